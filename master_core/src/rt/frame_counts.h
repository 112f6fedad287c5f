/** Adds up what buses count. */
#ifndef FSN_FRAME_COUNTS_H
#define FSN_FRAME_COUNTS_H

#include "fsn/bus.h"

#define FSN_BYTES(name) +sizeof((struct fsn_frame_counts *)0)->name
_Static_assert(sizeof(struct fsn_frame_counts) == 0 FSN_FRAME_COUNT_TABLE(FSN_BYTES),
               "a field is missing in FSN_FRAME_COUNT_TABLE");
#undef FSN_BYTES

/** Adds what was counted since `before`; NULL: all. */
static inline void fsn_add_counts(struct fsn_frame_counts *to, const struct fsn_frame_counts *now,
                                  const struct fsn_frame_counts *before) {
    static const struct fsn_frame_counts none;
    before = before == NULL ? &none : before;
#define FSN_ADD(name) to->name += now->name - before->name;
    FSN_FRAME_COUNT_TABLE(FSN_ADD)
#undef FSN_ADD
}

#endif
