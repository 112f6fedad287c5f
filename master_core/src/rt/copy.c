#include "rt/rt.h"

#include <string.h>

/* A constant size lets the compiler turn memcpy into one to four loads and stores, which is why
 * copies are grouped by size: the only branch is per group, not per copy, and not on data.
 *
 * Above 64 bytes: whole blocks of 16 with a constant count, then the last 16 bytes again from the
 * end. Both parts stay inside the range, so no byte outside it is ever written. Because sources are
 * inputs and destinations are outputs, no byte is read after it was written. */
enum { BLOCK = 16 };

#define EACH_COPY for (; copy != end; copy++)
#define COPY_CASE(n)                                                                               \
    case n:                                                                                        \
        EACH_COPY {                                                                                \
            memcpy(image + copy->destination, image + copy->source, n);                            \
        }                                                                                          \
        break;
#define COPY_CASES_4(n) COPY_CASE(n) COPY_CASE((n) + 1) COPY_CASE((n) + 2) COPY_CASE((n) + 3)
#define COPY_CASES_16(n)                                                                           \
    COPY_CASES_4(n) COPY_CASES_4((n) + 4) COPY_CASES_4((n) + 8) COPY_CASES_4((n) + 12)
#define BLOCKS_CASE(blocks)                                                                        \
    case blocks:                                                                                   \
        EACH_COPY {                                                                                \
            uint8_t *const to = image + copy->destination;                                         \
            const uint8_t *const from = image + copy->source;                                      \
            memcpy(to, from, (blocks) * BLOCK);                                                    \
            memcpy(to + size_bytes - BLOCK, from + size_bytes - BLOCK, BLOCK);                     \
        }                                                                                          \
        break;

/** Copies of one size above 64 bytes. */
static void copy_large(uint8_t *restrict image, const struct fsn_rt_copy *copy,
                       const struct fsn_rt_copy *const end, uint32_t size_bytes) {
    switch ((size_bytes - 1) / BLOCK) {
        BLOCKS_CASE(4)
        BLOCKS_CASE(5)
        BLOCKS_CASE(6)
        BLOCKS_CASE(7)
        BLOCKS_CASE(8)
        BLOCKS_CASE(9)
        BLOCKS_CASE(10)
        BLOCKS_CASE(11)
        BLOCKS_CASE(12)
        BLOCKS_CASE(13)
        BLOCKS_CASE(14)
        BLOCKS_CASE(15)
    default:
        EACH_COPY {
            memcpy(image + copy->destination, image + copy->source, size_bytes);
        }
    }
}

void fsn_rt_copy_all(uint8_t *restrict image, const struct fsn_rt_copy *copies,
                     const struct fsn_rt_group *groups, uint32_t group_count) {
    for (uint32_t g = 0; g < group_count; g++) {
        const struct fsn_rt_copy *copy = copies + groups[g].first;
        const struct fsn_rt_copy *const end = copy + groups[g].count;
        switch (groups[g].size_bytes) {
            COPY_CASES_16(1)
            COPY_CASES_16(17)
            COPY_CASES_16(33)
            COPY_CASES_16(49)
        default:
            copy_large(image, copy, end, groups[g].size_bytes);
        }
    }
}
