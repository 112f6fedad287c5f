/** Jobs that were submitted and are not yet done. */
#ifndef FSN_CONTROL_JOB_QUEUE_H
#define FSN_CONTROL_JOB_QUEUE_H

#include "control/base/host.h"
#include "control/jobs/job.h"

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
