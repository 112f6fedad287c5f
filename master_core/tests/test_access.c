/** Outputs of the application, ages, datagrams, resets, and other threads next to a running one. */
/* shows R2 */
#define _POSIX_C_SOURCE 200809L

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <string.h>

#include "core/core_internal.h"
#include "emulated_rig.h"

static struct emulated_rig set_up_full(void) {
    size_t len;
    uint8_t *bytes = build_full(&len);
    return emulated_rig_load(bytes, len);
}

static void send(struct emulated_rig *rig, uint32_t sm, const char *frame) {
    uint8_t inputs[8] = {0};
    memcpy(inputs, frame, 6);
    inputs[6] = 0x34;
    inputs[7] = 0x12;
    CHECK(fsn_emulated_write_inputs(rig->bus, sm, inputs, sizeof inputs) == FSN_OK);
}

static struct fsn_statistics statistics(struct emulated_rig *rig) {
    struct fsn_statistics s;
    CHECK(fsn_core_snapshot(rig->core, &s, NULL, NULL) == FSN_OK);
    return s;
}

/** Bits 52 to 59 of the main's outputs, next to its frame and to bits that are not the symbol's. */
static void outputs_touch_their_bits_only(void) {
    struct emulated_rig rig = set_up_full();
    uint8_t out[9];
    send(&rig, 3, "\x36\xFF\xFF\xFF\xFF\xFF");
    CHECK(fsn_core_set_output(rig.core, 0, 0xFFFFFFFFFFFFFFFFu) == FSN_OK);
    emulated_rig_cycle(&rig);
    CHECK(fsn_emulated_read_outputs(rig.bus, 0, out, sizeof out, NULL) == FSN_OK);
    CHECK(memcmp(out, "\x36\xFF\xFF\xFF\xFF\xFF\xF0\x0F\x00", 9) == 0);
    CHECK(fsn_core_set_output(rig.core, 0, 0xA5) == FSN_OK);
    emulated_rig_cycle(&rig);
    CHECK(fsn_emulated_read_outputs(rig.bus, 0, out, sizeof out, NULL) == FSN_OK);
    CHECK(memcmp(out, "\x36\xFF\xFF\xFF\xFF\xFF\x50\x0A\x00", 9) == 0);
    emulated_rig_cycle(&rig); /* and it stays */
    uint8_t image[33];
    uint64_t value;
    CHECK(fsn_core_snapshot(rig.core, NULL, NULL, image) == FSN_OK);
    CHECK(fsn_core_read_symbol(rig.core, image, 0, &value) == FSN_OK && value == 0xA5);
    send(&rig, 1, "\x36\x00\x00\x00\x00\x00");
    emulated_rig_cycle(&rig);
    CHECK(fsn_core_snapshot(rig.core, NULL, NULL, image) == FSN_OK);
    CHECK(fsn_core_read_symbol(rig.core, image, 1, &value) == FSN_OK && value == 0x1234);
    CHECK(fsn_core_read_symbol(rig.core, image, 2, &value) == FSN_E_ARG);
    CHECK(fsn_core_set_output(rig.core, 1, 1) == FSN_E_CLOSED); /* an input */
    CHECK(fsn_core_set_output(rig.core, 2, 1) == FSN_E_ARG);
    emulated_rig_end(&rig);
}

/** A symbol under a standard copy belongs to the copy. */
static void copied_outputs_are_closed(void) {
    static const struct build_sm sm[2][2] = {{{1, 4}, {2, 4}}, {{1, 4}, {2, 4}}};
    static const struct build_copy copies[] = {{0, 0, 1, 1, 2}};
    static const struct build_symbol symbols[] = {{.sm = 2, .bit_offset = 0, .bits = 8},
                                                  {.sm = 2, .bit_offset = 7, .bits = 2},
                                                  {.sm = 2, .bit_offset = 16, .bits = 8},
                                                  {.sm = 2, .bit_offset = 24, .bits = 8}};
    const struct build build = {.subdevices = 2,
                                .sm = sm,
                                .copies = copies,
                                .standard = 1,
                                .symbols = symbols,
                                .symbol_count = 4};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct emulated_rig rig = emulated_rig_load(bytes, len);
    CHECK(fsn_core_set_output(rig.core, 0, 1) == FSN_OK);
    CHECK(fsn_core_set_output(rig.core, 1, 1) == FSN_E_CLOSED);
    CHECK(fsn_core_set_output(rig.core, 2, 1) == FSN_E_CLOSED);
    CHECK(fsn_core_set_output(rig.core, 3, 1) == FSN_OK);
    emulated_rig_end(&rig);
}

static void one_byte_is_enough(void) {
    static const struct build_sm sm[2][2] = {{{1, 1}, {2, 1}}, {{1, 1}, {2, 0}}};
    const struct build build = {.subdevices = 2, .sm = sm};
    struct emulated_rig rig = emulated_rig_build(&build);
    uint8_t byte = 0x5A;
    CHECK(fsn_emulated_write_inputs(rig.bus, 1, &byte, 1) == FSN_OK);
    emulated_rig_cycle(&rig);
    uint8_t image[8];
    CHECK(fsn_core_snapshot(rig.core, NULL, NULL, image) == FSN_OK && image[1] == 0x5A);
    CHECK(fsn_emulated_read_outputs(rig.bus, 0, &byte, 1, NULL) == FSN_OK && byte == 0);
    CHECK(fsn_emulated_write_inputs(rig.bus, 3, &byte, 0) == FSN_E_ARG);
    CHECK(fsn_emulated_write_inputs(rig.bus, 4, &byte, 1) == FSN_E_ARG);
    CHECK(fsn_emulated_write_inputs(rig.bus, UINT32_MAX, &byte, 1) == FSN_E_ARG);
    CHECK(strcmp(fsn_emulated_ops()->name, "emulated") == 0);
    emulated_rig_end(&rig);
}

/** Two times: the first is the smallest, and half of all. */
static void percentiles_begin_with_the_first(void) {
    struct fsn_histogram h = {.count = 2, .min_ns = 10, .max_ns = 1000000};
    h.bucket[10] = h.bucket[40] = 1;
    const uint64_t first = fsn_histogram_floor(11) - 1;
    const uint64_t second = fsn_histogram_floor(41) - 1;
    CHECK(fsn_histogram_percentile(&h, 0) == first);
    CHECK(fsn_histogram_percentile(&h, 500000) == first);
    CHECK(fsn_histogram_percentile(&h, 500001) == second);
    CHECK(fsn_histogram_percentile(&h, 1000000) == second);
    h.max_ns = second - 1;
    CHECK(fsn_histogram_percentile(&h, 1000000) == second - 1);
    /* The last two: one has an end, the other has none. */
    struct fsn_histogram late = {.count = 2, .min_ns = 1, .max_ns = UINT64_MAX};
    late.bucket[FSN_BUCKETS - 2] = late.bucket[FSN_BUCKETS - 1] = 1;
    CHECK(fsn_histogram_percentile(&late, 500000) == fsn_histogram_floor(FSN_BUCKETS - 1) - 1);
    CHECK(fsn_histogram_percentile(&late, 1000000) == UINT64_MAX);
}

static void age_and_news_are_reported(void) {
    struct emulated_rig rig = set_up_full();
    uint8_t out[9];
    bool fresh = true;
    CHECK(fsn_emulated_read_outputs(rig.bus, 0, out, sizeof out, &fresh) == FSN_OK && !fresh);
    emulated_rig_cycle(&rig);
    CHECK(fsn_emulated_read_outputs(rig.bus, 0, out, sizeof out, &fresh) == FSN_OK && fresh);
    CHECK(fsn_emulated_read_outputs(rig.bus, 0, out, sizeof out, &fresh) == FSN_OK && !fresh);
    CHECK(fsn_emulated_set_present(rig.bus, 1, false) == FSN_OK);
    for (int i = 0; i < 3; i++) {
        emulated_rig_cycle(&rig);
    }
    CHECK(fsn_core_stale_cycles(rig.core, 3) == 3 && fsn_core_stale_cycles(rig.core, 1) == 0);
    CHECK(fsn_core_stale_cycles(rig.core, 2) == 0); /* an output has no age */
    CHECK(fsn_core_stale_cycles(rig.core, 99) == 0);
    CHECK(statistics(&rig).wkc_errors == 3);
    CHECK(fsn_emulated_read_outputs(rig.bus, 2, out, sizeof out, &fresh) == FSN_OK);
    CHECK(fsn_emulated_read_outputs(rig.bus, 2, out, sizeof out, &fresh) == FSN_OK && !fresh);
    emulated_rig_end(&rig);
}

/** Three SubDevices with 800 bytes each way: a cut before each sync manager that would not fit. */
static void datagrams_are_cut_at_sync_managers(void) {
    static const struct build_sm sm[3][2] = {
        {{1, 800}, {2, 686}}, {{1, 1486}, {2, 1}}, {{1, 3}, {2, 4}}};
    const struct build build = {.subdevices = 3, .sm = sm};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    struct emulated_rig rig = emulated_rig_load(bytes, len);
    static const uint32_t base[] = {0, 800, 1486, 2972, 2973, 2976};
    for (uint32_t i = 0; i < 6; i++) {
        CHECK(fsn_core_sm_base(rig.core, i) == base[i]);
    }
    emulated_rig_cycle(&rig);
    CHECK(statistics(&rig).expected_wkc == 9 && statistics(&rig).actual_wkc == 9);
    CHECK(fsn_emulated_set_present(rig.bus, 1, false) == FSN_OK); /* in two datagrams */
    emulated_rig_cycle(&rig);
    CHECK(statistics(&rig).actual_wkc == 6 && statistics(&rig).wkc_errors == 1);
    emulated_rig_end(&rig);
}

/** 1 486 bytes fit a datagram, 1 487 do not. */
static void datagrams_end_at_their_limit(void) {
    for (uint32_t excess = 0; excess < 2; excess++) {
        const struct build_sm sm[1][2] = {{{1, 800}, {2, 686 + excess}}};
        const struct build build = {.subdevices = 1, .sm = sm};
        size_t len;
        uint8_t *bytes = build_plan(&build, &len);
        struct fsn_plan *plan;
        struct fsn_emulated *bus;
        struct fsn_bus_layout layout;
        CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
        CHECK(fsn_emulated_create(plan, &bus) == FSN_OK);
        CHECK(fsn_emulated_ops()->open(bus, plan, &layout, NULL) == FSN_OK);
        CHECK(layout.image_bytes == 1486 + excess && layout.datagram_count == 1 + excess);
        CHECK(layout.datagram_begin[0] == 0);
        CHECK(excess == 0 || layout.datagram_begin[1] == 800);
        fsn_emulated_ops()->close(bus);
        fsn_emulated_free(bus);
        fsn_plan_free(plan);
        free(bytes);
    }
}

/** A Reset lasts several frames: it counts once, and that of a start not at all. */
static void resets_are_counted_once(void) {
    struct emulated_rig rig = set_up_full();
    static const char *const frames[] = {
        "\x2a\x05\x01\x00\x00\x00", "\x2a\x05\x02\x00\x00\x00", "\x2a\x04\x03\x00\x00\x00",
        "\x4e\x05\x01\x00\x00\x00", "\x2a\x01\x01\x00\x00\x00",
    };
    struct fsn_connection_status c;
    for (size_t i = 0; i < 5; i++) {
        send(&rig, 1, frames[i]);
        emulated_rig_cycle(&rig);
        CHECK(fsn_core_snapshot(rig.core, NULL, &c, NULL) == FSN_OK);
        CHECK(c.direction[0].resets == (i < 4 ? 0u : 1u) && c.direction[0].frames == i + 1);
    }
    CHECK(c.direction[0].reset_code == 1 && c.direction[1].frames == 0);
    emulated_rig_end(&rig);
}

static void one_core_per_bus(void) {
    struct emulated_rig rig = set_up_full();
    struct fsn_core *second;
    struct fsn_fault fault;
    CHECK(fsn_core_create(rig.plan, fsn_emulated_ops(), rig.bus, &second, &fault) == FSN_E_STATE);
    emulated_rig_cycle(&rig); /* the first one is not harmed */
    fsn_core_free(rig.core);
    CHECK(fsn_core_create(rig.plan, fsn_emulated_ops(), rig.bus, &rig.core, &fault) == FSN_OK);
    emulated_rig_end(&rig);
}

/** A writer that stopped in the middle of a snapshot leaves the previous one to its readers; a
 *  reader that is overtaken every time is reported. */
static void writer_in_the_middle_takes_nothing_away(void) {
    struct emulated_rig rig = set_up_full();
    struct fsn_rt_snapshot *shown = &rig.core->rt.snapshot;
    struct fsn_statistics s;
    emulated_rig_cycle(&rig);
    emulated_rig_cycle(&rig);
    const uint32_t next = atomic_fetch_add(&shown->shown->begun, 1) + 1;
    atomic_store(&shown->words[next % FSN_RT_PICTURES][0], UINT64_MAX);
    CHECK(fsn_core_snapshot(rig.core, &s, NULL, NULL) == FSN_OK);
    CHECK(s.cycles == 2 && s.now_ns == rig.now_ns);
    atomic_fetch_add(&shown->shown->begun, 1);
    CHECK(fsn_core_snapshot(rig.core, &s, NULL, NULL) == FSN_E_BUSY);
    emulated_rig_cycle(&rig);
    CHECK(fsn_core_snapshot(rig.core, &s, NULL, NULL) == FSN_OK && s.cycles == 3);
    emulated_rig_end(&rig);
}

/** Both snapshots show the present connection, also the one filled after the change. */
static void no_picture_shows_an_old_state(void) {
    struct emulated_rig rig = set_up_full();
    send(&rig, 1, "\x2a\x01\x02\x03\x04\x05");
    for (int i = 0; i < 2 * FSN_RT_PICTURES; i++) {
        struct fsn_connection_status c;
        emulated_rig_cycle(&rig);
        CHECK(fsn_core_snapshot(rig.core, NULL, &c, NULL) == FSN_OK);
        CHECK(c.direction[FSN_TO_SUB].frames == 1);
    }
    emulated_rig_end(&rig);
}

/** Places end where the plan does; a missing argument is reported. */
static void arguments_are_looked_at(void) {
    struct emulated_rig rig = set_up_full();
    uint8_t image[64] = {0};
    uint64_t value = 0;
    const uint32_t symbol = 0;
    struct fsn_event event;
    struct fsn_bus_subdevice seen;
    struct fsn_bus_ring ring;
    struct fsn_statistics statistics;
    CHECK(fsn_core_datagram_count(rig.core) == 1);
    CHECK(fsn_core_datagram_byte(rig.core, 0) == 0);
    CHECK(fsn_core_datagram_byte(rig.core, 1) == FSN_NONE);
    CHECK(fsn_core_stale_cycles(rig.core, 4) == 0);
    CHECK(!fsn_core_event(rig.core, NULL) && !fsn_core_event(NULL, &event));
    CHECK(fsn_core_poll(NULL, FSN_AL_OP, 1) && fsn_core_poll(rig.core, FSN_AL_OP, 1));
    CHECK(fsn_core_ring(NULL, &ring) == FSN_E_ARG && fsn_core_ring(rig.core, NULL) == FSN_E_ARG);
    CHECK(fsn_core_bus(NULL, 0, &statistics) == FSN_E_ARG);
    CHECK(fsn_core_bus(rig.core, 0, NULL) == FSN_E_ARG);
    CHECK(fsn_core_bus(rig.core, 1, &statistics) == FSN_E_ARG);
    CHECK(fsn_core_bus(rig.core, 0, &statistics) == FSN_OK);
    CHECK(fsn_core_subdevice(NULL, 0, &seen) == FSN_E_ARG);
    CHECK(fsn_core_subdevice(rig.core, 0, NULL) == FSN_E_ARG);
    CHECK(fsn_core_subdevice(rig.core, 2, &seen) == FSN_E_ARG);
    CHECK(fsn_core_subdevice(rig.core, 1, &seen) == FSN_E_STATE); /* a bus without states */
    CHECK(fsn_core_set_outputs(rig.core, 1, &symbol, NULL) == FSN_E_ARG);
    CHECK(fsn_core_set_outputs(rig.core, 1, NULL, &value) == FSN_E_ARG);
    CHECK(fsn_core_read_symbol(NULL, image, 0, &value) == FSN_E_ARG);
    CHECK(fsn_core_read_symbol(rig.core, NULL, 0, &value) == FSN_E_ARG);
    CHECK(fsn_core_read_symbol(rig.core, image, 0, NULL) == FSN_E_ARG);
    CHECK(fsn_core_read_symbol(rig.core, image, 2, &value) == FSN_E_ARG);
    image[6] = 0x50; /* bits 52 to 59 */
    image[7] = 0xFA;
    CHECK(fsn_core_read_symbol(rig.core, image, 0, &value) == FSN_OK && value == 0xA5);
    CHECK(strcmp(fsn_found_text(FSN_FOUND_RIGHT), "the SubDevice of the plan") == 0);
    CHECK(strcmp(fsn_found_text(99), "?") == 0 && fsn_core_kept_cycles(NULL) == 0);
    CHECK(strcmp(fsn_al_code_text(0), "no error is named") == 0);
    CHECK(strcmp(fsn_al_code_text(0x7FFF), "not a code of ETG.1000.6") == 0);
    CHECK(strcmp(fsn_al_code_text(0x8000), "a vendor-specific error, see its manual") == 0);
    CHECK(fsn_core_record(NULL, 1, NULL, NULL, NULL) == FSN_E_ARG);
    struct fsn_emulated *bus = NULL;
    CHECK(fsn_emulated_create(NULL, &bus) == FSN_E_ARG && bus == NULL);
    CHECK(fsn_emulated_create(rig.plan, NULL) == FSN_E_ARG);
    struct fsn_core *core;
    CHECK(fsn_core_create(rig.plan, fsn_emulated_ops(), NULL, &core, NULL) == FSN_E_ARG);
    CHECK(fsn_core_cycle(rig.core, 1) == FSN_OK);
    emulated_rig_end(&rig);
}

/** Start of a bucket, and the value that a share per million stays below. */
static void percentiles_are_ends_of_buckets(void) {
    static const uint64_t floors[][2] = {{0, 0},     {1, 1},     {63, 63},   {64, 64},
                                         {65, 65},   {127, 127}, {128, 128}, {129, 130},
                                         {191, 254}, {192, 256}, {193, 260}, {256, 512}};
    for (uint32_t i = 0; i < sizeof floors / sizeof floors[0]; i++) {
        CHECK(fsn_histogram_floor((uint32_t)floors[i][0]) == floors[i][1]);
    }
    CHECK(fsn_histogram_floor(FSN_BUCKETS - 1) == UINT64_C(127) << 26);
    struct fsn_histogram h = {0};
    CHECK(fsn_histogram_percentile(NULL, 500000) == 0);
    CHECK(fsn_histogram_percentile(&h, 500000) == 0);
    h = (struct fsn_histogram){.count = 10, .max_ns = 1000};
    h.bucket[132] = 5; /* 136 and 137 ns */
    h.bucket[196] = 4; /* 272 to 275 ns */
    h.bucket[FSN_BUCKETS - 1] = 1;
    static const struct {
        uint32_t per_million;
        uint64_t below;
    } table[] = {{0, 137},      {1, 137},       {500000, 137},  {500001, 275},
                 {900000, 275}, {900001, 1000}, {1000000, 1000}};
    for (uint32_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        CHECK(fsn_histogram_percentile(&h, table[i].per_million) == table[i].below);
    }
    h.max_ns = 273; /* never more than the longest */
    CHECK(fsn_histogram_percentile(&h, 900000) == 273);
}

static void nothing_is_refused(void) {
    CHECK(fsn_core_cycle(NULL, 1) == FSN_E_ARG);
    CHECK(fsn_core_snapshot(NULL, NULL, NULL, NULL) == FSN_E_ARG);
    CHECK(fsn_core_set_output(NULL, 0, 0) == FSN_E_ARG);
    CHECK(!fsn_core_event(NULL, NULL));
    CHECK(strcmp(fsn_version(), FSN_VERSION_STRING) == 0);
    fsn_core_stop(NULL);
    fsn_core_free(NULL);
    fsn_emulated_free(NULL);
    fsn_plan_free(NULL);
}

struct shared {
    struct emulated_rig rig;
    atomic_bool done;
};

/** A device that answers each frame, so that states change all the time. */
static void *device(void *argument) {
    struct shared *shared = argument;
    for (uint8_t n = 0; !atomic_load(&shared->done); n++) {
        const char frame[] = {n % 2 ? 0x36 : 0x08, (char)n, 1, 0, 7, 0};
        send(&shared->rig, 1, frame);
        send(&shared->rig, 3, frame);
        uint8_t out[9];
        CHECK(fsn_emulated_read_outputs(shared->rig.bus, 0, out, sizeof out, NULL) == FSN_OK);
        CHECK(out[0] == 0 || out[0] == 0x36 || out[0] == 0x08);
        sched_yield();
    }
    return NULL;
}

static void *writer(void *argument) {
    struct shared *shared = argument;
    for (uint64_t n = 0; !atomic_load(&shared->done); n++) {
        CHECK(fsn_core_set_output(shared->rig.core, 0, n) == FSN_OK);
        sched_yield();
    }
    return NULL;
}

/** The real thread with a device, an output writer, an event consumer and a reader next to it. */
static void everyone_at_once(void) {
    struct shared shared = {.rig = set_up_full()};
    struct emulated_rig *rig = &shared.rig;
    pthread_t threads[2];
    CHECK(pthread_create(&threads[0], NULL, device, &shared) == 0);
    CHECK(pthread_create(&threads[1], NULL, writer, &shared) == 0);
    const struct fsn_thread_options options = {.cycle_ns = 100000, .priority = 1};
    struct fsn_fault fault;
    CHECK(fsn_core_start(rig->core, &options, &fault) == FSN_OK);
    struct fsn_statistics s = {0};
    uint64_t events = 0;
    uint64_t last_ns = 0;
    while (s.cycles < 500 || events < 3) {
        struct fsn_event event;
        while (fsn_core_event(rig->core, &event)) {
            CHECK(event.connection == 0 && event.before != event.after && event.now_ns >= last_ns);
            last_ns = event.now_ns;
            events++;
        }
        if (fsn_core_snapshot(rig->core, &s, NULL, NULL) == FSN_OK) {
            CHECK(s.bytes_copied == 12 * s.cycles);
        }
        sched_yield();
    }
    fsn_core_stop(rig->core);
    atomic_store(&shared.done, true);
    pthread_join(threads[0], NULL);
    pthread_join(threads[1], NULL);
    s = statistics(rig);
    uint64_t in_buckets = 0;
    for (int i = 0; i < FSN_BUCKETS; i++) {
        in_buckets += s.latency.bucket[i];
    }
    CHECK(s.latency.count == s.cycles && in_buckets == s.cycles && s.work.count == s.cycles);
    CHECK(s.period.count + 1 == s.cycles && s.round_trip.count == 0 && s.dc_offset.count == 0);
    CHECK(s.latency.min_ns <= s.latency.max_ns && s.latency.sum_ns >= s.latency.max_ns);
    CHECK(s.work.max_ns >= s.copy.max_ns);
    printf("%llu cycles, %llu events, real-time %u, latency %llu to %llu ns\n",
           (unsigned long long)s.cycles, (unsigned long long)events, s.realtime,
           (unsigned long long)s.latency.min_ns, (unsigned long long)s.latency.max_ns);
    emulated_rig_end(rig);
}

int main(void) {
    arguments_are_looked_at();
    percentiles_are_ends_of_buckets();
    outputs_touch_their_bits_only();
    copied_outputs_are_closed();
    one_byte_is_enough();
    percentiles_begin_with_the_first();
    age_and_news_are_reported();
    datagrams_are_cut_at_sync_managers();
    datagrams_end_at_their_limit();
    resets_are_counted_once();
    one_core_per_bus();
    writer_in_the_middle_takes_nothing_away();
    no_picture_shows_an_old_state();
    nothing_is_refused();
    everyone_at_once();
    return 0;
}
