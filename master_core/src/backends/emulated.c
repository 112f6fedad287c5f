#include "fsn/emulated.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "plan_internal.h"

/** Three buffers of one sync manager: one with the writer, one with the reader, one in between.
 *  `middle` holds the number of the buffer in between, and FRESH while nobody has read it. */
struct mailbox {
    uint8_t *buffer[3];
    uint32_t size_bytes, subdevice, base;
    uint8_t direction;
    uint8_t writer, reader; /**< each touched by its own side only */
    _Atomic uint8_t middle;
};

enum { FRESH = 4, NUMBER = 3 };

struct fsn_emulated {
    /** Caller and core: the last one to let go frees it, so that they may go in any order. */
    atomic_uint holders;
    atomic_bool opened; /**< one image, so one core at a time */
    const struct fsn_plan *plan;
    struct mailbox *boxes; /**< one per sync manager; size 0 without a place */
    uint32_t box_count;
    atomic_bool *present; /**< per SubDevice */
    uint32_t subdevice_count;
    uint8_t *storage;
    uint8_t *image;
    uint32_t image_bytes;
    uint32_t *sm_base, *sm_datagram;
    uint32_t *datagram_begin;
    uint32_t datagram_count;
    uint32_t *expected;   /**< working counter per datagram when all are present */
    uint32_t *outputs_in; /**< last datagram that counted this SubDevice's outputs, plus one */
    uint32_t *inputs_in;
};

static void publish(struct mailbox *box, const uint8_t *bytes) {
    memcpy(box->buffer[box->writer], bytes, box->size_bytes);
    const uint8_t old = atomic_exchange_explicit(&box->middle, (uint8_t)(box->writer | FRESH),
                                                 memory_order_acq_rel);
    box->writer = old & NUMBER;
}

/** Newest whole buffer; `fresh` tells whether it was published since the last call. */
static const uint8_t *newest(struct mailbox *box, bool *fresh) {
    *fresh = false;
    if ((atomic_load_explicit(&box->middle, memory_order_relaxed) & FRESH) != 0) {
        const uint8_t old =
            atomic_exchange_explicit(&box->middle, box->reader, memory_order_acq_rel);
        box->reader = old & NUMBER;
        *fresh = true;
    }
    return box->buffer[box->reader];
}

/** IgH's order: SubDevices as added, per SubDevice first outputs, then inputs; a datagram ends
 *  where the next sync manager would not fit. */
static void lay_out(struct fsn_emulated *bus) {
    uint32_t end = 0;
    uint32_t datagram_start = 0;
    uint32_t datagram = 0;
    for (uint32_t sub = 0; sub < bus->subdevice_count; sub++) {
        struct fsn_subdevice_info info;
        if (fsn_plan_subdevice(bus->plan, sub, &info) != FSN_OK) {
            continue;
        }
        for (uint8_t direction = FSN_OUTPUT; direction <= FSN_INPUT; direction++) {
            for (uint32_t sm = info.first_sm; sm < info.first_sm + info.sm_count; sm++) {
                struct mailbox *box = &bus->boxes[sm];
                if (box->size_bytes == 0 || box->direction != direction) {
                    continue;
                }
                if (end > datagram_start &&
                    end - datagram_start + box->size_bytes > FSN_MAX_DATAGRAM_BYTES) {
                    datagram++;
                    datagram_start = bus->datagram_begin[datagram] = end;
                }
                box->base = bus->sm_base[sm] = end;
                bus->sm_datagram[sm] = datagram;
                end += box->size_bytes;
            }
        }
    }
    bus->image_bytes = end;
    bus->datagram_count = datagram + 1;
}

/** What one sync manager adds to the working counter of its datagram: each SubDevice counts once
 * per direction and datagram, 2 for outputs and 1 for inputs, as LRW does. */
static uint32_t wkc_of(struct fsn_emulated *bus, uint32_t sm) {
    const struct mailbox *box = &bus->boxes[sm];
    const uint32_t datagram = bus->sm_datagram[sm];
    uint32_t *seen = box->direction == FSN_OUTPUT ? bus->outputs_in : bus->inputs_in;
    if (seen[box->subdevice] == datagram + 1) {
        return 0;
    }
    seen[box->subdevice] = datagram + 1;
    return box->direction == FSN_OUTPUT ? 2 : 1;
}

static void clear_seen(struct fsn_emulated *bus) {
    memset(bus->outputs_in, 0, bus->subdevice_count * sizeof *bus->outputs_in);
    memset(bus->inputs_in, 0, bus->subdevice_count * sizeof *bus->inputs_in);
}

/** Reads the sync managers that get a place, and how many bytes their buffers need. */
static size_t read_plan(struct fsn_emulated *bus) {
    size_t total = 0;
    for (uint32_t sm = 0; sm < bus->box_count; sm++) {
        struct fsn_sm_info info;
        bus->sm_base[sm] = FSN_NONE;
        if (fsn_plan_sm(bus->plan, sm, &info) == FSN_OK && info.registered) {
            bus->boxes[sm].size_bytes = info.size_bytes;
            bus->boxes[sm].subdevice = info.subdevice;
            bus->boxes[sm].direction = info.direction;
            total += info.size_bytes;
        }
    }
    return total;
}

static bool allocate(struct fsn_emulated *bus) {
    const size_t sms = (size_t)bus->box_count + 1;
    const size_t subs = (size_t)bus->subdevice_count + 1;
    bus->boxes = calloc(sms, sizeof *bus->boxes);
    bus->sm_base = calloc(sms, sizeof *bus->sm_base);
    bus->sm_datagram = calloc(sms, sizeof *bus->sm_datagram);
    bus->expected = calloc(sms, sizeof *bus->expected);
    bus->datagram_begin = calloc(sms, sizeof *bus->datagram_begin);
    bus->present = calloc(subs, sizeof *bus->present);
    bus->outputs_in = calloc(subs, sizeof *bus->outputs_in);
    bus->inputs_in = calloc(subs, sizeof *bus->inputs_in);
    if (bus->boxes == NULL || bus->sm_base == NULL || bus->sm_datagram == NULL ||
        bus->expected == NULL || bus->datagram_begin == NULL || bus->present == NULL ||
        bus->outputs_in == NULL || bus->inputs_in == NULL) {
        return false;
    }
    const size_t total = read_plan(bus);
    bus->storage = calloc(3 * total + 1, 1);
    bus->image = calloc(total + 1, 1);
    return bus->storage != NULL && bus->image != NULL;
}

static void fill(struct fsn_emulated *bus) {
    uint8_t *at = bus->storage;
    for (uint32_t sm = 0; sm < bus->box_count; sm++) {
        struct mailbox *box = &bus->boxes[sm];
        for (int i = 0; i < 3; i++, at += box->size_bytes) {
            box->buffer[i] = at;
        }
        box->writer = 0;
        box->reader = 2;
        atomic_init(&box->middle, 1);
    }
    for (uint32_t sub = 0; sub < bus->subdevice_count; sub++) {
        atomic_init(&bus->present[sub], true);
    }
    lay_out(bus);
    for (uint32_t sm = 0; sm < bus->box_count; sm++) {
        if (bus->boxes[sm].size_bytes > 0) {
            bus->expected[bus->sm_datagram[sm]] += wkc_of(bus, sm);
        }
    }
}

fsn_status fsn_emulated_create(const struct fsn_plan *plan, struct fsn_emulated **out) {
    if (plan == NULL || out == NULL) {
        return FSN_E_ARG;
    }
    *out = NULL;
    struct fsn_emulated *bus = calloc(1, sizeof *bus);
    if (bus == NULL) {
        return FSN_E_NOMEM;
    }
    atomic_init(&bus->holders, 1);
    fsn_plan_hold(plan);
    bus->plan = plan;
    bus->box_count = fsn_plan_sm_count(plan);
    bus->subdevice_count = fsn_plan_subdevice_count(plan);
    if (!allocate(bus)) {
        fsn_emulated_free(bus);
        return FSN_E_NOMEM;
    }
    fill(bus);
    *out = bus;
    return FSN_OK;
}

void fsn_emulated_free(struct fsn_emulated *bus) {
    if (bus == NULL || atomic_fetch_sub_explicit(&bus->holders, 1, memory_order_acq_rel) != 1) {
        return;
    }
    free(bus->boxes);
    free(bus->sm_base);
    free(bus->sm_datagram);
    free(bus->expected);
    free(bus->datagram_begin);
    free((void *)bus->present);
    free(bus->outputs_in);
    free(bus->inputs_in);
    free(bus->storage);
    free(bus->image);
    fsn_plan_free((struct fsn_plan *)bus->plan);
    free(bus);
}

static fsn_status emulated_open(void *context, const struct fsn_plan *plan,
                                struct fsn_bus_layout *layout, struct fsn_fault *fault) {
    struct fsn_emulated *bus = context;
    (void)fault;
    if (bus == NULL || bus->plan != plan) {
        return FSN_E_ARG;
    }
    if (atomic_exchange(&bus->opened, true)) {
        return FSN_E_STATE;
    }
    atomic_fetch_add_explicit(&bus->holders, 1, memory_order_relaxed);
    *layout = (struct fsn_bus_layout){
        .image = bus->image,
        .image_bytes = bus->image_bytes,
        .sm_base = bus->sm_base,
        .datagram_begin = bus->datagram_begin,
        .datagram_count = bus->datagram_count,
    };
    return FSN_OK;
}

static void emulated_close(void *context) {
    struct fsn_emulated *bus = context;
    atomic_store(&bus->opened, false);
    fsn_emulated_free(bus);
}

static bool is_present(struct fsn_emulated *bus, const struct mailbox *box) {
    return atomic_load_explicit(&bus->present[box->subdevice], memory_order_acquire);
}

static void emulated_receive(void *context, struct fsn_bus_input *input) {
    struct fsn_emulated *bus = context;
    clear_seen(bus);
    for (uint32_t d = 0; d < bus->datagram_count; d++) {
        input->wkc[d].expected = bus->expected[d];
    }
    for (uint32_t sm = 0; sm < bus->box_count; sm++) {
        struct mailbox *box = &bus->boxes[sm];
        if (box->size_bytes == 0) {
            continue;
        }
        if (!is_present(bus, box)) {
            /* The input bytes of an absent SubDevice stay as they are, whole. */
            input->sm_stale[sm] = box->direction == FSN_INPUT;
            continue;
        }
        input->wkc[bus->sm_datagram[sm]].actual += wkc_of(bus, sm);
        if (box->direction == FSN_INPUT) {
            bool fresh;
            memcpy(bus->image + box->base, newest(box, &fresh), box->size_bytes);
        }
    }
}

static void emulated_send(void *context) {
    struct fsn_emulated *bus = context;
    for (uint32_t sm = 0; sm < bus->box_count; sm++) {
        struct mailbox *box = &bus->boxes[sm];
        if (box->size_bytes > 0 && box->direction == FSN_OUTPUT && is_present(bus, box)) {
            publish(box, bus->image + box->base);
        }
    }
}

const struct fsn_bus_ops *fsn_emulated_ops(void) {
    static const struct fsn_bus_ops ops = {
        .name = "emulated",
        .open = emulated_open,
        .receive = emulated_receive,
        .send = emulated_send,
        .close = emulated_close,
    };
    return &ops;
}

static struct mailbox *find(struct fsn_emulated *bus, uint32_t sm, uint8_t direction) {
    if (sm >= bus->box_count || bus->boxes[sm].size_bytes == 0 ||
        bus->boxes[sm].direction != direction) {
        return NULL;
    }
    return &bus->boxes[sm];
}

fsn_status fsn_emulated_read_outputs(struct fsn_emulated *bus, uint32_t sm, uint8_t *buffer,
                                     size_t len_bytes, bool *fresh) {
    struct mailbox *box = find(bus, sm, FSN_OUTPUT);
    if (box == NULL || len_bytes < box->size_bytes) {
        return FSN_E_ARG;
    }
    bool is_new;
    memcpy(buffer, newest(box, &is_new), box->size_bytes);
    if (fresh != NULL) {
        *fresh = is_new;
    }
    return FSN_OK;
}

fsn_status fsn_emulated_write_inputs(struct fsn_emulated *bus, uint32_t sm, const uint8_t *buffer,
                                     size_t len_bytes) {
    struct mailbox *box = find(bus, sm, FSN_INPUT);
    if (box == NULL || len_bytes != box->size_bytes) {
        return FSN_E_ARG;
    }
    publish(box, buffer);
    return FSN_OK;
}

fsn_status fsn_emulated_set_present(struct fsn_emulated *bus, uint32_t subdevice, bool present) {
    if (subdevice >= bus->subdevice_count) {
        return FSN_E_ARG;
    }
    atomic_store_explicit(&bus->present[subdevice], present, memory_order_release);
    return FSN_OK;
}
