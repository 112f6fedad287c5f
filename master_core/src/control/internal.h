/** What the parts of the control socket share. One thread. */
#ifndef FSN_CONTROL_INTERNAL_H
#define FSN_CONTROL_INTERNAL_H

#include <sys/stat.h>

#include "control.h"
#include "job.h"
#include "json.h"
#include "outputs.h"
#include "plan_internal.h"
#include "words.h"

enum {
    FSN_LEASE_MS = 1000,       /**< lease of a client that asks for no other */
    FSN_LEASE_MAX_MS = 600000, /**< longest lease */
    FSN_TURN_LINES = 16,       /**< requests of one client before the others have their turn */
    FSN_STALL_MS = 5000,       /**< a client that reads nothing for so long is dropped */
    FSN_IDLE_MS = 5000,        /**< one that does nothing for so long makes room for another */
};

/** Cycles that a client wants to see. */
struct fsn_stream {
    uint32_t every;    /**< 0: none */
    bool image;        /**< whole images, else the values of `symbols` */
    bool typed;        /**< values in the units of their symbols */
    uint64_t next;     /**< cycle of the next line */
    uint64_t skipped;  /**< lines left out since the last one */
    uint32_t *symbols; /**< owned */
    size_t count;
};

/** One cycle taken out of the recorder. */
struct fsn_taken {
    uint64_t cycle; /**< 0: none */
    struct fsn_cycle record;
    struct fsn_wkc *wkc; /**< room for one per datagram */
    uint8_t *image;
};

struct fsn_client {
    int fd;          /**< -1: the slot is free */
    uint32_t number; /**< rising, never used twice, never FSN_NOBODY */
    pid_t pid;
    uid_t uid;
    bool events; /**< subscribed */
    struct fsn_stream stream;
    bool skipping;           /**< inside a line that was too long */
    const char *drop_reason; /**< why it is to be dropped, or NULL */
    bool more;               /**< whole lines are waiting in `in` */
    uint32_t lease_ms;       /**< 0: until it disconnects */
    uint64_t heard_ns;       /**< end of its last request, or of its last lease */
    uint64_t asked_ns;       /**< end of its last request, or its beginning */
    uint64_t moved_ns;       /**< when it last took bytes, or had none to take */
    size_t in_bytes;
    char in[FSN_LINE_BYTES + 2];
    struct fsn_job *job; /**< its request that is under way; lines behind it wait */
    size_t long_bytes;   /**< of a long answer in `out`, which may be that much longer */
    struct fsn_json out; /**< replies and events not yet written, `sent` bytes of it gone */
    size_t sent;
};

/** What the bus looked like at the last look. */
struct fsn_seen {
    struct fsn_bus_subdevice *subdevice; /**< one per SubDevice of the plan */
    uint64_t *reset_told_ns;             /**< per connection: last line on a reset; 0: none */
    bool known;                          /**< the above were read once */
    bool incomplete;                     /**< working counter of the last look */
    bool wkc_lost;                       /**< a line has said that nobody answers */
    uint64_t wkc_errors, lost_frames, old_replies, unsent_frames, overruns; /**< as last told */
    uint64_t events_lost;                                                   /**< as last told */
    uint64_t wkc_told_ns, looked_ns;
    uint64_t cycle; /**< the last one that was looked at */
};

struct fsn_control {
    const struct fsn_plan *plan;
    const struct fsn_control_host *host;
    const struct fsn_control_access *access;
    struct fsn_outputs *outputs;
    struct fsn_core *core; /**< NULL: none */
    char sha256[2 * FSN_SHA256_BYTES + 1];
    struct fsn_fingerprint fingerprint; /**< of the plan as it was loaded */
    struct fsn_client client[FSN_CONTROL_CLIENTS];
    uint64_t polled_ns; /**< what was sent before then has been read, when clients are served */
    uint32_t last_number;
    int listener;   /**< -1: none */
    char path[108]; /**< as long as the system allows */
    dev_t device;   /**< of the socket's file, to remove none but our own */
    ino_t inode;
    struct fsn_statistics statistics; /**< room for snapshots */
    struct fsn_connection_status *connections;
    uint8_t *image;
    struct fsn_taken taken;
    struct fsn_seen seen;
    struct fsn_json event;           /**< the event being written */
    struct fsn_incidents *incidents; /**< NULL: none are kept */
    struct fsn_json line;            /**< the cycle being written */
    struct fsn_job *job[FSN_JOBS];   /**< handed over and not yet done */
};

uint64_t fsn_now_ns(void);

/* server.c */

/** Appends bytes for a client; dooms it when it has left too much unread. */
void fsn_client_put(struct fsn_client *client, const char *bytes, size_t len_bytes);

/** The same for one long answer, which does not count as left unread. */
void fsn_client_put_long(struct fsn_client *client, const char *bytes, size_t len_bytes);

/** Drops a client: its outputs fall back. */
void fsn_client_drop(struct fsn_control *control, struct fsn_client *client, const char *why);

/* requests.c */

/** Answers one line; it is changed in place. */
void fsn_request(struct fsn_control *control, struct fsn_client *client, char *line,
                 size_t len_bytes);

/** Answers with a refusal. */
void fsn_reply_refusal(struct fsn_client *client, const char *tag,
                       const struct fsn_refusal *refusal);

/* stream.c */

/** Sends clients the cycles they watch, as far as they are over. */
void fsn_streams_serve(struct fsn_control *control);

/** There is another core, or none: cycles count anew. */
void fsn_streams_restart(struct fsn_control *control);

/** Ends what a client watches. */
void fsn_stream_end(struct fsn_client *client);
/* jobs.c */

/** Begins a request that is answered later; the client's next lines wait for it. */
fsn_status fsn_job_ask(struct fsn_control *control, struct fsn_client *client, const char *tag,
                       const char *name, const char *const *argument, size_t count,
                       struct fsn_refusal *refusal);

/** Asks every planned SubDevice for its FSoE values, for an incident; NULL: not possible now. */
struct fsn_job *fsn_job_fsoe(struct fsn_control *control);

/** The client is gone: nobody waits for its answer. */
void fsn_job_forget(struct fsn_client *client);

/* report.c */

void fsn_report_hello(struct fsn_control *control, const struct fsn_client *client,
                      struct fsn_json *json);
void fsn_report_status(struct fsn_control *control, struct fsn_json *json);
void fsn_report_subdevices(struct fsn_control *control, struct fsn_json *json);
void fsn_report_symbols(struct fsn_control *control, struct fsn_json *json);

/** Fingerprint of the loaded plan, with the version of the engine and the cycle that is used. */
void fsn_report_fingerprint(struct fsn_control *control, struct fsn_json *json);

/** Statistics and connections of one cycle, and the SubDevices. FSN_E_STATE without a core. */
fsn_status fsn_report_snapshot(struct fsn_control *control, struct fsn_json *json);
/** The same for a file that is written in any case: without a core null and no connections. */
void fsn_report_last_cycle(struct fsn_control *control, struct fsn_json *json);

/* report_layout.c */

/** Where everything lies in the image. FSN_E_STATE without a core. */
fsn_status fsn_report_layout(struct fsn_control *control, struct fsn_json *json);

/** Name of a SubDevice under a key. */
void fsn_report_name(struct fsn_control *control, struct fsn_json *json, const char *key,
                     uint32_t subdevice);

/* report_text.c */

const char *fsn_outside_text(uint32_t outside);
bool fsn_outside_is_data(uint32_t outside);
const char *fsn_reset_text(uint8_t code);
const char *fsn_command_name(uint8_t command);

/** "OP", "SAFEOP+ERROR"; into `room`, which it returns. */
const char *fsn_al_text(uint8_t al_status, char room[24]);

/** UTC as 2026-01-31T12:00:00.123456Z of a monotonic time. */
void fsn_utc_text(uint64_t at_ns, char room[32]);

/* watch.c */

/** Forgets what the bus looked like. */
void fsn_watch_reset(struct fsn_control *control);

/** Looks at the bus; tells every change. */
void fsn_watch(struct fsn_control *control, uint64_t now_ns);

/** Takes back what a client holds and tells it. */
void fsn_watch_take_back(struct fsn_control *control, const struct fsn_client *client,
                         const char *why);

/** Begins an event; `at_ns` monotonic. Keys may be added until it is told. */
struct fsn_json *fsn_event_begin(struct fsn_control *control, const char *name, uint64_t at_ns);

/** Ends it: subscribers and the log get it. */
__attribute__((format(printf, 3, 4))) void
fsn_event_tell(struct fsn_control *control, enum fsn_log_level level, const char *format, ...);

#endif
