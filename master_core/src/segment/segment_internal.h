/** The segment: SubDevices in ring order, and the link that feeds them. */
#ifndef FSN_SEGMENT_INTERNAL_H
#define FSN_SEGMENT_INTERNAL_H

#include <pthread.h>
#include <stdatomic.h>

#include "../plan_internal.h"
#include "esc.h"
#include "fsn/segment.h"

/** Where a sync manager of the plan lies. */
struct place {
    uint32_t position; /**< FSN_NONE: nowhere */
    uint8_t sm;
};

struct fsn_segment {
    struct fsn_plan *plan;
    struct esc *escs; /**< in ring order */
    bool *present;
    uint32_t count;
    uint32_t *positions;  /**< per SubDevice of the plan */
    struct place *places; /**< per sync manager of the plan */
    uint8_t *storage;     /**< device side of all process data */
    uint8_t **siis;
    pthread_mutex_t lock;
    struct fsn_segment_counts counts;
    uint32_t lose;
    uint64_t last_ns;
    int socket; /**< -1: not linked */
    pthread_t thread;
    atomic_bool stop;
};

/** Makes SII contents and object dictionary of one SubDevice of the plan, or of a free position
 *  (subdevice FSN_NONE); false when out of memory (describe.c). */
bool segment_describe(struct fsn_segment *segment, uint32_t subdevice, uint32_t position);

#endif
