/** The SII interface: commands at 0x0502 read and write the EEPROM of an emulated SubDevice. */
#include "segment/esc.h"

#include <string.h>

enum {
    COMMAND_MASK = 0x07,
    COMMAND_READ = 1,
    COMMAND_WRITE = 2,
    COMMAND_RELOAD = 4,
    ERROR_COMMAND = 0x20,
    ERROR_MASK = 0x78,
    ALIAS = 8, /**< byte */
    CHECKSUM = 14,
};

/** One byte of the EEPROM; beyond its end it reads as erased, which ends the categories. */
static uint8_t sii_byte(const struct esc *esc, uint64_t at) {
    return at < esc->sii_bytes ? esc->sii[at] : 0xFF;
}

/** Only the alias and the checksum of its block can be written; used after the next power-on. */
static bool write_alias(struct esc *esc) {
    const uint64_t at = 2 * (uint64_t)fsn_get32(esc->memory + REG_SII_ADDRESS);
    if (at != ALIAS && at != CHECKSUM) {
        return false;
    }
    memcpy(esc->sii + at, esc->memory + REG_SII_DATA, 2);
    return true;
}

void esc_sii_command(struct esc *esc) {
    uint8_t *control = esc->memory + REG_SII_CONTROL;
    const uint8_t command = control[1] & COMMAND_MASK;
    /* Commands complete immediately and clear themselves: MainDevices wait until these bits are
     * 0. */
    control[1] &= (uint8_t)~(COMMAND_MASK | ERROR_MASK | 0x80);
    control[0] |= 0x40; /* 8 bytes per read */
    if (command == COMMAND_READ) {
        const uint64_t word = fsn_get32(esc->memory + REG_SII_ADDRESS);
        for (unsigned i = 0; i < 8; i++) {
            esc->memory[REG_SII_DATA + i] = sii_byte(esc, 2 * word + i);
        }
    } else if (command == COMMAND_RELOAD) {
        memcpy(esc->memory + REG_ALIAS, esc->sii + 8, 2);
    } else if (command == COMMAND_WRITE && write_alias(esc)) {
        return;
    } else if (command != 0) {
        control[1] |= ERROR_COMMAND; /* its EEPROM comes from the network file: not written */
    }
}
