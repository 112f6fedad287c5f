#include "control/requests/client.h"

#include "control/base/clock.h"

static bool is_free(const struct fsn_quota row[FSN_QUOTA_KINDS], uint64_t now_ns) {
    bool free = true;
    for (int kind = 0; kind < FSN_QUOTA_KINDS; kind++) {
        free = free && row[kind].times == 0 && row[kind].due_ns <= now_ns;
    }
    return free;
}

static bool is_of(const struct fsn_quota row[FSN_QUOTA_KINDS], uid_t uid) {
    bool same = false;
    for (int kind = 0; kind < FSN_QUOTA_KINDS; kind++) {
        same = same || (row[kind].due_ns != 0 && row[kind].last.peer.uid == uid);
    }
    return same;
}

/** The row of a user: its own, otherwise one that is like new, otherwise the shared one. */
static struct fsn_quota *row_of(struct fsn_quotas *quotas, uid_t uid, uint64_t now_ns) {
    size_t found = FSN_QUOTA_USERS;
    for (size_t i = 0; i < FSN_QUOTA_USERS; i++) {
        struct fsn_quota *row = quotas->of[i];
        if (is_free(row, now_ns)) {
            row[FSN_QUOTA_REFUSED].due_ns = row[FSN_QUOTA_DROPPED].due_ns = 0;
            found = i;
        } else if (is_of(row, uid)) {
            return row;
        }
    }
    return quotas->of[found];
}

static bool is_due(struct fsn_quota *quota, uint64_t now_ns) {
    return fsn_pace_allows(&quota->due_ns, now_ns, FSN_QUOTA_AT_ONCE,
                           FSN_QUOTA_S * UINT64_C(1000000000));
}

uint32_t fsn_quota_take(struct fsn_quotas *quotas, enum fsn_quota_kind kind,
                        const struct fsn_cause *cause, uint64_t now_ns) {
    struct fsn_quota *quota = &row_of(quotas, cause->peer.uid, now_ns)[kind];
    quota->last = *cause;
    quota->times += quota->times < UINT32_MAX;
    const uint32_t times = is_due(quota, now_ns) ? quota->times : 0;
    quota->times = times > 0 ? 0 : quota->times;
    return times;
}

const struct fsn_cause *fsn_quota_left(struct fsn_quotas *quotas, enum fsn_quota_kind kind,
                                       uint64_t now_ns, uint32_t *times) {
    for (size_t i = 0; i <= FSN_QUOTA_USERS; i++) {
        struct fsn_quota *quota = &quotas->of[i][kind];
        if (quota->times > 0 && (now_ns == UINT64_MAX || is_due(quota, now_ns))) {
            *times = quota->times;
            quota->times = 0;
            return &quota->last;
        }
    }
    return NULL;
}
