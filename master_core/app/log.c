#define _POSIX_C_SOURCE 200809L

#include "log.h"

#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "control/internal.h"
#include "control/words.h"

static bool as_json; /* set once, before there are threads */

static const char *level_name(enum fsn_log_level level) {
    static const char *const names[] = {"detail", "info", "warning", "error"};
    return names[level];
}

void log_as_json(bool json) {
    as_json = json;
}

/** One write, so that lines of two threads do not mix. What stderr does not take at once is lost:
 *  a reader that stands still must not make leases stand still. */
static void put(const char *bytes, size_t len) {
    struct pollfd ready = {.fd = STDERR_FILENO, .events = POLLOUT};
    if (poll(&ready, 1, 0) == 1 && (ready.revents & POLLOUT) == 0) {
        return;
    }
    if (ready.revents == 0 || write(STDERR_FILENO, bytes, len) < 0) {
        return;
    }
}

static void put_text(enum fsn_log_level level, const char *text) {
    char utc[32];
    char line[1024];
    fsn_utc_text(fsn_now_ns(), utc);
    size_t len = (size_t)snprintf(line, sizeof line, "%s %s ", utc, level_name(level));
    /* Names in it come from files and devices. */
    len += fsn_show_text(line + len, sizeof line - len, text);
    line[len++] = '\n';
    put(line, len);
}

static void put_json(const char *json, size_t len) {
    char line[4096];
    if (len + 1 > sizeof line) { /* a fallback of very many outputs */
        put(json, len);
        put("\n", 1);
        return;
    }
    memcpy(line, json, len);
    line[len] = '\n';
    put(line, len + 1);
}

void log_line(enum fsn_log_level level, const char *format, ...) {
    char text[800];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (!as_json) {
        put_text(level, text);
        return;
    }
    struct fsn_json json = {.limit_bytes = 8192};
    char utc[32];
    fsn_utc_text(fsn_now_ns(), utc);
    fsn_json_open(&json, '{');
    fsn_json_put_text(&json, "event", "log");
    fsn_json_put_text(&json, "utc", utc);
    fsn_json_put_text(&json, "level", level_name(level));
    fsn_json_put_text(&json, "text", text);
    fsn_json_close(&json, '}');
    if (!json.failed) {
        put_json(json.bytes, json.len_bytes);
    }
    fsn_json_free(&json);
}

void log_event(enum fsn_log_level level, const char *text, const char *json, size_t json_bytes) {
    if (as_json) {
        put_json(json, json_bytes);
    } else if (level > FSN_LOG_DETAIL) {
        put_text(level, text);
    }
}
