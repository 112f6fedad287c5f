/** The cyclic wire against a segment of our own making: freshness, old replies, the ring. */
#define _GNU_SOURCE

#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "builder.h"
#include "live/frames.h"

enum { MOST = 300, LEN = 1600 };

/* -- this program's clock, poll and recvmsg take the place of libc's -------------------------- */

#define REALTIME_NS UINT64_C(1700000000123456789)
#define MONOTONIC_NS UINT64_C(86400987654321)

struct rig;

/** A piece of control data beside a packet. */
struct control {
    int level, type;
    struct timespec at;
};

static struct {
    uint64_t monotonic_ns, realtime_ns;
    struct control control[3]; /**< beside the next packets, as far as there is a type */
    uint64_t later_ns;         /**< the stamp of each packet is so much later than the last one */
    unsigned interrupts;       /**< so many times a read is interrupted */
    unsigned flood;            /**< so many reads get the last packet once more */
    unsigned reads;
    void (*while_waiting)(struct rig *rig); /**< what happens while ppoll() waits */
    struct rig *rig;
    uint64_t waited_ns; /**< longest time that ppoll() was to wait */
    nfds_t polled;
} wall;

int clock_gettime(clockid_t clock, struct timespec *now) {
    CHECK(clock == CLOCK_MONOTONIC || clock == CLOCK_REALTIME);
    const uint64_t ns = clock == CLOCK_MONOTONIC ? wall.monotonic_ns : wall.realtime_ns;
    *now = (struct timespec){.tv_sec = (time_t)(ns / 1000000000u),
                             .tv_nsec = (long)(ns % 1000000000u)};
    return 0;
}

/** Nothing moves but this clock: what nobody sends while we wait does not come. */
int ppoll(struct pollfd *polled, nfds_t count, const struct timespec *left,
          const sigset_t *blocked) {
    CHECK(blocked == NULL && left->tv_nsec >= 0 && left->tv_nsec < 1000000000);
    const uint64_t left_ns = (uint64_t)left->tv_sec * 1000000000u + (uint64_t)left->tv_nsec;
    wall.waited_ns = left_ns > wall.waited_ns ? left_ns : wall.waited_ns;
    wall.polled = count;
    if (wall.while_waiting != NULL) {
        wall.while_waiting(wall.rig);
    }
    const int ready = poll(polled, count, 0);
    CHECK(ready >= 0);
    wall.monotonic_ns += ready > 0 ? 0 : left_ns;
    return ready;
}

ssize_t recvmsg(int fd, struct msghdr *message, int flags) {
    static uint8_t last[LEN];
    static ssize_t last_bytes;
    CHECK(flags == MSG_DONTWAIT && message->msg_iovlen == 1);
    struct iovec *part = message->msg_iov;
    wall.reads++;
    if (wall.interrupts > 0) {
        wall.interrupts--;
        errno = EINTR;
        return -1;
    }
    if (wall.flood > 0) {
        wall.flood--;
        memcpy(part->iov_base, last, (size_t)last_bytes);
        message->msg_controllen = 0;
        return last_bytes;
    }
    const ssize_t got = recv(fd, part->iov_base, part->iov_len, flags);
    if (got > 0) {
        memcpy(last, part->iov_base, (size_t)got);
        last_bytes = got;
    }
    size_t used = 0;
    struct cmsghdr *at = CMSG_FIRSTHDR(message);
    for (unsigned i = 0; i < 3 && wall.control[i].type != 0; i++) {
        CHECK(at != NULL && used + CMSG_SPACE(sizeof(struct timespec)) <= message->msg_controllen);
        at->cmsg_level = wall.control[i].level;
        at->cmsg_type = wall.control[i].type;
        at->cmsg_len = CMSG_LEN(sizeof(struct timespec));
        memcpy(CMSG_DATA(at), &wall.control[i].at, sizeof(struct timespec));
        wall.control[i].at.tv_nsec += got > 0 ? (long)wall.later_ns : 0;
        used += CMSG_SPACE(sizeof(struct timespec));
        at = (struct cmsghdr *)((uint8_t *)at + CMSG_SPACE(sizeof(struct timespec)));
    }
    message->msg_controllen = used;
    return got;
}

/* -- the segment ------------------------------------------------------------------------------ */

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

static struct rig *set_up_plan(unsigned ports, uint8_t *bytes, size_t len) {
    struct rig *rig = calloc(1, sizeof *rig);
    CHECK(rig != NULL);
    memset(&wall, 0, sizeof wall);
    wall.monotonic_ns = MONOTONIC_NS;
    wall.realtime_ns = REALTIME_NS;
    wall.rig = rig;
    rig->bytes = bytes;
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

static struct rig *set_up(unsigned ports) {
    size_t len;
    uint8_t *bytes = build_estop(&len);
    return set_up_plan(ports, bytes, len);
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
            continue; /* data and working counters are what a reply is for */
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
        CHECK(rig->input.lost_frames == !is_free && rig->input.old_replies == is_old);
        CHECK(is_free ? inputs_are(rig, 0xA0, 0xA1) : inputs_are(rig, 0, 0));
    }
    for (ssize_t length = 1; length < frame->len_bytes; length++) {
        fsn_wire_send(&rig->frames.wire);
        rig->queued = 0;
        CHECK(hold(rig, 0));
        rig->length[0] = length;
        answer(rig, 0, 0);
        take(rig);
        CHECK(rig->input.lost_frames == 1 && rig->input.old_replies == 0);
    }
    tear_down(rig);
}

/** Ethernet pads short frames: what is behind a reply does not count. */
static void padding_is_left_alone(void) {
    struct rig *rig = set_up(1);
    fsn_wire_send(&rig->frames.wire);
    CHECK(hold(rig, 0));
    visit(rig, 0, rig->queue[0]);
    visit(rig, 1, rig->queue[0]);
    rig->length[0] += 7;
    answer(rig, 0, 0);
    take(rig);
    CHECK(rig->input.lost_frames == 0 && inputs_are(rig, 0xA0, 0xA1));
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
    CHECK(rig->input.send_errno == ENOTSOCK); /* the last reason stays */
    close(no_socket);
    tear_down(rig);
}

/** The whole frame as it stands on the wire, and its datagram for the time of the segment. */
static void frames_are_what_the_standard_says(void) {
    static const char expected[] =
        "FFFFFFFFFFFF0246534E000188A4" /* everybody, from us; EtherCAT */
        "5510"                         /* 85 bytes of datagrams */
        "0080000000000880"             /* NOP, index 0x80, 8 bytes, one more behind it */
        "0000785634120100000000"       /* this run, cycle 1 */
        "00"
        "0C80000000002180" /* LRW at address 0, 33 bytes, one more behind it */
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
    wire->cycle = UINT32_MAX; /* 0 says that nothing was sent */
    exchange(rig);
    CHECK(wire->cycle == 1 && memcmp(rig->queue[0] + FSN_WIRE_MARK, "\xF0\xDE\xBC\x9A\1", 5) == 0);
    take(rig);
    CHECK(rig->input.lost_frames == 0);
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
        CHECK(rig->input.lost_frames == (lost < 3));
        CHECK(rig->wkc[0].expected == 3 && rig->wkc[1].expected == 3);
        CHECK(rig->wkc[0].actual == (lost == 0 ? 0 : 2));
        CHECK(rig->wkc[1].actual == (lost == 1 ? 0 : 3));
        CHECK(rig->input.dc_time_ns == (lost == 2 ? 0 : UINT64_C(0x0807060504030201)));
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
        CHECK(fsn_frames_create(plan, 0, &frames) == (more == 0 ? FSN_OK : FSN_E_BUS_IMAGE));
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
    CHECK(rig->input.old_replies == 1 && rig->input.lost_frames == 0);
    CHECK(rig->frames.bytes[HALF] == 0xA0);
    CHECK(rig->input.round_trip_ns == 70); /* when the last frame came */
    /* What comes behind the last frame is of no interest. */
    fsn_wire_send(&rig->frames.wire);
    rig->queued = 0;
    CHECK(hold(rig, 0) && hold(rig, 0));
    answer(rig, 0, 0);
    answer(rig, 0, 0);
    take(rig);
    CHECK(rig->input.old_replies == 1 && rig->input.lost_frames == 1);
    tear_down(rig);
}

/** The time of a reply is what the kernel says it is, where it says so. */
static void replies_tell_their_time(void) {
    static const struct timespec later = {1700000000, 123456789 + 1234};
    static const struct timespec much_later = {1700000002, 123456789 + 5};
    static const struct timespec same = {1700000000, 123456789};
    static const struct timespec before = {1699999999, 999999999};
    const struct {
        struct control control[3];
        uint64_t round_trip_ns;
    } table[] = {
        {{{SOL_SOCKET, SCM_TIMESTAMPNS, later}}, 1234},
        {{{SOL_SOCKET, SCM_TIMESTAMPNS, much_later}}, 2000000005},
        {{{SOL_SOCKET, SCM_CREDENTIALS, much_later}, {SOL_SOCKET, SCM_TIMESTAMPNS, later}}, 1234},
        {{{IPPROTO_IP, SCM_TIMESTAMPNS, much_later}, {SOL_SOCKET, SCM_TIMESTAMPNS, later}}, 1234},
        {{{IPPROTO_IP, SCM_TIMESTAMPNS, later}}, 0},
        {{{SOL_SOCKET, SCM_CREDENTIALS, later}}, 0},
        {{{SOL_SOCKET, SCM_TIMESTAMPNS, same}}, 0},
        {{{SOL_SOCKET, SCM_TIMESTAMPNS, before}}, 0},
        {{{0}}, 0},
    };
    struct rig *rig = set_up(1);
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        memcpy(wall.control, table[i].control, sizeof wall.control);
        exchange(rig);
        CHECK(rig->frames.wire.sent_ns == REALTIME_NS);
        take(rig);
        CHECK(rig->input.lost_frames == 0);
        CHECK(rig->input.round_trip_ns == table[i].round_trip_ns);
    }
    tear_down(rig);
}

/** An interrupted read is tried again; a flood does not hold the cycle up. */
static void reading_goes_on_and_ends(void) {
    struct rig *rig = set_up(1);
    exchange(rig);
    wall.interrupts = 3;
    take(rig);
    CHECK(rig->input.lost_frames == 0 && wall.interrupts == 0);
    fsn_wire_send(&rig->frames.wire);
    wall.flood = UINT32_MAX; /* the reply of the cycle before, again and again */
    wall.reads = 0;
    take(rig);
    CHECK(wall.reads == 1024 && rig->input.old_replies == 1024 && rig->input.lost_frames == 1);
    wall.flood = 0;
    take(rig);
    tear_down(rig);
}

/** The clock is read of the first reference that answered; on a broken ring of either side. */
static void the_time_comes_from_the_side_of_the_clock(void) {
    for (unsigned side = 0; side < 3; side++) {
        struct rig *rig = set_up(2);
        rig->frames.wire.dc_every = 1;
        const uint32_t dc = rig->frames.wire.frames[0].dc;
        fsn_wire_send(&rig->frames.wire);
        CHECK(hold(rig, 0) && hold(rig, 1));
        for (unsigned port = 0; port < 2; port++) {
            CHECK(rig->queue[port][FSN_WIRE_NOP + 1] == 0x80 + 0x40 * port);
            CHECK(rig->queue[port][FSN_WIRE_LRW + 1] == 0x80 + 0x40 * port);
            CHECK(rig->queue[port][dc + 1] == 0x80 + 0x40 * port);
            memset(rig->queue[port] + dc + 10, 0x11 * (int)(port + 1), 8);
            count_up(rig->queue[port] + dc + 18, side == 2 || side == port);
            if (side != port) {
                visit(rig, 0, rig->queue[port]); /* changes time and counter when it is the clock */
                memset(rig->queue[port] + dc + 10, 0x11 * (int)(port + 1), 8);
                rig->queue[port][dc + 18] = side == 2;
            }
            answer(rig, port, port);
        }
        take(rig);
        CHECK(rig->input.dc_time_ns ==
              (side == 1 ? UINT64_C(0x2222222222222222) : UINT64_C(0x1111111111111111)));
        tear_down(rig);
    }
}

/** Both replies have inputs that are new: those of the first port count. */
static void the_first_port_goes_first(void) {
    struct rig *rig = set_up(2);
    fsn_wire_send(&rig->frames.wire);
    CHECK(hold(rig, 0) && hold(rig, 1));
    visit(rig, 0, rig->queue[0]);
    rig->fill = 0xB0;
    visit(rig, 0, rig->queue[1]);
    answer(rig, 1, 1);
    answer(rig, 0, 0);
    wall.control[0] = (struct control){SOL_SOCKET, SCM_TIMESTAMPNS, {1700000000, 123456789 + 50}};
    wall.later_ns = 10; /* the first port is read first */
    take(rig);
    CHECK(inputs_are(rig, 0xA0, 0) && rig->wkc[0].actual == 6);
    CHECK(rig->input.round_trip_ns == 60);
    /* Without the second socket nothing is its reply. */
    fsn_wire_send(&rig->frames.wire);
    rig->queued = 0;
    CHECK(hold(rig, 0) && hold(rig, 1));
    const int second = rig->frames.wire.sockets[1];
    rig->frames.wire.sockets[1] = -1;
    answer(rig, 1, 0);
    take(rig);
    CHECK(rig->input.lost_frames == 1 && rig->input.old_replies == 0);
    rig->frames.wire.sockets[1] = second;
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

static void nobody_answers(struct rig *rig) {
    (void)rig;
}

static void both_answer(struct rig *rig) {
    wall.monotonic_ns += 1000;
    rig->queued = 0;
    CHECK(hold(rig, 0));
    visit(rig, 0, rig->queue[0]);
    visit(rig, 1, rig->queue[0]);
    answer(rig, 0, 0);
}

static void somebody_else_speaks(struct rig *rig) {
    wall.monotonic_ns += UINT64_C(700000000);
    CHECK(send(rig->far[0], "somebody else", 13, 0) == 13);
}

/** Waiting ends with the last reply, or when the time is over, whoever else speaks meanwhile. */
static void waiting_ends_with_the_reply(void) {
    const uint64_t patience_ns = UINT64_C(2500000000);
    struct rig *rig = set_up(1);
    rig->frames.wire.wait_ns = patience_ns;
    wall.while_waiting = nobody_answers;
    fsn_wire_send(&rig->frames.wire);
    CHECK(hold(rig, 0) && rig->frames.wire.sent_ns == MONOTONIC_NS);
    take(rig); /* nobody answers: the time runs out */
    CHECK(rig->input.lost_frames == 1 && rig->input.round_trip_ns == 0);
    CHECK(wall.waited_ns == patience_ns && wall.monotonic_ns == MONOTONIC_NS + patience_ns);
    CHECK(wall.polled == 1);
    wall.while_waiting = somebody_else_speaks;
    fsn_wire_send(&rig->frames.wire);
    take(rig);
    CHECK(rig->input.lost_frames == 1);
    CHECK(wall.monotonic_ns == MONOTONIC_NS + patience_ns + UINT64_C(2800000000));
    rig->queued = 0;
    CHECK(hold(rig, 0)); /* what nobody took */
    wall.while_waiting = both_answer;
    fsn_wire_send(&rig->frames.wire);
    take(rig);
    CHECK(rig->input.lost_frames == 0 && rig->input.round_trip_ns == 1000);
    CHECK(inputs_are(rig, 0xA0, 0xA1));
    /* A reply that is there already is not waited for. */
    wall.while_waiting = nobody_answers;
    const uint64_t now_ns = wall.monotonic_ns;
    exchange(rig);
    wall.waited_ns = 0;
    take(rig);
    CHECK(rig->input.lost_frames == 0 && wall.waited_ns == 0 && wall.monotonic_ns == now_ns);
    tear_down(rig);
}

static void only_the_far_side_answers(struct rig *rig) {
    wall.monotonic_ns += 1000;
    if (rig->queued == 0) {
        CHECK(hold(rig, 0) && hold(rig, 1));
        visit(rig, 0, rig->queue[0]);
        visit(rig, 1, rig->queue[0]);
        answer(rig, 0, 1);
    }
}

/** On a ring a frame that has visited everybody is enough, on whichever port it comes back; one
 *  that has not is waited for. */
static void waiting_ends_when_everybody_was_visited(void) {
    struct rig *rig = set_up(2);
    rig->frames.wire.wait_ns = 5000;
    wall.while_waiting = only_the_far_side_answers;
    fsn_wire_send(&rig->frames.wire);
    take(rig);
    CHECK(wall.polled == 2 && wall.monotonic_ns == MONOTONIC_NS + 1000);
    CHECK(rig->input.lost_frames == 0 && rig->input.round_trip_ns == 1000);
    rig->present[1] = false;
    rig->queued = 0;
    fsn_wire_send(&rig->frames.wire);
    take(rig); /* its other half may still come from the second port */
    CHECK(wall.monotonic_ns >= MONOTONIC_NS + 1000 + 5000 && rig->input.round_trip_ns == 0);
    CHECK(rig->input.lost_frames == 0 && rig->wkc[0].actual == 3);
    /* Who expects nobody cannot tell that all were visited. */
    rig->present[1] = true;
    rig->frames.wire.frames[0].expected = 0;
    rig->queued = 0;
    const uint64_t now_ns = wall.monotonic_ns;
    fsn_wire_send(&rig->frames.wire);
    take(rig);
    CHECK(wall.monotonic_ns >= now_ns + 5000 && rig->input.round_trip_ns == 0);
    tear_down(rig);
}

int main(void) {
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
    replies_tell_their_time();
    reading_goes_on_and_ends();
    the_time_comes_from_the_side_of_the_clock();
    the_first_port_goes_first();
    padding_is_left_alone();
    damaged_replies_are_foreign();
    foreign_frames_count_once();
    what_cannot_be_sent_is_counted();
    ring(false, false);
    ring(true, false);
    ring(false, true);
    waiting_ends_with_the_reply();
    waiting_ends_when_everybody_was_visited();
    return 0;
}
