#define _POSIX_C_SOURCE 200809L

#include "live/check.h"

#include <stdio.h>
#include <string.h>

#include "live/fsoe_objects.h"
#include "rt/clock.h"

enum {
    KNOWN_ADDRESS = 2, /**< bit of fsn_connection_info.known */
    MOST_ADDRESSES = 16,
    LEAST_TRIES = 3, /**< of one object, whatever time each one takes */
    MOST_TRIES = 10,
    MS = 1000000,
};

/** Further tries of one object begin within this time. */
static const uint64_t patience_ns = 2000000000u;

typedef fsn_status (*transfer_fn)(void *bus, struct fsn_transfer *transfer);

bool fsn_is_silent(fsn_status status) {
    return status == FSN_E_BUS_MAILBOX || status == FSN_E_BUS_MISSING;
}

/** Transfers an object, and retries after a lost or late answer with increasing pauses, because a
 *  check at the start must not depend on one frame. A write may be repeated. */
static fsn_status persist(const struct fsn_objects *objects, transfer_fn transfer_it,
                          struct fsn_transfer *transfer) {
    const uint32_t size_bytes = transfer->size_bytes;
    const uint64_t end_ns = fsn_clock_ns(CLOCK_MONOTONIC) + patience_ns;
    fsn_status status = transfer_it(objects->bus, transfer);
    for (int tries = 1; status == FSN_E_BUS_MAILBOX && tries < MOST_TRIES &&
                        (tries < LEAST_TRIES || fsn_clock_ns(CLOCK_MONOTONIC) < end_ns);
         tries++) {
        const struct timespec pause = {.tv_nsec = (long)MS << (tries - 1)};
        clock_nanosleep(CLOCK_MONOTONIC, 0, &pause, NULL);
        transfer->size_bytes = size_bytes;
        status = transfer_it(objects->bus, transfer);
    }
    return status;
}

/** Adds the object that was not answered. */
static fsn_status note_silence(fsn_status status, uint16_t index, uint8_t sub,
                               char detail[FSN_DETAIL_BYTES]) {
    if (fsn_is_silent(status)) {
        snprintf(detail, FSN_DETAIL_BYTES, "0x%04x:%02x: no answer", index, sub);
    }
    return status;
}

fsn_status fsn_objects_read(const struct fsn_objects *objects, uint16_t index, uint8_t sub,
                            uint8_t bytes[8], char detail[FSN_DETAIL_BYTES]) {
    struct fsn_transfer transfer = {
        .position = objects->position, .index = index, .sub = sub, .data = bytes, .size_bytes = 8};
    memset(bytes, 0, 8);
    return note_silence(persist(objects, objects->upload, &transfer), index, sub, detail);
}

fsn_status fsn_objects_write(const struct fsn_objects *objects, uint16_t index, uint8_t sub,
                             const uint8_t *bytes, uint32_t size_bytes, uint32_t *abort_code) {
    /* A transfer has one pointer for both ways; a download only reads from it. */
    struct fsn_transfer transfer = {.position = objects->position,
                                    .index = index,
                                    .sub = sub,
                                    .data = (uint8_t *)(uintptr_t)bytes,
                                    .size_bytes = size_bytes};
    const fsn_status status = persist(objects, objects->download, &transfer);
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
             "found vendor 0x%08x product 0x%08x revision 0x%08x, the plan has 0x%08x 0x%08x "
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
        const fsn_status status =
            fsn_objects_write(objects, r.index, r.subindex, value, r.size_bytes, &code);
        if (fsn_is_silent(status)) {
            return note_silence(status, r.index, r.subindex, detail);
        }
        if (status != FSN_OK && code == 0) {
            snprintf(detail, FSN_DETAIL_BYTES, "0x%04x:%02x: an answer that makes no sense",
                     r.index, r.subindex);
        } else if (status != FSN_OK) {
            snprintf(detail, FSN_DETAIL_BYTES, "0x%04x:%02x: abort code 0x%08x %s", r.index,
                     r.subindex, code, fsn_abort_text(code));
        }
        if (status != FSN_OK) {
            return FSN_E_BUS_SDO;
        }
    }
    return FSN_OK;
}

/** Reads the FSoE address of a SubDevice: the expected one if it has it, otherwise its first. */
static fsn_status read_own_address(const struct fsn_objects *objects, uint16_t expected,
                                   uint16_t *found, char detail[FSN_DETAIL_BYTES]) {
    uint8_t bytes[8];
    fsn_status status = fsn_objects_read(objects, FSN_ADDRESSES, 1, bytes, detail);
    *found = fsn_get16(bytes);
    if (status != FSN_OK || *found == expected) {
        return status;
    }
    uint8_t count = 1;
    status = fsn_objects_read(objects, FSN_ADDRESSES, 0, bytes, detail);
    if (status == FSN_OK) {
        count = bytes[0] < MOST_ADDRESSES ? bytes[0] : MOST_ADDRESSES;
    }
    for (uint8_t sub = 2; sub <= count && *found != expected && !fsn_is_silent(status); sub++) {
        status = fsn_objects_read(objects, FSN_ADDRESSES, sub, bytes, detail);
        if (status == FSN_OK && fsn_get16(bytes) == expected) {
            *found = expected;
        }
    }
    return fsn_is_silent(status) ? status : FSN_OK;
}

/** Reads the address of a SubInstance from the parameters of its connection; absent if there is
 *  none before the first connection. */
static fsn_status read_given_address(const struct fsn_plan *plan,
                                     const struct fsn_connection_info *c,
                                     const struct fsn_objects *objects, uint16_t *found,
                                     char detail[FSN_DETAIL_BYTES]) {
    uint8_t bytes[8];
    const struct fsn_copy_info copy = fsn_known_copy(plan, c->copy_to_main);
    const uint16_t object =
        fsn_parameter_object(fsn_object_at(plan, copy.source_sm, 8 * copy.source_byte));
    if (object == 0) {
        return FSN_E_ABSENT;
    }
    FSN_TRY(fsn_objects_read(objects, object, 0, bytes, detail));
    if (bytes[0] < FSN_PARAMETER_WATCHDOG_MS) {
        return FSN_E_ABSENT;
    }
    FSN_TRY(fsn_objects_read(objects, object, FSN_PARAMETER_ADDRESS, bytes, detail));
    *found = fsn_get16(bytes);
    return *found == 0 ? FSN_E_ABSENT : FSN_OK;
}

fsn_status fsn_check_address(const struct fsn_plan *plan, uint32_t subdevice,
                             const struct fsn_objects *objects, bool *readable, uint16_t *found,
                             char detail[FSN_DETAIL_BYTES]) {
    struct fsn_connection_info c;
    *readable = false;
    *found = 0;
    for (uint32_t i = 0; objects != NULL && fsn_plan_connection(plan, i, &c) == FSN_OK; i++) {
        uint16_t address = 0;
        if (c.sub_subdevice != subdevice || (c.known & KNOWN_ADDRESS) == 0) {
            continue;
        }
        fsn_status status = read_own_address(objects, c.address, &address, detail);
        if (status != FSN_OK && !fsn_is_silent(status)) {
            status = read_given_address(plan, &c, objects, &address, detail);
        }
        if (fsn_is_silent(status)) {
            return status;
        }
        *readable = *readable || status == FSN_OK;
        if (status == FSN_OK && address != c.address) {
            snprintf(detail, FSN_DETAIL_BYTES, "it has FSoE address %u, the plan has %u", address,
                     c.address);
            *found = address;
            return FSN_E_BUS_ADDRESS;
        }
    }
    return FSN_OK;
}
