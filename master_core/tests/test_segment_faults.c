/** Faults of the emulated segment: cables, power, errors on demand. */
#include <string.h>

#include "heap.h"
#include "segment_rig.h"

/** Reads bytes of a register of one SubDevice by its place. */
static const uint8_t *peek(struct rig *rig, uint16_t place, uint16_t address, uint16_t size) {
    CHECK(datagram(rig, APRD, (uint16_t)(0u - place), address, NULL, size) == 1);
    return rig->data;
}

static bool shows(struct rig *rig, uint16_t place, uint16_t address, uint16_t wanted) {
    const uint8_t *at = peek(rig, place, address, 2);
    return (at[0] | at[1] << 8) == wanted;
}

static void ports_tell_of_neighbours(void) {
    struct rig rig = set_up_line(3);
    CHECK(peek(&rig, 0, 0x0007, 1)[0] == 0x0F);
    CHECK(shows(&rig, 0, 0x0110, 0x5A31));
    CHECK(shows(&rig, 1, 0x0110, 0x5A31));
    CHECK(shows(&rig, 2, 0x0110, 0x5611)); /* nothing after it */
    fsn_segment_set_present(rig.segment, 2, false);
    CHECK(shows(&rig, 1, 0x0110, 0x5611));
    CHECK(shows(&rig, 0, 0x0110, 0x5A31));
    fsn_segment_set_present(rig.segment, 2, true);
    CHECK(shows(&rig, 1, 0x0110, 0x5A31));
    tear_down(&rig);
}

static void a_cut_cable_keeps_the_device_alive(void) {
    struct rig rig = set_up_line(3);
    CHECK(datagram(&rig, BWR, 0, 0x0010, "\x55\x01", 2) == 3);
    CHECK(fsn_segment_set_link(rig.segment, 0, false) == FSN_OK);
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == 1);
    CHECK(shows(&rig, 0, 0x0110, 0x5611));
    CHECK(memcmp(peek(&rig, 0, 0x0310, 4), "\0\1\0\0", 4) == 0); /* at its port 1 */
    CHECK(fsn_segment_set_link(rig.segment, 0, true) == FSN_OK);
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == 3);
    CHECK(shows(&rig, 1, 0x0010, 0x0155));                       /* still has its address */
    CHECK(memcmp(peek(&rig, 1, 0x0310, 4), "\1\0\0\0", 4) == 0); /* at its port 0 */
    CHECK(memcmp(peek(&rig, 2, 0x0310, 4), "\0\0\0\0", 4) == 0);
    CHECK(fsn_segment_set_link(rig.segment, FSN_NONE, false) == FSN_OK);
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == -1);
    CHECK(fsn_segment_set_link(rig.segment, FSN_NONE, true) == FSN_OK);
    CHECK(peek(&rig, 0, 0x0310, 1)[0] == 1);
    CHECK(fsn_segment_set_link(rig.segment, 3, false) == FSN_E_ARG);
    tear_down(&rig);
}

static void lost_links_count_to_255(void) {
    struct rig rig = set_up_line(2);
    for (int i = 0; i < 300; i++) {
        fsn_segment_power_cycle(rig.segment, 1);
        CHECK(i != 2 || peek(&rig, 0, 0x0311, 1)[0] == 3);
    }
    CHECK(peek(&rig, 0, 0x0311, 1)[0] == 255);
    CHECK(peek(&rig, 1, 0x0310, 1)[0] == 0); /* its own counters are lost with its power */
    CHECK(fsn_segment_rx_errors(rig.segment, 0, 1, 3) == FSN_OK);
    CHECK(datagram(&rig, APWR, 0, 0x0313, "", 1) == 1); /* any of them clears all of them */
    CHECK(peek(&rig, 0, 0x0311, 1)[0] == 0);
    CHECK(peek(&rig, 0, 0x0302, 1)[0] == 3); /* and no others */
    fsn_segment_set_present(rig.segment, 1, false);
    fsn_segment_power_cycle(rig.segment, 1); /* an unplugged SubDevice has no power to switch */
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == 1);
    CHECK(peek(&rig, 0, 0x0311, 1)[0] == 1);
    tear_down(&rig);
}

static void receive_errors_are_forwarded(void) {
    struct rig rig = set_up_line(3);
    CHECK(fsn_segment_rx_errors(rig.segment, 1, 0, 2) == FSN_OK);
    CHECK(memcmp(peek(&rig, 1, 0x0300, 4), "\2\2\0\0", 4) == 0);
    CHECK(peek(&rig, 2, 0x0308, 1)[0] == 2);
    CHECK(peek(&rig, 0, 0x0308, 1)[0] == 0);
    CHECK(fsn_segment_set_link(rig.segment, 1, false) == FSN_OK); /* after the second one */
    CHECK(fsn_segment_rx_errors(rig.segment, 0, 0, 1) == FSN_OK);
    CHECK(fsn_segment_set_link(rig.segment, 1, true) == FSN_OK);
    CHECK(peek(&rig, 1, 0x0308, 1)[0] == 1 && peek(&rig, 2, 0x0308, 1)[0] == 2);
    CHECK(fsn_segment_rx_errors(rig.segment, 1, 0, 0xFFFFFFFFu) == FSN_OK);
    CHECK(peek(&rig, 1, 0x0300, 1)[0] == 255);
    CHECK(fsn_segment_rx_errors(rig.segment, 1, 2, 1) == FSN_E_ARG);
    CHECK(fsn_segment_rx_errors(rig.segment, 3, 0, 1) == FSN_E_ARG);
    CHECK(datagram(&rig, BWR, 0, 0x0300, "12345678901234567890", 20) == 3);
    CHECK(peek(&rig, 1, 0x0300, 1)[0] == 0);
    tear_down(&rig);
}

static void watchdogs_are_counted(void) {
    struct rig rig = set_up();
    set_stations(&rig);
    for (int round = 0; round < 2; round++) {
        to_op(&rig, 1001, 0, 9);
        CHECK(datagram(&rig, LWR, 0, 0, "123456789", 9) == 1);
        rig.now_ns += 200000000;
        fsn_segment_idle(rig.segment, rig.now_ns);
        CHECK(al(&rig, 0) == 0x14);
        CHECK(write16(&rig, FPWR, 1001, 0x0120, 0x11) == 1);
    }
    CHECK(shows(&rig, 0, 0x0442, 2));
    CHECK(datagram(&rig, APWR, 0, 0x0443, "", 1) == 1);
    CHECK(shows(&rig, 0, 0x0442, 0));
    const uint8_t times[0x44] = {0xC2, 0x09, [0x20] = 0x88, [0x42] = 7};
    CHECK(datagram(&rig, APWR, 0, 0x0400, times, sizeof times) == 1);
    CHECK(shows(&rig, 0, 0x0442, 0) && shows(&rig, 0, 0x0420, 0x0088));
    tear_down(&rig);
}

static int broadcast(struct rig *rig, uint32_t port) {
    rig->port = port;
    const int counter = datagram(rig, BRD, 0, 0, NULL, 1);
    rig->port = 0;
    return counter;
}

static void a_closed_ring_crosses_over(void) {
    struct rig rig = set_up_line(4);
    CHECK(broadcast(&rig, 1) == -1); /* no second cable yet */
    fsn_segment_set_ring(rig.segment, true);
    CHECK(broadcast(&rig, 0) == 4 && rig.out_port == 1);
    CHECK(broadcast(&rig, 1) == 0 && rig.out_port == 0); /* passed, not processed */
    CHECK(broadcast(&rig, 2) == -1);
    CHECK(shows(&rig, 3, 0x0110, 0x5A31));
    fsn_segment_set_ring(rig.segment, false);
    CHECK(broadcast(&rig, 0) == 4 && rig.out_port == 0);
    CHECK(shows(&rig, 3, 0x0110, 0x5611));
    tear_down(&rig);
}

static void at_a_gap_each_half_answers(void) {
    struct rig rig = set_up_line(4);
    fsn_segment_set_ring(rig.segment, true);
    for (uint32_t behind = 0; behind < 3; behind++) {
        CHECK(fsn_segment_set_link(rig.segment, behind, false) == FSN_OK);
        CHECK(broadcast(&rig, 0) == (int)behind + 1 && rig.out_port == 0);
        CHECK(broadcast(&rig, 1) == 3 - (int)behind && rig.out_port == 1);
        /* From the second port the one at the gap is the first that processes. */
        rig.port = 1;
        CHECK(write16(&rig, APWR, 0, 0x0010, 0x0777) == 1);
        rig.port = 0;
        CHECK(fsn_segment_set_link(rig.segment, behind, true) == FSN_OK);
        CHECK(shows(&rig, (uint16_t)(behind + 1), 0x0010, 0x0777));
        CHECK(broadcast(&rig, 0) == 4 && rig.out_port == 1);
    }
    CHECK(fsn_segment_set_link(rig.segment, FSN_NONE, false) == FSN_OK);
    CHECK(broadcast(&rig, 0) == -1);
    CHECK(broadcast(&rig, 1) == 4 && rig.out_port == 1);
    CHECK(fsn_segment_set_link(rig.segment, FSN_NONE, true) == FSN_OK);
    CHECK(fsn_segment_set_link(rig.segment, 3, false) == FSN_OK);
    CHECK(broadcast(&rig, 0) == 4 && rig.out_port == 0);
    CHECK(broadcast(&rig, 1) == -1);
    tear_down(&rig);
}

static void a_ring_survives_one_device(void) {
    struct rig rig = set_up_line(4);
    fsn_segment_set_ring(rig.segment, true);
    fsn_segment_set_present(rig.segment, 1, false);
    CHECK(broadcast(&rig, 0) == 1 && broadcast(&rig, 1) == 2);
    CHECK(peek(&rig, 0, 0x0311, 1)[0] == 1);
    fsn_segment_set_present(rig.segment, 3, false); /* two gaps: the one between is out of reach */
    CHECK(broadcast(&rig, 0) == 1 && broadcast(&rig, 1) == -1);
    fsn_segment_set_present(rig.segment, 1, true);
    fsn_segment_set_present(rig.segment, 3, true);
    CHECK(broadcast(&rig, 0) == 4 && rig.out_port == 1);
    CHECK(memcmp(peek(&rig, 2, 0x0310, 2), "\1\1", 2) == 0);
    tear_down(&rig);
}

static const uint8_t read_product[8] = {0x40, 0x18, 0x10, 2};

static void another_device_answers(void) {
    struct rig rig = set_up();
    const struct fsn_segment_identity other = {.vendor_id = 7, .product_code = 0xABCD};
    const uint8_t read_sii[6] = {0, 1, 8, 0, 0, 0};
    CHECK(fsn_segment_set_identity(rig.segment, 0, &other) == FSN_OK);
    CHECK(fsn_segment_set_identity(rig.segment, 2, &other) == FSN_E_ARG);
    CHECK(datagram(&rig, APWR, 0, 0x0502, read_sii, 6) == 1);
    CHECK(peek(&rig, 0, 0x0508, 8)[0] == 2); /* only when it is switched on */
    fsn_segment_power_cycle(rig.segment, 0);
    CHECK(datagram(&rig, APWR, 0, 0x0502, read_sii, 6) == 1);
    CHECK(memcmp(peek(&rig, 0, 0x0508, 8), "\7\0\0\0\xCD\xAB\0\0", 8) == 0);
    set_stations(&rig);
    to_preop(&rig, 1001);
    CHECK(sdo(&rig, read_product, 8) == 10 && rig.data[12] == 0xCD && rig.data[13] == 0xAB);
    CHECK(fsn_segment_set_identity(rig.segment, 0, NULL) == FSN_OK);
    fsn_segment_power_cycle(rig.segment, 0);
    set_stations(&rig);
    to_preop(&rig, 1001);
    CHECK(sdo(&rig, read_product, 8) == 10 && rig.data[12] == 0x00 && rig.data[13] == 0x10);
    tear_down(&rig);
}

static void objects_abort_on_demand(void) {
    struct rig rig = set_up();
    set_stations(&rig);
    to_preop(&rig, 1001);
    CHECK(fsn_segment_set_sdo_abort(rig.segment, 0, 0x1018, 2, 0x08000021) == FSN_OK);
    CHECK(sdo(&rig, read_product, 8) == 10 && rig.data[8] == 0x80);
    CHECK(memcmp(rig.data + 9, "\x18\x10\2\x21\0\0\x08", 7) == 0);
    const uint8_t read_vendor[8] = {0x40, 0x18, 0x10, 1};
    CHECK(sdo(&rig, read_vendor, 8) == 10 && rig.data[8] == 0x43);
    CHECK(fsn_segment_set_sdo_abort(rig.segment, 0, 0x1018, FSN_NONE, 1) == FSN_OK);
    CHECK(sdo(&rig, read_vendor, 8) == 10 && rig.data[8] == 0x80 && rig.data[12] == 1);
    CHECK(fsn_segment_set_sdo_abort(rig.segment, 0, 0x1018, FSN_NONE, 0) == FSN_OK);
    CHECK(fsn_segment_set_sdo_abort(rig.segment, 0, 0x1018, 2, 0) == FSN_OK);
    CHECK(fsn_segment_set_sdo_abort(rig.segment, 0, 0x1018, 2, 0) == FSN_OK); /* twice is fine */
    CHECK(sdo(&rig, read_product, 8) == 10 && rig.data[8] == 0x43);
    CHECK(fsn_segment_set_sdo_abort(rig.segment, 0, 0x1018, 256, 1) == FSN_E_ARG);
    for (uint16_t i = 0; i < 16; i++) {
        CHECK(fsn_segment_set_sdo_abort(rig.segment, 0, (uint16_t)(0x2000 + i), 0, 1) == FSN_OK);
    }
    CHECK(fsn_segment_set_sdo_abort(rig.segment, 0, 0x3000, 0, 1) == FSN_E_NOMEM);
    CHECK(fsn_segment_set_sdo_abort(rig.segment, 0, 0x2000, 0, 2) == FSN_OK); /* replaced */
    tear_down(&rig);
}

static void answers_and_states_wait(void) {
    struct rig rig = set_up();
    set_stations(&rig);
    to_preop(&rig, 1001);
    CHECK(fsn_segment_set_mailbox_delay(rig.segment, 0, 5000000) == FSN_OK);
    CHECK(fsn_segment_set_mailbox_delay(rig.segment, 9, 1) == FSN_E_ARG);
    post(&rig, read_product, 8);
    CHECK(datagram(&rig, FPRD, 1001, 0x1080, NULL, 128) == 0);
    rig.now_ns += 5000000;
    fsn_segment_idle(rig.segment, rig.now_ns);
    CHECK(datagram(&rig, FPRD, 1001, 0x1080, NULL, 128) == 1);
    CHECK(fsn_segment_set_al_delay(rig.segment, 0, 20000000) == FSN_OK);
    CHECK(fsn_segment_set_al_delay(rig.segment, 9, 1) == FSN_E_ARG);
    CHECK(write16(&rig, FPWR, 1001, 0x0120, 0x11) == 1);
    CHECK(al(&rig, 0) == 2);
    rig.now_ns += 19000000;
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == 2);
    CHECK(al(&rig, 0) == 1);
    CHECK(fsn_segment_set_al_delay(rig.segment, 0, 0) == FSN_OK);
    to_preop(&rig, 1001);
    CHECK(al(&rig, 0) == 2);
    tear_down(&rig);
}

static void swapped_devices_answer_at_the_other_place(void) {
    struct rig rig = set_up_line(3);
    set_stations(&rig);
    CHECK(fsn_segment_swap(rig.segment, 0, 2) == FSN_OK);
    CHECK(datagram(&rig, FPRD, 1001, 0, NULL, 1) == 0); /* it was switched off */
    const uint8_t read_sii[6] = {0, 1, 8, 0, 0, 0};
    CHECK(datagram(&rig, BWR, 0, 0x0502, read_sii, 6) == 3);
    CHECK(peek(&rig, 0, 0x050C, 1)[0] == 2); /* product 0x1002 */
    CHECK(peek(&rig, 2, 0x050C, 1)[0] == 0);
    CHECK(peek(&rig, 1, 0x0310, 2)[0] == 1 && rig.data[1] == 1); /* lost both neighbours */
    CHECK(shows(&rig, 2, 0x0110, 0x5611));
    fsn_segment_set_present(rig.segment, 2, false); /* the device, at the first place now */
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == -1);
    CHECK(fsn_segment_swap(rig.segment, 2, 0) == FSN_OK);
    CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == 2); /* still unplugged, at the end again */
    CHECK(fsn_segment_swap(rig.segment, 1, 1) == FSN_E_ARG);
    CHECK(fsn_segment_swap(rig.segment, 1, 3) == FSN_E_ARG);
    tear_down(&rig);
}

static void every_nth_frame_is_lost(void) {
    struct rig rig = set_up_line(1);
    fsn_segment_lose_every(rig.segment, 3);
    for (int i = 1; i <= 12; i++) {
        CHECK((datagram(&rig, BRD, 0, 0, NULL, 1) == -1) == (i % 3 == 0));
    }
    fsn_segment_lose_every(rig.segment, 0);
    for (int i = 0; i < 4; i++) {
        CHECK(datagram(&rig, BRD, 0, 0, NULL, 1) == 1);
    }
    struct fsn_segment_counts counts;
    fsn_segment_counts(rig.segment, &counts);
    CHECK(counts.lost == 4 && counts.frames == 12);
    tear_down(&rig);
}

/** Puts a broadcast read with an index on the wire. */
static void put_in(struct rig *rig, uint8_t index, uint64_t now_ns) {
    uint8_t frame[29] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 1,    1,  1,
                         1,    1,    1,    0x88, 0xA4, 13,   0x10, BRD};
    frame[17] = index;
    frame[22] = 1;
    fsn_segment_send(rig->segment, 0, frame, sizeof frame, now_ns);
}

/** Returns the index of the next answer, -1 when there is none. */
static int take_out(struct rig *rig, uint64_t now_ns) {
    uint8_t frame[1536];
    uint32_t port = 9;
    const size_t len = fsn_segment_receive(rig->segment, frame, sizeof frame, now_ns, &port);
    CHECK(len == 0 || (len == 29 && port == 0 && frame[27] == 1));
    return len == 0 ? -1 : frame[17];
}

static void the_wire_delays_stalls_and_repeats(void) {
    struct rig rig = set_up_line(1);
    put_in(&rig, 1, 100);
    CHECK(fsn_segment_wait(rig.segment, 100) == 0);
    CHECK(take_out(&rig, 100) == 1 && take_out(&rig, 100) == -1);
    CHECK(fsn_segment_wait(rig.segment, 100) == UINT64_MAX);
    fsn_segment_set_delay(rig.segment, 500);
    put_in(&rig, 2, 1000);
    put_in(&rig, 3, 1100);
    CHECK(fsn_segment_wait(rig.segment, 1200) == 300);
    CHECK(take_out(&rig, 1499) == -1);
    CHECK(take_out(&rig, 1500) == 2 && take_out(&rig, 1500) == -1);
    fsn_segment_set_delay(rig.segment, 0);
    put_in(&rig, 4, 1550);
    CHECK(take_out(&rig, 1550) == -1); /* no frame overtakes another */
    CHECK(take_out(&rig, 1600) == 3 && take_out(&rig, 1600) == 4);
    fsn_segment_stall(rig.segment, 1000);
    put_in(&rig, 5, 2000);
    put_in(&rig, 6, 2500);
    CHECK(take_out(&rig, 2999) == -1);
    CHECK(take_out(&rig, 3000) == 5 && take_out(&rig, 3000) == 6 && take_out(&rig, 3000) == -1);
    fsn_segment_repeat(rig.segment, 2);
    for (uint8_t i = 10; i < 14; i++) {
        put_in(&rig, i, 4000);
    }
    static const int wanted[] = {10, 11, 10, 12, 10, 13, -1};
    for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; i++) {
        CHECK(take_out(&rig, 4000) == wanted[i]);
    }
    tear_down(&rig);
}

static void the_wire_has_an_end(void) {
    struct rig rig = set_up_line(1);
    static uint8_t giant[2000];
    fsn_segment_send(rig.segment, 0, giant, sizeof giant, 1);
    CHECK(fsn_segment_receive(rig.segment, giant, 100, 1, NULL) == 0);
    fsn_segment_stall(rig.segment, 1000);
    for (int i = 0; i < 1030; i++) {
        put_in(&rig, (uint8_t)i, 10);
    }
    for (int i = 0; i < 1024; i++) {
        CHECK(take_out(&rig, 2000) == i % 256);
    }
    CHECK(take_out(&rig, 2000) == -1);
    struct fsn_segment_counts counts;
    fsn_segment_counts(rig.segment, &counts);
    CHECK(counts.lost == 6 && counts.foreign == 1);
    tear_down(&rig);
}

static void objects_are_set(void) {
    struct rig rig = set_up();
    set_stations(&rig);
    to_preop(&rig, 1001);
    const uint8_t read_address[8] = {0x40, 0x80, 0xF9, 1};
    CHECK(fsn_segment_set_object(rig.segment, 0, 0xF980, 1, "\x34\x12", 2) == FSN_OK);
    CHECK(sdo(&rig, read_address, 8) == 10 && rig.data[12] == 0x34 && rig.data[13] == 0x12);
    CHECK(fsn_segment_set_object(rig.segment, 0, 0xF980, 1, "\x35\x12", 2) == FSN_OK);
    CHECK(fsn_segment_set_object(rig.segment, 0, 0xF980, 1, "\x35", 1) == FSN_E_ARG);
    CHECK(fsn_segment_set_object(rig.segment, 2, 0xF980, 1, "\x35", 1) == FSN_E_ARG);
    fsn_segment_power_cycle(rig.segment, 0); /* a switch at the device, no memory */
    set_stations(&rig);
    to_preop(&rig, 1001);
    CHECK(sdo(&rig, read_address, 8) == 10 && rig.data[12] == 0x35);
    tear_down(&rig);
}

static void objects_are_written_and_read(void) {
    struct rig rig = set_up();
    set_stations(&rig);
    to_preop(&rig, 1001);
    uint8_t value[2] = {0};
    CHECK(fsn_segment_get_object(rig.segment, 0, 0x6098, 0, value, 2) == FSN_E_ARG);
    CHECK(fsn_segment_offer_object(rig.segment, 0, 0x6098, 0, "\x34\x12", 2) == FSN_OK);
    CHECK(fsn_segment_get_object(rig.segment, 0, 0x6098, 0, value, 2) == FSN_OK);
    CHECK(value[0] == 0x34 && value[1] == 0x12);
    const uint8_t write[8] = {0x2B, 0x98, 0x60, 0, 0x78, 0x56};
    sdo(&rig, write, 8);
    CHECK(rig.data[8] == 0x60);
    CHECK(fsn_segment_get_object(rig.segment, 0, 0x6098, 0, value, 2) == FSN_OK);
    CHECK(value[0] == 0x78 && value[1] == 0x56);
    CHECK(fsn_segment_get_object(rig.segment, 0, 0x6098, 0, value, 1) == FSN_E_ARG);
    CHECK(fsn_segment_get_object(rig.segment, 0, 0x6098, 1, value, 2) == FSN_E_ARG);
    CHECK(fsn_segment_get_object(rig.segment, 0, 0x6098, 0, NULL, 2) == FSN_E_ARG);
    CHECK(fsn_segment_get_object(rig.segment, 9, 0x6098, 0, value, 2) == FSN_E_ARG);
    CHECK(fsn_segment_offer_object(rig.segment, 9, 0x6098, 0, value, 2) == FSN_E_ARG);
    fsn_segment_power_cycle(rig.segment, 0);
    CHECK(fsn_segment_get_object(rig.segment, 0, 0x6098, 0, value, 2) == FSN_OK);
    CHECK(value[0] == 0x34 && value[1] == 0x12);
    /* What is only shown stays as it is. */
    CHECK(fsn_segment_set_object(rig.segment, 0, 0x6041, 0, "\x50\x02", 2) == FSN_OK);
    set_stations(&rig);
    to_preop(&rig, 1001);
    const uint8_t refused[8] = {0x2B, 0x41, 0x60, 0, 0x78, 0x56};
    sdo(&rig, refused, 8);
    CHECK(rig.data[8] == 0x80);
    CHECK(fsn_segment_get_object(rig.segment, 0, 0x6041, 0, value, 2) == FSN_OK);
    CHECK(value[0] == 0x50);
    tear_down(&rig);
}

int main(void) {
    const long alive = heap_alive();
    another_device_answers();
    objects_abort_on_demand();
    answers_and_states_wait();
    swapped_devices_answer_at_the_other_place();
    every_nth_frame_is_lost();
    the_wire_delays_stalls_and_repeats();
    the_wire_has_an_end();
    objects_are_set();
    objects_are_written_and_read();
    a_closed_ring_crosses_over();
    at_a_gap_each_half_answers();
    a_ring_survives_one_device();
    ports_tell_of_neighbours();
    a_cut_cable_keeps_the_device_alive();
    lost_links_count_to_255();
    receive_errors_are_forwarded();
    watchdogs_are_counted();
    CHECK(heap_alive() == alive);
    return 0;
}
