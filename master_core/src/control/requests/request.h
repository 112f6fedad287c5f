/** One request being answered: one function per request, one table in requests.c. */
#ifndef FSN_CONTROL_REQUEST_H
#define FSN_CONTROL_REQUEST_H

#include "control/requests/client.h"

struct fsn_request {
    struct fsn_services *services;
    struct fsn_client *client;
    const char *name;
    const char *const *argument; /**< words after the name */
    size_t count;
    struct fsn_json *json; /**< the reply, open, with "ok" already written */
    struct fsn_refusal refusal;
    const char *tag;        /**< NULL: none */
    bool later;             /**< a job answers */
    int fd[FSN_CLIENT_FDS]; /**< descriptors that go with the reply, `fds` of them */
    unsigned fds;
};

/** Answers a request: writes into its `json`, or returns the result of fsn_request_refuse(). */
typedef fsn_status (*fsn_answer_fn)(struct fsn_request *request);

/** Refuses a request: status, hint, and a text as for printf; returns the status. */
#define fsn_request_refuse(request, ...) fsn_refusal_set(&(request)->refusal, __VA_ARGS__)

/** The symbols of a name. Inputs and outputs have separate names and are never confused. */
struct fsn_named {
    uint32_t input;  /**< or FSN_NONE */
    uint32_t output; /**< or FSN_NONE */
};

/** Finds the input and the output of a name, or refuses an unknown name. */
fsn_status fsn_request_find(struct fsn_request *request, const char *name, struct fsn_named *found);

/** Marks the inputs and outputs that a word names, or refuses; a final * matches any ending.
 *  @param[in,out] marks  one per symbol. */
fsn_status fsn_request_mark(struct fsn_request *request, const char *word, uint8_t *marks);

/** Reports outputs that the client did not write before and now owns. */
void fsn_request_report_taken(struct fsn_request *request, const struct fsn_wanted *wanted,
                              size_t count);

/** Removes "--typed" from the arguments: values are then in the units of their symbols. */
bool fsn_request_typed(struct fsn_request *request);

/* values.c */
fsn_status fsn_answer_get(struct fsn_request *request);
fsn_status fsn_answer_set(struct fsn_request *request);
fsn_status fsn_answer_arm(struct fsn_request *request);
/* stream.c */
fsn_status fsn_answer_watch(struct fsn_request *request);
/* realtime.c */
fsn_status fsn_answer_realtime(struct fsn_request *request);
/** Adds the clients that are in the cycle; nothing if there are none. */
void fsn_report_realtime(const struct fsn_services *services, struct fsn_json *json);
/* transfers.c: begins a job; the client's next lines wait for it. */
fsn_status fsn_answer_later(struct fsn_request *request);

#endif
