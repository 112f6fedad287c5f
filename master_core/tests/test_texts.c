/** Every text that the library has for a number, as in texts.txt; test_texts --write prints the
 *  file again. */
#include <string.h>

#include "builder.h"
#include "fsn/acyclic.h"
#include "fsn/fsn.h"

static char texts[65536];

static void add(const char *kind, unsigned number, const char *text) {
    const size_t used = strlen(texts);
    CHECK(used + strlen(text) + 40 < sizeof texts);
    snprintf(texts + used, sizeof texts - used, "%s %x %s\n", kind, number, text);
}

/** Property of a number that none of its neighbours need have. */
static void add_all(const char *kind, unsigned from, unsigned to, const char *(*text_of)(unsigned),
                    const char *none) {
    for (unsigned number = from; number <= to; number++) {
        const char *text = text_of(number);
        if (strcmp(text, none) != 0) {
            add(kind, number, text);
        }
    }
}

static const char *status_name(unsigned number) {
    return fsn_status_name((fsn_status) - (int)number);
}

static const char *status_text(unsigned number) {
    return fsn_status_text((fsn_status) - (int)number);
}

static const char *next_step(unsigned number) {
    return fsn_status_next_step((fsn_status) - (int)number);
}

static const char *al_code(unsigned number) {
    return fsn_al_code_text((uint16_t)number);
}

static const char *found(unsigned number) {
    return fsn_found_text((uint8_t)number);
}

static const char *abort_code(unsigned number) {
    return fsn_abort_text(number);
}

static const char *fingerprint_section(unsigned number) {
    return fsn_fingerprint_section(number);
}

static const char *section(unsigned number) {
    return fsn_section_name(number);
}

static void collect(void) {
    static const char none[] = "not a code of ETG.1000.6";
    add_all("status", 0, 500, status_name, "FSN_E_?");
    add_all("text", 0, 500, status_text, "unknown status");
    add_all("next", 0, 500, next_step, "fsoe-net plan NETWORK -o PLAN makes the plan again");
    add_all("al", 0, 0x8000, al_code, none);
    add_all("found", 0, 255, found, "?");
    add_all("abort", 0, 0xFFFF, abort_code, none);
    add_all("abort", 0x05030000, 0x0504FFFF, abort_code, none);
    add_all("abort", 0x06010000, 0x060AFFFF, abort_code, none);
    add_all("abort", 0x08000000, 0x0800FFFF, abort_code, none);
    add_all("section", 0, 255, section, "?");
    add_all("fingerprint", 0, 255, fingerprint_section, "?");
}

int main(int argc, char **argv) {
    static char expected[sizeof texts];
    collect();
    if (argc > 1 && strcmp(argv[1], "--write") == 0) {
        fputs(texts, stdout);
        return 0;
    }
    FILE *file = fopen(FSN_TEST_FOLDER "/texts.txt", "r");
    CHECK(file != NULL);
    expected[fread(expected, 1, sizeof expected - 1, file)] = 0;
    fclose(file);
    size_t same = 0;
    while (texts[same] != 0 && texts[same] == expected[same]) {
        same++;
    }
    if (strcmp(texts, expected) != 0) {
        fprintf(stderr, "differs at %.60s\nexpected   %.60s\n", texts + same, expected + same);
        return 1;
    }
    return 0;
}
