/** The intervention log: its chain over files, crashes, disks that are full, folders that go. */
/* shows R26, R29 */
#define _GNU_SOURCE

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/log/interventions.h"
#include "builder.h"
#include "control/base/words.h"
#include "plan/plan_internal.h"

enum { MIB = 1 << 20, PATIENCE_MS = 600000 };

static const char stop[] = "{\"event\":\"stop\",\"code\":0}";
static const char some[] = "{\"event\":\"state\",\"text\":\"some\"}";

static struct {
    char folder[64];
    struct interventions *log;
    struct fsn_refusal refusal;
} rig;

static void set_up(void) {
    snprintf(rig.folder, sizeof rig.folder, "/tmp/fsn-log-XXXXXX");
    CHECK(mkdtemp(rig.folder) != NULL);
}

static void tear_down(void) {
    char command[128];
    snprintf(command, sizeof command, "rm -r %s", rig.folder);
    CHECK(system(command) == 0);
}

static fsn_status begin_with(uint64_t most_bytes) {
    return interventions_open(rig.folder, most_bytes, &rig.log, &rig.refusal);
}

static void begin(void) {
    CHECK(begin_with(MIB) == FSN_OK);
}

static void put_as(enum fsn_role account, const char *json) {
    interventions_put(rig.log, account, json, strlen(json));
}

static void put(const char *json) {
    put_as(FSN_MAINTAINER, json);
}

static void end(void) {
    CHECK(interventions_close(rig.log, PATIENCE_MS) == 0);
}

static const char *path_of(uint32_t file) {
    static char path[128];
    char name[INTERVENTION_NAME_BYTES];
    intervention_file_name(file, name);
    snprintf(path, sizeof path, "%s/%s", rig.folder, name);
    return path;
}

/** Bytes of a file, to be freed; NULL: there is none. */
static char *read_file(uint32_t file, size_t *len) {
    FILE *in = fopen(path_of(file), "re");
    struct stat found;
    if (in == NULL) {
        return NULL;
    }
    CHECK(fstat(fileno(in), &found) == 0);
    char *bytes = calloc(1, (size_t)found.st_size + 1);
    *len = fread(bytes, 1, (size_t)found.st_size, in);
    CHECK(*len == (size_t)found.st_size);
    fclose(in);
    return bytes;
}

static void append_to(uint32_t file, const char *bytes) {
    FILE *out = fopen(path_of(file), "ae");
    CHECK(out != NULL && fputs(bytes, out) >= 0 && fclose(out) == 0);
}

static void cut(uint32_t file, off_t bytes) {
    struct stat found;
    CHECK(stat(path_of(file), &found) == 0);
    CHECK(truncate(path_of(file), found.st_size - bytes) == 0);
}

/** Result of a walk along the chain. */
struct walk {
    uint64_t entries, torn_lines;
    char hash[65];
    char events[8192]; /**< of the entries, separated by blanks */
};

static void take_line(struct walk *walk, const char *line, size_t len) {
    uint64_t number;
    char event[32];
    char previous[80];
    uint8_t digest[FSN_SHA256_BYTES];
    if (len >= 5 && memcmp(line + len - 5, " torn", 5) == 0) {
        walk->torn_lines++;
        return;
    }
    CHECK(sscanf(line, "{\"number\":%" SCNu64 ",\"event\":\"%31[a-z_]\"", &number, event) == 2);
    CHECK(number == ++walk->entries);
    snprintf(previous, sizeof previous, number == 1 ? "\"previous\":null}" : "\"previous\":\"%s\"}",
             walk->hash);
    CHECK(len > strlen(previous));
    CHECK(strncmp(line + len - strlen(previous), previous, strlen(previous)) == 0);
    fsn_sha256(line, len, digest);
    fsn_hex_text(digest, sizeof digest, walk->hash);
    const size_t used = strlen(walk->events);
    snprintf(walk->events + used, sizeof walk->events - used, "%s ", event);
}

/** Walks along all files up to the first that is missing: every whole line holds the hash of the
 *  one before. Returns the events. */
static struct walk walk_all(uint32_t first) {
    static struct walk walk;
    size_t len;
    char *bytes;
    memset(&walk, 0, sizeof walk);
    for (uint32_t file = first; (bytes = read_file(file, &len)) != NULL; file++) {
        char *at = bytes;
        for (char *newline; (newline = strchr(at, '\n')) != NULL; at = newline + 1) {
            take_line(&walk, at, (size_t)(newline - at));
        }
        CHECK(*at == 0); /* nothing without its newline */
        free(bytes);
    }
    return walk;
}

static void check_events(const char *expected) {
    const struct walk walk = walk_all(1);
    if (strcmp(walk.events, expected) != 0) {
        fprintf(stderr, "events: %s\n", walk.events);
    }
    CHECK(strcmp(walk.events, expected) == 0);
}

static void entries_are_chained(void) {
    struct fsn_interventions state;
    struct stat found;
    const mode_t before = umask(0);
    set_up();
    begin();
    umask(before);
    put(some);
    put(stop);
    end();
    check_events("file state stop ");
    CHECK(stat(path_of(1), &found) == 0 && (found.st_mode & 07777) == 0640);
    begin(); /* with a stop before, nothing is missing */
    interventions_state(rig.log, &state);
    CHECK(state.entry == 3 && state.lost == 0 && state.error == NULL);
    CHECK(strcmp(state.hash, walk_all(1).hash) == 0 && strcmp(state.folder, rig.folder) == 0);
    put(some);
    end();
    begin();
    put(stop);
    end();
    check_events("file state stop state unfinished stop ");
    tear_down();
}

static void only_what_belongs_there_is_kept(void) {
    static const char *const events[] = {"{\"event\":\"wkc\",\"x\":1}",
                                         "{\"event\":\"arm\",\"x\":1}",
                                         "{\"event\":\"armed\",\"x\":1}",
                                         "{\"event\":\"request\",\"x\":1}",
                                         "{\"event\":\"connection\"}",
                                         "{\"event\":\"parameters\",\"x\":1}",
                                         "{}",
                                         "{\"event\":\"ar",
                                         "{\"event\":\"incident\",\"x\":1}"};
    set_up();
    begin();
    for (size_t i = 0; i < sizeof events / sizeof events[0]; i++) {
        interventions_put_event(rig.log, FSN_OBSERVER, events[i], strlen(events[i]));
        interventions_put_event(NULL, FSN_OBSERVER, events[i], strlen(events[i]));
    }
    end();
    check_events("file arm request parameters incident ");
    tear_down();
}

static void files_go_on_in_the_next(void) {
    set_up();
    CHECK(begin_with(150) == FSN_OK);
    for (int i = 0; i < 5; i++) {
        put(some);
    }
    put(stop);
    end();
    const struct walk walk = walk_all(1);
    CHECK(walk.entries == 7 + 6 && access(path_of(7), F_OK) == 0 && access(path_of(8), F_OK) != 0);
    /* Old files may be moved away, the last one carries on. */
    for (uint32_t file = 1; file < 7; file++) {
        CHECK(unlink(path_of(file)) == 0);
    }
    begin();
    put(stop);
    end();
    size_t len;
    char *bytes = read_file(7, &len);
    CHECK(strstr(bytes, "\"log\":1,\"file\":7,\"before\":\"interventions-000006.jsonl\"") != NULL);
    CHECK(strstr(bytes, "\n{\"number\":14,\"event\":\"stop\"") != NULL);
    free(bytes);
    tear_down();
}

static void what_is_torn_stays_and_is_marked(void) {
    static const char *const tails[] = {"{\"number\":3,\"ev",
                                        "x",
                                        "}",
                                        "",
                                        "\n\n",
                                        "a\nb\nc",
                                        "{\"number\":3,\"event\":\"state\",\"previous\":null}"};
    for (size_t i = 0; i < sizeof tails / sizeof tails[0]; i++) {
        set_up();
        begin();
        put(stop);
        end();
        append_to(1, tails[i]);
        begin();
        put(stop);
        end();
        size_t len;
        char *bytes = read_file(1, &len);
        char *at = strchr(strchr(bytes, '\n') + 1, '\n') + 1;
        CHECK(strncmp(at, tails[i], strlen(tails[i])) == 0);
        if (tails[i][0] == 0) {
            check_events("file stop stop ");
        } else {
            uint8_t digest[FSN_SHA256_BYTES];
            char hash[65];
            char expected[160];
            const char *torn = strstr(at, "{\"number\":3,\"event\":\"torn\"");
            CHECK(torn != NULL && torn[-1] == '\n');
            CHECK(tails[i][0] == '\n' || memcmp(torn - 6, " torn\n", 6) == 0);
            fsn_sha256(at, (size_t)(torn - at), digest);
            fsn_hex_text(digest, sizeof digest, hash);
            snprintf(expected, sizeof expected, "\"bytes\":%zu,\"sha256\":\"%s\",",
                     (size_t)(torn - at), hash);
            CHECK(strstr(torn, expected) != NULL);
            CHECK(strstr(torn, "\n{\"number\":4,\"event\":\"unfinished\"") != NULL);
        }
        free(bytes);
        tear_down();
    }
}

/** A last line without its newline is torn, however whole it looks. */
static void a_cut_newline_is_torn(void) {
    set_up();
    begin();
    put(some);
    put(stop);
    end();
    cut(1, 1);
    begin();
    put(stop);
    end();
    CHECK(walk_all(1).torn_lines == 1);
    check_events("file state torn unfinished stop ");
    tear_down();
}

static void a_file_without_an_entry_is_used(void) {
    set_up();
    append_to(1, "");
    begin();
    put(stop);
    end();
    check_events("file stop ");
    append_to(2, "{\"numb");
    begin();
    put(stop);
    end();
    check_events("file stop file torn unfinished stop ");
    CHECK(access(path_of(3), F_OK) != 0);
    tear_down();
}

/** However far the numbers are apart, the end is found at once or not looked for. */
static void a_number_far_away_holds_nobody_up(void) {
    set_up();
    append_to(999999999, "");
    begin();
    put(stop);
    end();
    size_t len;
    char *bytes = read_file(999999999, &len);
    CHECK(strstr(bytes, "begins a new log") != NULL);
    free(bytes);
    tear_down();
}

static void a_long_foreign_file_stays(void) {
    struct stat found;
    set_up();
    begin();
    put(stop);
    end();
    append_to(2, "not ours\n");
    CHECK(truncate(path_of(2), 5 * MIB) == 0);
    begin();
    put(stop);
    end();
    CHECK(stat(path_of(2), &found) == 0 && found.st_size == 5 * MIB);
    size_t len;
    char *bytes = read_file(3, &len);
    CHECK(strncmp(bytes, "{\"number\":3,\"event\":\"file\"", 26) == 0);
    CHECK(strstr(bytes, "\"before\":\"interventions-000001.jsonl\"") != NULL);
    free(bytes);
    tear_down();
}

static void expect_refusal(fsn_status status, const char *text) {
    const fsn_status found = begin_with(MIB);
    if (found != status || strstr(rig.refusal.text, text) == NULL) {
        fprintf(stderr, "%d: %s\n", (int)found, rig.refusal.text);
    }
    CHECK(found == status && strstr(rig.refusal.text, text) != NULL);
}

static void places_are_checked(void) {
    char real[sizeof rig.folder];
    set_up();
    memcpy(real, rig.folder, sizeof real);
    snprintf(rig.folder, sizeof rig.folder, "%.40s/none", real);
    expect_refusal(FSN_E_SYS, "No such file or directory");
    memcpy(rig.folder, real, sizeof real);
    begin();
    struct interventions *first = rig.log;
    expect_refusal(FSN_E_STATE, "another fsn-master");
    rig.log = first;
    end();
    CHECK(unlink(path_of(1)) == 0 && symlink("/dev/null", path_of(1)) == 0);
    expect_refusal(FSN_E_SYS, "symbolic link");
    CHECK(unlink(path_of(1)) == 0 && mkfifo(path_of(1), 0600) == 0);
    expect_refusal(FSN_E_SYS, "not a regular file");
    CHECK(unlink(path_of(1)) == 0 && mkdir(path_of(1), 0700) == 0);
    expect_refusal(FSN_E_SYS, "not a regular file");
    char long_name[INTERVENTION_PATH_BYTES + 1];
    memset(long_name, 'a', sizeof long_name - 1);
    long_name[sizeof long_name - 1] = 0;
    CHECK(interventions_open(long_name, MIB, &rig.log, &rig.refusal) == FSN_E_ARG);
    tear_down();
}

static struct fsn_interventions wait_until(bool fails) {
    struct fsn_interventions state;
    do {
        usleep(1000);
        interventions_state(rig.log, &state);
    } while ((state.error != NULL) != fails || (!fails && state.waiting > 0));
    return state;
}

static void limit_files(rlim_t bytes) {
    struct rlimit limit;
    CHECK(getrlimit(RLIMIT_FSIZE, &limit) == 0);
    limit.rlim_cur = bytes;
    CHECK(setrlimit(RLIMIT_FSIZE, &limit) == 0);
}

/** The disk fills in the middle of a line; later it accepts writes again. */
static void a_full_disk_loses_nothing_that_waits(void) {
    struct stat found;
    set_up();
    begin();
    put(some);
    end();
    CHECK(stat(path_of(1), &found) == 0);
    begin();
    CHECK(wait_until(false).entry == 3); /* unfinished */
    CHECK(stat(path_of(1), &found) == 0);
    limit_files((rlim_t)found.st_size + 20);
    put(some);
    const struct fsn_interventions state = wait_until(true);
    CHECK(strcmp(state.error, "File too large") == 0 && state.waiting == 1 && state.entry == 3);
    put(some);
    limit_files(RLIM_INFINITY);
    CHECK(wait_until(false).lost == 0);
    put(stop);
    end();
    CHECK(walk_all(1).torn_lines == 1);
    check_events("file state unfinished torn state state stop ");
    tear_down();
}

/** A disk that is full when the program starts does not prevent the start. */
static void a_full_disk_is_no_refusal(void) {
    set_up();
    limit_files(0);
    begin();
    put(some);
    CHECK(wait_until(true).waiting == 1);
    CHECK(interventions_close(rig.log, PATIENCE_MS) == 1); /* reported by whoever ends */
    begin();
    wait_until(true);
    limit_files(RLIM_INFINITY);
    wait_until(false); /* noticed, although nothing waits */
    limit_files(0);
    put(some);
    limit_files(RLIM_INFINITY);
    wait_until(false);
    put(stop);
    end();
    check_events("file state stop ");
    tear_down();
}

/** Entries of an observer fill half of the queue, of an operator three quarters: the rest is kept
 *  for those above. Lost entries are counted, and the count is written. */
static void the_queue_has_a_reserve(void) {
    static const char of_observer[] = "{\"event\":\"dropped\",\"of\":\"observer\"}";
    set_up();
    begin();
    put(some);
    wait_until(false);
    limit_files(0);
    for (int i = 0; i < INTERVENTIONS_ENTRIES; i++) {
        put_as(FSN_OBSERVER, of_observer);
    }
    CHECK(wait_until(true).waiting == INTERVENTIONS_ENTRIES / 2);
    for (int i = 0; i < INTERVENTIONS_ENTRIES; i++) {
        put_as(FSN_OPERATOR, some);
    }
    CHECK(wait_until(true).waiting == INTERVENTIONS_ENTRIES / 4 * 3);
    for (int i = 0; i < INTERVENTIONS_ENTRIES / 4 + 3; i++) {
        put(some);
    }
    const uint64_t lost = INTERVENTIONS_ENTRIES / 2 + INTERVENTIONS_ENTRIES / 4 * 3 + 3;
    CHECK(wait_until(true).lost == lost);
    limit_files(RLIM_INFINITY);
    CHECK(wait_until(false).lost == lost);
    put(stop);
    end();
    const struct walk walk = walk_all(1);
    CHECK(walk.entries == 2 + INTERVENTIONS_ENTRIES + 2);
    size_t len;
    char *bytes = read_file(1, &len);
    CHECK(strstr(bytes, "\"event\":\"entries_lost\"") != NULL &&
          strstr(bytes, "\"entries\":1253,\"acts\":753,\"from\":\"2") != NULL);
    free(bytes);
    tear_down();
}

/** Bytes of an observer fill half of the queue as well, however few entries they are. */
static void long_entries_leave_the_reserve(void) {
    enum { LONG = INTERVENTION_LINE_BYTES / 4 };
    char *json = malloc(LONG);
    memset(json, 'x', LONG);
    set_up();
    begin();
    limit_files(0);
    for (int i = 0; i < 20; i++) {
        interventions_put(rig.log, FSN_OBSERVER, json, LONG);
    }
    CHECK(wait_until(true).waiting == INTERVENTIONS_BYTES / 2 / LONG);
    limit_files(RLIM_INFINITY);
    end();
    free(json);
    tear_down();
}

static uint64_t bytes_of_files(void) {
    struct stat found;
    uint64_t bytes = 0;
    for (uint32_t file = 1; stat(path_of(file), &found) == 0; file++) {
        bytes += (uint64_t)found.st_size;
    }
    return bytes;
}

/** Puts entries one by one until one of them is lost. */
static struct fsn_interventions fill_as(enum fsn_role account) {
    struct fsn_interventions state;
    interventions_state(rig.log, &state);
    const uint64_t lost = state.lost;
    do {
        put_as(account, some);
        do {
            usleep(100);
            interventions_state(rig.log, &state);
        } while (state.waiting > 0 && state.error == NULL);
    } while (state.lost == lost && state.error == NULL);
    return state;
}

static void check_bytes_near(uint64_t expected) {
    enum { SLACK = 800 }; /* two entries: one at the begin of a file, one about lost entries */
    const uint64_t bytes = bytes_of_files();
    CHECK(bytes + SLACK > expected && bytes < expected + SLACK);
}

/** The folder has a limit with the same reserve; moved files make room again. */
static void the_folder_has_a_limit(void) {
    enum { MOST = 1000, LIMIT = INTERVENTION_FILES * MOST };
    struct fsn_interventions state;
    set_up();
    CHECK(begin_with(MOST) == FSN_OK);
    CHECK(fill_as(FSN_OBSERVER).limit_bytes == LIMIT);
    do {
        state = wait_until(false);
    } while (!state.limited);
    check_bytes_near(LIMIT / 2);
    CHECK(state.bytes == bytes_of_files());
    CHECK(fill_as(FSN_OPERATOR).error == NULL);
    check_bytes_near(LIMIT / 4 * 3);
    const uint64_t entry = wait_until(false).entry;
    put(some);                                   /* the program and maintainers still have room */
    CHECK(wait_until(false).entry == entry + 2); /* after the entry about lost entries */
    state = fill_as(FSN_MAINTAINER);
    CHECK(strstr(state.error, "move old ones away") != NULL && state.waiting > 0);
    check_bytes_near(LIMIT);
    for (uint32_t file = 1; file < 50; file++) {
        CHECK(unlink(path_of(file)) == 0);
    }
    do {
        state = wait_until(false);
    } while (state.limited);
    put_as(FSN_OBSERVER, some);
    CHECK(wait_until(false).lost == state.lost);
    put(stop);
    end();
    tear_down();
}

/** The file or the folder is removed: the chain continues with the same numbers. */
static void a_file_that_goes_is_followed_by_another(void) {
    size_t len;
    set_up();
    begin();
    put(some);
    wait_until(false);
    CHECK(unlink(path_of(1)) == 0);
    put(some);
    wait_until(false);
    char *bytes = read_file(2, &len);
    CHECK(strncmp(bytes, "{\"number\":3,\"event\":\"file\"", 26) == 0);
    CHECK(strstr(bytes, "\n{\"number\":4,\"event\":\"state\"") != NULL);
    free(bytes);
    CHECK(unlink(path_of(2)) == 0 && rmdir(rig.folder) == 0);
    put(some);
    CHECK(strcmp(wait_until(true).error, "No such file or directory") == 0);
    CHECK(mkdir(rig.folder, 0755) == 0);
    wait_until(false);
    bytes = read_file(3, &len);
    CHECK(strncmp(bytes, "{\"number\":5,\"event\":\"file\"", 26) == 0);
    free(bytes);
    put(stop);
    end();
    tear_down();
}

static void too_long_is_reported(void) {
    char *json = malloc(INTERVENTION_LINE_BYTES);
    size_t len;
    memset(json, 'x', INTERVENTION_LINE_BYTES);
    set_up();
    begin();
    interventions_put(rig.log, FSN_MAINTAINER, json, INTERVENTION_LINE_BYTES);
    put(stop);
    end();
    free(json);
    check_events("file too_long stop ");
    char *bytes = read_file(1, &len);
    CHECK(strstr(bytes, "\"bytes\":1048576,") != NULL);
    free(bytes);
    tear_down();
}

/** A process is killed while it writes: all whole entries are chained; the next one reports it. */
static void a_killed_writer_leaves_a_chain(void) {
    struct stat found = {0};
    set_up();
    const pid_t child = fork();
    if (child == 0) {
        begin();
        for (;;) {
            put(some);
        }
    }
    while (stat(path_of(1), &found) != 0 || found.st_size < 20000) {
        usleep(100);
    }
    CHECK(kill(child, SIGKILL) == 0 && waitpid(child, NULL, 0) == child);
    begin();
    put(stop);
    end();
    const struct walk walk = walk_all(1);
    CHECK(walk.entries > 100 && walk.torn_lines <= 1);
    size_t len;
    char *bytes = read_file(1, &len);
    CHECK(strstr(bytes, "\"event\":\"unfinished\"") != NULL);
    free(bytes);
    tear_down();
}

int main(void) {
    signal(SIGXFSZ, SIG_IGN);
    entries_are_chained();
    only_what_belongs_there_is_kept();
    files_go_on_in_the_next();
    what_is_torn_stays_and_is_marked();
    a_cut_newline_is_torn();
    a_file_without_an_entry_is_used();
    a_number_far_away_holds_nobody_up();
    a_long_foreign_file_stays();
    places_are_checked();
    a_full_disk_loses_nothing_that_waits();
    a_full_disk_is_no_refusal();
    the_queue_has_a_reserve();
    long_entries_leave_the_reserve();
    the_folder_has_a_limit();
    a_file_that_goes_is_followed_by_another();
    too_long_is_reported();
    a_killed_writer_leaves_a_chain();
    CHECK(interventions_close(NULL, 0) == 0);
    return 0;
}
