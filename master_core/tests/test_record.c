/** The recorder: its content and length, and that a cycle taken out of it is never half of two. Run
 *  under TSan too. */
#define _POSIX_C_SOURCE 200809L

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <string.h>
#include <time.h>

#include "core/core_internal.h"
#include "emulated_rig.h"

enum {
    READERS = 2,
    CYCLES = 20000,
    RECORDS = 2000,
    MOST_CYCLES = 3000000,
    SM_BYTES = 1486,
    COPY_BYTES = 1480,
};

static struct emulated_rig set_up(uint32_t cycle_ns) {
    static const struct build_sm sm[2][2] = {{{1, SM_BYTES}, {2, SM_BYTES}},
                                             {{1, SM_BYTES}, {2, SM_BYTES}}};
    static const struct build_copy copy[] = {{0, 0, 1, 0, COPY_BYTES}, {1, 0, 0, 0, COPY_BYTES}};
    const struct build build = {
        .subdevices = 2, .sm = sm, .copies = copy, .standard = 2, .cycle_ns = cycle_ns};
    return emulated_rig_build(&build);
}

/** Cycle `cycle`: its number is in every input byte of the sub. */
static void run_cycle(struct emulated_rig *rig, uint64_t cycle) {
    static uint8_t inputs[SM_BYTES];
    memset(inputs, (uint8_t)cycle, sizeof inputs);
    CHECK(fsn_emulated_write_inputs(rig->bus, 3, inputs, sizeof inputs) == FSN_OK);
    CHECK(fsn_core_cycle(rig->core, 1000 * cycle) == FSN_OK);
}

/** Everything in a record is of one cycle, the outputs too. */
static void check_record(const struct emulated_rig *rig, uint64_t cycle,
                         const struct fsn_cycle *record, const struct fsn_wkc *wkc,
                         const uint8_t *image) {
    const uint8_t *source = image + fsn_core_sm_base(rig->core, 3);
    const uint8_t *destination = image + fsn_core_sm_base(rig->core, 0);
    uint32_t expected = 0;
    uint32_t actual = 0;
    for (uint32_t d = 0; d < fsn_core_datagram_count(rig->core); d++) {
        expected += wkc[d].expected;
        actual += wkc[d].actual;
    }
    CHECK(record->cycle == cycle && record->now_ns == 1000 * cycle);
    CHECK(record->expected_wkc == expected && record->actual_wkc == actual && expected > 0);
    CHECK(source[0] == (uint8_t)cycle && memcmp(source, source + 1, SM_BYTES - 1) == 0);
    CHECK(destination[0] == source[0]);
    CHECK(memcmp(destination, destination + 1, COPY_BYTES - 1) == 0);
}

static void check_cycle(const struct emulated_rig *rig, uint64_t cycle) {
    struct fsn_cycle record;
    struct fsn_wkc wkc[64];
    static uint8_t image[4 * SM_BYTES];
    CHECK(fsn_core_datagram_count(rig->core) <= 64);
    CHECK(fsn_core_image_bytes(rig->core) <= sizeof image);
    CHECK(fsn_core_record(rig->core, cycle, &record, wkc, image) == FSN_OK);
    check_record(rig, cycle, &record, wkc, image);
}

static void the_last_cycles_are_kept(void) {
    struct emulated_rig rig = set_up(1000000);
    const size_t room = (size_t)1 << 20;
    CHECK(fsn_core_last_cycle(rig.core) == 0 && fsn_core_kept_cycles(rig.core) == 0);
    CHECK(fsn_core_record(rig.core, 1, NULL, NULL, NULL) == FSN_E_STATE);
    run_cycle(&rig, 1);
    CHECK(fsn_core_last_cycle(rig.core) == 1); /* without a recorder too */
    CHECK(fsn_core_keep(rig.core, 9000000, room) == FSN_OK);
    CHECK(fsn_core_kept_cycles(rig.core) == 10);
    CHECK(fsn_core_record(rig.core, 0, NULL, NULL, NULL) == FSN_E_ARG);
    CHECK(fsn_core_record(rig.core, 1, NULL, NULL, NULL) == FSN_E_ARG); /* before the recorder */
    CHECK(fsn_core_record(rig.core, 2, NULL, NULL, NULL) == FSN_E_BUSY);
    for (uint64_t cycle = 2; cycle <= 25; cycle++) {
        run_cycle(&rig, cycle);
        check_cycle(&rig, cycle);
    }
    CHECK(fsn_core_record(rig.core, 15, NULL, NULL, NULL) == FSN_E_ARG);
    CHECK(fsn_core_record(rig.core, 26, NULL, NULL, NULL) == FSN_E_BUSY);
    for (uint64_t cycle = 16; cycle <= 25; cycle++) {
        check_cycle(&rig, cycle);
    }
    CHECK(fsn_core_record(rig.core, 20, NULL, NULL, NULL) == FSN_OK); /* every part may be NULL */
    CHECK(fsn_core_keep(rig.core, 0, 0) == FSN_OK && fsn_core_kept_cycles(rig.core) == 0);
    CHECK(fsn_core_record(rig.core, 25, NULL, NULL, NULL) == FSN_E_STATE);
    emulated_rig_end(&rig);
}

static void the_room_bounds_it(void) {
    struct emulated_rig rig = set_up(1000000);
    const size_t image = fsn_core_image_bytes(rig.core);
    CHECK(fsn_core_keep(NULL, 1, 1) == FSN_E_ARG);
    CHECK(fsn_core_keep(rig.core, 9000000, image) == FSN_E_ARG); /* not even one */
    const struct fsn_thread_options options = {.cycle_ns = 1000000};
    CHECK(fsn_core_start(rig.core, &options, NULL) == FSN_OK); /* the refused one has no effect */
    fsn_core_stop(rig.core);
    CHECK(fsn_core_kept_cycles(rig.core) == 0);
    CHECK(fsn_core_kept_cycles(rig.core) == 0);
    CHECK(fsn_core_keep(rig.core, UINT64_MAX, 20 * image) == FSN_OK);
    const uint64_t kept = fsn_core_kept_cycles(rig.core);
    CHECK(kept >= 18 && kept < 20);
    emulated_rig_end(&rig);
    rig = set_up(0); /* no cycle time in the plan: the room alone counts */
    CHECK(fsn_core_keep(rig.core, 1, 20 * image) == FSN_OK);
    CHECK(fsn_core_kept_cycles(rig.core) == kept);
    emulated_rig_end(&rig);
}

/** The time counts in cycles of the thread, also where they are others than the plan's. */
static void the_thread_is_recorded(void) {
    struct emulated_rig rig = set_up(1000000);
    const struct fsn_thread_options options = {.cycle_ns = 500000};
    CHECK(fsn_core_keep(rig.core, 10000000, (size_t)1 << 20) == FSN_OK);
    CHECK(fsn_core_kept_cycles(rig.core) == 11);
    CHECK(fsn_core_start(rig.core, &options, NULL) == FSN_OK);
    CHECK(fsn_core_kept_cycles(rig.core) == 21);
    CHECK(fsn_core_keep(rig.core, 10000000, (size_t)1 << 20) == FSN_E_STATE);
    while (fsn_core_last_cycle(rig.core) < 30) {
        sched_yield();
    }
    fsn_core_stop(rig.core);
    const uint64_t last = fsn_core_last_cycle(rig.core);
    struct fsn_cycle before;
    struct fsn_cycle record;
    CHECK(fsn_core_record(rig.core, last - 20, &before, NULL, NULL) == FSN_OK);
    uint64_t overruns = 0;
    for (uint64_t cycle = last - 19; cycle <= last; cycle++) {
        CHECK(fsn_core_record(rig.core, cycle, &record, NULL, NULL) == FSN_OK);
        CHECK(record.cycle == cycle && record.now_ns > before.now_ns && record.work_ns > 0);
        CHECK(record.overruns == record.late_ns / 500000);
        overruns += record.overruns;
        before = record;
    }
    struct fsn_statistics s;
    CHECK(fsn_core_snapshot(rig.core, &s, NULL, NULL) == FSN_OK);
    CHECK(s.now_ns == record.now_ns && s.overruns >= overruns);
    emulated_rig_end(&rig);
}

enum { HELD_UP = 5, CYCLE_NS = 500000 };

static struct {
    const struct fsn_core *core;
    atomic_ulong looks;
    uint64_t left_out;
} held_up;

/** Reads the snapshot of the previous cycle, which is not overwritten meanwhile; one cycle takes so
 *  long that the next one comes too late. */
static void look_back(void *bus, struct fsn_bus_input *input) {
    const uint64_t last = fsn_core_last_cycle(held_up.core);
    struct fsn_cycle record;
    struct fsn_statistics s;
    fsn_emulated_ops()->receive(bus, input);
    if (last == 0) {
        return;
    }
    CHECK(fsn_core_record(held_up.core, last, &record, NULL, NULL) == FSN_OK);
    CHECK(fsn_core_snapshot((struct fsn_core *)held_up.core, &s, NULL, NULL) == FSN_OK);
    held_up.left_out += record.overruns;
    CHECK(s.cycles == last && s.now_ns == record.now_ns && s.overruns == held_up.left_out);
    CHECK(last != HELD_UP + 1 || record.overruns >= 2);
    if (last + 1 == HELD_UP) {
        const struct timespec pause = {.tv_nsec = 4 * CYCLE_NS};
        nanosleep(&pause, NULL);
    }
    atomic_fetch_add(&held_up.looks, 1);
}

/** A cycle that came too late is reported together with the cycles skipped because of it: its time
 *  and the counters of one snapshot match. */
static void a_picture_counts_what_was_left_out_before_it(void) {
    struct emulated_rig rig = set_up(CYCLE_NS);
    fsn_core_free(rig.core);
    struct fsn_bus_ops ops = *fsn_emulated_ops();
    ops.receive = look_back;
    CHECK(fsn_core_create(rig.plan, &ops, rig.bus, &rig.core, NULL) == FSN_OK);
    CHECK(fsn_core_keep(rig.core, 10000000, (size_t)1 << 20) == FSN_OK);
    held_up.core = rig.core;
    const struct fsn_thread_options options = {.cycle_ns = CYCLE_NS};
    CHECK(fsn_core_start(rig.core, &options, NULL) == FSN_OK);
    while (atomic_load(&held_up.looks) < 4 * HELD_UP) {
        sched_yield();
    }
    emulated_rig_end(&rig); /* stops the thread */
}

struct shared {
    struct emulated_rig rig;
    atomic_bool done;
    atomic_ulong records, missed;
};

/** Reads the cycles one by one; if it was too slow it continues with the oldest ones, which the
 *  writer is about to overwrite. */
static void *reader(void *argument) {
    struct shared *shared = argument;
    struct fsn_core *core = shared->rig.core;
    const uint64_t kept = fsn_core_kept_cycles(core);
    uint8_t *image = malloc(4 * SM_BYTES);
    CHECK(image != NULL);
    struct fsn_wkc wkc[64];
    uint64_t cycle = 1;
    while (!atomic_load(&shared->done)) {
        struct fsn_cycle record;
        const fsn_status status = fsn_core_record(core, cycle, &record, wkc, image);
        if (status == FSN_OK) {
            check_record(&shared->rig, cycle++, &record, wkc, image);
            atomic_fetch_add(&shared->records, 1);
        } else if (status == FSN_E_BUSY) {
            sched_yield();
        } else {
            CHECK(status == FSN_E_ARG);
            const uint64_t last = fsn_core_last_cycle(core);
            cycle = last >= kept ? last - kept + 1 : 1;
            atomic_fetch_add(&shared->missed, 1);
        }
    }
    free(image);
    return NULL;
}

static void readers_see_whole_cycles(void) {
    static struct shared shared;
    shared.rig = set_up(1000);
    CHECK(fsn_core_keep(shared.rig.core, 7000, (size_t)1 << 20) == FSN_OK);
    pthread_t threads[READERS];
    for (int i = 0; i < READERS; i++) {
        CHECK(pthread_create(&threads[i], NULL, reader, &shared) == 0);
    }
    uint64_t cycle = 0;
    while (cycle < CYCLES || (atomic_load(&shared.records) < RECORDS && cycle < MOST_CYCLES)) {
        run_cycle(&shared.rig, ++cycle);
        if (cycle % 64 == 0) {
            sched_yield(); /* on one CPU the others must get their turn */
        }
    }
    atomic_store(&shared.done, true);
    for (int i = 0; i < READERS; i++) {
        pthread_join(threads[i], NULL);
    }
    printf("%lu records, %lu times too slow, during %lu cycles\n", atomic_load(&shared.records),
           atomic_load(&shared.missed), (unsigned long)cycle);
    CHECK(atomic_load(&shared.records) > 0);
    emulated_rig_end(&shared.rig);
}

int main(void) {
    the_last_cycles_are_kept();
    the_room_bounds_it();
    the_thread_is_recorded();
    a_picture_counts_what_was_left_out_before_it();
    readers_see_whole_cycles();
    return 0;
}
