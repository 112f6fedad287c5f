/** Devices at the positions. */
#include "backends/soem/soem.h"

#include <stdio.h>
#include <string.h>

#include "live/port.h"

enum { PREOP_MS = 3000, AL_CODE_MAILBOX = 0x0016 };

uint16_t soem_slave_of(const struct fsn_soem *bus, const struct fsn_subdevice_info *info) {
    uint32_t at = info->position;
    if (info->alias != 0) {
        uint32_t first = 1;
        while (first <= (uint32_t)bus->slave_count && bus->slaves[first].aliasadr != info->alias) {
            first++;
        }
        at += first - 1;
    }
    return at < (uint32_t)bus->slave_count ? (uint16_t)(at + 1) : 0;
}

/** Vendor, product and revision at a position, from its SII. */
struct identity {
    uint32_t vendor, product, revision;
};

static uint16_t position_address(uint16_t slave) {
    return (uint16_t)(1 - slave);
}

static uint32_t read_sii(struct fsn_soem *bus, uint16_t slave, uint16_t word) {
    soem_drain(bus);
    return etohl(
        (uint32_t)ecx_readeepromAP(&bus->context, position_address(slave), word, EC_TIMEOUTEEP));
}

static struct identity read_identity(struct fsn_soem *bus, uint16_t slave) {
    const uint8 to_master = 2;
    const uint8 given = 0;
    const uint16_t at = position_address(slave);
    (void)ecx_APWR(bus->context.port, at, ECT_REG_EEPCFG, 1, (void *)(uintptr_t)&to_master,
                   EC_TIMEOUTRET);
    (void)ecx_APWR(bus->context.port, at, ECT_REG_EEPCFG, 1, (void *)(uintptr_t)&given,
                   EC_TIMEOUTRET);
    return (struct identity){.vendor = read_sii(bus, slave, ECT_SII_MANUF),
                             .product = read_sii(bus, slave, ECT_SII_ID),
                             .revision = read_sii(bus, slave, ECT_SII_REV)};
}

/** Stores the device at a place. Values that could not be read are zero in any of the three: a
 *  device counts as a different one only if a second search confirms it. */
static fsn_status note_who_answers(struct fsn_soem *bus, struct node *node, uint16_t slave,
                                   struct identity found) {
    char detail[FSN_DETAIL_BYTES];
    if (fsn_node_note_identity(&bus->all, &node->known, found.vendor, found.product, found.revision,
                               detail)) {
        soem_note(bus, node, FSN_FOUND_RIGHT, "%s", "");
        return FSN_OK;
    }
    const struct identity again = read_identity(bus, slave);
    if (found.vendor != 0 && found.product != 0 && memcmp(&found, &again, sizeof found) == 0) {
        soem_note(bus, node, FSN_FOUND_IDENTITY, "%s", detail);
        return FSN_E_BUS_IDENTITY;
    }
    soem_note(bus, node, FSN_FOUND_UNKNOWN,
              "its SII could not be read (frames lost or late), or is empty: vendor 0x%08x "
              "product 0x%08x",
              (unsigned)found.vendor, (unsigned)found.product);
    return FSN_E_BUS_STATE;
}

static fsn_status nobody(const struct fsn_soem *bus, struct fsn_fault *fault) {
    const int error = fsn_port_try(bus->interface);
    char linked[SOEM_LINKS_BYTES];
    const bool any = soem_links(bus, linked);
    if (error != 0 && fsn_port_has_link(bus->interface)) {
        fsn_live_refuse(fault, FSN_E_BUS_SILENT, NULL, "frames cannot be sent on %s: %s",
                        bus->interface, strerror(error));
    } else {
        fsn_live_refuse(fault, FSN_E_BUS_SILENT, NULL, "%s%s", linked,
                        any ? ", but no EtherCAT SubDevice answers on it"
                            : ": cable, power of the SubDevices, `ip link set ... up`");
    }
    if (fault != NULL) {
        fault->link_down = !any;
    }
    return FSN_E_BUS_SILENT;
}

/** Assigns each node the device at its place. */
static fsn_status match(struct fsn_soem *bus, struct fsn_fault *fault) {
    fsn_status first = FSN_OK;
    for (uint32_t n = 0; n < bus->all.count; n++) {
        struct node *node = &bus->nodes[n];
        fsn_status status = FSN_OK;
        if (node->group != FSN_NONE) {
            continue; /* it may be attached later */
        }
        node->slave = soem_slave_of(bus, &node->known.info);
        if (node->slave == 0) {
            soem_note(bus, node, FSN_FOUND_NOTHING, "alias %u, position %u: %d SubDevices answer",
                      node->known.info.alias, node->known.info.position, bus->slave_count);
            status = FSN_E_BUS_MISSING;
        } else {
            const ec_slavet *s = &bus->slaves[node->slave];
            const struct identity found = {s->eep_man, s->eep_id, s->eep_rev};
            bus->places[node->slave].node = (int)n;
            node->known.seen.al_status = FSN_AL_INIT; /* SOEM has brought all to this state */
            status = note_who_answers(bus, node, node->slave, found);
        }
        if (status != FSN_OK && first == FSN_OK) {
            first = fsn_node_refuse(fault, status, &node->known);
        }
    }
    return first;
}

/** Again if it refuses because the frames that set up its mailbox were lost or late. */
static bool reach_preop(struct fsn_soem *bus, uint16_t slave) {
    if (soem_reach(bus, slave, FSN_AL_PREOP, PREOP_MS)) {
        return true;
    }
    const ec_slavet *s = &bus->slaves[slave];
    if ((s->state & EC_STATE_ERROR) == 0 || s->ALstatuscode != AL_CODE_MAILBOX) {
        return false;
    }
    soem_drain(bus);
    soem_prepare_mailbox(bus, slave);
    return soem_reach(bus, slave, FSN_AL_PREOP, PREOP_MS);
}

fsn_status soem_find(struct fsn_soem *bus, struct fsn_fault *fault) {
    const int found = ecx_config_init(&bus->context, FALSE);
    if (found == EC_SLAVECOUNTEXCEEDED) {
        return fsn_refuse_all(fault, FSN_E_BUS_IMAGE, "more than 512 SubDevices are on the bus");
    }
    if (found <= 0) {
        return nobody(bus, fault);
    }
    soem_set_groups_apart(bus);
    for (int s = 0; s <= bus->slave_count; s++) {
        bus->places[s] = (struct place){.node = SOEM_NO_NODE, .had = bus->slaves[s].activeports};
    }
    FSN_TRY(match(bus, fault));
    for (uint32_t n = 0; n < bus->all.count; n++) {
        struct node *node = &bus->nodes[n];
        if (node->group == FSN_NONE && !reach_preop(bus, node->slave)) {
            const ec_slavet *s = &bus->slaves[node->slave];
            node->known.seen.al_status = (uint8_t)s->state;
            node->known.seen.al_code = s->ALstatuscode;
            if (s->state == 0) {
                soem_note(bus, node, FSN_FOUND_NOTHING, "it was there a moment ago");
                return fsn_node_refuse(fault, FSN_E_BUS_MISSING, &node->known);
            }
            if ((s->state & EC_STATE_ERROR) == 0) {
                soem_note(bus, node, FSN_FOUND_STATE, "not in PREOP after %d ms: AL status 0x%02x",
                          PREOP_MS, s->state);
            } else {
                soem_note(bus, node, FSN_FOUND_STATE,
                          "PREOP refused: AL status 0x%02x, code 0x%04x: %s", s->state,
                          s->ALstatuscode, fsn_al_code_text(s->ALstatuscode));
            }
            return fsn_node_refuse(fault, FSN_E_BUS_STATE, &node->known);
        }
        node->known.seen.al_status = node->group == FSN_NONE ? FSN_AL_PREOP : FSN_AL_NONE;
    }
    return FSN_OK;
}

fsn_status soem_identify(struct fsn_soem *bus, struct node *node, uint16_t at) {
    return note_who_answers(bus, node, at, read_identity(bus, at));
}

void soem_describe_at(struct fsn_soem *bus, uint16_t at, uint16_t alias,
                      char text[FSN_DETAIL_BYTES]) {
    const struct identity found = read_identity(bus, at);
    snprintf(text, FSN_DETAIL_BYTES,
             "ring position %u: vendor 0x%08x product 0x%08x alias %u is of no group", at - 1u,
             (unsigned)found.vendor, (unsigned)found.product, alias);
}

/* -- coming back ---------------------------------------------------------------------------- */

bool soem_station_at(struct fsn_soem *bus, uint16_t at, uint16_t *station, uint16_t *alias) {
    uint16_t raw[2] = {0}; /* 0x0010, 0x0012 */
    soem_drain(bus);
    const int counter = ecx_APRD(bus->context.port, position_address(at), ECT_REG_STADR, sizeof raw,
                                 raw, EC_TIMEOUTRET);
    *station = etohs(raw[0]);
    *alias = etohs(raw[1]);
    return counter == 1;
}

bool soem_set_station(struct fsn_soem *bus, uint16_t at, uint16_t station) {
    return ecx_APWRw(bus->context.port, position_address(at), ECT_REG_STADR, htoes(station),
                     EC_TIMEOUTRET3) == 1;
}

/** Whether the device at a position without a station address is the same as before; any other
 *  device is noted and left unchanged. */
static bool is_same_device(struct fsn_soem *bus, uint16_t slave, uint16_t at) {
    const struct identity found = read_identity(bus, at);
    const int node = bus->places[slave].node;
    if (node != SOEM_NO_NODE) {
        return note_who_answers(bus, &bus->nodes[node], at, found) == FSN_OK;
    }
    const ec_slavet *s = &bus->slaves[slave];
    return found.vendor == s->eep_man && found.product == s->eep_id;
}

bool soem_take_back(struct fsn_soem *bus, uint16_t slave, uint16_t at) {
    ec_slavet *s = &bus->slaves[slave];
    if (!is_same_device(bus, slave, at)) {
        return false;
    }
    soem_forget_clock(bus, slave);
    (void)soem_set_station(bus, at, s->configadr);
    s->eep_pdi = 0;
    s->mbx_cnt = 0;
    bus->places[slave].quiet = 0;
    if (bus->places[slave].node != SOEM_NO_NODE) {
        struct node *node = &bus->nodes[bus->places[slave].node];
        node->configured = false;
        node->requested = 0;
        node->known.retry_ns = 0;
    }
    return true;
}

void soem_search(struct fsn_soem *bus) {
    /* A position is valid only after an unchanged one: on a line with different cabling, or viewed
     * from both ends of a broken ring, positions have another meaning. */
    bool before_is_right = true;
    for (uint16_t slave = 1; slave <= bus->slave_count; slave++) {
        uint16_t station;
        uint16_t alias;
        if (bus->places[slave].al_status != 0) {
            before_is_right = true;
            continue;
        }
        if (!before_is_right || !soem_station_at(bus, slave, &station, &alias)) {
            before_is_right = false;
            continue;
        }
        if (station == bus->slaves[slave].configadr) {
            continue;
        }
        before_is_right = soem_slave_at(bus, station) == 0 && soem_take_back(bus, slave, slave);
    }
}
