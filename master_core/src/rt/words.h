/** Bytes as relaxed 8-byte words: the cyclic thread publishes them in this form to readers that it
 *  never waits for. A sequence next to the words shows a reader whether they belong together. */
#ifndef FSN_WORDS_H
#define FSN_WORDS_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "rt/atomics.h"

/** Number of words for this number of bytes. */
static inline size_t fsn_words_of(size_t len_bytes) {
    return (len_bytes + 7) / 8;
}

/** Stores bytes; the last word is padded with zeros. Returns the word after them. */
static inline _Atomic uint64_t *fsn_words_put(_Atomic uint64_t *words, const void *from,
                                              size_t len_bytes) {
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

/** Loads bytes; `to` may be NULL to skip them. Returns the word after them. */
static inline const _Atomic uint64_t *fsn_words_take(const _Atomic uint64_t *from, void *to,
                                                     size_t len_bytes) {
    uint8_t *bytes = to;
    if (bytes == NULL) {
        return from + fsn_words_of(len_bytes);
    }
    for (; len_bytes >= 8; len_bytes -= 8, bytes += 8) {
        const uint64_t word = atomic_load_explicit(from++, memory_order_relaxed);
        memcpy(bytes, &word, 8);
    }
    if (len_bytes > 0) {
        const uint64_t word = atomic_load_explicit(from++, memory_order_relaxed);
        memcpy(bytes, &word, len_bytes);
    }
    return from;
}

#endif
