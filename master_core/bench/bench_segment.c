/** Own time of the emulated segment per frame, in memory: one LRW over the process data and one
 * FRMW of the reference clock. Printed as a ratio to the limit. */
#define _GNU_SOURCE

#include <stdio.h>
#include <string.h>
#include <time.h>

#include "builder.h"
#include "fsn/segment.h"

enum { MOST = 100, ROUNDS = 20000, REPEATS = 7, HEAD = 16, DATAGRAM = 10 };
enum { APWR = 2, FPWR = 5, LRW = 12, FRMW = 14 };

struct rig {
    struct fsn_segment *segment;
    uint64_t now_ns;
};

static uint64_t clock_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static size_t add(uint8_t *frame, size_t at, uint8_t command, uint32_t address, uint16_t size,
                  bool more) {
    uint8_t *d = frame + at;
    memset(d, 0, DATAGRAM + (size_t)size + 2);
    d[0] = command;
    for (int i = 0; i < 4; i++) {
        d[2 + i] = (uint8_t)(address >> (8 * i));
    }
    d[6] = (uint8_t)size;
    d[7] = (uint8_t)((size >> 8) | (more ? 0x80 : 0));
    return at + DATAGRAM + size + 2;
}

static void close_frame(uint8_t *frame, size_t len) {
    memset(frame, 0xFF, 12);
    frame[12] = 0x88;
    frame[13] = 0xA4;
    frame[14] = (uint8_t)(len - HEAD);
    frame[15] = (uint8_t)(0x10 | ((len - HEAD) >> 8));
}

static void put(struct rig *rig, uint8_t command, uint16_t adp, uint16_t ado, const void *data,
                uint16_t size) {
    uint8_t frame[100];
    const size_t len = add(frame, HEAD, command, adp | ((uint32_t)ado << 16), size, false);
    memcpy(frame + HEAD + DATAGRAM, data, size);
    close_frame(frame, len);
    CHECK(fsn_segment_frame(rig->segment, frame, len, rig->now_ns++) == len);
    CHECK(frame[len - 2] == 1);
}

static void sm(struct rig *rig, uint16_t station, uint16_t number, uint16_t start, uint16_t length,
               uint8_t control) {
    const uint8_t r[8] = {(uint8_t)start, (uint8_t)(start >> 8), (uint8_t)length, 0, control, 0, 1};
    put(rig, FPWR, station, (uint16_t)(0x0800 + 8 * number), r, 8);
}

static void fmmu(struct rig *rig, uint16_t station, uint16_t number, uint32_t logical,
                 uint16_t length, uint16_t physical, uint8_t type) {
    const uint8_t r[16] = {(uint8_t)logical,
                           (uint8_t)(logical >> 8),
                           0,
                           0,
                           (uint8_t)length,
                           0,
                           0,
                           7,
                           (uint8_t)physical,
                           (uint8_t)(physical >> 8),
                           0,
                           type,
                           1};
    put(rig, FPWR, station, (uint16_t)(0x0600 + 16 * number), r, 16);
}

static void request(struct rig *rig, uint16_t station, uint8_t state) {
    const uint8_t bytes[2] = {state};
    put(rig, FPWR, station, 0x0120, bytes, 2);
}

/** Outputs of all first, then inputs of all, as MainDevices lay them out. */
static void bring_up(struct rig *rig, uint32_t count, uint16_t size) {
    for (uint16_t i = 0; i < count; i++) {
        const uint16_t station = (uint16_t)(1001 + i);
        const uint8_t address[2] = {(uint8_t)station, (uint8_t)(station >> 8)};
        put(rig, APWR, (uint16_t)(0u - i), 0x0010, address, 2);
        sm(rig, station, 0, 0x1000, 128, 0x26);
        sm(rig, station, 1, 0x1080, 128, 0x22);
        request(rig, station, 2);
        sm(rig, station, 2, 0x1100, size, 0x64);
        sm(rig, station, 3, 0x1140, size, 0x20);
        fmmu(rig, station, 0, (uint32_t)i * size, size, 0x1100, 2);
        fmmu(rig, station, 1, (uint32_t)(count + i) * size, size, 0x1140, 1);
        request(rig, station, 4);
        request(rig, station, 8);
        CHECK(fsn_segment_al_status(rig->segment, i, NULL) == 8);
    }
}

static double cycle_ns(struct rig *rig, uint32_t count, uint16_t size) {
    static uint8_t frame[1600];
    const uint16_t image = (uint16_t)(2 * count * size);
    uint64_t best = UINT64_MAX;
    for (int repeat = 0; repeat < REPEATS; repeat++) {
        const uint64_t start = clock_ns();
        for (int round = 0; round < ROUNDS; round++) {
            size_t len = add(frame, HEAD, LRW, 0, image, true);
            len = add(frame, len, FRMW, 1001 | (0x0910u << 16), 8, false);
            close_frame(frame, len);
            rig->now_ns += 1000;
            (void)fsn_segment_frame(rig->segment, frame, len, rig->now_ns);
        }
        const uint64_t spent = clock_ns() - start;
        best = spent < best ? spent : best;
        const size_t at = HEAD + DATAGRAM + (size_t)image;
        CHECK((uint32_t)(frame[at] | (frame[at + 1] << 8)) == 3 * count);
    }
    return (double)best / ROUNDS;
}

static void measure(uint32_t count, uint16_t size, double limit_ns) {
    struct build_sm sms[MOST][2];
    for (uint32_t i = 0; i < count; i++) {
        sms[i][0] = (struct build_sm){1, size};
        sms[i][1] = (struct build_sm){2, size};
    }
    const struct build build = {
        .subdevices = count, .sm = (const struct build_sm(*)[2])sms, .cycle_ns = 1000000};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct fsn_plan *plan;
    struct rig rig = {.now_ns = 1};
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    CHECK(fsn_segment_create(plan, &rig.segment) == FSN_OK);
    bring_up(&rig, count, size);
    const double spent_ns = cycle_ns(&rig, count, size);
    printf("segment   %3u SubDevices, %u + %u bytes each: %6.2f us per frame, %.2f of the limit of"
           " %.0f us\n",
           count, size, size, spent_ns / 1000, spent_ns / limit_ns, limit_ns / 1000);
    fsn_plan_free(plan);
    fsn_segment_free(rig.segment);
    free(bytes);
}

int main(void) {
    measure(10, 11, 2000);
    measure(100, 7, 20000);
    return 0;
}
