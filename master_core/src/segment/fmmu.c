/** FMMUs: logical addresses to memory, bit by bit. */
#include "segment/esc.h"

#include <string.h>

enum { CMD_LRD = 10, CMD_LWR = 11, CMD_LRW = 12 };

static bool get_fmmu(const struct esc *esc, unsigned number, struct esc_fmmu *fmmu) {
    const uint8_t *r = esc->memory + REG_FMMU + 16 * number;
    *fmmu = (struct esc_fmmu){
        .logical = fsn_get32(r),
        .length = fsn_get16(r + 4),
        .start_bit = r[6] & 7,
        .end_bit = r[7] & 7,
        .physical = fsn_get16(r + 8),
        .physical_bit = r[10] & 7,
        .read = (r[11] & 1) != 0,
        .write = (r[11] & 2) != 0,
    };
    fmmu->whole_bytes = fmmu->start_bit == 0 && fmmu->end_bit == 7 && fmmu->physical_bit == 0;
    const bool any = fmmu->length > 1 || (fmmu->length == 1 && fmmu->start_bit <= fmmu->end_bit);
    return (r[12] & 1) != 0 && any;
}

/** The only sync manager in the range of an FMMU, if access is always allowed: it contains process
 *  data, and the FMMU has the same direction. */
static uint8_t inside(const struct esc *esc, const struct esc_fmmu *f) {
    const uint32_t end = (uint32_t)f->physical + f->length;
    uint8_t found = 0;
    for (uint8_t n = 0; n < esc->sm_count; n++) {
        const struct esc_sm *sm = &esc->sms[n];
        const uint32_t sm_end = (uint32_t)sm->start + sm->length;
        if (f->physical >= sm_end || end <= sm->start) {
            continue;
        }
        /* An FMMU across two sync managers, or across a mailbox, does not work in any device. */
        if (found != 0 || sm->mailbox || f->physical < sm->start || end > sm_end) {
            return 0;
        }
        found = (uint8_t)(n + 1);
    }
    const bool one_way =
        found != 0 && f->read != f->write && f->read == esc->sms[found - 1].from_device;
    return one_way && f->whole_bytes && end <= ESC_MEMORY_BYTES ? found : 0;
}

void esc_fmmu_load(struct esc *esc) {
    esc->fmmu_count = 0;
    esc->fmmu_begin = UINT32_MAX;
    esc->fmmu_end = 0;
    for (unsigned n = 0; n < ESC_FMMUS; n++) {
        struct esc_fmmu *f = &esc->fmmus[esc->fmmu_count];
        if (get_fmmu(esc, n, f)) {
            const uint64_t end = (uint64_t)f->logical + f->length;
            const uint32_t bounded = end < UINT32_MAX ? (uint32_t)end : UINT32_MAX;
            esc->fmmu_begin = f->logical < esc->fmmu_begin ? f->logical : esc->fmmu_begin;
            esc->fmmu_end = bounded > esc->fmmu_end ? bounded : esc->fmmu_end;
            f->inside = inside(esc, f);
            esc->fmmu_count++;
        }
    }
}

/** The part of a datagram that an FMMU maps: byte in the datagram, in the memory, and length. */
struct part {
    uint16_t in_datagram, address, length;
};

static bool overlap(const struct esc_fmmu *f, uint32_t logical, uint16_t size_bytes,
                    struct part *part) {
    const uint64_t begin = f->logical > logical ? f->logical : logical;
    const uint64_t f_end = (uint64_t)f->logical + f->length;
    const uint64_t d_end = (uint64_t)logical + size_bytes;
    const uint64_t end = f_end < d_end ? f_end : d_end;
    if (begin >= end) {
        return false;
    }
    part->in_datagram = (uint16_t)(begin - logical);
    part->address = (uint16_t)(f->physical + (begin - f->logical));
    part->length = (uint16_t)(end - begin);
    return true;
}

/** Number of bits of an FMMU that is not a multiple of bytes; at least one, see get_fmmu(). */
static uint32_t bit_count(const struct esc_fmmu *f) {
    return 8u * f->length - f->start_bit - (7u - f->end_bit);
}

/** Number of memory bytes of these bits; one access. */
static uint32_t byte_count(const struct esc_fmmu *f) {
    return (f->physical_bit + bit_count(f) + 7) / 8;
}

/** Whether bit `i` of an FMMU is in a datagram; then also which bit of it. */
static bool bit_of_datagram(const struct esc_fmmu *f, uint32_t i, uint32_t logical,
                            uint16_t size_bytes, uint32_t *at) {
    const uint64_t bit = 8u * (uint64_t)f->logical + f->start_bit + i;
    const uint64_t first = 8u * (uint64_t)logical;
    *at = (uint32_t)(bit - first);
    return bit >= first && bit < first + 8u * (uint64_t)size_bytes;
}

static bool read_bits(struct esc *esc, const struct esc_fmmu *f, uint32_t logical, uint8_t *data,
                      uint16_t size_bytes) {
    uint8_t bytes[64];
    const uint32_t needed = byte_count(f);
    if (needed > sizeof bytes || !esc_read(esc, f->physical, bytes, (uint16_t)needed, false)) {
        return false;
    }
    bool hit = false;
    for (uint32_t at, i = 0; i < bit_count(f); i++) {
        if (bit_of_datagram(f, i, logical, size_bytes, &at)) {
            fsn_write_bits(data, at, 1, fsn_read_bits(bytes, f->physical_bit + i, 1));
            hit = true;
        }
    }
    return hit;
}

static bool write_bits(struct esc *esc, const struct esc_fmmu *f, uint32_t logical,
                       const uint8_t *data, uint16_t size_bytes) {
    uint8_t bytes[64];
    const uint32_t needed = byte_count(f);
    if (needed > sizeof bytes || (uint32_t)f->physical + needed > ESC_MEMORY_BYTES) {
        return false;
    }
    memcpy(bytes, esc->memory + f->physical, needed);
    bool hit = false;
    for (uint32_t at, i = 0; i < bit_count(f); i++) {
        if (bit_of_datagram(f, i, logical, size_bytes, &at)) {
            fsn_write_bits(bytes, f->physical_bit + i, 1, fsn_read_bits(data, at, 1));
            hit = true;
        }
    }
    return hit && esc_write(esc, f->physical, bytes, (uint16_t)needed);
}

static bool write_part(struct esc *esc, const struct esc_fmmu *f, const struct part *p,
                       const struct datagram *d, uint32_t logical) {
    const uint8_t *from = d->data + p->in_datagram;
    if (f->inside == 0) {
        return f->whole_bytes ? esc_write(esc, p->address, from, p->length)
                              : write_bits(esc, f, logical, d->data, d->size_bytes);
    }
    const struct esc_sm *sm = &esc->sms[f->inside - 1];
    memcpy(esc->memory + p->address, from, p->length);
    if (p->address + p->length == sm->start + sm->length) {
        esc_sm_give_outputs(esc, sm);
    }
    return true;
}

static bool read_part(struct esc *esc, const struct esc_fmmu *f, const struct part *p,
                      const struct datagram *d, uint32_t logical) {
    uint8_t *to = d->data + p->in_datagram;
    if (f->inside == 0) {
        return f->whole_bytes ? esc_read(esc, p->address, to, p->length, false)
                              : read_bits(esc, f, logical, d->data, d->size_bytes);
    }
    const struct esc_sm *sm = &esc->sms[f->inside - 1];
    if (p->address == sm->start) {
        esc_sm_take_inputs(esc, sm);
    }
    memcpy(to, esc->memory + p->address, p->length);
    return true;
}

void esc_fmmu_pass(struct esc *esc, struct datagram *d) {
    const uint32_t logical = d->position | ((uint32_t)d->offset << 16);
    const bool wants_read = d->command != CMD_LWR;
    const bool wants_write = d->command != CMD_LRD;
    bool read = false;
    bool written = false;
    struct part p;
    if (logical > esc->fmmu_end || (uint64_t)logical + d->size_bytes <= esc->fmmu_begin) {
        return; /* no part of it is mapped here */
    }
    /* Writes first: inputs and outputs may share an address, and the received bytes are written. */
    for (unsigned i = 0; i < esc->fmmu_count && wants_write; i++) {
        const struct esc_fmmu *f = &esc->fmmus[i];
        if (f->write && overlap(f, logical, d->size_bytes, &p)) {
            written |= write_part(esc, f, &p, d, logical);
        }
    }
    for (unsigned i = 0; i < esc->fmmu_count && wants_read; i++) {
        const struct esc_fmmu *f = &esc->fmmus[i];
        if (f->read && overlap(f, logical, d->size_bytes, &p)) {
            read |= read_part(esc, f, &p, d, logical);
        }
    }
    /* Once per SubDevice and direction, whatever the number of FMMUs. */
    const uint16_t for_write = d->command == CMD_LRW ? 2 : 1;
    d->counter = (uint16_t)(d->counter + read + (written ? for_write : 0));
}
