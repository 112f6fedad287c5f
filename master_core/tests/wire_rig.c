#define _GNU_SOURCE

#include "wire_rig.h"

#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

struct wall wall;

int clock_gettime(clockid_t clock, struct timespec *now) {
    CHECK(clock == CLOCK_MONOTONIC || clock == CLOCK_REALTIME);
    const uint64_t ns = clock == CLOCK_MONOTONIC ? wall.monotonic_ns : wall.realtime_ns;
    *now = (struct timespec){.tv_sec = (time_t)(ns / 1000000000u),
                             .tv_nsec = (long)(ns % 1000000000u)};
    return 0;
}

/** Only this clock moves: a packet that is not sent while we wait does not come. */
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

struct rig *set_up_plan(unsigned ports, uint8_t *bytes, size_t len) {
    struct rig *rig = calloc(1, sizeof *rig);
    CHECK(rig != NULL);
    memset(&wall, 0, sizeof wall);
    wall.monotonic_ns = MONOTONIC_NS;
    wall.realtime_ns = REALTIME_NS;
    wall.rig = rig;
    rig->bytes = bytes;
    CHECK(fsn_plan_load(rig->bytes, len, &rig->plan, NULL) == FSN_OK);
    CHECK(fsn_frames_create(rig->plan, 0x1001, false, &rig->frames) == FSN_OK);
    rig->frames.wire.run = 0x12345678;
    rig->frames.wire.dc_every = 2;
    atomic_store(&rig->frames.wire.dc_base, DC_TIME_NS - MONOTONIC_NS);
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

struct rig *set_up(unsigned ports) {
    size_t len;
    uint8_t *bytes = build_estop(&len);
    return set_up_plan(ports, bytes, len);
}

void tear_down(struct rig *rig) {
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

void count_up(uint8_t *at, uint16_t by) {
    const uint16_t value = (uint16_t)(fsn_get16(at) + by);
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

void visit(const struct rig *rig, unsigned n, uint8_t *frame) {
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

bool hold(struct rig *rig, unsigned port) {
    CHECK(rig->queued < MOST);
    uint8_t *at = rig->queue[rig->queued];
    const ssize_t got = recv(rig->far[port], at, LEN, MSG_DONTWAIT);
    if (got <= 0) {
        return false;
    }
    rig->length[rig->queued++] = got;
    return true;
}

void answer(struct rig *rig, unsigned number, unsigned port) {
    CHECK(send(rig->far[port], rig->queue[number], (size_t)rig->length[number], 0) > 0);
}

void exchange(struct rig *rig) {
    fsn_wire_send(&rig->frames.wire);
    rig->queued = 0;
    CHECK(hold(rig, 0) && !hold(rig, 0));
    visit(rig, 0, rig->queue[0]);
    visit(rig, 1, rig->queue[0]);
    answer(rig, 0, 0);
}

void take(struct rig *rig) {
    memset(rig->wkc, 0, sizeof rig->wkc);
    memset(rig->stale, 0, sizeof rig->stale);
    rig->input = (struct fsn_bus_input){.wkc = rig->wkc, .sm_stale = rig->stale};
    fsn_wire_receive(&rig->frames.wire, &rig->input);
}

bool inputs_are(const struct rig *rig, uint8_t first, uint8_t second) {
    uint8_t expected[8];
    memset(expected, first, 8);
    if (memcmp(rig->frames.bytes + rig->frames.image.sm_base[1], expected, 8) != 0) {
        return false;
    }
    memset(expected, second, 8);
    return memcmp(rig->frames.bytes + rig->frames.image.sm_base[3], expected, 8) == 0;
}
