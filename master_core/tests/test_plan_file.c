/** The file around the tables of a plan: its head, gaps, ends, every truncation. */
#include "broken.h"
#include "heap.h"

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

/** Bytes of the header and of the section table changed, alone. */
static void header_rules(void) {
    static const struct {
        size_t at;
        uint8_t value;
        bool crc; /**< corrected again */
        const char *says;
    } table[] = {
        {0, 'f', false, "PLAN_MAGIC 0.-1+0: these bytes are not a plan"},
        {7, 1, false, "PLAN_MAGIC 0.-1+0: these bytes are not a plan"},
        {8, 2, false, "PLAN_VERSION 0.-1+8: the plan format has another version"},
        {9, 1, false, "PLAN_VERSION 0.-1+8: the plan format has another version"},
        {12, 0, false, "PLAN_LENGTH 0.-1+12: the stated length is not that of the file"},
        {15, 1, false, "PLAN_LENGTH 0.-1+12: the stated length is not that of the file"},
        {16, 0, false, "PLAN_CRC 0.-1+16: CRC-32 does not fit; the plan was changed"},
        {20, 0, true, "OK"},
        {24, 9, true,
         "PLAN_SECTION 0.-1+24: the number of sections is not 10 to 13 (format 1.0 to 1.3)"},
        {24, 11, true,
         "PLAN_SECTION 0.-1+24: the number of sections is not 10 to 13 (format 1.0 to 1.3)"},
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
    const long alive = heap_alive();
    nothing_is_left_over();
    files_end_behind_their_last_section();
    header_rules();
    two_gibibytes_are_no_plan();
    gaps_are_zero();
    every_truncation_is_refused();
    CHECK(heap_alive() == alive);
    return 0;
}
