/** Fuzz target: any bytes as a script of what a monitor sees. Fits libFuzzer and driver.c.
 *
 *  Bytes alone never form a chain, so the script orders right frames, built outside of the core,
 * and disturbs them. Layout: two bytes for the frame lengths, then operations of one byte (low four
 *  bits: enum order, bit 4: direction, bits 5 to 7: command) with what each of them needs. */
#include "fuzz.h"

#include <stdlib.h>
#include <string.h>

enum order { RIGHT, RAW, FLIP, REPLAY, START, SESSION, JUMP, WAIT, FILL, ORDERS };
enum {
    MOST_FRAMES = 4096,
    MEMORY = 8,       /**< frames remembered per direction, to be replayed */
    FOUND_AFTER = 12, /**< right frames in turn after which a monitor has found any chain */
    FIRST_DATA = 2,   /**< in `commands`: neither Reset nor Session */
    COMMANDS = 6,
};

static const uint8_t commands[COMMANDS] = {FSN_CMD_RESET,        FSN_CMD_SESSION,
                                           FSN_CMD_CONNECTION,   FSN_CMD_PARAMETER,
                                           FSN_CMD_PROCESS_DATA, FSN_CMD_FAILSAFE_DATA};

uint64_t fuzz_reached;

struct bench {
    struct input in;
    struct fsn_monitor monitor;
    struct chain chain;
    size_t len[2];
    uint8_t seen[2][MEMORY][FSN_MAX_FRAME_BYTES]; /**< [n % MEMORY]; zeros before the first */
    uint32_t count[2];
    bool known;      /**< the monitor is certain to be in the chain */
    uint32_t in_row; /**< right frames in turn since the last disturbance */
    uint64_t now_ns;
};

static const uint8_t *last_of(const struct bench *b, unsigned way) {
    return b->seen[way][b->count[way] % MEMORY];
}

static void check_direction(const struct fsn_direction *d) {
    CHECK(d->frames == d->right + d->wrong + d->unchecked);
    CHECK(d->process_data + d->failsafe_data <= d->frames && d->resets <= d->frames);
    CHECK(d->intervals < d->frames || d->frames == 0);
    CHECK(d->intervals == 0 || d->interval_min_ns <= d->interval_last_ns);
    CHECK(d->interval_last_ns <= d->interval_max_ns && d->interval_max_ns <= d->interval_sum_ns);
}

/** A frame called right has the one number its CRC_0 allows, and all CRCs fit that. */
static void check_right(const struct bench *b, const struct fsn_monitor *before, unsigned way,
                        const uint8_t *frame) {
    const size_t len = b->len[way];
    if (fsn_fsoe_check(frame, len, 0, 1) && frame[0] <= FSN_CMD_SESSION) {
        return; /* Reset and Session begin a chain anywhere */
    }
    const uint16_t number = fsn_fsoe_solve_sequence(frame, len, before->last_crc);
    CHECK(number != 0 && fsn_fsoe_check(frame, len, before->last_crc, number));
    CHECK(b->monitor.followed[way].sequence == (number == 0xFFFF ? 1 : number + 1));
}

/** Shows the monitor a frame, in memory that is exactly as long. */
static enum fsn_verdict show(struct bench *b, unsigned way, const uint8_t *bytes) {
    const size_t len = b->len[way];
    uint8_t *frame = malloc(len);
    CHECK(frame != NULL);
    memcpy(frame, bytes, len);
    const bool same = memcmp(frame, last_of(b, way), len) == 0;
    struct fsn_monitor before;
    memcpy(&before, &b->monitor, sizeof before); /* padding too, it is compared */
    const enum fsn_verdict verdict =
        fsn_monitor_frame(&b->monitor, (enum fsn_way)way, frame, b->now_ns);
    CHECK((verdict == FSN_VERDICT_SAME) == same && verdict <= FSN_VERDICT_UNCHECKED);
    CHECK(memcmp(frame, bytes, len) == 0);
    const struct fsn_direction *d = &b->monitor.status.direction[way];
    CHECK(d->frames == before.status.direction[way].frames + !same);
    if (same) {
        CHECK(memcmp(&before, &b->monitor, sizeof before) == 0);
    } else {
        CHECK(d->command == frame[0] && d->connection_id == fsn_fsoe_connection_id(frame, len));
        CHECK(d->last_new_ns == b->now_ns);
        b->count[way]++;
        memcpy(b->seen[way][b->count[way] % MEMORY], frame, len);
    }
    if (verdict == FSN_VERDICT_RIGHT) {
        check_right(b, &before, way, frame);
    }
    check_direction(d);
    CHECK(b->monitor.status.observed <= FSN_OBSERVED_UNKNOWN);
    free(frame);
    return verdict;
}

/** Shows a frame that belongs to no chain: nothing is known after it unless it was the last. */
static void disturb(struct bench *b, unsigned way, const uint8_t *bytes) {
    if (show(b, way, bytes) != FSN_VERDICT_SAME) {
        b->known = false;
        b->in_row = 0;
    }
}

/** Puts command, data and ConnID of a frame of the chain. */
static void compose(struct bench *b, unsigned way, uint8_t command, uint8_t *frame) {
    const size_t len = b->len[way];
    const bool is_start = command == FSN_CMD_RESET || command == FSN_CMD_SESSION;
    const uint8_t data = input_byte(&b->in);
    memset(frame, 0, len);
    frame[0] = command;
    frame[1] = data;
    for (size_t at = 5; at + 6 <= len && command != FSN_CMD_RESET; at += 4) {
        frame[at] = (uint8_t)(data + at);
    }
    frame[len - 2] = is_start ? 0 : 0xCD;
    frame[len - 1] = is_start ? 0 : 0xAB;
}

/** The next frame of the chain. In turn it is right, out of turn an answer passed unseen. */
static void right(struct bench *b, unsigned way, uint8_t command) {
    uint8_t frame[FSN_MAX_FRAME_BYTES];
    const struct chain before = b->chain;
    const bool in_turn = before.last_way != way;
    compose(b, way, command, frame);
    chain_finish(&b->chain, way, frame, b->len[way]);
    const enum fsn_verdict verdict = show(b, way, frame);
    if (verdict == FSN_VERDICT_SAME) {
        b->chain = before; /* not seen, so as good as not sent */
        return;
    }
    if (in_turn && (b->known || b->in_row >= FOUND_AFTER)) {
        CHECK(verdict == FSN_VERDICT_RIGHT);
        fuzz_reached++;
    }
    if (!in_turn) {
        CHECK(!b->known || verdict == FSN_VERDICT_UNCHECKED);
        b->known = false;
    }
    b->in_row = in_turn ? b->in_row + 1 : 0;
}

/** A Reset that differs from the image before, so that it is seen. */
static void reset(struct bench *b, unsigned way) {
    uint8_t frame[FSN_MAX_FRAME_BYTES];
    const uint8_t *last = last_of(b, way);
    struct chain chain;
    compose(b, way, FSN_CMD_RESET, frame);
    frame[1] = last[0] == FSN_CMD_RESET && last[1] == frame[1] ? frame[1] + 1 : frame[1];
    chain_clear(&chain);
    chain_finish(&chain, way, frame, b->len[way]);
    CHECK(show(b, way, frame) == FSN_VERDICT_RIGHT);
    chain_clear(&b->chain);
    b->known = true;
    b->in_row = 0;
}

/** The main begins a session without a Reset, at any point of the chain. */
static void session(struct bench *b) {
    uint8_t frame[FSN_MAX_FRAME_BYTES];
    struct chain chain;
    compose(b, FSN_TO_SUB, FSN_CMD_SESSION, frame);
    chain_clear(&chain);
    chain_finish(&chain, FSN_TO_SUB, frame, b->len[FSN_TO_SUB]);
    const enum fsn_verdict verdict = show(b, FSN_TO_SUB, frame);
    if (verdict == FSN_VERDICT_SAME) {
        return;
    }
    CHECK(verdict == FSN_VERDICT_RIGHT);
    /* By chance it may fit the chain before as well; then that one continues. */
    const struct fsn_followed *followed = b->monitor.followed;
    b->known = followed[0].sequence == 2 && followed[1].sequence == 1 && !followed[1].has_own;
    b->chain = chain;
    b->in_row = 0;
}

/** One bit of the next right frame differs: never right. */
static void flip(struct bench *b, unsigned way, uint8_t command) {
    uint8_t frame[FSN_MAX_FRAME_BYTES];
    struct chain chain = b->chain;
    const size_t len = b->len[way];
    compose(b, way, command, frame);
    chain_finish(&chain, way, frame, len);
    const unsigned bit = input_word(&b->in) % (8 * (unsigned)len);
    frame[bit / 8] ^= (uint8_t)(1 << bit % 8);
    const bool starts = frame[0] == FSN_CMD_RESET || frame[0] == FSN_CMD_SESSION;
    /* With the number after the next, the collision rule allows a second CRC. */
    const uint16_t crc =
        fsn_fsoe_expected_crc0(frame, len, b->chain.last_crc, b->chain.sequence[way]);
    const bool collides = b->chain.has_own[way] && crc == b->chain.own[way];
    const bool certain = b->known && b->chain.last_way != way && !starts && !collides;
    const uint64_t right_before = b->monitor.status.direction[way].right;
    disturb(b, way, frame);
    CHECK(!certain || b->monitor.status.direction[way].right == right_before);
}

static void raw(struct bench *b, unsigned way) {
    uint8_t frame[FSN_MAX_FRAME_BYTES];
    for (size_t i = 0; i < b->len[way]; i++) {
        frame[i] = input_byte(&b->in);
    }
    disturb(b, way, frame);
}

static void replay(struct bench *b, unsigned way) {
    uint8_t frame[FSN_MAX_FRAME_BYTES];
    const unsigned from = input_byte(&b->in);
    memcpy(frame, b->seen[from / MEMORY % 2 == 0 ? way : 1 - way][from % MEMORY], b->len[way]);
    disturb(b, way, frame);
}

/** Many frames passed unseen: the numbers go on elsewhere. */
static void jump(struct bench *b) {
    const uint16_t number = (uint16_t)input_word(&b->in);
    b->chain.sequence[0] = b->chain.sequence[1] = number == 0 ? 1 : number;
    b->known = false;
    b->in_row = 0;
}

static void data_in_turn(struct bench *b, uint8_t command) {
    for (unsigned n = input_byte(&b->in) % 32; n > 0; n--) {
        right(b, b->chain.last_way == FSN_TO_SUB ? FSN_TO_MAIN : FSN_TO_SUB, command);
    }
}

static void carry_out(struct bench *b, uint8_t operation) {
    const unsigned way = operation >> 4 & 1u;
    const uint8_t command = commands[FIRST_DATA + (operation >> 5) % (COMMANDS - FIRST_DATA)];
    switch (operation % 16 % ORDERS) {
    case RIGHT:
        right(b, way, command);
        break;
    case RAW:
        raw(b, way);
        break;
    case FLIP:
        flip(b, way, command);
        break;
    case REPLAY:
        replay(b, way);
        break;
    case START:
        reset(b, way);
        break;
    case SESSION:
        session(b);
        break;
    case JUMP:
        jump(b);
        break;
    case WAIT:
        b->now_ns += input_word(&b->in);
        break;
    default:
        data_in_turn(b, command);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct bench *b = calloc(1, sizeof *b);
    CHECK(b != NULL);
    b->in = (struct input){.at = data, .left = size};
    b->len[0] = chain_length(input_byte(&b->in));
    b->len[1] = chain_length(input_byte(&b->in));
    chain_clear(&b->chain);
    CHECK(fsn_monitor_init(&b->monitor, (uint32_t)b->len[0], (uint32_t)b->len[1]) == FSN_OK);
    while (b->in.left > 0 && b->count[0] + b->count[1] < MOST_FRAMES) {
        carry_out(b, input_byte(&b->in));
    }
    free(b);
    return 0;
}
