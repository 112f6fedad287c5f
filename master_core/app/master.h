/** The life cycle of the program: opening, running, stopping, as required by clients, signals and
 *  time. */
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

#endif
