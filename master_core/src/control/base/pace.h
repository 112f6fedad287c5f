/** Limits how often something may happen: a few times at once, later at intervals. */
#ifndef FSN_CONTROL_PACE_H
#define FSN_CONTROL_PACE_H

#include <stdbool.h>
#include <stdint.h>

/** Whether it may happen now; if so, it is counted.
 *  @param[in,out] due_ns  0 at first; when it has happened for `at_once` times, it may happen again
 *                         `every_ns` after the first of them, and so on.
 *  @param[in] now_ns      monotonic. */
bool fsn_pace_allows(uint64_t *due_ns, uint64_t now_ns, unsigned at_once, uint64_t every_ns);

#endif
