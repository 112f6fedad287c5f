#define _GNU_SOURCE

#include "backends/soem/soem.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "backends/soem/xdp.h"
#include "live/port.h"

enum { LISTEN_NS = 60000000, MBX_COE = 0x04, WINDOW_NS = 1000 };

/* -- helpers -------------------------------------------------------------------------------- */

/** Here, because every acyclic exchange begins with it, however long they take together. */
static void count_foreign(struct fsn_soem *bus) {
    for (size_t i = 0; i < FSN_WIRE_PORTS; i++) {
        if (bus->foreign[i] >= 0) {
            atomic_fetch_add_explicit(&bus->frames.wire.foreign,
                                      fsn_port_count_foreign(bus->foreign[i]),
                                      memory_order_relaxed);
        }
    }
}

void soem_drain(struct fsn_soem *bus) {
    count_foreign(bus);
    const int sockets[] = {bus->port.sockhandle,
                           bus->redundant[0] != '\0' ? bus->redundant_port.sockhandle : -1};
    for (size_t i = 0; i < sizeof sockets / sizeof sockets[0]; i++) {
        uint8_t packet[FSN_WIRE_MOST];
        while (sockets[i] >= 0 && recv(sockets[i], packet, sizeof packet, MSG_DONTWAIT) > 0) {
        }
    }
}

bool soem_has_coe(const struct fsn_soem *bus, uint16_t slave) {
    return bus->slaves[slave].mbx_l > 0 && (bus->slaves[slave].mbx_proto & MBX_COE) != 0;
}

bool soem_reach(struct fsn_soem *bus, uint16_t slave, uint8_t al_state, unsigned most_ms) {
    ec_slavet *s = &bus->slaves[slave];
    soem_drain(bus);
    s->state = (uint16)(al_state | EC_STATE_ACK);
    ecx_writestate(&bus->context, slave);
    return ecx_statecheck(&bus->context, slave, al_state, (int)(1000 * most_ms)) == al_state;
}

void soem_prepare_mailbox(struct fsn_soem *bus, uint16_t slave) {
    ec_slavet *s = &bus->slaves[slave];
    if (s->mbx_l > 0) {
        (void)soem_write(bus, slave, ECT_REG_SM0, s->SM, 2 * sizeof(ec_smt));
    }
    ecx_eeprom2pdi(&bus->context, slave);
}

bool soem_write(struct fsn_soem *bus, uint16_t slave, uint16_t address, const void *data,
                uint16_t size_bytes) {
    return ecx_FPWR(bus->context.port, bus->slaves[slave].configadr, address, size_bytes,
                    (void *)(uintptr_t)data, EC_TIMEOUTRET3) == 1;
}

uint16_t soem_slave_at(const struct fsn_soem *bus, uint16_t station) {
    uint16_t slave = 1;
    while (slave <= bus->slave_count && bus->slaves[slave].configadr != station) {
        slave++;
    }
    return slave <= bus->slave_count ? slave : 0;
}

struct node *soem_node_at(struct fsn_soem *bus, uint16_t slave) {
    const int node = bus->places[slave].node;
    return node == SOEM_NO_NODE ? NULL : &bus->nodes[node];
}

const char *soem_name_at(const struct fsn_soem *bus, uint16_t slave) {
    const int node = bus->places[slave].node;
    return node == SOEM_NO_NODE ? bus->slaves[slave].name : bus->nodes[node].known.info.name;
}

/* -- life ----------------------------------------------------------------------------------- */

static bool copy_name(char *to, const char *from) {
    return from == NULL || snprintf(to, SOEM_NAME_BYTES, "%s", from) < SOEM_NAME_BYTES;
}

static fsn_status soem_create(const struct fsn_live_options *options, void **out,
                              struct fsn_fault *fault) {
    if (options == NULL || out == NULL || options->interface == NULL ||
        options->interface[0] == '\0') {
        return fsn_refuse_all(fault, FSN_E_ARG, "the SOEM backend needs a network interface");
    }
    *out = NULL;
    struct fsn_soem *bus = calloc(1, sizeof *bus);
    if (bus == NULL) {
        return fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
    }
    if (!copy_name(bus->interface, options->interface) ||
        !copy_name(bus->redundant, options->redundant) ||
        strcmp(bus->interface, bus->redundant) == 0) {
        free(bus);
        return fsn_refuse_all(fault, FSN_E_ARG,
                              "interfaces have at most 15 characters and are not the same");
    }
    bus->xdp = options->xdp;
    bus->cycle_ns = options->cycle_ns;
    bus->wait_ns = options->receive_wait_ns;
    bus->dc_every = options->dc_every;
    bus->dc_host = options->dc_host;
    bus->clocks.host = options->dc_host;
    bus->clocks.shift_ns = (uint32_t)options->dc_shift_ns;
    bus->clocks.window_ns =
        (uint32_t)(options->dc_window_ns != 0 ? options->dc_window_ns : WINDOW_NS);
    bus->attach = options->attach;
    bus->sockets[0] = bus->sockets[1] = bus->foreign[0] = bus->foreign[1] = bus->lock = -1;
    bus->tag = fsn_port_tag(bus->interface);
    fsn_nodes_init(&bus->all);
    *out = bus;
    return FSN_OK;
}

static void close_socket(int *socket) {
    if (*socket >= 0) {
        close(*socket);
    }
    *socket = -1;
}

void soem_release(void *context) {
    struct fsn_soem *bus = context;
    for (unsigned port = 0; port < FSN_WIRE_PORTS; port++) {
        if (bus->rings[port] == NULL) {
            close_socket(&bus->sockets[port]);
        }
        soem_xdp_close(bus->rings[port]);
        bus->rings[port] = NULL;
        bus->sockets[port] = -1;
        close_socket(&bus->foreign[port]);
    }
    fsn_frames_free(&bus->frames);
    if (bus->nic_open) {
        ecx_close(&bus->context);
        bus->nic_open = false;
    }
    close_socket(&bus->lock);
}

static void soem_free(void *context) {
    struct fsn_soem *bus = context;
    if (bus == NULL) {
        return;
    }
    soem_release(bus);
    fsn_nodes_free(&bus->all);
    free(bus->described);
    free(bus->groups_of_plan);
    free(bus);
}

static void set_up_context(struct fsn_soem *bus) {
    bus->context = (ecx_contextt){
        .port = &bus->port,
        .slavelist = bus->slaves,
        .slavecount = &bus->slave_count,
        .maxslave = SOEM_MOST_SLAVES,
        .grouplist = bus->groups,
        .maxgroup = 1,
        .esibuf = bus->esi_buffer,
        .esimap = bus->esi_map,
        .elist = &bus->errors,
        .idxstack = &bus->stack,
        .ecaterror = &bus->ecat_error,
        .DCtime = &bus->dc_time,
        .SMcommtype = &bus->comm_type,
        .PDOassign = &bus->assign,
        .PDOdesc = &bus->desc,
        .eepSM = &bus->eeprom_sm,
        .eepFMMU = &bus->eeprom_fmmu,
    };
}

/** SOEM writes a header once for each of its frames, and the middle of the address when it sends;
 *  this distinguishes its two interfaces. */
static void sign(struct fsn_soem *bus, ec_bufT *frame) {
    uint8_t *bytes = (uint8_t *)frame;
    bytes[FSN_PORT_SOURCE] = FSN_PORT_OURS >> 8;
    bytes[FSN_PORT_SOURCE + 1] = FSN_PORT_OURS & 0xFF;
    bytes[FSN_PORT_TAG] = (uint8_t)(bus->tag >> 8);
    bytes[FSN_PORT_TAG + 1] = (uint8_t)bus->tag;
}

fsn_status soem_open_nic(struct fsn_soem *bus, struct fsn_fault *fault) {
    set_up_context(bus);
    const bool redundant = bus->redundant[0] != '\0';
    const int ok = redundant ? ecx_init_redundant(&bus->context, &bus->redundant_port,
                                                  bus->interface, bus->redundant)
                             : ecx_init(&bus->context, bus->interface);
    bus->nic_open = bus->port.sockhandle > 0;
    if (ok <= 0 || fsn_port_filter_acyclic(bus->port.sockhandle, bus->tag) != FSN_OK ||
        (redundant &&
         fsn_port_filter_acyclic(bus->redundant_port.sockhandle, bus->tag) != FSN_OK)) {
        return fsn_refuse_all(fault, FSN_E_SYS, "SOEM cannot use the interface");
    }
    for (size_t i = 0; i < EC_MAXBUF; i++) {
        sign(bus, &bus->port.txbuf[i]);
    }
    sign(bus, &bus->port.txbuf2);
    return FSN_OK;
}

fsn_status soem_take_interfaces(struct fsn_soem *bus, struct fsn_fault *fault) {
    FSN_TRY(fsn_port_listen(bus->interface, LISTEN_NS, fault));
    if (bus->redundant[0] != '\0') {
        FSN_TRY(fsn_port_listen(bus->redundant, LISTEN_NS, fault));
    }
    return fsn_port_lock(bus->interface, &bus->lock, fault);
}

/** Opens the sockets of the cycle before those of SOEM: the kernel delivers a packet to the first
 *  socket last, and that one needs no copy of it. */
static fsn_status open_ports(struct fsn_soem *bus, struct fsn_fault *fault) {
    const char *interface[FSN_WIRE_PORTS] = {bus->interface, bus->redundant};
    const bool stamp = bus->wait_ns == 0;
    for (size_t i = 0; i < FSN_WIRE_PORTS && interface[i][0] != '\0'; i++) {
        if (bus->xdp) {
            FSN_TRY(soem_xdp_open(interface[i], bus->tag, &bus->rings[i], fault));
            bus->sockets[i] = bus->rings[i]->fd;
        } else {
            FSN_TRY(fsn_port_open(interface[i], bus->tag, stamp, &bus->sockets[i], fault));
        }
        FSN_TRY(fsn_port_open_foreign(interface[i], bus->tag, &bus->foreign[i], fault));
    }
    return FSN_OK;
}

static fsn_status make_wire(struct fsn_soem *bus, struct fsn_fault *fault) {
    if (!bus->attached) {
        FSN_TRY(soem_start_clocks(bus, fault));
    }
    const fsn_status status =
        fsn_frames_create(bus->all.plan, bus->dc_station, bus->dc_host, &bus->frames);
    if (status != FSN_OK) {
        return fsn_refuse_all(fault, status,
                              "the process data does not fit the frames: at most 1466 bytes per "
                              "sync manager, at most 64 frames");
    }
    struct fsn_wire *wire = &bus->frames.wire;
    fsn_frames_sign(&bus->frames, bus->tag);
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    wire->run = (uint32_t)now.tv_nsec ^ ((uint32_t)now.tv_sec << 16) ^ (uint32_t)getpid();
    bus->ring = (struct fsn_ring_watch){0};
    bus->links_kept = false;
    wire->wait_ns = bus->wait_ns;
    wire->dc_every = bus->dc_every;
    wire->dc_host = bus->dc_host;
    atomic_store(&wire->dc_base, bus->dc_base);
    memcpy(wire->sockets, bus->sockets, sizeof wire->sockets);
    memcpy(wire->rings, bus->rings, sizeof wire->rings);
    return FSN_OK;
}

static fsn_status configure(void *bus, struct fsn_node *known) {
    struct node *node = (struct node *)known;
    return node->group == FSN_NONE ? soem_configure(bus, node) : FSN_OK;
}

static fsn_status compare(void *bus, struct fsn_node *node) {
    return soem_compare(bus, (struct node *)node);
}

/** Creates nodes and groups of the plan. */
static fsn_status make_nodes(struct fsn_soem *bus, const struct fsn_plan *plan,
                             struct fsn_fault *fault) {
    bus->nodes = fsn_nodes_create(&bus->all, plan, sizeof *bus->nodes);
    if (bus->nodes == NULL || !soem_make_groups(bus)) {
        return fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
    }
    if (bus->group_count > 0 && (bus->attach != NULL || bus->redundant[0] != '\0')) {
        return fsn_refuse_all(fault, FSN_E_ARG,
                              "groups that may be absent go with one interface, and with a bus "
                              "that is started");
    }
    return FSN_OK;
}

/** At a take-over the ring is already in OP: interfaces and states stay as the predecessor left
 *  them. */
static fsn_status open_steps(struct fsn_soem *bus, const struct fsn_plan *plan,
                             struct fsn_fault *fault) {
    FSN_TRY(make_nodes(bus, plan, fault));
    if (!bus->attached) {
        FSN_TRY(soem_take_interfaces(bus, fault));
    }
    FSN_TRY(open_ports(bus, fault));
    FSN_TRY(soem_open_nic(bus, fault));
    FSN_TRY((bus->attached ? soem_restore : soem_find)(bus, fault));
    FSN_TRY(make_wire(bus, fault));
    FSN_TRY(soem_place_groups(bus, fault));
    return fsn_nodes_check(&bus->all, bus, bus->attached ? compare : configure, fault);
}

static fsn_status soem_open(void *context, const struct fsn_plan *plan,
                            struct fsn_bus_layout *layout, struct fsn_fault *fault) {
    struct fsn_soem *bus = context;
    /* Half a cycle: SYNC0 is then farthest from both the arrival and the departure of frames. */
    bus->cycle_ns = fsn_live_cycle_ns(bus->cycle_ns, plan);
    if (bus->clocks.shift_ns == 0) {
        bus->clocks.shift_ns = (uint32_t)(bus->cycle_ns / 2);
    }
    bus->attached = bus->attach != NULL;
    const fsn_status status = open_steps(bus, plan, fault);
    /* Used once: a later restart opens the bus from the beginning. */
    bus->attach = NULL;
    if (status != FSN_OK) {
        soem_release(bus);
        return status;
    }
    *layout = fsn_image_layout(&bus->frames.image, bus->frames.bytes);
    /* The offset exists only when the bus has a reference clock. */
    layout->dc_base_ns = bus->dc_host && bus->dc_station != 0 ? bus->dc_base : 0;
    return FSN_OK;
}

static void soem_close(void *context) {
    struct fsn_soem *bus = context;
    if (bus->attached && bus->frames.wire.cycle == 0) {
        soem_release(bus); /* it was never ours */
        return;
    }
    /* SubDevices in a higher state are set back step by step, without waiting for their answers. */
    static const uint8_t states[] = {FSN_AL_SAFEOP, FSN_AL_PREOP, FSN_AL_INIT};
    for (size_t i = 0; i < sizeof states; i++) {
        bus->slaves[0].state = states[i];
        ecx_writestate(&bus->context, 0);
        ecx_statecheck(&bus->context, 0, states[i], 20000);
    }
    soem_release(bus);
}

static void soem_receive(void *context, struct fsn_bus_input *input) {
    struct fsn_soem *bus = context;
    fsn_wire_receive(&bus->frames.wire, input);
}

static void soem_send(void *context) {
    struct fsn_soem *bus = context;
    fsn_wire_send(&bus->frames.wire);
}

const struct fsn_backend *fsn_backend_soem(void) {
    static const struct fsn_bus_ops ops = {
        .name = "soem",
        .open = soem_open,
        .receive = soem_receive,
        .send = soem_send,
        .close = soem_close,
        .poll = soem_poll,
        .state = fsn_nodes_state,
        .ring = soem_ring,
        .clocks = soem_clocks,
        .acyclic = &soem_acyclic,
        .describe = soem_describe,
        .discard = soem_discard,
    };
    static const struct fsn_backend backend = {
        .name = "soem",
        .about = "SOEM 1.4, Simple Open EtherCAT Master, Copyright (C) Speciaal Machinefabriek "
                 "Ketels v.o.f. and rt-labs AB: GNU General Public License version 2 with an "
                 "exception for linking.\n"
                 "EtherCAT is a registered trademark and patented technology, licensed by Beckhoff "
                 "Automation GmbH, Germany; to use a MainDevice you need the free licence of the "
                 "EtherCAT Technology Group.",
        .ops = &ops,
        .needs_interface = true,
        .takes_redundant = true,
        .takes_xdp = true,
        .create = soem_create,
        .reach = fsn_port_reach,
        .free = soem_free,
    };
    return &backend;
}
