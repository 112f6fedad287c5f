/** The command line of fsn-master. */
#ifndef FSN_APP_OPTIONS_H
#define FSN_APP_OPTIONS_H

#include <stdbool.h>
#include <stdint.h>

#include "control/server/control.h"

enum { EXIT_FINE = 0, EXIT_REFUSED = 1, EXIT_USAGE = 2, EXIT_ENVIRONMENT = 3, EXIT_DIFFERS = 4 };

enum {
    MOST_BUSES = 16,
    DEFAULT_PRIORITY = 80,  /**< of fifo */
    INCIDENTS_MIB = 1024,   /**< default limit of the incident files */
    INTERVENTIONS_MIB = 16, /**< default size of a file of the intervention log */
};

enum policy { POLICY_FIFO, POLICY_DEADLINE, POLICY_OTHER };

struct options {
    const char *plan_file, *bus, *interface, *redundant, *socket, *accepted, *incidents;
    const char *acceptance, *signers, *revoked; /**< acceptance record and its signers; or NULL */
    const char *acceptance_said;                /**< output of their check; NULL: not yet checked */
    const char *interventions;                  /**< folder of the intervention log; or NULL */
    const char *interfaces[MOST_BUSES];         /**< as given; `interface` is the first */
    size_t interface_count;
    const char *const *bus_interfaces; /**< of each bus of the plan; NULL if it has only one */
    uint64_t cycle_ns;                 /**< 0: that of the plan */
    uint64_t run_ns;                   /**< 0: until stopped */
    uint64_t record_ns;                /**< duration of recorded cycles; 0: none */
    uint64_t wait_ns;                  /**< how long to retry while SubDevices are missing */
    enum policy policy;
    bool policy_given;     /**< the program must not start without it */
    int priority;          /**< 1 … 99, of fifo */
    int cpu;               /**< CPU number + 1; 0: any */
    uint32_t dc_every;     /**< 0: as required by the plan */
    bool dc_host;          /**< this machine sets the clocks of the bus */
    uint64_t dc_shift_ns;  /**< required lead of frames before SYNC0; 0: half a cycle */
    uint64_t dc_window_ns; /**< permitted difference of clocks; 0: 1000 ns */
    int incidents_mib;     /**< maximum MiB of incident files */
    int interventions_mib; /**< of a file of the intervention log */
    bool free_run, trace, log_json;
    bool xdp;              /**< the cycle uses AF_XDP */
    bool require_observed; /**< parameters on the bus that differ from the plan are an alarm */
    bool standby;          /**< follows another process, and takes over when it stops */
    bool take_over;        /**< the bus of another process, without leaving OP */
    bool confine;          /**< drops unneeded privileges while it runs; set by main() */
    bool scan;             /**< scans the bus and ends, without a plan */
    struct fsn_control_access access;
};

/** Reads the command line.
 *  @return -1 to continue, otherwise the exit code, with the error printed. */
int options_read(int argc, char **argv, struct options *options);

static inline const char *policy_name(enum policy policy) {
    static const char *const name[] = {"fifo", "deadline", "other"};
    return name[policy];
}

/** Priority of the cyclic threads; 0: normal scheduling. */
static inline int options_priority(const struct options *options) {
    if (options->policy != POLICY_FIFO) {
        return 0;
    }
    return options->priority > 0 ? options->priority : DEFAULT_PRIORITY;
}

/** Reports an error of an option.   @return EXIT_USAGE. */
int options_wrong(const char *option, const char *value, const char *text);

/** Options that do not go together: the first broken rule is reported as by options_wrong(). */
struct options_rule {
    bool broken;
    const char *option, *value, *text;
};
/** @return -1 if no rule is broken, otherwise EXIT_USAGE. */
int options_check(const struct options_rule *rules, size_t count);

#endif
