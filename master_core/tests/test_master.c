/** The life of fsn-master on a bus that has states, can be missing, wrong or slow. */
#define _GNU_SOURCE

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "app/base/explain.h"
#include "app/master.h"
#include "builder.h"
#include "fsn/emulated.h"

/** A bus that behaves as set, and remembers in which order it was used. */
static struct bus {
    struct fsn_emulated *memory;
    fsn_status refusal; /**< result of open(), `refusals` times */
    int sys_errno;
    unsigned refusals, opens, closes;
    bool stubborn; /**< never leaves OP */
    atomic_uint al_state, tends, sent;
    atomic_uint output;       /**< the byte after the frame, as last sent */
    unsigned output_at_leave; /**< the same when SAFEOP was requested */
    unsigned sent_at_leave, sent_at_close;
} bus;

static fsn_status bus_open(void *context, const struct fsn_plan *plan,
                           struct fsn_bus_layout *layout, struct fsn_fault *fault) {
    (void)context;
    bus.opens++;
    if (bus.refusals > 0) {
        bus.refusals--;
        *fault = (struct fsn_fault){.status = bus.refusal,
                                    .section = 1,
                                    .copy_index = 1,
                                    .sys_errno = bus.sys_errno,
                                    .rule = fsn_status_text(bus.refusal),
                                    .detail = "found vendor 2 product 3"};
        return bus.refusal;
    }
    CHECK(fsn_emulated_create(plan, &bus.memory) == FSN_OK);
    bus.al_state = FSN_AL_PREOP;
    return fsn_emulated_ops()->open(bus.memory, plan, layout, fault);
}

static void bus_receive(void *context, struct fsn_bus_input *input) {
    (void)context;
    fsn_emulated_ops()->receive(bus.memory, input);
}

static void bus_send(void *context) {
    uint8_t out[9];
    (void)context;
    fsn_emulated_ops()->send(bus.memory);
    if (fsn_emulated_read_outputs(bus.memory, 0, out, sizeof out, NULL) == FSN_OK) {
        bus.output = out[6];
    }
    bus.sent++;
}

static void bus_close(void *context) {
    (void)context;
    bus.closes++;
    bus.sent_at_close = bus.sent;
    fsn_emulated_ops()->close(bus.memory);
    fsn_emulated_free(bus.memory);
}

static bool bus_poll(void *context, uint8_t al_state, uint64_t now_ns) {
    (void)context;
    (void)now_ns;
    if (al_state == FSN_AL_SAFEOP && bus.sent_at_leave == 0) {
        bus.sent_at_leave = bus.sent;
    }
    if (al_state == FSN_AL_SAFEOP && bus.stubborn) {
        return false;
    }
    if (bus.al_state < al_state && ++bus.tends < 5) {
        return false; /* takes a while */
    }
    if (al_state == FSN_AL_SAFEOP && bus.sent < bus.sent_at_leave + 5) {
        return false;
    }
    if (al_state == FSN_AL_SAFEOP) {
        bus.output_at_leave = bus.output;
    }
    bus.al_state = al_state;
    return true;
}

static fsn_status bus_state(void *context, uint32_t subdevice, struct fsn_bus_subdevice *seen) {
    (void)context;
    (void)subdevice;
    *seen =
        (struct fsn_bus_subdevice){.al_status = (uint8_t)bus.al_state, .found = FSN_FOUND_RIGHT};
    return FSN_OK;
}

static const struct fsn_bus_ops ops = {.name = "test",
                                       .open = bus_open,
                                       .receive = bus_receive,
                                       .send = bus_send,
                                       .close = bus_close,
                                       .poll = bus_poll,
                                       .state = bus_state};

static fsn_status make(const struct fsn_live_options *options, void **context,
                       struct fsn_fault *fault) {
    (void)fault;
    CHECK(strcmp(options->interface, "if") == 0 && options->cycle_ns == 1000000);
    *context = &bus;
    return FSN_OK;
}

static void unmake(void *context) {
    (void)context;
}

static const struct fsn_backend backend = {
    .name = "test", .about = "for tests", .ops = &ops, .create = make, .free = unmake};

/** A run of the program in a thread, with its socket and a way to signal it. */
struct run {
    struct options options;
    struct fsn_plan *plan;
    char path[64];
    int signals[2];
    pthread_t thread;
    int code;
    int client;
};

static void *run_master(void *argument) {
    struct run *run = argument;
    run->code = master_run(&run->options, run->plan, &backend, run->path, run->signals[0], NULL,
                           NULL, NULL);
    return NULL;
}

static void begin(struct run *run, uint64_t wait_ns) {
    size_t len;
    uint8_t *bytes = build_full(&len); /* symbol 0, "t": outputs from bit 52 on, stop value 0x5A */
    *run = (struct run){.options = {.plan_file = "plan",
                                    .bus = "test",
                                    .interface = "if",
                                    .cycle_ns = 1000000,
                                    .wait_ns = wait_ns,
                                    .policy = POLICY_OTHER}};
    CHECK(fsn_plan_load(bytes, len, &run->plan, NULL) == FSN_OK);
    free(bytes);
    snprintf(run->path, sizeof run->path, "/tmp/fsn-test-%ld.sock", (long)getpid());
    CHECK(pipe(run->signals) == 0);
    CHECK(pthread_create(&run->thread, NULL, run_master, run) == 0);
}

static int end(struct run *run) {
    pthread_join(run->thread, NULL);
    CHECK(access(run->path, F_OK) != 0);
    close(run->signals[0]);
    close(run->signals[1]);
    fsn_plan_free(run->plan);
    return run->code;
}

static void send_signal(struct run *run) {
    const struct signalfd_siginfo info = {.ssi_signo = 15};
    CHECK(write(run->signals[1], &info, sizeof info) == (ssize_t)sizeof info);
}

/** Connects, trying again until the socket is there. */
static void connect_to(struct run *run) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    memcpy(address.sun_path, run->path, strlen(run->path) + 1);
    run->client = socket(AF_UNIX, SOCK_STREAM, 0);
    while (connect(run->client, (const struct sockaddr *)&address, sizeof address) != 0) {
        CHECK(errno == ENOENT || errno == ECONNREFUSED);
        usleep(1000);
    }
}

/** Asks; the reply is one line that fits. */
static void ask(struct run *run, const char *request, char *reply, size_t room) {
    size_t len = 0;
    CHECK(write(run->client, request, strlen(request)) == (ssize_t)strlen(request));
    do {
        CHECK(len + 1 < room);
        CHECK(read(run->client, reply + len, 1) == 1);
    } while (reply[len++] != '\n');
    reply[len] = 0;
}

static void ask_until(struct run *run, const char *request, const char *wanted) {
    char reply[8192] = "";
    while (strstr(reply, wanted) == NULL) {
        ask(run, request, reply, sizeof reply);
    }
}

static void it_waits_for_devices_and_stops_in_order(void) {
    struct run run;
    char reply[8192];
    bus = (struct bus){.refusal = FSN_E_BUS_MISSING, .refusals = 2};
    begin(&run, UINT64_C(600000000000));
    connect_to(&run);
    ask_until(&run, "status\n", "\"state\":\"running\"");
    CHECK(bus.opens == 3 && bus.al_state == FSN_AL_OP);
    ask(&run, "status\n", reply, sizeof reply);
    CHECK(strstr(reply, "\"subdevices\":{\"planned\":2,\"in_op\":2,\"missing\":0}") != NULL);
    ask(&run, "subdevices\n", reply, sizeof reply);
    CHECK(strstr(reply, "\"al\":\"OP\"") != NULL);
    CHECK(strstr(reply, "\"found_text\":\"the SubDevice of the plan\"") != NULL);
    ask(&run, "lease 0\n", reply, sizeof reply);
    ask(&run, "set t=255\n", reply, sizeof reply);
    ask_until(&run, "get t\n", "\"t\":255");
    send_signal(&run);
    CHECK(end(&run) == EXIT_FINE);
    close(run.client);
    /* The stop value, 0x5A from bit 4 on, was sent while they still were in OP. */
    CHECK((bus.output_at_leave & 0xF0) == 0xA0);
    CHECK(bus.al_state == FSN_AL_SAFEOP && bus.closes == 1);
    CHECK(bus.sent_at_close > bus.sent_at_leave);
}

static void a_bus_that_never_leaves_op_does_not_hold_it(void) {
    struct run run;
    bus = (struct bus){.stubborn = true};
    begin(&run, 0);
    connect_to(&run);
    ask_until(&run, "status\n", "\"state\":\"running\"");
    send_signal(&run);
    CHECK(end(&run) == EXIT_FINE && bus.closes == 1);
    close(run.client);
}

static void a_refusal_has_its_code(void) {
    static const struct {
        fsn_status refusal;
        int sys_errno, code;
    } rows[] = {{FSN_E_BUS_IDENTITY, 0, EXIT_REFUSED},
                {FSN_E_BUS_MISSING, 0, EXIT_REFUSED},
                {FSN_E_SYS, EPERM, EXIT_ENVIRONMENT},
                {FSN_E_SYS, ENODEV, EXIT_ENVIRONMENT}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct run run;
        bus =
            (struct bus){.refusal = rows[i].refusal, .sys_errno = rows[i].sys_errno, .refusals = 1};
        begin(&run, 0);
        CHECK(end(&run) == rows[i].code && bus.opens == 1 && bus.closes == 0);
    }
}

static void a_failed_start_later_is_told_and_mended(void) {
    struct run run;
    char reply[8192];
    bus = (struct bus){0};
    begin(&run, 0);
    connect_to(&run);
    ask_until(&run, "status\n", "\"state\":\"running\"");
    ask(&run, "stop\n", reply, sizeof reply);
    ask_until(&run, "status\n", "\"state\":\"stopped\"");
    bus.refusal = FSN_E_BUS_IDENTITY;
    bus.refusals = 1;
    ask(&run, "start\n", reply, sizeof reply);
    ask_until(&run, "status\n", "\"state\":\"failed\"");
    ask(&run, "status\n", reply, sizeof reply);
    CHECK(strstr(reply, "FSN_E_BUS_IDENTITY: SubDevice 1 (t): a SubDevice is not the one in the "
                        "plan: found vendor 2 product 3; compare the bus") != NULL);
    ask(&run, "start\n", reply, sizeof reply);
    ask_until(&run, "status\n", "\"state\":\"running\"");
    ask(&run, "shutdown\n", reply, sizeof reply);
    CHECK(end(&run) == EXIT_FINE && bus.closes == 2);
    close(run.client);
}

static void giving_up_to_wait(void) {
    struct run run;
    bus = (struct bus){.refusal = FSN_E_BUS_SILENT, .refusals = 1000000};
    begin(&run, UINT64_C(600000000000));
    connect_to(&run);
    ask_until(&run, "status\n", "\"state\":\"opening\"");
    send_signal(&run);
    CHECK(end(&run) == EXIT_FINE && bus.closes == 0);
    close(run.client);
}

int main(void) {
    it_waits_for_devices_and_stops_in_order();
    a_bus_that_never_leaves_op_does_not_hold_it();
    a_refusal_has_its_code();
    a_failed_start_later_is_told_and_mended();
    giving_up_to_wait();
    return 0;
}
