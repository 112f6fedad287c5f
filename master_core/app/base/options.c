#include "app/base/options.h"

#include <ctype.h>
#include <getopt.h>
#include <grp.h>
#include <pwd.h>
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

static bool read_number(const char *text, long least, long most, long *number) {
    char *end = NULL;
    if (!isdigit((unsigned char)*text)) {
        return false;
    }
    *number = strtol(text, &end, 10);
    return *end == 0 && *number >= least && *number <= most;
}

static int read_policy(const char *text, struct options *o) {
    static const char *const name[] = {"fifo", "deadline", "other"};
    for (int i = 0; i < 3; i++) {
        if (strcmp(text, name[i]) == 0) {
            o->policy = (enum policy)i;
            o->policy_given = true;
            return -1;
        }
    }
    return options_wrong("--policy", text, "fifo, deadline or other");
}

static int read_hash(const char *text, struct options *o) {
    const size_t hex = strspn(text, "0123456789abcdefABCDEF");
    if (hex != 2 * FSN_SHA256_BYTES || text[hex] != 0) {
        return options_wrong("--accepted", text, "a SHA-256 has 64 hexadecimal digits");
    }
    o->accepted = text;
    return -1;
}

/** Reads NAME[:ROLE] of a user or group. */
static int allow(const char *option, const char *text, bool group, struct options *o) {
    char name[256];
    const char *colon = strrchr(text, ':');
    const enum fsn_role role = colon != NULL ? fsn_role_of(colon + 1) : FSN_OBSERVER;
    const size_t len = colon != NULL ? (size_t)(colon - text) : strlen(text);
    if (role == FSN_NO_ROLE) {
        return options_wrong(option, text, "a role is observer, operator or maintainer");
    }
    snprintf(name, sizeof name, "%.*s", (int)(len < sizeof name ? len : sizeof name - 1), text);
    const struct passwd *user = group ? NULL : getpwnam(name);
    const struct group *members = group ? getgrnam(name) : NULL;
    if (user == NULL && members == NULL) {
        return options_wrong(option, text, group ? "unknown group" : "unknown user");
    }
    size_t *count = group ? &o->access.groups : &o->access.users;
    if (*count == FSN_CONTROL_ALLOWED) {
        return options_wrong(option, text,
                             group ? "too many groups" : "too many; a group is better");
    }
    (group ? o->access.group : o->access.user)[(*count)++] =
        (struct fsn_control_allowed){.id = group ? members->gr_gid : user->pw_uid, .role = role};
    return -1;
}

static int take_interface(const char *text, struct options *o) {
    if (o->interface_count == MOST_BUSES) {
        return options_wrong("--interface", text, "more than there can be buses");
    }
    o->interfaces[o->interface_count++] = text;
    o->interface = o->interfaces[0];
    return -1;
}

static int read_log(const char *text, struct options *o) {
    if (strcmp(text, "text") != 0 && strcmp(text, "json") != 0) {
        return options_wrong("--log", text, "text or json");
    }
    o->log_json = strcmp(text, "json") == 0;
    return -1;
}

/** Returns -1 where a condition holds, else the exit code. */
static int require(bool holds, const char *option, const char *text, const char *rule) {
    return holds ? -1 : options_wrong(option, text, rule);
}

static int read_clock(const char *text, struct options *o) {
    o->dc_host = strcmp(text, "host") == 0;
    return require(o->dc_host || strcmp(text, "bus") == 0, "--dc-clock", text, "bus or host");
}

/* All options: identifier, name, argument. HELP is the last one, as take_plain() relies on it. */
#define OPTIONS(X)                                                                                 \
    X(BUS, "bus", required_argument)                                                               \
    X(INTERFACE, "interface", required_argument)                                                   \
    X(REDUNDANT, "redundant", required_argument)                                                   \
    X(CYCLE, "cycle", required_argument)                                                           \
    X(POLICY, "policy", required_argument)                                                         \
    X(PRIORITY, "priority", required_argument)                                                     \
    X(CPU, "cpu", required_argument)                                                               \
    X(FREE_RUN, "free-run", no_argument)                                                           \
    X(XDP, "xdp", no_argument)                                                                     \
    X(DC_EVERY, "dc-every", required_argument)                                                     \
    X(DC_CLOCK, "dc-clock", required_argument)                                                     \
    X(DC_SHIFT, "dc-shift", required_argument)                                                     \
    X(DC_WINDOW, "dc-window", required_argument)                                                   \
    X(DURATION, "duration", required_argument)                                                     \
    X(RECORD, "record", required_argument)                                                         \
    X(WAIT, "wait", required_argument)                                                             \
    X(ACCEPTED, "accepted", required_argument)                                                     \
    X(ACCEPTANCE, "acceptance", required_argument)                                                 \
    X(SIGNERS, "signers", required_argument)                                                       \
    X(REVOKED, "revoked", required_argument)                                                       \
    X(REQUIRE_OBSERVED, "require-observed", no_argument)                                           \
    X(TAKE_OVER, "take-over", no_argument)                                                         \
    X(STANDBY, "standby", no_argument)                                                             \
    X(SOCKET, "socket", required_argument)                                                         \
    X(ALLOW_USER, "allow-user", required_argument)                                                 \
    X(ALLOW_GROUP, "allow-group", required_argument)                                               \
    X(INCIDENTS, "incidents", required_argument)                                                   \
    X(INCIDENTS_LIMIT, "incidents-limit", required_argument)                                       \
    X(INTERVENTIONS, "intervention-log", required_argument)                                        \
    X(INTERVENTIONS_FILE, "intervention-log-file", required_argument)                              \
    X(LOG, "log", required_argument)                                                               \
    X(TRACE, "trace", no_argument)                                                                 \
    X(SCAN, "scan", no_argument)                                                                   \
    X(VERSION, "version", no_argument)                                                             \
    X(HELP, "help", no_argument)

enum option_id {
    NO_OPTION = 255, /* beyond the characters that getopt_long() returns */
#define OPTION_ID(id, name, argument) id,
    OPTIONS(OPTION_ID)
#undef OPTION_ID
};

static int take_number(int id, const char *text, struct options *o) {
    long number = 0;
    bool valid;
    switch (id) {
    case PRIORITY:
        valid = read_number(text, 1, 99, &number);
        o->priority = (int)number;
        return require(valid, "--priority", text, "1 to 99");
    case CPU:
        if (!read_number(text, 0, 1023, &number)) {
            return options_wrong("--cpu", text, "a CPU number from 0 on");
        }
        o->cpu = (int)number + 1;
        return require(number < sysconf(_SC_NPROCESSORS_CONF), "--cpu", text,
                       "this machine has no such CPU");
    case DC_EVERY:
        valid = read_number(text, 0, 1000000, &number);
        o->dc_every = (uint32_t)number;
        return require(valid, "--dc-every", text, "0 to 1000000 cycles");
    case INCIDENTS_LIMIT:
        return require(read_number(text, 1, 1000000, &o->incidents_mib), "--incidents-limit", text,
                       "1 to 1000000 MiB");
    default:
        return require(read_number(text, 1, 1000, &o->interventions_mib), "--intervention-log-file",
                       text, "1 to 1000 MiB");
    }
}

static int take_time(int id, const char *text, struct options *o) {
    enum { MS = 1000000, SECOND = 1000000000 };
    const struct {
        int id;
        uint64_t *time_ns;
        uint64_t bare_ns, least_ns, most_ns; /* bare_ns as in read_time() */
        const char *option, *rule;
    } times[] = {
        {CYCLE, &o->cycle_ns, 0, 50000, SECOND, "--cycle",
         "a time from 50us to 1s with its unit, e.g. 1ms; --free-run is faster"},
        {DC_SHIFT, &o->dc_shift_ns, 0, 1, SECOND, "--dc-shift",
         "a time up to a bus cycle with its unit, e.g. 300us"},
        {DC_WINDOW, &o->dc_window_ns, 0, 100, MS, "--dc-window",
         "a time from 100ns to 1ms with its unit, e.g. 1us"},
        {DURATION, &o->run_ns, SECOND, 1, UINT64_MAX, "--duration", "a time above 0, e.g. 10s"},
        {RECORD, &o->record_ns, SECOND, 0, UINT64_MAX, "--record",
         "a time, e.g. 10s; 0 keeps nothing"},
        {WAIT, &o->wait_ns, SECOND, 0, UINT64_MAX, "--wait", "a time, e.g. 30s"},
    };
    size_t i = 0;
    for (; i + 1 < sizeof times / sizeof times[0] && times[i].id != id; i++) {
    }
    const bool valid = read_time(text, times[i].bare_ns, times[i].time_ns) &&
                       *times[i].time_ns >= times[i].least_ns &&
                       *times[i].time_ns <= times[i].most_ns;
    return require(valid, times[i].option, text, times[i].rule);
}

/** Options whose text is stored unchanged, and those without one. */
static bool take_plain(int id, const char *text, struct options *o) {
    const char **const texts[HELP] = {
        [REDUNDANT] = &o->redundant,
        [SOCKET] = &o->socket,
        [INCIDENTS] = &o->incidents,
        [ACCEPTANCE] = &o->acceptance,
        [INTERVENTIONS] = &o->interventions,
        [SIGNERS] = &o->signers,
        [REVOKED] = &o->revoked,
    };
    bool *const flags[HELP] = {
        [FREE_RUN] = &o->free_run,
        [TRACE] = &o->trace,
        [TAKE_OVER] = &o->take_over,
        [REQUIRE_OBSERVED] = &o->require_observed,
        [STANDBY] = &o->standby,
        [SCAN] = &o->scan,
        [XDP] = &o->xdp,
    };
    if (texts[id] != NULL) {
        *texts[id] = text;
    } else if (flags[id] != NULL) {
        *flags[id] = true;
    }
    return texts[id] != NULL || flags[id] != NULL;
}

static int take(int id, const char *text, struct options *o) {
    /* Options that only store a text or a flag. */
    if (take_plain(id, text, o)) {
        return -1;
    }
    switch (id) {
    case BUS:
        o->bus = text;
        return require(backend_is_known(text), "--bus", text, "soem, igh or emulated");
    case INTERFACE:
        return take_interface(text, o);
    case POLICY:
        return read_policy(text, o);
    case ACCEPTED:
        return read_hash(text, o);
    case ALLOW_USER:
        return allow("--allow-user", text, false, o);
    case ALLOW_GROUP:
        return allow("--allow-group", text, true, o);
    case LOG:
        return read_log(text, o);
    case DC_CLOCK:
        return read_clock(text, o);
    case PRIORITY:
    case CPU:
    case DC_EVERY:
    case INCIDENTS_LIMIT:
    case INTERVENTIONS_FILE:
        return take_number(id, text, o);
    default:
        return take_time(id, text, o);
    }
}

/** A bus that this build does not have is rejected later, by its name. */
static int check_bus(const struct options *o) {
    const struct fsn_backend *bus = backend_find(o->bus);
    if (o->interface == NULL && (bus == NULL || bus->needs_interface)) {
        return options_wrong("--interface", NULL, "is missing");
    }
    if (o->xdp && bus != NULL && !bus->takes_xdp) {
        return options_wrong("--xdp", NULL, "this bus has no AF_XDP");
    }
    if (o->xdp && (o->scan || o->take_over || o->standby)) {
        return options_wrong("--xdp", NULL, "is for a bus that this process starts");
    }
    if (o->redundant == NULL) {
        return -1;
    }
    if (bus != NULL && !bus->takes_redundant) {
        return options_wrong("--redundant", o->redundant,
                             "this bus takes no second interface here");
    }
    return require(strcmp(o->redundant, o->interface) != 0, "--redundant", o->redundant,
                   "the same interface twice");
}

static int check_schedule(const struct options *o) {
    if (o->priority != 0 && o->policy != POLICY_FIFO) {
        return options_wrong("--priority", NULL, "only with --policy fifo");
    }
    if (o->cpu != 0 && o->policy == POLICY_DEADLINE) {
        return options_wrong("--cpu", NULL,
                             "a deadline thread cannot be pinned; isolate the CPU instead");
    }
    if (o->free_run && o->policy == POLICY_DEADLINE) {
        return options_wrong("--free-run", NULL,
                             "a deadline thread has a period; use --policy fifo");
    }
    return -1;
}

static int check_signed(const struct options *o) {
    if ((o->acceptance == NULL) != (o->signers == NULL)) {
        return options_wrong("--acceptance", o->acceptance, "belongs together with --signers FILE");
    }
    return require(o->revoked == NULL || o->signers != NULL, "--revoked", o->revoked,
                   "goes with --signers FILE");
}

static int check_interventions(const struct options *o) {
    return require(o->interventions != NULL || o->interventions_mib == INTERVENTIONS_MIB,
                   "--intervention-log-file", NULL, "goes with --intervention-log DIR");
}

/** A scan reads a single bus, with any SubDevices. */
static int check_scan(const struct options *o) {
    if (!o->scan) {
        return -1;
    }
    if (o->plan_file != NULL) {
        return options_wrong("--scan", o->plan_file, "looks at any bus and takes no plan");
    }
    if (o->interface_count > 1) {
        return options_wrong("--scan", NULL, "reads one bus: give one --interface");
    }
    if (o->take_over || o->standby) {
        return options_wrong(o->standby ? "--standby" : "--take-over", NULL,
                             "goes with a plan, not with --scan");
    }
    return -1;
}

static int check_together(const struct options *o) {
    if (o->plan_file == NULL && !o->scan) {
        return options_wrong("PLAN", NULL,
                             "the plan is missing; fsoe-net plan NETWORK -o PLAN makes one");
    }
    if (o->take_over && o->standby) {
        return options_wrong("--standby", NULL,
                             "either at once, with --take-over, or when the other stops");
    }
    static int (*const checks[])(const struct options *) = {check_scan, check_bus, check_signed,
                                                            check_interventions, check_schedule};
    int code = -1;
    for (size_t i = 0; i < sizeof checks / sizeof checks[0] && code == -1; i++) {
        code = checks[i](o);
    }
    return code;
}

int options_read(int argc, char **argv, struct options *o) {
    static const struct option table[] = {
#define OPTION_ROW(id, name, argument) {name, argument, NULL, id},
        OPTIONS(OPTION_ROW)
#undef OPTION_ROW
            {NULL, 0, NULL, 0},
    };
    int id;
    o->bus = "soem"; /* needs no kernel module */
    o->record_ns = 10000000000u;
    o->interventions_mib = INTERVENTIONS_MIB;
    while ((id = getopt_long(argc, argv, "", table, NULL)) != -1) {
        if (id == HELP) {
            fputs(usage_text, stdout);
            return EXIT_FINE;
        }
        if (id == VERSION) {
            backends_print(stdout);
            return EXIT_FINE;
        }
        const int code = id == '?' ? EXIT_USAGE : take(id, optarg, o);
        if (code != -1) {
            return code;
        }
    }
    if (optind + 1 < argc) {
        return options_wrong(argv[optind + 1], NULL, "one plan only");
    }
    o->plan_file = optind < argc ? argv[optind] : NULL;
    return check_together(o);
}
