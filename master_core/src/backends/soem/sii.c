/** Sync managers in an SII, and the start of its categories. */
#include "backends/soem/soem.h"

#ifdef FSN_SOEM_FROM_SOURCE

enum {
    CATEGORIES = 0x80,
    END = 0xFFFF,
    MOST_EMPTY = 16 /**< consecutive categories with neither type nor length */
};

static uint16_t word_at(ecx_contextt *context, uint16_t slave, uint32_t at) {
    const uint8_t low = ecx_siigetbyte(context, slave, (uint16)at);
    return (uint16_t)(low | ecx_siigetbyte(context, slave, (uint16)(at + 1)) << 8);
}

/** SOEM's own search returns to an earlier position if a length makes its 16 bits wrap, and then
 *  never ends: one damaged answer is sufficient. If SOEM is built from source, this function
 *  replaces it (weak.h) for all SII reads of SOEM. Values that could not be read are zeros: a
 *  SubDevice that does not receive its address causes a timeout for each of them, which adds up to
 *  minutes. */
int16 ecx_siifind(ecx_contextt *context, uint16 slave, uint16 cat) {
    const bool was_of_device = context->slavelist[slave].eep_pdi != 0;
    int16 found = 0;
    int empty = 0;
    for (uint32_t at = CATEGORIES; at + 4 <= EC_MAXEEPBUF && found == 0 && empty < MOST_EMPTY;) {
        const uint16_t type = word_at(context, slave, at);
        if (type == cat) {
            found = (int16)(at + 2); /* position of its length */
        } else if (type == END) {
            break;
        }
        const uint16_t words = word_at(context, slave, at + 2);
        empty = type == 0 && words == 0 ? empty + 1 : 0;
        at += 4 + 2u * words;
    }
    if (was_of_device) {
        ecx_eeprom2pdi(context, slave);
    }
    return found;
}

#endif

uint16_t soem_sii_start(struct fsn_soem *bus, uint16_t slave, uint8_t number) {
    ec_slavet *s = &bus->slaves[slave];
    if (number < EC_MAXSM && s->SM[number].StartAddr == 0) {
        ec_eepromSMt sm = {0};
        soem_drain(bus);
        bus->context.esislave = 0; /* earlier data are no longer valid */
        if (ecx_siiSM(&bus->context, slave, &sm) > 0) {
            for (uint16 n = 0; n < sm.nSM && n < EC_MAXSM; n++) {
                if (n > 0 && ecx_siiSMnext(&bus->context, slave, &sm, n) == 0) {
                    break;
                }
                s->SM[n].StartAddr = htoes(sm.PhStart);
                s->SM[n].SMflags = htoel((uint32)sm.Creg | (uint32)sm.Activate << 16);
            }
        }
    }
    return number < EC_MAXSM ? etohs(s->SM[number].StartAddr) : 0;
}
