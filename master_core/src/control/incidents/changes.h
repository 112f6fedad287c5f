/** Turns changes of the bus into events. */
#ifndef FSN_CONTROL_CHANGES_H
#define FSN_CONTROL_CHANGES_H

#include "control/incidents/incidents.h"

/** A group as last reported. */
struct fsn_seen_group {
    uint8_t state; /**< enum fsn_group_state */
    uint64_t coming_ns;
    char detail[FSN_DETAIL_BYTES];
};

/** State of the bus at the last poll, in addition to the SubDevices in the view. */
struct fsn_changes {
    struct fsn_bus_view *view;
    struct fsn_events *events;
    uint64_t *reset_reported_ns; /**< per connection: last line on a reset; 0: none */
    bool incomplete;             /**< working counter of the last poll */
    bool differed;               /**< a connection has had parameters that differ from the plan */
    bool wkc_lost;               /**< the missing answers were logged */
    struct fsn_frame_counts counts; /**< last reported, but for foreign frames */
    uint64_t wkc_errors, overruns, events_lost, foreign_frames; /**< last reported */
    uint64_t foreign_reported_ns;
    uint64_t wkc_reported_ns, polled_ns;
    struct fsn_seen_group *group; /**< of each group of the plan */
    struct fsn_bus_ring ring;     /**< as last reported */
    uint8_t clocks;               /**< enum fsn_clocks, as last reported */
    uint64_t cycle;               /**< the last cycle that was polled */
};

/** @return false  out of memory. */
bool fsn_changes_init(struct fsn_changes *changes, struct fsn_bus_view *view,
                      struct fsn_events *events);
void fsn_changes_free(struct fsn_changes *changes);

/** There is another core, or none: resets the state of the bus. */
void fsn_changes_reset(struct fsn_changes *changes);

/** Polls the bus; sends an event for every change. Some changes begin an incident. */
void fsn_changes_poll(struct fsn_changes *changes, struct fsn_incidents *incidents,
                      uint64_t now_ns);

#endif
