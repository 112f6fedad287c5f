/** Requests of cycles: a client gets every N-th cycle as a line, out of the recorder of the core.
 *  Nobody waits for a slow one: what it misses is counted. */
#include <stdlib.h>
#include <string.h>

#include "asked.h"
#include "value.h"

enum {
    MOST_EVERY = 1000000,      /**< cycles between two lines */
    TURN_LINES = 32,           /**< lines for one client before the others have their turn */
    PENDING_BYTES = 256 << 10, /**< unread bytes of a client that gets no more lines for now */
    LINE_BYTES = 256 << 10,    /**< of one line */
    NUMBER_BYTES = 28,         /**< of a value, with what stands around its name */
};

void fsn_stream_end(struct fsn_client *client) {
    free(client->stream.symbols);
    client->stream = (struct fsn_stream){0};
}

void fsn_streams_restart(struct fsn_control *control) {
    control->taken.cycle = 0;
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        control->client[i].stream.next = fsn_core_last_cycle(control->core) + 1;
    }
}

/** Takes a cycle out of the recorder, for all clients that want the same one. */
static fsn_status take(struct fsn_control *control, uint64_t number) {
    struct fsn_taken *taken = &control->taken;
    if (taken->cycle == number) {
        return FSN_OK;
    }
    const fsn_status found =
        fsn_core_record(control->core, number, &taken->record, NULL, taken->image);
    taken->cycle = found == FSN_OK ? number : 0;
    return found;
}

static void put_values(struct fsn_control *control, const struct fsn_stream *stream,
                       struct fsn_json *json) {
    fsn_json_key(json, "values");
    fsn_json_open(json, '{');
    for (size_t i = 0; i < stream->count; i++) {
        const struct fsn_symbol_info info = fsn_known_symbol(control->plan, stream->symbols[i]);
        uint64_t raw;
        if (fsn_core_read_symbol(control->core, control->taken.image, stream->symbols[i], &raw) ==
            FSN_OK) {
            fsn_json_key(json, info.name);
            (stream->typed ? fsn_value_write_typed : fsn_value_write)(&info, raw, json);
        }
    }
    fsn_json_close(json, '}');
}

static void put_image(struct fsn_control *control, struct fsn_json *json) {
    fsn_json_put_u64(json, "expected_wkc", control->taken.record.expected_wkc);
    fsn_json_put_u64(json, "actual_wkc", control->taken.record.actual_wkc);
    fsn_json_key(json, "image");
    fsn_json_hex(json, control->taken.image, fsn_core_image_bytes(control->core));
}

/** Writes the taken cycle as one line. */
static void put_line(struct fsn_control *control, struct fsn_client *client) {
    struct fsn_stream *stream = &client->stream;
    struct fsn_json *json = &control->line;
    fsn_json_clear(json);
    fsn_json_open(json, '{');
    fsn_json_put_text(json, "event", stream->image ? "image" : "values");
    fsn_json_put_u64(json, "cycle", control->taken.record.cycle);
    fsn_json_put_u64(json, "now_ns", control->taken.record.now_ns);
    if (stream->skipped > 0) {
        fsn_json_put_u64(json, "skipped", stream->skipped);
    }
    if (stream->image) {
        put_image(control, json);
    } else {
        put_values(control, stream, json);
    }
    fsn_json_close(json, '}');
    fsn_json_end(json);
    if (json->failed) {
        stream->skipped++;
        return;
    }
    stream->skipped = 0;
    fsn_client_put(client, json->bytes, json->len_bytes);
}

/** Leaves out what lies before cycle `until`. */
static void skip_to(struct fsn_stream *stream, uint64_t until) {
    if (until > stream->next) {
        const uint64_t count = (until - stream->next + stream->every - 1) / stream->every;
        stream->skipped += count;
        stream->next += count * stream->every;
    }
}

static void serve(struct fsn_control *control, struct fsn_client *client, uint64_t last) {
    struct fsn_stream *stream = &client->stream;
    for (int lines = 0; lines < TURN_LINES && stream->next <= last; lines++) {
        if (client->out.len_bytes - client->sent > PENDING_BYTES) {
            skip_to(stream, last + 1);
            return;
        }
        const fsn_status found = take(control, stream->next);
        if (found == FSN_OK) {
            put_line(control, client);
            stream->next += stream->every;
        } else if (found == FSN_E_ARG) {
            /* Overwritten. The oldest that are left are about to be. */
            const uint64_t kept = fsn_core_kept_cycles(control->core);
            skip_to(stream, last - kept + kept / 8 + 2);
        } else {
            return;
        }
    }
}

void fsn_streams_serve(struct fsn_control *control) {
    const uint64_t last = fsn_core_last_cycle(control->core);
    for (size_t i = 0; control->core != NULL && i < FSN_CONTROL_CLIENTS; i++) {
        struct fsn_client *client = &control->client[i];
        if (client->fd >= 0 && client->drop_reason == NULL && client->stream.every > 0) {
            serve(control, client, last);
        }
    }
}

/** Marks the symbols that a word names. */
static fsn_status mark(struct fsn_asked *asked, const char *word, uint8_t *marks) {
    const struct fsn_plan *plan = asked->control->plan;
    const size_t len = strlen(word);
    struct fsn_symbol_info info;
    uint32_t symbol;
    if (len == 0 || word[len - 1] != '*') {
        const fsn_status found = fsn_asked_symbol(asked, word, &symbol, &info);
        if (found == FSN_OK) {
            marks[symbol] = 1;
        }
        return found;
    }
    bool any = false;
    for (symbol = 0; fsn_plan_symbol(plan, symbol, &info) == FSN_OK; symbol++) {
        if (strncmp(info.name, word, len - 1) == 0) {
            marks[symbol] = 1;
            any = true;
        }
    }
    return any ? FSN_OK
               : fsn_refusal_set(&asked->refusal, FSN_E_ARG, "symbols lists the names",
                                 "no input or output begins with %.*s",
                                 len - 1 > 150 ? 150 : (int)(len - 1), word);
}

/** Takes over what is marked, and proves that a line of it is not too long. */
static fsn_status collect(struct fsn_asked *asked, const uint8_t *marks, uint32_t all,
                          struct fsn_stream *stream) {
    size_t bytes = 0;
    for (uint32_t i = 0; i < all; i++) {
        if (marks[i] != 0) {
            stream->symbols[stream->count++] = i;
            bytes += strlen(fsn_known_symbol(asked->control->plan, i).name) + NUMBER_BYTES;
        }
    }
    return bytes < LINE_BYTES - 256
               ? FSN_OK
               : fsn_asked_refuse(asked, FSN_E_SPACE, "name fewer", "too many values for a line");
}

/** Words behind the options: names; none means all. */
static fsn_status choose(struct fsn_asked *asked, size_t first, struct fsn_stream *stream) {
    const uint32_t all = fsn_plan_symbol_count(asked->control->plan);
    uint8_t *marks = calloc((size_t)all + 1, 1);
    stream->symbols = calloc((size_t)all + 1, sizeof *stream->symbols);
    if (marks == NULL || stream->symbols == NULL) {
        free(marks);
        return fsn_asked_refuse(asked, FSN_E_NOMEM, NULL, "out of memory");
    }
    if (first == asked->count) {
        memset(marks, 1, all);
    }
    fsn_status found = FSN_OK;
    for (size_t i = first; found == FSN_OK && i < asked->count; i++) {
        found = mark(asked, asked->argument[i], marks);
    }
    if (found == FSN_OK) {
        found = collect(asked, marks, all, stream);
    }
    free(marks);
    return found;
}

/** N [--image | --typed] [NAME…]. */
static fsn_status read_stream(struct fsn_asked *asked, struct fsn_stream *stream) {
    const struct fsn_symbol_info number = {.bits = 32, .kind = FSN_KIND_UNSIGNED};
    uint64_t every;
    if (fsn_value_parse(&number, asked->argument[0], &every) != NULL || every == 0 ||
        every > MOST_EVERY) {
        return fsn_asked_refuse(asked, FSN_E_ARG, "watch 1 shows every cycle; watch off ends it",
                                "watch takes 1 to 1000000 cycles, or off");
    }
    stream->every = (uint32_t)every;
    const char *option = asked->count > 1 ? asked->argument[1] : "";
    if (strncmp(option, "--", 2) != 0) {
        return choose(asked, 1, stream);
    }
    if (strcmp(option, "--typed") == 0) {
        stream->typed = true;
        return choose(asked, 2, stream);
    }
    if (strcmp(option, "--image") != 0) {
        return fsn_asked_refuse(asked, FSN_E_ARG, "watch N --image, or watch N [--typed] NAME…",
                                "watch has no such option");
    }
    stream->image = true;
    if (asked->count > 2) {
        return fsn_asked_refuse(asked, FSN_E_ARG, "the image holds all of them",
                                "watch --image takes no names");
    }
    return 2 * (uint64_t)fsn_core_image_bytes(asked->control->core) < LINE_BYTES - 256
               ? FSN_OK
               : fsn_asked_refuse(asked, FSN_E_SPACE, "watch N NAME… shows parts of it",
                                  "the image is too long for a line");
}

static fsn_status watch_off(struct fsn_asked *asked) {
    if (asked->count > 1) {
        return fsn_asked_refuse(asked, FSN_E_ARG, NULL, "watch off takes no more words");
    }
    fsn_stream_end(asked->client);
    fsn_json_put_u64(asked->json, "watch", 0);
    return FSN_OK;
}

fsn_status fsn_answer_watch(struct fsn_asked *asked) {
    struct fsn_core *core = asked->control->core;
    if (strcmp(asked->argument[0], "off") == 0) {
        return watch_off(asked);
    }
    if (core == NULL) {
        return fsn_asked_refuse(asked, FSN_E_STATE, "send start first", "the bus is stopped");
    }
    if (fsn_core_kept_cycles(core) == 0) {
        return fsn_asked_refuse(asked, FSN_E_STATE, "start fsn-master with --record 10s",
                                "no cycles are recorded");
    }
    struct fsn_stream stream = {.next = fsn_core_last_cycle(core) + 1};
    const fsn_status found = read_stream(asked, &stream);
    if (found != FSN_OK) {
        free(stream.symbols);
        return found;
    }
    fsn_stream_end(asked->client);
    asked->client->stream = stream;
    fsn_json_put_u64(asked->json, "watch", stream.every);
    fsn_json_put_u64(asked->json, "values", stream.count);
    fsn_json_put_bool(asked->json, "image", stream.image);
    return FSN_OK;
}
