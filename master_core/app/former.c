#define _GNU_SOURCE

#include "former.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "control/base/clock.h"
#include "fsn/version.h"
#include "handover.h"
#include "log.h"
#include "plan/plan_internal.h"

enum {
    ANSWER_MS = 5000, /**< an SDO that is under way is finished first */
    END_MS = 5000,    /**< for a disk of its intervention log; its cycle goes on meanwhile */
    STILL_MS = 20,    /**< without a cycle: it is frozen, or gone */
    EXIT_MS = 20,     /**< from its last cycle to its end, unless it is killed */
    KILLED_MS = 5000, /**< for the kernel to end it */
};

static void close_fd(int *fd) {
    if (*fd >= 0) {
        close(*fd);
    }
    *fd = -1;
}

void former_release(struct former *former) {
    if (former->room != NULL) {
        munmap(former->room, former->room_bytes);
        former->room = NULL;
    }
    if (former->attachment.bytes != NULL) {
        munmap((void *)(uintptr_t)former->attachment.bytes, former->attachment.len_bytes);
        former->attachment.bytes = NULL;
    }
    for (size_t i = 0; i < FSN_HELD; i++) {
        close_fd(&former->attachment.held[i]);
    }
    close_fd(&former->listener);
    close_fd(&former->lock);
    close_fd(&former->pidfd);
    close_fd(&former->fd);
}

/** Maps what came, if it is as long as was said; NULL: it is not, or the system refused. */
static void *map(int *fd, uint64_t len_bytes) {
    struct stat found;
    void *bytes = MAP_FAILED;
    if (*fd >= 0 && len_bytes > 0 && fstat(*fd, &found) == 0 &&
        (uint64_t)found.st_size >= len_bytes) {
        bytes = mmap(NULL, (size_t)len_bytes, PROT_READ, MAP_SHARED, *fd, 0);
    }
    close_fd(fd);
    return bytes != MAP_FAILED ? bytes : NULL;
}

static bool take_answer(struct former *former, const struct handover_answer *answer, int *fds) {
    former->lock = former->attachment.lock = fds[HANDOVER_LOCK];
    former->listener = fds[HANDOVER_LISTENER];
    former->room_bytes = (size_t)answer->room_bytes;
    former->room = map(&fds[HANDOVER_ROOM], answer->room_bytes);
    former->attachment.len_bytes = (size_t)answer->attachment_bytes;
    former->attachment.bytes = map(&fds[HANDOVER_ATTACHMENT], answer->attachment_bytes);
    for (size_t i = 0; i < FSN_HELD; i++) {
        former->attachment.held[i] = fds[HANDOVER_HELD + i];
    }
    return former->lock >= 0 && former->room != NULL && former->attachment.bytes != NULL;
}

/** Waits for a message; false when its time is over. */
static bool wait_for(int fd, int wait_ms) {
    struct pollfd polled = {.fd = fd, .events = POLLIN};
    return poll(&polled, 1, wait_ms) == 1;
}

static int refuse(struct former *former, const char *text) {
    log_line(FSN_LOG_ERROR, "the take-over is refused, and process %d goes on: %s",
             (int)former->pid, text);
    former_release(former);
    return EXIT_REFUSED;
}

static int ask(struct former *former, const struct options *o, const struct fsn_plan *plan) {
    struct handover_hello hello = {
        .format = HANDOVER_FORMAT, .dc_every = o->dc_every, .cycle_ns = o->cycle_ns};
    struct handover_answer answer;
    int fds[HANDOVER_FDS];
    fsn_plan_sha256(plan, hello.plan);
    snprintf(hello.version, sizeof hello.version, "%s", fsn_version());
    if (!handover_send(former->fd, &hello, sizeof hello, NULL, 0) ||
        !wait_for(former->fd, ANSWER_MS)) {
        return refuse(former, "it does not answer; where it hangs, end it with SIGKILL, and start "
                              "the bus without --take-over");
    }
    if (handover_receive(former->fd, &answer, sizeof answer, fds) != 1 ||
        answer.format != HANDOVER_FORMAT) {
        return refuse(former, "it answers in another way; stop the bus, and start this version");
    }
    answer.text[sizeof answer.text - 1] = 0;
    const bool whole = take_answer(former, &answer, fds);
    if (answer.taken == 0) {
        return refuse(former, answer.text);
    }
    if (!whole) {
        return refuse(former, "what it handed over is not whole");
    }
    /* Now that it has answered, the pidfd is of it. */
    if (syscall(SYS_pidfd_send_signal, former->pidfd, 0, NULL, 0) != 0) {
        return refuse(former, "this process may not end it: it needs the same user, or CAP_KILL");
    }
    return -1;
}

int former_find(struct former *former, const struct options *o, const struct fsn_plan *plan,
                const struct fsn_backend *backend) {
    struct fsn_fault fault;
    uid_t uid;
    *former = (struct former){.fd = -1, .pidfd = -1, .lock = -1, .listener = -1};
    memset(former->attachment.held, 0xFF, sizeof former->attachment.held); /* none: -1 */
    if (backend->reach == NULL) {
        log_line(FSN_LOG_ERROR, "--take-over: a bus of %s cannot be handed over", backend->name);
        return EXIT_REFUSED;
    }
    if (backend->reach(o->interface, &former->fd, &fault) != FSN_OK) {
        log_line(FSN_LOG_ERROR, "--take-over: %s; without --take-over this one starts the bus",
                 fault.detail[0] != 0 ? fault.detail : fsn_status_text(fault.status));
        return EXIT_REFUSED;
    }
    former->pidfd = handover_pidfd(former->fd, &former->pid, &uid);
    if (former->pidfd < 0) {
        return refuse(former, "it cannot be seen from here; both need the same PID namespace");
    }
    return ask(former, o, plan);
}

/** Waits until the former says that its cycle has stopped, or has ended, or stands still. */
static fsn_status wait_for_its_word(const struct former *former) {
    const uint64_t until_ns = fsn_now_ns() + END_MS * UINT64_C(1000000);
    uint32_t pictures = fsn_room_pictures(former->room);
    uint64_t moved_ns = fsn_now_ns();
    for (uint64_t now_ns = moved_ns; now_ns < until_ns; now_ns = fsn_now_ns()) {
        struct pollfd polled[] = {{.fd = former->fd, .events = POLLIN},
                                  {.fd = former->pidfd, .events = POLLIN}};
        uint32_t word = 0;
        (void)poll(polled, 2, 1);
        if (polled[1].revents != 0) {
            return FSN_OK;
        }
        const int got = handover_receive(former->fd, &word, sizeof word, NULL);
        if (got == 1 && word == HANDOVER_ENDS) {
            return FSN_OK;
        }
        if (got < 0) { /* it has shut the door, and closes the bus, unless it is at its end */
            return handover_has_ended(former->pidfd, EXIT_MS) ? FSN_OK : FSN_E_BUS_BUSY;
        }
        if (fsn_room_pictures(former->room) != pictures) {
            pictures = fsn_room_pictures(former->room);
            moved_ns = now_ns;
        } else if (now_ns - moved_ns > STILL_MS * UINT64_C(1000000)) {
            return FSN_OK;
        }
    }
    return FSN_OK;
}

fsn_status former_end(struct former *former, struct fsn_fault *fault) {
    const uint32_t word = HANDOVER_END;
    if (handover_send(former->fd, &word, sizeof word, NULL, 0) &&
        wait_for_its_word(former) != FSN_OK) {
        return fsn_refuse_all(fault, FSN_E_BUS_BUSY, "the process before closes the bus itself");
    }
    if (!handover_has_ended(former->pidfd, EXIT_MS)) {
        log_line(FSN_LOG_WARNING, "process %d does not end; it is killed", (int)former->pid);
        (void)syscall(SYS_pidfd_send_signal, former->pidfd, SIGKILL, NULL, 0);
    }
    if (!handover_has_ended(former->pidfd, KILLED_MS)) {
        return fsn_refuse_all(fault, FSN_E_STATE,
                              "the process before cannot be ended; nothing was sent");
    }
    former->ended = true;
    return FSN_OK;
}

fsn_status former_continue(const struct former *former, struct fsn_core *core,
                           struct fsn_statistics *last) {
    const uint32_t image_bytes = fsn_core_image_bytes(core);
    uint8_t *image = malloc((size_t)image_bytes + 1);
    fsn_status status = image != NULL ? FSN_OK : FSN_E_NOMEM;
    if (status == FSN_OK) {
        status = fsn_room_read(former->room, former->room_bytes, image_bytes, last, image);
    }
    if (status == FSN_OK) {
        status = fsn_core_continue(core, last, image);
    }
    free(image);
    return status;
}
