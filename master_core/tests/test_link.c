/** The link of an emulated segment to interfaces, over sockets of the test's own: this program's
 *  system calls replace those of libc, so no interface and no privilege is needed. */
#define _GNU_SOURCE

#include <arpa/inet.h>
#include <dlfcn.h>
#include <errno.h>
#include <linux/ethtool.h>
#include <linux/if_packet.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <poll.h>
#include <sched.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include "segment/segment_internal.h"
#include "segment_rig.h"

enum { FRAME_BYTES = 60, ETHERTYPE = 0x88A4 };

static struct rig rig;

static struct {
    int fails_in; /**< number of the call that fails, from now on; 0: none */
    const char *driver;
    int mtu;
    atomic_bool running[2]; /**< per interface: it has a carrier */
    atomic_bool down[2]; /**< per port: its interface went down, and that error has not been read */
    atomic_int send_fails;
    atomic_int polls;
    atomic_bool frozen;             /**< the clock */
    int inherits, policy, priority; /**< of the last thread */
    int peer[4];                    /**< far ends of the interfaces, as they were opened */
    int peers;
} os;

static bool fails(void) {
    errno = EPERM;
    return os.fails_in > 0 && --os.fails_in == 0;
}

unsigned if_nametoindex(const char *name) {
    return fails() || strcmp(name, "none") == 0 ? 0 : 1u + (unsigned)(name[0] == 'b');
}

int socket(int domain, int type, int protocol) {
    int ends[2];
    if (fails()) {
        return -1;
    }
    if (domain != AF_PACKET) {
        CHECK(type == (SOCK_STREAM | SOCK_CLOEXEC));
        return (int)syscall(SYS_socket, domain, type, protocol);
    }
    CHECK(type == (SOCK_RAW | SOCK_CLOEXEC) && protocol == htons(ETHERTYPE));
    CHECK(os.peers < 4 && socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) == 0);
    os.peer[os.peers++] = ends[1];
    return ends[0];
}

int ioctl(int fd, unsigned long request, ...) {
    va_list arguments;
    va_start(arguments, request);
    struct ifreq *ifr = va_arg(arguments, struct ifreq *);
    va_end(arguments);
    CHECK(strcmp(ifr->ifr_name, "a") == 0 || strcmp(ifr->ifr_name, "b") == 0);
    if (request != SIOCGIFFLAGS && fails()) {
        return -1;
    }
    if (request == SIOCETHTOOL) {
        struct ethtool_drvinfo *info = (void *)ifr->ifr_data;
        CHECK(info->cmd == ETHTOOL_GDRVINFO);
        snprintf(info->driver, sizeof info->driver, "%s", os.driver);
    } else if (request == SIOCGIFMTU) {
        ifr->ifr_mtu = os.mtu;
    } else {
        CHECK(request == SIOCGIFFLAGS);
        const unsigned port = ifr->ifr_name[0] == 'b';
        CHECK(fd == rig.segment->sockets[port]);
        ifr->ifr_flags = (short)(IFF_UP | (atomic_load(&os.running[port]) ? IFF_RUNNING : 0));
    }
    return 0;
}

int setsockopt(int fd, int level, int name, const void *value, socklen_t size) {
    if (fails()) {
        return -1;
    }
    const struct timeval *patience = value;
    if (level == SOL_SOCKET) {
        CHECK(name == SO_RCVTIMEO && size == sizeof *patience);
        CHECK(patience->tv_sec == 0 && patience->tv_usec == 5000);
    } else {
        CHECK(level == SOL_PACKET && name == PACKET_IGNORE_OUTGOING);
        CHECK(size == sizeof(int) && *(const int *)value == 1);
    }
    return level == SOL_PACKET ? 0 : (int)syscall(SYS_setsockopt, fd, level, name, value, size);
}

int bind(int fd, __CONST_SOCKADDR_ARG address, socklen_t size) {
    if (fails()) {
        return -1;
    }
    const struct sockaddr *to = address.__sockaddr__;
    if (to->sa_family == AF_PACKET) {
        const struct sockaddr_ll *port = (const void *)to;
        CHECK(port->sll_protocol == htons(ETHERTYPE) && size == sizeof *port);
        CHECK(port->sll_ifindex == (fd == rig.segment->sockets[1] ? 2 : 1));
        return 0;
    }
    static const char name[] = "\0fsn-segment:?"; /* abstract */
    const struct sockaddr_un *lock = (const void *)to;
    CHECK(memcmp(lock->sun_path, name, sizeof name - 2) == 0);
    CHECK(lock->sun_path[sizeof name - 2] == (fd == rig.segment->locks[1] ? 'b' : 'a'));
    CHECK(size == offsetof(struct sockaddr_un, sun_path) + sizeof name - 1);
    return (int)syscall(SYS_bind, fd, to, size);
}

/** Only a link with two ports, or with frames that are due soon, needs it. */
int ppoll(struct pollfd *fds, nfds_t count, const struct timespec *timeout, const sigset_t *mask) {
    atomic_fetch_add(&os.polls, 1);
    CHECK(count == 2 && fds[0].fd == rig.segment->sockets[0] && fds[0].events == POLLIN);
    CHECK(fds[1].fd == rig.segment->sockets[1] && fds[1].events == POLLIN && mask == NULL);
    CHECK(timeout->tv_sec == 0 && timeout->tv_nsec <= 5000000);
    for (int port = 0; port < 2; port++) {
        fds[port].revents = atomic_load(&os.down[port]) ? POLLERR : 0;
    }
    if (fds[0].revents + fds[1].revents != 0) {
        return 1;
    }
    struct timespec left = *timeout; /* the kernel writes the rest of it */
    return (int)syscall(SYS_ppoll, fds, count, &left, NULL, (size_t)0);
}

/** Scheduling requested for the thread; here it runs as any other. */
int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *),
                   void *context) {
    int (*libc)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    void *found = dlsym(RTLD_NEXT, "pthread_create");
    struct sched_param parameter;
    memcpy(&libc, &found, sizeof found);
    CHECK(pthread_attr_getinheritsched(attributes, &os.inherits) == 0);
    CHECK(pthread_attr_getschedpolicy(attributes, &os.policy) == 0);
    CHECK(pthread_attr_getschedparam(attributes, &parameter) == 0);
    os.priority = parameter.sched_priority;
    return libc(thread, os.priority != 0 ? NULL : attributes, run, context);
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    CHECK(clock == CLOCK_MONOTONIC);
    if (!atomic_load(&os.frozen)) {
        return (int)syscall(SYS_clock_gettime, clock, now);
    }
    *now = (struct timespec){.tv_sec = 1000000000, .tv_nsec = 5};
    return 0;
}

ssize_t recv(int fd, void *bytes, size_t size, int flags) {
    for (int port = 0; port < 2; port++) {
        if (fd == rig.segment->sockets[port] && atomic_exchange(&os.down[port], false)) {
            errno = ENETDOWN;
            return -1;
        }
    }
    return recvfrom(fd, bytes, size, flags, NULL, NULL);
}

ssize_t send(int fd, const void *bytes, size_t size, int flags) {
    const int error = atomic_exchange(&os.send_fails, 0);
    if (error != 0) {
        errno = error;
        return -1;
    }
    return sendto(fd, bytes, size, flags, NULL, 0);
}

static void begin(void) {
    rig = set_up();
    os.driver = "veth";
    os.mtu = 1500;
    atomic_store(&os.running[0], true);
    atomic_store(&os.running[1], true);
}

static void hang_up(void) {
    fsn_segment_unlink(rig.segment);
    for (int port = 0; port < 2; port++) {
        CHECK(rig.segment->sockets[port] == -1 && rig.segment->locks[port] == -1);
    }
    while (os.peers > 0) {
        CHECK(close(os.peer[--os.peers]) == 0);
    }
}

static void end(void) {
    hang_up();
    tear_down(&rig);
}

static fsn_status plug(struct fsn_segment_link_options options, int *sys_errno) {
    return fsn_segment_link(rig.segment, &options, sys_errno);
}

/** Sends a broadcast read of two bytes. */
static void ask_at(int port) {
    uint8_t frame[FRAME_BYTES] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 1, 1, 1, 1, 1, 1, 0x88, 0xA4};
    frame[14] = 14;
    frame[15] = 0x10;
    frame[16] = BRD;
    frame[22] = 2;
    CHECK(sendto(os.peer[port], frame, sizeof frame, 0, NULL, 0) == FRAME_BYTES);
}

/** The working counter of one that comes back where it is waited for. */
static int answer_at(int from, int to) {
    uint8_t frame[FRAME_BYTES];
    ask_at(from);
    CHECK(recv(os.peer[to], frame, sizeof frame, 0) == FRAME_BYTES);
    return frame[28] | frame[29] << 8;
}

static void what_is_asked_is_checked(void) {
    int error = 77;
    int allowed = 0; /* the first CPU that this process may use */
    cpu_set_t set;
    CHECK(sched_getaffinity(0, sizeof set, &set) == 0);
    while (!CPU_ISSET((size_t)allowed, &set)) {
        allowed++;
    }
    begin();
    CHECK(fsn_segment_link(NULL, NULL, &error) == FSN_E_ARG);
    CHECK(fsn_segment_link(rig.segment, NULL, &error) == FSN_E_ARG);
    CHECK(plug((struct fsn_segment_link_options){0}, &error) == FSN_E_ARG);
    CHECK(plug((struct fsn_segment_link_options){.interface = "a", .interface2 = "a"}, &error) ==
          FSN_E_ARG);
    fsn_segment_unlink(NULL);
    fsn_segment_unlink(rig.segment);
    const struct {
        struct fsn_segment_link_options options;
        fsn_status status;
        int error;
    } rows[] = {
        {{.interface = "none"}, FSN_E_SYS, ENODEV},
        {{.interface = "a", .interface2 = "none"}, FSN_E_SYS, ENODEV},
        {{.interface = "a", .cpu = -1}, FSN_E_SYS, EINVAL},
        {{.interface = "a", .cpu = CPU_SETSIZE + 1}, FSN_E_SYS, EINVAL},
        {{.interface = "a", .priority = 1000}, FSN_E_SYS, EINVAL},
        {{.interface = "a", .priority = 1000, .cpu = 1}, FSN_E_SYS, EINVAL},
        {{.interface = "a", .cpu = CPU_SETSIZE}, FSN_E_SYS, EINVAL}, /* not existing */
        {{.interface = "a", .cpu = allowed + 1}, FSN_OK, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        if (plug(rows[i].options, &error) != rows[i].status || error != rows[i].error) {
            fprintf(stderr, "row %zu: %d\n", i, error);
            exit(1);
        }
        CHECK(plug(rows[i].options, NULL) ==
              (rows[i].status == FSN_OK ? FSN_E_STATE : rows[i].status));
        hang_up();
    }
    CHECK(os.inherits == PTHREAD_INHERIT_SCHED && os.policy == SCHED_OTHER && os.priority == 0);
    CHECK(plug((struct fsn_segment_link_options){.interface = "a", .priority = 9}, NULL) == FSN_OK);
    CHECK(os.inherits == PTHREAD_EXPLICIT_SCHED && os.policy == SCHED_FIFO && os.priority == 9);
    end();
}

static void real_interfaces_are_refused(void) {
    static const struct {
        const char *driver;
        int mtu;
        fsn_status status;
        int error;
    } rows[] = {{"veth", 1500, FSN_OK, 0},
                {"tun", 9000, FSN_OK, 0},
                {"e1000e", 1500, FSN_E_ARG, 0},
                {"veth", 1499, FSN_E_SYS, EMSGSIZE}};
    begin();
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        int error = 77;
        os.driver = rows[i].driver;
        os.mtu = rows[i].mtu;
        CHECK(plug((struct fsn_segment_link_options){.interface = "a"}, &error) == rows[i].status);
        CHECK(error == rows[i].error);
        hang_up();
    }
    end();
}

/** Whichever call fails, it is reported, nothing stays open, and the next attempt works. An unknown
 *  MTU is not treated as too small. */
static void each_call_may_fail(void) {
    const struct fsn_segment_link_options ring = {.interface = "a", .interface2 = "b"};
    unsigned logged = 0, not_virtual = 0, good = 0;
    begin();
    for (int n = 1, left = 0; left == 0; n++) {
        int error = 0;
        os.fails_in = n;
        const fsn_status status = plug(ring, &error);
        left = os.fails_in;
        os.fails_in = 0;
        CHECK(status != FSN_E_SYS || error == EPERM || error == ENODEV);
        logged += status == FSN_E_SYS;
        not_virtual += status == FSN_E_ARG;
        good += status == FSN_OK;
        hang_up();
        CHECK(plug(ring, NULL) == FSN_OK && answer_at(0, 1) == 2);
        hang_up();
    }
    CHECK(logged == 14 && not_virtual == 2 && good == 3);
    end();
}

static uint64_t last_ns(void) {
    pthread_mutex_lock(&rig.segment->lock);
    const uint64_t ns = rig.segment->last_ns;
    pthread_mutex_unlock(&rig.segment->lock);
    return ns;
}

static void an_answer_that_cannot_be_sent_is_counted(void) {
    struct fsn_segment_counts counts;
    begin();
    atomic_store(&os.polls, 0);
    CHECK(plug((struct fsn_segment_link_options){.interface = "a"}, NULL) == FSN_OK);
    CHECK(answer_at(0, 0) == 2);
    atomic_store(&os.send_fails, ENETDOWN);
    ask_at(0);
    CHECK(sendto(os.peer[0], "", 0, 0, NULL, 0) == 0);  /* nothing in it: no frame */
    CHECK(sendto(os.peer[0], "x", 1, 0, NULL, 0) == 1); /* but not one of EtherCAT */
    CHECK(answer_at(0, 0) == 2);                        /* the next one is */
    fsn_segment_counts(rig.segment, &counts);
    CHECK(counts.unsent == 1 && counts.send_errno == ENETDOWN && counts.foreign == 1);
    /* Time continues without frames. */
    const uint64_t before = last_ns();
    while (last_ns() == before) {
        usleep(1000);
    }
    CHECK(atomic_load(&os.polls) == 0);
    atomic_store(&os.frozen, true);
    while (last_ns() != UINT64_C(1000000000000000005)) {
        usleep(1000);
    }
    atomic_store(&os.frozen, false);
    end();
}

/** A ring with one carrier is a line from there: the answer comes back where it was sent. */
static void a_ring_opens_without_a_carrier(unsigned gone) {
    const unsigned left = 1 - gone;
    begin();
    CHECK(plug((struct fsn_segment_link_options){.interface = "a", .interface2 = "b"}, NULL) ==
          FSN_OK);
    CHECK(answer_at(0, 1) == 2 && answer_at(1, 0) == 0); /* backwards it is not read */
    atomic_store(&os.running[gone], false);
    int back = 0;
    while (back == 0) { /* until it has looked */
        uint8_t frame[FRAME_BYTES];
        ask_at((int)left);
        while (back == 0 && recv(os.peer[gone], frame, sizeof frame, MSG_DONTWAIT) < 0) {
            back = recv(os.peer[left], frame, sizeof frame, MSG_DONTWAIT) > 0;
            usleep(1000);
        }
    }
    CHECK(answer_at((int)left, (int)left) == 2);
    ask_at((int)gone);
    CHECK(answer_at((int)left, (int)left) == 2);
    uint8_t frame[FRAME_BYTES];
    CHECK(recv(os.peer[gone], frame, sizeof frame, MSG_DONTWAIT) < 0); /* lost, all that time */
    const uint64_t before = last_ns();
    while (last_ns() == before) {
        usleep(1000);
    }
    end();
}

/** The kernel reports it until it is read; a thread that does not read it waits no longer. */
static void an_interface_that_goes_down_is_read_once(void) {
    begin();
    CHECK(plug((struct fsn_segment_link_options){.interface = "a", .interface2 = "b"}, NULL) ==
          FSN_OK);
    for (int port = 0; port < 2; port++) {
        atomic_store(&os.down[port], true);
        while (atomic_load(&os.down[port])) {
            usleep(1000);
        }
    }
    CHECK(answer_at(0, 1) == 2);
    end();
}

int main(void) {
    close(STDIN_FILENO); /* 0 is a descriptor like any other */
    const int open_before = open_files();
    what_is_asked_is_checked();
    real_interfaces_are_refused();
    each_call_may_fail();
    an_answer_that_cannot_be_sent_is_counted();
    a_ring_opens_without_a_carrier(0);
    a_ring_opens_without_a_carrier(1);
    an_interface_that_goes_down_is_read_once();
    CHECK(open_files() == open_before);
    return 0;
}
