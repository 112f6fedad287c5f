/** The side of the process that drives the bus: which process may follow it, and when. Control
 *  thread. */
#ifndef FSN_APP_HANDOVER_LISTENER_H
#define FSN_APP_HANDOVER_LISTENER_H

#include <poll.h>

#include "app/base/options.h"
#include "app/takeover/handover.h"
#include "fsn/bus.h"

enum { HANDOVER_LISTENER_FDS = 2 };

enum handover_listener_state {
    HANDOVER_LISTENER_FREE,    /**< no connection */
    HANDOVER_LISTENER_KNOCKS,  /**< connected, no request yet */
    HANDOVER_LISTENER_RESTS,   /**< the acyclic work must pause before anything is passed on */
    HANDOVER_LISTENER_GIVEN,   /**< it has the lock, and everything needed to follow */
    HANDOVER_LISTENER_FOLLOWED /**< it is the standby; the acyclic work continues */
};

struct handover_listener {
    int lock; /**< of the interface, owned by the bus; -1: the bus is closed */
    int peer; /**< the connected process, or -1 */
    /** The last process that received the lock; -1: none. No other process gets it before that one
     *  has ended: a frozen process may resume, and would assume that it is next. */
    int successor;
    int pidfd;         /**< of the peer, until it receives the lock */
    pid_t pid;         /**< of the peer */
    uint64_t given_ns; /**< when the peer received the lock */
    uint64_t away_ns;  /**< time of the last logged rejection */
    bool held;         /**< maintenance: the standby does not take over */
    enum handover_listener_state state;
};

/** Data for its answers. */
struct handover_listener_facts {
    const struct options *options;
    const struct fsn_plan *plan;
    bool in_op; /**< every SubDevice is in OP, and no stop is in progress */
};

/** Requested action. */
enum handover_listener_event {
    HANDOVER_LISTENER_NOTHING,
    HANDOVER_LISTENER_REST,  /**< pause the acyclic work, then call handover_listener_give() */
    HANDOVER_LISTENER_GO_ON, /**< the peer has disconnected or was rejected: the acyclic work
                              * continues */
    HANDOVER_LISTENER_END    /**< the bus is the successor's: stop the cycle,
                                handover_listener_say_end(), end the process */
};

/** Data passed to the successor. */
struct handover_listener_gift {
    struct fsn_bus_attachment attachment;
    int listener, room;
    size_t room_bytes;
};

/** Initialises it; no process can connect. */
void handover_listener_init(struct handover_listener *handover_listener);

/** The bus is open: accepts successors through its lock. -1: the bus cannot be handed over. */
void handover_listener_open(struct handover_listener *handover_listener, int lock);

/** Informs the standby, and later ones, whether it may take over; see HANDOVER_HOLD. */
void handover_listener_hold(struct handover_listener *handover_listener, bool held);

/** Whether a successor has all data that it needs to continue when this process ends. */
bool handover_listener_is_followed(const struct handover_listener *handover_listener);

/** The bus is about to close: no successor is accepted any longer. */
void handover_listener_close(struct handover_listener *handover_listener);

/** Descriptors and time to wait for. */
void handover_listener_prepare(const struct handover_listener *handover_listener,
                               struct pollfd fds[HANDOVER_LISTENER_FDS]);

/** Serves the results of poll(). */
enum handover_listener_event handover_listener_serve(struct handover_listener *handover_listener,
                                                     const struct pollfd fds[HANDOVER_LISTENER_FDS],
                                                     const struct handover_listener_facts *facts);

/** Gives the peer its data; the acyclic work pauses. */
enum handover_listener_event handover_listener_give(struct handover_listener *handover_listener,
                                                    const struct handover_listener_gift *gift);

/** The cycle has stopped. */
void handover_listener_say_end(const struct handover_listener *handover_listener);

#endif
