/** Self-description of an emulated SubDevice: SII and object dictionary, created from the plan. */
#define _GNU_SOURCE

#include <stdlib.h>
#include <string.h>

#include "segment/segment_internal.h"

enum {
    MAILBOX_BYTES = 128,
    MAILBOX_IN = 0x1000,
    MAILBOX_OUT = 0x1080,
    PROCESS_DATA = 0x1100,
    SII_BYTES = 4096, /**< sufficient for everything except the PDOs of a device, which are added */
    ENTRY_BYTES = 8,
    COUPLER_PRODUCT = 0x044C2C52, /**< an EK1100, which is often the first device of a segment */
    BECKHOFF = 2,
};

/** A sync manager in the form of the SII. */
struct sii_sm {
    uint16_t start, length;
    uint8_t control, type;
};

struct writer {
    uint8_t *bytes;
    size_t at, room;
};

static void put8(struct writer *w, uint32_t value) {
    w->bytes[w->at++] = (uint8_t)value;
}

static void put16(struct writer *w, uint32_t value) {
    put8(w, value);
    put8(w, value >> 8);
}

static size_t begin_category(struct writer *w, uint16_t type) {
    put16(w, type);
    put16(w, 0);
    return w->at;
}

/** Categories have whole words; the padding is 0, never 0xFF, which would look like the end. */
static void end_category(struct writer *w, size_t start) {
    if ((w->at - start) % 2 != 0) {
        put8(w, 0);
    }
    fsn_put16(w->bytes + start - 2, (uint32_t)(w->at - start) / 2);
}

static void put_strings(struct writer *w, const char *name) {
    const size_t start = begin_category(w, 10);
    const size_t len = strnlen(name, 200);
    put8(w, 1);
    put8(w, (uint32_t)len);
    for (size_t i = 0; i < len; i++) {
        put8(w, (uint8_t)name[i]);
    }
    end_category(w, start);
}

static void put_general(struct writer *w, bool has_mailbox) {
    const size_t start = begin_category(w, 30);
    /* Group, order and name: the only string; CoE: SDO, complete access. */
    const uint8_t general[32] = {[0] = 1, [2] = 1, [3] = 1, [5] = has_mailbox ? 0x21 : 0};
    for (size_t i = 0; i < sizeof general; i++) {
        put8(w, general[i]);
    }
    end_category(w, start);
}

static void put_sms(struct writer *w, const struct sii_sm *sms, uint32_t count) {
    size_t start = begin_category(w, 40);
    put8(w, 1); /* outputs */
    put8(w, 2); /* inputs */
    end_category(w, start);
    start = begin_category(w, 41);
    for (uint32_t i = 0; i < count; i++) {
        put16(w, sms[i].start);
        put16(w, sms[i].length);
        put8(w, sms[i].control);
        put8(w, 0);
        put8(w, sms[i].length > 0);
        put8(w, sms[i].type);
    }
    end_category(w, start);
}

static void put_pdos(struct writer *w, const struct fsn_plan *plan, uint32_t sm) {
    const struct fsn_sm_record r = fsn_read_sm(plan, sm);
    const bool output = r.direction == FSN_OUTPUT;
    if (r.pdo_count == 0) {
        return;
    }
    const size_t start = begin_category(w, output ? 51 : 50);
    for (uint32_t p = 0; p < r.pdo_count; p++) {
        const struct fsn_pdo_record pdo = fsn_read_pdo(plan, r.first_pdo + p);
        put16(w, pdo.index);
        put8(w, pdo.entry_count);
        put8(w, r.index);
        put8(w, 0);
        put8(w, 0);
        put16(w, 0);
        for (uint32_t e = 0; e < pdo.entry_count; e++) {
            const struct fsn_entry_record entry = fsn_read_entry(plan, pdo.first_entry + e);
            put16(w, entry.index);
            put8(w, entry.subindex);
            put8(w, 0);
            put8(w, 0);
            put8(w, entry.bits);
            put16(w, 0);
        }
    }
    end_category(w, start);
}

/** Everything except the identity, which is written at power-on. */
static void put_head(struct writer *w, const struct fsn_subdevice_info *info, bool has_mailbox) {
    fsn_put16(w->bytes, 0x0005); /* PDI control */
    fsn_put16(w->bytes + 8, info->position == 0 ? info->alias : 0);
    w->bytes[14] = fsn_eeprom_checksum(w->bytes);
    if (has_mailbox) {
        fsn_put16(w->bytes + 0x30, MAILBOX_IN);
        fsn_put16(w->bytes + 0x32, MAILBOX_BYTES);
        fsn_put16(w->bytes + 0x34, MAILBOX_OUT);
        fsn_put16(w->bytes + 0x36, MAILBOX_BYTES);
        fsn_put16(w->bytes + 0x38, 0x0004); /* CoE */
    }
    fsn_put16(w->bytes + 0x7C, (uint32_t)(w->room / 128) - 1); /* KiBit, minus one */
    fsn_put16(w->bytes + 0x7E, 1);
    w->at = 0x80;
}

/** Assigns start addresses to all sync managers: mailboxes, then process data, consecutively. */
static uint32_t lay_out(const struct fsn_plan *plan, const struct fsn_subdevice_info *info,
                        bool has_mailbox, struct sii_sm sms[ESC_SMS]) {
    uint32_t count = 0;
    if (has_mailbox) {
        sms[0] = (struct sii_sm){MAILBOX_IN, MAILBOX_BYTES, 0x26, 1};
        sms[1] = (struct sii_sm){MAILBOX_OUT, MAILBOX_BYTES, 0x22, 2};
        count = 2;
    }
    uint32_t start = PROCESS_DATA;
    for (uint32_t i = 0; i < info->sm_count; i++) {
        const struct fsn_sm_record r = fsn_read_sm(plan, info->first_sm + i);
        const uint32_t length = fsn_sm_bytes(plan, info->first_sm + i);
        if (r.index >= ESC_SMS || (has_mailbox && r.index < 2)) {
            continue;
        }
        const bool output = r.direction == FSN_OUTPUT;
        const uint8_t watchdog = r.watchdog != 2 ? 0x40 : 0;
        sms[r.index] = (struct sii_sm){(uint16_t)start, (uint16_t)length,
                                       (uint8_t)(output ? 0x24 | watchdog : 0x20), output ? 3 : 4};
        count = r.index + 1u > count ? r.index + 1u : count;
        start += (length + 15) / 16 * 16;
    }
    return count;
}

static void add_mapping(struct objects *o, const struct fsn_plan *plan, uint32_t pdo_number) {
    const struct fsn_pdo_record pdo = fsn_read_pdo(plan, pdo_number);
    const uint32_t entries = pdo.entry_count;
    objects_add_number(o, pdo.index, 0, true, entries > 254 ? 254 : entries, 1);
    for (uint32_t e = 0; e < entries && e < 254; e++) {
        const struct fsn_entry_record entry = fsn_read_entry(plan, pdo.first_entry + e);
        const uint32_t value =
            ((uint32_t)entry.index << 16) | ((uint32_t)entry.subindex << 8) | (entry.bits & 0xFFu);
        objects_add_number(o, pdo.index, (uint8_t)(e + 1), true, value, 4);
    }
}

static void add_assignment(struct objects *o, const struct fsn_plan *plan, uint32_t sm) {
    const struct fsn_sm_record r = fsn_read_sm(plan, sm);
    const uint16_t index = (uint16_t)(0x1C10 + r.index);
    objects_add_number(o, index, 0, true, r.pdo_count, 1);
    for (uint32_t p = 0; p < r.pdo_count && p < 254; p++) {
        const uint32_t number = r.first_pdo + p;
        const uint16_t pdo = fsn_read_pdo(plan, number).index;
        objects_add_number(o, index, (uint8_t)(p + 1), true, pdo, 2);
        add_mapping(o, plan, number);
    }
}

static void add_objects(struct objects *o, const struct fsn_plan *plan,
                        const struct fsn_subdevice_info *info, const struct sii_sm *sms,
                        uint32_t count) {
    objects_add_number(o, 0x1000, 0, false, 0x00001389, 4);
    objects_add(o, 0x1008, 0, false, info->name, (uint32_t)strlen(info->name));
    objects_add_number(o, 0x1018, 0, false, 4, 1);
    objects_add_number(o, 0x1018, 1, false, info->vendor_id, 4);
    objects_add_number(o, 0x1018, 2, false, info->product_code, 4);
    objects_add_number(o, 0x1018, 3, false, info->revision_low, 4);
    objects_add_number(o, 0x1018, 4, false, 0, 4);
    objects_add_number(o, 0x1C00, 0, false, count, 1);
    for (uint32_t i = 0; i < count; i++) {
        objects_add_number(o, 0x1C00, (uint8_t)(i + 1), false, sms[i].type, 1);
    }
    for (uint32_t i = 0; i < info->sm_count; i++) {
        const uint8_t number = fsn_read_sm(plan, info->first_sm + i).index;
        if (number >= 2) {
            add_assignment(o, plan, info->first_sm + i);
        }
    }
    for (uint32_t i = 0; i < info->sdo_count; i++) {
        const struct fsn_sdo_record r = fsn_read_sdo(plan, info->first_sdo + i);
        const uint8_t zeros[8] = {0};
        objects_add(o, r.index, r.subindex, true, zeros, r.size_bytes);
    }
}

/** Adds the FSoE address of a SubInstance, if in the plan, with the value of its live object. */
static void add_address(struct objects *o, const struct fsn_plan *plan, uint32_t subdevice) {
    for (uint32_t i = 0; i < fsn_plan_connection_count(plan); i++) {
        const struct fsn_connection_info c = fsn_known_connection(plan, i);
        if (c.sub_subdevice == subdevice && (c.known & 2) != 0) {
            objects_add_number(o, 0xF980, 0, false, 1, 1);
            objects_add_number(o, 0xF980, 1, false, c.address, 2);
        }
    }
}

/** Diagnosis history of a device that has just started: one message about the start. */
static void add_history(struct objects *o) {
    enum { MESSAGES = 4, FIRST = 6 };
    static const uint8_t message[] = {0x00, 0xE8, 0x00, 0x00, /* code: vendor-specific, number 0 */
                                      0x00, 0x01,             /* information, one parameter */
                                      0x01, 0x00,             /* text 1 */
                                      0,    0,    0,    0,    0, 0, 0, 0, /* time */
                                      0x05, 0x00, 1};                     /* UINT8 1 */
    objects_add_number(o, 0x10F3, 0, false, FIRST + MESSAGES - 1, 1);
    objects_add_number(o, 0x10F3, 1, false, MESSAGES, 1);
    objects_add_number(o, 0x10F3, 2, false, FIRST, 1);
    objects_add_number(o, 0x10F3, 3, true, 0, 1);
    objects_add_number(o, 0x10F3, 4, false, 1, 1);
    objects_add_number(o, 0x10F3, 5, true, 1, 2);
    objects_add(o, 0x10F3, FIRST, false, message, sizeof message);
    for (uint8_t i = 1; i < MESSAGES; i++) {
        objects_add(o, 0x10F3, (uint8_t)(FIRST + i), false, message, 0);
    }
}

/** A device whose sync managers 0 and 1 carry process data has no mailbox. */
static bool has_mailbox(const struct fsn_plan *plan, const struct fsn_subdevice_info *info) {
    for (uint32_t i = 0; i < info->sm_count; i++) {
        const struct fsn_sm_record sm = fsn_read_sm(plan, info->first_sm + i);
        if (sm.index < 2 && sm.bits > 0) {
            return false;
        }
    }
    return info->sm_count > 0;
}

bool segment_describe(struct fsn_segment *segment, uint32_t subdevice, uint32_t position) {
    const struct fsn_plan *plan = segment->plan;
    struct esc *esc = &segment->escs[position];
    struct fsn_subdevice_info info = {
        .name = "coupler", .vendor_id = BECKHOFF, .product_code = COUPLER_PRODUCT};
    if (subdevice != FSN_NONE) {
        info = fsn_known_subdevice(plan, subdevice);
    }
    esc->has_mailbox = has_mailbox(plan, &info);
    struct sii_sm sms[ESC_SMS] = {{0}};
    const uint32_t count = lay_out(plan, &info, esc->has_mailbox, sms);
    struct writer w = {.room = SII_BYTES};
    for (uint32_t i = 0; i < info.sm_count; i++) {
        const struct fsn_sm_record r = fsn_read_sm(plan, info.first_sm + i);
        for (uint32_t p = 0; p < r.pdo_count; p++) {
            w.room += 8 + (size_t)ENTRY_BYTES * fsn_read_pdo(plan, r.first_pdo + p).entry_count;
        }
    }
    w.room = (w.room + 127) / 128 * 128;
    w.bytes = calloc(w.room, 1);
    if (w.bytes == NULL) {
        return false;
    }
    segment->siis[position] = w.bytes;
    put_head(&w, &info, esc->has_mailbox);
    put_strings(&w, info.name);
    put_general(&w, esc->has_mailbox);
    put_sms(&w, sms, count);
    for (uint32_t i = 0; i < info.sm_count; i++) {
        put_pdos(&w, plan, info.first_sm + i);
    }
    put16(&w, 0xFFFF);
    esc->sii = w.bytes;
    esc->identity = (struct esc_identity){{info.vendor_id, info.product_code, info.revision_low}};
    esc->sii_bytes = w.room;
    if (subdevice != FSN_NONE) {
        add_objects(&esc->objects, plan, &info, sms, count);
        add_history(&esc->objects);
        add_address(&esc->objects, plan, subdevice);
    }
    return !esc->objects.failed;
}
