/** The proofs of docs/reference/plan-format.md, “What a reader proves again”, second half: the data
 *  copied between the SubDevices. Blocks and copies are sorted, so every overlap is found at a
 *  neighbour or by bisection: O(n log n) for any file. */
#include <string.h>

#include "fsn/fsoe.h"
#include "plan/plan_internal.h"

enum { MOST_APP_BYTES = 4096 };

static uint32_t safe_bytes_of(uint32_t frame_bytes) {
    return frame_bytes == 6 ? 1 : (frame_bytes - 3) / 2;
}

static fsn_status prove_blocks(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct fsn_at at = {plan, fault, FSN_SEC_BLOCK, 0};
    uint32_t last_sm = 0;
    uint32_t last_end = 0;
    for (; at.number < plan->count[FSN_SEC_BLOCK]; at.number++) {
        const struct fsn_block_record r = fsn_read_block(plan, at.number);
        if (r.sm >= plan->count[FSN_SEC_SM]) {
            return fsn_refuse_at(&at, FSN_E_PLAN_REFERENCE, FSN_AT(block, sm),
                                 "the block's sync manager does not exist");
        }
        /* The lengths of ETG.5100: no end would accept a frame with another length. */
        if (!fsn_fsoe_is_frame_length(r.frame_bytes) ||
            r.safe_bytes != safe_bytes_of(r.frame_bytes)) {
            return fsn_refuse_at(
                &at, FSN_E_PLAN_VALUE, FSN_AT(block, frame_bytes),
                "an FSoE frame has 6 bytes or 3 + 4 k up to 255, and safe data to match");
        }
        const uint32_t size = fsn_read_sm(plan, r.sm).bits / 8; /* whole bytes only */
        if (r.byte_offset > size || r.frame_bytes > size - r.byte_offset) {
            return fsn_refuse_at(&at, FSN_E_COPY_RANGE, FSN_AT(block, byte_offset),
                                 "the block ends after its sync manager");
        }
        /* Sorted blocks need one comparison each, and other rules search them by bisection. */
        if (at.number > 0 && (r.sm < last_sm || (r.sm == last_sm && r.byte_offset < last_end))) {
            return fsn_refuse_at(&at, FSN_E_COPY_OVERLAP, FSN_AT(block, byte_offset),
                                 "blocks overlap or are not sorted by sync manager and offset");
        }
        if (r.copied > 1) {
            return fsn_refuse_at(&at, FSN_E_PLAN_RESERVED, FSN_AT(block, copied),
                                 "a flag of the block is unknown");
        }
        last_sm = r.sm;
        last_end = r.byte_offset + r.frame_bytes;
    }
    return FSN_OK;
}

/** First block that ends after `byte` of an SM, in the sorted list of blocks; count if there is
 *  none. */
static uint32_t first_block_behind(const struct fsn_plan *plan, uint32_t sm, uint32_t byte) {
    uint32_t low = 0;
    uint32_t high = plan->count[FSN_SEC_BLOCK];
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        const struct fsn_block_record r = fsn_read_block(plan, middle);
        const uint32_t end = r.byte_offset + r.frame_bytes;
        if (r.sm < sm || (r.sm == sm && end <= byte)) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

enum fsn_overlap fsn_overlap_of(const struct fsn_plan *plan, uint32_t sm, uint32_t byte,
                                uint32_t size) {
    const uint32_t number = first_block_behind(plan, sm, byte);
    if (number >= plan->count[FSN_SEC_BLOCK]) {
        return FSN_OVERLAP_NONE;
    }
    const struct fsn_block_record r = fsn_read_block(plan, number);
    if (r.sm != sm || r.byte_offset >= byte + size) {
        return FSN_OVERLAP_NONE;
    }
    return r.byte_offset == byte && r.frame_bytes == size ? FSN_OVERLAP_EXACT : FSN_OVERLAP_PART;
}

bool fsn_is_copied(const struct fsn_plan *plan, const struct fsn_symbol_info *symbol) {
    const uint32_t first = symbol->bit_offset / 8;
    const uint32_t behind = (symbol->bit_offset + symbol->bits + 7) / 8;
    uint32_t low = 0; /* sorted: the first copy that ends after the first byte of the symbol */
    uint32_t high = plan->count[FSN_SEC_COPY];
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        const struct fsn_copy_record r = fsn_read_copy(plan, middle);
        const uint32_t sm = r.destination_sm;
        const uint32_t end = (r.destination_bit + r.bits) / 8;
        if (sm < symbol->sm || (sm == symbol->sm && end <= first)) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    if (low >= plan->count[FSN_SEC_COPY]) {
        return false;
    }
    const struct fsn_copy_record r = fsn_read_copy(plan, low);
    return r.destination_sm == symbol->sm && r.destination_bit / 8 < behind;
}

/** Checks stop values of symbols: only bits of an output itself, and none that could start a
 *  machine. */
static bool is_stop_value_ok(const struct fsn_symbol_record *symbol) {
    const uint64_t value = symbol->stop_value;
    const bool closed = (symbol->flags & 1u) == 0 || (symbol->flags & 2u) != 0;
    return value == 0 || (!closed && (symbol->bits == 64 || value >> symbol->bits == 0));
}

/** Finite, by its bits: the bytes read here may not be a number. */
static bool is_scale_ok(const struct fsn_symbol_record *symbol) {
    return (symbol->factor << 1) != 0 && ((symbol->factor >> 52) & 0x7FFu) != 0x7FFu &&
           ((symbol->offset >> 52) & 0x7FFu) != 0x7FFu;
}

static fsn_status prove_symbols(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct fsn_at at = {plan, fault, FSN_SEC_SYMBOL, 0};
    for (; at.number < plan->count[FSN_SEC_SYMBOL]; at.number++) {
        const struct fsn_symbol_record r = fsn_read_symbol(plan, at.number);
        if (!fsn_string_ok(plan, r.name)) {
            return fsn_refuse_at(&at, FSN_E_PLAN_STRING, FSN_AT(symbol, name),
                                 "the name lies outside the strings");
        }
        if (r.sm >= plan->count[FSN_SEC_SM]) {
            return fsn_refuse_at(&at, FSN_E_PLAN_REFERENCE, FSN_AT(symbol, sm),
                                 "the symbol's sync manager does not exist");
        }
        /* Unknown flags belong to a newer format, whose meaning this version would miss. */
        if (r.flags > 3 || r.reserved != 0) {
            return fsn_refuse_at(
                &at, FSN_E_PLAN_RESERVED, FSN_AT(symbol, flags),
                "a flag of the symbol is unknown or its reserved field is not zero");
        }
        const struct fsn_sm_record sm = fsn_read_sm(plan, r.sm);
        if (r.bits == 0 || r.bits > 64 || r.kind > 4 ||
            (r.flags & 1u) != (sm.direction == FSN_OUTPUT)) {
            return fsn_refuse_at(
                &at, FSN_E_PLAN_VALUE, FSN_AT(symbol, bits),
                "a symbol has 1 to 64 bits, a known type and the direction of its sync manager");
        }
        /* Subtracted, not added, because the sum of two 32-bit numbers can overflow. */
        if (r.bit_offset > sm.bits || r.bits > sm.bits - r.bit_offset) {
            return fsn_refuse_at(&at, FSN_E_COPY_RANGE, FSN_AT(symbol, bit_offset),
                                 "the symbol ends after its sync manager");
        }
        if (!is_stop_value_ok(&r)) {
            return fsn_refuse_at(
                &at, FSN_E_PLAN_VALUE, FSN_AT(symbol, stop_value),
                "a stop value has the bits of its output, and is 0 for an input and for "
                "what is restart relevant");
        }
        if (!is_scale_ok(&r)) {
            return fsn_refuse_at(&at, FSN_E_PLAN_VALUE, FSN_AT(symbol, factor),
                                 "factor and offset are finite numbers, and the factor is not 0");
        }
        /* A value across a byte border uses both bytes. */
        const uint32_t first = r.bit_offset / 8;
        const uint32_t last = (r.bit_offset + r.bits - 1) / 8;
        if (fsn_overlap_of(plan, r.sm, first, last - first + 1) != FSN_OVERLAP_NONE) {
            return fsn_refuse_at(&at, FSN_E_COPY_FRAME, FSN_AT(symbol, bit_offset),
                                 "a symbol must not touch an FSoE block");
        }
    }
    return FSN_OK;
}

/** One end of a copy, with the first bytes of its fields. */
struct end {
    uint32_t sm, bit, at_sm, at_bit;
};

static struct end source_of(const struct fsn_copy_record *copy) {
    return (struct end){copy->source_sm, copy->source_bit, FSN_AT(copy, source_sm),
                        FSN_AT(copy, source_bit)};
}

static struct end destination_of(const struct fsn_copy_record *copy) {
    return (struct end){copy->destination_sm, copy->destination_bit, FSN_AT(copy, destination_sm),
                        FSN_AT(copy, destination_bit)};
}

/** Proves that it is a registered SM of the correct direction, and whole bytes inside it. */
static fsn_status prove_end(const struct fsn_at *at, const struct end end, uint8_t direction,
                            uint32_t bits) {
    if (end.sm >= at->plan->count[FSN_SEC_SM]) {
        return fsn_refuse_at(at, FSN_E_PLAN_REFERENCE, end.at_sm,
                             "the copy's sync manager does not exist");
    }
    const struct fsn_sm_record sm = fsn_read_sm(at->plan, end.sm);
    if (sm.direction != direction || sm.registered != 1) {
        return fsn_refuse_at(at, FSN_E_COPY_DIRECTION, end.at_sm,
                             "a copy reads a registered input and writes a registered output");
    }
    if (end.bit % 8 != 0) {
        return fsn_refuse_at(at, FSN_E_COPY_ALIGN, end.at_bit, "a copy starts on a byte");
    }
    if (end.bit > sm.bits || bits > sm.bits - end.bit) {
        return fsn_refuse_at(at, FSN_E_COPY_RANGE, end.at_bit,
                             "the copy ends after its sync manager");
    }
    return FSN_OK;
}

static fsn_status prove_copy_frame(const struct fsn_at *at, const struct fsn_copy_record *copy) {
    const uint32_t size = copy->bits / 8;
    const bool fsoe = copy->kind == FSN_COPY_FSOE;
    if (fsoe && !fsn_fsoe_is_frame_length(size)) {
        return fsn_refuse_at(at, FSN_E_COPY_FRAME, FSN_AT(copy, bits),
                             "no FSoE frame has this length");
    }
    const struct end ends[] = {source_of(copy), destination_of(copy)};
    for (size_t i = 0; i < 2; i++) {
        const enum fsn_overlap overlap =
            fsn_overlap_of(at->plan, ends[i].sm, ends[i].bit / 8, size);
        if (overlap == FSN_OVERLAP_PART || (overlap == FSN_OVERLAP_EXACT && !fsoe)) {
            return fsn_refuse_at(at, FSN_E_COPY_FRAME, ends[i].at_sm,
                                 "a copy must cover a whole FSoE block as an FSoE copy, or none");
        }
    }
    return FSN_OK;
}

static fsn_status prove_one_copy(const struct fsn_at *at) {
    const struct fsn_plan *plan = at->plan;
    const struct fsn_copy_record r = fsn_read_copy(plan, at->number);
    if (r.bits == 0 || r.bits % 8 != 0) {
        return fsn_refuse_at(at, FSN_E_COPY_ALIGN, FSN_AT(copy, bits),
                             "a copy has at least one whole byte");
    }
    FSN_TRY(prove_end(at, source_of(&r), FSN_INPUT, r.bits));
    FSN_TRY(prove_end(at, destination_of(&r), FSN_OUTPUT, r.bits));
    if (!fsn_string_ok(plan, r.net)) {
        return fsn_refuse_at(at, FSN_E_PLAN_STRING, FSN_AT(copy, net),
                             "the net's name lies outside the strings");
    }
    if (r.kind != FSN_COPY_FSOE && r.kind != FSN_COPY_STANDARD) {
        return fsn_refuse_at(at, FSN_E_PLAN_VALUE, FSN_AT(copy, kind),
                             "the kind of the copy is unknown");
    }
    if (r.reserved != 0) {
        return fsn_refuse_at(at, FSN_E_PLAN_RESERVED, FSN_AT(copy, reserved),
                             "a reserved field of the copy is not zero");
    }
    const bool known = r.connection < plan->count[FSN_SEC_CONNECTION];
    if (r.kind == FSN_COPY_FSOE ? !known : r.connection != FSN_NONE) {
        return fsn_refuse_at(at, FSN_E_COPY_PAIR, FSN_AT(copy, connection),
                             "an FSoE copy names its connection, a standard copy none");
    }
    return prove_copy_frame(at, &r);
}

static fsn_status prove_copies(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct fsn_at at = {plan, fault, FSN_SEC_COPY, 0};
    uint32_t last_sm = 0;
    uint32_t last_end = 0;
    for (; at.number < plan->count[FSN_SEC_COPY]; at.number++) {
        FSN_TRY(prove_one_copy(&at));
        const struct fsn_copy_record r = fsn_read_copy(plan, at.number);
        const uint32_t sm = r.destination_sm;
        const uint32_t bit = r.destination_bit;
        if (at.number > 0 && (sm < last_sm || (sm == last_sm && bit < last_end))) {
            return fsn_refuse_at(
                &at, FSN_E_COPY_OVERLAP, FSN_AT(copy, destination_sm),
                "two copies write the same byte, or copies are not sorted by destination");
        }
        last_sm = sm;
        last_end = bit + r.bits;
    }
    return FSN_OK;
}

/** Proves one direction of a connection: a separate FSoE copy between the correct SubDevices.
 *  @param[in] field  first byte of the field with the number of the copy. */
static fsn_status prove_direction(const struct fsn_at *at, uint32_t field, uint32_t number,
                                  uint32_t from, uint32_t to, uint32_t safe_bytes) {
    const struct fsn_plan *plan = at->plan;
    if (number >= plan->count[FSN_SEC_COPY]) {
        return fsn_refuse_at(at, FSN_E_PLAN_REFERENCE, field,
                             "the connection's copy does not exist");
    }
    const struct fsn_copy_record copy = fsn_read_copy(plan, number);
    if (copy.kind != FSN_COPY_FSOE || copy.connection != at->number ||
        fsn_read_sm(plan, copy.source_sm).subdevice != from ||
        fsn_read_sm(plan, copy.destination_sm).subdevice != to) {
        return fsn_refuse_at(
            at, FSN_E_COPY_PAIR, field,
            "the copy is not this connection's FSoE copy between its two SubDevices");
    }
    if (safe_bytes_of(copy.bits / 8) != safe_bytes) {
        return fsn_refuse_at(at, FSN_E_PLAN_VALUE, field,
                             "the safe data do not match the length of the copy");
    }
    return FSN_OK;
}

/** Checks application parameters. A longer list would make a hostile plan slow to prove. */
static bool are_hex_pairs(const char *digits) {
    const size_t count = strspn(digits, "0123456789abcdef");
    return digits[count] == 0 && count % 2 == 0 && count / 2 <= MOST_APP_BYTES;
}

static fsn_status prove_connections(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct fsn_at at = {plan, fault, FSN_SEC_CONNECTION, 0};
    for (; at.number < plan->count[FSN_SEC_CONNECTION]; at.number++) {
        const struct fsn_connection_record r = fsn_read_connection(plan, at.number);
        if (!fsn_string_ok(plan, r.name) || !fsn_string_ok(plan, r.net)) {
            return fsn_refuse_at(&at, FSN_E_PLAN_STRING, FSN_AT(connection, name),
                                 "a name lies outside the strings");
        }
        if (r.main == r.sub) {
            return fsn_refuse_at(&at, FSN_E_COPY_PAIR, FSN_AT(connection, main),
                                 "main and sub are the same SubDevice");
        }
        if (r.known > 7) {
            return fsn_refuse_at(&at, FSN_E_PLAN_RESERVED, FSN_AT(connection, known),
                                 "a flag of the connection is unknown");
        }
        if (!fsn_string_ok(plan, r.app_parameters) ||
            !are_hex_pairs(fsn_string(plan, r.app_parameters))) {
            return fsn_refuse_at(&at, FSN_E_PLAN_STRING, FSN_AT(connection, app_parameters),
                                 "the application parameters are not pairs of hex digits");
        }
        FSN_TRY(prove_direction(&at, FSN_AT(connection, copy_to_sub), r.copy_to_sub, r.main, r.sub,
                                r.safe_to_sub));
        FSN_TRY(prove_direction(&at, FSN_AT(connection, copy_to_main), r.copy_to_main, r.sub,
                                r.main, r.safe_to_main));
    }
    return FSN_OK;
}

/** Proves that each FSoE copy is one of the two of the connection that it names. */
static fsn_status prove_owners(const struct fsn_plan *plan, struct fsn_fault *fault) {
    struct fsn_at at = {plan, fault, FSN_SEC_COPY, 0};
    for (; at.number < plan->count[FSN_SEC_COPY]; at.number++) {
        const struct fsn_copy_record copy = fsn_read_copy(plan, at.number);
        if (copy.kind != FSN_COPY_FSOE) {
            continue;
        }
        const struct fsn_connection_record c = fsn_read_connection(plan, copy.connection);
        if (c.copy_to_sub != at.number && c.copy_to_main != at.number) {
            return fsn_refuse_at(&at, FSN_E_COPY_PAIR, FSN_AT(copy, connection),
                                 "the connection does not name this copy as one of its two");
        }
    }
    return FSN_OK;
}

fsn_status fsn_prove_copies(const struct fsn_plan *plan, struct fsn_fault *fault) {
    typedef fsn_status (*proof)(const struct fsn_plan *, struct fsn_fault *);
    static const proof proofs[] = {prove_blocks, prove_symbols, prove_copies, prove_connections,
                                   prove_owners};
    for (size_t i = 0; i < sizeof proofs / sizeof proofs[0]; i++) {
        FSN_TRY(proofs[i](plan, fault));
    }
    return FSN_OK;
}
