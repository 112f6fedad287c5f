/** The segment on a virtual network interface: a packet socket and a thread that answers. */
#define _GNU_SOURCE

#include <arpa/inet.h>
#include <errno.h>
#include <linux/ethtool.h>
#include <linux/if_packet.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "segment_internal.h"

enum { ETHERTYPE = 0x88A4, WAIT_MS = 5, MAX_FRAME = 2048 };

#ifndef PACKET_IGNORE_OUTGOING
#define PACKET_IGNORE_OUTGOING 23
#endif

static uint64_t clock_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

/** Whether an interface is a pair in software or a tap: then no real machine hangs on it. */
static bool is_virtual(int socket_fd, const char *interface) {
    struct ethtool_drvinfo info = {.cmd = ETHTOOL_GDRVINFO};
    struct ifreq request = {0};
    snprintf(request.ifr_name, sizeof request.ifr_name, "%s", interface);
    request.ifr_data = (void *)&info;
    if (ioctl(socket_fd, SIOCETHTOOL, &request) != 0) {
        return false;
    }
    return strcmp(info.driver, "veth") == 0 || strcmp(info.driver, "tun") == 0;
}

static void *serve(void *context) {
    struct fsn_segment *s = context;
    static _Thread_local uint8_t frame[MAX_FRAME];
    while (!atomic_load(&s->stop)) {
        struct pollfd ready = {.fd = s->socket, .events = POLLIN};
        if (poll(&ready, 1, WAIT_MS) <= 0) {
            fsn_segment_idle(s, clock_ns());
            continue;
        }
        const ssize_t got = recv(s->socket, frame, sizeof frame, MSG_DONTWAIT);
        if (got <= 0) {
            continue;
        }
        const uint64_t start = clock_ns();
        const size_t len = fsn_segment_frame(s, frame, (size_t)got, start);
        const uint64_t end = clock_ns();
        if (len > 0) {
            (void)!send(s->socket, frame, len, 0);
        }
        pthread_mutex_lock(&s->lock);
        s->counts.work_ns += end - start;
        pthread_mutex_unlock(&s->lock);
    }
    return NULL;
}

static fsn_status open_socket(struct fsn_segment *s, const char *interface) {
    const unsigned index = if_nametoindex(interface);
    if (index == 0) {
        return FSN_E_ARG;
    }
    s->socket = socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, htons(ETHERTYPE));
    if (s->socket < 0) {
        return FSN_E_SYS;
    }
    if (!is_virtual(s->socket, interface)) {
        return FSN_E_ARG;
    }
    const struct sockaddr_ll address = {
        .sll_family = AF_PACKET, .sll_protocol = htons(ETHERTYPE), .sll_ifindex = (int)index};
    const int on = 1; /* its own answers are no frames to answer */
    if (setsockopt(s->socket, SOL_PACKET, PACKET_IGNORE_OUTGOING, &on, sizeof on) != 0 ||
        bind(s->socket, (const struct sockaddr *)&address, sizeof address) != 0) {
        return FSN_E_SYS;
    }
    return FSN_OK;
}

fsn_status fsn_segment_link(struct fsn_segment *s, const char *interface, int *sys_errno) {
    if (s == NULL || interface == NULL) {
        return FSN_E_ARG;
    }
    if (s->socket >= 0) {
        return FSN_E_STATE;
    }
    fsn_status status = open_socket(s, interface);
    int error = errno;
    atomic_store(&s->stop, false);
    if (status == FSN_OK) {
        error = pthread_create(&s->thread, NULL, serve, s);
        status = error == 0 ? FSN_OK : FSN_E_SYS;
    }
    if (status != FSN_OK) {
        if (s->socket >= 0) {
            close(s->socket);
        }
        s->socket = -1;
        if (sys_errno != NULL) {
            *sys_errno = status == FSN_E_SYS ? error : 0;
        }
    }
    return status;
}

void fsn_segment_unlink(struct fsn_segment *s) {
    if (s == NULL || s->socket < 0) {
        return;
    }
    atomic_store(&s->stop, true);
    pthread_join(s->thread, NULL);
    close(s->socket);
    s->socket = -1;
}
