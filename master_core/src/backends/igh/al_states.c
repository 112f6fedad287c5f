/** States, losses and returns, next to the running cycle.
 *
 *  IgH brings every SubDevice that has a configuration to OP by itself, again after each loss. It
 *  identifies it by vendor and product code alone. In addition, this module gives a lost SubDevice
 *  no process data in either direction until its revision and FSoE address have been compared with
 *  the plan. It cannot prevent the following: IgH writes start-up SDOs, mapping, sync managers and
 *  FMMUs into any device of that vendor and product, and requests OP. */
#include "backends/igh/igh.h"

#include <string.h>

enum {
    POLL_NS = 10000000,    /**< between two polls of all SubDevices */
    AGAIN_NS = 100000000,  /**< between two tries to read an FSoE address */
    RETRY_NS = 1000000000, /**< after a refusal */
    STUCK_NS = 1000000000, /**< a register request without an answer: it is repeated */
    QUIET_CYCLES = 10,     /**< cycles without a working counter until a SubDevice counts as lost */
    STATE_BITS = 0x0F,
    REG_CONTROL = 0x0120,
    REG_STATUS = 0x0130,
    REG_ERRORS = 0x0300,
    LINK_LOST = 0x10, /**< 0x0310, from 0x0300 on */
};

/* -- registers ------------------------------------------------------------------------------ */

static void note_al(struct fsn_igh *bus, struct igh_node *node, const uint8_t *data) {
    const uint16_t status = fsn_get16(data);
    node->left = node->left || (status & STATE_BITS) != FSN_AL_OP;
    if ((status & FSN_AL_ERROR) == 0) {
        return;
    }
    pthread_mutex_lock(&bus->all.lock);
    node->known.seen.al_code = fsn_get16(data + 4);
    pthread_mutex_unlock(&bus->all.lock);
}

static void note_errors(struct fsn_igh *bus, struct igh_node *node, const uint8_t *data) {
    pthread_mutex_lock(&bus->all.lock);
    for (unsigned port = 0; port < FSN_PORTS; port++) {
        node->known.seen.rx_errors[port] = data[2 * port];
        node->known.seen.link_lost[port] = data[LINK_LOST + port];
    }
    pthread_mutex_unlock(&bus->all.lock);
}

static void request_register(struct igh_node *node, enum igh_register what, uint64_t now_ns) {
    int result = 0;
    if (what == IGH_REG_AL) {
        result = ecrt_reg_request_read(node->request, REG_STATUS, IGH_AL_BYTES);
    } else if (what == IGH_REG_ERRORS) {
        result = ecrt_reg_request_read(node->request, REG_ERRORS, IGH_ERROR_BYTES);
    } else {
        static const uint8_t safeop[IGH_CONTROL_BYTES] = {FSN_AL_SAFEOP, 0};
        memcpy(ecrt_reg_request_data(node->request), safeop, sizeof safeop);
        result = ecrt_reg_request_write(node->request, REG_CONTROL, IGH_CONTROL_BYTES);
    }
    node->requested = result == 0 ? what : IGH_REG_NONE;
    node->known.requested_ns = now_ns;
}

/** Takes the answer to the last request and sends the next one. */
static void poll_registers(struct fsn_igh *bus, struct igh_node *node, bool leaving,
                           uint64_t now_ns) {
    if (node->request == NULL) {
        return;
    }
    const ec_request_state_t state = ecrt_reg_request_state(node->request);
    if (node->requested != IGH_REG_NONE && state == EC_REQUEST_BUSY) {
        /* The same request again: if the first one is answered after all, the answer matches. */
        if (now_ns - node->known.requested_ns > STUCK_NS) {
            request_register(node, node->requested, now_ns);
        }
        return;
    }
    if (state == EC_REQUEST_SUCCESS && node->requested == IGH_REG_AL) {
        note_al(bus, node, ecrt_reg_request_data(node->request));
    } else if (state == EC_REQUEST_SUCCESS && node->requested == IGH_REG_ERRORS) {
        note_errors(bus, node, ecrt_reg_request_data(node->request));
    }
    if (leaving) {
        request_register(node, node->requested == IGH_REG_CONTROL ? IGH_REG_AL : IGH_REG_CONTROL,
                         now_ns);
    } else {
        request_register(node, node->requested == IGH_REG_AL ? IGH_REG_ERRORS : IGH_REG_AL, now_ns);
    }
}

/* -- polling -------------------------------------------------------------------------------- */

static bool is_silent(const struct igh_node *node) {
    return atomic_load_explicit(&node->silent, memory_order_relaxed) >= QUIET_CYCLES;
}

static void shut_out(struct igh_node *node) {
    atomic_store_explicit(&node->admitted, 0, memory_order_release);
    node->checked = false;
}

static void lose(struct fsn_igh *bus, struct igh_node *node) {
    shut_out(node);
    node->known.away = node->known.was_in_op;
    pthread_mutex_lock(&bus->all.lock);
    const bool noted =
        node->known.seen.found == FSN_FOUND_NOTHING || node->known.seen.found == FSN_FOUND_IDENTITY;
    node->known.seen.al_status = FSN_AL_NONE;
    pthread_mutex_unlock(&bus->all.lock);
    if (!noted) {
        igh_note(bus, node, FSN_FOUND_NOTHING,
                 "no answer; secure the machine, then look at its cable, its supply, and those of "
                 "the SubDevices before it");
    }
}

static void note_slave(struct fsn_igh *bus, struct igh_node *node, const ec_slave_info_t *slave) {
    pthread_mutex_lock(&bus->all.lock);
    node->known.seen.al_status =
        (uint8_t)(slave->al_state | (slave->error_flag != 0 ? FSN_AL_ERROR : 0));
    for (unsigned port = 0; port < FSN_PORTS; port++) {
        node->known.seen.link[port] = slave->ports[port].link.link_up != 0;
    }
    pthread_mutex_unlock(&bus->all.lock);
}

/** Whether the FSoE address is the same as before, as far as it could be read then. */
static bool has_address(struct fsn_igh *bus, struct igh_node *node, unsigned state) {
    bool readable = false;
    if (!node->address_readable) {
        return true;
    }
    /* Below PREOP it has no mailbox. */
    return (state == FSN_AL_PREOP || state == FSN_AL_SAFEOP || state == FSN_AL_OP) &&
           igh_check_address(bus, node, &readable) == FSN_OK && readable;
}

/** Whether the device at the position is the planned one; only then is it admitted. */
static bool admit(struct fsn_igh *bus, struct igh_node *node, const ec_slave_info_t *slave,
                  uint64_t now_ns) {
    if (!igh_note_identity(bus, node, slave)) {
        shut_out(node);
        return false;
    }
    if (node->checked) {
        return true;
    }
    if (now_ns < node->known.retry_ns) {
        return false;
    }
    node->known.retry_ns = now_ns + AGAIN_NS;
    if (!has_address(bus, node, slave->al_state & STATE_BITS)) {
        return false;
    }
    node->checked = true;
    node->known.retry_ns = 0;
    atomic_store_explicit(&node->admitted, 1, memory_order_release);
    igh_note(bus, node, FSN_FOUND_RIGHT, "%s", "");
    return true;
}

/** IgH no longer starts a SubDevice that has refused a state. A reset makes it retry, without
 *  effect on the others. */
static void retry_refused(struct fsn_igh *bus, struct igh_node *node, const ec_slave_info_t *slave,
                          uint64_t now_ns) {
    igh_note(bus, node, FSN_FOUND_STATE,
             "OP refused: AL status 0x%02x, code 0x%04x; see the kernel log", slave->al_state,
             node->known.seen.al_code);
    if (now_ns >= bus->reset_ns) {
        (void)ecrt_master_reset(bus->master);
        bus->reset_ns = now_ns + RETRY_NS;
    }
}

static void note_op(struct fsn_igh *bus, struct igh_node *node) {
    fsn_node_note_op(&bus->all, &node->known);
    if (node->known.seen.found == FSN_FOUND_STATE) { /* only this thread writes it */
        igh_note(bus, node, FSN_FOUND_RIGHT, "%s", "");
    }
}

/** Returns false if it answers and is not in OP. */
static bool bring_to(struct fsn_igh *bus, struct igh_node *node, const ec_master_info_t *master,
                     uint64_t now_ns) {
    ec_slave_info_t slave = {0};
    if (!igh_ring_of(bus, &node->known.info, master->slave_count, &node->ring) ||
        !igh_slave(bus, node->ring, &slave)) {
        lose(bus, node);
        return true;
    }
    /* If the device was restarted between two polls, its outputs must not be used before it is
     * compared. */
    if (node->checked && node->known.was_in_op && is_silent(node) &&
        (slave.al_state & STATE_BITS) < FSN_AL_SAFEOP) {
        shut_out(node); /* it was absent between two polls */
        node->known.away = true;
    }
    note_slave(bus, node, &slave);
    node->known.away =
        node->known.away || (node->known.was_in_op && (slave.al_state & STATE_BITS) != FSN_AL_OP);
    const bool admitted = admit(bus, node, &slave, now_ns);
    poll_registers(bus, node, false, now_ns);
    /* A device that was not compared may be a different one, and is not asked again. */
    if (slave.error_flag != 0 && admitted) {
        retry_refused(bus, node, &slave, now_ns);
    }
    if (slave.al_state != FSN_AL_OP || slave.error_flag != 0 || !admitted) {
        return false;
    }
    note_op(bus, node);
    return true;
}

/** During a scan IgH has no SubDevices; only the working counters show which ones are lost. */
static void lose_silent(struct fsn_igh *bus) {
    for (uint32_t n = 0; n < bus->all.count; n++) {
        if (bus->nodes[n].known.was_in_op && is_silent(&bus->nodes[n])) {
            lose(bus, &bus->nodes[n]);
        }
    }
}

/* -- leaving -------------------------------------------------------------------------------- */

/** ecrt.h cannot request a state below OP. It offers only deactivation, which ends the exchange of
 *  process data at once. So AL control is written through a register request while the cycle
 *  continues, and AL status is read back. IgH detects a SubDevice in an unexpected state and will
 *  bring it up again, from INIT on. It is therefore enough to see it once outside OP, and the
 *  caller must close the bus soon after. A SubDevice without a register request, or without an
 *  answer, is not waited for. */
static bool leave(struct fsn_igh *bus, struct igh_node *node, uint64_t now_ns) {
    if (node->left || node->request == NULL || is_silent(node)) {
        return true;
    }
    poll_registers(bus, node, true, now_ns);
    if (node->left) {
        pthread_mutex_lock(&bus->all.lock);
        node->known.seen.al_status = FSN_AL_SAFEOP;
        pthread_mutex_unlock(&bus->all.lock);
    }
    return node->left;
}

static void begin(struct fsn_igh *bus, uint8_t al_state) {
    bus->goal = al_state;
    bus->poll_ns = 0;
    for (uint32_t n = 0; n < bus->all.count; n++) {
        bus->nodes[n].left = false;
    }
}

bool igh_poll(void *context, uint8_t al_state, uint64_t now_ns) {
    struct fsn_igh *bus = context;
    if (al_state != bus->goal) {
        begin(bus, al_state);
    }
    bool all = true;
    if (al_state != FSN_AL_OP) {
        for (uint32_t n = 0; n < bus->all.count; n++) {
            all = leave(bus, &bus->nodes[n], now_ns) && all;
        }
        return all;
    }
    if (now_ns < bus->poll_ns) {
        return bus->all_there;
    }
    bus->poll_ns = now_ns + POLL_NS;
    ec_master_info_t master = {0};
    if (ecrt_master(bus->master, &master) != 0) {
        return bus->all_there;
    }
    if (master.scan_busy != 0) {
        lose_silent(bus);
        return bus->all_there;
    }
    for (uint32_t n = 0; n < bus->all.count; n++) {
        all = bring_to(bus, &bus->nodes[n], &master, now_ns) && all;
    }
    bus->all_there = all;
    return all;
}
