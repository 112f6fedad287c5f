/** Requests, values, JSON and leases of the control socket, without a socket. */
#include <string.h>

#include "control/base/json.h"
#include "control/base/value.h"
#include "control/base/words.h"
#include "control/outputs/outputs.h"
#include "emulated_rig.h"
#include "plan/plan_internal.h"

/** The line gets exactly the room it may use, so that ASan sees a reach beyond it. */
static const char *split(const char *text, size_t len, struct fsn_words *words, char **room) {
    *room = malloc(len + 1);
    CHECK(*room != NULL);
    memcpy(*room, text, len);
    return fsn_words_split(*room, len, words);
}

static void lines_are_split(void) {
    static const struct {
        const char *line;
        const char *word[4]; /* NULL: refused */
    } good[] = {
        {"status", {"status"}},
        {"  get  a\tb ", {"get", "a", "b"}},
        {"set \"a b\"=1", {"set", "a b=1"}},
        {"set a=\"x \\\" \\\\ \\n\"", {"set", "a=x \" \\ \\n"}},
        {"\"\" x", {"", "x"}},
        {"a\"\"b", {"ab"}},
        {"\xc3\xa9t\xc3\xa9", {"\xc3\xa9t\xc3\xa9"}},
    };
    static const char *const bad[] = {"",
                                      "   ",
                                      "\"",
                                      "a \"b",
                                      "a\x01",
                                      "\x7f",
                                      "\xff",
                                      "a \xc3",
                                      "\xc0\x80",
                                      "\xed\xa0\x80",
                                      "\xf4\x90\x80\x80",
                                      "a\rb"};
    struct fsn_words words;
    char *room;
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        CHECK(split(good[i].line, strlen(good[i].line), &words, &room) == NULL);
        for (size_t w = 0; w < 4; w++) {
            const char *expected = good[i].word[w];
            CHECK((w < words.count) == (expected != NULL));
            CHECK(expected == NULL || strcmp(words.word[w], expected) == 0);
        }
        free(room);
    }
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        CHECK(split(bad[i], strlen(bad[i]), &words, &room) != NULL);
        free(room);
    }
    CHECK(split("a\0b", 3, &words, &room) != NULL);
    free(room);
    char many[2 * FSN_WORDS + 2];
    for (size_t i = 0; i < sizeof many; i++) {
        many[i] = i % 2 == 0 ? 'a' : ' ';
    }
    CHECK(split(many, 2 * FSN_WORDS, &words, &room) == NULL && words.count == FSN_WORDS);
    free(room);
    CHECK(split(many, sizeof many, &words, &room) != NULL);
    free(room);
}

static void json_is_escaped_and_bounded(void) {
    struct fsn_json json = {.limit_bytes = 200};
    fsn_json_open(&json, '{');
    /* CSI of one byte, right-to-left override, a letter, a character above 0xFFFF */
    fsn_json_put_text(&json, "a", "\"\\\n\x7f\xff\xc2\x9b\xe2\x80\xae\xc3\xa9\xf0\x9f\x98\x80");
    fsn_json_key(&json, "b");
    fsn_json_open(&json, '[');
    fsn_json_i64(&json, INT64_MIN);
    fsn_json_u64(&json, UINT64_MAX);
    fsn_json_real(&json, 0.5);
    const double zero = 0;
    fsn_json_real(&json, 1 / zero);
    fsn_json_bool(&json, true);
    fsn_json_close(&json, ']');
    fsn_json_close(&json, '}');
    static const char expected[] =
        "{\"a\":\"\\\"\\\\\\u000a\\u007f\\ufffd\\u009b\\u202e\xc3\xa9\xf0\x9f\x98\x80\",\"b\":[-"
        "9223372036854775808,"
        "18446744073709551615,0.5,null,true]}";
    CHECK(!json.failed && json.len_bytes == sizeof expected - 1);
    CHECK(memcmp(json.bytes, expected, json.len_bytes) == 0);
    for (int i = 0; i < 100; i++) {
        fsn_json_u64(&json, 1000000);
    }
    CHECK(json.failed && json.len_bytes <= 200 && json.room_bytes <= 200);
    fsn_json_free(&json);
    CHECK(json.bytes == NULL && json.limit_bytes == 200);
}

struct row {
    uint8_t kind;
    uint16_t bits;
    const char *text;
    bool ok;
    uint64_t raw;
    const char *written; /* NULL: not looked at */
};

static const struct row rows[] = {
    {FSN_KIND_BOOL, 1, "true", true, 1, "true"},
    {FSN_KIND_BOOL, 1, "off", true, 0, "false"},
    {FSN_KIND_BOOL, 1, "2", false, 0, NULL},
    {FSN_KIND_BITS, 1, "1", true, 1, "1"},
    {FSN_KIND_BITS, 4, "0xF", true, 15, "15"},
    {FSN_KIND_BITS, 4, "16", false, 0, NULL},
    {FSN_KIND_UNSIGNED, 8, "0b1010", true, 10, "10"},
    {FSN_KIND_UNSIGNED, 8, "0o17", true, 15, "15"},
    {FSN_KIND_UNSIGNED, 8, "-1", false, 0, NULL},
    {FSN_KIND_UNSIGNED, 8, "-0", true, 0, "0"},
    {FSN_KIND_UNSIGNED, 8, "256", false, 0, NULL},
    {FSN_KIND_UNSIGNED, 64, "18446744073709551615", true, UINT64_MAX, "18446744073709551615"},
    {FSN_KIND_UNSIGNED, 64, "18446744073709551616", false, 0, NULL},
    {FSN_KIND_UNSIGNED, 16, "", false, 0, NULL},
    {FSN_KIND_UNSIGNED, 16, "- 1", false, 0, NULL},
    {FSN_KIND_UNSIGNED, 16, "+-1", false, 0, NULL},
    {FSN_KIND_UNSIGNED, 16, "0x", false, 0, NULL},
    {FSN_KIND_UNSIGNED, 16, "0x0x1", false, 0, NULL},
    {FSN_KIND_UNSIGNED, 16, "1 ", false, 0, NULL},
    {FSN_KIND_UNSIGNED, 16, "1.0", false, 0, NULL},
    {FSN_KIND_SIGNED, 8, "-128", true, 0x80, "-128"},
    {FSN_KIND_SIGNED, 8, "-129", false, 0, NULL},
    {FSN_KIND_SIGNED, 8, "127", true, 0x7F, "127"},
    {FSN_KIND_SIGNED, 8, "128", false, 0, NULL},
    {FSN_KIND_SIGNED, 8, "-0x10", true, 0xF0, "-16"},
    {FSN_KIND_SIGNED, 64, "-9223372036854775808", true, UINT64_C(1) << 63, "-9223372036854775808"},
    {FSN_KIND_SIGNED, 64, "9223372036854775808", false, 0, NULL},
    {FSN_KIND_REAL, 32, "-1.5", true, 0xBFC00000, "-1.5"},
    {FSN_KIND_REAL, 32, "1e39", false, 0, NULL},
    {FSN_KIND_REAL, 64, "1e39", true, 0x48078287F49C4A1D, NULL},
    {FSN_KIND_REAL, 64, "nan", false, 0, NULL},
    {FSN_KIND_REAL, 64, "inf", false, 0, NULL},
    {FSN_KIND_REAL, 64, "1e999", false, 0, NULL},
    {FSN_KIND_REAL, 64, " 1", false, 0, NULL},
    {FSN_KIND_REAL, 64, ".", false, 0, NULL},
    {FSN_KIND_REAL, 16, "3", true, 3, "3"}, /* no such float: bits */
};

static void texts_are_shown_as_far_as_there_is_room(void) {
    char room[FSN_SHOWN_BYTES * 3];
    CHECK(fsn_show_text(room, sizeof room, "a\x1b]b") == 9 && strcmp(room, "a\\u001b]b") == 0);
    CHECK(fsn_show_text(room, 1, "a") == 0 && room[0] == '\0');
    for (size_t size = 1; size <= sizeof room; size++) {
        memset(room, 'x', sizeof room);
        const size_t len = fsn_show_text(room, size, "\x1b\x1b\x1b\x1b");
        CHECK(len < size && room[len] == '\0' && len % 6 == 0);
    }
}

static void values_are_typed(void) {
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct row *row = &rows[i];
        const struct fsn_symbol_info symbol = {.kind = row->kind, .bits = row->bits};
        uint64_t raw = 0;
        const char *wrong = fsn_value_parse(&symbol, row->text, &raw);
        if ((wrong == NULL) != row->ok || raw != row->raw) {
            fprintf(stderr, "row %zu: %s\n", i, row->text);
        }
        CHECK((wrong == NULL) == row->ok && (!row->ok || raw == row->raw));
        if (row->written != NULL) {
            struct fsn_json json = {.limit_bytes = 64};
            fsn_value_write(&symbol, raw, &json);
            CHECK(json.len_bytes == strlen(row->written));
            CHECK(memcmp(json.bytes, row->written, json.len_bytes) == 0);
            fsn_json_free(&json);
        }
    }
}

/** Values in the units of a symbol; `text` is written, `written` is read back. */
static void values_are_scaled(void) {
    static const struct {
        struct fsn_symbol_info symbol;
        const char *text;
        bool ok;
        uint64_t raw;
        const char *written;
    } scaled[] = {
        {{.kind = FSN_KIND_SIGNED, .bits = 16, .factor = 0.5, .offset = 1},
         "-7",
         true,
         0xFFFD,
         "-0.5"},
        {{.kind = FSN_KIND_SIGNED, .bits = 16, .factor = 0.5, .offset = 1, .output = 1},
         "-7",
         true,
         0xFFFD,
         "-8"}, /* -2.5 is rounded away from 0 */
        {{.kind = FSN_KIND_UNSIGNED, .bits = 8, .factor = 10, .output = 1},
         "25.5",
         true,
         255,
         "25.5"},
        {{.kind = FSN_KIND_UNSIGNED, .bits = 8, .factor = 10, .output = 1}, "25.6", false, 0, NULL},
        {{.kind = FSN_KIND_UNSIGNED, .bits = 8, .factor = 10, .output = 1}, "-1", false, 0, NULL},
        {{.kind = FSN_KIND_SIGNED, .bits = 64, .factor = 2, .output = 1},
         "-4611686018427387904",
         true,
         UINT64_C(1) << 63,
         "-4.6116860184273879e+18"},
        {{.kind = FSN_KIND_SIGNED, .bits = 64, .factor = 2, .output = 1},
         "4611686018427387904",
         false,
         0,
         NULL},
        {{.kind = FSN_KIND_REAL, .bits = 32, .factor = 2, .output = 1},
         "1e38",
         true,
         0x7F167699,
         NULL},
        {{.kind = FSN_KIND_REAL, .bits = 32, .factor = 4, .output = 1}, "1e38", false, 0, NULL},
        {{.kind = FSN_KIND_UNSIGNED, .bits = 8, .factor = 2, .output = 1}, "nan", false, 0, NULL},
        {{.kind = FSN_KIND_UNSIGNED, .bits = 64, .factor = 1},
         "0xFFFFFFFFFFFFFFFF",
         true,
         UINT64_MAX,
         "18446744073709551615"}, /* without a scale nothing is lost */
        {{.kind = FSN_KIND_BOOL, .bits = 1, .factor = 3}, "on", true, 1, "true"},
    };
    for (size_t i = 0; i < sizeof scaled / sizeof scaled[0]; i++) {
        uint64_t raw = 0;
        const char *wrong = fsn_value_parse_typed(&scaled[i].symbol, scaled[i].text, &raw);
        if ((wrong == NULL) != scaled[i].ok || raw != scaled[i].raw) {
            fprintf(stderr, "row %zu: %s gave 0x%llx\n", i, scaled[i].text,
                    (unsigned long long)raw);
        }
        CHECK((wrong == NULL) == scaled[i].ok && raw == scaled[i].raw);
        if (scaled[i].written != NULL) {
            struct fsn_json json = {.limit_bytes = 64};
            fsn_value_write_typed(&scaled[i].symbol, raw, &json);
            char text[64];
            snprintf(text, sizeof text, "%.*s", (int)json.len_bytes, json.bytes);
            if (strcmp(text, scaled[i].written) != 0) {
                fprintf(stderr, "row %zu: written as %s\n", i, text);
            }
            CHECK(strcmp(text, scaled[i].written) == 0);
            fsn_json_free(&json);
        }
    }
}

enum { OUTPUT, INPUT, COPIED, START, SYMBOLS };

struct rig {
    struct emulated_rig on;
    struct fsn_outputs *outputs;
    unsigned fell;
    struct fsn_refusal refusal;
};

static struct rig set_up(void) {
    static const struct build_sm sm[2][2] = {{{1, 9}, {2, 8}}, {{1, 8}, {2, 8}}};
    static const struct build_copy copies[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}, {0, 6, 1, 6, 1}};
    static const struct build_symbol symbols[SYMBOLS] = {
        [OUTPUT] = {.sm = 0, .bit_offset = 48, .bits = 8, .stop_value = 0x5A},
        [INPUT] = {.sm = 1, .bit_offset = 48, .bits = 8},
        [COPIED] = {.sm = 2, .bit_offset = 48, .bits = 8},
        [START] = {.sm = 0, .bit_offset = 56, .bits = 8, .restart_relevant = 1},
    };
    const struct build build = {.subdevices = 2,
                                .sm = sm,
                                .copies = copies,
                                .pairs = 1,
                                .standard = 1,
                                .symbols = symbols,
                                .symbol_count = SYMBOLS};
    struct rig rig = {.on = emulated_rig_build(&build)};
    rig.outputs = fsn_outputs_create(rig.on.plan);
    CHECK(rig.outputs != NULL);
    return rig;
}

static void tear_down(struct rig *rig) {
    fsn_outputs_free(rig->outputs);
    emulated_rig_end(&rig->on);
}

static uint8_t sent(struct rig *rig, size_t byte) {
    uint8_t out[9];
    emulated_rig_cycle(&rig->on);
    CHECK(fsn_emulated_read_outputs(rig->on.bus, 0, out, sizeof out, NULL) == FSN_OK);
    return out[byte];
}

static fsn_status write_one(struct rig *rig, uint32_t symbol, uint32_t client, uint64_t raw) {
    const fsn_status status =
        fsn_outputs_check(rig->outputs, symbol, client, raw, rig->on.now_ns, &rig->refusal);
    if (status == FSN_OK) {
        struct fsn_wanted wanted = {.symbol = symbol, .raw = raw};
        fsn_outputs_write(rig->outputs, client, &wanted, 1);
    }
    return status;
}

static void count(void *self, uint32_t symbol) {
    struct rig *rig = self;
    (void)symbol;
    rig->fell++;
}

static void an_output_belongs_to_one_client(void) {
    struct rig rig = set_up();
    CHECK(write_one(&rig, OUTPUT, 1, 1) == FSN_E_STATE); /* no core yet */
    fsn_outputs_attach(rig.outputs, rig.on.core);
    CHECK(sent(&rig, 6) == 0x5A); /* without a writer: its stop value */
    CHECK(write_one(&rig, OUTPUT, 1, 7) == FSN_OK && sent(&rig, 6) == 7);
    CHECK(write_one(&rig, OUTPUT, 2, 8) == FSN_E_CLOSED);
    CHECK(strstr(rig.refusal.text, "client 1") != NULL);
    CHECK(write_one(&rig, INPUT, 1, 1) == FSN_E_CLOSED);
    CHECK(write_one(&rig, COPIED, 1, 1) == FSN_E_CLOSED);
    CHECK(fsn_outputs_take_back(rig.outputs, 2, count, &rig) == 0 && sent(&rig, 6) == 7);
    CHECK(fsn_outputs_take_back(rig.outputs, 1, count, &rig) == 1 && rig.fell == 1);
    CHECK(sent(&rig, 6) == 0x5A);
    CHECK(fsn_outputs_take_back(rig.outputs, 1, count, &rig) == 0);
    CHECK(write_one(&rig, OUTPUT, 2, 8) == FSN_OK && sent(&rig, 6) == 8);
    fsn_outputs_close(rig.outputs, count, &rig);
    CHECK(rig.fell == 2 && sent(&rig, 6) == 0x5A);
    CHECK(write_one(&rig, OUTPUT, 2, 8) == FSN_E_STATE);
    fsn_outputs_attach(rig.outputs, NULL);
    CHECK(write_one(&rig, OUTPUT, 2, 8) == FSN_E_STATE);
    CHECK(!fsn_outputs_state(rig.outputs, OUTPUT).open);
    tear_down(&rig);
}

static fsn_status arm(struct rig *rig, uint32_t symbol, uint32_t client) {
    return fsn_outputs_arm(rig->outputs, symbol, client, rig->on.now_ns, &rig->refusal);
}

static void arming_allows_one_edge(void) {
    struct rig rig = set_up();
    fsn_outputs_attach(rig.outputs, rig.on.core);
    CHECK(write_one(&rig, START, 1, 1) == FSN_E_CLOSED);
    CHECK(write_one(&rig, START, 1, 0) == FSN_OK); /* no edge */
    CHECK(arm(&rig, OUTPUT, 1) == FSN_E_ARG && arm(&rig, INPUT, 1) == FSN_E_CLOSED);
    CHECK(arm(&rig, START, 2) == FSN_E_CLOSED); /* client 1 has it */
    CHECK(arm(&rig, START, 1) == FSN_OK);
    CHECK(write_one(&rig, START, 1, 1) == FSN_OK && sent(&rig, 7) == 1);
    CHECK(write_one(&rig, START, 1, 1) == FSN_OK);       /* no edge */
    CHECK(write_one(&rig, START, 1, 3) == FSN_E_CLOSED); /* a second one */
    CHECK(write_one(&rig, START, 1, 0) == FSN_OK && sent(&rig, 7) == 0);
    CHECK(write_one(&rig, START, 1, 1) == FSN_E_CLOSED);
    CHECK(arm(&rig, START, 1) == FSN_OK);
    rig.on.now_ns += (uint64_t)FSN_ARM_MS * 1000000;
    CHECK(write_one(&rig, START, 1, 1) == FSN_E_CLOSED); /* too late */
    CHECK(arm(&rig, START, 1) == FSN_OK);
    CHECK(fsn_outputs_take_back(rig.outputs, 1, count, &rig) == 1);
    CHECK(write_one(&rig, START, 1, 1) == FSN_E_CLOSED); /* taken back with the rest */
    CHECK(arm(&rig, START, 1) == FSN_OK && arm(&rig, START, 2) == FSN_E_CLOSED);
    CHECK(write_one(&rig, START, 2, 1) == FSN_E_CLOSED);
    tear_down(&rig);
}

/** Both values of one write are in the next cycle, and the edge is the one that is restart
 * relevant.
 */
static void values_go_out_together(void) {
    struct rig rig = set_up();
    fsn_outputs_attach(rig.outputs, rig.on.core);
    CHECK(arm(&rig, START, 1) == FSN_OK);
    struct fsn_wanted wanted[] = {{.symbol = OUTPUT, .raw = 9}, {.symbol = START, .raw = 1}};
    fsn_outputs_write(rig.outputs, 1, wanted, 2);
    CHECK(!wanted[0].edge && wanted[1].edge);
    CHECK(sent(&rig, 6) == 9);
    CHECK(sent(&rig, 7) == 1);
    tear_down(&rig);
}

/** The first and the last character of each length, and those next to them. */
static void utf8_has_its_bounds(void) {
    static const struct {
        const char *text;
        bool good;
    } cases[] = {
        {"\x7F", true},
        {"\x80", false},
        {"\xBF", false},
        {"\xC1\xBF", false},
        {"\xC2\x80", true},
        {"\xC2\x7F", false},
        {"\xC2\xC0", false},
        {"\xC2", false},
        {"\xDF\xBF", true},
        {"\xE0\x9F\xBF", false},
        {"\xE0\xA0\x80", true},
        {"\xE0\xA0", false},
        {"\xED\x9F\xBF", true},
        {"\xED\xA0\x80", false},
        {"\xED\xBF\xBF", false},
        {"\xEE\x80\x80", true},
        {"\xEF\xBF\xBF", true},
        {"\xF0\x8F\xBF\xBF", false},
        {"\xF0\x90\x80\x80", true},
        {"\xF0\x90\x80", false},
        {"\xF4\x8F\xBF\xBF", true},
        {"\xF4\x90\x80\x80", false},
        {"\xF5\x80\x80\x80", false},
        {"\xF8\x88\x80\x80\x80", false},
        {"\xFF", false},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        if (fsn_is_utf8(cases[i].text, strlen(cases[i].text)) != cases[i].good) {
            fprintf(stderr, "case %zu\n", i);
            exit(1);
        }
    }
}

/** Outputs that are closed to every client: first the reason that is nearest to the plan. */
static void not_every_output_is_for_clients(void) {
    static const struct build_sm sm[3][2] = {
        {{1, 20}, {2, 20}}, {{1, 6}, {2, 6}}, {{1, 4}, {2, 4}}};
    static const struct build_copy copies[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}, {2, 0, 0, 14, 2}};
    static const struct build_symbol symbols[] = {
        {.sm = 0, .bit_offset = 128, .bits = 8}, /* free */
        {.sm = 1, .bit_offset = 128, .bits = 8}, /* an input */
        {.sm = 0, .bit_offset = 120, .bits = 8}, /* the last byte of a copy */
        {.sm = 0, .bit_offset = 104, .bits = 8}, /* the one before it */
        {.sm = 4, .bit_offset = 0, .bits = 8},   /* where the bus has no place */
    };
    static const struct {
        fsn_status status;
        const char *text, *hint; /**< after a name, which is empty here */
    } cases[] = {
        {FSN_OK, "", NULL},
        {FSN_E_CLOSED, " is an input", "get reads it"},
        {FSN_E_CLOSED, " belongs to a copy", "the transfers of the network write it"},
        {FSN_OK, "", NULL},
        {FSN_E_CLOSED, " has no place in the process image", NULL},
    };
    const struct build build = {.subdevices = 3,
                                .sm = sm,
                                .copies = copies,
                                .pairs = 1,
                                .standard = 1,
                                .symbols = symbols,
                                .symbol_count = 5};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct fsn_plan *plan;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    free(bytes);
    plan->bytes[plan->offset[FSN_SEC_SM] + 4 * fsn_record_bytes[FSN_SEC_SM] + 7] = 0;
    struct fsn_emulated *bus;
    struct fsn_core *core;
    CHECK(fsn_emulated_create(plan, &bus) == FSN_OK);
    CHECK(fsn_core_create(plan, fsn_emulated_ops(), bus, &core, NULL) == FSN_OK);
    struct fsn_outputs *outputs = fsn_outputs_create(plan);
    CHECK(outputs != NULL);
    fsn_outputs_attach(outputs, core);
    for (uint32_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct fsn_refusal refusal = {.text = ""};
        CHECK(fsn_outputs_check(outputs, i, 1, 5, 1, &refusal) == cases[i].status);
        if (strcmp(refusal.text, cases[i].text) != 0) {
            fprintf(stderr, "%u: %s\n", i, refusal.text);
            exit(1);
        }
        CHECK(cases[i].hint == NULL ? refusal.hint == NULL
                                    : strcmp(refusal.hint, cases[i].hint) == 0);
        CHECK(fsn_outputs_state(outputs, i).open == (cases[i].status == FSN_OK));
        CHECK(!fsn_outputs_has(outputs, 1));
    }
    fsn_outputs_close(outputs, NULL, NULL);
    struct fsn_refusal refusal;
    CHECK(fsn_outputs_check(outputs, 0, 1, 5, 1, &refusal) == FSN_E_STATE);
    CHECK(strcmp(refusal.text, "the bus is being stopped") == 0);
    fsn_outputs_attach(outputs, NULL);
    CHECK(fsn_outputs_check(outputs, 0, 1, 5, 1, &refusal) == FSN_E_STATE);
    CHECK(strcmp(refusal.text, "the bus is stopped") == 0);
    fsn_outputs_free(outputs);
    fsn_outputs_free(NULL);
    fsn_core_free(core);
    fsn_emulated_free(bus);
    fsn_plan_free(plan);
}

int main(void) {
    utf8_has_its_bounds();
    not_every_output_is_for_clients();
    lines_are_split();
    json_is_escaped_and_bounded();
    texts_are_shown_as_far_as_there_is_room();
    values_are_typed();
    values_are_scaled();
    an_output_belongs_to_one_client();
    arming_allows_one_edge();
    values_go_out_together();
    return 0;
}
