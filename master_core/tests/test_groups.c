/** Groups of SubDevices that may be absent: the plan, and the expected working counter. */
#define _GNU_SOURCE

#include <string.h>

#include "fsn/core.h"
#include "fsn/emulated.h"
#include "heap.h"
#include "wire_rig.h"

enum { SUBDEVICES = 4, GROUP = 13, RECORD = 16 };

static const struct build_sm sms[SUBDEVICES][2] = {{{FSN_OUTPUT, 18}, {FSN_INPUT, 18}},
                                                   {{FSN_OUTPUT, 6}, {FSN_INPUT, 6}},
                                                   {{FSN_OUTPUT, 6}, {FSN_INPUT, 6}},
                                                   {{FSN_OUTPUT, 6}, {FSN_INPUT, 6}}};
static const struct build_copy copies[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6},  {0, 6, 2, 0, 6},
                                           {2, 0, 0, 6, 6}, {0, 12, 3, 0, 6}, {3, 0, 0, 12, 6}};
/* A tool of two SubDevices, and one of one at the same place. */
static const struct build_group groups[] = {{1, 2, 1}, {3, 1, 1}};

static uint8_t *build_groups(const struct build_group *two, size_t *len) {
    const struct build b = {.subdevices = SUBDEVICES,
                            .sm = sms,
                            .copies = copies,
                            .pairs = SUBDEVICES - 1,
                            .cycle_ns = 1000000,
                            .groups = two,
                            .group_count = 2};
    return build_plan(&b, len);
}

static uint8_t *build(size_t *len) {
    return build_groups(groups, len);
}

static void a_plan_names_its_groups(void) {
    size_t len;
    uint8_t *bytes = build(&len);
    struct fsn_plan *plan;
    struct fsn_group_info info;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    CHECK(fsn_plan_group_count(plan) == 2 && fsn_plan_group(plan, 2, &info) == FSN_E_ARG);
    CHECK(fsn_plan_group(plan, 0, &info) == FSN_OK && strcmp(info.name, "t") == 0);
    CHECK(strcmp(info.place, "t") == 0 && info.first_subdevice == 1 && info.subdevice_count == 2);
    CHECK(fsn_plan_group_of(plan, 0) == FSN_NONE && fsn_plan_group_of(plan, 1) == 0);
    CHECK(fsn_plan_group_of(plan, 2) == 0 && fsn_plan_group_of(plan, 3) == 1);
    struct fsn_plan *part;
    CHECK(fsn_plan_part(plan, 0, &part) == FSN_OK && part == plan);
    fsn_plan_free(part);
    fsn_plan_free(plan);
    free(bytes);
}

/** Without a place, or at another one, a group leaves none out. */
static void a_group_of_its_own_is_a_first_choice(void) {
    static const struct build_group cases[][2] = {{{1, 2, 0}, {3, 1, 1}}, {{1, 2, 1}, {3, 1, 0}}};
    for (int n = 0; n < 2; n++) {
        size_t len;
        uint8_t *bytes = build_groups(cases[n], &len);
        struct fsn_plan *plan;
        struct fsn_emulated *bus;
        struct fsn_core *core;
        struct fsn_statistics s;
        CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
        CHECK(fsn_emulated_create(plan, &bus) == FSN_OK);
        CHECK(fsn_core_create(plan, fsn_emulated_ops(), bus, &core, NULL) == FSN_OK);
        CHECK(fsn_core_cycle(core, 0) == FSN_OK);
        CHECK(fsn_core_snapshot(core, &s, NULL, NULL) == FSN_OK);
        CHECK(s.expected_wkc == 12 && s.actual_wkc == 12);
        fsn_core_free(core);
        fsn_emulated_free(bus);
        fsn_plan_free(plan);
        free(bytes);
    }
}

/** Every group with its name, so that a wrong tool cannot be meant. */
static void wrong_groups_are_refused(void) {
    static const struct {
        uint32_t section, record, byte, value;
        fsn_status status;
    } table[] = {
        {GROUP, 0, 0, 0, FSN_E_PLAN_STRING},    /* no name */
        {GROUP, 0, 0, 99, FSN_E_PLAN_STRING},   /* outside */
        {GROUP, 1, 4, 99, FSN_E_PLAN_STRING},   /* its place */
        {GROUP, 1, 8, 2, FSN_E_PLAN_REFERENCE}, /* in both */
        {GROUP, 1, 8, 4, FSN_E_PLAN_REFERENCE}, /* after the last */
        {GROUP, 1, 8, 0xFFFFFFFF, FSN_E_PLAN_REFERENCE},
        {GROUP, 1, 12, 0, FSN_E_PLAN_REFERENCE}, /* of no group */
        {GROUP, 1, 12, 2, FSN_E_PLAN_REFERENCE}, /* too many */
        {GROUP, 1, 12, 0xFFFFFFFF, FSN_E_PLAN_REFERENCE},
        {1, 3, 4, 0, FSN_E_PLAN_VALUE},          /* no alias */
        {1, 3, 4, 0x00010503, FSN_E_PLAN_VALUE}, /* not at its alias */
        {1, 2, 4, 0x00010502, FSN_E_PLAN_VALUE}, /* another alias than the first */
        {1, 2, 4, 0x00000501, FSN_E_PLAN_VALUE}, /* at the place of the first */
        {1, 3, 40, 0x0300, FSN_E_PLAN_VALUE},    /* with distributed clocks */
    };
    static const uint32_t record_bytes[] = {[1] = 48, [GROUP] = RECORD};
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        size_t len;
        uint8_t *bytes = build(&len);
        uint8_t *at = bytes + fsn_get32(bytes + 32 + 16 * (table[i].section - 1) + 4) +
                      (size_t)table[i].record * record_bytes[table[i].section] + table[i].byte;
        struct fsn_plan *plan;
        struct fsn_fault fault;
        fsn_put32(at, table[i].value);
        build_fix_crc(bytes, len);
        CHECK(fsn_plan_load(bytes, len, &plan, &fault) == table[i].status && plan == NULL);
        CHECK(fault.section == GROUP && fault.copy_index <= 1 && fault.rule[0] != 0);
        free(bytes);
    }
}

/** Format 1.3 has groups and no buses. */
static void the_sections_of_a_plan_with_groups(void) {
    const uint32_t rows[] = {GROUP, 12}; /* whose count is wrong */
    for (size_t i = 0; i < 2; i++) {
        size_t len;
        uint8_t *bytes = build(&len);
        struct fsn_plan *plan;
        fsn_put32(bytes + 32 + 16 * (rows[i] - 1) + 8, i == 0 ? 0 : 2);
        build_fix_crc(bytes, len);
        CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_E_PLAN_SECTION);
        free(bytes);
    }
}

static void a_group_is_in_the_fingerprint(void) {
    struct fsn_fingerprint made[2];
    for (uint32_t n = 0; n < 2; n++) {
        size_t len;
        uint8_t *bytes = build(&len);
        struct fsn_plan *plan;
        fsn_put32(bytes + fsn_get32(bytes + 32 + 16 * (GROUP - 1) + 4) + 4, n);
        build_fix_crc(bytes, len);
        CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
        CHECK(fsn_plan_fingerprint(plan, &made[n]) == FSN_OK);
        fsn_plan_free(plan);
        free(bytes);
    }
    CHECK(memcmp(made[0].section[0], made[1].section[0], FSN_SHA256_BYTES) != 0);
    CHECK(memcmp(made[0].section[1], made[1].section[1], FSN_SHA256_BYTES) == 0);
}

/* -- the wire ------------------------------------------------------------------------------- */

/** One cycle in which the segment counts so much. */
static struct fsn_wkc counts(struct rig *rig, uint16_t counter) {
    rig->queued = 0;
    fsn_wire_send(&rig->frames.wire);
    CHECK(hold(rig, 0));
    count_up(rig->queue[0] + FSN_WIRE_DATA + rig->frames.wire.frames[0].size_bytes, counter);
    answer(rig, 0, 0);
    take(rig);
    return rig->wkc[0];
}

static void set_there(struct rig *rig, uint32_t group, uint8_t there) {
    atomic_store(&rig->frames.wire.groups[group].there, there);
}

static void the_working_counter_follows_who_is_there(void) {
    enum { EACH = 3, PATIENCE = 4 };
    size_t len;
    uint8_t *bytes = build(&len);
    struct rig *rig = set_up_plan(1, bytes, len);
    rig->frames.wire.group_patience = PATIENCE;
    CHECK(rig->frames.wire.group_count == 2 && rig->frames.wire.groups[0].wkc[0] == 2 * EACH);
    CHECK(rig->frames.wire.groups[1].wkc[0] == EACH);
    struct fsn_wkc seen = counts(rig, EACH); /* none is there */
    CHECK(seen.expected == EACH && seen.actual == EACH);
    seen = counts(rig, EACH - 1); /* who is always there is missed */
    CHECK(seen.expected == EACH && seen.actual == EACH - 1);
    CHECK(rig->stale[1] == 1 && rig->stale[3] == 0 && rig->stale[7] == 0);
    set_there(rig, 0, FSN_WIRE_COMING);
    for (uint16_t more = 0; more <= 2 * EACH; more++) { /* it comes piece by piece */
        seen = counts(rig, (uint16_t)(EACH + more));
        CHECK(seen.expected == seen.actual);
    }
    seen = counts(rig, 4 * EACH + 1); /* more than there are */
    CHECK(seen.expected != seen.actual);
    set_there(rig, 0, FSN_WIRE_THERE);
    seen = counts(rig, 3 * EACH);
    CHECK(seen.expected == 3 * EACH && seen.actual == 3 * EACH);
    for (uint32_t n = 0; n < 2; n++) {
        for (uint32_t i = 0; i < PATIENCE; i++) { /* it has gone, not detected yet */
            seen = counts(rig, EACH);
            CHECK(seen.expected == EACH && seen.actual == EACH);
        }
        seen = counts(rig, EACH); /* by now it should be known */
        CHECK(seen.expected == 3 * EACH && seen.actual == EACH);
        seen = counts(rig, 3 * EACH);
        CHECK(seen.expected == seen.actual);
    }
    seen = counts(rig, 2 * EACH); /* half of it is a fault */
    CHECK(seen.expected == 3 * EACH && seen.actual == 2 * EACH);
    rig->frames.wire.groups[1].wkc[0] = 0; /* all of it in another frame: it changes nothing here */
    set_there(rig, 1, FSN_WIRE_THERE);
    seen = counts(rig, 4 * EACH);
    CHECK(seen.expected == 4 * EACH && seen.actual == 4 * EACH);
    fsn_wire_send(&rig->frames.wire); /* a lost frame is one, whoever is there */
    take(rig);
    CHECK(rig->wkc[0].actual == 0 && rig->wkc[0].expected != 0);
    tear_down(rig);
}

/* -- the emulated bus ------------------------------------------------------------------------ */

static void an_emulated_group_comes_and_goes(void) {
    size_t len;
    uint8_t *bytes = build(&len);
    struct fsn_plan *plan;
    struct fsn_emulated *bus;
    struct fsn_core *core;
    struct fsn_statistics s;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    CHECK(fsn_emulated_create(plan, &bus) == FSN_OK);
    CHECK(fsn_core_create(plan, fsn_emulated_ops(), bus, &core, NULL) == FSN_OK);
    /* The first of its place is there at first; then none, both, one half. */
    static const struct {
        bool present[SUBDEVICES];
        uint32_t expected, actual;
    } steps[] = {{{true, true, true, false}, 9, 9},
                 {{true, false, false, false}, 3, 3},
                 {{true, true, true, true}, 12, 12},
                 {{false, false, false, false}, 3, 0}};
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        for (uint32_t n = 0; i > 0 && n < SUBDEVICES; n++) {
            CHECK(fsn_emulated_set_present(bus, n, steps[i].present[n]) == FSN_OK);
        }
        CHECK(fsn_core_cycle(core, i) == FSN_OK);
        CHECK(fsn_core_snapshot(core, &s, NULL, NULL) == FSN_OK);
        CHECK(s.expected_wkc == steps[i].expected && s.actual_wkc == steps[i].actual);
    }
    CHECK(s.wkc_errors == 1 && fsn_core_stale_cycles(core, 1) == 1);
    CHECK(fsn_core_stale_cycles(core, 3) == 0);
    fsn_core_free(core);
    fsn_emulated_free(bus);
    fsn_plan_free(plan);
    free(bytes);
}

int main(void) {
    const long alive = heap_alive();
    a_plan_names_its_groups();
    a_group_of_its_own_is_a_first_choice();
    CHECK(strcmp(fsn_clocks_text(255), "?") == 0);
    wrong_groups_are_refused();
    the_sections_of_a_plan_with_groups();
    a_group_is_in_the_fingerprint();
    the_working_counter_follows_who_is_there();
    an_emulated_group_comes_and_goes();
    CHECK(heap_alive() == alive);
    return 0;
}
