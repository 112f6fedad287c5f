/** SubDevices in a row: frames pass through all reachable ones, and return. */
#include "segment/segment_internal.h"

enum {
    MAC_BYTES = 12,
    FRAME_HEAD = 16, /**< Ethernet and EtherCAT header */
    DATAGRAM_HEAD = 10,
    MAX_DATA = 1500,
};

enum { CMD_APWR = 2, CMD_FPWR = 5, CMD_BWR = 8, CMD_LRD = 10, CMD_LRW = 12 };

/** Places that process a frame, from first to the one before end, and its arrival time at the
 *  first. */
struct span {
    uint32_t first, end;
    uint64_t now_ns;
};

static struct esc *esc_at(struct fsn_segment *s, uint32_t place) {
    return &s->escs[s->order[place]];
}

static bool is_there(const struct fsn_segment *s, uint32_t place) {
    return s->present[s->order[place]];
}

/** Time that a frame needs to pass some places. */
static uint64_t way_ns(struct fsn_segment *s, uint32_t first, uint32_t end) {
    uint64_t sum = 0;
    for (uint32_t place = first; place < end; place++) {
        sum += is_there(s, place) ? esc_at(s, place)->clock.forward_ns : 0;
    }
    return sum;
}

static void latch(struct fsn_segment *s, const struct span *span) {
    const uint64_t turns = span->now_ns + way_ns(s, span->first, span->end);
    uint64_t arrival = span->now_ns;
    for (uint32_t place = span->first; place < span->end; place++) {
        struct esc *esc = esc_at(s, place);
        if (is_there(s, place)) {
            esc_latch_times(esc, arrival, turns + (turns - arrival));
            arrival += esc->clock.forward_ns;
        }
    }
}

static bool latches_times(const struct datagram *d) {
    return d->offset <= REG_DC_RECEIVE && d->offset + d->size_bytes > REG_DC_RECEIVE &&
           (d->command == CMD_BWR || d->command == CMD_APWR || d->command == CMD_FPWR);
}

static bool pass_datagram(struct fsn_segment *s, const struct span *span, uint8_t *at, size_t len,
                          bool *more, size_t *used) {
    if (len < DATAGRAM_HEAD + 2) {
        return false;
    }
    const uint16_t flags = fsn_get16(at + 6);
    const uint16_t size = flags & 0x07FF;
    *more = (flags & 0x8000) != 0;
    *used = (size_t)DATAGRAM_HEAD + size + 2;
    if (*used > len || size > MAX_DATA) {
        return false;
    }
    struct datagram d = {
        .command = at[0],
        .position = fsn_get16(at + 2),
        .offset = fsn_get16(at + 4),
        .data = at + DATAGRAM_HEAD,
        .size_bytes = size,
        .counter = fsn_get16(at + DATAGRAM_HEAD + size),
    };
    uint64_t arrival = span->now_ns;
    for (uint32_t place = span->first; place < span->end; place++) {
        struct esc *esc = esc_at(s, place);
        if (is_there(s, place)) {
            esc->now_ns = arrival;
            arrival += esc->clock.forward_ns;
            esc_pass(esc, &d);
        }
    }
    if (latches_times(&d)) {
        latch(s, span);
    }
    if (d.command < CMD_LRD || d.command > CMD_LRW) {
        fsn_put16(at + 2, d.position);
    }
    fsn_put16(at + DATAGRAM_HEAD + size, d.counter);
    s->counts.datagrams++;
    return true;
}

static bool pass_datagrams(struct fsn_segment *s, const struct span *span, uint8_t *frame,
                           size_t len) {
    size_t left = fsn_get16(frame + MAC_BYTES + 2) & 0x07FF;
    if (left > len - FRAME_HEAD) {
        return false;
    }
    uint8_t *at = frame + FRAME_HEAD;
    for (bool more = true; more;) {
        size_t used;
        if (!pass_datagram(s, span, at, left, &more, &used)) {
            return false;
        }
        at += used;
        left -= used;
    }
    for (uint32_t place = span->first; place < span->end; place++) {
        esc_idle(esc_at(s, place), span->now_ns);
    }
    frame[6] |= 2; /* the first controller marks the source address */
    return true;
}

static bool is_ethercat(const uint8_t *frame, size_t len) {
    return len >= FRAME_HEAD && frame[MAC_BYTES] == 0x88 && frame[MAC_BYTES + 1] == 0xA4 &&
           fsn_get16(frame + MAC_BYTES + 2) >> 12 == 1;
}

static bool is_lost(struct fsn_segment *s) {
    if (s->lose > 0) {
        s->lose--;
        return true;
    }
    if (s->lose_every > 0 && --s->until_lost == 0) {
        s->until_lost = s->lose_every;
        return true;
    }
    return false;
}

/** Whether a frame passes at all; a lost one is counted. */
static bool is_taken(struct fsn_segment *s, uint32_t port, const uint8_t *frame, size_t len) {
    if (!is_ethercat(frame, len)) {
        s->counts.foreign++;
        return false;
    }
    if (is_lost(s)) {
        s->counts.lost++;
        return false;
    }
    return (port == 0 ? s->from_first : s->from_last) > 0;
}

/** Controllers process frames that enter at port 0, whatever their origin. In a closed ring, only
 *  frames from the first port of the MainDevice do. At a gap, the last half returns a frame, so it
 *  passes twice and is processed on the way out. */
static struct span span_of(struct fsn_segment *s, uint32_t port, uint64_t now_ns) {
    if (port == 0) {
        return (struct span){.end = s->from_first, .now_ns = now_ns};
    }
    const uint64_t inwards_ns = way_ns(s, s->count - s->from_last, s->count);
    return (struct span){
        .first = s->closed ? s->count : s->count - s->from_last,
        .end = s->count,
        .now_ns = now_ns + inwards_ns,
    };
}

static size_t pass_frame(struct fsn_segment *s, uint32_t port, uint8_t *frame, size_t len,
                         uint64_t now_ns, uint32_t *out_port) {
    if (!is_taken(s, port, frame, len)) {
        return 0;
    }
    const struct span span = span_of(s, port, now_ns);
    if (span.first < span.end && !pass_datagrams(s, &span, frame, len)) {
        s->counts.foreign++;
        return 0;
    }
    *out_port = s->closed ? 1 - port : port;
    s->counts.frames++;
    return len;
}

size_t segment_pass(struct fsn_segment *s, uint32_t port, uint8_t *frame, size_t len,
                    uint64_t now_ns, uint32_t *out_port) {
    s->last_ns = now_ns > s->last_ns ? now_ns : s->last_ns;
    *out_port = port;
    const bool is_cabled = port == 0 || (port == 1 && s->ring);
    return is_cabled ? pass_frame(s, port, frame, len, s->last_ns, out_port) : 0;
}

size_t fsn_segment_frame_from(struct fsn_segment *s, uint32_t port, uint8_t *frame,
                              size_t len_bytes, uint64_t now_ns, uint32_t *out_port) {
    uint32_t out;
    pthread_mutex_lock(&s->lock);
    const size_t answer = segment_pass(s, port, frame, len_bytes, now_ns, &out);
    pthread_mutex_unlock(&s->lock);
    if (out_port != NULL) {
        *out_port = out;
    }
    return answer;
}

size_t fsn_segment_frame(struct fsn_segment *s, uint8_t *frame, size_t len_bytes, uint64_t now_ns) {
    return fsn_segment_frame_from(s, 0, frame, len_bytes, now_ns, NULL);
}

void fsn_segment_idle(struct fsn_segment *s, uint64_t now_ns) {
    pthread_mutex_lock(&s->lock);
    s->last_ns = now_ns > s->last_ns ? now_ns : s->last_ns;
    for (uint32_t p = 0; p < s->count; p++) {
        if (s->present[p]) {
            esc_idle(&s->escs[p], s->last_ns);
        }
    }
    pthread_mutex_unlock(&s->lock);
}
