/** States, losses and returns, next to the running cycle. */
#include "backends/soem/soem.h"

#include <string.h>

enum {
    STATES_NS = 5000000,   /**< between two polls of all states */
    SEARCH_NS = 50000000,  /**< between two searches for lost SubDevices */
    LINKS_NS = 20000000,   /**< between reading the link counters of two SubDevices */
    RETRY_NS = 1000000000, /**< after a refusal */
    QUIET_POLLS = 2,       /**< polls without an answer until a SubDevice counts as lost */
    LINK_BYTES = 20,       /**< 0x0300 … 0x0313 */
    REG_LINK_LOST = 0x10,  /**< from 0x0300 on */
    STATE_BITS = 0x0F,
    AT_ONCE = 32, /**< registers read with one frame */
};

/** Timeout for a requested state: most take milliseconds, some drives 3 s. */
static const uint64_t patience_ns = 4000000000u;

/* -- polling -------------------------------------------------------------------------------- */

static void note_state(struct fsn_soem *bus, struct node *node, uint16_t status, uint16_t code) {
    pthread_mutex_lock(&bus->all.lock);
    node->known.seen.al_status = (uint8_t)status;
    if ((status & EC_STATE_ERROR) != 0) {
        node->known.seen.al_code = code;
    }
    pthread_mutex_unlock(&bus->all.lock);
}

/** The link that is down: that of the nearest preceding SubDevice that still answers. */
static void note_loss(struct fsn_soem *bus, struct node *node) {
    uint16_t before = bus->slaves[node->slave].parent;
    while (before != 0 && bus->places[before].al_status == 0) {
        before = bus->slaves[before].parent;
    }
    if (before == 0) {
        char linked[SOEM_LINKS_BYTES];
        soem_note(bus, node, FSN_FOUND_NOTHING,
                  soem_links(bus, linked)
                      ? "%s, but no SubDevice after it answers: power of the SubDevices, or "
                        "frames are late"
                      : "%s",
                  linked);
        return;
    }
    uint16_t links = 0;
    const bool known = ecx_FPRD(bus->context.port, bus->slaves[before].configadr, ECT_REG_DLSTAT,
                                sizeof links, &links, EC_TIMEOUTRET) == 1;
    if (!known && node->known.seen.found == FSN_FOUND_NOTHING) {
        return; /* the last note stays until its links are known */
    }
    links = etohs(links);
    unsigned port = 0;
    while (port < FSN_PORTS && ((bus->slaves[before].activeports & (1u << port)) == 0 ||
                                (links & (0x10u << port)) != 0)) {
        port++;
    }
    const char *name = soem_name_at(bus, before);
    if (port < FSN_PORTS) {
        soem_note(bus, node, FSN_FOUND_NOTHING,
                  "the link after %.40s (ring position %u, port %u) is down", name, before - 1u,
                  port);
        fsn_node_note_facts(&bus->all, &node->known, 0, true);
    } else {
        soem_note(bus, node, FSN_FOUND_NOTHING,
                  "the last one before it that answers is %.40s, whose links are up", name);
    }
}

static void lose(struct fsn_soem *bus, uint16_t slave) {
    struct place *place = &bus->places[slave];
    place->al_status = 0;
    if (place->node == SOEM_NO_NODE) {
        return;
    }
    struct node *node = &bus->nodes[place->node];
    node->requested = 0;
    node->known.away = node->known.was_in_op;
    if (node->known.info.assign_activate != 0) {
        node->configured = false; /* its clock runs free in the meantime: restart below OP */
    }
    note_state(bus, node, 0, 0);
    if (node->group != FSN_NONE) {
        node->taken_in = false; /* the next device that answers is identified first */
    } else if (node->known.seen.found != FSN_FOUND_NOTHING &&
               node->known.seen.found != FSN_FOUND_IDENTITY) {
        note_loss(bus, node);
    }
}

static void see(struct fsn_soem *bus, uint16_t slave, uint16_t status, uint16_t code) {
    struct place *place = &bus->places[slave];
    /* At the place of a group, any device may be plugged in: it counts only after it was
     * compared. */
    const bool is_unknown = place->node != SOEM_NO_NODE &&
                            bus->nodes[place->node].group != FSN_NONE &&
                            !bus->nodes[place->node].taken_in;
    const bool answers = (status & STATE_BITS) != 0 && !is_unknown;
    if (place->node != SOEM_NO_NODE) {
        const struct node *node = &bus->nodes[place->node];
        /* Inputs are valid from SAFEOP on; the cyclic thread reads this flag without a lock. */
        atomic_store_explicit(&bus->frames.wire.answers[node->known.number],
                              answers && (status & STATE_BITS) >= EC_STATE_SAFE_OP,
                              memory_order_relaxed);
    }
    if (!answers) {
        /* One answer can be lost with its frame: only several consecutive ones mean that the
         * SubDevice is missing. */
        place->quiet = (uint8_t)(place->quiet < QUIET_POLLS ? place->quiet + 1 : QUIET_POLLS);
        if (place->quiet >= QUIET_POLLS) {
            lose(bus, slave);
        }
        return;
    }
    place->quiet = 0;
    place->al_status = status;
    place->al_code = code;
    if (place->node != SOEM_NO_NODE) {
        struct node *node = &bus->nodes[place->node];
        note_state(bus, node, status, code);
        /* A SubDevice that was in OP and has left it counts as away until it reaches OP again. */
        node->known.away = node->known.was_in_op && (node->known.away || status != FSN_AL_OP);
        if (node->known.seen.found == FSN_FOUND_NOTHING) {
            soem_note(bus, node, FSN_FOUND_RIGHT, "%s", "");
        }
    }
}

static void read_some(struct fsn_soem *bus, uint16_t first, uint16_t count, uint16_t address,
                      uint16_t size_bytes, uint8 *value) {
    ecx_portt *port = bus->context.port;
    uint16 places[AT_ONCE] = {EC_HEADERSIZE};
    memset(value, 0, (size_t)count * size_bytes);
    soem_drain(bus);
    const uint8 index = ecx_getindex(port);
    ecx_setupdatagram(port, &port->txbuf[index], EC_CMD_FPRD, index, bus->slaves[first].configadr,
                      address, size_bytes, value);
    for (uint16_t i = 1; i < count; i++) {
        places[i] = ecx_adddatagram(port, &port->txbuf[index], EC_CMD_FPRD, index, i + 1 < count,
                                    bus->slaves[first + i].configadr, address, size_bytes,
                                    value + (size_t)i * size_bytes);
    }
    if (ecx_srconfirm(port, index, EC_TIMEOUTRET3) >= 0) {
        for (uint16_t i = 0; i < count; i++) {
            const uint8 *data = port->rxbuf[index] + places[i];
            if (data[size_bytes] == 1) { /* its working counter */
                memcpy(value + (size_t)i * size_bytes, data, size_bytes);
            }
        }
    }
    ecx_setbufstat(port, index, EC_BUF_EMPTY);
}

void soem_read_each(struct fsn_soem *bus, uint16_t first, uint16_t count, uint16_t address,
                    uint16_t size_bytes, void *values) {
    for (uint16_t done = 0; done < count; done = (uint16_t)(done + AT_ONCE)) {
        const uint16_t left = (uint16_t)(count - done);
        read_some(bus, (uint16_t)(first + done), left < AT_ONCE ? left : (uint16_t)AT_ONCE, address,
                  size_bytes, (uint8 *)values + (size_t)done * size_bytes);
    }
}

static void poll_states(struct fsn_soem *bus) {
    ec_alstatust states[SOEM_MOST_SLAVES];
    soem_read_each(bus, 1, (uint16_t)bus->slave_count, ECT_REG_ALSTAT, sizeof *states, states + 1);
    for (uint16_t slave = 1; slave <= bus->slave_count; slave++) {
        see(bus, slave, etohs(states[slave].alstatus), etohs(states[slave].alstatuscode));
    }
}

/** In a ring a lost link has no effect yet, but the next one would: it is reported for the
 *  SubDevices on both sides of the gap. */
static void note_gap(struct fsn_soem *bus, struct node *node) {
    const bool open = bus->ring.ring.state > FSN_RING_CLOSED;
    if (node->known.seen.found != FSN_FOUND_RIGHT) {
        return;
    }
    for (unsigned port = 0; open && port < FSN_PORTS; port++) {
        if ((bus->places[node->slave].had & (1u << port)) != 0 &&
            node->known.seen.link[port] == 0) {
            soem_note(bus, node, FSN_FOUND_RIGHT, "the ring is open at its port %u", port);
            return;
        }
    }
    if (node->known.seen.detail[0] != '\0') {
        soem_note(bus, node, FSN_FOUND_RIGHT, "%s", "");
    }
}

/** Reads links and counters of one SubDevice after another. For a lost one, determines where it is
 *  cut off now: one gap may hide another, and the first lost frames show neither. */
static void poll_links(struct fsn_soem *bus) {
    bus->next_link = (uint16_t)(bus->next_link >= bus->slave_count ? 1 : bus->next_link + 1);
    const struct place *place = &bus->places[bus->next_link];
    if (place->node == SOEM_NO_NODE) {
        return;
    }
    if (place->al_status == 0) {
        struct node *lost = &bus->nodes[place->node];
        if (lost->group == FSN_NONE && lost->known.seen.found == FSN_FOUND_NOTHING) {
            note_loss(bus, lost);
        }
        return;
    }
    const uint16_t station = bus->slaves[bus->next_link].configadr;
    uint8_t counters[LINK_BYTES] = {0};
    uint16_t links = 0;
    if (ecx_FPRD(bus->context.port, station, ECT_REG_DLSTAT, sizeof links, &links, EC_TIMEOUTRET) !=
            1 ||
        ecx_FPRD(bus->context.port, station, ECT_REG_RXERR, sizeof counters, counters,
                 EC_TIMEOUTRET) != 1) {
        return;
    }
    struct fsn_bus_subdevice *seen = &bus->nodes[place->node].known.seen;
    pthread_mutex_lock(&bus->all.lock);
    for (unsigned port = 0; port < FSN_PORTS; port++) {
        seen->link[port] = (uint8_t)((uint32_t)etohs(links) >> (4 + port)) & 1u;
        seen->rx_errors[port] = counters[2 * port];
        seen->link_lost[port] = counters[REG_LINK_LOST + port];
    }
    pthread_mutex_unlock(&bus->all.lock);
    note_gap(bus, &bus->nodes[place->node]);
}

/* -- towards a state
 * -------------------------------------------------------------------------------- */

static void request_state(struct fsn_soem *bus, struct node *node, uint8_t state, uint64_t now_ns) {
    ec_slavet *s = &bus->slaves[node->slave];
    s->state = (uint16)(state | EC_STATE_ACK);
    ecx_writestate(&bus->context, node->slave);
    node->requested = state;
    node->known.requested_ns = now_ns;
}

static const char *name_of(uint8_t state) {
    switch (state) {
    case FSN_AL_OP:
        return "OP";
    case FSN_AL_SAFEOP:
        return "SAFEOP";
    case FSN_AL_PREOP:
        return "PREOP";
    default:
        return "INIT";
    }
}

static void give_up(struct fsn_soem *bus, struct node *node, uint64_t now_ns) {
    const struct place *place = &bus->places[node->slave];
    const char *state = name_of(node->requested);
    if ((place->al_status & EC_STATE_ERROR) != 0) {
        soem_note(bus, node, FSN_FOUND_STATE, "%s refused: AL status 0x%02x, code 0x%04x: %s",
                  state, place->al_status, place->al_code, fsn_al_code_text(place->al_code));
    } else {
        soem_note(bus, node, FSN_FOUND_STATE, "not in %s after %u ms: AL status 0x%02x", state,
                  (unsigned)(patience_ns / 1000000), place->al_status);
    }
    node->requested = 0;
    node->known.retry_ns = now_ns + RETRY_NS;
}

static uint8_t above(uint8_t state) {
    return state == FSN_AL_INIT ? FSN_AL_PREOP : (uint8_t)(2 * state);
}

/** One step of one SubDevice towards a higher state. */
static void lift(struct fsn_soem *bus, struct node *node, uint8_t state, uint64_t now_ns) {
    if (state == FSN_AL_INIT || state == FSN_AL_BOOT) {
        node->configured = false;
        if (state == FSN_AL_BOOT) {
            request_state(bus, node, FSN_AL_INIT, now_ns);
            return;
        }
        soem_prepare_mailbox(bus, node->slave);
    }
    if (state == FSN_AL_PREOP && !node->configured && soem_configure(bus, node) != FSN_OK) {
        node->known.retry_ns = now_ns + RETRY_NS;
        return;
    }
    if (state == FSN_AL_SAFEOP && !node->configured) {
        request_state(bus, node, FSN_AL_PREOP,
                      now_ns); /* it returned without losing power: restart everything */
        return;
    }
    request_state(bus, node, above(state), now_ns);
}

/** Returns whether the SubDevice is in the required state. */
static bool bring_to(struct fsn_soem *bus, struct node *node, uint8_t goal, uint64_t now_ns) {
    const struct place *place = &bus->places[node->slave];
    const uint8_t state = place->al_status & STATE_BITS;
    const bool error = (place->al_status & EC_STATE_ERROR) != 0;
    /* Even without a request: SubDevices may be in the state left by an earlier process. */
    if (state == goal && !error) {
        if (goal == FSN_AL_OP) {
            fsn_node_note_op(&bus->all, &node->known);
        }
        if (node->requested != 0) {
            soem_note(bus, node, FSN_FOUND_RIGHT, "%s", "");
        }
        node->requested = 0;
        return true;
    }
    /* A change of state takes time; a second request would restart it in the device. */
    if (node->requested != 0 && state != node->requested && !error) {
        if (now_ns - node->known.requested_ns > patience_ns) {
            give_up(bus, node, now_ns);
        }
        return false;
    }
    /* The device has refused: its AL status code is read before another attempt. */
    if (node->requested != 0 && error && state != node->requested) {
        give_up(bus, node, now_ns);
        return false;
    }
    /* A device that refuses immediately must not be asked in each poll. */
    if (now_ns < node->known.retry_ns) {
        return false;
    }
    /* Down to the goal in one step; up only through each state in order. */
    if (state > goal) {
        request_state(bus, node, goal, now_ns);
    } else if (error) {
        request_state(bus, node, state, now_ns); /* acknowledges the error */
    } else {
        lift(bus, node, state, now_ns);
    }
    return false;
}

uint16_t soem_answering(const struct fsn_soem *bus) {
    uint16_t count = 0;
    for (int s = 1; s <= bus->slave_count; s++) {
        count = (uint16_t)(count + (bus->places[s].al_status != 0));
    }
    return count;
}

bool soem_poll(void *context, uint8_t al_state, uint64_t now_ns) {
    struct fsn_soem *bus = context;
    if (now_ns < bus->states_ns && al_state == bus->goal) {
        return bus->all_there;
        /* A new goal is not delayed by the interval of the polls. */
    }
    bus->goal = al_state;
    poll_states(bus);
    soem_watch_groups(bus);
    soem_keep_reference(bus);
    bool all = true; /* missing SubDevices have also left OP */
    for (uint32_t n = 0; n < bus->all.count; n++) {
        struct node *node = &bus->nodes[n];
        if (bus->places[node->slave].al_status != 0) {
            const bool is_there = bring_to(bus, node, al_state, now_ns);
            all = all && (is_there || (al_state == FSN_AL_OP && soem_is_excused(bus, node)));
        } else {
            all = all && (al_state != FSN_AL_OP || soem_is_excused(bus, node));
        }
    }
    /* The search reads registers of the whole ring, so it runs only at intervals. */
    if (soem_answering(bus) < bus->slave_count && now_ns >= bus->search_ns) {
        (bus->group_count > 0 ? soem_search_groups : soem_search)(bus);
        bus->search_ns = now_ns + SEARCH_NS;
    }
    soem_watch_ring(bus, now_ns);
    soem_watch_clocks(bus, now_ns);
    if (now_ns >= bus->links_ns) {
        poll_links(bus);
        bus->links_ns = now_ns + LINKS_NS;
    }
    /* Polled again immediately while a SubDevice changes its state, so that the start is not slowed
     * down. */
    bus->states_ns = all ? now_ns + STATES_NS : 0;
    bus->all_there = all;
    return all;
}
