/** A bus, objects, an SII and a time of the test's own, and the control server on them, without a
 *  socket: for the requests of test_replies.c. */
#ifndef FSN_TEST_REPLIES_RIG_H
#define FSN_TEST_REPLIES_RIG_H

#include "control_host.h"
#include "emulated_rig.h"

enum { SUBS = 3, IMAGE = 84, SII_BYTES = 512 };

struct replies_rig {
    struct fsn_plan *plan;
    struct fsn_core *core;
    struct fsn_control *control;
    struct fsn_client *client;
    uint8_t image[IMAGE], frames[IMAGE];
    uint32_t base[2 * SUBS], begin[1];
    struct fsn_bus_input input;
    struct fsn_wkc wkc;
    struct fsn_bus_subdevice seen[SUBS];
    struct fsn_bus_acyclic acyclic;
    struct fsn_bus_ops ops;
    uint8_t sii[SII_BYTES];
    uint8_t written[8];
    uint32_t written_bytes;
    fsn_status fails; /**< answer of every transfer instead */
    bool goes_on, stateless, no_coe;
    uint8_t clocks; /**< enum fsn_clocks */
    time_t takes_s; /**< each upload */
    uint64_t now_ns;
    unsigned dropped, refused; /**< without memory */
    unsigned count_of, count;  /**< an object that has so many entries instead; 0: none */
    uint8_t history[2];        /**< places for messages, and the newest */
    char read[16384];          /**< which objects were, since the last request */
};

extern struct replies_rig on;
extern struct fsn_control_host host;
/** A job that was submitted and not done; NULL: none. */
extern struct fsn_job *waiting;

void set_up(void);
void tear_down(void);
void cycle(void);
/** Data of the rig for transfers. */
struct fsn_job_context context_of(void);
/** The acyclic thread: does the job that waits. */
void do_job(void);
/** Takes a job, as the program around does. */
void submit(void *self, struct fsn_job *job);
/** Data of the bus about a SubDevice that is not in the plan. */
fsn_status member(void *bus, uint32_t position, struct fsn_bus_member *m);

#endif
