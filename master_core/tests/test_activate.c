/** Requirements of the core on a bus, and its second proof of the plan: each fault as a whole.
 *  Values that a loaded plan cannot hold are written into its bytes without the loader. */
/* shows R2 */
#include <string.h>

#include "core/core_internal.h"
#include "emulated_rig.h"
#include "heap.h"

/** The bus of the e-stop plan: 9 + 8 and 8 + 8 bytes. */
static struct {
    uint8_t image[64];
    uint32_t base[4], begin[3];
    struct fsn_bus_layout layout;
    struct fsn_plan *plan;
    fsn_status opens;
    bool says_why;
    unsigned closed;
} on;

static fsn_status bus_open(void *bus, const struct fsn_plan *plan, struct fsn_bus_layout *layout,
                           struct fsn_fault *fault) {
    (void)bus;
    CHECK(plan == on.plan);
    *layout = on.layout;
    if (on.opens != FSN_OK && on.says_why) {
        *fault = (struct fsn_fault){.status = on.opens, .section = 2, .rule = "the cable is out"};
    }
    return on.opens;
}

static void bus_receive(void *bus, struct fsn_bus_input *input) {
    (void)bus;
    (void)input;
}

static void bus_send(void *bus) {
    (void)bus;
}

static void bus_close(void *bus) {
    (void)bus;
    on.closed++;
}

static const struct fsn_bus_ops ops = {
    .name = "own", .open = bus_open, .receive = bus_receive, .send = bus_send, .close = bus_close};

static void set_up_build(uint8_t *bytes, size_t len) {
    static const uint32_t base[4] = {0, 9, 17, 25};
    memset(&on, 0, sizeof on);
    CHECK(fsn_plan_load(bytes, len, &on.plan, NULL) == FSN_OK);
    free(bytes);
    memcpy(on.base, base, sizeof base);
    on.layout = (struct fsn_bus_layout){.image = on.image,
                                        .image_bytes = 33,
                                        .sm_base = on.base,
                                        .datagram_begin = on.begin,
                                        .datagram_count = 1};
}

static void set_up(void) {
    size_t len;
    uint8_t *bytes = build_full(&len);
    set_up_build(bytes, len);
}

/** Creates a core and compares the fault: status section.record+byte: rule; "OK" without one. */
static void answers(const char *expected, int line) {
    struct fsn_core *core = NULL;
    struct fsn_fault fault;
    char said[256] = "OK";
    const fsn_status status = fsn_core_create(on.plan, &ops, &on, &core, &fault);
    CHECK((status == FSN_OK) == (core != NULL));
    if (status != FSN_OK) {
        CHECK(fault.status == status);
        CHECK(fsn_core_create(on.plan, &ops, &on, &core, NULL) == status); /* the reason is not
                                                                            * requested */
        snprintf(said, sizeof said, "%s %u.%d+%u: %s", fsn_status_name(status) + 6, fault.section,
                 (int)fault.copy_index, fault.byte, fault.rule);
    }
    if (strcmp(said, expected) != 0) {
        fprintf(stderr, "%s:%d: said\n%s\nexpected\n%s\n", __FILE__, line, said, expected);
        exit(1);
    }
    on.closed = 0;
    fsn_core_free(core);
    CHECK(on.closed == (status == FSN_OK));
    fsn_plan_free(on.plan);
}

#define ANSWERS(expected) answers(expected, __LINE__)

static void a_bus_that_does_not_open(void) {
    set_up();
    on.opens = FSN_E_BUS_SILENT;
    ANSWERS("BUS_SILENT 0.-1+0: the bus does not open");
    set_up();
    on.opens = FSN_E_BUS_SILENT;
    on.says_why = true;
    ANSWERS("BUS_SILENT 2.0+0: the cable is out");
}

static void layouts_are_whole(void) {
    static const char left_empty[] = "BUS_IMAGE 0.-1+0: the bus left a part of its layout empty";
    static const char do_not_rise[] =
        "BUS_IMAGE 0.-1+0: datagrams do not start at 0 and rise inside the image";
    set_up();
    ANSWERS("OK");
    set_up();
    on.layout.sm_base = NULL;
    ANSWERS(left_empty);
    set_up();
    on.layout.datagram_begin = NULL;
    ANSWERS(left_empty);
    set_up();
    on.layout.datagram_count = 0;
    ANSWERS(left_empty);
    set_up();
    on.layout.image = NULL;
    ANSWERS(left_empty);
    set_up();
    on.layout.image_bytes = UINT32_MAX / 8 + 1;
    ANSWERS("BUS_IMAGE 0.-1+0: the image has 512 MiB or more");
    set_up();
    on.layout.datagram_count = 3;
    on.begin[1] = 17;
    on.begin[2] = 33;
    ANSWERS("OK"); /* one that begins at the end of the image has nothing in it */
    set_up();
    on.layout.datagram_count = 3;
    on.begin[1] = 17;
    on.begin[2] = 34;
    ANSWERS(do_not_rise);
    set_up();
    on.layout.datagram_count = 3;
    on.begin[1] = 17;
    on.begin[2] = 16;
    ANSWERS(do_not_rise);
    set_up();
    on.layout.datagram_count = 3;
    on.begin[1] = on.begin[2] = 17;
    ANSWERS("OK");
    set_up();
    on.begin[0] = 1;
    ANSWERS(do_not_rise);
}

static void sync_managers_have_places_of_their_own(void) {
    static const char no_place[] =
        "BUS_IMAGE 8.0+0: the bus gives a sync manager of this copy no place in its image";
    set_up();
    on.base[3] = 26;
    ANSWERS("BUS_IMAGE 2.3+0: the bus gives a sync manager no place inside its image");
    set_up();
    on.base[3] = 34;
    ANSWERS("BUS_IMAGE 2.3+0: the bus gives a sync manager no place inside its image");
    set_up();
    on.base[1] = 8;
    ANSWERS("BUS_OVERLAP 2.1+0: the bus lays inputs over outputs");
    set_up();
    on.base[0] = 24; /* the others are in order, but not in that of their numbers */
    on.base[3] = 0;
    ANSWERS("BUS_OVERLAP 2.0+0: the bus lays inputs over outputs");
    set_up();
    on.base[2] = FSN_NONE;
    ANSWERS("BUS_IMAGE 8.1+0: the bus gives a sync manager of this copy no place in its image");
    set_up();
    on.base[0] = FSN_NONE;
    ANSWERS(no_place);
    set_up();
    on.base[3] = FSN_NONE;
    ANSWERS(no_place);
}

static void a_copy_stays_in_one_datagram(void) {
    static const struct {
        uint32_t cut;
        const char *says;
    } table[] = {
        {9, "OK"},
        {10, "BUS_STRADDLE 8.1+0: a copy would be split over two datagrams"},
        {14, "BUS_STRADDLE 8.1+0: a copy would be split over two datagrams"},
        {15, "OK"},
        {17, "OK"},
        {18, "BUS_STRADDLE 8.1+0: a copy would be split over two datagrams"},
        {22, "BUS_STRADDLE 8.1+0: a copy would be split over two datagrams"},
        {23, "OK"},
        {26, "BUS_STRADDLE 8.0+0: a copy would be split over two datagrams"},
        {5, "BUS_STRADDLE 8.0+0: a copy would be split over two datagrams"},
        {6, "OK"},
    };
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        set_up();
        on.layout.datagram_count = 3;
        on.begin[1] = on.begin[2] = table[i].cut;
        ANSWERS(table[i].says);
    }
}

/** Copies are proved a second time where they are executed. */
static void what_the_loader_has_proved_is_proved_again(void) {
    static const struct {
        uint32_t section, record, field, value;
        const char *says;
    } table[] = {
        {8, 0, 0, 2, "COPY_DIRECTION 8.0+0: a copy must read an input and write an output"},
        {8, 0, 8, 1, "COPY_DIRECTION 8.0+0: a copy must read an input and write an output"},
        {8, 0, 4, 24, "COPY_RANGE 8.0+0: bytes lie outside their sync manager"},
        {8, 0, 12, 32, "COPY_RANGE 8.0+0: bytes lie outside their sync manager"},
        {8, 1, 28, 1, "COPY_PAIR 8.1+0: a connection is not a pair of opposite copies"},
        {9, 0, 16, 5, "COPY_PAIR 8.1+0: a connection is not a pair of opposite copies"},
        {9, 0, 8, 1, "COPY_PAIR 8.0+0: a connection is not a pair of opposite copies"},
        {9, 0, 12, 0, "COPY_PAIR 8.0+0: a connection is not a pair of opposite copies"},
        {8, 1, 8, 0, "COPY_PAIR 8.1+0: a connection is not a pair of opposite copies"},
        {8, 0, 16, 64, "COPY_FRAME 8.1+0: a copy does not cover exactly one FSoE frame"},
        {8, 1, 16, 64, "COPY_FRAME 8.1+0: a copy does not cover exactly one FSoE frame"},
    };
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        set_up();
        uint8_t *field = on.plan->bytes + on.plan->offset[table[i].section] +
                         table[i].record * fsn_record_bytes[table[i].section] + table[i].field;
        memset(field, 0, 4);
        field[0] = (uint8_t)table[i].value;
        answers(table[i].says, (int)i);
    }
}

/** The copies of a connection are there, whatever their kind field is. */
static void a_connection_has_its_copies(void) {
    set_up();
    on.plan->bytes[on.plan->offset[8] + fsn_record_bytes[8] + 24] = 2; /* copy 1: standard data */
    on.plan->bytes[on.plan->offset[9] + 16] = 9;
    ANSWERS("COPY_PAIR 9.0+0: a connection is not a pair of opposite copies");
}

/** Two copies to the same bytes, which is also proved for the image. */
static void destinations_are_disjoint(void) {
    static const struct build_sm sm[2][2] = {{{1, 9}, {2, 8}}, {{1, 8}, {2, 8}}};
    static const struct build_copy copies[] = {{0, 0, 1, 0, 4}, {0, 4, 1, 4, 4}};
    const struct build build = {.subdevices = 2, .sm = sm, .copies = copies, .standard = 2};
    for (uint32_t byte = 3; byte <= 4; byte++) {
        size_t len;
        uint8_t *bytes = build_plan(&build, &len);
        set_up_build(bytes, len);
        uint8_t *second = on.plan->bytes + on.plan->offset[8] + fsn_record_bytes[8];
        second[12] = (uint8_t)(8 * byte);
        answers(byte == 3 ? "COPY_OVERLAP 8.1+0: two destinations overlap, or copies are not sorted"
                          : "OK",
                1);
    }
}

static void what_is_needed_is_asked_for(void) {
    struct fsn_core *core = (void *)&on;
    struct fsn_fault fault;
    set_up();
    for (int lacking = 0; lacking < 3; lacking++) {
        struct fsn_bus_ops some = ops;
        some.open = lacking == 0 ? NULL : some.open;
        some.receive = lacking == 1 ? NULL : some.receive;
        some.send = lacking == 2 ? NULL : some.send;
        CHECK(fsn_core_create(on.plan, &some, &on, &core, &fault) == FSN_E_ARG && core == NULL);
        CHECK(strcmp(fault.rule, "plan, open, receive and send are needed") == 0);
    }
    CHECK(fsn_core_create(NULL, &ops, &on, &core, &fault) == FSN_E_ARG);
    CHECK(fsn_core_create(on.plan, NULL, &on, &core, &fault) == FSN_E_ARG);
    CHECK(fsn_core_create(on.plan, &ops, &on, NULL, &fault) == FSN_E_ARG);
    CHECK(fault.status == FSN_E_ARG);
    fsn_plan_free(on.plan);
}

/** The image begins with zeros, and an output without a place does not count as an output. */
static void the_image_begins_empty(void) {
    set_up();
    struct fsn_core *core;
    memset(on.image, 0xEE, sizeof on.image);
    CHECK(fsn_core_create(on.plan, &ops, &on, &core, NULL) == FSN_OK);
    for (size_t i = 0; i < sizeof on.image; i++) {
        CHECK(on.image[i] == (i < 33 ? 0 : 0xEE));
    }
    CHECK(fsn_core_is_open(core, 0) && !fsn_core_is_open(core, 1));
    CHECK(core->rt.outputs[0].bit_offset == 52 && core->rt.outputs[0].bits == 8);
    CHECK(core->rt.outputs[1].bit_offset == 9 * 8 + 48 && core->rt.outputs[1].bits == 16);
    fsn_core_free(core);
    /* An input that is marked as an output is not open. */
    on.plan->bytes[on.plan->offset[6] + fsn_record_bytes[6] + FSN_AT(symbol, flags)] |= 1;
    CHECK(fsn_core_create(on.plan, &ops, &on, &core, NULL) == FSN_OK);
    CHECK(fsn_core_is_open(core, 0) && !fsn_core_is_open(core, 1));
    fsn_core_free(core);
    fsn_plan_free(on.plan);

    static const struct build_sm sm[2][2] = {{{1, 9}, {2, 0}}, {{1, 8}, {2, 0}}};
    static const struct build_symbol symbols[] = {{.sm = 0, .bits = 8}, {.sm = 2, .bits = 8}};
    const struct build build = {.subdevices = 2, .sm = sm, .symbols = symbols, .symbol_count = 2};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    set_up_build(bytes, len);
    on.base[0] = on.base[3] = FSN_NONE; /* a symbol without bytes may have a place */
    CHECK(fsn_core_create(on.plan, &ops, &on, &core, NULL) == FSN_OK);
    CHECK(!fsn_core_is_open(core, 0) && fsn_core_is_open(core, 1));
    CHECK(fsn_core_set_output(core, 0, 1) == FSN_E_ARG);
    fsn_core_free(core);
    on.layout = (struct fsn_bus_layout){
        .sm_base = on.base, .datagram_begin = on.begin, .datagram_count = 1};
    on.base[2] = FSN_NONE; /* a bus without any image */
    CHECK(fsn_core_create(on.plan, &ops, &on, &core, NULL) == FSN_OK);
    CHECK(fsn_core_image_bytes(core) == 0 && fsn_core_cycle(core, 1) == FSN_OK);
    fsn_core_free(core);
    fsn_plan_free(on.plan);
}

/** An output is open where neither a copy nor an FSoE block has a bit of its bytes. */
static void outputs_beside_copies_are_open(void) {
    static const struct build_sm sm[2][2] = {{{1, 9}, {2, 8}}, {{1, 8}, {2, 8}}};
    static const struct build_copy copies[] = {{1, 0, 0, 2, 2}, {1, 2, 0, 6, 1}, {0, 0, 1, 0, 1}};
    static const struct {
        uint32_t bit, bits;
        bool open;
    } table[] = {{0, 16, true},  {0, 17, false}, {15, 1, true},  {16, 1, false},  {31, 1, false},
                 {32, 1, true},  {30, 3, false}, {32, 16, true}, {32, 17, false}, {47, 1, true},
                 {48, 8, false}, {55, 1, false}, {56, 16, true}, {8, 64, false}};
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        const struct build_symbol symbol = {
            .sm = 0, .bit_offset = table[i].bit, .bits = table[i].bits};
        const struct build build = {.subdevices = 2,
                                    .sm = sm,
                                    .copies = copies,
                                    .standard = 3,
                                    .symbols = &symbol,
                                    .symbol_count = 1};
        size_t len;
        uint8_t *bytes = build_plan(&build, &len);
        set_up_build(bytes, len);
        struct fsn_core *core;
        CHECK(fsn_core_create(on.plan, &ops, &on, &core, NULL) == FSN_OK);
        if (fsn_core_is_open(core, 0) != table[i].open) {
            fprintf(stderr, "row %zu\n", i);
            exit(1);
        }
        fsn_core_free(core);
        fsn_plan_free(on.plan);
    }
}

/** No plan is loaded whose outputs lie in an FSoE frame; the core looks again. */
static void outputs_in_a_frame_are_closed(void) {
    static const struct build_sm sm[2][2] = {{{1, 9}, {2, 8}}, {{1, 8}, {2, 8}}};
    static const struct build_block block = {0, 1, 6};
    static const struct build_symbol symbol = {.sm = 0, .bits = 8};
    static const struct {
        uint8_t bit;
        bool open;
    } table[] = {{0, true}, {1, false}, {24, false}, {55, false}, {56, true}};
    const struct build build = {.subdevices = 2,
                                .sm = sm,
                                .symbols = &symbol,
                                .symbol_count = 1,
                                .blocks = &block,
                                .block_count = 1};
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        size_t len;
        uint8_t *bytes = build_plan(&build, &len);
        set_up_build(bytes, len);
        on.plan->bytes[on.plan->offset[6] + FSN_AT(symbol, bit_offset)] = table[i].bit;
        struct fsn_core *core;
        struct fsn_statistics statistics;
        CHECK(fsn_core_create(on.plan, &ops, &on, &core, NULL) == FSN_OK);
        CHECK(fsn_core_is_open(core, 0) == table[i].open);
        CHECK(fsn_core_bus(core, 0, &statistics) == FSN_OK); /* it counts nothing of its own */
        fsn_core_free(core);
        fsn_plan_free(on.plan);
    }
}

/** A connection is silent after twice its watchdog; where none is stated after a second. */
static void silence_is_twice_the_watchdog(void) {
    for (int known = 0; known < 2; known++) {
        set_up();
        uint8_t *r = on.plan->bytes + on.plan->offset[9];
        r[28] = 0x34;
        r[29] = 0x12;
        r[30] = (uint8_t)(known ? 7 : 3);
        struct fsn_core *core;
        CHECK(fsn_core_create(on.plan, &ops, &on, &core, NULL) == FSN_OK);
        const uint64_t ms = known ? 2 * 0x1234 : 1000;
        CHECK(core->rt.watches[0].silent_ns == ms * 1000000);
        CHECK(core->rt.watches[0].offset[0] == 17 && core->rt.watches[0].offset[1] == 0);
        CHECK(core->rt.watches[0].size_bytes[0] == 6 && core->rt.watches[0].size_bytes[1] == 6);
        CHECK(core->rt.statistics.copies == 2 && core->rt.bytes_per_cycle == 12);
        fsn_core_free(core);
        fsn_plan_free(on.plan);
    }
}

/** Copies of a size are executed together; the three sets of values do not share a place. */
static void copies_are_grouped_by_size(void) {
    static const struct build_sm sm[2][2] = {{{1, 16}, {2, 16}}, {{1, 16}, {2, 16}}};
    static const struct build_copy copies[] = {{0, 0, 1, 0, 2}, {0, 4, 1, 4, 3}, {0, 8, 1, 8, 2}};
    static const struct build_symbol symbols[] = {{.sm = 0, .bits = 8},
                                                  {.sm = 0, .bit_offset = 8, .bits = 8}};
    const struct build build = {.subdevices = 2,
                                .sm = sm,
                                .copies = copies,
                                .standard = 3,
                                .symbols = symbols,
                                .symbol_count = 2};
    struct emulated_rig rig = emulated_rig_build(&build);
    const struct fsn_rt *rt = &rig.core->rt;
    CHECK(rt->group_count == 2 && rt->groups[0].count + rt->groups[1].count == 3);
    for (uint32_t g = 0; g < 2; g++) {
        CHECK(rt->groups[g].count == (rt->groups[g].size_bytes == 2 ? 2 : 1));
    }
    CHECK(rt->sets.set[1].values >= rt->sets.set[0].values + 2);
    CHECK(rt->sets.set[2].values >= rt->sets.set[1].values + 2);
    emulated_rig_end(&rig);
}

int main(void) {
    const long alive = heap_alive();
    a_bus_that_does_not_open();
    layouts_are_whole();
    sync_managers_have_places_of_their_own();
    a_copy_stays_in_one_datagram();
    what_the_loader_has_proved_is_proved_again();
    a_connection_has_its_copies();
    destinations_are_disjoint();
    what_is_needed_is_asked_for();
    the_image_begins_empty();
    outputs_beside_copies_are_open();
    outputs_in_a_frame_are_closed();
    silence_is_twice_the_watchdog();
    copies_are_grouped_by_size();
    CHECK(heap_alive() == alive);
    return 0;
}
