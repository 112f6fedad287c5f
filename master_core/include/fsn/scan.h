/** Finds FSoE connections in captured EtherCAT frames and follows them.
 *
 *  No description of the network is needed. A place in the process data counts as one end of a
 *  connection if its first byte is always a command, its last two bytes are one ConnID, and its
 *  CRCs form one chain with those of another place with the same ConnID. */
#ifndef FSN_SCAN_H
#define FSN_SCAN_H

#include "fsn/monitor.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fsn_scan;

enum { FSN_SCAN_PLACES = 8 }; /**< places remembered per connection */

/** Source of the knowledge which end of a connection is the MainInstance. */
enum fsn_scan_roles {
    FSN_ROLES_BY_NUMBERS = 0, /**< from the sequence numbers; wrong after enough collisions */
    FSN_ROLES_BY_START = 1    /**< its first Session frame was seen */
};

/** Position of the frames of one direction. */
struct fsn_scan_place {
    uint32_t address;    /**< logical address, or station address and offset, of the first byte */
    uint8_t command;     /**< EtherCAT command of the datagram */
    uint8_t way;         /**< enum fsn_way */
    uint16_t size_bytes; /**< length of the frame */
};

/** A connection that was found. */
struct fsn_scan_connection {
    struct fsn_connection_status status;
    struct fsn_scan_place places[FSN_SCAN_PLACES]; /**< [0] and [1] are followed by the monitor */
    uint32_t place_count;
    uint16_t connection_id;
    uint8_t roles; /**< enum fsn_scan_roles */
};

/** One new frame of a connection. */
struct fsn_sighting {
    uint64_t time_ns; /**< as given with the packet */
    uint64_t packet;  /**< number of the packet, from 1 */
    uint32_t connection;
    uint16_t sequence; /**< number of this frame in its chain; 0 when not known */
    uint16_t size_bytes;
    uint8_t way;      /**< enum fsn_way */
    uint8_t verdict;  /**< enum fsn_verdict */
    uint8_t observed; /**< enum fsn_observed, after this frame */
    uint8_t frame[FSN_MAX_FRAME_BYTES];
};

/** Counters of all other observations. */
struct fsn_scan_counts {
    uint64_t packets;    /**< passed to the scanner */
    uint64_t ethercat;   /**< of these, EtherCAT frames */
    uint64_t malformed;  /**< of these, invalid EtherCAT frames */
    uint64_t datagrams;  /**< process data datagrams that a SubDevice has answered */
    uint64_t unanswered; /**< process data datagrams with working counter 0 */
    uint64_t dropped;    /**< datagrams or places that were skipped because tables were full */
};

/** Creates a scanner; fsn_scan_free() frees it, and accepts NULL. Context: set-up. Allocates, at
 *  most about 60 MB however long the capture is. */
FSN_API FSN_MUST_USE fsn_status fsn_scan_create(struct fsn_scan **scan);
/** Frees a scanner. Context: set-up. */
FSN_API void fsn_scan_free(struct fsn_scan *scan);

/** Processes one captured Ethernet frame: EtherCAT (0x88A4, with VLAN tag or not) or EtherCAT in
 *  UDP. Datagrams with working counter 0 are skipped: on their way out the inputs are old.
 *  @param[in] bus      number of the bus, if the capture contains several: the same logical address
 *                      is another place there. The source address distinguishes buses as well.
 *  @param[in] time_ns  when it was captured, nanoseconds, never decreasing. Returns the number of
 *  waiting sightings. Context: one thread. Allocates. */
FSN_API uint32_t fsn_scan_packet(struct fsn_scan *scan, uint32_t bus, const uint8_t *bytes,
                                 size_t len_bytes, uint64_t time_ns);

/** Takes the oldest sighting; false if there is none. The first frames of a connection are returned
 *  when it is found, a few frames late. Context: one thread. */
FSN_API bool fsn_scan_next(struct fsn_scan *scan, struct fsn_sighting *sighting);

/** Connections found so far. Context: one thread. */
FSN_API uint32_t fsn_scan_connection_count(const struct fsn_scan *scan);
/** One connection; FSN_E_ARG for an unknown number. Context: one thread. */
FSN_API FSN_MUST_USE fsn_status fsn_scan_connection(const struct fsn_scan *scan, uint32_t number,
                                                    struct fsn_scan_connection *connection);
/** All counters so far. Context: one thread. */
FSN_API void fsn_scan_counts(const struct fsn_scan *scan, struct fsn_scan_counts *counts);

#ifdef __cplusplus
}
#endif

#endif
