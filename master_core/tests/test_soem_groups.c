/** Groups that come and go on a bus of SOEM, against the emulated segment; skipped (77) where no
 * veth pair can be made. */
#define _GNU_SOURCE

#include <string.h>

#include "soem_rig.h"

enum { SKIPPED = 77, RECORD = 48, AGAIN = 5 };

/** A main that is always there, a tool of two SubDevices, and one of one at the same place. */
static uint8_t *build_tools(size_t *len) {
    static const struct build_sm sms[SUBDEVICES][2] = {{{FSN_OUTPUT, 18}, {FSN_INPUT, 18}},
                                                       {{FSN_OUTPUT, 6}, {FSN_INPUT, 7}},
                                                       {{FSN_OUTPUT, 6}, {FSN_INPUT, 6}},
                                                       {{FSN_OUTPUT, 8}, {FSN_INPUT, 6}}};
    static const struct build_copy copies[] = {{0, 0, 1, 0, FRAME},  {1, 0, 0, 0, FRAME},
                                               {0, 6, 2, 0, FRAME},  {2, 0, 0, 6, FRAME},
                                               {0, 12, 3, 0, FRAME}, {3, 0, 0, 12, FRAME}};
    static const struct build_group groups[] = {{1, 2, 1}, {3, 1, 1}};
    const struct build b = {.subdevices = SUBDEVICES,
                            .sm = sms,
                            .copies = copies,
                            .pairs = SUBDEVICES - 1,
                            .cycle_ns = 1000000,
                            .groups = groups,
                            .group_count = 2};
    return build_plan(&b, len);
}

/** The bus is open, and the first group has come. */
static struct rig *begin(void) {
    size_t len;
    uint8_t *bytes = build_tools(&len);
    struct rig *rig = set_up_plans(NULL, bytes, bytes, len);
    while (open_bus(rig) != FSN_OK) { /* frames may be late */
        close_bus(rig);
    }
    const struct fsn_thread_options options = {.cycle_ns = 2000000};
    CHECK(fsn_core_start(rig->core, &options, NULL) == FSN_OK);
    poll_until(rig, 0, FSN_AL_OP);
    poll_until(rig, 1, FSN_AL_OP);
    poll_until(rig, 2, FSN_AL_OP);
    return rig;
}

static void plug(struct rig *rig, uint32_t n, bool present) {
    fsn_segment_set_present(rig->segment, fsn_segment_position(rig->segment, n), present);
}

/** Waits until a SubDevice is found so, with a text. */
static void find(struct rig *rig, uint32_t n, uint8_t found, const char *text) {
    for (int i = 0; i < PATIENCE_MS / 2; i++) {
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        if (look(rig, n).found == found && strstr(look(rig, n).detail, text) != NULL) {
            return;
        }
        pause_ms(2);
    }
    fprintf(stderr, "SubDevice %u: found %u, %s\n", n, look(rig, n).found, look(rig, n).detail);
    exit(1);
}

static int compare(const void *left, const void *right) {
    const uint64_t a = *(const uint64_t *)left;
    const uint64_t b = *(const uint64_t *)right;
    return (a > b) - (a < b);
}

/** Permanent SubDevices stay in OP, and no cycle is incomplete except for late frames. */
static void tools_are_exchanged(int times) {
    struct rig *rig = begin();
    uint64_t *took_ns = calloc((size_t)times, sizeof *took_ns);
    CHECK(took_ns != NULL);
    const struct fsn_statistics before = statistics(rig);
    CHECK(look(rig, 3).found == FSN_FOUND_ABSENT && look(rig, 3).detail[0] == 0);
    CHECK(flows(rig, 1) && flows(rig, 2) && !flows_soon(rig, 3));
    for (int i = 0; i < times; i++) {
        plug(rig, 1, false);
        plug(rig, 2, false);
        poll_until(rig, 1, FSN_AL_NONE);
        poll_until(rig, 2, FSN_AL_NONE);
        find(rig, 1, FSN_FOUND_ABSENT, "");
        const uint64_t plugged_ns = now_ns();
        plug(rig, 3, true);
        poll_until(rig, 3, FSN_AL_OP);
        CHECK(look(rig, 3).found == FSN_FOUND_RIGHT && flows(rig, 3));
        took_ns[i] = now_ns() - plugged_ns;
        CHECK(fsn_core_poll(rig->core, FSN_AL_OP, now_ns()) || lateness(rig) > 0);
        plug(rig, 3, false);
        poll_until(rig, 3, FSN_AL_NONE);
        plug(rig, 1, true);
        plug(rig, 2, true);
        poll_until(rig, 1, FSN_AL_OP);
        poll_until(rig, 2, FSN_AL_OP);
        CHECK(flows(rig, 1) && flows(rig, 2));
    }
    const struct fsn_statistics s = statistics(rig);
    const uint64_t late =
        s.counts.lost_frames + s.overruns - before.counts.lost_frames - before.overruns;
    CHECK(s.wkc_errors - before.wkc_errors <= late);
    CHECK(look(rig, 0).returns == 0 || late > 0);
    qsort(took_ns, (size_t)times, sizeof *took_ns, compare);
    printf("%d exchanges; from plugging to the first frames there and back: median %.1f ms, "
           "longest %.1f ms; %llu of %llu cycles with lost or left out frames\n",
           times, (double)took_ns[times / 2] / 1e6, (double)took_ns[times - 1] / 1e6,
           (unsigned long long)late, (unsigned long long)(s.cycles - before.cycles));
    free(took_ns);
    tear_down(rig);
}

/** Another tool at the same place, or another device with its alias: named, never taken in. */
static void wrong_tools_stay_out(void) {
    static const struct fsn_segment_identity other = {0x1234, 0x5678, 0x9};
    struct rig *rig = begin();
    plug(rig, 3, true);
    find(rig, 3, FSN_FOUND_ABSENT, "it is at ring position 3 while t is at t");
    CHECK(look(rig, 3).al_status == FSN_AL_NONE && flows(rig, 1));
    CHECK(fsn_segment_al_status(rig->segment, 3, NULL) == FSN_AL_INIT);
    plug(rig, 3, false);
    find(rig, 3, FSN_FOUND_ABSENT, "");
    plug(rig, 1, false);
    plug(rig, 2, false);
    poll_until(rig, 1, FSN_AL_NONE);
    CHECK(fsn_segment_set_identity(rig->segment, 3, &other) == FSN_OK);
    plug(rig, 3, true);
    find(rig, 3, FSN_FOUND_IDENTITY, "ring position 1, t: ");
    CHECK(fsn_segment_al_status(rig->segment, 3, NULL) == FSN_AL_INIT);
    plug(rig, 3, false);
    CHECK(fsn_segment_set_identity(rig->segment, 3, NULL) == FSN_OK);
    plug(rig, 3, true);
    poll_until(rig, 3, FSN_AL_OP);
    CHECK(flows(rig, 3));
    tear_down(rig);
}

/** Half of a tool is a fault, and comes back; a tool comes when it is whole. */
static void half_a_tool(void) {
    struct rig *rig = begin();
    plug(rig, 2, false);
    find(rig, 2, FSN_FOUND_NOTHING, "the rest of t is there");
    CHECK(!fsn_core_poll(rig->core, FSN_AL_OP, now_ns()) && flows(rig, 1));
    plug(rig, 2, true);
    poll_until(rig, 2, FSN_AL_OP);
    CHECK(flows(rig, 2));
    plug(rig, 1, false);
    plug(rig, 2, false);
    poll_until(rig, 1, FSN_AL_NONE);
    poll_until(rig, 2, FSN_AL_NONE);
    plug(rig, 1, true);
    find(rig, 1, FSN_FOUND_UNKNOWN, "ring position 2, t: ");
    CHECK(look(rig, 1).al_status == FSN_AL_NONE);
    plug(rig, 2, true);
    poll_until(rig, 1, FSN_AL_OP);
    poll_until(rig, 2, FSN_AL_OP);
    tear_down(rig);
}

/** The segment has another alias than the plan: a device of no group, in front of a group. */
static void strangers_are_named(void) {
    size_t len;
    uint8_t *bytes = build_tools(&len);
    uint8_t *of_segment = malloc(len);
    CHECK(of_segment != NULL);
    memcpy(of_segment, bytes, len);
    const uint32_t at = (uint32_t)(bytes[36] | bytes[37] << 8);
    for (uint32_t n = 1; n < 3; n++) {
        of_segment[at + RECORD * n + 4] = 0x77;
    }
    build_fix_crc(of_segment, len);
    struct rig *rig = set_up_plans(NULL, bytes, of_segment, len);
    free(of_segment);
    plug(rig, 1, false); /* else it would count among those that are always there */
    plug(rig, 2, false);
    while (open_bus(rig) != FSN_OK) {
        close_bus(rig);
    }
    const struct fsn_thread_options options = {.cycle_ns = 2000000};
    CHECK(fsn_core_start(rig->core, &options, NULL) == FSN_OK);
    poll_until(rig, 0, FSN_AL_OP);
    plug(rig, 1, true);
    find(rig, 3, FSN_FOUND_ABSENT, "alias 1399 is of no group");
    plug(rig, 3, true); /* after it */
    poll_until(rig, 3, FSN_AL_OP);
    CHECK(flows(rig, 3));
    plug(rig, 3, false);
    poll_until(rig, 3, FSN_AL_NONE);
    plug(rig, 1, false);
    find(rig, 1, FSN_FOUND_ABSENT, "");
    tear_down(rig);
}

/** Permanent SubDevices are found again, wherever a tool is. */
static void the_bus_is_lost_and_comes_back(void) {
    struct rig *rig = begin();
    CHECK(fsn_segment_set_link(rig->segment, FSN_NONE, false) == FSN_OK);
    poll_until(rig, 0, FSN_AL_NONE);
    poll_until(rig, 1, FSN_AL_NONE);
    CHECK(look(rig, 0).found == FSN_FOUND_NOTHING);
    find(rig, 1, FSN_FOUND_ABSENT, "");
    CHECK(fsn_segment_set_link(rig->segment, FSN_NONE, true) == FSN_OK);
    poll_until(rig, 0, FSN_AL_OP);
    poll_until(rig, 1, FSN_AL_OP);
    poll_until(rig, 2, FSN_AL_OP);
    fsn_segment_power_cycle(rig->segment, fsn_segment_position(rig->segment, 0));
    poll_until(rig, 1, FSN_AL_OP);
    poll_until(rig, 0, FSN_AL_OP);
    CHECK(flows(rig, 1) && flows(rig, 2));
    tear_down(rig);
}

static void not_in_a_ring(void) {
    size_t len;
    uint8_t *bytes = build_tools(&len);
    struct rig *rig = set_up_plans("far2", bytes, bytes, len);
    CHECK(open_bus(rig) == FSN_E_ARG && strstr(rig->fault.rule, "one interface") != NULL);
    tear_down(rig);
}

/** An argument is how many exchanges; then nothing else is tried. */
int main(int argc, char **argv) {
    if (!make_network()) {
        fprintf(stderr, "skipped: no network namespace with a veth pair can be made here\n");
        return SKIPPED;
    }
    if (argc > 1) {
        tools_are_exchanged(atoi(argv[1]));
        return 0;
    }
    tools_are_exchanged(AGAIN);
    wrong_tools_stay_out();
    half_a_tool();
    strangers_are_named();
    the_bus_is_lost_and_comes_back();
    not_in_a_ring();
    return 0;
}
