/** The window of an incident ends with a cycle, not with a clock. No time passes here. */
#define _GNU_SOURCE

#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "control/base/clock.h"
#include "control/incidents/incidents.h"
#include "control/incidents/kept.h"
#include "control_host.h"
#include "emulated_rig.h"
#include "heap.h"
#include "plan/plan_internal.h"

enum { MS = 1000000 };

/* -- a system that refuses ------------------------------------------------------------------- */

static struct {
    int fsync, fdopen, fclose, access, thread; /**< errors that the next calls end with */
} fails;

static atomic_bool holds; /**< a disk that does not answer */

int fsync(int fd) {
    (void)fd;
    while (atomic_load(&holds)) {
        usleep(100);
    }
    errno = fails.fsync;
    return fails.fsync != 0 ? -1 : 0;
}

static void real(void *to, const char *name) {
    void *found = dlsym(RTLD_NEXT, name);
    memcpy(to, &found, sizeof found);
}

FILE *fdopen(int fd, const char *mode) {
    FILE *(*libc)(int, const char *);
    real(&libc, "fdopen");
    errno = fails.fdopen;
    return fails.fdopen != 0 ? NULL : libc(fd, mode);
}

int fclose(FILE *file) {
    int (*libc)(FILE *);
    real(&libc, "fclose");
    const int closed = libc(file);
    errno = fails.fclose;
    return fails.fclose != 0 ? EOF : closed;
}

int access(const char *path, int mode) {
    errno = fails.access;
    return fails.access != 0 ? -1 : faccessat(AT_FDCWD, path, mode, 0);
}

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *),
                   void *context) {
    int (*libc)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    real(&libc, "pthread_create");
    return fails.thread != 0 ? fails.thread : libc(thread, attributes, run, context);
}

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
static char logged[2000];
static enum fsn_program_state state = FSN_PROGRAM_RUNNING;

static void keep_text(void *self, enum fsn_log_level level, enum fsn_role account, const char *text,
                      const char *json, size_t json_bytes) {
    (void)account;
    (void)self;
    CHECK(json_bytes >= 2 && json[0] == '{' && json[json_bytes - 1] == '}');
    const size_t used = strlen(logged);
    snprintf(logged + used, sizeof logged - used, "%c %s\n", "diwe"[level], text);
}

static void tell_state(void *self, struct fsn_control_status *status) {
    host_status(self, status);
    status->state = state;
}

static struct rig set_up_with(uint32_t connections) {
    static const struct build_sm sm[2][2] = {{{1, 8}, {2, 8}}, {{1, 8}, {2, 8}}};
    static const struct build_copy copies[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}};
    const struct build build = {
        .subdevices = 2, .sm = sm, .copies = copies, .pairs = connections, .cycle_ns = MS};
    struct rig rig = {.on = emulated_rig_build(&build), .folder = "/tmp/fsn-test-XXXXXX"};
    struct fsn_refusal refusal;
    CHECK(mkdtemp(rig.folder) != NULL);
    CHECK(fsn_core_keep(rig.on.core, UINT64_C(10000) * MS, (size_t)8 << 20) == FSN_OK);
    host = test_host(take_job);
    host.log = keep_text;
    host.status = tell_state;
    logged[0] = 0;
    rig.control = fsn_control_create(rig.on.plan, &host, &nobody);
    CHECK(rig.control != NULL);
    CHECK(fsn_control_keep_incidents(rig.control, rig.folder, 1 << 30, &refusal) == FSN_OK);
    fsn_control_attach(rig.control, rig.on.core);
    return rig;
}

static struct rig set_up(void) {
    return set_up_with(0);
}

/** One cycle at a time of our choice, and the reaction of the control thread. */
static void cycle_at(struct rig *rig, uint64_t now_ns) {
    CHECK(fsn_core_cycle(rig->on.core, now_ns) == FSN_OK);
    fsn_changes_poll(&rig->control->changes, rig->control->services.incidents, now_ns);
}

static bool is_kept_still(struct rig *rig, uint64_t now_ns) {
    fsn_incident_turn(rig->control->services.incidents, now_ns);
    return rig->control->services.incidents->pending.active;
}

static void begin_at(struct rig *rig, uint64_t now_ns) {
    const struct fsn_trigger trigger = {.kind = FSN_REQUESTED, .now_ns = now_ns, .text = "a test"};
    CHECK(fsn_incident_begin(rig->control->services.incidents, &trigger));
    submitted->status = FSN_E_ABSENT; /* this bus has no objects */
    fsn_control_job_done(rig->control, submitted);
    CHECK(rig->control->services.incidents->job == NULL);
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
    const struct fsn_trigger trigger = {.kind = FSN_LEFT_DATA, .now_ns = now_ns, .text = "a test"};
    const bool begun = fsn_incident_begin(rig->control->services.incidents, &trigger);
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

/** A second failure has a file of its own, and so has a third; a continuing one has not. */
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

/** A SubDevice that refuses a state is one incident until it is in OP, however often it is tried.
 */
static void a_subdevice_that_refuses_is_one(void) {
    struct rig rig = set_up();
    struct fsn_incidents *in = rig.control->services.incidents;
    struct fsn_bus_subdevice seen = {.found = FSN_FOUND_STATE, .al_status = FSN_AL_PREOP};
    snprintf(seen.detail, sizeof seen.detail, "SAFEOP refused");
    const uint64_t second = UINT64_C(1000) * MS;
    cycle_at(&rig, second);
    for (int i = 0; i < 3; i++) {
        fsn_incident_subdevice(rig.control->services.incidents, 1, &seen, second);
        seen.found = FSN_FOUND_RIGHT; /* it is tried again */
        fsn_incident_subdevice(rig.control->services.incidents, 1, &seen, second);
        seen.found = FSN_FOUND_STATE;
    }
    CHECK(in->pending.active && in->files == 1);
    struct fsn_subdevice_info info;
    char text[300];
    CHECK(fsn_plan_subdevice(rig.on.plan, 1, &info) == FSN_OK);
    snprintf(text, sizeof text, "SubDevice %s: refused a state: SAFEOP refused", info.name);
    CHECK(in->pending.kind == FSN_REFUSED && strcmp(in->pending.text, text) == 0);
    CHECK(strcmp(in->pending.subdevice, info.name) == 0);
    submitted->status = FSN_E_ABSENT;
    fsn_control_job_done(rig.control, submitted);
    cycle_at(&rig, 2 * second);
    CHECK(!is_kept_still(&rig, 2 * second));
    fsn_incident_subdevice(rig.control->services.incidents, 1, &seen, 3 * second);
    CHECK(!in->pending.active);
    const struct fsn_bus_subdevice in_op = {.found = FSN_FOUND_RIGHT, .al_status = FSN_AL_OP};
    fsn_incident_subdevice(rig.control->services.incidents, 1, &in_op, 4 * second);
    fsn_incident_subdevice(rig.control->services.incidents, 1, &seen, 5 * second);
    CHECK(in->pending.active && in->files == 2);
    submitted->status = FSN_E_ABSENT;
    fsn_control_job_done(rig.control, submitted);
    CHECK(tear_down(&rig) >= 1);
}

/** A connection that was in Data has left it; it did not fail to reach it. */
static void who_was_in_data_did_come(void) {
    struct rig rig = set_up();
    fsn_incident_connection(rig.control->services.incidents, 0, FSN_OBSERVED_RESET);
    CHECK(rig.control->services.incidents->reported[0] == 0);
    fsn_incident_connection(rig.control->services.incidents, 0, FSN_OBSERVED_DATA_PROCESS);
    fsn_incident_connection(rig.control->services.incidents, 0, FSN_OBSERVED_RESET);
    CHECK(rig.control->services.incidents->reported[0] == 1);
    CHECK(tear_down(&rig) == 0);
}

/** A connection that is not in Data five seconds after the bus runs is one incident, once; the time
 *  restarts when the bus does not run. */
static void who_never_comes_is_reported_once(void) {
    struct rig rig = set_up_with(1);
    struct fsn_incidents *in = rig.control->services.incidents;
    const uint64_t second = UINT64_C(1000) * MS;
    static const struct {
        uint64_t ms;
        enum fsn_program_state state;
        bool begun;
    } turns[] = {{1000, FSN_PROGRAM_RUNNING, false},  {5999, FSN_PROGRAM_RUNNING, false},
                 {6500, FSN_PROGRAM_STARTING, false}, {7000, FSN_PROGRAM_RUNNING, false},
                 {11999, FSN_PROGRAM_RUNNING, false}, {12498, FSN_PROGRAM_RUNNING, false},
                 {12499, FSN_PROGRAM_RUNNING, true}};
    cycle_at(&rig, second);
    for (size_t i = 0; i < sizeof turns / sizeof turns[0]; i++) {
        state = turns[i].state;
        fsn_incident_turn(in, turns[i].ms * MS);
        CHECK(in->pending.active == turns[i].begun);
    }
    CHECK(in->pending.kind == FSN_NOT_CONNECTED);
    CHECK(strcmp(in->pending.connection, "t") == 0 && strcmp(in->pending.after, "silent") == 0);
    CHECK(strcmp(in->pending.text, "connection t has not come to Data within 5 s after every "
                                   "SubDevice reached OP, it is in silent") == 0);
    CHECK(in->reported[0] == 1 && in->pending.now_ns == UINT64_C(12499) * MS);
    submitted->status = FSN_E_ABSENT;
    fsn_control_job_done(rig.control, submitted);
    cycle_at(&rig, 14 * second);
    CHECK(!is_kept_still(&rig, 14 * second));
    while (in->file != NULL) {
        fsn_incident_turn(in, 14 * second);
        usleep(100);
    }
    CHECK(!is_kept_still(&rig, 20 * second) && in->files == 1);
    state = FSN_PROGRAM_RUNNING;
    CHECK(tear_down(&rig) == 1);
}

static void one_that_runs_is_not_either(void) {
    struct rig rig = set_up();
    cycle_at(&rig, UINT64_C(1000) * MS);
    begin_at(&rig, UINT64_C(1000) * MS);
    cycle_at(&rig, UINT64_C(2000) * MS);
    CHECK(!is_kept_still(&rig, UINT64_C(2000) * MS));
    CHECK(tear_down(&rig) == 1);
}

/* -- failures ------------------------------------------------------------------------------- */

/** One incident from start to end; its reports, with `*` for the folder. */
static const char *one_incident(struct rig *rig, uint64_t now_ns) {
    static char text[2000];
    logged[0] = 0;
    begin_at(rig, now_ns);
    cycle_at(rig, now_ns + UINT64_C(1000) * MS);
    struct fsn_incidents *in = rig->control->services.incidents;
    while (in->pending.active || in->file != NULL) {
        fsn_incident_turn(rig->control->services.incidents, now_ns + UINT64_C(1000) * MS);
        usleep(100);
    }
    size_t used = 0;
    for (const char *at = logged; *at != 0; at++) {
        const size_t len = strlen(rig->folder);
        const bool folder = strncmp(at, rig->folder, len) == 0;
        text[used++] = folder ? '*' : *at;
        at += folder ? len - 1 : 0;
    }
    text[used] = 0;
    return text;
}

static void is_logged(const char *got, const char *expected) {
    if (strcmp(got, expected) != 0) {
        fprintf(stderr, "said     %sexpected %s", got, expected);
        exit(1);
    }
}

/** Name of the file of an incident at a time; `number` follows it for those of the same second. */
static const char *file_at(uint64_t now_ns, const char *number) {
    static char name[100];
    char utc[32];
    fsn_utc_text(now_ns, utc);
    for (char *c = utc; *c != 0; c++) {
        *c = *c == ':' ? '_' : *c;
    }
    snprintf(name, sizeof name, "*/incident-%.19sZ-request%s.fsnincident", utc, number);
    return name;
}

static void a_system_that_refuses_is_reported(void) {
    struct rig rig = set_up();
    char expected[500];
    const uint64_t second = UINT64_C(1000) * MS;
    cycle_at(&rig, second);
    snprintf(expected, sizeof expected, "w incident: a test; fsoe-net log incident %s\n",
             file_at(second, ""));
    is_logged(one_incident(&rig, second), expected);
    snprintf(expected, sizeof expected, "w incident: a test; fsoe-net log incident %s\n",
             file_at(second, "-2"));
    is_logged(one_incident(&rig, second), expected); /* nothing that exists is touched */
    fails.fsync = EIO;
    snprintf(expected, sizeof expected,
             "e incident: a test; %s ends after 4 cycles: Input/output error\n",
             file_at(2 * second, ""));
    is_logged(one_incident(&rig, 2 * second), expected);
    fails.fclose = ENOSPC; /* the first reason is the one that is reported */
    snprintf(expected, sizeof expected,
             "e incident: a test; %s ends after 5 cycles: Input/output error\n",
             file_at(3 * second, ""));
    is_logged(one_incident(&rig, 3 * second), expected);
    fails.fsync = 0;
    snprintf(expected, sizeof expected,
             "e incident: a test; %s ends after 6 cycles: No space left on device\n",
             file_at(5 * second, ""));
    is_logged(one_incident(&rig, 5 * second), expected);
    fails.fclose = 0;
    fails.fdopen = ENOMEM;
    snprintf(expected, sizeof expected,
             "e incident: a test; %s ends after 0 cycles: Cannot allocate memory\n",
             file_at(3 * second, "-2"));
    is_logged(one_incident(&rig, 3 * second), expected);
    fails.fdopen = 0;
    fails.thread = EAGAIN;
    is_logged(one_incident(&rig, 4 * second), "e an incident is not kept: no memory for it\n");
    fails.thread = 0;
    CHECK(tear_down(&rig) == 6);
}

/** Nobody waits for the disk: the turns go on, and the result is reported when it is there. */
static void a_slow_disk_holds_nobody_up(void) {
    struct rig rig = set_up();
    struct fsn_incidents *in = rig.control->services.incidents;
    const uint64_t second = UINT64_C(1000) * MS;
    cycle_at(&rig, second);
    atomic_store(&holds, true);
    begin_at(&rig, second);
    cycle_at(&rig, 2 * second);
    for (int i = 0; i < 10; i++) {
        CHECK(!is_kept_still(&rig, 2 * second) && in->file != NULL && logged[0] == 0);
    }
    atomic_store(&holds, false);
    while (in->file != NULL) {
        fsn_incident_turn(in, 2 * second);
        usleep(100);
    }
    CHECK(strncmp(logged, "w incident: a test; ", 20) == 0);
    CHECK(tear_down(&rig) == 1);
}

/** A file is named after a connection, a SubDevice or the event, in plain characters. */
static void files_have_plain_names(void) {
    static const char long_name[] =
        "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ-_0123456789";
    static const struct {
        struct fsn_trigger trigger;
        const char *name;
    } rows[] = {
        {{.kind = FSN_REQUESTED, .connection = "door", .subdevice = "logic"}, "door"},
        {{.kind = FSN_REQUESTED, .subdevice = "two words"}, "two_words"},
        {{.kind = FSN_REQUESTED, .connection = "/a/../b  \x01\xC3\xA4z"}, "_a_b_z"},
        {{.kind = FSN_REQUESTED, .connection = "@`[{/:Az_Z09-a"}, "_Az_Z09-a"},
        {{.kind = FSN_REQUESTED, .connection = long_name},
         "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ-_012345"},
    };
    struct rig rig = set_up();
    const uint64_t second = UINT64_C(1000) * MS;
    struct fsn_incidents *in = rig.control->services.incidents;
    char utc[32], expected[500];
    cycle_at(&rig, second);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct fsn_trigger trigger = rows[i].trigger;
        trigger.now_ns = second * (i + 1);
        trigger.text = "a test";
        logged[0] = 0;
        CHECK(fsn_incident_begin(in, &trigger));
        fsn_control_attach(rig.control, NULL); /* the window ends with the bus */
        fsn_control_attach(rig.control, rig.on.core);
        while (in->file != NULL) {
            fsn_incident_turn(in, trigger.now_ns);
            usleep(100);
        }
        submitted->status = FSN_E_ABSENT;
        fsn_control_job_done(rig.control, submitted);
        fsn_utc_text(trigger.now_ns, utc);
        utc[13] = utc[16] = '_';
        snprintf(expected, sizeof expected,
                 "w incident: a test; fsoe-net log incident %s/incident-%.19sZ-%s.fsnincident\n",
                 rig.folder, utc, rows[i].name);
        is_logged(logged, expected);
    }
    CHECK(tear_down(&rig) == 5);
}

/** The recorded window begins five seconds before, to the nanosecond. */
static void five_seconds_before_are_kept(void) {
    struct rig rig = set_up();
    char expected[500];
    const uint64_t second = UINT64_C(1000) * MS;
    cycle_at(&rig, second);
    cycle_at(&rig, second + 1);
    fails.fsync = EIO;
    snprintf(expected, sizeof expected,
             "e incident: a test; %s ends after 2 cycles: Input/output error\n",
             file_at(6 * second + 1, ""));
    is_logged(one_incident(&rig, 6 * second + 1), expected);
    fails.fsync = 0;
    CHECK(tear_down(&rig) == 1);
}

/** All incident files in the folder count, whoever wrote them; other files and folders do not. */
static void a_folder_has_a_limit(void) {
    struct rig rig = set_up();
    const uint64_t second = UINT64_C(1000) * MS;
    char path[100];
    cycle_at(&rig, second);
    snprintf(path, sizeof path, "%s/large.other", rig.folder);
    int fd = open(path, O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
    CHECK(fd >= 0 && ftruncate(fd, 3 << 20) == 0 && close(fd) == 0);
    snprintf(path, sizeof path, "%s/no-suffix", rig.folder);
    CHECK(symlink("large.other", path) == 0);
    snprintf(path, sizeof path, "%s/link.fsnincident", rig.folder);
    CHECK(symlink("large.other", path) == 0);
    rig.control->services.incidents->most_bytes = 2 << 20;
    CHECK(strstr(one_incident(&rig, second), "w incident: a test; fsoe-net") != NULL);
    snprintf(path, sizeof path, "%s/of-before.fsnincident", rig.folder);
    fd = open(path, O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
    CHECK(fd >= 0 && ftruncate(fd, 2 << 20) == 0 && close(fd) == 0);
    is_logged(one_incident(&rig, 2 * second),
              "e incident: a test; not kept, for the incident files in * have 2 MiB; move some of "
              "them away, or start with a higher --incidents-limit\n");
    CHECK(tear_down(&rig) == 5);
}

/** A reader of the file decides by the status and the SubDevice, not by the text. */
static void a_bus_that_failed_is_kept_in_numbers(void) {
    struct rig rig = set_up();
    struct fsn_incidents *in = rig.control->services.incidents;
    const struct fsn_fault fault = {
        .status = FSN_E_BUS_IDENTITY, .section = FSN_SEC_SUBDEVICE, .copy_index = 1};
    const struct fsn_fault silent = {
        .status = FSN_E_BUS_SILENT, .copy_index = FSN_FAULT_NO_RECORD, .link_down = true};
    struct fsn_json head = {.limit_bytes = FSN_INCIDENT_HEAD_BYTES};
    cycle_at(&rig, UINT64_C(1000) * MS);
    fsn_control_bus_failed(rig.control, "some text", &fault, NULL);
    fsn_incident_head(in, &head);
    CHECK(strstr(head.bytes, "\"text\":\"some text\",\"fault\":{\"status\":\"FSN_E_BUS_IDENTITY\","
                             "\"subdevice\":\"t\",\"link_down\":false}}") != NULL);
    in->pending.fault = silent;
    head.len_bytes = 0;
    fsn_incident_head(in, &head);
    CHECK(strstr(head.bytes, "\"fault\":{\"status\":\"FSN_E_BUS_SILENT\",\"subdevice\":null,"
                             "\"link_down\":true}}") != NULL);
    fsn_json_free(&head);
    in->pending.active = false;
    CHECK(tear_down(&rig) == 0);
}

/** A whole file: its head, a line for each cycle with its deviations, and the end. */
static void a_file_says_what_is_new(void) {
    static const char expected[] =
        "{\"incident\":1}\n"
        "{\"cycle\":7,\"t\":1000,\"image\":\"00ff1a\"}\n"
        "{\"cycle\":8,\"t\":2000,\"late\":11,\"work\":12,\"round\":13,\"lost\":14,\"old\":15,"
        "\"foreign\":16,\"overruns\":17,\"wkc\":[6,5]}\n"
        "{\"cycle\":10,\"t\":4000,\"image\":\"00ff1b\"}\n"
        "{\"end\":true,\"cycles\":3}\n";
    static const struct fsn_cycle cycles[] = {{.cycle = 7, .now_ns = 1000},
                                              {.cycle = 8,
                                               .now_ns = 2000,
                                               .late_ns = 11,
                                               .work_ns = 12,
                                               .round_trip_ns = 13,
                                               .counts.lost_frames = 14,
                                               .counts.old_replies = 15,
                                               .counts.foreign_frames = 16,
                                               .overruns = 17,
                                               .expected_wkc = 6,
                                               .actual_wkc = 5},
                                              {.cycle = 10, .now_ns = 4000}};
    static const uint8_t images[] = {0x00, 0xFF, 0x1A, 0x00, 0xFF, 0x1A, 0x00, 0xFF, 0x1B};
    struct rig rig = set_up();
    struct fsn_json head = {.limit_bytes = 100};
    fsn_json_open(&head, '{');
    fsn_json_put_u64(&head, "incident", 1);
    fsn_json_close(&head, '}');
    fsn_json_end(&head);
    struct fsn_window window = {.count = 3,
                                .image_bytes = 3,
                                .cycles = malloc(sizeof cycles),
                                .images = malloc(sizeof images)};
    CHECK(window.cycles != NULL && window.images != NULL);
    memcpy(window.cycles, cycles, sizeof cycles);
    memcpy(window.images, images, sizeof images);
    struct fsn_incident_result result;
    struct fsn_incident_file *file =
        fsn_incident_file_begin(rig.folder, "a-name", 1, &head, &window);
    CHECK(file != NULL && head.bytes == NULL && window.cycles == NULL);
    fsn_incident_file_wait(file, &result);
    char path[100];
    char text[1000];
    snprintf(path, sizeof path, "%s/a-name.fsnincident", rig.folder);
    CHECK(strcmp(result.path, path) == 0 && result.cycles == 3 && result.error == 0);
    CHECK(!result.full);
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    const ssize_t got = read(fd, text, sizeof text - 1);
    CHECK(got > 0 && close(fd) == 0);
    text[got] = 0;
    is_logged(text, expected);
    struct stat found;
    CHECK(stat(path, &found) == 0 && (found.st_mode & 0111) == 0);
    CHECK(tear_down(&rig) == 1);
}

/** The plan is at the end of the head in base64 (RFC 4648), whatever its length. */
static void a_head_ends_with_the_plan(void) {
    static const char *const ends[] = {"\"plan\":\"Rg==\"}", "\"plan\":\"RlM=\"}",
                                       "\"plan\":\"RlNO\"}"};
    struct rig rig = set_up();
    const uint32_t len_bytes = rig.on.plan->len_bytes;
    CHECK(memcmp(rig.on.plan->bytes, "FSN", 3) == 0);
    for (uint32_t n = 0; n < 3; n++) {
        struct fsn_json head = {.limit_bytes = FSN_INCIDENT_HEAD_BYTES};
        rig.on.plan->len_bytes = n + 1;
        fsn_incident_head(rig.control->services.incidents, &head);
        const size_t end = strlen(ends[n]);
        CHECK(head.failed == FSN_OK && head.len_bytes > end + 1);
        CHECK(memcmp(head.bytes + head.len_bytes - 1 - end, ends[n], end) == 0);
        fsn_json_free(&head);
    }
    rig.on.plan->len_bytes = len_bytes;
    CHECK(tear_down(&rig) == 0);
}

/** The window begins five seconds before the moment, with the first cycle that is still there. */
static void a_window_has_its_begin(void) {
    struct rig rig = set_up();
    for (uint64_t n = 1; n <= 5; n++) {
        cycle_at(&rig, n * 100 * MS);
    }
    for (uint64_t from = 0; from <= 6; from++) {
        struct fsn_window window = fsn_window_take(rig.on.core, from * 100 * MS);
        const uint64_t first = from == 0 ? 1 : from;
        CHECK(window.count == 6 - first && window.image_bytes == fsn_core_image_bytes(rig.on.core));
        for (uint64_t i = 0; i < window.count; i++) {
            CHECK(window.cycles[i].cycle == first + i);
            CHECK(window.cycles[i].now_ns == (first + i) * 100 * MS);
        }
        fsn_window_free(&window);
        CHECK(window.cycles == NULL && window.images == NULL && window.count == 0);
    }
    CHECK(tear_down(&rig) == 0);
}

static void a_hundred_are_enough(void) {
    struct rig rig = set_up();
    const uint64_t second = UINT64_C(1000) * MS;
    const struct fsn_trigger trigger = {.kind = FSN_REQUESTED, .now_ns = second, .text = "a test"};
    cycle_at(&rig, second);
    rig.control->services.incidents->files = 99;
    CHECK(strstr(one_incident(&rig, second), "w incident: a test; fsoe-net") != NULL);
    logged[0] = 0;
    for (int i = 0; i < 3; i++) {
        CHECK(!fsn_incident_begin(rig.control->services.incidents, &trigger));
        is_logged(logged, "w 100 incidents were kept since the start; later ones are not kept\n");
    }
    CHECK(tear_down(&rig) == 1);
}

static void folders_are_checked(void) {
    struct rig rig = set_up();
    char path[100];
    char text[200];
    struct fsn_refusal refusal;
    struct fsn_incidents *none = NULL;
    struct fsn_services *with = &rig.control->services;
    snprintf(path, sizeof path, "%s/file", rig.folder);
    const int fd = open(path, O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
    CHECK(fd >= 0 && close(fd) == 0);
    errno = ENOSPC; /* of something else */
    CHECK(fsn_incidents_create(path, 0, &with->view, &with->events, &with->jobs, &none, &refusal) ==
              FSN_E_SYS &&
          none == NULL);
    snprintf(text, sizeof text, "incidents: %s is not a writable folder: Not a directory", path);
    CHECK(strcmp(refusal.text, text) == 0);
    CHECK(fsn_incidents_create("/nonexistent", 0, &with->view, &with->events, &with->jobs, &none,
                               &refusal) == FSN_E_SYS);
    CHECK(strcmp(refusal.text, "incidents: /nonexistent is not a writable folder: No such file or "
                               "directory") == 0);
    fails.access = EACCES;
    CHECK(fsn_incidents_create(rig.folder, 0, &with->view, &with->events, &with->jobs, &none,
                               &refusal) == FSN_E_SYS);
    fails.access = 0;
    snprintf(text, sizeof text, "incidents: %s is not a writable folder: Permission denied",
             rig.folder);
    CHECK(strcmp(refusal.text, text) == 0 && none == NULL);
    CHECK(strcmp(refusal.hint, "mkdir it, and let this user write there") == 0);
    CHECK(tear_down(&rig) == 1);
}

/** A requested stop is not a failure; a requested incident still gets its file. */
static void a_stop_is_no_incident(void) {
    static const enum fsn_program_state states[] = {FSN_PROGRAM_STOPPING, FSN_PROGRAM_STOPPED,
                                                    FSN_PROGRAM_RUNNING};
    struct rig rig = set_up();
    const uint64_t second = UINT64_C(1000) * MS;
    const struct fsn_trigger left = {.kind = FSN_LEFT_DATA, .now_ns = second, .text = "a test"};
    cycle_at(&rig, second);
    for (int i = 0; i < 3; i++) {
        state = states[i];
        CHECK(fsn_incident_begin(rig.control->services.incidents, &left) == (i == 2));
    }
    CHECK(!fsn_incident_begin(rig.control->services.incidents, &left)); /* one at a time */
    fsn_control_attach(rig.control, NULL); /* and it is written when the bus stops */
    CHECK(!rig.control->services.incidents->pending.active);
    CHECK(atomic_load(&submitted->cancelled) && rig.control->services.incidents->job == NULL);
    submitted->status = FSN_E_ABSENT;
    fsn_control_job_done(rig.control, submitted);
    CHECK(tear_down(&rig) == 1);
}

/** After closing nothing is recorded, and nothing fails. */
static void without_a_folder_nothing_is_kept(void) {
    struct rig rig = set_up();
    const struct fsn_trigger trigger = {.kind = FSN_REQUESTED, .now_ns = 1, .text = "a test"};
    struct fsn_control *control = fsn_control_create(rig.on.plan, &host, &nobody);
    CHECK(control != NULL);
    fsn_incident_turn(control->services.incidents, 1);
    fsn_incident_detach(control->services.incidents);
    fsn_incident_event(control->services.incidents, "{}", 2);
    fsn_incident_connection(control->services.incidents, 0, FSN_OBSERVED_DATA_PROCESS);
    CHECK(!fsn_incident_begin(control->services.incidents, &trigger));
    fsn_control_free(control);
    CHECK(tear_down(&rig) == 0);
}

#ifdef FSN_TEST_HEAP
/** Whichever allocation fails at the end of the window: a file comes of it, or it is reported. */
static void memory_runs_out(bool again) {
    const long alive = heap.alive;
    struct rig rig = set_up();
    const uint64_t second = UINT64_C(1000) * MS;
    int kept = 0;
    int lost = 0;
    cycle_at(&rig, second);
    for (long n = 1; kept < 3; n++) {
        const uint64_t now_ns = second * (uint64_t)(n + 1);
        logged[0] = 0;
        begin_at(&rig, now_ns);
        cycle_at(&rig, now_ns + second);
        struct fsn_incidents *in = rig.control->services.incidents;
        heap.fails_in = n;
        while (in->pending.active) {
            fsn_incident_turn(rig.control->services.incidents, now_ns + second);
        }
        heap.fails_in = 0;
        while (in->file != NULL) {
            fsn_incident_turn(rig.control->services.incidents, now_ns + second);
            usleep(100);
        }
        kept += strstr(logged, "w incident: a test; fsoe-net log incident ") != NULL;
        lost += strcmp(logged, "e an incident is not kept: no memory for it\n") == 0;
        if (kept + lost < n && strstr(logged, "Cannot allocate memory") == NULL) {
            fprintf(stderr, "allocation %ld: %s\n", n, logged);
            exit(1);
        }
        CHECK(n < 200);
    }
    CHECK(lost > 2);
    (void)tear_down(&rig);
    CHECK(!again || heap.alive == alive);
}
#endif

int main(void) {
    close(STDIN_FILENO); /* 0 is a descriptor like any other */
    const int open_before = open_files();
#ifdef FSN_TEST_HEAP
    memory_runs_out(false);
    memory_runs_out(true); /* what libc keeps of the first one is kept already */
#endif
    a_system_that_refuses_is_reported();
    a_slow_disk_holds_nobody_up();
    five_seconds_before_are_kept();
    files_have_plain_names();
    a_folder_has_a_limit();
    a_bus_that_failed_is_kept_in_numbers();
    a_file_says_what_is_new();
    a_head_ends_with_the_plan();
    a_window_has_its_begin();
    a_hundred_are_enough();
    folders_are_checked();
    a_stop_is_no_incident();
    without_a_folder_nothing_is_kept();
    a_cycle_that_was_held_up_is_waited_for();
    a_cycle_that_stands_still_is_not();
    one_that_runs_is_not_either();
    who_never_comes_is_reported_once();
    a_second_failure_has_its_own();
    a_subdevice_that_refuses_is_one();
    who_was_in_data_did_come();
    CHECK(open_files() == open_before);
    return 0;
}
