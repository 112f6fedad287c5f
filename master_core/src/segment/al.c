/** AL state machine of an emulated SubDevice. */
#include "segment/esc.h"

static void set_state(struct esc *esc, uint8_t state, uint16_t code) {
    fsn_put16(esc->memory + REG_AL_STATUS, state);
    fsn_put16(esc->memory + REG_AL_CODE, code);
}

void esc_al_error(struct esc *esc, uint8_t state, uint16_t code) {
    set_state(esc, (uint8_t)(state | AL_ERROR), code);
}

/** Returns the code with which a request is refused, or 0 if it is granted. */
static uint16_t refusal(const struct esc *esc, uint8_t from, uint8_t to) {
    if (to == AL_BOOT) {
        return AL_CODE_NO_BOOT;
    }
    if (to != AL_INIT && to != AL_PREOP && to != AL_SAFEOP && to != AL_OP) {
        return AL_CODE_UNKNOWN_STATE;
    }
    if (to <= from) {
        return 0; /* lower states are always allowed */
    }
    /* States are 1, 2, 4 and 8: twice the current one is the next. */
    if (to > 2 * from) {
        return AL_CODE_INVALID_TRANSITION; /* a state was skipped: 1, 2, 4, 8 */
    }
    if (to == AL_PREOP && esc->has_mailbox && !esc_sm_mailbox_ok(esc)) {
        return AL_CODE_MAILBOX;
    }
    /* Outputs before inputs, which decides about the code if both are wrong. */
    if (to == AL_SAFEOP && !esc_sm_process_data_ok(esc, true)) {
        return AL_CODE_OUTPUTS;
    }
    if (to == AL_SAFEOP && !esc_sm_process_data_ok(esc, false)) {
        return AL_CODE_INPUTS;
    }
    return 0;
}

void esc_al_control(struct esc *esc) {
    if (esc->faults.al_delay_ns > 0) {
        esc->al_pending = true;
        esc->al_due_ns = esc->now_ns + esc->faults.al_delay_ns;
        return;
    }
    esc_al_decide(esc);
}

void esc_al_decide(struct esc *esc) {
    esc->al_pending = false;
    const uint8_t request = esc->memory[REG_AL_CONTROL];
    const uint8_t from = esc_state(esc);
    const uint8_t to = request & 0x0F;
    const bool error = (esc->memory[REG_AL_STATUS] & AL_ERROR) != 0;
    if (error && (request & AL_ERROR) == 0 && to != AL_INIT) {
        return; /* an error must be acknowledged first */
    }
    uint16_t code = refusal(esc, from, to);
    if (code == 0 && to == AL_OP && from < to) {
        code = esc_clock_fault(esc);
    }
    if (code != 0) {
        esc_al_error(esc, from, code);
        return;
    }
    if (to == AL_INIT || to == AL_PREOP) {
        esc->outputs_seen = false;
    }
    if (to == AL_INIT) {
        esc->answer_bytes = 0;
        esc->transfer = (struct transfer){0};
    }
    if (to == AL_OP) {
        esc->outputs_ns = esc->now_ns; /* the watchdog starts here */
        esc->memory[REG_WD_STATUS] = 1;
    }
    set_state(esc, to, 0);
}
