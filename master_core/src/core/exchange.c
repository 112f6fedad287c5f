#include "core/exchange.h"

#include <stdlib.h>

#include "plan/plan_internal.h"
#include "rt/prefault.h"

/** Lists the sync managers of one direction that have a place. */
static uint32_t list_spans(const struct fsn_plan *part, const struct fsn_bus_layout *layout,
                           uint8_t direction, struct fsn_exchange_span *spans) {
    uint32_t count = 0;
    for (uint32_t sm = 0; sm < fsn_plan_sm_count(part); sm++) {
        const struct fsn_sm_info info = fsn_known_sm(part, sm);
        if (layout->sm_base[sm] != FSN_NONE && info.direction == direction) {
            spans[count++] = (struct fsn_exchange_span){layout->sm_base[sm], info.size_bytes};
        }
    }
    return count;
}

/** Divides the memory between the sets. */
static void place_sets(struct fsn_exchange *x, size_t wkc_bytes, size_t stride) {
    for (size_t i = 0; i < FSN_TRIPLE_SETS; i++) {
        uint8_t *at = x->room + i * stride;
        x->brought[i].wkc = (struct fsn_wkc *)(void *)at;
        x->brought[i].image = at + wkc_bytes;
        x->given[i] = x->brought[i].image + x->image_bytes;
        x->brought[i].sm_stale = x->given[i] + x->image_bytes;
    }
    fsn_triple_init(&x->up);
    fsn_triple_init(&x->down);
}

fsn_status fsn_exchange_create(const struct fsn_plan *part, const struct fsn_bus_layout *layout,
                               struct fsn_exchange *exchange) {
    const uint32_t sms = fsn_plan_sm_count(part);
    const size_t wkc_bytes = layout->datagram_count * sizeof(struct fsn_wkc);
    const size_t set_bytes = wkc_bytes + 2 * (size_t)layout->image_bytes + sms;
    const size_t stride = (set_bytes + 63) / 64 * 64; /* no two sets in one cache line */
    struct fsn_exchange_span *spans = fsn_calloc_prefaulted((size_t)sms + 1, sizeof *spans);
    uint8_t *room = fsn_calloc_prefaulted(FSN_TRIPLE_SETS, stride);
    *exchange = (struct fsn_exchange){0};
    if (spans == NULL || room == NULL) {
        free(spans);
        free(room);
        return FSN_E_NOMEM;
    }
    exchange->image = layout->image;
    exchange->image_bytes = layout->image_bytes;
    exchange->datagram_count = layout->datagram_count;
    exchange->sm_count = sms;
    exchange->inputs = spans;
    exchange->input_count = list_spans(part, layout, FSN_INPUT, spans);
    exchange->outputs = spans + exchange->input_count;
    exchange->output_count = list_spans(part, layout, FSN_OUTPUT, spans + exchange->input_count);
    exchange->room = room;
    place_sets(exchange, wkc_bytes, stride);
    return FSN_OK;
}

void fsn_exchange_free(struct fsn_exchange *exchange) {
    free((void *)exchange->inputs);
    free(exchange->room);
    *exchange = (struct fsn_exchange){0};
}
