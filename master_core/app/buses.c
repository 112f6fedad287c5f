#include "app/master.h"

#include <stdio.h>
#include <string.h>

#include "fsn/several.h"

/** All buses of this program. */
static struct {
    const struct options *options;
    const struct fsn_plan *plan;
    const struct fsn_backend *of; /**< the backend of all buses */
    const char *interface[MOST_BUSES];
    uint32_t count;
    void *bus[MOST_BUSES];
    struct fsn_bus_ops ops;
    struct fsn_backend backend;
} all;

static void free_members(void) {
    for (uint32_t n = 0; n < all.count; n++) {
        all.of->free(all.bus[n]);
        all.bus[n] = NULL;
    }
}

static fsn_status create(const struct fsn_live_options *options, void **bus,
                         struct fsn_fault *fault) {
    const struct fsn_thread_options thread = {.priority = options_priority(all.options),
                                              .cpu = all.options->cpu,
                                              .follow_dc = true,
                                              .dc_shift_ns = all.options->dc_shift_ns};
    struct fsn_several_member members[MOST_BUSES];
    struct fsn_several *several = NULL;
    fsn_status status = FSN_OK;
    *bus = NULL;
    for (uint32_t n = 0; n < all.count && status == FSN_OK; n++) {
        struct fsn_live_options own = *options;
        struct fsn_bus_info info;
        status = fsn_plan_bus(all.plan, n, &info);
        own.interface = all.interface[n];
        own.cycle_ns = info.cycle_ns;
        if (status == FSN_OK) {
            status = all.of->create(&own, &all.bus[n], fault);
        }
        members[n] = (struct fsn_several_member){.ops = all.of->ops, .bus = all.bus[n]};
    }
    if (status == FSN_OK) {
        status = fsn_several_create(all.plan, members, &thread, &several);
    }
    if (status != FSN_OK) {
        free_members();
        return status;
    }
    all.ops = *fsn_several_ops(several);
    *bus = several;
    return FSN_OK;
}

static void free_all(void *bus) {
    if (bus != NULL) {
        fsn_several_free(bus);
        free_members();
    }
}

/** Assigns NAME=INTERFACE to its bus. */
static int assign(const char *text) {
    const char *behind = strchr(text, '=');
    for (uint32_t n = 0; behind != NULL && n < all.count; n++) {
        struct fsn_bus_info info;
        const size_t len = (size_t)(behind - text);
        if (fsn_plan_bus(all.plan, n, &info) == FSN_OK && strlen(info.name) == len &&
            memcmp(info.name, text, len) == 0) {
            if (all.interface[n] != NULL) {
                return options_wrong("--interface", text, "this bus has one already");
            }
            all.interface[n] = behind + 1;
            return -1;
        }
    }
    return options_wrong("--interface", text,
                         "this plan has several buses; write BUS=IF for each, with its name");
}

static int check_options(const struct options *o) {
    static const char one[] = "goes with a plan of one bus";
    const struct options_rule rules[] = {
        {o->redundant != NULL, "--redundant", o->redundant, one},
        {o->free_run, "--free-run", NULL, one},
        {o->take_over || o->standby, o->standby ? "--standby" : "--take-over", NULL, one},
        {o->policy == POLICY_DEADLINE, "--policy", "deadline", one},
        {o->cycle_ns != fsn_plan_cycle_ns(all.plan), "--cycle", NULL,
         "of several buses the plan states the cycles"},
    };
    return options_check(rules, sizeof rules / sizeof rules[0]);
}

static int check_interfaces(void) {
    for (uint32_t n = 0; n < all.count; n++) {
        struct fsn_bus_info info;
        const fsn_status status = fsn_plan_bus(all.plan, n, &info);
        if (status == FSN_OK && all.interface[n] == NULL && all.of->needs_interface) {
            char text[96];
            snprintf(text, sizeof text, "bus %.60s has none; --interface BUS=IF", info.name);
            return options_wrong("--interface", NULL, text);
        }
        for (uint32_t other = 0; other < n && all.interface[n] != NULL; other++) {
            if (all.interface[other] != NULL &&
                strcmp(all.interface[other], all.interface[n]) == 0) {
                return options_wrong("--interface", all.interface[n], "two buses on one interface");
            }
        }
    }
    return -1;
}

int buses_check_groups(const struct options *o, const struct fsn_plan *plan) {
    static const char text[] = "the plan has groups that may be absent";
    const bool groups = fsn_plan_group_count(plan) > 0;
    const struct options_rule rules[] = {
        {groups && o->redundant != NULL, "--redundant", NULL, text},
        {groups && o->standby, "--standby", NULL, text},
        {groups && o->take_over, "--take-over", NULL, text},
    };
    return options_check(rules, sizeof rules / sizeof rules[0]);
}

int buses_choose(struct options *options, const struct fsn_plan *plan,
                 const struct fsn_backend **backend) {
    const uint32_t count = fsn_plan_bus_count(plan);
    if (count == 1) {
        return options->interface_count > 1
                   ? options_wrong("--interface", options->interfaces[1], "the plan has one bus")
                   : -1;
    }
    if (count > MOST_BUSES) {
        return options_wrong("PLAN", NULL, "more than 16 buses");
    }
    all.options = options;
    all.plan = plan;
    all.of = *backend;
    all.count = count;
    int code = check_options(options);
    for (size_t n = 0; n < options->interface_count && code == -1; n++) {
        code = assign(options->interfaces[n]);
    }
    if (code == -1) {
        code = check_interfaces();
    }
    options->interface = all.interface[0];
    options->bus_interfaces = all.interface;
    all.backend = **backend;
    all.backend.ops = &all.ops;
    all.ops = (struct fsn_bus_ops){.name = (*backend)->ops->name, .poll = (*backend)->ops->poll};
    all.backend.create = create;
    all.backend.free = free_all;
    *backend = &all.backend;
    return code;
}
