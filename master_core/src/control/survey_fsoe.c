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

void fsn_survey_fsoe(struct fsn_surveyed *of, struct fsn_json *json) {
    uint32_t addresses = 0;
    uint16_t object[MOST_CONNECTIONS];
    uint32_t connections = 0;
    const bool has_addresses = fsn_survey_number(of, ADDRESSES, 0, &addresses);
    for (uint32_t i = 0; i < MOST_CONNECTIONS && of->coe; i++) {
        uint32_t subs;
        object[connections] = (uint16_t)(CONNECTIONS + CONNECTION_STEP * i);
        connections += fsn_survey_number(of, object[connections], 0, &subs);
    }
    fsn_json_key(json, "fsoe");
    if (!has_addresses && connections == 0) {
        fsn_json_null(json);
        return;
    }
    fsn_json_open(json, '{');
    if (put_addresses(of, json, addresses) == 0 && has_addresses) {
        fsn_survey_problem(of, "0xF980 tells no FSoE address");
    }
    fsn_json_key(json, "connections");
    fsn_json_open(json, '[');
    for (uint32_t i = 0; i < connections; i++) {
        put_connection(of, json, object[i]);
    }
    fsn_json_close(json, ']');
    fsn_json_close(json, '}');
}
