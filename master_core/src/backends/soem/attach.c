/** A bus that another process has brought to OP: described by that process, attached to by the next
 *  one. */
#define _GNU_SOURCE

#include "backends/soem/soem.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>

#include "live/port.h"

/** State passed from one process to the next. Both must have the same SOEM version, otherwise it is
 *  rejected. */
struct description {
    uint32_t slave_bytes, slave_count;
    uint32_t dc_station, dc_every;
    uint64_t dc_base;
    char redundant[SOEM_NAME_BYTES];
    ec_slavet slaves[]; /**< slave_count plus one */
};

static size_t bytes_of(size_t slaves) {
    return sizeof(struct description) + (slaves + 1) * sizeof(ec_slavet);
}

static void hold(struct fsn_bus_attachment *attachment, int fd) {
    if (fd >= 0) {
        attachment->held[attachment->held_count++] = fd;
    }
}

fsn_status soem_describe(void *context, struct fsn_bus_attachment *attachment) {
    struct fsn_soem *bus = context;
    if (bus->xdp) {
        return FSN_E_STATE; /* its program and its queue are of one process */
    }
    const size_t slaves = (size_t)bus->slave_count;
    struct description *d = calloc(1, bytes_of(slaves));
    if (d == NULL) {
        return FSN_E_NOMEM;
    }
    d->slave_bytes = sizeof(ec_slavet);
    d->slave_count = (uint32_t)slaves;
    const struct fsn_wire *wire = &bus->frames.wire;
    d->dc_station = atomic_load(&wire->dc_station);
    d->dc_every = wire->dc_every;
    d->dc_base = atomic_load(&wire->dc_base);
    memcpy(d->redundant, bus->redundant, sizeof d->redundant);
    memcpy(d->slaves, bus->slaves, (slaves + 1) * sizeof(ec_slavet));
    free(bus->described);
    bus->described = d;
    *attachment =
        (struct fsn_bus_attachment){.bytes = d, .len_bytes = bytes_of(slaves), .lock = bus->lock};
    hold(attachment, bus->port.sockhandle);
    if (bus->redundant[0] != '\0') {
        hold(attachment, bus->redundant_port.sockhandle);
    }
    for (size_t i = 0; i < FSN_WIRE_PORTS; i++) {
        hold(attachment, bus->sockets[i]);
        hold(attachment, bus->foreign[i]);
    }
    return FSN_OK;
}

void soem_discard(void *context) {
    struct fsn_soem *bus = context;
    for (size_t i = 0; i < FSN_WIRE_PORTS; i++) {
        fsn_port_discard(bus->sockets[i]);
    }
}

/** Assigns each node of the plan the SubDevice at its place, as read by the predecessor. */
static fsn_status match(struct fsn_soem *bus, struct fsn_fault *fault) {
    char detail[FSN_DETAIL_BYTES];
    for (int s = 0; s <= bus->slave_count; s++) {
        bus->places[s] = (struct place){.node = SOEM_NO_NODE, .al_status = FSN_AL_OP};
    }
    for (uint32_t n = 0; n < bus->all.count; n++) {
        struct node *node = &bus->nodes[n];
        node->slave = soem_slave_of(bus, &node->known.info);
        const ec_slavet *s = &bus->slaves[node->slave];
        if (node->slave == 0) {
            soem_note(bus, node, FSN_FOUND_NOTHING, "the running bus has %d SubDevices",
                      bus->slave_count);
            return fsn_node_refuse(fault, FSN_E_BUS_MISSING, &node->known);
        }
        bus->places[node->slave].node = (int)n;
        if (!fsn_node_note_identity(&bus->all, &node->known, s->eep_man, s->eep_id, s->eep_rev,
                                    detail)) {
            soem_note(bus, node, FSN_FOUND_IDENTITY, "%s", detail);
            return fsn_node_refuse(fault, FSN_E_BUS_IDENTITY, &node->known);
        }
    }
    return FSN_OK;
}

fsn_status soem_restore(struct fsn_soem *bus, struct fsn_fault *fault) {
    const struct description *d = bus->attach->bytes;
    uint16_t found = 0;
    if (bus->attach->len_bytes < sizeof *d || d->slave_bytes != sizeof(ec_slavet) ||
        d->slave_count >= SOEM_MOST_SLAVES || bus->attach->len_bytes != bytes_of(d->slave_count)) {
        return fsn_refuse_all(fault, FSN_E_STATE,
                              "the running process was built with another SOEM; stop it and start "
                              "this one");
    }
    if (strncmp(d->redundant, bus->redundant, sizeof d->redundant) != 0) {
        return fsn_refuse_all(fault, FSN_E_STATE,
                              "the running process has another --redundant; the ring is opened "
                              "when the bus is started");
    }
    bus->lock = fcntl(bus->attach->lock, F_DUPFD_CLOEXEC, 0);
    if (bus->lock < 0) {
        return fsn_refuse_all(fault, FSN_E_SYS, "the lock of the interface was not handed over");
    }
    bus->slave_count = (int)d->slave_count;
    bus->dc_station = (uint16_t)d->dc_station;
    bus->dc_every = d->dc_every;
    bus->dc_base = d->dc_base;
    memcpy(bus->slaves, d->slaves, (d->slave_count + 1) * sizeof(ec_slavet));
    soem_drain(bus);
    if (ecx_BRD(bus->context.port, 0, ECT_REG_TYPE, sizeof found, &found, EC_TIMEOUTSAFE) !=
        bus->slave_count) {
        return fsn_refuse_all(fault, FSN_E_BUS_MISSING, "not every SubDevice answers");
    }
    return match(bus, fault);
}

bool soem_read_surely(struct fsn_soem *bus, uint16_t slave, uint16_t address, void *to,
                      uint16_t size_bytes) {
    for (int tries = 0; tries < 10; tries++) { /* of 6 ms each */
        soem_drain(bus);
        if (ecx_FPRD(bus->context.port, bus->slaves[slave].configadr, address, size_bytes, to,
                     EC_TIMEOUTRET3) == 1) {
            return true;
        }
    }
    return false;
}

fsn_status soem_compare(struct fsn_soem *bus, struct node *node) {
    ec_alstatust al = {0};
    if (!soem_read_surely(bus, node->slave, ECT_REG_ALSTAT, &al, sizeof al) ||
        etohs(al.alstatus) != FSN_AL_OP) {
        node->known.seen.al_status = (uint8_t)etohs(al.alstatus);
        soem_note(bus, node, FSN_FOUND_STATE, "it is not in OP: AL status 0x%02x",
                  etohs(al.alstatus));
        return FSN_E_BUS_STATE;
    }
    FSN_TRY(soem_compare_layout(bus, node));
    node->known.seen.al_status = FSN_AL_OP;
    node->configured = true;
    atomic_store(&bus->frames.wire.answers[node->known.number], 1);
    soem_note(bus, node, FSN_FOUND_RIGHT, "%s", "");
    return FSN_OK;
}
