#include "control/survey/member.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "control/base/clock.h"
#include "control/base/names.h"
#include "control/base/value.h"
#include "live/check.h"
#include "plan/plan_internal.h"

enum { VENDOR = 0x10, SERIAL = 0x1C, DEVICE_NAME = 0x1008, STATE_BITS = 0x0F };

void fsn_survey_problem(struct fsn_surveyed *of, const char *format, ...) {
    va_list arguments;
    if (of->problems == FSN_SURVEY_PROBLEMS) {
        return;
    }
    va_start(arguments, format);
    vsnprintf(of->problem[of->problems++], FSN_SURVEY_TEXT, format, arguments);
    va_end(arguments);
}

fsn_status fsn_survey_begin(struct fsn_surveyed *of, const struct fsn_survey *survey,
                            uint32_t position) {
    static const struct fsn_surveyed nothing;
    *of = nothing;
    of->survey = survey;
    of->position = position;
    const struct fsn_bus_member *m = &of->member;
    const fsn_status status = survey->ops->acyclic->member(survey->bus, position, &of->member);
    of->coe = m->al_status != FSN_AL_NONE && (m->mailbox & FSN_MAILBOX_COE) != 0 &&
              survey->ops->acyclic->upload != NULL;
    return status;
}

static bool goes_on(struct fsn_surveyed *of) {
    const struct fsn_survey *s = of->survey;
    of->stopped = of->stopped || (s->between != NULL && !s->between(s->self));
    return !of->stopped;
}

/** Reads an object; any failure except an abort ends the reading of objects. */
static bool upload(struct fsn_surveyed *of, struct fsn_transfer *transfer) {
    const struct fsn_survey *s = of->survey;
    if (!of->coe || !goes_on(of)) {
        return false;
    }
    if (++of->transfers > FSN_SURVEY_TRANSFERS) {
        fsn_survey_problem(of, "more than %d objects to read: the rest is left out",
                           FSN_SURVEY_TRANSFERS);
        of->coe = false;
        return false;
    }
    transfer->position = of->position;
    const uint32_t room = transfer->size_bytes;
    fsn_status status = s->ops->acyclic->upload(s->bus, transfer);
    if (fsn_is_silent(status) && goes_on(of)) { /* a frame may have been lost or late */
        transfer->size_bytes = room;
        status = s->ops->acyclic->upload(s->bus, transfer);
    }
    if (fsn_is_silent(status) || status == FSN_E_BUS_STATE || status == FSN_E_STATE) {
        fsn_survey_problem(
            of, "0x%04x:%02x: %s; no further object is read", transfer->index, transfer->sub,
            status == FSN_E_BUS_STATE ? "an answer that makes no sense" : "no answer");
        of->coe = false;
    }
    return status == FSN_OK;
}

bool fsn_survey_word(struct fsn_surveyed *of, uint16_t index, uint8_t sub, uint16_t *value) {
    uint8_t bytes[8] = {0};
    struct fsn_transfer transfer = {
        .index = index, .sub = sub, .data = bytes, .size_bytes = sizeof bytes};
    const bool read = upload(of, &transfer) && transfer.size_bytes == 2;
    *value = fsn_get16(bytes);
    return read;
}

bool fsn_survey_number(struct fsn_surveyed *of, uint16_t index, uint8_t sub, uint32_t *value) {
    uint8_t bytes[8] = {0};
    struct fsn_transfer transfer = {
        .index = index, .sub = sub, .data = bytes, .size_bytes = sizeof bytes};
    const bool read = upload(of, &transfer) && transfer.size_bytes > 0;
    *value = read ? (uint32_t)fsn_value_read(bytes, transfer.size_bytes) : 0;
    return read;
}

/* -- one SubDevice -------------------------------------------------------------------------- */

static void read_sii(struct fsn_surveyed *of, uint8_t *room) {
    const struct fsn_survey *s = of->survey;
    struct fsn_transfer transfer = {.position = of->position,
                                    .data = room,
                                    .size_bytes = FSN_SII_BYTES,
                                    .between = s->between,
                                    .self = s->self};
    const fsn_status status = fsn_acyclic_read_sii(s->ops->acyclic, s->bus, &transfer);
    of->sii = (struct fsn_sii){NULL, 0};
    if (status == FSN_E_ABSENT) {
        return; /* this bus provides none */
    }
    if (status == FSN_E_STATE) {
        of->stopped = true;
    } else if (status != FSN_OK) {
        fsn_survey_problem(of, "its SII cannot be read beyond byte %u",
                           (unsigned)transfer.size_bytes);
    }
    if (transfer.size_bytes >= 0x80) {
        of->sii = (struct fsn_sii){room, transfer.size_bytes};
    }
}

static void put_identity(struct fsn_surveyed *of, struct fsn_json *json) {
    const struct fsn_bus_member *m = &of->member;
    const uint8_t *sii = of->sii.bytes; /* read with care; missing values are 0 */
    const uint32_t vendor = sii != NULL ? fsn_get32(sii + VENDOR) : m->vendor_id;
    const uint32_t product = sii != NULL ? fsn_get32(sii + VENDOR + 4) : m->product_code;
    if (vendor != 0 && product != 0) {
        fsn_json_put_u64(json, "vendor_id", vendor);
        fsn_json_put_u64(json, "product_code", product);
        fsn_json_put_u64(json, "revision", sii != NULL ? fsn_get32(sii + VENDOR + 8) : m->revision);
    } else {
        fsn_survey_problem(of, "its identity cannot be read: the SII is empty or does not answer");
    }
    if (of->sii.bytes != NULL) {
        fsn_json_put_u64(json, "serial", fsn_get32(of->sii.bytes + SERIAL));
    } else if (of->survey->ops->acyclic->sii_read == NULL) {
        fsn_json_put_u64(json, "serial", m->serial);
    }
}

static void put_name(struct fsn_surveyed *of, struct fsn_json *json) {
    char name[FSN_NAME_BYTES * 4] = "";
    struct fsn_transfer transfer = {
        .index = DEVICE_NAME, .data = (uint8_t *)name, .size_bytes = sizeof name - 1};
    if (fsn_survey_sii_name(&of->sii, name)) {
        fsn_json_put_text(json, "name", name);
    } else if (of->member.name[0] != 0) {
        fsn_json_put_text(json, "name", of->member.name);
    } else if (upload(of, &transfer)) {
        name[transfer.size_bytes] = 0;
        fsn_json_put_text(json, "name", name);
    }
}

static void put_state(struct fsn_surveyed *of, struct fsn_json *json) {
    char room[24];
    const struct fsn_bus_member *m = &of->member;
    fsn_json_put_u64(json, "al_status", m->al_status);
    if (m->al_status == FSN_AL_NONE) {
        fsn_survey_problem(of, "it does not answer");
        return;
    }
    fsn_json_put_text(json, "al", fsn_al_text(m->al_status, room));
    fsn_json_put_u64(json, "al_code", m->al_code);
    if ((m->al_status & FSN_AL_ERROR) != 0) {
        fsn_json_put_text(json, "al_code_text", fsn_al_code_text(m->al_code));
    }
    if ((m->al_status & STATE_BITS) == FSN_AL_INIT && m->mailbox != 0) {
        fsn_survey_problem(of, "it stays in INIT, where its mailbox is closed");
    }
}

static void put_mailbox(const struct fsn_surveyed *of, struct fsn_json *json) {
    static const char *const name[] = {"aoe", "eoe", "coe", "foe", "soe", "voe"};
    fsn_json_put_open(json, "mailbox", '[');
    for (unsigned i = 0; i < 6; i++) {
        if ((of->member.mailbox >> i & 1) != 0) {
            fsn_json_text(json, name[i]);
        }
    }
    fsn_json_close(json, ']');
    fsn_json_put_bool(json, "dc", of->member.has_dc);
}

static void put_ports(const struct fsn_surveyed *of, struct fsn_json *json) {
    const struct fsn_bus_member *m = &of->member;
    fsn_json_put_open(json, "ports", '[');
    for (unsigned port = 0; port < FSN_PORTS; port++) {
        if ((m->ports >> port & 1) == 0) {
            continue;
        }
        fsn_json_open(json, '{');
        fsn_json_put_u64(json, "port", port);
        fsn_json_put_bool(json, "link", m->link[port] != 0);
        if (m->errors_known) {
            fsn_json_put_u64(json, "link_lost", m->link_lost[port]);
            fsn_json_put_u64(json, "rx_errors", m->rx_errors[port]);
        }
        fsn_json_close(json, '}');
    }
    fsn_json_close(json, ']');
}

static void put_end(const struct fsn_surveyed *of, struct fsn_json *json) {
    const bool planned = of->survey->plan != NULL && of->member.subdevice != FSN_NONE;
    fsn_json_put_text(json, "planned",
                      planned ? fsn_known_subdevice(of->survey->plan, of->member.subdevice).name
                              : NULL);
    fsn_json_put_open(json, "problems", '[');
    for (uint32_t i = 0; i < of->problems; i++) {
        fsn_json_text(json, of->problem[i]);
    }
    fsn_json_close(json, ']');
}

static bool put_subdevice(const struct fsn_survey *survey, uint32_t position, uint8_t *room,
                          struct fsn_json *json) {
    struct fsn_surveyed of;
    const struct fsn_bus_member *m = &of.member;
    const fsn_status status = fsn_survey_begin(&of, survey, position);
    if (status != FSN_OK && m->al_status != FSN_AL_NONE) {
        fsn_survey_problem(&of, "it answers only some of its registers");
    }
    of.coe = of.coe && (m->al_status & STATE_BITS) != FSN_AL_INIT;
    if (m->al_status != FSN_AL_NONE) {
        read_sii(&of, room);
    }
    fsn_json_open(json, '{');
    fsn_json_put_u64(json, "position", position);
    FSN_JSON_PUT(json, m, alias, station);
    put_identity(&of, json);
    put_name(&of, json);
    put_state(&of, json);
    put_mailbox(&of, json);
    put_ports(&of, json);
    fsn_survey_sms(&of, json);
    fsn_survey_fsoe(&of, json);
    put_end(&of, json);
    fsn_json_close(json, '}');
    return goes_on(&of);
}

fsn_status fsn_survey_write(const struct fsn_survey *survey, struct fsn_json *json) {
    char utc[32];
    const struct fsn_bus_acyclic *acyclic = survey->ops->acyclic;
    if (acyclic == NULL || acyclic->member == NULL) {
        return FSN_E_ABSENT;
    }
    uint8_t *room = malloc(FSN_SII_BYTES);
    if (room == NULL) {
        return FSN_E_NOMEM;
    }
    fsn_utc_text(fsn_now_ns(), utc);
    fsn_json_put_u64(json, "scan", FSN_SURVEY_FORMAT);
    fsn_json_put_text(json, "utc", utc);
    fsn_json_put_text(json, "interface", survey->interface != NULL ? survey->interface : "");
    fsn_json_put_text(json, "backend", survey->ops->name);
    fsn_json_put_bool(json, "states_changed", survey->states_changed);
    fsn_json_put_open(json, "subdevices", '[');
    const uint32_t count = acyclic->count(survey->bus);
    bool whole = true;
    for (uint32_t position = 0; whole && position < count && json->failed == FSN_OK; position++) {
        whole = put_subdevice(survey, position, room, json);
    }
    fsn_json_close(json, ']');
    free(room);
    return whole || json->failed != FSN_OK ? json->failed : FSN_E_STATE;
}
