#include "control/reports/reports.h"

#include <inttypes.h>
#include <stdio.h>

/** Parameters that a plan can state. */
static const struct {
    uint32_t bit;
    const char *key, *text;
} parameter[] = {
    {FSN_STATED_CONNECTION_ID, "connection_id", "connection ID"},
    {FSN_STATED_ADDRESS, "address", "FSoE address"},
    {FSN_STATED_WATCHDOG, "watchdog_ms", "watchdog"},
    {FSN_STATED_APP, "app_parameters", "application parameters"},
};
enum { STATED = sizeof parameter / sizeof parameter[0], NUMBERS = 3, VALUE_BYTES = 48 };

static unsigned number(const struct fsn_parameters *parameters, size_t i) {
    const unsigned numbers[NUMBERS] = {parameters->connection_id, parameters->address,
                                       parameters->watchdog_ms};
    return numbers[i];
}

static const char *value(const struct fsn_parameters *p, size_t i, char room[VALUE_BYTES]) {
    if ((p->known & parameter[i].bit) == 0) {
        return "not known now";
    }
    if (parameter[i].bit == FSN_STATED_APP) {
        snprintf(room, VALUE_BYTES, "%u bytes, CRC-32 0x%08" PRIx32, (unsigned)p->app_bytes,
                 p->app_crc);
    } else {
        snprintf(room, VALUE_BYTES, "%u%s", number(p, i),
                 parameter[i].bit == FSN_STATED_WATCHDOG ? " ms" : "");
    }
    return room;
}

void fsn_report_parameters(struct fsn_json *json, const char *key,
                           const struct fsn_parameters *parameters) {
    fsn_json_put_open(json, key, '{');
    for (size_t i = 0; i < NUMBERS; i++) {
        fsn_json_put_known(json, parameter[i].key, (parameters->known & parameter[i].bit) != 0,
                           number(parameters, i));
    }
    const bool app = (parameters->known & FSN_STATED_APP) != 0;
    fsn_json_put_known(json, "app_bytes", app, parameters->app_bytes);
    fsn_json_put_known(json, "app_crc", app, parameters->app_crc);
    fsn_json_close(json, '}');
}

void fsn_report_differs(struct fsn_json *json, uint32_t differs) {
    fsn_json_put_open(json, "differs", '[');
    for (size_t i = 0; i < STATED; i++) {
        if ((differs & parameter[i].bit) != 0) {
            fsn_json_text(json, parameter[i].key);
        }
    }
    fsn_json_close(json, ']');
}

const char *fsn_differs_text(uint32_t differs, const struct fsn_parameters *planned,
                             const struct fsn_parameters *observed, char room[FSN_DIFFERS_BYTES]) {
    size_t used = 0;
    char there[VALUE_BYTES];
    char stated[VALUE_BYTES];
    room[0] = 0;
    for (size_t i = 0; i < STATED; i++) {
        if ((differs & parameter[i].bit) != 0) {
            used +=
                (size_t)snprintf(room + used, FSN_DIFFERS_BYTES - used, "%s%s %s, %s in the plan",
                                 used != 0 ? "; " : "", parameter[i].text,
                                 value(observed, i, there), value(planned, i, stated));
        }
    }
    return room;
}
