/** PDO assignment and mapping of a SubDevice against the plan, object by object where it has CoE,
 *  else against its SII. What can be changed is changed once; what still differs is refused. */
#include "soem.h"

#include <string.h>

enum {
    ASSIGNMENT = 0x1C10,
    MOST_PDOS = 64,
    MOST_ENTRIES = 254,
    RX_CATEGORY = 1, /**< of ecx_siiPDO: outputs */
    TX_CATEGORY = 0,
};

/** A mapping as objects hold it: index, subindex, bits in one word each; index 0 is padding. */
struct mapping {
    uint32_t count;
    uint32_t entries[MOST_ENTRIES];
};

/** PDOs of one sync manager. */
struct assignment {
    uint32_t count;
    uint16_t pdos[MOST_PDOS];
};

/** What is needed everywhere here. */
struct at {
    struct fsn_soem *bus;
    struct node *node;
    uint32_t sm;    /**< its record in the plan */
    uint8_t number; /**< its number in the SubDevice */
};

static fsn_status differs(const struct at *at, const char *what, uint32_t found, uint32_t planned) {
    soem_note(at->bus, at->node, FSN_FOUND_MAPPING, "SM%u: %s is 0x%x, the plan says 0x%x",
              at->number, what, found, planned);
    return FSN_E_BUS_MAPPING;
}

/* -- as planned ----------------------------------------------------------------------------- */

static const uint8_t *pdo_record(const struct at *at, uint32_t pdo) {
    const struct fsn_plan *plan = at->bus->plan;
    const uint32_t first = fsn_get32(fsn_record(plan, FSN_SEC_SM, at->sm) + 12);
    return fsn_record(plan, FSN_SEC_PDO, first + pdo);
}

static void planned_assignment(const struct at *at, struct assignment *a) {
    a->count = fsn_get32(fsn_record(at->bus->plan, FSN_SEC_SM, at->sm) + 16);
    a->count = a->count > MOST_PDOS ? MOST_PDOS : a->count;
    for (uint32_t i = 0; i < a->count; i++) {
        a->pdos[i] = fsn_get16(pdo_record(at, i));
    }
}

static void add_entry(struct mapping *m, uint32_t value) {
    if (m->count < MOST_ENTRIES) {
        m->entries[m->count++] = value;
    }
}

static void planned_mapping(const struct at *at, uint32_t pdo, struct mapping *m) {
    const uint8_t *r = pdo_record(at, pdo);
    m->count = 0;
    for (uint32_t e = 0; e < fsn_get32(r + 8); e++) {
        const uint8_t *entry = fsn_record(at->bus->plan, FSN_SEC_ENTRY, fsn_get32(r + 4) + e);
        uint32_t bits = fsn_get16(entry + 4);
        const uint32_t name = ((uint32_t)fsn_get16(entry) << 16) | ((uint32_t)entry[2] << 8);
        /* A mapping entry holds at most 255 bits; longer padding is several. */
        while (name == 0 && bits > 255) {
            add_entry(m, 248);
            bits -= 248;
        }
        add_entry(m, name | (bits & 0xFFu));
    }
}

/** Joins padding that stands side by side, so that 16 bits equal twice 8. */
static void join_padding(struct mapping *m) {
    uint32_t kept = 0;
    for (uint32_t i = 0; i < m->count; i++) {
        const bool padding = m->entries[i] >> 8 == 0 || m->entries[i] >> 16 == 0;
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
    int size = sizeof bytes;
    uint32_t abort_code;
    if (!soem_upload(at->bus, at->node->slave, index, sub, bytes, &size, &abort_code)) {
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
    for (uint32_t i = 0; i < count && i < MOST_ENTRIES; i++) {
        uint32_t entry;
        if (!read_number(at, pdo, (uint8_t)(i + 1), &entry)) {
            return false;
        }
        add_entry(m, entry);
    }
    return true;
}

/* -- writing -------------------------------------------------------------------------------- */

static bool write_number(const struct at *at, uint16_t index, uint8_t sub, uint32_t value,
                         int size) {
    const uint8_t bytes[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16),
                              (uint8_t)(value >> 24)};
    uint32_t abort_code;
    return soem_download(at->bus, at->node->slave, index, sub, bytes, size, &abort_code);
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

static fsn_status compare_mapping(const struct at *at, uint16_t pdo, struct mapping *planned,
                                  struct mapping *found) {
    join_padding(planned);
    join_padding(found);
    for (uint32_t i = 0; i < planned->count && i < found->count; i++) {
        if (planned->entries[i] != found->entries[i]) {
            soem_note(
                at->bus, at->node, FSN_FOUND_MAPPING,
                "PDO 0x%04x, entry %u is 0x%08x, the plan says 0x%08x (index, subindex, bits)", pdo,
                i + 1, found->entries[i], planned->entries[i]);
            return FSN_E_BUS_MAPPING;
        }
    }
    if (planned->count != found->count) {
        soem_note(at->bus, at->node, FSN_FOUND_MAPPING,
                  "PDO 0x%04x has %u entries, the plan says %u", pdo, found->count, planned->count);
        return FSN_E_BUS_MAPPING;
    }
    return FSN_OK;
}

static fsn_status check_mapping(const struct at *at, uint32_t number) {
    const uint16_t pdo = fsn_get16(pdo_record(at, number));
    struct mapping planned, found;
    planned_mapping(at, number, &planned);
    if (!read_mapping(at, pdo, &found)) {
        return FSN_OK;
    }
    struct mapping as_written = planned;
    if (compare_mapping(at, pdo, &planned, &found) == FSN_OK) {
        return FSN_OK;
    }
    write_mapping(at, pdo, &as_written);
    if (!read_mapping(at, pdo, &found)) {
        return FSN_OK;
    }
    planned = as_written;
    return compare_mapping(at, pdo, &planned, &found);
}

/** Without CoE the SII says what is mapped; a SubDevice that says nothing is not judged. */
static fsn_status check_sii(const struct at *at, bool output) {
    ec_eepromPDOt *sii = &at->bus->eeprom_pdo;
    memset(sii, 0, sizeof *sii);
    ecx_siiPDO(&at->bus->context, at->node->slave, sii, output ? RX_CATEGORY : TX_CATEGORY);
    if (sii->Startpos == 0 || at->number >= EC_MAXSM) {
        return FSN_OK;
    }
    const uint32_t planned = fsn_sm_bits(at->bus->plan, at->sm);
    const uint32_t found = sii->SMbitsize[at->number];
    return found == planned ? FSN_OK : differs(at, "its length in bits by the SII", found, planned);
}

fsn_status soem_check_pdos(struct fsn_soem *bus, struct node *node) {
    const bool coe = soem_has_coe(bus, node->slave);
    for (uint32_t sm = node->info.first_sm; sm < node->info.first_sm + node->info.sm_count; sm++) {
        const uint8_t *r = fsn_record(bus->plan, FSN_SEC_SM, sm);
        const struct at at = {bus, node, sm, r[4]};
        const uint32_t pdos = fsn_get32(r + 16);
        if (bus->slaves[node->slave].mbx_l > 0 && r[4] < 2) {
            continue; /* a mailbox */
        }
        fsn_status status = coe ? check_assignment(&at) : check_sii(&at, r[5] == FSN_OUTPUT);
        for (uint32_t i = 0; coe && status == FSN_OK && i < pdos; i++) {
            status = check_mapping(&at, i);
        }
        if (status != FSN_OK) {
            return status;
        }
    }
    return FSN_OK;
}
