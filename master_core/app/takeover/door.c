#define _GNU_SOURCE

#include "app/takeover/door.h"

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
#include "control/base/words.h"
#include "fsn/version.h"

static const uint64_t rest_ns =
    10000000000u; /**< how long the acyclic work rests for a successor */
static const uint64_t again_ns = 1000000000u; /**< between two lines about users that may not */

static void close_fd(int *fd) {
    if (*fd >= 0) {
        close(*fd);
    }
    *fd = -1;
}

void door_init(struct door *door) {
    *door = (struct door){.lock = -1, .peer = -1, .successor = -1, .pidfd = -1};
}

void door_open(struct door *door, int lock) {
    door->lock = lock >= 0 && listen(lock, 4) == 0 ? lock : -1;
    if (door->lock >= 0) {
        (void)fcntl(lock, F_SETFL, O_NONBLOCK);
    }
}

static void forget_peer(struct door *door) {
    close_fd(&door->peer);
    close_fd(&door->pidfd);
    door->state = DOOR_FREE;
}

static bool say(const struct door *door, uint32_t word) {
    return handover_send(door->peer, &word, sizeof word, NULL, 0);
}

void door_hold(struct door *door, bool held) {
    door->held = held;
    if (door->state == DOOR_FOLLOWED) {
        (void)say(door, held ? HANDOVER_HOLD : HANDOVER_RESUME);
    }
}

bool door_is_followed(const struct door *door) {
    return door->state == DOOR_GIVEN || door->state == DOOR_FOLLOWED;
}

void door_close(struct door *door) {
    if (door->state == DOOR_FOLLOWED) {
        (void)say(door, HANDOVER_LEAVES);
    }
    forget_peer(door);
    door->lock = -1;
}

void door_prepare(const struct door *door, struct pollfd fds[DOOR_FDS]) {
    fds[0] = (struct pollfd){.fd = door->lock, .events = POLLIN};
    fds[1] = (struct pollfd){.fd = door->peer, .events = POLLIN};
}

__attribute__((format(printf, 3, 4))) static void refuse(int peer, bool again, const char *format,
                                                         ...) {
    struct handover_answer answer = {.format = HANDOVER_FORMAT, .again = again};
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(answer.text, sizeof answer.text, format, arguments);
    va_end(arguments);
    if (!again) { /* who tries again would fill the log */
        log_line(FSN_LOG_WARNING, "a process that would take the bus over was refused: %s",
                 answer.text);
    }
    (void)handover_send(peer, &answer, sizeof answer, NULL, 0);
}

static const char not_ready[] = "not every SubDevice is in OP; try again when the bus is ready";

/** Why a process with this request cannot follow; NULL: it can. */
static const char *obstacle(const struct handover_hello *hello, const struct door_facts *facts) {
    uint8_t plan[FSN_SHA256_BYTES];
    fsn_plan_sha256(facts->plan, plan);
    if (hello->format != HANDOVER_FORMAT) {
        return "its version hands a bus over in another way; stop the bus, and start that version";
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

/** Lets one in at a time. */
static void let_in(struct door *door) {
    uid_t uid = 0;
    pid_t pid = 0;
    const int peer = accept4(door->lock, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (peer < 0) {
        return;
    }
    const int pidfd = handover_pidfd(peer, &pid, &uid);
    if (door->successor >= 0 && handover_has_ended(door->successor, 0)) {
        close_fd(&door->successor);
    }
    if (door->state == DOOR_KNOCKS) {
        forget_peer(door); /* it has said nothing, and makes room */
    }
    if (pidfd < 0 || (uid != 0 && uid != geteuid())) {
        const uint64_t now_ns = fsn_now_ns();
        refuse(peer, door->away_ns != 0 && now_ns - door->away_ns < again_ns,
               "process %d: it must be of the same user or root, and visible from here", (int)pid);
        door->away_ns =
            door->away_ns == 0 || now_ns - door->away_ns >= again_ns ? now_ns : door->away_ns;
    } else if (door->peer >= 0 || door->successor >= 0) {
        refuse(peer, true, "process %d: another one follows already, or has not ended yet",
               (int)pid);
    } else {
        door->peer = peer;
        door->pidfd = pidfd;
        door->pid = pid;
        door->state = DOOR_KNOCKS;
        return;
    }
    close(peer);
    if (pidfd >= 0) {
        close(pidfd);
    }
}

static enum door_event leave(struct door *door) {
    if (door->state == DOOR_FOLLOWED) {
        log_line(FSN_LOG_WARNING, "the standby, process %d, has gone: nobody follows",
                 (int)door->pid);
    }
    const bool rested = door->state == DOOR_RESTS || door->state == DOOR_GIVEN;
    if (door->state == DOOR_GIVEN) {
        log_line(FSN_LOG_INFO, "process %d does not take the bus over", (int)door->pid);
    }
    forget_peer(door);
    return rested ? DOOR_GO_ON : DOOR_NOTHING;
}

static enum door_event hear(struct door *door, const struct door_facts *facts) {
    struct handover_hello hello;
    uint32_t word = 0;
    const int got = door->state == DOOR_KNOCKS
                        ? handover_receive(door->peer, &hello, sizeof hello, NULL)
                        : handover_receive(door->peer, &word, sizeof word, NULL);
    if (got == 0) {
        return DOOR_NOTHING;
    }
    if (got < 0) {
        return leave(door);
    }
    if (door->state == DOOR_GIVEN && word == HANDOVER_END) {
        log_line(FSN_LOG_INFO, "hands the bus over to process %d", (int)door->pid);
        return DOOR_END;
    }
    if (door->state == DOOR_GIVEN && word == HANDOVER_FOLLOWS) {
        door->state = DOOR_FOLLOWED;
        log_line(FSN_LOG_INFO, "process %d follows as standby%s", (int)door->pid,
                 door->held ? ", and is held: maintenance" : "");
        if (door->held) {
            (void)say(door, HANDOVER_HOLD);
        }
        return DOOR_GO_ON;
    }
    if (door->state != DOOR_KNOCKS) {
        return leave(door);
    }
    const char *why = obstacle(&hello, facts);
    if (why != NULL) {
        refuse(door->peer, why == not_ready, "process %d, %.31s: %s", (int)door->pid, hello.version,
               why);
        return leave(door);
    }
    door->state = DOOR_RESTS;
    return DOOR_REST;
}

enum door_event door_serve(struct door *door, const struct pollfd fds[DOOR_FDS],
                           const struct door_facts *facts) {
    enum door_event event = DOOR_NOTHING;
    if (door->state == DOOR_GIVEN && fsn_now_ns() - door->given_ns > rest_ns) {
        return leave(door); /* lost SubDevices do not come back while the acyclic work rests */
    }
    if (door->peer >= 0 && fds[1].fd == door->peer && fds[1].revents != 0) {
        event = hear(door, facts);
    }
    if (door->lock >= 0 && fds[0].fd == door->lock && fds[0].revents != 0) {
        let_in(door);
    }
    return event;
}

/** Puts bytes where another process can read them; -1: the system refused. */
static int shared(const void *bytes, size_t len_bytes) {
    const int fd = memfd_create("fsn-attachment", MFD_CLOEXEC);
    if (fd >= 0 && write(fd, bytes, len_bytes) != (ssize_t)len_bytes) {
        close(fd);
        return -1;
    }
    return fd;
}

enum door_event door_give(struct door *door, const struct door_gift *gift) {
    if (door->state != DOOR_RESTS) {
        return DOOR_GO_ON; /* it has gone meanwhile */
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
        refuse(door->peer, false, "the system refused: %s", strerror(errno));
        close_fd(&fds[HANDOVER_ATTACHMENT]);
        close_fd(&fds[HANDOVER_SELF]);
        return leave(door);
    }
    /* From here on it counts as the successor, however the sending ends. */
    door->successor = door->pidfd;
    door->pidfd = -1;
    door->state = DOOR_GIVEN;
    door->given_ns = fsn_now_ns();
    memcpy(&fds[HANDOVER_HELD], gift->attachment.held, sizeof gift->attachment.held);
    const bool sent = handover_send(door->peer, &answer, sizeof answer, fds,
                                    HANDOVER_HELD + gift->attachment.held_count);
    close(fds[HANDOVER_ATTACHMENT]);
    close(fds[HANDOVER_SELF]);
    return sent ? DOOR_NOTHING : leave(door);
}

void door_say_end(const struct door *door) {
    (void)say(door, HANDOVER_ENDS);
}
