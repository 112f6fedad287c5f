/** The requests of the control socket. */
#ifndef FSN_CONTROL_REQUESTS_H
#define FSN_CONTROL_REQUESTS_H

#include "control/requests/client.h"

enum {
    FSN_CONTROL_PROTOCOL = 1,  /**< version of the protocol; it grows by new words and keys */
    FSN_LEASE_MS = 1000,       /**< lease of a client that does not request another */
    FSN_LEASE_MAX_MS = 600000, /**< longest lease */
};

/** Answers one line; it is changed in place. */
void fsn_request_answer(struct fsn_services *services, struct fsn_client *client, char *line,
                        size_t len_bytes);

/** Answers with a refusal. */
void fsn_reply_refusal(struct fsn_client *client, const char *tag,
                       const struct fsn_refusal *refusal);

/** A client's job is done: sends the answer. */
void fsn_reply_job(struct fsn_client *client, const struct fsn_job *job);

#endif
