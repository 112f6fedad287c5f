/** Words for numbers in replies and logs. */
#ifndef FSN_CONTROL_NAMES_H
#define FSN_CONTROL_NAMES_H

#include "control/base/host.h"

const char *fsn_log_level_name(enum fsn_log_level level);
const char *fsn_observed_text(uint32_t observed);
bool fsn_observed_is_data(uint32_t observed);
const char *fsn_reset_text(uint8_t code);
const char *fsn_command_name(uint8_t command);
const char *fsn_program_state_name(enum fsn_program_state state);

/** Writes "OP", "SAFEOP+ERROR" and the like into `room`, which it returns. */
const char *fsn_al_text(uint8_t al_status, char room[24]);

#endif
