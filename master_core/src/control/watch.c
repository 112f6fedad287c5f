/** Turns what changes on the bus into events for subscribers and the log. */
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "incident.h"
#include "internal.h"

enum {
    LOOK_MS = 20,    /**< between two looks at the SubDevices */
    WKC_MS = 1000,   /**< between two reports of single incomplete cycles */
    AGAIN_MS = 5000, /**< between two lines on a connection that resets again and again */
    DRAIN = 256,     /**< events of the core taken at once */
};

struct fsn_json *fsn_event_begin(struct fsn_control *control, const char *name, uint64_t at_ns) {
    struct fsn_json *json = &control->event;
    char utc[32];
    fsn_json_free(json);
    fsn_utc_text(at_ns, utc);
    fsn_json_open(json, '{');
    fsn_json_put_text(json, "event", name);
    fsn_json_put_text(json, "utc", utc);
    fsn_json_put_u64(json, "now_ns", at_ns);
    return json;
}

void fsn_event_tell(struct fsn_control *control, enum fsn_log_level level, const char *format,
                    ...) {
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    struct fsn_json *json = &control->event;
    static const char *const level_name[] = {"detail", "info", "warning", "error"};
    fsn_json_put_text(json, "level", level_name[level]);
    fsn_json_put_text(json, "text", text);
    fsn_json_close(json, '}');
    if (json->failed) {
        control->host->log(control->host->self, level, text, "{}", 2);
        return;
    }
    control->host->log(control->host->self, level, text, json->bytes, json->len_bytes);
    fsn_incident_event(control, json->bytes, json->len_bytes);
    fsn_json_end(json);
    for (size_t i = 0; !json->failed && i < FSN_CONTROL_CLIENTS; i++) {
        if (control->client[i].events) {
            fsn_client_put(&control->client[i], json->bytes, json->len_bytes);
        }
    }
}

/** Into Data and out of it, and the first reset of several: that is what people look for. */
static enum fsn_log_level connection_level(struct fsn_control *control,
                                           const struct fsn_event *event, bool left, bool data) {
    uint64_t *told_ns = &control->seen.reset_told_ns[event->connection];
    if (left && !data) {
        *told_ns = event->now_ns;
        return FSN_LOG_WARNING;
    }
    if (data) {
        *told_ns = 0;
        return FSN_LOG_INFO;
    }
    if (event->after != FSN_OUTSIDE_RESET ||
        (*told_ns != 0 && event->now_ns - *told_ns < AGAIN_MS * UINT64_C(1000000))) {
        return FSN_LOG_DETAIL;
    }
    const bool again = *told_ns != 0;
    *told_ns = event->now_ns;
    return again ? FSN_LOG_WARNING : FSN_LOG_INFO;
}

static void left_data(struct fsn_control *control, const struct fsn_event *event, const char *name,
                      const char *reset_by, const char *cause) {
    char text[300];
    snprintf(text, sizeof text, "connection %.120s left Data: %s%s", name,
             fsn_outside_text(event->after), cause);
    const struct fsn_trigger trigger = {
        .kind = "left_data",
        .connection = name,
        .before = fsn_outside_text(event->before),
        .after = fsn_outside_text(event->after),
        .reset_by = reset_by,
        .reset_text = reset_by != NULL ? fsn_reset_text(event->reset_code) : NULL,
        .reset_code = reset_by != NULL ? event->reset_code : 0,
        .now_ns = event->now_ns,
        .text = text};
    (void)fsn_incident_begin(control, &trigger);
}

static void connection_event(struct fsn_control *control, const struct fsn_event *event) {
    const struct fsn_connection_info info = fsn_known_connection(control->plan, event->connection);
    const bool reset = event->after == FSN_OUTSIDE_RESET && event->by != 0;
    const char *by = !reset ? NULL : event->by == FSN_TO_SUB + 1 ? "main" : "sub";
    char cause[120] = "";
    struct fsn_json *json = fsn_event_begin(control, "connection", event->now_ns);
    fsn_json_put_text(json, "connection", info.name);
    fsn_json_put_text(json, "before", fsn_outside_text(event->before));
    fsn_json_put_text(json, "after", fsn_outside_text(event->after));
    if (reset) {
        fsn_json_put_text(json, "reset_by", by);
        fsn_json_put_u64(json, "reset_code", event->reset_code);
        fsn_json_put_text(json, "reset_text", fsn_reset_text(event->reset_code));
        snprintf(cause, sizeof cause, ", by the %s: %s", by, fsn_reset_text(event->reset_code));
    }
    const bool left = fsn_outside_is_data(event->before);
    const bool data = fsn_outside_is_data(event->after);
    fsn_event_tell(control, connection_level(control, event, left, data),
                   "connection %.120s: %s -> %s%s", info.name, fsn_outside_text(event->before),
                   fsn_outside_text(event->after), cause);
    fsn_incident_connection(control, event->connection, event->after);
    if (left && !data) {
        left_data(control, event, info.name, by, cause);
    }
}

static bool same_subdevice(const struct fsn_bus_subdevice *a, const struct fsn_bus_subdevice *b) {
    return a->al_status == b->al_status && a->found == b->found && a->al_code == b->al_code &&
           a->returns == b->returns && strcmp(a->detail, b->detail) == 0 &&
           memcmp(a->link, b->link, sizeof a->link) == 0;
}

/** Lost, refused, wrong or in error; back in OP. What lies between, and links that are read one
 *  after the other, are details. */
static enum fsn_log_level subdevice_level(const struct fsn_bus_subdevice *before,
                                          const struct fsn_bus_subdevice *after) {
    const bool wrong = after->found != FSN_FOUND_RIGHT && after->found != FSN_FOUND_UNKNOWN;
    if (before->found == FSN_FOUND_UNKNOWN && !wrong && after->al_status == FSN_AL_NONE) {
        return FSN_LOG_DETAIL; /* at the start nobody has been asked for his state yet */
    }
    const bool told = after->detail[0] != 0 && strcmp(before->detail, after->detail) != 0;
    if ((after->al_status & FSN_AL_ERROR) != 0 || after->al_status == FSN_AL_NONE || wrong ||
        told) {
        return FSN_LOG_WARNING;
    }
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

static void subdevice_event(struct fsn_control *control, uint32_t number,
                            const struct fsn_bus_subdevice *before,
                            const struct fsn_bus_subdevice *after, bool told, uint64_t now_ns) {
    const struct fsn_subdevice_info info = fsn_known_subdevice(control->plan, number);
    char from[24];
    char to[24];
    struct fsn_json *json = fsn_event_begin(control, "subdevice", now_ns);
    fsn_json_put_text(json, "subdevice", info.name);
    fsn_json_put_text(json, "before", fsn_al_text(before->al_status, from));
    fsn_json_put_text(json, "after", fsn_al_text(after->al_status, to));
    fsn_json_put_u64(json, "al_code", after->al_code);
    fsn_json_put_text(json, "found", fsn_found_text(after->found));
    fsn_json_put_text(json, "detail", after->detail);
    fsn_json_put_u64(json, "returns", after->returns);
    fsn_json_key(json, "link");
    fsn_json_open(json, '[');
    for (size_t i = 0; i < FSN_PORTS; i++) {
        fsn_json_u64(json, after->link[i]);
    }
    fsn_json_close(json, ']');
    char code[120] = "";
    if ((after->al_status & FSN_AL_ERROR) != 0) {
        snprintf(code, sizeof code, ", AL status code 0x%04x %s", (unsigned)after->al_code,
                 fsn_al_code_text(after->al_code));
    }
    char links[32] = "";
    if (memcmp(before->link, after->link, sizeof after->link) != 0) {
        put_links(after, links, sizeof links);
    }
    const bool fine = after->found == FSN_FOUND_RIGHT || after->found == FSN_FOUND_UNKNOWN;
    const bool unread = fine && (before->al_status | after->al_status) == FSN_AL_NONE;
    const bool moved = before->al_status != after->al_status;
    fsn_event_tell(control, told ? FSN_LOG_DETAIL : subdevice_level(before, after),
                   "SubDevice %.120s: %s%s%s%s%s%s%s%s%.150s", info.name,
                   unread ? "its AL state is not read yet" : from, moved ? " -> " : "",
                   moved ? to : "", code, links, fine ? "" : ", ",
                   fine ? "" : fsn_found_text(after->found), after->detail[0] != 0 ? ": " : "",
                   after->detail);
}

/** One line for a bus that is lost or back as a whole. Returns whether it is. */
static bool whole_bus(struct fsn_control *control, uint32_t count, uint32_t lost, uint32_t back,
                      const char *detail, uint64_t now_ns) {
    if (count < 2 || (lost != count && back != count)) {
        return false;
    }
    struct fsn_json *json = fsn_event_begin(control, "bus", now_ns);
    fsn_json_put_bool(json, "lost", lost == count);
    if (lost == count) {
        fsn_event_tell(control, FSN_LOG_WARNING,
                       "the bus is lost: none of %" PRIu32 " SubDevices answers%s%.150s", count,
                       detail[0] != 0 ? ": " : "", detail);
    } else {
        fsn_event_tell(control, FSN_LOG_INFO, "the bus is back: all %" PRIu32 " SubDevices answer",
                       count);
    }
    return true;
}

static void look_at_subdevices(struct fsn_control *control, uint64_t now_ns) {
    struct fsn_seen *seen = &control->seen;
    if (now_ns - seen->looked_ns < LOOK_MS * UINT64_C(1000000)) {
        return;
    }
    seen->looked_ns = now_ns;
    const uint32_t count = fsn_plan_subdevice_count(control->plan);
    uint32_t lost = 0;
    uint32_t back = 0;
    struct fsn_bus_subdevice after = {0};
    for (uint32_t i = 0; i < count; i++) {
        if (fsn_core_subdevice(control->core, i, &after) != FSN_OK) {
            return; /* a bus without states */
        }
        const bool was = seen->subdevice[i].al_status != FSN_AL_NONE;
        lost += seen->known && was && after.al_status == FSN_AL_NONE;
        back += seen->known && !was && after.al_status != FSN_AL_NONE;
    }
    after.detail[FSN_DETAIL_BYTES - 1] = 0;
    const bool told = whole_bus(control, count, lost, back, after.detail, now_ns);
    for (uint32_t i = 0; i < count && fsn_core_subdevice(control->core, i, &after) == FSN_OK; i++) {
        after.detail[FSN_DETAIL_BYTES - 1] = 0;
        const struct fsn_bus_subdevice before = seen->subdevice[i];
        seen->subdevice[i] = after;
        if (!seen->known || !same_subdevice(&before, &after)) {
            subdevice_event(control, i, &before, &after, told, now_ns);
            fsn_incident_subdevice(control, i, &after, now_ns);
        }
    }
    seen->known = true;
}

static const char *plural(uint64_t number) {
    return number == 1 ? "" : "s";
}

/** What the cycle lost since the last line, in words; the overruns and late replies name the cause.
 */
static void wkc_text(const struct fsn_seen *seen, const struct fsn_statistics *s, char *text,
                     size_t room_bytes) {
    const uint64_t late = s->old_replies - seen->old_replies;
    const uint64_t unsent = s->unsent_frames - seen->unsent_frames;
    const uint64_t left_out = s->overruns - seen->overruns;
    int len =
        snprintf(text, room_bytes,
                 "working counter %u of %u; since the last line %" PRIu64
                 " incomplete cycle%s, %" PRIu64 " frame%s not back in time",
                 (unsigned)s->actual_wkc, (unsigned)s->expected_wkc,
                 s->wkc_errors - seen->wkc_errors, plural(s->wkc_errors - seen->wkc_errors),
                 s->lost_frames - seen->lost_frames, plural(s->lost_frames - seen->lost_frames));
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

static void look_at_wkc(struct fsn_control *control, uint64_t now_ns) {
    struct fsn_seen *seen = &control->seen;
    const struct fsn_statistics *s = &control->statistics;
    const bool incomplete = s->cycles > 0 && s->expected_wkc != s->actual_wkc;
    const bool turned = incomplete != seen->incomplete;
    const bool more = s->wkc_errors != seen->wkc_errors || s->lost_frames != seen->lost_frames ||
                      s->overruns != seen->overruns;
    /* A bus that is lost stays lost until the working counter says otherwise. */
    const bool known = incomplete && s->actual_wkc == 0 && seen->wkc_lost;
    const bool due = !known && now_ns - seen->wkc_told_ns >= WKC_MS * UINT64_C(1000000);
    if (!turned && (!more || !due)) {
        return;
    }
    char text[320];
    wkc_text(seen, s, text, sizeof text);
    struct fsn_json *json = fsn_event_begin(control, "wkc", s->now_ns);
    fsn_json_put_bool(json, "complete", !incomplete);
    fsn_json_put_u64(json, "expected", s->expected_wkc);
    fsn_json_put_u64(json, "actual", s->actual_wkc);
    fsn_json_put_u64(json, "wkc_errors", s->wkc_errors);
    fsn_json_put_u64(json, "lost_frames", s->lost_frames);
    fsn_event_tell(control, due ? FSN_LOG_WARNING : FSN_LOG_DETAIL, "%s", text);
    seen->incomplete = incomplete;
    if (due) {
        seen->wkc_errors = s->wkc_errors;
        seen->lost_frames = s->lost_frames;
        seen->old_replies = s->old_replies;
        seen->unsent_frames = s->unsent_frames;
        seen->overruns = s->overruns;
        seen->wkc_told_ns = now_ns;
        seen->wkc_lost = incomplete && s->actual_wkc == 0;
    }
}

void fsn_watch_reset(struct fsn_control *control) {
    struct fsn_seen *seen = &control->seen;
    memset(seen->subdevice, 0, fsn_plan_subdevice_count(control->plan) * sizeof *seen->subdevice);
    memset(seen->reset_told_ns, 0,
           fsn_plan_connection_count(control->plan) * sizeof *seen->reset_told_ns);
    *seen = (struct fsn_seen){.subdevice = seen->subdevice, .reset_told_ns = seen->reset_told_ns};
}

void fsn_watch(struct fsn_control *control, uint64_t now_ns) {
    if (control->core == NULL) {
        return;
    }
    look_at_subdevices(control, now_ns);
    struct fsn_event event;
    for (int i = 0; i < DRAIN && fsn_core_event(control->core, &event); i++) {
        connection_event(control, &event);
    }
    const uint64_t cycle = fsn_core_last_cycle(control->core);
    if (cycle == control->seen.cycle ||
        fsn_core_snapshot(control->core, &control->statistics, NULL, NULL) != FSN_OK) {
        return;
    }
    control->seen.cycle = cycle;
    if (control->statistics.events_lost != control->seen.events_lost) {
        fsn_event_begin(control, "lost", control->statistics.now_ns);
        fsn_json_put_u64(&control->event, "events", control->statistics.events_lost);
        fsn_event_tell(control, FSN_LOG_WARNING, "events lost so far: %" PRIu64,
                       control->statistics.events_lost);
        control->seen.events_lost = control->statistics.events_lost;
    }
    look_at_wkc(control, now_ns);
}

/** Adds the name of an output that fell back to the event being written. */
static void add_output(void *self, uint32_t symbol) {
    struct fsn_control *control = self;
    fsn_json_text(&control->event, fsn_known_symbol(control->plan, symbol).name);
}

void fsn_watch_take_back(struct fsn_control *control, const struct fsn_client *client,
                         const char *why) {
    struct fsn_json *json = fsn_event_begin(control, "fallback", fsn_now_ns());
    fsn_json_put_u64(json, "client", client->number);
    fsn_json_put_u64(json, "pid", (uint64_t)client->pid);
    fsn_json_put_text(json, "why", why);
    fsn_json_key(json, "outputs");
    fsn_json_open(json, '[');
    const size_t taken =
        fsn_outputs_take_back(control->outputs, client->number, add_output, control);
    fsn_json_close(json, ']');
    if (taken > 0) {
        fsn_event_tell(control, FSN_LOG_WARNING,
                       "client %u (pid %ld) %s: %zu output%s stop value%s",
                       (unsigned)client->number, (long)client->pid, why, taken,
                       taken == 1 ? " takes its" : "s take their", plural(taken));
    }
}

void fsn_control_close_outputs(struct fsn_control *control) {
    struct fsn_json *json = fsn_event_begin(control, "fallback", fsn_now_ns());
    fsn_json_put_text(json, "why", "stop");
    fsn_json_key(json, "outputs");
    fsn_json_open(json, '[');
    fsn_outputs_close(control->outputs, add_output, control);
    fsn_json_close(json, ']');
    fsn_event_tell(control, FSN_LOG_INFO, "outputs have their stop values");
}

void fsn_control_state_changed(struct fsn_control *control, enum fsn_log_level level,
                               const char *text) {
    struct fsn_control_status status = {0};
    control->host->status(control->host->self, &status);
    fsn_json_put_text(fsn_event_begin(control, "state", fsn_now_ns()), "state", status.state);
    fsn_event_tell(control, level, "%.500s", text);
}
