/** Activation: the plan refers to sync managers, the bus to an image. Here both are converted to
 *  absolute bytes, are verified together, and never change afterwards. */
#include <stdlib.h>
#include <string.h>

#include "core/core_internal.h"
#include "rt/prefault.h"
#include "rt/words.h"

/** A copy with absolute bytes while neighbours are merged and sizes grouped. */
struct span {
    uint32_t source, destination, size_bytes;
    uint32_t number; /**< copy of the plan, to be named in a refusal */
};

/** Position of a sync manager in the image. */
struct place {
    uint32_t begin, end, sm;
};

static fsn_status refuse_copy(struct fsn_fault *fault, fsn_status status, uint32_t number,
                              const char *rule) {
    return fsn_refuse(fault, status, FSN_SEC_COPY, number, 0, rule);
}

static int by_begin(const void *a, const void *b) {
    const struct place *x = a;
    const struct place *y = b;
    return (x->begin > y->begin) - (x->begin < y->begin);
}

/** Fills `places` with the sync managers that have one, each inside the image. */
static fsn_status place_all(const struct fsn_core *core, struct place *places, uint32_t *used,
                            struct fsn_fault *fault) {
    const struct fsn_bus_layout *layout = &core->layout;
    *used = 0;
    for (uint32_t sm = 0; sm < core->plan->count[FSN_SEC_SM]; sm++) {
        const uint32_t base = layout->sm_base[sm];
        const uint32_t size = fsn_sm_bytes(core->plan, sm);
        if (base == FSN_NONE || size == 0) {
            continue;
        }
        if (base > layout->image_bytes || size > layout->image_bytes - base) {
            return fsn_refuse(fault, FSN_E_BUS_IMAGE, FSN_SEC_SM, sm, 0, NULL);
        }
        places[(*used)++] = (struct place){base, base + size, sm};
    }
    return FSN_OK;
}

/** Sync managers must not overlap: an input that shares bytes with an output would return our own
 *  frames, and two outputs that share bytes would make disjoint copies collide. */
static fsn_status check_places(const struct fsn_core *core, struct fsn_fault *fault) {
    struct place *places;
    if (!FSN_NEW(places, core->plan->count[FSN_SEC_SM])) {
        return fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
    }
    uint32_t used = 0;
    fsn_status status = place_all(core, places, &used, fault);
    if (status == FSN_OK) {
        qsort(places, used, sizeof *places, by_begin);
    }
    for (uint32_t i = 1; i < used && status == FSN_OK; i++) {
        if (places[i].begin < places[i - 1].end) {
            status = fsn_refuse(fault, FSN_E_BUS_OVERLAP, FSN_SEC_SM, places[i].sm, 0, NULL);
        }
    }
    free(places);
    return status;
}

static fsn_status check_layout(const struct fsn_core *core, struct fsn_fault *fault) {
    const struct fsn_bus_layout *layout = &core->layout;
    if (layout->sm_base == NULL || layout->datagram_begin == NULL || layout->datagram_count == 0 ||
        (layout->image == NULL && layout->image_bytes > 0)) {
        return fsn_refuse_all(fault, FSN_E_BUS_IMAGE, "the bus left a part of its layout empty");
    }
    /* Places are later counted in bits, which must fit into 32 bits. */
    if (layout->image_bytes > UINT32_MAX / 8) {
        return fsn_refuse_all(fault, FSN_E_BUS_IMAGE, "the image has 512 MiB or more");
    }
    for (uint32_t d = 0; d < layout->datagram_count; d++) {
        const uint32_t begin = layout->datagram_begin[d];
        if (begin > layout->image_bytes ||
            (d == 0 ? begin != 0 : begin < layout->datagram_begin[d - 1])) {
            return fsn_refuse_all(fault, FSN_E_BUS_IMAGE,
                                  "datagrams do not start at 0 and rise inside the image");
        }
    }
    return check_places(core, fault);
}

/** Datagram that carries a byte of the image. */
static uint32_t datagram_of(const struct fsn_bus_layout *layout, uint32_t byte) {
    uint32_t low = 0;
    uint32_t high = layout->datagram_count;
    while (high - low > 1) {
        const uint32_t middle = low + (high - low) / 2;
        if (layout->datagram_begin[middle] <= byte) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

static bool straddles(const struct fsn_bus_layout *layout, uint32_t byte, uint32_t size_bytes) {
    return datagram_of(layout, byte) != datagram_of(layout, byte + size_bytes - 1);
}

/** An FSoE copy must be one of the two of its connection, and run in the direction it has there.
 *  The loader has proved it; it is proved again here, because this keeps frames separate. */
static bool is_paired(const struct fsn_plan *plan, uint32_t number,
                      const struct fsn_copy_info *copy) {
    struct fsn_connection_info c;
    if (copy->kind != FSN_COPY_FSOE) {
        return true;
    }
    if (fsn_plan_connection(plan, copy->connection, &c) != FSN_OK ||
        (number != c.copy_to_sub && number != c.copy_to_main)) {
        return false;
    }
    const uint32_t from = number == c.copy_to_sub ? c.main_subdevice : c.sub_subdevice;
    const uint32_t to = number == c.copy_to_sub ? c.sub_subdevice : c.main_subdevice;
    return fsn_read_sm(plan, copy->source_sm).subdevice == from &&
           fsn_read_sm(plan, copy->destination_sm).subdevice == to;
}

/** Resolves one copy to absolute bytes and verifies it for this bus. */
static fsn_status resolve_copy(const struct fsn_core *core, uint32_t number, struct span *span,
                               struct fsn_fault *fault) {
    const struct fsn_plan *plan = core->plan;
    const struct fsn_bus_layout *layout = &core->layout;
    const struct fsn_copy_info copy = fsn_known_copy(plan, number);
    if (layout->sm_base[copy.source_sm] == FSN_NONE ||
        layout->sm_base[copy.destination_sm] == FSN_NONE) {
        return refuse_copy(fault, FSN_E_BUS_IMAGE, number,
                           "the bus gives a sync manager of this copy no place in its image");
    }
    if (fsn_read_sm(plan, copy.source_sm).direction != FSN_INPUT ||
        fsn_read_sm(plan, copy.destination_sm).direction != FSN_OUTPUT) {
        return refuse_copy(fault, FSN_E_COPY_DIRECTION, number, NULL);
    }
    if (copy.source_byte + copy.size_bytes > fsn_sm_bytes(plan, copy.source_sm) ||
        copy.destination_byte + copy.size_bytes > fsn_sm_bytes(plan, copy.destination_sm)) {
        return refuse_copy(fault, FSN_E_COPY_RANGE, number, NULL);
    }
    if (!is_paired(plan, number, &copy)) {
        return refuse_copy(fault, FSN_E_COPY_PAIR, number, NULL);
    }
    *span = (struct span){layout->sm_base[copy.source_sm] + copy.source_byte,
                          layout->sm_base[copy.destination_sm] + copy.destination_byte,
                          copy.size_bytes, number};
    /* Two datagrams may come from two passes of the bus: a part of the frame would be old. */
    if (straddles(layout, span->source, span->size_bytes) ||
        straddles(layout, span->destination, span->size_bytes)) {
        return refuse_copy(fault, FSN_E_BUS_STRADDLE, number, NULL);
    }
    return FSN_OK;
}

static int by_destination(const void *a, const void *b) {
    const struct span *x = a;
    const struct span *y = b;
    return (x->destination > y->destination) - (x->destination < y->destination);
}

static int by_size(const void *a, const void *b) {
    const struct span *x = a;
    const struct span *y = b;
    if (x->size_bytes != y->size_bytes) {
        return x->size_bytes < y->size_bytes ? -1 : 1;
    }
    return by_destination(a, b);
}

static fsn_status check_disjoint(const struct span *spans, uint32_t count,
                                 struct fsn_fault *fault) {
    for (uint32_t i = 1; i < count; i++) {
        if (spans[i].destination < spans[i - 1].destination + spans[i - 1].size_bytes) {
            return refuse_copy(fault, FSN_E_COPY_OVERLAP, spans[i].number, NULL);
        }
    }
    return FSN_OK;
}

/** Merges copies that are adjacent on both sides. The input is sorted by destination. */
static uint32_t merge(struct span *spans, uint32_t count) {
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; i++) {
        struct span *last = kept > 0 ? &spans[kept - 1] : NULL;
        if (last != NULL && last->destination + last->size_bytes == spans[i].destination &&
            last->source + last->size_bytes == spans[i].source) {
            last->size_bytes += spans[i].size_bytes;
        } else {
            spans[kept++] = spans[i];
        }
    }
    return kept;
}

/** Sorts the merged copies by size into groups. */
static void group(struct fsn_core *core, const struct span *spans, uint32_t count) {
    uint32_t groups = 0;
    for (uint32_t i = 0; i < count; i++) {
        core->copies[i] = (struct fsn_rt_copy){spans[i].source, spans[i].destination};
        if (groups > 0 && core->groups[groups - 1].size_bytes == spans[i].size_bytes) {
            core->groups[groups - 1].count++;
        } else {
            core->groups[groups++] = (struct fsn_rt_group){spans[i].size_bytes, i, 1};
        }
    }
    core->rt.copies = core->copies;
    core->rt.groups = core->groups;
    core->rt.group_count = groups;
    core->rt.statistics.merged_copies = count;
}

static fsn_status activate_copies(struct fsn_core *core, struct fsn_fault *fault) {
    const uint32_t count = core->plan->count[FSN_SEC_COPY];
    struct span *spans;
    if (!FSN_NEW(spans, count) || !FSN_NEW_PREFAULTED(core->copies, count) ||
        !FSN_NEW_PREFAULTED(core->groups, count)) {
        free(spans);
        return fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
    }
    fsn_status status = FSN_OK;
    for (uint32_t i = 0; i < count && status == FSN_OK; i++) {
        status = resolve_copy(core, i, &spans[i], fault);
        core->rt.bytes_per_cycle += status == FSN_OK ? spans[i].size_bytes : 0;
    }
    if (status == FSN_OK) {
        qsort(spans, count, sizeof *spans, by_destination);
        status = check_disjoint(spans, count, fault);
    }
    if (status == FSN_OK) {
        const uint32_t merged = merge(spans, count);
        qsort(spans, merged, sizeof *spans, by_size);
        group(core, spans, merged);
        core->rt.statistics.copies = count;
    }
    free(spans);
    return status;
}

static fsn_status watch(struct fsn_core *core, uint32_t number, uint32_t *seen_bytes,
                        struct fsn_fault *fault) {
    struct fsn_rt_watch *watch = &core->rt.watches[number];
    const struct fsn_connection_info info = fsn_known_connection(core->plan, number);
    const uint32_t copies[] = {info.copy_to_sub, info.copy_to_main};
    watch->seen = *seen_bytes;
    for (unsigned way = 0; way < 2; way++) {
        struct fsn_copy_info copy;
        if (fsn_plan_copy(core->plan, copies[way], &copy) != FSN_OK) {
            return fsn_refuse(fault, FSN_E_COPY_PAIR, FSN_SEC_CONNECTION, number, 0, NULL);
        }
        watch->offset[way] = core->layout.sm_base[copy.destination_sm] + copy.destination_byte;
        watch->size_bytes[way] = copy.size_bytes;
        *seen_bytes += copy.size_bytes;
    }
    /* A live connection has a new frame within its watchdog; Resets are about as frequent. */
    const uint64_t watchdog_ms = (info.known & 4) != 0 ? info.watchdog_ms : 500;
    watch->silent_ns = 2 * watchdog_ms * UINT64_C(1000000);
    watch->planned = fsn_planned_parameters(&info);
    const fsn_status status = fsn_monitor_init(
        &core->rt.monitors[number], watch->size_bytes[FSN_TO_SUB], watch->size_bytes[FSN_TO_MAIN]);
    return status == FSN_OK ? FSN_OK : refuse_copy(fault, FSN_E_COPY_FRAME, copies[0], NULL);
}

static fsn_status activate_monitor(struct fsn_core *core, struct fsn_fault *fault) {
    struct fsn_rt *rt = &core->rt;
    const uint32_t count = core->plan->count[FSN_SEC_CONNECTION];
    if (!FSN_NEW_PREFAULTED(rt->watches, count) || !FSN_NEW_PREFAULTED(rt->monitors, count)) {
        return fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
    }
    rt->connection_count = count;
    uint32_t seen_bytes = 0;
    for (uint32_t i = 0; i < count; i++) {
        FSN_TRY(watch(core, i, &seen_bytes, fault));
    }
    return FSN_NEW_PREFAULTED(rt->seen, seen_bytes) ? FSN_OK
                                                    : fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
}

/** Whether the application may write this symbol: an output that belongs to neither a copy nor a
 *  recognised FSoE block. */
static bool is_open(const struct fsn_plan *plan, const struct fsn_symbol_info *symbol) {
    const uint32_t first = symbol->bit_offset / 8;
    const uint32_t last = (symbol->bit_offset + symbol->bits - 1u) / 8;
    return symbol->output != 0 && fsn_read_sm(plan, symbol->sm).direction == FSN_OUTPUT &&
           fsn_overlap_of(plan, symbol->sm, first, last - first + 1) == FSN_OVERLAP_NONE &&
           !fsn_is_copied(plan, symbol);
}

static fsn_status activate_outputs(struct fsn_core *core, struct fsn_fault *fault) {
    const uint32_t count = core->plan->count[FSN_SEC_SYMBOL];
    if (!FSN_NEW_PREFAULTED(core->rt.outputs, count) || !FSN_NEW_PREFAULTED(core->active, count) ||
        !FSN_NEW(core->active_slot, count) || !FSN_NEW(core->wanted, count) ||
        !FSN_NEW_PREFAULTED(core->set_values, FSN_TRIPLE_SETS * ((size_t)count + 1))) {
        return fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
    }
    core->rt.active = core->active;
    for (size_t set = 0; set < FSN_TRIPLE_SETS; set++) {
        core->rt.sets.set[set].values = core->set_values + set * ((size_t)count + 1);
    }
    fsn_triple_init(&core->rt.sets.triple);
    for (uint32_t i = 0; i < count; i++) {
        const struct fsn_symbol_info info = fsn_known_symbol(core->plan, i);
        if (core->layout.sm_base[info.sm] == FSN_NONE) {
            continue;
        }
        core->rt.outputs[i].bit_offset = 8 * core->layout.sm_base[info.sm] + info.bit_offset;
        core->rt.outputs[i].bits = info.bits;
        core->rt.outputs[i].open = is_open(core->plan, &info);
    }
    return FSN_OK;
}

/** Allocates the data that the bus fills in every cycle, and its counters. */
static fsn_status activate_input(struct fsn_core *core, struct fsn_fault *fault) {
    struct fsn_rt *rt = &core->rt;
    rt->datagram_count = core->layout.datagram_count;
    rt->sm_count = core->plan->count[FSN_SEC_SM];
    return FSN_NEW_PREFAULTED(rt->input.wkc, rt->datagram_count) &&
                   FSN_NEW_PREFAULTED(rt->input.sm_stale, rt->sm_count) &&
                   FSN_NEW_PREFAULTED(rt->stale, rt->sm_count)
               ? FSN_OK
               : fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
}

static fsn_status activate_snapshot(struct fsn_core *core, struct fsn_fault *fault) {
    struct fsn_rt *rt = &core->rt;
    const size_t count = fsn_words_of(sizeof rt->statistics) +
                         fsn_words_of(rt->connection_count * sizeof(struct fsn_connection_status)) +
                         fsn_words_of(rt->image_bytes);
    for (int i = 0; i < FSN_RT_PICTURES; i++) {
        if (!FSN_NEW_PREFAULTED(rt->snapshot.words[i], count)) {
            return fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
        }
    }
    fsn_rt_publish(rt);
    return FSN_OK;
}

fsn_status fsn_core_activate(struct fsn_core *core, struct fsn_fault *fault) {
    struct fsn_bus_layout *layout = &core->layout;
    struct fsn_fault of_bus;
    fsn_refuse_all(&of_bus, FSN_OK, NULL);
    const fsn_status status = core->rt.ops->open(core->rt.bus, core->plan, layout, &of_bus);
    if (status != FSN_OK) {
        if (of_bus.status != status) {
            return fsn_refuse_all(fault, status, "the bus does not open");
        }
        if (fault != NULL) {
            *fault = of_bus;
        }
        return status;
    }
    core->opened = true;
    FSN_TRY(check_layout(core, fault));
    core->rt.image = layout->image;
    core->rt.image_bytes = layout->image_bytes;
    if (layout->image_bytes > 0) {
        /* Until its source has delivered data, a destination contains zeros. */
        memset(layout->image, 0, layout->image_bytes);
    }
    FSN_TRY(activate_copies(core, fault));
    FSN_TRY(activate_monitor(core, fault));
    FSN_TRY(activate_outputs(core, fault));
    FSN_TRY(activate_input(core, fault));
    return activate_snapshot(core, fault);
}
