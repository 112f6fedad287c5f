#include "plan/plan_internal.h"

#include <stdlib.h>
#include <string.h>

static const uint8_t magic[8] = {'F', 'S', 'N', 'P', 'L', 'A', 'N', 0};

const uint32_t fsn_record_bytes[FSN_SECTIONS_WITH_GROUPS + 1] = {
#define FSN_BYTES(name, number, size_bytes) [number] = (size_bytes),
    FSN_SECTION_TABLE(FSN_BYTES)
#undef FSN_BYTES
};

fsn_status fsn_refuse(struct fsn_fault *fault, fsn_status status, uint32_t section, uint32_t record,
                      uint32_t byte, const char *rule) {
    if (fault != NULL) {
        *fault = (struct fsn_fault){
            .status = status,
            .section = section,
            .copy_index = record,
            .byte = byte,
            .rule = rule != NULL ? rule : fsn_status_text(status),
        };
    }
    return status;
}

/** CRC-32 of IEEE 802.3 with four bytes at `hole` treated as zero. Building the table takes 2 048
 *  steps per plan and saves a constant in the library. */
static uint32_t crc32_with_hole(const uint8_t *bytes, uint32_t len, uint32_t hole) {
    uint32_t table[256];
    for (uint32_t n = 0; n < 256; n++) {
        table[n] = fsn_crc32_step(n, 0);
    }
    uint32_t crc = 0xFFFFFFFFu;
    for (uint32_t i = 0; i < len; i++) {
        const uint8_t byte =
            (i - hole < 4) ? 0 : bytes[i]; /* before the hole this wraps: above 4 */
        crc = (crc >> 8) ^ table[(crc ^ byte) & 0xFFu];
    }
    return ~crc;
}

static fsn_status check_header(const uint8_t *b, size_t len, struct fsn_fault *fault) {
    if (len < FSN_HEADER_BYTES + FSN_SECTIONS * FSN_ROW_BYTES) {
        return fsn_refuse_all(fault, FSN_E_PLAN_LENGTH, "shorter than header and section table");
    }
    if (memcmp(b, magic, sizeof magic) != 0) {
        return fsn_refuse(fault, FSN_E_PLAN_MAGIC, 0, FSN_FAULT_NO_RECORD, 0, NULL);
    }
    if (fsn_get16(b + 8) != 1) {
        return fsn_refuse(fault, FSN_E_PLAN_VERSION, 0, FSN_FAULT_NO_RECORD, 8, NULL);
    }
    if (len > 0x7FFFFFFFu || fsn_get32(b + 12) != len) {
        return fsn_refuse(fault, FSN_E_PLAN_LENGTH, 0, FSN_FAULT_NO_RECORD, 12,
                          "the stated length is not that of the file");
    }
    if (fsn_get32(b + 16) != crc32_with_hole(b, (uint32_t)len, 16)) {
        return fsn_refuse(fault, FSN_E_PLAN_CRC, 0, FSN_FAULT_NO_RECORD, 16, NULL);
    }
    const uint32_t minor = fsn_get16(b + 10);
    if (minor > FSN_SECTIONS_WITH_GROUPS - FSN_SECTIONS) {
        return fsn_refuse(fault, FSN_E_PLAN_VERSION, 0, FSN_FAULT_NO_RECORD, 10, NULL);
    }
    if (fsn_get32(b + 24) != FSN_SECTIONS + minor) {
        return fsn_refuse(fault, FSN_E_PLAN_SECTION, 0, FSN_FAULT_NO_RECORD, 24,
                          "the number of sections is not 10 to 13 (format 1.0 to 1.3)");
    }
    if (len < FSN_HEADER_BYTES + fsn_get32(b + 24) * FSN_ROW_BYTES) {
        return fsn_refuse_all(fault, FSN_E_PLAN_LENGTH, "shorter than header and section table");
    }
    if (fsn_get32(b + 28) != 0) {
        return fsn_refuse(fault, FSN_E_PLAN_RESERVED, 0, FSN_FAULT_NO_RECORD, 28,
                          "the reserved field of the header is not zero");
    }
    return FSN_OK;
}

/** Bytes from `from` to `to` that must be zero: the next section starts at a multiple of 4. */
static fsn_status check_gap(const struct fsn_plan *plan, uint32_t section, uint64_t from,
                            uint64_t to, struct fsn_fault *fault) {
    for (uint64_t i = from; i < to && i < plan->len_bytes; i++) {
        if (plan->bytes[i] != 0) {
            return fsn_refuse(fault, FSN_E_PLAN_RESERVED, section, FSN_FAULT_NO_RECORD, (uint32_t)i,
                              "bytes between two sections are not zero");
        }
    }
    return FSN_OK;
}

/** Whether the count of records is valid; sections of newer formats must not be empty. */
static bool is_count_ok(const struct fsn_plan *plan, uint32_t section, uint32_t count) {
    if (section == FSN_SEC_SAFETY) {
        return count == 1 || (count == 0 && plan->sections >= FSN_SECTIONS_WITH_BUSES);
    }
    if (section == FSN_SEC_GROUP) {
        return count > 0;
    }
    /* Groups are only possible on a single bus. */
    return section != FSN_SEC_BUS ||
           (plan->sections == FSN_SECTIONS_WITH_GROUPS ? count == 0 : count > 1);
}

/** Sections are consecutive and in order, without gaps except zero bytes up to a multiple of 4. */
static fsn_status read_sections(struct fsn_plan *plan, struct fsn_fault *fault) {
    uint64_t expected = FSN_HEADER_BYTES + plan->sections * FSN_ROW_BYTES;
    for (uint32_t s = 1; s <= plan->sections; s++) {
        const uint32_t at = FSN_HEADER_BYTES + (s - 1) * FSN_ROW_BYTES;
        const uint8_t *row = plan->bytes + at;
        const uint32_t offset = fsn_get32(row + 4);
        const uint32_t count = fsn_get32(row + 8);
        const uint64_t end = (uint64_t)offset + (uint64_t)count * fsn_record_bytes[s];
        if (fsn_get32(row) != s || offset != expected || end > plan->len_bytes ||
            fsn_get32(row + 12) != fsn_record_bytes[s] || !is_count_ok(plan, s, count)) {
            return fsn_refuse(fault, FSN_E_PLAN_SECTION, s, FSN_FAULT_NO_RECORD, at,
                              "a row of the section table has a wrong kind, place or size");
        }
        plan->offset[s] = offset;
        plan->count[s] = count;
        expected = s < plan->sections ? (end + 3) & ~(uint64_t)3 : end;
        FSN_TRY(check_gap(plan, s, end, expected, fault));
    }
    if (expected != plan->len_bytes) {
        return fsn_refuse(fault, FSN_E_PLAN_LENGTH, plan->sections, FSN_FAULT_NO_RECORD,
                          (uint32_t)expected, "the last section does not end the file");
    }
    return FSN_OK;
}

fsn_status fsn_plan_load(const void *bytes, size_t len_bytes, struct fsn_plan **out,
                         struct fsn_fault *fault) {
    if (out == NULL) {
        return fsn_refuse_all(fault, FSN_E_ARG, NULL);
    }
    *out = NULL;
    if (bytes == NULL) {
        return fsn_refuse_all(fault, FSN_E_ARG, NULL);
    }
    FSN_TRY(check_header(bytes, len_bytes, fault));
    struct fsn_plan *plan = calloc(1, sizeof *plan);
    uint8_t *copy = malloc(len_bytes);
    if (plan == NULL || copy == NULL) {
        free(plan);
        free(copy);
        return fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
    }
    memcpy(copy, bytes, len_bytes);
    atomic_init(&plan->holders, 1);
    plan->bytes = copy;
    plan->len_bytes = (uint32_t)len_bytes;
    plan->cycle_ns = fsn_get32(copy + 20);
    plan->sections = fsn_get32(copy + 24);
    fsn_status status = read_sections(plan, fault);
    if (status == FSN_OK) {
        status = fsn_prove_layout(plan, fault);
    }
    if (status == FSN_OK) {
        status = fsn_prove_copies(plan, fault);
    }
    if (status != FSN_OK) {
        fsn_plan_free(plan);
        return status;
    }
    *out = plan;
    return FSN_OK;
}

void fsn_plan_hold(const struct fsn_plan *plan) {
    /* The count is not covered by const; every plan comes from calloc. */
    atomic_fetch_add_explicit(&((struct fsn_plan *)plan)->holders, 1, memory_order_relaxed);
}

void fsn_plan_free(struct fsn_plan *plan) {
    if (plan != NULL && atomic_fetch_sub_explicit(&plan->holders, 1, memory_order_acq_rel) == 1) {
        free(plan->bytes);
        free(plan);
    }
}

uint32_t fsn_plan_cycle_ns(const struct fsn_plan *plan) {
    return plan->cycle_ns;
}

uint32_t fsn_plan_bus_count(const struct fsn_plan *plan) {
    return plan->count[FSN_SEC_BUS] > 0 ? plan->count[FSN_SEC_BUS] : 1;
}

fsn_status fsn_plan_bus(const struct fsn_plan *plan, uint32_t number, struct fsn_bus_info *info) {
    if (number >= fsn_plan_bus_count(plan)) {
        return FSN_E_ARG;
    }
    *info = (struct fsn_bus_info){
        .name = "", .cycle_ns = plan->cycle_ns, .subdevice_count = plan->count[FSN_SEC_SUBDEVICE]};
    if (plan->count[FSN_SEC_BUS] > 0) {
        const struct fsn_bus_record r = fsn_read_bus(plan, number);
        *info = (struct fsn_bus_info){.name = fsn_string(plan, r.name),
                                      .cycle_ns = r.cycle_ns,
                                      .first_subdevice = r.first_subdevice,
                                      .subdevice_count = r.subdevice_count};
    }
    return FSN_OK;
}

uint32_t fsn_plan_bus_of(const struct fsn_plan *plan, uint32_t subdevice) {
    uint32_t number = 0;
    for (uint32_t n = 1; n < plan->count[FSN_SEC_BUS]; n++) {
        number += subdevice >= fsn_read_bus(plan, n).first_subdevice;
    }
    return number;
}

#define FSN_COUNT(record, RECORD)                                                                  \
    uint32_t fsn_plan_##record##_count(const struct fsn_plan *plan) {                              \
        return plan->count[FSN_SEC_##RECORD];                                                      \
    }
FSN_COUNT(subdevice, SUBDEVICE)
FSN_COUNT(sm, SM)
FSN_COUNT(symbol, SYMBOL)
FSN_COUNT(block, BLOCK)
FSN_COUNT(copy, COPY)
FSN_COUNT(connection, CONNECTION)
FSN_COUNT(group, GROUP)
#undef FSN_COUNT

/** Decodes a record into what the public functions give about it: `r` is the record. */
#define FSN_INFO(record, RECORD, ...)                                                              \
    fsn_status fsn_plan_##record(const struct fsn_plan *plan, uint32_t number,                     \
                                 struct fsn_##record##_info *info) {                               \
        if (number >= plan->count[FSN_SEC_##RECORD]) {                                             \
            return FSN_E_ARG;                                                                      \
        }                                                                                          \
        const struct fsn_##record##_record r = fsn_read_##record(plan, number);                    \
        *info = (struct fsn_##record##_info){__VA_ARGS__};                                         \
        return FSN_OK;                                                                             \
    }

FSN_INFO(group, GROUP, .name = fsn_string(plan, r.name), .place = fsn_string(plan, r.place),
         .first_subdevice = r.first_subdevice, .subdevice_count = r.subdevice_count)

uint32_t fsn_plan_group_of(const struct fsn_plan *plan, uint32_t subdevice) {
    for (uint32_t n = 0; n < plan->count[FSN_SEC_GROUP]; n++) {
        const struct fsn_group_record r = fsn_read_group(plan, n);
        if (subdevice >= r.first_subdevice && subdevice - r.first_subdevice < r.subdevice_count) {
            return n;
        }
    }
    return FSN_NONE;
}

bool fsn_plan_is_first_choice(const struct fsn_plan *plan, uint32_t subdevice) {
    const uint32_t group = fsn_plan_group_of(plan, subdevice);
    if (group == FSN_NONE) {
        return true;
    }
    const char *place = fsn_string(plan, fsn_read_group(plan, group).place);
    for (uint32_t n = 0; n < group && *place != 0; n++) {
        if (strcmp(fsn_string(plan, fsn_read_group(plan, n).place), place) == 0) {
            return false;
        }
    }
    return true;
}

FSN_INFO(subdevice, SUBDEVICE, .name = fsn_string(plan, r.name), .alias = r.alias,
         .position = r.position, .vendor_id = r.vendor_id, .product_code = r.product_code,
         .revision_low = r.revision_low, .revision_high = r.revision_high, .first_sm = r.first_sm,
         .sm_count = r.sm_count, .first_sdo = r.first_sdo, .sdo_count = r.sdo_count,
         .assign_activate = r.assign_activate, .in_copy = (uint8_t)(r.in_copy & 1u))

FSN_INFO(sm, SM, .subdevice = r.subdevice, .index = r.index, .direction = r.direction,
         .watchdog = r.watchdog, .registered = r.registered & 1u, .bits = r.bits,
         .size_bytes = (r.bits + 7) / 8, .first_pdo = r.first_pdo, .pdo_count = r.pdo_count)

static double real_of(uint64_t bits) {
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

FSN_INFO(symbol, SYMBOL, .name = fsn_string(plan, r.name), .sm = r.sm, .bit_offset = r.bit_offset,
         .bits = r.bits, .kind = r.kind, .output = r.flags & 1u,
         .restart_relevant = (r.flags >> 1) & 1u, .stop_value = r.stop_value,
         .factor = real_of(r.factor), .offset = real_of(r.offset))

struct fsn_entry_record fsn_symbol_object(const struct fsn_plan *plan,
                                          const struct fsn_symbol_info *symbol) {
    uint32_t behind;
    for (uint32_t n = fsn_sm_entries(plan, symbol->sm, &behind); n < behind; n++) {
        const struct fsn_entry_record entry = fsn_read_entry(plan, n);
        if (entry.bit_offset == symbol->bit_offset && entry.bits == symbol->bits) {
            return entry;
        }
    }
    return (struct fsn_entry_record){0};
}

FSN_INFO(block, BLOCK, .sm = r.sm, .byte_offset = r.byte_offset, .frame_bytes = r.frame_bytes,
         .safe_bytes = r.safe_bytes, .copied = (uint8_t)(r.copied & 1u))

FSN_INFO(copy, COPY, .source_sm = r.source_sm, .source_byte = r.source_bit / 8,
         .destination_sm = r.destination_sm, .destination_byte = r.destination_bit / 8,
         .size_bytes = r.bits / 8, .net = fsn_string(plan, r.net), .kind = r.kind,
         .connection = r.connection)

static uint8_t hex_digit(char digit) {
    return (uint8_t)(digit <= '9' ? digit - '0' : digit - 'a' + 10);
}

/** Length and CRC-32 of application parameters, which have been proved to be pairs of digits. */
static void measure_app(const char *digits, struct fsn_connection_info *info) {
    uint32_t crc = UINT32_MAX;
    for (; *digits != 0; digits += 2) {
        crc = fsn_crc32_step(crc, (uint8_t)(hex_digit(digits[0]) << 4 | hex_digit(digits[1])));
        info->app_bytes++;
    }
    if (info->app_bytes != 0) {
        info->app_crc = ~crc;
        info->known |= FSN_STATED_APP;
    }
}

fsn_status fsn_plan_connection(const struct fsn_plan *plan, uint32_t number,
                               struct fsn_connection_info *info) {
    if (number >= plan->count[FSN_SEC_CONNECTION]) {
        return FSN_E_ARG;
    }
    const struct fsn_connection_record r = fsn_read_connection(plan, number);
    *info = (struct fsn_connection_info){
        .name = fsn_string(plan, r.name),
        .net = fsn_string(plan, r.net),
        .main_subdevice = r.main,
        .sub_subdevice = r.sub,
        .copy_to_sub = r.copy_to_sub,
        .copy_to_main = r.copy_to_main,
        .connection_id = r.connection_id,
        .address = r.address,
        .watchdog_ms = r.watchdog_ms,
        .known = r.known,
        .safe_to_sub = r.safe_to_sub,
        .safe_to_main = r.safe_to_main,
    };
    measure_app(fsn_string(plan, r.app_parameters), info);
    return FSN_OK;
}
