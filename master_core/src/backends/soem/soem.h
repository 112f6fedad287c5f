/** SOEM as the acyclic side of a bus: scan, mailbox, states. The cycle has its own wire. */
#ifndef FSN_SOEM_INTERNAL_H
#define FSN_SOEM_INTERNAL_H

#include "fsn/live.h"
#include "live/frames.h"
#include "live/node.h"
#include "live/ring.h"

#include <ethercat.h>

enum {
    SOEM_NAME_BYTES = 16,   /**< IFNAMSIZ */
    SOEM_MOST_SLAVES = 513, /**< entry 0 is the MainDevice itself */
    SOEM_NO_NODE = -1,
};

/** A SubDevice of the plan. */
struct node {
    struct fsn_node known; /**< first */
    uint16_t slave;        /**< in SOEM's list, from 1; 0: no SubDevice at its place */
    bool configured;       /**< since it was last found: SDOs, PDOs, SMs and FMMUs are written */
    uint8_t requested;     /**< AL state; 0: none */
    uint32_t group;        /**< of the plan; FSN_NONE: it is always present */
    bool taken_in;         /**< belongs to a group: identified since it was attached */
};

/** A group of the plan, and its last result. */
struct soem_group {
    struct fsn_group_info info;
    uint8_t found;                 /**< result of its first SubDevice if it is absent */
    char detail[FSN_DETAIL_BYTES]; /**< why it was not added, or which other device is present */
};

/** Any device on the ring, in SOEM's order. */
struct place {
    int node;           /**< number of its node, or SOEM_NO_NODE */
    uint16_t al_status; /**< as last read; 0: no answer */
    uint16_t al_code;
    uint8_t quiet; /**< consecutive polls without an answer */
    bool unset;    /**< it was switched off: its clock shows another time */
    uint8_t had;   /**< ports with a link, as bits, when the ring was last closed */
};

struct fsn_soem {
    struct fsn_nodes all; /**< first */
    char interface[SOEM_NAME_BYTES], redundant[SOEM_NAME_BYTES];
    uint64_t cycle_ns, wait_ns;
    uint32_t dc_every;

    ecx_contextt context;
    ecx_portt port;
    ecx_redportt redundant_port;
    ec_slavet slaves[SOEM_MOST_SLAVES];
    int slave_count;
    ec_groupt groups[1];
    /* Longer than in SOEM, which writes 8 bytes from the start of the last 2, and marks as many. */
    uint8 esi_buffer[(EC_MAXEEPBUF) + 8];
    uint32 esi_map[EC_MAXEEPBITMAP + 1];
    ec_eringt errors;
    ec_idxstackT stack;
    boolean ecat_error;
    int64 dc_time;
    ec_SMcommtypet comm_type;
    ec_PDOassignt assign;
    ec_PDOdesct desc;
    ec_eepromSMt eeprom_sm;
    ec_eepromFMMUt eeprom_fmmu;
    ec_eepromPDOt eeprom_pdo;
    bool nic_open;
    int lock;                                /**< -1, or the descriptor that locks the interface */
    int sockets[FSN_WIRE_PORTS];             /**< of the cycle */
    struct fsn_rings *rings[FSN_WIRE_PORTS]; /**< of the same sockets with AF_XDP, or NULL */
    bool xdp;
    int foreign[FSN_WIRE_PORTS]; /**< receive frames of another MainDevice */
    uint16_t tag;                /**< in the source address of all our frames */

    struct fsn_frames frames;
    struct node *nodes; /**< the nodes of `all` */
    struct place places[SOEM_MOST_SLAVES];
    uint64_t states_ns, links_ns, search_ns; /**< when these are due again */
    uint8_t goal;                            /**< AL state of the last poll() */
    bool all_there;                          /**< its result */
    struct fsn_ring_watch ring; /**< with a second interface; `ring` in it is guarded by the lock */
    uint64_t ring_ns;           /**< when it is checked again */
    bool links_kept;            /**< `had` of the places, since it was last closed */
    uint16_t next_link;         /**< next SubDevice whose counters are read */
    const struct fsn_bus_attachment *attach; /**< until it is open; NULL: a bus started here */
    bool attached;                           /**< another process started it */
    uint16_t dc_station;                     /**< of its reference clock, 0: none */
    bool dc_needed;                          /**< a SubDevice of the plan has SYNC0 */
    bool dc_host;                            /**< its reference clock is set from here */
    uint64_t dc_base;                        /**< its lead over CLOCK_MONOTONIC at the start */
    struct fsn_bus_clocks clocks;            /**< last result, guarded by the lock */
    uint64_t clocks_ns;                      /**< when they are checked again */
    uint64_t clocks_seen;                    /**< time of the reference at the last check */
    uint32_t clocks_calm; /**< consecutive checks in which all were well inside the window */
    void *described;      /**< the last description */
    struct soem_group *groups_of_plan;
    uint32_t group_count;
};

/** Stores a note about a node; printf-like. */
#define soem_note(bus, node, ...) fsn_node_note(&(bus)->all, &(node)->known, __VA_ARGS__)

/* Finding (find.c). */

/** Scans the bus and finds every SubDevice of the plan at its place; refuses on any difference. */
fsn_status soem_find(struct fsn_soem *bus, struct fsn_fault *fault);
/** Compares the device at a position, from 1, with a SubDevice of the plan; the node notes it. */
fsn_status soem_identify(struct fsn_soem *bus, struct node *node, uint16_t at);
/** Station address and alias of the device at a position; false without an answer. */
bool soem_station_at(struct fsn_soem *bus, uint16_t at, uint16_t *station, uint16_t *alias);
bool soem_set_station(struct fsn_soem *bus, uint16_t at, uint16_t station);
/** Takes back the SubDevice at a position if it is the lost one. */
bool soem_take_back(struct fsn_soem *bus, uint16_t slave, uint16_t at);
/** Reports the device at a position that belongs to no group. */
void soem_describe_at(struct fsn_soem *bus, uint16_t at, uint16_t alias,
                      char text[FSN_DETAIL_BYTES]);
/** Searches for places that do not answer: restores their station address if the current device is
 *  the same as before. */
void soem_search(struct fsn_soem *bus);

/* Groups of SubDevices that may be absent (groups.c). They follow all others in SOEM's list,
 * whatever their place on the bus, and are added when they are found. */

enum { SOEM_GROUP_GONE_NS = 100000000 /**< after this time, the removed SubDevices are known */ };
/** Allocates the groups of the plan; false: no memory. */
bool soem_make_groups(struct fsn_soem *bus);
/** Removes SubDevices of groups from SOEM's list after its scan: positions count the others. */
void soem_set_groups_apart(struct fsn_soem *bus);
/** Gives each SubDevice of a group its number in SOEM's list. */
fsn_status soem_place_groups(struct fsn_soem *bus, struct fsn_fault *fault);
/** soem_search() for a plan with groups: also for groups that were attached. */
void soem_search_groups(struct fsn_soem *bus);
/** After each poll of the states: detects groups that are present, and those that were removed. */
void soem_watch_groups(struct fsn_soem *bus);
/** Whether it need not be in OP now, because its group is absent or has just been attached. */
bool soem_is_excused(const struct fsn_soem *bus, const struct node *node);

/* Configuring (configure.c). */

/** Brings a SubDevice, which must be in PREOP, to the point where SAFEOP can be requested: start-up
 *  SDOs, PDO assignment and mapping, FSoE address, sync managers, FMMUs, SYNC0.
 *  @retval FSN_E_BUS_SDO, FSN_E_BUS_MAPPING, FSN_E_BUS_ADDRESS, FSN_E_BUS_MAILBOX  details in
 *      `seen`
 *  of the node. */
fsn_status soem_configure(struct fsn_soem *bus, struct node *node);

/** Compares sync managers and FMMUs of a running SubDevice with what soem_configure() would write.
 *  @retval FSN_E_BUS_MAPPING  details in `seen` of the node. */
fsn_status soem_compare_layout(struct fsn_soem *bus, struct node *node);

/* A bus that is handed over in OP (attach.c). */
fsn_status soem_describe(void *context, struct fsn_bus_attachment *attachment);
void soem_discard(void *context);
/** Takes over the predecessor's data of the SubDevices; nothing on the bus is changed. */
fsn_status soem_restore(struct fsn_soem *bus, struct fsn_fault *fault);
/** Compares one SubDevice with the plan: in OP, with the same sync managers and FMMUs. */
fsn_status soem_compare(struct fsn_soem *bus, struct node *node);
/** Reads a register of a SubDevice, repeatedly if frames are late; false: no answer. */
bool soem_read_surely(struct fsn_soem *bus, uint16_t slave, uint16_t address, void *to,
                      uint16_t size_bytes);
/** SOEM's number of the planned SubDevice; 0: no device there (find.c). */
uint16_t soem_slave_of(const struct fsn_soem *bus, const struct fsn_subdevice_info *info);

/* Distributed clocks (clocks.c). */

/** Measures delays, sets all clocks after the first one, and distributes its time until they show
 *  it; without SYNC0 in the plan only where it was requested. Sets `dc_station`.
 *  @retval FSN_E_BUS_CLOCK  a SubDevice with SYNC0 has no clock, or it cannot be set. */
fsn_status soem_start_clocks(struct fsn_soem *bus, struct fsn_fault *fault);
/** The first SubDevice with a clock that answers and shows the time becomes the reference if the
 *  current one is lost; if all were off, the first one is given the time. */
void soem_keep_reference(struct fsn_soem *bus);
/** It was off, and is about to answer again: no SubDevice follows its clock until it is set. */
void soem_forget_clock(struct fsn_soem *bus, uint16_t slave);
/** Sets the clock of a SubDevice that came back, and waits until it shows the time.
 *  @retval FSN_E_BUS_CLOCK  it has SYNC0 and does not; details in `seen` of the node. */
fsn_status soem_set_clock(struct fsn_soem *bus, struct node *node);
/** Starts SYNC0 as planned.   @retval FSN_E_BUS_CLOCK  it cannot be started. */
fsn_status soem_start_sync(struct fsn_soem *bus, struct node *node);
/** Reads the differences of all clocks, when they are due. */
void soem_watch_clocks(struct fsn_soem *bus, uint64_t now_ns);
/** clocks() of fsn_bus_ops. */
bool soem_clocks(void *context, struct fsn_bus_clocks *clocks);

/* SII (sii.c). */

/** Start address of a sync manager by the SII; 0 if it has none, or must not be read. SOEM reads
 *  all at the start, and waits for a time-out at an empty SII. */
uint16_t soem_sii_start(struct fsn_soem *bus, uint16_t slave, uint8_t number);

/* Supervision (al_states.c). */
bool soem_poll(void *context, uint8_t al_state, uint64_t now_ns);
/** Number of SubDevices that answer. */
uint16_t soem_answering(const struct fsn_soem *bus);

/** Reads a register of consecutive SubDevices, of many with one frame.
 *  @param[out] values  one after the other; zeros without an answer. */
void soem_read_each(struct fsn_soem *bus, uint16_t first, uint16_t count, uint16_t address,
                    uint16_t size_bytes, void *values);

/* The ring (ring.c). */

/** Judges both directions and finds the gaps, when they are due. */
void soem_watch_ring(struct fsn_soem *bus, uint64_t now_ns);
/** ring() of fsn_bus_ops. */
bool soem_ring(void *context, struct fsn_bus_ring *ring);
enum { SOEM_LINKS_BYTES = 2 * SOEM_NAME_BYTES + 32 };
/** Writes a text about which interface has a link; false: none. */
bool soem_links(const struct fsn_soem *bus, char text[SOEM_LINKS_BYTES]);

/* Objects, SII and registers (acyclic.c). */
extern const struct fsn_bus_acyclic soem_acyclic;
/** Access to the objects of a SubDevice with CoE. Unlike soem_acyclic it requests no AL state
 *  first: at open() the SubDevices have not been checked yet. */
struct fsn_objects soem_objects(struct fsn_soem *bus, uint16_t slave);

/* Shared (soem.c). */

/** Checks for each interface that it exists, is reserved for this process and carries no frames of
 *  another MainDevice.
 */
fsn_status soem_take_interfaces(struct fsn_soem *bus, struct fsn_fault *fault);
/** Opens SOEM's sockets. */
fsn_status soem_open_nic(struct fsn_soem *bus, struct fsn_fault *fault);
/** Closes everything that is open. */
void soem_release(void *context);

/** Discards the frames that wait for SOEM. No exchange is in progress when this is called, so such
 *  a frame is the answer to one that SOEM has given up. SOEM distinguishes answers by an index
 *  modulo 16 only: after a stall each of them would pass for the answer to a later frame,
 *  permanently. */
void soem_drain(struct fsn_soem *bus);
/** Requests an AL state and waits for it, milliseconds. */
bool soem_reach(struct fsn_soem *bus, uint16_t slave, uint8_t al_state, unsigned most_ms);
/** Sets up the mailbox, without which a SubDevice that has one does not leave INIT. */
void soem_prepare_mailbox(struct fsn_soem *bus, uint16_t slave);
bool soem_has_coe(const struct fsn_soem *bus, uint16_t slave);
/** Writes registers of a SubDevice; false if it did not accept them. */
bool soem_write(struct fsn_soem *bus, uint16_t slave, uint16_t address, const void *data,
                uint16_t size_bytes);
/** SOEM's number of the SubDevice with a station address; 0: none. */
uint16_t soem_slave_at(const struct fsn_soem *bus, uint16_t station);
/** The SubDevice of the plan at a place of the ring; NULL: the plan has none there. */
struct node *soem_node_at(struct fsn_soem *bus, uint16_t slave);
/** Its name in the plan, otherwise that of its SII. */
const char *soem_name_at(const struct fsn_soem *bus, uint16_t slave);

#endif
