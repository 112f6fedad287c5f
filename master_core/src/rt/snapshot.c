#include "rt.h"

#include <string.h>

/** Stores bytes as relaxed 8-byte words; the last word is padded with zeros. */
static _Atomic uint64_t *put(_Atomic uint64_t *words, const void *from, size_t len_bytes) {
    const uint8_t *bytes = from;
    for (; len_bytes >= 8; len_bytes -= 8, bytes += 8) {
        uint64_t word;
        memcpy(&word, bytes, 8);
        atomic_store_explicit(words++, word, memory_order_relaxed);
    }
    if (len_bytes > 0) {
        uint64_t word = 0;
        memcpy(&word, bytes, len_bytes);
        atomic_store_explicit(words++, word, memory_order_relaxed);
    }
    return words;
}

/* Sequence lock: odd while the words change. Readers see either nothing of a change or retry. */
void fsn_rt_publish(struct fsn_rt *rt) {
    struct fsn_rt_snapshot *s = &rt->snapshot;
    const uint32_t sequence = atomic_load_explicit(&s->sequence, memory_order_relaxed);
    atomic_store_explicit(&s->sequence, sequence + 1, memory_order_relaxed);
    atomic_thread_fence(memory_order_release);
    _Atomic uint64_t *words = put(s->words, &rt->statistics, sizeof rt->statistics);
    for (uint32_t c = 0; c < rt->connection_count; c++) {
        struct fsn_rt_watch *watch = &rt->watches[c];
        if (watch->changed) {
            put(words, &rt->monitors[c].status, sizeof rt->monitors[c].status);
            watch->changed = false;
        }
        words += (sizeof rt->monitors[c].status + 7) / 8;
    }
    put(words, rt->image, rt->image_bytes);
    atomic_store_explicit(&s->sequence, sequence + 2, memory_order_release);
}
