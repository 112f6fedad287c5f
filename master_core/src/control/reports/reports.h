/** The documents of the control socket and of incident files. */
#ifndef FSN_CONTROL_REPORTS_H
#define FSN_CONTROL_REPORTS_H

#include "control/base/json.h"
#include "control/reports/bus_view.h"
#include "fsn/monitor.h"

/** Part of a report whose rows do not all fit into one reply. Zero means the whole report. */
struct fsn_page {
    uint32_t first;     /**< first row to write */
    size_t limit_bytes; /**< no row is begun beyond this length of the report; 0: no limit */
    uint32_t row;       /**< rows so far, written or not */
    uint32_t next;      /**< first row of the next page; 0: no further page */
};

/** Counts a row, and returns whether it belongs to this page. A page has at least one row. */
bool fsn_page_takes(struct fsn_page *page, const struct fsn_json *json);

/** Writes the rows of this page as an array of objects; `put` writes the keys of one row. */
void fsn_report_rows(struct fsn_bus_view *view, struct fsn_page *page, struct fsn_json *json,
                     const char *key, uint32_t count,
                     void (*put)(struct fsn_bus_view *view, struct fsn_json *json, uint32_t row));

/** Short state of program and bus. `clients`: number of connected clients. */
void fsn_report_status(struct fsn_bus_view *view, uint32_t clients, struct fsn_json *json);
fsn_status fsn_report_subdevices(struct fsn_bus_view *view, struct fsn_page *page,
                                 struct fsn_json *json);
/** The ring, or null if the bus is not a ring or is stopped; only its keys. */
void fsn_report_ring(struct fsn_bus_view *view, struct fsn_json *json);
void fsn_report_ring_keys(const struct fsn_bus_ring *ring, struct fsn_json *json);
/** The distributed clocks, or null if none are in use or the bus is stopped; only their keys. */
void fsn_report_clocks(struct fsn_bus_view *view, struct fsn_json *json);
void fsn_report_clocks_keys(const struct fsn_bus_clocks *clocks, struct fsn_json *json);
fsn_status fsn_report_symbols(struct fsn_bus_view *view, struct fsn_page *page,
                              struct fsn_json *json);

/** Fingerprint of the loaded plan, with the version of the engine and the cycle in use. */
void fsn_report_fingerprint(struct fsn_bus_view *view, struct fsn_json *json);

/** State of the intervention log. */
void fsn_report_interventions(const struct fsn_interventions *log, struct fsn_json *json);

/** Statistics and connections of one cycle, and the SubDevices. FSN_E_STATE without a core. */
fsn_status fsn_report_snapshot(struct fsn_bus_view *view, struct fsn_page *page,
                               struct fsn_json *json);
/** The same for a file that is written in any case: without a core, null and no connections. */
void fsn_report_last_cycle(struct fsn_bus_view *view, struct fsn_json *json);

/** Positions in the image. FSN_E_STATE without a core. */
fsn_status fsn_report_layout(struct fsn_bus_view *view, struct fsn_page *page,
                             struct fsn_json *json);

/** Writes the name of a SubDevice under a key. */
void fsn_report_name(struct fsn_bus_view *view, struct fsn_json *json, const char *key,
                     uint32_t subdevice);

/** State of a group of SubDevices that may be absent. */
enum fsn_group_state {
    FSN_GROUP_ABSENT, /**< not a fault */
    FSN_GROUP_WRONG,  /**< absent, and another device at its place is not accepted */
    FSN_GROUP_COMING, /**< not all of its SubDevices are in OP */
    FSN_GROUP_THERE,
};

/** State of a group, from an array with the states of all SubDevices of the plan. */
enum fsn_group_state fsn_group_state(const struct fsn_plan *plan, uint32_t group,
                                     const struct fsn_bus_subdevice *subdevices);

/** Returns "absent", "wrong", "coming" or "there". */
const char *fsn_group_text(enum fsn_group_state state);

/** Whether a SubDevice belongs to a group that is absent now. */
bool fsn_group_is_away(const struct fsn_bus_view *view, uint32_t subdevice);

/** Writes `groups` of the status; nothing for a plan without groups. */
void fsn_report_groups(struct fsn_bus_view *view, struct fsn_json *json);

enum { FSN_DIFFERS_BYTES = 256 };

/** Writes an object under a key; unknown values are null. */
void fsn_report_parameters(struct fsn_json *json, const char *key,
                           const struct fsn_parameters *parameters);

/** Writes the keys of parameters that differ, as a list. */
void fsn_report_differs(struct fsn_json *json, uint32_t differs);

/** Writes "watchdog 4000 ms, 400 ms in the plan" into `room`, which it returns. */
const char *fsn_differs_text(uint32_t differs, const struct fsn_parameters *planned,
                             const struct fsn_parameters *observed, char room[FSN_DIFFERS_BYTES]);

#endif
