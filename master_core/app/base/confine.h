/** Restrictions of the running program: system calls for the whole process, capabilities thread by
 *  thread. They limit the effect of a defect in the code that reads requests of clients. */
#ifndef FSN_APP_CONFINE_H
#define FSN_APP_CONFINE_H

#include <stdbool.h>

/** Restricts every thread of the process, including later ones, to the system calls that the
 *  program makes while it runs. Any other call fails with ENOSYS, so that a C library continues
 *  without it; starting another program ends the process.
 *  @param[in] xdp  whether it opens AF_XDP sockets, and loads the program that feeds them.
 *  @return 0, or errno; then nothing is restricted. Nothing at all under a sanitizer. */
int confine_process(bool xdp);

/** Removes every capability from the calling thread, and from threads that it starts, except
 *  CAP_IPC_LOCK, without which locked memory cannot grow. Root also keeps CAP_DAC_OVERRIDE, so that
 *  it can still write files of other users.
 *  @return 0, or errno. */
int confine_thread(void);

#endif
