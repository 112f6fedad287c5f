/** Diagnosis messages, object 0x10F3. */
#ifndef FSN_CONTROL_HISTORY_H
#define FSN_CONTROL_HISTORY_H

#include "control/base/json.h"

/** Decodes a message of 0x10F3; false if it is invalid. */
bool fsn_history_message(const uint8_t *bytes, uint32_t size_bytes, uint32_t id,
                         struct fsn_json *json);

#endif
