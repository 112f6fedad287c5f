/** Data of the control thread about plan, program and bus: the source of all documents. */
#ifndef FSN_CONTROL_BUS_VIEW_H
#define FSN_CONTROL_BUS_VIEW_H

#include "control/base/host.h"
#include "control/outputs/outputs.h"
#include "fsn/core.h"

/** One cycle read from the recorder. */
struct fsn_recorded {
    uint64_t cycle; /**< 0: none */
    struct fsn_cycle record;
    struct fsn_wkc *wkc; /**< room for one per datagram */
    uint8_t *image;
};

struct fsn_bus_view {
    const struct fsn_plan *plan;
    const struct fsn_control_host *host;
    struct fsn_outputs *outputs;
    struct fsn_core *core; /**< NULL: none */
    char sha256[2 * FSN_SHA256_BYTES + 1];
    struct fsn_fingerprint fingerprint; /**< of the loaded plan */
    struct fsn_statistics statistics;   /**< room for snapshots, with the next two members */
    struct fsn_connection_status *connections;
    uint8_t *image;
    struct fsn_recorded recorded;
    struct fsn_bus_subdevice *subdevice; /**< last state of each SubDevice of the plan */
    bool subdevices_known;               /**< they were read at least once */
};

/** @return false  out of memory; to be freed in any case. `plan` and `host` must outlive it. */
bool fsn_bus_view_init(struct fsn_bus_view *view, const struct fsn_plan *plan,
                       const struct fsn_control_host *host);
void fsn_bus_view_free(struct fsn_bus_view *view);

/** There is another core, or none (NULL). */
void fsn_bus_view_attach(struct fsn_bus_view *view, struct fsn_core *core);

/** Current data that the program reports about itself. */
struct fsn_control_status fsn_program_status(const struct fsn_control_host *host);

#endif
