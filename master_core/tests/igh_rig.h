/** The backend on IgH against a master in memory (tests/fake). */
#ifndef FSN_TEST_IGH_RIG_H
#define FSN_TEST_IGH_RIG_H

#include "builder.h"
#include "fake.h"
#include "fsn/fsn.h"
#include "fsn/live.h"

enum { MS = 1000000, ADDRESS = 14, KNOWN_ADDRESS = 2 };

struct rig {
    struct fsn_plan *plan;
    void *bus;
    struct fsn_core *core;
    struct fsn_fault fault;
    uint64_t now_ns;
};

/** The e-stop pair as plan and as devices; the plan has the FSoE address of the second one. */
struct rig *set_up(void);
/** set_up(), the bus opened, both in OP. */
struct rig *bring_up(void);
void tear_down(struct rig *rig);

/** Bytes of a record of the plan. */
uint8_t *record(struct rig *rig, uint32_t section, uint32_t number);
fsn_status open_with(struct rig *rig, uint32_t dc_every);
/** Opening is refused with a text; takes the rig down. */
void refuses(struct rig *rig, fsn_status status, const char *detail);
struct fsn_bus_subdevice look(struct rig *rig, uint32_t n);
/** Cycles of 1 ms, each with one step of the acyclic work; returns the result of the last one. */
bool run(struct rig *rig, unsigned cycles, uint8_t goal);
struct fsn_statistics snapshot(struct rig *rig);
bool is_in_op(struct rig *rig, uint32_t n);
/** Cycles until both are in OP. */
void reach_op(struct rig *rig);

#endif
