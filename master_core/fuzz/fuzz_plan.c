/** Fuzz target: any bytes as a plan; what loads must also run. Fits libFuzzer and driver.c.
 *
 *  Length and CRC guard the rest of the loader so well that no mutation would pass them, so a plan
 *  that is refused for its CRC gets a right one and a second try. */
#include "fuzz.h"

#include <stdlib.h>
#include <string.h>

uint64_t fuzz_reached;

static void run(const struct fsn_plan *plan) {
    struct fsn_fingerprint made;
    CHECK(fsn_plan_fingerprint(plan, &made) == FSN_OK);
    struct fsn_emulated *bus;
    struct fsn_core *core;
    CHECK(fsn_emulated_create(plan, &bus) == FSN_OK);
    /* The emulated bus keeps every promise of the seam, so what the loader let through must run. */
    CHECK(fsn_core_create(plan, fsn_emulated_ops(), bus, &core, NULL) == FSN_OK);
    for (uint32_t symbol = 0; symbol < fsn_plan_symbol_count(plan); symbol++) {
        const fsn_status status = fsn_core_set_output(core, symbol, UINT64_MAX);
        CHECK(status == FSN_OK || status == FSN_E_CLOSED || status == FSN_E_ARG);
    }
    for (uint64_t now = 1; now < 4; now++) {
        CHECK(fsn_core_cycle(core, now) == FSN_OK);
    }
    fuzz_reached++;
    fsn_core_free(core);
    fsn_emulated_free(bus);
}

static fsn_status try_plan(const uint8_t *data, size_t size) {
    struct fsn_plan *plan;
    struct fsn_fault fault;
    const fsn_status status = fsn_plan_load(data, size, &plan, &fault);
    CHECK((status == FSN_OK) == (plan != NULL));
    if (status != FSN_OK) {
        CHECK(fault.status == status && fault.rule != NULL);
        CHECK(fault.byte <= size && fsn_section_name(fault.section)[0] != '?');
        return status;
    }
    run(plan);
    fsn_plan_free(plan);
    return FSN_OK;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    const fsn_status status = try_plan(data, size);
    if (size >= 32 && (status == FSN_E_PLAN_CRC || status == FSN_E_PLAN_LENGTH)) {
        uint8_t *corrected =
            malloc(size); /* exactly as long, so that ASan sees a reach beyond it */
        CHECK(corrected != NULL);
        memcpy(corrected, data, size);
        for (int i = 0; i < 4; i++) {
            corrected[12 + i] = (uint8_t)(size >> (8 * i));
        }
        build_fix_crc(corrected, size);
        (void)try_plan(corrected, size);
        free(corrected);
    }
    return 0;
}
