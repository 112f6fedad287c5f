/** Two places become a connection if their frames form one chain. */
#include "scan/scan.h"

#include <stdlib.h>
#include <string.h>

enum {
    LEAST_FRAMES = 4, /**< with a ConnID that each place must show before pairing is tried; one more
                         than LEAST_COPIES, because a copy may be ahead of its original */
    LEAST_RIGHT = 3,  /**< frames of each place, with a ConnID and matching CRCs: 2^-96 by chance */
    LEAST_COPIES = 3, /**< frames equal to those of a known place that identify a copy of it */
};

/** Frames of two places, merged by time. */
struct merged {
    const struct candidate *end[2]; /**< enum fsn_way */
    uint32_t left[2];
};

static struct merged merge(const struct candidate *main, const struct candidate *sub) {
    return (struct merged){.end = {main, sub},
                           .left = {scan_remembered(main), scan_remembered(sub)}};
}

/** Takes the older of the two next frames; NULL at the end. */
static const struct shown *take(struct merged *m, const struct fsn_monitor *monitor,
                                enum fsn_way *way) {
    const struct shown *next[2] = {NULL, NULL};
    for (unsigned i = 0; i < 2; i++) {
        next[i] = m->left[i] > 0 ? scan_shown(m->end[i], m->left[i] - 1) : NULL;
    }
    if (next[0] == NULL && next[1] == NULL) {
        return NULL;
    }
    bool sub_first = next[0] == NULL;
    if (next[0] != NULL && next[1] != NULL) {
        sub_first = next[0]->packet == next[1]->packet
                        ? fsn_monitor_sub_first(monitor, next[0]->bytes, next[1]->bytes)
                        : next[1]->packet < next[0]->packet;
    }
    *way = sub_first ? FSN_TO_MAIN : FSN_TO_SUB;
    m->left[*way]--;
    return next[*way];
}

/** Whether the frames of these places form one chain. */
static bool is_chain(const struct candidate *main, const struct candidate *sub,
                     struct fsn_monitor *monitor) {
    if (fsn_monitor_init(monitor, main->size_bytes, sub->size_bytes) != FSN_OK) {
        return false;
    }
    struct merged m = merge(main, sub);
    uint32_t right[2] = {0, 0};
    enum fsn_way way;
    for (const struct shown *s = take(&m, monitor, &way); s != NULL; s = take(&m, monitor, &way)) {
        const enum fsn_verdict verdict = fsn_monitor_frame(monitor, way, s->bytes, s->time_ns);
        if (verdict == FSN_VERDICT_WRONG) {
            return false;
        }
        right[way] += verdict == FSN_VERDICT_RIGHT &&
                      fsn_fsoe_connection_id(s->bytes, monitor->followed[way].size_bytes) != 0;
    }
    return right[0] >= LEAST_RIGHT && right[1] >= LEAST_RIGHT;
}

/** Whether a place has shown a Session frame that begins a chain: only a main sends these. */
static bool began_session(const struct candidate *c) {
    for (uint32_t back = 0; back < scan_remembered(c); back++) {
        const uint8_t *frame = scan_shown(c, back)->bytes;
        if (frame[0] == FSN_CMD_SESSION && fsn_fsoe_check(frame, c->size_bytes, 0, 1)) {
            return true;
        }
    }
    return false;
}

/** Without collisions, main and sub use the same number in an FSoE cycle. After a frame of the main
 *  its next number is therefore one ahead, otherwise they are equal. */
static bool numbers_say_swapped(const struct fsn_monitor *monitor) {
    const int ahead =
        monitor->followed[FSN_TO_SUB].sequence - monitor->followed[FSN_TO_MAIN].sequence;
    return ahead < (monitor->last_way == FSN_TO_SUB ? 1 : 0);
}

static void push(struct fsn_scan *scan, const struct fsn_sighting *sighting) {
    const uint32_t end = scan->queue_head + scan->queue_count;
    if (end == scan->queue_slots) {
        const uint32_t slots = scan->queue_slots == 0 ? 64 : 2 * scan->queue_slots;
        struct fsn_sighting *queue = realloc(scan->queue, slots * sizeof *queue);
        if (queue == NULL) {
            scan->counts.dropped++;
            return;
        }
        scan->queue = queue;
        scan->queue_slots = slots;
    }
    scan->queue[end] = *sighting;
    scan->queue_count++;
}

/** Passes one frame to the monitor of a connection and queues it. */
static void follow(struct fsn_scan *scan, uint32_t connection, enum fsn_way way,
                   const struct shown *shown) {
    struct fsn_monitor *monitor = &scan->found[connection].monitor;
    const enum fsn_verdict verdict = fsn_monitor_frame(monitor, way, shown->bytes, shown->time_ns);
    if (verdict == FSN_VERDICT_SAME) {
        return;
    }
    const uint16_t next = monitor->followed[way].sequence;
    const uint32_t size_bytes = monitor->followed[way].size_bytes;
    const bool numbered = verdict == FSN_VERDICT_RIGHT && shown->bytes[0] != FSN_CMD_RESET;
    struct fsn_sighting sighting = {
        .time_ns = shown->time_ns,
        .packet = shown->packet,
        .connection = connection,
        .size_bytes = (uint16_t)size_bytes,
        .way = (uint8_t)way,
        .verdict = (uint8_t)verdict,
        .observed = (uint8_t)monitor->status.observed,
    };
    if (numbered) {
        sighting.sequence = next == 1 ? 0xFFFF : (uint16_t)(next - 1);
    }
    memcpy(sighting.frame, shown->bytes, size_bytes);
    push(scan, &sighting);
}

static bool is_locked(const struct fsn_monitor *monitor) {
    return monitor->followed[0].sequence != 0 && monitor->followed[1].sequence != 0;
}

/** Passes the frames of both ends to a monitor in one order; returns whether a CRC was wrong. */
static bool show(struct fsn_monitor *monitor, bool sub_first, const struct shown *const frames[2]) {
    bool wrong = false;
    for (unsigned i = 0; i < 2; i++) {
        const unsigned way = sub_first ? 1 - i : i;
        wrong = (frames[way] != NULL &&
                 fsn_monitor_frame(monitor, (enum fsn_way)way, frames[way]->bytes,
                                   frames[way]->time_ns) == FSN_VERDICT_WRONG) ||
                wrong;
    }
    return wrong;
}

/** Which end came first in a packet with frames of both. A packet does not show this until the
 *  chain is known, so both orders are followed until one of them forms a chain. */
static bool sub_came_first(struct found *f, const struct shown *const frames[2]) {
    if (!f->unsure) {
        return fsn_monitor_sub_first(&f->monitor, frames[0]->bytes, frames[1]->bytes);
    }
    struct fsn_monitor main_first = f->monitor;
    struct fsn_monitor sub_first = f->other;
    const bool wrong = show(&main_first, false, frames);
    const bool other_wrong = show(&sub_first, true, frames);
    const bool locked = is_locked(&main_first);
    bool better;
    if (locked != is_locked(&sub_first)) {
        better = !locked;
    } else if (wrong != other_wrong) {
        better = wrong;
    } else {
        better = fsn_monitor_sub_first(&f->monitor, frames[0]->bytes, frames[1]->bytes);
    }
    if (better) {
        f->monitor = f->other;
    }
    return better;
}

/** Follows the new frames of a packet, of one end or of both. */
static void follow_packet(struct fsn_scan *scan, uint32_t connection,
                          const struct shown *const frames[2]) {
    struct found *f = &scan->found[connection];
    const bool both = frames[0] != NULL && frames[1] != NULL;
    const bool sub_first = both ? sub_came_first(f, frames) : frames[0] == NULL;
    if (f->unsure) {
        (void)show(&f->other, true, frames);
    }
    for (unsigned i = 0; i < 2; i++) {
        const unsigned way = sub_first ? 1 - i : i;
        if (frames[way] != NULL) {
            follow(scan, connection, (enum fsn_way)way, frames[way]);
        }
    }
    const bool unsure = !is_locked(&f->monitor);
    if (unsure && !f->unsure) {
        f->other = f->monitor;
    }
    f->unsure = unsure;
}

static void add_place(struct fsn_scan *scan, const struct candidate *c) {
    struct fsn_scan_connection *info = &scan->found[c->connection].info;
    if (info->place_count == FSN_SCAN_PLACES) {
        return;
    }
    const struct window *w = &scan->windows[c->window];
    const bool logical = w->command >= 10;
    info->places[info->place_count++] = (struct fsn_scan_place){
        /* A physical address has the offset in its upper half. */
        .address = w->address + (logical ? c->offset : c->offset << 16),
        .command = w->command,
        .way = c->way,
        .size_bytes = (uint16_t)c->size_bytes,
    };
}

static void connect(struct fsn_scan *scan, struct candidate *main, struct candidate *sub,
                    enum fsn_scan_roles roles) {
    const uint32_t number = scan->found_count;
    /* Bounded, as a capture of noise may contain any number of candidates. */
    if (number == MAX_CONNECTIONS ||
        fsn_monitor_init(&scan->found[number].monitor, main->size_bytes, sub->size_bytes) !=
            FSN_OK) {
        scan->counts.dropped++;
        return;
    }
    scan->found_count++;
    scan->found[number].info =
        (struct fsn_scan_connection){.connection_id = main->connection_id, .roles = (uint8_t)roles};
    struct candidate *const ends[2] = {main, sub};
    for (unsigned i = 0; i < 2; i++) {
        ends[i]->connection = number;
        ends[i]->way = (uint8_t)i;
        add_place(scan, ends[i]);
    }
    scan->found[number].unsure = true;
    /* Both orders of frames in a packet are followed until one of them forms a chain. */
    scan->found[number].other = scan->found[number].monitor;
    uint32_t left[2] = {scan_remembered(main), scan_remembered(sub)};
    while (left[0] > 0 || left[1] > 0) {
        const struct shown *next[2];
        for (unsigned i = 0; i < 2; i++) {
            next[i] = left[i] > 0 ? scan_shown(ends[i], left[i] - 1) : NULL;
        }
        /* In the order of their packets, because both directions depend on each other. */
        if (next[0] != NULL && next[1] != NULL && next[0]->packet != next[1]->packet) {
            next[next[0]->packet < next[1]->packet ? 1 : 0] = NULL;
        }
        left[0] -= next[0] != NULL;
        left[1] -= next[1] != NULL;
        follow_packet(scan, number, next);
    }
}

bool scan_has_shown(const struct candidate *candidate, const uint8_t *frame) {
    for (uint32_t k = 0; k < scan_remembered(candidate); k++) {
        if (memcmp(scan_shown(candidate, k)->bytes, frame, candidate->size_bytes) == 0) {
            return true;
        }
    }
    return false;
}

const struct candidate *scan_original(const struct fsn_scan *scan, const struct candidate *copy) {
    for (uint32_t i = 0; i < scan->candidate_count; i++) {
        const struct candidate *c = &scan->candidates[i];
        if (c->used && c->connection == copy->connection && c->way == copy->way && !c->copy) {
            return c;
        }
    }
    return NULL;
}

/** Whether a place shows the same frames as a known place of a connection. Frames outside of a
 *  chain do not count: every connection of this size has the same Resets. */
static bool is_copy_of(const struct candidate *c, const struct candidate *known) {
    if (known->size_bytes != c->size_bytes) {
        return false;
    }
    uint32_t equal = 0;
    for (uint32_t i = 0; i < scan_remembered(c); i++) {
        const uint8_t *frame = scan_shown(c, i)->bytes;
        equal += fsn_fsoe_connection_id(frame, c->size_bytes) != 0 && scan_has_shown(known, frame);
    }
    return equal >= LEAST_COPIES;
}

static void set_free(struct candidate *c) {
    c->connection = NONE;
    c->copy = false;
    c->against = 0;
    c->count = 0; /* its frames so far are outdated */
    c->next_try = 0;
    c->connection_id = 0;
}

void scan_release(struct fsn_scan *scan, uint32_t candidate) {
    struct candidate *c = &scan->candidates[candidate];
    const uint32_t connection = c->connection;
    if (c->copy) {
        set_free(c);
        return;
    }
    for (uint32_t i = 0; i < scan->candidate_count; i++) {
        if (scan->candidates[i].used && scan->candidates[i].connection == connection) {
            set_free(&scan->candidates[i]);
        }
    }
}

/** Adds a place as a copy of a known one; false if it is not a copy. */
static bool join_as_copy(struct fsn_scan *scan, struct candidate *c) {
    for (uint32_t i = 0; i < scan->candidate_count; i++) {
        const struct candidate *known = &scan->candidates[i];
        if (known->used && known->connection != NONE && !known->copy &&
            known->connection_id == c->connection_id &&
            scan->windows[known->window].bus == scan->windows[c->window].bus &&
            is_copy_of(c, known)) {
            c->connection = known->connection;
            c->way = known->way;
            c->copy = true;
            add_place(scan, c);
            return true;
        }
    }
    return false;
}

/** Tries two places as the two ends of a connection. */
static bool try_pair(struct fsn_scan *scan, struct candidate *a, struct candidate *b) {
    struct fsn_monitor monitor;
    if (!is_chain(a, b, &monitor)) {
        return false;
    }
    const bool a_began = began_session(a);
    if (a_began || began_session(b)) {
        connect(scan, a_began ? a : b, a_began ? b : a, FSN_ROLES_BY_START);
        return true;
    }
    const bool swapped = numbers_say_swapped(&monitor);
    connect(scan, swapped ? b : a, swapped ? a : b, FSN_ROLES_BY_NUMBERS);
    return true;
}

static bool shown_enough(const struct candidate *c) {
    uint32_t frames = 0;
    for (uint32_t i = 0; i < scan_remembered(c) && frames < LEAST_FRAMES; i++) {
        frames += fsn_fsoe_connection_id(scan_shown(c, i)->bytes, c->size_bytes) != 0;
    }
    return frames >= LEAST_FRAMES;
}

/** Whether another place is worth trying as the other end. */
static bool may_be_ends(const struct fsn_scan *scan, const struct candidate *c,
                        const struct candidate *other) {
    return other->used && other->connection == NONE && other->connection_id == c->connection_id &&
           shown_enough(other) && scan->windows[other->window].bus == scan->windows[c->window].bus;
}

void scan_pair(struct fsn_scan *scan, uint32_t candidate) {
    struct candidate *c = &scan->candidates[candidate];
    /* Pairing is costly, so it is retried only after some more frames. */
    if (c->connection_id == 0 || c->count < c->next_try || scan->pair_tries == 0 ||
        !shown_enough(c)) {
        return;
    }
    scan->pair_tries--;
    /* The same frame at a second place of the image is a copy, not another connection. */
    if (join_as_copy(scan, c)) {
        return;
    }
    unsigned tries = 0;
    for (uint32_t n = 0; n < scan->candidate_count; n++) {
        const uint32_t i = (c->next_other + n) % scan->candidate_count;
        struct candidate *other = &scan->candidates[i];
        if (other != c && may_be_ends(scan, c, other)) {
            if (scan->pair_tries == 0 || tries == OWN_TRIES) {
                c->next_other = i;
                /* By then all others have had their turn: a packet allows attempts for more than 4
                 * places. */
                c->next_try = c->count + 1 + scan->candidate_count / 4;
                return;
            }
            scan->pair_tries--;
            tries++;
            if (try_pair(scan, c, other)) {
                return;
            }
        }
    }
    c->next_try = c->count + 1 + c->count / 4; /* rarely, for places that never match */
}

static void swap_ways(struct fsn_monitor *monitor) {
    const struct fsn_followed followed = monitor->followed[0];
    monitor->followed[0] = monitor->followed[1];
    monitor->followed[1] = followed;
    const struct fsn_direction direction = monitor->status.direction[0];
    monitor->status.direction[0] = monitor->status.direction[1];
    monitor->status.direction[1] = direction;
}

/** The roles were a guess by numbers, and now the end considered the sub has begun a session. */
static void swap_roles(struct fsn_scan *scan, uint32_t connection) {
    struct found *f = &scan->found[connection];
    f->info.roles = FSN_ROLES_BY_START;
    for (uint32_t i = 0; i < f->info.place_count; i++) {
        f->info.places[i].way ^= 1;
    }
    const struct fsn_scan_place place = f->info.places[0];
    f->info.places[0] = f->info.places[1];
    f->info.places[1] = place;
    swap_ways(&f->monitor);
    f->other = f->monitor;
    for (uint32_t i = 0; i < scan->candidate_count; i++) {
        if (scan->candidates[i].used && scan->candidates[i].connection == connection) {
            scan->candidates[i].way ^= 1;
        }
    }
}

static void settle_roles(struct fsn_scan *scan, const struct candidate *c) {
    struct fsn_scan_connection *info = &scan->found[c->connection].info;
    const uint8_t *frame = scan_shown(c, 0)->bytes;
    if (info->roles == FSN_ROLES_BY_START || frame[0] != FSN_CMD_SESSION ||
        !fsn_fsoe_check(frame, c->size_bytes, 0, 1)) {
        return;
    }
    if (c->way == FSN_TO_MAIN) {
        swap_roles(scan, c->connection);
    }
    info->roles = FSN_ROLES_BY_START;
}

void scan_follow(struct fsn_scan *scan, uint32_t candidate) {
    struct candidate *c = &scan->candidates[candidate];
    if (c->copy) {
        return;
    }
    settle_roles(scan, c);
    if (scan->deferred_count < DEFERRED) {
        scan->deferred[scan->deferred_count++] = candidate;
        return;
    }
    follow(scan, c->connection, (enum fsn_way)c->way, scan_shown(c, 0));
}

/** The new frame of the other end in this packet, from a place in the list on; NULL: none. */
static struct candidate *partner(struct fsn_scan *scan, uint32_t from, const struct candidate *c,
                                 uint32_t *at) {
    for (uint32_t i = from; i < scan->deferred_count; i++) {
        struct candidate *other = &scan->candidates[scan->deferred[i]];
        if (scan->deferred[i] != NONE && other->connection == c->connection) {
            *at = i;
            return other;
        }
    }
    return NULL;
}

void scan_end_of_packet(struct fsn_scan *scan) {
    for (uint32_t i = 0; i < scan->deferred_count; i++) {
        if (scan->deferred[i] == NONE || scan->candidates[scan->deferred[i]].connection == NONE) {
            continue; /* already followed, or released in this packet */
        }
        const struct candidate *first = &scan->candidates[scan->deferred[i]];
        const struct shown *frames[2] = {NULL, NULL};
        uint32_t at = 0;
        const struct candidate *second = partner(scan, i + 1, first, &at);
        frames[first->way] = scan_shown(first, 0);
        if (second != NULL && second->way != first->way) {
            scan->deferred[at] = NONE;
            frames[second->way] = scan_shown(second, 0);
        }
        follow_packet(scan, first->connection, frames);
    }
    scan->deferred_count = 0;
}
