/** Opening the backend on IgH: refusals, configuration, and which calls may fail. */
#include <errno.h>
#include <string.h>

#include "fsn/acyclic.h"
#include "heap.h"
#include "igh_rig.h"
#include "plan/plan_internal.h"

/* -- refusals ------------------------------------------------------------------------------- */

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
    const struct fsn_live_options host = {.interface = "0", .dc_host = true};
    CHECK(fsn_backend_igh()->create(&host, &bus, &fault) == FSN_E_ARG && bus == NULL);
    CHECK(strstr(fault.rule, "--dc-clock bus") != NULL);
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
    fake.device[0].present = false;
    fake.link_down = true;
    CHECK(open_with(rig, 0) == FSN_E_BUS_SILENT && rig->fault.link_down);
    tear_down(rig);
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

static void groups_are_refused(void) {
    static const struct build_sm sm[2][2] = {{{1, 9}, {2, 8}}, {{1, 8}, {2, 8}}};
    static const struct build_copy pair[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}};
    static const struct build_group group = {1, 1, 0};
    const struct build build = {.subdevices = 2,
                                .sm = sm,
                                .copies = pair,
                                .pairs = 1,
                                .cycle_ns = 1000000,
                                .groups = &group,
                                .group_count = 1};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct rig *rig = set_up();
    fsn_plan_free(rig->plan);
    CHECK(fsn_plan_load(bytes, len, &rig->plan, NULL) == FSN_OK);
    free(bytes);
    refuses(rig, FSN_E_ARG, "");
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
    refuses(rig, FSN_E_BUS_STATE, "could not read its identity");
    /* IgH ignores the revision; we check it, at both ends of the range. */
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
    refuses(rig, FSN_E_BUS_ADDRESS, "FSoE address 15, the plan has 14");
}

static void mappings_are_checked(void) {
    struct rig *rig = set_up();
    fake_object(1, 0x1A00, 3, 0x60000310, 4, true);
    refuses(rig, FSN_E_BUS_MAPPING, "PDO 0x1a00, entry 3 is 0x60000310");
    rig = set_up();
    fake_object(1, 0x1A00, 0, 7, 1, true);
    refuses(rig, FSN_E_BUS_MAPPING, "PDO 0x1a00 has 7 entries, the plan has 8");
    rig = set_up();
    fake_object(0, 0x1C12, 1, 0x1601, 2, true);
    refuses(rig, FSN_E_BUS_MAPPING, "an assigned PDO is 0x1601");
    /* A writable difference is written once, then it fits. */
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
    refuses(rig, FSN_E_BUS_MAPPING, "SM2: its length in bits by the SII is 80, the plan has 72");
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

/* -- calls that fail ------------------------------------------------------------------------- */

/** All steps of a run: opening, cycles, objects, a loss, closing. Errors of opening. */
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

/** Nine lost answers in a row, whichever object they are of, do not cause a restart. With ten that
 *  object is named, and no SubDevice is missing or without CoE. */
static void a_lost_answer_is_asked_for_again(void) {
    unsigned silent = 0, failed = 1;
    for (unsigned n = 1; failed > 0; n++) {
        failed = 0;
        for (unsigned times = 9; times <= 10; times++) {
            struct rig *rig = set_up();
            fake.fails_from = n;
            fake.fails_for = times;
            fake.fails_as = -EIO;
            const fsn_status status = open_with(rig, 0);
            const bool unanswered = strstr(rig->fault.detail, "no answer") != NULL;
            CHECK(strstr(rig->fault.detail, "no CoE") == NULL);
            CHECK((status == FSN_E_BUS_MAILBOX) == unanswered);
            if (unanswered) {
                CHECK(times == 10 && rig->fault.section == FSN_SEC_SUBDEVICE);
                CHECK(strncmp(rig->fault.detail, "0x", 2) == 0);
                struct fsn_bus_subdevice seen;
                const struct fsn_bus_ops *ops = fsn_backend_igh()->ops;
                CHECK(ops->state(rig->bus, rig->fault.copy_index, &seen) == FSN_OK);
                CHECK(seen.found == FSN_FOUND_MAILBOX);
            }
            silent += unanswered;
            failed += fake.failed;
            tear_down(rig);
        }
    }
    CHECK(silent >= 40); /* objects that are read or written of two SubDevices */
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
    CHECK(fake.app_time != 0 && fake.clock_syncs > 0); /* the plan alone requests clocks */
    tear_down(rig);
    /* Its own cycle has priority over that of the plan; without both it is a millisecond. */
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

/** A mailbox is not configured, so it has no place in the image either. */
static void sizes_of_igh_are_checked(void) {
    struct rig *rig = set_up();
    record(rig, FSN_SEC_SM, 3)[4] = 1;
    refuses(rig, FSN_E_BUS_IMAGE, "IgH gives it 0 bytes, the plan has 8");
}

static void what_does_not_come_is_not_waited_for(void) {
    struct rig *rig = set_up();
    fake.scans = 1000000;
    CHECK(open_with(rig, 0) == FSN_E_BUS_STATE);
    CHECK(strcmp(rig->fault.rule, "IgH does not finish its scan") == 0);
    tear_down(rig);
    rig = set_up();
    fake.device[1].al = 1;
    refuses(rig, FSN_E_BUS_STATE, "PREOP refused: AL status 0x01; see the kernel log");
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

/** The fault may be NULL. */
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
        const uint64_t lost = snapshot(rig).counts.lost_frames;
        fake.lose_frames = true;
        run(rig, 1, FSN_AL_OP);
        fake.lose_frames = false;
        CHECK(snapshot(rig).counts.lost_frames == lost + 1);
        tear_down(rig);
    }
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
        CHECK(status != FSN_OK || heap.fails_in > 0);
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
    a_lost_answer_is_asked_for_again();
    a_place_may_be_told_by_an_alias();
    igh_is_told_clocks_and_watchdogs();
    sizes_of_igh_are_checked();
    what_does_not_come_is_not_waited_for();
    a_fault_is_not_needed();
    replies_are_waited_for();
    each_call_may_fail(-EIO, 1, 1, 20);
    each_call_may_fail(-EINTR, 1, 1, 0);
    each_call_may_fail(-EINTR, 9, 7, 5);
    each_call_may_fail(-EINTR, 200, 31, 1);
    each_call_may_fail(-EPROTO, 3, 7, 5);
    each_call_may_fail(-EOPNOTSUPP, 2, 7, 5);
    options_are_checked();
    bus_is_refused();
    other_devices_are_refused();
    groups_are_refused();
    mappings_are_checked();
    sdos_are_written();
    return 0;
}
