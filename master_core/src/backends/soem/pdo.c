/** Compares process data of a SubDevice with the plan: from its objects if it has CoE, otherwise
 *  from its SII. */
#include "backends/soem/soem.h"

#include <string.h>

#include "live/pdo.h"

enum {
    RX_CATEGORY = 1, /**< of ecx_siiPDO: outputs */
    TX_CATEGORY = 0,
};

/** A SubDevice whose SII has no process data is not checked. */
static fsn_status check_sii(struct fsn_soem *bus, const struct node *node, uint32_t sm,
                            char detail[FSN_DETAIL_BYTES]) {
    const struct fsn_sm_record r = fsn_read_sm(bus->all.plan, sm);
    ec_eepromPDOt *sii = &bus->eeprom_pdo;
    memset(sii, 0, sizeof *sii);
    ecx_siiPDO(&bus->context, node->slave, sii,
               r.direction == FSN_OUTPUT ? RX_CATEGORY : TX_CATEGORY);
    return sii->Startpos == 0 || r.index >= EC_MAXSM
               ? FSN_OK
               : fsn_pdo_check_bits(bus->all.plan, sm, sii->SMbitsize[r.index], detail);
}

fsn_status soem_check_pdos(struct fsn_soem *bus, struct node *node) {
    const struct fsn_objects objects = soem_objects(bus, node->slave);
    const bool coe = soem_has_coe(bus, node->slave);
    for (uint32_t sm = node->known.info.first_sm;
         sm < node->known.info.first_sm + node->known.info.sm_count; sm++) {
        char detail[FSN_DETAIL_BYTES];
        if (bus->slaves[node->slave].mbx_l > 0 && fsn_read_sm(bus->all.plan, sm).index < 2) {
            continue; /* a mailbox */
        }
        const fsn_status status = coe ? fsn_pdo_check(bus->all.plan, sm, &objects, detail)
                                      : check_sii(bus, node, sm, detail);
        if (status != FSN_OK) {
            soem_note(bus, node, fsn_found_of(status), "%s", detail);
            return status;
        }
    }
    return FSN_OK;
}
