/** Included before SOEM's nicdrv.c, which does not open an interface that refuses promiscuous mode.
 *  That needs CAP_NET_ADMIN. EtherCAT frames go to the broadcast address, so they arrive without.
 */
#ifndef FSN_SOEM_PROMISCUOUS_H
#define FSN_SOEM_PROMISCUOUS_H

#include <errno.h>
#include <sys/ioctl.h>

static inline int fsn_soem_ioctl(int fd, unsigned long request, void *argument) {
    const int result = ioctl(fd, request, argument);
    return result != 0 && request == SIOCSIFFLAGS && errno == EPERM ? 0 : result;
}

#define ioctl fsn_soem_ioctl

#endif
