/** The cyclic frames of a live bus on sockets of their own.
 *
 *  Each frame carries a NOP datagram that no SubDevice touches, with the number of its cycle: a
 *  reply is accepted only in its own cycle, however long the segment or this process was stopped.
 *  Then one LRW datagram, whose input bytes are sent as in the image: without an answer of the
 *  SubDevice they come back unchanged. One frame may also carry the DC time.
 *
 *  With two sockets the same frame enters the ring at both ends. On a closed ring only the first is
 *  processed; on a broken one, each visits the SubDevices on its side.
 *
 *  Built by fsn_frames_create(); then only the cyclic thread accesses it, except for its
 *  atomics. */
#ifndef FSN_WIRE_H
#define FSN_WIRE_H

#include <stdbool.h>
#include <stdint.h>

#include "fsn/bus.h"
#include "rt/atomics.h"
#include "rt/rings.h"

enum {
    FSN_WIRE_PORTS = 2,
    FSN_WIRE_FIRST_INDEX = 0x80, /**< below: frames of the acyclic side */
    FSN_WIRE_FRAMES = 0x40,      /**< most frames: their numbers share the index with the port */
    FSN_WIRE_MARK_BYTES = 8,     /**< data of the NOP datagram: this run, the cycle */
    /* Positions in a frame. */
    FSN_WIRE_NOP = 16,
    FSN_WIRE_MARK = FSN_WIRE_NOP + 10,
    FSN_WIRE_LRW = FSN_WIRE_MARK + FSN_WIRE_MARK_BYTES + 2,
    FSN_WIRE_DATA = FSN_WIRE_LRW + 10,
    FSN_WIRE_MOST = 1514,      /**< longest Ethernet frame, without its check sequence */
    FSN_WIRE_LRW_BYTES = 1466, /**< longest process data of one frame */
};

/** An input sync manager inside a frame. */
struct fsn_wire_input {
    uint32_t sm, subdevice;
    uint32_t group; /**< group of its SubDevice; FSN_NONE: it is always present */
    uint32_t image_byte, frame_byte, size_bytes;
};

/** Whether a group of SubDevices that may be absent takes part. */
enum { FSN_WIRE_ABSENT, FSN_WIRE_COMING, FSN_WIRE_THERE };

struct fsn_wire_group {
    uint32_t *wkc; /**< per datagram: its share of the working counter */
    /** Written by the acyclic side. A group that is arriving may answer in any part. */
    _Atomic uint8_t there;
    uint32_t missed; /**< consecutive frames that returned without it while it was present */
};

struct fsn_wire_frame {
    uint8_t *sent;                  /**< as sent on the first port */
    uint8_t *reply[FSN_WIRE_PORTS]; /**< by the port where the frame was sent */
    bool back[FSN_WIRE_PORTS];      /**< `reply` belongs to this cycle */
    uint32_t len_bytes;
    uint32_t image_byte, size_bytes; /**< data of its LRW; from the image if it carries any */
    uint32_t expected;               /**< working counter of the LRW */
    uint32_t dc;                     /**< start of the DC datagram; 0: none in this frame */
    uint32_t dc_set; /**< start of the datagram that sets the reference clock; or 0 */
    uint32_t first_input, input_count;
};

struct fsn_wire {
    int sockets[FSN_WIRE_PORTS]; /**< non-blocking use; the second is -1 without redundancy */
    struct fsn_rings *rings[FSN_WIRE_PORTS]; /**< of an AF_XDP socket; NULL: a packet socket */
    uint8_t *image;
    struct fsn_wire_frame *frames;
    uint32_t frame_count, datagram_count; /**< frames beyond the datagrams carry no process data */
    struct fsn_wire_input *inputs;
    /** Per SubDevice: 1 while it exchanges process data, according to the acyclic side. */
    _Atomic uint8_t *answers;
    struct fsn_wire_group *groups;
    uint32_t group_count;
    /** Number of frames that may return without a group before it is an error: by then the acyclic
     *  side has detected whether the group has left. */
    uint32_t group_patience;
    uint32_t run;   /**< marks the frames of this run */
    uint32_t cycle; /**< number of the last frames sent; 0: none yet */
    uint32_t dc_every, dc_left;
    _Atomic uint16_t dc_station; /**< station address of the DC reference clock */
    bool dc_host;                /**< this machine sets it: `dc_base` stays unchanged */
    /** The DC time is CLOCK_MONOTONIC plus this. It is sent in the datagram: if the reference clock
     *  is lost, or not reached because of a gap in the ring, all others follow this time. */
    _Atomic uint64_t dc_base;
    uint64_t dc_sent_ns;      /**< of the last send with a DC time, CLOCK_MONOTONIC */
    _Atomic uint64_t dc_seen; /**< last reading of the reference clock; 0: never */
    uint64_t wait_ns;         /**< how long to wait for replies */
    /** Time of the last send: CLOCK_MONOTONIC if replies are waited for, otherwise CLOCK_REALTIME,
     *  the clock of kernel timestamps. */
    uint64_t sent_ns;
    /** Frames of another MainDevice; the acyclic side counts them, because this side never receives
     *  them. */
    _Atomic uint64_t foreign;
    uint64_t foreign_reported; /**< number of these already reported */
    uint32_t unsent;           /**< frames of the last send that the system rejected */
    int send_errno;            /**< errno of the last rejection */
    /** Written by this thread only, read by the supervision of the two directions of a ring: cycles
     *  sent, and returned frames, including late ones, by the port where they were sent and the one
     *  where they arrived. */
    _Atomic uint32_t sent, came[FSN_WIRE_PORTS][FSN_WIRE_PORTS];
};

/** Takes the replies to the last frames, drops older ones, and copies inputs into the image. */
void fsn_wire_receive(struct fsn_wire *wire, struct fsn_bus_input *input);

/** Sends the image in the frames of the next cycle. */
void fsn_wire_send(struct fsn_wire *wire);

#endif
