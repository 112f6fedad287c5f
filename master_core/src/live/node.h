/** The SubDevices of a plan in every live bus: data and last observation. */
#ifndef FSN_LIVE_NODE_H
#define FSN_LIVE_NODE_H

#include <pthread.h>

#include "live/check.h"
#include "live/image.h"

/** First member of a backend's own node. Used by the acyclic thread; `seen` is guarded by the
 *  lock. */
struct fsn_node {
    struct fsn_subdevice_info info;
    uint32_t number;       /**< in the plan */
    bool was_in_op;        /**< at least once */
    bool away;             /**< it was in OP, but is no longer */
    uint64_t requested_ns; /**< when the last request was sent to it */
    uint64_t retry_ns;     /**< no attempt is made before */
    struct fsn_bus_subdevice seen;
};

struct fsn_nodes {
    const struct fsn_plan *plan; /**< plan that it was opened with; held by the core */
    void *first;                 /**< owned; `count` nodes of the backend, consecutive */
    uint32_t count;
    size_t node_bytes;
    pthread_mutex_t lock; /**< guards `seen` of the nodes; never taken by the cycle */
};

void fsn_nodes_init(struct fsn_nodes *nodes);
void fsn_nodes_free(struct fsn_nodes *nodes);

/** Creates one zeroed node for each SubDevice of the plan, replacing existing ones; NULL: no
 *  memory. */
void *fsn_nodes_create(struct fsn_nodes *nodes, const struct fsn_plan *plan, size_t node_bytes);

/** Node of a SubDevice of the plan. */
struct fsn_node *fsn_nodes_at(const struct fsn_nodes *nodes, uint32_t number);

/** state() of fsn_bus_ops for a bus that begins with its nodes. */
fsn_status fsn_nodes_state(void *bus, uint32_t subdevice, struct fsn_bus_subdevice *seen);

/** Writes a note about a node, for fsn_nodes_state(); printf-like. */
__attribute__((format(printf, 4, 5))) void fsn_node_note(struct fsn_nodes *nodes,
                                                         struct fsn_node *node, uint8_t found,
                                                         const char *format, ...);

/** Adds the numeric meaning to the last note of a node, see fsn_bus_subdevice. */
void fsn_node_note_facts(struct fsn_nodes *nodes, struct fsn_node *node, uint16_t fsoe_address,
                         bool link_down);

/** Stores the identity of the device at the place of a node; returns whether it is the planned one,
 *  otherwise `detail` names both. */
bool fsn_node_note_identity(struct fsn_nodes *nodes, struct fsn_node *node, uint32_t vendor_id,
                            uint32_t product_code, uint32_t revision,
                            char detail[FSN_DETAIL_BYTES]);

/** Checks of check.h and pdo.h; a difference becomes the note of the node.
 *  @param[in] objects  NULL: it has no CoE. */
fsn_status fsn_node_write_sdos(struct fsn_nodes *nodes, struct fsn_node *node,
                               const struct fsn_objects *objects);
fsn_status fsn_node_check_address(struct fsn_nodes *nodes, struct fsn_node *node,
                                  const struct fsn_objects *objects, bool *readable);
/** @param[in] sii_bits  length of a sync manager in the SII; false: it is not checked. */
fsn_status fsn_node_check_pdos(struct fsn_nodes *nodes, struct fsn_node *node,
                               const struct fsn_objects *objects,
                               bool (*sii_bits)(void *bus, const struct fsn_node *node, uint32_t sm,
                                                uint32_t *bits),
                               void *bus);

/** Notes why a check of a SubDevice failed; returns `status`. */
fsn_status fsn_node_note_status(struct fsn_nodes *nodes, struct fsn_node *node, fsn_status status,
                                const char *detail);

/** The SubDevice is in OP: counts a return if it was away since it was last in OP. */
void fsn_node_note_op(struct fsn_nodes *nodes, struct fsn_node *node);

/** Refuses because of a node; the detail is its note. */
fsn_status fsn_node_refuse(struct fsn_fault *fault, fsn_status status, const struct fsn_node *node);

/** Refuses a bus, with a detail; printf-like.   @return status. */
__attribute__((format(printf, 4, 5))) fsn_status fsn_live_refuse(struct fsn_fault *fault,
                                                                 fsn_status status,
                                                                 const char *rule,
                                                                 const char *format, ...);

/** Checks every node, even after a refused one, so that all can be reported.
 *  @return the first refusal. */
fsn_status fsn_nodes_check(struct fsn_nodes *nodes, void *bus,
                           fsn_status (*check)(void *bus, struct fsn_node *node),
                           struct fsn_fault *fault);

/** The bus cycle; if not given, that of the plan, or 1 ms. */
uint64_t fsn_live_cycle_ns(uint64_t given_ns, const struct fsn_plan *plan);

#endif
