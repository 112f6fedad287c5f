/** An interface as a MainDevice uses it, on a system that this program emulates: frames that pass
 *  the filters, socket options, and reports when the system refuses. */
#define _DEFAULT_SOURCE

#include <errno.h>
#include <linux/filter.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "builder.h"
#include "heap.h"
#include "live/port.h"
#include "plan/plan_internal.h"

enum { FD = 1000, NUMBER = 7, TAG = 0xBEEF };

/* -- the system ------------------------------------------------------------------------------ */

static struct {
    int socket_fails, bind_fails, ioctl_fails, filter_fails, getsockopt_fails, send_fails;
    bool no_interface;
    int mtu;
    short flags;
    uint8_t address[6];
    uint32_t counted;
    /* Requests. */
    int opens, closes, family, type, protocol_of_socket;
    struct sock_filter code[32];
    size_t code_len;
    struct sockaddr_storage bound;
    socklen_t bound_bytes;
    char options[256]; /**< name and value of each option, in order */
    uint8_t sent[128];
    ssize_t sent_bytes;
    uint64_t now_ns;
    unsigned packets; /**< that come while a listener waits, one per poll */
    unsigned polls;
} os;

static int answer(int error) {
    errno = error;
    return error == 0 ? 0 : -1;
}

int socket(int family, int type, int protocol) {
    os.family = family;
    os.type = type;
    os.protocol_of_socket = protocol;
    if (os.socket_fails != 0) {
        return answer(os.socket_fails);
    }
    os.opens++;
    return FD;
}

int close(int fd) {
    if (fd != FD) {
        return (int)syscall(SYS_close, fd); /* a file of the run-time library */
    }
    os.closes++;
    return 0;
}

unsigned if_nametoindex(const char *name) {
    CHECK(strcmp(name, "eth7") == 0);
    return os.no_interface ? 0 : NUMBER;
}

int ioctl(int fd, unsigned long request, ...) {
    va_list arguments;
    va_start(arguments, request);
    struct ifreq *ifr = va_arg(arguments, struct ifreq *);
    va_end(arguments);
    CHECK(fd == FD && strcmp(ifr->ifr_name, "eth7") == 0);
    if (os.ioctl_fails != 0) {
        return answer(os.ioctl_fails);
    }
    if (request == SIOCGIFMTU) {
        ifr->ifr_mtu = os.mtu;
    } else if (request == SIOCGIFHWADDR) {
        memcpy(ifr->ifr_hwaddr.sa_data, os.address, sizeof os.address);
    } else {
        CHECK(request == SIOCGIFFLAGS);
        ifr->ifr_flags = os.flags;
    }
    return 0;
}

int setsockopt(int fd, int level, int name, const void *value, socklen_t bytes) {
    CHECK(fd == FD);
    if (level == SOL_SOCKET && name == SO_ATTACH_FILTER) {
        const struct sock_fprog *program = value;
        CHECK(program->len <= 32);
        memcpy(os.code, program->filter, program->len * sizeof os.code[0]);
        os.code_len = program->len;
        return answer(os.filter_fails);
    }
    const size_t used = strlen(os.options);
    if (level == SOL_PACKET && name == PACKET_ADD_MEMBERSHIP) {
        const struct packet_mreq *all = value;
        CHECK(bytes == sizeof *all && all->mr_ifindex == NUMBER);
        CHECK(all->mr_type == PACKET_MR_PROMISC);
        snprintf(os.options + used, sizeof os.options - used, "all ");
        return 0;
    }
    int number;
    CHECK(bytes == sizeof number);
    memcpy(&number, value, sizeof number);
    snprintf(os.options + used, sizeof os.options - used, "%s=%d ",
             level == SOL_PACKET && name == PACKET_IGNORE_OUTGOING ? "in"
             : level == SOL_PACKET && name == PACKET_QDISC_BYPASS  ? "bypass"
             : level == SOL_SOCKET && name == SO_RCVBUF            ? "room"
             : level == SOL_SOCKET && name == SO_TIMESTAMPNS       ? "stamp"
                                                                   : "?",
             number);
    return 0;
}

int getsockopt(int fd, int level, int name, void *restrict value, socklen_t *restrict bytes) {
    struct tpacket_stats *counted = value;
    CHECK(fd == FD && level == SOL_PACKET && name == PACKET_STATISTICS);
    CHECK(*bytes == sizeof *counted);
    counted->tp_packets = os.counted;
    counted->tp_drops = 99;
    return answer(os.getsockopt_fails);
}

int bind(int fd, const struct sockaddr *address, socklen_t bytes) {
    CHECK(fd == FD && bytes <= sizeof os.bound);
    memcpy(&os.bound, address, bytes);
    os.bound_bytes = bytes;
    return answer(os.bind_fails);
}

ssize_t sendto(int fd, const void *packet, size_t bytes, int flags, const struct sockaddr *address,
               socklen_t address_bytes) {
    const struct sockaddr_ll *to = (const struct sockaddr_ll *)address;
    CHECK(fd == FD && flags == MSG_DONTWAIT && address_bytes == sizeof *to && bytes <= 128);
    CHECK(to->sll_family == AF_PACKET && to->sll_protocol == htons(0x88A4));
    CHECK(to->sll_ifindex == NUMBER);
    memcpy(os.sent, packet, bytes);
    os.sent_bytes = (ssize_t)bytes;
    return os.send_fails != 0 ? answer(os.send_fails) : (ssize_t)bytes;
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    CHECK(clock == CLOCK_MONOTONIC);
    *now = (struct timespec){.tv_sec = (time_t)(os.now_ns / 1000000000u),
                             .tv_nsec = (long)(os.now_ns % 1000000000u)};
    return 0;
}

int poll(struct pollfd *polled, nfds_t count, int wait_ms) {
    (void)polled; /* libc promises that poll() reads nothing of it */
    CHECK(count == 1 && wait_ms > 0);
    os.polls++;
    if (os.packets > 0) {
        os.now_ns += 1000;
        return 1;
    }
    os.now_ns += (uint64_t)wait_ms * 1000000u;
    return 0;
}

ssize_t recv(int fd, void *packet, size_t bytes, int flags) {
    CHECK(fd == FD && flags == MSG_DONTWAIT && bytes >= 1514 && os.packets > 0);
    memset(packet, 0, 60);
    os.packets--;
    return 60;
}

static struct fsn_fault fault;

static void set_up(void) {
    memset(&os, 0, sizeof os);
    memset(&fault, 0, sizeof fault);
    os.mtu = 1500;
}

static void logged(fsn_status status, int error, const char *rule, const char *detail, int line) {
    if (fault.status != status || fault.sys_errno != error || strcmp(fault.rule, rule) != 0 ||
        strcmp(fault.detail, detail) != 0 || os.opens != os.closes) {
        fprintf(stderr, "line %d: %d, errno %d, %s: %s; %d opened, %d closed\n", line, fault.status,
                fault.sys_errno, fault.rule, fault.detail, os.opens, os.closes);
        exit(1);
    }
}

#define TOLD(status, error, rule, detail) logged(status, error, rule, detail, __LINE__)

/* -- filters --------------------------------------------------------------------------------- */

/** Handling of a packet by the kernel, as far as our filters go. */
static uint32_t filtered(const uint8_t *packet, uint32_t len) {
    uint32_t a = 0;
    uint32_t x = 0;
    for (size_t at = 0;; at++) {
        CHECK(at < os.code_len);
        const struct sock_filter *i = &os.code[at];
        const uint32_t bytes = BPF_SIZE(i->code) == BPF_W ? 4 : BPF_SIZE(i->code) == BPF_H ? 2 : 1;
        switch (i->code) {
        case BPF_LD | BPF_W | BPF_LEN:
            a = len;
            break;
        case BPF_LD | BPF_B | BPF_ABS:
        case BPF_LD | BPF_H | BPF_ABS:
            if (i->k + bytes > len) {
                return 0;
            }
            a = bytes == 1 ? packet[i->k] : (uint32_t)(packet[i->k] << 8 | packet[i->k + 1]);
            break;
        case BPF_MISC | BPF_TAX:
            x = a;
            break;
        case BPF_ALU | BPF_AND | BPF_K:
            a &= i->k;
            break;
        case BPF_ALU | BPF_LSH | BPF_K:
            a <<= i->k;
            break;
        case BPF_ALU | BPF_ADD | BPF_K:
            a += i->k;
            break;
        case BPF_ALU | BPF_ADD | BPF_X:
            a += x;
            break;
        case BPF_JMP | BPF_JEQ | BPF_K:
            at += a == i->k ? i->jt : i->jf;
            break;
        case BPF_JMP | BPF_JGE | BPF_K:
            at += a >= i->k ? i->jt : i->jf;
            break;
        case BPF_JMP | BPF_JGE | BPF_X:
            at += a >= x ? i->jt : i->jf;
            break;
        default:
            CHECK(i->code == (BPF_RET | BPF_K));
            return i->k;
        }
    }
}

/** A packet of another station: its address, its tag, an index, and the stated number of bytes. */
static uint32_t passes(uint16_t ours, uint16_t tag, uint8_t index, uint32_t states, uint32_t len) {
    uint8_t packet[1600] = {0};
    packet[6] = (uint8_t)(ours >> 8);
    packet[7] = (uint8_t)ours;
    packet[8] = 0x53;
    packet[10] = (uint8_t)(tag >> 8);
    packet[11] = (uint8_t)tag;
    packet[12] = 0x88;
    packet[13] = 0xA4;
    packet[14] = (uint8_t)states;
    packet[15] = (uint8_t)(0x10 | states >> 8);
    packet[17] = index;
    return filtered(packet, len);
}

static void filters_tell_frames_apart(void) {
    int fd;
    set_up();
    CHECK(fsn_port_filter_acyclic(FD, TAG) == FSN_OK && strcmp(os.options, "in=1 ") == 0);
    CHECK(passes(0x0246, TAG, 0x7F, 44, 60) == 0xFFFF && passes(0x0246, TAG, 0, 44, 60) == 0xFFFF);
    CHECK(passes(0x0246, TAG, 0x80, 44, 60) == 0 && passes(0x0246, TAG, 0xFF, 44, 60) == 0);
    CHECK(passes(0x0247, TAG, 1, 44, 60) == 0 && passes(0x0246, TAG + 1, 1, 44, 60) == 0);
    /* A packet has at least the stated number of bytes: SOEM relies on it. */
    CHECK(passes(0x0246, TAG, 1, 45, 60) == 0 && passes(0x0246, TAG, 1, 43, 60) == 0xFFFF);
    CHECK(passes(0x0246, TAG, 1, 0x102, 274) == 0xFFFF && passes(0x0246, TAG, 1, 0x102, 273) == 0);
    CHECK(passes(0x0246, TAG, 1, 0x502, 0x512) == 0xFFFF &&
          passes(0x0246, TAG, 1, 0x702, 0x511) == 0);
    os.filter_fails = EINVAL;
    CHECK(fsn_port_filter_acyclic(FD, TAG) == FSN_E_SYS);

    set_up();
    CHECK(fsn_port_open("eth7", TAG, false, &fd, &fault) == FSN_OK && fd == FD);
    CHECK(passes(0x0246, TAG, 0x80, 44, 60) == 0xFFFF &&
          passes(0x0246, TAG, 0xFF, 0, 60) == 0xFFFF);
    CHECK(passes(0x0246, TAG, 0x7F, 44, 60) == 0);
    CHECK(passes(0x0346, TAG, 0x80, 44, 60) == 0 && passes(0x0246, TAG - 1, 0x80, 44, 60) == 0);

    set_up();
    CHECK(fsn_port_open_foreign("eth7", TAG, &fd, &fault) == FSN_OK && fd == FD);
    CHECK(passes(0x0246, TAG, 0x80, 44, 60) == 0 && passes(0x0246, TAG, 1, 44, 60) == 0);
    CHECK(passes(0x0246, TAG ^ 1, 1, 44, 60) == 64 && passes(0x0101, TAG, 1, 44, 60) == 64);
}

/* -- sockets --------------------------------------------------------------------------------- */

static void sockets_are_set_up(void) {
    int fd;
    set_up();
    CHECK(fsn_port_open("eth7", TAG, true, &fd, &fault) == FSN_OK && fd == FD);
    CHECK(os.family == AF_PACKET && os.type == (SOCK_RAW | SOCK_CLOEXEC));
    CHECK(os.protocol_of_socket == 0 && os.opens == 1 && os.closes == 0);
    CHECK(strcmp(os.options, "room=4194304 bypass=1 stamp=1 all in=1 ") == 0);
    const struct sockaddr_ll *bound = (const struct sockaddr_ll *)&os.bound;
    CHECK(os.bound_bytes == sizeof *bound && bound->sll_family == AF_PACKET);
    CHECK(bound->sll_protocol == htons(0x88A4) && bound->sll_ifindex == NUMBER);
    set_up();
    CHECK(fsn_port_open("eth7", TAG, false, &fd, &fault) == FSN_OK);
    CHECK(strcmp(os.options, "room=4194304 bypass=1 all in=1 ") == 0);
    set_up();
    CHECK(fsn_port_open_foreign("eth7", TAG, &fd, &fault) == FSN_OK && fd == FD);
    CHECK(strcmp(os.options, "room=0 in=1 ") == 0 && bound->sll_protocol == htons(0x88A4));
}

static fsn_status open_it(void) {
    int fd = 5;
    const fsn_status status = fsn_port_open("eth7", TAG, false, &fd, &fault);
    CHECK(fsn_port_open("eth7", TAG, false, &fd, NULL) == status && fd == -1);
    return status;
}

static fsn_status open_foreign(void) {
    int fd = 5;
    const fsn_status status = fsn_port_open_foreign("eth7", TAG, &fd, &fault);
    CHECK(fsn_port_open_foreign("eth7", TAG, &fd, NULL) == status && fd == -1);
    return status;
}

static fsn_status listen_to_it(void) {
    const fsn_status status = fsn_port_listen("eth7", 1000, &fault);
    CHECK(fsn_port_listen("eth7", 1000, NULL) == status);
    return status;
}

/** Every function that opens a raw socket reports the same failure. */
static void refusals_are_reported(void) {
    static fsn_status (*const opens[])(void) = {open_it, open_foreign, listen_to_it};
    for (size_t i = 0; i < 3; i++) {
        set_up();
        os.no_interface = true;
        CHECK(opens[i]() == FSN_E_SYS);
        TOLD(FSN_E_SYS, ENODEV, "unknown interface", "eth7");
        set_up();
        os.socket_fails = EPERM;
        CHECK(opens[i]() == FSN_E_SYS);
        TOLD(FSN_E_SYS, EPERM, "no raw socket could be opened",
             "eth7; raw sockets need CAP_NET_RAW");
        set_up();
        os.socket_fails = EMFILE;
        CHECK(opens[i]() == FSN_E_SYS);
        TOLD(FSN_E_SYS, EMFILE, "no raw socket could be opened", "eth7");
        set_up();
        os.mtu = 1499;
        CHECK(opens[i]() == FSN_E_SYS);
        TOLD(FSN_E_SYS, EMSGSIZE, "EtherCAT frames do not fit through the interface",
             "eth7 has an MTU of 1499, they need 1500");
        set_up();
        os.filter_fails = ENOMEM;
        CHECK(opens[i]() == FSN_E_SYS);
        TOLD(FSN_E_SYS, ENOMEM, "the raw socket is of no use", "eth7");
        set_up();
        os.bind_fails = ENETDOWN;
        CHECK(opens[i]() == FSN_E_SYS);
        TOLD(FSN_E_SYS, ENETDOWN, "the raw socket is of no use", "eth7");
    }
    int fd;
    set_up();
    os.ioctl_fails = ENOTTY; /* an unknown MTU is accepted */
    CHECK(fsn_port_open("eth7", TAG, false, &fd, &fault) == FSN_OK);
}

static void an_interface_has_one_user(void) {
    int lock = 5;
    set_up();
    CHECK(fsn_port_lock("eth7", &lock, &fault) == FSN_OK && lock == FD && os.closes == 0);
    const struct sockaddr_un *name = (const struct sockaddr_un *)&os.bound;
    CHECK(os.family == AF_UNIX && os.type == (SOCK_SEQPACKET | SOCK_CLOEXEC));
    CHECK(name->sun_family == AF_UNIX && name->sun_path[0] == 0);
    CHECK(strcmp(name->sun_path + 1, "fsn-maindevice:eth7") == 0);
    CHECK(os.bound_bytes == sizeof(sa_family_t) + 1 + 19);
    set_up();
    os.bind_fails = EADDRINUSE;
    CHECK(fsn_port_lock("eth7", &lock, &fault) == FSN_E_BUS_BUSY && lock == -1);
    TOLD(FSN_E_BUS_BUSY, 0, fsn_status_text(FSN_E_BUS_BUSY),
         "eth7: another process of fsoe-net drives this interface");
    CHECK(fsn_port_lock("eth7", &lock, NULL) == FSN_E_BUS_BUSY);
    set_up();
    os.bind_fails = EACCES;
    CHECK(fsn_port_lock("eth7", &lock, &fault) == FSN_E_SYS && lock == -1);
    TOLD(FSN_E_SYS, EACCES, "the interface could not be locked", "eth7");
    set_up();
    os.socket_fails = EMFILE;
    CHECK(fsn_port_lock("eth7", &lock, &fault) == FSN_E_SYS && lock == -1);
    TOLD(FSN_E_SYS, EMFILE, "the interface could not be locked", "eth7");
}

static void others_are_heard(void) {
    set_up();
    CHECK(fsn_port_listen("eth7", 250000000, &fault) == FSN_OK);
    CHECK(os.now_ns >= 250000000 && os.now_ns <= 252000000 && os.opens == os.closes);
    CHECK(((const struct sockaddr_ll *)&os.bound)->sll_protocol == htons(ETH_P_ALL));
    CHECK(passes(1, 2, 3, 4, 60) == 0xFFFF && filtered((const uint8_t[60]){0}, 60) == 0);
    set_up();
    os.packets = 3;
    CHECK(fsn_port_listen("eth7", 250000000, &fault) == FSN_E_BUS_BUSY);
    TOLD(FSN_E_BUS_BUSY, 0, fsn_status_text(FSN_E_BUS_BUSY),
         "eth7: 3 EtherCAT packets within 250 ms that are not ours");
    set_up();
    os.packets = 5000; /* a thousand are enough */
    CHECK(fsn_port_listen("eth7", 250000000, &fault) == FSN_E_BUS_BUSY && os.packets == 4000);
    set_up();
    os.counted = 17;
    CHECK(fsn_port_count_foreign(FD) == 17);
    os.getsockopt_fails = EBADF;
    CHECK(fsn_port_count_foreign(FD) == 0);
}

static void a_frame_is_tried(void) {
    static const uint8_t head[] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x02, 0x46, 0, 0, 0, 0,
                                   0x88, 0xA4, 0x0D, 0x10, 0,    0,    0,    0,    0, 0, 1, 0};
    set_up();
    CHECK(fsn_port_try("eth7") == 0 && os.sent_bytes == 60 && os.opens == os.closes);
    CHECK(memcmp(os.sent, head, sizeof head) == 0);
    for (size_t i = sizeof head; i < 60; i++) {
        CHECK(os.sent[i] == 0);
    }
    os.send_fails = ENETDOWN;
    CHECK(fsn_port_try("eth7") == ENETDOWN && os.opens == os.closes);
    set_up();
    os.no_interface = true;
    CHECK(fsn_port_try("eth7") == ENODEV);
    set_up();
    os.mtu = 576;
    errno = 0;
    CHECK(fsn_port_try("eth7") == EMSGSIZE && os.opens == os.closes);
}

static void tags_and_links_are_read(void) {
    static const uint8_t address[6] = {1, 2, 3, 4, 0xBE, 0xEF};
    set_up();
    memcpy(os.address, address, sizeof address);
    CHECK(fsn_port_tag("eth7") == 0xBEEF && os.family == AF_UNIX);
    CHECK(os.type == (SOCK_DGRAM | SOCK_CLOEXEC) && os.opens == 1 && os.closes == 1);
    os.ioctl_fails = ENODEV;
    CHECK(fsn_port_tag("eth7") == 1 && os.closes == 2);
    os.socket_fails = EMFILE;
    CHECK(fsn_port_tag("eth7") == 1 && !fsn_port_has_link("eth7") && os.closes == 2);
    static const struct {
        short flags;
        bool link;
    } table[] = {{IFF_UP | IFF_RUNNING, true}, {IFF_UP, false}, {IFF_RUNNING, false}, {0, false}};
    for (size_t i = 0; i < 4; i++) {
        set_up();
        os.flags = table[i].flags;
        CHECK(fsn_port_has_link("eth7") == table[i].link && os.opens == os.closes);
        os.ioctl_fails = ENODEV;
        CHECK(!fsn_port_has_link("eth7"));
    }
}

int main(void) {
    const long alive = heap_alive();
    filters_tell_frames_apart();
    sockets_are_set_up();
    refusals_are_reported();
    an_interface_has_one_user();
    others_are_heard();
    a_frame_is_tried();
    tags_and_links_are_read();
    CHECK(heap_alive() == alive);
    return 0;
}
