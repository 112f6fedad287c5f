/** A real-time client of fsn-master: it reads the inputs of every cycle, and writes outputs of its
 *  own that are sent with the next frame. For motion controllers and other non-safety programs.
 *
 *  The master stays part of the black channel: the data of a client reaches only the outputs that
 *  it owns. It never reaches an FSoE frame, a copy, an output of another writer, or an output that
 *  can restart a machine. No function here is a safety function.
 *
 *      struct fsn_realtime_options options = {.socket = "/run/fsn-master-eth1.sock"};
 *      ...
 *      while (fsn_realtime_wait(rt, 100000000, &cycle) == FSN_OK) {
 *          fsn_realtime_set_value(rt, target, control(fsn_realtime_value(rt, actual)));
 *          fsn_realtime_send(rt);
 *      }
 *
 *  Needs libc and Linux only. Usable from C++. One thread at a time for each struct fsn_realtime.
 */
#ifndef FSN_CLIENT_H
#define FSN_CLIENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fsn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fsn_realtime;

enum { FSN_REALTIME_NONE = -1, FSN_REALTIME_TEXT_BYTES = 512 };

/** Options of a client. Zero is a valid value for every field except `socket`. */
struct fsn_realtime_options {
    const char *socket;         /**< control socket of fsn-master */
    const char *plan_sha256;    /**< required plan, 64 hex digits; NULL: any */
    const char *const *outputs; /**< names of outputs to write; a final * matches any ending */
    size_t output_count;        /**< 0: the client only reads */
    /** Permitted consecutive cycles without new outputs, 0 … 1000. After one more the outputs take
     *  their stop values, and the client must open again. */
    uint32_t misses;
    uint32_t timeout_ms; /**< for the answer of fsn-master; 0: 5000 */
};

/** Reason of a refusal. */
struct fsn_realtime_fault {
    fsn_status status;
    int sys_errno;                      /**< with FSN_E_SYS */
    char text[FSN_REALTIME_TEXT_BYTES]; /**< in words, with the next step if there is one */
};

/** A value of the process image. */
struct fsn_realtime_symbol {
    const char *name;      /**< valid while the client is open */
    const char *subdevice; /**< the same, for its SubDevice */
    double factor,
        offset; /**< input: factor * raw + offset; raw of an output: factor * value + offset */
    uint64_t stop_value; /**< raw; for an output */
    uint32_t bit_offset; /**< in fsn_realtime_image() */
    uint32_t bits;       /**< 1 … 64; 0: not in the image */
    uint16_t index;      /**< of the object; 0: a part of an object */
    uint8_t subindex;    /**< same */
    uint8_t kind;        /**< enum fsn_kind of <fsn/plan.h> */
    bool output;         /**< from the view of the MainDevice */
    bool owned;          /**< this client writes it */
};

/** One cycle. */
struct fsn_realtime_cycle {
    uint64_t cycle;      /**< its number; 1 is the first since the bus was opened */
    uint64_t now_ns;     /**< its start, CLOCK_MONOTONIC */
    uint64_t next_ns;    /**< earliest start of the next one, which sends outputs set before */
    uint64_t dc_time_ns; /**< last reading of the DC reference clock; 0 if there is none */
    uint64_t skipped;    /**< cycles that this client missed since the previous one */
    uint64_t overruns;   /**< cycles that the master has skipped so far */
    uint32_t expected_wkc, actual_wkc; /**< if they differ, some inputs are from an earlier cycle */
};

/** Counters of the master for this client; they only increase. */
struct fsn_realtime_counts {
    uint64_t on_time; /**< outputs sent with the frame after the inputs that they answer */
    uint64_t late;    /**< outputs sent with a later frame */
    uint64_t missed;  /**< cycles without new outputs, since the first ones */
    uint64_t torn;    /**< cycles in which the outputs were being written at every attempt */
};

/** Connects, and maps the memory.
 *  @param[out] realtime  to be closed by fsn_realtime_close(); NULL on refusal.
 *  @param[out] fault     may be NULL.
 *  @retval FSN_E_ARG     unknown output, another plan or another layout of the memory: see `text`.
 *  @retval FSN_E_CLOSED  an output is not for this client, or the role is below operator.
 *  @retval FSN_E_STATE   the bus is stopped.
 *  @retval FSN_E_BUSY    too many clients, or no answer.
 *  @retval FSN_E_SYS     no fsn-master listens on the socket.
 *  @retval FSN_E_NOMEM   out of memory.
 *  Context: set-up. Allocates and waits. */
FSN_API FSN_MUST_USE fsn_status fsn_realtime_open(const struct fsn_realtime_options *options,
                                                  struct fsn_realtime **realtime,
                                                  struct fsn_realtime_fault *fault);

/** Disconnects; its outputs take their stop values. NULL is allowed. Context: set-up. */
FSN_API void fsn_realtime_close(struct fsn_realtime *realtime);

/** Number of an input, or FSN_REALTIME_NONE. An output of the same name is another symbol: the
 *  target of an axis is never taken for its actual value.
 *  Context: set-up; compares names one by one. */
FSN_API int32_t fsn_realtime_input(const struct fsn_realtime *realtime, const char *name);

/** Number of an output, or FSN_REALTIME_NONE. Context: set-up; compares names one by one. */
FSN_API int32_t fsn_realtime_output(const struct fsn_realtime *realtime, const char *name);

/** Number of symbols: valid numbers are 0 to this - 1. Context: any. */
FSN_API uint32_t fsn_realtime_symbol_count(const struct fsn_realtime *realtime);

/** Describes a symbol.   @retval FSN_E_ARG  unknown symbol.   Context: any. */
FSN_API FSN_MUST_USE fsn_status fsn_realtime_symbol(const struct fsn_realtime *realtime,
                                                    uint32_t symbol,
                                                    struct fsn_realtime_symbol *info);

/** Waits for the next cycle that this client has not seen, and takes its inputs.
 *  @param[in]  timeout_ns  longest wait.
 *  @param[out] cycle       may be NULL; filled with FSN_OK and FSN_E_CLOSED.
 *  @retval FSN_E_BUSY    no cycle within that time.
 *  @retval FSN_E_STATE   the bus was stopped, or fsn-master has ended: open again.
 *  @retval FSN_E_CLOSED  a cycle is available, but the outputs were revoked: open again.
 *  Context: thread of the client. Sleeps until the planned start of the next cycle and its time for
 *  sending, then in steps of 1/64 cycle (2 … 100 us). The kernel wakes a thread that is not
 *  real-time up to 50 us late, unless prctl(PR_SET_TIMERSLACK, 1) is set. */
FSN_API FSN_MUST_USE fsn_status fsn_realtime_wait(struct fsn_realtime *realtime,
                                                  uint64_t timeout_ns,
                                                  struct fsn_realtime_cycle *cycle);

/** Raw value in the current cycle, zero-extended; 0 for an unknown symbol. Context: thread of the
 *  client. RT-safe: no allocation, lock or system call. */
FSN_API uint64_t fsn_realtime_get(const struct fsn_realtime *realtime, int32_t symbol);

/** The same as a number, with sign, factor and offset.
 *  Context: RT-safe. */
FSN_API double fsn_realtime_value(const struct fsn_realtime *realtime, int32_t symbol);

/** Stores the raw value of an output for fsn_realtime_send(); its low bits are used.
 *  @retval FSN_E_CLOSED  not an output of this client.
 *  Context: RT-safe. */
FSN_API FSN_MUST_USE fsn_status fsn_realtime_set(struct fsn_realtime *realtime, int32_t symbol,
                                                 uint64_t raw);

/** The same for a number: factor and offset apply. The value is rounded to the nearest integer,
 *  unless the type is floating point.
 *  @retval FSN_E_CLOSED  not an output of this client.
 *  @retval FSN_E_ARG     out of the range of its type, or NaN; the output keeps its value.
 *  Context: RT-safe. */
FSN_API FSN_MUST_USE fsn_status fsn_realtime_set_value(struct fsn_realtime *realtime,
                                                       int32_t symbol, double value);

/** Sends all outputs of this client together, with their last stored values. Outputs that were
 *  never stored have their stop values. They answer the current cycle. Context: RT-safe. */
FSN_API void fsn_realtime_send(struct fsn_realtime *realtime);

/** Counters of the master. All are 0 for a client without outputs.
 *  Context: RT-safe. */
FSN_API struct fsn_realtime_counts fsn_realtime_counts(const struct fsn_realtime *realtime);

/** The process image in the current cycle: inputs as received, outputs as sent. Context:
 *  RT-safe. */
FSN_API const uint8_t *fsn_realtime_image(const struct fsn_realtime *realtime);

/** Its length, bytes.
 *  Context: any. */
FSN_API uint32_t fsn_realtime_image_bytes(const struct fsn_realtime *realtime);

/** Bus cycle of the plan, nanoseconds.
 *  Context: any. */
FSN_API uint64_t fsn_realtime_cycle_ns(const struct fsn_realtime *realtime);

#ifdef __cplusplus
}
#endif

#endif
