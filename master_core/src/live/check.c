#include "live/check.h"

#include <stdio.h>
#include <string.h>

#include "live/fsoe_objects.h"

enum {
    KNOWN_ADDRESS = 2, /**< bit of fsn_connection_info.known */
    MOST_ADDRESSES = 16,
};

fsn_status fsn_objects_read(const struct fsn_objects *objects, uint16_t index, uint8_t sub,
                            uint8_t bytes[8]) {
    struct fsn_transfer transfer = {
        .position = objects->position, .index = index, .sub = sub, .data = bytes, .size_bytes = 8};
    memset(bytes, 0, 8);
    return objects->upload(objects->bus, &transfer);
}

fsn_status fsn_objects_write(const struct fsn_objects *objects, uint16_t index, uint8_t sub,
                             const uint8_t *bytes, uint32_t size_bytes, uint32_t *abort_code) {
    /* A transfer has one pointer for both ways; a download only reads from it. */
    struct fsn_transfer transfer = {.position = objects->position,
                                    .index = index,
                                    .sub = sub,
                                    .data = (uint8_t *)(uintptr_t)bytes,
                                    .size_bytes = size_bytes};
    const fsn_status status = objects->download(objects->bus, &transfer);
    *abort_code = transfer.abort_code;
    return status;
}

bool fsn_check_identity(const struct fsn_subdevice_info *info, uint32_t vendor_id,
                        uint32_t product_code, uint32_t revision, char detail[FSN_DETAIL_BYTES]) {
    if (vendor_id == info->vendor_id && product_code == info->product_code &&
        revision >= info->revision_low && revision <= info->revision_high) {
        return true;
    }
    snprintf(detail, FSN_DETAIL_BYTES,
             "found vendor 0x%08x product 0x%08x revision 0x%08x, the plan says 0x%08x 0x%08x "
             "0x%08x to 0x%08x",
             vendor_id, product_code, revision, info->vendor_id, info->product_code,
             info->revision_low, info->revision_high);
    return false;
}

fsn_status fsn_check_sdos(const struct fsn_plan *plan, const struct fsn_subdevice_info *info,
                          const struct fsn_objects *objects, char detail[FSN_DETAIL_BYTES]) {
    for (uint32_t i = 0; i < info->sdo_count; i++) {
        const struct fsn_sdo_record r = fsn_read_sdo(plan, info->first_sdo + i);
        const uint8_t *value = fsn_sdo_value(plan, info->first_sdo + i);
        uint32_t code = 0;
        if (objects == NULL) {
            snprintf(detail, FSN_DETAIL_BYTES, "0x%04x:%02x is to be written, but it has no CoE",
                     r.index, r.subindex);
            return FSN_E_BUS_SDO;
        }
        if (fsn_objects_write(objects, r.index, r.subindex, value, r.size_bytes, &code) != FSN_OK) {
            if (code == 0) {
                snprintf(detail, FSN_DETAIL_BYTES, "0x%04x:%02x: no answer", r.index, r.subindex);
            } else {
                snprintf(detail, FSN_DETAIL_BYTES, "0x%04x:%02x: abort code 0x%08x %s", r.index,
                         r.subindex, code, fsn_abort_text(code));
            }
            return FSN_E_BUS_SDO;
        }
    }
    return FSN_OK;
}

/** Reads which FSoE addresses a SubDevice has: the one that is wanted where it has it, else its
 *  first. */
static bool read_own_address(const struct fsn_objects *objects, uint16_t wanted, uint16_t *found) {
    uint8_t bytes[8];
    if (fsn_objects_read(objects, FSN_ADDRESSES, 1, bytes) != FSN_OK) {
        return false;
    }
    *found = fsn_get16(bytes);
    uint8_t count = 1;
    if (*found != wanted && fsn_objects_read(objects, FSN_ADDRESSES, 0, bytes) == FSN_OK) {
        count = bytes[0] < MOST_ADDRESSES ? bytes[0] : MOST_ADDRESSES;
    }
    for (uint8_t sub = 2; sub <= count && *found != wanted; sub++) {
        if (fsn_objects_read(objects, FSN_ADDRESSES, sub, bytes) == FSN_OK &&
            fsn_get16(bytes) == wanted) {
            *found = wanted;
        }
    }
    return true;
}

/** Reads the address of a SubInstance from the parameters of its connection; 0 there: not known
 *  before the first connection. */
static bool read_given_address(const struct fsn_plan *plan, const struct fsn_connection_info *c,
                               const struct fsn_objects *objects, uint16_t *found) {
    uint8_t bytes[8];
    const struct fsn_copy_info copy = fsn_known_copy(plan, c->copy_to_main);
    const uint16_t object =
        fsn_parameter_object(fsn_object_at(plan, copy.source_sm, 8 * copy.source_byte));
    if (object == 0 || fsn_objects_read(objects, object, 0, bytes) != FSN_OK ||
        bytes[0] < FSN_PARAMETER_WATCHDOG_MS ||
        fsn_objects_read(objects, object, FSN_PARAMETER_ADDRESS, bytes) != FSN_OK) {
        return false;
    }
    *found = fsn_get16(bytes);
    return *found != 0;
}

fsn_status fsn_check_address(const struct fsn_plan *plan, uint32_t subdevice,
                             const struct fsn_objects *objects, bool *readable,
                             char detail[FSN_DETAIL_BYTES]) {
    struct fsn_connection_info c;
    *readable = false;
    for (uint32_t i = 0; objects != NULL && fsn_plan_connection(plan, i, &c) == FSN_OK; i++) {
        uint16_t address;
        if (c.sub_subdevice != subdevice || (c.known & KNOWN_ADDRESS) == 0 ||
            (!read_own_address(objects, c.address, &address) &&
             !read_given_address(plan, &c, objects, &address))) {
            continue;
        }
        *readable = true;
        if (address != c.address) {
            snprintf(detail, FSN_DETAIL_BYTES, "it has FSoE address %u, the plan says %u", address,
                     c.address);
            return FSN_E_BUS_ADDRESS;
        }
    }
    return FSN_OK;
}
