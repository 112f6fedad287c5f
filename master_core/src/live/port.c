#define _GNU_SOURCE

#include "live/port.h"

#include <arpa/inet.h>
#include <errno.h>
#include <linux/filter.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <poll.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "live/node.h"
#include "rt/clock.h"
#include "rt/wire.h"

#ifndef PACKET_IGNORE_OUTGOING
#define PACKET_IGNORE_OUTGOING 23
#endif

enum {
    INDEX_BYTE = 17,
    ETHERCAT = 0x88A4,
    CYCLIC_BUFFER_BYTES = 4 << 20,
    EAR_BYTES = 64, /**< of each foreign frame: they are never read */
    ETHERNET_BYTES = 1500,
};

fsn_status fsn_port_refuse(struct fsn_fault *fault, const char *interface, const char *rule,
                           const char *permission) {
    const int error = errno;
    fsn_refuse_all(fault, FSN_E_SYS, rule);
    if (fault != NULL) {
        fault->sys_errno = error;
        snprintf(fault->detail, sizeof fault->detail, "%s%s%s", interface,
                 error == EPERM ? "; " : "", error == EPERM ? permission : "");
    }
    return FSN_E_SYS;
}

static fsn_status refuse_system(struct fsn_fault *fault, const char *interface, const char *rule) {
    return fsn_port_refuse(fault, interface, rule, "raw sockets need CAP_NET_RAW");
}

bool fsn_port_ask(const char *interface, unsigned long what, struct ifreq *request) {
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    snprintf(request->ifr_name, sizeof request->ifr_name, "%s", interface);
    const bool answered = fd >= 0 && ioctl(fd, what, request) == 0;
    if (fd >= 0) {
        close(fd);
    }
    return answered;
}

/** Continues after it for own frames, and `others` instructions further for foreign ones. */
#define IS_OURS(tag, others)                                                                       \
    BPF_STMT(BPF_LD | BPF_H | BPF_ABS, FSN_PORT_SOURCE),                                           \
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, FSN_PORT_OURS, 0, (others) + 2),                       \
        BPF_STMT(BPF_LD | BPF_H | BPF_ABS, FSN_PORT_TAG),                                          \
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, (tag), 0, (others))

/** Older kernels cannot filter the frames sent by this host; then our own frames are received
 *  twice, and dropped later. */
static void ignore_outgoing(int socket) {
    const int yes = 1;
    (void)setsockopt(socket, SOL_PACKET, PACKET_IGNORE_OUTGOING, &yes, sizeof yes);
}

static int attach(int socket, struct sock_filter *code, size_t count) {
    const struct sock_fprog program = {.len = (unsigned short)count, .filter = code};
    return setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program);
}

fsn_status fsn_port_filter_acyclic(int socket, uint16_t tag) {
    /* Complete packets only, because SOEM relies on the length field of a frame: the header, 16
     * bytes, and that many more. */
    struct sock_filter code[] = {
        IS_OURS(tag, 13),
        BPF_STMT(BPF_LD | BPF_B | BPF_ABS, INDEX_BYTE),
        BPF_JUMP(BPF_JMP | BPF_JGE | BPF_K, FSN_WIRE_FIRST_INDEX, 11, 0),
        BPF_STMT(BPF_LD | BPF_B | BPF_ABS, 15),
        BPF_STMT(BPF_ALU | BPF_AND | BPF_K, 0x0F),
        BPF_STMT(BPF_ALU | BPF_LSH | BPF_K, 8),
        BPF_STMT(BPF_MISC | BPF_TAX, 0),
        BPF_STMT(BPF_LD | BPF_B | BPF_ABS, 14),
        BPF_STMT(BPF_ALU | BPF_ADD | BPF_X, 0),
        BPF_STMT(BPF_ALU | BPF_ADD | BPF_K, 16),
        BPF_STMT(BPF_MISC | BPF_TAX, 0),
        BPF_STMT(BPF_LD | BPF_W | BPF_LEN, 0),
        BPF_JUMP(BPF_JMP | BPF_JGE | BPF_X, 0, 0, 1),
        BPF_STMT(BPF_RET | BPF_K, 0xFFFF),
        BPF_STMT(BPF_RET | BPF_K, 0),
    };
    ignore_outgoing(socket);
    return attach(socket, code, sizeof code / sizeof code[0]) == 0 ? FSN_OK : FSN_E_SYS;
}

static int filter_cyclic(int socket, uint16_t tag) {
    struct sock_filter code[] = {
        IS_OURS(tag, 3),
        BPF_STMT(BPF_LD | BPF_B | BPF_ABS, INDEX_BYTE),
        BPF_JUMP(BPF_JMP | BPF_JGE | BPF_K, FSN_WIRE_FIRST_INDEX, 0, 1),
        BPF_STMT(BPF_RET | BPF_K, 0xFFFF),
        BPF_STMT(BPF_RET | BPF_K, 0),
    };
    ignore_outgoing(socket);
    return attach(socket, code, sizeof code / sizeof code[0]);
}

static int filter_foreign(int socket, uint16_t tag) {
    struct sock_filter code[] = {
        IS_OURS(tag, 1),
        BPF_STMT(BPF_RET | BPF_K, 0),
        BPF_STMT(BPF_RET | BPF_K, EAR_BYTES),
    };
    ignore_outgoing(socket);
    return attach(socket, code, sizeof code / sizeof code[0]);
}

static int bind_to(int fd, unsigned number, uint16_t protocol) {
    const struct sockaddr_ll at = {
        .sll_family = AF_PACKET, .sll_protocol = htons(protocol), .sll_ifindex = (int)number};
    return bind(fd, (const struct sockaddr *)&at, sizeof at);
}

/** A frame longer than the MTU is refused each time, by us or by the other end of a pair. */
static fsn_status check_mtu(const char *interface, int fd, struct fsn_fault *fault) {
    struct ifreq request = {0};
    snprintf(request.ifr_name, sizeof request.ifr_name, "%s", interface);
    if (ioctl(fd, SIOCGIFMTU, &request) != 0 || request.ifr_mtu >= ETHERNET_BYTES) {
        return FSN_OK;
    }
    fsn_live_refuse(fault, FSN_E_SYS, "EtherCAT frames do not fit through the interface",
                    "%s has an MTU of %d, they need %d", interface, request.ifr_mtu,
                    ETHERNET_BYTES);
    errno = EMSGSIZE; /* for callers that read errno */
    if (fault != NULL) {
        fault->sys_errno = errno;
    }
    return FSN_E_SYS;
}

/** Opens a raw EtherCAT socket that does not receive anything yet. */
static fsn_status open_raw(const char *interface, int *fd, unsigned *number,
                           struct fsn_fault *fault) {
    *fd = -1;
    *number = if_nametoindex(interface);
    if (*number == 0) {
        errno = ENODEV;
        return refuse_system(fault, interface, "unknown interface");
    }
    *fd = socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, 0);
    if (*fd < 0) {
        return refuse_system(fault, interface, "no raw socket could be opened");
    }
    const fsn_status status = check_mtu(interface, *fd, fault);
    if (status != FSN_OK) {
        close(*fd);
        *fd = -1;
    }
    return status;
}

uint16_t fsn_port_tag(const char *interface) {
    struct ifreq request = {0};
    const bool ok = fsn_port_ask(interface, SIOCGIFHWADDR, &request);
    const uint8_t *address = (const uint8_t *)request.ifr_hwaddr.sa_data;
    return (uint16_t)(ok ? address[4] << 8 | address[5] : 1);
}

fsn_status fsn_port_open(const char *interface, uint16_t tag, bool stamp, int *out,
                         struct fsn_fault *fault) {
    unsigned number;
    int fd;
    *out = -1;
    FSN_TRY(open_raw(interface, &fd, &number, fault));
    const int yes = 1;
    const int bytes = CYCLIC_BUFFER_BYTES;
    (void)setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    /* It also works without these, with a little more delay or less accurate information. */
    (void)setsockopt(fd, SOL_PACKET, PACKET_QDISC_BYPASS, &yes, sizeof yes);
    if (stamp) {
        (void)setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &yes, sizeof yes);
    }
    struct packet_mreq all = {.mr_ifindex = (int)number, .mr_type = PACKET_MR_PROMISC};
    (void)setsockopt(fd, SOL_PACKET, PACKET_ADD_MEMBERSHIP, &all, sizeof all);
    if (filter_cyclic(fd, tag) != 0 || bind_to(fd, number, ETHERCAT) != 0) {
        const fsn_status refused = refuse_system(fault, interface, "the raw socket is of no use");
        close(fd);
        return refused;
    }
    *out = fd;
    return FSN_OK;
}

fsn_status fsn_port_open_foreign(const char *interface, uint16_t tag, int *out,
                                 struct fsn_fault *fault) {
    unsigned number;
    FSN_TRY(open_raw(interface, out, &number, fault));
    const int least = 0; /* also counts packets that do not fit */
    (void)setsockopt(*out, SOL_SOCKET, SO_RCVBUF, &least, sizeof least);
    if (filter_foreign(*out, tag) != 0 || bind_to(*out, number, ETHERCAT) != 0) {
        const fsn_status refused = refuse_system(fault, interface, "the raw socket is of no use");
        close(*out);
        *out = -1;
        return refused;
    }
    return FSN_OK;
}

uint32_t fsn_port_count_foreign(int socket) {
    struct tpacket_stats counted = {0}; /* reading resets them */
    socklen_t size = sizeof counted;
    return getsockopt(socket, SOL_PACKET, PACKET_STATISTICS, &counted, &size) == 0
               ? counted.tp_packets
               : 0;
}

/** The lock of an interface is an abstract name: it belongs to the network namespace, like the
 *  interface, and disappears with its last descriptor. */
static socklen_t lock_name(const char *interface, struct sockaddr_un *name) {
    *name = (struct sockaddr_un){.sun_family = AF_UNIX};
    /* mutants: the name of an interface is much shorter than the room */
    const int length =
        snprintf(name->sun_path + 1, sizeof name->sun_path - 1, "fsn-maindevice:%s", interface);
    return (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1 + (size_t)length);
}

fsn_status fsn_port_lock(const char *interface, int *lock, struct fsn_fault *fault) {
    struct sockaddr_un name;
    const socklen_t size = lock_name(interface, &name);
    *lock = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    if (*lock < 0) {
        return refuse_system(fault, interface, "the interface could not be locked");
    }
    if (bind(*lock, (const struct sockaddr *)&name, size) == 0) {
        return FSN_OK;
    }
    const bool taken = errno == EADDRINUSE;
    close(*lock);
    *lock = -1;
    return taken
               ? fsn_live_refuse(fault, FSN_E_BUS_BUSY, NULL,
                                 "%s: another process of fsoe-net drives this interface", interface)
               : refuse_system(fault, interface, "the interface could not be locked");
}

fsn_status fsn_port_reach(const char *interface, int *fd, struct fsn_fault *fault) {
    struct sockaddr_un name;
    const socklen_t size = lock_name(interface, &name);
    *fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    if (*fd < 0) {
        return refuse_system(fault, interface, "the process that drives it could not be reached");
    }
    if (connect(*fd, (const struct sockaddr *)&name, size) == 0) {
        return FSN_OK;
    }
    close(*fd);
    *fd = -1;
    return fsn_live_refuse(fault, FSN_E_BUS_SILENT, NULL,
                           "%s: no fsn-master drives this interface and takes a successor",
                           interface);
}

void fsn_port_discard(int socket) {
    uint8_t packet[FSN_WIRE_MOST + 4];
    while (socket >= 0 && recv(socket, packet, sizeof packet, MSG_DONTWAIT) > 0) {
    }
}

/** Counts EtherCAT packets from any sender, until the time is over. */
static unsigned hear(int fd, uint64_t listen_ns) {
    const uint64_t end_ns = fsn_clock_ns(CLOCK_MONOTONIC) + listen_ns;
    unsigned heard = 0;
    for (uint64_t now = fsn_clock_ns(CLOCK_MONOTONIC); now < end_ns && heard < 1000;
         now = fsn_clock_ns(CLOCK_MONOTONIC)) {
        struct pollfd polled = {.fd = fd, .events = POLLIN};
        if (poll(&polled, 1, (int)((end_ns - now) / 1000000u) + 1) <= 0) {
            continue;
        }
        uint8_t packet[FSN_WIRE_MOST + 4];
        heard += recv(fd, packet, sizeof packet, MSG_DONTWAIT) > 0;
    }
    return heard;
}

fsn_status fsn_port_listen(const char *interface, uint64_t listen_ns, struct fsn_fault *fault) {
    unsigned number;
    int fd;
    FSN_TRY(open_raw(interface, &fd, &number, fault));
    /* All protocols; otherwise the frames sent by this host would not be received. */
    struct sock_filter ethercat[] = {
        BPF_STMT(BPF_LD | BPF_H | BPF_ABS, 12),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ETHERCAT, 0, 1),
        BPF_STMT(BPF_RET | BPF_K, 0xFFFF),
        BPF_STMT(BPF_RET | BPF_K, 0),
    };
    if (attach(fd, ethercat, sizeof ethercat / sizeof ethercat[0]) != 0 ||
        bind_to(fd, number, ETH_P_ALL) != 0) {
        const fsn_status refused = refuse_system(fault, interface, "the raw socket is of no use");
        close(fd);
        return refused;
    }
    const unsigned heard = hear(fd, listen_ns);
    close(fd);
    return heard == 0 ? FSN_OK
                      : fsn_live_refuse(fault, FSN_E_BUS_BUSY, NULL,
                                        "%s: %u EtherCAT packets within %u ms that are not ours",
                                        interface, heard, (unsigned)(listen_ns / 1000000u));
}

int fsn_port_try(const char *interface) {
    static const uint8_t head[] = {FSN_PORT_OURS >> 8, FSN_PORT_OURS & 0xFF, 0,    0,   0, 0,
                                   ETHERCAT >> 8,      ETHERCAT & 0xFF,      0x0D, 0x10};
    uint8_t nop[60] = {0};
    unsigned number;
    int fd;
    memset(nop, 0xFF, 6);
    memcpy(nop + 6, head, sizeof head);
    nop[22] = 1; /* one byte */
    if (open_raw(interface, &fd, &number, NULL) != FSN_OK) {
        return errno;
    }
    const struct sockaddr_ll at = {
        .sll_family = AF_PACKET, .sll_protocol = htons(ETHERCAT), .sll_ifindex = (int)number};
    const bool sent = sendto(fd, nop, sizeof nop, MSG_DONTWAIT, (const struct sockaddr *)&at,
                             sizeof at) == (ssize_t)sizeof nop;
    const int error = errno;
    close(fd);
    return sent ? 0 : error;
}

bool fsn_port_has_link(const char *interface) {
    struct ifreq request = {0};
    const bool ok = fsn_port_ask(interface, SIOCGIFFLAGS, &request);
    const unsigned flags = (unsigned short)request.ifr_flags;
    return ok && (flags & IFF_UP) != 0 && (flags & IFF_RUNNING) != 0;
}
