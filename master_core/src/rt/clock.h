/** A clock of the system as one number. A file that uses it asks for POSIX before any include. */
#ifndef FSN_CLOCK_H
#define FSN_CLOCK_H

#include <stdint.h>
#include <time.h>

static inline uint64_t fsn_clock_ns(clockid_t clock) {
    struct timespec now;
    clock_gettime(clock, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

#endif
