/** The document of one cycle: every counter, histogram and connection. */
#include "control/base/names.h"
#include "control/reports/parameters.h"
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
    fsn_json_put_u64(json, "count", histogram->count);
    fsn_json_put_u64(json, "sum_ns", histogram->sum_ns);
    fsn_json_put_u64(json, "min_ns", histogram->min_ns);
    fsn_json_put_u64(json, "max_ns", histogram->max_ns);
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
    fsn_json_put_open(json, "statistics", '{');
    fsn_json_put_u64(json, "cycles", s->cycles);
    fsn_json_put_u64(json, "overruns", s->overruns);
    fsn_json_put_u64(json, "wkc_errors", s->wkc_errors);
#define PUT(name) fsn_json_put_u64(json, #name, s->counts.name);
    FSN_FRAME_COUNT_TABLE(PUT)
#undef PUT
    fsn_json_put_u64(json, "send_errno", s->send_errno);
    fsn_json_put_u64(json, "bytes_copied", s->bytes_copied);
    fsn_json_put_u64(json, "now_ns", s->now_ns);
    fsn_json_put_u64(json, "dc_time_ns", s->dc_time_ns);
    fsn_json_put_u64(json, "events_lost", s->events_lost);
    fsn_json_put_u64(json, "expected_wkc", s->expected_wkc);
    fsn_json_put_u64(json, "actual_wkc", s->actual_wkc);
    fsn_json_put_u64(json, "copies", s->copies);
    fsn_json_put_u64(json, "merged_copies", s->merged_copies);
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
    fsn_json_put_u64(json, "frames", d->frames);
    fsn_json_put_u64(json, "process_data", d->process_data);
    fsn_json_put_u64(json, "failsafe_data", d->failsafe_data);
    fsn_json_put_u64(json, "right", d->right);
    fsn_json_put_u64(json, "wrong", d->wrong);
    fsn_json_put_u64(json, "unchecked", d->unchecked);
    fsn_json_put_u64(json, "resets", d->resets);
    fsn_json_put_u64(json, "last_new_ns", d->last_new_ns);
    fsn_json_put_u64(json, "interval_last_ns", d->interval_last_ns);
    fsn_json_put_u64(json, "interval_min_ns", d->interval_min_ns);
    fsn_json_put_u64(json, "interval_max_ns", d->interval_max_ns);
    fsn_json_put_u64(json, "interval_sum_ns", d->interval_sum_ns);
    fsn_json_put_u64(json, "intervals", d->intervals);
    fsn_json_put_u64(json, "connection_id", d->connection_id);
    fsn_json_put_u64(json, "command", d->command);
    fsn_json_put_text(json, "command_text", fsn_command_name(d->command));
    fsn_json_put_u64(json, "reset_code", d->reset_code);
    const bool has_reset = d->resets > 0 || d->command == FSN_CMD_RESET;
    fsn_json_put_text(json, "reset_text", has_reset ? fsn_reset_text(d->reset_code) : "");
    fsn_json_close(json, '}');
}

static void put_connection(struct fsn_bus_view *view, struct fsn_json *json, uint32_t number) {
    const struct fsn_connection_info info = fsn_known_connection(view->plan, number);
    const struct fsn_connection_status *status = &view->connections[number];
    fsn_json_open(json, '{');
    fsn_json_put_text(json, "name", info.name);
    fsn_json_put_text(json, "net", info.net);
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
    fsn_json_close(json, '}');
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

static void put_snapshot(struct fsn_bus_view *view, struct fsn_page *page, struct fsn_json *json,
                         bool taken) {
    const uint32_t connections = taken ? fsn_plan_connection_count(view->plan) : 0;
    fsn_report_fingerprint(view, json);
    if (taken) {
        put_statistics(json, &view->statistics);
    } else {
        fsn_json_key(json, "statistics");
        fsn_json_null(json);
    }
    fsn_json_put_open(json, "connections", '[');
    for (uint32_t i = 0; i < connections; i++) {
        if (fsn_page_takes(page, json)) {
            put_connection(view, json, i);
        }
    }
    fsn_json_close(json, ']');
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
