#include "control/reports/reports.h"

#include "plan/plan_internal.h"

enum fsn_group_state fsn_group_state(const struct fsn_plan *plan, uint32_t group,
                                     const struct fsn_bus_subdevice *subdevices) {
    const struct fsn_group_info info = fsn_known_group(plan, group);
    const struct fsn_bus_subdevice *first = subdevices + info.first_subdevice;
    bool away = true;
    bool in_op = true;
    for (uint32_t n = 0; n < info.subdevice_count; n++) {
        away = away && first[n].al_status == FSN_AL_NONE;
        in_op = in_op && first[n].al_status == FSN_AL_OP;
    }
    if (in_op) {
        return FSN_GROUP_THERE;
    }
    if (!away) {
        return FSN_GROUP_COMING;
    }
    return first->detail[0] != 0 ? FSN_GROUP_WRONG : FSN_GROUP_ABSENT;
}

const char *fsn_group_text(enum fsn_group_state state) {
    static const char *const text[] = {"absent", "wrong", "coming", "there"};
    return text[state];
}

bool fsn_group_is_away(const struct fsn_bus_view *view, uint32_t subdevice) {
    struct fsn_bus_subdevice seen;
    return fsn_plan_group_of(view->plan, subdevice) != FSN_NONE &&
           fsn_core_subdevice(view->core, subdevice, &seen) == FSN_OK &&
           seen.al_status == FSN_AL_NONE;
}

void fsn_report_groups(struct fsn_bus_view *view, struct fsn_json *json) {
    const uint32_t count = fsn_plan_group_count(view->plan);
    const bool known = view->core != NULL && view->subdevices_known;
    if (count == 0) {
        return;
    }
    fsn_json_put_open(json, "groups", '[');
    for (uint32_t n = 0; n < count; n++) {
        const struct fsn_group_info info = fsn_known_group(view->plan, n);
        const enum fsn_group_state state = fsn_group_state(view->plan, n, view->subdevice);
        fsn_json_open(json, '{');
        FSN_JSON_PUT(json, &info, name, place);
        fsn_json_put_text(json, "state", known ? fsn_group_text(state) : NULL);
        fsn_json_put_text(json, "detail", view->subdevice[info.first_subdevice].detail);
        fsn_json_close(json, '}');
    }
    fsn_json_close(json, ']');
}
