/** The program around the control socket. */
#ifndef FSN_CONTROL_HOST_H
#define FSN_CONTROL_HOST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "control/base/peer.h"
#include "control/base/refusal.h"

struct fsn_job;

/** Requests of a client to the program around the socket. */
enum fsn_program_request {
    FSN_PROGRAM_START,
    FSN_PROGRAM_STOP,
    FSN_PROGRAM_RESTART,
    FSN_PROGRAM_SHUTDOWN,
    FSN_PROGRAM_HOLD,  /**< maintenance: the standby does not take over */
    FSN_PROGRAM_RESUME /**< the standby may take over again */
};

/** FSN_LOG_DETAIL: for subscribers and a log of records; too much for people to read. */
enum fsn_log_level { FSN_LOG_DETAIL, FSN_LOG_INFO, FSN_LOG_WARNING, FSN_LOG_ERROR };

/** State of the intervention log. */
struct fsn_interventions {
    const char *folder;
    uint64_t entry;       /**< number of the last written one; 0: none */
    const char *hash;     /**< SHA-256 of its line; empty: none */
    uint64_t waiting;     /**< entries to be written */
    uint64_t lost;        /**< entries of this run that could not be stored */
    uint64_t bytes;       /**< of all files in the folder */
    uint64_t limit_bytes; /**< limit of these; operators may fill three quarters, all others half */
    bool limited;         /**< half is full: entries about refused requests are omitted */
    const char *error;    /**< why entries cannot be written now, or NULL */
};

/** State of the program in replies; fsn_program_state_name() is its word. */
enum fsn_program_state {
    FSN_PROGRAM_STOPPED,
    FSN_PROGRAM_OPENING,
    FSN_PROGRAM_STARTING, /**< the cycle runs, but not all SubDevices are in OP */
    FSN_PROGRAM_RUNNING,
    FSN_PROGRAM_STOPPING,
    FSN_PROGRAM_FAILED,
    FSN_PROGRAM_STANDBY,
};

/** Data of the program about itself. Strings are valid until the next call. */
struct fsn_control_status {
    enum fsn_program_state state;
    const char *fault; /**< why it is stopped, or NULL */
    const char *backend, *interface, *redundant, *plan_file, *accepted;
    const char *const *bus_interfaces; /**< of each bus of the plan; NULL if it has only one */
    const char *policy;                /**< fifo, deadline or other: the policy in use */
    uint64_t started_ns;               /**< start of the process, monotonic */
    uint64_t cycle_ns;                 /**< bus cycle */
    int cpu;                           /**< CPU number + 1; 0: not pinned */
    int priority;                      /**< of the cyclic thread; 0: none */
    bool free_run;
    bool xdp; /**< sockets of this host do not see the frames of the cycle */
    const char *acceptance, *acceptance_said;      /**< signed record, and output of its check */
    const struct fsn_interventions *interventions; /**< NULL: none are logged */
    int standby_pid;                               /**< successor process; 0: none */
    bool standby_held;                             /**< maintenance: it does not take over */
    bool require_observed; /**< parameters that differ from the plan are an alarm */
};

/** The program around the socket. Called in the control thread only. */
struct fsn_control_host {
    void *self;
    void (*status)(void *self, struct fsn_control_status *status);
    fsn_status (*request)(void *self, enum fsn_program_request request,
                          struct fsn_refusal *refusal);
    /** `text` in words; `json` is the event for subscribers, without its newline; `account` is the
     *  role whose share of the intervention log it uses. */
    void (*log)(void *self, enum fsn_log_level level, enum fsn_role account, const char *text,
                const char *json, size_t json_bytes);
    /** Takes a job, to be done in the acyclic thread of the bus and returned by
     *  fsn_control_job_done(); NULL if no jobs are accepted. */
    void (*submit)(void *self, struct fsn_job *job);
};

#endif
