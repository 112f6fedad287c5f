/** Whether a plan is the one in an acceptance record that two persons signed. */
#ifndef FSN_APP_ACCEPTANCE_H
#define FSN_APP_ACCEPTANCE_H

#include <stddef.h>
#include <stdint.h>

#include "app/base/options.h"

/** Has `fsoe-net acceptance verify` compare a plan with `options->acceptance`, and check its
 *  signatures. It runs without a shell, from the folder of this program or from PATH, and reads the
 *  bytes that were loaded. Its output is logged.
 *  @param[in,out] options  the output is kept in `acceptance_said`.
 *  @return -1 if everything matches the signatures, otherwise the exit code, with the reason
 *        logged.
 *  Context: before the control thread runs; waits for the other program. */
int acceptance_check(const uint8_t *plan, size_t plan_bytes, struct options *options);

#endif
