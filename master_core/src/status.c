#include "fsn/status.h"

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

const char *fsn_found_text(uint8_t found) {
    static const char *const texts[] = {
#define FSN_FOUND_TEXT(name, value, text) [value] = (text),
        FSN_FOUND_TABLE(FSN_FOUND_TEXT)
#undef FSN_FOUND_TEXT
    };
    return found < sizeof texts / sizeof texts[0] ? texts[found] : "?";
}

const char *fsn_section_name(uint32_t section) {
    static const char *const names[] = {"header", "SubDevice",  "sync manager", "PDO",
                                        "entry",  "SDO",        "symbol",       "FSoE block",
                                        "copy",   "connection", "strings"};
    return section < sizeof names / sizeof names[0] ? names[section] : "?";
}
