#define _GNU_SOURCE

#include "soem_rig.h"

#include <sched.h>
#include <string.h>
#include <time.h>

bool make_network(void) {
    if (unshare(CLONE_NEWNET) != 0 && unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) {
        return false;
    }
    return system("ip link set lo up && ip link add near type veth peer name far && "
                  "ip link set near up && ip link set far up && "
                  "ip link add near2 type veth peer name far2 && "
                  "ip link set near2 up && ip link set far2 up") == 0;
}

uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

void pause_ms(long ms) {
    const struct timespec pause = {.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000};
    nanosleep(&pause, NULL);
}

enum { SEC_SUBDEVICE = 1 }; /* of the plan file */

uint8_t *build(size_t *len) {
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
    uint8_t *bytes = build_plan(&b, len);
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        const char name[] = {'s', (char)('0' + n), '\0'};
        bytes = build_name(bytes, len, SEC_SUBDEVICE, n, name);
    }
    build_fix_crc(bytes, *len);
    return bytes;
}

/** Gives every sub its SYNC0. */
static void add_sync(uint8_t *bytes, size_t len) {
    enum { SUBDEVICE_BYTES = 48, ASSIGN_ACTIVATE = 40 };
    const uint8_t *begin = bytes + 32 + 16 * (SEC_SUBDEVICE - 1) + 4;
    uint8_t *records = bytes + (begin[0] | begin[1] << 8);
    for (uint32_t n = 1; n < SUBDEVICES; n++) {
        records[SUBDEVICE_BYTES * n + ASSIGN_ACTIVATE + 1] = 0x03;
    }
    build_fix_crc(bytes, len);
}

void link_segment(struct fsn_segment *segment, const char *second) {
    struct fsn_segment_link_options options = {
        .interface = "far", .interface2 = second, .priority = 1};
    if (fsn_segment_link(segment, &options, NULL) != FSN_OK) {
        options.priority = 0;
        CHECK(fsn_segment_link(segment, &options, NULL) == FSN_OK);
    }
}

struct rig *set_up_plans(const char *second, uint8_t *bytes, const uint8_t *of_segment,
                         size_t len) {
    struct rig *rig = calloc(1, sizeof *rig);
    CHECK(rig != NULL);
    rig->bytes = bytes;
    CHECK(fsn_plan_load(bytes, len, &rig->plan, NULL) == FSN_OK);
    CHECK(fsn_plan_load(of_segment, len, &rig->plan_of_segment, NULL) == FSN_OK);
    CHECK(fsn_segment_create(rig->plan_of_segment, &rig->segment) == FSN_OK);
    link_segment(rig->segment, second);
    rig->live = (struct fsn_live_options){
        .interface = "near", .redundant = second != NULL ? "near2" : NULL, .dc_every = 5};
    return rig;
}

struct rig *set_up_with(const char *second) {
    size_t len;
    uint8_t *bytes = build(&len);
    return set_up_plans(second, bytes, bytes, len);
}

struct rig *set_up_with_sync(void) {
    size_t len;
    uint8_t *bytes = build(&len);
    add_sync(bytes, len);
    struct rig *rig = set_up_plans(NULL, bytes, bytes, len);
    rig->live.dc_every = 0;
    return rig;
}

struct rig *set_up(void) {
    return set_up_with(NULL);
}

fsn_status open_bus(struct rig *rig) {
    CHECK(fsn_backend_soem()->create(&rig->live, &rig->bus, &rig->fault) == FSN_OK);
    const fsn_status status =
        fsn_core_create(rig->plan, fsn_backend_soem()->ops, rig->bus, &rig->core, &rig->fault);
    CHECK(status == FSN_OK || (rig->core == NULL && rig->fault.status == status));
    return status;
}

void close_bus(struct rig *rig) {
    fsn_core_free(rig->core);
    fsn_backend_soem()->free(rig->bus);
    rig->core = NULL;
    rig->bus = NULL;
}

void tear_down(struct rig *rig) {
    close_bus(rig);
    fsn_segment_free(rig->segment);
    fsn_plan_free(rig->plan);
    fsn_plan_free(rig->plan_of_segment);
    free(rig->bytes);
    free(rig);
}

struct fsn_bus_subdevice look(struct rig *rig, uint32_t n) {
    struct fsn_bus_subdevice seen;
    CHECK(fsn_core_subdevice(rig->core, n, &seen) == FSN_OK);
    return seen;
}

/** The writer may be faster than every attempt, under a sanitizer at least. */
struct fsn_statistics statistics(struct rig *rig) {
    struct fsn_statistics s;
    fsn_status status = FSN_E_BUSY;
    while (status == FSN_E_BUSY) {
        status = fsn_core_snapshot(rig->core, &s, NULL, NULL);
    }
    CHECK(status == FSN_OK);
    return s;
}

uint64_t lateness(struct rig *rig) {
    const struct fsn_statistics s = statistics(rig);
    return s.overruns + s.counts.old_replies;
}

void poll_until(struct rig *rig, uint32_t n, uint8_t al_state) {
    for (int i = 0; i < PATIENCE_MS / 2; i++) {
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        if (look(rig, n).al_status == al_state) {
            return;
        }
        pause_ms(2);
    }
    fprintf(stderr, "SubDevice %u: AL 0x%02x code 0x%04x, %s\n", n, look(rig, n).al_status,
            look(rig, n).al_code, look(rig, n).detail);
    exit(1);
}

void poll_until_all_in_op(struct rig *rig) {
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        poll_until(rig, n, FSN_AL_OP);
    }
}

struct rig *bring_up_from(struct rig *rig) {
    const uint64_t end = now_ns() + OPEN_PATIENCE_MS * UINT64_C(1000000);
    while (open_bus(rig) != FSN_OK) {
        fprintf(stderr, "%s: %s\n", rig->fault.rule, rig->fault.detail);
        CHECK(now_ns() < end);
        close_bus(rig);
    }
    const struct fsn_thread_options thread = {
        .cycle_ns = 1000000, .follow_dc = true, .dc_shift_ns = rig->live.dc_shift_ns};
    CHECK(fsn_core_start(rig->core, &thread, NULL) == FSN_OK);
    poll_until_all_in_op(rig);
    return rig;
}

struct rig *bring_up(void) {
    return bring_up_from(set_up());
}

static bool flows_within(struct rig *rig, uint32_t k, int looks) {
    uint8_t inputs[18], outputs[18];
    const uint32_t sizes[] = {18, 7, 6, 6};
    const uint32_t out_sizes[] = {18, 6, 6, 8};
    rig->beat++;
    memset(inputs, rig->beat, sizeof inputs);
    CHECK(fsn_segment_write_inputs(rig->segment, 2 * k + 1, inputs, sizes[k]) == FSN_OK);
    CHECK(fsn_segment_write_inputs(rig->segment, 1, inputs, sizes[0]) == FSN_OK);
    for (int i = 0; i < looks; i++) {
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
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

bool flows(struct rig *rig, uint32_t k) {
    return flows_within(rig, k, PATIENCE_MS / 2);
}

bool flows_soon(struct rig *rig, uint32_t k) {
    return flows_within(rig, k, 100);
}
