/** CRC-16 of FSoE (§2), polynomial 0x139B7, by tables: a CRC that starts from 0 is linear, so the
 *  CRC of a block is the XOR of the CRCs of its bytes, each followed by as many zero bytes as the
 *  block has after it. No step depends on the previous one. */
#include "fsn/fsoe.h"

enum { POLYNOMIAL = 0x139B7, FIRST = 3, LAST = 13 };

/* Builds a table from the CRCs of its eight single bits. */
#define BIT(n, bit, crc) (((n) >> (bit)) & 1 ? (crc) : 0)
#define CRC(n, a, b, c, d, e, f, g, h)                                                             \
    (uint16_t)(BIT(n, 0, a) ^ BIT(n, 1, b) ^ BIT(n, 2, c) ^ BIT(n, 3, d) ^ BIT(n, 4, e) ^          \
               BIT(n, 5, f) ^ BIT(n, 6, g) ^ BIT(n, 7, h))
#define CRC4(n, ...)                                                                               \
    CRC(n, __VA_ARGS__), CRC((n) + 1, __VA_ARGS__), CRC((n) + 2, __VA_ARGS__),                     \
        CRC((n) + 3, __VA_ARGS__)
#define CRC16(n, ...)                                                                              \
    CRC4(n, __VA_ARGS__), CRC4((n) + 4, __VA_ARGS__), CRC4((n) + 8, __VA_ARGS__),                  \
        CRC4((n) + 12, __VA_ARGS__)
#define CRC64(n, ...)                                                                              \
    CRC16(n, __VA_ARGS__), CRC16((n) + 16, __VA_ARGS__), CRC16((n) + 32, __VA_ARGS__),             \
        CRC16((n) + 48, __VA_ARGS__)
#define TABLE(...)                                                                                 \
    CRC64(0, __VA_ARGS__), CRC64(64, __VA_ARGS__), CRC64(128, __VA_ARGS__), CRC64(192, __VA_ARGS__)

/* Row n - FIRST: CRCs of a byte followed by n zero bytes; n from FIRST to LAST. */
static const uint16_t table[LAST - FIRST + 1][256] = {
    {TABLE(0x7648, 0xEC90, 0xE097, 0xF899, 0xC885, 0xA8BD, 0x68CD, 0xD19A)}, /* 3 */
    {TABLE(0x9A83, 0x0CB1, 0x1962, 0x32C4, 0x6588, 0xCB10, 0xAF97, 0x6699)}, /* 4 */
    {TABLE(0xCD32, 0xA3D3, 0x7E11, 0xFC22, 0xC1F3, 0xBA51, 0x4D15, 0x9A2A)}, /* 5 */
    {TABLE(0x0DE3, 0x1BC6, 0x378C, 0x6F18, 0xDE30, 0x85D7, 0x3219, 0x6432)}, /* 6 */
    {TABLE(0xC864, 0xA97F, 0x6B49, 0xD692, 0x9493, 0x1091, 0x2122, 0x4244)}, /* 7 */
    {TABLE(0x8488, 0x30A7, 0x614E, 0xC29C, 0xBC8F, 0x40A9, 0x8152, 0x3B13)}, /* 8 */
    {TABLE(0x7626, 0xEC4C, 0xE12F, 0xFBE9, 0xCE65, 0xA57D, 0x734D, 0xE69A)}, /* 9 */
    {TABLE(0xF483, 0xD0B1, 0x98D5, 0x081D, 0x103A, 0x2074, 0x40E8, 0x81D0)}, /* 10 */
    {TABLE(0x3A17, 0x742E, 0xE85C, 0xE90F, 0xEBA9, 0xEEE5, 0xE47D, 0xF14D)}, /* 11 */
    {TABLE(0xDB2D, 0x8FED, 0x266D, 0x4CDA, 0x99B4, 0x0ADF, 0x15BE, 0x2B7C)}, /* 12 */
    {TABLE(0x56F8, 0xADF0, 0x6257, 0xC4AE, 0xB0EB, 0x5861, 0xB0C2, 0x5833)}, /* 13 */
};

static uint16_t byte_crc(uint8_t byte, unsigned zeros) {
    return table[zeros - FIRST][byte];
}

/** Bytes before the data: old CRC, ConnID, sequence, command; `zeros` bytes follow. */
static inline uint16_t head_crc(const uint8_t *frame, uint16_t id, uint16_t old_crc,
                                uint16_t sequence, unsigned zeros) {
    return (uint16_t)(byte_crc((uint8_t)old_crc, zeros + 6) ^
                      byte_crc((uint8_t)(old_crc >> 8), zeros + 5) ^
                      byte_crc((uint8_t)id, zeros + 4) ^ byte_crc((uint8_t)(id >> 8), zeros + 3) ^
                      byte_crc((uint8_t)sequence, zeros + 2) ^
                      byte_crc((uint8_t)(sequence >> 8), zeros + 1) ^ byte_crc(frame[0], zeros));
}

static inline uint16_t data_crc(const uint8_t *data) {
    return (uint16_t)(byte_crc(data[0], 4) ^ byte_crc(data[1], 3));
}

static inline uint16_t word(const uint8_t *at) {
    return (uint16_t)(at[0] | (at[1] << 8));
}

bool fsn_fsoe_is_frame_length(size_t len_bytes) {
    return len_bytes == FSN_MIN_FRAME_BYTES ||
           (len_bytes >= 7 && len_bytes <= FSN_MAX_FRAME_BYTES && len_bytes % 4 == 3);
}

static unsigned blocks_of(size_t len_bytes) {
    return len_bytes == FSN_MIN_FRAME_BYTES ? 1 : (unsigned)(len_bytes - 3) / 4;
}

uint16_t fsn_fsoe_connection_id(const uint8_t *frame, size_t len_bytes) {
    return word(frame + len_bytes - 2);
}

uint16_t fsn_fsoe_crc0(const uint8_t *frame, size_t len_bytes) {
    return word(frame + (len_bytes == FSN_MIN_FRAME_BYTES ? 2 : 3));
}

uint16_t fsn_fsoe_expected_crc0(const uint8_t *frame, size_t len_bytes, uint16_t old_crc,
                                uint16_t sequence) {
    const uint16_t id = fsn_fsoe_connection_id(frame, len_bytes);
    if (len_bytes == FSN_MIN_FRAME_BYTES) {
        return head_crc(frame, id, old_crc, sequence, 4) ^ byte_crc(frame[1], 3);
    }
    return head_crc(frame, id, old_crc, sequence, 5) ^ data_crc(frame + 1);
}

/** Counts the blocks after the first that match a head. The number of a block, which is below 63,
 *  is between head and data. */
static unsigned fitting_blocks(const uint8_t *frame, unsigned blocks, uint16_t head) {
    unsigned n = 1;
    while (n < blocks) {
        const uint8_t *block = frame + 1 + 4 * n;
        if ((head ^ byte_crc((uint8_t)n, 6) ^ data_crc(block)) != word(block + 2)) {
            break;
        }
        n++;
    }
    return n;
}

bool fsn_fsoe_check(const uint8_t *frame, size_t len_bytes, uint16_t old_crc, uint16_t sequence) {
    if (!fsn_fsoe_is_frame_length(len_bytes)) {
        return false;
    }
    if (fsn_fsoe_expected_crc0(frame, len_bytes, old_crc, sequence) !=
        fsn_fsoe_crc0(frame, len_bytes)) {
        return false;
    }
    const unsigned blocks = blocks_of(len_bytes);
    if (blocks < 2) { /* mutants: one block fits itself, this is only quicker */
        return true;
    }
    const uint16_t id = fsn_fsoe_connection_id(frame, len_bytes);
    const uint16_t head = head_crc(frame, id, old_crc, sequence, 7);
    return fitting_blocks(frame, blocks, head) == blocks;
}

/** Reverts a register by zero bits that were shifted in. */
static uint16_t shift_back(uint16_t crc, unsigned bits) {
    uint32_t rest = crc;
    for (; bits > 0; bits--) {
        rest = (rest & 1) != 0 ? (rest ^ POLYNOMIAL) >> 1 : rest >> 1;
    }
    return (uint16_t)rest;
}

uint16_t fsn_fsoe_solve_sequence(const uint8_t *frame, size_t len_bytes, uint16_t old_crc) {
    const uint16_t rest =
        fsn_fsoe_crc0(frame, len_bytes) ^ fsn_fsoe_expected_crc0(frame, len_bytes, old_crc, 0);
    const unsigned bytes_behind = len_bytes == FSN_MIN_FRAME_BYTES ? 5 : 6;
    const uint16_t swapped = shift_back(rest, 16 + 8 * bytes_behind);
    return (uint16_t)((swapped << 8) | (swapped >> 8));
}

/** Shifts zero bits into a register. */
static uint16_t shift(uint16_t crc, unsigned bits) {
    uint32_t rest = crc;
    for (; bits > 0; bits--) {
        rest = (rest & 0x8000u) != 0 ? (rest << 1) ^ POLYNOMIAL : rest << 1;
    }
    return (uint16_t)rest;
}

bool fsn_fsoe_is_whole(const uint8_t *frame, size_t len_bytes, unsigned *blocks) {
    const unsigned all = blocks_of(len_bytes);
    unsigned fitting = 1;
    if (all >= 2) {
        /* Share of the head in the CRC of the first block, followed by two more zero bytes. */
        const uint16_t head = shift(fsn_fsoe_crc0(frame, len_bytes) ^ data_crc(frame + 1), 16);
        fitting = fitting_blocks(frame, all, head);
    }
    if (blocks != NULL) {
        *blocks = fitting;
    }
    return fitting == all;
}
