/** Memory that runs out: whichever allocation fails, the call reports it, leaks nothing, and the
 *  next one works. */
/* shows R7 */
#include <string.h>

#include "control_host.h"
#include "emulated_rig.h"
#include "fsn/segment.h"
#include "heap.h"
#include "live/frames.h"
#include "live/image.h"

static struct emulated_rig on;
static uint8_t *plan_bytes;
static size_t plan_len;
static struct fsn_control_host host;

static fsn_status load(void) {
    struct fsn_plan *plan = (void *)&on;
    struct fsn_fault fault;
    const fsn_status status = fsn_plan_load(plan_bytes, plan_len, &plan, &fault);
    CHECK(status == FSN_OK || (plan == NULL && fault.status == status));
    fsn_plan_free(plan);
    return status;
}

static fsn_status fingerprint(void) {
    struct fsn_fingerprint made;
    return fsn_plan_fingerprint(on.plan, &made);
}

static fsn_status emulated(void) {
    struct fsn_emulated *bus = NULL;
    const fsn_status status = fsn_emulated_create(on.plan, &bus);
    CHECK((status == FSN_OK) == (bus != NULL));
    fsn_emulated_free(bus);
    return status;
}

static fsn_status core(void) {
    struct fsn_core *made = (void *)&on;
    struct fsn_fault fault;
    const fsn_status status = fsn_core_create(on.plan, fsn_emulated_ops(), on.bus, &made, &fault);
    CHECK(status == FSN_OK || (made == NULL && fault.status == status));
    fsn_core_free(made);
    return status;
}

static fsn_status recorder(void) {
    const fsn_status status = fsn_core_keep(on.core, 1000000000, 1 << 20);
    CHECK((fsn_core_kept_cycles(on.core) > 0) == (status == FSN_OK));
    CHECK(fsn_core_keep(on.core, 0, 0) == FSN_OK);
    return status;
}

static fsn_status frames(void) {
    struct fsn_frames made;
    const fsn_status status = fsn_frames_create(on.plan, 0x1001, true, &made);
    fsn_frames_free(&made);
    return status;
}

static fsn_status segment(void) {
    struct fsn_segment *made = NULL;
    const fsn_status status = fsn_segment_create(on.plan, &made);
    CHECK((status == FSN_OK) == (made != NULL));
    fsn_segment_free(made);
    return status;
}

/** An object without memory leaves the others unchanged, and may be set again. */
static fsn_status object(void) {
    static const uint8_t bytes[1024];
    const long after = heap.fails_in;
    struct fsn_segment *made = NULL;
    heap.fails_in = 0;
    CHECK(fsn_segment_create(on.plan, &made) == FSN_OK);
    heap.fails_in = after;
    const fsn_status status = fsn_segment_set_object(made, 0, 0x2000, 1, bytes, sizeof bytes);
    const long left = heap.fails_in;
    heap.fails_in = 0;
    CHECK(fsn_segment_set_object(made, 0, 0x2001, 1, bytes, sizeof bytes) == FSN_OK);
    CHECK(fsn_segment_set_object(made, 0, 0x2000, 1, bytes, sizeof bytes) == FSN_OK);
    fsn_segment_free(made);
    heap.fails_in = left;
    return status == FSN_E_ARG ? FSN_E_NOMEM : status;
}

static fsn_status outputs(void) {
    struct fsn_outputs *made = fsn_outputs_create(on.plan);
    fsn_outputs_free(made);
    return made != NULL ? FSN_OK : FSN_E_NOMEM;
}

static fsn_status control(void) {
    struct fsn_control *made = fsn_control_create(on.plan, &host, &nobody);
    fsn_control_free(made);
    return made != NULL ? FSN_OK : FSN_E_NOMEM;
}

/** Without room for images the core counts as stopped for those who ask. */
static fsn_status attach(void) {
    const long after = heap.fails_in;
    heap.fails_in = 0;
    struct fsn_control *made = fsn_control_create(on.plan, &host, &nobody);
    heap.fails_in = after;
    fsn_control_attach(made, on.core);
    const bool attached = made->services.view.core != NULL;
    fsn_control_free(made);
    return attached ? FSN_OK : FSN_E_NOMEM;
}

static void each_allocation_may_fail(void) {
    static const struct {
        const char *name;
        fsn_status (*call)(void);
        long least; /**< allocations that it makes at least */
    } table[] = {
        {"load", load, 2},        {"fingerprint", fingerprint, 3}, {"emulated", emulated, 9},
        {"core", core, 15},       {"recorder", recorder, 1},       {"frames", frames, 9},
        {"segment", segment, 15}, {"object", object, 2},           {"outputs", outputs, 1},
        {"control", control, 5},  {"attach", attach, 3},
    };
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        long failed = 0;
        fsn_status status = FSN_E_NOMEM;
        while (status != FSN_OK) {
            const long alive = heap.alive;
            heap.fails_in = ++failed;
            status = table[i].call();
            const bool failing = heap.fails_in == 0; /* there were as many */
            heap.fails_in = 0;
            if (status != (failing ? FSN_E_NOMEM : FSN_OK) || heap.alive != alive) {
                fprintf(stderr, "%s, allocation %ld: %s, %ld not freed\n", table[i].name, failed,
                        fsn_status_name(status), heap.alive - alive);
                exit(1);
            }
        }
        if (failed <= table[i].least) {
            fprintf(stderr, "%s: only %ld allocations were tried\n", table[i].name, failed - 1);
            exit(1);
        }
    }
}

int main(void) {
    uint8_t *bytes = build_full(&plan_len);
    plan_bytes = malloc(plan_len);
    CHECK(plan_bytes != NULL);
    memcpy(plan_bytes, bytes, plan_len);
    on = emulated_rig_load(bytes, plan_len);
    /* One image, one core: that of the calls under test takes the bus. */
    fsn_core_free(on.core);
    host = test_host(NULL);
    struct fsn_emulated *second;
    CHECK(fsn_emulated_create(on.plan, &second) == FSN_OK);
    CHECK(fsn_core_create(on.plan, fsn_emulated_ops(), second, &on.core, NULL) == FSN_OK);
    each_allocation_may_fail();
    fsn_emulated_free(second);
    emulated_rig_end(&on);
    free(plan_bytes);
    return 0;
}
