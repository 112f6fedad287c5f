/** An axis by CiA 402 (IEC 61800-7-201, ETG.6010), as its MainDevice drives it: the state machine
 *  of controlword and statusword, modes, set-points and homing.
 *
 *  The first part is pure: no socket, no clock, no memory of its own. fsn_axis_step() takes the
 *  received data and computes the data to send. Any MainDevice can use it. The second part binds it
 *  to a real-time client of fsn-master (<fsn/client.h>).
 *
 *      if (axis.enabled) {
 *          status = fsn_axis_set_position(&axis, axis.outputs.position + step);
 *      }
 *      fsn_axis_step(&axis, &inputs);       // then send axis.outputs
 *
 *  - No axis jumps: as long as the targets of the program are not in effect, the target position is
 *    the actual position, and target velocity and torque are 0.
 *  - No automatic restart: after a stop of any kind, including a fault, the program has to request
 *    operation.
 *  - A drive that stops by itself, as with STO, SS1 or SS2, is not in fault. The axis detects this
 *    from statusword and standard process data, never from FSoE frames. It is an observation and
 *    not a safety function: only the safety functions of the drive determine what it prevents.
 *
 *  Positions, velocities and torques are numbers of the drive, in its own units. Needs libc only.
 *  Usable from C++. One thread at a time for each axis.
 */
#ifndef FSN_AXIS_H
#define FSN_AXIS_H

#include <stdbool.h>
#include <stdint.h>

#include "fsn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Modes of operation, with the values of 0x6060. */
enum fsn_axis_mode {
    FSN_AXIS_PP = 1,   /**< profile position */
    FSN_AXIS_PV = 3,   /**< profile velocity */
    FSN_AXIS_HM = 6,   /**< homing */
    FSN_AXIS_CSP = 8,  /**< cyclic synchronous position */
    FSN_AXIS_CSV = 9,  /**< cyclic synchronous velocity */
    FSN_AXIS_CST = 10, /**< cyclic synchronous torque */
};

/** States of the drive (IEC 61800-7-201, table of statusword bits 0 to 3, 5 and 6). */
enum fsn_axis_state {
    FSN_AXIS_NOT_READY,
    FSN_AXIS_SWITCH_ON_DISABLED,
    FSN_AXIS_READY_TO_SWITCH_ON,
    FSN_AXIS_SWITCHED_ON,
    FSN_AXIS_OPERATION_ENABLED,
    FSN_AXIS_QUICK_STOP_ACTIVE,
    FSN_AXIS_FAULT_REACTION_ACTIVE,
    FSN_AXIS_FAULT,
    FSN_AXIS_NO_STATE, /**< these bits match no state */
};

/** State of the axis between its program and its drive. */
enum fsn_axis_phase {
    FSN_AXIS_OFF,      /**< not requested, no fault */
    FSN_AXIS_ENABLING, /**< changing to Operation enabled */
    FSN_AXIS_ENABLED,
    FSN_AXIS_STOPPING, /**< disable or quick stop was requested; includes Quick stop active */
    FSN_AXIS_STOPPED_BY_DRIVE, /**< the drive stops by itself, as with SS1 or SS2: expected */
    FSN_AXIS_TORQUE_OFF,       /**< the drive removed the torque by itself, as with STO: expected */
    FSN_AXIS_FAULTED,          /**< the drive reports a fault: fsn_axis_reset() */
    FSN_AXIS_RESETTING,        /**< the fault is being reset */
    FSN_AXIS_NO_ANSWER,        /**< the drive did not follow a request in time */
    FSN_AXIS_BAD_STATUSWORD,   /**< its bits match no state; the axis was stopped */
};

/** Result of the last set-point (PP) or homing. */
enum fsn_axis_job {
    FSN_AXIS_JOB_NONE,
    FSN_AXIS_JOB_WAITING, /**< not yet accepted by the drive */
    FSN_AXIS_JOB_RUNNING,
    FSN_AXIS_JOB_DONE,   /**< target reached, homing completed */
    FSN_AXIS_JOB_FAILED, /**< rejected, ended with an error, or interrupted */
};

/** Parameters of an axis, set by the program. A limit of 0 disables the modes that use it. */
struct fsn_axis_config {
    uint32_t max_step;     /**< CSP: largest change of the target in one step, position units */
    uint32_t max_velocity; /**< CSV, PV: largest target, in both directions */
    uint32_t answer_ms;  /**< for a change of state, a mode or a set-point; longer than the drive's
                              ramps; 0: 3000 */
    uint16_t max_torque; /**< CST: largest target, in both directions */
    uint16_t modes;      /**< 1 << mode, for each mode of the drive; 0: all */
    int8_t mode;         /**< initial enum fsn_axis_mode */
};

/** Data received in a cycle. */
struct fsn_axis_inputs {
    uint64_t now_ns;     /**< monotonic, for answer_ms; never decreasing */
    uint16_t statusword; /**< 0x6041 */
    int8_t mode;         /**< 0x6061; if not mapped, the mode the drive was started with */
    bool torque_off;     /**< a vendor-specific bit reports that STO is active; else false */
    int32_t position;    /**< 0x6064 */
    int32_t velocity;    /**< 0x606C; for the program */
    int16_t torque;      /**< 0x6077; for the program */
};

/** Data to send. */
struct fsn_axis_outputs {
    uint16_t controlword; /**< 0x6040 */
    int8_t mode;          /**< 0x6060 */
    int32_t position;     /**< 0x607A */
    int32_t velocity;     /**< 0x60FF */
    int16_t torque;       /**< 0x6071 */
};

/** Private; only the functions below use it. */
struct fsn_axis_own {
    uint64_t since_ns, mode_ns, job_ns, low_ns;
    int32_t wanted_position, wanted_velocity;
    uint16_t learned;
    int16_t wanted_torque;
    uint8_t goal, highest;
    bool started, settled, followed, follows, halted, has_position, start, at_once, fresh, resets;
};

/** An axis. The program reads it, and changes it only through the functions below. */
struct fsn_axis {
    struct fsn_axis_config config;
    struct fsn_axis_inputs inputs;   /**< of the last step */
    struct fsn_axis_outputs outputs; /**< of the last step */
    uint8_t state;                   /**< enum fsn_axis_state */
    uint8_t phase;                   /**< enum fsn_axis_phase */
    uint8_t job;                     /**< enum fsn_axis_job */
    bool enabled; /**< targets are in effect: Operation enabled, mode confirmed */
    bool halted;
    bool limited; /**< the drive limits the motion (bit 11), as with SLS or at its own limits */
    bool reached; /**< target reached (bit 10) */
    struct fsn_axis_own own;
};

/** Initialises an axis that is off; until the first step its outputs are 0, except the mode.
 *  @retval FSN_E_ARG  unknown mode, or its limit is 0.
 *  Context: set-up. */
FSN_API FSN_MUST_USE fsn_status fsn_axis_init(struct fsn_axis *axis,
                                              const struct fsn_axis_config *config);

/** One cycle: takes the received data and computes `axis->outputs`. Call it once in each bus cycle.
 *  Context: RT-safe: no allocation, lock or system call. Cost: constant. */
FSN_API void fsn_axis_step(struct fsn_axis *axis, const struct fsn_axis_inputs *inputs);

/** Requests Operation enabled, from any state of the drive. `axis->enabled` is set when the targets
 *  of the program are in effect. This also continues an axis that its drive stopped in Operation
 *  enabled, from its present position.
 *  @retval FSN_E_STATE  a fault: reset it first. Quick stop active: disable first, which removes
 *                       the torque. The drive reports STO, still stops by itself, or shows an
 *                       invalid state.
 *  Context: RT-safe. */
FSN_API FSN_MUST_USE fsn_status fsn_axis_enable(struct fsn_axis *axis);

/** Requests Ready to switch on: the drive slows down as set in its object 0x605C, then removes the
 *  torque. A drive that stays in Operation enabled gets Disable voltage after `answer_ms`. From
 *  Quick stop active: Disable voltage at once.
 *  Context: RT-safe. */
FSN_API void fsn_axis_disable(struct fsn_axis *axis);

/** Requests Quick stop: the drive slows down as set in its object 0x605A. Not an emergency stop. An
 *  axis that is not in Operation enabled is disabled.
 *  Context: RT-safe. */
FSN_API void fsn_axis_quick_stop(struct fsn_axis *axis);

/** Resets a fault: one rising edge of bit 7, held until the drive leaves Fault, or for `answer_ms`.
 *  The axis is off afterwards.
 *  @retval FSN_E_STATE  no fault, or a reset is in progress.
 *  Context: RT-safe. */
FSN_API FSN_MUST_USE fsn_status fsn_axis_reset(struct fsn_axis *axis);

/** Halts or continues (bit 8). In CSP the target stays. In CSV, PV and CST it is 0 until the
 *  program sets another. In PP the motion continues afterwards. In homing the drive decides.
 *  fsn_axis_enable() also ends a halt.
 *  Context: RT-safe. */
FSN_API void fsn_axis_halt(struct fsn_axis *axis, bool halts);

/** Requests another mode. Until the drive confirms it, targets are those of an axis that is off. A
 *  set-point or homing in progress is interrupted.
 *  @retval FSN_E_ARG  unknown mode, the drive does not support it, or its limit is 0.
 *  Context: RT-safe. */
FSN_API FSN_MUST_USE fsn_status fsn_axis_set_mode(struct fsn_axis *axis, int8_t mode);

/** CSP: target of the next step and of all later steps until the next call. A step larger than
 *  `max_step` from the previous target is rejected, not shortened: the drive would follow a program
 *  with a wrong position at full speed. The target then stays. Cycles that the program missed do
 *  not allow a larger step, since the drive gets it in one cycle.
 *  @retval FSN_E_STATE  not enabled in CSP, or halted.   @retval FSN_E_ARG  too large a step.
 *  Context: RT-safe. */
FSN_API FSN_MUST_USE fsn_status fsn_axis_set_position(struct fsn_axis *axis, int32_t position);

/** CSV, PV: target from the next step on.
 *  @retval FSN_E_STATE  not enabled in CSV or PV, or halted.
 *  @retval FSN_E_ARG    beyond `max_velocity`; the target stays.
 *  Context: RT-safe. */
FSN_API FSN_MUST_USE fsn_status fsn_axis_set_velocity(struct fsn_axis *axis, int32_t velocity);

/** CST: target from the next step on.
 *  @retval FSN_E_STATE  not enabled in CST, or halted.
 *  @retval FSN_E_ARG    beyond `max_torque`; the target stays.
 *  Context: RT-safe. */
FSN_API FSN_MUST_USE fsn_status fsn_axis_set_torque(struct fsn_axis *axis, int16_t torque);

/** PP: an absolute set-point, offered to the drive with the next step by bit 4 and accepted by its
 *  bit 12. `axis->job` holds the result.
 *  @param[in] at_once  true: the drive drops its present set-point; false: it completes that first.
 *  @retval FSN_E_STATE  not enabled in PP, or halted.
 *  @retval FSN_E_BUSY   the drive has not yet accepted the previous set-point.
 *  Context: RT-safe. */
FSN_API FSN_MUST_USE fsn_status fsn_axis_move(struct fsn_axis *axis, int32_t position,
                                              bool at_once);

/** HM: starts homing by the method in the drive's object 0x6098. `axis->job` holds the result. Bits
 *  of an earlier homing that the drive still shows are ignored for 100 ms.
 *  @retval FSN_E_STATE  not enabled in HM, or halted.   @retval FSN_E_BUSY  it runs.
 *  Context: RT-safe. */
FSN_API FSN_MUST_USE fsn_status fsn_axis_home(struct fsn_axis *axis);

/** Decodes the state from these bits.   Context: any thread. */
FSN_API enum fsn_axis_state fsn_axis_state_of(uint16_t statusword);

/** Texts for messages, such as "operation enabled", "torque off", "csp"; "?" for an unknown number.
 *  Context: any thread. */
FSN_API const char *fsn_axis_state_name(uint32_t state);
FSN_API const char *fsn_axis_phase_name(uint32_t phase);
FSN_API const char *fsn_axis_mode_name(int32_t mode);

/* -- in the cycle of fsn-master ---------------------------------------------------------------- */

struct fsn_realtime;
struct fsn_realtime_cycle;
struct fsn_realtime_fault;

/** Selects an axis and its symbols. */
struct fsn_axis_options {
    const char *subdevice; /**< its name in the network file */
    uint32_t number;       /**< the objects of axis n are 0x800 * n higher; 0 … 7 */
    struct fsn_axis_config config;
    /** Symbol with a bit of the drive that reports STO active, such as its statusword; NULL if
     *  there is none. FSoE frames have no symbols. */
    const char *torque_off;
    uint64_t torque_off_mask; /**< this bit of it, or one of several */
    bool torque_off_low;      /**< active low: the bit is 0 while STO is active */
};

/** Numbers of symbols, FSN_REALTIME_NONE where an object is not mapped. */
struct fsn_axis_symbols {
    int32_t statusword, mode_display, actual_position, actual_velocity, actual_torque, torque_off;
    int32_t controlword, mode, target_position, target_velocity, target_torque;
};

/** An axis of a real-time client. */
struct fsn_realtime_axis {
    struct fsn_axis axis;
    struct fsn_axis_symbols symbols;
    uint64_t torque_off_mask;
    bool torque_off_low;
};

/** Finds the objects of an axis in the process image. Requires 0x6040, 0x6041, 0x6064 with 0x607A,
 *  0x6061 with 0x6060, and those of the mode. This client must own their outputs. Modes without
 *  their objects are disabled.
 *  @param[out] fault  may be NULL.
 *  @retval FSN_E_ARG     unknown SubDevice or axis, or an object is missing or has another size.
 *  @retval FSN_E_CLOSED  this client does not own an output of the axis.
 *  Context: set-up; compares names one by one. */
FSN_API FSN_MUST_USE fsn_status fsn_realtime_axis_open(const struct fsn_realtime *realtime,
                                                       const struct fsn_axis_options *options,
                                                       struct fsn_realtime_axis *axis,
                                                       struct fsn_realtime_fault *fault);

/** One cycle of an axis: reads the inputs of the last cycle waited for, calls fsn_axis_step(), and
 *  stores the outputs for fsn_realtime_send().
 *  @param[in] cycle  of fsn_realtime_wait().
 *  Context: RT-safe: no allocation, lock or system call. */
FSN_API void fsn_realtime_axis_step(struct fsn_realtime_axis *axis, struct fsn_realtime *realtime,
                                    const struct fsn_realtime_cycle *cycle);

#ifdef __cplusplus
}
#endif

#endif
