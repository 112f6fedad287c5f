/** Devices at the ring positions, by the last scan of IgH. */
#define _POSIX_C_SOURCE 200809L

#include "backends/igh/igh.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

enum {
    PAUSE_MS = 10,
    SCAN_MS = 15000,
    PREOP_MS = 10000,
    STATE_BITS = 0x0F,
    MOST_TRIES = 100,
    MOST_SCANS = 20
};

static void pause_a_little(void) {
    const struct timespec pause = {.tv_nsec = PAUSE_MS * 1000000L};
    clock_nanosleep(CLOCK_MONOTONIC, 0, &pause, NULL);
}

/** A failed scan leaves zeros. */
static bool is_read(const ec_slave_info_t *slave) {
    return slave->vendor_id != 0 || slave->product_code != 0;
}

/* If a signal interrupts the call, the place is not empty. */
bool igh_slave(const struct fsn_igh *bus, uint16_t ring, ec_slave_info_t *slave) {
    int result = -EINTR;
    IGH_CALL(result, MOST_TRIES, ecrt_master_get_slave(bus->master, ring, slave));
    return result == 0;
}

/* IgH attaches its configurations by vendor and product code alone; the revision is checked
 * here. */
bool igh_note_identity(struct fsn_igh *bus, struct igh_node *node, const ec_slave_info_t *slave) {
    char detail[FSN_DETAIL_BYTES];
    if (fsn_node_note_identity(&bus->all, &node->known, slave->vendor_id, slave->product_code,
                               slave->revision_number, detail)) {
        return true;
    }
    if (!is_read(slave)) {
        igh_note(bus, node, FSN_FOUND_UNKNOWN,
                 "IgH could not read its identity; `ethercat rescan` retries");
        return false;
    }
    igh_note(bus, node, FSN_FOUND_IDENTITY, "%s", detail);
    return false;
}

bool igh_ring_of(const struct fsn_igh *bus, const struct fsn_subdevice_info *info,
                 unsigned slave_count, uint16_t *ring) {
    unsigned first = 0;
    while (info->alias != 0 && first < slave_count) {
        ec_slave_info_t slave = {0};
        if (igh_slave(bus, (uint16_t)first, &slave) && slave.alias == info->alias) {
            break;
        }
        first++;
    }
    *ring = (uint16_t)(first + info->position);
    return first + info->position < slave_count;
}

/** Waits while IgH scans; the result is in `master`. */
static fsn_status wait_for_scan(struct fsn_igh *bus, ec_master_info_t *master,
                                struct fsn_fault *fault) {
    for (int ms = 0; ms < SCAN_MS; ms += PAUSE_MS) {
        const int result = ecrt_master(bus->master, master);
        if (result != 0 && result != -EINTR) {
            return igh_refuse_call(fault, result, "IgH does not report its SubDevices");
        }
        if (result == 0 && master->scan_busy == 0) {
            return FSN_OK;
        }
        pause_a_little();
    }
    return fsn_refuse_all(fault, FSN_E_BUS_STATE, "IgH does not finish its scan");
}

static fsn_status nobody(const struct fsn_igh *bus, bool link_up, struct fsn_fault *fault) {
    fsn_live_refuse(fault, FSN_E_BUS_SILENT, NULL, "master %u %s", bus->index,
                    link_up ? "has a link, but no EtherCAT SubDevice answers on it"
                            : "has no link: cable, power of the SubDevices, `ip link set ... up`");
    if (fault != NULL) {
        fault->link_down = !link_up;
    }
    return FSN_E_BUS_SILENT;
}

static fsn_status match(struct fsn_igh *bus, unsigned slave_count, struct fsn_fault *fault) {
    fsn_status first = FSN_OK;
    for (uint32_t n = 0; n < bus->all.count; n++) {
        struct igh_node *node = &bus->nodes[n];
        ec_slave_info_t slave = {0};
        fsn_status status = FSN_OK;
        if (!igh_ring_of(bus, &node->known.info, slave_count, &node->ring) ||
            !igh_slave(bus, node->ring, &slave)) {
            igh_note(bus, node, FSN_FOUND_NOTHING, "alias %u, position %u: %u SubDevices answer",
                     node->known.info.alias, node->known.info.position, slave_count);
            status = FSN_E_BUS_MISSING;
        } else if (!igh_note_identity(bus, node, &slave)) {
            status = is_read(&slave) ? FSN_E_BUS_IDENTITY : FSN_E_BUS_STATE;
        } else {
            igh_note(bus, node, FSN_FOUND_RIGHT, "%s", "");
        }
        if (status != FSN_OK && first == FSN_OK) {
            first = fsn_node_refuse(fault, status, &node->known);
        }
    }
    return first;
}

/** Reserves the master. From here until activation IgH does not scan, so all SubDevices must be
 *  found before. */
static fsn_status reserve(struct fsn_igh *bus, struct fsn_fault *fault) {
    int result = -EINTR;
    IGH_CALL(result, MOST_TRIES, ecrt_master_reserve(bus->master));
    if (result == -EBUSY) {
        return fsn_refuse_all(fault, FSN_E_BUS_BUSY,
                              "another program has this master of IgH in use");
    }
    return result == 0 ? FSN_OK : igh_refuse_call(fault, result, "IgH does not provide its master");
}

/** An idle master brings all to PREOP. */
static fsn_status wait_for_preop(struct fsn_igh *bus, struct igh_node *node,
                                 struct fsn_fault *fault) {
    ec_slave_info_t slave = {0};
    for (int ms = 0; ms < PREOP_MS; ms += PAUSE_MS) {
        if (igh_slave(bus, node->ring, &slave)) {
            const unsigned state = slave.al_state & STATE_BITS;
            if (slave.error_flag != 0) {
                break;
            }
            if (slave.al_state == FSN_AL_PREOP || state == FSN_AL_SAFEOP || state == FSN_AL_OP) {
                node->known.seen.al_status = slave.al_state;
                return FSN_OK;
            }
        }
        pause_a_little();
    }
    node->known.seen.al_status = slave.al_state;
    igh_note(bus, node, FSN_FOUND_STATE, "PREOP refused: AL status 0x%02x; see the kernel log",
             slave.al_state);
    return fsn_node_refuse(fault, FSN_E_BUS_STATE, &node->known);
}

/** Finds all by a scan that was complete before and after. */
static fsn_status match_scanned(struct fsn_igh *bus, struct fsn_fault *fault) {
    fsn_status status = FSN_OK;
    ec_master_info_t after = {.scan_busy = 1};
    for (int tries = 0; after.scan_busy != 0 && tries < MOST_SCANS; tries++) {
        ec_master_info_t master = {0};
        FSN_TRY(wait_for_scan(bus, &master, fault));
        status = master.slave_count == 0 ? nobody(bus, master.link_up, fault)
                                         : match(bus, master.slave_count, fault);
        if (ecrt_master(bus->master, &after) != 0) {
            after.scan_busy = 1;
        }
    }
    return status;
}

fsn_status igh_find(struct fsn_igh *bus, struct fsn_fault *fault) {
    FSN_TRY(match_scanned(bus, fault));
    FSN_TRY(reserve(bus, fault));
    /* Between the scan and the reservation the bus may have changed. */
    FSN_TRY(match_scanned(bus, fault));
    for (uint32_t n = 0; n < bus->all.count; n++) {
        FSN_TRY(wait_for_preop(bus, &bus->nodes[n], fault));
    }
    return FSN_OK;
}
