/** The side of a process that takes a running bus over from another one: the former. */
#ifndef FSN_APP_FORMER_H
#define FSN_APP_FORMER_H

#include "app/base/backends.h"
#include "app/base/options.h"
#include "fsn/handover.h"

/** So many bus cycles, as counted in wake-ups of the standby that came in time, and at least
 *  FORMER_STILL_MS: the former has stopped. A machine that stands still stops both, and counts
 *  nothing. */
enum { FORMER_STILL_CYCLES = 10, FORMER_STILL_MS = 5 };

struct former {
    int fd;    /**< connection to it */
    int pidfd; /**< shows its end; what sends it a signal */
    pid_t pid;
    int lock, listener;
    void *room; /**< in which it shows its cycles */
    size_t room_bytes;
    struct fsn_bus_attachment attachment;
    bool ended; /**< its bus is ours */
    bool again; /**< it refuses for now; later it may not */
};

/** Connects to the process that drives the bus, and gets from it what the bus needs to attach. The
 *  former goes on; its acyclic work rests until former_release().
 *  @return -1, else the exit code; then it has said why. */
int former_find(struct former *former, const struct options *options, const struct fsn_plan *plan,
                const struct fsn_backend *backend);

/** Follows as standby: until the former has ended by itself, or its cycles have stopped.
 *  @param[in] cycle_ns  the bus cycle; FORMER_STILL_CYCLES without a cycle are a stop.
 *  @param[in] turn      called again and again, with what follows; false: give up.
 *  @retval FSN_OK           former_kill(), then the bus may be taken over.
 *  @retval FSN_E_BUS_BUSY   the former closes the bus itself.
 *  @retval FSN_E_STATE      given up, or the former has ended while the take-over was held.
 *  Costs some microseconds in every half bus cycle. */
fsn_status former_follow(struct former *former, uint64_t cycle_ns, bool (*turn)(void *self),
                         void *self, struct fsn_fault *fault);

/** Ends the former with SIGKILL and waits for its end.
 *  @param[in] priority  of SCHED_FIFO for its threads, where this is permitted: a thread that is
 *                       killed has to run to its end, and would wait for others; 0: as they are.
 *  @retval  as former_end(). */
fsn_status former_kill(struct former *former, int priority, struct fsn_fault *fault);

/** Ends the former, which leaves every SubDevice in OP, and waits for its end: requests it, and
 *  sends SIGKILL where it is silent or its cycle stands.
 *  @retval FSN_OK       it has ended: whoever attached may send.
 *  @retval FSN_E_STATE  it has not, whatever was done; nothing may be sent.
 *  @retval FSN_E_BUS_BUSY  it closes the bus itself. */
fsn_status former_end(struct former *former, struct fsn_fault *fault);

/** Goes on from what the former has shown last.   @retval as fsn_room_read(), fsn_core_continue()
 */
fsn_status former_continue(const struct former *former, struct fsn_core *core,
                           struct fsn_statistics *last);

/** Closes all that came from it; where it goes on, it goes on alone. */
void former_release(struct former *former);

#endif
