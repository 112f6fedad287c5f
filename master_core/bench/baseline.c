#include "baseline.h"

#include <string.h>

void plain_loop(const struct plain_copy *copies, size_t count) {
    for (size_t i = 0; i < count; i++) {
        memcpy(copies[i].to, copies[i].from, copies[i].size_bytes);
    }
}

#define CONSTANT(bytes)                                                                            \
    case bytes:                                                                                    \
        for (; at != end; at++) {                                                                  \
            memcpy(image + (*at)[1], image + (*at)[0], bytes);                                     \
        }                                                                                          \
        break;

void constant_sizes(uint8_t *restrict image, const struct constant_part *parts, size_t count) {
    for (size_t i = 0; i < count; i++) {
        const uint32_t(*at)[2] = parts[i].offset;
        const uint32_t(*const end)[2] = at + parts[i].count;
        switch (parts[i].size_bytes) { BASELINE_SIZES(CONSTANT) }
    }
}
