/** Packets of one interface through AF_XDP: rings in memory that the kernel reads and writes as
 * well.
 *
 *  Each slot of the memory belongs to one entry of the sending ring for ever; the other half of the
 *  slots circulates between the kernel and the receiving ring.
 *
 *  Set up by whoever opens the interface; then only the cyclic thread accesses it. Layout of the
 *  rings: Documentation/networking/af_xdp.rst of Linux. */
#ifndef FSN_RINGS_H
#define FSN_RINGS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "rt/atomics.h"

enum {
    FSN_RINGS_SLOTS = 256,       /**< entries of each ring */
    FSN_RINGS_SLOT_BYTES = 2048, /**< more than the headroom of the kernel and a frame */
};

/** One ring: its writer moves `producer`, its reader `consumer`. */
struct fsn_rings_queue {
    _Atomic uint32_t *producer, *consumer, *flags;
    void *entries;
};

struct fsn_rings {
    int fd;
    bool zero_copy;  /**< the network card reads and writes the slots itself */
    uint8_t *memory; /**< slots to receive, then slots to send */
    struct fsn_rings_queue rx, tx, fill, completion;
    uint32_t sent;  /**< entries ever handed over for sending */
    uint32_t first; /**< entry of the first packet of this cycle */
};

/** Gives the kernel all slots of the receiving half. */
void fsn_rings_fill(struct fsn_rings *rings);

/** Begins a cycle of `count` packets, as many as in each cycle. Packets that the kernel has not
 * taken since the last cycle are replaced, not sent late. With zero copy the card may be reading
 * them: it gets no others until it has sent them.
 *  @return whether there is room; otherwise errno is EBUSY. */
bool fsn_rings_begin(struct fsn_rings *rings, uint32_t count);

/** Writes packet `number` of the cycle, at most FSN_RINGS_SLOT_BYTES. */
void fsn_rings_put(struct fsn_rings *rings, uint32_t number, const uint8_t *packet,
                   uint32_t len_bytes);

/** Sends the packets of the cycle.
 *  @return how many were not sent; errno has the reason. */
uint32_t fsn_rings_send(struct fsn_rings *rings, uint32_t count);

/** Copies one received packet, cut off at `room_bytes`.
 *  @return its length; -1 with errno EAGAIN without one. */
ssize_t fsn_rings_receive(struct fsn_rings *rings, uint8_t *packet, size_t room_bytes);

#endif
