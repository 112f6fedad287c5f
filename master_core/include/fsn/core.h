/** The core: activates a plan on a bus, then copies in every cycle. */
#ifndef FSN_CORE_H
#define FSN_CORE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fsn/bus.h"
#include "fsn/monitor.h"
#include "fsn/plan.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fsn_core;

enum { FSN_OCTAVE = 64, FSN_BUCKETS = 28 * FSN_OCTAVE };

/** Times. Bucket n < 64 counts n ns. Above, 64 buckets share an octave: bucket 64 * (e - 5) + s
 *  counts times from (64 + s) * 2^(e-6) ns on; the last one counts all above 8.5 s. Therefore no
 *  bucket is wider than 1.6 % of its times. */
struct fsn_histogram {
    uint64_t count, sum_ns;
    uint64_t min_ns, max_ns; /**< 0 if there are none */
    uint32_t bucket[FSN_BUCKETS];
};

/** Counters of the cyclic thread; they only increase. */
struct fsn_statistics {
    uint64_t cycles;                /**< bus cycles run */
    uint64_t overruns;              /**< cycles skipped because of a late wake-up */
    uint64_t wkc_errors;            /**< cycles with an incomplete working counter */
    struct fsn_frame_counts counts; /**< of frames */
    uint64_t bytes_copied;          /**< bytes moved by copies */
    uint64_t now_ns;                /**< start of the last cycle, monotonic */
    uint64_t dc_time_ns;    /**< last reading of the DC reference clock; 0 if there is none */
    uint64_t events_lost;   /**< events dropped because the ring was full */
    uint32_t expected_wkc;  /**< of the last cycle */
    uint32_t actual_wkc;    /**< of the last cycle */
    uint32_t copies;        /**< copies of the plan */
    uint32_t merged_copies; /**< copies executed after merging neighbours */
    uint32_t realtime;      /**< 1 if the thread has its real-time priority */
    uint32_t send_errno;    /**< errno of the last frame that could not be sent; 0: none */
    uint32_t locked;        /**< 1 if the memory of the process is locked */
    /* Of the cyclic thread only; empty in virtual time. */
    struct fsn_histogram latency;    /**< delay of wake-ups */
    struct fsn_histogram period;     /**< from the start of one cycle to the next */
    struct fsn_histogram work;       /**< from the wake-up to the end of send() */
    struct fsn_histogram copy;       /**< the copies alone */
    struct fsn_histogram round_trip; /**< from send() to the last reply, if the bus reports it */
    struct fsn_histogram dc_offset;  /**< distance from the required lead before SYNC0 */
};

/** One change of state. */
struct fsn_event {
    uint64_t now_ns;       /**< start of the cycle in which it was detected, nanoseconds */
    uint32_t connection;   /**< its number in the plan */
    uint8_t before, after; /**< enum fsn_observed */
    uint8_t reset_code;    /**< if `after` is a reset: reset code of the end that began it */
    uint8_t by; /**< if `after` is a reset: the end that began it, enum fsn_way + 1, or 0 */
    /** If `before` equals `after`: the parameters began to differ from the plan, or match it again.
     *  `differs` has the bits of fsn_connection_status, `parameters` is the observation. */
    uint8_t differs;
    struct fsn_parameters parameters;
};

/** One cycle, as stored by the recorder. */
struct fsn_cycle {
    uint64_t cycle;         /**< its number: 1 for the first; fsn_statistics.cycles after it */
    uint64_t now_ns;        /**< its start, monotonic */
    uint64_t dc_time_ns;    /**< DC reference clock in its reply; 0 if there is none */
    uint32_t late_ns;       /**< wake-up delay; this and the next two saturate at 2^32 - 1 */
    uint32_t work_ns;       /**< from the wake-up to the end of send() */
    uint32_t round_trip_ns; /**< from send() to the last reply; 0 if unknown to the bus */
    struct fsn_frame_counts counts; /**< of this cycle */
    uint32_t expected_wkc;          /**< over all datagrams */
    uint32_t actual_wkc;            /**< over all datagrams */
    uint32_t overruns; /**< cycles skipped before this one because of its late wake-up */
};

/** Options of the cyclic thread. Zero is a valid value for every field except cycle_ns. */
struct fsn_thread_options {
    uint64_t cycle_ns;    /**< bus cycle, 1 000 … 4 000 000 000 ns; 0: that of the plan */
    int priority;         /**< SCHED_FIFO priority 1 … 99; 0 keeps the normal scheduler */
    int cpu;              /**< CPU number + 1 to pin the thread; 0 leaves it free */
    bool lock_memory;     /**< mlockall(MCL_CURRENT | MCL_FUTURE) before the first cycle */
    bool free_run;        /**< no waiting: the next cycle begins when the bus has answered */
    bool follow_dc;       /**< whether wake-ups keep their phase to the DC reference clock */
    uint64_t dc_shift_ns; /**< how long before SYNC0, a multiple of the cycle on the DC reference
                               clock, frames reach that clock; 0 takes half a cycle */
    bool trace; /**< writes markers into the kernel's trace buffer; see fsn_core_start() */
};

/** Activates a plan on a bus: gets the layout of the bus, resolves every copy to absolute bytes,
 *  proves bounds, direction, disjoint destinations and one datagram per copy, merges neighbours.
 *  Afterwards the copies are immutable.
 *  @param[in]  plan   held until the core is freed.
 *  @param[in]  ops, bus  must outlive the core; an emulated bus keeps a reference itself.
 *                     ops->close is called by fsn_core_free(), and on a refusal after ops->open.
 *  @param[out] core   to be freed by fsn_core_free(); NULL on refusal.
 *  @param[out] fault  names the copy or sync manager and the rule; may be NULL.
 *  @retval FSN_E_ARG           plan, ops or one of open, receive and send is missing.
 *  @retval FSN_E_NOMEM         out of memory.
 *  @retval FSN_E_BUS_IMAGE     a sync manager or datagram lies outside the image.
 *  @retval FSN_E_BUS_OVERLAP   two sync managers share bytes, such as inputs laid over outputs.
 *  @retval FSN_E_BUS_STRADDLE  a copy would be split over two datagrams.
 *  @retval FSN_E_COPY_…        a rule of the plan format does not hold on this bus.
 *  @retval others              what ops->open returned.
 *  After any refusal nothing runs and no byte was moved.
 *  Context: set-up. Allocates. */
FSN_API FSN_MUST_USE fsn_status fsn_core_create(const struct fsn_plan *plan,
                                                const struct fsn_bus_ops *ops, void *bus,
                                                struct fsn_core **core, struct fsn_fault *fault);

/** Stops the thread if it runs and frees the core; NULL is allowed. Context: set-up. */
FSN_API void fsn_core_free(struct fsn_core *core);

/** Runs one bus cycle: receive, copies, application outputs, send; then counts and monitor, which
 *  come before send if fsn_core_show_first() is set.
 *  @param[in] now_ns  monotonic start of the cycle, nanoseconds; any clock, never decreasing.
 *  @retval FSN_E_ARG    no core.
 *  @retval FSN_E_STATE  the thread runs; no byte was moved.
 *  Context: the caller's cyclic thread. RT-safe: no allocation, lock or system call.
 *  Cost: O(copies + connections). */
FSN_API FSN_MUST_USE fsn_status fsn_core_cycle(struct fsn_core *core, uint64_t now_ns);

/** Starts the cyclic thread: cycles at absolute times of CLOCK_MONOTONIC, missed ones are counted
 *  and skipped.
 *  @param[in]  options  copied.
 *  @param[out] fault    may be NULL.
 *  @retval FSN_E_STATE  already running.   @retval FSN_E_ARG  cycle time is missing or out of
 *      range.
 *  @retval FSN_E_SYS    the thread could not be created or memory not locked; see sys_errno.
 *  A refused real-time priority is not an error: fsn_statistics.realtime stays 0. With `trace` each
 *  cycle writes "fsn: cycle begins" and "fsn: cycle ends", and overruns "fsn: overrun", to
 *  /sys/kernel/tracing/trace_marker: a system call, for measurements only.
 *  Context: set-up. */
FSN_API FSN_MUST_USE fsn_status fsn_core_start(struct fsn_core *core,
                                               const struct fsn_thread_options *options,
                                               struct fsn_fault *fault);

/** Smallest time that bucket `bucket` counts, nanoseconds. Context: any thread. */
FSN_API uint64_t fsn_histogram_floor(uint32_t bucket);

/** Time that a share of all times does not exceed, nanoseconds: the upper end of its bucket, at
 *  most the greatest time; 0 if there are none.
 *  @param[in] per_million  the share, e.g. 999000 for 99.9 %.   Context: any thread. */
FSN_API uint64_t fsn_histogram_percentile(const struct fsn_histogram *histogram,
                                          uint32_t per_million);

/** One step of the acyclic work of a live bus next to the cycle, see `poll` of fsn_bus_ops.
 *  @param[in] al_state  FSN_AL_INIT … FSN_AL_OP.
 *  @retval true  every SubDevice is in that state (one that does not answer is not in OP, and has
 *                left it), or the bus has no states.
 *  Context: one thread other than the cyclic one. May block. */
FSN_API bool fsn_core_poll(struct fsn_core *core, uint8_t al_state, uint64_t now_ns);

/** Acyclic data of the bus about a SubDevice of the plan.
 *  @retval FSN_E_ARG    unknown SubDevice.
 *  @retval FSN_E_STATE  a bus without states.   Context: any thread but the cyclic one. */
FSN_API FSN_MUST_USE fsn_status fsn_core_subdevice(struct fsn_core *core, uint32_t subdevice,
                                                   struct fsn_bus_subdevice *seen);

/** Whether the ring is closed, and where it is open.
 *  @retval FSN_E_STATE  not a ring: a bus with one interface.
 *  Context: any thread but the cyclic one. */
FSN_API FSN_MUST_USE fsn_status fsn_core_ring(struct fsn_core *core, struct fsn_bus_ring *ring);

/** Whether the distributed clocks are synchronous, and which one is not.
 *  @retval FSN_E_STATE  none are in use.   Context: any thread but the cyclic one. */
FSN_API FSN_MUST_USE fsn_status fsn_core_clocks(struct fsn_core *core,
                                                struct fsn_bus_clocks *clocks);

/** Stops the cyclic thread after its current cycle; outputs keep their values. Idempotent. Context:
 *  set-up. */
FSN_API void fsn_core_stop(struct fsn_core *core);

/** Takes a consistent snapshot of one cycle.
 *  @param[out] statistics    may be NULL.
 *  @param[out] connections   fsn_plan_connection_count() elements; may be NULL.
 *  @param[out] image         fsn_core_image_bytes() bytes; may be NULL.
 *  @retval FSN_E_ARG   no core.
 *  @retval FSN_E_BUSY  at every attempt two cycles ended during the read; try again.
 *  Context: any thread. Never delays the cyclic thread; at most 1 000 attempts. */
FSN_API FSN_MUST_USE fsn_status fsn_core_snapshot(struct fsn_core *core,
                                                  struct fsn_statistics *statistics,
                                                  struct fsn_connection_status *connections,
                                                  uint8_t *image);

/** Counters of one bus; those of fsn_core_snapshot() are for all buses together, in cycles of the
 *  first.
 *  @param[in] number  of the bus in the plan.
 *  @retval FSN_E_ARG   unknown bus.   @retval FSN_E_BUSY  as for fsn_core_snapshot().
 *  Context: any thread. Never delays a cyclic thread. */
FSN_API FSN_MUST_USE fsn_status fsn_core_bus(struct fsn_core *core, uint32_t number,
                                             struct fsn_statistics *statistics);

/** Keeps the last cycles completely: numbers, working counters and image.
 *  @param[in] time_ns     duration, counted in bus cycles of the plan, or of the options passed to
 *                         fsn_core_start(); 0 keeps none and frees the memory.
 *  @param[in] most_bytes  limit of the memory: at most as many cycles as fit.
 *  @retval FSN_E_ARG    no core, or not even one cycle fits.
 *  @retval FSN_E_STATE  the thread runs.   @retval FSN_E_NOMEM  out of memory.
 *  After a refusal of FSN_E_ARG or FSN_E_NOMEM nothing is kept.
 *  Context: set-up. Allocates, and touches every page once, so that no cycle has to. */
FSN_API FSN_MUST_USE fsn_status fsn_core_keep(struct fsn_core *core, uint64_t time_ns,
                                              size_t most_bytes);

/** How many cycles are kept; 0: none. Context: any thread. */
FSN_API uint64_t fsn_core_kept_cycles(const struct fsn_core *core);

/** Number of the last completed cycle; 0 before the first. Works without fsn_core_keep().
 *  Context: any thread. */
FSN_API uint64_t fsn_core_last_cycle(const struct fsn_core *core);

/** Reads one complete cycle from the recorder: inputs as received in it, outputs as sent. Any
 *  number of readers may go through the cycles one by one.
 *  @param[out] record  may be NULL.
 *  @param[out] wkc     fsn_core_datagram_count() elements; may be NULL.
 *  @param[out] image   fsn_core_image_bytes() bytes; may be NULL.
 *  @retval FSN_E_ARG    no core, unknown or overwritten cycle; the buffers are undefined.
 *  @retval FSN_E_BUSY   the cycle has not ended yet.
 *  @retval FSN_E_STATE  nothing is recorded.
 *  Context: any thread. Never delays the cyclic thread; one attempt, no waiting. */
FSN_API FSN_MUST_USE fsn_status fsn_core_record(const struct fsn_core *core, uint64_t cycle,
                                                struct fsn_cycle *record, struct fsn_wkc *wkc,
                                                uint8_t *image);

/** Number of datagrams of the process image. Context: any thread. */
FSN_API uint32_t fsn_core_datagram_count(const struct fsn_core *core);

/** First byte of a datagram in the image, or FSN_NONE. Context: any thread. */
FSN_API uint32_t fsn_core_datagram_byte(const struct fsn_core *core, uint32_t datagram);

/** Length of the process image, bytes. Context: any thread. */
FSN_API uint32_t fsn_core_image_bytes(const struct fsn_core *core);

/** First byte of a sync manager in the image, or FSN_NONE. Context: any thread. */
FSN_API uint32_t fsn_core_sm_base(const struct fsn_core *core, uint32_t sm);

/** Cycles in which an input sync manager contained old bytes, if the bus detects this. Context: any
 *  thread. */
FSN_API uint64_t fsn_core_stale_cycles(const struct fsn_core *core, uint32_t sm);

/** Takes the oldest event. A full ring drops new events and counts them in events_lost.
 *  @param[out] event  unchanged when there is none.
 *  @retval false  there is none.   Context: one consumer thread. */
FSN_API bool fsn_core_event(struct fsn_core *core, struct fsn_event *event);

/** Sets a standard output; it is written in every cycle from the next on, after the copies.
 *  @param[in] symbol  its number in the plan.
 *  @param[in] value   its low bits are used, as many as the symbol has.
 *  @retval FSN_E_ARG     unknown symbol.
 *  @retval FSN_E_CLOSED  the symbol is an input, or a copy or FSoE block owns one of its bytes.
 *  Context: one writer thread. */
FSN_API FSN_MUST_USE fsn_status fsn_core_set_output(struct fsn_core *core, uint32_t symbol,
                                                    uint64_t value);

/** Sets several standard outputs, all in one cycle: they are sent together.
 *  @param[in] count    number of outputs; 0 does nothing.
 *  @param[in] symbols  their numbers in the plan; if one occurs twice, its last value counts.
 *  @param[in] values   one for each, as for fsn_core_set_output().
 *  @retval FSN_E_ARG     unknown symbol.   @retval FSN_E_CLOSED  one is closed.
 *  After a refusal all keep their values.
 *  Context: one writer thread, that of fsn_core_set_output(). Neither the writer nor the cycle
 *  waits for the other. Cost: O(outputs set so far). */
FSN_API FSN_MUST_USE fsn_status fsn_core_set_outputs(struct fsn_core *core, size_t count,
                                                     const uint32_t *symbols,
                                                     const uint64_t *values);

/** Whether fsn_core_set_output() accepts this symbol. Context: any thread. */
FSN_API bool fsn_core_is_open(const struct fsn_core *core, uint32_t symbol);

/** Reads a symbol from an image taken by fsn_core_snapshot(), zero-extended.
 *  @retval FSN_E_ARG  unknown symbol, or not in the image.   Context: any thread. */
FSN_API FSN_MUST_USE fsn_status fsn_core_read_symbol(const struct fsn_core *core,
                                                     const uint8_t *image, uint32_t symbol,
                                                     uint64_t *value);

#ifdef __cplusplus
}
#endif

#endif
