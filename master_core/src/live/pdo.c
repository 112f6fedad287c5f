#include "live/pdo.h"

#include <stdio.h>
#include <string.h>

enum { ASSIGNMENT = 0x1C10, MOST_PDOS = 64, LONGEST_PADDING = 248 };

/** PDOs of a sync manager, or a mapping in the form of its objects. */
struct list {
    uint32_t count;
    uint32_t values[FSN_PDO_ENTRIES];
};

/** Common arguments of this file. */
struct at {
    const struct fsn_plan *plan;
    const struct fsn_objects *objects;
    uint32_t sm;       /**< its record in the plan */
    uint16_t assigned; /**< its assignment object */
    char *detail;
};

/* -- as planned ----------------------------------------------------------------------------- */

static void add_entry(uint32_t *entries, uint32_t *count, uint32_t value) {
    if (*count < FSN_PDO_ENTRIES) {
        entries[(*count)++] = value;
    }
}

uint32_t fsn_pdo_entries(const struct fsn_plan *plan, uint32_t number,
                         uint32_t entries[FSN_PDO_ENTRIES]) {
    const struct fsn_pdo_record pdo = fsn_read_pdo(plan, number);
    uint32_t count = 0;
    for (uint32_t e = 0; e < pdo.entry_count; e++) {
        const struct fsn_entry_record entry = fsn_read_entry(plan, pdo.first_entry + e);
        uint32_t bits = entry.bits;
        const uint32_t name = ((uint32_t)entry.index << 16) | ((uint32_t)entry.subindex << 8);
        while (name == 0 && bits > 255) {
            add_entry(entries, &count, LONGEST_PADDING);
            bits -= LONGEST_PADDING;
        }
        add_entry(entries, &count, name | (bits & 0xFFu));
    }
    return count;
}

static void planned_assignment(const struct at *at, struct list *a) {
    const struct fsn_sm_record sm = fsn_read_sm(at->plan, at->sm);
    a->count = sm.pdo_count > MOST_PDOS ? MOST_PDOS : sm.pdo_count;
    for (uint32_t i = 0; i < a->count; i++) {
        a->values[i] = fsn_read_pdo(at->plan, sm.first_pdo + i).index;
    }
}

/** Joins adjacent padding, so that 16 bits are equal to twice 8 bits. */
static void join_padding(struct list *m) {
    uint32_t kept = 0;
    for (uint32_t i = 0; i < m->count; i++) {
        const bool padding = m->values[i] >> 16 == 0;
        if (padding && kept > 0 && m->values[kept - 1] >> 16 == 0) {
            m->values[kept - 1] += m->values[i] & 0xFFu;
        } else {
            m->values[kept++] = padding ? m->values[i] & 0xFFu : m->values[i];
        }
    }
    m->count = kept;
}

/* -- as found ------------------------------------------------------------------------------- */

/** Returns as fsn_objects_read(): a refusal by the SubDevice is not an error here. */
static fsn_status read_number(const struct at *at, uint16_t index, uint8_t sub, uint32_t *value) {
    uint8_t bytes[8];
    const fsn_status status = fsn_objects_read(at->objects, index, sub, bytes, at->detail);
    *value = fsn_get32(bytes);
    return status;
}

/** Reads an object whose subindex 0 counts the others, at most `most` of them and some bits. */
static fsn_status read_list(const struct at *at, uint16_t index, uint32_t most, uint32_t bits,
                            struct list *list) {
    FSN_TRY(read_number(at, index, 0, &list->count));
    list->count &= 0xFFu;
    list->count = list->count > most ? most : list->count;
    for (uint32_t i = 0; i < list->count; i++) {
        FSN_TRY(read_number(at, index, (uint8_t)(i + 1), &list->values[i]));
        list->values[i] &= bits;
    }
    return FSN_OK;
}

/* -- writing -------------------------------------------------------------------------------- */

static bool write_number(const struct at *at, uint16_t index, uint8_t sub, uint32_t value,
                         uint32_t size) {
    const uint8_t bytes[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16),
                              (uint8_t)(value >> 24)};
    uint32_t abort_code;
    return fsn_objects_write(at->objects, index, sub, bytes, size, &abort_code) == FSN_OK;
}

/** The order required by ETG.1000: empty it, fill it, then set the count. */
static void write_list(const struct at *at, uint16_t index, uint32_t size,
                       const struct list *list) {
    bool ok = write_number(at, index, 0, 0, 1);
    for (uint32_t i = 0; ok && i < list->count; i++) {
        ok = write_number(at, index, (uint8_t)(i + 1), list->values[i], size);
    }
    /* Even if one was refused, so that the SubDevice is not left without an assignment. */
    (void)write_number(at, index, 0, list->count, 1);
}

/* -- comparing ------------------------------------------------------------------------------ */

static bool same_list(const struct list *a, const struct list *b) {
    return a->count == b->count && memcmp(a->values, b->values, a->count * sizeof *a->values) == 0;
}

static fsn_status differs(const struct at *at, const char *what, uint32_t found, uint32_t planned) {
    snprintf(at->detail, FSN_DETAIL_BYTES, "SM%u: %s is 0x%x, the plan has 0x%x",
             at->assigned - ASSIGNMENT, what, found, planned);
    return FSN_E_BUS_MAPPING;
}

/** Objects that cannot be read are not compared: the SubDevice checks the length itself, in SAFEOP.
 *  Without an answer it is unknown whether they can be read. */
static fsn_status unless_silent(fsn_status status) {
    return fsn_is_silent(status) ? status : FSN_OK;
}

static fsn_status check_assignment(const struct at *at) {
    struct list planned, found;
    planned_assignment(at, &planned);
    fsn_status status = read_list(at, at->assigned, MOST_PDOS, UINT16_MAX, &found);
    /* mutants: either way round */
    if (status != FSN_OK || same_list(&planned, &found)) {
        return unless_silent(status);
    }
    write_list(at, at->assigned, 2, &planned);
    status = read_list(at, at->assigned, MOST_PDOS, UINT16_MAX, &found);
    /* mutants: as above */
    if (status != FSN_OK || same_list(&planned, &found)) {
        return unless_silent(status);
    }
    for (uint32_t i = 0; i < planned.count && i < found.count; i++) {
        if (planned.values[i] != found.values[i]) {
            return differs(at, "an assigned PDO", found.values[i], planned.values[i]);
        }
    }
    return differs(at, "the number of assigned PDOs", found.count, planned.count);
}

static fsn_status compare_mapping(const struct at *at, uint16_t pdo, struct list planned,
                                  struct list *found) {
    join_padding(&planned);
    join_padding(found);
    for (uint32_t i = 0; i < planned.count && i < found->count; i++) {
        if (planned.values[i] != found->values[i]) {
            snprintf(at->detail, FSN_DETAIL_BYTES,
                     "PDO 0x%04x, entry %u is 0x%08x, the plan has 0x%08x (index, subindex, bits)",
                     pdo, i + 1, found->values[i], planned.values[i]);
            return FSN_E_BUS_MAPPING;
        }
    }
    if (planned.count != found->count) {
        snprintf(at->detail, FSN_DETAIL_BYTES, "PDO 0x%04x has %u entries, the plan has %u", pdo,
                 found->count, planned.count);
        return FSN_E_BUS_MAPPING;
    }
    return FSN_OK;
}

static fsn_status check_mapping(const struct at *at, uint32_t number) {
    const uint16_t pdo = fsn_read_pdo(at->plan, number).index;
    struct list planned, found;
    planned.count = fsn_pdo_entries(at->plan, number, planned.values);
    fsn_status status = read_list(at, pdo, FSN_PDO_ENTRIES, UINT32_MAX, &found);
    if (status != FSN_OK || compare_mapping(at, pdo, planned, &found) == FSN_OK) {
        return unless_silent(status);
    }
    write_list(at, pdo, 4, &planned);
    status = read_list(at, pdo, FSN_PDO_ENTRIES, UINT32_MAX, &found);
    return status == FSN_OK ? compare_mapping(at, pdo, planned, &found) : unless_silent(status);
}

fsn_status fsn_pdo_check(const struct fsn_plan *plan, uint32_t sm,
                         const struct fsn_objects *objects, char detail[FSN_DETAIL_BYTES]) {
    const struct fsn_sm_record r = fsn_read_sm(plan, sm);
    const struct at at = {plan, objects, sm, (uint16_t)(ASSIGNMENT + r.index), detail};
    FSN_TRY(check_assignment(&at));
    for (uint32_t i = 0; i < r.pdo_count; i++) {
        FSN_TRY(check_mapping(&at, r.first_pdo + i));
    }
    return FSN_OK;
}

fsn_status fsn_pdo_check_bits(const struct fsn_plan *plan, uint32_t sm, uint32_t found_bits,
                              char detail[FSN_DETAIL_BYTES]) {
    const struct fsn_sm_record planned = fsn_read_sm(plan, sm);
    if (found_bits == planned.bits) {
        return FSN_OK;
    }
    snprintf(detail, FSN_DETAIL_BYTES, "SM%u: its length in bits by the SII is %u, the plan has %u",
             planned.index, found_bits, planned.bits);
    return FSN_E_BUS_MAPPING;
}
