/** Frames of the cyclic wire, built once from a plan. */
#ifndef FSN_FRAMES_H
#define FSN_FRAMES_H

#include "live/image.h"
#include "rt/wire.h"

/** Everything that the wire refers to. */
struct fsn_frames {
    struct fsn_wire wire; /**< sockets are -1, wait_ns and dc_every 0 until the caller sets them */
    struct fsn_image image;
    uint8_t *bytes;      /**< process image */
    uint32_t *group_wkc; /**< of the groups of the wire */
    uint8_t *storage;    /**< data of the frames: as sent, and both replies */
};

/** Builds image and frames; logical addresses are offsets in the image.
 *  @param[in] dc_station  station address of the DC reference clock; 0: no DC datagram.
 *  @param[in] dc_host     with a datagram that sets that clock.
 *  @retval FSN_E_NOMEM      out of memory.
 *  @retval FSN_E_BUS_IMAGE  a sync manager is longer than FSN_WIRE_LRW_BYTES, or there are more
 *                           than FSN_WIRE_FRAMES frames.
 *  To be freed by fsn_frames_free(), also after a refusal. */
fsn_status fsn_frames_create(const struct fsn_plan *plan, uint16_t dc_station, bool dc_host,
                             struct fsn_frames *frames);

/** Gives every frame its source address; see fsn_port_tag(). */
void fsn_frames_sign(struct fsn_frames *frames, uint16_t tag);

/** Frees the result of create; also frames that are all zeros. */
void fsn_frames_free(struct fsn_frames *frames);

#endif
