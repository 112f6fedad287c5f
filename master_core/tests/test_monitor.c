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

/** The CRC of the protocol (§2) bit by bit: old CRC, ConnID, number, command, number of the block
 *  behind the first one, two bytes, three zeros. */
static uint16_t crc_bit_by_bit(const uint8_t *frame, size_t len, unsigned block, uint16_t old_crc,
                               uint16_t number) {
    const uint8_t *data = len == 6 ? frame + 1 : frame + 1 + 4 * block;
    uint8_t bytes[14] = {(uint8_t)old_crc, (uint8_t)(old_crc >> 8), frame[len - 2], frame[len - 1],
                         (uint8_t)number,  (uint8_t)(number >> 8),  frame[0]};
    size_t count = 7;
    if (block > 0) {
        bytes[count++] = (uint8_t)block;
        bytes[count++] = 0;
    }
    bytes[count++] = data[0];
    if (len != 6) {
        bytes[count++] = data[1];
    }
    count += 3;
    uint32_t crc = 0;
    for (size_t i = 0; i < count; i++) {
        crc ^= (uint32_t)bytes[i] << 8;
        for (int bit = 0; bit < 8; bit++) {
            crc = (crc & 0x8000u) != 0 ? ((crc << 1) ^ 0x139B7u) & 0xFFFFu : crc << 1;
        }
    }
    return (uint16_t)crc;
}

static void put16(uint8_t *at, uint16_t value) {
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

/** Random frames of every length: right with their CRCs, wrong with any other. */
static void the_tables_are_the_polynomial(void) {
    uint64_t seed = 3;
    for (int round = 0; round < 300; round++) {
        for (size_t len = 6; len <= 255; len += len == 6 ? 1 : 4) {
            const unsigned blocks = len == 6 ? 1 : (unsigned)(len - 3) / 4;
            const uint16_t old_crc = (uint16_t)next_random(&seed);
            uint16_t number = (uint16_t)next_random(&seed);
            number = number == 0 ? 1 : number;
            uint8_t frame[255];
            for (size_t i = 0; i < len; i++) {
                frame[i] = (uint8_t)next_random(&seed);
            }
            for (unsigned block = 0; block < blocks; block++) {
                const uint16_t crc = crc_bit_by_bit(frame, len, block, old_crc, number);
                put16(frame + (len == 6 ? 2 : 3 + 4 * block), crc);
            }
            unsigned whole = 0;
            CHECK(fsn_fsoe_expected_crc0(frame, len, old_crc, number) == fsn_fsoe_crc0(frame, len));
            CHECK(fsn_fsoe_crc0(frame, len) == crc_bit_by_bit(frame, len, 0, old_crc, number));
            CHECK(fsn_fsoe_check(frame, len, old_crc, number));
            CHECK(fsn_fsoe_solve_sequence(frame, len, old_crc) == number);
            CHECK(fsn_fsoe_is_whole(frame, len, &whole) && whole == blocks);
            CHECK(fsn_fsoe_connection_id(frame, len) == frame[len - 2] + 256 * frame[len - 1]);
            const uint32_t bit = next_random(&seed) % (uint32_t)(8 * len);
            frame[bit / 8] ^= (uint8_t)(1u << bit % 8);
            CHECK(!fsn_fsoe_check(frame, len, old_crc, number));
        }
    }
}

static void lengths_of_frames(void) {
    unsigned count = 0;
    for (size_t len = 0; len < 600; len++) {
        const bool right = len == 6 || (len > 6 && len < 256 && len % 4 == 3);
        CHECK(fsn_fsoe_is_frame_length(len) == right);
        count += right;
    }
    CHECK(count == 64);
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
    the_tables_are_the_polynomial();
    lengths_of_frames();
    blocks_fit_each_other();
    start_up_is_followed();
    any_start_leads_into_the_chain();
    impossible_lengths_are_refused();
    return 0;
}
