/** The side of a process that takes over a running bus from another one: the predecessor. */
#ifndef FSN_APP_PREDECESSOR_H
#define FSN_APP_PREDECESSOR_H

#include "app/base/backends.h"
#include "app/base/options.h"
#include "fsn/handover.h"

/** The predecessor has stopped after this number of bus cycles, counted in timely wake-ups of the
 *  standby, and at least PREDECESSOR_STILL_MS. A stalled machine stops both processes, and counts
 *  nothing. */
enum { PREDECESSOR_STILL_CYCLES = 10, PREDECESSOR_STILL_MS = 5 };

struct predecessor {
    int fd;    /**< connection to it */
    int pidfd; /**< becomes readable at its end; used to send it a signal */
    pid_t pid;
    int lock, listener;
    void *room; /**< memory in which it publishes its cycles */
    size_t room_bytes;
    struct fsn_bus_attachment attachment;
    bool ended; /**< its bus is ours */
    bool again; /**< it refuses for now; later it may accept */
};

/** Connects to the process that drives the bus, and receives the data that the bus needs to attach.
 *  The predecessor continues; its acyclic work pauses until predecessor_release().
 *  @return -1, otherwise the exit code, with the reason logged. */
int predecessor_find(struct predecessor *predecessor, const struct options *options,
                     const struct fsn_plan *plan, const struct fsn_backend *backend);

/** Follows as standby: until the predecessor has ended by itself, or its cycles have stopped.
 *  @param[in] cycle_ns  the bus cycle; PREDECESSOR_STILL_CYCLES without a cycle are a stop.
 *  @param[in] turn      called repeatedly, with the state of the standby; false: give up.
 *  @retval FSN_OK           predecessor_kill(), then the bus may be taken over.
 *  @retval FSN_E_BUS_BUSY   the predecessor closes the bus itself.
 *  @retval FSN_E_STATE      given up, or the predecessor has ended while the take-over was held.
 *  Costs some microseconds in every half bus cycle. */
fsn_status predecessor_follow(struct predecessor *predecessor, uint64_t cycle_ns,
                              bool (*turn)(void *self), void *self, struct fsn_fault *fault);

/** Ends the predecessor with SIGKILL and waits for its end.
 *  @param[in] priority  of SCHED_FIFO for its threads, if permitted: a killed thread must run to
 *        its end, and would otherwise wait for others; 0: unchanged.
 *  @retval  as predecessor_end(). */
fsn_status predecessor_kill(struct predecessor *predecessor, int priority, struct fsn_fault *fault);

/** Ends the predecessor, which leaves every SubDevice in OP, and waits for its end: requests it,
 *  and sends SIGKILL if it is silent or its cycle is stopped.
 *  @retval FSN_OK       it has ended: this process may send.
 *  @retval FSN_E_STATE  it has not ended; nothing may be sent.
 *  @retval FSN_E_BUS_BUSY  it closes the bus itself. */
fsn_status predecessor_end(struct predecessor *predecessor, struct fsn_fault *fault);

/** Continues from the last published cycle of the predecessor.   @retval as fsn_room_read(),
 *  fsn_core_continue()
 */
fsn_status predecessor_continue(const struct predecessor *predecessor, struct fsn_core *core,
                                struct fsn_statistics *last);

/** Closes all descriptors received from it; a predecessor that continues has no successor. */
void predecessor_release(struct predecessor *predecessor);

#endif
