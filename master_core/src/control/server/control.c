/** Callbacks into the program between the turns of the socket. */
#include "control/server/control.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "control/base/clock.h"
#include "control/base/names.h"
#include "control/reports/reports.h"
#include "control/requests/client.h"
#include "control/requests/requests.h"
#include "control/server/server.h"
#include "plan/plan_internal.h"

/** Sends an event to incidents and subscribers. */
static void deliver(void *self, struct fsn_json *json) {
    struct fsn_control *control = self;
    fsn_incident_event(control->services.incidents, json->bytes, json->len_bytes);
    fsn_json_end(json);
    for (size_t i = 0; json->failed == FSN_OK && i < FSN_CONTROL_CLIENTS; i++) {
        if (control->client[i].events) {
            fsn_client_put(&control->client[i], json->bytes, json->len_bytes);
        }
    }
}

struct fsn_control *fsn_control_create(const struct fsn_plan *plan,
                                       const struct fsn_control_host *host,
                                       const struct fsn_control_access *access) {
    struct fsn_control *control = calloc(1, sizeof *control);
    if (control == NULL) {
        return NULL;
    }
    struct fsn_services *services = &control->services;
    control->access = access;
    control->listener = -1;
    services->jobs.host = host;
    services->client = control->client;
    services->clients = FSN_CONTROL_CLIENTS;
    services->line.limit_bytes = FSN_CLIENT_OUT_BYTES / 2;
    services->events = (struct fsn_events){.host = host,
                                           .json.limit_bytes = FSN_CLIENT_OUT_BYTES,
                                           .deliver = deliver,
                                           .self = control};
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        control->client[i].fd = -1;
    }
    if (!fsn_bus_view_init(&services->view, plan, host) ||
        !fsn_changes_init(&control->changes, &services->view, &services->events)) {
        fsn_control_free(control);
        return NULL;
    }
    return control;
}

void fsn_control_free(struct fsn_control *control) {
    if (control == NULL) {
        return;
    }
    struct fsn_services *services = &control->services;
    fsn_control_close_socket(control);
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        if (control->client[i].fd >= 0) {
            close(control->client[i].fd);
        }
        fsn_client_close_passed(&control->client[i]);
        fsn_json_free(&control->client[i].out);
        fsn_stream_end(&control->client[i]);
    }
    fsn_incidents_free(services->incidents);
    for (size_t i = 0; i < FSN_JOBS; i++) {
        fsn_job_free(services->jobs.job[i]);
    }
    fsn_json_free(&services->events.json);
    fsn_json_free(&services->line);
    fsn_changes_free(&control->changes);
    fsn_bus_view_free(&services->view);
    free(control);
}

void fsn_control_attach(struct fsn_control *control, struct fsn_core *core) {
    struct fsn_services *services = &control->services;
    if (core == NULL && services->view.core != NULL) {
        fsn_incident_detach(services->incidents);
    }
    fsn_bus_view_attach(&services->view, core);
    fsn_changes_reset(&control->changes);
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) { /* the cycle count restarts */
        control->client[i].stream.next = fsn_core_last_cycle(services->view.core) + 1;
        control->client[i].place = 0;
        control->client[i].begun = false;
    }
}

fsn_status fsn_control_keep_incidents(struct fsn_control *control, const char *folder,
                                      uint64_t most_bytes, struct fsn_refusal *refusal) {
    struct fsn_services *services = &control->services;
    return fsn_incidents_create(folder, most_bytes, &services->view, &services->events,
                                &services->jobs, &services->incidents, refusal);
}

void fsn_control_bus_failed(struct fsn_control *control, const char *text,
                            const struct fsn_fault *fault, const struct fsn_bus_subdevice *seen) {
    struct fsn_bus_view *view = &control->services.view;
    if (seen != NULL) {
        memcpy(view->subdevice, seen, fsn_plan_subdevice_count(view->plan) * sizeof *seen);
        view->subdevices_known = true;
    }
    const struct fsn_trigger trigger = {
        .kind = FSN_BUS_FAILED, .now_ns = fsn_now_ns(), .text = text, .fault = fault};
    (void)fsn_incident_begin(control->services.incidents, &trigger);
}

void fsn_control_close_outputs(struct fsn_control *control) {
    fsn_services_close_outputs(&control->services);
}

/** Adds the identity of a client; for one that has disconnected, only its number. */
static void put_client(const struct fsn_control *control, uint32_t number, struct fsn_json *json) {
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        if (control->client[i].fd >= 0 && control->client[i].number == number) {
            fsn_client_put_peer(&control->client[i], json);
            return;
        }
    }
    fsn_json_put_u64(json, "client", number);
}

/** Reports the result of a request to write into a SubDevice. */
static void report_written(struct fsn_control *control, const struct fsn_job *job) {
    struct fsn_services *services = &control->services;
    const bool alias = job->kind == FSN_JOB_ALIAS;
    if (!alias && job->kind != FSN_JOB_WRITE) {
        return;
    }
    const bool done = job->status == FSN_OK;
    const char *name = fsn_known_subdevice(services->view.plan, job->subdevice).name;
    char what[64];
    struct fsn_json *json = fsn_event_begin_act(&services->events, "written", FSN_MAINTAINER);
    put_client(control, job->client, json);
    fsn_json_put_text(json, "subdevice", name);
    if (alias) {
        fsn_json_put_u64(json, "alias", job->alias);
        snprintf(what, sizeof what, "alias %u", (unsigned)job->alias);
    } else {
        FSN_JSON_PUT(json, job, index, sub);
        fsn_json_put_hex(json, "data", job->data, job->data_bytes);
        snprintf(what, sizeof what, "0x%04x:%02x", (unsigned)job->index, (unsigned)job->sub);
    }
    fsn_json_put_text(json, "error", done ? NULL : fsn_status_name(job->status));
    fsn_event_send(&services->events, done ? FSN_LOG_INFO : FSN_LOG_WARNING,
                   "SubDevice %.120s, %s: %s%s, for client %u", name, what,
                   done ? "written" : "not written: ", done ? "" : job->refusal.text,
                   (unsigned)job->client);
}

void fsn_control_job_done(struct fsn_control *control, struct fsn_job *job) {
    report_written(control, job);
    for (size_t i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        struct fsn_client *client = &control->client[i];
        if (client->fd >= 0 && client->job == job) {
            fsn_reply_job(client, job);
        }
    }
    fsn_incident_job_done(control->services.incidents, job);
    fsn_job_remove(&control->services.jobs, job);
}

bool fsn_control_differed(const struct fsn_control *control) {
    return control->changes.differed;
}

void fsn_control_state_changed(struct fsn_control *control, enum fsn_log_level level,
                               const char *text) {
    struct fsn_events *events = &control->services.events;
    struct fsn_json *json = fsn_event_begin_act(events, "state", FSN_MAINTAINER);
    const enum fsn_program_state state = fsn_program_status(events->host).state;
    fsn_json_put_text(json, "state", fsn_program_state_name(state));
    fsn_event_send(events, level, "%.500s", text);
}

void fsn_control_interventions_changed(struct fsn_control *control, enum fsn_log_level level,
                                       const char *text) {
    struct fsn_events *events = &control->services.events;
    struct fsn_json *json = fsn_event_begin_act(events, "interventions", FSN_MAINTAINER);
    fsn_report_interventions(fsn_program_status(events->host).interventions, json);
    fsn_event_send(events, level, "%.500s", text);
}
