#include "live/fsoe_objects.h"

#include "plan/plan_internal.h"

enum {
    MODULE = 0x0FF0, /**< bits of an index that number the module */
    DRIVE_FROM_SUB = 0x6760,
    DRIVE_TO_SUB = 0x6770,
    DRIVE_PARAMETERS = 0x6791,
};

uint16_t fsn_parameter_object(uint16_t command_index) {
    if (command_index == DRIVE_FROM_SUB || command_index == DRIVE_TO_SUB) {
        return DRIVE_PARAMETERS;
    }
    switch (command_index & ~MODULE) {
    case 0x6000:
    case 0x7000:
        return (uint16_t)(0x9001 | (command_index & MODULE));
    default:
        break;
    }
    switch (command_index & ~0xF0) {
    case 0xE600:
    case 0xE700:
        return (uint16_t)(FSN_CONNECTIONS | (command_index & 0xF0));
    default:
        return 0;
    }
}

uint16_t fsn_diagnosis_object(uint16_t parameter_index) {
    if ((parameter_index & ~MODULE) == 0x9001) {
        return (uint16_t)(0xA000 | (parameter_index & MODULE));
    }
    if ((parameter_index & ~0xF0) == FSN_CONNECTIONS) {
        return (uint16_t)(0xEA00 | (parameter_index & 0xF0));
    }
    return 0;
}

uint16_t fsn_object_at(const struct fsn_plan *plan, uint32_t sm, uint32_t bit) {
    uint32_t behind;
    for (uint32_t e = fsn_sm_entries(plan, sm, &behind); e < behind; e++) {
        const struct fsn_entry_record entry = fsn_read_entry(plan, e);
        if (entry.bit_offset == bit && entry.index != 0) {
            return entry.index;
        }
    }
    return 0;
}
