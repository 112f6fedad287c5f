/** Distributed clocks of the SOEM backend: set, followed, watched; on the emulated segment, whose
 *  devices leave OP where SYNC0 cannot be used. Skipped (77) like test_soem. */
#define _GNU_SOURCE

#include <string.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "soem_rig.h"

enum { SKIPPED = 77, CYCLE = 1000000, SECOND = 1000000000, SYNC_FATAL = 0x002C };

/** Wall clock of this process, nanoseconds since 1970; 0: that of the machine. SOEM sets all clocks
 *  to it. */
static uint64_t wall_ns;

int clock_gettime(clockid_t clock, struct timespec *time) {
    if (clock != CLOCK_REALTIME || wall_ns == 0) {
        return (int)syscall(SYS_clock_gettime, clock, time);
    }
    *time = (struct timespec){.tv_sec = (time_t)(wall_ns / SECOND),
                              .tv_nsec = (long)(wall_ns % SECOND)};
    return 0;
}

static struct fsn_bus_clocks clocks(struct rig *rig) {
    struct fsn_bus_clocks clocks;
    CHECK(fsn_core_clocks(rig->core, &clocks) == FSN_OK);
    return clocks;
}

static struct fsn_bus_clocks clocks_become(struct rig *rig, uint8_t state) {
    for (int i = 0; i < PATIENCE_MS / 2; i++) {
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        const struct fsn_bus_clocks c = clocks(rig);
        if (c.state == state && (state != FSN_CLOCKS_SYNCHRONOUS || c.subdevices == 3)) {
            return c;
        }
        pause_ms(2);
    }
    fprintf(stderr, "the clocks are %s: %s\n", fsn_clocks_text(clocks(rig).state),
            clocks(rig).place);
    exit(1);
}

/** Switches a SubDevice off and on, and waits until it is in OP again. No SubDevice leaves OP
 *  because of its clock. */
static void come_back(struct rig *rig, uint32_t n) {
    const uint32_t returns = look(rig, n).returns;
    fsn_segment_power_cycle(rig->segment, n);
    for (int i = 0; look(rig, n).returns == returns; i++) {
        CHECK(i < PATIENCE_MS / 2);
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        for (uint32_t other = 0; other < SUBDEVICES; other++) {
            CHECK(look(rig, other).al_code != SYNC_FATAL);
        }
        pause_ms(2);
    }
}

/** Half of all frames of the next cycles come near their place before SYNC0. */
static void frames_come_in_phase(struct rig *rig) {
    const struct fsn_statistics before = statistics(rig);
    struct fsn_histogram since = {0};
    while (since.count < 300) {
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        pause_ms(2);
        since = statistics(rig).dc_offset;
        since.count -= before.dc_offset.count;
    }
    for (uint32_t i = 0; i < FSN_BUCKETS; i++) {
        since.bucket[i] -= before.dc_offset.bucket[i];
    }
    CHECK(fsn_histogram_percentile(&since, 500000) < CYCLE / 8);
}

/** The plan alone switches clocks on; all stay in OP, in either direction, and so does who returns.
 */
static void clocks_are_set_and_followed(void) {
    for (int host = 0; host < 2; host++) {
        struct rig *rig = set_up_with_sync();
        rig->live.dc_host = host;
        rig->live.dc_shift_ns = host ? 300000 : 0;
        rig->live.dc_window_ns = host ? 100000 : 0; /* a microsecond then */
        bring_up_from(rig);
        const struct fsn_bus_clocks c = clocks_become(rig, FSN_CLOCKS_SYNCHRONOUS);
        CHECK(c.worst_ns <= c.window_ns && c.outside == 0 && c.host == host);
        CHECK(c.window_ns == (host ? 100000 : 1000));
        CHECK(strcmp(c.reference, "s0") == 0 && c.place[0] == '\0');
        CHECK(c.shift_ns == (host ? 300000 : CYCLE / 2) && c.lead_ns <= CYCLE);
        frames_come_in_phase(rig);
        fsn_segment_power_cycle(rig->segment, 2);
        poll_until_all_in_op(rig);
        (void)clocks_become(rig, FSN_CLOCKS_SYNCHRONOUS);
        for (uint32_t n = 0; n < SUBDEVICES; n++) {
            CHECK(look(rig, n).found == FSN_FOUND_RIGHT);
        }
        tear_down(rig);
    }
}

/** How far the pulses of SYNC0 are apart within their cycle, at most. */
static uint64_t pulses_apart(struct rig *rig) {
    uint64_t most = 0;
    for (uint32_t n = 1; n < SUBDEVICES; n++) {
        uint64_t first, pulse;
        CHECK(fsn_segment_next_pulse(rig->segment, 1, &first) == FSN_OK);
        CHECK(fsn_segment_next_pulse(rig->segment, n, &pulse) == FSN_OK);
        const uint64_t apart = (pulse % CYCLE + CYCLE - first % CYCLE) % CYCLE;
        const uint64_t least = apart < CYCLE - apart ? apart : CYCLE - apart;
        most = least > most ? least : most;
    }
    return most;
}

/** A wrong start stays wrong; a clock that has just begun to follow is correct soon. */
static void pulses_come_together(struct rig *rig) {
    for (int i = 0; pulses_apart(rig) > CYCLE / 50; i++) {
        if (i == PATIENCE_MS / 20) {
            fprintf(stderr, "pulses of SYNC0 are %u ns apart\n", (unsigned)pulses_apart(rig));
            exit(1);
        }
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        pause_ms(2);
    }
}

/** Clocks of 32 and 64 bits, as reference and as others, set to times before and after an end of 32
 *  bits: the start of SYNC0 is the same moment for all, also for one that comes back. */
static void clocks_of_both_widths_pulse_together(void) {
    enum { MS = 1000000, RUNS = 6, ENDS = 200 };
    /* So many times 2^32 ns are 0.459 ms after a whole cycle. */
    static const uint64_t end_ns = UINT64_C(946684800) * SECOND + ((uint64_t)ENDS << 32);
    for (uint32_t run = 0; run < RUNS; run++) {
        struct rig *rig = set_up_with_sync();
        wall_ns = end_ns - 100 * MS * (uint64_t)run;
        for (uint32_t n = 0; n < SUBDEVICES; n++) {
            const uint32_t bits = (n + run) % 2 == 0 ? 32 : 64;
            CHECK(fsn_segment_set_clock_bits(rig->segment, n, bits) == FSN_OK);
        }
        bring_up_from(rig);
        (void)clocks_become(rig, FSN_CLOCKS_SYNCHRONOUS);
        pulses_come_together(rig);
        frames_come_in_phase(rig);
        for (uint32_t n = 0; n < SUBDEVICES && run < 2; n++) {
            come_back(rig, n);
            pulses_come_together(rig);
        }
        for (uint32_t n = 0; n < SUBDEVICES; n++) {
            CHECK(look(rig, n).found == FSN_FOUND_RIGHT);
        }
        tear_down(rig);
    }
    wall_ns = 0;
}

/** The reference is switched off and on, then all are: the time continues, and no other SubDevice
 *  leaves OP because of it. */
static void the_time_survives_its_reference(void) {
    struct rig *rig = bring_up_from(set_up_with_sync());
    (void)clocks_become(rig, FSN_CLOCKS_SYNCHRONOUS);
    struct fsn_statistics before = statistics(rig);
    while (before.dc_time_ns == 0) { /* its first frames were late */
        pause_ms(2);
        before = statistics(rig);
    }
    const uint64_t apart_before = before.dc_time_ns - before.now_ns;
    come_back(rig, 0);
    (void)clocks_become(rig, FSN_CLOCKS_SYNCHRONOUS);
    frames_come_in_phase(rig);
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        fsn_segment_set_present(rig->segment, n, false);
    }
    /* How often clocks were apart before is not of interest: a machine that stands still for more
     * than the window is enough. */
    const struct fsn_bus_clocks c = clocks_become(rig, FSN_CLOCKS_LOST);
    CHECK(c.subdevices == 0 && c.outside == 0 && c.worst_ns == 0);
    CHECK(strncmp(c.place, "the time of s", 13) == 0);
    poll_until(rig, 0, 0);
    for (uint32_t n = 0; n < SUBDEVICES; n++) {
        fsn_segment_set_present(rig->segment, n, true);
    }
    poll_until_all_in_op(rig);
    (void)clocks_become(rig, FSN_CLOCKS_SYNCHRONOUS);
    frames_come_in_phase(rig);
    const int64_t moved =
        (int64_t)(statistics(rig).dc_time_ns - statistics(rig).now_ns - apart_before);
    CHECK(moved < 100 * CYCLE && moved > -100 * CYCLE); /* their own clocks begin elsewhere */
    tear_down(rig);
}

/** All come back while frames are lost: no SubDevice is in OP with a time that differs. */
static void no_lost_frame_leaves_a_clock_behind(void) {
    enum { TURNS = 6, OF_FRAMES = 17 };
    struct rig *rig = bring_up_from(set_up_with_sync());
    for (int turn = 0; turn < TURNS; turn++) {
        for (uint32_t n = 0; n < SUBDEVICES; n++) {
            fsn_segment_power_cycle(rig->segment, n);
        }
        fsn_segment_lose_every(rig->segment, OF_FRAMES);
        uint32_t in_op = 0;
        for (int polls = 0; in_op < SUBDEVICES; polls++) {
            CHECK(polls < PATIENCE_MS);
            fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
            in_op = 0;
            for (uint32_t n = 0; n < SUBDEVICES; n++) {
                CHECK(look(rig, n).al_code != SYNC_FATAL);
                in_op += look(rig, n).al_status == FSN_AL_OP;
            }
            pause_ms(1);
        }
        fsn_segment_lose_every(rig->segment, 0);
        (void)clocks_become(rig, FSN_CLOCKS_SYNCHRONOUS);
    }
    tear_down(rig);
}

/** A clock that goes its own way is named; when its device is back it is in time again. */
static void who_leaves_the_window_is_named(void) {
    struct rig *rig = bring_up_from(set_up_with_sync());
    const struct fsn_segment_clock other = {.offset_ns = 12345678, .forward_ns = 300};
    const uint32_t leaves = clocks_become(rig, FSN_CLOCKS_SYNCHRONOUS).leaves;
    CHECK(fsn_segment_set_clock(rig->segment, 3, &other) == FSN_OK);
    const struct fsn_bus_clocks c = clocks_become(rig, FSN_CLOCKS_APART);
    CHECK(c.leaves == leaves + 1 && c.outside >= 1 && c.worst_ns > 1000);
    CHECK(strncmp(c.place, "s3 is ", 6) == 0 && strstr(c.place, " ns from s0") != NULL);
    fsn_segment_power_cycle(rig->segment, 3);
    poll_until(rig, 3, FSN_AL_OP);
    CHECK(clocks_become(rig, FSN_CLOCKS_SYNCHRONOUS).leaves >= c.leaves);
    tear_down(rig);
}

/** Sends a datagram of 8 bytes to a SubDevice of the segment, next to the cycle. */
static void pass(struct rig *rig, uint8_t command, uint32_t n, uint16_t address, uint64_t *value) {
    uint8_t frame[60] = {[12] = 0x88, [13] = 0xA4, [14] = 20, [15] = 0x10, [16] = command};
    const uint16_t station = (uint16_t)(0x1001 + n);
    memcpy(frame + 18, &station, 2);
    memcpy(frame + 20, &address, 2);
    frame[22] = sizeof *value;
    memcpy(frame + 26, value, sizeof *value);
    CHECK(fsn_segment_frame(rig->segment, frame, sizeof frame, now_ns()) == sizeof frame);
    CHECK(frame[34] == 1);
    memcpy(value, frame + 26, sizeof *value);
}

/** Moves the clock of s3 until a check has met it outside of the window. */
static void push_out(struct rig *rig) {
    enum { FPRD = 4, FPWR = 5, OFFSET = 0x0920 };
    for (int i = 0; clocks(rig).outside == 0; i++) {
        uint64_t offset = 0;
        pass(rig, FPRD, 3, OFFSET, &offset);
        offset += 10000;
        pass(rig, FPWR, 3, OFFSET, &offset);
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        CHECK(i < PATIENCE_MS / 2);
        pause_ms(2);
    }
}

/** A clock that leaves the window repeatedly, as after the gap of a ring, is apart all the time;
 *  with nothing to compare it is unknown. */
static void clocks_that_come_and_go_are_apart(void) {
    enum { TIMES = 5 };
    struct rig *rig = bring_up_from(set_up_with_sync());
    const uint32_t leaves = clocks_become(rig, FSN_CLOCKS_SYNCHRONOUS).leaves;
    for (int times = 0; times < TIMES; times++) {
        push_out(rig);
        for (int i = 0; clocks(rig).outside > 0 || i < 50; i++) {
            fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
            CHECK(clocks(rig).state == FSN_CLOCKS_APART && i < PATIENCE_MS / 2);
            CHECK(strncmp(clocks(rig).place, "s3 is ", 6) == 0);
            pause_ms(2);
        }
    }
    const struct fsn_bus_clocks c = clocks_become(rig, FSN_CLOCKS_SYNCHRONOUS);
    CHECK(c.leaves == leaves + 1 && c.place[0] == '\0');
    push_out(rig);
    CHECK(strncmp(clocks(rig).place, "s3 is ", 6) == 0);
    fsn_segment_set_present(rig->segment, 1, false); /* and all after it */
    CHECK(clocks_become(rig, FSN_CLOCKS_UNKNOWN).place[0] == '\0');
    tear_down(rig);
}

/** Without a clock SYNC0 is impossible; a defective clock follows no other. Both are refused by
 *  name, before anything is in OP. */
static void clocks_that_cannot_be_set_are_refused(void) {
    const struct fsn_segment_clock none = {.absent = true, .forward_ns = 300};
    const struct fsn_segment_clock deaf = {.deaf = true, .drift_ppb = 900000, .forward_ns = 300};
    struct rig *rig = set_up_with_sync();
    CHECK(fsn_segment_set_clock(rig->segment, 2, &none) == FSN_OK);
    fsn_status status = open_bus(rig);
    for (int tries = 0; status != FSN_E_BUS_CLOCK; tries++) { /* frames were late */
        CHECK(status != FSN_OK && tries < TRIES);
        close_bus(rig);
        status = open_bus(rig);
    }
    CHECK(rig->fault.section == 1 && rig->fault.copy_index == 2);
    CHECK(strstr(rig->fault.detail, "no distributed clock") != NULL);
    close_bus(rig);
    CHECK(fsn_segment_set_clock(rig->segment, 2, &deaf) == FSN_OK);
    do {
        status = open_bus(rig);
    } while (status != FSN_E_BUS_CLOCK && status != FSN_OK);
    CHECK(status == FSN_E_BUS_CLOCK && rig->fault.copy_index == 2);
    CHECK(strstr(rig->fault.detail, " ns from the reference clock (s0)") != NULL);
    tear_down(rig);
}

/** The same for a returning one: it stays out of OP, by name, and the others continue. */
static void a_clock_that_follows_nobody_stays_out(void) {
    const struct fsn_segment_clock deaf = {.deaf = true, .drift_ppb = 900000, .forward_ns = 300};
    struct rig *rig = bring_up_from(set_up_with_sync());
    CHECK(fsn_segment_set_clock(rig->segment, 3, &deaf) == FSN_OK);
    fsn_segment_power_cycle(rig->segment, 3);
    for (int i = 0; look(rig, 3).found != FSN_FOUND_CLOCK; i++) {
        CHECK(i < PATIENCE_MS / 2);
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        pause_ms(2);
    }
    CHECK(strstr(look(rig, 3).detail, "does not follow the reference clock (s0)") != NULL);
    CHECK(look(rig, 3).al_status != FSN_AL_OP && look(rig, 2).al_status == FSN_AL_OP);
    tear_down(rig);
}

/** While no frame brings the time a difference stays 0, whatever the clock shows: nothing has
 * settled then. */
static void without_the_time_no_clock_has_settled(void) {
    struct rig *rig = set_up_with_sync();
    const uint64_t end = now_ns() + OPEN_PATIENCE_MS * UINT64_C(1000000);
    while (open_bus(rig) != FSN_OK) {
        CHECK(now_ns() < end);
        close_bus(rig);
    }
    poll_until(rig, 3, FSN_AL_SAFEOP); /* the cycle is not started */
    fsn_segment_power_cycle(rig->segment, 3);
    for (int i = 0; look(rig, 3).found != FSN_FOUND_CLOCK; i++) {
        CHECK(i < PATIENCE_MS / 2);
        fsn_core_poll(rig->core, FSN_AL_OP, now_ns());
        pause_ms(2);
    }
    CHECK(look(rig, 3).al_status == FSN_AL_PREOP);
    const struct fsn_thread_options thread = {.cycle_ns = CYCLE, .follow_dc = true};
    CHECK(fsn_core_start(rig->core, &thread, NULL) == FSN_OK);
    poll_until_all_in_op(rig);
    tear_down(rig);
}

/** If no SubDevice starts SYNC0, clocks are off unless they are requested. */
static void without_sync0_clocks_are_off(void) {
    struct rig *rig = set_up();
    rig->live.dc_every = 0;
    bring_up_from(rig);
    struct fsn_bus_clocks c;
    CHECK(fsn_core_clocks(rig->core, &c) == FSN_E_STATE);
    CHECK(fsn_core_clocks(NULL, &c) == FSN_E_ARG && fsn_core_clocks(rig->core, NULL) == FSN_E_ARG);
    CHECK(statistics(rig).dc_time_ns == 0);
    tear_down(rig);
}

int main(void) {
    if (!make_network()) {
        return SKIPPED;
    }
    clocks_are_set_and_followed();
    clocks_of_both_widths_pulse_together();
    the_time_survives_its_reference();
    no_lost_frame_leaves_a_clock_behind();
    who_leaves_the_window_is_named();
    clocks_that_come_and_go_are_apart();
    clocks_that_cannot_be_set_are_refused();
    a_clock_that_follows_nobody_stays_out();
    without_the_time_no_clock_has_settled();
    without_sync0_clocks_are_off();
    return 0;
}
