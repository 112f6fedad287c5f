#include "control/jobs/job.h"

#include <stdlib.h>
#include <string.h>

#include "control/base/clock.h"
#include "control/survey/survey.h"
#include "plan/try.h"

enum {
    MOST_S = 60, /**< for any job except a scan */
    HISTORY = 0x10F3,
    FIRST_MESSAGE = 6,
    MESSAGE_ROOM = 4096,
};

/** A job being done. */
struct doing {
    struct fsn_job *job;
    const struct fsn_job_context *context;
    uint32_t abort_code; /**< of its last transfer */
};

static bool is_late(const struct fsn_job *job) {
    return job->until_ns != 0 && fsn_now_ns() >= job->until_ns;
}

static bool goes_on(void *self) {
    const struct doing *d = self;
    return !atomic_load(&d->job->cancelled) && !is_late(d->job) &&
           (d->context->between == NULL || d->context->between(d->context->self));
}

static const char *absent_text(enum fsn_job_kind kind) {
    switch (kind) {
    case FSN_JOB_SII:
    case FSN_JOB_ALIAS:
        return "this backend cannot read its SII; use the tools of its stack";
    case FSN_JOB_SCAN:
        return "this bus cannot be scanned";
    default:
        return "it has no objects (no CoE)";
    }
}

static fsn_status fault_text(struct fsn_job *job, const struct fsn_plan *plan, fsn_status status,
                             uint32_t abort_code) {
    struct fsn_subdevice_info info;
    const char *name =
        fsn_plan_subdevice(plan, job->subdevice, &info) == FSN_OK ? info.name : "the bus";
    struct fsn_refusal *r = &job->refusal;
    const unsigned sub = job->sub;
    switch (status) {
    case FSN_E_BUS_SDO:
        return fsn_refusal_set(r, status, "compare with the manual of the device",
                               "%.80s, 0x%04x:%02x: abort code 0x%08x%s%s", name, job->index, sub,
                               (unsigned)abort_code, abort_code != 0 ? ": " : "",
                               fsn_abort_text(abort_code));
    case FSN_E_BUS_MISSING:
        return fsn_refusal_set(r, status, "subdevices shows which ones answer", "%.80s: no answer",
                               name);
    case FSN_E_BUS_MAILBOX:
        return fsn_refusal_set(r, status,
                               "subdevices shows whether it answers; if so, send it again",
                               "%.80s, 0x%04x:%02x: no answer", name, job->index, sub);
    /* No CoE or no access to the SII: a property of device or bus, so that a retry would not
     * help. */
    case FSN_E_ABSENT:
        return fsn_refusal_set(r, status, NULL, "%.80s: %s", name, absent_text(job->kind));
    case FSN_E_BUS_STATE:
        return fsn_refusal_set(r, status, "subdevices shows its AL state",
                               "%.80s: its answer is invalid, or its mailbox is closed", name);
    /* The same status for a job that took too long and for a bus that was stopped in the
     * meantime. */
    case FSN_E_STATE:
        return is_late(job)
                   ? fsn_refusal_set(r, status, NULL, "%.80s: not done within %d s", name, MOST_S)
                   : fsn_refusal_set(r, status, "send start first",
                                     "the bus is stopped, or stopping");
    case FSN_E_SPACE:
        return fsn_refusal_set(r, status, NULL, "%.80s: longer than %d bytes", name,
                               job->kind == FSN_JOB_SCAN ? FSN_SURVEY_BYTES : FSN_SDO_BYTES);
    default:
        return fsn_refusal_set(r, status, NULL, "%.80s: %s", name, fsn_status_text(status));
    }
}

static struct fsn_transfer transfer_of(struct doing *d, uint8_t *data, uint32_t size_bytes) {
    return (struct fsn_transfer){.index = d->job->index,
                                 .sub = d->job->sub,
                                 .data = data,
                                 .size_bytes = size_bytes,
                                 .between = goes_on,
                                 .self = d};
}

static fsn_status read_object(struct doing *d) {
    struct fsn_job *job = d->job;
    const bool sii = job->kind == FSN_JOB_SII;
    uint8_t *room = malloc(FSN_SDO_BYTES);
    if (room == NULL) {
        return FSN_E_NOMEM;
    }
    struct fsn_transfer transfer = transfer_of(d, room, FSN_SDO_BYTES);
    const fsn_status status = sii ? fsn_core_sii_read(d->context->core, job->subdevice, &transfer)
                                  : fsn_core_upload(d->context->core, job->subdevice, &transfer);
    if (status == FSN_OK && sii) {
        fsn_json_put_hex(&job->json, "data", room, transfer.size_bytes);
        fsn_json_put_u64(&job->json, "bytes", transfer.size_bytes);
    } else if (status == FSN_OK) {
        fsn_data_write(&job->type, room, transfer.size_bytes, &job->json);
    }
    d->abort_code = transfer.abort_code;
    free(room);
    return status;
}

static fsn_status write_object(struct doing *d) {
    struct fsn_job *job = d->job;
    struct fsn_transfer transfer = transfer_of(d, job->data, job->data_bytes);
    const fsn_status status = fsn_core_download(d->context->core, job->subdevice, &transfer);
    d->abort_code = transfer.abort_code;
    fsn_json_put_u64(&job->json, "bytes", job->data_bytes);
    return status;
}

static fsn_status write_alias(struct doing *d) {
    fsn_json_put_u64(&d->job->json, "alias", d->job->alias);
    fsn_json_put_text(&d->job->json, "used", "after the next power-on of the SubDevice");
    return fsn_core_alias_write(d->context->core, d->job->subdevice, d->job->alias);
}

/** A byte of 0x10F3. */
static fsn_status read_byte(struct doing *d, uint8_t sub, uint8_t *byte) {
    uint8_t bytes[8] = {0};
    d->job->sub = sub;
    struct fsn_transfer transfer = transfer_of(d, bytes, sizeof bytes);
    const fsn_status status = fsn_core_upload(d->context->core, d->job->subdevice, &transfer);
    d->abort_code = transfer.abort_code;
    *byte = bytes[0];
    return status;
}

/** All messages, oldest first: they are in a ring of subindices whose newest is known. */
static fsn_status read_history(struct doing *d) {
    struct fsn_job *job = d->job;
    uint8_t most, newest;
    job->index = HISTORY;
    FSN_TRY(read_byte(d, 1, &most));
    FSN_TRY(read_byte(d, 2, &newest));
    const unsigned ring = most > 255 - FIRST_MESSAGE + 1 ? 255 - FIRST_MESSAGE + 1 : most;
    const unsigned first = newest >= FIRST_MESSAGE ? newest - FIRST_MESSAGE + 1u : 0;
    fsn_json_put_open(&job->json, "messages", '[');
    for (unsigned i = 0; i < ring && newest != 0; i++) {
        uint8_t message[MESSAGE_ROOM];
        job->sub = (uint8_t)(FIRST_MESSAGE + (first + i) % ring);
        struct fsn_transfer transfer = transfer_of(d, message, sizeof message);
        const fsn_status status = fsn_core_upload(d->context->core, job->subdevice, &transfer);
        if (status == FSN_OK) {
            (void)fsn_history_message(message, transfer.size_bytes, job->sub, &job->json);
        } else if (status != FSN_E_BUS_SDO) { /* an empty place may be refused */
            return status;
        }
        if (!goes_on(d)) {
            return FSN_E_STATE;
        }
    }
    fsn_json_close(&job->json, ']');
    return FSN_OK;
}

static struct fsn_survey survey_of(struct doing *d) {
    return (struct fsn_survey){.ops = d->context->ops,
                               .bus = d->context->bus,
                               .plan = d->context->plan,
                               .interface = d->context->interface,
                               .between = goes_on,
                               .self = d};
}

static fsn_status do_it(struct doing *d) {
    const struct fsn_survey survey = survey_of(d);
    switch (d->job->kind) {
    case FSN_JOB_WRITE:
        return write_object(d);
    case FSN_JOB_ALIAS:
        return write_alias(d);
    case FSN_JOB_HISTORY:
        return read_history(d);
    case FSN_JOB_SCAN:
        return fsn_survey_write(&survey, &d->job->json);
    case FSN_JOB_FSOE:
        return fsn_survey_planned_fsoe(&survey, &d->job->json);
    default:
        return read_object(d);
    }
}

/** Writes the answer for a client as a line; the FSoE values of an incident are written alone. */
static fsn_status write_answer(struct doing *d) {
    struct fsn_json *json = &d->job->json;
    if (d->job->kind == FSN_JOB_FSOE) {
        return do_it(d);
    }
    fsn_json_open(json, '{');
    fsn_json_put_bool(json, "ok", true);
    if (d->job->tag != NULL) {
        fsn_json_put_text(json, "tag", d->job->tag);
    }
    const fsn_status status = do_it(d);
    fsn_json_close(json, '}');
    fsn_json_end(json);
    return status;
}

void fsn_job_run(struct fsn_job *job, const struct fsn_job_context *context) {
    struct doing d = {.job = job, .context = context};
    job->status = FSN_E_STATE;
    job->until_ns = job->kind == FSN_JOB_SCAN ? 0 : fsn_now_ns() + MOST_S * UINT64_C(1000000000);
    if (atomic_load(&job->cancelled)) {
        return;
    }
    if (context->core != NULL) {
        job->status = write_answer(&d);
    }
    if (job->status == FSN_OK) {
        job->status = job->json.failed;
    }
    if (job->status != FSN_OK) {
        fault_text(job, context->plan, job->status, d.abort_code);
    }
}

void fsn_job_free(struct fsn_job *job) {
    if (job == NULL) {
        return;
    }
    fsn_json_free(&job->json);
    free(job->data);
    free(job->tag);
    free(job);
}
