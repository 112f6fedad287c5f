/** Requests for values: reading, writing, arming. */
#include <inttypes.h>
#include <string.h>

#include "control/base/clock.h"
#include "control/base/value.h"
#include "control/requests/request.h"
#include "plan/plan_internal.h"

fsn_status fsn_request_find(struct fsn_request *request, const char *name,
                            struct fsn_named *found) {
    const struct fsn_outputs *outputs = request->services->view.outputs;
    found->input = fsn_outputs_find(outputs, name, false);
    found->output = fsn_outputs_find(outputs, name, true);
    return found->input != FSN_NONE || found->output != FSN_NONE
               ? FSN_OK
               : fsn_request_refuse(request, FSN_E_ARG, "symbols lists the names",
                                    "no input or output is called %.150s", name);
}

/** Finds the output of a name, or else its input, which fsn_outputs_check() refuses. */
static fsn_status find_output(struct fsn_request *request, const char *name, uint32_t *symbol) {
    struct fsn_named found;
    const fsn_status status = fsn_request_find(request, name, &found);
    *symbol = found.output != FSN_NONE ? found.output : found.input;
    return status;
}

bool fsn_request_typed(struct fsn_request *request) {
    const bool typed = request->count > 1 && strcmp(request->argument[0], "--typed") == 0;
    request->argument += typed;
    request->count -= typed;
    return typed;
}

/** Writes the value of a symbol under its name; refuses one without a place on the bus. */
static fsn_status put_value(struct fsn_request *request, uint32_t symbol, bool typed) {
    struct fsn_bus_view *view = &request->services->view;
    const struct fsn_symbol_info info = fsn_known_symbol(view->plan, symbol);
    uint64_t raw;
    if (fsn_core_read_symbol(view->core, view->image, symbol, &raw) != FSN_OK) {
        return fsn_request_refuse(request, FSN_E_ARG, NULL,
                                  "%.150s has no place in the process image", info.name);
    }
    fsn_json_key(request->json, info.name);
    (typed ? fsn_value_write_typed : fsn_value_write)(&info, raw, request->json);
    return FSN_OK;
}

/** Writes the inputs, or the outputs, named by the arguments. */
static fsn_status put_direction(struct fsn_request *request, bool output, bool typed) {
    fsn_status status = FSN_OK;
    fsn_json_put_open(request->json, output ? "outputs" : "inputs", '{');
    for (size_t i = 0; status == FSN_OK && i < request->count; i++) {
        struct fsn_named found;
        status = fsn_request_find(request, request->argument[i], &found);
        const uint32_t symbol = output ? found.output : found.input;
        if (status == FSN_OK && symbol != FSN_NONE) {
            status = put_value(request, symbol, typed);
        }
    }
    fsn_json_close(request->json, '}');
    return status;
}

fsn_status fsn_answer_get(struct fsn_request *request) {
    struct fsn_bus_view *view = &request->services->view;
    const bool typed = fsn_request_typed(request);
    if (view->core == NULL) {
        return fsn_request_refuse(request, FSN_E_STATE, "send start first", "the bus is stopped");
    }
    if (fsn_core_snapshot(view->core, &view->statistics, NULL, view->image) != FSN_OK) {
        return fsn_request_refuse(request, FSN_E_BUSY, "ask again", "no stable picture of a cycle");
    }
    fsn_json_put_u64(request->json, "cycle", view->statistics.cycles);
    FSN_TRY(put_direction(request, false, typed));
    return put_direction(request, true, typed);
}

static fsn_status read_wanted(struct fsn_request *request, const char *word, bool typed,
                              uint64_t now_ns, struct fsn_wanted *wanted) {
    char name[FSN_LINE_BYTES + 1];
    struct fsn_symbol_info info;
    const char *equals = strrchr(word, '=');
    if (equals == NULL || equals == word) {
        return fsn_request_refuse(request, FSN_E_ARG, "set NAME=VALUE …",
                                  "%.150s is not NAME=VALUE", word);
    }
    memcpy(name, word, (size_t)(equals - word));
    name[equals - word] = 0;
    FSN_TRY(find_output(request, name, &wanted->symbol));
    info = fsn_known_symbol(request->services->view.plan, wanted->symbol);
    const char *wrong =
        (typed ? fsn_value_parse_typed : fsn_value_parse)(&info, equals + 1, &wanted->raw);
    if (wrong != NULL && (info.kind == FSN_KIND_BOOL || info.bits == 1)) {
        return fsn_request_refuse(request, FSN_E_ARG, "write true, false, on, off, 1 or 0",
                                  "%.120s is a bool: %.60s is not a valid value", info.name,
                                  equals + 1);
    }
    if (wrong != NULL) {
        return fsn_request_refuse(request, FSN_E_ARG, "symbols shows type and bits of each",
                                  "%.120s is %u bits %s: %.60s is %s", info.name,
                                  (unsigned)info.bits, fsn_value_type(&info), equals + 1, wrong);
    }
    return fsn_outputs_check(request->services->view.outputs, wanted->symbol,
                             request->client->number, wanted->raw, now_ns, &request->refusal);
}

static void report_edge(struct fsn_request *request, const char *event, uint32_t symbol,
                        uint64_t raw) {
    const struct fsn_symbol_info info = fsn_known_symbol(request->services->view.plan, symbol);
    struct fsn_json *json =
        fsn_event_begin_act(&request->services->events, event, request->client->role);
    char who[FSN_CLIENT_TEXT_BYTES];
    fsn_client_put_peer(request->client, json);
    fsn_json_put_text(json, "output", info.name);
    fsn_json_put_u64(json, "raw", raw);
    fsn_event_send(&request->services->events, FSN_LOG_WARNING, "%s: %s %.120s, raw %" PRIu64,
                   fsn_client_text(request->client, who), event, info.name, raw);
}

void fsn_request_report_taken(struct fsn_request *request, const struct fsn_wanted *wanted,
                              size_t count) {
    struct fsn_services *services = request->services;
    struct fsn_json *json = NULL;
    size_t taken = 0;
    for (size_t i = 0; i < count; i++) {
        const uint32_t symbol = wanted[i].symbol;
        if (fsn_outputs_state(services->view.outputs, symbol).owner == request->client->number) {
            continue;
        }
        if (taken++ == 0) {
            json = fsn_event_begin_act(&services->events, "taken", request->client->role);
            fsn_client_put_peer(request->client, json);
            fsn_json_put_u64(json, "lease_ms", request->client->lease_ms);
            fsn_json_put_open(json, "outputs", '{');
        }
        fsn_json_put_u64(json, fsn_known_symbol(services->view.plan, symbol).name, wanted[i].raw);
    }
    if (taken > 0) {
        char who[FSN_CLIENT_TEXT_BYTES];
        fsn_json_close(json, '}');
        fsn_event_send(&services->events, FSN_LOG_DETAIL, "%s writes %zu output%s",
                       fsn_client_text(request->client, who), taken, taken == 1 ? "" : "s");
    }
}

/** All or none: every value is read and checked before the first is written. */
fsn_status fsn_answer_set(struct fsn_request *request) {
    static struct fsn_wanted wanted[FSN_WORDS]; /* one thread, and too large for its stack */
    const uint64_t now_ns = fsn_now_ns();
    const bool typed = fsn_request_typed(request);
    if (request->client->place != 0) {
        return fsn_request_refuse(request, FSN_E_STATE, "open another connection",
                                  "this client is in the cycle, and writes its outputs there");
    }
    for (size_t i = 0; i < request->count; i++) {
        FSN_TRY(read_wanted(request, request->argument[i], typed, now_ns, &wanted[i]));
        for (size_t before = 0; before < i; before++) {
            if (wanted[before].symbol == wanted[i].symbol) {
                return fsn_request_refuse(request, FSN_E_ARG, "one value for each",
                                          "an output is named twice");
            }
        }
    }
    fsn_request_report_taken(request, wanted, request->count);
    fsn_outputs_write(request->services->view.outputs, request->client->number, wanted,
                      request->count);
    for (size_t i = 0; i < request->count; i++) {
        if (wanted[i].edge) {
            report_edge(request, "edge", wanted[i].symbol, wanted[i].raw);
        }
    }
    fsn_json_put_u64(request->json, "set", request->count);
    return FSN_OK;
}

fsn_status fsn_answer_arm(struct fsn_request *request) {
    uint32_t symbol;
    fsn_status found = find_output(request, request->argument[0], &symbol);
    if (found == FSN_OK) {
        found = fsn_outputs_arm(request->services->view.outputs, symbol, request->client->number,
                                fsn_now_ns(), &request->refusal);
    }
    if (found == FSN_OK) {
        report_edge(request, "arm", symbol, 0);
        fsn_json_put_text(request->json, "armed",
                          fsn_known_symbol(request->services->view.plan, symbol).name);
        fsn_json_put_u64(request->json, "for_ms", FSN_ARM_MS);
    }
    return found;
}
