/** Several outputs in one cycle: they are sent together. Run under TSan too. */
#define _POSIX_C_SOURCE 200809L

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>

#include "emulated_rig.h"

enum { OUTPUTS = 200, CYCLES = 20000, SETS = 500, MOST_CYCLES = 3000000, SM_BYTES = 2 * OUTPUTS };

/** Outputs 0 … OUTPUTS - 1 of 16 bits, then one input, then one output under a copy. */
static struct emulated_rig set_up(void) {
    static const struct build_sm sm[2][2] = {{{1, SM_BYTES}, {2, 8}}, {{1, 8}, {2, 8}}};
    static const struct build_copy copies[] = {{0, 0, 1, 0, 4}};
    static struct build_symbol symbols[OUTPUTS + 2];
    for (uint32_t i = 0; i < OUTPUTS; i++) {
        symbols[i] = (struct build_symbol){.sm = 0, .bit_offset = 16 * i, .bits = 16};
    }
    symbols[OUTPUTS] = (struct build_symbol){.sm = 1, .bits = 16};
    symbols[OUTPUTS + 1] = (struct build_symbol){.sm = 2, .bits = 16};
    const struct build build = {.subdevices = 2,
                                .sm = sm,
                                .copies = copies,
                                .standard = 1,
                                .symbols = symbols,
                                .symbol_count = OUTPUTS + 2};
    return emulated_rig_build(&build);
}

static uint32_t sent(const struct emulated_rig *rig, uint32_t symbol) {
    uint8_t out[SM_BYTES];
    CHECK(fsn_emulated_read_outputs(rig->bus, 0, out, sizeof out, NULL) == FSN_OK);
    return out[2 * symbol] + 256u * out[2 * symbol + 1];
}

static void cycle(struct emulated_rig *rig, uint64_t number) {
    CHECK(fsn_core_cycle(rig->core, 1000 * number) == FSN_OK);
}

static void all_or_none(void) {
    struct emulated_rig rig = set_up();
    CHECK(fsn_core_is_open(rig.core, 0) && fsn_core_is_open(rig.core, OUTPUTS - 1));
    CHECK(!fsn_core_is_open(rig.core, OUTPUTS) && !fsn_core_is_open(rig.core, OUTPUTS + 1));
    CHECK(!fsn_core_is_open(rig.core, OUTPUTS + 2) && !fsn_core_is_open(NULL, 0));
    CHECK(fsn_core_set_outputs(rig.core, 2, (const uint32_t[]){5, 3},
                               (const uint64_t[]){500, 300}) == FSN_OK);
    cycle(&rig, 1);
    CHECK(sent(&rig, 5) == 500 && sent(&rig, 3) == 300 && sent(&rig, 4) == 0);
    static const uint32_t wrong[][2] = {{5, OUTPUTS}, {OUTPUTS + 1, 5}, {5, OUTPUTS + 2}};
    static const fsn_status refusal[] = {FSN_E_CLOSED, FSN_E_CLOSED, FSN_E_ARG};
    for (int i = 0; i < 3; i++) {
        CHECK(fsn_core_set_outputs(rig.core, 2, wrong[i], (const uint64_t[]){7, 7}) == refusal[i]);
        cycle(&rig, 2);
        CHECK(sent(&rig, 5) == 500);
    }
    /* One more set keeps the earlier values; two sets before one cycle count both. */
    CHECK(fsn_core_set_output(rig.core, 4, 400) == FSN_OK);
    CHECK(fsn_core_set_outputs(rig.core, 2, (const uint32_t[]){5, 5}, (const uint64_t[]){1, 501}) ==
          FSN_OK);
    cycle(&rig, 3);
    CHECK(sent(&rig, 3) == 300 && sent(&rig, 4) == 400 && sent(&rig, 5) == 501);
    CHECK(fsn_core_set_outputs(rig.core, 0, NULL, NULL) == FSN_OK);
    CHECK(fsn_core_set_outputs(rig.core, 1, NULL, NULL) == FSN_E_ARG);
    CHECK(fsn_core_set_outputs(NULL, 0, NULL, NULL) == FSN_E_ARG);
    cycle(&rig, 4);
    CHECK(sent(&rig, 3) == 300 && sent(&rig, 4) == 400 && sent(&rig, 5) == 501);
    emulated_rig_end(&rig);
}

struct shared {
    struct emulated_rig rig;
    atomic_bool done;
    atomic_ulong sets;
};

/** Sets more and more outputs to one value, and then all of them again and again. */
static void *writer(void *argument) {
    struct shared *shared = argument;
    uint32_t symbols[OUTPUTS];
    uint64_t values[OUTPUTS];
    for (uint64_t n = 1; !atomic_load(&shared->done); n++) {
        for (uint32_t i = 0; i < OUTPUTS; i++) {
            symbols[i] = (i * 7 + (uint32_t)n) % OUTPUTS;
            values[i] = n;
        }
        CHECK(fsn_core_set_outputs(shared->rig.core, OUTPUTS, symbols, values) == FSN_OK);
        atomic_fetch_add(&shared->sets, 1);
        sched_yield();
    }
    return NULL;
}

static void every_cycle_sends_one_set(void) {
    static struct shared shared;
    shared.rig = set_up();
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, writer, &shared) == 0);
    uint8_t out[SM_BYTES];
    uint64_t number = 0;
    unsigned long changes = 0;
    uint32_t before = 0;
    while (number < CYCLES || (atomic_load(&shared.sets) < SETS && number < MOST_CYCLES)) {
        cycle(&shared.rig, ++number);
        CHECK(fsn_emulated_read_outputs(shared.rig.bus, 0, out, sizeof out, NULL) == FSN_OK);
        const uint32_t value = out[0] + 256u * out[1];
        for (uint32_t i = 1; i < OUTPUTS; i++) {
            CHECK(out[2 * i] + 256u * out[2 * i + 1] == value);
        }
        changes += value != before;
        before = value;
        if (number % 64 == 0) {
            sched_yield(); /* on one CPU the writer must get its turn */
        }
    }
    atomic_store(&shared.done, true);
    pthread_join(thread, NULL);
    cycle(&shared.rig, number + 1);
    CHECK(sent(&shared.rig, 0) == (atomic_load(&shared.sets) & 0xFFFF)); /* the last one counts */
    printf("%lu sets, %lu changes seen in %lu cycles\n", atomic_load(&shared.sets), changes,
           (unsigned long)number);
    emulated_rig_end(&shared.rig);
}

int main(void) {
    all_or_none();
    every_cycle_sends_one_set();
    return 0;
}
