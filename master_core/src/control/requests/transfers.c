/** Requests that become jobs. */
#define _POSIX_C_SOURCE 200809L /* strdup */

#include <stdlib.h>
#include <string.h>

#include "control/base/value.h"
#include "control/jobs/job.h"
#include "control/requests/request.h"
#include "control/survey/survey.h"
#include "plan/try.h"

static fsn_status read_number(struct fsn_request *request, size_t at, uint16_t bits,
                              uint64_t *number) {
    const char *wrong = fsn_value_parse_number(request->argument[at], bits, number);
    return wrong == NULL
               ? FSN_OK
               : fsn_request_refuse(request, FSN_E_ARG, "decimal, or with 0x, 0o or 0b before it",
                                    "%.60s is %s", request->argument[at], wrong);
}

static fsn_status read_subdevice(struct fsn_request *request, struct fsn_job *job) {
    struct fsn_subdevice_info info;
    for (uint32_t n = 0; fsn_plan_subdevice(request->services->view.plan, n, &info) == FSN_OK;
         n++) {
        if (strcmp(info.name, request->argument[0]) == 0) {
            job->subdevice = n;
            return FSN_OK;
        }
    }
    return fsn_request_refuse(request, FSN_E_ARG, "subdevices lists the names",
                              "%.100s: the plan has no such SubDevice", request->argument[0]);
}

static fsn_status read_object(struct fsn_request *request, struct fsn_job *job) {
    uint64_t index = 0;
    uint64_t sub = 0;
    FSN_TRY(read_number(request, 1, 16, &index));
    FSN_TRY(read_number(request, 2, 8, &sub));
    job->index = (uint16_t)index;
    job->sub = (uint8_t)sub;
    return FSN_OK;
}

static fsn_status read_type(struct fsn_request *request, struct fsn_job *job, size_t at) {
    if (fsn_data_type_read(request->argument[at], &job->type)) {
        return FSN_OK;
    }
    return fsn_request_refuse(
        request, FSN_E_ARG,
        "bool int8 int16 int32 int64 uint8 uint16 uint32 uint64 real32 real64 string hex",
        "%.100s is not a type", request->argument[at]);
}

static fsn_status read_upload(struct fsn_request *request, struct fsn_job *job) {
    FSN_TRY(read_object(request, job));
    return request->count > 3 ? read_type(request, job, 3) : FSN_OK;
}

static fsn_status read_write(struct fsn_request *request, struct fsn_job *job) {
    FSN_TRY(read_object(request, job));
    FSN_TRY(read_type(request, job, 3));
    const char *why = fsn_guard_write(request->services->view.plan, job->subdevice, job->index,
                                      request->services->view.core != NULL);
    if (why != NULL) {
        return fsn_request_refuse(request, FSN_E_CLOSED,
                                  "this program writes no safety objects and no mapping",
                                  "0x%04x of %.80s: %s", job->index, request->argument[0], why);
    }
    job->data = malloc(strlen(request->argument[4]) + 8);
    if (job->data == NULL) {
        return fsn_request_refuse(request, FSN_E_NOMEM, NULL, "out of memory");
    }
    const char *wrong =
        fsn_data_parse(&job->type, request->argument[4], job->data, &job->data_bytes);
    return wrong == NULL ? FSN_OK
                         : fsn_request_refuse(request, FSN_E_ARG, NULL, "%.60s as %.10s is %s",
                                              request->argument[4], request->argument[3], wrong);
}

static fsn_status read_alias(struct fsn_request *request, struct fsn_job *job) {
    uint64_t alias = 0;
    FSN_TRY(read_number(request, 1, 16, &alias));
    job->alias = (uint16_t)alias;
    return FSN_OK;
}

static const struct {
    const char *name;
    enum fsn_job_kind kind;
    fsn_status (*read)(struct fsn_request *request,
                       struct fsn_job *job); /**< in addition to the SubDevice; or NULL */
} kinds[] = {
    {"sdo-read", FSN_JOB_READ, read_upload}, {"sdo-write", FSN_JOB_WRITE, read_write},
    {"sii-read", FSN_JOB_SII, NULL},         {"alias-write", FSN_JOB_ALIAS, read_alias},
    {"history", FSN_JOB_HISTORY, NULL},      {"scan", FSN_JOB_SCAN, NULL},
};

static fsn_status fill(struct fsn_request *request, struct fsn_job *job) {
    size_t i = 0;
    while (strcmp(kinds[i].name, request->name) != 0) {
        i++;
    }
    job->kind = kinds[i].kind;
    job->subdevice = FSN_NONE;
    if (request->count > 0) {
        FSN_TRY(read_subdevice(request, job));
    }
    return kinds[i].read != NULL ? kinds[i].read(request, job) : FSN_OK;
}

fsn_status fsn_answer_later(struct fsn_request *request) {
    struct fsn_job *job = calloc(1, sizeof *job);
    if (job == NULL) {
        return fsn_request_refuse(request, FSN_E_NOMEM, NULL, "out of memory");
    }
    atomic_init(&job->cancelled, false);
    job->client = request->client->number;
    fsn_status status = fill(request, job);
    job->json.limit_bytes = job->kind == FSN_JOB_SCAN ? FSN_SURVEY_BYTES : FSN_JOB_ANSWER_BYTES;
    if (status == FSN_OK && request->tag != NULL) {
        job->tag = strdup(request->tag);
        if (job->tag == NULL) {
            status = fsn_request_refuse(request, FSN_E_NOMEM, NULL, "out of memory");
        }
    }
    if (status == FSN_OK) {
        struct fsn_services *services = request->services;
        status = fsn_job_submit(&services->jobs, services->view.core, job, &request->refusal);
    }
    if (status != FSN_OK) {
        fsn_job_free(job);
        return status;
    }
    request->client->job = job;
    return FSN_OK;
}
