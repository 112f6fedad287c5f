/** An emulated EtherCAT segment: SubDevices of a plan that answer frames like real ones.
 *
 *  For development and tests. It contains no FSoE: devices on top of it, such as those of the
 * Python package, read outputs and write inputs. */
#ifndef FSN_SEGMENT_H
#define FSN_SEGMENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fsn/plan.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fsn_segment;

/** Counters of a segment; they only increase. */
struct fsn_segment_counts {
    uint64_t frames;    /**< EtherCAT frames answered */
    uint64_t datagrams; /**< datagrams in these frames */
    uint64_t lost;      /**< frames that were lost on purpose */
    uint64_t foreign;   /**< packets that were not a complete EtherCAT frame; they get no answer */
    uint64_t unsent;    /**< answers that the system refused to send */
    uint64_t work_ns;   /**< time spent on frames by the link thread */
    int send_errno;     /**< errno of the last refused answer; 0: none */
};

/** Builds the SubDevices of a plan, in ring order, all switched on and in INIT. Positions that the
 *  plan leaves free are couplers without process data. Groups follow all others, as on a junction:
 *  without them frames still pass. Of the groups of one place, the first is plugged in.
 *  @param[in]  plan     referenced until the segment is freed.
 *  @param[out] segment  to be freed by fsn_segment_free(); NULL on refusal.
 *  @retval FSN_E_ARG    plan or segment is missing.
 *  @retval FSN_E_NOMEM  out of memory.
 *  Context: set-up. Allocates. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_create(struct fsn_plan *plan,
                                                   struct fsn_segment **segment);

/** Stops a link and frees the segment; NULL is allowed. Context: set-up. */
FSN_API void fsn_segment_free(struct fsn_segment *segment);

/** Lets one Ethernet frame pass through the segment, in place.
 *  @param[in] now_ns  arrival time; any clock, never decreasing.
 *  @retval 0  no answer: not EtherCAT, malformed, lost, or no SubDevice is plugged in.
 *  @retval otherwise the length of the answer, the same as of the frame.
 *  Context: any thread. Locks. Cost: O(datagrams * SubDevices). */
FSN_API size_t fsn_segment_frame(struct fsn_segment *segment, uint8_t *frame, size_t len_bytes,
                                 uint64_t now_ns);

/** Cables the last SubDevice to a second port of the MainDevice, or removes that cable. While the
 *  ring is closed, a frame that enters at one end leaves at the other; only those from the first
 *  port are processed. At a gap frames turn round, and each half is processed by its own. Context:
 *  any thread. Locks. */
FSN_API void fsn_segment_set_ring(struct fsn_segment *segment, bool ring);

/** fsn_segment_frame() for either port of the MainDevice.
 *  @param[in]  port      0, or 1 in a ring; any other port gets no answer.
 *  @param[out] out_port  port where the answer leaves; may be NULL.
 *  Context: any thread. Locks. */
FSN_API size_t fsn_segment_frame_from(struct fsn_segment *segment, uint32_t port, uint8_t *frame,
                                      size_t len_bytes, uint64_t now_ns, uint32_t *out_port);

/** Runs events without a frame: watchdogs. Context: any thread. Locks. */
FSN_API void fsn_segment_idle(struct fsn_segment *segment, uint64_t now_ns);

/** SubDevices on the ring, including couplers at free positions. Context: any thread. */
FSN_API uint32_t fsn_segment_size(const struct fsn_segment *segment);

/** Ring position of a SubDevice of the plan; FSN_NONE: there is none. Context: any thread. */
FSN_API uint32_t fsn_segment_position(const struct fsn_segment *segment, uint32_t subdevice);

/** Newest outputs of a sync manager, as the device reads them: complete, or else the previous ones.
 *  @param[out] fresh  whether they are new since the last call; may be NULL.
 *  @retval FSN_E_ARG  unknown output, or another length.   Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_read_outputs(struct fsn_segment *segment, uint32_t sm,
                                                         uint8_t *buffer, size_t len_bytes,
                                                         bool *fresh);

/** Publishes inputs of a sync manager, all at once.
 *  @retval FSN_E_ARG  unknown input, or another length.   Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_write_inputs(struct fsn_segment *segment, uint32_t sm,
                                                         const uint8_t *buffer, size_t len_bytes);

/** AL status of the SubDevice at a ring position, error bit included, and its AL status code.
 *  @param[out] code   may be NULL.
 *  Returns 0 when there is none. Context: any thread. Locks. */
FSN_API uint8_t fsn_segment_al_status(struct fsn_segment *segment, uint32_t position,
                                      uint16_t *code);

/** Unplugs the SubDevice at a ring position, with all SubDevices after it unless it belongs to a
 *  group, or plugs it in again: it then starts as after power-on. No effect at a position that does
 *  not exist. Context: any thread. Locks. */
FSN_API void fsn_segment_set_present(struct fsn_segment *segment, uint32_t position, bool present);

/** Switches the SubDevice at a ring position off and on: its neighbours lose the link to it and
 *  find it again. No effect when it is unplugged. Context: any thread. Locks. */
FSN_API void fsn_segment_power_cycle(struct fsn_segment *segment, uint32_t position);

/** Cuts a cable, or repairs it; SubDevices on both sides keep their power and their state, and
 *  count a lost link.
 *  @param[in] position  of the SubDevice before the cable; FSN_NONE: the cable from the MainDevice
 *                       to the first SubDevice.
 *  @retval FSN_E_ARG    no such cable.
 *  Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_set_link(struct fsn_segment *segment, uint32_t position,
                                                     bool up);

/** Counts receive errors at a port, and forwarded errors in all SubDevices after it. The frames
 *  themselves are unchanged; to lose some, use fsn_segment_lose().
 *  @param[in] port      0: towards the MainDevice, 1: away from it.
 *  @retval FSN_E_ARG    no such SubDevice or port.
 *  Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_rx_errors(struct fsn_segment *segment,
                                                      uint32_t position, uint32_t port,
                                                      uint32_t errors);

/** Exchanges two SubDevices with their process data, as after a cabling mistake; both start as
 *  after power-on. All other functions still use their planned positions; a second swap restores
 *  them.
 *  @retval FSN_E_ARG    no such SubDevices, or the same twice.
 *  Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_swap(struct fsn_segment *segment, uint32_t one,
                                                 uint32_t other);

/** Identity that a SubDevice reports. */
struct fsn_segment_identity {
    uint32_t vendor_id, product_code, revision;
};

/** Lets a SubDevice report another identity, from the next time it is switched on.
 *  @param[in] identity  NULL: its own again.
 *  @retval FSN_E_ARG    no such SubDevice.
 *  Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_set_identity(
    struct fsn_segment *segment, uint32_t position, const struct fsn_segment_identity *identity);

/** Answers SDO transfers of an object with an abort code until the next call.
 *  @param[in] sub       0 … 255; FSN_NONE: all of the object.
 *  @param[in] code      0: no longer.
 *  @retval FSN_E_ARG    no such SubDevice, or no such subindex.
 *  @retval FSN_E_NOMEM  16 objects of it are aborted already.
 *  Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_set_sdo_abort(struct fsn_segment *segment,
                                                          uint32_t position, uint16_t index,
                                                          uint32_t sub, uint32_t code);

/** Sets the value of an object that CoE reads, now and after every power-on; an unknown object is
 *  added, read only.
 *  @retval FSN_E_ARG    no such SubDevice, more than 1024 bytes, or another length than before.
 *  Context: any thread. Locks; allocates when it adds. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_set_object(struct fsn_segment *segment,
                                                       uint32_t position, uint16_t index,
                                                       uint8_t sub, const void *bytes,
                                                       size_t len_bytes);

/** Sets an object like fsn_segment_set_object(); an added object can also be written by CoE.
 *  @retval FSN_E_ARG    as there.
 *  Context: any thread. Locks; allocates when it adds. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_offer_object(struct fsn_segment *segment,
                                                         uint32_t position, uint16_t index,
                                                         uint8_t sub, const void *bytes,
                                                         size_t len_bytes);

/** Reads the current value of an object: as set, or as written by CoE since then.
 *  @retval FSN_E_ARG    no such SubDevice or object, or another length; nothing was copied.
 *  Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_get_object(struct fsn_segment *segment,
                                                       uint32_t position, uint16_t index,
                                                       uint8_t sub, void *bytes, size_t len_bytes);

/** The distributed clock of a SubDevice. By default, clocks of a segment start at different times
 *  and differ by up to 50 ppm, and a frame takes 300 ns from one to the next. */
struct fsn_segment_clock {
    bool absent;         /**< there is no clock */
    bool deaf;           /**< its control loop does not work: it does not follow another clock */
    uint64_t offset_ns;  /**< lead of the clock over the time given with a frame */
    int32_t drift_ppb;   /**< rate error of a fast clock, in 1e-9; less than 0.1 % */
    uint32_t forward_ns; /**< delay of a frame from it to the next SubDevice */
};

/** Gives a SubDevice another clock; it restarts, its registers as after power-on. A device with
 *  SYNC0 goes to OP, and stays there, only where the time of a reference clock reaches it (AL
 *  status code 0x002C), SYNC0 was given a start that was still to come (0x002D), and most outputs
 *  come an eighth of its cycle away from the pulses at least (0x001A).
 *  @retval FSN_E_ARG    no such SubDevice, or no clock runs so fast.
 *  Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_set_clock(struct fsn_segment *segment,
                                                      uint32_t position,
                                                      const struct fsn_segment_clock *clock);

/** Gives the times of a SubDevice's clock 32 or 64 bits; the default is 64. With 32 bits the upper
 *  halves of system time, offset and start time are zero. A SYNC0 whose start has passed then
 *  begins when the time wraps around, after at most 4.29 s.
 *  @retval FSN_E_ARG    no such SubDevice, or another number of bits.
 *  Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_set_clock_bits(struct fsn_segment *segment,
                                                           uint32_t position, uint32_t bits);

/** Gets the time of the next SYNC0 pulse of a SubDevice.
 *  @param[out] time_ns  in the time passed with the last frame.
 *  @retval FSN_E_ARG    no such SubDevice, or a null pointer.
 *  @retval FSN_E_STATE  SYNC0 is off, or its start has passed.
 *  Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_next_pulse(struct fsn_segment *segment,
                                                       uint32_t position, uint64_t *time_ns);

/** Delays mailbox answers; 0: no delay. At most an hour, like all delays here.
 *  @retval FSN_E_ARG    unknown SubDevice.   Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_set_mailbox_delay(struct fsn_segment *segment,
                                                              uint32_t position, uint64_t delay_ns);

/** Delays AL state transitions; 0: no delay.
 *  @retval FSN_E_ARG    unknown SubDevice.   Context: any thread. Locks. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_set_al_delay(struct fsn_segment *segment,
                                                         uint32_t position, uint64_t delay_ns);

/** Loses the next frames on purpose. Context: any thread. Locks. */
FSN_API void fsn_segment_lose(struct fsn_segment *segment, uint32_t frames);

/** Loses every n-th frame from now on; 0: none. Context: any thread. Locks. */
FSN_API void fsn_segment_lose_every(struct fsn_segment *segment, uint32_t frames);

/** Puts a frame on the wire to the segment, where delay, stall and repetition apply. It holds 1024
 *  frames; further frames are lost and counted.
 *  @param[in] port  of the MainDevice: 0, or 1 in a ring.
 *  Context: any thread. Locks. */
FSN_API void fsn_segment_send(struct fsn_segment *segment, uint32_t port, const uint8_t *frame,
                              size_t len_bytes, uint64_t now_ns);

/** Takes the next answer that has returned by now.
 *  @param[out] frame  at least 1536 bytes.
 *  @param[out] port where it left; may be NULL.
 *  @retval 0  there is none, or too little room.
 *  Context: any thread. Locks. */
FSN_API size_t fsn_segment_receive(struct fsn_segment *segment, uint8_t *frame, size_t room_bytes,
                                   uint64_t now_ns, uint32_t *port);

/** Time until the next frame on the wire is due; UINT64_MAX if there is none. Context: any thread.
 *  Locks. */
FSN_API uint64_t fsn_segment_wait(struct fsn_segment *segment, uint64_t now_ns);

/** Delays frames on the wire by this time; their order is unchanged. Context: any thread. Locks. */
FSN_API void fsn_segment_set_delay(struct fsn_segment *segment, uint64_t delay_ns);

/** Holds all frames for a time; those on the wire are delivered afterwards, all at once. Context:
 *  any thread. Locks. */
FSN_API void fsn_segment_stall(struct fsn_segment *segment, uint64_t duration_ns);

/** Holds the next answer, and repeats it after each of this number of further ones, as an old
 *  frame. Context: any thread. Locks. */
FSN_API void fsn_segment_repeat(struct fsn_segment *segment, uint32_t frames);

/** Context: any thread. Locks. */
FSN_API void fsn_segment_counts(struct fsn_segment *segment, struct fsn_segment_counts *counts);

/** Options of the link. Zero is a valid value for every field except interface. */
struct fsn_segment_link_options {
    const char *interface;  /**< of the first port */
    const char *interface2; /**< of the second port, which makes it a ring; NULL: none */
    int priority;           /**< SCHED_FIFO priority 1 … 99; 0 keeps the normal scheduler */
    int cpu;                /**< CPU number + 1 to pin the thread; 0 leaves it free */
    /** Also accepts interfaces that are not veth or tap: a person guarantees that no machine is
     *  connected to them. No effect unless fsn_segment_test_rig(). */
    bool no_machine_on_this_wire;
};

/** Whether this library was built with FSN_TEST_RIG, for test rigs: only then may it answer on a
 *  real network interface. Context: any thread. */
FSN_API bool fsn_segment_test_rig(void);

/** Answers on one or two network interfaces, in a separate thread, until fsn_segment_unlink(). Only
 *  veth and tap interfaces are accepted: an emulated SubDevice with a valid FSoE address must never
 *  reach a real machine. fsn_segment_test_rig() is the one exception.
 *  @param[in]  options    copied.
 *  @param[out] sys_errno  of the system, with FSN_E_SYS; may be NULL.
 *  @retval FSN_E_ARG      not a virtual interface.
 *  @retval FSN_E_STATE    linked already.
 *  @retval FSN_E_SYS      a system call failed: ENODEV without such an interface, EADDRINUSE when
 *                         another segment answers on it, EMSGSIZE for an MTU below 1500; EPERM for
 *                         a missing CAP_NET_RAW, or CAP_SYS_NICE for the priority; EINVAL for
 *                         a priority or CPU that does not exist.
 *  Context: set-up. */
FSN_API FSN_MUST_USE fsn_status fsn_segment_link(struct fsn_segment *segment,
                                                 const struct fsn_segment_link_options *options,
                                                 int *sys_errno);

/** Ends the link; idempotent. Context: set-up. */
FSN_API void fsn_segment_unlink(struct fsn_segment *segment);

#ifdef __cplusplus
}
#endif

#endif
