/** The requests of the control socket: one table, one function each. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "asked.h"
#include "value.h"

struct request {
    const char *name;
    size_t least, most;   /**< number of arguments */
    fsn_answer_fn answer; /**< NULL: a job answers later */
    const char *usage;
};

fsn_status fsn_asked_refuse(struct fsn_asked *asked, fsn_status status, const char *hint,
                            const char *text) {
    return fsn_refusal_set(&asked->refusal, status, hint, "%.300s", text);
}

static fsn_status hello(struct fsn_asked *asked) {
    fsn_report_hello(asked->control, asked->client, asked->json);
    return FSN_OK;
}

static fsn_status status(struct fsn_asked *asked) {
    fsn_report_status(asked->control, asked->json);
    return FSN_OK;
}

static fsn_status snapshot(struct fsn_asked *asked) {
    const fsn_status found = fsn_report_snapshot(asked->control, asked->json);
    if (found == FSN_E_STATE) {
        return fsn_asked_refuse(asked, found, "send start first", "the bus is stopped");
    }
    return found == FSN_OK
               ? FSN_OK
               : fsn_asked_refuse(asked, found, "ask again", "no stable picture of a cycle");
}

static fsn_status layout(struct fsn_asked *asked) {
    return fsn_report_layout(asked->control, asked->json) == FSN_OK
               ? FSN_OK
               : fsn_asked_refuse(asked, FSN_E_STATE, "send start first", "the bus is stopped");
}

static fsn_status subdevices(struct fsn_asked *asked) {
    fsn_report_subdevices(asked->control, asked->json);
    return FSN_OK;
}

static fsn_status symbols(struct fsn_asked *asked) {
    fsn_report_symbols(asked->control, asked->json);
    return FSN_OK;
}

static fsn_status lease(struct fsn_asked *asked) {
    const char *text = asked->argument[0];
    uint64_t ms;
    const struct fsn_symbol_info number = {.bits = 32, .kind = FSN_KIND_UNSIGNED};
    if (fsn_value_parse(&number, text, &ms) != NULL || ms > FSN_LEASE_MAX_MS) {
        return fsn_asked_refuse(asked, FSN_E_ARG, "0 lets it end with the connection only",
                                "a lease has 0 to 600000 ms");
    }
    asked->client->lease_ms = (uint32_t)ms;
    fsn_json_put_u64(asked->json, "lease_ms", ms);
    return FSN_OK;
}

static fsn_status events(struct fsn_asked *asked) {
    const bool on = strcmp(asked->argument[0], "on") == 0;
    if (!on && strcmp(asked->argument[0], "off") != 0) {
        return fsn_asked_refuse(asked, FSN_E_ARG, NULL, "events on or events off");
    }
    asked->client->events = on;
    fsn_json_put_bool(asked->json, "events", on);
    return FSN_OK;
}

static fsn_status wish(struct fsn_asked *asked, enum fsn_wish wished) {
    const struct fsn_control_host *host = asked->control->host;
    const fsn_status found = host->wish(host->self, wished, &asked->refusal);
    if (found == FSN_OK) {
        struct fsn_control_status now = {0};
        host->status(host->self, &now);
        fsn_json_put_text(asked->json, "state", now.state); /* events tell how it goes on */
    }
    return found;
}

static fsn_status start(struct fsn_asked *asked) {
    return wish(asked, FSN_WISH_START);
}

static fsn_status stop(struct fsn_asked *asked) {
    return wish(asked, FSN_WISH_STOP);
}

static fsn_status restart(struct fsn_asked *asked) {
    return wish(asked, FSN_WISH_RESTART);
}

static fsn_status shut_down(struct fsn_asked *asked) {
    return wish(asked, FSN_WISH_SHUTDOWN);
}

static fsn_status help(struct fsn_asked *asked);

static const struct request requests[] = {
    {"hello", 0, 0, hello, "hello: version of protocol and program, your client number"},
    {"status", 0, 0, status, "status: state of the program and of the bus, short"},
    {"snapshot", 0, 0, snapshot, "snapshot: statistics, connections and SubDevices in full"},
    {"subdevices", 0, 0, subdevices, "subdevices: what is known about each SubDevice"},
    {"symbols", 0, 0, symbols, "symbols: named inputs and outputs, and who writes them"},
    {"get", 1, FSN_WORDS, fsn_answer_get, "get [--typed] NAME…: values of one cycle"},
    {"layout", 0, 0, layout, "layout: where everything lies in the process image"},
    {"set", 1, FSN_WORDS, fsn_answer_set,
     "set [--typed] NAME=VALUE…: all or none; yours until your lease ends"},
    {"lease", 1, 1, lease, "lease MS: silence after which your outputs fall back; 0: never"},
    {"arm", 1, 1, fsn_answer_arm,
     "arm NAME: allows one edge of an output that can restart a machine"},
    {"events", 1, 1, events, "events on|off: every change as a line of JSON"},
    {"incident", 0, 1, fsn_answer_incident, "incident [TEXT]: keeps the last seconds in a file"},
    {"watch", 1, FSN_WORDS, fsn_answer_watch,
     "watch N|off [--image|--typed] [NAME…]: every N-th cycle as a line of JSON; NAME may end in "
     "*"},
    {"start", 0, 0, start, "start: opens the bus and brings it to OP"},
    {"stop", 0, 0, stop, "stop: stop values, SAFEOP, bus closed; no emergency stop"},
    {"restart", 0, 0, restart, "restart: stop, then start"},
    {"shutdown", 0, 0, shut_down, "shutdown: stop, then the end of the program"},
    {"sdo-read", 3, 4, NULL, "sdo-read SUBDEVICE INDEX SUB [TYPE]: an object of a SubDevice"},
    {"sdo-write", 5, 5, NULL, "sdo-write SUBDEVICE INDEX SUB TYPE VALUE: no safety objects"},
    {"sii-read", 1, 1, NULL, "sii-read SUBDEVICE: its SII, in hex"},
    {"alias-write", 2, 2, NULL, "alias-write SUBDEVICE ALIAS: used after its next power-on"},
    {"history", 1, 1, NULL, "history SUBDEVICE: its diagnosis messages"},
    {"scan", 0, 0, NULL, "scan: all that stands on the bus, planned or not"},
    {"help", 0, 0, help, "help: this list"},
};
enum { REQUESTS = sizeof requests / sizeof requests[0] };

static fsn_status help(struct fsn_asked *asked) {
    fsn_json_key(asked->json, "requests");
    fsn_json_open(asked->json, '[');
    for (size_t i = 0; i < REQUESTS; i++) {
        fsn_json_text(asked->json, requests[i].usage);
    }
    fsn_json_close(asked->json, ']');
    return FSN_OK;
}

static void begin(struct fsn_json *json, const char *tag, bool ok) {
    fsn_json_open(json, '{');
    fsn_json_put_bool(json, "ok", ok);
    if (tag != NULL) {
        fsn_json_put_text(json, "tag", tag);
    }
}

/** Ends a reply. A client would wait in vain for one that there is no memory for. */
static void finish(struct fsn_client *client, struct fsn_json *json) {
    fsn_json_close(json, '}');
    fsn_json_end(json);
    if (json->failed) {
        client->drop_reason = "no memory for it";
        return;
    }
    fsn_client_put(client, json->bytes, json->len_bytes);
}

void fsn_reply_refusal(struct fsn_client *client, const char *tag,
                       const struct fsn_refusal *refusal) {
    struct fsn_json json = {.limit_bytes = FSN_CONTROL_OUT_BYTES};
    begin(&json, tag, false);
    fsn_json_put_text(&json, "error", fsn_status_name(refusal->status));
    fsn_json_put_text(&json, "text", refusal->text);
    if (refusal->hint != NULL) {
        fsn_json_put_text(&json, "hint", refusal->hint);
    }
    finish(client, &json);
    fsn_json_free(&json);
}

static const struct request *find_request(const char *name) {
    for (size_t i = 0; i < REQUESTS; i++) {
        if (strcmp(requests[i].name, name) == 0) {
            return &requests[i];
        }
    }
    return NULL;
}

static fsn_status answer(struct fsn_asked *asked, const char *name) {
    const struct request *request = find_request(name);
    if (request == NULL) {
        return fsn_refusal_set(&asked->refusal, FSN_E_ARG, "help lists the requests",
                               "there is no request %.100s", name);
    }
    if (asked->count < request->least || asked->count > request->most) {
        return fsn_asked_refuse(asked, FSN_E_ARG, request->usage, "wrong number of words");
    }
    if (request->answer == NULL) {
        asked->later = true;
        return fsn_job_ask(asked->control, asked->client, asked->tag, name, asked->argument,
                           asked->count, &asked->refusal);
    }
    return request->answer(asked);
}

void fsn_request(struct fsn_control *control, struct fsn_client *client, char *line,
                 size_t len_bytes) {
    static struct fsn_words words; /* one thread */
    struct fsn_json json = {.limit_bytes = FSN_CONTROL_OUT_BYTES / 2};
    struct fsn_asked asked = {.control = control, .client = client, .json = &json};
    const char *wrong = fsn_words_split(line, len_bytes, &words);
    const bool tagged = wrong == NULL && words.word[0][0] == '#';
    const char *tag = tagged ? words.word[0] + 1 : NULL;
    fsn_status found;
    if (wrong != NULL) {
        found = fsn_asked_refuse(&asked, FSN_E_ARG, "help lists the requests", wrong);
    } else if (words.count == (size_t)tagged) {
        found = fsn_asked_refuse(&asked, FSN_E_ARG, "help lists the requests",
                                 "a tag without a request");
    } else {
        asked.argument = words.word + 1 + tagged;
        asked.count = words.count - 1 - tagged;
        asked.tag = tag;
        begin(&json, tag, true);
        found = answer(&asked, words.word[tagged]);
    }
    const bool later = found == FSN_OK && asked.later; /* its job answers, and nobody else */
    if (found == FSN_OK && !later && json.failed) {
        found = fsn_asked_refuse(&asked, FSN_E_SPACE, "ask for less", "the reply is too long");
    }
    if (found != FSN_OK) {
        fsn_reply_refusal(client, tag, &asked.refusal);
    } else if (!later) {
        finish(client, &json);
    }
    fsn_json_free(&json);
}
