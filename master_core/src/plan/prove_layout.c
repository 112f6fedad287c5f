/** The proofs of docs/reference/plan-format.md, “What a reader proves again”, first half: the
 *  SubDevices. Section by section; a later one relies on the proofs of the earlier ones. */
#include "plan/plan_internal.h"

fsn_status fsn_refuse_at(const struct fsn_at *at, fsn_status status, uint32_t field,
                         const char *rule) {
    const uint8_t *r = fsn_record(at->plan, at->section, at->number);
    return fsn_refuse(at->fault, status, at->section, at->number,
                      (uint32_t)(r - at->plan->bytes) + field, rule);
}

bool fsn_string_ok(const struct fsn_plan *plan, uint32_t offset) {
    return offset < plan->count[FSN_SEC_STRINGS];
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

/** Whether a range of records starts where the previous one ended. */
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
        const struct fsn_subdevice_record r = fsn_read_subdevice(plan, at.number);
        if (!fsn_string_ok(plan, r.name)) {
            return fsn_refuse_at(&at, FSN_E_PLAN_STRING, FSN_AT(subdevice, name),
                                 "the name lies outside the strings");
        }
        if (r.revision_low > r.revision_high) {
            return fsn_refuse_at(&at, FSN_E_PLAN_VALUE, FSN_AT(subdevice, revision_low),
                                 "the lowest revision is above the highest");
        }
        if (!tiles(r.first_sm, r.sm_count, &sms, plan->count[FSN_SEC_SM])) {
            return fsn_refuse_at(&at, FSN_E_PLAN_REFERENCE, FSN_AT(subdevice, first_sm),
                                 "sync managers do not follow those of the SubDevice before");
        }
        if (!tiles(r.first_sdo, r.sdo_count, &sdos, plan->count[FSN_SEC_SDO])) {
            return fsn_refuse_at(&at, FSN_E_PLAN_REFERENCE, FSN_AT(subdevice, first_sdo),
                                 "start-up SDOs do not follow those of the SubDevice before");
        }
        if (r.in_copy > 1) {
            return fsn_refuse_at(&at, FSN_E_PLAN_RESERVED, FSN_AT(subdevice, in_copy),
                                 "a flag of the SubDevice is unknown");
        }
        if (!fsn_string_ok(plan, r.driver)) {
            return fsn_refuse_at(&at, FSN_E_PLAN_STRING, FSN_AT(subdevice, driver),
                                 "what the driver reads lies outside the strings");
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
        const struct fsn_sdo_record r = fsn_read_sdo(plan, at.number);
        const uint8_t size = r.size_bytes;
        if (size != 1 && size != 2 && size != 4 && size != 8) {
            return fsn_refuse_at(&at, FSN_E_PLAN_VALUE, FSN_AT(sdo, size_bytes),
                                 "an SDO has 1, 2, 4 or 8 bytes");
        }
        if (r.reserved != 0) {
            return fsn_refuse_at(&at, FSN_E_PLAN_RESERVED, FSN_AT(sdo, reserved),
                                 "a reserved field of the SDO is not zero");
        }
    }
    return FSN_OK;
}

/** Proves the entries of one PDO: consecutive from `bit` on. */
static fsn_status prove_entries(struct fsn_at *at, uint32_t first, uint32_t count, uint32_t *bit,
                                bool *registered) {
    at->section = FSN_SEC_ENTRY;
    for (at->number = first; at->number < first + count; at->number++) {
        const struct fsn_entry_record r = fsn_read_entry(at->plan, at->number);
        if (r.bit_offset != *bit) {
            return fsn_refuse_at(at, FSN_E_PLAN_LAYOUT, FSN_AT(entry, bit_offset),
                                 "the entry does not start where the one before ends");
        }
        if (r.registered > 1 || r.reserved != 0) {
            return fsn_refuse_at(
                at, FSN_E_PLAN_RESERVED, FSN_AT(entry, registered),
                "a flag of the entry is unknown or its reserved field is not zero");
        }
        if (r.kind > 4 || (r.registered == 1 && r.index == 0)) {
            return fsn_refuse_at(at, FSN_E_PLAN_VALUE, FSN_AT(entry, kind),
                                 "the type is unknown, or padding is registered");
        }
        *bit += r.bits;
        *registered = *registered || r.registered == 1;
        if (*bit > FSN_MAX_SM_BITS) {
            return fsn_refuse_at(at, FSN_E_PLAN_LAYOUT, FSN_AT(entry, bits),
                                 "the sync manager has more than 1486 bytes");
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
        const struct fsn_pdo_record r = fsn_read_pdo(at.plan, n);
        if (r.reserved != 0) {
            return fsn_refuse_at(&at, FSN_E_PLAN_RESERVED, FSN_AT(pdo, reserved),
                                 "a reserved field of the PDO is not zero");
        }
        if (r.bit_offset != *bit) {
            return fsn_refuse_at(&at, FSN_E_PLAN_LAYOUT, FSN_AT(pdo, bit_offset),
                                 "the PDO does not start where the one before ends");
        }
        if (!tiles(r.first_entry, r.entry_count, entries, at.plan->count[FSN_SEC_ENTRY])) {
            return fsn_refuse_at(&at, FSN_E_PLAN_REFERENCE, FSN_AT(pdo, first_entry),
                                 "entries do not follow those of the PDO before");
        }
        FSN_TRY(prove_entries(&at, r.first_entry, r.entry_count, bit, registered));
    }
    return FSN_OK;
}

static fsn_status prove_one_sm(const struct fsn_at *at, uint32_t owner, int previous_index,
                               uint32_t *pdos, uint32_t *entries) {
    const struct fsn_sm_record r = fsn_read_sm(at->plan, at->number);
    if (r.subdevice != owner) {
        return fsn_refuse_at(at, FSN_E_PLAN_REFERENCE, FSN_AT(sm, subdevice),
                             "the sync manager belongs to another SubDevice");
    }
    /* Ascending numbers: a sync manager then exists once, and the order of the image is fixed. */
    if (r.index > 15 || (int)r.index <= previous_index || r.direction < FSN_OUTPUT ||
        r.direction > FSN_INPUT || r.watchdog > 2) {
        return fsn_refuse_at(
            at, FSN_E_PLAN_VALUE, FSN_AT(sm, index),
            "SM number, direction or watchdog is not allowed, or SM numbers do not rise");
    }
    if (r.registered > 1 || r.reserved != 0) {
        return fsn_refuse_at(
            at, FSN_E_PLAN_RESERVED, FSN_AT(sm, registered),
            "a flag of the sync manager is unknown or its reserved field is not zero");
    }
    if (!tiles(r.first_pdo, r.pdo_count, pdos, at->plan->count[FSN_SEC_PDO])) {
        return fsn_refuse_at(at, FSN_E_PLAN_REFERENCE, FSN_AT(sm, first_pdo),
                             "PDOs do not follow those of the sync manager before");
    }
    uint32_t bits = 0;
    bool registered = false;
    FSN_TRY(prove_pdos(at, r.first_pdo, r.pdo_count, entries, &bits, &registered));
    /* Length and flag are stored twice, so that readers need not calculate them; both must
     * agree. */
    if (bits != r.bits || registered != (r.registered == 1)) {
        return fsn_refuse_at(at, FSN_E_PLAN_LAYOUT, FSN_AT(sm, bits),
                             "the entries do not add up to length and flags of the sync manager");
    }
    return FSN_OK;
}

static fsn_status prove_sms(const struct fsn_plan *plan, struct fsn_fault *fault) {
    uint32_t pdos = 0;
    uint32_t entries = 0;
    struct fsn_at at = {plan, fault, FSN_SEC_SM, 0};
    for (uint32_t sub = 0; sub < plan->count[FSN_SEC_SUBDEVICE]; sub++) {
        const struct fsn_subdevice_record owner = fsn_read_subdevice(plan, sub);
        const uint32_t end = owner.first_sm + owner.sm_count;
        int previous = -1;
        for (at.number = owner.first_sm; at.number < end; at.number++) {
            FSN_TRY(prove_one_sm(&at, sub, previous, &pdos, &entries));
            previous = fsn_read_sm(plan, at.number).index;
        }
    }
    if (pdos != plan->count[FSN_SEC_PDO] || entries != plan->count[FSN_SEC_ENTRY]) {
        return fsn_refuse(fault, FSN_E_PLAN_REFERENCE, FSN_SEC_PDO, FSN_FAULT_NO_RECORD,
                          plan->offset[FSN_SEC_PDO], "PDOs or entries belong to no sync manager");
    }
    return FSN_OK;
}

/** A plan without bus records has one bus, with all SubDevices. */
static fsn_status prove_buses(const struct fsn_plan *plan, struct fsn_fault *fault) {
    const uint32_t count = plan->count[FSN_SEC_BUS];
    uint32_t subdevices = 0;
    struct fsn_at at = {plan, fault, FSN_SEC_BUS, 0};
    for (; at.number < count; at.number++) {
        const struct fsn_bus_record r = fsn_read_bus(plan, at.number);
        if (!fsn_string_ok(plan, r.name) || *fsn_string(plan, r.name) == 0) {
            return fsn_refuse_at(&at, FSN_E_PLAN_STRING, FSN_AT(bus, name),
                                 "the bus has no name, or it lies outside the strings");
        }
        if (at.number == 0 ? r.cycle_ns == 0 || r.cycle_ns != plan->cycle_ns
                           : r.cycle_ns < plan->cycle_ns) {
            return fsn_refuse_at(&at, FSN_E_PLAN_VALUE, FSN_AT(bus, cycle_ns),
                                 "the first bus has the cycle of the plan, others none below it");
        }
        if (r.subdevice_count == 0 || !tiles(r.first_subdevice, r.subdevice_count, &subdevices,
                                             plan->count[FSN_SEC_SUBDEVICE])) {
            return fsn_refuse_at(&at, FSN_E_PLAN_REFERENCE, FSN_AT(bus, first_subdevice),
                                 "SubDevices do not follow those of the bus before");
        }
    }
    if (count > 0 && subdevices != plan->count[FSN_SEC_SUBDEVICE]) {
        return fsn_refuse(fault, FSN_E_PLAN_REFERENCE, FSN_SEC_BUS, FSN_FAULT_NO_RECORD,
                          plan->offset[FSN_SEC_BUS], "a SubDevice belongs to no bus");
    }
    return FSN_OK;
}

/** Whether the SubDevices of a group are consecutive and found by the alias of the first. */
static bool is_found_by_alias(const struct fsn_plan *plan, const struct fsn_group_record *group) {
    const uint16_t alias = fsn_read_subdevice(plan, group->first_subdevice).alias;
    for (uint32_t n = 0; n < group->subdevice_count; n++) {
        const struct fsn_subdevice_record r = fsn_read_subdevice(plan, group->first_subdevice + n);
        if (alias == 0 || r.alias != alias || r.position != n || r.assign_activate != 0) {
            return false;
        }
    }
    return true;
}

/** Groups are ascending, with permanent SubDevices between them. */
static fsn_status prove_groups(const struct fsn_plan *plan, struct fsn_fault *fault) {
    uint32_t end = 0;
    struct fsn_at at = {plan, fault, FSN_SEC_GROUP, 0};
    for (; at.number < plan->count[FSN_SEC_GROUP]; at.number++) {
        const struct fsn_group_record r = fsn_read_group(plan, at.number);
        if (!fsn_string_ok(plan, r.name) || *fsn_string(plan, r.name) == 0 ||
            !fsn_string_ok(plan, r.place)) {
            return fsn_refuse_at(&at, FSN_E_PLAN_STRING, FSN_AT(group, name),
                                 "the group has no name, or a text outside the strings");
        }
        const uint32_t count = plan->count[FSN_SEC_SUBDEVICE];
        if (r.first_subdevice < end || r.first_subdevice > count || r.subdevice_count == 0 ||
            r.subdevice_count > count - r.first_subdevice) {
            return fsn_refuse_at(&at, FSN_E_PLAN_REFERENCE, FSN_AT(group, first_subdevice),
                                 "SubDevices of the group do not exist, or are in another");
        }
        if (!is_found_by_alias(plan, &r)) {
            return fsn_refuse_at(&at, FSN_E_PLAN_VALUE, FSN_AT(group, first_subdevice),
                                 "the group has no alias of its own, its SubDevices do not follow "
                                 "each other, or one has distributed clocks");
        }
        end = r.first_subdevice + r.subdevice_count;
    }
    return FSN_OK;
}

fsn_status fsn_prove_layout(const struct fsn_plan *plan, struct fsn_fault *fault) {
    typedef fsn_status (*proof)(const struct fsn_plan *, struct fsn_fault *);
    static const proof proofs[] = {prove_strings, prove_subdevices, prove_buses,
                                   prove_groups,  prove_sdos,       prove_sms};
    for (size_t i = 0; i < sizeof proofs / sizeof proofs[0]; i++) {
        FSN_TRY(proofs[i](plan, fault));
    }
    return FSN_OK;
}
