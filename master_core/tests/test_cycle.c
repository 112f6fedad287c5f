/** Freshness, working counter, monitor and outputs on the emulated bus. */
/* shows R1, R3 */
#include <sched.h>
#include <string.h>

#include "emulated_rig.h"

static struct emulated_rig set_up(void) {
    size_t len;
    uint8_t *bytes = build_estop(&len);
    return emulated_rig_load(bytes, len);
}

static void send(struct emulated_rig *rig, uint32_t sm, const char *frame) {
    uint8_t inputs[8] = {0};
    memcpy(inputs, frame, 6);
    CHECK(fsn_emulated_write_inputs(rig->bus, sm, inputs, sizeof inputs) == FSN_OK);
}

static struct fsn_statistics statistics(struct emulated_rig *rig) {
    struct fsn_statistics s;
    CHECK(fsn_core_snapshot(rig->core, &s, NULL, NULL) == FSN_OK);
    return s;
}

static struct fsn_connection_status connection(struct emulated_rig *rig) {
    struct fsn_connection_status c;
    CHECK(fsn_core_snapshot(rig->core, NULL, &c, NULL) == FSN_OK);
    return c;
}

/* Sync managers of the e-stop plan: 0 and 1 of the main (outputs, inputs), 2 and 3 of the sub. */

static void frames_arrive_in_the_same_cycle(void) {
    struct emulated_rig rig = set_up();
    uint8_t outputs[9];
    CHECK(fsn_emulated_read_outputs(rig.bus, 2, outputs, sizeof outputs, NULL) == FSN_OK);
    CHECK(outputs[0] == 0); /* no frame before the source has delivered */
    send(&rig, 1, "\x2a\x01\x02\x03\x04\x05");
    emulated_rig_cycle(&rig);
    CHECK(fsn_emulated_read_outputs(rig.bus, 2, outputs, sizeof outputs, NULL) == FSN_OK);
    CHECK(memcmp(outputs, "\x2a\x01\x02\x03\x04\x05\x00\x00", 8) == 0);
    emulated_rig_end(&rig);
}

static void absent_subdevice_keeps_its_last_frame_whole(void) {
    struct emulated_rig rig = set_up();
    send(&rig, 3, "\x36\x11\x22\x33\x07\x00");
    emulated_rig_cycle(&rig);
    CHECK(statistics(&rig).wkc_errors == 0 && statistics(&rig).expected_wkc == 6);
    CHECK(fsn_emulated_set_present(rig.bus, 1, false) == FSN_OK);
    send(&rig, 3, "\x36\xAA\xBB\xCC\x07\x00"); /* written while unplugged: must not come through */
    send(&rig, 1, "\x36\x55\x66\x77\x07\x00");
    emulated_rig_cycle(&rig);
    uint8_t outputs[9];
    CHECK(fsn_emulated_read_outputs(rig.bus, 0, outputs, sizeof outputs, NULL) == FSN_OK);
    CHECK(memcmp(outputs, "\x36\x11\x22\x33\x07\x00", 6) == 0);
    CHECK(fsn_emulated_read_outputs(rig.bus, 2, outputs, sizeof outputs, NULL) == FSN_OK);
    CHECK(outputs[0] == 0); /* nor does it get anything */
    CHECK(statistics(&rig).wkc_errors == 1 && statistics(&rig).actual_wkc == 3);
    CHECK(fsn_emulated_set_present(rig.bus, 1, true) == FSN_OK);
    emulated_rig_cycle(&rig);
    CHECK(fsn_emulated_read_outputs(rig.bus, 0, outputs, sizeof outputs, NULL) == FSN_OK);
    CHECK(outputs[1] == 0xAA);
    CHECK(statistics(&rig).wkc_errors == 1);
    emulated_rig_end(&rig);
}

static void monitor_follows_a_connection(void) {
    struct emulated_rig rig = set_up();
    static const struct {
        const char *to_sub, *to_main;
        enum fsn_observed observed;
    } steps[] = {
        {"\x2a\x05\x01\x00\x00\x00", "\x00\x00\x00\x00\x00\x00", FSN_OBSERVED_SILENT},
        {"\x2a\x05\x01\x00\x00\x00", "\x2a\x00\x01\x00\x00\x00", FSN_OBSERVED_RESET},
        {"\x4e\x05\x01\x00\x00\x00", "\x4e\x00\x01\x00\x00\x00", FSN_OBSERVED_SESSION},
        {"\x64\x05\x01\x00\x07\x00", "\x4e\x00\x01\x00\x00\x00", FSN_OBSERVED_SESSION},
        {"\x64\x05\x01\x00\x07\x00", "\x64\x00\x01\x00\x07\x00", FSN_OBSERVED_CONNECTION},
        {"\x52\x05\x01\x00\x07\x00", "\x52\x00\x01\x00\x07\x00", FSN_OBSERVED_PARAMETER},
        {"\x08\x05\x01\x00\x07\x00", "\x08\x00\x01\x00\x07\x00", FSN_OBSERVED_DATA_FAILSAFE},
        {"\x36\x05\x01\x00\x07\x00", "\x08\x01\x01\x00\x07\x00", FSN_OBSERVED_DATA_FAILSAFE},
        {"\x36\x05\x02\x00\x07\x00", "\x36\x00\x01\x00\x07\x00", FSN_OBSERVED_DATA_PROCESS},
        {"\x99\x05\x02\x00\x07\x00", "\x36\x00\x01\x00\x07\x00", FSN_OBSERVED_UNKNOWN},
    };
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        send(&rig, 1, steps[i].to_sub);
        send(&rig, 3, steps[i].to_main);
        emulated_rig_cycle(&rig);
        CHECK(connection(&rig).observed == (uint32_t)steps[i].observed);
    }
    const struct fsn_connection_status c = connection(&rig);
    CHECK(c.direction[0].frames == 8 && c.direction[0].resets == 0);
    CHECK(c.direction[0].reset_code == 5 && c.direction[0].connection_id == 7);
    CHECK(c.direction[0].process_data == 2 && c.direction[0].failsafe_data == 1);
    CHECK(c.direction[0].interval_last_ns == 1000000 && c.direction[0].intervals == 2);
    struct fsn_event event;
    uint32_t events = 0;
    while (fsn_core_event(rig.core, &event)) {
        CHECK(event.connection == 0 && event.before != event.after);
        events++;
    }
    CHECK(events == 7); /* the first and the fourth step change nothing */
    emulated_rig_end(&rig);
}

/** An event ring without a reader counts dropped events and keeps the older ones. */
static void full_ring_counts_losses(void) {
    struct emulated_rig rig = set_up();
    for (int i = 0; i < 400; i++) {
        send(&rig, 1, i % 2 ? "\x2a\x00\x01\x00\x00\x00" : "\x4e\x00\x01\x00\x00\x00");
        send(&rig, 3, i % 2 ? "\x2a\x00\x01\x00\x00\x00" : "\x4e\x00\x01\x00\x00\x00");
        emulated_rig_cycle(&rig);
    }
    CHECK(statistics(&rig).events_lost == 400 - 256);
    struct fsn_event event;
    CHECK(fsn_core_event(rig.core, &event) && event.now_ns == 1000000);
    emulated_rig_end(&rig);
}

static void thread_runs_and_stops(void) {
    struct emulated_rig rig = set_up();
    struct fsn_thread_options options = {.cycle_ns = 200000};
    struct fsn_fault fault;
    CHECK(fsn_core_start(rig.core, &options, &fault) == FSN_OK);
    CHECK(fsn_core_start(rig.core, &options, &fault) == FSN_E_STATE);
    CHECK(fsn_core_cycle(rig.core, 1) == FSN_E_STATE);
    while (statistics(&rig).cycles < 20) {
    }
    fsn_core_stop(rig.core);
    fsn_core_stop(rig.core);
    const uint64_t cycles = statistics(&rig).cycles;
    CHECK(cycles == statistics(&rig).cycles);
    options.cycle_ns = 10;
    CHECK(fsn_core_start(rig.core, &options, &fault) == FSN_E_ARG);
    options.cycle_ns = 0; /* the plan's */
    CHECK(fsn_core_start(rig.core, &options, &fault) == FSN_OK);
    emulated_rig_end(&rig); /* stops the thread */
}

static void jumping_receive(void *bus, struct fsn_bus_input *input) {
    static const uint64_t clock[] = {(uint64_t)INT64_MAX + 1, 1, UINT64_MAX, INT64_MAX, 1000000};
    static uint32_t at;
    fsn_emulated_ops()->receive(bus, input);
    input->dc_time_ns = clock[at++ % 5];
}

/** The time of a reference clock comes from a frame: wake-ups stay near their cycle for any value.
 */
static void jumps_of_the_reference_clock_are_bounded(void) {
    struct emulated_rig rig = set_up();
    fsn_core_free(rig.core);
    struct fsn_bus_ops ops = *fsn_emulated_ops();
    ops.receive = jumping_receive;
    struct fsn_fault fault;
    CHECK(fsn_core_create(rig.plan, &ops, rig.bus, &rig.core, &fault) == FSN_OK);
    const struct fsn_thread_options options = {.cycle_ns = 200000, .follow_dc = true};
    CHECK(fsn_core_start(rig.core, &options, &fault) == FSN_OK);
    while (statistics(&rig).cycles < 50) {
        sched_yield();
    }
    fsn_core_stop(rig.core);
    const struct fsn_statistics s = statistics(&rig);
    CHECK(s.dc_offset.count + 1 == s.cycles && s.dc_offset.max_ns <= options.cycle_ns / 2);
    emulated_rig_end(&rig);
}

static void wrong_arguments_are_refused(void) {
    struct emulated_rig rig = set_up();
    uint8_t buffer[9] = {0};
    CHECK(fsn_emulated_read_outputs(rig.bus, 1, buffer, 9, NULL) == FSN_E_ARG);
    CHECK(fsn_emulated_read_outputs(rig.bus, 0, buffer, 8, NULL) == FSN_E_ARG);
    CHECK(fsn_emulated_read_outputs(rig.bus, 99, buffer, 9, NULL) == FSN_E_ARG);
    CHECK(fsn_emulated_write_inputs(rig.bus, 0, buffer, 9) == FSN_E_ARG);
    CHECK(fsn_emulated_write_inputs(rig.bus, 1, buffer, 9) == FSN_E_ARG);
    CHECK(fsn_emulated_set_present(rig.bus, 2, true) == FSN_E_ARG);
    CHECK(fsn_core_set_output(rig.core, 0, 1) == FSN_E_ARG);
    CHECK(fsn_core_sm_base(rig.core, 0) == 0 && fsn_core_sm_base(rig.core, 1) == 9);
    CHECK(fsn_core_sm_base(rig.core, 3) == 25 && fsn_core_sm_base(rig.core, 4) == FSN_NONE);
    CHECK(fsn_core_image_bytes(rig.core) == 33);
    emulated_rig_end(&rig);
}

/** Both ends stop: their bytes left in the image no longer count. */
static void without_new_frames_a_connection_is_silent(void) {
    struct emulated_rig rig = set_up();
    struct fsn_event event;
    send(&rig, 1, "\x2a\x01\x02\x03\x04\x05");
    send(&rig, 3, "\x2a\x01\x02\x03\x04\x05");
    emulated_rig_cycle(&rig);
    CHECK(connection(&rig).observed == FSN_OBSERVED_RESET);
    CHECK(fsn_core_event(rig.core, &event) && event.after == FSN_OBSERVED_RESET);
    for (int i = 0; i < 1000; i++) {
        emulated_rig_cycle(&rig); /* the plan states no watchdog: a second of patience */
    }
    CHECK(connection(&rig).observed == FSN_OBSERVED_RESET && !fsn_core_event(rig.core, &event));
    emulated_rig_cycle(&rig);
    CHECK(connection(&rig).observed == FSN_OBSERVED_SILENT);
    CHECK(fsn_core_event(rig.core, &event) && event.after == FSN_OBSERVED_SILENT);
    emulated_rig_cycle(&rig);
    CHECK(!fsn_core_event(rig.core, &event)); /* reported once */
    send(&rig, 3, "\x2a\x05\x02\x03\x04\x05");
    emulated_rig_cycle(&rig);
    CHECK(connection(&rig).observed == FSN_OBSERVED_RESET);
    emulated_rig_end(&rig);
}

int main(void) {
    without_new_frames_a_connection_is_silent();
    frames_arrive_in_the_same_cycle();
    absent_subdevice_keeps_its_last_frame_whole();
    monitor_follows_a_connection();
    full_ring_counts_losses();
    thread_runs_and_stops();
    jumps_of_the_reference_clock_are_bounded();
    wrong_arguments_are_refused();
    return 0;
}
