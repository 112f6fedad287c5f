/** Self-description of emulated SubDevices: SII, objects, and places left free by the plan. */
#define _GNU_SOURCE

#include <string.h>

#include "heap.h"
#include "segment/segment_internal.h"
#include "segment_rig.h"

/** A plan may place a SubDevice where the emulation has no room, and none is there then. */
static void what_is_not_there_is_reported(void) {
    struct rig rig = {.bytes = NULL};
    size_t len;
    uint8_t byte = 0;
    CHECK(fsn_segment_create(NULL, &rig.segment) == FSN_E_ARG);
    rig.bytes = build_estop(&len);
    CHECK(fsn_plan_load(rig.bytes, len, &rig.plan, NULL) == FSN_OK);
    CHECK(fsn_segment_create(rig.plan, NULL) == FSN_E_ARG);
    free(rig.bytes);
    rig.bytes = build_estop(&len);
    fsn_plan_free(rig.plan);
    /* The first table is that of the SubDevices, 48 bytes each; bytes 6 and 7 are the position. */
    uint8_t *second = rig.bytes + (rig.bytes[36] | rig.bytes[37] << 8) + 48;
    CHECK(second[6] == 1 && second[7] == 0);
    second[7] = 0x10; /* 4097 */
    build_fix_crc(rig.bytes, len);
    CHECK(fsn_plan_load(rig.bytes, len, &rig.plan, NULL) == FSN_OK);
    CHECK(fsn_segment_create(rig.plan, &rig.segment) == FSN_OK);
    CHECK(fsn_segment_size(rig.segment) == 1);
    CHECK(fsn_segment_position(rig.segment, 0) == 0);
    CHECK(fsn_segment_position(rig.segment, 1) == FSN_NONE);
    CHECK(fsn_segment_position(rig.segment, 2) == FSN_NONE);
    CHECK(fsn_segment_write_inputs(rig.segment, 3, &byte, 1) == FSN_E_ARG);
    CHECK(fsn_segment_write_inputs(rig.segment, 4, &byte, 1) == FSN_E_ARG);
    CHECK(al(&rig, 0) == 1 && al(&rig, 1) == 0);
    fsn_segment_set_present(rig.segment, 0, false);
    CHECK(al(&rig, 0) == 0);
    fsn_segment_set_present(rig.segment, 7, false);
    fsn_segment_power_cycle(rig.segment, 7);
    CHECK(fsn_segment_swap(rig.segment, 0, 1) == FSN_E_ARG);
    CHECK(fsn_segment_swap(rig.segment, 1, 0) == FSN_E_ARG);
    CHECK(fsn_segment_swap(rig.segment, 0, 0) == FSN_E_ARG);
    CHECK(fsn_segment_set_object(rig.segment, 0, 0x2000, 0, NULL, 1) == FSN_E_ARG);
    static const uint8_t large[1025];
    CHECK(fsn_segment_set_object(rig.segment, 0, 0x2000, 0, large, 1025) == FSN_E_ARG);
    CHECK(fsn_segment_set_object(rig.segment, 0, 0x2000, 0, large, 1024) == FSN_OK);
    CHECK(fsn_segment_set_object(rig.segment, 0, 0x2000, 0, large, 1023) == FSN_E_ARG);
    CHECK(fsn_segment_set_object(rig.segment, 1, 0x2000, 0, large, 4) == FSN_E_ARG);
    tear_down(&rig);
}

/** One without a place leaves the others theirs. */
static void the_others_have_their_places(void) {
    struct rig rig = set_up_line(3);
    fsn_segment_free(rig.segment);
    uint8_t *second =
        rig.plan->bytes + rig.plan->offset[FSN_SEC_SUBDEVICE] + fsn_record_bytes[FSN_SEC_SUBDEVICE];
    second[6] = 0;
    second[7] = 0x10; /* 4096 */
    CHECK(fsn_segment_create(rig.plan, &rig.segment) == FSN_OK);
    CHECK(fsn_segment_position(rig.segment, 1) == FSN_NONE);
    CHECK(fsn_segment_position(rig.segment, 2) == 2 && fsn_segment_size(rig.segment) == 3);
    tear_down(&rig);
}

/** A place left free by the plan has a coupler, with an SII and no objects. */
static void a_free_place_has_a_coupler(void) {
    struct rig rig = {.bytes = NULL};
    size_t len;
    rig.bytes = build_estop(&len);
    (rig.bytes + (rig.bytes[36] | rig.bytes[37] << 8) + 48)[6] = 2;
    build_fix_crc(rig.bytes, len);
    CHECK(fsn_plan_load(rig.bytes, len, &rig.plan, NULL) == FSN_OK);
    CHECK(fsn_segment_create(rig.plan, &rig.segment) == FSN_OK);
    CHECK(fsn_segment_size(rig.segment) == 3 && fsn_segment_position(rig.segment, 1) == 2);
    CHECK(datagram(&rig, APWR, 0xFFFF, 0x0502, "\0\1\x08\0\0\0", 6) == 1);
    CHECK(datagram(&rig, APRD, 0xFFFF, 0x0508, NULL, 8) == 1);
    CHECK(memcmp(rig.data, "\2\0\0\0\x52\x2C\x4C\x04", 8) == 0);
    CHECK(al(&rig, 1) == 1 && write16(&rig, APWR, 0xFFFF, 0x0120, 2) == 1 && al(&rig, 1) == 2);
    tear_down(&rig);
}

/** Alias, revision and FSoE address of the plan are where a MainDevice looks for them. */
static void what_the_plan_knows_is_shown(void) {
    static const uint8_t count[8] = {0x40, 0x80, 0xF9, 0};
    static const uint8_t address[8] = {0x40, 0x80, 0xF9, 1};
    struct rig rig = {.bytes = NULL};
    size_t len;
    rig.bytes = build_estop(&len);
    CHECK(fsn_plan_load(rig.bytes, len, &rig.plan, NULL) == FSN_OK);
    uint8_t *first = rig.plan->bytes + rig.plan->offset[FSN_SEC_SUBDEVICE];
    uint8_t *connection = rig.plan->bytes + rig.plan->offset[FSN_SEC_CONNECTION];
    first[4] = 0x34;
    first[5] = 0x12;
    first[16] = 0x78;
    first[19] = 0x56;
    connection[26] = 0xCD;
    connection[27] = 0xAB;
    connection[30] |= 2;
    struct fsn_connection_info info;
    CHECK(fsn_plan_connection(rig.plan, 0, &info) == FSN_OK && info.address == 0xABCD);
    CHECK(fsn_segment_create(rig.plan, &rig.segment) == FSN_OK);
    CHECK(write16(&rig, APWR, 0xFFFF, 0x0010, 1001) == 1); /* the SubInstance */
    CHECK(datagram(&rig, APRD, 0, 0x0012, NULL, 2) == 1 && memcmp(rig.data, "\x34\x12", 2) == 0);
    CHECK(datagram(&rig, APWR, 0, 0x0502, "\0\1\x0C\0\0\0", 6) == 1);
    CHECK(datagram(&rig, APRD, 0, 0x0508, NULL, 4) == 1);
    CHECK(memcmp(rig.data, "\x78\0\0\x56", 4) == 0);
    to_preop(&rig, 1001);
    CHECK(sdo(&rig, count, 8) == 10 && memcmp(rig.data + 8, "\x4F\x80\xF9\0\1\0\0\0", 8) == 0);
    for (uint8_t sub = 0; sub < 2; sub++) {
        const uint8_t write[8] = {0x2F, 0x80, 0xF9, sub, 9};
        CHECK(sdo(&rig, write, 8) == 10 && memcmp(rig.data + 12, "\2\0\1\6", 4) == 0);
    }
    CHECK(sdo(&rig, address, 8) == 10);
    CHECK(memcmp(rig.data + 8, "\x4B\x80\xF9\1\xCD\xAB\0\0", 8) == 0);
    tear_down(&rig);
}

/** A device without a mailbox: its unused sync managers are empty in the SII, and outputs have a
 *  watchdog unless the plan disables it. */
static void a_device_may_have_no_mailbox(void) {
    static const struct build_sm sm[1][2] = {{{1, 8}, {2, 8}}};
    static const struct build build = {.subdevices = 1, .sm = sm, .cycle_ns = 1000000};
    for (uint8_t watchdog = 0; watchdog < 3; watchdog++) {
        const uint8_t category[] = {41, 0,    16, 0, /* its words */
                                    0,  0,    0,  0, 0,
                                    0,  0,    0, /* SM0 */
                                    0,  0x11, 8,  0, (uint8_t)(watchdog == 2 ? 0x24 : 0x64),
                                    0,  1,    3, /* SM1 */
                                    0,  0,    0,  0, 0,
                                    0,  0,    0, /* SM2 */
                                    16, 0x11, 8,  0, 0x20,
                                    0,  1,    4};
        struct rig rig = {.bytes = NULL};
        size_t len;
        rig.bytes = build_plan(&build, &len);
        CHECK(fsn_plan_load(rig.bytes, len, &rig.plan, NULL) == FSN_OK);
        uint8_t *record = rig.plan->bytes + rig.plan->offset[FSN_SEC_SM];
        record[4] = 1;
        record[6] = watchdog;
        CHECK(fsn_read_sm(rig.plan, 0).watchdog == watchdog);
        CHECK(fsn_segment_create(rig.plan, &rig.segment) == FSN_OK);
        const uint8_t *sii = rig.segment->siis[0];
        CHECK(memmem(sii, rig.segment->escs[0].sii_bytes, category, sizeof category) != NULL);
        CHECK(fsn_get16(sii + 0x30) == 0 && fsn_get16(sii + 0x38) == 0);
        CHECK(write16(&rig, APWR, 0, 0x0120, 2) == 1 && al(&rig, 0) == 2);
        tear_down(&rig);
    }
}

/** Of a long name the SII holds 200 bytes, and the next category follows it; the object holds all
 *  of it. */
static void long_names_are_cut(void) {
    static const uint8_t object[8] = {0x40, 0x08, 0x10, 0};
    char name[251];
    for (size_t len = 199; len <= 250; len += len < 201 ? 1 : 49) {
        struct rig rig = {.bytes = NULL};
        size_t bytes;
        memset(name, 'n', len);
        name[len] = 0;
        rig.bytes = build_estop(&bytes);
        rig.bytes = build_name(rig.bytes, &bytes, FSN_SEC_SUBDEVICE, 0, name);
        build_fix_crc(rig.bytes, bytes);
        CHECK(fsn_plan_load(rig.bytes, bytes, &rig.plan, NULL) == FSN_OK);
        CHECK(fsn_segment_create(rig.plan, &rig.segment) == FSN_OK);
        const uint8_t *sii = rig.segment->siis[0] + 0x80;
        const size_t shown = len < 200 ? len : 200;
        const size_t words = (2 + shown + 1) / 2;
        CHECK(fsn_get16(sii) == 10 && fsn_get16(sii + 2) == words);
        CHECK(sii[4] == 1 && sii[5] == shown && memcmp(sii + 6, name, shown) == 0);
        CHECK(shown % 2 == 0 || sii[6 + shown] == 0);
        CHECK(fsn_get16(sii + 4 + 2 * words) == 30);
        CHECK(write16(&rig, APWR, 0, 0x0010, 1001) == 1);
        to_preop(&rig, 1001);
        CHECK(sdo(&rig, object, 8) == 122 && rig.data[8] == 0x41 && rig.data[12] == len);
        tear_down(&rig);
    }
}

/** All of an object with a byte of padding after its first value: 2048 bytes in all. */
static void a_whole_name_has_a_limit(void) {
    static const uint8_t object[8] = {0x50, 0x08, 0x10, 0};
    static char name[2049];
    for (size_t len = 2047; len <= 2048; len++) {
        struct rig rig = {.bytes = NULL};
        size_t bytes;
        memset(name, 'n', len);
        rig.bytes = build_estop(&bytes);
        rig.bytes = build_name(rig.bytes, &bytes, FSN_SEC_SUBDEVICE, 0, name);
        build_fix_crc(rig.bytes, bytes);
        CHECK(fsn_plan_load(rig.bytes, bytes, &rig.plan, NULL) == FSN_OK);
        CHECK(fsn_segment_create(rig.plan, &rig.segment) == FSN_OK);
        CHECK(write16(&rig, APWR, 0, 0x0010, 1001) == 1);
        to_preop(&rig, 1001);
        const unsigned answer = sdo(&rig, object, 8);
        CHECK(answer == (len == 2047 ? 122 : 10) && rig.data[8] == (len == 2047 ? 0x51 : 0x80));
        CHECK(rig.segment->escs[0].transfer.size_bytes == (len == 2047 ? 2048 : 0));
        CHECK(rig.segment->escs[0].al_due_ns == 0);
        tear_down(&rig);
    }
}

/** A plan may name the sync managers of the mailbox, without data, and more than a controller of
 *  this segment has. */
static void sync_managers_of_no_use_are_left_out(void) {
    static const struct build_sm sm[1][2] = {{{1, 0}, {2, 8}}};
    static const struct build build = {.subdevices = 1, .sm = sm, .cycle_ns = 1000000};
    static const uint8_t numbers[] = {0, 1, 8, 9};
    static const uint8_t count[8] = {0x40, 0x00, 0x1C, 0};
    for (size_t i = 0; i < sizeof numbers; i++) {
        struct rig rig = {.bytes = NULL};
        uint8_t output;
        size_t len;
        rig.bytes = build_plan(&build, &len);
        CHECK(fsn_plan_load(rig.bytes, len, &rig.plan, NULL) == FSN_OK);
        rig.plan->bytes[rig.plan->offset[FSN_SEC_SM] + 4] = numbers[i];
        CHECK(fsn_read_sm(rig.plan, 0).index == numbers[i]);
        CHECK(fsn_segment_create(rig.plan, &rig.segment) == FSN_OK);
        CHECK(write16(&rig, APWR, 0, 0x0010, 1001) == 1);
        to_preop(&rig, 1001);
        CHECK(sdo(&rig, count, 8) == 10 && rig.data[8] == 0x4F && rig.data[12] == 4);
        for (uint8_t number = 1; number <= 4; number++) { /* the third one is not used */
            const uint8_t type[8] = {0x40, 0x00, 0x1C, number};
            CHECK(sdo(&rig, type, 8) == 10);
            CHECK(rig.data[8] == 0x4F && rig.data[12] == (number == 3 ? 0 : number));
        }
        CHECK(fsn_segment_read_outputs(rig.segment, 0, &output, 0, NULL) == FSN_E_ARG);
        CHECK(fsn_segment_write_inputs(rig.segment, 1, count, 8) == FSN_OK); /* the next one is */
        tear_down(&rig);
    }
}

/** All of an object at once, and more of it than a transfer holds. */
static void whole_objects_have_a_limit(void) {
    static const uint8_t request[8] = {0x50, 0x00, 0x20, 0};
    static const uint8_t part[1024] = {7};
    struct rig rig = set_up();
    set_stations(&rig);
    to_preop(&rig, 1001);
    CHECK(fsn_segment_set_object(rig.segment, 0, 0x2000, 0, "\3", 1) == FSN_OK);
    CHECK(fsn_segment_set_object(rig.segment, 0, 0x2000, 1, part, 1022) == FSN_OK);
    CHECK(fsn_segment_set_object(rig.segment, 0, 0x2000, 2, part, 1024) == FSN_OK);
    CHECK(sdo(&rig, request, 8) == 122 && rig.data[8] == 0x51 && rig.data[12] == 0 &&
          rig.data[13] == 8); /* 2048 bytes */
    CHECK(fsn_segment_set_object(rig.segment, 0, 0x2000, 3, part, 1) == FSN_OK);
    CHECK(sdo(&rig, request, 8) == 10 && rig.data[8] == 0x80);
    CHECK(memcmp(rig.data + 12, "\5\0\4\5", 4) == 0);
    tear_down(&rig);
}

static void eeprom_is_read(void) {
    struct rig rig = set_up();
    const uint8_t read_identity[6] = {0, 1, 8, 0, 0, 0};
    CHECK(datagram(&rig, APWR, 0, 0x0502, read_identity, 6) == 1);
    CHECK(datagram(&rig, APRD, 0, 0x0502, NULL, 14) == 1);
    CHECK((rig.data[1] & 0x87) == 0); /* done, command bits cleared */
    const uint8_t read_behind[6] = {0, 1, 0xFF, 0xFF, 0, 0};
    CHECK(datagram(&rig, APWR, 0, 0x0502, read_behind, 6) == 1);
    CHECK(datagram(&rig, APRD, 0, 0x0508, NULL, 4) == 1 && rig.data[0] == 0xFF);
    tear_down(&rig);
}

int main(void) {
    const long alive = heap_alive();
    what_is_not_there_is_reported();
    the_others_have_their_places();
    a_free_place_has_a_coupler();
    what_the_plan_knows_is_shown();
    a_device_may_have_no_mailbox();
    long_names_are_cut();
    a_whole_name_has_a_limit();
    sync_managers_of_no_use_are_left_out();
    whole_objects_have_a_limit();
    eeprom_is_read();
    CHECK(heap_alive() == alive);
    return 0;
}
