#define _GNU_SOURCE

#include "app/runner.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <unistd.h>

#include "app/base/schedule.h"
#include "app/log/log.h"
#include "app/takeover/predecessor.h"
#include "control/base/clock.h"
#include "plan/plan_internal.h"

enum {
    TEND_NS = 2000000,      /**< between two steps of the acyclic work */
    LEAVE_MS = 2000,        /**< time for SubDevices to leave OP */
    RETRY_MS = 200,         /**< between two attempts to open */
    RECORD_BYTES = 64 << 20 /**< room for recorded cycles */
};

/** How long to try attaching to a running bus. */
static const uint64_t attach_ns = 3000000000u;

/** Jobs, oldest first. */
struct queue {
    struct fsn_job *first, *last;
};

struct runner {
    const struct options *options;
    const struct fsn_plan *plan;
    const struct fsn_backend *backend;
    pthread_t thread;
    int wake; /**< eventfd: the control thread has a result to take */
    pthread_mutex_t lock;
    pthread_cond_t requested;
    enum runner_job job;         /**< requested, guarded by lock */
    bool ending;                 /**< guarded by lock */
    struct runner_result result; /**< guarded by lock */
    struct queue waiting, done;  /**< guarded by lock */
    atomic_bool give_up, in_op, follows;
    /* Used by the thread only. */
    void *bus;
    struct fsn_core *core;
    struct predecessor *predecessor; /**< its bus is taken over; NULL: none, or no longer */
    bool rests;                      /**< only the cycle accesses the bus */
    void *room;                      /**< where the core publishes its cycles; NULL: nowhere */
    size_t room_bytes;
    int room_fd;
    struct fsn_bus_subdevice *found; /**< result of the last bus that did not open */
    bool has_found;
};

static void put(struct queue *queue, struct fsn_job *job) {
    job->next = NULL;
    if (queue->first == NULL) {
        queue->first = job;
    } else {
        queue->last->next = job;
    }
    queue->last = job;
}

static struct fsn_job *take(struct queue *queue) {
    struct fsn_job *job = queue->first;
    queue->first = job != NULL ? job->next : NULL;
    return job;
}

static void wake(struct runner *runner) {
    const uint64_t one = 1;
    if (write(runner->wake, &one, sizeof one) < 0) {
        return; /* already counted */
    }
}

static void sleep_ns(uint64_t ns) {
    const struct timespec time = fsn_timespec(ns);
    clock_nanosleep(CLOCK_MONOTONIC, 0, &time, NULL);
}

/** Whether a retry may help: no SubDevice yet, or not all, or frames were late. */
static bool may_come(fsn_status status) {
    return status == FSN_E_BUS_MISSING || status == FSN_E_BUS_SILENT || status == FSN_E_BUS_STATE ||
           status == FSN_E_BUS_CLOCK || status == FSN_E_BUS_MAILBOX;
}

/** Stores the data of the bus about each SubDevice of the plan, before it is closed. */
static void keep_findings(struct runner *runner) {
    const struct fsn_bus_ops *ops = runner->backend->ops;
    runner->has_found = false;
    for (uint32_t n = 0;
         runner->bus != NULL && ops->state != NULL && n < fsn_plan_subdevice_count(runner->plan);
         n++) {
        struct fsn_bus_subdevice *seen = &runner->found[n];
        *seen = (struct fsn_bus_subdevice){0};
        if (ops->state(runner->bus, n, seen) == FSN_OK) {
            runner->has_found = runner->has_found || seen->found != FSN_FOUND_UNKNOWN;
        }
    }
}

/** The refusal names the first SubDevice that differs from the plan; all of them are reported
 *  here. */
static void tell_findings(const struct runner *runner) {
    for (uint32_t n = 0; runner->has_found && n < fsn_plan_subdevice_count(runner->plan); n++) {
        struct fsn_subdevice_info info;
        const struct fsn_bus_subdevice *seen = &runner->found[n];
        if (seen->found > FSN_FOUND_RIGHT && seen->found != FSN_FOUND_ABSENT &&
            fsn_plan_subdevice(runner->plan, n, &info) == FSN_OK) {
            log_subdevice(FSN_LOG_WARNING, info.name, "%s%s%s", fsn_found_text(seen->found),
                          seen->detail[0] != 0 ? ": " : "", seen->detail);
        }
    }
}

static uint64_t cycle_of(const struct runner *runner) {
    const uint64_t given = runner->options->cycle_ns;
    return given != 0 ? given : fsn_plan_cycle_ns(runner->plan);
}

static fsn_status open_once(struct runner *runner, struct fsn_fault *fault) {
    const struct options *o = runner->options;
    const uint64_t cycle_ns = cycle_of(runner);
    const struct fsn_live_options live = {
        .interface = o->interface,
        .redundant = o->redundant,
        .xdp = o->xdp,
        .cycle_ns = cycle_ns,
        .receive_wait_ns = o->free_run ? 2 * cycle_ns : 0,
        .dc_every = o->dc_every,
        .dc_host = o->dc_host,
        .dc_shift_ns = o->dc_shift_ns,
        .dc_window_ns = o->dc_window_ns,
        .attach = runner->predecessor != NULL ? &runner->predecessor->attachment : NULL,
    };
    fsn_status status = runner->backend->create(&live, &runner->bus, fault);
    if (status == FSN_OK) {
        status =
            fsn_core_create(runner->plan, runner->backend->ops, runner->bus, &runner->core, fault);
    }
    if (status != FSN_OK) {
        keep_findings(runner);
        runner->backend->free(runner->bus);
        runner->bus = NULL;
    }
    return status;
}

static fsn_status open_bus(struct runner *runner, struct fsn_fault *fault) {
    /* Attaching does not disturb anything, and a late frame is not a reason to refuse. */
    const uint64_t least_ns = runner->predecessor != NULL ? attach_ns : 0;
    const uint64_t wait_ns = runner->options->wait_ns;
    const uint64_t until = fsn_now_ns() + (wait_ns > least_ns ? wait_ns : least_ns);
    char reported[FSN_DETAIL_BYTES] = "";
    for (int tries = 0;; tries++) {
        *fault = (struct fsn_fault){.copy_index = FSN_FAULT_NO_RECORD};
        const fsn_status status = open_once(runner, fault);
        if (status == FSN_OK || !may_come(status) || fsn_now_ns() >= until ||
            atomic_load(&runner->give_up)) {
            if (status != FSN_OK) {
                tell_findings(runner);
            }
            return status;
        }
        if (tries == 0 || strcmp(reported, fault->detail) != 0) { /* may change between attempts */
            snprintf(reported, sizeof reported, "%s", fault->detail);
            log_line(FSN_LOG_INFO, "%s%s%s; tries again", fsn_status_text(status),
                     fault->detail[0] != 0 ? ": " : "", fault->detail);
        }
        sleep_ns(RETRY_MS * UINT64_C(1000000));
    }
}

static uint64_t cycles_of(struct runner *runner) {
    struct fsn_statistics statistics = {0};
    const fsn_status status = fsn_core_snapshot(runner->core, &statistics, NULL, NULL);
    return status == FSN_OK ? statistics.cycles : 0;
}

/** From its first cycle on, an output has its stop value until a client writes it. The control
 *  thread, which writes the outputs later, does not have this core yet. */
static void set_stop_values(struct runner *runner) {
    struct fsn_symbol_info symbol;
    for (uint32_t i = 0; fsn_plan_symbol(runner->plan, i, &symbol) == FSN_OK; i++) {
        if ((symbol.stop_value != 0 || runner->predecessor != NULL) &&
            fsn_core_set_output(runner->core, i, symbol.stop_value) != FSN_OK) {
            continue; /* a copy owns it */
        }
    }
}

/** Waits for a cycle after number `before`: until then a snapshot is not valid. Returns whether the
 *  thread is a real-time thread. */
static bool first_cycle(struct runner *runner, uint64_t before) {
    struct fsn_statistics statistics = {.cycles = before};
    for (int ms = 0; ms < 5000 && statistics.cycles <= before; ms++) {
        sleep_ns(1000000);
        if (fsn_core_snapshot(runner->core, &statistics, NULL, NULL) != FSN_OK) {
            statistics.cycles = before;
        }
    }
    return statistics.realtime != 0;
}

/** Starts the cycle as well as the system permits; exactly as requested if the options require
 *  it. */
static fsn_status start_cycle(struct runner *runner, struct fsn_fault *fault,
                              struct runner_result *result) {
    const struct options *o = runner->options;
    /* The predecessor has ended: its bus is not given up because of scheduling. */
    const bool strict = o->policy_given && runner->predecessor == NULL;
    pid_t before[SCHEDULE_THREADS];
    pid_t after[SCHEDULE_THREADS];
    struct fsn_thread_options thread = {
        .cycle_ns = cycle_of(runner),
        .cpu = o->cpu,
        .priority = options_priority(o),
        .lock_memory = o->policy != POLICY_OTHER,
        .free_run = o->free_run,
        .follow_dc = true, /* if a frame carries the time */
        .dc_shift_ns = o->dc_shift_ns,
        .trace = o->trace,
    };
    const size_t known = schedule_threads(before);
    const uint64_t last = cycles_of(runner);
    fsn_status status = fsn_core_start(runner->core, &thread, fault);
    /* Locking memory needs a permission that a test machine may lack; without it the cycle is only
     * less reliable. */
    if (status == FSN_E_SYS && thread.lock_memory && !strict &&
        (fault->sys_errno == EPERM || fault->sys_errno == ENOMEM)) {
        thread.lock_memory = false;
        status = fsn_core_start(runner->core, &thread, fault);
    }
    if (status != FSN_OK) {
        return status;
    }
    result->locked = thread.lock_memory;
    int error = 0;
    const bool realtime = first_cycle(runner, last);
    /* The core starts its thread itself, so it is identified as the one that did not exist
     * before. */
    if (o->policy == POLICY_DEADLINE) {
        const pid_t cyclic = schedule_new_thread(before, known, after, schedule_threads(after));
        error = cyclic != 0 ? schedule_deadline(cyclic, thread.cycle_ns) : ESRCH;
    } else if (o->policy == POLICY_FIFO && !realtime) {
        error = EPERM;
    }
    /* Reports the policy in use, not the requested one. */
    result->policy = error == 0 ? o->policy : POLICY_OTHER;
    if (error != 0 && strict) {
        *fault = (struct fsn_fault){.status = FSN_E_SYS,
                                    .copy_index = FSN_FAULT_NO_RECORD,
                                    .sys_errno = error,
                                    .rule = "the cyclic thread gets no real-time scheduling"};
        return FSN_E_SYS;
    }
    return FSN_OK;
}

static void close_room(struct runner *runner) {
    if (runner->room != NULL) {
        munmap(runner->room, runner->room_bytes);
        close(runner->room_fd);
    }
    runner->room = NULL;
    runner->room_fd = -1;
}

static void close_bus(struct runner *runner) {
    fsn_core_free(runner->core);
    runner->core = NULL;
    runner->backend->free(runner->bus);
    runner->bus = NULL;
    runner->rests = false;
    close_room(runner);
}

/** Gives the core memory in which another process can follow its cycles. */
static fsn_status open_room(struct runner *runner) {
    if (runner->backend->ops->describe == NULL) {
        return FSN_OK;
    }
    runner->room_bytes = fsn_core_room_bytes(runner->core);
    const int fd = memfd_create("fsn-cycles", MFD_CLOEXEC);
    void *room = MAP_FAILED;
    if (fd >= 0 && ftruncate(fd, (off_t)runner->room_bytes) == 0) {
        room = mmap(NULL, runner->room_bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd,
                    0);
    }
    if (room == MAP_FAILED) {
        if (fd >= 0) {
            close(fd);
        }
        return FSN_E_SYS;
    }
    runner->room = room;
    runner->room_fd = fd;
    return fsn_core_share(runner->core, room);
}

/** Data for a successor. */
static void describe(struct runner *runner, struct runner_result *result) {
    result->attachment.lock = -1;
    result->room = runner->room_fd;
    result->room_bytes = runner->room_bytes;
    if (runner->room != NULL &&
        runner->backend->ops->describe(runner->bus, &result->attachment) != FSN_OK) {
        result->attachment = (struct fsn_bus_attachment){.lock = -1};
    }
}

/** One turn of a standby: discards the cyclic frames of the predecessor, which would fill the
 *  socket. */
static bool follow_on(void *self) {
    struct runner *runner = self;
    runner->backend->ops->discard(runner->bus);
    return !atomic_load(&runner->give_up);
}

static fsn_status follow(struct runner *runner, struct fsn_fault *fault) {
    /* Uses the priority of the cycle: it does nearly nothing until it must act. It creates the
     * cyclic thread, and is then an ordinary thread again. */
    const struct sched_param urgent = {.sched_priority = options_priority(runner->options)};
    if (urgent.sched_priority > 0) {
        (void)pthread_setschedparam(pthread_self(), SCHED_FIFO, &urgent);
    }
    atomic_store(&runner->follows, true);
    wake(runner);
    const fsn_status status =
        predecessor_follow(runner->predecessor, cycle_of(runner), follow_on, runner, fault);
    atomic_store(&runner->follows, false);
    return status;
}

/** Everything is prepared: ends the predecessor, and continues its cycle. All checks that may
 *  refuse have been done before. */
static fsn_status take_over(struct runner *runner, struct fsn_fault *fault,
                            struct fsn_statistics *last) {
    struct predecessor *predecessor = runner->predecessor;
    if (runner->options->policy != POLICY_OTHER) {
        (void)mlockall(MCL_CURRENT | MCL_FUTURE); /* takes time; fsn_core_start() reports errors */
    }
    if (fsn_room_read(predecessor->room, predecessor->room_bytes,
                      fsn_core_image_bytes(runner->core), NULL, NULL) == FSN_E_ARG) {
        return fsn_refuse_all(
            fault, FSN_E_STATE,
            "its version counts in another way; stop the bus, and start this one");
    }
    if (runner->options->standby) {
        FSN_TRY(follow(runner, fault));
        FSN_TRY(predecessor_kill(predecessor, options_priority(runner->options), fault));
    } else {
        FSN_TRY(predecessor_end(predecessor, fault));
    }
    runner->backend->ops->discard(runner->bus);
    return predecessor_continue(predecessor, runner->core, last);
}

/** Time without a sender. */
static void measure_gap(const struct runner *runner, const struct fsn_statistics *last,
                        struct runner_result *result) {
    struct fsn_cycle first;
    struct fsn_statistics now;
    if (fsn_core_record(runner->core, last->cycles + 1, &first, NULL, NULL) == FSN_OK) {
        result->gap_ns = first.now_ns - last->now_ns;
        result->gap_cycles = first.overruns + 1u;
    } else if (fsn_core_snapshot(runner->core, &now, NULL, NULL) == FSN_OK) {
        result->gap_cycles = now.overruns - last->overruns + 1;
        result->gap_ns = result->gap_cycles * cycle_of(runner);
    }
}

/** Starts the cycle on an open bus. */
static fsn_status begin_cycle(struct runner *runner, struct runner_result *result) {
    struct fsn_statistics last;
    struct fsn_fault *fault = &result->fault;
    set_stop_values(runner);
    FSN_TRY(fsn_core_keep(runner->core, runner->options->record_ns, RECORD_BYTES));
    FSN_TRY(open_room(runner));
    if (runner->predecessor == NULL) {
        return start_cycle(runner, fault, result);
    }
    FSN_TRY(take_over(runner, fault, &last));
    FSN_TRY(start_cycle(runner, fault, result));
    measure_gap(runner, &last, result);
    return FSN_OK;
}

static void job_open(struct runner *runner, struct runner_result *result) {
    struct fsn_fault *fault = &result->fault;
    result->status = open_bus(runner, fault);
    if (result->status == FSN_OK) {
        result->status = begin_cycle(runner, result);
        if (result->status != FSN_OK) {
            close_bus(runner);
        }
    }
    const struct sched_param usual = {.sched_priority = 0};
    (void)pthread_setschedparam(pthread_self(), SCHED_OTHER, &usual);
    runner->predecessor = NULL;
    describe(runner, result);
    result->environment = result->status == FSN_E_SYS || result->status == FSN_E_NOMEM;
    result->core = runner->core;
    result->found = result->status != FSN_OK && runner->has_found ? runner->found : NULL;
    if (result->status != FSN_OK && fault->rule == NULL) {
        fault->rule = fsn_status_text(result->status);
    }
}

static void tell_who_is_in_op(const struct runner *runner) {
    for (uint32_t n = 0; n < fsn_plan_subdevice_count(runner->plan); n++) {
        struct fsn_subdevice_info info;
        struct fsn_bus_subdevice seen;
        if (fsn_plan_subdevice(runner->plan, n, &info) == FSN_OK &&
            fsn_core_subdevice(runner->core, n, &seen) == FSN_OK &&
            (seen.al_status & ~FSN_AL_ERROR) == FSN_AL_OP) {
            log_line(FSN_LOG_WARNING, "SubDevice %.80s is still in OP", info.name);
        }
    }
}

/** The stop values were set before this request: they are sent in a few more cycles, and copying
 *  continues until the SubDevices have left OP. */
static void job_leave(struct runner *runner) {
    enum { CYCLES = 3 };
    const uint64_t bound = LEAVE_MS * UINT64_C(1000000) + CYCLES * cycle_of(runner);
    const uint64_t until = fsn_now_ns() + bound;
    const uint64_t sent = cycles_of(runner) + CYCLES;
    atomic_store(&runner->in_op, false);
    for (;;) {
        const uint64_t now = fsn_now_ns();
        const bool left = fsn_core_poll(runner->core, FSN_AL_SAFEOP, now);
        if (left && cycles_of(runner) >= sent) {
            return;
        }
        if (now >= until) {
            log_line(FSN_LOG_WARNING, left ? "the cycle stands still"
                                           : "not every SubDevice has left OP within 2 s");
            tell_who_is_in_op(runner);
            return;
        }
        sleep_ns(TEND_NS);
    }
}

static void work(struct runner *runner, enum runner_job job) {
    struct runner_result result = {.done = job, .core = runner->core};
    if (job == RUNNER_OPEN) {
        job_open(runner, &result);
    } else if (job == RUNNER_LEAVE) {
        job_leave(runner);
    } else if (job == RUNNER_REST || job == RUNNER_GO_ON) {
        runner->rests = job == RUNNER_REST;
        describe(runner, &result);
    } else {
        close_bus(runner);
        result.core = NULL;
    }
    pthread_mutex_lock(&runner->lock);
    runner->result = result;
    pthread_mutex_unlock(&runner->lock);
    wake(runner);
}

static void poll_bus(struct runner *runner) {
    const bool in_op = fsn_core_poll(runner->core, FSN_AL_OP, fsn_now_ns());
    if (in_op != atomic_exchange(&runner->in_op, in_op)) {
        wake(runner);
    }
}

/** Between two steps of a transfer: supervision continues, until another request arrives. */
static bool poll_between(void *self) {
    struct runner *runner = self;
    pthread_mutex_lock(&runner->lock);
    const bool goes_on = runner->job == RUNNER_IDLE && !runner->ending;
    pthread_mutex_unlock(&runner->lock);
    if (goes_on) {
        poll_bus(runner);
    }
    return goes_on;
}

/** Executes one transfer, if one is waiting. */
static void do_transfer(struct runner *runner, bool polling) {
    const struct fsn_job_context context = {.core = polling ? runner->core : NULL,
                                            .ops = runner->backend->ops,
                                            .bus = runner->bus,
                                            .plan = runner->plan,
                                            .interface = runner->options->interface,
                                            .between = poll_between,
                                            .self = runner};
    pthread_mutex_lock(&runner->lock);
    struct fsn_job *job = take(&runner->waiting);
    pthread_mutex_unlock(&runner->lock);
    if (job == NULL) {
        return;
    }
    fsn_job_run(job, &context);
    pthread_mutex_lock(&runner->lock);
    put(&runner->done, job);
    pthread_mutex_unlock(&runner->lock);
    wake(runner);
}

/** Waits for a job; while a bus is polled, only briefly. */
static enum runner_job next_job(struct runner *runner, bool polling, bool *ending) {
    pthread_mutex_lock(&runner->lock);
    const struct timespec until = fsn_timespec(fsn_now_ns() + TEND_NS);
    int waited = 0;
    while (runner->job == RUNNER_IDLE && !runner->ending && waited == 0 &&
           (runner->rests || runner->waiting.first == NULL)) {
        waited = polling ? pthread_cond_timedwait(&runner->requested, &runner->lock, &until)
                         : pthread_cond_wait(&runner->requested, &runner->lock);
    }
    const enum runner_job job = runner->job;
    runner->job = RUNNER_IDLE;
    *ending = runner->ending;
    pthread_mutex_unlock(&runner->lock);
    return job;
}

static void *run(void *argument) {
    struct runner *runner = argument;
    bool polling = false;
    bool ending = false;
    while (!ending) {
        const enum runner_job job = next_job(runner, polling, &ending);
        if (job != RUNNER_IDLE) {
            work(runner, job);
            polling = (job == RUNNER_OPEN && runner->core != NULL) || job == RUNNER_GO_ON;
        }
        if (polling && !ending) {
            poll_bus(runner);
        }
        if (!runner->rests) {
            do_transfer(runner, polling && !ending);
        }
    }
    return NULL;
}

struct runner *runner_create(const struct options *options, const struct fsn_plan *plan,
                             const struct fsn_backend *backend, struct predecessor *predecessor) {
    struct runner *runner = calloc(1, sizeof *runner);
    if (runner == NULL) {
        return NULL;
    }
    runner->options = options;
    runner->plan = plan;
    runner->backend = backend;
    runner->predecessor = predecessor;
    runner->room_fd = -1;
    runner->found = calloc((size_t)fsn_plan_subdevice_count(plan) + 1, sizeof *runner->found);
    runner->wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    pthread_condattr_t attributes;
    pthread_mutex_init(&runner->lock, NULL);
    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_cond_init(&runner->requested, &attributes);
    pthread_condattr_destroy(&attributes);
    if (runner->wake < 0 || runner->found == NULL ||
        pthread_create(&runner->thread, NULL, run, runner) != 0) {
        free(runner->found);
        free(runner);
        return NULL;
    }
    return runner;
}

void runner_free(struct runner *runner) {
    if (runner == NULL) {
        return;
    }
    pthread_mutex_lock(&runner->lock);
    runner->ending = true;
    pthread_cond_signal(&runner->requested);
    pthread_mutex_unlock(&runner->lock);
    pthread_join(runner->thread, NULL);
    close(runner->wake);
    pthread_mutex_destroy(&runner->lock);
    pthread_cond_destroy(&runner->requested);
    free(runner->found);
    free(runner);
}

void runner_ask(struct runner *runner, enum runner_job job) {
    pthread_mutex_lock(&runner->lock);
    if (job == RUNNER_OPEN) {
        atomic_store(&runner->give_up, false);
    }
    runner->job = job;
    pthread_cond_signal(&runner->requested);
    pthread_mutex_unlock(&runner->lock);
}

void runner_give_up(struct runner *runner) {
    atomic_store(&runner->give_up, true);
}

int runner_fd(const struct runner *runner) {
    return runner->wake;
}

void runner_take(struct runner *runner, struct runner_result *result) {
    uint64_t count;
    if (read(runner->wake, &count, sizeof count) < 0) {
        count = 0; /* the SubDevice was absent; the result reports this */
    }
    pthread_mutex_lock(&runner->lock);
    *result = runner->result;
    runner->result = (struct runner_result){.done = RUNNER_IDLE};
    pthread_mutex_unlock(&runner->lock);
}

bool runner_follows(const struct runner *runner) {
    return atomic_load(&((struct runner *)runner)->follows);
}

bool runner_in_op(const struct runner *runner) {
    return atomic_load(&((struct runner *)runner)->in_op);
}

void runner_submit(struct runner *runner, struct fsn_job *job) {
    pthread_mutex_lock(&runner->lock);
    put(&runner->waiting, job);
    pthread_cond_signal(&runner->requested);
    pthread_mutex_unlock(&runner->lock);
}

struct fsn_job *runner_take_job(struct runner *runner) {
    pthread_mutex_lock(&runner->lock);
    struct fsn_job *job = take(&runner->done);
    pthread_mutex_unlock(&runner->lock);
    return job;
}
