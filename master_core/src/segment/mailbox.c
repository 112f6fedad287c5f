/** Mailbox of an emulated SubDevice: CoE, and an error for other protocols. */
#include "segment/esc.h"

#include <string.h>

enum {
    HEADER_BYTES = 6,
    COE_BYTES = 2,
    SDO_BYTES = 8, /**< command, index, sub, 4 bytes */
    SM_FULL = 0x08,
    TYPE_ERROR = 0,
    TYPE_COE = 3,
    SERVICE_REQUEST = 2,
    SERVICE_RESPONSE = 3,
    SERVICE_INFORMATION = 8,
    COMPLETE_ACCESS = 0x10,
};

enum {
    ABORT_TOGGLE = 0x05030000u,
    ABORT_COMMAND = 0x05040001u,
    ABORT_MEMORY = 0x05040005u,
    ABORT_READ_ONLY = 0x06010002u,
    ABORT_NO_OBJECT = 0x06020000u,
    ABORT_LENGTH = 0x06070010u,
    ABORT_NO_SUB = 0x06090011u,
};

static uint8_t *sm(struct esc *esc, unsigned number) {
    return esc->memory + REG_SM + 8 * number;
}

/** Longest answer that fits into SM1. */
static uint32_t room(struct esc *esc) {
    const uint32_t length = fsn_get16(sm(esc, 1) + 2);
    return length < ESC_MAILBOX_BYTES ? length : ESC_MAILBOX_BYTES;
}

/** Begins an answer; returns the position of its body. */
static uint8_t *begin(struct esc *esc, uint8_t type, uint32_t body_bytes) {
    uint8_t *a = esc->answer;
    memset(a, 0, sizeof esc->answer);
    esc->mailbox_counter = (uint8_t)(esc->mailbox_counter % 7 + 1);
    fsn_put16(a, body_bytes);
    a[5] = (uint8_t)(type | (esc->mailbox_counter << 4));
    esc->answer_bytes = (uint16_t)(HEADER_BYTES + body_bytes);
    return a + HEADER_BYTES;
}

static uint8_t *begin_sdo(struct esc *esc, uint8_t command, uint16_t index, uint8_t sub,
                          uint32_t more_bytes) {
    uint8_t *body = begin(esc, TYPE_COE, COE_BYTES + SDO_BYTES + more_bytes);
    fsn_put16(body, SERVICE_RESPONSE << 12);
    body[2] = command;
    fsn_put16(body + 3, index);
    body[5] = sub;
    return body + 6;
}

static void abort_sdo(struct esc *esc, uint16_t index, uint8_t sub, uint32_t code) {
    uint8_t *data = begin_sdo(esc, 0x80, index, sub, 0);
    esc->answer[HEADER_BYTES + 1] = SERVICE_REQUEST << 4; /* an abort is a request */
    fsn_put32(data, code);
    esc->transfer.active = false;
}

/** Collects the data of an upload: one value, or a whole object with subindex 0 in 16 bits. */
static bool collect(struct esc *esc, uint16_t index, uint8_t sub, bool complete) {
    struct transfer *t = &esc->transfer;
    t->size_bytes = 0;
    for (uint32_t s = sub; s <= (complete ? 255u : sub); s++) {
        const struct object *o = objects_find(&esc->objects, index, (uint8_t)s);
        if (o == NULL) {
            break;
        }
        const uint32_t padding = complete && s == 0 ? 1 : 0;
        if (t->size_bytes + o->size_bytes + padding > sizeof t->data) {
            return false;
        }
        memcpy(t->data + t->size_bytes, objects_value(&esc->objects, o), o->size_bytes);
        t->size_bytes += o->size_bytes;
        if (padding > 0) {
            t->data[t->size_bytes++] = 0;
        }
    }
    return true;
}

/* A request returns its abort code, or 0 if it is answered. */

static uint32_t upload(struct esc *esc, uint8_t command, uint16_t index, uint8_t sub) {
    const bool complete = (command & COMPLETE_ACCESS) != 0;
    struct transfer *t = &esc->transfer;
    if (!objects_has(&esc->objects, index)) {
        return ABORT_NO_OBJECT;
    }
    if (objects_find(&esc->objects, index, sub) == NULL) {
        return ABORT_NO_SUB;
    }
    if (!collect(esc, index, sub, complete)) {
        return ABORT_MEMORY;
    }
    const uint8_t kept = command & COMPLETE_ACCESS;
    if (t->size_bytes > 0 && t->size_bytes <= 4) {
        const uint8_t unused = (uint8_t)(4 - t->size_bytes);
        uint8_t *data = begin_sdo(esc, (uint8_t)(0x43 | kept | (unused << 2)), index, sub, 0);
        memcpy(data, t->data, t->size_bytes);
        return 0;
    }
    const uint32_t space = room(esc) - HEADER_BYTES - COE_BYTES - SDO_BYTES;
    const uint32_t now = t->size_bytes < space ? t->size_bytes : space;
    uint8_t *data = begin_sdo(esc, (uint8_t)(0x41 | kept), index, sub, now);
    fsn_put32(data, t->size_bytes);
    memcpy(data + 4, t->data, now);
    t->done = now;
    t->active = now < t->size_bytes;
    t->upload = true;
    t->toggle = false;
    t->index = index;
    t->sub = sub;
    return 0;
}

/** Whether a segment continues the transfer. */
static uint32_t check_segment(const struct transfer *t, bool upload, uint8_t command) {
    if (!t->active || t->upload != upload) {
        return ABORT_COMMAND;
    }
    return ((command & 0x10) != 0) != t->toggle ? ABORT_TOGGLE : 0;
}

static uint32_t upload_segment(struct esc *esc, uint8_t command) {
    struct transfer *t = &esc->transfer;
    const uint32_t code = check_segment(t, true, command);
    if (code != 0) {
        return code;
    }
    const uint32_t left = t->size_bytes - t->done;
    const uint32_t space = room(esc) - HEADER_BYTES - COE_BYTES - 1;
    const uint32_t now = left < space ? left : space;
    const uint32_t shown = now < 7 ? 7 : now; /* a segment has at least 7 bytes */
    uint8_t *body = begin(esc, TYPE_COE, COE_BYTES + 1 + shown);
    fsn_put16(body, SERVICE_RESPONSE << 12);
    body[2] = (uint8_t)((t->toggle ? 0x10 : 0) | (now == left ? 1 : 0) | ((shown - now) << 1));
    memcpy(body + 3, t->data + t->done, now);
    t->done += now;
    t->toggle = !t->toggle;
    t->active = t->done < t->size_bytes;
    return 0;
}

/** Returns the abort code of a finished download, or 0 if it was stored. */
static uint32_t store(struct esc *esc, uint16_t index, uint8_t sub, bool complete,
                      const uint8_t *data, uint32_t size_bytes) {
    if (!objects_has(&esc->objects, index)) {
        return ABORT_NO_OBJECT;
    }
    uint32_t at = 0;
    /* Complete access writes all subindexes in turn; otherwise there is only one. */
    for (uint32_t s = sub; s <= (complete ? 255u : sub) && (at < size_bytes || s == sub); s++) {
        const struct object *o = objects_find(&esc->objects, index, (uint8_t)s);
        if (o == NULL) {
            return s == sub ? ABORT_NO_SUB : ABORT_LENGTH;
        }
        if (!o->writable) {
            return ABORT_READ_ONLY;
        }
        if (size_bytes - at < o->size_bytes || (!complete && size_bytes != o->size_bytes)) {
            return ABORT_LENGTH;
        }
        memcpy(objects_value(&esc->objects, o), data + at, o->size_bytes);
        /* With complete access, subindex 0 takes two bytes: a padding byte follows it. */
        at += o->size_bytes + (complete && s == 0 ? 1 : 0);
    }
    return 0;
}

static uint32_t download(struct esc *esc, const uint8_t *sdo, uint32_t sdo_bytes) {
    const uint8_t command = sdo[0];
    const uint16_t index = fsn_get16(sdo + 1);
    const uint8_t sub = sdo[3];
    const bool complete = (command & COMPLETE_ACCESS) != 0;
    const bool expedited = (command & 2) != 0;
    uint32_t size = fsn_get32(sdo + 4);
    uint32_t given = sdo_bytes - SDO_BYTES;
    if (expedited) {
        size = given = (command & 1) != 0 ? 4u - (command >> 2 & 3) : 4u;
    }
    struct transfer *t = &esc->transfer;
    if (size > sizeof t->data) {
        return ABORT_MEMORY;
    }
    const uint8_t *data = sdo + (expedited ? 4 : SDO_BYTES);
    uint32_t code = 0;
    if (given < size) {
        *t = (struct transfer){.active = true,
                               .complete = complete,
                               .index = index,
                               .sub = sub,
                               .size_bytes = size,
                               .done = given};
        memcpy(t->data, data, given);
    } else {
        code = store(esc, index, sub, complete, data, size);
    }
    if (code == 0) {
        (void)begin_sdo(esc, (uint8_t)(0x60 | (complete ? COMPLETE_ACCESS : 0)), index, sub, 0);
    }
    return code;
}

static uint32_t download_segment(struct esc *esc, const uint8_t *sdo, uint32_t sdo_bytes) {
    struct transfer *t = &esc->transfer;
    const uint8_t command = sdo[0];
    uint32_t code = check_segment(t, false, command);
    if (code != 0) {
        return code;
    }
    uint32_t given = sdo_bytes - 1;
    if (given == 7) {
        given -= command >> 1 & 7; /* only a segment of 7 bytes has this number */
    }
    if (given > t->size_bytes - t->done) {
        return ABORT_LENGTH;
    }
    memcpy(t->data + t->done, sdo + 1, given);
    t->done += given;
    t->toggle = !t->toggle;
    if ((command & 1) != 0) {
        t->active = false;
        code = t->done == t->size_bytes
                   ? store(esc, t->index, t->sub, t->complete, t->data, t->size_bytes)
                   : ABORT_LENGTH;
        if (code != 0) {
            return code;
        }
    }
    uint8_t *body = begin(esc, TYPE_COE, COE_BYTES + SDO_BYTES);
    fsn_put16(body, SERVICE_RESPONSE << 12);
    body[2] = (uint8_t)(0x20 | (command & 0x10));
    return 0;
}

/** Code with which a test lets access to an object abort; 0: none. */
static uint32_t abort_on_demand(const struct esc *esc, uint16_t index, uint8_t sub) {
    for (uint32_t i = 0; i < esc->faults.abort_count; i++) {
        const struct esc_abort *a = &esc->faults.aborts[i];
        if (a->index == index && (a->sub > 255 || a->sub == sub)) {
            return a->code;
        }
    }
    return 0;
}

enum { DOWNLOAD_SEGMENT, DOWNLOAD, UPLOAD, UPLOAD_SEGMENT, ABORT };

static uint32_t answer_sdo(struct esc *esc, const uint8_t *sdo, uint32_t sdo_bytes) {
    switch (sdo[0] >> 5) {
    case DOWNLOAD_SEGMENT:
        return download_segment(esc, sdo, sdo_bytes);
    case DOWNLOAD:
        esc->transfer = (struct transfer){0};
        return download(esc, sdo, sdo_bytes);
    case UPLOAD:
        esc->transfer = (struct transfer){0};
        return upload(esc, sdo[0], fsn_get16(sdo + 1), sdo[3]);
    case UPLOAD_SEGMENT:
        return upload_segment(esc, sdo[0]);
    case ABORT:
        esc->transfer = (struct transfer){0}; /* the MainDevice gave up: no answer */
        return 0;
    default:
        return ABORT_COMMAND;
    }
}

static void take_sdo(struct esc *esc, const uint8_t *sdo, uint32_t sdo_bytes) {
    const uint8_t command = sdo[0] >> 5;
    const bool segment = command == DOWNLOAD_SEGMENT || command == UPLOAD_SEGMENT;
    const uint16_t index = segment ? esc->transfer.index : fsn_get16(sdo + 1);
    const uint8_t sub = segment ? esc->transfer.sub : sdo[3];
    const bool whole = command == DOWNLOAD || command == UPLOAD;
    uint32_t code = whole ? abort_on_demand(esc, index, sub) : 0;
    code = code != 0 ? code : answer_sdo(esc, sdo, sdo_bytes);
    if (code != 0) {
        abort_sdo(esc, index, sub, code);
    }
}

static void refuse(struct esc *esc, uint16_t detail) {
    uint8_t *body = begin(esc, TYPE_ERROR, 4);
    fsn_put16(body, 1);
    fsn_put16(body + 2, detail);
}

static void refuse_information(struct esc *esc) {
    uint8_t *body = begin(esc, TYPE_COE, COE_BYTES + 8);
    fsn_put16(body, SERVICE_INFORMATION << 12);
    body[2] = 7; /* SDO information error */
    fsn_put32(body + 6, ABORT_COMMAND);
}

void esc_mailbox_in(struct esc *esc) {
    const uint16_t start = fsn_get16(sm(esc, 0));
    const uint32_t length = fsn_get16(sm(esc, 0) + 2);
    uint8_t message[ESC_MAILBOX_BYTES + SDO_BYTES] = {0};
    const uint32_t taken = length < ESC_MAILBOX_BYTES ? length : ESC_MAILBOX_BYTES;
    if ((uint32_t)start + taken > ESC_MEMORY_BYTES || esc_state(esc) == AL_INIT) {
        return;
    }
    memcpy(message, esc->memory + start, taken);
    esc->answer_due_ns = esc->now_ns + esc->faults.mailbox_delay_ns;
    sm(esc, 0)[5] &= (uint8_t)~SM_FULL; /* the device has taken it */
    if (room(esc) < HEADER_BYTES + COE_BYTES + SDO_BYTES) {
        return; /* SM1 has been written since PREOP: no answer is possible */
    }
    const uint32_t body = fsn_get16(message);
    const uint8_t type = message[5] & 0x0F;
    const uint8_t service = message[HEADER_BYTES + 1] >> 4;
    if (body + HEADER_BYTES > taken || body < COE_BYTES) {
        refuse(esc, 0x0005); /* the length in the header exceeds the mailbox */
    } else if (type != TYPE_COE) {
        refuse(esc, 0x0002); /* protocol not supported */
    } else if (service == SERVICE_REQUEST && body >= COE_BYTES + SDO_BYTES) {
        take_sdo(esc, message + HEADER_BYTES + COE_BYTES, body - COE_BYTES);
    } else if (service == SERVICE_INFORMATION) {
        refuse_information(esc);
    } else {
        refuse(esc, 0x0004); /* service not supported */
    }
    esc_mailbox_out(esc);
}

void esc_mailbox_out(struct esc *esc) {
    uint8_t *registers = sm(esc, 1);
    const uint16_t start = fsn_get16(registers);
    const uint32_t length = fsn_get16(registers + 2);
    if (esc->answer_bytes == 0 || esc->now_ns < esc->answer_due_ns ||
        (registers[5] & SM_FULL) != 0 || (registers[6] & 1) == 0 ||
        (uint32_t)start + length > ESC_MEMORY_BYTES || esc->answer_bytes > length) {
        return;
    }
    memset(esc->memory + start, 0, length);
    memcpy(esc->memory + start, esc->answer, esc->answer_bytes);
    esc->answer_bytes = 0;
    registers[5] |= SM_FULL;
}
