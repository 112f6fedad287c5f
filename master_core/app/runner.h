/** The thread that opens the bus, polls it next to the cycle and closes it again. Its work may take
 *  seconds; the control thread sends a request, continues, and is woken at the end. */
#ifndef FSN_APP_RUNNER_H
#define FSN_APP_RUNNER_H

#include "app/base/backends.h"
#include "app/base/options.h"
#include "control/jobs/job.h"
#include "fsn/core.h"

struct runner;
struct predecessor;

enum runner_job {
    RUNNER_IDLE,
    RUNNER_OPEN,  /**< opens the bus, starts the cycle, brings it towards OP until the next job */
    RUNNER_LEAVE, /**< brings it to SAFEOP while the cycle continues, at most 2 s */
    RUNNER_CLOSE, /**< stops the cycle, closes the bus; the core is then freed */
    RUNNER_REST,  /**< only the cycle accesses the bus from now on; describes it */
    RUNNER_GO_ON  /**< ends the pause */
};

/** Result of the last job. */
struct runner_result {
    enum runner_job done;   /**< RUNNER_IDLE: none since the last call */
    fsn_status status;      /**< of RUNNER_OPEN */
    struct fsn_fault fault; /**< why it was refused */
    struct fsn_core *core;  /**< valid until RUNNER_CLOSE is requested */
    enum policy policy;     /**< the policy in use */
    bool locked;            /**< the memory is locked */
    bool environment;       /**< the system refused, not plan or bus */
    /** For RUNNER_OPEN and RUNNER_REST: for a successor; lock -1: the bus cannot be handed over. */
    struct fsn_bus_attachment attachment;
    int room;          /**< descriptor of the memory in which cycles are published; -1: none */
    size_t room_bytes; /**< its size */
    /** For RUNNER_OPEN of a bus that was taken over: from the last cycle of the predecessor to the
     *  first here. */
    uint64_t gap_ns, gap_cycles;
    /** If the bus did not open: the device found for each SubDevice of the plan, until RUNNER_OPEN
     *  is requested again; NULL: none. */
    const struct fsn_bus_subdevice *found;
};

/** Starts the thread.
 *  @param[in] predecessor  its bus is taken over at the first opening; NULL: none.
 *  @retval NULL  a system call failed. */
struct runner *runner_create(const struct options *options, const struct fsn_plan *plan,
                             const struct fsn_backend *backend, struct predecessor *predecessor);

/** Ends the thread; the bus must be closed. NULL is allowed. */
void runner_free(struct runner *runner);

/** Requests a job; the result of the previous one must have been taken. */
void runner_ask(struct runner *runner, enum runner_job job);

/** Stops retrying to open. */
void runner_give_up(struct runner *runner);

/** Accepts a job, to be done between two steps of the acyclic work. */
void runner_submit(struct runner *runner, struct fsn_job *job);

/** Returns a finished job; NULL: none. */
struct fsn_job *runner_take_job(struct runner *runner);

/** Readable if a result is available, or all SubDevices have reached OP. */
int runner_fd(const struct runner *runner);

/** Takes the result. */
void runner_take(struct runner *runner, struct runner_result *result);

/** Whether it follows the predecessor, as a standby. */
bool runner_follows(const struct runner *runner);

/** Whether every SubDevice is in OP; for a bus without states immediately. */
bool runner_in_op(const struct runner *runner);

#endif
