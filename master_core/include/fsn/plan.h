/** Plans: bytes of a .fsnplan file, treated as hostile input and verified before anything is
 *  copied. Layout: docs/reference/plan-format.md. */
#ifndef FSN_PLAN_H
#define FSN_PLAN_H

#include <stddef.h>
#include <stdint.h>

#include "fsn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/** No record, no place. */
#define FSN_NONE 0xFFFFFFFFu
enum { FSN_OUTPUT = 1, FSN_INPUT = 2 };
enum { FSN_COPY_FSOE = 1, FSN_COPY_STANDARD = 2 };
enum { FSN_MAX_SM_BITS = 11888, FSN_MAX_DATAGRAM_BYTES = 1486 };
enum { FSN_SHA256_BYTES = 32 };

/** Interpretation of the bits of an entry. */
enum fsn_kind {
    FSN_KIND_BITS = 0,
    FSN_KIND_BOOL = 1,
    FSN_KIND_SIGNED = 2,
    FSN_KIND_UNSIGNED = 3,
    FSN_KIND_REAL = 4 /**< IEEE 754, 32 or 64 bits */
};

struct fsn_plan;

/** A SubDevice of the plan. */
struct fsn_subdevice_info {
    const char *name;
    uint32_t vendor_id, product_code, revision_low, revision_high;
    uint32_t first_sm, sm_count, first_sdo, sdo_count;
    uint16_t alias, position, assign_activate;
    uint8_t in_copy;
};

/** A sync manager; sizes in bits, size_bytes rounds up. */
struct fsn_sm_info {
    uint32_t subdevice, bits, size_bytes, first_pdo, pdo_count;
    uint8_t index, direction, watchdog, registered;
};

/** A named entry of ordinary process data. */
struct fsn_symbol_info {
    const char *name;
    uint32_t sm, bit_offset;
    uint16_t bits;
    uint8_t kind; /**< enum fsn_kind */
    uint8_t output, restart_relevant;
    uint64_t stop_value;   /**< raw value of an output without a writer; 0 for inputs */
    double factor, offset; /**< value of an input: factor * raw + offset; raw of an output: factor *
                              value + offset; finite, factor not 0 */
};

/** A recognised FSoE frame. */
struct fsn_block_info {
    uint32_t sm, byte_offset;
    uint16_t frame_bytes, safe_bytes;
    uint8_t copied;
};

/** A copy; offsets are relative to the sync manager's process data. */
struct fsn_copy_info {
    const char *net;
    uint32_t source_sm, source_byte, destination_sm, destination_byte, size_bytes, connection;
    uint16_t kind;
};

/** A connection: two opposite copies between a MainInstance and a SubInstance. */
struct fsn_connection_info {
    const char *name, *net;
    uint32_t main_subdevice, sub_subdevice, copy_to_sub, copy_to_main;
    uint16_t connection_id, address, watchdog_ms, known; /**< known: bit 0, 1, 2 in this order */
    uint16_t safe_to_sub, safe_to_main;
    uint16_t app_bytes; /**< length of the application parameters; known: bit 3 */
    uint32_t app_crc;   /**< CRC-32 (IEEE 802.3) of these */
};

/** One of the buses of a plan; the SubDevices of a bus are consecutive. */
struct fsn_bus_info {
    const char *name;  /**< empty if there is only one */
    uint32_t cycle_ns; /**< 0: not stated */
    uint32_t first_subdevice, subdevice_count;
};

/** SubDevices that may be absent: consecutive in the plan and on the bus, after the first, which
 *  has an alias. */
struct fsn_group_info {
    const char *name;
    const char *place; /**< groups of one place are never present together; empty: no place */
    uint32_t first_subdevice, subdevice_count;
};

/** Copies and proves a plan.
 *  @param[in]  bytes       file content; not needed after the call.
 *  @param[in]  len_bytes   its length.
 *  @param[out] plan        the plan, to be freed by fsn_plan_free(); NULL on refusal.
 *  @param[out] fault       where and why it was refused; may be NULL.
 *  @retval FSN_E_PLAN_…, FSN_E_COPY_…  a rule of the plan format is broken; nothing was kept.
 *  Memory: len_bytes plus a small constant. Time: O(len_bytes + records * log(blocks)).
 *  Context: set-up. Allocates. */
FSN_API FSN_MUST_USE fsn_status fsn_plan_load(const void *bytes, size_t len_bytes,
                                              struct fsn_plan **plan, struct fsn_fault *fault);

/** Releases a plan; NULL is allowed. Buses and cores made from it keep a reference, so all of them
 *  may be freed in any order. Context: set-up. */
FSN_API void fsn_plan_free(struct fsn_plan *plan);

/** SHA-256 of the loaded plan, calculated from the bytes of its records. It equals that of the file
 *  unless the file has changed since. Context: any thread. Cost: O(length). */
FSN_API void fsn_plan_sha256(const struct fsn_plan *plan, uint8_t digest[FSN_SHA256_BYTES]);

/** The sections of a fingerprint, in the order of the total hash. */
enum {
    FSN_FINGERPRINT_DEVICES,
    FSN_FINGERPRINT_PROCESS_DATA,
    FSN_FINGERPRINT_COPIES,
    FSN_FINGERPRINT_CONNECTIONS,
    FSN_FINGERPRINT_CYCLE,
    FSN_FINGERPRINT_SAFETY_FUNCTIONS,
    FSN_FINGERPRINT_SECTIONS,
};

/** Name and version of the text that is hashed. */
#define FSN_FINGERPRINT_FORM "fsoe-net fingerprint 2"

/** SHA-256 of each section and of the whole; input: docs/reference/fingerprint.md. */
struct fsn_fingerprint {
    uint8_t whole[FSN_SHA256_BYTES];
    uint8_t section[FSN_FINGERPRINT_SECTIONS][FSN_SHA256_BYTES];
};

/** Bytes of the short code, "A1B2 C3D4 E5F6 0718" and a zero byte. */
enum { FSN_FINGERPRINT_CODE_BYTES = 20 };

/** Fingerprint of everything safety-relevant in a plan, calculated from the loaded tables. Only the
 *  hash of the safety functions is taken from the plan, which does not contain their text.
 *  @retval FSN_E_ARG    an argument is NULL.
 *  @retval FSN_E_NOMEM  no memory for the order of connections and symbols.
 *  Memory: 4 bytes per connection and symbol, freed afterwards. Time: O(records * log(symbols)).
 *  Context: set-up, any thread. Allocates. */
FSN_API FSN_MUST_USE fsn_status fsn_plan_fingerprint(const struct fsn_plan *plan,
                                                     struct fsn_fingerprint *fingerprint);

/** Name of a section such as "process_data", "?" for an unknown number. Context: any thread. */
FSN_API const char *fsn_fingerprint_section(uint32_t section);

/** Writes the short code that people compare: the first 16 hexadecimal digits of the whole.
 *  Context: any thread. */
FSN_API void fsn_fingerprint_code(const struct fsn_fingerprint *fingerprint,
                                  char code[FSN_FINGERPRINT_CODE_BYTES]);

/** Bus cycle in nanoseconds; 0 if the plan does not state it. Context: any thread. */
FSN_API uint32_t fsn_plan_cycle_ns(const struct fsn_plan *plan);

/** Number of buses, at least 1. The first bus has the shortest cycle, which is that of the plan.
 *  Context: any thread. */
FSN_API uint32_t fsn_plan_bus_count(const struct fsn_plan *plan);

/** One of the buses.   @retval FSN_E_ARG  unknown bus.   Context: any thread. */
FSN_API FSN_MUST_USE fsn_status fsn_plan_bus(const struct fsn_plan *plan, uint32_t number,
                                             struct fsn_bus_info *info);

/** Number of the bus that a SubDevice of the plan is on. Context: any thread. */
FSN_API uint32_t fsn_plan_bus_of(const struct fsn_plan *plan, uint32_t subdevice);

/** Number of the group of a SubDevice of the plan; FSN_NONE: it is always present. Context: any
 *  thread. */
FSN_API uint32_t fsn_plan_group_of(const struct fsn_plan *plan, uint32_t subdevice);

/** Creates the plan of one bus: only its SubDevices, and the copies between them. Their numbers
 *  begin at 0, as do those of sync managers, symbols, copies and connections.
 *  @param[out] part  to be freed by fsn_plan_free(); NULL on refusal. For a plan with one bus
 *                    it is the plan itself, with one more reference.
 *  @retval FSN_E_ARG    unknown bus.   @retval FSN_E_NOMEM  out of memory.
 *  Context: set-up. Allocates. */
FSN_API FSN_MUST_USE fsn_status fsn_plan_part(const struct fsn_plan *plan, uint32_t bus,
                                              struct fsn_plan **part);

/** Numbers of records. Context: any thread. */
FSN_API uint32_t fsn_plan_subdevice_count(const struct fsn_plan *plan);
FSN_API uint32_t fsn_plan_sm_count(const struct fsn_plan *plan);
FSN_API uint32_t fsn_plan_symbol_count(const struct fsn_plan *plan);
FSN_API uint32_t fsn_plan_block_count(const struct fsn_plan *plan);
FSN_API uint32_t fsn_plan_copy_count(const struct fsn_plan *plan);
FSN_API uint32_t fsn_plan_connection_count(const struct fsn_plan *plan);
FSN_API uint32_t fsn_plan_group_count(const struct fsn_plan *plan);

/** Decode one record.
 *  @retval FSN_E_ARG  no record of that number.
 *  Names point into the plan and live as long as it. Context: any thread. */
FSN_API FSN_MUST_USE fsn_status fsn_plan_subdevice(const struct fsn_plan *plan, uint32_t number,
                                                   struct fsn_subdevice_info *info);
FSN_API FSN_MUST_USE fsn_status fsn_plan_sm(const struct fsn_plan *plan, uint32_t number,
                                            struct fsn_sm_info *info);
FSN_API FSN_MUST_USE fsn_status fsn_plan_symbol(const struct fsn_plan *plan, uint32_t number,
                                                struct fsn_symbol_info *info);
FSN_API FSN_MUST_USE fsn_status fsn_plan_block(const struct fsn_plan *plan, uint32_t number,
                                               struct fsn_block_info *info);
FSN_API FSN_MUST_USE fsn_status fsn_plan_copy(const struct fsn_plan *plan, uint32_t number,
                                              struct fsn_copy_info *info);
FSN_API FSN_MUST_USE fsn_status fsn_plan_connection(const struct fsn_plan *plan, uint32_t number,
                                                    struct fsn_connection_info *info);
FSN_API FSN_MUST_USE fsn_status fsn_plan_group(const struct fsn_plan *plan, uint32_t number,
                                               struct fsn_group_info *info);

#ifdef __cplusplus
}
#endif

#endif
