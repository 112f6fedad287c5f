#include "rt/rt.h"

enum { FIRST_EXPONENT = 6 /* of FSN_OCTAVE; below, a bucket is 1 ns wide */ };

/** Bucket of a time: see struct fsn_histogram. */
static uint32_t bucket_of(uint64_t time_ns) {
    if (time_ns < FSN_OCTAVE) { /* mutants: of 64 both say 64 */
        return (uint32_t)time_ns;
    }
    const uint32_t exponent = 63 - (uint32_t)__builtin_clzll(time_ns);
    const uint32_t part = (uint32_t)(time_ns >> (exponent - FIRST_EXPONENT)) % FSN_OCTAVE;
    const uint32_t bucket = FSN_OCTAVE * (exponent - FIRST_EXPONENT + 1) + part;
    return bucket < FSN_BUCKETS ? bucket : FSN_BUCKETS - 1;
}

/** Its position in the words of the statistics. */
static uint32_t word_of(const struct fsn_rt *rt, const void *place) {
    return (uint32_t)((const uint8_t *)place - (const uint8_t *)&rt->statistics) / 8;
}

void fsn_rt_count(struct fsn_rt *rt, struct fsn_histogram *histogram, uint64_t time_ns) {
    if (histogram->count == 0 || time_ns < histogram->min_ns) {
        histogram->min_ns = time_ns;
    }
    if (time_ns > histogram->max_ns) {
        histogram->max_ns = time_ns;
    }
    histogram->count++;
    histogram->sum_ns += time_ns;
    uint32_t *bucket = &histogram->bucket[bucket_of(time_ns)];
    ++*bucket;
    const struct fsn_rt_counted counted = {word_of(rt, histogram), word_of(rt, bucket)};
    for (uint32_t picture = 0; picture < FSN_RT_PICTURES; picture++) {
        struct fsn_rt_unshown *unshown = &rt->snapshot.unshown[picture];
        if (unshown->count < FSN_RT_COUNTED) {
            unshown->counted[unshown->count] = counted;
        }
        unshown->count += unshown->count <= FSN_RT_COUNTED;
    }
}
