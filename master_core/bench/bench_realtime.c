/** A client in the cycle of fsn-master against a thread inside SOEM's own loop, over a veth pair
 *  with the emulated segment, at 1 and 4 kHz.
 *
 *  bench_realtime FSN_MASTER [SECONDS]: needs root; makes a network namespace of its own.
 *  - inputs: from the start of a cycle until the loop has its inputs.
 *  - through a thread: the same where a further thread is woken by futex, as a master would that
 *    wakes its clients.
 *  - to the wire: from the moment an output is sent until its frame is on the wire, as the kernel
 *    stamps it at the other end, and from the start of the cycle whose inputs it answers. */
#define _GNU_SOURCE

#include <arpa/inet.h>
#include <errno.h>
#include <linux/futex.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "bare.h"
#include "builder.h"
#include "fsn/client.h"
#include "fsn/fsn.h"
#include "fsn/segment.h"

enum { DEVICES = 4, SM_BYTES = 32, OUTPUT_BYTE = 16, KEPT = 1 << 17, PRIORITY = 60 };
enum { CYCLE_PRIORITY = 80, LOOP_PRIORITY = 50 };

static const uint32_t marker = 0xF5E0C1CE;

static uint64_t clock_ns(clockid_t clock) {
    struct timespec now;
    clock_gettime(clock, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static uint64_t now_ns(void) {
    return clock_ns(CLOCK_MONOTONIC);
}

static void sleep_until(uint64_t at_ns) {
    const struct timespec at = {.tv_sec = (time_t)(at_ns / 1000000000u),
                                .tv_nsec = (long)(at_ns % 1000000000u)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) == EINTR) {
    }
}

static void be_realtime(int priority, int cpu) {
    cpu_set_t set;
    CPU_ZERO(&set);
    for (int c = 0; c < CPU_SETSIZE; c++) {
        if (cpu < 0 || c == cpu) {
            CPU_SET((size_t)c, &set);
        }
    }
    const struct sched_param parameter = {.sched_priority = priority};
    CHECK(sched_setaffinity(0, sizeof set, &set) == 0);
    CHECK(sched_setscheduler(0, priority > 0 ? SCHED_FIFO : SCHED_OTHER, &parameter) == 0);
}

/* -- what is measured ------------------------------------------------------------------------- */

struct times {
    uint32_t count;
    uint32_t ns[KEPT];
};

static void keep(struct times *times, uint64_t ns) {
    if (times->count < KEPT) {
        times->ns[times->count++] = ns > UINT32_MAX ? UINT32_MAX : (uint32_t)ns;
    }
}

static int by_time(const void *a, const void *b) {
    const uint32_t *x = a;
    const uint32_t *y = b;
    return (*x > *y) - (*x < *y);
}

static void print(const char *name, struct times *times) {
    qsort(times->ns, times->count, sizeof times->ns[0], by_time);
    const uint32_t n = times->count;
    if (n == 0) {
        printf("    %-34s none\n", name);
        return;
    }
    printf("    %-34s %8.1f %8.1f %8.1f us (50, 99.9 %%, most) of %u\n", name,
           times->ns[n / 2] / 1e3, times->ns[(uint32_t)((uint64_t)n * 999 / 1000)] / 1e3,
           times->ns[n - 1] / 1e3, n);
}

/** Of each output, by its number: when its cycle began, when it was sent, when it was on the wire.
 */
static struct outputs {
    uint64_t began_ns[KEPT], sent_ns[KEPT];
    _Atomic uint64_t wire_ns[KEPT];
} outputs;

static struct times inputs, through, to_wire, answered;

static void forget(void) {
    memset(&outputs, 0, sizeof outputs);
    inputs.count = through.count = to_wire.count = answered.count = 0;
}

static uint64_t output_of(uint32_t number, uint64_t began_ns) {
    outputs.began_ns[number % KEPT] = began_ns;
    outputs.sent_ns[number % KEPT] = now_ns();
    return (uint64_t)marker << 32 | number;
}

static void report(const char *who) {
    for (uint32_t i = 0; i < KEPT; i++) {
        const uint64_t wire_ns = atomic_load(&outputs.wire_ns[i]);
        if (wire_ns > outputs.sent_ns[i] && outputs.sent_ns[i] != 0) {
            keep(&to_wire, wire_ns - outputs.sent_ns[i]);
            keep(&answered, wire_ns - outputs.began_ns[i]);
        }
    }
    printf("  %s\n", who);
    print("start of cycle to inputs", &inputs);
    if (through.count > 0) {
        print("  through a waking thread", &through);
    }
    print("output sent to wire", &to_wire);
    print("start of cycle to answer on wire", &answered);
}

/** Looks at every frame at the far end, as the kernel stamps it. */
static void *sniff(void *argument) {
    (void)argument;
    const int one = 1;
    uint8_t frame[2048];
    const int fd = socket(AF_PACKET, SOCK_RAW, htons(0x88A4));
    const struct sockaddr_ll address = {.sll_family = AF_PACKET,
                                        .sll_protocol = htons(0x88A4),
                                        .sll_ifindex = (int)if_nametoindex("far")};
    CHECK(fd >= 0 && bind(fd, (const struct sockaddr *)&address, sizeof address) == 0);
    CHECK(setsockopt(fd, SOL_PACKET, PACKET_IGNORE_OUTGOING, &one, sizeof one) == 0);
    CHECK(setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &one, sizeof one) == 0);
    for (;;) {
        union {
            struct cmsghdr head;
            char room[256];
        } control;
        struct iovec piece = {frame, sizeof frame};
        struct msghdr message = {.msg_iov = &piece,
                                 .msg_iovlen = 1,
                                 .msg_control = &control,
                                 .msg_controllen = sizeof control};
        const ssize_t got = recvmsg(fd, &message, 0);
        const uint8_t *at = got > 0 ? memmem(frame, (size_t)got, &marker, sizeof marker) : NULL;
        if (at == NULL || at < frame + 4) {
            continue;
        }
        uint32_t number;
        memcpy(&number, at - sizeof number, sizeof number);
        const uint64_t offset_ns = clock_ns(CLOCK_REALTIME) - now_ns();
        for (struct cmsghdr *c = CMSG_FIRSTHDR(&message); c != NULL; c = CMSG_NXTHDR(&message, c)) {
            struct timespec stamp;
            if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SO_TIMESTAMPNS) {
                memcpy(&stamp, CMSG_DATA(c), sizeof stamp);
                uint64_t none = 0;
                atomic_compare_exchange_strong(&outputs.wire_ns[number % KEPT], &none,
                                               (uint64_t)stamp.tv_sec * 1000000000u +
                                                   (uint64_t)stamp.tv_nsec - offset_ns);
            }
        }
    }
}

/* -- SOEM's own loop --------------------------------------------------------------------------- */

static void run_bare(uint64_t cycle_ns, double seconds, int cpu) {
    struct bare *b = calloc(1, sizeof *b);
    CHECK(b != NULL);
    forget();
    be_realtime(CYCLE_PRIORITY, cpu);
    CHECK(bare_open(b, "near", 0) && bare_bring_up(b, DEVICES));
    uint64_t next = now_ns();
    const uint64_t end = next + (uint64_t)(seconds * 1e9);
    for (uint32_t number = 1; next < end; number++) {
        next += cycle_ns;
        sleep_until(next);
        const uint64_t began = now_ns();
        bare_soem(b);
        keep(&inputs, now_ns() - began);
        const uint64_t value = output_of(number, began);
        memcpy(b->slaves[1].outputs + OUTPUT_BYTE, &value, sizeof value);
    }
    be_realtime(0, -1);
    bare_end(b);
    usleep(100000); /* or its last frames would look like another MainDevice */
    free(b);
    report("a thread inside SOEM's own loop");
}

/* -- a client of fsn-master -------------------------------------------------------------------- */

static _Atomic uint32_t woken; /**< what the waking thread changes */
static _Atomic uint64_t woken_began_ns;

/** A thread that is woken by another one. */
static void *wait_for_futex(void *argument) {
    be_realtime(LOOP_PRIORITY, *(int *)argument);
    for (uint32_t seen = 0;;) {
        syscall(SYS_futex, &woken, FUTEX_WAIT, seen, NULL, NULL, 0);
        const uint32_t now = atomic_load(&woken);
        if (now == UINT32_MAX) {
            return NULL;
        }
        if (now != seen) {
            keep(&through, now_ns() - atomic_load(&woken_began_ns));
            seen = now;
        }
    }
}

static void wake(uint32_t number) {
    atomic_store(&woken, number);
    syscall(SYS_futex, &woken, FUTEX_WAKE, 1, NULL, NULL, 0);
}

static pid_t start_master(const char *program, const char *folder, uint64_t cycle_ns, int cpu) {
    char plan[64];
    char path[64];
    char cycle[32];
    char number[16];
    snprintf(plan, sizeof plan, "%s/plan", folder);
    snprintf(path, sizeof path, "%s/s", folder);
    snprintf(cycle, sizeof cycle, "%lluns", (unsigned long long)cycle_ns);
    snprintf(number, sizeof number, "%d", cpu);
    const pid_t child = fork();
    if (child == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        execl(program, program, plan, "--interface", "near", "--cycle", cycle, "--socket", path,
              "--cpu", number, "--wait", "10s", "--record", "1s", (char *)NULL);
        perror(program);
        _exit(127);
    }
    CHECK(child > 0);
    return child;
}

static struct fsn_realtime *connect_to(const char *folder) {
    static const char *const names[] = {"t"};
    char path[64];
    snprintf(path, sizeof path, "%s/s", folder);
    const struct fsn_realtime_options options = {
        .socket = path, .outputs = names, .output_count = 1, .misses = 100};
    struct fsn_realtime_fault fault;
    struct fsn_realtime *client = NULL;
    for (int tries = 0; tries < 1500; tries++, usleep(10000)) {
        if (fsn_realtime_open(&options, &client, &fault) == FSN_OK) {
            return client;
        }
    }
    fprintf(stderr, "bench_realtime: %s\n", fault.text);
    exit(1);
}

static void run_client(const char *program, const char *folder, uint64_t cycle_ns, double seconds,
                       const int cpu[2]) {
    forget();
    const pid_t master = start_master(program, folder, cycle_ns, cpu[0]);
    struct fsn_realtime *client = connect_to(folder);
    const int32_t out = fsn_realtime_output(client, "t");
    pthread_t thread;
    int other = cpu[1];
    atomic_store(&woken, 0);
    CHECK(pthread_create(&thread, NULL, wait_for_futex, &other) == 0);
    sleep(1); /* every SubDevice is in OP */
    be_realtime(LOOP_PRIORITY, cpu[1]);
    const uint64_t end = now_ns() + (uint64_t)(seconds * 1e9);
    uint64_t skipped = 0;
    uint64_t overruns[2] = {0, 0};
    for (uint32_t number = 1; now_ns() < end; number++) {
        struct fsn_realtime_cycle cycle;
        CHECK(fsn_realtime_wait(client, 1000000000, &cycle) == FSN_OK);
        keep(&inputs, now_ns() - cycle.now_ns);
        CHECK(fsn_realtime_set(client, out, output_of(number, cycle.now_ns)) == FSN_OK);
        fsn_realtime_send(client);
        atomic_store(&woken_began_ns, cycle.now_ns);
        wake(number);
        skipped += number > 1 ? cycle.skipped : 0;
        overruns[number > 1] = cycle.overruns;
    }
    const struct fsn_realtime_counts counts = fsn_realtime_counts(client);
    be_realtime(0, -1);
    wake(UINT32_MAX);
    CHECK(pthread_join(thread, NULL) == 0);
    fsn_realtime_close(client);
    CHECK(kill(master, SIGTERM) == 0 && waitpid(master, NULL, 0) == master);
    report("a client in the cycle of fsn-master");
    printf(
        "    %llu outputs in time, %llu late, %llu cycles without; %llu not seen, %llu overruns\n",
        (unsigned long long)counts.on_time, (unsigned long long)counts.late,
        (unsigned long long)counts.missed, (unsigned long long)skipped,
        (unsigned long long)(overruns[1] - overruns[0]));
}

/* -- both -------------------------------------------------------------------------------------- */

static struct fsn_plan *build(const char *folder) {
    static const struct build_symbol symbols[] = {
        {.sm = 0, .bit_offset = 8 * OUTPUT_BYTE, .bits = 64}};
    static const struct build_copy copies[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}};
    struct build_sm sms[DEVICES][2];
    for (int d = 0; d < DEVICES; d++) {
        sms[d][0] = (struct build_sm){FSN_OUTPUT, SM_BYTES};
        sms[d][1] = (struct build_sm){FSN_INPUT, SM_BYTES};
    }
    const struct build b = {.subdevices = DEVICES,
                            .sm = (const struct build_sm(*)[2])sms,
                            .copies = copies,
                            .pairs = 1,
                            .cycle_ns = 1000000,
                            .symbols = symbols,
                            .symbol_count = 1};
    size_t len;
    uint8_t *bytes = build_plan(&b, &len);
    char path[64];
    snprintf(path, sizeof path, "%s/plan", folder);
    FILE *file = fopen(path, "wb");
    CHECK(file != NULL && fwrite(bytes, 1, len, file) == len && fclose(file) == 0);
    struct fsn_plan *plan;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    free(bytes);
    return plan;
}

int main(int argc, char **argv) {
    static const uint64_t cycles_ns[] = {1000000, 250000};
    setvbuf(stdout, NULL, _IOLBF, 0);
    if (argc < 2) {
        fprintf(stderr, "usage: bench_realtime FSN_MASTER [SECONDS]\n");
        return 2;
    }
    const double seconds = argc > 2 ? atof(argv[2]) : 8;
    const int last = (int)sysconf(_SC_NPROCESSORS_ONLN) - 1;
    const int cpu[2] = {last, last > 0 ? last - 1 : 0};
    if (unshare(CLONE_NEWNET) != 0 ||
        system("ip link set lo up && ip link add near type veth peer name far && "
               "ip link set near up && ip link set far up") != 0) {
        fprintf(stderr, "bench_realtime: a network namespace with a veth pair is needed: root\n");
        return 3;
    }
    char folder[] = "/tmp/fsn-bench-XXXXXX";
    CHECK(mkdtemp(folder) != NULL && mlockall(MCL_CURRENT | MCL_FUTURE) == 0);
    struct fsn_plan *plan = build(folder);
    struct fsn_segment *segment;
    const struct fsn_segment_link_options link = {
        .interface = "far", .priority = CYCLE_PRIORITY + 1, .cpu = cpu[0] + 1};
    CHECK(fsn_segment_create(plan, &segment) == FSN_OK);
    CHECK(fsn_segment_link(segment, &link, NULL) == FSN_OK);
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, sniff, NULL) == 0);
    for (size_t i = 0; i < sizeof cycles_ns / sizeof cycles_ns[0]; i++) {
        printf("%g kHz\n", 1e6 / (double)cycles_ns[i]);
        run_bare(cycles_ns[i], seconds, cpu[0]);
        run_client(argv[1], folder, cycles_ns[i], seconds, cpu);
    }
    fsn_segment_free(segment);
    fsn_plan_free(plan);
    char path[64];
    snprintf(path, sizeof path, "%s/plan", folder);
    CHECK(unlink(path) == 0 && rmdir(folder) == 0);
    return 0;
}
