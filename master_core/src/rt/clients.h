/** Clients in the cycle: their outputs before each send, the inputs for them after it. */
#ifndef FSN_RT_CLIENTS_H
#define FSN_RT_CLIENTS_H

#include <stdbool.h>

#include "rt/shared.h"

/** One client that owns outputs. Only the master accesses it, except the targets of `sent` and
 *  `set`. */
struct fsn_rt_client {
    const struct fsn_shared_numbers *sent;        /**< the client writes it */
    const _Atomic uint64_t *set[FSN_SHARED_SETS]; /**< as well */
    const uint32_t *symbols;                      /**< outputs that it owns, all of them open */
    uint64_t *values, *fresh;                     /**< last values taken; buffer for new ones */
    struct fsn_shared_client *shown;              /**< where its counters are published */
    uint32_t count;                               /**< number of outputs; 0: reads inputs only */
    uint32_t misses;                              /**< permitted in a row */
    uint32_t missed;                              /**< cycles in a row without new outputs */
    uint32_t taken;                               /**< number of the set in `values` */
};

struct fsn_rt_clients {
    _Atomic uint32_t present; /**< bit n: there is a client[n] */
    struct fsn_rt_client client[FSN_SHARED_CLIENTS];
    struct fsn_shared_inputs *inputs; /**< NULL: no client yet */
    _Atomic uint64_t *pictures;
};

struct fsn_rt;

/** Writes the outputs that clients own, with the values they have sent. If a client has not sent
 *  any in time, they keep their stop values, which every cycle writes first. Cost: O(outputs of all
 *  clients), independent of their data. */
void fsn_rt_clients_write(struct fsn_rt *rt);

/** Shows the cycle to the clients, if there are any. */
void fsn_rt_clients_show(struct fsn_rt *rt, bool timed);

#endif
