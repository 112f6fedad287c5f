/** One core after the other: the state that the second reads of the first, and how it continues. */
#define _GNU_SOURCE

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/core_internal.h"
#include "emulated_rig.h"

static struct emulated_rig set_up(void) {
    size_t len;
    uint8_t *bytes = build_full(&len);
    return emulated_rig_load(bytes, len);
}

static void *room_of(const struct emulated_rig *rig) {
    const size_t len_bytes = fsn_core_room_bytes(rig->core);
    void *room = aligned_alloc(64, (len_bytes + 63) / 64 * 64);
    CHECK(room != NULL && len_bytes > 0);
    memset(room, 0, len_bytes);
    return room;
}

static uint32_t image_bytes(const struct emulated_rig *rig) {
    return fsn_core_image_bytes(rig->core);
}

static uint8_t *image_of(const struct emulated_rig *rig, struct fsn_statistics *statistics) {
    uint8_t *image = malloc(image_bytes(rig));
    CHECK(image != NULL && fsn_core_snapshot(rig->core, statistics, NULL, image) == FSN_OK);
    return image;
}

/** Readers of the same process and of others see the same, before and after the room is shared. */
static void a_room_shows_every_cycle(void) {
    struct emulated_rig rig = set_up();
    void *room = room_of(&rig);
    const size_t len = fsn_core_room_bytes(rig.core);
    struct fsn_statistics own, shown;
    uint8_t *image = malloc(image_bytes(&rig));
    emulated_rig_cycle(&rig);
    CHECK(fsn_room_read(room, len, image_bytes(&rig), &shown, image) == FSN_E_ARG);
    CHECK(fsn_core_share(rig.core, room) == FSN_OK);
    CHECK(fsn_core_share(rig.core, room) == FSN_E_STATE);
    for (uint64_t cycle = 1; cycle < 5; cycle++) {
        uint8_t *same = image_of(&rig, &own);
        CHECK(fsn_room_read(room, len, image_bytes(&rig), &shown, image) == FSN_OK);
        CHECK(shown.cycles == cycle && memcmp(&own, &shown, sizeof own) == 0);
        CHECK(memcmp(same, image, image_bytes(&rig)) == 0);
        CHECK(fsn_room_read(room, len, image_bytes(&rig), NULL, NULL) == FSN_OK);
        free(same);
        const uint32_t pictures = fsn_room_pictures(room);
        emulated_rig_cycle(&rig);
        CHECK(fsn_room_pictures(room) == pictures + 1);
    }
    void *few = malloc(4); /* a sanitizer reports who reads more of it */
    CHECK(few != NULL);
    memcpy(few, room, 4);
    CHECK(fsn_room_read(few, 4, image_bytes(&rig), &shown, image) == FSN_E_ARG);
    free(few);
    CHECK(fsn_room_read(room, len - 1, image_bytes(&rig), &shown, image) == FSN_E_ARG);
    CHECK(fsn_room_read(room, len, image_bytes(&rig) + 1, &shown, image) == FSN_E_ARG);
    CHECK(fsn_room_read(NULL, len, image_bytes(&rig), &shown, image) == FSN_E_ARG);
    ((uint32_t *)room)[1]++; /* another version counts more */
    CHECK(fsn_room_read(room, len, image_bytes(&rig), &shown, image) == FSN_E_ARG);
    ((uint32_t *)room)[1]--;
    /* A writer that is ended in the middle of a snapshot leaves the previous one. */
    atomic_fetch_add(&rig.core->rt.snapshot.shown->begun, 1);
    CHECK(fsn_room_read(room, len, image_bytes(&rig), &shown, image) == FSN_OK);
    CHECK(shown.cycles == 5);
    atomic_fetch_add(&rig.core->rt.snapshot.shown->begun, 1);
    CHECK(fsn_room_read(room, len, image_bytes(&rig), &shown, image) == FSN_E_BUSY);
    CHECK(fsn_core_bus(rig.core, 0, &own) == FSN_E_BUSY);
    emulated_rig_end(&rig);
    free(image);
    free(room);
}

/** The first outputs of the second core are the last ones of the first, not zeros. */
static void the_second_core_goes_on(void) {
    struct emulated_rig first = set_up();
    struct emulated_rig second = set_up();
    struct fsn_statistics last, now;
    for (uint8_t i = 0; i < 7; i++) {
        const uint8_t input[8] = {0x36, i, 2, 3, 4, 5, 0x34, 0x12};
        CHECK(fsn_emulated_write_inputs(first.bus, 1, input, sizeof input) == FSN_OK);
        emulated_rig_cycle(&first);
    }
    uint8_t *image = image_of(&first, &last);
    CHECK(last.cycles == 7 && last.bytes_copied > 0);
    const uint32_t copies = last.copies;
    last.copies = 99; /* its own are its own */
    last.locked = 1;
    CHECK(fsn_core_continue(second.core, &last, image) == FSN_OK);
    CHECK(fsn_core_last_cycle(second.core) == 7);
    second.now_ns = first.now_ns;
    uint8_t *shown = image_of(&second, &now);
    CHECK(now.cycles == 7 && now.copies == copies && now.locked == 0);
    CHECK(memcmp(shown, image, image_bytes(&first)) == 0);
    free(shown);
    emulated_rig_cycle(&second); /* no new input: the outputs are unchanged */
    shown = image_of(&second, &now);
    CHECK(now.cycles == 8 && now.bytes_copied > last.bytes_copied);
    CHECK(fsn_core_continue(second.core, &last, image) == FSN_E_STATE);
    free(shown);
    free(image);
    emulated_rig_end(&first);
    emulated_rig_end(&second);
}

static uint64_t clock_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

/** Cycles that no process ran are overruns of the first; the times are those of the first core. */
static void the_gap_is_counted(void) {
    enum { CYCLE_NS = 1000000, MISSED = 50 };
    struct emulated_rig rig = set_up();
    struct fsn_thread_options options = {.cycle_ns = CYCLE_NS};
    struct fsn_statistics last = {.cycles = 1000, .overruns = 3};
    struct fsn_cycle cycle;
    uint8_t *image = calloc(1, image_bytes(&rig));
    CHECK(fsn_core_keep(rig.core, 1000000000, 1 << 20) == FSN_OK);
    const uint64_t before_ns = clock_ns();
    last.now_ns = before_ns - (MISSED + 1) * (uint64_t)CYCLE_NS;
    CHECK(fsn_core_continue(rig.core, &last, image) == FSN_OK);
    CHECK(fsn_core_start(rig.core, &options, NULL) == FSN_OK);
    while (fsn_core_record(rig.core, 1001, &cycle, NULL, NULL) != FSN_OK) {
    }
    fsn_core_stop(rig.core);
    const uint64_t gap = (cycle.now_ns - last.now_ns) / CYCLE_NS;
    CHECK(cycle.cycle == 1001 && cycle.overruns + 1u == gap && gap > MISSED);
    struct fsn_statistics now;
    CHECK(fsn_core_snapshot(rig.core, &now, NULL, NULL) == FSN_OK);
    CHECK(now.overruns >= 3 + MISSED && now.cycles > 1000);
    /* Stopped and started again, it does not count the time in between. */
    CHECK(!rig.core->rt.goes_on);
    free(image);
    emulated_rig_end(&rig);
}

/** A bus that reads the room while it sends: the state that a process ending now would leave. */
static struct {
    void *room;
    size_t len_bytes;
    uint32_t image_bytes;
    uint64_t shown; /**< cycles in the room at the last send */
} spy;

static void spy_send(void *bus) {
    struct fsn_statistics statistics;
    CHECK(fsn_room_read(spy.room, spy.len_bytes, spy.image_bytes, &statistics, NULL) == FSN_OK);
    spy.shown = statistics.cycles;
    fsn_emulated_ops()->send(bus);
}

static void a_cycle_is_shown_before_it_is_sent_where_somebody_follows(void) {
    struct emulated_rig rig = set_up();
    struct fsn_bus_ops ops = *fsn_emulated_ops();
    ops.send = spy_send;
    spy.room = room_of(&rig);
    spy.len_bytes = fsn_core_room_bytes(rig.core);
    spy.image_bytes = image_bytes(&rig);
    CHECK(fsn_core_share(rig.core, spy.room) == FSN_OK);
    rig.core->rt.ops = &ops;
    for (uint64_t cycle = 1; cycle < 9; cycle++) {
        const bool first = cycle > 4;
        fsn_core_show_first(rig.core, first);
        const uint32_t pictures = fsn_room_pictures(spy.room);
        emulated_rig_cycle(&rig);
        CHECK(spy.shown == cycle - !first);
        CHECK(fsn_room_pictures(spy.room) == pictures + 1);
    }
    fsn_core_show_first(NULL, true);
    emulated_rig_end(&rig);
    free(spy.room);
}

/** A running core has its room, and continues from no other. */
static void a_core_that_runs_is_left_alone(void) {
    struct emulated_rig rig = set_up();
    const struct fsn_thread_options options = {.cycle_ns = 4000000000};
    struct fsn_statistics statistics = {0};
    void *room = room_of(&rig);
    CHECK(fsn_core_start(rig.core, &options, NULL) == FSN_OK);
    CHECK(fsn_core_share(rig.core, room) == FSN_E_STATE);
    CHECK(fsn_core_continue(rig.core, &statistics, room) == FSN_E_STATE);
    fsn_core_stop(rig.core);
    CHECK(fsn_core_share(rig.core, room) == FSN_OK);
    emulated_rig_end(&rig);
    free(room);
}

/** A bus without any process data continues as well. */
static void an_image_may_be_empty(void) {
    static const struct build_sm sm[1][2] = {{{1, 0}, {2, 0}}};
    const struct build build = {.subdevices = 1, .sm = sm};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct emulated_rig rig = emulated_rig_load(bytes, len);
    const struct fsn_statistics last = {.cycles = 5};
    const uint8_t image[1] = {0};
    CHECK(fsn_core_image_bytes(rig.core) == 0);
    CHECK(fsn_core_continue(rig.core, &last, image) == FSN_OK);
    CHECK(fsn_core_last_cycle(rig.core) == 5);
    emulated_rig_end(&rig);
}

static void nothing_is_taken_from_nobody(void) {
    struct emulated_rig rig = set_up();
    struct fsn_statistics statistics = {0};
    uint8_t image[1] = {0};
    CHECK(fsn_core_room_bytes(NULL) == 0);
    CHECK(fsn_core_share(NULL, image) == FSN_E_ARG);
    CHECK(fsn_core_share(rig.core, NULL) == FSN_E_ARG);
    CHECK(fsn_core_continue(NULL, &statistics, image) == FSN_E_ARG);
    CHECK(fsn_core_continue(rig.core, NULL, image) == FSN_E_ARG);
    CHECK(fsn_core_continue(rig.core, &statistics, NULL) == FSN_E_ARG);
    emulated_rig_end(&rig);
}

int main(void) {
    a_room_shows_every_cycle();
    the_second_core_goes_on();
    the_gap_is_counted();
    a_cycle_is_shown_before_it_is_sent_where_somebody_follows();
    a_core_that_runs_is_left_alone();
    an_image_may_be_empty();
    nothing_is_taken_from_nobody();
    return 0;
}
