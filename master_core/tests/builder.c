#include "builder.h"

#include <fcntl.h>
#include <signal.h>
#include <string.h>
#include <sys/prctl.h>

enum { SECTIONS = 10, WITH_BUSES = 12, MOST_SECTIONS = 13 };

static const uint32_t record_bytes[MOST_SECTIONS] = {48, 24, 16, 12, 16, 44, 16,
                                                     32, 40, 1,  32, 16, 16};

/** A test that waits for long ends with the program that runs it. */
__attribute__((constructor)) static void end_with_parent(void) {
    (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
}

struct buffer {
    uint8_t *bytes;
    size_t len, room;
};

static void put(struct buffer *b, uint64_t value, size_t bytes) {
    if (b->len + bytes > b->room) {
        b->room = 2 * b->room + 4096;
        b->bytes = realloc(b->bytes, b->room);
        CHECK(b->bytes != NULL);
    }
    for (size_t i = 0; i < bytes; i++) {
        b->bytes[b->len++] = (uint8_t)(value >> (8 * i));
    }
}

static void poke(uint8_t *at, uint32_t value) {
    for (int i = 0; i < 4; i++) {
        at[i] = (uint8_t)(value >> (8 * i));
    }
}

static uint32_t peek(const uint8_t *at) {
    return at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

uint8_t *build_name(uint8_t *bytes, size_t *len, uint32_t section, uint32_t record,
                    const char *text) {
    const size_t size = strlen(text) + 1;
    bytes = realloc(bytes, *len + size);
    CHECK(bytes != NULL);
    memcpy(bytes + *len, text, size);
    *len += size;
    uint8_t *strings = bytes + 32 + 16 * (SECTIONS - 1);
    const uint32_t at = peek(strings + 8);
    poke(bytes + peek(bytes + 32 + 16 * (section - 1) + 4) + record * record_bytes[section - 1],
         at);
    poke(strings + 8, at + (uint32_t)size);
    poke(bytes + 12, (uint32_t)*len);
    return bytes;
}

void build_fix_crc(uint8_t *bytes, size_t len) {
    poke(bytes + 16, 0);
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 0; i < len; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = (crc >> 1) ^ ((crc & 1u) != 0 ? 0xEDB88320u : 0u);
        }
    }
    poke(bytes + 16, ~crc);
}

static void subdevices(struct buffer *b, const struct build *n) {
    for (uint32_t i = 0; i < n->subdevices; i++) {
        put(b, 1, 4);
        put(b, 0, 2);
        put(b, i, 2);
        put(b, 2, 4);
        put(b, 0x1000 + i, 4);
        put(b, 0, 4);
        put(b, 0xFFFFFFFFu, 4);
        put(b, 2 * (uint64_t)i, 4);
        put(b, 2, 4);
        put(b, 0, 4);
        put(b, i + 1 == n->subdevices ? n->sdo_count : 0, 4);
        put(b, 0, 2);
        put(b, 1, 2);
        put(b, 0, 4);
    }
}

static void sms(struct buffer *b, const struct build *n) {
    uint32_t pdo = 0;
    for (uint32_t i = 0; i < 2 * n->subdevices; i++) {
        const struct build_sm *sm = &n->sm[i / 2][i % 2];
        put(b, i / 2, 4);
        put(b, 2 + i % 2, 1);
        put(b, sm->direction, 1);
        put(b, 0, 1);
        put(b, sm->size_bytes > 0, 1);
        put(b, 8 * (uint64_t)sm->size_bytes, 4);
        put(b, pdo, 4);
        put(b, sm->size_bytes > 0, 4);
        put(b, 0, 4);
        pdo += sm->size_bytes > 0;
    }
}

static void pdos(struct buffer *b, const struct build *n) {
    uint32_t entry = 0;
    for (uint32_t i = 0; i < 2 * n->subdevices; i++) {
        const uint32_t size = n->sm[i / 2][i % 2].size_bytes;
        if (size == 0) {
            continue;
        }
        put(b, i % 2 == 0 ? 0x1600 : 0x1A00, 2);
        put(b, 0, 2);
        put(b, entry, 4);
        put(b, size, 4);
        put(b, 0, 4);
        entry += size;
    }
}

static void entries(struct buffer *b, const struct build *n) {
    for (uint32_t i = 0; i < 2 * n->subdevices; i++) {
        for (uint32_t byte = 0; byte < n->sm[i / 2][i % 2].size_bytes; byte++) {
            put(b, 0x6000, 2);
            put(b, byte & 0xFF, 1);
            put(b, 1, 1);
            put(b, 8, 2);
            put(b, 3, 1);
            put(b, 0, 1);
            put(b, 8 * (uint64_t)byte, 4);
        }
    }
}

static void sdos(struct buffer *b, const struct build *n) {
    for (uint32_t i = 0; i < n->sdo_count; i++) {
        put(b, 0x8000 + i, 2);
        put(b, 1, 1);
        put(b, 4, 1);
        put(b, 0, 4);
        put(b, 0x12345678, 8);
    }
}

static void put_real(struct buffer *b, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(b, bits, 8);
}

static void symbols(struct buffer *b, const struct build *n) {
    for (uint32_t i = 0; i < n->symbol_count; i++) {
        const struct build_symbol *symbol = &n->symbols[i];
        put(b, i == 0 ? 1 : 2, 4); /* names are unique as far as there are names */
        put(b, symbol->sm, 4);
        put(b, symbol->bit_offset, 4);
        put(b, symbol->bits, 2);
        put(b, symbol->kind != 0 ? symbol->kind : 3, 1);
        put(b, (symbol->sm % 2 == 0) | (symbol->restart_relevant ? 2 : 0), 1);
        put(b, 0, 4);
        put(b, symbol->stop_value, 8);
        put_real(b, symbol->factor != 0 ? symbol->factor : 1);
        put_real(b, symbol->offset);
    }
}

static uint32_t safe_bytes(uint32_t frame) {
    return frame == 6 ? 1 : (frame - 3) / 2;
}

static void blocks(struct buffer *b, const struct build *n) {
    for (uint32_t i = 0; i < n->block_count; i++) {
        const struct build_block *block = &n->blocks[i];
        put(b, block->sm, 4);
        put(b, block->byte_offset, 4);
        put(b, block->size_bytes, 2);
        put(b, safe_bytes(block->size_bytes), 2);
        put(b, 1, 4);
    }
}

struct order {
    uint32_t sm, byte, copy;
};

static int by_destination(const void *a, const void *b) {
    const struct order *x = a;
    const struct order *y = b;
    if (x->sm != y->sm) {
        return x->sm < y->sm ? -1 : 1;
    }
    return (x->byte > y->byte) - (x->byte < y->byte);
}

static struct order *sorted(const struct build *n) {
    const uint32_t count = 2 * n->pairs + n->standard;
    struct order *order = calloc((size_t)count + 1, sizeof *order);
    CHECK(order != NULL);
    for (uint32_t i = 0; i < count; i++) {
        order[i] = (struct order){2 * n->copies[i].to, n->copies[i].destination_byte, i};
    }
    qsort(order, count, sizeof *order, by_destination);
    return order;
}

static void copies(struct buffer *b, const struct build *n, const struct order *order) {
    for (uint32_t i = 0; i < 2 * n->pairs + n->standard; i++) {
        const struct build_copy *c = &n->copies[order[i].copy];
        const int fsoe = order[i].copy < 2 * n->pairs;
        put(b, 2 * (uint64_t)c->from + 1, 4);
        put(b, 8 * (uint64_t)c->source_byte, 4);
        put(b, 2 * (uint64_t)c->to, 4);
        put(b, 8 * (uint64_t)c->destination_byte, 4);
        put(b, 8 * (uint64_t)c->size_bytes, 4);
        put(b, 1, 4);
        put(b, fsoe ? 1 : 2, 2);
        put(b, 0, 2);
        put(b, fsoe ? order[i].copy / 2 : 0xFFFFFFFFu, 4);
    }
}

static void connections(struct buffer *b, const struct build *n, const struct order *order) {
    for (uint32_t pair = 0; pair < n->pairs; pair++) {
        const struct build_copy *down = &n->copies[2 * pair];
        uint32_t number[2] = {0, 0};
        for (uint32_t i = 0; i < 2 * n->pairs + n->standard; i++) {
            if (order[i].copy / 2 == pair && order[i].copy < 2 * n->pairs) {
                number[order[i].copy % 2] = i;
            }
        }
        put(b, 1, 4);
        put(b, 1, 4);
        put(b, down->from, 4);
        put(b, down->to, 4);
        put(b, number[0], 4);
        put(b, number[1], 4);
        put(b, pair + 1, 2);
        put(b, 0, 2);
        put(b, 0, 2);
        put(b, 1, 2);
        put(b, safe_bytes(down->size_bytes), 2);
        put(b, safe_bytes(n->copies[2 * pair + 1].size_bytes), 2);
        put(b, 0, 4);
    }
}

static void buses(struct buffer *b, const struct build *n) {
    for (uint32_t i = 0; i < n->bus_count; i++) {
        put(b, 1, 4);
        put(b, n->buses[i].cycle_ns, 4);
        put(b, n->buses[i].first_subdevice, 4);
        put(b, n->buses[i].subdevice_count, 4);
    }
}

static void groups(struct buffer *b, const struct build *n) {
    for (uint32_t i = 0; i < n->group_count; i++) {
        put(b, 1, 4);
        put(b, n->groups[i].has_place, 4);
        put(b, n->groups[i].first_subdevice, 4);
        put(b, n->groups[i].subdevice_count, 4);
    }
}

/** The SubDevices of groups have an alias. */
static void set_aliases(uint8_t *first, const struct build *n) {
    for (uint32_t i = 0; i < n->group_count; i++) {
        const struct build_group *g = &n->groups[i];
        for (uint32_t m = 0; m < g->subdevice_count; m++) {
            uint8_t *record = first + (size_t)record_bytes[0] * (g->first_subdevice + m);
            poke(record + 4, 0x0500u + g->first_subdevice + (m << 16));
        }
    }
}

uint8_t *build_plan(const struct build *n, size_t *len_bytes) {
    struct order *order = sorted(n);
    struct buffer b = {0};
    size_t start[MOST_SECTIONS + 1];
    const int sections = n->group_count > 0 ? MOST_SECTIONS
                         : n->bus_count > 0 ? WITH_BUSES
                                            : SECTIONS;
    put(&b, 0, 8);
    memcpy(b.bytes, "FSNPLAN", 8);
    put(&b, 1, 2);
    put(&b, (uint64_t)(sections - SECTIONS), 2);
    put(&b, 0, 8);
    put(&b, n->cycle_ns, 4);
    put(&b, (uint64_t)sections, 4);
    put(&b, 0, 4);
    for (int i = 0; i < 4 * sections; i++) {
        put(&b, 0, 4);
    }
    for (int s = 0; s < sections; s++) {
        start[s] = b.len;
        switch (s) {
        case 0:
            subdevices(&b, n);
            break;
        case 1:
            sms(&b, n);
            break;
        case 2:
            pdos(&b, n);
            break;
        case 3:
            entries(&b, n);
            break;
        case 4:
            sdos(&b, n);
            break;
        case 5:
            symbols(&b, n);
            break;
        case 6:
            blocks(&b, n);
            break;
        case 7:
            copies(&b, n, order);
            break;
        case 8:
            connections(&b, n, order);
            break;
        case 9:
            put(&b, 0x00007400u, 4);
            break; /* "", "t", "" */
        case 11:
            buses(&b, n);
            break;
        case 12:
            groups(&b, n);
            break;
        default:
            break;
        }
    }
    start[sections] = b.len;
    set_aliases(b.bytes + start[0], n);
    for (int s = 0; s < sections; s++) {
        uint8_t *row = b.bytes + 32 + 16 * s;
        poke(row, (uint32_t)s + 1);
        poke(row + 4, (uint32_t)start[s]);
        poke(row + 8, (uint32_t)((start[s + 1] - start[s]) / record_bytes[s]));
        poke(row + 12, record_bytes[s]);
    }
    poke(b.bytes + 12, (uint32_t)b.len);
    build_fix_crc(b.bytes, b.len);
    free(order);
    *len_bytes = b.len;
    return b.bytes;
}

uint8_t *build_estop(size_t *len_bytes) {
    static const struct build_sm sm[2][2] = {{{1, 9}, {2, 8}}, {{1, 8}, {2, 8}}};
    static const struct build_copy pair[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}};
    const struct build build = {
        .subdevices = 2, .sm = sm, .copies = pair, .pairs = 1, .cycle_ns = 1000000};
    return build_plan(&build, len_bytes);
}

uint8_t *build_full(size_t *len_bytes) {
    static const struct build_sm sm[2][2] = {{{1, 9}, {2, 8}}, {{1, 8}, {2, 8}}};
    static const struct build_copy pair[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}};
    static const struct build_symbol symbols[] = {
        {.sm = 0, .bit_offset = 52, .bits = 8, .stop_value = 0x5A},
        {.sm = 1, .bit_offset = 48, .bits = 16}};
    static const struct build_block blocks[] = {{0, 0, 6}, {1, 0, 6}, {2, 0, 6}, {3, 0, 6}};
    const struct build build = {.subdevices = 2,
                                .sm = sm,
                                .copies = pair,
                                .pairs = 1,
                                .cycle_ns = 1000000,
                                .symbols = symbols,
                                .blocks = blocks,
                                .symbol_count = 2,
                                .block_count = 4,
                                .sdo_count = 1};
    return build_plan(&build, len_bytes);
}

uint8_t *build_with_safety(size_t *len_bytes) {
    size_t len;
    uint8_t *old = build_full(&len);
    const size_t head = 32 + 16 * SECTIONS;
    const size_t padded = (len + 3) & ~(size_t)3;
    *len_bytes = padded + 16 + 32;
    uint8_t *bytes = calloc(1, *len_bytes);
    CHECK(bytes != NULL);
    memcpy(bytes, old, head);
    memcpy(bytes + head + 16, old + head, len - head);
    memset(bytes + padded + 16, 0x5A, 32);
    free(old);
    for (size_t s = 0; s < SECTIONS; s++) {
        uint8_t *offset = bytes + 32 + 16 * s + 4;
        poke(offset, (uint32_t)(offset[0] | offset[1] << 8) + 16);
    }
    poke(bytes + head, SECTIONS + 1);
    poke(bytes + head + 4, (uint32_t)padded + 16);
    poke(bytes + head + 8, 1);
    poke(bytes + head + 12, 32);
    poke(bytes + 24, SECTIONS + 1);
    bytes[10] = 1;
    poke(bytes + 12, (uint32_t)*len_bytes);
    build_fix_crc(bytes, *len_bytes);
    return bytes;
}

uint32_t next_random(uint64_t *state) {
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*state >> 33);
}

int open_files(void) {
    int count = 0;
    for (int fd = 0; fd < 1024; fd++) {
        count += fcntl(fd, F_GETFD) >= 0;
    }
    return count;
}

const char *program_name(void) {
    static char name[32];
    FILE *file = fopen("/proc/self/comm", "re");
    CHECK(file != NULL && fgets(name, sizeof name, file) != NULL && fclose(file) == 0);
    name[strcspn(name, "\n")] = 0;
    return name;
}
