/** The recorder of the core: set up before the cycle runs, read by other threads while it does. */
#include <stdlib.h>
#include <string.h>

#include "core/core_internal.h"
#include "rt/words.h"

static size_t slot_words(const struct fsn_rt *rt) {
    return 1 + fsn_words_of(sizeof(struct fsn_cycle)) +
           fsn_words_of(rt->datagram_count * sizeof(struct fsn_wkc)) +
           fsn_words_of(rt->image_bytes);
}

/** Number of cycles to keep: all within the time, or as many as fit. */
static uint64_t slots_for(const struct fsn_core *core, uint64_t cycle_ns, size_t slot_bytes) {
    const uint64_t fit = core->keep_bytes / slot_bytes;
    if (cycle_ns == 0 || core->keep_ns / cycle_ns >= fit) {
        return fit;
    }
    return core->keep_ns / cycle_ns + 1;
}

fsn_status fsn_core_fit_recorder(struct fsn_core *core, uint64_t cycle_ns) {
    struct fsn_rt_recorder *r = &core->rt.recorder;
    const size_t slot_bytes = slot_words(&core->rt) * sizeof *r->words;
    const uint64_t slots = core->keep_ns > 0 ? slots_for(core, cycle_ns, slot_bytes) : 0;
    if (core->keep_ns > 0 && slots == 0) {
        return FSN_E_ARG;
    }
    if (slots == r->slots) {
        return FSN_OK;
    }
    free((void *)r->words);
    *r = (struct fsn_rt_recorder){.last = atomic_load(&r->last)};
    if (slots == 0) {
        return FSN_OK;
    }
    /* mutants: more room or another alignment costs, and is not wrong */
    r->words = aligned_alloc(64, (size_t)((slots * slot_bytes + 63) / 64 * 64));
    if (r->words == NULL) {
        return FSN_E_NOMEM;
    }
    /* mutants: no calloc; its pages would be touched for the first time in a cycle */
    memset((void *)r->words, 0, (size_t)(slots * slot_bytes));
    r->slots = slots;
    r->slot_words = slot_words(&core->rt);
    return FSN_OK;
}

fsn_status fsn_core_keep(struct fsn_core *core, uint64_t time_ns, size_t most_bytes) {
    if (core == NULL) {
        return FSN_E_ARG;
    }
    if (core->running) {
        return FSN_E_STATE;
    }
    core->keep_ns = time_ns;
    core->keep_bytes = most_bytes;
    const fsn_status status = fsn_core_fit_recorder(core, core->plan->cycle_ns);
    if (status != FSN_OK) {
        core->keep_ns = 0;
    }
    return status;
}

uint64_t fsn_core_last_cycle(const struct fsn_core *core) {
    return core == NULL ? 0 : atomic_load_explicit(&core->rt.recorder.last, memory_order_acquire);
}

uint64_t fsn_core_kept_cycles(const struct fsn_core *core) {
    return core == NULL ? 0 : core->rt.recorder.slots;
}

fsn_status fsn_core_record(const struct fsn_core *core, uint64_t cycle, struct fsn_cycle *record,
                           struct fsn_wkc *wkc, uint8_t *image) {
    if (core == NULL || cycle == 0) {
        return FSN_E_ARG;
    }
    const struct fsn_rt_recorder *r = &core->rt.recorder;
    if (r->slots == 0) {
        return FSN_E_STATE;
    }
    if (cycle > fsn_core_last_cycle(core)) {
        return FSN_E_BUSY;
    }
    const _Atomic uint64_t *sequence = r->words + (cycle % r->slots) * r->slot_words;
    if (atomic_load_explicit(sequence, memory_order_relaxed) != 2 * cycle) {
        return FSN_E_ARG;
    }
    const _Atomic uint64_t *from = fsn_words_take(sequence + 1, record, sizeof *record);
    from = fsn_words_take(from, wkc, core->rt.datagram_count * sizeof *wkc);
    fsn_words_take(from, image, core->rt.image_bytes);
    /* The loads above must not be reordered after the second read of the sequence. */
    atomic_thread_fence(memory_order_acquire);
    return atomic_load_explicit(sequence, memory_order_relaxed) == 2 * cycle ? FSN_OK : FSN_E_ARG;
}
