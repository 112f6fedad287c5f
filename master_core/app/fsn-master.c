/** fsn-master: loads a plan, drives a bus, serves a local control socket. Runs without Python and
 *  continues without clients. Part of the black channel: it creates and changes no FSoE frame. */
#define _GNU_SOURCE

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include "app/base/confine.h"
#include "app/base/explain.h"
#include "app/base/notify.h"
#include "app/log/entries.h"
#include "app/log/log.h"
#include "app/master.h"
#include "app/takeover/predecessor.h"
#include "control/base/words.h"

enum { MAX_PLAN_BYTES = 64 << 20 };

/** Reads a whole file.   @return NULL with errno set. */
static uint8_t *read_file(const char *path, size_t *len) {
    FILE *file = fopen(path, "rbe");
    size_t room = 1 << 16;
    uint8_t *bytes = malloc(room);
    *len = 0;
    while (file != NULL && bytes != NULL) {
        errno = 0;
        *len += fread(bytes + *len, 1, room - *len, file);
        if (*len < room) {
            break;
        }
        uint8_t *more = room < MAX_PLAN_BYTES ? realloc(bytes, 2 * room) : NULL;
        if (more == NULL) {
            free(bytes);
            errno = EFBIG;
        }
        bytes = more;
        room *= 2;
    }
    const bool bad = file == NULL || ferror(file) != 0;
    const int error = errno != 0 ? errno : EIO;
    if (file != NULL) {
        fclose(file);
    }
    if (bad) {
        free(bytes);
        bytes = NULL;
    }
    errno = error;
    return bytes;
}

/** Loads the plan, and checks its signatures.
 *  @return -1, otherwise the exit code, with the error logged. */
static int load(struct options *o, struct fsn_plan **plan) {
    const char *path = o->plan_file;
    size_t len;
    char text[640];
    struct fsn_fault fault;
    uint8_t *bytes = read_file(path, &len);
    if (bytes == NULL) {
        log_line(FSN_LOG_ERROR, "%s: %s; fsoe-net plan NETWORK -o PLAN makes a plan", path,
                 strerror(errno));
        return EXIT_USAGE;
    }
    int code = -1;
    if (fsn_plan_load(bytes, len, plan, &fault) != FSN_OK) {
        explain_fault(&fault, NULL, o, text, sizeof text);
        log_line(FSN_LOG_ERROR, "%s: %s", path, text);
        code = EXIT_REFUSED;
    } else {
        entry_plan(*plan, o);
        code = o->acceptance != NULL ? acceptance_check(bytes, len, o) : -1;
    }
    free(bytes);
    return code;
}

/** Compares the plan with the accepted hash: that of the file, or the whole fingerprint. */
static int check_accepted(const struct fsn_plan *plan, const struct options *o) {
    uint8_t digest[FSN_SHA256_BYTES];
    struct fsn_fingerprint made;
    char hash[2 * FSN_SHA256_BYTES + 1];
    char whole[2 * FSN_SHA256_BYTES + 1];
    char code[FSN_FINGERPRINT_CODE_BYTES];
    fsn_plan_sha256(plan, digest);
    fsn_hex_text(digest, sizeof digest, hash);
    if (fsn_plan_fingerprint(plan, &made) != FSN_OK) {
        log_line(FSN_LOG_ERROR, "no memory for the fingerprint of the plan");
        return EXIT_REFUSED;
    }
    fsn_hex_text(made.whole, sizeof made.whole, whole);
    fsn_fingerprint_code(&made, code);
    log_line(FSN_LOG_INFO, "plan %s, SHA-256 %s", o->plan_file, hash);
    log_line(FSN_LOG_INFO, "fingerprint %s (%s)", code, whole);
    if (o->accepted != NULL && strcasecmp(o->accepted, hash) != 0 &&
        strcasecmp(o->accepted, whole) != 0) {
        log_line(FSN_LOG_ERROR,
                 "this is not the accepted plan: neither its SHA-256 nor its fingerprint is %s; "
                 "accept it after looking at what changed, or load the other one",
                 o->accepted);
        return EXIT_REFUSED;
    }
    return -1;
}

/** Compares the plan with the accepted hash, and its cycle time with the options. */
static int check_plan(const struct fsn_plan *plan, struct options *o) {
    const int code = check_accepted(plan, o);
    if (code != -1) {
        return code;
    }
    const uint32_t stated_ns = fsn_plan_cycle_ns(plan);
    if (o->cycle_ns == 0) {
        o->cycle_ns = stated_ns;
    }
    if (o->cycle_ns < 1000) {
        log_line(FSN_LOG_ERROR, "the plan states no cycle time; --cycle 1ms does");
        return EXIT_USAGE;
    }
    enum fsn_log_level level = FSN_LOG_INFO;
    const char *origin = " as in the plan";
    if (stated_ns == 0) {
        origin = " (the plan states none)";
    } else if (stated_ns != o->cycle_ns) {
        level = FSN_LOG_WARNING;
        origin = ", which is not that of the plan and its fingerprint";
    }
    log_line(level, "engine %s, cycle %.3f ms%s", fsn_version(), (double)o->cycle_ns / 1e6, origin);
    return -1;
}

static const char *runtime_directory(void) {
    static const char *const variables[] = {"RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR"};
    for (size_t i = 0; i < sizeof variables / sizeof variables[0]; i++) {
        const char *directory = getenv(variables[i]);
        if (directory != NULL && *directory != 0) {
            return directory;
        }
    }
    return "/run";
}

static void socket_path(const struct options *o, char *room, size_t room_bytes) {
    const char *directory = runtime_directory();
    const char *name = o->interface != NULL ? o->interface : o->bus;
    if (o->socket != NULL) {
        snprintf(room, room_bytes, "%s", o->socket);
        return;
    }
    /* A service manager may name several directories; the first one is used. */
    const int len =
        snprintf(room, room_bytes, "%.*s/fsn-master-", (int)strcspn(directory, ":"), directory);
    size_t at = (size_t)len < room_bytes ? (size_t)len : room_bytes - 1;
    for (; *name != 0 && at + 1 < room_bytes; name++) {
        room[at++] = *name == '/' ? '_' : *name;
    }
    snprintf(room + at, room_bytes - at, ".sock");
}

static int block_signals(void) {
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGHUP);
    /* Before any thread exists, so that all threads inherit it. */
    sigprocmask(SIG_BLOCK, &set, NULL);
    return signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
}

/** The command line. */
struct words {
    int count;
    char **word;
};

/** Opens the intervention log.   @return -1, otherwise the exit code, with the error logged. */
static int keep_log(const struct options *o, const struct words *words) {
    struct interventions *log = NULL;
    struct fsn_refusal refusal;
    if (o->interventions == NULL) {
        return -1;
    }
    if (interventions_open(o->interventions, (uint64_t)o->interventions_mib << 20, &log,
                           &refusal) != FSN_OK) {
        log_line(FSN_LOG_ERROR, "%s%s%s", refusal.text, refusal.hint != NULL ? "; " : "",
                 refusal.hint != NULL ? refusal.hint : "");
        return refusal.status == FSN_E_STATE ? EXIT_REFUSED : EXIT_ENVIRONMENT;
    }
    log_keep(log);
    entry_start(words->count, words->word);
    return -1;
}

/** Entries to write when a log is opened late. */
struct late {
    const struct options *options;
    const struct fsn_plan *plan;
    const struct words *words;
};

/** The log of the predecessor may be the same file, so it is opened after that process has
 *  ended. */
static int keep_log_late(void *self) {
    const struct late *late = self;
    const int code = keep_log(late->options, late->words);
    if (code == -1) {
        entry_plan(late->plan, late->options);
    }
    return code;
}

/** The restrictions cannot be removed by any thread. Missing kernel support does not prevent the
 *  start. */
static void confine(struct options *options) {
    const int error = confine_process(options->xdp);
    options->confine = true;
    if (error != 0) {
        log_line(FSN_LOG_WARNING, "system calls are not restricted: %s", strerror(error));
    }
}

static int run(struct options *options, const struct words *words) {
    const struct fsn_backend *backend = backend_find(options->bus);
    if (backend == NULL) {
        log_line(FSN_LOG_ERROR,
                 "FSN_E_ABSENT: this build has no bus %s; fsn-master --version lists those it "
                 "has, and fsoe-net install-master --overwrite builds one with soem",
                 options->bus);
        return EXIT_REFUSED;
    }
    if (options->scan) {
        return scan_run(options, backend);
    }
    struct fsn_plan *plan = NULL;
    struct predecessor predecessor;
    int code = load(options, &plan);
    code = code == -1 ? check_plan(plan, options) : code;
    code = code == -1 ? buses_check_groups(options, plan) : code;
    const bool second = options->take_over || options->standby;
    if (code == -1 && second) {
        code = predecessor_find(&predecessor, options, plan, backend);
    }
    code = code == -1 ? buses_choose(options, plan, &backend) : code;
    if (code == -1) {
        char path[512];
        struct late late = {.options = options, .plan = plan, .words = words};
        socket_path(options, path, sizeof path);
        notify_begin();
        const int signal_fd = block_signals();
        confine(options);
        code = master_run(options, plan, backend, path, signal_fd, second ? &predecessor : NULL,
                          keep_log_late, &late);
        close(signal_fd);
    }
    fsn_plan_free(plan);
    return code;
}

int main(int argc, char **argv) {
    static struct options options;
    int code = options_read(argc, argv, &options);
    if (code != -1) {
        return code;
    }
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN); /* a longer text is truncated and marked */
    log_as_json(options.log_json);
    const struct words words = {argc, argv};
    code = options.take_over || options.standby ? -1 : keep_log(&options, &words);
    return code != -1 ? code : log_end(run(&options, &words));
}
