#define _GNU_SOURCE

#include "control/incidents/incidents.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "control/base/clock.h"
#include "control/base/names.h"
#include "control/incidents/kept.h"
#include "plan/plan_internal.h"

enum {
    BEFORE_MS = 5000,   /**< recorded before the moment */
    AFTER_MS = 1000,    /**< recorded after it */
    LATE_MS = 1000,     /**< longest wait for a cycle after that */
    PAUSE_MS = 10000,   /**< between two files that were not requested, in the long run */
    AT_ONCE = 3,        /**< files without that pause: a second failure has its own */
    PATIENCE_MS = 5000, /**< time in OP without Data */
    ANSWER_MS = 2000,   /**< longest wait for the FSoE values of the SubDevices */
    POLL_MS = 500,      /**< between two searches for incomplete connections */
    MOST_FILES = 100,   /**< of one run of the program, to limit a connection that flaps for days */
};

/** Returns 0, or the errno that explains why the folder is not writable. */
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

fsn_status fsn_incidents_create(const char *folder, uint64_t most_bytes, struct fsn_bus_view *view,
                                struct fsn_events *events, struct fsn_job_queue *jobs,
                                struct fsn_incidents **incidents, struct fsn_refusal *refusal) {
    const int error = why_not(folder);
    if (error != 0) {
        return fsn_refusal_set(refusal, FSN_E_SYS, "mkdir it, and let this user write there",
                               "incidents: %.200s is not a writable folder: %s", folder,
                               strerror(error));
    }
    struct fsn_incidents *in = calloc(1, sizeof *in);
    if (in == NULL) {
        return fsn_refusal_set(refusal, FSN_E_NOMEM, NULL, "out of memory");
    }
    *in = (struct fsn_incidents){
        .view = view, .events = events, .jobs = jobs, .most_bytes = most_bytes};
    snprintf(in->folder, sizeof in->folder, "%s", folder);
    in->connections = fsn_plan_connection_count(view->plan);
    if (!FSN_NEW(in->reported, in->connections) ||
        !FSN_NEW(in->refused, fsn_plan_subdevice_count(view->plan))) {
        fsn_incidents_free(in);
        return fsn_refusal_set(refusal, FSN_E_NOMEM, NULL, "out of memory");
    }
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
    free(incidents->reported);
    free(incidents->refused);
    free(incidents);
}

void fsn_incident_event(struct fsn_incidents *in, const char *json, size_t len_bytes) {
    if (in == NULL) {
        return;
    }
    char **place = &in->event[in->next_event++ % FSN_INCIDENT_EVENTS];
    free(*place);
    *place = strndup(json, len_bytes);
}

static bool is_plain(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_';
}

static const char *subject_of(const struct fsn_pending *p) {
    if (p->connection[0] != 0) {
        return p->connection;
    }
    return p->subdevice[0] != 0 ? p->subdevice : fsn_trigger_name(p->kind);
}

/** Names the file after time and cause, without characters that a shell or a file system treats
 *  specially: other characters become one '_', none at the start. */
static void put_stem(const struct fsn_pending *p, char *stem, size_t room_bytes) {
    char utc[32];
    char whole[200];
    size_t used = 0;
    fsn_utc_text(p->now_ns, utc);
    snprintf(whole, sizeof whole, "incident-%.19sZ-%s", utc, subject_of(p));
    char last = 0;
    for (const char *c = whole; *c != 0 && used + 1 < room_bytes; c++) {
        if (is_plain(*c) || last != '_') {
            last = is_plain(*c) ? *c : '_';
            stem[used++] = last;
        }
    }
    stem[used] = 0;
}

/** The window has ended: passes everything to the thread that writes. */
static void finish(struct fsn_incidents *in) {
    struct fsn_pending *p = &in->pending;
    struct fsn_json head = {.limit_bytes = FSN_INCIDENT_HEAD_BYTES};
    struct fsn_window window = {0};
    char stem[101];
    const uint64_t before_ns = BEFORE_MS * UINT64_C(1000000);
    if (in->job != NULL) {
        atomic_store(&in->job->cancelled, true);
        in->job = NULL; /* it is freed when it is done */
    }
    if (in->view->core != NULL && fsn_core_kept_cycles(in->view->core) > 0) {
        window = fsn_window_take(in->view->core, p->now_ns > before_ns ? p->now_ns - before_ns : 0);
    }
    fsn_incident_head(in, &head);
    p->active = false;
    fsn_json_free(&in->fsoe);
    put_stem(p, stem, sizeof stem);
    snprintf(in->text, sizeof in->text, "%s", p->text);
    if (head.failed != FSN_OK) {
        fsn_json_free(&head);
        fsn_window_free(&window);
    } else {
        in->file = fsn_incident_file_begin(in->folder, stem, in->most_bytes, &head, &window);
    }
    if (in->file == NULL) {
        fsn_event_begin_act(in->events, "incident", FSN_MAINTAINER);
        fsn_event_send(in->events, FSN_LOG_ERROR, "an incident is not kept: no memory for it");
    }
}

static void tell_result(struct fsn_incidents *in, const struct fsn_incident_result *result) {
    struct fsn_json *json = fsn_event_begin_act(in->events, "incident", FSN_MAINTAINER);
    fsn_json_put_text(json, "file", result->path);
    fsn_json_put_u64(json, "cycles", result->cycles);
    fsn_json_put_bool(json, "whole", result->error == 0);
    if (result->error == 0) {
        fsn_json_put_hex(json, "sha256", result->sha256, sizeof result->sha256);
        fsn_event_send(in->events, FSN_LOG_WARNING,
                       "incident: %.300s; fsoe-net log incident %.150s", in->text, result->path);
        return;
    }
    fsn_json_put_text(json, "sha256", NULL);
    if (result->full) {
        fsn_event_send(in->events, FSN_LOG_ERROR,
                       "incident: %.200s; not kept, for the incident files in %.150s have %" PRIu64
                       " MiB; move some of them away, or start with a higher --incidents-limit",
                       in->text, in->folder, in->most_bytes >> 20);
    } else {
        fsn_event_send(in->events, FSN_LOG_ERROR,
                       "incident: %.200s; %.150s ends after %" PRIu64 " cycles: %s", in->text,
                       result->path, result->cycles, strerror(result->error));
    }
}

/* -- beginning ------------------------------------------------------------------------------ */

/** In the long run one file every ten seconds, so that a connection that flaps does not fill the
 *  disk; a few are allowed at once. */
static bool is_too_soon(struct fsn_incidents *in, uint64_t now_ns) {
    return !fsn_pace_allows(&in->due_ns, now_ns, AT_ONCE, PAUSE_MS * UINT64_C(1000000));
}

static bool is_stopping(struct fsn_incidents *in) {
    const struct fsn_control_status status = fsn_program_status(in->view->host);
    return status.state == FSN_PROGRAM_STOPPING || status.state == FSN_PROGRAM_STOPPED;
}

static void copy_text(char *to, size_t room_bytes, const char *from) {
    snprintf(to, room_bytes, "%s", from != NULL ? from : "");
}

bool fsn_incident_begin(struct fsn_incidents *in, const struct fsn_trigger *t) {
    const bool requested = t->kind == FSN_REQUESTED;
    if (in == NULL || in->pending.active ||
        (!requested && (is_stopping(in) || is_too_soon(in, t->now_ns)))) {
        return false;
    }
    if (in->files >= MOST_FILES) {
        if (!in->full_reported) {
            fsn_event_begin_act(in->events, "incident", FSN_MAINTAINER);
            fsn_event_send(in->events, FSN_LOG_WARNING,
                           "%d incidents were kept since the start; later ones are not kept",
                           MOST_FILES);
        }
        in->full_reported = true;
        return false;
    }
    struct fsn_pending *p = &in->pending;
    *p = (struct fsn_pending){.active = true,
                              .kind = t->kind,
                              .reset_code = t->reset_code,
                              .now_ns = t->now_ns,
                              .until_ns = t->now_ns + AFTER_MS * UINT64_C(1000000)};
    copy_text(p->connection, sizeof p->connection, t->connection);
    copy_text(p->subdevice, sizeof p->subdevice, t->subdevice);
    copy_text(p->before, sizeof p->before, t->before);
    copy_text(p->after, sizeof p->after, t->after);
    copy_text(p->reset_by, sizeof p->reset_by, t->reset_by);
    copy_text(p->reset_text, sizeof p->reset_text, t->reset_text);
    copy_text(p->text, sizeof p->text, t->text);
    p->has_fault = t->fault != NULL;
    p->fault = t->fault != NULL ? *t->fault : p->fault;
    if (in->view->core != NULL) {
        p->cycle = fsn_core_last_cycle(in->view->core);
    }
    in->job = fsn_job_submit_fsoe(in->jobs, in->view->core);
    in->files++;
    return true;
}

void fsn_incident_subdevice(struct fsn_incidents *in, uint32_t number,
                            const struct fsn_bus_subdevice *seen, uint64_t now_ns) {
    const bool wrong = seen->found > FSN_FOUND_RIGHT && seen->found != FSN_FOUND_ABSENT;
    if (in == NULL || (!wrong && seen->al_status != FSN_AL_OP)) {
        return; /* it is still starting, or will be retried: not decided yet */
    }
    const bool reported = in->refused[number] != 0;
    in->refused[number] = wrong;
    if (!wrong || reported) {
        return;
    }
    const struct fsn_subdevice_info info = fsn_known_subdevice(in->view->plan, number);
    char text[400];
    snprintf(text, sizeof text, "SubDevice %.120s: %s%s%s", info.name, fsn_found_text(seen->found),
             seen->detail[0] != 0 ? ": " : "", seen->detail);
    const struct fsn_trigger trigger = {
        .kind = FSN_REFUSED, .subdevice = info.name, .now_ns = now_ns, .text = text};
    (void)fsn_incident_begin(in, &trigger);
}

void fsn_incident_connection(struct fsn_incidents *in, uint32_t number, uint32_t observed) {
    if (in != NULL && fsn_observed_is_data(observed)) {
        in->reported[number] = 1; /* from here on, it can only leave Data */
    }
}

static void not_connected(struct fsn_incidents *in, uint32_t number, uint64_t now_ns) {
    const struct fsn_connection_info info = fsn_known_connection(in->view->plan, number);
    char text[300];
    const char *observed = fsn_observed_text(in->view->connections[number].observed);
    snprintf(text, sizeof text,
             "connection %.120s has not come to Data within %d s after every SubDevice reached OP, "
             "it is in %s",
             info.name, PATIENCE_MS / 1000, observed);
    const struct fsn_trigger trigger = {.kind = FSN_NOT_CONNECTED,
                                        .connection = info.name,
                                        .after = observed,
                                        .now_ns = now_ns,
                                        .text = text};
    (void)fsn_incident_begin(in, &trigger);
}

/** Every SubDevice is in OP but a connection is not in Data: no other line reports this. */
static void find_missing(struct fsn_incidents *in, uint64_t now_ns) {
    const struct fsn_control_status status = fsn_program_status(in->view->host);
    if (in->view->core == NULL || status.state != FSN_PROGRAM_RUNNING) {
        in->in_op_ns = 0;
        return;
    }
    in->in_op_ns = in->in_op_ns == 0 ? now_ns : in->in_op_ns;
    if (now_ns - in->in_op_ns < PATIENCE_MS * UINT64_C(1000000)) {
        return;
    }
    if (fsn_core_snapshot(in->view->core, NULL, in->view->connections, NULL) != FSN_OK) {
        return;
    }
    for (uint32_t i = 0; i < in->connections; i++) {
        fsn_incident_connection(in, i, in->view->connections[i].observed);
        if (in->reported[i] == 0 && !in->pending.active) {
            in->reported[i] = 1;
            not_connected(in, i, now_ns);
        }
    }
}

/** If the cycle was also delayed, the following cycles belong to the window: the file waits for a
 *  cycle after its end, but not for a stopped cycle. */
static bool is_over(struct fsn_incidents *in, uint64_t now_ns) {
    struct fsn_pending *p = &in->pending;
    const uint64_t patience_ns = in->job != NULL ? ANSWER_MS * UINT64_C(1000000) : 0;
    if (in->view->core == NULL) {
        return true;
    }
    if (now_ns < p->until_ns + patience_ns) {
        return false;
    }
    p->late_ns = p->late_ns == 0 ? now_ns : p->late_ns;
    return in->view->statistics.now_ns >= p->until_ns ||
           now_ns - p->late_ns >= LATE_MS * UINT64_C(1000000);
}

void fsn_incident_turn(struct fsn_incidents *in, uint64_t now_ns) {
    struct fsn_incident_result result;
    if (in == NULL) {
        return;
    }
    if (in->file != NULL && fsn_incident_file_done(in->file, &result)) {
        in->file = NULL;
        tell_result(in, &result);
    }
    if (now_ns - in->polled_ns >= POLL_MS * UINT64_C(1000000)) {
        in->polled_ns = now_ns;
        find_missing(in, now_ns);
    }
    if (in->pending.active && in->file == NULL && is_over(in, now_ns)) {
        finish(in);
    }
}

void fsn_incident_job_done(struct fsn_incidents *in, struct fsn_job *job) {
    if (in == NULL || in->job != job) {
        return;
    }
    in->job = NULL;
    if (job->status == FSN_OK) {
        in->fsoe = job->json;
        job->json = (struct fsn_json){0};
    }
}

void fsn_incident_detach(struct fsn_incidents *in) {
    if (in != NULL) {
        if (in->pending.active) {
            struct fsn_incident_result result;
            if (in->file != NULL) {
                fsn_incident_file_wait(in->file, &result);
                in->file = NULL;
                tell_result(in, &result);
            }
            finish(in);
        }
        memset(in->reported, 0, in->connections);
        memset(in->refused, 0, fsn_plan_subdevice_count(in->view->plan));
        in->in_op_ns = 0;
    }
}
