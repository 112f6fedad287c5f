/** The buses of a plan, each on its interface. */
#ifndef FSN_APP_BUSES_H
#define FSN_APP_BUSES_H

#include "app/base/backends.h"
#include "app/base/options.h"

/** Gives every bus of the plan its interface; several buses get one common backend.
 *  @param[in,out] backend  backend of one bus; then that of the plan.
 *  @return -1 to continue, otherwise the exit code, with the error logged. */
int buses_choose(struct options *options, const struct fsn_plan *plan,
                 const struct fsn_backend **backend);

/** Rejects options that conflict with a plan with groups; -1 if there are none. */
int buses_check_groups(const struct options *options, const struct fsn_plan *plan);

#endif
