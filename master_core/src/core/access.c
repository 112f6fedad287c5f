/** Functions for other threads while the cycle runs: read the snapshot, take events, set outputs.
 *  Nothing here can delay the cyclic thread. */
#define _POSIX_C_SOURCE 200809L

#include <sched.h>
#include <string.h>

#include "core/core_internal.h"
#include "rt/bytes.h"
#include "rt/words.h"

/** Reads the last complete snapshot; false if the writer has begun to overwrite it in the
 *  meantime. */
static bool try_snapshot(const struct fsn_rt *rt, struct fsn_statistics *statistics,
                         struct fsn_connection_status *connections, uint8_t *image) {
    const uint32_t picture = atomic_load_explicit(&rt->snapshot.shown->whole, memory_order_acquire);
    const _Atomic uint64_t *from = rt->snapshot.words[picture % FSN_RT_PICTURES];
    from = fsn_words_take(from, statistics, sizeof rt->statistics);
    from = fsn_words_take(from, connections, rt->connection_count * sizeof *connections);
    fsn_words_take(from, image, rt->image_bytes);
    /* The loads above must not be reordered after this check for a new write. */
    atomic_thread_fence(memory_order_acquire);
    return atomic_load_explicit(&rt->snapshot.shown->begun, memory_order_relaxed) - picture <
           FSN_RT_PICTURES;
}

fsn_status fsn_core_snapshot(struct fsn_core *core, struct fsn_statistics *statistics,
                             struct fsn_connection_status *connections, uint8_t *image) {
    /* Bounded: a reader that is always overtaken gets a status instead of hanging. */
    enum { ATTEMPTS = 1000 };
    if (core == NULL) {
        return FSN_E_ARG;
    }
    for (int i = 0; i < ATTEMPTS; i++) { /* mutants: one attempt more or less */
        if (try_snapshot(&core->rt, statistics, connections, image)) {
            return FSN_OK;
        }
        sched_yield();
    }
    return FSN_E_BUSY;
}

uint32_t fsn_core_image_bytes(const struct fsn_core *core) {
    return core->rt.image_bytes;
}

uint32_t fsn_core_sm_base(const struct fsn_core *core, uint32_t sm) {
    return sm < core->rt.sm_count ? core->layout.sm_base[sm] : FSN_NONE;
}

uint32_t fsn_core_datagram_count(const struct fsn_core *core) {
    return core->rt.datagram_count;
}

uint32_t fsn_core_datagram_byte(const struct fsn_core *core, uint32_t datagram) {
    return datagram < core->rt.datagram_count ? core->layout.datagram_begin[datagram] : FSN_NONE;
}

uint64_t fsn_core_stale_cycles(const struct fsn_core *core, uint32_t sm) {
    return sm < core->rt.sm_count ? atomic_load_explicit(&core->rt.stale[sm], memory_order_relaxed)
                                  : 0;
}

bool fsn_core_event(struct fsn_core *core, struct fsn_event *event) {
    if (core == NULL || event == NULL) {
        return false;
    }
    struct fsn_rt_ring *ring = &core->rt.ring;
    const uint32_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    if (tail == atomic_load_explicit(&ring->head, memory_order_acquire)) {
        return false;
    }
    *event = ring->slot[tail % FSN_RT_EVENTS];
    atomic_store_explicit(&ring->tail, tail + 1, memory_order_release);
    return true;
}

uint64_t fsn_histogram_floor(uint32_t bucket) {
    /* mutants: of 64 both say 64 */
    return bucket < FSN_OCTAVE
               ? bucket
               : (uint64_t)(FSN_OCTAVE + bucket % FSN_OCTAVE) << (bucket / FSN_OCTAVE - 1);
}

uint64_t fsn_histogram_percentile(const struct fsn_histogram *histogram, uint32_t per_million) {
    if (histogram == NULL || histogram->count == 0) {
        return 0;
    }
    const double wanted = (double)histogram->count * per_million / 1e6;
    uint64_t seen = 0;
    for (uint32_t b = 0; b + 1 < FSN_BUCKETS; b++) {
        seen += histogram->bucket[b];
        if (seen > 0 && (double)seen >= wanted) {
            const uint64_t end = fsn_histogram_floor(b + 1) - 1;
            return end < histogram->max_ns ? end : histogram->max_ns;
        }
    }
    return histogram->max_ns;
}

bool fsn_core_poll(struct fsn_core *core, uint8_t al_state, uint64_t now_ns) {
    return core == NULL || core->rt.ops->poll == NULL ||
           core->rt.ops->poll(core->rt.bus, al_state, now_ns);
}

fsn_status fsn_core_subdevice(struct fsn_core *core, uint32_t subdevice,
                              struct fsn_bus_subdevice *seen) {
    if (core == NULL || seen == NULL || subdevice >= core->plan->count[FSN_SEC_SUBDEVICE]) {
        return FSN_E_ARG;
    }
    return core->rt.ops->state == NULL ? FSN_E_STATE
                                       : core->rt.ops->state(core->rt.bus, subdevice, seen);
}

fsn_status fsn_core_ring(struct fsn_core *core, struct fsn_bus_ring *ring) {
    if (core == NULL || ring == NULL) {
        return FSN_E_ARG;
    }
    const struct fsn_bus_ops *ops = core->rt.ops;
    return ops->ring != NULL && ops->ring(core->rt.bus, ring) ? FSN_OK : FSN_E_STATE;
}

fsn_status fsn_core_clocks(struct fsn_core *core, struct fsn_bus_clocks *clocks) {
    if (core == NULL || clocks == NULL) {
        return FSN_E_ARG;
    }
    const struct fsn_bus_ops *ops = core->rt.ops;
    return ops->clocks != NULL && ops->clocks(core->rt.bus, clocks) ? FSN_OK : FSN_E_STATE;
}

fsn_status fsn_core_bus(struct fsn_core *core, uint32_t number, struct fsn_statistics *statistics) {
    if (core == NULL || statistics == NULL || number >= fsn_plan_bus_count(core->plan)) {
        return FSN_E_ARG;
    }
    FSN_TRY(fsn_core_snapshot(core, statistics, NULL, NULL));
    const struct fsn_bus_ops *ops = core->rt.ops;
    return ops->statistics != NULL ? ops->statistics(core->rt.bus, number, statistics) : FSN_OK;
}

static bool has_place(const struct fsn_core *core, uint32_t symbol) {
    return symbol < core->plan->count[FSN_SEC_SYMBOL] && core->rt.outputs[symbol].bits > 0;
}

bool fsn_core_is_open(const struct fsn_core *core, uint32_t symbol) {
    return core != NULL && has_place(core, symbol) && core->rt.outputs[symbol].open;
}

/** Stores one value in the writer's own copy. */
static void want(struct fsn_core *core, uint32_t symbol, uint64_t value) {
    if (core->active_slot[symbol] == 0) {
        core->active[core->active_count++] = symbol;
        core->active_slot[symbol] = core->active_count;
    }
    core->wanted[core->active_slot[symbol] - 1] = value;
}

/** Publishes all values. The cycle sees the contents of the set and their symbols before it sees
 *  that there is a new one; the returned set is no longer in use. */
static void hand_over(struct fsn_core *core) {
    struct fsn_rt_sets *sets = &core->rt.sets;
    struct fsn_rt_set *set = &sets->set[sets->triple.writer];
    memcpy(set->values, core->wanted, core->active_count * sizeof *set->values);
    set->count = core->active_count;
    fsn_triple_publish(&sets->triple);
}

fsn_status fsn_core_set_outputs(struct fsn_core *core, size_t count, const uint32_t *symbols,
                                const uint64_t *values) {
    if (core == NULL || (count > 0 && (symbols == NULL || values == NULL))) {
        return FSN_E_ARG;
    }
    for (size_t i = 0; i < count; i++) {
        if (!has_place(core, symbols[i])) {
            return FSN_E_ARG;
        }
        if (!core->rt.outputs[symbols[i]].open) {
            return FSN_E_CLOSED;
        }
    }
    for (size_t i = 0; i < count; i++) {
        want(core, symbols[i], values[i]);
    }
    hand_over(core);
    return FSN_OK;
}

fsn_status fsn_core_set_output(struct fsn_core *core, uint32_t symbol, uint64_t value) {
    return fsn_core_set_outputs(core, 1, &symbol, &value);
}

fsn_status fsn_core_read_symbol(const struct fsn_core *core, const uint8_t *image, uint32_t symbol,
                                uint64_t *value) {
    if (core == NULL || image == NULL || value == NULL || !has_place(core, symbol)) {
        return FSN_E_ARG;
    }
    const struct fsn_rt_output *place = &core->rt.outputs[symbol];
    *value = fsn_read_bits(image, place->bit_offset, place->bits);
    return FSN_OK;
}
