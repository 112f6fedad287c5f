/** Jobs that were handed to the program and are not yet done. */
#ifndef FSN_CONTROL_JOB_QUEUE_H
#define FSN_CONTROL_JOB_QUEUE_H

#include "control/base/host.h"
#include "control/jobs/job.h"

enum { FSN_JOBS = 32 /**< waiting, running and not yet answered together */ };

struct fsn_job_queue {
    const struct fsn_control_host *host;
    struct fsn_job *job[FSN_JOBS];
};

/** Hands a job over; on a refusal it is still the caller's.
 *  @param[in] core  NULL: the bus is stopped, which refuses it. */
fsn_status fsn_job_submit(struct fsn_job_queue *queue, const struct fsn_core *core,
                          struct fsn_job *job, struct fsn_refusal *refusal);

/** Asks every planned SubDevice for its FSoE values, for an incident; NULL: not possible now. */
struct fsn_job *fsn_job_submit_fsoe(struct fsn_job_queue *queue, const struct fsn_core *core);

/** A job is done and answered: takes it out and frees it. */
void fsn_job_remove(struct fsn_job_queue *queue, struct fsn_job *job);

#endif
