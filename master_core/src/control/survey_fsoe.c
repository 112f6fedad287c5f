/** What a SubDevice tells of its FSoE addresses and connections. */
#include "survey.h"

enum {
    ADDRESSES = 0xF980,
    CONNECTIONS = 0xE901,
    CONNECTION_STEP = 0x10,
    MOST_CONNECTIONS = 16,
    MOST_ADDRESSES = 16,
};

static uint32_t put_addresses(struct fsn_surveyed *of, struct fsn_json *json, uint32_t count) {
    uint32_t address[MOST_ADDRESSES];
    uint32_t found = 0;
    for (uint32_t i = 0; i < count && i < MOST_ADDRESSES; i++) {
        if (fsn_survey_number(of, ADDRESSES, (uint8_t)(i + 1), &address[found])) {
            address[found++] &= 0xFFFF;
        }
    }
    fsn_json_key(json, "address");
    if (found > 0) {
        fsn_json_u64(json, address[0]);
    } else {
        fsn_json_null(json);
    }
    if (found > 1) {
        fsn_json_key(json, "addresses");
        fsn_json_open(json, '[');
        for (uint32_t i = 0; i < found; i++) {
            fsn_json_u64(json, address[i]);
        }
        fsn_json_close(json, ']');
    }
    return found;
}

static void put_connection(struct fsn_surveyed *of, struct fsn_json *json, uint16_t object) {
    static const char *const key[] = {"state", "address", "connection_id", "watchdog_ms"};
    fsn_json_open(json, '{');
    fsn_json_put_u64(json, "object", object);
    for (uint8_t sub = 1; sub <= 4; sub++) {
        uint32_t value;
        if (fsn_survey_number(of, object, sub, &value)) {
            fsn_json_put_u64(json, key[sub - 1], value);
        }
    }
    fsn_json_close(json, '}');
}

/** What there is to read. */
struct told {
    bool has_addresses;
    uint32_t addresses;
    uint16_t object[MOST_CONNECTIONS];
    uint32_t connections;
};

static bool look(struct fsn_surveyed *of, struct told *told) {
    *told = (struct told){0};
    told->has_addresses = fsn_survey_number(of, ADDRESSES, 0, &told->addresses);
    for (uint32_t i = 0; i < MOST_CONNECTIONS && of->coe; i++) {
        uint32_t subs;
        told->object[told->connections] = (uint16_t)(CONNECTIONS + CONNECTION_STEP * i);
        told->connections += fsn_survey_number(of, told->object[told->connections], 0, &subs);
    }
    return told->has_addresses || told->connections > 0;
}

/** Writes the keys into an object that is open. */
static void put_told(struct fsn_surveyed *of, const struct told *told, struct fsn_json *json) {
    if (put_addresses(of, json, told->addresses) == 0 && told->has_addresses) {
        fsn_survey_problem(of, "0xF980 tells no FSoE address");
    }
    fsn_json_key(json, "connections");
    fsn_json_open(json, '[');
    for (uint32_t i = 0; i < told->connections; i++) {
        put_connection(of, json, told->object[i]);
    }
    fsn_json_close(json, ']');
}

void fsn_survey_fsoe(struct fsn_surveyed *of, struct fsn_json *json) {
    struct told told;
    const bool any = look(of, &told);
    fsn_json_key(json, "fsoe");
    if (!any) {
        fsn_json_null(json);
        return;
    }
    fsn_json_open(json, '{');
    put_told(of, &told, json);
    fsn_json_close(json, '}');
}

static void put_planned(const struct fsn_survey *survey, uint32_t position, struct fsn_json *json) {
    static const struct fsn_surveyed nothing;
    struct fsn_surveyed of = nothing;
    struct fsn_subdevice_info info;
    struct told told;
    of.survey = survey;
    of.position = position;
    (void)survey->ops->acyclic->member(survey->bus, position, &of.member);
    const struct fsn_bus_member *m = &of.member;
    of.coe = m->al_status != FSN_AL_NONE && (m->mailbox & FSN_MAILBOX_COE) != 0 &&
             survey->ops->acyclic->upload != NULL;
    if (!of.coe || m->subdevice == FSN_NONE ||
        fsn_plan_subdevice(survey->plan, m->subdevice, &info) != FSN_OK || !look(&of, &told)) {
        return;
    }
    fsn_json_open(json, '{');
    fsn_json_put_text(json, "subdevice", info.name);
    put_told(&of, &told, json);
    fsn_json_close(json, '}');
}

fsn_status fsn_survey_planned_fsoe(const struct fsn_survey *survey, struct fsn_json *json) {
    const struct fsn_bus_acyclic *acyclic = survey->ops->acyclic;
    if (acyclic == NULL || acyclic->member == NULL) {
        return FSN_E_ABSENT;
    }
    fsn_json_open(json, '[');
    const uint32_t count = acyclic->count(survey->bus);
    for (uint32_t position = 0; position < count; position++) {
        if (survey->between != NULL && !survey->between(survey->self)) {
            return FSN_E_STATE;
        }
        put_planned(survey, position, json);
    }
    fsn_json_close(json, ']');
    return FSN_OK;
}
