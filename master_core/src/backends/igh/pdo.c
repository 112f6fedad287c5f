/** Compares process data of a SubDevice with the plan: from its objects if it has CoE, otherwise
 *  from the SII as read by IgH. It is checked here because IgH itself only prints a warning in the
 *  kernel log and continues. */
#include "backends/igh/igh.h"

#include "live/pdo.h"

/** Bits in IgH for a sync manager; 0 if it has no data. */
static uint32_t sii_bits(struct fsn_igh *bus, const struct igh_node *node, uint8_t number) {
    ec_master_t *master = bus->master;
    const uint16_t ring = node->ring;
    ec_sync_info_t sync = {0};
    uint32_t bits = 0;
    if (ecrt_master_get_sync_manager(master, ring, number, &sync) != 0 || sync.n_pdos == 0) {
        return 0;
    }
    for (unsigned p = 0; p < sync.n_pdos; p++) {
        ec_pdo_info_t pdo = {0};
        if (ecrt_master_get_pdo(master, ring, number, (uint16_t)p, &pdo) != 0) {
            return 0;
        }
        for (unsigned e = 0; e < pdo.n_entries; e++) {
            ec_pdo_entry_info_t entry = {0};
            if (ecrt_master_get_pdo_entry(master, ring, number, (uint16_t)p, (uint16_t)e, &entry) !=
                0) {
                return 0;
            }
            bits += entry.bit_length;
        }
    }
    return bits;
}

fsn_status igh_check_pdos(struct fsn_igh *bus, struct igh_node *node) {
    const struct fsn_objects objects = igh_objects(bus, node);
    for (uint32_t sm = node->known.info.first_sm;
         sm < node->known.info.first_sm + node->known.info.sm_count; sm++) {
        const uint8_t number = fsn_read_sm(bus->all.plan, sm).index;
        char detail[FSN_DETAIL_BYTES];
        fsn_status status = FSN_OK;
        if (!node->coe) {
            /* A SubDevice without data is not checked. */
            const uint32_t bits = sii_bits(bus, node, number);
            status = bits == 0 ? FSN_OK : fsn_pdo_check_bits(bus->all.plan, sm, bits, detail);
        } else if (number >= 2) { /* the others are its mailbox */
            status = fsn_pdo_check(bus->all.plan, sm, &objects, detail);
        }
        if (status != FSN_OK) {
            igh_note(bus, node, fsn_found_of(status), "%s", detail);
            return status;
        }
    }
    return FSN_OK;
}
