/** The first line of an incident file. */
#include <stdlib.h>
#include <string.h>

#include "control/base/clock.h"
#include "control/incidents/kept.h"
#include "control/reports/reports.h"
#include "fsn/version.h"
#include "plan/plan_internal.h"

static void put_base64(struct fsn_json *json, const char *key, const uint8_t *bytes,
                       size_t len_bytes) {
    static const char digit[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    char *text = malloc(len_bytes / 3 * 4 + 5);
    size_t at = 0;
    if (text == NULL) {
        json->failed = FSN_E_NOMEM;
        return;
    }
    for (size_t i = 0; i < len_bytes; i += 3) {
        const size_t left = len_bytes - i;
        const uint32_t word = ((uint32_t)bytes[i] << 16) |
                              (left > 1 ? (uint32_t)bytes[i + 1] << 8 : 0) |
                              (left > 2 ? bytes[i + 2] : 0u);
        text[at++] = digit[word >> 18];
        text[at++] = digit[(word >> 12) & 63];
        text[at++] = left > 1 ? digit[(word >> 6) & 63] : '=';
        text[at++] = left > 2 ? digit[word & 63] : '=';
    }
    text[at] = 0;
    fsn_json_put_text(json, key, text);
    free(text);
}

static void put_or_null(struct fsn_json *json, const char *key, const char *text) {
    fsn_json_put_text(json, key, text[0] != 0 ? text : NULL);
}

static void put_fault(struct fsn_json *json, const struct fsn_plan *plan,
                      const struct fsn_fault *fault) {
    struct fsn_subdevice_info info;
    const bool named = fault->section == FSN_SEC_SUBDEVICE &&
                       fsn_plan_subdevice(plan, fault->copy_index, &info) == FSN_OK;
    fsn_json_put_open(json, "fault", '{');
    fsn_json_put_text(json, "status", fsn_status_name(fault->status));
    fsn_json_put_text(json, "subdevice", named ? info.name : NULL);
    fsn_json_put_bool(json, "link_down", fault->link_down);
    fsn_json_close(json, '}');
}

const char *fsn_trigger_name(enum fsn_trigger_kind kind) {
    static const char *const name[] = {"left_data", "not_connected", "refused", "bus_failed",
                                       "request"};
    return name[kind];
}

static void put_trigger(struct fsn_json *json, const struct fsn_plan *plan,
                        const struct fsn_pending *p) {
    fsn_json_put_open(json, "trigger", '{');
    fsn_json_put_text(json, "kind", fsn_trigger_name(p->kind));
    put_or_null(json, "connection", p->connection);
    put_or_null(json, "subdevice", p->subdevice);
    put_or_null(json, "before", p->before);
    put_or_null(json, "after", p->after);
    put_or_null(json, "reset_by", p->reset_by);
    fsn_json_put_u64(json, "reset_code", p->reset_code);
    put_or_null(json, "reset_text", p->reset_text);
    FSN_JSON_PUT(json, p, cycle, now_ns, text);
    if (p->has_fault) {
        put_fault(json, plan, &p->fault);
    }
    fsn_json_close(json, '}');
}

static void put_events(const struct fsn_incidents *in, struct fsn_json *json) {
    fsn_json_put_open(json, "events", '[');
    for (unsigned i = 0; i < FSN_INCIDENT_EVENTS; i++) {
        const char *event = in->event[(in->next_event + i) % FSN_INCIDENT_EVENTS];
        if (event != NULL) {
            fsn_json_raw(json, event, strlen(event));
        }
    }
    fsn_json_close(json, ']');
}

void fsn_incident_head(struct fsn_incidents *in, struct fsn_json *json) {
    struct fsn_bus_view *view = in->view;
    const struct fsn_control_status status = fsn_program_status(view->host);
    char utc[32];
    fsn_utc_text(in->pending.now_ns, utc);
    fsn_json_open(json, '{');
    fsn_json_put_u64(json, "incident", 1);
    fsn_json_put_text(json, "utc", utc);
    fsn_json_put_text(json, "version", fsn_version());
    FSN_JSON_PUT(json, &status, backend, interface, plan_file);
    fsn_json_put_text(json, "plan_sha256", view->sha256);
    fsn_json_put_u64(json, "cycle_ns", status.cycle_ns);
    put_trigger(json, view->plan, &in->pending);
    fsn_report_last_cycle(view, json);
    fsn_report_ring(view, json);
    fsn_report_clocks(view, json);
    if (fsn_json_put_object(json, "layout", view->core != NULL)) {
        struct fsn_page whole = {0};
        (void)fsn_report_layout(view, &whole, json);
        fsn_json_close(json, '}');
    }
    if (in->fsoe.len_bytes > 0) {
        fsn_json_key(json, "fsoe");
        fsn_json_raw(json, in->fsoe.bytes, in->fsoe.len_bytes);
    }
    put_events(in, json);
    put_base64(json, "plan", view->plan->bytes, view->plan->len_bytes);
    fsn_json_close(json, '}');
    fsn_json_end(json);
}
