/** The life of the program: opening, running, stopping, as clients, signals and time require. */
#ifndef FSN_APP_MASTER_H
#define FSN_APP_MASTER_H

#include "backends.h"
#include "options.h"

/** Runs until a signal or a client ends it.   @return the exit code. Signals must be blocked and in
 *  `signal_fd`. */
int master_run(const struct options *options, const struct fsn_plan *plan,
               const struct fsn_backend *backend, const char *socket_path, int signal_fd);

#endif
