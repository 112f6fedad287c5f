/** PDO assignment and mapping of a SubDevice against the plan, object by object where it has CoE,
 *  else against what IgH has read from its SII. What can be changed is changed once; what still
 *  differs is refused here, since IgH itself only warns in the kernel log and goes on. */
#include "igh.h"

#include <string.h>

enum { ASSIGNMENT = 0x1C10, MOST_PDOS = 64, LONGEST_PADDING = 248 };

/** A mapping as objects hold it: index, subindex, bits in one word each; index 0 is padding. */
struct mapping {
    uint32_t count;
    uint32_t entries[IGH_MOST_ENTRIES];
};

/** PDOs of one sync manager. */
struct assignment {
    uint32_t count;
    uint16_t pdos[MOST_PDOS];
};

/** What is needed everywhere here. */
struct at {
    struct fsn_igh *bus;
    struct igh_node *node;
    uint32_t sm;    /**< its record in the plan */
    uint8_t number; /**< its number in the SubDevice */
};

static fsn_status differs(const struct at *at, const char *what, uint32_t found, uint32_t planned) {
    igh_note(at->bus, at->node, FSN_FOUND_MAPPING, "SM%u: %s is 0x%x, the plan says 0x%x",
             at->number, what, found, planned);
    return FSN_E_BUS_MAPPING;
}

/* -- as planned ----------------------------------------------------------------------------- */

const uint8_t *igh_pdo(const struct fsn_plan *plan, uint32_t sm, uint32_t number) {
    return fsn_record(plan, FSN_SEC_PDO, fsn_get32(fsn_record(plan, FSN_SEC_SM, sm) + 12) + number);
}

static void add_entry(uint32_t *entries, uint32_t *count, uint32_t value) {
    if (*count < IGH_MOST_ENTRIES) {
        entries[(*count)++] = value;
    }
}

uint32_t igh_planned_entries(const struct fsn_plan *plan, const uint8_t *pdo, uint32_t *entries) {
    uint32_t count = 0;
    for (uint32_t e = 0; e < fsn_get32(pdo + 8); e++) {
        const uint8_t *entry = fsn_record(plan, FSN_SEC_ENTRY, fsn_get32(pdo + 4) + e);
        uint32_t bits = fsn_get16(entry + 4);
        const uint32_t name = ((uint32_t)fsn_get16(entry) << 16) | ((uint32_t)entry[2] << 8);
        while (name == 0 && bits > 255) {
            add_entry(entries, &count, LONGEST_PADDING);
            bits -= LONGEST_PADDING;
        }
        add_entry(entries, &count, name | (bits & 0xFFu));
    }
    return count;
}

static void planned_assignment(const struct at *at, struct assignment *a) {
    a->count = fsn_get32(fsn_record(at->bus->plan, FSN_SEC_SM, at->sm) + 16);
    a->count = a->count > MOST_PDOS ? MOST_PDOS : a->count;
    for (uint32_t i = 0; i < a->count; i++) {
        a->pdos[i] = fsn_get16(igh_pdo(at->bus->plan, at->sm, i));
    }
}

/** Joins padding that stands side by side, so that 16 bits equal twice 8. */
static void join_padding(struct mapping *m) {
    uint32_t kept = 0;
    for (uint32_t i = 0; i < m->count; i++) {
        const bool padding = m->entries[i] >> 16 == 0;
        if (padding && kept > 0 && m->entries[kept - 1] >> 16 == 0) {
            m->entries[kept - 1] += m->entries[i] & 0xFFu;
        } else {
            m->entries[kept++] = padding ? m->entries[i] & 0xFFu : m->entries[i];
        }
    }
    m->count = kept;
}

/* -- as found ------------------------------------------------------------------------------- */

static bool read_number(const struct at *at, uint16_t index, uint8_t sub, uint32_t *value) {
    uint8_t bytes[8] = {0};
    uint32_t code;
    if (!igh_upload(at->bus, at->node, index, sub, bytes, sizeof bytes, &code)) {
        return false;
    }
    *value = fsn_get32(bytes);
    return true;
}

static bool read_assignment(const struct at *at, struct assignment *a) {
    const uint16_t index = (uint16_t)(ASSIGNMENT + at->number);
    if (!read_number(at, index, 0, &a->count)) {
        return false;
    }
    a->count &= 0xFFu;
    a->count = a->count > MOST_PDOS ? MOST_PDOS : a->count;
    for (uint32_t i = 0; i < a->count; i++) {
        uint32_t pdo;
        if (!read_number(at, index, (uint8_t)(i + 1), &pdo)) {
            return false;
        }
        a->pdos[i] = (uint16_t)pdo;
    }
    return true;
}

static bool read_mapping(const struct at *at, uint16_t pdo, struct mapping *m) {
    uint32_t count;
    m->count = 0;
    if (!read_number(at, pdo, 0, &count)) {
        return false;
    }
    count &= 0xFFu;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t entry;
        if (!read_number(at, pdo, (uint8_t)(i + 1), &entry)) {
            return false;
        }
        add_entry(m->entries, &m->count, entry);
    }
    return true;
}

/* -- writing -------------------------------------------------------------------------------- */

static bool write_number(const struct at *at, uint16_t index, uint8_t sub, uint32_t value,
                         size_t size) {
    const uint8_t bytes[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16),
                              (uint8_t)(value >> 24)};
    uint32_t code;
    return igh_download(at->bus, at->node, index, sub, bytes, size, &code);
}

/** The order ETG.1000 asks for: empty it, fill it, state how many. */
static void write_assignment(const struct at *at, const struct assignment *a) {
    const uint16_t index = (uint16_t)(ASSIGNMENT + at->number);
    bool ok = write_number(at, index, 0, 0, 1);
    for (uint32_t i = 0; ok && i < a->count; i++) {
        ok = write_number(at, index, (uint8_t)(i + 1), a->pdos[i], 2);
    }
    /* Also when one was refused, so that the SubDevice is not left without any. */
    (void)write_number(at, index, 0, a->count, 1);
}

static void write_mapping(const struct at *at, uint16_t pdo, const struct mapping *m) {
    bool ok = write_number(at, pdo, 0, 0, 1);
    for (uint32_t i = 0; ok && i < m->count; i++) {
        ok = write_number(at, pdo, (uint8_t)(i + 1), m->entries[i], 4);
    }
    (void)write_number(at, pdo, 0, m->count, 1);
}

/* -- comparing ------------------------------------------------------------------------------ */

static bool same_assignment(const struct assignment *a, const struct assignment *b) {
    return a->count == b->count && memcmp(a->pdos, b->pdos, a->count * sizeof *a->pdos) == 0;
}

static fsn_status check_assignment(const struct at *at) {
    struct assignment planned, found;
    planned_assignment(at, &planned);
    if (!read_assignment(at, &found)) {
        return FSN_OK; /* not readable: the SubDevice judges the length itself, in SAFEOP */
    }
    if (same_assignment(&planned, &found)) {
        return FSN_OK;
    }
    write_assignment(at, &planned);
    if (!read_assignment(at, &found) || same_assignment(&planned, &found)) {
        return FSN_OK;
    }
    for (uint32_t i = 0; i < planned.count && i < found.count; i++) {
        if (planned.pdos[i] != found.pdos[i]) {
            return differs(at, "an assigned PDO", found.pdos[i], planned.pdos[i]);
        }
    }
    return differs(at, "the number of assigned PDOs", found.count, planned.count);
}

static fsn_status compare_mapping(const struct at *at, uint16_t pdo, struct mapping planned,
                                  struct mapping *found) {
    join_padding(&planned);
    join_padding(found);
    for (uint32_t i = 0; i < planned.count && i < found->count; i++) {
        if (planned.entries[i] != found->entries[i]) {
            igh_note(at->bus, at->node, FSN_FOUND_MAPPING,
                     "PDO 0x%04x, entry %u is 0x%08x, the plan says 0x%08x (index, subindex, bits)",
                     pdo, i + 1, found->entries[i], planned.entries[i]);
            return FSN_E_BUS_MAPPING;
        }
    }
    if (planned.count != found->count) {
        igh_note(at->bus, at->node, FSN_FOUND_MAPPING,
                 "PDO 0x%04x has %u entries, the plan says %u", pdo, found->count, planned.count);
        return FSN_E_BUS_MAPPING;
    }
    return FSN_OK;
}

static fsn_status check_mapping(const struct at *at, uint32_t number) {
    const uint8_t *record = igh_pdo(at->bus->plan, at->sm, number);
    const uint16_t pdo = fsn_get16(record);
    struct mapping planned, found;
    planned.count = igh_planned_entries(at->bus->plan, record, planned.entries);
    if (!read_mapping(at, pdo, &found) || compare_mapping(at, pdo, planned, &found) == FSN_OK) {
        return FSN_OK;
    }
    write_mapping(at, pdo, &planned);
    return read_mapping(at, pdo, &found) ? compare_mapping(at, pdo, planned, &found) : FSN_OK;
}

/** Without CoE the SII says what is mapped; a SubDevice that says nothing is not judged. */
static fsn_status check_sii(const struct at *at) {
    ec_master_t *master = at->bus->master;
    const uint16_t ring = at->node->ring;
    ec_sync_info_t sync = {0};
    uint32_t bits = 0;
    if (ecrt_master_get_sync_manager(master, ring, at->number, &sync) != 0 || sync.n_pdos == 0) {
        return FSN_OK;
    }
    for (unsigned p = 0; p < sync.n_pdos; p++) {
        ec_pdo_info_t pdo = {0};
        if (ecrt_master_get_pdo(master, ring, at->number, (uint16_t)p, &pdo) != 0) {
            return FSN_OK;
        }
        for (unsigned e = 0; e < pdo.n_entries; e++) {
            ec_pdo_entry_info_t entry = {0};
            if (ecrt_master_get_pdo_entry(master, ring, at->number, (uint16_t)p, (uint16_t)e,
                                          &entry) != 0) {
                return FSN_OK;
            }
            bits += entry.bit_length;
        }
    }
    const uint32_t planned = fsn_sm_bits(at->bus->plan, at->sm);
    return bits == planned ? FSN_OK : differs(at, "its length in bits by the SII", bits, planned);
}

fsn_status igh_check_pdos(struct fsn_igh *bus, struct igh_node *node) {
    for (uint32_t sm = node->info.first_sm; sm < node->info.first_sm + node->info.sm_count; sm++) {
        const uint8_t *r = fsn_record(bus->plan, FSN_SEC_SM, sm);
        const struct at at = {bus, node, sm, r[4]};
        if (node->coe && r[4] < 2) {
            continue; /* a mailbox */
        }
        fsn_status status = node->coe ? check_assignment(&at) : check_sii(&at);
        for (uint32_t i = 0; node->coe && status == FSN_OK && i < fsn_get32(r + 16); i++) {
            status = check_mapping(&at, i);
        }
        if (status != FSN_OK) {
            return status;
        }
    }
    return FSN_OK;
}
