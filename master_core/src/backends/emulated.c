#include "fsn/emulated.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "fsn/several.h"
#include "live/image.h"
#include "rt/prefault.h"
#include "rt/triple.h"

/** Three buffers of one sync manager. */
struct mailbox {
    uint8_t *buffer[FSN_TRIPLE_SETS];
    uint32_t size_bytes, subdevice;
    uint8_t direction;
    struct fsn_triple triple;
};

/** One of several buses: each is a separate emulated bus. */
struct emulated_part {
    struct fsn_emulated *bus;
    uint32_t first_subdevice, first_sm;
};

struct fsn_emulated {
    /** References of caller and core: the last one frees it, so that they may end in any order. */
    atomic_uint holders;
    atomic_bool opened; /**< one image, so one core at a time */
    const struct fsn_plan *plan;
    struct mailbox *boxes; /**< one per sync manager; size 0 without a place */
    uint32_t box_count;
    atomic_bool *present; /**< per SubDevice */
    bool *optional;       /**< per SubDevice: it belongs to a group, and may be absent */
    uint32_t subdevice_count;
    uint8_t *storage;
    uint8_t *image;
    struct fsn_image layout;
    uint8_t *wkc; /**< per sync manager: its share of the working counter of its datagram */
    struct emulated_part *parts;
    uint32_t part_count; /**< 0: a single bus, all of it here */
    struct fsn_several *several;
};

static void publish(struct mailbox *box, const uint8_t *bytes) {
    memcpy(box->buffer[box->triple.writer], bytes, box->size_bytes);
    fsn_triple_publish(&box->triple);
}

/** Newest complete buffer; `fresh`: whether it was published since the last call. */
static const uint8_t *newest(struct mailbox *box, bool *fresh) {
    *fresh = fsn_triple_take(&box->triple);
    return box->buffer[box->triple.reader];
}

/** Reads the sync managers that have a place, and the size of their buffers. */
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
    if (!FSN_NEW(bus->boxes, bus->box_count) || !FSN_NEW(bus->wkc, bus->box_count) ||
        !FSN_NEW(bus->present, bus->subdevice_count) ||
        !FSN_NEW(bus->optional, bus->subdevice_count) ||
        fsn_image_create(bus->plan, FSN_MAX_DATAGRAM_BYTES, &bus->layout) != FSN_OK) {
        return false;
    }
    const size_t total = read_plan(bus);
    return FSN_NEW_PREFAULTED(bus->storage, 3 * total) && FSN_NEW_PREFAULTED(bus->image, total);
}

static void fill(struct fsn_emulated *bus) {
    uint8_t *at = bus->storage;
    for (uint32_t sm = 0; sm < bus->box_count; sm++) {
        struct mailbox *box = &bus->boxes[sm];
        for (int i = 0; i < FSN_TRIPLE_SETS; i++, at += box->size_bytes) {
            box->buffer[i] = at;
        }
        fsn_triple_init(&box->triple);
    }
    for (uint32_t sub = 0; sub < bus->subdevice_count; sub++) {
        atomic_init(&bus->present[sub], fsn_plan_is_first_choice(bus->plan, sub));
        bus->optional[sub] = fsn_plan_group_of(bus->plan, sub) != FSN_NONE;
    }
    for (uint32_t sm = 0; sm < bus->box_count; sm++) {
        bus->wkc[sm] = (uint8_t)fsn_image_wkc(bus->plan, &bus->layout, sm);
    }
}

/** Creates an emulated bus for each bus of the plan, and the multi-bus backend over them. */
static fsn_status make_parts(struct fsn_emulated *bus, uint32_t count) {
    struct fsn_several_member *members;
    fsn_status status =
        FSN_NEW(members, count) && FSN_NEW(bus->parts, count) ? FSN_OK : FSN_E_NOMEM;
    for (uint32_t n = 0; n < count && status == FSN_OK; n++) {
        struct fsn_bus_info info;
        struct fsn_plan *plan;
        struct emulated_part *part = &bus->parts[n];
        status = fsn_plan_bus(bus->plan, n, &info);
        if (status == FSN_OK) {
            status = fsn_plan_part(bus->plan, n, &plan);
        }
        if (status == FSN_OK) {
            status = fsn_emulated_create(plan, &part->bus);
            fsn_plan_free(plan); /* the bus holds a reference */
            part->first_subdevice = info.first_subdevice;
            part->first_sm = fsn_known_subdevice(bus->plan, info.first_subdevice).first_sm;
            members[n] = (struct fsn_several_member){fsn_emulated_ops(), part->bus, plan};
            bus->part_count = n + 1;
        }
    }
    if (status == FSN_OK) {
        status = fsn_several_create(bus->plan, members, NULL, &bus->several);
    }
    free(members);
    return status;
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
    fsn_status status = FSN_E_NOMEM;
    if (fsn_plan_bus_count(plan) > 1) {
        status = make_parts(bus, fsn_plan_bus_count(plan));
    } else {
        bus->box_count = fsn_plan_sm_count(plan);
        bus->subdevice_count = fsn_plan_subdevice_count(plan);
        if (allocate(bus)) {
            fill(bus);
            status = FSN_OK;
        }
    }
    if (status != FSN_OK) {
        fsn_emulated_free(bus);
        return status;
    }
    *out = bus;
    return FSN_OK;
}

void fsn_emulated_free(struct fsn_emulated *bus) {
    if (bus == NULL || atomic_fetch_sub_explicit(&bus->holders, 1, memory_order_acq_rel) != 1) {
        return;
    }
    fsn_several_free(bus->several);
    for (uint32_t n = 0; n < bus->part_count; n++) {
        fsn_emulated_free(bus->parts[n].bus);
    }
    free(bus->parts);
    free(bus->boxes);
    free(bus->wkc);
    fsn_image_free(&bus->layout);
    free((void *)bus->present);
    free(bus->optional);
    free(bus->storage);
    free(bus->image);
    fsn_plan_free((struct fsn_plan *)bus->plan);
    free(bus);
}

static fsn_status emulated_open(void *context, const struct fsn_plan *plan,
                                struct fsn_bus_layout *layout, struct fsn_fault *fault) {
    struct fsn_emulated *bus = context;
    if (bus == NULL || bus->plan != plan) {
        return FSN_E_ARG;
    }
    if (atomic_exchange(&bus->opened, true)) {
        return FSN_E_STATE;
    }
    if (bus->several != NULL) {
        const fsn_status status =
            fsn_several_ops(bus->several)->open(bus->several, plan, layout, fault);
        if (status != FSN_OK) {
            atomic_store(&bus->opened, false);
            return status;
        }
    } else {
        *layout = fsn_image_layout(&bus->layout, bus->image);
    }
    atomic_fetch_add_explicit(&bus->holders, 1, memory_order_relaxed);
    return FSN_OK;
}

static void emulated_close(void *context) {
    struct fsn_emulated *bus = context;
    if (bus->several != NULL) {
        fsn_several_ops(bus->several)->close(bus->several);
    }
    atomic_store(&bus->opened, false);
    fsn_emulated_free(bus);
}

static bool is_present(struct fsn_emulated *bus, const struct mailbox *box) {
    return atomic_load_explicit(&bus->present[box->subdevice], memory_order_acquire);
}

static void emulated_receive(void *context, struct fsn_bus_input *input) {
    struct fsn_emulated *bus = context;
    if (bus->several != NULL) {
        fsn_several_ops(bus->several)->receive(bus->several, input);
    }
    for (uint32_t d = 0; d < bus->layout.datagram_count; d++) {
        input->wkc[d].expected = bus->layout.expected[d];
    }
    for (uint32_t sm = 0; sm < bus->box_count; sm++) {
        struct mailbox *box = &bus->boxes[sm];
        if (box->size_bytes == 0) {
            continue;
        }
        if (!is_present(bus, box)) {
            /* The input bytes of an absent SubDevice stay unchanged. */
            const bool optional = bus->optional[box->subdevice];
            input->sm_stale[sm] = box->direction == FSN_INPUT && !optional;
            if (optional) {
                input->wkc[bus->layout.sm_datagram[sm]].expected -= bus->wkc[sm];
            }
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
    if (bus->several != NULL) {
        fsn_several_ops(bus->several)->send(bus->several);
    }
    for (uint32_t sm = 0; sm < bus->box_count; sm++) {
        struct mailbox *box = &bus->boxes[sm];
        if (box->size_bytes > 0 && box->direction == FSN_OUTPUT && is_present(bus, box)) {
            publish(box, bus->image + bus->layout.sm_base[sm]);
        }
    }
}

static fsn_status emulated_statistics(void *context, uint32_t number,
                                      struct fsn_statistics *statistics) {
    const struct fsn_emulated *bus = context;
    return bus->several != NULL
               ? fsn_several_ops(bus->several)->statistics(bus->several, number, statistics)
               : FSN_OK;
}

const struct fsn_bus_ops *fsn_emulated_ops(void) {
    static const struct fsn_bus_ops ops = {
        .name = "emulated",
        .open = emulated_open,
        .receive = emulated_receive,
        .send = emulated_send,
        .close = emulated_close,
        .statistics = emulated_statistics,
    };
    return &ops;
}

static struct mailbox *find(struct fsn_emulated *bus, uint32_t sm, uint8_t direction) {
    for (uint32_t n = bus->part_count; n-- > 0;) {
        if (sm >= bus->parts[n].first_sm) {
            return find(bus->parts[n].bus, sm - bus->parts[n].first_sm, direction);
        }
    }
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
    for (uint32_t n = bus->part_count; n-- > 0;) {
        if (subdevice >= bus->parts[n].first_subdevice) {
            return fsn_emulated_set_present(bus->parts[n].bus,
                                            subdevice - bus->parts[n].first_subdevice, present);
        }
    }
    if (subdevice >= bus->subdevice_count) {
        return FSN_E_ARG;
    }
    atomic_store_explicit(&bus->present[subdevice], present, memory_order_release);
    return FSN_OK;
}
