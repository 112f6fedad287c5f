/** Extracts the plan of one bus from a plan of several: records are renumbered, then proved like
 *  any other. */
#include <stdlib.h>
#include <string.h>

#include "plan/plan_internal.h"

/** Consecutive records. */
struct range {
    uint32_t first, count;
};

struct part {
    const struct fsn_plan *from;
    struct fsn_plan *to;
    struct range subdevices, sms, pdos, entries, sdos;
    uint32_t *copy;       /**< new number of each copy, FSN_NONE if it is omitted */
    uint32_t *connection; /**< the same for each connection */
};

static bool holds(const struct range *range, uint32_t number) {
    return number >= range->first && number - range->first < range->count;
}

/** Records of the SubDevices: ranges tile, as the loader has proved. */
static void find_ranges(struct part *part) {
    const struct fsn_plan *from = part->from;
    for (uint32_t n = 0; n < part->subdevices.count; n++) {
        const struct fsn_subdevice_record r = fsn_read_subdevice(from, part->subdevices.first + n);
        part->sms.first = n == 0 ? r.first_sm : part->sms.first;
        part->sdos.first = n == 0 ? r.first_sdo : part->sdos.first;
        part->sms.count += r.sm_count;
        part->sdos.count += r.sdo_count;
    }
    for (uint32_t n = 0; n < part->sms.count; n++) {
        const struct fsn_sm_record r = fsn_read_sm(from, part->sms.first + n);
        part->pdos.first = n == 0 ? r.first_pdo : part->pdos.first;
        part->pdos.count += r.pdo_count;
    }
    for (uint32_t n = 0; n < part->pdos.count; n++) {
        const struct fsn_pdo_record r = fsn_read_pdo(from, part->pdos.first + n);
        part->entries.first = n == 0 ? r.first_entry : part->entries.first;
        part->entries.count += r.entry_count;
    }
}

/** Numbers the copies and connections to keep: those with both ends on this bus. */
static void number_kept(struct part *part) {
    const struct fsn_plan *from = part->from;
    uint32_t next = 0;
    for (uint32_t n = 0; n < from->count[FSN_SEC_COPY]; n++) {
        const struct fsn_copy_record r = fsn_read_copy(from, n);
        const bool kept = holds(&part->sms, r.source_sm) && holds(&part->sms, r.destination_sm);
        part->copy[n] = kept ? next++ : FSN_NONE;
    }
    next = 0;
    for (uint32_t n = 0; n < from->count[FSN_SEC_CONNECTION]; n++) {
        const struct fsn_connection_record r = fsn_read_connection(from, n);
        const bool kept = holds(&part->subdevices, r.main) && holds(&part->subdevices, r.sub);
        part->connection[n] = kept ? next++ : FSN_NONE;
    }
}

/** Appends a record to the section that is being written. */
static uint8_t *append(struct part *part, uint32_t section, uint32_t number) {
    struct fsn_plan *to = part->to;
    const uint32_t size = fsn_record_bytes[section];
    uint8_t *at = to->bytes + to->len_bytes;
    memcpy(at, fsn_record(part->from, section, number), size);
    to->len_bytes += size;
    to->count[section]++;
    return at;
}

/** Changes a number so that it counts from the first record of its kind in this part. */
static void shift(uint8_t *at, const struct range *range) {
    fsn_put32(at, fsn_get32(at) - range->first);
}

/** Appends consecutive records, of which up to two numbers are shifted; NULL: none. */
static void put_range(struct part *part, uint32_t section, struct range range, uint32_t at,
                      const struct range *by, uint32_t other_at, const struct range *other_by) {
    part->to->offset[section] = part->to->len_bytes;
    for (uint32_t n = 0; n < range.count; n++) {
        uint8_t *r = append(part, section, range.first + n);
        if (by != NULL) {
            shift(r + at, by);
        }
        if (other_by != NULL) {
            shift(r + other_at, other_by);
        }
    }
}

/** Appends the records with a sync manager of this bus, whose number is at a byte of them. */
static void put_of_sms(struct part *part, uint32_t section, uint32_t at) {
    part->to->offset[section] = part->to->len_bytes;
    for (uint32_t n = 0; n < part->from->count[section]; n++) {
        if (holds(&part->sms, fsn_get32(fsn_record(part->from, section, n) + at))) {
            shift(append(part, section, n) + at, &part->sms);
        }
    }
}

static void put_copies(struct part *part) {
    part->to->offset[FSN_SEC_COPY] = part->to->len_bytes;
    for (uint32_t n = 0; n < part->from->count[FSN_SEC_COPY]; n++) {
        const uint32_t connection = fsn_read_copy(part->from, n).connection;
        if (part->copy[n] != FSN_NONE) {
            uint8_t *r = append(part, FSN_SEC_COPY, n);
            shift(r + FSN_AT(copy, source_sm), &part->sms);
            shift(r + FSN_AT(copy, destination_sm), &part->sms);
            fsn_put32(r + FSN_AT(copy, connection),
                      connection == FSN_NONE ? FSN_NONE : part->connection[connection]);
        }
    }
}

static void put_connections(struct part *part) {
    part->to->offset[FSN_SEC_CONNECTION] = part->to->len_bytes;
    for (uint32_t n = 0; n < part->from->count[FSN_SEC_CONNECTION]; n++) {
        const struct fsn_connection_record c = fsn_read_connection(part->from, n);
        if (part->connection[n] != FSN_NONE) {
            uint8_t *r = append(part, FSN_SEC_CONNECTION, n);
            shift(r + FSN_AT(connection, main), &part->subdevices);
            shift(r + FSN_AT(connection, sub), &part->subdevices);
            fsn_put32(r + FSN_AT(connection, copy_to_sub), part->copy[c.copy_to_sub]);
            fsn_put32(r + FSN_AT(connection, copy_to_main), part->copy[c.copy_to_main]);
        }
    }
}

static fsn_status write_sections(struct part *part) {
    const struct range strings = {0, part->from->count[FSN_SEC_STRINGS]};
    find_ranges(part);
    number_kept(part);
    put_range(part, FSN_SEC_SUBDEVICE, part->subdevices, FSN_AT(subdevice, first_sm), &part->sms,
              FSN_AT(subdevice, first_sdo), &part->sdos);
    put_range(part, FSN_SEC_SM, part->sms, FSN_AT(sm, subdevice), &part->subdevices,
              FSN_AT(sm, first_pdo), &part->pdos);
    put_range(part, FSN_SEC_PDO, part->pdos, FSN_AT(pdo, first_entry), &part->entries, 0, NULL);
    put_range(part, FSN_SEC_ENTRY, part->entries, 0, NULL, 0, NULL);
    put_range(part, FSN_SEC_SDO, part->sdos, 0, NULL, 0, NULL);
    put_of_sms(part, FSN_SEC_SYMBOL, FSN_AT(symbol, sm));
    put_of_sms(part, FSN_SEC_BLOCK, FSN_AT(block, sm));
    put_copies(part);
    put_connections(part);
    put_range(part, FSN_SEC_STRINGS, strings, 0, NULL, 0, NULL);
    FSN_TRY(fsn_prove_layout(part->to, NULL));
    return fsn_prove_copies(part->to, NULL);
}

fsn_status fsn_plan_part(const struct fsn_plan *plan, uint32_t bus, struct fsn_plan **out) {
    struct fsn_bus_info info;
    *out = NULL;
    if (fsn_plan_bus(plan, bus, &info) != FSN_OK) {
        return FSN_E_ARG;
    }
    if (fsn_plan_bus_count(plan) == 1) {
        fsn_plan_hold(plan);
        *out = (struct fsn_plan *)plan;
        return FSN_OK;
    }
    struct part part = {
        .from = plan,
        .to = calloc(1, sizeof *part.to),
        .subdevices = {info.first_subdevice, info.subdevice_count},
        .copy = calloc(plan->count[FSN_SEC_COPY] + (size_t)1, sizeof *part.copy),
        .connection = calloc(plan->count[FSN_SEC_CONNECTION] + (size_t)1, sizeof *part.connection)};
    fsn_status status = FSN_E_NOMEM;
    if (part.to != NULL) {
        atomic_init(&part.to->holders, 1);
        part.to->cycle_ns = info.cycle_ns;
        part.to->sections = FSN_SECTIONS;
        part.to->bytes = malloc(plan->len_bytes);
        if (part.to->bytes != NULL && part.copy != NULL && part.connection != NULL) {
            status = write_sections(&part);
        }
        if (status == FSN_OK) {
            *out = part.to;
        } else {
            fsn_plan_free(part.to);
        }
    }
    free(part.copy);
    free(part.connection);
    return status;
}
