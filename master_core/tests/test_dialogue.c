/** A MainDevice's talk with the emulated segment, datagram by datagram, with the whole answers. It
 *  stands in dialogue.txt: lines behind '>' ask, the line below is the answer.
 *      > dg COMMAND ADP ADO SIZE [HEX]   a datagram; numbers in hex, the command in decimal
 *      > mb HEX                          into the mailbox of station 1001, and what lies in the
 * other > sdo HEX                         an SDO request in a mailbox message > sii POSITION the
 * SII through its registers, 64 words > ms NUMBER                       time passes test_dialogue
 * --write prints the file anew, to be read before it is kept. */
#include <string.h>

#include "segment_rig.h"

enum { MAILBOX = 128 };

static struct rig rig;
static char said[4096];

static void say_hex(const uint8_t *bytes, size_t len) {
    char *at = said + strlen(said);
    for (size_t i = 0; i < len; i++, at += 2) {
        snprintf(at, 3, "%02x", bytes[i]);
    }
}

static size_t from_hex(const char *hex, uint8_t *bytes, size_t room) {
    size_t len = 0;
    unsigned byte;
    while (sscanf(hex, " %2x", &byte) == 1 && hex[strspn(hex, " ")] != 0) {
        CHECK(len < room);
        bytes[len++] = (uint8_t)byte;
        hex += strspn(hex, " ") + 2;
    }
    return len;
}

static void say_datagram(const char *rest) {
    unsigned command, adp, ado, size;
    int used = 0;
    uint8_t data[256] = {0};
    CHECK(sscanf(rest, "%u %x %x %x%n", &command, &adp, &ado, &size, &used) == 4 && size <= 256);
    (void)from_hex(rest + used, data, sizeof data);
    const int counter =
        datagram(&rig, (uint8_t)command, (uint16_t)adp, (uint16_t)ado, data, (uint16_t)size);
    snprintf(said, sizeof said, "%d:", counter);
    say_hex(rig.data, counter >= 0 ? size : 0);
}

/** What the other mailbox holds, as long as its header says. */
static void say_answer(void) {
    const int counter = datagram(&rig, FPRD, 1001, 0x1080, NULL, MAILBOX);
    if (counter != 1) {
        snprintf(said, sizeof said, "none");
        return;
    }
    const size_t len = 6u + rig.data[0] + 256u * rig.data[1];
    CHECK(len <= MAILBOX);
    say_hex(rig.data, len);
}

static void say_mailbox(const char *hex, bool sdo_only) {
    uint8_t message[MAILBOX] = {0};
    const size_t from = sdo_only ? 8 : 0;
    const size_t len = from_hex(hex, message + from, sizeof message - from);
    if (sdo_only) {
        message[0] = (uint8_t)(2 + len);
        message[5] = 0x13;
        message[7] = 0x20;
    }
    CHECK(datagram(&rig, FPWR, 1001, 0x1000, message, MAILBOX) == 1);
    say_answer();
}

static void say_sii(const char *rest) {
    unsigned position;
    CHECK(sscanf(rest, "%u", &position) == 1);
    const uint16_t adp = (uint16_t)(0u - position);
    for (unsigned word = 0; word < 128; word += 4) {
        const uint8_t read[6] = {0, 1, (uint8_t)word, 0, 0, 0};
        CHECK(datagram(&rig, APWR, adp, 0x0502, read, 6) == 1);
        CHECK(datagram(&rig, APRD, adp, 0x0508, NULL, 8) == 1);
        say_hex(rig.data, 8);
    }
}

static const char *answer_to(const char *line) {
    unsigned number;
    said[0] = 0;
    if (strncmp(line, "dg ", 3) == 0) {
        say_datagram(line + 3);
    } else if (strncmp(line, "mb", 2) == 0) {
        say_mailbox(line + 2, false);
    } else if (strncmp(line, "sdo ", 4) == 0) {
        say_mailbox(line + 4, true);
    } else if (strncmp(line, "sii ", 4) == 0) {
        say_sii(line + 4);
    } else {
        CHECK(sscanf(line, "ms %u", &number) == 1);
        rig.now_ns += number * UINT64_C(1000000);
    }
    return said;
}

/** The plan with a start-up SDO of 4 bytes at the second SubDevice; its stations are swapped, so
 *  that 1001 is the one with the objects. */
static void begin(void) {
    size_t len;
    rig = (struct rig){.bytes = build_full(&len)};
    CHECK(fsn_plan_load(rig.bytes, len, &rig.plan, NULL) == FSN_OK);
    CHECK(fsn_segment_create(rig.plan, &rig.segment) == FSN_OK);
    CHECK(write16(&rig, APWR, 0xFFFF, 0x0010, 1001) == 1);
    CHECK(write16(&rig, APWR, 0, 0x0010, 1002) == 1);
    CHECK(fsn_segment_set_object(rig.segment, 1, 0x2000, 1,
                                 "a long text for segments: 0123456789 "
                                 "0123456789 0123456789 0123456789 0123456789 0123456789 0123456789"
                                 " 0123456789 0123456789",
                                 124) == FSN_OK);
    CHECK(fsn_segment_set_object(rig.segment, 1, 0x2001, 0, "\2", 1) == FSN_OK);
    CHECK(fsn_segment_set_object(rig.segment, 1, 0x2001, 1, "\x34\x12", 2) == FSN_OK);
    CHECK(fsn_segment_set_object(rig.segment, 1, 0x2001, 2, "\x78\x56\x34\x12", 4) == FSN_OK);
    CHECK(fsn_segment_set_object(rig.segment, 1, 0x2003, 0,
                                 "the last segment of this one has three bytes: 0123456789 "
                                 "0123456789 0123456789 0123456789 0123456789 0123456789 01",
                                 115) == FSN_OK);
    to_preop(&rig, 1001);
}

int main(int argc, char **argv) {
    static char line[4096], expected[4096];
    const bool writes = argc > 1 && strcmp(argv[1], "--write") == 0;
    FILE *file = fopen(FSN_TEST_FOLDER "/dialogue.txt", "r");
    CHECK(file != NULL && fgets(line, sizeof line, file) != NULL);
    begin();
    bool more = true;
    unsigned requests = 0;
    while (more) {
        char question[1024];
        CHECK(strncmp(line, "> ", 2) == 0);
        snprintf(question, sizeof question, "%.*s", (int)strcspn(line, "\n"), line);
        expected[0] = 0;
        more = fgets(line, sizeof line, file) != NULL;
        if (more && line[0] != '>') {
            snprintf(expected, sizeof expected, "%.*s", (int)strcspn(line, "\n"), line);
            more = fgets(line, sizeof line, file) != NULL;
        }
        const char *answer = answer_to(question + 2);
        requests++;
        if (writes) {
            printf("%s\n%s%s", question, answer, answer[0] != 0 ? "\n" : "");
        } else if (strcmp(answer, expected) != 0) {
            fprintf(stderr, "%s\nsaid     %s\nexpected %s\n", question, answer, expected);
            return 1;
        }
    }
    fclose(file);
    CHECK(requests > 50);
    tear_down(&rig);
    return 0;
}
