/** The proofs of docs/reference/plan-format.md, “What a reader proves again”, first half: what the
 *  SubDevices look like. Section by section; a later one relies on what the earlier have shown. */
#include "plan/plan_internal.h"

fsn_status fsn_no(const struct fsn_at *at, fsn_status status, uint32_t field, const char *rule) {
    const uint8_t *r = fsn_record(at->plan, at->section, at->number);
    return fsn_refuse(at->fault, status, at->section, at->number,
                      (uint32_t)(r - at->plan->bytes) + field, rule);
}

bool fsn_string_ok(const struct fsn_plan *plan, const uint8_t *field) {
    return fsn_get32(field) < plan->count[FSN_SEC_STRINGS];
}

static fsn_status prove_strings(const struct fsn_plan *plan, struct fsn_fault *fault) {
    const uint32_t count = plan->count[FSN_SEC_STRINGS];
    const uint8_t *table = plan->bytes + plan->offset[FSN_SEC_STRINGS];
    if (count == 0 || table[0] != 0 || table[count - 1] != 0) {
        return fsn_refuse(fault, FSN_E_PLAN_STRING, FSN_SEC_STRINGS, FSN_FAULT_NO_RECORD,
                          plan->offset[FSN_SEC_STRINGS], "strings start and end with a zero byte");
    }
    for (uint32_t i = 0; i < count; i++) {
        if ((table[i] > 0 && table[i] < 0x20) || table[i] == 0x7F) {
            return fsn_refuse(fault, FSN_E_PLAN_STRING, FSN_SEC_STRINGS, FSN_FAULT_NO_RECORD,
                              plan->offset[FSN_SEC_STRINGS] + i, "a name has a control character");
        }
    }
    return FSN_OK;
}

/** A range of records that must start where the one before ended. */
static bool tiles(uint32_t first, uint32_t count, uint32_t *running, uint32_t total) {
    if (first != *running || count > total - first) {
        return false;
    }
    *running = first + count;
    return true;
}

static fsn_status prove_subdevices(const struct fsn_plan *plan, struct fsn_fault *fault) {
    uint32_t sms = 0;
    uint32_t sdos = 0;
    struct fsn_at at = {plan, fault, FSN_SEC_SUBDEVICE, 0};
    for (; at.number < plan->count[FSN_SEC_SUBDEVICE]; at.number++) {
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        if (!fsn_string_ok(plan, r)) {
            return fsn_no(&at, FSN_E_PLAN_STRING, 0, "the name lies outside the strings");
        }
        if (fsn_get32(r + 16) > fsn_get32(r + 20)) {
            return fsn_no(&at, FSN_E_PLAN_VALUE, 16, "the lowest revision is above the highest");
        }
        if (!tiles(fsn_get32(r + 24), fsn_get32(r + 28), &sms, plan->count[FSN_SEC_SM])) {
            return fsn_no(&at, FSN_E_PLAN_REFERENCE, 24,
                          "sync managers do not follow those of the SubDevice before");
        }
        if (!tiles(fsn_get32(r + 32), fsn_get32(r + 36), &sdos, plan->count[FSN_SEC_SDO])) {
            return fsn_no(&at, FSN_E_PLAN_REFERENCE, 32,
                          "start-up SDOs do not follow those of the SubDevice before");
        }
        if (fsn_get16(r + 42) > 1 || fsn_get32(r + 44) != 0) {
            return fsn_no(&at, FSN_E_PLAN_RESERVED, 42,
                          "a flag of the SubDevice is unknown or its reserved field is not zero");
        }
    }
    if (sms != plan->count[FSN_SEC_SM] || sdos != plan->count[FSN_SEC_SDO]) {
        return fsn_refuse(fault, FSN_E_PLAN_REFERENCE, FSN_SEC_SUBDEVICE, FSN_FAULT_NO_RECORD,
                          plan->offset[FSN_SEC_SUBDEVICE],
                          "sync managers or SDOs belong to no SubDevice");
    }
    return FSN_OK;
}

static fsn_status prove_sdos(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct fsn_at at = {plan, fault, FSN_SEC_SDO, 0};
    for (; at.number < plan->count[FSN_SEC_SDO]; at.number++) {
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        const uint8_t size = r[3];
        if (size != 1 && size != 2 && size != 4 && size != 8) {
            return fsn_no(&at, FSN_E_PLAN_VALUE, 3, "an SDO has 1, 2, 4 or 8 bytes");
        }
        if (fsn_get32(r + 4) != 0) {
            return fsn_no(&at, FSN_E_PLAN_RESERVED, 4, "a reserved field of the SDO is not zero");
        }
    }
    return FSN_OK;
}

/** Entries of one PDO: follow each other from `bit` on. */
static fsn_status prove_entries(struct fsn_at *at, uint32_t first, uint32_t count, uint32_t *bit,
                                bool *registered) {
    at->section = FSN_SEC_ENTRY;
    for (at->number = first; at->number < first + count; at->number++) {
        const uint8_t *r = fsn_record(at->plan, at->section, at->number);
        if (fsn_get32(r + 8) != *bit) {
            return fsn_no(at, FSN_E_PLAN_LAYOUT, 8,
                          "the entry does not start where the one before ends");
        }
        if (r[3] > 1 || r[7] != 0) {
            return fsn_no(at, FSN_E_PLAN_RESERVED, 3,
                          "a flag of the entry is unknown or its reserved field is not zero");
        }
        if (r[6] > 4 || (r[3] == 1 && fsn_get16(r) == 0)) {
            return fsn_no(at, FSN_E_PLAN_VALUE, 6, "the type is unknown, or padding is registered");
        }
        *bit += fsn_get16(r + 4);
        *registered = *registered || r[3] == 1;
        if (*bit > FSN_MAX_SM_BITS) {
            return fsn_no(at, FSN_E_PLAN_LAYOUT, 4, "the sync manager has more than 1486 bytes");
        }
    }
    return FSN_OK;
}

static fsn_status prove_pdos(const struct fsn_at *sm, uint32_t first, uint32_t count,
                             uint32_t *entries, uint32_t *bit, bool *registered) {
    struct fsn_at at = {sm->plan, sm->fault, FSN_SEC_PDO, first};
    for (uint32_t n = first; n < first + count; n++) {
        at.section = FSN_SEC_PDO;
        at.number = n;
        const uint8_t *r = fsn_record(at.plan, at.section, n);
        if (fsn_get16(r + 2) != 0) {
            return fsn_no(&at, FSN_E_PLAN_RESERVED, 2, "a reserved field of the PDO is not zero");
        }
        if (fsn_get32(r + 12) != *bit) {
            return fsn_no(&at, FSN_E_PLAN_LAYOUT, 12,
                          "the PDO does not start where the one before ends");
        }
        const uint32_t first_entry = fsn_get32(r + 4);
        const uint32_t entry_count = fsn_get32(r + 8);
        if (!tiles(first_entry, entry_count, entries, at.plan->count[FSN_SEC_ENTRY])) {
            return fsn_no(&at, FSN_E_PLAN_REFERENCE, 4,
                          "entries do not follow those of the PDO before");
        }
        const fsn_status status = prove_entries(&at, first_entry, entry_count, bit, registered);
        if (status != FSN_OK) {
            return status;
        }
    }
    return FSN_OK;
}

static fsn_status prove_one_sm(const struct fsn_at *at, uint32_t owner, int previous_index,
                               uint32_t *pdos, uint32_t *entries) {
    const uint8_t *r = fsn_record(at->plan, at->section, at->number);
    if (fsn_get32(r) != owner) {
        return fsn_no(at, FSN_E_PLAN_REFERENCE, 0, "the sync manager belongs to another SubDevice");
    }
    if (r[4] > 15 || (int)r[4] <= previous_index || r[5] < FSN_OUTPUT || r[5] > FSN_INPUT ||
        r[6] > 2) {
        return fsn_no(at, FSN_E_PLAN_VALUE, 4,
                      "SM number, direction or watchdog is not allowed, or SM numbers do not rise");
    }
    if (r[7] > 1 || fsn_get32(r + 20) != 0) {
        return fsn_no(at, FSN_E_PLAN_RESERVED, 7,
                      "a flag of the sync manager is unknown or its reserved field is not zero");
    }
    const uint32_t first = fsn_get32(r + 12);
    const uint32_t count = fsn_get32(r + 16);
    if (!tiles(first, count, pdos, at->plan->count[FSN_SEC_PDO])) {
        return fsn_no(at, FSN_E_PLAN_REFERENCE, 12,
                      "PDOs do not follow those of the sync manager before");
    }
    uint32_t bits = 0;
    bool registered = false;
    const fsn_status status = prove_pdos(at, first, count, entries, &bits, &registered);
    if (status != FSN_OK) {
        return status;
    }
    if (bits != fsn_get32(r + 8) || registered != (r[7] == 1)) {
        return fsn_no(at, FSN_E_PLAN_LAYOUT, 8,
                      "the entries do not add up to length and flags of the sync manager");
    }
    return FSN_OK;
}

static fsn_status prove_sms(const struct fsn_plan *plan, struct fsn_fault *fault) {
    uint32_t pdos = 0;
    uint32_t entries = 0;
    struct fsn_at at = {plan, fault, FSN_SEC_SM, 0};
    for (uint32_t sub = 0; sub < plan->count[FSN_SEC_SUBDEVICE]; sub++) {
        const uint8_t *owner = fsn_record(plan, FSN_SEC_SUBDEVICE, sub);
        const uint32_t end = fsn_get32(owner + 24) + fsn_get32(owner + 28);
        int previous = -1;
        for (at.number = fsn_get32(owner + 24); at.number < end; at.number++) {
            const fsn_status status = prove_one_sm(&at, sub, previous, &pdos, &entries);
            if (status != FSN_OK) {
                return status;
            }
            previous = fsn_record(plan, FSN_SEC_SM, at.number)[4];
        }
    }
    if (pdos != plan->count[FSN_SEC_PDO] || entries != plan->count[FSN_SEC_ENTRY]) {
        return fsn_refuse(fault, FSN_E_PLAN_REFERENCE, FSN_SEC_PDO, FSN_FAULT_NO_RECORD,
                          plan->offset[FSN_SEC_PDO], "PDOs or entries belong to no sync manager");
    }
    return FSN_OK;
}

fsn_status fsn_prove_layout(const struct fsn_plan *plan, struct fsn_fault *fault) {
    typedef fsn_status (*proof)(const struct fsn_plan *, struct fsn_fault *);
    static const proof proofs[] = {prove_strings, prove_subdevices, prove_sdos, prove_sms};
    fsn_status status = FSN_OK;
    for (size_t i = 0; i < sizeof proofs / sizeof proofs[0] && status == FSN_OK; i++) {
        status = proofs[i](plan, fault);
    }
    return status;
}
