/** Whether a plan is the one of an acceptance record that two persons signed. */
#ifndef FSN_APP_ACCEPTANCE_H
#define FSN_APP_ACCEPTANCE_H

#include <stddef.h>
#include <stdint.h>

#include "app/base/options.h"

/** Has `fsoe-net verify` compare a plan with `options->acceptance`, and check its signatures. It is
 *  run without a shell, from the folder of this program or from PATH, and gets the very bytes that
 *  were loaded. What it prints goes to the log.
 *  @param[in,out] options  what was printed is kept in `acceptance_said`.
 *  @return -1 when all is as signed, else the exit code; then it has said why.
 *  Context: before the control thread runs; waits for the other program. */
int acceptance_check(const uint8_t *plan, size_t plan_bytes, struct options *options);

#endif
