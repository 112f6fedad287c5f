/** Guards in place of chains of statuses and of allocations. */
#ifndef FSN_TRY_H
#define FSN_TRY_H

#include <stdlib.h>

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

/** Allocates zeros for `count` elements and one more, so that none is not a request for 0 bytes.
 *  Returns whether there was memory; otherwise the pointer is NULL. */
#define FSN_NEW(array, count) (((array) = calloc((size_t)(count) + 1, sizeof *(array))) != NULL)

#endif
