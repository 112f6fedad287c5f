/** Monotonic time, and the UTC that belongs to it. */
#ifndef FSN_CONTROL_CLOCK_H
#define FSN_CONTROL_CLOCK_H

#include <stdint.h>

uint64_t fsn_now_ns(void);

/** UTC as 2026-01-31T12:00:00.123456Z of a monotonic time. */
void fsn_utc_text(uint64_t at_ns, char room[32]);

#endif
