/** Times of the cyclic wire, its ring, and how long it waits. */
#define _GNU_SOURCE

#include <netinet/in.h>
#include <string.h>
#include <sys/socket.h>

#include "heap.h"
#include "wire_rig.h"

/** The time of a reply is that of the kernel, if it gives one. */
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
        CHECK(rig->input.counts.lost_frames == 0);
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
    CHECK(rig->input.counts.lost_frames == 0 && wall.interrupts == 0);
    fsn_wire_send(&rig->frames.wire);
    wall.flood = UINT32_MAX; /* the reply of the cycle before, again and again */
    wall.reads = 0;
    take(rig);
    CHECK(wall.reads == 1024 && rig->input.counts.old_replies == 1024 &&
          rig->input.counts.lost_frames == 1);
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
              (side == 1 ? UINT64_C(0x1111111122222222) : UINT64_C(0x1111111111111111)));
        tear_down(rig);
    }
}

/** Above 32 bits the time is the expected one: from the first reading on, over the end of 32 bits
 * and back, after seconds without a reading, and whatever the clock shows there. */
static void a_clock_of_32_bits_goes_on(void) {
    static const struct {
        uint64_t passed_ns, shown, time;
    } steps[] = {
        {0, 0xFFFFFF00, UINT64_C(0x5FFFFFF00)},
        {0, 0xFFFFFFF0, UINT64_C(0x5FFFFFFF0)},
        {0, 0x10, UINT64_C(0x600000010)},
        {0, UINT64_C(0x9FFFFFFFF), UINT64_C(0x5FFFFFFFF)},
        {UINT64_C(10000000000), 0x540BE400, UINT64_C(0x8540BE400)}, /* and a nanosecond */
    };
    struct rig *rig = set_up(1);
    struct fsn_wire *wire = &rig->frames.wire;
    const uint32_t dc = wire->frames[0].dc;
    wire->dc_every = 1;
    atomic_store(&wire->dc_base, UINT64_C(0x5FFFFF000) - MONOTONIC_NS);
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        wall.monotonic_ns += steps[i].passed_ns;
        rig->queued = 0;
        fsn_wire_send(wire);
        CHECK(hold(rig, 0));
        fsn_put64(rig->queue[0] + dc + 10, steps[i].shown);
        rig->queue[0][dc + 18] = 1;
        answer(rig, 0, 0);
        take(rig);
        CHECK(rig->input.dc_time_ns == steps[i].time &&
              atomic_load(&wire->dc_seen) == steps[i].time);
        CHECK(atomic_load(&wire->dc_base) == steps[i].time - wire->dc_sent_ns);
    }
    tear_down(rig);
}

/** A clock set by this machine gets four bytes of our time, right before it is distributed. */
static void the_time_of_this_machine_goes_out(void) {
    struct rig *rig = set_up(1);
    struct fsn_wire *wire = &rig->frames.wire;
    const struct fsn_plan *plan = rig->plan;
    const int socket = wire->sockets[0];
    fsn_frames_free(&rig->frames);
    CHECK(fsn_frames_create(plan, 0x1001, true, &rig->frames) == FSN_OK);
    wire->sockets[0] = socket;
    wire->dc_every = 2;
    wire->dc_host = true;
    atomic_store(&wire->dc_base, UINT64_C(0x700000000));
    const struct fsn_wire_frame *frame = &wire->frames[0];
    CHECK(frame->dc == frame->dc_set + 16 && frame->len_bytes == frame->dc + 20);
    for (unsigned cycle = 0; cycle < 3; cycle++) {
        rig->queued = 0;
        fsn_wire_send(wire);
        CHECK(hold(rig, 0));
        const uint8_t *set = rig->queue[0] + frame->dc_set;
        const uint8_t *dc = rig->queue[0] + frame->dc;
        CHECK(set[0] == (cycle == 1 ? 0 : 5) && dc[0] == (cycle == 1 ? 0 : 14));
        CHECK(fsn_get16(set + 2) == 0x1001 && fsn_get16(set + 4) == 0x0910);
        CHECK(fsn_get16(set + 6) == (0x8000 | 4) && set[1] == dc[1]);
        CHECK(cycle == 1 || fsn_get64(dc + 10) == wire->dc_sent_ns + UINT64_C(0x700000000));
        CHECK(memcmp(set + 10, dc + 10, 4) == 0);
    }
    rig->queue[0][frame->dc_set + 5] ^= 1; /* another register: not ours */
    answer(rig, 0, 0);
    take(rig);
    CHECK(rig->input.counts.lost_frames == 1);
    tear_down(rig);
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
    CHECK(rig->input.counts.lost_frames == 1 && rig->input.counts.old_replies == 0);
    rig->frames.wire.sockets[1] = second;
    tear_down(rig);
}

static bool came(const struct rig *rig, uint32_t first, uint32_t crossed, uint32_t back,
                 uint32_t second) {
    const struct fsn_wire *wire = &rig->frames.wire;
    return atomic_load(&wire->came[0][0]) == first && atomic_load(&wire->came[0][1]) == crossed &&
           atomic_load(&wire->came[1][0]) == back && atomic_load(&wire->came[1][1]) == second;
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
        CHECK(rig->wkc[0].actual == 6 && rig->input.counts.lost_frames == 0);
        const uint32_t n = i + 1;
        CHECK(atomic_load(&rig->frames.wire.sent) == n);
        const uint32_t second = second_cable_out ? 0 : n;
        CHECK(broken ? came(rig, n, 0, 0, second) : came(rig, 0, n, second, 0));
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
    CHECK(send(rig->far[0], "another sender", 14, 0) == 14);
}

/** Waiting ends with the last reply, or at the timeout, whatever other stations send meanwhile. */
static void waiting_ends_with_the_reply(void) {
    const uint64_t patience_ns = UINT64_C(2500000000);
    struct rig *rig = set_up(1);
    rig->frames.wire.wait_ns = patience_ns;
    wall.while_waiting = nobody_answers;
    fsn_wire_send(&rig->frames.wire);
    CHECK(hold(rig, 0) && rig->frames.wire.sent_ns == MONOTONIC_NS);
    take(rig); /* no answer: the time runs out */
    CHECK(rig->input.counts.lost_frames == 1 && rig->input.round_trip_ns == 0);
    CHECK(wall.waited_ns == patience_ns && wall.monotonic_ns == MONOTONIC_NS + patience_ns);
    CHECK(wall.polled == 1);
    wall.while_waiting = somebody_else_speaks;
    fsn_wire_send(&rig->frames.wire);
    take(rig);
    CHECK(rig->input.counts.lost_frames == 1);
    CHECK(wall.monotonic_ns == MONOTONIC_NS + patience_ns + UINT64_C(2800000000));
    rig->queued = 0;
    CHECK(hold(rig, 0)); /* the packets that were not read */
    wall.while_waiting = both_answer;
    fsn_wire_send(&rig->frames.wire);
    take(rig);
    CHECK(rig->input.counts.lost_frames == 0 && rig->input.round_trip_ns == 1000);
    CHECK(inputs_are(rig, 0xA0, 0xA1));
    /* A reply that is there already is not waited for. */
    wall.while_waiting = nobody_answers;
    const uint64_t now_ns = wall.monotonic_ns;
    exchange(rig);
    wall.waited_ns = 0;
    take(rig);
    CHECK(rig->input.counts.lost_frames == 0 && wall.waited_ns == 0 && wall.monotonic_ns == now_ns);
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
    CHECK(rig->input.counts.lost_frames == 0 && rig->input.round_trip_ns == 1000);
    rig->present[1] = false;
    rig->queued = 0;
    fsn_wire_send(&rig->frames.wire);
    take(rig); /* its other half may still come from the second port */
    CHECK(wall.monotonic_ns >= MONOTONIC_NS + 1000 + 5000 && rig->input.round_trip_ns == 0);
    CHECK(rig->input.counts.lost_frames == 0 && rig->wkc[0].actual == 3);
    /* A frame without an expected counter cannot show that all were visited. */
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
    const long alive = heap_alive();
    replies_tell_their_time();
    reading_goes_on_and_ends();
    the_time_comes_from_the_side_of_the_clock();
    a_clock_of_32_bits_goes_on();
    the_time_of_this_machine_goes_out();
    the_first_port_goes_first();
    ring(false, false);
    ring(true, false);
    ring(false, true);
    waiting_ends_with_the_reply();
    waiting_ends_when_everybody_was_visited();
    CHECK(heap_alive() == alive);
    return 0;
}
