/** State of a core that a successor reads, and how it continues from there. */
#include "fsn/handover.h"

#include <stdlib.h>
#include <string.h>

#include "core/core_internal.h"
#include "rt/words.h"

enum { ROOM_FORMAT = 0x316E7366 }; /* "fsn1" */

/** Head of a room; the snapshots follow, one after another. */
struct room {
    uint32_t format, statistics_bytes, connections_bytes, image_bytes;
    struct fsn_rt_shown shown;
    _Alignas(64) _Atomic uint64_t words[];
};

static size_t picture_words(size_t connections_bytes, size_t image_bytes) {
    return fsn_words_of(sizeof(struct fsn_statistics)) + fsn_words_of(connections_bytes) +
           fsn_words_of(image_bytes);
}

static size_t connections_bytes(const struct fsn_core *core) {
    return core->rt.connection_count * sizeof(struct fsn_connection_status);
}

static size_t room_bytes(size_t words) {
    return sizeof(struct room) + FSN_RT_PICTURES * words * sizeof(uint64_t);
}

size_t fsn_core_room_bytes(const struct fsn_core *core) {
    return core == NULL ? 0
                        : room_bytes(picture_words(connections_bytes(core), core->rt.image_bytes));
}

fsn_status fsn_core_share(struct fsn_core *core, void *at) {
    struct room *room = at;
    if (core == NULL || room == NULL) {
        return FSN_E_ARG;
    }
    struct fsn_rt_snapshot *snapshot = &core->rt.snapshot;
    if (core->running || snapshot->shown != &core->shown) {
        return FSN_E_STATE;
    }
    const size_t words = picture_words(connections_bytes(core), core->rt.image_bytes);
    room->statistics_bytes = sizeof(struct fsn_statistics);
    room->connections_bytes = (uint32_t)connections_bytes(core);
    room->image_bytes = core->rt.image_bytes;
    atomic_init(&room->shown.begun, atomic_load(&core->shown.begun));
    atomic_init(&room->shown.whole, atomic_load(&core->shown.whole));
    for (size_t i = 0; i < FSN_RT_PICTURES; i++) {
        _Atomic uint64_t *place = room->words + i * words;
        memcpy((void *)place, (void *)snapshot->words[i], words * sizeof *place);
        free((void *)snapshot->words[i]);
        snapshot->words[i] = place;
    }
    snapshot->shown = &room->shown;
    room->format = ROOM_FORMAT;
    return FSN_OK;
}

void fsn_core_show_first(struct fsn_core *core, bool first) {
    if (core != NULL) {
        atomic_store_explicit(&core->rt.show_first, first, memory_order_relaxed);
    }
}

uint32_t fsn_room_pictures(const void *room) {
    return atomic_load_explicit(&((const struct room *)room)->shown.whole, memory_order_acquire);
}

fsn_status fsn_room_read(const void *at, size_t len_bytes, uint32_t image_bytes,
                         struct fsn_statistics *statistics, uint8_t *image) {
    const struct room *room = at;
    if (room == NULL || len_bytes < sizeof *room || room->format != ROOM_FORMAT ||
        room->statistics_bytes != sizeof *statistics || room->image_bytes != image_bytes ||
        len_bytes < room_bytes(picture_words(room->connections_bytes, image_bytes))) {
        return FSN_E_ARG;
    }
    const size_t words = picture_words(room->connections_bytes, image_bytes);
    for (int attempts = 0; attempts < 1000; attempts++) {
        const uint32_t picture = fsn_room_pictures(room);
        const _Atomic uint64_t *from = room->words + (picture % FSN_RT_PICTURES) * words;
        from = fsn_words_take(from, statistics, sizeof *statistics);
        from = fsn_words_take(from, NULL, room->connections_bytes);
        fsn_words_take(from, image, image_bytes);
        /* The loads above must not be reordered after this check for a new write. */
        atomic_thread_fence(memory_order_acquire);
        if (atomic_load_explicit(&room->shown.begun, memory_order_relaxed) - picture <
            FSN_RT_PICTURES) {
            return FSN_OK;
        }
    }
    return FSN_E_BUSY;
}

fsn_status fsn_core_continue(struct fsn_core *core, const struct fsn_statistics *statistics,
                             const uint8_t *image) {
    if (core == NULL || statistics == NULL || image == NULL) {
        return FSN_E_ARG;
    }
    struct fsn_rt *rt = &core->rt;
    if (core->running || rt->statistics.cycles > 0) {
        return FSN_E_STATE;
    }
    struct fsn_statistics *s = &rt->statistics;
    const uint32_t copies = s->copies, merged = s->merged_copies;
    const uint32_t realtime = s->realtime, locked = s->locked;
    *s = *statistics;
    s->copies = copies;
    s->merged_copies = merged;
    s->realtime = realtime;
    s->locked = locked;
    for (uint32_t picture = 0; picture < FSN_RT_PICTURES; picture++) {
        rt->snapshot.unshown[picture].count = FSN_RT_COUNTED + 1; /* all of the histograms */
    }
    if (rt->image_bytes > 0) {
        memcpy(rt->image, image, rt->image_bytes);
    }
    atomic_store(&rt->recorder.last, statistics->cycles);
    rt->goes_on = statistics->cycles > 0;
    fsn_rt_publish(rt);
    return FSN_OK;
}
