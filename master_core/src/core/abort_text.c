#include "fsn/acyclic.h"

const char *fsn_abort_text(uint32_t code) {
    static const struct {
        uint32_t code;
        const char *text;
    } codes[] = {
        {0x05030000, "toggle bit not changed"},
        {0x05040000, "its own time for the transfer is over"},
        {0x05040001, "unknown command"},
        {0x05040005, "out of memory"},
        {0x06010000, "access not supported"},
        {0x06010001, "write only"},
        {0x06010002, "read only"},
        {0x06010003, "subindex 0 must be 0 to write the others"},
        {0x06010004, "no complete access to this object"},
        {0x06010005, "longer than its mailbox takes"},
        {0x06010006, "mapped to process data: not to be written"},
        {0x06020000, "no such object"},
        {0x06040041, "cannot be mapped to a PDO"},
        {0x06040042, "the PDO would be too long"},
        {0x06040043, "parameters do not go together"},
        {0x06040047, "does not fit its own state"},
        {0x06060000, "hardware fault"},
        {0x06070010, "another length"},
        {0x06070012, "too long"},
        {0x06070013, "too short"},
        {0x06090011, "no such subindex"},
        {0x06090030, "value out of range"},
        {0x06090031, "value too great"},
        {0x06090032, "value too small"},
        {0x06090033, "the list of modules is another one"},
        {0x06090036, "greatest value below the smallest"},
        {0x08000000, "general error"},
        {0x08000020, "cannot be stored"},
        {0x08000021, "local control forbids it"},
        {0x08000022, "not in this AL state"},
        {0x08000023, "no object dictionary"},
    };
    for (size_t i = 0; i < sizeof codes / sizeof codes[0]; i++) {
        if (codes[i].code == code) {
            return codes[i].text;
        }
    }
    return "not a code of ETG.1000.6";
}
