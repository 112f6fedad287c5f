/** Ownership of outputs: leases, arming and stop values. One thread, the control thread. */
#ifndef FSN_CONTROL_OUTPUTS_H
#define FSN_CONTROL_OUTPUTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "control/base/refusal.h"
#include "fsn/core.h"

struct fsn_outputs;

enum { FSN_NOBODY = 0, FSN_ARM_MS = 10000 };

/** Data of an output for readers. */
struct fsn_output_state {
    uint32_t owner; /**< client that writes it, or FSN_NOBODY */
    uint32_t armed; /**< client that may make one edge, or FSN_NOBODY */
    bool open;      /**< a client could write it */
};

/** One value to write. */
struct fsn_wanted {
    uint32_t symbol;
    uint64_t raw;
    bool edge; /**< filled by the write: the edge of an output that can restart a machine */
};

/** Called for each output that fell back to its stop value. */
typedef void (*fsn_fallback_fn)(void *self, uint32_t symbol);

/** Prepares the symbols of a plan; NULL if out of memory. `plan` must outlive it. */
struct fsn_outputs *fsn_outputs_create(const struct fsn_plan *plan);
void fsn_outputs_free(struct fsn_outputs *outputs);

/** Begins to write into a core; NULL: none, all outputs are closed. Afterwards no output has an
 *  owner, and every open output of the core has its stop value. */
void fsn_outputs_attach(struct fsn_outputs *outputs, struct fsn_core *core);

/** Clients may no longer write and lose their outputs. Every output that they wrote takes its stop
 *  value. */
void fsn_outputs_close(struct fsn_outputs *outputs, fsn_fallback_fn fallback, void *self);

/** Finds an input or an output by its name.   @retval FSN_NONE  no such name. */
uint32_t fsn_outputs_find(const struct fsn_outputs *outputs, const char *name, bool output);

struct fsn_output_state fsn_outputs_state(const struct fsn_outputs *outputs, uint32_t symbol);

/** Whether `client` may write this now. Nothing is changed.
 *  @retval FSN_E_STATE   no core, or the outputs are closed for a stop.
 *  @retval FSN_E_CLOSED  an input, owned by a copy or FSoE, another client's, or not armed. */
fsn_status fsn_outputs_check(const struct fsn_outputs *outputs, uint32_t symbol, uint32_t client,
                             uint64_t raw, uint64_t now_ns, struct fsn_refusal *refusal);

/** Writes values, all in one cycle; the client then owns the outputs. Each was checked before, and
 *  none occurs twice. */
void fsn_outputs_write(struct fsn_outputs *outputs, uint32_t client, struct fsn_wanted *wanted,
                       size_t count);

/** Allows a client one edge of a restart-relevant output, within FSN_ARM_MS. */
fsn_status fsn_outputs_arm(struct fsn_outputs *outputs, uint32_t symbol, uint32_t client,
                           uint64_t now_ns, struct fsn_refusal *refusal);

/** Whether a client writes an output, or is allowed an edge of one. */
bool fsn_outputs_has(const struct fsn_outputs *outputs, uint32_t client);

/** Takes all outputs from a client: they return to their stop values, and are disarmed.
 *  @return number of outputs that returned. */
size_t fsn_outputs_take_back(struct fsn_outputs *outputs, uint32_t client, fsn_fallback_fn fallback,
                             void *self);

#endif
