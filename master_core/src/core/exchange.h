/** Data that two cycles exchange: set-up; see rt/exchange.h. */
#ifndef FSN_CORE_EXCHANGE_H
#define FSN_CORE_EXCHANGE_H

#include "rt/exchange.h"

/** Finds the sync managers of a bus and makes room for three sets in each direction.
 *  @param[in]  part      plan of that bus.
 *  @param[in]  layout    its image, which outlives the exchange.
 *  @param[out] exchange  to be freed by fsn_exchange_free(); all zeros after a refusal.
 *  @retval FSN_E_NOMEM  out of memory.   Context: set-up. Allocates. */
fsn_status fsn_exchange_create(const struct fsn_plan *part, const struct fsn_bus_layout *layout,
                               struct fsn_exchange *exchange);

/** Frees the result of create; also a result that is all zeros. */
void fsn_exchange_free(struct fsn_exchange *exchange);

#endif
