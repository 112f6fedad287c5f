/** Fuzz target: any bytes as captured traffic. Fits libFuzzer and driver.c.
 *
 *  A packet of the input is handed over as it is. So that the scanner finds connections in what no
 *  mutation would build, the script also keeps a process image, writes right FSoE frames of three
 *  connections into it, disturbs it and sends it as one datagram. Layout: three bytes for the frame
 *  lengths, then operations of one byte (low three bits: enum order, then the connection, bit 5:
 *  direction, bits 6 and 7: command) with what each of them needs. */
#include "fuzz.h"

#include <stdlib.h>
#include <string.h>

enum order { FRAME, SEND, PACKET, CYCLES, POKE, START, SHAPE, COPY };
enum {
    CONNECTIONS = 3,
    PLACE_BYTES = 512, /**< for both directions of one connection */
    IMAGE_BYTES = CONNECTIONS * PLACE_BYTES,
    MAC_BYTES = 12,
    DATAGRAM_AT = MAC_BYTES + 2 + 2,
    HEAD_BYTES = 10,
    MOST_PACKETS = 512,
    NOT_FOUND = 0xFF,
    KNOWN = 8, /**< connections whose roles are remembered */
    LRW = 12
};

static const uint8_t commands[] = {FSN_CMD_PROCESS_DATA, FSN_CMD_FAILSAFE_DATA, FSN_CMD_CONNECTION,
                                   FSN_CMD_PARAMETER};

uint64_t fuzz_reached;

struct wire {
    struct input in;
    struct fsn_scan *scan;
    struct chain chain[CONNECTIONS];
    size_t len[CONNECTIONS][2];
    uint8_t image[IMAGE_BYTES];
    uint8_t command;
    uint16_t size, address, working_counter;
    uint64_t now_ns, packets;
    uint8_t roles[KNOWN]; /**< how they were known before this packet; NOT_FOUND: not at all */
};

static void check_direction(const struct fsn_direction *d) {
    CHECK(d->frames == d->right + d->wrong + d->unchecked);
    CHECK(d->process_data + d->failsafe_data <= d->frames && d->resets <= d->frames);
    CHECK(d->interval_max_ns <= d->interval_sum_ns);
}

static void check_connections(const struct fsn_scan *scan) {
    struct fsn_scan_connection c;
    const uint32_t count = fsn_scan_connection_count(scan);
    CHECK(fsn_scan_connection(scan, count, &c) == FSN_E_ARG);
    for (uint32_t number = 0; number < count; number++) {
        CHECK(fsn_scan_connection(scan, number, &c) == FSN_OK);
        CHECK(c.connection_id != 0 && c.roles <= FSN_ROLES_BY_START);
        CHECK(c.place_count >= 2 && c.place_count <= FSN_SCAN_PLACES);
        CHECK(c.places[0].way == FSN_TO_SUB && c.places[1].way == FSN_TO_MAIN);
        for (uint32_t i = 0; i < c.place_count; i++) {
            CHECK(fsn_fsoe_is_frame_length(c.places[i].size_bytes) && c.places[i].way < 2);
        }
        CHECK(c.status.observed <= FSN_OBSERVED_UNKNOWN);
        check_direction(&c.status.direction[0]);
        check_direction(&c.status.direction[1]);
    }
}

static void check_sighting(const struct wire *w, const struct fsn_sighting *s) {
    CHECK(s->verdict >= FSN_VERDICT_RIGHT && s->verdict <= FSN_VERDICT_UNCHECKED);
    CHECK(s->connection < fsn_scan_connection_count(w->scan) && s->way < 2);
    CHECK(s->observed <= FSN_OBSERVED_UNKNOWN && fsn_fsoe_is_frame_length(s->size_bytes));
    CHECK(s->packet >= 1 && s->packet <= w->packets && s->time_ns <= w->now_ns);
    CHECK(s->sequence == 0 || s->verdict == FSN_VERDICT_RIGHT);
    struct fsn_scan_connection c;
    CHECK(fsn_scan_connection(w->scan, s->connection, &c) == FSN_OK);
    if (s->connection < KNOWN && w->roles[s->connection] == c.roles) { /* else they may swap */
        CHECK(s->size_bytes == c.places[s->way].size_bytes);
    }
    fuzz_reached += s->verdict == FSN_VERDICT_RIGHT;
}

static void remember_roles(struct wire *w) {
    for (uint32_t number = 0; number < KNOWN; number++) {
        struct fsn_scan_connection c;
        const bool found = fsn_scan_connection(w->scan, number, &c) == FSN_OK;
        w->roles[number] = found ? c.roles : NOT_FOUND;
    }
}

/** Hands a packet over, in memory that is exactly as long, and takes what was seen. */
static void hand_over(struct wire *w, const uint8_t *bytes, size_t len) {
    uint8_t *packet = malloc(len > 0 ? len : 1);
    CHECK(packet != NULL);
    memcpy(packet, bytes, len);
    remember_roles(w);
    w->packets++;
    w->now_ns += 1000;
    uint32_t waiting = fsn_scan_packet(w->scan, 0, packet, len, w->now_ns);
    CHECK(memcmp(packet, bytes, len) == 0);
    free(packet);
    struct fsn_sighting sighting;
    for (; fsn_scan_next(w->scan, &sighting); waiting--) {
        CHECK(waiting > 0);
        check_sighting(w, &sighting);
    }
    CHECK(waiting == 0);
}

static uint8_t *place(struct wire *w, unsigned c, unsigned way) {
    return w->image + c * PLACE_BYTES + way * w->len[c][0];
}

static void write_frame(struct wire *w, unsigned c, unsigned way, uint8_t command) {
    const size_t len = w->len[c][way];
    uint8_t *frame = place(w, c, way);
    const bool is_start = command == FSN_CMD_RESET || command == FSN_CMD_SESSION;
    const uint8_t data = command == FSN_CMD_RESET ? 0 : (uint8_t)(w->packets * 7);
    memset(frame, 0, len);
    frame[0] = command;
    frame[1] = data;
    frame[len - 2] = is_start ? 0 : (uint8_t)(c + 1);
    frame[len - 1] = is_start ? 0 : 0xAB;
    chain_finish(&w->chain[c], way, frame, len);
}

static void send_image(struct wire *w) {
    uint8_t packet[DATAGRAM_AT + HEAD_BYTES + IMAGE_BYTES + 2] = {0};
    const unsigned len = HEAD_BYTES + w->size + 2u;
    packet[MAC_BYTES] = 0x88;
    packet[MAC_BYTES + 1] = 0xA4;
    packet[MAC_BYTES + 2] = (uint8_t)len;
    packet[MAC_BYTES + 3] = (uint8_t)(len >> 8 | 0x10);
    uint8_t *datagram = packet + DATAGRAM_AT;
    datagram[0] = w->command;
    datagram[4] = (uint8_t)w->address;
    datagram[5] = (uint8_t)(w->address >> 8);
    datagram[6] = (uint8_t)w->size;
    datagram[7] = (uint8_t)(w->size >> 8);
    memcpy(datagram + HEAD_BYTES, w->image, w->size);
    datagram[HEAD_BYTES + w->size] = (uint8_t)w->working_counter;
    datagram[HEAD_BYTES + w->size + 1] = (uint8_t)(w->working_counter >> 8);
    hand_over(w, packet, DATAGRAM_AT + (size_t)len);
}

/** FSoE cycles of all connections in one packet each way, as a bus has them. */
static void cycles(struct wire *w, uint8_t command) {
    for (unsigned n = input_byte(&w->in) % 16; n > 0 && w->packets < MOST_PACKETS; n--) {
        for (unsigned way = 0; way < 2; way++) {
            for (unsigned c = 0; c < CONNECTIONS; c++) {
                write_frame(w, c, way, command);
            }
            send_image(w);
        }
    }
}

/** Reset, then the main's Session: a start-up shows the roles. Or only other numbers, as after many
 *  collisions: then a guess of the roles by the numbers is wrong. */
static void start(struct wire *w, unsigned c) {
    const uint8_t how = input_byte(&w->in);
    const bool reset = how % 2 == 0;
    chain_clear(&w->chain[c]);
    if (how == 2) {
        w->chain[c].sequence[FSN_TO_MAIN] = 9;
        return;
    }
    for (unsigned way = 0; way < 2 && reset; way++) {
        write_frame(w, c, way, FSN_CMD_RESET);
        send_image(w);
        chain_clear(&w->chain[c]);
    }
    for (unsigned way = 0; way < 2; way++) {
        write_frame(w, c, way, FSN_CMD_SESSION);
        send_image(w);
    }
}

static void packet_as_it_is(struct wire *w) {
    const size_t len = input_word(&w->in) % 2048;
    const size_t there = len < w->in.left ? len : w->in.left;
    hand_over(w, w->in.at, there);
    w->in.at += there;
    w->in.left -= there;
}

static void shape(struct wire *w) {
    static const uint8_t process_data[] = {LRW, 10, 11, 1, 2, 4, 5, 6, 7};
    w->command = process_data[input_byte(&w->in) % sizeof process_data];
    w->size = (uint16_t)(input_word(&w->in) % (IMAGE_BYTES + 1));
    w->address = (uint16_t)(0x1000 + input_byte(&w->in));
    w->working_counter = input_byte(&w->in) % 4;
}

/** Moves a piece of the image elsewhere: copies of frames are what a copy master makes. */
static void copy(struct wire *w) {
    const size_t from = input_word(&w->in) % IMAGE_BYTES;
    const size_t to = input_word(&w->in) % IMAGE_BYTES;
    const size_t most = IMAGE_BYTES - (from > to ? from : to);
    const size_t len = input_byte(&w->in);
    memmove(w->image + to, w->image + from, len < most ? len : most);
}

/** In this order with any compiler. */
static void damage(struct wire *w) {
    const size_t at = input_word(&w->in) % IMAGE_BYTES;
    w->image[at] = input_byte(&w->in);
}

static void carry_out(struct wire *w, uint8_t operation) {
    const unsigned c = (operation >> 3 & 3u) % CONNECTIONS;
    const uint8_t command = commands[operation >> 6];
    switch (operation % 8) {
    case FRAME:
        write_frame(w, c, operation >> 5 & 1u, command);
        break;
    case SEND:
        send_image(w);
        break;
    case PACKET:
        packet_as_it_is(w);
        break;
    case CYCLES:
        cycles(w, command);
        break;
    case POKE:
        damage(w);
        break;
    case START:
        start(w, c);
        break;
    case SHAPE:
        shape(w);
        break;
    default:
        copy(w);
    }
}

static void check_counts(const struct wire *w) {
    struct fsn_scan_counts n;
    fsn_scan_counts(w->scan, &n);
    CHECK(n.packets == w->packets && n.ethercat <= n.packets && n.malformed <= n.ethercat);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct wire *w = calloc(1, sizeof *w);
    CHECK(w != NULL);
    w->in = (struct input){.at = data, .left = size};
    for (unsigned c = 0; c < CONNECTIONS; c++) {
        const unsigned shape = input_byte(&w->in);
        w->len[c][0] = chain_length(shape % 16);
        w->len[c][1] = chain_length(shape / 16);
        chain_clear(&w->chain[c]);
    }
    w->command = LRW;
    w->size = IMAGE_BYTES - 100;
    w->working_counter = 1;
    CHECK(fsn_scan_create(&w->scan) == FSN_OK);
    while (w->in.left > 0 && w->packets < MOST_PACKETS) {
        carry_out(w, input_byte(&w->in));
    }
    check_connections(w->scan);
    check_counts(w);
    fsn_scan_free(w->scan);
    free(w);
    return 0;
}
