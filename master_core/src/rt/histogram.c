#include "rt/rt.h"

/** Bucket of a time: see struct fsn_histogram. */
static uint32_t bucket_of(uint64_t time_ns) {
    if (time_ns < 4) {
        return (uint32_t)time_ns;
    }
    uint32_t exponent = 2;
    while (exponent < 33 && time_ns >> (exponent + 1) != 0) {
        exponent++;
    }
    const uint32_t quarter = (uint32_t)(time_ns >> (exponent - 2)) & 3u;
    const uint32_t bucket = 4 * (exponent - 1) + quarter;
    return bucket < FSN_BUCKETS ? bucket : FSN_BUCKETS - 1;
}

void fsn_rt_count(struct fsn_histogram *histogram, uint64_t time_ns) {
    if (histogram->count == 0 || time_ns < histogram->min_ns) {
        histogram->min_ns = time_ns;
    }
    if (time_ns > histogram->max_ns) {
        histogram->max_ns = time_ns;
    }
    histogram->count++;
    histogram->sum_ns += time_ns;
    histogram->bucket[bucket_of(time_ns)]++;
}
