/** Cycles of the backend on IgH: moved data, observed SubDevices, returns. */
/* shows R3 */
#include <string.h>

#include "igh_rig.h"
#include "plan/plan_internal.h"

/* -- moved data ----------------------------------------------------------------------------- */

/** The frame of the SubInstance as in the outputs of the MainInstance, and back. */
static void data_flows(void) {
    struct rig *rig = bring_up();
    uint8_t expected[6];
    memset(expected, 0xB0, sizeof expected);
    CHECK(memcmp(fake.device[0].outputs, expected, sizeof expected) == 0);
    memset(expected, 0xA0, sizeof expected);
    CHECK(memcmp(fake.device[1].outputs, expected, sizeof expected) == 0);
    const struct fsn_statistics s = snapshot(rig);
    CHECK(s.expected_wkc == 4 && s.actual_wkc == 4);
    CHECK(fake.send_interval == 1000);
    tear_down(rig);
}

/** A missing reply leaves the old bytes, whole, and is reported. */
static void losses_keep_old_bytes(void) {
    struct rig *rig = bring_up();
    const uint64_t stale = fsn_core_stale_cycles(rig->core, 3);
    fake.device[1].mute = true;
    memset(fake.device[1].inputs, 0xEE, 8);
    memset(fake.device[0].inputs, 0xA1, 8);
    run(rig, 3, FSN_AL_OP);
    CHECK(fake.device[0].outputs[0] == 0xB0 && fake.device[0].outputs[5] == 0xB0);
    CHECK(snapshot(rig).actual_wkc == 2);
    CHECK(fsn_core_stale_cycles(rig->core, 3) >= stale + 2);
    CHECK(snapshot(rig).counts.lost_frames == 0);
    fake.device[1].mute = false;
    run(rig, 3, FSN_AL_OP);
    CHECK(fake.device[0].outputs[0] == 0xEE && fake.device[1].outputs[0] == 0xA1);
    const uint64_t lost = snapshot(rig).counts.lost_frames;
    fake.lose_frames = true;
    memset(fake.device[1].inputs, 0x11, 8);
    run(rig, 2, FSN_AL_OP);
    fake.lose_frames = false;
    CHECK(snapshot(rig).counts.lost_frames == lost + 2);
    CHECK(fake.device[0].outputs[0] == 0xEE);
    tear_down(rig);
}

/** Signals end calls of the kernel; a few are made again, and more of them are a lost cycle. */
static void signals_do_no_harm(void) {
    struct rig *rig = bring_up();
    const uint64_t before = snapshot(rig).wkc_errors;
    fake.interrupted = 4;
    run(rig, 3, FSN_AL_OP);
    CHECK(snapshot(rig).wkc_errors == before);
    memset(fake.device[1].inputs, 0x77, 8);
    fake.interrupted = 1000;
    run(rig, 1, FSN_AL_OP);
    fake.interrupted = 0;
    CHECK(snapshot(rig).wkc_errors == before + 1 && snapshot(rig).actual_wkc == 0);
    /* Its queue was refused as well: the reply of before must not pass for a new one. */
    run(rig, 1, FSN_AL_OP);
    CHECK(snapshot(rig).wkc_errors == before + 2 && fake.device[0].outputs[0] == 0xB0);
    run(rig, 2, FSN_AL_OP);
    CHECK(snapshot(rig).wkc_errors == before + 2 && fake.device[0].outputs[0] == 0x77);
    tear_down(rig);
}

static void clocks_are_reported(void) {
    struct rig *rig = set_up();
    CHECK(open_with(rig, 5) == FSN_OK);
    run(rig, 20, FSN_AL_OP);
    CHECK(fake.clock_syncs == 4 && fake.app_time != 0 && snapshot(rig).dc_time_ns == 0);
    fake.reference_time = (uint32_t)fake.app_time + 5000;
    run(rig, 6, FSN_AL_OP);
    CHECK((uint32_t)snapshot(rig).dc_time_ns == fake.reference_time);
    /* Our own time follows the clock from then on. */
    CHECK(snapshot(rig).dc_time_ns <= fake.app_time);
    /* A cycle without replies has no time to read: the library would report an error each time. */
    const unsigned reads = fake.clock_reads;
    fake.lose_frames = true;
    run(rig, 10, FSN_AL_OP);
    CHECK(reads > 0 && fake.clock_reads <= reads + 1);
    fake.lose_frames = false;
    run(rig, 10, FSN_AL_OP);
    CHECK(fake.clock_reads > reads + 1);
    tear_down(rig);
}

/* -- observations --------------------------------------------------------------------------- */

static void devices_return(void) {
    struct rig *rig = bring_up();
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    CHECK(look(rig, 1).found == FSN_FOUND_NOTHING && look(rig, 1).al_status == FSN_AL_NONE);
    CHECK(look(rig, 0).found == FSN_FOUND_RIGHT && look(rig, 0).al_status == FSN_AL_OP);
    CHECK(snapshot(rig).actual_wkc == 2);
    fake_plug(1);
    memset(fake.device[1].inputs, 0x42, 8);
    for (int i = 0; i < 50 && look(rig, 1).returns == 0; i++) {
        run(rig, 20, FSN_AL_OP);
    }
    CHECK(look(rig, 1).returns == 1 && look(rig, 1).found == FSN_FOUND_RIGHT);
    CHECK(look(rig, 0).returns == 0);
    run(rig, 3, FSN_AL_OP);
    CHECK(fake.device[0].outputs[0] == 0x42 && snapshot(rig).actual_wkc == 4);
    tear_down(rig);
}

/** IgH brings any device of that vendor and product to OP; it gets no process data from us. */
static void another_address_gets_nothing(void) {
    struct rig *rig = bring_up();
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    fake_object(1, 0xF980, 1, ADDRESS + 1, 2, true);
    fake_plug(1);
    memset(fake.device[1].inputs, 0x42, 8);
    fake.device[1].output_sets = 0;
    CHECK(!run(rig, 400, FSN_AL_OP));
    CHECK(look(rig, 1).found == FSN_FOUND_ADDRESS && look(rig, 1).returns == 0);
    CHECK(fake.device[1].output_sets == 0 && fake.device[0].outputs[0] == 0xB0);
    fake_object(1, 0xF980, 1, ADDRESS, 2, true); /* its switches are corrected */
    run(rig, 400, FSN_AL_OP);
    CHECK(look(rig, 1).returns == 1 && fake.device[0].outputs[0] == 0x42);
    tear_down(rig);
}

static void another_revision_gets_nothing(void) {
    struct rig *rig = set_up();
    memset(record(rig, FSN_SEC_SUBDEVICE, 1) + 20, 0, 4);
    record(rig, FSN_SEC_SUBDEVICE, 1)[20] = 7;
    CHECK(open_with(rig, 0) == FSN_OK);
    CHECK(run(rig, 50, FSN_AL_OP));
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    fake.device[1].info.revision_number = 8;
    fake_plug(1);
    memset(fake.device[1].inputs, 0x42, 8);
    fake.device[1].output_sets = 0;
    CHECK(!run(rig, 400, FSN_AL_OP));
    CHECK(look(rig, 1).found == FSN_FOUND_IDENTITY && look(rig, 1).revision == 8);
    CHECK(fake.device[1].output_sets == 0 && fake.device[0].outputs[0] == 0xB0);
    fake.device[1].info.revision_number = 7;
    CHECK(run(rig, 400, FSN_AL_OP) && fake.device[0].outputs[0] == 0x42);
    /* Also if the loss was not detected. */
    fake.device[1].info.revision_number = 8;
    run(rig, 12, FSN_AL_OP);
    memset(fake.device[1].inputs, 0x43, 8);
    CHECK(!run(rig, 12, FSN_AL_OP) && fake.device[0].outputs[0] == 0x42);
    tear_down(rig);
}

static void refusals_are_tried_again(void) {
    struct rig *rig = set_up();
    fake.device[1].refuses_op = true;
    CHECK(open_with(rig, 0) == FSN_OK);
    CHECK(!run(rig, 100, FSN_AL_OP));
    CHECK(look(rig, 1).found == FSN_FOUND_STATE && look(rig, 1).al_code == 0x1B);
    CHECK((look(rig, 1).al_status & FSN_AL_ERROR) != 0);
    const unsigned resets = fake.device[1].resets;
    CHECK(resets == 1); /* not one in each look */
    fake.device[1].refuses_op = false;
    fake.device[1].al_code = 0;
    CHECK(run(rig, 2000, FSN_AL_OP) && look(rig, 1).found == FSN_FOUND_RIGHT);
    tear_down(rig);
}

static void counters_are_read(void) {
    struct rig *rig = bring_up();
    run(rig, 100, FSN_AL_OP);
    CHECK(look(rig, 0).link[0] == 1 && look(rig, 0).link[1] == 0);
    CHECK(look(rig, 0).rx_errors[1] == 7 && look(rig, 0).link_lost[1] == 3);
    CHECK(look(rig, 1).vendor_id == 2 && look(rig, 1).product_code == 0x1001);
    struct fsn_bus_subdevice seen;
    CHECK(fsn_backend_igh()->ops->state(rig->bus, 2, &seen) == FSN_E_ARG);
    tear_down(rig);
}

/** They leave OP while process data continues, and only then the bus is closed. */
static void they_leave_op(void) {
    struct rig *rig = bring_up();
    CHECK(!run(rig, 1, FSN_AL_SAFEOP));
    bool left = false;
    for (int i = 0; i < 10 && !left; i++) {
        left = run(rig, 1, FSN_AL_SAFEOP);
    }
    CHECK(left && snapshot(rig).actual_wkc == 4);
    CHECK(look(rig, 0).al_status == FSN_AL_SAFEOP);
    tear_down(rig);
    /* Nobody waits for who has gone, or without register requests. */
    rig = bring_up();
    fake_unplug(0);
    run(rig, 20, FSN_AL_OP);
    CHECK(run(rig, 1, FSN_AL_SAFEOP));
    tear_down(rig);
    rig = set_up();
    fake.no_requests = true;
    CHECK(open_with(rig, 0) == FSN_OK && run(rig, 50, FSN_AL_OP));
    CHECK(run(rig, 1, FSN_AL_SAFEOP));
    tear_down(rig);
}

/* -- registers and returns, once more --------------------------------------------------------- */

static void requests_without_an_answer_are_made_again(void) {
    struct rig *rig = set_up();
    fake.deaf = true;
    CHECK(open_with(rig, 0) == FSN_OK);
    run(rig, 1500, FSN_AL_OP);
    CHECK(look(rig, 0).rx_errors[1] == 0);
    fake.deaf = false;
    run(rig, 1500, FSN_AL_OP);
    CHECK(look(rig, 0).rx_errors[1] == 7);
    fake.deaf = true;
    CHECK(!run(rig, 20, FSN_AL_SAFEOP));
    fake.device[0].mute = fake.device[1].mute = true; /* and who is silent is not waited for */
    CHECK(run(rig, 20, FSN_AL_SAFEOP));
    tear_down(rig);
}

static void a_loss_between_two_looks_is_one(void) {
    struct rig *rig = bring_up();
    run(rig, 1, FSN_AL_OP); /* with a look; the next one is ten cycles away */
    fake.device[1].mute = true;
    fake.device[1].al = 2;
    fake.device[1].info.error_flag = 1;
    run(rig, 10, FSN_AL_OP);
    CHECK(look(rig, 1).found == FSN_FOUND_STATE && look(rig, 1).returns == 0);
    fake.device[1].mute = false;
    reach_op(rig);
    CHECK(look(rig, 1).returns == 1 && is_in_op(rig, 1) && look(rig, 0).returns == 0);
    tear_down(rig);
}

static void another_device_that_goes_is_still_another(void) {
    struct rig *rig = bring_up();
    fake.device[1].info.product_code = 0x99;
    run(rig, 20, FSN_AL_OP);
    CHECK(look(rig, 1).found == FSN_FOUND_IDENTITY);
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    CHECK(look(rig, 1).found == FSN_FOUND_IDENTITY && look(rig, 1).al_status == FSN_AL_NONE);
    tear_down(rig);
}

/** A SubDevice whose FSoE address was never read need not show it when it returns. */
static void an_address_that_was_never_told_is_not_asked_for(void) {
    struct rig *rig = set_up();
    for (unsigned i = 0; i < fake.device[1].object_count; i++) {
        struct fake_object *object = &fake.device[1].objects[i];
        object->index = object->index == 0xF980 ? 0x2000 : object->index;
    }
    CHECK(open_with(rig, 0) == FSN_OK);
    reach_op(rig);
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    fake_plug(1);
    reach_op(rig);
    CHECK(look(rig, 1).returns == 1);
    tear_down(rig);
}

int main(void) {
    requests_without_an_answer_are_made_again();
    a_loss_between_two_looks_is_one();
    another_device_that_goes_is_still_another();
    an_address_that_was_never_told_is_not_asked_for();
    data_flows();
    losses_keep_old_bytes();
    signals_do_no_harm();
    clocks_are_reported();
    devices_return();
    another_address_gets_nothing();
    another_revision_gets_nothing();
    refusals_are_tried_again();
    counters_are_read();
    they_leave_op();
    return 0;
}
