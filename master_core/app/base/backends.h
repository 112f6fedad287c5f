/** The buses this build can drive. */
#ifndef FSN_APP_BACKENDS_H
#define FSN_APP_BACKENDS_H

#include <stdio.h>

#include "fsn/live.h"

/** Finds a bus by its name.   @retval NULL  this build does not have it. */
const struct fsn_backend *backend_find(const char *name);

/** Whether there is a bus of that name in some build. */
bool backend_is_known(const char *name);

/** Prints version, buses with their terms, and the limits of this program. */
void backends_print(FILE *out);

#endif
