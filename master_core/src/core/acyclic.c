#include "fsn/acyclic.h"

#include <string.h>

#include "core/core_internal.h"
#include "plan/plan_internal.h"

enum {
    SII_STEP = 64, /**< bytes read between two steps of other work */
    SII_ALIAS = 8, /**< byte offsets */
    SII_CHECKSUM = 14,
    SII_CATEGORIES = 0x80,
    SII_END = 0xFFFF,
};

/** Finds operations and place of a SubDevice of the plan. */
static fsn_status reach(struct fsn_core *core, uint32_t subdevice,
                        const struct fsn_bus_acyclic **acyclic, uint32_t *position) {
    if (core == NULL || subdevice >= fsn_plan_subdevice_count(core->plan)) {
        return FSN_E_ARG;
    }
    *acyclic = core->rt.ops->acyclic;
    if (*acyclic == NULL) {
        return FSN_E_ABSENT;
    }
    *position = (*acyclic)->place(core->rt.bus, subdevice);
    return *position == FSN_NONE ? FSN_E_BUS_MISSING : FSN_OK;
}

static bool is_allowed(const struct fsn_transfer *transfer) {
    return transfer != NULL && (transfer->data != NULL || transfer->size_bytes == 0) &&
           transfer->size_bytes <= FSN_SDO_BYTES;
}

/** Upload or download. */
static fsn_status transfer_object(struct fsn_core *core, uint32_t subdevice,
                                  struct fsn_transfer *transfer, bool writes) {
    const struct fsn_bus_acyclic *acyclic;
    if (!is_allowed(transfer)) {
        return FSN_E_ARG;
    }
    FSN_TRY(reach(core, subdevice, &acyclic, &transfer->position));
    fsn_status (*transfer_it)(void *bus, struct fsn_transfer *transfer) =
        writes ? acyclic->download : acyclic->upload;
    return transfer_it != NULL ? transfer_it(core->rt.bus, transfer) : FSN_E_ABSENT;
}

fsn_status fsn_core_upload(struct fsn_core *core, uint32_t subdevice,
                           struct fsn_transfer *transfer) {
    return transfer_object(core, subdevice, transfer, false);
}

fsn_status fsn_core_download(struct fsn_core *core, uint32_t subdevice,
                             struct fsn_transfer *transfer) {
    return transfer_object(core, subdevice, transfer, true);
}

/* -- SII ------------------------------------------------------------------------------------ */

/** Number of bytes of the SII that are needed, according to the part read so far: up to the end of
 *  its categories. `at` is the first category not yet passed; the next call continues there. */
static uint32_t needed(const uint8_t *sii, uint32_t have, uint32_t room, uint32_t *at) {
    /* mutants: both are even */
    while (*at + 4 <= have && fsn_get16(sii + *at) != SII_END) {
        *at += 4 + 2u * fsn_get16(sii + *at + 2);
    }
    /* mutants: both are even, and it is rounded up to 8 */
    const uint32_t whole = (*at + (*at + 4 <= have ? 2u : 4u) + 7) / 8 * 8;
    return whole < room ? whole : room;
}

fsn_status fsn_acyclic_read_sii(const struct fsn_bus_acyclic *acyclic, void *bus,
                                struct fsn_transfer *transfer) {
    const uint32_t room =
        (transfer->size_bytes < FSN_SII_BYTES ? transfer->size_bytes : FSN_SII_BYTES) / 8 * 8;
    uint32_t have = 0, category = SII_CATEGORIES, want;
    transfer->size_bytes = 0;
    if (acyclic->sii_read == NULL) {
        return FSN_E_ABSENT;
    }
    while ((want = needed(transfer->data, have, room, &category)) > have) {
        const uint32_t step = want - have < SII_STEP ? want - have : SII_STEP;
        FSN_TRY(acyclic->sii_read(bus, transfer->position, have, transfer->data + have, step));
        have += step;
        transfer->size_bytes = have;
        if (transfer->between != NULL && !transfer->between(transfer->self)) {
            return FSN_E_STATE;
        }
    }
    return FSN_OK;
}

fsn_status fsn_core_sii_read(struct fsn_core *core, uint32_t subdevice,
                             struct fsn_transfer *transfer) {
    const struct fsn_bus_acyclic *acyclic;
    if (!is_allowed(transfer)) {
        return FSN_E_ARG;
    }
    FSN_TRY(reach(core, subdevice, &acyclic, &transfer->position));
    return fsn_acyclic_read_sii(acyclic, core->rt.bus, transfer);
}

fsn_status fsn_core_alias_write(struct fsn_core *core, uint32_t subdevice, uint16_t alias) {
    const struct fsn_bus_acyclic *acyclic;
    uint32_t position;
    uint8_t head[16];
    FSN_TRY(reach(core, subdevice, &acyclic, &position));
    if (acyclic->sii_read == NULL || acyclic->sii_write == NULL) {
        return FSN_E_ABSENT;
    }
    void *bus = core->rt.bus;
    FSN_TRY(acyclic->sii_read(bus, position, 0, head, sizeof head));
    head[SII_ALIAS] = (uint8_t)alias;
    head[SII_ALIAS + 1] = (uint8_t)(alias >> 8);
    head[SII_CHECKSUM] = fsn_eeprom_checksum(head);
    FSN_TRY(acyclic->sii_write(bus, position, SII_ALIAS, alias));
    FSN_TRY(acyclic->sii_write(bus, position, SII_CHECKSUM, fsn_get16(head + SII_CHECKSUM)));
    uint8_t back[16] = {0}; /* mutants: read before it is compared */
    FSN_TRY(acyclic->sii_read(bus, position, 0, back, sizeof back));
    return memcmp(head, back, sizeof head) == 0 ? FSN_OK : FSN_E_BUS_STATE;
}
