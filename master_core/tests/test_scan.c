/** The scanner when its tables or the memory are full. The Python tests cover real traffic. */
/* shows R7 */
#include <string.h>

#include "../fuzz/fuzz.h"
#include "heap.h"
#include "rt/bytes.h"
#include "scan/scan.h"

enum {
    HEAD_AT = 14,
    DATAGRAM_HEAD = 10,
    MOST_PACKET = 2062,
    FRAME = FSN_MIN_FRAME_BYTES,
    LRW = 12,
    NS = 1000000
};

/** One Ethernet frame that is put together from datagrams. */
static struct {
    uint8_t bytes[MOST_PACKET];
    size_t len;
    uint64_t now_ns;
} packet;

static void begin_packet(void) {
    memset(packet.bytes, 0, sizeof packet.bytes);
    packet.bytes[12] = 0x88;
    packet.bytes[13] = 0xA4;
    packet.len = HEAD_AT + 2;
    packet.now_ns += NS;
}

/** Adds a datagram without setting the "more follows" bit of the one before. */
static void add_last_datagram(uint32_t address, const uint8_t *data, uint16_t size) {
    uint8_t *at = packet.bytes + packet.len;
    CHECK(packet.len + DATAGRAM_HEAD + size + 2 <= sizeof packet.bytes);
    at[0] = LRW;
    fsn_put32(at + 2, address);
    at[6] = (uint8_t)size;
    at[7] = (uint8_t)(size >> 8);
    memcpy(at + DATAGRAM_HEAD, data, size);
    at[DATAGRAM_HEAD + size] = 1;
    packet.len += DATAGRAM_HEAD + size + 2u;
}

static void add_datagram(uint32_t address, const uint8_t *data, uint16_t size) {
    if (packet.len > HEAD_AT + 2) { /* the one before has a follower: all are of one size here */
        packet.bytes[packet.len - 1 - 2 - size - 2] |= 0x80;
    }
    add_last_datagram(address, data, size);
}

static void hand_over(struct fsn_scan *scan) {
    const size_t len = packet.len - HEAD_AT - 2;
    packet.bytes[HEAD_AT] = (uint8_t)len;
    packet.bytes[HEAD_AT + 1] = (uint8_t)(0x10 | len >> 8);
    (void)fsn_scan_packet(scan, 0, packet.bytes, packet.len, packet.now_ns);
}

/** Two ends of a connection, one after the other. */
struct pair {
    struct chain chain;
    uint8_t frames[2 * FRAME];
};

static void put_frame(struct chain *chain, unsigned way, uint8_t command, uint16_t id,
                      uint8_t value, uint8_t *frame, size_t size) {
    memset(frame, 0, size);
    frame[0] = command;
    frame[1] = value;
    frame[size - 2] = (uint8_t)id;
    frame[size - 1] = (uint8_t)(id >> 8);
    chain_finish(chain, way, frame, size);
}

static void next_frame(struct pair *pair, uint16_t id, unsigned way, uint8_t value) {
    put_frame(&pair->chain, way, FSN_CMD_PROCESS_DATA, id, value,
              pair->frames + (size_t)way * FRAME, FRAME);
}

static uint64_t dropped(const struct fsn_scan *scan) {
    struct fsn_scan_counts counts;
    fsn_scan_counts(scan, &counts);
    return counts.dropped;
}

#ifdef FSN_TEST_HEAP
/** Whichever allocation fails: it is refused, or counted, and the connection is found later. */
static void memory_runs_out(void) {
    const long alive = heap.alive;
    long left = 0;
    for (long n = 1; left == 0; n++) {
        struct pair pair = {0};
        struct fsn_scan *scan = (void *)&packet;
        struct fsn_sighting sighting;
        uint64_t seen = 0;
        chain_clear(&pair.chain);
        heap.fails_in = n;
        const fsn_status status = fsn_scan_create(&scan);
        for (uint8_t i = 0; status == FSN_OK && i < 80; i++) {
            next_frame(&pair, 7, i % 2, i);
            begin_packet();
            add_datagram(0x1000, pair.frames, sizeof pair.frames);
            hand_over(scan);
            while (i % 8 == 7 && fsn_scan_next(scan, &sighting)) {
                seen++;
            }
        }
        left = heap.fails_in; /* there were not so many */
        heap.fails_in = 0;
        CHECK(status == (n <= 4 ? FSN_E_NOMEM : FSN_OK));
        if (status != FSN_OK) {
            CHECK(scan == NULL && heap.alive == alive);
            continue;
        }
        CHECK(fsn_scan_connection_count(scan) == 1);
        CHECK((dropped(scan) > 0) == (left == 0) && seen > 20);
        fsn_scan_free(scan);
        CHECK(heap.alive == alive);
    }
}
#endif

/** A new address has no room any more; those known go on. */
static void addresses_are_limited(void) {
    struct pair pair = {0};
    struct fsn_scan *scan;
    const uint8_t nothing[FRAME] = {0};
    chain_clear(&pair.chain);
    CHECK(fsn_scan_create(&scan) == FSN_OK);
    for (uint8_t i = 0; i < 40; i++) {
        next_frame(&pair, 7, i % 2, i);
        begin_packet();
        add_datagram(0x1000, pair.frames, sizeof pair.frames);
        hand_over(scan);
        for (uint32_t n = 0; i == 0 && n < MAX_WINDOWS + 1; n++) {
            CHECK(dropped(scan) == (n < MAX_WINDOWS ? 0 : 1));
            begin_packet();
            add_datagram(0x100000 + n, nothing, sizeof nothing);
            hand_over(scan);
        }
    }
    CHECK(dropped(scan) == 2 && fsn_scan_connection_count(scan) == 1);
    fsn_scan_free(scan);
}

/** Places that look like frames, more than it remembers. */
static void places_are_limited(void) {
    enum { PLACES = 240, WINDOWS = MAX_CANDIDATES / PLACES + 2 };
    static uint8_t data[PLACES * FRAME];
    struct fsn_scan *scan;
    CHECK(fsn_scan_create(&scan) == FSN_OK);
    for (unsigned round = 0; round < 2; round++) {
        for (uint32_t window = 0; window < WINDOWS; window++) {
            for (size_t place = 0; place < PLACES; place++) {
                uint8_t *frame = data + place * FRAME;
                memset(frame, 0x81, FRAME);
                frame[0] = FSN_CMD_PROCESS_DATA;
                frame[1] = (uint8_t)(0x80 + round);
            }
            begin_packet();
            add_datagram(0x10000 * window, data, sizeof data);
            hand_over(scan);
        }
    }
    CHECK(dropped(scan) > 0 && scan->candidate_count == MAX_CANDIDATES);
    CHECK(fsn_scan_connection_count(scan) == 0);
    fsn_scan_free(scan);
}

enum { PER_DATAGRAM = 82, PER_PACKET = 2 * PER_DATAGRAM, PAIRS = 7 * PER_PACKET };

/** Shows connections whose frames are adjacent, as in the process data of a main terminal.
 *  @param[in] together  from this even round on the answer comes in the same packet, but that of
 *  the first connection.
 *  @return number of correct frames from then on. */
static uint64_t show_side_by_side(struct fsn_scan *scan, size_t count, unsigned rounds,
                                  unsigned together) {
    static struct pair pairs[PAIRS];
    static uint8_t data[2][PER_DATAGRAM * 2 * FRAME];
    struct fsn_sighting sighting;
    uint64_t right = 0;
    for (size_t i = 0; i < count; i++) {
        chain_clear(&pairs[i].chain);
    }
    for (unsigned round = 0; round < rounds; round++) {
        for (size_t first = 0; first < count; first += PER_PACKET) {
            begin_packet();
            for (size_t i = 0; i < PER_PACKET; i++) {
                struct pair *pair = &pairs[first + i];
                const uint16_t id = (uint16_t)(first + i + 1);
                const bool both = round >= together && i > 0;
                next_frame(pair, id, both ? 0 : round % 2, (uint8_t)round);
                if (both) {
                    next_frame(pair, id, 1, (uint8_t)round);
                }
                memcpy(data[i / PER_DATAGRAM] + i % PER_DATAGRAM * 2 * FRAME, pair->frames,
                       2 * FRAME);
            }
            add_datagram((uint32_t)first << 16, data[0], sizeof data[0]);
            add_datagram((uint32_t)(first + 1) << 16, data[1], sizeof data[1]);
            hand_over(scan);
            while (fsn_scan_next(scan, &sighting)) {
                CHECK(sighting.verdict != FSN_VERDICT_WRONG);
                right += round >= together && sighting.verdict == FSN_VERDICT_RIGHT;
            }
        }
    }
    return right;
}

/** The second byte after each frame is the first of the next, so all of them look like 7-byte
 *  frames of one ConnID as well, and each such place has hundreds of candidates to try.
 */
static void connections_are_limited(void) {
    struct fsn_scan *scan;
    CHECK(fsn_scan_create(&scan) == FSN_OK);
    CHECK(show_side_by_side(scan, PAIRS, 60, 40) > 10u * MAX_CONNECTIONS);
    CHECK(dropped(scan) > 0 && fsn_scan_connection_count(scan) == MAX_CONNECTIONS);
    fsn_scan_free(scan);
}

/** Which of two frames in a packet came first is known at its end: all of them wait for it. */
static void a_packet_full_of_answers_is_right(void) {
    struct fsn_scan *scan;
    CHECK(fsn_scan_create(&scan) == FSN_OK);
    CHECK(show_side_by_side(scan, PER_PACKET, 120, 100) == 20 * (2 * PER_PACKET - 1));
    CHECK(dropped(scan) == 0 && fsn_scan_connection_count(scan) == PER_PACKET);
    fsn_scan_free(scan);
}

/** How many packets pass until a connection is found after so many places that are not frames.
 *  @param[in] others  6-byte places that change in every packet and all show the ConnID 0x3600. */
static unsigned packets_until_found(size_t others, uint16_t id) {
    enum { MOST = 330, LONGEST = 5000 };
    static uint8_t data[2][(MOST / 2 + 2) * FRAME];
    const size_t size = (others / 2 + 2) * FRAME;
    struct pair pair = {0};
    struct fsn_scan *scan;
    unsigned packets = 0;
    CHECK(others <= MOST && fsn_scan_create(&scan) == FSN_OK);
    chain_clear(&pair.chain);
    for (; packets < LONGEST && fsn_scan_connection_count(scan) == 0; packets++) {
        for (size_t place = 0; place < others; place++) {
            uint8_t *frame = data[place % 2] + place / 2 * FRAME;
            const uint8_t bytes[FRAME] = {
                FSN_CMD_PROCESS_DATA, (uint8_t)(packets | 0x80), 0x81, 0x81, 0, 0x36};
            memcpy(frame, bytes, sizeof bytes);
        }
        next_frame(&pair, id, packets % 2, (uint8_t)packets);
        memcpy(data[1] + size - 2 * FRAME, pair.frames, 2 * FRAME);
        begin_packet();
        add_datagram(0x1000, data[0], (uint16_t)size);
        add_datagram(0x2000, data[1], (uint16_t)size);
        hand_over(scan);
    }
    fsn_scan_free(scan);
    return packets;
}

/** Places that never fit do not block the others, and each place is compared with all others in the
 *  end. */
static void what_is_no_frame_holds_nothing_up(void) {
    CHECK(packets_until_found(0, 7) < 20);
    CHECK(packets_until_found(326, 7) < 300);
    CHECK(packets_until_found(20, 0x3600) < 1000);
}

/** How many frames a connection shows until it is found where another value has been before. */
static unsigned frames_until_found(uint8_t before) {
    enum { PACKETS = 20, LONGEST = 100 };
    struct pair pair = {.frames = {[0] = before, [FRAME] = before}};
    uint8_t data[2 * FRAME + 1];
    struct fsn_scan *scan;
    unsigned frames = 0;
    chain_clear(&pair.chain);
    CHECK(fsn_scan_create(&scan) == FSN_OK);
    for (unsigned i = 0; frames < LONGEST && fsn_scan_connection_count(scan) == 0; i++) {
        if (i >= PACKETS) {
            next_frame(&pair, 7, frames % 2, (uint8_t)frames);
            frames++;
        }
        memcpy(data, pair.frames, sizeof pair.frames);
        data[2 * FRAME] = (uint8_t)i; /* only the byte after both changes */
        begin_packet();
        add_datagram(0x1000, data, sizeof data);
        hand_over(scan);
    }
    fsn_scan_free(scan);
    return frames;
}

static void a_value_that_stays_delays_nothing(void) {
    CHECK(frames_until_found(0) < 20);
    CHECK(frames_until_found(0x55) == frames_until_found(0));
}

/** One image in two datagrams, cut at each byte. Every seventh packet the second has no answer. */
static void a_frame_may_be_cut_by_two_datagrams(void) {
    enum { PACKETS = 300 };
    for (uint16_t cut = 1; cut < 2 * FRAME; cut++) {
        struct pair pair = {0};
        struct fsn_scan *scan;
        struct fsn_sighting seen;
        struct fsn_scan_counts counts;
        unsigned right = 0, wrong = 0, sent = 0;
        chain_clear(&pair.chain);
        CHECK(fsn_scan_create(&scan) == FSN_OK);
        for (unsigned i = 0; i < PACKETS; i++) {
            const bool answered = i % 7 != 0;
            if (answered) {
                next_frame(&pair, 7, sent % 2, (uint8_t)sent);
                sent++;
            }
            begin_packet();
            add_datagram(0x1000, pair.frames, cut);
            packet.bytes[HEAD_AT + 2 + 7] |= 0x80; /* another follows */
            uint8_t rest[2 * FRAME] = {0}; /* without an answer the previous outputs come back */
            memcpy(rest, answered ? pair.frames + cut : rest, (size_t)(2 * FRAME - cut));
            add_last_datagram(0x1000u + cut, rest, (uint16_t)(2 * FRAME - cut));
            if (!answered) {
                memset(packet.bytes + packet.len - 2, 0, 2);
            }
            hand_over(scan);
            while (fsn_scan_next(scan, &seen)) {
                right += seen.verdict == FSN_VERDICT_RIGHT;
                wrong += seen.verdict == FSN_VERDICT_WRONG;
            }
        }
        fsn_scan_counts(scan, &counts);
        CHECK(fsn_scan_connection_count(scan) == 1 && wrong == 0);
        CHECK(right > PACKETS / 2 && counts.unanswered == PACKETS / 7 + 1);
        CHECK(counts.datagrams == 2 * PACKETS - counts.unanswered);
        fsn_scan_free(scan);
    }
}

enum { LONG = 11 }; /**< bytes of a frame with two CRCs */

/** Hands over a packet with one datagram; returns how many frames of it were wrong. */
static unsigned wrong_in(struct fsn_scan *scan, const uint8_t *data, uint16_t size) {
    struct fsn_sighting seen;
    unsigned wrong = 0;
    begin_packet();
    add_datagram(0x1000, data, size);
    hand_over(scan);
    while (fsn_scan_next(scan, &seen)) {
        wrong += seen.verdict == FSN_VERDICT_WRONG;
    }
    return wrong;
}

/** The capture lacks a frame, and then all frames up to a packet with the answer to a session and
 *  the start of the next one: only one order has no wrong frame. */
static void an_answer_comes_before_the_next_session(void) {
    enum { PACKETS = 40 };
    struct pair pair = {0};
    struct fsn_scan *scan;
    uint8_t *const to_main = pair.frames + FRAME;
    chain_clear(&pair.chain);
    CHECK(fsn_scan_create(&scan) == FSN_OK);
    for (unsigned i = 0; i < PACKETS; i++) {
        next_frame(&pair, 7, i % 2, (uint8_t)i);
        CHECK(wrong_in(scan, pair.frames, sizeof pair.frames) == 0);
    }
    CHECK(fsn_scan_connection_count(scan) == 1);
    const struct pair before = pair;
    next_frame(&pair, 7, FSN_TO_SUB, PACKETS);
    memcpy(pair.frames, before.frames, FRAME); /* not seen */
    next_frame(&pair, 7, FSN_TO_MAIN, PACKETS);
    CHECK(wrong_in(scan, pair.frames, sizeof pair.frames) == 0);
    put_frame(&pair.chain, FSN_TO_MAIN, FSN_CMD_SESSION, 0, 0x12, to_main, FRAME);
    chain_clear(&pair.chain);
    put_frame(&pair.chain, FSN_TO_SUB, FSN_CMD_SESSION, 0, 0x34, pair.frames, FRAME);
    CHECK(wrong_in(scan, pair.frames, sizeof pair.frames) == 0);
    put_frame(&pair.chain, FSN_TO_MAIN, FSN_CMD_SESSION, 0, 0x56, to_main, FRAME);
    CHECK(wrong_in(scan, pair.frames, sizeof pair.frames) == 0);
    fsn_scan_free(scan);
}

/** A capture begins in Data, and the numbers of the ends suggest the wrong roles. A session that
 *  the main begins shows the correct ones: all counters move with their end. */
static void a_session_shows_who_is_the_main(void) {
    enum { PACKETS = 40 };
    uint8_t data[LONG + FRAME] = {0};
    uint8_t *const to_main = data + LONG;
    struct chain chain;
    struct fsn_scan *scan;
    struct fsn_scan_connection found;
    chain_clear(&chain);
    chain.sequence[FSN_TO_MAIN] = 9;
    CHECK(fsn_scan_create(&scan) == FSN_OK);
    for (unsigned i = 0; i < PACKETS; i++) {
        const uint8_t value = (uint8_t)i;
        if (i % 2 == 0) {
            put_frame(&chain, FSN_TO_SUB, FSN_CMD_PROCESS_DATA, 7, value, data, LONG);
        } else {
            put_frame(&chain, FSN_TO_MAIN, FSN_CMD_FAILSAFE_DATA, 7, value, to_main, FRAME);
        }
        CHECK(wrong_in(scan, data, sizeof data) == 0);
    }
    CHECK(fsn_scan_connection(scan, 0, &found) == FSN_OK && found.roles == FSN_ROLES_BY_NUMBERS);
    CHECK(found.places[FSN_TO_SUB].size_bytes == FRAME);
    chain_clear(&chain);
    put_frame(&chain, FSN_TO_SUB, FSN_CMD_SESSION, 0, 0x12, data, LONG);
    CHECK(wrong_in(scan, data, sizeof data) == 0);
    put_frame(&chain, FSN_TO_MAIN, FSN_CMD_SESSION, 0, 0x34, to_main, FRAME);
    CHECK(wrong_in(scan, data, sizeof data) == 0);
    CHECK(fsn_scan_connection(scan, 0, &found) == FSN_OK && found.roles == FSN_ROLES_BY_START);
    CHECK(found.places[FSN_TO_SUB].size_bytes == LONG);
    const struct fsn_direction *const seen = found.status.direction;
    CHECK(seen[FSN_TO_MAIN].command == FSN_CMD_SESSION);
    CHECK(seen[FSN_TO_SUB].process_data > PACKETS / 4 && seen[FSN_TO_SUB].failsafe_data == 0);
    CHECK(seen[FSN_TO_MAIN].failsafe_data > PACKETS / 4 && seen[FSN_TO_MAIN].process_data == 0);
    fsn_scan_free(scan);
}

/** Of a packet that the capture has cut, the datagrams before the cut count. */
static void a_packet_may_be_cut_by_the_capture(void) {
    enum { SIZE = 8, WHOLE = DATAGRAM_HEAD + SIZE + 2 };
    static const uint8_t data[SIZE] = {1};
    struct fsn_scan *scan;
    struct fsn_scan_counts counts;
    CHECK(fsn_scan_create(&scan) == FSN_OK);
    begin_packet();
    add_datagram(0x1000, data, SIZE);
    add_datagram(0x2000, data, SIZE);
    hand_over(scan);
    fsn_scan_counts(scan, &counts);
    CHECK(counts.datagrams == 2 && counts.malformed == 0);
    for (size_t cut = 1; cut <= 2 * WHOLE; cut++) { /* the bytes after the cut are still there */
        const struct fsn_scan_counts before = counts;
        (void)fsn_scan_packet(scan, 0, packet.bytes, packet.len - cut, packet.now_ns);
        fsn_scan_counts(scan, &counts);
        CHECK(counts.datagrams == before.datagrams + (cut <= WHOLE ? 1 : 0));
        CHECK(counts.malformed == before.malformed + 1);
    }
    fsn_scan_free(scan);
}

static void what_is_no_packet_is_no_harm(void) {
    static const uint8_t short_one[] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x88, 0xA4, 0};
    struct fsn_scan *scan;
    struct fsn_scan_counts counts;
    CHECK(fsn_scan_create(NULL) == FSN_E_ARG);
    CHECK(fsn_scan_create(&scan) == FSN_OK);
    for (size_t len = 0; len <= sizeof short_one; len++) {
        CHECK(fsn_scan_packet(scan, 0, short_one, len, len) == 0);
    }
    fsn_scan_counts(scan, &counts);
    CHECK(counts.packets == sizeof short_one + 1 && counts.ethercat == 2 && counts.malformed == 2);
    fsn_scan_free(scan);
    fsn_scan_free(NULL);
}

int main(void) {
#ifdef FSN_TEST_HEAP
    memory_runs_out();
#endif
    addresses_are_limited();
    places_are_limited();
    connections_are_limited();
    a_packet_full_of_answers_is_right();
    what_is_no_frame_holds_nothing_up();
    a_value_that_stays_delays_nothing();
    a_frame_may_be_cut_by_two_datagrams();
    an_answer_comes_before_the_next_session();
    a_session_shows_who_is_the_main();
    a_packet_may_be_cut_by_the_capture();
    what_is_no_packet_is_no_harm();
    return 0;
}
