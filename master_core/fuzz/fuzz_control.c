/** Fuzz target: any bytes as lines of the control socket; each gets one reply that is whole. Fits
 *  libFuzzer and driver.c. */
#include "fuzz.h"

#include <string.h>

#include "control/requests/client.h"
#include "control/requests/requests.h"
#include "control/server/server.h"

uint64_t fuzz_reached;

static struct {
    struct fsn_plan *plan;
    struct fsn_emulated *bus;
    struct fsn_core *core;
    struct fsn_control *control;
} rig;

static void tell_status(void *self, struct fsn_control_status *status) {
    (void)self;
    *status = (struct fsn_control_status){.state = FSN_PROGRAM_RUNNING,
                                          .backend = "emulated",
                                          .plan_file = "plan",
                                          .policy = "other"};
}

static fsn_status grant(void *self, enum fsn_program_request request, struct fsn_refusal *refusal) {
    (void)self;
    return request == FSN_PROGRAM_START ? fsn_refusal_set(refusal, FSN_E_STATE, NULL, "it runs")
                                        : FSN_OK;
}

static void swallow(void *self, enum fsn_log_level level, enum fsn_role account, const char *text,
                    const char *json, size_t json_bytes) {
    (void)account;
    (void)self;
    (void)level;
    CHECK(fsn_is_utf8(text, strlen(text)) && fsn_is_utf8(json, json_bytes));
}

/* -- a bus whose SubDevices say anything ---------------------------------------------------- */

static uint32_t seed;
static struct fsn_job *pending;

static uint8_t noise(void) {
    seed = seed * 1664525u + 1013904223u;
    return (uint8_t)(seed >> 24);
}

static void fill(uint8_t *data, uint32_t size_bytes) {
    for (uint32_t i = 0; i < size_bytes; i++) {
        data[i] = noise();
    }
}

static uint32_t noisy_count(void *bus) {
    (void)bus;
    return 2;
}

static uint32_t noisy_place(void *bus, uint32_t subdevice) {
    (void)bus;
    return subdevice;
}

static fsn_status noisy_member(void *bus, uint32_t position, struct fsn_bus_member *member) {
    (void)bus;
    fill((uint8_t *)member, offsetof(struct fsn_bus_member, mailbox));
    member->subdevice = position;
    member->mailbox = noise();
    member->al_status = noise();
    member->has_dc = member->errors_known = true;
    member->ports = 0xFF;
    member->name[0] = 0;
    return noise() < 128 ? FSN_OK : FSN_E_BUS_MISSING;
}

static fsn_status noisy_upload(void *bus, struct fsn_transfer *transfer) {
    static const fsn_status result[] = {FSN_OK, FSN_OK, FSN_OK, FSN_E_BUS_SDO, FSN_E_BUS_MISSING};
    (void)bus;
    const uint32_t size = noise() % 40u;
    transfer->size_bytes = size < transfer->size_bytes ? size : transfer->size_bytes;
    fill(transfer->data, transfer->size_bytes);
    return noise() < 250 ? FSN_OK : result[noise() % 5];
}

static fsn_status noisy_sii(void *bus, uint32_t position, uint32_t offset, uint8_t *data,
                            uint32_t size_bytes) {
    static const uint8_t types[] = {10, 30, 41, 50, 51};
    (void)bus;
    (void)position;
    fill(data, size_bytes);
    if (offset >= 0x80 && noise() < 200) { /* often a category there is */
        data[0] = types[noise() % 5];
        data[1] = data[3] = 0;
        data[2] = 30; /* the next one begins after this step */
    }
    return noise() < 250 ? FSN_OK : FSN_E_BUS_MISSING;
}

static const struct fsn_bus_acyclic noisy = {.count = noisy_count,
                                             .place = noisy_place,
                                             .member = noisy_member,
                                             .upload = noisy_upload,
                                             .download = noisy_upload,
                                             .sii_read = noisy_sii};
static struct fsn_bus_ops ops;

static void submit(void *self, struct fsn_job *job) {
    (void)self;
    CHECK(pending == NULL);
    pending = job;
}

static void do_job(void) {
    const struct fsn_job_context context = {
        .core = rig.core, .ops = &ops, .bus = rig.bus, .plan = rig.plan};
    struct fsn_job *job = pending;
    pending = NULL;
    if (job != NULL) {
        fsn_job_run(job, &context);
        fsn_control_job_done(rig.control, job);
    }
}

static const struct fsn_control_host host = {
    .status = tell_status, .request = grant, .log = swallow, .submit = submit};
static const struct fsn_control_access nobody;

static void set_up(void) {
    size_t len;
    uint8_t *bytes = build_full(&len);
    CHECK(fsn_plan_load(bytes, len, &rig.plan, NULL) == FSN_OK);
    free(bytes);
    ops = *fsn_emulated_ops();
    ops.acyclic = &noisy;
    seed = (uint32_t)len;
    CHECK(fsn_emulated_create(rig.plan, &rig.bus) == FSN_OK);
    CHECK(fsn_core_create(rig.plan, &ops, rig.bus, &rig.core, NULL) == FSN_OK);
    rig.control = fsn_control_create(rig.plan, &host, &nobody);
    CHECK(rig.control != NULL);
    CHECK(fsn_core_keep(rig.core, 1, (size_t)1 << 12) == FSN_OK);
    fsn_control_attach(rig.control, rig.core);
}

static void tear_down(void) {
    fsn_control_free(rig.control);
    fsn_core_free(rig.core);
    fsn_emulated_free(rig.bus);
    fsn_plan_free(rig.plan);
}

/** A line of JSON: brackets pair outside of strings, no control character, UTF-8. */
static void check_line(const char *line, size_t len) {
    char stack[64];
    size_t depth = 0;
    bool text = false;
    CHECK(fsn_is_utf8(line, len) && len > 0 && line[0] == '{');
    for (size_t i = 0; i < len; i++) {
        CHECK((unsigned char)line[i] >= 0x20);
        if (text && line[i] == '\\') {
            i++; /* whatever it is, it does not end the text */
        } else if (text) {
            text = line[i] != '"';
        } else if (line[i] == '"') {
            text = true;
        } else if (line[i] == '{' || line[i] == '[') {
            CHECK(depth < sizeof stack);
            stack[depth++] = line[i] == '{' ? '}' : ']';
        } else if (line[i] == '}' || line[i] == ']') {
            CHECK(depth > 0 && stack[--depth] == line[i]);
        }
    }
    CHECK(!text && depth == 0);
}

static void ask(struct fsn_client *client, const uint8_t *bytes, size_t len) {
    char *line = malloc(len + 1); /* exactly the room it may use */
    CHECK(line != NULL);
    memcpy(line, bytes, len);
    fsn_request_answer(&rig.control->services, client, line, len);
    do_job();
    free(line);
    fsn_streams_serve(&rig.control->services); /* cycles are lines too */
    CHECK(client->drop_reason == NULL && client->out.len_bytes > 0);
    unsigned replies = 0;
    for (size_t at = 0; at < client->out.len_bytes;) {
        const char *from = client->out.bytes + at;
        const char *end = memchr(from, '\n', client->out.len_bytes - at);
        CHECK(end != NULL);
        check_line(from, (size_t)(end - from));
        replies += strncmp(from, "{\"ok\":", 6) == 0;
        fuzz_reached += strncmp(from, "{\"ok\":true", 10) == 0;
        at += (size_t)(end - from) + 1;
    }
    CHECK(replies == 1); /* the rest are events */
    fsn_json_free(&client->out);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    set_up();
    struct fsn_client *client = &rig.control->client[0];
    *client = (struct fsn_client){.fd = 1 << 20, /* no descriptor: nothing is sent here */
                                  .number = 1,
                                  .role = FSN_MAINTAINER,
                                  .lease_ms = FSN_LEASE_MS,
                                  .out.limit_bytes = FSN_CLIENT_OUT_BYTES};
    uint64_t now = 0;
    while (size > 0) {
        const uint8_t *end = memchr(data, '\n', size);
        const size_t line = end != NULL ? (size_t)(end - data) : size;
        if (line <= FSN_LINE_BYTES) {
            ask(client, data, line);
        }
        CHECK(fsn_core_cycle(rig.core, ++now) == FSN_OK);
        data += line + (end != NULL);
        size -= line + (end != NULL);
    }
    fsn_stream_end(client);
    client->fd = -1;
    tear_down();
    return 0;
}
