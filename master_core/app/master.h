/** The life cycle of the program: opening, running, stopping, as required by clients, signals and
 *  time; the checks before it, and the scan in its place. */
#ifndef FSN_APP_MASTER_H
#define FSN_APP_MASTER_H

#include "app/base/backends.h"
#include "app/base/options.h"

struct predecessor;

/** Runs until a signal or a client ends it.   @return the exit code. Signals must be blocked and in
 *  `signal_fd`.
 *  @param[in] predecessor  its bus is taken over; NULL: none. `taken` is called once when it has
 *        ended, and may open the files of the predecessor. */
int master_run(const struct options *options, const struct fsn_plan *plan,
               const struct fsn_backend *backend, const char *socket_path, int signal_fd,
               struct predecessor *predecessor, int (*taken)(void *self), void *self);

/** `fsn-master --scan`: scans a bus without a plan. Prints one JSON document on stdout; returns the
 * exit code. */
int scan_run(const struct options *options, const struct fsn_backend *backend);

/** Has `fsoe-net acceptance verify` compare a plan with `options->acceptance`, and check its
 *  signatures. It runs without a shell, from the folder of this program or from PATH, and reads the
 *  bytes that were loaded. Its output is logged.
 *  @param[in,out] options  the output is kept in `acceptance_said`.
 *  @return -1 if everything matches the signatures, otherwise the exit code, with the reason
 *        logged.
 *  Context: before the control thread runs; waits for the other program. */
int acceptance_check(const uint8_t *plan, size_t plan_bytes, struct options *options);

/** Gives every bus of the plan its interface; several buses get one common backend.
 *  @param[in,out] backend  backend of one bus; then that of the plan.
 *  @return -1 to continue, otherwise the exit code, with the error logged. */
int buses_choose(struct options *options, const struct fsn_plan *plan,
                 const struct fsn_backend **backend);

/** Rejects options that conflict with a plan with groups; -1 if there are none. */
int buses_check_groups(const struct options *options, const struct fsn_plan *plan);

#endif
