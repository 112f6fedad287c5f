/** State of program and bus, SubDevices, symbols. */
#include "control/base/clock.h"
#include "control/base/names.h"
#include "control/base/value.h"
#include "control/reports/reports.h"
#include "fsn/version.h"
#include "plan/plan_internal.h"

void fsn_report_fingerprint(struct fsn_bus_view *view, struct fsn_json *json) {
    const struct fsn_fingerprint *made = &view->fingerprint;
    char code[FSN_FINGERPRINT_CODE_BYTES];
    const struct fsn_control_status status = fsn_program_status(view->host);
    fsn_fingerprint_code(made, code);
    fsn_json_put_open(json, "fingerprint", '{');
    fsn_json_put_text(json, "form", FSN_FINGERPRINT_FORM);
    fsn_json_put_text(json, "short", code);
    fsn_json_put_hex(json, "whole", made->whole, sizeof made->whole);
    fsn_json_put_open(json, "sections", '{');
    for (uint32_t i = 0; i < FSN_FINGERPRINT_SECTIONS; i++) {
        fsn_json_put_hex(json, fsn_fingerprint_section(i), made->section[i],
                         sizeof made->section[i]);
    }
    fsn_json_close(json, '}');
    fsn_json_put_text(json, "version", fsn_version());
    fsn_json_put_u64(json, "cycle_ns", status.cycle_ns);
    fsn_json_close(json, '}');
}

static void short_subdevices(struct fsn_bus_view *view, struct fsn_json *json) {
    uint32_t in_op = 0;
    uint32_t missing = 0;
    uint32_t absent = 0;
    const uint32_t count = fsn_plan_subdevice_count(view->plan);
    struct fsn_bus_subdevice seen;
    for (uint32_t i = 0; fsn_core_subdevice(view->core, i, &seen) == FSN_OK; i++) {
        in_op += seen.al_status == FSN_AL_OP;
        absent += seen.found == FSN_FOUND_ABSENT;
        missing += seen.al_status == FSN_AL_NONE && seen.found != FSN_FOUND_ABSENT;
    }
    fsn_json_put_open(json, "subdevices", '{');
    fsn_json_put_u64(json, "planned", count);
    fsn_json_put_u64(json, "in_op", in_op);
    fsn_json_put_u64(json, "missing", missing);
    if (fsn_plan_group_count(view->plan) > 0) {
        fsn_json_put_u64(json, "absent", absent);
    }
    fsn_json_close(json, '}');
}

void fsn_report_ring_keys(const struct fsn_bus_ring *ring, struct fsn_json *json) {
    fsn_json_put_text(json, "state", fsn_ring_text(ring->state));
    fsn_json_put_bytes(json, "ways", ring->ways, sizeof ring->ways);
    FSN_JSON_PUT(json, ring, breaks, place);
}

void fsn_report_ring(struct fsn_bus_view *view, struct fsn_json *json) {
    struct fsn_bus_ring ring;
    if (fsn_json_put_object(json, "ring", fsn_core_ring(view->core, &ring) == FSN_OK)) {
        fsn_report_ring_keys(&ring, json);
        fsn_json_close(json, '}');
    }
}

void fsn_report_clocks_keys(const struct fsn_bus_clocks *clocks, struct fsn_json *json) {
    fsn_json_put_text(json, "state", fsn_clocks_text(clocks->state));
    fsn_json_put_text(json, "set_by", clocks->host ? "host" : "bus");
    FSN_JSON_PUT(json, clocks, reference, subdevices, outside, leaves, window_ns);
    FSN_JSON_PUT(json, clocks, worst_ns, shift_ns, lead_ns, place);
}

void fsn_report_clocks(struct fsn_bus_view *view, struct fsn_json *json) {
    struct fsn_bus_clocks clocks;
    if (fsn_json_put_object(json, "clocks", fsn_core_clocks(view->core, &clocks) == FSN_OK)) {
        fsn_report_clocks_keys(&clocks, json);
        fsn_json_close(json, '}');
    }
}

/** Number of connections with known parameters, and of those that differ from the plan. */
static void put_parameters(struct fsn_bus_view *view, struct fsn_json *json, bool taken) {
    uint32_t observed = 0;
    uint32_t differing = 0;
    const uint32_t count = taken ? fsn_plan_connection_count(view->plan) : 0;
    for (uint32_t i = 0; i < count; i++) {
        observed += (view->connections[i].parameters.known & FSN_STATED_WATCHDOG) != 0;
        differing += view->connections[i].differs != 0;
    }
    fsn_json_put_open(json, "parameters", '{');
    fsn_json_put_u64(json, "observed", observed);
    fsn_json_put_u64(json, "differing", differing);
    fsn_json_close(json, '}');
}

static void put_cycle(struct fsn_bus_view *view, struct fsn_json *json) {
    struct fsn_statistics *s = &view->statistics;
    const bool taken = fsn_core_snapshot(view->core, s, view->connections, NULL) == FSN_OK;
    if (!taken) {
        *s = (struct fsn_statistics){0};
    }
    FSN_JSON_PUT(json, s, cycles, overruns, wkc_errors, expected_wkc, actual_wkc);
    fsn_json_put_bool(json, "realtime", s->realtime != 0);
    fsn_json_put_bool(json, "locked", s->locked != 0);
    put_parameters(view, json, taken);
}

/** Writes each of several buses; the values above are for all of them together. */
static void put_buses(struct fsn_bus_view *view, const struct fsn_control_status *status,
                      struct fsn_json *json) {
    const uint32_t count = fsn_plan_bus_count(view->plan);
    if (count == 1) {
        return;
    }
    fsn_json_put_open(json, "buses", '[');
    for (uint32_t n = 0; n < count; n++) {
        struct fsn_bus_info info;
        struct fsn_statistics *s = &view->statistics;
        if (fsn_plan_bus(view->plan, n, &info) != FSN_OK ||
            fsn_core_bus(view->core, n, s) != FSN_OK) {
            *s = (struct fsn_statistics){0};
        }
        fsn_json_open(json, '{');
        fsn_json_put_text(json, "name", info.name);
        fsn_json_put_text(json, "interface",
                          status->bus_interfaces != NULL ? status->bus_interfaces[n] : NULL);
        fsn_json_put_u64(json, "cycle_ns", info.cycle_ns);
        FSN_JSON_PUT(json, s, cycles, overruns, wkc_errors);
        fsn_json_put_u64(json, "lost_frames", s->counts.lost_frames);
        FSN_JSON_PUT(json, s, expected_wkc, actual_wkc);
        fsn_json_put_bool(json, "realtime", s->realtime != 0);
        fsn_json_close(json, '}');
    }
    fsn_json_close(json, ']');
}

void fsn_report_interventions(const struct fsn_interventions *log, struct fsn_json *json) {
    FSN_JSON_PUT(json, log, folder, entry);
    fsn_json_put_text(json, "hash", log->hash[0] != 0 ? log->hash : NULL);
    FSN_JSON_PUT(json, log, waiting, lost, bytes, limit_bytes, limited, error);
}

/** The required record, and its signers. */
static void put_acceptance(const struct fsn_control_status *status, struct fsn_json *json) {
    if (fsn_json_put_object(json, "acceptance", status->acceptance != NULL)) {
        fsn_json_put_text(json, "record", status->acceptance);
        fsn_json_put_text(json, "said", status->acceptance_said);
        fsn_json_close(json, '}');
    }
}

static void put_interventions(const struct fsn_interventions *log, struct fsn_json *json) {
    if (fsn_json_put_object(json, "interventions", log != NULL)) {
        fsn_report_interventions(log, json);
        fsn_json_close(json, '}');
    }
}

static void put_standby(const struct fsn_control_status *status, struct fsn_json *json) {
    if (fsn_json_put_object(json, "standby", status->standby_pid != 0)) {
        fsn_json_put_u64(json, "pid", (uint64_t)status->standby_pid);
        fsn_json_put_bool(json, "held", status->standby_held);
        fsn_json_close(json, '}');
    }
}

void fsn_report_status(struct fsn_bus_view *view, uint32_t clients, struct fsn_json *json) {
    const struct fsn_control_status status = fsn_program_status(view->host);
    fsn_json_put_text(json, "state", fsn_program_state_name(status.state));
    FSN_JSON_PUT(json, &status, fault, backend, interface, redundant, xdp);
    fsn_json_put_text(json, "plan", status.plan_file);
    fsn_json_put_text(json, "plan_sha256", view->sha256);
    fsn_report_fingerprint(view, json);
    fsn_json_put_bool(json, "accepted", status.accepted != NULL);
    fsn_json_put_bool(json, "require_observed", status.require_observed);
    put_acceptance(&status, json);
    put_interventions(status.interventions, json);
    fsn_json_put_u64(json, "uptime_ns", fsn_now_ns() - status.started_ns);
    FSN_JSON_PUT(json, &status, cycle_ns, free_run, policy);
    fsn_json_put_u64(json, "priority", (uint64_t)status.priority);
    fsn_json_put_known(json, "cpu", status.cpu > 0, (uint64_t)status.cpu - 1);
    put_cycle(view, json);
    put_buses(view, &status, json);
    short_subdevices(view, json);
    fsn_report_groups(view, json);
    fsn_report_ring(view, json);
    fsn_report_clocks(view, json);
    put_standby(&status, json);
    fsn_json_put_u64(json, "clients", clients);
}

static void put_subdevice(struct fsn_bus_view *view, struct fsn_json *json, uint32_t number) {
    const struct fsn_subdevice_info info = fsn_known_subdevice(view->plan, number);
    struct fsn_bus_subdevice seen = {0};
    char al[24];
    fsn_json_put_u64(json, "number", number);
    FSN_JSON_PUT(json, &info, name, alias, position);
    if (fsn_plan_bus_count(view->plan) > 1) {
        fsn_json_put_u64(json, "bus", fsn_plan_bus_of(view->plan, number));
    }
    bool known = view->subdevices_known;
    if (view->core != NULL) {
        known = fsn_core_subdevice(view->core, number, &seen) == FSN_OK;
    } else if (known) {
        seen = view->subdevice[number]; /* the bus did not open: last result of the search */
    }
    fsn_json_put_bool(json, "known", known);
    if (known) {
        seen.detail[FSN_DETAIL_BYTES - 1] = 0;
        fsn_json_put_text(json, "al", fsn_al_text(seen.al_status, al));
        FSN_JSON_PUT(json, &seen, al_status, al_code, found);
        fsn_json_put_text(json, "found_text", fsn_found_text(seen.found));
        FSN_JSON_PUT(json, &seen, detail, vendor_id, product_code, revision, fsoe_address,
                     link_down, returns);
        fsn_json_put_bytes(json, "link", seen.link, FSN_PORTS);
        fsn_json_put_bytes(json, "link_lost", seen.link_lost, FSN_PORTS);
        fsn_json_put_bytes(json, "rx_errors", seen.rx_errors, FSN_PORTS);
    }
    uint64_t stale = 0;
    for (uint32_t sm = 0; view->core != NULL && sm < info.sm_count; sm++) {
        stale += fsn_core_stale_cycles(view->core, info.first_sm + sm);
    }
    fsn_json_put_u64(json, "stale_cycles", stale);
}

fsn_status fsn_report_subdevices(struct fsn_bus_view *view, struct fsn_page *page,
                                 struct fsn_json *json) {
    fsn_report_rows(view, page, json, "subdevices", fsn_plan_subdevice_count(view->plan),
                    put_subdevice);
    return FSN_OK;
}

static void put_symbol(struct fsn_bus_view *view, struct fsn_json *json, uint32_t number) {
    const struct fsn_symbol_info info = fsn_known_symbol(view->plan, number);
    const struct fsn_entry_record object = fsn_symbol_object(view->plan, &info);
    const struct fsn_output_state state = fsn_outputs_state(view->outputs, number);
    fsn_json_put_text(json, "name", info.name);
    fsn_json_put_text(json, "subdevice", fsn_symbol_subdevice(view->plan, &info));
    fsn_json_put_text(json, "direction", info.output != 0 ? "output" : "input");
    FSN_JSON_PUT(json, &object, index, subindex);
    fsn_json_put_text(json, "type", fsn_value_type(&info));
    fsn_json_put_u64(json, "bits", info.bits);
    fsn_json_key(json, "factor");
    fsn_json_real(json, info.factor);
    fsn_json_key(json, "offset");
    fsn_json_real(json, info.offset);
    fsn_json_put_bool(json, "open", state.open);
    if (info.output != 0) {
        fsn_json_put_bool(json, "restart_relevant", info.restart_relevant != 0);
        fsn_json_key(json, "stop_value");
        fsn_value_write(&info, info.stop_value, json);
        fsn_json_put_known(json, "client", state.owner != FSN_NOBODY, state.owner);
    }
}

fsn_status fsn_report_symbols(struct fsn_bus_view *view, struct fsn_page *page,
                              struct fsn_json *json) {
    fsn_report_rows(view, page, json, "symbols", fsn_plan_symbol_count(view->plan), put_symbol);
    return FSN_OK;
}
