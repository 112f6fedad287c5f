/** Cycles over a veth pair against the emulated segment: our core with plan, copies and monitor,
 * SOEM's own send and receive without any of it, and the system calls alone, in turn and on the
 * same CPU.
 *
 *  bench_live [SECONDS [CPU [SECONDS_WITH_PERIOD]]]: needs root; makes a network namespace of its
 * own. A third of the seconds of each part are SOEM's. The emulator has the higher priority, so
 * that answers are there when send() returns: what is left is our own time.
 *
 * Busy is the time from the wake-up until a cycle has read its replies and sent its frames: SOEM's
 * does nothing else, the core observes and shows after that, which the free run counts. */
#define _GNU_SOURCE

#include <errno.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "bare.h"
#include "builder.h"
#include "fsn/fsn.h"
#include "fsn/live.h"
#include "fsn/segment.h"

enum { DEVICES = 10, PRIORITY = 60, FRAME = 6, HALF = 5, MOST_PAIRS = 42 };

static uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static void sleep_until(uint64_t at_ns) {
    const struct timespec at = {.tv_sec = (time_t)(at_ns / 1000000000u),
                                .tv_nsec = (long)(at_ns % 1000000000u)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) == EINTR) {
    }
}

/** A network: half of the SubDevices are mains, each with `pairs` connections of 6-byte frames to a
 *  sub of its own, laid out so that no two copies are neighbours; `standard` single bytes. */
static struct fsn_plan *build(uint32_t pairs, uint32_t standard) {
    static struct build_sm sms[DEVICES][2];
    static struct build_copy copies[2 * HALF * MOST_PAIRS + HALF];
    uint32_t used = 0;
    for (uint32_t main = 0; main < HALF; main++) {
        for (uint32_t i = 0; i < pairs; i++) {
            const uint32_t at = FRAME * i;
            const uint32_t there = FRAME * (pairs - 1 - i);
            copies[used++] = (struct build_copy){main, at, HALF + main, there, FRAME};
            copies[used++] = (struct build_copy){HALF + main, there, main, at, FRAME};
        }
    }
    for (uint32_t i = 0; i < standard; i++) {
        copies[used++] = (struct build_copy){i, FRAME * pairs, HALF + i, FRAME * pairs, 1};
    }
    const uint32_t size = FRAME * pairs + 1 > 11 ? FRAME * pairs + 1 : 11;
    for (uint32_t d = 0; d < DEVICES; d++) {
        sms[d][0] = (struct build_sm){FSN_OUTPUT, size};
        sms[d][1] = (struct build_sm){FSN_INPUT, size};
    }
    const struct build b = {.subdevices = DEVICES,
                            .sm = (const struct build_sm(*)[2])sms,
                            .copies = copies,
                            .pairs = HALF * pairs,
                            .standard = standard,
                            .cycle_ns = 1000000};
    size_t len;
    uint8_t *bytes = build_plan(&b, &len);
    struct fsn_plan *plan;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    free(bytes);
    return plan;
}

struct figures {
    uint64_t cycles, lost, missed;
    struct fsn_histogram period, busy;
    uint64_t elapsed_ns;
};

static void count(struct fsn_histogram *h, uint64_t time_ns) {
    uint32_t b = 0;
    for (uint32_t above = FSN_BUCKETS; above - b > 1;) {
        const uint32_t middle = (b + above) / 2;
        if (fsn_histogram_floor(middle) <= time_ns) {
            b = middle;
        } else {
            above = middle;
        }
    }
    h->bucket[b]++;
    h->count++;
    h->sum_ns += time_ns;
    h->max_ns = time_ns > h->max_ns ? time_ns : h->max_ns;
}

/* -- SOEM alone ----------------------------------------------------------------------------- */

/** Puts this thread where the cycle runs, or back among all others: a cycle that never waits would
 *  starve a thread of its own priority on its CPU. */
static void be_cyclic(int cpu, bool cyclic) {
    cpu_set_t set;
    CPU_ZERO(&set);
    for (int c = 0; c < CPU_SETSIZE; c++) {
        if (!cyclic || c == cpu) {
            CPU_SET((size_t)c, &set);
        }
    }
    const struct sched_param parameter = {.sched_priority = cyclic ? PRIORITY : 0};
    if (sched_setaffinity(0, sizeof set, &set) != 0 ||
        sched_setscheduler(0, cyclic ? SCHED_FIFO : SCHED_OTHER, &parameter) != 0) {
        perror("bench_live: real-time scheduling");
        exit(3);
    }
}

/** SOEM's cycle. Returns whether the working counter is the expected one. */
static bool soem_cycle(struct bare *b) {
    const int expected = 2 * b->groups[0].outputsWKC + b->groups[0].inputsWKC;
    ecx_send_processdata(&b->context);
    return ecx_receive_processdata(&b->context, EC_TIMEOUTRET) == expected;
}

/** The same frames by send() and recv() alone, made once and never read: what no
 *  MainDevice on a packet socket can be faster than. */
static bool least_cycle(struct bare *b) {
    static uint8_t frames[8][EC_BUFSIZE];
    static int lengths[8], count;
    static const struct bare *of;
    uint8_t reply[EC_BUFSIZE];
    ecx_portt *port = &b->port;
    bool came = true;
    if (of != b) { /* as SOEM sends them */
        ecx_send_processdata(&b->context);
        of = b;
        count = b->stack.pushed;
        for (int i = 0; i < count && i < 8; i++) {
            lengths[i] = port->txbuflength[b->stack.idx[i]];
            memcpy(frames[i], port->txbuf[b->stack.idx[i]], (size_t)lengths[i]);
        }
        ecx_receive_processdata(&b->context, EC_TIMEOUTRET);
    }
    for (int i = 0; i < count; i++) {
        came = send(port->sockhandle, frames[i], (size_t)lengths[i], 0) == lengths[i] && came;
    }
    for (int i = 0; i < count; i++) {
        const uint64_t until = now_ns() + EC_TIMEOUTRET * UINT64_C(1000);
        ssize_t got;
        while ((got = recv(port->sockhandle, reply, sizeof reply, MSG_DONTWAIT)) <= 0 &&
               now_ns() < until) {
        }
        came = got > 0 && came;
    }
    return came;
}

static struct figures run_bare(bool (*cycle)(struct bare *b), uint64_t cycle_ns, double seconds,
                               int cpu) {
    struct bare *b = calloc(1, sizeof *b);
    CHECK(b != NULL);
    be_cyclic(cpu, true);
    bare_bring_up(b, DEVICES);
    struct figures f = {0};
    const uint64_t begin = now_ns();
    const uint64_t end = begin + (uint64_t)(seconds * 1e9);
    uint64_t next = begin;
    uint64_t before = 0;
    for (uint64_t start = begin; start < end;) {
        if (cycle_ns > 0) {
            next += cycle_ns;
            sleep_until(next);
        }
        start = now_ns();
        if (before != 0) {
            count(&f.period, start - before);
        }
        before = start;
        f.lost += !cycle(b);
        count(&f.busy, now_ns() - start);
        if (cycle_ns > 0 && start >= next + cycle_ns) {
            const uint64_t missed = (start - next) / cycle_ns;
            f.missed += missed;
            next += missed * cycle_ns;
        }
        f.cycles++;
    }
    f.elapsed_ns = now_ns() - begin;
    bare_end(b);
    be_cyclic(cpu, false);
    usleep(100000); /* or its last frames would look like another MainDevice */
    free(b);
    return f;
}

/* -- our core ------------------------------------------------------------------------------- */

/** A cycle that never waits can be faster than every attempt. */
static void take_snapshot(struct fsn_core *core, struct fsn_statistics *statistics) {
    while (fsn_core_snapshot(core, statistics, NULL, NULL) == FSN_E_BUSY) {
        usleep(1000);
    }
}

static struct figures run_core(const struct fsn_plan *plan, uint64_t cycle_ns, double seconds,
                               int cpu) {
    const struct fsn_live_options options = {
        .interface = "near", .dc_every = 1, .receive_wait_ns = cycle_ns == 0 ? 2000000 : 0};
    struct fsn_fault fault;
    struct fsn_core *core;
    void *bus;
    CHECK(fsn_backend_soem()->create(&options, &bus, &fault) == FSN_OK);
    if (fsn_core_create(plan, fsn_backend_soem()->ops, bus, &core, &fault) != FSN_OK) {
        fprintf(stderr, "%s: %s\n", fault.rule, fault.detail);
        exit(1);
    }
    const struct fsn_thread_options thread = {.cycle_ns = cycle_ns == 0 ? 1000000 : cycle_ns,
                                              .priority = PRIORITY,
                                              .cpu = cpu + 1,
                                              .free_run = cycle_ns == 0};
    CHECK(fsn_core_start(core, &thread, &fault) == FSN_OK);
    while (!fsn_core_poll(core, FSN_AL_OP, now_ns())) {
        usleep(1000);
    }
    struct fsn_statistics from, to;
    take_snapshot(core, &from);
    const uint64_t begin = now_ns();
    for (uint64_t end = begin + (uint64_t)(seconds * 1e9); now_ns() < end; usleep(20000)) {
        fsn_core_poll(core, FSN_AL_OP, now_ns());
    }
    take_snapshot(core, &to);
    struct figures f = {.cycles = to.cycles - from.cycles,
                        .lost = to.wkc_errors - from.wkc_errors,
                        .missed = to.overruns - from.overruns,
                        .period = to.period,
                        .busy = to.work,
                        .elapsed_ns = now_ns() - begin};
    fsn_core_free(core);
    fsn_backend_soem()->free(bus);
    return f;
}

/* -- comparing ------------------------------------------------------------------------------ */

static double us(uint64_t ns) {
    return (double)ns / 1000.0;
}

static void print(const char *name, const struct figures *f) {
    printf("  %-26s %9llu cycles, %llu with a wrong counter, %llu missed; %.1f kHz\n", name,
           (unsigned long long)f->cycles, (unsigned long long)f->lost,
           (unsigned long long)f->missed, (double)f->cycles / us(f->elapsed_ns) * 1000);
    printf("  %-26s period %.1f / %.1f / %.1f us, busy %.1f / %.1f / %.1f us (50, 99.9 %%, most)\n",
           "", us(fsn_histogram_percentile(&f->period, 500000)),
           us(fsn_histogram_percentile(&f->period, 999000)), us(f->period.max_ns),
           us(fsn_histogram_percentile(&f->busy, 500000)),
           us(fsn_histogram_percentile(&f->busy, 999000)), us(f->busy.max_ns));
}

/** Parts in turn, so that a slow second of the machine falls on both. */
static void compare(uint32_t pairs, uint32_t standard, uint64_t cycle_ns, double seconds, int cpu) {
    enum { TURNS = 4 };
    struct fsn_plan *plan = build(pairs, standard);
    struct fsn_segment *segment;
    const struct fsn_segment_link_options link = {
        .interface = "far", .priority = PRIORITY + 1, .cpu = cpu + 1};
    CHECK(fsn_segment_create(plan, &segment) == FSN_OK);
    CHECK(fsn_segment_link(segment, &link, NULL) == FSN_OK);
    printf("%u copies, ", fsn_plan_copy_count(plan));
    if (cycle_ns == 0) {
        printf("free running\n");
    } else {
        printf("%g kHz\n", 1e6 / (double)cycle_ns);
    }
    static const char *const names[] = {"SOEM alone", "core, copies, monitor",
                                        "send() and recv() alone"};
    enum { SOEM, CORE, LEAST, WHO };
    double best[WHO] = {0};
    uint64_t bad[WHO] = {0};
    double median[WHO] = {0};
    double mean[WHO] = {0}, busy[WHO] = {0};
    for (int turn = 0; turn < TURNS; turn++) {
        const struct figures f[WHO] = {
            run_bare(soem_cycle, cycle_ns, seconds / TURNS, cpu),
            run_core(plan, cycle_ns, seconds / TURNS, cpu),
            run_bare(least_cycle, cycle_ns, seconds / TURNS, cpu),
        };
        for (int who = 0; who < WHO; who++) {
            const double rate = (double)f[who].cycles / us(f[who].elapsed_ns) * 1000;
            best[who] = rate > best[who] ? rate : best[who];
            bad[who] += f[who].lost + f[who].missed;
            median[who] += us(fsn_histogram_percentile(&f[who].period, 500000)) / TURNS;
            busy[who] += us(fsn_histogram_percentile(&f[who].busy, 500000)) / TURNS;
            mean[who] += us(f[who].busy.sum_ns / (f[who].busy.count + 1)) / TURNS;
            print(names[who], &f[who]);
        }
    }
    struct fsn_segment_counts c;
    fsn_segment_counts(segment, &c);
    printf("emulator: %.2f us per frame\n", us(c.work_ns) / (double)c.frames);
    if (cycle_ns == 0) {
        printf("=> rate of the core %.2f of that of SOEM alone; nothing on these sockets can reach "
               "more than %.2f\n\n",
               best[CORE] / best[SOEM], best[LEAST] / best[SOEM]);
    } else {
        printf("=> median period %.3f of SOEM alone, busy %+.1f us at the median (goal 2) and "
               "%+.1f on "
               "average, lost or missed %llu against %llu\n\n",
               median[CORE] / median[SOEM], busy[CORE] - busy[SOEM], mean[CORE] - mean[SOEM],
               (unsigned long long)bad[CORE], (unsigned long long)bad[SOEM]);
    }
    fsn_segment_free(segment);
    fsn_plan_free(plan);
}

int main(int argc, char **argv) {
    setvbuf(stdout, NULL, _IOLBF, 0);
    const double seconds = argc > 1 ? atof(argv[1]) : 8;
    const int cpu = argc > 2 ? atoi(argv[2]) : (int)sysconf(_SC_NPROCESSORS_ONLN) - 1;
    const double paced = argc > 3 ? atof(argv[3]) : seconds;
    if (unshare(CLONE_NEWNET) != 0 ||
        system("ip link set lo up && ip link add near type veth peer name far && "
               "ip link set near up && ip link set far up") != 0) {
        fprintf(stderr, "bench_live: a network namespace with a veth pair is needed: root\n");
        return 3;
    }
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
        perror("bench_live: mlockall");
        return 3;
    }
    compare(1, 0, 0, seconds, cpu);
    compare(MOST_PAIRS, 4, 0, seconds, cpu); /* 424 copies */
    compare(MOST_PAIRS, 4, 1000000, paced, cpu);
    compare(1, 0, 1000000, paced, cpu);
    compare(1, 0, 250000, paced, cpu);
    return 0;
}
