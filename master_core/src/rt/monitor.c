/** Passes the image to the monitors of all connections, and reports changes of state. */
#include "rt/rt.h"

#include <string.h>

/** The end that began the current reset. An end acknowledges with code 0. If both show a Reset in
 *  one cycle, it is therefore the end that gives a reason, otherwise the main. */
static unsigned reset_by(const struct fsn_connection_status *status) {
    const struct fsn_direction *d = status->direction;
    if (d[FSN_TO_SUB].command != FSN_CMD_RESET) {
        return FSN_TO_MAIN;
    }
    const bool both = d[FSN_TO_MAIN].command == FSN_CMD_RESET;
    return both && d[FSN_TO_SUB].reset_code == 0 && d[FSN_TO_MAIN].reset_code != 0 ? FSN_TO_MAIN
                                                                                   : FSN_TO_SUB;
}

static void report(struct fsn_rt *rt, uint32_t connection, uint32_t before, uint64_t now_ns) {
    const struct fsn_connection_status *status = &rt->monitors[connection].status;
    struct fsn_event event = {
        .now_ns = now_ns,
        .connection = connection,
        .before = (uint8_t)before,
        .after = (uint8_t)status->observed,
    };
    if (status->observed == FSN_OBSERVED_RESET) {
        const unsigned way = reset_by(status);
        event.reset_code = status->direction[way].reset_code;
        event.by = (uint8_t)(way + 1);
    }
    fsn_rt_push_event(rt, &event);
}

static void follow(struct fsn_monitor *monitor, const uint8_t *const frames[2], uint64_t now_ns) {
    const bool sub_first = fsn_monitor_sub_first(monitor, frames[FSN_TO_SUB], frames[FSN_TO_MAIN]);
    const enum fsn_way first = sub_first ? FSN_TO_MAIN : FSN_TO_SUB;
    const enum fsn_way second = sub_first ? FSN_TO_SUB : FSN_TO_MAIN;
    (void)fsn_monitor_frame(monitor, first, frames[first], now_ns);
    (void)fsn_monitor_frame(monitor, second, frames[second], now_ns);
}

/** Compares the observation with the plan; values that are unknown on either side are not
 *  compared. */
static void compare(struct fsn_rt *rt, uint32_t connection, uint64_t now_ns) {
    struct fsn_connection_status *status = &rt->monitors[connection].status;
    const struct fsn_parameters *seen = &status->parameters;
    const struct fsn_parameters *planned = &rt->watches[connection].planned;
    const uint32_t known = seen->known & planned->known;
    const uint32_t unequal =
        (seen->connection_id != planned->connection_id ? FSN_STATED_CONNECTION_ID : 0U) |
        (seen->address != planned->address ? FSN_STATED_ADDRESS : 0U) |
        (seen->watchdog_ms != planned->watchdog_ms ? FSN_STATED_WATCHDOG : 0U) |
        (seen->app_bytes != planned->app_bytes || seen->app_crc != planned->app_crc ? FSN_STATED_APP
                                                                                    : 0U);
    const uint32_t differs = (status->differs & ~known) | (unequal & known);
    if (differs == status->differs) {
        return;
    }
    status->differs = differs;
    const struct fsn_event event = {.now_ns = now_ns,
                                    .connection = connection,
                                    .before = (uint8_t)status->observed,
                                    .after = (uint8_t)status->observed,
                                    .differs = (uint8_t)differs,
                                    .parameters = *seen};
    fsn_rt_push_event(rt, &event);
}

/** Both ends have stopped: their last frames are no longer valid. */
static void fall_silent(struct fsn_rt *rt, uint32_t connection, uint64_t now_ns) {
    struct fsn_rt_watch *watch = &rt->watches[connection];
    struct fsn_connection_status *status = &rt->monitors[connection].status;
    const uint32_t before = status->observed;
    watch->new_ns = 0;
    watch->unshown = FSN_RT_PICTURES;
    status->observed = FSN_OBSERVED_SILENT;
    if (before != FSN_OBSERVED_SILENT) {
        report(rt, connection, before, now_ns);
    }
}

void fsn_rt_monitor(struct fsn_rt *rt, uint64_t now_ns) {
    for (uint32_t c = 0; c < rt->connection_count; c++) {
        struct fsn_rt_watch *watch = &rt->watches[c];
        const uint8_t *const frames[2] = {rt->image + watch->offset[FSN_TO_SUB],
                                          rt->image + watch->offset[FSN_TO_MAIN]};
        uint8_t *seen[2] = {rt->seen + watch->seen,
                            rt->seen + watch->seen + watch->size_bytes[FSN_TO_SUB]};
        if (memcmp(seen[0], frames[0], watch->size_bytes[0]) == 0 &&
            memcmp(seen[1], frames[1], watch->size_bytes[1]) == 0) {
            if (watch->new_ns != 0 && now_ns - watch->new_ns > watch->silent_ns) {
                fall_silent(rt, c, now_ns);
            }
            continue;
        }
        watch->new_ns = now_ns != 0 ? now_ns : 1;
        memcpy(seen[0], frames[0], watch->size_bytes[0]);
        memcpy(seen[1], frames[1], watch->size_bytes[1]);
        watch->unshown = FSN_RT_PICTURES;
        const uint32_t before = rt->monitors[c].status.observed;
        follow(&rt->monitors[c], frames, now_ns);
        if (rt->monitors[c].status.observed != before) {
            report(rt, c, before, now_ns);
        }
        compare(rt, c, now_ns);
    }
}

void fsn_rt_push_event(struct fsn_rt *rt, const struct fsn_event *event) {
    struct fsn_rt_ring *ring = &rt->ring;
    const uint32_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    const uint32_t tail = atomic_load_explicit(&ring->tail, memory_order_acquire);
    if (head - tail >= FSN_RT_EVENTS) {
        rt->statistics.events_lost++;
        return;
    }
    ring->slot[head % FSN_RT_EVENTS] = *event;
    atomic_store_explicit(&ring->head, head + 1, memory_order_release);
}
