#define _POSIX_C_SOURCE 200809L

#include "app/log/log.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "control/base/clock.h"
#include "control/base/json.h"
#include "control/base/names.h"
#include "control/base/words.h"

enum { END_MS = 3000 /**< how long the end waits for the disk of the intervention log */ };

static bool as_json; /* set once, before there are threads */

/** The intervention log; NULL: none. Another thread may log while it ends. */
static struct {
    pthread_mutex_t lock; /**< held only for operations that do not wait */
    struct interventions *log;
} kept = {.lock = PTHREAD_MUTEX_INITIALIZER};

void log_as_json(bool json) {
    as_json = json;
}

enum { MOST_PIECE = 4096 }; /* a writable pipe accepts this many bytes without waiting: PIPE_BUF */

/** Destination of lines. Several threads write them. */
static struct {
    pthread_mutex_t lock; /**< held only for operations that do not wait */
    bool known;
    bool socket; /**< send() leaves the waiting to us */
    bool polled; /**< polled before each piece, because nothing else shows whether it would block */
    int fd;
    char *rest; /**< of a partly written line, or NULL */
    size_t rest_bytes, rest_at;
    unsigned long lost; /**< number of lines since the last written one */
} out = {.lock = PTHREAD_MUTEX_INITIALIZER};

/** Standard error may be shared with other programs, which expect it to block. Therefore a separate
 *  open file description is used for non-blocking writes. */
static void find_out(void) {
    struct stat found;
    out.known = true;
    out.fd = STDERR_FILENO;
    if (fstat(STDERR_FILENO, &found) != 0 || S_ISREG(found.st_mode)) {
        return;
    }
    out.socket = S_ISSOCK(found.st_mode);
    if (!out.socket) {
        const int own =
            open("/proc/self/fd/2", O_WRONLY | O_NONBLOCK | O_NOCTTY | O_APPEND | O_CLOEXEC);
        out.polled = own < 0;
        out.fd = own < 0 ? STDERR_FILENO : own;
    }
}

static ssize_t write_some(const char *bytes, size_t len) {
    if (out.socket) {
        return send(out.fd, bytes, len, MSG_DONTWAIT | MSG_NOSIGNAL);
    }
    struct pollfd ready = {.fd = out.fd, .events = POLLOUT};
    if (out.polled && (poll(&ready, 1, 0) != 1 || (ready.revents & POLLOUT) == 0)) {
        return -1;
    }
    return write(out.fd, bytes, out.polled && len > MOST_PIECE ? MOST_PIECE : len);
}

/** Writes the bytes that are accepted without waiting, and returns their number. */
static size_t write_all(const char *bytes, size_t len) {
    size_t done = 0;
    while (done < len) {
        const ssize_t wrote = write_some(bytes + done, len - done);
        if (wrote > 0) {
            done += (size_t)wrote;
        } else if (wrote == 0 || errno != EINTR) {
            break;
        }
    }
    return done;
}

/** Writes the rest of a line first; false if some of it is left. */
static bool finish_rest(void) {
    if (out.rest == NULL) {
        return true;
    }
    out.rest_at += write_all(out.rest + out.rest_at, out.rest_bytes - out.rest_at);
    if (out.rest_at < out.rest_bytes) {
        return false;
    }
    free(out.rest);
    out.rest = NULL;
    return true;
}

/** Writes a line, and stores the rest that is not accepted immediately; false if nothing was
 *  written. */
static bool put_whole(const char *line, size_t len) {
    const size_t done = finish_rest() ? write_all(line, len) : 0;
    if (done == 0) {
        return false;
    }
    if (done < len) {
        out.rest = malloc(len - done); /* without memory, the line stays incomplete */
        out.rest_bytes = out.rest != NULL ? len - done : 0;
        out.rest_at = 0;
        if (out.rest != NULL) {
            memcpy(out.rest, line + done, len - done);
        }
    }
    return true;
}

static size_t lost_line(char *line, size_t room) {
    char utc[32];
    fsn_utc_text(fsn_now_ns(), utc);
    char text[96];
    snprintf(text, sizeof text, "lines of this log that were lost unread: %lu", out.lost);
    const int len = snprintf(line, room,
                             as_json ? "{\"event\":\"log\",\"utc\":\"%s\",\"level\":\"%s\","
                                       "\"text\":\"%s\"}\n"
                                     : "%s %s %s\n",
                             utc, fsn_log_level_name(FSN_LOG_WARNING), text);
    return (size_t)len;
}

/** Writes one line, so that lines of two threads do not mix. Bytes that are not accepted
 *  immediately are lost and reported later: a stalled reader must not stall leases. */
static void put(const char *line, size_t len) {
    pthread_mutex_lock(&out.lock);
    if (!out.known) {
        find_out();
    }
    char lost[256];
    if (out.lost > 0 && put_whole(lost, lost_line(lost, sizeof lost))) {
        out.lost = 0;
    }
    out.lost += out.lost > 0 || !put_whole(line, len);
    pthread_mutex_unlock(&out.lock);
}

static void put_text(enum fsn_log_level level, const char *text) {
    char utc[32];
    char line[1024];
    fsn_utc_text(fsn_now_ns(), utc);
    size_t len = (size_t)snprintf(line, sizeof line, "%s %s ", utc, fsn_log_level_name(level));
    /* Names in it come from files and devices. */
    len += fsn_show_text(line + len, sizeof line - len, text);
    line[len++] = '\n';
    put(line, len);
}

static void put_json(struct fsn_json *json) {
    fsn_json_end(json);
    /* Without memory, it is also lost. */
    put(json->bytes, json->failed != FSN_OK ? 0 : json->len_bytes);
}

/** A line as an event; the caller frees it. */
static struct fsn_json as_event(const char *event, enum fsn_log_level level, const char *text) {
    struct fsn_json json = {.limit_bytes = 8192};
    fsn_json_begin_event(&json, event, fsn_now_ns());
    fsn_json_put_text(&json, "level", fsn_log_level_name(level));
    fsn_json_put_text(&json, "text", text);
    return json;
}

void log_entry(enum fsn_role account, const struct fsn_json *json) {
    pthread_mutex_lock(&kept.lock);
    if (kept.log != NULL && json->failed == FSN_OK) {
        interventions_put(kept.log, account, json->bytes, json->len_bytes);
    }
    pthread_mutex_unlock(&kept.lock);
}

/** Writes one line; `subdevice` may be NULL. */
static void write_line(enum fsn_log_level level, const char *subdevice, const char *text) {
    struct fsn_json json = as_event("log", level, text);
    if (subdevice != NULL) {
        fsn_json_put_text(&json, "subdevice", subdevice);
    }
    fsn_json_close(&json, '}');
    if (level >= FSN_LOG_WARNING) {
        log_entry(FSN_OBSERVER, &json);
    }
    if (as_json) {
        put_json(&json);
    } else {
        put_text(level, text);
    }
    fsn_json_free(&json);
}

void log_line(enum fsn_log_level level, const char *format, ...) {
    char text[800];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    write_line(level, NULL, text);
}

void log_subdevice(enum fsn_log_level level, const char *subdevice, const char *format, ...) {
    char text[800];
    size_t len = (size_t)snprintf(text, sizeof text, "SubDevice %.80s: ", subdevice);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text + len, sizeof text - len, format, arguments);
    va_end(arguments);
    write_line(level, subdevice, text);
}

void log_event(enum fsn_log_level level, enum fsn_role account, const char *text, const char *json,
               size_t json_bytes) {
    pthread_mutex_lock(&kept.lock);
    interventions_put_event(kept.log, account, json, json_bytes);
    pthread_mutex_unlock(&kept.lock);
    if (as_json) {
        struct fsn_json line = {.limit_bytes = json_bytes + 2};
        fsn_json_raw(&line, json, json_bytes);
        put_json(&line);
        fsn_json_free(&line);
    } else if (level > FSN_LOG_DETAIL) {
        put_text(level, text);
    }
}

void log_keep(struct interventions *log) {
    pthread_mutex_lock(&kept.lock);
    kept.log = log;
    pthread_mutex_unlock(&kept.lock);
}

bool log_kept(struct fsn_interventions *state) {
    if (kept.log != NULL) {
        interventions_state(kept.log, state);
    }
    return kept.log != NULL;
}

int log_end(int code) {
    if (kept.log == NULL) {
        return code;
    }
    char text[64];
    snprintf(text, sizeof text, "ends with exit code %d", code);
    struct fsn_json json = as_event("stop", FSN_LOG_INFO, text);
    fsn_json_put_u64(&json, "code", (uint64_t)code);
    fsn_json_close(&json, '}');
    log_entry(FSN_MAINTAINER, &json);
    fsn_json_free(&json);
    pthread_mutex_lock(&kept.lock);
    struct interventions *log = kept.log;
    kept.log = NULL;
    pthread_mutex_unlock(&kept.lock);
    const uint64_t left = interventions_close(log, END_MS);
    if (left > 0) {
        log_line(FSN_LOG_ERROR, "entries of the intervention log that were not written: %llu",
                 (unsigned long long)left);
    }
    return code;
}
