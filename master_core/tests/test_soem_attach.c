/** A second user of a running bus: it attaches where all is as planned, changes nothing before its
 *  first cycle, and is refused where anything differs. */
#define _GNU_SOURCE

#include <string.h>

#include "fsn/handover.h"
#include "plan/plan_internal.h"
#include "soem_rig.h"

enum { SKIPPED = 77, PRODUCT = 12 /**< of a SubDevice's record */ };

/** Attaches with a plan, checks all SubDevices, and detaches. */
static fsn_status attach(const struct fsn_plan *plan, const struct fsn_bus_attachment *attachment,
                         const char *second, struct fsn_fault *fault) {
    const struct fsn_live_options options = {
        .interface = "near", .redundant = second, .dc_every = 5, .attach = attachment};
    void *bus;
    struct fsn_core *core = NULL;
    CHECK(fsn_backend_soem()->create(&options, &bus, fault) == FSN_OK);
    const fsn_status status = fsn_core_create(plan, fsn_backend_soem()->ops, bus, &core, fault);
    CHECK((status == FSN_OK) == (core != NULL));
    if (status == FSN_OK) {
        for (uint32_t n = 0; n < fsn_plan_subdevice_count(plan); n++) {
            struct fsn_bus_subdevice seen;
            CHECK(fsn_core_subdevice(core, n, &seen) == FSN_OK);
            CHECK(seen.al_status == FSN_AL_OP && seen.found == FSN_FOUND_RIGHT);
        }
    }
    fsn_core_free(core);
    fsn_backend_soem()->free(bus);
    return status;
}

static struct fsn_bus_attachment describe(struct rig *rig) {
    struct fsn_bus_attachment attachment;
    CHECK(fsn_backend_soem()->ops->describe(rig->bus, &attachment) == FSN_OK);
    CHECK(attachment.len_bytes > 0 && attachment.lock >= 0 && attachment.held_count >= 3);
    return attachment;
}

/** Attaches until it goes as wanted. A busy machine may lose frames, or stop the cycle for longer
 *  than a SubDevice stays in OP: where all shall be there, who has left is brought back. */
static void until(struct rig *rig, const struct fsn_plan *plan,
                  const struct fsn_bus_attachment *attachment, fsn_status wanted,
                  const char *detail) {
    const uint64_t end = now_ns() + PATIENCE_MS * UINT64_C(1000000);
    while (attach(plan, attachment, NULL, &rig->fault) != wanted ||
           (wanted != FSN_OK && strstr(rig->fault.detail, detail) == NULL)) {
        CHECK(now_ns() < end);
        if (wanted == FSN_OK || plan != rig->plan) {
            fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        }
    }
}

/** It attaches and detaches next to the process that drives the bus: nothing leaves OP. */
static void a_successor_looks_and_leaves(void) {
    struct rig *rig = bring_up();
    const struct fsn_bus_attachment attachment = describe(rig);
    until(rig, rig->plan, &attachment, FSN_OK, NULL);
    until(rig, rig->plan, &attachment, FSN_OK, NULL);
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        CHECK(look(rig, n).returns == 0 || lateness(rig) > 0);
    }
    poll_until_all_in_op(rig);
    for (uint32_t k = 1; k < SUBDEVICES; k++) {
        CHECK(flows(rig, k));
    }
    tear_down(rig);
}

/** How a plan of the running bus differs, and how attaching with it is refused. */
struct difference {
    uint32_t subdevices;
    uint16_t input_bytes;
    uint8_t product; /**< of SubDevice 1 */
    fsn_status status;
    const char *detail;
};

static void a_plan_is_refused(struct rig *rig, const struct fsn_bus_attachment *attachment,
                              const struct difference *other) {
    const struct build_sm sms[SUBDEVICES + 1][2] = {
        {{FSN_OUTPUT, 18}, {FSN_INPUT, 18}},
        {{FSN_OUTPUT, 6}, {FSN_INPUT, other->input_bytes}},
        {{FSN_OUTPUT, 6}, {FSN_INPUT, 6}},
        {{FSN_OUTPUT, 8}, {FSN_INPUT, 6}},
        {{FSN_OUTPUT, 6}, {FSN_INPUT, 6}}};
    const struct build b = {.subdevices = other->subdevices, .sm = sms, .cycle_ns = 1000000};
    size_t len;
    uint8_t *bytes = build_plan(&b, &len);
    struct fsn_plan *plan;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    plan->bytes[plan->offset[FSN_SEC_SUBDEVICE] + fsn_record_bytes[FSN_SEC_SUBDEVICE] + PRODUCT] =
        other->product;
    until(rig, plan, attachment, other->status, other->detail);
    fsn_plan_free(plan);
    free(bytes);
}

static void what_differs_is_refused(void) {
    struct rig *rig = bring_up();
    struct fsn_bus_attachment attachment = describe(rig);
    static const struct difference others[] = {
        {SUBDEVICES, 9, 0x01, FSN_E_BUS_MAPPING, "not those of this plan"},
        {SUBDEVICES + 1, 7, 0x01, FSN_E_BUS_MISSING, "the running bus has 4 SubDevices"},
        {SUBDEVICES, 7, 0x77, FSN_E_BUS_IDENTITY, "found vendor"},
    };
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        a_plan_is_refused(rig, &attachment, &others[i]);
    }
    CHECK(attach(rig->plan, &attachment, "near2", &rig->fault) == FSN_E_STATE);
    CHECK(strstr(rig->fault.rule, "--redundant") != NULL);
    attachment.len_bytes--;
    CHECK(attach(rig->plan, &attachment, NULL, &rig->fault) == FSN_E_STATE);
    CHECK(strstr(rig->fault.rule, "another SOEM") != NULL);
    attachment.len_bytes = 3;
    CHECK(attach(rig->plan, &attachment, NULL, &rig->fault) == FSN_E_STATE);
    attachment = describe(rig);
    attachment.lock = -1;
    CHECK(attach(rig->plan, &attachment, NULL, &rig->fault) == FSN_E_SYS);
    /* Somebody is away, or not in OP. */
    attachment = describe(rig);
    fsn_segment_set_present(rig->segment, SUBDEVICES - 1, false);
    until(rig, rig->plan, &attachment, FSN_E_BUS_MISSING, "");
    fsn_segment_set_present(rig->segment, SUBDEVICES - 1, true);
    poll_until_all_in_op(rig);
    attachment = describe(rig);
    fsn_segment_power_cycle(rig->segment, 2);
    until(rig, rig->plan, &attachment, FSN_E_BUS_STATE, "it is not in OP");
    poll_until_all_in_op(rig);
    attachment = describe(rig);
    until(rig, rig->plan, &attachment, FSN_OK, NULL);
    tear_down(rig);
}

int main(void) {
    if (!make_network()) {
        fprintf(stderr, "skipped: no network namespace with a veth pair can be made here\n");
        return SKIPPED;
    }
    a_successor_looks_and_leaves();
    what_differs_is_refused();
    return 0;
}
