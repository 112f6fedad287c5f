/** Numbers in bytes, low byte first, as in EtherCAT, FSoE and plan files. */
#ifndef FSN_BYTES_H
#define FSN_BYTES_H

#include <stdint.h>

static inline uint16_t fsn_get16(const uint8_t *at) {
    return (uint16_t)(at[0] | (at[1] << 8));
}

static inline uint32_t fsn_get32(const uint8_t *at) {
    return (uint32_t)at[0] | ((uint32_t)at[1] << 8) | ((uint32_t)at[2] << 16) |
           ((uint32_t)at[3] << 24);
}

static inline uint64_t fsn_get64(const uint8_t *at) {
    return (uint64_t)fsn_get32(at) | ((uint64_t)fsn_get32(at + 4) << 32);
}

static inline void fsn_put16(uint8_t *at, uint32_t value) {
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

static inline void fsn_put32(uint8_t *at, uint32_t value) {
    fsn_put16(at, value);
    fsn_put16(at + 2, value >> 16);
}

static inline void fsn_put64(uint8_t *at, uint64_t value) {
    fsn_put32(at, (uint32_t)value);
    fsn_put32(at + 4, (uint32_t)(value >> 32));
}

/** Writes up to 64 bits at any bit of an image; adjacent bits are unchanged. */
static inline void fsn_write_bits(uint8_t *image, uint32_t bit, uint32_t bits, uint64_t value) {
    while (bits > 0) {
        const uint32_t shift = bit % 8;
        const uint32_t now = bits < 8 - shift ? bits : 8 - shift;
        const uint8_t mask = (uint8_t)(((1u << now) - 1u) << shift);
        uint8_t *byte = image + bit / 8;
        *byte = (uint8_t)((*byte & ~mask) | (((uint32_t)(value & 0xFFu) << shift) & mask));
        value >>= now;
        bit += now;
        bits -= now;
    }
}

/** Reads up to 64 bits at any bit of an image. */
static inline uint64_t fsn_read_bits(const uint8_t *image, uint32_t bit, uint32_t bits) {
    uint64_t value = 0;
    for (uint32_t done = 0; done < bits;) {
        const uint32_t shift = (bit + done) % 8;
        const uint32_t now = bits - done < 8 - shift ? bits - done : 8 - shift;
        const uint64_t part = ((uint32_t)image[(bit + done) / 8] >> shift) & ((1u << now) - 1u);
        value |= part << done;
        done += now;
    }
    return value;
}

/** One byte of a CRC-32 of IEEE 802.3, with initial value ~0 and a final inversion. */
static inline uint32_t fsn_crc32_step(uint32_t crc, uint8_t byte) {
    crc ^= byte;
    for (unsigned bit = 0; bit < 8; bit++) {
        crc = crc >> 1 ^ ((crc & 1) != 0 ? 0xEDB88320U : 0);
    }
    return crc;
}

#endif
