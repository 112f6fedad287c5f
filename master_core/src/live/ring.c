#include "live/ring.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum {
    FEWEST_CYCLES = 4, /**< between two judgements */
    LOST_AFTER = 2,    /**< judgements */
    SILENT_AFTER = 10, /**< if no frame returns at all */
    NAME_BYTES = 40,   /**< of a SubDevice, in a place */
    ENTRY = 1,         /**< bit of port 0, where frames arrive */
};

/* -- ways ----------------------------------------------------------------------------------- */

bool fsn_ring_silent(const struct fsn_ring_watch *watch) {
    const struct fsn_ring_counts *c = &watch->since;
    return (c->came[0][0] | c->came[0][1] | c->came[1][0] | c->came[1][1]) == 0;
}

static void adopt(struct fsn_bus_ring *ring, uint8_t state) {
    const bool was_broken = ring->state == FSN_RING_OPEN || ring->state == FSN_RING_ONE_WAY;
    ring->breaks += !was_broken && state != FSN_RING_CLOSED;
    ring->state = state;
}

bool fsn_ring_judge(struct fsn_ring_watch *watch, const struct fsn_ring_counts *now,
                    bool both_linked) {
    struct fsn_ring_counts *since = &watch->since;
    if (now->sent - watch->last.sent < FEWEST_CYCLES) {
        return false;
    }
    since->sent = now->sent - watch->last.sent;
    for (unsigned sent = 0; sent < 2; sent++) {
        for (unsigned in = 0; in < 2; in++) {
            since->came[sent][in] = now->came[sent][in] - watch->last.came[sent][in];
        }
    }
    watch->last = *now;
    const uint8_t ways[2] = {since->came[0][1] > 0, since->came[1][0] > 0};
    const bool closed = ways[0] != 0 && ways[1] != 0;
    const uint32_t patience = fsn_ring_silent(watch) && both_linked ? SILENT_AFTER : LOST_AFTER;
    watch->bad = closed ? 0 : watch->bad + 1;
    if (closed || watch->bad >= patience) {
        memcpy(watch->ring.ways, ways, sizeof ways);
        static const uint8_t state[] = {FSN_RING_OPEN, FSN_RING_ONE_WAY, FSN_RING_CLOSED};
        adopt(&watch->ring, state[ways[0] + ways[1]]);
    }
    return true;
}

/* -- gaps ----------------------------------------------------------------------------------- */

struct text {
    char *bytes;
    size_t used;
};

/** Adds one gap, if there is room for all of it. */
__attribute__((format(printf, 2, 3))) static void add(struct text *text, const char *format, ...) {
    char gap[FSN_DETAIL_BYTES];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(gap, sizeof gap, format, arguments);
    va_end(arguments);
    const char *comma = text->used == 0 ? "" : "; ";
    if (text->used + strlen(comma) + strlen(gap) < FSN_DETAIL_BYTES) {
        text->used += (size_t)snprintf(text->bytes + text->used, FSN_DETAIL_BYTES - text->used,
                                       "%s%s", comma, gap);
    }
}

/** The first of its outgoing ports with a lost link; FSN_PORTS: none. */
static unsigned lost_exit(const struct fsn_ring_member *m) {
    unsigned port = 1;
    while (port < FSN_PORTS && (m->had & ~m->has & (1u << port)) == 0) {
        port++;
    }
    return m->answers ? port : (unsigned)FSN_PORTS;
}

/** The SubDevice before one whose entry has no link: the nearest that has also lost a link. If
 *  there is none, it is the neighbour, as on a line. */
static uint32_t in_front(const struct fsn_ring_member *members, uint32_t number) {
    uint32_t n = number;
    while (n > 0 && lost_exit(&members[n - 1]) == FSN_PORTS) {
        n--;
    }
    return n > 0 ? n - 1 : number - 1;
}

static const char *lost_link(const struct fsn_ring_end *end) {
    return end->link ? "" : " (no link)";
}

static void put_front(struct text *text, const struct fsn_ring_member *members, uint32_t number,
                      const struct fsn_ring_end *first) {
    const struct fsn_ring_member *m = &members[number];
    if (number == 0) {
        add(text, "between %s%s and %.*s (ring position 0, port 0)", first->interface,
            lost_link(first), NAME_BYTES, m->name);
        return;
    }
    const uint32_t front = in_front(members, number);
    const unsigned port = lost_exit(&members[front]);
    char at[24] = "";
    if (port < FSN_PORTS) {
        snprintf(at, sizeof at, ", port %u", port);
    }
    add(text, "between %.*s (ring position %u%s) and %.*s (ring position %u, port 0)", NAME_BYTES,
        members[front].name, (unsigned)front, at, NAME_BYTES, m->name, (unsigned)number);
}

/** Whether a link that a SubDevice has lost belongs to the cable of a later one. */
static bool is_named(const struct fsn_ring_member *members, uint32_t count, uint32_t number) {
    for (uint32_t later = number + 1; later < count; later++) {
        const struct fsn_ring_member *m = &members[later];
        if (!m->answers) {
            return later == number + 1;
        }
        if ((m->has & ENTRY) == 0) {
            return in_front(members, later) == number;
        }
    }
    return false;
}

static void put_behind(struct text *text, const struct fsn_ring_member *members, uint32_t count,
                       uint32_t number, const struct fsn_ring_end *last) {
    const struct fsn_ring_member *m = &members[number];
    const unsigned port = lost_exit(m);
    if (port == FSN_PORTS || is_named(members, count, number)) {
        return;
    }
    if (number + 1 == count) {
        add(text, "between %.*s (ring position %u, port %u) and %s%s", NAME_BYTES, m->name,
            (unsigned)number, port, last->interface, lost_link(last));
    } else {
        add(text, "after %.*s (ring position %u, port %u)", NAME_BYTES, m->name, (unsigned)number,
            port);
    }
}

/** No SubDevice reports a gap: the last cable was missing at the start, or frames are lost in one
 *  direction. */
static void put_rest(struct text *text, const struct fsn_ring_watch *watch, const char *last,
                     uint32_t count, const struct fsn_ring_end ends[2]) {
    const unsigned from = watch->ring.ways[0] != 0 ? 1 : 0;
    if (!ends[0].link) {
        add(text, "at %s, which has no link", ends[0].interface);
    } else if (!ends[1].link || watch->since.came[0][0] > 0) {
        add(text, "between %.*s (ring position %u) and %s%s", NAME_BYTES, last,
            (unsigned)(count - 1), ends[1].interface, lost_link(&ends[1]));
    } else if (fsn_ring_silent(watch)) {
        add(text, "no frame comes back at either interface");
    } else {
        add(text, "every link is up, but no frame from %s comes out at %s", ends[from].interface,
            ends[1 - from].interface);
    }
}

void fsn_ring_place(const struct fsn_ring_watch *watch, const struct fsn_ring_member *members,
                    uint32_t count, const struct fsn_ring_end ends[2],
                    char place[FSN_DETAIL_BYTES]) {
    struct text text = {.bytes = place};
    uint32_t answering = 0;
    place[0] = '\0';
    for (uint32_t n = 0; n < count; n++) {
        answering += members[n].answers;
    }
    if (answering == 0) {
        add(&text, "no SubDevice answers; %s has %s link, %s has %s", ends[0].interface,
            ends[0].link ? "a" : "no", ends[1].interface, ends[1].link ? "one" : "none");
        return;
    }
    for (uint32_t n = 0; n < count; n++) {
        const struct fsn_ring_member *m = &members[n];
        /* The first silent SubDevice marks the gap; the following ones are a consequence. */
        const bool after_silent = n > 0 && !members[n - 1].answers;
        if (!m->answers && !after_silent) {
            add(&text, "at %.*s (ring position %u), which does not answer", NAME_BYTES, m->name,
                (unsigned)n);
        } else if (m->answers && (m->has & ENTRY) == 0 && !after_silent) {
            put_front(&text, members, n, &ends[0]);
        }
        put_behind(&text, members, count, n, &ends[1]);
    }
    if (text.used == 0) {
        put_rest(&text, watch, members[count - 1].name, count, ends);
    }
}
