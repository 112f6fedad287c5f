#include "control/jobs/job.h"

#include <stdlib.h>

static struct fsn_job **place_of(struct fsn_job_queue *queue, const struct fsn_job *job) {
    for (size_t i = 0; i < FSN_JOBS; i++) {
        if (queue->job[i] == job) {
            return &queue->job[i];
        }
    }
    return NULL;
}

fsn_status fsn_job_submit(struct fsn_job_queue *queue, const struct fsn_core *core,
                          struct fsn_job *job, struct fsn_refusal *refusal) {
    const struct fsn_control_host *host = queue->host;
    struct fsn_job **place = place_of(queue, NULL);
    if (core == NULL) {
        return fsn_refusal_set(refusal, FSN_E_STATE, "send start first", "the bus is stopped");
    }
    if (host->submit == NULL) {
        return fsn_refusal_set(refusal, FSN_E_ABSENT, NULL, "this program does no transfers");
    }
    if (place == NULL) {
        return fsn_refusal_set(refusal, FSN_E_BUSY, "ask again later", "%d transfers are under way",
                               FSN_JOBS);
    }
    *place = job;
    host->submit(host->self, job);
    return FSN_OK;
}

struct fsn_job *fsn_job_submit_fsoe(struct fsn_job_queue *queue, const struct fsn_core *core) {
    struct fsn_refusal refusal;
    struct fsn_job *job = calloc(1, sizeof *job);
    if (job == NULL) {
        return NULL;
    }
    atomic_init(&job->cancelled, false);
    job->kind = FSN_JOB_FSOE;
    job->subdevice = FSN_NONE;
    job->json.limit_bytes = FSN_JOB_ANSWER_BYTES;
    if (fsn_job_submit(queue, core, job, &refusal) != FSN_OK) {
        fsn_job_free(job);
        return NULL;
    }
    return job;
}

void fsn_job_remove(struct fsn_job_queue *queue, struct fsn_job *job) {
    struct fsn_job **place = place_of(queue, job);
    if (place != NULL) {
        *place = NULL;
    }
    fsn_job_free(job);
}
