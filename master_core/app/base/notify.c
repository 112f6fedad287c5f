#define _GNU_SOURCE

#include "app/base/notify.h"

#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

static int fd = -1;
static struct sockaddr_un address;
static socklen_t address_bytes;
static uint64_t watchdog_ns;

void notify_begin(void) {
    const char *path = getenv("NOTIFY_SOCKET");
    const char *usec = getenv("WATCHDOG_USEC");
    const char *pid = getenv("WATCHDOG_PID");
    if (path == NULL || (path[0] != '/' && path[0] != '@') || path[1] == 0 ||
        strlen(path) >= sizeof address.sun_path) {
        return;
    }
    fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    address.sun_family = AF_UNIX;
    memcpy(address.sun_path, path, strlen(path));
    address_bytes = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + strlen(path));
    if (path[0] == '@') {
        address.sun_path[0] = 0; /* the abstract name space */
    }
    if (usec != NULL && (pid == NULL || strtol(pid, NULL, 10) == (long)getpid())) {
        watchdog_ns = strtoull(usec, NULL, 10) * 1000 / 2;
    }
}

void notify(const char *lines) {
    /* A manager that does not listen does not prevent the start. */
    if (fd >= 0 && sendto(fd, lines, strlen(lines), MSG_NOSIGNAL | MSG_DONTWAIT,
                          (const struct sockaddr *)&address, address_bytes) < 0) {
        return;
    }
}

uint64_t notify_watchdog_ns(void) {
    return watchdog_ns;
}
