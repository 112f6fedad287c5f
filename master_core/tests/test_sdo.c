/** SDO transfers over a mailbox in memory, answered well and badly. */
#include <string.h>

#include "builder.h"
#include "fsn/fsn.h"
#include "heap.h"
#include "live/sdo.h"

enum { MAILBOX = 32, OBJECT = 300, ANSWERS = 64 };

/** The device: answers from a script, or an object that is read and written in segments. */
struct device {
    uint8_t object[OBJECT];
    uint32_t size, done;
    bool writing;
    uint8_t answer[MAILBOX];
    bool has_answer;
    uint8_t counter;
    const uint8_t *script; /**< bodies of 10 bytes, sent instead */
    const char *head;      /**< 6 bytes before each of them; NULL: as it is right */
    uint32_t script_left;
    uint32_t sent, aborts;
    bool mute;
    char talk[4000]; /**< every request as it was sent, without trailing zeros */
};

static void keep(struct device *d, const uint8_t *message) {
    const unsigned len = 6u + message[0];
    size_t used = strlen(d->talk);
    CHECK(len <= MAILBOX);
    for (unsigned i = 0; i < len; i++) {
        used += (size_t)snprintf(d->talk + used, sizeof d->talk - used, "%02x", message[i]);
    }
    snprintf(d->talk + used, sizeof d->talk - used, "\n");
    for (unsigned i = len; i < MAILBOX; i++) {
        CHECK(message[i] == 0);
    }
}

static void reply(struct device *d, uint32_t sdo_bytes) {
    d->answer[0] = (uint8_t)(2 + sdo_bytes);
    d->answer[1] = 0;
    d->answer[5] = 3;
    d->answer[6] = 0;
    d->answer[7] = 0x30;
    d->has_answer = true;
}

static void reply_object(struct device *d, uint8_t command, const uint8_t *request) {
    memset(d->answer, 0, sizeof d->answer);
    d->answer[8] = command;
    memcpy(d->answer + 9, request + 9, 3);
    reply(d, 8);
}

static void upload_next(struct device *d, bool toggle) {
    const uint32_t room = MAILBOX - 9;
    const uint32_t left = d->size - d->done;
    const uint32_t now = left < room ? left : room;
    const uint32_t shown = now < 7 ? 7 : now;
    memset(d->answer, 0, sizeof d->answer);
    d->answer[8] = (uint8_t)((toggle ? 0x10 : 0) | (now == left) | (shown - now) << 1);
    memcpy(d->answer + 9, d->object + d->done, now);
    d->done += now;
    reply(d, 1 + shown);
}

static void answer_well(struct device *d, const uint8_t *m) {
    const uint32_t body = m[0];
    switch (m[8] >> 5) {
    case 2:
        d->done = 0;
        reply_object(d, d->size <= 4 ? (uint8_t)(0x43 | (4 - d->size) << 2) : 0x41, m);
        if (d->size <= 4) {
            memcpy(d->answer + 12, d->object, d->size);
            return;
        }
        d->answer[12] = (uint8_t)d->size;
        d->answer[13] = (uint8_t)(d->size >> 8);
        return;
    case 3:
        upload_next(d, (m[8] & 0x10) != 0);
        return;
    case 1:
        d->done = 0;
        if ((m[8] & 2) != 0) {
            d->size = 4u - (m[8] >> 2 & 3);
            memcpy(d->object, m + 12, d->size);
        } else {
            d->size = (uint32_t)(m[12] | m[13] << 8);
            d->done = body - 10;
            memcpy(d->object, m + 16, d->done);
        }
        reply_object(d, 0x60, m);
        return;
    default: {
        uint32_t given = body - 3;
        given -= given == 7 ? m[8] >> 1 & 7 : 0;
        CHECK(d->done + given <= d->size);
        memcpy(d->object + d->done, m + 9, given);
        d->done += given;
        memset(d->answer, 0, sizeof d->answer);
        d->answer[8] = (uint8_t)(0x20 | (m[8] & 0x10));
        reply(d, 8);
    }
    }
}

static uint8_t next_counter(void *context) {
    struct device *d = context;
    return d->counter = (uint8_t)(d->counter % 7 + 1);
}

static bool send_message(void *context, const uint8_t *message) {
    struct device *d = context;
    d->sent++;
    keep(d, message);
    d->has_answer = false;
    if (message[8] == 0x80) {
        d->aborts++;
        return true;
    }
    CHECK(message[0] + 6u <= MAILBOX && (message[5] & 0x0F) == 3 && message[5] >> 4 == d->counter);
    if (d->script_left > 0) {
        memset(d->answer, 0, sizeof d->answer);
        memcpy(d->answer + 6, d->script, 10);
        memcpy(d->answer, d->head != NULL ? d->head : "\x0a\0\0\0\0\3", 6);
        d->script += 10;
        d->script_left--;
        d->has_answer = true;
    } else if (!d->mute) {
        answer_well(d, message);
    }
    return true;
}

static bool receive_message(void *context, uint8_t *message) {
    struct device *d = context;
    if (!d->has_answer) {
        return false;
    }
    d->has_answer = false;
    memcpy(message, d->answer, MAILBOX);
    return true;
}

static struct fsn_mailbox mailbox_of(struct device *d) {
    return (struct fsn_mailbox){.context = d,
                                .in_bytes = MAILBOX,
                                .out_bytes = MAILBOX,
                                .next_counter = next_counter,
                                .send = send_message,
                                .receive = receive_message};
}

static void objects_of_every_length(void) {
    for (uint32_t size = 0; size <= OBJECT; size++) {
        uint8_t *data = malloc(size + 1);
        struct device d = {0};
        const struct fsn_mailbox mailbox = mailbox_of(&d);
        CHECK(data != NULL);
        for (uint32_t i = 0; i < size; i++) {
            data[i] = (uint8_t)(i * 7 + size);
        }
        struct fsn_transfer t = {.index = 0x2000, .sub = 1, .data = data, .size_bytes = size};
        CHECK(fsn_sdo_download(&mailbox, &t) == FSN_OK);
        CHECK(d.size == size && memcmp(d.object, data, size) == 0);
        if (size > 0) { /* an empty object has no expedited form in this device */
            memset(data, 0, size);
            CHECK(fsn_sdo_upload(&mailbox, &t) == FSN_OK && t.size_bytes == size);
            CHECK(memcmp(d.object, data, size) == 0);
            t.size_bytes = size - 1;
            CHECK(fsn_sdo_upload(&mailbox, &t) == FSN_E_SPACE);
        }
        free(data);
    }
}

static bool refuse_to_go_on(void *self) {
    return --*(int *)self > 0;
}

static void long_transfers_are_broken_off(void) {
    struct device d = {.size = OBJECT};
    const struct fsn_mailbox mailbox = mailbox_of(&d);
    uint8_t data[OBJECT];
    int steps = 3;
    struct fsn_transfer t = {
        .data = data, .size_bytes = sizeof data, .between = refuse_to_go_on, .self = &steps};
    CHECK(fsn_sdo_upload(&mailbox, &t) == FSN_E_STATE && d.aborts == 1 && d.sent == 4);
    steps = 3;
    t.size_bytes = sizeof data;
    CHECK(fsn_sdo_download(&mailbox, &t) == FSN_E_STATE && d.aborts == 2);
}

static void bad_answers(void) {
    static const struct {
        uint8_t answers[3 * 10];
        uint32_t count;
        fsn_status status;
        uint32_t abort_code;
    } rows[] = {
        /* abort */
        {{0, 0x20, 0x80, 0, 0, 0, 0, 0, 2, 6}, 1, FSN_E_BUS_SDO, 0x06020000},
        {{0, 0x30, 0x80, 0, 0, 0, 0, 0, 2, 6}, 1, FSN_E_BUS_SDO, 0x06020000},
        /* a length that would be negative, one of 4 GiB, one beyond the room */
        {{0, 0x30, 0x41, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF}, 1, FSN_E_SPACE, 0},
        {{0, 0x30, 0x41, 0, 0, 0, 0, 0, 0, 0x80}, 1, FSN_E_SPACE, 0},
        {{0, 0x30, 0x41, 0, 0, 0, 65, 0, 0, 0}, 1, FSN_E_SPACE, 0},
        /* an answer to a download, and one about another object */
        {{0, 0x30, 0x60, 0, 0, 0, 0, 0, 0, 0}, 1, FSN_E_BUS_STATE, 0},
        {{0, 0x30, 0x43, 1, 0, 0, 0, 0, 0, 0}, 1, FSN_E_BUS_MAILBOX, 0},
        {{0, 0x10, 0x43, 0, 0, 0, 0, 0, 0, 0}, 1, FSN_E_BUS_MAILBOX, 0},
        /* segments: wrong toggle, more than announced, none, too few, not a segment */
        {{0, 0x30, 0x41, 0, 0, 0, 9, 0, 0, 0, 0, 0x30, 0x10}, 2, FSN_E_BUS_STATE, 0},
        {{0, 0x30, 0x41, 0, 0, 0, 5, 0, 0, 0, 0, 0x30, 0x01}, 2, FSN_E_BUS_STATE, 0},
        {{0, 0x30, 0x41, 0, 0, 0, 9, 0, 0, 0, 0, 0x30, 0x0E}, 2, FSN_E_BUS_STATE, 0},
        {{0, 0x30, 0x41, 0, 0, 0, 9, 0, 0, 0, 0, 0x30, 0x01}, 2, FSN_E_BUS_STATE, 0},
        {{0, 0x30, 0x41, 0, 0, 0, 9, 0, 0, 0, 0, 0x30, 0x43}, 2, FSN_E_BUS_STATE, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct device d = {.script = rows[i].answers, .script_left = rows[i].count, .mute = true};
        const struct fsn_mailbox mailbox = mailbox_of(&d);
        uint8_t *data = malloc(64);
        CHECK(data != NULL);
        struct fsn_transfer t = {.data = data, .size_bytes = 64};
        CHECK(fsn_sdo_upload(&mailbox, &t) == rows[i].status);
        CHECK(t.abort_code == rows[i].abort_code && t.size_bytes <= 64);
        free(data);
    }
}

/** A message of another protocol, one that is cut off, one longer than the mailbox. */
static void what_is_no_sdo_is_passed_over(void) {
    static const uint8_t body[10] = {0, 0x30, 0x4F, 0, 0, 0, 77};
    static const struct {
        const char *head;
        fsn_status status;
    } rows[] = {
        {"\x0a\0\0\0\0\3", FSN_OK},
        {"\x0a\0\0\0\0\xF3", FSN_OK},
        {"\x0a\0\0\0\0\2", FSN_E_BUS_MAILBOX},
        {"\x09\0\0\0\0\3", FSN_E_BUS_MAILBOX},
        {"\x1a\0\0\0\0\3", FSN_OK},
        {"\x1b\0\0\0\0\3", FSN_E_BUS_MAILBOX},
        {"\x0a\1\0\0\0\3", FSN_E_BUS_MAILBOX},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct device d = {.head = rows[i].head, .script = body, .script_left = 1, .mute = true};
        const struct fsn_mailbox mailbox = mailbox_of(&d);
        uint8_t data[4] = {0};
        struct fsn_transfer t = {.data = data, .size_bytes = sizeof data};
        CHECK(fsn_sdo_upload(&mailbox, &t) == rows[i].status);
        CHECK(data[0] == (rows[i].status == FSN_OK ? 77 : 0));
    }
}

/** Four bytes where the answer states no size, whatever its other bits are. */
static void an_answer_without_a_size_has_four_bytes(void) {
    static const uint8_t body[10] = {0, 0x30, 0x46, 0, 0, 0, 1, 2, 3, 4};
    struct device d = {.script = body, .script_left = 1, .mute = true};
    const struct fsn_mailbox mailbox = mailbox_of(&d);
    uint8_t data[8];
    struct fsn_transfer t = {.data = data, .size_bytes = sizeof data};
    CHECK(fsn_sdo_upload(&mailbox, &t) == FSN_OK && t.size_bytes == 4);
    CHECK(memcmp(data, body + 6, 4) == 0);
}

/** Bytes at random never reach beyond the room; ASan sees it. */
static void noise(void) {
    uint32_t seed = 1;
    for (int round = 0; round < 20000; round++) {
        uint8_t script[8 * 10];
        for (size_t i = 0; i < sizeof script; i++) {
            seed = seed * 1664525u + 1013904223u;
            script[i] = (uint8_t)(i % 10 == 1 ? 0x30 : i % 10 >= 3 && i % 10 <= 5 ? 0 : seed >> 24);
        }
        struct device d = {.script = script, .script_left = 8, .mute = true};
        const struct fsn_mailbox mailbox = mailbox_of(&d);
        uint8_t *data = malloc(40);
        CHECK(data != NULL);
        struct fsn_transfer t = {.data = data, .size_bytes = 40};
        (void)fsn_sdo_upload(&mailbox, &t);
        CHECK(t.size_bytes <= 40);
        (void)fsn_sdo_download(&mailbox, &t);
        free(data);
    }
}

static void talked(struct device *d, const char *expected, int line) {
    if (strcmp(d->talk, expected) != 0) {
        fprintf(stderr, "line %d: sent\n%sexpected\n%s", line, d->talk, expected);
        exit(1);
    }
    d->talk[0] = 0;
}

/** Whole requests: object 0x1234:56, in a mailbox of 32 bytes. */
static void requests_are_as_the_standard_says(void) {
    uint8_t data[OBJECT];
    struct device d = {.size = 40};
    const struct fsn_mailbox mailbox = mailbox_of(&d);
    for (unsigned i = 0; i < sizeof data; i++) {
        data[i] = (uint8_t)(i + 1);
    }
    struct fsn_transfer t = {
        .index = 0x1234, .sub = 0x56, .data = data, .size_bytes = 1, .abort_code = 9};
    for (t.size_bytes = 0; t.size_bytes <= 5; t.size_bytes++) {
        CHECK(fsn_sdo_download(&mailbox, &t) == FSN_OK && t.abort_code == 0);
    }
    talked(&d,
           "0a000000001300202134125600000000\n"
           "0a000000002300202f34125601000000\n"
           "0a000000003300202b34125601020000\n"
           "0a000000004300202734125601020300\n"
           "0a000000005300202334125601020304\n"
           "0f0000000063002021341256050000000102030405\n",
           __LINE__);
    t.size_bytes = 16;
    CHECK(fsn_sdo_download(&mailbox, &t) == FSN_OK);
    t.size_bytes = 17;
    CHECK(fsn_sdo_download(&mailbox, &t) == FSN_OK);
    t.size_bytes = 45;
    CHECK(fsn_sdo_download(&mailbox, &t) == FSN_OK);
    talked(&d,
           "1a0000000073002021341256100000000102030405060708090a0b0c0d0e0f10\n"
           "1a0000000013002021341256110000000102030405060708090a0b0c0d0e0f10\n"
           "0a000000002300200d11000000000000\n"
           "1a00000000330020213412562d0000000102030405060708090a0b0c0d0e0f10\n"
           "1a00000000430020001112131415161718191a1b1c1d1e1f2021222324252627\n"
           "0a000000005300201328292a2b2c2d00\n",
           __LINE__);
    t.size_bytes = sizeof data;
    CHECK(fsn_sdo_upload(&mailbox, &t) == FSN_OK && t.size_bytes == 45);
    int steps = 2;
    t.between = refuse_to_go_on;
    t.self = &steps;
    t.size_bytes = sizeof data;
    CHECK(fsn_sdo_upload(&mailbox, &t) == FSN_E_STATE);
    steps = 2;
    t.size_bytes = 60;
    CHECK(fsn_sdo_download(&mailbox, &t) == FSN_E_STATE);
    talked(&d,
           "0a000000006300204034125600000000\n"
           "0a000000007300206000000000000000\n"
           "0a000000001300207000000000000000\n"
           "0a000000002300204034125600000000\n"
           "0a000000003300206000000000000000\n"
           "0a000000004300208034125600000008\n"
           "1a00000000530020213412563c0000000102030405060708090a0b0c0d0e0f10\n"
           "1a00000000630020001112131415161718191a1b1c1d1e1f2021222324252627\n"
           "0a000000007300208034125600000008\n",
           __LINE__);
}

int main(void) {
    const long alive = heap_alive();
    struct device small = {0};
    struct fsn_mailbox none = mailbox_of(&small);
    none.in_bytes = 0;
    struct fsn_transfer t = {0};
    CHECK(fsn_sdo_upload(&none, &t) == FSN_E_ABSENT && fsn_sdo_download(&none, &t) == FSN_E_ABSENT);
    CHECK(fsn_abort_text(0x06020000)[0] != 0 && fsn_abort_text(1)[0] != 0);
    requests_are_as_the_standard_says();
    objects_of_every_length();
    long_transfers_are_broken_off();
    bad_answers();
    what_is_no_sdo_is_passed_over();
    an_answer_without_a_size_has_four_bytes();
    noise();
    CHECK(heap_alive() == alive);
    return 0;
}
