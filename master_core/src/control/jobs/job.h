/** Requests that take time: queued by the control thread, done in the acyclic thread of the bus,
 *  answered later. */
#ifndef FSN_CONTROL_JOB_H
#define FSN_CONTROL_JOB_H

#include <stdatomic.h>
#include <stdbool.h>

#include "control/base/host.h"
#include "control/base/json.h"
#include "control/base/refusal.h"
#include "control/base/value.h"
#include "fsn/acyclic.h"
#include "fsn/core.h"
#include "fsn/plan.h"

enum { FSN_JOB_ANSWER_BYTES = 1 << 20 /**< longest answer except that of a scan */ };

enum fsn_job_kind {
    FSN_JOB_READ,
    FSN_JOB_WRITE,
    FSN_JOB_SII,
    FSN_JOB_ALIAS,
    FSN_JOB_HISTORY,
    FSN_JOB_SCAN,
    FSN_JOB_FSOE /**< for an incident, not for a client */
};

struct fsn_job {
    struct fsn_job *next; /**< for the queues of the program */
    enum fsn_job_kind kind;
    uint32_t client; /**< client that requested it */
    uint32_t subdevice;
    uint16_t index, alias;
    uint8_t sub;
    struct fsn_data_type type;
    uint8_t *data; /**< to be written */
    uint32_t data_bytes;
    char *tag;             /**< tag of the request, or NULL */
    atomic_bool cancelled; /**< no client waits for the answer any longer */
    uint64_t until_ns;     /**< aborted at this time; set when it begins; 0: never */
    struct fsn_json json;  /**< the line of the answer; FSN_JOB_FSOE: the array alone */
    fsn_status status;
    struct fsn_refusal refusal;
};

/** Resources of a job. All in the acyclic thread. */
struct fsn_job_context {
    struct fsn_core *core; /**< NULL: the bus is stopped by now */
    const struct fsn_bus_ops *ops;
    void *bus;
    const struct fsn_plan *plan;
    const char *interface;
    /** Called between two steps; false aborts it. */
    bool (*between)(void *self);
    void *self;
};

/** Runs the job; afterwards json, or status and refusal, are filled in. */
void fsn_job_run(struct fsn_job *job, const struct fsn_job_context *context);

void fsn_job_free(struct fsn_job *job);

/** Whether an object may be written, by plan and state of the bus.
 *  @return NULL, or the reason why not. */
const char *fsn_guard_write(const struct fsn_plan *plan, uint32_t subdevice, uint16_t index,
                            bool bus_runs);

/** Decodes a message of 0x10F3; false if it is invalid. */
bool fsn_history_message(const uint8_t *bytes, uint32_t size_bytes, uint32_t id,
                         struct fsn_json *json);

enum { FSN_JOBS = 32 /**< maximum of waiting, running and unanswered jobs together */ };

struct fsn_job_queue {
    const struct fsn_control_host *host;
    struct fsn_job *job[FSN_JOBS];
};

/** Submits a job; on a refusal the caller still owns it.
 *  @param[in] core  NULL: the bus is stopped, so the job is refused. */
fsn_status fsn_job_submit(struct fsn_job_queue *queue, const struct fsn_core *core,
                          struct fsn_job *job, struct fsn_refusal *refusal);

/** Requests the FSoE values of every planned SubDevice, for an incident; NULL: not possible now. */
struct fsn_job *fsn_job_submit_fsoe(struct fsn_job_queue *queue, const struct fsn_core *core);

/** A job is done and answered: removes and frees it. */
void fsn_job_remove(struct fsn_job_queue *queue, struct fsn_job *job);

#endif
