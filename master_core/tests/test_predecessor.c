/** The side of a process that takes a bus over: which messages of its predecessor it accepts, and
 *  when it continues. The predecessor is a child process that sends messages of its own. */
#define _GNU_SOURCE

#include "app/takeover/predecessor.h"

#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/log/log.h"
#include "app/takeover/handover.h"
#include "builder.h"
#include "emulated_rig.h"
#include "takeover_rig.h"

enum { ROOM_BYTES = 1 << 18 }; /**< enough for the e-stop pair */

static struct fsn_plan *plan;
static struct options options = {.interface = "test0", .cycle_ns = 20000000};
static int listening = -1;  /**< of the predecessor; -1: none */
static unsigned tries_left; /**< until it can be reached */
static fsn_status unreachable = FSN_E_BUS_SILENT;

static fsn_status reach(const char *interface, int *fd, struct fsn_fault *fault) {
    CHECK(strcmp(interface, "test0") == 0);
    if (tries_left > 0) {
        tries_left--;
        *fault = (struct fsn_fault){.status = unreachable};
        return unreachable;
    }
    *fd = takeover_rig_connect(listening);
    return FSN_OK;
}

static const struct fsn_backend backend = {.name = "test", .reach = reach};

/** How the child answers the first message. */
struct part {
    struct handover_answer answer;
    size_t answer_bytes;   /**< 0: the whole of it */
    bool silent, no_files; /**< sends nothing; gives no descriptors */
    size_t room_bytes;     /**< of its room */
    void (*then)(int fd, void *room);
};

/** Waits for the next message. */
static uint32_t next_word(int fd) {
    struct pollfd polled = {.fd = fd, .events = POLLIN};
    uint32_t word = 0;
    CHECK(poll(&polled, 1, 10000) == 1);
    CHECK(handover_receive(fd, &word, sizeof word, NULL) == 1);
    return word;
}

static void say(int fd, uint32_t word) {
    CHECK(handover_send(fd, &word, sizeof word, NULL, 0));
}

static void play(const struct part *part) {
    struct handover_hello hello;
    struct handover_answer answer = part->answer;
    const int fd = accept4(listening, NULL, NULL, SOCK_CLOEXEC);
    struct pollfd polled = {.fd = fd, .events = POLLIN};
    CHECK(fd >= 0 && poll(&polled, 1, 10000) == 1);
    CHECK(handover_receive(fd, &hello, sizeof hello, NULL) == 1);
    CHECK(hello.format == HANDOVER_FORMAT && hello.cycle_ns == options.cycle_ns);
    CHECK(hello.standby == options.standby);
    if (part->silent) {
        return;
    }
    const size_t len = part->answer_bytes != 0 ? part->answer_bytes : sizeof answer;
    int fds[HANDOVER_FDS];
    const int room = takeover_rig_memory(part->room_bytes);
    fds[HANDOVER_SELF] = (int)syscall(SYS_pidfd_open, getpid(), 0);
    fds[HANDOVER_LOCK] = listening;
    fds[HANDOVER_LISTENER] = listening;
    fds[HANDOVER_ROOM] = room;
    fds[HANDOVER_ATTACHMENT] = takeover_rig_memory(8);
    void *shown = mmap(NULL, part->room_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, room, 0);
    CHECK(shown != MAP_FAILED);
    answer.pid = getpid();
    CHECK(handover_send(fd, &answer, len, fds, part->no_files ? 0 : HANDOVER_HELD));
    if (part->then != NULL) {
        part->then(fd, shown);
    }
    close(fd);
}

static pid_t child = -1;

static struct predecessor found(const struct part *part, int expected) {
    struct predecessor predecessor;
    listening = takeover_rig_listen();
    CHECK(listen(listening, 1) == 0);
    child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        play(part);
        exit(0);
    }
    CHECK(predecessor_find(&predecessor, &options, plan, &backend) == expected);
    return predecessor;
}

static void end(struct predecessor *predecessor, bool killed) {
    int status = 0;
    predecessor_release(predecessor);
    close(listening);
    CHECK(waitpid(child, &status, 0) == child);
    CHECK(killed ? WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL : status == 0);
}

static const struct part good = {.answer = {.format = HANDOVER_FORMAT,
                                            .taken = 1,
                                            .room_bytes = ROOM_BYTES,
                                            .attachment_bytes = 8},
                                 .room_bytes = ROOM_BYTES};

static struct part with(void (*then)(int fd, void *room)) {
    struct part part = good;
    part.then = then;
    return part;
}

static void refused(const struct part *part) {
    struct predecessor predecessor = found(part, EXIT_REFUSED);
    CHECK(predecessor.fd == -1 && predecessor.room == NULL && predecessor.pidfd == -1 &&
          !predecessor.ended);
    end(&predecessor, false);
}

static void wait_for_the_end(int fd, void *room) {
    struct pollfd polled = {.fd = fd, .events = POLLIN};
    (void)room;
    CHECK(poll(&polled, 1, 10000) == 1);
}

/** An answer that is short, of another version, or inconsistent does not describe a bus to take
 *  over. */
static void odd_answers_are_refused(void) {
    struct part part = good;
    part.answer.taken = 0;
    strcpy(part.answer.text, "it has another plan");
    refused(&part);
    memset(part.answer.text, 'x', sizeof part.answer.text); /* without an end */
    refused(&part);
    part = good;
    part.answer.format++;
    refused(&part);
    part = good;
    part.answer_bytes = 16;
    refused(&part);
    part = good;
    part.silent = true;
    refused(&part);
    part = with(wait_for_the_end);
    part.no_files = true;
    refused(&part);
    part = with(wait_for_the_end);
    part.answer.room_bytes = ROOM_BYTES + 1; /* more than there is */
    refused(&part);
    part.answer.room_bytes = UINT64_MAX;
    refused(&part);
    part = with(wait_for_the_end);
    part.answer.attachment_bytes = 0;
    refused(&part);
}

/** A standby waits for a bus that is not there yet; a take-over does not. Neither waits for another
 *  cause. */
static void only_a_standby_waits(void) {
    struct predecessor predecessor;
    tries_left = 1;
    CHECK(predecessor_find(&predecessor, &options, plan, &backend) == EXIT_REFUSED &&
          tries_left == 0);
    options.standby = true;
    tries_left = 1;
    unreachable = FSN_E_SYS;
    CHECK(predecessor_find(&predecessor, &options, plan, &backend) == EXIT_REFUSED &&
          tries_left == 0);
    unreachable = FSN_E_BUS_SILENT;
    tries_left = 2;
    const struct part part = with(wait_for_the_end);
    predecessor = found(&part, -1);
    CHECK(tries_left == 0 && predecessor.pid == child && predecessor.room_bytes == ROOM_BYTES);
    end(&predecessor, false);
    options.standby = false;
    CHECK(predecessor_find(&predecessor, &options, plan, &(struct fsn_backend){.name = "none"}) ==
          EXIT_REFUSED);
}

static unsigned turns; /**< of predecessor_follow(), from which it gives up */

static bool turn(void *self) {
    (void)self;
    return turns-- > 0;
}

static fsn_status follow(const struct predecessor *predecessor, unsigned most) {
    struct fsn_fault fault;
    turns = most;
    return predecessor_follow((struct predecessor *)(uintptr_t)predecessor, options.cycle_ns, turn,
                              NULL, &fault);
}

/** Runs and shows a cycle now and then, as one that is alive. */
static void show(void *room) {
    size_t len;
    uint8_t *bytes = build_full(&len);
    struct emulated_rig rig = emulated_rig_load(bytes, len);
    CHECK(fsn_core_share(rig.core, room) == FSN_OK);
    for (int i = 0; i < 40; i++) {
        emulated_rig_cycle(&rig);
        usleep(500);
    }
    emulated_rig_end(&rig);
}

static void lives_and_leaves(int fd, void *room) {
    CHECK(next_word(fd) == HANDOVER_FOLLOWS);
    show(room);
    say(fd, HANDOVER_LEAVES);
    wait_for_the_end(fd, room);
}

static void stands_still(int fd, void *room) {
    CHECK(next_word(fd) == HANDOVER_FOLLOWS);
    (void)room;
    pause();
}

/* It is in maintenance mode before it follows: however late its message comes on a busy machine. */
static void is_held_and_ends(int fd, void *room) {
    say(fd, HANDOVER_HOLD);
    CHECK(next_word(fd) == HANDOVER_FOLLOWS);
    usleep(50000); /* longer than a stop would be allowed to be */
    (void)room;
}

static void is_held_and_goes_on(int fd, void *room) {
    CHECK(next_word(fd) == HANDOVER_FOLLOWS);
    say(fd, HANDOVER_HOLD);
    say(fd, HANDOVER_RESUME);
    (void)room;
    pause();
}

static void is_given_up(int fd, void *room) {
    CHECK(next_word(fd) == HANDOVER_FOLLOWS);
    wait_for_the_end(fd, room);
}

static void ends(int fd, void *room) {
    CHECK(next_word(fd) == HANDOVER_FOLLOWS);
    (void)room;
}

/** A standby takes over from a process that has ended or is stalled, but not from one that closes
 *  its bus itself. */
static void a_standby_follows(void) {
    enum { LONG = 100000 };
    struct part part = with(lives_and_leaves);
    struct predecessor predecessor = found(&part, -1);
    CHECK(follow(&predecessor, LONG) == FSN_E_BUS_BUSY);
    end(&predecessor, false);
    part = with(ends);
    predecessor = found(&part, -1);
    CHECK(follow(&predecessor, LONG) == FSN_OK);
    CHECK(predecessor_kill(&predecessor, 0, NULL) == FSN_OK && predecessor.ended);
    end(&predecessor, false);
    part = with(is_held_and_ends);
    predecessor = found(&part, -1);
    struct pollfd held = {.fd = predecessor.fd, .events = POLLIN};
    CHECK(poll(&held, 1, 10000) == 1);
    CHECK(follow(&predecessor, LONG) == FSN_E_STATE);
    end(&predecessor, false);
    void (*const stopped[])(int fd, void *room) = {stands_still, is_held_and_goes_on};
    for (size_t i = 0; i < 2; i++) {
        part = with(stopped[i]);
        predecessor = found(&part, -1);
        CHECK(follow(&predecessor, LONG) == FSN_OK && !predecessor.ended);
        CHECK(predecessor_kill(&predecessor, 1, NULL) == FSN_OK && predecessor.ended);
        end(&predecessor, true);
    }
    part = with(is_given_up);
    predecessor = found(&part, -1);
    CHECK(follow(&predecessor, 2) == FSN_E_STATE); /* it is told to end itself */
    end(&predecessor, false);
}

static void says_that_it_ends(int fd, void *room) {
    CHECK(next_word(fd) == HANDOVER_END);
    show(room);
    say(fd, HANDOVER_ENDS);
}

/** Its connection ends with it, at once: a sanitizer takes long to end a process in order. */
static void ends_without_a_word(int fd, void *room) {
    CHECK(next_word(fd) == HANDOVER_END);
    (void)room;
    _exit(0);
}

static void says_it_and_stays(int fd, void *room) {
    says_that_it_ends(fd, room);
    pause();
}

/** Reads the requests, and sends nothing further. */
static void shuts_the_handover_listener(int fd, void *room) {
    shutdown(fd, SHUT_WR);
    (void)room;
    pause(); /* it closes the bus in its own time */
}

static void does_not_listen(int fd, void *room) {
    shutdown(fd, SHUT_RDWR);
    (void)room;
    pause();
}

/** A take-over asks, kills a process that does not answer, and leaves others unchanged. */
static void a_take_over_ends_the_predecessor(void) {
    static const struct {
        void (*part)(int fd, void *room);
        fsn_status status;
        bool killed;
    } parts[] = {{says_that_it_ends, FSN_OK, false},
                 {ends_without_a_word, FSN_OK, false},
                 {says_it_and_stays, FSN_OK, true},
                 {stands_still, FSN_OK, true},
                 {shuts_the_handover_listener, FSN_E_BUS_BUSY, false},
                 {does_not_listen, FSN_E_BUS_BUSY, false}};
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++) {
        struct part part = with(parts[i].part);
        struct predecessor predecessor = found(&part, -1);
        struct fsn_fault fault;
        if (parts[i].part == stands_still) {
            say(predecessor.fd, HANDOVER_FOLLOWS);
        }
        if (parts[i].status == FSN_E_BUS_BUSY) { /* before it is requested: however late it runs */
            struct pollfd polled = {.fd = predecessor.fd, .events = POLLIN};
            CHECK(poll(&polled, 1, 10000) == 1);
        }
        CHECK(predecessor_end(&predecessor, &fault) == parts[i].status);
        CHECK(predecessor.ended == (parts[i].status == FSN_OK));
        if (!predecessor.ended) {
            CHECK(kill(child, SIGTERM) == 0); /* it was left alone until now */
        }
        int status = 0;
        predecessor_release(&predecessor);
        close(listening);
        CHECK(waitpid(child, &status, 0) == child);
        /* A process that is about to end may be faster than the signal. */
        CHECK(parts[i].killed || !predecessor.ended ? WIFSIGNALED(status) : true);
        CHECK(!WIFSIGNALED(status) || WTERMSIG(status) == (predecessor.ended ? SIGKILL : SIGTERM));
    }
}

/** The outputs of the core before are the first ones of the next. */
static void goes_on_from_the_last_picture(void) {
    size_t len;
    uint8_t *bytes = build_full(&len);
    struct emulated_rig first = emulated_rig_load(bytes, len);
    bytes = build_full(&len);
    struct emulated_rig second = emulated_rig_load(bytes, len);
    const size_t room_bytes = fsn_core_room_bytes(first.core);
    CHECK(room_bytes <= ROOM_BYTES);
    struct predecessor predecessor = {.room_bytes = room_bytes};
    struct fsn_statistics last;
    predecessor.room =
        mmap(NULL, room_bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    CHECK(predecessor.room != MAP_FAILED && fsn_core_share(first.core, predecessor.room) == FSN_OK);
    for (int i = 0; i < 5; i++) {
        emulated_rig_cycle(&first);
    }
    CHECK(predecessor_continue(&predecessor, second.core, &last) == FSN_OK && last.cycles == 5);
    CHECK(fsn_core_last_cycle(second.core) == 5);
    predecessor.room_bytes--;
    CHECK(predecessor_continue(&predecessor, second.core, &last) == FSN_E_ARG);
    emulated_rig_end(&first);
    emulated_rig_end(&second);
    munmap(predecessor.room, room_bytes);
}

int main(void) {
    log_line(FSN_LOG_INFO, "the first line opens what the log keeps");
    const int files = open_files();
    plan = takeover_rig_plan();
    odd_answers_are_refused();
    only_a_standby_waits();
    a_standby_follows();
    a_take_over_ends_the_predecessor();
    goes_on_from_the_last_picture();
    fsn_plan_free(plan);
    CHECK(open_files() == files);
    return 0;
}
