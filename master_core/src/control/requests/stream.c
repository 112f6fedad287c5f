/** Requests of cycles: a client gets every N-th cycle as a line from the recorder of the core. A
 *  slow client does not delay others: its missed cycles are counted. */
#include "control/requests/client.h"

#include <stdlib.h>
#include <string.h>

#include "control/base/value.h"
#include "control/requests/request.h"
#include "plan/plan_internal.h"

enum {
    MOST_EVERY = 1000000,      /**< cycles between two lines */
    TURN_LINES = 32,           /**< lines for one client before the others are served */
    PENDING_BYTES = 256 << 10, /**< unread bytes above which a client gets no lines for now */
    LINE_BYTES = 512 << 10,    /**< of one line */
    NUMBER_BYTES = 28,         /**< of a value, with the text around its name */
};

void fsn_stream_end(struct fsn_client *client) {
    free(client->stream.symbols);
    client->stream = (struct fsn_stream){0};
}

/** Reads a cycle from the recorder, for all clients that request the same one. */
static fsn_status take(struct fsn_bus_view *view, uint64_t number) {
    struct fsn_recorded *recorded = &view->recorded;
    if (recorded->cycle == number) {
        return FSN_OK;
    }
    const fsn_status found =
        fsn_core_record(view->core, number, &recorded->record, NULL, recorded->image);
    recorded->cycle = found == FSN_OK ? number : 0;
    return found;
}

static void put_values(struct fsn_bus_view *view, const struct fsn_stream *stream, bool output,
                       struct fsn_json *json) {
    fsn_json_put_open(json, output ? "outputs" : "inputs", '{');
    for (size_t i = 0; i < stream->count; i++) {
        const struct fsn_symbol_info info = fsn_known_symbol(view->plan, stream->symbols[i]);
        uint64_t raw;
        if ((info.output != 0) == output &&
            fsn_core_read_symbol(view->core, view->recorded.image, stream->symbols[i], &raw) ==
                FSN_OK) {
            fsn_json_key(json, info.name);
            (stream->typed ? fsn_value_write_typed : fsn_value_write)(&info, raw, json);
        }
    }
    fsn_json_close(json, '}');
}

static void put_image(struct fsn_bus_view *view, struct fsn_json *json) {
    FSN_JSON_PUT(json, &view->recorded.record, expected_wkc, actual_wkc);
    fsn_json_put_hex(json, "image", view->recorded.image, fsn_core_image_bytes(view->core));
}

/** Writes the taken cycle as one line. */
static void put_line(struct fsn_services *services, struct fsn_client *client) {
    struct fsn_stream *stream = &client->stream;
    struct fsn_json *json = &services->line;
    struct fsn_bus_view *view = &services->view;
    fsn_json_clear(json);
    fsn_json_open(json, '{');
    fsn_json_put_text(json, "event", stream->image ? "image" : "values");
    FSN_JSON_PUT(json, &view->recorded.record, cycle, now_ns);
    if (stream->skipped > 0) {
        fsn_json_put_u64(json, "skipped", stream->skipped);
    }
    if (stream->image) {
        put_image(view, json);
    } else {
        put_values(view, stream, false, json);
        put_values(view, stream, true, json);
    }
    fsn_json_close(json, '}');
    fsn_json_end(json);
    if (json->failed != FSN_OK) {
        stream->skipped++;
        return;
    }
    stream->skipped = 0;
    fsn_client_put(client, json->bytes, json->len_bytes);
}

/** Skips the data before cycle `until`. */
static void skip_to(struct fsn_stream *stream, uint64_t until) {
    if (until > stream->next) {
        const uint64_t count = (until - stream->next + stream->every - 1) / stream->every;
        stream->skipped += count;
        stream->next += count * stream->every;
    }
}

static void serve(struct fsn_services *services, struct fsn_client *client, uint64_t last) {
    struct fsn_bus_view *view = &services->view;
    struct fsn_stream *stream = &client->stream;
    for (int lines = 0; lines < TURN_LINES && stream->next <= last; lines++) {
        if (client->out.len_bytes - client->sent > PENDING_BYTES) {
            skip_to(stream, last + 1);
            return;
        }
        const fsn_status found = take(view, stream->next);
        if (found == FSN_OK) {
            put_line(services, client);
            stream->next += stream->every;
        } else if (found == FSN_E_ARG) {
            /* Overwritten. The oldest remaining ones will soon be overwritten. */
            const uint64_t kept = fsn_core_kept_cycles(view->core);
            skip_to(stream, last - kept + kept / 8 + 2);
        } else {
            return;
        }
    }
}

void fsn_streams_serve(struct fsn_services *services) {
    const struct fsn_core *core = services->view.core;
    const uint64_t last = fsn_core_last_cycle(core);
    for (size_t i = 0; core != NULL && i < services->clients; i++) {
        struct fsn_client *client = &services->client[i];
        if (client->fd >= 0 && client->drop_reason == NULL && client->stream.every > 0) {
            serve(services, client, last);
        }
    }
}

fsn_status fsn_request_mark(struct fsn_request *request, const char *word, uint8_t *marks) {
    const struct fsn_plan *plan = request->services->view.plan;
    const size_t len = strlen(word);
    struct fsn_symbol_info info;
    if (len == 0 || word[len - 1] != '*') {
        struct fsn_named found;
        const fsn_status status = fsn_request_find(request, word, &found);
        if (found.input != FSN_NONE) {
            marks[found.input] = 1;
        }
        if (found.output != FSN_NONE) {
            marks[found.output] = 1;
        }
        return status;
    }
    bool any = false;
    for (uint32_t symbol = 0; fsn_plan_symbol(plan, symbol, &info) == FSN_OK; symbol++) {
        if (strncmp(info.name, word, len - 1) == 0) {
            marks[symbol] = 1;
            any = true;
        }
    }
    return any ? FSN_OK
               : fsn_request_refuse(request, FSN_E_ARG, "symbols lists the names",
                                    "no input or output begins with %.*s", (int)(len - 1), word);
}

/** Accepts the marked symbols, and checks that a line of them is not too long. */
static fsn_status collect(struct fsn_request *request, const uint8_t *marks, uint32_t all,
                          struct fsn_stream *stream) {
    size_t bytes = 0;
    for (uint32_t i = 0; i < all; i++) {
        if (marks[i] != 0) {
            stream->symbols[stream->count++] = i;
            bytes += strlen(fsn_known_symbol(request->services->view.plan, i).name) + NUMBER_BYTES;
        }
    }
    return bytes < LINE_BYTES - 256 ? FSN_OK
                                    : fsn_request_refuse(request, FSN_E_SPACE, "name fewer",
                                                         "too many values for a line");
}

/** Words after the options: names; none means all. */
static fsn_status choose(struct fsn_request *request, size_t first, struct fsn_stream *stream) {
    const uint32_t all = fsn_plan_symbol_count(request->services->view.plan);
    uint8_t *marks;
    if (!FSN_NEW(marks, all) || !FSN_NEW(stream->symbols, all)) {
        free(marks);
        return fsn_request_refuse(request, FSN_E_NOMEM, NULL, "out of memory");
    }
    if (first == request->count) {
        memset(marks, 1, all);
    }
    fsn_status found = FSN_OK;
    for (size_t i = first; found == FSN_OK && i < request->count; i++) {
        found = fsn_request_mark(request, request->argument[i], marks);
    }
    if (found == FSN_OK) {
        found = collect(request, marks, all, stream);
    }
    free(marks);
    return found;
}

/** N [--image | --typed] [NAME…]. */
static fsn_status read_stream(struct fsn_request *request, struct fsn_stream *stream) {
    uint64_t every;
    if (fsn_value_parse_number(request->argument[0], 32, &every) != NULL || every == 0 ||
        every > MOST_EVERY) {
        return fsn_request_refuse(request, FSN_E_ARG,
                                  "watch 1 shows every cycle; watch off ends it",
                                  "watch takes 1 to 1000000 cycles, or off");
    }
    stream->every = (uint32_t)every;
    const char *option = request->count > 1 ? request->argument[1] : "";
    if (strncmp(option, "--", 2) != 0) {
        return choose(request, 1, stream);
    }
    if (strcmp(option, "--typed") == 0) {
        stream->typed = true;
        return choose(request, 2, stream);
    }
    if (strcmp(option, "--image") != 0) {
        return fsn_request_refuse(request, FSN_E_ARG, "watch N --image, or watch N [--typed] NAME…",
                                  "watch has no such option");
    }
    stream->image = true;
    if (request->count > 2) {
        return fsn_request_refuse(request, FSN_E_ARG, "the image holds all of them",
                                  "watch --image takes no names");
    }
    return 2 * (uint64_t)fsn_core_image_bytes(request->services->view.core) < LINE_BYTES - 256
               ? FSN_OK
               : fsn_request_refuse(request, FSN_E_SPACE, "watch N NAME… shows parts of it",
                                    "the image is too long for a line");
}

static fsn_status watch_off(struct fsn_request *request) {
    if (request->count > 1) {
        return fsn_request_refuse(request, FSN_E_ARG, NULL, "watch off has no further words");
    }
    fsn_stream_end(request->client);
    fsn_json_put_u64(request->json, "watch", 0);
    return FSN_OK;
}

fsn_status fsn_answer_watch(struct fsn_request *request) {
    struct fsn_core *core = request->services->view.core;
    if (strcmp(request->argument[0], "off") == 0) {
        return watch_off(request);
    }
    if (core == NULL) {
        return fsn_request_refuse(request, FSN_E_STATE, "send start first", "the bus is stopped");
    }
    if (fsn_core_kept_cycles(core) == 0) {
        return fsn_request_refuse(request, FSN_E_STATE, "start fsn-master with --record 10s",
                                  "no cycles are recorded");
    }
    struct fsn_stream stream = {.next = fsn_core_last_cycle(core) + 1};
    const fsn_status found = read_stream(request, &stream);
    if (found != FSN_OK) {
        free(stream.symbols);
        return found;
    }
    fsn_stream_end(request->client);
    request->client->stream = stream;
    fsn_json_put_u64(request->json, "watch", stream.every);
    fsn_json_put_u64(request->json, "values", stream.count);
    fsn_json_put_bool(request->json, "image", stream.image);
    return FSN_OK;
}
