#define _GNU_SOURCE

#include "app/master.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/log/entries.h"
#include "app/log/log.h"

enum { MOST_TEXT = 16384, NOT_STARTED = 127 };

static const char program_name[] = "fsoe-net";

/** Puts a folder before the name of the program.   @return whether it can be executed there. */
static bool is_in(const char *folder, size_t folder_bytes, char path[PATH_MAX]) {
    const int len = snprintf(path, PATH_MAX, "%.*s/%s", (int)folder_bytes, folder, program_name);
    return folder[0] == '/' && len > 0 && len < PATH_MAX && access(path, X_OK) == 0;
}

/** Finds the program in the folder of this one, or in the absolute folders of PATH. */
static bool find_program(char path[PATH_MAX]) {
    char own[PATH_MAX];
    const ssize_t len = readlink("/proc/self/exe", own, sizeof own - 1);
    if (len > 0) {
        own[len] = 0;
        const char *end = strrchr(own, '/');
        if (end != NULL && is_in(own, (size_t)(end - own), path)) {
            return true;
        }
    }
    const char *rest = getenv("PATH");
    while (rest != NULL && *rest != 0) {
        const size_t folder_bytes = strcspn(rest, ":");
        if (folder_bytes < PATH_MAX && is_in(rest, folder_bytes, path)) {
            return true;
        }
        rest += folder_bytes + (rest[folder_bytes] == ':');
    }
    return false;
}

/** Returns a file without a name that contains the plan, at its start; -1 with errno set. */
static int plan_as_file(const uint8_t *plan, size_t plan_bytes) {
    const int fd = memfd_create("plan", MFD_CLOEXEC);
    for (size_t at = 0; fd >= 0 && at < plan_bytes;) {
        const ssize_t written = write(fd, plan + at, plan_bytes - at);
        if (written < 0 && errno != EINTR) {
            const int error = errno;
            close(fd);
            errno = error;
            return -1;
        }
        at += written > 0 ? (size_t)written : 0;
    }
    if (fd >= 0) {
        lseek(fd, 0, SEEK_SET);
    }
    return fd;
}

/** Executes the other program in this process.   @return only on failure. */
static void become(const char *path, const struct options *o, int plan_fd, int text_fd) {
    char *const argv[] = {
        (char *)program_name,
        "acceptance",
        "verify",
        "-",
        "--acceptance",
        (char *)o->acceptance,
        "--signers",
        (char *)o->signers,
        o->revoked != NULL ? "--revoked" : NULL,
        (char *)o->revoked,
        NULL,
    };
    if (dup2(plan_fd, STDIN_FILENO) >= 0 && dup2(text_fd, STDOUT_FILENO) >= 0 &&
        dup2(text_fd, STDERR_FILENO) >= 0) {
        execv(path, argv);
    }
}

/** Reads until the other end is closed; bytes that do not fit are discarded. */
static void read_text(int fd, char text[MOST_TEXT]) {
    char rest[512];
    size_t used = 0;
    ssize_t len;
    do {
        const size_t room = MOST_TEXT - 1 - used;
        len = room > 0 ? read(fd, text + used, room) : read(fd, rest, sizeof rest);
        used += len > 0 && room > 0 ? (size_t)len : 0;
    } while (len > 0 || (len < 0 && errno == EINTR));
    text[used] = 0;
}

/** Runs the program to its end.   @return its status as from `waitpid`; -1 with errno set. */
static int run(const char *path, const struct options *o, int plan_fd, char text[MOST_TEXT]) {
    int ends[2];
    int status = -1;
    if (pipe2(ends, O_CLOEXEC) != 0) {
        return -1;
    }
    const pid_t child = fork();
    if (child == 0) {
        become(path, o, plan_fd, ends[1]);
        _exit(NOT_STARTED);
    }
    close(ends[1]);
    if (child > 0) {
        read_text(ends[0], text);
        while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
        }
    }
    close(ends[0]);
    return status;
}

static void log_text(enum fsn_log_level level, char *text) {
    char *rest = NULL;
    for (char *line = strtok_r(text, "\n", &rest); line != NULL;
         line = strtok_r(NULL, "\n", &rest)) {
        log_line(level, "%s", line);
    }
}

int acceptance_check(const uint8_t *plan, size_t plan_bytes, struct options *options) {
    static char text[MOST_TEXT];
    static char said[MOST_TEXT];
    char path[PATH_MAX];
    if (!find_program(path)) {
        log_line(FSN_LOG_ERROR,
                 "fsoe-net is neither next to fsn-master nor on PATH, so nothing checks the "
                 "signatures of %s; install it, or name the accepted plan with --accepted HASH",
                 options->acceptance);
        return EXIT_ENVIRONMENT;
    }
    const int plan_fd = plan_as_file(plan, plan_bytes);
    const int status = plan_fd < 0 ? -1 : run(path, options, plan_fd, text);
    const int error = errno;
    if (plan_fd >= 0) {
        close(plan_fd);
    }
    if (status == -1) {
        log_line(FSN_LOG_ERROR, "%s cannot be run: %s", path, strerror(error));
        return EXIT_ENVIRONMENT;
    }
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : NOT_STARTED;
    memcpy(said, text, sizeof said);
    options->acceptance_said = said;
    entry_acceptance(options, code == EXIT_FINE, said);
    log_text(FSN_LOG_INFO, text);
    if (code == EXIT_FINE) {
        return -1;
    }
    const bool revoked = options->revoked != NULL;
    log_line(FSN_LOG_ERROR,
             "plan %s is not as signed in %s; compare with `fsoe-net acceptance verify %s "
             "--acceptance %s --signers %s%s%s` (%s ended with code %d)",
             options->plan_file, options->acceptance, options->plan_file, options->acceptance,
             options->signers, revoked ? " --revoked " : "", revoked ? options->revoked : "", path,
             code);
    return code == EXIT_REFUSED || code == EXIT_USAGE ? EXIT_REFUSED : EXIT_ENVIRONMENT;
}
