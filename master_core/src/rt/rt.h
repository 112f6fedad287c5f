/** Data of the cyclic path. Set-up code fills it, then only the cyclic thread writes it. Nothing
 *  here allocates, locks, prints or makes a system call, except for clock and sleep. */
#ifndef FSN_RT_H
#define FSN_RT_H

#include <stdbool.h>
#include <stdint.h>

#include "fsn/core.h"
#include "rt/clients.h"
#include "rt/triple.h"

enum {
    FSN_RT_EVENTS = 256,  /**< slots of the event ring, a power of two */
    FSN_RT_PICTURES = 2,  /**< snapshots that the cycle fills alternately */
    FSN_RT_COUNTED = 12,  /**< times counted by two cycles, six each */
    FSN_RT_STEERED = 100, /**< a reference clock moves a cycle by at most one part in this number */
};

/** One merged copy, absolute bytes in the image. */
struct fsn_rt_copy {
    uint32_t source, destination;
};

/** Copies of one size, executed together. */
struct fsn_rt_group {
    uint32_t size_bytes, first, count;
};

/** Position of an observed connection. The fields that every cycle reads are kept small and close
 *  together; its monitor is accessed only when one of its frames is new. */
struct fsn_rt_watch {
    uint32_t offset[2];            /**< position of its frames after the copy, enum fsn_way */
    uint32_t size_bytes[2];        /**< of these frames */
    uint32_t seen;                 /**< positions, consecutive, in fsn_rt.seen */
    uint64_t new_ns;               /**< time of its last new frame */
    uint64_t silent_ns;            /**< time without a new frame after which it counts as silent */
    struct fsn_parameters planned; /**< planned parameters */
    uint8_t unshown;               /**< snapshots that do not yet contain its last change */
};

/** Bits of the image for a symbol. */
struct fsn_rt_output {
    uint32_t bit_offset; /**< absolute bit in the image */
    uint32_t bits;       /**< 0 if it has no place in the image */
    bool open;           /**< the application may set it */
};

/** One complete set of output values. */
struct fsn_rt_set {
    uint64_t *values; /**< of the first `count` symbols in fsn_rt.active */
    uint32_t count;
};

/** Sets from the writer of outputs to the cycle. */
struct fsn_rt_sets {
    struct fsn_rt_set set[FSN_TRIPLE_SETS];
    struct fsn_triple triple;
};

/** Ring of events: written by the cycle, read by one consumer. */
struct fsn_rt_ring {
    _Atomic uint32_t head, tail;
    struct fsn_event slot[FSN_RT_EVENTS];
};

/** Snapshots for other threads: the cycle fills one while readers use the other, the last complete
 *  one. A reader fails only if the cycle reaches its snapshot again in the meantime. */
struct fsn_rt_shown {
    _Atomic uint32_t begun, whole; /**< snapshots so far; number n is at n % FSN_RT_PICTURES */
};

/** A counted time: the words of its histogram and its bucket in the statistics. */
struct fsn_rt_counted {
    uint32_t histogram, bucket;
};

/** Changes of the histograms that a snapshot does not yet contain, because they are too large to be
 *  copied in each cycle. If there are too many: all of them. */
struct fsn_rt_unshown {
    uint32_t count;
    struct fsn_rt_counted counted[FSN_RT_COUNTED];
};

struct fsn_rt_snapshot {
    struct fsn_rt_shown *shown;               /**< next to the words: both may be shared */
    _Atomic uint64_t *words[FSN_RT_PICTURES]; /**< statistics, connections, image, each padded */
    struct fsn_rt_unshown unshown[FSN_RT_PICTURES];
};

/** Ring of the last cycles. Slot n of a cycle: sequence, struct fsn_cycle, working counters, image,
 *  each padded to 8 bytes. */
struct fsn_rt_recorder {
    _Atomic uint64_t last;   /**< number of the last cycle, even without slots */
    _Atomic uint64_t *words; /**< touched once before the first cycle */
    uint64_t slots;          /**< 0: nothing is recorded */
    size_t slot_words;
};

/** Writes a marker into the trace buffer of the kernel; not part of the cyclic object files. */
typedef void (*fsn_rt_trace_fn)(int fd, const char *marker);

struct fsn_rt {
    const struct fsn_bus_ops *ops;
    void *bus;
    uint8_t *image;
    uint32_t image_bytes;

    struct fsn_bus_input input; /**< filled by the bus in every cycle */
    _Atomic uint64_t *stale;    /**< per sync manager: cycles with old inputs */
    uint32_t datagram_count, sm_count;

    const struct fsn_rt_copy *copies;
    const struct fsn_rt_group *groups;
    uint32_t group_count;
    uint64_t bytes_per_cycle;

    struct fsn_rt_watch *watches; /**< one per connection */
    struct fsn_monitor *monitors; /**< one per connection */
    uint8_t *seen;                /**< frames of the last cycle */
    uint32_t connection_count;

    struct fsn_rt_output *outputs; /**< one per symbol */
    const uint32_t *active;        /**< symbols set so far, in the order of their first set */
    struct fsn_rt_sets sets;

    struct fsn_statistics statistics;
    struct fsn_rt_ring ring;
    struct fsn_rt_snapshot snapshot;
    struct fsn_rt_recorder recorder;
    struct fsn_rt_clients clients;

    /* Used by the thread only. */
    uint64_t cycle_ns;
    uint64_t period_ns; /**< since the wake-up of the previous cycle; 0 in the first one */
    uint64_t late_ns;   /**< delay of this wake-up; 0 in virtual time */
    uint64_t left_out;  /**< cycles skipped before this one because of a late wake-up */
    bool free_run, follow_dc;
    bool goes_on;           /**< the first cycle keeps the times of another core */
    uint64_t dc_shift_ns;   /**< required lead of frames at the reference clock before SYNC0 */
    uint64_t dc_base_ns;    /**< the bus is set to CLOCK_MONOTONIC plus this; 0: it is not */
    int64_t dc_sum_ns;      /**< accumulated distances, for the rate of that clock */
    uint64_t dc_late_ns;    /**< delay of the previous wake-up */
    fsn_rt_trace_fn trace;  /**< NULL: no markers */
    int trace_fd;           /**< descriptor for it */
    atomic_bool show_first; /**< the snapshot of a cycle is complete before its frames are sent */
    atomic_bool stop;
};

/** Counts a time in one of the histograms of its statistics. */
void fsn_rt_count(struct fsn_rt *rt, struct fsn_histogram *histogram, uint64_t time_ns);

/** Executes every copy of the plan. Cost: O(copies); nothing depends on the data. */
void fsn_rt_copy_all(uint8_t *image, const struct fsn_rt_copy *copies,
                     const struct fsn_rt_group *groups, uint32_t group_count);

/** Monitors every connection after the copies; never changes a byte of the image. */
void fsn_rt_monitor(struct fsn_rt *rt, uint64_t now_ns);

/** Adds an event; a full ring counts the loss and keeps the older events. */
void fsn_rt_push_event(struct fsn_rt *rt, const struct fsn_event *event);

/** Publishes statistics, connections and image. */
void fsn_rt_publish(struct fsn_rt *rt);

/** Records the cycle that has just run, and publishes its number. */
void fsn_rt_record(struct fsn_rt *rt, uint64_t work_ns);

/** One bus cycle. `timed` reads the clock around copy and cycle; off in virtual time. */
void fsn_rt_cycle(struct fsn_rt *rt, uint64_t now_ns, bool timed);

/** The cyclic thread: cycles at absolute times until stop is set. */
void fsn_rt_loop(struct fsn_rt *rt);

#endif
