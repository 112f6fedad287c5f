/** The emulated segment in memory: working counters, states, mailboxes, process data, hot plug.
 *  Real MainDevices on it are tests/segment/test_peers.py. */
#define _GNU_SOURCE

#include <string.h>

#include "heap.h"
#include "segment/segment_internal.h"
#include "segment_rig.h"

static void working_counters(void) {
    struct rig rig = set_up();
    CHECK(fsn_segment_size(rig.segment) == 2);
    CHECK(datagram(&rig, BRD, 0, 0x0000, NULL, 1) == 2);
    CHECK(rig.data[0] == 0x11);
    CHECK(datagram(&rig, APRD, 0, 0x0000, NULL, 1) == 1);
    CHECK(datagram(&rig, APRD, 0xFFFE, 0x0000, NULL, 1) == 0); /* a third port does not exist */
    CHECK(datagram(&rig, FPRD, 1001, 0x0000, NULL, 1) == 0);   /* no station address yet */
    set_stations(&rig);
    CHECK(datagram(&rig, FPRD, 1002, 0x0010, NULL, 2) == 1);
    CHECK(rig.data[0] == (1002 & 0xFF));
    CHECK(datagram(&rig, FPRD, 1001, 0x0A00, NULL, 2) == 0); /* a register that does not exist */
    CHECK(write16(&rig, FPWR, 1001, 0x0000, 0xFFFF) == 0);   /* one that is read only */
    CHECK(datagram(&rig, FRMW, 1001, 0x0910, NULL, 8) == 2);
    CHECK(datagram(&rig, 0, 0, 0, NULL, 4) == 0);
    tear_down(&rig);
}

static void hostile_frames_get_no_answer(void) {
    struct rig rig = set_up();
    for (size_t len = 0; len < 64; len++) {
        uint8_t *frame = malloc(len + 1);
        CHECK(frame != NULL);
        memset(frame, 0xFF, len + 1);
        if (len >= 16) {
            frame[12] = 0x88;
            frame[13] = 0xA4;
            frame[15] = 0x17; /* the stated length far exceeds the data */
        }
        CHECK(fsn_segment_frame(rig.segment, frame, len, 1) == 0);
        free(frame);
    }
    tear_down(&rig);
}

/** A good frame of one datagram in which one thing is changed. */
static void frames_are_checked(void) {
    static const struct {
        unsigned at;
        uint8_t value;
        size_t len;
        bool answered;
    } rows[] = {
        {0, 0xFF, 30, true},                            /* nothing changed */
        {0, 0xFF, 60, true},                            /* padding after it */
        {12, 0x89, 30, false},                          /* another protocol */
        {13, 0xA5, 30, false},   {15, 0x40, 30, false}, /* EtherCAT, but no datagrams */
        {0, 0xFF, 15, false},                           /* no whole header */
        {14, 15, 30, false},                            /* a byte more than there is */
        {14, 13, 30, false},     /* the datagram has a byte more than its frame */
        {14, 11, 30, false},     /* less than the head of a datagram */
        {14, 0, 30, false},      /* none at all */
        {22, 3, 30, false},      /* more data than the frame has */
        {23, 0x80, 30, false},   /* another one follows, which is missing */
        {23, 0x07, 2000, false}, /* more data than a datagram may have */
    };
    struct rig rig = set_up();
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct fsn_segment_counts before, after;
        uint8_t frame[2000] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 1, 1, 1, 1, 1, 1, 0x88, 0xA4};
        frame[14] = 14;
        frame[15] = 0x10;
        frame[16] = BRD;
        frame[22] = 2;
        if (rows[i].len > 100) {
            frame[14] = (uint8_t)(rows[i].len - 16);
            frame[15] = (uint8_t)(0x10 | (rows[i].len - 16) >> 8);
        }
        frame[rows[i].at] = rows[i].value;
        fsn_segment_counts(rig.segment, &before);
        const size_t len = fsn_segment_frame(rig.segment, frame, rows[i].len, 1);
        fsn_segment_counts(rig.segment, &after);
        if ((len == rows[i].len) != rows[i].answered ||
            after.foreign - before.foreign != !rows[i].answered ||
            after.frames - before.frames != rows[i].answered ||
            (rows[i].answered && frame[6] != (1 | 2))) { /* the first controller marks it */
            fprintf(stderr, "row %zu: %zu\n", i, len);
            exit(1);
        }
    }
    tear_down(&rig);
}

/** The watchdog time is that of the registers, from the write on. */
static void the_watchdog_takes_its_time_from_the_registers(void) {
    static const struct {
        uint16_t divider, limit, most_ms;
    } rows[] = {{2498, 20, 2}, {2498, 40, 4}, {4998, 20, 4}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct rig rig = set_up();
        uint16_t code;
        set_stations(&rig);
        to_op(&rig, 1001, 0, 9);
        CHECK(write16(&rig, FPWR, 1001, 0x0400, rows[i].divider) == 1);
        CHECK(write16(&rig, FPWR, 1001, 0x0420, rows[i].limit) == 1);
        CHECK(datagram(&rig, LWR, 0, 0, "123456789", 9) == 1 && al(&rig, 0) == 8);
        for (uint16_t ms = 1; ms <= rows[i].most_ms; ms++) {
            CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == 2 && al(&rig, 0) == 8);
        }
        CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == 2);
        CHECK(fsn_segment_al_status(rig.segment, 0, &code) == 0x14 && code == 0x001B);
        tear_down(&rig);
    }
}

/** A set of inputs is taken as a whole when its first byte is read, and only then; bytes beyond the
 *  memory are left out. */
static void inputs_are_taken_with_their_first_byte(void) {
    static const uint8_t inputs[2][8] = {{1, 2, 3, 4, 5, 6, 7, 8}, {9, 9, 9, 9, 9, 9, 9, 9}};
    struct rig rig = set_up();
    set_stations(&rig);
    to_preop(&rig, 1001);
    set_sm(&rig, 1001, 3, 0x1140, 8, 0x20);
    CHECK(fsn_segment_write_inputs(rig.segment, 1, inputs[0], 8) == FSN_OK);
    CHECK(datagram(&rig, FPRD, 1001, 0x1144, NULL, 4) == 1 && rig.data[0] == 0);
    CHECK(datagram(&rig, FPRD, 1001, 0x1140, NULL, 4) == 1);
    CHECK(memcmp(rig.data, inputs[0], 4) == 0);
    CHECK(fsn_segment_write_inputs(rig.segment, 1, inputs[1], 8) == FSN_OK);
    CHECK(datagram(&rig, FPRD, 1001, 0x1144, NULL, 4) == 1);
    CHECK(memcmp(rig.data, inputs[0] + 4, 4) == 0);
    CHECK(datagram(&rig, FPRD, 1001, 0x113F, NULL, 8) == 1);
    CHECK(rig.data[0] == 0 && memcmp(rig.data + 1, inputs[1], 7) == 0);
    set_sm(&rig, 1001, 3, 0x2FFC, 8, 0x20);
    CHECK(fsn_segment_write_inputs(rig.segment, 1, inputs[0], 8) == FSN_OK);
    CHECK(datagram(&rig, FPRD, 1001, 0x2FFC, NULL, 4) == 1 && rig.data[0] == 0);
    /* A shorter sync manager takes as much of it as it holds. */
    set_sm(&rig, 1001, 3, 0x1200, 3, 0x20);
    CHECK(fsn_segment_write_inputs(rig.segment, 1, inputs[0], 8) == FSN_OK);
    CHECK(datagram(&rig, FPRD, 1001, 0x1200, NULL, 4) == 1);
    CHECK(memcmp(rig.data, "\1\2\3\0", 4) == 0);
    tear_down(&rig);
}

/** Outputs count from SAFEOP on, and where they are in the memory. */
static void outputs_are_given_from_safeop_on(void) {
    uint8_t outputs[9];
    bool fresh = true;
    struct rig rig = set_up();
    set_stations(&rig);
    to_preop(&rig, 1001);
    set_sm(&rig, 1001, 2, 0x1100, 9, 0x64);
    set_sm(&rig, 1001, 3, 0x1140, 8, 0x20);
    CHECK(datagram(&rig, FPWR, 1001, 0x1100, "123456789", 9) == 1);
    CHECK(fsn_segment_read_outputs(rig.segment, 0, outputs, 9, &fresh) == FSN_OK && !fresh);
    CHECK(write16(&rig, FPWR, 1001, 0x0120, 4) == 1 && al(&rig, 0) == 4);
    CHECK(datagram(&rig, FPWR, 1001, 0x1100, "123456789", 9) == 1);
    CHECK(fsn_segment_read_outputs(rig.segment, 0, outputs, 9, &fresh) == FSN_OK && fresh);
    CHECK(memcmp(outputs, "123456789", 9) == 0);
    set_sm(&rig, 1001, 2, 0x2FFC, 9, 0x64);
    CHECK(datagram(&rig, FPWR, 1001, 0x2FFC, "abcdefghi", 9) == 1);
    CHECK(fsn_segment_read_outputs(rig.segment, 0, outputs, 9, &fresh) == FSN_OK && fresh);
    CHECK(memcmp(outputs, "123456789", 9) == 0);
    tear_down(&rig);
}

static void states_in_order_only(void) {
    struct rig rig = set_up();
    set_stations(&rig);
    uint16_t code;
    CHECK(write16(&rig, FPWR, 1001, 0x0120, 8) == 1);
    CHECK(fsn_segment_al_status(rig.segment, 0, &code) == 0x11 && code == 0x0011);
    CHECK(write16(&rig, FPWR, 1001, 0x0120, 2) == 1);
    CHECK(al(&rig, 0) == 0x11); /* an error is acknowledged first */
    CHECK(write16(&rig, FPWR, 1001, 0x0120, 0x11) == 1);
    CHECK(al(&rig, 0) == 1);
    CHECK(write16(&rig, FPWR, 1001, 0x0120, 3) == 1);
    CHECK(fsn_segment_al_status(rig.segment, 0, &code) == 0x11 && code == 0x0013);
    CHECK(write16(&rig, FPWR, 1001, 0x0120, 0x17) == 1);
    CHECK(fsn_segment_al_status(rig.segment, 0, &code) == 0x11 && code == 0x0012);
    tear_down(&rig);
}

static void process_data_goes_both_ways(void) {
    struct rig rig = set_up();
    set_stations(&rig);
    to_op(&rig, 1001, 0, 9);
    to_op(&rig, 1002, 17, 8);
    CHECK(al(&rig, 0) == 8 && al(&rig, 1) == 8);
    uint8_t image[33];
    for (uint8_t i = 0; i < sizeof image; i++) {
        image[i] = i;
    }
    const uint8_t inputs[8] = {0xA0, 0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA6, 0xA7};
    CHECK(fsn_segment_write_inputs(rig.segment, 3, inputs, 8) == FSN_OK);
    CHECK(datagram(&rig, LRW, 0, 0, image, sizeof image) == 6);
    CHECK(memcmp(rig.data + 25, inputs, 8) == 0); /* of the second SubDevice */
    CHECK(rig.data[9] == 0);                      /* the first one has published nothing */
    CHECK(memcmp(rig.data, image, 9) == 0);       /* outputs come back as sent */
    uint8_t outputs[9];
    bool fresh = false;
    CHECK(fsn_segment_read_outputs(rig.segment, 2, outputs, 8, &fresh) == FSN_OK);
    CHECK(fresh && memcmp(outputs, image + 17, 8) == 0);
    CHECK(fsn_segment_read_outputs(rig.segment, 2, outputs, 8, &fresh) == FSN_OK && !fresh);
    CHECK(datagram(&rig, LRD, 0, 0, image, sizeof image) == 2);
    CHECK(datagram(&rig, LWR, 0, 0, image, sizeof image) == 2);
    CHECK(datagram(&rig, LRW, 5000, 0, image, 4) == 0);
    CHECK(al(&rig, 0) == 8 && al(&rig, 1) == 8); /* no watchdog sees a frame from the future */
    CHECK(fsn_segment_read_outputs(rig.segment, 3, outputs, 8, NULL) == FSN_E_ARG);
    CHECK(fsn_segment_write_inputs(rig.segment, 2, inputs, 8) == FSN_E_ARG);
    CHECK(fsn_segment_write_inputs(rig.segment, 3, inputs, 7) == FSN_E_ARG);
    tear_down(&rig);
}

static void wrong_lengths_are_refused(void) {
    struct rig rig = set_up();
    set_stations(&rig);
    uint16_t code;
    CHECK(write16(&rig, FPWR, 1001, 0x0120, 2) == 1);
    CHECK(fsn_segment_al_status(rig.segment, 0, &code) == 0x11 && code == 0x0016);
    to_preop(&rig, 1001);
    CHECK(al(&rig, 0) == 2);
    set_sm(&rig, 1001, 2, 0x1100, 8, 0x64); /* it needs 9 */
    CHECK(write16(&rig, FPWR, 1001, 0x0120, 4) == 1);
    CHECK(fsn_segment_al_status(rig.segment, 0, &code) == 0x12 && code == 0x001D);
    set_sm(&rig, 1001, 2, 0x1100, 9, 0x64);
    set_sm(&rig, 1001, 3, 0x1140, 9, 0x20);
    CHECK(write16(&rig, FPWR, 1001, 0x0120, 0x14) == 1);
    CHECK(fsn_segment_al_status(rig.segment, 0, &code) == 0x12 && code == 0x001E);
    tear_down(&rig);
}

static void mailbox_speaks_coe(void) {
    struct rig rig = set_up();
    set_stations(&rig);
    to_preop(&rig, 1001);
    const uint8_t vendor[8] = {0x40, 0x18, 0x10, 1};
    CHECK(sdo(&rig, vendor, 8) == 10);
    CHECK(rig.data[7] == 0x30 && rig.data[8] == 0x43); /* response, 4 bytes expedited */
    const uint8_t absent[8] = {0x40, 0x34, 0x12, 0};
    CHECK(sdo(&rig, absent, 8) == 10);
    CHECK(rig.data[8] == 0x80 && rig.data[14] == 0x02 && rig.data[15] == 0x06);
    const uint8_t read_only[8] = {0x23, 0x18, 0x10, 1, 1, 2, 3, 4};
    CHECK(sdo(&rig, read_only, 8) == 10);
    CHECK(rig.data[8] == 0x80 && rig.data[12] == 0x02 && rig.data[14] == 0x01);
    const uint8_t no_sub[8] = {0x40, 0x18, 0x10, 9};
    CHECK(sdo(&rig, no_sub, 8) == 10);
    CHECK(rig.data[8] == 0x80 && rig.data[12] == 0x11 && rig.data[14] == 0x09);
    /* The mailbox is full of an unsupported protocol. */
    uint8_t foreign[128] = {4, 0, 0, 0, 0, 0x14};
    CHECK(datagram(&rig, FPWR, 1001, 0x1000, foreign, 128) == 1);
    CHECK(datagram(&rig, FPRD, 1001, 0x1080, NULL, 128) == 1 && rig.data[5] % 16 == 0);
    /* And of nothing but length. */
    memset(foreign, 0xFF, sizeof foreign);
    CHECK(datagram(&rig, FPWR, 1001, 0x1000, foreign, 128) == 1);
    CHECK(datagram(&rig, FPRD, 1001, 0x1080, NULL, 128) == 1 && rig.data[5] % 16 == 0);
    tear_down(&rig);
}

static void watchdog_takes_it_out_of_op(void) {
    struct rig rig = set_up();
    set_stations(&rig);
    to_op(&rig, 1001, 0, 9);
    uint16_t code;
    CHECK(datagram(&rig, LWR, 0, 0, "123456789", 9) == 1);
    fsn_segment_idle(rig.segment, rig.now_ns + 99000000);
    CHECK(al(&rig, 0) == 8);
    fsn_segment_idle(rig.segment, rig.now_ns + 101000000);
    CHECK(fsn_segment_al_status(rig.segment, 0, &code) == 0x14 && code == 0x001B);
    tear_down(&rig);
}

static void unplugging_cuts_all_behind(void) {
    struct rig rig = set_up();
    set_stations(&rig);
    fsn_segment_set_present(rig.segment, 1, false);
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == 1);
    CHECK(datagram(&rig, FPRD, 1001, 0x0311, NULL, 1) == 1 && rig.data[0] == 1); /* lost link */
    fsn_segment_set_present(rig.segment, 1, true);
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == 2);
    CHECK(datagram(&rig, FPRD, 1002, 0, NULL, 1) == 0); /* it has forgotten its address */
    fsn_segment_set_present(rig.segment, 0, false);
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == -1);
    fsn_segment_set_present(rig.segment, 0, true);
    fsn_segment_lose(rig.segment, 2);
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == -1);
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == -1);
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == 2);
    tear_down(&rig);
}

/** Any datagram at any register, the mailbox and the FMMUs included: nothing may break, and a frame
 *  with room for its datagrams gets an answer of the same length. */
static void any_datagram(void) {
    struct rig rig = set_up();
    static const uint16_t places[] = {0x0010, 0x0120, 0x0500, 0x0600, 0x0610, 0x0800,
                                      0x0808, 0x0810, 0x0900, 0x1000, 0x1080, 0x2FF0};
    uint64_t seed = 7;
    for (int round = 0; round < 100000; round++) {
        uint8_t data[256];
        const uint16_t size = (uint16_t)(next_random(&seed) % 200);
        for (uint16_t i = 0; i < size; i++) {
            data[i] = (uint8_t)(next_random(&seed) % 3 == 0 ? next_random(&seed) : i % 7);
        }
        const uint8_t command = (uint8_t)(next_random(&seed) % 16);
        const uint16_t station = (uint16_t)(1001 + next_random(&seed) % 2);
        const bool logical = command >= LRD && command <= LRW;
        const bool increment = command >= APRD && command <= APRW;
        const uint16_t adp = (uint16_t)(logical     ? next_random(&seed) % 64
                                        : increment ? 0
                                                    : station);
        const uint16_t ado =
            logical ? 0 : (uint16_t)(places[next_random(&seed) % 12] + next_random(&seed) % 20);
        CHECK(datagram(&rig, command, adp, ado, data, size) >= 0);
        if (round % 50 == 0) {
            set_stations(&rig);
        }
        if (round % 500 == 0) {
            fsn_segment_power_cycle(rig.segment, next_random(&seed) % 3);
        }
    }
    tear_down(&rig);
}

/** A sync manager or an FMMU as it comes, mostly where others are. */
static void odd_register(uint64_t *seed, uint16_t *at, uint8_t bytes[16], uint16_t *size) {
    const uint16_t start =
        (uint16_t)((next_random(seed) % 4 == 0 ? 0x2FF0 : 0x1100) + 4 * (next_random(seed) % 8));
    const uint8_t length = (uint8_t)(1 + next_random(seed) % 12);
    const uint16_t number = next_random(seed) % 4;
    memset(bytes, 0, 16);
    if (next_random(seed) % 3 == 0) {
        static const uint8_t controls[] = {0x64, 0x20, 0x64, 0x20, 0x26, 0x22};
        *at = (uint16_t)(0x0800 + 8 * number);
        *size = 8;
        fsn_put16(bytes, start);
        bytes[2] = length;
        bytes[4] = controls[next_random(seed) % 6];
        bytes[6] = 1;
        return;
    }
    const bool whole = next_random(seed) % 4 != 0;
    *at = (uint16_t)(0x0600 + 16 * number);
    *size = 16;
    bytes[0] = (uint8_t)(4 * (next_random(seed) % 8));
    bytes[4] = length;
    bytes[6] = whole ? 0 : next_random(seed) % 8;
    bytes[7] = whole ? 7 : next_random(seed) % 8;
    fsn_put16(bytes + 8, (uint16_t)(start + next_random(seed) % 4));
    bytes[10] = whole ? 0 : next_random(seed) % 8;
    bytes[11] = next_random(seed) % 4;
    bytes[12] = 1;
}

/** An FMMU inside a sync manager does not ask it each time: compared with a segment where all do,
 *  nothing differs, for any register values. */
static void an_fmmu_inside_a_sync_manager_does_as_others(void) {
    struct rig rigs[2] = {set_up(), set_up()};
    struct esc *escs[2];
    uint64_t seed = 11;
    unsigned inside = 0;
    for (int r = 0; r < 2; r++) {
        set_stations(&rigs[r]);
        to_op(&rigs[r], 1001, 0, 9);
        escs[r] = &rigs[r].segment->escs[0];
    }
    for (int round = 0; round < 50000; round++) {
        uint8_t data[64], inputs[8], outputs[2][9];
        uint8_t command = (uint8_t)(LRD + next_random(&seed) % 3);
        uint16_t adp = (uint16_t)(next_random(&seed) % 48), at = 0;
        uint16_t size = (uint16_t)(1 + next_random(&seed) % 48);
        for (unsigned i = 0; i < sizeof data; i++) {
            data[i] = (uint8_t)next_random(&seed);
        }
        memcpy(inputs, data + 5, sizeof inputs);
        if (round % 8 == 0) {
            command = FPWR;
            adp = 1001;
            odd_register(&seed, &at, data, &size);
        }
        int counter[2];
        bool fresh[2];
        for (int r = 0; r < 2; r++) {
            CHECK(round % 5 != 0 ||
                  fsn_segment_write_inputs(rigs[r].segment, 1, inputs, 8) == FSN_OK);
            counter[r] = datagram(&rigs[r], command, adp, at, data, size);
            CHECK(fsn_segment_read_outputs(rigs[r].segment, 0, outputs[r], 9, &fresh[r]) == FSN_OK);
        }
        for (unsigned i = 0; i < escs[1]->fmmu_count; i++) {
            inside += escs[0]->fmmus[i].inside != 0;
            escs[1]->fmmus[i].inside = 0;
        }
        CHECK(counter[0] == counter[1] && memcmp(rigs[0].data, rigs[1].data, size) == 0);
        CHECK(fresh[0] == fresh[1] && memcmp(outputs[0], outputs[1], 9) == 0);
        CHECK(memcmp(escs[0]->memory, escs[1]->memory, sizeof escs[0]->memory) == 0);
    }
    CHECK(inside > 1000);
    tear_down(&rigs[0]);
    tear_down(&rigs[1]);
}

/** FMMUs that end before they begin, or whose bits need more bytes than 16 bits can count: they map
 *  nothing. */
static void fmmus_of_nonsense_map_nothing(void) {
    static const struct {
        uint8_t length_low, length_high, first_bit, last_bit, physical_bit;
    } nonsense[] = {{1, 0, 5, 2, 0}, {1, 0, 7, 0, 7}, {0xFF, 0xFF, 0, 7, 7}, {0, 0, 0, 7, 0}};
    struct rig rig = set_up();
    set_stations(&rig);
    to_op(&rig, 1001, 0, 9);
    for (size_t i = 0; i < sizeof nonsense / sizeof nonsense[0]; i++) {
        const uint8_t fmmu[16] = {[4] = nonsense[i].length_low,
                                  [5] = nonsense[i].length_high,
                                  [6] = nonsense[i].first_bit,
                                  [7] = nonsense[i].last_bit,
                                  [9] = 0x11,
                                  [10] = nonsense[i].physical_bit,
                                  [11] = 3,
                                  [12] = 1};
        const uint8_t none[16] = {0};
        CHECK(datagram(&rig, FPWR, 1001, 0x0600, fmmu, 16) == 1);
        CHECK(datagram(&rig, FPWR, 1001, 0x0610, none, 16) == 1);
        CHECK(datagram(&rig, LRW, 0, 0, NULL, 200) == 0);
    }
    tear_down(&rig);
}

/** SM1 is made shorter than any answer after PREOP was granted; and then as long as it was. */
static void no_answer_into_a_mailbox_too_short(void) {
    static const uint8_t request[8] = {0x40, 0x00, 0x20, 0};
    static const uint8_t value[600] = {1, 2, 3};
    struct rig rig = set_up();
    set_stations(&rig);
    to_preop(&rig, 1001);
    CHECK(fsn_segment_set_object(rig.segment, 0, 0x2000, 0, value, sizeof value) == FSN_OK);
    for (uint16_t length = 0; length < 16; length++) {
        set_sm(&rig, 1001, 1, 0x1080, length, 0x22);
        post(&rig, request, 8);
        CHECK(datagram(&rig, FPRD, 1001, 0x080D, NULL, 1) == 1 && (rig.data[0] & 8) == 0);
    }
    static const uint8_t short_one[8] = {0x40, 0x18, 0x10, 1};
    for (uint16_t length = 0; length < 16; length++) {
        set_sm(&rig, 1001, 1, 0x1080, length, 0x22);
        post(&rig, short_one, 8);
        CHECK(rig.segment->escs[0].answer_bytes == 0);
    }
    set_sm(&rig, 1001, 1, 0x1080, 128, 0x22);
    CHECK(sdo(&rig, request, 8) == 122 && rig.data[8] == 0x41);
    /* In the middle of an upload as well: its segments find no room. */
    static const uint8_t segment[8] = {0x60};
    set_sm(&rig, 1001, 1, 0x1080, 8, 0x22);
    post(&rig, segment, 8);
    CHECK(datagram(&rig, FPRD, 1001, 0x080D, NULL, 1) == 1 && (rig.data[0] & 8) == 0);
    tear_down(&rig);
}

static void no_real_interface_is_taken(void) {
    struct rig rig = set_up();
    const struct fsn_segment_link_options absent = {.interface = "no-such-if"};
    const struct fsn_segment_link_options real = {.interface = "lo",
                                                  .no_machine_on_this_wire = true};
    CHECK(fsn_segment_link(rig.segment, &(struct fsn_segment_link_options){0}, NULL) == FSN_E_ARG);
    CHECK(fsn_segment_link(rig.segment, &absent, NULL) == FSN_E_SYS);
    const fsn_status lo = fsn_segment_link(rig.segment, &real, NULL);
    /* Nobody's word counts but in a test rig. SYS where raw sockets are not allowed. */
    CHECK(lo == FSN_E_ARG || lo == FSN_E_SYS || fsn_segment_test_rig());
    fsn_segment_unlink(rig.segment);
    tear_down(&rig);
}

int main(void) {
    const long alive = heap_alive();
    working_counters();
    hostile_frames_get_no_answer();
    frames_are_checked();
    the_watchdog_takes_its_time_from_the_registers();
    inputs_are_taken_with_their_first_byte();
    outputs_are_given_from_safeop_on();
    states_in_order_only();
    process_data_goes_both_ways();
    wrong_lengths_are_refused();
    mailbox_speaks_coe();
    watchdog_takes_it_out_of_op();
    unplugging_cuts_all_behind();
    any_datagram();
    an_fmmu_inside_a_sync_manager_does_as_others();
    fmmus_of_nonsense_map_nothing();
    no_answer_into_a_mailbox_too_short();
    no_real_interface_is_taken();
    CHECK(heap_alive() == alive);
    return 0;
}
