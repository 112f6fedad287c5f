/** The loader against tables of which one rule is broken. */
/* shows R2 */
#include "broken.h"
#include "heap.h"

static void good_plan_is_decoded(void) {
    size_t len;
    uint8_t *bytes = build_estop(&len);
    struct fsn_plan *plan;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    memset(bytes, 0xEE, len); /* the plan has its own copy */
    free(bytes);
    CHECK(fsn_plan_cycle_ns(plan) == 1000000);
    CHECK(fsn_plan_subdevice_count(plan) == 2 && fsn_plan_copy_count(plan) == 2);
    struct fsn_copy_info copy;
    CHECK(fsn_plan_copy(plan, 0, &copy) == FSN_OK);
    CHECK(copy.source_sm == 3 && copy.destination_sm == 0 && copy.size_bytes == 6);
    struct fsn_connection_info connection;
    CHECK(fsn_plan_connection(plan, 0, &connection) == FSN_OK);
    CHECK(connection.copy_to_sub == 1 && connection.copy_to_main == 0);
    CHECK(connection.connection_id == 1 && connection.safe_to_sub == 1);
    CHECK(fsn_plan_copy(plan, 2, &copy) == FSN_E_ARG);
    fsn_plan_free(plan);
    CHECK(fsn_plan_load(NULL, 10, &plan, NULL) == FSN_E_ARG);
}

static const struct broken broken_rules[] = {
    {1, 0, 0, 4, 99, FSN_E_PLAN_STRING,
     "PLAN_STRING SubDevice 0+0: the name lies outside the strings"},
    {1, 0, 16, 4, 0xFFFFFFFFu, FSN_OK, "OK"},
    {1, 0, 20, 4, 0, FSN_OK, "OK"},
    {1, 1, 24, 4, 1, FSN_E_PLAN_REFERENCE,
     "PLAN_REFERENCE SubDevice 1+24: sync managers do not follow those of the SubDevice before"},
    {1, 1, 28, 4, 3, FSN_E_PLAN_REFERENCE,
     "PLAN_REFERENCE SubDevice 1+24: sync managers do not follow those of the SubDevice before"},
    {1, 0, 36, 4, 1, FSN_E_PLAN_REFERENCE,
     "PLAN_REFERENCE SubDevice 0+32: start-up SDOs do not follow those of the SubDevice before"},
    {1, 0, 42, 2, 2, FSN_E_PLAN_RESERVED,
     "PLAN_RESERVED SubDevice 0+42: a flag of the SubDevice is unknown"},
    {1, 0, 44, 4, 9999, FSN_E_PLAN_STRING,
     "PLAN_STRING SubDevice 0+44: what the driver reads lies outside the strings"},
    {2, 0, 0, 4, 1, FSN_E_PLAN_REFERENCE,
     "PLAN_REFERENCE sync manager 0+0: the sync manager belongs to another SubDevice"},
    {2, 0, 4, 1, 16, FSN_E_PLAN_VALUE,
     "PLAN_VALUE sync manager 0+4: SM number, direction or watchdog is not allowed, or SM numbers "
     "do not rise"},
    {2, 1, 4, 1, 2, FSN_E_PLAN_VALUE,
     "PLAN_VALUE sync manager 1+4: SM number, direction or watchdog is not allowed, or SM numbers "
     "do not rise"},
    {2, 0, 5, 1, 3, FSN_E_PLAN_VALUE,
     "PLAN_VALUE sync manager 0+4: SM number, direction or watchdog is not allowed, or SM numbers "
     "do not rise"},
    {2, 0, 6, 1, 3, FSN_E_PLAN_VALUE,
     "PLAN_VALUE sync manager 0+4: SM number, direction or watchdog is not allowed, or SM numbers "
     "do not rise"},
    {2, 0, 7, 1, 0, FSN_E_PLAN_LAYOUT,
     "PLAN_LAYOUT sync manager 0+8: the entries do not add up to length and flags of the sync "
     "manager"},
    {2, 0, 7, 1, 3, FSN_E_PLAN_RESERVED,
     "PLAN_RESERVED sync manager 0+7: a flag of the sync manager is unknown or its reserved field "
     "is not zero"},
    {2, 0, 8, 4, 64, FSN_E_PLAN_LAYOUT,
     "PLAN_LAYOUT sync manager 0+8: the entries do not add up to length and flags of the sync "
     "manager"},
    {2, 0, 12, 4, 1, FSN_E_PLAN_REFERENCE,
     "PLAN_REFERENCE sync manager 0+12: PDOs do not follow those of the sync manager before"},
    {2, 0, 16, 4, 9, FSN_E_PLAN_REFERENCE,
     "PLAN_REFERENCE sync manager 0+12: PDOs do not follow those of the sync manager before"},
    {2, 0, 20, 4, 1, FSN_E_PLAN_RESERVED,
     "PLAN_RESERVED sync manager 0+7: a flag of the sync manager is unknown or its reserved field "
     "is not zero"},
    {3, 0, 2, 2, 1, FSN_E_PLAN_RESERVED,
     "PLAN_RESERVED PDO 0+2: a reserved field of the PDO is not zero"},
    {3, 0, 4, 4, 1, FSN_E_PLAN_REFERENCE,
     "PLAN_REFERENCE PDO 0+4: entries do not follow those of the PDO before"},
    {3, 0, 8, 4, 0xFFFFFFFFu, FSN_E_PLAN_REFERENCE,
     "PLAN_REFERENCE PDO 0+4: entries do not follow those of the PDO before"},
    {3, 0, 12, 4, 8, FSN_E_PLAN_LAYOUT,
     "PLAN_LAYOUT PDO 0+12: the PDO does not start where the one before ends"},
    {4, 0, 3, 1, 2, FSN_E_PLAN_RESERVED,
     "PLAN_RESERVED entry 0+3: a flag of the entry is unknown or its reserved field is not zero"},
    {4, 0, 6, 1, 5, FSN_E_PLAN_VALUE,
     "PLAN_VALUE entry 0+6: the type is unknown, or padding is registered"},
    {4, 0, 0, 2, 0, FSN_E_PLAN_VALUE,
     "PLAN_VALUE entry 0+6: the type is unknown, or padding is registered"},
    {4, 0, 4, 2, 9, FSN_E_PLAN_LAYOUT,
     "PLAN_LAYOUT entry 1+8: the entry does not start where the one before ends"},
    {4, 1, 8, 4, 9, FSN_E_PLAN_LAYOUT,
     "PLAN_LAYOUT entry 1+8: the entry does not start where the one before ends"},
    {4, 8, 4, 2, 0xFFFF, FSN_E_PLAN_LAYOUT,
     "PLAN_LAYOUT entry 8+4: the sync manager has more than 1486 bytes"},
    {4, 8, 4, 2, 11888 - 63, FSN_E_PLAN_LAYOUT,
     "PLAN_LAYOUT entry 8+4: the sync manager has more than 1486 bytes"},
    {4, 8, 4, 2, 11888 - 64, FSN_E_PLAN_LAYOUT,
     "PLAN_LAYOUT sync manager 0+8: the entries do not add up to length and flags of the sync "
     "manager"},
    {2, 0, 6, 1, 2, FSN_OK, "OK"},
    {8, 0, 0, 4, 99, FSN_E_PLAN_REFERENCE,
     "PLAN_REFERENCE copy 0+0: the copy's sync manager does not exist"},
    {8, 0, 0, 4, 2, FSN_E_COPY_DIRECTION,
     "COPY_DIRECTION copy 0+0: a copy reads a registered input and writes a registered output"},
    {8, 0, 8, 4, 1, FSN_E_COPY_DIRECTION,
     "COPY_DIRECTION copy 0+8: a copy reads a registered input and writes a registered output"},
    {8, 0, 4, 4, 4, FSN_E_COPY_ALIGN, "COPY_ALIGN copy 0+4: a copy starts on a byte"},
    {8, 0, 12, 4, 1, FSN_E_COPY_ALIGN, "COPY_ALIGN copy 0+12: a copy starts on a byte"},
    {8, 0, 16, 4, 0, FSN_E_COPY_ALIGN, "COPY_ALIGN copy 0+16: a copy has at least one whole byte"},
    {8, 0, 16, 4, 47, FSN_E_COPY_ALIGN, "COPY_ALIGN copy 0+16: a copy has at least one whole byte"},
    {8, 0, 4, 4, 24, FSN_E_COPY_RANGE, "COPY_RANGE copy 0+4: the copy ends after its sync manager"},
    {8, 0, 12, 4, 0xFFFFFFF8u, FSN_E_COPY_RANGE,
     "COPY_RANGE copy 0+12: the copy ends after its sync manager"},
    {8, 0, 16, 4, 0xFFFFFFF8u, FSN_E_COPY_RANGE,
     "COPY_RANGE copy 0+4: the copy ends after its sync manager"},
    {8, 0, 16, 4, 64, FSN_E_COPY_FRAME, "COPY_FRAME copy 0+16: no FSoE frame has this length"},
    {8, 0, 20, 4, 4, FSN_E_PLAN_STRING,
     "PLAN_STRING copy 0+20: the net's name lies outside the strings"},
    {8, 0, 24, 2, 3, FSN_E_PLAN_VALUE, "PLAN_VALUE copy 0+24: the kind of the copy is unknown"},
    {8, 0, 24, 2, 2, FSN_E_COPY_PAIR,
     "COPY_PAIR copy 0+28: an FSoE copy names its connection, a standard copy none"},
    {8, 0, 26, 2, 1, FSN_E_PLAN_RESERVED,
     "PLAN_RESERVED copy 0+26: a reserved field of the copy is not zero"},
    {8, 0, 28, 4, 1, FSN_E_COPY_PAIR,
     "COPY_PAIR copy 0+28: an FSoE copy names its connection, a standard copy none"},
    {8, 1, 8, 4, 0, FSN_E_COPY_OVERLAP,
     "COPY_OVERLAP copy 1+8: two copies write the same byte, or copies are not sorted by "
     "destination"},
    {9, 0, 0, 4, 4, FSN_E_PLAN_STRING,
     "PLAN_STRING connection 0+0: a name lies outside the strings"},
    {9, 0, 8, 4, 1, FSN_E_COPY_PAIR,
     "COPY_PAIR connection 0+8: main and sub are the same SubDevice"},
    {9, 0, 16, 4, 0, FSN_E_COPY_PAIR,
     "COPY_PAIR connection 0+16: the copy is not this connection's FSoE copy between its two "
     "SubDevices"},
    {9, 0, 16, 4, 2, FSN_E_PLAN_REFERENCE,
     "PLAN_REFERENCE connection 0+16: the connection's copy does not exist"},
    {9, 0, 30, 2, 8, FSN_E_PLAN_RESERVED,
     "PLAN_RESERVED connection 0+30: a flag of the connection is unknown"},
    {9, 0, 32, 2, 2, FSN_E_PLAN_VALUE,
     "PLAN_VALUE connection 0+16: the safe data do not match the length of the copy"},
    {9, 0, 36, 4, 1, FSN_E_PLAN_STRING,
     "PLAN_STRING connection 0+36: the application parameters are not pairs of hex digits"},
    {9, 0, 36, 4, 9999, FSN_E_PLAN_STRING,
     "PLAN_STRING connection 0+36: the application parameters are not pairs of hex digits"},
    {10, 0, 0, 1, 1, FSN_E_PLAN_STRING,
     "PLAN_STRING strings -1+0: strings start and end with a zero byte"},
    {10, 1, 0, 1, 0x1B, FSN_E_PLAN_STRING,
     "PLAN_STRING strings -1+1: a name has a control character"},
    {10, 1, 0, 1, 0x01, FSN_E_PLAN_STRING,
     "PLAN_STRING strings -1+1: a name has a control character"},
    {10, 1, 0, 1, 0x1F, FSN_E_PLAN_STRING,
     "PLAN_STRING strings -1+1: a name has a control character"},
    {10, 1, 0, 1, 0x20, FSN_OK, "OK"},
    {10, 1, 0, 1, 0x80, FSN_OK, "OK"},
    {10, 1, 0, 1, 0x7F, FSN_E_PLAN_STRING,
     "PLAN_STRING strings -1+1: a name has a control character"},
    {10, 3, 0, 1, 1, FSN_E_PLAN_STRING,
     "PLAN_STRING strings -1+0: strings start and end with a zero byte"},
};

static void each_broken_rule_is_named(void) {
    for (size_t i = 0; i < sizeof broken_rules / sizeof broken_rules[0]; i++) {
        const struct broken *rule = &broken_rules[i];
        size_t len;
        uint8_t *bytes = build_estop(&len);
        const fsn_status status = break_rule(bytes, len, rule);
        if (status != rule->status) {
            fprintf(stderr, "rule %zu (section %u field %u): %s\n", i, rule->section, rule->field,
                    fsn_status_name(status));
        }
        CHECK(status == rule->status);
        free(bytes);
    }
}

/** Symbol 0 is an output with bits 52 to 59, symbol 1 an input. */
static void stop_values_are_proved(void) {
    static const struct broken rules[] = {
        {6, 0, 20, 4, 0xFF, FSN_OK, "OK"},
        {6, 0, 20, 4, 0x100, FSN_E_PLAN_VALUE,
         "PLAN_VALUE symbol 0+20: a stop value has the bits of its output, and is 0 for an input "
         "and for what is restart relevant"},
        {6, 0, 24, 4, 1, FSN_E_PLAN_VALUE,
         "PLAN_VALUE symbol 0+20: a stop value has the bits of its output, and is 0 for an input "
         "and for what is restart relevant"},
        {6, 0, 15, 1, 3, FSN_E_PLAN_VALUE,
         "PLAN_VALUE symbol 0+20: a stop value has the bits of its output, and is 0 for an input "
         "and for what is restart relevant"}, /* restart relevant, and a stop value */
        {6, 1, 20, 4, 1, FSN_E_PLAN_VALUE,
         "PLAN_VALUE symbol 1+20: a stop value has the bits of its output, and is 0 for an input "
         "and for what is restart relevant"},
        {6, 0, 16, 4, 1, FSN_E_PLAN_RESERVED,
         "PLAN_RESERVED symbol 0+15: a flag of the symbol is unknown or its reserved field is not "
         "zero"},
    };
    for (size_t i = 0; i < sizeof rules / sizeof rules[0]; i++) {
        size_t len;
        uint8_t *bytes = build_full(&len);
        CHECK(break_rule(bytes, len, &rules[i]) == rules[i].status);
        free(bytes);
    }
    size_t len;
    uint8_t *bytes = build_full(&len);
    struct fsn_plan *plan;
    struct fsn_symbol_info symbol;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    CHECK(fsn_plan_symbol(plan, 0, &symbol) == FSN_OK && symbol.stop_value == 0x5A);
    fsn_plan_free(plan);
    free(bytes);
}

/** Two fields that contradict each other. */
static void revisions_are_a_range(void) {
    size_t len;
    uint8_t *bytes = build_estop(&len);
    struct fsn_fault fault;
    uint8_t *r = bytes + section_at(bytes, 1) + 48;
    r[16] = 2;
    memcpy(r + 20, "\2\0\0\0", 4);
    build_fix_crc(bytes, len);
    CHECK(load(bytes, len, &fault) == FSN_OK);
    r[20] = 1;
    build_fix_crc(bytes, len);
    CHECK(load(bytes, len, &fault) == FSN_E_PLAN_VALUE);
    CHECK(strcmp(line_of(&fault, bytes), "PLAN_VALUE SubDevice 1+16: the lowest revision is above "
                                         "the highest") == 0);
    free(bytes);
}

static void an_empty_sync_manager_has_no_entries(void) {
    static const struct build_sm sm[1][2] = {{{1, 0}, {2, 3}}};
    const struct build build = {.subdevices = 1, .sm = sm};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct fsn_plan *plan;
    uint32_t behind = 9;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    CHECK(fsn_sm_entries(plan, 0, &behind) == 0 && behind == 0);
    CHECK(fsn_sm_entries(plan, 1, &behind) == 0 && behind == 3);
    fsn_plan_free(plan);
    free(bytes);
}

/** A third FSoE copy that claims the connection of two others. */
static void a_connection_has_two_copies(void) {
    static const struct build_sm sm[2][2] = {{{1, 12}, {2, 12}}, {{1, 12}, {2, 12}}};
    static const struct build_copy copies[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}, {0, 6, 1, 6, 6}};
    const struct build build = {
        .subdevices = 2, .sm = sm, .copies = copies, .pairs = 1, .standard = 1};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct fsn_fault fault;
    CHECK(load(bytes, len, &fault) == FSN_OK);
    uint8_t *r = bytes + section_at(bytes, 8) + 2 * 32;
    r[24] = 1;
    memset(r + 28, 0, 4);
    build_fix_crc(bytes, len);
    CHECK(load(bytes, len, &fault) == FSN_E_COPY_PAIR);
    CHECK(strcmp(line_of(&fault, bytes), "COPY_PAIR copy 2+28: the connection does not name this "
                                         "copy as one of its two") == 0);
    free(bytes);
}

/** Rules that break only when several fields are changed together. */
static void several_fields_together(void) {
    static const struct {
        bool full; /**< the plan with blocks, else without */
        struct broken change[10];
        const char *says;
    } rows[] = {
        {true,
         {{8, 0, 24, 2, 2, FSN_OK, NULL}, {8, 0, 28, 4, FSN_NONE, FSN_OK, NULL}},
         "COPY_FRAME copy 0+0: a copy must cover a whole FSoE block as an FSoE copy, or none"},
        {false,
         {{8, 0, 8, 4, 2, FSN_OK, NULL}, {8, 1, 8, 4, 0, FSN_OK, NULL}},
         "COPY_OVERLAP copy 1+8: two copies write the same byte, or copies are not sorted by "
         "destination"},
        {false,
         {{2, 2, 7, 1, 0, FSN_OK, NULL},
          {4, 17, 3, 1, 0, FSN_OK, NULL},
          {4, 18, 3, 1, 0, FSN_OK, NULL},
          {4, 19, 3, 1, 0, FSN_OK, NULL},
          {4, 20, 3, 1, 0, FSN_OK, NULL},
          {4, 21, 3, 1, 0, FSN_OK, NULL},
          {4, 22, 3, 1, 0, FSN_OK, NULL},
          {4, 23, 3, 1, 0, FSN_OK, NULL},
          {4, 24, 3, 1, 0, FSN_OK, NULL}},
         "COPY_DIRECTION copy 1+8: a copy reads a registered input and writes a registered output"},
        {true, {{5, 0, 3, 1, 1, FSN_OK, NULL}}, "OK"},
        {true, {{5, 0, 3, 1, 2, FSN_OK, NULL}}, "OK"},
        {true, {{5, 0, 3, 1, 8, FSN_OK, NULL}}, "OK"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        size_t len;
        uint8_t *bytes = rows[i].full ? build_full(&len) : build_estop(&len);
        for (const struct broken *c = rows[i].change; c->bytes != 0; c++) {
            uint8_t *field = bytes + section_at(bytes, c->section) +
                             c->record * fsn_record_bytes[c->section] + c->field;
            for (uint32_t b = 0; b < c->bytes; b++) {
                field[b] = (uint8_t)(c->value >> (8 * b));
            }
        }
        build_fix_crc(bytes, len);
        struct fsn_fault fault;
        const char *said = load(bytes, len, &fault) == FSN_OK ? "OK" : line_of(&fault, bytes);
        if (strcmp(said, rows[i].says) != 0) {
            fprintf(stderr, "said     %s\nexpected %s\n", said, rows[i].says);
        }
        CHECK(strcmp(said, rows[i].says) == 0);
        free(bytes);
    }
}

static void fault_names_the_copy(void) {
    size_t len;
    uint8_t *bytes = build_estop(&len);
    bytes[section_at(bytes, 8) + 32 + 4] = 4; /* copy 1, source bit offset */
    build_fix_crc(bytes, len);
    struct fsn_fault fault;
    CHECK(load(bytes, len, &fault) == FSN_E_COPY_ALIGN);
    CHECK(fault.section == 8 && fault.copy_index == 1);
    CHECK(fault.byte == section_at(bytes, 8) + 32 + 4);
    CHECK(strcmp(fsn_section_name(fault.section), "copy") == 0);
    free(bytes);
}

static void statuses_have_texts(void) {
    CHECK(strcmp(fsn_status_name(FSN_OK), "FSN_OK") == 0);
    CHECK(fsn_status_next_step(FSN_OK)[0] == 0 && strcmp(fsn_section_name(99), "?") == 0);
    CHECK(strcmp(fsn_status_text((fsn_status)-999), "unknown status") == 0);
    CHECK(strcmp(fsn_status_name(FSN_E_COPY_RANGE), "FSN_E_COPY_RANGE") == 0);
    CHECK(strcmp(fsn_status_name((fsn_status)-999), "FSN_E_?") == 0);
}

int main(void) {
    const long alive = heap_alive();
    good_plan_is_decoded();
    each_broken_rule_is_named();
    stop_values_are_proved();
    revisions_are_a_range();
    an_empty_sync_manager_has_no_entries();
    a_connection_has_two_copies();
    several_fields_together();
    fault_names_the_copy();
    statuses_have_texts();
    CHECK(heap_alive() == alive);
    return 0;
}
