/** Three sets of the same data: one filled by the writer, one used by the reader, and one between
 *  them. A complete set changes hands by one exchange, so neither side waits and the reader never
 *  gets an incomplete set. */
#ifndef FSN_TRIPLE_H
#define FSN_TRIPLE_H

#include <stdbool.h>
#include <stdint.h>

#include "rt/atomics.h"

enum { FSN_TRIPLE_SETS = 3, FSN_TRIPLE_FRESH = 4 };

struct fsn_triple {
    _Atomic uint32_t between; /**< number of the set between them; FSN_TRIPLE_FRESH: newer */
    uint32_t writer, reader;  /**< numbers of their sets, each accessed by its own side only */
};

static inline void fsn_triple_init(struct fsn_triple *triple) {
    triple->reader = 0;
    atomic_init(&triple->between, 1);
    triple->writer = 2;
}

/** Publishes the set that the writer has filled, and gives it another one. */
static inline void fsn_triple_publish(struct fsn_triple *triple) {
    triple->writer = atomic_exchange_explicit(&triple->between, triple->writer | FSN_TRIPLE_FRESH,
                                              memory_order_acq_rel) &
                     ~(uint32_t)FSN_TRIPLE_FRESH;
}

/** Gives the reader the newest set; returns whether it differs from the previous one. */
static inline bool fsn_triple_take(struct fsn_triple *triple) {
    if ((atomic_load_explicit(&triple->between, memory_order_relaxed) & FSN_TRIPLE_FRESH) == 0) {
        return false;
    }
    triple->reader =
        atomic_exchange_explicit(&triple->between, triple->reader, memory_order_acq_rel) &
        ~(uint32_t)FSN_TRIPLE_FRESH;
    return true;
}

#endif
