/** Scheduling of the cyclic thread that the core does not set itself. */
#ifndef FSN_APP_SCHEDULE_H
#define FSN_APP_SCHEDULE_H

#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

enum { SCHEDULE_THREADS = 256 };

/** Threads of this process.   @return their number; at most SCHEDULE_THREADS. */
size_t schedule_threads(pid_t threads[SCHEDULE_THREADS]);

/** The thread that is in `after` and not in `before`; 0 unless there is exactly one. */
pid_t schedule_new_thread(const pid_t *before, size_t before_count, const pid_t *after,
                          size_t after_count);

/** Makes a thread SCHED_DEADLINE with this period.   @return 0, or errno. */
int schedule_deadline(pid_t thread, uint64_t period_ns);

#endif
