/** Copy engine against a plain loop over every transfer, and against copies of constant size after
 *  merging. Same buffers, same run; only ratios mean something. */
#define _POSIX_C_SOURCE 200809L

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "baseline.h"
#include "rt/rt.h"

enum { ROUNDS = 21, IMAGE_BYTES = 512 * 1024, MOST = 2000, KINDS = 3 };
enum kind { CORE, CONSTANT, PLAIN };

#define SIZE_ENTRY(n) n,
static const uint32_t sizes[] = {BASELINE_SIZES(SIZE_ENTRY)};
enum { SIZES = sizeof sizes / sizeof sizes[0], FRAMES = 4 };

struct setup {
    uint8_t *image;
    struct plain_copy plain[MOST]; /**< every transfer, in order of its destination */
    uint32_t merged_size[MOST];    /**< merged copies, in order of their destination … */
    uint32_t merged[MOST][2];      /**< … with source and destination */
    uint32_t sorted[MOST][2];      /**< the same by size, as both fast ways want them */
    struct fsn_rt_copy copies[MOST];
    struct fsn_rt_group groups[SIZES];
    struct constant_part parts[SIZES];
    uint32_t plain_count, merged_count, group_count;
};

static uint32_t random_of(uint64_t *seed, uint32_t below) {
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*seed >> 33) % below;
}

/** Lays out `count` transfers. Scattered: gaps after each, so that none merge. Mergeable: runs of
 * 4, 8 or 16 neighbours (6 + 7 + 11 + 31 = 55 bytes each four), gaps after each run. */
static void lay_out(struct setup *s, uint32_t count, bool mergeable) {
    uint64_t seed = 7;
    uint32_t source = 0;
    uint32_t destination = IMAGE_BYTES / 2;
    s->plain_count = s->merged_count = 0;
    while (s->plain_count < count) {
        uint32_t run = mergeable ? 4u << random_of(&seed, 3) : 1;
        run = run <= count - s->plain_count ? run : 4;
        uint32_t size = 0;
        for (uint32_t i = 0; i < run; i++) {
            const uint32_t frame = mergeable ? sizes[i % FRAMES] : sizes[random_of(&seed, FRAMES)];
            s->plain[s->plain_count++] =
                (struct plain_copy){s->image + destination + size, s->image + source + size, frame};
            size += frame;
        }
        s->merged_size[s->merged_count] = size;
        s->merged[s->merged_count][0] = source;
        s->merged[s->merged_count++][1] = destination;
        source += size + 1 + random_of(&seed, 4);
        destination += size + 1 + random_of(&seed, 4);
    }
}

/** Groups the merged copies by size, once for the engine and once for the constant loops. */
static void sort_by_size(struct setup *s) {
    uint32_t used = 0;
    s->group_count = 0;
    for (uint32_t k = 0; k < SIZES; k++) {
        const uint32_t first = used;
        for (uint32_t i = 0; i < s->merged_count; i++) {
            if (s->merged_size[i] == sizes[k]) {
                memcpy(s->sorted[used], s->merged[i], sizeof s->sorted[0]);
                s->copies[used++] = (struct fsn_rt_copy){s->merged[i][0], s->merged[i][1]};
            }
        }
        if (used > first) {
            s->groups[s->group_count] = (struct fsn_rt_group){sizes[k], first, used - first};
            s->parts[s->group_count++] = (struct constant_part){
                sizes[k], used - first, (const uint32_t(*)[2])s->sorted + first};
        }
    }
    if (used != s->merged_count) {
        abort(); /* a size BASELINE_SIZES does not list */
    }
}

static void run(struct setup *s, enum kind kind, uint32_t times) {
    for (uint32_t i = 0; i < times; i++) {
        if (kind == CORE) {
            fsn_rt_copy_all(s->image, s->copies, s->groups, s->group_count);
        } else if (kind == CONSTANT) {
            constant_sizes(s->image, s->parts, s->group_count);
        } else {
            plain_loop(s->plain, s->plain_count);
        }
    }
}

static double now_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int compare(const void *a, const void *b) {
    const double x = *(const double *)a;
    const double y = *(const double *)b;
    return (x > y) - (x < y);
}

/** Median of several rounds; the three ways take turns, so that a busy machine hits all alike. */
static void measure(struct setup *s, double median_ns[KINDS]) {
    static double rounds[KINDS][ROUNDS];
    const uint32_t times = 1000000 / (s->plain_count + 8);
    for (int r = 0; r < ROUNDS; r++) {
        for (int k = 0; k < KINDS; k++) {
            const double start = now_s();
            run(s, (enum kind)k, times);
            rounds[k][r] = 1e9 * (now_s() - start) / times;
        }
    }
    for (int k = 0; k < KINDS; k++) {
        qsort(rounds[k], ROUNDS, sizeof rounds[k][0], compare);
        median_ns[k] = rounds[k][ROUNDS / 2];
    }
}

int main(void) {
    static const uint32_t counts[] = {8, 64, 424, MOST};
    static struct setup s;
    s.image = calloc(1, IMAGE_BYTES);
    if (s.image == NULL) {
        return 1;
    }
    printf("%-10s %-10s %7s %9s %12s %9s %11s %10s\n", "layout", "transfers", "merged", "core ns",
           "constant ns", "loop ns", "core/const", "core/loop");
    for (int mergeable = 0; mergeable < 2; mergeable++) {
        for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
            lay_out(&s, counts[i], mergeable);
            sort_by_size(&s);
            double t[KINDS];
            measure(&s, t);
            printf("%-10s %-10u %7u %9.1f %12.1f %9.1f %11.2f %10.2f\n",
                   mergeable ? "mergeable" : "scattered", s.plain_count, s.merged_count, t[CORE],
                   t[CONSTANT], t[PLAIN], t[CORE] / t[CONSTANT], t[CORE] / t[PLAIN]);
        }
    }
    printf("aims: core/const at most 1.50, core/loop at most 0.50\n");
    free(s.image);
    return 0;
}
