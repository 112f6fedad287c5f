#define _GNU_SOURCE

#include "app/takeover/handover_listener.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "app/log/log.h"
#include "control/base/clock.h"
#include "fsn/version.h"

static const uint64_t rest_ns =
    10000000000u; /**< how long the acyclic work pauses for a successor */
static const uint64_t again_ns = 1000000000u; /**< between two lines about rejected users */

void handover_listener_init(struct handover_listener *handover_listener) {
    *handover_listener =
        (struct handover_listener){.lock = -1, .peer = -1, .successor = -1, .pidfd = -1};
}

void handover_listener_open(struct handover_listener *handover_listener, int lock) {
    handover_listener->lock = lock >= 0 && listen(lock, 4) == 0 ? lock : -1;
    if (handover_listener->lock >= 0) {
        (void)fcntl(lock, F_SETFL, O_NONBLOCK);
    }
}

static void forget_peer(struct handover_listener *handover_listener) {
    handover_close(&handover_listener->peer);
    handover_close(&handover_listener->pidfd);
    handover_listener->state = HANDOVER_LISTENER_FREE;
}

static bool say(const struct handover_listener *handover_listener, uint32_t word) {
    return handover_send(handover_listener->peer, &word, sizeof word, NULL, 0);
}

void handover_listener_hold(struct handover_listener *handover_listener, bool held) {
    handover_listener->held = held;
    if (handover_listener->state == HANDOVER_LISTENER_FOLLOWED) {
        (void)say(handover_listener, held ? HANDOVER_HOLD : HANDOVER_RESUME);
    }
}

bool handover_listener_is_followed(const struct handover_listener *handover_listener) {
    return handover_listener->state == HANDOVER_LISTENER_GIVEN ||
           handover_listener->state == HANDOVER_LISTENER_FOLLOWED;
}

void handover_listener_close(struct handover_listener *handover_listener) {
    if (handover_listener->state == HANDOVER_LISTENER_FOLLOWED) {
        (void)say(handover_listener, HANDOVER_LEAVES);
    }
    forget_peer(handover_listener);
    handover_listener->lock = -1;
}

void handover_listener_prepare(const struct handover_listener *handover_listener,
                               struct pollfd fds[HANDOVER_LISTENER_FDS]) {
    fds[0] = (struct pollfd){.fd = handover_listener->lock, .events = POLLIN};
    fds[1] = (struct pollfd){.fd = handover_listener->peer, .events = POLLIN};
}

__attribute__((format(printf, 3, 4))) static void refuse(int peer, bool again, const char *format,
                                                         ...) {
    struct handover_answer answer = {.format = HANDOVER_FORMAT, .again = again};
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(answer.text, sizeof answer.text, format, arguments);
    va_end(arguments);
    if (!again) { /* repeated attempts would fill the log */
        log_line(FSN_LOG_WARNING, "a process that would take the bus over was refused: %s",
                 answer.text);
    }
    (void)handover_send(peer, &answer, sizeof answer, NULL, 0);
}

static const char not_ready[] = "not every SubDevice is in OP; try again when the bus is ready";

/** Why a process with this request cannot follow; NULL if it can. */
static const char *obstacle(const struct handover_hello *hello,
                            const struct handover_listener_facts *facts) {
    uint8_t plan[FSN_SHA256_BYTES];
    fsn_plan_sha256(facts->plan, plan);
    if (hello->format != HANDOVER_FORMAT) {
        return "its handover protocol differs; stop the bus, and start that version";
    }
    if (memcmp(hello->plan, plan, sizeof plan) != 0) {
        return "it has another plan; a take-over keeps the plan, another one needs a stop";
    }
    const struct options *own = facts->options;
    if (hello->cycle_ns != own->cycle_ns || hello->dc_every != own->dc_every ||
        hello->dc_host != own->dc_host || hello->dc_shift_ns != own->dc_shift_ns) {
        return "it has another --cycle, --dc-every, --dc-clock or --dc-shift; they belong to the "
               "start of a bus";
    }
    return facts->in_op ? NULL : not_ready;
}

/** Accepts one connection at a time. */
static void let_in(struct handover_listener *handover_listener) {
    uid_t uid = 0;
    pid_t pid = 0;
    const int peer = accept4(handover_listener->lock, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (peer < 0) {
        return;
    }
    const int pidfd = handover_pidfd(peer, &pid, &uid);
    /* A successor that has ended makes room for the next one. */
    if (handover_listener->successor >= 0 && handover_has_ended(handover_listener->successor, 0)) {
        handover_close(&handover_listener->successor);
    }
    if (handover_listener->state == HANDOVER_LISTENER_KNOCKS) {
        forget_peer(handover_listener); /* it has sent nothing, and makes room */
    }
    /* Another user must not get the file descriptors of the bus. */
    if (pidfd < 0 || (uid != 0 && uid != geteuid())) {
        const uint64_t now_ns = fsn_now_ns();
        refuse(peer,
               handover_listener->away_ns != 0 && now_ns - handover_listener->away_ns < again_ns,
               "process %d: it must be of the same user or root, and visible from here", (int)pid);
        /* Refusals of one kind are logged at intervals, because anyone may connect. */
        handover_listener->away_ns =
            handover_listener->away_ns == 0 || now_ns - handover_listener->away_ns >= again_ns
                ? now_ns
                : handover_listener->away_ns;
    } else if (handover_listener->peer >= 0 || handover_listener->successor >= 0) {
        refuse(peer, true, "process %d: another one follows already, or has not ended yet",
               (int)pid);
    } else {
        handover_listener->peer = peer;
        handover_listener->pidfd = pidfd;
        handover_listener->pid = pid;
        handover_listener->state = HANDOVER_LISTENER_KNOCKS;
        return;
    }
    close(peer);
    if (pidfd >= 0) {
        close(pidfd);
    }
}

static enum handover_listener_event leave(struct handover_listener *handover_listener) {
    if (handover_listener->state == HANDOVER_LISTENER_FOLLOWED) {
        log_line(FSN_LOG_WARNING, "the standby, process %d, has gone: no standby follows",
                 (int)handover_listener->pid);
    }
    const bool rested = handover_listener->state == HANDOVER_LISTENER_RESTS ||
                        handover_listener->state == HANDOVER_LISTENER_GIVEN;
    if (handover_listener->state == HANDOVER_LISTENER_GIVEN) {
        log_line(FSN_LOG_INFO, "process %d does not take the bus over",
                 (int)handover_listener->pid);
    }
    forget_peer(handover_listener);
    return rested ? HANDOVER_LISTENER_GO_ON : HANDOVER_LISTENER_NOTHING;
}

static enum handover_listener_event hear(struct handover_listener *handover_listener,
                                         const struct handover_listener_facts *facts) {
    struct handover_hello hello;
    uint32_t word = 0;
    const int got = handover_listener->state == HANDOVER_LISTENER_KNOCKS
                        ? handover_receive(handover_listener->peer, &hello, sizeof hello, NULL)
                        : handover_receive(handover_listener->peer, &word, sizeof word, NULL);
    if (got == 0) {
        return HANDOVER_LISTENER_NOTHING;
    }
    if (got < 0) {
        return leave(handover_listener);
    }
    if (handover_listener->state == HANDOVER_LISTENER_GIVEN && word == HANDOVER_END) {
        log_line(FSN_LOG_INFO, "hands the bus over to process %d", (int)handover_listener->pid);
        return HANDOVER_LISTENER_END;
    }
    if (handover_listener->state == HANDOVER_LISTENER_GIVEN && word == HANDOVER_FOLLOWS) {
        handover_listener->state = HANDOVER_LISTENER_FOLLOWED;
        log_line(FSN_LOG_INFO, "process %d follows as standby%s", (int)handover_listener->pid,
                 handover_listener->held ? ", and is held: maintenance" : "");
        if (handover_listener->held) {
            (void)say(handover_listener, HANDOVER_HOLD);
        }
        return HANDOVER_LISTENER_GO_ON;
    }
    if (handover_listener->state != HANDOVER_LISTENER_KNOCKS) {
        return leave(handover_listener);
    }
    const char *why = obstacle(&hello, facts);
    if (why != NULL) {
        refuse(handover_listener->peer, why == not_ready, "process %d, %.31s: %s",
               (int)handover_listener->pid, hello.version, why);
        return leave(handover_listener);
    }
    handover_listener->state = HANDOVER_LISTENER_RESTS;
    return HANDOVER_LISTENER_REST;
}

enum handover_listener_event handover_listener_serve(struct handover_listener *handover_listener,
                                                     const struct pollfd fds[HANDOVER_LISTENER_FDS],
                                                     const struct handover_listener_facts *facts) {
    enum handover_listener_event event = HANDOVER_LISTENER_NOTHING;
    if (handover_listener->state == HANDOVER_LISTENER_GIVEN &&
        fsn_now_ns() - handover_listener->given_ns > rest_ns) {
        return leave(
            handover_listener); /* lost SubDevices cannot return while the acyclic work pauses */
    }
    if (handover_listener->peer >= 0 && fds[1].fd == handover_listener->peer &&
        fds[1].revents != 0) {
        event = hear(handover_listener, facts);
    }
    if (handover_listener->lock >= 0 && fds[0].fd == handover_listener->lock &&
        fds[0].revents != 0) {
        let_in(handover_listener);
    }
    return event;
}

/** Puts bytes into memory that another process can read; -1: the system refused. */
static int shared(const void *bytes, size_t len_bytes) {
    const int fd = memfd_create("fsn-attachment", MFD_CLOEXEC);
    if (fd >= 0 && write(fd, bytes, len_bytes) != (ssize_t)len_bytes) {
        close(fd);
        return -1;
    }
    return fd;
}

enum handover_listener_event handover_listener_give(struct handover_listener *handover_listener,
                                                    const struct handover_listener_gift *gift) {
    if (handover_listener->state != HANDOVER_LISTENER_RESTS) {
        return HANDOVER_LISTENER_GO_ON; /* it has disconnected in the meantime */
    }
    struct handover_answer answer = {.format = HANDOVER_FORMAT,
                                     .taken = 1,
                                     .pid = getpid(),
                                     .room_bytes = gift->room_bytes,
                                     .attachment_bytes = gift->attachment.len_bytes};
    int fds[HANDOVER_FDS];
    fds[HANDOVER_LOCK] = gift->attachment.lock;
    fds[HANDOVER_LISTENER] = gift->listener;
    fds[HANDOVER_ROOM] = gift->room;
    fds[HANDOVER_ATTACHMENT] = shared(gift->attachment.bytes, gift->attachment.len_bytes);
    fds[HANDOVER_SELF] = (int)syscall(SYS_pidfd_open, getpid(), 0);
    if (fds[HANDOVER_ATTACHMENT] < 0 || fds[HANDOVER_SELF] < 0) {
        refuse(handover_listener->peer, false, "the system refused: %s", strerror(errno));
        handover_close(&fds[HANDOVER_ATTACHMENT]);
        handover_close(&fds[HANDOVER_SELF]);
        return leave(handover_listener);
    }
    /* From here on it counts as the successor, whether or not the sending succeeds. */
    handover_listener->successor = handover_listener->pidfd;
    handover_listener->pidfd = -1;
    handover_listener->state = HANDOVER_LISTENER_GIVEN;
    handover_listener->given_ns = fsn_now_ns();
    memcpy(&fds[HANDOVER_HELD], gift->attachment.held, sizeof gift->attachment.held);
    const bool sent = handover_send(handover_listener->peer, &answer, sizeof answer, fds,
                                    HANDOVER_HELD + gift->attachment.held_count);
    close(fds[HANDOVER_ATTACHMENT]);
    close(fds[HANDOVER_SELF]);
    return sent ? HANDOVER_LISTENER_NOTHING : leave(handover_listener);
}

void handover_listener_say_end(const struct handover_listener *handover_listener) {
    (void)say(handover_listener, HANDOVER_ENDS);
}
