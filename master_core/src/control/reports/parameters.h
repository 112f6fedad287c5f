/** Parameters of connections, planned and observed, as documents and in words. */
#ifndef FSN_CONTROL_PARAMETERS_H
#define FSN_CONTROL_PARAMETERS_H

#include "control/base/json.h"
#include "fsn/monitor.h"

enum { FSN_DIFFERS_BYTES = 256 };

/** Writes an object under a key; unknown values are null. */
void fsn_report_parameters(struct fsn_json *json, const char *key,
                           const struct fsn_parameters *parameters);

/** Writes the keys of parameters that differ, as a list. */
void fsn_report_differs(struct fsn_json *json, uint32_t differs);

/** Writes "watchdog 4000 ms, 400 ms in the plan" into `room`, which it returns. */
const char *fsn_differs_text(uint32_t differs, const struct fsn_parameters *planned,
                             const struct fsn_parameters *observed, char room[FSN_DIFFERS_BYTES]);

#endif
