/** Objects of any ring position through IgH, next to the cycle. ecrt.h gives no access to SII or
 *  registers of a SubDevice without a configuration; the command `ethercat` does. */
#define _POSIX_C_SOURCE 200809L

#include "backends/igh/igh.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_TRIES = 100, MOST_RING = 65535 };

static uint32_t igh_count(void *context) {
    const struct fsn_igh *bus = context;
    ec_master_info_t master = {0};
    if (ecrt_master(bus->master, &master) != 0) {
        return 0;
    }
    return master.slave_count < MOST_RING ? master.slave_count : MOST_RING;
}

static uint32_t igh_place(void *context, uint32_t subdevice) {
    const struct fsn_igh *bus = context;
    if (subdevice >= bus->all.count || bus->nodes[subdevice].known.seen.al_status == FSN_AL_NONE) {
        return FSN_NONE;
    }
    return bus->nodes[subdevice].ring;
}

/** The node of the plan at a position. */
static struct igh_node *node_at(const struct fsn_igh *bus, uint32_t position) {
    for (uint32_t n = 0; n < bus->all.count; n++) {
        if (bus->nodes[n].ring == position && bus->nodes[n].known.seen.al_status != FSN_AL_NONE) {
            return &bus->nodes[n];
        }
    }
    return NULL;
}

static fsn_status igh_member(void *context, uint32_t position, struct fsn_bus_member *m) {
    struct fsn_igh *bus = context;
    const struct igh_node *node = node_at(bus, position);
    ec_slave_info_t slave = {0};
    *m = (struct fsn_bus_member){.subdevice = node != NULL ? node->known.number : FSN_NONE};
    if (!igh_slave(bus, (uint16_t)position, &slave)) {
        return FSN_E_BUS_MISSING;
    }
    m->vendor_id = slave.vendor_id;
    m->product_code = slave.product_code;
    m->revision = slave.revision_number;
    m->serial = slave.serial_number;
    m->alias = slave.alias;
    m->station = (uint16_t)(position + 1); /* as numbered by IgH */
    m->al_status = (uint8_t)(slave.al_state | (slave.error_flag != 0 ? FSN_AL_ERROR : 0));
    /* IgH does not report protocols. A SubDevice without CoE reports this in its answer. */
    m->mailbox = FSN_MAILBOX_COE;
    m->ports = 0x0F;
    m->errors_known = node != NULL && node->request != NULL;
    snprintf(m->name, sizeof m->name, "%.*s", (int)sizeof m->name - 1, slave.name);
    for (unsigned port = 0; port < FSN_PORTS; port++) {
        m->link[port] = slave.ports[port].link.link_up;
        m->link_lost[port] = m->errors_known ? node->known.seen.link_lost[port] : 0;
        m->rx_errors[port] = m->errors_known ? node->known.seen.rx_errors[port] : 0;
    }
    m->al_code = node != NULL ? node->known.seen.al_code : 0;
    return FSN_OK;
}

static fsn_status result_of(int result, uint32_t abort_code) {
    if (result == 0) {
        return FSN_OK;
    }
    if (abort_code != 0) {
        return FSN_E_BUS_SDO;
    }
    switch (-result) {
    case ENOBUFS:
    case EOVERFLOW:
        return FSN_E_SPACE;
    case EPROTONOSUPPORT:
    case EOPNOTSUPP:
        return FSN_E_ABSENT;
    case EPROTO:
    case EBADMSG:
        return FSN_E_BUS_STATE;
    case EINVAL: /* IgH has no SubDevice at this position */
        return FSN_E_BUS_MISSING;
    default:
        return FSN_E_BUS_MAILBOX;
    }
}

static fsn_status igh_upload_object(void *context, struct fsn_transfer *t) {
    struct fsn_igh *bus = context;
    size_t size = 0;
    int result = -EINTR;
    t->abort_code = 0;
    IGH_CALL(result, MOST_TRIES,
             ecrt_master_sdo_upload(bus->master, (uint16_t)t->position, t->index, t->sub, t->data,
                                    t->size_bytes, &size, &t->abort_code));
    if (result == 0) {
        t->size_bytes = size < t->size_bytes ? (uint32_t)size : t->size_bytes;
    }
    return result_of(result, t->abort_code);
}

static fsn_status igh_download_object(void *context, struct fsn_transfer *t) {
    struct fsn_igh *bus = context;
    int result = -EINTR;
    t->abort_code = 0;
    IGH_CALL(result, MOST_TRIES,
             ecrt_master_sdo_download(bus->master, (uint16_t)t->position, t->index, t->sub, t->data,
                                      t->size_bytes, &t->abort_code));
    return result_of(result, t->abort_code);
}

static fsn_status igh_pdo(void *context, uint32_t position, uint8_t sm, uint32_t number,
                          uint16_t *index, bool *output, uint32_t *entries, uint32_t room,
                          uint32_t *count) {
    struct fsn_igh *bus = context;
    ec_sync_info_t sync = {0};
    ec_pdo_info_t pdo = {0};
    const uint16_t ring = (uint16_t)position;
    if (ecrt_master_get_sync_manager(bus->master, ring, sm, &sync) != 0 || number >= sync.n_pdos ||
        ecrt_master_get_pdo(bus->master, ring, sm, (uint16_t)number, &pdo) != 0) {
        return FSN_E_ARG;
    }
    *index = pdo.index;
    *output = sync.dir == EC_DIR_OUTPUT;
    *count = 0;
    for (unsigned e = 0; e < pdo.n_entries && *count < room; e++) {
        ec_pdo_entry_info_t entry = {0};
        if (ecrt_master_get_pdo_entry(bus->master, ring, sm, (uint16_t)number, (uint16_t)e,
                                      &entry) != 0) {
            break;
        }
        entries[(*count)++] =
            (uint32_t)entry.index << 16 | (uint32_t)entry.subindex << 8 | entry.bit_length;
    }
    return FSN_OK;
}

/** An idle master has already brought all to PREOP. */
static fsn_status igh_visit(void *context, bool *states_changed, struct fsn_fault *fault) {
    struct fsn_igh *bus = context;
    free(bus->nodes);
    bus->nodes = NULL;
    bus->all.count = 0;
    *states_changed = false;
    bus->master = ecrt_open_master(bus->index);
    if (bus->master == NULL) {
        return igh_refuse_call(fault, errno,
                               "no master of that number: is the module ec_master loaded, and may "
                               "this user open its device, /dev/EtherCAT0 and so on?");
    }
    const fsn_status status = igh_find(bus, fault);
    if (status != FSN_OK) {
        igh_release(bus);
    }
    return status;
}

const struct fsn_bus_acyclic igh_acyclic = {
    .visit = igh_visit,
    .quit = igh_release,
    .count = igh_count,
    .place = igh_place,
    .member = igh_member,
    .upload = igh_upload_object,
    .download = igh_download_object,
    .pdo = igh_pdo,
};
