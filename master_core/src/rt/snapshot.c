#include "rt.h"
#include "words.h"

/* Sequence lock: odd while the words change. Readers see either nothing of a change or retry. */
void fsn_rt_publish(struct fsn_rt *rt) {
    struct fsn_rt_snapshot *s = &rt->snapshot;
    const uint32_t sequence = atomic_load_explicit(&s->sequence, memory_order_relaxed);
    atomic_store_explicit(&s->sequence, sequence + 1, memory_order_relaxed);
    atomic_thread_fence(memory_order_release);
    _Atomic uint64_t *words = fsn_words_put(s->words, &rt->statistics, sizeof rt->statistics);
    for (uint32_t c = 0; c < rt->connection_count; c++) {
        struct fsn_rt_watch *watch = &rt->watches[c];
        if (watch->changed) {
            fsn_words_put(words, &rt->monitors[c].status, sizeof rt->monitors[c].status);
            watch->changed = false;
        }
        words += fsn_words_of(sizeof rt->monitors[c].status);
    }
    fsn_words_put(words, rt->image, rt->image_bytes);
    atomic_store_explicit(&s->sequence, sequence + 2, memory_order_release);
}
