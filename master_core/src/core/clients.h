/** Real-time clients: their memory is allocated and freed outside of the cycle. */
#ifndef FSN_CORE_CLIENTS_H
#define FSN_CORE_CLIENTS_H

#include "fsn/core.h"
#include "rt/shared.h"

enum { FSN_CLIENT_FDS = 2 }; /**< descriptors of a client: inputs, and its outputs if it has any */

/** Outputs that a client requests, and its limit of missed cycles. */
struct fsn_core_client {
    const uint32_t *symbols; /**< open outputs, without duplicates, not owned by another client */
    uint32_t count;          /**< 0: reads inputs only */
    uint32_t misses;         /**< cycles in a row without new outputs that are allowed */
};

/** Counters of the cycle for a client. */
struct fsn_core_client_seen {
    uint32_t count, misses; /**< as it was opened */
    uint32_t state;         /**< enum fsn_shared_state */
    uint64_t on_time, late, missed, torn;
};

/** Creates the memory of a client. One that only reads is in the cycle at once. Its outputs must be
 *  set to their stop values before, by fsn_core_set_outputs(): they have these until it sends some,
 *  and again when it is late or gone.
 *  @param[out] place  its number, for the functions below.
 *  @param[out] fds    inputs, sealed against writing, and outputs (-1: it has none); the caller
 *                     closes them.
 *  @retval FSN_E_BUSY   there are FSN_SHARED_CLIENTS already, or one has just left: try again.
 *  @retval FSN_E_ARG    no such symbol.   @retval FSN_E_CLOSED  one is closed to writes.
 *  @retval FSN_E_NOMEM  out of memory.
 *  @retval FSN_E_SYS    a system call failed; see errno.
 *  Context: control thread. Allocates; never delays the cyclic thread. */
fsn_status fsn_core_client_open(struct fsn_core *core, const struct fsn_core_client *wanted,
                                uint32_t *place, int fds[FSN_CLIENT_FDS]);

/** Lets a client with outputs into the cycle, once it has mapped them. They are sealed now, so that
 *  no process can map them for writing any longer, write them by a call, or remove pages, which
 *  would make the cycle wait.
 *  @retval FSN_E_SYS  the client has prevented the seal, or the kernel is too old.
 *  Context: control thread. */
fsn_status fsn_core_client_begin(struct fsn_core *core, uint32_t place);

/** Takes a client out of the cycle: from the next one on its outputs have what
 *  fsn_core_set_outputs() set.   Context: control thread. */
void fsn_core_client_close(struct fsn_core *core, uint32_t place);

/** Counters of a client that is in the cycle.   Context: control thread. */
struct fsn_core_client_seen fsn_core_client_seen(const struct fsn_core *core, uint32_t place);

#endif
