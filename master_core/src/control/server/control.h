/** The control socket of fsn-master: requests of one line, replies of one JSON line.
 *
 *  Runs in one thread other than the cyclic one, with limits for everything, and accesses the cycle
 *  only through snapshot, output area and event ring of the core. Protocol:
 *  docs/reference/control-protocol.md. */
#ifndef FSN_CONTROL_H
#define FSN_CONTROL_H

#include <poll.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "control/base/host.h"
#include "control/base/peer.h"
#include "fsn/core.h"

struct fsn_control;

enum {
    FSN_CONTROL_SHARED = 64,  /**< clients at once */
    FSN_CONTROL_RESERVED = 4, /**< additional clients for operators and maintainers */
    FSN_CONTROL_CLIENTS = FSN_CONTROL_SHARED + FSN_CONTROL_RESERVED,
    FSN_CONTROL_FDS = FSN_CONTROL_CLIENTS + 1,
    FSN_CONTROL_ALLOWED = 16, /**< users and groups in the access list */
};

/** A user or group, and its role. */
struct fsn_control_allowed {
    uint32_t id; /**< uid or gid */
    enum fsn_role role;
};

/** Users that may connect, in addition to root and the user of this process, which are
 *  maintainers. */
struct fsn_control_access {
    struct fsn_control_allowed user[FSN_CONTROL_ALLOWED], group[FSN_CONTROL_ALLOWED];
    size_t users, groups;
};

/** Prepares it; nothing is opened. NULL if out of memory. All pointers must outlive it. */
struct fsn_control *fsn_control_create(const struct fsn_plan *plan,
                                       const struct fsn_control_host *host,
                                       const struct fsn_control_access *access);

/** Drops every client, removes the socket, frees. NULL is allowed. */
void fsn_control_free(struct fsn_control *control);

/** Opens the socket. A socket left by a dead process is replaced.
 *  @retval FSN_E_STATE  another process answers there.   @retval FSN_E_ARG  no path for a socket.
 *  @retval FSN_E_SYS    the system refused. */
fsn_status fsn_control_listen(struct fsn_control *control, const char *path,
                              struct fsn_refusal *refusal);

/** Continues with the socket of a process that has ended: clients connect to it as before. Closes
 *  `listener` on a refusal.   @retval  as fsn_control_listen(). */
fsn_status fsn_control_adopt(struct fsn_control *control, int listener, const char *path,
                             struct fsn_refusal *refusal);

/** Whether a listener is the socket with this path. */
bool fsn_control_is_at(int listener, const char *path);

/** Descriptor of the socket, for the successor. */
int fsn_control_listener(const struct fsn_control *control);

/** Records each connection that leaves Data, in files in this folder.
 *  @param[in] most_bytes  limit for the incident files in the folder, of all runs. When it is
 *      reached, no further file is written; files are never deleted.
 *  @retval FSN_E_SYS  not a writable folder.   @retval FSN_E_NOMEM  out of memory. */
fsn_status fsn_control_keep_incidents(struct fsn_control *control, const char *folder,
                                      uint64_t most_bytes, struct fsn_refusal *refusal);

/** The bus did not open, which is also an incident.
 *  @param[in] text   the reason in words.
 *  @param[in] fault  the same in numbers.
 *  @param[in] seen  the device found for each SubDevice of the plan; NULL: none. */
void fsn_control_bus_failed(struct fsn_control *control, const char *text,
                            const struct fsn_fault *fault, const struct fsn_bus_subdevice *seen);

/** There is a core now (NULL: no longer). It is polled until the next call with NULL. */
void fsn_control_attach(struct fsn_control *control, struct fsn_core *core);

/** Every output takes its stop value and is closed, until the next attach. */
void fsn_control_close_outputs(struct fsn_control *control);

/** Returns the descriptors to wait for, at most FSN_CONTROL_FDS, and the longest wait. */
size_t fsn_control_prepare(struct fsn_control *control, struct pollfd *fds, uint64_t *wait_ns);

/** Serves the results of poll(), polls the bus, takes outputs back from silent clients. */
void fsn_control_serve(struct fsn_control *control, const struct pollfd *fds, size_t count);

/** A job is done: answers it, and frees it. */
void fsn_control_job_done(struct fsn_control *control, struct fsn_job *job);

/** Sends subscribers and the log an event: the state of the program has changed. */
void fsn_control_state_changed(struct fsn_control *control, enum fsn_log_level level,
                               const char *text);

/** Sends subscribers and the log an event: writing of the intervention log has stopped or
 *  resumed. */
void fsn_control_interventions_changed(struct fsn_control *control, enum fsn_log_level level,
                                       const char *text);

/** Whether a connection has had parameters that differ from the plan since the program began. */
bool fsn_control_differed(const struct fsn_control *control);

/** Writes the remaining bytes to the clients, for at most `wait_ms`. */
void fsn_control_flush(struct fsn_control *control, int wait_ms);

/** Role of a user with these ids: the highest role of the user and of its groups. */
enum fsn_role fsn_control_role(const struct fsn_control_access *access, uid_t user,
                               const gid_t *groups, size_t count);

#endif
