/** The copy engine against a plain loop, on random networks, with every byte of the image compared.
 */
/* shows R1, R2 */
#include <string.h>

#include "emulated_rig.h"
#include "heap.h"
#include "rt/rt.h"

enum { SUBS = 12, SM_BYTES = 400 };

/** A bus whose image the test owns. */
struct own_bus {
    uint8_t image[2 * SUBS * SM_BYTES];
    uint8_t before_send[2 * SUBS * SM_BYTES];
    uint32_t base[2 * SUBS], begin[2];
    uint32_t image_bytes, datagrams;
    uint8_t inputs[2 * SUBS * SM_BYTES];
};

static fsn_status bus_open(void *context, const struct fsn_plan *plan,
                           struct fsn_bus_layout *layout, struct fsn_fault *fault) {
    struct own_bus *bus = context;
    (void)fault;
    (void)plan;
    *layout = (struct fsn_bus_layout){
        .image = bus->image,
        .image_bytes = bus->image_bytes,
        .sm_base = bus->base,
        .datagram_begin = bus->begin,
        .datagram_count = bus->datagrams,
    };
    return FSN_OK;
}

static void bus_receive(void *context, struct fsn_bus_input *input) {
    struct own_bus *bus = context;
    for (uint32_t sub = 0; sub < SUBS; sub++) {
        const uint32_t at = bus->base[2 * sub + 1];
        memcpy(bus->image + at, bus->inputs + at, SM_BYTES);
    }
    input->wkc[0] = (struct fsn_wkc){3 * SUBS, 3 * SUBS};
}

static void bus_send(void *context) {
    struct own_bus *bus = context;
    memcpy(bus->before_send, bus->image, bus->image_bytes);
}

static const struct fsn_bus_ops own_ops = {
    .name = "own", .open = bus_open, .receive = bus_receive, .send = bus_send};

static const uint32_t frames[] = {6, 7, 11, 15, 19, 31, 63, 255};

/** Fills the outputs of all SubDevices with random pairs of frames; standard copies in between. */
static uint32_t random_pairs(uint64_t *seed, struct build_copy *copies, uint32_t room) {
    uint32_t used_out[SUBS] = {0};
    uint32_t used_in[SUBS] = {0};
    uint32_t pairs = 0;
    while (pairs < room) {
        const uint32_t a = next_random(seed) % SUBS;
        const uint32_t b = next_random(seed) % SUBS;
        const uint32_t down = frames[next_random(seed) % 8];
        const uint32_t up = frames[next_random(seed) % 8];
        const uint32_t gap = next_random(seed) % 3;
        if (a == b || used_out[a] + up + gap > SM_BYTES || used_out[b] + down + gap > SM_BYTES ||
            used_in[a] + down + gap > SM_BYTES || used_in[b] + up + gap > SM_BYTES) {
            break;
        }
        copies[2 * pairs] = (struct build_copy){a, used_in[a] + gap, b, used_out[b] + gap, down};
        copies[2 * pairs + 1] = (struct build_copy){b, used_in[b] + gap, a, used_out[a] + gap, up};
        used_in[a] += down + gap;
        used_out[b] += down + gap;
        used_in[b] += up + gap;
        used_out[a] += up + gap;
        pairs++;
    }
    return pairs;
}

static void one_network(uint64_t *seed) {
    static struct build_sm sm[SUBS][2];
    static struct build_copy copies[256];
    static struct own_bus bus;
    for (uint32_t i = 0; i < SUBS; i++) {
        sm[i][0] = (struct build_sm){1, SM_BYTES};
        sm[i][1] = (struct build_sm){2, SM_BYTES};
    }
    const struct build build = {.subdevices = SUBS,
                                .sm = (const struct build_sm(*)[2])sm,
                                .copies = copies,
                                .pairs = random_pairs(seed, copies, 128),
                                .cycle_ns = 1000000};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct fsn_plan *plan;
    struct fsn_fault fault;
    CHECK(fsn_plan_load(bytes, len, &plan, &fault) == FSN_OK);
    bus.image_bytes = sizeof bus.image;
    bus.datagrams = 1;
    for (uint32_t i = 0; i < 2 * SUBS; i++) {
        bus.base[i] = i * SM_BYTES;
    }
    struct fsn_core *core;
    CHECK(fsn_core_create(plan, &own_ops, &bus, &core, &fault) == FSN_OK);
    for (int cycle = 0; cycle < 3; cycle++) {
        for (size_t i = 0; i < sizeof bus.inputs; i++) {
            bus.inputs[i] = (uint8_t)next_random(seed);
        }
        static uint8_t expected[sizeof bus.image];
        memset(expected, 0, sizeof expected);
        for (uint32_t s = 0; s < SUBS; s++) {
            memcpy(expected + bus.base[2 * s + 1], bus.inputs + bus.base[2 * s + 1], SM_BYTES);
        }
        for (uint32_t c = 0; c < 2 * build.pairs; c++) {
            memcpy(expected + bus.base[2 * copies[c].to] + copies[c].destination_byte,
                   bus.inputs + bus.base[2 * copies[c].from + 1] + copies[c].source_byte,
                   copies[c].size_bytes);
        }
        CHECK(fsn_core_cycle(core, (uint64_t)cycle * 1000000u) == FSN_OK);
        CHECK(memcmp(bus.before_send, expected, sizeof expected) == 0);
    }
    fsn_core_free(core);
    fsn_plan_free(plan);
    free(bytes);
}

/** Every size by itself: two copies move whole, no adjacent byte changes; groups in sequence, one
 *  of them empty. */
static void every_size_moves_whole(void) {
    enum { LONGEST = 1490, ROOM = 4 * (LONGEST + 2) };
    static uint8_t image[ROOM], expected[ROOM];
    uint64_t seed = 7;
    for (uint32_t size = 1; size <= LONGEST; size += size < 300 ? 1 : 170) {
        const struct fsn_rt_copy copies[] = {
            {1, 2 * (LONGEST + 2) + 1}, {LONGEST + 3, 3 * (LONGEST + 2) + 1}, {0, 2 * LONGEST + 3}};
        const struct fsn_rt_group groups[] = {{size, 0, 2}, {size, 2, 0}, {1, 2, 1}};
        for (uint32_t i = 0; i < ROOM; i++) {
            image[i] = (uint8_t)next_random(&seed);
        }
        memcpy(expected, image, ROOM);
        for (uint32_t i = 0; i < 2; i++) {
            memcpy(expected + copies[i].destination, expected + copies[i].source, size);
        }
        expected[copies[2].destination] = expected[copies[2].source];
        fsn_rt_copy_all(image, copies, groups, 3);
        CHECK(memcmp(image, expected, ROOM) == 0);
    }
}

/** Frames that are neighbours on both sides become one copy. */
static void neighbours_are_merged(void) {
    static const struct build_sm sm[2][2] = {{{1, 24}, {2, 24}}, {{1, 24}, {2, 24}}};
    static const struct build_copy pairs[] = {{0, 0, 1, 0, 6},   {1, 0, 0, 0, 6},
                                              {0, 6, 1, 6, 7},   {1, 6, 0, 6, 7},
                                              {0, 13, 1, 14, 7}, {1, 13, 0, 13, 7}};
    const struct build build = {
        .subdevices = 2, .sm = sm, .copies = pairs, .pairs = 3, .cycle_ns = 1000};
    struct emulated_rig rig = emulated_rig_build(&build);
    struct fsn_statistics statistics;
    CHECK(fsn_core_snapshot(rig.core, &statistics, NULL, NULL) == FSN_OK);
    CHECK(statistics.copies == 6 && statistics.merged_copies == 3);
    emulated_rig_end(&rig);
}

/** A bus that lays inputs over outputs, or leaves its image, is refused before a byte moves. */
static void bad_buses_are_refused(void) {
    static struct own_bus bus;
    size_t len;
    uint8_t *bytes = build_estop(&len);
    struct fsn_plan *plan;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    struct fsn_core *core;
    struct fsn_fault fault;
    bus.image_bytes = 33;
    bus.datagrams = 1;
    const uint32_t good[4] = {0, 9, 17, 25};
    memcpy(bus.base, good, sizeof good);
    bus.base[1] = 8;
    CHECK(fsn_core_create(plan, &own_ops, &bus, &core, &fault) == FSN_E_BUS_OVERLAP);
    bus.base[1] = 26;
    CHECK(fsn_core_create(plan, &own_ops, &bus, &core, &fault) == FSN_E_BUS_IMAGE);
    CHECK(core == NULL && fault.status == FSN_E_BUS_IMAGE);
    bus.base[1] = FSN_NONE;
    CHECK(fsn_core_create(plan, &own_ops, &bus, &core, &fault) == FSN_E_BUS_IMAGE);
    bus.base[1] = 9;
    bus.datagrams = 2;
    bus.begin[1] = 34;
    CHECK(fsn_core_create(plan, &own_ops, &bus, &core, &fault) == FSN_E_BUS_IMAGE);
    bus.begin[0] = 1;
    CHECK(fsn_core_create(plan, &own_ops, &bus, &core, &fault) == FSN_E_BUS_IMAGE);
    bus.begin[0] = 0;
    bus.begin[1] = 20; /* cuts the output frame of the sub, bytes 17 to 22: copy 1 */
    CHECK(fsn_core_create(plan, &own_ops, &bus, &core, &fault) == FSN_E_BUS_STRADDLE);
    CHECK(fault.section == 8 && fault.copy_index == 1 && fault.rule != NULL);
    bus.begin[1] = 12; /* and the input frame of the main, bytes 9 to 14: its source */
    CHECK(fsn_core_create(plan, &own_ops, &bus, &core, &fault) == FSN_E_BUS_STRADDLE);
    CHECK(fault.copy_index == 1);
    bus.begin[1] = 17; /* between two sync managers */
    CHECK(fsn_core_create(plan, &own_ops, &bus, &core, &fault) == FSN_OK);
    fsn_core_free(core);
    CHECK(fsn_core_create(plan, &own_ops, NULL, NULL, &fault) == FSN_E_ARG);
    fsn_plan_free(plan);
    free(bytes);
}

int main(void) {
    const long alive = heap_alive();
    uint64_t seed = 1;
    for (int i = 0; i < 300; i++) {
        one_network(&seed);
    }
    every_size_moves_whole();
    neighbours_are_merged();
    bad_buses_are_refused();
    CHECK(heap_alive() == alive);
    return 0;
}
