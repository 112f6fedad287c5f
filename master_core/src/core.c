#define _GNU_SOURCE

#include "fsn/core.h"

#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "plan_internal.h"
#include "rt/rt.h"

struct fsn_core {
    struct fsn_rt rt;
    const struct fsn_plan *plan;
    struct fsn_bus_layout layout;
    struct fsn_rt_copy *copies;
    struct fsn_rt_group *groups;
    struct fsn_connection_status *connections;
    uint32_t *active;
    uint8_t *is_active; /**< per symbol */
    pthread_t thread;
    bool running;
};

/** A copy with absolute bytes while neighbours are merged and sizes grouped. */
struct span {
    uint32_t source, destination, size_bytes;
};

static uint32_t sm_size(const struct fsn_plan *plan, uint32_t sm) {
    return (fsn_get32(fsn_record(plan, FSN_SEC_SM, sm) + 8) + 7) / 8;
}

struct place {
    uint32_t begin, end;
    uint8_t direction;
};

static int by_begin(const void *a, const void *b) {
    const struct place *x = a;
    const struct place *y = b;
    return (x->begin > y->begin) - (x->begin < y->begin);
}

/** Every placed sync manager lies inside the image and over no other: an input that shared bytes
 *  with an output would show us our own frames. */
static fsn_status check_layout(const struct fsn_core *core, struct fsn_fault *fault) {
    const struct fsn_plan *plan = core->plan;
    const struct fsn_bus_layout *layout = &core->layout;
    const uint32_t count = plan->count[FSN_SEC_SM];
    struct place *places = calloc((size_t)count + 1, sizeof *places);
    if (places == NULL) {
        return fsn_refuse(fault, FSN_E_NOMEM, 0, FSN_FAULT_NO_RECORD, 0);
    }
    fsn_status status = FSN_OK;
    uint32_t used = 0;
    for (uint32_t sm = 0; sm < count && status == FSN_OK; sm++) {
        const uint32_t base = layout->sm_base[sm];
        const uint32_t size = sm_size(plan, sm);
        if (base == FSN_NONE || size == 0) {
            continue;
        }
        if (base > layout->image_bytes || size > layout->image_bytes - base ||
            layout->sm_datagram[sm] >= layout->datagram_count) {
            status = fsn_refuse(fault, FSN_E_BUS_IMAGE, FSN_SEC_SM, sm, 0);
        }
        places[used++] =
            (struct place){base, base + size, fsn_record(plan, FSN_SEC_SM, sm)[5]};
    }
    qsort(places, used, sizeof *places, by_begin);
    for (uint32_t i = 1; i < used && status == FSN_OK; i++) {
        if (places[i].begin < places[i - 1].end) {
            status = fsn_refuse(fault, FSN_E_BUS_OVERLAP, FSN_SEC_SM, FSN_FAULT_NO_RECORD, 0);
        }
    }
    free(places);
    return status;
}

/** Resolves one copy to absolute bytes. One sync manager is in one datagram, so a frame that lies
 *  inside its sync manager is never split; that is proved here once more for the bus's layout. */
static fsn_status resolve_copy(const struct fsn_core *core, uint32_t number, struct span *span,
                               struct fsn_fault *fault) {
    struct fsn_copy_info copy;
    fsn_status status = fsn_plan_copy(core->plan, number, &copy);
    if (status != FSN_OK) {
        return fsn_refuse(fault, status, FSN_SEC_COPY, number, 0);
    }
    const uint32_t source = core->layout.sm_base[copy.source_sm];
    const uint32_t destination = core->layout.sm_base[copy.destination_sm];
    if (source == FSN_NONE || destination == FSN_NONE) {
        return fsn_refuse(fault, FSN_E_BUS_IMAGE, FSN_SEC_COPY, number, 0);
    }
    const uint32_t source_room = sm_size(core->plan, copy.source_sm);
    const uint32_t destination_room = sm_size(core->plan, copy.destination_sm);
    if (copy.source_byte + copy.size_bytes > source_room ||
        copy.destination_byte + copy.size_bytes > destination_room) {
        return fsn_refuse(fault, FSN_E_COPY_RANGE, FSN_SEC_COPY, number, 0);
    }
    *span = (struct span){source + copy.source_byte, destination + copy.destination_byte,
                          copy.size_bytes};
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

/** Merges neighbours that are neighbours on both sides. The input is sorted by destination. */
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
    struct span *spans = calloc((size_t)count + 1, sizeof *spans);
    core->copies = calloc((size_t)count + 1, sizeof *core->copies);
    core->groups = calloc((size_t)count + 1, sizeof *core->groups);
    if (spans == NULL || core->copies == NULL || core->groups == NULL) {
        free(spans);
        return fsn_refuse(fault, FSN_E_NOMEM, 0, FSN_FAULT_NO_RECORD, 0);
    }
    fsn_status status = FSN_OK;
    for (uint32_t i = 0; i < count && status == FSN_OK; i++) {
        status = resolve_copy(core, i, &spans[i], fault);
        core->rt.bytes_per_cycle += status == FSN_OK ? spans[i].size_bytes : 0;
    }
    if (status == FSN_OK) {
        qsort(spans, count, sizeof *spans, by_destination);
        for (uint32_t i = 1; i < count && status == FSN_OK; i++) {
            if (spans[i].destination < spans[i - 1].destination + spans[i - 1].size_bytes) {
                status = fsn_refuse(fault, FSN_E_COPY_OVERLAP, FSN_SEC_COPY, i, 0);
            }
        }
        const uint32_t merged = merge(spans, count);
        qsort(spans, merged, sizeof *spans, by_size);
        group(core, spans, merged);
        core->rt.statistics.copies = count;
    }
    free(spans);
    return status;
}

static void watch(const struct fsn_core *core, uint32_t number, struct fsn_rt_watch *out) {
    struct fsn_copy_info copy;
    if (fsn_plan_copy(core->plan, number, &copy) == FSN_OK) {
        out->offset = core->layout.sm_base[copy.destination_sm] + copy.destination_byte;
        out->size_bytes = copy.size_bytes;
    }
}

static fsn_status activate_monitor(struct fsn_core *core, struct fsn_fault *fault) {
    const uint32_t count = core->plan->count[FSN_SEC_CONNECTION];
    core->connections = calloc((size_t)count + 1, sizeof *core->connections);
    core->rt.watches = calloc(2 * (size_t)count + 1, sizeof *core->rt.watches);
    if (core->connections == NULL || core->rt.watches == NULL) {
        return fsn_refuse(fault, FSN_E_NOMEM, 0, FSN_FAULT_NO_RECORD, 0);
    }
    for (uint32_t i = 0; i < count; i++) {
        struct fsn_connection_info info;
        if (fsn_plan_connection(core->plan, i, &info) == FSN_OK) {
            watch(core, info.copy_to_sub, &core->rt.watches[2 * i]);
            watch(core, info.copy_to_main, &core->rt.watches[2 * i + 1]);
        }
    }
    core->rt.connections = core->connections;
    core->rt.connection_count = count;
    return FSN_OK;
}

static fsn_status activate_outputs(struct fsn_core *core, struct fsn_fault *fault) {
    const uint32_t count = core->plan->count[FSN_SEC_SYMBOL];
    core->rt.outputs = calloc((size_t)count + 1, sizeof *core->rt.outputs);
    core->active = calloc((size_t)count + 1, sizeof *core->active);
    core->is_active = calloc((size_t)count + 1, 1);
    if (core->rt.outputs == NULL || core->active == NULL || core->is_active == NULL) {
        return fsn_refuse(fault, FSN_E_NOMEM, 0, FSN_FAULT_NO_RECORD, 0);
    }
    core->rt.active = core->active;
    for (uint32_t i = 0; i < count; i++) {
        struct fsn_symbol_info info;
        if (fsn_plan_symbol(core->plan, i, &info) != FSN_OK ||
            core->layout.sm_base[info.sm] == FSN_NONE) {
            continue;
        }
        core->rt.outputs[i].bit_offset = 8 * core->layout.sm_base[info.sm] + info.bit_offset;
        core->rt.outputs[i].bits = info.bits;
    }
    return FSN_OK;
}

static size_t words(size_t bytes) {
    return (bytes + 7) / 8;
}

static fsn_status activate_snapshot(struct fsn_core *core, struct fsn_fault *fault) {
    struct fsn_rt *rt = &core->rt;
    const size_t count = words(sizeof rt->statistics) +
                         words(rt->connection_count * sizeof *rt->connections) +
                         words(rt->image_bytes);
    rt->snapshot.words = calloc(count, sizeof *rt->snapshot.words);
    if (rt->snapshot.words == NULL) {
        return fsn_refuse(fault, FSN_E_NOMEM, 0, FSN_FAULT_NO_RECORD, 0);
    }
    rt->snapshot.word_count = (uint32_t)count;
    fsn_rt_publish(rt);
    return FSN_OK;
}

static fsn_status activate(struct fsn_core *core, struct fsn_fault *fault) {
    struct fsn_bus_layout *layout = &core->layout;
    fsn_status status = core->rt.ops->open(core->rt.bus, core->plan, layout);
    if (status != FSN_OK) {
        return fsn_refuse(fault, status, 0, FSN_FAULT_NO_RECORD, 0);
    }
    if (layout->sm_base == NULL || layout->sm_datagram == NULL || layout->datagram_count == 0 ||
        (layout->image == NULL && layout->image_bytes > 0)) {
        return fsn_refuse(fault, FSN_E_BUS_IMAGE, 0, FSN_FAULT_NO_RECORD, 0);
    }
    status = check_layout(core, fault);
    if (status != FSN_OK) {
        return status;
    }
    core->rt.image = layout->image;
    core->rt.image_bytes = layout->image_bytes;
    if (layout->image_bytes > 0) {
        /* Until its source has delivered once, a destination holds zeros. */
        memset(layout->image, 0, layout->image_bytes);
    }
    typedef fsn_status (*step)(struct fsn_core *, struct fsn_fault *);
    static const step steps[] = {activate_copies, activate_monitor, activate_outputs,
                                 activate_snapshot};
    for (size_t i = 0; i < sizeof steps / sizeof steps[0] && status == FSN_OK; i++) {
        status = steps[i](core, fault);
    }
    return status;
}

fsn_status fsn_core_create(const struct fsn_plan *plan, const struct fsn_bus_ops *ops, void *bus,
                           struct fsn_core **out, struct fsn_fault *fault) {
    if (out == NULL) {
        return fsn_refuse(fault, FSN_E_ARG, 0, FSN_FAULT_NO_RECORD, 0);
    }
    *out = NULL;
    if (plan == NULL || ops == NULL || ops->open == NULL || ops->receive == NULL ||
        ops->send == NULL) {
        return fsn_refuse(fault, FSN_E_ARG, 0, FSN_FAULT_NO_RECORD, 0);
    }
    struct fsn_core *core = calloc(1, sizeof *core);
    if (core == NULL) {
        return fsn_refuse(fault, FSN_E_NOMEM, 0, FSN_FAULT_NO_RECORD, 0);
    }
    core->plan = plan;
    core->rt.ops = ops;
    core->rt.bus = bus;
    const fsn_status status = activate(core, fault);
    if (status != FSN_OK) {
        fsn_core_free(core);
        return status;
    }
    *out = core;
    return FSN_OK;
}

void fsn_core_free(struct fsn_core *core) {
    if (core == NULL) {
        return;
    }
    fsn_core_stop(core);
    if (core->rt.ops->close != NULL) {
        core->rt.ops->close(core->rt.bus);
    }
    free(core->copies);
    free(core->groups);
    free(core->connections);
    free(core->rt.watches);
    free(core->rt.outputs);
    free(core->active);
    free(core->is_active);
    free((void *)core->rt.snapshot.words);
    free(core);
}

fsn_status fsn_core_cycle(struct fsn_core *core, uint64_t now_ns) {
    if (core->running) {
        return FSN_E_STATE;
    }
    fsn_rt_cycle(&core->rt, now_ns, false);
    return FSN_OK;
}

static void *thread_main(void *argument) {
    struct fsn_core *core = argument;
    /* Touch the stack once, so that no page fault falls into a cycle. */
    volatile uint8_t stack[16384];
    for (size_t i = 0; i < sizeof stack; i += 1024) {
        stack[i] = 0;
    }
    fsn_rt_loop(&core->rt);
    return NULL;
}

static int create_thread(struct fsn_core *core, const struct fsn_thread_options *options,
                         bool realtime) {
    pthread_attr_t attributes;
    int error = pthread_attr_init(&attributes);
    if (error != 0) {
        return error;
    }
    if (realtime) {
        const struct sched_param parameter = {.sched_priority = options->priority};
        pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
        pthread_attr_setschedpolicy(&attributes, SCHED_FIFO);
        pthread_attr_setschedparam(&attributes, &parameter);
    }
    if (options->cpu > 0) {
        cpu_set_t set;
        CPU_ZERO(&set);
        CPU_SET((size_t)options->cpu - 1, &set);
        pthread_attr_setaffinity_np(&attributes, sizeof set, &set);
    }
    core->rt.statistics.realtime = realtime;
    error = pthread_create(&core->thread, &attributes, thread_main, core);
    pthread_attr_destroy(&attributes);
    return error;
}

fsn_status fsn_core_start(struct fsn_core *core, const struct fsn_thread_options *options,
                          struct fsn_fault *fault) {
    if (core->running) {
        return fsn_refuse(fault, FSN_E_STATE, 0, FSN_FAULT_NO_RECORD, 0);
    }
    const uint64_t cycle_ns = options->cycle_ns ? options->cycle_ns : core->plan->cycle_ns;
    if (cycle_ns < 1000 || cycle_ns > 4000000000u || options->priority < 0 ||
        options->priority > 99 || options->cpu < 0 || options->cpu > CPU_SETSIZE) {
        return fsn_refuse(fault, FSN_E_ARG, 0, FSN_FAULT_NO_RECORD, 0);
    }
    core->rt.cycle_ns = cycle_ns;
    atomic_store(&core->rt.stop, false);
    int error = 0;
    if (options->lock_memory && mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
        error = errno;
    }
    if (error == 0) {
        error = create_thread(core, options, options->priority > 0);
        if (error == EPERM && options->priority > 0) {
            error = create_thread(core, options, false);
        }
    }
    if (error != 0) {
        fsn_refuse(fault, FSN_E_SYS, 0, FSN_FAULT_NO_RECORD, 0);
        if (fault != NULL) {
            fault->sys_errno = error;
        }
        return FSN_E_SYS;
    }
    core->running = true;
    return FSN_OK;
}

void fsn_core_stop(struct fsn_core *core) {
    if (!core->running) {
        return;
    }
    atomic_store(&core->rt.stop, true);
    pthread_join(core->thread, NULL);
    core->running = false;
}

/** Copies words of the snapshot; `to` may be NULL to skip them. */
static const _Atomic uint64_t *take(const _Atomic uint64_t *from, void *to, size_t len_bytes) {
    uint8_t *bytes = to;
    for (size_t at = 0; at < len_bytes; at += 8, from++) {
        if (bytes != NULL) {
            const uint64_t word = atomic_load_explicit(from, memory_order_relaxed);
            const size_t left = len_bytes - at;
            memcpy(bytes + at, &word, left < 8 ? left : 8);
        }
    }
    return from;
}

fsn_status fsn_core_snapshot(struct fsn_core *core, struct fsn_statistics *statistics,
                             struct fsn_connection_status *connections, uint8_t *image) {
    enum { ATTEMPTS = 1000 };
    const struct fsn_rt *rt = &core->rt;
    for (int i = 0; i < ATTEMPTS; i++) {
        const uint32_t before =
            atomic_load_explicit(&rt->snapshot.sequence, memory_order_acquire);
        if (before % 2 != 0) {
            sched_yield();
            continue;
        }
        const _Atomic uint64_t *from = rt->snapshot.words;
        from = take(from, statistics, sizeof rt->statistics);
        from = take(from, connections, rt->connection_count * sizeof *rt->connections);
        take(from, image, rt->image_bytes);
        atomic_thread_fence(memory_order_acquire);
        if (atomic_load_explicit(&rt->snapshot.sequence, memory_order_relaxed) == before) {
            return FSN_OK;
        }
    }
    return FSN_E_BUSY;
}

uint32_t fsn_core_image_bytes(const struct fsn_core *core) {
    return core->rt.image_bytes;
}

uint32_t fsn_core_sm_base(const struct fsn_core *core, uint32_t sm) {
    return sm < core->plan->count[FSN_SEC_SM] ? core->layout.sm_base[sm] : FSN_NONE;
}

bool fsn_core_event(struct fsn_core *core, struct fsn_event *event) {
    struct fsn_rt_ring *ring = &core->rt.ring;
    const uint32_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    if (tail == atomic_load_explicit(&ring->head, memory_order_acquire)) {
        return false;
    }
    *event = ring->slot[tail % FSN_RT_EVENTS];
    atomic_store_explicit(&ring->tail, tail + 1, memory_order_release);
    return true;
}

/** Whether a copy writes a byte of this symbol; copies are sorted by destination. */
static bool is_copied(const struct fsn_plan *plan, const struct fsn_symbol_info *symbol) {
    const uint32_t first = symbol->bit_offset / 8;
    const uint32_t behind = (symbol->bit_offset + symbol->bits + 7) / 8;
    for (uint32_t i = 0; i < plan->count[FSN_SEC_COPY]; i++) {
        struct fsn_copy_info copy;
        if (fsn_plan_copy(plan, i, &copy) == FSN_OK && copy.destination_sm == symbol->sm &&
            copy.destination_byte < behind && first < copy.destination_byte + copy.size_bytes) {
            return true;
        }
    }
    return false;
}

fsn_status fsn_core_set_output(struct fsn_core *core, uint32_t symbol, uint64_t value) {
    struct fsn_symbol_info info;
    if (fsn_plan_symbol(core->plan, symbol, &info) != FSN_OK ||
        core->rt.outputs[symbol].bits == 0) {
        return FSN_E_ARG;
    }
    atomic_store_explicit(&core->rt.outputs[symbol].value, value, memory_order_relaxed);
    if (core->is_active[symbol]) {
        return FSN_OK;
    }
    if (!info.output || is_copied(core->plan, &info)) {
        return FSN_E_CLOSED;
    }
    const uint32_t count = atomic_load_explicit(&core->rt.active_count, memory_order_relaxed);
    core->active[count] = symbol;
    core->is_active[symbol] = 1;
    atomic_store_explicit(&core->rt.active_count, count + 1, memory_order_release);
    return FSN_OK;
}

fsn_status fsn_core_read_symbol(const struct fsn_core *core, const uint8_t *image, uint32_t symbol,
                                uint64_t *value) {
    if (symbol >= core->plan->count[FSN_SEC_SYMBOL] || core->rt.outputs[symbol].bits == 0) {
        return FSN_E_ARG;
    }
    const uint32_t first = core->rt.outputs[symbol].bit_offset;
    *value = 0;
    for (uint32_t i = 0; i < core->rt.outputs[symbol].bits; i++) {
        const uint32_t bit = first + i;
        *value |= (uint64_t)((image[bit / 8] >> (bit % 8)) & 1u) << i;
    }
    return FSN_OK;
}
