#define _POSIX_C_SOURCE 200809L

#include "rt/clients.h"

#include "rt/bytes.h"
#include "rt/clock.h"
#include "rt/rt.h"
#include "rt/words.h"

static void count(_Atomic uint64_t *counter) {
    const uint64_t before = atomic_load_explicit(counter, memory_order_relaxed);
    atomic_store_explicit(counter, before + 1, memory_order_relaxed);
}

/** Takes the newest set of a client, if it is new and complete. A concurrent write of the client
 *  affects only which of its own values are taken. */
static bool take(struct fsn_rt_client *client, uint64_t *answers) {
    enum { TRIES = 2 };
    for (int i = 0; i < TRIES; i++) {
        const uint32_t whole = atomic_load_explicit(&client->sent->whole, memory_order_acquire);
        if (whole == client->taken) {
            return false;
        }
        const _Atomic uint64_t *from = client->set[whole % FSN_SHARED_SETS];
        from = fsn_words_take(from, answers, sizeof *answers);
        fsn_words_take(from, client->fresh, client->count * sizeof *client->fresh);
        /* The loads above must not be reordered after this check for a new write. */
        atomic_thread_fence(memory_order_acquire);
        if (atomic_load_explicit(&client->sent->begun, memory_order_relaxed) - whole <
            FSN_SHARED_SETS) {
            uint64_t *values = client->values;
            client->values = client->fresh;
            client->fresh = values;
            client->taken = whole;
            return true;
        }
    }
    count(&client->shown->torn);
    return false;
}

/** State of the client in this cycle.
 *  @param[in] last  cycle that the clients have seen last. */
static uint32_t judge(struct fsn_rt_client *client, uint64_t last) {
    uint64_t answers = 0;
    uint32_t state = atomic_load_explicit(&client->shown->state, memory_order_relaxed);
    if (state == FSN_SHARED_LATE) {
        return state; /* until it has restarted */
    }
    if (take(client, &answers)) {
        count(answers == last ? &client->shown->on_time : &client->shown->late);
        client->missed = 0;
        state = FSN_SHARED_RUNS;
    } else if (state == FSN_SHARED_RUNS) {
        count(&client->shown->missed);
        client->missed++;
        state = client->missed > client->misses ? FSN_SHARED_LATE : FSN_SHARED_RUNS;
    }
    atomic_store_explicit(&client->shown->state, state, memory_order_relaxed);
    return state;
}

void fsn_rt_clients_write(struct fsn_rt *rt) {
    uint32_t present = atomic_load_explicit(&rt->clients.present, memory_order_acquire);
    for (uint32_t n = 0; present != 0; n++, present >>= 1) {
        struct fsn_rt_client *client = &rt->clients.client[n];
        if ((present & 1) == 0 || client->count == 0 ||
            judge(client, rt->statistics.cycles) != FSN_SHARED_RUNS) {
            continue;
        }
        for (uint32_t i = 0; i < client->count; i++) {
            const struct fsn_rt_output *output = &rt->outputs[client->symbols[i]];
            fsn_write_bits(rt->image, output->bit_offset, output->bits, client->values[i]);
        }
    }
}

/** The earliest start of the next cycle: a reference clock may adjust it a little. */
static uint64_t next_ns(const struct fsn_rt *rt) {
    if (rt->free_run) {
        return rt->statistics.now_ns;
    }
    const uint64_t steered_ns = rt->follow_dc ? rt->cycle_ns / FSN_RT_STEERED : 0;
    return rt->statistics.now_ns - rt->late_ns + (rt->left_out + 1) * rt->cycle_ns - steered_ns;
}

void fsn_rt_clients_show(struct fsn_rt *rt, bool timed) {
    const struct fsn_statistics *s = &rt->statistics;
    if (atomic_load_explicit(&rt->clients.present, memory_order_acquire) == 0) {
        return;
    }
    const uint64_t shown_ns = timed ? fsn_clock_ns(CLOCK_MONOTONIC) - s->now_ns : 0;
    struct fsn_shared_inputs *inputs = rt->clients.inputs;
    const struct fsn_shared_cycle cycle = {.cycle = s->cycles,
                                           .now_ns = s->now_ns,
                                           .next_ns = next_ns(rt),
                                           .dc_time_ns = s->dc_time_ns,
                                           .shown_ns = shown_ns,
                                           .overruns = s->overruns,
                                           .expected_wkc = s->expected_wkc,
                                           .actual_wkc = s->actual_wkc};
    const uint32_t picture = atomic_load_explicit(&inputs->shown.whole, memory_order_relaxed) + 1;
    atomic_store_explicit(&inputs->shown.begun, picture, memory_order_relaxed);
    atomic_thread_fence(memory_order_release);
    _Atomic uint64_t *words =
        rt->clients.pictures + (picture % FSN_SHARED_PICTURES) * inputs->picture_words;
    words = fsn_words_put(words, &cycle, sizeof cycle);
    fsn_words_put(words, rt->image, rt->image_bytes);
    atomic_store_explicit(&inputs->shown.whole, picture, memory_order_release);
}
