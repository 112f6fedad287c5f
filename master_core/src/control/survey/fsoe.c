/** FSoE addresses and connections reported by a SubDevice. */
#include "control/survey/member.h"
#include "live/fsoe_objects.h"
#include "plan/plan_internal.h"

enum {
    CONNECTION_STEP = 0x10,
    MOST_SAFETY_CONNECTIONS = 16, /**< 0xE901 … 0xE9F1 */
    MOST_ADDRESSES = 16,
    SIDE_MAIN = 0,
    SIDE_SUB = 1,
    SIDE_UNKNOWN = 0xFF,
};

/** One connection as its SubDevice reports it. */
struct found_connection {
    uint16_t object;
    uint16_t value[FSN_PARAMETER_WATCHDOG_MS + 1]; /**< by enum fsn_parameter */
    uint16_t state;
    uint8_t known; /**< bits by enum fsn_parameter; bit 0: state */
    uint8_t side;
};

/** Data reported by a SubDevice. */
struct found {
    bool has_addresses;
    uint16_t address[MOST_ADDRESSES];
    uint32_t addresses;
    struct found_connection connection[FSN_SURVEY_CONNECTIONS];
    uint32_t connections;
};

void fsn_survey_entry(struct fsn_surveyed *of, uint32_t entry) {
    const bool is_command = (entry >> 8 & 0xFF) == 1 && (entry & 0xFF) == 8;
    const uint16_t object = is_command ? fsn_parameter_object((uint16_t)(entry >> 16)) : 0;
    if (object == 0 || of->fsoe_object_count == FSN_SURVEY_CONNECTIONS) {
        return;
    }
    for (uint32_t i = 0; i < of->fsoe_object_count; i++) {
        if (of->fsoe_objects[i] == object) {
            return;
        }
    }
    of->fsoe_objects[of->fsoe_object_count++] = object;
}

/* -- reading -------------------------------------------------------------------------------- */

static bool has_address(const struct found *found, uint16_t address) {
    for (uint32_t i = 0; i < found->addresses; i++) {
        if (found->address[i] == address) {
            return true;
        }
    }
    return false;
}

static void read_addresses(struct fsn_surveyed *of, struct found *found) {
    uint32_t count;
    found->has_addresses = fsn_survey_number(of, FSN_ADDRESSES, 0, &count);
    for (uint32_t i = 0; found->has_addresses && i < count && i < MOST_ADDRESSES; i++) {
        uint32_t address;
        if (fsn_survey_number(of, FSN_ADDRESSES, (uint8_t)(i + 1), &address)) {
            found->address[found->addresses++] = (uint16_t)address;
        }
    }
}

/** Reads the parameters of a connection. In the object of a module, which may have another meaning,
 *  they count only together and with their sizes. */
static bool read_connection(struct fsn_surveyed *of, uint16_t object, struct found_connection *c) {
    enum {
        ALL = 1 << FSN_PARAMETER_ADDRESS | 1 << FSN_PARAMETER_CONNECTION_ID |
              1 << FSN_PARAMETER_WATCHDOG_MS
    };
    uint32_t subs;
    uint32_t side;
    *c = (struct found_connection){.object = object, .side = SIDE_UNKNOWN};
    if (!fsn_survey_number(of, object, 0, &subs)) {
        return false;
    }
    for (uint8_t sub = FSN_PARAMETER_ADDRESS; sub <= FSN_PARAMETER_WATCHDOG_MS; sub++) {
        if (fsn_survey_word(of, object, sub, &c->value[sub])) {
            c->known |= (uint8_t)(1 << sub);
        }
    }
    if (c->known == 0 || (object < FSN_CONNECTIONS && c->known != ALL)) {
        return false;
    }
    if (subs >= FSN_PARAMETER_SIDE && fsn_survey_number(of, object, FSN_PARAMETER_SIDE, &side) &&
        side <= SIDE_SUB) {
        c->side = (uint8_t)side;
    }
    const uint16_t diagnosis = fsn_diagnosis_object(object);
    c->known |= diagnosis != 0 && fsn_survey_word(of, diagnosis, 1, &c->state);
    return true;
}

/** Determines from the addresses of the SubDevice which end of a connection it is, and addresses
 *  that only a connection names. */
static void complete_sides(struct found *found) {
    const bool no_addresses = found->addresses == 0;
    for (uint32_t i = 0; i < found->connections; i++) {
        struct found_connection *c = &found->connection[i];
        const uint16_t address = c->value[FSN_PARAMETER_ADDRESS];
        if ((c->known & 1 << FSN_PARAMETER_ADDRESS) == 0 || address == 0) {
            continue;
        }
        if (c->side == SIDE_UNKNOWN && has_address(found, address)) {
            c->side = SIDE_SUB;
        } else if (c->side == SIDE_SUB && no_addresses && !has_address(found, address) &&
                   found->addresses < MOST_ADDRESSES) {
            found->address[found->addresses++] = address;
        }
    }
}

static bool read_found(struct fsn_surveyed *of, struct found *found) {
    *found = (struct found){0};
    read_addresses(of, found);
    for (uint32_t i = 0; i < of->fsoe_object_count && of->coe; i++) {
        found->connections +=
            read_connection(of, of->fsoe_objects[i], &found->connection[found->connections]);
    }
    /* A safety device with other object numbers for its frames may still have the objects of its
     * area. */
    const bool search = found->connections == 0;
    for (uint32_t i = 0; i < MOST_SAFETY_CONNECTIONS && of->coe && search; i++) {
        const uint16_t object = (uint16_t)(FSN_CONNECTIONS + CONNECTION_STEP * i);
        found->connections += read_connection(of, object, &found->connection[found->connections]);
    }
    complete_sides(found);
    return found->has_addresses || found->connections > 0;
}

/* -- writing -------------------------------------------------------------------------------- */

static void put_addresses(const struct found *found, struct fsn_json *json) {
    fsn_json_put_known(json, "address", found->addresses > 0, found->address[0]);
    if (found->addresses > 1) {
        fsn_json_put_open(json, "addresses", '[');
        for (uint32_t i = 0; i < found->addresses; i++) {
            fsn_json_u64(json, found->address[i]);
        }
        fsn_json_close(json, ']');
    }
}

static void put_connection(const struct found_connection *c, struct fsn_json *json) {
    static const char *const key[] = {[FSN_PARAMETER_ADDRESS] = "address",
                                      [FSN_PARAMETER_CONNECTION_ID] = "connection_id",
                                      [FSN_PARAMETER_WATCHDOG_MS] = "watchdog_ms"};
    fsn_json_open(json, '{');
    fsn_json_put_u64(json, "object", c->object);
    if ((c->known & 1) != 0) {
        fsn_json_put_u64(json, "state", c->state);
    }
    for (unsigned sub = FSN_PARAMETER_ADDRESS; sub <= FSN_PARAMETER_WATCHDOG_MS; sub++) {
        if ((c->known >> sub & 1) != 0) {
            fsn_json_put_u64(json, key[sub], c->value[sub]);
        }
    }
    fsn_json_close(json, '}');
}

static void put_side(const struct found *found, struct fsn_json *json, const char *key, bool subs) {
    fsn_json_put_open(json, key, '[');
    for (uint32_t i = 0; i < found->connections; i++) {
        if ((found->connection[i].side == SIDE_SUB) == subs) {
            put_connection(&found->connection[i], json);
        }
    }
    fsn_json_close(json, ']');
}

/** Writes the keys into an object that is open. */
static void put_found(struct fsn_surveyed *of, const struct found *found, struct fsn_json *json) {
    put_addresses(found, json);
    if (found->addresses == 0 && found->has_addresses) {
        fsn_survey_problem(of, "0xF980 holds no FSoE address");
    }
    put_side(found, json, "connections", false);
    put_side(found, json, "given", true);
}

void fsn_survey_fsoe(struct fsn_surveyed *of, struct fsn_json *json) {
    struct found found;
    if (fsn_json_put_object(json, "fsoe", read_found(of, &found))) {
        put_found(of, &found, json);
        fsn_json_close(json, '}');
    }
}

/** Records the FSoE frames that a plan has on a SubDevice. */
static void note_planned(const struct fsn_plan *plan, uint32_t subdevice, struct fsn_surveyed *of) {
    struct fsn_block_info block;
    for (uint32_t i = 0; fsn_plan_block(plan, i, &block) == FSN_OK; i++) {
        if (fsn_known_sm(plan, block.sm).subdevice == subdevice) {
            const uint16_t command = fsn_object_at(plan, block.sm, 8 * block.byte_offset);
            fsn_survey_entry(of, (uint32_t)command << 16 | 1 << 8 | 8);
        }
    }
}

static void put_planned(const struct fsn_survey *survey, uint32_t position, struct fsn_json *json) {
    struct fsn_surveyed of;
    struct found found;
    const struct fsn_bus_member *m = &of.member;
    (void)fsn_survey_begin(&of, survey, position);
    if (!of.coe || m->subdevice == FSN_NONE) {
        return;
    }
    note_planned(survey->plan, m->subdevice, &of);
    if (!read_found(&of, &found)) {
        return;
    }
    fsn_json_open(json, '{');
    fsn_json_put_text(json, "subdevice", fsn_known_subdevice(survey->plan, m->subdevice).name);
    put_found(&of, &found, json);
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
