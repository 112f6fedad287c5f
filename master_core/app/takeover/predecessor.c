#define _GNU_SOURCE

#include "app/takeover/predecessor.h"

#include <dirent.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "app/log/log.h"
#include "app/takeover/handover.h"
#include "control/base/clock.h"
#include "fsn/version.h"
#include "plan/plan_internal.h"

enum {
    ANSWER_MS = 5000, /**< an SDO in progress is completed first */
    END_MS = 5000,    /**< for the disk of its intervention log; its cycle continues meanwhile */
    STILL_MS = 20,    /**< without a cycle: it is frozen, or has ended */
    EXIT_MS = 20,     /**< from its last cycle to its end; then it is killed */
    AGAIN_MS = 200,   /**< between two attempts of a standby */
    LEAST_STEP_NS = 250000,
    KILLED_MS = 5000, /**< time for the kernel to end it */
};

void predecessor_release(struct predecessor *predecessor) {
    if (predecessor->room != NULL) {
        munmap(predecessor->room, predecessor->room_bytes);
        predecessor->room = NULL;
    }
    if (predecessor->attachment.bytes != NULL) {
        munmap((void *)(uintptr_t)predecessor->attachment.bytes, predecessor->attachment.len_bytes);
        predecessor->attachment.bytes = NULL;
    }
    for (size_t i = 0; i < FSN_HELD; i++) {
        handover_close(&predecessor->attachment.held[i]);
    }
    handover_close(&predecessor->listener);
    handover_close(&predecessor->lock);
    handover_close(&predecessor->pidfd);
    handover_close(&predecessor->fd);
}

/** Maps a received file if it has the stated length; NULL if it has not, or a system call
 *  failed. */
static void *map(int *fd, uint64_t len_bytes) {
    struct stat found;
    void *bytes = MAP_FAILED;
    if (*fd >= 0 && len_bytes > 0 && fstat(*fd, &found) == 0 &&
        (uint64_t)found.st_size >= len_bytes) {
        bytes = mmap(NULL, (size_t)len_bytes, PROT_READ, MAP_SHARED, *fd, 0);
    }
    handover_close(fd);
    return bytes != MAP_FAILED ? bytes : NULL;
}

static bool take_answer(struct predecessor *predecessor, const struct handover_answer *answer,
                        int *fds) {
    predecessor->pidfd = fds[HANDOVER_SELF];
    predecessor->pid = (pid_t)answer->pid;
    predecessor->lock = predecessor->attachment.lock = fds[HANDOVER_LOCK];
    predecessor->listener = fds[HANDOVER_LISTENER];
    predecessor->room_bytes = (size_t)answer->room_bytes;
    predecessor->room = map(&fds[HANDOVER_ROOM], answer->room_bytes);
    predecessor->attachment.len_bytes = (size_t)answer->attachment_bytes;
    predecessor->attachment.bytes = map(&fds[HANDOVER_ATTACHMENT], answer->attachment_bytes);
    for (size_t i = 0; i < FSN_HELD; i++) {
        predecessor->attachment.held[i] = fds[HANDOVER_HELD + i];
    }
    return predecessor->pidfd >= 0 && predecessor->lock >= 0 && predecessor->room != NULL &&
           predecessor->attachment.bytes != NULL;
}

/** Waits for a message; false on a timeout. */
static bool wait_for(int fd, int wait_ms) {
    struct pollfd polled = {.fd = fd, .events = POLLIN};
    return poll(&polled, 1, wait_ms) == 1;
}

static int refuse(struct predecessor *predecessor, const char *text) {
    log_line(FSN_LOG_ERROR, "the take-over is refused, and the predecessor continues: %s", text);
    predecessor_release(predecessor);
    return EXIT_REFUSED;
}

static int request(struct predecessor *predecessor, const struct options *o,
                   const struct fsn_plan *plan) {
    struct handover_hello hello = {.format = HANDOVER_FORMAT,
                                   .dc_every = o->dc_every,
                                   .dc_host = o->dc_host,
                                   .dc_shift_ns = o->dc_shift_ns,
                                   .standby = o->standby,
                                   .cycle_ns = o->cycle_ns};
    struct handover_answer answer;
    int fds[HANDOVER_FDS];
    fsn_plan_sha256(plan, hello.plan);
    snprintf(hello.version, sizeof hello.version, "%s", fsn_version());
    /* After an immediate rejection sending fails, but its answer is available. */
    (void)handover_send(predecessor->fd, &hello, sizeof hello, NULL, 0);
    if (!wait_for(predecessor->fd, ANSWER_MS)) {
        return refuse(predecessor,
                      "it does not answer; where it hangs, end it with SIGKILL, and start "
                      "the bus without --take-over");
    }
    const bool heard = handover_receive(predecessor->fd, &answer, sizeof answer, fds) == 1;
    const bool whole = heard && take_answer(predecessor, &answer, fds);
    if (!heard || answer.format != HANDOVER_FORMAT) {
        return refuse(predecessor,
                      "it answers in another way; stop the bus, and start this version");
    }
    answer.text[sizeof answer.text - 1] = 0;
    predecessor->again = answer.taken == 0 && answer.again != 0;
    if (predecessor->again && o->standby) {
        predecessor_release(predecessor);
        return EXIT_REFUSED; /* retries, without a line each time */
    }
    if (answer.taken == 0) {
        return refuse(predecessor, answer.text);
    }
    if (!whole) {
        return refuse(predecessor, "what it handed over is not whole");
    }
    if (syscall(SYS_pidfd_send_signal, predecessor->pidfd, 0, NULL, 0) != 0) {
        return refuse(predecessor,
                      "this process may not end it: it needs the same user, or CAP_KILL");
    }
    return -1;
}

static int find_once(struct predecessor *predecessor, const struct options *o,
                     const struct fsn_plan *plan, const struct fsn_backend *backend) {
    struct fsn_fault fault;
    *predecessor = (struct predecessor){.fd = -1, .pidfd = -1, .lock = -1, .listener = -1};
    memset(predecessor->attachment.held, 0xFF, sizeof predecessor->attachment.held); /* none: -1 */
    if (backend->reach(o->interface, &predecessor->fd, &fault) != FSN_OK) {
        predecessor->again = o->standby && fault.status == FSN_E_BUS_SILENT;
        if (predecessor->again) {
            return EXIT_REFUSED;
        }
        log_line(FSN_LOG_ERROR, "--take-over: %s; without --take-over this one starts the bus",
                 fault.detail[0] != 0 ? fault.detail : fsn_status_text(fault.status));
        return EXIT_REFUSED;
    }
    return request(predecessor, o, plan);
}

int predecessor_find(struct predecessor *predecessor, const struct options *o,
                     const struct fsn_plan *plan, const struct fsn_backend *backend) {
    if (backend->reach == NULL) {
        log_line(FSN_LOG_ERROR, "a bus of %s cannot be handed over", backend->name);
        return EXIT_REFUSED;
    }
    for (int tries = 0;; tries++) {
        const int code = find_once(predecessor, o, plan, backend);
        if (code == -1 || !o->standby || !predecessor->again) {
            return code;
        }
        if (tries == 0) {
            log_line(FSN_LOG_INFO,
                     "standby: waits for an fsn-master on %s with every SubDevice in OP",
                     o->interface);
        }
        const struct timespec pause = {.tv_nsec = AGAIN_MS * 1000000L};
        nanosleep(&pause, NULL);
    }
}

/** Reads a message of the predecessor; false: it closes the bus. */
static bool hear(struct predecessor *predecessor, bool *held) {
    uint32_t word = 0;
    const int got = handover_receive(predecessor->fd, &word, sizeof word, NULL);
    if (got == 1 && (word == HANDOVER_HOLD || word == HANDOVER_RESUME)) {
        *held = word == HANDOVER_HOLD;
        log_line(FSN_LOG_WARNING, *held ? "maintenance: takes nothing over" : "follows again");
    }
    /* A connection that closes without a message belongs to a process that is ending. */
    return !(got == 1 && word == HANDOVER_LEAVES) &&
           (got >= 0 || handover_has_ended(predecessor->pidfd, KILLED_MS));
}

fsn_status predecessor_follow(struct predecessor *predecessor, uint64_t cycle_ns,
                              bool (*turn)(void *self), void *self, struct fsn_fault *fault) {
    /* At most half a cycle, so that no cycle is missed; not less, because that costs processor
     * time. */
    const uint64_t step_ns = cycle_ns / 2 > LEAST_STEP_NS ? cycle_ns / 2 : LEAST_STEP_NS;
    /* In cycles and in time: a fast bus needs a margin for the scheduler, a slow one for its
     * cycle. */
    const uint64_t cycles_ns = PREDECESSOR_STILL_CYCLES * cycle_ns;
    const uint64_t least_ns = PREDECESSOR_STILL_MS * UINT64_C(1000000);
    const uint64_t threshold_ns = cycles_ns > least_ns ? cycles_ns : least_ns;
    const struct timespec step = fsn_timespec(step_ns);
    uint32_t pictures = fsn_room_pictures(predecessor->room);
    uint64_t still_ns = 0;
    bool held = false;
    const uint32_t word = HANDOVER_FOLLOWS;
    (void)handover_send(predecessor->fd, &word, sizeof word, NULL, 0);
    while (turn(self)) {
        struct pollfd polled[] = {{.fd = predecessor->pidfd, .events = POLLIN},
                                  {.fd = predecessor->fd, .events = POLLIN}};
        const uint64_t slept_ns = fsn_now_ns();
        (void)ppoll(polled, 2, &step, NULL);
        if (polled[1].revents != 0 && !hear(predecessor, &held)) {
            return fsn_refuse_all(fault, FSN_E_BUS_BUSY, "the predecessor closes the bus itself");
        }
        /* An end during maintenance is intended, and is not a failure to take over. */
        const bool ended = handover_has_ended(predecessor->pidfd, 0);
        if (ended && held) {
            break;
        }
        /* A late wake-up means that this machine was stalled, and counts as one step. */
        const uint64_t waited_ns = fsn_now_ns() - slept_ns;
        const uint32_t now = fsn_room_pictures(predecessor->room);
        still_ns += waited_ns < 2 * step_ns ? waited_ns : step_ns;
        if (now != pictures || held) {
            still_ns = 0;
        }
        pictures = now;
        if (ended || still_ns >= threshold_ns) {
            log_line(FSN_LOG_ERROR,
                     ended ? "process %d has ended: takes the bus over"
                           : "process %d no longer runs cycles: takes the bus over",
                     (int)predecessor->pid);
            return FSN_OK;
        }
    }
    return fsn_refuse_all(fault, FSN_E_STATE,
                          held ? "the predecessor has ended in maintenance: nothing is taken over"
                               : "the standby ends");
}

/** Waits until the predecessor reports that its cycle has stopped, or has ended, or is stalled. */
static fsn_status wait_for_its_word(const struct predecessor *predecessor) {
    const uint64_t until_ns = fsn_now_ns() + END_MS * UINT64_C(1000000);
    uint32_t pictures = fsn_room_pictures(predecessor->room);
    uint64_t moved_ns = fsn_now_ns();
    for (uint64_t now_ns = moved_ns; now_ns < until_ns; now_ns = fsn_now_ns()) {
        struct pollfd polled[] = {{.fd = predecessor->fd, .events = POLLIN},
                                  {.fd = predecessor->pidfd, .events = POLLIN}};
        uint32_t word = 0;
        (void)poll(polled, 2, 1);
        if (polled[1].revents != 0) {
            return FSN_OK;
        }
        const int got = handover_receive(predecessor->fd, &word, sizeof word, NULL);
        if (got == 1 && word == HANDOVER_ENDS) {
            return FSN_OK;
        }
        if (got < 0) { /* it has closed the listener, and closes the bus, unless it is ending */
            return handover_has_ended(predecessor->pidfd, EXIT_MS) ? FSN_OK : FSN_E_BUS_BUSY;
        }
        if (fsn_room_pictures(predecessor->room) != pictures) {
            pictures = fsn_room_pictures(predecessor->room);
            moved_ns = now_ns;
        } else if (now_ns - moved_ns > STILL_MS * UINT64_C(1000000)) {
            return FSN_OK;
        }
    }
    return FSN_OK;
}

fsn_status predecessor_end(struct predecessor *predecessor, struct fsn_fault *fault) {
    const uint32_t word = HANDOVER_END;
    const bool said = handover_send(predecessor->fd, &word, sizeof word, NULL, 0);
    /* A closed handover_listener means that the predecessor continues without us, unless it is
     * ending. */
    if (said ? wait_for_its_word(predecessor) != FSN_OK
             : !handover_has_ended(predecessor->pidfd, EXIT_MS)) {
        return fsn_refuse_all(fault, FSN_E_BUS_BUSY, "the predecessor closes the bus itself");
    }
    if (!handover_has_ended(predecessor->pidfd, EXIT_MS)) {
        log_line(FSN_LOG_WARNING, "process %d does not end; it is killed", (int)predecessor->pid);
    }
    return predecessor_kill(predecessor, 0, fault);
}

/** The pidfd prevents reuse of the process number during this check. */
static void hasten(const struct predecessor *predecessor, int priority) {
    const struct sched_param urgent = {.sched_priority = priority};
    char path[32];
    snprintf(path, sizeof path, "/proc/%d/task", (int)predecessor->pid);
    DIR *threads = priority > 0 ? opendir(path) : NULL;
    const struct dirent *entry;
    while (threads != NULL && (entry = readdir(threads)) != NULL) {
        const long thread = strtol(entry->d_name, NULL, 10);
        if (thread > 0) {
            (void)sched_setscheduler((pid_t)thread, SCHED_FIFO, &urgent);
        }
    }
    if (threads != NULL) {
        closedir(threads);
    }
}

fsn_status predecessor_kill(struct predecessor *predecessor, int priority,
                            struct fsn_fault *fault) {
    if (!handover_has_ended(predecessor->pidfd, 0)) {
        hasten(predecessor, priority);
    }
    (void)syscall(SYS_pidfd_send_signal, predecessor->pidfd, SIGKILL, NULL, 0);
    if (!handover_has_ended(predecessor->pidfd, KILLED_MS)) {
        return fsn_refuse_all(fault, FSN_E_STATE,
                              "the process before cannot be ended; nothing was sent");
    }
    predecessor->ended = true;
    return FSN_OK;
}

fsn_status predecessor_continue(const struct predecessor *predecessor, struct fsn_core *core,
                                struct fsn_statistics *last) {
    const uint32_t image_bytes = fsn_core_image_bytes(core);
    uint8_t *image = malloc((size_t)image_bytes + 1);
    fsn_status status = image != NULL ? FSN_OK : FSN_E_NOMEM;
    if (status == FSN_OK) {
        status =
            fsn_room_read(predecessor->room, predecessor->room_bytes, image_bytes, last, image);
    }
    if (status == FSN_OK) {
        status = fsn_core_continue(core, last, image);
    }
    free(image);
    return status;
}
