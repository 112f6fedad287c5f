#define _POSIX_C_SOURCE 200809L

/** Several buses of one core: parts of a plan, cycles of their own, frames that cross whole. */
#include <pthread.h>
#include <stdatomic.h>
#include <string.h>
#include <time.h>

#include "builder.h"
#include "fsn/acyclic.h"
#include "fsn/fsn.h"
#include "heap.h"
#include "plan/plan_internal.h"

enum { FRAME = 31, SM_BYTES = 62, LEAD_NS = 1000000, NO_CPU = 100000 };

/* SubDevices 0 and 1 on the first bus, 2 and 3 on the second. One connection on each, one across,
 * and 8 bytes of standard data back across. */
static const struct build_sm sms[4][2] = {{{1, 70}, {2, 70}},
                                          {{1, SM_BYTES}, {2, SM_BYTES}},
                                          {{1, 70}, {2, 70}},
                                          {{1, SM_BYTES}, {2, SM_BYTES}}};
static const struct build_copy copies[] = {
    {0, 0, 1, 0, FRAME},   {1, 0, 0, 0, FRAME},   /* first bus */
    {2, 0, 3, 0, FRAME},   {3, 0, 2, 0, FRAME},   /* second bus */
    {0, 31, 2, 31, FRAME}, {2, 31, 0, 31, FRAME}, /* across */
    {2, 62, 0, 62, 8},                            /* standard, across */
};
static const struct build_symbol symbols[] = {{.sm = 2, .bit_offset = 8 * FRAME, .bits = 8},
                                              {.sm = 6, .bit_offset = 8 * FRAME, .bits = 8},
                                              {.sm = 7, .bit_offset = 8 * FRAME, .bits = 8}};

static uint8_t *build_buses(const struct build_bus *buses, uint32_t count, size_t *len) {
    const struct build build = {.subdevices = 4,
                                .sm = sms,
                                .copies = copies,
                                .pairs = 3,
                                .standard = 1,
                                .cycle_ns = LEAD_NS,
                                .symbols = symbols,
                                .symbol_count = 3,
                                .sdo_count = 1,
                                .buses = buses,
                                .bus_count = count};
    return build_plan(&build, len);
}

static fsn_status refused(const uint8_t *bytes, size_t len, struct fsn_fault *fault) {
    struct fsn_plan *plan;
    const fsn_status status = fsn_plan_load(bytes, len, &plan, fault);
    CHECK(status != FSN_OK && plan == NULL);
    return status;
}

static struct fsn_plan *load(const struct build_bus *buses, uint32_t count) {
    size_t len;
    uint8_t *bytes = build_buses(buses, count, &len);
    struct fsn_plan *plan = NULL;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    free(bytes);
    return plan;
}

static struct fsn_plan *two_buses(uint32_t further_ns) {
    const struct build_bus buses[] = {{LEAD_NS, 0, 2}, {further_ns, 2, 2}};
    return load(buses, 2);
}

/* -- plans ---------------------------------------------------------------------------------- */

static void buses_share_out_the_subdevices(void) {
    struct fsn_plan *plan = two_buses(4 * LEAD_NS);
    struct fsn_bus_info info;
    CHECK(fsn_plan_bus_count(plan) == 2);
    CHECK(fsn_plan_bus(plan, 0, &info) == FSN_OK && info.cycle_ns == LEAD_NS &&
          info.first_subdevice == 0 && info.subdevice_count == 2 && strcmp(info.name, "t") == 0);
    CHECK(fsn_plan_bus(plan, 1, &info) == FSN_OK && info.cycle_ns == 4 * LEAD_NS &&
          info.first_subdevice == 2 && info.subdevice_count == 2);
    CHECK(fsn_plan_bus(plan, 2, &info) == FSN_E_ARG);
    CHECK(fsn_plan_bus_of(plan, 1) == 0 && fsn_plan_bus_of(plan, 2) == 1 &&
          fsn_plan_bus_of(plan, 3) == 1);
    fsn_plan_free(plan);
}

/** Each with the record and the byte of its field, and the rule. */
static void a_wrong_share_is_refused(void) {
    static const char follows[] = "SubDevices do not follow those of the bus before";
    static const char cycle[] = "the first bus has the cycle of the plan, others none below it";
    const struct {
        struct build_bus bus[2];
        fsn_status status;
        uint32_t record, field;
        const char *rule;
    } wrong[] = {
        {{{LEAD_NS, 0, 2}, {LEAD_NS, 3, 1}}, FSN_E_PLAN_REFERENCE, 1, 8, follows},
        {{{LEAD_NS, 0, 2}, {LEAD_NS, 1, 3}}, FSN_E_PLAN_REFERENCE, 1, 8, follows},
        {{{LEAD_NS, 0, 4}, {LEAD_NS, 4, 0}}, FSN_E_PLAN_REFERENCE, 1, 8, follows},
        {{{LEAD_NS, 0, 2}, {LEAD_NS, 2, 3}}, FSN_E_PLAN_REFERENCE, 1, 8, follows},
        {{{LEAD_NS, 1, 1}, {LEAD_NS, 2, 2}}, FSN_E_PLAN_REFERENCE, 0, 8, follows},
        {{{LEAD_NS, 0, 2}, {LEAD_NS, 2, 1}},
         FSN_E_PLAN_REFERENCE,
         FSN_FAULT_NO_RECORD,
         0,
         "a SubDevice belongs to no bus"},
        {{{LEAD_NS, 0, 2}, {LEAD_NS - 1, 2, 2}}, FSN_E_PLAN_VALUE, 1, 4, cycle},
        {{{LEAD_NS + 1, 0, 2}, {LEAD_NS + 1, 2, 2}}, FSN_E_PLAN_VALUE, 0, 4, cycle},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        size_t len;
        struct fsn_fault fault;
        uint8_t *bytes = build_buses(wrong[i].bus, 2, &len);
        const uint32_t record = wrong[i].record == FSN_FAULT_NO_RECORD ? 0 : wrong[i].record;
        CHECK(refused(bytes, len, &fault) == wrong[i].status);
        CHECK(fault.section == 12 && fault.copy_index == wrong[i].record);
        CHECK(fault.byte == len - 32 + 16 * record + wrong[i].field);
        CHECK(strcmp(fault.rule, wrong[i].rule) == 0);
        free(bytes);
    }
}

/** Buses without a name, without a cycle, one alone, two hashes; a bus section in an old format. */
static void a_wrong_section_is_refused(void) {
    const struct build_bus bus[] = {{LEAD_NS, 0, 2}, {LEAD_NS, 2, 2}};
    const struct {
        size_t back; /**< of the changed byte, from the end */
        uint8_t value;
        fsn_status status;
    } changes[] = {
        {32, 0, FSN_E_PLAN_STRING}, {32, 200, FSN_E_PLAN_STRING}, {16, 0, FSN_E_PLAN_STRING}};
    size_t len;
    struct fsn_fault fault;
    for (size_t i = 0; i < sizeof changes / sizeof changes[0]; i++) {
        uint8_t *bytes = build_buses(bus, 2, &len);
        bytes[len - changes[i].back] = changes[i].value;
        build_fix_crc(bytes, len);
        CHECK(refused(bytes, len, &fault) == changes[i].status && fault.section == 12);
        free(bytes);
    }
    uint8_t *bytes = build_buses(bus, 1, &len);
    CHECK(refused(bytes, len, &fault) == FSN_E_PLAN_SECTION && fault.section == 12);
    free(bytes);
    bytes = build_buses(bus, 2, &len);
    bytes[20] = bytes[21] = bytes[22] = 0; /* no cycle of the plan */
    memset(bytes + len - 28, 0, 4);        /* nor of the first bus */
    build_fix_crc(bytes, len);
    CHECK(refused(bytes, len, &fault) == FSN_E_PLAN_VALUE && fault.section == 12);
    bytes[10] = 1;
    build_fix_crc(bytes, len);
    CHECK(refused(bytes, len, &fault) == FSN_E_PLAN_SECTION && fault.byte == 24);
    free(bytes);
}

static void a_part_has_what_is_between_its_own(void) {
    struct fsn_plan *plan = two_buses(4 * LEAD_NS);
    struct fsn_plan *part;
    CHECK(fsn_plan_part(plan, 2, &part) == FSN_E_ARG && part == NULL);
    CHECK(fsn_plan_part(plan, 1, &part) == FSN_OK);
    fsn_plan_free(plan);
    CHECK(fsn_plan_bus_count(part) == 1 && fsn_plan_cycle_ns(part) == 4 * LEAD_NS);
    CHECK(fsn_plan_subdevice_count(part) == 2 && fsn_plan_sm_count(part) == 4 &&
          fsn_plan_symbol_count(part) == 2 && fsn_plan_copy_count(part) == 2 &&
          fsn_plan_connection_count(part) == 1);
    struct fsn_subdevice_info sub;
    CHECK(fsn_plan_subdevice(part, 0, &sub) == FSN_OK && sub.product_code == 0x1002 &&
          sub.first_sm == 0 && sub.sdo_count == 0);
    CHECK(fsn_plan_subdevice(part, 1, &sub) == FSN_OK && sub.product_code == 0x1003 &&
          sub.first_sm == 2 && sub.first_sdo == 0 && sub.sdo_count == 1);
    struct fsn_sm_info sm;
    CHECK(fsn_plan_sm(part, 3, &sm) == FSN_OK && sm.subdevice == 1 && sm.size_bytes == SM_BYTES &&
          sm.first_pdo == 3);
    struct fsn_symbol_info symbol;
    CHECK(fsn_plan_symbol(part, 0, &symbol) == FSN_OK && symbol.sm == 2);
    CHECK(fsn_plan_symbol(part, 1, &symbol) == FSN_OK && symbol.sm == 3);
    struct fsn_copy_info copy;
    CHECK(fsn_plan_copy(part, 0, &copy) == FSN_OK && copy.source_sm == 3 &&
          copy.destination_sm == 0 && copy.connection == 0);
    CHECK(fsn_plan_copy(part, 1, &copy) == FSN_OK && copy.source_sm == 1 &&
          copy.destination_sm == 2 && copy.connection == 0);
    struct fsn_connection_info c;
    CHECK(fsn_plan_connection(part, 0, &c) == FSN_OK && c.main_subdevice == 0 &&
          c.sub_subdevice == 1 && c.copy_to_sub == 1 && c.copy_to_main == 0 &&
          c.connection_id == 2);
    fsn_plan_free(part);
}

/** Standard data between SubDevices of one bus stays theirs; a part is proved as a plan is. */
static void a_part_is_proved_anew(void) {
    static const struct build_copy standard[] = {{0, 0, 1, 0, 8}};
    const struct build_bus buses[] = {{LEAD_NS, 0, 2}, {LEAD_NS, 2, 2}};
    const struct build build = {.subdevices = 4,
                                .sm = sms,
                                .copies = standard,
                                .standard = 1,
                                .cycle_ns = LEAD_NS,
                                .buses = buses,
                                .bus_count = 2};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct fsn_plan *plan, *part;
    struct fsn_copy_info copy;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    free(bytes);
    CHECK(fsn_plan_part(plan, 0, &part) == FSN_OK && fsn_plan_copy_count(part) == 1);
    CHECK(fsn_plan_copy(part, 0, &copy) == FSN_OK && copy.connection == FSN_NONE);
    CHECK(copy.source_sm == 1 && copy.destination_sm == 2 && copy.size_bytes == 8);
    fsn_plan_free(part);
    plan->bytes[plan->offset[3] + 2] = 1; /* reserved, without the loader */
    CHECK(fsn_plan_part(plan, 0, &part) == FSN_E_PLAN_RESERVED && part == NULL);
    fsn_plan_free(plan);
}

static void the_part_of_one_bus_is_the_plan(void) {
    struct fsn_plan *plan = load(NULL, 0);
    struct fsn_plan *part;
    struct fsn_bus_info info;
    CHECK(fsn_plan_bus_count(plan) == 1 && fsn_plan_bus_of(plan, 3) == 0);
    CHECK(fsn_plan_bus(plan, 0, &info) == FSN_OK && info.name[0] == 0 && info.cycle_ns == LEAD_NS &&
          info.first_subdevice == 0 && info.subdevice_count == 4);
    CHECK(fsn_plan_part(plan, 0, &part) == FSN_OK && part == plan);
    fsn_plan_free(plan);
    fsn_plan_free(part);
}

/* -- cycles --------------------------------------------------------------------------------- */

struct rig {
    struct fsn_plan *plan;
    struct fsn_emulated *bus;
    struct fsn_core *core;
    uint64_t now_ns;
};

static struct rig set_up(uint32_t further_ns) {
    struct rig rig = {.plan = two_buses(further_ns)};
    CHECK(fsn_emulated_create(rig.plan, &rig.bus) == FSN_OK);
    CHECK(fsn_core_create(rig.plan, fsn_emulated_ops(), rig.bus, &rig.core, NULL) == FSN_OK);
    return rig;
}

static void end(struct rig *rig) {
    fsn_core_free(rig->core);
    fsn_emulated_free(rig->bus);
    fsn_plan_free(rig->plan);
}

static void cycle(struct rig *rig) {
    rig->now_ns += LEAD_NS;
    CHECK(fsn_core_cycle(rig->core, rig->now_ns) == FSN_OK);
}

/** All frames of a SubDevice hold one byte. */
static void show(struct rig *rig, uint32_t subdevice, uint8_t value) {
    uint8_t bytes[70];
    const size_t size = subdevice % 2 == 0 ? 70 : SM_BYTES;
    memset(bytes, value, sizeof bytes);
    CHECK(fsn_emulated_write_inputs(rig->bus, 2 * subdevice + 1, bytes, size) == FSN_OK);
}

/** A byte in the outputs of a SubDevice. */
static uint8_t seen(struct rig *rig, uint32_t subdevice, size_t byte) {
    uint8_t bytes[70] = {0};
    CHECK(fsn_emulated_read_outputs(rig->bus, 2 * subdevice, bytes, sizeof bytes, NULL) == FSN_OK);
    return bytes[byte];
}

/** Cycles until a byte is there. */
static unsigned cycles_until(struct rig *rig, uint32_t subdevice, size_t byte, uint8_t value) {
    unsigned count = 0;
    while (seen(rig, subdevice, byte) != value) {
        cycle(rig);
        CHECK(++count < 20);
    }
    return count;
}

/** Inside a bus a copy takes no longer than alone; across, one cycle of the receiving side more. */
static void delays_are_those_of_the_buses(void) {
    struct rig rig = set_up(LEAD_NS);
    cycle(&rig);
    show(&rig, 0, 1);
    show(&rig, 2, 2);
    CHECK(cycles_until(&rig, 1, 0, 1) == 1); /* first bus */
    CHECK(seen(&rig, 3, 0) == 2);            /* second bus, in the same cycle */
    CHECK(seen(&rig, 0, 31) == 2 && seen(&rig, 0, 62) == 2);
    CHECK(seen(&rig, 2, 31) == 0);
    CHECK(cycles_until(&rig, 2, 31, 1) == 1); /* to the second bus: with its next cycle */
    end(&rig);

    rig = set_up(4 * LEAD_NS);
    cycle(&rig); /* the second bus has its cycles in 1, 5, 9 … of the first */
    show(&rig, 0, 1);
    show(&rig, 2, 2);
    CHECK(cycles_until(&rig, 1, 0, 1) == 1);
    CHECK(seen(&rig, 2, 31) == 0 && seen(&rig, 0, 31) == 0);
    CHECK(cycles_until(&rig, 0, 31, 2) == 3 && seen(&rig, 3, 0) == 2);
    CHECK(seen(&rig, 2, 31) == 1);
    end(&rig);
}

static void outputs_of_each_bus_are_written(void) {
    struct rig rig = set_up(4 * LEAD_NS);
    uint64_t value = 0;
    const uint32_t both[] = {0, 1};
    const uint64_t values[] = {0xA1, 0xB2};
    CHECK(fsn_core_set_outputs(rig.core, 2, both, values) == FSN_OK);
    cycle(&rig);
    CHECK(seen(&rig, 1, FRAME) == 0xA1 && seen(&rig, 3, FRAME) == 0);
    CHECK(cycles_until(&rig, 3, FRAME, 0xB2) == 4);
    show(&rig, 3, 0xC3);
    for (int i = 0; i < 4; i++) {
        cycle(&rig);
    }
    uint8_t image[1024];
    CHECK(fsn_core_image_bytes(rig.core) <= sizeof image);
    CHECK(fsn_core_snapshot(rig.core, NULL, NULL, image) == FSN_OK);
    CHECK(fsn_core_read_symbol(rig.core, image, 2, &value) == FSN_OK && value == 0xC3);
    end(&rig);
}

static void a_lost_bus_takes_its_own_with_it(void) {
    struct rig rig = set_up(2 * LEAD_NS);
    for (uint8_t i = 1; i < 5; i++) {
        show(&rig, 0, i);
        show(&rig, 1, i);
        show(&rig, 2, i);
        show(&rig, 3, i);
        cycle(&rig);
    }
    struct fsn_statistics all, first, second;
    CHECK(fsn_core_bus(rig.core, 0, &first) == FSN_OK &&
          fsn_core_bus(rig.core, 1, &second) == FSN_OK &&
          fsn_core_snapshot(rig.core, &all, NULL, NULL) == FSN_OK);
    CHECK(first.cycles == 4 && second.cycles == 2 && all.cycles == 4);
    CHECK(first.expected_wkc == 6 && second.expected_wkc == 6 && all.expected_wkc == 12);
    CHECK(first.actual_wkc == 6 && second.actual_wkc == 6 && all.actual_wkc == 12);
    CHECK(fsn_core_bus(rig.core, 2, &all) == FSN_E_ARG && fsn_core_bus(NULL, 0, &all) == FSN_E_ARG);
    CHECK(fsn_emulated_set_present(rig.bus, 2, false) == FSN_OK &&
          fsn_emulated_set_present(rig.bus, 3, false) == FSN_OK);
    for (uint8_t i = 11; i < 17; i++) {
        show(&rig, 0, i);
        show(&rig, 1, i);
        show(&rig, 2, i);
        show(&rig, 3, i);
        cycle(&rig);
    }
    CHECK(seen(&rig, 1, 0) == 16 && seen(&rig, 0, 0) == 16); /* continues */
    CHECK(seen(&rig, 0, 31) < 11 && seen(&rig, 0, 62) < 11); /* old, whole */
    CHECK(seen(&rig, 0, 31) == seen(&rig, 0, 61));
    CHECK(fsn_core_bus(rig.core, 0, &first) == FSN_OK &&
          fsn_core_bus(rig.core, 1, &second) == FSN_OK);
    CHECK(first.actual_wkc == 6 && first.wkc_errors == 0);
    CHECK(second.actual_wkc == 0 && second.wkc_errors == 3);
    /* SM 1 and 3 are inputs of the first bus, 5 and 7 of the second. */
    CHECK(fsn_core_stale_cycles(rig.core, 1) == 0 && fsn_core_stale_cycles(rig.core, 3) == 0 &&
          fsn_core_stale_cycles(rig.core, 5) == 3 && fsn_core_stale_cycles(rig.core, 7) == 3);
    CHECK(fsn_emulated_set_present(rig.bus, 2, true) == FSN_OK &&
          fsn_emulated_set_present(rig.bus, 3, true) == FSN_OK);
    cycle(&rig);
    cycle(&rig);
    CHECK(seen(&rig, 0, 31) == 16);
    end(&rig);
}

/* -- threads -------------------------------------------------------------------------------- */

struct live {
    struct fsn_emulated *bus;
    uint32_t subdevice;
    atomic_bool *stop;
    uint64_t frames, torn, changes;
};

/** A device: writes frames of one changing byte, and checks that received frames are whole. */
static void *device(void *argument) {
    struct live *of = argument;
    const size_t size = of->subdevice % 2 == 0 ? 70 : SM_BYTES;
    uint8_t value = 0;
    uint8_t last = 0;
    while (!atomic_load_explicit(of->stop, memory_order_relaxed)) {
        uint8_t bytes[70];
        bool fresh;
        memset(bytes, ++value, sizeof bytes);
        CHECK(fsn_emulated_write_inputs(of->bus, 2 * of->subdevice + 1, bytes, size) == FSN_OK);
        CHECK(fsn_emulated_read_outputs(of->bus, 2 * of->subdevice, bytes, sizeof bytes, &fresh) ==
              FSN_OK);
        for (size_t at = 0; at + FRAME <= size; at += FRAME) {
            for (size_t i = 1; i < FRAME; i++) {
                of->torn += of->subdevice % 2 == 0 && bytes[at + i] != bytes[at];
            }
        }
        of->frames += fresh;
        of->changes += bytes[31] != last;
        last = bytes[31];
    }
    return NULL;
}

/** Each bus has its thread; whatever crosses is of one piece, and both sides go on. */
static void frames_cross_whole(void) {
    struct fsn_plan *plan = two_buses(LEAD_NS);
    struct fsn_several_member members[2];
    struct fsn_emulated *bus[2];
    struct fsn_several *several;
    struct fsn_core *core;
    for (uint32_t n = 0; n < 2; n++) {
        struct fsn_plan *part;
        CHECK(fsn_plan_part(plan, n, &part) == FSN_OK);
        CHECK(fsn_emulated_create(part, &bus[n]) == FSN_OK);
        fsn_plan_free(part);
        members[n] = (struct fsn_several_member){fsn_emulated_ops(), bus[n], part};
    }
    const struct fsn_thread_options options = {.cycle_ns = 100000};
    CHECK(fsn_several_create(NULL, members, &options, &several) == FSN_E_ARG);
    CHECK(fsn_several_create(plan, NULL, &options, &several) == FSN_E_ARG);
    CHECK(fsn_several_create(plan, members, &options, NULL) == FSN_E_ARG);
    /* A thread that cannot be had: the bus that was to have it is named, and nothing is open. */
    const struct fsn_thread_options nowhere = {.cpu = NO_CPU};
    struct fsn_fault fault;
    CHECK(fsn_several_create(plan, members, &nowhere, &several) == FSN_OK);
    CHECK(fsn_core_create(plan, fsn_several_ops(several), several, &core, &fault) != FSN_OK);
    CHECK(core == NULL && strcmp(fault.detail, "bus t") == 0);
    fsn_several_free(several);
    CHECK(fsn_several_create(plan, members, &options, &several) == FSN_OK);
    CHECK(fsn_core_create(plan, fsn_several_ops(several), several, &core, NULL) == FSN_OK);
    CHECK(fsn_core_start(core, &options, NULL) == FSN_OK);
    atomic_bool stop = false;
    struct live devices[] = {{.bus = bus[0], .subdevice = 0, .stop = &stop},
                             {.bus = bus[1], .subdevice = 0, .stop = &stop}};
    pthread_t threads[2];
    for (size_t i = 0; i < 2; i++) {
        CHECK(pthread_create(&threads[i], NULL, device, &devices[i]) == 0);
    }
    struct fsn_statistics first = {0}, second = {0};
    while (first.cycles < 2000 || second.cycles < 200) {
        const struct timespec ms = {.tv_nsec = 1000000};
        nanosleep(&ms, NULL);
        if (fsn_core_bus(core, 0, &first) != FSN_OK || fsn_core_bus(core, 1, &second) != FSN_OK) {
            continue; /* busy: again */
        }
    }
    atomic_store(&stop, true);
    for (size_t i = 0; i < 2; i++) {
        CHECK(pthread_join(threads[i], NULL) == 0);
        CHECK(devices[i].torn == 0 && devices[i].frames > 0 && devices[i].changes > 0);
    }
    fsn_core_free(core);
    fsn_several_free(several);
    fsn_several_free(NULL);
    fsn_emulated_free(bus[0]);
    fsn_emulated_free(bus[1]);
    fsn_plan_free(plan);
}

/* -- refusals ------------------------------------------------------------------------------- */

static fsn_status refuse_open(void *bus, const struct fsn_plan *plan, struct fsn_bus_layout *layout,
                              struct fsn_fault *fault) {
    (void)plan;
    (void)layout;
    if (fault != NULL) {
        *fault = *(struct fsn_fault *)bus;
    }
    return ((const struct fsn_fault *)bus)->status;
}

static void no_receive(void *bus, struct fsn_bus_input *input) {
    (void)bus;
    (void)input;
}

static void no_send(void *bus) {
    (void)bus;
}

/** The bus is named, and its SubDevices have the numbers of the whole plan. */
static void a_refusal_names_the_bus(void) {
    static const struct fsn_bus_ops refusing = {
        .name = "refusing", .open = refuse_open, .receive = no_receive, .send = no_send};
    struct fsn_plan *plan = two_buses(LEAD_NS);
    struct fsn_plan *part;
    struct fsn_emulated *first;
    struct fsn_several *several;
    struct fsn_core *core;
    struct fsn_fault why = {
        .status = FSN_E_BUS_MISSING, .section = 1, .copy_index = 1, .detail = "no answer"};
    CHECK(fsn_plan_part(plan, 0, &part) == FSN_OK && fsn_emulated_create(part, &first) == FSN_OK);
    const struct fsn_several_member members[] = {{fsn_emulated_ops(), first, part},
                                                 {&refusing, &why, NULL}};
    const struct fsn_thread_options options = {.cycle_ns = 0};
    CHECK(fsn_several_create(plan, members, &options, &several) == FSN_OK);
    struct fsn_fault fault;
    CHECK(fsn_core_create(plan, fsn_several_ops(several), several, &core, &fault) ==
          FSN_E_BUS_MISSING);
    CHECK(fault.status == FSN_E_BUS_MISSING && fault.section == 1 && fault.copy_index == 3);
    CHECK(strcmp(fault.detail, "bus t: no answer") == 0);
    why = (struct fsn_fault){.status = FSN_E_BUS_IMAGE, .section = 2, .copy_index = 2};
    CHECK(fsn_core_create(plan, fsn_several_ops(several), several, &core, &fault) ==
          FSN_E_BUS_IMAGE);
    CHECK(fault.section == 2 && fault.copy_index == 6 && strcmp(fault.detail, "bus t") == 0);
    why = (struct fsn_fault){.status = FSN_E_SYS, .copy_index = FSN_FAULT_NO_RECORD};
    CHECK(fsn_core_create(plan, fsn_several_ops(several), several, &core, &fault) == FSN_E_SYS);
    CHECK(fault.copy_index == FSN_FAULT_NO_RECORD);
    struct fsn_bus_layout layout;
    CHECK(fsn_several_ops(several)->open(several, plan, &layout, NULL) == FSN_E_SYS);
    struct fsn_plan *other = two_buses(LEAD_NS);
    CHECK(fsn_core_create(other, fsn_several_ops(several), several, &core, NULL) == FSN_E_ARG);
    fsn_plan_free(other);
    fsn_several_free(several);
    fsn_emulated_free(first);
    fsn_plan_free(part);
    fsn_plan_free(plan);
}

/* -- next to the cycle ------------------------------------------------------------------------ */

/** A bus of two SubDevices in memory, with data set by a test. */
struct scripted {
    struct fsn_emulated *bus;
    uint32_t number, members; /**< on the ring; more than the plan has */
    uint8_t asked_state;
    bool there;
    struct fsn_bus_clocks clocks; /**< in use unless they are FSN_CLOCKS_UNKNOWN */
    char called[64];              /**< the last call, with its arguments as this bus got them */
};

static struct scripted buses_said[2];

static fsn_status scripted_open(void *bus, const struct fsn_plan *plan,
                                struct fsn_bus_layout *layout, struct fsn_fault *fault) {
    return fsn_emulated_ops()->open(((struct scripted *)bus)->bus, plan, layout, fault);
}

static void scripted_receive(void *bus, struct fsn_bus_input *input) {
    fsn_emulated_ops()->receive(((struct scripted *)bus)->bus, input);
    input->counts.lost_frames = 1 + ((struct scripted *)bus)->number;
    input->counts.unsent_frames = 1;
    input->send_errno = 5;
}

static void scripted_send(void *bus) {
    fsn_emulated_ops()->send(((struct scripted *)bus)->bus);
}

static void scripted_close(void *bus) {
    fsn_emulated_ops()->close(((struct scripted *)bus)->bus);
}

static bool scripted_poll(void *bus, uint8_t al_state, uint64_t now_ns) {
    struct scripted *s = bus;
    s->asked_state = now_ns == 77 ? al_state : 0;
    return s->there;
}

static fsn_status scripted_state(void *bus, uint32_t subdevice, struct fsn_bus_subdevice *seen) {
    seen->vendor_id = 100 * ((struct scripted *)bus)->number + subdevice;
    return FSN_OK;
}

static bool scripted_clocks(void *bus, struct fsn_bus_clocks *clocks) {
    *clocks = ((struct scripted *)bus)->clocks;
    return clocks->state != FSN_CLOCKS_UNKNOWN;
}

static uint32_t scripted_count(void *bus) {
    return ((struct scripted *)bus)->members;
}

static uint32_t scripted_place(void *bus, uint32_t subdevice) {
    return ((struct scripted *)bus)->there ? subdevice + 1 : FSN_NONE; /* a coupler comes first */
}

static fsn_status scripted_member(void *bus, uint32_t position, struct fsn_bus_member *member) {
    (void)bus;
    member->subdevice = position == 0 ? FSN_NONE : position - 1;
    return FSN_OK;
}

static fsn_status note(void *bus, const char *what, unsigned position, unsigned more) {
    struct scripted *s = bus;
    snprintf(s->called, sizeof s->called, "%s %u %u", what, position, more);
    return FSN_OK;
}

static fsn_status scripted_upload(void *bus, struct fsn_transfer *transfer) {
    return note(bus, "upload", transfer->position, transfer->index);
}

static fsn_status scripted_download(void *bus, struct fsn_transfer *transfer) {
    return note(bus, "download", transfer->position, transfer->index);
}

static fsn_status scripted_sii_read(void *bus, uint32_t position, uint32_t offset, uint8_t *data,
                                    uint32_t size_bytes) {
    memset(data, 0, size_bytes);
    return note(bus, "sii-read", position, offset);
}

static fsn_status scripted_sii_write(void *bus, uint32_t position, uint32_t offset, uint16_t word) {
    return note(bus, "sii-write", position, offset + word);
}

static fsn_status scripted_pdo(void *bus, uint32_t position, uint8_t sm, uint32_t pdo,
                               uint16_t *index, bool *output, uint32_t *entries, uint32_t room,
                               uint32_t *count) {
    (void)index;
    (void)output;
    (void)entries;
    (void)count;
    return note(bus, "pdo", position, sm + pdo + room);
}

static const struct fsn_bus_acyclic scripted_acyclic = {.count = scripted_count,
                                                        .place = scripted_place,
                                                        .member = scripted_member,
                                                        .upload = scripted_upload,
                                                        .download = scripted_download,
                                                        .sii_read = scripted_sii_read,
                                                        .sii_write = scripted_sii_write,
                                                        .pdo = scripted_pdo};
static const struct fsn_bus_ops scripted_ops = {.name = "scripted",
                                                .open = scripted_open,
                                                .receive = scripted_receive,
                                                .send = scripted_send,
                                                .close = scripted_close,
                                                .poll = scripted_poll,
                                                .state = scripted_state,
                                                .clocks = scripted_clocks,
                                                .acyclic = &scripted_acyclic};

struct said {
    struct fsn_plan *plan, *part[2];
    struct fsn_several *several;
    struct fsn_core *core;
};

static struct said open_scripted(const struct fsn_bus_ops *ops) {
    struct said said = {.plan = two_buses(LEAD_NS)};
    struct fsn_several_member members[2];
    for (uint32_t n = 0; n < 2; n++) {
        buses_said[n] = (struct scripted){.number = n, .members = 3, .there = true};
        CHECK(fsn_plan_part(said.plan, n, &said.part[n]) == FSN_OK);
        CHECK(fsn_emulated_create(said.part[n], &buses_said[n].bus) == FSN_OK);
        members[n] = (struct fsn_several_member){ops, &buses_said[n], said.part[n]};
    }
    CHECK(fsn_several_create(said.plan, members, NULL, &said.several) == FSN_OK);
    CHECK(strcmp(fsn_several_ops(said.several)->name, ops->name) == 0);
    CHECK(fsn_core_create(said.plan, fsn_several_ops(said.several), said.several, &said.core,
                          NULL) == FSN_OK);
    return said;
}

static void close_scripted(struct said *said) {
    fsn_core_free(said->core);
    fsn_several_free(said->several);
    for (uint32_t n = 0; n < 2; n++) {
        fsn_emulated_free(buses_said[n].bus);
        fsn_plan_free(said->part[n]);
    }
    fsn_plan_free(said->plan);
}

/** Each acyclic request reaches the bus that has the SubDevice, with the numbers of that bus. */
static void each_bus_answers_for_its_own(void) {
    struct said said = open_scripted(&scripted_ops);
    struct fsn_several *several = said.several;
    struct fsn_core *core = said.core;
    const struct fsn_bus_ops *ops = fsn_several_ops(several);

    CHECK(fsn_core_poll(core, FSN_AL_OP, 77));
    CHECK(buses_said[0].asked_state == FSN_AL_OP && buses_said[1].asked_state == FSN_AL_OP);
    buses_said[0].there = false; /* the other one is still polled */
    CHECK(!fsn_core_poll(core, FSN_AL_SAFEOP, 77) && buses_said[1].asked_state == FSN_AL_SAFEOP);
    buses_said[0].there = true;
    struct fsn_bus_subdevice seen;
    for (uint32_t n = 0; n < 4; n++) {
        CHECK(fsn_core_subdevice(core, n, &seen) == FSN_OK);
        CHECK(seen.vendor_id == 100 * (n / 2) + n % 2);
    }
    /* Places are counted over both rings, each with a coupler before its SubDevices. */
    const struct fsn_bus_acyclic *acyclic = ops->acyclic;
    struct fsn_bus_member member;
    static const uint32_t planned[] = {FSN_NONE, 0, 1, FSN_NONE, 2, 3};
    CHECK(acyclic->count(several) == 6);
    for (uint32_t n = 0; n < 6; n++) {
        CHECK(acyclic->member(several, n, &member) == FSN_OK && member.subdevice == planned[n]);
    }
    CHECK(acyclic->place(several, 1) == 2 && acyclic->place(several, 2) == 4);
    buses_said[1].there = false;
    CHECK(acyclic->place(several, 3) == FSN_NONE);
    buses_said[1].there = true;
    uint8_t data[8];
    struct fsn_transfer transfer = {.index = 9, .data = data, .size_bytes = sizeof data};
    CHECK(fsn_core_upload(core, 3, &transfer) == FSN_OK && transfer.position == 5);
    CHECK(strcmp(buses_said[1].called, "upload 2 9") == 0);
    CHECK(fsn_core_download(core, 0, &transfer) == FSN_OK && transfer.position == 1);
    CHECK(strcmp(buses_said[0].called, "download 1 9") == 0);
    CHECK(acyclic->sii_read(several, 3, 64, data, 8) == FSN_OK);
    CHECK(strcmp(buses_said[1].called, "sii-read 0 64") == 0);
    CHECK(acyclic->sii_write(several, 4, 8, 3) == FSN_OK);
    CHECK(strcmp(buses_said[1].called, "sii-write 1 11") == 0);
    CHECK(acyclic->pdo(several, 2, 3, 1, NULL, NULL, NULL, 5, NULL) == FSN_OK);
    CHECK(strcmp(buses_said[0].called, "pdo 2 9") == 0);

    CHECK(fsn_core_cycle(core, 1) == FSN_OK && fsn_core_cycle(core, 2) == FSN_OK);
    struct fsn_statistics all, first, second;
    CHECK(fsn_core_snapshot(core, &all, NULL, NULL) == FSN_OK);
    CHECK(fsn_core_bus(core, 0, &first) == FSN_OK && fsn_core_bus(core, 1, &second) == FSN_OK);
    CHECK(first.counts.lost_frames == 2 && second.counts.lost_frames == 4 &&
          all.counts.lost_frames == 6);
    CHECK(all.counts.unsent_frames == 4 && all.send_errno == 5);
    close_scripted(&said);
}

/** Clocks without a reference, then those that are apart are reported, whichever bus they are of;
 *  else those of the first bus that has any. */
static void clocks_that_are_apart_come_first(void) {
    enum {
        NONE = FSN_CLOCKS_UNKNOWN,
        SAME = FSN_CLOCKS_SYNCHRONOUS,
        APART = FSN_CLOCKS_APART,
        LOST = FSN_CLOCKS_LOST
    };
    static const struct {
        uint8_t first, second;
        uint32_t bus; /**< whose are reported: 1 or 2, 0: none */
    } cases[] = {{NONE, NONE, 0},  {SAME, NONE, 1},  {NONE, SAME, 2},  {SAME, SAME, 1},
                 {SAME, APART, 2}, {APART, SAME, 1}, {APART, NONE, 1}, {NONE, APART, 2},
                 {LOST, APART, 1}, {APART, LOST, 2}, {SAME, LOST, 2},  {APART, APART, 1}};
    struct said said = open_scripted(&scripted_ops);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct fsn_bus_clocks clocks = {0};
        buses_said[0].clocks = (struct fsn_bus_clocks){.state = cases[i].first, .worst_ns = 1};
        buses_said[1].clocks = (struct fsn_bus_clocks){.state = cases[i].second, .worst_ns = 2};
        const fsn_status status = fsn_core_clocks(said.core, &clocks);
        CHECK((status == FSN_OK) == (cases[i].bus != 0) && clocks.worst_ns == cases[i].bus);
    }
    close_scripted(&said);
}

/** Nothing is offered that the buses cannot do. */
static void what_a_bus_cannot_do_is_not_offered(void) {
    static const struct fsn_bus_acyclic bare = {.count = scripted_count, .place = scripted_place};
    struct fsn_bus_ops ops = scripted_ops;
    ops.acyclic = &bare;
    ops.clocks = NULL;
    struct said said = open_scripted(&ops);
    const struct fsn_bus_acyclic *offered = fsn_several_ops(said.several)->acyclic;
    CHECK(offered->count(said.several) == 6 && offered->place(said.several, 1) == 2);
    CHECK(offered->member == NULL && offered->upload == NULL && offered->download == NULL);
    CHECK(offered->sii_read == NULL && offered->sii_write == NULL && offered->pdo == NULL);
    struct fsn_bus_clocks clocks;
    uint8_t byte;
    struct fsn_transfer transfer = {.index = 9, .data = &byte, .size_bytes = 1};
    CHECK(fsn_core_clocks(said.core, &clocks) != FSN_OK);
    CHECK(fsn_core_upload(said.core, 3, &transfer) != FSN_OK);
    close_scripted(&said);
}

#ifdef FSN_TEST_HEAP
/** Whichever allocation fails: a refusal, and no leak. */
static void memory_may_run_out(void) {
    struct fsn_plan *plan = two_buses(LEAD_NS);
    const long alive = heap.alive;
    fsn_status status = FSN_E_NOMEM;
    for (long fails_in = 1; status != FSN_OK; fails_in++) {
        struct fsn_emulated *bus = NULL;
        struct fsn_core *core = NULL;
        heap.fails_in = fails_in;
        status = fsn_emulated_create(plan, &bus);
        if (status == FSN_OK) {
            status = fsn_core_create(plan, fsn_emulated_ops(), bus, &core, NULL);
        }
        CHECK(status == (heap.fails_in > 0 ? FSN_OK : FSN_E_NOMEM));
        CHECK(status == FSN_OK || core == NULL);
        heap.fails_in = 0;
        CHECK(fails_in < 500);
        fsn_core_free(core);
        fsn_emulated_free(bus);
        CHECK(heap.alive == alive);
    }
    fsn_plan_free(plan);
}
#endif

int main(void) {
    const long alive = heap_alive();
    buses_share_out_the_subdevices();
    a_wrong_share_is_refused();
    a_wrong_section_is_refused();
    a_part_has_what_is_between_its_own();
    a_part_is_proved_anew();
    the_part_of_one_bus_is_the_plan();
    delays_are_those_of_the_buses();
    outputs_of_each_bus_are_written();
    a_lost_bus_takes_its_own_with_it();
    a_refusal_names_the_bus();
    each_bus_answers_for_its_own();
    clocks_that_are_apart_come_first();
    what_a_bus_cannot_do_is_not_offered();
#ifdef FSN_TEST_HEAP
    memory_may_run_out();
#endif
    CHECK(heap_alive() == alive);
    frames_cross_whole(); /* libc keeps what it needs for threads */
    return 0;
}
