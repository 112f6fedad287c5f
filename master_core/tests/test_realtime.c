/** Real-time clients, over a real socket and real memory: the data they read and own, the data they
 *  cannot reach whatever they write, and the effect of being late or gone. */
/* shows R20 */
#define _GNU_SOURCE

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include "control_host.h"
#include "core/clients.h"
#include "core/core_internal.h"
#include "emulated_rig.h"
#include "fsn/client.h"
#include "heap.h"
#include "rt/shared.h"

enum { MAIN_BYTES = 40, SUB_BYTES = 8, SYMBOLS = 11, FRAME = 6, WAIT_NS = 1000000 };

static struct {
    struct emulated_rig on;
    struct fsn_control *control;
    pthread_t thread;
    atomic_bool ends;
    char path[64];
    char logged[8192];
} rig;

/* -- a system that refuses -------------------------------------------------------------------- */

static int memfd_fails;     /**< number of the call, from now on; 0: none */
static bool takes_no_seals; /**< as an old kernel */
static bool has_no_size;

int memfd_create(const char *name, unsigned flags) {
    errno = EMFILE;
    if (memfd_fails > 0 && --memfd_fails == 0) {
        return -1;
    }
    return has_no_size ? open("/dev/null", O_RDWR | O_CLOEXEC)
                       : (int)syscall(SYS_memfd_create, name,
                                      takes_no_seals ? flags & ~MFD_ALLOW_SEALING : flags);
}

/* -- the server ------------------------------------------------------------------------------- */

static void *serve(void *argument) {
    (void)argument;
    while (!atomic_load(&rig.ends)) {
        struct pollfd fds[FSN_CONTROL_FDS];
        uint64_t wait_ns;
        const size_t count = fsn_control_prepare(rig.control, fds, &wait_ns);
        CHECK(poll(fds, (nfds_t)count, 1) >= 0);
        fsn_control_serve(rig.control, fds, count);
    }
    return NULL;
}

static void begin_serving(void) {
    atomic_store(&rig.ends, false);
    CHECK(pthread_create(&rig.thread, NULL, serve, NULL) == 0);
}

/** Afterwards this thread has the rights of the control thread. */
static void end_serving(void) {
    atomic_store(&rig.ends, true);
    CHECK(pthread_join(rig.thread, NULL) == 0);
}

static struct fsn_control_host host;

static void keep(void *self, enum fsn_log_level level, enum fsn_role account, const char *text,
                 const char *json, size_t json_bytes) {
    (void)account;
    (void)self;
    (void)level;
    (void)json;
    (void)json_bytes;
    const size_t used = strlen(rig.logged);
    snprintf(rig.logged + used, sizeof rig.logged - used, "%s\n", text);
}

/** A connection of 6-byte frames, a copy of two bytes, and values of every kind. */
static void set_up(void) {
    static const struct build_sm sm[2][2] = {{{1, MAIN_BYTES}, {2, MAIN_BYTES}},
                                             {{1, SUB_BYTES}, {2, SUB_BYTES}}};
    static const struct build_copy copies[] = {
        {0, 0, 1, 0, FRAME}, {1, 0, 0, 0, FRAME}, {0, 20, 1, 6, 2}};
    static const struct build_symbol symbols[SYMBOLS] = {
        {.sm = 0, .bit_offset = 96, .bits = 16, .stop_value = 7},
        {.sm = 0, .bit_offset = 112, .bits = 8, .restart_relevant = 1},
        {.sm = 0, .bit_offset = 120, .bits = 1, .kind = 1},
        {.sm = 0, .bit_offset = 128, .bits = 16, .kind = 2, .factor = 0.5, .offset = 1},
        {.sm = 0, .bit_offset = 147, .bits = 10},
        {.sm = 0, .bit_offset = 160, .bits = 32, .kind = 4},
        {.sm = 0, .bit_offset = 192, .bits = 64, .kind = 4, .factor = 2},
        {.sm = 0, .bit_offset = 256, .bits = 64},
        {.sm = 1, .bit_offset = 96, .bits = 32, .kind = 4},
        {.sm = 1, .bit_offset = 128, .bits = 16, .kind = 2, .factor = 0.25, .offset = -1},
        {.sm = 2, .bit_offset = 48, .bits = 16}};
    static const struct build_block blocks[] = {
        {0, 0, FRAME}, {1, 0, FRAME}, {2, 0, FRAME}, {3, 0, FRAME}};
    static const char *const names[SYMBOLS] = {"speed", "start",   "lamp",    "level",
                                               "odd",   "real.32", "real 64", "wide \"64\"",
                                               "speed", "height",  "copied"};
    const struct build build = {.subdevices = 2,
                                .sm = sm,
                                .copies = copies,
                                .pairs = 1,
                                .standard = 1,
                                .cycle_ns = 1000000,
                                .symbols = symbols,
                                .blocks = blocks,
                                .symbol_count = SYMBOLS,
                                .block_count = 4};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    for (uint32_t i = 0; i < SYMBOLS; i++) {
        bytes = build_name(bytes, &len, FSN_SEC_SYMBOL, i, names[i]);
    }
    build_fix_crc(bytes, len);
    char folder[] = "/tmp/fsn-rt-XXXXXX";
    CHECK(mkdtemp(folder) != NULL);
    rig.on = emulated_rig_load(bytes, len);
    snprintf(rig.path, sizeof rig.path, "%s/s", folder);
    rig.logged[0] = 0;
    host = test_host(NULL);
    host.log = keep;
    rig.control = fsn_control_create(rig.on.plan, &host, &nobody);
    CHECK(rig.control != NULL);
    fsn_control_attach(rig.control, rig.on.core);
    struct fsn_refusal refusal;
    CHECK(fsn_control_listen(rig.control, rig.path, &refusal) == FSN_OK);
    begin_serving();
}

static void tear_down(void) {
    end_serving();
    fsn_control_free(rig.control);
    emulated_rig_end(&rig.on);
    *strrchr(rig.path, '/') = 0;
    CHECK(rmdir(rig.path) == 0);
}

static void cycle(void) {
    emulated_rig_cycle(&rig.on);
}

/** Runs cycles until this many clients are in the cycle: the server thread sees an end in its turn.
 */
static void until_present(unsigned count) {
    while ((unsigned)__builtin_popcount(atomic_load(&rig.on.core->rt.clients.present)) != count) {
        usleep(200);
    }
}

/** Data on the bus after the last cycle. */
static uint64_t sent(uint32_t symbol) {
    struct fsn_symbol_info info;
    uint8_t image[2 * (MAIN_BYTES + SUB_BYTES)];
    uint64_t value;
    CHECK(fsn_plan_symbol(rig.on.plan, symbol, &info) == FSN_OK);
    CHECK(fsn_core_snapshot(rig.on.core, NULL, NULL, image) == FSN_OK);
    CHECK(fsn_core_read_symbol(rig.on.core, image, symbol, &value) == FSN_OK);
    return value;
}

/* -- clients ---------------------------------------------------------------------------------- */

static struct fsn_realtime_fault fault;

static fsn_status try_open(uint32_t misses, size_t count, const char *const *names,
                           struct fsn_realtime **client) {
    const struct fsn_realtime_options options = {
        .socket = rig.path, .outputs = names, .output_count = count, .misses = misses};
    return fsn_realtime_open(&options, client, &fault);
}

static struct fsn_realtime *open_client(uint32_t misses, size_t count, const char *const *names) {
    struct fsn_realtime *client;
    const fsn_status status = try_open(misses, count, names, &client);
    if (status != FSN_OK) {
        fprintf(stderr, "%s\n", fault.text);
    }
    CHECK(status == FSN_OK && client != NULL);
    return client;
}

static void close_client(struct fsn_realtime *client, unsigned left) {
    fsn_realtime_close(client);
    until_present(left);
}

static fsn_status wait_for(struct fsn_realtime *client) {
    return fsn_realtime_wait(client, WAIT_NS, NULL);
}

static void values_of_every_kind(void) {
    static const char *const names[] = {"speed", "real*", "l*", "odd", "wide \"64\""};
    set_up();
    struct fsn_realtime *client = open_client(3, 5, names);
    struct fsn_realtime_symbol info;
    CHECK(fsn_realtime_symbol_count(client) == SYMBOLS);
    CHECK(fsn_realtime_symbol(client, SYMBOLS, &info) == FSN_E_ARG);
    CHECK(fsn_realtime_symbol(client, 3, &info) == FSN_OK && strcmp(info.name, "level") == 0);
    CHECK(info.bits == 16 && info.kind == FSN_KIND_SIGNED && info.output && info.owned);
    CHECK(info.factor == 0.5 && info.offset == 1 && info.bit_offset == 128);
    CHECK(fsn_realtime_symbol(client, 1, &info) == FSN_OK && info.output && !info.owned);
    CHECK(fsn_realtime_symbol(client, 9, &info) == FSN_OK && !info.output && !info.owned);
    CHECK(fsn_realtime_output(client, "real 64") == 6);
    CHECK(fsn_realtime_input(client, "real 64") == FSN_REALTIME_NONE);
    CHECK(fsn_realtime_output(client, "real") == FSN_REALTIME_NONE);
    CHECK(fsn_realtime_output(client, "speed") == 0 && fsn_realtime_input(client, "speed") == 8);
    CHECK(fsn_realtime_cycle_ns(client) == 1000000);
    uint8_t in[MAIN_BYTES] = {0};
    fsn_put32(in + 12, 0xC0200000u); /* -2.5 */
    in[16] = 0xFE;                   /* -2 */
    in[17] = 0xFF;
    CHECK(fsn_emulated_write_inputs(rig.on.bus, 1, in, sizeof in) == FSN_OK);
    cycle();
    struct fsn_realtime_cycle seen;
    CHECK(fsn_realtime_wait(client, WAIT_NS, &seen) == FSN_OK);
    CHECK(seen.cycle == 1 && seen.now_ns == rig.on.now_ns && seen.skipped == 0);
    CHECK(seen.expected_wkc == seen.actual_wkc && seen.expected_wkc > 0 && seen.overruns == 0);
    CHECK(fsn_realtime_value(client, 8) == -2.5 && fsn_realtime_value(client, 9) == -1.5);
    CHECK(fsn_realtime_get(client, 9) == 0xFFFE && fsn_realtime_get(client, 99) == 0);
    CHECK(fsn_realtime_value(client, -1) == 0);
    CHECK(fsn_realtime_image_bytes(client) == 2 * (MAIN_BYTES + SUB_BYTES));
    CHECK(memcmp(fsn_realtime_image(client) + fsn_core_sm_base(rig.on.core, 1), in, sizeof in) ==
          0);
    CHECK(sent(0) == 7); /* none were sent yet */
    CHECK(fsn_realtime_set(client, 0, 300) == FSN_OK);
    CHECK(fsn_realtime_set_value(client, 2, 1) == FSN_OK);
    CHECK(fsn_realtime_set_value(client, 3, -8.4) == FSN_OK); /* -3.2, so -3 */
    CHECK(fsn_realtime_set(client, 4, UINT64_MAX) == FSN_OK);
    CHECK(fsn_realtime_set_value(client, 5, 1.5) == FSN_OK);
    CHECK(fsn_realtime_set_value(client, 6, 4.5) == FSN_OK);
    CHECK(fsn_realtime_set_value(client, 7, 4503599627370497.0) == FSN_OK);
    for (int32_t other = 8; other <= SYMBOLS; other++) {
        CHECK(fsn_realtime_set(client, other, 1) == FSN_E_CLOSED);
        CHECK(fsn_realtime_set_value(client, other, 1) == FSN_E_CLOSED);
    }
    CHECK(fsn_realtime_set_value(client, 3, 65533.0) == FSN_E_ARG);
    CHECK(fsn_realtime_set_value(client, 3, -65539.0) == FSN_E_ARG);
    CHECK(fsn_realtime_set_value(client, 0, -0.5) == FSN_E_ARG);
    CHECK(fsn_realtime_set_value(client, 0, 65535.5) == FSN_E_ARG);
    CHECK(fsn_realtime_set_value(client, 5, 1e300) == FSN_E_ARG);
    CHECK(fsn_realtime_set_value(client, 6, __builtin_nan("")) == FSN_E_ARG);
    CHECK(fsn_realtime_set_value(client, 7, 18446744073709551616.0) == FSN_E_ARG);
    cycle();
    CHECK(sent(0) == 7); /* nothing goes before it is sent */
    CHECK(wait_for(client) == FSN_OK);
    fsn_realtime_send(client);
    cycle();
    double wide = 9;
    uint64_t raw;
    memcpy(&raw, &wide, sizeof raw);
    CHECK(sent(0) == 300 && sent(2) == 1 && sent(3) == 0xFFFD && sent(4) == 0x3FF);
    CHECK(sent(5) == 0x3FC00000 && sent(6) == raw && sent(7) == 4503599627370497u);
    CHECK(sent(1) == 0);
    CHECK(wait_for(client) == FSN_OK);
    CHECK(fsn_realtime_value(client, 3) == -8 && fsn_realtime_value(client, 2) == 1);
    CHECK(fsn_realtime_value(client, 6) == 4.5 && fsn_realtime_value(client, 5) == 1.5);
    CHECK(wait_for(client) == FSN_E_BUSY);
    close_client(client, 0);
    cycle();
    CHECK(sent(0) == 7 && sent(2) == 0 && sent(3) == 0 && sent(4) == 0 && sent(7) == 0);
    tear_down();
}

static struct fsn_realtime_counts counts(struct fsn_realtime *client) {
    return fsn_realtime_counts(client);
}

static void on_time_late_and_gone(void) {
    static const char *const names[] = {"speed"};
    set_up();
    struct fsn_realtime *client = open_client(2, 1, names);
    struct fsn_realtime_cycle seen;
    for (int i = 0; i < 5; i++) {
        cycle(); /* who has sent nothing yet misses nothing */
    }
    CHECK(fsn_realtime_wait(client, WAIT_NS, &seen) == FSN_OK && seen.cycle == 5);
    CHECK(counts(client).missed == 0);
    CHECK(fsn_realtime_set(client, 0, 1000) == FSN_OK);
    fsn_realtime_send(client);
    cycle();
    CHECK(sent(0) == 1000 && counts(client).on_time == 1);
    CHECK(wait_for(client) == FSN_OK);
    cycle(); /* missed; the sent values stay */
    CHECK(sent(0) == 1000 && counts(client).missed == 1);
    CHECK(fsn_realtime_set(client, 0, 1001) == FSN_OK);
    fsn_realtime_send(client); /* answers the cycle before the last */
    cycle();
    CHECK(sent(0) == 1001 && counts(client).late == 1 && counts(client).on_time == 1);
    CHECK(fsn_realtime_wait(client, WAIT_NS, &seen) == FSN_OK && seen.skipped == 1);
    fsn_realtime_send(client);
    fsn_realtime_send(client); /* the last of several counts */
    cycle();
    CHECK(counts(client).on_time == 2 && counts(client).late == 1);
    cycle();
    cycle();
    CHECK(sent(0) == 1001 && counts(client).missed == 3);
    cycle(); /* the third in a row */
    CHECK(sent(0) == 7 && counts(client).missed == 4);
    fsn_realtime_send(client);
    cycle();
    CHECK(sent(0) == 7); /* until it opens again */
    CHECK(fsn_realtime_wait(client, WAIT_NS, &seen) == FSN_E_CLOSED && seen.cycle == 13);
    until_present(0);
    cycle();
    CHECK(sent(0) == 7);
    struct fsn_realtime *again = open_client(0, 1, names);
    cycle();
    CHECK(wait_for(again) == FSN_OK);
    CHECK(wait_for(client) == FSN_E_CLOSED); /* its place is gone */
    CHECK(fsn_realtime_set(again, 0, 5) == FSN_OK);
    fsn_realtime_send(again);
    fsn_realtime_send(client); /* into memory that is no longer read */
    cycle();
    CHECK(sent(0) == 5 && counts(again).on_time == 1);
    CHECK(wait_for(client) == FSN_E_CLOSED && wait_for(again) == FSN_OK);
    cycle(); /* no cycle may be missed */
    CHECK(sent(0) == 7);
    end_serving();
    CHECK(strstr(rig.logged, ", late: 1 output takes its stop value") != NULL);
    begin_serving();
    fsn_realtime_close(again);
    close_client(client, 0);
    fsn_realtime_close(NULL);
    tear_down();
}

/** When the next cycle begins: a client that sends until then is in time. */
static void the_next_cycle_is_announced(void) {
    set_up();
    struct fsn_realtime *client = open_client(0, 0, NULL);
    struct fsn_rt *rt = &rig.on.core->rt;
    struct fsn_realtime_cycle seen;
    const struct {
        uint64_t late_ns, left_out;
        bool free_run, follow_dc;
        uint64_t next_ns; /**< after its start */
    } cases[] = {{0, 0, false, false, 1000000},
                 {300, 0, false, false, 999700},
                 {1000300, 1, false, false, 999700},
                 {300, 0, false, true, 989700},
                 {0, 0, true, false, 0}};
    rt->cycle_ns = 1000000;
    rt->statistics.overruns = 5;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rt->late_ns = cases[i].late_ns;
        rt->left_out = cases[i].left_out;
        rt->free_run = cases[i].free_run;
        rt->follow_dc = cases[i].follow_dc;
        cycle();
        CHECK(fsn_realtime_wait(client, WAIT_NS, &seen) == FSN_OK);
        CHECK(seen.next_ns - seen.now_ns == cases[i].next_ns && seen.overruns == 5);
    }
    close_client(client, 0);
    tear_down();
}

/** Each of several clients for itself, whichever of them waits, writes or goes. */
static void several_at_once(void) {
    static const char *const names[] = {"speed", "lamp", "odd"};
    struct fsn_realtime *client[3];
    set_up();
    for (int i = 0; i < 3; i++) {
        client[i] = open_client(1000, 1, &names[i]);
    }
    CHECK(fsn_realtime_set(client[2], 4, 9) == FSN_OK);
    fsn_realtime_send(client[2]);
    cycle(); /* those before it wait */
    CHECK(sent(0) == 7 && sent(2) == 0 && sent(4) == 9);
    CHECK(fsn_realtime_set(client[0], 0, 5) == FSN_OK);
    CHECK(fsn_realtime_set(client[1], 2, 1) == FSN_OK);
    fsn_realtime_send(client[0]);
    fsn_realtime_send(client[1]);
    cycle();
    CHECK(sent(0) == 5 && sent(2) == 1 && sent(4) == 9);
    CHECK(counts(client[2]).missed == 1 && counts(client[0]).missed == 0);
    close_client(client[0], 2);
    cycle(); /* its memory is still there, but no longer used */
    CHECK(sent(0) == 7 && sent(2) == 1 && sent(4) == 9);
    fsn_realtime_close(client[1]);
    close_client(client[2], 0);
    tear_down();
}

/** Sends a line and returns the answer, with the descriptors; -1: none. */
static const char *request(int fd, const char *line, int fds[2]) {
    static char text[65536];
    union {
        struct cmsghdr head;
        char room[CMSG_SPACE(2 * sizeof(int))];
    } control;
    struct iovec piece = {text, sizeof text - 1};
    struct msghdr message = {.msg_iov = &piece,
                             .msg_iovlen = 1,
                             .msg_control = &control,
                             .msg_controllen = sizeof control};
    CHECK(write(fd, line, strlen(line)) == (ssize_t)strlen(line));
    const ssize_t got = recvmsg(fd, &message, 0);
    CHECK(got > 0);
    text[got] = 0;
    fds[0] = fds[1] = -1;
    const struct cmsghdr *c = CMSG_FIRSTHDR(&message);
    if (c != NULL) {
        memcpy(fds, CMSG_DATA(c), c->cmsg_len - CMSG_LEN(0));
    }
    return text;
}

static int connect_raw(void) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    snprintf(address.sun_path, sizeof address.sun_path, "%s", rig.path);
    CHECK(fd >= 0 && connect(fd, (struct sockaddr *)&address, sizeof address) == 0);
    return fd;
}

/** The outputs are mapped. */
static void begin_raw(int fd) {
    int fds[2];
    CHECK(strstr(request(fd, "realtime begin\n", fds), "\"begun\":true") != NULL);
}

static void refused(const char *line, const char *text) {
    int fds[2];
    const int fd = connect_raw();
    const char *got = request(fd, line, fds);
    if (strstr(got, text) == NULL || fds[0] != -1) {
        fprintf(stderr, "%s%s", line, got);
        CHECK(false);
    }
    close(fd);
}

static void who_does_not_fit_is_refused(void) {
    static const char *const speed[] = {"speed"};
    static const struct {
        const char *name;
        fsn_status status;
        const char *text;
    } wrong[] = {{"nothing", FSN_E_ARG, "no input or output is called nothing"},
                 {"nothing*", FSN_E_ARG, "no input or output begins with nothing"},
                 {"h*", FSN_E_ARG, "no writable output has this name"},
                 {"start", FSN_E_CLOSED, "start can restart a machine"},
                 {"height", FSN_E_CLOSED, "height is an input"},
                 {"copied", FSN_E_CLOSED, "copied belongs to a copy"},
                 {"speed", FSN_E_CLOSED, "speed is written by client 1"},
                 {"s*", FSN_E_CLOSED, "speed is written by client 1"}};
    int fds[2];
    set_up();
    struct fsn_realtime *first = open_client(1000, 1, speed);
    struct fsn_realtime *client;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        CHECK(try_open(3, 1, &wrong[i].name, &client) == wrong[i].status && client == NULL);
        CHECK(fault.status == wrong[i].status && strstr(fault.text, wrong[i].text) != NULL);
    }
    CHECK(try_open(1001, 0, NULL, &client) == FSN_E_ARG);
    const struct fsn_realtime_options other = {.socket = rig.path, .plan_sha256 = "00ff"};
    CHECK(fsn_realtime_open(&other, &client, &fault) == FSN_E_ARG);
    CHECK(strstr(fault.text, "the client was made for plan 00ff, loaded is ") != NULL);
    refused("realtime 3 any 3\n", "the client has layout 3 of the shared memory, fsn-master 2");
    refused("realtime x any 3\n", "the client has layout x");
    refused("realtime 2 any\n", "wrong number of words");
    refused("realtime begin\n", "this client has no outputs in the cycle");
    const int sealer = connect_raw();
    CHECK(strstr(request(sealer, "realtime 2 any 3 lamp\n", fds), "\"outputs\":1") != NULL);
    CHECK(fcntl(fds[1], F_ADD_SEALS, F_SEAL_SEAL) == 0 && close(fds[0]) == 0 && close(fds[1]) == 0);
    CHECK(strstr(request(sealer, "realtime begin\n", fds), "cannot be sealed") != NULL);
    close(sealer);
    const int fd = connect_raw();
    CHECK(strstr(request(fd, "set lamp=1\n", fds), "\"set\":1") != NULL);
    CHECK(strstr(request(fd, "realtime 2 any 3\n", fds), "writes outputs with set") != NULL);
    close(fd);
    const int second = connect_raw();
    CHECK(strstr(request(second, "realtime 2 any 3\n", fds), "\"outputs\":0") != NULL);
    CHECK(fds[0] >= 0 && fds[1] == -1 && close(fds[0]) == 0);
    begin_raw(second); /* it has begun already */
    CHECK(strstr(request(second, "lease 1\n", fds), "\"lease_ms\":1") != NULL);
    const int silent = connect_raw(); /* it never begins: its lease runs */
    CHECK(strstr(request(silent, "lease 1\n", fds), "\"lease_ms\":1") != NULL);
    CHECK(strstr(request(silent, "realtime 2 any 3 odd\n", fds), "\"outputs\":1") != NULL);
    CHECK(close(fds[0]) == 0 && close(fds[1]) == 0);
    static const char *const odd_one[] = {"odd"};
    while (try_open(3, 1, odd_one, &client) == FSN_E_CLOSED) {
        usleep(1000);
    }
    CHECK(client != NULL);
    close(silent);
    close_client(client, 2);
    CHECK(strstr(request(second, "realtime 2 any 3\n", fds), "in the cycle already") != NULL);
    CHECK(strstr(request(second, "set lamp=1\n", fds), "is in the cycle, and writes") != NULL);
    const char *status = request(second, "status\n", fds);
    CHECK(strstr(status, "\"in_cycle\":[{\"client\":1,\"outputs\":1,\"misses\":1000,\"state\":"
                         "\"waits\",\"on_time\":0,\"late\":0,\"missed\":0,\"torn\":0},{") != NULL);
    CHECK(strstr(status, "\"outputs\":0,\"misses\":3,\"state\":\"reads\"") != NULL);
    close(second);
    until_present(1);
    struct fsn_realtime *all[FSN_SHARED_CLIENTS - 1];
    for (int i = 0; i < FSN_SHARED_CLIENTS - 1; i++) {
        all[i] = open_client(0, 0, NULL);
        CHECK(counts(all[i]).on_time == 0);
        fsn_realtime_send(all[i]); /* nothing to send */
    }
    CHECK(try_open(0, 0, NULL, &client) == FSN_E_BUSY);
    CHECK(strstr(fault.text, "8 clients are in the cycle already: close one of them") != NULL);
    for (int i = 0; i < FSN_SHARED_CLIENTS - 1; i++) {
        fsn_realtime_close(all[i]);
    }
    close_client(first, 0);
    tear_down();
}

static void what_the_client_itself_refuses(void) {
    struct fsn_realtime *client = (void *)&rig;
    const struct fsn_realtime_options none = {.output_count = 1, .socket = "/no/such"};
    CHECK(fsn_realtime_open(&none, &client, &fault) == FSN_E_ARG && client == NULL);
    CHECK(fsn_realtime_open(NULL, &client, NULL) == FSN_E_ARG);
    CHECK(fsn_realtime_open(&none, NULL, NULL) == FSN_E_ARG);
    const struct fsn_realtime_options absent = {.socket = "/no/such"};
    CHECK(fsn_realtime_open(&absent, &client, &fault) == FSN_E_SYS && fault.sys_errno == ENOENT);
    char path[200];
    memset(path, 'x', sizeof path);
    path[199] = 0;
    const struct fsn_realtime_options too_long = {.socket = path};
    CHECK(fsn_realtime_open(&too_long, &client, &fault) == FSN_E_SYS);
    CHECK(fault.sys_errno == ENAMETOOLONG);
    set_up();
    static char name[9000];
    memset(name, 'x', sizeof name - 1);
    const char *const names[] = {NULL, name};
    CHECK(try_open(0, 1, names, &client) == FSN_E_ARG);
    CHECK(try_open(0, 1, names + 1, &client) == FSN_E_ARG);
    takes_no_seals = true;
    CHECK(try_open(0, 0, NULL, &client) == FSN_E_SYS);
    takes_no_seals = false;
    has_no_size = true;
    CHECK(try_open(0, 0, NULL, &client) == FSN_E_SYS);
    has_no_size = false;
    memfd_fails = 1;
    CHECK(try_open(0, 0, NULL, &client) == FSN_E_SYS);
    CHECK(strstr(fault.text, "no memory to share: ") != NULL);
    static const char *const speed[] = {"speed"};
    memfd_fails = 2;
    CHECK(try_open(0, 1, speed, &client) == FSN_E_SYS);
    close_client(open_client(0, 1, speed), 0); /* it is free again */
    end_serving();
    const struct fsn_realtime_options soon = {.socket = rig.path, .timeout_ms = 1};
    CHECK(fsn_realtime_open(&soon, &client, &fault) == FSN_E_BUSY);
    begin_serving();
    tear_down();
}

/* -- answers of another program -------------------------------------------------------------- */

static struct {
    int listener;
    const char *text;
    int fd[3];
    unsigned fds;
} odd;

/** Answers one request as given in `odd`, and disconnects. */
static void *answer_oddly(void *argument) {
    char request_line[512];
    const int fd = accept(odd.listener, NULL, NULL);
    CHECK(fd >= 0 && read(fd, request_line, sizeof request_line) > 0);
    union {
        struct cmsghdr head;
        char room[CMSG_SPACE(sizeof odd.fd)];
    } control = {0};
    const size_t fds_bytes = odd.fds * sizeof odd.fd[0];
    control.head = (struct cmsghdr){
        .cmsg_len = CMSG_LEN(fds_bytes), .cmsg_level = SOL_SOCKET, .cmsg_type = SCM_RIGHTS};
    memcpy(CMSG_DATA(&control.head), odd.fd, fds_bytes);
    /* Descriptors end a read: a long answer comes in two pieces. */
    const size_t all_bytes = strlen(odd.text);
    struct iovec piece = {(void *)odd.text, all_bytes < 5000 ? all_bytes : 5000};
    const struct msghdr message = {.msg_iov = &piece,
                                   .msg_iovlen = 1,
                                   .msg_control = &control,
                                   .msg_controllen = odd.fds > 0 ? CMSG_SPACE(fds_bytes) : 0};
    CHECK(piece.iov_len == 0 || sendmsg(fd, &message, MSG_NOSIGNAL) > 0);
    const size_t left_bytes = all_bytes - piece.iov_len;
    CHECK(left_bytes == 0 || send(fd, odd.text + piece.iov_len, left_bytes, MSG_NOSIGNAL) > 0);
    close(fd);
    return argument;
}

static int file_of(const void *bytes, size_t len_bytes, size_t size_bytes) {
    const int fd = (int)syscall(SYS_memfd_create, "odd", MFD_CLOEXEC);
    CHECK(fd >= 0 && ftruncate(fd, (off_t)size_bytes) == 0);
    CHECK(pwrite(fd, bytes, len_bytes, 0) == (ssize_t)len_bytes);
    return fd;
}

static void expect_odd(const char *path, const char *text, unsigned fds, fsn_status status) {
    static const char *const names[] = {"speed"};
    const struct fsn_realtime_options options = {
        .socket = path, .outputs = names, .output_count = fds > 1 ? 1 : 0};
    struct fsn_realtime *client;
    pthread_t thread;
    odd.text = text;
    odd.fds = fds;
    CHECK(pthread_create(&thread, NULL, answer_oddly, NULL) == 0);
    CHECK(fsn_realtime_open(&options, &client, &fault) == status && client == NULL);
    CHECK(pthread_join(thread, NULL) == 0 && fault.text[0] != 0);
}

static void odd_answers(void) {
    static const char yes[] = "{\"ok\":true}\n";
    char folder[] = "/tmp/fsn-rt-XXXXXX";
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    CHECK(mkdtemp(folder) != NULL);
    snprintf(address.sun_path, sizeof address.sun_path, "%s/s", folder);
    odd.listener = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    CHECK(bind(odd.listener, (const struct sockaddr *)&address, sizeof address) == 0);
    CHECK(listen(odd.listener, 1) == 0);
    struct fsn_shared_inputs in = {.magic = FSN_SHARED_MAGIC,
                                   .layout = FSN_SHARED_LAYOUT,
                                   .size_bytes = 4096,
                                   .symbols_at = sizeof in};
    odd.fd[0] = file_of(&in, sizeof in, 4096);
    odd.fd[1] = file_of("", 1, 4096);
    odd.fd[2] = odd.fd[1];
    static char long_line[20000];
    memset(long_line, ' ', sizeof long_line - 1);
    expect_odd(address.sun_path, "", 0, FSN_E_SYS);
    CHECK(fault.sys_errno == ECONNRESET);
    expect_odd(address.sun_path, long_line, 1, FSN_E_SYS);
    CHECK(fault.sys_errno == EMSGSIZE);
    expect_odd(address.sun_path, "not a word\n", 0, FSN_E_ARG);
    expect_odd(address.sun_path, "{\"ok\":false,\"error\":\"FSN_E_NOMEM\"}\n", 0, FSN_E_NOMEM);
    expect_odd(address.sun_path, "{\"ok\":false,\"text\":\"a \\\"b\\\" c\"}\n", 0, FSN_E_ARG);
    CHECK(strncmp(fault.text, "a \"b\" c: ", 9) == 0);
    expect_odd(address.sun_path, yes, 0, FSN_E_NOMEM); /* no memory came */
    expect_odd(address.sun_path, yes, 3, FSN_E_NOMEM); /* one too many */
    expect_odd(address.sun_path, yes, 2, FSN_E_NOMEM); /* invalid outputs */
    CHECK(pwrite(odd.fd[0], "x", 1, 0) == 1);
    expect_odd(address.sun_path, yes, 1, FSN_E_NOMEM); /* invalid inputs */
    CHECK(ftruncate(odd.fd[0], 4) == 0);
    expect_odd(address.sun_path, yes, 1, FSN_E_NOMEM); /* too short to be any */
    close(odd.fd[0]);
    close(odd.fd[1]);
    close(odd.listener);
    CHECK(unlink(address.sun_path) == 0 && rmdir(folder) == 0);
}

#ifdef FSN_TEST_HEAP
/** Whichever allocation fails, of the client or of the master: it is refused, and the next try is
 *  as good as the first. */
static void memory_runs_out(void) {
    static const char *const speed[] = {"speed"};
    set_up();
    struct fsn_realtime *client;
    bool said = false;
    long left = 0;
    for (long n = 1; left == 0; n++) {
        CHECK(n < 1000);
        heap.fails_in = n;
        const fsn_status status = try_open(3, 1, speed, &client);
        left = heap.fails_in; /* there were not so many */
        heap.fails_in = 0;
        CHECK((client != NULL) == (status == FSN_OK));
        CHECK(strstr(fault.text, "too long") == NULL && strstr(fault.text, "Success") == NULL);
        said = said || strstr(fault.text, "out of memory") != NULL;
        until_present(status == FSN_OK);
        if (status == FSN_OK) {
            close_client(client, 0);
        }
        usleep(500); /* the master has seen that the client left */
    }
    CHECK(said);
    tear_down();
}
#endif

static void what_the_core_itself_refuses(void) {
    set_up();
    end_serving();
    int fds[FSN_CLIENT_FDS];
    uint32_t place;
    const uint32_t absent = SYMBOLS;
    const uint32_t copied = SYMBOLS - 1;
    const struct fsn_core_client wrong[] = {{.symbols = &absent, .count = 1},
                                            {.symbols = &copied, .count = 1}};
    CHECK(fsn_core_client_open(rig.on.core, &wrong[0], &place, fds) == FSN_E_ARG);
    CHECK(fsn_core_client_open(rig.on.core, &wrong[1], &place, fds) == FSN_E_CLOSED);
    CHECK(fds[0] == -1 && fds[1] == -1);
    const uint32_t open = 0;
    const struct fsn_core_client writes = {.symbols = &open, .count = 1};
    CHECK(fsn_core_client_open(rig.on.core, &writes, &place, fds) == FSN_OK);
    CHECK(fsn_core_client_begin(rig.on.core, place) == FSN_OK);
    CHECK(fsn_core_client_begin(rig.on.core, place) == FSN_OK); /* it has begun */
    fsn_core_client_close(rig.on.core, place);
    close(fds[0]);
    close(fds[1]);
    /* No descriptor is left. */
    struct rlimit limit;
    CHECK(getrlimit(RLIMIT_NOFILE, &limit) == 0);
    const int next = dup(0);
    close(next);
    const struct rlimit none = {.rlim_cur = (rlim_t)next, .rlim_max = limit.rlim_max};
    CHECK(setrlimit(RLIMIT_NOFILE, &none) == 0);
    const struct fsn_core_client reads = {0};
    CHECK(fsn_core_client_open(rig.on.core, &reads, &place, fds) == FSN_E_SYS && errno == EMFILE);
    CHECK(fds[0] == -1 && fds[1] == -1);
    CHECK(setrlimit(RLIMIT_NOFILE, &limit) == 0);
    begin_serving();
    tear_down();
}

/** A reply waits after others; its descriptors wait with it. */
static void descriptors_go_with_their_reply(void) {
    int fds[2];
    char drain[4096];
    set_up();
    const int fd = connect_raw();
    const char *text = request(fd, "events on\nstatus\nrealtime 2 any 3 speed\nhello\n", fds);
    ssize_t got = (ssize_t)strlen(text);
    while (fds[0] < 0) { /* the first piece ends before the one with the descriptors */
        CHECK(got > 0 && strstr(text, "\"outputs\":1") == NULL);
        text = request(fd, "hello\n", fds);
    }
    CHECK(fds[1] >= 0 && strstr(text, "\"layout\":2") != NULL);
    close(fds[0]);
    close(fds[1]);
    CHECK(write(fd, "realtime 9 any 3\n", 17) == 17);
    do {
        got = read(fd, drain, sizeof drain - 1);
        CHECK(got > 0);
        drain[got] = 0;
    } while (strstr(drain, "the client has layout 9") == NULL);
    close(fd);
    until_present(0);
    tear_down();
}

/** The whole memory of the outputs is the client's to write. */
static void whatever_a_client_writes(void) {
    static const char *const theirs[] = {"level"};
    set_up();
    struct fsn_realtime *other = open_client(0, 1, theirs);
    const int fd = connect_raw();
    int fds[2];
    CHECK(strstr(request(fd, "realtime 2 any 1000 speed odd\n", fds), "\"outputs\":2") != NULL);
    CHECK(fds[0] >= 0 && fds[1] >= 0);
    const off_t in_bytes = lseek(fds[0], 0, SEEK_END);
    const off_t out_bytes = lseek(fds[1], 0, SEEK_END);
    /* The inputs are read-only, by any way. */
    CHECK(mmap(NULL, (size_t)in_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fds[0], 0) ==
          MAP_FAILED);
    void *in = mmap(NULL, (size_t)in_bytes, PROT_READ, MAP_SHARED, fds[0], 0);
    CHECK(in != MAP_FAILED && mprotect(in, (size_t)in_bytes, PROT_READ | PROT_WRITE) != 0);
    CHECK(pwrite(fds[0], "x", 1, 0) < 0 && ftruncate(fds[0], 0) != 0);
    CHECK(fallocate(fds[0], FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0, in_bytes) != 0);
    char path[64];
    snprintf(path, sizeof path, "/proc/self/fd/%d", fds[0]);
    const int again = open(path, O_RDWR | O_CLOEXEC);
    CHECK(again < 0 || (pwrite(again, "x", 1, 0) < 0 && close(again) == 0));
    CHECK(ftruncate(fds[1], 0) != 0 && ftruncate(fds[1], 2 * out_bytes) != 0);
    CHECK(fcntl(fds[1], F_ADD_SEALS, F_SEAL_WRITE) != 0);
    uint64_t *out = mmap(NULL, (size_t)out_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fds[1], 0);
    CHECK(out != MAP_FAILED);
    CHECK(fallocate(fds[1], FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0, out_bytes) == 0);
    begin_raw(fd);
    /* Removing pages of them now would make the cycle wait. */
    CHECK(fallocate(fds[1], FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0, out_bytes) != 0);
    CHECK(madvise(out, (size_t)out_bytes, MADV_REMOVE) != 0 && pwrite(fds[1], "x", 1, 0) < 0);
    CHECK(mmap(NULL, (size_t)out_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fds[1], 0) ==
          MAP_FAILED);
    struct fsn_shared_outputs *head = (void *)out;
    uint64_t state = 1;
    unsigned taken = 0;
    for (unsigned i = 0; i < 3000; i++) {
        for (size_t w = 0; w < (size_t)out_bytes / sizeof *out; w++) {
            out[w] = (uint64_t)next_random(&state) << 32 | next_random(&state);
        }
        if (i % 2 == 0) { /* so that some of it counts */
            atomic_store(&head->sent.begun, atomic_load(&head->sent.whole));
        }
        uint8_t frames[2 * (MAIN_BYTES + SUB_BYTES)];
        CHECK(fsn_realtime_set(other, 3, i) == FSN_OK);
        fsn_realtime_send(other);
        cycle();
        CHECK(wait_for(other) == FSN_OK);
        CHECK(fsn_core_snapshot(rig.on.core, NULL, NULL, frames) == FSN_OK);
        for (uint32_t sm = 0; sm < 4; sm += 2) { /* all bits but their own are unchanged */
            uint8_t *at = frames + fsn_core_sm_base(rig.on.core, sm);
            uint8_t expected[MAIN_BYTES] = {0};
            const uint32_t bytes = sm == 0 ? MAIN_BYTES : SUB_BYTES;
            if (sm == 0) {
                taken += (uint32_t)(at[12] | at[13] << 8) != 7;
                memset(at + 12, 0, 2);
                at[18] &= 0x07;
                at[19] &= 0xE0;
                expected[16] = (uint8_t)i;
                expected[17] = (uint8_t)(i >> 8);
            }
            CHECK(memcmp(at, expected, bytes) == 0);
        }
    }
    CHECK(taken > 1000);
    CHECK(counts(other).on_time == 3000 && counts(other).missed == 0);
    munmap(in, (size_t)in_bytes);
    munmap(out, (size_t)out_bytes);
    close(fds[0]);
    close(fds[1]);
    close(fd);
    until_present(1);
    cycle();
    CHECK(sent(0) == 7 && sent(4) == 0);
    close_client(other, 0);
    tear_down();
}

/** Half of a set is never taken. */
static void a_set_is_whole(void) {
    set_up();
    const int fd = connect_raw();
    int fds[2];
    CHECK(strstr(request(fd, "realtime 2 any 1000 speed odd\n", fds), "\"outputs\":2") != NULL);
    const off_t out_bytes = lseek(fds[1], 0, SEEK_END);
    struct fsn_shared_outputs *head =
        mmap(NULL, (size_t)out_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fds[1], 0);
    CHECK(head != MAP_FAILED);
    atomic_store(&head->sent.whole, 1);
    cycle();
    CHECK(sent(0) == 7); /* it has not begun */
    begin_raw(fd);
    atomic_store(&head->sent.begun, 3); /* the set of 1 is being overwritten */
    atomic_store(&head->sent.whole, 1);
    cycle();
    CHECK(sent(0) == 7);
    atomic_store(&head->sent.begun, 2); /* 2 is being written: 1 is whole */
    cycle();
    CHECK(sent(0) == 0);
    /* Accepted and rejected values are separate: half of a set changes nothing that is sent. */
    _Atomic uint64_t *set = (void *)((uint8_t *)head + head->sets_at);
    for (uint32_t number = 2; number < 6; number++) {
        atomic_store(set + 3 * (number % 2) + 1, 100 + number);
        atomic_store(&head->sent.whole, number);
        atomic_store(&head->sent.begun, number % 2 == 0 ? number : number + 2);
        cycle();
        CHECK(sent(0) == (number < 4 ? 102 : 104));
    }
    const char *status = request(fd, "status\n", (int[2]){0});
    CHECK(strstr(status, "\"state\":\"runs\"") != NULL && strstr(status, "\"torn\":3}") != NULL);
    munmap(head, (size_t)out_bytes);
    close(fds[0]);
    close(fds[1]);
    close(fd);
    until_present(0);
    tear_down();
}

static void a_stop_ends_it(void) {
    static const char *const speed[] = {"speed"};
    set_up();
    struct fsn_realtime *writes = open_client(1000, 1, speed);
    struct fsn_realtime *reads = open_client(0, 0, NULL);
    cycle();
    CHECK(wait_for(writes) == FSN_OK && wait_for(reads) == FSN_OK);
    CHECK(fsn_realtime_set(writes, 0, 9) == FSN_OK);
    fsn_realtime_send(writes);
    cycle();
    CHECK(sent(0) == 9);
    end_serving();
    fsn_control_close_outputs(rig.control);
    cycle();
    CHECK(sent(0) == 7);
    fsn_control_attach(rig.control, NULL);
    fsn_core_free(rig.on.core);
    rig.on.core = NULL;
    begin_serving();
    CHECK(wait_for(writes) == FSN_E_CLOSED);
    CHECK(wait_for(writes) == FSN_E_STATE);
    struct fsn_realtime *client;
    CHECK(try_open(0, 0, NULL, &client) == FSN_E_STATE);
    end_serving();
    fsn_control_free(rig.control);
    CHECK(wait_for(reads) == FSN_OK); /* cycles it has not seen yet */
    CHECK(wait_for(reads) == FSN_E_STATE);
    fsn_realtime_close(writes);
    fsn_realtime_close(reads);
    emulated_rig_end(&rig.on);
    *strrchr(rig.path, '/') = 0;
    CHECK(rmdir(rig.path) == 0);
}

int main(void) {
    const int files = open_files();
#ifdef FSN_TEST_HEAP
    memory_runs_out();
#endif
    what_the_client_itself_refuses();
    what_the_core_itself_refuses();
    odd_answers();
    descriptors_go_with_their_reply();
    values_of_every_kind();
    on_time_late_and_gone();
    the_next_cycle_is_announced();
    several_at_once();
    who_does_not_fit_is_refused();
    whatever_a_client_writes();
    a_set_is_whole();
    a_stop_ends_it();
    CHECK(open_files() == files);
    const long alive = heap_alive(); /* what libc keeps is kept by now */
    several_at_once();
    CHECK(heap_alive() == alive);
    return 0;
}
