/** Data of incidents.c, and of the head of its files. */
#ifndef FSN_CONTROL_INCIDENT_KEPT_H
#define FSN_CONTROL_INCIDENT_KEPT_H

#include "control/base/json.h"
#include "control/incidents/incidents.h"
#include "fsn/core.h"

enum { FSN_INCIDENT_PATH = 512 };

#define FSN_INCIDENT_SUFFIX ".fsnincident"

/** Cycles copied from the recorder, one after another. */
struct fsn_window {
    uint64_t count;
    uint32_t image_bytes;
    struct fsn_cycle *cycles; /**< owned; NULL: none */
    uint8_t *images;          /**< owned; count times image_bytes */
};

/** Copies the cycles since `from_ns` from the recorder; older ones are omitted if they would need
 *  more than 32 MiB. Empty without a recorder or memory. */
struct fsn_window fsn_window_take(const struct fsn_core *core, uint64_t from_ns);
void fsn_window_free(struct fsn_window *window);

/** The file of one incident, written by a separate thread. */
struct fsn_incident_file;

/** Starts writing; takes ownership of head and window, even if it fails.
 *  @param[in] folder, stem  the file is `folder/stem.fsnincident`, or with a number after the stem.
 *  @param[in] most_bytes    limit for all incident files of the folder together; then no further
 *      one is written.
 *  @return NULL  no thread, or no memory. */
struct fsn_incident_file *fsn_incident_file_begin(const char *folder, const char *stem,
                                                  uint64_t most_bytes, struct fsn_json *head,
                                                  struct fsn_window *window);

/** Result. */
struct fsn_incident_result {
    char path[FSN_INCIDENT_PATH];
    uint8_t sha256[FSN_SHA256_BYTES]; /**< of a complete file */
    uint64_t cycles;                  /**< number written */
    int error;                        /**< 0, or errno: the file ends early */
    bool full; /**< it was not begun: the files in the folder have reached their limit */
};

/** Whether the thread is done; if so, it is freed. */
bool fsn_incident_file_done(struct fsn_incident_file *file, struct fsn_incident_result *result);

/** Waits for the thread and frees it. */
void fsn_incident_file_wait(struct fsn_incident_file *file, struct fsn_incident_result *result);

enum { FSN_INCIDENT_EVENTS = 200, FSN_INCIDENT_HEAD_BYTES = 16 << 20 };

/** The incident in progress. */
struct fsn_pending {
    bool active;
    enum fsn_trigger_kind kind;
    char connection[128], subdevice[128], before[24], after[24], reset_by[8], reset_text[80],
        text[600];
    uint8_t reset_code;
    bool has_fault;
    struct fsn_fault fault;
    uint64_t now_ns, cycle, until_ns;
    uint64_t late_ns; /**< when the window ended before the last cycle was complete; 0: not yet */
};

struct fsn_incidents {
    struct fsn_bus_view *view;
    struct fsn_events *events;
    struct fsn_job_queue *jobs;
    char folder[FSN_INCIDENT_PATH / 2];
    uint64_t most_bytes; /**< of all incident files in it, before another one is begun */
    struct fsn_pending pending;
    struct fsn_job *job;            /**< reads the FSoE values of the SubDevices, or NULL */
    struct fsn_json fsoe;           /**< their answer; empty if there is none */
    struct fsn_incident_file *file; /**< being written */
    char text[640];                 /**< of the file being written */
    uint64_t due_ns;                /**< when the next one is due; see is_too_soon() */
    uint64_t in_op_ns, polled_ns;   /**< 0: not all are in OP */
    uint8_t *reported;              /**< per connection: it was in Data, or reported as missing */
    uint8_t *refused;               /**< per SubDevice: its difference was reported */
    uint32_t connections;
    unsigned files;
    bool full_reported;
    char *event[FSN_INCIDENT_EVENTS]; /**< the last events, as a ring */
    unsigned next_event;
};

const char *fsn_trigger_name(enum fsn_trigger_kind kind);

/** Writes the first line: all data except the cycles. */
void fsn_incident_head(struct fsn_incidents *incidents, struct fsn_json *json);

#endif
