/** The buses supported by this build. */
#ifndef FSN_APP_BACKENDS_H
#define FSN_APP_BACKENDS_H

#include <stdio.h>

#include "fsn/live.h"

/** Finds a bus by its name.   @retval NULL  not in this build. */
const struct fsn_backend *backend_find(const char *name);

/** Whether any build has a bus with this name. */
bool backend_is_known(const char *name);

/** Prints version, buses with their terms, and the limits of this program. */
void backends_print(FILE *out);

#endif
