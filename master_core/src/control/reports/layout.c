/** Positions in the process image, for programs that read whole images. */
#include "control/reports/reports.h"
#include "plan/plan_internal.h"

void fsn_report_name(struct fsn_bus_view *view, struct fsn_json *json, const char *key,
                     uint32_t subdevice) {
    fsn_json_put_text(json, key, fsn_known_subdevice(view->plan, subdevice).name);
}

static void put_sms(struct fsn_bus_view *view, struct fsn_page *page, struct fsn_json *json) {
    struct fsn_sm_info info;
    fsn_json_put_open(json, "sms", '[');
    for (uint32_t sm = 0; fsn_plan_sm(view->plan, sm, &info) == FSN_OK; sm++) {
        const uint32_t byte = fsn_core_sm_base(view->core, sm);
        if (byte == FSN_NONE || !fsn_page_takes(page, json)) {
            continue;
        }
        fsn_json_open(json, '{');
        fsn_report_name(view, json, "subdevice", info.subdevice);
        fsn_json_put_u64(json, "sm", info.index);
        fsn_json_put_text(json, "direction", info.direction == FSN_OUTPUT ? "output" : "input");
        fsn_json_put_u64(json, "byte", byte);
        fsn_json_put_u64(json, "bytes", info.size_bytes);
        fsn_json_close(json, '}');
    }
    fsn_json_close(json, ']');
}

/** With the working counters of the last available cycle. */
static void put_datagrams(struct fsn_bus_view *view, struct fsn_page *page, struct fsn_json *json) {
    const struct fsn_core *core = view->core;
    const uint32_t count = fsn_core_datagram_count(core);
    const bool known =
        fsn_core_record(core, fsn_core_last_cycle(core), NULL, view->recorded.wkc, NULL) == FSN_OK;
    fsn_json_put_open(json, "datagrams", '[');
    for (uint32_t d = 0; d < count; d++) {
        const uint32_t byte = fsn_core_datagram_byte(core, d);
        const uint32_t end =
            d + 1 < count ? fsn_core_datagram_byte(core, d + 1) : fsn_core_image_bytes(core);
        if (!fsn_page_takes(page, json)) {
            continue;
        }
        fsn_json_open(json, '{');
        fsn_json_put_u64(json, "byte", byte);
        fsn_json_put_u64(json, "bytes", end - byte);
        if (known) {
            fsn_json_put_u64(json, "expected_wkc", view->recorded.wkc[d].expected);
        }
        fsn_json_close(json, '}');
    }
    fsn_json_close(json, ']');
}

static void put_place(struct fsn_bus_view *view, struct fsn_json *json,
                      const struct fsn_copy_info *copy) {
    fsn_json_put_u64(json, "source_byte",
                     fsn_core_sm_base(view->core, copy->source_sm) + copy->source_byte);
    fsn_json_put_u64(json, "destination_byte",
                     fsn_core_sm_base(view->core, copy->destination_sm) + copy->destination_byte);
    fsn_json_put_u64(json, "bytes", copy->size_bytes);
}

static void put_copy(struct fsn_bus_view *view, struct fsn_json *json, uint32_t number) {
    const struct fsn_copy_info copy = fsn_known_copy(view->plan, number);
    if (copy.net != NULL && copy.net[0] != 0) {
        fsn_json_put_text(json, "name", copy.net);
    }
    put_place(view, json, &copy);
}

static void put_way(struct fsn_bus_view *view, struct fsn_json *json, const char *key,
                    uint32_t number) {
    const struct fsn_copy_info copy = fsn_known_copy(view->plan, number);
    fsn_json_put_open(json, key, '{');
    put_place(view, json, &copy);
    fsn_json_close(json, '}');
}

static void put_connection(struct fsn_bus_view *view, struct fsn_json *json, uint32_t number) {
    const struct fsn_connection_info info = fsn_known_connection(view->plan, number);
    fsn_json_put_text(json, "name", info.name);
    fsn_report_name(view, json, "main", info.main_subdevice);
    fsn_report_name(view, json, "sub", info.sub_subdevice);
    fsn_json_put_known(json, "connection_id", (info.known & 1) != 0, info.connection_id);
    fsn_json_put_known(json, "address", (info.known & 2) != 0, info.address);
    fsn_json_put_known(json, "watchdog_ms", (info.known & 4) != 0, info.watchdog_ms);
    put_way(view, json, "to_sub", info.copy_to_sub);
    put_way(view, json, "to_main", info.copy_to_main);
}

fsn_status fsn_report_layout(struct fsn_bus_view *view, struct fsn_page *page,
                             struct fsn_json *json) {
    if (view->core == NULL) {
        return FSN_E_STATE;
    }
    fsn_json_put_u64(json, "image_bytes", fsn_core_image_bytes(view->core));
    put_sms(view, page, json);
    put_datagrams(view, page, json);
    fsn_report_rows(view, page, json, "copies", fsn_plan_copy_count(view->plan), put_copy);
    fsn_report_rows(view, page, json, "connections", fsn_plan_connection_count(view->plan),
                    put_connection);
    return FSN_OK;
}
