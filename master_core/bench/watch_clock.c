/** Watches the clock of one CPU above everything else there, and prints when it stood still: a
 *  stall of the machine, since nothing of ours runs above it.
 *
 *  watch_clock CPU THRESHOLD_MS    a line for each wake-up that came so late: when it was due and
 *                                  when it came, CLOCK_MONOTONIC, nanoseconds. Ends by a signal. */
#define _GNU_SOURCE

#include <inttypes.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include <errno.h>

enum { PERIOD_NS = 1000000, SECOND_NS = 1000000000 };

static int prepare(long cpu) {
    const struct sched_param highest = {.sched_priority = sched_get_priority_max(SCHED_FIFO)};
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET((size_t)cpu, &set);
    if (sched_setaffinity(0, sizeof set, &set) != 0 ||
        sched_setscheduler(0, SCHED_FIFO, &highest) != 0 ||
        mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
        fprintf(stderr, "watch_clock: CPU %ld, priority %d: %s\n", cpu, highest.sched_priority,
                strerror(errno));
        return 3;
    }
    return 0;
}

static uint64_t clock_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * SECOND_NS + (uint64_t)now.tv_nsec;
}

int main(int count, char **words) {
    const long cpu = count == 3 ? strtol(words[1], NULL, 10) : -1;
    const long threshold_ms = count == 3 ? strtol(words[2], NULL, 10) : 0;
    if (cpu < 0 || cpu >= CPU_SETSIZE || threshold_ms <= 0) {
        fprintf(stderr, "watch_clock CPU THRESHOLD_MS\n");
        return 2;
    }
    const int refused = prepare(cpu);
    if (refused != 0) {
        return refused;
    }
    printf("watching\n");
    fflush(stdout);
    for (uint64_t due_ns = clock_ns() + PERIOD_NS;;) {
        const struct timespec due = {.tv_sec = (time_t)(due_ns / SECOND_NS),
                                     .tv_nsec = (long)(due_ns % SECOND_NS)};
        (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        const uint64_t now_ns = clock_ns();
        if (now_ns > due_ns + (uint64_t)threshold_ms * PERIOD_NS) {
            printf("%" PRIu64 " %" PRIu64 "\n", due_ns, now_ns);
            fflush(stdout);
        }
        due_ns = (now_ns > due_ns ? now_ns : due_ns) + PERIOD_NS;
    }
}
