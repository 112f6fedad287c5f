#define _GNU_SOURCE

#include "control/requests/client.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "control/base/clock.h"
#include "plan/plan_internal.h"

void fsn_client_put(struct fsn_client *client, const char *bytes, size_t len_bytes) {
    struct fsn_json *out = &client->out;
    if (client->drop_reason != NULL) {
        return;
    }
    if (client->sent > 0) { /* a disconnected client needs no room */
        memmove(out->bytes, out->bytes + client->sent, out->len_bytes - client->sent);
        out->len_bytes -= client->sent;
        client->pass_at -= client->passes > 0 ? client->sent : 0;
        client->sent = 0;
    }
    if (out->len_bytes + len_bytes > FSN_CLIENT_OUT_BYTES + client->long_bytes) {
        client->drop_reason = "does not read";
        return;
    }
    if (len_bytes > out->room_bytes - out->len_bytes) {
        const size_t wanted = 2 * (out->len_bytes + len_bytes);
        char *room = realloc(out->bytes, wanted);
        if (room == NULL) {
            client->drop_reason = "no memory for it";
            return;
        }
        out->bytes = room;
        out->room_bytes = wanted;
    }
    memcpy(out->bytes + out->len_bytes, bytes, len_bytes);
    out->len_bytes += len_bytes;
}

void fsn_client_put_long(struct fsn_client *client, const char *bytes, size_t len_bytes) {
    client->long_bytes = len_bytes;
    fsn_client_put(client, bytes, len_bytes);
}

void fsn_client_pass(struct fsn_client *client, const int *fds, unsigned count) {
    client->pass_at = client->out.len_bytes;
    for (client->passes = 0; client->passes < count; client->passes++) {
        client->pass[client->passes] = fds[client->passes];
    }
}

void fsn_client_close_passed(struct fsn_client *client) {
    while (client->passes > 0) {
        close(client->pass[--client->passes]);
    }
}

/** Sends some of the queued bytes; descriptors go with the first byte after `pass_at`. */
static ssize_t send_some(struct fsn_client *client) {
    const bool before = client->passes > 0 && client->sent < client->pass_at;
    const size_t end = before ? client->pass_at : client->out.len_bytes;
    struct iovec piece = {client->out.bytes + client->sent, end - client->sent};
    if (client->passes == 0 || before) {
        return send(client->fd, piece.iov_base, piece.iov_len, MSG_NOSIGNAL | MSG_DONTWAIT);
    }
    union {
        struct cmsghdr head;
        char room[CMSG_SPACE(FSN_CLIENT_FDS * sizeof(int))];
    } control = {0};
    const size_t fds_bytes = client->passes * sizeof *client->pass;
    control.head = (struct cmsghdr){
        .cmsg_len = CMSG_LEN(fds_bytes), .cmsg_level = SOL_SOCKET, .cmsg_type = SCM_RIGHTS};
    memcpy(CMSG_DATA(&control.head), client->pass, fds_bytes);
    const struct msghdr message = {.msg_iov = &piece,
                                   .msg_iovlen = 1,
                                   .msg_control = &control,
                                   .msg_controllen = CMSG_SPACE(fds_bytes)};
    const ssize_t sent = sendmsg(client->fd, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent > 0) {
        fsn_client_close_passed(client);
    }
    return sent;
}

bool fsn_client_send(struct fsn_client *client, uint64_t now_ns) {
    while (client->sent < client->out.len_bytes) {
        const ssize_t sent = send_some(client);
        if (sent < 0 && errno == EINTR) {
            continue;
        }
        if (sent < 0 && errno == EAGAIN) {
            return true;
        }
        if (sent < 0) {
            return false;
        }
        client->sent += (size_t)sent;
        client->moved_ns = now_ns;
    }
    fsn_json_free(&client->out);
    client->sent = 0;
    client->long_bytes = 0;
    client->moved_ns = now_ns;
    return true;
}

static void put_who(uint32_t number, const struct fsn_peer *peer, enum fsn_role role,
                    struct fsn_json *json) {
    fsn_json_put_u64(json, "client", number);
    fsn_peer_put(peer, json);
    fsn_json_put_text(json, "access", fsn_role_name(role));
}

void fsn_client_put_peer(const struct fsn_client *client, struct fsn_json *json) {
    put_who(client->number, &client->peer, client->role, json);
}

struct fsn_cause fsn_client_cause(const struct fsn_client *client, const char *what,
                                  fsn_status status) {
    return (struct fsn_cause){.peer = client->peer,
                              .role = client->role,
                              .client = client->number,
                              .what = what,
                              .status = status};
}

/** Reports the last cause, with the number of counted ones. */
static void report_counted(struct fsn_services *services, enum fsn_quota_kind kind,
                           const struct fsn_cause *last, uint32_t times) {
    const bool refused = kind == FSN_QUOTA_REFUSED;
    struct fsn_events *events = &services->events;
    char who[FSN_PEER_TEXT_BYTES];
    struct fsn_json *json = fsn_event_begin(events, refused ? "request" : "dropped", fsn_now_ns());
    put_who(last->client, &last->peer, last->role, json);
    fsn_json_put_text(json, refused ? "request" : "why", last->what);
    if (refused) {
        fsn_json_put_text(json, "error", fsn_status_name(last->status));
    }
    fsn_json_put_u64(json, "times", times);
    fsn_event_send(events, FSN_LOG_WARNING, "%s: %u more %s, the last one: %s",
                   fsn_peer_text(&last->peer, who), (unsigned)times,
                   refused ? "refused requests" : "dropped connections", last->what);
}

void fsn_services_report_counted(struct fsn_services *services, uint64_t now_ns) {
    for (enum fsn_quota_kind kind = 0; kind < FSN_QUOTA_KINDS; kind++) {
        const struct fsn_cause *last;
        uint32_t times;
        while ((last = fsn_quota_left(&services->quotas, kind, now_ns, &times)) != NULL) {
            report_counted(services, kind, last, times);
        }
    }
}

const char *fsn_client_text(const struct fsn_client *client, char room[FSN_CLIENT_TEXT_BYTES]) {
    char who[FSN_PEER_TEXT_BYTES];
    snprintf(room, FSN_CLIENT_TEXT_BYTES, "client %u, %s", (unsigned)client->number,
             fsn_peer_text(&client->peer, who));
    return room;
}

/** Adds the name of an output that fell back to the event being written. */
static void add_output(void *self, uint32_t symbol) {
    struct fsn_services *services = self;
    fsn_json_text(&services->events.json, fsn_known_symbol(services->view.plan, symbol).name);
}

/** Removes a client from the cycle; its outputs already have their stop values. */
static void leave_cycle(struct fsn_services *services, struct fsn_client *client) {
    if (client->place != 0) {
        fsn_core_client_close(services->view.core, client->place - 1);
        client->place = 0;
        client->begun = false;
    }
}

void fsn_client_take_back(struct fsn_services *services, struct fsn_client *client,
                          const char *why) {
    struct fsn_json *json = fsn_event_begin_act(&services->events, "fallback", client->role);
    char who[FSN_CLIENT_TEXT_BYTES];
    fsn_client_put_peer(client, json);
    fsn_json_put_text(json, "why", why);
    fsn_json_put_open(json, "outputs", '[');
    const size_t taken =
        fsn_outputs_take_back(services->view.outputs, client->number, add_output, services);
    leave_cycle(services, client);
    fsn_json_close(json, ']');
    if (taken > 0) {
        fsn_event_send(&services->events, FSN_LOG_WARNING, "%s, %s: %zu output%s stop value%s",
                       fsn_client_text(client, who), why, taken,
                       taken == 1 ? " takes its" : "s take their", taken == 1 ? "" : "s");
    }
}

void fsn_services_close_outputs(struct fsn_services *services) {
    struct fsn_json *json = fsn_event_begin_act(&services->events, "fallback", FSN_MAINTAINER);
    fsn_json_put_text(json, "why", "stop");
    fsn_json_put_open(json, "outputs", '[');
    fsn_outputs_close(services->view.outputs, add_output, services);
    for (size_t i = 0; i < services->clients; i++) {
        leave_cycle(services, &services->client[i]);
    }
    fsn_json_close(json, ']');
    fsn_event_send(&services->events, FSN_LOG_INFO, "outputs have their stop values");
}

void fsn_services_watch_cycle(struct fsn_services *services) {
    for (size_t i = 0; i < services->clients; i++) {
        struct fsn_client *client = &services->client[i];
        if (client->place != 0 &&
            fsn_core_client_seen(services->view.core, client->place - 1).state == FSN_SHARED_LATE) {
            fsn_client_take_back(services, client, "late");
        }
    }
}

static void report_dropped(struct fsn_services *services, const struct fsn_client *client,
                           const char *why) {
    const uint64_t now_ns = fsn_now_ns();
    const struct fsn_cause cause = fsn_client_cause(client, why, FSN_OK);
    const uint32_t times = fsn_quota_take(&services->quotas, FSN_QUOTA_DROPPED, &cause, now_ns);
    if (times > 0) {
        struct fsn_json *json = fsn_event_begin(&services->events, "dropped", now_ns);
        char who[FSN_CLIENT_TEXT_BYTES];
        fsn_client_put_peer(client, json);
        fsn_json_put_text(json, "why", why);
        fsn_json_put_u64(json, "times", times);
        fsn_event_send(&services->events, FSN_LOG_WARNING, "%s dropped: %s",
                       fsn_client_text(client, who), why);
    }
}

static void close_client(struct fsn_client *client) {
    close(client->fd);
    client->fd = -1;
    client->events = false;
    if (client->job != NULL) { /* no client waits for its answer */
        atomic_store(&client->job->cancelled, true);
        client->job = NULL;
    }
    fsn_json_free(&client->out);
    fsn_stream_end(client);
    fsn_client_close_passed(client);
    client->sent = 0;
}

void fsn_client_end(struct fsn_services *services, struct fsn_client *client) {
    close_client(client);
    fsn_client_take_back(services, client, "disconnected");
}

void fsn_client_drop(struct fsn_services *services, struct fsn_client *client, const char *why) {
    /* Closed first, so that it is not informed about its own end. */
    close_client(client);
    report_dropped(services, client, why);
    fsn_client_take_back(services, client, why);
}
