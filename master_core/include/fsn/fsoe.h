/** FSoE frames as bytes: lengths, commands, CRCs. Nothing here sends or changes a frame.
 *
 *  Compared with independent implementations, not checked against ETG.5100 and not conformance
 *  tested. Section numbers (§) are those of docs/explanation/fsoe-engine.md. */
#ifndef FSN_FSOE_H
#define FSN_FSOE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fsn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FSN_MIN_FRAME_BYTES = 6, FSN_MAX_FRAME_BYTES = 255 };

/** First byte of a frame (§1). */
enum fsn_command {
    FSN_CMD_RESET = 0x2A,
    FSN_CMD_SESSION = 0x4E,
    FSN_CMD_CONNECTION = 0x64,
    FSN_CMD_PARAMETER = 0x52,
    FSN_CMD_PROCESS_DATA = 0x36,
    FSN_CMD_FAILSAFE_DATA = 0x08
};

/** Whether an FSoE frame can have this length: 6, 7, 11, 15 … 255 bytes (§1). Context: any. */
FSN_API bool fsn_fsoe_is_frame_length(size_t len_bytes);

/** ConnID of a frame: its last two bytes, low byte first. `len_bytes` is a frame length.
 *  Context: any. */
FSN_API uint16_t fsn_fsoe_connection_id(const uint8_t *frame, size_t len_bytes);

/** CRC_0 as in the frame, correct or not. `len_bytes` is a frame length. Context: any. */
FSN_API uint16_t fsn_fsoe_crc0(const uint8_t *frame, size_t len_bytes);

/** Expected CRC_0 (§2), with the ConnID of the frame.
 *  @param[in] old_crc   CRC_0 of the previous frame in either direction; 0 after a Reset.
 *  @param[in] sequence  1 … 65535.
 *  Context: any thread. RT-safe. Cost: a dozen table look-ups. */
FSN_API uint16_t fsn_fsoe_expected_crc0(const uint8_t *frame, size_t len_bytes, uint16_t old_crc,
                                        uint16_t sequence);

/** Whether all CRCs of a frame are correct for this old CRC and sequence number (§2).
 *  @retval false  a CRC differs, or invalid FSoE frame length.
 *  Context: any thread. RT-safe. Cost: O(length). */
FSN_API bool fsn_fsoe_check(const uint8_t *frame, size_t len_bytes, uint16_t old_crc,
                            uint16_t sequence);

/** The only sequence number for which CRC_0 of a frame is correct; FSoE never uses 0.
 *  Context: any thread. RT-safe. Cost: constant. */
FSN_API uint16_t fsn_fsoe_solve_sequence(const uint8_t *frame, size_t len_bytes, uint16_t old_crc);

/** Whether the blocks of a frame match each other, whatever old CRC and sequence number are: 16
 *  bits of evidence for each block except the first, none for a frame of one block.
 *  @param[out] blocks  number of matching blocks, from the first on; may be NULL.
 *  Context: any thread. RT-safe. Cost: O(length). */
FSN_API bool fsn_fsoe_is_whole(const uint8_t *frame, size_t len_bytes, unsigned *blocks);

#ifdef __cplusplus
}
#endif

#endif
