/** PDO assignment and mapping compared with the plan: reads, writes and their order, and the report
 *  if it stays different. */
#define _POSIX_C_SOURCE 200809L

#include "live/pdo.h"

#include <string.h>
#include <time.h>

#include "emulated_rig.h"
#include "heap.h"

enum { SM = 2, NUMBER = 2, ASSIGNED = 0x1C12, PDO = 0x1600, ENTRIES = 8, MOST = 80 };

/** Nothing waits here. */
int clock_nanosleep(clockid_t clock, int flags, const struct timespec *time,
                    struct timespec *left) {
    (void)clock;
    (void)flags;
    (void)time;
    (void)left;
    return 0;
}

struct object {
    uint16_t index;
    uint8_t sub;
    uint32_t value;
};

/** The objects of a SubDevice, which may refuse to be written or to be read. */
static struct {
    struct object row[MOST];
    size_t rows;
    uint16_t locked;          /**< object that takes nothing */
    bool locked_whole;        /**< nor their number */
    struct object unreadable; /**< one that is not read, or 0 */
    unsigned unreadable_from; /**< number of its reads that succeed before */
    bool silent;              /**< nothing answers to it, where others refuse */
    char log[2000];           /**< written data */
} on;

static struct object *find(uint16_t index, uint8_t sub) {
    for (size_t i = 0; i < on.rows; i++) {
        if (on.row[i].index == index && on.row[i].sub == sub) {
            return &on.row[i];
        }
    }
    return NULL;
}

static void put(uint16_t index, uint8_t sub, uint32_t value) {
    struct object *o = find(index, sub);
    CHECK(o != NULL || on.rows < MOST);
    o = o != NULL ? o : &on.row[on.rows++];
    *o = (struct object){index, sub, value};
}

static fsn_status upload(void *bus, struct fsn_transfer *t) {
    CHECK(bus == &on);
    const struct object *o = find(t->index, t->sub);
    const bool refused =
        on.unreadable.index == t->index && on.unreadable.sub == t->sub && on.unreadable_from-- == 0;
    if (o == NULL || refused) {
        on.unreadable_from = refused ? 0 : on.unreadable_from;
        return refused && on.silent ? FSN_E_BUS_MAILBOX : FSN_E_BUS_SDO;
    }
    for (unsigned i = 0; i < 4; i++) {
        t->data[i] = (uint8_t)(o->value >> (8 * i));
    }
    t->size_bytes = t->sub == 0 ? 1 : t->index == ASSIGNED ? 2 : 4;
    return FSN_OK;
}

static fsn_status download(void *bus, struct fsn_transfer *t) {
    CHECK(bus == &on);
    uint32_t value = 0;
    for (unsigned i = 0; i < t->size_bytes; i++) {
        value |= (uint32_t)t->data[i] << (8 * i);
    }
    const size_t used = strlen(on.log);
    const bool refused = on.locked == t->index && (t->sub != 0 || on.locked_whole);
    snprintf(on.log + used, sizeof on.log - used, "%04x:%02x=%x/%u%s ", t->index, t->sub,
             (unsigned)value, (unsigned)t->size_bytes, refused ? "!" : "");
    if (refused) {
        return FSN_E_BUS_SDO;
    }
    put(t->index, t->sub, value);
    return FSN_OK;
}

static struct fsn_plan *plan;

/** As the plan has it: one PDO with eight entries of a byte. */
static void set_up(void) {
    memset(&on, 0, sizeof on);
    put(ASSIGNED, 0, 1);
    put(ASSIGNED, 1, PDO);
    put(PDO, 0, ENTRIES);
    for (uint8_t i = 0; i < ENTRIES; i++) {
        put(PDO, (uint8_t)(i + 1), 0x60000008u | (uint32_t)i << 8);
    }
}

static void checked(fsn_status expected, const char *log, const char *detail, int line) {
    const struct fsn_objects objects = {.bus = &on, .upload = upload, .download = download};
    char said[FSN_DETAIL_BYTES] = "";
    const fsn_status status = fsn_pdo_check(plan, SM, &objects, said);
    if (status != expected || strcmp(on.log, log) != 0 ||
        (status != FSN_OK && strcmp(said, detail) != 0)) {
        fprintf(stderr, "line %d: %s\nwritten %s\nsaid    %s\n", line, fsn_status_name(status),
                on.log, said);
        exit(1);
    }
}

#define CHECKED(status, log, detail) checked(status, log, detail, __LINE__)
#define ANEW                                                                                       \
    "1600:00=0/1 1600:01=60000008/4 1600:02=60000108/4 1600:03=60000208/4 1600:04=60000308/4 "     \
    "1600:05=60000408/4 1600:06=60000508/4 1600:07=60000608/4 1600:08=60000708/4 1600:00=8/1 "

static void what_fits_is_left_alone(void) {
    set_up();
    CHECKED(FSN_OK, "", "");
    put(ASSIGNED, 0, 0x101); /* only the low byte counts */
    put(PDO, 0, 0x100 + ENTRIES);
    CHECKED(FSN_OK, "", "");
}

static void assignments_are_written_once(void) {
    set_up();
    put(ASSIGNED, 1, 0x1601);
    CHECKED(FSN_OK, "1c12:00=0/1 1c12:01=1600/2 1c12:00=1/1 ", "");
    set_up();
    put(ASSIGNED, 0, 2);
    put(ASSIGNED, 2, 0x1605);
    CHECKED(FSN_OK, "1c12:00=0/1 1c12:01=1600/2 1c12:00=1/1 ", "");
    set_up();
    put(ASSIGNED, 1, 0x1601);
    on.locked = ASSIGNED;
    CHECKED(FSN_E_BUS_MAPPING, "1c12:00=0/1 1c12:01=1600/2! 1c12:00=1/1 ",
            "SM2: an assigned PDO is 0x1601, the plan has 0x1600");
    set_up();
    on.locked = ASSIGNED;
    put(ASSIGNED, 0, 0); /* nothing was assigned, and its place keeps another one */
    put(ASSIGNED, 1, 0x1607);
    CHECKED(FSN_E_BUS_MAPPING, "1c12:00=0/1 1c12:01=1600/2! 1c12:00=1/1 ",
            "SM2: an assigned PDO is 0x1607, the plan has 0x1600");
}

/** What takes nothing at all is not filled either, and how many there are is compared. */
static void numbers_are_compared(void) {
    static const uint32_t counts[] = {0, 2, 3, 64, 65, 255};
    static const uint32_t believed[] = {0, 2, 3, 64, 64, 64};
    char detail[FSN_DETAIL_BYTES];
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
        set_up();
        on.rows = 0;
        for (uint8_t n = 1; n <= 64; n++) {
            put(ASSIGNED, n, n == 1 ? PDO : 0x1601u);
        }
        put(ASSIGNED, 0, counts[i]);
        on.locked = ASSIGNED;
        on.locked_whole = true;
        snprintf(detail, sizeof detail,
                 "SM2: the number of assigned PDOs is 0x%x, the plan has 0x1",
                 (unsigned)believed[i]);
        CHECKED(FSN_E_BUS_MAPPING, "1c12:00=0/1! 1c12:00=1/1! ", detail);
    }
    set_up();
    put(PDO, 0, 7);
    on.locked = PDO;
    on.locked_whole = true;
    CHECKED(FSN_E_BUS_MAPPING, "1600:00=0/1! 1600:00=8/1! ",
            "PDO 0x1600 has 7 entries, the plan has 8");
}

static void what_cannot_be_read_is_left_to_the_device(void) {
    static const struct object places[] = {{ASSIGNED, 0, 0}, {ASSIGNED, 1, 0}};
    for (size_t i = 0; i < 2; i++) {
        set_up();
        put(ASSIGNED, 1, 0x1601);
        on.unreadable = places[i];
        CHECKED(FSN_OK, "", "");
        on.unreadable_from = 1; /* readable before it was written, and not after */
        CHECKED(FSN_OK, "1c12:00=0/1 1c12:01=1600/2 1c12:00=1/1 ", "");
    }
    static const struct object entries[] = {{PDO, 0, 0}, {PDO, 8, 0}};
    for (size_t i = 0; i < 2; i++) {
        set_up();
        put(PDO, 3, 0x60000210);
        on.unreadable = entries[i];
        CHECKED(FSN_OK, "", "");
        on.unreadable_from = 1;
        CHECKED(FSN_OK, ANEW, "");
    }
}

/** A lost answer is not a result, before the write and after it. */
static void what_nobody_answers_is_no_agreement(void) {
    static const struct {
        struct object at;
        const char *written, *detail;
    } places[] = {
        {{ASSIGNED, 0, 0}, "1c12:00=0/1 1c12:01=1600/2 1c12:00=1/1 ", "0x1c12:00: no answer"},
        {{ASSIGNED, 1, 0}, "1c12:00=0/1 1c12:01=1600/2 1c12:00=1/1 ", "0x1c12:01: no answer"},
        {{PDO, 0, 0}, ANEW, "0x1600:00: no answer"},
        {{PDO, 8, 0}, ANEW, "0x1600:08: no answer"},
    };
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        for (unsigned from = 0; from < 2; from++) {
            set_up();
            on.silent = true;
            on.unreadable = places[i].at;
            on.unreadable_from = from;
            if (places[i].at.index == PDO) {
                put(PDO, 3, 0x60000210);
            } else {
                put(ASSIGNED, 1, 0x1601);
            }
            CHECKED(FSN_E_BUS_MAILBOX, from == 0 ? "" : places[i].written, places[i].detail);
        }
    }
}

static void mappings_are_written_once(void) {
    set_up();
    put(PDO, 3, 0x60000210);
    CHECKED(FSN_OK, ANEW, "");
    set_up();
    put(PDO, 0, 7);
    CHECKED(FSN_OK, ANEW, "");
    set_up();
    put(PDO, 3, 0x60000210);
    on.locked = PDO;
    CHECKED(FSN_E_BUS_MAPPING, "1600:00=0/1 1600:01=60000008/4! 1600:00=8/1 ",
            "PDO 0x1600, entry 3 is 0x60000210, the plan has 0x60000208 (index, subindex, bits)");
    set_up();
    put(PDO, 0, 9);
    put(PDO, 9, 0x70000008);
    on.locked = PDO;
    find(PDO, 0)->value = 9;
    CHECKED(FSN_OK, "1600:00=0/1 1600:01=60000008/4! 1600:00=8/1 ", "");
}

/** An entry whose number has no two bytes alike. */
static void every_byte_is_written(void) {
    static const struct build_sm sm[1][2] = {{{1, 1}, {2, 1}}};
    const struct build build = {.subdevices = 1, .sm = sm};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    uint8_t *entry = bytes + fsn_get32(bytes + 32 + 16 * (FSN_SEC_ENTRY - 1) + 4);
    memcpy(entry, "\x23\x61\x45", 3); /* index and subindex */
    build_fix_crc(bytes, len);
    struct fsn_plan *other;
    CHECK(fsn_plan_load(bytes, len, &other, NULL) == FSN_OK);
    free(bytes);
    const struct fsn_objects objects = {.bus = &on, .upload = upload, .download = download};
    char said[FSN_DETAIL_BYTES] = "";
    set_up();
    CHECK(fsn_pdo_check(other, 0, &objects, said) == FSN_OK);
    CHECK(strcmp(on.log, "1600:00=0/1 1600:01=61234508/4 1600:00=1/1 ") == 0);
    fsn_plan_free(other);
}

/** Two of padding are one of their sum, wherever they stand. */
static void padding_may_be_split(void) {
    static const struct build_sm sm[1][2] = {{{1, 8}, {2, 1}}};
    const struct build build = {.subdevices = 1, .sm = sm};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    uint8_t *entry = bytes + fsn_get32(bytes + 32 + 16 * (FSN_SEC_ENTRY - 1) + 4);
    for (int i = 2; i < 5; i++) { /* entries 3 to 5 are padding */
        memset(entry + 12 * i, 0, 4);
    }
    build_fix_crc(bytes, len);
    struct fsn_plan *padded;
    CHECK(fsn_plan_load(bytes, len, &padded, NULL) == FSN_OK);
    free(bytes);
    struct fsn_plan *const kept = plan;
    plan = padded;
    const struct fsn_objects objects = {.bus = &on, .upload = upload, .download = download};
    char said[FSN_DETAIL_BYTES] = "";
    set_up();
    put(PDO, 0, 7);
    put(PDO, 3, 16);
    put(PDO, 4, 8);
    for (uint8_t i = 0; i < 3; i++) {
        put(PDO, (uint8_t)(5 + i), 0x60000508u + 0x100u * i);
    }
    CHECK(fsn_pdo_check(plan, 0, &objects, said) == FSN_OK && on.log[0] == 0);
    put(PDO, 4, 9);
    on.locked = PDO;
    CHECK(fsn_pdo_check(plan, 0, &objects, said) == FSN_E_BUS_MAPPING);
    CHECK(strcmp(said, "PDO 0x1600, entry 3 is 0x00000019, the plan has 0x00000018 (index, "
                       "subindex, bits)") == 0);
    fsn_plan_free(padded);
    plan = kept;
}

/** Padding of more than 255 bits is several entries; no object holds more than 254. */
static void long_padding_is_split(void) {
    static const struct build_sm sm[1][2] = {{{1, 4}, {2, 1}}};
    const struct build build = {.subdevices = 1, .sm = sm};
    static const struct {
        uint32_t bits, count, last;
    } table[] = {{255, 4, 255}, {256, 5, 8}, {503, 5, 255}, {504, 6, 8}};
    for (size_t i = 0; i < 4; i++) {
        size_t len;
        uint8_t *bytes = build_plan(&build, &len);
        uint8_t *entry = bytes + fsn_get32(bytes + 32 + 16 * (FSN_SEC_ENTRY - 1) + 4);
        uint8_t *record = bytes + fsn_get32(bytes + 32 + 16 * (FSN_SEC_SM - 1) + 4);
        memset(entry, 0, 4);
        entry[4] = (uint8_t)table[i].bits;
        entry[5] = (uint8_t)(table[i].bits >> 8);
        for (uint32_t e = 1; e < 4; e++) {
            const uint32_t at = table[i].bits + 8 * (e - 1);
            entry[12 * e + 8] = (uint8_t)at;
            entry[12 * e + 9] = (uint8_t)(at >> 8);
        }
        record[8] = (uint8_t)(table[i].bits + 24);
        record[9] = (uint8_t)((table[i].bits + 24) >> 8);
        build_fix_crc(bytes, len);
        struct fsn_plan *padded;
        CHECK(fsn_plan_load(bytes, len, &padded, NULL) == FSN_OK);
        uint32_t entries[FSN_PDO_ENTRIES];
        const uint32_t count = fsn_pdo_entries(padded, fsn_read_sm(padded, 0).first_pdo, entries);
        CHECK(count == table[i].count && entries[count - 4] == table[i].last);
        for (uint32_t e = 0; e + 4 < count; e++) {
            CHECK(entries[e] == 248);
        }
        CHECK(entries[count - 1] == 0x60000308);
        CHECK(fsn_read_pdo(padded, fsn_read_sm(padded, 1).first_pdo).index == 0x1A00);
        fsn_plan_free(padded);
        free(bytes);
    }
}

static void lengths_are_compared(void) {
    char said[FSN_DETAIL_BYTES] = "";
    CHECK(fsn_pdo_check_bits(plan, SM, 64, said) == FSN_OK && said[0] == 0);
    CHECK(fsn_pdo_check_bits(plan, SM, 63, said) == FSN_E_BUS_MAPPING);
    CHECK(strcmp(said, "SM2: its length in bits by the SII is 63, the plan has 64") == 0);
}

int main(void) {
    const long alive = heap_alive();
    size_t len;
    uint8_t *bytes = build_estop(&len);
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    free(bytes);
    what_fits_is_left_alone();
    assignments_are_written_once();
    numbers_are_compared();
    what_cannot_be_read_is_left_to_the_device();
    what_nobody_answers_is_no_agreement();
    mappings_are_written_once();
    every_byte_is_written();
    padding_may_be_split();
    long_padding_is_split();
    lengths_are_compared();
    fsn_plan_free(plan);
    CHECK(heap_alive() == alive);
    return 0;
}
