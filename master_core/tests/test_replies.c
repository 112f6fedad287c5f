/** Every request of the control socket with its whole reply, on a bus, with objects and at a time
 *  of the test's own. They are in replies.txt: a request after '>', a change of the rig after '!',
 *  and the reply below. test_replies --write prints the file again: read it before you keep it.
 */
#define _GNU_SOURCE

#include <string.h>
#include <unistd.h>

#include "control/base/names.h"
#include "control/base/words.h"
#include "control/incidents/kept.h"
#include "core/core_internal.h"
#include "fsn/version.h"
#include "heap.h"
#include "replies_rig.h"

/** Requests of an incident to the planned SubDevices; shown as an answer. */
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

/** Incidents are recorded; only their head is shown, so no file is ever written. */
static void keep_incidents(void) {
    char folder[] = "/tmp/fsn-replies-XXXXXX";
    struct fsn_refusal refusal;
    CHECK(mkdtemp(folder) != NULL);
    while (fsn_control_keep_incidents(on.control, folder, 1 << 30, &refusal) != FSN_OK) {
        CHECK(refusal.status == FSN_E_NOMEM);
    }
    CHECK(rmdir(folder) == 0);
}

/** Keeps an incident with every field. */
static void fail_in_every_way(void) {
    const struct fsn_trigger trigger = {.kind = FSN_LEFT_DATA,
                                        .connection = "door safe",
                                        .subdevice = "door",
                                        .before = "process data",
                                        .after = "reset",
                                        .reset_by = "sub",
                                        .reset_text = "wrong CRC",
                                        .reset_code = 4,
                                        .now_ns = UINT64_C(999000000000),
                                        .text = "the test refuses"};
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
#define PLACE(name) , &s->counts.name
    uint64_t *const numbers[] = {
        &s->cycles,       &s->overruns, &s->wkc_errors FSN_FRAME_COUNT_TABLE(PLACE),
        &s->bytes_copied, &s->now_ns,   &s->dc_time_ns,
        &s->events_lost};
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
            fsn_rt_count(rt, histograms[i], (100 + i) * much);
        }
    }
    for (uint32_t i = 0; i < 2; i++) {
        rt->monitors[i].status =
            (struct fsn_connection_status){.direction = {direction_from((uint8_t)(20 + 60 * i)),
                                                         direction_from((uint8_t)(50 + 60 * i))},
                                           .parameters = {.known = i == 0 ? 3 : 15,
                                                          .connection_id = 2099,
                                                          .address = 14,
                                                          .watchdog_ms = 4000,
                                                          .app_bytes = 6,
                                                          .app_crc = UINT32_MAX},
                                           .differs = 1 + 4 * i,
                                           .observed = FSN_OBSERVED_PARAMETER,
                                           .gaps = 9 + i};
        rt->watches[i].unshown = 1;
    }
    for (uint32_t sm = 0; sm < 2 * SUBS; sm++) {
        atomic_store(&rt->stale[sm], UINT64_C(1) << sm);
    }
    fsn_rt_publish(rt);
}

/** Each word for a number, where it differs from that for the number before. */
static void show_names(void) {
    char before[100] = "";
    char line[100];
    char al[24];
    for (unsigned kind = 0; kind < 4; kind++) {
        for (unsigned i = 0; i < 256; i++) {
            const uint8_t n = (uint8_t)i;
            const char *name = kind == 0   ? fsn_observed_text(i)
                               : kind == 1 ? fsn_reset_text(n)
                               : kind == 2 ? fsn_command_name(n)
                                           : fsn_al_text(n, al);
            if (strcmp(name, before) != 0) {
                snprintf(before, sizeof before, "%s", name);
                snprintf(line, sizeof line, "%u: %s\n", i, name);
                fsn_client_put(on.client, line, strlen(line));
            }
        }
    }
}

static size_t encode(uint32_t c, char to[5]) {
    const size_t more = c < 0x80 ? 0 : c < 0x800 ? 1 : c < 0x10000 ? 2 : 3;
    static const uint8_t first[] = {0, 0xC0, 0xE0, 0xF0};
    to[0] = (char)(first[more] | c >> (6 * more));
    for (size_t i = 1; i <= more; i++) {
        to[i] = (char)(0x80 | (c >> (6 * (more - i)) & 0x3F));
    }
    to[more + 1] = 0;
    return more + 1;
}

/** First and last of the hidden characters. */
static void show_hidden(void) {
    bool before = false;
    for (uint32_t c = 0; c <= 0x110000; c++) {
        char bytes[5], shown[FSN_SHOWN_BYTES], line[40];
        const size_t len = encode(c, bytes);
        const size_t taken = fsn_show_character(bytes, len, shown);
        const bool hidden = strcmp(shown, bytes) != 0;
        CHECK(taken == len || (hidden && taken == 1));
        if (hidden != before) {
            snprintf(line, sizeof line, "%x %s\n", (unsigned)c, hidden ? shown : "shown");
            fsn_client_put(on.client, line, strlen(line));
        }
        before = hidden;
    }
}

/** Fills the queue of jobs, or empties it. */
static void fill_queue(bool full) {
    static struct fsn_job job;
    for (size_t i = 0; i < FSN_JOBS; i++) {
        on.control->services.jobs.job[i] = full ? &job : NULL;
    }
}

/** A cycle, and the view of the control thread after it. */
static void cycle_later(unsigned ms) {
    on.now_ns += ms * UINT64_C(1000000);
    CHECK(fsn_core_cycle(on.core, on.now_ns) == FSN_OK);
    fsn_changes_poll(&on.control->changes, on.control->services.incidents, on.now_ns);
}

/** Writes bytes into the SII: an offset, and the bytes in hex. */
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
        on.input = (struct fsn_bus_input){.counts.lost_frames = 1,
                                          .counts.old_replies = 2,
                                          .counts.foreign_frames = 3,
                                          .counts.unsent_frames = 4,
                                          .send_errno = 105,
                                          .dc_time_ns = 12345};
        on.seen[1].al_status = FSN_AL_SAFEOP | FSN_AL_ERROR;
        on.seen[1].al_code = 0x1B;
        snprintf(on.seen[1].detail, FSN_DETAIL_BYTES, "it needs a restart");
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
    } else if (strcmp(word, "coe") == 0) {
        on.no_coe = false;
    } else if (strncmp(word, "count ", 6) == 0) {
        CHECK(sscanf(word + 6, "%x %u", &on.count_of, &on.count) == 2);
    } else if (strcmp(word, "hidden") == 0) {
        show_hidden();
    } else if (strcmp(word, "names") == 0) {
        show_names();
    } else if (strcmp(word, "reads") == 0) {
        strcat(on.read, "\n");
        fsn_client_put(on.client, on.read, strlen(on.read));
    } else if (strcmp(word, "unstable") == 0) { /* the cycle writes the snapshot that is read */
        atomic_fetch_add(&on.core->rt.snapshot.shown->begun, FSN_RT_PICTURES);
    } else if (strcmp(word, "stable") == 0) {
        atomic_fetch_sub(&on.core->rt.snapshot.shown->begun, FSN_RT_PICTURES);
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
    } else if (strncmp(word, "clocks ", 7) == 0) {
        on.clocks = (uint8_t)atoi(word + 7);
    } else if (strncmp(word, "after ", 6) == 0) {
        cycle_later((unsigned)atoi(word + 6));
    } else if (strcmp(word, "fsoe") == 0) {
        ask_for_fsoe();
    } else if (strcmp(word, "nobody-else") == 0) {
        on.client->number = 6;
    } else if (strncmp(word, "fails ", 6) != 0) {
        CHECK(strcmp(word, "with-memory") == 0); /* from here on there is enough of it */
    } else {
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

/** The reply to a request, or the events of a change; of the version only that there is one. */
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
 *  may precede it. */
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

/** Every request of the file up to a mark, each time with one more allocation before the one that
 * fails. */
static void memory_runs_out(void) {
    static char line[65536];
    const long alive = heap.alive;
    FILE *file = open_replies();
    memset(&on, 0, sizeof on);
    set_up();
    while (fgets(line, sizeof line, file) != NULL && strcmp(line, "!with-memory\n") != 0) {
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
