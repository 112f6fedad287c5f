/** Adds up what buses count. */
#ifndef FSN_FRAME_COUNTS_H
#define FSN_FRAME_COUNTS_H

#include "fsn/bus.h"

/** Adds what was counted since `before`; NULL: all. */
static inline void fsn_add_counts(struct fsn_frame_counts *to, const struct fsn_frame_counts *now,
                                  const struct fsn_frame_counts *before) {
    static const struct fsn_frame_counts none;
    before = before == NULL ? &none : before;
    to->lost_frames += now->lost_frames - before->lost_frames;
    to->old_replies += now->old_replies - before->old_replies;
    to->foreign_frames += now->foreign_frames - before->foreign_frames;
    to->unsent_frames += now->unsent_frames - before->unsent_frames;
}

#endif
