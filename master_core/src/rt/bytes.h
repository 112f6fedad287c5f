/** Numbers in bytes, low byte first: as EtherCAT, FSoE and plan files have them. */
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

/** One byte of a CRC-32 of IEEE 802.3, which begins with ~0 and is inverted at its end. */
static inline uint32_t fsn_crc32_step(uint32_t crc, uint8_t byte) {
    crc ^= byte;
    for (unsigned bit = 0; bit < 8; bit++) {
        crc = crc >> 1 ^ ((crc & 1) != 0 ? 0xEDB88320U : 0);
    }
    return crc;
}

#endif
