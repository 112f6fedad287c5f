/** Lines on stderr, with UTC. */
#ifndef FSN_APP_LOG_H
#define FSN_APP_LOG_H

#include <stdbool.h>
#include <stddef.h>

#include "control/server/control.h"

/** Chooses between text and JSON lines. */
void log_as_json(bool json);

/** One line in the chosen form. */
__attribute__((format(printf, 2, 3))) void log_line(enum fsn_log_level level, const char *format,
                                                    ...);

/** One event: `text` for people, or `json` as it is. */
void log_event(enum fsn_log_level level, const char *text, const char *json, size_t json_bytes);

#endif
