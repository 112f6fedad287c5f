#include "control/reports/events.h"

#include <stdarg.h>
#include <stdio.h>

#include "control/base/clock.h"

struct fsn_json *fsn_event_begin(struct fsn_events *events, const char *name, uint64_t at_ns) {
    struct fsn_json *json = &events->json;
    char utc[32];
    fsn_json_free(json);
    fsn_utc_text(at_ns, utc);
    fsn_json_open(json, '{');
    fsn_json_put_text(json, "event", name);
    fsn_json_put_text(json, "utc", utc);
    fsn_json_put_u64(json, "now_ns", at_ns);
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
    static const char *const level_name[] = {"detail", "info", "warning", "error"};
    fsn_json_put_text(json, "level", level_name[level]);
    fsn_json_put_text(json, "text", text);
    fsn_json_close(json, '}');
    if (json->failed != FSN_OK) {
        host->log(host->self, level, text, "{}", 2);
        return;
    }
    host->log(host->self, level, text, json->bytes, json->len_bytes);
    events->deliver(events->self, json);
}
