#include "live/node.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "live/pdo.h"

void fsn_nodes_init(struct fsn_nodes *nodes) {
    pthread_mutex_init(&nodes->lock, NULL);
}

void fsn_nodes_free(struct fsn_nodes *nodes) {
    free(nodes->first);
    pthread_mutex_destroy(&nodes->lock);
}

struct fsn_node *fsn_nodes_at(const struct fsn_nodes *nodes, uint32_t number) {
    return (struct fsn_node *)((char *)nodes->first + number * nodes->node_bytes);
}

void *fsn_nodes_create(struct fsn_nodes *nodes, const struct fsn_plan *plan, size_t node_bytes) {
    free(nodes->first);
    nodes->plan = plan;
    nodes->count = fsn_plan_subdevice_count(plan);
    nodes->node_bytes = node_bytes;
    nodes->first = calloc((size_t)nodes->count + 1, node_bytes);
    for (uint32_t n = 0; nodes->first != NULL && n < nodes->count; n++) {
        fsn_nodes_at(nodes, n)->number = n;
        fsn_nodes_at(nodes, n)->info = fsn_known_subdevice(plan, n);
    }
    return nodes->first;
}

fsn_status fsn_nodes_state(void *bus, uint32_t subdevice, struct fsn_bus_subdevice *seen) {
    struct fsn_nodes *nodes = bus;
    if (subdevice >= nodes->count) {
        return FSN_E_ARG;
    }
    pthread_mutex_lock(&nodes->lock);
    *seen = fsn_nodes_at(nodes, subdevice)->seen;
    pthread_mutex_unlock(&nodes->lock);
    return FSN_OK;
}

void fsn_node_note(struct fsn_nodes *nodes, struct fsn_node *node, uint8_t found,
                   const char *format, ...) {
    char text[FSN_DETAIL_BYTES];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    pthread_mutex_lock(&nodes->lock);
    node->seen.found = found;
    node->seen.fsoe_address = 0;
    node->seen.link_down = false;
    memcpy(node->seen.detail, text, sizeof text);
    pthread_mutex_unlock(&nodes->lock);
}

void fsn_node_note_facts(struct fsn_nodes *nodes, struct fsn_node *node, uint16_t fsoe_address,
                         bool link_down) {
    pthread_mutex_lock(&nodes->lock);
    node->seen.fsoe_address = fsoe_address;
    node->seen.link_down = link_down;
    pthread_mutex_unlock(&nodes->lock);
}

bool fsn_node_note_identity(struct fsn_nodes *nodes, struct fsn_node *node, uint32_t vendor_id,
                            uint32_t product_code, uint32_t revision,
                            char detail[FSN_DETAIL_BYTES]) {
    pthread_mutex_lock(&nodes->lock);
    node->seen.vendor_id = vendor_id;
    node->seen.product_code = product_code;
    node->seen.revision = revision;
    pthread_mutex_unlock(&nodes->lock);
    return fsn_check_identity(&node->info, vendor_id, product_code, revision, detail);
}

static uint8_t found_of(fsn_status status) {
    switch (status) {
    case FSN_E_BUS_MISSING:
        return FSN_FOUND_NOTHING;
    case FSN_E_BUS_MAILBOX:
        return FSN_FOUND_MAILBOX;
    case FSN_E_BUS_MAPPING:
        return FSN_FOUND_MAPPING;
    case FSN_E_BUS_ADDRESS:
        return FSN_FOUND_ADDRESS;
    case FSN_E_BUS_SDO:
        return FSN_FOUND_SDO;
    default:
        return FSN_FOUND_STATE;
    }
}

fsn_status fsn_node_note_status(struct fsn_nodes *nodes, struct fsn_node *node, fsn_status status,
                                const char *detail) {
    if (status != FSN_OK) {
        fsn_node_note(nodes, node, found_of(status), "%s", detail);
    }
    return status;
}

fsn_status fsn_node_write_sdos(struct fsn_nodes *nodes, struct fsn_node *node,
                               const struct fsn_objects *objects) {
    char detail[FSN_DETAIL_BYTES];
    const fsn_status status = fsn_check_sdos(nodes->plan, &node->info, objects, detail);
    return fsn_node_note_status(nodes, node, status, detail);
}

fsn_status fsn_node_check_address(struct fsn_nodes *nodes, struct fsn_node *node,
                                  const struct fsn_objects *objects, bool *readable) {
    char detail[FSN_DETAIL_BYTES];
    uint16_t found;
    const fsn_status status =
        fsn_check_address(nodes->plan, node->number, objects, readable, &found, detail);
    if (fsn_node_note_status(nodes, node, status, detail) != FSN_OK) {
        fsn_node_note_facts(nodes, node, found, false);
    }
    return status;
}

fsn_status fsn_node_check_pdos(struct fsn_nodes *nodes, struct fsn_node *node,
                               const struct fsn_objects *objects,
                               bool (*sii_bits)(void *bus, const struct fsn_node *node, uint32_t sm,
                                                uint32_t *bits),
                               void *bus) {
    for (uint32_t sm = node->info.first_sm; sm < node->info.first_sm + node->info.sm_count; sm++) {
        char detail[FSN_DETAIL_BYTES];
        uint32_t bits;
        fsn_status status = FSN_OK;
        if (objects == NULL && sii_bits(bus, node, sm, &bits)) {
            status = fsn_pdo_check_bits(nodes->plan, sm, bits, detail);
        } else if (objects != NULL && fsn_read_sm(nodes->plan, sm).index >= 2) {
            status = fsn_pdo_check(nodes->plan, sm, objects, detail); /* the others: its mailbox */
        }
        FSN_TRY(fsn_node_note_status(nodes, node, status, detail));
    }
    return FSN_OK;
}

void fsn_node_note_op(struct fsn_nodes *nodes, struct fsn_node *node) {
    pthread_mutex_lock(&nodes->lock);
    node->seen.returns += node->away;
    pthread_mutex_unlock(&nodes->lock);
    node->away = false;
    node->was_in_op = true;
}

fsn_status fsn_node_refuse(struct fsn_fault *fault, fsn_status status,
                           const struct fsn_node *node) {
    fsn_refuse(fault, status, FSN_SEC_SUBDEVICE, node->number, 0, NULL);
    if (fault != NULL) {
        memcpy(fault->detail, node->seen.detail, sizeof fault->detail);
    }
    return status;
}

fsn_status fsn_live_refuse(struct fsn_fault *fault, fsn_status status, const char *rule,
                           const char *format, ...) {
    va_list arguments;
    fsn_refuse_all(fault, status, rule);
    if (fault != NULL) {
        va_start(arguments, format);
        vsnprintf(fault->detail, sizeof fault->detail, format, arguments);
        va_end(arguments);
    }
    return status;
}

fsn_status fsn_nodes_check(struct fsn_nodes *nodes, void *bus,
                           fsn_status (*check)(void *bus, struct fsn_node *node),
                           struct fsn_fault *fault) {
    fsn_status first = FSN_OK;
    for (uint32_t n = 0; n < nodes->count; n++) {
        struct fsn_node *node = fsn_nodes_at(nodes, n);
        const fsn_status status = check(bus, node);
        if (status != FSN_OK && first == FSN_OK) {
            first = fsn_node_refuse(fault, status, node);
        }
    }
    return first;
}

uint64_t fsn_live_cycle_ns(uint64_t given_ns, const struct fsn_plan *plan) {
    if (given_ns != 0) {
        return given_ns;
    }
    return fsn_plan_cycle_ns(plan) != 0 ? fsn_plan_cycle_ns(plan) : 1000000;
}
