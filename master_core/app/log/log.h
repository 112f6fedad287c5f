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

/** From now on warnings, errors and interventions are also written to an intervention log, which
 *  this module ends. Context: the thread that ends it. */
void log_keep(struct interventions *log);

/** State of the intervention log.   @return false  there is none. Context: the thread that ends it.
 */
bool log_kept(struct fsn_interventions *state);

/** Writes the remaining entries and then the exit code to the intervention log, and ends it.
 *  @return `code`. */
int log_end(int code);

/** Writes an entry only to the intervention log, on behalf of a role: a complete object; no effect
 *  without a log. */
void log_entry(enum fsn_role account, const struct fsn_json *json);

/** Writes one line in the selected form. */
__attribute__((format(printf, 2, 3))) void log_line(enum fsn_log_level level, const char *format,
                                                    ...);

/** Writes one line about a SubDevice: its name precedes the text, and has a key in JSON. */
__attribute__((format(printf, 3, 4))) void
log_subdevice(enum fsn_log_level level, const char *subdevice, const char *format, ...);

/** Writes one event on behalf of a role: `text`, or `json` unchanged. */
void log_event(enum fsn_log_level level, enum fsn_role account, const char *text, const char *json,
               size_t json_bytes);

#endif
