/** Words for numbers, for people who read replies and logs. */
#ifndef FSN_CONTROL_NAMES_H
#define FSN_CONTROL_NAMES_H

#include <stdbool.h>
#include <stdint.h>

const char *fsn_outside_text(uint32_t outside);
bool fsn_outside_is_data(uint32_t outside);
const char *fsn_reset_text(uint8_t code);
const char *fsn_command_name(uint8_t command);

/** "OP", "SAFEOP+ERROR"; into `room`, which it returns. */
const char *fsn_al_text(uint8_t al_status, char room[24]);

#endif
