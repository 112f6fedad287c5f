/** Whether a ring is closed, and where it is open: derived from frame counts and link states. */
#ifndef FSN_LIVE_RING_H
#define FSN_LIVE_RING_H

#include <stdbool.h>
#include <stdint.h>

#include "fsn/bus.h"

/** A SubDevice on the ring, in ring order. Bit n of the masks: port n has a link. */
struct fsn_ring_member {
    const char *name;
    bool answers;
    uint8_t had; /**< when the ring was last closed, or at the start */
    uint8_t has; /**< now */
};

/** An interface of the MainDevice. */
struct fsn_ring_end {
    const char *interface;
    bool link;
};

/** Counters of the cycle, see fsn_wire. */
struct fsn_ring_counts {
    uint32_t sent, came[2][2];
};

struct fsn_ring_watch {
    struct fsn_ring_counts last, since; /**< at the last judgement; between the last two */
    uint32_t bad;             /**< consecutive judgements without a frame in a direction */
    struct fsn_bus_ring ring; /**< fsn_ring_judge() does not write its `place` */
};

/** Judges each direction by the frames that passed since the last judgement. A direction without
 *  frames is lost at the second judgement, so that single lost frames do not open the ring. A
 *  silent bus is given more time if both interfaces have a link.
 *  @return whether there were frames to judge. */
bool fsn_ring_judge(struct fsn_ring_watch *watch, const struct fsn_ring_counts *now,
                    bool both_linked);

/** Whether no frame has returned between the last two checks. */
bool fsn_ring_silent(const struct fsn_ring_watch *watch);

/** Lists the gaps of an open ring, with their cables, as many as fit. */
void fsn_ring_place(const struct fsn_ring_watch *watch, const struct fsn_ring_member *members,
                    uint32_t count, const struct fsn_ring_end ends[2],
                    char place[FSN_DETAIL_BYTES]);

#endif
