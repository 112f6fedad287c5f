/** Faults of the emulated segment: cables, power, errors on demand. */
#include <string.h>

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
    CHECK(shows(&rig, 2, 0x0110, 0x5611)); /* nothing behind it */
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
    CHECK(shows(&rig, 1, 0x0010, 0x0155));                       /* still knows its address */
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
    fsn_segment_power_cycle(rig.segment, 1); /* what is unplugged has no power to switch */
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

int main(void) {
    a_closed_ring_crosses_over();
    at_a_gap_each_half_answers();
    a_ring_survives_one_device();
    ports_tell_of_neighbours();
    a_cut_cable_keeps_the_device_alive();
    lost_links_count_to_255();
    receive_errors_are_forwarded();
    watchdogs_are_counted();
    return 0;
}
