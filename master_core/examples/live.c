/** A plan on a real EtherCAT interface, in a program of your own: live PLAN INTERFACE SECONDS. */
#define _POSIX_C_SOURCE 200809L

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "fsn/fsn.h"
#include "fsn/live.h"

static uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static struct fsn_plan *load(const char *path) {
    static uint8_t bytes[1 << 20];
    FILE *file = fopen(path, "rb");
    const size_t len = file == NULL ? 0 : fread(bytes, 1, sizeof bytes, file);
    if (file != NULL) {
        fclose(file);
    }
    struct fsn_plan *plan;
    struct fsn_fault fault;
    if (fsn_plan_load(bytes, len, &plan, &fault) != FSN_OK) {
        fprintf(stderr, "%s: %s\n", path, fault.rule);
        exit(1);
    }
    return plan;
}

static void print(struct fsn_core *core, const struct fsn_plan *plan) {
    for (uint32_t n = 0; n < fsn_plan_subdevice_count(plan); n++) {
        struct fsn_subdevice_info info;
        struct fsn_bus_subdevice seen;
        if (fsn_plan_subdevice(plan, n, &info) == FSN_OK &&
            fsn_core_subdevice(core, n, &seen) == FSN_OK) {
            printf("%-16s AL 0x%02x, %s %s\n", info.name, seen.al_status,
                   fsn_found_text(seen.found), seen.detail);
        }
    }
    struct fsn_statistics s;
    if (fsn_core_snapshot(core, &s, NULL, NULL) == FSN_OK) {
        printf("%llu cycles, %llu frames lost, %llu with a wrong working counter\n",
               (unsigned long long)s.cycles, (unsigned long long)s.counts.lost_frames,
               (unsigned long long)s.wkc_errors);
    }
}

int main(int argc, char **argv) {
    if (argc != 4) {
        fprintf(stderr, "usage: live PLAN INTERFACE SECONDS\n");
        return 2;
    }
    struct fsn_plan *plan = load(argv[1]);
    const struct fsn_backend *backend = fsn_backend_soem();
    const struct fsn_live_options options = {.interface = argv[2], .dc_every = 10};
    struct fsn_fault fault;
    struct fsn_core *core;
    void *bus;
    if (backend->create(&options, &bus, &fault) != FSN_OK ||
        fsn_core_create(plan, backend->ops, bus, &core, &fault) != FSN_OK) {
        fprintf(stderr, "%s: %s: %s\n", argv[2], fault.rule, fault.detail);
        return 1;
    }
    const struct fsn_thread_options thread = {.cycle_ns = 1000000, .priority = 80};
    if (fsn_core_start(core, &thread, &fault) != FSN_OK) {
        fprintf(stderr, "%s\n", fault.rule);
        return 1;
    }
    const uint64_t end = now_ns() + strtoull(argv[3], NULL, 10) * 1000000000u;
    const struct timespec pause = {.tv_nsec = 2000000};
    while (now_ns() < end) {
        fsn_core_poll(core, FSN_AL_OP, now_ns());
        nanosleep(&pause, NULL);
    }
    print(core, plan);
    /* Copies go on until every SubDevice has left OP. */
    for (int i = 0; i < 500 && !fsn_core_poll(core, FSN_AL_SAFEOP, now_ns()); i++) {
        nanosleep(&pause, NULL);
    }
    fsn_core_free(core);
    backend->free(bus);
    fsn_plan_free(plan);
    return 0;
}
