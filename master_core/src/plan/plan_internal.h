/** The loaded plan, shared by loader and proofs. */
#ifndef FSN_PLAN_INTERNAL_H
#define FSN_PLAN_INTERNAL_H

#include <stdatomic.h>
#include <stdbool.h>

#include "fsn/monitor.h"
#include "fsn/plan.h"
#include "plan/records.h"
#include "plan/try.h"
#include "rt/bytes.h"

enum {
    FSN_HEADER_BYTES = 32,
    FSN_ROW_BYTES = 16,
    FSN_SECTIONS = 10,             /**< of format 1.0 */
    FSN_SECTIONS_WITH_SAFETY = 11, /**< of format 1.1 */
    FSN_SECTIONS_WITH_BUSES = 12,  /**< of format 1.2 */
    FSN_SECTIONS_WITH_GROUPS = 13, /**< of format 1.3 */
};

enum fsn_section {
#define FSN_SECTION(name, number, size_bytes) FSN_SEC_##name = (number),
    FSN_SECTION_TABLE(FSN_SECTION)
#undef FSN_SECTION
};

struct fsn_plan {
    /** References of caller, buses and cores: the last one frees it, so that they may be freed in
     *  any order. */
    atomic_uint holders;
    uint8_t *bytes;
    uint32_t len_bytes;
    uint32_t cycle_ns;
    uint32_t sections;                             /**< 10 to 13 */
    uint32_t offset[FSN_SECTIONS_WITH_GROUPS + 1]; /**< by section number; [0] unused */
    uint32_t count[FSN_SECTIONS_WITH_GROUPS + 1];  /**< 0 for missing sections */
};

/** Size of one record of a section, bytes. */
extern const uint32_t fsn_record_bytes[FSN_SECTIONS_WITH_GROUPS + 1];

/** First byte of a record; the caller must have checked the number. */
static inline const uint8_t *fsn_record(const struct fsn_plan *plan, uint32_t section,
                                        uint32_t number) {
    return plan->bytes + plan->offset[section] + (size_t)number * fsn_record_bytes[section];
}

/* A record with its fields by name: struct fsn_sm_record fsn_read_sm(plan, number), and so on.
 * Names are offsets of strings, floating point its bits. FSN_AT(sm, bits) is the first byte of a
 * field. */
typedef uint8_t fsn_u8;
typedef uint16_t fsn_u16;
typedef uint32_t fsn_u32;
typedef uint64_t fsn_u64;
#define fsn_load_u8(at) ((at)[0])
#define fsn_load_u16 fsn_get16
#define fsn_load_u32 fsn_get32
#define fsn_load_u64 fsn_get64
#define FSN_AT(record, field) fsn_at_##record##_##field
#define FSN_MEMBER(record, type, field, at) fsn_##type field;
#define FSN_PLACE(record, type, field, at) FSN_AT(record, field) = (at),
#define FSN_LOAD(record, type, field, at) .field = fsn_load_##type(r + (at)),
#define FSN_RECORD(record, RECORD)                                                                 \
    struct fsn_##record##_record {                                                                 \
        FSN_##RECORD##_FIELDS(FSN_MEMBER)                                                          \
    };                                                                                             \
    enum { FSN_##RECORD##_FIELDS(FSN_PLACE) };                                                     \
    static inline struct fsn_##record##_record fsn_read_##record(const struct fsn_plan *plan,      \
                                                                 uint32_t number) {                \
        const uint8_t *r = fsn_record(plan, FSN_SEC_##RECORD, number);                             \
        return (struct fsn_##record##_record){FSN_##RECORD##_FIELDS(FSN_LOAD)};                    \
    }
FSN_RECORD(subdevice, SUBDEVICE)
FSN_RECORD(sm, SM)
FSN_RECORD(pdo, PDO)
FSN_RECORD(entry, ENTRY)
FSN_RECORD(sdo, SDO)
FSN_RECORD(symbol, SYMBOL)
FSN_RECORD(block, BLOCK)
FSN_RECORD(copy, COPY)
FSN_RECORD(connection, CONNECTION)
FSN_RECORD(bus, BUS)
FSN_RECORD(group, GROUP)
#undef FSN_RECORD

/* Decodes a record, for callers that have already checked its number. */
#define FSN_KNOWN(record)                                                                          \
    static inline struct fsn_##record##_info fsn_known_##record(const struct fsn_plan *plan,       \
                                                                uint32_t number) {                 \
        struct fsn_##record##_info info = {0};                                                     \
        const fsn_status found = fsn_plan_##record(plan, number, &info);                           \
        (void)found;                                                                               \
        return info;                                                                               \
    }
FSN_KNOWN(subdevice)
FSN_KNOWN(sm)
FSN_KNOWN(symbol)
FSN_KNOWN(copy)
FSN_KNOWN(connection)
FSN_KNOWN(group)
#undef FSN_KNOWN

/** Planned parameters of a connection. */
static inline struct fsn_parameters fsn_planned_parameters(const struct fsn_connection_info *info) {
    return (struct fsn_parameters){.known = info->known,
                                   .connection_id = info->connection_id,
                                   .address = info->address,
                                   .watchdog_ms = info->watchdog_ms,
                                   .app_bytes = info->app_bytes,
                                   .app_crc = info->app_crc};
}

/** Entries of a sync manager: from the first to before `*end`. Proved: consecutive PDO by PDO. */
static inline uint32_t fsn_sm_entries(const struct fsn_plan *plan, uint32_t sm, uint32_t *end) {
    const struct fsn_sm_record r = fsn_read_sm(plan, sm);
    *end = 0;
    if (r.pdo_count == 0) {
        return 0;
    }
    const struct fsn_pdo_record last = fsn_read_pdo(plan, r.first_pdo + r.pdo_count - 1);
    *end = last.first_entry + last.entry_count;
    return fsn_read_pdo(plan, r.first_pdo).first_entry;
}

/** The bytes of a start-up SDO's value, as sent. */
static inline const uint8_t *fsn_sdo_value(const struct fsn_plan *plan, uint32_t number) {
    return fsn_record(plan, FSN_SEC_SDO, number) + FSN_AT(sdo, value);
}

static inline uint32_t fsn_sm_bytes(const struct fsn_plan *plan, uint32_t sm) {
    return (fsn_read_sm(plan, sm).bits + 7) / 8;
}

/** Data that a rule needs to refuse a record. */
struct fsn_at {
    const struct fsn_plan *plan;
    struct fsn_fault *fault;
    uint32_t section, number;
};

/** Refuses the record: `field` is the byte in it, `rule` a static sentence. */
fsn_status fsn_refuse_at(const struct fsn_at *at, fsn_status status, uint32_t field,
                         const char *rule);

/** Whether this is the offset of a string. */
bool fsn_string_ok(const struct fsn_plan *plan, uint32_t offset);

/** A string whose reference has been proved; the table ends in zero. */
static inline const char *fsn_string(const struct fsn_plan *plan, uint32_t offset) {
    return (const char *)plan->bytes + plan->offset[FSN_SEC_STRINGS] + offset;
}

/** Proves strings, SubDevices, SDOs, sync managers, PDOs and entries. */
fsn_status fsn_prove_layout(const struct fsn_plan *plan, struct fsn_fault *fault);

/** Proves blocks, symbols, copies and connections; the layout must have been proved. */
fsn_status fsn_prove_copies(const struct fsn_plan *plan, struct fsn_fault *fault);

/** Overlap of a range of bytes with the FSoE blocks of its sync manager. */
enum fsn_overlap { FSN_OVERLAP_NONE, FSN_OVERLAP_EXACT, FSN_OVERLAP_PART };
enum fsn_overlap fsn_overlap_of(const struct fsn_plan *plan, uint32_t sm, uint32_t byte,
                                uint32_t size);

/** Name of the SubDevice of a symbol. */
static inline const char *fsn_symbol_subdevice(const struct fsn_plan *plan,
                                               const struct fsn_symbol_info *symbol) {
    return fsn_known_subdevice(plan, fsn_known_sm(plan, symbol->sm).subdevice).name;
}

/** The entry that is exactly this symbol; index 0: the symbol is only a part of an entry. */
struct fsn_entry_record fsn_symbol_object(const struct fsn_plan *plan,
                                          const struct fsn_symbol_info *symbol);

/** Whether a copy writes a byte of this symbol. */
bool fsn_is_copied(const struct fsn_plan *plan, const struct fsn_symbol_info *symbol);

/** Incremental SHA-256: start, add any number of times, end. */
struct fsn_sha256_run {
    uint32_t state[8];
    uint64_t len_bytes;
    size_t kept; /**< bytes of an incomplete block */
    uint8_t block[64];
};
void fsn_sha256_start(struct fsn_sha256_run *run);
void fsn_sha256_add(struct fsn_sha256_run *run, const void *bytes, size_t len_bytes);
void fsn_sha256_end(struct fsn_sha256_run *run, uint8_t digest[FSN_SHA256_BYTES]);

/** SHA-256 of any bytes. */
void fsn_sha256(const void *bytes, size_t len_bytes, uint8_t digest[FSN_SHA256_BYTES]);

/** SHA-256 of a file, from its beginning.   @return 0, or errno. */
int fsn_sha256_file(int fd, uint8_t digest[FSN_SHA256_BYTES]);

/** Checksum of the first seven words of an SII: CRC-8 with polynomial 0x07, initial value 0xFF. */
uint8_t fsn_eeprom_checksum(const uint8_t bytes[14]);

/** Whether a SubDevice is present at the start of an emulation: of the groups of one place only the
 *  first one is. */
bool fsn_plan_is_first_choice(const struct fsn_plan *plan, uint32_t subdevice);

/** Takes another reference to a plan; fsn_plan_free() releases it. */
void fsn_plan_hold(const struct fsn_plan *plan);

/** Fills a fault (may be NULL) and returns its status; `rule` NULL means the status text. */
fsn_status fsn_refuse(struct fsn_fault *fault, fsn_status status, uint32_t section, uint32_t record,
                      uint32_t byte, const char *rule);

/** The same for faults without a record. */
static inline fsn_status fsn_refuse_all(struct fsn_fault *fault, fsn_status status,
                                        const char *rule) {
    return fsn_refuse(fault, status, 0, FSN_FAULT_NO_RECORD, 0, rule);
}

#endif
