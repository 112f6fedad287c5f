/** Checks of a SubDevice against the plan, common to all live buses. */
#ifndef FSN_LIVE_CHECK_H
#define FSN_LIVE_CHECK_H

#include "fsn/acyclic.h"
#include "plan/plan_internal.h"

/** Access to the objects of one SubDevice, as in fsn_bus_acyclic. Values are little-endian. */
struct fsn_objects {
    void *bus;
    uint32_t position;
    fsn_status (*upload)(void *bus, struct fsn_transfer *transfer);
    fsn_status (*download)(void *bus, struct fsn_transfer *transfer);
};

/** Whether there was no answer, or the SubDevice is lost. */
bool fsn_is_silent(fsn_status status);

/** Reads an object of at most 8 bytes, the rest of them 0, with retries if no answer comes.
 *  @param[out] detail  the object without an answer; otherwise unchanged.   Returns as upload(). */
fsn_status fsn_objects_read(const struct fsn_objects *objects, uint16_t index, uint8_t sub,
                            uint8_t bytes[8], char detail[FSN_DETAIL_BYTES]);
/** Writes an object, repeatedly if there is no answer.
 *  @param[out] abort_code  reason of the refusal, or 0.   Returns as download(). */
fsn_status fsn_objects_write(const struct fsn_objects *objects, uint16_t index, uint8_t sub,
                             const uint8_t *bytes, uint32_t size_bytes, uint32_t *abort_code);

/** Whether a device is the planned one; if not, `detail` names both. */
bool fsn_check_identity(const struct fsn_subdevice_info *info, uint32_t vendor_id,
                        uint32_t product_code, uint32_t revision, char detail[FSN_DETAIL_BYTES]);

/** Writes the start-up SDOs of a SubDevice.
 *  @param[in]  objects  NULL: it has no CoE.
 *  @param[out] detail   the failed SDO and the reason.
 *  @retval FSN_E_BUS_SDO      one was refused.
 *  @retval FSN_E_BUS_MAILBOX, FSN_E_BUS_MISSING  one was not answered.   Context: may block. */
fsn_status fsn_check_sdos(const struct fsn_plan *plan, const struct fsn_subdevice_info *info,
                          const struct fsn_objects *objects, char detail[FSN_DETAIL_BYTES]);

/** Compares the FSoE address of a SubInstance with the plan, if both have it.
 *  @param[in]  subdevice  its number in the plan.
 *  @param[in]  objects    NULL: it has no CoE.
 *  @param[out] readable   whether it could be read.
 *  @param[out] found      the differing address; 0 without one.
 *  @param[out] detail   the difference, or the object without an answer.
 *  @retval FSN_E_BUS_ADDRESS  the address differs.
 *  @retval FSN_E_BUS_MAILBOX, FSN_E_BUS_MISSING  no answer: unknown.   Context: may block.
 */
fsn_status fsn_check_address(const struct fsn_plan *plan, uint32_t subdevice,
                             const struct fsn_objects *objects, bool *readable, uint16_t *found,
                             char detail[FSN_DETAIL_BYTES]);

#endif
