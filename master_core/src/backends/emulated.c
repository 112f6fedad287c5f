#include "fsn/emulated.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "live/image.h"
#include "rt/prefault.h"

/** Three buffers of one sync manager: one with the writer, one with the reader, one in between.
 *  `middle` holds the number of the buffer in between, and FRESH while nobody has read it. */
struct mailbox {
    uint8_t *buffer[3];
    uint32_t size_bytes, subdevice;
    uint8_t direction;
    uint8_t writer, reader; /**< each touched by its own side only */
    _Atomic uint8_t middle;
};

enum { FRESH = 4, NUMBER = 3 }; /* mutants: only two threads at once see two buffers in one */

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
    struct fsn_image layout;
    uint8_t *wkc; /**< per sync manager: what it adds to the working counter of its datagram */
};

static void publish(struct mailbox *box, const uint8_t *bytes) {
    memcpy(box->buffer[box->writer], bytes, box->size_bytes);
    const uint8_t old = atomic_exchange_explicit(&box->middle, (uint8_t)(box->writer | FRESH),
                                                 memory_order_acq_rel);
    box->writer = old & NUMBER;
}

/** Newest whole buffer; `fresh`: whether it was published since the last call. */
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

/** Reads the sync managers that get a place, and how many bytes their buffers need. */
static size_t read_plan(struct fsn_emulated *bus) {
    size_t total = 0;
    for (uint32_t sm = 0; sm < bus->box_count; sm++) {
        const struct fsn_sm_info info = fsn_known_sm(bus->plan, sm);
        if (info.registered) {
            bus->boxes[sm].size_bytes = info.size_bytes;
            bus->boxes[sm].subdevice = info.subdevice;
            bus->boxes[sm].direction = info.direction;
            total += info.size_bytes;
        }
    }
    return total;
}

static bool allocate(struct fsn_emulated *bus) {
    /* mutants: one more, so that nothing is not a request for 0 bytes */
    const size_t sms = (size_t)bus->box_count + 1;
    const size_t subs = (size_t)bus->subdevice_count + 1;
    bus->boxes = calloc(sms, sizeof *bus->boxes);
    bus->wkc = calloc(sms, sizeof *bus->wkc);
    bus->present = calloc(subs, sizeof *bus->present);
    if (bus->boxes == NULL || bus->wkc == NULL || bus->present == NULL ||
        fsn_image_create(bus->plan, FSN_MAX_DATAGRAM_BYTES, &bus->layout) != FSN_OK) {
        return false;
    }
    const size_t total = read_plan(bus);
    bus->storage = fsn_calloc_prefaulted(3 * total + 1, 1); /* mutants: as above */
    bus->image = fsn_calloc_prefaulted(total + 1, 1);
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
    for (uint32_t sm = 0; sm < bus->box_count; sm++) {
        bus->wkc[sm] = (uint8_t)fsn_image_wkc(bus->plan, &bus->layout, sm);
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
    free(bus->wkc);
    fsn_image_free(&bus->layout);
    free((void *)bus->present);
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
    *layout = fsn_image_layout(&bus->layout, bus->image);
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
    for (uint32_t d = 0; d < bus->layout.datagram_count; d++) {
        input->wkc[d].expected = bus->layout.expected[d];
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
        input->wkc[bus->layout.sm_datagram[sm]].actual += bus->wkc[sm];
        if (box->direction == FSN_INPUT) {
            bool fresh;
            memcpy(bus->image + bus->layout.sm_base[sm], newest(box, &fresh), box->size_bytes);
        }
    }
}

static void emulated_send(void *context) {
    struct fsn_emulated *bus = context;
    for (uint32_t sm = 0; sm < bus->box_count; sm++) {
        struct mailbox *box = &bus->boxes[sm];
        if (box->size_bytes > 0 && box->direction == FSN_OUTPUT && is_present(bus, box)) {
            publish(box, bus->image + bus->layout.sm_base[sm]);
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
