/** Watching cycles through the control socket: each cycle once and in order, and cycles missed by a
 *  slow client are counted. */
#define _GNU_SOURCE

#include <string.h>

#include "control_host.h"
#include "emulated_rig.h"

enum { KEPT = 64, SM_BYTES = 1000 };

struct rig {
    struct emulated_rig on;
    struct fsn_control *control;
    struct fsn_client *client;
    uint64_t cycle;          /**< run so far */
    uint64_t next;           /**< cycle of the next line */
    uint64_t lines, skipped; /**< seen so far */
};

static struct fsn_control_host host;

static struct rig set_up(void) {
    static const struct build_sm sm[2][2] = {{{1, SM_BYTES}, {2, SM_BYTES}}, {{1, 8}, {2, 8}}};
    static const struct build_symbol symbols[] = {{.sm = 0, .bits = 32}, {.sm = 1, .bits = 32}};
    const struct build build = {
        .subdevices = 2, .sm = sm, .cycle_ns = 1000, .symbols = symbols, .symbol_count = 2};
    struct rig rig = {.on = emulated_rig_build(&build), .next = 1};
    CHECK(fsn_core_keep(rig.on.core, (KEPT - 1) * 1000, (size_t)1 << 20) == FSN_OK);
    CHECK(fsn_core_kept_cycles(rig.on.core) == KEPT);
    host = test_host(NULL);
    rig.control = fsn_control_create(rig.on.plan, &host, &nobody);
    CHECK(rig.control != NULL);
    fsn_control_attach(rig.control, rig.on.core);
    rig.client = &rig.control->client[3];
    *rig.client = (struct fsn_client){.fd = 1 << 20, /* no descriptor: nothing is sent here */
                                      .number = 1,
                                      .role = FSN_MAINTAINER,
                                      .out.limit_bytes = FSN_CLIENT_OUT_BYTES};
    return rig;
}

static void tear_down(struct rig *rig) {
    fsn_stream_end(rig->client);
    rig->client->fd = -1;
    fsn_control_free(rig->control);
    emulated_rig_end(&rig->on);
}

/** Runs cycles whose output is their number. */
static void run(struct rig *rig, unsigned cycles) {
    for (unsigned i = 0; i < cycles; i++) {
        rig->cycle++;
        CHECK(fsn_core_set_output(rig->on.core, 0, rig->cycle) == FSN_OK);
        CHECK(fsn_core_cycle(rig->on.core, 1000 * rig->cycle) == FSN_OK);
    }
}

static bool answer(struct rig *rig, const char *request, const char *expected) {
    char line[64];
    const size_t len = strlen(request);
    memcpy(line, request, len);
    fsn_request_answer(&rig->control->services, rig->client, line, len);
    const struct fsn_json *out = &rig->client->out;
    const bool found = out->len_bytes > strlen(expected) &&
                       memmem(out->bytes, out->len_bytes, expected, strlen(expected)) != NULL;
    if (!found) {
        fprintf(stderr, "%s: %.*s", request, (int)out->len_bytes, out->bytes);
    }
    fsn_json_free(&rig->client->out);
    return found;
}

static uint64_t number_of(const char *line, const char *end, const char *key) {
    const char *at = memmem(line, (size_t)(end - line), key, strlen(key));
    return at == NULL ? 0 : strtoull(at + strlen(key), NULL, 10);
}

/** Reads everything that was sent: each line is the one that is due, or names the missing ones. */
static void read_lines(struct rig *rig, uint64_t every, const char *value) {
    const struct fsn_json *out = &rig->client->out;
    for (size_t at = 0; at < out->len_bytes;) {
        const char *line = out->bytes + at;
        const char *end = memchr(line, '\n', out->len_bytes - at);
        CHECK(end != NULL);
        const uint64_t cycle = number_of(line, end, "\"cycle\":");
        const uint64_t skipped = number_of(line, end, "\"skipped\":");
        CHECK(cycle == rig->next + skipped * every);
        CHECK(number_of(line, end, "\"now_ns\":") == 1000 * cycle);
        CHECK(value == NULL || number_of(line, end, value) == cycle);
        rig->lines++;
        rig->skipped += skipped;
        rig->next = cycle + every;
        at += (size_t)(end - line) + 1;
    }
    fsn_json_free(&rig->client->out);
}

static void requests_are_understood(void) {
    struct rig rig = set_up();
    CHECK(answer(&rig, "watch 0", "1 to 1000000"));
    CHECK(answer(&rig, "watch 1000001", "FSN_E_ARG"));
    CHECK(answer(&rig, "watch x", "FSN_E_ARG"));
    CHECK(answer(&rig, "watch 1 nothing", "no input or output is called nothing"));
    CHECK(answer(&rig, "watch 1 nothing*", "no input or output begins with nothing"));
    CHECK(answer(&rig, "watch 1 --all", "no such option"));
    CHECK(answer(&rig, "watch 1 --image t", "takes no names"));
    CHECK(answer(&rig, "watch off t", "FSN_E_ARG"));
    CHECK(rig.client->stream.every == 0);
    CHECK(answer(&rig, "watch 7 *", "\"watch\":7,\"values\":2,\"image\":false"));
    CHECK(answer(&rig, "watch 0", "FSN_E_ARG") && rig.client->stream.every == 7); /* stays */
    CHECK(answer(&rig, "watch 9 --image", "\"watch\":9,\"values\":0,\"image\":true"));
    CHECK(answer(&rig, "watch off", "\"watch\":0") && rig.client->stream.every == 0);
    CHECK(fsn_core_keep(rig.on.core, 0, 0) == FSN_OK);
    CHECK(answer(&rig, "watch 1", "--record"));
    fsn_control_attach(rig.control, NULL);
    CHECK(answer(&rig, "watch 1", "FSN_E_STATE") && answer(&rig, "layout", "FSN_E_STATE"));
    fsn_streams_serve(&rig.control->services);
    tear_down(&rig);
}

static void every_cycle_comes_once(void) {
    static const uint64_t every[] = {1, 3};
    for (int i = 0; i < 2; i++) {
        struct rig rig = set_up();
        char request[32];
        snprintf(request, sizeof request, "watch %u t", (unsigned)every[i]);
        CHECK(answer(&rig, request, "\"ok\":true"));
        for (int turns = 0; turns < 40; turns++) {
            run(&rig, 7);
            fsn_streams_serve(&rig.control->services);
            read_lines(&rig, every[i], "\"t\":");
        }
        CHECK(rig.lines == (280 + every[i] - 1) / every[i] && rig.skipped == 0);
        tear_down(&rig);
    }
}

static void what_is_overwritten_is_counted(void) {
    struct rig rig = set_up();
    CHECK(answer(&rig, "watch 2", "\"ok\":true"));
    for (int turns = 0; turns < 10; turns++) {
        run(&rig, 3 * KEPT + 1); /* the control thread was away for this long */
        fsn_streams_serve(&rig.control->services);
        read_lines(&rig, 2, "\"t\":");
    }
    CHECK(rig.lines > 0 && rig.skipped > 0);
    CHECK(2 * (rig.lines + rig.skipped) + 1 == rig.next && rig.next > rig.cycle);
    tear_down(&rig);
}

/** A client that was away continues an eighth of the recorder after its oldest cycle, in its own
 *  step. */
static void what_is_left_out_is_no_more_than_needed(void) {
    for (uint64_t more = 0; more < 3; more++) {
        struct rig rig = set_up();
        CHECK(answer(&rig, "watch 3 t", "\"ok\":true"));
        run(&rig, (unsigned)(200 + more));
        fsn_streams_serve(&rig.control->services);
        const uint64_t until = 200 + more - KEPT + KEPT / 8 + 2;
        const uint64_t count = (until - 1 + 2) / 3;
        const char *line = rig.client->out.bytes;
        const char *end = memchr(line, '\n', rig.client->out.len_bytes);
        CHECK(number_of(line, end, "\"cycle\":") == 1 + 3 * count);
        CHECK(number_of(line, end, "\"skipped\":") == count);
        tear_down(&rig);
    }
}

static void a_slow_reader_is_not_waited_for(void) {
    struct rig rig = set_up();
    CHECK(answer(&rig, "watch 1 --image", "\"ok\":true"));
    for (int turns = 0; turns < 500; turns++) {
        run(&rig, 1);
        fsn_streams_serve(&rig.control->services); /* it reads nothing */
        CHECK(rig.client->drop_reason == NULL);
        CHECK(rig.client->out.len_bytes < 300000);
    }
    read_lines(&rig, 1, NULL);
    CHECK(rig.lines > 20 && rig.lines < 100 && rig.skipped == 0);
    run(&rig, 1);
    fsn_streams_serve(&rig.control->services);
    read_lines(&rig, 1, NULL);
    CHECK(rig.skipped > 400 && rig.lines + rig.skipped == 501 && rig.next == 502);
    tear_down(&rig);
}

/** Up to 256 KiB may be unread before a line is left out. */
static void so_much_may_lie_unread(void) {
    static char block[(256 << 10) + 1];
    for (size_t more = 0; more < 2; more++) {
        struct rig rig = set_up();
        const size_t len = (256 << 10) + more;
        CHECK(answer(&rig, "watch 1 t", "\"ok\":true"));
        memset(block, 'x', sizeof block);
        fsn_client_put(rig.client, block, len);
        run(&rig, 2);
        fsn_streams_serve(&rig.control->services);
        CHECK((rig.client->out.len_bytes > len) == (more == 0));
        CHECK(rig.client->stream.next == 3 && rig.client->stream.skipped == 1 + more);
        tear_down(&rig);
    }
}

/** Cycles of another core count from 1 again. */
static void watching_goes_on_with_another_core(void) {
    struct rig rig = set_up();
    run(&rig, 5);
    CHECK(answer(&rig, "watch 1 t", "\"ok\":true"));
    fsn_control_attach(rig.control, NULL);
    fsn_streams_serve(&rig.control->services);
    CHECK(rig.client->out.len_bytes == 0);
    fsn_core_free(rig.on.core);
    CHECK(fsn_core_create(rig.on.plan, fsn_emulated_ops(), rig.on.bus, &rig.on.core, NULL) ==
          FSN_OK);
    CHECK(fsn_core_keep(rig.on.core, KEPT * 1000, (size_t)1 << 20) == FSN_OK);
    fsn_control_attach(rig.control, rig.on.core);
    rig.cycle = 0;
    run(&rig, 3);
    fsn_streams_serve(&rig.control->services);
    read_lines(&rig, 1, "\"t\":");
    CHECK(rig.lines == 3 && rig.next == 4);
    tear_down(&rig);
}

int main(void) {
    requests_are_understood();
    every_cycle_comes_once();
    what_is_overwritten_is_counted();
    what_is_left_out_is_no_more_than_needed();
    a_slow_reader_is_not_waited_for();
    so_much_may_lie_unread();
    watching_goes_on_with_another_core();
    return 0;
}
