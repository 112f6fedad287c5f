#include "control/incidents/changes.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "control/base/names.h"
#include "control/reports/reports.h"
#include "plan/plan_internal.h"

enum {
    POLL_MS = 20,       /**< between two polls of the SubDevices */
    WKC_MS = 1000,      /**< between two reports of single incomplete cycles */
    AGAIN_MS = 5000,    /**< between two lines about a connection that resets repeatedly */
    FOREIGN_MS = 60000, /**< between two lines about another MainDevice */
    DRAIN = 256,        /**< events of the core taken at once */
};

/** Transitions into and out of Data, and the first of several resets: people search for these. */
static enum fsn_log_level connection_level(struct fsn_changes *changes,
                                           const struct fsn_event *event, bool left, bool data) {
    uint64_t *reported_ns = &changes->reset_reported_ns[event->connection];
    if (left && !data) {
        *reported_ns = event->now_ns;
        return FSN_LOG_WARNING;
    }
    if (data) {
        *reported_ns = 0;
        return FSN_LOG_INFO;
    }
    if (event->after != FSN_OBSERVED_RESET ||
        (*reported_ns != 0 && event->now_ns - *reported_ns < AGAIN_MS * UINT64_C(1000000))) {
        return FSN_LOG_DETAIL;
    }
    const bool again = *reported_ns != 0;
    *reported_ns = event->now_ns;
    return again ? FSN_LOG_WARNING : FSN_LOG_INFO;
}

static void left_data(struct fsn_incidents *incidents, const struct fsn_event *event,
                      const char *name, const char *reset_by, const char *cause) {
    char text[300];
    snprintf(text, sizeof text, "connection %.120s left Data: %s%s", name,
             fsn_observed_text(event->after), cause);
    const struct fsn_trigger trigger = {
        .kind = FSN_LEFT_DATA,
        .connection = name,
        .before = fsn_observed_text(event->before),
        .after = fsn_observed_text(event->after),
        .reset_by = reset_by,
        .reset_text = reset_by != NULL ? fsn_reset_text(event->reset_code) : NULL,
        .reset_code = reset_by != NULL ? event->reset_code : 0,
        .now_ns = event->now_ns,
        .text = text};
    (void)fsn_incident_begin(incidents, &trigger);
}

static void connection_event(struct fsn_changes *changes, struct fsn_incidents *incidents,
                             const struct fsn_event *event) {
    const struct fsn_connection_info info =
        fsn_known_connection(changes->view->plan, event->connection);
    const bool reset = event->after == FSN_OBSERVED_RESET && event->by != 0;
    const char *by = NULL;
    char cause[120] = "";
    struct fsn_json *json = fsn_event_begin(changes->events, "connection", event->now_ns);
    fsn_json_put_text(json, "connection", info.name);
    fsn_json_put_text(json, "before", fsn_observed_text(event->before));
    fsn_json_put_text(json, "after", fsn_observed_text(event->after));
    if (reset) {
        by = event->by == FSN_TO_SUB + 1 ? "main" : "sub";
        fsn_json_put_text(json, "reset_by", by);
        fsn_json_put_u64(json, "reset_code", event->reset_code);
        fsn_json_put_text(json, "reset_text", fsn_reset_text(event->reset_code));
        snprintf(cause, sizeof cause, ", by the %s: %s", by, fsn_reset_text(event->reset_code));
    }
    const bool data = fsn_observed_is_data(event->after);
    /* If a group is removed, its connections also end. */
    const bool away = !data && (fsn_group_is_away(changes->view, info.main_subdevice) ||
                                fsn_group_is_away(changes->view, info.sub_subdevice));
    const bool left = fsn_observed_is_data(event->before) && !away;
    fsn_event_send(changes->events,
                   away ? FSN_LOG_DETAIL : connection_level(changes, event, left, data),
                   "connection %.120s: %s -> %s%s", info.name, fsn_observed_text(event->before),
                   fsn_observed_text(event->after), cause);
    fsn_incident_connection(incidents, event->connection, event->after);
    if (left && !data) {
        left_data(incidents, event, info.name, by, cause);
    }
}

/** Parameters differ from the plan; never suppressed, because a difference is reported once. */
static void parameters_event(struct fsn_changes *changes, const struct fsn_event *event) {
    const struct fsn_connection_info info =
        fsn_known_connection(changes->view->plan, event->connection);
    const struct fsn_parameters planned = fsn_planned_parameters(&info);
    struct fsn_json *json = fsn_event_begin(changes->events, "parameters", event->now_ns);
    fsn_json_put_text(json, "connection", info.name);
    fsn_report_parameters(json, "configured", &planned);
    fsn_report_parameters(json, "observed", &event->parameters);
    fsn_report_differs(json, event->differs);
    const bool alarm =
        event->differs != 0 && fsn_program_status(changes->view->host).require_observed;
    fsn_json_put_bool(json, "alarm", alarm);
    changes->differed |= event->differs != 0;
    char text[FSN_DIFFERS_BYTES];
    if (event->differs == 0) {
        fsn_event_send(changes->events, FSN_LOG_INFO,
                       "connection %.120s: its parameters are those of the plan again", info.name);
        return;
    }
    fsn_event_send(changes->events, alarm ? FSN_LOG_ERROR : FSN_LOG_WARNING,
                   "connection %.120s runs with other parameters than the plan: %s", info.name,
                   fsn_differs_text(event->differs, &planned, &event->parameters, text));
}

static bool same_subdevice(const struct fsn_bus_subdevice *a, const struct fsn_bus_subdevice *b) {
    return a->al_status == b->al_status && a->found == b->found && a->al_code == b->al_code &&
           a->returns == b->returns && strcmp(a->detail, b->detail) == 0 &&
           memcmp(a->link, b->link, sizeof a->link) == 0;
}

/** Lost, refused, wrong or in error; back in OP. Intermediate states, and links that are read one
 *  after another, are details. */
static enum fsn_log_level subdevice_level(const struct fsn_bus_subdevice *before,
                                          const struct fsn_bus_subdevice *after) {
    const bool wrong = after->found != FSN_FOUND_RIGHT && after->found != FSN_FOUND_UNKNOWN;
    if (after->found == FSN_FOUND_ABSENT || before->found == FSN_FOUND_ABSENT) {
        return FSN_LOG_DETAIL; /* its group is reported as a whole */
    }
    if (before->found == FSN_FOUND_UNKNOWN && !wrong && after->al_status == FSN_AL_NONE) {
        return FSN_LOG_DETAIL; /* at the start no AL state has been read yet */
    }
    const bool reported = after->detail[0] != 0 && strcmp(before->detail, after->detail) != 0;
    if ((after->al_status & FSN_AL_ERROR) != 0 || after->al_status == FSN_AL_NONE || wrong ||
        reported) {
        return FSN_LOG_WARNING;
    }
    /* People wait for OP; intermediate steps are details. */
    return after->al_status == FSN_AL_OP && before->al_status != FSN_AL_OP ? FSN_LOG_INFO
                                                                           : FSN_LOG_DETAIL;
}

static void put_links(const struct fsn_bus_subdevice *seen, char *text, size_t room_bytes) {
    size_t used = 0;
    for (unsigned port = 0; port < FSN_PORTS; port++) {
        if (seen->link[port] != 0) {
            used += (size_t)snprintf(text + used, room_bytes - used, "%s%u",
                                     used == 0 ? ", links at ports " : " ", port);
        }
    }
    if (used == 0) {
        snprintf(text, room_bytes, ", no link at any port");
    }
}

static void subdevice_event(struct fsn_changes *changes, uint32_t number,
                            const struct fsn_bus_subdevice *before,
                            const struct fsn_bus_subdevice *after, bool reported, uint64_t now_ns) {
    const struct fsn_subdevice_info info = fsn_known_subdevice(changes->view->plan, number);
    char from[24];
    char to[24];
    struct fsn_json *json = fsn_event_begin(changes->events, "subdevice", now_ns);
    fsn_json_put_text(json, "subdevice", info.name);
    fsn_json_put_text(json, "before", fsn_al_text(before->al_status, from));
    fsn_json_put_text(json, "after", fsn_al_text(after->al_status, to));
    fsn_json_put_u64(json, "al_code", after->al_code);
    fsn_json_put_u64(json, "found_code", after->found);
    fsn_json_put_text(json, "found", fsn_found_text(after->found));
    FSN_JSON_PUT(json, after, fsoe_address, detail, returns);
    fsn_json_put_bytes(json, "link", after->link, FSN_PORTS);
    char code[120] = "";
    if ((after->al_status & FSN_AL_ERROR) != 0) {
        snprintf(code, sizeof code, ", AL status code 0x%04x %s", (unsigned)after->al_code,
                 fsn_al_code_text(after->al_code));
    }
    char links[32] = "";
    if (memcmp(before->link, after->link, sizeof after->link) != 0) {
        put_links(after, links, sizeof links);
    }
    /* Absent by design but with an answer is a transitional state, not a fault. */
    const bool fine = after->found == FSN_FOUND_RIGHT || after->found == FSN_FOUND_UNKNOWN ||
                      (after->found == FSN_FOUND_ABSENT && after->al_status != FSN_AL_NONE);
    /* Before the first poll both states are 0, which would read as a loss. */
    const bool unread = fine && (before->al_status | after->al_status) == FSN_AL_NONE;
    const bool moved = before->al_status != after->al_status;
    fsn_event_send(changes->events, reported ? FSN_LOG_DETAIL : subdevice_level(before, after),
                   "SubDevice %.120s: %s%s%s%s%s%s%s%s%.150s", info.name,
                   unread ? "its AL state is not read yet" : from, moved ? " -> " : "",
                   moved ? to : "", code, links, fine ? "" : ", ",
                   fine ? "" : fsn_found_text(after->found), after->detail[0] != 0 ? ": " : "",
                   after->detail);
}

/** Reports one line for a bus that is completely lost or recovered. Returns whether it is. */
static bool whole_bus(struct fsn_changes *changes, uint32_t count, uint32_t lost, uint32_t back,
                      const char *detail, uint64_t now_ns) {
    if (count < 2 || (lost != count && back != count)) {
        return false;
    }
    struct fsn_json *json = fsn_event_begin(changes->events, "bus", now_ns);
    fsn_json_put_bool(json, "lost", lost == count);
    if (lost == count) {
        fsn_event_send(changes->events, FSN_LOG_WARNING,
                       "the bus is lost: none of %" PRIu32 " SubDevices answers%s%.150s", count,
                       detail[0] != 0 ? ": " : "", detail);
    } else {
        fsn_event_send(changes->events, FSN_LOG_INFO,
                       "the bus is back: all %" PRIu32 " SubDevices answer", count);
    }
    return true;
}

static void poll_ring(struct fsn_changes *changes, uint64_t now_ns) {
    struct fsn_bus_ring ring;
    if (fsn_core_ring(changes->view->core, &ring) != FSN_OK ||
        (ring.state == changes->ring.state && strcmp(ring.place, changes->ring.place) == 0)) {
        return;
    }
    const bool first = changes->ring.state == FSN_RING_UNKNOWN;
    struct fsn_json *json = fsn_event_begin(changes->events, "ring", now_ns);
    fsn_report_ring_keys(&ring, json);
    if (ring.state == FSN_RING_CLOSED) {
        fsn_event_send(changes->events, FSN_LOG_INFO, "the ring is closed%s",
                       first ? "" : " again");
    } else {
        fsn_event_send(changes->events, FSN_LOG_WARNING, "the ring %s%s: %.159s",
                       first ? "has been open since the start" : "is open",
                       ring.state == FSN_RING_ONE_WAY ? " in one direction" : "", ring.place);
    }
    changes->ring = ring;
}

static void poll_clocks(struct fsn_changes *changes, uint64_t now_ns) {
    struct fsn_bus_clocks clocks;
    if (fsn_core_clocks(changes->view->core, &clocks) != FSN_OK ||
        clocks.state == changes->clocks) {
        return;
    }
    const struct fsn_statistics *s = &changes->view->statistics;
    if ((clocks.state == FSN_CLOCKS_LOST || clocks.state == FSN_CLOCKS_UNKNOWN) &&
        s->expected_wkc > 0 && s->actual_wkc == 0) {
        return; /* no answer at all, which has a separate line */
    }
    const bool first = changes->clocks == FSN_CLOCKS_UNKNOWN;
    struct fsn_json *json = fsn_event_begin(changes->events, "clocks", now_ns);
    fsn_report_clocks_keys(&clocks, json);
    if (clocks.state == FSN_CLOCKS_APART) {
        fsn_event_send(changes->events, FSN_LOG_WARNING,
                       "the clocks are apart: %.159s; the window is %" PRIu32 " ns", clocks.place,
                       clocks.window_ns);
    } else if (clocks.state == FSN_CLOCKS_LOST) {
        fsn_event_send(changes->events, FSN_LOG_WARNING, "the clocks have no reference: %.159s",
                       clocks.place);
    } else if (clocks.state == FSN_CLOCKS_SYNCHRONOUS) {
        fsn_event_send(changes->events, FSN_LOG_INFO,
                       "the clocks are synchronous%s: all within %" PRIu32 " ns of %.63s",
                       first ? "" : " again", clocks.worst_ns, clocks.reference);
    } else {
        fsn_event_send(
            changes->events, FSN_LOG_INFO,
            "the clocks are unknown: no SubDevice to compare with %.63s is in SAFEOP or OP",
            clocks.reference);
    }
    changes->clocks = clocks.state;
}

/** A group is attached or removed, which is not a fault; or a device at its place is not
 *  accepted. */
static void poll_groups(struct fsn_changes *changes, bool first, uint64_t now_ns) {
    for (uint32_t n = 0; n < fsn_plan_group_count(changes->view->plan); n++) {
        const struct fsn_group_info info = fsn_known_group(changes->view->plan, n);
        struct fsn_seen_group *seen = &changes->group[n];
        const enum fsn_group_state state =
            fsn_group_state(changes->view->plan, n, changes->view->subdevice);
        const char *detail = changes->view->subdevice[info.first_subdevice].detail;
        const bool wrong = state == FSN_GROUP_WRONG;
        /* A wrong device is reported again when its reason changes. */
        if (!first && state == seen->state && (!wrong || strcmp(detail, seen->detail) == 0)) {
            continue;
        }
        struct fsn_json *json = fsn_event_begin(changes->events, "group", now_ns);
        fsn_json_put_text(json, "group", info.name);
        fsn_json_put_text(json, "place", info.place);
        fsn_json_put_text(json, "before", fsn_group_text(seen->state));
        fsn_json_put_text(json, "after", fsn_group_text(state));
        fsn_json_put_text(json, "detail", detail);
        /* The time from plugging in to OP is the figure that a tool changer needs. */
        const bool came = state == FSN_GROUP_THERE && seen->state == FSN_GROUP_COMING;
        char after[64] = "";
        if (came) {
            snprintf(after, sizeof after, ", %" PRIu64 " ms after it was found",
                     (now_ns - seen->coming_ns) / 1000000);
        }
        fsn_event_send(changes->events, wrong ? FSN_LOG_WARNING : FSN_LOG_INFO,
                       "group %.120s is %s%s%s%.150s", info.name,
                       wrong ? "absent" : fsn_group_text(state), after,
                       wrong ? ", something else is there: " : "", wrong ? detail : "");
        seen->coming_ns =
            state == FSN_GROUP_COMING && seen->state != FSN_GROUP_COMING ? now_ns : seen->coming_ns;
        seen->state = (uint8_t)state;
        memcpy(seen->detail, detail, sizeof seen->detail);
    }
}

static void poll_subdevices(struct fsn_changes *changes, struct fsn_incidents *incidents,
                            uint64_t now_ns) {
    if (now_ns - changes->polled_ns < POLL_MS * UINT64_C(1000000)) {
        return;
    }
    changes->polled_ns = now_ns;
    /* The place of an open ring explains the losses that follow. */
    poll_ring(changes, now_ns); /* before the SubDevices next to the gap */
    poll_clocks(changes, now_ns);
    const uint32_t count = fsn_plan_subdevice_count(changes->view->plan);
    uint32_t lost = 0;
    uint32_t back = 0;
    uint32_t always = 0;
    struct fsn_bus_subdevice after = {0};
    for (uint32_t i = 0; i < count; i++) {
        if (fsn_core_subdevice(changes->view->core, i, &after) != FSN_OK) {
            return; /* a bus without states */
        }
        const bool was = changes->view->subdevice[i].al_status != FSN_AL_NONE;
        /* Groups may be absent: their members do not count as a lost bus. */
        if (fsn_plan_group_of(changes->view->plan, i) != FSN_NONE) {
            continue;
        }
        always++;
        lost += changes->view->subdevices_known && was && after.al_status == FSN_AL_NONE;
        back += changes->view->subdevices_known && !was && after.al_status != FSN_AL_NONE;
    }
    after.detail[FSN_DETAIL_BYTES - 1] = 0;
    /* If all are lost at the same time, one event for the bus replaces one for each SubDevice. */
    const bool reported = whole_bus(changes, always, lost, back, after.detail, now_ns);
    for (uint32_t i = 0; fsn_core_subdevice(changes->view->core, i, &after) == FSN_OK; i++) {
        after.detail[FSN_DETAIL_BYTES - 1] = 0;
        const struct fsn_bus_subdevice before = changes->view->subdevice[i];
        changes->view->subdevice[i] = after;
        if (!changes->view->subdevices_known || !same_subdevice(&before, &after)) {
            subdevice_event(changes, i, &before, &after, reported, now_ns);
            fsn_incident_subdevice(incidents, i, &after, now_ns);
        }
    }
    poll_groups(changes, !changes->view->subdevices_known, now_ns);
    changes->view->subdevices_known = true;
}

static const char *plural(uint64_t number) {
    return number == 1 ? "" : "s";
}

/** Losses of the cycle since the last line as text; overruns and late replies indicate the
 *  cause. */
static void wkc_text(const struct fsn_changes *changes, const struct fsn_statistics *s, char *text,
                     size_t room_bytes) {
    const uint64_t late = s->counts.old_replies - changes->counts.old_replies;
    const uint64_t unsent = s->counts.unsent_frames - changes->counts.unsent_frames;
    const uint64_t left_out = s->overruns - changes->overruns;
    int len =
        snprintf(text, room_bytes,
                 "working counter %u of %u; since the last line %" PRIu64
                 " incomplete cycle%s, %" PRIu64 " frame%s not back in time",
                 (unsigned)s->actual_wkc, (unsigned)s->expected_wkc,
                 s->wkc_errors - changes->wkc_errors, plural(s->wkc_errors - changes->wkc_errors),
                 s->counts.lost_frames - changes->counts.lost_frames,
                 plural(s->counts.lost_frames - changes->counts.lost_frames));
    if (late > 0) {
        len += snprintf(text + len, room_bytes - (size_t)len,
                        ", %" PRIu64 " repl%s late: the cycle is short for this bus", late,
                        late == 1 ? "y" : "ies");
    }
    if (left_out > 0) {
        len += snprintf(text + len, room_bytes - (size_t)len,
                        ", %" PRIu64 " cycle%s left out: this machine came too late", left_out,
                        plural(left_out));
    }
    if (unsent > 0) {
        snprintf(text + len, room_bytes - (size_t)len, ", %" PRIu64 " frame%s not sent: %s", unsent,
                 plural(unsent), strerror((int)s->send_errno));
    }
}

static void poll_wkc(struct fsn_changes *changes, uint64_t now_ns) {
    const struct fsn_statistics *s = &changes->view->statistics;
    const bool incomplete = s->cycles > 0 && s->expected_wkc != s->actual_wkc;
    const bool turned = incomplete != changes->incomplete;
    const bool more = s->wkc_errors != changes->wkc_errors ||
                      s->counts.lost_frames != changes->counts.lost_frames ||
                      s->overruns != changes->overruns;
    /* A lost bus stays lost until the working counter is correct again. */
    const bool known = incomplete && s->actual_wkc == 0 && changes->wkc_lost;
    const bool due = !known && now_ns - changes->wkc_reported_ns >= WKC_MS * UINT64_C(1000000);
    if (!turned && (!more || !due)) {
        return;
    }
    char text[320];
    wkc_text(changes, s, text, sizeof text);
    struct fsn_json *json = fsn_event_begin(changes->events, "wkc", s->now_ns);
    fsn_json_put_bool(json, "complete", !incomplete);
    fsn_json_put_u64(json, "expected", s->expected_wkc);
    fsn_json_put_u64(json, "actual", s->actual_wkc);
    fsn_json_put_u64(json, "wkc_errors", s->wkc_errors);
    fsn_json_put_u64(json, "lost_frames", s->counts.lost_frames);
    fsn_event_send(changes->events, due ? FSN_LOG_WARNING : FSN_LOG_DETAIL, "%s", text);
    changes->incomplete = incomplete;
    if (due) {
        changes->wkc_errors = s->wkc_errors;
        changes->counts = s->counts;
        changes->overruns = s->overruns;
        changes->wkc_reported_ns = now_ns;
        changes->wkc_lost = incomplete && s->actual_wkc == 0;
    }
}

/** Another MainDevice sends on this bus: reported immediately, then at most once a minute. */
static void poll_foreign(struct fsn_changes *changes, uint64_t now_ns) {
    const struct fsn_statistics *s = &changes->view->statistics;
    if (s->counts.foreign_frames == changes->foreign_frames ||
        (changes->foreign_reported_ns != 0 &&
         now_ns - changes->foreign_reported_ns < FOREIGN_MS * UINT64_C(1000000))) {
        return;
    }
    struct fsn_json *json = fsn_event_begin(changes->events, "foreign", s->now_ns);
    fsn_json_put_u64(json, "foreign_frames", s->counts.foreign_frames);
    fsn_event_send(changes->events, FSN_LOG_WARNING,
                   "another MainDevice sends on this bus: %" PRIu64 " of its frames so far",
                   s->counts.foreign_frames);
    changes->foreign_frames = s->counts.foreign_frames;
    changes->foreign_reported_ns = now_ns;
}

bool fsn_changes_init(struct fsn_changes *changes, struct fsn_bus_view *view,
                      struct fsn_events *events) {
    *changes = (struct fsn_changes){.view = view, .events = events};
    return FSN_NEW(changes->reset_reported_ns, fsn_plan_connection_count(view->plan)) &&
           FSN_NEW(changes->group, fsn_plan_group_count(view->plan));
}

void fsn_changes_free(struct fsn_changes *changes) {
    free(changes->reset_reported_ns);
    free(changes->group);
}

void fsn_changes_reset(struct fsn_changes *changes) {
    const struct fsn_plan *plan = changes->view->plan;
    memset(changes->reset_reported_ns, 0,
           fsn_plan_connection_count(plan) * sizeof *changes->reset_reported_ns);
    memset(changes->group, 0, fsn_plan_group_count(plan) * sizeof *changes->group);
    *changes = (struct fsn_changes){.view = changes->view,
                                    .events = changes->events,
                                    .reset_reported_ns = changes->reset_reported_ns,
                                    .group = changes->group,
                                    .differed = changes->differed};
}

void fsn_changes_poll(struct fsn_changes *changes, struct fsn_incidents *incidents,
                      uint64_t now_ns) {
    if (changes->view->core == NULL) {
        return;
    }
    poll_subdevices(changes, incidents, now_ns);
    struct fsn_event event;
    for (int i = 0; i < DRAIN && fsn_core_event(changes->view->core, &event); i++) {
        if (event.before == event.after) {
            parameters_event(changes, &event);
        } else {
            connection_event(changes, incidents, &event);
        }
    }
    const uint64_t cycle = fsn_core_last_cycle(changes->view->core);
    if (cycle == changes->cycle ||
        fsn_core_snapshot(changes->view->core, &changes->view->statistics, NULL, NULL) != FSN_OK) {
        return;
    }
    changes->cycle = cycle;
    const struct fsn_statistics *s = &changes->view->statistics;
    if (s->events_lost != changes->events_lost) {
        struct fsn_json *json = fsn_event_begin(changes->events, "lost", s->now_ns);
        fsn_json_put_u64(json, "events", s->events_lost);
        fsn_event_send(changes->events, FSN_LOG_WARNING, "events lost so far: %" PRIu64,
                       s->events_lost);
        changes->events_lost = s->events_lost;
    }
    poll_foreign(changes, now_ns);
    poll_wkc(changes, now_ns);
}
