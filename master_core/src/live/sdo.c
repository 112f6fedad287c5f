#include "live/sdo.h"

#include <string.h>

#include "plan/plan_internal.h"

enum {
    HEADER_BYTES = 6,
    COE_BYTES = 2,
    SDO_BYTES = 8, /**< command, index, subindex, 4 bytes */
    BODY = HEADER_BYTES + COE_BYTES,
    TYPE_COE = 3,
    SERVICE_REQUEST = 2,
    SERVICE_RESPONSE = 3,
    UPLOAD = 0x40,
    UPLOAD_SEGMENT = 0x60,
    DOWNLOAD_WITH_SIZE = 0x21,
    DOWNLOAD_EXPEDITED = 0x23,
    ABORT = 0x80,
    TOGGLE = 0x10,
    ABORT_GENERAL = 0x08000000,
    STRAY_MESSAGES = 16, /**< emergencies and others that may precede the answer */
};

/** One request and its answer. */
struct exchange {
    const struct fsn_mailbox *mailbox;
    struct fsn_transfer *transfer;
    uint8_t request[FSN_MAILBOX_BYTES];
    uint8_t answer[FSN_MAILBOX_BYTES];
    uint8_t *sdo;       /**< of the answer */
    uint32_t sdo_bytes; /**< its length, at least 1 */
};

/** Begins a request; returns the position of its SDO. */
static uint8_t *begin(struct exchange *x, uint32_t sdo_bytes) {
    memset(x->request, 0, sizeof x->request);
    fsn_put16(x->request, COE_BYTES + sdo_bytes);
    x->request[5] = (uint8_t)(TYPE_COE | (x->mailbox->next_counter(x->mailbox->context) & 7) << 4);
    fsn_put16(x->request + HEADER_BYTES, SERVICE_REQUEST << 12);
    return x->request + BODY;
}

static uint8_t *begin_object(struct exchange *x, uint8_t command, uint32_t more_bytes) {
    uint8_t *sdo = begin(x, SDO_BYTES + more_bytes);
    sdo[0] = command;
    fsn_put16(sdo + 1, x->transfer->index);
    sdo[3] = x->transfer->sub;
    return sdo;
}

/** Finds the SDO in a message; false if there is none, or it is longer than its mailbox. */
static bool is_sdo(struct exchange *x) {
    const uint32_t body = fsn_get16(x->answer);
    const unsigned service = x->answer[HEADER_BYTES + 1] >> 4;
    if ((x->answer[5] & 0x0F) != TYPE_COE || body < COE_BYTES + SDO_BYTES ||
        HEADER_BYTES + body > x->mailbox->in_bytes ||
        (service != SERVICE_RESPONSE && service != SERVICE_REQUEST)) {
        return false;
    }
    x->sdo = x->answer + BODY;
    x->sdo_bytes = body - COE_BYTES;
    return service == SERVICE_RESPONSE || x->sdo[0] == ABORT;
}

static bool is_ours(const struct exchange *x) {
    return fsn_get16(x->sdo + 1) == x->transfer->index && x->sdo[3] == x->transfer->sub;
}

/** Sends and waits for the SDO that answers.
 *  @param[in] named  whether the answer contains the object address; those to segments do not. */
static fsn_status exchange_sdo(struct exchange *x, bool named) {
    if (!x->mailbox->send(x->mailbox->context, x->request)) {
        return FSN_E_BUS_MAILBOX;
    }
    for (int i = 0; i < STRAY_MESSAGES; i++) {
        memset(x->answer, 0, sizeof x->answer);
        if (!x->mailbox->receive(x->mailbox->context, x->answer)) {
            return FSN_E_BUS_MAILBOX;
        }
        if (!is_sdo(x)) {
            continue;
        }
        if (x->sdo[0] == ABORT) {
            x->transfer->abort_code = fsn_get32(x->sdo + 4);
            return FSN_E_BUS_SDO;
        }
        if (!named || is_ours(x)) {
            return FSN_OK;
        }
    }
    return FSN_E_BUS_STATE;
}

/** Ends the transfer on the SubDevice, which does not answer. */
static fsn_status give_up(struct exchange *x, fsn_status status) {
    fsn_put32(begin_object(x, ABORT, 0) + 4, ABORT_GENERAL);
    (void)x->mailbox->send(x->mailbox->context, x->request);
    return status;
}

static bool start(struct exchange *x, const struct fsn_mailbox *mailbox,
                  struct fsn_transfer *transfer) {
    x->mailbox = mailbox;
    x->transfer = transfer;
    transfer->abort_code = 0;
    return mailbox->in_bytes >= FSN_MAILBOX_LEAST && mailbox->out_bytes >= FSN_MAILBOX_LEAST &&
           mailbox->in_bytes <= FSN_MAILBOX_BYTES && mailbox->out_bytes <= FSN_MAILBOX_BYTES;
}

static bool goes_on(const struct fsn_transfer *t) {
    return t->between == NULL || t->between(t->self);
}

/* -- reading -------------------------------------------------------------------------------- */

/** One segment: 7 bytes or more; a short one contains the number of unused bytes. */
static fsn_status take_segment(struct exchange *x, uint32_t *done, uint32_t size, bool toggle,
                               bool *last) {
    begin(x, SDO_BYTES)[0] = (uint8_t)(UPLOAD_SEGMENT | (toggle ? TOGGLE : 0));
    FSN_TRY(exchange_sdo(x, false));
    uint32_t given = x->sdo_bytes - 1;
    if (given == 7) {
        given -= x->sdo[0] >> 1 & 7;
    }
    *last = (x->sdo[0] & 1) != 0;
    if (x->sdo[0] >> 5 != 0 || ((x->sdo[0] & TOGGLE) != 0) != toggle || given > size - *done ||
        (given == 0 && !*last)) {
        return give_up(x, FSN_E_BUS_STATE);
    }
    memcpy(x->transfer->data + *done, x->sdo + 1, given);
    *done += given;
    return FSN_OK;
}

static fsn_status take_segments(struct exchange *x, uint32_t done, uint32_t size) {
    bool toggle = false;
    bool last = false;
    while (!last) {
        if (!goes_on(x->transfer)) {
            return give_up(x, FSN_E_STATE);
        }
        FSN_TRY(take_segment(x, &done, size, toggle, &last));
        toggle = !toggle;
    }
    x->transfer->size_bytes = done;
    return done == size ? FSN_OK : FSN_E_BUS_STATE;
}

fsn_status fsn_sdo_upload(const struct fsn_mailbox *mailbox, struct fsn_transfer *transfer) {
    struct exchange x;
    if (!start(&x, mailbox, transfer)) {
        return FSN_E_ABSENT;
    }
    (void)begin_object(&x, UPLOAD, 0);
    FSN_TRY(exchange_sdo(&x, true));
    const uint8_t command = x.sdo[0];
    if (command >> 5 != UPLOAD >> 5) {
        return FSN_E_BUS_STATE;
    }
    const bool expedited = (command & 2) != 0;
    uint32_t size = 4;
    if (!expedited) {
        size = fsn_get32(x.sdo + 4);
    } else if ((command & 1) != 0) {
        size -= command >> 2 & 3;
    }
    const uint8_t *data = x.sdo + (expedited ? 4 : SDO_BYTES);
    const uint32_t held = expedited ? size : x.sdo_bytes - SDO_BYTES;
    const uint32_t now = held < size ? held : size;
    if (size > transfer->size_bytes) {
        return now < size ? give_up(&x, FSN_E_SPACE) : FSN_E_SPACE;
    }
    memcpy(transfer->data, data, now);
    if (now < size) {
        return take_segments(&x, now, size);
    }
    transfer->size_bytes = size;
    return FSN_OK;
}

/* -- writing -------------------------------------------------------------------------------- */

static fsn_status give_segments(struct exchange *x, uint32_t done) {
    const struct fsn_transfer *t = x->transfer;
    const uint32_t room = x->mailbox->out_bytes - BODY - 1u;
    bool toggle = false;
    while (done < t->size_bytes) {
        if (!goes_on(t)) {
            return give_up(x, FSN_E_STATE);
        }
        const uint32_t left = t->size_bytes - done;
        const uint32_t now = left < room ? left : room;
        const uint32_t shown = now < 7 ? 7 : now;
        uint8_t *sdo = begin(x, 1 + shown);
        sdo[0] = (uint8_t)((toggle ? TOGGLE : 0) | (now == left ? 1 : 0) | (shown - now) << 1);
        memcpy(sdo + 1, t->data + done, now);
        FSN_TRY(exchange_sdo(x, false));
        if (x->sdo[0] >> 5 != 1 || ((x->sdo[0] & TOGGLE) != 0) != toggle) {
            return give_up(x, FSN_E_BUS_STATE);
        }
        done += now;
        toggle = !toggle;
    }
    return FSN_OK;
}

fsn_status fsn_sdo_download(const struct fsn_mailbox *mailbox, struct fsn_transfer *transfer) {
    struct exchange x;
    if (!start(&x, mailbox, transfer)) {
        return FSN_E_ABSENT;
    }
    const uint32_t size = transfer->size_bytes;
    uint32_t now = size;
    if (size > 0 && size <= 4) {
        uint8_t *sdo = begin_object(&x, (uint8_t)(DOWNLOAD_EXPEDITED | (4 - size) << 2), 0);
        memcpy(sdo + 4, transfer->data, size);
    } else {
        const uint32_t room = mailbox->out_bytes - BODY - (uint32_t)SDO_BYTES;
        now = size < room ? size : room;
        uint8_t *sdo = begin_object(&x, DOWNLOAD_WITH_SIZE, now);
        fsn_put32(sdo + 4, size);
        memcpy(sdo + SDO_BYTES, transfer->data, now);
    }
    FSN_TRY(exchange_sdo(&x, true));
    if (x.sdo[0] >> 5 != 3) {
        return FSN_E_BUS_STATE;
    }
    return now < size ? give_segments(&x, now) : FSN_OK;
}
