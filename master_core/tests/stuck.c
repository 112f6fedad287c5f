/** A test that hangs prints the stacks of all its threads before ctest ends it without output:
 *  ctest sets the limit in FSN_TEST_LIMIT_S. */
#define _GNU_SOURCE

#include <dirent.h>
#include <execinfo.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

enum { FRAMES = 64, TURN_MS = 200 };

static void say(const char *text) {
    if (write(STDERR_FILENO, text, strlen(text)) < 0) {
        _exit(1);
    }
}

/** Of the thread that the signal came to. */
static void show_stack(int number) {
    (void)number;
    void *frames[FRAMES];
    say("--- a thread:\n");
    backtrace_symbols_fd(frames, backtrace(frames, FRAMES), STDERR_FILENO);
}

/** Asks one thread after the other, so that their lines do not mix. */
static void end_with_stacks(int number) {
    (void)number;
    say("the test hangs; addr2line -f -e PROGRAM +OFFSET names a line\n");
    DIR *tasks = opendir("/proc/self/task");
    const struct dirent *entry;
    while (tasks != NULL && (entry = readdir(tasks)) != NULL) {
        const long thread = strtol(entry->d_name, NULL, 10);
        if (thread > 0) {
            (void)syscall(SYS_tgkill, getpid(), thread, SIGUSR2);
            const struct timespec turn = {.tv_nsec = TURN_MS * 1000000L};
            (void)nanosleep(&turn, NULL);
        }
    }
    _exit(1);
}

__attribute__((constructor)) static void arm(void) {
    const char *limit = getenv("FSN_TEST_LIMIT_S");
    if (limit == NULL) {
        return;
    }
    void *frames[1];
    (void)backtrace(frames, 1); /* its first call allocates */
    const struct sigaction show = {.sa_handler = show_stack, .sa_flags = SA_RESTART};
    const struct sigaction end = {.sa_handler = end_with_stacks};
    (void)sigaction(SIGUSR2, &show, NULL);
    (void)sigaction(SIGALRM, &end, NULL);
    (void)alarm((unsigned)strtoul(limit, NULL, 10));
}
