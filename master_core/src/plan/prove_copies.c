/** The proofs of docs/reference/plan-format.md, “What a reader proves again”, second half: what
 * moves between the SubDevices. Blocks and copies are sorted, so every overlap shows at a neighbour
 * or by bisection: O(n log n) whatever the file says. */
#include "fsn/fsoe.h"
#include "plan/plan_internal.h"

static uint32_t safe_bytes_of(uint32_t frame_bytes) {
    return frame_bytes == 6 ? 1 : (frame_bytes - 3) / 2;
}

static fsn_status prove_blocks(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct fsn_at at = {plan, fault, FSN_SEC_BLOCK, 0};
    uint32_t last_sm = 0;
    uint32_t last_end = 0;
    for (; at.number < plan->count[FSN_SEC_BLOCK]; at.number++) {
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        const uint32_t sm = fsn_get32(r);
        const uint32_t offset = fsn_get32(r + 4);
        const uint32_t frame = fsn_get16(r + 8);
        if (sm >= plan->count[FSN_SEC_SM]) {
            return fsn_no(&at, FSN_E_PLAN_REFERENCE, 0, "the block's sync manager does not exist");
        }
        if (!fsn_fsoe_is_frame_length(frame) || fsn_get16(r + 10) != safe_bytes_of(frame)) {
            return fsn_no(&at, FSN_E_PLAN_VALUE, 8,
                          "an FSoE frame has 6 bytes or 3 + 4 k up to 255, and safe data to match");
        }
        const uint32_t size = fsn_sm_bits(plan, sm) / 8; /* whole bytes only */
        if (offset > size || frame > size - offset) {
            return fsn_no(&at, FSN_E_COPY_RANGE, 4, "the block ends behind its sync manager");
        }
        if (at.number > 0 && (sm < last_sm || (sm == last_sm && offset < last_end))) {
            return fsn_no(&at, FSN_E_COPY_OVERLAP, 4,
                          "blocks overlap or are not sorted by sync manager and offset");
        }
        if (fsn_get32(r + 12) > 1) {
            return fsn_no(&at, FSN_E_PLAN_RESERVED, 12, "a flag of the block is unknown");
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

enum fsn_touch fsn_touch_of(const struct fsn_plan *plan, uint32_t sm, uint32_t byte,
                            uint32_t size) {
    const uint32_t number = first_block_behind(plan, sm, byte);
    if (number >= plan->count[FSN_SEC_BLOCK]) {
        return FSN_TOUCH_NONE;
    }
    const uint8_t *r = fsn_record(plan, FSN_SEC_BLOCK, number);
    if (fsn_get32(r) != sm || fsn_get32(r + 4) >= byte + size) {
        return FSN_TOUCH_NONE;
    }
    return fsn_get32(r + 4) == byte && fsn_get16(r + 8) == size ? FSN_TOUCH_EXACT : FSN_TOUCH_PART;
}

/** What a symbol says about the stop: an output's own bits, and none that could start a machine. */
static bool is_stop_value_ok(const uint8_t *symbol, uint32_t bits) {
    const uint64_t value = fsn_get64(symbol + 20);
    const bool closed = (symbol[15] & 1u) == 0 || (symbol[15] & 2u) != 0;
    return value == 0 || (!closed && (bits == 64 || value >> bits == 0));
}

/** Finite, by its bits: what is read here is not believed to be a number. */
static bool is_scale_ok(const uint8_t *symbol) {
    const uint64_t factor = fsn_get64(symbol + 28);
    const uint64_t offset = fsn_get64(symbol + 36);
    return (factor << 1) != 0 && ((factor >> 52) & 0x7FFu) != 0x7FFu &&
           ((offset >> 52) & 0x7FFu) != 0x7FFu;
}

static fsn_status prove_symbols(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct fsn_at at = {plan, fault, FSN_SEC_SYMBOL, 0};
    for (; at.number < plan->count[FSN_SEC_SYMBOL]; at.number++) {
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        const uint32_t sm = fsn_get32(r + 4);
        const uint32_t bit = fsn_get32(r + 8);
        const uint32_t bits = fsn_get16(r + 12);
        if (!fsn_string_ok(plan, r)) {
            return fsn_no(&at, FSN_E_PLAN_STRING, 0, "the name lies outside the strings");
        }
        if (sm >= plan->count[FSN_SEC_SM]) {
            return fsn_no(&at, FSN_E_PLAN_REFERENCE, 4, "the symbol's sync manager does not exist");
        }
        if (r[15] > 3 || fsn_get32(r + 16) != 0) {
            return fsn_no(&at, FSN_E_PLAN_RESERVED, 15,
                          "a flag of the symbol is unknown or its reserved field is not zero");
        }
        const uint8_t direction = fsn_record(plan, FSN_SEC_SM, sm)[5];
        if (bits == 0 || bits > 64 || r[14] > 4 || (r[15] & 1u) != (direction == FSN_OUTPUT)) {
            return fsn_no(
                &at, FSN_E_PLAN_VALUE, 12,
                "a symbol has 1 to 64 bits, a known type and the direction of its sync manager");
        }
        if (bit > fsn_sm_bits(plan, sm) || bits > fsn_sm_bits(plan, sm) - bit) {
            return fsn_no(&at, FSN_E_COPY_RANGE, 8, "the symbol ends behind its sync manager");
        }
        if (!is_stop_value_ok(r, bits)) {
            return fsn_no(&at, FSN_E_PLAN_VALUE, 20,
                          "a stop value has the bits of its output, and is 0 for an input and for "
                          "what is restart relevant");
        }
        if (!is_scale_ok(r)) {
            return fsn_no(&at, FSN_E_PLAN_VALUE, 28,
                          "factor and offset are finite numbers, and the factor is not 0");
        }
        const uint32_t first = bit / 8;
        const uint32_t last = (bit + bits - 1) / 8;
        if (fsn_touch_of(plan, sm, first, last - first + 1) != FSN_TOUCH_NONE) {
            return fsn_no(&at, FSN_E_COPY_FRAME, 8, "a symbol must not touch an FSoE block");
        }
    }
    return FSN_OK;
}

/** One end of a copy: registered SM of the right direction, whole bytes inside it. */
static fsn_status prove_end(const struct fsn_at *at, uint32_t field, uint8_t direction,
                            uint32_t bits) {
    const struct fsn_plan *plan = at->plan;
    const uint8_t *r = fsn_record(plan, at->section, at->number) + field;
    const uint32_t sm = fsn_get32(r);
    const uint32_t bit = fsn_get32(r + 4);
    if (sm >= plan->count[FSN_SEC_SM]) {
        return fsn_no(at, FSN_E_PLAN_REFERENCE, field, "the copy's sync manager does not exist");
    }
    const uint8_t *manager = fsn_record(plan, FSN_SEC_SM, sm);
    if (manager[5] != direction || manager[7] != 1) {
        return fsn_no(at, FSN_E_COPY_DIRECTION, field,
                      "a copy reads a registered input and writes a registered output");
    }
    if (bit % 8 != 0) {
        return fsn_no(at, FSN_E_COPY_ALIGN, field + 4, "a copy starts on a byte");
    }
    const uint32_t room = fsn_sm_bits(plan, sm);
    if (bit > room || bits > room - bit) {
        return fsn_no(at, FSN_E_COPY_RANGE, field + 4, "the copy ends behind its sync manager");
    }
    return FSN_OK;
}

static fsn_status prove_copy_frame(const struct fsn_at *at) {
    const uint8_t *r = fsn_record(at->plan, at->section, at->number);
    const uint32_t size = fsn_get32(r + 16) / 8;
    const bool fsoe = fsn_get16(r + 24) == FSN_COPY_FSOE;
    if (fsoe && !fsn_fsoe_is_frame_length(size)) {
        return fsn_no(at, FSN_E_COPY_FRAME, 16, "no FSoE frame has this length");
    }
    for (uint32_t field = 0; field <= 8; field += 8) {
        const enum fsn_touch touch =
            fsn_touch_of(at->plan, fsn_get32(r + field), fsn_get32(r + field + 4) / 8, size);
        if (touch == FSN_TOUCH_PART || (touch == FSN_TOUCH_EXACT && !fsoe)) {
            return fsn_no(at, FSN_E_COPY_FRAME, field,
                          "a copy must cover a whole FSoE block as an FSoE copy, or none");
        }
    }
    return FSN_OK;
}

static fsn_status prove_one_copy(const struct fsn_at *at) {
    const struct fsn_plan *plan = at->plan;
    const uint8_t *r = fsn_record(plan, at->section, at->number);
    const uint32_t bits = fsn_get32(r + 16);
    const uint16_t kind = fsn_get16(r + 24);
    if (bits == 0 || bits % 8 != 0) {
        return fsn_no(at, FSN_E_COPY_ALIGN, 16, "a copy has at least one whole byte");
    }
    fsn_status status = prove_end(at, 0, FSN_INPUT, bits);
    if (status == FSN_OK) {
        status = prove_end(at, 8, FSN_OUTPUT, bits);
    }
    if (status != FSN_OK) {
        return status;
    }
    if (!fsn_string_ok(plan, r + 20)) {
        return fsn_no(at, FSN_E_PLAN_STRING, 20, "the net's name lies outside the strings");
    }
    if (kind != FSN_COPY_FSOE && kind != FSN_COPY_STANDARD) {
        return fsn_no(at, FSN_E_PLAN_VALUE, 24, "the kind of the copy is unknown");
    }
    if (fsn_get16(r + 26) != 0) {
        return fsn_no(at, FSN_E_PLAN_RESERVED, 26, "a reserved field of the copy is not zero");
    }
    const uint32_t connection = fsn_get32(r + 28);
    const bool known = connection < plan->count[FSN_SEC_CONNECTION];
    if (kind == FSN_COPY_FSOE ? !known : connection != FSN_NONE) {
        return fsn_no(at, FSN_E_COPY_PAIR, 28,
                      "an FSoE copy names its connection, a standard copy none");
    }
    return prove_copy_frame(at);
}

static fsn_status prove_copies(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct fsn_at at = {plan, fault, FSN_SEC_COPY, 0};
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
            return fsn_no(
                &at, FSN_E_COPY_OVERLAP, 8,
                "two copies write the same byte, or copies are not sorted by destination");
        }
        last_sm = sm;
        last_end = bit + fsn_get32(r + 16);
    }
    return FSN_OK;
}

/** One direction of a connection: an FSoE copy of its own, between the right SubDevices. */
static fsn_status prove_direction(const struct fsn_at *at, uint32_t field, uint32_t from,
                                  uint32_t to, uint32_t safe_bytes) {
    const struct fsn_plan *plan = at->plan;
    const uint8_t *r = fsn_record(plan, at->section, at->number);
    const uint32_t copy = fsn_get32(r + field);
    if (copy >= plan->count[FSN_SEC_COPY]) {
        return fsn_no(at, FSN_E_PLAN_REFERENCE, field, "the connection's copy does not exist");
    }
    const uint8_t *c = fsn_record(plan, FSN_SEC_COPY, copy);
    const uint32_t source = fsn_get32(fsn_record(plan, FSN_SEC_SM, fsn_get32(c)));
    const uint32_t target = fsn_get32(fsn_record(plan, FSN_SEC_SM, fsn_get32(c + 8)));
    if (fsn_get16(c + 24) != FSN_COPY_FSOE || fsn_get32(c + 28) != at->number || source != from ||
        target != to) {
        return fsn_no(at, FSN_E_COPY_PAIR, field,
                      "the copy is not this connection's FSoE copy between its two SubDevices");
    }
    if (safe_bytes_of(fsn_get32(c + 16) / 8) != safe_bytes) {
        return fsn_no(at, FSN_E_PLAN_VALUE, field,
                      "the safe data do not match the length of the copy");
    }
    return FSN_OK;
}

static fsn_status prove_connections(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct fsn_at at = {plan, fault, FSN_SEC_CONNECTION, 0};
    for (; at.number < plan->count[FSN_SEC_CONNECTION]; at.number++) {
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        const uint32_t main_sub = fsn_get32(r + 8);
        const uint32_t sub = fsn_get32(r + 12);
        if (!fsn_string_ok(plan, r) || !fsn_string_ok(plan, r + 4)) {
            return fsn_no(&at, FSN_E_PLAN_STRING, 0, "a name lies outside the strings");
        }
        if (main_sub == sub) {
            return fsn_no(&at, FSN_E_COPY_PAIR, 8, "main and sub are the same SubDevice");
        }
        if (fsn_get16(r + 30) > 7 || fsn_get32(r + 36) != 0) {
            return fsn_no(&at, FSN_E_PLAN_RESERVED, 30,
                          "a flag of the connection is unknown or its reserved field is not zero");
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
    struct fsn_at at = {plan, fault, FSN_SEC_COPY, 0};
    for (; at.number < plan->count[FSN_SEC_COPY]; at.number++) {
        const uint8_t *r = fsn_record(plan, at.section, at.number);
        if (fsn_get16(r + 24) != FSN_COPY_FSOE) {
            continue;
        }
        const uint8_t *c = fsn_record(plan, FSN_SEC_CONNECTION, fsn_get32(r + 28));
        if (fsn_get32(c + 16) != at.number && fsn_get32(c + 20) != at.number) {
            return fsn_no(&at, FSN_E_COPY_PAIR, 28,
                          "the connection does not name this copy as one of its two");
        }
    }
    return FSN_OK;
}

fsn_status fsn_prove_copies(const struct fsn_plan *plan, struct fsn_fault *fault) {
    typedef fsn_status (*proof)(const struct fsn_plan *, struct fsn_fault *);
    static const proof proofs[] = {prove_blocks, prove_symbols, prove_copies, prove_connections,
                                   prove_owners};
    fsn_status status = FSN_OK;
    for (size_t i = 0; i < sizeof proofs / sizeof proofs[0] && status == FSN_OK; i++) {
        status = proofs[i](plan, fault);
    }
    return status;
}
