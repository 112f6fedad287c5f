/** The interface to a MainDevice, which owns the process image and moves it over the wire. */
#ifndef FSN_BUS_H
#define FSN_BUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fsn/plan.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Layout that a bus reports to the core once, at activation. Arrays belong to the bus and must
 *  stay valid and unchanged until close(). */
struct fsn_bus_layout {
    uint8_t *image;          /**< process image, inputs and outputs; zeroed by the core */
    uint32_t image_bytes;    /**< its length */
    const uint32_t *sm_base; /**< per sync manager of the plan: byte in the image, or FSN_NONE */
    /** First byte of each datagram in the image, ascending; the first one is 0. A datagram ends
     *  where the next begins, the last one at image_bytes. */
    const uint32_t *datagram_begin;
    uint32_t datagram_count; /**< number of datagrams, at least 1 */
    /** The bus sets its reference clock to CLOCK_MONOTONIC plus this, nanoseconds; 0: it does
     *  not. */
    uint64_t dc_base_ns;
};

/** Working counter of one datagram in one cycle. */
struct fsn_wkc {
    uint32_t expected; /**< if every SubDevice answers */
    uint32_t actual;   /**< received value; 0 for a lost datagram */
};

/** Frames that did not come back as they should. */
struct fsn_frame_counts {
    uint64_t lost_frames;    /**< that did not return in their cycle */
    uint64_t old_replies;    /**< replies to earlier frames, discarded */
    uint64_t foreign_frames; /**< of another MainDevice, if the bus receives them */
    uint64_t unsent_frames;  /**< that the system did not send */
};

/** Each field of fsn_frame_counts, whose name is also its key in replies. */
#define FSN_FRAME_COUNT_TABLE(X) X(lost_frames) X(old_replies) X(foreign_frames) X(unsent_frames)

/** Data that a bus reports to the core in every cycle. The arrays belong to the core, which clears
 *  them before each receive(). */
struct fsn_bus_input {
    struct fsn_wkc *wkc; /**< one per datagram; to be filled */
    /** One per sync manager: set to 1 if an input contains the bytes of an earlier cycle. Leave it
     *  0 if the mapping does not show this; then only the working counter does. */
    uint8_t *sm_stale;
    struct fsn_frame_counts counts; /**< since the last receive() */
    int send_errno;                 /**< errno of the last frame that was not sent; 0: none */
    uint64_t round_trip_ns;         /**< from send() to the last reply; 0 if unknown to the bus */
    uint64_t dc_time_ns;            /**< time of the DC reference clock in this reply; 0 if none */
};

/** AL states of EtherCAT SubDevices; the flag FSN_AL_ERROR may be added to a state. */
enum {
    FSN_AL_NONE = 0, /**< no answer */
    FSN_AL_INIT = 1,
    FSN_AL_PREOP = 2,
    FSN_AL_BOOT = 3,
    FSN_AL_SAFEOP = 4,
    FSN_AL_OP = 8,
    FSN_AL_ERROR = 0x10,
};

/** Device found at the position of a SubDevice of the plan: name, value, text. */
#define FSN_FOUND_TABLE(X)                                                                         \
    X(UNKNOWN, 0, "not looked at yet")                                                             \
    X(NOTHING, 1, "does not answer")                                                               \
    X(RIGHT, 2, "the SubDevice of the plan")                                                       \
    X(IDENTITY, 3, "another device")                                                               \
    X(MAPPING, 4, "other process data")                                                            \
    X(ADDRESS, 5, "another FSoE address")                                                          \
    X(SDO, 6, "refused a start-up SDO")                                                            \
    X(STATE, 7, "refused a state")                                                                 \
    X(CLOCK, 8, "its clock cannot be set")                                                         \
    X(ABSENT, 9, "absent, as it may be")                                                           \
    X(MAILBOX, 10, "does not answer an SDO")

enum fsn_found {
#define FSN_FOUND_ENUM(name, value, text) FSN_FOUND_##name = (value),
    FSN_FOUND_TABLE(FSN_FOUND_ENUM)
#undef FSN_FOUND_ENUM
};

/** Returns "another device" and the like for an enum fsn_found. Context: any thread. */
FSN_API const char *fsn_found_text(uint8_t found);

/** Returns the text of an AL status code, e.g. "sync manager watchdog" for 0x001B; never an empty
 *  text. Context: any thread. */
FSN_API const char *fsn_al_code_text(uint16_t code);

enum { FSN_PORTS = 4 };

/** Acyclic data of a bus about one SubDevice; as old as the last poll(). */
struct fsn_bus_subdevice {
    uint8_t al_status;             /**< AL status with its error flag; FSN_AL_NONE: no answer */
    uint8_t found;                 /**< enum fsn_found */
    uint16_t al_code;              /**< AL status code of the last error */
    uint32_t vendor_id;            /**< as read; with the next two 0 before the first read */
    uint32_t product_code;         /**< as read */
    uint32_t revision;             /**< as read */
    uint32_t returns;              /**< how often it returned to OP after a loss or another state */
    uint8_t link[FSN_PORTS];       /**< per port: 1 = a partner is connected and communicates */
    uint8_t link_lost[FSN_PORTS];  /**< lost links, 0x0310 */
    uint8_t rx_errors[FSN_PORTS];  /**< invalid frames, 0x0300 */
    uint16_t fsoe_address;         /**< as read, if it differs from the plan; 0: unknown */
    bool link_down;                /**< no answer, and the preceding link is down */
    char detail[FSN_DETAIL_BYTES]; /**< differences in words; may be empty */
};

/** Whether a ring, a bus between two interfaces of the MainDevice, is closed: name, value, text. */
#define FSN_RING_TABLE(X)                                                                          \
    X(UNKNOWN, 0, "unknown")                                                                       \
    X(CLOSED, 1, "closed")                                                                         \
    X(OPEN, 2, "open")                                                                             \
    X(ONE_WAY, 3, "one way")

enum fsn_ring {
#define FSN_RING_ENUM(name, value, text) FSN_RING_##name = (value),
    FSN_RING_TABLE(FSN_RING_ENUM)
#undef FSN_RING_ENUM
};

/** Returns "closed" and the like for an enum fsn_ring. Context: any thread. */
FSN_API const char *fsn_ring_text(uint8_t ring);

/** A ring at the last poll(). */
struct fsn_bus_ring {
    uint8_t state;   /**< enum fsn_ring; UNKNOWN before the first cycles */
    uint8_t ways[2]; /**< 1: frames that enter at the first (second) interface leave at the other */
    uint32_t breaks; /**< how often it was found open or one-way since the bus opened */
    /** First gaps of an open ring in words; empty if it is closed. */
    char place[FSN_DETAIL_BYTES];
};

/** Whether all clocks of a bus with distributed clocks show the same time: name, value, text. */
#define FSN_CLOCKS_TABLE(X)                                                                        \
    X(UNKNOWN, 0, "unknown")                                                                       \
    X(SYNCHRONOUS, 1, "synchronous")                                                               \
    X(APART, 2, "apart")                                                                           \
    X(LOST, 3, "no reference")

enum fsn_clocks {
#define FSN_CLOCKS_ENUM(name, value, text) FSN_CLOCKS_##name = (value),
    FSN_CLOCKS_TABLE(FSN_CLOCKS_ENUM)
#undef FSN_CLOCKS_ENUM
};

/** Returns "synchronous" and the like for an enum fsn_clocks. Context: any thread. */
FSN_API const char *fsn_clocks_text(uint8_t clocks);

/** Distributed clocks at the last poll(). Times in nanoseconds. */
struct fsn_bus_clocks {
    /** enum fsn_clocks. UNKNOWN: nothing to compare, for example before the first check. APART
     *  until all have stayed within half of the window for 3 s. LOST: no frame carries the time of
     *  the reference clock. */
    uint8_t state;
    bool host;           /**< this machine sets the reference clock; false: the cycle follows it */
    uint32_t subdevices; /**< checked ones of the plan: in SAFEOP or OP, without the reference */
    uint32_t outside;    /**< of these, those further from the reference clock than the window */
    uint32_t leaves;     /**< how often they were found apart since the bus opened */
    uint32_t window_ns;  /**< largest permitted difference from the reference clock */
    uint32_t worst_ns;   /**< largest difference found */
    uint32_t shift_ns;   /**< required lead of frames at the reference clock before SYNC0 */
    uint32_t lead_ns;    /**< actual lead of the last frame */
    char reference[64];  /**< SubDevice with the reference clock; empty before the start */
    /** The clock that is apart, or no longer the reference, in words; otherwise empty. */
    char place[FSN_DETAIL_BYTES];
};

struct fsn_bus_acyclic;
struct fsn_statistics;

enum { FSN_HELD = 8 };

/** A bus in OP, as passed from one process to the next; see fsn_live_options.attach. */
struct fsn_bus_attachment {
    const void *bytes; /**< SubDevice data of the backend; valid for the same backend only */
    size_t len_bytes;
    int lock; /**< descriptor that locks the interface */
    /** Descriptors to keep open until the first cycle of the successor. Closing the last one of a
     *  raw socket takes the kernel 10 ms, which would delay the end of the predecessor.
     */
    int held[FSN_HELD];
    size_t held_count;
};

/** A backend. `bus` is its own context.
 *
 *  Freshness: receive() leaves the input bytes of a SubDevice that did not answer unchanged. It
 *  never clears them, never writes a part of them and never writes outputs. From one receive() to
 *  the next only the core writes the image, and it reads the image after send(). */
struct fsn_bus_ops {
    const char *name;
    /** Fills the layout. A live bus has found and checked its SubDevices by then, and they are in
     *  PREOP or higher. Any status except FSN_OK rejects the activation; `fault`, never NULL, may
     *  then be filled with details. Set-up thread; may allocate and take seconds. */
    fsn_status (*open)(void *bus, const struct fsn_plan *plan, struct fsn_bus_layout *layout,
                       struct fsn_fault *fault);
    /** Copies the inputs of this cycle into the image. Cyclic thread; RT-safe. */
    void (*receive)(void *bus, struct fsn_bus_input *input);
    /** Sends the outputs of the image. Cyclic thread; RT-safe. */
    void (*send)(void *bus);
    /** Called once per successful open(), when the core is freed; may be NULL. Set-up thread. */
    void (*close)(void *bus);
    /** One step of the acyclic work next to the running cycle: brings every SubDevice towards an AL
     *  state, detects lost ones and recovers those that return. Must be called repeatedly from one
     *  thread other than the cyclic one. A step may take as long as an SDO. Returns whether every
     *  SubDevice of the plan is in that state. A SubDevice that does not answer is not in OP, and
     *  has left it. Groups may be absent. NULL: a bus without states. */
    bool (*poll)(void *bus, uint8_t al_state, uint64_t now_ns);
    /** Acyclic data of a SubDevice of the plan; any thread except the cyclic one. With poll(). */
    fsn_status (*state)(void *bus, uint32_t subdevice, struct fsn_bus_subdevice *seen);
    /** Whether the ring is closed; any thread except the cyclic one. Returns false without a second
     *  interface. With poll(); NULL: never a ring. */
    bool (*ring)(void *bus, struct fsn_bus_ring *ring);
    /** The distributed clocks; any thread except a cyclic one. Returns false if none are in use.
     *  With poll(); NULL: never. */
    bool (*clocks)(void *bus, struct fsn_bus_clocks *clocks);
    /** Acyclic objects, SII and registers, see fsn/acyclic.h; NULL: none. */
    const struct fsn_bus_acyclic *acyclic;
    /** Describes the bus for its successor process. Context: that of poll(), which must not run
     *  until that process has attached.
     *  @param[out] attachment  belongs to the bus, and is valid until the next call.
     *  NULL: this bus cannot be handed over. */
    fsn_status (*describe)(void *bus, struct fsn_bus_attachment *attachment);
    /** Discards the cyclic frames that arrived while another process drove the bus. Set-up; before
     *  the first cycle of a bus that was attached to. With describe(). */
    void (*discard)(void *bus);
    /** Counters of one of several buses, by its number in the plan. For the first, whose cycle is
     *  that of the core, only counters that differ from those of the core are overwritten. Any
     *  thread except a cyclic one. NULL: there is only one bus. */
    fsn_status (*statistics)(void *bus, uint32_t number, struct fsn_statistics *statistics);
};

#ifdef __cplusplus
}
#endif

#endif
