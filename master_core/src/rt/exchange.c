#include "rt/exchange.h"

#include <string.h>

#include "rt/frame_counts.h"

void fsn_exchange_copy(uint8_t *to, const uint8_t *from, const struct fsn_exchange_span *spans,
                       uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        memcpy(to + spans[i].byte, from + spans[i].byte, spans[i].size_bytes);
    }
}

void fsn_exchange_in_bus(struct fsn_exchange *exchange, const struct fsn_bus_input *input) {
    struct fsn_exchange_inputs *set = &exchange->brought[exchange->up.writer];
    fsn_add_counts(&exchange->counted, &input->counts, NULL);
    set->totals = exchange->counted;
    set->send_errno = input->send_errno;
    fsn_exchange_copy(set->image, exchange->image, exchange->inputs, exchange->input_count);
    memcpy(set->wkc, input->wkc, exchange->datagram_count * sizeof *set->wkc);
    memcpy(set->sm_stale, input->sm_stale, exchange->sm_count);
    fsn_triple_publish(&exchange->up);
    (void)fsn_triple_take(&exchange->down);
    fsn_exchange_copy(exchange->image, exchange->given[exchange->down.reader], exchange->outputs,
                      exchange->output_count);
}

void fsn_exchange_receive(struct fsn_exchange *exchange, uint8_t *image,
                          struct fsn_bus_input *input) {
    const bool fresh = fsn_triple_take(&exchange->up);
    const struct fsn_exchange_inputs *set = &exchange->brought[exchange->up.reader];
    /* Between two cycles of a slower bus its last cycle counts; its age is not an error. */
    memcpy(input->wkc, set->wkc, exchange->datagram_count * sizeof *set->wkc);
    if (!fresh) {
        return;
    }
    memcpy(input->sm_stale, set->sm_stale, exchange->sm_count);
    fsn_exchange_copy(image, set->image, exchange->inputs, exchange->input_count);
    /* Differences, so that sets that were never read are included. */
    fsn_add_counts(&input->counts, &set->totals, &exchange->known);
    input->send_errno = set->send_errno != 0 ? set->send_errno : input->send_errno;
    exchange->known = set->totals;
}

void fsn_exchange_send(struct fsn_exchange *exchange, const uint8_t *image) {
    fsn_exchange_copy(exchange->given[exchange->down.writer], image, exchange->outputs,
                      exchange->output_count);
    fsn_triple_publish(&exchange->down);
}
