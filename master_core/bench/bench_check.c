/** PDU check and monitor in nanoseconds per frame, against the limits 15 ns (6 bytes) and 60 ns
 *  (31 bytes), and against a CRC computed bit by bit. */
#define _POSIX_C_SOURCE 200809L

#include <stdio.h>
#include <string.h>
#include <time.h>

#include "fsn/fsn.h"

enum { FRAMES = 1024, ROUNDS = 4000, SLOW_ROUNDS = 100 };

static uint64_t clock_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static uint16_t slow_byte(uint16_t crc, uint8_t byte) {
    uint32_t rest = crc ^ (uint32_t)(byte << 8);
    for (int bit = 0; bit < 8; bit++) {
        rest = (rest & 0x8000u) != 0 ? (rest << 1) ^ 0x139B7u : rest << 1;
    }
    return (uint16_t)rest;
}

static uint16_t slow_block(const uint8_t *frame, size_t len, uint16_t old, uint16_t seq,
                           unsigned block) {
    const uint8_t head[] = {(uint8_t)old, (uint8_t)(old >> 8), frame[len - 2], frame[len - 1],
                            (uint8_t)seq, (uint8_t)(seq >> 8), frame[0]};
    uint16_t crc = 0;
    for (size_t i = 0; i < sizeof head; i++) {
        crc = slow_byte(crc, head[i]);
    }
    if (block > 0) {
        crc = slow_byte(slow_byte(crc, (uint8_t)block), 0);
    }
    const unsigned data = len == 6 ? 1 : 2;
    for (unsigned i = 0; i < data; i++) {
        crc = slow_byte(crc, frame[1 + 4 * block + i]);
    }
    return slow_byte(slow_byte(slow_byte(crc, 0), 0), 0);
}

/** Fills frames with right CRCs for (old = number, sequence = number + 1). */
static void fill(uint8_t (*frames)[255], size_t len) {
    for (unsigned n = 0; n < FRAMES; n++) {
        uint8_t *f = frames[n];
        for (size_t i = 0; i < len; i++) {
            f[i] = (uint8_t)(n * 31 + i * 7);
        }
        f[0] = FSN_CMD_PROCESS_DATA;
        const unsigned blocks = len == 6 ? 1 : (unsigned)(len - 3) / 4;
        for (unsigned b = 0; b < blocks; b++) {
            const uint16_t crc = slow_block(f, len, (uint16_t)n, (uint16_t)(n + 1), b);
            const size_t at = len == 6 ? 2 : 3 + 4 * b;
            f[at] = (uint8_t)crc;
            f[at + 1] = (uint8_t)(crc >> 8);
        }
    }
}

static double checks(uint8_t (*frames)[255], size_t len) {
    unsigned right = 0;
    const uint64_t start = clock_ns();
    for (unsigned r = 0; r < ROUNDS; r++) {
        for (unsigned n = 0; n < FRAMES; n++) {
            right += fsn_fsoe_check(frames[n], len, (uint16_t)n, (uint16_t)(n + 1));
        }
    }
    const uint64_t end = clock_ns();
    if (right != (unsigned)ROUNDS * FRAMES) {
        printf("wrong: %u of %u right\n", right, (unsigned)ROUNDS * FRAMES);
    }
    return (double)(end - start) / ROUNDS / FRAMES;
}

static double slow_checks(uint8_t (*frames)[255], size_t len) {
    unsigned right = 0;
    const uint64_t start = clock_ns();
    for (unsigned r = 0; r < SLOW_ROUNDS; r++) {
        for (unsigned n = 0; n < FRAMES; n++) {
            const unsigned blocks = len == 6 ? 1 : (unsigned)(len - 3) / 4;
            for (unsigned b = 0; b < blocks; b++) {
                right += slow_block(frames[n], len, (uint16_t)n, (uint16_t)(n + 1), b) != 0xABCD;
            }
        }
    }
    const uint64_t end = clock_ns();
    return right == 0 ? 0.0 : (double)(end - start) / SLOW_ROUNDS / FRAMES;
}

/** A bus cycle in which nothing is new, and one with a new frame. */
static double monitor(uint8_t (*frames)[255], size_t len, unsigned step) {
    struct fsn_monitor m;
    if (fsn_monitor_init(&m, (uint32_t)len, (uint32_t)len) != FSN_OK) {
        return 0.0;
    }
    const uint64_t start = clock_ns();
    for (unsigned r = 0; r < ROUNDS; r++) {
        for (unsigned n = 0; n < FRAMES; n++) {
            (void)fsn_monitor_frame(&m, n % 2 ? FSN_TO_MAIN : FSN_TO_SUB, frames[step * n % FRAMES],
                                    n);
        }
    }
    return (double)(clock_ns() - start) / ROUNDS / FRAMES;
}

int main(void) {
    static uint8_t frames[FRAMES][255];
    static const struct {
        size_t len;
        double limit_ns;
    } rows[] = {{6, 15}, {7, 15}, {31, 60}, {255, 0}};
    printf("PDU check    ns/frame   of limit   bit by bit/check   monitor same   monitor new\n");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        fill(frames, rows[i].len);
        const double ns = checks(frames, rows[i].len);
        const double of_limit = rows[i].limit_ns > 0 ? ns / rows[i].limit_ns : 0.0;
        printf("%3zu bytes   %8.1f   %8.2f   %16.1f   %12.1f   %11.1f\n", rows[i].len, ns, of_limit,
               slow_checks(frames, rows[i].len) / ns, monitor(frames, rows[i].len, 0),
               monitor(frames, rows[i].len, 1));
    }
    return 0;
}
