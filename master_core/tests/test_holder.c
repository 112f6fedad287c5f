/** The processes that hold the lock of an interface are named, also one that is stopped and one
 * that has only been given a descriptor. */
#define _GNU_SOURCE

#include "app/base/holder.h"

#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "builder.h"

static char interface[16];
static char shown_name[40];
static char text[HOLDER_TEXT_BYTES];

static socklen_t name_lock(struct sockaddr_un *name) {
    *name = (struct sockaddr_un){.sun_family = AF_UNIX};
    const int len =
        snprintf(name->sun_path + 1, sizeof name->sun_path - 1, "fsn-maindevice:%s", interface);
    return (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1 + (size_t)len);
}

static int take_lock(void) {
    struct sockaddr_un name;
    const socklen_t size = name_lock(&name);
    const int lock = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    CHECK(bind(lock, (const struct sockaddr *)&name, size) == 0);
    return lock;
}

/** A process that has the lock as this one has it, and waits. */
static pid_t start_holder(void) {
    const pid_t child = fork();
    if (child == 0) {
        (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
        for (;;) {
            pause();
        }
    }
    CHECK(child > 0);
    return child;
}

static void check_holder(pid_t pid, const char *after) {
    char expected[128];
    snprintf(expected, sizeof expected, "pid %d (%s), uid %d (", (int)pid, program_name(),
             (int)getuid());
    const char *at = strstr(holder_text(shown_name, text), expected);
    CHECK(at != NULL);
    at = strstr(at, ") since 2");
    CHECK(at != NULL && strncmp(at + 8 + 27, after, strlen(after)) == 0);
}

/** The time of the start is that of the clock, not of the boot. */
static void check_today(void) {
    char day[16];
    const time_t now = time(NULL);
    struct tm utc;
    CHECK(strftime(day, sizeof day, "%Y-%m-%dT", gmtime_r(&now, &utc)) == 11);
    CHECK(strstr(text, day) != NULL || utc.tm_hour == 0);
}

static void holders_are_named(void) {
    CHECK(holder_text(shown_name, text)[0] == 0);
    int lock = take_lock();
    check_holder(getpid(), "");
    CHECK(strncmp(text, "held by pid ", 12) == 0 && strstr(text, "stopped") == NULL);
    check_today();
    const pid_t child = start_holder();
    check_holder(getpid(), "");
    check_holder(child, "");
    close(lock); /* the child is the only one now */
    CHECK(kill(child, SIGSTOP) == 0 && waitpid(child, NULL, WUNTRACED) == child);
    check_holder(child, ", stopped: secure the machine, then end it with SIGKILL");
    CHECK(kill(child, SIGKILL) == 0 && waitpid(child, NULL, 0) == child);
    CHECK(holder_text(shown_name, text)[0] == 0);
}

/** A connection to the lock has its name as well, and is not the lock. */
static void a_connection_is_no_holder(void) {
    struct sockaddr_un name;
    const socklen_t size = name_lock(&name);
    const int lock = take_lock();
    CHECK(listen(lock, 1) == 0);
    const int peer = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    CHECK(connect(peer, (const struct sockaddr *)&name, size) == 0);
    const int accepted = accept(lock, NULL, NULL);
    CHECK(accepted >= 0);
    check_holder(getpid(), "");
    close(lock);
    CHECK(holder_text(shown_name, text)[0] == 0);
    close(accepted);
    close(peer);
}

static void another_user_may_not_look(void) {
    if (getuid() != 0) {
        fprintf(stderr, "test_holder: becoming another user takes root: that part is left out\n");
        return;
    }
    const int lock = take_lock();
    const pid_t child = fork();
    if (child == 0) {
        close(lock);
        CHECK(setuid(4005) == 0);
        CHECK(strstr(holder_text(shown_name, text), "may not look at: sudo ss -xap") != NULL);
        CHECK(strstr(text, interface) != NULL);
        _exit(0);
    }
    int status;
    CHECK(waitpid(child, &status, 0) == child && status == 0);
    close(lock);
}

int main(void) {
    snprintf(interface, sizeof interface, "t%d", (int)getpid());
    snprintf(shown_name, sizeof shown_name, "@fsn-maindevice:%s", interface);
    holders_are_named();
    a_connection_is_no_holder();
    another_user_may_not_look();
    return 0;
}
