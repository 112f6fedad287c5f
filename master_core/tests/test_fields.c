/** Positions of the fields of a record, and the text of a fingerprint: the bytes of a loaded plan
 *  are overwritten, so that each field has a value of its own. */
/* shows R5 */
#include <inttypes.h>
#include <stdarg.h>
#include <string.h>

#include "builder.h"
#include "fsn/fsn.h"
#include "heap.h"
#include "plan/plan_internal.h"

static struct fsn_plan *load(uint8_t *bytes, size_t len) {
    struct fsn_plan *plan;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    free(bytes);
    return plan;
}

static uint8_t *record(struct fsn_plan *plan, uint32_t section, uint32_t number) {
    return plan->bytes + plan->offset[section] + number * fsn_record_bytes[section];
}

/** Writes a real number as a plan holds it. */
static void put_real(uint8_t *at, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    fsn_put64(at, bits);
}

/* -- fields ---------------------------------------------------------------------------------- */

/** Byte n of the second record of each section is n + 1, but for the first name: "t". */
static uint8_t *count_up(struct fsn_plan *plan, uint32_t section, unsigned names) {
    uint8_t *r = record(plan, section, 1);
    for (uint32_t i = 0; i < fsn_record_bytes[section]; i++) {
        r[i] = (uint8_t)(i + 1);
    }
    for (unsigned i = 0; i < names; i++) {
        memset(r + 4 * i, 0, 4);
        r[4 * i] = 1;
    }
    return r;
}

enum { BYTES_4 = 0x04030201, STEP_4 = 0x01010101, BYTES_2 = 0x0201, STEP_2 = 0x0101 };
#define AT4(field) ((uint32_t)(BYTES_4 + (field) * STEP_4))
#define AT2(field) ((uint32_t)(BYTES_2 + (field) * STEP_2))

static void fields_lie_where_the_format_says(void) {
    static const struct build_sm sm[2][2] = {{{1, 20}, {2, 20}}, {{1, 20}, {2, 20}}};
    static const struct build_copy copies[] = {
        {0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}, {0, 6, 1, 6, 6}, {1, 6, 0, 6, 6}};
    static const struct build_symbol symbols[] = {{.sm = 1, .bits = 8, .bit_offset = 96},
                                                  {.sm = 3, .bits = 8, .bit_offset = 96}};
    static const struct build_block blocks[] = {{0, 0, 6}, {0, 6, 6}};
    const struct build build = {.subdevices = 2,
                                .sm = sm,
                                .copies = copies,
                                .pairs = 2,
                                .symbols = symbols,
                                .symbol_count = 2,
                                .blocks = blocks,
                                .block_count = 2};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct fsn_plan *plan = load(bytes, len);
    CHECK(fsn_plan_subdevice_count(plan) == 2 && fsn_plan_sm_count(plan) == 4);
    CHECK(fsn_plan_symbol_count(plan) == 2 && fsn_plan_block_count(plan) == 2);
    CHECK(fsn_plan_copy_count(plan) == 4 && fsn_plan_connection_count(plan) == 2);

    struct fsn_subdevice_info sub;
    (void)count_up(plan, FSN_SEC_SUBDEVICE, 1);
    CHECK(fsn_plan_subdevice(plan, 1, &sub) == FSN_OK && strcmp(sub.name, "t") == 0);
    CHECK(sub.alias == AT2(4) && sub.position == AT2(6) && sub.vendor_id == AT4(8));
    CHECK(sub.product_code == AT4(12) && sub.revision_low == AT4(16));
    CHECK(sub.revision_high == AT4(20) && sub.first_sm == AT4(24) && sub.sm_count == AT4(28));
    CHECK(sub.first_sdo == AT4(32) && sub.sdo_count == AT4(36));
    CHECK(sub.assign_activate == AT2(40) && sub.in_copy == 1);
    CHECK(fsn_plan_subdevice(plan, 2, &sub) == FSN_E_ARG);

    struct fsn_sm_info info;
    uint8_t *r = count_up(plan, FSN_SEC_SM, 0);
    CHECK(fsn_plan_sm(plan, 1, &info) == FSN_OK && info.subdevice == AT4(0));
    CHECK(info.index == 5 && info.direction == 6 && info.watchdog == 7 && info.registered == 0);
    CHECK(info.bits == AT4(8) && info.size_bytes == (AT4(8) + 7) / 8);
    CHECK(info.first_pdo == AT4(12) && info.pdo_count == AT4(16));
    r[7] = 3;
    CHECK(fsn_plan_sm(plan, 1, &info) == FSN_OK && info.registered == 1);
    CHECK(fsn_plan_sm(plan, 4, &info) == FSN_E_ARG);

    struct fsn_symbol_info symbol;
    r = count_up(plan, FSN_SEC_SYMBOL, 1);
    const double factor = 1.25;
    const double offset = -3.5;
    put_real(r + 28, factor);
    put_real(r + 36, offset);
    r[15] = 1;
    CHECK(fsn_plan_symbol(plan, 1, &symbol) == FSN_OK && strcmp(symbol.name, "t") == 0);
    CHECK(symbol.sm == AT4(4) && symbol.bit_offset == AT4(8) && symbol.bits == AT2(12));
    CHECK(symbol.kind == 15 && symbol.output == 1 && symbol.restart_relevant == 0);
    CHECK(symbol.stop_value == (AT4(20) | (uint64_t)AT4(24) << 32));
    CHECK(memcmp(&symbol.factor, &factor, 8) == 0 && memcmp(&symbol.offset, &offset, 8) == 0);
    r[15] = 2;
    CHECK(fsn_plan_symbol(plan, 1, &symbol) == FSN_OK && symbol.restart_relevant == 1);
    CHECK(symbol.output == 0 && fsn_plan_symbol(plan, 2, &symbol) == FSN_E_ARG);

    struct fsn_block_info block;
    (void)count_up(plan, FSN_SEC_BLOCK, 0);
    CHECK(fsn_plan_block(plan, 1, &block) == FSN_OK && block.sm == AT4(0));
    CHECK(block.byte_offset == AT4(4) && block.frame_bytes == AT2(8));
    CHECK(block.safe_bytes == AT2(10) && block.copied == 1);
    CHECK(fsn_plan_block(plan, 2, &block) == FSN_E_ARG);

    struct fsn_copy_info copy;
    r = count_up(plan, FSN_SEC_COPY, 0);
    memcpy(r + 20, "\1\0\0\0", 4);
    CHECK(fsn_plan_copy(plan, 1, &copy) == FSN_OK && copy.source_sm == AT4(0));
    CHECK(copy.source_byte == AT4(4) / 8 && copy.destination_sm == AT4(8));
    CHECK(copy.destination_byte == AT4(12) / 8 && copy.size_bytes == AT4(16) / 8);
    CHECK(strcmp(copy.net, "t") == 0 && copy.kind == AT2(24) && copy.connection == AT4(28));
    CHECK(fsn_plan_copy(plan, 4, &copy) == FSN_E_ARG);

    struct fsn_connection_info c;
    r = count_up(plan, FSN_SEC_CONNECTION, 2);
    r[4] = 0;
    memset(r + 36, 0, 4); /* no application parameters */
    CHECK(fsn_plan_connection(plan, 1, &c) == FSN_OK && strcmp(c.name, "t") == 0);
    CHECK(c.net[0] == 0 && c.main_subdevice == AT4(8) && c.sub_subdevice == AT4(12));
    CHECK(c.copy_to_sub == AT4(16) && c.copy_to_main == AT4(20));
    CHECK(c.connection_id == AT2(24) && c.address == AT2(26) && c.watchdog_ms == AT2(28));
    CHECK(c.known == AT2(30) && c.safe_to_sub == AT2(32) && c.safe_to_main == AT2(34));
    CHECK(c.app_bytes == 0 && c.app_crc == 0);
    CHECK(fsn_plan_connection(plan, 2, &c) == FSN_E_ARG);
    fsn_plan_free(plan);
}

/* -- the text of a fingerprint ---------------------------------------------------------------- */

static char text[20000];

__attribute__((format(printf, 1, 2))) static void add(const char *format, ...) {
    const size_t used = strlen(text);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text + used, sizeof text - used, format, arguments);
    va_end(arguments);
}

static void begin(const char *section) {
    snprintf(text, sizeof text, "fsoe-net fingerprint 2 %s\n", section);
}

static void is_of(const struct fsn_fingerprint *made, unsigned section) {
    uint8_t digest[FSN_SHA256_BYTES];
    fsn_sha256(text, strlen(text), digest);
    if (memcmp(digest, made->section[section], sizeof digest) != 0) {
        fprintf(stderr, "section %u has another text than\n%s", section, text);
        exit(1);
    }
}

static void put(uint8_t *at, uint64_t value, unsigned bytes) {
    for (unsigned i = 0; i < bytes; i++) {
        at[i] = (uint8_t)(value >> (8 * i));
    }
}

/** Symbols in their order: sync manager, bit, bits, type, flags, stop value, factor, offset; then
 * by name. */
static const uint64_t symbols[][8] = {
    {0, 48, 8, 3, 1, 0x11, 0x3FF0000000000000, 0x4000000000000001},
    {0, 48, 8, 3, 1, 0x11, 0x3FF0000000000000, 0x4000000000000002},
    {0, 48, 8, 3, 1, 0x11, 0x3FF0000000000002, 0},
    {0, 48, 8, 3, 1, 0x12, 0x3FF0000000000001, 0},
    {0, 48, 8, 3, 3, 0x02, 0x3FF0000000000001, 0},
    {0, 48, 8, 4, 0, 0x01, 0x3FF0000000000001, 0},
    {0, 48, 9, 1, 0, 0x0102030405060708, 0x3FF0000000000001, 0},
    {0, 49, 3, 1, 1, 0, 0x3FF0000000000001, 0},
    {2, 5, 2, 2, 2, 0, 0x3FF0000000000001, 0},
    {2, 5, 2, 2, 2, 0, 0x3FF0000000000001, 0},
    {2, 5, 2, 2, 1, 0, 0x3FF0000000000001, 0}};
enum { SYMBOLS = sizeof symbols / sizeof symbols[0], NAMED = 9 /* the first record */ };

static void fingerprints_are_of_their_text(void) {
    static const struct build_sm sm[2][2] = {{{1, 13}, {2, 13}}, {{1, 13}, {2, 13}}};
    /* The second pair writes lower bytes of its sub than the first one: it comes first. */
    static const struct build_copy copies[] = {
        {0, 0, 1, 6, 6}, {1, 0, 0, 0, 6}, {0, 6, 1, 0, 6}, {1, 6, 0, 6, 6}, {0, 12, 1, 12, 1}};
    static const struct build_block blocks[] = {{0, 0, 6}, {1, 6, 6}};
    static const struct build_symbol some[SYMBOLS] = {
        {.sm = 0, .bits = 8, .bit_offset = 96}, {.sm = 0, .bits = 8, .bit_offset = 96},
        {.sm = 0, .bits = 8, .bit_offset = 96}, {.sm = 0, .bits = 8, .bit_offset = 96},
        {.sm = 0, .bits = 8, .bit_offset = 96}, {.sm = 0, .bits = 8, .bit_offset = 96},
        {.sm = 0, .bits = 8, .bit_offset = 96}, {.sm = 0, .bits = 8, .bit_offset = 96},
        {.sm = 0, .bits = 8, .bit_offset = 96}, {.sm = 0, .bits = 8, .bit_offset = 96},
        {.sm = 0, .bits = 8, .bit_offset = 96}};
    const struct build build = {.subdevices = 2,
                                .sm = sm,
                                .copies = copies,
                                .pairs = 2,
                                .standard = 1,
                                .blocks = blocks,
                                .block_count = 2,
                                .symbols = some,
                                .symbol_count = SYMBOLS,
                                .sdo_count = 3,
                                .cycle_ns = 123456789};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct fsn_plan *plan = load(bytes, len);
    struct fsn_fingerprint made;
    for (unsigned i = 0; i < SYMBOLS; i++) { /* in any order */
        uint8_t *r = record(plan, FSN_SEC_SYMBOL, (i * 7 + 3) % SYMBOLS);
        const uint64_t *s = symbols[i];
        put(r + 4, s[0], 4);
        put(r + 8, s[1], 4);
        put(r + 12, s[2], 2);
        put(r + 14, s[3], 1);
        put(r + 15, s[4], 1);
        put(r + 20, s[5], 8);
        put(r + 28, s[6], 8);
        put(r + 36, s[7], 8);
    }
    for (unsigned i = 0; i < 2; i++) {
        uint8_t *r = record(plan, FSN_SEC_SUBDEVICE, i);
        put(r + 4, 0x100 + i, 2);
        put(r + 6, 0x200 + i, 2);
        put(r + 8, 0x12345678 + i, 4);
        put(r + 12, 0x9ABCDEF0 + i, 4);
        put(r + 16, 0x11111111 + i, 4);
        put(r + 20, 0x22222222 + i, 4);
        put(r + 40, 0x700 + i, 2);
        put(r + 44, i == 0, 4);
        r = record(plan, FSN_SEC_CONNECTION, i);
        put(r + 24, 0x300 + i, 2);
        put(r + 26, 0x400 + i, 2);
        put(r + 28, 0x500 + i, 2);
        put(r + 30, i == 0 ? 2 : 5, 2);
        put(r + 32, 7 + i, 2);
        put(r + 34, 9 + i, 2);
    }
    static const uint8_t sizes[] = {1, 4, 8};
    for (unsigned i = 0; i < 3; i++) {
        uint8_t *r = record(plan, FSN_SEC_SDO, i);
        put(r, 0x8123 + i, 2);
        r[2] = (uint8_t)(0x40 + i);
        r[3] = sizes[i];
        put(r + 8, 0xFEDCBA9876543210, 8);
    }
    for (unsigned i = 0; i < 4; i++) {
        uint8_t *r = record(plan, FSN_SEC_SM, i);
        r[4] = (uint8_t)(2 + i);
        r[6] = (uint8_t)(i % 3);
        put(record(plan, FSN_SEC_PDO, i), 0x1600 + 0x101 * i, 2);
    }
    uint8_t *entry = record(plan, FSN_SEC_ENTRY, 0);
    put(entry, 0x6ABC, 2);
    entry[2] = 0xDE;
    entry[3] = 0;
    put(entry + 4, 0x102, 2);
    entry[6] = 4;
    CHECK(fsn_plan_fingerprint(plan, &made) == FSN_OK);

    begin("devices");
    for (unsigned i = 0; i < 2; i++) {
        add("device %u alias=%u position=%u vendor=0x%08x product=0x%08x revision=0x%08x-0x%08x "
            "dc=0x%04x in_copy=1 name=t driver=%s\n",
            i, 0x100 + i, 0x200 + i, 0x12345678 + i, 0x9ABCDEF0 + i, 0x11111111 + i, 0x22222222 + i,
            0x700 + i, i == 0 ? "t" : "");
    }
    add("sdo 0x8123:40 bytes=1 value=0x0000000000000010\n"
        "sdo 0x8124:41 bytes=4 value=0x0000000076543210\n"
        "sdo 0x8125:42 bytes=8 value=0xfedcba9876543210\n");
    is_of(&made, FSN_FINGERPRINT_DEVICES);

    begin("process_data");
    for (unsigned i = 0; i < 4; i++) {
        add("sm %u.%u direction=%u watchdog=%u bits=104\npdo 0x%04x\n", i / 2, 2 + i, 1 + i % 2,
            i % 3, 0x1600 + 0x101 * i);
        for (unsigned e = 0; e < 13; e++) {
            if (i + e == 0) {
                add("entry 0x6abc:de bits=258 type=4 registered=0\n");
            } else {
                add("entry 0x6000:%02x bits=8 type=3 registered=1\n", e);
            }
        }
    }
    add("frame 0.2 byte=0 bytes=6 safe=1 copied=1\nframe 0.3 byte=6 bytes=6 safe=1 copied=1\n");
    for (unsigned i = 0; i < SYMBOLS; i++) {
        const uint64_t *s = symbols[i];
        add("symbol %u.%u bit=%u bits=%u type=%u output=%u restart=%u stop=0x%016" PRIx64
            " factor=0x%016" PRIx64 " offset=0x%016" PRIx64 " name=%s\n",
            (unsigned)s[0] / 2, (unsigned)s[0] + 2, (unsigned)s[1], (unsigned)s[2], (unsigned)s[3],
            (unsigned)s[4] & 1, (unsigned)s[4] >> 1, s[5], s[6], s[7], i == NAMED ? "t" : "");
    }
    is_of(&made, FSN_FINGERPRINT_PROCESS_DATA);

    begin("copies");
    add("copy from=1.5@0 to=0.2@0 bits=48 kind=1 connection=1 net=t\n"
        "copy from=1.5@48 to=0.2@48 bits=48 kind=1 connection=0 net=t\n"
        "copy from=0.3@48 to=1.4@0 bits=48 kind=1 connection=0 net=t\n"
        "copy from=0.3@0 to=1.4@48 bits=48 kind=1 connection=1 net=t\n"
        "copy from=0.3@96 to=1.4@96 bits=8 kind=2 connection=- net=t\n");
    is_of(&made, FSN_FINGERPRINT_COPIES);

    begin("connections");
    add("connection 0 main=0 sub=1 id=%u address=- watchdog_ms=%u safe_to_sub=8 safe_to_main=10 "
        "app_parameters= name=t net=t\n"
        "connection 1 main=0 sub=1 id=- address=%u watchdog_ms=- safe_to_sub=7 safe_to_main=9 "
        "app_parameters= name=t net=t\n",
        0x301, 0x501, 0x400);
    is_of(&made, FSN_FINGERPRINT_CONNECTIONS);

    begin("cycle");
    add("cycle_ns=123456789\n");
    is_of(&made, FSN_FINGERPRINT_CYCLE);
    begin("safety_functions");
    is_of(&made, FSN_FINGERPRINT_SAFETY_FUNCTIONS);

    static const char *const sections[] = {"devices",     "process_data", "copies",
                                           "connections", "cycle",        "safety_functions"};
    snprintf(text, sizeof text, "fsoe-net fingerprint 2\n");
    for (unsigned i = 0; i < FSN_FINGERPRINT_SECTIONS; i++) {
        CHECK(strcmp(fsn_fingerprint_section(i), sections[i]) == 0);
        add("%s ", sections[i]);
        for (unsigned b = 0; b < FSN_SHA256_BYTES; b++) {
            add("%02x", made.section[i][b]);
        }
        add("\n");
    }
    uint8_t digest[FSN_SHA256_BYTES];
    fsn_sha256(text, strlen(text), digest);
    CHECK(memcmp(digest, made.whole, sizeof digest) == 0);

    /* Names are compared by byte; an unknown cycle time is absent. */
    plan->cycle_ns = 0;
    uint8_t *strings = plan->bytes + plan->offset[FSN_SEC_STRINGS];
    static const uint8_t odd[] = {0x20, 0x21, 0x25, 0x7E, 0x7F, 0x80, 0xFF, 'a'};
    for (unsigned i = 0; i < sizeof odd; i++) {
        strings[1] = odd[i];
        CHECK(fsn_plan_fingerprint(plan, &made) == FSN_OK);
        begin("copies");
        const bool plain = odd[i] == 0x21 || odd[i] == 0x7E || odd[i] == 'a';
        char word[8];
        snprintf(word, sizeof word, plain ? "%c" : "%%%02X", odd[i]);
        add("copy from=1.5@0 to=0.2@0 bits=48 kind=1 connection=1 net=%s\n"
            "copy from=1.5@48 to=0.2@48 bits=48 kind=1 connection=0 net=%s\n"
            "copy from=0.3@48 to=1.4@0 bits=48 kind=1 connection=0 net=%s\n"
            "copy from=0.3@0 to=1.4@48 bits=48 kind=1 connection=1 net=%s\n"
            "copy from=0.3@96 to=1.4@96 bits=8 kind=2 connection=- net=%s\n",
            word, word, word, word, word);
        is_of(&made, FSN_FINGERPRINT_COPIES);
    }
    begin("cycle");
    add("cycle_ns=-\n");
    is_of(&made, FSN_FINGERPRINT_CYCLE);
    CHECK(fsn_plan_fingerprint(plan, NULL) == FSN_E_ARG);
    fsn_plan_free(plan);
}

int main(void) {
    const long alive = heap_alive();
    fields_lie_where_the_format_says();
    fingerprints_are_of_their_text();
    CHECK(heap_alive() == alive);
    return 0;
}
