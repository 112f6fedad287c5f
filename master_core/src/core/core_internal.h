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
    uint64_t closed_after; /**< last cycle at the time of closing: the next one may still read it */
    struct fsn_shared_outputs *outputs; /**< mapped; NULL: it has none */
    int fd;                             /**< of the outputs, until they are sealed; otherwise -1 */
    uint32_t *symbols;
    uint64_t *values;
};

struct fsn_core {
    struct fsn_rt rt;
    const struct fsn_plan *plan;
    struct fsn_bus_layout layout;
    bool opened; /**< the bus was opened and must be closed */
    struct fsn_rt_copy *copies;
    struct fsn_rt_group *groups;
    uint32_t *active;          /**< symbols set so far; the cycle reads those in its set */
    uint32_t *active_slot;     /**< per symbol: its place in `active` + 1; 0: none. Writer only */
    uint64_t *wanted;          /**< last set values, in that order. Writer only */
    uint64_t *set_values;      /**< memory of the three sets */
    uint32_t active_count;     /**< writer only */
    uint64_t keep_ns;          /**< as requested by fsn_core_keep() */
    size_t keep_bytes;         /**< as requested by fsn_core_keep() */
    struct fsn_rt_shown shown; /**< of the snapshot, unless fsn_core_share() has moved it */
    struct fsn_core_place places[FSN_SHARED_CLIENTS];
    int inputs_fd;    /**< of rt.clients.inputs */
    uint32_t holders; /**< number of clients with outputs so far */
    pthread_t thread;
    bool running;
};

/** Opens the bus, verifies plan and layout together and builds the data that the cycle executes. On
 *  a refusal the caller frees the core. */
fsn_status fsn_core_activate(struct fsn_core *core, struct fsn_fault *fault);

/** Informs clients in the cycle that no further cycle follows, and frees their memory. Context:
 *  set-up, the cycle is stopped. */
void fsn_core_clients_end(struct fsn_core *core);

/** Allocates the cycles requested by fsn_core_keep(), at this bus cycle; 0: as many as fit.
 *  Recorded cycles are lost if the size changes. Context: set-up, the cycle is stopped. */
fsn_status fsn_core_fit_recorder(struct fsn_core *core, uint64_t cycle_ns);

#endif
