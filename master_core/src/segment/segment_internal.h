/** The segment: SubDevices in ring order, and the link that feeds them. */
#ifndef FSN_SEGMENT_INTERNAL_H
#define FSN_SEGMENT_INTERNAL_H

#include <pthread.h>
#include <stdatomic.h>

#include "fsn/segment.h"
#include "plan/plan_internal.h"
#include "segment/esc.h"

/** Position of a sync manager of the plan. */
struct place {
    uint32_t position; /**< FSN_NONE: no position */
    uint8_t sm;
};

enum { WIRE_FRAMES = 1024, WIRE_BYTES = 1536 };

/** A frame on its way in. */
struct held {
    uint64_t due_ns;
    uint32_t port;
    uint16_t size_bytes;
    uint8_t bytes[WIRE_BYTES];
};

/** Frames between MainDevice and segment, in order. */
struct wire {
    struct held held[WIRE_FRAMES];
    uint32_t first, count;
    uint64_t delay_ns;
    uint64_t stall_ns; /**< requested; begins when time is known */
    uint64_t stalled_until_ns;
    uint32_t repeat; /**< answers after which the old one is repeated */
    bool again;      /**< now */
    uint32_t old_port;
    size_t old_bytes;
    uint8_t old[WIRE_BYTES];
};

struct fsn_segment {
    struct fsn_plan *plan;
    struct esc *escs; /**< by position as planned */
    bool *present;    /**< by planned position */
    bool *optional;   /**< likewise: of a group; if absent, frames pass its place */
    uint32_t *order;  /**< place on the ring to position; equal unless devices were swapped */
    bool *cut;        /**< cable before a place; one more after the last */
    uint32_t count;
    bool ring;            /**< the last SubDevice is cabled to the second port of the MainDevice */
    bool unplugged[2];    /**< per port of the MainDevice: its interface has no carrier */
    uint32_t from_first;  /**< places that a frame at the first port reaches */
    uint32_t from_last;   /**< places, from the end, that a frame at the second port reaches */
    bool closed;          /**< the ring has no gap */
    uint32_t *positions;  /**< per SubDevice of the plan */
    struct place *places; /**< per sync manager of the plan */
    uint8_t *storage;     /**< device side of all process data */
    uint8_t **siis;
    pthread_mutex_t lock;
    struct fsn_segment_counts counts;
    struct wire *wire;
    uint32_t lose;
    uint32_t lose_every, until_lost;
    uint64_t last_ns;
    char interfaces[2][16];
    int sockets[2]; /**< per port of the MainDevice; -1: not linked */
    int locks[2];   /**< keep other segments off its interface; -1: none */
    pthread_t thread;
    atomic_bool stop;
};

/** Creates SII contents and object dictionary of one SubDevice of the plan, or of a free position
 *  (subdevice FSN_NONE); false if out of memory (describe.c). */
bool segment_describe(struct fsn_segment *segment, uint32_t subdevice, uint32_t position);

/** Passes a frame now; the lock is held (frames.c). */
size_t segment_pass(struct fsn_segment *segment, uint32_t port, uint8_t *frame, size_t len_bytes,
                    uint64_t now_ns, uint32_t *out_port);

/** Per port of the MainDevice: whether its interface has a carrier (topology.c). */
void segment_plug(struct fsn_segment *segment, bool first, bool second);

/** After any change of cables or power: updates reachability, DL status, lost links
 *  (topology.c). */
void segment_rewire(struct fsn_segment *segment);

#endif
