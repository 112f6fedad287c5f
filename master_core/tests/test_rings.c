/** Sending and receiving by AF_XDP against a kernel of the test's own: this program's system calls
 *  replace those of libc. */
#define _GNU_SOURCE

#include "rt/rings.h"

#include <errno.h>
#include <linux/if_xdp.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/socket.h>

#include "builder.h"

enum { FD = 7, FRAME_BYTES = 60, AT_ONCE = 32, HEADROOM = 256, WAKEUP = 1 };

/** Memory of both sides, and what the kernel does with it. */
static struct {
    uint8_t memory[2 * FSN_RINGS_SLOTS][FSN_RINGS_SLOT_BYTES];
    struct {
        _Atomic uint32_t producer, consumer, flags;
    } rx, tx, fill, completion;
    struct xdp_desc rx_entries[FSN_RINGS_SLOTS], tx_entries[FSN_RINGS_SLOTS];
    uint64_t fill_entries[FSN_RINGS_SLOTS], completion_entries[FSN_RINGS_SLOTS];
    int error; /**< the interface is down: the kernel takes nothing more */
    int takes; /**< packets before that */
    int drops; /**< of so many packets: taken, but the driver refuses them */
    int interrupted;
    uint32_t left; /**< packets that were sent */
    uint8_t first[1024], length[1024];
    int wakeups, fill_wakeups;
} os;

static struct fsn_rings rings;

ssize_t send(int fd, const void *bytes, size_t len, int flags) {
    CHECK(fd == FD && bytes == NULL && len == 0 && flags == MSG_DONTWAIT);
    os.wakeups++;
    if ((os.error != 0 && os.takes == 0) || os.interrupted > 0) {
        errno = os.interrupted-- > 0 ? EINTR : os.error;
        return -1;
    }
    for (int i = 0; i < AT_ONCE && os.tx.consumer != os.tx.producer; i++) {
        const struct xdp_desc *at = &os.tx_entries[os.tx.consumer++ % FSN_RINGS_SLOTS];
        CHECK(at->options == 0 && at->addr % FSN_RINGS_SLOT_BYTES == 0);
        os.completion_entries[os.completion.producer % FSN_RINGS_SLOTS] = at->addr;
        os.completion.producer++;
        if (os.takes > 0 && --os.takes == 0 && os.error != 0) {
            os.left++;
            errno = os.error;
            return -1;
        }
        if (os.drops > 0) {
            os.drops--;
            errno = EBUSY;
            return -1;
        }
        os.first[os.left] = os.memory[at->addr / FSN_RINGS_SLOT_BYTES][0];
        os.length[os.left++] = (uint8_t)at->len;
    }
    errno = EAGAIN;
    return os.tx.consumer == os.tx.producer ? 0 : -1;
}

ssize_t recv(int fd, void *bytes, size_t len, int flags) {
    CHECK(fd == FD && bytes == NULL && len == 0 && flags == MSG_DONTWAIT);
    os.fill_wakeups++;
    return 0;
}

static void set_up(bool zero_copy) {
    memset(&os, 0, sizeof os);
    rings = (struct fsn_rings){
        .fd = FD,
        .zero_copy = zero_copy,
        .memory = os.memory[0],
        .rx = {&os.rx.producer, &os.rx.consumer, &os.rx.flags, os.rx_entries},
        .tx = {&os.tx.producer, &os.tx.consumer, &os.tx.flags, os.tx_entries},
        .fill = {&os.fill.producer, &os.fill.consumer, &os.fill.flags, os.fill_entries},
        .completion = {&os.completion.producer, &os.completion.consumer, &os.completion.flags,
                       os.completion_entries}};
    os.tx.flags = WAKEUP;
    fsn_rings_fill(&rings);
}

/** One cycle, whose packets begin with `first`, `first` + 1 ...   @return as fsn_rings_send(). */
static uint32_t cycle(uint32_t count, uint8_t first) {
    uint8_t packet[FRAME_BYTES + 3] = {0};
    if (!fsn_rings_begin(&rings, count)) {
        CHECK(errno == EBUSY);
        return count;
    }
    for (uint32_t n = 0; n < count; n++) {
        packet[0] = (uint8_t)(first + n);
        fsn_rings_put(&rings, n, packet, FRAME_BYTES + n % 4);
    }
    return fsn_rings_send(&rings, count);
}

static void packets_leave_in_order(void) {
    set_up(false);
    CHECK(cycle(3, 10) == 0 && os.left == 3 && os.wakeups == 1);
    for (uint32_t n = 0; n < 3; n++) {
        CHECK(os.first[n] == 10 + n && os.length[n] == FRAME_BYTES + n);
    }
    CHECK(cycle(64, 100) == 0 && os.left == 67 && os.wakeups == 3);
    CHECK(os.first[3] == 100 && os.first[66] == 163);
    for (int i = 0; i < 1000; i++) { /* around the ring */
        os.left = 0;
        CHECK(cycle(5, (uint8_t)i) == 0 && os.left == 5 && os.first[4] == (uint8_t)(i + 4));
    }
    os.interrupted = 2;
    os.left = 0;
    CHECK(cycle(1, 9) == 0 && os.left == 1 && os.first[0] == 9);
}

/** What an interface that is down has not taken leaves later with the newest bytes, once. */
static void nothing_old_leaves_late(void) {
    set_up(false);
    os.error = ENETDOWN;
    for (uint8_t i = 0; i < 100; i++) {
        CHECK(cycle(2, i) == 2 && errno == ENETDOWN);
    }
    os.error = 0;
    CHECK(os.left == 0);
    CHECK(cycle(2, 200) == 0 && os.left == 2 && os.first[0] == 200 && os.first[1] == 201);
}

/** The interface goes down in the middle of a cycle: all of the next one leaves, and only that. */
static void a_cycle_that_has_left_in_part_is_followed_by_a_whole_one(void) {
    set_up(false);
    os.error = ENETDOWN;
    os.takes = 2;
    CHECK(cycle(5, 1) == 3 && errno == ENETDOWN);
    CHECK(cycle(5, 50) == 5);
    os.error = 0;
    os.left = 0;
    CHECK(cycle(5, 100) == 0 && os.left == 5);
    for (uint32_t n = 0; n < 5; n++) {
        CHECK(os.first[n] == 100 + n && os.length[n] == FRAME_BYTES + n % 4);
    }
}

/** A card that reads the slots itself may be in the middle of one. */
static void a_card_keeps_what_it_has(void) {
    set_up(true);
    os.error = ENETDOWN;
    CHECK(cycle(2, 1) == 2 && errno == ENETDOWN);
    CHECK(cycle(2, 3) == 2 && errno == EBUSY && os.left == 0);
    CHECK(os.memory[FSN_RINGS_SLOTS][0] == 1);
    os.error = 0; /* when it is woken again it sends them */
    CHECK(cycle(2, 4) == 2 && errno == EBUSY && os.left == 2 && os.first[0] == 1);
    os.tx.flags = 0; /* and is awake: no system call */
    os.wakeups = 0;
    CHECK(cycle(2, 5) == 0 && os.wakeups == 0 && os.memory[FSN_RINGS_SLOTS + 2][0] == 5);
}

static void packets_that_the_driver_refuses_are_counted(void) {
    set_up(false);
    os.drops = 2;
    CHECK(cycle(4, 1) == 2 && os.left == 2 && os.first[0] == 3);
    os.error = ENOBUFS;
    CHECK(cycle(4, 1) == 4 && errno == ENOBUFS);
}

/** A slot is used again only after the kernel has given it back. */
static void slots_in_use_stay_untouched(void) {
    set_up(true);
    os.tx.flags = 0;
    uint32_t cycles = 0;
    while (cycle(60, 1) == 0) {
        os.tx.consumer = (uint32_t)os.tx.producer; /* the card sends, and completes nothing */
        cycles++;
    }
    CHECK(cycles == FSN_RINGS_SLOTS / 60);
    os.completion.producer += 60;
    CHECK(cycle(60, 1) == 0 && os.completion.consumer == 60);
}

/** The kernel writes a packet after its headroom into the next slot.
 *  @return false without one. */
static bool arrive(uint8_t first, uint32_t len) {
    if (os.fill.consumer == os.fill.producer) {
        return false;
    }
    const uint64_t slot = os.fill_entries[os.fill.consumer++ % FSN_RINGS_SLOTS];
    CHECK(slot < FSN_RINGS_SLOTS * FSN_RINGS_SLOT_BYTES && slot % FSN_RINGS_SLOT_BYTES == 0);
    memset(os.memory[slot / FSN_RINGS_SLOT_BYTES] + HEADROOM, first, len);
    os.rx_entries[os.rx.producer % FSN_RINGS_SLOTS] =
        (struct xdp_desc){.addr = slot + HEADROOM, .len = len};
    os.rx.producer++;
    return true;
}

static void packets_arrive_in_order(void) {
    uint8_t packet[FRAME_BYTES + 1] = {0};
    set_up(false);
    CHECK(fsn_rings_receive(&rings, packet, sizeof packet) == -1 && errno == EAGAIN);
    for (int i = 0; i < 1000; i++) {
        CHECK(arrive((uint8_t)i, FRAME_BYTES) && arrive((uint8_t)(i + 1), FRAME_BYTES - 1));
        CHECK(fsn_rings_receive(&rings, packet, sizeof packet) == FRAME_BYTES);
        CHECK(packet[0] == (uint8_t)i && packet[FRAME_BYTES - 1] == (uint8_t)i);
        CHECK(fsn_rings_receive(&rings, packet, sizeof packet) == FRAME_BYTES - 1);
        CHECK(packet[0] == (uint8_t)(i + 1));
        CHECK(fsn_rings_receive(&rings, packet, sizeof packet) == -1);
    }
    CHECK(os.fill_wakeups == 0);
    os.fill.flags = WAKEUP;
    CHECK(fsn_rings_receive(&rings, packet, sizeof packet) == -1 && errno == EAGAIN);
    CHECK(os.fill_wakeups == 1);
}

static void a_long_packet_is_cut_off(void) {
    uint8_t packet[FRAME_BYTES + 1];
    set_up(false);
    memset(packet, 0xEE, sizeof packet);
    CHECK(arrive(5, 1500));
    CHECK(fsn_rings_receive(&rings, packet, FRAME_BYTES) == FRAME_BYTES);
    CHECK(packet[FRAME_BYTES - 1] == 5 && packet[FRAME_BYTES] == 0xEE);
}

static void every_slot_comes_back_after_a_flood(void) {
    uint8_t packet[FRAME_BYTES];
    set_up(false);
    for (int round = 0; round < 3; round++) {
        uint32_t came = 0;
        while (arrive((uint8_t)came, FRAME_BYTES)) {
            came++;
        }
        CHECK(came == FSN_RINGS_SLOTS);
        for (uint32_t i = 0; i < came; i++) {
            CHECK(fsn_rings_receive(&rings, packet, sizeof packet) == FRAME_BYTES);
            CHECK(packet[0] == (uint8_t)i);
        }
        CHECK(fsn_rings_receive(&rings, packet, sizeof packet) == -1);
    }
}

int main(void) {
    packets_leave_in_order();
    nothing_old_leaves_late();
    a_cycle_that_has_left_in_part_is_followed_by_a_whole_one();
    a_card_keeps_what_it_has();
    packets_that_the_driver_refuses_are_counted();
    slots_in_use_stay_untouched();
    packets_arrive_in_order();
    a_long_packet_is_cut_off();
    every_slot_comes_back_after_a_flood();
    return 0;
}
