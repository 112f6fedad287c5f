#include <stddef.h>

#include "rt/rt.h"
#include "rt/words.h"

enum {
    HEAD_BYTES = offsetof(struct fsn_statistics, latency), /* before the first histogram */
    TIMES_BYTES = offsetof(struct fsn_histogram, bucket)   /* before its first bucket */
};
_Static_assert(HEAD_BYTES % 8 == 0 && TIMES_BYTES % 8 == 0, "words of one part only");

/** Writes the rest of this snapshot; returns the word after the statistics. */
static _Atomic uint64_t *show_statistics(struct fsn_rt *rt, uint32_t picture) {
    struct fsn_rt_unshown *unshown = &rt->snapshot.unshown[picture];
    _Atomic uint64_t *words = rt->snapshot.words[picture];
    const uint8_t *bytes = (const uint8_t *)&rt->statistics;
    const bool all = unshown->count > FSN_RT_COUNTED;
    fsn_words_put(words, bytes, all ? sizeof rt->statistics : HEAD_BYTES);
    for (uint32_t i = 0; !all && i < unshown->count; i++) {
        const struct fsn_rt_counted at = unshown->counted[i];
        fsn_words_put(words + at.histogram, bytes + 8 * (size_t)at.histogram, TIMES_BYTES);
        fsn_words_put(words + at.bucket, bytes + 8 * (size_t)at.bucket, 8);
    }
    unshown->count = 0;
    return words + fsn_words_of(sizeof rt->statistics);
}

/* Only the cycle writes `whole`. A reader that reads a word of a newer snapshot also sees, after
 * its fence, that this snapshot has begun. */
void fsn_rt_publish(struct fsn_rt *rt) {
    struct fsn_rt_snapshot *s = &rt->snapshot;
    const uint32_t picture = atomic_load_explicit(&s->shown->whole, memory_order_relaxed) + 1;
    atomic_store_explicit(&s->shown->begun, picture, memory_order_relaxed);
    atomic_thread_fence(memory_order_release);
    _Atomic uint64_t *words = show_statistics(rt, picture % FSN_RT_PICTURES);
    for (uint32_t c = 0; c < rt->connection_count; c++) {
        struct fsn_rt_watch *watch = &rt->watches[c];
        if (watch->unshown > 0) {
            fsn_words_put(words, &rt->monitors[c].status, sizeof rt->monitors[c].status);
            watch->unshown--;
        }
        words += fsn_words_of(sizeof rt->monitors[c].status);
    }
    fsn_words_put(words, rt->image, rt->image_bytes);
    atomic_store_explicit(&s->shown->whole, picture, memory_order_release);
}
