/** Checksums and fingerprint of a plan. */
/* shows R4 */
#include "broken.h"
#include "heap.h"

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

/** Changes one field and returns the sections of the fingerprint that changed with it, as bits. */
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
        {{1, 0, 42, 1, 0, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_DEVICES},
        {{1, 0, 44, 1, 1, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_DEVICES},
        {{7, 0, 12, 1, 0, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_PROCESS_DATA},
        {{6, 0, 0, 4, 0, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_PROCESS_DATA},
        {{9, 0, 0, 4, 0, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_CONNECTIONS},
        {{9, 0, 4, 4, 0, FSN_OK, NULL}, 1u << FSN_FINGERPRINT_CONNECTIONS},
        {{2, 0, 0, 4, 0, FSN_OK, NULL}, 0}, /* existing text */
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        CHECK(changed_by(&rows[i].change) == rows[i].section);
    }
    CHECK(fsn_plan_fingerprint(NULL, NULL) == FSN_E_ARG);
    CHECK(strcmp(fsn_fingerprint_section(FSN_FINGERPRINT_CYCLE), "cycle") == 0);
    CHECK(strcmp(fsn_fingerprint_section(FSN_FINGERPRINT_SECTIONS), "?") == 0);
}

/** Application parameters are in the text; their length and CRC-32 are marked as known. */
static void application_parameters_are_stated(void) {
    size_t len;
    uint8_t *bytes = build_full(&len);
    struct fsn_fingerprint before;
    struct fsn_fingerprint after;
    struct fsn_connection_info info;
    struct fsn_plan *plan;
    fingerprint_of_bytes(bytes, len, &before);
    bytes = build_name(bytes, &len, FSN_SEC_CONNECTION, 0, "313233343536373839");
    uint8_t *record = bytes + fsn_get32(bytes + 32 + 16 * (FSN_SEC_CONNECTION - 1) + 4);
    memcpy(record + 36, record, 4);
    fsn_put32(record, 1); /* its name, unchanged */
    build_fix_crc(bytes, len);
    fingerprint_of_bytes(bytes, len, &after);
    CHECK(memcmp(before.section[FSN_FINGERPRINT_CONNECTIONS],
                 after.section[FSN_FINGERPRINT_CONNECTIONS], FSN_SHA256_BYTES) != 0);
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    CHECK(fsn_plan_connection(plan, 0, &info) == FSN_OK);
    CHECK(info.app_bytes == 9 && info.app_crc == 0xCBF43926 && (info.known & FSN_STATED_APP) != 0);
    fsn_plan_free(plan);
    free(bytes);
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
    CHECK(code[4] == ' ' && code[9] == ' ' && code[14] == ' ');
    for (size_t cut = 0; cut < len; cut++) {
        CHECK(load(bytes, cut, NULL) != FSN_OK);
    }
    bytes[10] = 0;
    build_fix_crc(bytes, len);
    CHECK(load(bytes, len, NULL) == FSN_E_PLAN_SECTION);
    bytes[10] = 4;
    build_fix_crc(bytes, len);
    struct fsn_fault fault;
    CHECK(load(bytes, len, &fault) == FSN_E_PLAN_VERSION);
    CHECK(fault.section == 0 && fault.byte == 10 && fault.copy_index == FSN_FAULT_NO_RECORD);
    bytes[10] = 1;
    bytes[32 + 16 * 10 + 8] = 2; /* two hashes, and room for them */
    bytes = realloc(bytes, len + 32);
    CHECK(bytes != NULL);
    memset(bytes + len, 0x5A, 32);
    len += 32;
    fsn_put32(bytes + 12, (uint32_t)len);
    build_fix_crc(bytes, len);
    CHECK(load(bytes, len, &fault) == FSN_E_PLAN_SECTION && fault.byte == 32 + 16 * 10);
    free(bytes);
}

int main(void) {
    const long alive = heap_alive();
    sha256_is_right();
    sha256_takes_pieces();
    a_change_changes_its_section();
    application_parameters_are_stated();
    format_1_1_is_read();
    CHECK(heap_alive() == alive);
    return 0;
}
