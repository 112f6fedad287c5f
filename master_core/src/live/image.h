/** Positions of the sync managers of a plan in a process image laid out by this library. */
#ifndef FSN_IMAGE_H
#define FSN_IMAGE_H

#include "fsn/bus.h"
#include "plan/plan_internal.h"

/** Arrays have one element more than the plan has sync managers. */
struct fsn_image {
    uint32_t *sm_base;        /**< FSN_NONE without a place */
    uint32_t *sm_datagram;    /**< datagram that carries it */
    uint32_t *datagram_begin; /**< first byte of each datagram */
    uint32_t *expected;       /**< working counter of each datagram if all answer */
    uint32_t datagram_count, bytes;
};

/** Uses the order of IgH: SubDevices as added; for each SubDevice first outputs, then inputs. A
 *  datagram ends where the next sync manager would not fit.
 *  @retval FSN_E_NOMEM      out of memory.
 *  @retval FSN_E_BUS_IMAGE  a sync manager alone is longer than `datagram_bytes`.
 *  After a refusal everything is free again. */
fsn_status fsn_image_create(const struct fsn_plan *plan, uint32_t datagram_bytes,
                            struct fsn_image *image);

/** Layout of an image at `bytes`, in the form that a bus reports to the core. */
struct fsn_bus_layout fsn_image_layout(const struct fsn_image *image, uint8_t *bytes);

/** Frees the arrays; also those of an image that is all zeros. */
void fsn_image_free(struct fsn_image *image);

/** Share of a sync manager in the working counter of its datagram: each SubDevice counts once per
 *  direction and datagram, 2 for outputs and 1 for inputs, as in LRW. The SMs of one SubDevice are
 *  checked one after another. Returns 0 if an earlier one has already counted. */
uint32_t fsn_image_wkc(const struct fsn_plan *plan, const struct fsn_image *image, uint32_t sm);

#endif
