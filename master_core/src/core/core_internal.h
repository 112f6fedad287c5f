/** The core as set up, shared by activation, thread control and access from other threads. */
#ifndef FSN_CORE_INTERNAL_H
#define FSN_CORE_INTERNAL_H

#include <pthread.h>

#include "fsn/core.h"
#include "plan/plan_internal.h"
#include "rt/rt.h"

/** Memory of a client in the cycle. */
struct fsn_core_place {
    bool used, closed;
    uint64_t closed_after; /**< cycle that was the last one then: the next may still read it */
    struct fsn_shared_outputs *outputs; /**< mapped; NULL: it has none */
    int fd;                             /**< of the outputs, until they are sealed; else -1 */
    uint32_t *symbols;
    uint64_t *values;
};

struct fsn_core {
    struct fsn_rt rt;
    const struct fsn_plan *plan;
    struct fsn_bus_layout layout;
    bool opened; /**< the bus was opened and is owed a close */
    struct fsn_rt_copy *copies;
    struct fsn_rt_group *groups;
    uint32_t *active;      /**< symbols set so far; the cycle reads those of its set */
    uint32_t *active_slot; /**< per symbol: its place in `active` + 1; 0: none. The writer's own */
    uint64_t *wanted;      /**< values as last set, in that order; the writer's own */
    uint64_t *set_values;  /**< room of the three sets */
    uint32_t active_count; /**< the writer's own */
    uint64_t keep_ns;      /**< as requested by fsn_core_keep() */
    size_t keep_bytes;     /**< as requested by fsn_core_keep() */
    struct fsn_rt_shown shown; /**< of the snapshot, unless fsn_core_share() has moved it */
    struct fsn_core_place places[FSN_SHARED_CLIENTS];
    int inputs_fd;    /**< of rt.clients.inputs */
    uint32_t holders; /**< clients so far that have outputs */
    pthread_t thread;
    bool running;
};

/** Opens the bus, proves plan and layout together and builds what the cycle executes.
 *  On refusal the caller frees the core. */
fsn_status fsn_core_activate(struct fsn_core *core, struct fsn_fault *fault);

/** Says to clients in the cycle that no further one comes, and gives their memory back.
 *  Context: set-up, the cycle stands. */
void fsn_core_clients_end(struct fsn_core *core);

/** Makes room for the cycles that fsn_core_keep() requested, at this bus cycle; 0: as many as fit.
 *  What was recorded is gone when the room changes. Context: set-up, the cycle stands. */
fsn_status fsn_core_fit_recorder(struct fsn_core *core, uint64_t cycle_ns);

#endif
