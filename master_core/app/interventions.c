#define _GNU_SOURCE

#include "interventions.h"

#include "confine.h"

#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "control/base/clock.h"
#include "control/base/json.h"

enum {
    MOST_WAITING = 1000,                        /**< entries in the queue */
    MOST_BYTES = 4 << 20,                       /**< of all of them */
    MOST_ENTRY = INTERVENTION_LINE_BYTES - 256, /**< number and hash are added */
    SYNC_ENTRIES = 64,       /**< written at most before they must be on the disk */
    AGAIN_MS = 200,          /**< between two tries while the disk takes nothing */
    STACK_BYTES = 256 << 10, /**< locked memory is counted: no more than it needs */
};

struct entry {
    struct entry *next;
    size_t len_bytes;
    char json[];
};

struct interventions {
    struct intervention_files files; /**< of the thread */
    pthread_t thread;
    pthread_mutex_t lock; /**< of all below; held for what does not wait only */
    pthread_cond_t changed;
    struct entry *first, *last;
    uint64_t waiting, waiting_bytes;
    uint64_t lost, lost_reported;
    char lost_from[32], lost_until[32];
    int error; /**< of the last try; 0: it was written */
    bool ending, ended;
    uint64_t entry;
    char hash[2 * FSN_SHA256_BYTES + 1];
    char hash_shown[2 * FSN_SHA256_BYTES + 1];
};

const char *interventions_error(int error) {
    switch (error) {
    case EBUSY:
        return "another fsn-master writes its log there";
    case ELOOP:
        return "a symbolic link stands where a file of the log should be";
    case EISDIR:
        return "what stands where a file of the log should be is no regular file";
    default:
        return strerrordesc_np(error) != NULL ? strerrordesc_np(error) : "an unknown error";
    }
}

/** A disk may be full, read-only or broken for a while; the bus need not wait for it. */
static bool may_pass(int error) {
    return error == ENOSPC || error == EDQUOT || error == EFBIG || error == EROFS || error == EIO;
}

/* -- the queue ------------------------------------------------------------------------------ */

static void put_locked(struct interventions *log, struct entry *entry) {
    if (entry == NULL || log->waiting >= MOST_WAITING ||
        log->waiting_bytes + entry->len_bytes > MOST_BYTES) {
        fsn_utc_text(fsn_now_ns(), log->lost_until);
        if (log->lost == log->lost_reported) {
            memcpy(log->lost_from, log->lost_until, sizeof log->lost_from);
        }
        log->lost++;
        free(entry);
        return;
    }
    if (log->first == NULL) {
        log->first = entry;
    } else {
        log->last->next = entry;
    }
    log->last = entry;
    log->waiting++;
    log->waiting_bytes += entry->len_bytes;
    pthread_cond_signal(&log->changed);
}

void interventions_put(struct interventions *log, const char *json, size_t len_bytes) {
    char instead[160];
    if (len_bytes > MOST_ENTRY) {
        char utc[32];
        fsn_utc_text(fsn_now_ns(), utc);
        json = instead;
        len_bytes = (size_t)snprintf(instead, sizeof instead,
                                     "{\"event\":\"too_long\",\"utc\":\"%s\",\"bytes\":%zu,"
                                     "\"level\":\"warning\",\"text\":\"an event is left out: it "
                                     "is too long\"}",
                                     utc, len_bytes);
    }
    struct entry *entry = malloc(sizeof *entry + len_bytes);
    if (entry != NULL) {
        entry->next = NULL;
        entry->len_bytes = len_bytes;
        memcpy(entry->json, json, len_bytes);
    }
    pthread_mutex_lock(&log->lock);
    put_locked(log, entry);
    pthread_mutex_unlock(&log->lock);
}

void interventions_put_event(struct interventions *log, const char *json, size_t len_bytes) {
    /* What cycles and cables do all day is no intervention: it is in the journal and in incidents.
     */
    static const char *const kinds[] = {
        "state",   "parameters", "arm",         "edge",    "taken",    "fallback",     "dropped",
        "request", "written",    "turned_away", "foreign", "incident", "interventions"};
    static const char begin[] = "{\"event\":\"";
    const size_t skip = sizeof begin - 1;
    for (size_t i = 0; log != NULL && i < sizeof kinds / sizeof kinds[0]; i++) {
        const size_t len = strlen(kinds[i]);
        if (len_bytes > skip + len && memcmp(json + skip, kinds[i], len) == 0 &&
            json[skip + len] == '"') {
            interventions_put(log, json, len_bytes);
            return;
        }
    }
}

/* -- the thread ----------------------------------------------------------------------------- */

/** Waits for an entry, or after an error for the time to try again. Holds the lock. */
static void wait_for_work(struct interventions *log) {
    struct timespec until;
    clock_gettime(CLOCK_MONOTONIC, &until);
    until.tv_nsec += AGAIN_MS * 1000000L;
    until.tv_sec += until.tv_nsec / 1000000000;
    until.tv_nsec %= 1000000000;
    int waited = 0;
    while (!log->ending && waited == 0 &&
           (log->error != 0 || (log->first == NULL && log->lost == log->lost_reported))) {
        waited = log->error != 0 ? pthread_cond_timedwait(&log->changed, &log->lock, &until)
                                 : pthread_cond_wait(&log->changed, &log->lock);
    }
}

static int write_lost(struct interventions *log, uint64_t lost, const char *from,
                      const char *until) {
    char utc[32];
    char json[320];
    fsn_utc_text(fsn_now_ns(), utc);
    const int len = snprintf(json, sizeof json,
                             "{\"event\":\"entries_lost\",\"utc\":\"%s\",\"entries\":%llu,"
                             "\"from\":\"%s\",\"until\":\"%s\",\"level\":\"warning\","
                             "\"text\":\"entries that the disk did not take in time: %llu\"}",
                             utc, (unsigned long long)lost, from, until, (unsigned long long)lost);
    return intervention_files_append(&log->files, json, (size_t)len);
}

/** Writes the next entry without the lock, and takes it off the queue when it is written. */
static void write_next(struct interventions *log, unsigned *unsynced) {
    struct entry *entry = log->first;
    char from[32];
    char until[32];
    const uint64_t lost = log->lost;
    memcpy(from, log->lost_from, sizeof from);
    memcpy(until, log->lost_until, sizeof until);
    const uint64_t lost_now = lost - log->lost_reported;
    const bool is_last = entry == NULL || entry->next == NULL;
    pthread_mutex_unlock(&log->lock);
    int error = entry != NULL
                    ? intervention_files_append(&log->files, entry->json, entry->len_bytes)
                    : write_lost(log, lost_now, from, until);
    const bool written = error == 0;
    *unsynced += written;
    if (written && (is_last || *unsynced >= SYNC_ENTRIES)) {
        error = intervention_files_sync(&log->files);
        *unsynced = 0;
    }
    pthread_mutex_lock(&log->lock);
    log->error = error;
    if (written) {
        log->entry = log->files.number;
        memcpy(log->hash, log->files.hash, sizeof log->hash);
    }
    if (written && entry != NULL) {
        log->first = entry->next;
        log->waiting--;
        log->waiting_bytes -= entry->len_bytes;
        free(entry);
    } else if (written) {
        log->lost_reported = lost;
    }
}

/** The disk had an error and nothing waits: is it over?   Holds the lock. */
static void try_again(struct interventions *log) {
    pthread_mutex_unlock(&log->lock);
    int error = intervention_files_open(&log->files);
    error = error != 0 ? error : intervention_files_sync(&log->files);
    pthread_mutex_lock(&log->lock);
    log->error = error;
}

static void *run(void *context) {
    struct interventions *log = context;
    unsigned unsynced = 0;
    (void)confine_thread(); /* with them it writes as well */
    pthread_mutex_lock(&log->lock);
    for (;;) {
        wait_for_work(log);
        const bool ending = log->ending;
        const bool work = log->first != NULL || log->lost != log->lost_reported;
        if (work) {
            write_next(log, &unsynced);
        } else if (log->error != 0) {
            try_again(log);
        }
        if (ending && (!work || log->error != 0)) {
            break;
        }
    }
    log->ended = true;
    pthread_cond_broadcast(&log->changed);
    pthread_mutex_unlock(&log->lock);
    return NULL;
}

/** Starts the thread with all signals blocked: they are for the program. */
static int start_thread(struct interventions *log) {
    sigset_t all;
    sigset_t before;
    pthread_attr_t attributes;
    sigfillset(&all);
    pthread_sigmask(SIG_BLOCK, &all, &before);
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, STACK_BYTES);
    const int error = pthread_create(&log->thread, &attributes, run, log);
    pthread_attr_destroy(&attributes);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return error;
}

/* -- begin and end -------------------------------------------------------------------------- */

static void discard(struct interventions *log) {
    while (log->first != NULL) {
        struct entry *next = log->first->next;
        free(log->first);
        log->first = next;
    }
    intervention_files_close(&log->files);
    pthread_cond_destroy(&log->changed);
    pthread_mutex_destroy(&log->lock);
    free(log);
}

fsn_status interventions_open(const char *folder, uint64_t most_bytes, struct interventions **made,
                              struct fsn_refusal *refusal) {
    if (strlen(folder) >= INTERVENTION_PATH_BYTES) {
        return fsn_refusal_set(refusal, FSN_E_ARG, "a shorter path",
                               "the folder of the intervention log has at most %d bytes",
                               INTERVENTION_PATH_BYTES - 1);
    }
    struct interventions *log = calloc(1, sizeof *log);
    if (log == NULL) {
        return fsn_refusal_set(refusal, FSN_E_NOMEM, NULL, "out of memory");
    }
    pthread_condattr_t attributes;
    pthread_mutex_init(&log->lock, NULL);
    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_cond_init(&log->changed, &attributes);
    pthread_condattr_destroy(&attributes);
    intervention_files_init(&log->files, folder, most_bytes);
    log->error = intervention_files_open(&log->files);
    if (log->error != 0 && !may_pass(log->error)) {
        const bool busy = log->error == EBUSY;
        const fsn_status status = fsn_refusal_set(refusal, busy ? FSN_E_STATE : FSN_E_SYS,
                                                  busy ? "give each fsn-master a folder of its own"
                                                       : "mkdir it, and let this user write there",
                                                  "intervention log: %.200s: %s", folder,
                                                  interventions_error(log->error));
        discard(log);
        return status;
    }
    log->entry = log->files.number;
    memcpy(log->hash, log->files.hash, sizeof log->hash);
    const int error = start_thread(log);
    if (error != 0) {
        discard(log);
        return fsn_refusal_set(refusal, FSN_E_SYS, NULL,
                               "intervention log: its thread cannot be started: %s",
                               interventions_error(error));
    }
    *made = log;
    return FSN_OK;
}

void interventions_state(struct interventions *log, struct fsn_interventions *state) {
    pthread_mutex_lock(&log->lock);
    memcpy(log->hash_shown, log->hash, sizeof log->hash);
    *state = (struct fsn_interventions){.folder = log->files.path,
                                        .entry = log->entry,
                                        .hash = log->hash_shown,
                                        .waiting = log->waiting,
                                        .lost = log->lost,
                                        .error = log->error != 0 ? interventions_error(log->error)
                                                                 : NULL};
    pthread_mutex_unlock(&log->lock);
}

uint64_t interventions_close(struct interventions *log, int wait_ms) {
    if (log == NULL) {
        return 0;
    }
    struct timespec until;
    clock_gettime(CLOCK_MONOTONIC, &until);
    until.tv_sec += wait_ms / 1000;
    until.tv_nsec += wait_ms % 1000 * 1000000L;
    until.tv_sec += until.tv_nsec / 1000000000;
    until.tv_nsec %= 1000000000;
    int waited = 0;
    pthread_mutex_lock(&log->lock);
    log->ending = true;
    pthread_cond_broadcast(&log->changed);
    while (!log->ended && waited == 0) {
        waited = pthread_cond_timedwait(&log->changed, &log->lock, &until);
    }
    const uint64_t left = log->waiting + log->lost - log->lost_reported;
    const bool ended = log->ended;
    pthread_mutex_unlock(&log->lock);
    if (ended) {
        pthread_join(log->thread, NULL);
        discard(log);
    } else {
        pthread_detach(log->thread); /* a disk holds it up: it goes with the process */
    }
    return left;
}
