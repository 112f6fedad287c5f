/** Process data between the cycle of a bus and the first bus's cycle, in any order: each side finds
 *  the newest complete image of the other, or the previous one. Neither waits. */
#ifndef FSN_EXCHANGE_H
#define FSN_EXCHANGE_H

#include "fsn/bus.h"
#include "rt/triple.h"

/** Bytes of a sync manager in the image of its bus. */
struct fsn_exchange_span {
    uint32_t byte, size_bytes;
};

/** One whole set of data from a bus. */
struct fsn_exchange_inputs {
    uint8_t *image;
    struct fsn_wkc *wkc;
    uint8_t *sm_stale;
    struct fsn_frame_counts totals; /**< since the bus was opened */
    int send_errno;
};

struct fsn_exchange {
    uint8_t *image; /**< of the bus */
    uint32_t image_bytes, datagram_count, sm_count;
    const struct fsn_exchange_span *inputs, *outputs; /**< one block, inputs first */
    uint8_t *room;                                    /**< memory of the sets below */
    uint32_t input_count, output_count;
    struct fsn_triple up, down;
    struct fsn_exchange_inputs brought[FSN_TRIPLE_SETS];
    uint8_t *given[FSN_TRIPLE_SETS]; /**< images that contain the outputs */
    struct fsn_frame_counts counted; /**< of the bus's own cycle */
    struct fsn_frame_counts known;   /**< of the leading cycle */
};

/** Cycle of the bus, after its receive(): publishes its inputs and fetches the outputs. */
void fsn_exchange_in_bus(struct fsn_exchange *exchange, const struct fsn_bus_input *input);

/** Leading cycle: takes the inputs.
 *  @param[out] image  of this bus inside the leading one.
 *  @param[out] input  its `wkc` and `sm_stale` are those of this bus; counters are added. */
void fsn_exchange_receive(struct fsn_exchange *exchange, uint8_t *image,
                          struct fsn_bus_input *input);

/** Leading cycle: publishes the outputs. */
void fsn_exchange_send(struct fsn_exchange *exchange, const uint8_t *image);

/** Copies some sync managers from one image to another. */
void fsn_exchange_copy(uint8_t *to, const uint8_t *from, const struct fsn_exchange_span *spans,
                       uint32_t count);

#endif
