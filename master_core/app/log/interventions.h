/** The intervention log: start, stop, arming, writes and other changes, with person and time.
 *
 *  Threads put entries into a bounded queue and continue; a separate thread writes them, because a
 *  disk may be slow, full or missing. Entries that find the queue full are counted, and the count
 *  is written.
 */
#ifndef FSN_APP_INTERVENTIONS_H
#define FSN_APP_INTERVENTIONS_H

#include "app/log/intervention_files.h"
#include "control/base/host.h"

struct interventions;

enum {
    INTERVENTIONS_ENTRIES = 1000,  /**< that wait for the disk */
    INTERVENTIONS_BYTES = 4 << 20, /**< of all of them */
};

/** Opens the log and starts its thread. A full, read-only or defective disk is not an error:
 *  entries wait until it accepts them.
 *  @param[in] most_bytes  of a file, before the next one begins.
 *  @retval FSN_E_SYS    not a writable folder, or a file in it is not a log.
 *  @retval FSN_E_STATE  another program writes there.   @retval FSN_E_NOMEM  out of memory. */
fsn_status interventions_open(const char *folder, uint64_t most_bytes, struct interventions **log,
                              struct fsn_refusal *refusal);

/** Adds an entry: an event as JSON object with "event" as its first key. A maintainer, and the
 *  program itself, may fill all of queue and disk, an operator three quarters of them, and all
 *  other entries half: entries of a role are never lost because of lower roles. Context: any thread
 *  but the cyclic one; waits for no disk. */
void interventions_put(struct interventions *log, enum fsn_role account, const char *json,
                       size_t len_bytes);

/** Adds an event if its kind belongs in the log; `log` may be NULL. Context: as above. */
void interventions_put_event(struct interventions *log, enum fsn_role account, const char *json,
                             size_t len_bytes);

/** Current state; strings are valid until the next call. Context: one thread. */
void interventions_state(struct interventions *log, struct fsn_interventions *state);

/** Writes the waiting entries, for at most `wait_ms`, and ends. NULL is allowed.
 *  @return number of entries that were not written. */
uint64_t interventions_close(struct interventions *log, int wait_ms);

/** Why the system refused, in words. Context: any thread. */
const char *interventions_error(int error);

#endif
