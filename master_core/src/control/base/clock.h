/** Monotonic time, and the corresponding UTC. */
#ifndef FSN_CONTROL_CLOCK_H
#define FSN_CONTROL_CLOCK_H

#include <stdbool.h>
#include <stdint.h>
#include <time.h>

uint64_t fsn_now_ns(void);

/** A time or a duration in the form of the system. */
struct timespec fsn_timespec(uint64_t ns);

/** UTC of a monotonic time, as 2026-01-31T12:00:00.123456Z. */
void fsn_utc_text(uint64_t at_ns, char room[32]);

/** Limits how often something may happen: a few times at once, later at intervals.
 *  Whether it may happen now; if so, it is counted.
 *  @param[in,out] due_ns  0 at first; when it has happened for `at_once` times, it may happen again
 *                         `every_ns` after the first of them, and so on.
 *  @param[in] now_ns      monotonic. */
bool fsn_pace_allows(uint64_t *due_ns, uint64_t now_ns, unsigned at_once, uint64_t every_ns);

#endif
