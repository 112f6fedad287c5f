#include "control/base/names.h"

#include <stdio.h>

#include "fsn/bus.h"
#include "fsn/fsoe.h"
#include "fsn/monitor.h"

const char *fsn_log_level_name(enum fsn_log_level level) {
    static const char *const name[] = {"detail", "info", "warning", "error"};
    return name[level];
}

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

const char *fsn_program_state_name(enum fsn_program_state state) {
    static const char *const names[] = {
        [FSN_PROGRAM_STOPPED] = "stopped",   [FSN_PROGRAM_OPENING] = "opening",
        [FSN_PROGRAM_STARTING] = "starting", [FSN_PROGRAM_RUNNING] = "running",
        [FSN_PROGRAM_STOPPING] = "stopping", [FSN_PROGRAM_FAILED] = "failed",
        [FSN_PROGRAM_STANDBY] = "standby",
    };
    return names[state];
}

const char *fsn_command_name(uint8_t command) {
    static const char *const name[UINT8_MAX + 1] = {
        [0] = "none",
        [FSN_CMD_RESET] = "Reset",
        [FSN_CMD_SESSION] = "Session",
        [FSN_CMD_CONNECTION] = "Connection",
        [FSN_CMD_PARAMETER] = "Parameter",
        [FSN_CMD_PROCESS_DATA] = "ProcessData",
        [FSN_CMD_FAILSAFE_DATA] = "FailSafeData",
    };
    return name[command] != NULL ? name[command] : "unknown";
}

const char *fsn_al_text(uint8_t al_status, char room[24]) {
    static const char *const states[16] = {
        [FSN_AL_NONE] = "none", [FSN_AL_INIT] = "INIT",     [FSN_AL_PREOP] = "PREOP",
        [FSN_AL_BOOT] = "BOOT", [FSN_AL_SAFEOP] = "SAFEOP", [FSN_AL_OP] = "OP"};
    const char *state = states[al_status & 0x0F];
    snprintf(room, 24, "%s%s", state != NULL ? state : "unknown",
             (al_status & FSN_AL_ERROR) != 0 ? "+ERROR" : "");
    return room;
}
