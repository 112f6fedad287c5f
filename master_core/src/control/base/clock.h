/** Monotonic time, and the corresponding UTC. */
#ifndef FSN_CONTROL_CLOCK_H
#define FSN_CONTROL_CLOCK_H

#include <stdint.h>

uint64_t fsn_now_ns(void);

/** UTC of a monotonic time, as 2026-01-31T12:00:00.123456Z. */
void fsn_utc_text(uint64_t at_ns, char room[32]);

#endif
