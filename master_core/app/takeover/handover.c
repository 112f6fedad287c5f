#define _GNU_SOURCE

#include "app/takeover/handover.h"

#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

union control {
    struct cmsghdr align;
    char bytes[CMSG_SPACE(HANDOVER_FDS * sizeof(int))];
};

bool handover_send(int fd, const void *message, size_t len_bytes, const int *fds, size_t fd_count) {
    union control control = {.bytes = {0}};
    struct iovec part = {.iov_base = (void *)(uintptr_t)message, .iov_len = len_bytes};
    struct msghdr header = {.msg_iov = &part, .msg_iovlen = 1};
    if (fd_count > 0) {
        header.msg_control = control.bytes;
        header.msg_controllen = CMSG_SPACE(fd_count * sizeof(int));
        struct cmsghdr *c = &control.align; /* the first and only one */
        c->cmsg_level = SOL_SOCKET;
        c->cmsg_type = SCM_RIGHTS;
        c->cmsg_len = CMSG_LEN(fd_count * sizeof(int));
        memcpy(CMSG_DATA(c), fds, fd_count * sizeof(int));
    }
    return sendmsg(fd, &header, MSG_NOSIGNAL | MSG_DONTWAIT) == (ssize_t)len_bytes;
}

static void take_fds(struct msghdr *header, int *fds) {
    for (struct cmsghdr *c = CMSG_FIRSTHDR(header); c != NULL; c = CMSG_NXTHDR(header, c)) {
        const size_t count = (c->cmsg_len - CMSG_LEN(0)) / sizeof(int);
        if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_RIGHTS) {
            continue;
        }
        for (size_t i = 0; i < count; i++) {
            int fd;
            memcpy(&fd, CMSG_DATA(c) + i * sizeof fd, sizeof fd);
            if (fds != NULL && i < HANDOVER_FDS) {
                fds[i] = fd;
            } else {
                close(fd);
            }
        }
    }
}

int handover_receive(int fd, void *message, size_t len_bytes, int *fds) {
    union control control;
    struct iovec part = {.iov_base = message, .iov_len = len_bytes};
    struct msghdr header = {.msg_iov = &part,
                            .msg_iovlen = 1,
                            .msg_control = control.bytes,
                            .msg_controllen = sizeof control.bytes};
    for (size_t i = 0; fds != NULL && i < HANDOVER_FDS; i++) {
        fds[i] = -1;
    }
    ssize_t got = recvmsg(fd, &header, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
    if (got < 0 && errno == ECONNRESET) { /* this precedes the last message of the other end */
        got = recvmsg(fd, &header, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
    }
    if (got < 0) {
        return errno == EAGAIN || errno == EINTR ? 0 : -1;
    }
    const bool whole =
        (size_t)got == len_bytes && (header.msg_flags & (MSG_TRUNC | MSG_CTRUNC)) == 0;
    take_fds(&header, whole ? fds : NULL);
    return whole ? 1 : -1;
}

int handover_pidfd(int fd, pid_t *pid, uid_t *uid) {
    struct ucred peer = {0};
    socklen_t size = sizeof peer;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) {
        return -1;
    }
    *pid = peer.pid;
    *uid = peer.uid;
    if (peer.pid <= 0) { /* in another PID namespace */
        errno = ESRCH;
        return -1;
    }
    return (int)syscall(SYS_pidfd_open, peer.pid, 0);
}

void handover_close(int *fd) {
    if (*fd >= 0) {
        close(*fd);
    }
    *fd = -1;
}

bool handover_has_ended(int pidfd, int wait_ms) {
    struct pollfd polled = {.fd = pidfd, .events = POLLIN};
    return poll(&polled, 1, wait_ms) == 1 && (polled.revents & POLLIN) != 0;
}
