/** Incidents: the bus data before and after a connection left Data, each written to a file.
 *
 *  The control thread detects the incident and copies a window from the recorder. A separate thread
 *  writes the file, because a disk may be slow or full. Format: docs/reference/incident-file.md. */
#ifndef FSN_CONTROL_INCIDENT_H
#define FSN_CONTROL_INCIDENT_H

#include "control/jobs/job.h"
#include "control/reports/bus_view.h"
#include "control/reports/events.h"

struct fsn_incidents;

/** Writes incidents from now on.
 *  @param[in] folder, most_bytes  existing folder of the files, and its limit.
 *  @param[in] view, events, jobs  must outlive it.
 *  @retval FSN_E_SYS  not a writable folder.   @retval FSN_E_NOMEM  out of memory. */
fsn_status fsn_incidents_create(const char *folder, uint64_t most_bytes, struct fsn_bus_view *view,
                                struct fsn_events *events, struct fsn_job_queue *jobs,
                                struct fsn_incidents **incidents, struct fsn_refusal *refusal);

/** Waits until a file that is being written is complete. NULL is allowed. */
void fsn_incidents_free(struct fsn_incidents *incidents);

enum fsn_trigger_kind {
    FSN_LEFT_DATA,
    FSN_NOT_CONNECTED,
    FSN_REFUSED,
    FSN_BUS_FAILED,
    FSN_REQUESTED,
};

/** Something happened that is worth a file. While one is in progress, the next is only an event in
 *  it. Fields that do not apply are NULL or 0. */
struct fsn_trigger {
    enum fsn_trigger_kind kind;
    const char *connection, *subdevice, *before, *after, *reset_by, *reset_text;
    uint8_t reset_code;
    uint64_t now_ns;
    const char *text;              /**< in words */
    const struct fsn_fault *fault; /**< of bus_failed */
};

/** Begins an incident. Does nothing without incidents (NULL) or while another one is kept. Unless a
 *  client requests it, it also does nothing during a stop and after too many incidents in a row.
 *  @retval false  no file will be written. */
bool fsn_incident_begin(struct fsn_incidents *incidents, const struct fsn_trigger *trigger);

/** A connection is now in this state; records that it has reached Data. */
void fsn_incident_connection(struct fsn_incidents *incidents, uint32_t number, uint32_t observed);

/** A SubDevice has changed: if it differs from the plan, or refuses a state or an object, this is
 *  an incident, once until it is in OP. */
void fsn_incident_subdevice(struct fsn_incidents *incidents, uint32_t number,
                            const struct fsn_bus_subdevice *seen, uint64_t now_ns);

/** Stores an event line for the next file. */
void fsn_incident_event(struct fsn_incidents *incidents, const char *json, size_t len_bytes);

/** Must be called in every turn: ends windows, detects connections that do not reach Data, reports
 *  written files. */
void fsn_incident_turn(struct fsn_incidents *incidents, uint64_t now_ns);

/** A job is done; it may have read the FSoE values of the SubDevices. */
void fsn_incident_job_done(struct fsn_incidents *incidents, struct fsn_job *job);

/** The core is about to end: the incident in progress is written with the available data. */
void fsn_incident_detach(struct fsn_incidents *incidents);

#endif
