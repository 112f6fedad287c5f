/** Objects that this program never writes. */
#ifndef FSN_CONTROL_GUARD_H
#define FSN_CONTROL_GUARD_H

#include <stdbool.h>

#include "fsn/plan.h"

/** Whether an object may be written, by plan and state of the bus.
 *  @return NULL, or the reason why not. */
const char *fsn_guard_write(const struct fsn_plan *plan, uint32_t subdevice, uint16_t index,
                            bool bus_runs);

#endif
