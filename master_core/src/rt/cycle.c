#define _POSIX_C_SOURCE 200809L

#include "rt/rt.h"

#include <errno.h>
#include <string.h>

#include "rt/bytes.h"
#include "rt/clock.h"
#include "rt/frame_counts.h"

static void sleep_until(uint64_t at_ns) {
    const struct timespec at = {.tv_sec = (time_t)(at_ns / 1000000000u),
                                .tv_nsec = (long)(at_ns % 1000000000u)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) == EINTR) {
    }
}

static void write_outputs(struct fsn_rt *rt) {
    struct fsn_rt_sets *sets = &rt->sets;
    (void)fsn_triple_take(&sets->triple);
    const struct fsn_rt_set *set = &sets->set[sets->triple.reader];
    for (uint32_t i = 0; i < set->count; i++) {
        const struct fsn_rt_output *output = &rt->outputs[rt->active[i]];
        fsn_write_bits(rt->image, output->bit_offset, output->bits, set->values[i]);
    }
}

static void clear_input(struct fsn_rt *rt) {
    memset(rt->input.wkc, 0, rt->datagram_count * sizeof *rt->input.wkc);
    memset(rt->input.sm_stale, 0, rt->sm_count);
    rt->input.counts = (struct fsn_frame_counts){0};
    rt->input.send_errno = 0;
    rt->input.round_trip_ns = 0;
    rt->input.dc_time_ns = 0;
}

/** Judges the working counter of each datagram, and the age of the inputs. Neither changes what is
 *  sent: an old frame is harmless, and the watchdog of its receiver handles the rest. */
static void judge_input(struct fsn_rt *rt) {
    struct fsn_statistics *s = &rt->statistics;
    uint32_t bad = 0;
    s->expected_wkc = 0;
    s->actual_wkc = 0;
    for (uint32_t d = 0; d < rt->datagram_count; d++) {
        s->expected_wkc += rt->input.wkc[d].expected;
        s->actual_wkc += rt->input.wkc[d].actual;
        bad += rt->input.wkc[d].expected != rt->input.wkc[d].actual;
    }
    s->wkc_errors += bad > 0;
    fsn_add_counts(&s->counts, &rt->input.counts, NULL);
    s->send_errno = (uint32_t)rt->input.send_errno;
    if (rt->input.dc_time_ns != 0) {
        s->dc_time_ns = rt->input.dc_time_ns;
    }
    for (uint32_t sm = 0; sm < rt->sm_count; sm++) {
        if (rt->input.sm_stale[sm] != 0) {
            atomic_fetch_add_explicit(&rt->stale[sm], 1, memory_order_relaxed);
        }
    }
}

static void mark(const struct fsn_rt *rt, const char *marker) {
    if (rt->trace != NULL) {
        rt->trace(rt->trace_fd, marker);
    }
}

/** Counts and observations of this cycle. They do not change the sent data, so they run after
 *  sending where possible. */
static void observe(struct fsn_rt *rt, uint64_t now_ns, bool timed) {
    struct fsn_statistics *s = &rt->statistics;
    judge_input(rt);
    fsn_rt_monitor(rt, now_ns);
    s->cycles++;
    s->bytes_copied += rt->bytes_per_cycle;
    s->now_ns = now_ns;
    if (!timed) {
        return;
    }
    if (rt->period_ns != 0) {
        fsn_rt_count(rt, &s->period, rt->period_ns);
    }
    if (!rt->free_run) {
        fsn_rt_count(rt, &s->latency, rt->late_ns);
    }
    if (rt->input.round_trip_ns != 0) {
        fsn_rt_count(rt, &s->round_trip, rt->input.round_trip_ns);
    }
}

void fsn_rt_cycle(struct fsn_rt *rt, uint64_t now_ns, bool timed) {
    struct fsn_statistics *s = &rt->statistics;
    clear_input(rt);
    rt->ops->receive(rt->bus, &rt->input);
    const uint64_t before_copy = timed ? fsn_clock_ns(CLOCK_MONOTONIC) : 0;
    fsn_rt_copy_all(rt->image, rt->copies, rt->groups, rt->group_count);
    const uint64_t after_copy = timed ? fsn_clock_ns(CLOCK_MONOTONIC) : 0;
    write_outputs(rt);
    fsn_rt_clients_write(rt);
    /* The successor must never read outputs older than the last ones sent. FSoE would treat them as
     * new frames with a broken CRC chain. Newer ones are sent by the successor. */
    const bool first = atomic_load_explicit(&rt->show_first, memory_order_relaxed);
    if (first) {
        observe(rt, now_ns, timed);
        fsn_rt_publish(rt);
    }
    rt->ops->send(rt->bus);
    const uint64_t work_ns = timed ? fsn_clock_ns(CLOCK_MONOTONIC) - now_ns : 0;
    if (timed) {
        fsn_rt_count(rt, &s->copy, after_copy - before_copy);
        fsn_rt_count(rt, &s->work, work_ns);
    }
    if (!first) {
        observe(rt, now_ns, timed);
        fsn_rt_publish(rt);
    }
    fsn_rt_record(rt, work_ns);
    fsn_rt_clients_show(rt, timed);
}

/** Distance of a DC time from its target, which is a fixed time before a multiple of the cycle. It
 *  is at most half a cycle in either direction; positive if late. A frame may contain any time. */
static int64_t dc_distance(const struct fsn_rt *rt, uint64_t dc_time_ns) {
    const uint64_t cycle = rt->cycle_ns;
    const uint64_t behind = (dc_time_ns % cycle + rt->dc_shift_ns % cycle) % cycle;
    return behind > cycle / 2 ? (int64_t)(behind - cycle) : (int64_t)behind;
}

static int64_t bounded(int64_t value, int64_t most) {
    const int64_t raised = value > -most ? value : -most;
    return raised < most ? raised : most;
}

/** Adjusts the wake-ups to the reference clock, in phase and rate: a sixteenth of the distance per
 *  cycle; the remainder is accumulated. Never more than a hundredth of a cycle, so that one outlier
 *  has little effect. The reply is that of the previous cycle. */
static uint64_t steer(struct fsn_rt *rt, uint64_t next_ns) {
    const uint64_t late_ns = rt->dc_late_ns;
    rt->dc_late_ns = rt->late_ns;
    if (rt->input.dc_time_ns == 0) {
        return next_ns;
    }
    const int64_t distance = dc_distance(rt, rt->input.dc_time_ns - late_ns);
    const int64_t most = (int64_t)rt->cycle_ns / FSN_RT_STEERED;
    fsn_rt_count(rt, &rt->statistics.dc_offset, (uint64_t)(distance < 0 ? -distance : distance));
    if (!rt->follow_dc) {
        return next_ns;
    }
    const int64_t more = bounded(distance, (int64_t)rt->cycle_ns / 1000);
    rt->dc_sum_ns = bounded(rt->dc_sum_ns + more, (int64_t)rt->cycle_ns);
    return next_ns - (uint64_t)bounded(distance / 16 + rt->dc_sum_ns / 1024, most);
}

/** The first wake-up if the bus is set to our clock: at its position before SYNC0. */
static uint64_t align(const struct fsn_rt *rt, uint64_t next_ns) {
    return rt->dc_base_ns == 0 ? next_ns
                               : next_ns - (uint64_t)dc_distance(rt, next_ns + rt->dc_base_ns);
}

void fsn_rt_loop(struct fsn_rt *rt) {
    struct fsn_statistics *s = &rt->statistics;
    uint64_t next =
        align(rt, (rt->goes_on ? s->now_ns : fsn_clock_ns(CLOCK_MONOTONIC)) + rt->cycle_ns);
    rt->goes_on = false;
    uint64_t before = 0;
    while (!atomic_load_explicit(&rt->stop, memory_order_relaxed)) {
        if (!rt->free_run) {
            sleep_until(next);
        }
        const uint64_t now = fsn_clock_ns(CLOCK_MONOTONIC);
        rt->period_ns = before != 0 ? now - before : 0;
        before = now;
        rt->late_ns = !rt->free_run && now > next ? now - next : 0;
        rt->left_out = rt->late_ns / rt->cycle_ns;
        s->overruns += rt->left_out; /* already in the snapshot of this cycle, like its time */
        mark(rt, "fsn: cycle begins");
        fsn_rt_cycle(rt, now, true);
        mark(rt, "fsn: cycle ends");
        if (rt->free_run) {
            continue;
        }
        next = steer(rt, next) + rt->cycle_ns;
        if (rt->left_out > 0) {
            /* Missed wake-ups are counted and dropped, not caught up: a burst of cycles would put
             * several frames of one device into one of its own cycles. */
            next += rt->left_out * rt->cycle_ns;
            mark(rt, "fsn: overrun");
        }
    }
}
