#include "app/base/options.h"

#include <ctype.h>
#include <getopt.h>
#include <grp.h>
#include <pwd.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "app/base/backends.h"
#include "control/base/words.h"

static const char usage_text[] =
    "usage: fsn-master PLAN --interface IF [options]\n"
    "       fsn-master --scan --interface IF [--bus NAME]\n"
    "\n"
    "Drives the EtherCAT bus of a compiled plan and moves its FSoE frames in every cycle.\n"
    "\n"
    "  --bus NAME         soem (default), igh, or emulated: an image in memory\n"
    "  --interface IF     network interface (soem) or number of the master (igh); BUS=IF for each\n"
    "                     bus of a plan that has several\n"
    "  --redundant IF2    second interface, at the other end of the ring\n"
    "  --xdp              the cycle uses AF_XDP, with zero copy where the driver has it\n"
    "  --cycle TIME       bus cycle, e.g. 1ms or 250us; default: the plan's\n"
    "  --policy P         fifo, deadline or other; default: fifo where it is permitted\n"
    "  --priority N       of fifo, 1 to 99; default 80\n"
    "  --cpu N            runs the cycle on this CPU only\n"
    "  --free-run         no waiting: a cycle begins as soon as the bus has answered\n"
    "  --dc-every N       distributes the DC reference time every N cycles; default 0: each cycle\n"
    "                     where the plan starts SYNC0, else never\n"
    "  --dc-clock WHO     bus (default): the cycle follows the first SubDevice with a clock; "
    "host:\n"
    "                     this machine sets the clocks of the bus\n"
    "  --dc-shift TIME    time of the frames before SYNC0; default: half a cycle\n"
    "  --dc-window TIME   clocks further from the reference clock are an event; default 1us\n"
    "  --duration TIME    stops by itself, e.g. 10s\n"
    "  --record TIME      keeps the cycles of the last TIME; default 10s, at most 64 MiB\n"
    "  --wait TIME        retries for this time while SubDevices are missing\n"
    "  --accepted HASH    refuses a plan with another SHA-256 or fingerprint\n"
    "  --acceptance RECORD  refuses a plan other than the one of this record, signed by two "
    "people;\n"
    "                     fsoe-net, next to this program or on PATH, checks the signatures\n"
    "  --signers FILE     allowed signers (an ssh-keygen allowed_signers file)\n"
    "  --revoked FILE     revoked keys (an ssh-keygen revocation file)\n"
    "  --require-observed connection parameters that differ from the plan raise an alarm and\n"
    "                     exit code 4 at the end; no frame is changed or delayed\n"
    "  --take-over        takes the running bus over from another fsn-master with the same plan:\n"
    "                     no SubDevice leaves OP, and the other one ends\n"
    "  --standby          follows another fsn-master with the same plan, and takes the bus over "
    "when\n"
    "                     that one ends or hangs: 10 cycles and at least 5 ms without a frame\n"
    "  --socket PATH      control socket; default fsn-master-IF.sock in $RUNTIME_DIRECTORY,\n"
    "                     $XDG_RUNTIME_DIR or /run\n"
    "  --allow-user NAME[:ROLE]   user of the socket. Root and the user of this process are\n"
    "                     maintainers. ROLE is observer (only reads; default),\n"
    "                     operator (also sets outputs) or maintainer (objects, start, stop)\n"
    "  --allow-group NAME[:ROLE]  the same for a group; both are repeatable\n"
    "  --incidents DIR    writes a file about each connection that leaves Data\n"
    "  --incidents-limit MIB  no further files if those in DIR have this size; default 1024\n"
    "  --intervention-log DIR  keeps a log of starts, stops, requests that change something,\n"
    "                     parameters that differ and incidents; each entry holds the hash of the\n"
    "                     one before\n"
    "  --intervention-log-file MIB  size at which the next file begins; default 16\n"
    "  --log text|json    lines on stderr; default text\n"
    "  --trace            writes markers into the kernel's trace buffer\n"
    "  --scan             brings all SubDevices to PREOP, prints them as JSON and ends\n"
    "  --version          version, buses and their terms\n"
    "  --help             this text\n"
    "\n"
    "example: fsn-master estop.fsnplan --bus soem --interface eth1 --cycle 1ms\n"
    "Part of the black channel; no safety function, no certificate. Stop is not an emergency "
    "stop.\n";

int options_wrong(const char *option, const char *value, const char *text) {
    char shown[400];
    fsn_show_text(shown, sizeof shown, value != NULL ? value : "");
    fprintf(stderr, "fsn-master: %s%s%s: %s; fsn-master --help lists the options\n", option,
            value != NULL ? " " : "", shown, text);
    return EXIT_USAGE;
}

/** Reads a time with its unit; a bare number counts in `bare_ns`, and is rejected if that is 0. */
static bool read_time(const char *text, uint64_t bare_ns, uint64_t *time_ns) {
    static const struct {
        const char *unit;
        double ns;
    } units[] = {{"ns", 1}, {"us", 1e3}, {"ms", 1e6}, {"s", 1e9}, {"min", 6e10}, {"h", 3.6e12}};
    char *end = NULL;
    if (!isdigit((unsigned char)*text)) {
        return false;
    }
    const double number = strtod(text, &end);
    double unit = (double)bare_ns;
    for (size_t i = 0; *end != 0 && i < sizeof units / sizeof units[0]; i++) {
        if (strcmp(end, units[i].unit) == 0) {
            unit = units[i].ns;
            end += strlen(end);
        }
    }
    if (*end != 0 || !(unit > 0) || !(number * unit < 1e18)) {
        return false;
    }
    *time_ns = (uint64_t)(number * unit + 0.5);
    return true;
}

/** An option, and where its value goes. */
struct row {
    const char *name;
    int (*take)(const struct row *row, const char *text, struct options *o);
    size_t at;            /**< in struct options */
    uint64_t least, most; /**< of a number or a time */
    const char *rule;
    uint64_t bare_ns; /**< as in read_time() */
};

#define AT(field) .at = offsetof(struct options, field)

/** Returns -1 where a condition holds, else the exit code. */
static int require(bool holds, const struct row *row, const char *text, const char *rule) {
    char option[32];
    snprintf(option, sizeof option, "--%s", row->name);
    return holds ? -1 : options_wrong(option, text, rule);
}

static void *value_of(const struct row *row, struct options *o) {
    return (char *)o + row->at;
}

static int take_text(const struct row *row, const char *text, struct options *o) {
    *(const char **)value_of(row, o) = text;
    return -1;
}

static int take_flag(const struct row *row, const char *text, struct options *o) {
    (void)text;
    *(bool *)value_of(row, o) = true;
    return -1;
}

/** Takes a number into an int or an unsigned. */
static int take_number(const struct row *row, const char *text, struct options *o) {
    char *end = NULL;
    const unsigned long number = strtoul(text, &end, 10);
    *(int *)value_of(row, o) = (int)number;
    return require(isdigit((unsigned char)*text) && *end == 0 && number >= row->least &&
                       number <= row->most,
                   row, text, row->rule);
}

static int take_cpu(const struct row *row, const char *text, struct options *o) {
    const int code = take_number(row, text, o);
    return code != -1 ? code
                      : require(o->cpu++ < sysconf(_SC_NPROCESSORS_CONF), row, text,
                                "this machine has no such CPU");
}

static int take_time(const struct row *row, const char *text, struct options *o) {
    uint64_t *time_ns = value_of(row, o);
    const bool valid =
        read_time(text, row->bare_ns, time_ns) && *time_ns >= row->least && *time_ns <= row->most;
    return require(valid, row, text, row->rule);
}

static int take_log(const struct row *row, const char *text, struct options *o) {
    o->log_json = strcmp(text, "json") == 0;
    return require(o->log_json || strcmp(text, "text") == 0, row, text, "text or json");
}

static int take_clock(const struct row *row, const char *text, struct options *o) {
    o->dc_host = strcmp(text, "host") == 0;
    return require(o->dc_host || strcmp(text, "bus") == 0, row, text, "bus or host");
}

static int take_policy(const struct row *row, const char *text, struct options *o) {
    o->policy = POLICY_FIFO;
    while (o->policy < POLICY_OTHER && strcmp(text, policy_name(o->policy)) != 0) {
        o->policy++;
    }
    o->policy_given = true;
    return require(strcmp(text, policy_name(o->policy)) == 0, row, text, "fifo, deadline or other");
}

static int take_hash(const struct row *row, const char *text, struct options *o) {
    const size_t hex = strspn(text, "0123456789abcdefABCDEF");
    o->accepted = text;
    return require(hex == 2 * FSN_SHA256_BYTES && text[hex] == 0, row, text,
                   "a SHA-256 has 64 hexadecimal digits");
}

static int take_bus(const struct row *row, const char *text, struct options *o) {
    o->bus = text;
    return require(backend_is_known(text), row, text, "soem, igh or emulated");
}

static int take_interface(const struct row *row, const char *text, struct options *o) {
    if (o->interface_count == MOST_BUSES) {
        return require(false, row, text, "more than there can be buses");
    }
    o->interfaces[o->interface_count++] = text;
    o->interface = o->interfaces[0];
    return -1;
}

/** Reads NAME[:ROLE] of a user or group. */
static int take_allowed(const struct row *row, const char *text, struct options *o) {
    const bool group = row->at == offsetof(struct options, access.group);
    char name[256];
    const char *colon = strrchr(text, ':');
    const enum fsn_role role = colon != NULL ? fsn_role_of(colon + 1) : FSN_OBSERVER;
    const size_t len = colon != NULL ? (size_t)(colon - text) : strlen(text);
    if (role == FSN_NO_ROLE) {
        return require(false, row, text, "a role is observer, operator or maintainer");
    }
    snprintf(name, sizeof name, "%.*s", (int)(len < sizeof name ? len : sizeof name - 1), text);
    const struct passwd *user = group ? NULL : getpwnam(name);
    const struct group *members = group ? getgrnam(name) : NULL;
    if (user == NULL && members == NULL) {
        return require(false, row, text, group ? "unknown group" : "unknown user");
    }
    size_t *count = group ? &o->access.groups : &o->access.users;
    if (*count == FSN_CONTROL_ALLOWED) {
        return require(false, row, text, group ? "too many groups" : "too many; a group is better");
    }
    (group ? o->access.group : o->access.user)[(*count)++] =
        (struct fsn_control_allowed){.id = group ? members->gr_gid : user->pw_uid, .role = role};
    return -1;
}

static int take_help(const struct row *row, const char *text, struct options *o) {
    (void)row, (void)text, (void)o;
    fputs(usage_text, stdout);
    return EXIT_FINE;
}

static int take_version(const struct row *row, const char *text, struct options *o) {
    (void)row, (void)text, (void)o;
    backends_print(stdout);
    return EXIT_FINE;
}

enum { MS = 1000000, SECOND = 1000000000 };

static const struct row rows[] = {
    {"bus", .take = take_bus},
    {"interface", .take = take_interface},
    {"redundant", take_text, AT(redundant)},
    {"cycle", take_time, AT(cycle_ns), 50000, SECOND,
     "a time from 50us to 1s with its unit, e.g. 1ms; --free-run is faster"},
    {"policy", .take = take_policy},
    {"priority", take_number, AT(priority), 1, 99, "1 to 99"},
    {"cpu", take_cpu, AT(cpu), 0, 1023, "a CPU number from 0 on"},
    {"free-run", take_flag, AT(free_run)},
    {"xdp", take_flag, AT(xdp)},
    {"dc-every", take_number, AT(dc_every), 0, 1000000, "0 to 1000000 cycles"},
    {"dc-clock", .take = take_clock},
    {"dc-shift", take_time, AT(dc_shift_ns), 1, SECOND,
     "a time up to a bus cycle with its unit, e.g. 300us"},
    {"dc-window", take_time, AT(dc_window_ns), 100, MS,
     "a time from 100ns to 1ms with its unit, e.g. 1us"},
    {"duration", take_time, AT(run_ns), 1, UINT64_MAX, "a time above 0, e.g. 10s", SECOND},
    {"record", take_time, AT(record_ns), 0, UINT64_MAX, "a time, e.g. 10s; 0 keeps nothing",
     SECOND},
    {"wait", take_time, AT(wait_ns), 0, UINT64_MAX, "a time, e.g. 30s", SECOND},
    {"accepted", .take = take_hash},
    {"acceptance", take_text, AT(acceptance)},
    {"signers", take_text, AT(signers)},
    {"revoked", take_text, AT(revoked)},
    {"require-observed", take_flag, AT(require_observed)},
    {"take-over", take_flag, AT(take_over)},
    {"standby", take_flag, AT(standby)},
    {"socket", take_text, AT(socket)},
    {"allow-user", take_allowed, AT(access.user)},
    {"allow-group", take_allowed, AT(access.group)},
    {"incidents", take_text, AT(incidents)},
    {"incidents-limit", take_number, AT(incidents_mib), 1, 1000000, "1 to 1000000 MiB"},
    {"intervention-log", take_text, AT(interventions)},
    {"intervention-log-file", take_number, AT(interventions_mib), 1, 1000, "1 to 1000 MiB"},
    {"log", .take = take_log},
    {"trace", take_flag, AT(trace)},
    {"scan", take_flag, AT(scan)},
    {"version", .take = take_version},
    {"help", .take = take_help},
};
enum { ROWS = sizeof rows / sizeof rows[0], FIRST = 256 /* beyond the characters of getopt() */ };

int options_check(const struct options_rule *rules, size_t count) {
    for (size_t i = 0; i < count; i++) {
        if (rules[i].broken) {
            return options_wrong(rules[i].option, rules[i].value, rules[i].text);
        }
    }
    return -1;
}

/** A scan reads a single bus, with any SubDevices. */
static int check_plan(const struct options *o) {
    const bool second = o->take_over || o->standby;
    const struct options_rule rules[] = {
        {o->plan_file == NULL && !o->scan, "PLAN", NULL,
         "the plan is missing; fsoe-net plan NETWORK -o PLAN makes one"},
        {o->take_over && o->standby, "--standby", NULL,
         "either at once, with --take-over, or when the other stops"},
        {o->scan && o->plan_file != NULL, "--scan", o->plan_file,
         "looks at any bus and takes no plan"},
        {o->scan && o->interface_count > 1, "--scan", NULL, "reads one bus: give one --interface"},
        {o->scan && second, o->standby ? "--standby" : "--take-over", NULL,
         "goes with a plan, not with --scan"},
    };
    return options_check(rules, sizeof rules / sizeof rules[0]);
}

/** A bus that this build does not have is rejected later, by its name. */
static int check_bus(const struct options *o) {
    const struct fsn_backend *bus = backend_find(o->bus);
    const char *second = o->redundant;
    const struct options_rule rules[] = {
        {o->interface == NULL && (bus == NULL || bus->needs_interface), "--interface", NULL,
         "is missing"},
        {o->xdp && bus != NULL && !bus->takes_xdp, "--xdp", NULL, "this bus has no AF_XDP"},
        {o->xdp && (o->scan || o->take_over || o->standby), "--xdp", NULL,
         "is for a bus that this process starts"},
        {second != NULL && bus != NULL && !bus->takes_redundant, "--redundant", second,
         "this bus takes no second interface here"},
        {second != NULL && o->interface != NULL && strcmp(second, o->interface) == 0, "--redundant",
         second, "the same interface twice"},
    };
    return options_check(rules, sizeof rules / sizeof rules[0]);
}

static int check_rest(const struct options *o) {
    const bool deadline = o->policy == POLICY_DEADLINE;
    const struct options_rule rules[] = {
        {(o->acceptance == NULL) != (o->signers == NULL), "--acceptance", o->acceptance,
         "belongs together with --signers FILE"},
        {o->revoked != NULL && o->signers == NULL, "--revoked", o->revoked,
         "goes with --signers FILE"},
        {o->interventions == NULL && o->interventions_mib != INTERVENTIONS_MIB,
         "--intervention-log-file", NULL, "goes with --intervention-log DIR"},
        {o->priority != 0 && o->policy != POLICY_FIFO, "--priority", NULL,
         "only with --policy fifo"},
        {o->cpu != 0 && deadline, "--cpu", NULL,
         "a deadline thread cannot be pinned; isolate the CPU instead"},
        {o->free_run && deadline, "--free-run", NULL,
         "a deadline thread has a period; use --policy fifo"},
    };
    return options_check(rules, sizeof rules / sizeof rules[0]);
}

int options_read(int argc, char **argv, struct options *o) {
    struct option table[ROWS + 1] = {{0}};
    int id;
    for (int i = 0; i < ROWS; i++) {
        const bool alone =
            rows[i].take == take_flag || rows[i].take == take_version || rows[i].take == take_help;
        table[i] = (struct option){.name = rows[i].name, .has_arg = !alone, .val = FIRST + i};
    }
    o->bus = "soem"; /* needs no kernel module */
    o->record_ns = 10000000000u;
    o->incidents_mib = INCIDENTS_MIB;
    o->interventions_mib = INTERVENTIONS_MIB;
    while ((id = getopt_long(argc, argv, "", table, NULL)) != -1) {
        const struct row *row = id != '?' ? &rows[id - FIRST] : NULL;
        const int code = row != NULL ? row->take(row, optarg, o) : EXIT_USAGE;
        if (code != -1) {
            return code;
        }
    }
    if (optind + 1 < argc) {
        return options_wrong(argv[optind + 1], NULL, "one plan only");
    }
    o->plan_file = optind < argc ? argv[optind] : NULL;
    int code = check_plan(o);
    code = code == -1 ? check_bus(o) : code;
    return code == -1 ? check_rest(o) : code;
}
