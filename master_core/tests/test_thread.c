/** Start of the cyclic thread: requests to the system and refusals. Its calls are answered by this
 *  program, so that privileges and machine do not matter. */
#define _GNU_SOURCE

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <stdarg.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "core/core_internal.h"
#include "emulated_rig.h"

static struct {
    int create_fails[2]; /**< the first and the second time */
    int attribute_fails, affinity_fails, lock_fails, trace_fails;
    int priority[2], cpu;
    int creates, locks;
    int trace_ends[2];
} os;

int pthread_attr_init(pthread_attr_t *attributes) {
    int (*real)(pthread_attr_t *);
    void *found = dlsym(RTLD_NEXT, "pthread_attr_init");
    memcpy(&real, &found, sizeof real);
    return os.attribute_fails != 0 ? os.attribute_fails : real(attributes);
}

int pthread_attr_setaffinity_np(pthread_attr_t *attributes, size_t bytes, const cpu_set_t *set) {
    (void)attributes;
    CHECK(bytes == sizeof *set && CPU_COUNT(set) == 1);
    for (size_t cpu = 0; cpu < CPU_SETSIZE; cpu++) {
        os.cpu = CPU_ISSET(cpu, set) ? (int)cpu : os.cpu;
    }
    return os.affinity_fails;
}

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *),
                   void *argument) {
    struct sched_param parameter = {0};
    int policy;
    int inherit;
    CHECK(pthread_attr_getschedpolicy(attributes, &policy) == 0);
    CHECK(pthread_attr_getinheritsched(attributes, &inherit) == 0);
    CHECK(pthread_attr_getschedparam(attributes, &parameter) == 0 && os.creates < 2);
    const bool realtime = policy == SCHED_FIFO && inherit == PTHREAD_EXPLICIT_SCHED;
    CHECK(realtime || (policy == SCHED_OTHER && parameter.sched_priority == 0));
    os.priority[os.creates] = realtime ? parameter.sched_priority : 0;
    if (os.create_fails[os.creates++] != 0) {
        return os.create_fails[os.creates - 1];
    }
    int (*real)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    void *found = dlsym(RTLD_NEXT, "pthread_create");
    memcpy(&real, &found, sizeof real);
    return real(thread, NULL, run, argument); /* it need not be real time */
}

int mlockall(int flags) {
    CHECK(flags == (MCL_CURRENT | MCL_FUTURE));
    os.locks++;
    errno = os.lock_fails;
    return os.lock_fails != 0 ? -1 : 0;
}

int open(const char *path, int flags, ...) {
    if (strcmp(path, "/sys/kernel/tracing/trace_marker") != 0) {
        va_list arguments; /* a file of the run-time library */
        va_start(arguments, flags);
        const unsigned mode = (flags & O_CREAT) != 0 ? va_arg(arguments, unsigned) : 0;
        va_end(arguments);
        return (int)syscall(SYS_openat, AT_FDCWD, path, flags, mode);
    }
    CHECK(flags == (O_WRONLY | O_CLOEXEC));
    errno = os.trace_fails;
    return os.trace_fails != 0 ? -1 : os.trace_ends[1];
}

static struct emulated_rig rig;

static void set_up(void) {
    size_t len;
    uint8_t *bytes = build_estop(&len);
    memset(&os, 0, sizeof os);
    os.cpu = -1;
    rig = emulated_rig_load(bytes, len);
}

static struct fsn_statistics statistics(void) {
    struct fsn_statistics s;
    fsn_status status = FSN_E_BUSY;
    while (status == FSN_E_BUSY) {
        status = fsn_core_snapshot(rig.core, &s, NULL, NULL);
    }
    CHECK(status == FSN_OK);
    return s;
}

static void run_a_while(void) {
    while (statistics().cycles < 3) {
        sched_yield();
    }
    fsn_core_stop(rig.core);
}

static void a_thread_gets_what_was_asked_for(void) {
    set_up();
    const struct fsn_thread_options options = {
        .cycle_ns = 50000, .priority = 80, .cpu = 3, .lock_memory = true};
    CHECK(fsn_core_start(rig.core, &options, NULL) == FSN_OK);
    run_a_while();
    CHECK(os.creates == 1 && os.priority[0] == 80 && os.cpu == 2 && os.locks == 1);
    CHECK(statistics().realtime && statistics().locked);
    emulated_rig_end(&rig);
}

/** Without the right to real time it still runs, and reports it. */
static void a_thread_without_rights_is_none_of_real_time(void) {
    set_up();
    os.create_fails[0] = EPERM;
    const struct fsn_thread_options options = {.cycle_ns = 50000, .priority = 1};
    CHECK(fsn_core_start(rig.core, &options, NULL) == FSN_OK);
    run_a_while();
    CHECK(os.creates == 2 && os.priority[0] == 1 && os.priority[1] == 0);
    CHECK(os.cpu == -1 && os.locks == 0 && !statistics().realtime && !statistics().locked);
    emulated_rig_end(&rig);
}

static void refused(const struct fsn_thread_options *options, int error) {
    struct fsn_fault fault;
    CHECK(fsn_core_start(rig.core, options, &fault) == FSN_E_SYS);
    CHECK(fault.status == FSN_E_SYS && fault.sys_errno == error && !rig.core->running);
    CHECK(fsn_core_start(rig.core, options, NULL) == FSN_E_SYS);
    CHECK(rig.core->rt.trace == NULL);
    emulated_rig_end(&rig);
}

static void what_the_system_refuses_is_reported(void) {
    const struct fsn_thread_options plain = {.cycle_ns = 50000};
    const struct fsn_thread_options fast = {.cycle_ns = 50000, .priority = 5};
    const struct fsn_thread_options pinned = {.cycle_ns = 50000, .cpu = 1};
    const struct fsn_thread_options locked = {.cycle_ns = 50000, .lock_memory = true};
    const struct fsn_thread_options traced = {.cycle_ns = 50000, .trace = true};
    set_up();
    os.create_fails[0] = os.create_fails[1] = EAGAIN;
    refused(&plain, EAGAIN);
    set_up();
    os.create_fails[0] = EAGAIN; /* only a missing privilege is tolerated */
    struct fsn_fault fault;
    CHECK(fsn_core_start(rig.core, &fast, &fault) == FSN_E_SYS && os.creates == 1);
    emulated_rig_end(&rig);
    set_up();
    os.create_fails[0] = EPERM;
    CHECK(fsn_core_start(rig.core, &plain, &fault) == FSN_E_SYS && os.creates == 1);
    CHECK(fault.sys_errno == EPERM);
    emulated_rig_end(&rig);
    set_up();
    os.attribute_fails = ENOMEM;
    refused(&plain, ENOMEM);
    set_up();
    os.affinity_fails = EINVAL;
    refused(&pinned, EINVAL);
    set_up();
    os.lock_fails = ENOMEM;
    refused(&locked, ENOMEM);
    set_up();
    os.trace_fails = ENOENT;
    refused(&traced, ENOENT);
}

/** Markers go to the file of the kernel while it runs, and nowhere else. */
static void markers_are_written(void) {
    set_up();
    CHECK(pipe(os.trace_ends) == 0 && fcntl(os.trace_ends[1], F_SETFL, O_NONBLOCK) == 0);
    const struct fsn_thread_options options = {.cycle_ns = 100000, .trace = true};
    CHECK(fsn_core_start(rig.core, &options, NULL) == FSN_OK);
    run_a_while();
    char text[40] = "";
    CHECK(read(os.trace_ends[0], text, 34) == 34);
    CHECK(strcmp(text, "fsn: cycle beginsfsn: cycle ends") == 0 ||
          strncmp(text, "fsn: cycle beginsfsn: cycle ends", 32) == 0);
    CHECK(fcntl(os.trace_ends[1], F_GETFD) == -1 && rig.core->rt.trace == NULL);
    close(os.trace_ends[0]);
    emulated_rig_end(&rig);
    set_up();
    CHECK(pipe(os.trace_ends) == 0);
    os.create_fails[0] = EAGAIN; /* the file is closed again */
    struct fsn_fault fault;
    CHECK(fsn_core_start(rig.core, &options, &fault) == FSN_E_SYS);
    CHECK(fcntl(os.trace_ends[1], F_GETFD) == -1);
    close(os.trace_ends[0]);
    emulated_rig_end(&rig);
}

/** The limits of the parameters. */
static void options_have_limits(void) {
    static const char limits[] = "the cycle is 1 us to 4 s, the priority 0 to 99, the CPU exists";
    static const struct {
        struct fsn_thread_options options;
        bool good;
    } table[] = {
        {{.cycle_ns = 999}, false},
        {{.cycle_ns = 1000}, true},
        {{.cycle_ns = UINT64_C(4000000000)}, true},
        {{.cycle_ns = UINT64_C(4000000001)}, false},
        {{.priority = -1}, false},
        {{.priority = 99}, true},
        {{.priority = 100}, false},
        {{.cpu = -1}, false},
        {{.cpu = 1}, true},
        {{.cpu = CPU_SETSIZE}, true},
        {{.cpu = CPU_SETSIZE + 1}, false},
        {{.cycle_ns = 0}, true}, /* the plan's */
    };
    set_up();
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        struct fsn_thread_options options = table[i].options;
        struct fsn_fault fault;
        os.creates = 0;
        options.cycle_ns = options.cycle_ns == 0 ? 1000000 : options.cycle_ns;
        os.create_fails[0] = EAGAIN; /* none of them need really run */
        const fsn_status status = fsn_core_start(rig.core, &options, &fault);
        CHECK(status == (table[i].good ? FSN_E_SYS : FSN_E_ARG));
        CHECK(table[i].good || strcmp(fault.rule, limits) == 0);
        CHECK(!table[i].good || rig.core->rt.cycle_ns == options.cycle_ns);
    }
    struct fsn_fault fault;
    const struct fsn_thread_options fine = {.free_run = true, .follow_dc = true};
    CHECK(fsn_core_start(NULL, &fine, &fault) == FSN_E_ARG);
    CHECK(fsn_core_start(rig.core, NULL, &fault) == FSN_E_ARG);
    os.creates = os.create_fails[0] = 0;
    rig.core->rt.dc_sum_ns = 5; /* of another run */
    CHECK(fsn_core_start(rig.core, &fine, &fault) == FSN_OK);
    CHECK(rig.core->rt.cycle_ns == 1000000 && rig.core->rt.free_run && rig.core->rt.follow_dc);
    CHECK(rig.core->rt.dc_sum_ns == 0 && rig.core->rt.dc_shift_ns == 500000);
    CHECK(fsn_core_start(rig.core, &fine, &fault) == FSN_E_STATE);
    CHECK(strcmp(fault.rule, "the cyclic thread runs already") == 0);
    CHECK(fsn_core_cycle(rig.core, 1) == FSN_E_STATE);
    run_a_while();
    CHECK(fsn_core_cycle(rig.core, 1) == FSN_OK);
    fsn_core_stop(NULL);
    /* Room for cycles that do not fit at this cycle time. */
    CHECK(fsn_core_keep(rig.core, 1, 1 << 12) == FSN_OK);
    rig.core->keep_bytes = 1;
    CHECK(fsn_core_start(rig.core, &fine, &fault) == FSN_E_ARG);
    CHECK(strcmp(fault.rule, "no room to record the cycles") == 0);
    emulated_rig_end(&rig);
}

int main(void) {
    a_thread_gets_what_was_asked_for();
    a_thread_without_rights_is_none_of_real_time();
    what_the_system_refuses_is_reported();
    markers_are_written();
    options_have_limits();
    return 0;
}
