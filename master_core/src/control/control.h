/** The control socket of fsn-master: requests of one line, replies of one JSON line.
 *
 *  Runs in one thread that is not the cyclic one, bounded in everything, and reaches the cycle
 *  only through snapshot, output area and event ring of the core. Protocol:
 *  docs/reference/control-protocol.md. */
#ifndef FSN_CONTROL_H
#define FSN_CONTROL_H

#include <poll.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "fsn/core.h"
#include "refusal.h"

struct fsn_control;
struct fsn_job;

enum {
    FSN_CONTROL_PROTOCOL = 1, /**< version of the protocol; it grows by new words and keys */
    FSN_CONTROL_SHARED = 32,  /**< clients at once */
    FSN_CONTROL_RESERVED = 4, /**< more of them for root and the user of the program */
    FSN_CONTROL_CLIENTS = FSN_CONTROL_SHARED + FSN_CONTROL_RESERVED,
    FSN_CONTROL_OUT_BYTES = 1 << 20, /**< what a client may leave unread before it is dropped */
    FSN_CONTROL_FDS = FSN_CONTROL_CLIENTS + 1,
    FSN_INCIDENTS_BYTES = 1 << 30, /**< of incident files in a folder */
    FSN_CONTROL_ALLOWED = 16,      /**< users and groups that may be allowed */
};

/** What a client asks of the program around the socket. */
enum fsn_wish { FSN_WISH_START, FSN_WISH_STOP, FSN_WISH_RESTART, FSN_WISH_SHUTDOWN };

/** FSN_LOG_DETAIL: for subscribers and a log of records; too much for lines that people read. */
enum fsn_log_level { FSN_LOG_DETAIL, FSN_LOG_INFO, FSN_LOG_WARNING, FSN_LOG_ERROR };

/** What the program says about itself. Strings live until the next call. */
struct fsn_control_status {
    const char *state; /**< stopped, opening, starting, running, stopping or failed */
    const char *fault; /**< why it is stopped, or NULL */
    const char *backend, *interface, *redundant, *plan_file, *accepted;
    const char *policy;  /**< fifo, deadline or other, as it came to be */
    uint64_t started_ns; /**< start of the process, monotonic */
    uint64_t cycle_ns;   /**< bus cycle */
    int cpu;             /**< CPU number + 1; 0: not pinned */
    int priority;        /**< of the cyclic thread; 0: none */
    bool free_run;
};

/** The program around the socket. Called in the control thread only. */
struct fsn_control_host {
    void *self;
    void (*status)(void *self, struct fsn_control_status *status);
    fsn_status (*wish)(void *self, enum fsn_wish wish, struct fsn_refusal *refusal);
    /** `text` for people; `json` the event as subscribers get it, without its newline. */
    void (*log)(void *self, enum fsn_log_level level, const char *text, const char *json,
                size_t json_bytes);
    /** Takes a job, to be done in the acyclic thread of the bus and given back by
     *  fsn_control_job_done(); NULL: none are taken. */
    void (*submit)(void *self, struct fsn_job *job);
};

/** Who may connect beside root and the user this runs as. */
struct fsn_control_access {
    uid_t user[FSN_CONTROL_ALLOWED];
    gid_t group[FSN_CONTROL_ALLOWED];
    size_t users, groups;
};

/** Prepares it; nothing is opened. NULL when out of memory. All pointers must outlive it. */
struct fsn_control *fsn_control_create(const struct fsn_plan *plan,
                                       const struct fsn_control_host *host,
                                       const struct fsn_control_access *access);

/** Drops every client, removes the socket, frees. NULL is allowed. */
void fsn_control_free(struct fsn_control *control);

/** Opens the socket. One that a dead process left is replaced.
 *  @retval FSN_E_STATE  another process answers there.   @retval FSN_E_ARG  no path for a socket.
 *  @retval FSN_E_SYS    the system refused. */
fsn_status fsn_control_listen(struct fsn_control *control, const char *path,
                              struct fsn_refusal *refusal);

/** Keeps what happened around each connection that leaves Data, in files in this folder.
 *  @retval FSN_E_SYS  it is no folder one can write to.   @retval FSN_E_NOMEM  out of memory. */
fsn_status fsn_control_keep_incidents(struct fsn_control *control, const char *folder,
                                      struct fsn_refusal *refusal);

/** Writes no further file once those in the folder, of all runs, have so many bytes; nothing is
 * ever deleted. FSN_INCIDENTS_BYTES until this is called, after fsn_control_keep_incidents(). */
void fsn_control_limit_incidents(struct fsn_control *control, uint64_t most_bytes);

/** The bus did not open: that is an incident as well.
 *  @param[in] seen  what was found of each SubDevice of the plan; NULL: nothing. */
void fsn_control_bus_failed(struct fsn_control *control, const char *text,
                            const struct fsn_bus_subdevice *seen);

/** There is a core now (NULL: none any more). Until the next call with NULL it is looked at. */
void fsn_control_attach(struct fsn_control *control, struct fsn_core *core);

/** Every output takes its stop value and is closed, until the next attach. */
void fsn_control_close_outputs(struct fsn_control *control);

/** Says what to wait for: at most FSN_CONTROL_FDS descriptors, and for how long. */
size_t fsn_control_prepare(struct fsn_control *control, struct pollfd *fds, uint64_t *wait_ns);

/** Serves what poll() found, looks at the bus, takes back what silent clients hold. */
void fsn_control_serve(struct fsn_control *control, const struct pollfd *fds, size_t count);

/** A job is done: answers, and frees it. */
void fsn_control_job_done(struct fsn_control *control, struct fsn_job *job);

/** Tells subscribers and the log that the state of the program has changed. */
void fsn_control_state_changed(struct fsn_control *control, enum fsn_log_level level,
                               const char *text);

/** Writes what is still to be written to the clients, for at most `wait_ms`. */
void fsn_control_flush(struct fsn_control *control, int wait_ms);

/** Whether a user with these ids may connect. */
bool fsn_control_may(const struct fsn_control_access *access, uid_t user, gid_t group);

#endif
