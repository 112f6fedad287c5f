/** The loader against hostile bytes: each rule broken alone, every truncation, every byte changed.
 */
#include <string.h>

#include "builder.h"
#include "fsn/fsn.h"
#include "plan/plan_internal.h"

static size_t section_at(const uint8_t *bytes, uint32_t section) {
    return fsn_get32(bytes + 32 + 16 * (section - 1) + 4);
}

static fsn_status load(const uint8_t *bytes, size_t len, struct fsn_fault *fault) {
    struct fsn_plan *plan = NULL;
    const fsn_status status = fsn_plan_load(bytes, len, &plan, fault);
    CHECK((status == FSN_OK) == (plan != NULL));
    fsn_plan_free(plan);
    return status;
}

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

/** One broken rule: where, what is written there, what must be answered. */
struct broken {
    uint32_t section, record, field, bytes, value;
    fsn_status status;
    const char *says; /**< the whole fault; NULL: not looked at */
};

/** A fault in one line: what, where, which rule. */
static const char *line_of(const struct fsn_fault *fault, const uint8_t *bytes) {
    static char line[256];
    uint32_t at = fault->byte;
    if (fault->section != 0) {
        at -= (uint32_t)section_at(bytes, fault->section);
        at -= fault->copy_index == FSN_FAULT_NO_RECORD
                  ? 0
                  : fault->copy_index * fsn_record_bytes[fault->section];
    }
    snprintf(line, sizeof line, "%s %s %d+%u: %s", fsn_status_name(fault->status) + 6,
             fsn_section_name(fault->section), (int)fault->copy_index, at, fault->rule);
    return line;
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
     "PLAN_RESERVED SubDevice 0+42: a flag of the SubDevice is unknown or its reserved field is "
     "not zero"},
    {1, 0, 44, 4, 1, FSN_E_PLAN_RESERVED,
     "PLAN_RESERVED SubDevice 0+42: a flag of the SubDevice is unknown or its reserved field is "
     "not zero"},
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
    {8, 0, 4, 4, 24, FSN_E_COPY_RANGE,
     "COPY_RANGE copy 0+4: the copy ends behind its sync manager"},
    {8, 0, 12, 4, 0xFFFFFFF8u, FSN_E_COPY_RANGE,
     "COPY_RANGE copy 0+12: the copy ends behind its sync manager"},
    {8, 0, 16, 4, 0xFFFFFFF8u, FSN_E_COPY_RANGE,
     "COPY_RANGE copy 0+4: the copy ends behind its sync manager"},
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
     "PLAN_RESERVED connection 0+30: a flag of the connection is unknown or its reserved field is "
     "not zero"},
    {9, 0, 32, 2, 2, FSN_E_PLAN_VALUE,
     "PLAN_VALUE connection 0+16: the safe data do not match the length of the copy"},
    {9, 0, 36, 4, 1, FSN_E_PLAN_RESERVED,
     "PLAN_RESERVED connection 0+30: a flag of the connection is unknown or its reserved field is "
     "not zero"},
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

static fsn_status break_rule(uint8_t *bytes, size_t len, const struct broken *rule) {
    uint8_t *field = bytes + section_at(bytes, rule->section) +
                     rule->record * fsn_record_bytes[rule->section] + rule->field;
    for (uint32_t b = 0; b < rule->bytes; b++) {
        field[b] = (uint8_t)(rule->value >> (8 * b));
    }
    build_fix_crc(bytes, len);
    struct fsn_fault fault;
    const fsn_status status = load(bytes, len, &fault);
    CHECK(status == FSN_OK || fault.status == status);
    if (rule->says != NULL) {
        const char *said = status == FSN_OK ? "OK" : line_of(&fault, bytes);
        if (strcmp(said, rule->says) != 0) {
            fprintf(stderr, "said     %s\nexpected %s\n", said, rule->says);
        }
        CHECK(strcmp(said, rule->says) == 0);
    }
    return status;
}

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
        {6, 0, 20, 4, 0xFF, FSN_OK, NULL},
        {6, 0, 20, 4, 0x100, FSN_E_PLAN_VALUE, NULL},
        {6, 0, 24, 4, 1, FSN_E_PLAN_VALUE, NULL},
        {6, 0, 15, 1, 3, FSN_E_PLAN_VALUE, NULL}, /* restart relevant, and a stop value */
        {6, 1, 20, 4, 1, FSN_E_PLAN_VALUE, NULL},
        {6, 0, 16, 4, 1, FSN_E_PLAN_RESERVED, NULL},
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

/** The examples of FIPS 180-4, and a length on each side of the padding's border. */
static void sha256_is_right(void) {
    static const struct {
        const char *text;
        const char *digest; /* its first four bytes */
    } known[] = {
        {"", "\xe3\xb0\xc4\x42"},
        {"abc", "\xba\x78\x16\xbf"},
        {"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", "\x24\x8d\x6a\x61"},
        {"0123456789012345678901234567890123456789012345678901234", "\xf3\x4d\x5a\x0f"},
    };
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        uint8_t digest[FSN_SHA256_BYTES];
        fsn_sha256(known[i].text, strlen(known[i].text), digest);
        CHECK(memcmp(digest, known[i].digest, 4) == 0);
    }
}

/** In pieces of every length the hash is that of the whole. */
static void sha256_takes_pieces(void) {
    uint8_t bytes[300];
    uint8_t wanted[FSN_SHA256_BYTES];
    for (size_t i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8_t)(7 * i);
    }
    fsn_sha256(bytes, sizeof bytes, wanted);
    for (size_t piece = 1; piece < sizeof bytes; piece++) {
        uint8_t digest[FSN_SHA256_BYTES];
        struct fsn_sha256_run run;
        fsn_sha256_start(&run);
        for (size_t at = 0; at < sizeof bytes; at += piece) {
            fsn_sha256_add(&run, bytes + at, piece < sizeof bytes - at ? piece : sizeof bytes - at);
        }
        fsn_sha256_end(&run, digest);
        CHECK(memcmp(digest, wanted, sizeof wanted) == 0);
    }
}

static void fingerprint_of_bytes(const uint8_t *bytes, size_t len, struct fsn_fingerprint *made) {
    struct fsn_plan *plan;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    CHECK(fsn_plan_fingerprint(plan, made) == FSN_OK);
    fsn_plan_free(plan);
}

/** Changes one field and says which sections of the fingerprint changed with it, as bits. */
static unsigned changed_by(const struct broken *change) {
    struct fsn_fingerprint before;
    struct fsn_fingerprint after;
    size_t len;
    unsigned bits = 0;
    uint8_t *bytes = build_with_safety(&len);
    fingerprint_of_bytes(bytes, len, &before);
    CHECK(break_rule(bytes, len, change) == FSN_OK);
    fingerprint_of_bytes(bytes, len, &after);
    for (unsigned i = 0; i < FSN_FINGERPRINT_SECTIONS; i++) {
        const bool same = memcmp(before.section[i], after.section[i], FSN_SHA256_BYTES) == 0;
        bits |= same ? 0u : 1u << i;
    }
    CHECK((memcmp(before.whole, after.whole, FSN_SHA256_BYTES) == 0) == (bits == 0));
    free(bytes);
    return bits;
}

static void a_change_changes_its_section(void) {
    static const struct {
        struct broken change;
        unsigned section;
    } rows[] = {
        {{1, 1, 12, 4, 7, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_DEVICES},
        {{5, 0, 8, 1, 9, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_DEVICES},
        {{2, 0, 6, 1, 1, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_PROCESS_DATA},
        {{4, 0, 6, 1, 2, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_PROCESS_DATA},
        {{6, 0, 20, 1, 0x5B, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_PROCESS_DATA},
        {{9, 0, 24, 2, 77, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_CONNECTIONS},
        {{9, 0, 30, 2, 3, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_CONNECTIONS},
        {{11, 0, 31, 1, 0, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_SAFETY_FUNCTIONS},
        {{1, 0, 42, 1, 0, FSN_OK, NULL}, 0}, /* a flag that says again what the copies say */
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        CHECK(changed_by(&rows[i].change) == rows[i].section);
    }
    CHECK(fsn_plan_fingerprint(NULL, NULL) == FSN_E_ARG);
    CHECK(strcmp(fsn_fingerprint_section(FSN_FINGERPRINT_CYCLE), "cycle") == 0);
    CHECK(strcmp(fsn_fingerprint_section(FSN_FINGERPRINT_SECTIONS), "?") == 0);
}

static void format_1_1_is_read(void) {
    size_t len;
    uint8_t *bytes = build_with_safety(&len);
    struct fsn_fingerprint made;
    char code[FSN_FINGERPRINT_CODE_BYTES];
    fingerprint_of_bytes(bytes, len, &made);
    CHECK(made.section[FSN_FINGERPRINT_SAFETY_FUNCTIONS][31] == 0x5A);
    made.whole[0] = 0xA1;
    made.whole[7] = 0x0F;
    fsn_fingerprint_code(&made, code);
    CHECK(strlen(code) == 19 && memcmp(code, "A1", 2) == 0 && strcmp(code + 17, "0F") == 0);
    for (size_t cut = 0; cut < len; cut++) {
        CHECK(load(bytes, cut, NULL) != FSN_OK);
    }
    bytes[10] = 0;
    build_fix_crc(bytes, len);
    CHECK(load(bytes, len, NULL) == FSN_E_PLAN_SECTION);
    bytes[10] = 2;
    build_fix_crc(bytes, len);
    CHECK(load(bytes, len, NULL) == FSN_E_PLAN_VERSION);
    bytes[10] = 1;
    bytes[32 + 16 * 10 + 8] = 2; /* two hashes */
    build_fix_crc(bytes, len);
    CHECK(load(bytes, len, NULL) == FSN_E_PLAN_SECTION);
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

/** A third FSoE copy that says it belongs to a connection of two others. */
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

/** What is wrong only where several fields are changed together. */
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

static void put32(uint8_t *at, size_t value) {
    for (int i = 0; i < 4; i++) {
        at[i] = (uint8_t)(value >> (8 * i));
    }
}

/** A file that ends with a section, where one more or a string should come. */
static void files_end_behind_their_last_section(void) {
    size_t len;
    uint8_t *bytes = build_with_safety(&len);
    struct fsn_fault fault;
    size_t cut = section_at(bytes, 10) + 1;
    bytes[32 + 16 * 9 + 8] = 1;
    put32(bytes + 12, cut);
    build_fix_crc(bytes, cut);
    CHECK(load(bytes, cut, &fault) == FSN_E_PLAN_SECTION && fault.section == 11);
    free(bytes);
    bytes = build_estop(&len);
    cut = section_at(bytes, 10);
    bytes[32 + 16 * 9 + 8] = 0; /* no strings at all */
    put32(bytes + 12, cut);
    build_fix_crc(bytes, cut);
    CHECK(load(bytes, cut, &fault) == FSN_E_PLAN_STRING && fault.byte == cut);
    free(bytes);
}

/** PDOs and entries that no sync manager has. */
static void nothing_is_left_over(void) {
    static const char says[] = "PLAN_REFERENCE PDO -1+0: PDOs or entries belong to no sync manager";
    static const struct build_sm sm[1][2] = {{{1, 1}, {2, 1}}};
    const struct build build = {.subdevices = 1, .sm = sm};
    for (int kind = 0; kind < 2; kind++) {
        size_t len;
        uint8_t *bytes = build_plan(&build, &len);
        struct fsn_fault fault;
        if (kind == 0) { /* the last sync manager is without its PDO */
            uint8_t *r = bytes + section_at(bytes, 2) + 24;
            r[7] = r[8] = r[16] = 0;
        } else { /* its PDO is without its entry */
            uint8_t *r = bytes + section_at(bytes, 2) + 24;
            r[7] = r[8] = 0;
            bytes[section_at(bytes, 3) + 16 + 8] = 0;
        }
        build_fix_crc(bytes, len);
        CHECK(load(bytes, len, &fault) == FSN_E_PLAN_REFERENCE);
        CHECK(strcmp(line_of(&fault, bytes), says) == 0);
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

/** Bytes of the header and of the section table changed, alone. */
static void header_rules(void) {
    static const struct {
        size_t at;
        uint8_t value;
        bool crc; /**< made right again */
        const char *says;
    } table[] = {
        {0, 'f', false, "PLAN_MAGIC 0.-1+0: these bytes are no plan"},
        {7, 1, false, "PLAN_MAGIC 0.-1+0: these bytes are no plan"},
        {8, 2, false, "PLAN_VERSION 0.-1+8: the plan format has another version"},
        {9, 1, false, "PLAN_VERSION 0.-1+8: the plan format has another version"},
        {12, 0, false, "PLAN_LENGTH 0.-1+12: the stated length is not that of the file"},
        {15, 1, false, "PLAN_LENGTH 0.-1+12: the stated length is not that of the file"},
        {16, 0, false, "PLAN_CRC 0.-1+16: CRC-32 does not fit; the plan was changed"},
        {20, 0, true, "OK"},
        {24, 9, true,
         "PLAN_SECTION 0.-1+24: the number of sections is not 10 (format 1.0) or 11 (format 1.1)"},
        {24, 11, true,
         "PLAN_SECTION 0.-1+24: the number of sections is not 10 (format 1.0) or 11 (format 1.1)"},
        {28, 1, true, "PLAN_RESERVED 0.-1+28: the reserved field of the header is not zero"},
        {31, 1, true, "PLAN_RESERVED 0.-1+28: the reserved field of the header is not zero"},
        {32, 2, true,
         "PLAN_SECTION 1.-1+32: a row of the section table has a wrong kind, place or size"},
        {36, 4, true,
         "PLAN_SECTION 1.-1+32: a row of the section table has a wrong kind, place or size"},
        {43, 1, true,
         "PLAN_SECTION 1.-1+32: a row of the section table has a wrong kind, place or size"},
        {44, 47, true,
         "PLAN_SECTION 1.-1+32: a row of the section table has a wrong kind, place or size"},
        {32 + 9 * 16 + 8, 2, true, "PLAN_LENGTH 10.-1+950: the last section does not end the file"},
        {32 + 9 * 16 + 8, 5, true,
         "PLAN_SECTION 10.-1+176: a row of the section table has a wrong kind, place or size"},
    };
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        size_t len;
        uint8_t *bytes = build_estop(&len);
        struct fsn_fault fault;
        bytes[table[i].at] = table[i].value;
        if (table[i].crc) {
            build_fix_crc(bytes, len);
        }
        char said[256] = "OK";
        if (load(bytes, len, &fault) != FSN_OK) {
            snprintf(said, sizeof said, "%s %u.%d+%u: %s", fsn_status_name(fault.status) + 6,
                     fault.section, (int)fault.copy_index, fault.byte, fault.rule);
        }
        if (strcmp(said, table[i].says) != 0) {
            fprintf(stderr, "said     %s\nexpected %s\n", said, table[i].says);
        }
        CHECK(strcmp(said, table[i].says) == 0);
        free(bytes);
    }
}

/** A length that does not fit 31 bits is refused before anything of it is read. */
static void two_gibibytes_are_no_plan(void) {
    size_t len;
    uint8_t *bytes = build_estop(&len);
    struct fsn_fault fault;
    memcpy(bytes + 12, "\0\0\0\x80", 4);
    CHECK(load(bytes, (size_t)1 << 31, &fault) == FSN_E_PLAN_LENGTH && fault.byte == 12);
    CHECK(fsn_plan_load(bytes, len, NULL, &fault) == FSN_E_ARG && fault.status == FSN_E_ARG);
    free(bytes);
}

/** Padding between two sections is zero, byte by byte. */
static void gaps_are_zero(void) {
    size_t len;
    uint8_t *bytes = build_with_safety(&len);
    const size_t strings = section_at(bytes, 10);
    const size_t behind = strings + 1;
    CHECK(section_at(bytes, 11) - strings == 4);
    memset(bytes + strings, 0, 4);
    bytes[32 + 16 * 9 + 8] = 1; /* one empty name and three bytes up to the next section */
    for (size_t at = behind; at < section_at(bytes, 11); at++) {
        struct fsn_fault fault;
        bytes[at] = 1;
        build_fix_crc(bytes, len);
        CHECK(load(bytes, len, &fault) == FSN_E_PLAN_RESERVED);
        CHECK(fault.section == 10 && fault.byte == at && fault.copy_index == FSN_FAULT_NO_RECORD);
        CHECK(strcmp(fault.rule, "bytes between two sections are not zero") == 0);
        bytes[at] = 0;
    }
    free(bytes);
}

/** A file cut off anywhere is refused; the buffer has exactly that size, so ASan sees any reach. */
static void every_truncation_is_refused(void) {
    size_t len;
    uint8_t *bytes = build_estop(&len);
    for (size_t cut = 0; cut < len; cut++) {
        uint8_t *part = malloc(cut + 1);
        CHECK(part != NULL);
        memcpy(part, bytes, cut);
        CHECK(load(part, cut, NULL) != FSN_OK);
        if (cut > 200) {
            part = realloc(part, cut);
            CHECK(part != NULL);
            part[12] = (uint8_t)cut;
            part[13] = (uint8_t)(cut >> 8);
            build_fix_crc(part, cut);
            CHECK(load(part, cut, NULL) != FSN_OK);
        }
        free(part);
    }
    free(bytes);
}

int main(void) {
    good_plan_is_decoded();
    each_broken_rule_is_named();
    stop_values_are_proved();
    sha256_is_right();
    sha256_takes_pieces();
    a_change_changes_its_section();
    format_1_1_is_read();
    revisions_are_a_range();
    a_connection_has_two_copies();
    nothing_is_left_over();
    several_fields_together();
    files_end_behind_their_last_section();
    fault_names_the_copy();
    header_rules();
    two_gibibytes_are_no_plan();
    gaps_are_zero();
    every_truncation_is_refused();
    CHECK(strcmp(fsn_status_name(FSN_OK), "FSN_OK") == 0);
    CHECK(fsn_status_next_step(FSN_OK)[0] == 0 && strcmp(fsn_section_name(99), "?") == 0);
    CHECK(strcmp(fsn_status_text((fsn_status)-999), "unknown status") == 0);
    CHECK(strcmp(fsn_status_name(FSN_E_COPY_RANGE), "FSN_E_COPY_RANGE") == 0);
    CHECK(strcmp(fsn_status_name((fsn_status)-999), "FSN_E_?") == 0);
    return 0;
}
