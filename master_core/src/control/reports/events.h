/** Events: one line of JSON each, for subscribers, the log and incidents. */
#ifndef FSN_CONTROL_EVENTS_H
#define FSN_CONTROL_EVENTS_H

#include "control/base/host.h"
#include "control/base/json.h"
#include "control/base/peer.h"

struct fsn_events {
    const struct fsn_control_host *host; /**< its log gets each event */
    struct fsn_json json;                /**< the event being written */
    const char *name;                    /**< its name; static */
    uint64_t at_ns;
    enum fsn_role account; /**< role whose share of the intervention log it uses */
    /** Receives each event without its newline; may add one and forward the event. */
    void (*deliver)(void *self, struct fsn_json *json);
    void *self;
};

/** Begins an event; `at_ns` monotonic. Keys may be added until it is sent. Its account is that of
 *  an observer, unless fsn_event_begin_act() or the caller sets another. */
struct fsn_json *fsn_event_begin(struct fsn_events *events, const char *name, uint64_t at_ns);

/** The same for an action of a role: the program itself is a maintainer. */
struct fsn_json *fsn_event_begin_act(struct fsn_events *events, const char *name,
                                     enum fsn_role role);

/** Ends and sends it. An event that is too long is sent without the added keys. */
__attribute__((format(printf, 3, 4))) void
fsn_event_send(struct fsn_events *events, enum fsn_log_level level, const char *format, ...);

#endif
