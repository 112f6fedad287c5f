/** Exclusive use of a network interface by a MainDevice, with raw sockets. */
#ifndef FSN_PORT_H
#define FSN_PORT_H

#include <stdbool.h>
#include <stdint.h>

#include "fsn/status.h"

struct ifreq;

/** Source address of all our frames, which distinguishes them from those of another MainDevice:
 *  FSN_PORT_OURS, two bytes of our choice, the tag. The first SubDevice sets the bit of a locally
 *  administered address, which is already set here. */
enum { FSN_PORT_OURS = 0x0246, FSN_PORT_SOURCE = 6, FSN_PORT_TAG = 10 };

/** Asks the system about an interface, on a socket that a hardened service also has.
 *  @param[in,out] request  its name is filled in here.   @return false with errno set. */
bool fsn_port_ask(const char *interface, unsigned long what, struct ifreq *request);

/** Returns the tag of an interface: it differs from those of other computers, and stays the same
 *  when the bus is started again. */
uint16_t fsn_port_tag(const char *interface);

/** Opens the cyclic socket of an interface: it receives only replies to our cyclic frames.
 *  @param[in]  stamp   whether the kernel timestamps received packets.
 *  @param[out] socket  to be closed by the caller; -1 on refusal.
 *  @retval FSN_E_SYS    a system call failed, see sys_errno: EPERM when CAP_NET_RAW is missing,
 *                       ENODEV without such an interface.
 *  Details go to `fault`. */
fsn_status fsn_port_open(const char *interface, uint16_t tag, bool stamp, int *socket,
                         struct fsn_fault *fault);

/** Lets a socket of the acyclic side receive complete EtherCAT packets of ours with indices below
 *  those of the cyclic frames. */
fsn_status fsn_port_filter_acyclic(int socket, uint16_t tag);

/** Opens a socket for fsn_port_count_foreign().
 *  @param[out] socket  to be closed by the caller; -1 on refusal. */
fsn_status fsn_port_open_foreign(const char *interface, uint16_t tag, int *socket,
                                 struct fsn_fault *fault);

/** Returns the number of EtherCAT frames received since the last call that are not ours. */
uint32_t fsn_port_count_foreign(int socket);

/** Ensures that no other process in this network namespace uses the interface.
 *  @param[out] lock  must be kept open while the interface is used; -1 on refusal.
 *  @retval FSN_E_BUS_BUSY  another process uses it. */
fsn_status fsn_port_lock(const char *interface, int *lock, struct fsn_fault *fault);

/** Connects to the process that has the lock of an interface; see `reach` of fsn_backend. */
fsn_status fsn_port_reach(const char *interface, int *fd, struct fsn_fault *fault);

/** Discards the packets that are waiting in a socket. */
void fsn_port_discard(int socket);

/** Listens for another MainDevice on the interface.
 *  @param[in] listen_ns  duration.
 *  @retval FSN_E_BUS_BUSY  there is one; the detail describes the frames. */
fsn_status fsn_port_listen(const char *interface, uint64_t listen_ns, struct fsn_fault *fault);

/** Refuses an interface because a system call failed, for the reason in errno.
 *  @param[in] permission  added where that is EPERM.   @return FSN_E_SYS. */
fsn_status fsn_port_refuse(struct fsn_fault *fault, const char *interface, const char *rule,
                           const char *permission);

/** Sends a frame that no SubDevice processes; returns 0, or errno if it cannot be sent. */
int fsn_port_try(const char *interface);

/** Whether the interface is up and has a link. */
bool fsn_port_has_link(const char *interface);

#endif
