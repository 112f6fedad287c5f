#define _GNU_SOURCE

#include "incident.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "asked.h"
#include "incident_kept.h"
#include "job.h"

enum {
    BEFORE_MS = 5000,   /**< kept before the moment */
    AFTER_MS = 1000,    /**< and behind it */
    LATE_MS = 1000,     /**< longer nobody waits for a cycle behind that */
    PAUSE_MS = 10000,   /**< between two that nobody asked for, in the long run */
    AT_ONCE = 3,        /**< files without that pause: a second failure has its own */
    PATIENCE_MS = 5000, /**< in OP and not in Data for so long */
    ANSWER_MS = 2000,   /**< longer nobody waits for the FSoE values of the SubDevices */
    LOOK_MS = 500,      /**< between two looks for those */
    MOST_FILES = 100,   /**< of one run of the program, against a connection that flaps for days */
};

/** 0, or why this is no folder that one can write to. */
static int why_not(const char *folder) {
    struct stat found;
    if (stat(folder, &found) != 0) {
        return errno;
    }
    if (!S_ISDIR(found.st_mode)) {
        return ENOTDIR;
    }
    return access(folder, W_OK | X_OK) != 0 ? errno : 0;
}

fsn_status fsn_incidents_create(const char *folder, const struct fsn_plan *plan,
                                struct fsn_incidents **incidents, struct fsn_refusal *refusal) {
    const int error = why_not(folder);
    if (error != 0) {
        return fsn_refusal_set(refusal, FSN_E_SYS, "mkdir it, and let this user write there",
                               "incidents: %.200s is no folder to write to: %s", folder,
                               strerror(error));
    }
    struct fsn_incidents *in = calloc(1, sizeof *in);
    const uint32_t connections = fsn_plan_connection_count(plan);
    uint8_t *told = calloc((size_t)connections + 1, 1);
    uint8_t *refused = calloc((size_t)fsn_plan_subdevice_count(plan) + 1, 1);
    if (in == NULL || told == NULL || refused == NULL) {
        free(in);
        free(told);
        free(refused);
        return fsn_refusal_set(refusal, FSN_E_NOMEM, NULL, "out of memory");
    }
    snprintf(in->folder, sizeof in->folder, "%s", folder);
    in->most_bytes = FSN_INCIDENTS_BYTES;
    in->told = told;
    in->refused = refused;
    in->connections = connections;
    *incidents = in;
    return FSN_OK;
}

void fsn_incidents_free(struct fsn_incidents *incidents) {
    struct fsn_incident_result result;
    if (incidents == NULL) {
        return;
    }
    if (incidents->file != NULL) {
        fsn_incident_file_wait(incidents->file, &result);
    }
    for (size_t i = 0; i < FSN_INCIDENT_EVENTS; i++) {
        free(incidents->event[i]);
    }
    fsn_json_free(&incidents->fsoe);
    free(incidents->told);
    free(incidents->refused);
    free(incidents);
}

void fsn_incident_event(struct fsn_control *control, const char *json, size_t len_bytes) {
    struct fsn_incidents *in = control->incidents;
    if (in == NULL) {
        return;
    }
    char **place = &in->event[in->next_event++ % FSN_INCIDENT_EVENTS];
    free(*place);
    *place = strndup(json, len_bytes);
}

/** Names the file after when and what, with nothing a shell or a file system minds. */
static void put_stem(const struct fsn_pending *p, char *stem, size_t room_bytes) {
    char utc[32];
    size_t used = 0;
    fsn_utc_text(p->now_ns, utc);
    const char *what = p->connection[0] != 0  ? p->connection
                       : p->subdevice[0] != 0 ? p->subdevice
                                              : p->kind;
    char whole[200];
    snprintf(whole, sizeof whole, "incident-%.19sZ-%s", utc, what);
    for (const char *c = whole; *c != 0 && used + 1 < room_bytes && used < 100; c++) {
        const bool plain = (*c >= 'a' && *c <= 'z') || (*c >= 'A' && *c <= 'Z') ||
                           (*c >= '0' && *c <= '9') || *c == '-' || *c == '_';
        if (plain || (used > 0 && stem[used - 1] != '_')) {
            stem[used++] = *c;
            stem[used - 1] = plain ? *c : '_';
        }
    }
    stem[used] = 0;
}

/** The window is over: hands everything to the thread that writes. */
static void finish(struct fsn_control *control) {
    struct fsn_incidents *in = control->incidents;
    struct fsn_pending *p = &in->pending;
    struct fsn_json head = {.limit_bytes = FSN_INCIDENT_HEAD_BYTES};
    struct fsn_window window = {0};
    char stem[128];
    const uint64_t before_ns = BEFORE_MS * UINT64_C(1000000);
    if (in->job != NULL) {
        atomic_store(&in->job->cancelled, true);
        in->job = NULL; /* it is freed when it is done */
    }
    if (control->core != NULL && fsn_core_kept_cycles(control->core) > 0) {
        window = fsn_window_take(control->core, p->now_ns > before_ns ? p->now_ns - before_ns : 0);
    }
    fsn_incident_head(control, &head);
    p->active = false;
    fsn_json_free(&in->fsoe);
    put_stem(p, stem, sizeof stem);
    snprintf(in->text, sizeof in->text, "%s", p->text);
    if (head.failed) {
        fsn_json_free(&head);
        fsn_window_free(&window);
    } else {
        in->file = fsn_incident_file_begin(in->folder, stem, in->most_bytes, &head, &window);
    }
    if (in->file == NULL) {
        fsn_event_begin(control, "incident", fsn_now_ns());
        fsn_event_tell(control, FSN_LOG_ERROR, "an incident is not kept: no memory for it");
    }
}

static void tell_result(struct fsn_control *control, const struct fsn_incident_result *result) {
    struct fsn_incidents *in = control->incidents;
    struct fsn_json *json = fsn_event_begin(control, "incident", fsn_now_ns());
    fsn_json_put_text(json, "file", result->path);
    fsn_json_put_u64(json, "cycles", result->cycles);
    fsn_json_put_bool(json, "whole", result->error == 0);
    if (result->error == 0) {
        fsn_event_tell(control, FSN_LOG_WARNING, "incident: %.300s; fsoe-net incident %.150s",
                       in->text, result->path);
    } else if (result->full) {
        fsn_event_tell(control, FSN_LOG_ERROR,
                       "incident: %.200s; not kept, for the incident files in %.150s have %" PRIu64
                       " MiB; move some of them away, or start with a higher --incidents-limit",
                       in->text, in->folder, in->most_bytes >> 20);
    } else {
        fsn_event_tell(control, FSN_LOG_ERROR,
                       "incident: %.200s; %.150s ends after %" PRIu64 " cycles: %s", in->text,
                       result->path, result->cycles, strerror(result->error));
    }
}

/* -- beginning ------------------------------------------------------------------------------ */

/** In the long run one file each ten seconds, so that a connection that flaps does not fill the
 *  disk; a few may come at once. */
static bool is_too_soon(struct fsn_incidents *in, uint64_t now_ns) {
    const uint64_t pause_ns = PAUSE_MS * UINT64_C(1000000);
    if (in->due_ns > now_ns + (AT_ONCE - 1) * pause_ns) {
        return true;
    }
    in->due_ns = (in->due_ns > now_ns ? in->due_ns : now_ns) + pause_ns;
    return false;
}

static bool is_stopping(struct fsn_control *control) {
    struct fsn_control_status status = {0};
    control->host->status(control->host->self, &status);
    return strcmp(status.state, "stopping") == 0 || strcmp(status.state, "stopped") == 0;
}

static void copy_text(char *to, size_t room_bytes, const char *from) {
    snprintf(to, room_bytes, "%s", from != NULL ? from : "");
}

bool fsn_incident_begin(struct fsn_control *control, const struct fsn_trigger *t) {
    struct fsn_incidents *in = control->incidents;
    const bool asked = strcmp(t->kind, "request") == 0;
    if (in == NULL || in->pending.active ||
        (!asked && (is_stopping(control) || is_too_soon(in, t->now_ns)))) {
        return false;
    }
    if (in->files >= MOST_FILES) {
        if (!in->full_told) {
            fsn_event_begin(control, "incident", t->now_ns);
            fsn_event_tell(control, FSN_LOG_WARNING,
                           "%d incidents were kept since the start; no more will be", MOST_FILES);
        }
        in->full_told = true;
        return false;
    }
    struct fsn_pending *p = &in->pending;
    *p = (struct fsn_pending){.active = true,
                              .reset_code = t->reset_code,
                              .now_ns = t->now_ns,
                              .until_ns = t->now_ns + AFTER_MS * UINT64_C(1000000)};
    copy_text(p->kind, sizeof p->kind, t->kind);
    copy_text(p->connection, sizeof p->connection, t->connection);
    copy_text(p->subdevice, sizeof p->subdevice, t->subdevice);
    copy_text(p->before, sizeof p->before, t->before);
    copy_text(p->after, sizeof p->after, t->after);
    copy_text(p->reset_by, sizeof p->reset_by, t->reset_by);
    copy_text(p->reset_text, sizeof p->reset_text, t->reset_text);
    copy_text(p->text, sizeof p->text, t->text);
    if (control->core != NULL) {
        p->cycle = fsn_core_last_cycle(control->core);
    }
    in->job = control->core != NULL ? fsn_job_fsoe(control) : NULL;
    in->files++;
    return true;
}

void fsn_incident_subdevice(struct fsn_control *control, uint32_t number,
                            const struct fsn_bus_subdevice *seen, uint64_t now_ns) {
    struct fsn_incidents *in = control->incidents;
    const bool wrong = seen->found > FSN_FOUND_RIGHT;
    if (in == NULL || (!wrong && seen->al_status != FSN_AL_OP)) {
        return; /* it is led on, or tried again: the last word is not spoken */
    }
    const bool told = in->refused[number] != 0;
    in->refused[number] = wrong;
    if (!wrong || told) {
        return;
    }
    const struct fsn_subdevice_info info = fsn_known_subdevice(control->plan, number);
    char text[400];
    snprintf(text, sizeof text, "SubDevice %.120s: %s%s%s", info.name, fsn_found_text(seen->found),
             seen->detail[0] != 0 ? ": " : "", seen->detail);
    const struct fsn_trigger trigger = {
        .kind = "refused", .subdevice = info.name, .now_ns = now_ns, .text = text};
    (void)fsn_incident_begin(control, &trigger);
}

void fsn_incident_connection(struct fsn_control *control, uint32_t number, uint32_t outside) {
    if (control->incidents != NULL && fsn_outside_is_data(outside)) {
        control->incidents->told[number] = 1; /* from here on it can only leave Data */
    }
}

static void not_connected(struct fsn_control *control, uint32_t number, uint64_t now_ns) {
    const struct fsn_connection_info info = fsn_known_connection(control->plan, number);
    char text[300];
    const char *outside = fsn_outside_text(control->connections[number].outside);
    snprintf(text, sizeof text,
             "connection %.120s has not come to Data within %d s after every SubDevice reached OP, "
             "it is in %s",
             info.name, PATIENCE_MS / 1000, outside);
    const struct fsn_trigger trigger = {.kind = "not_connected",
                                        .connection = info.name,
                                        .after = outside,
                                        .now_ns = now_ns,
                                        .text = text};
    (void)fsn_incident_begin(control, &trigger);
}

/** Every SubDevice works and a connection does not: nobody else would say so. */
static void look_for_missing(struct fsn_control *control, uint64_t now_ns) {
    struct fsn_incidents *in = control->incidents;
    struct fsn_control_status status = {0};
    control->host->status(control->host->self, &status);
    if (control->core == NULL || strcmp(status.state, "running") != 0) {
        in->in_op_ns = 0;
        return;
    }
    in->in_op_ns = in->in_op_ns == 0 ? now_ns : in->in_op_ns;
    if (now_ns - in->in_op_ns < PATIENCE_MS * UINT64_C(1000000)) {
        return;
    }
    if (fsn_core_snapshot(control->core, NULL, control->connections, NULL) != FSN_OK) {
        return;
    }
    for (uint32_t i = 0; i < in->connections; i++) {
        fsn_incident_connection(control, i, control->connections[i].outside);
        if (in->told[i] == 0 && !in->pending.active) {
            in->told[i] = 1;
            not_connected(control, i, now_ns);
        }
    }
}

fsn_status fsn_answer_incident(struct fsn_asked *asked) {
    const char *text = asked->count > 0 ? asked->argument[0] : "a client asked for it";
    const struct fsn_trigger trigger = {.kind = "request", .now_ns = fsn_now_ns(), .text = text};
    if (asked->control->incidents == NULL) {
        return fsn_asked_refuse(asked, FSN_E_STATE, "start fsn-master with --incidents FOLDER",
                                "no incidents are kept");
    }
    if (!fsn_incident_begin(asked->control, &trigger)) {
        return fsn_asked_refuse(asked, FSN_E_BUSY,
                                "ask again in a few seconds; its event names the file",
                                "an incident is being kept, or a hundred were");
    }
    fsn_json_put_bool(asked->json, "begun", true);
    return FSN_OK;
}

void fsn_control_limit_incidents(struct fsn_control *control, uint64_t most_bytes) {
    if (control->incidents != NULL) {
        control->incidents->most_bytes = most_bytes;
    }
}

fsn_status fsn_control_keep_incidents(struct fsn_control *control, const char *folder,
                                      struct fsn_refusal *refusal) {
    return fsn_incidents_create(folder, control->plan, &control->incidents, refusal);
}

void fsn_control_bus_failed(struct fsn_control *control, const char *text,
                            const struct fsn_bus_subdevice *seen) {
    if (seen != NULL) {
        memcpy(control->seen.subdevice, seen,
               fsn_plan_subdevice_count(control->plan) * sizeof *seen);
        control->seen.known = true;
    }
    const struct fsn_trigger trigger = {.kind = "bus_failed", .now_ns = fsn_now_ns(), .text = text};
    (void)fsn_incident_begin(control, &trigger);
}

/** Where the cycle was held up as well, what it does next is of the window: the file waits for a
 *  cycle behind its end, but not for one that stands still. */
static bool is_over(struct fsn_control *control, uint64_t now_ns) {
    struct fsn_incidents *in = control->incidents;
    struct fsn_pending *p = &in->pending;
    const uint64_t patience_ns = in->job != NULL ? ANSWER_MS * UINT64_C(1000000) : 0;
    if (control->core == NULL) {
        return true;
    }
    if (now_ns < p->until_ns + patience_ns) {
        return false;
    }
    p->late_ns = p->late_ns == 0 ? now_ns : p->late_ns;
    return control->statistics.now_ns >= p->until_ns ||
           now_ns - p->late_ns >= LATE_MS * UINT64_C(1000000);
}

void fsn_incident_turn(struct fsn_control *control, uint64_t now_ns) {
    struct fsn_incidents *in = control->incidents;
    struct fsn_incident_result result;
    if (in == NULL) {
        return;
    }
    if (in->file != NULL && fsn_incident_file_done(in->file, &result)) {
        in->file = NULL;
        tell_result(control, &result);
    }
    if (now_ns - in->looked_ns >= LOOK_MS * UINT64_C(1000000)) {
        in->looked_ns = now_ns;
        look_for_missing(control, now_ns);
    }
    if (in->pending.active && in->file == NULL && is_over(control, now_ns)) {
        finish(control);
    }
}

void fsn_incident_job_done(struct fsn_control *control, struct fsn_job *job) {
    struct fsn_incidents *in = control->incidents;
    if (in == NULL || in->job != job) {
        return;
    }
    in->job = NULL;
    if (job->status == FSN_OK) {
        in->fsoe = job->json;
        job->json = (struct fsn_json){0};
    }
}

void fsn_incident_detach(struct fsn_control *control) {
    struct fsn_incidents *in = control->incidents;
    if (in != NULL) {
        if (in->pending.active) {
            struct fsn_incident_result result;
            if (in->file != NULL) {
                fsn_incident_file_wait(in->file, &result);
                in->file = NULL;
                tell_result(control, &result);
            }
            finish(control);
        }
        memset(in->told, 0, in->connections);
        memset(in->refused, 0, fsn_plan_subdevice_count(control->plan));
        in->in_op_ns = 0;
    }
}
