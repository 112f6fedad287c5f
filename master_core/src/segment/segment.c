/** Builds a segment from a plan, with the data access of its devices. */
#define _GNU_SOURCE

#include <stdlib.h>
#include <string.h>

#include "segment/segment_internal.h"

enum {
    MAX_POSITIONS = 4096,
    FORWARD_NS = 300, /**< delay through one controller */
};

/* -- building ------------------------------------------------------------------------------- */

/** Assigns ring positions. A SubDevice without alias has its own position. The position of one with
 *  an alias counts from the SubDevice that carries the alias, and that one takes the next free
 *  place. Groups that may be absent follow all others, one after another. */
static uint32_t place_subdevices(struct fsn_segment *s) {
    const uint32_t subdevices = fsn_plan_subdevice_count(s->plan);
    uint8_t taken[MAX_POSITIONS] = {0};
    uint32_t count = 0;
    for (unsigned turn = 0; turn < 3; turn++) {
        for (uint32_t i = 0; i < subdevices; i++) {
            const struct fsn_subdevice_info info = fsn_known_subdevice(s->plan, i);
            const bool in_group = fsn_plan_group_of(s->plan, i) != FSN_NONE;
            if (turn != (in_group ? 2u : info.alias != 0)) {
                continue;
            }
            s->positions[i] = FSN_NONE;
            const uint32_t first[] = {info.position, 0, count};
            uint32_t at = first[turn];
            while (at < MAX_POSITIONS && taken[at] != 0) {
                at++;
            }
            if (at >= MAX_POSITIONS) {
                continue;
            }
            taken[at] = 1;
            s->positions[i] = at;
            count = at + 1 > count ? at + 1 : count;
        }
    }
    return count;
}

static bool allocate(struct fsn_segment *s) {
    const uint32_t sms = fsn_plan_sm_count(s->plan);
    if (!FSN_NEW(s->positions, fsn_plan_subdevice_count(s->plan)) || !FSN_NEW(s->places, sms)) {
        return false;
    }
    s->count = place_subdevices(s);
    size_t total = 0;
    for (uint32_t sm = 0; sm < sms; sm++) {
        total += fsn_sm_bytes(s->plan, sm);
    }
    s->wire = calloc(1, sizeof *s->wire);
    /* There is one cable more than SubDevices. */
    return s->wire != NULL && FSN_NEW(s->escs, s->count) && FSN_NEW(s->present, s->count) &&
           FSN_NEW(s->optional, s->count) && FSN_NEW(s->order, s->count) &&
           FSN_NEW(s->cut, s->count) && FSN_NEW(s->siis, s->count) && FSN_NEW(s->storage, total);
}

static void give_buffers(struct fsn_segment *s) {
    uint8_t *next = s->storage;
    for (uint32_t sm = 0; sm < fsn_plan_sm_count(s->plan); sm++) {
        const struct fsn_sm_record r = fsn_read_sm(s->plan, sm);
        const uint32_t position = s->positions[r.subdevice];
        const uint32_t size = fsn_sm_bytes(s->plan, sm);
        s->places[sm] = (struct place){.position = FSN_NONE};
        if (position == FSN_NONE || r.index >= ESC_SMS || size == 0) {
            continue;
        }
        s->places[sm] = (struct place){.position = position, .sm = r.index};
        s->escs[position].buffers[r.index].device = next;
        s->escs[position].buffers[r.index].size_bytes = size;
        next += size;
    }
}

/** The owner inherits the priority of waiting threads, because the link may be a real-time
 *  thread. */
static void init_lock(pthread_mutex_t *lock) {
    pthread_mutexattr_t attributes;
    pthread_mutexattr_init(&attributes);
    pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
    pthread_mutex_init(lock, &attributes);
    pthread_mutexattr_destroy(&attributes);
}

/** Of the groups of one place, only the first is initially plugged in. */
static void set_groups(struct fsn_segment *s) {
    for (uint32_t i = 0; i < fsn_plan_subdevice_count(s->plan); i++) {
        const uint32_t position = s->positions[i];
        if (position != FSN_NONE && fsn_plan_group_of(s->plan, i) != FSN_NONE) {
            s->optional[position] = true;
            s->present[position] = fsn_plan_is_first_choice(s->plan, i);
        }
    }
}

fsn_status fsn_segment_create(struct fsn_plan *plan, struct fsn_segment **segment) {
    if (plan == NULL || segment == NULL) {
        return FSN_E_ARG;
    }
    *segment = NULL;
    struct fsn_segment *s = calloc(1, sizeof *s);
    if (s == NULL) {
        return FSN_E_NOMEM;
    }
    s->sockets[0] = s->sockets[1] = s->locks[0] = s->locks[1] = -1;
    s->plan = plan;
    atomic_fetch_add(&plan->holders, 1);
    init_lock(&s->lock);
    bool ok = allocate(s);
    if (ok) {
        give_buffers(s);
        for (uint32_t i = 0; i < fsn_plan_subdevice_count(plan); i++) {
            ok = ok && (s->positions[i] == FSN_NONE || segment_describe(s, i, s->positions[i]));
        }
    }
    for (uint32_t p = 0; ok && p < s->count; p++) {
        if (s->siis[p] == NULL) {
            ok = segment_describe(s, FSN_NONE, p);
        }
        s->present[p] = true;
        s->order[p] = p;
        /* Their clocks differ in time and in rate. */
        s->escs[p].clock = (struct esc_clock){.forward_ns = FORWARD_NS,
                                              .offset_ns = 1000003u * (uint64_t)p,
                                              .drift_ppb = (int64_t)(p * 37 % 101) * 1000 - 50000};
        esc_power_on(&s->escs[p]);
    }
    if (!ok) {
        fsn_segment_free(s);
        return FSN_E_NOMEM;
    }
    set_groups(s);
    segment_rewire(s);
    *segment = s;
    return FSN_OK;
}

void fsn_segment_free(struct fsn_segment *s) {
    if (s == NULL) {
        return;
    }
    fsn_segment_unlink(s);
    for (uint32_t p = 0; p < s->count; p++) {
        if (s->escs != NULL) {
            objects_free(&s->escs[p].objects);
        }
        if (s->siis != NULL) {
            free(s->siis[p]);
        }
    }
    free(s->escs);
    free(s->present);
    free(s->optional);
    free(s->order);
    free(s->cut);
    free(s->wire);
    free(s->siis);
    free(s->positions);
    free(s->places);
    free(s->storage);
    pthread_mutex_destroy(&s->lock); /* mutants: it keeps nothing that could be missed */
    fsn_plan_free(s->plan);
    free(s);
}

/* -- the side of the devices ---------------------------------------------------------------- */

uint32_t fsn_segment_size(const struct fsn_segment *s) {
    return s->count;
}

uint32_t fsn_segment_position(const struct fsn_segment *s, uint32_t subdevice) {
    return subdevice < fsn_plan_subdevice_count(s->plan) ? s->positions[subdevice] : FSN_NONE;
}

static struct esc_buffer *buffer_of(struct fsn_segment *s, uint32_t sm, uint8_t direction,
                                    size_t len_bytes) {
    if (sm >= fsn_plan_sm_count(s->plan) || s->places[sm].position == FSN_NONE ||
        fsn_read_sm(s->plan, sm).direction != direction) {
        return NULL;
    }
    struct esc_buffer *b = &s->escs[s->places[sm].position].buffers[s->places[sm].sm];
    return b->size_bytes == len_bytes ? b : NULL;
}

fsn_status fsn_segment_read_outputs(struct fsn_segment *s, uint32_t sm, uint8_t *buffer,
                                    size_t len_bytes, bool *fresh) {
    pthread_mutex_lock(&s->lock);
    struct esc_buffer *b = buffer_of(s, sm, FSN_OUTPUT, len_bytes);
    if (b != NULL) {
        memcpy(buffer, b->device, len_bytes);
        if (fresh != NULL) {
            *fresh = b->fresh;
        }
        b->fresh = false;
    }
    pthread_mutex_unlock(&s->lock);
    return b != NULL ? FSN_OK : FSN_E_ARG;
}

fsn_status fsn_segment_write_inputs(struct fsn_segment *s, uint32_t sm, const uint8_t *buffer,
                                    size_t len_bytes) {
    pthread_mutex_lock(&s->lock);
    struct esc_buffer *b = buffer_of(s, sm, FSN_INPUT, len_bytes);
    if (b != NULL) {
        memcpy(b->device, buffer, len_bytes);
        b->fresh = true;
    }
    pthread_mutex_unlock(&s->lock);
    return b != NULL ? FSN_OK : FSN_E_ARG;
}

uint8_t fsn_segment_al_status(struct fsn_segment *s, uint32_t position, uint16_t *code) {
    pthread_mutex_lock(&s->lock);
    uint8_t status = 0;
    if (position < s->count && s->present[position]) {
        status = s->escs[position].memory[REG_AL_STATUS];
        if (code != NULL) {
            *code = fsn_get16(s->escs[position].memory + REG_AL_CODE);
        }
    }
    pthread_mutex_unlock(&s->lock);
    return status;
}

void fsn_segment_counts(struct fsn_segment *s, struct fsn_segment_counts *counts) {
    pthread_mutex_lock(&s->lock);
    *counts = s->counts;
    pthread_mutex_unlock(&s->lock);
}
