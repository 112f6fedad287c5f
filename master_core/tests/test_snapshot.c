/** Snapshots and frames taken while the cycle runs are never half of two cycles. Run under TSan
 *  too.
 *
 *  The image is large, so that a reader and the writer meet in the middle of it all the time, and
 *  the test continues until enough of its snapshots were whole. */
/* shows R1 */
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <string.h>

#include "emulated_rig.h"

enum { CYCLES = 20000, PICTURES = 500, MOST_CYCLES = 3000000, SM_BYTES = 1486, COPY_BYTES = 1480 };

struct shared {
    struct emulated_rig on;
    atomic_bool done;
    atomic_ulong pictures, reads;
};

/** Each input block is one value over and over; so must be whatever arrives, on both sides. */
static void *device(void *argument) {
    struct shared *shared = argument;
    uint8_t value = 1;
    static uint8_t inputs[SM_BYTES], outputs[SM_BYTES];
    while (!atomic_load(&shared->done)) {
        memset(inputs, value, sizeof inputs);
        value = (uint8_t)(value % 250 + 1);
        CHECK(fsn_emulated_write_inputs(shared->on.bus, 1, inputs, sizeof inputs) == FSN_OK);
        CHECK(fsn_emulated_read_outputs(shared->on.bus, 2, outputs, sizeof outputs, NULL) ==
              FSN_OK);
        CHECK(memcmp(outputs, outputs + 1, COPY_BYTES - 1) == 0);
        atomic_fetch_add(&shared->reads, 1);
    }
    return NULL;
}

/** The inputs of the sub, and the outputs of the main that they are copied to, hold the number of
 *  the cycle: statistics and image of one snapshot must be of one cycle. */
static void check_bytes_of_cycle(const struct fsn_core *core, const uint8_t *image, uint8_t cycle) {
    const uint8_t *source = image + fsn_core_sm_base(core, 3);
    const uint8_t *destination = image + fsn_core_sm_base(core, 0);
    CHECK(source[0] == cycle && memcmp(source, source + 1, SM_BYTES - 1) == 0);
    CHECK(destination[0] == cycle && memcmp(destination, destination + 1, COPY_BYTES - 1) == 0);
}

static void *reader(void *argument) {
    struct shared *shared = argument;
    uint64_t last = 0;
    static uint8_t image[4 * SM_BYTES];
    const uint32_t source = fsn_core_sm_base(shared->on.core, 1);
    const uint32_t destination = fsn_core_sm_base(shared->on.core, 2);
    while (!atomic_load(&shared->done)) {
        struct fsn_statistics statistics;
        if (fsn_core_snapshot(shared->on.core, &statistics, NULL, image) != FSN_OK) {
            continue;
        }
        CHECK(statistics.cycles >= last);
        CHECK(statistics.now_ns == 1000 * statistics.cycles);
        CHECK(statistics.bytes_copied == 2 * COPY_BYTES * statistics.cycles);
        if (statistics.cycles > 0) {
            check_bytes_of_cycle(shared->on.core, image, (uint8_t)statistics.cycles);
        }
        CHECK(memcmp(image + source, image + destination, COPY_BYTES) == 0);
        CHECK(memcmp(image + source, image + source + 1, SM_BYTES - 1) == 0);
        last = statistics.cycles;
        atomic_fetch_add(&shared->pictures, 1);
    }
    return NULL;
}

int main(void) {
    static const struct build_sm sm[2][2] = {{{1, SM_BYTES}, {2, SM_BYTES}},
                                             {{1, SM_BYTES}, {2, SM_BYTES}}};
    static const struct build_copy copy[] = {{0, 0, 1, 0, COPY_BYTES}, {1, 0, 0, 0, COPY_BYTES}};
    const struct build build = {.subdevices = 2, .sm = sm, .copies = copy, .standard = 2};
    static struct shared shared;
    shared.on = emulated_rig_build(&build);
    pthread_t threads[2];
    CHECK(pthread_create(&threads[0], NULL, device, &shared) == 0);
    CHECK(pthread_create(&threads[1], NULL, reader, &shared) == 0);
    static uint8_t inputs[SM_BYTES];
    uint64_t cycle = 0;
    while (cycle < CYCLES || (atomic_load(&shared.pictures) < PICTURES && cycle < MOST_CYCLES)) {
        cycle++;
        /* Written here and not by the device: with two CPUs it hardly runs next to writer and
         * reader. */
        memset(inputs, (uint8_t)cycle, sizeof inputs);
        CHECK(fsn_emulated_write_inputs(shared.on.bus, 3, inputs, sizeof inputs) == FSN_OK);
        CHECK(fsn_core_cycle(shared.on.core, 1000 * cycle) == FSN_OK);
        if (cycle % 1024 == 0) {
            sched_yield(); /* on one CPU the others must get their turn */
        }
    }
    atomic_store(&shared.done, true);
    pthread_join(threads[0], NULL);
    pthread_join(threads[1], NULL);
    printf("%lu pictures, %lu device reads during %lu cycles\n", atomic_load(&shared.pictures),
           atomic_load(&shared.reads), (unsigned long)cycle);
    CHECK(atomic_load(&shared.pictures) > 0);
    emulated_rig_end(&shared.on);
    return 0;
}
