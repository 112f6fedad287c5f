/** Real-time clients: their memory is allocated and freed outside of the cycle. */
#ifndef FSN_CORE_CLIENTS_H
#define FSN_CORE_CLIENTS_H

#include "fsn/core.h"
#include "rt/shared.h"

enum { FSN_CLIENT_FDS = 2 }; /**< descriptors of a client: inputs, and outputs if it has any */

/** Outputs that a client requests, and its limit of missed cycles. */
struct fsn_core_client {
    const uint32_t *symbols; /**< open outputs, without duplicates, not owned by another client */
    uint32_t count;          /**< 0: the client only reads */
    uint32_t misses;         /**< permitted consecutive cycles without new outputs */
};

/** Counters of the cycle for a client. */
struct fsn_core_client_seen {
    uint32_t count, misses; /**< as passed when it was opened */
    uint32_t state;         /**< enum fsn_shared_state */
    uint64_t on_time, late, missed, torn;
};

/** Creates the memory of a client. A client that only reads is in the cycle immediately. Its
 *  outputs must first be set to their stop values by fsn_core_set_outputs(): they have these until
 *  it sends some, and again if it is late or disconnected.
 *  @param[out] place  its number, for the functions below.
 *  @param[out] fds    inputs, sealed against writing, and outputs (-1: it has none); the caller
 *                     closes them.
 *  @retval FSN_E_BUSY   there are already FSN_SHARED_CLIENTS, or one has just left: try again.
 *  @retval FSN_E_ARG    unknown symbol.   @retval FSN_E_CLOSED  one is closed to writes.
 *  @retval FSN_E_NOMEM  out of memory.
 *  @retval FSN_E_SYS    a system call failed; see errno.
 *  Context: control thread. Allocates; never delays the cyclic thread. */
fsn_status fsn_core_client_open(struct fsn_core *core, const struct fsn_core_client *wanted,
                                uint32_t *place, int fds[FSN_CLIENT_FDS]);

/** Adds a client with outputs to the cycle after it has mapped them. They are then sealed, so that
 *  processes can no longer map them for writing, write them by a call, or remove pages, which would
 *  make the cycle wait.
 *  @retval FSN_E_SYS  the client has prevented the seal, or the kernel is too old.
 *  Context: control thread. */
fsn_status fsn_core_client_begin(struct fsn_core *core, uint32_t place);

/** Removes a client from the cycle: from the next cycle on its outputs have the values of
 *  fsn_core_set_outputs().   Context: control thread. */
void fsn_core_client_close(struct fsn_core *core, uint32_t place);

/** Counters of a client that is in the cycle.   Context: control thread. */
struct fsn_core_client_seen fsn_core_client_seen(const struct fsn_core *core, uint32_t place);

#endif
