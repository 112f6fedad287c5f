#include "emulated_rig.h"

struct emulated_rig emulated_rig_load(uint8_t *bytes, size_t len_bytes) {
    struct emulated_rig rig = {0};
    CHECK(fsn_plan_load(bytes, len_bytes, &rig.plan, NULL) == FSN_OK);
    free(bytes);
    CHECK(fsn_emulated_create(rig.plan, &rig.bus) == FSN_OK);
    CHECK(fsn_core_create(rig.plan, fsn_emulated_ops(), rig.bus, &rig.core, NULL) == FSN_OK);
    return rig;
}

struct emulated_rig emulated_rig_build(const struct build *build) {
    size_t len_bytes;
    uint8_t *bytes = build_plan(build, &len_bytes);
    return emulated_rig_load(bytes, len_bytes);
}

void emulated_rig_end(struct emulated_rig *rig) {
    fsn_core_free(rig->core);
    fsn_emulated_free(rig->bus);
    fsn_plan_free(rig->plan);
}

void emulated_rig_cycle(struct emulated_rig *rig) {
    rig->now_ns += 1000000;
    CHECK(fsn_core_cycle(rig->core, rig->now_ns) == FSN_OK);
}
