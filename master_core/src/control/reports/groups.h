/** Groups of SubDevices that may be absent, and whether they are present. */
#ifndef FSN_CONTROL_GROUPS_H
#define FSN_CONTROL_GROUPS_H

#include "control/base/json.h"
#include "control/reports/bus_view.h"

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

#endif
