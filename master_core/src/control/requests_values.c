/** Requests for values: reading, writing, arming. */
#include <inttypes.h>
#include <string.h>

#include "asked.h"
#include "value.h"

fsn_status fsn_asked_symbol(struct fsn_asked *asked, const char *name, uint32_t *symbol,
                            struct fsn_symbol_info *info) {
    *symbol = fsn_outputs_find(asked->control->outputs, name);
    if (*symbol == FSN_NONE) {
        return fsn_refusal_set(&asked->refusal, FSN_E_ARG, "symbols lists the names",
                               "no input or output is called %.150s", name);
    }
    *info = fsn_known_symbol(asked->control->plan, *symbol);
    return FSN_OK;
}

bool fsn_asked_typed(struct fsn_asked *asked) {
    const bool typed = asked->count > 1 && strcmp(asked->argument[0], "--typed") == 0;
    asked->argument += typed;
    asked->count -= typed;
    return typed;
}

fsn_status fsn_answer_get(struct fsn_asked *asked) {
    struct fsn_control *control = asked->control;
    const bool typed = fsn_asked_typed(asked);
    if (control->core == NULL) {
        return fsn_asked_refuse(asked, FSN_E_STATE, "send start first", "the bus is stopped");
    }
    if (fsn_core_snapshot(control->core, &control->statistics, NULL, control->image) != FSN_OK) {
        return fsn_asked_refuse(asked, FSN_E_BUSY, "ask again", "no stable picture of a cycle");
    }
    fsn_json_put_u64(asked->json, "cycle", control->statistics.cycles);
    fsn_json_key(asked->json, "values");
    fsn_json_open(asked->json, '{');
    for (size_t i = 0; i < asked->count; i++) {
        uint32_t symbol;
        struct fsn_symbol_info info = {0};
        uint64_t raw;
        if (fsn_asked_symbol(asked, asked->argument[i], &symbol, &info) != FSN_OK) {
            return FSN_E_ARG;
        }
        if (fsn_core_read_symbol(control->core, control->image, symbol, &raw) != FSN_OK) {
            return fsn_refusal_set(&asked->refusal, FSN_E_ARG, NULL,
                                   "%.150s has no place in the process image", info.name);
        }
        fsn_json_key(asked->json, info.name);
        (typed ? fsn_value_write_typed : fsn_value_write)(&info, raw, asked->json);
    }
    fsn_json_close(asked->json, '}');
    return FSN_OK;
}

static fsn_status read_wanted(struct fsn_asked *asked, const char *word, bool typed,
                              uint64_t now_ns, struct fsn_wanted *wanted) {
    char name[FSN_LINE_BYTES + 1];
    struct fsn_symbol_info info = {0};
    const char *equals = strrchr(word, '=');
    if (equals == NULL || equals == word) {
        return fsn_refusal_set(&asked->refusal, FSN_E_ARG, "set NAME=VALUE …",
                               "%.150s is no NAME=VALUE", word);
    }
    memcpy(name, word, (size_t)(equals - word));
    name[equals - word] = 0;
    fsn_status found = fsn_asked_symbol(asked, name, &wanted->symbol, &info);
    if (found != FSN_OK) {
        return found;
    }
    const char *wrong =
        (typed ? fsn_value_parse_typed : fsn_value_parse)(&info, equals + 1, &wanted->raw);
    if (wrong != NULL) {
        return fsn_refusal_set(&asked->refusal, FSN_E_ARG, "symbols says type and bits of each",
                               "%.120s is %u bits %s: %.60s is %s", info.name, (unsigned)info.bits,
                               fsn_value_type(&info), equals + 1, wrong);
    }
    return fsn_outputs_check(asked->control->outputs, wanted->symbol, asked->client->number,
                             wanted->raw, now_ns, &asked->refusal);
}

static void tell_edge(struct fsn_asked *asked, const char *event, uint32_t symbol, uint64_t raw) {
    const struct fsn_symbol_info info = fsn_known_symbol(asked->control->plan, symbol);
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
fsn_status fsn_answer_set(struct fsn_asked *asked) {
    static struct fsn_wanted wanted[FSN_WORDS]; /* one thread, and too large for its stack */
    const uint64_t now_ns = fsn_now_ns();
    const bool typed = fsn_asked_typed(asked);
    for (size_t i = 0; i < asked->count; i++) {
        const fsn_status found = read_wanted(asked, asked->argument[i], typed, now_ns, &wanted[i]);
        if (found != FSN_OK) {
            return found;
        }
        for (size_t before = 0; before < i; before++) {
            if (wanted[before].symbol == wanted[i].symbol) {
                return fsn_asked_refuse(asked, FSN_E_ARG, "one value for each",
                                        "an output is named twice");
            }
        }
    }
    fsn_outputs_write(asked->control->outputs, asked->client->number, wanted, asked->count);
    for (size_t i = 0; i < asked->count; i++) {
        if (wanted[i].edge) {
            tell_edge(asked, "edge", wanted[i].symbol, wanted[i].raw);
        }
    }
    fsn_json_put_u64(asked->json, "set", asked->count);
    return FSN_OK;
}

fsn_status fsn_answer_arm(struct fsn_asked *asked) {
    uint32_t symbol;
    struct fsn_symbol_info info = {0};
    fsn_status found = fsn_asked_symbol(asked, asked->argument[0], &symbol, &info);
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
