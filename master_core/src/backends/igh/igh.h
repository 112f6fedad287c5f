/** IgH EtherCAT Master through ecrt.h: a kernel module owns the wire and the AL states.
 *
 *  There is one domain per sync manager, so that each has its own datagram and working counter: 1
 *  if its SubDevice took part, otherwise 0. The bytes of a domain are those of the datagram, so the
 *  image is separate memory: inputs are copied into it only if their working counter is correct.
 *
 *  The attached state of the configurations ("online") does not describe the cycle: whenever the
 *  number of answering SubDevices changes, IgH scans all of them again and detaches every
 *  configuration in the meantime, while process data continue. The working counters judge the
 *  cycle. */
#ifndef FSN_IGH_INTERNAL_H
#define FSN_IGH_INTERNAL_H

#include <errno.h>
#include <stdatomic.h>

#include "fsn/live.h"
#include "live/node.h"

#include <ecrt.h>

enum {
    IGH_AL_BYTES = 6,     /**< 0x0130: AL status, reserved, AL status code */
    IGH_ERROR_BYTES = 20, /**< 0x0300 … 0x0313 */
    IGH_CONTROL_BYTES = 2,
};

/** Last use of the register request of a SubDevice. */
enum igh_register { IGH_REG_NONE, IGH_REG_AL, IGH_REG_ERRORS, IGH_REG_CONTROL };

/** A SubDevice of the plan. */
struct igh_node {
    struct fsn_node known; /**< first */
    uint16_t ring;         /**< its position on the ring in the last scan */
    ec_slave_config_t *config;
    ec_reg_request_t
        *request; /**< NULL if IgH provides none: without it, codes and counters are missing */
    enum igh_register requested;
    bool coe;              /**< it answered an SDO */
    bool address_readable; /**< its FSoE address was read before the cycle began */
    bool checked;          /**< identity and FSoE address were checked since it was last found */
    bool left;             /**< it was outside OP after it was requested to leave it */
    /** 1 while process data are exchanged with it; 0 after it was lost, until `checked`. */
    _Atomic uint8_t admitted;
    /** Consecutive cycles without a working counter in any of its domains; counted by the cycle. */
    _Atomic uint32_t silent;
    bool answered; /**< in this cycle; written by the cyclic thread */
};

/** A sync manager with a place in the image, and its domain. */
struct igh_area {
    uint32_t sm, node;
    uint32_t image_byte, size_bytes;
    bool output;
    bool queued; /**< in the last send(): otherwise its domain is from an earlier cycle */
    bool complete;
    ec_domain_t *domain;
    uint8_t *data;
};

struct fsn_igh {
    struct fsn_nodes all; /**< first */
    unsigned index;       /**< number of the master */
    uint64_t cycle_ns, wait_ns;
    uint32_t dc_every;

    ec_master_t *master;
    bool active;
    struct fsn_image image;
    uint8_t *bytes;         /**< the image */
    struct igh_node *nodes; /**< the nodes of `all` */
    struct igh_area *areas; /**< in the order of the image */
    uint32_t area_count;

    /* Used by the cyclic thread. */
    uint32_t dc_left;
    bool sent, dc_requested;
    bool uses_time;      /**< a SubDevice needs the application time */
    uint64_t app_ns;     /**< time of the application in the last send() */
    uint64_t app_set_ns; /**< CLOCK_MONOTONIC of that */

    /* Used by the acyclic side. */
    uint64_t poll_ns, reset_ns;
    uint8_t goal;
    bool all_there;
};

/** Repeats a call of ecrt.h while a signal interrupts it, `most` times. */
#define IGH_CALL(result, most, call)                                                               \
    for (int igh_calls = 0; igh_calls < (most) && ((result) = (call)) == -EINTR; igh_calls++) {    \
    }

/** Stores a note about a node; printf-like. */
#define igh_note(bus, node, ...) fsn_node_note(&(bus)->all, &(node)->known, __VA_ARGS__)

/* Finding (find.c). */

/** Waits until the bus is scanned, takes the master, and finds every SubDevice of the plan in PREOP
 *  or higher; refuses on any difference. */
fsn_status igh_find(struct fsn_igh *bus, struct fsn_fault *fault);
/** Data of IgH about the device at a ring position; false: no device. */
bool igh_slave(const struct fsn_igh *bus, uint16_t ring, ec_slave_info_t *slave);
/** Ring position of the planned SubDevice, by the last scan; false: no device there. */
bool igh_ring_of(const struct fsn_igh *bus, const struct fsn_subdevice_info *info,
                 unsigned slave_count, uint16_t *ring);
/** Stores the device at the place of a node; returns whether it is the planned one. */
bool igh_note_identity(struct fsn_igh *bus, struct igh_node *node, const ec_slave_info_t *slave);

/* Configuring (configure.c). */

/** Start-up SDOs, process data and FSoE address of one SubDevice, before the master is active.
 *  @retval FSN_E_BUS_SDO, FSN_E_BUS_MAPPING, FSN_E_BUS_ADDRESS, FSN_E_BUS_MAILBOX  details in
 *      `seen` of the node. */
fsn_status igh_check(struct fsn_igh *bus, struct igh_node *node);
/** Configures how IgH handles a SubDevice whenever it finds it, and creates the domains. */
fsn_status igh_configure(struct fsn_igh *bus, struct igh_node *node);
/** Compares the FSoE address with the plan.
 *  @param[out] readable  whether it could be read. */
fsn_status igh_check_address(struct fsn_igh *bus, struct igh_node *node, bool *readable);

/* The cycle (cycle.c). */
void igh_receive(void *context, struct fsn_bus_input *input);
void igh_send(void *context);

/* Supervision (al_states.c). */
bool igh_poll(void *context, uint8_t al_state, uint64_t now_ns);

/* Objects next to the cycle (acyclic.c). */
extern const struct fsn_bus_acyclic igh_acyclic;

/* Shared (igh.c). */

/** Releases the master. */
void igh_release(void *context);

/** Refuses because a call of ecrt.h failed. */
fsn_status igh_refuse_call(struct fsn_fault *fault, int error, const char *rule);
/** Access to its objects. */
struct fsn_objects igh_objects(struct fsn_igh *bus, const struct igh_node *node);

#endif
