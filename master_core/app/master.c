#define _GNU_SOURCE

#include "app/master.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include "app/base/confine.h"
#include "app/base/explain.h"
#include "app/base/holder.h"
#include "app/base/notify.h"
#include "app/log/log.h"
#include "app/runner.h"
#include "app/takeover/handover_listener.h"
#include "app/takeover/predecessor.h"
#include "control/base/clock.h"
#include "control/base/names.h"
#include "control/base/peer.h"
#include "fsn/handover.h"

enum { END_MS = 10000 }; /**< maximum time for the end if the bus does not even open */

enum state { STOPPED, OPENING, RUNNING, LEAVING, CLOSING, FAILED };
static const enum fsn_program_state program_states[] = {
    FSN_PROGRAM_STOPPED,  FSN_PROGRAM_OPENING,  FSN_PROGRAM_RUNNING,
    FSN_PROGRAM_STOPPING, FSN_PROGRAM_STOPPING, FSN_PROGRAM_FAILED,
};

static const char *state_name(enum state state) {
    return fsn_program_state_name(program_states[state]);
}

struct master {
    const struct options *options;
    const struct fsn_plan *plan;
    const struct fsn_backend *backend;
    struct fsn_control *control;
    struct runner *runner;
    int signal_fd;
    enum state state;
    bool wanted;      /**< the bus should run */
    bool again;       /**< it must be stopped before it runs again */
    bool ending;      /**< the program should end */
    bool opened_once; /**< the cycle has run */
    bool ready;       /**< every SubDevice has reached OP since the bus was opened */
    bool was_ready;   /**< since the program began: the manager was notified */
    int code;         /**< exit code */
    char fault[1200];
    struct fsn_core *core;
    enum policy policy;
    bool locked;
    uint64_t started_ns, run_until_ns, end_until_ns;
    uint64_t watchdog_ns, watched_cycles;
    bool logs;                                  /**< there is an intervention log */
    bool log_fails;                             /**< reported: it cannot be written */
    bool log_limited;                           /**< reported: half of its limit is used */
    struct fsn_interventions interventions;     /**< its state in this turn */
    struct handover_listener handover_listener; /**< for the successor process */
    bool turns;                                 /**< the runner begins or ends a pause */
    const char *socket_path;
    struct predecessor *predecessor; /**< its bus is taken over; NULL: none, or the bus is ours */
    bool follows;                    /**< as standby */
    bool listener_waits;             /**< its control socket will also become ours */
    int (*taken)(void *self);
    void *self;
};

static void set_state(struct master *m, enum state state, enum fsn_log_level level,
                      const char *text) {
    char lines[256];
    m->state = state;
    snprintf(lines, sizeof lines, "STATUS=%s: %.200s", state_name(state), text);
    notify(lines);
    fsn_control_state_changed(m->control, level, text);
}

static enum fsn_program_state reported_state(const struct master *m) {
    if (m->state == RUNNING && !m->ready) {
        return FSN_PROGRAM_STARTING;
    }
    return m->follows ? FSN_PROGRAM_STANDBY : program_states[m->state];
}

static void host_status(void *self, struct fsn_control_status *status) {
    const struct master *m = self;
    const struct options *o = m->options;
    *status = (struct fsn_control_status){
        .state = reported_state(m),
        .standby_pid =
            m->handover_listener.state == HANDOVER_LISTENER_FOLLOWED ? m->handover_listener.pid : 0,
        .standby_held = m->handover_listener.held,
        .fault = m->fault[0] != 0 ? m->fault : NULL,
        .backend = m->backend->name,
        .interface = o->interface,
        .bus_interfaces = o->bus_interfaces,
        .redundant = o->redundant,
        .xdp = o->xdp,
        .plan_file = o->plan_file,
        .accepted = o->accepted != NULL ? o->accepted : o->acceptance,
        .acceptance = o->acceptance,
        .acceptance_said = o->acceptance_said,
        .interventions = m->logs ? &m->interventions : NULL,
        .require_observed = o->require_observed,
        .policy = policy_name(m->policy),
        .started_ns = m->started_ns,
        .cycle_ns = o->cycle_ns,
        .cpu = o->cpu,
        .priority = m->policy == POLICY_FIFO ? options_priority(o) : 0,
        .free_run = o->free_run,
    };
}

static void begin_end(struct master *m, const char *why) {
    if (m->ending) {
        return;
    }
    m->ending = true;
    m->wanted = false;
    m->end_until_ns = fsn_now_ns() + END_MS * UINT64_C(1000000) + 4 * m->options->cycle_ns;
    notify("STOPPING=1");
    fsn_control_state_changed(m->control, FSN_LOG_INFO, why);
}

static fsn_status host_request(void *self, enum fsn_program_request request,
                               struct fsn_refusal *refusal) {
    struct master *m = self;
    const bool stopped = m->state == STOPPED || m->state == FAILED;
    if (m->ending) {
        return fsn_refusal_set(refusal, FSN_E_STATE, NULL, "the program is ending");
    }
    switch (request) {
    case FSN_PROGRAM_START:
        if (m->wanted) {
            return fsn_refusal_set(refusal, FSN_E_STATE, "restart stops it before", "the bus is %s",
                                   state_name(m->state));
        }
        m->wanted = true;
        return FSN_OK;
    case FSN_PROGRAM_STOP:
        if (stopped && !m->wanted) {
            return fsn_refusal_set(refusal, FSN_E_STATE, NULL, "the bus is stopped");
        }
        m->wanted = false;
        m->again = false;
        return FSN_OK;
    case FSN_PROGRAM_RESTART:
        m->wanted = true;
        m->again = !stopped;
        return FSN_OK;
    case FSN_PROGRAM_HOLD:
    case FSN_PROGRAM_RESUME:
        handover_listener_hold(&m->handover_listener, request == FSN_PROGRAM_HOLD);
        fsn_control_state_changed(m->control, FSN_LOG_WARNING,
                                  m->handover_listener.held ? "maintenance: no standby takes over"
                                                            : "a standby takes over again");
        return FSN_OK;
    default:
        begin_end(m, "a client requests the end");
        return FSN_OK;
    }
}

static void host_submit(void *self, struct fsn_job *job) {
    runner_submit(((struct master *)self)->runner, job);
}

static void host_log(void *self, enum fsn_log_level level, enum fsn_role account, const char *text,
                     const char *json, size_t json_bytes) {
    (void)self;
    log_event(level, account, text, json, json_bytes);
}

/** Takes the next step towards the requested state, unless a job is in progress. */
static void advance(struct master *m) {
    const bool leave = !m->wanted || m->again;
    if (m->turns) {
        return;
    }
    if (m->state == RUNNING && leave) {
        m->again = false;
        handover_listener_close(&m->handover_listener);
        fsn_control_close_outputs(m->control);
        set_state(m, LEAVING, FSN_LOG_INFO, "stops: SubDevices leave OP, copying continues");
        runner_ask(m->runner, RUNNER_LEAVE);
    } else if (m->state == OPENING && leave) {
        runner_give_up(m->runner);
    } else if ((m->state == STOPPED || m->state == FAILED) && m->wanted) {
        m->again = false;
        m->fault[0] = 0;
        m->ready = false;
        set_state(m, OPENING, FSN_LOG_INFO, "opens the bus");
        runner_ask(m->runner, RUNNER_OPEN);
    }
}

static bool lacks_permission(const struct runner_result *result) {
    return result->fault.sys_errno == EPERM || result->fault.sys_errno == EACCES;
}

static void failed(struct master *m, const struct runner_result *result) {
    char text[1280];
    explain_bus_fault(&result->fault, m->plan, m->options, m->fault, sizeof m->fault);
    const bool given_up = !m->wanted;
    m->wanted = false;
    m->follows = false;
    /* If the predecessor is alive the bus runs: this is not a failed bus. */
    if (m->options->standby && m->predecessor != NULL && !m->predecessor->ended) {
        snprintf(text, sizeof text, "the standby takes nothing over: %s", m->fault);
    } else if (m->predecessor != NULL && !m->predecessor->ended) {
        snprintf(text, sizeof text, "the take-over is refused, and process %d continues: %s",
                 (int)m->predecessor->pid, m->fault);
    } else {
        snprintf(text, sizeof text, "the bus does not open: %s", m->fault);
    }
    set_state(m, FAILED, FSN_LOG_ERROR, text);
    /* A bus that was abandoned on request needs no incident file. */
    if (!given_up) {
        fsn_control_bus_failed(m->control, m->fault, &result->fault, result->found);
    }
    if (!m->opened_once && !given_up) {
        /* At the start no client is connected that could repair it and retry. */
        m->code = EXIT_REFUSED;
        if (m->options->standby && result->status == FSN_E_BUS_BUSY) {
            m->code = EXIT_FINE;
        } else if (result->environment || lacks_permission(result)) {
            m->code = EXIT_ENVIRONMENT;
        }
        begin_end(m, "ends: the bus does not open");
    }
}

/** Warns that the kernel stops a real-time thread that never sleeps for a part of every second. */
static void warn_of_throttling(void) {
    FILE *file = fopen("/proc/sys/kernel/sched_rt_runtime_us", "re");
    long runtime_us = -1;
    if (file != NULL && fscanf(file, "%ld", &runtime_us) == 1 && runtime_us >= 0) {
        log_line(FSN_LOG_WARNING,
                 "free running in real time: the kernel stops it now and then, for it leaves only "
                 "%ld us of a period to real-time threads; sysctl kernel.sched_rt_runtime_us=-1 "
                 "ends that",
                 runtime_us);
    }
    if (file != NULL) {
        fclose(file);
    }
}

/** The predecessor has ended, and this process has its resources. */
static void took_over(struct master *m, const struct runner_result *result) {
    struct predecessor *predecessor = m->predecessor;
    struct fsn_refusal refusal;
    m->predecessor = NULL;
    m->follows = false;
    if (m->listener_waits) {
        m->listener_waits = false;
        if (fsn_control_adopt(m->control, predecessor->listener, m->socket_path, &refusal) !=
            FSN_OK) {
            log_line(FSN_LOG_ERROR, "no control socket: %s", refusal.text);
        }
        predecessor->listener = -1;
    }
    if (m->taken(m->self) != -1) {
        log_line(FSN_LOG_ERROR, "continues without it: the bus is more important");
    }
    log_line(FSN_LOG_WARNING,
             "took the bus over from process %d: %.3f ms and %llu cycles from its last frame to "
             "the first of this one",
             (int)predecessor->pid, (double)result->gap_ns / 1e6,
             (unsigned long long)result->gap_cycles);
    predecessor_release(predecessor);
}

static void opened(struct master *m, const struct runner_result *result) {
    char cycle[32];
    char text[256];
    if (result->status != FSN_OK) {
        failed(m, result);
        return;
    }
    if (m->predecessor != NULL) {
        took_over(m, result);
    }
    handover_listener_open(&m->handover_listener, result->attachment.lock);
    m->opened_once = true;
    m->core = result->core;
    m->policy = result->policy;
    m->locked = result->locked;
    fsn_control_attach(m->control, m->core);
    snprintf(cycle, sizeof cycle, "%.3f ms", (double)m->options->cycle_ns / 1e6);
    snprintf(text, sizeof text, "the cycle runs: %s, scheduling %s, memory %s",
             m->options->free_run ? "free, without waiting" : cycle, policy_name(m->policy),
             m->locked ? "locked" : "not locked");
    set_state(m, RUNNING, FSN_LOG_INFO, text);
    if (m->policy != m->options->policy) {
        log_line(FSN_LOG_WARNING, "no real-time scheduling: %s", explain_permission(m->options));
    }
    if (m->options->free_run && m->policy == POLICY_FIFO) {
        warn_of_throttling();
    }
    if (m->options->run_ns > 0 && m->run_until_ns == 0) {
        m->run_until_ns = fsn_now_ns() + m->options->run_ns;
    }
}

static void ask_rest(struct master *m, enum runner_job job) {
    m->turns = true;
    runner_ask(m->runner, job);
}

static void rested(struct master *m, const struct runner_result *result) {
    const struct handover_listener_gift gift = {.attachment = result->attachment,
                                                .listener = fsn_control_listener(m->control),
                                                .room = result->room,
                                                .room_bytes = result->room_bytes};
    m->turns = false;
    fsn_core_show_first(m->core, result->done == RUNNER_REST);
    if (result->done == RUNNER_REST &&
        handover_listener_give(&m->handover_listener, &gift) == HANDOVER_LISTENER_GO_ON) {
        ask_rest(m, RUNNER_GO_ON);
    }
}

/** The successor owns the bus. Slow work is done before the last cycle: a request of a client or a
 *  disk must not cause a gap on the bus. */
static void hand_over(struct master *m) {
    m->ending = true;
    fsn_control_state_changed(m->control, FSN_LOG_WARNING,
                              "hands the bus over to another process: every SubDevice stays in OP");
    fsn_control_flush(m->control, 100);
    notify("STOPPING=1");
    const bool differs = m->options->require_observed && fsn_control_differed(m->control);
    const int code = log_end(differs ? EXIT_DIFFERS : EXIT_FINE);
    fsn_core_stop(m->core);
    handover_listener_say_end(&m->handover_listener);
    _exit(code); /* the socket's file and the states of the bus stay unchanged */
}

static void serve_handover_listener(struct master *m, const struct pollfd *fds) {
    const bool in_op = m->state == RUNNING && m->wanted && !m->again && runner_in_op(m->runner);
    const struct handover_listener_facts facts = {
        .options = m->options, .plan = m->plan, .in_op = in_op};
    if (m->turns) {
        return;
    }
    switch (handover_listener_serve(&m->handover_listener, fds, &facts)) {
    case HANDOVER_LISTENER_REST:
        ask_rest(m, RUNNER_REST);
        return;
    case HANDOVER_LISTENER_GO_ON:
        ask_rest(m, RUNNER_GO_ON);
        return;
    case HANDOVER_LISTENER_END:
        hand_over(m);
        return;
    default:
        return;
    }
}

static void take_result(struct master *m) {
    char text[64];
    struct runner_result result;
    runner_take(m->runner, &result);
    /* Jobs first: their clients wait, and the state change below may close the bus. */
    for (struct fsn_job *job = runner_take_job(m->runner); job != NULL;
         job = runner_take_job(m->runner)) {
        fsn_control_job_done(m->control, job);
    }
    if (result.done == RUNNER_REST || result.done == RUNNER_GO_ON) {
        rested(m, &result);
    } else if (result.done == RUNNER_OPEN) {
        opened(m, &result);
    } else if (result.done == RUNNER_LEAVE) {
        fsn_control_attach(m->control, NULL);
        m->core = NULL;
        m->state = CLOSING;
        runner_ask(m->runner, RUNNER_CLOSE);
    } else if (result.done == RUNNER_CLOSE) {
        set_state(m, STOPPED, FSN_LOG_INFO, "the bus is closed");
    }
    /* A standby is ready when it follows: otherwise systemd would stop it while it waits. */
    if (m->state == OPENING && !m->follows && runner_follows(m->runner)) {
        m->follows = true;
        snprintf(text, sizeof text, "follows process %d as standby", (int)m->predecessor->pid);
        set_state(m, OPENING, FSN_LOG_INFO, text);
        notify("READY=1");
    }
    if (m->state == RUNNING && !m->ready && runner_in_op(m->runner)) {
        m->ready = true;
        set_state(m, RUNNING, FSN_LOG_INFO,
                  m->backend->ops->poll != NULL ? "ready: every SubDevice is in OP"
                                                : "ready: this bus has no states");
        /* systemd takes READY once; later starts of the bus are states of their own. */
        if (!m->was_ready) {
            m->was_ready = true;
            notify("READY=1");
        }
    }
}

static void take_signal(struct master *m) {
    struct signalfd_siginfo info;
    if (read(m->signal_fd, &info, sizeof info) != (ssize_t)sizeof info) {
        return;
    }
    if (m->ending) {
        log_line(FSN_LOG_ERROR, "a second signal: ends at once");
        _exit(log_end(EXIT_REFUSED));
    }
    char text[FSN_PEER_TEXT_BYTES + 64];
    char who[FSN_PEER_TEXT_BYTES];
    struct fsn_peer sender;
    fsn_peer_read(&sender, (pid_t)info.ssi_pid, info.ssi_uid);
    snprintf(text, sizeof text, "ends: %s, sent by %s", strsignal((int)info.ssi_signo),
             fsn_peer_text(&sender, who));
    begin_end(m, text);
}

static void watch_time(struct master *m, uint64_t now_ns) {
    if (m->run_until_ns != 0 && now_ns >= m->run_until_ns) {
        begin_end(m, "ends: the run time is over");
    }
    if (m->ending && now_ns >= m->end_until_ns) {
        log_line(FSN_LOG_ERROR, "the bus neither opens nor closes; ends without it");
        _exit(log_end(EXIT_REFUSED));
    }
    if (notify_watchdog_ns() == 0 || now_ns < m->watchdog_ns) {
        return;
    }
    struct fsn_statistics statistics = {0};
    if (m->core != NULL && fsn_core_snapshot(m->core, &statistics, NULL, NULL) != FSN_OK) {
        return;
    }
    if (m->core == NULL || statistics.cycles != m->watched_cycles) {
        m->watched_cycles = statistics.cycles;
        m->watchdog_ns = now_ns + notify_watchdog_ns() / 2;
        notify("WATCHDOG=1");
    }
}

/** Reports the intervention log when it stops or starts to be written, or to be limited. */
static void watch_log(struct master *m) {
    char text[320];
    m->logs = log_kept(&m->interventions);
    const struct fsn_interventions *log = &m->interventions;
    const bool fails = log->error != NULL;
    if (!m->logs || (fails == m->log_fails && log->limited == m->log_limited)) {
        return;
    }
    m->log_fails = fails;
    m->log_limited = log->limited;
    if (fails) {
        snprintf(text, sizeof text,
                 "the intervention log in %.150s is not written: %s; entries wait", log->folder,
                 log->error);
    } else if (log->limited) {
        snprintf(text, sizeof text,
                 "the intervention log in %.150s has %llu of at most %llu bytes: refused requests "
                 "are no longer logged; move old files away",
                 log->folder, (unsigned long long)log->bytes, (unsigned long long)log->limit_bytes);
    } else {
        snprintf(text, sizeof text, "the intervention log is written again; entries lost: %llu",
                 (unsigned long long)log->lost);
    }
    fsn_control_interventions_changed(
        m->control, fails || log->limited ? FSN_LOG_ERROR : FSN_LOG_WARNING, text);
}

static void turn(struct master *m) {
    enum { SIGNALS = FSN_CONTROL_FDS, RUNNER, HANDOVER, ALL = HANDOVER + HANDOVER_LISTENER_FDS };
    struct pollfd fds[ALL];
    uint64_t wait_ns;
    fsn_control_prepare(m->control, fds, &wait_ns);
    const struct timespec wait = fsn_timespec(wait_ns);
    fds[SIGNALS] = (struct pollfd){.fd = m->signal_fd, .events = POLLIN};
    fds[RUNNER] = (struct pollfd){.fd = runner_fd(m->runner), .events = POLLIN};
    handover_listener_prepare(&m->handover_listener, &fds[HANDOVER]);
    for (int i = 0; i < HANDOVER_LISTENER_FDS && m->turns; i++) {
        fds[HANDOVER + i].fd = -1; /* paused */
    }
    if (ppoll(fds, ALL, &wait, NULL) < 0) {
        return; /* interrupted */
    }
    if (fds[SIGNALS].revents != 0) {
        take_signal(m);
    }
    if (fds[RUNNER].revents != 0) {
        take_result(m);
    }
    serve_handover_listener(m, &fds[HANDOVER]);
    fsn_core_show_first(m->core, handover_listener_is_followed(&m->handover_listener));
    fsn_control_serve(m->control, fds, FSN_CONTROL_FDS);
    watch_time(m, fsn_now_ns());
    watch_log(m);
    advance(m);
}

static int listen_on(struct master *m, const char *path) {
    struct fsn_refusal refusal;
    if (fsn_control_listen(m->control, path, &refusal) == FSN_OK) {
        return -1;
    }
    char holder[HOLDER_TEXT_BYTES] = "";
    if (refusal.status == FSN_E_STATE && path[0] == '/') { /* a relative path is not unique */
        holder_text(path, holder);
    }
    log_line(FSN_LOG_ERROR, "%s; %s%s%s", refusal.text, refusal.hint,
             holder[0] != 0 ? "; it is " : "", holder);
    return refusal.status == FSN_E_STATE ? EXIT_REFUSED : EXIT_ENVIRONMENT;
}

static int keep_incidents(struct master *m) {
    struct fsn_refusal refusal;
    const char *folder = m->options->incidents;
    if (folder == NULL) {
        return -1;
    }
    if (fsn_control_keep_incidents(m->control, folder, (uint64_t)m->options->incidents_mib << 20,
                                   &refusal) == FSN_OK) {
        return -1;
    }
    log_line(FSN_LOG_ERROR, "%s; %s", refusal.text, refusal.hint != NULL ? refusal.hint : "");
    return EXIT_ENVIRONMENT;
}

/** Drops the capabilities of this thread, which reads requests; the thread of the bus has its
 *  own. */
static void give_up(const struct options *options) {
    if (options->confine && confine_thread() != 0) {
        log_line(FSN_LOG_WARNING, "the capabilities are kept: %s", strerror(errno));
    }
}

int master_run(const struct options *options, const struct fsn_plan *plan,
               const struct fsn_backend *backend, const char *socket_path, int signal_fd,
               struct predecessor *predecessor, int (*taken)(void *self), void *self) {
    struct master m = {.options = options,
                       .plan = plan,
                       .backend = backend,
                       .signal_fd = signal_fd,
                       .started_ns = fsn_now_ns(),
                       .wanted = true,
                       .socket_path = socket_path,
                       .predecessor = predecessor,
                       .taken = taken,
                       .self = self,
                       .policy = options->policy};
    const struct fsn_control_host host = {.self = &m,
                                          .status = host_status,
                                          .request = host_request,
                                          .submit = host_submit,
                                          .log = host_log};
    m.control = fsn_control_create(plan, &host, &options->access);
    if (m.control == NULL) {
        log_line(FSN_LOG_ERROR, "out of memory");
        return EXIT_ENVIRONMENT;
    }
    /* Before anything is opened: a successor may connect at any time. */
    handover_listener_init(&m.handover_listener);
    watch_log(&m);
    m.code = keep_incidents(&m);
    /* The predecessor still owns the socket with this path; it is taken over at the handover. */
    m.listener_waits = predecessor != NULL && fsn_control_is_at(predecessor->listener, socket_path);
    if (m.code == -1 && !m.listener_waits) {
        m.code = listen_on(&m, socket_path);
    }
    if (m.code == -1) {
        m.code = EXIT_FINE;
        m.runner = runner_create(options, plan, backend, predecessor);
        if (m.runner == NULL) {
            log_line(FSN_LOG_ERROR, "the thread for the bus cannot be started: %s",
                     strerror(errno));
            m.code = EXIT_ENVIRONMENT;
        }
    }
    /* After the socket and the threads, which need the permissions of the start. */
    give_up(options);
    while (m.runner != NULL && !(m.ending && (m.state == STOPPED || m.state == FAILED))) {
        advance(&m);
        turn(&m);
    }
    /* Only for an otherwise correct end: a fault has its own code. */
    if (m.code == EXIT_FINE && options->require_observed && fsn_control_differed(m.control)) {
        log_line(FSN_LOG_ERROR, "ends with %d: a connection had other parameters than the plan",
                 EXIT_DIFFERS);
        m.code = EXIT_DIFFERS;
    }
    /* Clients must get the last event before the process ends. */
    fsn_control_flush(m.control, 200);
    runner_free(m.runner);
    if (m.predecessor != NULL) {
        predecessor_release(m.predecessor);
    }
    fsn_control_free(m.control);
    return m.code;
}
