/** Cables and ports: the SubDevices that a frame reaches, and their reports about neighbours. */
#include "segment/segment_internal.h"

enum {
    PORTS_USED = 2, /**< every SubDevice here has an entry, port 0, and an exit, port 1 */
    PDI_OPERATIONAL = 0x01,
};

void esc_count(uint8_t *counter, uint32_t more) {
    /* mutants: where both sides meet they are the same */
    *counter = (uint8_t)(more < 255u - *counter ? *counter + more : 255u);
}

static bool is_powered(const struct fsn_segment *s, uint32_t place) {
    return s->present[s->order[place]];
}

/** A group is connected to a junction: without it, the path is as if its place did not exist. */
static bool is_passed(const struct fsn_segment *s, uint32_t place) {
    return is_powered(s, place) || s->optional[s->order[place]];
}

/** Whether the cable before a place carries a link; the one after the last place ends at the second
 *  port of the MainDevice. */
static bool is_up(const struct fsn_segment *s, uint32_t cable) {
    const bool is_first = cable == 0;
    const bool is_last = cable == s->count;
    if (s->cut[cable] || (is_first && s->unplugged[0]) ||
        (is_last && (s->unplugged[1] || !s->ring))) {
        return false;
    }
    return (is_first || is_passed(s, cable - 1)) && (is_last || is_passed(s, cable));
}

/** Whether a device is linked before a place, or after it, ignoring absent devices. */
static bool is_linked(const struct fsn_segment *s, uint32_t place, bool behind) {
    uint32_t cable = behind ? place + 1 : place;
    while (is_up(s, cable)) {
        if (cable == (behind ? s->count : 0)) {
            return true;
        }
        if (is_powered(s, behind ? cable : cable - 1)) {
            return true;
        }
        cable = behind ? cable + 1 : cable - 1;
    }
    return false;
}

/** DL status: link, open loop and signal of ports 0 and 1; 2 and 3 are closed. */
static uint16_t dl_status(unsigned ports) {
    unsigned value = PDI_OPERATIONAL | ports << 4;
    for (unsigned p = 0; p < ESC_PORTS; p++) {
        value |= ((ports >> p & 1u) != 0 ? 2u : 1u) << (8 + 2 * p);
    }
    return (uint16_t)value;
}

static void show_ports(struct esc *esc, uint8_t ports) {
    for (unsigned p = 0; p < PORTS_USED; p++) {
        if ((esc->ports >> p & 1) != 0 && (ports >> p & 1) == 0) {
            esc_count(esc->memory + REG_LOST_LINK + p, 1);
        }
    }
    esc->ports = ports;
    fsn_put16(esc->memory + REG_DL_STATUS, dl_status(ports));
}

void segment_rewire(struct fsn_segment *s) {
    s->from_first = 0;
    while (s->from_first < s->count && is_up(s, s->from_first)) {
        s->from_first++;
    }
    s->from_last = 0;
    while (s->from_last < s->count && is_up(s, s->count - s->from_last)) {
        s->from_last++;
    }
    s->closed = s->from_first == s->count && is_up(s, s->count);
    for (uint32_t place = 0; place < s->count; place++) {
        const unsigned before = is_linked(s, place, false) ? 1u : 0u;
        const unsigned behind = is_linked(s, place, true) ? 2u : 0u;
        struct esc *esc = &s->escs[s->order[place]];
        if (is_powered(s, place)) {
            show_ports(esc, (uint8_t)(before | behind));
        } else {
            esc->ports = 0;
        }
    }
}

static void switch_device(struct fsn_segment *s, uint32_t position, bool on) {
    if (on) {
        esc_power_on(&s->escs[position]);
    }
    s->present[position] = on;
    segment_rewire(s);
}

void fsn_segment_set_present(struct fsn_segment *s, uint32_t position, bool present) {
    pthread_mutex_lock(&s->lock);
    if (position < s->count && s->present[position] != present) {
        switch_device(s, position, present);
    }
    pthread_mutex_unlock(&s->lock);
}

void fsn_segment_power_cycle(struct fsn_segment *s, uint32_t position) {
    pthread_mutex_lock(&s->lock);
    if (position < s->count && s->present[position]) {
        switch_device(s, position, false);
        switch_device(s, position, true);
    }
    pthread_mutex_unlock(&s->lock);
}

static uint32_t place_of(const struct fsn_segment *s, uint32_t position) {
    uint32_t place = 0;
    while (s->order[place] != position) {
        place++;
    }
    return place;
}

fsn_status fsn_segment_swap(struct fsn_segment *s, uint32_t one, uint32_t other) {
    if (one >= s->count || other >= s->count || one == other) {
        return FSN_E_ARG;
    }
    pthread_mutex_lock(&s->lock);
    const uint32_t pair[2] = {one, other};
    bool was_on[2];
    for (int i = 0; i < 2; i++) {
        was_on[i] = s->present[pair[i]];
        s->present[pair[i]] = false;
    }
    segment_rewire(s);
    const uint32_t place = place_of(s, one);
    s->order[place_of(s, other)] = one;
    s->order[place] = other;
    for (int i = 0; i < 2; i++) {
        if (was_on[i]) {
            switch_device(s, pair[i], true);
        }
    }
    pthread_mutex_unlock(&s->lock);
    return FSN_OK;
}

fsn_status fsn_segment_set_link(struct fsn_segment *s, uint32_t position, bool up) {
    pthread_mutex_lock(&s->lock);
    const bool exists = position == FSN_NONE || position < s->count;
    if (exists) {
        s->cut[position == FSN_NONE ? 0 : position + 1] = !up;
        segment_rewire(s);
    }
    pthread_mutex_unlock(&s->lock);
    return exists ? FSN_OK : FSN_E_ARG;
}

void fsn_segment_set_ring(struct fsn_segment *s, bool ring) {
    pthread_mutex_lock(&s->lock);
    s->ring = ring;
    segment_rewire(s);
    pthread_mutex_unlock(&s->lock);
}

void segment_plug(struct fsn_segment *s, bool first, bool second) {
    pthread_mutex_lock(&s->lock);
    if (s->unplugged[0] == first || s->unplugged[1] == second) {
        s->unplugged[0] = !first;
        s->unplugged[1] = !second;
        segment_rewire(s);
    }
    pthread_mutex_unlock(&s->lock);
}

fsn_status fsn_segment_rx_errors(struct fsn_segment *s, uint32_t position, uint32_t port,
                                 uint32_t errors) {
    pthread_mutex_lock(&s->lock);
    const bool exists = position < s->count && port < PORTS_USED;
    if (exists) {
        struct esc *esc = &s->escs[position];
        esc_count(esc->memory + REG_RX_ERRORS + 2 * port, errors);     /* frames */
        esc_count(esc->memory + REG_RX_ERRORS + 2 * port + 1, errors); /* symbols */
        bool behind = false;
        for (uint32_t place = 0; place < s->count; place++) {
            if (behind && is_powered(s, place)) {
                esc_count(s->escs[s->order[place]].memory + REG_FORWARDED_ERRORS, errors);
            }
            behind = (behind || s->order[place] == position) && is_up(s, place + 1);
        }
    }
    pthread_mutex_unlock(&s->lock);
    return exists ? FSN_OK : FSN_E_ARG;
}
