/** The SOEM backend, its segment on a veth pair, and long time limits: on a busy machine frames
 *  come late, and SOEM gives up after milliseconds. Nothing here asserts a speed. */
#ifndef FSN_TEST_SOEM_RIG_H
#define FSN_TEST_SOEM_RIG_H

#include "builder.h"
#include "fsn/fsn.h"
#include "fsn/live.h"
#include "fsn/segment.h"

enum { SUBDEVICES = 4, FRAME = 6, PATIENCE_MS = 20000, OPEN_PATIENCE_MS = 120000, TRIES = 20 };

struct rig {
    uint8_t *bytes;
    struct fsn_plan *plan, *plan_of_segment;
    struct fsn_segment *segment;
    void *bus;
    struct fsn_core *core;
    struct fsn_fault fault;
    struct fsn_live_options live; /**< as the bus is opened */
    uint8_t beat;                 /**< data of the SubDevices, changed by each check */
};

/** A network namespace with a veth pair; false where this user may not make one. */
bool make_network(void);
uint64_t now_ns(void);
void pause_ms(long ms);
/** A main at position 0 and three subs after it. */
uint8_t *build(size_t *len);

/** Puts SubDevices on the far end, or on both far ends. They answer in time however busy this
 *  machine is: where it may, their thread goes before others. */
void link_segment(struct fsn_segment *segment, const char *second);
struct rig *set_up_with(const char *second);
/** The subs start SYNC0, and clocks are on for that alone. */
struct rig *set_up_with_sync(void);
/** With plans of the test's own: one for the bus, one of the same length for the segment. */
struct rig *set_up_plans(const char *second, uint8_t *bytes, const uint8_t *of_segment, size_t len);
struct rig *set_up(void);
/** Opens the bus once. */
fsn_status open_bus(struct rig *rig);
/** Frees the result of open_bus(). */
void close_bus(struct rig *rig);
/** Opens the bus, starts the cycle and brings all to OP. */
struct rig *bring_up_from(struct rig *rig);
struct rig *bring_up(void);
void tear_down(struct rig *rig);

struct fsn_bus_subdevice look(struct rig *rig, uint32_t n);
struct fsn_statistics statistics(struct rig *rig);
/** Skipped cycles and late replies so far: if the number grows, this machine was too busy, which is
 *  why SubDevices were lost meanwhile. */
uint64_t lateness(struct rig *rig);
/** Polls the bus until a SubDevice has an AL state, or none (0); fails after a long time. */
void poll_until(struct rig *rig, uint32_t n, uint8_t al_state);
void poll_until_all_in_op(struct rig *rig);
/** Whether a frame goes from sub `k` to its place in the main, and one from there to the sub; waits
 *  long for it. */
bool flows(struct rig *rig, uint32_t k);
/** The same where none is expected: it waits 200 ms. */
bool flows_soon(struct rig *rig, uint32_t k);

#endif
