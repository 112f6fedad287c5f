#include "times.h"

#include <stdio.h>

static uint32_t bucket_of(uint64_t time_ns) {
    uint32_t low = 0;
    for (uint32_t above = FSN_BUCKETS; above - low > 1;) {
        const uint32_t middle = (low + above) / 2;
        if (fsn_histogram_floor(middle) <= time_ns) {
            low = middle;
        } else {
            above = middle;
        }
    }
    return low;
}

void times_count(struct fsn_histogram *h, uint64_t time_ns) {
    h->bucket[bucket_of(time_ns)]++;
    h->count++;
    h->max_ns = time_ns > h->max_ns ? time_ns : h->max_ns;
}

void times_add(struct fsn_histogram *sum, const struct fsn_histogram *from,
               const struct fsn_histogram *to) {
    for (uint32_t b = 0; b < FSN_BUCKETS; b++) {
        sum->bucket[b] += to->bucket[b] - from->bucket[b];
    }
    sum->count += to->count - from->count;
    sum->max_ns = to->max_ns > sum->max_ns ? to->max_ns : sum->max_ns;
}

/** The time that a share of all times does not exceed, between the ends of its bucket by rank: two
 *  medians are compared, and a bucket is as wide as what they may differ by. */
static uint64_t at_most(const struct fsn_histogram *h, uint32_t per_million) {
    const uint64_t rank = (h->count * per_million + 999999) / 1000000;
    uint64_t below = 0;
    for (uint32_t b = 0; b + 1 < FSN_BUCKETS; b++) {
        if (h->bucket[b] > 0 && below + h->bucket[b] >= rank) {
            const uint64_t floor_ns = fsn_histogram_floor(b);
            const uint64_t wide_ns = fsn_histogram_floor(b + 1) - floor_ns;
            const uint64_t time_ns = floor_ns + wide_ns * (rank - below) / h->bucket[b];
            return time_ns < h->max_ns ? time_ns : h->max_ns;
        }
        below += h->bucket[b];
    }
    return h->max_ns;
}

double times_median_per_s(const struct fsn_histogram *period) {
    const uint64_t median_ns = at_most(period, 500000);
    return median_ns > 0 ? 1e9 / (double)median_ns : 0;
}

void times_print(const char *name, const struct fsn_histogram *h) {
    printf("\"%s\":{\"count\":%llu,\"p50_ns\":%llu,\"p99_ns\":%llu,\"p999_ns\":%llu,"
           "\"max_ns\":%llu}",
           name, (unsigned long long)h->count, (unsigned long long)at_most(h, 500000),
           (unsigned long long)at_most(h, 990000), (unsigned long long)at_most(h, 999000),
           (unsigned long long)h->max_ns);
}
