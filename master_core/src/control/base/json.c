#include "control/base/json.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "control/base/clock.h"
#include "control/base/words.h"

void fsn_json_free(struct fsn_json *json) {
    free(json->bytes);
    *json = (struct fsn_json){.limit_bytes = json->limit_bytes};
}

void fsn_json_clear(struct fsn_json *json) {
    json->len_bytes = 0;
    json->failed = FSN_OK;
    json->comma = false;
}

static bool make_room(struct fsn_json *json, size_t more) {
    if (json->failed != FSN_OK) {
        return false;
    }
    if (more > json->limit_bytes - json->len_bytes) {
        json->failed = FSN_E_SPACE;
        return false;
    }
    if (more <= json->room_bytes - json->len_bytes) {
        return true;
    }
    size_t room = 2 * (json->len_bytes + more) + 256;
    room = room > json->limit_bytes ? json->limit_bytes : room;
    char *bytes = realloc(json->bytes, room);
    if (bytes == NULL) {
        json->failed = FSN_E_NOMEM;
        return false;
    }
    json->bytes = bytes;
    json->room_bytes = room;
    return true;
}

static void raw(struct fsn_json *json, const char *bytes, size_t len) {
    if (make_room(json, len)) {
        memcpy(json->bytes + json->len_bytes, bytes, len);
        json->len_bytes += len;
    }
}

static void value(struct fsn_json *json, const char *bytes, size_t len) {
    if (json->comma) {
        raw(json, ",", 1);
    }
    raw(json, bytes, len);
    json->comma = true;
}

void fsn_json_open(struct fsn_json *json, char bracket) {
    value(json, &bracket, 1);
    json->comma = false;
}

void fsn_json_close(struct fsn_json *json, char bracket) {
    raw(json, &bracket, 1);
    json->comma = true;
}

/** Writes one byte or one complete UTF-8 sequence; returns the number of bytes used. */
static size_t character(struct fsn_json *json, const char *at, size_t left) {
    if (*at == '"' || *at == '\\') {
        const char pair[2] = {'\\', *at};
        raw(json, pair, 2);
        return 1;
    }
    char shown[FSN_SHOWN_BYTES];
    const size_t taken = fsn_show_character(at, left, shown);
    raw(json, shown, strlen(shown));
    return taken;
}

void fsn_json_chars(struct fsn_json *json, const char *text, size_t left) {
    value(json, "\"", 1);
    while (left > 0 && json->failed == FSN_OK) {
        const size_t taken = character(json, text, left);
        text += taken;
        left -= taken;
    }
    raw(json, "\"", 1);
}

void fsn_json_text(struct fsn_json *json, const char *text) {
    if (text == NULL) {
        fsn_json_null(json);
    } else {
        fsn_json_chars(json, text, strlen(text));
    }
}

void fsn_json_raw(struct fsn_json *json, const char *bytes, size_t len_bytes) {
    value(json, bytes, len_bytes);
}

void fsn_json_key(struct fsn_json *json, const char *key) {
    fsn_json_text(json, key);
    raw(json, ":", 1);
    json->comma = false;
}

void fsn_json_u64(struct fsn_json *json, uint64_t number) {
    char text[24];
    value(json, text, (size_t)snprintf(text, sizeof text, "%" PRIu64, number));
}

void fsn_json_i64(struct fsn_json *json, int64_t number) {
    char text[24];
    value(json, text, (size_t)snprintf(text, sizeof text, "%" PRId64, number));
}

void fsn_json_real(struct fsn_json *json, double number) {
    char text[40];
    if (!isfinite(number)) {
        fsn_json_null(json);
        return;
    }
    value(json, text, (size_t)snprintf(text, sizeof text, "%.17g", number));
}

void fsn_json_bool(struct fsn_json *json, bool yes) {
    value(json, yes ? "true" : "false", yes ? 4 : 5);
}

void fsn_json_null(struct fsn_json *json) {
    value(json, "null", 4);
}

void fsn_json_hex(struct fsn_json *json, const uint8_t *bytes, size_t len_bytes) {
    static const char digits[] = "0123456789abcdef";
    value(json, "\"", 1);
    if (make_room(json, 2 * len_bytes)) {
        char *to = json->bytes + json->len_bytes;
        for (size_t i = 0; i < len_bytes; i++) {
            to[2 * i] = digits[bytes[i] >> 4];
            to[2 * i + 1] = digits[bytes[i] & 15];
        }
        json->len_bytes += 2 * len_bytes;
    }
    raw(json, "\"", 1);
}

void fsn_json_put_open(struct fsn_json *json, const char *key, char bracket) {
    fsn_json_key(json, key);
    fsn_json_open(json, bracket);
}

bool fsn_json_put_object(struct fsn_json *json, const char *key, bool exists) {
    fsn_json_key(json, key);
    if (exists) {
        fsn_json_open(json, '{');
    } else {
        fsn_json_null(json);
    }
    return exists;
}

void fsn_json_put_text(struct fsn_json *json, const char *key, const char *text) {
    fsn_json_key(json, key);
    fsn_json_text(json, text);
}

void fsn_json_put_u64(struct fsn_json *json, const char *key, uint64_t number) {
    fsn_json_key(json, key);
    fsn_json_u64(json, number);
}

void fsn_json_put_known(struct fsn_json *json, const char *key, bool known, uint64_t number) {
    fsn_json_key(json, key);
    if (known) {
        fsn_json_u64(json, number);
    } else {
        fsn_json_null(json);
    }
}

void fsn_json_put_bool(struct fsn_json *json, const char *key, bool yes) {
    fsn_json_key(json, key);
    fsn_json_bool(json, yes);
}

void fsn_json_put_bytes(struct fsn_json *json, const char *key, const uint8_t *bytes,
                        size_t count) {
    fsn_json_put_open(json, key, '[');
    for (size_t i = 0; i < count; i++) {
        fsn_json_u64(json, bytes[i]);
    }
    fsn_json_close(json, ']');
}

void fsn_json_put_hex(struct fsn_json *json, const char *key, const uint8_t *bytes,
                      size_t len_bytes) {
    fsn_json_key(json, key);
    fsn_json_hex(json, bytes, len_bytes);
}

void fsn_json_begin_event(struct fsn_json *json, const char *name, uint64_t at_ns) {
    char utc[32];
    fsn_utc_text(at_ns, utc);
    fsn_json_open(json, '{');
    fsn_json_put_text(json, "event", name);
    fsn_json_put_text(json, "utc", utc);
}

void fsn_json_end_event(struct fsn_json *json, const char *level, const char *text) {
    fsn_json_put_text(json, "level", level);
    fsn_json_put_text(json, "text", text);
    fsn_json_close(json, '}');
}

void fsn_json_end(struct fsn_json *json) {
    raw(json, "\n", 1);
}
