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
    const uint32_t *symbols;                      /**< outputs it owns, all of them open */
    uint64_t *values, *fresh;                     /**< as last taken; room to take */
    struct fsn_shared_client *shown;              /**< where it is counted */
    uint32_t count;                               /**< of them; 0: reads inputs only */
    uint32_t misses;                              /**< allowed in a row */
    uint32_t missed;                              /**< in a row */
    uint32_t taken;                               /**< number of the set in `values` */
};

struct fsn_rt_clients {
    _Atomic uint32_t present; /**< bit n: there is a client[n] */
    struct fsn_rt_client client[FSN_SHARED_CLIENTS];
    struct fsn_shared_inputs *inputs; /**< NULL: no client so far */
    _Atomic uint64_t *pictures;
};

struct fsn_rt;

/** Writes the outputs that clients own, with the values they have sent. A client that has sent
 *  nothing in time leaves them at their stop values, which every cycle writes first.
 *  Cost: O(outputs of all clients); no data of theirs can make it longer. */
void fsn_rt_clients_write(struct fsn_rt *rt);

/** Shows the cycle to the clients, when there are any. */
void fsn_rt_clients_show(struct fsn_rt *rt, bool timed);

#endif
