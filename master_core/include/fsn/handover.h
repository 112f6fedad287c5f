/** Handover of a running bus to another process: the data that the successor reads from its
 *  predecessor, and how it continues. See docs/explanation/standby.md. */
#ifndef FSN_HANDOVER_H
#define FSN_HANDOVER_H

#include "fsn/core.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Size in bytes of the memory in which the core publishes its cycles; 0: no core. Context: any
 *  thread. */
FSN_API size_t fsn_core_room_bytes(const struct fsn_core *core);

/** Moves the snapshots of fsn_core_snapshot() into memory that other processes may read. This has
 *  no cost in the cycle: only the address of the snapshots changes.
 *  @param[in] room  fsn_core_room_bytes() bytes of zeros, 64-byte aligned, every page touched once;
 *                   it must outlive the core.
 *  @retval FSN_E_ARG    no core or room.   @retval FSN_E_STATE  the thread runs, or it has one.
 *  Context: set-up. */
FSN_API FSN_MUST_USE fsn_status fsn_core_share(struct fsn_core *core, void *room);

/** Whether each cycle is published before its frames are sent, not after. Set it while a successor
 *  follows: it would repeat older outputs if this process ended between the two. The frames then
 *  wait for counts, monitor and a copy of the image. NULL is allowed.   Context: any thread. */
FSN_API void fsn_core_show_first(struct fsn_core *core, bool first);

/** Number of cycles published by the core that owns a room; constant while the cycle is stopped.
 *  @param[in] room  accepted by fsn_room_read() once.   Context: any process. */
FSN_API uint32_t fsn_room_pictures(const void *room);

/** Reads the last complete snapshot of a room, even after its owner has ended.
 *  @param[in]  len_bytes    bytes of the room.
 *  @param[in]  image_bytes  bytes of the process image, which must be the same.
 *  @param[out] statistics   may be NULL.
 *  @param[out] image        `image_bytes`; may be NULL.
 *  @retval FSN_E_ARG   not a room, of a version with other counters, or with another image.
 *  @retval FSN_E_BUSY  at every attempt two cycles ended during the read; try again.
 *  Context: any process. */
FSN_API FSN_MUST_USE fsn_status fsn_room_read(const void *room, size_t len_bytes,
                                              uint32_t image_bytes,
                                              struct fsn_statistics *statistics, uint8_t *image);

/** Continues from the last snapshot of another core with the same plan: its first cycle sends the
 *  outputs unchanged, it continues the counts, and keeps the cycle times. Cycles that no process
 *  ran count as overruns of the first.
 *  @retval FSN_E_ARG    no core, statistics or image.   @retval FSN_E_STATE  it has already run.
 *  Context: set-up, right before fsn_core_start(). */
FSN_API FSN_MUST_USE fsn_status fsn_core_continue(struct fsn_core *core,
                                                  const struct fsn_statistics *statistics,
                                                  const uint8_t *image);

#ifdef __cplusplus
}
#endif

#endif
