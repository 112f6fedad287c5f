/** The SOEM backend against the emulated segment, over a veth pair in a network namespace of its
 *  own; skipped (77) where that cannot be made. */
#define _GNU_SOURCE

#include <sched.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "builder.h"
#include "fsn/acyclic.h"
#include "fsn/fsn.h"
#include "fsn/live.h"
#include "fsn/segment.h"

enum { SKIPPED = 77, SUBDEVICES = 4, FRAME = 6, PATIENCE_MS = 20000 };

struct rig {
    uint8_t *bytes;
    struct fsn_plan *plan, *plan_of_segment;
    struct fsn_segment *segment;
    void *bus;
    struct fsn_core *core;
    struct fsn_fault fault;
    const char *second; /**< interface at the other end of the ring */
    uint8_t beat;       /**< what the SubDevices deliver, changed by each check */
};

static uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static void pause_ms(long ms) {
    const struct timespec pause = {.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000};
    nanosleep(&pause, NULL);
}

/** A main at position 0 and three subs behind it. */
static uint8_t *build(size_t *len) {
    static const struct build_sm sms[SUBDEVICES][2] = {{{FSN_OUTPUT, 18}, {FSN_INPUT, 18}},
                                                       {{FSN_OUTPUT, 6}, {FSN_INPUT, 7}},
                                                       {{FSN_OUTPUT, 6}, {FSN_INPUT, 6}},
                                                       {{FSN_OUTPUT, 8}, {FSN_INPUT, 6}}};
    static const struct build_copy copies[] = {{0, 0, 1, 0, FRAME},  {1, 0, 0, 0, FRAME},
                                               {0, 6, 2, 0, FRAME},  {2, 0, 0, 6, FRAME},
                                               {0, 12, 3, 0, FRAME}, {3, 0, 0, 12, FRAME}};
    const struct build b = {.subdevices = SUBDEVICES,
                            .sm = sms,
                            .copies = copies,
                            .pairs = SUBDEVICES - 1,
                            .cycle_ns = 1000000,
                            .sdo_count = 1};
    return build_plan(&b, len);
}

static struct rig *set_up_with(const char *second) {
    struct rig *rig = calloc(1, sizeof *rig);
    CHECK(rig != NULL);
    size_t len;
    rig->bytes = build(&len);
    CHECK(fsn_plan_load(rig->bytes, len, &rig->plan, NULL) == FSN_OK);
    CHECK(fsn_plan_load(rig->bytes, len, &rig->plan_of_segment, NULL) == FSN_OK);
    CHECK(fsn_segment_create(rig->plan_of_segment, &rig->segment) == FSN_OK);
    const struct fsn_segment_link_options options = {.interface = "far", .interface2 = second};
    CHECK(fsn_segment_link(rig->segment, &options, NULL) == FSN_OK);
    rig->second = second != NULL ? "near2" : NULL;
    return rig;
}

static struct rig *set_up(void) {
    return set_up_with(NULL);
}

static fsn_status open_bus(struct rig *rig) {
    const struct fsn_live_options options = {
        .interface = "near", .redundant = rig->second, .dc_every = 5};
    CHECK(fsn_backend_soem()->create(&options, &rig->bus, &rig->fault) == FSN_OK);
    const fsn_status status =
        fsn_core_create(rig->plan, fsn_backend_soem()->ops, rig->bus, &rig->core, &rig->fault);
    CHECK(status == FSN_OK || (rig->core == NULL && rig->fault.status == status));
    return status;
}

static void tear_down(struct rig *rig) {
    fsn_core_free(rig->core);
    fsn_backend_soem()->free(rig->bus);
    fsn_segment_free(rig->segment);
    fsn_plan_free(rig->plan);
    fsn_plan_free(rig->plan_of_segment);
    free(rig->bytes);
    free(rig);
}

static struct fsn_bus_subdevice look(struct rig *rig, uint32_t n) {
    struct fsn_bus_subdevice seen;
    CHECK(fsn_core_subdevice(rig->core, n, &seen) == FSN_OK);
    return seen;
}

/** The writer may be faster than every attempt, under a sanitizer at least. */
static struct fsn_statistics statistics(struct rig *rig) {
    struct fsn_statistics s;
    fsn_status status = FSN_E_BUSY;
    while (status == FSN_E_BUSY) {
        status = fsn_core_snapshot(rig->core, &s, NULL, NULL);
    }
    CHECK(status == FSN_OK);
    return s;
}

/** Tends the bus until a SubDevice has an AL state, or none (0); fails after long. */
static void tend_until(struct rig *rig, uint32_t n, uint8_t al_state) {
    for (int i = 0; i < PATIENCE_MS / 2; i++) {
        fsn_core_tend(rig->core, FSN_AL_OP, now_ns());
        if (look(rig, n).al_status == al_state) {
            return;
        }
        pause_ms(2);
    }
    fprintf(stderr, "SubDevice %u: AL 0x%02x code 0x%04x, %s\n", n, look(rig, n).al_status,
            look(rig, n).al_code, look(rig, n).detail);
    exit(1);
}

static struct rig *bring_up_from(struct rig *rig) {
    if (open_bus(rig) != FSN_OK) {
        fprintf(stderr, "%s: %s\n", rig->fault.rule, rig->fault.detail);
        exit(1);
    }
    const struct fsn_thread_options thread = {.cycle_ns = 1000000};
    CHECK(fsn_core_start(rig->core, &thread, NULL) == FSN_OK);
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        tend_until(rig, n, FSN_AL_OP);
    }
    return rig;
}

static struct rig *bring_up(void) {
    return bring_up_from(set_up());
}

/** Whether a frame goes from sub `k` to its place in the main, and one from there to the sub. */
static bool flows(struct rig *rig, uint32_t k) {
    uint8_t inputs[18], outputs[18];
    const uint32_t sizes[] = {18, 7, 6, 6};
    const uint32_t out_sizes[] = {18, 6, 6, 8};
    rig->beat++;
    memset(inputs, rig->beat, sizeof inputs);
    CHECK(fsn_segment_write_inputs(rig->segment, 2 * k + 1, inputs, sizes[k]) == FSN_OK);
    CHECK(fsn_segment_write_inputs(rig->segment, 1, inputs, sizes[0]) == FSN_OK);
    for (int i = 0; i < 100; i++) {
        fsn_core_tend(rig->core, FSN_AL_OP, now_ns());
        pause_ms(2);
        bool there = true;
        CHECK(fsn_segment_read_outputs(rig->segment, 0, outputs, out_sizes[0], NULL) == FSN_OK);
        there = there && memcmp(outputs + FRAME * (k - 1), inputs, FRAME) == 0;
        CHECK(fsn_segment_read_outputs(rig->segment, 2 * k, outputs, out_sizes[k], NULL) == FSN_OK);
        if (there && memcmp(outputs, inputs, FRAME) == 0) {
            return true;
        }
    }
    return false;
}

static void frames_flow(void) {
    struct rig *rig = bring_up();
    for (uint32_t k = 1; k < SUBDEVICES; k++) {
        CHECK(flows(rig, k));
        CHECK(look(rig, k).found == FSN_FOUND_RIGHT && look(rig, k).returns == 0);
    }
    const struct fsn_statistics s = statistics(rig);
    CHECK(s.expected_wkc == 3 * SUBDEVICES && s.dc_time_ns != 0 && s.round_trip.count > 0);
    tear_down(rig);
}

/** Whoever is cut off is named; all others go on; whoever returns is led to OP again. */
static void each_is_unplugged_and_returns(void) {
    struct rig *rig = bring_up();
    for (uint32_t p = 0; p < SUBDEVICES; p++) {
        fsn_segment_set_present(rig->segment, p, false);
        tend_until(rig, p, 0);
        CHECK(look(rig, p).found == FSN_FOUND_NOTHING);
        CHECK(strstr(look(rig, p).detail, p == 0 ? "near" : "is down") != NULL);
        for (uint32_t k = 1; k < SUBDEVICES; k++) {
            CHECK(flows(rig, k) == (k < p));
        }
        fsn_segment_set_present(rig->segment, p, true);
        for (uint32_t k = 0; k < SUBDEVICES; k++) {
            tend_until(rig, k, FSN_AL_OP);
        }
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
        tend_until(rig, p, FSN_AL_OP);
        fsn_segment_lose(rig->segment, 7);
        for (uint32_t k = 1; k < SUBDEVICES; k++) {
            tend_until(rig, k, FSN_AL_OP);
            CHECK(flows(rig, k));
        }
    }
    const struct fsn_statistics s = statistics(rig);
    CHECK(s.lost_frames > 0 && s.wkc_errors >= s.lost_frames);
    tear_down(rig);
}

/** The segment holds everything back for a while and then gives it out at once; then it brings one
 *  answer again and again. Nothing old is ever taken for new. */
static void stalls_and_repetitions(void) {
    struct rig *rig = bring_up();
    for (uint64_t ms = 30; ms <= 200; ms += 34) {
        const uint64_t old = statistics(rig).old_replies;
        fsn_segment_stall(rig->segment, ms * 1000000);
        while (statistics(rig).old_replies - old < ms / 4) {
            pause_ms(1);
        }
        for (uint32_t k = 1; k < SUBDEVICES; k++) {
            tend_until(rig, k, FSN_AL_OP);
            CHECK(flows(rig, k)); /* the newest bytes, not those of before the stall */
        }
        pause_ms(20);
        const struct fsn_statistics before = statistics(rig);
        pause_ms(50);
        const struct fsn_statistics after = statistics(rig);
        /* On a busy machine a reply may come after the next frame was sent; not each time. */
        CHECK(2 * (after.old_replies - before.old_replies) < after.cycles - before.cycles);
    }
    /* SOEM's own frames get old answers as well: lost ones are found again all the same. */
    fsn_segment_stall(rig->segment, 900000000);
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        fsn_segment_power_cycle(rig->segment, n);
    }
    for (int i = 0; i < 500; i++) {
        fsn_core_tend(rig->core, FSN_AL_OP, now_ns());
        pause_ms(2);
    }
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        tend_until(rig, n, FSN_AL_OP);
    }
    const uint64_t old = statistics(rig).old_replies;
    fsn_segment_repeat(rig->segment, 100);
    while (statistics(rig).old_replies < old + 50) {
        pause_ms(1);
    }
    CHECK(flows(rig, 1) && flows(rig, 2) && flows(rig, 3));
    tear_down(rig);
}

/** Another device, and the right ones in each other's place, are not led anywhere. */
static void wrong_devices_stay_out(void) {
    struct rig *rig = bring_up();
    const struct fsn_segment_identity other = {.vendor_id = 2, .product_code = 3, .revision = 4};
    fsn_segment_set_present(rig->segment, 3, false);
    tend_until(rig, 3, 0);
    CHECK(fsn_segment_set_identity(rig->segment, 3, &other) == FSN_OK);
    fsn_segment_set_present(rig->segment, 3, true);
    while (look(rig, 3).found != FSN_FOUND_IDENTITY) {
        CHECK(flows(rig, 1) && flows(rig, 2));
    }
    CHECK(look(rig, 3).vendor_id == 2 && look(rig, 3).product_code == 3);
    CHECK(strstr(look(rig, 3).detail, "found vendor 0x00000002") != NULL);
    CHECK(look(rig, 3).al_status == 0 && !flows(rig, 3));
    CHECK(fsn_segment_set_identity(rig->segment, 3, NULL) == FSN_OK);
    fsn_segment_power_cycle(rig->segment, 3);
    tend_until(rig, 3, FSN_AL_OP);
    CHECK(flows(rig, 3));
    fsn_segment_set_present(rig->segment, 2, false);
    tend_until(rig, 2, 0);
    CHECK(fsn_segment_swap(rig->segment, 2, 3) == FSN_OK);
    fsn_segment_set_present(rig->segment, 2, true);
    while (look(rig, 2).found != FSN_FOUND_IDENTITY) {
        CHECK(flows(rig, 1));
    }
    CHECK(!flows(rig, 2) && !flows(rig, 3));
    tear_down(rig);
}

/** A SubDevice that comes back and refuses a start-up SDO stays in PREOP, named, until it takes it;
 *  one that is slow is waited for. */
static void who_refuses_is_asked_again(void) {
    struct rig *rig = bring_up();
    CHECK(fsn_segment_set_sdo_abort(rig->segment, 3, 0x8000, 1, 0x06090030) == FSN_OK);
    fsn_segment_power_cycle(rig->segment, 3);
    while (look(rig, 3).found != FSN_FOUND_SDO) {
        CHECK(flows(rig, 1) && flows(rig, 2));
    }
    CHECK(strstr(look(rig, 3).detail, "0x8000:01: abort code 0x06090030 value out of range") !=
          NULL);
    CHECK(look(rig, 3).al_status == FSN_AL_PREOP);
    CHECK(fsn_segment_set_sdo_abort(rig->segment, 3, 0x8000, 1, 0) == FSN_OK);
    CHECK(fsn_segment_set_al_delay(rig->segment, 3, 300000000) == FSN_OK);
    tend_until(rig, 3, FSN_AL_OP);
    CHECK(look(rig, 3).found == FSN_FOUND_RIGHT && look(rig, 3).returns >= 1 && flows(rig, 3));
    tear_down(rig);
}

/** A cut cable between any two SubDevices of a ring disturbs nobody, and is named. */
static void a_ring_survives_each_cable(void) {
    struct rig *rig = bring_up_from(set_up_with("far2"));
    for (uint32_t cable = 0; cable < SUBDEVICES; cable++) {
        const uint32_t front = cable == 0 ? FSN_NONE : cable - 1;
        for (uint32_t k = 1; k < SUBDEVICES; k++) {
            CHECK(flows(rig, k));
        }
        CHECK(fsn_segment_set_link(rig->segment, front, false) == FSN_OK);
        for (int i = 0; i < 5; i++) {
            for (uint32_t k = 1; k < SUBDEVICES; k++) {
                CHECK(flows(rig, k));
            }
        }
        for (uint32_t n = 0; n < SUBDEVICES; n++) {
            CHECK(look(rig, n).al_status == FSN_AL_OP && look(rig, n).returns == 0);
        }
        if (front != FSN_NONE) {
            while (look(rig, front).link[1] != 0 || look(rig, cable).link[0] != 0) {
                CHECK(flows(rig, 1)); /* one SubDevice after the other is asked for its links */
            }
            while (look(rig, front).detail[0] == 0) {
                CHECK(flows(rig, 1));
            }
            CHECK(strstr(look(rig, front).detail, "the ring is open at its port 1") != NULL);
            CHECK(look(rig, front).link_lost[1] > 0 && look(rig, cable).link_lost[0] > 0);
        }
        CHECK(fsn_segment_set_link(rig->segment, front, true) == FSN_OK);
    }
    CHECK(system("ip link set near2 down") == 0); /* the second card itself */
    for (int i = 0; i < 30; i++) {
        for (uint32_t k = 1; k < SUBDEVICES; k++) {
            (void)flows(rig, k);
        }
    }
    for (uint32_t k = 1; k < SUBDEVICES; k++) {
        CHECK(flows(rig, k) && look(rig, k).al_status == FSN_AL_OP);
    }
    CHECK(system("ip link set near2 up") == 0);
    tear_down(rig);
}

/** A ring that is not closed at the start works as a line, and that is told. */
static void a_ring_open_at_the_start_is_told(void) {
    struct rig *rig = set_up_with("far2");
    CHECK(fsn_segment_set_link(rig->segment, SUBDEVICES - 1, false) == FSN_OK);
    bring_up_from(rig);
    while (look(rig, SUBDEVICES - 1).detail[0] == 0) {
        CHECK(flows(rig, 1));
    }
    CHECK(strstr(look(rig, SUBDEVICES - 1).detail, "open since the start") != NULL);
    CHECK(fsn_segment_set_link(rig->segment, SUBDEVICES - 1, true) == FSN_OK);
    while (look(rig, SUBDEVICES - 1).detail[0] != 0) {
        CHECK(flows(rig, 1));
    }
    tear_down(rig);
}

static void stops_step_by_step(void) {
    struct rig *rig = bring_up();
    for (int i = 0; i < 1000 && !fsn_core_tend(rig->core, FSN_AL_SAFEOP, now_ns()); i++) {
        pause_ms(2);
    }
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        CHECK(fsn_segment_al_status(rig->segment, n, NULL) == FSN_AL_SAFEOP);
    }
    fsn_core_free(rig->core);
    rig->core = NULL;
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        CHECK(fsn_segment_al_status(rig->segment, n, NULL) == FSN_AL_INIT);
    }
    tear_down(rig);
}

static void refuses(fsn_status status, const char *detail, struct rig *rig) {
    const fsn_status got = open_bus(rig);
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
    CHECK(fsn_backend_soem()->create(&options, &second, NULL) == FSN_OK);
    CHECK(fsn_core_create(rig->plan, fsn_backend_soem()->ops, second, &none, &fault) ==
          FSN_E_BUS_BUSY);
    CHECK(strstr(fault.detail, "not ours") != NULL);
    fsn_backend_soem()->free(second);
    CHECK(flows(rig, 1)); /* nobody noticed */
    tear_down(rig);

    const struct fsn_live_options absent = {.interface = "absent"};
    const struct fsn_live_options too_long = {.interface = "an-interface-too-long"};
    CHECK(fsn_backend_soem()->create(&too_long, &second, NULL) == FSN_E_ARG);
    CHECK(fsn_backend_soem()->create(&absent, &second, NULL) == FSN_OK);
    rig = set_up();
    CHECK(fsn_core_create(rig->plan, fsn_backend_soem()->ops, second, &none, &fault) == FSN_E_SYS);
    CHECK(strstr(fault.rule, "no such interface") != NULL && strcmp(fault.detail, "absent") == 0);
    fsn_backend_soem()->free(second);
    tear_down(rig);
}

/** A network namespace with a veth pair; false where this user may not make one. */
static bool make_network(void) {
    if (unshare(CLONE_NEWNET) != 0 && unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) {
        return false;
    }
    return system("ip link set lo up && ip link add near type veth peer name far && "
                  "ip link set near up && ip link set far up && "
                  "ip link add near2 type veth peer name far2 && "
                  "ip link set near2 up && ip link set far2 up") == 0;
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
    CHECK(fsn_core_upload(rig->core, 2, &t) == FSN_OK && t.size_bytes == LONG);
    CHECK(memcmp(data, written, LONG) == 0);
    t.size_bytes = LONG - 1;
    CHECK(fsn_core_upload(rig->core, 2, &t) == FSN_E_SPACE);
    t = (struct fsn_transfer){.index = 0x5FFF, .data = data, .size_bytes = 8};
    CHECK(fsn_core_upload(rig->core, 2, &t) == FSN_E_BUS_SDO && t.abort_code == 0x06020000);
    CHECK(fsn_core_alias_write(rig->core, 2, 0x1234) == FSN_OK);
    t.size_bytes = sizeof data;
    CHECK(fsn_core_sii_read(rig->core, 2, &t) == FSN_OK && t.size_bytes > 128);
    CHECK(data[8] == 0x34 && data[9] == 0x12);
    CHECK(flows(rig, 1) && look(rig, 2).al_status == FSN_AL_OP);
    fsn_segment_set_present(rig->segment, fsn_segment_position(rig->segment, 2), false);
    t = (struct fsn_transfer){.index = 0x2000, .sub = 1, .data = data, .size_bytes = LONG};
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
    wrong_devices_stay_out();
    who_refuses_is_asked_again();
    a_ring_survives_each_cable();
    a_ring_open_at_the_start_is_told();
    stops_step_by_step();
    refusals();
    return 0;
}
