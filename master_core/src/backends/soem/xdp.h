/** Opens an interface for AF_XDP: only replies to our cyclic frames come through its rings, all
 * other packets go to the sockets of the system as before. */
#ifndef FSN_SOEM_XDP_H
#define FSN_SOEM_XDP_H

#include "fsn/status.h"
#include "rt/rings.h"

/** Opens the rings of an interface.
 *  @param[out] rings  to be closed by soem_xdp_close(); NULL on refusal.
 *  @retval FSN_E_SYS    a system call failed, see sys_errno: EPERM without the capabilities.
 *  @retval FSN_E_STATE  the interface receives on several queues, or has another XDP program.
 *  Details go to `fault`. */
fsn_status soem_xdp_open(const char *interface, uint16_t tag, struct fsn_rings **rings,
                         struct fsn_fault *fault);

/** Closes the rings; NULL is permitted. */
void soem_xdp_close(struct fsn_rings *rings);

#endif
