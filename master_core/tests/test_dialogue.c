/** A MainDevice's dialogue with the emulated segment, datagram by datagram, with the whole answers.
 *  It is in dialogue.txt: lines after '>' are requests, the line below is the answer.
 *
 *      > dg COMMAND ADP ADO SIZE [HEX]  a datagram; numbers in hex, the command in decimal
 *      > mb HEX                         into the mailbox of station 1001; reads the other
 *      > sdo HEX                        an SDO request in a mailbox message
 *      > sii POSITION                   the SII through its registers, 64 words
 *      > ms NUMBER                      time passes
 *      > line NUMBER                    another segment, of so many SubDevices
 *      > do WORD [NUMBER…]              a fault, see deeds[]
 *      > put PORT, > take, > wait       frames on the wire
 *      > all                            counters, and all of each SubDevice that is not 0
 *
 *  test_dialogue --write prints the file again: read it before you keep it. */
#include <string.h>

#include "heap.h"
#include "segment/segment_internal.h"
#include "segment_rig.h"

enum { MAILBOX = 128, FRAME = 29, ZEROS = 4 };

static struct rig rig;
static char said[16384];
static uint8_t frames_put;

static void say(const char *format, unsigned long long number) {
    const size_t used = strlen(said);
    snprintf(said + used, sizeof said - used, format, number);
}

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
    if (counter >= 0 && rig.adp != adp) {
        say(" adp %llx", rig.adp);
    }
    if (counter >= 0 && rig.out_port != rig.port) {
        say(" at port %llu", rig.out_port);
    }
}

/** The content of the other mailbox, as long as in its header. */
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

/* -- faults, the wire, whole states ----------------------------------------------------------- */

static fsn_status present(const unsigned *n) {
    fsn_segment_set_present(rig.segment, n[0], n[1] != 0);
    return FSN_OK;
}

static fsn_status power(const unsigned *n) {
    fsn_segment_power_cycle(rig.segment, n[0]);
    return FSN_OK;
}

static fsn_status cable(const unsigned *n) {
    return fsn_segment_set_link(rig.segment, n[0], n[1] != 0);
}

static fsn_status ring(const unsigned *n) {
    fsn_segment_set_ring(rig.segment, n[0] != 0);
    return FSN_OK;
}

static fsn_status port(const unsigned *n) {
    rig.port = n[0];
    return FSN_OK;
}

static fsn_status swap(const unsigned *n) {
    return fsn_segment_swap(rig.segment, n[0], n[1]);
}

static fsn_status errors(const unsigned *n) {
    return fsn_segment_rx_errors(rig.segment, n[0], n[1], n[2]);
}

static fsn_status lose(const unsigned *n) {
    fsn_segment_lose(rig.segment, n[0]);
    return FSN_OK;
}

static fsn_status lose_every(const unsigned *n) {
    fsn_segment_lose_every(rig.segment, n[0]);
    return FSN_OK;
}

static fsn_status delay(const unsigned *n) {
    fsn_segment_set_delay(rig.segment, n[0] * UINT64_C(1000000));
    return FSN_OK;
}

static fsn_status stall(const unsigned *n) {
    fsn_segment_stall(rig.segment, n[0] * UINT64_C(1000000));
    return FSN_OK;
}

static fsn_status repeat(const unsigned *n) {
    fsn_segment_repeat(rig.segment, n[0]);
    return FSN_OK;
}

static fsn_status al_delay(const unsigned *n) {
    return fsn_segment_set_al_delay(rig.segment, n[0], n[1] * UINT64_C(1000000));
}

static fsn_status mailbox_delay(const unsigned *n) {
    return fsn_segment_set_mailbox_delay(rig.segment, n[0], n[1] * UINT64_C(1000000));
}

static fsn_status identity(const unsigned *n) {
    const struct fsn_segment_identity other = {n[1], n[2], n[3]};
    return fsn_segment_set_identity(rig.segment, n[0], n[1] != 0 ? &other : NULL);
}

static fsn_status abort_code(const unsigned *n) {
    return fsn_segment_set_sdo_abort(rig.segment, n[0], (uint16_t)n[1], n[2], n[3]);
}

static fsn_status object(const unsigned *n) {
    uint8_t bytes[1024];
    for (unsigned i = 0; i < n[2]; i++) {
        bytes[i] = (uint8_t)(i + i / 256);
    }
    return fsn_segment_set_object(rig.segment, n[0], (uint16_t)n[1], 0, bytes, n[2]);
}

static fsn_status inputs(const unsigned *n) {
    const uint8_t bytes[] = {1, 2, 3, 4, 5, 6, 7, (uint8_t)n[1]};
    return fsn_segment_write_inputs(rig.segment, n[0], bytes, sizeof bytes);
}

static fsn_status outputs(const unsigned *n) {
    uint8_t bytes[16] = {0};
    bool fresh = false;
    const fsn_status status = fsn_segment_read_outputs(rig.segment, n[0], bytes, n[1], &fresh);
    say_hex(bytes, n[1]);
    say(fresh ? " fresh " : " old ", 0);
    return status;
}

static fsn_status idle(const unsigned *n) {
    rig.now_ns += n[0] * UINT64_C(1000000);
    fsn_segment_idle(rig.segment, rig.now_ns);
    return FSN_OK;
}

static const struct {
    const char *word;
    fsn_status (*act)(const unsigned *numbers);
} deeds[] = {
    {"present", present}, /* POSITION YES */
    {"power", power},     /* POSITION: off and on */
    {"cable", cable},     /* POSITION UP: after it */
    {"ring", ring},       /* YES */
    {"port", port},       /* of the MainDevice that sends */
    {"swap", swap},       /* POSITION POSITION */
    {"errors", errors},   /* POSITION PORT NUMBER */
    {"lose", lose},
    {"lose-every", lose_every},
    {"delay", delay}, /* MS */
    {"stall", stall}, /* MS */
    {"repeat", repeat},
    {"al-delay", al_delay},           /* POSITION MS */
    {"mailbox-delay", mailbox_delay}, /* POSITION MS */
    {"identity", identity},           /* POSITION VENDOR PRODUCT REVISION; vendor 0: its own */
    {"abort", abort_code},            /* POSITION INDEX SUB CODE */
    {"object", object},               /* POSITION INDEX BYTES */
    {"inputs", inputs},               /* SM LAST-BYTE */
    {"outputs", outputs},             /* SM BYTES */
    {"idle", idle},                   /* MS */
};

static void do_deed(const char *rest) {
    char word[20];
    unsigned n[4] = {0};
    CHECK(sscanf(rest, "%19s %i %i %i %i", word, (int *)&n[0], (int *)&n[1], (int *)&n[2],
                 (int *)&n[3]) >= 1);
    size_t at = 0;
    while (strcmp(deeds[at].word, word) != 0) {
        CHECK(++at < sizeof deeds / sizeof deeds[0]);
    }
    const fsn_status status = deeds[at].act(n);
    strcat(said, fsn_status_name(status));
}

/** A broadcast read of one byte, with a number of its own. */
static void put_frame(const char *rest) {
    uint8_t frame[FRAME] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 1,    1,  1,
                            1,    1,    1,    0x88, 0xA4, 13,   0x10, BRD};
    frame[17] = ++frames_put;
    frame[22] = 1;
    unsigned to;
    CHECK(sscanf(rest, "%u", &to) == 1);
    fsn_segment_send(rig.segment, to, frame, sizeof frame, rig.now_ns);
    say("frame %llu", frames_put);
}

static void take_frame(void) {
    uint8_t frame[1536];
    uint32_t from = 9;
    const size_t len = fsn_segment_receive(rig.segment, frame, sizeof frame, rig.now_ns, &from);
    CHECK(len == 0 || len == FRAME);
    say(len == 0 ? "none" : "frame %llu", frame[17]);
    if (len > 0) {
        say(" at port %llu", from);
        say(", counter %llu", frame[27]);
    }
}

static void say_memory(const struct esc *esc) {
    uint32_t zeros = ZEROS; /* bytes that are 0 and not said */
    for (uint32_t at = 0; at < ESC_MEMORY_BYTES; at++) {
        if (esc->memory[at] == 0) {
            zeros++;
            continue;
        }
        if (zeros >= ZEROS) {
            say(" %llx:", at);
            zeros = 0;
        }
        say_hex(esc->memory + at - zeros, zeros + 1);
        zeros = 0;
    }
}

static void say_all(void) {
    struct fsn_segment_counts c;
    fsn_segment_counts(rig.segment, &c);
    say("frames %llu", c.frames);
    say(" datagrams %llu", c.datagrams);
    say(" lost %llu", c.lost);
    say(" foreign %llu", c.foreign);
    for (uint32_t i = 0; i < fsn_segment_size(rig.segment); i++) {
        const struct esc *esc = &rig.segment->escs[i];
        uint16_t code = 0;
        say(" | al %02llx", fsn_segment_al_status(rig.segment, i, &code));
        say(" code %llx", code);
        say(" ports %llu", esc->ports);
        say_memory(esc);
    }
}

/* -- all of it ------------------------------------------------------------------------------- */

static void new_line(const char *rest) {
    unsigned subdevices;
    CHECK(sscanf(rest, "%u", &subdevices) == 1);
    tear_down(&rig);
    rig = set_up_line(subdevices);
    frames_put = 0;
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
    } else if (strncmp(line, "line ", 5) == 0) {
        new_line(line + 5);
    } else if (strncmp(line, "do ", 3) == 0) {
        do_deed(line + 3);
    } else if (strncmp(line, "put ", 4) == 0) {
        put_frame(line + 4);
    } else if (strcmp(line, "take") == 0) {
        take_frame();
    } else if (strcmp(line, "wait") == 0) {
        say("%llu ns", fsn_segment_wait(rig.segment, rig.now_ns));
    } else if (strcmp(line, "all") == 0) {
        say_all();
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
    const long alive = heap_alive();
    static char line[16384], expected[16384];
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
    CHECK(writes || heap_alive() == alive);
    return 0;
}
