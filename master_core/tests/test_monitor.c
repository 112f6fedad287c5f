/** CRC and monitor against frames that other implementations sent. The comparison with the Python
 *  monitor, over any input, is tests/core/test_monitor.py. */
/* shows R17, R18 */
#include <string.h>

#include "builder.h"
#include "fsn/fsn.h"
#include "heap.h"

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
 *  after the first one, two bytes, three zeros. */
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

/** Random frames of every length: correct with their CRCs, wrong with any other. */
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
    CHECK(monitor.status.observed == FSN_OBSERVED_DATA_FAILSAFE);
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

/** Two ends that count on: each frame with the CRC of the one before, its own number, and the rule
 *  that two frames in a row never have the same CRC. */
struct chain {
    uint32_t len[2];
    uint16_t number[2], own[2], last, id;
    bool has_own[2];
    uint64_t seed;
    uint8_t frame[255];
};

static uint16_t seal(uint8_t *frame, size_t len, uint16_t id, uint16_t old_crc, uint16_t number) {
    const unsigned blocks = len == 6 ? 1 : (unsigned)(len - 3) / 4;
    put16(frame + len - 2, id);
    for (unsigned block = 0; block < blocks; block++) {
        put16(frame + (len == 6 ? 2 : 3 + 4 * block),
              crc_bit_by_bit(frame, len, block, old_crc, number));
    }
    return fsn_fsoe_crc0(frame, len);
}

/** The next frame of a direction. */
static const uint8_t *next_frame(struct chain *c, unsigned way, uint8_t command) {
    for (size_t i = 0; i < c->len[way]; i++) {
        c->frame[i] = (uint8_t)next_random(&c->seed);
    }
    c->frame[0] = command;
    uint16_t crc = seal(c->frame, c->len[way], c->id, c->last, c->number[way]);
    if (c->has_own[way] && crc == c->own[way]) {
        c->number[way] = c->number[way] == 0xFFFF ? 1 : (uint16_t)(c->number[way] + 1);
        crc = seal(c->frame, c->len[way], c->id, c->last, c->number[way]);
    }
    c->last = c->own[way] = crc;
    c->has_own[way] = true;
    c->number[way] = c->number[way] == 0xFFFF ? 1 : (uint16_t)(c->number[way] + 1);
    return c->frame;
}

static struct chain chain_of(uint32_t to_sub, uint32_t to_main, uint16_t number) {
    return (struct chain){
        .len = {to_sub, to_main}, .number = {number, number}, .id = 0x1234, .seed = number};
}

/** Once around all numbers, with the collisions that come along. */
static void numbers_go_around(void) {
    struct chain c = chain_of(11, 6, 1);
    struct fsn_monitor monitor;
    CHECK(fsn_monitor_init(&monitor, 11, 6) == FSN_OK);
    uint8_t reset[11] = {FSN_CMD_RESET};
    (void)seal(reset, 11, 0, 0, 1);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, reset, 1) == FSN_VERDICT_RIGHT);
    for (uint32_t i = 0; i < 70000; i++) {
        for (unsigned way = 0; way < 2; way++) {
            const uint8_t command = i == 0 ? FSN_CMD_SESSION : FSN_CMD_PROCESS_DATA;
            const uint8_t *frame = next_frame(&c, way, command);
            CHECK(fsn_monitor_frame(&monitor, (enum fsn_way)way, frame, 2 + i) ==
                  FSN_VERDICT_RIGHT);
        }
    }
    CHECK(monitor.status.direction[0].right == 70001 && monitor.status.direction[1].right == 70000);
    CHECK(monitor.status.gaps == 0 && monitor.status.observed == FSN_OBSERVED_DATA_PROCESS);
    CHECK(monitor.status.direction[0].connection_id == 0x1234);
}

/** Gives both frames of a cycle; the verdicts as two letters of "rwu". */
static const char *both(struct fsn_monitor *monitor, struct chain *c) {
    static char said[3];
    for (unsigned way = 0; way < 2; way++) {
        const uint8_t *frame = next_frame(c, way, FSN_CMD_PROCESS_DATA);
        const enum fsn_verdict v = fsn_monitor_frame(monitor, (enum fsn_way)way, frame, 1);
        said[way] = v == FSN_VERDICT_RIGHT ? 'r' : v == FSN_VERDICT_WRONG ? 'w' : 'u';
    }
    return said;
}

/** Joining in the middle, losing frames, and finding the numbers again: one gap. */
static void lost_numbers_are_found_again(void) {
    for (uint32_t round = 0; round < 200; round++) {
        struct chain c = chain_of(7 + 4 * (round % 3), 6, (uint16_t)(round * 331 + 1));
        struct fsn_monitor monitor;
        CHECK(fsn_monitor_init(&monitor, c.len[0], c.len[1]) == FSN_OK);
        CHECK(strcmp(both(&monitor, &c), "uu") == 0 && strcmp(both(&monitor, &c), "ur") == 0);
        CHECK(strcmp(both(&monitor, &c), "rr") == 0 && monitor.status.gaps == 0);
        for (unsigned way = 0; way < 2; way++) { /* both pass unseen */
            (void)next_frame(&c, way, FSN_CMD_PROCESS_DATA);
        }
        CHECK(strcmp(both(&monitor, &c), "wu") == 0 && monitor.status.gaps == 0);
        CHECK(strcmp(both(&monitor, &c), "ur") == 0 && monitor.status.gaps == 1);
        CHECK(strcmp(both(&monitor, &c), "rr") == 0 && monitor.status.gaps == 1);
        CHECK(monitor.status.direction[0].wrong == 1 && monitor.status.direction[1].wrong == 0);
    }
}

/** A missed answer: the two in a row prove nothing, and the chain is found again. */
static void one_end_alone_is_not_checked(void) {
    struct chain c = chain_of(6, 6, 5);
    struct fsn_monitor monitor;
    CHECK(fsn_monitor_init(&monitor, 6, 6) == FSN_OK);
    while (strcmp(both(&monitor, &c), "rr") != 0) {
    }
    const uint8_t *frame = next_frame(&c, 0, FSN_CMD_PROCESS_DATA);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, frame, 1) == FSN_VERDICT_RIGHT);
    (void)next_frame(&c, 1, FSN_CMD_PROCESS_DATA);
    frame = next_frame(&c, 0, FSN_CMD_PROCESS_DATA);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, frame, 1) == FSN_VERDICT_UNCHECKED);
    frame = next_frame(&c, 1, FSN_CMD_PROCESS_DATA);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, frame, 1) == FSN_VERDICT_UNCHECKED);
    CHECK(strcmp(both(&monitor, &c), "ur") == 0 && strcmp(both(&monitor, &c), "rr") == 0);
    CHECK(monitor.status.gaps == 1 && monitor.status.direction[0].wrong == 0);
}

/** A chain that was never known is not lost: no gap is reported. */
static void what_was_not_known_is_no_gap(void) {
    struct chain c = chain_of(6, 6, 700);
    struct fsn_monitor monitor;
    CHECK(fsn_monitor_init(&monitor, 6, 6) == FSN_OK);
    for (unsigned i = 0; i < 3; i++) {
        const uint8_t *frame = next_frame(&c, 1, FSN_CMD_PROCESS_DATA);
        CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, frame, 1) == FSN_VERDICT_UNCHECKED);
    }
    while (strcmp(both(&monitor, &c), "rr") != 0) {
    }
    CHECK(monitor.status.gaps == 0);
    /* One of the two numbers is known: that is enough to lose. */
    CHECK(fsn_monitor_init(&monitor, 6, 6) == FSN_OK);
    CHECK(strcmp(both(&monitor, &c), "uu") == 0 && strcmp(both(&monitor, &c), "ur") == 0);
    const uint8_t *again = next_frame(&c, 1, FSN_CMD_PROCESS_DATA);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, again, 1) == FSN_VERDICT_UNCHECKED);
    while (strcmp(both(&monitor, &c), "rr") != 0) {
    }
    CHECK(monitor.status.gaps == 1);
}

/** While the numbers are searched for, blocks that do not fit each other are still wrong. */
static void broken_blocks_are_wrong_at_any_time(void) {
    struct chain c = chain_of(15, 15, 9);
    struct fsn_monitor monitor;
    CHECK(fsn_monitor_init(&monitor, 15, 15) == FSN_OK);
    CHECK(strcmp(both(&monitor, &c), "uu") == 0);
    uint8_t frame[15];
    memcpy(frame, next_frame(&c, 0, FSN_CMD_PROCESS_DATA), 15);
    frame[9] ^= 1;
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, frame, 1) == FSN_VERDICT_WRONG);
    memcpy(frame, next_frame(&c, 1, FSN_CMD_PROCESS_DATA), 15);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, frame, 1) == FSN_VERDICT_RIGHT);
    CHECK(strcmp(both(&monitor, &c), "ur") == 0 && strcmp(both(&monitor, &c), "rr") == 0);
}

/** §3, §5, §6: effects of Reset and Session on the chain. */
static void sessions_begin_anew(void) {
    struct fsn_monitor monitor;
    uint8_t reset[6] = {FSN_CMD_RESET, 5};
    uint8_t session[6] = {FSN_CMD_SESSION, 0x77};
    uint8_t answer[6] = {FSN_CMD_SESSION, 0x88};
    CHECK(fsn_monitor_init(&monitor, 6, 6) == FSN_OK);
    (void)seal(reset, 6, 0, 0, 1);
    const uint16_t first = seal(session, 6, 0, 0, 1);
    (void)seal(answer, 6, 0, first, 1);
    /* A sub may answer before the main has begun: correct when it follows a Reset. */
    uint8_t early[6] = {FSN_CMD_SESSION, 0x99};
    (void)seal(early, 6, 0, 0, 1);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, answer, 1) == FSN_VERDICT_UNCHECKED);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, reset, 1) == FSN_VERDICT_RIGHT);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, early, 1) == FSN_VERDICT_RIGHT);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, session, 1) == FSN_VERDICT_RIGHT);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, answer, 1) == FSN_VERDICT_RIGHT);
    session[1] = 0x78; /* the main restarts, in the middle */
    const uint16_t second = seal(session, 6, 0, 0, 1);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, session, 1) == FSN_VERDICT_RIGHT);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, early, 1) == FSN_VERDICT_WRONG);
    answer[1] = 0x89; /* the chain is still that of the main */
    (void)seal(answer, 6, 0, second, 1);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, answer, 1) == FSN_VERDICT_RIGHT);
    reset[1] = 6;
    (void)seal(reset, 6, 0, 0, 2); /* a Reset counts from 1 */
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, reset, 1) == FSN_VERDICT_WRONG);
    (void)seal(reset, 6, 9, 0, 1); /* and has no ConnID */
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, reset, 1) == FSN_VERDICT_WRONG);
    CHECK(monitor.status.direction[1].resets == 1 && monitor.status.direction[1].reset_code == 6);
    CHECK(monitor.status.direction[1].frames == 7 && monitor.status.direction[1].wrong == 3);
}

/** The CRC of a frame before the Reset is forgotten: an equal one by chance is then not a
 *  collision. */
static void a_reset_forgets_the_own_crc(void) {
    struct fsn_monitor monitor;
    uint8_t reset[6] = {FSN_CMD_RESET};
    uint8_t session[6] = {FSN_CMD_SESSION, 0x77};
    uint8_t answer[6] = {FSN_CMD_SESSION};
    CHECK(fsn_monitor_init(&monitor, 6, 6) == FSN_OK);
    const uint16_t own = seal(reset, 6, 0, 0, 1);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, reset, 1) == FSN_VERDICT_RIGHT);
    monitor.followed[FSN_TO_MAIN].has_own = true; /* as in a session before */
    monitor.followed[FSN_TO_MAIN].own = own;
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, reset, 1) == FSN_VERDICT_RIGHT);
    const uint16_t first = seal(session, 6, 0, 0, 1);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, session, 1) == FSN_VERDICT_RIGHT);
    uint32_t tried = 0;
    do {
        answer[1] = (uint8_t)tried;
        CHECK(tried < UINT32_C(1) << 24);
    } while (seal(answer, 6, (uint16_t)(tried++ >> 8), first, 1) != own);
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, answer, 1) == FSN_VERDICT_RIGHT);
}

/** While a number is searched, one that would repeat the CRC of before is left out by the sender,
 * and so is the next but one then; any other is none that follows. */
static void a_collision_is_known_while_searching(void) {
    for (uint16_t number = 8; number <= 9; number++) {
        uint8_t to_sub[6] = {FSN_CMD_PROCESS_DATA, 1};
        uint8_t to_main[6] = {FSN_CMD_PROCESS_DATA, 2};
        struct fsn_monitor monitor;
        CHECK(fsn_monitor_init(&monitor, 6, 6) == FSN_OK);
        uint16_t last = 0x1234;
        uint16_t own = 0;
        for (uint16_t n = 5; n <= 6; n++) {
            own = seal(to_sub, 6, 0x77, last, n);
            CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, to_sub, n) == FSN_VERDICT_UNCHECKED);
            last = seal(to_main, 6, 0x77, own, n);
            CHECK(fsn_monitor_frame(&monitor, FSN_TO_MAIN, to_main, n) ==
                  (n == 5 ? FSN_VERDICT_UNCHECKED : FSN_VERDICT_RIGHT));
        }
        uint32_t tried = 0;
        uint16_t id;
        do {
            to_sub[1] = (uint8_t)tried;
            id = (uint16_t)(tried++ >> 8);
            CHECK(tried < UINT32_C(1) << 24);
        } while (seal(to_sub, 6, id, last, 7) != own);
        (void)seal(to_sub, 6, id, last, number);
        CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, to_sub, 7) ==
              (number == 8 ? FSN_VERDICT_RIGHT : FSN_VERDICT_UNCHECKED));
    }
}

/** Intervals are those between two Data frames of a direction. */
static void intervals_are_counted(void) {
    static const struct {
        uint8_t command;
        uint64_t at_ns;
    } frames[] = {
        {FSN_CMD_PARAMETER, 100},     {FSN_CMD_PROCESS_DATA, 150}, {FSN_CMD_PROCESS_DATA, 180},
        {FSN_CMD_FAILSAFE_DATA, 230}, {FSN_CMD_PROCESS_DATA, 250}, {FSN_CMD_RESET, 300},
        {FSN_CMD_RESET, 310},         {FSN_CMD_PROCESS_DATA, 400}, {FSN_CMD_FAILSAFE_DATA, 440}};
    struct fsn_monitor monitor;
    CHECK(fsn_monitor_init(&monitor, 6, 6) == FSN_OK);
    for (uint8_t i = 0; i < sizeof frames / sizeof frames[0]; i++) {
        const uint8_t frame[6] = {frames[i].command, i, i, 0, 3, 4};
        (void)fsn_monitor_frame(&monitor, FSN_TO_MAIN, frame, frames[i].at_ns);
    }
    const struct fsn_direction *d = &monitor.status.direction[FSN_TO_MAIN];
    CHECK(d->intervals == 4 && d->interval_last_ns == 40 && d->interval_sum_ns == 140);
    CHECK(d->interval_min_ns == 20 && d->interval_max_ns == 50 && d->last_new_ns == 440);
    CHECK(d->frames == 9 && d->process_data == 4 && d->failsafe_data == 2 && d->resets == 1);
    CHECK(d->reset_code == 6 && d->command == FSN_CMD_FAILSAFE_DATA);
    CHECK(d->connection_id == 0x0403 && monitor.status.direction[FSN_TO_SUB].frames == 0);
    CHECK(d->wrong + d->unchecked + d->right == 9 &&
          monitor.status.observed == FSN_OBSERVED_SILENT);
}

/** Which frame of a cycle came first; both are new and the chain decides. */
static void the_order_of_a_cycle_is_seen(void) {
    struct chain c = chain_of(6, 6, 3);
    struct fsn_monitor monitor;
    CHECK(fsn_monitor_init(&monitor, 6, 6) == FSN_OK);
    while (strcmp(both(&monitor, &c), "rr") != 0) {
    }
    uint8_t to_sub[6];
    uint8_t to_main[6];
    struct chain main_first = c;
    memcpy(to_sub, next_frame(&main_first, 0, FSN_CMD_PROCESS_DATA), 6);
    memcpy(to_main, next_frame(&main_first, 1, FSN_CMD_PROCESS_DATA), 6);
    CHECK(!fsn_monitor_sub_first(&monitor, to_sub, to_main));
    struct chain sub_first = c;
    CHECK(fsn_monitor_frame(&monitor, FSN_TO_SUB, next_frame(&sub_first, 0, FSN_CMD_PROCESS_DATA),
                            1) == FSN_VERDICT_RIGHT);
    memcpy(to_main, next_frame(&sub_first, 1, FSN_CMD_PROCESS_DATA), 6);
    memcpy(to_sub, next_frame(&sub_first, 0, FSN_CMD_PROCESS_DATA), 6);
    CHECK(fsn_monitor_sub_first(&monitor, to_sub, to_main));
    const struct fsn_monitor before = monitor;
    CHECK(
        !fsn_monitor_sub_first(&monitor, monitor.followed[0].last, to_main)); /* only one is new */
    CHECK(!fsn_monitor_sub_first(&monitor, to_sub, monitor.followed[1].last));
    uint8_t reset[6] = {FSN_CMD_RESET};
    (void)seal(reset, 6, 0, 0, 1);
    CHECK(fsn_monitor_sub_first(&monitor, reset, to_main)); /* a restart does not show the order */
    to_main[1] ^= 1;
    CHECK(!fsn_monitor_sub_first(&monitor, reset, to_main));
    CHECK(!fsn_monitor_sub_first(&monitor, to_sub, reset));
    uint8_t session[6] = {FSN_CMD_SESSION};
    (void)seal(session, 6, 0, 0, 1);
    CHECK(!fsn_monitor_sub_first(&monitor, session, reset)); /* the main was in Data */
    CHECK(memcmp(&before, &monitor, sizeof before) == 0);    /* asking changes nothing */
    CHECK(fsn_monitor_init(&monitor, 6, 6) == FSN_OK);
    CHECK(fsn_monitor_sub_first(&monitor, session, reset));
    CHECK(!fsn_monitor_sub_first(&monitor, to_sub, reset));
    uint8_t other[6] = {FSN_CMD_RESET, 1};
    (void)seal(other, 6, 0, 0, 1);
    (void)fsn_monitor_frame(&monitor, FSN_TO_SUB, other, 1);
    CHECK(fsn_monitor_sub_first(&monitor, session, reset)); /* after its Reset */
}

/** Every pair of commands: the end that lags decides. */
static void outside_is_what_both_show(void) {
    static const uint8_t commands[] = {FSN_CMD_RESET,
                                       FSN_CMD_SESSION,
                                       FSN_CMD_CONNECTION,
                                       FSN_CMD_PARAMETER,
                                       FSN_CMD_FAILSAFE_DATA,
                                       FSN_CMD_PROCESS_DATA,
                                       0x99};
    static const char expected[] = "RRRRRRR"
                                   "RSSSSSS"
                                   "RSCCCCC"
                                   "RSCPPPP"
                                   "RSCPFFU"
                                   "RSCPFDU"
                                   "RSCPUUU";
    static const char names[] = {
        [FSN_OBSERVED_RESET] = 'R',         [FSN_OBSERVED_SESSION] = 'S',
        [FSN_OBSERVED_CONNECTION] = 'C',    [FSN_OBSERVED_PARAMETER] = 'P',
        [FSN_OBSERVED_DATA_FAILSAFE] = 'F', [FSN_OBSERVED_DATA_PROCESS] = 'D',
        [FSN_OBSERVED_UNKNOWN] = 'U'};
    for (size_t i = 0; i < 49; i++) {
        struct fsn_monitor monitor;
        CHECK(fsn_monitor_init(&monitor, 6, 6) == FSN_OK);
        const uint8_t to_sub[6] = {commands[i / 7]};
        const uint8_t to_main[6] = {commands[i % 7]};
        (void)fsn_monitor_frame(&monitor, FSN_TO_SUB, to_sub, 1);
        CHECK(monitor.status.observed == FSN_OBSERVED_SILENT);
        (void)fsn_monitor_frame(&monitor, FSN_TO_MAIN, to_main, 1);
        CHECK(names[monitor.status.observed] == expected[i]);
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
    const long alive = heap_alive();
    reset_frames();
    the_tables_are_the_polynomial();
    lengths_of_frames();
    blocks_fit_each_other();
    start_up_is_followed();
    any_start_leads_into_the_chain();
    numbers_go_around();
    lost_numbers_are_found_again();
    one_end_alone_is_not_checked();
    what_was_not_known_is_no_gap();
    broken_blocks_are_wrong_at_any_time();
    sessions_begin_anew();
    a_reset_forgets_the_own_crc();
    a_collision_is_known_while_searching();
    intervals_are_counted();
    the_order_of_a_cycle_is_seen();
    outside_is_what_both_show();
    impossible_lengths_are_refused();
    CHECK(heap_alive() == alive);
    return 0;
}
