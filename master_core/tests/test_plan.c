/** The loader against hostile bytes: each rule broken alone, every truncation, every byte changed.
 */
#include <string.h>

#include "builder.h"
#include "fsn/fsn.h"
#include "plan_internal.h"

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
};

static const struct broken broken_rules[] = {
    {1, 0, 0, 4, 99, FSN_E_PLAN_STRING},
    {1, 0, 16, 4, 0xFFFFFFFFu, FSN_OK},
    {1, 0, 20, 4, 0, FSN_OK},
    {1, 1, 24, 4, 1, FSN_E_PLAN_REFERENCE},
    {1, 1, 28, 4, 3, FSN_E_PLAN_REFERENCE},
    {1, 0, 36, 4, 1, FSN_E_PLAN_REFERENCE},
    {1, 0, 42, 2, 2, FSN_E_PLAN_RESERVED},
    {1, 0, 44, 4, 1, FSN_E_PLAN_RESERVED},
    {2, 0, 0, 4, 1, FSN_E_PLAN_REFERENCE},
    {2, 0, 4, 1, 16, FSN_E_PLAN_VALUE},
    {2, 1, 4, 1, 2, FSN_E_PLAN_VALUE},
    {2, 0, 5, 1, 3, FSN_E_PLAN_VALUE},
    {2, 0, 6, 1, 3, FSN_E_PLAN_VALUE},
    {2, 0, 7, 1, 0, FSN_E_PLAN_LAYOUT},
    {2, 0, 7, 1, 3, FSN_E_PLAN_RESERVED},
    {2, 0, 8, 4, 64, FSN_E_PLAN_LAYOUT},
    {2, 0, 12, 4, 1, FSN_E_PLAN_REFERENCE},
    {2, 0, 16, 4, 9, FSN_E_PLAN_REFERENCE},
    {2, 0, 20, 4, 1, FSN_E_PLAN_RESERVED},
    {3, 0, 2, 2, 1, FSN_E_PLAN_RESERVED},
    {3, 0, 4, 4, 1, FSN_E_PLAN_REFERENCE},
    {3, 0, 8, 4, 0xFFFFFFFFu, FSN_E_PLAN_REFERENCE},
    {3, 0, 12, 4, 8, FSN_E_PLAN_LAYOUT},
    {4, 0, 3, 1, 2, FSN_E_PLAN_RESERVED},
    {4, 0, 6, 1, 5, FSN_E_PLAN_VALUE},
    {4, 0, 0, 2, 0, FSN_E_PLAN_VALUE},
    {4, 0, 4, 2, 9, FSN_E_PLAN_LAYOUT},
    {4, 1, 8, 4, 9, FSN_E_PLAN_LAYOUT},
    {8, 0, 0, 4, 99, FSN_E_PLAN_REFERENCE},
    {8, 0, 0, 4, 2, FSN_E_COPY_DIRECTION},
    {8, 0, 8, 4, 1, FSN_E_COPY_DIRECTION},
    {8, 0, 4, 4, 4, FSN_E_COPY_ALIGN},
    {8, 0, 12, 4, 1, FSN_E_COPY_ALIGN},
    {8, 0, 16, 4, 0, FSN_E_COPY_ALIGN},
    {8, 0, 16, 4, 47, FSN_E_COPY_ALIGN},
    {8, 0, 4, 4, 24, FSN_E_COPY_RANGE},
    {8, 0, 12, 4, 0xFFFFFFF8u, FSN_E_COPY_RANGE},
    {8, 0, 16, 4, 0xFFFFFFF8u, FSN_E_COPY_RANGE},
    {8, 0, 16, 4, 64, FSN_E_COPY_FRAME},
    {8, 0, 20, 4, 4, FSN_E_PLAN_STRING},
    {8, 0, 24, 2, 3, FSN_E_PLAN_VALUE},
    {8, 0, 24, 2, 2, FSN_E_COPY_PAIR},
    {8, 0, 26, 2, 1, FSN_E_PLAN_RESERVED},
    {8, 0, 28, 4, 1, FSN_E_COPY_PAIR},
    {8, 1, 8, 4, 0, FSN_E_COPY_OVERLAP},
    {9, 0, 0, 4, 4, FSN_E_PLAN_STRING},
    {9, 0, 8, 4, 1, FSN_E_COPY_PAIR},
    {9, 0, 16, 4, 0, FSN_E_COPY_PAIR},
    {9, 0, 16, 4, 2, FSN_E_PLAN_REFERENCE},
    {9, 0, 30, 2, 8, FSN_E_PLAN_RESERVED},
    {9, 0, 32, 2, 2, FSN_E_PLAN_VALUE},
    {9, 0, 36, 4, 1, FSN_E_PLAN_RESERVED},
    {10, 0, 0, 1, 1, FSN_E_PLAN_STRING},
    {10, 1, 0, 1, 0x1B, FSN_E_PLAN_STRING},
    {10, 1, 0, 1, 0x7F, FSN_E_PLAN_STRING},
    {10, 3, 0, 1, 1, FSN_E_PLAN_STRING},
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
        {6, 0, 20, 4, 0xFF, FSN_OK},
        {6, 0, 20, 4, 0x100, FSN_E_PLAN_VALUE},
        {6, 0, 24, 4, 1, FSN_E_PLAN_VALUE},
        {6, 0, 15, 1, 3, FSN_E_PLAN_VALUE}, /* restart relevant, and a stop value */
        {6, 1, 20, 4, 1, FSN_E_PLAN_VALUE},
        {6, 0, 16, 4, 1, FSN_E_PLAN_RESERVED},
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
        {{1, 1, 12, 4, 7, FSN_OK}, 1u << FSN_FINGERPRINT_DEVICES},
        {{5, 0, 8, 1, 9, FSN_OK}, 1u << FSN_FINGERPRINT_DEVICES},
        {{2, 0, 6, 1, 1, FSN_OK}, 1u << FSN_FINGERPRINT_PROCESS_DATA},
        {{4, 0, 6, 1, 2, FSN_OK}, 1u << FSN_FINGERPRINT_PROCESS_DATA},
        {{6, 0, 20, 1, 0x5B, FSN_OK}, 1u << FSN_FINGERPRINT_PROCESS_DATA},
        {{9, 0, 24, 2, 77, FSN_OK}, 1u << FSN_FINGERPRINT_CONNECTIONS},
        {{9, 0, 30, 2, 3, FSN_OK}, 1u << FSN_FINGERPRINT_CONNECTIONS},
        {{11, 0, 31, 1, 0, FSN_OK}, 1u << FSN_FINGERPRINT_SAFETY_FUNCTIONS},
        {{1, 0, 42, 1, 0, FSN_OK}, 0}, /* a flag that says again what the copies say */
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

static void header_rules(void) {
    size_t len;
    uint8_t *bytes = build_estop(&len);
    bytes[0] ^= 1;
    CHECK(load(bytes, len, NULL) == FSN_E_PLAN_MAGIC);
    bytes[0] ^= 1;
    bytes[8] = 2;
    CHECK(load(bytes, len, NULL) == FSN_E_PLAN_VERSION);
    bytes[8] = 1;
    bytes[len - 2] ^= 1;
    CHECK(load(bytes, len, NULL) == FSN_E_PLAN_CRC);
    bytes[len - 2] ^= 1;
    bytes[28] = 1;
    build_fix_crc(bytes, len);
    CHECK(load(bytes, len, NULL) == FSN_E_PLAN_RESERVED);
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
    fault_names_the_copy();
    header_rules();
    every_truncation_is_refused();
    CHECK(strcmp(fsn_status_name(FSN_E_COPY_RANGE), "FSN_E_COPY_RANGE") == 0);
    CHECK(strcmp(fsn_status_name((fsn_status)-999), "FSN_E_?") == 0);
    return 0;
}
