#define _GNU_SOURCE

#include "rt/wire.h"

#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>

#include "rt/bytes.h"
#include "rt/clock.h"

enum {
    /* One cycle reads at most this number of packets per port, so that a flood cannot delay it.
     * This is sufficient to discard the packets of a second without cycles. */
    MOST_PACKETS = 1024,
    CMD_NOP = 0,
    CMD_FPWR = 5,
    CMD_FRMW = 14,
    DATAGRAM_HEAD = 10,
};

/** Counts for other threads; this thread is the only writer. */
static void count_one(_Atomic uint32_t *counter) {
    atomic_store_explicit(counter, atomic_load_explicit(counter, memory_order_relaxed) + 1,
                          memory_order_relaxed);
}

/* -- sending -------------------------------------------------------------------------------- */

/** Writes port and frame number into every datagram, which distinguish replies. */
static void set_index(const struct fsn_wire_frame *frame, uint8_t index) {
    frame->sent[FSN_WIRE_NOP + 1] = index;
    frame->sent[FSN_WIRE_LRW + 1] = index;
    if (frame->dc != 0) {
        frame->sent[frame->dc + 1] = index;
    }
    if (frame->dc_set != 0) {
        frame->sent[frame->dc_set + 1] = index;
    }
}

static uint8_t index_of(uint32_t frame, uint32_t port) {
    return (uint8_t)(FSN_WIRE_FIRST_INDEX + port * FSN_WIRE_FRAMES + frame);
}

/** Fills the DC datagrams of a frame; if no time is due, each is a NOP of the same length. */
static void write_dc(struct fsn_wire *wire, const struct fsn_wire_frame *frame, bool with_dc) {
    const uint16_t station = atomic_load_explicit(&wire->dc_station, memory_order_relaxed);
    uint8_t *datagram = frame->sent + frame->dc;
    datagram[0] = with_dc ? CMD_FRMW : CMD_NOP;
    datagram[2] = (uint8_t)station;
    datagram[3] = (uint8_t)(station >> 8);
    if (with_dc) {
        wire->dc_sent_ns = fsn_clock_ns(CLOCK_MONOTONIC);
        const uint64_t time =
            wire->dc_sent_ns + atomic_load_explicit(&wire->dc_base, memory_order_relaxed);
        fsn_put32(datagram + DATAGRAM_HEAD, (uint32_t)time);
        fsn_put32(datagram + DATAGRAM_HEAD + 4, (uint32_t)(time >> 32));
    }
    if (frame->dc_set != 0) {
        uint8_t *set = frame->sent + frame->dc_set;
        set[0] = with_dc ? CMD_FPWR : CMD_NOP;
        memcpy(set + 2, datagram + 2, 2);
        memcpy(set + DATAGRAM_HEAD, datagram + DATAGRAM_HEAD, 4);
    }
}

/** Sends all frames by a packet socket. A frame that cannot be sent does not return. */
static void send_packets(struct fsn_wire *wire, uint32_t port) {
    for (uint32_t f = 0; f < wire->frame_count; f++) {
        const struct fsn_wire_frame *frame = &wire->frames[f];
        set_index(frame, index_of(f, port));
        /* mutants: nothing sends 0 bytes of a packet */
        if (send(wire->sockets[port], frame->sent, frame->len_bytes, MSG_DONTWAIT) < 0) {
            wire->unsent++;
            wire->send_errno = errno;
        }
    }
}

/** The same by AF_XDP: in one system call. */
static void send_by_rings(struct fsn_wire *wire, uint32_t port) {
    struct fsn_rings *rings = wire->rings[port];
    uint32_t unsent = wire->frame_count;
    if (fsn_rings_begin(rings, wire->frame_count)) {
        for (uint32_t f = 0; f < wire->frame_count; f++) {
            const struct fsn_wire_frame *frame = &wire->frames[f];
            set_index(frame, index_of(f, port));
            fsn_rings_put(rings, f, frame->sent, frame->len_bytes);
        }
        unsent = fsn_rings_send(rings, wire->frame_count);
    }
    if (unsent > 0) {
        wire->unsent += unsent;
        wire->send_errno = errno;
    }
}

void fsn_wire_send(struct fsn_wire *wire) {
    wire->unsent = 0;
    /* 0 marks frames that were never sent. */
    wire->cycle = wire->cycle == UINT32_MAX ? 1 : wire->cycle + 1;
    const bool with_dc = wire->dc_every > 0 && wire->dc_left == 0;
    wire->dc_left = with_dc ? wire->dc_every - 1 : wire->dc_left - (wire->dc_left > 0);
    for (uint32_t f = 0; f < wire->frame_count; f++) {
        struct fsn_wire_frame *frame = &wire->frames[f];
        fsn_put32(frame->sent + FSN_WIRE_MARK, wire->run);
        fsn_put32(frame->sent + FSN_WIRE_MARK + 4, wire->cycle);
        /* The last frame may hold only the clock datagram. */
        if (f < wire->datagram_count) {
            memcpy(frame->sent + FSN_WIRE_DATA, wire->image + frame->image_byte, frame->size_bytes);
        }
        if (frame->dc != 0) {
            write_dc(wire, frame, with_dc);
        }
    }
    count_one(&wire->sent);
    wire->sent_ns = fsn_clock_ns(wire->wait_ns != 0 ? CLOCK_MONOTONIC : CLOCK_REALTIME);
    /* The second port is last: on a closed ring its frames only pass through. */
    for (uint32_t port = 0; port < FSN_WIRE_PORTS && wire->sockets[port] >= 0; port++) {
        for (uint32_t f = 0; f < wire->frame_count; f++) {
            wire->frames[f].back[port] = false;
        }
        if (wire->rings[port] != NULL) {
            send_by_rings(wire, port);
        } else {
            send_packets(wire, port);
        }
    }
}

/* -- receiving ------------------------------------------------------------------------------ */

/** Whether a datagram returned as it was sent: command, index, address and length. The data, the
 *  working counter, the interrupt word and the flag of a circulating frame may differ. */
static bool same_head(const uint8_t *sent, const uint8_t *reply, uint8_t index) {
    return sent[0] == reply[0] && reply[1] == index && memcmp(sent + 2, reply + 2, 4) == 0 &&
           sent[6] == reply[6] && ((sent[7] ^ reply[7]) & 0xBFu) == 0;
}

static bool same_dc(const struct fsn_wire_frame *frame, const uint8_t *reply, uint8_t index) {
    return (frame->dc == 0 || same_head(frame->sent + frame->dc, reply + frame->dc, index)) &&
           (frame->dc_set == 0 ||
            same_head(frame->sent + frame->dc_set, reply + frame->dc_set, index));
}

enum taken { TAKEN, OLD, FOREIGN };

/** Stores a packet that arrived on a port if it is a reply to a frame of this cycle. */
static enum taken take(struct fsn_wire *wire, uint32_t came_in, const uint8_t *packet,
                       uint32_t len_bytes) {
    /* mutants: what is shorter than its frame is foreign below; this keeps to what was read */
    if (len_bytes < FSN_WIRE_DATA + 2 || packet[FSN_WIRE_NOP + 1] < FSN_WIRE_FIRST_INDEX) {
        return FOREIGN;
    }
    const uint8_t index = packet[FSN_WIRE_NOP + 1];
    const uint32_t number = (uint32_t)(index - FSN_WIRE_FIRST_INDEX) % FSN_WIRE_FRAMES;
    const uint32_t port = (uint32_t)(index - FSN_WIRE_FIRST_INDEX) / FSN_WIRE_FRAMES;
    /* The mark of this run: replies to an earlier process, or to another master, are foreign. */
    if (number >= wire->frame_count || wire->sockets[port] < 0 ||
        fsn_get32(packet + FSN_WIRE_MARK) != wire->run) {
        return FOREIGN;
    }
    struct fsn_wire_frame *frame = &wire->frames[number];
    /* Ethernet may have padded a short frame. */
    /* The header of the reply must be that of the sent frame, apart from the working counter. */
    if (len_bytes < frame->len_bytes || memcmp(packet + 12, frame->sent + 12, 4) != 0 ||
        !same_head(frame->sent + FSN_WIRE_NOP, packet + FSN_WIRE_NOP, index) ||
        !same_head(frame->sent + FSN_WIRE_LRW, packet + FSN_WIRE_LRW, index)) {
        return FOREIGN;
    }
    count_one(&wire->came[port][came_in]);
    /* A reply of an earlier cycle contains older inputs than those in use. */
    if (fsn_get32(packet + FSN_WIRE_MARK + 4) != wire->cycle || frame->back[port]) {
        return OLD;
    }
    if (!same_dc(frame, packet, index)) {
        return FOREIGN;
    }
    memcpy(frame->reply[port], packet, frame->len_bytes);
    frame->back[port] = true;
    return TAKEN;
}

/** Time at which the kernel received the packet, CLOCK_REALTIME; 0 without a timestamp. */
static uint64_t arrival_ns(struct msghdr *message) {
    for (struct cmsghdr *c = CMSG_FIRSTHDR(message); c != NULL; c = CMSG_NXTHDR(message, c)) {
        if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SCM_TIMESTAMPNS) {
            struct timespec at;
            memcpy(&at, CMSG_DATA(c), sizeof at);
            return (uint64_t)at.tv_sec * 1000000000u + (uint64_t)at.tv_nsec;
        }
    }
    return 0;
}

/** Reads one packet and its arrival time, which AF_XDP does not tell. A loop that waits for replies
 * checks the timeout with the clock. */
static ssize_t read_packet(const struct fsn_wire *wire, uint32_t port, uint8_t *packet,
                           size_t room_bytes, uint64_t *at_ns) {
    *at_ns = 0;
    if (wire->rings[port] != NULL) {
        return fsn_rings_receive(wire->rings[port], packet, room_bytes);
    }
    if (wire->wait_ns != 0) {
        return recv(wire->sockets[port], packet, room_bytes, MSG_DONTWAIT);
    }
    union {
        struct cmsghdr align;
        uint8_t bytes[64];
    } control;
    struct iovec part = {.iov_base = packet, .iov_len = room_bytes};
    struct msghdr message = {.msg_iov = &part,
                             .msg_iovlen = 1,
                             .msg_control = control.bytes,
                             .msg_controllen = sizeof control.bytes};
    const ssize_t got = recvmsg(wire->sockets[port], &message, MSG_DONTWAIT);
    *at_ns = got > 0 ? arrival_ns(&message) : 0;
    return got;
}

static uint32_t counter_of(const struct fsn_wire_frame *frame) {
    uint32_t sum = 0;
    for (uint32_t port = 0; port < FSN_WIRE_PORTS; port++) {
        if (frame->back[port]) {
            sum += fsn_get16(frame->reply[port] + FSN_WIRE_DATA + frame->size_bytes);
        }
    }
    return sum;
}

/** Whether all replies have arrived: every frame has returned, or has visited every SubDevice. */
static bool complete(const struct fsn_wire *wire) {
    for (uint32_t f = 0; f < wire->frame_count; f++) {
        const struct fsn_wire_frame *frame = &wire->frames[f];
        const bool all = frame->back[0] && (wire->sockets[1] < 0 || frame->back[1]);
        if (!all && (!(frame->back[0] || frame->back[1]) || frame->expected == 0 ||
                     counter_of(frame) < frame->expected)) {
            return false;
        }
    }
    return true;
}

/** Reads the packets of a port until the frames of this cycle have returned: later packets are old
 *  in the next cycle. Returns the arrival time of the last one. */
static uint64_t drain(struct fsn_wire *wire, uint32_t port, struct fsn_bus_input *input) {
    uint64_t last_ns = 0;
    for (int i = 0; i < MOST_PACKETS && !complete(wire); i++) {
        uint8_t packet[FSN_WIRE_MOST + 4];
        uint64_t at_ns;
        const ssize_t got = read_packet(wire, port, packet, sizeof packet, &at_ns);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got <= 0) {
            break;
        }
        const enum taken taken = take(wire, port, packet, (uint32_t)got);
        last_ns = taken == TAKEN ? at_ns : last_ns;
        input->counts.old_replies += taken == OLD;
    }
    return last_ns;
}

static uint64_t drain_all(struct fsn_wire *wire, struct fsn_bus_input *input) {
    const uint64_t first = drain(wire, 0, input);
    const uint64_t second = wire->sockets[1] >= 0 ? drain(wire, 1, input) : 0;
    return first > second ? first : second;
}

/** Waits for packets; false if the time is over. */
static bool wait_until(const struct fsn_wire *wire, uint64_t end_ns) {
    const uint64_t now = fsn_clock_ns(CLOCK_MONOTONIC);
    if (now >= end_ns) {
        return false;
    }
    struct pollfd polled[FSN_WIRE_PORTS] = {{.fd = wire->sockets[0], .events = POLLIN},
                                            {.fd = wire->sockets[1], .events = POLLIN}};
    const struct timespec left = {.tv_sec = (time_t)((end_ns - now) / 1000000000u),
                                  .tv_nsec = (long)((end_ns - now) % 1000000000u)};
    const nfds_t ports = wire->sockets[1] >= 0 ? 2 : 1;
    return ppoll(polled, ports, &left, NULL) > 0; /* mutants: at the end the clock shows the same */
}

/** Returns the arrival time of the last reply, on the clock of `sent_ns`; 0 if unknown. */
static uint64_t collect(struct fsn_wire *wire, struct fsn_bus_input *input) {
    const uint64_t last_ns = drain_all(wire, input);
    if (wire->wait_ns == 0) {
        return last_ns;
    }
    const uint64_t end_ns = wire->sent_ns + wire->wait_ns;
    while (!complete(wire) && wait_until(wire, end_ns)) {
        drain_all(wire, input);
    }
    return complete(wire) ? fsn_clock_ns(CLOCK_MONOTONIC) : 0;
}

/** Copies one input into the image: from the reply in which it differs from the sent bytes, because
 *  that reply has visited its SubDevice. If neither differs, there is nothing to copy. */
static void move_input(struct fsn_wire *wire, const struct fsn_wire_frame *frame,
                       const struct fsn_wire_input *in) {
    for (uint32_t port = 0; port < FSN_WIRE_PORTS; port++) {
        const uint8_t *reply = frame->reply[port] + in->frame_byte;
        if (frame->back[port] && memcmp(reply, frame->sent + in->frame_byte, in->size_bytes) != 0) {
            memcpy(wire->image + in->image_byte, reply, in->size_bytes);
            return;
        }
    }
}

/** One time base is used from the start on, whichever clock is the reference and whatever its upper
 *  32 bits are: SYNC0 was started on multiples of the cycle in it. */
static void keep_dc(struct fsn_wire *wire, uint64_t shown, struct fsn_bus_input *input) {
    const uint64_t base = atomic_load_explicit(&wire->dc_base, memory_order_relaxed);
    const uint64_t time = fsn_clock_nearest(wire->dc_sent_ns + base, shown);
    if (!wire->dc_host) {
        atomic_store_explicit(&wire->dc_base, time - wire->dc_sent_ns, memory_order_relaxed);
    }
    input->dc_time_ns = time;
    atomic_store_explicit(&wire->dc_seen, time, memory_order_relaxed);
}

static void read_dc(struct fsn_wire *wire, const struct fsn_wire_frame *frame,
                    struct fsn_bus_input *input) {
    if (frame->dc == 0 || frame->sent[frame->dc] != CMD_FRMW) {
        return;
    }
    for (uint32_t port = 0; port < FSN_WIRE_PORTS; port++) {
        const uint8_t *at = frame->reply[port] + frame->dc + DATAGRAM_HEAD;
        if (frame->back[port] && fsn_get16(at + 8) > 0) {
            keep_dc(wire, fsn_get32(at) | ((uint64_t)fsn_get32(at + 4) << 32), input);
            return;
        }
    }
}

/** Expected working counter of a frame that has returned. An arriving group answers as soon as its
 *  sync managers are set up, and a leaving group has gone before the acyclic side detects it. */
static uint32_t expected_of(struct fsn_wire *wire, uint32_t number, uint32_t counter) {
    const uint32_t most = wire->frames[number].expected;
    uint32_t least = most;
    for (uint32_t g = 0; g < wire->group_count; g++) {
        struct fsn_wire_group *group = &wire->groups[g];
        if (atomic_load_explicit(&group->there, memory_order_relaxed) != FSN_WIRE_THERE) {
            least -= group->wkc[number];
        }
    }
    for (uint32_t g = 0; g < wire->group_count; g++) {
        struct fsn_wire_group *group = &wire->groups[g];
        const uint32_t own = group->wkc[number];
        if (own == 0 ||
            atomic_load_explicit(&group->there, memory_order_relaxed) != FSN_WIRE_THERE) {
            continue;
        }
        group->missed = counter + own == least ? group->missed + 1 : 0;
        if (group->missed > 0 && group->missed <= wire->group_patience) {
            return counter;
        }
    }
    return counter >= least && counter <= most ? counter : least;
}

static void judge(struct fsn_wire *wire, uint32_t number, struct fsn_bus_input *input) {
    struct fsn_wire_frame *frame = &wire->frames[number];
    const bool back = frame->back[0] || frame->back[1];
    const uint32_t counter = counter_of(frame);
    input->counts.lost_frames += !back;
    if (number < wire->datagram_count) {
        input->wkc[number].expected =
            wire->group_count == 0 || !back ? frame->expected : expected_of(wire, number, counter);
        input->wkc[number].actual = counter;
    }
    for (uint32_t i = frame->first_input; i < frame->first_input + frame->input_count; i++) {
        const struct fsn_wire_input *in = &wire->inputs[i];
        move_input(wire, frame, in);
        if (in->group != FSN_NONE &&
            atomic_load_explicit(&wire->groups[in->group].there, memory_order_relaxed) ==
                FSN_WIRE_ABSENT) {
            continue; /* reported as absent */
        }
        /* No answer: all inputs are old. A missing answer: the acyclic side identifies the
         * SubDevice. */
        input->sm_stale[in->sm] =
            counter == 0 ||
            (counter < frame->expected &&
             atomic_load_explicit(&wire->answers[in->subdevice], memory_order_relaxed) == 0);
    }
    read_dc(wire, frame, input);
}

void fsn_wire_receive(struct fsn_wire *wire, struct fsn_bus_input *input) {
    if (wire->cycle == 0) {
        return; /* nothing has been sent yet */
    }
    const uint64_t foreign = atomic_load_explicit(&wire->foreign, memory_order_relaxed);
    input->counts.foreign_frames = foreign - wire->foreign_reported;
    wire->foreign_reported = foreign;
    input->counts.unsent_frames = wire->unsent;
    input->send_errno = wire->send_errno;
    const uint64_t last_ns = collect(wire, input);
    if (last_ns > wire->sent_ns) {
        input->round_trip_ns = last_ns - wire->sent_ns;
    }
    for (uint32_t f = 0; f < wire->frame_count; f++) {
        judge(wire, f, input);
    }
}
