/** The seam to a MainDevice: who owns the process image and moves it over the wire. */
#ifndef FSN_BUS_H
#define FSN_BUS_H

#include <stddef.h>
#include <stdint.h>

#include "fsn/plan.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What a bus tells the core once, at activation. Arrays belong to the bus and must stay valid
 *  and unchanged until close(). */
struct fsn_bus_layout {
    uint8_t *image;          /**< process image, inputs and outputs; zeroed by the core */
    uint32_t image_bytes;    /**< its length */
    const uint32_t *sm_base; /**< per sync manager of the plan: byte in the image, or FSN_NONE */
    /** First byte of each datagram in the image, rising, the first one 0. A datagram ends where the
     *  next begins, the last one at image_bytes. */
    const uint32_t *datagram_begin;
    uint32_t datagram_count; /**< number of datagrams, at least 1 */
};

/** Working counter of one datagram in one cycle. */
struct fsn_wkc {
    uint32_t expected; /**< when every SubDevice answers */
    uint32_t actual;   /**< what came back; 0 for a lost datagram */
};

/** What a bus tells the core in every cycle. The arrays belong to the core, which clears them
 *  before each receive(). */
struct fsn_bus_input {
    struct fsn_wkc *wkc; /**< one per datagram; to be filled */
    /** One per sync manager: set to 1 where an input holds the bytes of an earlier cycle. Leave it
     *  0 where the mapping does not allow to know; the working counter then tells it alone. */
    uint8_t *sm_stale;
};

/** A backend. `bus` is its own context.
 *
 *  Freshness: receive() leaves the input bytes of a SubDevice that did not answer as they were,
 *  whole; it never zeroes them, never writes half of them and never writes outputs. */
struct fsn_bus_ops {
    const char *name;
    /** Fills the layout. Any status but FSN_OK refuses the activation. Set-up thread; may allocate.
     */
    fsn_status (*open)(void *bus, const struct fsn_plan *plan, struct fsn_bus_layout *layout);
    /** Brings the inputs of this cycle into the image. Cyclic thread; RT-safe. */
    void (*receive)(void *bus, struct fsn_bus_input *input);
    /** Sends the outputs of the image. Cyclic thread; RT-safe. */
    void (*send)(void *bus);
    /** Called once per successful open(), when the core is freed; may be NULL. Set-up thread. */
    void (*close)(void *bus);
};

#ifdef __cplusplus
}
#endif

#endif
