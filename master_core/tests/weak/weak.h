/** A model checker for the memory of C11: it calls functions of two threads again and again, until
 * a load has returned every value that the standard permits.
 *
 *  Each location keeps all its values. A thread has a view: the oldest value of each location that
 *  it may still read. A release passes the view on with a value, an acquire takes it over. This is
 *  the view-based semantics of release and acquire (RC11 without sequential consistency); it does
 *  not model loads that wait for a later store of their own thread.
 *
 *  Threads take turns by whole functions. That is complete where each location has one writer, or
 * is changed by exchange only: a load that comes first is the same as one that reads an older
 * value. */
#ifndef FSN_WEAK_H
#define FSN_WEAK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum weak_order {
    memory_order_relaxed,
    memory_order_acquire,
    memory_order_release,
    memory_order_acq_rel,
    memory_order_seq_cst
};

enum { WEAK_THREADS = 2, WEAK_SITES = 16 };

/** One order in the tested source. */
struct weak_site {
    const char *file;
    int line;
    enum weak_order order;
};

uint64_t weak_load(const volatile void *at, size_t bytes, const char *file, int line,
                   enum weak_order order);
void weak_store(volatile void *at, size_t bytes, const char *file, int line, enum weak_order order,
                uint64_t value);
uint64_t weak_exchange(volatile void *at, size_t bytes, const char *file, int line,
                       enum weak_order order, uint64_t value);
void weak_fence(const char *file, int line, enum weak_order order);

/** The functions that follow run in this thread. */
void weak_thread(uint32_t thread);

/** Returns a number below `count`; another one in each repetition. */
uint32_t weak_choose(uint32_t count);

/** Data that is not atomic is read or written; reports a race, which the standard leaves undefined.
 */
void weak_data(const void *data, bool is_write);

/** Ends the run with a violation. */
void weak_violation(void);

/** Called before each store, for data that the code accesses just before it. */
extern void (*weak_before_store)(const volatile void *at, uint64_t value);

struct weak_result {
    uint64_t runs;
    bool violated; /**< by the last run */
};

/** Calls `run` for every choice, up to the first violation.
 *  @param[in] weakened  this order is `as` in these runs; NULL: all are as in the source. */
struct weak_result weak_explore(void (*run)(void), const struct weak_site *weakened,
                                enum weak_order as);

/** Orders in the source that are stronger than relaxed and were met since the last exploration
 *  without a weakened one began; returns their number. */
uint32_t weak_sites(struct weak_site sites[WEAK_SITES]);

#endif
