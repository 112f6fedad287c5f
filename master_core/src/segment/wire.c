/** The wire between MainDevice and segment: frames that are late, held, or repeated. */
#include <string.h>

#include "segment/segment_internal.h"

static void begin_stall(struct wire *w, uint64_t now_ns) {
    if (w->stall_ns > 0) {
        w->stalled_until_ns = now_ns + w->stall_ns;
        w->stall_ns = 0;
    }
}

/** Time at which the first held frame may pass; UINT64_MAX: no such frame. */
static uint64_t due(const struct wire *w) {
    if (w->count == 0) {
        return UINT64_MAX;
    }
    const uint64_t head_ns = w->held[w->first].due_ns;
    return head_ns > w->stalled_until_ns ? head_ns : w->stalled_until_ns;
}

void fsn_segment_send(struct fsn_segment *s, uint32_t port, const uint8_t *frame, size_t len_bytes,
                      uint64_t now_ns) {
    pthread_mutex_lock(&s->lock);
    struct wire *w = s->wire;
    begin_stall(w, now_ns);
    if (len_bytes > WIRE_BYTES) {
        s->counts.foreign++;
    } else if (w->count == WIRE_FRAMES) {
        s->counts.lost++;
    } else {
        w->first = w->count == 0 ? 0 : w->first; /* reuse memory that is in the cache */
        struct held *h = &w->held[(w->first + w->count++) % WIRE_FRAMES];
        h->due_ns = now_ns + w->delay_ns;
        h->port = port;
        h->size_bytes = (uint16_t)len_bytes;
        memcpy(h->bytes, frame, len_bytes);
    }
    pthread_mutex_unlock(&s->lock);
}

/** Stores the first answer after a repetition was requested; it is due again after the following
 *  ones. */
static void remember(struct wire *w, const uint8_t *frame, size_t len, uint32_t port) {
    if (w->repeat == 0) {
        return;
    }
    if (w->old_bytes == 0) {
        memcpy(w->old, frame, len);
        w->old_bytes = len;
        w->old_port = port;
        return;
    }
    w->repeat--;
    w->again = true;
}

static size_t next(struct fsn_segment *s, uint8_t *frame, uint64_t now_ns, uint32_t *port) {
    struct wire *w = s->wire;
    if (w->again) {
        w->again = false;
        memcpy(frame, w->old, w->old_bytes);
        *port = w->old_port;
        return w->old_bytes;
    }
    while (due(w) <= now_ns) {
        struct held *h = &w->held[w->first];
        w->first = (w->first + 1) % WIRE_FRAMES;
        w->count--;
        const size_t len = segment_pass(s, h->port, h->bytes, h->size_bytes, now_ns, port);
        if (len > 0) {
            memcpy(frame, h->bytes, len);
            remember(w, frame, len, *port);
            return len;
        }
    }
    return 0;
}

size_t fsn_segment_receive(struct fsn_segment *s, uint8_t *frame, size_t room_bytes,
                           uint64_t now_ns, uint32_t *port) {
    if (room_bytes < WIRE_BYTES) {
        return 0;
    }
    uint32_t out = 0;
    pthread_mutex_lock(&s->lock);
    begin_stall(s->wire, now_ns);
    const size_t len = next(s, frame, now_ns, &out);
    pthread_mutex_unlock(&s->lock);
    if (port != NULL) {
        *port = out;
    }
    return len;
}

uint64_t fsn_segment_wait(struct fsn_segment *s, uint64_t now_ns) {
    pthread_mutex_lock(&s->lock);
    begin_stall(s->wire, now_ns);
    const uint64_t at_ns = s->wire->again ? now_ns : due(s->wire);
    pthread_mutex_unlock(&s->lock);
    if (at_ns == UINT64_MAX) {
        return UINT64_MAX;
    }
    return at_ns > now_ns ? at_ns - now_ns : 0;
}
