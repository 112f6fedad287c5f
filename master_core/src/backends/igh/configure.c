/** Checks before IgH takes over, and the configuration of IgH. */
#include "backends/igh/igh.h"

#include "live/pdo.h"

#include <string.h>

enum { DEVICE_TYPE = 0x1000 };

/* -- checks --------------------------------------------------------------------------------- */

/** Determines whether it has CoE: an abort code also counts as an answer, silence does not. */
static fsn_status find_coe(struct fsn_igh *bus, struct igh_node *node) {
    const struct fsn_objects objects = igh_objects(bus, node);
    char detail[FSN_DETAIL_BYTES];
    uint8_t bytes[8];
    const fsn_status status = fsn_objects_read(&objects, DEVICE_TYPE, 0, bytes, detail);
    node->coe = status == FSN_OK || status == FSN_E_BUS_SDO;
    if (!fsn_is_silent(status)) {
        return FSN_OK;
    }
    return fsn_node_note_status(&bus->all, &node->known, status, detail);
}

fsn_status igh_check_address(struct fsn_igh *bus, struct igh_node *node, bool *readable) {
    const struct fsn_objects objects = igh_objects(bus, node);
    return fsn_node_check_address(&bus->all, &node->known, node->coe ? &objects : NULL, readable);
}

/** Bits in IgH for a sync manager, as read from the SII; a SubDevice without data is not checked.
 */
static bool sii_bits(void *context, const struct fsn_node *node, uint32_t sm, uint32_t *bits) {
    struct fsn_igh *bus = context;
    const uint16_t ring = ((const struct igh_node *)node)->ring;
    const uint8_t number = fsn_read_sm(bus->all.plan, sm).index;
    ec_sync_info_t sync = {0};
    *bits = 0;
    if (ecrt_master_get_sync_manager(bus->master, ring, number, &sync) != 0) {
        return false;
    }
    for (unsigned p = 0; p < sync.n_pdos; p++) {
        ec_pdo_info_t pdo = {0};
        if (ecrt_master_get_pdo(bus->master, ring, number, (uint16_t)p, &pdo) != 0) {
            return false;
        }
        for (unsigned e = 0; e < pdo.n_entries; e++) {
            ec_pdo_entry_info_t entry = {0};
            if (ecrt_master_get_pdo_entry(bus->master, ring, number, (uint16_t)p, (uint16_t)e,
                                          &entry) != 0) {
                return false;
            }
            *bits += entry.bit_length;
        }
    }
    return *bits != 0;
}

fsn_status igh_check(struct fsn_igh *bus, struct igh_node *node) {
    FSN_TRY(find_coe(bus, node));
    const struct fsn_objects all = igh_objects(bus, node);
    const struct fsn_objects *objects = node->coe ? &all : NULL;
    /* IgH writes the SDOs again at every start of the SubDevice. Here they are checked, and the
     * process data, because IgH itself prints an error only in the kernel log. */
    FSN_TRY(fsn_node_write_sdos(&bus->all, &node->known, objects));
    FSN_TRY(fsn_node_check_pdos(&bus->all, &node->known, objects, sii_bits, bus));
    return fsn_node_check_address(&bus->all, &node->known, objects, &node->address_readable);
}

/* -- configuration -------------------------------------------------------------------------- */

static ec_watchdog_mode_t watchdog_of(uint8_t value) {
    static const ec_watchdog_mode_t modes[] = {EC_WD_DEFAULT, EC_WD_ENABLE, EC_WD_DISABLE};
    return value < sizeof modes / sizeof modes[0] ? modes[value] : EC_WD_DEFAULT;
}

static bool configure_pdo(const struct fsn_plan *plan, ec_slave_config_t *config, uint8_t sm,
                          uint32_t number) {
    uint32_t entries[FSN_PDO_ENTRIES];
    const uint32_t count = fsn_pdo_entries(plan, number, entries);
    const uint16_t index = fsn_read_pdo(plan, number).index;
    bool ok = ecrt_slave_config_pdo_assign_add(config, sm, index) == 0 &&
              ecrt_slave_config_pdo_mapping_clear(config, index) == 0;
    for (uint32_t i = 0; ok && i < count; i++) {
        ok =
            ecrt_slave_config_pdo_mapping_add(config, index, (uint16_t)(entries[i] >> 16),
                                              (uint8_t)(entries[i] >> 8), (uint8_t)entries[i]) == 0;
    }
    return ok;
}

static bool is_mailbox(const struct igh_node *node, uint8_t sm_number) {
    return node->coe && sm_number < 2;
}

static bool configure_sm(struct fsn_igh *bus, const struct igh_node *node, uint32_t sm) {
    const struct fsn_sm_record r = fsn_read_sm(bus->all.plan, sm);
    const ec_direction_t direction = r.direction == FSN_OUTPUT ? EC_DIR_OUTPUT : EC_DIR_INPUT;
    if (is_mailbox(node, r.index)) {
        return true;
    }
    bool ok = ecrt_slave_config_sync_manager(node->config, r.index, direction,
                                             watchdog_of(r.watchdog)) == 0 &&
              ecrt_slave_config_pdo_assign_clear(node->config, r.index) == 0;
    for (uint32_t i = 0; ok && i < r.pdo_count; i++) {
        ok = configure_pdo(bus->all.plan, node->config, r.index, r.first_pdo + i);
    }
    return ok;
}

/** Registering one entry adds the whole sync manager to the domain. */
static bool make_domain(struct fsn_igh *bus, const struct igh_node *node, struct igh_area *area) {
    const struct fsn_sm_record sm = fsn_read_sm(bus->all.plan, area->sm);
    area->domain = ecrt_master_create_domain(bus->master);
    if (area->domain == NULL) {
        return false;
    }
    uint32_t pdo = 0; /* an entry with a place has bits, so a PDO has entries */
    while (fsn_read_pdo(bus->all.plan, sm.first_pdo + pdo).entry_count == 0) {
        pdo++;
    }
    unsigned bit = 0;
    return ecrt_slave_config_reg_pdo_entry_pos(node->config, sm.index, pdo, 0, area->domain,
                                               &bit) == 0;
}

fsn_status igh_configure(struct fsn_igh *bus, struct igh_node *node) {
    const struct fsn_subdevice_info *info = &node->known.info;
    node->config = ecrt_master_slave_config(bus->master, info->alias, info->position,
                                            info->vendor_id, info->product_code);
    bool ok = node->config != NULL;
    for (uint32_t i = 0; ok && i < info->sdo_count; i++) {
        const struct fsn_sdo_record r = fsn_read_sdo(bus->all.plan, info->first_sdo + i);
        const uint8_t *value = fsn_sdo_value(bus->all.plan, info->first_sdo + i);
        ok = ecrt_slave_config_sdo(node->config, r.index, r.subindex, value, r.size_bytes) == 0;
    }
    for (uint32_t sm = info->first_sm; ok && sm < info->first_sm + info->sm_count; sm++) {
        ok = configure_sm(bus, node, sm);
    }
    for (uint32_t a = 0; ok && a < bus->area_count; a++) {
        ok = bus->areas[a].node != node->known.number || make_domain(bus, node, &bus->areas[a]);
    }
    if (ok && info->assign_activate != 0) {
        ok = ecrt_slave_config_dc(node->config, info->assign_activate, (uint32_t)bus->cycle_ns, 0,
                                  0, 0) == 0;
    }
    if (ok) {
        node->request = ecrt_slave_config_create_reg_request(node->config, IGH_ERROR_BYTES);
    }
    return ok ? FSN_OK : FSN_E_BUS_MAPPING;
}
