#define _GNU_SOURCE

#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/core_internal.h"
#include "rt/prefault.h"

fsn_status fsn_core_create(const struct fsn_plan *plan, const struct fsn_bus_ops *ops, void *bus,
                           struct fsn_core **out, struct fsn_fault *fault) {
    if (out == NULL) {
        return fsn_refuse_all(fault, FSN_E_ARG, NULL);
    }
    *out = NULL;
    if (plan == NULL || ops == NULL || ops->open == NULL || ops->receive == NULL ||
        ops->send == NULL) {
        return fsn_refuse_all(fault, FSN_E_ARG, "plan, open, receive and send are needed");
    }
    struct fsn_core *core = fsn_calloc_prefaulted(1, sizeof *core);
    if (core == NULL) {
        return fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
    }
    fsn_plan_hold(plan);
    core->plan = plan;
    core->rt.ops = ops;
    core->rt.bus = bus;
    core->rt.snapshot.shown = &core->shown;
    const fsn_status status = fsn_core_activate(core, fault);
    if (status != FSN_OK) {
        fsn_core_free(core);
        return status;
    }
    *out = core;
    return FSN_OK;
}

void fsn_core_free(struct fsn_core *core) {
    if (core == NULL) {
        return;
    }
    fsn_core_stop(core);
    fsn_core_clients_end(core);
    if (core->opened && core->rt.ops->close != NULL) {
        core->rt.ops->close(core->rt.bus);
    }
    free(core->copies);
    free(core->groups);
    free(core->rt.watches);
    free(core->rt.monitors);
    free(core->rt.seen);
    free(core->rt.outputs);
    free(core->active);
    free(core->active_slot);
    free(core->wanted);
    free(core->set_values);
    free(core->rt.input.wkc);
    free(core->rt.input.sm_stale);
    free((void *)core->rt.stale);
    for (int i = 0; i < FSN_RT_PICTURES && core->rt.snapshot.shown == &core->shown; i++) {
        free((void *)core->rt.snapshot.words[i]);
    }
    free((void *)core->rt.recorder.words);
    fsn_plan_free((struct fsn_plan *)core->plan);
    free(core);
}

fsn_status fsn_core_cycle(struct fsn_core *core, uint64_t now_ns) {
    if (core == NULL) {
        return FSN_E_ARG;
    }
    if (core->running) {
        return FSN_E_STATE;
    }
    fsn_rt_cycle(&core->rt, now_ns, false);
    return FSN_OK;
}

static void *thread_main(void *argument) {
    struct fsn_core *core = argument;
    /* Touch the stack once, so that no page fault occurs in a cycle. */
    volatile uint8_t stack[16384];
    /* mutants: what was not touched shows as time only */
    for (size_t i = 0; i < sizeof stack; i += 1024) {
        stack[i] = 0;
    }
    fsn_rt_loop(&core->rt);
    return NULL;
}

static int set_attributes(pthread_attr_t *attributes, const struct fsn_thread_options *options,
                          bool realtime) {
    int error = 0;
    if (realtime) {
        const struct sched_param parameter = {.sched_priority = options->priority};
        error = pthread_attr_setinheritsched(attributes, PTHREAD_EXPLICIT_SCHED);
        /* GCOVR_EXCL_BR_START: options_ok lets nothing through that the C library refuses */
        error = error != 0 ? error : pthread_attr_setschedpolicy(attributes, SCHED_FIFO);
        error = error != 0 ? error : pthread_attr_setschedparam(attributes, &parameter);
        /* GCOVR_EXCL_BR_STOP */
    }
    if (options->cpu > 0) {
        cpu_set_t set;
        CPU_ZERO(&set);
        /* GCOVR_EXCL_BR_START: as above; the macro has limits of its own */
        CPU_SET((size_t)options->cpu - 1, &set);
        error = error != 0 ? error : pthread_attr_setaffinity_np(attributes, sizeof set, &set);
        /* GCOVR_EXCL_BR_STOP */
    }
    return error;
}

static int create_thread(struct fsn_core *core, const struct fsn_thread_options *options,
                         bool realtime) {
    pthread_attr_t attributes;
    int error = pthread_attr_init(&attributes);
    if (error != 0) {
        return error;
    }
    error = set_attributes(&attributes, options, realtime);
    if (error == 0) {
        /* Before the thread runs: from then on, only the thread writes the statistics. */
        core->rt.statistics.realtime = realtime;
        error = pthread_create(&core->thread, &attributes, thread_main, core);
    }
    pthread_attr_destroy(&attributes);
    return error;
}

static bool options_ok(const struct fsn_thread_options *options, uint64_t cycle_ns) {
    return cycle_ns >= 1000 && cycle_ns <= 4000000000u && options->priority >= 0 &&
           options->priority <= 99 && options->cpu >= 0 && options->cpu <= CPU_SETSIZE;
}

static void write_marker(int fd, const char *marker) {
    /* A marker that cannot be written completely is lost; the cycle continues. */
    const ssize_t written = write(fd, marker, strlen(marker));
    (void)written;
}

static int open_trace(struct fsn_core *core) {
    core->rt.trace_fd = open("/sys/kernel/tracing/trace_marker", O_WRONLY | O_CLOEXEC);
    if (core->rt.trace_fd < 0) { /* mutants: 0 is standard input */
        return errno;
    }
    core->rt.trace = write_marker;
    return 0;
}

static void close_trace(struct fsn_core *core) {
    if (core->rt.trace != NULL) {
        core->rt.trace = NULL;
        close(core->rt.trace_fd);
    }
}

/** Opens, locks and creates the resources of the cycle. Returns 0, or errno. */
static int start_thread(struct fsn_core *core, const struct fsn_thread_options *options) {
    int error = options->trace ? open_trace(core) : 0;
    if (error == 0 && options->lock_memory && mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
        error = errno;
    }
    if (error != 0) {
        return error;
    }
    core->rt.statistics.locked = options->lock_memory;
    error = create_thread(core, options, options->priority > 0);
    return error == EPERM && options->priority > 0 ? create_thread(core, options, false) : error;
}

fsn_status fsn_core_start(struct fsn_core *core, const struct fsn_thread_options *options,
                          struct fsn_fault *fault) {
    if (core == NULL || options == NULL) {
        return fsn_refuse_all(fault, FSN_E_ARG, NULL);
    }
    if (core->running) {
        return fsn_refuse_all(fault, FSN_E_STATE, "the cyclic thread runs already");
    }
    const uint64_t cycle_ns = options->cycle_ns != 0 ? options->cycle_ns : core->plan->cycle_ns;
    if (!options_ok(options, cycle_ns)) {
        return fsn_refuse_all(fault, FSN_E_ARG,
                              "the cycle is 1 us to 4 s, the priority 0 to 99, the CPU exists");
    }
    const fsn_status fits = fsn_core_fit_recorder(core, cycle_ns);
    if (fits != FSN_OK) {
        return fsn_refuse_all(fault, fits, "no room to record the cycles");
    }
    core->rt.cycle_ns = cycle_ns;
    core->rt.free_run = options->free_run;
    core->rt.follow_dc = options->follow_dc && core->layout.dc_base_ns == 0;
    core->rt.dc_base_ns = core->layout.dc_base_ns;
    core->rt.dc_shift_ns = options->dc_shift_ns != 0 ? options->dc_shift_ns : cycle_ns / 2;
    core->rt.dc_sum_ns = 0;
    atomic_store(&core->rt.stop, false);
    const int error = start_thread(core, options);
    if (error != 0) {
        close_trace(core);
        fsn_refuse_all(fault, FSN_E_SYS, NULL);
        if (fault != NULL) {
            fault->sys_errno = error;
        }
        return FSN_E_SYS;
    }
    core->running = true;
    return FSN_OK;
}

void fsn_core_stop(struct fsn_core *core) {
    if (core == NULL || !core->running) {
        return;
    }
    atomic_store(&core->rt.stop, true);
    pthread_join(core->thread, NULL);
    core->running = false;
    close_trace(core);
}
