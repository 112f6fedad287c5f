#define _GNU_SOURCE

#include "replies_rig.h"

#include <fcntl.h>
#include <sched.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "plan/plan_internal.h"

enum { MEMBERS = 5 };

static time_t later_s; /**< than all the other time of this test */

/** Nobody waits here for others. */
int sched_yield(void) {
    return 0;
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    *now = (struct timespec){.tv_sec = (clock == CLOCK_REALTIME ? 1700000000 : 1000) + later_s};
    return 0;
}

/* -- the plan -------------------------------------------------------------------------------- */

static struct fsn_plan *make_plan(void) {
    static const struct build_sm sm[SUBS][2] = {
        {{1, 30}, {2, 30}}, {{1, 6}, {2, 6}}, {{1, 6}, {2, 6}}};
    static const struct build_copy copies[] = {
        {0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}, {0, 6, 2, 0, 6}, {2, 0, 0, 6, 6}};
    static const struct build_symbol symbols[] = {
        {.sm = 0, .bit_offset = 96, .bits = 16, .stop_value = 7},
        {.sm = 0, .bit_offset = 112, .bits = 8, .restart_relevant = 1},
        {.sm = 0, .bit_offset = 120, .bits = 1, .kind = 1},
        {.sm = 0, .bit_offset = 128, .bits = 16, .kind = 2, .factor = 0.5, .offset = 1},
        {.sm = 1, .bit_offset = 96, .bits = 32, .kind = 4},
        {.sm = 1, .bit_offset = 128, .bits = 16, .kind = 2, .factor = 0.25, .offset = -1},
        {.sm = 1, .bit_offset = 144, .bits = 4}};
    static const struct build_block blocks[] = {{0, 0, 6}, {0, 6, 6}, {1, 0, 6}, {1, 6, 6},
                                                {2, 0, 6}, {3, 0, 6}, {4, 0, 6}, {5, 0, 6}};
    static const char *const names[] = {"speed",  "start", "lamp",     "level",
                                        "actual", "level", "two words"};
    const struct build build = {.subdevices = SUBS,
                                .sm = sm,
                                .copies = copies,
                                .pairs = 2,
                                .cycle_ns = 1000000,
                                .symbols = symbols,
                                .blocks = blocks,
                                .symbol_count = 7,
                                .block_count = 8};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    for (uint32_t i = 0; i < 7; i++) {
        bytes = build_name(bytes, &len, FSN_SEC_SYMBOL, i, names[i]);
    }
    bytes = build_name(bytes, &len, FSN_SEC_SUBDEVICE, 0, "logic");
    bytes = build_name(bytes, &len, FSN_SEC_SUBDEVICE, 1, "door");
    bytes = build_name(bytes, &len, FSN_SEC_SUBDEVICE, 2, "drive 2");
    bytes = build_name(bytes, &len, FSN_SEC_CONNECTION, 0, "door safe");
    bytes = build_name(bytes, &len, FSN_SEC_CONNECTION, 1, "drive safe");
    build_fix_crc(bytes, len);
    struct fsn_plan *plan;
    CHECK(fsn_plan_load(bytes, len, &plan, NULL) == FSN_OK);
    free(bytes);
    /* Of the second connection address and watchdog are known. */
    uint8_t *second =
        plan->bytes + plan->offset[FSN_SEC_CONNECTION] + fsn_record_bytes[FSN_SEC_CONNECTION];
    second[26] = 78;
    second[28] = 100;
    second[30] |= 6;
    struct fsn_connection_info info;
    CHECK(fsn_plan_connection(plan, 1, &info) == FSN_OK && info.known == 7);
    CHECK(info.address == 78 && info.watchdog_ms == 100);
    return plan;
}

/* -- the bus --------------------------------------------------------------------------------- */

struct replies_rig on;

static fsn_status bus_open(void *bus, const struct fsn_plan *plan, struct fsn_bus_layout *layout,
                           struct fsn_fault *fault) {
    (void)bus;
    (void)plan;
    (void)fault;
    *layout = (struct fsn_bus_layout){.image = on.image,
                                      .image_bytes = IMAGE,
                                      .sm_base = on.base,
                                      .datagram_begin = on.begin,
                                      .datagram_count = 1};
    return FSN_OK;
}

static void bus_receive(void *bus, struct fsn_bus_input *input) {
    (void)bus;
    struct fsn_wkc *wkc = input->wkc;
    uint8_t *stale = input->sm_stale;
    *input = on.input;
    input->wkc = wkc;
    input->sm_stale = stale;
    wkc[0] = on.wkc;
    stale[3] = on.wkc.actual < on.wkc.expected;
    for (uint32_t sub = 0; sub < SUBS; sub++) {
        memcpy(on.image + on.base[2 * sub + 1], on.frames + on.base[2 * sub + 1],
               sub == 0 ? 30 : 6);
    }
}

static void bus_send(void *bus) {
    (void)bus;
}

static bool bus_poll(void *bus, uint8_t al_state, uint64_t now_ns) {
    (void)bus;
    (void)al_state;
    (void)now_ns;
    return true;
}

static fsn_status bus_state(void *bus, uint32_t subdevice, struct fsn_bus_subdevice *seen) {
    (void)bus;
    *seen = on.seen[subdevice];
    return FSN_OK;
}

static uint32_t count_members(void *bus) {
    (void)bus;
    return MEMBERS;
}

static uint32_t place(void *bus, uint32_t subdevice) {
    (void)bus;
    return subdevice;
}

fsn_status member(void *bus, uint32_t position, struct fsn_bus_member *m) {
    (void)bus;
    static const struct fsn_bus_member members[MEMBERS] = {
        {.subdevice = 0,
         .station = 0x1001,
         .alias = 5,
         .mailbox = FSN_MAILBOX_COE | 0x22,
         .al_status = FSN_AL_OP,
         .has_dc = true,
         .ports = 3,
         .errors_known = true,
         .link = {1, 1},
         .link_lost = {2, 3},
         .rx_errors = {4, 5},
         .name = "by the bus"},
        {.subdevice = 1,
         .vendor_id = 9,
         .product_code = 8,
         .revision = 7,
         .serial = 6,
         .station = 0x1002,
         .al_status = FSN_AL_SAFEOP | FSN_AL_ERROR,
         .al_code = 0x1B,
         .ports = 5,
         .link = {1, 0, 1},
         .name = "EL1"},
        {.subdevice = 2,
         .vendor_id = 3,
         .product_code = 4,
         .station = 0x1003,
         .mailbox = FSN_MAILBOX_COE,
         .al_status = FSN_AL_PREOP},
        {.subdevice = FSN_NONE,
         .station = 0x1004,
         .mailbox = FSN_MAILBOX_COE,
         .al_status = FSN_AL_INIT,
         .ports = 1},
        {.subdevice = FSN_NONE}};
    *m = members[position];
    m->mailbox &= (uint16_t)~(on.no_coe ? FSN_MAILBOX_COE : 0);
    return position == 2 ? FSN_E_BUS_MISSING : m->al_status == 0 ? FSN_E_BUS_MISSING : FSN_OK;
}

/** Objects: position, index, subindex, bytes of the number, number. */
static const uint32_t objects[][5] = {
    {0, 0x1018, 1, 4, 0x12345678}, {0, 0x1018, 2, 2, 0xFFFE},     {0, 0x1008, 0, 3, 0x434241},
    {0, 0x1C12, 0, 1, 1},          {0, 0x1C12, 1, 2, 0x1600},     {0, 0x1600, 0, 1, 2},
    {0, 0x1600, 1, 4, 0x70000108}, {0, 0x1600, 2, 4, 0x70000210}, {0, 0x1C13, 0, 1, 2},
    {0, 0x1C13, 1, 2, 0x1A00},     {0, 0x1A00, 0, 1, 3},          {0, 0x1A00, 1, 4, 0x60100108},
    {0, 0x1A00, 2, 4, 0x60200108}, {0, 0x1A00, 3, 4, 0x60300108}, {0, 0x9021, 0, 1, 4},
    {0, 0x9021, 2, 2, 77},         {0, 0x9021, 3, 2, 9},          {0, 0x9021, 4, 2, 60},
    {0, 0x9031, 0, 1, 6},          {0, 0x9031, 2, 2, 0},          {0, 0x9031, 3, 2, 10},
    {0, 0x9031, 4, 2, 70},         {0, 0x9031, 6, 1, 2},          {0, 0xF980, 0, 1, 2},
    {0, 0xF980, 1, 2, 77},         {0, 0xF980, 2, 2, 78},         {0, 0xA000, 1, 2, 0x66},
    {2, 0x1C00, 0, 1, 4},          {2, 0x1C00, 1, 1, 1},          {2, 0x1C00, 2, 1, 2},
    {2, 0x1C00, 3, 1, 3},          {2, 0x1C00, 4, 1, 9},          {2, 0x1C12, 0, 1, 2},
    {2, 0x1C12, 1, 2, 0x1601},     {2, 0x1008, 0, 5, 0x44434241}, {2, 0x1601, 0, 1, 1},
    {2, 0x1601, 1, 4, 0x67700108}, {0, 0x9001, 0, 1, 6},          {0, 0x9001, 2, 2, 78},
    {0, 0x9001, 3, 2, 1},          {0, 0x9001, 4, 2, 100},        {0, 0x9001, 6, 1, 1},
    {0, 0x9011, 0, 1, 4},          {0, 0x9011, 2, 2, 79},         {0, 0x9011, 3, 2, 2},
    {0, 0x9011, 4, 2, 50},         {2, 0x6791, 0, 1, 4},          {2, 0x6791, 2, 2, 80},
    {2, 0x6791, 3, 2, 3},          {2, 0xEA00, 1, 2, 5},          {2, 0xE901, 0, 1, 6},
    {2, 0xE901, 2, 2, 80},         {2, 0xE901, 3, 2, 3},          {2, 0xE901, 6, 1, 0},
    {2, 0xE911, 0, 1, 6},          {2, 0xE911, 2, 2, 81},         {2, 0xE911, 3, 2, 4},
    {2, 0xE911, 6, 1, 1},          {2, 0xE9F1, 0, 1, 3},          {2, 0xE9F1, 3, 2, 5},
    {2, 0xEA01, 0, 1, 3},          {2, 0xEA01, 3, 2, 6},
};

static fsn_status upload(void *bus, struct fsn_transfer *t) {
    (void)bus;
    later_s += on.takes_s;
    const size_t used = strlen(on.read);
    snprintf(on.read + used, sizeof on.read - used, " %u/%x:%x", t->position, t->index, t->sub);
    if (on.fails != FSN_OK) {
        t->abort_code = on.fails == FSN_E_BUS_SDO ? 0x06010002 : 0;
        return on.fails;
    }
    if (t->position == 0 && t->index == 0x10F3 && t->sub >= 6 && t->sub <= 8) {
        static const uint8_t message[] = {0x11, 0x22, 0x33, 0x44, 0, 0, 0x78, 0x56,
                                          1,    0,    0,    0,    0, 0, 0,    0};
        memcpy(t->data, message, sizeof message);
        t->data[4] = t->sub;
        t->size_bytes = sizeof message;
        return t->sub == 8 ? FSN_E_BUS_SDO : FSN_OK;
    }
    if (t->position == 0 && t->index == 0x10F3 && t->sub < 3) {
        t->data[0] = on.history[t->sub - 1];
        t->size_bytes = 1;
        return FSN_OK;
    }
    if (on.count_of != 0 && t->index == on.count_of && t->sub == 0) {
        t->data[0] = (uint8_t)on.count;
        t->size_bytes = 1;
        return FSN_OK;
    }
    for (size_t i = 0; i < sizeof objects / sizeof objects[0]; i++) {
        const uint32_t *o = objects[i];
        if (o[0] == t->position && o[1] == t->index && o[2] == t->sub) {
            for (uint32_t b = 0; b < o[3]; b++) {
                t->data[b] = (uint8_t)(b < 4 ? o[4] >> (8 * b) : 0x45);
            }
            t->size_bytes = o[3];
            return FSN_OK;
        }
    }
    t->abort_code = 0x06020000;
    return FSN_E_BUS_SDO;
}

static fsn_status download(void *bus, struct fsn_transfer *t) {
    (void)bus;
    CHECK(t->size_bytes <= sizeof on.written);
    memcpy(on.written, t->data, t->size_bytes);
    on.written_bytes = t->size_bytes;
    t->abort_code = 0x08000022;
    return on.fails;
}

static fsn_status sii_read(void *bus, uint32_t position, uint32_t offset, uint8_t *data,
                           uint32_t size_bytes) {
    (void)bus;
    if (position != 0 && position != 3) {
        return FSN_E_BUS_MISSING;
    }
    memset(data, position == 0 ? 0xFF : 0, size_bytes); /* erased after its end */
    for (uint32_t i = 0; position == 0 && i < size_bytes && offset + i < SII_BYTES; i++) {
        data[i] = on.sii[offset + i];
    }
    return position == 3 && offset >= 0x40 ? FSN_E_BUS_MISSING : on.fails;
}

static fsn_status sii_write(void *bus, uint32_t position, uint32_t offset, uint16_t word) {
    (void)bus;
    CHECK(position == 0);
    on.sii[offset] = (uint8_t)word;
    on.sii[offset + 1] = (uint8_t)(word >> 8);
    return FSN_OK;
}

static fsn_status bus_pdo(void *bus, uint32_t position, uint8_t sm, uint32_t pdo, uint16_t *index,
                          bool *output, uint32_t *entries, uint32_t room, uint32_t *count) {
    (void)bus;
    if (position != 1 || (sm != 2 && sm != 3) || pdo > 0) {
        return FSN_E_ARG;
    }
    CHECK(room == 255);
    *index = (uint16_t)(sm == 2 ? 0x1602 : 0x1A02);
    *output = sm == 2;
    *count = 2;
    entries[0] = 0x70000101;
    entries[1] = 0x00000007;
    return FSN_OK;
}

static size_t category(size_t at, uint16_t type, const void *bytes, size_t len) {
    on.sii[at] = (uint8_t)type;
    on.sii[at + 2] = (uint8_t)(len / 2);
    memcpy(on.sii + at + 4, bytes, len);
    return at + 4 + len;
}

static void make_sii(void) {
    static const uint8_t strings[] = {3, 5, 'l', 'o', 'g', 'i', 'c', 2, 'R', 'x', 2, 'T', 'x', 0};
    static const uint8_t general[] = {0, 0, 9, 1};
    static const uint8_t sms[] = {
        0,    0x10, 0x80, 0, 0x26, 0,    1, 1, 0x80, 0x10, 0x80, 0, 0x22, 0, 1, 0, 0, 0x11, 9, 0,
        0x24, 0,    1,    0, 0,    0x12, 9, 0, 0x20, 0,    1,    4, 0,    0, 0, 0, 0, 0,    0, 0};
    static const uint8_t inputs[] = {0, 0x1A, 1, 3, 0, 3, 0, 0, 0x10, 0x60, 1, 0, 0, 8, 0, 0};
    static const uint8_t outputs[] = {0, 0x16, 0, 2, 0, 2, 0, 0};
    for (size_t i = 0; i < SII_BYTES; i++) {
        on.sii[i] = (uint8_t)(i < 0x80 ? 0x10 + i : 0xFF);
    }
    memset(on.sii + 0x80, 0, SII_BYTES - 0x80);
    size_t at = category(0x80, 10, strings, sizeof strings);
    at = category(at, 30, general, sizeof general);
    at = category(at, 41, sms, sizeof sms);
    at = category(at, 50, inputs, sizeof inputs);
    at = category(at, 51, outputs, sizeof outputs);
    on.sii[at] = on.sii[at + 1] = 0xFF;
}

/* -- the program around ------------------------------------------------------------------------ */

static bool between(void *self) {
    (void)self;
    return on.goes_on;
}

struct fsn_job *waiting;

void submit(void *self, struct fsn_job *job) {
    (void)self;
    CHECK(waiting == NULL);
    waiting = job;
}

struct fsn_job_context context_of(void) {
    return (struct fsn_job_context){.core = on.core,
                                    .ops = &on.ops,
                                    .bus = &on,
                                    .plan = on.plan,
                                    .interface = "eth0",
                                    .between = between};
}

void do_job(void) {
    const struct fsn_job_context context = context_of();
    struct fsn_job *job = waiting;
    waiting = NULL;
    if (job != NULL) {
        fsn_job_run(job, &context);
        later_s = 0;
        fsn_control_job_done(on.control, job);
    }
}

static void host_state(void *self, struct fsn_control_status *status) {
    (void)self;
    *status = (struct fsn_control_status){.state = FSN_PROGRAM_RUNNING,
                                          .fault = on.stateless ? "the cable is out" : NULL,
                                          .backend = "script",
                                          .interface = "eth0",
                                          .redundant = on.stateless ? "eth1" : NULL,
                                          .xdp = on.stateless,
                                          .plan_file = "the.fsnplan",
                                          .accepted = on.stateless ? "ABCD-EF" : NULL,
                                          .policy = "fifo",
                                          .started_ns = UINT64_C(400000000000),
                                          .cycle_ns = 1000000,
                                          .cpu = on.stateless ? 3 : 0,
                                          .priority = 80,
                                          .free_run = on.stateless};
}

static bool bus_ring(void *bus, struct fsn_bus_ring *ring) {
    (void)bus;
    *ring = (struct fsn_bus_ring){
        .state = FSN_RING_ONE_WAY, .ways = {0, 1}, .breaks = 2, .place = "between logic and door"};
    return on.stateless;
}

static bool bus_clocks(void *bus, struct fsn_bus_clocks *clocks) {
    (void)bus;
    static const char *const places[] = {[FSN_CLOCKS_APART] = "door is 21480 ns from logic",
                                         [FSN_CLOCKS_LOST] =
                                             "the time of logic does not come back"};
    *clocks = (struct fsn_bus_clocks){.state = on.clocks,
                                      .host = true,
                                      .subdevices = 2,
                                      .outside = 1,
                                      .leaves = 3,
                                      .window_ns = 1000,
                                      .worst_ns = 21480,
                                      .shift_ns = 500000,
                                      .lead_ns = 499000,
                                      .reference = "logic"};
    if (places[on.clocks] != NULL) {
        snprintf(clocks->place, sizeof clocks->place, "%s", places[on.clocks]);
    }
    return on.stateless;
}

static fsn_status host_request(void *self, enum fsn_program_request request,
                               struct fsn_refusal *refusal) {
    (void)self;
    return request != FSN_PROGRAM_RESTART
               ? FSN_OK
               : fsn_refusal_set(refusal, FSN_E_BUSY, "wait", "it is on its way already");
}

struct fsn_control_host host;

void cycle(void) {
    on.now_ns += 1000000;
    CHECK(fsn_core_cycle(on.core, on.now_ns) == FSN_OK);
}

void set_up(void) {
    static const uint8_t frames[IMAGE] = {
        [30] = 0x36, 1,    2,    3,           9, 0, 0x08, 4, 5, 6,           8, 0, 0, 0, 0x80, 0x3F,
        0xFE,        0xFF, 0xF5, [66] = 0x36, 7, 8, 9,    9, 0, [78] = 0x2A, 5, 1, 1, 8, 0};
    on.plan = make_plan();
    static const uint32_t base[] = {0, 30, 60, 66, 72, 78};
    memcpy(on.base, base, sizeof base);
    memcpy(on.frames, frames, sizeof frames);
    on.wkc = (struct fsn_wkc){9, 9};
    for (uint32_t i = 0; i < SUBS; i++) {
        on.seen[i] = (struct fsn_bus_subdevice){.al_status = FSN_AL_OP,
                                                .found = FSN_FOUND_RIGHT,
                                                .vendor_id = 2,
                                                .product_code = 0x1000 + i,
                                                .revision = 3,
                                                .returns = i,
                                                .link = {1, 1},
                                                .link_lost = {(uint8_t)i, 7},
                                                .rx_errors = {8, 9}};
    }
    make_sii();
    on.history[0] = 3;
    on.history[1] = 7;
    on.goes_on = true;
    on.clocks = FSN_CLOCKS_APART;
    on.acyclic = (struct fsn_bus_acyclic){.count = count_members,
                                          .place = place,
                                          .member = member,
                                          .upload = upload,
                                          .download = download,
                                          .sii_read = sii_read,
                                          .sii_write = sii_write,
                                          .pdo = bus_pdo};
    on.ops = (struct fsn_bus_ops){.name = "script",
                                  .open = bus_open,
                                  .receive = bus_receive,
                                  .send = bus_send,
                                  .poll = bus_poll,
                                  .state = bus_state,
                                  .ring = bus_ring,
                                  .clocks = bus_clocks,
                                  .acyclic = &on.acyclic};
    host = test_host(submit);
    host.status = host_state;
    host.request = host_request;
    CHECK(fsn_core_create(on.plan, &on.ops, &on, &on.core, NULL) == FSN_OK);
    on.control = fsn_control_create(on.plan, &host, &nobody);
    CHECK(on.control != NULL);
    on.client = &on.control->client[0];
    *on.client = (struct fsn_client){.fd = open("/dev/null", O_RDWR | O_CLOEXEC),
                                     .number = 5,
                                     .role = FSN_MAINTAINER,
                                     .peer.pid = 4321,
                                     .peer.uid = 12,
                                     .lease_ms = FSN_LEASE_MS,
                                     .out.limit_bytes = FSN_CLIENT_OUT_BYTES};
    fsn_control_attach(on.control, on.core);
    cycle();
}

void tear_down(void) {
    fsn_control_free(on.control);
    fsn_core_free(on.core);
    fsn_plan_free(on.plan);
}
