/** Typed bytes, writable objects, diagnosis messages and SII contents, without a bus. */
/* shows R20 */
#include <stdio.h>
#include <string.h>

#include "builder.h"
#include "control/jobs/job.h"
#include "control/survey/member.h"
#include "fsn/fsn.h"

static void values_have_types(void) {
    static const struct {
        const char *type, *text, *hex, *written; /* hex NULL: refused */
    } rows[] = {
        {"int8", "-1", "ff", "-1"},
        {"int16", "-32768", "0080", "-32768"},
        {"int32", "0x7fffffff", "ffffff7f", "2147483647"},
        {"int64", "-1", "ffffffffffffffff", "-1"},
        {"uint8", "0b101", "05", "5"},
        {"uint16", "0o17", "0f00", "15"},
        {"uint32", "4294967295", "ffffffff", "4294967295"},
        {"uint64", "0xffffffffffffffff", "ffffffffffffffff", "18446744073709551615"},
        {"real32", "1.5", "0000c03f", "1.5"},
        {"real64", "-2", "00000000000000c0", "-2"},
        {"bool", "true", "01", "true"},
        {"bool", "0", "00", "false"},
        {"string", "a\"b", "612262", "\"a\\\"b\""},
        {"string", "", "", "\"\""},
        {"hex", "0A1bff", "0a1bff", NULL},
        {"hex", "", "", NULL},
        {"hex", "0x12", NULL, NULL},
        {"hex", "123", NULL, NULL},
        {"hex", "0g", NULL, NULL},
        {"hex", "@0", NULL, NULL},
        {"hex", "1:", NULL, NULL},
        {"hex", "0G", NULL, NULL},
        {"hex", "`0", NULL, NULL},
        {"hex", "/0", NULL, NULL},
        {"uint8", "0Xff", "ff", "255"},
        {"uint8", "0y1", NULL, NULL},
        {"uint16", "0x0x1", NULL, NULL},
        {"uint16", "0x0X1", NULL, NULL},
        {"uint16", "0x01X", NULL, NULL},
        {"uint16", "0x01", "0100", "1"},
        {"int8", "+5", "05", "5"},
        {"bool", "off", "00", "false"},
        {"bool", "on", "01", "true"},
        {"bool", "1", "01", "true"},
        {"int8", "128", NULL, NULL},
        {"uint8", "-1", NULL, NULL},
        {"uint16", "0x1 ", NULL, NULL},
        {"real32", "nan", NULL, NULL},
        {"real32", "1e39", NULL, NULL},
        {"bool", "2", NULL, NULL},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct fsn_data_type type;
        uint8_t bytes[32];
        uint32_t size = 0;
        char expected[160];
        struct fsn_json json = {.limit_bytes = 1000};
        CHECK(fsn_data_type_read(rows[i].type, &type));
        const char *wrong = fsn_data_parse(&type, rows[i].text, bytes, &size);
        CHECK((wrong == NULL) == (rows[i].hex != NULL));
        if (wrong != NULL) {
            continue;
        }
        fsn_json_open(&json, '{');
        fsn_data_write(&type, bytes, size, &json);
        fsn_json_close(&json, '}');
        snprintf(expected, sizeof expected, "{\"data\":\"%s\",\"bytes\":%u%s%s}", rows[i].hex,
                 (unsigned)size, rows[i].written != NULL ? ",\"value\":" : "",
                 rows[i].written != NULL ? rows[i].written : "");
        CHECK(json.len_bytes == strlen(expected));
        CHECK(memcmp(json.bytes, expected, json.len_bytes) == 0);
        fsn_json_free(&json);
    }
    struct fsn_data_type type;
    CHECK(!fsn_data_type_read("int24", &type) && !fsn_data_type_read("", &type));
}

/** SubDevices 0 and 1 have a connection, 2 has none. */
static void safety_objects_are_not_written(void) {
    static const struct build_sm sm[3][2] = {{{1, 9}, {2, 8}}, {{1, 8}, {2, 8}}, {{1, 1}, {2, 1}}};
    static const struct build_copy pair[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}};
    static const struct build_block frames[] = {{0, 0, 6}, {1, 0, 6}, {2, 0, 6}, {3, 0, 6}};
    const struct build build = {.subdevices = 3,
                                .sm = sm,
                                .copies = pair,
                                .pairs = 1,
                                .blocks = frames,
                                .block_count = 4,
                                .cycle_ns = 1000000};
    static const struct {
        uint16_t index;
        bool safety, other, other_running; /* refused on which */
    } rows[] = {
        {0x6000, true, false, false}, /* mapped into frames, and into none */
        {0x2000, false, false, false}, {0x1011, true, false, false},  {0x15FF, false, false, false},
        {0x1600, true, false, true},   {0x1A00, true, false, true},   {0x1BFF, true, false, true},
        {0x1C00, true, false, true},   {0x1C12, true, false, true},   {0x1C3F, true, false, true},
        {0x1C40, false, false, false}, {0x65FF, false, false, false}, {0x6600, true, false, false},
        {0x6640, true, false, false},  {0x67FF, true, false, false},  {0x6800, false, false, false},
        {0x7FFF, false, false, false}, {0x8000, true, false, false},  {0x800F, true, false, false},
        {0x8010, false, false, false}, {0x9001, true, false, false},  {0x9011, false, false, false},
        {0xA000, true, false, false},  {0xAFF0, false, false, false}, {0xB000, false, false, false},
        {0xDFFF, false, false, false}, {0xE000, true, true, true},    {0xE901, true, true, true},
        {0xEFFF, true, true, true},    {0xF000, false, false, false}, {0xF97F, false, false, false},
        {0xF980, true, true, true},    {0xF98F, true, true, true},    {0xF990, false, false, false},
    };
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct fsn_plan *plan;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const uint16_t index = rows[i].index;
        CHECK((fsn_guard_write(plan, 0, index, false) != NULL) == rows[i].safety);
        CHECK((fsn_guard_write(plan, 1, index, true) != NULL) == rows[i].safety);
        CHECK((fsn_guard_write(plan, 2, index, false) != NULL) == rows[i].other);
        CHECK((fsn_guard_write(plan, 2, index, true) != NULL) == rows[i].other_running);
    }
    fsn_plan_free(plan);
    free(bytes);
}

static void messages_are_decoded(void) {
    static const uint8_t message[] = {
        0x11, 0x22, 0x33, 0x44, 0x01, 0x06, 0x78, 0x56, 1,   0, 0,    0,    0,   0,
        0,    0,    0x02, 0x00, 0xFF, 0x03, 0x10, 1,    2,   3, 0x02, 0x20, 'h', 'i',
        0x00, 0x40, 0x34, 0x12, 0x04, 0x30, 'a',  0,    'b', 0, 0x99, 0x00, 1};
    static const char expected[] =
        "{\"subindex\":6,\"id\":1144201745,\"flags\":1537,\"time_ns\":1,\"text_id\":22136,"
        "\"kind\":\"warning\",\"parameters\":[-1,\"010203\",\"hi\",4660,\"ab\"],\"data\":\"";
    for (uint32_t size = 0; size <= sizeof message; size++) {
        uint8_t *room = malloc(size + 1);
        struct fsn_json json = {.limit_bytes = 10000};
        CHECK(room != NULL);
        memcpy(room, message, size);
        uint8_t *exact = realloc(room, size > 0 ? size : 1);
        CHECK(exact != NULL);
        CHECK(fsn_history_message(exact, size, 6, &json) == (size >= 16));
        CHECK(size < sizeof message || memcmp(json.bytes, expected, sizeof expected - 1) == 0);
        fsn_json_free(&json);
        free(exact);
    }
}

/** Every type of a parameter, and what is not a type: the rest of it stays in `data` only. */
static void parameters_have_types(void) {
    static const struct {
        uint8_t bytes[12];
        uint32_t size;
        const char *shown;
    } rows[] = {
        {{0x01, 0x00, 2}, 3, "true"},
        {{0x01, 0x00, 0}, 3, "false"},
        {{0x02, 0x00, 0x80}, 3, "-128"},
        {{0x03, 0x00, 0xFE, 0xFF}, 4, "-2"},
        {{0x04, 0x00, 0xFE, 0xFF, 0xFF, 0x7F}, 6, "2147483646"},
        {{0x05, 0x00, 0x80}, 3, "128"},
        {{0x06, 0x00, 0xFE, 0xFF}, 4, "65534"},
        {{0x07, 0x00, 1, 0, 0, 0x80}, 6, "2147483649"},
        {{0x08, 0x00, 0, 0, 0xC0, 0x3F}, 6, "1.5"},
        {{0x11, 0x00, 0, 0, 0, 0, 0, 0, 0, 0xC0}, 10, "-2"},
        {{0x11, 0x00, 0, 0, 0, 0, 0, 0, 0xF0, 0x7F}, 10, "null"},
        {{0x15, 0x00, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}, 10, "-1"},
        {{0x1B, 0x00, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}, 10, "18446744073709551615"},
        {{0x1E, 0x00, 0xFF}, 3, "255"},
        {{0x1F, 0x00, 0xFF, 1}, 4, "511"},
        {{0x20, 0x00, 1, 0, 0, 1}, 6, "16777217"},
        {{0x05, 0x00}, 2, ""},
        {{0x09, 0x00, 1, 2, 3}, 5, ""},
        {{0x02, 0x10, 0xAB, 0xCD}, 4, "\"abcd\""},
        {{0x00, 0x10}, 2, "\"\""},
        {{0x02, 0x20, 'o', 0xFF}, 4, "\"o\\ufffd\""},
        {{0x05, 0x30, 'o', 0, 'k', 1, 'x'}, 7, "\"o?\""},
        {{0x04, 0x30, 0x80, 0, 0x7F, 0}, 6, "\"?\\u007f\""},
        {{0x00, 0x40, 0x34, 0x12}, 4, "4660"},
        {{0x00, 0x40, 0x34}, 3, ""},
        {{0x01, 0x50, 1}, 3, ""},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        uint8_t message[32] = {0, 0, 0, 0, 2, 1};
        char expected[300] = "";
        struct fsn_json json = {.limit_bytes = 10000};
        memcpy(message + 16, rows[i].bytes, rows[i].size);
        CHECK(fsn_history_message(message, 16 + rows[i].size, 6, &json));
        const int used =
            snprintf(expected, sizeof expected,
                     "{\"subindex\":6,\"id\":0,\"flags\":258,\"time_ns\":0,\"text_id\":0,"
                     "\"kind\":\"error\",\"parameters\":[%s],\"data\":\"",
                     rows[i].shown);
        if (json.len_bytes < (size_t)used || memcmp(json.bytes, expected, (size_t)used) != 0) {
            fprintf(stderr, "row %zu: %.*s\n", i, (int)json.len_bytes, json.bytes);
            exit(1);
        }
        fsn_json_free(&json);
    }
}

static uint8_t sii[0x80 + 200];

static size_t category(size_t at, uint16_t type, const void *bytes, size_t len) {
    sii[at] = (uint8_t)type;
    sii[at + 1] = (uint8_t)(type >> 8);
    sii[at + 2] = (uint8_t)(len / 2);
    sii[at + 3] = 0;
    memcpy(sii + at + 4, bytes, len);
    return at + 4 + len;
}

static void an_sii_is_believed_as_far_as_it_goes(void) {
    static const uint8_t strings[] = {2, 3, 'a', 'b', 'c', 2, 'x', 'y'};
    static const uint8_t general[] = {0, 0, 2, 1};
    static const uint8_t pdos[] = {0, 0x1A, 1, 3, 0, 2, 0, 0, 0, 0x60, 1, 0, 0, 8, 0, 0};
    size_t at = category(0x80, 10, strings, sizeof strings);
    at = category(at, 30, general, sizeof general);
    at = category(at, 50, pdos, sizeof pdos);
    sii[at] = sii[at + 1] = 0xFF;
    char name[4 * FSN_NAME_BYTES];
    for (size_t cut = 0; cut <= at + 4; cut++) { /* wherever it ends, later bytes are unchanged */
        uint8_t *bytes = malloc(cut + 1);
        CHECK(bytes != NULL);
        memcpy(bytes, sii, cut);
        uint8_t *exact = realloc(bytes, cut > 0 ? cut : 1);
        const struct fsn_sii of = {exact, (uint32_t)cut};
        struct fsn_sii_pdo pdo;
        uint32_t from = 0;
        uint32_t inside = 0;
        const bool named = fsn_survey_sii_name(&of, name);
        const bool mapped = fsn_survey_sii_pdo(&of, false, &from, &inside, &pdo);
        CHECK(!named || strcmp(name, "abc") == 0);
        CHECK(cut < at + 4 || (named && mapped && pdo.index == 0x1A00 && pdo.entries == 1));
        CHECK(!mapped || !fsn_survey_sii_pdo(&of, false, &from, &inside, &pdo));
        from = inside = 0;
        CHECK(!fsn_survey_sii_pdo(&of, true, &from, &inside, &pdo));
        CHECK(!fsn_survey_sii_string(&of, 3, name) && !fsn_survey_sii_string(&of, 0, name));
        free(exact);
    }
}

int main(void) {
    values_have_types();
    safety_objects_are_not_written();
    messages_are_decoded();
    parameters_have_types();
    an_sii_is_believed_as_far_as_it_goes();
    return 0;
}
