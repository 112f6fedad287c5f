/** Compares PDO assignment and mapping of a SubDevice with the plan, object by object. */
#ifndef FSN_LIVE_PDO_H
#define FSN_LIVE_PDO_H

#include "live/check.h"

enum { FSN_PDO_ENTRIES = 254 };

/** Entries of a PDO of the plan in the form of mapping objects: index, subindex and bits in one
 *  word each, index 0 is padding; an entry of more than 255 bits is split. Returns their number. */
uint32_t fsn_pdo_entries(const struct fsn_plan *plan, uint32_t number,
                         uint32_t entries[FSN_PDO_ENTRIES]);

/** Compares assignment and mapping of a sync manager with the plan. A difference is corrected by
 *  one write and checked again. If the objects cannot be read, the SubDevice itself checks the
 *  length on its way to SAFEOP.
 *  @param[in]  sm      record of the sync manager in the plan; not of a mailbox.
 *  @param[out] detail  the difference in words.
 *  @retval FSN_E_BUS_MAPPING  it differs and cannot be changed.
 *  @retval FSN_E_BUS_MAILBOX, FSN_E_BUS_MISSING  no answer, which is not the same as a refusal.
 *  Context: set-up; may block. */
fsn_status fsn_pdo_check(const struct fsn_plan *plan, uint32_t sm,
                         const struct fsn_objects *objects, char detail[FSN_DETAIL_BYTES]);

/** Compares the length of the process data of a sync manager in the SII with the plan; for
 *  SubDevices without objects. @retval FSN_E_BUS_MAPPING  it differs. */
fsn_status fsn_pdo_check_bits(const struct fsn_plan *plan, uint32_t sm, uint32_t found_bits,
                              char detail[FSN_DETAIL_BYTES]);

#endif
