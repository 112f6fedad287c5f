/** The side of the process that drives the bus: who may follow it, and when. Control thread. */
#ifndef FSN_APP_DOOR_H
#define FSN_APP_DOOR_H

#include <poll.h>

#include "app/base/options.h"
#include "app/takeover/handover.h"
#include "fsn/bus.h"

enum { DOOR_FDS = 2 };

enum door_state {
    DOOR_FREE,    /**< nobody is connected */
    DOOR_KNOCKS,  /**< somebody is, and has not said yet what it wants */
    DOOR_RESTS,   /**< the acyclic work is to rest before anything is given */
    DOOR_GIVEN,   /**< it has the lock, and all it needs to follow */
    DOOR_FOLLOWED /**< it is the standby; the acyclic work goes on */
};

struct door {
    int lock; /**< of the interface, the bus's; -1: the bus is closed */
    int peer; /**< the process that is connected, or -1 */
    /** Of the last process that was given the lock; -1: none. Nobody else is, before it has ended:
     *  one that is frozen thaws, and would believe that it is the next. */
    int successor;
    int pidfd;         /**< of the peer, until it is given the lock */
    pid_t pid;         /**< of the peer */
    uint64_t given_ns; /**< when the peer was given the lock */
    uint64_t away_ns;  /**< when somebody was turned away and logged, the last time */
    bool held;         /**< maintenance: the standby takes nothing over */
    enum door_state state;
};

/** What it needs to know to answer. */
struct door_facts {
    const struct options *options;
    const struct fsn_plan *plan;
    bool in_op; /**< every SubDevice is in OP, and no stop is under way */
};

/** What is to be done. */
enum door_event {
    DOOR_NOTHING,
    DOOR_REST,  /**< let the acyclic work rest, then call door_give() */
    DOOR_GO_ON, /**< the peer has gone or was refused: the acyclic work goes on */
    DOOR_END    /**< the bus is the successor's: stop the cycle, door_say_end(), end the process */
};

/** What is given. */
struct door_gift {
    struct fsn_bus_attachment attachment;
    int listener, room;
    size_t room_bytes;
};

/** Nobody can reach it. */
void door_init(struct door *door);

/** The bus is open: takes successors by its lock. -1: the bus cannot be handed over. */
void door_open(struct door *door, int lock);

/** Says to the standby whether it may take over, also the next one; see HANDOVER_HOLD. */
void door_hold(struct door *door, bool held);

/** Whether somebody has all it needs to go on where this process ends. */
bool door_is_followed(const struct door *door);

/** The bus is to be closed: nobody follows any more. */
void door_close(struct door *door);

/** What to wait for. */
void door_prepare(const struct door *door, struct pollfd fds[DOOR_FDS]);

/** Serves what poll() found. */
enum door_event door_serve(struct door *door, const struct pollfd fds[DOOR_FDS],
                           const struct door_facts *facts);

/** Gives the peer what it needs; the acyclic work rests. */
enum door_event door_give(struct door *door, const struct door_gift *gift);

/** The cycle has stopped. */
void door_say_end(const struct door *door);

#endif
