/** Checks of a SubDevice common to both live backends, with objects in memory. */
#define _POSIX_C_SOURCE 200809L

#include "live/check.h"

#include <string.h>
#include <time.h>

#include "emulated_rig.h"
#include "heap.h"
#include "live/fsoe_objects.h"

enum { KNOWN_ADDRESS = 2, SUB = 1, POSITION = 5, MOST_TRIES = 10 };

/** Time of this program: it passes in pauses, and with each transfer. */
static uint16_t wrong_address; /* FSoE address that was found */

static struct wall {
    uint64_t now_ns, paused_ns, transfer_ns;
} wall;

int clock_gettime(clockid_t clock, struct timespec *time) {
    CHECK(clock == CLOCK_MONOTONIC);
    *time = (struct timespec){.tv_sec = (time_t)(wall.now_ns / 1000000000u),
                              .tv_nsec = (long)(wall.now_ns % 1000000000u)};
    return 0;
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *time,
                    struct timespec *left) {
    CHECK(clock == CLOCK_MONOTONIC && flags == 0 && left == NULL && time->tv_sec == 0);
    wall.paused_ns += (uint64_t)time->tv_nsec;
    wall.now_ns += (uint64_t)time->tv_nsec;
    return 0;
}

/** Objects of one SubDevice: whatever is read, this is the answer. */
struct objects {
    fsn_status status;
    uint32_t abort_code;
    uint16_t value;
    uint32_t transfers;
    char made[200]; /**< index and subindex of each transfer, and the written data */
};

static void note(char *made, size_t room, const struct fsn_transfer *t, bool writes) {
    size_t used = strlen(made);
    used += (size_t)snprintf(made + used, room - used, " %x:%x", t->index, t->sub);
    for (uint32_t i = 0; writes && i < t->size_bytes; i++) {
        used += (size_t)snprintf(made + used, room - used, "%s%02x", i == 0 ? "=" : "", t->data[i]);
    }
}

static void same(const char *got, const char *expected) {
    if (strcmp(got, expected) != 0) {
        fprintf(stderr, "got      %s\nexpected %s\n", got, expected);
        exit(1);
    }
}

static fsn_status answer(struct objects *o, struct fsn_transfer *t, bool writes) {
    CHECK(t->position == POSITION && t->data != NULL);
    o->transfers++;
    note(o->made, sizeof o->made, t, writes);
    t->abort_code = o->abort_code;
    return o->status;
}

static fsn_status upload(void *bus, struct fsn_transfer *t) {
    struct objects *o = bus;
    if (o->status == FSN_OK) {
        static const uint8_t zeros[8];
        CHECK(t->size_bytes == 8 && memcmp(t->data, zeros, 8) == 0);
        t->data[0] = (uint8_t)o->value;
        t->data[1] = (uint8_t)(o->value >> 8);
        t->size_bytes = 2;
    }
    return answer(o, t, false);
}

static fsn_status download(void *bus, struct fsn_transfer *t) {
    return answer(bus, t, true);
}

static struct fsn_objects reach(struct objects *o) {
    return (struct fsn_objects){
        .bus = o, .position = POSITION, .upload = upload, .download = download};
}

/** A plan with two SDOs of its last SubDevice; its connection may know its FSoE address. */
static struct fsn_plan *load(bool known) {
    static const struct build_sm sm[2][2] = {{{1, 9}, {2, 8}}, {{1, 8}, {2, 8}}};
    static const struct build_copy pair[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}};
    const struct build build = {
        .subdevices = 2, .sm = sm, .copies = pair, .pairs = 1, .sdo_count = 2};
    struct fsn_plan *plan;
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    uint8_t *connection = bytes + fsn_get32(bytes + 32 + 16 * (FSN_SEC_CONNECTION - 1) + 4);
    connection[26] = 7; /* its address */
    connection[30] |= known ? KNOWN_ADDRESS : 0;
    build_fix_crc(bytes, len);
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    free(bytes);
    return plan;
}

static void identities_are_compared(void) {
    const struct fsn_subdevice_info info = {
        .vendor_id = 2, .product_code = 3, .revision_low = 10, .revision_high = 20};
    char detail[FSN_DETAIL_BYTES] = "";
    CHECK(fsn_check_identity(&info, 2, 3, 10, detail));
    CHECK(fsn_check_identity(&info, 2, 3, 20, detail));
    CHECK(detail[0] == 0);
    CHECK(!fsn_check_identity(&info, 2, 3, 9, detail));
    CHECK(!fsn_check_identity(&info, 2, 3, 21, detail));
    CHECK(!fsn_check_identity(&info, 1, 3, 10, detail));
    CHECK(!fsn_check_identity(&info, 2, 4, 10, detail));
    same(detail, "found vendor 0x00000002 product 0x00000004 revision 0x0000000a, the plan has "
                 "0x00000002 0x00000003 0x0000000a to 0x00000014");
}

static void who_takes_no_sdo_says_why(struct fsn_plan *plan) {
    struct fsn_subdevice_info info;
    char detail[FSN_DETAIL_BYTES];
    struct objects objects = {.status = FSN_OK};
    const struct fsn_objects reached = reach(&objects);
    CHECK(fsn_plan_subdevice(plan, SUB, &info) == FSN_OK && info.sdo_count == 2);
    CHECK(fsn_check_sdos(plan, &info, &reached, detail) == FSN_OK && objects.transfers == 2);
    same(objects.made, " 8000:1=78563412 8001:1=78563412");
    CHECK(fsn_check_sdos(plan, &info, NULL, detail) == FSN_E_BUS_SDO);
    same(detail, "0x8000:01 is to be written, but it has no CoE");
    objects = (struct objects){.status = FSN_E_BUS_SDO, .abort_code = 0x06090030};
    CHECK(fsn_check_sdos(plan, &info, &reached, detail) == FSN_E_BUS_SDO);
    same(detail, "0x8000:01: abort code 0x06090030 value out of range");
    objects = (struct objects){.status = FSN_E_BUS_MISSING};
    CHECK(fsn_check_sdos(plan, &info, &reached, detail) == FSN_E_BUS_MISSING);
    same(detail, "0x8000:01: no answer");
    CHECK(objects.transfers == 1);
    objects = (struct objects){.status = FSN_E_BUS_MAILBOX};
    CHECK(fsn_check_sdos(plan, &info, &reached, detail) == FSN_E_BUS_MAILBOX);
    same(detail, "0x8000:01: no answer");
    CHECK(objects.transfers == MOST_TRIES);
    objects = (struct objects){.status = FSN_E_BUS_STATE}; /* an answer that is not one */
    CHECK(fsn_check_sdos(plan, &info, &reached, detail) == FSN_E_BUS_SDO);
    same(detail, "0x8000:01: an answer that makes no sense");
    info.first_sdo++;
    info.sdo_count--;
    CHECK(fsn_check_sdos(plan, &info, NULL, detail) == FSN_E_BUS_SDO);
    same(detail, "0x8001:01 is to be written, but it has no CoE");
    info.sdo_count = 0;
    CHECK(fsn_check_sdos(plan, &info, NULL, detail) == FSN_OK);
}

static void addresses_are_compared_where_both_tell_them(struct fsn_plan *plan) {
    struct fsn_connection_info c;
    char detail[FSN_DETAIL_BYTES];
    bool readable = true;
    CHECK(fsn_plan_connection(plan, 0, &c) == FSN_OK && c.sub_subdevice == SUB);
    struct objects objects = {.status = FSN_OK, .value = c.address};
    const struct fsn_objects reached = reach(&objects);
    CHECK(fsn_check_address(plan, SUB, &reached, &readable, &wrong_address, detail) == FSN_OK &&
          readable);
    same(objects.made, " f980:1");
    CHECK(fsn_check_address(plan, 1 - SUB, &reached, &readable, &wrong_address, detail) == FSN_OK &&
          !readable);
    CHECK(fsn_check_address(plan, SUB, NULL, &readable, &wrong_address, detail) == FSN_OK &&
          !readable);
    CHECK(wrong_address == 0);
    CHECK(objects.transfers == 1);
    objects.value = 0x0108; /* of at most 8 addresses, each with the same wrong one */
    CHECK(fsn_check_address(plan, SUB, &reached, &readable, &wrong_address, detail) ==
          FSN_E_BUS_ADDRESS);
    CHECK(readable && wrong_address == 264);
    same(detail, "it has FSoE address 264, the plan has 7");
    same(objects.made, " f980:1 f980:1 f980:0 f980:2 f980:3 f980:4 f980:5 f980:6 f980:7 f980:8");
    objects = (struct objects){.status = FSN_OK, .value = 0xFF};
    CHECK(fsn_check_address(plan, SUB, &reached, &readable, &wrong_address, detail) ==
          FSN_E_BUS_ADDRESS);
    CHECK(objects.transfers == 2 + 15); /* at most 16 are accepted */
    objects.status = FSN_E_BUS_SDO;
    CHECK(fsn_check_address(plan, SUB, &reached, &readable, &wrong_address, detail) == FSN_OK &&
          !readable);
}

static void without_an_address_nothing_is_compared(void) {
    struct fsn_plan *plan = load(false);
    char detail[FSN_DETAIL_BYTES];
    bool readable = true;
    struct objects objects = {.status = FSN_OK, .value = 9};
    const struct fsn_objects reached = reach(&objects);
    CHECK(fsn_check_address(plan, SUB, &reached, &readable, &wrong_address, detail) == FSN_OK &&
          !readable);
    CHECK(objects.transfers == 0);
    fsn_plan_free(plan);
}

/** Objects of one SubDevice, by index and subindex; all others are not there. */
struct dictionary {
    struct {
        uint16_t index;
        uint8_t sub;
        uint16_t value;
    } row[8];
};

static char looked_up[400];

/** From a transfer on so many answers are lost. */
static struct lost {
    uint32_t transfers, from, count;
    fsn_status as;
} lost;

static fsn_status look_up(void *bus, struct fsn_transfer *t) {
    const struct dictionary *d = bus;
    CHECK(t->size_bytes == 8);
    wall.now_ns += wall.transfer_ns;
    const uint32_t number = lost.transfers++ - lost.from;
    if (number < lost.count) {
        t->size_bytes = 0;
        return lost.as;
    }
    note(looked_up, sizeof looked_up, t, false);
    for (size_t i = 0; i < sizeof d->row / sizeof d->row[0]; i++) {
        if (d->row[i].index == t->index && d->row[i].sub == t->sub) {
            t->data[0] = (uint8_t)d->row[i].value;
            t->data[1] = (uint8_t)(d->row[i].value >> 8);
            return FSN_OK;
        }
    }
    t->abort_code = 0x06020000;
    return FSN_E_BUS_SDO;
}

static void address_is_found_where_the_device_has_it(struct fsn_plan *plan) {
    struct fsn_connection_info c;
    CHECK(fsn_plan_connection(plan, 0, &c) == FSN_OK);
    const uint16_t own = c.address;
    const uint16_t other = (uint16_t)(own + 1);
    const struct {
        struct dictionary objects;
        fsn_status status;
        bool readable;
        const char *made;
    } rows[] = {
        /* Two SubInstances in one SubDevice. */
        {{{{0xF980, 0, 2}, {0xF980, 1, other}, {0xF980, 2, own}}},
         FSN_OK,
         true,
         " f980:1 f980:0 f980:2"},
        {{{{0xF980, 0, 1}, {0xF980, 1, other}, {0xF980, 2, own}}},
         FSN_E_BUS_ADDRESS,
         true,
         " f980:1 f980:0"},
        {{{{0xF980, 1, other}}}, FSN_E_BUS_ADDRESS, true, " f980:1 f980:0"},
        /* Only the module of its frame, mapped from 0x6000, identifies it. */
        {{{{0x9001, 0, 8}, {0x9001, 2, own}}}, FSN_OK, true, " f980:1 9001:0 9001:2"},
        {{{{0x9001, 0, 4}, {0x9001, 2, other}}}, FSN_E_BUS_ADDRESS, true, " f980:1 9001:0 9001:2"},
        {{{{0x9001, 0, 3}, {0x9001, 2, other}}},
         FSN_OK,
         false,
         " f980:1 9001:0"}, /* something else */
        {{{{0x9011, 0, 8}, {0x9011, 2, other}}},
         FSN_OK,
         false,
         " f980:1 9001:0"}, /* another module */
        {{{{0x9001, 0, 8}}}, FSN_OK, false, " f980:1 9001:0 9001:2"},
        {{{{0x9001, 0, 8}, {0x9001, 2, 0}}},
         FSN_OK,
         false,
         " f980:1 9001:0 9001:2"}, /* before the first connection */
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct dictionary objects = rows[i].objects;
        const struct fsn_objects reached = {.bus = &objects, .upload = look_up};
        bool readable = !rows[i].readable;
        char detail[FSN_DETAIL_BYTES];
        CHECK(fsn_check_address(plan, SUB, &reached, &readable, &wrong_address, detail) ==
              rows[i].status);
        CHECK(readable == rows[i].readable);
        same(looked_up, rows[i].made);
        looked_up[0] = 0;
    }
}

/** A lost answer is asked for again, ten times or two seconds long; then its object is named, and
 *  nothing is taken for checked. */
static void lost_answers_are_asked_for_again(struct fsn_plan *plan) {
    struct fsn_connection_info c;
    CHECK(fsn_plan_connection(plan, 0, &c) == FSN_OK);
    const uint16_t other = (uint16_t)(c.address + 1);
    const struct {
        struct dictionary objects;
        uint32_t transfers;
        const char *named[3];
    } rows[] = {
        {{{{0xF980, 0, 2}, {0xF980, 1, other}, {0xF980, 2, c.address}}},
         3,
         {"0xf980:01: no answer", "0xf980:00: no answer", "0xf980:02: no answer"}},
        {{{{0x9001, 0, 8}, {0x9001, 2, c.address}}},
         3,
         {"0xf980:01: no answer", "0x9001:00: no answer", "0x9001:02: no answer"}},
    };
    for (uint32_t i = 0; i < 2 * 3 * (MOST_TRIES + 1); i++) {
        const uint32_t row = i % 2, from = i / 2 % 3, count = i / 6;
        struct dictionary objects = rows[row].objects;
        const struct fsn_objects reached = {.bus = &objects, .upload = look_up};
        bool readable = false;
        char detail[FSN_DETAIL_BYTES] = "";
        lost = (struct lost){.from = from, .count = count, .as = FSN_E_BUS_MAILBOX};
        wall = (struct wall){0};
        const fsn_status status =
            fsn_check_address(plan, SUB, &reached, &readable, &wrong_address, detail);
        CHECK(status == (count < MOST_TRIES ? FSN_OK : FSN_E_BUS_MAILBOX));
        CHECK(readable == (count < MOST_TRIES));
        CHECK(lost.transfers == (count < MOST_TRIES ? rows[row].transfers + count : from + count));
        CHECK(wall.paused_ns < 1000000000u);
        if (count == MOST_TRIES) {
            same(detail, rows[row].named[from]);
        }
        looked_up[0] = 0;
    }
    /* If each attempt takes long, three are enough; a lost SubDevice is not asked again. */
    struct dictionary objects = rows[0].objects;
    const struct fsn_objects reached = {.bus = &objects, .upload = look_up};
    bool readable;
    char detail[FSN_DETAIL_BYTES];
    lost = (struct lost){.count = 99, .as = FSN_E_BUS_MAILBOX};
    wall = (struct wall){.transfer_ns = 1100000000u};
    CHECK(fsn_check_address(plan, SUB, &reached, &readable, &wrong_address, detail) ==
          FSN_E_BUS_MAILBOX);
    CHECK(lost.transfers == 3);
    lost = (struct lost){.count = 99, .as = FSN_E_BUS_MISSING};
    CHECK(fsn_check_address(plan, SUB, &reached, &readable, &wrong_address, detail) ==
          FSN_E_BUS_MISSING);
    CHECK(lost.transfers == 1 && !readable);
    lost = (struct lost){0};
    wall = (struct wall){0};
}

static void parameters_follow_the_frame(void) {
    static const uint16_t rows[][3] = {
        /* command, parameters, diagnosis */
        {0x6000, 0x9001, 0xA000}, {0x7000, 0x9001, 0xA000},
        {0x7080, 0x9081, 0xA080}, {0x6FF0, 0x9FF1, 0xAFF0},
        {0xE600, 0xE901, 0xEA00}, {0xE7F0, 0xE9F1, 0xEAF0},
        {0x6760, 0x6791, 0},      {0x6770, 0x6791, 0},
        {0x6001, 0, 0},           {0x5000, 0, 0},
        {0x8000, 0, 0},           {0xE800, 0, 0},
        {0xE501, 0, 0},           {0, 0, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        CHECK(fsn_parameter_object(rows[i][0]) == rows[i][1]);
        CHECK(fsn_diagnosis_object(rows[i][1]) == rows[i][2]);
    }
}

int main(void) {
    const long alive = heap_alive();
    struct fsn_plan *plan = load(true);
    parameters_follow_the_frame();
    address_is_found_where_the_device_has_it(plan);
    lost_answers_are_asked_for_again(plan);
    identities_are_compared();
    who_takes_no_sdo_says_why(plan);
    addresses_are_compared_where_both_tell_them(plan);
    without_an_address_nothing_is_compared();
    fsn_plan_free(plan);
    CHECK(heap_alive() == alive);
    return 0;
}
