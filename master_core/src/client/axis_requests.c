/** Requests of a program to an axis, and their refusals. */
#include <stddef.h>

#include "client/axis_own.h"

/** Whether the drive has a mode, and the program stated its limit. */
static bool is_open(const struct fsn_axis_config *config, int8_t mode) {
    if (mode < 0 || mode > FSN_AXIS_CST ||
        (config->modes != 0 && (config->modes >> mode & 1) == 0)) {
        return false;
    }
    switch (mode) {
    case FSN_AXIS_PP:
    case FSN_AXIS_HM:
        return true;
    case FSN_AXIS_CSP:
        return config->max_step != 0;
    case FSN_AXIS_PV:
    case FSN_AXIS_CSV:
        return config->max_velocity != 0;
    case FSN_AXIS_CST:
        return config->max_torque != 0;
    default:
        return false;
    }
}

fsn_status fsn_axis_init(struct fsn_axis *axis, const struct fsn_axis_config *config) {
    *axis = (struct fsn_axis){
        .config = *config, .outputs = {.mode = config->mode}, .own = {.started = true}};
    return is_open(config, config->mode) ? FSN_OK : FSN_E_ARG;
}

/* -- requests ---------------------------------------------------------------------------------- */

fsn_status fsn_axis_enable(struct fsn_axis *axis) {
    struct fsn_axis_own *own = &axis->own;
    if (axis->state >= FSN_AXIS_QUICK_STOP_ACTIVE || axis->inputs.torque_off) {
        return FSN_E_STATE;
    }
    if (own->goal == GOAL_ON && axis->phase <= FSN_AXIS_ENABLED) {
        fsn_axis_halt(axis, false);
        return FSN_OK;
    }
    if (own->goal == GOAL_ON) { /* stopped by the drive, in Operation enabled */
        if ((own->learned & fsn_axis_watched_bits(axis) & (uint16_t)~axis->inputs.statusword) !=
            0) {
            return FSN_E_STATE;
        }
        axis->phase = FSN_AXIS_ENABLED;
    } else {
        axis->phase = FSN_AXIS_ENABLING;
        own->started = true;
        own->settled = false;
    }
    own->goal = GOAL_ON;
    fsn_axis_halt(axis, false);
    return FSN_OK;
}

/** Ends the request of the program; the cause of a stop stays until it is checked. */
static void leave(struct fsn_axis *axis, uint8_t goal) {
    axis->own.goal = goal;
    axis->own.started = true;
    axis->own.resets = false;
    if (axis->phase != FSN_AXIS_FAULTED) {
        axis->phase = FSN_AXIS_STOPPING;
    }
}

void fsn_axis_disable(struct fsn_axis *axis) {
    leave(axis, GOAL_OFF);
}

void fsn_axis_quick_stop(struct fsn_axis *axis) {
    leave(axis, GOAL_QUICK_STOP);
}

fsn_status fsn_axis_reset(struct fsn_axis *axis) {
    if (axis->state != FSN_AXIS_FAULT || axis->own.resets) {
        return FSN_E_STATE;
    }
    axis->own.resets = true;
    axis->own.started = true;
    return FSN_OK;
}

void fsn_axis_halt(struct fsn_axis *axis, bool halts) {
    if (halts == axis->halted) {
        return;
    }
    axis->halted = halts;
    if (axis->outputs.mode == FSN_AXIS_CSP) {
        axis->own.has_position = false;
        axis->enabled =
            axis->enabled && halts; /* it has moved on: continue from its current position */
    }
    axis->own.wanted_velocity = 0;
    axis->own.wanted_torque = 0;
}

fsn_status fsn_axis_set_mode(struct fsn_axis *axis, int8_t mode) {
    if (!is_open(&axis->config, mode)) {
        return FSN_E_ARG;
    }
    if (mode != axis->outputs.mode) {
        axis->outputs.mode = mode;
        axis->enabled = false;
        axis->own.followed = false;
        axis->own.mode_ns = axis->inputs.now_ns;
        fsn_axis_interrupt_job(axis);
        fsn_axis_forget_targets(axis);
    }
    return FSN_OK;
}

static bool takes(const struct fsn_axis *axis, int8_t mode) {
    return axis->enabled && !axis->halted && axis->outputs.mode == mode;
}

fsn_status fsn_axis_set_position(struct fsn_axis *axis, int32_t position) {
    if (!takes(axis, FSN_AXIS_CSP)) {
        return FSN_E_STATE;
    }
    const int64_t step = (int64_t)position - axis->outputs.position;
    if ((step < 0 ? -step : step) > (int64_t)axis->config.max_step) {
        return FSN_E_ARG;
    }
    axis->own.wanted_position = position;
    axis->own.has_position = true;
    return FSN_OK;
}

fsn_status fsn_axis_set_velocity(struct fsn_axis *axis, int32_t velocity) {
    if (!takes(axis, FSN_AXIS_CSV) && !takes(axis, FSN_AXIS_PV)) {
        return FSN_E_STATE;
    }
    const int64_t most = axis->config.max_velocity;
    if (velocity > most || velocity < -most) {
        return FSN_E_ARG;
    }
    axis->own.wanted_velocity = velocity;
    return FSN_OK;
}

fsn_status fsn_axis_set_torque(struct fsn_axis *axis, int16_t torque) {
    if (!takes(axis, FSN_AXIS_CST)) {
        return FSN_E_STATE;
    }
    const int32_t most = axis->config.max_torque;
    if (torque > most || torque < -most) {
        return FSN_E_ARG;
    }
    axis->own.wanted_torque = torque;
    return FSN_OK;
}

fsn_status fsn_axis_move(struct fsn_axis *axis, int32_t position, bool at_once) {
    if (!takes(axis, FSN_AXIS_PP)) {
        return FSN_E_STATE;
    }
    if (axis->job == FSN_AXIS_JOB_WAITING) {
        return FSN_E_BUSY;
    }
    axis->job = FSN_AXIS_JOB_WAITING;
    axis->own.wanted_position = position;
    axis->own.has_position = true;
    axis->own.at_once = at_once;
    return FSN_OK;
}

fsn_status fsn_axis_home(struct fsn_axis *axis) {
    if (!takes(axis, FSN_AXIS_HM)) {
        return FSN_E_STATE;
    }
    if (axis->job == FSN_AXIS_JOB_WAITING || axis->job == FSN_AXIS_JOB_RUNNING) {
        return FSN_E_BUSY;
    }
    axis->job = FSN_AXIS_JOB_WAITING;
    axis->own.at_once = false;
    return FSN_OK;
}

/* -- words ------------------------------------------------------------------------------------- */

const char *fsn_axis_state_name(uint32_t state) {
    static const char *const names[] = {"not ready to switch on",
                                        "switch on disabled",
                                        "ready to switch on",
                                        "switched on",
                                        "operation enabled",
                                        "quick stop active",
                                        "fault reaction active",
                                        "fault",
                                        "no state"};
    return state < sizeof names / sizeof names[0] ? names[state] : "?";
}

const char *fsn_axis_phase_name(uint32_t phase) {
    static const char *const names[] = {
        "off",        "enabling", "enabled",   "stopping",  "stopped by the drive",
        "torque off", "faulted",  "resetting", "no answer", "bad statusword"};
    return phase < sizeof names / sizeof names[0] ? names[phase] : "?";
}

const char *fsn_axis_mode_name(int32_t mode) {
    static const char *const names[] = {
        [FSN_AXIS_PP] = "pp",   [FSN_AXIS_PV] = "pv",   [FSN_AXIS_HM] = "hm",
        [FSN_AXIS_CSP] = "csp", [FSN_AXIS_CSV] = "csv", [FSN_AXIS_CST] = "cst"};
    const bool known = mode >= 0 && (size_t)mode < sizeof names / sizeof names[0];
    return known && names[mode] != NULL ? names[mode] : "?";
}
