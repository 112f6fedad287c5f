#define _GNU_SOURCE

#include "app/base/schedule.h"

#include <dirent.h>
#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <unistd.h>

/** As the kernel defines it (sched/types.h); libc has it only in newer versions. */
struct deadline_attributes {
    uint32_t size;
    uint32_t policy;
    uint64_t flags;
    int32_t nice;
    uint32_t priority;
    uint64_t runtime_ns, deadline_ns, period_ns;
};
enum { DEADLINE = 6 };

size_t schedule_threads(pid_t threads[SCHEDULE_THREADS]) {
    size_t count = 0;
    DIR *directory = opendir("/proc/self/task");
    if (directory == NULL) {
        return 0;
    }
    const struct dirent *entry;
    while (count < SCHEDULE_THREADS && (entry = readdir(directory)) != NULL) {
        const long number = strtol(entry->d_name, NULL, 10);
        if (number > 0) {
            threads[count++] = (pid_t)number;
        }
    }
    closedir(directory);
    return count;
}

pid_t schedule_new_thread(const pid_t *before, size_t before_count, const pid_t *after,
                          size_t after_count) {
    pid_t found = 0;
    for (size_t i = 0; i < after_count; i++) {
        bool known = false;
        for (size_t k = 0; k < before_count; k++) {
            known = known || before[k] == after[i];
        }
        if (!known && found != 0) {
            return 0;
        }
        found = known ? found : after[i];
    }
    return found;
}

int schedule_deadline(pid_t thread, uint64_t period_ns) {
    /* The kernel requires at least 1 us, and leaves 5 % of the CPU to others. */
    const struct deadline_attributes attributes = {
        .size = sizeof attributes,
        .policy = DEADLINE,
        .runtime_ns = period_ns * 8 / 10,
        .deadline_ns = period_ns,
        .period_ns = period_ns,
    };
    return syscall(SYS_sched_setattr, thread, &attributes, 0) == 0 ? 0 : errno;
}
