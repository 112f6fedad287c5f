#define _GNU_SOURCE

#include "app/log/interventions.h"

#include "app/base/confine.h"

#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "control/base/clock.h"
#include "control/base/json.h"

enum {
    MOST_ENTRY = INTERVENTION_LINE_BYTES - 256, /**< number and hash are added */
    SYNC_ENTRIES = 64,       /**< maximum entries before they must be on the disk */
    AGAIN_MS = 200,          /**< between two attempts while the disk accepts nothing */
    STACK_BYTES = 256 << 10, /**< locked memory is accounted: keep it small */
};

/** Quarters of queue and disk that the entries of a role may fill. */
static const unsigned quarters_of[FSN_ROLES] = {
    [FSN_NO_ROLE] = 2, [FSN_OBSERVER] = 2, [FSN_OPERATOR] = 3, [FSN_MAINTAINER] = 4};

struct entry {
    struct entry *next;
    enum fsn_role account;
    size_t len_bytes;
    char json[];
};

struct interventions {
    struct intervention_files files; /**< of the thread */
    pthread_t thread;
    pthread_mutex_t lock; /**< guards all below; held only for operations that do not wait */
    pthread_cond_t changed;
    struct entry *first, *last;
    uint64_t waiting, waiting_bytes;
    uint64_t lost, lost_reported;
    uint64_t lost_acts; /**< of these, those of operators and maintainers */
    char lost_from[32], lost_until[32];
    int error;      /**< of the last attempt; 0: successful */
    bool limited;   /**< the quarters of an observer are full */
    uint64_t bytes; /**< of all files */
    bool ending, ended;
    uint64_t entry;
    char hash[2 * FSN_SHA256_BYTES + 1];
    char hash_shown[2 * FSN_SHA256_BYTES + 1];
};

const char *interventions_error(int error) {
    switch (error) {
    case INTERVENTION_FULL:
        return "its files have reached their limit: move old ones away";
    case EBUSY:
        return "another fsn-master writes its log there";
    case ELOOP:
        return "a file of the log is a symbolic link";
    case EISDIR:
        return "a file of the log is not a regular file";
    default:
        return strerrordesc_np(error) != NULL ? strerrordesc_np(error) : "an unknown error";
    }
}

/** Whether the disk may be full, read-only or defective for some time; the bus does not wait for
 *  it. */
static bool may_pass(int error) {
    return error == INTERVENTION_FULL || error == ENOSPC || error == EDQUOT || error == EFBIG ||
           error == EROFS || error == EIO;
}

/* -- the queue ------------------------------------------------------------------------------ */

static void lose_locked(struct interventions *log, enum fsn_role account) {
    fsn_utc_text(fsn_now_ns(), log->lost_until);
    if (log->lost == log->lost_reported) {
        memcpy(log->lost_from, log->lost_until, sizeof log->lost_from);
    }
    log->lost++;
    log->lost_acts += account >= FSN_OPERATOR;
}

static bool has_room(const struct interventions *log, const struct entry *entry) {
    const unsigned quarters = quarters_of[entry->account];
    return log->waiting < INTERVENTIONS_ENTRIES / INTERVENTION_QUARTERS * quarters &&
           log->waiting_bytes + entry->len_bytes <=
               INTERVENTIONS_BYTES / INTERVENTION_QUARTERS * quarters;
}

static void put_locked(struct interventions *log, struct entry *entry) {
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

void interventions_put(struct interventions *log, enum fsn_role account, const char *json,
                       size_t len_bytes) {
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
        entry->account = account;
        entry->len_bytes = len_bytes;
        memcpy(entry->json, json, len_bytes);
    }
    pthread_mutex_lock(&log->lock);
    if (entry != NULL && has_room(log, entry)) {
        put_locked(log, entry);
    } else {
        lose_locked(log, account);
        free(entry);
    }
    pthread_mutex_unlock(&log->lock);
}

void interventions_put_event(struct interventions *log, enum fsn_role account, const char *json,
                             size_t len_bytes) {
    /* Routine events of cycles and cables are not interventions: they are in the journal and in
     * incidents. */
    static const char *const kinds[] = {
        "state",   "parameters", "arm",         "edge",    "taken",    "fallback",     "dropped",
        "request", "written",    "turned_away", "foreign", "incident", "interventions"};
    static const char begin[] = "{\"event\":\"";
    const size_t skip = sizeof begin - 1;
    for (size_t i = 0; log != NULL && i < sizeof kinds / sizeof kinds[0]; i++) {
        const size_t len = strlen(kinds[i]);
        if (len_bytes > skip + len && memcmp(json + skip, kinds[i], len) == 0 &&
            json[skip + len] == '"') {
            interventions_put(log, account, json, len_bytes);
            return;
        }
    }
}

/* -- the thread ----------------------------------------------------------------------------- */

/** Whether the entry about lost entries is due: when the queue is empty. While the files are
 *  limited it is written only before an entry of a maintainer, so that reports about lost entries
 *  do not use up the reserve. */
static bool is_lost_due(const struct interventions *log) {
    const bool ours = log->first != NULL && log->first->account == FSN_MAINTAINER;
    return log->lost != log->lost_reported &&
           (log->limited ? ours || (log->ending && log->first == NULL) : log->first == NULL);
}

/** Waits for an entry, or for the time to try again. Holds the lock. */
static void wait_for_work(struct interventions *log) {
    const struct timespec until = fsn_timespec(fsn_now_ns() + AGAIN_MS * UINT64_C(1000000));
    int waited = 0;
    while (!log->ending && waited == 0 &&
           (log->error != 0 || (log->first == NULL && !is_lost_due(log)))) {
        waited = log->error != 0 || log->limited
                     ? pthread_cond_timedwait(&log->changed, &log->lock, &until)
                     : pthread_cond_wait(&log->changed, &log->lock);
    }
}

/** Writes the entry about lost entries.   @return its bytes. */
static size_t lost_entry(const struct interventions *log, char *json, size_t room) {
    char utc[32];
    const unsigned long long lost = log->lost - log->lost_reported;
    fsn_utc_text(fsn_now_ns(), utc);
    return (size_t)snprintf(
        json, room,
        "{\"event\":\"entries_lost\",\"utc\":\"%s\",\"entries\":%llu,\"acts\":%llu,\"from\":\"%s\","
        "\"until\":\"%s\",\"level\":\"warning\",\"text\":\"entries lost for lack of room: "
        "%llu, of them granted requests: %llu\"}",
        utc, lost, (unsigned long long)log->lost_acts, log->lost_from, log->lost_until, lost,
        (unsigned long long)log->lost_acts);
}

/** Whether an observer has no room left. Called without the lock, because it reads the folder. */
static bool is_limited(struct interventions *log) {
    return !intervention_files_have_room(&log->files, quarters_of[FSN_OBSERVER], 0);
}

/** Copies the state of the files for other threads. The caller holds the lock. */
static void show_files(struct interventions *log, bool limited) {
    log->entry = log->files.number;
    memcpy(log->hash, log->files.hash, sizeof log->hash);
    log->bytes = log->files.bytes + log->files.other_bytes;
    log->limited = limited;
}

static void take_off(struct interventions *log) {
    struct entry *entry = log->first;
    log->first = entry->next;
    log->waiting--;
    log->waiting_bytes -= entry->len_bytes;
    free(entry);
}

/** The next entry to write: one of the queue, or the one about lost entries. */
struct next {
    enum fsn_role account;
    const char *json;
    size_t len_bytes;
    bool is_last;
};

/** Appends an entry, and waits for the disk when it is due. Without the lock.   @return 0, or
 * errno. */
static int append_next(struct interventions *log, const struct next *next, unsigned *unsynced,
                       bool *written) {
    const int error = intervention_files_append(&log->files, quarters_of[next->account], next->json,
                                                next->len_bytes);
    *written = error == 0;
    *unsynced += *written;
    if (!*written || !(next->is_last || *unsynced >= SYNC_ENTRIES)) {
        return error;
    }
    *unsynced = 0;
    return intervention_files_sync(&log->files);
}

/** Writes the next entry without the lock, and removes it from the queue when it is written. */
static void write_next(struct interventions *log, unsigned *unsynced) {
    char about_lost[400];
    struct entry *entry = is_lost_due(log) ? NULL : log->first;
    struct next next = {.account = FSN_MAINTAINER,
                        .json = about_lost,
                        .is_last = log->first == NULL || log->first->next == NULL};
    const uint64_t lost = log->lost;
    const uint64_t lost_acts = log->lost_acts;
    if (entry == NULL) {
        next.len_bytes = lost_entry(log, about_lost, sizeof about_lost);
    } else {
        next.account = entry->account;
        next.json = entry->json;
        next.len_bytes = entry->len_bytes;
    }
    bool written;
    pthread_mutex_unlock(&log->lock);
    const int error = append_next(log, &next, unsynced, &written);
    const bool limited = is_limited(log);
    pthread_mutex_lock(&log->lock);
    const bool left_out = error == INTERVENTION_FULL && next.account != FSN_MAINTAINER;
    log->error = left_out ? 0 : error;
    show_files(log, limited);
    if (left_out) {
        lose_locked(log, next.account);
    }
    if (entry != NULL && (written || left_out)) {
        take_off(log);
    } else if (written) {
        log->lost_reported = lost;
        log->lost_acts -= lost_acts;
    }
}

/** Tries the disk again after an error or without room, with an empty queue. The caller holds the
 *  lock. */
static void try_again(struct interventions *log) {
    pthread_mutex_unlock(&log->lock);
    int error = intervention_files_open(&log->files);
    error = error != 0 ? error : intervention_files_sync(&log->files);
    const bool limited = is_limited(log);
    pthread_mutex_lock(&log->lock);
    log->error = error;
    show_files(log, limited);
}

static void *run(void *context) {
    struct interventions *log = context;
    unsigned unsynced = 0;
    (void)confine_thread(); /* if this fails, it also writes with them */
    pthread_mutex_lock(&log->lock);
    for (;;) {
        wait_for_work(log);
        const bool ending = log->ending;
        const bool work = log->first != NULL || is_lost_due(log);
        if (work) {
            write_next(log, &unsynced);
        } else if (log->error != 0 || log->limited) {
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

/** Starts the thread with all signals blocked, because the program handles them. */
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
    show_files(log, is_limited(log));
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
                                        .bytes = log->bytes,
                                        .limit_bytes = intervention_files_limit(&log->files),
                                        .limited = log->limited,
                                        .error = log->error != 0 ? interventions_error(log->error)
                                                                 : NULL};
    pthread_mutex_unlock(&log->lock);
}

uint64_t interventions_close(struct interventions *log, int wait_ms) {
    if (log == NULL) {
        return 0;
    }
    const struct timespec until = fsn_timespec(fsn_now_ns() + (uint64_t)wait_ms * 1000000u);
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
        pthread_detach(log->thread); /* blocked by a disk: it ends with the process */
    }
    return left;
}
