/** Parts of the scanner: captured packets → process data → candidates → connections. */
#ifndef FSN_SCAN_INTERNAL_H
#define FSN_SCAN_INTERNAL_H

#include "fsn/scan.h"

enum {
    MAX_WINDOWS = 2048,     /**< different process data areas */
    MAX_CANDIDATES = 8192,  /**< places that may hold FSoE frames */
    MAX_CONNECTIONS = 1024, /**< found */
    MEMORY = 24,            /**< frames that a candidate remembers */
    STRIKE = 2,             /**< weight of a value that is not a command; a command counts -1 */
    MOST_STRIKES = 8,
    GIVEN_UP = 6,    /**< a place with this count is ignored */
    PATIENCE = 3,    /**< consecutive frames that contradict the assumption about a place */
    PAIR_TRIES = 32, /**< searches for another end per packet, and pairs tried */
    OWN_TRIES = 4,   /**< of these, pairs tried with one place */
    SLOTS = 2,       /**< candidates per place: of the length of its blocks, and of 6 bytes */
    DEFERRED = 341,  /**< 6-byte frames that fit into a packet */
};

#define NONE 0xFFFFFFFFu

/** One frame shown by a candidate. */
struct shown {
    uint64_t time_ns, packet;
    uint8_t *bytes;
};

/** A place in the process data that may contain FSoE frames. */
struct candidate {
    uint32_t window, offset, size_bytes;
    uint16_t connection_id; /**< 0: not yet shown */
    uint32_t count;         /**< frames shown; [count % MEMORY] is the next slot */
    uint32_t next_try;      /**< count from which pairing is tried again */
    uint32_t next_other;    /**< the place that is tried first at that time */
    struct shown shown[MEMORY];
    uint32_t next_free;  /**< of an unused slot: the next one, plus 1 */
    uint32_t connection; /**< NONE: not known to be an end of a connection */
    uint8_t way;
    uint8_t against; /**< consecutive frames that contradict length, connection or copy */
    bool copy;       /**< repeats another place of the connection */
    bool used;
};

/** Last process data at one address. */
struct window {
    uint64_t bus; /**< its number and the source address of the MainDevice */
    uint8_t command;
    uint32_t address;
    uint16_t size_bytes;
    bool seen;
    uint8_t *last;
    uint8_t *strikes;         /**< per byte, up to MOST_STRIKES */
    uint32_t (*slots)[SLOTS]; /**< per byte: its candidates, NONE if there is none */
};

struct found {
    struct fsn_scan_connection info;
    struct fsn_monitor monitor;
    /** While the chain is unknown: the state of the monitor if the frame of the sub is first in
     *  packets with frames of both ends. */
    struct fsn_monitor other;
    bool unsure;
};

enum { MOST_DATA = 2048 }; /**< of one EtherCAT frame, whose length has 11 bits */

/** Consecutive process data of one packet in the address space: one datagram, or several if a
 *  MainDevice splits its image into datagrams, which may split an FSoE frame. */
struct run {
    uint8_t command; /**< 0: none */
    uint32_t address;
    uint16_t size_bytes;
    bool any_answer;
    uint8_t data[MOST_DATA];
    bool answered[MOST_DATA]; /**< per byte: a SubDevice has answered its datagram */
};

struct fsn_scan {
    struct fsn_scan_counts counts;
    struct run run;
    uint64_t now_ns;
    uint64_t bus;                /**< of the packet */
    uint32_t pair_tries;         /**< left for this packet */
    uint32_t deferred[DEFERRED]; /**< candidates whose new frame waits for the end of the packet */
    uint32_t deferred_count;
    struct window windows[MAX_WINDOWS];
    uint32_t window_count;
    uint32_t next_window; /**< packets repeat: the window after the last one is the most likely */
    struct candidate *candidates;
    uint32_t candidate_count; /**< slots in use or used before */
    uint8_t *frames;          /**< memory of all candidates; only used pages are allocated */
    uint32_t free_candidate;  /**< first slot used before, plus 1; 0: none */
    struct found *found;
    uint32_t found_count;
    struct fsn_sighting *queue;
    uint32_t queue_head, queue_count, queue_slots;
};

/** Processes the process data of a run; data without an answer keep their last value. */
void scan_process_data(struct fsn_scan *scan, struct run *run);

/** Follows the frames that waited for the end of the packet. */
void scan_end_of_packet(struct fsn_scan *scan);

/** The frame that a candidate showed `back` frames ago; 0 is the last one. */
const struct shown *scan_shown(const struct candidate *candidate, uint32_t back);

/** Number of frames that a candidate remembers. */
uint32_t scan_remembered(const struct candidate *candidate);

/** A place no longer shows the frames of its connection: it, or the whole connection, is released
 *  so that it can be found again. */
void scan_release(struct fsn_scan *scan, uint32_t candidate);

/** Whether a place has recently shown a frame. */
bool scan_has_shown(const struct candidate *candidate, const uint8_t *frame);

/** The place whose frames a copy repeats; NULL: none. */
const struct candidate *scan_original(const struct fsn_scan *scan, const struct candidate *copy);

/** Follows the last frame of a candidate that belongs to a connection, now or at the end of the
 *  packet. */
void scan_follow(struct fsn_scan *scan, uint32_t candidate);

/** Searches for the other end of a candidate that has shown a new frame. When it is found, both
 *  become a connection, and their frames so far are followed. */
void scan_pair(struct fsn_scan *scan, uint32_t candidate);

#endif
