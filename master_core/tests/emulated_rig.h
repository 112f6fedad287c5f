/** A plan on the emulated bus with its core, for the tests that run cycles in memory. */
#ifndef FSN_TEST_EMULATED_RIG_H
#define FSN_TEST_EMULATED_RIG_H

#include "builder.h"
#include "fsn/fsn.h"

struct emulated_rig {
    struct fsn_plan *plan;
    struct fsn_emulated *bus;
    struct fsn_core *core;
    uint64_t now_ns; /**< of the last emulated_rig_cycle() */
};

/** Loads plan bytes, frees them, and opens the bus. */
struct emulated_rig emulated_rig_load(uint8_t *bytes, size_t len_bytes);
/** The same with a plan that is built. */
struct emulated_rig emulated_rig_build(const struct build *build);
void emulated_rig_end(struct emulated_rig *rig);

/** One cycle, a millisecond after the last one. */
void emulated_rig_cycle(struct emulated_rig *rig);

#endif
