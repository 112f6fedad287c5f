/** The buses of a plan, each on its interface. */
#ifndef FSN_APP_BUSES_H
#define FSN_APP_BUSES_H

#include "app/base/backends.h"
#include "app/base/options.h"

/** Gives every bus of the plan its interface; of several buses the backend is one for all of them.
 *  @param[in,out] backend  what drives one bus; then what drives the plan.
 *  @return -1 to go on, else the exit code; then it has said why. */
int buses_choose(struct options *options, const struct fsn_plan *plan,
                 const struct fsn_backend **backend);

/** Refuses options that a plan with groups does not go with; -1: none is given. */
int buses_check_groups(const struct options *options, const struct fsn_plan *plan);

#endif
