#include "control/reports/bus_view.h"

#include <string.h>

#include "control/base/words.h"
#include "plan/try.h"

struct fsn_control_status fsn_program_status(const struct fsn_control_host *host) {
    struct fsn_control_status status = {0};
    host->status(host->self, &status);
    return status;
}

bool fsn_bus_view_init(struct fsn_bus_view *view, const struct fsn_plan *plan,
                       const struct fsn_control_host *host) {
    view->plan = plan;
    view->host = host;
    uint8_t digest[FSN_SHA256_BYTES];
    fsn_plan_sha256(plan, digest);
    fsn_hex_text(digest, sizeof digest, view->sha256);
    view->outputs = fsn_outputs_create(plan);
    return fsn_plan_fingerprint(plan, &view->fingerprint) == FSN_OK && view->outputs != NULL &&
           FSN_NEW(view->connections, fsn_plan_connection_count(plan)) &&
           FSN_NEW(view->subdevice, fsn_plan_subdevice_count(plan));
}

static void free_images(struct fsn_bus_view *view) {
    free(view->image);
    free(view->recorded.image);
    free(view->recorded.wkc);
    view->image = NULL;
    view->recorded = (struct fsn_recorded){0};
}

void fsn_bus_view_free(struct fsn_bus_view *view) {
    fsn_outputs_free(view->outputs);
    free(view->connections);
    free(view->subdevice);
    free_images(view);
}

/** Allocates memory for images of a core. */
static bool make_images(struct fsn_bus_view *view, const struct fsn_core *core) {
    return FSN_NEW(view->image, fsn_core_image_bytes(core)) &&
           FSN_NEW(view->recorded.image, fsn_core_image_bytes(core)) &&
           FSN_NEW(view->recorded.wkc, fsn_core_datagram_count(core));
}

void fsn_bus_view_attach(struct fsn_bus_view *view, struct fsn_core *core) {
    free_images(view);
    view->core = core;
    if (core != NULL && !make_images(view, core)) {
        view->core = NULL; /* then the bus counts as stopped */
    }
    fsn_outputs_attach(view->outputs, view->core);
    memset(view->subdevice, 0, fsn_plan_subdevice_count(view->plan) * sizeof *view->subdevice);
    view->subdevices_known = false;
}
