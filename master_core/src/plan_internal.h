/** The plan as loaded, shared by loader and proofs. */
#ifndef FSN_PLAN_INTERNAL_H
#define FSN_PLAN_INTERNAL_H

#include "fsn/plan.h"

enum {
    FSN_HEADER_BYTES = 32,
    FSN_ROW_BYTES = 16,
    FSN_SECTIONS = 10,
};

enum fsn_section {
    FSN_SEC_SUBDEVICE = 1,
    FSN_SEC_SM,
    FSN_SEC_PDO,
    FSN_SEC_ENTRY,
    FSN_SEC_SDO,
    FSN_SEC_SYMBOL,
    FSN_SEC_BLOCK,
    FSN_SEC_COPY,
    FSN_SEC_CONNECTION,
    FSN_SEC_STRINGS,
};

struct fsn_plan {
    uint8_t *bytes;
    uint32_t len_bytes;
    uint32_t cycle_ns;
    uint32_t offset[FSN_SECTIONS + 1]; /**< by section number; [0] unused */
    uint32_t count[FSN_SECTIONS + 1];
};

/** Size of one record of a section, bytes. */
extern const uint32_t fsn_record_bytes[FSN_SECTIONS + 1];

static inline uint16_t fsn_get16(const uint8_t *p) {
    return (uint16_t)(p[0] | (p[1] << 8));
}

static inline uint32_t fsn_get32(const uint8_t *p) {
    return (uint32_t)p[0] | ((uint32_t)p[1] << 8) | ((uint32_t)p[2] << 16) | ((uint32_t)p[3] << 24);
}

/** First byte of a record; the caller has checked the number. */
static inline const uint8_t *fsn_record(const struct fsn_plan *plan, uint32_t section,
                                        uint32_t number) {
    return plan->bytes + plan->offset[section] + (size_t)number * fsn_record_bytes[section];
}

/** Proves every rule of the plan format but those of header and section table. */
fsn_status fsn_plan_prove(const struct fsn_plan *plan, struct fsn_fault *fault);

/** Fills a fault (may be NULL) and returns its status. */
fsn_status fsn_refuse(struct fsn_fault *fault, fsn_status status, uint32_t section, uint32_t record,
                      uint32_t byte);

#endif
