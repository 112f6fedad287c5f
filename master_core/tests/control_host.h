/** A host for tests of the control socket: the bus runs, every request is granted, nothing is
 * logged.
 */
#ifndef FSN_TEST_CONTROL_HOST_H
#define FSN_TEST_CONTROL_HOST_H

#include "control/requests/client.h"
#include "control/requests/requests.h"
#include "control/server/server.h"

static inline void host_status(void *self, struct fsn_control_status *status) {
    (void)self;
    *status = (struct fsn_control_status){.state = FSN_PROGRAM_RUNNING,
                                          .backend = "emulated",
                                          .plan_file = "plan",
                                          .policy = "other",
                                          .cycle_ns = 1000000};
}

static inline fsn_status host_grants(void *self, enum fsn_program_request request,
                                     struct fsn_refusal *refusal) {
    (void)self;
    (void)request;
    (void)refusal;
    return FSN_OK;
}

static inline void host_is_silent(void *self, enum fsn_log_level level, enum fsn_role account,
                                  const char *text, const char *json, size_t json_bytes) {
    (void)account;
    (void)self;
    (void)level;
    (void)text;
    (void)json;
    (void)json_bytes;
}

static const struct fsn_control_access nobody; /**< no other user may connect */

/** @param[in] submit  takes acyclic jobs; NULL: there are none. */
static inline struct fsn_control_host test_host(void (*submit)(void *, struct fsn_job *)) {
    return (struct fsn_control_host){
        .status = host_status, .request = host_grants, .submit = submit, .log = host_is_silent};
}

#endif
