/** Both directions of a ring, and the cables where it is open. */
#include <stdio.h>

#include "backends/soem/soem.h"
#include "live/port.h"

enum { RING_NS = 20000000 }; /**< between two judgements */

bool soem_links(const struct fsn_soem *bus, char text[SOEM_LINKS_BYTES]) {
    const bool ring = bus->redundant[0] != '\0';
    const bool first = fsn_port_has_link(bus->interface);
    const bool second = ring && fsn_port_has_link(bus->redundant);
    if (ring && !first && !second) {
        snprintf(text, SOEM_LINKS_BYTES, "neither %s nor %s has a link", bus->interface,
                 bus->redundant);
    } else {
        snprintf(text, SOEM_LINKS_BYTES, "%s has %s link",
                 first || !second ? bus->interface : bus->redundant, first || second ? "a" : "no");
    }
    return first || second;
}

static struct fsn_ring_counts counts_of(const struct fsn_wire *wire) {
    struct fsn_ring_counts counts = {.sent = atomic_load(&wire->sent)};
    for (unsigned sent = 0; sent < FSN_WIRE_PORTS; sent++) {
        for (unsigned in = 0; in < FSN_WIRE_PORTS; in++) {
            counts.came[sent][in] = atomic_load(&wire->came[sent][in]);
        }
    }
    return counts;
}

/** Reads the links of all SubDevices; 0 without an answer. Returns whether all answered. */
static bool read_links(struct fsn_soem *bus, uint16_t links[SOEM_MOST_SLAVES]) {
    bool whole = true;
    soem_read_each(bus, 1, (uint16_t)bus->slave_count, ECT_REG_DLSTAT, sizeof *links, links + 1);
    for (int s = 1; s <= bus->slave_count; s++) {
        links[s] = (uint16_t)(etohs(links[s]) >> 4 & 0x0F);
        whole = whole && links[s] != 0;
    }
    return whole;
}

static void keep_links(struct fsn_soem *bus) {
    uint16_t links[SOEM_MOST_SLAVES];
    if (!read_links(bus, links)) {
        return; /* try the next time */
    }
    for (int s = 1; s <= bus->slave_count; s++) {
        bus->places[s].had = (uint8_t)links[s];
    }
    bus->links_kept = true;
}

static void find_gaps(struct fsn_soem *bus, const struct fsn_ring_end ends[2],
                      char place[FSN_DETAIL_BYTES]) {
    uint16_t links[SOEM_MOST_SLAVES];
    struct fsn_ring_member members[SOEM_MOST_SLAVES];
    (void)read_links(bus, links);
    for (int s = 1; s <= bus->slave_count; s++) {
        /* A lost answer does not mean a lost SubDevice: its AL state decides. */
        const uint8_t had = bus->places[s].had;
        members[s - 1] = (struct fsn_ring_member){.name = soem_name_at(bus, (uint16_t)s),
                                                  .answers = bus->places[s].al_status != 0,
                                                  .had = had,
                                                  .has = links[s] != 0 ? (uint8_t)links[s] : had};
    }
    fsn_ring_place(&bus->ring, members, (uint32_t)bus->slave_count, ends, place);
}

void soem_watch_ring(struct fsn_soem *bus, uint64_t now_ns) {
    if (bus->redundant[0] == '\0' || now_ns < bus->ring_ns) {
        return;
    }
    bus->ring_ns = now_ns + RING_NS;
    const struct fsn_ring_end ends[2] = {{bus->interface, fsn_port_has_link(bus->interface)},
                                         {bus->redundant, fsn_port_has_link(bus->redundant)}};
    const struct fsn_ring_counts counts = counts_of(&bus->frames.wire);
    struct fsn_ring_watch watch = bus->ring; /* only this thread writes it */
    if (!fsn_ring_judge(&watch, &counts, ends[0].link && ends[1].link)) {
        return;
    }
    if (watch.ring.state > FSN_RING_CLOSED) {
        bus->links_kept = false;
        /* Links that can no longer be read keep their last state, until all are lost. */
        if (!fsn_ring_silent(&watch) || watch.ring.place[0] == '\0' || soem_answering(bus) == 0) {
            find_gaps(bus, ends, watch.ring.place);
        }
    } else {
        watch.ring.place[0] = '\0';
    }
    if (watch.ring.state == FSN_RING_CLOSED && !bus->links_kept) {
        keep_links(bus);
    }
    pthread_mutex_lock(&bus->all.lock);
    bus->ring = watch;
    pthread_mutex_unlock(&bus->all.lock);
}

bool soem_ring(void *context, struct fsn_bus_ring *ring) {
    struct fsn_soem *bus = context;
    pthread_mutex_lock(&bus->all.lock);
    *ring = bus->ring.ring;
    pthread_mutex_unlock(&bus->all.lock);
    return bus->redundant[0] != '\0';
}
