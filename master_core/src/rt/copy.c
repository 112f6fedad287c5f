#include "rt.h"

#include <string.h>

/* A constant size lets the compiler turn memcpy into one or two loads and stores, which is why
 * copies are grouped by size: the only branch is per group, none per copy, none on data. */
#define COPY_CASE(n)                                                                               \
    case n:                                                                                        \
        for (; copy != end; copy++) {                                                              \
            memcpy(image + copy->destination, image + copy->source, n);                            \
        }                                                                                          \
        break;
#define COPY_CASES_4(n) COPY_CASE(n) COPY_CASE((n) + 1) COPY_CASE((n) + 2) COPY_CASE((n) + 3)
#define COPY_CASES_16(n)                                                                           \
    COPY_CASES_4(n) COPY_CASES_4((n) + 4) COPY_CASES_4((n) + 8) COPY_CASES_4((n) + 12)

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
            for (; copy != end; copy++) {
                memcpy(image + copy->destination, image + copy->source, groups[g].size_bytes);
            }
        }
    }
}
