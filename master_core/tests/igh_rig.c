#define _POSIX_C_SOURCE 200809L

#include "igh_rig.h"

#include <string.h>
#include <time.h>

#include "plan/plan_internal.h"

/** Nobody waits here. */
int clock_nanosleep(clockid_t clock, int flags, const struct timespec *time,
                    struct timespec *left) {
    (void)clock;
    (void)flags;
    (void)time;
    (void)left;
    return 0;
}
uint8_t *record(struct rig *rig, uint32_t section, uint32_t number) {
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

struct rig *set_up(void) {
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

fsn_status open_with(struct rig *rig, uint32_t dc_every) {
    const struct fsn_live_options options = {.interface = "0", .dc_every = dc_every};
    CHECK(fsn_backend_igh()->create(&options, &rig->bus, &rig->fault) == FSN_OK);
    return fsn_core_create(rig->plan, fsn_backend_igh()->ops, rig->bus, &rig->core, &rig->fault);
}

void tear_down(struct rig *rig) {
    fsn_core_free(rig->core);
    fsn_backend_igh()->free(rig->bus);
    fsn_plan_free(rig->plan);
    free(rig);
    CHECK(fake.open_masters == 0 && !fake.active);
    CHECK(fake.sdo_while_scanning == 0);
}

void refuses(struct rig *rig, fsn_status status, const char *detail) {
    const fsn_status got = open_with(rig, 0);
    if (got != status || strstr(rig->fault.detail, detail) == NULL) {
        fprintf(stderr, "%s: %s, %s\n", detail, fsn_status_name(got), rig->fault.detail);
        exit(1);
    }
    CHECK(rig->fault.status == status && rig->fault.rule != NULL && !fake.active);
    tear_down(rig);
}

struct fsn_bus_subdevice look(struct rig *rig, uint32_t n) {
    struct fsn_bus_subdevice seen;
    CHECK(fsn_core_subdevice(rig->core, n, &seen) == FSN_OK);
    return seen;
}

bool run(struct rig *rig, unsigned cycles, uint8_t goal) {
    bool there = false;
    for (unsigned i = 0; i < cycles; i++) {
        rig->now_ns += MS;
        CHECK(fsn_core_cycle(rig->core, rig->now_ns) == FSN_OK);
        there = fsn_core_poll(rig->core, goal, rig->now_ns);
    }
    return there;
}

struct rig *bring_up(void) {
    struct rig *rig = set_up();
    CHECK(open_with(rig, 0) == FSN_OK);
    CHECK(run(rig, 50, FSN_AL_OP));
    CHECK(look(rig, 0).al_status == FSN_AL_OP && look(rig, 1).al_status == FSN_AL_OP);
    return rig;
}

struct fsn_statistics snapshot(struct rig *rig) {
    struct fsn_statistics statistics;
    CHECK(fsn_core_snapshot(rig->core, &statistics, NULL, NULL) == FSN_OK);
    return statistics;
}

bool is_in_op(struct rig *rig, uint32_t n) {
    return look(rig, n).found == FSN_FOUND_RIGHT && look(rig, n).al_status == FSN_AL_OP;
}

void reach_op(struct rig *rig) {
    unsigned cycles = 0;
    while (!run(rig, 1, FSN_AL_OP) || !is_in_op(rig, 0) || !is_in_op(rig, 1)) {
        CHECK(++cycles < 3000);
    }
}
