/** Turns of the server: new clients, their lines, outgoing bytes. */
#define _GNU_SOURCE

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "control/base/clock.h"
#include "control/requests/client.h"
#include "control/requests/requests.h"
#include "control/server/server.h"

enum {
    OBSERVER_LINES = 2,    /**< the same for an observer */
    OBSERVERS_NS = 500000, /**< of a turn, for the requests of all observers */
    TURN_LINES = 16,       /**< requests of one client before the others are served */
    STALL_MS = 5000,       /**< a client that reads nothing for this time is dropped */
    IDLE_MS = 5000,        /**< a client without activity for this time makes room for another */
};

/** Answers the complete lines in the buffer, a few at a time. */
static void answer_lines(struct fsn_control *control, struct fsn_client *client) {
    /* Observers get fewer lines in a turn: a flood from them must not delay an operator. */
    const int most = client->role >= FSN_OPERATOR ? TURN_LINES : OBSERVER_LINES;
    size_t at = 0;
    client->more = false;
    for (int lines = 0; client->drop_reason == NULL && client->job == NULL; lines++) {
        char *line = client->in + at;
        const char *end = memchr(line, '\n', client->in_bytes - at);
        if (end == NULL) {
            break;
        }
        /* The rest is answered in the next turn, after the other clients. */
        if (lines == most) {
            client->more = true;
            break;
        }
        size_t len = (size_t)(end - line);
        at += len + 1;
        len -= len > 0 && line[len - 1] == '\r';
        /* The end of a line that was too long; its beginning was already refused. */
        if (client->skipping) {
            client->skipping = false;
            continue;
        }
        client->heard_ns = client->request_ns = fsn_now_ns();
        fsn_request_answer(&control->services, client, line, len);
    }
    client->in_bytes -= at;
    memmove(client->in, client->in + at, client->in_bytes);
    /* More than a line without an end can never become a request. */
    if (client->in_bytes > FSN_LINE_BYTES && !client->more && client->job == NULL) {
        if (!client->skipping) {
            struct fsn_refusal refusal;
            fsn_refusal_set(&refusal, FSN_E_SPACE, "split it into several requests",
                            "a request has at most %d bytes", FSN_LINE_BYTES);
            fsn_reply_refusal(client, NULL, &refusal);
        }
        client->skipping = true;
        client->in_bytes = 0;
    }
}

static void read_some(struct fsn_control *control, struct fsn_client *client) {
    const size_t room = FSN_LINE_BYTES + 1 - client->in_bytes;
    if (room == 0) {
        return;
    }
    const ssize_t got = recv(client->fd, client->in + client->in_bytes, room, MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) {
        return;
    }
    if (got <= 0) {
        fsn_client_end(&control->services, client);
        return;
    }
    client->in_bytes += (size_t)got;
}

/** Best effort: one short line into a socket that is empty or is never read. */
static void say_last(int fd, fsn_status status, const char *text, const char *hint) {
    char line[256];
    const int len = snprintf(line, sizeof line,
                             "{\"ok\":false,\"error\":\"%s\",\"text\":\"%s\",\"hint\":\"%s\"}\n",
                             fsn_status_name(status), text, hint);
    const ssize_t sent = send(fd, line, (size_t)len, MSG_NOSIGNAL | MSG_DONTWAIT);
    (void)sent;
}

/** Unread data of a client: requests, its end. */
static short unread(const struct fsn_client *client) {
    struct pollfd there = {.fd = client->fd, .events = POLLIN};
    return client->fd >= 0 && poll(&there, 1, 0) > 0 ? there.revents : 0;
}

/** Whether all places are in use, but one of their clients has disconnected: the next turn reads
 *  its remaining data and frees the place. */
static bool is_place_coming(const struct fsn_control *control) {
    bool gone = false;
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        if (control->client[i].fd < 0) {
            return false;
        }
        gone = gone || (unread(&control->client[i]) & POLLHUP) != 0;
    }
    return gone;
}

/** Whether a client may be dropped: it has no subscription, no request and no data to write. */
static bool is_idle(const struct fsn_control *control, const struct fsn_client *client) {
    return client->fd >= 0 && !client->events && client->stream.every == 0 && client->job == NULL &&
           client->in_bytes == 0 && client->sent == client->out.len_bytes && client->place == 0 &&
           !fsn_outputs_has(control->services.view.outputs, client->number) && unread(client) == 0;
}

/** The client that has been idle longest, and at least for this time; NULL: none. */
static struct fsn_client *idlest(struct fsn_control *control, uint64_t now_ns, uint64_t least_ns) {
    struct fsn_client *found = NULL;
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        struct fsn_client *client = &control->client[i];
        if (is_idle(control, client) && now_ns - client->request_ns >= least_ns &&
            (found == NULL || client->request_ns < found->request_ns)) {
            found = client;
        }
    }
    return found;
}

/** Number of shared places that the observers of a user have. */
static size_t places_of(const struct fsn_control *control, uid_t uid) {
    size_t count = 0;
    for (size_t i = 0; i < FSN_CONTROL_SHARED; i++) {
        const struct fsn_client *client = &control->client[i];
        count += client->fd >= 0 && client->role < FSN_OPERATOR && client->peer.uid == uid;
    }
    return count;
}

/** The newest observer of the user with most of the shared places, if that user has at least two
 *  more than the user `uid`; NULL: none. Therefore one user cannot occupy all of them. */
static struct fsn_client *surplus(struct fsn_control *control, uid_t uid) {
    struct fsn_client *found = NULL;
    size_t most = places_of(control, uid) + 1;
    for (size_t i = 0; i < FSN_CONTROL_SHARED; i++) {
        struct fsn_client *client = &control->client[i];
        if (client->fd < 0 || client->role >= FSN_OPERATOR) {
            continue;
        }
        const size_t count = places_of(control, client->peer.uid);
        if (count > most ||
            (count == most && found != NULL && client->peer.uid == found->peer.uid &&
             client->number > found->number)) {
            found = client;
            most = count;
        }
    }
    return found;
}

/** A place for a new client; NULL: none. Clients with write access have reserved places and need
 *  not wait until another client counts as idle. */
static struct fsn_client *make_room(struct fsn_control *control, enum fsn_role role, uid_t uid,
                                    uint64_t now_ns) {
    const bool first = role >= FSN_OPERATOR;
    const size_t places = first ? FSN_CONTROL_CLIENTS : FSN_CONTROL_SHARED;
    for (size_t i = 0; i < places; i++) {
        if (control->client[i].fd < 0) {
            return &control->client[i];
        }
    }
    struct fsn_client *client = idlest(control, now_ns, first ? 0 : IDLE_MS * UINT64_C(1000000));
    if (client != NULL) {
        say_last(client->fd, FSN_E_BUSY,
                 "dropped: silent, and its place was needed for another client",
                 "connect again when there is something to ask");
        fsn_client_drop(&control->services, client, "makes room");
        return client;
    }
    client = first ? NULL : surplus(control, uid);
    if (client != NULL) {
        say_last(client->fd, FSN_E_BUSY,
                 "dropped: this user has the most places, and another user needed one",
                 "close clients of this user");
        fsn_client_drop(&control->services, client, "has a place too many for its user");
    }
    return client;
}

/** Reports a user without permission to connect; all of them share one quota. */
static void report_turned_away(struct fsn_control *control, pid_t pid, uid_t uid) {
    const uint64_t now_ns = fsn_now_ns();
    struct fsn_peer peer;
    char who[FSN_PEER_TEXT_BYTES];
    control->turned_away++;
    if (!fsn_pace_allows(&control->turned_away_due_ns, now_ns, FSN_QUOTA_AT_ONCE,
                         FSN_QUOTA_S * UINT64_C(1000000000))) {
        return;
    }
    fsn_peer_read(&peer, pid, uid);
    struct fsn_events *events = &control->services.events;
    struct fsn_json *json = fsn_event_begin(events, "turned_away", now_ns);
    fsn_peer_put(&peer, json);
    fsn_json_put_u64(json, "times", control->turned_away);
    fsn_event_send(events, FSN_LOG_WARNING, "%s may not connect; tries since the last line: %u",
                   fsn_peer_text(&peer, who), (unsigned)control->turned_away);
    control->turned_away = 0;
}

/** Role of the peer process, from its credentials in the kernel; and its user. */
static enum fsn_role read_role(const struct fsn_control *control, int fd, struct ucred *peer) {
    enum { GROUPS = 256 }; /* more than any user has: otherwise only its primary group counts */
    gid_t group[1 + GROUPS];
    socklen_t size = sizeof *peer, group_bytes = GROUPS * sizeof *group;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, peer, &size) != 0) {
        return FSN_NO_ROLE;
    }
    group[0] = peer->gid;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, group + 1, &group_bytes) != 0) {
        group_bytes = 0;
    }
    return fsn_control_role(control->access, peer->uid, group, 1 + group_bytes / sizeof *group);
}

/** Accepts one waiting client; false if there is none. */
static bool accept_one(struct fsn_control *control) {
    const int fd = accept4(control->listener, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0) {
        return false;
    }
    struct ucred peer = {.pid = 0};
    const enum fsn_role role = read_role(control, fd, &peer);
    if (role == FSN_NO_ROLE) {
        report_turned_away(control, peer.pid, peer.uid);
        say_last(fd, FSN_E_CLOSED, "this user may not connect",
                 "start fsn-master with --allow-user or --allow-group");
        close(fd);
        return true;
    }
    const uint64_t now = fsn_now_ns();
    struct fsn_client *client = make_room(control, role, peer.uid, now);
    if (client == NULL) {
        say_last(fd, FSN_E_BUSY, "too many clients", "close one of them");
        close(fd);
        return true;
    }
    *client = (struct fsn_client){.fd = fd,
                                  .number = ++control->last_number,
                                  .role = role,
                                  .lease_ms = FSN_LEASE_MS,
                                  .heard_ns = now,
                                  .request_ns = now,
                                  .moved_ns = now,
                                  .out.limit_bytes = FSN_CLIENT_OUT_BYTES};
    fsn_peer_read(&client->peer, peer.pid, peer.uid);
    return true;
}

/** Events and cycles of the core are polled, because it cannot wake this thread. In every cycle if
 *  a client waits for them. */
static uint64_t next_poll_ns(const struct fsn_control *control) {
    enum { STOPPED_NS = 100000000, POLL_NS = 5000000, LEAST_NS = 100000 };
    if (control->services.view.core == NULL) {
        return STOPPED_NS;
    }
    uint64_t cycles = UINT64_MAX;
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        const struct fsn_client *client = &control->client[i];
        if (client->fd >= 0 && client->events) {
            cycles = 1;
        } else if (client->fd >= 0 && client->stream.every > 0 && client->stream.every < cycles) {
            cycles = client->stream.every;
        }
    }
    if (cycles == UINT64_MAX) {
        return POLL_NS;
    }
    const uint64_t wanted_ns = cycles * fsn_program_status(control->services.view.host).cycle_ns;
    if (wanted_ns < LEAST_NS) {
        return LEAST_NS;
    }
    return wanted_ns < POLL_NS ? wanted_ns : POLL_NS;
}

size_t fsn_control_prepare(struct fsn_control *control, struct pollfd *fds, uint64_t *wait_ns) {
    *wait_ns = next_poll_ns(control);
    control->polled_ns = fsn_now_ns();
    fds[0] = (struct pollfd){.fd = control->listener, .events = POLLIN};
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        const struct fsn_client *client = &control->client[i];
        /* While a job is in progress nothing is read, so that its answer precedes the next one. */
        short wanted = client->job == NULL && client->in_bytes <= FSN_LINE_BYTES ? POLLIN : 0;
        if (client->sent < client->out.len_bytes) {
            wanted = (short)(wanted | POLLOUT);
        }
        fds[i + 1] = (struct pollfd){.fd = client->fd, .events = wanted};
        *wait_ns = client->fd >= 0 && client->more ? 0 : *wait_ns;
    }
    return FSN_CONTROL_FDS;
}

static void serve_client(struct fsn_control *control, struct fsn_client *client, short found) {
    if ((found & (POLLERR | POLLNVAL)) != 0 || (client->job != NULL && (found & POLLHUP) != 0)) {
        fsn_client_end(&control->services, client);
        return;
    }
    if ((found & (POLLIN | POLLHUP)) != 0) {
        read_some(control, client);
    }
    if (client->fd >= 0) {
        answer_lines(control, client);
    }
}

/** Serves clients with write access first. The observers share the rest of a turn, and the next
 *  turn continues where this one ended: however many requests they send, they delay only each
 *  other. */
static void serve_clients(struct fsn_control *control, const struct pollfd *fds, size_t count) {
    int fd[FSN_CONTROL_CLIENTS]; /* a slot may be reused while this runs */
    bool first[FSN_CONTROL_CLIENTS];
    /* Clients with write access are served first and completely. */
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        fd[i] = control->client[i].fd;
        first[i] = control->client[i].role >= FSN_OPERATOR;
        if (i + 1 < count && first[i] && fds[i + 1].fd >= 0 && fds[i + 1].fd == fd[i]) {
            serve_client(control, &control->client[i], fds[i + 1].revents);
        }
    }
    const size_t begin = control->first_observer;
    const uint64_t end_ns = fsn_now_ns() + OBSERVERS_NS;
    for (size_t n = 0; n < FSN_CONTROL_CLIENTS; n++) {
        const size_t i = (begin + n) % FSN_CONTROL_CLIENTS;
        struct fsn_client *client = &control->client[i];
        if (first[i] || i + 1 >= count || fds[i + 1].fd < 0 || fds[i + 1].fd != fd[i] ||
            client->fd != fd[i]) {
            continue;
        }
        /* The time of observers is limited; the next turn begins with the one that was skipped. */
        if (n > 0 && fsn_now_ns() >= end_ns) {
            control->first_observer = i;
            return;
        }
        serve_client(control, client, fds[i + 1].revents);
    }
}

/** For a client in the cycle, cycles are counted. Any other client counts as silent if it had no
 *  unread data at the last poll: if this thread was delayed since then, data that arrived in the
 *  meantime have not been read yet. */
static bool is_silent(const struct fsn_control *control, const struct fsn_client *client) {
    const uint64_t lease_ns = client->lease_ms * UINT64_C(1000000);
    return client->lease_ms != 0 && !client->more && client->job == NULL && !client->begun &&
           control->polled_ns > client->heard_ns &&
           control->polled_ns - client->heard_ns > lease_ns;
}

/** Writes the bytes that a client accepts without waiting. */
static void send_some(struct fsn_control *control, struct fsn_client *client, uint64_t now_ns) {
    if (!fsn_client_send(client, now_ns)) {
        fsn_client_end(&control->services, client);
    }
}

static void check_silence(struct fsn_control *control, struct fsn_client *client, uint64_t now_ns) {
    if (is_silent(control, client)) {
        client->heard_ns = now_ns;
        fsn_client_take_back(&control->services, client, "silent");
    }
    if (client->sent < client->out.len_bytes &&
        now_ns - client->moved_ns > STALL_MS * UINT64_C(1000000)) {
        fsn_client_drop(&control->services, client, "does not read");
    }
}

void fsn_control_serve(struct fsn_control *control, const struct pollfd *fds, size_t count) {
    serve_clients(control, fds, count);
    /* Several at a time, so that a flood does not fill the queue for others; not all, for the same
     * reason. */
    bool waits = count > 0 && (fds[0].revents & POLLIN) != 0;
    for (int i = 0; waits && i < FSN_CONTROL_CLIENTS; i++) {
        waits = !is_place_coming(control) && accept_one(control);
    }
    struct fsn_services *services = &control->services;
    fsn_changes_poll(&control->changes, services->incidents, fsn_now_ns());
    fsn_incident_turn(services->incidents, fsn_now_ns());
    fsn_streams_serve(services);
    fsn_services_watch_cycle(services);
    fsn_services_report_counted(services, fsn_now_ns());
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        struct fsn_client *client = &control->client[i];
        const uint64_t now = fsn_now_ns();
        if (client->fd >= 0 && client->drop_reason != NULL) {
            fsn_client_drop(&control->services, client, client->drop_reason);
        }
        if (client->fd >= 0) {
            send_some(control, client, now);
        }
        if (client->fd >= 0) {
            check_silence(control, client, now);
        }
    }
}

void fsn_control_flush(struct fsn_control *control, int wait_ms) {
    fsn_services_report_counted(&control->services, UINT64_MAX);
    const uint64_t until = fsn_now_ns() + (uint64_t)wait_ms * 1000000u;
    for (;;) {
        struct pollfd fds[FSN_CONTROL_CLIENTS];
        nfds_t count = 0;
        for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
            struct fsn_client *client = &control->client[i];
            if (client->fd >= 0) {
                send_some(control, client, fsn_now_ns());
            }
            if (client->fd >= 0 && client->sent < client->out.len_bytes) {
                fds[count++] = (struct pollfd){.fd = client->fd, .events = POLLOUT};
            }
        }
        const uint64_t now = fsn_now_ns();
        if (count == 0 || now >= until ||
            poll(fds, count, (int)((until - now) / 1000000) + 1) < 0) {
            return;
        }
    }
}
