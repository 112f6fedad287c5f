/** One process after the other on a running bus: what the next one reads of the one before, and how
 *  it goes on from there. See docs/explanation/standby.md. */
#ifndef FSN_HANDOVER_H
#define FSN_HANDOVER_H

#include "fsn/core.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Bytes of a room in which the core shows its cycles; 0: no core. Context: any thread. */
FSN_API size_t fsn_core_room_bytes(const struct fsn_core *core);

/** Moves the pictures of fsn_core_snapshot() into memory that other processes may read. It costs
 *  the cycle nothing: the pictures only have another place.
 *  @param[in] room  fsn_core_room_bytes() bytes of zeros, on 64 bytes, every page touched once; it
 *                   must outlive the core.
 *  @retval FSN_E_ARG    no core or room.   @retval FSN_E_STATE  the thread runs, or it has one.
 *  Context: set-up. */
FSN_API FSN_MUST_USE fsn_status fsn_core_share(struct fsn_core *core, void *room);

/** Whether each cycle is shown before its frames go out, not after: while somebody follows, who
 * would else repeat older outputs where the process ends between the two. Then the frames wait for
 * counts, monitor and a copy of the image. NULL is allowed.   Context: any thread. */
FSN_API void fsn_core_show_first(struct fsn_core *core, bool first);

/** How often the core that owns a room has shown a cycle; it stands still when the cycle does.
 *  @param[in] room  which fsn_room_read() has taken once.   Context: any process. */
FSN_API uint32_t fsn_room_pictures(const void *room);

/** Reads the last whole picture of a room, whether its owner still lives or not.
 *  @param[in]  len_bytes    bytes of the room.
 *  @param[in]  image_bytes  bytes of the process image, which must be the same.
 *  @param[out] statistics   may be NULL.
 *  @param[out] image        `image_bytes`; may be NULL.
 *  @retval FSN_E_ARG   not a room, of a version with other counters, or with another image.
 *  @retval FSN_E_BUSY  at every attempt two cycles ended while it read; try again.
 *  Context: any process. */
FSN_API FSN_MUST_USE fsn_status fsn_room_read(const void *room, size_t len_bytes,
                                              uint32_t image_bytes,
                                              struct fsn_statistics *statistics, uint8_t *image);

/** Goes on from the last picture of another core with the same plan: its first cycle sends outputs
 *  as they were, it counts on from there, and keeps to its times. Cycles that nobody ran count as
 *  overruns of the first.
 *  @retval FSN_E_ARG    no core, statistics or image.   @retval FSN_E_STATE  it has run already.
 *  Context: set-up, right before fsn_core_start(). */
FSN_API FSN_MUST_USE fsn_status fsn_core_continue(struct fsn_core *core,
                                                  const struct fsn_statistics *statistics,
                                                  const uint8_t *image);

#ifdef __cplusplus
}
#endif

#endif
