#include "fsn/status.h"

#include <stddef.h>

#include "fsn/bus.h"

#include "fsn/version.h"

const char *fsn_version(void) {
    return FSN_VERSION_STRING;
}

const char *fsn_status_name(fsn_status status) {
    switch (status) {
#define FSN_STATUS_NAME(name, value, text)                                                         \
    case FSN_##name:                                                                               \
        return "FSN_" #name;
        FSN_STATUS_TABLE(FSN_STATUS_NAME)
#undef FSN_STATUS_NAME
    }
    return "FSN_E_?";
}

const char *fsn_status_text(fsn_status status) {
    switch (status) {
#define FSN_STATUS_TEXT(name, value, text)                                                         \
    case FSN_##name:                                                                               \
        return text;
        FSN_STATUS_TABLE(FSN_STATUS_TEXT)
#undef FSN_STATUS_TEXT
    }
    return "unknown status";
}

const char *fsn_status_next_step(fsn_status status) {
    static const char compare[] =
        "compare the bus with the network file; fsoe-net plan makes a new plan";
    static const struct {
        fsn_status status;
        const char *text;
    } steps[] = {
        {FSN_OK, ""},
        {FSN_E_ARG, "an error in the calling program: see the contract of the function"},
        {FSN_E_SPACE, "an error in the calling program: see the contract of the function"},
        {FSN_E_STATE, "bring the bus into the required state, then try again"},
        {FSN_E_BUSY, "try again"},
        {FSN_E_CLOSED, "write only what the console's list shows as an output"},
        {FSN_E_ABSENT,
         "use a build that has it; fsn-master --version lists the contents of this one"},
        {FSN_E_BUS_BUSY, "stop the other MainDevice first"},
        {FSN_E_BUS_SILENT,
         "secure the machine, then check cable, power and --interface; --wait 30s retries"},
        {FSN_E_BUS_MISSING, "secure the machine, then check cable and power after the last "
                            "SubDevice found; --wait 30s retries"},
        {FSN_E_BUS_IDENTITY, compare},
        {FSN_E_BUS_MAPPING, compare},
        {FSN_E_BUS_ADDRESS, compare},
        {FSN_E_BUS_SDO, "compare the start-up SDOs of this device with its manual"},
        {FSN_E_BUS_MAILBOX, "--wait 30s retries; if it persists, check its AL state, its error "
                            "counters, and whether replies are late"},
        {FSN_E_BUS_STATE, "its AL status code gives the reason"},
        {FSN_E_BUS_CLOCK, "compare assign_activate in the device file with the device"},
        {FSN_E_NOMEM, "free memory, or allow the process more"},
        {FSN_E_SYS, "see the system's own message"},
    };
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        if (steps[i].status == status) {
            return steps[i].text;
        }
    }
    return "fsoe-net plan NETWORK -o PLAN makes the plan again";
}

const char *fsn_found_text(uint8_t found) {
    static const char *const texts[] = {
#define FSN_FOUND_TEXT(name, value, text) [value] = (text),
        FSN_FOUND_TABLE(FSN_FOUND_TEXT)
#undef FSN_FOUND_TEXT
    };
    return found < sizeof texts / sizeof texts[0] ? texts[found] : "?";
}

const char *fsn_ring_text(uint8_t ring) {
    static const char *const texts[] = {
#define FSN_RING_TEXT(name, value, text) [value] = (text),
        FSN_RING_TABLE(FSN_RING_TEXT)
#undef FSN_RING_TEXT
    };
    return ring < sizeof texts / sizeof texts[0] ? texts[ring] : "?";
}

const char *fsn_clocks_text(uint8_t clocks) {
    static const char *const texts[] = {
#define FSN_CLOCKS_TEXT(name, value, text) [value] = (text),
        FSN_CLOCKS_TABLE(FSN_CLOCKS_TEXT)
#undef FSN_CLOCKS_TEXT
    };
    return clocks < sizeof texts / sizeof texts[0] ? texts[clocks] : "?";
}

const char *fsn_al_code_text(uint16_t code) {
    static const struct {
        uint16_t code;
        const char *text;
    } codes[] = {
        {0x0000, "no error is named"},
        {0x0001, "unspecified error"},
        {0x0002, "no memory"},
        {0x0011, "invalid state change"},
        {0x0012, "unknown state"},
        {0x0013, "boot state not supported"},
        {0x0014, "no valid firmware"},
        {0x0015, "mailbox set up wrongly for boot"},
        {0x0016, "mailbox set up wrongly"},
        {0x0017, "sync managers set up wrongly"},
        {0x0018, "no valid inputs"},
        {0x0019, "no valid outputs"},
        {0x001A, "synchronisation error"},
        {0x001B, "sync manager watchdog: no outputs came in time"},
        {0x001C, "invalid sync manager types"},
        {0x001D, "outputs have another length or place than it expects"},
        {0x001E, "inputs have another length or place than it expects"},
        {0x001F, "invalid watchdog settings"},
        {0x0020, "needs a cold start"},
        {0x0021, "needs INIT first"},
        {0x0022, "needs PREOP first"},
        {0x0023, "needs SAFEOP first"},
        {0x0024, "invalid input mapping"},
        {0x0025, "invalid output mapping"},
        {0x0026, "inconsistent settings"},
        {0x0027, "free run not supported"},
        {0x0028, "synchronous mode not supported"},
        {0x0029, "free run needs three buffers"},
        {0x002A, "background watchdog"},
        {0x002B, "no valid inputs and outputs"},
        {0x002C, "fatal synchronisation error"},
        {0x002D, "no synchronisation signal"},
        {0x0030, "invalid DC SYNC settings"},
        {0x0032, "DC: the phase-locked loop failed"},
        {0x0033, "DC: inputs and outputs are not in time with SYNC0"},
        {0x0034, "DC: SYNC0 came too late"},
        {0x0035, "invalid DC cycle time"},
        {0x0036, "invalid DC cycle time of SYNC0"},
        {0x0037, "invalid DC cycle time of SYNC1"},
        {0x0050, "EEPROM not accessible"},
        {0x0051, "EEPROM error"},
        {0x0060, "restarted by itself"},
        {0x0061, "another device identification than configured"},
        {0x00F0, "application controller available"},
    };
    for (size_t i = 0; i < sizeof codes / sizeof codes[0]; i++) {
        if (codes[i].code == code) {
            return codes[i].text;
        }
    }
    return code >= 0x8000 ? "a vendor-specific error, see its manual" : "not a code of ETG.1000.6";
}

const char *fsn_section_name(uint32_t section) {
    static const char *const names[] = {"header", "SubDevice",  "sync manager", "PDO",
                                        "entry",  "SDO",        "symbol",       "FSoE block",
                                        "copy",   "connection", "strings",      "safety functions",
                                        "bus"};
    return section < sizeof names / sizeof names[0] ? names[section] : "?";
}
