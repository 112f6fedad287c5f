/** SHA-256 (FIPS 180-4), for the fingerprint of a plan and for files; the checksum of an SII. */
#define _POSIX_C_SOURCE 200809L /* pread */

#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "plan/plan_internal.h"

static const uint32_t round_constant[64] = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};

static uint32_t turn(uint32_t value, unsigned bits) {
    return (value >> bits) | (value << (32 - bits));
}

static void schedule(const uint8_t *block, uint32_t w[64]) {
    for (unsigned i = 0; i < 16; i++) {
        const uint8_t *b = block + 4 * i;
        w[i] = ((uint32_t)b[0] << 24) | ((uint32_t)b[1] << 16) | ((uint32_t)b[2] << 8) | b[3];
    }
    for (unsigned i = 16; i < 64; i++) {
        const uint32_t s0 = turn(w[i - 15], 7) ^ turn(w[i - 15], 18) ^ (w[i - 15] >> 3);
        const uint32_t s1 = turn(w[i - 2], 17) ^ turn(w[i - 2], 19) ^ (w[i - 2] >> 10);
        w[i] = w[i - 16] + s0 + w[i - 7] + s1;
    }
}

static void compress(uint32_t state[8], const uint8_t *block) {
    uint32_t w[64];
    uint32_t v[8];
    schedule(block, w);
    memcpy(v, state, sizeof v);
    for (unsigned i = 0; i < 64; i++) {
        const uint32_t s1 = turn(v[4], 6) ^ turn(v[4], 11) ^ turn(v[4], 25);
        /* mutants: the two share no bit */
        const uint32_t choice = (v[4] & v[5]) ^ (~v[4] & v[6]);
        const uint32_t t1 = v[7] + s1 + choice + round_constant[i] + w[i];
        const uint32_t s0 = turn(v[0], 2) ^ turn(v[0], 13) ^ turn(v[0], 22);
        const uint32_t majority = (v[0] & v[1]) ^ (v[0] & v[2]) ^ (v[1] & v[2]);
        memmove(v + 1, v, 7 * sizeof v[0]);
        v[4] += t1;
        v[0] = t1 + s0 + majority;
    }
    for (unsigned i = 0; i < 8; i++) {
        state[i] += v[i];
    }
}

void fsn_sha256_start(struct fsn_sha256_run *run) {
    *run = (struct fsn_sha256_run){.state = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                             0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19}};
}

void fsn_sha256_add(struct fsn_sha256_run *run, const void *bytes, size_t len_bytes) {
    const uint8_t *at = bytes;
    size_t left = len_bytes;
    run->len_bytes += len_bytes;
    while (left > 0) {
        if (run->kept == 0 && left >= sizeof run->block) {
            compress(run->state, at);
            at += sizeof run->block;
            left -= sizeof run->block;
            continue;
        }
        const size_t room = sizeof run->block - run->kept;
        const size_t taken = left < room ? left : room;
        memcpy(run->block + run->kept, at, taken);
        run->kept += taken;
        at += taken;
        left -= taken;
        if (run->kept == sizeof run->block) {
            compress(run->state, run->block);
            run->kept = 0;
        }
    }
}

void fsn_sha256_end(struct fsn_sha256_run *run, uint8_t digest[FSN_SHA256_BYTES]) {
    const uint64_t bits = run->len_bytes * 8;
    uint8_t last[128] = {0};
    memcpy(last, run->block, run->kept);
    last[run->kept] = 0x80;
    const size_t padded = run->kept < 56 ? 64 : 128;
    for (unsigned i = 0; i < 8; i++) {
        last[padded - 1 - i] = (uint8_t)(bits >> (8 * i));
    }
    for (size_t i = 0; i < padded; i += 64) {
        compress(run->state, last + i);
    }
    for (unsigned i = 0; i < FSN_SHA256_BYTES; i++) {
        digest[i] = (uint8_t)(run->state[i / 4] >> (24 - 8 * (i % 4)));
    }
}

void fsn_sha256(const void *bytes, size_t len_bytes, uint8_t digest[FSN_SHA256_BYTES]) {
    struct fsn_sha256_run run;
    fsn_sha256_start(&run);
    fsn_sha256_add(&run, bytes, len_bytes);
    fsn_sha256_end(&run, digest);
}

int fsn_sha256_file(int fd, uint8_t digest[FSN_SHA256_BYTES]) {
    struct fsn_sha256_run run;
    char piece[4096];
    ssize_t len;
    off_t at = 0;
    fsn_sha256_start(&run);
    while ((len = pread(fd, piece, sizeof piece, at)) > 0) {
        fsn_sha256_add(&run, piece, (size_t)len);
        at += len;
    }
    fsn_sha256_end(&run, digest);
    return len < 0 ? errno : 0;
}

void fsn_plan_sha256(const struct fsn_plan *plan, uint8_t digest[FSN_SHA256_BYTES]) {
    fsn_sha256(plan->bytes, plan->len_bytes, digest);
}

uint8_t fsn_eeprom_checksum(const uint8_t bytes[14]) {
    unsigned crc = 0xFF;
    for (int i = 0; i < 14; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = (crc & 0x80) != 0 ? (crc << 1 ^ 0x07) & 0xFF : crc << 1 & 0xFF;
        }
    }
    return (uint8_t)crc;
}
