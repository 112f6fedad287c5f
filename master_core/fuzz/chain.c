#include "fuzz.h"

#include <string.h>

uint8_t input_byte(struct input *in) {
    if (in->left == 0) {
        return 0;
    }
    in->left--;
    return *in->at++;
}

unsigned input_word(struct input *in) {
    const unsigned low = input_byte(in);
    return low | (unsigned)input_byte(in) << 8;
}

void chain_clear(struct chain *chain) {
    *chain = (struct chain){.sequence = {1, 1}, .last_way = 2};
}

size_t chain_length(unsigned number) {
    const unsigned blocks = number % 64;
    return blocks == 0 ? FSN_MIN_FRAME_BYTES : 3 + 4 * blocks;
}

static uint16_t crc_byte(uint16_t crc, uint8_t byte) {
    uint32_t rest = crc ^ (uint32_t)byte << 8;
    for (int bit = 0; bit < 8; bit++) {
        rest = (rest & 0x8000u) != 0 ? (rest << 1) ^ 0x139B7u : rest << 1;
    }
    return (uint16_t)rest;
}

static uint16_t crc_word(uint16_t crc, unsigned word) {
    return crc_byte(crc_byte(crc, (uint8_t)word), (uint8_t)(word >> 8));
}

/** CRC of one block (§2): the old CRC, ConnID, sequence, command, the number of a block but the
 *  first, the data, and zeros. */
static uint16_t block_crc(const uint8_t *frame, size_t len, uint16_t old_crc, uint16_t sequence,
                          unsigned block) {
    const size_t data_bytes = len == FSN_MIN_FRAME_BYTES ? 1 : 2;
    uint16_t crc = crc_word(0, old_crc);
    crc = crc_word(crc, fsn_fsoe_connection_id(frame, len));
    crc = crc_byte(crc_word(crc, sequence), frame[0]);
    crc = block > 0 ? crc_word(crc, block) : crc;
    for (size_t i = 0; i < data_bytes; i++) {
        crc = crc_byte(crc, frame[1 + 4 * block + i]);
    }
    return crc_byte(crc_word(crc, 0), 0);
}

static uint16_t advance(uint16_t sequence) {
    return sequence == 0xFFFF ? 1 : (uint16_t)(sequence + 1);
}

void chain_finish(struct chain *chain, unsigned way, uint8_t *frame, size_t len) {
    uint16_t sequence = chain->sequence[way];
    if (chain->has_own[way] &&
        block_crc(frame, len, chain->last_crc, sequence, 0) == chain->own[way]) {
        sequence = advance(sequence);
    }
    const unsigned blocks = len == FSN_MIN_FRAME_BYTES ? 1 : (unsigned)(len - 3) / 4;
    for (unsigned block = 0; block < blocks; block++) {
        const uint16_t crc = block_crc(frame, len, chain->last_crc, sequence, block);
        uint8_t *at = frame + (len == FSN_MIN_FRAME_BYTES ? 2 : 3 + 4 * block);
        at[0] = (uint8_t)crc;
        at[1] = (uint8_t)(crc >> 8);
    }
    CHECK(fsn_fsoe_check(frame, len, chain->last_crc, sequence));
    CHECK(fsn_fsoe_solve_sequence(frame, len, chain->last_crc) == sequence);
    CHECK(fsn_fsoe_is_whole(frame, len, NULL));
    chain->sequence[way] = advance(sequence);
    chain->own[way] = fsn_fsoe_crc0(frame, len);
    chain->has_own[way] = true;
    chain->last_crc = chain->own[way];
    chain->last_way = (uint8_t)way;
}
