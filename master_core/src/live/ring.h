/** Whether a ring is closed, and where it is open: from frames that were counted and links that
 *  were read. */
#ifndef FSN_LIVE_RING_H
#define FSN_LIVE_RING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fsn/bus.h"

/** A SubDevice on the ring, in ring order. Bit n of the masks: port n has a link. */
struct fsn_ring_member {
    const char *name;
    bool answers;
    uint8_t had; /**< when the ring was closed last, or at the start */
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
    uint32_t bad;                       /**< judgements in a row that a way was not passed */
    struct fsn_bus_ring ring;           /**< its place is not written by fsn_ring_judge() */
};

/** Judges each way by the frames that passed it since the last judgement; one that nothing passed
 *  is lost at the second judgement, so that some lost frames open no ring. A bus that is silent
 *  while both interfaces have a link is given longer.
 *  @return whether there was something to judge. */
bool fsn_ring_judge(struct fsn_ring_watch *watch, const struct fsn_ring_counts *now,
                    bool both_linked);

/** Whether no frame has come back between the last two checks. */
bool fsn_ring_silent(const struct fsn_ring_watch *watch);

/** Names the gaps of a ring that is not closed, with their cables, as many as there is room for. */
void fsn_ring_place(const struct fsn_ring_watch *watch, const struct fsn_ring_member *members,
                    uint32_t count, const struct fsn_ring_end ends[2],
                    char place[FSN_DETAIL_BYTES]);

#endif
