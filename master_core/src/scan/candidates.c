/** Places in the process data that may contain FSoE frames. Random data show no second command in a
 *  row at the same place, so nearly all places are excluded immediately. */
#include "scan/scan.h"

#include <stdlib.h>
#include <string.h>

static const uint8_t is_command[256] = {
    [FSN_CMD_RESET] = 1,     [FSN_CMD_SESSION] = 1,      [FSN_CMD_CONNECTION] = 1,
    [FSN_CMD_PARAMETER] = 1, [FSN_CMD_PROCESS_DATA] = 1, [FSN_CMD_FAILSAFE_DATA] = 1,
};

/** Returns the window at this address; NULL if the table is full. */
static struct window *window_of(struct fsn_scan *scan, uint8_t command, uint32_t address,
                                uint16_t size_bytes) {
    for (uint32_t i = 0; i < scan->window_count; i++) {
        const uint32_t at = (scan->next_window + i) % scan->window_count;
        struct window *w = &scan->windows[at];
        if (w->address == address && w->command == command && w->size_bytes == size_bytes &&
            w->bus == scan->bus) {
            scan->next_window = at + 1;
            return w;
        }
    }
    if (scan->window_count == MAX_WINDOWS) {
        scan->counts.dropped++;
        return NULL;
    }
    struct window *w = &scan->windows[scan->window_count];
    *w = (struct window){
        .bus = scan->bus, .command = command, .address = address, .size_bytes = size_bytes};
    w->last = calloc(size_bytes, 1);
    w->strikes = calloc(size_bytes, 1);
    w->slots = malloc(size_bytes * sizeof *w->slots);
    if (w->last == NULL || w->strikes == NULL || w->slots == NULL) {
        free(w->last);
        free(w->strikes);
        free(w->slots);
        scan->counts.dropped++;
        return NULL;
    }
    memset(w->slots, 0xFF, size_bytes * sizeof *w->slots);
    scan->window_count++;
    return w;
}

const struct shown *scan_shown(const struct candidate *candidate, uint32_t back) {
    return &candidate->shown[(candidate->count - 1 - back) % MEMORY];
}

uint32_t scan_remembered(const struct candidate *candidate) {
    return candidate->count < MEMORY ? candidate->count : MEMORY;
}

static void remember(struct fsn_scan *scan, struct candidate *c, const uint8_t *frame) {
    struct shown *slot = &c->shown[c->count % MEMORY];
    const size_t number = (size_t)(c - scan->candidates) * MEMORY + c->count % MEMORY;
    slot->bytes = scan->frames + number * FSN_MAX_FRAME_BYTES;
    slot->time_ns = scan->now_ns;
    slot->packet = scan->counts.packets;
    memcpy(slot->bytes, frame, c->size_bytes);
    c->count++;
}

static void drop(struct fsn_scan *scan, uint32_t *slot) {
    struct candidate *c = &scan->candidates[*slot];
    *c = (struct candidate){.next_free = scan->free_candidate};
    scan->free_candidate = *slot + 1;
    *slot = NONE;
}

/** Takes a free slot; NONE if all are in use. */
static uint32_t take_slot(struct fsn_scan *scan) {
    if (scan->free_candidate == 0) {
        return scan->candidate_count < MAX_CANDIDATES ? scan->candidate_count++ : NONE;
    }
    const uint32_t number = scan->free_candidate - 1;
    scan->free_candidate = scan->candidates[number].next_free;
    return number;
}

static void add(struct fsn_scan *scan, struct window *w, uint32_t offset, unsigned kind,
                uint32_t size_bytes) {
    const uint32_t number = take_slot(scan);
    if (number == NONE) {
        scan->counts.dropped++;
        return;
    }
    struct candidate *c = &scan->candidates[number];
    *c = (struct candidate){
        .window = (uint32_t)(w - scan->windows),
        .offset = offset,
        .size_bytes = size_bytes,
        .connection = NONE,
        .used = true,
    };
    w->slots[offset][kind] = number;
}

/** Whether a frame is possible by its own content: ConnID 0 only in Reset and Session; the CRCs of
 *  a Reset depend on no earlier frame. */
static bool plausible(const uint8_t *frame, uint32_t size_bytes, uint16_t connection_id) {
    const uint16_t id = fsn_fsoe_connection_id(frame, size_bytes);
    if (frame[0] == FSN_CMD_RESET) {
        return id == 0 && fsn_fsoe_check(frame, size_bytes, 0, 1);
    }
    if (frame[0] == FSN_CMD_SESSION) {
        return id == 0;
    }
    return id != 0 && (connection_id == 0 || connection_id == id);
}

/** Returns the length of the frame that begins here, determined by its matching blocks; 0 if not
 *  even one of 7 bytes fits. */
static uint32_t length_by_blocks(const uint8_t *frame, uint32_t room) {
    if (room < 7) {
        return 0;
    }
    const uint32_t most = room < FSN_MAX_FRAME_BYTES ? room : FSN_MAX_FRAME_BYTES;
    unsigned blocks;
    (void)fsn_fsoe_is_whole(frame, 3 + (most - 3) / 4 * 4, &blocks);
    return 3 + 4 * blocks;
}

/** Whether the assumed length of a place was wrong: blocks beyond it matched each other by chance,
 *  or its first frame was damaged and now more blocks match in every frame. */
static bool is_other_length(struct candidate *c, uint32_t size_bytes) {
    c->against = (uint8_t)(size_bytes > c->size_bytes ? c->against + 1 : 0);
    return size_bytes < c->size_bytes || c->against >= PATIENCE;
}

/** Examines a place that shows a command, for one length. */
static void consider(struct fsn_scan *scan, struct window *w, uint32_t offset, unsigned kind,
                     uint32_t size_bytes, const uint8_t *frame) {
    uint32_t *slot = &w->slots[offset][kind];
    /* A frame that no longer fits at this place: the first length was wrong. */
    if (*slot != NONE && memcmp(w->last + offset, frame, scan->candidates[*slot].size_bytes) != 0 &&
        is_other_length(&scan->candidates[*slot], size_bytes)) {
        drop(scan, slot);
    }
    const uint32_t size = *slot == NONE ? size_bytes : scan->candidates[*slot].size_bytes;
    /* An unchanged image gives no new fact: a frame is judged when it appears. */
    if (size == 0 || !w->seen || memcmp(w->last + offset, frame, size) == 0) {
        return;
    }
    const uint16_t id = *slot == NONE ? 0 : scan->candidates[*slot].connection_id;
    /* The connection ID stays the same; a different one means data that looked like a frame. */
    if (!plausible(frame, size, id)) {
        if (*slot != NONE) {
            drop(scan, slot);
        }
        return;
    }
    if (*slot == NONE) {
        add(scan, w, offset, kind, size);
    }
    if (*slot == NONE) {
        return;
    }
    struct candidate *c = &scan->candidates[*slot];
    /* The first frames of a session carry ConnID 0. */
    const uint16_t shown = fsn_fsoe_connection_id(frame, size);
    c->connection_id = shown != 0 ? shown : c->connection_id;
    remember(scan, c, frame);
    scan_pair(scan, *slot);
}

/** Whether the last frame of a known place contradicts its connection: another ConnID, or, for a
 *  copy, frames that its original has not shown. A copy may be ahead, so an older frame is
 *  checked. */
static bool speaks_against(const struct fsn_scan *scan, const struct candidate *c) {
    const uint8_t *frame = scan_shown(c, 0)->bytes;
    if (c->copy) {
        const struct candidate *original = scan_original(scan, c);
        return scan_remembered(c) > PATIENCE && original != NULL &&
               !scan_has_shown(original, scan_shown(c, PATIENCE)->bytes);
    }
    const uint16_t id = fsn_fsoe_connection_id(frame, c->size_bytes);
    const bool chained = frame[0] != FSN_CMD_RESET && frame[0] != FSN_CMD_SESSION;
    return chained && id != c->connection_id;
}

/** Follows the places here that belong to a connection; true if there is one. */
static bool follow_known(struct fsn_scan *scan, struct window *w, uint32_t offset,
                         const uint8_t *frame) {
    bool known = false;
    for (unsigned kind = 0; kind < SLOTS; kind++) {
        const uint32_t number = w->slots[offset][kind];
        if (number == NONE || scan->candidates[number].connection == NONE) {
            continue;
        }
        known = true;
        struct candidate *c = &scan->candidates[number];
        if (memcmp(w->last + offset, frame, c->size_bytes) == 0) {
            continue;
        }
        remember(scan, c, frame);
        c->against = (uint8_t)(speaks_against(scan, c) ? c->against + 1 : 0);
        if (c->against > PATIENCE) {
            scan_release(scan, number);
        } else {
            scan_follow(scan, number);
        }
    }
    return known;
}

static void strike(struct window *w, uint32_t offset, bool counts) {
    const int strikes = w->strikes[offset] + (counts ? STRIKE : 0);
    w->strikes[offset] = (uint8_t)(strikes < MOST_STRIKES ? strikes : MOST_STRIKES);
}

/** A changed byte that is not a command: the data from here on are not FSoE. */
static void refute(struct fsn_scan *scan, struct window *w, uint32_t offset, uint8_t byte) {
    for (unsigned kind = 0; kind < SLOTS; kind++) {
        if (w->slots[offset][kind] != NONE) {
            drop(scan, &w->slots[offset][kind]);
        }
    }
    strike(w, offset, byte != 0);
}

static void check_place(struct fsn_scan *scan, struct window *w, uint32_t offset,
                        const uint8_t *data) {
    const uint8_t *frame = data + offset;
    const bool empty = w->slots[offset][0] == NONE && w->slots[offset][1] == NONE;
    const bool command = is_command[frame[0]] != 0;
    /* The same byte that is not a command was already judged. */
    if (!command && frame[0] == w->last[offset]) {
        return;
    }
    /* A place that shows a command again becomes trusted again. */
    if (command && empty && w->strikes[offset] > 0) {
        w->strikes[offset]--;
    }
    if (!empty && follow_known(scan, w, offset, frame)) {
        return;
    }
    if (!command) {
        refute(scan, w, offset, frame[0]);
        return;
    }
    const uint32_t room = w->size_bytes - offset;
    consider(scan, w, offset, 0, length_by_blocks(frame, room), frame);
    /* Six bytes are the shortest frame and match almost anywhere, so longer ones are tried
     * first. */
    if (w->slots[offset][0] == NONE || scan->candidates[w->slots[offset][0]].connection == NONE) {
        consider(scan, w, offset, 1, FSN_MIN_FRAME_BYTES, frame);
    }
}

void scan_process_data(struct fsn_scan *scan, struct run *run) {
    const uint16_t size_bytes = run->size_bytes;
    const uint8_t *data = run->data;
    if (size_bytes < FSN_MIN_FRAME_BYTES) {
        return;
    }
    struct window *w = window_of(scan, run->command, run->address, size_bytes);
    if (w == NULL) {
        return;
    }
    for (uint32_t i = 0; i < size_bytes; i++) {
        run->data[i] = run->answered[i] ? run->data[i] : w->last[i];
    }
    if (w->seen && memcmp(w->last, data, size_bytes) == 0) {
        return;
    }
    for (uint32_t p = 0; p + FSN_MIN_FRAME_BYTES <= size_bytes; p++) {
        if (w->strikes[p] < GIVEN_UP) {
            check_place(scan, w, p, data);
        } else if (is_command[data[p]] != 0) {
            w->strikes[p]--; /* a place that was given up may now have another use */
        } else {
            strike(w, p, data[p] != 0);
        }
    }
    memcpy(w->last, data, size_bytes);
    w->seen = true;
}
