#define _POSIX_C_SOURCE 200809L

#include "backends/igh/igh.h"
#include "rt/prefault.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_MASTERS = 32 };

/* -- helpers -------------------------------------------------------------------------------- */

fsn_status igh_refuse_call(struct fsn_fault *fault, int error, const char *rule) {
    fsn_refuse_all(fault, FSN_E_SYS, rule);
    if (fault != NULL) {
        fault->sys_errno = error < 0 ? -error : error;
    }
    return FSN_E_SYS;
}

struct fsn_objects igh_objects(struct fsn_igh *bus, const struct igh_node *node) {
    return (struct fsn_objects){.bus = bus,
                                .position = node->ring,
                                .upload = igh_acyclic.upload,
                                .download = igh_acyclic.download};
}

/* -- life ----------------------------------------------------------------------------------- */

static bool read_index(const char *text, unsigned *index) {
    char *end;
    if (text == NULL || text[0] < '0' || text[0] > '9') {
        return false;
    }
    const unsigned long value = strtoul(text, &end, 10);
    *index = (unsigned)value;
    return *end == '\0' && value < MOST_MASTERS;
}

static fsn_status igh_create(const struct fsn_live_options *options, void **out,
                             struct fsn_fault *fault) {
    unsigned index = 0;
    if (out != NULL) {
        *out = NULL;
    }
    if (options == NULL || out == NULL || !read_index(options->interface, &index)) {
        return fsn_refuse_all(fault, FSN_E_ARG,
                              "the IgH backend needs the number of the master, such as 0, in place "
                              "of an interface");
    }
    if (options->redundant != NULL) {
        return fsn_refuse_all(fault, FSN_E_ARG,
                              "IgH takes its second interface from the kernel module: leave it out "
                              "here and set the parameter backup_devices of ec_master");
    }
    if (options->dc_host) {
        return fsn_refuse_all(fault, FSN_E_ARG,
                              "with IgH the cycle follows the reference clock: --dc-clock bus");
    }
    struct fsn_igh *bus = calloc(1, sizeof *bus);
    if (bus == NULL) {
        return fsn_refuse_all(fault, FSN_E_NOMEM, NULL);
    }
    bus->index = index;
    bus->cycle_ns = options->cycle_ns;
    bus->wait_ns = options->receive_wait_ns;
    bus->dc_every = options->dc_every;
    fsn_nodes_init(&bus->all);
    *out = bus;
    return FSN_OK;
}

/** Deactivation before release: it ends the exchange and has IgH bring all SubDevices to PREOP. */
void igh_release(void *context) {
    struct fsn_igh *bus = context;
    if (bus->master != NULL) {
        if (bus->active) {
            (void)ecrt_master_deactivate(bus->master);
        }
        ecrt_release_master(bus->master);
    }
    bus->master = NULL;
    bus->active = false;
    bus->sent = false;
    free(bus->areas);
    bus->areas = NULL;
    bus->area_count = 0;
    free(bus->bytes);
    bus->bytes = NULL;
    fsn_image_free(&bus->image);
}

static void igh_free(void *context) {
    struct fsn_igh *bus = context;
    if (bus == NULL) {
        return;
    }
    igh_release(bus);
    fsn_nodes_free(&bus->all);
    free(bus);
}

static int by_place(const void *a, const void *b) {
    const struct igh_area *x = a;
    const struct igh_area *y = b;
    return (x->image_byte > y->image_byte) - (x->image_byte < y->image_byte);
}

/** One area, hence one datagram, for each sync manager with a place. */
static fsn_status make_areas(struct fsn_igh *bus) {
    FSN_TRY(fsn_image_create(bus->all.plan, FSN_MAX_DATAGRAM_BYTES, &bus->image));
    const uint32_t sms = fsn_plan_sm_count(bus->all.plan);
    if (!FSN_NEW_PREFAULTED(bus->bytes, bus->image.bytes) || !FSN_NEW_PREFAULTED(bus->areas, sms)) {
        return FSN_E_NOMEM;
    }
    for (uint32_t sm = 0; sm < sms; sm++) {
        const struct fsn_sm_info info = fsn_known_sm(bus->all.plan, sm);
        if (bus->image.sm_base[sm] != FSN_NONE) {
            bus->areas[bus->area_count++] = (struct igh_area){
                .sm = sm,
                .node = info.subdevice,
                .image_byte = bus->image.sm_base[sm],
                .size_bytes = info.size_bytes,
                .output = info.direction == FSN_OUTPUT,
            };
        }
    }
    qsort(bus->areas, bus->area_count, sizeof *bus->areas, by_place);
    for (uint32_t a = 0; a < bus->area_count; a++) {
        bus->image.datagram_begin[a] = bus->areas[a].image_byte;
    }
    bus->image.datagram_count = bus->area_count > 0 ? bus->area_count : 1;
    return FSN_OK;
}

static fsn_status check(void *bus, struct fsn_node *node) {
    return igh_check(bus, (struct igh_node *)node);
}

static fsn_status configure_all(struct fsn_igh *bus, struct fsn_fault *fault) {
    for (uint32_t n = 0; n < bus->all.count; n++) {
        struct igh_node *node = &bus->nodes[n];
        if (igh_configure(bus, node) != FSN_OK) {
            igh_note(bus, node, FSN_FOUND_MAPPING,
                     "IgH does not take its configuration; see the kernel log");
            return fsn_node_refuse(fault, FSN_E_BUS_MAPPING, &node->known);
        }
        bus->uses_time = bus->uses_time || node->known.info.assign_activate != 0;
    }
    if (bus->uses_time && bus->dc_every == 0) {
        bus->dc_every = 1; /* without a common time, SYNC0 would be anywhere in the cycle */
    }
    bus->uses_time = bus->dc_every > 0;
    return FSN_OK;
}

static fsn_status activate(struct fsn_igh *bus, struct fsn_fault *fault) {
    (void)ecrt_master_set_send_interval(bus->master, (size_t)(bus->cycle_ns / 1000));
    const int result = ecrt_master_activate(bus->master);
    if (result != 0) {
        return igh_refuse_call(fault, result, "IgH does not start; see the kernel log");
    }
    bus->active = true;
    for (uint32_t a = 0; a < bus->area_count; a++) {
        struct igh_area *area = &bus->areas[a];
        area->data = ecrt_domain_data(area->domain);
        if (area->data == NULL || ecrt_domain_size(area->domain) != area->size_bytes) {
            struct igh_node *node = &bus->nodes[area->node];
            igh_note(bus, node, FSN_FOUND_MAPPING, "IgH gives it %zu bytes, the plan has %u",
                     ecrt_domain_size(area->domain), area->size_bytes);
            return fsn_node_refuse(fault, FSN_E_BUS_IMAGE, &node->known);
        }
    }
    return FSN_OK;
}

static fsn_status open_steps(struct fsn_igh *bus, const struct fsn_plan *plan,
                             struct fsn_fault *fault) {
    bus->nodes = fsn_nodes_create(&bus->all, plan, sizeof *bus->nodes);
    const fsn_status status = bus->nodes != NULL ? make_areas(bus) : FSN_E_NOMEM;
    if (status != FSN_OK) {
        return fsn_refuse_all(fault, status, NULL);
    }
    bus->master = ecrt_open_master(bus->index);
    if (bus->master == NULL) {
        return igh_refuse_call(fault, errno,
                               "no master of that number: is the module ec_master loaded, and may "
                               "this user open its device, /dev/EtherCAT0 and so on?");
    }
    FSN_TRY(igh_find(bus, fault));
    FSN_TRY(fsn_nodes_check(&bus->all, bus, check, fault));
    FSN_TRY(configure_all(bus, fault));
    return activate(bus, fault);
}

static fsn_status igh_open(void *context, const struct fsn_plan *plan,
                           struct fsn_bus_layout *layout, struct fsn_fault *fault) {
    struct fsn_igh *bus = context;
    if (fsn_plan_group_count(plan) > 0) {
        return fsn_refuse_all(fault, FSN_E_ARG,
                              "groups of SubDevices that may be absent need --bus soem");
    }
    bus->cycle_ns = fsn_live_cycle_ns(bus->cycle_ns, plan);
    const fsn_status status = open_steps(bus, plan, fault);
    if (status != FSN_OK) {
        igh_release(bus);
        return status;
    }
    for (uint32_t n = 0; n < bus->all.count; n++) {
        bus->nodes[n].checked = true;
        atomic_store(&bus->nodes[n].admitted, 1);
        igh_note(bus, &bus->nodes[n], FSN_FOUND_RIGHT, "%s", "");
    }
    *layout = fsn_image_layout(&bus->image, bus->bytes);
    return FSN_OK;
}

const struct fsn_backend *fsn_backend_igh(void) {
    static const struct fsn_bus_ops ops = {
        .name = "igh",
        .open = igh_open,
        .receive = igh_receive,
        .send = igh_send,
        .close = igh_release,
        .poll = igh_poll,
        .state = fsn_nodes_state,
        .acyclic = &igh_acyclic,
    };
    static const struct fsn_backend backend = {
        .name = "igh",
        .about =
            "IgH EtherCAT Master 1.6, the EtherLab MainDevice, Copyright (C) Ingenieurgemeinschaft "
            "IgH: its kernel modules under the GNU General Public License version 2, its "
            "library libethercat under the GNU Lesser General Public License version 2.1.\n"
            "EtherCAT is a registered trademark and patented technology, licensed by Beckhoff "
            "Automation GmbH, Germany; to use a MainDevice you need the free licence of the "
            "EtherCAT Technology Group.",
        .ops = &ops,
        .needs_interface = true,
        .create = igh_create,
        .free = igh_free,
    };
    return &backend;
}
