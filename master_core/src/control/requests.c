/** The requests of the control socket: one table, one function each. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "internal.h"
#include "value.h"

/** One request being answered. */
struct asked {
    struct fsn_control *control;
    struct fsn_client *client;
    const char *const *argument; /**< words behind the name of the request */
    size_t count;
    struct fsn_json *json; /**< the reply, open, "ok" written */
    struct fsn_refusal refusal;
};

typedef fsn_status (*answer_fn)(struct asked *asked);

struct command {
    const char *name;
    size_t least, most; /**< number of arguments */
    answer_fn answer;
    const char *usage;
};

static fsn_status refuse(struct asked *asked, fsn_status status, const char *hint,
                         const char *text) {
    return fsn_refusal_set(&asked->refusal, status, hint, "%.300s", text);
}

static fsn_status hello(struct asked *asked) {
    fsn_report_hello(asked->control, asked->client, asked->json);
    return FSN_OK;
}

static fsn_status status(struct asked *asked) {
    fsn_report_status(asked->control, asked->json);
    return FSN_OK;
}

static fsn_status snapshot(struct asked *asked) {
    const fsn_status found = fsn_report_snapshot(asked->control, asked->json);
    if (found == FSN_E_STATE) {
        return refuse(asked, found, "send start first", "the bus is stopped");
    }
    return found == FSN_OK ? FSN_OK
                           : refuse(asked, found, "ask again", "no stable picture of a cycle");
}

static fsn_status subdevices(struct asked *asked) {
    fsn_report_subdevices(asked->control, asked->json);
    return FSN_OK;
}

static fsn_status symbols(struct asked *asked) {
    fsn_report_symbols(asked->control, asked->json);
    return FSN_OK;
}

static fsn_status find(struct asked *asked, const char *name, uint32_t *symbol,
                       struct fsn_symbol_info *info) {
    *symbol = fsn_outputs_find(asked->control->outputs, name);
    if (*symbol == FSN_NONE || fsn_plan_symbol(asked->control->plan, *symbol, info) != FSN_OK) {
        return fsn_refusal_set(&asked->refusal, FSN_E_ARG, "symbols lists the names",
                               "no input or output is called %.150s", name);
    }
    return FSN_OK;
}

static fsn_status get(struct asked *asked) {
    struct fsn_control *control = asked->control;
    if (control->core == NULL) {
        return refuse(asked, FSN_E_STATE, "send start first", "the bus is stopped");
    }
    if (fsn_core_snapshot(control->core, &control->statistics, NULL, control->image) != FSN_OK) {
        return refuse(asked, FSN_E_BUSY, "ask again", "no stable picture of a cycle");
    }
    fsn_json_put_u64(asked->json, "cycle", control->statistics.cycles);
    fsn_json_key(asked->json, "values");
    fsn_json_open(asked->json, '{');
    for (size_t i = 0; i < asked->count; i++) {
        uint32_t symbol;
        struct fsn_symbol_info info;
        uint64_t raw;
        if (find(asked, asked->argument[i], &symbol, &info) != FSN_OK) {
            return FSN_E_ARG;
        }
        if (fsn_core_read_symbol(control->core, control->image, symbol, &raw) != FSN_OK) {
            return fsn_refusal_set(&asked->refusal, FSN_E_ARG, NULL,
                                   "%.150s has no place in the process image", info.name);
        }
        fsn_json_key(asked->json, info.name);
        fsn_value_write(&info, raw, asked->json);
    }
    fsn_json_close(asked->json, '}');
    return FSN_OK;
}

/** One NAME=VALUE, understood and allowed. */
struct wanted {
    uint32_t symbol;
    uint64_t raw;
};

static fsn_status read_wanted(struct asked *asked, const char *word, uint64_t now_ns,
                              struct wanted *wanted) {
    char name[FSN_LINE_BYTES + 1];
    struct fsn_symbol_info info;
    const char *equals = strrchr(word, '=');
    if (equals == NULL || equals == word) {
        return fsn_refusal_set(&asked->refusal, FSN_E_ARG, "set NAME=VALUE …",
                               "%.150s is no NAME=VALUE", word);
    }
    memcpy(name, word, (size_t)(equals - word));
    name[equals - word] = 0;
    fsn_status found = find(asked, name, &wanted->symbol, &info);
    if (found != FSN_OK) {
        return found;
    }
    const char *wrong = fsn_value_parse(&info, equals + 1, &wanted->raw);
    if (wrong != NULL) {
        return fsn_refusal_set(&asked->refusal, FSN_E_ARG, "symbols says type and bits of each",
                               "%.120s is %u bits %s: %.60s is %s", info.name, (unsigned)info.bits,
                               fsn_value_type(&info), equals + 1, wrong);
    }
    return fsn_outputs_check(asked->control->outputs, wanted->symbol, asked->client->number,
                             wanted->raw, now_ns, &asked->refusal);
}

static void tell_edge(struct asked *asked, const char *event, uint32_t symbol, uint64_t raw) {
    struct fsn_symbol_info info;
    if (fsn_plan_symbol(asked->control->plan, symbol, &info) != FSN_OK) {
        return;
    }
    struct fsn_json *json = fsn_event_begin(asked->control, event, fsn_now_ns());
    fsn_json_put_u64(json, "client", asked->client->number);
    fsn_json_put_u64(json, "pid", (uint64_t)asked->client->pid);
    fsn_json_put_u64(json, "uid", asked->client->uid);
    fsn_json_put_text(json, "output", info.name);
    fsn_json_put_u64(json, "raw", raw);
    fsn_event_tell(asked->control, FSN_LOG_WARNING,
                   "client %u (pid %ld, uid %ld) %s %.120s, raw "
                   "%" PRIu64,
                   (unsigned)asked->client->number, (long)asked->client->pid,
                   (long)asked->client->uid, event, info.name, raw);
}

/** All or none: every value is read and allowed before the first is written. */
static fsn_status set(struct asked *asked) {
    static struct wanted wanted[FSN_WORDS]; /* one thread, and too large for its stack */
    const uint64_t now_ns = fsn_now_ns();
    for (size_t i = 0; i < asked->count; i++) {
        const fsn_status found = read_wanted(asked, asked->argument[i], now_ns, &wanted[i]);
        if (found != FSN_OK) {
            return found;
        }
        for (size_t before = 0; before < i; before++) {
            if (wanted[before].symbol == wanted[i].symbol) {
                return refuse(asked, FSN_E_ARG, "one value for each", "an output is named twice");
            }
        }
    }
    for (size_t i = 0; i < asked->count; i++) {
        if (fsn_outputs_write(asked->control->outputs, wanted[i].symbol, asked->client->number,
                              wanted[i].raw)) {
            tell_edge(asked, "edge", wanted[i].symbol, wanted[i].raw);
        }
    }
    fsn_json_put_u64(asked->json, "set", asked->count);
    return FSN_OK;
}

static fsn_status lease(struct asked *asked) {
    const char *text = asked->argument[0];
    uint64_t ms;
    const struct fsn_symbol_info number = {.bits = 32, .kind = FSN_KIND_UNSIGNED};
    if (fsn_value_parse(&number, text, &ms) != NULL || ms > FSN_LEASE_MAX_MS) {
        return refuse(asked, FSN_E_ARG, "0 lets it end with the connection only",
                      "a lease has 0 to 600000 ms");
    }
    asked->client->lease_ms = (uint32_t)ms;
    fsn_json_put_u64(asked->json, "lease_ms", ms);
    return FSN_OK;
}

static fsn_status arm(struct asked *asked) {
    uint32_t symbol;
    struct fsn_symbol_info info;
    fsn_status found = find(asked, asked->argument[0], &symbol, &info);
    if (found == FSN_OK) {
        found = fsn_outputs_arm(asked->control->outputs, symbol, asked->client->number,
                                fsn_now_ns(), &asked->refusal);
    }
    if (found == FSN_OK) {
        tell_edge(asked, "arm", symbol, 0);
        fsn_json_put_text(asked->json, "armed", info.name);
        fsn_json_put_u64(asked->json, "for_ms", FSN_ARM_MS);
    }
    return found;
}

static fsn_status events(struct asked *asked) {
    const bool on = strcmp(asked->argument[0], "on") == 0;
    if (!on && strcmp(asked->argument[0], "off") != 0) {
        return refuse(asked, FSN_E_ARG, NULL, "events on or events off");
    }
    asked->client->events = on;
    fsn_json_put_bool(asked->json, "events", on);
    return FSN_OK;
}

static fsn_status wish(struct asked *asked, enum fsn_wish wished) {
    const struct fsn_control_host *host = asked->control->host;
    const fsn_status found = host->wish(host->self, wished, &asked->refusal);
    if (found == FSN_OK) {
        struct fsn_control_status now = {0};
        host->status(host->self, &now);
        fsn_json_put_text(asked->json, "state", now.state); /* events tell how it goes on */
    }
    return found;
}

static fsn_status start(struct asked *asked) {
    return wish(asked, FSN_WISH_START);
}

static fsn_status stop(struct asked *asked) {
    return wish(asked, FSN_WISH_STOP);
}

static fsn_status restart(struct asked *asked) {
    return wish(asked, FSN_WISH_RESTART);
}

static fsn_status shut_down(struct asked *asked) {
    return wish(asked, FSN_WISH_SHUTDOWN);
}

static fsn_status help(struct asked *asked);

static const struct command commands[] = {
    {"hello", 0, 0, hello, "hello: version of protocol and program, your client number"},
    {"status", 0, 0, status, "status: state of the program and of the bus, short"},
    {"snapshot", 0, 0, snapshot, "snapshot: statistics, connections and SubDevices in full"},
    {"subdevices", 0, 0, subdevices, "subdevices: what is known about each SubDevice"},
    {"symbols", 0, 0, symbols, "symbols: named inputs and outputs, and who writes them"},
    {"get", 1, FSN_WORDS, get, "get NAME…: values of one cycle"},
    {"set", 1, FSN_WORDS, set, "set NAME=VALUE…: all or none; yours until your lease ends"},
    {"lease", 1, 1, lease, "lease MS: silence after which your outputs fall back; 0: never"},
    {"arm", 1, 1, arm, "arm NAME: allows one edge of an output that can restart a machine"},
    {"events", 1, 1, events, "events on|off: every change as a line of JSON"},
    {"start", 0, 0, start, "start: opens the bus and brings it to OP"},
    {"stop", 0, 0, stop, "stop: stop values, SAFEOP, bus closed; no emergency stop"},
    {"restart", 0, 0, restart, "restart: stop, then start"},
    {"shutdown", 0, 0, shut_down, "shutdown: stop, then the end of the program"},
    {"help", 0, 0, help, "help: this list"},
};
enum { COMMANDS = sizeof commands / sizeof commands[0] };

static fsn_status help(struct asked *asked) {
    fsn_json_key(asked->json, "requests");
    fsn_json_open(asked->json, '[');
    for (size_t i = 0; i < COMMANDS; i++) {
        fsn_json_text(asked->json, commands[i].usage);
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

static void finish(struct fsn_client *client, struct fsn_json *json) {
    fsn_json_close(json, '}');
    fsn_json_end(json);
    if (!json->failed) {
        fsn_client_put(client, json->bytes, json->len_bytes);
    }
}

void fsn_reply_refusal(struct fsn_control *control, struct fsn_client *client, const char *tag,
                       const struct fsn_refusal *refusal) {
    (void)control;
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

static const struct command *find_command(const char *name) {
    for (size_t i = 0; i < COMMANDS; i++) {
        if (strcmp(commands[i].name, name) == 0) {
            return &commands[i];
        }
    }
    return NULL;
}

static fsn_status answer(struct asked *asked, const char *name) {
    const struct command *command = find_command(name);
    if (command == NULL) {
        return fsn_refusal_set(&asked->refusal, FSN_E_ARG, "help lists the requests",
                               "there is no request %.100s", name);
    }
    if (asked->count < command->least || asked->count > command->most) {
        return refuse(asked, FSN_E_ARG, command->usage, "wrong number of words");
    }
    return command->answer(asked);
}

void fsn_request(struct fsn_control *control, struct fsn_client *client, char *line,
                 size_t len_bytes) {
    static struct fsn_words words; /* one thread */
    struct fsn_json json = {.limit_bytes = FSN_CONTROL_OUT_BYTES / 2};
    struct asked asked = {.control = control, .client = client, .json = &json};
    const char *wrong = fsn_words_split(line, len_bytes, &words);
    const bool tagged = wrong == NULL && words.word[0][0] == '#';
    const char *tag = tagged ? words.word[0] + 1 : NULL;
    fsn_status found;
    if (wrong != NULL) {
        found = refuse(&asked, FSN_E_ARG, "help lists the requests", wrong);
    } else if (words.count == (size_t)tagged) {
        found = refuse(&asked, FSN_E_ARG, "help lists the requests", "a tag without a request");
    } else {
        asked.argument = words.word + 1 + tagged;
        asked.count = words.count - 1 - tagged;
        begin(&json, tag, true);
        found = answer(&asked, words.word[tagged]);
    }
    if (found == FSN_OK && json.failed) {
        found = refuse(&asked, FSN_E_SPACE, "ask for less", "the reply is too long");
    }
    if (found == FSN_OK) {
        finish(client, &json);
    } else {
        fsn_reply_refusal(control, client, tag, &asked.refusal);
    }
    fsn_json_free(&json);
}
