/** Memory for the cyclic path. */
#ifndef FSN_PREFAULT_H
#define FSN_PREFAULT_H

#include <stdint.h>
#include <stdlib.h>

/** Allocates zeros like calloc, and touches all pages once: without locked memory, each untouched
 *  page would cause a page fault in the first cycle that writes it. To be freed by free(). */
static inline void *fsn_calloc_prefaulted(size_t count, size_t size_bytes) {
    enum { STEP_BYTES = 1024 }; /* no page is smaller */
    volatile uint8_t *bytes = calloc(count, size_bytes);
    const size_t len_bytes = bytes != NULL ? count * size_bytes : 0;
    for (size_t at = 0; at < len_bytes; at += STEP_BYTES) {
        bytes[at] = 0;
    }
    if (len_bytes > 0) {
        bytes[len_bytes - 1] = 0;
    }
    return (void *)bytes;
}

/** The same for `count` elements of an array and one more; returns whether there was memory. */
#define FSN_NEW_PREFAULTED(array, count)                                                           \
    (((array) = fsn_calloc_prefaulted((size_t)(count) + 1, sizeof *(array))) != NULL)

#endif
