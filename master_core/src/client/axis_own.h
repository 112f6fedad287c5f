/** Data shared by the two files of an axis: requests on one side, the step on the other. */
#ifndef FSN_AXIS_OWN_H
#define FSN_AXIS_OWN_H

#include "fsn/axis.h"

/** Requests of the program. */
enum goal { GOAL_OFF, GOAL_ON, GOAL_QUICK_STOP };

/** Statusword in addition to the state. */
enum status {
    VOLTAGE = 1 << 4,
    REMOTE = 1 << 9,
    REACHED = 1 << 10,
    LIMITED = 1 << 11,
    FOLLOWS = 1 << 12, /* CSP, CSV, CST: the target is followed; PP: acknowledge; HM: attained */
    HOMING_ERROR = 1 << 13,
};

static inline bool fsn_axis_is_cyclic(int8_t mode) {
    return mode == FSN_AXIS_CSP || mode == FSN_AXIS_CSV || mode == FSN_AXIS_CST;
}

static inline bool fsn_axis_mode_is_confirmed(const struct fsn_axis *axis) {
    return axis->inputs.mode == axis->outputs.mode;
}

/** Bits that are 1 while the drive follows its command, if it has set them before. */
static inline uint16_t fsn_axis_watched_bits(const struct fsn_axis *axis) {
    const bool follows =
        fsn_axis_is_cyclic(axis->outputs.mode) && fsn_axis_mode_is_confirmed(axis) && !axis->halted;
    return (uint16_t)(VOLTAGE | REMOTE | (follows ? FOLLOWS : 0));
}

/** Ends a running set-point or homing without a result. */
static inline void fsn_axis_interrupt_job(struct fsn_axis *axis) {
    axis->own.start = false;
    if (axis->job == FSN_AXIS_JOB_WAITING || axis->job == FSN_AXIS_JOB_RUNNING) {
        axis->job = FSN_AXIS_JOB_FAILED;
    }
}

static inline void fsn_axis_forget_targets(struct fsn_axis *axis) {
    axis->own.has_position = false;
    axis->own.wanted_velocity = 0;
    axis->own.wanted_torque = 0;
}

#endif
