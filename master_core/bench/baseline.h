/** What the copy engine is measured against; in a file of its own so that nothing is inlined. */
#ifndef FSN_BASELINE_H
#define FSN_BASELINE_H

#include <stddef.h>
#include <stdint.h>

struct plain_copy {
    void *to;
    const void *from;
    size_t size_bytes;
};

/** A loop over (to, from, size), one memcpy each: what drivers do today. */
void plain_loop(const struct plain_copy *copies, size_t count);

/** Sizes the benchmark makes: four frames alone, and runs of them that merge. */
#define BASELINE_SIZES(X) X(6) X(7) X(11) X(31) X(55) X(110) X(220)

/** Offsets of the copies of one size. */
struct constant_part {
    size_t size_bytes, count;
    const uint32_t (*offset)[2]; /**< source, destination */
};

/** One memcpy of constant size for every copy, one loop per size, nothing to decide
 *  but which loop comes next: the fastest code that moves these bytes from a table. */
void constant_sizes(uint8_t *image, const struct constant_part *parts, size_t count);

#endif
