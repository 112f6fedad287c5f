/** The cyclic part. It does not allocate or take a lock of this library; every call of ecrt.h is a
 *  system call. Those that touch the queue of datagrams share a lock with IgH's own thread in the
 *  kernel.
 *
 *  A signal may interrupt these calls: they are retried a few times. The program should block
 *  signals in the cyclic thread, as fsn-master does. */
#define _POSIX_C_SOURCE 200809L

#include "backends/igh/igh.h"

#include <string.h>

#include "rt/clock.h"

enum { TRIES = 8, NAP_NS = 50000, NS_PER_S = 1000000000 };

/** EtherCAT counts its time from the year 2000. */
static const uint64_t epoch_ns = UINT64_C(946684800) * NS_PER_S;

/* -- receiving ------------------------------------------------------------------------------ */

/** If this fails, no frame has arrived, and the domains show it. */
static void receive_frames(struct fsn_igh *bus) {
    int result = -EINTR;
    IGH_CALL(result, TRIES, ecrt_master_receive(bus->master));
}

/** Updates which domains are complete; returns whether all that were sent are. A domain that was
 *  not queued in the last send() has data of an earlier cycle, so it is not read. */
static bool poll_domains(struct fsn_igh *bus) {
    bool all = true;
    for (uint32_t a = 0; a < bus->area_count; a++) {
        struct igh_area *area = &bus->areas[a];
        ec_domain_state_t state = {0};
        area->complete = area->queued && ecrt_domain_process(area->domain) == 0 &&
                         ecrt_domain_state(area->domain, &state) == 0 &&
                         state.wc_state == EC_WC_COMPLETE;
        all = all && (area->complete || !area->queued);
    }
    return all;
}

/** ecrt.h does not wait for replies, so poll for them. */
static void collect(struct fsn_igh *bus) {
    const uint64_t end_ns = bus->wait_ns != 0 ? fsn_clock_ns(CLOCK_MONOTONIC) + bus->wait_ns : 0;
    for (;;) {
        receive_frames(bus);
        if (poll_domains(bus) || bus->wait_ns == 0 || fsn_clock_ns(CLOCK_MONOTONIC) >= end_ns) {
            return;
        }
        const struct timespec nap = {.tv_nsec = NAP_NS};
        clock_nanosleep(CLOCK_MONOTONIC, 0, &nap, NULL);
    }
}

static void move(struct fsn_igh *bus, uint32_t number, struct fsn_bus_input *input) {
    struct igh_area *area = &bus->areas[number];
    input->wkc[number] = (struct fsn_wkc){.expected = 1, .actual = area->complete};
    bus->nodes[area->node].answered = bus->nodes[area->node].answered || area->complete;
    if (area->output) {
        return;
    }
    input->sm_stale[area->sm] = !area->complete;
    if (area->complete) {
        memcpy(bus->bytes + area->image_byte, area->data, area->size_bytes);
    }
}

static void count_silence(struct fsn_igh *bus) {
    for (uint32_t n = 0; n < bus->all.count; n++) {
        struct igh_node *node = &bus->nodes[n];
        const uint32_t before = atomic_load_explicit(&node->silent, memory_order_relaxed);
        atomic_store_explicit(&node->silent, node->answered ? 0 : before + (before != UINT32_MAX),
                              memory_order_relaxed);
        node->answered = false;
    }
}

/** ecrt.h returns the lower 32 bits of the reference clock; the rest is taken from our own time,
 *  which follows it. */
static void read_clock(struct fsn_igh *bus, struct fsn_bus_input *input) {
    uint32_t low = 0;
    if (!bus->dc_requested || ecrt_master_reference_clock_time(bus->master, &low) != 0) {
        return;
    }
    bus->app_ns = fsn_clock_nearest(bus->app_ns, low);
    input->dc_time_ns = bus->app_ns;
}

void igh_receive(void *context, struct fsn_bus_input *input) {
    struct fsn_igh *bus = context;
    if (!bus->sent) {
        return;
    }
    collect(bus);
    bool any = bus->area_count == 0;
    for (uint32_t a = 0; a < bus->area_count; a++) {
        move(bus, a, input);
        any = any || bus->areas[a].complete;
    }
    /* IgH does not report the number of frames for the datagrams; if nothing returned, at least one
     * is lost. */
    input->counts.lost_frames = !any;
    count_silence(bus);
    if (any) { /* otherwise its library prints, in this thread, that the time has not returned */
        read_clock(bus, input);
    }
}

/* -- sending -------------------------------------------------------------------------------- */

static bool queue(const struct igh_area *area) {
    int result = -EINTR;
    IGH_CALL(result, TRIES, ecrt_domain_queue(area->domain));
    return result == 0;
}

/** The time of the application is that of the reference clock if it is known. The clock itself is
 *  never set: the cycle follows it (fsn_thread_options.follow_dc), and two clocks that follow each
 *  other would drift together. */
static void tell_time(struct fsn_igh *bus) {
    const uint64_t now_ns = fsn_clock_ns(CLOCK_MONOTONIC);
    if (bus->app_set_ns == 0) {
        /* SYNC0 is a whole number of cycles after the first time: this makes it the same as with
         * SOEM. */
        const uint64_t first_ns = fsn_clock_ns(CLOCK_REALTIME) - epoch_ns;
        bus->app_ns = first_ns - first_ns % bus->cycle_ns;
    } else {
        bus->app_ns += now_ns - bus->app_set_ns;
    }
    bus->app_set_ns = now_ns;
    (void)ecrt_master_application_time(bus->master, bus->app_ns);
    bus->dc_requested =
        bus->dc_every > 0 && bus->dc_left == 0 && ecrt_master_sync_slave_clocks(bus->master) == 0;
    bus->dc_left = bus->dc_left > 0 ? bus->dc_left - 1 : bus->dc_every - (bus->dc_every > 0);
}

void igh_send(void *context) {
    struct fsn_igh *bus = context;
    for (uint32_t a = 0; a < bus->area_count; a++) {
        struct igh_area *area = &bus->areas[a];
        if (area->output) {
            memcpy(area->data, bus->bytes + area->image_byte, area->size_bytes);
        }
        area->queued =
            atomic_load_explicit(&bus->nodes[area->node].admitted, memory_order_acquire) != 0 &&
            queue(area);
    }
    if (bus->uses_time) {
        tell_time(bus);
    }
    int result = -EINTR;
    IGH_CALL(result, TRIES, ecrt_master_send(bus->master));
    bus->sent = true;
}
