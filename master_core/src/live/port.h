/** A network interface as a MainDevice uses it: alone, with raw sockets. */
#ifndef FSN_PORT_H
#define FSN_PORT_H

#include "fsn/status.h"
#include <stdbool.h>

/** Opens the cyclic socket of an interface: it sees replies with indices of the cyclic frames only.
 *  @param[in]  stamp   whether the kernel shall note when packets came in.
 *  @param[out] socket  to be closed by the caller; -1 on refusal.
 *  @retval FSN_E_SYS    the system refused, sys_errno says why: EPERM when CAP_NET_RAW is
 *                       missing, ENODEV without such an interface.
 *  Details go to `fault`. */
fsn_status fsn_port_open(const char *interface, bool stamp, int *socket, struct fsn_fault *fault);

/** Lets a socket of the acyclic side see whole EtherCAT packets with indices below those of the
 *  cyclic frames, and none that this host sent. */
fsn_status fsn_port_filter_acyclic(int socket);

/** Makes sure that nobody else of this host's network namespace uses the interface with us.
 *  @param[out] lock  to be kept open as long as the interface is used; -1 on refusal.
 *  @retval FSN_E_BUS_BUSY  somebody does. */
fsn_status fsn_port_lock(const char *interface, int *lock, struct fsn_fault *fault);

/** Listens whether another MainDevice talks on the interface.
 *  @param[in] listen_ns  how long.
 *  @retval FSN_E_BUS_BUSY  it does; the detail says what was heard. */
fsn_status fsn_port_listen(const char *interface, uint64_t listen_ns, struct fsn_fault *fault);

/** Whether the interface is up and has a link. */
bool fsn_port_has_link(const char *interface);

#endif
