/** Faults as one line of text, with the next step. */
#ifndef FSN_APP_EXPLAIN_H
#define FSN_APP_EXPLAIN_H

#include <stddef.h>

#include "app/base/options.h"
#include "fsn/plan.h"

/** Writes "FSN_E_…: record: rule: detail; remedy". `plan` may be NULL. */
void explain_fault(const struct fsn_fault *fault, const struct fsn_plan *plan,
                   const struct options *options, char *room, size_t room_bytes);

/** The same for a bus that does not open; also names the processes that hold its interfaces. */
void explain_bus_fault(const struct fsn_fault *fault, const struct fsn_plan *plan,
                       const struct options *options, char *room, size_t room_bytes);

/** Remedy when the system does not permit an operation. Context: one thread. */
const char *explain_permission(const struct options *options);

#endif
