/** A system clock as one number. A file that uses it must request POSIX before any include. */
#ifndef FSN_CLOCK_H
#define FSN_CLOCK_H

#include <stdint.h>
#include <time.h>

static inline uint64_t fsn_clock_ns(clockid_t clock) {
    struct timespec now;
    clock_gettime(clock, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

/** Extends a reading of 32 valid bits to the time nearest to the expected one.
 *  @param[in] shown_ns  a clock may have 32 bits only; its upper bits are not used. */
static inline uint64_t fsn_clock_nearest(uint64_t expected_ns, uint64_t shown_ns) {
    return expected_ns + (uint64_t)(int64_t)(int32_t)((uint32_t)shown_ns - (uint32_t)expected_ns);
}

#endif
