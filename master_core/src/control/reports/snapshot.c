/** The document of one cycle: every counter, histogram and connection. */
#include "control/base/names.h"
#include "control/reports/reports.h"
#include "plan/plan_internal.h"

static void percentiles(struct fsn_json *json, const struct fsn_histogram *histogram) {
    static const struct {
        const char *key;
        uint32_t per_million;
    } wanted[] = {
        {"p50", 500000}, {"p90", 900000}, {"p99", 990000}, {"p999", 999000}, {"p9999", 999900}};
    fsn_json_put_open(json, "percentiles_ns", '{');
    for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; i++) {
        fsn_json_put_u64(json, wanted[i].key,
                         fsn_histogram_percentile(histogram, wanted[i].per_million));
    }
    fsn_json_close(json, '}');
}

static void put_histogram(struct fsn_json *json, const char *key,
                          const struct fsn_histogram *histogram) {
    fsn_json_put_open(json, key, '{');
    FSN_JSON_PUT(json, histogram, count, sum_ns, min_ns, max_ns);
    percentiles(json, histogram);
    fsn_json_put_open(json, "buckets", '[');
    for (uint32_t i = 0; i < FSN_BUCKETS; i++) {
        if (histogram->bucket[i] != 0) {
            fsn_json_open(json, '[');
            fsn_json_u64(json, fsn_histogram_floor(i));
            fsn_json_u64(json, histogram->bucket[i]);
            fsn_json_close(json, ']');
        }
    }
    fsn_json_close(json, ']');
    fsn_json_close(json, '}');
}

static void put_statistics(struct fsn_json *json, const struct fsn_statistics *s) {
    FSN_JSON_PUT(json, s, cycles, overruns, wkc_errors);
#define PUT(name) fsn_json_put_u64(json, #name, s->counts.name);
    FSN_FRAME_COUNT_TABLE(PUT)
#undef PUT
    FSN_JSON_PUT(json, s, send_errno, bytes_copied, now_ns, dc_time_ns, events_lost);
    FSN_JSON_PUT(json, s, expected_wkc, actual_wkc, copies, merged_copies);
    fsn_json_put_bool(json, "realtime", s->realtime != 0);
    fsn_json_put_bool(json, "locked", s->locked != 0);
    put_histogram(json, "latency", &s->latency);
    put_histogram(json, "period", &s->period);
    put_histogram(json, "work", &s->work);
    put_histogram(json, "copy", &s->copy);
    put_histogram(json, "round_trip", &s->round_trip);
    put_histogram(json, "dc_offset", &s->dc_offset);
    fsn_json_close(json, '}');
}

static void put_direction(struct fsn_json *json, const char *key, const struct fsn_direction *d) {
    fsn_json_put_open(json, key, '{');
    FSN_JSON_PUT(json, d, frames, process_data, failsafe_data, right, wrong, unchecked);
    FSN_JSON_PUT(json, d, resets, last_new_ns, interval_last_ns, interval_min_ns, interval_max_ns,
                 interval_sum_ns);
    FSN_JSON_PUT(json, d, intervals, connection_id, command);
    fsn_json_put_text(json, "command_text", fsn_command_name(d->command));
    fsn_json_put_u64(json, "reset_code", d->reset_code);
    const bool has_reset = d->resets > 0 || d->command == FSN_CMD_RESET;
    fsn_json_put_text(json, "reset_text", has_reset ? fsn_reset_text(d->reset_code) : "");
    fsn_json_close(json, '}');
}

static void put_connection(struct fsn_bus_view *view, struct fsn_json *json, uint32_t number) {
    const struct fsn_connection_info info = fsn_known_connection(view->plan, number);
    const struct fsn_connection_status *status = &view->connections[number];
    FSN_JSON_PUT(json, &info, name, net);
    fsn_report_name(view, json, "main", info.main_subdevice);
    fsn_report_name(view, json, "sub", info.sub_subdevice);
    fsn_json_put_u64(json, "observed_state", status->observed);
    fsn_json_put_text(json, "state", fsn_observed_text(status->observed));
    fsn_json_put_u64(json, "gaps", status->gaps);
    const struct fsn_parameters planned = fsn_planned_parameters(&info);
    fsn_report_parameters(json, "configured", &planned);
    fsn_report_parameters(json, "observed", &status->parameters);
    fsn_report_differs(json, status->differs);
    put_direction(json, "to_sub", &status->direction[FSN_TO_SUB]);
    put_direction(json, "to_main", &status->direction[FSN_TO_MAIN]);
}

static fsn_status take_snapshot(struct fsn_bus_view *view) {
    return view->core == NULL
               ? FSN_E_STATE
               : fsn_core_snapshot(view->core, &view->statistics, view->connections, NULL);
}

bool fsn_page_takes(struct fsn_page *page, const struct fsn_json *json) {
    const uint32_t row = page->row++;
    const bool is_full = page->limit_bytes != 0 && json->len_bytes > page->limit_bytes;
    if (row > page->first && page->next == 0 && is_full) {
        page->next = row;
    }
    return row >= page->first && page->next == 0;
}

void fsn_report_rows(struct fsn_bus_view *view, struct fsn_page *page, struct fsn_json *json,
                     const char *key, uint32_t count,
                     void (*put)(struct fsn_bus_view *view, struct fsn_json *json, uint32_t row)) {
    fsn_json_put_open(json, key, '[');
    for (uint32_t row = 0; row < count; row++) {
        if (fsn_page_takes(page, json)) {
            fsn_json_open(json, '{');
            put(view, json, row);
            fsn_json_close(json, '}');
        }
    }
    fsn_json_close(json, ']');
}

static void put_snapshot(struct fsn_bus_view *view, struct fsn_page *page, struct fsn_json *json,
                         bool taken) {
    const uint32_t connections = taken ? fsn_plan_connection_count(view->plan) : 0;
    fsn_report_fingerprint(view, json);
    if (fsn_json_put_object(json, "statistics", taken)) {
        put_statistics(json, &view->statistics);
    }
    fsn_report_rows(view, page, json, "connections", connections, put_connection);
    (void)fsn_report_subdevices(view, page, json);
}

fsn_status fsn_report_snapshot(struct fsn_bus_view *view, struct fsn_page *page,
                               struct fsn_json *json) {
    const fsn_status status = take_snapshot(view);
    if (status == FSN_OK) {
        put_snapshot(view, page, json, true);
    }
    return status;
}

void fsn_report_last_cycle(struct fsn_bus_view *view, struct fsn_json *json) {
    struct fsn_page whole = {0};
    put_snapshot(view, &whole, json, take_snapshot(view) == FSN_OK);
}
