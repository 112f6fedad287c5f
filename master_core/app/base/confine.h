/** Restrictions of the running program: system calls for the whole process, capabilities thread by
 *  thread. They limit the effect of a defect in the code that reads requests of clients. */
#ifndef FSN_APP_CONFINE_H
#define FSN_APP_CONFINE_H

/** Leaves every thread of the process, and those that follow, the system calls that the program
 *  makes while it runs. Any other one fails with ENOSYS, so that a C library continues without it;
 *  starting another program ends the process.
 *  @return 0, or errno; then nothing is restricted. Nothing at all under a sanitizer. */
int confine_process(void);

/** Takes from the calling thread, and from threads that it starts, every capability but
 *  CAP_IPC_LOCK, without which locked memory cannot grow, and for root CAP_DAC_OVERRIDE, with
 *  which it writes files of others as before.
 *  @return 0, or errno. */
int confine_thread(void);

#endif
