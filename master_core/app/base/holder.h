/** The processes that hold a UNIX socket: the lock of an interface, or a control socket. */
#ifndef FSN_APP_HOLDER_H
#define FSN_APP_HOLDER_H

enum { HOLDER_TEXT_BYTES = 480 };

/** Describes up to two holders: pid, program, user, start, whether it is stopped, and the next
 * step.
 *  @param[in] name   of the socket as in /proc/net/unix: "@fsn-maindevice:eth1", or an absolute
 * path.
 *  @param[out] room  empty if nothing holds it.   @return room.
 *  Context: reads /proc; not in the cyclic thread. */
const char *holder_text(const char *name, char room[HOLDER_TEXT_BYTES]);

#endif
