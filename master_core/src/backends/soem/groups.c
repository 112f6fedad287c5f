/** Groups of SubDevices that may be absent: detects attached groups by the alias of the first
 *  SubDevice, and removed groups. */
#include "backends/soem/soem.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    STATIONS = 0x2000, /**< station addresses of groups; SOEM's own begin at 0x1001 */
    INIT_MS = 100,
    OLD_FMMUS = 48, /**< bytes: three FMMUs, as cleared by SOEM at its start */
    OLD_SMS = 32,
    MAILBOX_OUT = 0x00010026, /**< sync manager flags, as in SOEM */
    MAILBOX_IN = 0x00010022,
};

/* -- at the start ----------------------------------------------------------------------------- */

bool soem_make_groups(struct fsn_soem *bus) {
    const uint32_t count = fsn_plan_group_count(bus->all.plan);
    free(bus->groups_of_plan);
    bus->group_count = FSN_NEW(bus->groups_of_plan, count) ? count : 0;
    for (uint32_t g = 0; g < bus->group_count; g++) {
        bus->groups_of_plan[g].info = fsn_known_group(bus->all.plan, g);
    }
    for (uint32_t n = 0; n < bus->all.count; n++) {
        bus->nodes[n].group = fsn_plan_group_of(bus->all.plan, n);
    }
    return bus->groups_of_plan != NULL;
}

static struct node *member(const struct fsn_soem *bus, const struct soem_group *group,
                           uint32_t number) {
    return &bus->nodes[group->info.first_subdevice + number];
}

/** The group with this alias; FSN_NONE: none. */
static uint32_t group_with(const struct fsn_soem *bus, uint16_t alias) {
    for (uint32_t g = 0; g < bus->group_count && alias != 0; g++) {
        if (member(bus, &bus->groups_of_plan[g], 0)->known.info.alias == alias) {
            return g;
        }
    }
    return FSN_NONE;
}

static bool is_member(const struct fsn_soem *bus, const struct soem_group *group, uint32_t number,
                      uint16_t slave) {
    char detail[FSN_DETAIL_BYTES];
    const ec_slavet *s = &bus->slaves[slave];
    return fsn_check_identity(&member(bus, group, number)->known.info, s->eep_man, s->eep_id,
                              s->eep_rev, detail);
}

void soem_set_groups_apart(struct fsn_soem *bus) {
    uint16_t number[SOEM_MOST_SLAVES] = {0}; /* new number of each SubDevice of a group */
    const struct soem_group *of = NULL;      /* that has begun, and its next SubDevice */
    uint32_t next = 0;
    uint16_t kept = 0;
    for (int s = 1; s <= bus->slave_count; s++) {
        const uint32_t group = group_with(bus, bus->slaves[s].aliasadr);
        if (group != FSN_NONE) {
            of = &bus->groups_of_plan[group];
            next = 0;
        }
        if (of != NULL && (next == 0 || is_member(bus, of, next, (uint16_t)s))) {
            of = ++next < of->info.subdevice_count ? of : NULL;
            number[s] = number[bus->slaves[s].parent];
            continue;
        }
        of = NULL;
        number[s] = ++kept;
        bus->slaves[kept] = bus->slaves[s];
        bus->slaves[kept].parent = number[bus->slaves[s].parent];
    }
    bus->slave_count = kept;
}

fsn_status soem_place_groups(struct fsn_soem *bus, struct fsn_fault *fault) {
    for (uint32_t n = 0; n < bus->all.count; n++) {
        struct node *node = &bus->nodes[n];
        if (node->group == FSN_NONE) {
            continue;
        }
        if (bus->slave_count + 1 >= SOEM_MOST_SLAVES) {
            return fsn_refuse_all(fault, FSN_E_BUS_IMAGE, "more than 512 SubDevices on the bus");
        }
        node->slave = (uint16_t)++bus->slave_count;
        bus->places[node->slave] = (struct place){.node = (int)n};
        bus->slaves[node->slave] =
            (ec_slavet){.configadr = (uint16)(STATIONS + n), .activeports = 1, .topology = 1};
        soem_note(bus, node, FSN_FOUND_ABSENT, "%s", "");
    }
    const uint64_t cycle_ns = bus->cycle_ns > 0 ? bus->cycle_ns : 1;
    bus->frames.wire.group_patience =
        (uint32_t)(SOEM_GROUP_GONE_NS / cycle_ns + 1) * bus->frames.wire.frame_count;
    return FSN_OK;
}

/* -- coming ----------------------------------------------------------------------------------- */

static bool is_answering(const struct fsn_soem *bus, const struct node *node) {
    return bus->places[node->slave].al_status != 0;
}

static void set_there(struct fsn_soem *bus, uint32_t group, uint8_t there) {
    atomic_store_explicit(&bus->frames.wire.groups[group].there, there, memory_order_relaxed);
}

static uint8_t there_of(const struct fsn_soem *bus, uint32_t group) {
    return atomic_load_explicit(&bus->frames.wire.groups[group].there, memory_order_relaxed);
}

/** Mailbox data from the SII; the rest is read during configuration. */
static void read_mailbox(struct fsn_soem *bus, uint16_t slave) {
    ec_slavet *s = &bus->slaves[slave];
    uint16_t status = 0;
    bus->context.esislave = 0; /* earlier data are no longer valid */
    (void)ecx_FPRD(bus->context.port, s->configadr, ECT_REG_EEPSTAT, sizeof status, &status,
                   EC_TIMEOUTRET3);
    s->eep_8byte = (etohs(status) & EC_ESTAT_R64) != 0;
    const uint32 out = etohl(ecx_readeeprom(&bus->context, slave, ECT_SII_RXMBXADR, EC_TIMEOUTEEP));
    s->mbx_wo = (uint16)out;
    s->mbx_l = (uint16)(out >> 16);
    if (s->mbx_l == 0) {
        return;
    }
    const uint32 in = etohl(ecx_readeeprom(&bus->context, slave, ECT_SII_TXMBXADR, EC_TIMEOUTEEP));
    s->mbx_ro = (uint16)in;
    s->mbx_rl = (uint16)(in >> 16) != 0 ? (uint16)(in >> 16) : s->mbx_l;
    s->mbx_proto =
        (uint16)etohl(ecx_readeeprom(&bus->context, slave, ECT_SII_MBXPROTO, EC_TIMEOUTEEP));
    s->SM[0] = (ec_smt){htoes(s->mbx_wo), htoes(s->mbx_l), htoel(MAILBOX_OUT)};
    s->SM[1] = (ec_smt){htoes(s->mbx_ro), htoes(s->mbx_rl), htoel(MAILBOX_IN)};
}

/** Adds the device at a position, as after power-on: it may have just run on another bus, with the
 *  sync managers and FMMUs of that bus. */
static bool take_in(struct fsn_soem *bus, struct node *node, uint16_t at) {
    static const uint8_t nothing[OLD_FMMUS] = {0};
    ec_slavet *s = &bus->slaves[node->slave];
    const uint16_t station = s->configadr;
    *s = (ec_slavet){.configadr = station,
                     .aliasadr = node->known.info.alias,
                     .eep_man = node->known.seen.vendor_id,
                     .eep_id = node->known.seen.product_code,
                     .eep_rev = node->known.seen.revision,
                     .activeports = 1,
                     .topology = 1};
    snprintf(s->name, sizeof s->name, "%.*s", EC_MAXNAME, node->known.info.name);
    if (!soem_set_station(bus, at, station) ||
        !soem_write(bus, node->slave, ECT_REG_FMMU0, nothing, OLD_FMMUS) ||
        !soem_write(bus, node->slave, ECT_REG_SM0, nothing, OLD_SMS) ||
        !soem_reach(bus, node->slave, FSN_AL_INIT, INIT_MS)) {
        return false;
    }
    read_mailbox(bus, node->slave);
    bus->places[node->slave].quiet = 0;
    bus->places[node->slave].al_status = FSN_AL_INIT;
    node->taken_in = true;
    node->configured = false;
    node->requested = 0;
    node->known.retry_ns = 0;
    return true;
}

/** The group that is present at the same place; NULL: none. */
static const struct soem_group *rival(const struct fsn_soem *bus, const struct soem_group *group) {
    for (uint32_t g = 0; g < bus->group_count && group->info.place[0] != 0; g++) {
        const struct soem_group *other = &bus->groups_of_plan[g];
        if (other != group && strcmp(other->info.place, group->info.place) == 0 &&
            there_of(bus, g) != FSN_WIRE_ABSENT) {
            return other;
        }
    }
    return NULL;
}

/** Identifies a group whose first SubDevice is at a position, and adds it. A difference from the
 *  plan is noted at its first SubDevice, which is left unchanged. */
static void come(struct fsn_soem *bus, uint32_t number, uint16_t at) {
    struct soem_group *group = &bus->groups_of_plan[number];
    const struct soem_group *other = rival(bus, group);
    if (other != NULL) {
        snprintf(group->detail, sizeof group->detail,
                 "it is at ring position %u while %.40s is at %.40s", at - 1u, other->info.name,
                 group->info.place);
        return;
    }
    for (uint32_t m = 0; m < group->info.subdevice_count; m++) {
        struct node *node = member(bus, group, m);
        if (soem_identify(bus, node, (uint16_t)(at + m)) != FSN_OK) {
            group->found = node->known.seen.found;
            snprintf(group->detail, sizeof group->detail, "ring position %u, %.40s: %.90s",
                     at + m - 1u, node->known.info.name, node->known.seen.detail);
            return;
        }
    }
    set_there(bus, number, FSN_WIRE_COMING);
    bool all = true;
    for (uint32_t m = 0; m < group->info.subdevice_count && all; m++) {
        all = take_in(bus, member(bus, group, m), (uint16_t)(at + m));
    }
    if (!all) { /* it is removed again with the next poll */
        snprintf(group->detail, sizeof group->detail, "it does not reach INIT");
    }
}

/* -- searching -------------------------------------------------------------------------------- */

/** Planned neighbour after one of our SubDevices; 0: unknown. */
static uint16_t behind(const struct fsn_soem *bus, uint16_t slave) {
    const bool exists = slave < bus->slave_count;
    const int node = bus->places[slave].node;
    const int next = exists ? bus->places[slave + 1].node : SOEM_NO_NODE;
    const uint32_t own = node == SOEM_NO_NODE ? FSN_NONE : bus->nodes[node].group;
    const uint32_t other = next == SOEM_NO_NODE ? FSN_NONE : bus->nodes[next].group;
    return exists && own == other ? (uint16_t)(slave + 1) : 0;
}

/** Whether a lost SubDevice is at a position again; adds it again. */
static bool is_back(struct fsn_soem *bus, uint16_t slave, uint16_t at) {
    if (slave == 0 || bus->places[slave].al_status != 0) {
        return false;
    }
    const int node = bus->places[slave].node;
    if (node != SOEM_NO_NODE && bus->nodes[node].group != FSN_NONE) {
        struct node *of = &bus->nodes[node];
        return there_of(bus, of->group) != FSN_WIRE_ABSENT &&
               soem_identify(bus, of, at) == FSN_OK && take_in(bus, of, at);
    }
    return soem_take_back(bus, slave, at);
}

static void note_stranger(struct fsn_soem *bus, uint16_t at, uint16_t alias) {
    char text[FSN_DETAIL_BYTES];
    soem_describe_at(bus, at, alias, text);
    for (uint32_t g = 0; g < bus->group_count; g++) {
        struct soem_group *group = &bus->groups_of_plan[g];
        if (there_of(bus, g) == FSN_WIRE_ABSENT && group->detail[0] == 0) {
            memcpy(group->detail, text, sizeof text);
        }
    }
}

/** Follows the line: positions of the permanent SubDevices count without the groups. */
static void walk(struct fsn_soem *bus, uint16_t count) {
    uint16_t next = 1;   /* next permanent SubDevice; 0: unknown */
    uint16_t member = 0; /* next SubDevice of a group that has begun */
    for (uint16_t at = 1; at <= count; at++) {
        uint16_t station;
        uint16_t alias;
        if (!soem_station_at(bus, at, &station, &alias)) {
            return;
        }
        const uint16_t slave = soem_slave_at(bus, station);
        if (slave != 0 && bus->places[slave].al_status != 0) {
            const int node = bus->places[slave].node;
            const bool is_group = node != SOEM_NO_NODE && bus->nodes[node].group != FSN_NONE;
            next = is_group ? next : behind(bus, slave);
            member = is_group ? behind(bus, slave) : 0;
            continue;
        }
        const uint32_t group = group_with(bus, alias);
        if (group != FSN_NONE && there_of(bus, group) == FSN_WIRE_ABSENT) {
            come(bus, group, at);
            at = (uint16_t)(at + bus->groups_of_plan[group].info.subdevice_count - 1);
        } else if (is_back(bus, member, at)) {
            member = behind(bus, member);
        } else if (is_back(bus, next, at)) {
            next = behind(bus, next);
        } else {
            note_stranger(bus, at, alias);
            next = 0;
            member = 0;
        }
    }
}

static void note_absent(struct fsn_soem *bus, uint32_t number) {
    const struct soem_group *group = &bus->groups_of_plan[number];
    for (uint32_t m = 0; m < group->info.subdevice_count; m++) {
        soem_note(bus, member(bus, group, m), m == 0 ? group->found : FSN_FOUND_ABSENT, "%s",
                  m == 0 ? group->detail : "");
    }
}

void soem_search_groups(struct fsn_soem *bus) {
    uint16_t type;
    soem_drain(bus);
    const int count =
        ecx_BRD(bus->context.port, 0, ECT_REG_TYPE, sizeof type, &type, EC_TIMEOUTRET);
    for (uint32_t g = 0; g < bus->group_count; g++) {
        bus->groups_of_plan[g].found = FSN_FOUND_ABSENT;
        bus->groups_of_plan[g].detail[0] = 0;
    }
    if (count > 0 && count != soem_answering(bus)) {
        walk(bus, (uint16_t)count);
    }
    for (uint32_t g = 0; g < bus->group_count; g++) {
        if (there_of(bus, g) == FSN_WIRE_ABSENT) {
            note_absent(bus, g);
        }
    }
}

/* -- there, and gone -------------------------------------------------------------------------- */

void soem_watch_groups(struct fsn_soem *bus) {
    for (uint32_t g = 0; g < bus->group_count; g++) {
        struct soem_group *group = &bus->groups_of_plan[g];
        const uint8_t there = there_of(bus, g);
        uint32_t lost = 0;
        bool in_op = true;
        for (uint32_t m = 0; m < group->info.subdevice_count; m++) {
            const struct node *node = member(bus, group, m);
            lost += !is_answering(bus, node);
            in_op = in_op && bus->places[node->slave].al_status == FSN_AL_OP;
        }
        if (there == FSN_WIRE_ABSENT) {
            continue;
        }
        if (lost == group->info.subdevice_count) {
            set_there(bus, g, FSN_WIRE_ABSENT);
            group->found = FSN_FOUND_ABSENT;
            group->detail[0] = 0;
            note_absent(bus, g);
        } else if (in_op) {
            set_there(bus, g, FSN_WIRE_THERE);
        }
        for (uint32_t m = 0;
             m < group->info.subdevice_count && lost > 0 && lost < group->info.subdevice_count;
             m++) {
            struct node *node = member(bus, group, m);
            if (!is_answering(bus, node) && node->known.seen.found != FSN_FOUND_IDENTITY) {
                soem_note(bus, node, FSN_FOUND_NOTHING, "the rest of %.60s is there",
                          group->info.name);
            }
        }
    }
}

bool soem_is_excused(const struct fsn_soem *bus, const struct node *node) {
    return node->group != FSN_NONE && there_of(bus, node->group) != FSN_WIRE_THERE;
}
