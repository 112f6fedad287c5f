/** Objects and SII through the core, on a bus in memory: passed requests, and requests refused
 *  before a bus is used. */
#include <string.h>

#include "core/core_internal.h"
#include "emulated_rig.h"
#include "fsn/acyclic.h"
#include "heap.h"

enum { POSITION = 7, STEPS = 64 };

static struct {
    struct emulated_rig rig;
    struct fsn_bus_ops ops;
    struct fsn_bus_acyclic acyclic;
    uint32_t place;
    uint8_t sii[FSN_SII_BYTES];
    fsn_status fails;     /**< answer of the bus */
    uint32_t fails_after; /**< after this many good answers */
    uint32_t steps[STEPS], reads, between, goes_on_for;
    uint16_t word[2];
    uint32_t words;
    bool forgets; /**< written data */
    const struct fsn_transfer *seen;
    bool wrote;
} on;

static fsn_status answer(void) {
    return on.fails != FSN_OK && on.fails_after-- == 0 ? on.fails : FSN_OK;
}

static uint32_t place(void *bus, uint32_t subdevice) {
    CHECK(bus == on.rig.bus && subdevice == 1);
    return on.place;
}

static fsn_status upload(void *bus, struct fsn_transfer *transfer) {
    CHECK(bus == on.rig.bus);
    on.seen = transfer;
    on.wrote = false;
    return answer();
}

static fsn_status download(void *bus, struct fsn_transfer *transfer) {
    const fsn_status status = upload(bus, transfer);
    on.wrote = true;
    return status;
}

static fsn_status sii_read(void *bus, uint32_t position, uint32_t offset, uint8_t *data,
                           uint32_t size_bytes) {
    CHECK(bus == on.rig.bus && position == POSITION && offset % 8 == 0 && size_bytes % 8 == 0);
    CHECK(offset + size_bytes <= FSN_SII_BYTES);
    on.steps[on.reads++ % STEPS] = size_bytes;
    memcpy(data, on.sii + offset, size_bytes);
    return answer();
}

static fsn_status sii_write(void *bus, uint32_t position, uint32_t offset, uint16_t word) {
    CHECK(bus == on.rig.bus && position == POSITION && on.words < 2);
    CHECK(offset == (on.words == 0 ? 8u : 14u));
    on.word[on.words++] = word;
    if (!on.forgets) {
        on.sii[offset] = (uint8_t)word;
        on.sii[offset + 1] = (uint8_t)(word >> 8);
    }
    return answer();
}

static bool between(void *self) {
    CHECK(self == &on);
    return on.between++ < on.goes_on_for;
}

static void set_up(void) {
    memset(&on, 0, sizeof on);
    size_t len;
    uint8_t *bytes = build_full(&len);
    on.rig = emulated_rig_load(bytes, len);
    on.acyclic = (struct fsn_bus_acyclic){.place = place,
                                          .upload = upload,
                                          .download = download,
                                          .sii_read = sii_read,
                                          .sii_write = sii_write};
    on.ops = *fsn_emulated_ops();
    on.ops.acyclic = &on.acyclic;
    on.rig.core->rt.ops = &on.ops;
    on.place = POSITION;
    on.goes_on_for = UINT32_MAX;
}

static void objects_are_passed_on(void) {
    set_up();
    uint8_t data[4];
    struct fsn_transfer transfer = {.index = 0x1018, .sub = 4, .data = data, .size_bytes = 4};
    CHECK(fsn_core_upload(on.rig.core, 1, &transfer) == FSN_OK && !on.wrote);
    CHECK(on.seen == &transfer && transfer.position == POSITION);
    CHECK(fsn_core_download(on.rig.core, 1, &transfer) == FSN_OK && on.wrote);
    on.fails = FSN_E_BUS_SDO;
    CHECK(fsn_core_upload(on.rig.core, 1, &transfer) == FSN_E_BUS_SDO);
    transfer.size_bytes = FSN_SDO_BYTES;
    on.fails = FSN_OK;
    CHECK(fsn_core_upload(on.rig.core, 1, &transfer) == FSN_OK);
    transfer = (struct fsn_transfer){.index = 0x1018}; /* nothing to write is allowed */
    CHECK(fsn_core_download(on.rig.core, 1, &transfer) == FSN_OK && on.seen == &transfer);
    emulated_rig_end(&on.rig);
}

static void what_cannot_be_is_refused(void) {
    set_up();
    uint8_t data[8];
    struct fsn_core *core = on.rig.core;
    struct fsn_transfer fine = {.data = data, .size_bytes = 8};
    struct fsn_transfer too_long = {.data = data, .size_bytes = FSN_SDO_BYTES + 1};
    struct fsn_transfer no_room = {.size_bytes = 1};
    struct fsn_transfer *bad[] = {NULL, &too_long, &no_room};
    for (int i = 0; i < 3; i++) {
        CHECK(fsn_core_upload(core, 1, bad[i]) == FSN_E_ARG);
        CHECK(fsn_core_download(core, 1, bad[i]) == FSN_E_ARG);
        CHECK(fsn_core_sii_read(core, 1, bad[i]) == FSN_E_ARG);
    }
    CHECK(fsn_core_upload(NULL, 1, &fine) == FSN_E_ARG);
    CHECK(fsn_core_upload(core, 2, &fine) == FSN_E_ARG);
    CHECK(fsn_core_sii_read(core, 2, &fine) == FSN_E_ARG);
    CHECK(fsn_core_alias_write(core, 2, 1) == FSN_E_ARG);
    on.place = FSN_NONE;
    CHECK(fsn_core_upload(core, 1, &fine) == FSN_E_BUS_MISSING);
    CHECK(fsn_core_alias_write(core, 1, 1) == FSN_E_BUS_MISSING);
    on.place = POSITION;
    on.acyclic.upload = NULL;
    CHECK(fsn_core_upload(core, 1, &fine) == FSN_E_ABSENT);
    CHECK(fsn_core_download(core, 1, &fine) == FSN_OK);
    on.acyclic.download = NULL;
    CHECK(fsn_core_download(core, 1, &fine) == FSN_E_ABSENT);
    on.acyclic.sii_write = NULL;
    CHECK(fsn_core_alias_write(core, 1, 1) == FSN_E_ABSENT && on.reads == 0);
    on.acyclic.sii_read = NULL;
    on.acyclic.sii_write = sii_write;
    CHECK(fsn_core_alias_write(core, 1, 1) == FSN_E_ABSENT && on.words == 0);
    CHECK(fsn_core_sii_read(core, 1, &fine) == FSN_E_ABSENT && fine.size_bytes == 0);
    on.ops.acyclic = NULL;
    CHECK(fsn_core_upload(core, 1, &fine) == FSN_E_ABSENT);
    CHECK(fsn_core_alias_write(core, 1, 1) == FSN_E_ABSENT);
    emulated_rig_end(&on.rig);
}

/** A category of so many words at a byte; returns the byte after it. */
static uint32_t category(uint32_t at, uint16_t words) {
    on.sii[at] = 30;
    on.sii[at + 2] = (uint8_t)words;
    on.sii[at + 3] = (uint8_t)(words >> 8);
    return at + 4 + 2u * words;
}

static uint32_t read_sii(uint8_t *data, uint32_t room, fsn_status expected) {
    struct fsn_transfer transfer = {
        .data = data, .size_bytes = room, .between = between, .self = &on};
    on.reads = 0;
    on.between = 0;
    CHECK(fsn_core_sii_read(on.rig.core, 1, &transfer) == expected);
    CHECK(transfer.position == POSITION || expected == FSN_E_ARG);
    return transfer.size_bytes;
}

/** Up to the end of the categories, in steps that others may come between. */
static void an_sii_is_read_up_to_its_end(void) {
    static uint8_t data[FSN_SII_BYTES];
    set_up();
    memset(on.sii, 0xFF, sizeof on.sii); /* no category at all */
    CHECK(read_sii(data, sizeof data, FSN_OK) == 0x88);
    CHECK(on.reads == 3 && on.steps[0] == 64 && on.steps[1] == 64 && on.steps[2] == 8);
    CHECK(on.between == 3);
    uint32_t end = category(category(0x80, 10), 0x0101);
    CHECK(read_sii(data, sizeof data, FSN_OK) == (end + 4 + 7) / 8 * 8);
    CHECK(memcmp(data, on.sii, end + 2) == 0);
    for (uint16_t words = 0; words < 12; words++) {
        memset(on.sii, 0xFF, sizeof on.sii);
        end = category(0x80, words);
        const uint32_t got = read_sii(data, sizeof data, FSN_OK);
        CHECK(got >= end + 2 && got <= end + 4 + 7 && got % 8 == 0);
    }
    memset(on.sii, 0, sizeof on.sii); /* categories without an end */
    CHECK(read_sii(data, sizeof data, FSN_OK) == FSN_SII_BYTES);
    CHECK(read_sii(data, 100, FSN_OK) == 96); /* whole steps of 8 bytes */
    CHECK(on.reads == 2 && on.steps[1] == 32);
    CHECK(read_sii(data, 7, FSN_OK) == 0 && on.reads == 0);
    category(0x80, 0xFFFF); /* one that is longer than any SII */
    CHECK(read_sii(data, sizeof data, FSN_OK) == FSN_SII_BYTES);
    on.goes_on_for = 1;
    CHECK(read_sii(data, sizeof data, FSN_E_STATE) == 128 && on.reads == 2);
    on.fails = FSN_E_BUS_MISSING;
    on.fails_after = 1;
    on.goes_on_for = 9;
    CHECK(read_sii(data, sizeof data, FSN_E_BUS_MISSING) == 64 && on.reads == 2);
    on.fails = FSN_OK;
    struct fsn_transfer quiet = {.data = data, .size_bytes = 16}; /* no other request in between */
    CHECK(fsn_core_sii_read(on.rig.core, 1, &quiet) == FSN_OK && quiet.size_bytes == 16);
    emulated_rig_end(&on.rig);
}

/** The checksum of ETG.1000.6: CRC-8 with 0x07 from 0xFF over the first 14 bytes. */
static void checksums_are_those_of_the_standard(void) {
    static const uint8_t zeros[14] = {0};
    static const uint8_t counted[14] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14};
    CHECK(fsn_eeprom_checksum(zeros) == 0x30 && fsn_eeprom_checksum(counted) == 0x24);
}

static void an_alias_is_written_and_read_back(void) {
    set_up();
    for (uint8_t i = 0; i < 16; i++) {
        on.sii[i] = (uint8_t)(0x11 * i);
    }
    CHECK(fsn_core_alias_write(on.rig.core, 1, 0xABCD) == FSN_OK);
    CHECK(on.words == 2 && on.word[0] == 0xABCD && on.sii[8] == 0xCD && on.sii[9] == 0xAB);
    CHECK(on.sii[14] == fsn_eeprom_checksum(on.sii) && on.sii[15] == 0xFF);
    CHECK(on.reads == 2 && on.steps[0] == 16 && on.steps[1] == 16);
    for (uint32_t good = 0; good < 4; good++) {
        on.fails = FSN_E_BUS_MISSING;
        on.fails_after = good;
        on.words = on.reads = 0;
        CHECK(fsn_core_alias_write(on.rig.core, 1, 0x1234) == FSN_E_BUS_MISSING);
        CHECK(on.reads + on.words == good + 1); /* no data continues after it */
    }
    on.fails = FSN_OK;
    on.forgets = true;
    on.words = 0;
    CHECK(fsn_core_alias_write(on.rig.core, 1, 0x7777) == FSN_E_BUS_STATE);
    emulated_rig_end(&on.rig);
}

int main(void) {
    const long alive = heap_alive();
    objects_are_passed_on();
    what_cannot_be_is_refused();
    an_sii_is_read_up_to_its_end();
    checksums_are_those_of_the_standard();
    an_alias_is_written_and_read_back();
    CHECK(heap_alive() == alive);
    return 0;
}
