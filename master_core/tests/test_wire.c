/** The cyclic wire: freshness, old replies, content of a frame. */
/* shows R3 */
#define _GNU_SOURCE

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "heap.h"
#include "wire_rig.h"

static void inputs_come_in_and_outputs_stay(void) {
    struct rig *rig = set_up(1);
    take(rig); /* before the first frame */
    CHECK(rig->wkc[0].expected == 0 && rig->input.counts.lost_frames == 0);
    memset(rig->frames.bytes, 0x55, 4);
    exchange(rig);
    CHECK(rig->queue[0][FSN_WIRE_DATA] == 0x55);
    take(rig);
    CHECK(inputs_are(rig, 0xA0, 0xA1));
    CHECK(rig->wkc[0].expected == 6 && rig->wkc[0].actual == 6);
    CHECK(rig->input.dc_time_ns == DC_TIME_NS);
    CHECK(rig->frames.bytes[0] == 0x55 && rig->stale[1] == 0 && rig->stale[3] == 0);
    exchange(rig); /* the second cycle carries no DC time */
    take(rig);
    CHECK(rig->input.dc_time_ns == 0 && rig->input.counts.old_replies == 0);
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
    CHECK(rig->input.counts.lost_frames == 1 && rig->stale[1] == 1 && rig->stale[3] == 1);
    CHECK(rig->wkc[0].expected == 6 && rig->wkc[0].actual == 0);
    tear_down(rig);
}

/** The segment stands still for many cycles, then gives everything back at once. SOEM, which
 *  identifies replies by an index modulo 16, accepts each of them as a new one from then on. */
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
        CHECK(rig->input.counts.lost_frames == 1 && inputs_are(rig, 0xA0, 0xA1));
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
    CHECK(rig->input.counts.old_replies == cycles && rig->input.counts.lost_frames == 0);
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
    CHECK(rig->input.counts.old_replies == 1 && inputs_are(rig, 0xB0, 0xB1));
    tear_down(rig);
}

/** Every single bit of the heads changed: the reply is thrown away, the image keeps its bytes. Only
 *  where the reply is of another cycle of ours does it count as old. */
static void damaged_replies_are_foreign(void) {
    struct rig *rig = set_up(1);
    const struct fsn_wire_frame *frame = &rig->frames.wire.frames[0];
    for (uint32_t bit = 8 * 12; bit < 8 * frame->len_bytes; bit++) {
        const uint32_t byte = bit / 8;
        const bool in_lrw = byte >= FSN_WIRE_DATA && byte < FSN_WIRE_DATA + frame->size_bytes + 2;
        const bool in_dc_data = byte >= frame->dc + 10;
        if (in_lrw || in_dc_data) {
            continue; /* data and working counters are the purpose of a reply */
        }
        const uint32_t head = byte >= frame->dc      ? byte - frame->dc
                              : byte >= FSN_WIRE_LRW ? byte - FSN_WIRE_LRW
                                                     : byte - FSN_WIRE_NOP;
        const bool in_mark = byte >= FSN_WIRE_MARK && byte < FSN_WIRE_LRW;
        /* Interrupt word, flag of a circulating frame; working counter of the NOP. */
        const bool is_free = byte >= FSN_WIRE_NOP &&
                             (in_mark ? byte >= FSN_WIRE_MARK + 8
                                      : head == 8 || head == 9 || (head == 7 && bit % 8 == 6));
        const bool is_old = in_mark && byte >= FSN_WIRE_MARK + 4 && byte < FSN_WIRE_MARK + 8;
        memset(rig->frames.bytes, 0, rig->frames.image.bytes);
        fsn_wire_send(&rig->frames.wire);
        rig->queued = 0;
        CHECK(hold(rig, 0));
        visit(rig, 0, rig->queue[0]);
        visit(rig, 1, rig->queue[0]);
        rig->queue[0][byte] ^= (uint8_t)(1u << bit % 8);
        answer(rig, 0, 0);
        take(rig);
        CHECK(rig->input.counts.lost_frames == !is_free && rig->input.counts.old_replies == is_old);
        CHECK(is_free ? inputs_are(rig, 0xA0, 0xA1) : inputs_are(rig, 0, 0));
    }
    for (ssize_t length = 1; length < (ssize_t)frame->len_bytes; length++) {
        fsn_wire_send(&rig->frames.wire);
        rig->queued = 0;
        CHECK(hold(rig, 0));
        rig->length[0] = length;
        answer(rig, 0, 0);
        take(rig);
        CHECK(rig->input.counts.lost_frames == 1 && rig->input.counts.old_replies == 0);
    }
    tear_down(rig);
}

/** Ethernet pads short frames: the bytes after a reply do not count. */
static void padding_is_left_alone(void) {
    struct rig *rig = set_up(1);
    fsn_wire_send(&rig->frames.wire);
    CHECK(hold(rig, 0));
    visit(rig, 0, rig->queue[0]);
    visit(rig, 1, rig->queue[0]);
    rig->length[0] += 7;
    answer(rig, 0, 0);
    take(rig);
    CHECK(rig->input.counts.lost_frames == 0 && inputs_are(rig, 0xA0, 0xA1));
    tear_down(rig);
}

/** Frames of another MainDevice, as seen by the acyclic side, are counted once. */
static void foreign_frames_count_once(void) {
    struct rig *rig = set_up(1);
    exchange(rig);
    take(rig);
    CHECK(rig->input.counts.foreign_frames == 0);
    atomic_fetch_add(&rig->frames.wire.foreign, 3);
    exchange(rig);
    take(rig);
    CHECK(rig->input.counts.foreign_frames == 3);
    exchange(rig);
    take(rig);
    CHECK(rig->input.counts.foreign_frames == 0);
    tear_down(rig);
}

/** Frames that the system refuses to send are counted, with the reason. */
static void what_cannot_be_sent_is_counted(void) {
    struct rig *rig = set_up(1);
    const int wire = rig->frames.wire.sockets[0];
    const int no_socket = open("/dev/null", O_WRONLY | O_CLOEXEC);
    CHECK(no_socket >= 0);
    rig->frames.wire.sockets[0] = no_socket;
    fsn_wire_send(&rig->frames.wire);
    take(rig);
    CHECK(rig->input.counts.unsent_frames == 1 && rig->input.send_errno == ENOTSOCK);
    CHECK(rig->input.counts.lost_frames == 1);
    rig->frames.wire.sockets[0] = wire;
    exchange(rig);
    take(rig);
    CHECK(rig->input.counts.unsent_frames == 0 && rig->input.counts.lost_frames == 0);
    CHECK(rig->input.send_errno == ENOTSOCK); /* the last reason stays */
    close(no_socket);
    tear_down(rig);
}

/** The whole frame as it stands on the wire, and its datagram for the time of the segment. */
static void frames_are_what_the_standard_says(void) {
    static const char expected[] =
        "FFFFFFFFFFFF0246534E000188A4" /* broadcast, from us; EtherCAT */
        "5510"                         /* 85 bytes of datagrams */
        "0080000000000880"             /* NOP, index 0x80, 8 bytes, another one follows */
        "0000785634120100000000"       /* this run, cycle 1 */
        "00"
        "0C80000000002180" /* LRW at address 0, 33 bytes, another one follows */
        "0000";
    struct rig *rig = set_up(1);
    struct fsn_wire *wire = &rig->frames.wire;
    const struct fsn_wire_frame *frame = &wire->frames[0];
    for (uint32_t i = 0; i < rig->frames.image.bytes; i++) {
        rig->frames.bytes[i] = (uint8_t)(i + 1);
    }
    atomic_store(&wire->dc_station, 0xABCD);
    wire->dc_every = 3;
    for (unsigned cycle = 1; cycle <= 7; cycle++) {
        rig->queued = 0;
        fsn_wire_send(wire);
        CHECK(hold(rig, 0) && rig->length[0] == (ssize_t)frame->len_bytes);
        const uint8_t *sent = rig->queue[0];
        CHECK(sent[FSN_WIRE_MARK + 4] == cycle && sent[FSN_WIRE_MARK + 5] == 0);
        CHECK(memcmp(sent + FSN_WIRE_DATA, rig->frames.bytes, 33) == 0);
        static const uint8_t rest[] = {0xCD, 0xAB, 0x10, 0x09, 8, 0, 0, 0};
        const uint8_t *dc = sent + FSN_WIRE_DATA + 35;
        CHECK(dc[0] == (cycle % 3 == 1 ? 14 : 0) && dc[1] == 0x80);
        CHECK(memcmp(dc + 2, rest, sizeof rest) == 0);
        if (cycle == 1) {
            char hex[2 * FSN_WIRE_DATA + 1];
            for (unsigned i = 0; i < FSN_WIRE_DATA; i++) {
                snprintf(hex + 2 * i, 3, "%02X", sent[i]);
            }
            if (strcmp(hex, expected) != 0) {
                fprintf(stderr, "%s\n%s\n", hex, expected);
            }
            CHECK(strcmp(hex, expected) == 0);
        }
    }
    wire->dc_every = 0;
    wire->dc_left = 0;
    for (unsigned cycle = 0; cycle < 3; cycle++) {
        rig->queued = 0;
        fsn_wire_send(wire);
        CHECK(hold(rig, 0) && rig->queue[0][frame->dc] == 0);
    }
    wire->run = 0x9ABCDEF0;
    wire->cycle = UINT32_MAX; /* 0: nothing was sent */
    exchange(rig);
    CHECK(wire->cycle == 1 && memcmp(rig->queue[0] + FSN_WIRE_MARK, "\xF0\xDE\xBC\x9A\1", 5) == 0);
    take(rig);
    CHECK(rig->input.counts.lost_frames == 0);
    wire->cycle = 0x01020303;
    exchange(rig);
    CHECK(memcmp(rig->queue[0] + FSN_WIRE_MARK + 4, "\4\3\2\1", 4) == 0);
    tear_down(rig);
}

/** Two frames: one with both SubDevices' outputs and inputs, one with the rest, and a third one for
 *  the time since none has room left. */
static void frames_without_process_data_count_for_no_datagram(void) {
    enum { HALF = FSN_WIRE_LRW_BYTES / 2 };
    static const struct build_sm sm[2][2] = {{{1, HALF}, {2, HALF}}, {{1, HALF}, {2, HALF}}};
    static const struct build_copy copy[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}};
    const struct build build = {.subdevices = 2, .sm = sm, .copies = copy, .pairs = 1};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct rig *rig = set_up_plan(1, bytes, len);
    struct fsn_wire *wire = &rig->frames.wire;
    CHECK(wire->frame_count == 3 && wire->datagram_count == 2);
    CHECK(wire->frames[0].dc == 0 && wire->frames[1].dc == 0 && wire->frames[2].dc != 0);
    CHECK(wire->frames[0].expected == 3 && wire->frames[1].expected == 3);
    wire->dc_every = 1;
    for (unsigned lost = 0; lost < 4; lost++) {
        rig->queued = 0;
        fsn_wire_send(wire);
        CHECK(hold(rig, 0) && hold(rig, 0) && hold(rig, 0) && !hold(rig, 0));
        for (unsigned f = 0; f < 3; f++) {
            uint8_t *at = rig->queue[f];
            CHECK(at[FSN_WIRE_NOP + 1] == 0x80 + f && at[FSN_WIRE_LRW + 1] == 0x80 + f);
            if (f < 2) {
                memset(at + FSN_WIRE_DATA + HALF, 0xA0 + (int)f, HALF);
                count_up(at + FSN_WIRE_DATA + wire->frames[f].size_bytes, (uint16_t)(2 + f));
            } else {
                CHECK(fsn_get16(at + FSN_WIRE_LRW + 6) == (0x8000 | 1));
                CHECK(at[FSN_WIRE_DATA] == 0); /* nothing of the image */
                memcpy(at + wire->frames[2].dc + 10, "\1\2\3\4\5\6\7\10\1", 9);
            }
            if (f != lost) {
                answer(rig, f, 0);
            }
        }
        take(rig);
        CHECK(rig->input.counts.lost_frames == (lost < 3));
        CHECK(rig->wkc[0].expected == 3 && rig->wkc[1].expected == 3);
        CHECK(rig->wkc[0].actual == (lost == 0 ? 0 : 2));
        CHECK(rig->wkc[1].actual == (lost == 1 ? 0 : 3));
        CHECK(rig->input.dc_time_ns == (lost == 2 ? 0 : UINT64_C(0x1111111104030201)));
        CHECK(rig->stale[1] == 1 && rig->stale[3] == (lost == 1));
        CHECK(rig->frames.bytes[HALF] == (lost == 0 ? 0 : 0xA0));
        CHECK(rig->frames.bytes[4 * HALF - 1] == 0xA1 || lost == 1);
        CHECK(rig->stale[0] == 0 && rig->stale[2] == 0);
    }
    tear_down(rig);
}

/** A sync manager that fits no frame. */
static void sync_managers_fit_their_frames(void) {
    for (uint32_t more = 0; more < 2; more++) {
        const struct build_sm sm[1][2] = {{{1, 8}, {2, FSN_WIRE_LRW_BYTES + more}}};
        const struct build build = {.subdevices = 1, .sm = sm};
        size_t len;
        uint8_t *bytes = build_plan(&build, &len);
        struct fsn_plan *plan;
        struct fsn_frames frames;
        CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
        CHECK(fsn_frames_create(plan, 0, false, &frames) == (more == 0 ? FSN_OK : FSN_E_BUS_IMAGE));
        CHECK(more != 0 || (frames.wire.frame_count == 2 && frames.wire.frames[1].dc == 0));
        fsn_frames_free(&frames);
        fsn_plan_free(plan);
        free(bytes);
    }
}

/** A reply that comes twice while another one is missing is taken once, and is old then. */
static void a_reply_is_taken_once(void) {
    enum { HALF = 600 };
    static const struct build_sm sm[2][2] = {{{1, HALF}, {2, HALF}}, {{1, HALF}, {2, HALF}}};
    static const struct build_copy copy[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}};
    const struct build build = {.subdevices = 2, .sm = sm, .copies = copy, .pairs = 1};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct rig *rig = set_up_plan(1, bytes, len);
    const struct fsn_wire *wire = &rig->frames.wire;
    CHECK(wire->frame_count == 2 && wire->frames[0].dc == 0 && wire->frames[1].dc != 0);
    fsn_wire_send(&rig->frames.wire);
    CHECK(hold(rig, 0) && hold(rig, 0));
    memset(rig->queue[0] + FSN_WIRE_DATA + HALF, 0xA0, HALF);
    answer(rig, 0, 0);
    memset(rig->queue[0] + FSN_WIRE_DATA + HALF, 0xB0, HALF);
    answer(rig, 0, 0);
    answer(rig, 1, 0);
    wall.control[0] = (struct control){SOL_SOCKET, SCM_TIMESTAMPNS, {1700000000, 123456789 + 50}};
    wall.later_ns = 10;
    take(rig);
    CHECK(rig->input.counts.old_replies == 1 && rig->input.counts.lost_frames == 0);
    CHECK(rig->frames.bytes[HALF] == 0xA0);
    CHECK(rig->input.round_trip_ns == 70); /* when the last frame came */
    /* Packets after the last frame are ignored. */
    fsn_wire_send(&rig->frames.wire);
    rig->queued = 0;
    CHECK(hold(rig, 0) && hold(rig, 0));
    answer(rig, 0, 0);
    answer(rig, 0, 0);
    take(rig);
    CHECK(rig->input.counts.old_replies == 1 && rig->input.counts.lost_frames == 1);
    tear_down(rig);
}

int main(void) {
    const long alive = heap_alive();
    inputs_come_in_and_outputs_stay();
    the_missing_keeps_its_bytes();
    old_replies_never_pass(15);
    old_replies_never_pass(16);
    old_replies_never_pass(200);
    a_repeated_reply_counts_once();
    frames_are_what_the_standard_says();
    frames_without_process_data_count_for_no_datagram();
    sync_managers_fit_their_frames();
    a_reply_is_taken_once();
    padding_is_left_alone();
    damaged_replies_are_foreign();
    foreign_frames_count_once();
    what_cannot_be_sent_is_counted();
    CHECK(heap_alive() == alive);
    return 0;
}
