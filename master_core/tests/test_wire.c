/** The cyclic wire against a segment of our own making: freshness, old replies, the ring. */
#define _GNU_SOURCE

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "builder.h"
#include "live/frames.h"

enum { MOST = 300, LEN = 1600 };

/** Two SubDevices of the e-stop plan: image bytes 0..8 and 17..24 are outputs, the others inputs.
 */
struct rig {
    uint8_t *bytes;
    struct fsn_plan *plan;
    struct fsn_frames frames;
    int far[2];
    struct fsn_wkc wkc[2];
    uint8_t stale[8];
    struct fsn_bus_input input;
    uint8_t queue[MOST][LEN]; /**< frames that the segment holds */
    ssize_t length[MOST];
    unsigned queued;
    bool present[2];
    uint8_t fill; /**< what the SubDevices deliver */
};

static struct rig *set_up(unsigned ports) {
    struct rig *rig = calloc(1, sizeof *rig);
    CHECK(rig != NULL);
    size_t len;
    rig->bytes = build_estop(&len);
    CHECK(fsn_plan_load(rig->bytes, len, &rig->plan, NULL) == FSN_OK);
    CHECK(fsn_frames_create(rig->plan, 0x1001, &rig->frames) == FSN_OK);
    rig->frames.wire.run = 0x12345678;
    rig->frames.wire.dc_every = 2;
    rig->far[1] = -1;
    for (unsigned port = 0; port < ports; port++) {
        int pair[2];
        CHECK(socketpair(AF_UNIX, SOCK_SEQPACKET, 0, pair) == 0);
        rig->frames.wire.sockets[port] = pair[0];
        rig->far[port] = pair[1];
    }
    rig->input = (struct fsn_bus_input){.wkc = rig->wkc, .sm_stale = rig->stale};
    rig->present[0] = rig->present[1] = true;
    rig->fill = 0xA0;
    return rig;
}

static void tear_down(struct rig *rig) {
    for (unsigned port = 0; port < 2; port++) {
        if (rig->far[port] >= 0) {
            close(rig->far[port]);
            close(rig->frames.wire.sockets[port]);
        }
    }
    fsn_frames_free(&rig->frames);
    fsn_plan_free(rig->plan);
    free(rig->bytes);
    free(rig);
}

static void count_up(uint8_t *at, uint16_t by) {
    const uint16_t value = (uint16_t)(fsn_get16(at) + by);
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

/** What SubDevice `n` does to a frame that passes. */
static void visit(const struct rig *rig, unsigned n, uint8_t *frame) {
    const struct fsn_wire_frame *f = &rig->frames.wire.frames[0];
    const uint32_t input = rig->frames.image.sm_base[2 * n + 1];
    if (!rig->present[n]) {
        return;
    }
    memset(frame + FSN_WIRE_DATA + input, rig->fill + (int)n, 8);
    count_up(frame + FSN_WIRE_DATA + f->size_bytes, 3);
    if (frame[f->dc] == 14) {
        memset(frame + f->dc + 10, 0x11, 8);
        count_up(frame + f->dc + 18, 1);
    }
}

/** Takes the next frame from a port into the queue; false when there is none. */
static bool hold(struct rig *rig, unsigned port) {
    CHECK(rig->queued < MOST);
    uint8_t *at = rig->queue[rig->queued];
    const ssize_t got = recv(rig->far[port], at, LEN, MSG_DONTWAIT);
    if (got <= 0) {
        return false;
    }
    rig->length[rig->queued++] = got;
    return true;
}

static void answer(struct rig *rig, unsigned number, unsigned port) {
    CHECK(send(rig->far[port], rig->queue[number], (size_t)rig->length[number], 0) > 0);
}

/** Sends one cycle; all SubDevices answer. */
static void exchange(struct rig *rig) {
    fsn_wire_send(&rig->frames.wire);
    rig->queued = 0;
    CHECK(hold(rig, 0) && !hold(rig, 0));
    visit(rig, 0, rig->queue[0]);
    visit(rig, 1, rig->queue[0]);
    answer(rig, 0, 0);
}

static void take(struct rig *rig) {
    memset(rig->wkc, 0, sizeof rig->wkc);
    memset(rig->stale, 0, sizeof rig->stale);
    rig->input = (struct fsn_bus_input){.wkc = rig->wkc, .sm_stale = rig->stale};
    fsn_wire_receive(&rig->frames.wire, &rig->input);
}

static bool inputs_are(const struct rig *rig, uint8_t first, uint8_t second) {
    uint8_t expected[8];
    memset(expected, first, 8);
    if (memcmp(rig->frames.bytes + rig->frames.image.sm_base[1], expected, 8) != 0) {
        return false;
    }
    memset(expected, second, 8);
    return memcmp(rig->frames.bytes + rig->frames.image.sm_base[3], expected, 8) == 0;
}

static void inputs_come_in_and_outputs_stay(void) {
    struct rig *rig = set_up(1);
    take(rig); /* before the first frame */
    CHECK(rig->wkc[0].expected == 0 && rig->input.lost_frames == 0);
    memset(rig->frames.bytes, 0x55, 4);
    exchange(rig);
    CHECK(rig->queue[0][FSN_WIRE_DATA] == 0x55);
    take(rig);
    CHECK(inputs_are(rig, 0xA0, 0xA1));
    CHECK(rig->wkc[0].expected == 6 && rig->wkc[0].actual == 6);
    CHECK(rig->input.dc_time_ns == 0x1111111111111111u);
    CHECK(rig->frames.bytes[0] == 0x55 && rig->stale[1] == 0 && rig->stale[3] == 0);
    exchange(rig); /* the second cycle carries no DC time */
    take(rig);
    CHECK(rig->input.dc_time_ns == 0 && rig->input.old_replies == 0);
    tear_down(rig);
}

static void the_missing_keeps_its_bytes(void) {
    struct rig *rig = set_up(1);
    exchange(rig);
    take(rig);
    rig->present[1] = false;
    rig->fill = 0xB0;
    atomic_store(&rig->frames.wire.answers[0], 1);
    exchange(rig);
    take(rig);
    CHECK(inputs_are(rig, 0xB0, 0xA1));
    CHECK(rig->wkc[0].actual == 3 && rig->stale[1] == 0 && rig->stale[3] == 1);
    fsn_wire_send(&rig->frames.wire); /* lost altogether */
    take(rig);
    CHECK(inputs_are(rig, 0xB0, 0xA1));
    CHECK(rig->input.lost_frames == 1 && rig->stale[1] == 1 && rig->stale[3] == 1);
    CHECK(rig->wkc[0].expected == 6 && rig->wkc[0].actual == 0);
    tear_down(rig);
}

/** The segment stands still for many cycles, then gives everything back at once. SOEM, which tells
 *  replies apart by an index modulo 16, takes each of them for a new one from then on. */
static void old_replies_never_pass(unsigned cycles) {
    struct rig *rig = set_up(1);
    exchange(rig);
    take(rig);
    rig->queued = 0;
    for (unsigned i = 0; i < cycles; i++) {
        fsn_wire_send(&rig->frames.wire);
        CHECK(hold(rig, 0));
        rig->fill = (uint8_t)i;
        visit(rig, 0, rig->queue[i]);
        visit(rig, 1, rig->queue[i]);
        take(rig);
        CHECK(rig->input.lost_frames == 1 && inputs_are(rig, 0xA0, 0xA1));
    }
    fsn_wire_send(&rig->frames.wire);
    for (unsigned i = 0; i < cycles; i++) {
        answer(rig, i, 0);
    }
    rig->queued = 0;
    CHECK(hold(rig, 0));
    rig->fill = 0xC0;
    visit(rig, 0, rig->queue[0]);
    visit(rig, 1, rig->queue[0]);
    answer(rig, 0, 0);
    take(rig);
    CHECK(rig->input.old_replies == cycles && rig->input.lost_frames == 0);
    CHECK(inputs_are(rig, 0xC0, 0xC1) && rig->wkc[0].actual == 6);
    tear_down(rig);
}

static void a_repeated_reply_counts_once(void) {
    struct rig *rig = set_up(1);
    exchange(rig);
    answer(rig, 0, 0);
    take(rig);
    CHECK(rig->wkc[0].actual == 6);
    rig->fill = 0xB0;
    exchange(rig);
    take(rig); /* the second one is old by now */
    CHECK(rig->input.old_replies == 1 && inputs_are(rig, 0xB0, 0xB1));
    tear_down(rig);
}

/** Every single byte of the heads changed: the reply is thrown away, the image keeps its bytes. */
static void damaged_replies_are_foreign(void) {
    struct rig *rig = set_up(1);
    unsigned refused = 0;
    for (uint32_t byte = 12; byte < FSN_WIRE_DATA; byte++) {
        rig->fill = 0xA0;
        fsn_wire_send(&rig->frames.wire);
        rig->queued = 0;
        CHECK(hold(rig, 0));
        visit(rig, 0, rig->queue[0]);
        visit(rig, 1, rig->queue[0]);
        rig->queue[0][byte] ^= 0x08;
        answer(rig, 0, 0);
        memset(rig->frames.bytes, 0, rig->frames.image.bytes);
        take(rig);
        refused += rig->input.lost_frames;
        if (rig->input.lost_frames != 0) {
            CHECK(inputs_are(rig, 0, 0));
        }
    }
    /* Free to change: interrupt word and working counter of the NOP, interrupt word of the LRW. */
    CHECK(refused == FSN_WIRE_DATA - 12 - 6);
    for (ssize_t length = 1; length < 80; length++) {
        fsn_wire_send(&rig->frames.wire);
        rig->queued = 0;
        CHECK(hold(rig, 0));
        const ssize_t whole = rig->length[0];
        rig->length[0] = length < whole ? length : whole - 1;
        answer(rig, 0, 0);
        take(rig);
        CHECK(rig->input.lost_frames == 1);
    }
    tear_down(rig);
}

/** What the acyclic side has heard of another MainDevice is counted once, whenever it comes. */
static void foreign_frames_count_once(void) {
    struct rig *rig = set_up(1);
    exchange(rig);
    take(rig);
    CHECK(rig->input.foreign_frames == 0);
    atomic_fetch_add(&rig->frames.wire.foreign, 3);
    exchange(rig);
    take(rig);
    CHECK(rig->input.foreign_frames == 3);
    exchange(rig);
    take(rig);
    CHECK(rig->input.foreign_frames == 0);
    tear_down(rig);
}

/** What the system refuses to send is counted, with its reason. */
static void what_cannot_be_sent_is_counted(void) {
    struct rig *rig = set_up(1);
    const int wire = rig->frames.wire.sockets[0];
    const int no_socket = open("/dev/null", O_WRONLY | O_CLOEXEC);
    CHECK(no_socket >= 0);
    rig->frames.wire.sockets[0] = no_socket;
    fsn_wire_send(&rig->frames.wire);
    take(rig);
    CHECK(rig->input.unsent_frames == 1 && rig->input.send_errno == ENOTSOCK);
    CHECK(rig->input.lost_frames == 1);
    rig->frames.wire.sockets[0] = wire;
    exchange(rig);
    take(rig);
    CHECK(rig->input.unsent_frames == 0 && rig->input.lost_frames == 0);
    close(no_socket);
    tear_down(rig);
}

static void ring(bool broken, bool second_cable_out) {
    struct rig *rig = set_up(2);
    for (unsigned i = 0; i < 3; i++) {
        rig->fill = (uint8_t)(0xA0 + 4 * i);
        rig->queued = 0;
        fsn_wire_send(&rig->frames.wire);
        CHECK(hold(rig, 0) && hold(rig, 1));
        visit(rig, 0, rig->queue[0]);
        visit(rig, 1, rig->queue[broken ? 1 : 0]);
        answer(rig, 0, broken ? 0 : 1);
        if (!second_cable_out) {
            answer(rig, 1, broken ? 1 : 0);
        }
        take(rig);
        CHECK(inputs_are(rig, rig->fill, (uint8_t)(rig->fill + 1)));
        CHECK(rig->wkc[0].actual == 6 && rig->input.lost_frames == 0);
        CHECK(atomic_load(&rig->frames.wire.crossed) == !broken);
    }
    tear_down(rig);
}

static void waiting_ends_with_the_reply(void) {
    struct rig *rig = set_up(1);
    rig->frames.wire.wait_ns = 3000000;
    fsn_wire_send(&rig->frames.wire);
    CHECK(hold(rig, 0));
    take(rig); /* nobody answers: the time runs out */
    CHECK(rig->input.lost_frames == 1);
    rig->frames.wire.wait_ns = UINT64_C(1000000000000);
    exchange(rig);
    take(rig);
    CHECK(rig->input.lost_frames == 0);
    tear_down(rig);
}

int main(void) {
    inputs_come_in_and_outputs_stay();
    the_missing_keeps_its_bytes();
    old_replies_never_pass(15);
    old_replies_never_pass(16);
    old_replies_never_pass(200);
    a_repeated_reply_counts_once();
    damaged_replies_are_foreign();
    foreign_frames_count_once();
    what_cannot_be_sent_is_counted();
    ring(false, false);
    ring(true, false);
    ring(false, true);
    waiting_ends_with_the_reply();
    return 0;
}
