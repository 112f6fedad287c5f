#include "control/requests/requests.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "control/base/clock.h"
#include "control/base/names.h"
#include "control/base/value.h"
#include "control/reports/reports.h"
#include "control/requests/request.h"
#include "fsn/version.h"

enum {
    ARGUMENT_BYTES = 256,   /**< of the arguments of a refused request in its event */
    PAGE_BYTES = 128 * 1024 /**< of a report, after which the next page begins */
};

/** One request of the protocol. */
struct entry {
    const char *name;
    enum fsn_role role;                          /**< required role */
    size_t least, most;                          /**< number of arguments */
    fsn_answer_fn answer;                        /**< NULL: a job answers later */
    enum { READS, CHANGES, REFUSED_ONLY } event; /**< which of them become events */
    const char *usage;
};

static fsn_status hello(struct fsn_request *request) {
    struct fsn_json *json = request->json;
    fsn_json_put_text(json, "program", "fsn-master");
    fsn_json_put_u64(json, "protocol", FSN_CONTROL_PROTOCOL);
    fsn_json_put_text(json, "version", fsn_version());
    fsn_json_put_u64(json, "client", request->client->number);
    fsn_json_put_text(json, "access", fsn_role_name(request->client->role));
    fsn_json_put_u64(json, "lease_ms", request->client->lease_ms);
    fsn_json_put_text(json, "role",
                      "part of the black channel: moves FSoE frames whole and unchanged; no safety "
                      "function, not certified; stop is not an emergency stop");
    return FSN_OK;
}

static fsn_status status(struct fsn_request *request) {
    struct fsn_services *services = request->services;
    uint32_t clients = 0;
    for (size_t i = 0; i < services->clients; i++) {
        clients += services->client[i].fd >= 0;
    }
    fsn_report_status(&services->view, clients, request->json);
    fsn_report_realtime(services, request->json);
    return FSN_OK;
}

typedef fsn_status (*report_fn)(struct fsn_bus_view *view, struct fsn_page *page,
                                struct fsn_json *json);

/** Answers one page of a report: from the row in the argument on, with the next row as `next`. */
static fsn_status paged(struct fsn_request *request, report_fn report) {
    uint64_t first = 0;
    if (request->count > 0 && fsn_value_parse_number(request->argument[0], 32, &first) != NULL) {
        return fsn_request_refuse(request, FSN_E_ARG, "the previous page gives it as next",
                                  "the first row of a page is a number");
    }
    struct fsn_page page = {.first = (uint32_t)first, .limit_bytes = PAGE_BYTES};
    const fsn_status found = report(&request->services->view, &page, request->json);
    if (found == FSN_E_STATE) {
        return fsn_request_refuse(request, found, "send start first", "the bus is stopped");
    }
    if (found != FSN_OK) {
        return fsn_request_refuse(request, found, "ask again", "no stable picture of a cycle");
    }
    if (page.next != 0) {
        fsn_json_put_u64(request->json, "next", page.next);
    }
    return FSN_OK;
}

static fsn_status snapshot(struct fsn_request *request) {
    return paged(request, fsn_report_snapshot);
}

static fsn_status layout(struct fsn_request *request) {
    return paged(request, fsn_report_layout);
}

static fsn_status subdevices(struct fsn_request *request) {
    return paged(request, fsn_report_subdevices);
}

static fsn_status symbols(struct fsn_request *request) {
    return paged(request, fsn_report_symbols);
}

/** The words of a request on one line, as far as they fit. */
static const char *request_text(const struct fsn_request *request, char *room, size_t room_bytes) {
    size_t used = (size_t)snprintf(room, room_bytes, "%.30s", request->name);
    for (size_t i = 0; i < request->count && used + 1 < room_bytes; i++) {
        used += (size_t)snprintf(room + used, room_bytes - used, " %s", request->argument[i]);
    }
    return room;
}

/** Adds the arguments; of a refused request only their first bytes. */
static void put_arguments(const struct fsn_request *request, size_t most, struct fsn_json *json) {
    size_t left_out = 0;
    fsn_json_put_open(json, "arguments", '[');
    for (size_t i = 0; i < request->count; i++) {
        const size_t whole = strlen(request->argument[i]);
        const size_t len = whole < most ? whole : fsn_utf8_cut(request->argument[i], most);
        if (left_out == 0) {
            fsn_json_chars(json, request->argument[i], len);
        }
        most -= len;
        left_out += whole - len;
    }
    fsn_json_close(json, ']');
    if (left_out > 0) {
        fsn_json_put_u64(json, "arguments_cut", left_out);
    }
}

/** Reports a request that changes something, or would have. A refused one is reported as often as
 *  its user may cause events; otherwise it is counted. */
static void report(struct fsn_request *request, const char *name, bool refused) {
    struct fsn_client *client = request->client;
    struct fsn_events *events = &request->services->events;
    char who[FSN_CLIENT_TEXT_BYTES];
    char words[200];
    uint32_t times = 0;
    if (refused) {
        const struct fsn_cause cause = fsn_client_cause(client, name, request->refusal.status);
        times = fsn_quota_take(&request->services->quotas, FSN_QUOTA_REFUSED, &cause, fsn_now_ns());
        if (times == 0) {
            return;
        }
    }
    struct fsn_json *json =
        fsn_event_begin_act(events, "request", refused ? FSN_OBSERVER : client->role);
    fsn_client_put_peer(client, json);
    fsn_json_put_text(json, "request", name);
    put_arguments(request, refused ? ARGUMENT_BYTES : FSN_LINE_BYTES, json);
    fsn_json_put_text(json, "error", refused ? fsn_status_name(request->refusal.status) : NULL);
    if (refused) {
        fsn_json_put_u64(json, "times", times);
    }
    fsn_event_send(events, refused ? FSN_LOG_WARNING : FSN_LOG_INFO, "%s requests %s%s%s",
                   fsn_client_text(client, who), request_text(request, words, sizeof words),
                   refused ? ", refused: " : "", refused ? request->refusal.text : "");
}

static fsn_status lease(struct fsn_request *request) {
    uint64_t ms;
    if (fsn_value_parse_number(request->argument[0], 32, &ms) != NULL || ms > FSN_LEASE_MAX_MS) {
        return fsn_request_refuse(request, FSN_E_ARG, "0 lets it end with the connection only",
                                  "a lease has 0 to 600000 ms");
    }
    request->client->lease_ms = (uint32_t)ms;
    fsn_json_put_u64(request->json, "lease_ms", ms);
    return FSN_OK;
}

static fsn_status events(struct fsn_request *request) {
    const bool on = strcmp(request->argument[0], "on") == 0;
    if (!on && strcmp(request->argument[0], "off") != 0) {
        return fsn_request_refuse(request, FSN_E_ARG, NULL, "events on or events off");
    }
    request->client->events = on;
    fsn_json_put_bool(request->json, "events", on);
    return FSN_OK;
}

static fsn_status of_program(struct fsn_request *request) {
    static const char *const names[] = {
        [FSN_PROGRAM_START] = "start",     [FSN_PROGRAM_STOP] = "stop",
        [FSN_PROGRAM_RESTART] = "restart", [FSN_PROGRAM_SHUTDOWN] = "shutdown",
        [FSN_PROGRAM_HOLD] = "hold",       [FSN_PROGRAM_RESUME] = "resume"};
    const struct fsn_control_host *host = request->services->view.host;
    unsigned wanted = 0;
    while (strcmp(names[wanted], request->name) != 0) {
        wanted++;
    }
    const fsn_status found =
        host->request(host->self, (enum fsn_program_request)wanted, &request->refusal);
    if (found == FSN_OK) {
        /* Events report the progress. */
        const enum fsn_program_state state = fsn_program_status(host).state;
        fsn_json_put_text(request->json, "state", fsn_program_state_name(state));
    }
    return found;
}

static fsn_status incident(struct fsn_request *request) {
    const char *text = request->count > 0 ? request->argument[0] : "a client requested it";
    const struct fsn_trigger trigger = {
        .kind = FSN_REQUESTED, .now_ns = fsn_now_ns(), .text = text};
    if (request->services->incidents == NULL) {
        return fsn_request_refuse(request, FSN_E_STATE, "start fsn-master with --incidents FOLDER",
                                  "no incidents are kept");
    }
    if (!fsn_incident_begin(request->services->incidents, &trigger)) {
        return fsn_request_refuse(request, FSN_E_BUSY,
                                  "ask again in a few seconds; its event names the file",
                                  "an incident is being kept, or a hundred were");
    }
    fsn_json_put_bool(request->json, "begun", true);
    return FSN_OK;
}

static fsn_status help(struct fsn_request *request);

static const struct entry requests[] = {
    {"hello", FSN_OBSERVER, 0, 0, hello, READS,
     "hello: version of protocol and program, your client number"},
    {"status", FSN_OBSERVER, 0, 0, status, READS,
     "status: state of the program and of the bus, short"},
    {"snapshot", FSN_OBSERVER, 0, 1, snapshot, READS,
     "snapshot [ROW]: statistics, connections and SubDevices in full"},
    {"subdevices", FSN_OBSERVER, 0, 1, subdevices, READS,
     "subdevices [ROW]: what is known about each SubDevice"},
    {"symbols", FSN_OBSERVER, 0, 1, symbols, READS,
     "symbols [ROW]: named inputs and outputs, and who writes them"},
    {"get", FSN_OBSERVER, 1, FSN_WORDS, fsn_answer_get, READS,
     "get [--typed] NAME…: values of one cycle"},
    {"layout", FSN_OBSERVER, 0, 1, layout, READS, "layout [ROW]: the layout of the process image"},
    {"set", FSN_OPERATOR, 1, FSN_WORDS, fsn_answer_set, REFUSED_ONLY,
     "set [--typed] NAME=VALUE…: all or none; yours until your lease ends"},
    {"lease", FSN_OBSERVER, 1, 1, lease, READS,
     "lease MS: silence after which your outputs fall back; 0: never"},
    {"arm", FSN_OPERATOR, 1, 1, fsn_answer_arm, REFUSED_ONLY,
     "arm NAME: allows one edge of an output that can restart a machine"},
    {"events", FSN_OBSERVER, 1, 1, events, READS, "events on|off: every change as a line of JSON"},
    {"incident", FSN_OPERATOR, 0, 1, incident, READS,
     "incident [TEXT]: keeps the last seconds in a file"},
    {"watch", FSN_OBSERVER, 1, FSN_WORDS, fsn_answer_watch, READS,
     "watch N|off [--image|--typed] [NAME…]: every N-th cycle as a line of JSON; NAME may end in "
     "*"},
    {"realtime", FSN_OPERATOR, 1, FSN_WORDS, fsn_answer_realtime, CHANGES,
     "realtime LAYOUT PLAN|any MISSES [NAME…], then realtime begin: inputs and own outputs in "
     "shared memory"},
    {"start", FSN_MAINTAINER, 0, 0, of_program, CHANGES,
     "start: opens the bus and brings it to OP"},
    {"stop", FSN_MAINTAINER, 0, 0, of_program, CHANGES,
     "stop: stop values, SAFEOP, bus closed; no emergency stop"},
    {"restart", FSN_MAINTAINER, 0, 0, of_program, CHANGES, "restart: stop, then start"},
    {"shutdown", FSN_MAINTAINER, 0, 0, of_program, CHANGES,
     "shutdown: stop, then the end of the program"},
    {"hold", FSN_MAINTAINER, 0, 0, of_program, CHANGES,
     "hold: maintenance, a standby takes nothing over"},
    {"resume", FSN_MAINTAINER, 0, 0, of_program, CHANGES, "resume: a standby takes over again"},
    {"sdo-read", FSN_MAINTAINER, 3, 4, NULL, READS,
     "sdo-read SUBDEVICE INDEX SUB [TYPE]: an object of a SubDevice"},
    {"sdo-write", FSN_MAINTAINER, 5, 5, NULL, CHANGES,
     "sdo-write SUBDEVICE INDEX SUB TYPE VALUE: no safety objects"},
    {"sii-read", FSN_MAINTAINER, 1, 1, NULL, READS, "sii-read SUBDEVICE: its SII, in hex"},
    {"alias-write", FSN_MAINTAINER, 2, 2, NULL, CHANGES,
     "alias-write SUBDEVICE ALIAS: used after its next power-on"},
    {"history", FSN_OPERATOR, 1, 1, NULL, READS, "history SUBDEVICE: its diagnosis messages"},
    {"scan", FSN_OPERATOR, 0, 0, NULL, READS, "scan: all SubDevices on the bus, planned or not"},
    {"help", FSN_OBSERVER, 0, 0, help, READS, "help: this list"},
};
enum { REQUESTS = sizeof requests / sizeof requests[0] };

static fsn_status help(struct fsn_request *request) {
    fsn_json_put_open(request->json, "requests", '[');
    for (size_t i = 0; i < REQUESTS; i++) {
        fsn_json_text(request->json, requests[i].usage);
    }
    fsn_json_close(request->json, ']');
    return FSN_OK;
}

static void begin(struct fsn_json *json, const char *tag, bool ok) {
    fsn_json_open(json, '{');
    fsn_json_put_bool(json, "ok", ok);
    if (tag != NULL) {
        fsn_json_put_text(json, "tag", tag);
    }
}

/** Ends a reply. If there is no memory for it, the client must not wait in vain. */
static void finish(struct fsn_client *client, struct fsn_json *json) {
    fsn_json_close(json, '}');
    fsn_json_end(json);
    if (json->failed != FSN_OK) {
        client->drop_reason = "no memory for it";
        return;
    }
    fsn_client_put(client, json->bytes, json->len_bytes);
}

void fsn_reply_refusal(struct fsn_client *client, const char *tag,
                       const struct fsn_refusal *refusal) {
    struct fsn_json json = {.limit_bytes = FSN_CLIENT_OUT_BYTES};
    begin(&json, tag, false);
    fsn_json_put_text(&json, "error", fsn_status_name(refusal->status));
    fsn_json_put_text(&json, "text", refusal->text);
    if (refusal->hint != NULL) {
        fsn_json_put_text(&json, "hint", refusal->hint);
    }
    finish(client, &json);
    fsn_json_free(&json);
}

static const struct entry *find_request(const char *name) {
    for (size_t i = 0; i < REQUESTS; i++) {
        if (strcmp(requests[i].name, name) == 0) {
            return &requests[i];
        }
    }
    return NULL;
}

static fsn_status role_is_too_low(struct fsn_request *request, enum fsn_role least) {
    static const char *const hint[FSN_ROLES] = {
        [FSN_OPERATOR] = "fsn-master --allow-user NAME:operator permits it",
        [FSN_MAINTAINER] = "fsn-master --allow-user NAME:maintainer permits it"};
    return fsn_request_refuse(request, FSN_E_CLOSED, hint[least],
                              "only for the role %s; this client is %s", fsn_role_name(least),
                              fsn_role_name(request->client->role));
}

static fsn_status answer(struct fsn_request *request) {
    const struct entry *entry = find_request(request->name);
    if (entry == NULL) {
        return fsn_request_refuse(request, FSN_E_ARG, "help lists the requests",
                                  "unknown request %.100s", request->name);
    }
    /* The role is checked before the form: a forbidden request must not reveal its usage. */
    const bool may = request->client->role >= entry->role;
    const bool fits = request->count >= entry->least && request->count <= entry->most;
    if (may && !fits) {
        return fsn_request_refuse(request, FSN_E_ARG, entry->usage, "wrong number of words");
    }
    fsn_status found;
    request->later = may && entry->answer == NULL;
    if (!may) {
        found = role_is_too_low(request, entry->role);
    } else {
        found = request->later ? fsn_answer_later(request) : entry->answer(request);
    }
    if (found == FSN_OK && entry->event == CHANGES) {
        report(request, entry->name, false);
        /* Refused changes are also recorded, because a client has attempted them. */
    } else if (found != FSN_OK && (!may || entry->event != READS)) {
        report(request, entry->name, true);
    }
    return found;
}

/** The request was executed, but its reply does not fit. */
static fsn_status refuse_reply(struct fsn_request *request) {
    return request->json->failed == FSN_E_NOMEM
               ? fsn_request_refuse(request, FSN_E_NOMEM, NULL, "out of memory")
               : fsn_request_refuse(request, FSN_E_SPACE, "ask for less", "the reply is too long");
}

void fsn_request_answer(struct fsn_services *services, struct fsn_client *client, char *line,
                        size_t len_bytes) {
    static struct fsn_words words; /* one thread */
    struct fsn_json json = {.limit_bytes = FSN_CLIENT_OUT_BYTES / 2};
    struct fsn_request request = {.services = services, .client = client, .json = &json};
    const char *wrong = fsn_words_split(line, len_bytes, &words);
    /* A tag is returned with the reply, so that a client can send requests without waiting. */
    const bool tagged = wrong == NULL && words.word[0][0] == '#';
    const char *tag = tagged ? words.word[0] + 1 : NULL;
    fsn_status found;
    if (wrong != NULL) {
        found = fsn_request_refuse(&request, FSN_E_ARG, "help lists the requests", "%s", wrong);
    } else if (words.count == (size_t)tagged) {
        found = fsn_request_refuse(&request, FSN_E_ARG, "help lists the requests",
                                   "a tag without a request");
    } else {
        request.argument = words.word + 1 + tagged;
        request.count = words.count - 1 - tagged;
        request.tag = tag;
        begin(&json, tag, true);
        request.name = words.word[tagged];
        found = answer(&request);
    }
    /* A job answers by itself when it is done. */
    const bool later = found == FSN_OK && request.later; /* only its job answers */
    /* A reply that did not fit is replaced: an incomplete JSON document does not help a client. */
    if (found == FSN_OK && !later && json.failed != FSN_OK) {
        found = refuse_reply(&request);
    }
    if (found != FSN_OK) {
        fsn_reply_refusal(client, tag, &request.refusal);
    } else if (!later) {
        if (request.fds > 0) {
            fsn_client_pass(client, request.fd, request.fds);
        }
        finish(client, &json);
    }
    fsn_json_free(&json);
}

void fsn_reply_job(struct fsn_client *client, const struct fsn_job *job) {
    client->job = NULL;
    client->heard_ns = fsn_now_ns(); /* it was our turn until now */
    if (job->status == FSN_OK) {
        fsn_client_put_long(client, job->json.bytes, job->json.len_bytes);
    } else {
        fsn_reply_refusal(client, job->tag, &job->refusal);
    }
}
