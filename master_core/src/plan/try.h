/** A guard in place of a chain of statuses. */
#ifndef FSN_TRY_H
#define FSN_TRY_H

#include "fsn/status.h"

/** Calls a function that returns an fsn_status. Unless that is FSN_OK, the caller returns it here:
 *  only where there is nothing to release. */
#define FSN_TRY(call)                                                                              \
    do {                                                                                           \
        const fsn_status fsn_try_status = (call);                                                  \
        if (fsn_try_status != FSN_OK) {                                                            \
            return fsn_try_status;                                                                 \
        }                                                                                          \
    } while (0)

#endif
