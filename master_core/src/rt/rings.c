#define _GNU_SOURCE

#include "rt/rings.h"

#include <errno.h>
#include <linux/if_xdp.h>
#include <string.h>
#include <sys/socket.h>

enum {
    LAST_SLOT = FSN_RINGS_SLOTS - 1, /* the slots are a power of two */
    NEED_WAKEUP = 1,                 /* XDP_RING_NEED_WAKEUP, which older headers lack */
    MOST_TRIES = 8,                  /* the kernel takes 32 packets at once */
};

_Static_assert((FSN_RINGS_SLOTS & LAST_SLOT) == 0, "positions in a ring are masked");

static uint32_t seen(_Atomic uint32_t *counter) {
    return atomic_load_explicit(counter, memory_order_acquire);
}

static void show(_Atomic uint32_t *counter, uint32_t value) {
    atomic_store_explicit(counter, value, memory_order_release);
}

static bool needs_wakeup(const struct fsn_rings_queue *ring) {
    return (atomic_load_explicit(ring->flags, memory_order_relaxed) & NEED_WAKEUP) != 0;
}

void fsn_rings_fill(struct fsn_rings *rings) {
    uint64_t *slot = rings->fill.entries;
    for (uint32_t i = 0; i < FSN_RINGS_SLOTS; i++) {
        slot[i] = (uint64_t)i * FSN_RINGS_SLOT_BYTES;
    }
    show(rings->fill.producer, FSN_RINGS_SLOTS);
}

/* -- sending -------------------------------------------------------------------------------- */

bool fsn_rings_begin(struct fsn_rings *rings, uint32_t count) {
    const uint32_t waiting = rings->sent - seen(rings->tx.consumer);
    const uint32_t completed = seen(rings->completion.producer);
    show(rings->completion.consumer, completed);
    errno = EBUSY;
    if (rings->zero_copy && waiting > 0) {
        if (needs_wakeup(&rings->tx)) {
            (void)send(rings->fd, NULL, 0, MSG_DONTWAIT);
            errno = EBUSY;
        }
        return false;
    }
    /* Without zero copy the kernel reads slots only while this thread is in a system call. */
    rings->first = rings->sent - waiting;
    return rings->first + count - completed <= FSN_RINGS_SLOTS;
}

void fsn_rings_put(struct fsn_rings *rings, uint32_t number, const uint8_t *packet,
                   uint32_t len_bytes) {
    const uint32_t slot = (rings->first + number) & LAST_SLOT;
    const uint64_t at = (uint64_t)(FSN_RINGS_SLOTS + slot) * FSN_RINGS_SLOT_BYTES;
    memcpy(rings->memory + at, packet, len_bytes);
    ((struct xdp_desc *)rings->tx.entries)[slot] = (struct xdp_desc){.addr = at, .len = len_bytes};
}

uint32_t fsn_rings_send(struct fsn_rings *rings, uint32_t count) {
    rings->sent = rings->first + count;
    show(rings->tx.producer, rings->sent);
    uint32_t dropped = 0;
    int error = 0;
    for (int i = 0; i < MOST_TRIES && error == 0 && needs_wakeup(&rings->tx); i++) {
        if (send(rings->fd, NULL, 0, MSG_DONTWAIT) >= 0) {
            break;
        }
        /* Of EBUSY the driver refused one, which is taken from the ring; the others are not yet. */
        dropped += errno == EBUSY;
        if (errno != EBUSY && errno != EAGAIN && errno != EINTR) {
            error = errno;
        }
    }
    /* A card takes them from the ring itself, when it is their turn. */
    const uint32_t waiting = rings->zero_copy ? 0 : rings->sent - seen(rings->tx.consumer);
    errno = error != 0 ? error : EBUSY;
    return rings->zero_copy && error != 0 ? count : dropped + waiting;
}

/* -- receiving ------------------------------------------------------------------------------ */

ssize_t fsn_rings_receive(struct fsn_rings *rings, uint8_t *packet, size_t room_bytes) {
    const uint32_t next = atomic_load_explicit(rings->rx.consumer, memory_order_relaxed);
    if (seen(rings->rx.producer) == next) {
        if (needs_wakeup(&rings->fill)) {
            (void)recv(rings->fd, NULL, 0, MSG_DONTWAIT);
        }
        errno = EAGAIN;
        return -1;
    }
    const struct xdp_desc *came = &((struct xdp_desc *)rings->rx.entries)[next & LAST_SLOT];
    const size_t len = came->len < room_bytes ? came->len : room_bytes;
    memcpy(packet, rings->memory + came->addr, len);
    const uint32_t given = atomic_load_explicit(rings->fill.producer, memory_order_relaxed);
    const uint64_t slot = came->addr & ~(uint64_t)(FSN_RINGS_SLOT_BYTES - 1);
    ((uint64_t *)rings->fill.entries)[given & LAST_SLOT] = slot;
    show(rings->rx.consumer, next + 1);
    show(rings->fill.producer, given + 1);
    return (ssize_t)len;
}
