/** The cyclic wire against a segment of the test's own, at a time of its own: clock, ppoll() and
 *  recvmsg() of these programs replace those of libc. */
#ifndef FSN_TEST_WIRE_RIG_H
#define FSN_TEST_WIRE_RIG_H

#include <poll.h>
#include <sys/types.h>
#include <time.h>

#include "builder.h"
#include "live/frames.h"

enum { MOST = 300, LEN = 1600 };

#define REALTIME_NS UINT64_C(1700000000123456789)
#define MONOTONIC_NS UINT64_C(86400987654321)
#define DC_TIME_NS UINT64_C(0x1111111111111111) /* expected at that time */

struct rig;

/** A piece of control data with a packet. */
struct control {
    int level, type;
    struct timespec at;
};

struct wall {
    uint64_t monotonic_ns, realtime_ns;
    struct control control[3]; /**< with the next packets, if there is a type */
    uint64_t later_ns;         /**< the timestamp of each packet is this much later than the last
                                * one */
    unsigned interrupts;       /**< number of times a read is interrupted */
    unsigned flood;            /**< number of reads that get the last packet once more */
    unsigned reads;
    void (*while_waiting)(struct rig *rig); /**< events while ppoll() waits */
    struct rig *rig;
    uint64_t waited_ns; /**< longest time that ppoll() was to wait */
    nfds_t polled;
};

extern struct wall wall;

/** Two SubDevices of the e-stop plan: image bytes 0..8 and 17..24 are outputs, the others inputs.
 */
struct rig {
    uint8_t *bytes;
    struct fsn_plan *plan;
    struct fsn_frames frames;
    int far[2];
    struct fsn_wkc wkc[2];
    uint8_t stale[8];
    struct fsn_bus_input input;
    uint8_t queue[MOST][LEN]; /**< frames that the segment holds */
    ssize_t length[MOST];
    unsigned queued;
    bool present[2];
    uint8_t fill; /**< data of the SubDevices */
};

struct rig *set_up_plan(unsigned ports, uint8_t *bytes, size_t len);
/** The e-stop plan. */
struct rig *set_up(unsigned ports);
void tear_down(struct rig *rig);

/** Adds to a working counter. */
void count_up(uint8_t *at, uint16_t by);
/** Effect of SubDevice `n` on a frame that passes. */
void visit(const struct rig *rig, unsigned n, uint8_t *frame);
/** Takes the next frame from a port into the queue; false when there is none. */
bool hold(struct rig *rig, unsigned port);
/** Sends a frame of the queue back. */
void answer(struct rig *rig, unsigned number, unsigned port);
/** Sends one cycle; all SubDevices answer. */
void exchange(struct rig *rig);
/** Receives, and keeps the result. */
void take(struct rig *rig);
/** Whether the inputs of both SubDevices hold these bytes. */
bool inputs_are(const struct rig *rig, uint8_t first, uint8_t second);

#endif
