#include "control/reports/events.h"

#include <stdarg.h>
#include <stdio.h>

#include "control/base/clock.h"
#include "control/base/names.h"

static void put_head(struct fsn_events *events) {
    fsn_json_begin_event(&events->json, events->name, events->at_ns);
    fsn_json_put_u64(&events->json, "now_ns", events->at_ns);
}

struct fsn_json *fsn_event_begin(struct fsn_events *events, const char *name, uint64_t at_ns) {
    fsn_json_free(&events->json);
    events->name = name;
    events->at_ns = at_ns;
    events->account = FSN_OBSERVER;
    put_head(events);
    return &events->json;
}

struct fsn_json *fsn_event_begin_act(struct fsn_events *events, const char *name,
                                     enum fsn_role role) {
    struct fsn_json *json = fsn_event_begin(events, name, fsn_now_ns());
    events->account = role;
    return json;
}

void fsn_event_send(struct fsn_events *events, enum fsn_log_level level, const char *format, ...) {
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    const struct fsn_control_host *host = events->host;
    struct fsn_json *json = &events->json;
    fsn_json_end_event(json, fsn_log_level_name(level), text);
    if (json->failed != FSN_OK) { /* too long: without its keys it fits into the memory */
        fsn_json_clear(json);
        put_head(events);
        fsn_json_put_bool(json, "cut", true);
        fsn_json_end_event(json, fsn_log_level_name(level), text);
    }
    if (json->failed != FSN_OK) {
        host->log(host->self, level, events->account, text, "{}", 2);
        return;
    }
    host->log(host->self, level, events->account, text, json->bytes, json->len_bytes);
    events->deliver(events->self, json);
}
