/** Memory that runs out when a test requests it. Not with a sanitizer: it has its own allocator. */
#ifndef FSN_TEST_HEAP_H
#define FSN_TEST_HEAP_H

struct heap {
    long fails_in; /**< number of the allocation that fails, from now on; 0: none */
    long alive;    /**< allocations that were not freed */
};

extern struct heap heap;

/** heap.alive; 0 with a sanitizer, which detects leaks itself. */
static inline long heap_alive(void) {
#ifdef FSN_TEST_HEAP
    return heap.alive;
#else
    return 0;
#endif
}

#endif
