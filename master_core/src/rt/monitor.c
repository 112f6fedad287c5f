#include "rt.h"

#include <string.h>

enum {
    CMD_RESET = 0x2A,
    CMD_SESSION = 0x4E,
    CMD_CONNECTION = 0x64,
    CMD_PARAMETER = 0x52,
    CMD_PROCESS_DATA = 0x36,
    CMD_FAILSAFE_DATA = 0x08,
};

/** State as seen from outside. The end that lags decides: a connection is in Data when both are. */
static enum fsn_outside outside(uint8_t to_sub, uint8_t to_main) {
    if (to_sub == 0 || to_main == 0) {
        return FSN_OUTSIDE_SILENT;
    }
    if (to_sub == CMD_RESET || to_main == CMD_RESET) {
        return FSN_OUTSIDE_RESET;
    }
    static const uint8_t order[] = {CMD_SESSION, CMD_CONNECTION, CMD_PARAMETER};
    static const enum fsn_outside state[] = {FSN_OUTSIDE_SESSION, FSN_OUTSIDE_CONNECTION,
                                             FSN_OUTSIDE_PARAMETER};
    for (unsigned i = 0; i < sizeof order; i++) {
        if (to_sub == order[i] || to_main == order[i]) {
            return state[i];
        }
    }
    if (to_sub == CMD_PROCESS_DATA && to_main == CMD_PROCESS_DATA) {
        return FSN_OUTSIDE_DATA_PROCESS;
    }
    const bool data = (to_sub == CMD_PROCESS_DATA || to_sub == CMD_FAILSAFE_DATA) &&
                      (to_main == CMD_PROCESS_DATA || to_main == CMD_FAILSAFE_DATA);
    return data ? FSN_OUTSIDE_DATA_FAILSAFE : FSN_OUTSIDE_UNKNOWN;
}

static void count_interval(struct fsn_direction *d, uint64_t interval_ns) {
    d->interval_last_ns = interval_ns;
    d->interval_sum_ns += interval_ns;
    if (d->intervals == 0 || interval_ns < d->interval_min_ns) {
        d->interval_min_ns = interval_ns;
    }
    if (interval_ns > d->interval_max_ns) {
        d->interval_max_ns = interval_ns;
    }
    d->intervals++;
}

/** Takes a new frame into the counters of its direction. */
static void take_frame(struct fsn_direction *d, const uint8_t *frame, uint32_t size_bytes,
                       uint64_t now_ns) {
    const bool was_data = d->command == CMD_PROCESS_DATA || d->command == CMD_FAILSAFE_DATA;
    const bool is_data = frame[0] == CMD_PROCESS_DATA || frame[0] == CMD_FAILSAFE_DATA;
    const bool was_reset = d->command == CMD_RESET;
    if (was_data && is_data) {
        count_interval(d, now_ns - d->last_new_ns);
    }
    d->frames++;
    d->last_new_ns = now_ns;
    d->command = frame[0];
    d->connection_id = (uint16_t)(frame[size_bytes - 2] | (frame[size_bytes - 1] << 8));
    d->process_data += frame[0] == CMD_PROCESS_DATA;
    d->failsafe_data += frame[0] == CMD_FAILSAFE_DATA;
    if (frame[0] == CMD_RESET) {
        /* One Reset is several frames, because its CRCs go on; only its begin counts. */
        d->resets += !was_reset;
        d->reset_code = frame[1];
    }
}

/** Returns whether the frame in the image is a new one. An all-zero image before the first frame
 *  is none. */
static bool observe(struct fsn_rt *rt, struct fsn_rt_watch *watch, struct fsn_direction *d,
                    uint64_t now_ns) {
    const uint8_t *frame = rt->image + watch->offset;
    if (memcmp(frame, watch->last, watch->size_bytes) == 0) {
        return false;
    }
    memcpy(watch->last, frame, watch->size_bytes);
    take_frame(d, frame, watch->size_bytes, now_ns);
    return true;
}

void fsn_rt_monitor(struct fsn_rt *rt, uint64_t now_ns) {
    for (uint32_t c = 0; c < rt->connection_count; c++) {
        struct fsn_connection_status *status = &rt->connections[c];
        bool news = observe(rt, &rt->watches[2 * c], &status->direction[0], now_ns);
        news |= observe(rt, &rt->watches[2 * c + 1], &status->direction[1], now_ns);
        if (!news) {
            continue;
        }
        const enum fsn_outside before = (enum fsn_outside)status->outside;
        const enum fsn_outside after =
            outside(status->direction[0].command, status->direction[1].command);
        if (before == after) {
            continue;
        }
        status->outside = after;
        const struct fsn_direction *by =
            &status->direction[status->direction[0].command == CMD_RESET ? 0 : 1];
        const struct fsn_event event = {
            .now_ns = now_ns,
            .connection = c,
            .before = (uint8_t)before,
            .after = (uint8_t)after,
            .reset_code = after == FSN_OUTSIDE_RESET ? by->reset_code : 0,
        };
        fsn_rt_push_event(rt, &event);
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
