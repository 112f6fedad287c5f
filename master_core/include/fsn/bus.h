/** The seam to a MainDevice: who owns the process image and moves it over the wire. */
#ifndef FSN_BUS_H
#define FSN_BUS_H

#include <stddef.h>
#include <stdint.h>

#include "fsn/plan.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What a bus tells the core once, at activation. Arrays belong to the bus and must stay valid. */
struct fsn_bus_layout {
    uint8_t *image;              /**< process image, inputs and outputs; zeroed by the core */
    uint32_t image_bytes;        /**< its length */
    const uint32_t *sm_base;     /**< per sync manager of the plan: byte in the image, or FSN_NONE */
    const uint32_t *sm_datagram; /**< per sync manager: datagram that carries it */
    uint32_t datagram_count;     /**< number of datagrams, at least 1 */
};

/** What a bus tells the core in every cycle. The core clears it before each receive. */
struct fsn_bus_input {
    uint32_t expected_wkc; /**< sum over all datagrams */
    uint32_t actual_wkc;   /**< sum over all datagrams; lower when a SubDevice is missing */
    uint32_t bad_datagrams; /**< datagrams whose working counter is incomplete or that were lost */
};

/** A backend. `bus` is its own context.
 *
 *  Freshness: receive() leaves the input bytes of a SubDevice that did not answer as they were,
 *  whole; it never zeroes them, never writes half of them and never writes outputs. */
struct fsn_bus_ops {
    const char *name;
    /** Fills the layout. Set-up thread; may allocate. */
    fsn_status (*open)(void *bus, const struct fsn_plan *plan, struct fsn_bus_layout *layout);
    /** Brings the inputs of this cycle into the image. Cyclic thread; RT-safe. */
    void (*receive)(void *bus, struct fsn_bus_input *input);
    /** Sends the outputs of the image. Cyclic thread; RT-safe. */
    void (*send)(void *bus);
    /** Called once when the core is freed; may be NULL. Set-up thread. */
    void (*close)(void *bus);
};

#ifdef __cplusplus
}
#endif

#endif
