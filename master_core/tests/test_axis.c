/** An axis by CiA 402 against drives that behave by the standard, drives that stop by themselves at
 *  any moment, and drives that answer nonsense. After every single step the promises of the header
 *  are checked, whatever the drive does. */
#include <string.h>

#include "builder.h"
#include "fsn/axis.h"

enum { MS = 1000000, LIMIT = 50, START_POSITION = 100000 };

/** A drive: state, and the other bits of its statusword. */
struct drive {
    enum fsn_axis_state state;
    uint16_t extra; /**< bits over those of the state */
    uint16_t before;
    int8_t mode;
    int32_t position;
    unsigned mode_delay, delayed;
};

static struct {
    struct fsn_axis axis;
    struct drive drive;
    uint64_t now_ns;
    bool torque_off;
    bool edge_was_low;  /**< bit 7 was 0 in the step before */
    unsigned edges;     /**< of bit 7 */
    bool requested;     /**< the program has requested to enable since the last loss */
    bool reset_allowed; /**< it has requested a reset */
} rig;

static const uint16_t state_bits[] = {[FSN_AXIS_NOT_READY] = 0x00,
                                      [FSN_AXIS_SWITCH_ON_DISABLED] = 0x50,
                                      [FSN_AXIS_READY_TO_SWITCH_ON] = 0x31,
                                      [FSN_AXIS_SWITCHED_ON] = 0x33,
                                      [FSN_AXIS_OPERATION_ENABLED] = 0x37,
                                      [FSN_AXIS_QUICK_STOP_ACTIVE] = 0x17,
                                      [FSN_AXIS_FAULT_REACTION_ACTIVE] = 0x1F,
                                      [FSN_AXIS_FAULT] = 0x18,
                                      [FSN_AXIS_NO_STATE] = 0x02};

/** Transitions of the standard, by the command in the controlword. */
static enum fsn_axis_state next_state(enum fsn_axis_state state, uint16_t word, uint16_t before) {
    const bool reset = (word & 0x80) != 0 && (before & 0x80) == 0;
    if (state == FSN_AXIS_FAULT) {
        return reset ? FSN_AXIS_SWITCH_ON_DISABLED : state;
    }
    if (state == FSN_AXIS_NOT_READY) {
        return FSN_AXIS_SWITCH_ON_DISABLED;
    }
    if (state == FSN_AXIS_FAULT_REACTION_ACTIVE) {
        return FSN_AXIS_FAULT;
    }
    if ((word & 2) == 0) {
        return FSN_AXIS_SWITCH_ON_DISABLED;
    }
    if ((word & 4) == 0) {
        const bool moves =
            state == FSN_AXIS_OPERATION_ENABLED || state == FSN_AXIS_QUICK_STOP_ACTIVE;
        return moves ? FSN_AXIS_QUICK_STOP_ACTIVE : FSN_AXIS_SWITCH_ON_DISABLED;
    }
    if (state == FSN_AXIS_QUICK_STOP_ACTIVE || state == FSN_AXIS_NO_STATE) {
        return state;
    }
    if ((word & 1) == 0) {
        return FSN_AXIS_READY_TO_SWITCH_ON;
    }
    if (state == FSN_AXIS_SWITCH_ON_DISABLED) {
        return state;
    }
    if ((word & 8) == 0) {
        return FSN_AXIS_SWITCHED_ON;
    }
    return state == FSN_AXIS_READY_TO_SWITCH_ON ? FSN_AXIS_SWITCHED_ON : FSN_AXIS_OPERATION_ENABLED;
}

static void set_up(struct fsn_axis_config config) {
    memset(&rig, 0, sizeof rig);
    CHECK(fsn_axis_init(&rig.axis, &config) == FSN_OK);
    rig.drive = (struct drive){
        .state = FSN_AXIS_SWITCH_ON_DISABLED, .mode = config.mode, .position = START_POSITION};
    rig.now_ns = 123456789000u;
    rig.edge_was_low = true;
}

static struct fsn_axis_config csp(void) {
    return (struct fsn_axis_config){
        .mode = FSN_AXIS_CSP, .max_step = LIMIT, .max_velocity = 500, .max_torque = 70};
}

/** Guarantees of the header for every step. */
static void check_promises(int32_t last_position, bool was_enabled) {
    const struct fsn_axis *axis = &rig.axis;
    const struct fsn_axis_outputs *out = &axis->outputs;
    const struct fsn_axis_inputs *in = &axis->inputs;
    if (!axis->enabled) {
        CHECK(out->position == in->position && out->velocity == 0 && out->torque == 0);
    } else {
        CHECK(axis->state == FSN_AXIS_OPERATION_ENABLED && axis->phase == FSN_AXIS_ENABLED);
        CHECK(in->mode == out->mode && rig.requested);
        CHECK((out->controlword & 0x0F) == 0x0F);
        CHECK(was_enabled || out->mode == FSN_AXIS_PP || out->position == in->position);
    }
    if (axis->enabled && was_enabled && out->mode == FSN_AXIS_CSP) {
        const int64_t step = (int64_t)out->position - last_position;
        CHECK(step <= LIMIT && step >= -LIMIT);
    }
    CHECK(out->mode == FSN_AXIS_CSV || out->mode == FSN_AXIS_PV || out->velocity == 0);
    CHECK(out->velocity <= 500 && out->velocity >= -500 && out->torque <= 70 && out->torque >= -70);
    CHECK(out->mode == FSN_AXIS_CST || out->torque == 0);
    /* Enable operation is sent only to a drive that is on the way there by request. */
    const bool enables = (out->controlword & 0x8F) == 0x0F;
    CHECK(!enables || rig.requested);
    CHECK(!enables || axis->state == FSN_AXIS_SWITCHED_ON ||
          axis->state == FSN_AXIS_OPERATION_ENABLED);
    const bool low = (out->controlword & 0x80) == 0;
    CHECK(low || (axis->state == FSN_AXIS_FAULT && rig.reset_allowed));
    CHECK(low || out->controlword == 0x80);
    rig.edges += rig.edge_was_low && !low;
    rig.edge_was_low = low;
    /* A loss ends the request. */
    if (axis->phase > FSN_AXIS_ENABLED) {
        rig.requested =
            rig.requested && axis->state == FSN_AXIS_OPERATION_ENABLED &&
            (axis->phase == FSN_AXIS_TORQUE_OFF || axis->phase == FSN_AXIS_STOPPED_BY_DRIVE);
    }
    rig.reset_allowed = rig.reset_allowed && axis->state == FSN_AXIS_FAULT;
}

/** One cycle with this statusword. */
static void step_with(uint16_t statusword) {
    const int32_t last = rig.axis.outputs.position;
    const bool was = rig.axis.enabled;
    const struct fsn_axis_inputs inputs = {.now_ns = rig.now_ns += MS,
                                           .statusword = statusword,
                                           .mode = rig.drive.mode,
                                           .torque_off = rig.torque_off,
                                           .position = rig.drive.position};
    fsn_axis_step(&rig.axis, &inputs);
    check_promises(last, was);
}

/** One cycle with the drive, which answers. */
static void step(void) {
    struct drive *drive = &rig.drive;
    step_with(state_bits[drive->state] | drive->extra);
    const struct fsn_axis_outputs *out = &rig.axis.outputs;
    drive->state = next_state(drive->state, out->controlword, drive->before);
    drive->before = out->controlword;
    if (drive->mode != out->mode && ++drive->delayed > drive->mode_delay) {
        drive->mode = out->mode;
        drive->delayed = 0;
    }
    if (drive->state == FSN_AXIS_OPERATION_ENABLED && rig.axis.enabled) {
        const bool position = drive->mode == FSN_AXIS_CSP || drive->mode == FSN_AXIS_PP;
        const int64_t moved =
            position ? (int64_t)out->position : (int64_t)drive->position + out->velocity / 10;
        drive->position = (int32_t)moved;
    }
}

static void steps(unsigned count) {
    for (unsigned i = 0; i < count; i++) {
        step();
    }
}

static void enable(void) {
    CHECK(fsn_axis_enable(&rig.axis) == FSN_OK);
    rig.requested = true;
}

static void to_enabled(void) {
    enable();
    for (int i = 0; i < 20 && !rig.axis.enabled; i++) {
        step();
    }
    CHECK(rig.axis.enabled);
}

static void reset(void) {
    CHECK(fsn_axis_reset(&rig.axis) == FSN_OK);
    rig.reset_allowed = true;
}

/* -- states ----------------------------------------------------------------------------------- */

/** Every possible statusword: bits outside of the state field change nothing. */
static void every_statusword_has_its_state(void) {
    unsigned found[FSN_AXIS_NO_STATE + 1] = {0};
    for (uint32_t word = 0; word <= 0xFFFF; word++) {
        const uint16_t low = word & 0x4F;
        const bool quick = (word & 0x20) == 0; /* the drive shows Quick stop by 0 */
        enum fsn_axis_state expected = FSN_AXIS_NO_STATE;
        if (low == 0x00) {
            expected = FSN_AXIS_NOT_READY;
        } else if (low == 0x40) {
            expected = FSN_AXIS_SWITCH_ON_DISABLED;
        } else if (low == 0x0F) {
            expected = FSN_AXIS_FAULT_REACTION_ACTIVE;
        } else if (low == 0x08) {
            expected = FSN_AXIS_FAULT;
        } else if (low == 0x07) {
            expected = quick ? FSN_AXIS_QUICK_STOP_ACTIVE : FSN_AXIS_OPERATION_ENABLED;
        } else if (low == 0x03 && !quick) {
            expected = FSN_AXIS_SWITCHED_ON;
        } else if (low == 0x01 && !quick) {
            expected = FSN_AXIS_READY_TO_SWITCH_ON;
        }
        CHECK(fsn_axis_state_of((uint16_t)word) == expected);
        found[expected]++;
    }
    CHECK(found[FSN_AXIS_FAULT] == 2048 && found[FSN_AXIS_OPERATION_ENABLED] == 1024);
}

/** All states with each request, and statusword bits outside of the state field. */
static void each_state_and_each_request(void) {
    enum { OFF, ON, QUICK, REQUESTS };
    static const uint16_t expected[][REQUESTS] = {
        [FSN_AXIS_NOT_READY] = {0, 0, 0},
        [FSN_AXIS_SWITCH_ON_DISABLED] = {0, 6, 0},
        [FSN_AXIS_READY_TO_SWITCH_ON] = {6, 7, 6},
        [FSN_AXIS_SWITCHED_ON] = {6, 6, 6}, /* down first: a command may be on its way */
        [FSN_AXIS_OPERATION_ENABLED] = {7, 7, 2},
        [FSN_AXIS_QUICK_STOP_ACTIVE] = {0, 2, 2},
        [FSN_AXIS_FAULT_REACTION_ACTIVE] = {6, 6, 6},
        [FSN_AXIS_FAULT] = {0, 0, 0},
        [FSN_AXIS_NO_STATE] = {2, 2, 2}};
    static const uint16_t silent[] = {0, 0x80, 0x100, 0x200, 0x400, 0x800, 0x2000, 0x8000, 0xC180};
    for (unsigned state = 0; state <= FSN_AXIS_NO_STATE; state++) {
        for (unsigned request = 0; request < REQUESTS; request++) {
            for (size_t i = 0; i < sizeof silent / sizeof silent[0]; i++) {
                set_up(csp());
                if (request == ON) {
                    enable();
                } else if (request == QUICK) {
                    fsn_axis_quick_stop(&rig.axis);
                } else {
                    fsn_axis_disable(&rig.axis);
                }
                step_with(state_bits[state] | silent[i]);
                CHECK(rig.axis.state == state && !rig.axis.enabled);
                CHECK(rig.axis.outputs.controlword == expected[state][request]);
            }
        }
    }
}

static void up_and_down(void) {
    set_up(csp());
    steps(3);
    CHECK(rig.axis.phase == FSN_AXIS_OFF && rig.axis.outputs.controlword == 0);
    enable();
    static const uint16_t words[] = {0x06, 0x07, 0x0F, 0x0F};
    for (int i = 0; i < 4; i++) {
        step();
        CHECK(rig.axis.outputs.controlword == words[i]);
    }
    CHECK(rig.axis.enabled && rig.axis.outputs.position == START_POSITION);
    CHECK(fsn_axis_set_position(&rig.axis, START_POSITION + LIMIT + 1) == FSN_E_ARG);
    CHECK(fsn_axis_set_position(&rig.axis, 0) == FSN_E_ARG);
    CHECK(fsn_axis_set_position(&rig.axis, START_POSITION + LIMIT) == FSN_OK);
    steps(2);
    CHECK(rig.drive.position == START_POSITION + LIMIT);
    CHECK(fsn_axis_enable(&rig.axis) == FSN_OK && rig.axis.phase == FSN_AXIS_ENABLED);
    fsn_axis_disable(&rig.axis);
    step();
    CHECK(rig.axis.outputs.controlword == 0x07 && rig.axis.phase == FSN_AXIS_STOPPING);
    steps(3);
    CHECK(rig.axis.phase == FSN_AXIS_OFF && rig.drive.state == FSN_AXIS_READY_TO_SWITCH_ON);
    to_enabled();
    fsn_axis_quick_stop(&rig.axis);
    steps(3);
    CHECK(rig.axis.state == FSN_AXIS_QUICK_STOP_ACTIVE && rig.axis.phase == FSN_AXIS_STOPPING);
    CHECK(fsn_axis_enable(&rig.axis) == FSN_E_STATE);
    fsn_axis_disable(&rig.axis);
    steps(2);
    CHECK(rig.axis.phase == FSN_AXIS_OFF);
    /* At once again, with commands on their way: down first. */
    to_enabled();
    fsn_axis_disable(&rig.axis);
    step();
    to_enabled();
}

/** A drive that was left enabled is disabled; one that stays enabled gets Disable voltage. */
static void found_enabled_and_stuck(void) {
    set_up(csp());
    rig.drive.state = FSN_AXIS_OPERATION_ENABLED;
    step();
    CHECK(rig.axis.outputs.controlword == 0x07 && rig.axis.phase == FSN_AXIS_STOPPING);
    for (int i = 0; i < 3000; i++) {
        step_with(0x37);
        CHECK(rig.axis.outputs.controlword == 0x07);
    }
    step_with(0x37);
    step_with(0x37);
    CHECK(rig.axis.outputs.controlword == 0 && rig.axis.phase == FSN_AXIS_NO_ANSWER);
    /* One that never comes up. */
    set_up(csp());
    enable();
    for (int i = 0; i < 3001; i++) {
        step_with(0x50);
        CHECK(rig.axis.outputs.controlword == 0x06);
    }
    step_with(0x50);
    CHECK(rig.axis.outputs.controlword == 0 && rig.axis.phase == FSN_AXIS_NO_ANSWER);
}

/* -- stops by the drive ------------------------------------------------------------------------ */

/** STO: not a fault, no automatic restart, the program requests it. */
static void torque_off_is_expected(void) {
    set_up(csp());
    to_enabled();
    rig.drive.state = FSN_AXIS_SWITCH_ON_DISABLED;
    rig.drive.position += 1234; /* it sinks */
    steps(500);
    CHECK(rig.axis.phase == FSN_AXIS_TORQUE_OFF && rig.axis.outputs.controlword == 0);
    to_enabled();
    CHECK(rig.axis.outputs.position == START_POSITION + 1234);
    /* A bit of the drive's own, even where the drive makes it a fault. */
    rig.torque_off = true;
    step();
    CHECK(rig.axis.phase == FSN_AXIS_TORQUE_OFF && !rig.axis.enabled);
    CHECK(fsn_axis_enable(&rig.axis) == FSN_E_STATE);
    rig.drive.state = FSN_AXIS_FAULT;
    steps(2);
    CHECK(rig.axis.phase == FSN_AXIS_TORQUE_OFF);
    rig.torque_off = false;
    step();
    CHECK(rig.axis.phase == FSN_AXIS_FAULTED);
    /* While it comes up. */
    set_up(csp());
    enable();
    steps(3);
    rig.drive.state = FSN_AXIS_SWITCH_ON_DISABLED;
    steps(100);
    CHECK(rig.axis.phase == FSN_AXIS_TORQUE_OFF);
    /* The voltage goes in Operation enabled. */
    to_enabled();
    step_with(0x27);
    CHECK(rig.axis.phase == FSN_AXIS_TORQUE_OFF && rig.axis.outputs.controlword == 0x0F);
}

/** SS1: by Quick stop active, or in Operation enabled without following; then no torque. */
static void a_ramp_is_expected(void) {
    set_up(csp());
    to_enabled();
    rig.drive.state = FSN_AXIS_QUICK_STOP_ACTIVE;
    steps(50);
    CHECK(rig.axis.phase == FSN_AXIS_STOPPED_BY_DRIVE && rig.axis.outputs.controlword == 0x02);
    rig.drive.state = FSN_AXIS_SWITCH_ON_DISABLED;
    steps(50);
    CHECK(rig.axis.phase == FSN_AXIS_TORQUE_OFF);
    rig.drive.extra = 0x1200; /* remote, and it follows */
    to_enabled();
    steps(3);
    rig.drive.extra = 0x0200;
    step();
    CHECK(rig.axis.phase == FSN_AXIS_STOPPED_BY_DRIVE && rig.axis.outputs.controlword == 0x0F);
    CHECK(fsn_axis_enable(&rig.axis) == FSN_E_STATE);
    CHECK(fsn_axis_set_position(&rig.axis, START_POSITION) == FSN_E_STATE);
    rig.drive.position += 777;
    rig.drive.extra = 0x1200; /* SS2 has ended: it continues only by request */
    steps(50);
    CHECK(!rig.axis.enabled && rig.axis.phase == FSN_AXIS_STOPPED_BY_DRIVE);
    enable();
    step();
    CHECK(rig.axis.enabled && rig.axis.outputs.position == START_POSITION + 777);
    rig.drive.extra = 0x1000;
    step();
    CHECK(rig.axis.phase == FSN_AXIS_STOPPED_BY_DRIVE); /* the bus no longer commands it */
    rig.drive.extra = 0x1A00;
    step();
    enable();
    step();
    CHECK(rig.axis.limited && rig.axis.enabled); /* SLS is not a stop */
}

/** A drive that has shown bit 12 finds its target where it stands until it follows again. */
static void not_followed_is_not_enabled(void) {
    set_up(csp());
    rig.drive.extra = 0x1200;
    to_enabled();
    rig.drive.state = FSN_AXIS_SWITCH_ON_DISABLED;
    rig.drive.extra = 0x0200;
    step();
    enable();
    steps(10);
    CHECK(rig.axis.phase == FSN_AXIS_ENABLED && !rig.axis.enabled);
    rig.drive.position += 4000; /* a ramp of its own */
    step();
    rig.drive.extra = 0x1200;
    step();
    CHECK(rig.axis.enabled && rig.axis.outputs.position == START_POSITION + 4000);
    /* Halt and its end are not a stop by the drive. */
    rig.drive.extra = 0x0200;
    fsn_axis_halt(&rig.axis, true);
    steps(3);
    fsn_axis_halt(&rig.axis, false);
    steps(3);
    CHECK(rig.axis.phase == FSN_AXIS_ENABLED && !rig.axis.enabled);
    rig.drive.extra = 0x1200;
    step();
    CHECK(rig.axis.enabled);
    /* The bit for STO comes while it goes up: this request is over. */
    fsn_axis_disable(&rig.axis);
    steps(5);
    enable();
    step();
    rig.torque_off = true;
    step();
    rig.torque_off = false;
    steps(100);
    CHECK(rig.axis.phase == FSN_AXIS_TORQUE_OFF && !rig.axis.enabled);
}

/** The time of an answer begins with the request, however long the axis was off. */
static void each_request_has_its_time(void) {
    set_up(csp());
    enable();
    step();
    fsn_axis_disable(&rig.axis);
    for (int i = 0; i < 2; i++) {
        rig.now_ns += 5000u * (uint64_t)MS;
        step();
    }
    rig.now_ns += 5000u * (uint64_t)MS;
    to_enabled();
    for (int i = 0; i < 3500; i++) {
        step();
    }
    fsn_axis_disable(&rig.axis);
    step();
    CHECK(rig.axis.phase == FSN_AXIS_STOPPING);
}

/* -- faults ------------------------------------------------------------------------------------ */

static void fault_in_each_state(void) {
    for (unsigned state = 0; state <= FSN_AXIS_FAULT; state++) {
        set_up(csp());
        rig.drive.state = (enum fsn_axis_state)state;
        enable();
        step();
        rig.drive.state = FSN_AXIS_FAULT_REACTION_ACTIVE;
        steps(200);
        CHECK(rig.axis.phase == FSN_AXIS_FAULTED && rig.edges == 0); /* never by itself */
        CHECK(rig.axis.outputs.controlword == 0);
        CHECK(fsn_axis_enable(&rig.axis) == FSN_E_STATE);
        reset();
        CHECK(fsn_axis_reset(&rig.axis) == FSN_E_STATE);
        steps(3);
        CHECK(rig.edges == 1 && rig.axis.phase == FSN_AXIS_OFF);
        CHECK(rig.drive.state == FSN_AXIS_SWITCH_ON_DISABLED);
        to_enabled();
    }
    CHECK(fsn_axis_reset(&rig.axis) == FSN_E_STATE);
}

/** A fault that stays: one edge, held; the next one is low long enough before. */
static void a_fault_that_stays(void) {
    set_up(csp());
    for (unsigned i = 1; i <= 3; i++) {
        step_with(0x08);
        reset();
        unsigned low = 0;
        while (rig.edges < i) {
            step_with(0x08);
            CHECK(++low < 20);
        }
        CHECK(i == 1 ? low == 1 : low >= 10);
        while (rig.axis.phase == FSN_AXIS_RESETTING) {
            step_with(0x08);
        }
        CHECK(rig.edges == i && rig.axis.phase == FSN_AXIS_FAULTED);
        CHECK(rig.axis.outputs.controlword == 0);
    }
    reset();
    fsn_axis_disable(&rig.axis); /* takes it back */
    for (int i = 0; i < 100; i++) {
        step_with(0x08);
    }
    CHECK(rig.edges == 3 && rig.axis.phase == FSN_AXIS_FAULTED);
}

/* -- modes ------------------------------------------------------------------------------------- */

static void modes_are_confirmed(void) {
    set_up(csp());
    rig.drive.mode = 0;
    rig.drive.mode_delay = 20;
    enable();
    steps(15);
    CHECK(rig.axis.state == FSN_AXIS_SWITCHED_ON && rig.axis.outputs.controlword == 0x07);
    to_enabled();
    CHECK(fsn_axis_set_position(&rig.axis, START_POSITION + 10) == FSN_OK);
    step();
    CHECK(fsn_axis_set_mode(&rig.axis, FSN_AXIS_CSV) == FSN_OK);
    CHECK(fsn_axis_set_velocity(&rig.axis, 10) == FSN_E_STATE);
    steps(5);
    CHECK(!rig.axis.enabled && rig.axis.phase == FSN_AXIS_ENABLED);
    steps(30);
    CHECK(rig.axis.enabled && rig.axis.outputs.velocity == 0);
    CHECK(fsn_axis_set_velocity(&rig.axis, 501) == FSN_E_ARG);
    CHECK(fsn_axis_set_velocity(&rig.axis, -501) == FSN_E_ARG);
    CHECK(fsn_axis_set_position(&rig.axis, START_POSITION) == FSN_E_STATE);
    CHECK(fsn_axis_set_velocity(&rig.axis, -500) == FSN_OK);
    step();
    CHECK(rig.axis.outputs.velocity == -500);
    fsn_axis_halt(&rig.axis, true);
    step();
    CHECK(rig.axis.outputs.velocity == 0 && rig.axis.outputs.controlword == 0x10F);
    CHECK(fsn_axis_set_velocity(&rig.axis, 5) == FSN_E_STATE);
    fsn_axis_halt(&rig.axis, false);
    step();
    CHECK(rig.axis.outputs.velocity == 0 && rig.axis.outputs.controlword == 0x00F);
    CHECK(fsn_axis_set_mode(&rig.axis, FSN_AXIS_CST) == FSN_OK);
    steps(30);
    CHECK(fsn_axis_set_torque(&rig.axis, 71) == FSN_E_ARG);
    CHECK(fsn_axis_set_torque(&rig.axis, 70) == FSN_OK);
    step();
    CHECK(rig.axis.outputs.torque == 70);
    CHECK(fsn_axis_set_mode(&rig.axis, 7) == FSN_E_ARG);
    CHECK(fsn_axis_set_mode(&rig.axis, -1) == FSN_E_ARG);
    CHECK(fsn_axis_set_mode(&rig.axis, 11) == FSN_E_ARG);
    /* One that is never taken. */
    rig.drive.mode_delay = 10000;
    CHECK(fsn_axis_set_mode(&rig.axis, FSN_AXIS_PV) == FSN_OK);
    steps(3010);
    CHECK(rig.axis.phase == FSN_AXIS_NO_ANSWER && rig.axis.state != FSN_AXIS_OPERATION_ENABLED);
}

/** Bit 12 is cleared while the drive changes its mode: this is not a stop by the drive. */
static void a_change_of_mode_is_no_stop(void) {
    set_up(csp());
    rig.drive.extra = 0x1200;
    rig.drive.mode_delay = 5;
    to_enabled();
    CHECK(fsn_axis_set_mode(&rig.axis, FSN_AXIS_CSV) == FSN_OK);
    rig.drive.extra = 0x0200;
    steps(10);
    CHECK(rig.axis.phase == FSN_AXIS_ENABLED && !rig.axis.enabled);
    rig.drive.extra = 0x1200;
    step();
    CHECK(rig.axis.enabled);
}

static void limits_open_modes(void) {
    struct fsn_axis axis;
    struct fsn_axis_config none = {.mode = FSN_AXIS_CSP};
    CHECK(fsn_axis_init(&axis, &none) == FSN_E_ARG);
    none.mode = FSN_AXIS_HM;
    CHECK(fsn_axis_init(&axis, &none) == FSN_OK);
    static const int8_t closed[] = {FSN_AXIS_CSP, FSN_AXIS_CSV, FSN_AXIS_CST, FSN_AXIS_PV, 0, 2};
    for (size_t i = 0; i < sizeof closed; i++) {
        CHECK(fsn_axis_set_mode(&axis, closed[i]) == FSN_E_ARG);
    }
    struct fsn_axis_config few = csp();
    few.modes = 1 << FSN_AXIS_CSP;
    CHECK(fsn_axis_init(&axis, &few) == FSN_OK);
    CHECK(fsn_axis_set_mode(&axis, FSN_AXIS_PP) == FSN_E_ARG);
}

static void halt_in_csp_goes_on_from_where_it_stands(void) {
    set_up(csp());
    rig.drive.extra = 0x1200;
    to_enabled();
    steps(2);
    CHECK(fsn_axis_set_position(&rig.axis, START_POSITION + 40) == FSN_OK);
    step();
    fsn_axis_halt(&rig.axis, true);
    rig.drive.extra = 0x0200; /* it follows its own ramp */
    step();
    CHECK(rig.axis.phase == FSN_AXIS_ENABLED);
    CHECK(rig.axis.outputs.position == START_POSITION + 40);
    CHECK(fsn_axis_set_position(&rig.axis, START_POSITION + 41) == FSN_E_STATE);
    rig.drive.position = START_POSITION + 900;
    step_with(0x237);
    rig.drive.position = START_POSITION + 900;
    rig.drive.extra = 0x1200;
    fsn_axis_halt(&rig.axis, false);
    step();
    CHECK(rig.axis.enabled && rig.axis.outputs.position == START_POSITION + 900);
}

/* -- set-points and homing --------------------------------------------------------------------- */

static void set_points_shake_hands(void) {
    struct fsn_axis_config config = csp();
    config.mode = FSN_AXIS_PP;
    set_up(config);
    to_enabled();
    CHECK(fsn_axis_move(&rig.axis, 5000, true) == FSN_OK);
    CHECK(fsn_axis_move(&rig.axis, 6000, true) == FSN_E_BUSY);
    step_with(0x1437); /* the buffer of the drive is full */
    CHECK(rig.axis.outputs.controlword == 0x0F && rig.axis.job == FSN_AXIS_JOB_WAITING);
    step_with(0x0437);
    CHECK(rig.axis.outputs.controlword == 0x3F && rig.axis.outputs.position == 5000);
    step_with(0x0437); /* reached, but the one before */
    CHECK(rig.axis.job == FSN_AXIS_JOB_WAITING);
    step_with(0x1437);
    CHECK(rig.axis.outputs.controlword == 0x0F && rig.axis.job == FSN_AXIS_JOB_RUNNING);
    step_with(0x1437);
    CHECK(rig.axis.job == FSN_AXIS_JOB_RUNNING);
    step_with(0x0037);
    CHECK(rig.axis.job == FSN_AXIS_JOB_RUNNING && rig.axis.outputs.position == 5000);
    step_with(0x0437);
    CHECK(rig.axis.job == FSN_AXIS_JOB_DONE);
    CHECK(fsn_axis_move(&rig.axis, -7, false) == FSN_OK);
    step_with(0x0437);
    CHECK(rig.axis.outputs.controlword == 0x1F && rig.axis.outputs.position == -7);
    for (int i = 0; i < 3001; i++) {
        step_with(0x0437);
    }
    CHECK(rig.axis.job == FSN_AXIS_JOB_FAILED && rig.axis.outputs.controlword == 0x0F);
    CHECK(fsn_axis_move(&rig.axis, 9, false) == FSN_OK);
    step_with(0x0037);
    step_with(0x0050); /* STO in the middle of it */
    CHECK(rig.axis.job == FSN_AXIS_JOB_FAILED && rig.axis.phase == FSN_AXIS_TORQUE_OFF);
    CHECK(fsn_axis_move(&rig.axis, 9, false) == FSN_E_STATE);
}

static void homing_and_its_result(void) {
    static const struct {
        uint16_t words[4];
        enum fsn_axis_job job;
    } cases[] = {
        {{0x0037, 0x0037, 0x0437, 0x1437}, FSN_AXIS_JOB_DONE},
        {{0x0037, 0x0037, 0x2037, 0x2037}, FSN_AXIS_JOB_FAILED},
        {{0x1437, 0x1437, 0x1437, 0x1437}, FSN_AXIS_JOB_RUNNING}, /* of an earlier one */
        {{0x1437, 0x0037, 0x1037, 0x1437}, FSN_AXIS_JOB_DONE},
        {{0x2437, 0x2437, 0x0437, 0x0437}, FSN_AXIS_JOB_RUNNING},
        {{0x0037, 0x0037, 0x0037, 0x0050}, FSN_AXIS_JOB_FAILED},
    };
    struct fsn_axis_config config = csp();
    config.mode = FSN_AXIS_HM;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        set_up(config);
        CHECK(fsn_axis_home(&rig.axis) == FSN_E_STATE);
        to_enabled();
        CHECK(fsn_axis_home(&rig.axis) == FSN_OK && fsn_axis_home(&rig.axis) == FSN_E_BUSY);
        for (int n = 0; n < 4; n++) {
            step_with(cases[i].words[n]);
            CHECK(n > 0 || rig.axis.outputs.controlword == 0x1F);
        }
        CHECK(rig.axis.job == cases[i].job);
        const bool runs = cases[i].job == FSN_AXIS_JOB_RUNNING;
        CHECK(((rig.axis.outputs.controlword & 0x10) != 0) == runs);
    }
    /* Results of a set-point do not apply to homing. */
    config.mode = FSN_AXIS_PP;
    set_up(config);
    to_enabled();
    CHECK(fsn_axis_move(&rig.axis, 5, true) == FSN_OK);
    step_with(0x37);
    CHECK(fsn_axis_set_mode(&rig.axis, FSN_AXIS_HM) == FSN_OK);
    CHECK(rig.axis.job == FSN_AXIS_JOB_FAILED);
    rig.drive.mode = FSN_AXIS_HM;
    step_with(0x37);
    CHECK(fsn_axis_home(&rig.axis) == FSN_OK);
    step_with(0x37);
    CHECK(rig.axis.outputs.controlword == 0x1F);
    config.mode = FSN_AXIS_HM;
    /* A method that ends at once never shows that it has begun. */
    set_up(config);
    to_enabled();
    CHECK(fsn_axis_home(&rig.axis) == FSN_OK);
    for (int i = 0; i < 102; i++) {
        step_with(0x1437);
    }
    CHECK(rig.axis.job == FSN_AXIS_JOB_DONE);
}

/* -- at random --------------------------------------------------------------------------------- */

/** A program that requests anything at any time. */
static void request_something(uint64_t *seed) {
    static const int8_t modes[] = {1, 3, 6, 8, 9, 10, 0};
    struct fsn_axis *axis = &rig.axis;
    const int32_t near = axis->outputs.position;
    const uint32_t value = next_random(seed);
    fsn_status done = FSN_OK;
    switch (next_random(seed) % 24) {
    case 0:
    case 1:
        if (fsn_axis_enable(axis) == FSN_OK) {
            rig.requested = true;
        }
        return;
    case 2:
        fsn_axis_disable(axis);
        rig.requested = false;
        return;
    case 3:
        fsn_axis_quick_stop(axis);
        rig.requested = false;
        return;
    case 4:
        if (fsn_axis_reset(axis) == FSN_OK) {
            rig.reset_allowed = true;
        }
        return;
    case 5:
        fsn_axis_halt(axis, value % 2);
        return;
    case 6:
        done = fsn_axis_set_mode(axis, modes[value % sizeof modes]);
        break;
    case 7:
        done = fsn_axis_move(axis, (int32_t)value, value % 2);
        break;
    case 8:
        done = fsn_axis_home(axis);
        break;
    case 9:
        done = fsn_axis_set_position(axis, (int32_t)value);
        break;
    case 10:
        done = fsn_axis_set_velocity(axis, (int32_t)(value % 2000) - 1000);
        break;
    case 11:
        done = fsn_axis_set_torque(axis, (int16_t)((int32_t)(value % 200) - 100));
        break;
    default:
        if (near < INT32_MAX - 100 && near > INT32_MIN + 100) {
            done = fsn_axis_set_position(axis, near + (int32_t)(value % 120) - 60);
        }
        break;
    }
    CHECK(done == FSN_OK || done == FSN_E_ARG || done == FSN_E_STATE || done == FSN_E_BUSY);
}

/** A drive by the standard whose safety function, or a fault, takes it away at any moment. */
static void torque_is_taken_at_any_moment(void) {
    unsigned enabled = 0;
    unsigned stops = 0;
    for (uint64_t seed = 1; seed <= 200; seed++) {
        uint64_t state = seed;
        set_up(csp());
        rig.drive.extra = 0x1200;
        for (int i = 0; i < 1000; i++) {
            if (next_random(&state) % 3 == 0) {
                request_something(&state);
            } else if (!rig.requested && fsn_axis_enable(&rig.axis) == FSN_OK) {
                rig.requested = true;
            }
            const uint32_t what = next_random(&state) % 60;
            rig.torque_off = what == 0 || (rig.torque_off && what < 50);
            if (what <= 3) {
                static const enum fsn_axis_state to[] = {
                    FSN_AXIS_SWITCH_ON_DISABLED, FSN_AXIS_QUICK_STOP_ACTIVE,
                    FSN_AXIS_FAULT_REACTION_ACTIVE, FSN_AXIS_FAULT};
                rig.drive.state = to[what];
                rig.drive.position += (int32_t)(next_random(&state) % 2000) - 1000;
                stops++;
            }
            step();
            enabled += rig.axis.enabled;
        }
    }
    CHECK(enabled > 10000 && stops > 5000); /* the drives moved, and were stopped */
}

/** Drives that answer anything. */
static void nonsense(void) {
    unsigned enabled = 0;
    for (uint64_t seed = 1; seed <= 200; seed++) {
        uint64_t state = seed;
        set_up(csp());
        for (int i = 0; i < 1000; i++) {
            request_something(&state);
            uint16_t word = (uint16_t)next_random(&state);
            if (next_random(&state) % 4 != 0) { /* mostly a state */
                word = (uint16_t)((word & 0xFF80) | state_bits[next_random(&state) % 8]);
            }
            rig.drive.mode =
                next_random(&state) % 4 == 0 ? (int8_t)next_random(&state) : rig.axis.outputs.mode;
            rig.drive.position = (int32_t)next_random(&state);
            rig.torque_off = next_random(&state) % 16 == 0;
            if (next_random(&state) % 64 == 0) {
                rig.now_ns = (uint64_t)next_random(&state) << 20; /* time jumps, back as well */
            }
            const unsigned repeats = 1 + next_random(&state) % 3;
            for (unsigned n = 0; n < repeats; n++) {
                step_with(word);
                enabled += rig.axis.enabled;
            }
        }
    }
    CHECK(enabled > 100);
}

static void words_for_messages(void) {
    CHECK(strcmp(fsn_axis_state_name(FSN_AXIS_NO_STATE), "no state") == 0);
    CHECK(strcmp(fsn_axis_phase_name(FSN_AXIS_BAD_STATUSWORD), "bad statusword") == 0);
    CHECK(strcmp(fsn_axis_mode_name(FSN_AXIS_CST), "cst") == 0);
    CHECK(strcmp(fsn_axis_mode_name(7), "?") == 0 && strcmp(fsn_axis_mode_name(-3), "?") == 0);
    CHECK(strcmp(fsn_axis_mode_name(1000), "?") == 0);
    CHECK(strcmp(fsn_axis_state_name(9), "?") == 0 && strcmp(fsn_axis_phase_name(10), "?") == 0);
}

int main(void) {
    every_statusword_has_its_state();
    each_state_and_each_request();
    up_and_down();
    found_enabled_and_stuck();
    torque_off_is_expected();
    a_ramp_is_expected();
    not_followed_is_not_enabled();
    each_request_has_its_time();
    fault_in_each_state();
    a_fault_that_stays();
    modes_are_confirmed();
    a_change_of_mode_is_no_stop();
    limits_open_modes();
    halt_in_csp_goes_on_from_where_it_stands();
    set_points_shake_hands();
    homing_and_its_result();
    torque_is_taken_at_any_moment();
    nonsense();
    words_for_messages();
    return 0;
}
