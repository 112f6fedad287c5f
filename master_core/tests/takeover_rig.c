#define _GNU_SOURCE

#include "takeover_rig.h"

#include <stdlib.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "builder.h"

struct fsn_plan *takeover_rig_plan(void) {
    size_t len;
    struct fsn_plan *plan;
    uint8_t *bytes = build_full(&len);
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    free(bytes);
    return plan;
}

int takeover_rig_listen(void) {
    const struct sockaddr_un any = {.sun_family = AF_UNIX};
    const int fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    CHECK(fd >= 0 && bind(fd, (const struct sockaddr *)&any, sizeof any.sun_family) == 0);
    return fd;
}

int takeover_rig_connect(int listening) {
    struct sockaddr_un name;
    socklen_t size = sizeof name;
    const int fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    CHECK(fd >= 0 && getsockname(listening, (struct sockaddr *)&name, &size) == 0);
    CHECK(connect(fd, (const struct sockaddr *)&name, size) == 0);
    return fd;
}

int takeover_rig_memory(size_t len_bytes) {
    const int fd = memfd_create("test", MFD_CLOEXEC);
    CHECK(fd >= 0 && ftruncate(fd, (off_t)len_bytes) == 0);
    return fd;
}
