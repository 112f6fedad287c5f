/** The IgH backend against a master in memory (tests/fake): what it refuses, what it moves, what it
 *  sees, and in which order it calls. */
#define _POSIX_C_SOURCE 200809L

#include <errno.h>
#include <string.h>
#include <time.h>

#include "builder.h"
#include "fake.h"
#include "fsn/acyclic.h"
#include "fsn/fsn.h"
#include "fsn/live.h"
#include "heap.h"
#include "plan/plan_internal.h"

enum { MS = 1000000, ADDRESS = 14, KNOWN_ADDRESS = 2 };

/** Nobody waits here. */
int clock_nanosleep(clockid_t clock, int flags, const struct timespec *time,
                    struct timespec *left) {
    (void)clock;
    (void)flags;
    (void)time;
    (void)left;
    return 0;
}

struct rig {
    struct fsn_plan *plan;
    void *bus;
    struct fsn_core *core;
    struct fsn_fault fault;
    uint64_t now_ns;
};

/* -- set-up --------------------------------------------------------------------------------- */

static uint8_t *record(struct rig *rig, uint32_t section, uint32_t number) {
    return rig->plan->bytes + rig->plan->offset[section] + number * fsn_record_bytes[section];
}

/** Objects of a device whose PDO `pdo` has one byte per entry. */
static void map_bytes(unsigned device, uint8_t sm, uint16_t pdo, unsigned bytes) {
    const uint16_t assignment = (uint16_t)(0x1C10 + sm);
    fake_object(device, assignment, 0, 1, 1, false);
    fake_object(device, assignment, 1, pdo, 2, false);
    fake_object(device, pdo, 0, bytes, 1, false);
    for (unsigned i = 0; i < bytes; i++) {
        fake_object(device, pdo, (uint8_t)(i + 1), 0x60000008u | (i << 8), 4, false);
    }
}

/** The e-stop pair as plan and as devices; the plan knows the FSoE address of the second one. */
static struct rig *set_up(void) {
    struct rig *rig = calloc(1, sizeof *rig);
    CHECK(rig != NULL);
    size_t len;
    uint8_t *bytes = build_full(&len);
    CHECK(fsn_plan_load(bytes, len, &rig->plan, NULL) == FSN_OK);
    free(bytes);
    uint8_t *connection = record(rig, FSN_SEC_CONNECTION, 0);
    connection[26] = ADDRESS;
    connection[30] |= KNOWN_ADDRESS;
    struct fsn_connection_info info;
    CHECK(fsn_plan_connection(rig->plan, 0, &info) == FSN_OK && info.address == ADDRESS &&
          (info.known & KNOWN_ADDRESS) != 0);
    fake_reset(2);
    map_bytes(0, 2, 0x1600, 9);
    map_bytes(0, 3, 0x1A00, 8);
    map_bytes(1, 2, 0x1600, 8);
    map_bytes(1, 3, 0x1A00, 8);
    fake_object(1, 0xF980, 1, ADDRESS, 2, true);
    fake_object(1, 0x8000, 1, 0, 4, false);
    memset(fake.device[0].inputs, 0xA0, 8);
    memset(fake.device[1].inputs, 0xB0, 8);
    return rig;
}

static fsn_status open_with(struct rig *rig, uint32_t dc_every) {
    const struct fsn_live_options options = {.interface = "0", .dc_every = dc_every};
    CHECK(fsn_backend_igh()->create(&options, &rig->bus, &rig->fault) == FSN_OK);
    return fsn_core_create(rig->plan, fsn_backend_igh()->ops, rig->bus, &rig->core, &rig->fault);
}

static void tear_down(struct rig *rig) {
    fsn_core_free(rig->core);
    fsn_backend_igh()->free(rig->bus);
    fsn_plan_free(rig->plan);
    free(rig);
    CHECK(fake.open_masters == 0 && !fake.active);
    CHECK(fake.sdo_while_scanning == 0);
}

static void refuses(struct rig *rig, fsn_status status, const char *detail) {
    const fsn_status got = open_with(rig, 0);
    if (got != status || strstr(rig->fault.detail, detail) == NULL) {
        fprintf(stderr, "%s: %s, %s\n", detail, fsn_status_name(got), rig->fault.detail);
        exit(1);
    }
    CHECK(rig->fault.status == status && rig->fault.rule != NULL && !fake.active);
    tear_down(rig);
}

static struct fsn_bus_subdevice look(struct rig *rig, uint32_t n) {
    struct fsn_bus_subdevice seen;
    CHECK(fsn_core_subdevice(rig->core, n, &seen) == FSN_OK);
    return seen;
}

/** Cycles of 1 ms, each with one step of the acyclic work; returns what the last one said. */
static bool run(struct rig *rig, unsigned cycles, uint8_t goal) {
    bool there = false;
    for (unsigned i = 0; i < cycles; i++) {
        rig->now_ns += MS;
        CHECK(fsn_core_cycle(rig->core, rig->now_ns) == FSN_OK);
        there = fsn_core_poll(rig->core, goal, rig->now_ns);
    }
    return there;
}

static struct rig *bring_up(void) {
    struct rig *rig = set_up();
    CHECK(open_with(rig, 0) == FSN_OK);
    CHECK(run(rig, 50, FSN_AL_OP));
    CHECK(look(rig, 0).al_status == FSN_AL_OP && look(rig, 1).al_status == FSN_AL_OP);
    return rig;
}

static struct fsn_statistics snapshot(struct rig *rig) {
    struct fsn_statistics statistics;
    CHECK(fsn_core_snapshot(rig->core, &statistics, NULL, NULL) == FSN_OK);
    return statistics;
}

/* -- what is refused ------------------------------------------------------------------------ */

static void options_are_checked(void) {
    void *bus = NULL;
    struct fsn_fault fault;
    static const char *const wrong[] = {"eth0", "", "-1", "1x", "32", "99999999999999999999"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const struct fsn_live_options options = {.interface = wrong[i]};
        CHECK(fsn_backend_igh()->create(&options, &bus, &fault) == FSN_E_ARG && bus == NULL);
    }
    const struct fsn_live_options ring = {.interface = "0", .redundant = "eth1"};
    CHECK(fsn_backend_igh()->create(&ring, &bus, &fault) == FSN_E_ARG);
    CHECK(strstr(fault.rule, "backup_devices") != NULL);
    CHECK(fsn_backend_igh()->create(NULL, &bus, NULL) == FSN_E_ARG);
    CHECK(strstr(fsn_backend_igh()->about, "trademark") != NULL);
}

static void bus_is_refused(void) {
    struct rig *rig = set_up();
    fake.no_master = true;
    CHECK(open_with(rig, 0) == FSN_E_SYS && rig->fault.sys_errno == ENOENT);
    tear_down(rig);
    rig = set_up();
    fake.reserved_by_other = true;
    refuses(rig, FSN_E_BUS_BUSY, "");
    rig = set_up();
    fake.device[0].present = false;
    refuses(rig, FSN_E_BUS_SILENT, "no EtherCAT SubDevice");
    rig = set_up();
    fake.device[0].present = false;
    fake.link_down = true;
    refuses(rig, FSN_E_BUS_SILENT, "no link");
    rig = set_up();
    fake.device[1].present = false;
    refuses(rig, FSN_E_BUS_MISSING, "position 1: 1 SubDevices answer");
    rig = set_up();
    fake.device[1].al = 1;
    fake.device[1].refuses_preop = true;
    refuses(rig, FSN_E_BUS_STATE, "PREOP refused");
    rig = set_up();
    fake.activate_fails = true;
    CHECK(open_with(rig, 0) == FSN_E_SYS && rig->fault.sys_errno == ENOMEM);
    tear_down(rig);
}

static void other_devices_are_refused(void) {
    struct rig *rig = set_up();
    fake.device[1].info.product_code = 0x99;
    refuses(rig, FSN_E_BUS_IDENTITY, "product 0x00000099");
    rig = set_up();
    fake.device[1].info.vendor_id = 3;
    refuses(rig, FSN_E_BUS_IDENTITY, "vendor 0x00000003");
    rig = set_up();
    fake.device[0].info.vendor_id = fake.device[0].info.product_code = 0;
    refuses(rig, FSN_E_BUS_STATE, "could not read who it is");
    /* IgH does not look at the revision; we do, at both ends of the range. */
    for (uint32_t revision = 4; revision <= 8; revision += 4) {
        rig = set_up();
        record(rig, FSN_SEC_SUBDEVICE, 1)[16] = 5;
        memset(record(rig, FSN_SEC_SUBDEVICE, 1) + 20, 0, 4);
        record(rig, FSN_SEC_SUBDEVICE, 1)[20] = 7;
        fake.device[1].info.revision_number = revision;
        refuses(rig, FSN_E_BUS_IDENTITY, "revision 0x0000000");
    }
    rig = set_up();
    fake_object(1, 0xF980, 1, ADDRESS + 1, 2, true);
    refuses(rig, FSN_E_BUS_ADDRESS, "FSoE address 15, the plan says 14");
}

static void mappings_are_checked(void) {
    struct rig *rig = set_up();
    fake_object(1, 0x1A00, 3, 0x60000310, 4, true);
    refuses(rig, FSN_E_BUS_MAPPING, "PDO 0x1a00, entry 3 is 0x60000310");
    rig = set_up();
    fake_object(1, 0x1A00, 0, 7, 1, true);
    refuses(rig, FSN_E_BUS_MAPPING, "PDO 0x1a00 has 7 entries, the plan says 8");
    rig = set_up();
    fake_object(0, 0x1C12, 1, 0x1601, 2, true);
    refuses(rig, FSN_E_BUS_MAPPING, "an assigned PDO is 0x1601");
    /* What can be written is written once, then it fits. */
    rig = set_up();
    fake_object(0, 0x1C12, 1, 0x1601, 2, false);
    fake_object(0, 0x1600, 1, 0x70000108, 4, false);
    CHECK(open_with(rig, 0) == FSN_OK && strstr(fake.log, "download-active") == NULL);
    tear_down(rig);
    /* Without CoE the SII counts, and without that nothing. */
    rig = set_up();
    fake.device[0].object_count = 0;
    CHECK(open_with(rig, 0) == FSN_OK);
    tear_down(rig);
    rig = set_up();
    fake.device[0].object_count = 0;
    fake.device[0].sii_bits[2] = 80;
    refuses(rig, FSN_E_BUS_MAPPING, "SM2: its length in bits by the SII is 80, the plan says 72");
}

static void sdos_are_written(void) {
    struct rig *rig = set_up();
    fake_object(1, 0x8000, 1, 0, 4, true);
    refuses(rig, FSN_E_BUS_SDO, "0x8000:01: abort code 0x06010002 read only");
    rig = set_up();
    fake.device[1].object_count = 0;
    refuses(rig, FSN_E_BUS_SDO, "it has no CoE");
    rig = set_up();
    fake.scans = 3; /* it waits for the scan, and for one that begins meanwhile */
    fake.scan_in_look = true;
    CHECK(open_with(rig, 0) == FSN_OK);
    /* Found before it is taken, written before it is configured, then active; closed in the other
     * order. */
    fsn_core_free(rig->core);
    rig->core = NULL;
    CHECK(strcmp(fake.log, "open reserve download config-sdo activate deactivate release ") == 0);
    tear_down(rig);
}

/* -- what is moved -------------------------------------------------------------------------- */

/** The frame of the SubInstance as it stands in the outputs of the MainInstance, and back. */
static void data_flows(void) {
    struct rig *rig = bring_up();
    uint8_t expected[6];
    memset(expected, 0xB0, sizeof expected);
    CHECK(memcmp(fake.device[0].outputs, expected, sizeof expected) == 0);
    memset(expected, 0xA0, sizeof expected);
    CHECK(memcmp(fake.device[1].outputs, expected, sizeof expected) == 0);
    const struct fsn_statistics s = snapshot(rig);
    CHECK(s.expected_wkc == 4 && s.actual_wkc == 4);
    CHECK(fake.send_interval == 1000);
    tear_down(rig);
}

/** What does not come back leaves the old bytes, whole, and says so. */
static void losses_keep_old_bytes(void) {
    struct rig *rig = bring_up();
    const uint64_t stale = fsn_core_stale_cycles(rig->core, 3);
    fake.device[1].mute = true;
    memset(fake.device[1].inputs, 0xEE, 8);
    memset(fake.device[0].inputs, 0xA1, 8);
    run(rig, 3, FSN_AL_OP);
    CHECK(fake.device[0].outputs[0] == 0xB0 && fake.device[0].outputs[5] == 0xB0);
    CHECK(snapshot(rig).actual_wkc == 2);
    CHECK(fsn_core_stale_cycles(rig->core, 3) >= stale + 2);
    CHECK(snapshot(rig).lost_frames == 0);
    fake.device[1].mute = false;
    run(rig, 3, FSN_AL_OP);
    CHECK(fake.device[0].outputs[0] == 0xEE && fake.device[1].outputs[0] == 0xA1);
    const uint64_t lost = snapshot(rig).lost_frames;
    fake.lose_frames = true;
    memset(fake.device[1].inputs, 0x11, 8);
    run(rig, 2, FSN_AL_OP);
    fake.lose_frames = false;
    CHECK(snapshot(rig).lost_frames == lost + 2);
    CHECK(fake.device[0].outputs[0] == 0xEE);
    tear_down(rig);
}

/** Signals end calls of the kernel; a few are made again, and more of them are a lost cycle. */
static void signals_do_no_harm(void) {
    struct rig *rig = bring_up();
    const uint64_t before = snapshot(rig).wkc_errors;
    fake.interrupted = 4;
    run(rig, 3, FSN_AL_OP);
    CHECK(snapshot(rig).wkc_errors == before);
    memset(fake.device[1].inputs, 0x77, 8);
    fake.interrupted = 1000;
    run(rig, 1, FSN_AL_OP);
    fake.interrupted = 0;
    CHECK(snapshot(rig).wkc_errors == before + 1 && snapshot(rig).actual_wkc == 0);
    /* Its queue was refused as well: the reply of before must not pass for a new one. */
    run(rig, 1, FSN_AL_OP);
    CHECK(snapshot(rig).wkc_errors == before + 2 && fake.device[0].outputs[0] == 0xB0);
    run(rig, 2, FSN_AL_OP);
    CHECK(snapshot(rig).wkc_errors == before + 2 && fake.device[0].outputs[0] == 0x77);
    tear_down(rig);
}

static void clocks_are_reported(void) {
    struct rig *rig = set_up();
    CHECK(open_with(rig, 5) == FSN_OK);
    run(rig, 20, FSN_AL_OP);
    CHECK(fake.clock_syncs == 4 && fake.app_time != 0 && snapshot(rig).dc_time_ns == 0);
    fake.reference_time = (uint32_t)fake.app_time + 5000;
    run(rig, 6, FSN_AL_OP);
    CHECK((uint32_t)snapshot(rig).dc_time_ns == fake.reference_time);
    /* Our own time follows the clock from then on. */
    CHECK(snapshot(rig).dc_time_ns <= fake.app_time);
    tear_down(rig);
}

/* -- what is seen --------------------------------------------------------------------------- */

static void devices_return(void) {
    struct rig *rig = bring_up();
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    CHECK(look(rig, 1).found == FSN_FOUND_NOTHING && look(rig, 1).al_status == FSN_AL_NONE);
    CHECK(look(rig, 0).found == FSN_FOUND_RIGHT && look(rig, 0).al_status == FSN_AL_OP);
    CHECK(snapshot(rig).actual_wkc == 2);
    fake_plug(1);
    memset(fake.device[1].inputs, 0x42, 8);
    for (int i = 0; i < 50 && look(rig, 1).returns == 0; i++) {
        run(rig, 20, FSN_AL_OP);
    }
    CHECK(look(rig, 1).returns == 1 && look(rig, 1).found == FSN_FOUND_RIGHT);
    CHECK(look(rig, 0).returns == 0);
    run(rig, 3, FSN_AL_OP);
    CHECK(fake.device[0].outputs[0] == 0x42 && snapshot(rig).actual_wkc == 4);
    tear_down(rig);
}

/** IgH brings any device of that vendor and product to OP; it gets no process data from us. */
static void another_address_gets_nothing(void) {
    struct rig *rig = bring_up();
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    fake_object(1, 0xF980, 1, ADDRESS + 1, 2, true);
    fake_plug(1);
    memset(fake.device[1].inputs, 0x42, 8);
    fake.device[1].output_sets = 0;
    CHECK(!run(rig, 400, FSN_AL_OP));
    CHECK(look(rig, 1).found == FSN_FOUND_ADDRESS && look(rig, 1).returns == 0);
    CHECK(fake.device[1].output_sets == 0 && fake.device[0].outputs[0] == 0xB0);
    fake_object(1, 0xF980, 1, ADDRESS, 2, true); /* somebody sets its switches right */
    run(rig, 400, FSN_AL_OP);
    CHECK(look(rig, 1).returns == 1 && fake.device[0].outputs[0] == 0x42);
    tear_down(rig);
}

static void another_revision_gets_nothing(void) {
    struct rig *rig = set_up();
    memset(record(rig, FSN_SEC_SUBDEVICE, 1) + 20, 0, 4);
    record(rig, FSN_SEC_SUBDEVICE, 1)[20] = 7;
    CHECK(open_with(rig, 0) == FSN_OK);
    CHECK(run(rig, 50, FSN_AL_OP));
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    fake.device[1].info.revision_number = 8;
    fake_plug(1);
    memset(fake.device[1].inputs, 0x42, 8);
    fake.device[1].output_sets = 0;
    CHECK(!run(rig, 400, FSN_AL_OP));
    CHECK(look(rig, 1).found == FSN_FOUND_IDENTITY && look(rig, 1).revision == 8);
    CHECK(fake.device[1].output_sets == 0 && fake.device[0].outputs[0] == 0xB0);
    fake.device[1].info.revision_number = 7;
    CHECK(run(rig, 400, FSN_AL_OP) && fake.device[0].outputs[0] == 0x42);
    /* Also when nobody saw it go. */
    fake.device[1].info.revision_number = 8;
    run(rig, 12, FSN_AL_OP);
    memset(fake.device[1].inputs, 0x43, 8);
    CHECK(!run(rig, 12, FSN_AL_OP) && fake.device[0].outputs[0] == 0x42);
    tear_down(rig);
}

static void refusals_are_tried_again(void) {
    struct rig *rig = set_up();
    fake.device[1].refuses_op = true;
    CHECK(open_with(rig, 0) == FSN_OK);
    CHECK(!run(rig, 100, FSN_AL_OP));
    CHECK(look(rig, 1).found == FSN_FOUND_STATE && look(rig, 1).al_code == 0x1B);
    CHECK((look(rig, 1).al_status & FSN_AL_ERROR) != 0);
    const unsigned resets = fake.device[1].resets;
    CHECK(resets == 1); /* not one in each look */
    fake.device[1].refuses_op = false;
    fake.device[1].al_code = 0;
    CHECK(run(rig, 2000, FSN_AL_OP) && look(rig, 1).found == FSN_FOUND_RIGHT);
    tear_down(rig);
}

static void counters_are_read(void) {
    struct rig *rig = bring_up();
    run(rig, 100, FSN_AL_OP);
    CHECK(look(rig, 0).link[0] == 1 && look(rig, 0).link[1] == 0);
    CHECK(look(rig, 0).rx_errors[1] == 7 && look(rig, 0).link_lost[1] == 3);
    CHECK(look(rig, 1).vendor_id == 2 && look(rig, 1).product_code == 0x1001);
    struct fsn_bus_subdevice seen;
    CHECK(fsn_backend_igh()->ops->state(rig->bus, 2, &seen) == FSN_E_ARG);
    tear_down(rig);
}

/** They leave OP while process data goes on, and only then the bus is closed. */
static void they_leave_op(void) {
    struct rig *rig = bring_up();
    CHECK(!run(rig, 1, FSN_AL_SAFEOP));
    bool left = false;
    for (int i = 0; i < 10 && !left; i++) {
        left = run(rig, 1, FSN_AL_SAFEOP);
    }
    CHECK(left && snapshot(rig).actual_wkc == 4);
    CHECK(look(rig, 0).al_status == FSN_AL_SAFEOP);
    tear_down(rig);
    /* Nobody waits for who has gone, or without register requests. */
    rig = bring_up();
    fake_unplug(0);
    run(rig, 20, FSN_AL_OP);
    CHECK(run(rig, 1, FSN_AL_SAFEOP));
    tear_down(rig);
    rig = set_up();
    fake.no_requests = true;
    CHECK(open_with(rig, 0) == FSN_OK && run(rig, 50, FSN_AL_OP));
    CHECK(run(rig, 1, FSN_AL_SAFEOP));
    tear_down(rig);
}

/* -- objects -------------------------------------------------------------------------------- */

static void objects_are_reached_beside_the_cycle(void) {
    struct rig *rig = bring_up();
    uint8_t data[8] = {0};
    struct fsn_transfer t = {.index = 0xF980, .sub = 1, .data = data, .size_bytes = sizeof data};
    CHECK(fsn_core_upload(rig->core, 1, &t) == FSN_OK && t.size_bytes == 2 && data[0] == ADDRESS);
    t = (struct fsn_transfer){.index = 0xF980, .sub = 9, .data = data, .size_bytes = 8};
    CHECK(fsn_core_upload(rig->core, 1, &t) == FSN_E_BUS_SDO && t.abort_code != 0);
    t = (struct fsn_transfer){.index = 0x8000, .sub = 1, .data = data, .size_bytes = 1};
    CHECK(fsn_core_upload(rig->core, 1, &t) == FSN_E_SPACE);
    t.size_bytes = 4;
    memcpy(data, "abcd", 4);
    CHECK(fsn_core_download(rig->core, 1, &t) == FSN_OK);
    memset(data, 0, sizeof data);
    CHECK(fsn_core_upload(rig->core, 1, &t) == FSN_OK && memcmp(data, "abcd", 4) == 0);
    CHECK(fsn_core_upload(rig->core, 2, &t) == FSN_E_ARG);
    CHECK(fsn_core_sii_read(rig->core, 1, &t) == FSN_E_ABSENT);
    CHECK(fsn_core_alias_write(rig->core, 1, 5) == FSN_E_ABSENT);
    fake_unplug(1);
    run(rig, 50, FSN_AL_OP);
    CHECK(fsn_core_upload(rig->core, 1, &t) == FSN_E_BUS_MISSING);
    tear_down(rig);
}

static void a_bus_is_visited_without_a_plan(void) {
    const struct fsn_live_options options = {.interface = "0"};
    const struct fsn_bus_acyclic *acyclic = fsn_backend_igh()->ops->acyclic;
    struct rig *rig = set_up(); /* for its devices */
    struct fsn_bus_member member;
    struct fsn_fault fault;
    void *bus = NULL;
    bool changed = true;
    uint32_t entries[64];
    uint32_t count;
    uint16_t index;
    bool output;
    CHECK(fsn_backend_igh()->create(&options, &bus, &fault) == FSN_OK);
    CHECK(acyclic->visit(bus, &changed, &fault) == FSN_OK && !changed && acyclic->count(bus) == 2);
    CHECK(acyclic->member(bus, 1, &member) == FSN_OK && member.subdevice == FSN_NONE);
    CHECK(member.vendor_id == 2 && member.product_code != 0 && member.al_status == FSN_AL_PREOP);
    CHECK(acyclic->member(bus, 2, &member) == FSN_E_BUS_MISSING);
    CHECK(acyclic->pdo(bus, 1, 9, 0, &index, &output, entries, 64, &count) == FSN_E_ARG);
    acyclic->quit(bus);
    fake.reserved_by_other = true;
    CHECK(acyclic->visit(bus, &changed, &fault) == FSN_E_BUS_BUSY && fake.open_masters == 0);
    fsn_backend_igh()->free(bus);
    fake.reserved_by_other = false;
    tear_down(rig);
}

/* -- calls that fail ------------------------------------------------------------------------- */

static bool is_in_op(struct rig *rig, uint32_t n) {
    return look(rig, n).found == FSN_FOUND_RIGHT && look(rig, n).al_status == FSN_AL_OP;
}

static void reach_op(struct rig *rig) {
    unsigned cycles = 0;
    while (!run(rig, 1, FSN_AL_OP) || !is_in_op(rig, 0) || !is_in_op(rig, 1)) {
        CHECK(++cycles < 3000);
    }
}

/** All that a run does: opening, cycles, objects, a loss, leaving. What opening says. */
static fsn_status live_through(struct rig *rig) {
    const fsn_status opened = open_with(rig, 3);
    if (opened != FSN_OK) {
        CHECK(rig->fault.status == opened && rig->fault.rule != NULL && !fake.active);
        return opened;
    }
    uint8_t data[8];
    struct fsn_transfer t = {.index = 0x8000, .sub = 1, .data = data, .size_bytes = sizeof data};
    reach_op(rig);
    const unsigned before = fake.failed;
    const fsn_status read = fsn_core_upload(rig->core, 1, &t);
    const fsn_status written = fsn_core_download(rig->core, 1, &t);
    CHECK((read == FSN_OK && written == FSN_OK) || fake.failed > before);
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    fake_plug(1);
    reach_op(rig);
    run(rig, 5, FSN_AL_SAFEOP);
    return FSN_OK;
}

/** Whichever calls of ecrt.h fail: it is refused with a reason, or it works again afterwards. */
static void each_call_may_fail(int error, unsigned at_once, unsigned step, unsigned least_refused) {
    unsigned refused = 0, lived = 0, failed = 1;
    for (unsigned n = 1; failed > 0; n += step) {
        struct rig *rig = set_up();
        fake.fails_from = n;
        fake.fails_for = at_once;
        fake.fails_as = error;
        const fsn_status opened = live_through(rig);
        failed = fake.failed;
        refused += opened != FSN_OK;
        lived += opened == FSN_OK;
        tear_down(rig);
    }
    if (refused < least_refused || lived < 100 / step) {
        fprintf(stderr, "error %d, %u at once: %u refused, %u lived through\n", error, at_once,
                refused, lived);
        exit(1);
    }
}

/* -- configuration, and what does not come ---------------------------------------------------- */

static void a_place_may_be_told_by_an_alias(void) {
    struct rig *rig = set_up();
    record(rig, FSN_SEC_SUBDEVICE, 1)[4] = 7;
    record(rig, FSN_SEC_SUBDEVICE, 1)[6] = 0;
    refuses(rig, FSN_E_BUS_MISSING, "alias 7, position 0: 2 SubDevices answer");
    rig = set_up();
    record(rig, FSN_SEC_SUBDEVICE, 1)[4] = 7;
    record(rig, FSN_SEC_SUBDEVICE, 1)[6] = 0;
    fake.device[1].info.alias = 7;
    CHECK(open_with(rig, 0) == FSN_OK && run(rig, 50, FSN_AL_OP) && is_in_op(rig, 1));
    tear_down(rig);
}

static void igh_is_told_clocks_and_watchdogs(void) {
    struct rig *rig = set_up();
    record(rig, FSN_SEC_SUBDEVICE, 1)[41] = 3;
    record(rig, FSN_SEC_SM, 0)[6] = 1;
    record(rig, FSN_SEC_SM, 1)[6] = 2;
    CHECK(open_with(rig, 0) == FSN_OK);
    CHECK(fake.device[1].assign_activate == 0x0300 && fake.device[1].sync0_cycle == MS);
    CHECK(fake.device[0].assign_activate == 0);
    CHECK(fake.device[0].watchdog[2] == EC_WD_ENABLE &&
          fake.device[0].watchdog[3] == EC_WD_DISABLE);
    CHECK(fake.device[1].watchdog[2] == EC_WD_DEFAULT);
    run(rig, 2, FSN_AL_OP);
    CHECK(fake.app_time != 0 && fake.clock_syncs == 0);
    tear_down(rig);
    /* Its own cycle stands before that of the plan; without both it is a millisecond. */
    static const uint32_t cycles[][3] = {{2 * MS, 4 * MS, 2000}, {0, 4 * MS, 4000}, {0, 0, 1000}};
    for (size_t i = 0; i < sizeof cycles / sizeof cycles[0]; i++) {
        const struct fsn_live_options options = {.interface = "0", .cycle_ns = cycles[i][0]};
        rig = set_up();
        rig->plan->cycle_ns = cycles[i][1];
        CHECK(fsn_backend_igh()->create(&options, &rig->bus, NULL) == FSN_OK);
        CHECK(fsn_core_create(rig->plan, fsn_backend_igh()->ops, rig->bus, &rig->core, NULL) ==
              FSN_OK);
        CHECK(fake.send_interval == cycles[i][2]);
        tear_down(rig);
    }
}

/** A mailbox is configured by nobody, so it has no place in the image either. */
static void sizes_of_igh_are_checked(void) {
    struct rig *rig = set_up();
    record(rig, FSN_SEC_SM, 3)[4] = 1;
    refuses(rig, FSN_E_BUS_IMAGE, "IgH gives it 0 bytes, the plan says 8");
}

static void what_does_not_come_is_not_waited_for(void) {
    struct rig *rig = set_up();
    fake.scans = 1000000;
    CHECK(open_with(rig, 0) == FSN_E_BUS_STATE);
    CHECK(strcmp(rig->fault.rule, "IgH does not come to the end of its scan") == 0);
    tear_down(rig);
    rig = set_up();
    fake.device[1].al = 1;
    refuses(rig, FSN_E_BUS_STATE, "PREOP refused: AL status 0x01; the kernel log says why");
    for (uint8_t al = 4; al <= 8; al = (uint8_t)(2 * al)) {
        rig = set_up();
        fake.device[1].al = al;
        CHECK(open_with(rig, 0) == FSN_OK);
        tear_down(rig);
    }
    rig = set_up();
    fake.device[1].info.vendor_id = 0;
    refuses(rig, FSN_E_BUS_IDENTITY, "vendor 0x00000000");
}

/** Who wants no fault gets none. */
static void a_fault_is_not_needed(void) {
    struct fsn_bus_layout layout;
    const struct fsn_bus_ops *ops = fsn_backend_igh()->ops;
    for (int i = 0; i < 3; i++) {
        struct rig *rig = set_up();
        fake.no_master = i == 0;
        fake.device[0].present = i != 1;
        fake.device[1].present = false;
        const struct fsn_live_options options = {.interface = "0"};
        CHECK(fsn_backend_igh()->create(&options, &rig->bus, NULL) == FSN_OK);
        const fsn_status status[] = {FSN_E_SYS, FSN_E_BUS_SILENT, FSN_E_BUS_MISSING};
        CHECK(ops->open(rig->bus, rig->plan, &layout, NULL) == status[i]);
        tear_down(rig);
    }
    CHECK(fsn_backend_igh()->create(&(struct fsn_live_options){.interface = "0"}, NULL, NULL) ==
          FSN_E_ARG);
    void *bus;
    CHECK(fsn_backend_igh()->create(&(struct fsn_live_options){0}, &bus, NULL) == FSN_E_ARG);
    fsn_backend_igh()->free(NULL);
}

static void replies_are_waited_for(void) {
    for (uint64_t wait_ns = 1; wait_ns <= 200000; wait_ns += 199999) {
        const struct fsn_live_options options = {.interface = "0", .receive_wait_ns = wait_ns};
        struct rig *rig = set_up();
        CHECK(fsn_backend_igh()->create(&options, &rig->bus, NULL) == FSN_OK);
        CHECK(fsn_core_create(rig->plan, fsn_backend_igh()->ops, rig->bus, &rig->core, NULL) ==
              FSN_OK);
        CHECK(run(rig, 50, FSN_AL_OP));
        const uint64_t lost = snapshot(rig).lost_frames;
        fake.lose_frames = true;
        run(rig, 1, FSN_AL_OP);
        fake.lose_frames = false;
        CHECK(snapshot(rig).lost_frames == lost + 1);
        tear_down(rig);
    }
}

/* -- registers and returns, once more --------------------------------------------------------- */

static void requests_without_an_answer_are_made_again(void) {
    struct rig *rig = set_up();
    fake.deaf = true;
    CHECK(open_with(rig, 0) == FSN_OK);
    run(rig, 1500, FSN_AL_OP);
    CHECK(look(rig, 0).rx_errors[1] == 0);
    fake.deaf = false;
    run(rig, 1500, FSN_AL_OP);
    CHECK(look(rig, 0).rx_errors[1] == 7);
    fake.deaf = true;
    CHECK(!run(rig, 20, FSN_AL_SAFEOP));
    fake.device[0].mute = fake.device[1].mute = true; /* and who is silent is not waited for */
    CHECK(run(rig, 20, FSN_AL_SAFEOP));
    tear_down(rig);
}

static void a_loss_between_two_looks_is_one(void) {
    struct rig *rig = bring_up();
    run(rig, 1, FSN_AL_OP); /* with a look; the next one is ten cycles away */
    fake.device[1].mute = true;
    fake.device[1].al = 2;
    fake.device[1].info.error_flag = 1;
    run(rig, 10, FSN_AL_OP);
    CHECK(look(rig, 1).found == FSN_FOUND_STATE && look(rig, 1).returns == 0);
    fake.device[1].mute = false;
    reach_op(rig);
    CHECK(look(rig, 1).returns == 1 && is_in_op(rig, 1) && look(rig, 0).returns == 0);
    tear_down(rig);
}

static void another_device_that_goes_is_still_another(void) {
    struct rig *rig = bring_up();
    fake.device[1].info.product_code = 0x99;
    run(rig, 20, FSN_AL_OP);
    CHECK(look(rig, 1).found == FSN_FOUND_IDENTITY);
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    CHECK(look(rig, 1).found == FSN_FOUND_IDENTITY && look(rig, 1).al_status == FSN_AL_NONE);
    tear_down(rig);
}

/** A SubDevice whose FSoE address was never read need not show it when it returns. */
static void an_address_that_was_never_told_is_not_asked_for(void) {
    struct rig *rig = set_up();
    for (unsigned i = 0; i < fake.device[1].object_count; i++) {
        struct fake_object *object = &fake.device[1].objects[i];
        object->index = object->index == 0xF980 ? 0x2000 : object->index;
    }
    CHECK(open_with(rig, 0) == FSN_OK);
    reach_op(rig);
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    fake_plug(1);
    reach_op(rig);
    CHECK(look(rig, 1).returns == 1);
    tear_down(rig);
}

/* -- objects, once more ----------------------------------------------------------------------- */

static void errors_of_a_mailbox_have_a_status(void) {
    static const struct {
        int error;
        unsigned times;
        fsn_status status;
    } rows[] = {
        {-ENOBUFS, 1, FSN_E_SPACE},       {-EOVERFLOW, 1, FSN_E_SPACE},
        {-EOPNOTSUPP, 1, FSN_E_ABSENT},   {-EPROTONOSUPPORT, 1, FSN_E_ABSENT},
        {-EPROTO, 1, FSN_E_BUS_STATE},    {-EBADMSG, 1, FSN_E_BUS_STATE},
        {-EIO, 1, FSN_E_BUS_MISSING},     {-EINTR, 99, FSN_OK},
        {-EINTR, 100, FSN_E_BUS_MISSING},
    };
    struct rig *rig = bring_up();
    for (size_t i = 0; i < 2 * sizeof rows / sizeof rows[0]; i++) {
        uint8_t data[4] = {1, 2, 3, 4};
        struct fsn_transfer t = {.position = 1, .index = 0x8000, .sub = 1, .data = data};
        t.size_bytes = sizeof data;
        fake.fails_from = fake.calls + 1;
        fake.fails_for = rows[i / 2].times;
        fake.fails_as = rows[i / 2].error;
        const struct fsn_bus_acyclic *acyclic = fsn_backend_igh()->ops->acyclic;
        CHECK((i % 2 == 0 ? acyclic->upload : acyclic->download)(rig->bus, &t) ==
              rows[i / 2].status);
    }
    tear_down(rig);
}

static void members_are_told_with_their_nodes(void) {
    const struct fsn_bus_acyclic *acyclic = fsn_backend_igh()->ops->acyclic;
    struct rig *rig = set_up();
    fake.device[0].info.serial_number = 77;
    fake.device[0].info.alias = 9;
    snprintf(fake.device[0].info.name, sizeof fake.device[0].info.name, "logic");
    CHECK(open_with(rig, 0) == FSN_OK);
    reach_op(rig);
    run(rig, 100, FSN_AL_OP);
    struct fsn_bus_member m;
    CHECK(acyclic->count(rig->bus) == 2 && acyclic->member(rig->bus, 0, &m) == FSN_OK);
    CHECK(m.subdevice == 0 && m.serial == 77 && m.alias == 9 && m.station == 1 && m.revision == 1);
    CHECK(strcmp(m.name, "logic") == 0 && m.ports == 0x0F && m.al_status == FSN_AL_OP);
    CHECK(m.errors_known && m.rx_errors[1] == 7 && m.link_lost[1] == 3 && m.link[0] == 1);
    CHECK(acyclic->place(rig->bus, 0) == 0 && acyclic->place(rig->bus, 1) == 1);
    CHECK(acyclic->place(rig->bus, 2) == FSN_NONE);
    fake.device[1].info.error_flag = 1;
    CHECK(acyclic->member(rig->bus, 1, &m) == FSN_OK);
    CHECK(m.subdevice == 1 && m.al_status == (FSN_AL_OP | FSN_AL_ERROR));
    fake.device[1].info.error_flag = 0;
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    CHECK(acyclic->place(rig->bus, 1) == FSN_NONE && acyclic->count(rig->bus) == 1);
    CHECK(acyclic->member(rig->bus, 1, &m) == FSN_E_BUS_MISSING && m.subdevice == FSN_NONE);
    fake.fails_from = fake.calls + 1;
    fake.fails_for = 1;
    fake.fails_as = -EIO;
    CHECK(acyclic->count(rig->bus) == 0);
    tear_down(rig);
    rig = set_up();
    fake.no_requests = true;
    CHECK(open_with(rig, 0) == FSN_OK && acyclic->member(rig->bus, 0, &m) == FSN_OK);
    CHECK(m.subdevice == FSN_NONE || !m.errors_known);
    tear_down(rig);
}

static void pdos_are_told_by_the_sii(void) {
    const struct fsn_bus_acyclic *acyclic = fsn_backend_igh()->ops->acyclic;
    struct rig *rig = bring_up();
    uint16_t index;
    bool output = true;
    uint32_t entries[4];
    uint32_t count;
    fake.device[1].sii_bits[2] = 24;
    CHECK(acyclic->pdo(rig->bus, 1, 2, 0, &index, &output, entries, 4, &count) == FSN_OK);
    CHECK(index == 0x1600 && !output && count == 2 && entries[0] == 8 && entries[1] == 16);
    CHECK(acyclic->pdo(rig->bus, 1, 2, 0, &index, &output, entries, 1, &count) == FSN_OK);
    CHECK(count == 1);
    CHECK(acyclic->pdo(rig->bus, 1, 2, 1, &index, &output, entries, 4, &count) == FSN_E_ARG);
    CHECK(acyclic->pdo(rig->bus, 1, 3, 0, &index, &output, entries, 4, &count) == FSN_E_ARG);
    fake.device[1].sii_bits[3] = 8;
    CHECK(acyclic->pdo(rig->bus, 1, 3, 0, &index, &output, entries, 4, &count) == FSN_E_ARG);
    fake.fails_from = fake.calls + 4; /* the second entry */
    fake.fails_for = 1;
    fake.fails_as = -EIO;
    CHECK(acyclic->pdo(rig->bus, 1, 2, 0, &index, &output, entries, 4, &count) == FSN_OK);
    CHECK(count == 1);
    tear_down(rig);
    /* What cannot be read to its end is not judged: of the calls that fail in turn, four make a
     * wrong SII unknown. */
    unsigned unknown = 0;
    for (unsigned n = 1; n < 60; n++) {
        rig = set_up();
        fake.device[0].object_count = 0;
        fake.device[0].sii_bits[2] = 80;
        fake.fails_from = n;
        fake.fails_for = 1;
        fake.fails_as = -EIO;
        unknown += open_with(rig, 0) == FSN_OK;
        tear_down(rig);
    }
    CHECK(unknown == 4);
}

#ifdef FSN_TEST_HEAP
static void memory_runs_out(void) {
    const struct fsn_live_options options = {.interface = "0"};
    fsn_status status = FSN_E_NOMEM;
    long tried = 0;
    while (status != FSN_OK) {
        struct rig *rig = set_up();
        const long alive = heap.alive;
        heap.fails_in = ++tried;
        status = fsn_backend_igh()->create(&options, &rig->bus, &rig->fault);
        if (status == FSN_OK) {
            status = fsn_core_create(rig->plan, fsn_backend_igh()->ops, rig->bus, &rig->core,
                                     &rig->fault);
        }
        heap.fails_in = 0;
        CHECK(status == FSN_OK || (status == FSN_E_NOMEM && rig->fault.status == FSN_E_NOMEM));
        fsn_core_free(rig->core);
        fsn_backend_igh()->free(rig->bus);
        rig->core = NULL;
        rig->bus = NULL;
        CHECK(heap.alive == alive);
        tear_down(rig);
    }
    CHECK(tried > 15);
}
#endif

int main(void) {
#ifdef FSN_TEST_HEAP
    memory_runs_out();
#endif
    a_place_may_be_told_by_an_alias();
    igh_is_told_clocks_and_watchdogs();
    sizes_of_igh_are_checked();
    what_does_not_come_is_not_waited_for();
    a_fault_is_not_needed();
    replies_are_waited_for();
    requests_without_an_answer_are_made_again();
    a_loss_between_two_looks_is_one();
    another_device_that_goes_is_still_another();
    an_address_that_was_never_told_is_not_asked_for();
    errors_of_a_mailbox_have_a_status();
    members_are_told_with_their_nodes();
    pdos_are_told_by_the_sii();
    each_call_may_fail(-EIO, 1, 1, 20);
    each_call_may_fail(-EINTR, 1, 1, 0);
    each_call_may_fail(-EINTR, 9, 7, 5);
    each_call_may_fail(-EINTR, 200, 31, 1);
    each_call_may_fail(-EPROTO, 3, 7, 5);
    each_call_may_fail(-EOPNOTSUPP, 2, 7, 5);
    objects_are_reached_beside_the_cycle();
    a_bus_is_visited_without_a_plan();
    options_are_checked();
    bus_is_refused();
    other_devices_are_refused();
    mappings_are_checked();
    sdos_are_written();
    data_flows();
    losses_keep_old_bytes();
    signals_do_no_harm();
    clocks_are_reported();
    devices_return();
    another_address_gets_nothing();
    another_revision_gets_nothing();
    refusals_are_tried_again();
    counters_are_read();
    they_leave_op();
    puts("igh: ok");
    return 0;
}
