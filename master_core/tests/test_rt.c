/** The cyclic thread on a clock of the test's own: wake-ups, counters, records. This program's
 *  clock and sleep replace those of libc, so every time is known to the nanosecond and nothing
 *  depends on the machine. */
#define _GNU_SOURCE

#include <errno.h>
#include <string.h>
#include <time.h>

#include "builder.h"
#include "heap.h"
#include "rt/number.h"
#include "rt/rt.h"
#include "rt/words.h"

enum {
    MOST = 700,
    DATAGRAMS = 2,
    SMS = 3,
    IMAGE = 8,
    STATISTICS_WORDS = (sizeof(struct fsn_statistics) + 7) / 8,
    RECORD_WORDS = 1 + sizeof(struct fsn_cycle) / 8 + DATAGRAMS * sizeof(struct fsn_wkc) / 8 + 1,
    SLOTS = 4,
    TICK_NS = 7, /**< between two readings of the clock */
};

#define START_NS UINT64_C(1500000000)
#define CYCLE_NS UINT64_C(400000000)

/* -- the clock ------------------------------------------------------------------------------ */

static struct {
    uint64_t now_ns, tick_ns;
    uint64_t late_ns[MOST]; /**< how late each sleep ends */
    uint64_t request_ns[MOST];
    uint32_t sleeps, interrupts;
} wall;

int clock_gettime(clockid_t clock, struct timespec *now) {
    CHECK(clock == CLOCK_MONOTONIC);
    now->tv_sec = (time_t)(wall.now_ns / 1000000000u);
    now->tv_nsec = (long)(wall.now_ns % 1000000000u);
    wall.now_ns += wall.tick_ns;
    return 0;
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *at, struct timespec *left) {
    CHECK(clock == CLOCK_MONOTONIC && flags == TIMER_ABSTIME && left == NULL);
    CHECK(at->tv_nsec >= 0 && at->tv_nsec < 1000000000 && wall.sleeps < MOST);
    wall.request_ns[wall.sleeps] = (uint64_t)at->tv_sec * 1000000000u + (uint64_t)at->tv_nsec;
    if (wall.interrupts > 0) {
        wall.interrupts--;
        return EINTR; /* a signal: the rest of the time is still to be slept */
    }
    if (wall.request_ns[wall.sleeps] > wall.now_ns) {
        wall.now_ns = wall.request_ns[wall.sleeps];
    }
    wall.now_ns += wall.late_ns[wall.sleeps++];
    return 0;
}

/* -- the bus -------------------------------------------------------------------------------- */

static struct {
    struct fsn_rt rt;
    uint8_t image[IMAGE];
    struct fsn_wkc wkc[DATAGRAMS];
    uint8_t sm_stale[SMS];
    _Atomic uint64_t stale[SMS];
    struct fsn_rt_set sets[3];
    struct fsn_rt_shown shown;
    _Atomic uint64_t pictures[FSN_RT_PICTURES][STATISTICS_WORDS + 1];
    _Atomic uint64_t slots[SLOTS * RECORD_WORDS];
    struct fsn_bus_input script[MOST]; /**< input, cycle by cycle */
    struct fsn_wkc script_wkc[MOST][DATAGRAMS];
    uint8_t script_stale[MOST][SMS];
    uint64_t sent_ns;       /**< when the last frames went out */
    uint64_t seen;          /**< cycles that were counted and observed by then */
    uint32_t shown_to_all;  /**< snapshots by then */
    const int32_t *far_ppb; /**< the script is a reference clock with this rate error */
    uint32_t cycles, stop_after, sent;
} on;

static void receive(void *bus, struct fsn_bus_input *input) {
    static const struct fsn_wkc no_wkc[DATAGRAMS];
    static const uint8_t no_stale[SMS];
    CHECK(bus == &on && on.cycles < MOST && on.sent == on.cycles);
    /* Nothing is left of the cycle before. */
    CHECK(memcmp(input->wkc, no_wkc, sizeof no_wkc) == 0);
    CHECK(memcmp(input->sm_stale, no_stale, sizeof no_stale) == 0);
    CHECK(input->counts.lost_frames == 0 && input->counts.old_replies == 0 &&
          input->counts.foreign_frames == 0);
    CHECK(input->counts.unsent_frames == 0 && input->send_errno == 0);
    CHECK(input->round_trip_ns == 0 && input->dc_time_ns == 0);
    struct fsn_wkc *wkc = input->wkc;
    uint8_t *stale = input->sm_stale;
    *input = on.script[on.cycles];
    input->wkc = wkc;
    input->sm_stale = stale;
    if (on.far_ppb != NULL && on.sent > 0) {
        input->dc_time_ns = on.sent_ns + on.sent_ns / 1000 * (uint64_t)*on.far_ppb / 1000000;
    }
    memcpy(wkc, on.script_wkc[on.cycles], sizeof no_wkc);
    memcpy(stale, on.script_stale[on.cycles], sizeof no_stale);
    on.cycles++;
    if (on.cycles == on.stop_after) {
        atomic_store(&on.rt.stop, true);
    }
}

static void send(void *bus) {
    CHECK(bus == &on);
    on.sent++;
    on.sent_ns = wall.now_ns;
    on.seen = on.rt.statistics.cycles;
    on.shown_to_all = on.shown.whole;
}

static const struct fsn_bus_ops ops = {.name = "script", .receive = receive, .send = send};

static void set_up(uint32_t cycles) {
    memset(&on, 0, sizeof on);
    memset(&wall, 0, sizeof wall);
    wall.now_ns = START_NS;
    on.stop_after = cycles;
    on.rt.ops = &ops;
    on.rt.bus = &on;
    on.rt.image = on.image;
    on.rt.image_bytes = IMAGE;
    on.rt.input.wkc = on.wkc;
    on.rt.input.sm_stale = on.sm_stale;
    on.rt.stale = on.stale;
    on.rt.datagram_count = DATAGRAMS;
    on.rt.sm_count = SMS;
    on.rt.sets.triple.between = 1;
    on.rt.sets.triple.reader = 2;
    on.rt.snapshot.shown = &on.shown;
    on.rt.snapshot.words[0] = on.pictures[0];
    on.rt.snapshot.words[1] = on.pictures[1];
    on.rt.cycle_ns = CYCLE_NS;
}

static bool counted(const struct fsn_histogram *times, uint64_t count, uint64_t min_ns,
                    uint64_t max_ns, uint64_t sum_ns) {
    uint64_t in_buckets = 0;
    for (uint32_t i = 0; i < FSN_BUCKETS; i++) {
        in_buckets += times->bucket[i];
    }
    return times->count == count && in_buckets == count && times->min_ns == min_ns &&
           times->max_ns == max_ns && times->sum_ns == sum_ns;
}

/* -- when it wakes up ----------------------------------------------------------------------- */

/** One cycle time after the other, across whole seconds; a signal does not shorten a sleep. */
static void wakes_once_per_cycle(void) {
    set_up(5);
    wall.interrupts = 2;
    static const uint64_t late[] = {0, 1000, 0, 5000, 200};
    memcpy(wall.late_ns, late, sizeof late);
    fsn_rt_loop(&on.rt);
    const struct fsn_statistics *s = &on.rt.statistics;
    CHECK(wall.sleeps == 5 && s->cycles == 5 && on.sent == 5 && wall.interrupts == 0);
    for (uint32_t i = 0; i < 5; i++) {
        CHECK(wall.request_ns[i] == START_NS + (i + 1) * CYCLE_NS);
    }
    CHECK(counted(&s->latency, 5, 0, 5000, 6200));
    CHECK(counted(&s->period, 4, CYCLE_NS - 4800, CYCLE_NS + 5000, 4 * CYCLE_NS + 200));
    CHECK(s->overruns == 0 && s->now_ns == START_NS + 5 * CYCLE_NS + 200);
    CHECK(on.rt.late_ns == 200 && on.rt.left_out == 0);
    CHECK(s->dc_offset.count == 0 && s->round_trip.count == 0);
}

static char trace[512];

static void keep_marker(int fd, const char *marker) {
    CHECK(fd == 42 && strlen(trace) + strlen(marker) + 2 < sizeof trace);
    strcat(trace, marker);
    strcat(trace, "\n");
}

/** Whole cycles that a wake-up came too late for are left out and counted, not caught up. */
static void what_was_missed_is_left_out(void) {
    set_up(5);
    static const uint64_t late[] = {0, CYCLE_NS - 1, CYCLE_NS, 2 * CYCLE_NS + 5, 0};
    static const uint64_t left_out[] = {0, 0, 1, 2, 0};
    memcpy(wall.late_ns, late, sizeof late);
    on.rt.trace = keep_marker;
    on.rt.trace_fd = 42;
    trace[0] = 0;
    fsn_rt_loop(&on.rt);
    uint64_t planned = START_NS + CYCLE_NS;
    for (uint32_t i = 0; i < 5; i++) {
        CHECK(wall.request_ns[i] == planned);
        planned += (1 + left_out[i]) * CYCLE_NS;
    }
    CHECK(on.rt.statistics.overruns == 3 && on.rt.left_out == 0);
    CHECK(strcmp(trace, "fsn: cycle begins\nfsn: cycle ends\n"
                        "fsn: cycle begins\nfsn: cycle ends\n"
                        "fsn: cycle begins\nfsn: cycle ends\nfsn: overrun\n"
                        "fsn: cycle begins\nfsn: cycle ends\nfsn: overrun\n"
                        "fsn: cycle begins\nfsn: cycle ends\n") == 0);
}

/** Without a cycle time there is nothing to be late for. */
static void a_free_run_never_sleeps(void) {
    set_up(4);
    wall.tick_ns = TICK_NS;
    on.rt.free_run = true;
    on.rt.cycle_ns = 1; /* every cycle would be too late */
    on.rt.trace = keep_marker;
    on.rt.trace_fd = 42;
    on.script[1].dc_time_ns = on.script[2].dc_time_ns = 1000; /* nothing to steer either */
    trace[0] = 0;
    fsn_rt_loop(&on.rt);
    const struct fsn_statistics *s = &on.rt.statistics;
    CHECK(s->dc_offset.count == 0);
    CHECK(wall.sleeps == 0 && s->cycles == 4 && s->latency.count == 0 && s->overruns == 0);
    CHECK(on.rt.late_ns == 0 && on.rt.left_out == 0);
    /* Four readings of the clock per cycle: begin, before and after the copies, end. */
    CHECK(counted(&s->period, 3, 4 * TICK_NS, 4 * TICK_NS, 3 * 4 * TICK_NS));
    CHECK(counted(&s->copy, 4, TICK_NS, TICK_NS, 4 * TICK_NS));
    CHECK(counted(&s->work, 4, 3 * TICK_NS, 3 * TICK_NS, 4 * 3 * TICK_NS));
    CHECK(strstr(trace, "overrun") == NULL);
}

/** Runs the loop with reference clocks that are so far off the wake-up; expects so much off the
 *  next wake-ups, positive when they come earlier. */
static void follows(const int64_t *off_ns, const int64_t *step_ns, uint32_t cycles, bool follow) {
    set_up(cycles);
    on.rt.follow_dc = follow;
    const uint64_t shift = 123456789; /* target time of frames before a multiple of the cycle */
    on.rt.dc_shift_ns = shift;
    uint64_t planned = START_NS + CYCLE_NS;
    uint64_t expected[MOST];
    for (uint32_t i = 0; i < cycles; i++) {
        expected[i] = planned;
        on.script[i].dc_time_ns = 100 * CYCLE_NS - shift + (uint64_t)off_ns[i];
        planned += CYCLE_NS - (uint64_t)(follow ? step_ns[i] : 0);
    }
    fsn_rt_loop(&on.rt);
    uint64_t sum = 0;
    uint64_t max = 0;
    for (uint32_t i = 0; i < cycles; i++) {
        CHECK(wall.request_ns[i] == expected[i]);
        /* Half a cycle at most to either side. */
        int64_t apart = off_ns[i] % (int64_t)CYCLE_NS;
        apart -= apart > (int64_t)CYCLE_NS / 2 ? (int64_t)CYCLE_NS : 0;
        apart += apart < -(int64_t)CYCLE_NS / 2 ? (int64_t)CYCLE_NS : 0;
        const uint64_t size = (uint64_t)(apart < 0 ? -apart : apart);
        sum += size;
        max = size > max ? size : max;
    }
    CHECK(counted(&on.rt.statistics.dc_offset, cycles, 0, max, sum));
    CHECK(on.rt.statistics.dc_time_ns == on.script[cycles - 1].dc_time_ns);
}

/** A sixteenth of the distance, and a 1024th of what they add up to, each counted as a thousandth
 * of a cycle at most; at most a hundredth of a cycle, to the nearer side. */
static void steers_after_the_reference_clock(void) {
    enum { HALF = CYCLE_NS / 2, HUNDREDTH = CYCLE_NS / 100, EDGE = 16 * HUNDREDTH };
    static const int64_t off[] = {0,          1600, -1600,    EDGE,  EDGE + 16, -EDGE,
                                  -EDGE - 16, HALF, HALF + 1, -HALF, -HALF - 1, -15};
    static const int64_t step[] = {
        0,          101,       -100,       HUNDREDTH, HUNDREDTH, -HUNDREDTH + 400000 / 1024,
        -HUNDREDTH, HUNDREDTH, -HUNDREDTH, HUNDREDTH, HUNDREDTH, 799985 / 1024};
    follows(off, step, 12, true);
    follows(off, step, 12, false);
    /* A reading that wraps around, and whole cycles apart: the same place in the cycle. */
    static const int64_t far[] = {0, 3 * (int64_t)CYCLE_NS + 1600, -5 * (int64_t)CYCLE_NS - 1600};
    follows(far, step, 3, true);
}

/** Without a reading the wake-ups stay unchanged, and the last reading is still shown. */
static void a_cycle_without_reading_steers_nothing(void) {
    set_up(3);
    on.rt.follow_dc = true;
    on.script[0].dc_time_ns = 2 * CYCLE_NS;
    fsn_rt_loop(&on.rt);
    CHECK(on.rt.statistics.dc_offset.count == 1);
    CHECK(on.rt.statistics.dc_time_ns == 2 * CYCLE_NS);
    CHECK(wall.request_ns[2] == START_NS + 3 * CYCLE_NS);
}

/** A frame that left late because the wake-up was late gives no information about the clocks. */
static void a_late_wake_up_is_no_distance(void) {
    set_up(3);
    on.rt.follow_dc = true;
    wall.late_ns[1] = 5000;
    on.script[2].dc_time_ns = 9 * CYCLE_NS + 5000;
    fsn_rt_loop(&on.rt);
    CHECK(counted(&on.rt.statistics.dc_offset, 1, 0, 0, 0));
}

/** A reference clock that runs 100 ppm too fast, from the worst phase, with wake-ups that are late
 *  now and then: soon frames come where they shall. */
static void locks_to_a_clock_that_drifts(void) {
    static const int32_t ppb = 100000;
    enum { SETTLED = 500, SHIFT = 290000000 };
    set_up(MOST);
    on.far_ppb = &ppb;
    on.rt.follow_dc = true;
    on.rt.dc_shift_ns = SHIFT;
    for (uint32_t i = 0; i < MOST; i += 7) {
        wall.late_ns[i] = 300000;
    }
    on.stop_after = SETTLED;
    fsn_rt_loop(&on.rt);
    CHECK(on.rt.statistics.dc_offset.max_ns > CYCLE_NS / 4);
    on.rt.statistics.dc_offset = (struct fsn_histogram){0};
    on.rt.goes_on = true;
    atomic_store(&on.rt.stop, false);
    on.stop_after = MOST;
    fsn_rt_loop(&on.rt);
    CHECK(on.rt.statistics.dc_offset.count > 150);
    CHECK(on.rt.statistics.dc_offset.max_ns < CYCLE_NS / 1000);
}

/** If the bus is set to our clock, only the first wake-up has to be placed. */
static void the_first_wake_up_is_placed_before_sync0(void) {
    for (uint64_t base = 1; base < CYCLE_NS; base += CYCLE_NS / 5) {
        set_up(2);
        on.rt.dc_base_ns = base;
        on.rt.dc_shift_ns = 1000;
        on.script[1].dc_time_ns = 12345;
        fsn_rt_loop(&on.rt);
        CHECK((wall.request_ns[0] + base + 1000) % CYCLE_NS == 0);
        CHECK(wall.request_ns[0] >= START_NS + CYCLE_NS / 2);
        CHECK(wall.request_ns[0] <= START_NS + 3 * CYCLE_NS / 2);
        CHECK(wall.request_ns[1] == wall.request_ns[0] + CYCLE_NS);
    }
}

/* -- counters ------------------------------------------------------------------------------- */

static void counts_what_comes_in(void) {
    set_up(4);
    on.script[0] = (struct fsn_bus_input){.counts.lost_frames = 1,
                                          .counts.old_replies = 2,
                                          .counts.foreign_frames = 3,
                                          .counts.unsent_frames = 4,
                                          .send_errno = EIO,
                                          .round_trip_ns = 55};
    on.script[2] = (struct fsn_bus_input){.counts.lost_frames = 10,
                                          .counts.old_replies = 20,
                                          .counts.foreign_frames = 30,
                                          .counts.unsent_frames = 40,
                                          .round_trip_ns = 45};
    static const struct fsn_wkc wkc[4][DATAGRAMS] = {
        {{3, 3}, {4, 4}}, {{3, 2}, {4, 3}}, {{3, 4}, {4, 3}}, {{3, 3}, {4, 1}}};
    memcpy(on.script_wkc, wkc, sizeof wkc);
    static const uint8_t stale[4][SMS] = {{0, 0, 0}, {1, 0, 1}, {1, 0, 0}, {0, 0, 0}};
    memcpy(on.script_stale, stale, sizeof stale);
    on.rt.bytes_per_cycle = 12;
    fsn_rt_loop(&on.rt);
    const struct fsn_statistics *s = &on.rt.statistics;
    /* Two datagrams with opposite errors of the same size are also one bad cycle. */
    CHECK(s->wkc_errors == 3 && s->expected_wkc == 7 && s->actual_wkc == 4);
    CHECK(s->counts.lost_frames == 11 && s->counts.old_replies == 22 &&
          s->counts.foreign_frames == 33);
    CHECK(s->counts.unsent_frames == 44 && s->send_errno == 0); /* of the last cycle */
    CHECK(counted(&s->round_trip, 2, 45, 55, 100));
    CHECK(on.stale[0] == 2 && on.stale[1] == 0 && on.stale[2] == 1);
    CHECK(s->bytes_copied == 48 && s->cycles == 4);
    set_up(1);
    on.script[0].send_errno = ENOBUFS;
    fsn_rt_loop(&on.rt);
    CHECK(on.rt.statistics.send_errno == ENOBUFS);
}

/** In virtual time no clock is read. */
static void virtual_time_reads_no_clock(void) {
    set_up(2);
    wall.tick_ns = TICK_NS;
    on.script[0].round_trip_ns = 5;
    fsn_rt_cycle(&on.rt, 777, false);
    CHECK(wall.now_ns == START_NS && on.rt.statistics.now_ns == 777);
    CHECK(on.rt.statistics.copy.count == 0 && on.rt.statistics.work.count == 0);
    CHECK(on.rt.statistics.round_trip.count == 0);
}

/** Bucket by bucket, as in fsn/core.h. */
static void times_fall_into_their_buckets(void) {
    struct fsn_histogram *times = &on.rt.statistics.period;
    set_up(1);
    for (uint32_t bucket = 0; bucket < FSN_BUCKETS; bucket++) {
        const uint32_t shift = bucket < 64 ? 0 : bucket / 64 - 1;
        const uint64_t from = bucket < 64 ? bucket : (uint64_t)(64 + bucket % 64) << shift;
        const uint64_t last =
            bucket + 1 < FSN_BUCKETS ? from + (UINT64_C(1) << shift) - 1 : UINT64_MAX;
        *times = (struct fsn_histogram){0};
        fsn_rt_count(&on.rt, times, from);
        fsn_rt_count(&on.rt, times, last);
        CHECK(times->bucket[bucket] == 2 && times->count == 2 && times->min_ns == from);
        CHECK(times->max_ns == last && times->sum_ns == from + last);
    }
    *times = (struct fsn_histogram){0};
    static const uint64_t some[] = {9, 3, 12, 3, 0};
    for (uint32_t i = 0; i < 5; i++) {
        fsn_rt_count(&on.rt, times, some[i]);
    }
    CHECK(counted(times, 5, 0, 12, 27) && times->bucket[3] == 2 && times->bucket[0] == 1);
    fsn_rt_count(&on.rt, times, UINT64_C(1) << 33);
    fsn_rt_count(&on.rt, times, UINT64_C(1) << 34);
    fsn_rt_count(&on.rt, times, UINT64_C(1) << 63);
    CHECK(times->bucket[FSN_BUCKETS - 1] == 3);
}

/* -- records -------------------------------------------------------------------------------- */

/** A slot is whole if its sequence matches; times that do not fit saturate. */
static void a_record_holds_the_cycle(void) {
    set_up(3);
    wall.tick_ns = 1;
    on.rt.recorder.words = on.slots;
    on.rt.recorder.slots = SLOTS;
    on.rt.recorder.slot_words = RECORD_WORDS;
    const uint64_t long_ns = (UINT64_C(1) << 33) + 5;
    wall.late_ns[1] = long_ns;
    on.rt.cycle_ns = 1; /* left out cycles do not fit either */
    on.script[1] = (struct fsn_bus_input){.counts.lost_frames = 1,
                                          .counts.old_replies = 2,
                                          .counts.foreign_frames = 3,
                                          .round_trip_ns = long_ns,
                                          .dc_time_ns = 99};
    const struct fsn_wkc wkc[DATAGRAMS] = {{3, 2}, {4, 4}};
    memcpy(on.script_wkc[1], wkc, sizeof wkc);
    memset(on.image, 0x5A, IMAGE);
    fsn_rt_loop(&on.rt);
    CHECK(atomic_load(&on.rt.recorder.last) == 3);
    _Atomic uint64_t *slot = on.slots + 2 * RECORD_WORDS; /* of cycle 2 */
    struct fsn_cycle record;
    struct fsn_wkc kept[DATAGRAMS];
    uint8_t image[IMAGE];
    CHECK(slot[0] == 4);
    const _Atomic uint64_t *words = fsn_words_take(slot + 1, &record, sizeof record);
    words = fsn_words_take(words, kept, sizeof kept);
    CHECK(fsn_words_take(words, image, sizeof image) == slot + RECORD_WORDS);
    CHECK(record.cycle == 2 && record.dc_time_ns == 99 && record.late_ns == UINT32_MAX);
    CHECK(record.work_ns == 3 && record.round_trip_ns == UINT32_MAX);
    CHECK(record.counts.lost_frames == 1 && record.counts.old_replies == 2 &&
          record.counts.foreign_frames == 3);
    CHECK(record.expected_wkc == 7 && record.actual_wkc == 6 && record.overruns == UINT32_MAX);
    CHECK(memcmp(kept, wkc, sizeof wkc) == 0 && memcmp(image, on.image, IMAGE) == 0);
    slot += RECORD_WORDS;
    CHECK(slot[0] == 6 && on.slots[0] == 0);
    (void)fsn_words_take(slot + 1, &record, sizeof record);
    CHECK(record.cycle == 3 && record.now_ns == on.rt.statistics.now_ns && record.late_ns < 100);
    CHECK(record.overruns == record.late_ns && record.round_trip_ns == 0);
}

/** The longest time that can be reported is reported exactly. */
static void a_record_tells_times_exactly(void) {
    set_up(1);
    on.rt.recorder.words = on.slots;
    on.rt.recorder.slots = SLOTS;
    on.rt.recorder.slot_words = RECORD_WORDS;
    on.script[0].round_trip_ns = UINT32_MAX;
    on.rt.late_ns = UINT32_MAX - 1;
    fsn_rt_cycle(&on.rt, 5, false);
    struct fsn_cycle record;
    (void)fsn_words_take(on.slots + RECORD_WORDS + 1, &record, sizeof record);
    CHECK(record.round_trip_ns == UINT32_MAX && record.late_ns == UINT32_MAX - 1);
    CHECK(record.now_ns == 5 && record.work_ns == 0);
}

/** Two snapshots in turn; the number of the last whole one is written last. */
static void pictures_take_turns(void) {
    set_up(3);
    fsn_rt_loop(&on.rt);
    CHECK(on.shown.begun == 3 && on.shown.whole == 3);
    struct fsn_statistics shown;
    const _Atomic uint64_t *words = fsn_words_take(on.pictures[1], &shown, sizeof shown);
    CHECK(shown.cycles == 3 && words == on.pictures[1] + STATISTICS_WORDS);
    (void)fsn_words_take(on.pictures[0], &shown, sizeof shown);
    CHECK(shown.cycles == 2);
}

static const struct fsn_statistics *shown(void) {
    static struct fsn_statistics found;
    (void)fsn_words_take(on.pictures[on.shown.whole % FSN_RT_PICTURES], &found, sizeof found);
    return &found;
}

static bool shown_is_all(void) {
    return memcmp(shown(), &on.rt.statistics, sizeof on.rt.statistics) == 0;
}

/** A snapshot shows every time, also those of the cycle before, however many were counted. */
static void each_picture_shows_all_times(void) {
    set_up(MOST);
    struct fsn_statistics *s = &on.rt.statistics;
    for (uint32_t cycle = 0; cycle < 100; cycle++) {
        on.script[cycle].round_trip_ns = cycle % 3 * 1000;
        wall.tick_ns = 1 + (uint64_t)cycle * cycle * cycle;
        on.rt.late_ns = UINT64_C(1) << cycle % 40;
        on.rt.period_ns = CYCLE_NS + cycle * 10000;
        for (uint32_t more = cycle / 50 * cycle; more > 0; more--) {
            fsn_rt_count(&on.rt, &s->dc_offset, more);
        }
        fsn_rt_cycle(&on.rt, wall.now_ns, true);
        CHECK(shown_is_all());
    }
    /* If published before its frames are sent, a cycle counts its times later: the next one shows
     * them.
     */
    atomic_store(&on.rt.show_first, true);
    fsn_rt_cycle(&on.rt, wall.now_ns, true);
    CHECK(!shown_is_all());
    atomic_store(&on.rt.show_first, false);
    fsn_rt_cycle(&on.rt, wall.now_ns, false);
    CHECK(shown_is_all());
    fsn_rt_cycle(&on.rt, wall.now_ns, false);
    CHECK(shown_is_all());
}

/** Frames do not wait for readers, except where a successor may follow. */
static void frames_go_out_first(void) {
    set_up(3);
    fsn_rt_cycle(&on.rt, 1, false);
    CHECK(on.seen == 0 && on.shown_to_all == 0);
    CHECK(on.rt.statistics.cycles == 1 && on.shown.whole == 1);
    atomic_store(&on.rt.show_first, true);
    fsn_rt_cycle(&on.rt, 2, false);
    CHECK(on.seen == 2 && on.shown_to_all == 2 && shown()->cycles == 2);
    CHECK(on.rt.statistics.cycles == 2 && on.shown.whole == 2);
    atomic_store(&on.rt.show_first, false);
    fsn_rt_cycle(&on.rt, 3, false);
    CHECK(on.seen == 2 && on.shown_to_all == 2 && shown()->cycles == 3);
}

/** A client sleeps until a cycle is published to it, not only sent; in virtual time that is
 *  unknown.
 */
static void clients_learn_when_a_cycle_is_shown(void) {
    enum { WORDS = sizeof(struct fsn_shared_cycle) / 8 + 1 };
    static struct fsn_shared_inputs inputs;
    static _Atomic uint64_t pictures[FSN_SHARED_PICTURES * WORDS];
    struct fsn_shared_cycle cycle;
    set_up(3);
    wall.tick_ns = TICK_NS;
    inputs.picture_words = WORDS;
    on.rt.clients.inputs = &inputs;
    on.rt.clients.pictures = pictures;
    on.rt.clients.present = 1;
    for (uint32_t n = 1; n <= 2; n++) {
        fsn_rt_cycle(&on.rt, START_NS, n == 1);
        (void)fsn_words_take(pictures + (size_t)n * WORDS, &cycle, sizeof cycle);
        CHECK(inputs.shown.whole == n && cycle.cycle == n);
        /* The clock is read around the copies, after sending, and for the client. */
        CHECK(cycle.shown_ns == (n == 1 ? 3 * TICK_NS : 0));
    }
}

/* -- origin of a reset ------------------------------------------------------------------------- */

static struct {
    struct fsn_rt_watch watch;
    struct fsn_monitor monitor;
    uint8_t seen[12], image[12];
} one;

static void watch_one(void) {
    set_up(1);
    memset(&one, 0, sizeof one);
    one.watch = (struct fsn_rt_watch){
        .offset = {0, 6}, .size_bytes = {6, 6}, .silent_ns = 1000, .unshown = 0};
    CHECK(fsn_monitor_init(&one.monitor, 6, 6) == FSN_OK);
    on.rt.image = one.image;
    on.rt.watches = &one.watch;
    on.rt.monitors = &one.monitor;
    on.rt.seen = one.seen;
    on.rt.connection_count = 1;
}

static struct fsn_event only_event(void) {
    CHECK(on.rt.ring.head == on.rt.ring.tail + 1);
    const struct fsn_event event = on.rt.ring.slot[on.rt.ring.tail % FSN_RT_EVENTS];
    on.rt.ring.tail++;
    return event;
}

static void a_reset_is_put_down_to_its_end(void) {
    static const struct {
        uint8_t to_sub, code_to_sub, to_main, code_to_main; /**< commands and their codes */
        uint8_t by, code;
    } table[] = {
        {0x2A, 0, 0x2A, 0, 1, 0}, {0x2A, 5, 0x2A, 0, 1, 5}, {0x2A, 5, 0x2A, 6, 1, 5},
        {0x2A, 0, 0x2A, 6, 2, 6}, {0x2A, 0, 0x36, 6, 1, 0}, {0x2A, 7, 0x36, 0, 1, 7},
        {0x36, 5, 0x2A, 6, 2, 6}, {0x36, 5, 0x2A, 0, 2, 0},
    };
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        watch_one();
        const uint8_t image[12] = {table[i].to_sub,  table[i].code_to_sub,  1, 2, 3, 4,
                                   table[i].to_main, table[i].code_to_main, 5, 6, 7, 8};
        memcpy(one.image, image, sizeof image);
        fsn_rt_monitor(&on.rt, 50);
        const struct fsn_event event = only_event();
        CHECK(event.by == table[i].by && event.reset_code == table[i].code);
        CHECK(event.before == FSN_OBSERVED_SILENT && event.after == FSN_OBSERVED_RESET);
        CHECK(event.now_ns == 50 && event.connection == 0);
        CHECK(memcmp(one.image, image, sizeof image) == 0 && one.watch.unshown == FSN_RT_PICTURES);
    }
}

/** Silence counts from the last new frame, also from one at time 0; each change is reported once.
 */
static void silence_begins_after_its_time(void) {
    static const uint64_t begin[] = {0, 5000};
    for (int i = 0; i < 2; i++) {
        watch_one();
        const uint64_t new_ns = begin[i] != 0 ? begin[i] : 1;
        static const uint8_t image[12] = {0x36, 1, 1, 2, 3, 4, 0x36, 2, 5, 6, 7, 8};
        memcpy(one.image, image, sizeof image);
        fsn_rt_monitor(&on.rt, begin[i]);
        struct fsn_event event = only_event();
        CHECK(event.after == FSN_OBSERVED_DATA_PROCESS && event.by == 0 && event.reset_code == 0);
        CHECK(one.watch.new_ns == new_ns);
        one.watch.unshown = 0;
        fsn_rt_monitor(&on.rt, new_ns + 1000);
        CHECK(on.rt.ring.head == on.rt.ring.tail && one.watch.unshown == 0);
        fsn_rt_monitor(&on.rt, new_ns + 1001);
        event = only_event();
        CHECK(event.before == FSN_OBSERVED_DATA_PROCESS && event.after == FSN_OBSERVED_SILENT);
        CHECK(event.by == 0 && event.reset_code == 0 && event.now_ns == new_ns + 1001);
        CHECK(one.watch.new_ns == 0 && one.watch.unshown == FSN_RT_PICTURES);
        fsn_rt_monitor(&on.rt, new_ns + 9000);
        CHECK(on.rt.ring.head == on.rt.ring.tail);
        one.image[1] ^= 0x40; /* one end is enough to be heard again */
        fsn_rt_monitor(&on.rt, new_ns + 9001);
        CHECK(only_event().after == FSN_OBSERVED_DATA_PROCESS);
        one.image[7] ^= 0x40;
        fsn_rt_monitor(&on.rt, new_ns + 9002);
        CHECK(on.rt.ring.head == on.rt.ring.tail && one.watch.new_ns == new_ns + 9002);
    }
}

/** What is known on both sides is compared; each change is one event, a Reset leaves what is known.
 */
static void parameters_are_compared_with_the_plan(void) {
    static const struct fsn_parameters planned = {
        .connection_id = 1, .address = 2, .watchdog_ms = 3, .app_bytes = 4, .app_crc = 5};
    static const struct {
        struct fsn_parameters seen;
        uint32_t known, differs;
        bool event;
    } table[] = {
        {{.known = 15, .connection_id = 1, .address = 2, .watchdog_ms = 3}, 7, 0, false},
        {{.known = 15, .connection_id = 9, .address = 2, .watchdog_ms = 3}, 7, 1, true},
        {{.known = 15, .connection_id = 9, .address = 9, .watchdog_ms = 3}, 7, 3, true},
        {{.known = 0}, 7, 3, false},
        {{.known = 3, .connection_id = 1, .address = 2}, 7, 0, true},
        {{.known = 15, .connection_id = 1, .address = 2, .watchdog_ms = 9}, 3, 0, false},
        {{.known = 15, .connection_id = 1, .address = 2, .watchdog_ms = 9}, 7, 4, true},
        {{.known = 15, .connection_id = 1, .address = 2, .watchdog_ms = 9}, 7, 4, false},
        {{.known = 15, .connection_id = 9, .address = 9, .watchdog_ms = 9}, 0, 4, false},
        {{5, 4, 1, 2, 3, 15}, 15, 0, true},
        {{6, 4, 1, 2, 3, 15}, 15, 8, true},
        {{5, 5, 1, 2, 3, 15}, 15, 8, false},
    };
    watch_one();
    one.image[0] = one.image[6] = FSN_CMD_RESET;
    fsn_rt_monitor(&on.rt, 1);
    CHECK(only_event().differs == 0);
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        one.watch.planned = planned;
        one.watch.planned.known = table[i].known;
        one.monitor.status.parameters = table[i].seen;
        one.image[2]++;
        fsn_rt_monitor(&on.rt, 50 + i);
        CHECK(one.monitor.status.differs == table[i].differs);
        CHECK(on.rt.ring.head == on.rt.ring.tail + table[i].event);
        if (table[i].event) {
            const struct fsn_event event = only_event();
            CHECK(event.differs == table[i].differs && event.now_ns == 50 + i);
            CHECK(event.before == FSN_OBSERVED_RESET && event.after == FSN_OBSERVED_RESET);
            CHECK(memcmp(&event.parameters, &table[i].seen, sizeof event.parameters) == 0);
        }
    }
}

/** The ring goes around: what was read makes room, whatever the numbers of its ends are. */
static void the_ring_goes_around(void) {
    watch_one();
    on.rt.ring.head = on.rt.ring.tail = UINT32_MAX - 100; /* the numbers go around too */
    for (uint32_t i = 0; i < 3 * FSN_RT_EVENTS; i++) {
        const struct fsn_event event = {.now_ns = i};
        fsn_rt_push_event(&on.rt, &event);
        CHECK(only_event().now_ns == i);
    }
    for (uint32_t i = 0; i < FSN_RT_EVENTS + 2; i++) {
        const struct fsn_event event = {.now_ns = i};
        fsn_rt_push_event(&on.rt, &event);
    }
    CHECK(on.rt.statistics.events_lost == 2);
    CHECK(on.rt.ring.slot[on.rt.ring.tail % FSN_RT_EVENTS].now_ns == 0);
}

/** A connection that was silent when it went silent again has nothing to report. */
static void silent_stays_silent(void) {
    watch_one();
    one.image[1] = 1; /* not a frame: its command is 0 */
    fsn_rt_monitor(&on.rt, 10);
    CHECK(one.watch.new_ns == 10);
    fsn_rt_monitor(&on.rt, 2000);
    CHECK(one.watch.new_ns == 0 && on.rt.ring.head == 0);
}

static void numbers_become_bits_to_the_end_of_their_type(void) {
    uint64_t raw = 0;
    CHECK(fsn_bits_of(FSN_KIND_SIGNED, 64, -0x1p63, &raw) && raw == UINT64_C(1) << 63);
    CHECK(fsn_bits_of(FSN_KIND_SIGNED, 60, -0x1p59, &raw) && raw == UINT64_C(1) << 59);
    CHECK(!fsn_bits_of(FSN_KIND_SIGNED, 64, 0x1p63, &raw));
    CHECK(!fsn_bits_of(FSN_KIND_UNSIGNED, 64, 0x1p64, &raw));
    CHECK(fsn_bits_of(FSN_KIND_UNSIGNED, 64, 0x1p52 + 1, &raw) && raw == (UINT64_C(1) << 52) + 1);
    CHECK(fsn_bits_of(FSN_KIND_SIGNED, 16, -2.5, &raw) && raw == 0xFFFD);
    CHECK(fsn_bits_of(FSN_KIND_UNSIGNED, 8, 255.4, &raw) && raw == 255);
    CHECK(!fsn_bits_of(FSN_KIND_UNSIGNED, 8, 255.5, &raw));
    CHECK(!fsn_bits_of(FSN_KIND_REAL, 32, 1e39, &raw));
}

int main(void) {
    const long alive = heap_alive();
    wakes_once_per_cycle();
    what_was_missed_is_left_out();
    a_free_run_never_sleeps();
    steers_after_the_reference_clock();
    a_cycle_without_reading_steers_nothing();
    a_late_wake_up_is_no_distance();
    locks_to_a_clock_that_drifts();
    the_first_wake_up_is_placed_before_sync0();
    counts_what_comes_in();
    virtual_time_reads_no_clock();
    times_fall_into_their_buckets();
    a_record_holds_the_cycle();
    a_record_tells_times_exactly();
    pictures_take_turns();
    each_picture_shows_all_times();
    frames_go_out_first();
    clients_learn_when_a_cycle_is_shown();
    a_reset_is_put_down_to_its_end();
    parameters_are_compared_with_the_plan();
    silence_begins_after_its_time();
    silent_stays_silent();
    the_ring_goes_around();
    numbers_become_bits_to_the_end_of_their_type();
    CHECK(heap_alive() == alive);
    return 0;
}
