/** Leases over a socket: a silent client is detected by its unread data at the last poll, not by
 *  how long the control thread was away itself. No time passes here. */
/* shows R20 */
#define _GNU_SOURCE

#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "control_host.h"
#include "emulated_rig.h"

enum { LEASE_MS = 60000 };

struct rig {
    struct emulated_rig on;
    struct fsn_control *control;
    struct fsn_client *client;
    int peer; /**< the client's end */
    struct pollfd fds[FSN_CONTROL_FDS];
};

static void say(struct rig *rig, const char *line) {
    CHECK(write(rig->peer, line, strlen(line)) == (ssize_t)strlen(line));
}

/** Up to the poll: as if the lease ended at that very moment, and `late_ns` before it. */
static void look(struct rig *rig, uint64_t late_ns) {
    uint64_t wait_ns;
    CHECK(fsn_control_prepare(rig->control, rig->fds, &wait_ns) == FSN_CONTROL_FDS);
    rig->client->heard_ns = rig->control->polled_ns - LEASE_MS * UINT64_C(1000000) - late_ns;
    CHECK(poll(rig->fds, FSN_CONTROL_FDS, 0) >= 0);
}

static bool holds_its_output(struct rig *rig) {
    fsn_control_serve(rig->control, rig->fds, FSN_CONTROL_FDS);
    return fsn_outputs_state(rig->control->services.view.outputs, 0).owner == rig->client->number;
}

static struct fsn_control_host host;

static struct rig *set_up(void) {
    static const struct build_sm sm[2][2] = {{{1, 8}, {2, 8}}, {{1, 8}, {2, 8}}};
    static const struct build_symbol symbols[] = {{.sm = 0, .bits = 32}};
    const struct build build = {
        .subdevices = 2, .sm = sm, .cycle_ns = 1000000, .symbols = symbols, .symbol_count = 1};
    static struct rig rig;
    int ends[2];
    rig = (struct rig){.on = emulated_rig_build(&build)};
    host = test_host(NULL);
    rig.control = fsn_control_create(rig.on.plan, &host, &nobody);
    CHECK(rig.control != NULL);
    fsn_control_attach(rig.control, rig.on.core);
    CHECK(socketpair(AF_UNIX, SOCK_STREAM, 0, ends) == 0);
    rig.peer = ends[1];
    rig.client = &rig.control->client[0];
    *rig.client = (struct fsn_client){.fd = ends[0],
                                      .number = 1,
                                      .role = FSN_MAINTAINER,
                                      .lease_ms = LEASE_MS,
                                      .out.limit_bytes = FSN_CLIENT_OUT_BYTES};
    say(&rig, "set t=7\n");
    look(&rig, 0);
    CHECK(holds_its_output(&rig));
    return &rig;
}

static void tear_down(struct rig *rig) {
    close(rig->peer);
    fsn_control_free(rig->control);
    emulated_rig_end(&rig->on);
}

static void who_speaks_while_nobody_listens_was_not_silent(void) {
    struct rig *rig = set_up();
    look(rig, 0);
    say(rig, "hello\n"); /* the poll has not seen it, and by the clock the lease is over now */
    CHECK(holds_its_output(rig));
    look(rig, 1);
    CHECK(holds_its_output(rig)); /* it is read before anything is taken back */
    tear_down(rig);
}

static void who_says_nothing_loses_its_outputs(void) {
    struct rig *rig = set_up();
    look(rig, 1);
    CHECK(!holds_its_output(rig));
    say(rig, "set t=8\n"); /* it may go on */
    look(rig, 1);
    CHECK(holds_its_output(rig));
    tear_down(rig);
}

int main(void) {
    who_speaks_while_nobody_listens_was_not_silent();
    who_says_nothing_loses_its_outputs();
    return 0;
}
