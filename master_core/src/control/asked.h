/** What the requests of the control socket share: one function each, one table in requests.c. */
#ifndef FSN_CONTROL_ASKED_H
#define FSN_CONTROL_ASKED_H

#include "internal.h"

/** One request being answered. */
struct fsn_asked {
    struct fsn_control *control;
    struct fsn_client *client;
    const char *const *argument; /**< words behind the name of the request */
    size_t count;
    struct fsn_json *json; /**< the reply, open, "ok" written */
    struct fsn_refusal refusal;
    const char *tag; /**< NULL: none */
    bool later;      /**< a job answers */
};

/** Answers a request: writes into its `json`, or returns what fsn_asked_refuse() did. */
typedef fsn_status (*fsn_answer_fn)(struct fsn_asked *asked);

/** Refuses a request; returns `status`. */
fsn_status fsn_asked_refuse(struct fsn_asked *asked, fsn_status status, const char *hint,
                            const char *text);

/** Finds a symbol by its name, or refuses. */
fsn_status fsn_asked_symbol(struct fsn_asked *asked, const char *name, uint32_t *symbol,
                            struct fsn_symbol_info *info);

/* requests_values.c */
fsn_status fsn_answer_get(struct fsn_asked *asked);
fsn_status fsn_answer_set(struct fsn_asked *asked);
fsn_status fsn_answer_arm(struct fsn_asked *asked);

/** Takes "--typed" off the arguments: values are in the units of their symbols then. */
bool fsn_asked_typed(struct fsn_asked *asked);

/* incident.c */
fsn_status fsn_answer_incident(struct fsn_asked *asked);
/* stream.c */
fsn_status fsn_answer_watch(struct fsn_asked *asked);

#endif
