/** What a fuzz target and its seeds offer, and the FSoE chain they share. */
#ifndef FSN_FUZZ_H
#define FSN_FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "builder.h"
#include "fsn/fsn.h"

/** The target. Leaves the process when the code under test breaks a promise. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/** How often the target got where damaged input does not come: a plan that ran, a frame right in
 *  its chain. A target that stays at 0 with its own seeds tests nothing. */
extern uint64_t fuzz_reached;

/** Returns a good input, to be freed by the caller; NULL when there is none of this number. */
uint8_t *fuzz_seed(size_t number, size_t *len_bytes);

/** Reads the input from the front; zeros after its end. */
struct input {
    const uint8_t *at;
    size_t left;
};

uint8_t input_byte(struct input *in);
unsigned input_word(struct input *in);

/** An FSoE chain (§3) as both ends together keep it: bit by bit, shares no code with the core. */
struct chain {
    uint16_t sequence[2]; /**< number of the next frame, enum fsn_way */
    uint16_t own[2];      /**< CRC_0 of the last frame */
    bool has_own[2];
    uint16_t last_crc; /**< CRC_0 of the last frame of either direction */
    uint8_t last_way;  /**< who sent it; 2: no end */
};

/** Begins a chain, as a Reset does. */
void chain_clear(struct chain *chain);

/** Returns an FSoE frame length, made from any number. */
size_t chain_length(unsigned number);

/** Finishes a frame whose command, data and ConnID are there: writes its CRCs, continues the
 *  chain. */
void chain_finish(struct chain *chain, unsigned way, uint8_t *frame, size_t len_bytes);

#endif
