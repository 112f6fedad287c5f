#include "control/base/names.h"

#include <stdio.h>

#include "fsn/bus.h"
#include "fsn/fsoe.h"
#include "fsn/monitor.h"

const char *fsn_observed_text(uint32_t observed) {
    static const char *const text[] = {"silent",    "reset",         "session",      "connection",
                                       "parameter", "failsafe data", "process data", "unknown"};
    return text[observed <= FSN_OBSERVED_UNKNOWN ? observed : FSN_OBSERVED_UNKNOWN];
}

bool fsn_observed_is_data(uint32_t observed) {
    return observed == FSN_OBSERVED_DATA_PROCESS || observed == FSN_OBSERVED_DATA_FAILSAFE;
}

const char *fsn_reset_text(uint8_t code) {
    static const char *const text[] = {
        "local reset or acknowledgement",
        "command not allowed in this state",
        "unknown command",
        "wrong connection ID",
        "wrong CRC",
        "watchdog expired",
        "wrong FSoE address",
        "echoed data differ",
        "wrong length of the communication parameters",
        "communication parameters (watchdog) refused",
        "wrong length of the application parameters",
        "application parameters refused",
    };
    if (code >= 0x80) {
        return "device-specific code";
    }
    return code < sizeof text / sizeof text[0] ? text[code] : "unknown code";
}

const char *fsn_command_name(uint8_t command) {
    switch (command) {
    case 0:
        return "none";
    case FSN_CMD_RESET:
        return "Reset";
    case FSN_CMD_SESSION:
        return "Session";
    case FSN_CMD_CONNECTION:
        return "Connection";
    case FSN_CMD_PARAMETER:
        return "Parameter";
    case FSN_CMD_PROCESS_DATA:
        return "ProcessData";
    case FSN_CMD_FAILSAFE_DATA:
        return "FailSafeData";
    default:
        return "unknown";
    }
}

const char *fsn_al_text(uint8_t al_status, char room[24]) {
    const char *state = "unknown";
    switch (al_status & 0x0F) {
    case FSN_AL_NONE:
        state = "none";
        break;
    case FSN_AL_INIT:
        state = "INIT";
        break;
    case FSN_AL_PREOP:
        state = "PREOP";
        break;
    case FSN_AL_BOOT:
        state = "BOOT";
        break;
    case FSN_AL_SAFEOP:
        state = "SAFEOP";
        break;
    case FSN_AL_OP:
        state = "OP";
        break;
    default:
        break;
    }
    snprintf(room, 24, "%s%s", state, (al_status & FSN_AL_ERROR) != 0 ? "+ERROR" : "");
    return room;
}
