/** Configures a SubDevice from PREOP to the point where SAFEOP can be requested. */
#include "backends/soem/soem.h"

#include <string.h>

enum {
    REG_FMMU_COUNT = 0x0004,
    FMMU_BYTES = 16,
    MOST_FMMUS = 16,
    SM_BYTES = 8,
    SM_WATCHDOG = 0x40,
    SM_OUTPUT = 0x24,
    SM_INPUT = 0x20,
    RX_CATEGORY = 1, /**< of ecx_siiPDO: outputs */
    TX_CATEGORY = 0,
};

/** Bits of a sync manager by the SII. A SubDevice whose SII has no process data is not checked. */
static bool sii_bits(void *context, const struct fsn_node *known, uint32_t sm, uint32_t *bits) {
    struct fsn_soem *bus = context;
    const struct node *node = (const struct node *)known;
    const struct fsn_sm_record r = fsn_read_sm(bus->all.plan, sm);
    ec_eepromPDOt *sii = &bus->eeprom_pdo;
    if ((bus->slaves[node->slave].mbx_l > 0 && r.index < 2) || r.index >= EC_MAXSM) {
        return false; /* a mailbox */
    }
    memset(sii, 0, sizeof *sii);
    ecx_siiPDO(&bus->context, node->slave, sii,
               r.direction == FSN_OUTPUT ? RX_CATEGORY : TX_CATEGORY);
    *bits = sii->SMbitsize[r.index];
    return sii->Startpos != 0;
}

/* -- registers ------------------------------------------------------------------------------ */

typedef bool (*use_fn)(struct fsn_soem *bus, uint16_t slave, uint16_t address, const void *data,
                       uint16_t size);

/** Whether registers already have these bytes; for a sync manager, without its status and PDI
 *  byte. */
static bool same_register(struct fsn_soem *bus, uint16_t slave, uint16_t address, const void *data,
                          uint16_t size) {
    uint8_t found[MOST_FMMUS * FMMU_BYTES] = {0};
    if (!soem_read_surely(bus, slave, address, found, size)) {
        return false;
    }
    if (size == SM_BYTES) {
        found[5] = ((const uint8_t *)data)[5];
        found[7] = ((const uint8_t *)data)[7];
    }
    return memcmp(found, data, size) == 0;
}

/** Start address from the SII, length from the plan. */
static fsn_status use_sm(struct fsn_soem *bus, struct node *node, uint32_t sm, uint16_t *physical,
                         use_fn use) {
    const struct fsn_sm_record r = fsn_read_sm(bus->all.plan, sm);
    const uint8_t number = r.index;
    const ec_slavet *s = &bus->slaves[node->slave];
    *physical = soem_sii_start(bus, node->slave, number);
    if (*physical == 0) {
        soem_note(bus, node, FSN_FOUND_MAPPING,
                  "its SII has no address for SM%u, or could not be read", number);
        return FSN_E_BUS_MAPPING;
    }
    const bool output = r.direction == FSN_OUTPUT;
    uint8_t control = (uint8_t)etohl(s->SM[number].SMflags);
    /* Buffered, in the correct direction, whatever the SII contains; the watchdog as planned. */
    control = (uint8_t)((control & ~0x0Fu) | ((output ? SM_OUTPUT : SM_INPUT) & 0x0Fu));
    if (r.watchdog == 1) {
        control |= SM_WATCHDOG;
    } else if (r.watchdog == 2) {
        control &= (uint8_t)(0xFF - SM_WATCHDOG);
    }
    uint8_t bytes[SM_BYTES] = {0};
    fsn_put16(bytes, *physical);
    fsn_put16(bytes + 2, fsn_sm_bytes(bus->all.plan, sm));
    bytes[4] = control;
    bytes[6] = fsn_sm_bytes(bus->all.plan, sm) > 0;
    return use(bus, node->slave, (uint16_t)(ECT_REG_SM0 + SM_BYTES * number), bytes, SM_BYTES)
               ? FSN_OK
               : FSN_E_BUS_STATE;
}

static void fill_fmmu(uint8_t *bytes, uint32_t logical, uint32_t size, uint16_t physical,
                      bool output) {
    fsn_put16(bytes, logical);
    fsn_put16(bytes + 2, logical >> 16);
    fsn_put16(bytes + 4, size);
    bytes[7] = 7; /* from bit 0 to bit 7 */
    fsn_put16(bytes + 8, physical);
    bytes[11] = output ? 2 : 1;
    bytes[12] = 1;
}

/** Configures sync managers and one FMMU for each that has a place in the image. */
static fsn_status use_layout(struct fsn_soem *bus, struct node *node, use_fn use) {
    uint8_t fmmus[MOST_FMMUS * FMMU_BYTES] = {0};
    uint8_t available = 0;
    unsigned used = 0;
    (void)soem_read_surely(bus, node->slave, REG_FMMU_COUNT, &available, 1);
    available = available > MOST_FMMUS ? MOST_FMMUS : available;
    for (uint32_t sm = node->known.info.first_sm;
         sm < node->known.info.first_sm + node->known.info.sm_count; sm++) {
        const struct fsn_sm_record r = fsn_read_sm(bus->all.plan, sm);
        const uint32_t base = bus->frames.image.sm_base[sm];
        uint16_t physical;
        if (fsn_sm_bytes(bus->all.plan, sm) == 0) {
            continue;
        }
        FSN_TRY(use_sm(bus, node, sm, &physical, use));
        if (base == FSN_NONE) {
            continue;
        }
        if (used >= available) {
            soem_note(bus, node, FSN_FOUND_MAPPING, "it has %u FMMUs, the plan needs more",
                      available);
            return FSN_E_BUS_MAPPING;
        }
        fill_fmmu(fmmus + FMMU_BYTES * used++, base, fsn_sm_bytes(bus->all.plan, sm), physical,
                  r.direction == FSN_OUTPUT);
    }
    return available == 0 ||
                   use(bus, node->slave, ECT_REG_FMMU0, fmmus, (uint16_t)(FMMU_BYTES * available))
               ? FSN_OK
               : FSN_E_BUS_STATE;
}

fsn_status soem_compare_layout(struct fsn_soem *bus, struct node *node) {
    const fsn_status status = use_layout(bus, node, same_register);
    if (status != FSN_E_BUS_STATE) {
        return status;
    }
    uint16_t al;
    if (!soem_read_surely(bus, node->slave, ECT_REG_ALSTAT, &al, sizeof al)) {
        soem_note(bus, node, FSN_FOUND_NOTHING, "it has stopped to answer, or frames are late");
        return FSN_E_BUS_MISSING;
    }
    soem_note(bus, node, FSN_FOUND_MAPPING,
              "its sync managers or FMMUs are not those of this plan");
    return FSN_E_BUS_MAPPING;
}

fsn_status soem_configure(struct fsn_soem *bus, struct node *node) {
    const struct fsn_objects all = soem_objects(bus, node->slave);
    const struct fsn_objects *objects = soem_has_coe(bus, node->slave) ? &all : NULL;
    bool readable;
    FSN_TRY(fsn_node_write_sdos(&bus->all, &node->known, objects));
    FSN_TRY(fsn_node_check_pdos(&bus->all, &node->known, objects, sii_bits, bus));
    FSN_TRY(fsn_node_check_address(&bus->all, &node->known, objects, &readable));
    const fsn_status status = use_layout(bus, node, soem_write);
    if (status == FSN_E_BUS_STATE) {
        soem_note(bus, node, FSN_FOUND_STATE, "it does not take its sync managers or FMMUs");
    }
    FSN_TRY(status);
    ecx_eeprom2pdi(&bus->context, node->slave);
    /* At the start, all clocks were set together. */
    if (bus->goal != 0) {
        FSN_TRY(soem_set_clock(bus, node));
    }
    FSN_TRY(soem_start_sync(bus, node));
    node->configured = true;
    soem_note(bus, node, FSN_FOUND_RIGHT, "%s", "");
    return FSN_OK;
}
