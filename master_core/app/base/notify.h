/** Notifications to a service manager through $NOTIFY_SOCKET; without one nothing is sent. */
#ifndef FSN_APP_NOTIFY_H
#define FSN_APP_NOTIFY_H

#include <stdint.h>

/** Reads the environment. Call once. */
void notify_begin(void);

/** Sends lines such as "READY=1\nSTATUS=…". */
void notify(const char *lines);

/** Half the time after which the manager considers this process dead; 0: it does not monitor. */
uint64_t notify_watchdog_ns(void);

#endif
