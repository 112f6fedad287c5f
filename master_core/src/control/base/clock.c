#define _POSIX_C_SOURCE 200809L

#include "control/base/clock.h"

#include <stdio.h>
#include <string.h>

#include "rt/clock.h"

uint64_t fsn_now_ns(void) {
    return fsn_clock_ns(CLOCK_MONOTONIC);
}

struct timespec fsn_timespec(uint64_t ns) {
    return (struct timespec){.tv_sec = (time_t)(ns / 1000000000u),
                             .tv_nsec = (long)(ns % 1000000000u)};
}

void fsn_utc_text(uint64_t at_ns, char room[32]) {
    struct tm parts;
    const int64_t utc_ns = (int64_t)(fsn_clock_ns(CLOCK_REALTIME) - (fsn_now_ns() - at_ns));
    const time_t seconds = (time_t)(utc_ns / 1000000000);
    memset(&parts, 0, sizeof parts);
    gmtime_r(&seconds, &parts);
    char day[24];
    strftime(day, sizeof day, "%Y-%m-%dT%H:%M:%S", &parts);
    snprintf(room, 32, "%s.%06uZ", day, (unsigned)(utc_ns % 1000000000 / 1000) % 1000000u);
}

bool fsn_pace_allows(uint64_t *due_ns, uint64_t now_ns, unsigned at_once, uint64_t every_ns) {
    if (*due_ns > now_ns + (at_once - 1) * every_ns) {
        return false;
    }
    *due_ns = (*due_ns > now_ns ? *due_ns : now_ns) + every_ns;
    return true;
}
