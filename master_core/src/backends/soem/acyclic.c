/** Objects, SII and registers of any ring position, next to the cycle. */
#include "backends/soem/soem.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "live/port.h"
#include "live/sdo.h"

enum {
    VISIT_PREOP_MS = 3000, /**< for all of them together */
    LEAST_MS = 20,         /**< for each one, whatever time the others took */
    REG_DL = 0x0110,
    REG_ERRORS = 0x0300,
    ERROR_BYTES = 20,
    LINK_LOST = 0x10, /**< from 0x0300 on */
    REG_SII_STATUS = 0x0502,
    SII_TROUBLE = 0xF800, /**< busy, or an error */
    STATE_BITS = 0x0F,
};

/** Context of the mailbox of one SubDevice. */
struct whose {
    struct fsn_soem *bus;
    uint16_t slave;
};

static bool is_there(const struct fsn_soem *bus, uint32_t position) {
    return position < (uint32_t)bus->slave_count && bus->places[position + 1].al_status != 0;
}

static bool read_registers(struct fsn_soem *bus, uint16_t slave, uint16_t address, void *data,
                           uint16_t size) {
    soem_drain(bus);
    memset(data, 0, size);
    return ecx_FPRD(bus->context.port, bus->slaves[slave].configadr, address, size, data,
                    EC_TIMEOUTRET3) == 1;
}

/* -- members -------------------------------------------------------------------------------- */

static uint32_t soem_count(void *context) {
    const struct fsn_soem *bus = context;
    return (uint32_t)bus->slave_count;
}

static uint32_t soem_place(void *context, uint32_t subdevice) {
    const struct fsn_soem *bus = context;
    if (subdevice >= bus->all.count || bus->nodes[subdevice].slave == 0) {
        return FSN_NONE;
    }
    return bus->nodes[subdevice].slave - 1u;
}

/** Its ports, from 0x0007: two bits each; 2 and 3 mean that the port is usable. */
static uint8_t ports_of(uint8_t types) {
    uint8_t ports = 0;
    for (unsigned port = 0; port < FSN_PORTS; port++) {
        ports = (uint8_t)(ports | ((types >> (2 * port) & 3) >= 2) << port);
    }
    return ports;
}

static void fill_known(const struct fsn_soem *bus, uint16_t slave, struct fsn_bus_member *m) {
    const ec_slavet *s = &bus->slaves[slave];
    const int node = bus->places[slave].node;
    *m = (struct fsn_bus_member){
        .subdevice = node == SOEM_NO_NODE ? FSN_NONE : bus->nodes[node].known.number,
        .vendor_id = s->eep_man,
        .product_code = s->eep_id,
        .revision = s->eep_rev,
        .station = s->configadr,
        .alias = s->aliasadr,
        .mailbox = s->mbx_l > 0 ? (uint16_t)(s->mbx_proto & 0x3F) : 0,
        .has_dc = s->hasdc != 0,
        .ports = ports_of(s->ptype),
    };
    snprintf(m->name, sizeof m->name, "%.*s", (int)sizeof m->name - 1, s->name);
}

static fsn_status soem_member(void *context, uint32_t position, struct fsn_bus_member *m) {
    struct fsn_soem *bus = context;
    if (position >= (uint32_t)bus->slave_count) {
        return FSN_E_ARG;
    }
    const uint16_t slave = (uint16_t)(position + 1);
    uint8_t al[6], links[2], errors[ERROR_BYTES];
    fill_known(bus, slave, m);
    if (!read_registers(bus, slave, ECT_REG_ALSTAT, al, sizeof al)) {
        return FSN_E_BUS_MISSING;
    }
    m->al_status = al[0];
    m->al_code = fsn_get16(al + 4);
    if (!read_registers(bus, slave, REG_DL, links, sizeof links) ||
        !read_registers(bus, slave, REG_ERRORS, errors, sizeof errors)) {
        return FSN_E_BUS_MISSING;
    }
    m->errors_known = true;
    for (unsigned port = 0; port < FSN_PORTS; port++) {
        /* Communication on the port, from the odd bits of 0x0111. */
        m->link[port] = (links[1] >> (2 * port + 1) & 1) != 0;
        m->rx_errors[port] = errors[2 * port];
        m->link_lost[port] = errors[LINK_LOST + port];
    }
    return FSN_OK;
}

/* -- objects -------------------------------------------------------------------------------- */

static uint8_t next_counter(void *context) {
    const struct whose *w = context;
    ec_slavet *s = &w->bus->slaves[w->slave];
    s->mbx_cnt = (uint8)(s->mbx_cnt % 7 + 1);
    return s->mbx_cnt;
}

static bool mailbox_send(void *context, const uint8_t *message) {
    const struct whose *w = context;
    ec_mbxbuft old;
    soem_drain(w->bus);
    (void)ecx_mbxreceive(&w->bus->context, w->slave, &old, 0); /* an outdated answer */
    return ecx_mbxsend(&w->bus->context, w->slave, (ec_mbxbuft *)(uintptr_t)message,
                       EC_TIMEOUTTXM) > 0;
}

static bool mailbox_receive(void *context, uint8_t *message) {
    const struct whose *w = context;
    return ecx_mbxreceive(&w->bus->context, w->slave, (ec_mbxbuft *)message, EC_TIMEOUTRXM) > 0;
}

typedef fsn_status (*sdo_fn)(const struct fsn_mailbox *mailbox, struct fsn_transfer *transfer);

/** One transfer with a SubDevice that has a mailbox. SOEM's own SDO transfers trust the lengths
 *  that a SubDevice states. */
static fsn_status transfer_by_mailbox(struct fsn_soem *bus, struct fsn_transfer *transfer,
                                      sdo_fn transfer_it) {
    const uint16_t slave = (uint16_t)(transfer->position + 1);
    struct whose whose = {bus, slave};
    const struct fsn_mailbox mailbox = {
        .context = &whose,
        .in_bytes = bus->slaves[slave].mbx_rl,
        .out_bytes = bus->slaves[slave].mbx_l,
        .next_counter = next_counter,
        .send = mailbox_send,
        .receive = mailbox_receive,
    };
    const fsn_status status = transfer_it(&mailbox, transfer);
    ec_errort error;
    while (ecx_poperror(&bus->context, &error)) { /* emergencies and the like: not used */
    }
    return status;
}

static fsn_status upload_by_mailbox(void *context, struct fsn_transfer *transfer) {
    return transfer_by_mailbox(context, transfer, fsn_sdo_upload);
}

static fsn_status download_by_mailbox(void *context, struct fsn_transfer *transfer) {
    return transfer_by_mailbox(context, transfer, fsn_sdo_download);
}

struct fsn_objects soem_objects(struct fsn_soem *bus, uint16_t slave) {
    return (struct fsn_objects){.bus = bus,
                                .position = slave - 1u,
                                .upload = upload_by_mailbox,
                                .download = download_by_mailbox};
}

static fsn_status transfer_object(struct fsn_soem *bus, struct fsn_transfer *transfer,
                                  sdo_fn transfer_it) {
    if (!is_there(bus, transfer->position)) {
        return FSN_E_BUS_MISSING;
    }
    const uint16_t slave = (uint16_t)(transfer->position + 1);
    const uint8_t state = bus->places[slave].al_status & STATE_BITS;
    if (!soem_has_coe(bus, slave)) {
        return FSN_E_ABSENT;
    }
    return state == FSN_AL_INIT || state == FSN_AL_BOOT
               ? FSN_E_BUS_STATE
               : transfer_by_mailbox(bus, transfer, transfer_it);
}

static fsn_status soem_upload_object(void *context, struct fsn_transfer *transfer) {
    return transfer_object(context, transfer, fsn_sdo_upload);
}

static fsn_status soem_download_object(void *context, struct fsn_transfer *transfer) {
    return transfer_object(context, transfer, fsn_sdo_download);
}

/* -- SII ------------------------------------------------------------------------------------ */

static bool sii_is_fine(struct fsn_soem *bus, uint16_t slave) {
    uint8_t status[2];
    return read_registers(bus, slave, REG_SII_STATUS, status, sizeof status) &&
           (fsn_get16(status) & SII_TROUBLE) == 0;
}

static fsn_status soem_sii_read(void *context, uint32_t position, uint32_t offset, uint8_t *data,
                                uint32_t size_bytes) {
    struct fsn_soem *bus = context;
    if (!is_there(bus, position)) {
        return FSN_E_BUS_MISSING;
    }
    const uint16_t slave = (uint16_t)(position + 1);
    const ec_slavet *s = &bus->slaves[slave];
    const uint32_t step = s->eep_8byte ? 8 : 4;
    const bool was_of_device = s->eep_pdi != 0;
    soem_drain(bus);
    ecx_eeprom2master(&bus->context, slave);
    bool ok = true;
    for (uint32_t at = 0; ok && at < size_bytes; at += step) {
        const uint64 value = ecx_readeepromFP(&bus->context, s->configadr,
                                              (uint16)((offset + at) / 2), EC_TIMEOUTEEP);
        for (uint32_t i = 0; i < step; i++) {
            data[at + i] = (uint8_t)(value >> (8 * i));
        }
        ok = value != 0 || sii_is_fine(bus, slave); /* 0 also means no answer */
    }
    if (was_of_device) {
        ecx_eeprom2pdi(&bus->context, slave);
    }
    return ok ? FSN_OK : FSN_E_BUS_MISSING;
}

static fsn_status soem_sii_write(void *context, uint32_t position, uint32_t offset, uint16_t word) {
    struct fsn_soem *bus = context;
    if (!is_there(bus, position)) {
        return FSN_E_BUS_MISSING;
    }
    const uint16_t slave = (uint16_t)(position + 1);
    const bool was_of_device = bus->slaves[slave].eep_pdi != 0;
    soem_drain(bus);
    const bool ok =
        ecx_writeeeprom(&bus->context, slave, (uint16)(offset / 2), word, EC_TIMEOUTEEP) > 0 &&
        sii_is_fine(bus, slave);
    if (was_of_device) {
        ecx_eeprom2pdi(&bus->context, slave);
    }
    return ok ? FSN_OK : FSN_E_BUS_STATE;
}

/* -- without a plan ------------------------------------------------------------------------- */

/** Requests PREOP of all; the AL status shows which ones do not reach it. */
static void reach_preop(struct fsn_soem *bus) {
    unsigned left_ms = VISIT_PREOP_MS;
    for (int s = 1; s <= bus->slave_count; s++) {
        const uint16_t slave = (uint16_t)s;
        unsigned most_ms = left_ms > LEAST_MS ? left_ms : LEAST_MS;
        if (!soem_reach(bus, slave, FSN_AL_PREOP, most_ms)) {
            left_ms = 0;
        }
        uint8_t al[6];
        (void)read_registers(bus, slave, ECT_REG_ALSTAT, al, sizeof al);
        bus->places[slave].al_status = al[0];
        bus->places[slave].al_code = fsn_get16(al + 4);
    }
}

static fsn_status soem_visit(void *context, bool *states_changed, struct fsn_fault *fault) {
    struct fsn_soem *bus = context;
    free(bus->nodes);
    bus->nodes = NULL;
    bus->all.count = 0;
    *states_changed = false;
    fsn_status status = soem_take_interfaces(bus, fault);
    if (status == FSN_OK) {
        status = soem_open_nic(bus, fault);
    }
    if (status == FSN_OK) {
        *states_changed = true; /* SOEM brings all to INIT before it requests a higher state */
        status = soem_find(bus, fault);
    }
    if (status != FSN_OK) {
        soem_release(bus);
        return status;
    }
    reach_preop(bus);
    return FSN_OK;
}

const struct fsn_bus_acyclic soem_acyclic = {
    .visit = soem_visit,
    .quit = soem_release,
    .count = soem_count,
    .place = soem_place,
    .member = soem_member,
    .upload = soem_upload_object,
    .download = soem_download_object,
    .sii_read = soem_sii_read,
    .sii_write = soem_sii_write,
};
