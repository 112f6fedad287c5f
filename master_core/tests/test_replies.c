/** Every request of the control socket with its whole reply, on a bus, with objects and at a time
 * of the test's own. They stand in replies.txt: a request behind '>', a change of the rig behind
 *  '!', and what comes back below. test_replies --write prints the file anew, to be read before it
 *  is kept. */
#define _GNU_SOURCE

#include <fcntl.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "control/incidents/kept.h"
#include "control_host.h"
#include "core/core_internal.h"
#include "emulated_rig.h"
#include "fsn/version.h"
#include "heap.h"
#include "plan/plan_internal.h"

enum { SUBS = 3, IMAGE = 84, MEMBERS = 5, SII_BYTES = 512 };

static time_t later_s; /**< than all the other time of this test */

int clock_gettime(clockid_t clock, struct timespec *now) {
    *now = (struct timespec){.tv_sec = (clock == CLOCK_REALTIME ? 1700000000 : 1000) + later_s};
    return 0;
}

/* -- the plan -------------------------------------------------------------------------------- */

/** Appends a name and lets a record have it; strings are the last section. */
static uint8_t *name(uint8_t *bytes, size_t *len, uint32_t section, uint32_t record,
                     const char *text) {
    const size_t size = strlen(text) + 1;
    bytes = realloc(bytes, *len + size);
    CHECK(bytes != NULL);
    memcpy(bytes + *len, text, size);
    uint8_t *row = bytes + 32 + 16 * (FSN_SEC_STRINGS - 1);
    const uint32_t at = fsn_get32(row + 8);
    const uint32_t count = at + (uint32_t)size;
    *len += size;
    const uint32_t whole = (uint32_t)*len;
    uint8_t *field =
        bytes + fsn_get32(bytes + 32 + 16 * (section - 1) + 4) + record * fsn_record_bytes[section];
    for (int i = 0; i < 4; i++) {
        field[i] = (uint8_t)(at >> (8 * i));
        row[8 + i] = (uint8_t)(count >> (8 * i));
        bytes[12 + i] = (uint8_t)(whole >> (8 * i));
    }
    return bytes;
}

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
    static const char *const names[] = {"speed",  "start",  "lamp",     "level",
                                        "actual", "height", "two words"};
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
        bytes = name(bytes, &len, FSN_SEC_SYMBOL, i, names[i]);
    }
    bytes = name(bytes, &len, FSN_SEC_SUBDEVICE, 0, "logic");
    bytes = name(bytes, &len, FSN_SEC_SUBDEVICE, 1, "door");
    bytes = name(bytes, &len, FSN_SEC_SUBDEVICE, 2, "drive 2");
    bytes = name(bytes, &len, FSN_SEC_CONNECTION, 0, "door safe");
    bytes = name(bytes, &len, FSN_SEC_CONNECTION, 1, "drive safe");
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

static struct {
    struct fsn_plan *plan;
    struct fsn_core *core;
    struct fsn_control *control;
    struct fsn_client *client;
    uint8_t image[IMAGE], frames[IMAGE];
    uint32_t base[2 * SUBS], begin[1];
    struct fsn_bus_input input;
    struct fsn_wkc wkc;
    struct fsn_bus_subdevice seen[SUBS];
    struct fsn_bus_acyclic acyclic;
    struct fsn_bus_ops ops;
    uint8_t sii[SII_BYTES];
    uint8_t written[8];
    uint32_t written_bytes;
    fsn_status fails; /**< what every transfer answers instead */
    bool goes_on, stateless, no_coe;
    time_t takes_s; /**< each upload */
    uint64_t now_ns;
    unsigned dropped, refused; /**< without memory */
    uint8_t history[2];        /**< places for messages, and the newest */
    char read[8192];           /**< which objects were, since the last request */
} on;

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

static fsn_status member(void *bus, uint32_t position, struct fsn_bus_member *m) {
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
    memset(data, 0, size_bytes);
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

static struct fsn_job *waiting;

static void submit(void *self, struct fsn_job *job) {
    (void)self;
    CHECK(waiting == NULL);
    waiting = job;
}

static struct fsn_job_context context_of(void) {
    return (struct fsn_job_context){.core = on.core,
                                    .ops = &on.ops,
                                    .bus = &on,
                                    .plan = on.plan,
                                    .interface = "eth0",
                                    .between = between};
}

/** The acyclic thread. */
static void do_job(void) {
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
    *status = (struct fsn_control_status){.state = "running",
                                          .fault = on.stateless ? "the cable is out" : NULL,
                                          .backend = "script",
                                          .interface = "eth0",
                                          .redundant = on.stateless ? "eth1" : NULL,
                                          .plan_file = "the.fsnplan",
                                          .accepted = on.stateless ? "ABCD-EF" : NULL,
                                          .policy = "fifo",
                                          .started_ns = UINT64_C(400000000000),
                                          .cycle_ns = 1000000,
                                          .cpu = on.stateless ? 3 : 0,
                                          .priority = 80,
                                          .free_run = on.stateless};
}

static fsn_status host_request(void *self, enum fsn_program_request request,
                               struct fsn_refusal *refusal) {
    (void)self;
    return request != FSN_PROGRAM_RESTART
               ? FSN_OK
               : fsn_refusal_set(refusal, FSN_E_BUSY, "wait", "it is on its way already");
}

static struct fsn_control_host host;

static void cycle(void) {
    on.now_ns += 1000000;
    CHECK(fsn_core_cycle(on.core, on.now_ns) == FSN_OK);
}

static void set_up(void) {
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
                                     .pid = 4321,
                                     .uid = 12,
                                     .lease_ms = FSN_LEASE_MS,
                                     .out.limit_bytes = FSN_CLIENT_OUT_BYTES};
    fsn_control_attach(on.control, on.core);
    cycle();
}

static void tear_down(void) {
    fsn_control_free(on.control);
    fsn_core_free(on.core);
    fsn_plan_free(on.plan);
}

/** What an incident asks of the planned SubDevices; shown as an answer. */
static void ask_for_fsoe(void) {
    on.read[0] = 0;
    struct fsn_job *job =
        fsn_job_submit_fsoe(&on.control->services.jobs, on.control->services.view.core);
    CHECK((job == NULL) == (waiting == NULL));
    if (job == NULL) {
        fsn_client_put(on.client, "{\"none\":true}\n", 14);
        return;
    }
    const struct fsn_job_context context = context_of();
    waiting = NULL;
    fsn_job_run(job, &context);
    char text[64];
    snprintf(text, sizeof text, "{\"status\":%d,\"fsoe\":", (int)job->status);
    fsn_client_put(on.client, text, strlen(text));
    const bool good = job->status == FSN_OK;
    fsn_client_put(on.client, good ? job->json.bytes : "0", good ? job->json.len_bytes : 1);
    fsn_client_put(on.client, "}\n", 2);
    fsn_control_job_done(on.control, job);
}

/** Incidents are kept; what is shown of them is their head, so no file is ever written. */
static void keep_incidents(void) {
    char folder[] = "/tmp/fsn-replies-XXXXXX";
    struct fsn_refusal refusal;
    CHECK(mkdtemp(folder) != NULL);
    while (fsn_control_keep_incidents(on.control, folder, &refusal) != FSN_OK) {
        CHECK(refusal.status == FSN_E_NOMEM);
    }
    CHECK(rmdir(folder) == 0);
}

/** Keeps an incident that says everything. */
static void fail_in_every_way(void) {
    const struct fsn_trigger trigger = {.kind = "left_data",
                                        .connection = "door safe",
                                        .subdevice = "door",
                                        .before = "process data",
                                        .after = "reset",
                                        .reset_by = "sub",
                                        .reset_text = "wrong CRC",
                                        .reset_code = 4,
                                        .now_ns = UINT64_C(999000000000),
                                        .text = "the test says so"};
    on.control->services.incidents->pending.active = false;
    CHECK(fsn_incident_begin(on.control->services.incidents, &trigger));
    do_job();
}

/** The first line of the file of the incident that is being kept. */
static void show_head(void) {
    struct fsn_json head = {.limit_bytes = FSN_INCIDENT_HEAD_BYTES};
    fsn_incident_head(on.control->services.incidents, &head);
    fsn_client_put(on.client, head.failed ? "none\n" : head.bytes,
                   head.failed ? 5 : head.len_bytes);
    fsn_json_free(&head);
}

static struct fsn_direction direction_from(uint8_t first) {
    const uint64_t n = first;
    return (struct fsn_direction){n,
                                  n + 1,
                                  n + 2,
                                  n + 3,
                                  n + 4,
                                  n + 5,
                                  n + 6,
                                  n + 7,
                                  n + 8,
                                  n + 9,
                                  n + 10,
                                  n + 11,
                                  n + 12,
                                  (uint16_t)(n + 13),
                                  FSN_CMD_PARAMETER,
                                  (uint8_t)(n % 8)};
}

/** Shows a cycle in which no two numbers are equal. */
static void all_differs(void) {
    struct fsn_rt *rt = &on.core->rt;
    struct fsn_statistics *s = &rt->statistics;
    uint64_t *const numbers[] = {&s->cycles,        &s->overruns,     &s->wkc_errors,
                                 &s->lost_frames,   &s->old_replies,  &s->foreign_frames,
                                 &s->unsent_frames, &s->bytes_copied, &s->now_ns,
                                 &s->dc_time_ns,    &s->events_lost};
    for (uint64_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        *numbers[i] = 101 + i;
    }
    uint32_t *const narrow[] = {&s->expected_wkc, &s->actual_wkc, &s->copies, &s->merged_copies,
                                &s->send_errno};
    for (uint32_t i = 0; i < sizeof narrow / sizeof narrow[0]; i++) {
        *narrow[i] = 121 + i;
    }
    s->realtime = 1;
    struct fsn_histogram *const histograms[] = {&s->latency, &s->period,     &s->work,
                                                &s->copy,    &s->round_trip, &s->dc_offset};
    for (uint64_t i = 0; i < 6; i++) {
        for (uint64_t n = 0; n < 20000; n++) { /* so that each percentile is another bucket */
            const uint64_t much = n < 10000   ? 1
                                  : n < 18000 ? 4
                                  : n < 19800 ? 16
                                  : n < 19980 ? 64
                                  : n < 19998 ? 256
                                              : 1024;
            fsn_rt_count(histograms[i], (100 + i) * much);
        }
    }
    for (uint32_t i = 0; i < 2; i++) {
        rt->monitors[i].status = (struct fsn_connection_status){
            {direction_from((uint8_t)(20 + 60 * i)), direction_from((uint8_t)(50 + 60 * i))},
            FSN_OBSERVED_PARAMETER,
            9 + i};
        rt->watches[i].unshown = 1;
    }
    for (uint32_t sm = 0; sm < 2 * SUBS; sm++) {
        atomic_store(&rt->stale[sm], UINT64_C(1) << sm);
    }
    fsn_rt_publish(rt);
}

/** Fills the queue of jobs, or empties it. */
static void fill_queue(bool full) {
    static struct fsn_job job;
    for (size_t i = 0; i < FSN_JOBS; i++) {
        on.control->services.jobs.job[i] = full ? &job : NULL;
    }
}

/** A cycle, and what the control thread sees of the bus behind it. */
static void cycle_later(unsigned ms) {
    on.now_ns += ms * UINT64_C(1000000);
    CHECK(fsn_core_cycle(on.core, on.now_ns) == FSN_OK);
    fsn_changes_poll(&on.control->changes, on.control->services.incidents, on.now_ns);
}

/** Writes bytes into the SII: an offset, and what goes there, in hex. */
static void change_sii(const char *words) {
    unsigned at, byte;
    int used;
    CHECK(sscanf(words, "%x%n", &at, &used) == 1);
    for (words += used; sscanf(words, " %2x%n", &byte, &used) == 1; words += used) {
        CHECK(at < SII_BYTES);
        on.sii[at++] = (uint8_t)byte;
    }
}

/** Changes the rig by a word. */
static void change(const char *word) {
    if (strcmp(word, "stop") == 0) {
        fsn_control_attach(on.control, NULL);
    } else if (strcmp(word, "start") == 0) {
        fsn_control_attach(on.control, on.core);
    } else if (strcmp(word, "cycle") == 0) {
        cycle();
        fsn_streams_serve(&on.control->services);
    } else if (strcmp(word, "record") == 0) {
        CHECK(fsn_core_keep(on.core, 9000000, 1 << 20) == FSN_OK);
    } else if (strcmp(word, "trouble") == 0) {
        on.stateless = true;
        on.wkc.actual = 6;
        on.input = (struct fsn_bus_input){.lost_frames = 1,
                                          .old_replies = 2,
                                          .foreign_frames = 3,
                                          .unsent_frames = 4,
                                          .send_errno = 105,
                                          .dc_time_ns = 12345};
        on.seen[1].al_status = FSN_AL_SAFEOP | FSN_AL_ERROR;
        on.seen[1].al_code = 0x1B;
        snprintf(on.seen[1].detail, FSN_DETAIL_BYTES, "it wants a restart");
        on.seen[2] = (struct fsn_bus_subdevice){.found = FSN_FOUND_NOTHING};
        cycle();
    } else if (strcmp(word, "breaks-off") == 0) {
        on.goes_on = false;
    } else if (strcmp(word, "goes-on") == 0) {
        on.goes_on = true;
    } else if (strcmp(word, "no-jobs") == 0) {
        host.submit = NULL;
    } else if (strcmp(word, "jobs") == 0) {
        host.submit = submit;
    } else if (strcmp(word, "no-members") == 0) {
        on.acyclic.member = NULL;
    } else if (strcmp(word, "members") == 0) {
        on.acyclic.member = member;
    } else if (strncmp(word, "takes ", 6) == 0) {
        on.takes_s = atoi(word + 6);
    } else if (strcmp(word, "incidents") == 0) {
        keep_incidents();
    } else if (strcmp(word, "failure") == 0) {
        fail_in_every_way();
    } else if (strncmp(word, "history ", 8) == 0) {
        CHECK(sscanf(word + 8, "%hhu %hhu", &on.history[0], &on.history[1]) == 2);
    } else if (strcmp(word, "no-coe") == 0) {
        on.no_coe = true;
    } else if (strncmp(word, "sii ", 4) == 0) {
        change_sii(word + 4);
    } else if (strcmp(word, "reads") == 0) {
        fsn_client_put(on.client, on.read, strlen(on.read));
        fsn_client_put(on.client, "\n", 1);
    } else if (strcmp(word, "unstable") == 0) { /* the cycle writes the picture that is read */
        atomic_fetch_add(&on.core->rt.snapshot.begun, FSN_RT_PICTURES);
    } else if (strcmp(word, "stable") == 0) {
        atomic_fetch_sub(&on.core->rt.snapshot.begun, FSN_RT_PICTURES);
    } else if (strncmp(word, "image-bytes ", 12) == 0) {
        on.core->rt.image_bytes = (uint32_t)atoi(word + 12);
    } else if (strcmp(word, "many-jobs") == 0) {
        fill_queue(true);
    } else if (strcmp(word, "no-more-jobs") == 0) {
        fill_queue(false);
    } else if (strcmp(word, "all-differs") == 0) {
        all_differs();
    } else if (strcmp(word, "head") == 0) {
        show_head();
    } else if (strncmp(word, "after ", 6) == 0) {
        cycle_later((unsigned)atoi(word + 6));
    } else if (strcmp(word, "fsoe") == 0) {
        ask_for_fsoe();
    } else if (strcmp(word, "nobody-else") == 0) {
        on.client->number = 6;
    } else {
        CHECK(strncmp(word, "fails ", 6) == 0);
        on.fails = (fsn_status)atoi(word + 6);
    }
}

static void request(const char *line) {
    char room[512];
    on.read[0] = 0;
    CHECK(strlen(line) < sizeof room);
    memcpy(room, line, strlen(line) + 1);
    fsn_request_answer(&on.control->services, on.client, room, strlen(room));
    do_job();
}

/** The reply to a request, or what a change sends; of the version only that there is one. */
static char *reply_to(const char *line) {
    static char text[65536];
    static const char version[] = "\"version\":\"" FSN_VERSION_STRING "\"";
    if (line[0] == '!') {
        change(line + 1);
    } else {
        request(line + 2);
    }
    const struct fsn_json *out = &on.client->out;
    CHECK(out->len_bytes < sizeof text);
    if (out->len_bytes > 0) {
        memcpy(text, out->bytes, out->len_bytes);
    }
    text[out->len_bytes] = 0;
    for (char *found = strstr(text, version); found != NULL; found = strstr(found, version)) {
        memmove(found + 11, found + sizeof version - 2, strlen(found + sizeof version - 2) + 1);
        memcpy(found, "\"version\":\"", 11);
    }
    fsn_json_free(&on.client->out);
    return text;
}

static FILE *open_replies(void) {
    FILE *file = fopen(FSN_TEST_FOLDER "/replies.txt", "r");
    CHECK(file != NULL);
    return file;
}

#ifdef FSN_TEST_HEAP
/** Whichever allocation fails: a request is answered by one line, or its client is dropped. Events
 *  may stand before it. */
static void is_answered(const char *line) {
    struct fsn_client *client = on.client;
    const struct fsn_json *out = &client->out;
    const char *last = out->bytes;
    size_t len = out->len_bytes;
    while (len > 9 && memcmp(last, "{\"event\":", 9) == 0) {
        const char *end = memchr(last, '\n', len);
        CHECK(end != NULL);
        len -= (size_t)(end + 1 - last);
        last = end + 1;
    }
    const bool refused =
        len > 11 && memcmp(last, "{\"ok\":false", 11) == 0 && client->drop_reason == NULL;
    const bool fits = len > 0 && last[len - 1] == '\n' && memchr(last, '\n', len - 1) == NULL;
    if (client->drop_reason != NULL
            ? strcmp(client->drop_reason, "no memory for it") != 0 || len > 0
            : !fits || (!refused && memcmp(last, "{\"ok\":true", 10) != 0)) {
        fprintf(stderr, "%s\nwithout memory: %s, %.*s\n", line,
                client->drop_reason != NULL ? client->drop_reason : "", (int)out->len_bytes,
                out->bytes != NULL ? out->bytes : "");
        exit(1);
    }
    on.dropped += client->drop_reason != NULL;
    on.refused += refused;
    client->drop_reason = NULL;
    fsn_json_free(&client->out);
}

/** Every request of the file, each time with one more allocation before the one that fails. */
static void memory_runs_out(void) {
    static char line[65536];
    const long alive = heap.alive;
    FILE *file = open_replies();
    memset(&on, 0, sizeof on);
    set_up();
    while (fgets(line, sizeof line, file) != NULL) {
        line[strcspn(line, "\n")] = 0;
        if (line[0] == '!') {
            change(line + 1);
            fsn_json_free(&on.client->out);
        }
        for (long n = 1, left = 0; line[0] == '>' && left == 0; n++) {
            heap.fails_in = n;
            request(line + 2);
            left = heap.fails_in;
            heap.fails_in = 0;
            is_answered(line);
        }
    }
    fclose(file);
    CHECK(on.dropped > 100 && on.refused > 300);
    tear_down();
    CHECK(heap.alive == alive);
}
#endif

/** Compares every reply, or prints it; the exit code. */
static int replies_are_as_written(bool writes) {
    static char line[65536], expected[65536];
    FILE *file = open_replies();
    CHECK(fgets(line, sizeof line, file) != NULL);
    unsigned requests = 0;
    set_up();
    bool more = true;
    while (more) {
        char request[512];
        CHECK(line[0] == '>' || line[0] == '!');
        snprintf(request, sizeof request, "%.*s", (int)strcspn(line, "\n"), line);
        expected[0] = 0;
        while ((more = fgets(line, sizeof line, file) != NULL) && line[0] != '>' &&
               line[0] != '!') {
            CHECK(strlen(expected) + strlen(line) < sizeof expected);
            strcat(expected, line);
        }
        const char *said = reply_to(request);
        requests++;
        if (writes) {
            printf("%s\n%s", request, said);
        } else if (strcmp(said, expected) != 0) {
            fprintf(stderr, "%s\nsaid\n%sexpected\n%s", request, said, expected);
            return 1;
        }
    }
    fclose(file);
    CHECK(writes || (requests > 100 && on.written_bytes == 2));
    CHECK(writes || memcmp(on.written, "\x39\x30", 2) == 0);
    tear_down();
    return 0;
}

int main(int argc, char **argv) {
    const bool writes = argc > 1 && strcmp(argv[1], "--write") == 0;
    const int differs = replies_are_as_written(writes);
#ifdef FSN_TEST_HEAP
    if (!writes && differs == 0) {
        memory_runs_out();
    }
#endif
    return differs;
}
