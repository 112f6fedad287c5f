/** The SOEM backend with SubDevices of other kinds, and refusals of its set-up. As test_soem.c. */
#include <string.h>

#include "fsn/acyclic.h"
#include "heap.h"
#include "plan/plan_internal.h"
#include "soem_rig.h"

enum { SKIPPED = 77 };

static uint8_t *record(struct fsn_plan *plan, uint32_t section, uint32_t number) {
    return plan->bytes + plan->offset[section] + number * fsn_record_bytes[section];
}

/** Both plans of a rig are changed before the segment is made from one of them. */
static struct rig *set_up_changed(void (*change)(struct fsn_plan *plan)) {
    struct rig *rig = set_up();
    fsn_segment_free(rig->segment);
    change(rig->plan);
    change(rig->plan_of_segment);
    CHECK(fsn_segment_create(rig->plan_of_segment, &rig->segment) == FSN_OK);
    link_segment(rig->segment, NULL);
    return rig;
}

/** Opens it, again while frames are late. */
static void is_refused(struct rig *rig, fsn_status status, const char *detail) {
    fsn_status got = open_bus(rig);
    for (int tries = 0; got != status && got != FSN_OK && tries < TRIES; tries++) {
        close_bus(rig);
        got = open_bus(rig);
    }
    if (got != status || strstr(rig->fault.detail, detail) == NULL) {
        fprintf(stderr, "%s: %s\n", fsn_status_name(got), rig->fault.detail);
        exit(1);
    }
}

static void options_are_checked(void) {
    static const struct fsn_live_options wrong[] = {
        {.interface = NULL},
        {.interface = ""},
        {.interface = "an-interface-too-long"},
        {.interface = "near", .redundant = "an-interface-too-long"},
        {.interface = "near", .redundant = "near"},
    };
    const struct fsn_backend *soem = fsn_backend_soem();
    void *bus = &bus;
    struct fsn_fault fault;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        CHECK(soem->create(&wrong[i], &bus, &fault) == FSN_E_ARG && fault.status == FSN_E_ARG);
    }
    CHECK(soem->create(NULL, &bus, &fault) == FSN_E_ARG);
    CHECK(soem->create(&(struct fsn_live_options){.interface = "near"}, NULL, NULL) == FSN_E_ARG);
    soem->free(NULL);
}

/** The fault may be NULL. */
static void a_fault_is_not_needed(void) {
    struct rig *rig = set_up();
    struct fsn_bus_layout layout;
    fsn_segment_set_present(rig->segment, 0, false);
    const struct fsn_live_options options = {.interface = "near"};
    const struct fsn_live_options absent = {.interface = "absent"};
    const struct fsn_backend *soem = fsn_backend_soem();
    CHECK(soem->create(&options, &rig->bus, NULL) == FSN_OK);
    CHECK(soem->ops->open(rig->bus, rig->plan, &layout, NULL) == FSN_E_BUS_SILENT);
    soem->free(rig->bus);
    fsn_segment_set_present(rig->segment, 0, true);
    fsn_segment_set_present(rig->segment, 2, false);
    CHECK(soem->create(&options, &rig->bus, NULL) == FSN_OK);
    CHECK(soem->ops->open(rig->bus, rig->plan, &layout, NULL) == FSN_E_BUS_MISSING);
    soem->free(rig->bus);
    CHECK(soem->create(&absent, &rig->bus, NULL) == FSN_OK);
    CHECK(soem->ops->open(rig->bus, rig->plan, &layout, NULL) == FSN_E_SYS);
    tear_down(rig);
}

static void carry_an_alias(struct fsn_plan *plan) {
    record(plan, FSN_SEC_SUBDEVICE, 1)[4] = 7;
    record(plan, FSN_SEC_SUBDEVICE, 1)[6] = 0; /* itself; in the segment it takes a free place */
    record(plan, FSN_SEC_SUBDEVICE, 2)[4] = 7;
    record(plan, FSN_SEC_SUBDEVICE, 2)[6] = 1; /* the next one after it */
}

static void places_may_be_told_by_an_alias(void) {
    struct rig *rig = set_up_changed(carry_an_alias);
    CHECK(fsn_segment_position(rig->segment, 1) == 1 && fsn_segment_position(rig->segment, 2) == 2);
    bring_up_from(rig);
    CHECK(flows(rig, 1) && flows(rig, 2));
    struct fsn_bus_subdevice seen;
    CHECK(fsn_backend_soem()->ops->state(rig->bus, SUBDEVICES, &seen) == FSN_E_ARG);
    tear_down(rig);
    rig = set_up();
    record(rig->plan, FSN_SEC_SUBDEVICE, 1)[4] = 9; /* not present */
    const struct fsn_live_options options = {.interface = "near"};
    CHECK(fsn_backend_soem()->create(&options, &rig->bus, NULL) == FSN_OK);
    CHECK(fsn_core_create(rig->plan, fsn_backend_soem()->ops, rig->bus, &rig->core, &rig->fault) ==
          FSN_E_BUS_MISSING);
    CHECK(strstr(rig->fault.detail, "alias 9, position 1: 4 SubDevices answer") != NULL);
    tear_down(rig);
}

/** The third SubDevice has its process data in sync managers 0 and 1, hence no mailbox; without
 *  clocks the fourth needs none. */
static void have_no_mailbox(struct fsn_plan *plan) {
    record(plan, FSN_SEC_SM, 4)[4] = 0;
    record(plan, FSN_SEC_SM, 5)[4] = 1;
    record(plan, FSN_SEC_SUBDEVICE, 1)[41] = 3; /* SYNC0 */
    record(plan, FSN_SEC_SUBDEVICE, 3)[41] = 7; /* and SYNC1 */
}

static void some_have_no_mailbox_and_some_have_clocks(void) {
    uint8_t byte;
    struct rig *rig = bring_up_from(set_up_changed(have_no_mailbox));
    CHECK(flows(rig, 1) && flows(rig, 2) && flows(rig, 3));
    struct fsn_transfer t = {.index = 0x1000, .data = &byte, .size_bytes = 1};
    CHECK(fsn_core_upload(rig->core, 2, &t) == FSN_E_ABSENT);
    tear_down(rig);
    /* In its SII it has another length than in the plan. */
    rig = set_up_changed(have_no_mailbox);
    uint8_t *pdo = record(rig->plan, FSN_SEC_SM, 5);
    pdo[8] = (uint8_t)(pdo[8] - 8);
    is_refused(rig, FSN_E_BUS_MAPPING, "SM1: its length in bits by the SII is 48, the plan has 40");
    tear_down(rig);
}

/** A plan's sync manager that no SII has, and two that are wrong at once: the first one is named.
 */
static void what_has_no_place_is_refused(void) {
    struct rig *rig = set_up_changed(have_no_mailbox);
    record(rig->plan, FSN_SEC_SM, 5)[4] = 9;
    is_refused(rig, FSN_E_BUS_MAPPING, "its SII has no address for SM9, or could not be read");
    tear_down(rig);
    rig = set_up();
    rig->plan->cycle_ns = 0; /* a millisecond then */
    const struct fsn_segment_identity other = {.vendor_id = 5, .product_code = 6, .revision = 7};
    for (uint32_t n = 1; n < 3; n++) {
        const uint32_t position = fsn_segment_position(rig->segment, n);
        CHECK(fsn_segment_set_identity(rig->segment, position, &other) == FSN_OK);
        fsn_segment_power_cycle(rig->segment, position);
    }
    is_refused(rig, FSN_E_BUS_IDENTITY, "found vendor 0x00000005");
    CHECK(rig->fault.copy_index == 1);
    tear_down(rig);
    rig = set_up();
    CHECK(system("ip link set far down") == 0);
    is_refused(rig, FSN_E_BUS_SILENT, "near has no link");
    CHECK(rig->fault.link_down);
    CHECK(system("ip link set far up") == 0);
    tear_down(rig);
    /* Of a ring, either interface may have a link. */
    rig = set_up_with("far2");
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        fsn_segment_set_present(rig->segment, n, false);
    }
    CHECK(system("ip link set far down") == 0);
    is_refused(rig, FSN_E_BUS_SILENT, "near2 has a link, but no EtherCAT SubDevice answers on it");
    CHECK(!rig->fault.link_down);
    CHECK(system("ip link set far2 down") == 0);
    close_bus(rig);
    is_refused(rig, FSN_E_BUS_SILENT, "neither near nor near2 has a link");
    CHECK(rig->fault.link_down);
    CHECK(system("ip link set far up && ip link set far2 up") == 0);
    tear_down(rig);
}

/** A SubDevice that does not come to PREOP is named at the start. */
static void preop_is_not_waited_for_for_ever(void) {
    struct rig *rig = set_up();
    const uint32_t position = fsn_segment_position(rig->segment, 2);
    CHECK(fsn_segment_set_al_delay(rig->segment, position, UINT64_C(3600000000000)) == FSN_OK);
    is_refused(rig, FSN_E_BUS_STATE, "not in PREOP after 3000 ms: AL status 0x01");
    CHECK(rig->fault.copy_index == 2);
    tear_down(rig);
}

/** An absent SubDevice cannot be reached either. */
static void nobody_is_reached_in_vain(void) {
    const struct fsn_bus_acyclic *acyclic = fsn_backend_soem()->ops->acyclic;
    struct rig *rig = bring_up();
    struct fsn_bus_member member;
    uint8_t bytes[4];
    CHECK(acyclic->count(rig->bus) == SUBDEVICES);
    CHECK(acyclic->place(rig->bus, 1) == 1 && acyclic->place(rig->bus, SUBDEVICES) == FSN_NONE);
    CHECK(acyclic->member(rig->bus, SUBDEVICES, &member) == FSN_E_ARG);
    struct fsn_transfer transfer = {.position = SUBDEVICES, .data = bytes, .size_bytes = 4};
    CHECK(acyclic->upload(rig->bus, &transfer) == FSN_E_BUS_MISSING);
    CHECK(acyclic->download(rig->bus, &transfer) == FSN_E_BUS_MISSING);
    CHECK(acyclic->sii_read(rig->bus, SUBDEVICES, 0, bytes, 4) == FSN_E_BUS_MISSING);
    CHECK(acyclic->sii_write(rig->bus, SUBDEVICES, 8, 1) == FSN_E_BUS_MISSING);
    fsn_segment_set_present(rig->segment, SUBDEVICES - 1, false);
    poll_until(rig, SUBDEVICES - 1, FSN_AL_NONE);
    CHECK(acyclic->sii_read(rig->bus, SUBDEVICES - 1, 0, bytes, 4) == FSN_E_BUS_MISSING);
    CHECK(acyclic->sii_write(rig->bus, SUBDEVICES - 1, 8, 1) == FSN_E_BUS_MISSING);
    tear_down(rig);
}

/** Polls the bus at a time in the future until something was noted about a SubDevice. */
static void is_noted(struct rig *rig, uint32_t n, const char *detail) {
    uint64_t ahead_ns = 0;
    while (strstr(look(rig, n).detail, detail) == NULL) {
        CHECK(ahead_ns < PATIENCE_MS * UINT64_C(1000000000));
        ahead_ns += UINT64_C(100000000);
        (void)fsn_core_poll(rig->core, FSN_AL_OP, now_ns() + ahead_ns);
        pause_ms(2);
    }
}

/** A write of another master: a request of an AL state, by ring position. */
static void request_from_elsewhere(struct rig *rig, uint32_t position, uint8_t al_state) {
    enum { ETHERNET = 14, APWR = 2, REG_AL_CONTROL = 0x0120 };
    uint8_t frame[60] = {0};
    uint8_t *ecat = frame + ETHERNET;
    const uint16_t address = (uint16_t)-position;
    frame[12] = 0x88;
    frame[13] = 0xA4;
    ecat[0] = 14; /* one datagram of two bytes */
    ecat[1] = 0x10;
    ecat[2] = APWR;
    ecat[4] = (uint8_t)address;
    ecat[5] = (uint8_t)(address >> 8);
    ecat[6] = REG_AL_CONTROL & 0xFF;
    ecat[7] = REG_AL_CONTROL >> 8;
    ecat[8] = 2;
    ecat[12] = al_state;
    CHECK(fsn_segment_frame(rig->segment, frame, sizeof frame, now_ns()) == sizeof frame);
    CHECK(ecat[14] == 1); /* one has taken it */
}

/** A SubDevice that refuses the requested state is named with its code, and tried again. */
static void a_refusal_is_told_with_its_code(void) {
    struct rig *rig = bring_up();
    const uint32_t position = fsn_segment_position(rig->segment, 2);
    for (int tries = 0; strstr(look(rig, 2).detail, "refused") == NULL; tries++) {
        CHECK(tries < TRIES);
        CHECK(fsn_segment_set_al_delay(rig->segment, position, UINT64_C(3600000000000)) == FSN_OK);
        fsn_segment_power_cycle(rig->segment, position);
        poll_until(rig, 2, FSN_AL_INIT);
        (void)fsn_core_poll(rig->core, FSN_AL_OP, now_ns()); /* PREOP is requested */
        CHECK(fsn_segment_set_al_delay(rig->segment, position, 0) == FSN_OK);
        request_from_elsewhere(rig, position, FSN_AL_BOOT);
        (void)fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
    }
    CHECK(strcmp(look(rig, 2).detail,
                 "PREOP refused: AL status 0x11, code 0x0013: boot state not supported") == 0);
    CHECK(look(rig, 2).found == FSN_FOUND_STATE && look(rig, 2).al_code == 0x0013);
    poll_until_all_in_op(rig);
    CHECK(look(rig, 2).found == FSN_FOUND_RIGHT && look(rig, 2).detail[0] == '\0');
    tear_down(rig);
}

/** A SubDevice that does not reach a state in four seconds is named, and tried again. */
static void states_have_their_time(void) {
    struct rig *rig = bring_up();
    const uint32_t position = fsn_segment_position(rig->segment, 2);
    CHECK(fsn_segment_set_al_delay(rig->segment, position, UINT64_C(3600000000000)) == FSN_OK);
    fsn_segment_power_cycle(rig->segment, position);
    is_noted(rig, 2, "not in PREOP after 4000 ms: AL status 0x01");
    CHECK(look(rig, 2).found == FSN_FOUND_STATE);
    CHECK(fsn_segment_set_al_delay(rig->segment, position, 0) == FSN_OK);
    tear_down(rig);
}

#ifdef FSN_TEST_HEAP
static void memory_runs_out(void) {
    const struct fsn_live_options options = {.interface = "near"};
    struct rig *rig = set_up();
    fsn_status status = FSN_E_NOMEM;
    long tried = 0;
    while (status != FSN_OK) {
        const long alive = heap.alive;
        heap.fails_in = ++tried;
        status = fsn_backend_soem()->create(&options, &rig->bus, &rig->fault);
        if (status == FSN_OK) {
            status = fsn_core_create(rig->plan, fsn_backend_soem()->ops, rig->bus, &rig->core,
                                     &rig->fault);
        }
        CHECK(status != FSN_OK || heap.fails_in > 0);
        tried -= heap.fails_in > 0 && status != FSN_OK; /* a frame was late, nothing else */
        heap.fails_in = 0;
        CHECK(status == FSN_OK || rig->fault.status == status);
        close_bus(rig);
        CHECK(heap.alive == alive);
    }
    CHECK(tried > 15);
    tear_down(rig);
}
#endif

int main(void) {
    options_are_checked();
    if (!make_network()) {
        fprintf(stderr, "skipped: no network namespace with a veth pair can be made here\n");
        return SKIPPED;
    }
    a_fault_is_not_needed();
    places_may_be_told_by_an_alias();
    some_have_no_mailbox_and_some_have_clocks();
    what_has_no_place_is_refused();
    preop_is_not_waited_for_for_ever();
    nobody_is_reached_in_vain();
    a_refusal_is_told_with_its_code();
    states_have_their_time();
#ifdef FSN_TEST_HEAP
    memory_runs_out();
#endif
    return 0;
}
