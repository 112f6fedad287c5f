/** Faults that a test sets in a segment, until it clears them. */
#include <string.h>

#include "segment/segment_internal.h"

enum { MAX_OBJECT_BYTES = 1024 };
static const uint64_t MAX_DELAY_NS = 3600000000000u;

static uint64_t bounded(uint64_t delay_ns) {
    return delay_ns < MAX_DELAY_NS ? delay_ns : MAX_DELAY_NS;
}

/** Locks, and returns the SubDevice at a position if an argument is valid; NULL, unlocked, if not.
 */
static struct esc *hold(struct fsn_segment *s, uint32_t position, bool valid) {
    if (!valid || position >= s->count) {
        return NULL;
    }
    pthread_mutex_lock(&s->lock);
    return &s->escs[position];
}

static fsn_status release(struct fsn_segment *s, fsn_status status) {
    pthread_mutex_unlock(&s->lock);
    return status;
}

fsn_status fsn_segment_set_identity(struct fsn_segment *s, uint32_t position,
                                    const struct fsn_segment_identity *identity) {
    struct esc *esc = hold(s, position, true);
    if (esc == NULL) {
        return FSN_E_ARG;
    }
    esc->faults.is_other = identity != NULL;
    if (identity != NULL) {
        esc->faults.other = (struct esc_identity){
            {identity->vendor_id, identity->product_code, identity->revision}};
    }
    return release(s, FSN_OK);
}

static bool set_abort(struct esc_faults *f, uint16_t index, uint32_t sub, uint32_t code) {
    uint32_t at = 0;
    while (at < f->abort_count && (f->aborts[at].index != index || f->aborts[at].sub != sub)) {
        at++;
    }
    if (code == 0) {
        if (at < f->abort_count) {
            f->aborts[at] = f->aborts[--f->abort_count];
        }
        return true;
    }
    if (at == ESC_ABORTS) {
        return false;
    }
    f->abort_count += at == f->abort_count;
    f->aborts[at] = (struct esc_abort){.index = index, .sub = sub, .code = code};
    return true;
}

fsn_status fsn_segment_set_sdo_abort(struct fsn_segment *s, uint32_t position, uint16_t index,
                                     uint32_t sub, uint32_t code) {
    struct esc *esc = hold(s, position, sub <= 255 || sub == FSN_NONE);
    if (esc == NULL) {
        return FSN_E_ARG;
    }
    const bool ok = set_abort(&esc->faults, index, sub, code);
    return release(s, ok ? FSN_OK : FSN_E_NOMEM);
}

fsn_status fsn_segment_set_mailbox_delay(struct fsn_segment *s, uint32_t position,
                                         uint64_t delay_ns) {
    struct esc *esc = hold(s, position, true);
    if (esc == NULL) {
        return FSN_E_ARG;
    }
    esc->faults.mailbox_delay_ns = bounded(delay_ns);
    return release(s, FSN_OK);
}

fsn_status fsn_segment_set_al_delay(struct fsn_segment *s, uint32_t position, uint64_t delay_ns) {
    struct esc *esc = hold(s, position, true);
    if (esc == NULL) {
        return FSN_E_ARG;
    }
    esc->faults.al_delay_ns = bounded(delay_ns);
    return release(s, FSN_OK);
}

fsn_status fsn_segment_set_clock(struct fsn_segment *s, uint32_t position,
                                 const struct fsn_segment_clock *clock) {
    enum { FASTEST_PPB = 1000000 };
    const bool ok =
        clock != NULL && clock->drift_ppb < FASTEST_PPB && clock->drift_ppb > -FASTEST_PPB;
    struct esc *esc = hold(s, position, ok);
    if (esc == NULL) {
        return FSN_E_ARG;
    }
    esc->clock = (struct esc_clock){.absent = clock->absent,
                                    .deaf = clock->deaf,
                                    .narrow = esc->clock.narrow,
                                    .forward_ns = clock->forward_ns,
                                    .offset_ns = clock->offset_ns,
                                    .drift_ppb = clock->drift_ppb};
    memset(esc->memory + REG_DC_TIME, 0, REG_DC_END - REG_DC_TIME);
    esc_clock_reset(esc, true);
    return release(s, FSN_OK);
}

fsn_status fsn_segment_set_clock_bits(struct fsn_segment *s, uint32_t position, uint32_t bits) {
    struct esc *esc = hold(s, position, bits == 32 || bits == 64);
    if (esc == NULL) {
        return FSN_E_ARG;
    }
    esc->clock.narrow = bits == 32;
    esc_clock_limit(esc);
    return release(s, FSN_OK);
}

fsn_status fsn_segment_next_pulse(struct fsn_segment *s, uint32_t position, uint64_t *time_ns) {
    struct esc *esc = hold(s, position, time_ns != NULL);
    if (esc == NULL) {
        return FSN_E_ARG;
    }
    const uint64_t left_ns = esc_clock_until_pulse(esc);
    *time_ns = esc->now_ns + left_ns;
    return release(s, left_ns != UINT64_MAX ? FSN_OK : FSN_E_STATE);
}

static fsn_status put_object(struct fsn_segment *s, uint32_t position, uint16_t index, uint8_t sub,
                             const void *bytes, size_t len_bytes, bool writable) {
    struct esc *esc = hold(s, position, len_bytes <= MAX_OBJECT_BYTES && bytes != NULL);
    if (esc == NULL) {
        return FSN_E_ARG;
    }
    const bool ok = objects_put(&esc->objects, index, sub, writable, bytes, (uint32_t)len_bytes);
    return release(s, ok ? FSN_OK : FSN_E_ARG);
}

fsn_status fsn_segment_set_object(struct fsn_segment *s, uint32_t position, uint16_t index,
                                  uint8_t sub, const void *bytes, size_t len_bytes) {
    return put_object(s, position, index, sub, bytes, len_bytes, false);
}

fsn_status fsn_segment_offer_object(struct fsn_segment *s, uint32_t position, uint16_t index,
                                    uint8_t sub, const void *bytes, size_t len_bytes) {
    return put_object(s, position, index, sub, bytes, len_bytes, true);
}

fsn_status fsn_segment_get_object(struct fsn_segment *s, uint32_t position, uint16_t index,
                                  uint8_t sub, void *bytes, size_t len_bytes) {
    struct esc *esc = hold(s, position, bytes != NULL);
    if (esc == NULL) {
        return FSN_E_ARG;
    }
    const struct object *object = objects_find(&esc->objects, index, sub);
    const bool ok = object != NULL && object->size_bytes == len_bytes;
    if (ok) {
        memcpy(bytes, objects_value(&esc->objects, object), len_bytes);
    }
    return release(s, ok ? FSN_OK : FSN_E_ARG);
}

void fsn_segment_lose(struct fsn_segment *s, uint32_t frames) {
    pthread_mutex_lock(&s->lock);
    s->lose = frames;
    pthread_mutex_unlock(&s->lock);
}

void fsn_segment_lose_every(struct fsn_segment *s, uint32_t frames) {
    pthread_mutex_lock(&s->lock);
    s->lose_every = frames;
    s->until_lost = frames;
    pthread_mutex_unlock(&s->lock);
}

void fsn_segment_set_delay(struct fsn_segment *s, uint64_t delay_ns) {
    pthread_mutex_lock(&s->lock);
    s->wire->delay_ns = bounded(delay_ns);
    pthread_mutex_unlock(&s->lock);
}

void fsn_segment_stall(struct fsn_segment *s, uint64_t duration_ns) {
    pthread_mutex_lock(&s->lock);
    s->wire->stall_ns = bounded(duration_ns);
    pthread_mutex_unlock(&s->lock);
}

void fsn_segment_repeat(struct fsn_segment *s, uint32_t frames) {
    pthread_mutex_lock(&s->lock);
    s->wire->repeat = frames;
    s->wire->old_bytes = 0;
    pthread_mutex_unlock(&s->lock);
}
