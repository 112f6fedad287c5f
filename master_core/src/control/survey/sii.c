/** Categories of an SII; every length in it is checked. */
#include <string.h>

#include "control/survey/member.h"
#include "plan/plan_internal.h"

enum { CATEGORIES = 0x80, END = 0xFFFF, STRINGS = 10, GENERAL = 30, INPUTS = 50, OUTPUTS = 51 };

const uint8_t *fsn_survey_sii_category(const struct fsn_sii *sii, uint16_t type, uint32_t *at,
                                       uint32_t *size_bytes) {
    uint32_t begin = *at < CATEGORIES ? CATEGORIES : *at;
    while (begin + 4 <= sii->size_bytes && fsn_get16(sii->bytes + begin) != END) {
        const uint8_t *category = sii->bytes + begin;
        const uint32_t size = 2u * fsn_get16(category + 2);
        begin += 4 + size;
        if (begin > sii->size_bytes) {
            break;
        }
        if (fsn_get16(category) == type) {
            *at = begin;
            *size_bytes = size;
            return category + 4;
        }
    }
    return NULL;
}

bool fsn_survey_sii_string(const struct fsn_sii *sii, unsigned number,
                           char room[FSN_NAME_BYTES * 4]) {
    uint32_t at = 0;
    uint32_t size;
    const uint8_t *strings = fsn_survey_sii_category(sii, STRINGS, &at, &size);
    if (strings == NULL || size == 0 || number == 0 || number > strings[0]) {
        return false;
    }
    uint32_t from = 1;
    for (unsigned n = 1; from < size; n++) {
        const uint32_t len = strings[from];
        if (from + 1 + len > size) {
            return false;
        }
        if (n == number) {
            memcpy(room, strings + from + 1, len); /* at most 255 */
            room[len] = 0;
            return len > 0;
        }
        from += 1 + len;
    }
    return false;
}

bool fsn_survey_sii_name(const struct fsn_sii *sii, char room[FSN_NAME_BYTES * 4]) {
    uint32_t at = 0;
    uint32_t size;
    const uint8_t *general = fsn_survey_sii_category(sii, GENERAL, &at, &size);
    /* The name as ordered, or the longer one if there is none. */
    return general != NULL && size >= 4 &&
           (fsn_survey_sii_string(sii, general[3], room) ||
            fsn_survey_sii_string(sii, general[2], room));
}

bool fsn_survey_sii_pdo(const struct fsn_sii *sii, bool outputs, uint32_t *at, uint32_t *inside,
                        struct fsn_sii_pdo *pdo) {
    for (;;) {
        uint32_t next = *at;
        uint32_t size;
        const uint8_t *category =
            fsn_survey_sii_category(sii, outputs ? OUTPUTS : INPUTS, &next, &size);
        if (category == NULL) {
            return false;
        }
        if (*inside + 8 > size) { /* on to the next category */
            *at = next;
            *inside = 0;
            continue;
        }
        const uint8_t *p = category + *inside;
        *pdo = (struct fsn_sii_pdo){
            .index = fsn_get16(p), .entries = p[2], .sm = p[3], .name = p[5], .entry = p + 8};
        *inside += 8 + 8u * p[2];
        if (*inside > size) {
            *inside = size; /* longer than the data */
            continue;
        }
        return true;
    }
}
