/** The proofs of docs/reference/plan-format.md, “What a reader proves again”. Section by section;
 *  a later section may rely on what the earlier ones have shown. */
#include "plan_internal.h"

#include <stdbool.h>

/** What a rule needs to refuse a record. */
struct at {
    const struct fsn_plan *plan;
    struct fsn_fault *fault;
    uint32_t section, number;
};

static fsn_status no(const struct at *at, fsn_status status, uint32_t field) {
    const uint8_t *r = fsn_record(at->plan, at->section, at->number);
    return fsn_refuse(at->fault, status, at->section, at->number,
                      (uint32_t)(r - at->plan->bytes) + field);
}

static bool string_ok(const struct fsn_plan *plan, const uint8_t *field) {
    return fsn_get32(field) < plan->count[FSN_SEC_STRINGS];
}

static bool is_frame(uint32_t size_bytes) {
    return size_bytes == 6 ||
           (size_bytes >= 7 && size_bytes <= FSN_MAX_FRAME_BYTES && size_bytes % 4 == 3);
}

static uint32_t safe_bytes_of(uint32_t frame_bytes) {
    return frame_bytes == 6 ? 1 : (frame_bytes - 3) / 2;
}

static fsn_status prove_strings(const struct fsn_plan *plan, struct fsn_fault *fault) {
    const uint32_t count = plan->count[FSN_SEC_STRINGS];
    const uint8_t *table = plan->bytes + plan->offset[FSN_SEC_STRINGS];
    if (count == 0 || table[0] != 0 || table[count - 1] != 0) {
        return fsn_refuse(fault, FSN_E_PLAN_STRING, FSN_SEC_STRINGS, FSN_FAULT_NO_RECORD,
                          plan->offset[FSN_SEC_STRINGS]);
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
    struct at at = {plan, fault, FSN_SEC_SUBDEVICE, 0};
    for (; at.number < plan->count[FSN_SEC_SUBDEVICE]; at.number++) {
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        if (!string_ok(plan, r)) {
            return no(&at, FSN_E_PLAN_STRING, 0);
        }
        if (fsn_get32(r + 16) > fsn_get32(r + 20)) {
            return no(&at, FSN_E_PLAN_VALUE, 16);
        }
        if (!tiles(fsn_get32(r + 24), fsn_get32(r + 28), &sms, plan->count[FSN_SEC_SM])) {
            return no(&at, FSN_E_PLAN_REFERENCE, 24);
        }
        if (!tiles(fsn_get32(r + 32), fsn_get32(r + 36), &sdos, plan->count[FSN_SEC_SDO])) {
            return no(&at, FSN_E_PLAN_REFERENCE, 32);
        }
        if (fsn_get16(r + 42) > 1 || fsn_get32(r + 44) != 0) {
            return no(&at, FSN_E_PLAN_RESERVED, 42);
        }
    }
    if (sms != plan->count[FSN_SEC_SM] || sdos != plan->count[FSN_SEC_SDO]) {
        return fsn_refuse(fault, FSN_E_PLAN_REFERENCE, FSN_SEC_SUBDEVICE, FSN_FAULT_NO_RECORD,
                          plan->offset[FSN_SEC_SUBDEVICE]);
    }
    return FSN_OK;
}

static fsn_status prove_sdos(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct at at = {plan, fault, FSN_SEC_SDO, 0};
    for (; at.number < plan->count[FSN_SEC_SDO]; at.number++) {
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        const uint8_t size = r[3];
        if (size != 1 && size != 2 && size != 4 && size != 8) {
            return no(&at, FSN_E_PLAN_VALUE, 3);
        }
        if (fsn_get32(r + 4) != 0) {
            return no(&at, FSN_E_PLAN_RESERVED, 4);
        }
    }
    return FSN_OK;
}

/** Entries of one PDO: follow each other from `bit` on. */
static fsn_status prove_entries(struct at *at, uint32_t first, uint32_t count, uint32_t *bit,
                                bool *registered) {
    at->section = FSN_SEC_ENTRY;
    for (at->number = first; at->number < first + count; at->number++) {
        const uint8_t *r = fsn_record(at->plan, at->section, at->number);
        if (fsn_get32(r + 8) != *bit) {
            return no(at, FSN_E_PLAN_LAYOUT, 8);
        }
        if (r[3] > 1 || r[7] != 0) {
            return no(at, FSN_E_PLAN_RESERVED, 3);
        }
        if (r[6] > 4 || (r[3] == 1 && fsn_get16(r) == 0)) {
            return no(at, FSN_E_PLAN_VALUE, 6);
        }
        *bit += fsn_get16(r + 4);
        *registered = *registered || r[3] == 1;
        if (*bit > FSN_MAX_SM_BITS) {
            return no(at, FSN_E_PLAN_LAYOUT, 4);
        }
    }
    return FSN_OK;
}

static fsn_status prove_pdos(const struct at *sm, uint32_t first, uint32_t count, uint32_t *entries,
                             uint32_t *bit, bool *registered) {
    struct at at = {sm->plan, sm->fault, FSN_SEC_PDO, first};
    for (uint32_t n = first; n < first + count; n++) {
        at.section = FSN_SEC_PDO;
        at.number = n;
        const uint8_t *r = fsn_record(at.plan, at.section, n);
        if (fsn_get16(r + 2) != 0) {
            return no(&at, FSN_E_PLAN_RESERVED, 2);
        }
        if (fsn_get32(r + 12) != *bit) {
            return no(&at, FSN_E_PLAN_LAYOUT, 12);
        }
        const uint32_t first_entry = fsn_get32(r + 4);
        const uint32_t entry_count = fsn_get32(r + 8);
        if (!tiles(first_entry, entry_count, entries, at.plan->count[FSN_SEC_ENTRY])) {
            return no(&at, FSN_E_PLAN_REFERENCE, 4);
        }
        const fsn_status status = prove_entries(&at, first_entry, entry_count, bit, registered);
        if (status != FSN_OK) {
            return status;
        }
    }
    return FSN_OK;
}

static fsn_status prove_one_sm(const struct at *at, uint32_t owner, int previous_index,
                               uint32_t *pdos, uint32_t *entries) {
    const uint8_t *r = fsn_record(at->plan, at->section, at->number);
    if (fsn_get32(r) != owner) {
        return no(at, FSN_E_PLAN_REFERENCE, 0);
    }
    if (r[4] > 15 || (int)r[4] <= previous_index || r[5] < FSN_OUTPUT || r[5] > FSN_INPUT ||
        r[6] > 2) {
        return no(at, FSN_E_PLAN_VALUE, 4);
    }
    if (r[7] > 1 || fsn_get32(r + 20) != 0) {
        return no(at, FSN_E_PLAN_RESERVED, 7);
    }
    const uint32_t first = fsn_get32(r + 12);
    const uint32_t count = fsn_get32(r + 16);
    if (!tiles(first, count, pdos, at->plan->count[FSN_SEC_PDO])) {
        return no(at, FSN_E_PLAN_REFERENCE, 12);
    }
    uint32_t bits = 0;
    bool registered = false;
    const fsn_status status = prove_pdos(at, first, count, entries, &bits, &registered);
    if (status != FSN_OK) {
        return status;
    }
    if (bits != fsn_get32(r + 8) || registered != (r[7] == 1)) {
        return no(at, FSN_E_PLAN_LAYOUT, 8);
    }
    return FSN_OK;
}

static fsn_status prove_sms(const struct fsn_plan *plan, struct fsn_fault *fault) {
    uint32_t pdos = 0;
    uint32_t entries = 0;
    struct at at = {plan, fault, FSN_SEC_SM, 0};
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
                          plan->offset[FSN_SEC_PDO]);
    }
    return FSN_OK;
}

static uint32_t sm_bits(const struct fsn_plan *plan, uint32_t sm) {
    return fsn_get32(fsn_record(plan, FSN_SEC_SM, sm) + 8);
}

static uint32_t sm_bytes(const struct fsn_plan *plan, uint32_t sm) {
    return (sm_bits(plan, sm) + 7) / 8;
}

static fsn_status prove_blocks(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct at at = {plan, fault, FSN_SEC_BLOCK, 0};
    uint32_t last_sm = 0;
    uint32_t last_end = 0;
    for (; at.number < plan->count[FSN_SEC_BLOCK]; at.number++) {
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        const uint32_t sm = fsn_get32(r);
        const uint32_t offset = fsn_get32(r + 4);
        const uint32_t frame = fsn_get16(r + 8);
        if (sm >= plan->count[FSN_SEC_SM]) {
            return no(&at, FSN_E_PLAN_REFERENCE, 0);
        }
        if (!is_frame(frame) || fsn_get16(r + 10) != safe_bytes_of(frame)) {
            return no(&at, FSN_E_PLAN_VALUE, 8);
        }
        const uint32_t size = sm_bytes(plan, sm);
        if (offset > size || frame > size - offset) {
            return no(&at, FSN_E_COPY_RANGE, 4);
        }
        if (at.number > 0 && (sm < last_sm || (sm == last_sm && offset < last_end))) {
            return no(&at, FSN_E_COPY_OVERLAP, 4);
        }
        if (fsn_get32(r + 12) > 1) {
            return no(&at, FSN_E_PLAN_RESERVED, 12);
        }
        last_sm = sm;
        last_end = offset + frame;
    }
    return FSN_OK;
}

/** First block that ends behind `byte` of an SM, in the sorted list of blocks; count if none. */
static uint32_t first_block_behind(const struct fsn_plan *plan, uint32_t sm, uint32_t byte) {
    uint32_t low = 0;
    uint32_t high = plan->count[FSN_SEC_BLOCK];
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        const uint8_t *r = fsn_record(plan, FSN_SEC_BLOCK, middle);
        const uint32_t end = fsn_get32(r + 4) + fsn_get16(r + 8);
        if (fsn_get32(r) < sm || (fsn_get32(r) == sm && end <= byte)) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

enum touch { TOUCH_NONE, TOUCH_EXACT, TOUCH_PART };

/** How bytes [byte, byte + size) of an SM meet the FSoE blocks in it. */
static enum touch touch_of(const struct fsn_plan *plan, uint32_t sm, uint32_t byte, uint32_t size) {
    const uint32_t number = first_block_behind(plan, sm, byte);
    if (number >= plan->count[FSN_SEC_BLOCK]) {
        return TOUCH_NONE;
    }
    const uint8_t *r = fsn_record(plan, FSN_SEC_BLOCK, number);
    if (fsn_get32(r) != sm || fsn_get32(r + 4) >= byte + size) {
        return TOUCH_NONE;
    }
    return fsn_get32(r + 4) == byte && fsn_get16(r + 8) == size ? TOUCH_EXACT : TOUCH_PART;
}

static fsn_status prove_symbols(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct at at = {plan, fault, FSN_SEC_SYMBOL, 0};
    for (; at.number < plan->count[FSN_SEC_SYMBOL]; at.number++) {
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        const uint32_t sm = fsn_get32(r + 4);
        const uint32_t bit = fsn_get32(r + 8);
        const uint32_t bits = fsn_get16(r + 12);
        if (!string_ok(plan, r)) {
            return no(&at, FSN_E_PLAN_STRING, 0);
        }
        if (sm >= plan->count[FSN_SEC_SM]) {
            return no(&at, FSN_E_PLAN_REFERENCE, 4);
        }
        if (r[15] > 3 || fsn_get32(r + 16) != 0) {
            return no(&at, FSN_E_PLAN_RESERVED, 15);
        }
        const uint8_t direction = fsn_record(plan, FSN_SEC_SM, sm)[5];
        if (bits == 0 || bits > 64 || r[14] > 4 || (r[15] & 1u) != (direction == FSN_OUTPUT)) {
            return no(&at, FSN_E_PLAN_VALUE, 12);
        }
        if (bit > sm_bits(plan, sm) || bits > sm_bits(plan, sm) - bit) {
            return no(&at, FSN_E_COPY_RANGE, 8);
        }
        const uint32_t first = bit / 8;
        const uint32_t last = (bit + bits - 1) / 8;
        if (touch_of(plan, sm, first, last - first + 1) != TOUCH_NONE) {
            return no(&at, FSN_E_COPY_FRAME, 8);
        }
    }
    return FSN_OK;
}

/** One end of a copy: registered SM of the right direction, whole bytes inside it. */
static fsn_status prove_end(const struct at *at, uint32_t field, uint8_t direction, uint32_t bits) {
    const struct fsn_plan *plan = at->plan;
    const uint8_t *r = fsn_record(plan, at->section, at->number) + field;
    const uint32_t sm = fsn_get32(r);
    const uint32_t bit = fsn_get32(r + 4);
    if (sm >= plan->count[FSN_SEC_SM]) {
        return no(at, FSN_E_PLAN_REFERENCE, field);
    }
    const uint8_t *manager = fsn_record(plan, FSN_SEC_SM, sm);
    if (manager[5] != direction || manager[7] != 1) {
        return no(at, FSN_E_COPY_DIRECTION, field);
    }
    if (bit % 8 != 0) {
        return no(at, FSN_E_COPY_ALIGN, field + 4);
    }
    const uint32_t room = 8 * sm_bytes(plan, sm);
    if (bit > room || bits > room - bit) {
        return no(at, FSN_E_COPY_RANGE, field + 4);
    }
    return FSN_OK;
}

static fsn_status prove_copy_frame(const struct at *at) {
    const uint8_t *r = fsn_record(at->plan, at->section, at->number);
    const uint32_t size = fsn_get32(r + 16) / 8;
    const bool fsoe = fsn_get16(r + 24) == FSN_COPY_FSOE;
    if (fsoe && !is_frame(size)) {
        return no(at, FSN_E_COPY_FRAME, 16);
    }
    for (uint32_t field = 0; field <= 8; field += 8) {
        const enum touch touch =
            touch_of(at->plan, fsn_get32(r + field), fsn_get32(r + field + 4) / 8, size);
        if (touch == TOUCH_PART || (touch == TOUCH_EXACT && !fsoe)) {
            return no(at, FSN_E_COPY_FRAME, field);
        }
    }
    return FSN_OK;
}

static fsn_status prove_one_copy(const struct at *at) {
    const struct fsn_plan *plan = at->plan;
    const uint8_t *r = fsn_record(plan, at->section, at->number);
    const uint32_t bits = fsn_get32(r + 16);
    const uint16_t kind = fsn_get16(r + 24);
    if (bits == 0 || bits % 8 != 0) {
        return no(at, FSN_E_COPY_ALIGN, 16);
    }
    fsn_status status = prove_end(at, 0, FSN_INPUT, bits);
    if (status == FSN_OK) {
        status = prove_end(at, 8, FSN_OUTPUT, bits);
    }
    if (status != FSN_OK) {
        return status;
    }
    if (!string_ok(plan, r + 20)) {
        return no(at, FSN_E_PLAN_STRING, 20);
    }
    if (kind != FSN_COPY_FSOE && kind != FSN_COPY_STANDARD) {
        return no(at, FSN_E_PLAN_VALUE, 24);
    }
    if (fsn_get16(r + 26) != 0) {
        return no(at, FSN_E_PLAN_RESERVED, 26);
    }
    const uint32_t connection = fsn_get32(r + 28);
    const bool known = connection < plan->count[FSN_SEC_CONNECTION];
    if (kind == FSN_COPY_FSOE ? !known : connection != FSN_NONE) {
        return no(at, FSN_E_COPY_PAIR, 28);
    }
    return prove_copy_frame(at);
}

static fsn_status prove_copies(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct at at = {plan, fault, FSN_SEC_COPY, 0};
    uint32_t last_sm = 0;
    uint32_t last_end = 0;
    for (; at.number < plan->count[FSN_SEC_COPY]; at.number++) {
        const fsn_status status = prove_one_copy(&at);
        if (status != FSN_OK) {
            return status;
        }
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        const uint32_t sm = fsn_get32(r + 8);
        const uint32_t bit = fsn_get32(r + 12);
        if (at.number > 0 && (sm < last_sm || (sm == last_sm && bit < last_end))) {
            return no(&at, FSN_E_COPY_OVERLAP, 8);
        }
        last_sm = sm;
        last_end = bit + fsn_get32(r + 16);
    }
    return FSN_OK;
}

/** One direction of a connection: an FSoE copy of its own, between the right SubDevices. */
static fsn_status prove_direction(const struct at *at, uint32_t field, uint32_t from, uint32_t to,
                                  uint32_t safe_bytes) {
    const struct fsn_plan *plan = at->plan;
    const uint8_t *r = fsn_record(plan, at->section, at->number);
    const uint32_t copy = fsn_get32(r + field);
    if (copy >= plan->count[FSN_SEC_COPY]) {
        return no(at, FSN_E_PLAN_REFERENCE, field);
    }
    const uint8_t *c = fsn_record(plan, FSN_SEC_COPY, copy);
    const uint32_t source = fsn_get32(fsn_record(plan, FSN_SEC_SM, fsn_get32(c)));
    const uint32_t target = fsn_get32(fsn_record(plan, FSN_SEC_SM, fsn_get32(c + 8)));
    if (fsn_get16(c + 24) != FSN_COPY_FSOE || fsn_get32(c + 28) != at->number || source != from ||
        target != to) {
        return no(at, FSN_E_COPY_PAIR, field);
    }
    if (safe_bytes_of(fsn_get32(c + 16) / 8) != safe_bytes) {
        return no(at, FSN_E_PLAN_VALUE, field);
    }
    return FSN_OK;
}

static fsn_status prove_connections(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct at at = {plan, fault, FSN_SEC_CONNECTION, 0};
    for (; at.number < plan->count[FSN_SEC_CONNECTION]; at.number++) {
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        const uint32_t main_sub = fsn_get32(r + 8);
        const uint32_t sub = fsn_get32(r + 12);
        if (!string_ok(plan, r) || !string_ok(plan, r + 4)) {
            return no(&at, FSN_E_PLAN_STRING, 0);
        }
        if (main_sub == sub) {
            return no(&at, FSN_E_COPY_PAIR, 8);
        }
        if (fsn_get16(r + 30) > 7 || fsn_get32(r + 36) != 0) {
            return no(&at, FSN_E_PLAN_RESERVED, 30);
        }
        fsn_status status = prove_direction(&at, 16, main_sub, sub, fsn_get16(r + 32));
        if (status == FSN_OK) {
            status = prove_direction(&at, 20, sub, main_sub, fsn_get16(r + 34));
        }
        if (status != FSN_OK) {
            return status;
        }
    }
    return FSN_OK;
}

/** Each FSoE copy is one of the two of the connection it names. */
static fsn_status prove_owners(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct at at = {plan, fault, FSN_SEC_COPY, 0};
    for (; at.number < plan->count[FSN_SEC_COPY]; at.number++) {
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        if (fsn_get16(r + 24) != FSN_COPY_FSOE) {
            continue;
        }
        const uint8_t *c = fsn_record(plan, FSN_SEC_CONNECTION, fsn_get32(r + 28));
        if (fsn_get32(c + 16) != at.number && fsn_get32(c + 20) != at.number) {
            return no(&at, FSN_E_COPY_PAIR, 28);
        }
    }
    return FSN_OK;
}

fsn_status fsn_plan_prove(const struct fsn_plan *plan, struct fsn_fault *fault) {
    typedef fsn_status (*proof)(const struct fsn_plan *, struct fsn_fault *);
    static const proof proofs[] = {
        prove_strings, prove_subdevices, prove_sdos,        prove_sms,    prove_blocks,
        prove_symbols, prove_copies,     prove_connections, prove_owners,
    };
    for (size_t i = 0; i < sizeof proofs / sizeof proofs[0]; i++) {
        const fsn_status status = proofs[i](plan, fault);
        if (status != FSN_OK) {
            return status;
        }
    }
    return FSN_OK;
}
