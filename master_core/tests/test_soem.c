/** The SOEM backend against the emulated segment, over a veth pair in a network namespace of its
 *  own; skipped (77) where that cannot be made. */
#define _GNU_SOURCE

#include <arpa/inet.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <sched.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "fsn/acyclic.h"
#include "soem_rig.h"

enum { SKIPPED = 77 };

static void frames_flow(void) {
    struct rig *rig = bring_up();
    for (uint32_t k = 1; k < SUBDEVICES; k++) {
        CHECK(flows(rig, k));
        CHECK(look(rig, k).found == FSN_FOUND_RIGHT);
        CHECK(look(rig, k).returns == 0 || lateness(rig) > 0); /* no SubDevice is lost without a
                                                                * cause */
    }
    const struct fsn_statistics s = statistics(rig);
    CHECK(s.expected_wkc == 3 * SUBDEVICES && s.dc_time_ns != 0 && s.round_trip.count > 0);
    tear_down(rig);
}

/** Takes one away until it is reported which link is down: when frames are late those before it
 * count as lost as well, and then that is reported. */
static void unplug(struct rig *rig, uint32_t p) {
    for (int tries = 0;; tries++) {
        const uint64_t late = lateness(rig);
        fsn_segment_set_present(rig->segment, p, false);
        poll_until(rig, p, 0);
        CHECK(look(rig, p).found == FSN_FOUND_NOTHING);
        if (p == 0 ? strstr(look(rig, p).detail, "near") != NULL : look(rig, p).link_down) {
            return;
        }
        CHECK(lateness(rig) > late && tries < TRIES);
        fsn_segment_set_present(rig->segment, p, true);
        poll_until_all_in_op(rig);
    }
}

/** A SubDevice that is cut off is named; all others continue; one that returns is brought to OP
 *  again. */
static void each_is_unplugged_and_returns(void) {
    struct rig *rig = bring_up();
    for (uint32_t p = 0; p < SUBDEVICES; p++) {
        unplug(rig, p);
        for (uint32_t k = 1; k < SUBDEVICES; k++) {
            CHECK(k < p ? flows(rig, k) : !flows_soon(rig, k));
        }
        fsn_segment_set_present(rig->segment, p, true);
        poll_until_all_in_op(rig);
        for (uint32_t k = 1; k < SUBDEVICES; k++) {
            CHECK(flows(rig, k));
        }
        CHECK(look(rig, p).returns >= p + 1 && look(rig, p).found == FSN_FOUND_RIGHT);
    }
    tear_down(rig);
}

static void power_cycles_and_lost_frames(void) {
    struct rig *rig = bring_up();
    for (uint32_t p = 0; p < SUBDEVICES; p++) {
        fsn_segment_power_cycle(rig->segment, p);
        poll_until(rig, p, FSN_AL_OP);
        fsn_segment_lose(rig->segment, 7);
        for (uint32_t k = 1; k < SUBDEVICES; k++) {
            poll_until(rig, k, FSN_AL_OP);
            CHECK(flows(rig, k));
        }
    }
    const struct fsn_statistics s = statistics(rig);
    CHECK(s.counts.lost_frames > 0 && s.wkc_errors >= s.counts.lost_frames);
    tear_down(rig);
}

/** Holds answers back for a while; again when this machine sent too few frames meanwhile. */
static void stall(struct rig *rig, uint64_t ms) {
    const uint64_t old = statistics(rig).counts.old_replies;
    uint64_t again_ns = 0;
    while (statistics(rig).counts.old_replies - old < ms / 4) {
        if (now_ns() >= again_ns) {
            fsn_segment_stall(rig->segment, ms * 1000000);
            again_ns = now_ns() + 10 * ms * 1000000;
        }
        pause_ms(1);
    }
}

/** Waits until most replies are new: on a busy machine some come after the next frame was sent, and
 *  one that always lags never does so. */
static void settle(struct rig *rig) {
    for (int looks = 0;; looks++) {
        CHECK(looks < PATIENCE_MS / 50);
        const struct fsn_statistics before = statistics(rig);
        pause_ms(50);
        const struct fsn_statistics after = statistics(rig);
        if (2 * (after.counts.old_replies - before.counts.old_replies) <
            after.cycles - before.cycles) {
            return;
        }
    }
}

/** The segment holds everything back for a while and then gives it out at once; then it brings one
 *  answer again and again. Nothing old is ever taken for new. */
static void stalls_and_repetitions(void) {
    struct rig *rig = bring_up();
    for (uint64_t ms = 30; ms <= 200; ms += 34) {
        stall(rig, ms);
        for (uint32_t k = 1; k < SUBDEVICES; k++) {
            poll_until(rig, k, FSN_AL_OP);
            CHECK(flows(rig, k)); /* the newest bytes, not those of before the stall */
        }
        settle(rig);
    }
    /* SOEM's own frames get old answers as well: lost SubDevices are still found again. */
    fsn_segment_stall(rig->segment, 900000000);
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        fsn_segment_power_cycle(rig->segment, n);
    }
    for (int i = 0; i < 500; i++) {
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        pause_ms(2);
    }
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        poll_until(rig, n, FSN_AL_OP);
    }
    const uint64_t old = statistics(rig).counts.old_replies;
    fsn_segment_repeat(rig->segment, 100);
    while (statistics(rig).counts.old_replies < old + 50) {
        pause_ms(1);
    }
    CHECK(flows(rig, 1) && flows(rig, 2) && flows(rig, 3));
    tear_down(rig);
}

/** A part of the SII of a returning SubDevice reads as zeros: it is unknown, not another device. */
static void half_an_sii_is_no_other_device(void) {
    struct rig *rig = bring_up();
    const struct fsn_segment_identity half = {.vendor_id = 0, .product_code = 3, .revision = 4};
    fsn_segment_set_present(rig->segment, 3, false);
    poll_until(rig, 3, 0);
    CHECK(fsn_segment_set_identity(rig->segment, 3, &half) == FSN_OK);
    fsn_segment_set_present(rig->segment, 3, true);
    while (look(rig, 3).found != FSN_FOUND_UNKNOWN) {
        CHECK(look(rig, 3).found == FSN_FOUND_NOTHING && flows(rig, 1));
    }
    CHECK(strstr(look(rig, 3).detail, "its SII could not be read") != NULL);
    CHECK(fsn_segment_set_identity(rig->segment, 3, NULL) == FSN_OK);
    fsn_segment_power_cycle(rig->segment, 3);
    poll_until(rig, 3, FSN_AL_OP);
    tear_down(rig);
}

/** Another device, and correct ones in each other's place, stay in their state. */
static void wrong_devices_stay_out(void) {
    struct rig *rig = bring_up();
    const struct fsn_segment_identity other = {.vendor_id = 2, .product_code = 3, .revision = 4};
    fsn_segment_set_present(rig->segment, 3, false);
    poll_until(rig, 3, 0);
    CHECK(fsn_segment_set_identity(rig->segment, 3, &other) == FSN_OK);
    fsn_segment_set_present(rig->segment, 3, true);
    while (look(rig, 3).found != FSN_FOUND_IDENTITY) {
        CHECK(flows(rig, 1) && flows(rig, 2));
    }
    CHECK(look(rig, 3).vendor_id == 2 && look(rig, 3).product_code == 3);
    CHECK(strstr(look(rig, 3).detail, "found vendor 0x00000002") != NULL);
    CHECK(look(rig, 3).al_status == 0 && !flows_soon(rig, 3));
    CHECK(fsn_segment_set_identity(rig->segment, 3, NULL) == FSN_OK);
    fsn_segment_power_cycle(rig->segment, 3);
    poll_until(rig, 3, FSN_AL_OP);
    CHECK(flows(rig, 3));
    fsn_segment_set_present(rig->segment, 2, false);
    poll_until(rig, 2, 0);
    CHECK(fsn_segment_swap(rig->segment, 2, 3) == FSN_OK);
    fsn_segment_set_present(rig->segment, 2, true);
    while (look(rig, 2).found != FSN_FOUND_IDENTITY) {
        CHECK(flows(rig, 1));
    }
    CHECK(!flows_soon(rig, 2) && !flows_soon(rig, 3));
    tear_down(rig);
}

/** A returning SubDevice that refuses a start-up SDO stays in PREOP, named, until it accepts it; a
 *  slow one is waited for. */
static void who_refuses_is_asked_again(void) {
    struct rig *rig = bring_up();
    CHECK(fsn_segment_set_sdo_abort(rig->segment, 3, 0x8000, 1, 0x06090030) == FSN_OK);
    fsn_segment_power_cycle(rig->segment, 3);
    while (look(rig, 3).found != FSN_FOUND_SDO) {
        CHECK(flows(rig, 1) && flows(rig, 2));
    }
    CHECK(strstr(look(rig, 3).detail, "0x8000:01: abort code 0x06090030 value out of range") !=
          NULL);
    poll_until(rig, 3, FSN_AL_PREOP);
    CHECK(fsn_segment_set_sdo_abort(rig->segment, 3, 0x8000, 1, 0) == FSN_OK);
    CHECK(fsn_segment_set_al_delay(rig->segment, 3, 300000000) == FSN_OK);
    poll_until(rig, 3, FSN_AL_OP);
    CHECK(look(rig, 3).found == FSN_FOUND_RIGHT && look(rig, 3).returns >= 1 && flows(rig, 3));
    tear_down(rig);
}

/** Cuts a cable, and observes for a while; returns whether all SubDevices stayed in OP. */
static bool stays_up_without(struct rig *rig, uint32_t front) {
    uint32_t returns[SUBDEVICES];
    bool stayed = true;
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        returns[n] = look(rig, n).returns;
    }
    CHECK(fsn_segment_set_link(rig->segment, front, false) == FSN_OK);
    for (int i = 0; i < 5; i++) {
        for (uint32_t k = 1; k < SUBDEVICES; k++) {
            CHECK(flows(rig, k));
        }
    }
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        const struct fsn_bus_subdevice seen = look(rig, n);
        stayed = stayed && seen.al_status == FSN_AL_OP && seen.returns == returns[n];
    }
    return stayed;
}

/** The same, repeated if frames came so late meanwhile that a SubDevice was lost. */
static void nobody_minds_the_cut(struct rig *rig, uint32_t front) {
    uint64_t late = lateness(rig);
    for (int tries = 0; !stays_up_without(rig, front); tries++) {
        CHECK(lateness(rig) > late && tries < TRIES);
        CHECK(fsn_segment_set_link(rig->segment, front, true) == FSN_OK);
        poll_until_all_in_op(rig);
        late = lateness(rig);
    }
}

/** Polls the bus until the ring is in a state, and is open as given in that text. */
static struct fsn_bus_ring ring_becomes(struct rig *rig, uint8_t state, const char *place) {
    struct fsn_bus_ring ring = {0};
    for (int i = 0; i < PATIENCE_MS / 2; i++) {
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        CHECK(fsn_core_ring(rig->core, &ring) == FSN_OK);
        if (ring.state == state && strcmp(ring.place, place) == 0) {
            return ring;
        }
        pause_ms(2);
    }
    fprintf(stderr, "the ring is %s, \"%s\", not \"%s\"\n", fsn_ring_text(ring.state), ring.place,
            place);
    exit(1);
}

static void run(const char *command) {
    CHECK(system(command) == 0);
}

/** Names of the cables of the rig, from the first to the last. */
static const char *const cables[SUBDEVICES + 1] = {
    "between near and s0 (ring position 0, port 0)",
    "between s0 (ring position 0, port 1) and s1 (ring position 1, port 0)",
    "between s1 (ring position 1, port 1) and s2 (ring position 2, port 0)",
    "between s2 (ring position 2, port 1) and s3 (ring position 3, port 0)",
    "between s3 (ring position 3, port 1) and near2",
};
static const char first_dark[] = "between near (no link) and s0 (ring position 0, port 0)";
static const char last_dark[] = "between s3 (ring position 3, port 1) and near2 (no link)";

/** A cut cable of a ring has no effect on the data, and is named; so is an interface without a
 *  link. */
static void a_ring_survives_each_cable(void) {
    struct rig *rig = bring_up_from(set_up_with("far2"));
    CHECK(ring_becomes(rig, FSN_RING_CLOSED, "").breaks == 0);
    for (uint32_t cable = 0; cable <= SUBDEVICES; cable++) {
        const uint32_t front = cable == 0 ? FSN_NONE : cable - 1;
        for (uint32_t k = 1; k < SUBDEVICES; k++) {
            CHECK(flows(rig, k));
        }
        nobody_minds_the_cut(rig, front);
        const struct fsn_bus_ring cut = ring_becomes(rig, FSN_RING_OPEN, cables[cable]);
        CHECK(cut.breaks >= cable + 1 && cut.ways[0] == 0 && cut.ways[1] == 0);
        if (front != FSN_NONE && cable < SUBDEVICES) {
            while (look(rig, front).link[1] != 0 || look(rig, cable).link[0] != 0) {
                CHECK(flows(rig, 1)); /* one SubDevice after the other is requested its links */
            }
            while (strstr(look(rig, front).detail, "the ring is open at its port 1") == NULL) {
                CHECK(flows(rig, 1));
            }
            CHECK(look(rig, front).link_lost[1] > 0 && look(rig, cable).link_lost[0] > 0);
        }
        CHECK(fsn_segment_set_link(rig->segment, front, true) == FSN_OK);
        CHECK(ring_becomes(rig, FSN_RING_CLOSED, "").ways[1] == 1);
    }
    tear_down(rig);
}

static void all_flow(struct rig *rig) {
    for (uint32_t k = 1; k < SUBDEVICES; k++) {
        CHECK(flows(rig, k));
    }
    poll_until_all_in_op(rig);
}

/** Either interface may fail, the other one continues; without both the bus is lost, and comes
 *  back.
 */
static void each_interface_may_go(void) {
    struct rig *rig = bring_up_from(set_up_with("far2"));
    (void)ring_becomes(rig, FSN_RING_CLOSED, "");
    run("ip link set far down"); /* no carrier at the first */
    (void)ring_becomes(rig, FSN_RING_OPEN, first_dark);
    all_flow(rig);
    run("ip link set far2 down");
    (void)ring_becomes(rig, FSN_RING_OPEN,
                       "no SubDevice answers; near has no link, near2 has none");
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        poll_until(rig, n, FSN_AL_NONE);
        for (int polls = 0; strcmp(look(rig, n).detail, "neither near nor near2 has a link") != 0;
             polls++) { /* the note of the first loss is checked again */
            CHECK(polls < PATIENCE_MS / 2);
            fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
            pause_ms(2);
        }
    }
    run("ip link set far up");
    (void)ring_becomes(rig, FSN_RING_OPEN, last_dark);
    all_flow(rig);
    run("ip link set far2 up");
    (void)ring_becomes(rig, FSN_RING_CLOSED, "");
    all_flow(rig);
    run("ip link set near2 down"); /* the second card itself */
    for (int i = 0; i < 30; i++) {
        for (uint32_t k = 1; k < SUBDEVICES; k++) {
            (void)flows_soon(rig, k);
        }
    }
    for (uint32_t k = 1; k < SUBDEVICES; k++) {
        CHECK(flows(rig, k));
        poll_until(rig, k, FSN_AL_OP);
    }
    (void)ring_becomes(rig, FSN_RING_OPEN, last_dark);
    run("ip link set near2 up");
    (void)ring_becomes(rig, FSN_RING_CLOSED, "");
    tear_down(rig);
}

/** Opens a ring that is open already, and closes it. */
static void starts_open(uint32_t cable, const char *place) {
    struct rig *rig = set_up_with("far2");
    const uint32_t front = cable == 0 ? FSN_NONE : cable - 1;
    CHECK(fsn_segment_set_link(rig->segment, front, false) == FSN_OK);
    bring_up_from(rig);
    CHECK(ring_becomes(rig, FSN_RING_OPEN, place).breaks >= 1);
    all_flow(rig);
    CHECK(fsn_segment_set_link(rig->segment, front, true) == FSN_OK);
    (void)ring_becomes(rig, FSN_RING_CLOSED, "");
    all_flow(rig);
    CHECK(fsn_segment_set_link(rig->segment, front, false) == FSN_OK);
    (void)ring_becomes(rig, FSN_RING_OPEN, cables[cable]); /* now its ports are known */
    tear_down(rig);
}

/** A ring that is not closed at the start works as a line, from either end, and that is reported.
 */
static void a_ring_open_at_the_start_is_reported(void) {
    starts_open(0, cables[0]);
    starts_open(2, "between s1 (ring position 1) and s2 (ring position 2, port 0)");
    starts_open(SUBDEVICES, "between s3 (ring position 3) and near2");
    run("ip link set far down && ip link set far2 down");
    struct rig *rig = set_up_with("far2");
    CHECK(open_bus(rig) == FSN_E_BUS_SILENT);
    CHECK(strstr(rig->fault.detail, "neither near nor near2 has a link: cable") != NULL);
    tear_down(rig);
    run("ip link set far up && ip link set far2 up");
    rig = bring_up();
    struct fsn_bus_ring ring;
    CHECK(fsn_core_ring(rig->core, &ring) == FSN_E_STATE &&
          fsn_core_ring(NULL, &ring) == FSN_E_ARG);
    tear_down(rig);
}

/** Sends frames as another MainDevice does, with indices on both sides of our border. */
static void send_foreign(int frames) {
    uint8_t frame[60] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x01, 0x01,
                         0x01, 0x01, 0x01, 0x01, 0x88, 0xA4, 0x0D, 0x10};
    const struct sockaddr_ll at = {.sll_family = AF_PACKET,
                                   .sll_protocol = htons(0x88A4),
                                   .sll_ifindex = (int)if_nametoindex("near")};
    const int fd = socket(AF_PACKET, SOCK_RAW, 0);
    CHECK(fd >= 0);
    frame[16] = 7; /* BRD */
    frame[22] = 1; /* one byte */
    for (int i = 0; i < frames; i++) {
        frame[17] = i % 2 == 0 ? 0x03 : 0x83;
        CHECK(sendto(fd, frame, sizeof frame, 0, (const struct sockaddr *)&at, sizeof at) ==
              (ssize_t)sizeof frame);
    }
    close(fd);
}

/** Frames of another MainDevice are counted, each once, and none of ours: neither those of the
 *  cycle nor SOEM's own. */
static void foreign_frames_are_counted(void) {
    enum { FRAMES = 100 };
    struct rig *rig = bring_up();
    CHECK(flows(rig, 1) && statistics(rig).counts.foreign_frames == 0);
    send_foreign(FRAMES);
    for (int i = 0; statistics(rig).counts.foreign_frames < FRAMES; i++) {
        CHECK(i < PATIENCE_MS / 2);
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        pause_ms(2);
    }
    for (uint32_t k = 1; k < SUBDEVICES; k++) {
        CHECK(flows(rig, k));
    }
    CHECK(statistics(rig).counts.foreign_frames == FRAMES);
    tear_down(rig);
}

static void stops_step_by_step(void) {
    struct rig *rig = bring_up();
    for (int i = 0; i < PATIENCE_MS / 2 && !fsn_core_poll(rig->core, FSN_AL_SAFEOP, now_ns());
         i++) {
        pause_ms(2);
    }
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        CHECK(fsn_segment_al_status(rig->segment, n, NULL) == FSN_AL_SAFEOP);
    }
    fsn_core_free(rig->core);
    rig->core = NULL;
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        for (int i = 0; fsn_segment_al_status(rig->segment, n, NULL) != FSN_AL_INIT; i++) {
            CHECK(i < PATIENCE_MS); /* no one waited for an answer: it may still be on its way */
            pause_ms(1);
        }
    }
    tear_down(rig);
}

static void refuses(fsn_status status, const char *detail, struct rig *rig) {
    fsn_status got = open_bus(rig);
    for (int tries = 0; got != status && got != FSN_OK && tries < TRIES; tries++) {
        close_bus(rig);
        got = open_bus(rig);
    }
    if (got != status || strstr(rig->fault.detail, detail) == NULL) {
        fprintf(stderr, "%s: %s\n", fsn_status_name(got), rig->fault.detail);
        exit(1);
    }
    tear_down(rig);
}

static void refusals(void) {
    struct rig *rig = set_up();
    fsn_segment_set_present(rig->segment, 0, false);
    refuses(FSN_E_BUS_SILENT, "near has a link", rig);

    rig = set_up();
    fsn_segment_set_present(rig->segment, 2, false);
    refuses(FSN_E_BUS_MISSING, "2 SubDevices answer", rig);

    rig = set_up(); /* another product on the bus than in the plan */
    size_t len;
    fsn_plan_free(rig->plan);
    uint8_t *other = build(&len);
    other[192 + 48 + 12] ^= 1;
    build_fix_crc(other, len);
    CHECK(fsn_plan_load(other, len, &rig->plan, NULL) == FSN_OK);
    free(other);
    refuses(FSN_E_BUS_IDENTITY, "found vendor", rig);

    rig = set_up();
    CHECK(fsn_segment_set_sdo_abort(rig->segment, 3, 0x8000, 1, 0x06090011) == FSN_OK);
    refuses(FSN_E_BUS_SDO, "0x8000:01: abort code 0x06090011", rig);

    rig = bring_up();
    void *second;
    struct fsn_core *none;
    struct fsn_fault fault;
    const struct fsn_live_options options = {.interface = "near"};
    bool heard = false; /* it listens for a while; a busy machine may send nothing in it */
    for (int tries = 0; !heard && tries < TRIES; tries++) {
        CHECK(fsn_backend_soem()->create(&options, &second, NULL) == FSN_OK);
        CHECK(fsn_core_create(rig->plan, fsn_backend_soem()->ops, second, &none, &fault) ==
              FSN_E_BUS_BUSY);
        heard = strstr(fault.detail, "not ours") != NULL;
        fsn_backend_soem()->free(second);
    }
    CHECK(heard);
    CHECK(flows(rig, 1)); /* not detected */
    tear_down(rig);

    const struct fsn_live_options absent = {.interface = "absent"};
    const struct fsn_live_options too_long = {.interface = "an-interface-too-long"};
    CHECK(fsn_backend_soem()->create(&too_long, &second, NULL) == FSN_E_ARG);
    CHECK(fsn_backend_soem()->create(&absent, &second, NULL) == FSN_OK);
    rig = set_up();
    CHECK(fsn_core_create(rig->plan, fsn_backend_soem()->ops, second, &none, &fault) == FSN_E_SYS);
    CHECK(strstr(fault.rule, "unknown interface") != NULL && strcmp(fault.detail, "absent") == 0);
    fsn_backend_soem()->free(second);
    tear_down(rig);
}

/** Reads an object of the third SubDevice; again when an answer came too late. */
static fsn_status upload(struct rig *rig, struct fsn_transfer *transfer) {
    const uint32_t room = transfer->size_bytes;
    fsn_status status = FSN_E_BUS_MAILBOX;
    for (int tries = 0; status == FSN_E_BUS_MAILBOX && tries < TRIES; tries++) {
        transfer->size_bytes = room;
        status = fsn_core_upload(rig->core, 2, transfer);
    }
    return status;
}

/** A long object in segments, the SII and an alias, while frames flow. */
static void objects_and_sii_beside_the_cycle(void) {
    enum { LONG = 900 };
    struct rig *rig = bring_up();
    uint8_t written[LONG];
    static uint8_t data[FSN_SII_BYTES];
    for (size_t i = 0; i < LONG; i++) {
        written[i] = (uint8_t)(i * 3);
    }
    CHECK(fsn_segment_set_object(rig->segment, fsn_segment_position(rig->segment, 2), 0x2000, 1,
                                 written, LONG) == FSN_OK);
    struct fsn_transfer t = {.index = 0x2000, .sub = 1, .data = data, .size_bytes = LONG};
    CHECK(upload(rig, &t) == FSN_OK && t.size_bytes == LONG);
    CHECK(memcmp(data, written, LONG) == 0);
    t.size_bytes = LONG - 1;
    CHECK(upload(rig, &t) == FSN_E_SPACE);
    t = (struct fsn_transfer){.index = 0x5FFF, .data = data, .size_bytes = 8};
    CHECK(upload(rig, &t) == FSN_E_BUS_SDO && t.abort_code == 0x06020000);
    for (int tries = 0; fsn_core_alias_write(rig->core, 2, 0x1234) != FSN_OK; tries++) {
        CHECK(tries < TRIES);
    }
    for (int tries = 0; tries == 0 || t.size_bytes <= 128; tries++) {
        t.size_bytes = sizeof data;
        CHECK(fsn_core_sii_read(rig->core, 2, &t) == FSN_OK || tries < TRIES);
    }
    CHECK(data[8] == 0x34 && data[9] == 0x12);
    CHECK(flows(rig, 1));
    poll_until(rig, 2, FSN_AL_OP);
    fsn_segment_set_present(rig->segment, fsn_segment_position(rig->segment, 2), false);
    t = (struct fsn_transfer){.index = 0x2000, .sub = 1, .data = data, .size_bytes = LONG};
    CHECK(fsn_core_upload(rig->core, 2, &t) == FSN_E_BUS_MAILBOX);
    poll_until(rig, 2, 0); /* now it is known to be gone */
    CHECK(fsn_core_upload(rig->core, 2, &t) == FSN_E_BUS_MISSING);
    tear_down(rig);
}

int main(void) {
    if (!make_network()) {
        fprintf(stderr, "skipped: no network namespace with a veth pair can be made here\n");
        return SKIPPED;
    }
    objects_and_sii_beside_the_cycle();
    frames_flow();
    each_is_unplugged_and_returns();
    power_cycles_and_lost_frames();
    stalls_and_repetitions();
    half_an_sii_is_no_other_device();
    wrong_devices_stay_out();
    who_refuses_is_asked_again();
    a_ring_survives_each_cable();
    each_interface_may_go();
    a_ring_open_at_the_start_is_reported();
    foreign_frames_are_counted();
    stops_step_by_step();
    refusals();
    return 0;
}
