/** Clients over sockets, at a time of the test's own: lines whole and too long, turns, clients that
 *  do not read, and how long to wait. */
#define _GNU_SOURCE

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "control_host.h"
#include "emulated_rig.h"

#define SECOND_NS UINT64_C(1000000000)

static uint64_t now_ns;
static int send_fails; /**< the next send() fails so, once */
static int recv_fails; /**< the next recv() of the server */
static int poll_fails; /**< the next poll() */
static int poll_ms;    /**< how long the last poll() was to wait */

int clock_gettime(clockid_t clock, struct timespec *now) {
    const uint64_t ns = clock == CLOCK_REALTIME ? 1700000000 * SECOND_NS : now_ns;
    *now = (struct timespec){.tv_sec = (time_t)(ns / SECOND_NS), .tv_nsec = (long)(ns % SECOND_NS)};
    return 0;
}

ssize_t send(int fd, const void *bytes, size_t size, int flags) {
    if (send_fails != 0) {
        errno = send_fails;
        send_fails = 0;
        return -1;
    }
    return sendto(fd, bytes, size, flags, NULL, 0);
}

ssize_t recv(int fd, void *bytes, size_t size, int flags) {
    if (recv_fails != 0) {
        errno = recv_fails;
        recv_fails = 0;
        return -1;
    }
    return recvfrom(fd, bytes, size, flags, NULL, NULL);
}

int poll(struct pollfd *fds, nfds_t count, int timeout_ms) {
    const struct timespec timeout = {.tv_nsec = timeout_ms * 1000000L};
    poll_ms = timeout_ms;
    if (poll_fails != 0) {
        errno = poll_fails;
        poll_fails = 0;
        return -1;
    }
    return ppoll(fds, count, &timeout, NULL);
}

static struct rig {
    struct emulated_rig on;
    struct fsn_control *control;
    int peer[3];
    struct pollfd fds[FSN_CONTROL_FDS];
    uint64_t wait_ns, cycle_ns;
    char logged[4096];
    unsigned events[FSN_ROLES]; /**< by account */
} rig;

static struct fsn_control_host host;

static void keep(void *self, enum fsn_log_level level, enum fsn_role account, const char *text,
                 const char *json, size_t json_bytes) {
    (void)self;
    rig.events[account]++;
    const size_t used = strlen(rig.logged);
    snprintf(rig.logged + used, sizeof rig.logged - used, "%c %s\n%.*s\n", "diwe"[level], text,
             (int)json_bytes, json);
}

static void state(void *self, struct fsn_control_status *status) {
    CHECK(self == &rig);
    *status = (struct fsn_control_status){.state = FSN_PROGRAM_RUNNING, .cycle_ns = rig.cycle_ns};
}

/** Clients 1 to `count`, each at the end of a socket. */
static void set_up(unsigned count) {
    static const struct build_sm sm[2][2] = {{{1, 8}, {2, 8}}, {{1, 8}, {2, 8}}};
    static const struct build_symbol symbols[] = {{.sm = 0, .bits = 32}};
    const struct build build = {
        .subdevices = 2, .sm = sm, .cycle_ns = 1000000, .symbols = symbols, .symbol_count = 1};
    rig = (struct rig){.on = emulated_rig_build(&build), .cycle_ns = 1000000};
    now_ns = 1000 * SECOND_NS;
    host = test_host(NULL);
    host.self = &rig;
    host.log = keep;
    host.status = state;
    rig.control = fsn_control_create(rig.on.plan, &host, &nobody);
    CHECK(rig.control != NULL);
    CHECK(rig.control->polled_ns == 0 && rig.control->last_number == 0);
    fsn_control_attach(rig.control, rig.on.core);
    for (unsigned i = 0; i < count; i++) {
        int ends[2];
        CHECK(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0);
        rig.peer[i] = ends[1];
        rig.control->client[i] = (struct fsn_client){.fd = ends[0],
                                                     .number = i + 1,
                                                     .role = FSN_MAINTAINER,
                                                     .peer.pid = 100 + (pid_t)i,
                                                     .lease_ms = 0,
                                                     .heard_ns = now_ns,
                                                     .moved_ns = now_ns,
                                                     .out.limit_bytes = FSN_CLIENT_OUT_BYTES};
    }
}

static void tear_down(unsigned count) {
    fsn_control_free(rig.control);
    for (unsigned i = 0; i < count; i++) {
        close(rig.peer[i]);
    }
    emulated_rig_end(&rig.on);
}

static void say(unsigned peer, const char *text) {
    CHECK(write(rig.peer[peer], text, strlen(text)) == (ssize_t)strlen(text));
}

static void turn(void) {
    const size_t count = fsn_control_prepare(rig.control, rig.fds, &rig.wait_ns);
    CHECK(count == FSN_CONTROL_FDS && rig.fds[0].fd == -1 && rig.fds[0].events == POLLIN);
    CHECK(poll(rig.fds, FSN_CONTROL_FDS, 0) >= 0);
    fsn_control_serve(rig.control, rig.fds, count);
}

/** Whole lines that a peer has received. */
static const char *heard(unsigned peer) {
    static char text[65536];
    const ssize_t got = recv(rig.peer[peer], text, sizeof text - 1, MSG_DONTWAIT);
    text[got > 0 ? got : 0] = 0;
    return text;
}

static unsigned lines_of(const char *text) {
    unsigned lines = 0;
    for (; *text != 0; text++) {
        lines += *text == '\n';
    }
    return lines;
}

#define EVENTS_OFF "{\"ok\":true,\"events\":false}\n"
#define TOO_LONG                                                                                   \
    "{\"ok\":false,\"error\":\"FSN_E_SPACE\",\"text\":\"a request has at most 8192 bytes\","       \
    "\"hint\":\"split it into several requests\"}\n"

static void lines_end_with_or_without_a_return(void) {
    set_up(1);
    say(0, "events off\r\nevents off\nevents");
    turn();
    CHECK(strcmp(heard(0), EVENTS_OFF EVENTS_OFF) == 0);
    say(0, " off\n\n");
    turn();
    CHECK(strncmp(heard(0), EVENTS_OFF "{\"ok\":false", sizeof EVENTS_OFF + 10) == 0);
    tear_down(1);
}

/** A line that is too long is refused once, for any remainder; then reading continues. */
static void long_lines_are_refused_once(void) {
    static char text[FSN_LINE_BYTES + 3];
    set_up(1);
    memset(text, 'x', FSN_LINE_BYTES);
    text[FSN_LINE_BYTES] = '\n';
    say(0, text);
    turn();
    CHECK(strstr(heard(0), "unknown request xxx") != NULL); /* just not too long */
    memset(text, 'x', FSN_LINE_BYTES + 1);
    text[FSN_LINE_BYTES + 1] = 0;
    say(0, text);
    turn();
    CHECK(strcmp(heard(0), TOO_LONG) == 0 && rig.control->client[0].skipping);
    say(0, text);
    turn();
    CHECK(heard(0)[0] == 0);
    say(0, "yy\nevents off\n");
    turn();
    CHECK(strcmp(heard(0), EVENTS_OFF) == 0 && !rig.control->client[0].skipping);
    tear_down(1);
}

/** Sixteen requests, then the next client has its turn; the rest is not waited for. */
static void clients_take_turns(void) {
    set_up(2);
    for (int i = 0; i < 40; i++) {
        say(0, "events off\n");
    }
    say(1, "events off\n");
    turn();
    CHECK(lines_of(heard(0)) == 16 && lines_of(heard(1)) == 1);
    CHECK(fsn_control_prepare(rig.control, rig.fds, &rig.wait_ns) > 0 && rig.wait_ns == 0);
    turn();
    CHECK(lines_of(heard(0)) == 16);
    turn();
    CHECK(lines_of(heard(0)) == 8);
    turn();
    CHECK(rig.wait_ns == 5000000 && heard(0)[0] == 0);
    tear_down(2);
}

static void how_long_to_wait(void) {
    set_up(2);
    turn();
    CHECK(rig.wait_ns == 5000000);
    rig.control->client[0].events = true;
    turn();
    CHECK(rig.wait_ns == 1000000); /* a cycle */
    rig.cycle_ns = 50000;
    turn();
    CHECK(rig.wait_ns == 100000);
    rig.cycle_ns = 100000;
    turn();
    CHECK(rig.wait_ns == 100000);
    rig.cycle_ns = 60000000;
    turn();
    CHECK(rig.wait_ns == 5000000);
    rig.cycle_ns = 1000000;
    rig.control->client[0].events = false;
    rig.control->client[0].stream.every = 3;
    rig.control->client[1].stream.every = 2;
    turn();
    CHECK(rig.wait_ns == 2000000);
    rig.control->client[0].stream.every = rig.control->client[1].stream.every = 0;
    fsn_control_attach(rig.control, NULL);
    turn();
    CHECK(rig.wait_ns == 100000000);
    tear_down(2);
}

static void who_leaves_is_dropped_quietly(void) {
    set_up(2);
    close(rig.peer[0]);
    rig.peer[0] = -1;
    turn();
    CHECK(rig.control->client[0].fd == -1 && rig.control->client[1].fd >= 0);
    CHECK(rig.logged[0] == 0);
    /* Nor is the end of a connection news while an answer is on its way. */
    fsn_client_put(&rig.control->client[1], "x\n", 2);
    send_fails = EPIPE;
    turn();
    CHECK(rig.control->client[1].fd == -1 && rig.logged[0] == 0);
    tear_down(2);
}

/** A send that is interrupted is tried again; one that would block waits for its time. */
static void what_is_not_taken_waits(void) {
    set_up(1);
    struct fsn_client *client = &rig.control->client[0];
    fsn_client_put(client, "one\n", 4);
    send_fails = EINTR;
    turn();
    CHECK(strcmp(heard(0), "one\n") == 0 && client->out.len_bytes == 0);
    fsn_client_put(client, "two\n", 4);
    send_fails = EAGAIN;
    turn();
    CHECK(heard(0)[0] == 0 && client->out.len_bytes == 4);
    (void)fsn_control_prepare(rig.control, rig.fds, &rig.wait_ns);
    CHECK(rig.fds[1].events == (POLLIN | POLLOUT));
    turn();
    CHECK(strcmp(heard(0), "two\n") == 0);
    (void)fsn_control_prepare(rig.control, rig.fds, &rig.wait_ns);
    CHECK(rig.fds[1].events == POLLIN && rig.fds[2].fd == -1);
    tear_down(1);
}

/** Five seconds in which nothing is read are the end; data sent before is received, not lost. */
static void who_does_not_read_is_dropped(void) {
    set_up(1);
    struct fsn_client *client = &rig.control->client[0];
    static char block[300000];
    memset(block, 'x', sizeof block);
    fsn_client_put(client, block, sizeof block);
    turn();
    CHECK(client->sent > 0 && client->sent < sizeof block && client->moved_ns == now_ns);
    const size_t left = sizeof block - client->sent;
    fsn_client_put(client, "end\n", 4);
    CHECK(client->sent == 0 && client->out.len_bytes == left + 4);
    now_ns += 5 * SECOND_NS;
    turn();
    CHECK(client->fd >= 0);
    now_ns += 1;
    turn();
    CHECK(client->fd == -1);
    CHECK(strcmp(rig.logged,
                 "w client 1, pid 100 (?), uid 0 (?) dropped: does not read\n"
                 "{\"event\":\"dropped\",\"utc\":\"2023-11-14T22:13:20.000000Z\","
                 "\"now_ns\":1005000000001,\"client\":1,\"pid\":100,\"uid\":0,\"user\":null,"
                 "\"program\":null,\"access\":\"maintainer\",\"why\":\"does not read\",\"times\":1,"
                 "\"level\":\"warning\",\"text\":\"client 1, pid 100 (?), uid 0 (?) dropped: "
                 "does not read\"}\n") == 0);
    tear_down(1);
}

/** More than a mebibyte unread is too much; one long answer does not count. */
static void there_is_a_limit_to_what_is_unread(void) {
    static char block[FSN_CLIENT_OUT_BYTES];
    set_up(3);
    memset(block, 'x', sizeof block);
    struct fsn_client *client = rig.control->client;
    fsn_client_put(&client[0], block, sizeof block);
    CHECK(client[0].drop_reason == NULL);
    fsn_client_put(&client[0], "x", 1);
    CHECK(strcmp(client[0].drop_reason, "does not read") == 0);
    fsn_client_put(&client[0], "x", 1);
    CHECK(client[0].out.len_bytes == sizeof block);
    fsn_client_put_long(&client[1], block, sizeof block);
    fsn_client_put(&client[1], block, sizeof block);
    CHECK(client[1].drop_reason == NULL && client[1].out.len_bytes == 2 * sizeof block);
    fsn_client_put(&client[1], "x", 1);
    CHECK(client[1].drop_reason != NULL);
    client[2].events = true;
    turn();
    CHECK(client[0].fd == -1 && client[1].fd == -1 && client[2].fd >= 0);
    CHECK(lines_of(heard(2)) == 2); /* the others are reported of both */
    tear_down(3);
}

/** A long answer after a longer one that was not read is one too many. */
static void long_answers_have_their_limit_one_by_one(void) {
    static char block[2 * FSN_CLIENT_OUT_BYTES];
    set_up(1);
    memset(block, 'x', sizeof block);
    struct fsn_client *client = rig.control->client;
    fsn_client_put_long(client, block, sizeof block);
    CHECK(client->drop_reason == NULL && client->out.len_bytes == sizeof block);
    fsn_client_put_long(client, block, 10);
    CHECK(strcmp(client->drop_reason, "does not read") == 0 &&
          client->out.len_bytes == sizeof block);
    tear_down(1);
}

/** Readable data ends for a moment, or permanently. */
static void reading_may_fail(void) {
    static const int passing[] = {EAGAIN, EINTR};
    set_up(2);
    for (int i = 0; i < 2; i++) {
        say(0, "events off\n");
        recv_fails = passing[i];
        turn();
        CHECK(recv_fails == 0 && rig.control->client[0].fd >= 0);
        turn();
        recv_fails = 0;
        CHECK(strcmp(heard(0), EVENTS_OFF) == 0);
    }
    say(0, "events off\n");
    recv_fails = ECONNRESET;
    turn();
    CHECK(rig.control->client[0].fd == -1 && rig.control->client[1].fd >= 0 && rig.logged[0] == 0);
    tear_down(2);
}

/** While a client waits for a job or for its turn, its lines are left where they are; who has gone
 *  meanwhile is not waited for. */
static void lines_wait_behind_a_job(void) {
    static struct fsn_job job;
    set_up(1);
    struct fsn_client *client = rig.control->client;
    client->job = &job;
    say(0, "events off\n");
    turn();
    CHECK(rig.fds[1].events == 0 && client->in_bytes == 0 && heard(0)[0] == 0);
    memset(client->in, 'x', FSN_LINE_BYTES + 1); /* came with the line of the job */
    client->in_bytes = FSN_LINE_BYTES + 1;
    turn();
    CHECK(!client->skipping && client->in_bytes == FSN_LINE_BYTES + 1 && heard(0)[0] == 0);
    client->job = NULL;
    turn();
    CHECK(client->skipping && client->in_bytes == 0 && strcmp(heard(0), TOO_LONG) == 0);
    client->skipping = false;
    client->job = &job;
    close(rig.peer[0]);
    turn();
    CHECK(client->fd == -1 && client->job == NULL && job.cancelled);
    rig.peer[0] = open("/dev/null", O_RDWR | O_CLOEXEC);
    tear_down(1);
}

/** Sixteen lines fill the buffer: nothing further fits until the next turn. */
static void a_full_buffer_waits_for_its_turn(void) {
    set_up(1);
    struct fsn_client *client = rig.control->client;
    for (int i = 0; i < 17; i++) {
        memcpy(client->in + 11 * i, "events off\n", 11);
    }
    memset(client->in + 11 * 17, ' ', FSN_LINE_BYTES + 1 - 11 * 17);
    client->in_bytes = FSN_LINE_BYTES + 1;
    close(rig.peer[0]);
    fsn_control_prepare(rig.control, rig.fds, &rig.wait_ns);
    CHECK(rig.fds[1].events == 0);
    rig.fds[1].revents = POLLHUP;
    fsn_control_serve(rig.control, rig.fds, 2);
    CHECK(client->fd == -1 && rig.logged[0] == 0); /* answered in vain */
    rig.peer[0] = open("/dev/null", O_RDWR | O_CLOEXEC);
    tear_down(1);
}

/** A client that is silent for longer than its lease loses its outputs, and is reported. */
static void leases_end(void) {
    set_up(1);
    struct fsn_client *client = &rig.control->client[0];
    say(0, "lease 200\nset t=5\n");
    turn();
    CHECK(lines_of(heard(0)) == 2 && client->lease_ms == 200);
    CHECK(strstr(rig.logged, "d client 1, pid 100 (?), uid 0 (?) writes 1 output\n") == rig.logged);
    rig.logged[0] = 0;
    now_ns += 200000000;
    turn();
    CHECK(rig.logged[0] == 0);
    now_ns += 1;
    turn();
    CHECK(strcmp(rig.logged,
                 "w client 1, pid 100 (?), uid 0 (?), silent: 1 output takes its stop value\n"
                 "{\"event\":\"fallback\",\"utc\":\"2023-11-14T22:13:20.000000Z\","
                 "\"now_ns\":1000200000001,\"client\":1,\"pid\":100,\"uid\":0,\"user\":null,"
                 "\"program\":null,\"access\":\"maintainer\",\"why\":\"silent\","
                 "\"outputs\":[\"t\"],\"level\":\"warning\",\"text\":\"client 1, pid 100 (?), uid "
                 "0 (?), "
                 "silent: 1 output takes its stop value\"}\n") == 0);
    turn();
    CHECK(strlen(rig.logged) < 440); /* reported once */
    tear_down(1);
}

/** Sends one request that is refused. */
static void refuse_one(unsigned peer) {
    rig.logged[0] = 0;
    say(peer, "arm none\n");
    turn();
    CHECK(lines_of(heard(peer)) == 1);
}

/** Refused requests of all connections of a user share one quota; granted ones have none. */
static void refused_requests_are_counted_by_user(void) {
    set_up(3);
    rig.control->client[2].peer.uid = 7;
    for (unsigned i = 0; i < FSN_QUOTA_AT_ONCE; i++) {
        refuse_one(i % 2);
        CHECK(strstr(rig.logged, "\"request\":\"arm\",\"arguments\":[\"none\"],\"error\":"
                                 "\"FSN_E_ARG\",\"times\":1,") != NULL);
    }
    refuse_one(0);
    refuse_one(1);
    CHECK(rig.logged[0] == 0 && rig.events[FSN_OBSERVER] == FSN_QUOTA_AT_ONCE);
    refuse_one(2);
    CHECK(strstr(rig.logged, "\"uid\":7,") != NULL);
    rig.logged[0] = 0;
    say(0, "start\n");
    turn();
    CHECK(strstr(rig.logged, "requests start\n") != NULL && rig.events[FSN_MAINTAINER] == 1);
    CHECK(lines_of(heard(0)) == 1);
    now_ns += FSN_QUOTA_S * SECOND_NS - 1;
    rig.logged[0] = 0;
    turn();
    CHECK(rig.logged[0] == 0);
    now_ns += 1;
    turn(); /* without another request */
    CHECK(strstr(rig.logged, "\"client\":2,\"pid\":101,\"uid\":0,") != NULL);
    CHECK(strstr(rig.logged, ": 2 more refused requests, the last one: arm\n") != NULL);
    CHECK(strstr(rig.logged, "\"error\":\"FSN_E_ARG\",\"times\":2,") != NULL);
    refuse_one(0);
    CHECK(rig.logged[0] == 0);
    fsn_control_flush(rig.control, 0); /* the program ends */
    CHECK(strstr(rig.logged, "\"times\":1,") != NULL);
    tear_down(3);
}

/** More users than there are quotas share the last one; a quota that is unused again is free. */
static void users_beyond_the_quotas_share_one(void) {
    set_up(1);
    struct fsn_client *client = &rig.control->client[0];
    for (unsigned i = 0; i < FSN_QUOTA_USERS + FSN_QUOTA_AT_ONCE + 5; i++) {
        client->peer.uid = 1000 + i;
        refuse_one(0);
        CHECK((rig.logged[0] != 0) == (i < FSN_QUOTA_USERS + FSN_QUOTA_AT_ONCE));
    }
    now_ns += FSN_QUOTA_S * SECOND_NS;
    client->peer.uid = 1; /* takes the row of another */
    for (unsigned i = 0; i < FSN_QUOTA_AT_ONCE + 1; i++) {
        refuse_one(0);
        CHECK((rig.logged[0] != 0) == (i < FSN_QUOTA_AT_ONCE));
    }
    tear_down(1);
}

static void dropped_connections_have_a_quota(void) {
    set_up(1);
    struct fsn_client client = rig.control->client[0];
    client.fd = -1;
    for (unsigned i = 0; i < FSN_QUOTA_AT_ONCE + 2; i++) {
        rig.logged[0] = 0;
        fsn_client_drop(&rig.control->services, &client, "does not read");
        CHECK((strstr(rig.logged, "\"event\":\"dropped\"") != NULL) == (i < FSN_QUOTA_AT_ONCE));
    }
    now_ns += FSN_QUOTA_S * SECOND_NS;
    turn();
    CHECK(strstr(rig.logged, "2 more dropped connections, the last one: does not read\n") != NULL);
    CHECK(strstr(rig.logged, "\"why\":\"does not read\",\"times\":2,") != NULL);
    tear_down(1);
}

/** Of the arguments of a refused request the event has the first bytes, whole characters. */
static void arguments_of_a_refused_request_are_cut(void) {
    char line[1200] = "set none ";
    set_up(1);
    for (int i = 0; i < 500; i++) {
        memcpy(line + strlen(line), "\303\251", 3);
    }
    memcpy(line + strlen(line), " last\n", 7);
    say(0, line);
    turn();
    char *cut = strstr(rig.logged, "\"arguments\":[\"none\",\"");
    CHECK(cut != NULL && strspn(cut + 21, "\303\251") == 252);
    CHECK(strncmp(cut + 21 + 252, "\"],\"arguments_cut\":752,", 23) == 0);
    tear_down(1);
}

/** An event that is too long is sent without its own keys. */
static void a_long_event_is_cut(void) {
    set_up(1);
    rig.control->services.events.json.limit_bytes = 250;
    refuse_one(0);
    CHECK(strstr(rig.logged, "\n{\"event\":\"request\",") != NULL);
    CHECK(strstr(rig.logged, "\"cut\":true,\"level\":\"warning\",\"text\":\"client 1") != NULL);
    tear_down(1);
}

/** At the end the remaining data is written, for a limited time. */
static void a_flush_waits_for_readers(void) {
    set_up(2);
    static char block[300000];
    memset(block, 'x', sizeof block);
    fsn_client_put(&rig.control->client[1], "bye\n", 4);
    fsn_control_flush(rig.control, 1000);
    CHECK(strcmp(heard(1), "bye\n") == 0);
    poll_ms = -5;
    fsn_control_flush(rig.control, 1000); /* nothing is left: no client is waited for */
    CHECK(poll_ms == -5);
    fsn_client_put(&rig.control->client[0], block, sizeof block);
    fsn_control_flush(rig.control, 0); /* without a reader, and without time */
    CHECK(rig.control->client[0].sent > 0 && rig.control->client[0].sent < sizeof block);
    const size_t before = rig.control->client[0].sent;
    poll_fails = EINTR;
    fsn_control_flush(rig.control, 1000); /* nor after a signal */
    CHECK(poll_fails == 0 && poll_ms == 1001 && rig.control->client[0].sent == before);
    tear_down(2);
}

int main(void) {
    close(STDIN_FILENO); /* 0 is a descriptor like any other */
    const int open_before = open_files();
    lines_end_with_or_without_a_return();
    long_lines_are_refused_once();
    clients_take_turns();
    how_long_to_wait();
    who_leaves_is_dropped_quietly();
    what_is_not_taken_waits();
    who_does_not_read_is_dropped();
    there_is_a_limit_to_what_is_unread();
    long_answers_have_their_limit_one_by_one();
    reading_may_fail();
    lines_wait_behind_a_job();
    a_full_buffer_waits_for_its_turn();
    leases_end();
    refused_requests_are_counted_by_user();
    users_beyond_the_quotas_share_one();
    dropped_connections_have_a_quota();
    arguments_of_a_refused_request_are_cut();
    a_long_event_is_cut();
    a_flush_waits_for_readers();
    CHECK(open_files() == open_before);
    return 0;
}
