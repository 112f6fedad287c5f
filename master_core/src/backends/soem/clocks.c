/** Distributed clocks: set at the start, monitored while the bus runs, set again for returning
 *  SubDevices. */
#define _POSIX_C_SOURCE 200809L

#include "backends/soem/soem.h"

#include <stdio.h>
#include <string.h>

#include "rt/clock.h"

enum {
    REG_LOOP = 0x0930, /**< writing it restarts the mean difference */
    LOOP_DEFAULT = 0x1000,
    READING_BYTES = 6,   /**< 0x092C, followed by 0x0930, which is not zero */
    BATCH = 100,         /**< frames with the time between two checks of the differences */
    STEADY = 10,         /**< consecutive checks: a clock without the time may cross the window */
    MOST_FRAMES = 15000, /**< of one attempt; this number compensates a quartz */
    TRIES = 3,
    SYNC_DELAY_NS = 100000000, /**< until the first pulse, while the start is written */
    WATCH_NS = 100000000,
    CALM = 30, /**< consecutive checks, 3 s: covers clocks that cross the window repeatedly */
    SETTLE_NS = 5000000,
    SETTLE_LOOKS = 100,
    NOBODY = 0xFFFE, /**< station if no clock shows the time: it then continues from here */
};

static const uint64_t try_ns = 2000000000u;

static uint16_t reference(const struct fsn_soem *bus) {
    return soem_slave_at(bus, (uint16_t)atomic_load(&bus->frames.wire.dc_station));
}

/* -- differences ---------------------------------------------------------------------------- */

/** Only clocks with SYNC0 count; if there are none, all clocks of the plan. */
static bool counts(struct fsn_soem *bus, uint16_t slave, uint16_t of) {
    const struct node *node = soem_node_at(bus, slave);
    return node != NULL && slave != of && bus->slaves[slave].hasdc &&
           (!bus->dc_needed || node->known.info.assign_activate != 0);
}

/** Reads how far clocks are from the reference.
 *  @param[in] running  only SubDevices in SAFEOP or OP.
 *  @return the SubDevice with the largest difference or without an answer; 0: all are in the
 *        window. */
static uint16_t look(struct fsn_soem *bus, uint16_t of, bool running, struct fsn_bus_clocks *c) {
    uint16_t worst = 0;
    c->subdevices = c->outside = c->worst_ns = 0;
    uint8_t values[SOEM_MOST_SLAVES][READING_BYTES];
    soem_read_each(bus, 1, (uint16_t)bus->slave_count, ECT_REG_DCSYSDIFF, READING_BYTES, values[1]);
    for (uint16_t slave = 1; slave <= bus->slave_count; slave++) {
        const bool answers = fsn_get16(values[slave] + 4) != 0;
        if (!counts(bus, slave, of) ||
            (running && ((bus->places[slave].al_status & 0x0F) < FSN_AL_SAFEOP || !answers))) {
            continue;
        }
        /* The meaning of the highest bit as a sign differs between controllers. */
        const uint32_t apart = answers ? fsn_get32(values[slave]) & INT32_MAX : INT32_MAX;
        c->subdevices++;
        c->outside += apart > c->window_ns;
        if (apart > c->worst_ns) {
            c->worst_ns = apart;
            worst = slave;
        }
    }
    return c->outside > 0 ? worst : 0;
}

/* -- start ---------------------------------------------------------------------------------- */

/** Reads the reference clock: its lead over CLOCK_MONOTONIC. */
static bool read_base(struct fsn_soem *bus, uint16_t station) {
    for (int tries = 0; tries < TRIES; tries++) {
        uint64_t time = 0;
        const uint64_t before = fsn_clock_ns(CLOCK_MONOTONIC);
        if (ecx_FPRD(bus->context.port, station, ECT_REG_DCSYSTIME, sizeof time, &time,
                     EC_TIMEOUTRET) == 1) {
            bus->dc_base = etohll(time) - (before + (fsn_clock_ns(CLOCK_MONOTONIC) - before) / 2);
            return true;
        }
    }
    return false;
}

/** Distributes the time until all show it. Returns a SubDevice that does not; 0: all do. */
static uint16_t compensate(struct fsn_soem *bus, uint16_t of) {
    const uint16_t station = bus->slaves[of].configadr;
    const uint64_t end_ns = fsn_clock_ns(CLOCK_MONOTONIC) + try_ns;
    struct fsn_bus_clocks seen = bus->clocks;
    uint16_t loop = htoes(LOOP_DEFAULT);
    uint16_t worst = of;
    int steady = 0;
    soem_drain(bus);
    (void)ecx_BWR(bus->context.port, 0, REG_LOOP, sizeof loop, &loop, EC_TIMEOUTRET3);
    for (int frame = 0;
         frame < MOST_FRAMES && steady < STEADY && fsn_clock_ns(CLOCK_MONOTONIC) < end_ns;
         frame++) {
        uint64_t time = 0;
        (void)ecx_FRMW(bus->context.port, station, ECT_REG_DCSYSTIME, sizeof time, &time,
                       EC_TIMEOUTRET);
        if (frame % BATCH == BATCH - 1) {
            const uint16_t now = look(bus, of, false, &seen);
            steady = now == 0 ? steady + 1 : 0;
            worst = now != 0 ? now : worst;
        }
    }
    bus->clocks.worst_ns = seen.worst_ns;
    return steady == STEADY ? 0 : worst;
}

/** A SubDevice that answers has a link, even if its DL status reported none or a lost frame hid it:
 *  SOEM relies on it, and computes delays with a port that it never set. */
static void believe_no_missing_link(struct fsn_soem *bus) {
    for (int s = 1; s <= bus->slave_count; s++) {
        ec_slavet *slave = &bus->slaves[s];
        if (slave->activeports == 0) {
            slave->activeports = 1; /* port 0, where frames arrive */
            slave->topology = 1;
        }
    }
}

static fsn_status refuse(struct fsn_soem *bus, uint16_t slave, struct fsn_fault *fault,
                         const char *why) {
    struct node *node = soem_node_at(bus, slave);
    if (node == NULL) { /* the reference, which the plan need not name */
        return fsn_refuse_all(fault, FSN_E_BUS_CLOCK, "the reference clock does not answer");
    }
    soem_note(bus, node, FSN_FOUND_CLOCK, "%s", why);
    return fsn_node_refuse(fault, FSN_E_BUS_CLOCK, &node->known);
}

/** Whether the plan needs clocks, and each SubDevice that needs one has one. */
static fsn_status need(struct fsn_soem *bus, struct fsn_fault *fault) {
    fsn_status status = FSN_OK;
    bus->dc_needed = false;
    for (uint32_t n = 0; n < bus->all.count; n++) {
        const struct node *node = &bus->nodes[n];
        if (node->known.info.assign_activate == 0) {
            continue;
        }
        bus->dc_needed = true;
        if (!bus->slaves[node->slave].hasdc && status == FSN_OK) {
            status = refuse(bus, node->slave, fault,
                            "the plan starts SYNC0 (assign_activate), and it has no distributed "
                            "clock");
        }
    }
    if (bus->dc_every == 0 && bus->dc_needed) {
        bus->dc_every = 1;
    }
    return status;
}

fsn_status soem_start_clocks(struct fsn_soem *bus, struct fsn_fault *fault) {
    believe_no_missing_link(bus);
    bus->dc_station = 0;
    const fsn_status status = need(bus, fault);
    if (status != FSN_OK || bus->dc_every == 0) {
        return status;
    }
    uint16_t worst = 0;
    for (int tries = 0; tries < TRIES; tries++) {
        soem_drain(bus);
        if (!ecx_configdc(&bus->context)) {
            return FSN_OK; /* no SubDevice has a clock, and none needs one */
        }
        const uint16_t of = bus->slaves[0].DCnext;
        worst = compensate(bus, of);
        if (worst == 0 || !bus->dc_needed) {
            bus->dc_station = bus->slaves[of].configadr;
            return read_base(bus, bus->dc_station) ? FSN_OK : refuse(bus, of, fault, "no answer");
        }
    }
    char why[FSN_DETAIL_BYTES];
    snprintf(why, sizeof why, "its clock is %u ns from the reference clock (%.40s) after %d tries",
             (unsigned)bus->clocks.worst_ns, soem_name_at(bus, bus->slaves[0].DCnext), TRIES);
    return refuse(bus, worst, fault, why);
}

/* -- one SubDevice -------------------------------------------------------------------------- */

/** Reads both system times and the offset with one frame, whose path is known: nothing else arrives
 *  in between. */
static bool read_both(struct fsn_soem *bus, uint16_t station, uint16_t of, uint64_t values[3]) {
    const struct {
        uint16_t station, address;
    } reads[3] = {
        {of, ECT_REG_DCSYSTIME}, {station, ECT_REG_DCSYSTIME}, {station, ECT_REG_DCSYSOFFSET}};
    ecx_portt *port = bus->context.port;
    uint16 places[3] = {EC_HEADERSIZE};
    bool whole = true;
    soem_drain(bus);
    const uint8 index = ecx_getindex(port);
    memset(values, 0, 3 * sizeof *values);
    ecx_setupdatagram(port, &port->txbuf[index], EC_CMD_FPRD, index, reads[0].station,
                      reads[0].address, sizeof *values, values);
    for (int i = 1; i < 3; i++) {
        places[i] = ecx_adddatagram(port, &port->txbuf[index], EC_CMD_FPRD, index, i < 2,
                                    reads[i].station, reads[i].address, sizeof *values, values + i);
    }
    if (ecx_srconfirm(port, index, EC_TIMEOUTRET3) < 0) {
        whole = false;
    }
    for (int i = 0; whole && i < 3; i++) {
        const uint8 *data = port->rxbuf[index] + places[i];
        whole = fsn_get16(data + sizeof *values) == 1;
        values[i] = fsn_get32(data) | (uint64_t)fsn_get32(data + 4) << 32;
    }
    ecx_setbufstat(port, index, EC_BUF_EMPTY);
    return whole;
}

static void pause_ns(uint64_t time_ns) {
    const struct timespec pause = {.tv_sec = (time_t)(time_ns / 1000000000u),
                                   .tv_nsec = (long)(time_ns % 1000000000u)};
    nanosleep(&pause, NULL);
}

/** Waits until the control loop of a clock has brought it into the window, and keeps it there.
 *  While no time arrives, the difference stays unchanged and is not valid. */
static bool settles(struct fsn_soem *bus, const struct node *node) {
    const uint64_t period_ns = bus->cycle_ns * bus->dc_every;
    uint64_t seen = atomic_load(&bus->frames.wire.dc_seen);
    int steady = 0;
    for (int looks = 0; looks < SETTLE_LOOKS && steady < STEADY; looks++) {
        uint8_t value[READING_BYTES];
        pause_ns(period_ns > SETTLE_NS ? period_ns : SETTLE_NS);
        const uint64_t before = seen;
        seen = atomic_load(&bus->frames.wire.dc_seen);
        soem_read_each(bus, node->slave, 1, ECT_REG_DCSYSDIFF, sizeof value, value);
        const uint32_t apart = fsn_get32(value) & INT32_MAX;
        steady = fsn_get16(value + 4) != 0 && apart <= bus->clocks.window_ns
                     ? steady + (seen != before)
                     : 0;
    }
    return steady == STEADY;
}

/** Writes offset and delay, and restarts the mean difference. */
static void write_offset(struct fsn_soem *bus, uint16_t slave, uint64_t offset_ns) {
    const uint64_t offset = htoell(offset_ns);
    const uint32_t delay = htoel((uint32_t)bus->slaves[slave].pdelay);
    const uint16_t loop = htoes(LOOP_DEFAULT);
    bus->places[slave].unset =
        !soem_write(bus, slave, ECT_REG_DCSYSOFFSET, &offset, sizeof offset) ||
        !soem_write(bus, slave, ECT_REG_DCSYSDELAY, &delay, sizeof delay) ||
        !soem_write(bus, slave, REG_LOOP, &loop, sizeof loop);
}

/** Sets a clock that follows the reference on the ring. */
static void set_after(struct fsn_soem *bus, uint16_t slave, uint16_t of) {
    const ec_slavet *s = &bus->slaves[slave];
    uint64_t values[3];
    if (read_both(bus, s->configadr, bus->slaves[of].configadr, values)) {
        const int32 way_ns = s->pdelay - bus->slaves[of].pdelay;
        write_offset(bus, slave, values[2] + values[0] + (uint64_t)(int64_t)way_ns - values[1]);
    }
}

/** Sets a clock to the time that is expected here, because no other clock has it any longer. */
static void set_here(struct fsn_soem *bus, uint16_t slave) {
    const uint16_t station = bus->slaves[slave].configadr;
    uint64_t values[3];
    const uint64_t before = fsn_clock_ns(CLOCK_MONOTONIC);
    if (read_both(bus, station, station, values)) {
        const uint64_t now = before + (fsn_clock_ns(CLOCK_MONOTONIC) - before) / 2;
        const uint64_t base = atomic_load(&bus->frames.wire.dc_base);
        write_offset(bus, slave, values[2] + base + now - values[1]);
    }
}

/** The first SubDevice with a clock that answers and has the time; 0: none. */
static uint16_t first_clock(const struct fsn_soem *bus, bool set) {
    for (uint16_t s = 1; s <= bus->slave_count; s++) {
        const struct place *place = &bus->places[s];
        if (bus->slaves[s].hasdc && place->al_status != 0 && !(set && place->unset)) {
            return s;
        }
    }
    return 0;
}

void soem_forget_clock(struct fsn_soem *bus, uint16_t slave) {
    const uint16_t station = bus->slaves[slave].configadr;
    bus->places[slave].unset = bus->slaves[slave].hasdc;
    if (atomic_load(&bus->frames.wire.dc_station) == station) {
        atomic_store(&bus->frames.wire.dc_station, NOBODY);
    }
}

void soem_keep_reference(struct fsn_soem *bus) {
    if (atomic_load(&bus->frames.wire.dc_station) == 0) {
        return;
    }
    uint16_t found = first_clock(bus, true);
    if (found == 0) {
        found = first_clock(bus, false);
        if (found != 0) {
            set_here(bus, found);
            /* Not accepted: its time is not distributed, and it is set again. */
            found = bus->places[found].unset ? 0 : found;
        }
    }
    if (found != 0) {
        atomic_store(&bus->frames.wire.dc_station, bus->slaves[found].configadr);
    }
    for (uint16_t s = 1; s <= bus->slave_count && found != 0; s++) {
        /* Those of the plan are set when they are configured. */
        if (bus->places[s].unset && bus->places[s].al_status != 0 && soem_node_at(bus, s) == NULL) {
            set_after(bus, s, found);
        }
    }
}

fsn_status soem_set_clock(struct fsn_soem *bus, struct node *node) {
    if (!bus->slaves[node->slave].hasdc || atomic_load(&bus->frames.wire.dc_station) == 0) {
        return FSN_OK;
    }
    const struct place *place = &bus->places[node->slave];
    const uint16_t of = reference(bus);
    for (int tries = 0; tries < TRIES && of != 0 && of != node->slave; tries++) {
        set_after(bus, node->slave, of);
        if (!place->unset) {
            /* A clock before the reference becomes the next reference: SubDevices before it do not
             * get its time. */
            soem_keep_reference(bus);
            break;
        }
    }
    if (node->known.info.assign_activate == 0) {
        return FSN_OK;
    }
    if (of == 0 || place->unset) {
        soem_note(bus, node, FSN_FOUND_CLOCK, "its clock could not be set; it is tried again");
        return FSN_E_BUS_CLOCK;
    }
    if (reference(bus) == node->slave) {
        pause_ns(3 * bus->cycle_ns * bus->dc_every); /* until it has distributed its time */
        return FSN_OK;
    }
    if (settles(bus, node)) {
        return FSN_OK;
    }
    soem_note(bus, node, FSN_FOUND_CLOCK, "it does not follow the reference clock (%.40s)",
              soem_name_at(bus, of));
    return FSN_E_BUS_CLOCK;
}

/** One try: the first pulse on a whole multiple of the cycle, as that of all others. The multiple
 *  is one of the time that the cycle follows: a clock of 32 bits has only the lower part of it, and
 *  the upper part of 64-bit clocks may differ between them. */
static bool start_pulses(struct fsn_soem *bus, const struct node *node) {
    const uint64_t cycle = bus->cycle_ns;
    uint64_t shown = 0;
    uint64_t now = 0;
    uint8_t word[2] = {0};
    uint8_t cycles[8] = {0}; /* SYNC0, then SYNC1 at the same time */
    uint8_t start[8];
    soem_drain(bus);
    if (!soem_write(bus, node->slave, ECT_REG_DCCUC, word, sizeof word) ||
        !soem_read_surely(bus, node->slave, ECT_REG_DCSYSTIME, &shown, sizeof shown)) {
        return false;
    }
    shown = etohll(shown);
    const uint64_t time = fsn_clock_nearest(
        fsn_clock_ns(CLOCK_MONOTONIC) + atomic_load(&bus->frames.wire.dc_base), shown);
    const uint64_t first = ((time + SYNC_DELAY_NS) / cycle + 1) * cycle;
    fsn_put32(cycles, (uint32_t)cycle);
    fsn_put64(start, shown + (first - time));
    fsn_put16(word, node->known.info.assign_activate);
    return soem_write(bus, node->slave, ECT_REG_DCCYCLE0, cycles, sizeof cycles) &&
           soem_write(bus, node->slave, ECT_REG_DCSTART0, start, sizeof start) &&
           soem_write(bus, node->slave, ECT_REG_DCCUC, word, sizeof word) &&
           soem_read_surely(bus, node->slave, ECT_REG_DCSYSTIME, &now, sizeof now) &&
           /* otherwise this machine was too slow, and it would not pulse before its time wraps */
           (uint32_t)(etohll(now) - shown) < first - time;
}

fsn_status soem_start_sync(struct fsn_soem *bus, struct node *node) {
    for (int tries = 0; tries < TRIES && node->known.info.assign_activate != 0; tries++) {
        if (start_pulses(bus, node)) {
            return FSN_OK;
        }
    }
    if (node->known.info.assign_activate == 0) {
        return FSN_OK;
    }
    soem_note(bus, node, FSN_FOUND_CLOCK,
              "SYNC0 could not be started: its registers from 0x0980 "
              "on are not taken in time");
    return FSN_E_BUS_CLOCK;
}

/* -- watching ------------------------------------------------------------------------------- */

/** Compares all clocks with the reference, which gives its time. A clock near the edge of the
 *  window, or one that follows this machine after a gap, leaves it repeatedly: they are apart until
 *  all have stayed within half of it for 3 s. */
static void judge(struct fsn_soem *bus, uint16_t of, struct fsn_bus_clocks *c) {
    const uint16_t worst = look(bus, of, true, c);
    snprintf(c->reference, sizeof c->reference, "%.60s", soem_name_at(bus, of));
    bus->clocks_calm = c->worst_ns <= c->window_ns / 2 ? bus->clocks_calm + 1 : 0;
    if (worst != 0) {
        c->leaves += c->state != FSN_CLOCKS_APART;
        c->state = FSN_CLOCKS_APART;
        snprintf(c->place, sizeof c->place, "%.60s is %u ns from %.60s", soem_name_at(bus, worst),
                 (unsigned)c->worst_ns, c->reference);
    } else if (c->subdevices == 0) {
        c->state = FSN_CLOCKS_UNKNOWN;
        c->place[0] = '\0';
    } else if (c->state < FSN_CLOCKS_APART || bus->clocks_calm >= CALM) {
        c->state = FSN_CLOCKS_SYNCHRONOUS;
        c->place[0] = '\0';
    }
}

void soem_watch_clocks(struct fsn_soem *bus, uint64_t now_ns) {
    const struct fsn_wire *wire = &bus->frames.wire;
    const uint64_t seen = atomic_load(&wire->dc_seen);
    if (seen == 0 || now_ns < bus->clocks_ns) { /* no clocks in use, or none has been read yet */
        return;
    }
    const uint64_t period_ns = 2 * bus->cycle_ns * bus->dc_every;
    bus->clocks_ns = now_ns + (period_ns > WATCH_NS ? period_ns : WATCH_NS);
    struct fsn_bus_clocks c = bus->clocks; /* only this thread writes it */
    const uint16_t of = reference(bus);
    c.lead_ns = (uint32_t)(bus->cycle_ns - seen % bus->cycle_ns);
    if (of != 0 && seen != bus->clocks_seen) {
        judge(bus, of, &c);
    } else { /* no frame has carried its time since */
        bus->clocks_calm = 0;
        c.subdevices = c.outside = c.worst_ns = 0;
        c.state = FSN_CLOCKS_LOST;
        snprintf(c.place, sizeof c.place, "the time of %.60s does not come back", c.reference);
    }
    bus->clocks_seen = seen;
    pthread_mutex_lock(&bus->all.lock);
    bus->clocks = c;
    pthread_mutex_unlock(&bus->all.lock);
}

bool soem_clocks(void *context, struct fsn_bus_clocks *clocks) {
    struct fsn_soem *bus = context;
    pthread_mutex_lock(&bus->all.lock);
    *clocks = bus->clocks;
    pthread_mutex_unlock(&bus->all.lock);
    return atomic_load(&bus->frames.wire.dc_station) != 0;
}
