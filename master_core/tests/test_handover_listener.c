/** The side of a process that drives the bus: which peers may follow, for any message. */
#define _GNU_SOURCE

#include "app/takeover/handover_listener.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/log/log.h"
#include "app/takeover/handover.h"
#include "builder.h"
#include "control/base/clock.h"
#include "takeover_rig.h"

static struct fsn_plan *plan;
static struct options options = {.cycle_ns = 1000000, .dc_every = 10};
static struct handover_listener_facts facts;

struct takeover_rig {
    struct handover_listener handover_listener;
    int listening, room, listener;
};

static struct takeover_rig open_handover_listener(void) {
    struct takeover_rig rig = {.listening = takeover_rig_listen(),
                               .room = takeover_rig_memory(100)};
    rig.listener = takeover_rig_memory(1);
    facts = (struct handover_listener_facts){.options = &options, .plan = plan, .in_op = true};
    handover_listener_init(&rig.handover_listener);
    handover_listener_open(&rig.handover_listener, rig.listening);
    CHECK(rig.handover_listener.lock == rig.listening);
    return rig;
}

static void shut_handover_listener(struct takeover_rig *rig) {
    handover_listener_close(&rig->handover_listener);
    if (rig->handover_listener.successor >= 0) {
        close(rig->handover_listener.successor);
    }
    close(rig->listening);
    close(rig->room);
    close(rig->listener);
}

/** One turn of the control thread. */
static enum handover_listener_event turn(struct takeover_rig *rig) {
    struct pollfd fds[HANDOVER_LISTENER_FDS];
    handover_listener_prepare(&rig->handover_listener, fds);
    CHECK(poll(fds, HANDOVER_LISTENER_FDS, 5000) >= 0);
    return handover_listener_serve(&rig->handover_listener, fds, &facts);
}

static int knock(struct takeover_rig *rig) {
    const int fd = takeover_rig_connect(rig->listening);
    CHECK(turn(rig) == HANDOVER_LISTENER_NOTHING);
    return fd;
}

static struct handover_hello hello_of(void) {
    struct handover_hello hello = {.format = HANDOVER_FORMAT,
                                   .dc_every = options.dc_every,
                                   .cycle_ns = options.cycle_ns,
                                   .version = "1.2.3"};
    fsn_plan_sha256(plan, hello.plan);
    return hello;
}

static void say(int fd, uint32_t word) {
    CHECK(handover_send(fd, &word, sizeof word, NULL, 0));
}

static uint32_t heard(int fd) {
    uint32_t word = 0;
    CHECK(handover_receive(fd, &word, sizeof word, NULL) == 1);
    return word;
}

static struct handover_answer answer_at(int fd, int *fds) {
    struct handover_answer answer;
    CHECK(handover_receive(fd, &answer, sizeof answer, fds) == 1);
    CHECK(answer.format == HANDOVER_FORMAT);
    return answer;
}

/** Knocks, asks, and is given all there is. */
static int given(struct takeover_rig *rig) {
    const int fd = knock(rig);
    const struct handover_hello hello = hello_of();
    static const char known[] = "the state of the bus";
    struct handover_listener_gift gift = {.attachment = {.bytes = known,
                                                         .len_bytes = sizeof known,
                                                         .lock = rig->listening,
                                                         .held = {rig->listener},
                                                         .held_count = 1},
                                          .listener = rig->listener,
                                          .room = rig->room,
                                          .room_bytes = 100};
    int fds[HANDOVER_FDS];
    char read_back[sizeof known];
    CHECK(handover_send(fd, &hello, sizeof hello, NULL, 0));
    CHECK(turn(rig) == HANDOVER_LISTENER_REST &&
          !handover_listener_is_followed(&rig->handover_listener));
    CHECK(handover_listener_give(&rig->handover_listener, &gift) == HANDOVER_LISTENER_NOTHING &&
          handover_listener_is_followed(&rig->handover_listener));
    const struct handover_answer answer = answer_at(fd, fds);
    CHECK(answer.taken == 1 && answer.pid == getpid() && answer.room_bytes == 100);
    CHECK(answer.attachment_bytes == sizeof known && answer.text[0] == 0);
    CHECK(pread(fds[HANDOVER_ATTACHMENT], read_back, sizeof read_back, 0) == sizeof read_back);
    CHECK(memcmp(read_back, known, sizeof known) == 0);
    CHECK(!handover_has_ended(fds[HANDOVER_SELF], 0));
    for (size_t i = 0; i < HANDOVER_FDS; i++) {
        CHECK((fds[i] >= 0) == (i <= HANDOVER_HELD));
        if (fds[i] >= 0) {
            close(fds[i]);
        }
    }
    return fd;
}

static void refused(const struct handover_hello *hello, bool again, const char *text) {
    struct takeover_rig rig = open_handover_listener();
    const int fd = knock(&rig);
    char whole[HANDOVER_TEXT_BYTES];
    CHECK(handover_send(fd, hello, sizeof *hello, NULL, 0));
    CHECK(turn(&rig) == HANDOVER_LISTENER_NOTHING &&
          rig.handover_listener.state == HANDOVER_LISTENER_FREE);
    const struct handover_answer answer = answer_at(fd, NULL);
    snprintf(whole, sizeof whole, "process %d, 1.2.3: %s", (int)getpid(), text);
    CHECK(answer.taken == 0 && answer.again == again && strcmp(answer.text, whole) == 0);
    close(fd);
    shut_handover_listener(&rig);
}

/** An invalid request is refused with its reason, and only "not yet" may be retried. */
static void who_does_not_fit_is_refused(void) {
    struct handover_hello hello = hello_of();
    hello.format++;
    refused(&hello, false, "its handover protocol differs; stop the bus, and start that version");
    hello = hello_of();
    hello.plan[31] ^= 1;
    refused(&hello, false,
            "it has another plan; a take-over keeps the plan, another one needs a stop");
    static const char other[] =
        "it has another --cycle, --dc-every, --dc-clock or --dc-shift; they belong to the start "
        "of a bus";
    hello = hello_of();
    hello.cycle_ns++;
    refused(&hello, false, other);
    hello = hello_of();
    hello.dc_every++;
    refused(&hello, false, other);
    hello = hello_of();
    hello.dc_host = 1;
    refused(&hello, false, other);
    hello = hello_of();
    hello.dc_shift_ns++;
    refused(&hello, false, other);
    struct takeover_rig rig = open_handover_listener();
    const int fd = knock(&rig);
    facts.in_op = false;
    hello = hello_of();
    CHECK(handover_send(fd, &hello, sizeof hello, NULL, 0) &&
          turn(&rig) == HANDOVER_LISTENER_NOTHING);
    const struct handover_answer answer = answer_at(fd, NULL);
    CHECK(answer.again == 1 && strstr(answer.text, "try again when the bus is ready") != NULL);
    close(fd);
    shut_handover_listener(&rig);
}

/** From the first message to the handover; the standby gets its permissions. */
static void one_follows_and_takes_over(void) {
    struct takeover_rig rig = open_handover_listener();
    const int fd = given(&rig);
    handover_listener_hold(&rig.handover_listener,
                           true); /* it does not follow yet, and is told when it does */
    say(fd, HANDOVER_FOLLOWS);
    CHECK(turn(&rig) == HANDOVER_LISTENER_GO_ON &&
          rig.handover_listener.state == HANDOVER_LISTENER_FOLLOWED);
    CHECK(heard(fd) == HANDOVER_HOLD);
    handover_listener_hold(&rig.handover_listener, false);
    CHECK(heard(fd) == HANDOVER_RESUME);
    const int second = takeover_rig_connect(rig.listening);
    CHECK(turn(&rig) == HANDOVER_LISTENER_NOTHING);
    const struct handover_answer answer = answer_at(second, NULL);
    CHECK(answer.taken == 0 && answer.again == 1);
    CHECK(strstr(answer.text, "another one follows already, or has not ended yet") != NULL);
    close(second);
    shut_handover_listener(&rig);
    CHECK(heard(fd) == HANDOVER_LEAVES);
    close(fd);

    rig = open_handover_listener();
    const int taker = given(&rig);
    say(taker, HANDOVER_END);
    CHECK(turn(&rig) == HANDOVER_LISTENER_END);
    handover_listener_say_end(&rig.handover_listener);
    CHECK(heard(taker) == HANDOVER_ENDS);
    close(taker);
    shut_handover_listener(&rig);
}

/** After an invalid message or a disconnect the handover_listener accepts the next peer. */
static void who_leaves_makes_room(void) {
    struct takeover_rig rig = open_handover_listener();
    const int silent = knock(&rig);
    const int next = knock(&rig); /* the silent one makes room */
    CHECK(rig.handover_listener.state == HANDOVER_LISTENER_KNOCKS);
    close(next);
    CHECK(turn(&rig) == HANDOVER_LISTENER_NOTHING &&
          rig.handover_listener.state == HANDOVER_LISTENER_FREE);
    close(silent);

    const int odd = knock(&rig);
    say(odd, HANDOVER_END); /* not a first message */
    CHECK(turn(&rig) == HANDOVER_LISTENER_NOTHING &&
          rig.handover_listener.state == HANDOVER_LISTENER_FREE);
    close(odd);

    const struct handover_hello hello = hello_of();
    const int gone = knock(&rig);
    CHECK(handover_send(gone, &hello, sizeof hello, NULL, 0) &&
          turn(&rig) == HANDOVER_LISTENER_REST);
    close(gone);
    CHECK(turn(&rig) == HANDOVER_LISTENER_GO_ON &&
          rig.handover_listener.state == HANDOVER_LISTENER_FREE);
    CHECK(handover_listener_give(&rig.handover_listener,
                                 &(struct handover_listener_gift){.room = -1}) ==
          HANDOVER_LISTENER_GO_ON);

    const int liar = given(&rig);
    say(liar, 4711);
    CHECK(turn(&rig) == HANDOVER_LISTENER_GO_ON &&
          rig.handover_listener.state == HANDOVER_LISTENER_FREE);
    close(liar);
    shut_handover_listener(&rig);

    rig = open_handover_listener();
    const int standby = given(&rig);
    say(standby, HANDOVER_FOLLOWS);
    CHECK(turn(&rig) == HANDOVER_LISTENER_GO_ON);
    say(standby, HANDOVER_FOLLOWS); /* a second time */
    CHECK(turn(&rig) == HANDOVER_LISTENER_NOTHING &&
          rig.handover_listener.state == HANDOVER_LISTENER_FREE);
    close(standby);
    shut_handover_listener(&rig);
}

/** One that was given the lock and then does nothing does not hold the acyclic work for ever. */
static void who_does_nothing_is_left(void) {
    struct takeover_rig rig = open_handover_listener();
    const int fd = given(&rig);
    rig.handover_listener.given_ns -= UINT64_C(11000000000);
    struct pollfd fds[HANDOVER_LISTENER_FDS];
    handover_listener_prepare(&rig.handover_listener, fds);
    CHECK(handover_listener_serve(&rig.handover_listener, fds, &facts) == HANDOVER_LISTENER_GO_ON &&
          rig.handover_listener.state == HANDOVER_LISTENER_FREE);
    /* The peer has the lock, and may assume that it owns the bus: no other peer before its end. */
    const int next = knock(&rig);
    CHECK(rig.handover_listener.state == HANDOVER_LISTENER_FREE &&
          answer_at(next, NULL).again == 1);
    close(next);
    close(fd);
    shut_handover_listener(&rig);
}

/** A process that has ended makes room for the next one. */
static void who_has_ended_makes_room(void) {
    struct takeover_rig rig = open_handover_listener();
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        const struct handover_hello hello = hello_of();
        const int fd = takeover_rig_connect(rig.listening);
        _exit(handover_send(fd, &hello, sizeof hello, NULL, 0) ? 0 : 1);
    }
    CHECK(turn(&rig) == HANDOVER_LISTENER_NOTHING && turn(&rig) == HANDOVER_LISTENER_REST);
    struct handover_listener_gift gift = {
        .attachment = {.bytes = "", .len_bytes = 1, .lock = rig.listening},
        .listener = rig.listener,
        .room = rig.room};
    CHECK(waitpid(child, NULL, 0) == child);
    CHECK(handover_listener_give(&rig.handover_listener, &gift) == HANDOVER_LISTENER_GO_ON &&
          rig.handover_listener.successor >= 0);
    const int next = knock(&rig);
    CHECK(rig.handover_listener.state == HANDOVER_LISTENER_KNOCKS &&
          rig.handover_listener.successor < 0);
    close(next);
    shut_handover_listener(&rig);
}

/** Another user is refused; many tries are one line in the log. */
static void another_user_is_refused(void) {
    if (geteuid() != 0) {
        return; /* only root can be another one */
    }
    struct takeover_rig rig = open_handover_listener();
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        CHECK(setuid(65534) == 0);
        for (uint32_t i = 0; i < 2; i++) {
            struct handover_answer answer;
            const int fd = takeover_rig_connect(rig.listening);
            struct pollfd polled = {.fd = fd, .events = POLLIN};
            CHECK(poll(&polled, 1, 10000) == 1);
            CHECK(handover_receive(fd, &answer, sizeof answer, NULL) == 1 && answer.taken == 0);
            CHECK(answer.again == i);
            CHECK(strstr(answer.text, "must be of the same user or root") != NULL);
            close(fd);
        }
        _exit(0);
    }
    int status = 1;
    CHECK(turn(&rig) == HANDOVER_LISTENER_NOTHING && rig.handover_listener.away_ns != 0);
    rig.handover_listener.away_ns = fsn_now_ns(); /* however long the second one takes to come */
    CHECK(turn(&rig) == HANDOVER_LISTENER_NOTHING);
    CHECK(waitpid(child, &status, 0) == child && status == 0);
    CHECK(rig.handover_listener.state == HANDOVER_LISTENER_FREE);
    shut_handover_listener(&rig);
}

/** If the system has no descriptor left, the peer gets an answer, and the bus continues. */
static void no_descriptor_is_left(void) {
    struct takeover_rig rig = open_handover_listener();
    struct rlimit before;
    const int fd = knock(&rig);
    const struct handover_hello hello = hello_of();
    struct handover_listener_gift gift = {
        .attachment = {.bytes = "", .len_bytes = 1, .lock = rig.listening},
        .listener = rig.listener,
        .room = rig.room};
    CHECK(handover_send(fd, &hello, sizeof hello, NULL, 0) && turn(&rig) == HANDOVER_LISTENER_REST);
    CHECK(getrlimit(RLIMIT_NOFILE, &before) == 0);
    CHECK(setrlimit(RLIMIT_NOFILE, &(struct rlimit){.rlim_max = before.rlim_max}) == 0);
    CHECK(handover_listener_give(&rig.handover_listener, &gift) == HANDOVER_LISTENER_GO_ON &&
          rig.handover_listener.state == HANDOVER_LISTENER_FREE);
    CHECK(setrlimit(RLIMIT_NOFILE, &before) == 0);
    const struct handover_answer answer = answer_at(fd, NULL);
    CHECK(answer.taken == 0 && strstr(answer.text, "the system refused: Too many open") != NULL);
    close(fd);
    shut_handover_listener(&rig);
}

/** A bus without a lock cannot be handed over, and accepts no peer. */
static void without_a_lock_nobody_comes(void) {
    struct handover_listener handover_listener;
    struct pollfd fds[HANDOVER_LISTENER_FDS];
    const int no_socket = takeover_rig_memory(1);
    handover_listener_init(&handover_listener);
    handover_listener_open(&handover_listener, no_socket);
    CHECK(handover_listener.lock < 0);
    handover_listener_open(&handover_listener, -1);
    handover_listener_prepare(&handover_listener, fds);
    CHECK(fds[0].fd < 0 && fds[1].fd < 0);
    CHECK(handover_listener_serve(&handover_listener, fds, &facts) == HANDOVER_LISTENER_NOTHING);
    handover_listener_close(&handover_listener);
    close(no_socket);
}

int main(void) {
    log_line(FSN_LOG_INFO, "the first line opens what the log keeps");
    const int files = open_files();
    plan = takeover_rig_plan();
    who_does_not_fit_is_refused();
    one_follows_and_takes_over();
    who_leaves_makes_room();
    who_does_nothing_is_left();
    who_has_ended_makes_room();
    another_user_is_refused();
    no_descriptor_is_left();
    without_a_lock_nobody_comes();
    fsn_plan_free(plan);
    CHECK(open_files() == files);
    return 0;
}
