#include "rt/rt.h"
#include "rt/words.h"

/* Only the cycle writes `whole`. A reader that meets a word of a newer picture also sees, after its
 * fence, that this picture was begun. */
void fsn_rt_publish(struct fsn_rt *rt) {
    struct fsn_rt_snapshot *s = &rt->snapshot;
    const uint32_t picture = atomic_load_explicit(&s->shown->whole, memory_order_relaxed) + 1;
    atomic_store_explicit(&s->shown->begun, picture, memory_order_relaxed);
    atomic_thread_fence(memory_order_release);
    _Atomic uint64_t *words =
        fsn_words_put(s->words[picture % FSN_RT_PICTURES], &rt->statistics, sizeof rt->statistics);
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
