/** Cycles over a wire, in turn and on the same CPU: our core with plan, copies and monitor, SOEM's
 *  own functions, and the system calls alone.
 *
 *  fsn-bench PLAN SECONDS CYCLE_NS CPU
 *      over a veth pair in a network namespace of its own, against the emulated SubDevices of the
 *      plan: free running, then with the cycle. Needs root and `ip`. The emulator has the higher
 *      priority, so that replies are there when send() returns: what is left is our own time.
 *  fsn-bench PLAN SECONDS CYCLE_NS CPU INTERFACE
 *      over this interface, with the cycle, without our core: one NOP datagram with as many bytes
 *      as the process data of the plan. SubDevices pass it on and execute nothing.
 *
 *  Writes one JSON object. `work` is the time from the wake-up until a cycle has read its replies
 *  and sent its frames. SOEM's does nothing else; the core observes and publishes after that, which
 *  the free run counts. */
#define _GNU_SOURCE

#include <errno.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "backends/soem/xdp.h"
#include "bare.h"
#include "fsn/fsn.h"
#include "fsn/live.h"
#include "fsn/segment.h"
#include "live/port.h"
#include "times.h"

enum { PRIORITY = 60, TURNS = 5, LISTEN_NS = 100000000, SETTLE_US = 100000 };
enum { EXIT_ENVIRONMENT = 3, MOST_NOP = 1486, MOST_PLAN = 1 << 24 };
enum who { BARE, SOEM, CORE, XDP, WHO };

struct measured {
    uint64_t cycles, incomplete, left_out;
    double per_s[TURNS]; /**< by the median period, which a stall of the machine does not change */
    struct fsn_histogram work, round_trip;
};

struct bench {
    struct fsn_plan *plan;
    int devices;
    double seconds;
    uint64_t cycle_ns;
    int cpu;
    const char *interface;
    uint16_t nop_bytes; /**< 0: on the veth pair */
    bool xdp;           /**< the core is also measured with AF_XDP, which this kernel has */
};

static _Noreturn void refuse(const char *what, const char *detail) {
    fprintf(stderr, "%s%s%s\n", what, detail[0] != '\0' ? ": " : "", detail);
    exit(EXIT_ENVIRONMENT);
}

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

static void print_measured(const char *name, const struct measured *m) {
    printf("\"%s\":{\"cycles\":%llu,\"incomplete\":%llu,\"left_out\":%llu,\"per_s\":[", name,
           (unsigned long long)m->cycles, (unsigned long long)m->incomplete,
           (unsigned long long)m->left_out);
    for (int turn = 0; turn < TURNS; turn++) {
        printf("%s%.1f", turn > 0 ? "," : "", m->per_s[turn]);
    }
    printf("],");
    times_print("work", &m->work);
    if (m->round_trip.count > 0) { /* of the others it is their work */
        printf(",");
        times_print("round_trip", &m->round_trip);
    }
    printf("}");
}

/* -- SOEM, and the system calls alone --------------------------------------------------------- */

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
        refuse("real-time scheduling needs root or CAP_SYS_NICE", strerror(errno));
    }
}

static void repeat(const struct bench *bench, bool (*cycle)(struct bare *b), struct bare *b,
                   uint64_t cycle_ns, int turn, struct measured *m) {
    const uint64_t begin = now_ns();
    const uint64_t end = begin + (uint64_t)(bench->seconds / TURNS * 1e9);
    static struct fsn_histogram period;
    memset(&period, 0, sizeof period);
    uint64_t next = begin;
    uint64_t before = 0;
    for (uint64_t start = begin; start < end; m->cycles++) {
        if (cycle_ns > 0) {
            next += cycle_ns;
            sleep_until(next);
        }
        start = now_ns();
        if (before != 0) {
            times_count(&period, start - before);
        }
        before = start;
        m->incomplete += !cycle(b);
        times_count(&m->work, now_ns() - start);
        if (cycle_ns > 0 && start >= next + cycle_ns) {
            m->left_out += (start - next) / cycle_ns;
            next += (start - next) / cycle_ns * cycle_ns;
        }
    }
    m->per_s[turn] = times_median_per_s(&period);
}

static void run_bare(const struct bench *bench, bool (*cycle)(struct bare *b), uint64_t cycle_ns,
                     int turn, struct measured *m) {
    struct bare *b = calloc(1, sizeof *b);
    if (b == NULL || !bare_open(b, bench->interface, bench->nop_bytes)) {
        refuse("SOEM cannot open the interface; it needs root or CAP_NET_RAW", bench->interface);
    }
    be_cyclic(bench->cpu, true);
    if (bench->nop_bytes == 0 && !bare_bring_up(b, bench->devices)) {
        refuse("SOEM does not bring the emulated SubDevices to OP", "");
    }
    repeat(bench, cycle, b, cycle_ns, turn, m);
    bare_end(b);
    be_cyclic(bench->cpu, false);
    usleep(SETTLE_US); /* or its last frames would look like another MainDevice */
    free(b);
}

/* -- our core ------------------------------------------------------------------------------- */

/** Waits for the first cycle; one that never waits can also be faster than an attempt. */
static void take_snapshot(struct fsn_core *core, struct fsn_statistics *statistics) {
    while (fsn_core_snapshot(core, statistics, NULL, NULL) != FSN_OK) {
        usleep(1000);
    }
}

static void observe(const struct bench *bench, struct fsn_core *core, int turn,
                    struct measured *m) {
    static struct fsn_statistics from, to;
    take_snapshot(core, &from);
    const uint64_t begin = now_ns();
    const uint64_t end = begin + (uint64_t)(bench->seconds / TURNS * 1e9);
    while (now_ns() < end) {
        usleep(20000);
        fsn_core_poll(core, FSN_AL_OP, now_ns());
    }
    take_snapshot(core, &to);
    static struct fsn_histogram period;
    memset(&period, 0, sizeof period);
    times_add(&period, &from.period, &to.period);
    m->per_s[turn] = times_median_per_s(&period);
    m->cycles += to.cycles - from.cycles;
    m->incomplete += to.wkc_errors - from.wkc_errors;
    m->left_out += to.overruns - from.overruns;
    times_add(&m->work, &from.work, &to.work);
    times_add(&m->round_trip, &from.round_trip, &to.round_trip);
}

static void run_core(const struct bench *bench, bool xdp, uint64_t cycle_ns, int turn,
                     struct measured *m) {
    const struct fsn_live_options options = {.interface = bench->interface,
                                             .xdp = xdp,
                                             .dc_every = 1,
                                             .receive_wait_ns = cycle_ns == 0 ? 2000000 : 0};
    const struct fsn_thread_options thread = {.cycle_ns = cycle_ns == 0 ? 1000000 : cycle_ns,
                                              .priority = PRIORITY,
                                              .cpu = bench->cpu + 1,
                                              .free_run = cycle_ns == 0};
    struct fsn_fault fault = {0};
    struct fsn_core *core = NULL;
    void *bus = NULL;
    if (fsn_backend_soem()->create(&options, &bus, &fault) != FSN_OK ||
        fsn_core_create(bench->plan, fsn_backend_soem()->ops, bus, &core, &fault) != FSN_OK ||
        fsn_core_start(core, &thread, &fault) != FSN_OK) {
        refuse(fault.rule != NULL ? fault.rule : "the bus does not start", fault.detail);
    }
    while (!fsn_core_poll(core, FSN_AL_OP, now_ns())) {
        usleep(1000);
    }
    observe(bench, core, turn, m);
    fsn_core_free(core);
    fsn_backend_soem()->free(bus);
    usleep(SETTLE_US);
}

/* -- turns ------------------------------------------------------------------------------------ */

/** In turn, so that a slow second of the machine falls on all. */
static void measure(const struct bench *bench, const char *name, uint64_t cycle_ns) {
    static struct measured all[WHO];
    memset(all, 0, sizeof all);
    for (int turn = 0; turn < TURNS; turn++) {
        run_bare(bench, bare_send_receive, cycle_ns, turn, &all[BARE]);
        run_bare(bench, bare_soem, cycle_ns, turn, &all[SOEM]);
        if (bench->nop_bytes == 0) {
            run_core(bench, false, cycle_ns, turn, &all[CORE]);
        }
        if (bench->xdp) {
            run_core(bench, true, cycle_ns, turn, &all[XDP]);
        }
    }
    if (all[BARE].incomplete == all[BARE].cycles) {
        refuse(bench->interface, "no frame comes back; check cable and power of the SubDevices");
    }
    printf("\"%s\":{", name);
    print_measured("bare", &all[BARE]);
    printf(",");
    print_measured("soem", &all[SOEM]);
    if (bench->nop_bytes == 0) {
        printf(",");
        print_measured("core", &all[CORE]);
    }
    if (bench->xdp) {
        printf(",");
        print_measured("xdp", &all[XDP]);
    }
    printf("}");
}

static void measure_pair(struct bench *bench) {
    if (unshare(CLONE_NEWNET) != 0 ||
        system("ip link set lo up && ip link add near type veth peer name far && "
               "ip link set near up && ip link set far up") != 0) {
        refuse("a network namespace with a veth pair needs root, and the program ip (iproute2)",
               "");
    }
    struct fsn_segment *segment;
    const struct fsn_segment_link_options link = {
        .interface = "far", .priority = PRIORITY + 1, .cpu = bench->cpu + 1};
    int error = 0;
    if (fsn_segment_create(bench->plan, &segment) != FSN_OK ||
        fsn_segment_link(segment, &link, &error) != FSN_OK) {
        refuse("the emulated SubDevices do not start", error != 0 ? strerror(error) : "");
    }
    bench->interface = "near";
    struct fsn_rings *rings;
    bench->xdp = soem_xdp_open(bench->interface, 0, &rings, NULL) == FSN_OK;
    soem_xdp_close(rings);
    printf("{");
    measure(bench, "free", 0);
    printf(",");
    measure(bench, "paced", bench->cycle_ns);
    printf("}\n");
    fsn_segment_free(segment);
}

/** Until its end nothing else of fsoe-net uses the interface. */
static void measure_interface(const struct bench *bench) {
    struct fsn_fault fault = {0};
    int lock;
    if (fsn_port_listen(bench->interface, LISTEN_NS, &fault) != FSN_OK ||
        fsn_port_lock(bench->interface, &lock, &fault) != FSN_OK) {
        refuse(fault.rule != NULL ? fault.rule : "the interface cannot be used", fault.detail);
    }
    printf("{");
    measure(bench, "paced", bench->cycle_ns);
    printf("}\n");
    close(lock);
}

static struct fsn_plan *load(const char *path) {
    FILE *file = fopen(path, "rb");
    uint8_t *bytes = malloc(MOST_PLAN);
    struct fsn_fault fault = {0};
    struct fsn_plan *plan = NULL;
    if (file == NULL || bytes == NULL) {
        refuse(path, strerror(errno));
    }
    const size_t len = fread(bytes, 1, MOST_PLAN, file);
    if (fsn_plan_load(bytes, len, &plan, &fault) != FSN_OK) {
        refuse(path, fault.rule);
    }
    fclose(file);
    free(bytes);
    return plan;
}

static uint16_t image_bytes(const struct fsn_plan *plan) {
    uint32_t sum = 0;
    for (uint32_t sm = 0; sm < fsn_plan_sm_count(plan); sm++) {
        struct fsn_sm_info info;
        sum += fsn_plan_sm(plan, sm, &info) == FSN_OK ? info.size_bytes : 0;
    }
    return (uint16_t)(sum < MOST_NOP ? sum : MOST_NOP);
}

int main(int argc, char **argv) {
    if (argc < 5 || argc > 6) {
        fprintf(stderr, "usage: fsn-bench PLAN SECONDS CYCLE_NS CPU [INTERFACE]\n");
        return 2;
    }
    struct bench bench = {.plan = load(argv[1]),
                          .seconds = atof(argv[2]),
                          .cycle_ns = strtoull(argv[3], NULL, 10),
                          .cpu = atoi(argv[4]),
                          .interface = argc > 5 ? argv[5] : NULL};
    bench.devices = (int)fsn_plan_subdevice_count(bench.plan);
    if (bench.devices >= MOST_SLAVES || bench.cycle_ns == 0) {
        refuse("at most 63 SubDevices, and a cycle", argv[1]);
    }
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
        refuse("locked memory needs root or CAP_IPC_LOCK", strerror(errno));
    }
    if (bench.interface != NULL) {
        bench.nop_bytes = image_bytes(bench.plan);
        measure_interface(&bench);
    } else {
        measure_pair(&bench);
    }
    fsn_plan_free(bench.plan);
    return 0;
}
