/** Reason why a request was refused, for the reply. */
#ifndef FSN_CONTROL_REFUSAL_H
#define FSN_CONTROL_REFUSAL_H

#include "fsn/status.h"

struct fsn_refusal {
    fsn_status status;
    char text[320];
    const char *hint; /**< the next step; static, or NULL */
};

/** Fills a refusal; returns its status. */
__attribute__((format(printf, 4, 5))) fsn_status fsn_refusal_set(struct fsn_refusal *refusal,
                                                                 fsn_status status,
                                                                 const char *hint,
                                                                 const char *format, ...);

#endif
