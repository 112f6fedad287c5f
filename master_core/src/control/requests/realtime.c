/** Requests of clients in the cycle: inputs of every cycle and outputs of their own, in memory that
 *  they share with the cyclic thread. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "control/base/value.h"
#include "control/requests/request.h"
#include "plan/plan_internal.h"

enum { MOST_MISSES = 1000 };

/** Parameters of the request of a client. */
struct wanted {
    struct fsn_wanted *outputs; /**< each with its stop value */
    uint32_t *symbols;          /**< the same */
    uint8_t *marks;             /**< per symbol of the plan */
    uint32_t count;
    uint64_t misses;
};

static void end(struct wanted *wanted) {
    free(wanted->outputs);
    free(wanted->symbols);
    free(wanted->marks);
}

/** Whether the client may have this output; nothing is changed. */
static fsn_status check(struct fsn_request *request, uint32_t symbol) {
    const struct fsn_bus_view *view = &request->services->view;
    const struct fsn_symbol_info info = fsn_known_symbol(view->plan, symbol);
    if (info.restart_relevant != 0) {
        return fsn_request_refuse(
            request, FSN_E_CLOSED, "arm and set it over a connection of its own",
            "%.120s can restart a machine; no client writes it in every cycle", info.name);
    }
    return fsn_outputs_check(view->outputs, symbol, request->client->number, info.stop_value, 0,
                             &request->refusal);
}

/** Selects the outputs that match a word with a * and that the client may write. */
static fsn_status choose(struct fsn_request *request, struct wanted *wanted) {
    const struct fsn_bus_view *view = &request->services->view;
    for (uint32_t i = 0; i < fsn_plan_symbol_count(view->plan); i++) {
        const struct fsn_symbol_info info = fsn_known_symbol(view->plan, i);
        if (wanted->marks[i] == 0 || !fsn_core_is_open(view->core, i) ||
            info.restart_relevant != 0) {
            continue;
        }
        FSN_TRY(check(request, i));
        wanted->symbols[wanted->count] = i;
        wanted->outputs[wanted->count++] = (struct fsn_wanted){.symbol = i, .raw = info.stop_value};
    }
    return wanted->count > 0
               ? FSN_OK
               : fsn_request_refuse(request, FSN_E_ARG, "symbols shows which are open",
                                    "no writable output has this name");
}

static fsn_status read_names(struct fsn_request *request, size_t first, struct wanted *wanted) {
    const uint32_t all = fsn_plan_symbol_count(request->services->view.plan);
    if (!FSN_NEW(wanted->outputs, all) || !FSN_NEW(wanted->symbols, all) ||
        !FSN_NEW(wanted->marks, all)) {
        return fsn_request_refuse(request, FSN_E_NOMEM, NULL, "out of memory");
    }
    for (size_t i = first; i < request->count; i++) {
        const char *word = request->argument[i];
        const struct fsn_outputs *outputs = request->services->view.outputs;
        uint32_t symbol = fsn_outputs_find(outputs, word, true);
        symbol = symbol != FSN_NONE ? symbol : fsn_outputs_find(outputs, word, false);
        FSN_TRY(fsn_request_mark(request, word, wanted->marks));
        if (symbol != FSN_NONE) {
            FSN_TRY(check(request, symbol));
        }
    }
    return first < request->count ? choose(request, wanted) : FSN_OK;
}

/** Whether the client was built for this memory and this plan. */
static fsn_status check_build(struct fsn_request *request) {
    const char *plan = request->argument[1];
    uint64_t layout;
    if (fsn_value_parse_number(request->argument[0], 32, &layout) != NULL ||
        layout != FSN_SHARED_LAYOUT) {
        return fsn_request_refuse(request, FSN_E_ARG,
                                  "build it with the headers of this fsn-master",
                                  "the client has layout %.20s of the shared memory, fsn-master %d",
                                  request->argument[0], FSN_SHARED_LAYOUT);
    }
    if (strcmp(plan, "any") != 0 && strcmp(plan, request->services->view.sha256) != 0) {
        return fsn_request_refuse(request, FSN_E_ARG,
                                  "build it for this plan; status shows its plan_sha256",
                                  "the client was made for plan %.64s, loaded is %.64s", plan,
                                  request->services->view.sha256);
    }
    return FSN_OK;
}

static fsn_status check_client(struct fsn_request *request) {
    const struct fsn_client *client = request->client;
    if (request->services->view.core == NULL) {
        return fsn_request_refuse(request, FSN_E_STATE, "send start first", "the bus is stopped");
    }
    if (client->place != 0 || client->passes > 0) {
        return fsn_request_refuse(request, FSN_E_STATE, "open another connection",
                                  "this client is in the cycle already");
    }
    if (fsn_outputs_has(request->services->view.outputs, client->number)) {
        return fsn_request_refuse(request, FSN_E_STATE, "open another connection",
                                  "this client writes outputs with set");
    }
    return FSN_OK;
}

static fsn_status read_wanted(struct fsn_request *request, struct wanted *wanted) {
    FSN_TRY(check_build(request));
    FSN_TRY(check_client(request));
    if (fsn_value_parse_number(request->argument[2], 32, &wanted->misses) != NULL ||
        wanted->misses > MOST_MISSES) {
        return fsn_request_refuse(request, FSN_E_ARG, "3 lets three cycles in a row pass",
                                  "a client may miss 0 to 1000 cycles in a row");
    }
    return read_names(request, 3, wanted);
}

static fsn_status refuse_open(struct fsn_request *request, fsn_status status) {
    if (status == FSN_E_BUSY) {
        return fsn_request_refuse(request, status, "close one of them",
                                  "%d clients are in the cycle already", FSN_SHARED_CLIENTS);
    }
    if (status == FSN_E_NOMEM) {
        return fsn_request_refuse(request, status, NULL, "out of memory");
    }
    return fsn_request_refuse(request, status,
                              "Linux 5.1 or newer, and memory that may be locked, are needed",
                              "no memory to share: %s", strerror(errno));
}

/** The client has mapped its outputs. */
static fsn_status begin(struct fsn_request *request) {
    struct fsn_client *client = request->client;
    if (client->place == 0) {
        return fsn_request_refuse(request, FSN_E_STATE, "realtime LAYOUT PLAN MISSES NAME… first",
                                  "this client has no outputs in the cycle");
    }
    if (fsn_core_client_begin(request->services->view.core, client->place - 1) != FSN_OK) {
        fsn_client_take_back(request->services, client, "refused");
        return fsn_request_refuse(request, FSN_E_SYS,
                                  "map the outputs, and leave their seals alone",
                                  "the outputs cannot be sealed");
    }
    client->begun = true;
    fsn_json_put_bool(request->json, "begun", true);
    return FSN_OK;
}

/** Writes data for the client, in addition to its descriptors. */
static void put_reply(struct fsn_request *request, const struct wanted *wanted) {
    fsn_json_put_u64(request->json, "layout", FSN_SHARED_LAYOUT);
    fsn_json_put_text(request->json, "plan_sha256", request->services->view.sha256);
    fsn_json_put_u64(request->json, "misses", wanted->misses);
    fsn_json_put_u64(request->json, "outputs", wanted->count);
}

fsn_status fsn_answer_realtime(struct fsn_request *request) {
    if (request->count == 1 && strcmp(request->argument[0], "begin") == 0) {
        return begin(request);
    }
    if (request->count < 3) {
        return fsn_request_refuse(request, FSN_E_ARG,
                                  "realtime LAYOUT PLAN|any MISSES [NAME…], then realtime begin",
                                  "wrong number of words");
    }
    struct fsn_client *client = request->client;
    struct fsn_bus_view *view = &request->services->view;
    struct wanted wanted = {0};
    uint32_t place;
    fsn_status found = read_wanted(request, &wanted);
    /* Before anything is opened: it would remain if the reply does not fit. */
    put_reply(request, &wanted);
    if (found == FSN_OK && request->json->failed == FSN_OK) {
        const struct fsn_core_client in_cycle = {
            .symbols = wanted.symbols, .count = wanted.count, .misses = (uint32_t)wanted.misses};
        fsn_request_report_taken(request, wanted.outputs, wanted.count);
        fsn_outputs_write(view->outputs, client->number, wanted.outputs, wanted.count);
        found = fsn_core_client_open(view->core, &in_cycle, &place, request->fd);
        if (found != FSN_OK) {
            found = refuse_open(request, found);
            fsn_client_take_back(request->services, client, "refused");
        }
    }
    end(&wanted);
    if (found != FSN_OK || request->json->failed != FSN_OK) {
        return found;
    }
    request->fds = wanted.count > 0 ? 2 : 1;
    client->place = place + 1;
    client->begun = wanted.count == 0;
    return FSN_OK;
}

void fsn_report_realtime(const struct fsn_services *services, struct fsn_json *json) {
    static const char *const states[] = {"waits", "runs", "late"};
    bool any = false;
    for (size_t i = 0; i < services->clients; i++) {
        const struct fsn_client *client = &services->client[i];
        if (client->place == 0) {
            continue;
        }
        if (!any) {
            fsn_json_put_open(json, "in_cycle", '[');
            any = true;
        }
        const struct fsn_core_client_seen seen =
            fsn_core_client_seen(services->view.core, client->place - 1);
        fsn_json_open(json, '{');
        fsn_json_put_u64(json, "client", client->number);
        fsn_json_put_u64(json, "outputs", seen.count);
        fsn_json_put_u64(json, "misses", seen.misses);
        fsn_json_put_text(json, "state", seen.count == 0 ? "reads" : states[seen.state]);
        FSN_JSON_PUT(json, &seen, on_time, late, missed, torn);
        fsn_json_close(json, '}');
    }
    if (any) {
        fsn_json_close(json, ']');
    }
}
