/** One client of the control socket: received and queued bytes, and its resources. */
#ifndef FSN_CONTROL_CLIENT_H
#define FSN_CONTROL_CLIENT_H

#include "control/base/words.h"
#include "control/incidents/incidents.h"
#include "core/clients.h"

struct fsn_client;

/* Limits of the events that a user may cause by refused requests. The user comes from the kernel,
 * because a program may open any number of connections. */

enum {
    FSN_QUOTA_AT_ONCE = 10, /**< events of a user and kind without a pause */
    FSN_QUOTA_S = 60,       /**< then one in this many seconds */
    FSN_QUOTA_USERS = 32,   /**< with their own quota; all others share one */
};

enum fsn_quota_kind { FSN_QUOTA_REFUSED, FSN_QUOTA_DROPPED, FSN_QUOTA_KINDS };

/** The last cause of a kind by a user, with or without an event. */
struct fsn_cause {
    struct fsn_peer peer;
    enum fsn_role role;
    uint32_t client;
    const char *what; /**< static: name of the request, or the reason for dropping */
    fsn_status status;
};

struct fsn_quota {
    uint64_t due_ns; /**< of fsn_pace_allows() */
    uint32_t times;  /**< since the last event */
    struct fsn_cause last;
};

struct fsn_quotas {
    struct fsn_quota of[FSN_QUOTA_USERS + 1][FSN_QUOTA_KINDS]; /**< the last is shared */
};

/** Counts a cause.   @return how often it has occurred since the last event; 0: no event now. */
uint32_t fsn_quota_take(struct fsn_quotas *quotas, enum fsn_quota_kind kind,
                        const struct fsn_cause *cause, uint64_t now_ns);

/** Events that were only counted and may be reported now, one at a time.
 *  @param[in] now_ns  UINT64_MAX: all of them, at the end of the program.
 *  @param[out] times  number of occurrences.   @return NULL: none. */
const struct fsn_cause *fsn_quota_left(struct fsn_quotas *quotas, enum fsn_quota_kind kind,
                                       uint64_t now_ns, uint32_t *times);

/** Modules that answer requests, combined in one structure. */
struct fsn_services {
    struct fsn_bus_view view;
    struct fsn_events events;
    struct fsn_quotas quotas; /**< of events about refusals */
    struct fsn_job_queue jobs;
    struct fsn_incidents *incidents; /**< NULL: none are recorded */
    struct fsn_client *client;       /**< the places of all clients, used and free */
    size_t clients;                  /**< number of places */
    struct fsn_json line;            /**< the cycle being written for a client */
};

enum {
    FSN_CLIENT_OUT_BYTES = 1 << 20, /**< limit of unread bytes before it is dropped */
    FSN_CLIENT_TEXT_BYTES = FSN_PEER_TEXT_BYTES + 20,
};

/** Cycles that a client subscribes to. */
struct fsn_stream {
    uint32_t every;    /**< 0: none */
    bool image;        /**< whole images, otherwise the values of `symbols` */
    bool typed;        /**< values in the units of their symbols */
    uint64_t next;     /**< cycle of the next line */
    uint64_t skipped;  /**< lines omitted since the last one */
    uint32_t *symbols; /**< owned */
    size_t count;
};

struct fsn_client {
    int fd;          /**< -1: the slot is free */
    uint32_t number; /**< increasing, never reused, never FSN_NOBODY */
    struct fsn_peer peer;
    enum fsn_role role; /**< role at the time of the connection */
    bool events;        /**< subscribed */
    struct fsn_stream stream;
    bool skipping;           /**< inside a line that is too long */
    const char *drop_reason; /**< reason to drop it, or NULL */
    bool more;               /**< complete lines are waiting in `in` */
    uint32_t lease_ms;       /**< 0: until it disconnects */
    uint64_t heard_ns;       /**< end of its last request, or of its last lease */
    uint64_t request_ns;     /**< end of its last request, or its beginning */
    uint64_t moved_ns;       /**< when it last accepted bytes, or none were pending */
    size_t in_bytes;
    char in[FSN_LINE_BYTES + 2];
    struct fsn_job *job; /**< its request in progress; subsequent lines wait */
    size_t long_bytes;   /**< of a long answer in `out`, not subject to its limit */
    struct fsn_json out; /**< replies and events to send; `sent` bytes are already sent */
    size_t sent;
    uint32_t place;           /**< place in the cycle + 1; 0: none */
    int pass[FSN_CLIENT_FDS]; /**< descriptors that go with byte `pass_at` of `out` */
    size_t pass_at;
    unsigned passes; /**< their number; 0: none */
    bool begun;      /**< it is in the cycle; until then its lease runs */
};

/** Appends bytes for a client; it is dropped if too many are unread. */
void fsn_client_put(struct fsn_client *client, const char *bytes, size_t len_bytes);

/** The same for one long answer, which does not count as unread. */
void fsn_client_put_long(struct fsn_client *client, const char *bytes, size_t len_bytes);

/** Sends descriptors with the next bytes, and closes them here once they are sent. */
void fsn_client_pass(struct fsn_client *client, const int *fds, unsigned count);

/** Closes descriptors that have not been sent. */
void fsn_client_close_passed(struct fsn_client *client);

/** Writes the bytes that a connected client accepts without waiting; false if it has
 *  disconnected. */
bool fsn_client_send(struct fsn_client *client, uint64_t now_ns);

/** Ends a client that has disconnected; its outputs fall back. */
void fsn_client_end(struct fsn_services *services, struct fsn_client *client);

/** Drops a connected client and reports why; its outputs fall back. */
void fsn_client_drop(struct fsn_services *services, struct fsn_client *client, const char *why);

/** Adds the identity of a client to an event. */
void fsn_client_put_peer(const struct fsn_client *client, struct fsn_json *json);

/** The client in words: "client 3, pid 12 (fsoe-net), uid 1000 (anna)".   @return room. */
const char *fsn_client_text(const struct fsn_client *client, char room[FSN_CLIENT_TEXT_BYTES]);

/** Returns the cause of events that count against the quota of its user. */
struct fsn_cause fsn_client_cause(const struct fsn_client *client, const char *what,
                                  fsn_status status);

/** Reports events that were counted against quotas and may be reported now.
 *  @param[in] now_ns  UINT64_MAX: all of them, at the end of the program. */
void fsn_services_report_counted(struct fsn_services *services, uint64_t now_ns);

/** Releases the resources of a client and reports it. */
void fsn_client_take_back(struct fsn_services *services, struct fsn_client *client,
                          const char *why);

/** Takes back the outputs of late clients in the cycle. */
void fsn_services_watch_cycle(struct fsn_services *services);

/** Every output takes its stop value and is closed until there is another core. */
void fsn_services_close_outputs(struct fsn_services *services);

/** Sends clients the completed cycles that they watch. */
void fsn_streams_serve(struct fsn_services *services);

/** Ends the subscription of a client. */
void fsn_stream_end(struct fsn_client *client);

#endif
