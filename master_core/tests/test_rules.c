/** The loader's rules for SDOs, symbols, FSoE blocks and the bytes that copies may use; every byte
 *  of a plan changed, one at a time; and a large plan, which must load in milliseconds. */
/* shows R2 */
#define _POSIX_C_SOURCE 200809L

#include <string.h>
#include <time.h>

#include "builder.h"
#include "fsn/fsn.h"
#include "plan/plan_internal.h"
#include "rules_of_fields.h"

/** One broken rule: position, written bytes, expected fault, and the named record. */
struct broken {
    uint32_t section, record, field, bytes, value;
    fsn_status status;
    uint32_t named;
    const char *says;
};

static const struct broken broken_rules[] = {
    {5, 0, 3, 1, 3, FSN_E_PLAN_VALUE, 0, "an SDO has 1, 2, 4 or 8 bytes"},
    {5, 0, 4, 4, 1, FSN_E_PLAN_RESERVED, 0, "a reserved field of the SDO is not zero"},
    {6, 1, 0, 4, 4, FSN_E_PLAN_STRING, 1, "the name lies outside the strings"},
    {6, 1, 4, 4, 4, FSN_E_PLAN_REFERENCE, 1, "the symbol's sync manager does not exist"},
    {6, 0, 4, 4, 1, FSN_E_PLAN_VALUE, 0,
     "a symbol has 1 to 64 bits, a known type and the direction of its sync manager"}, /* an output
                                                                                          symbol in
                                                                                          an input
                                                                                        */
    {6, 0, 8, 4, 65, FSN_E_COPY_RANGE, 0, "the symbol ends after its sync manager"},
    {6, 0, 8, 4, 0xFFFFFFF8u, FSN_E_COPY_RANGE, 0, "the symbol ends after its sync manager"},
    {6, 0, 8, 4, 47, FSN_E_COPY_FRAME, 0,
     "a symbol must not touch an FSoE block"}, /* last bit of the frame */
    {6, 0, 12, 2, 0, FSN_E_PLAN_VALUE, 0,
     "a symbol has 1 to 64 bits, a known type and the direction of its sync manager"},
    {6, 0, 12, 2, 65, FSN_E_PLAN_VALUE, 0,
     "a symbol has 1 to 64 bits, a known type and the direction of its sync manager"},
    {6, 0, 14, 1, 5, FSN_E_PLAN_VALUE, 0,
     "a symbol has 1 to 64 bits, a known type and the direction of its sync manager"},
    {6, 0, 15, 1, 4, FSN_E_PLAN_RESERVED, 0,
     "a flag of the symbol is unknown or its reserved field is not zero"},
    {6, 1, 16, 4, 1, FSN_E_PLAN_RESERVED, 1,
     "a flag of the symbol is unknown or its reserved field is not zero"},
    {7, 1, 0, 4, 4, FSN_E_PLAN_REFERENCE, 1, "the block's sync manager does not exist"},
    {7, 1, 0, 4, 0, FSN_E_COPY_OVERLAP, 1,
     "blocks overlap or are not sorted by sync manager and offset"}, /* two blocks at one place */
    {7, 0, 4, 4, 4, FSN_E_COPY_RANGE, 0, "the block ends after its sync manager"},
    {7, 0, 4, 4, 0xFFFFFFFFu, FSN_E_COPY_RANGE, 0, "the block ends after its sync manager"},
    {7, 0, 4, 4, 1, FSN_E_COPY_FRAME, 0,
     "a symbol must not touch an FSoE block"}, /* block moved: symbol 0 or copy 0 cuts it */
    {7, 0, 8, 2, 8, FSN_E_PLAN_VALUE, 0,
     "an FSoE frame has 6 bytes or 3 + 4 k up to 255, and safe data to match"},
    {7, 0, 8, 2, 7, FSN_E_PLAN_VALUE, 0,
     "an FSoE frame has 6 bytes or 3 + 4 k up to 255, and safe data to match"}, /* 7 bytes carry 2
                                                                                   safe ones, not 1
                                                                                 */
    {7, 0, 12, 4, 2, FSN_E_PLAN_RESERVED, 0, "a flag of the block is unknown"},
    {8, 0, 4, 4, 8, FSN_E_COPY_FRAME, 0,
     "a copy must cover a whole FSoE block as an FSoE copy, or none"}, /* reads a part of a block */
    {8, 0, 12, 4, 8, FSN_E_COPY_FRAME, 0,
     "a copy must cover a whole FSoE block as an FSoE copy, or none"}, /* writes a part of a block
                                                                        */
    {8, 1, 12, 4, 16, FSN_E_COPY_FRAME, 1,
     "a copy must cover a whole FSoE block as an FSoE copy, or none"},
};

static fsn_status load_and_run(const uint8_t *bytes, size_t len, struct fsn_fault *fault) {
    struct fsn_plan *plan = NULL;
    const fsn_status status = fsn_plan_load(bytes, len, &plan, fault);
    CHECK((status == FSN_OK) == (plan != NULL));
    if (status != FSN_OK) {
        return status;
    }
    struct fsn_emulated *bus;
    struct fsn_core *core;
    struct fsn_fault second;
    CHECK(fsn_emulated_create(plan, &bus) == FSN_OK);
    CHECK(fsn_core_create(plan, fsn_emulated_ops(), bus, &core, &second) == FSN_OK);
    CHECK(fsn_core_cycle(core, 1) == FSN_OK);
    /* Freed in the order that hurts most without reference counts. */
    fsn_plan_free(plan);
    fsn_emulated_free(bus);
    CHECK(fsn_core_cycle(core, 2) == FSN_OK);
    fsn_core_free(core);
    return FSN_OK;
}

static uint8_t *field_of(uint8_t *bytes, const struct broken *rule) {
    const uint32_t start = fsn_get32(bytes + 32 + 16 * (rule->section - 1) + 4);
    return bytes + start + rule->record * fsn_record_bytes[rule->section] + rule->field;
}

static void each_broken_rule_is_named(void) {
    for (size_t i = 0; i < sizeof broken_rules / sizeof broken_rules[0]; i++) {
        const struct broken *rule = &broken_rules[i];
        size_t len;
        uint8_t *bytes = build_full(&len);
        CHECK(load_and_run(bytes, len, NULL) == FSN_OK);
        uint8_t *field = field_of(bytes, rule);
        for (uint32_t b = 0; b < rule->bytes; b++) {
            field[b] = (uint8_t)(rule->value >> (8 * b));
        }
        build_fix_crc(bytes, len);
        struct fsn_fault fault;
        const fsn_status status = load_and_run(bytes, len, &fault);
        if (status != rule->status) {
            fprintf(stderr, "rule %zu (section %u field %u): %s\n", i, rule->section, rule->field,
                    fsn_status_name(status));
        }
        CHECK(status == rule->status && fault.status == status);
        CHECK(fault.copy_index == rule->named && strcmp(fault.rule, rule->says) == 0);
        free(bytes);
    }
}

/** Two connections of different frames, a standard copy, symbols of several sizes, SDOs. */
static uint8_t *build_rich(size_t *len) {
    static const struct build_sm sm[3][2] = {
        {{1, 30}, {2, 30}}, {{1, 12}, {2, 12}}, {{1, 12}, {2, 12}}};
    static const struct build_copy copies[] = {
        {0, 0, 1, 0, 6}, {1, 0, 0, 0, 7}, {0, 6, 2, 0, 11}, {2, 0, 0, 7, 6}, {1, 8, 2, 11, 1}};
    static const struct build_symbol symbols[] = {
        {.sm = 0, .bit_offset = 104, .bits = 64, .stop_value = UINT64_MAX},
        {.sm = 0, .bit_offset = 168, .bits = 63, .stop_value = 1},
        {.sm = 3, .bit_offset = 64, .bits = 16, .kind = 2},
        {.sm = 0, .bit_offset = 231, .bits = 9, .restart_relevant = 1}};
    static const struct build_block blocks[] = {{0, 0, 7}, {0, 7, 6}, {1, 0, 6},  {1, 6, 11},
                                                {2, 0, 6}, {3, 0, 7}, {4, 0, 11}, {5, 0, 6}};
    const struct build build = {.subdevices = 3,
                                .sm = sm,
                                .copies = copies,
                                .pairs = 2,
                                .standard = 1,
                                .cycle_ns = 1000000,
                                .symbols = symbols,
                                .blocks = blocks,
                                .symbol_count = 4,
                                .block_count = 8,
                                .sdo_count = 2};
    return build_plan(&build, len);
}

/** Bytes of the fields of a record, by section. */
static const char *const fields_of[] = {NULL,
                                        "422444444442"
                                        "24",
                                        "411114444",
                                        "22444",
                                        "2112114",
                                        "21148",
                                        "444211"
                                        "4888",
                                        "44224",
                                        "4444442"
                                        "24",
                                        "444444"
                                        "222222"
                                        "4"};

/** Records that represent others of the same kind. */
static bool is_tried(uint32_t section, uint32_t record) {
    static const uint32_t tried[] = {0,    1u << 1, 1u << 0 | 1u << 5, 1u << 5, 1, 1, 0xF, 0x83,
                                     0x1F, 3};
    return record < 32 && (tried[section] >> record & 1u) != 0;
}

/** Effect of a change of one field: fault and position in its record, "." if it is still a plan. */
static void say(char *text, size_t room, uint8_t *bytes, size_t len, uint8_t *field, size_t width,
                uint64_t value) {
    uint8_t kept[8];
    struct fsn_fault fault;
    memcpy(kept, field, width);
    for (size_t i = 0; i < width; i++) {
        field[i] = (uint8_t)(value >> (8 * i));
    }
    build_fix_crc(bytes, len);
    const fsn_status status = load_and_run(bytes, len, &fault);
    const size_t used = strlen(text);
    if (status == FSN_OK) {
        snprintf(text + used, room - used, " .");
    } else {
        const uint32_t start = fsn_get32(bytes + 32 + 16 * (fault.section - 1) + 4);
        const bool whole = fault.copy_index == FSN_FAULT_NO_RECORD;
        const uint32_t at =
            fault.byte - start - (whole ? 0 : fault.copy_index * fsn_record_bytes[fault.section]);
        snprintf(text + used, room - used, " %s@%u.%d+%u",
                 strrchr(fsn_status_name(status), '_') + 1, fault.section, (int)fault.copy_index,
                 at);
    }
    memcpy(field, kept, width);
}

/** Every field of every record: one less, one more, eight less, eight more, 0, all bits set. */
static void every_field_has_its_rule(void) {
    size_t len;
    uint8_t *bytes = build_rich(&len);
    CHECK(load_and_run(bytes, len, NULL) == FSN_OK);
    size_t row = 0;
    for (uint32_t section = 1; section <= 9; section++) {
        const uint32_t start = fsn_get32(bytes + 32 + 16 * (section - 1) + 4);
        const uint32_t count = fsn_get32(bytes + 32 + 16 * (section - 1) + 8);
        for (uint32_t record = 0; record < count; record++) {
            uint8_t *at = bytes + start + record * fsn_record_bytes[section];
            if (!is_tried(section, record)) {
                continue;
            }
            for (const char *width = fields_of[section]; *width != 0; width++) {
                const size_t size = (size_t)(*width - '0');
                const uint64_t value = fsn_read_bits(at, 0, (uint32_t)(8 * size));
                char text[400];
                snprintf(text, sizeof text, "%u.%u+%u:", section, record,
                         (unsigned)(at - bytes) - start - record * fsn_record_bytes[section]);
                const uint64_t values[] = {value - 1, value + 1, value - 8,
                                           value + 8, 0,         UINT64_MAX};
                for (size_t i = 0; i < sizeof values / sizeof values[0]; i++) {
                    say(text, sizeof text, bytes, len, at, size, values[i]);
                }
                const char *expected = row < sizeof rules_of_fields / sizeof rules_of_fields[0]
                                           ? rules_of_fields[row]
                                           : "nothing";
                if (strcmp(text, expected) != 0) {
                    fprintf(stderr, "said     %s\nexpected %s\n", text, expected);
                    exit(1);
                }
                row++;
                at += size;
            }
        }
    }
    CHECK(row == sizeof rules_of_fields / sizeof rules_of_fields[0]);
    free(bytes);
}

/** A plan with one changed byte and a correct CRC is refused, or is a plan that can be run. */
static void every_byte_may_lie(void) {
    size_t len;
    uint8_t *bytes = build_full(&len);
    unsigned refused = 0;
    unsigned accepted = 0;
    for (size_t at = 0; at < len; at++) {
        const uint8_t before = bytes[at];
        static const uint8_t flips[] = {0x01, 0x80, 0xFF, 0x04, 0x10};
        for (size_t f = 0; f < sizeof flips; f++) {
            bytes[at] = before ^ flips[f];
            build_fix_crc(bytes, len);
            const fsn_status status = load_and_run(bytes, len, NULL);
            refused += status != FSN_OK;
            accepted += status == FSN_OK;
            CHECK(at < 20 || at >= 24 || status == FSN_OK); /* the cycle time is free */
        }
        bytes[at] = before;
    }
    printf("%u changed plans refused, %u still plans\n", refused, accepted);
    CHECK(refused > accepted);
    free(bytes);
}

/** A bit that is left over in the last byte of a sync manager belongs to no copy. */
static void copy_ends_inside_the_bits(void) {
    size_t len;
    uint8_t *bytes = build_estop(&len);
    struct fsn_fault fault;
    /* The inputs of the sub have 8 bytes: with 4 bits less, the last byte is not whole any longer.
     */
    uint8_t *sm = field_of(bytes, &(struct broken){.section = 2, .record = 3, .field = 8});
    CHECK(sm[0] == 64);
    sm[0] = 60;
    uint8_t *entry = field_of(bytes, &(struct broken){.section = 4, .record = 32, .field = 4});
    CHECK(entry[0] == 8);
    entry[0] = 4;
    uint8_t *copy = field_of(bytes, &(struct broken){.section = 8, .record = 0, .field = 4});
    copy[0] = 8;
    build_fix_crc(bytes, len);
    CHECK(load_and_run(bytes, len, NULL) == FSN_OK);
    copy[0] = 16;
    build_fix_crc(bytes, len);
    CHECK(load_and_run(bytes, len, &fault) == FSN_E_COPY_RANGE);
    CHECK(fault.section == 8 && fault.copy_index == 0);
    free(bytes);
}

static double now_ms(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/** 5 000 SubDevices and 4 000 copies: one main is connected to every second of the others. */
static void large_plan_loads_quickly(void) {
    enum { SUBS = 5000, PAIRS = 2000 };
    static struct build_sm sm[SUBS][2];
    static struct build_copy copies[2 * PAIRS];
    for (uint32_t i = 0; i < SUBS; i++) {
        sm[i][0] = (struct build_sm){1, 12};
        sm[i][1] = (struct build_sm){2, 12};
    }
    for (uint32_t i = 0; i < PAIRS; i++) {
        copies[2 * i] = (struct build_copy){2 * i, 0, 2 * i + 1, 0, 6};
        copies[2 * i + 1] = (struct build_copy){2 * i + 1, 0, 2 * i, 0, 6};
    }
    const struct build build = {.subdevices = SUBS,
                                .sm = (const struct build_sm(*)[2])sm,
                                .copies = copies,
                                .pairs = PAIRS};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct fsn_plan *plan;
    struct fsn_emulated *bus;
    struct fsn_core *core;
    const double start = now_ms();
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    const double loaded = now_ms();
    CHECK(fsn_emulated_create(plan, &bus) == FSN_OK);
    CHECK(fsn_core_create(plan, fsn_emulated_ops(), bus, &core, NULL) == FSN_OK);
    const double active = now_ms();
    CHECK(fsn_core_cycle(core, 1) == FSN_OK);
    printf("%zu bytes, %u copies: loaded in %.1f ms, active after %.1f ms more\n", len,
           fsn_plan_copy_count(plan), loaded - start, active - loaded);
    fsn_core_free(core);
    fsn_emulated_free(bus);
    fsn_plan_free(plan);
    free(bytes);
}

int main(void) {
    each_broken_rule_is_named();
    every_field_has_its_rule();
    every_byte_may_lie();
    copy_ends_inside_the_bits();
    large_plan_loads_quickly();
    return 0;
}
