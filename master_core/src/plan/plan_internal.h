/** The plan as loaded, shared by loader and proofs. */
#ifndef FSN_PLAN_INTERNAL_H
#define FSN_PLAN_INTERNAL_H

#include <stdatomic.h>
#include <stdbool.h>

#include "fsn/plan.h"

enum {
    FSN_HEADER_BYTES = 32,
    FSN_ROW_BYTES = 16,
    FSN_SECTIONS = 10,             /**< of format 1.0 */
    FSN_SECTIONS_WITH_SAFETY = 11, /**< of format 1.1 */
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
    FSN_SEC_SAFETY, /**< format 1.1: one record, the hash of the safety functions */
};

struct fsn_plan {
    /** Caller, buses and cores that use it: the last one to let go frees it, so that they may be
     *  freed in any order. */
    atomic_uint holders;
    uint8_t *bytes;
    uint32_t len_bytes;
    uint32_t cycle_ns;
    uint32_t sections;                             /**< 10 or 11 */
    uint32_t offset[FSN_SECTIONS_WITH_SAFETY + 1]; /**< by section number; [0] unused */
    uint32_t count[FSN_SECTIONS_WITH_SAFETY + 1];
};

/** Size of one record of a section, bytes. */
extern const uint32_t fsn_record_bytes[FSN_SECTIONS_WITH_SAFETY + 1];

static inline uint16_t fsn_get16(const uint8_t *p) {
    return (uint16_t)(p[0] | (p[1] << 8));
}

static inline uint32_t fsn_get32(const uint8_t *p) {
    return (uint32_t)p[0] | ((uint32_t)p[1] << 8) | ((uint32_t)p[2] << 16) | ((uint32_t)p[3] << 24);
}

static inline uint64_t fsn_get64(const uint8_t *p) {
    return (uint64_t)fsn_get32(p) | ((uint64_t)fsn_get32(p + 4) << 32);
}

/** First byte of a record; the caller has checked the number. */
static inline const uint8_t *fsn_record(const struct fsn_plan *plan, uint32_t section,
                                        uint32_t number) {
    return plan->bytes + plan->offset[section] + (size_t)number * fsn_record_bytes[section];
}

/* What a record says; the caller knows that there is one of this number. */

static inline struct fsn_subdevice_info fsn_known_subdevice(const struct fsn_plan *plan,
                                                            uint32_t number) {
    struct fsn_subdevice_info info = {0};
    const fsn_status found = fsn_plan_subdevice(plan, number, &info);
    (void)found;
    return info;
}

static inline struct fsn_sm_info fsn_known_sm(const struct fsn_plan *plan, uint32_t number) {
    struct fsn_sm_info info = {0};
    const fsn_status found = fsn_plan_sm(plan, number, &info);
    (void)found;
    return info;
}

static inline struct fsn_symbol_info fsn_known_symbol(const struct fsn_plan *plan,
                                                      uint32_t number) {
    struct fsn_symbol_info info = {0};
    const fsn_status found = fsn_plan_symbol(plan, number, &info);
    (void)found;
    return info;
}

static inline struct fsn_copy_info fsn_known_copy(const struct fsn_plan *plan, uint32_t number) {
    struct fsn_copy_info info = {0};
    const fsn_status found = fsn_plan_copy(plan, number, &info);
    (void)found;
    return info;
}

static inline struct fsn_connection_info fsn_known_connection(const struct fsn_plan *plan,
                                                              uint32_t number) {
    struct fsn_connection_info info = {0};
    const fsn_status found = fsn_plan_connection(plan, number, &info);
    (void)found;
    return info;
}

static inline uint32_t fsn_sm_bits(const struct fsn_plan *plan, uint32_t sm) {
    return fsn_get32(fsn_record(plan, FSN_SEC_SM, sm) + 8);
}

static inline uint32_t fsn_sm_bytes(const struct fsn_plan *plan, uint32_t sm) {
    return (fsn_sm_bits(plan, sm) + 7) / 8;
}

static inline uint8_t fsn_sm_direction(const struct fsn_plan *plan, uint32_t sm) {
    return fsn_record(plan, FSN_SEC_SM, sm)[5];
}

/** What a rule needs to refuse a record. */
struct fsn_at {
    const struct fsn_plan *plan;
    struct fsn_fault *fault;
    uint32_t section, number;
};

/** Refuses the record: `field` is the byte in it, `rule` a static sentence. */
fsn_status fsn_no(const struct fsn_at *at, fsn_status status, uint32_t field, const char *rule);

/** Whether the u32 at `field` is the offset of a string. */
bool fsn_string_ok(const struct fsn_plan *plan, const uint8_t *field);

/** Proves strings, SubDevices, SDOs, sync managers, PDOs and entries. */
fsn_status fsn_prove_layout(const struct fsn_plan *plan, struct fsn_fault *fault);

/** Proves blocks, symbols, copies and connections; the layout must have been proved. */
fsn_status fsn_prove_copies(const struct fsn_plan *plan, struct fsn_fault *fault);

/** How a range of bytes meets the FSoE blocks of its sync manager. */
enum fsn_touch { FSN_TOUCH_NONE, FSN_TOUCH_EXACT, FSN_TOUCH_PART };
enum fsn_touch fsn_touch_of(const struct fsn_plan *plan, uint32_t sm, uint32_t byte, uint32_t size);

/** SHA-256 piece by piece: start, add as often as wanted, end. */
struct fsn_sha256_run {
    uint32_t state[8];
    uint64_t len_bytes;
    size_t kept; /**< bytes of the block that wait for more */
    uint8_t block[64];
};
void fsn_sha256_start(struct fsn_sha256_run *run);
void fsn_sha256_add(struct fsn_sha256_run *run, const void *bytes, size_t len_bytes);
void fsn_sha256_end(struct fsn_sha256_run *run, uint8_t digest[FSN_SHA256_BYTES]);

/** SHA-256 of any bytes. */
void fsn_sha256(const void *bytes, size_t len_bytes, uint8_t digest[FSN_SHA256_BYTES]);

/** Checksum of the first seven words of an SII: CRC-8 with polynomial 0x07 from 0xFF on. */
uint8_t fsn_eeprom_checksum(const uint8_t bytes[14]);

/** Takes a further hold of a plan; fsn_plan_free() lets go. */
void fsn_plan_hold(const struct fsn_plan *plan);

/** Fills a fault (may be NULL) and returns its status; `rule` NULL stands for the status text. */
fsn_status fsn_refuse(struct fsn_fault *fault, fsn_status status, uint32_t section, uint32_t record,
                      uint32_t byte, const char *rule);

/** The same for what concerns no record. */
static inline fsn_status fsn_refuse_all(struct fsn_fault *fault, fsn_status status,
                                        const char *rule) {
    return fsn_refuse(fault, status, 0, FSN_FAULT_NO_RECORD, 0, rule);
}

#endif
