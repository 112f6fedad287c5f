/** Limits the events that a user may cause by refused requests. The user comes from the kernel,
 *  because a program may open any number of connections. */
#ifndef FSN_CONTROL_QUOTA_H
#define FSN_CONTROL_QUOTA_H

#include "control/base/peer.h"
#include "fsn/status.h"

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

#endif
