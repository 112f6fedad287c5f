/** Lines on stderr, with UTC. */
#ifndef FSN_APP_LOG_H
#define FSN_APP_LOG_H

#include <stdbool.h>
#include <stddef.h>

#include "app/log/interventions.h"
#include "control/base/json.h"
#include "control/server/control.h"

/** Chooses between text and JSON lines. */
void log_as_json(bool json);

/** From now on warnings, errors and interventions also go into an intervention log, which this
 *  module ends. Context: the thread that ends it. */
void log_keep(struct interventions *log);

/** State of the intervention log.   @return false  there is none. Context: the thread that ends it.
 */
bool log_kept(struct fsn_interventions *state);

/** Writes the remaining entries into the intervention log, the exit code last, and ends it.
 *  @return `code`. */
int log_end(int code);

/** An entry for the intervention log alone, on behalf of a role: a whole object; no effect without
 *  a log. */
void log_entry(enum fsn_role account, const struct fsn_json *json);

/** One line in the chosen form. */
__attribute__((format(printf, 2, 3))) void log_line(enum fsn_log_level level, const char *format,
                                                    ...);

/** One line about a SubDevice: its name precedes the text, and has a key in JSON. */
__attribute__((format(printf, 3, 4))) void
log_subdevice(enum fsn_log_level level, const char *subdevice, const char *format, ...);

/** One event on behalf of a role: `text` for people, or `json` unchanged. */
void log_event(enum fsn_log_level level, enum fsn_role account, const char *text, const char *json,
               size_t json_bytes);

#endif
