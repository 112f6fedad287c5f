/** Messages between two processes when one follows the other on a bus: complete messages over the
 *  lock of the interface. See docs/explanation/standby.md. */
#ifndef FSN_APP_HANDOVER_H
#define FSN_APP_HANDOVER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "fsn/bus.h"

enum { HANDOVER_FORMAT = 2, HANDOVER_TEXT_BYTES = 400 };

/** The first message, sent by the process that requests to follow. */
struct handover_hello {
    uint32_t format, dc_every;
    uint32_t standby; /**< 1: it follows, and takes over when cycles stop; 0: immediately */
    uint32_t free;
    uint64_t cycle_ns, dc_shift_ns;
    uint32_t dc_host, unused;
    uint8_t plan[FSN_SHA256_BYTES];
    char version[32];
};

/** Descriptors sent with the answer, in this order. */
enum handover_fd {
    HANDOVER_SELF,       /**< pidfd of the process that answers, the only proof of its identity */
    HANDOVER_LOCK,       /**< of the interface: includes the right to follow */
    HANDOVER_LISTENER,   /**< of the control socket */
    HANDOVER_ROOM,       /**< memory in which every cycle is published, see fsn/handover.h */
    HANDOVER_ATTACHMENT, /**< state of the bus, see fsn_bus_attachment */
    HANDOVER_HELD,       /**< and following: kept open until the predecessor has ended */
    HANDOVER_FDS = HANDOVER_HELD + FSN_HELD
};

/** The answer of the process that drives the bus. */
struct handover_answer {
    uint32_t format, taken; /**< 0: refused, see `text` */
    uint32_t again, free;   /**< refused: 1 if it may be granted a moment later */
    int64_t pid;            /**< of the process that answers */
    uint64_t room_bytes, attachment_bytes;
    char text[HANDOVER_TEXT_BYTES];
};

/** Content of the message, one 32 bit number each. */
enum handover_word {
    HANDOVER_END = 1, /**< to the predecessor: end without leaving OP */
    HANDOVER_ENDS,    /**< from it: the cycle has stopped, the process ends now */
    HANDOVER_FOLLOWS, /**< to the predecessor: attached; the acyclic work may continue */
    HANDOVER_LEAVES,  /**< from the predecessor: it closes the bus, without a successor */
    HANDOVER_HOLD,    /**< from it: maintenance, do not take over until HANDOVER_RESUME */
    HANDOVER_RESUME,  /**< from it: the maintenance is over */
};

/** Sends a message with descriptors; false if the other end is closed. */
bool handover_send(int fd, const void *message, size_t len_bytes, const int *fds, size_t fd_count);

/** Receives a message of exactly this length, without waiting.
 *  @param[out] fds  HANDOVER_FDS, to be closed by the caller; -1 if there is none; NULL: none are
 *        accepted.
 *  @return 1, 0 if there is none yet, -1 at the end or for another length. */
int handover_receive(int fd, void *message, size_t len_bytes, int *fds);

/** Returns a pidfd of the process that has connected to a socket, and its credentials from the
 *  kernel; -1 with errno set. Only for the accepting end: for the other end, the kernel returns the
 *  process that listened, which may have ended since. */
int handover_pidfd(int fd, pid_t *pid, uid_t *uid);

/** Closes a descriptor, which is then -1. */
void handover_close(int *fd);

/** Whether a pidfd shows the end of its process: none of its threads runs, its descriptors are
 *  closed. */
bool handover_has_ended(int pidfd, int wait_ms);

#endif
