/** Requests that take time: queued by the control thread, done in the acyclic thread of the bus,
 *  answered later. */
#ifndef FSN_CONTROL_JOB_H
#define FSN_CONTROL_JOB_H

#include <stdatomic.h>

#include "control/base/json.h"
#include "control/base/object_value.h"
#include "control/base/refusal.h"
#include "fsn/acyclic.h"
#include "fsn/core.h"

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

#endif
