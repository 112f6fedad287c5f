/** Sync managers: mailboxes that are full or empty, process data that are always complete. */
#include "segment/esc.h"

#include <string.h>

enum { SM_FULL = 0x08 };

static bool get_sm(const struct esc *esc, unsigned number, struct esc_sm *sm) {
    const uint8_t *r = esc->memory + REG_SM + 8 * number;
    *sm = (struct esc_sm){
        .start = fsn_get16(r),
        .length = fsn_get16(r + 2),
        .number = (uint8_t)number,
        .mailbox = (r[4] & 3) == 2,
        .from_device = (r[4] & 0x0C) == 0,
    };
    /* It guards process data memory only: registers stay accessible whatever is configured. */
    return (r[6] & 1) != 0 && sm->length > 0 && sm->start >= ESC_PROCESS_DATA;
}

void esc_sm_load(struct esc *esc) {
    esc->sm_count = 0;
    for (unsigned n = 0; n < ESC_SMS; n++) {
        esc->sm_count += get_sm(esc, n, &esc->sms[esc->sm_count]);
    }
    esc_fmmu_load(esc); /* their position in these */
}

static uint8_t *status(struct esc *esc, unsigned number) {
    return esc->memory + REG_SM + 8 * number + 5;
}

static bool touches(const struct esc_sm *sm, uint16_t address, uint16_t size_bytes) {
    return address < sm->start + sm->length && (uint32_t)address + size_bytes > sm->start;
}

static bool holds(uint16_t address, uint16_t size_bytes, uint32_t byte) {
    return byte >= address && byte < (uint32_t)address + size_bytes;
}

bool esc_sm_allows(const struct esc *esc, uint16_t address, uint16_t size_bytes, bool write) {
    if ((uint32_t)address + size_bytes <= ESC_PROCESS_DATA) {
        return true;
    }
    for (unsigned n = 0; n < esc->sm_count; n++) {
        const struct esc_sm *sm = &esc->sms[n];
        if (!touches(sm, address, size_bytes)) {
            continue;
        }
        if (write == sm->from_device) {
            return false; /* the device side */
        }
        const bool full = (esc->memory[REG_SM + 8 * sm->number + 5] & SM_FULL) != 0;
        if (sm->mailbox && full != sm->from_device) {
            return false; /* written while full, or read while empty */
        }
    }
    return true;
}

void esc_sm_take_inputs(struct esc *esc, const struct esc_sm *sm) {
    struct esc_buffer *b = &esc->buffers[sm->number];
    if (b->fresh) {
        const uint32_t size = sm->length < b->size_bytes ? sm->length : b->size_bytes;
        if ((uint32_t)sm->start + size <= ESC_MEMORY_BYTES) {
            memcpy(esc->memory + sm->start, b->device, size);
        }
        b->fresh = false;
    }
}

void esc_sm_before_read(struct esc *esc, uint16_t address, uint16_t size_bytes) {
    for (unsigned n = 0; n < esc->sm_count; n++) {
        const struct esc_sm *sm = &esc->sms[n];
        /* The newest set is copied when its first byte is read, so that a set read in several
         * datagrams is complete. */
        if (sm->from_device && !sm->mailbox && holds(address, size_bytes, sm->start)) {
            esc_sm_take_inputs(esc, sm);
        }
    }
}

void esc_sm_after_read(struct esc *esc, uint16_t address, uint16_t size_bytes) {
    for (unsigned n = 0; n < esc->sm_count; n++) {
        const struct esc_sm *sm = &esc->sms[n];
        if (sm->mailbox && sm->from_device &&
            holds(address, size_bytes, sm->start + sm->length - 1u)) {
            *status(esc, sm->number) &= (uint8_t)~SM_FULL;
            esc_mailbox_out(esc);
        }
    }
}

void esc_sm_give_outputs(struct esc *esc, const struct esc_sm *sm) {
    struct esc_buffer *b = &esc->buffers[sm->number];
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
    esc_clock_outputs(esc);
}

void esc_sm_after_write(struct esc *esc, uint16_t address, uint16_t size_bytes) {
    for (unsigned n = 0; n < esc->sm_count; n++) {
        const struct esc_sm *sm = &esc->sms[n];
        if (sm->from_device || !holds(address, size_bytes, sm->start + sm->length - 1u)) {
            continue;
        }
        if (sm->mailbox) {
            *status(esc, sm->number) |= SM_FULL;
            esc_mailbox_in(esc);
        } else {
            esc_sm_give_outputs(esc, sm);
        }
    }
}

static bool is_mailbox(const struct esc *esc, unsigned number, bool from_device) {
    struct esc_sm sm;
    return get_sm(esc, number, &sm) && sm.mailbox && sm.from_device == from_device &&
           sm.length >= 16 && sm.length <= ESC_MAILBOX_BYTES;
}

bool esc_sm_mailbox_ok(const struct esc *esc) {
    return is_mailbox(esc, 0, false) && is_mailbox(esc, 1, true);
}

bool esc_sm_process_data_ok(const struct esc *esc, bool outputs) {
    for (unsigned n = 0; n < esc->sm_count; n++) {
        const struct esc_sm *sm = &esc->sms[n];
        const struct esc_buffer *b = &esc->buffers[sm->number];
        if (b->size_bytes > 0 && sm->from_device != outputs && sm->length != b->size_bytes) {
            return false;
        }
    }
    return true;
}
