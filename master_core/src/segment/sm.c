/** Sync managers: mailboxes that are full or empty, process data that is never half new. */
#include "esc.h"

#include <string.h>

enum { SM_FULL = 0x08 };

struct sm {
    uint16_t start, length;
    bool mailbox, from_device, enabled; /**< from_device: the bus reads it */
};

static struct sm get_sm(const struct esc *esc, unsigned number) {
    const uint8_t *r = esc->memory + REG_SM + 8 * number;
    return (struct sm){
        .start = esc_get16(r),
        .length = esc_get16(r + 2),
        .mailbox = (r[4] & 3) == 2,
        .from_device = (r[4] & 0x0C) == 0,
        /* It guards process data memory only: registers stay reachable whatever is set. */
        .enabled = (r[6] & 1) != 0 && esc_get16(r + 2) > 0 && esc_get16(r) >= ESC_PROCESS_DATA,
    };
}

static uint8_t *status(struct esc *esc, unsigned number) {
    return esc->memory + REG_SM + 8 * number + 5;
}

static bool touches(const struct sm *sm, uint16_t address, uint16_t size_bytes) {
    return sm->enabled && address < sm->start + sm->length &&
           (uint32_t)address + size_bytes > sm->start;
}

static bool holds(uint16_t address, uint16_t size_bytes, uint32_t byte) {
    return byte >= address && byte < (uint32_t)address + size_bytes;
}

bool esc_sm_allows(const struct esc *esc, uint16_t address, uint16_t size_bytes, bool write) {
    for (unsigned n = 0; n < ESC_SMS; n++) {
        const struct sm sm = get_sm(esc, n);
        if (!touches(&sm, address, size_bytes)) {
            continue;
        }
        if (write == sm.from_device) {
            return false; /* the device's side of it */
        }
        const bool full = (esc->memory[REG_SM + 8 * n + 5] & SM_FULL) != 0;
        if (sm.mailbox && full != sm.from_device) {
            return false; /* written while full, or read while empty */
        }
    }
    return true;
}

void esc_sm_before_read(struct esc *esc, uint16_t address, uint16_t size_bytes) {
    for (unsigned n = 0; n < ESC_SMS; n++) {
        const struct sm sm = get_sm(esc, n);
        struct esc_buffer *b = &esc->buffers[n];
        /* The newest set is taken when its first byte is read, so that a set read in several
         * datagrams is whole. */
        if (touches(&sm, address, size_bytes) && sm.from_device && !sm.mailbox && b->fresh &&
            holds(address, size_bytes, sm.start)) {
            const uint32_t size = sm.length < b->size_bytes ? sm.length : b->size_bytes;
            if ((uint32_t)sm.start + size <= ESC_MEMORY_BYTES) {
                memcpy(esc->memory + sm.start, b->device, size);
            }
            b->fresh = false;
        }
    }
}

void esc_sm_after_read(struct esc *esc, uint16_t address, uint16_t size_bytes) {
    for (unsigned n = 0; n < ESC_SMS; n++) {
        const struct sm sm = get_sm(esc, n);
        if (touches(&sm, address, size_bytes) && sm.mailbox && sm.from_device &&
            holds(address, size_bytes, sm.start + sm.length - 1u)) {
            *status(esc, n) &= (uint8_t)~SM_FULL;
            esc_mailbox_out(esc);
        }
    }
}

static void outputs_written(struct esc *esc, unsigned number, const struct sm *sm) {
    struct esc_buffer *b = &esc->buffers[number];
    const uint8_t state = esc_state(esc);
    if (b->size_bytes == 0 || (state != AL_SAFEOP && state != AL_OP)) {
        return;
    }
    const uint32_t size = sm->length < b->size_bytes ? sm->length : b->size_bytes;
    if ((uint32_t)sm->start + size <= ESC_MEMORY_BYTES) {
        memcpy(b->device, esc->memory + sm->start, size);
    }
    b->fresh = true;
    esc->outputs_seen = true;
    esc->outputs_ns = esc->now_ns;
}

void esc_sm_after_write(struct esc *esc, uint16_t address, uint16_t size_bytes) {
    for (unsigned n = 0; n < ESC_SMS; n++) {
        const struct sm sm = get_sm(esc, n);
        if (!touches(&sm, address, size_bytes) || sm.from_device ||
            !holds(address, size_bytes, sm.start + sm.length - 1u)) {
            continue;
        }
        if (sm.mailbox) {
            *status(esc, n) |= SM_FULL;
            esc_mailbox_in(esc);
        } else {
            outputs_written(esc, n, &sm);
        }
    }
}

bool esc_sm_mailbox_ok(const struct esc *esc) {
    const struct sm in = get_sm(esc, 0);
    const struct sm out = get_sm(esc, 1);
    return in.enabled && in.mailbox && !in.from_device && in.length >= 16 &&
           in.length <= ESC_MAILBOX_BYTES && out.enabled && out.mailbox && out.from_device &&
           out.length >= 16 && out.length <= ESC_MAILBOX_BYTES;
}

bool esc_sm_process_data_ok(const struct esc *esc, bool outputs) {
    for (unsigned n = 0; n < ESC_SMS; n++) {
        const struct sm sm = get_sm(esc, n);
        const struct esc_buffer *b = &esc->buffers[n];
        if (b->size_bytes > 0 && sm.from_device != outputs && sm.enabled &&
            sm.length != b->size_bytes) {
            return false;
        }
    }
    return true;
}
