#define _POSIX_C_SOURCE 200809L /* strdup */

/** Requests that become jobs, and their answers. */
#include <stdlib.h>
#include <string.h>

#include "incident.h"
#include "internal.h"
#include "job.h"
#include "survey.h"
#include "value.h"

struct asked {
    struct fsn_control *control;
    const char *const *argument;
    size_t count;
    struct fsn_job *job;
    struct fsn_refusal *refusal;
};

static fsn_status refuse(const struct asked *a, const char *hint, const char *text,
                         const char *word) {
    return fsn_refusal_set(a->refusal, FSN_E_ARG, hint, "%.100s%s", word, text);
}

static fsn_status read_number(const struct asked *a, size_t at, uint16_t bits, uint64_t *number) {
    const struct fsn_symbol_info type = {.bits = bits, .kind = FSN_KIND_UNSIGNED};
    const char *wrong = fsn_value_parse(&type, a->argument[at], number);
    return wrong == NULL
               ? FSN_OK
               : fsn_refusal_set(a->refusal, FSN_E_ARG, "decimal, or with 0x, 0o or 0b before it",
                                 "%.60s is %s", a->argument[at], wrong);
}

static fsn_status read_subdevice(const struct asked *a) {
    struct fsn_subdevice_info info;
    for (uint32_t n = 0; fsn_plan_subdevice(a->control->plan, n, &info) == FSN_OK; n++) {
        if (strcmp(info.name, a->argument[0]) == 0) {
            a->job->subdevice = n;
            return FSN_OK;
        }
    }
    return refuse(a, "subdevices lists the names", ": the plan has no such SubDevice",
                  a->argument[0]);
}

static fsn_status read_object(const struct asked *a) {
    uint64_t index = 0;
    uint64_t sub = 0;
    fsn_status status = read_number(a, 1, 16, &index);
    status = status != FSN_OK ? status : read_number(a, 2, 8, &sub);
    a->job->index = (uint16_t)index;
    a->job->sub = (uint8_t)sub;
    return status;
}

static fsn_status read_type(const struct asked *a, size_t at) {
    if (fsn_data_type_read(a->argument[at], &a->job->type)) {
        return FSN_OK;
    }
    return refuse(a,
                  "bool int8 int16 int32 int64 uint8 uint16 uint32 uint64 real32 real64 string hex",
                  " is no type", a->argument[at]);
}

static fsn_status ask_read(const struct asked *a) {
    const fsn_status status = read_object(a);
    return status == FSN_OK && a->count > 3 ? read_type(a, 3) : status;
}

static fsn_status ask_write(const struct asked *a) {
    struct fsn_job *job = a->job;
    fsn_status status = read_object(a);
    status = status != FSN_OK ? status : read_type(a, 3);
    if (status != FSN_OK) {
        return status;
    }
    const char *why =
        fsn_guard_write(a->control->plan, job->subdevice, job->index, a->control->core != NULL);
    if (why != NULL) {
        return fsn_refusal_set(a->refusal, FSN_E_CLOSED,
                               "this program writes no safety objects and no mapping",
                               "0x%04x of %.80s: %s", job->index, a->argument[0], why);
    }
    job->data = malloc(strlen(a->argument[4]) + 8);
    if (job->data == NULL) {
        return fsn_refusal_set(a->refusal, FSN_E_NOMEM, NULL, "out of memory");
    }
    const char *wrong = fsn_data_parse(&job->type, a->argument[4], job->data, &job->data_bytes);
    return wrong == NULL ? FSN_OK
                         : fsn_refusal_set(a->refusal, FSN_E_ARG, NULL, "%.60s as %.10s is %s",
                                           a->argument[4], a->argument[3], wrong);
}

static fsn_status ask_alias(const struct asked *a) {
    uint64_t alias = 0;
    const fsn_status status = read_number(a, 1, 16, &alias);
    a->job->alias = (uint16_t)alias;
    return status;
}

static const struct {
    const char *name;
    enum fsn_job_kind kind;
    fsn_status (*ask)(const struct asked *asked); /**< beyond the SubDevice; or NULL */
} kinds[] = {
    {"sdo-read", FSN_JOB_READ, ask_read}, {"sdo-write", FSN_JOB_WRITE, ask_write},
    {"sii-read", FSN_JOB_SII, NULL},      {"alias-write", FSN_JOB_ALIAS, ask_alias},
    {"history", FSN_JOB_HISTORY, NULL},   {"scan", FSN_JOB_SCAN, NULL},
};

static fsn_status fill(const struct asked *a, const char *name) {
    size_t i = 0;
    while (strcmp(kinds[i].name, name) != 0) {
        i++;
    }
    a->job->kind = kinds[i].kind;
    fsn_status status = a->count > 0 ? read_subdevice(a) : FSN_OK;
    if (a->count == 0) {
        a->job->subdevice = FSN_NONE;
    }
    if (status == FSN_OK && kinds[i].ask != NULL) {
        status = kinds[i].ask(a);
    }
    return status;
}

static struct fsn_job **free_place(struct fsn_control *control) {
    for (size_t i = 0; i < FSN_JOBS; i++) {
        if (control->job[i] == NULL) {
            return &control->job[i];
        }
    }
    return NULL;
}

/** Hands it over; on a refusal it is still the caller's. */
static fsn_status submit(struct fsn_control *control, struct fsn_job *job,
                         struct fsn_refusal *refusal) {
    const struct fsn_control_host *host = control->host;
    struct fsn_job **place = free_place(control);
    if (control->core == NULL) {
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

fsn_status fsn_job_ask(struct fsn_control *control, struct fsn_client *client, const char *tag,
                       const char *name, const char *const *argument, size_t count,
                       struct fsn_refusal *refusal) {
    struct fsn_job *job = calloc(1, sizeof *job);
    if (job == NULL) {
        return fsn_refusal_set(refusal, FSN_E_NOMEM, NULL, "out of memory");
    }
    const struct asked asked = {control, argument, count, job, refusal};
    atomic_init(&job->cancelled, false);
    job->client = client->number;
    fsn_status status = fill(&asked, name);
    job->json.limit_bytes = job->kind == FSN_JOB_SCAN ? FSN_SURVEY_BYTES : FSN_CONTROL_OUT_BYTES;
    if (status == FSN_OK && tag != NULL) {
        job->tag = strdup(tag);
        if (job->tag == NULL) {
            status = fsn_refusal_set(refusal, FSN_E_NOMEM, NULL, "out of memory");
        }
    }
    status = status != FSN_OK ? status : submit(control, job, refusal);
    if (status != FSN_OK) {
        fsn_job_free(job);
        return status;
    }
    client->job = job;
    return FSN_OK;
}

struct fsn_job *fsn_job_fsoe(struct fsn_control *control) {
    struct fsn_refusal refusal;
    struct fsn_job *job = calloc(1, sizeof *job);
    if (job == NULL) {
        return NULL;
    }
    atomic_init(&job->cancelled, false);
    job->kind = FSN_JOB_FSOE;
    job->subdevice = FSN_NONE;
    job->json.limit_bytes = FSN_CONTROL_OUT_BYTES;
    if (submit(control, job, &refusal) != FSN_OK) {
        fsn_job_free(job);
        return NULL;
    }
    return job;
}

void fsn_job_forget(struct fsn_client *client) {
    if (client->job != NULL) {
        atomic_store(&client->job->cancelled, true);
        client->job = NULL;
    }
}

static void answer(struct fsn_client *client, struct fsn_job *job) {
    client->job = NULL;
    client->heard_ns = fsn_now_ns(); /* it was our turn until now */
    if (job->status == FSN_OK) {
        fsn_client_put_long(client, job->json.bytes, job->json.len_bytes);
    } else {
        fsn_reply_refusal(client, job->tag, &job->refusal);
    }
}

void fsn_control_job_done(struct fsn_control *control, struct fsn_job *job) {
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        struct fsn_client *client = &control->client[i];
        if (client->fd >= 0 && client->job == job) {
            answer(client, job);
        }
    }
    fsn_incident_job_done(control, job);
    for (size_t i = 0; i < FSN_JOBS; i++) {
        if (control->job[i] == job) {
            control->job[i] = NULL;
        }
    }
    fsn_job_free(job);
}
