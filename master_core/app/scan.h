/** `fsn-master --scan`: scans a bus without a plan. */
#ifndef FSN_APP_SCAN_H
#define FSN_APP_SCAN_H

#include "app/base/backends.h"
#include "app/base/options.h"

/** Prints one JSON document on stdout; returns the exit code. */
int scan_run(const struct options *options, const struct fsn_backend *backend);

#endif
