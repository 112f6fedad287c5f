/** The window of an incident ends with a cycle, not with a clock. No time passes here. */
#define _GNU_SOURCE

#include <dirent.h>
#include <string.h>
#include <unistd.h>

#include "control/incident.h"
#include "control/incident_kept.h"
#include "control_host.h"
#include "emulated_rig.h"

enum { MS = 1000000 };

struct rig {
    struct emulated_rig on;
    struct fsn_control *control;
    char folder[32];
};

static struct fsn_job *submitted;

static void take_job(void *self, struct fsn_job *job) {
    (void)self;
    submitted = job;
}

static struct fsn_control_host host;

static struct rig set_up(void) {
    static const struct build_sm sm[2][2] = {{{1, 8}, {2, 8}}, {{1, 8}, {2, 8}}};
    const struct build build = {.subdevices = 2, .sm = sm, .cycle_ns = MS};
    struct rig rig = {.on = emulated_rig_build(&build), .folder = "/tmp/fsn-test-XXXXXX"};
    struct fsn_refusal refusal;
    CHECK(mkdtemp(rig.folder) != NULL);
    CHECK(fsn_core_keep(rig.on.core, UINT64_C(10000) * MS, (size_t)8 << 20) == FSN_OK);
    host = test_host(take_job);
    rig.control = fsn_control_create(rig.on.plan, &host, &nobody);
    CHECK(rig.control != NULL);
    CHECK(fsn_control_keep_incidents(rig.control, rig.folder, &refusal) == FSN_OK);
    fsn_control_attach(rig.control, rig.on.core);
    return rig;
}

/** One cycle at a time of our choice, and what the control thread makes of it. */
static void cycle_at(struct rig *rig, uint64_t now_ns) {
    CHECK(fsn_core_cycle(rig->on.core, now_ns) == FSN_OK);
    fsn_watch(rig->control, now_ns);
}

static bool is_kept_still(struct rig *rig, uint64_t now_ns) {
    fsn_incident_turn(rig->control, now_ns);
    return rig->control->incidents->pending.active;
}

static void begin_at(struct rig *rig, uint64_t now_ns) {
    const struct fsn_trigger trigger = {.kind = "request", .now_ns = now_ns, .text = "a test"};
    CHECK(fsn_incident_begin(rig->control, &trigger));
    submitted->status = FSN_E_ABSENT; /* this bus has no objects */
    fsn_control_job_done(rig->control, submitted);
    CHECK(rig->control->incidents->job == NULL);
}

/** Returns how many files there were. */
static int tear_down(struct rig *rig) {
    fsn_control_free(rig->control); /* waits for the file */
    emulated_rig_end(&rig->on);
    char path[400];
    int files = 0;
    DIR *folder = opendir(rig->folder);
    CHECK(folder != NULL);
    for (struct dirent *entry = readdir(folder); entry != NULL; entry = readdir(folder)) {
        if (entry->d_name[0] != '.') {
            snprintf(path, sizeof path, "%s/%s", rig->folder, entry->d_name);
            CHECK(unlink(path) == 0);
            files++;
        }
    }
    closedir(folder);
    CHECK(rmdir(rig->folder) == 0);
    return files;
}

static void a_cycle_that_was_held_up_is_waited_for(void) {
    struct rig rig = set_up();
    cycle_at(&rig, UINT64_C(1000) * MS);
    begin_at(&rig, UINT64_C(1000) * MS);
    cycle_at(&rig, UINT64_C(1400) * MS);
    CHECK(is_kept_still(&rig, UINT64_C(1999) * MS));
    CHECK(is_kept_still(&rig, UINT64_C(9000) * MS)); /* this thread was held up as well */
    CHECK(is_kept_still(&rig, UINT64_C(9999) * MS));
    cycle_at(&rig, UINT64_C(9999) * MS);
    CHECK(!is_kept_still(&rig, UINT64_C(9999) * MS));
    CHECK(tear_down(&rig) == 1);
}

static void a_cycle_that_stands_still_is_not(void) {
    struct rig rig = set_up();
    cycle_at(&rig, UINT64_C(1000) * MS);
    begin_at(&rig, UINT64_C(1000) * MS);
    CHECK(is_kept_still(&rig, UINT64_C(2000) * MS));
    CHECK(is_kept_still(&rig, UINT64_C(2999) * MS));
    CHECK(!is_kept_still(&rig, UINT64_C(3000) * MS));
    CHECK(tear_down(&rig) == 1);
}

static bool left_data_at(struct rig *rig, uint64_t now_ns) {
    const struct fsn_trigger trigger = {.kind = "left_data", .now_ns = now_ns, .text = "a test"};
    const bool begun = fsn_incident_begin(rig->control, &trigger);
    if (begun) {
        submitted->status = FSN_E_ABSENT;
        fsn_control_job_done(rig->control, submitted);
        cycle_at(rig, now_ns + UINT64_C(1000) * MS);
        for (int i = 0; is_kept_still(rig, now_ns + UINT64_C(1000) * MS); i++) {
            CHECK(i < 60000); /* the file of the one before is still being written */
            usleep(1000);
        }
    }
    return begun;
}

/** A second failure has a file of its own, and a third one; one that goes on and on has not. */
static void a_second_failure_has_its_own(void) {
    struct rig rig = set_up();
    const uint64_t second = UINT64_C(1000) * MS;
    cycle_at(&rig, second);
    CHECK(left_data_at(&rig, 10 * second));
    CHECK(left_data_at(&rig, 12 * second));
    CHECK(left_data_at(&rig, 14 * second));
    CHECK(!left_data_at(&rig, 16 * second));
    CHECK(!left_data_at(&rig, 19 * second));
    CHECK(left_data_at(&rig, 20 * second)); /* one each ten seconds, in the long run */
    CHECK(!left_data_at(&rig, 29 * second));
    CHECK(left_data_at(&rig, 30 * second));
    CHECK(left_data_at(&rig, 100 * second));
    CHECK(left_data_at(&rig, 102 * second));
    CHECK(tear_down(&rig) == 7);
}

/** A SubDevice that refuses a state is one incident until it is in OP, however often it is asked.
 */
static void a_subdevice_that_refuses_is_one(void) {
    struct rig rig = set_up();
    struct fsn_incidents *in = rig.control->incidents;
    struct fsn_bus_subdevice seen = {.found = FSN_FOUND_STATE, .al_status = FSN_AL_PREOP};
    snprintf(seen.detail, sizeof seen.detail, "SAFEOP refused");
    const uint64_t second = UINT64_C(1000) * MS;
    cycle_at(&rig, second);
    for (int i = 0; i < 3; i++) {
        fsn_incident_subdevice(rig.control, 1, &seen, second);
        seen.found = FSN_FOUND_RIGHT; /* it is asked again */
        fsn_incident_subdevice(rig.control, 1, &seen, second);
        seen.found = FSN_FOUND_STATE;
    }
    CHECK(in->pending.active && in->files == 1);
    struct fsn_subdevice_info info;
    char text[300];
    CHECK(fsn_plan_subdevice(rig.on.plan, 1, &info) == FSN_OK);
    snprintf(text, sizeof text, "SubDevice %s: refused a state: SAFEOP refused", info.name);
    CHECK(strcmp(in->pending.kind, "refused") == 0 && strcmp(in->pending.text, text) == 0);
    CHECK(strcmp(in->pending.subdevice, info.name) == 0);
    submitted->status = FSN_E_ABSENT;
    fsn_control_job_done(rig.control, submitted);
    cycle_at(&rig, 2 * second);
    CHECK(!is_kept_still(&rig, 2 * second));
    fsn_incident_subdevice(rig.control, 1, &seen, 3 * second);
    CHECK(!in->pending.active);
    const struct fsn_bus_subdevice in_op = {.found = FSN_FOUND_RIGHT, .al_status = FSN_AL_OP};
    fsn_incident_subdevice(rig.control, 1, &in_op, 4 * second);
    fsn_incident_subdevice(rig.control, 1, &seen, 5 * second);
    CHECK(in->pending.active && in->files == 2);
    submitted->status = FSN_E_ABSENT;
    fsn_control_job_done(rig.control, submitted);
    CHECK(tear_down(&rig) >= 1);
}

/** Who was in Data has left it, and not never come. */
static void who_was_in_data_did_come(void) {
    struct rig rig = set_up();
    fsn_incident_connection(rig.control, 0, FSN_OUTSIDE_RESET);
    CHECK(rig.control->incidents->told[0] == 0);
    fsn_incident_connection(rig.control, 0, FSN_OUTSIDE_DATA_PROCESS);
    fsn_incident_connection(rig.control, 0, FSN_OUTSIDE_RESET);
    CHECK(rig.control->incidents->told[0] == 1);
    CHECK(tear_down(&rig) == 0);
}

static void one_that_runs_is_not_either(void) {
    struct rig rig = set_up();
    cycle_at(&rig, UINT64_C(1000) * MS);
    begin_at(&rig, UINT64_C(1000) * MS);
    cycle_at(&rig, UINT64_C(2000) * MS);
    CHECK(!is_kept_still(&rig, UINT64_C(2000) * MS));
    CHECK(tear_down(&rig) == 1);
}

int main(void) {
    a_cycle_that_was_held_up_is_waited_for();
    a_cycle_that_stands_still_is_not();
    one_that_runs_is_not_either();
    a_second_failure_has_its_own();
    a_subdevice_that_refuses_is_one();
    who_was_in_data_did_come();
    return 0;
}
