#define _GNU_SOURCE

#include "backends/soem/xdp.h"

#include <arpa/inet.h>
#include <errno.h>
#include <linux/bpf.h>
#include <linux/ethtool.h>
#include <linux/if_link.h>
#include <linux/if_xdp.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "live/node.h"
#include "live/port.h"
#include "rt/wire.h"

enum {
    ETHERCAT = 0x88A4,
    INDEX_BYTE = 17,
    MEMORY_BYTES = 2 * FSN_RINGS_SLOTS * FSN_RINGS_SLOT_BYTES,
    LINK_MS = 10000, /* a card may restart when it gets a program */
    STEP_MS = 20,
};

/** The rings, and what else is open; closing `link` removes the program from the interface. */
struct xdp {
    struct fsn_rings rings;
    int map, program, link;
    struct {
        void *at;
        size_t bytes;
    } mapped[4];
};

static fsn_status refuse(struct fsn_fault *fault, const char *interface, const char *rule) {
    return fsn_port_refuse(fault, interface, rule, "AF_XDP also needs CAP_NET_ADMIN and CAP_BPF");
}

static int bpf(enum bpf_cmd command, union bpf_attr *attributes) {
    return (int)syscall(SYS_bpf, command, attributes, sizeof *attributes);
}

/* -- the program ------------------------------------------------------------------------------ */

/** One instruction of eBPF; registers and operations as in instruction-set.rst of Linux. */
#define STEP(operation, to, from, skip, value)                                                     \
    {.code = (operation), .dst_reg = (to), .src_reg = (from), .off = (skip), .imm = (value)}
#define LOAD(size, to, from, at) STEP(BPF_LDX | BPF_MEM | (size), to, from, at, 0)
#define COPY(to, from) STEP(BPF_ALU64 | BPF_MOV | BPF_X, to, from, 0, 0)
#define SET(to, value) STEP(BPF_ALU64 | BPF_MOV | BPF_K, to, 0, 0, value)
#define UNLESS_EQUAL(reg, value, skip) STEP(BPF_JMP | BPF_JNE | BPF_K, reg, 0, skip, value)

/** Loads the program: it passes each packet to the system, except the replies to cyclic frames of
 *  this tag on the queue with the rings. */
static int load_program(int map, uint16_t tag) {
    enum { PACKET = BPF_REG_2, END = BPF_REG_3, FOUND = BPF_REG_5 };
    const struct bpf_insn code[] = {
        LOAD(BPF_W, PACKET, BPF_REG_1, offsetof(struct xdp_md, data)),
        LOAD(BPF_W, END, BPF_REG_1, offsetof(struct xdp_md, data_end)),
        COPY(BPF_REG_4, PACKET),
        STEP(BPF_ALU64 | BPF_ADD | BPF_K, BPF_REG_4, 0, 0, INDEX_BYTE + 1),
        STEP(BPF_JMP | BPF_JGT | BPF_X, BPF_REG_4, END, 14, 0),
        LOAD(BPF_H, FOUND, PACKET, 12),
        UNLESS_EQUAL(FOUND, htons(ETHERCAT), 12),
        LOAD(BPF_H, FOUND, PACKET, FSN_PORT_SOURCE),
        UNLESS_EQUAL(FOUND, htons(FSN_PORT_OURS), 10),
        LOAD(BPF_H, FOUND, PACKET, FSN_PORT_TAG),
        UNLESS_EQUAL(FOUND, htons(tag), 8),
        LOAD(BPF_B, FOUND, PACKET, INDEX_BYTE),
        STEP(BPF_JMP | BPF_JLT | BPF_K, FOUND, 0, 6, FSN_WIRE_FIRST_INDEX),
        LOAD(BPF_W, BPF_REG_2, BPF_REG_1, offsetof(struct xdp_md, rx_queue_index)),
        STEP(BPF_LD | BPF_DW | BPF_IMM, BPF_REG_1, BPF_PSEUDO_MAP_FD, 0, map),
        STEP(0, 0, 0, 0, 0), /* the upper half of that value */
        SET(BPF_REG_3, XDP_PASS),
        STEP(BPF_JMP | BPF_CALL, 0, 0, 0, BPF_FUNC_redirect_map),
        STEP(BPF_JMP | BPF_EXIT, 0, 0, 0, 0),
        SET(BPF_REG_0, XDP_PASS),
        STEP(BPF_JMP | BPF_EXIT, 0, 0, 0, 0),
    };
    union bpf_attr load = {.prog_type = BPF_PROG_TYPE_XDP,
                           .insn_cnt = sizeof code / sizeof code[0],
                           .insns = (uint64_t)(uintptr_t)code,
                           .license = (uint64_t)(uintptr_t)"Apache-2.0",
                           .prog_name = "fsn_cyclic",
                           .expected_attach_type = BPF_XDP};
    return bpf(BPF_PROG_LOAD, &load);
}

/** Attaches the program until the process ends, in the driver where that is possible. */
static int attach(int program, unsigned interface) {
    union bpf_attr link = {.link_create = {.prog_fd = (uint32_t)program,
                                           .target_ifindex = interface,
                                           .attach_type = BPF_XDP,
                                           .flags = XDP_FLAGS_DRV_MODE}};
    const int made = bpf(BPF_LINK_CREATE, &link);
    if (made >= 0 || errno != EOPNOTSUPP) {
        return made;
    }
    link.link_create.flags = XDP_FLAGS_SKB_MODE;
    return bpf(BPF_LINK_CREATE, &link);
}

/* -- the rings -------------------------------------------------------------------------------- */

static bool set_size(int fd, int option) {
    const int entries = FSN_RINGS_SLOTS;
    return setsockopt(fd, SOL_XDP, option, &entries, sizeof entries) == 0;
}

static bool map_ring(struct xdp *x, int number, const struct xdp_ring_offset *at, off_t page,
                     size_t entry_bytes, struct fsn_rings_queue *ring) {
    const size_t bytes = (size_t)at->desc + FSN_RINGS_SLOTS * entry_bytes;
    uint8_t *memory =
        mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, x->rings.fd, page);
    if (memory == MAP_FAILED) {
        return false;
    }
    x->mapped[number].at = memory;
    x->mapped[number].bytes = bytes;
    *ring = (struct fsn_rings_queue){.producer = (void *)(memory + at->producer),
                                     .consumer = (void *)(memory + at->consumer),
                                     .flags = (void *)(memory + at->flags),
                                     .entries = memory + at->desc};
    return true;
}

static bool make_rings(struct xdp *x) {
    struct fsn_rings *r = &x->rings;
    r->memory = mmap(NULL, MEMORY_BYTES, PROT_READ | PROT_WRITE,
                     MAP_PRIVATE | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (r->memory == MAP_FAILED) {
        r->memory = NULL;
        return false;
    }
    const struct xdp_umem_reg area = {.addr = (uint64_t)(uintptr_t)r->memory,
                                      .len = MEMORY_BYTES,
                                      .chunk_size = FSN_RINGS_SLOT_BYTES};
    struct xdp_mmap_offsets at;
    socklen_t size = sizeof at;
    return setsockopt(r->fd, SOL_XDP, XDP_UMEM_REG, &area, sizeof area) == 0 &&
           set_size(r->fd, XDP_UMEM_FILL_RING) && set_size(r->fd, XDP_UMEM_COMPLETION_RING) &&
           set_size(r->fd, XDP_RX_RING) && set_size(r->fd, XDP_TX_RING) &&
           getsockopt(r->fd, SOL_XDP, XDP_MMAP_OFFSETS, &at, &size) == 0 &&
           map_ring(x, 0, &at.rx, XDP_PGOFF_RX_RING, sizeof(struct xdp_desc), &r->rx) &&
           map_ring(x, 1, &at.tx, XDP_PGOFF_TX_RING, sizeof(struct xdp_desc), &r->tx) &&
           map_ring(x, 2, &at.fr, (off_t)XDP_UMEM_PGOFF_FILL_RING, sizeof(uint64_t), &r->fill) &&
           map_ring(x, 3, &at.cr, (off_t)XDP_UMEM_PGOFF_COMPLETION_RING, sizeof(uint64_t),
                    &r->completion);
}

/** Takes queue 0, with zero copy where the driver has it. */
static bool take_queue(struct fsn_rings *r, unsigned interface) {
    const struct sockaddr_xdp at = {
        .sxdp_family = AF_XDP, .sxdp_flags = XDP_USE_NEED_WAKEUP, .sxdp_ifindex = interface};
    struct xdp_options options = {0};
    socklen_t size = sizeof options;
    if (bind(r->fd, (const struct sockaddr *)&at, sizeof at) != 0 ||
        getsockopt(r->fd, SOL_XDP, XDP_OPTIONS, &options, &size) != 0) {
        return false;
    }
    r->zero_copy = (options.flags & XDP_OPTIONS_ZEROCOPY) != 0;
    return true;
}

/* -- the interface ---------------------------------------------------------------------------- */

/** Replies in any queue but the first would never be read. */
static fsn_status check_queues(const char *interface, struct fsn_fault *fault) {
    struct ethtool_channels queues = {.cmd = ETHTOOL_GCHANNELS};
    struct ifreq request = {.ifr_data = (char *)&queues};
    const bool known = fsn_port_ask(interface, SIOCETHTOOL, &request);
    const unsigned count = queues.rx_count + queues.combined_count;
    return !known || count <= 1 /* a driver that does not report them has one */
               ? FSN_OK
               : fsn_live_refuse(fault, FSN_E_STATE,
                                 "AF_XDP reads the first queue of an interface only",
                                 "%s receives on %u queues; ethtool -L %s %s 1", interface, count,
                                 interface, queues.combined_count > 0 ? "combined" : "rx");
}

static void wait_for_link(const char *interface) {
    const struct timespec step = {.tv_nsec = STEP_MS * 1000000L};
    for (int ms = 0; ms < LINK_MS && !fsn_port_has_link(interface); ms += STEP_MS) {
        clock_nanosleep(CLOCK_MONOTONIC, 0, &step, NULL);
    }
}

static fsn_status open_steps(struct xdp *x, const char *interface, uint16_t tag,
                             struct fsn_fault *fault) {
    const unsigned number = if_nametoindex(interface);
    if (number == 0) {
        errno = ENODEV;
        return refuse(fault, interface, "unknown interface");
    }
    FSN_TRY(check_queues(interface, fault));
    const bool had_link = fsn_port_has_link(interface);
    x->rings.fd = socket(AF_XDP, SOCK_RAW | SOCK_CLOEXEC, 0);
    if (x->rings.fd < 0 || !make_rings(x)) {
        return refuse(fault, interface, "no AF_XDP socket could be opened");
    }
    union bpf_attr map = {.map_type = BPF_MAP_TYPE_XSKMAP,
                          .key_size = sizeof(uint32_t),
                          .value_size = sizeof(uint32_t),
                          .max_entries = 1};
    x->map = bpf(BPF_MAP_CREATE, &map);
    x->program = x->map >= 0 ? load_program(x->map, tag) : -1;
    if (x->program < 0) {
        return refuse(fault, interface, "the kernel does not load the XDP program");
    }
    x->link = attach(x->program, number);
    if (x->link < 0 && errno == EBUSY) {
        return fsn_live_refuse(fault, FSN_E_STATE, "another XDP program has the interface",
                               "%s; bpftool net lists it", interface);
    }
    if (x->link < 0) {
        return refuse(fault, interface, "the interface takes no XDP program");
    }
    fsn_rings_fill(&x->rings);
    if (!take_queue(&x->rings, number)) {
        return refuse(fault, interface, "the interface has no queue for AF_XDP");
    }
    const uint32_t queue = 0;
    const uint32_t fd = (uint32_t)x->rings.fd;
    union bpf_attr entry = {.map_fd = (uint32_t)x->map,
                            .key = (uint64_t)(uintptr_t)&queue,
                            .value = (uint64_t)(uintptr_t)&fd};
    if (bpf(BPF_MAP_UPDATE_ELEM, &entry) != 0) {
        return refuse(fault, interface, "the interface has no queue for AF_XDP");
    }
    if (had_link) {
        wait_for_link(interface);
    }
    return FSN_OK;
}

static void release(struct xdp *x) {
    const int open[] = {x->link, x->rings.fd, x->program, x->map};
    for (size_t i = 0; i < sizeof open / sizeof open[0]; i++) {
        if (open[i] >= 0) {
            close(open[i]);
        }
    }
    for (size_t i = 0; i < sizeof x->mapped / sizeof x->mapped[0]; i++) {
        if (x->mapped[i].at != NULL) {
            munmap(x->mapped[i].at, x->mapped[i].bytes);
        }
    }
    if (x->rings.memory != NULL) {
        munmap(x->rings.memory, MEMORY_BYTES);
    }
    free(x);
}

fsn_status soem_xdp_open(const char *interface, uint16_t tag, struct fsn_rings **rings,
                         struct fsn_fault *fault) {
    *rings = NULL;
    struct xdp *x = calloc(1, sizeof *x);
    if (x == NULL) {
        return fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
    }
    x->rings.fd = x->map = x->program = x->link = -1;
    const fsn_status status = open_steps(x, interface, tag, fault);
    if (status != FSN_OK) {
        release(x);
        return status;
    }
    *rings = (struct fsn_rings *)x; /* its first member */
    return FSN_OK;
}

void soem_xdp_close(struct fsn_rings *rings) {
    if (rings != NULL) {
        release((struct xdp *)rings); /* its first member */
    }
}
