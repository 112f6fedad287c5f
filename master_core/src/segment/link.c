/** The segment on virtual network interfaces: packet sockets and a thread that answers. */
#define _GNU_SOURCE

#include <arpa/inet.h>
#include <errno.h>
#include <linux/ethtool.h>
#include <linux/if_packet.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <poll.h>
#include <sched.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "rt/clock.h"
#include "segment/segment_internal.h"

enum {
    ETHERTYPE = 0x88A4,
    WAIT_NS = 5000000,
    CARRIER_NS = 20000000,
    MAX_FRAME = 2048,
    PORTS = 2,
    ETHERNET_BYTES = 1500
};

#ifndef PACKET_IGNORE_OUTGOING
#define PACKET_IGNORE_OUTGOING 23
#endif

#ifdef FSN_TEST_RIG
enum { TEST_RIG = 1 };
#else
enum { TEST_RIG = 0 };
#endif

bool fsn_segment_test_rig(void) {
    return TEST_RIG != 0;
}

/** Whether an interface is a software pair or a tap, so that no real machine is connected to it. */
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

/** Puts the next packet of a port on the wire; false if there is none. */
static bool take(struct fsn_segment *s, uint32_t port, int flags) {
    static _Thread_local uint8_t frame[MAX_FRAME];
    const ssize_t got = recv(s->sockets[port], frame, sizeof frame, flags);
    if (got > 0) {
        fsn_segment_send(s, port, frame, (size_t)got, fsn_clock_ns(CLOCK_MONOTONIC));
    }
    return got > 0;
}

/** Sends all answers that are due. */
static void answer(struct fsn_segment *s) {
    static _Thread_local uint8_t frame[MAX_FRAME];
    for (;;) {
        uint32_t port;
        const uint64_t start = fsn_clock_ns(CLOCK_MONOTONIC);
        const size_t len = fsn_segment_receive(s, frame, sizeof frame, start, &port);
        if (len == 0) {
            return;
        }
        const uint64_t end = fsn_clock_ns(CLOCK_MONOTONIC);
        const bool sent = send(s->sockets[port], frame, len, 0) >= 0;
        const int error = errno;
        pthread_mutex_lock(&s->lock);
        if (!sent) {
            s->counts.unsent++;
            s->counts.send_errno = error;
        }
        s->counts.work_ns += end - start;
        pthread_mutex_unlock(&s->lock);
    }
}

/** Receives frames until a held frame is due; false if none arrived for some time. */
static bool take_next(struct fsn_segment *s) {
    const uint64_t until_due = fsn_segment_wait(s, fsn_clock_ns(CLOCK_MONOTONIC));
    if (until_due >= WAIT_NS && s->sockets[1] < 0) {
        return take(s, 0, 0); /* one system call instead of two; the socket has a time-out */
    }
    struct pollfd ready[PORTS];
    for (uint32_t port = 0; port < PORTS; port++) { /* poll() skips negative ones */
        ready[port] = (struct pollfd){.fd = s->sockets[port], .events = POLLIN};
    }
    const uint64_t wait_ns = until_due < WAIT_NS ? until_due : WAIT_NS;
    const struct timespec timeout = {.tv_nsec = (long)wait_ns};
    if (ppoll(ready, PORTS, &timeout, NULL) <= 0) {
        return false;
    }
    bool taken = false;
    for (uint32_t port = 0; port < PORTS; port++) { /* also an error: reading it once clears it */
        taken |= ready[port].revents != 0 && take(s, port, MSG_DONTWAIT);
    }
    return taken;
}

/** Whether the other end of an interface is up: otherwise its last SubDevice has no link. */
static bool has_carrier(int socket_fd, const char *interface) {
    struct ifreq request = {0};
    snprintf(request.ifr_name, sizeof request.ifr_name, "%s", interface);
    return ioctl(socket_fd, SIOCGIFFLAGS, &request) == 0 &&
           ((unsigned short)request.ifr_flags & IFF_RUNNING) != 0;
}

/** Each end of a ring is plugged in or not; the other end continues to work. */
static void poll_carriers(struct fsn_segment *s, uint64_t *due_ns) {
    const uint64_t now = fsn_clock_ns(CLOCK_MONOTONIC);
    if (s->sockets[1] < 0 || now < *due_ns) {
        return;
    }
    *due_ns = now + CARRIER_NS;
    segment_plug(s, has_carrier(s->sockets[0], s->interfaces[0]),
                 has_carrier(s->sockets[1], s->interfaces[1]));
}

static void *serve(void *context) {
    struct fsn_segment *s = context;
    uint64_t carriers_ns = 0;
    while (!atomic_load(&s->stop)) {
        poll_carriers(s, &carriers_ns);
        if (!take_next(s)) {
            fsn_segment_idle(s, fsn_clock_ns(CLOCK_MONOTONIC));
        }
        answer(s);
    }
    return NULL;
}

static fsn_status open_socket(int *socket_fd, const char *interface, bool takes_real) {
    const unsigned index = if_nametoindex(interface);
    if (index == 0) {
        errno = ENODEV;
        return FSN_E_SYS;
    }
    *socket_fd = socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, htons(ETHERTYPE));
    if (*socket_fd < 0) {
        return FSN_E_SYS;
    }
    if (!is_virtual(*socket_fd, interface) && !takes_real) {
        return FSN_E_ARG;
    }
    struct ifreq request = {0};
    snprintf(request.ifr_name, sizeof request.ifr_name, "%s", interface);
    if (ioctl(*socket_fd, SIOCGIFMTU, &request) == 0 && request.ifr_mtu < ETHERNET_BYTES) {
        errno = EMSGSIZE; /* long frames would never arrive */
        return FSN_E_SYS;
    }
    const struct sockaddr_ll address = {
        .sll_family = AF_PACKET, .sll_protocol = htons(ETHERTYPE), .sll_ifindex = (int)index};
    const int on = 1; /* our own answers must not be answered */
    const struct timeval patience = {.tv_usec = WAIT_NS / 1000};
    if (setsockopt(*socket_fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience) != 0 ||
        setsockopt(*socket_fd, SOL_PACKET, PACKET_IGNORE_OUTGOING, &on, sizeof on) != 0 ||
        bind(*socket_fd, (const struct sockaddr *)&address, sizeof address) != 0) {
        return FSN_E_SYS;
    }
    return FSN_OK;
}

/** Only one emulation answers on an interface. An abstract name belongs to the network namespace,
 *  like the interface, and disappears with its process, however that ends. */
static fsn_status lock_interface(int *lock, const char *interface) {
    struct sockaddr_un name = {.sun_family = AF_UNIX};
    const int length =
        snprintf(name.sun_path + 1, sizeof name.sun_path - 1, "fsn-segment:%.15s", interface);
    *lock = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const socklen_t size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1 + (size_t)length);
    return *lock >= 0 && bind(*lock, (const struct sockaddr *)&name, size) == 0 ? FSN_OK
                                                                                : FSN_E_SYS;
}

static fsn_status open_port(struct fsn_segment *s, uint32_t port, const char *interface,
                            bool takes_real) {
    FSN_TRY(open_socket(&s->sockets[port], interface, takes_real));
    return lock_interface(&s->locks[port], interface);
}

static void close_sockets(struct fsn_segment *s) {
    for (uint32_t port = 0; port < PORTS; port++) {
        if (s->locks[port] >= 0) {
            close(s->locks[port]);
        }
        s->locks[port] = -1;
        if (s->sockets[port] >= 0) {
            close(s->sockets[port]);
        }
        s->sockets[port] = -1;
    }
}

static int set_up_thread(pthread_attr_t *attributes, const struct fsn_segment_link_options *o) {
    int error = 0;
    if (o->priority != 0) {
        const struct sched_param parameter = {.sched_priority = o->priority};
        (void)pthread_attr_setinheritsched(attributes, PTHREAD_EXPLICIT_SCHED);
        (void)pthread_attr_setschedpolicy(attributes, SCHED_FIFO);
        error = pthread_attr_setschedparam(attributes, &parameter); /* only this may be invalid */
    }
    if (error == 0 && o->cpu != 0) {
        if ((unsigned)o->cpu > CPU_SETSIZE) { /* or below 0 */
            return EINVAL;
        }
        cpu_set_t set;
        CPU_ZERO(&set);
        CPU_SET((size_t)o->cpu - 1, &set);
        error = pthread_attr_setaffinity_np(attributes, sizeof set, &set);
    }
    return error;
}

static int start_thread(struct fsn_segment *s, const struct fsn_segment_link_options *options) {
    pthread_attr_t attributes;
    pthread_attr_init(&attributes);
    int error = set_up_thread(&attributes, options);
    error = error != 0 ? error : pthread_create(&s->thread, &attributes, serve, s);
    pthread_attr_destroy(&attributes);
    return error;
}

static fsn_status open_ports(struct fsn_segment *s, const struct fsn_segment_link_options *o) {
    const bool takes_real = TEST_RIG != 0 && o->no_machine_on_this_wire;
    FSN_TRY(open_port(s, 0, o->interface, takes_real));
    return o->interface2 != NULL ? open_port(s, 1, o->interface2, takes_real) : FSN_OK;
}

/** Starts answering. Returns 0, or errno. */
static int begin(struct fsn_segment *s, const struct fsn_segment_link_options *o) {
    snprintf(s->interfaces[0], sizeof s->interfaces[0], "%s", o->interface);
    snprintf(s->interfaces[1], sizeof s->interfaces[1], "%s",
             o->interface2 != NULL ? o->interface2 : "");
    fsn_segment_set_ring(s, o->interface2 != NULL);
    atomic_store(&s->stop, false);
    return start_thread(s, o);
}

fsn_status fsn_segment_link(struct fsn_segment *s, const struct fsn_segment_link_options *options,
                            int *sys_errno) {
    if (s == NULL || options == NULL || options->interface == NULL ||
        (options->interface2 != NULL && strcmp(options->interface, options->interface2) == 0)) {
        return FSN_E_ARG;
    }
    if (s->sockets[0] >= 0) {
        return FSN_E_STATE;
    }
    fsn_status status = open_ports(s, options);
    int error = errno;
    if (status == FSN_OK) {
        error = begin(s, options);
        status = error == 0 ? FSN_OK : FSN_E_SYS;
    }
    if (status != FSN_OK) {
        close_sockets(s);
    }
    if (sys_errno != NULL) {
        *sys_errno = status == FSN_E_SYS ? error : 0;
    }
    return status;
}

void fsn_segment_unlink(struct fsn_segment *s) {
    if (s == NULL || s->sockets[0] < 0) {
        return;
    }
    atomic_store(&s->stop, true);
    pthread_join(s->thread, NULL);
    close_sockets(s);
    pthread_mutex_lock(&s->lock);
    s->wire->count = 0; /* late frames have no receiver */
    s->wire->again = false;
    pthread_mutex_unlock(&s->lock);
}
