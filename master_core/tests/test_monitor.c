/** CRC and monitor against frames that other implementations sent. The comparison with the Python
 *  monitor, over any input, is tests/core/test_monitor.py. */
#include <string.h>

#include "builder.h"
#include "fsn/fsn.h"

/** Start-up of 2/2 bytes, session ids 0x1122 and 0x3344, ConnID 0xABCD; main and sub in turn. */
static const char *const start_up[] = {
    "2a0000c42d0000", "2a0000c42d0000", "4e2211fddd0000", "4e4433f5760000",
    "64cdabac4dcdab", "64cdab018dcdab", "6434121350cdab", "643412dd7acdab",
    "52020024d1cdab", "520200cb9fcdab", "526400d592cdab", "5264004a68cdab",
    "520000e008cdab", "520000f5eacdab", "08000099f9cdab", "0800005ac6cdab",
};

static void from_hex(const char *hex, uint8_t *bytes) {
    for (; *hex != 0; hex += 2) {
        unsigned byte;
        CHECK(sscanf(hex, "%2x", &byte) == 1);
        *bytes++ = (uint8_t)byte;
    }
}

static void reset_frames(void) {
    static const char *const resets[] = {"2a0086f80000", "2a0000c42d0000", "2a0000c42d0000b9140000",
                                         "2aff00c6f70000"};
    for (size_t i = 0; i < sizeof resets / sizeof resets[0]; i++) {
        uint8_t frame[16];
        from_hex(resets[i], frame);
        const size_t len = strlen(resets[i]) / 2;
        CHECK(fsn_fsoe_check(frame, len, 0, 1));
        CHECK(fsn_fsoe_solve_sequence(frame, len, 0) == 1);
        CHECK(fsn_fsoe_is_whole(frame, len, NULL));
        CHECK(!fsn_fsoe_check(frame, len, 0, 2) && !fsn_fsoe_check(frame, len, 1, 1));
        CHECK(!fsn_fsoe_check(frame, len + 1, 0, 1) && !fsn_fsoe_check(frame, 0, 0, 1));
    }
}

static void blocks_fit_each_other(void) {
    uint8_t frame[16];
    unsigned blocks = 0;
    from_hex("2a0000c42d0000b9140000", frame);
    CHECK(fsn_fsoe_is_whole(frame, 11, &blocks) && blocks == 2);
    frame[7] ^= 0x10;
    CHECK(!fsn_fsoe_is_whole(frame, 11, &blocks) && blocks == 1);
}

static void start_up_is_followed(void) {
    struct fsn_monitor monitor;
    CHECK(fsn_monitor_init(&monitor, 7, 7) == FSN_OK);
    for (size_t i = 0; i < sizeof start_up / sizeof start_up[0]; i++) {
        uint8_t frame[7];
        from_hex(start_up[i], frame);
        const enum fsn_way way = i % 2 == 0 ? FSN_TO_SUB : FSN_TO_MAIN;
        CHECK(fsn_monitor_frame(&monitor, way, frame, i) == FSN_VERDICT_RIGHT);
        CHECK(fsn_monitor_frame(&monitor, way, frame, i) == FSN_VERDICT_SAME);
    }
    CHECK(monitor.status.outside == FSN_OUTSIDE_DATA_FAILSAFE);
    CHECK(monitor.status.direction[0].right == 8 && monitor.status.direction[1].right == 8);
    CHECK(monitor.status.direction[0].wrong == 0 && monitor.status.gaps == 0);
    uint8_t wrong[7];
    from_hex("08000099f8cdab", wrong);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, wrong, 99) == FSN_VERDICT_WRONG);
}

static void any_start_leads_into_the_chain(void) {
    for (size_t from = 1; from < 8; from++) {
        struct fsn_monitor monitor;
        CHECK(fsn_monitor_init(&monitor, 7, 7) == FSN_OK);
        enum fsn_verdict last = FSN_VERDICT_SAME;
        for (size_t i = from; i < sizeof start_up / sizeof start_up[0]; i++) {
            uint8_t frame[7];
            from_hex(start_up[i], frame);
            const enum fsn_way way = i % 2 == 0 ? FSN_TO_SUB : FSN_TO_MAIN;
            last = fsn_monitor_frame(&monitor, way, frame, i);
            CHECK(last != FSN_VERDICT_WRONG);
        }
        CHECK(last == FSN_VERDICT_RIGHT && monitor.status.gaps == 0);
    }
}

static void impossible_lengths_are_refused(void) {
    struct fsn_monitor monitor;
    static const uint32_t bad[] = {0, 5, 8, 9, 10, 256, 259, 0xFFFFFFFFu};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        CHECK(fsn_monitor_init(&monitor, bad[i], 7) == FSN_E_ARG);
        CHECK(fsn_monitor_init(&monitor, 7, bad[i]) == FSN_E_ARG);
    }
    CHECK(fsn_monitor_init(NULL, 7, 7) == FSN_E_ARG);
    CHECK(fsn_monitor_init(&monitor, 6, 255) == FSN_OK);
}

int main(void) {
    reset_frames();
    blocks_fit_each_other();
    start_up_is_followed();
    any_start_leads_into_the_chain();
    impossible_lengths_are_refused();
    return 0;
}
