#include "fsn/several.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/exchange.h"
#include "fsn/acyclic.h"
#include "plan/plan_internal.h"
#include "rt/prefault.h"

/** One bus, with its place in the leading image. */
struct member {
    struct fsn_several_member of;
    struct fsn_plan *part; /**< the plan of this bus alone */
    struct fsn_bus_info info;
    uint32_t first_sm;
    struct fsn_bus_layout layout;
    struct fsn_exchange exchange;
    uint32_t image_base, datagram_base;
    struct fsn_core *core; /**< its cycle; NULL: it is the first bus */
    uint64_t elapsed_ns;   /**< without threads: time since its last cycle */
    bool open;
};

struct fsn_several {
    const struct fsn_plan *plan;
    struct fsn_thread_options thread;
    bool threads;
    uint32_t count;
    struct member *members;
    struct fsn_bus_ops ops;
    struct fsn_bus_acyclic acyclic;
    /* The leading image. */
    uint8_t *image;
    uint32_t *sm_base;
    uint32_t *datagram_begin;
    /** Of the first bus alone; written by its cycle. */
    _Atomic uint64_t lost_frames, wkc_errors;
    _Atomic uint32_t expected_wkc, actual_wkc;
};

/* -- cycles --------------------------------------------------------------------------------- */

/** The cycle of a further bus: publish its inputs before its own copies, then fetch outputs. */
static void further_receive(void *context, struct fsn_bus_input *input) {
    struct member *m = context;
    m->of.ops->receive(m->of.bus, input);
    fsn_exchange_in_bus(&m->exchange, input);
}

static void further_send(void *context) {
    struct member *m = context;
    m->of.ops->send(m->of.bus);
}

/** Without threads: runs the cycles that are due, each at most once per leading cycle. */
static void run_due(struct fsn_several *several) {
    const uint64_t cycle_ns = several->members[0].info.cycle_ns;
    for (uint32_t n = 1; n < several->count; n++) {
        struct member *m = &several->members[n];
        m->elapsed_ns += cycle_ns;
        if (m->elapsed_ns >= m->info.cycle_ns) {
            m->elapsed_ns -= m->info.cycle_ns;
            const uint64_t now_ns = fsn_core_last_cycle(m->core) * m->info.cycle_ns;
            if (fsn_core_cycle(m->core, now_ns) != FSN_OK) {
                continue; /* GCOVR_EXCL_LINE: it has no thread, and no other one runs it */
            }
        }
    }
}

/** The counters of the core are for all buses; these are for the first. */
static void count_lead(struct fsn_several *several, const struct fsn_bus_input *input) {
    uint32_t expected = 0;
    uint32_t actual = 0;
    uint32_t bad = 0;
    for (uint32_t d = 0; d < several->members[0].layout.datagram_count; d++) {
        expected += input->wkc[d].expected;
        actual += input->wkc[d].actual;
        bad += input->wkc[d].expected != input->wkc[d].actual;
    }
    atomic_store_explicit(&several->expected_wkc, expected, memory_order_relaxed);
    atomic_store_explicit(&several->actual_wkc, actual, memory_order_relaxed);
    atomic_fetch_add_explicit(&several->wkc_errors, bad > 0, memory_order_relaxed);
    atomic_fetch_add_explicit(&several->lost_frames, input->counts.lost_frames,
                              memory_order_relaxed);
}

static void several_receive(void *context, struct fsn_bus_input *input) {
    struct fsn_several *several = context;
    struct member *lead = &several->members[0];
    lead->of.ops->receive(lead->of.bus, input);
    count_lead(several, input);
    fsn_exchange_copy(several->image, lead->layout.image, lead->exchange.inputs,
                      lead->exchange.input_count);
    if (!several->threads) {
        run_due(several);
    }
    struct fsn_wkc *wkc = input->wkc;
    uint8_t *sm_stale = input->sm_stale;
    for (uint32_t n = 1; n < several->count; n++) {
        struct member *m = &several->members[n];
        input->wkc = wkc + m->datagram_base;
        input->sm_stale = sm_stale + m->first_sm;
        fsn_exchange_receive(&m->exchange, several->image + m->image_base, input);
    }
    input->wkc = wkc;
    input->sm_stale = sm_stale;
}

static void several_send(void *context) {
    struct fsn_several *several = context;
    struct member *lead = &several->members[0];
    fsn_exchange_copy(lead->layout.image, several->image, lead->exchange.outputs,
                      lead->exchange.output_count);
    lead->of.ops->send(lead->of.bus);
    for (uint32_t n = 1; n < several->count; n++) {
        struct member *m = &several->members[n];
        fsn_exchange_send(&m->exchange, several->image + m->image_base);
    }
}

/* -- opening -------------------------------------------------------------------------------- */

static void member_close(void *context) {
    struct member *m = context;
    if (m->open && m->of.ops->close != NULL) {
        m->of.ops->close(m->of.bus);
    }
    m->open = false;
    fsn_exchange_free(&m->exchange);
}

/** open() of the backend itself; afterwards everything else is known. */
static fsn_status member_open(void *context, const struct fsn_plan *plan,
                              struct fsn_bus_layout *layout, struct fsn_fault *fault) {
    struct member *m = context;
    FSN_TRY(m->of.ops->open(m->of.bus, plan, &m->layout, fault));
    m->open = true;
    *layout = m->layout;
    const fsn_status status = fsn_exchange_create(m->part, &m->layout, &m->exchange);
    if (status != FSN_OK) {
        member_close(m);
    }
    return status;
}

static fsn_status open_one(struct fsn_several *several, struct member *m, struct fsn_fault *fault) {
    static const struct fsn_bus_ops further = {.name = "several",
                                               .open = member_open,
                                               .receive = further_receive,
                                               .send = further_send,
                                               .close = member_close};
    if (m != several->members) {
        return fsn_core_create(m->part, &further, m, &m->core, fault);
    }
    struct fsn_bus_layout layout;
    FSN_TRY(member_open(m, m->part, &layout, fault));
    if (layout.image_bytes > 0) {
        memset(layout.image, 0, layout.image_bytes);
    }
    return FSN_OK;
}

/** Errors of a bus are reported with its name, and with the numbers of the whole plan. */
static fsn_status refuse(const struct member *m, fsn_status status, struct fsn_fault *fault) {
    if (fault == NULL) {
        return status;
    }
    char detail[FSN_DETAIL_BYTES];
    if (fault->section == FSN_SEC_SUBDEVICE && fault->copy_index != FSN_FAULT_NO_RECORD) {
        fault->copy_index += m->info.first_subdevice;
    } else if (fault->section == FSN_SEC_SM && fault->copy_index != FSN_FAULT_NO_RECORD) {
        fault->copy_index += m->first_sm;
    } else {
        fault->copy_index = FSN_FAULT_NO_RECORD;
    }
    snprintf(detail, sizeof detail, "bus %.40s%s%.110s", m->info.name,
             fault->detail[0] != 0 ? ": " : "", fault->detail);
    memcpy(fault->detail, detail, sizeof detail);
    return status;
}

/** The images, one after another. */
static fsn_status join_layouts(struct fsn_several *several, struct fsn_bus_layout *layout) {
    uint32_t bytes = 0;
    uint32_t datagrams = 0;
    for (uint32_t n = 0; n < several->count; n++) {
        struct member *m = &several->members[n];
        m->image_base = bytes;
        m->datagram_base = datagrams;
        if (m->layout.image_bytes > UINT32_MAX / 8 - bytes) {
            return FSN_E_BUS_IMAGE; /* GCOVR_EXCL_LINE: half a gigabyte */
        }
        bytes += m->layout.image_bytes;
        datagrams += m->layout.datagram_count;
    }
    if (!FSN_NEW_PREFAULTED(several->image, bytes) ||
        !FSN_NEW(several->sm_base, fsn_plan_sm_count(several->plan)) ||
        !FSN_NEW(several->datagram_begin, datagrams)) {
        return FSN_E_NOMEM;
    }
    for (uint32_t n = 0; n < several->count; n++) {
        const struct member *m = &several->members[n];
        for (uint32_t sm = 0; sm < fsn_plan_sm_count(m->part); sm++) {
            const uint32_t base = m->layout.sm_base[sm];
            several->sm_base[m->first_sm + sm] = base == FSN_NONE ? base : m->image_base + base;
        }
        for (uint32_t d = 0; d < m->layout.datagram_count; d++) {
            several->datagram_begin[m->datagram_base + d] =
                m->image_base + m->layout.datagram_begin[d];
        }
    }
    *layout = (struct fsn_bus_layout){.image = several->image,
                                      .image_bytes = bytes,
                                      .sm_base = several->sm_base,
                                      .datagram_begin = several->datagram_begin,
                                      .datagram_count = datagrams,
                                      .dc_base_ns = several->members[0].layout.dc_base_ns};
    return FSN_OK;
}

static void several_close(void *context) {
    struct fsn_several *several = context;
    for (uint32_t n = several->count; n-- > 0;) {
        struct member *m = &several->members[n];
        if (n == 0) {
            member_close(m);
        }
        fsn_core_free(m->core);
        m->core = NULL;
    }
    free(several->image);
    free(several->sm_base);
    free(several->datagram_begin);
    several->image = NULL;
    several->sm_base = NULL;
    several->datagram_begin = NULL;
}

static fsn_status start_threads(struct fsn_several *several, struct fsn_fault *fault) {
    for (uint32_t n = 1; n < several->count && several->threads; n++) {
        struct member *m = &several->members[n];
        several->thread.cycle_ns = m->info.cycle_ns;
        const fsn_status status = fsn_core_start(m->core, &several->thread, fault);
        if (status != FSN_OK) {
            return refuse(m, status, fault);
        }
    }
    return FSN_OK;
}

static fsn_status several_open(void *context, const struct fsn_plan *plan,
                               struct fsn_bus_layout *layout, struct fsn_fault *fault) {
    struct fsn_several *several = context;
    if (plan != several->plan) {
        return FSN_E_ARG;
    }
    fsn_status status = FSN_OK;
    for (uint32_t n = 0; n < several->count && status == FSN_OK; n++) {
        struct member *m = &several->members[n];
        m->elapsed_ns = m->info.cycle_ns - several->members[0].info.cycle_ns;
        status = open_one(several, m, fault);
        if (status != FSN_OK) {
            refuse(m, status, fault);
        }
    }
    if (status == FSN_OK) {
        status = join_layouts(several, layout);
        fsn_refuse_all(fault, status, NULL);
    }
    if (status == FSN_OK) {
        status = start_threads(several, fault);
    }
    if (status != FSN_OK) {
        several_close(several);
    }
    return status;
}

/* -- next to the cycle ------------------------------------------------------------------------ */

static bool several_poll(void *context, uint8_t al_state, uint64_t now_ns) {
    struct fsn_several *several = context;
    bool all = true;
    for (uint32_t n = 0; n < several->count; n++) {
        const struct fsn_several_member *of = &several->members[n].of;
        all = of->ops->poll(of->bus, al_state, now_ns) && all;
    }
    return all;
}

/** Those without a reference, otherwise those that are apart, otherwise the first in use. */
static bool several_clocks(void *context, struct fsn_bus_clocks *clocks) {
    const struct fsn_several *several = context;
    bool found = false;
    for (uint32_t n = 0; n < several->count; n++) {
        const struct fsn_several_member *of = &several->members[n].of;
        struct fsn_bus_clocks own;
        if (of->ops->clocks(of->bus, &own) &&
            (!found || (own.state >= FSN_CLOCKS_APART && own.state > clocks->state))) {
            *clocks = own;
            found = true;
        }
    }
    return found;
}

static struct member *member_of(struct fsn_several *several, uint32_t subdevice) {
    return &several->members[fsn_plan_bus_of(several->plan, subdevice)];
}

static fsn_status several_state(void *context, uint32_t subdevice, struct fsn_bus_subdevice *seen) {
    const struct member *m = member_of(context, subdevice);
    return m->of.ops->state(m->of.bus, subdevice - m->info.first_subdevice, seen);
}

static uint32_t several_count(void *context) {
    const struct fsn_several *several = context;
    uint32_t count = 0;
    for (uint32_t n = 0; n < several->count; n++) {
        const struct fsn_several_member *of = &several->members[n].of;
        count += of->ops->acyclic->count(of->bus);
    }
    return count;
}

static uint32_t several_place(void *context, uint32_t subdevice) {
    struct fsn_several *several = context;
    const struct member *m = member_of(several, subdevice);
    const uint32_t place =
        m->of.ops->acyclic->place(m->of.bus, subdevice - m->info.first_subdevice);
    uint32_t before = 0;
    for (const struct member *other = several->members; other < m; other++) {
        before += other->of.ops->acyclic->count(other->of.bus);
    }
    return place == FSN_NONE ? place : before + place;
}

/** The bus with a position, counted across all of them; and the position on it. */
static struct member *at_place(struct fsn_several *several, uint32_t *position) {
    struct member *m = several->members;
    for (; m + 1 < several->members + several->count; m++) {
        const uint32_t count = m->of.ops->acyclic->count(m->of.bus);
        if (*position < count) {
            break;
        }
        *position -= count;
    }
    return m;
}

static fsn_status several_member(void *context, uint32_t position, struct fsn_bus_member *member) {
    const struct member *m = at_place(context, &position);
    const fsn_status status = m->of.ops->acyclic->member(m->of.bus, position, member);
    if (member->subdevice != FSN_NONE) {
        member->subdevice += m->info.first_subdevice;
    }
    return status;
}

/** Upload or download at a position, on the bus that has it. */
static fsn_status transfer(struct fsn_several *several, struct fsn_transfer *transfer,
                           bool writes) {
    const uint32_t position = transfer->position;
    const struct member *m = at_place(several, &transfer->position);
    const struct fsn_bus_acyclic *acyclic = m->of.ops->acyclic;
    const fsn_status status =
        writes ? acyclic->download(m->of.bus, transfer) : acyclic->upload(m->of.bus, transfer);
    transfer->position = position;
    return status;
}

static fsn_status several_upload(void *context, struct fsn_transfer *of) {
    return transfer(context, of, false);
}

static fsn_status several_download(void *context, struct fsn_transfer *of) {
    return transfer(context, of, true);
}

static fsn_status several_sii_read(void *context, uint32_t position, uint32_t offset, uint8_t *data,
                                   uint32_t size_bytes) {
    const struct member *m = at_place(context, &position);
    return m->of.ops->acyclic->sii_read(m->of.bus, position, offset, data, size_bytes);
}

static fsn_status several_sii_write(void *context, uint32_t position, uint32_t offset,
                                    uint16_t word) {
    const struct member *m = at_place(context, &position);
    return m->of.ops->acyclic->sii_write(m->of.bus, position, offset, word);
}

static fsn_status several_pdo(void *context, uint32_t position, uint8_t sm, uint32_t pdo,
                              uint16_t *index, bool *output, uint32_t *entries, uint32_t room,
                              uint32_t *count) {
    const struct member *m = at_place(context, &position);
    return m->of.ops->acyclic->pdo(m->of.bus, position, sm, pdo, index, output, entries, room,
                                   count);
}

static fsn_status several_statistics(void *context, uint32_t number,
                                     struct fsn_statistics *statistics) {
    struct fsn_several *several = context;
    if (number != 0) {
        return fsn_core_snapshot(several->members[number].core, statistics, NULL, NULL);
    }
    statistics->counts.lost_frames =
        atomic_load_explicit(&several->lost_frames, memory_order_relaxed);
    statistics->wkc_errors = atomic_load_explicit(&several->wkc_errors, memory_order_relaxed);
    statistics->expected_wkc = atomic_load_explicit(&several->expected_wkc, memory_order_relaxed);
    statistics->actual_wkc = atomic_load_explicit(&several->actual_wkc, memory_order_relaxed);
    return FSN_OK;
}

/* -- life ----------------------------------------------------------------------------------- */

/** Selects the operations for the data of its members. */
static void choose_ops(struct fsn_several *several, const struct fsn_bus_ops *of) {
    several->ops = (struct fsn_bus_ops){.name = of->name,
                                        .open = several_open,
                                        .receive = several_receive,
                                        .send = several_send,
                                        .close = several_close,
                                        .statistics = several_statistics};
    if (of->poll != NULL) {
        several->ops.poll = several_poll;
        several->ops.state = several_state;
    }
    several->ops.clocks = of->clocks != NULL ? several_clocks : NULL;
    if (of->acyclic != NULL) {
        const struct fsn_bus_acyclic *theirs = of->acyclic;
        several->acyclic = (struct fsn_bus_acyclic){
            .count = several_count,
            .place = several_place,
            .member = theirs->member != NULL ? several_member : NULL,
            .upload = theirs->upload != NULL ? several_upload : NULL,
            .download = theirs->download != NULL ? several_download : NULL,
            .sii_read = theirs->sii_read != NULL ? several_sii_read : NULL,
            .sii_write = theirs->sii_write != NULL ? several_sii_write : NULL,
            .pdo = theirs->pdo != NULL ? several_pdo : NULL};
        several->ops.acyclic = &several->acyclic;
    }
}

static fsn_status make_member(struct fsn_several *several, uint32_t number,
                              const struct fsn_several_member *of) {
    struct member *m = &several->members[number];
    m->of = *of;
    FSN_TRY(fsn_plan_bus(several->plan, number, &m->info));
    if (of->part != NULL) {
        fsn_plan_hold(of->part);
        m->part = (struct fsn_plan *)of->part;
    } else {
        FSN_TRY(fsn_plan_part(several->plan, number, &m->part));
    }
    struct fsn_subdevice_info first;
    FSN_TRY(fsn_plan_subdevice(several->plan, m->info.first_subdevice, &first));
    m->first_sm = first.first_sm;
    return FSN_OK;
}

fsn_status fsn_several_create(const struct fsn_plan *plan, const struct fsn_several_member *members,
                              const struct fsn_thread_options *thread, struct fsn_several **out) {
    if (plan == NULL || members == NULL || out == NULL) {
        return FSN_E_ARG;
    }
    *out = NULL;
    struct fsn_several *several = calloc(1, sizeof *several);
    if (several == NULL) {
        return FSN_E_NOMEM;
    }
    fsn_plan_hold(plan);
    several->plan = plan;
    several->count = fsn_plan_bus_count(plan);
    several->threads = thread != NULL;
    several->thread = thread != NULL ? *thread : (struct fsn_thread_options){0};
    fsn_status status = FSN_NEW_PREFAULTED(several->members, several->count) ? FSN_OK : FSN_E_NOMEM;
    for (uint32_t n = 0; n < several->count && status == FSN_OK; n++) {
        status = make_member(several, n, &members[n]);
    }
    if (status != FSN_OK) {
        fsn_several_free(several);
        return status;
    }
    choose_ops(several, members[0].ops);
    *out = several;
    return FSN_OK;
}

void fsn_several_free(struct fsn_several *several) {
    if (several == NULL) {
        return;
    }
    for (uint32_t n = 0; n < several->count && several->members != NULL; n++) {
        fsn_plan_free(several->members[n].part);
    }
    free(several->members);
    fsn_plan_free((struct fsn_plan *)several->plan);
    free(several);
}

const struct fsn_bus_ops *fsn_several_ops(struct fsn_several *several) {
    return &several->ops;
}
