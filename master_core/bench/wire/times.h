/** Times of cycles in the histogram of the core. */
#ifndef FSN_BENCH_TIMES_H
#define FSN_BENCH_TIMES_H

#include "fsn/core.h"

void times_count(struct fsn_histogram *h, uint64_t time_ns);

/** Adds the times between two snapshots of the core; its greatest one is that since its start. */
void times_add(struct fsn_histogram *sum, const struct fsn_histogram *from,
               const struct fsn_histogram *to);

/** Cycles per second at the median period; 0 without periods. */
double times_median_per_s(const struct fsn_histogram *period);

/** Writes them as a member of a JSON object. */
void times_print(const char *name, const struct fsn_histogram *h);

#endif
