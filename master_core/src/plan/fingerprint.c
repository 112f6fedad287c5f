/** The fingerprint of a plan: SHA-256 over the canonical text of docs/reference/fingerprint.md. */
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "plan/plan_internal.h"

static const char *const section_name[FSN_FINGERPRINT_SECTIONS] = {
    "devices", "process_data", "copies", "connections", "cycle", "safety_functions"};

/** A symbol with its name, which determines the order of equal ones. */
struct by_place {
    struct fsn_symbol_record record;
    const char *name;
};

/** Common data of the sections: the tables, the running hash, canonical numbers. */
struct text {
    const struct fsn_plan *plan;
    struct fsn_sha256_run run;
    uint32_t *rank;          /**< canonical number of each connection */
    uint32_t *number;        /**< connection of each canonical number */
    struct by_place *symbol; /**< in canonical order */
};

__attribute__((format(printf, 2, 3))) static void put(struct text *text, const char *format, ...) {
    char line[256]; /* the longest, a symbol, has less than 200 */
    va_list values;
    va_start(values, format);
    const int len = vsnprintf(line, sizeof line, format, values);
    va_end(values);
    /* GCOVR_EXCL_BR_START, mutants: no text is empty or longer, nor can it fail */
    if (len > 0 && (size_t)len < sizeof line) {
        fsn_sha256_add(&text->run, line, (size_t)len);
    } /* GCOVR_EXCL_BR_STOP */
}

/** A string of the plan as one word: visible ASCII except '%' unchanged, all others as %XX. */
static void put_word(struct text *text, uint32_t offset) {
    const uint8_t *at = text->plan->bytes + text->plan->offset[FSN_SEC_STRINGS] + offset;
    for (; *at != 0; at++) {
        if (*at > 0x20 && *at < 0x7F && *at != '%') {
            fsn_sha256_add(&text->run, at, 1);
        } else {
            put(text, "%%%02X", (unsigned)*at);
        }
    }
}

/** Writes SubDevice and number of a sync manager, `0.2`. */
static void put_place(struct text *text, const char *before, uint32_t sm) {
    const struct fsn_sm_record r = fsn_read_sm(text->plan, sm);
    put(text, "%s%" PRIu32 ".%u", before, r.subdevice, (unsigned)r.index);
}

static void put_sdo(struct text *text, uint32_t number) {
    const struct fsn_sdo_record r = fsn_read_sdo(text->plan, number);
    const unsigned size = r.size_bytes;
    const uint64_t mask = size < 8 ? ((uint64_t)1 << (8 * size)) - 1 : UINT64_MAX;
    put(text, "sdo 0x%04x:%02x bytes=%u value=0x%016" PRIx64 "\n", (unsigned)r.index,
        (unsigned)r.subindex, size, r.value & mask);
}

static void devices(struct text *text) {
    const struct fsn_plan *plan = text->plan;
    for (uint32_t n = 0; n < plan->count[FSN_SEC_BUS]; n++) {
        const struct fsn_bus_record r = fsn_read_bus(plan, n);
        put(text,
            "bus %" PRIu32 " cycle_ns=%" PRIu32 " first=%" PRIu32 " devices=%" PRIu32 " name=", n,
            r.cycle_ns, r.first_subdevice, r.subdevice_count);
        put_word(text, r.name);
        put(text, "\n");
    }
    for (uint32_t n = 0; n < plan->count[FSN_SEC_GROUP]; n++) {
        const struct fsn_group_record r = fsn_read_group(plan, n);
        put(text, "group %" PRIu32 " first=%" PRIu32 " devices=%" PRIu32 " name=", n,
            r.first_subdevice, r.subdevice_count);
        put_word(text, r.name);
        put(text, " place=");
        put_word(text, r.place);
        put(text, "\n");
    }
    for (uint32_t n = 0; n < plan->count[FSN_SEC_SUBDEVICE]; n++) {
        const struct fsn_subdevice_record r = fsn_read_subdevice(plan, n);
        put(text,
            "device %" PRIu32 " alias=%u position=%u vendor=0x%08" PRIx32 " product=0x%08" PRIx32
            " revision=0x%08" PRIx32 "-0x%08" PRIx32 " dc=0x%04x in_copy=%u name=",
            n, (unsigned)r.alias, (unsigned)r.position, r.vendor_id, r.product_code, r.revision_low,
            r.revision_high, (unsigned)r.assign_activate, (unsigned)r.in_copy);
        put_word(text, r.name);
        put(text, " driver=");
        put_word(text, r.driver);
        put(text, "\n");
        for (uint32_t sdo = r.first_sdo; sdo < r.first_sdo + r.sdo_count; sdo++) {
            put_sdo(text, sdo);
        }
    }
}

static void put_pdo(struct text *text, uint32_t number) {
    const struct fsn_pdo_record pdo = fsn_read_pdo(text->plan, number);
    put(text, "pdo 0x%04x\n", (unsigned)pdo.index);
    for (uint32_t n = pdo.first_entry; n < pdo.first_entry + pdo.entry_count; n++) {
        const struct fsn_entry_record r = fsn_read_entry(text->plan, n);
        put(text, "entry 0x%04x:%02x bits=%u type=%u registered=%u\n", (unsigned)r.index,
            (unsigned)r.subindex, (unsigned)r.bits, (unsigned)r.kind, r.registered & 1u);
    }
}

static void put_symbol(struct text *text, const struct by_place *symbol) {
    const struct fsn_symbol_record *r = &symbol->record;
    put_place(text, "symbol ", r->sm);
    put(text,
        " bit=%" PRIu32 " bits=%u type=%u output=%u restart=%u stop=0x%016" PRIx64
        " factor=0x%016" PRIx64 " offset=0x%016" PRIx64 " name=",
        r->bit_offset, (unsigned)r->bits, (unsigned)r->kind, r->flags & 1u, (r->flags >> 1) & 1u,
        r->stop_value, r->factor, r->offset);
    put_word(text, r->name);
    put(text, "\n");
}

static void process_data(struct text *text) {
    const struct fsn_plan *plan = text->plan;
    for (uint32_t n = 0; n < plan->count[FSN_SEC_SM]; n++) {
        const struct fsn_sm_record r = fsn_read_sm(plan, n);
        put_place(text, "sm ", n);
        put(text, " direction=%u watchdog=%u bits=%" PRIu32 "\n", (unsigned)r.direction,
            (unsigned)r.watchdog, r.bits);
        for (uint32_t pdo = r.first_pdo; pdo < r.first_pdo + r.pdo_count; pdo++) {
            put_pdo(text, pdo);
        }
    }
    for (uint32_t n = 0; n < plan->count[FSN_SEC_BLOCK]; n++) { /* sorted: proved */
        const struct fsn_block_record r = fsn_read_block(plan, n);
        put_place(text, "frame ", r.sm);
        put(text, " byte=%" PRIu32 " bytes=%u safe=%u copied=%u\n", r.byte_offset,
            (unsigned)r.frame_bytes, (unsigned)r.safe_bytes, (unsigned)r.copied);
    }
    for (uint32_t n = 0; n < plan->count[FSN_SEC_SYMBOL]; n++) {
        put_symbol(text, &text->symbol[n]);
    }
}

static void copies(struct text *text) {
    const struct fsn_plan *plan = text->plan;
    for (uint32_t n = 0; n < plan->count[FSN_SEC_COPY]; n++) { /* sorted by destination: proved */
        const struct fsn_copy_record r = fsn_read_copy(plan, n);
        put_place(text, "copy from=", r.source_sm);
        put(text, "@%" PRIu32, r.source_bit);
        put_place(text, " to=", r.destination_sm);
        put(text, "@%" PRIu32 " bits=%" PRIu32 " kind=%u connection=", r.destination_bit, r.bits,
            (unsigned)r.kind);
        if (r.connection == FSN_NONE) {
            put(text, "-");
        } else {
            put(text, "%" PRIu32, text->rank[r.connection]);
        }
        put(text, " net=");
        put_word(text, r.net);
        put(text, "\n");
    }
}

/** Writes a number that may be missing in the plan. */
static void put_stated(struct text *text, const char *key, unsigned value, bool known) {
    if (known) {
        put(text, " %s=%u", key, value);
    } else {
        put(text, " %s=-", key);
    }
}

static void connections(struct text *text) {
    for (uint32_t n = 0; n < text->plan->count[FSN_SEC_CONNECTION]; n++) {
        const struct fsn_connection_record r = fsn_read_connection(text->plan, text->number[n]);
        put(text, "connection %" PRIu32 " main=%" PRIu32 " sub=%" PRIu32, n, r.main, r.sub);
        put_stated(text, "id", r.connection_id, (r.known & 1u) != 0);
        put_stated(text, "address", r.address, (r.known & 2u) != 0);
        put_stated(text, "watchdog_ms", r.watchdog_ms, (r.known & 4u) != 0);
        put(text, " safe_to_sub=%u safe_to_main=%u app_parameters=", (unsigned)r.safe_to_sub,
            (unsigned)r.safe_to_main);
        put_word(text, r.app_parameters);
        put(text, " name=");
        put_word(text, r.name);
        put(text, " net=");
        put_word(text, r.net);
        put(text, "\n");
    }
}

static void cycle(struct text *text) {
    if (text->plan->cycle_ns == 0) {
        put(text, "cycle_ns=-\n");
    } else {
        put(text, "cycle_ns=%" PRIu32 "\n", text->plan->cycle_ns);
    }
}

/** Numbers the connections in the order of the bytes that they write to their SubInstance: copies
 *  are sorted by destination, and each connection has one such copy. */
static void order_connections(struct text *text) {
    const struct fsn_plan *plan = text->plan;
    uint32_t next = 0;
    for (uint32_t n = 0; n < plan->count[FSN_SEC_COPY]; n++) {
        const uint32_t connection = fsn_read_copy(plan, n).connection;
        if (connection != FSN_NONE && fsn_read_connection(plan, connection).copy_to_sub == n) {
            text->rank[connection] = next;
            text->number[next++] = connection;
        }
    }
}

static int order(uint64_t a, uint64_t b) {
    return (a > b) - (a < b);
}

/** Compares symbols by place, then by all other fields in the text. */
static int compare_symbols(const void *left, const void *right) {
    const struct by_place *one = left;
    const struct by_place *other = right;
    const struct fsn_symbol_record *a = &one->record;
    const struct fsn_symbol_record *b = &other->record;
    const int steps[] = {
        order(a->sm, b->sm),
        order(a->bit_offset, b->bit_offset),
        order(a->bits, b->bits),
        order(a->kind, b->kind),
        order(a->flags & 1u, b->flags & 1u),
        order(a->flags, b->flags),
        order(a->stop_value, b->stop_value),
        order(a->factor, b->factor),
        order(a->offset, b->offset),
    };
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        if (steps[i] != 0) {
            return steps[i];
        }
    }
    return strcmp(one->name, other->name);
}

static void order_symbols(struct text *text) {
    const uint32_t count = text->plan->count[FSN_SEC_SYMBOL];
    for (uint32_t n = 0; n < count; n++) {
        const struct fsn_symbol_record r = fsn_read_symbol(text->plan, n);
        text->symbol[n] = (struct by_place){r, fsn_string(text->plan, r.name)};
    }
    qsort(text->symbol, count, sizeof text->symbol[0], compare_symbols);
}

static void nothing(struct text *text) {
    (void)text;
}

static void hash_sections(struct text *text, struct fsn_fingerprint *out) {
    static void (*const section[FSN_FINGERPRINT_SECTIONS])(struct text *) = {
        devices, process_data, copies, connections, cycle, nothing};
    const struct fsn_plan *plan = text->plan;
    for (size_t i = 0; i < FSN_FINGERPRINT_SECTIONS; i++) {
        fsn_sha256_start(&text->run);
        put(text, FSN_FINGERPRINT_FORM " %s\n", section_name[i]);
        section[i](text);
        fsn_sha256_end(&text->run, out->section[i]);
    }
    if (plan->count[FSN_SEC_SAFETY] > 0) {
        memcpy(out->section[FSN_FINGERPRINT_SAFETY_FUNCTIONS], fsn_record(plan, FSN_SEC_SAFETY, 0),
               FSN_SHA256_BYTES);
    }
    fsn_sha256_start(&text->run);
    put(text, FSN_FINGERPRINT_FORM "\n");
    for (size_t i = 0; i < FSN_FINGERPRINT_SECTIONS; i++) {
        put(text, "%s ", section_name[i]);
        for (size_t n = 0; n < FSN_SHA256_BYTES; n++) {
            put(text, "%02x", (unsigned)out->section[i][n]);
        }
        put(text, "\n");
    }
    fsn_sha256_end(&text->run, out->whole);
}

fsn_status fsn_plan_fingerprint(const struct fsn_plan *plan, struct fsn_fingerprint *fingerprint) {
    if (plan == NULL || fingerprint == NULL) {
        return FSN_E_ARG;
    }
    struct text text = {.plan = plan};
    const bool room = FSN_NEW(text.rank, plan->count[FSN_SEC_CONNECTION]) &&
                      FSN_NEW(text.number, plan->count[FSN_SEC_CONNECTION]) &&
                      FSN_NEW(text.symbol, plan->count[FSN_SEC_SYMBOL]);
    if (room) {
        order_connections(&text);
        order_symbols(&text);
        hash_sections(&text, fingerprint);
    }
    free(text.rank);
    free(text.number);
    free(text.symbol);
    return room ? FSN_OK : FSN_E_NOMEM;
}

const char *fsn_fingerprint_section(uint32_t section) {
    return section < FSN_FINGERPRINT_SECTIONS ? section_name[section] : "?";
}

void fsn_fingerprint_code(const struct fsn_fingerprint *fingerprint,
                          char code[FSN_FINGERPRINT_CODE_BYTES]) {
    static const char digit[] = "0123456789ABCDEF";
    size_t at = 0;
    for (size_t i = 0; i < 8; i++) {
        code[at++] = digit[fingerprint->whole[i] >> 4];
        code[at++] = digit[fingerprint->whole[i] & 15];
        if (i % 2 == 1 && i < 7) {
            code[at++] = ' ';
        }
    }
    code[at] = 0;
}
