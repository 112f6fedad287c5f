/** An axis by CiA 402 in its cycle: the drive's states, its commands, and targets that never jump.
 *
 *  Each step answers three questions in this order: the state of the drive (watch), its targets
 *  (targets), and the controlword that leads to the requested state (command). */
#include <stddef.h>

#include "client/axis_own.h"

enum {
    NS_PER_MS = 1000000,
    DEFAULT_ANSWER_MS = 3000,
    SETTLE_MS = 100, /**< after this time, bits belong to this homing and not to an earlier one */
    LOW_MS = 10,     /**< bit 7 is 0 for this time before it rises: drives sample it at their own
                      * rate */
};

/** Controlword: the commands, and bits of the modes (IEC 61800-7-201, table of commands). */
enum command {
    DISABLE_VOLTAGE = 0x00,
    QUICK_STOP = 0x02,
    SHUTDOWN = 0x06,
    SWITCH_ON = 0x07, /* from Operation enabled: disable operation */
    ENABLE_OPERATION = 0x0F,
    START = 1 << 4, /* PP: new set-point; HM: start */
    AT_ONCE = 1 << 5,
    FAULT_RESET = 1 << 7,
    HALT = 1 << 8,
};

enum fsn_axis_state fsn_axis_state_of(uint16_t statusword) {
    static const struct {
        uint16_t mask, bits;
        enum fsn_axis_state state;
    } table[] = {
        {0x4F, 0x00, FSN_AXIS_NOT_READY},
        {0x4F, 0x40, FSN_AXIS_SWITCH_ON_DISABLED},
        {0x6F, 0x21, FSN_AXIS_READY_TO_SWITCH_ON},
        {0x6F, 0x23, FSN_AXIS_SWITCHED_ON},
        {0x6F, 0x27, FSN_AXIS_OPERATION_ENABLED},
        {0x6F, 0x07, FSN_AXIS_QUICK_STOP_ACTIVE},
        {0x4F, 0x0F, FSN_AXIS_FAULT_REACTION_ACTIVE},
        {0x4F, 0x08, FSN_AXIS_FAULT},
    };
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        if ((statusword & table[i].mask) == table[i].bits) {
            return table[i].state;
        }
    }
    return FSN_AXIS_NO_STATE;
}

/** No torque, and no pending command that removes it. */
static bool is_low(uint8_t state) {
    return state == FSN_AXIS_NOT_READY || state == FSN_AXIS_SWITCH_ON_DISABLED ||
           state == FSN_AXIS_READY_TO_SWITCH_ON;
}

static bool is_faulted(uint8_t state) {
    return state == FSN_AXIS_FAULT || state == FSN_AXIS_FAULT_REACTION_ACTIVE;
}

static uint64_t answer_ns(const struct fsn_axis *axis) {
    const uint32_t ms =
        axis->config.answer_ms != 0 ? axis->config.answer_ms : (uint32_t)DEFAULT_ANSWER_MS;
    return (uint64_t)ms * NS_PER_MS;
}

static bool is_over(const struct fsn_axis *axis, uint64_t since_ns, uint64_t time_ns) {
    return axis->inputs.now_ns > since_ns && axis->inputs.now_ns - since_ns > time_ns;
}

/* -- state of the drive ------------------------------------------------------------------------ */

/** The drive has left the requested state: only the program can return it. */
static void lose(struct fsn_axis *axis, enum fsn_axis_phase phase) {
    axis->own.goal = axis->state == FSN_AXIS_QUICK_STOP_ACTIVE ? GOAL_QUICK_STOP : GOAL_OFF;
    axis->own.since_ns = axis->inputs.now_ns;
    axis->phase = (uint8_t)phase;
}

/** Meaning of a state that was not requested. */
static enum fsn_axis_phase unrequested(const struct fsn_axis *axis) {
    if (axis->state == FSN_AXIS_NO_STATE) {
        return FSN_AXIS_BAD_STATUSWORD;
    }
    if (axis->inputs.torque_off) {
        return FSN_AXIS_TORQUE_OFF; /* some drives show STO as a fault; then it must be reset */
    }
    if (is_faulted(axis->state)) {
        return FSN_AXIS_FAULTED;
    }
    return axis->state == FSN_AXIS_QUICK_STOP_ACTIVE ? FSN_AXIS_STOPPED_BY_DRIVE
                                                     : FSN_AXIS_TORQUE_OFF;
}

/** In Operation enabled: learns the bits of the drive, and detects when one is cleared. */
static void watch_bits(struct fsn_axis *axis) {
    struct fsn_axis_own *own = &axis->own;
    const uint16_t watched = fsn_axis_watched_bits(axis);
    const uint16_t now = axis->inputs.statusword & watched;
    const uint16_t gone = own->learned & watched & (uint16_t)~now;
    if (axis->inputs.torque_off || (gone & VOLTAGE) != 0) {
        axis->phase = FSN_AXIS_TORQUE_OFF;
    } else if ((gone & REMOTE) != 0 || ((gone & FOLLOWS) != 0 && own->followed)) {
        axis->phase = FSN_AXIS_STOPPED_BY_DRIVE;
    }
    own->learned |= now;
    own->follows = own->follows || (now & FOLLOWS) != 0;
    own->followed = (now & FOLLOWS) != 0;
}

static void watch_enabling(struct fsn_axis *axis) {
    struct fsn_axis_own *own = &axis->own;
    if (axis->state >= FSN_AXIS_QUICK_STOP_ACTIVE || axis->inputs.torque_off) {
        lose(axis, unrequested(axis));
        return;
    }
    if (!own->settled) {
        /* An earlier command may still be pending: the drive must first be in a low state. */
        own->settled = is_low(axis->state);
        own->highest = axis->state;
    } else if (axis->state < own->highest) {
        lose(axis, FSN_AXIS_TORQUE_OFF);
        return;
    }
    own->highest = axis->state;
    if (own->settled && axis->state == FSN_AXIS_OPERATION_ENABLED &&
        fsn_axis_mode_is_confirmed(axis)) {
        axis->phase = FSN_AXIS_ENABLED;
        own->learned = 0;
        own->followed = false;
        watch_bits(axis);
    } else if (is_over(axis, own->since_ns, answer_ns(axis))) {
        lose(axis, FSN_AXIS_NO_ANSWER);
    }
}

static void watch_enabled(struct fsn_axis *axis) {
    if (axis->state != FSN_AXIS_OPERATION_ENABLED) {
        lose(axis, unrequested(axis));
        return;
    }
    if (axis->phase == FSN_AXIS_ENABLED) {
        watch_bits(axis);
    }
    if (fsn_axis_mode_is_confirmed(axis)) {
        axis->own.mode_ns = axis->inputs.now_ns;
    } else if (is_over(axis, axis->own.mode_ns, answer_ns(axis))) {
        lose(axis, FSN_AXIS_NO_ANSWER);
    }
}

/** Phase of an axis that is not requested to be enabled. */
static uint8_t phase_off(const struct fsn_axis *axis) {
    const uint8_t state = axis->state;
    uint8_t phase = axis->phase;
    if (axis->own.resets) {
        return FSN_AXIS_RESETTING;
    }
    if (is_faulted(state) || state == FSN_AXIS_NO_STATE || axis->inputs.torque_off) {
        return (uint8_t)unrequested(axis);
    }
    if (phase == FSN_AXIS_STOPPED_BY_DRIVE && state < FSN_AXIS_OPERATION_ENABLED) {
        return FSN_AXIS_TORQUE_OFF; /* the end of SS1 */
    }
    if (phase == FSN_AXIS_FAULTED || phase == FSN_AXIS_RESETTING) {
        phase = FSN_AXIS_OFF;
    }
    if (phase == FSN_AXIS_OFF || phase == FSN_AXIS_STOPPING) {
        phase = is_low(state) ? FSN_AXIS_OFF : FSN_AXIS_STOPPING;
    }
    return phase;
}

static void watch_off(struct fsn_axis *axis) {
    struct fsn_axis_own *own = &axis->own;
    if (axis->state != FSN_AXIS_FAULT || is_over(axis, own->since_ns, answer_ns(axis))) {
        own->resets = false; /* done; or the cause is still present, or it cannot be reset */
    }
    axis->phase = phase_off(axis);
    if (axis->state != FSN_AXIS_OPERATION_ENABLED) {
        own->since_ns = own->resets ? own->since_ns : axis->inputs.now_ns;
    } else if (is_over(axis, own->since_ns, answer_ns(axis))) {
        axis->phase = FSN_AXIS_NO_ANSWER; /* it stays in Operation enabled */
    }
}

static void watch(struct fsn_axis *axis) {
    if (axis->own.started) {
        axis->own.started = false;
        axis->own.since_ns = axis->inputs.now_ns;
        axis->own.mode_ns = axis->inputs.now_ns;
    }
    if (axis->own.goal != GOAL_ON) {
        watch_off(axis);
    } else if (axis->phase == FSN_AXIS_ENABLING) {
        watch_enabling(axis);
    } else {
        watch_enabled(axis);
    }
}

/* -- its command ------------------------------------------------------------------------------- */

/** A rising edge that the drive cannot miss. */
static uint16_t reset_bit(struct fsn_axis *axis) {
    const bool was_low = (axis->outputs.controlword & FAULT_RESET) == 0;
    if (!axis->own.resets) {
        axis->own.low_ns = was_low ? axis->own.low_ns : axis->inputs.now_ns;
        return 0;
    }
    const bool low_for_long =
        axis->own.low_ns == 0 || is_over(axis, axis->own.low_ns, (uint64_t)LOW_MS * NS_PER_MS);
    return !was_low || low_for_long ? FAULT_RESET : 0;
}

static uint16_t command_enabled(const struct fsn_axis *axis) {
    const struct fsn_axis_own *own = &axis->own;
    if (own->goal == GOAL_ON && (own->settled || axis->phase != FSN_AXIS_ENABLING)) {
        return (uint16_t)(ENABLE_OPERATION | (axis->halted ? HALT : 0) | (own->start ? START : 0) |
                          (own->start && own->at_once ? AT_ONCE : 0));
    }
    if (axis->phase == FSN_AXIS_NO_ANSWER && is_over(axis, own->since_ns, answer_ns(axis))) {
        return DISABLE_VOLTAGE;
    }
    return own->goal == GOAL_QUICK_STOP ? QUICK_STOP : SWITCH_ON;
}

static uint16_t command(struct fsn_axis *axis) {
    const bool on = axis->own.goal == GOAL_ON;
    switch (axis->state) {
    case FSN_AXIS_SWITCH_ON_DISABLED:
        return on ? SHUTDOWN : DISABLE_VOLTAGE;
    case FSN_AXIS_READY_TO_SWITCH_ON:
        return on ? SWITCH_ON : SHUTDOWN;
    case FSN_AXIS_SWITCHED_ON:
        /* An earlier command may still act: the drive must have been in a low state first. */
        if (!on || !axis->own.settled) {
            return SHUTDOWN;
        }
        /* With an unconfirmed mode, the drive would interpret the target as another quantity. */
        return fsn_axis_mode_is_confirmed(axis) ? ENABLE_OPERATION : SWITCH_ON;
    case FSN_AXIS_OPERATION_ENABLED:
        return command_enabled(axis);
    case FSN_AXIS_QUICK_STOP_ACTIVE:
        /* Only a request to switch off leaves the state: the drive may hold its position there. */
        return axis->own.goal == GOAL_OFF ? DISABLE_VOLTAGE : QUICK_STOP;
    case FSN_AXIS_FAULT_REACTION_ACTIVE:
        return SHUTDOWN; /* the voltage stays, so that the drive can end its ramp */
    case FSN_AXIS_NO_STATE:
        return QUICK_STOP; /* a step down from every state, and a ramp from Operation enabled */
    default:
        return DISABLE_VOLTAGE;
    }
}

/* -- set-points and homing --------------------------------------------------------------------- */

/** PP: bit 4 is set when the drive is free (bit 12 is 0), and cleared when it has accepted it. */
static void follow_set_point(struct fsn_axis *axis) {
    struct fsn_axis_own *own = &axis->own;
    const bool taken = (axis->inputs.statusword & FOLLOWS) != 0;
    if (axis->job == FSN_AXIS_JOB_WAITING && !own->start) {
        own->start = !taken;
        own->job_ns = axis->inputs.now_ns;
    } else if (axis->job == FSN_AXIS_JOB_WAITING && taken) {
        own->start = false;
        axis->job = FSN_AXIS_JOB_RUNNING;
    } else if (axis->job == FSN_AXIS_JOB_WAITING && is_over(axis, own->job_ns, answer_ns(axis))) {
        fsn_axis_interrupt_job(axis);
    } else if (axis->job == FSN_AXIS_JOB_RUNNING && !taken && axis->reached) {
        axis->job = FSN_AXIS_JOB_DONE;
    }
}

static void follow_homing(struct fsn_axis *axis) {
    struct fsn_axis_own *own = &axis->own;
    const uint16_t found = axis->inputs.statusword & (REACHED | FOLLOWS | HOMING_ERROR);
    if (axis->job == FSN_AXIS_JOB_WAITING) {
        axis->job = FSN_AXIS_JOB_RUNNING;
        own->start = true;
        own->fresh = false;
        own->job_ns = axis->inputs.now_ns;
        return;
    }
    own->fresh = own->fresh || (found & (FOLLOWS | HOMING_ERROR)) == 0 ||
                 is_over(axis, own->job_ns, (uint64_t)SETTLE_MS * NS_PER_MS);
    if (axis->job != FSN_AXIS_JOB_RUNNING || !own->fresh) {
        return;
    }
    if ((found & HOMING_ERROR) != 0) {
        fsn_axis_interrupt_job(axis);
    } else if (found == (REACHED | FOLLOWS)) {
        axis->job = FSN_AXIS_JOB_DONE;
        own->start = false;
    }
}

static void follow_job(struct fsn_axis *axis) {
    if (!axis->enabled) {
        fsn_axis_interrupt_job(axis);
    } else if (axis->outputs.mode == FSN_AXIS_PP) {
        follow_set_point(axis);
    } else if (axis->outputs.mode == FSN_AXIS_HM) {
        follow_homing(axis);
    }
}

/* -- targets ----------------------------------------------------------------------------------- */

/** Actual or commanded state of the drive: only the target of its mode may change. */
static int32_t target_position(const struct fsn_axis *axis, bool was_enabled) {
    const struct fsn_axis_own *own = &axis->own;
    const int8_t mode = axis->outputs.mode;
    if (!axis->enabled || (mode != FSN_AXIS_CSP && mode != FSN_AXIS_PP)) {
        return axis->inputs.position;
    }
    if (own->has_position && (mode == FSN_AXIS_CSP || own->start)) {
        return own->wanted_position;
    }
    return was_enabled ? axis->outputs.position : axis->inputs.position;
}

static void set_targets(struct fsn_axis *axis, bool was_enabled) {
    if (!axis->enabled) {
        fsn_axis_forget_targets(axis);
    }
    struct fsn_axis_outputs *out = &axis->outputs;
    const bool moves = axis->enabled && !axis->halted;
    const bool by_velocity = out->mode == FSN_AXIS_CSV || out->mode == FSN_AXIS_PV;
    out->position = target_position(axis, was_enabled);
    out->velocity = moves && by_velocity ? axis->own.wanted_velocity : 0;
    out->torque = moves && out->mode == FSN_AXIS_CST ? axis->own.wanted_torque : 0;
}

void fsn_axis_step(struct fsn_axis *axis, const struct fsn_axis_inputs *inputs) {
    const bool was_enabled = axis->enabled;
    axis->inputs = *inputs;
    axis->state = (uint8_t)fsn_axis_state_of(inputs->statusword);
    axis->reached = (inputs->statusword & REACHED) != 0;
    axis->limited = (inputs->statusword & LIMITED) != 0;
    watch(axis);
    /* A drive that supports bit 12 ignores its target while the bit is 0, and must not find a
     * different one when it follows again. */
    const bool ignored = axis->own.follows && fsn_axis_is_cyclic(axis->outputs.mode) &&
                         !axis->halted && (inputs->statusword & FOLLOWS) == 0;
    axis->enabled = axis->phase == FSN_AXIS_ENABLED && fsn_axis_mode_is_confirmed(axis) && !ignored;
    follow_job(axis);
    set_targets(axis, was_enabled);
    axis->outputs.controlword = (uint16_t)(command(axis) | reset_bit(axis));
}
