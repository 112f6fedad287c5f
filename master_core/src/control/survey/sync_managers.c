/** Sync managers of a SubDevice and their PDOs: from its objects if it has CoE, otherwise from its
 *  SII, otherwise from the bus. */
#include <string.h>

#include "control/survey/member.h"
#include "plan/plan_internal.h"

enum {
    SM_CATEGORY = 41,
    SM_BYTES = 8,
    SM_TYPES = 0x1C00,
    ASSIGNMENT = 0x1C10,
    MAILBOX_OUT = 1,
    MAILBOX_IN = 2,
    OUTPUTS = 3,
    INPUTS = 4,
};

struct sm {
    uint8_t number, kind;
    bool placed; /**< start and length are known */
    uint16_t start, bytes;
};

/** A PDO as read. */
struct pdo {
    uint16_t index;
    uint32_t count;
    uint32_t entry[FSN_SURVEY_ENTRIES]; /**< index, subindex, bits */
};

/** From the SII, or from the buffer type and direction in its control byte. */
static uint8_t kind_of(const uint8_t *sm) {
    if (sm[7] >= MAILBOX_OUT && sm[7] <= INPUTS) {
        return sm[7];
    }
    const bool output = (sm[4] >> 2 & 3) == 1;
    if ((sm[4] & 3) == 2) {
        return output ? MAILBOX_OUT : MAILBOX_IN;
    }
    return output ? OUTPUTS : INPUTS;
}

static uint32_t sms_of_sii(const struct fsn_sii *sii, struct sm sms[FSN_SURVEY_SMS]) {
    uint32_t at = 0;
    uint32_t size;
    uint32_t count = 0;
    const uint8_t *category = fsn_survey_sii_category(sii, SM_CATEGORY, &at, &size);
    for (uint32_t i = 0; category != NULL && i < size / SM_BYTES && i < FSN_SURVEY_SMS; i++) {
        const uint8_t *sm = category + SM_BYTES * i;
        if (fsn_get16(sm) == 0 && fsn_get16(sm + 2) == 0 && sm[7] == 0) {
            continue; /* not used */
        }
        sms[count++] = (struct sm){(uint8_t)i, kind_of(sm), true, fsn_get16(sm), fsn_get16(sm + 2)};
    }
    return count;
}

static uint32_t sms_of_objects(struct fsn_surveyed *of, struct sm sms[FSN_SURVEY_SMS]) {
    uint32_t types;
    uint32_t count = 0;
    (void)fsn_survey_number(of, SM_TYPES, 0, &types);
    for (uint32_t i = 0; i < types && i < FSN_SURVEY_SMS; i++) {
        uint32_t type;
        if (fsn_survey_number(of, SM_TYPES, (uint8_t)(i + 1), &type) && type >= MAILBOX_OUT &&
            type <= INPUTS) {
            sms[count++] = (struct sm){.number = (uint8_t)i, .kind = (uint8_t)type};
        }
    }
    return count;
}

/* -- one PDO -------------------------------------------------------------------------------- */

static void put_name(const struct fsn_surveyed *of, struct fsn_json *json, uint16_t index,
                     bool outputs) {
    struct fsn_sii_pdo pdo;
    char name[FSN_NAME_BYTES * 4];
    uint32_t at = 0;
    uint32_t inside = 0;
    while (fsn_survey_sii_pdo(&of->sii, outputs, &at, &inside, &pdo)) {
        if (pdo.index == index && fsn_survey_sii_string(&of->sii, pdo.name, name)) {
            fsn_json_put_text(json, "name", name);
            return;
        }
    }
}

/** Writes a PDO; returns its bits. */
static uint32_t put_pdo(struct fsn_surveyed *of, struct fsn_json *json, const struct pdo *pdo,
                        bool outputs) {
    uint32_t bits = 0;
    fsn_json_open(json, '{');
    fsn_json_put_u64(json, "index", pdo->index);
    put_name(of, json, pdo->index, outputs);
    fsn_json_put_open(json, "entries", '[');
    for (uint32_t i = 0; i < pdo->count; i++) {
        const uint32_t entry = pdo->entry[i];
        fsn_json_open(json, '{');
        fsn_json_put_u64(json, "index", entry >> 16);
        fsn_json_put_u64(json, "subindex", entry >> 8 & 0xFF);
        fsn_json_put_u64(json, "bits", entry & 0xFF);
        fsn_json_close(json, '}');
        bits += entry & 0xFF;
        fsn_survey_entry(of, entry);
    }
    fsn_json_close(json, ']');
    fsn_json_close(json, '}');
    return bits;
}

/* -- all of a sync manager ------------------------------------------------------------------ */

/** Reads the mapping of a PDO. */
static bool read_pdo(struct fsn_surveyed *of, struct pdo *pdo) {
    uint32_t count;
    pdo->count = 0;
    if (!fsn_survey_number(of, pdo->index, 0, &count)) {
        return false;
    }
    for (uint32_t i = 0; i < count && i < FSN_SURVEY_ENTRIES; i++) {
        if (!fsn_survey_number(of, pdo->index, (uint8_t)(i + 1), &pdo->entry[pdo->count++])) {
            return false;
        }
    }
    return true;
}

static uint32_t put_object_pdos(struct fsn_surveyed *of, struct fsn_json *json, const struct sm *sm,
                                const uint16_t *assigned, uint32_t count) {
    uint32_t bits = 0;
    for (uint32_t i = 0; i < count; i++) {
        struct pdo pdo = {.index = assigned[i]};
        if (!read_pdo(of, &pdo)) {
            of->half_read |= 1u << sm->number;
            fsn_survey_problem(of, "SM%u: the mapping of PDO 0x%04x cannot be read", sm->number,
                               pdo.index);
        }
        bits += put_pdo(of, json, &pdo, sm->kind == OUTPUTS);
    }
    return bits;
}

static uint32_t put_sii_pdos(struct fsn_surveyed *of, struct fsn_json *json, const struct sm *sm) {
    struct fsn_sii_pdo found;
    uint32_t at = 0;
    uint32_t inside = 0;
    uint32_t bits = 0;
    while (fsn_survey_sii_pdo(&of->sii, sm->kind == OUTPUTS, &at, &inside, &found)) {
        struct pdo pdo = {.index = found.index, .count = found.entries};
        if (found.sm != sm->number) {
            continue;
        }
        for (uint32_t i = 0; i < pdo.count; i++) {
            const uint8_t *e = found.entry + 8 * (size_t)i;
            pdo.entry[i] = (uint32_t)fsn_get16(e) << 16 | (uint32_t)e[2] << 8 | e[5];
        }
        bits += put_pdo(of, json, &pdo, sm->kind == OUTPUTS);
    }
    return bits;
}

/** Writes data of the bus about a sync manager of a SubDevice without objects. */
static uint32_t put_bus_pdos(struct fsn_surveyed *of, struct fsn_json *json, const struct sm *sm) {
    const struct fsn_survey *s = of->survey;
    uint32_t bits = 0;
    for (uint32_t i = 0; i < FSN_SURVEY_PDOS; i++) {
        struct pdo pdo = {0};
        bool output;
        if (s->ops->acyclic->pdo(s->bus, of->position, sm->number, i, &pdo.index, &output,
                                 pdo.entry, FSN_SURVEY_ENTRIES, &pdo.count) != FSN_OK) {
            break;
        }
        bits += put_pdo(of, json, &pdo, output);
    }
    return bits;
}

static bool read_assignment(struct fsn_surveyed *of, const struct sm *sm,
                            uint16_t assigned[FSN_SURVEY_PDOS], uint32_t *count) {
    const uint16_t object = (uint16_t)(ASSIGNMENT + sm->number);
    uint32_t pdos;
    *count = 0;
    if (!fsn_survey_number(of, object, 0, &pdos)) {
        return false;
    }
    for (uint32_t i = 0; i < pdos && i < FSN_SURVEY_PDOS; i++) {
        uint32_t pdo;
        if (!fsn_survey_number(of, object, (uint8_t)(i + 1), &pdo)) {
            of->half_read |= 1u << sm->number;
            fsn_survey_problem(of, "SM%u: 0x%04x:%02x cannot be read", sm->number, object, i + 1);
            break;
        }
        assigned[(*count)++] = (uint16_t)pdo;
    }
    return true;
}

static void put_process_data(struct fsn_surveyed *of, struct fsn_json *json, const struct sm *sm) {
    uint16_t assigned[FSN_SURVEY_PDOS];
    uint32_t count;
    uint32_t bits;
    const bool objects = read_assignment(of, sm, assigned, &count);
    fsn_json_put_text(json, "source", objects ? "coe" : "sii");
    fsn_json_put_open(json, "pdos", '[');
    if (objects) {
        bits = put_object_pdos(of, json, sm, assigned, count);
    } else if (of->sii.bytes == NULL && of->survey->ops->acyclic->pdo != NULL) {
        bits = put_bus_pdos(of, json, sm);
    } else {
        bits = put_sii_pdos(of, json, sm);
    }
    fsn_json_close(json, ']');
    if (sm->placed) {
        fsn_json_put_u64(json, "start", sm->start);
    }
    fsn_json_put_u64(json, "bytes", (bits + 7) / 8);
    fsn_json_put_bool(json, "complete", (of->half_read >> sm->number & 1) == 0);
}

/** Without SII and objects only the bus has a list of them. */
static uint32_t sms_of_bus(const struct fsn_surveyed *of, struct sm sms[FSN_SURVEY_SMS]) {
    const struct fsn_survey *s = of->survey;
    uint32_t count = 0;
    for (uint8_t i = 0; i < FSN_SURVEY_SMS && s->ops->acyclic->pdo != NULL; i++) {
        uint16_t index;
        bool output;
        uint32_t entries[FSN_SURVEY_ENTRIES];
        uint32_t entry_count;
        if (s->ops->acyclic->pdo(s->bus, of->position, i, 0, &index, &output, entries,
                                 FSN_SURVEY_ENTRIES, &entry_count) == FSN_OK) {
            sms[count++] = (struct sm){.number = i, .kind = output ? OUTPUTS : INPUTS};
        }
    }
    return count;
}

void fsn_survey_sms(struct fsn_surveyed *of, struct fsn_json *json) {
    static const char *const name[] = {"", "mailbox_out", "mailbox_in", "outputs", "inputs"};
    struct sm sms[FSN_SURVEY_SMS];
    uint32_t count = sms_of_sii(&of->sii, sms);
    count = count == 0 ? sms_of_objects(of, sms) : count;
    count = count == 0 ? sms_of_bus(of, sms) : count;
    fsn_json_put_open(json, "sms", '[');
    for (uint32_t i = 0; i < count; i++) {
        const struct sm *sm = &sms[i];
        fsn_json_open(json, '{');
        fsn_json_put_u64(json, "sm", sm->number);
        fsn_json_put_text(json, "kind", name[sm->kind]);
        if (sm->kind >= OUTPUTS) {
            put_process_data(of, json, sm);
        } else {
            if (sm->placed) {
                FSN_JSON_PUT(json, sm, start, bytes);
            }
            fsn_json_put_text(json, "source", "sii");
            fsn_json_put_open(json, "pdos", '[');
            fsn_json_close(json, ']');
        }
        fsn_json_close(json, '}');
    }
    fsn_json_close(json, ']');
}
