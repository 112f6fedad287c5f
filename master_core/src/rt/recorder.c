#include "rt/rt.h"
#include "rt/words.h"

static uint32_t saturated(uint64_t value) {
    return value > UINT32_MAX ? UINT32_MAX : (uint32_t)value;
}

/* Sequence of a slot: 2 n - 1 while cycle n is written, 2 n when it is complete. A reader of cycle
 * n reads 2 n before and after it; otherwise the cycle is not yet, or no longer, in the slot. Its
 * number in `last`, which readers load first, publishes all of it. */
void fsn_rt_record(struct fsn_rt *rt, uint64_t work_ns) {
    struct fsn_rt_recorder *r = &rt->recorder;
    const struct fsn_statistics *s = &rt->statistics;
    if (r->slots > 0) {
        const struct fsn_cycle cycle = {.cycle = s->cycles,
                                        .now_ns = s->now_ns,
                                        .dc_time_ns = rt->input.dc_time_ns,
                                        .late_ns = saturated(rt->late_ns),
                                        .work_ns = saturated(work_ns),
                                        .round_trip_ns = saturated(rt->input.round_trip_ns),
                                        .counts = rt->input.counts,
                                        .expected_wkc = s->expected_wkc,
                                        .actual_wkc = s->actual_wkc,
                                        .overruns = saturated(rt->left_out)};
        _Atomic uint64_t *sequence = r->words + (s->cycles % r->slots) * r->slot_words;
        /* mutants: only a reader in between sees this, see test_record.c */
        atomic_store_explicit(sequence, 2 * s->cycles - 1, memory_order_relaxed);
        atomic_thread_fence(memory_order_release);
        _Atomic uint64_t *words = fsn_words_put(sequence + 1, &cycle, sizeof cycle);
        words = fsn_words_put(words, rt->input.wkc, rt->datagram_count * sizeof *rt->input.wkc);
        fsn_words_put(words, rt->image, rt->image_bytes);
        atomic_store_explicit(sequence, 2 * s->cycles, memory_order_relaxed);
    }
    atomic_store_explicit(&r->last, s->cycles, memory_order_release);
}
