/** Plans with one thing broken. */
#ifndef FSN_TEST_BROKEN_H
#define FSN_TEST_BROKEN_H

#include <string.h>

#include "builder.h"
#include "fsn/fsn.h"
#include "plan/plan_internal.h"

static inline size_t section_at(const uint8_t *bytes, uint32_t section) {
    return fsn_get32(bytes + 32 + 16 * (section - 1) + 4);
}

static inline fsn_status load(const uint8_t *bytes, size_t len, struct fsn_fault *fault) {
    struct fsn_plan *plan = NULL;
    const fsn_status status = fsn_plan_load(bytes, len, &plan, fault);
    CHECK((status == FSN_OK) == (plan != NULL));
    fsn_plan_free(plan);
    return status;
}

/** One broken rule: position, written bytes, expected fault. */
struct broken {
    uint32_t section, record, field, bytes, value;
    fsn_status status;
    const char *says; /**< the whole fault; NULL: not looked at */
};

/** A fault in one line: code, position, rule. */
static inline const char *line_of(const struct fsn_fault *fault, const uint8_t *bytes) {
    static char line[256];
    uint32_t at = fault->byte;
    if (fault->section != 0) {
        at -= (uint32_t)section_at(bytes, fault->section);
        at -= fault->copy_index == FSN_FAULT_NO_RECORD
                  ? 0
                  : fault->copy_index * fsn_record_bytes[fault->section];
    }
    snprintf(line, sizeof line, "%s %s %d+%u: %s", fsn_status_name(fault->status) + 6,
             fsn_section_name(fault->section), (int)fault->copy_index, at, fault->rule);
    return line;
}

static inline fsn_status break_rule(uint8_t *bytes, size_t len, const struct broken *rule) {
    uint8_t *field = bytes + section_at(bytes, rule->section) +
                     rule->record * fsn_record_bytes[rule->section] + rule->field;
    for (uint32_t b = 0; b < rule->bytes; b++) {
        field[b] = (uint8_t)(rule->value >> (8 * b));
    }
    build_fix_crc(bytes, len);
    struct fsn_fault fault;
    const fsn_status status = load(bytes, len, &fault);
    CHECK(status == FSN_OK || fault.status == status);
    if (rule->says != NULL) {
        const char *said = status == FSN_OK ? "OK" : line_of(&fault, bytes);
        if (strcmp(said, rule->says) != 0) {
            fprintf(stderr, "said     %s\nexpected %s\n", said, rule->says);
        }
        CHECK(strcmp(said, rule->says) == 0);
    }
    return status;
}

#endif
