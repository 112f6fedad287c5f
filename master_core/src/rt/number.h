/** Values of symbols as numbers, without libm: clients link this too. */
#ifndef FSN_NUMBER_H
#define FSN_NUMBER_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "fsn/plan.h"

static inline bool fsn_is_real(uint8_t kind, uint16_t bits) {
    return kind == FSN_KIND_REAL && (bits == 32 || bits == 64);
}

/** The number for these bits of a type. */
static inline double fsn_number_of(uint8_t kind, uint16_t bits, uint64_t raw) {
    if (fsn_is_real(kind, bits) && bits == 32) {
        const uint32_t half = (uint32_t)raw;
        float number;
        memcpy(&number, &half, sizeof number);
        return (double)number;
    }
    if (fsn_is_real(kind, bits)) {
        double number;
        memcpy(&number, &raw, sizeof number);
        return number;
    }
    const uint64_t sign = UINT64_C(1) << (bits - 1);
    return kind == FSN_KIND_SIGNED && (raw & sign) != 0 ? -(double)((~raw & (sign - 1)) + 1)
                                                        : (double)raw;
}

/** The bits of an integer; false: it is outside the range of the type, and `raw` is unchanged. */
static inline bool fsn_bits_of_integer(uint8_t kind, uint16_t bits, bool is_negative,
                                       uint64_t magnitude, uint64_t *raw) {
    const uint64_t mask = bits == 64 ? UINT64_MAX : (UINT64_C(1) << bits) - 1;
    uint64_t most = kind == FSN_KIND_SIGNED ? mask >> 1 : mask;
    if (is_negative) {
        most = kind == FSN_KIND_SIGNED ? most + 1 : 0;
    }
    if (magnitude > most) {
        return false;
    }
    *raw = (is_negative ? 0 - magnitude : magnitude) & mask;
    return true;
}

/** The bits of a number, rounded where the type is not floating point, half away from zero; false:
 *  it is outside the range of the type. */
static inline bool fsn_bits_of(uint8_t kind, uint16_t bits, double number, uint64_t *raw) {
    if (fsn_is_real(kind, bits)) {
        const float narrow = (float)number;
        uint32_t half;
        if (number - number != 0 || (bits == 32 && narrow - narrow != 0)) {
            return false; /* not finite */
        }
        memcpy(&half, &narrow, sizeof half);
        memcpy(raw, &number, sizeof *raw);
        *raw = bits == 32 ? half : *raw;
        return true;
    }
    const double size = number < 0 ? -number : number;
    if (!(size < 0x1p64)) {
        return false;
    }
    const uint64_t below = (uint64_t)size;
    const uint64_t magnitude = below + (size - (double)below >= 0.5);
    return fsn_bits_of_integer(kind, bits, number < 0, magnitude, raw);
}

#endif
