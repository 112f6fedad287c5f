/** The real-time client: connecting, and its reads and writes in shared memory. */
#define _GNU_SOURCE

#include "fsn/client.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include "fsn/plan.h"
#include "rt/bytes.h"
#include "rt/clock.h"
#include "rt/number.h"
#include "rt/shared.h"
#include "rt/words.h"

enum { LINE_BYTES = 8192, FDS = 2, DEFAULT_TIMEOUT_MS = 5000 };
enum { LOOK_AFTER = 256 }; /**< sleeps of one cycle before a check for further cycles */

struct fsn_realtime {
    int fd; /**< of the socket: while it is open, this client owns the outputs */
    const struct fsn_shared_inputs *inputs;
    const struct fsn_shared_symbol *symbols;
    struct fsn_shared_outputs *outputs; /**< NULL: read-only */
    size_t inputs_bytes, outputs_bytes;
    uint8_t *image;
    uint64_t *values; /**< of the outputs */
    uint32_t *slot;   /**< per symbol: its place in `values` + 1; 0: not owned */
    uint32_t taken;   /**< number of the last snapshot */
    struct fsn_shared_cycle cycle;
};

/** An answer of fsn-master and the descriptors sent with it. */
struct answer {
    char line[LINE_BYTES];
    int fd[FDS];
    size_t fds;
};

static fsn_status refuse(struct fsn_realtime_fault *fault, fsn_status status, const char *what,
                         const char *text) {
    if (fault != NULL) {
        *fault = (struct fsn_realtime_fault){.status = status};
        fault->sys_errno = status == FSN_E_SYS ? errno : 0;
        snprintf(fault->text, sizeof fault->text, "%.160s: %.340s", what, text);
    }
    return status;
}

/* -- the request ---------------------------------------------------------------------------- */

/** Appends a word in quotes; false if the line is full. */
static bool put_word(char *line, size_t *used, const char *word) {
    line[(*used)++] = ' ';
    line[(*used)++] = '"';
    for (; *word != 0; word++) {
        if (*used + 5 > LINE_BYTES) {
            return false;
        }
        if (*word == '"' || *word == '\\') {
            line[(*used)++] = '\\';
        }
        line[(*used)++] = *word;
    }
    line[(*used)++] = '"';
    return true;
}

static bool write_request(const struct fsn_realtime_options *options, char line[LINE_BYTES + 8],
                          size_t *used) {
    const char *plan = options->plan_sha256 != NULL ? options->plan_sha256 : "any";
    *used = (size_t)snprintf(line, LINE_BYTES, "realtime %d %.64s %u", FSN_SHARED_LAYOUT, plan,
                             (unsigned)options->misses);
    for (size_t i = 0; i < options->output_count; i++) {
        if (options->outputs[i] == NULL || *used + 8 > LINE_BYTES ||
            !put_word(line, used, options->outputs[i])) {
            return false;
        }
    }
    line[(*used)++] = '\n';
    return true;
}

/** Stores descriptors received with some bytes. */
static void keep_fds(struct msghdr *message, struct answer *answer) {
    for (struct cmsghdr *c = CMSG_FIRSTHDR(message); c != NULL; c = CMSG_NXTHDR(message, c)) {
        if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_RIGHTS) {
            continue;
        }
        for (size_t i = 0; CMSG_LEN((i + 1) * sizeof(int)) <= c->cmsg_len; i++) {
            int fd;
            memcpy(&fd, CMSG_DATA(c) + i * sizeof fd, sizeof fd);
            if (answer->fds < FDS) {
                answer->fd[answer->fds++] = fd;
            } else {
                close(fd);
            }
        }
    }
}

/** Reads one line. Returns 0, or errno. */
static int read_line(int fd, struct answer *answer) {
    size_t used = 0;
    for (;;) {
        union {
            struct cmsghdr head;
            char room[CMSG_SPACE(FDS * sizeof(int))];
        } control;
        struct iovec piece = {answer->line + used, sizeof answer->line - 1 - used};
        struct msghdr message = {.msg_iov = &piece,
                                 .msg_iovlen = 1,
                                 .msg_control = &control,
                                 .msg_controllen = sizeof control};
        const ssize_t got = recvmsg(fd, &message, MSG_CMSG_CLOEXEC);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got < 0) {
            return errno == EAGAIN ? ETIMEDOUT : errno;
        }
        if (got == 0) {
            return ECONNRESET;
        }
        keep_fds(&message, answer);
        used += (size_t)got;
        answer->line[used] = 0;
        if (memchr(answer->line, '\n', used) != NULL) {
            return 0;
        }
        if (used + 1 == sizeof answer->line) {
            return EMSGSIZE;
        }
    }
}

/** Text of a key in a line of JSON, unchanged. */
static const char *text_of(const char *line, const char *key, char *room, size_t room_bytes) {
    const char *at = strstr(line, key);
    size_t used = 0;
    room[0] = 0;
    for (at = at != NULL ? at + strlen(key) : ""; *at != 0 && *at != '"'; at++) {
        at += *at == '\\' && at[1] != 0;
        if (used + 1 < room_bytes) {
            room[used++] = *at;
        }
    }
    room[used] = 0;
    return room;
}

static fsn_status read_refusal(const char *line, struct fsn_realtime_fault *fault) {
    static const struct {
        const char *name;
        fsn_status status;
    } known[] = {{"FSN_E_CLOSED", FSN_E_CLOSED},
                 {"FSN_E_STATE", FSN_E_STATE},
                 {"FSN_E_BUSY", FSN_E_BUSY},
                 {"FSN_E_NOMEM", FSN_E_NOMEM},
                 {"FSN_E_SYS", FSN_E_SYS}};
    char text[240];
    char hint[100];
    char error[24];
    fsn_status status = FSN_E_ARG;
    text_of(line, "\"error\":\"", error, sizeof error);
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        status = strcmp(error, known[i].name) == 0 ? known[i].status : status;
    }
    errno = 0;
    text_of(line, "\"text\":\"", text, sizeof text);
    text_of(line, "\"hint\":\"", hint, sizeof hint);
    return refuse(fault, status, text[0] != 0 ? text : "fsn-master refuses",
                  hint[0] != 0 ? hint : error);
}

/* -- the memory ----------------------------------------------------------------------------- */

/** Maps a file whose length matches its head; NULL if it does not come from fsn-master. */
static void *map(int fd, int protection, size_t least_bytes, size_t *size_bytes) {
    struct stat found;
    if (fstat(fd, &found) != 0 || found.st_size < 0 || (size_t)found.st_size < least_bytes) {
        return NULL;
    }
    *size_bytes = (size_t)found.st_size;
    void *at = mmap(NULL, *size_bytes, protection, MAP_SHARED | MAP_POPULATE, fd, 0);
    return at != MAP_FAILED ? at : NULL;
}

static bool take_inputs(struct fsn_realtime *realtime, int fd) {
    const struct fsn_shared_inputs *inputs =
        map(fd, PROT_READ, sizeof *inputs, &realtime->inputs_bytes);
    realtime->inputs = inputs;
    if (inputs == NULL || inputs->magic != FSN_SHARED_MAGIC ||
        inputs->layout != FSN_SHARED_LAYOUT || inputs->size_bytes != realtime->inputs_bytes) {
        return false;
    }
    realtime->symbols = (const void *)((const uint8_t *)inputs + inputs->symbols_at);
    realtime->image = calloc(1, (size_t)inputs->image_bytes + 1);
    realtime->slot = calloc((size_t)inputs->symbol_count + 1, sizeof *realtime->slot);
    return realtime->image != NULL && realtime->slot != NULL;
}

static bool take_outputs(struct fsn_realtime *realtime, int fd) {
    struct fsn_shared_outputs *outputs =
        map(fd, PROT_READ | PROT_WRITE, sizeof *outputs, &realtime->outputs_bytes);
    realtime->outputs = outputs;
    if (outputs == NULL || outputs->magic != FSN_SHARED_MAGIC ||
        outputs->size_bytes != realtime->outputs_bytes) {
        return false;
    }
    realtime->values = calloc(outputs->count, sizeof *realtime->values);
    if (realtime->values == NULL) {
        return false;
    }
    const uint32_t *symbols = (const void *)((const uint8_t *)outputs + outputs->symbols_at);
    for (uint32_t i = 0; i < outputs->count; i++) {
        realtime->slot[symbols[i]] = i + 1;
        realtime->values[i] = realtime->symbols[symbols[i]].stop_value;
    }
    return true;
}

/* -- opening -------------------------------------------------------------------------------- */

static int connect_to(const struct fsn_realtime_options *options) {
    const uint32_t ms = options->timeout_ms != 0 ? options->timeout_ms : DEFAULT_TIMEOUT_MS;
    const struct timeval wait = {.tv_sec = (time_t)(ms / 1000),
                                 .tv_usec = (suseconds_t)(ms % 1000 * 1000)};
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (strlen(options->socket) >= sizeof address.sun_path) {
        errno = ENAMETOOLONG;
        return -1;
    }
    memcpy(address.sun_path, options->socket, strlen(options->socket) + 1);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd >= 0 && (setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait) != 0 ||
                    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &wait, sizeof wait) != 0 ||
                    connect(fd, (const struct sockaddr *)&address, sizeof address) != 0)) {
        const int error = errno;
        close(fd);
        errno = error;
        return -1;
    }
    return fd;
}

/** Sends a line and reads the answer; `fault` describes an error in it. */
static fsn_status ask(const struct fsn_realtime_options *options, int fd, const char *line,
                      size_t len_bytes, struct answer *answer, struct fsn_realtime_fault *fault) {
    if (send(fd, line, len_bytes, MSG_NOSIGNAL) != (ssize_t)len_bytes) {
        return refuse(fault, FSN_E_SYS, options->socket, strerror(errno));
    }
    const int error = read_line(fd, answer);
    if (error != 0) {
        errno = error;
        return refuse(fault, error == ETIMEDOUT ? FSN_E_BUSY : FSN_E_SYS, options->socket,
                      error == ETIMEDOUT ? "fsn-master has not answered in time" : strerror(error));
    }
    return strncmp(answer->line, "{\"ok\":true", 10) == 0 ? FSN_OK
                                                          : read_refusal(answer->line, fault);
}

static fsn_status request(const struct fsn_realtime_options *options, int fd, struct answer *answer,
                          struct fsn_realtime_fault *fault) {
    char line[LINE_BYTES + 8];
    size_t used;
    if (!write_request(options, line, &used)) {
        return refuse(
            fault, FSN_E_ARG, "outputs",
            "a name is missing, or the names are too long for one request; end some in *");
    }
    return ask(options, fd, line, used, answer, fault);
}

/** Maps the files of an answer, and closes its descriptors. */
static bool take_memory(struct fsn_realtime *realtime, struct answer *answer, bool writes) {
    const bool taken = answer->fds == (writes ? 2u : 1u) && take_inputs(realtime, answer->fd[0]) &&
                       (!writes || take_outputs(realtime, answer->fd[1]));
    while (answer->fds > 0) {
        close(answer->fd[--answer->fds]);
    }
    return taken;
}

static fsn_status open_client(const struct fsn_realtime_options *options,
                              struct fsn_realtime *realtime, struct fsn_realtime_fault *fault) {
    struct answer answer = {.fds = 0};
    realtime->fd = connect_to(options);
    if (realtime->fd < 0) {
        return refuse(fault, FSN_E_SYS, options->socket, strerror(errno));
    }
    const bool writes = options->output_count > 0;
    const fsn_status status = request(options, realtime->fd, &answer, fault);
    if (!take_memory(realtime, &answer, writes) && status == FSN_OK) {
        return refuse(fault, FSN_E_NOMEM, "fsn_realtime_open",
                      "the memory of fsn-master cannot be mapped");
    }
    static const char begin[] = "realtime begin\n";
    return status != FSN_OK || !writes
               ? status
               : ask(options, realtime->fd, begin, sizeof begin - 1, &answer, fault);
}

fsn_status fsn_realtime_open(const struct fsn_realtime_options *options, struct fsn_realtime **out,
                             struct fsn_realtime_fault *fault) {
    if (out != NULL) {
        *out = NULL;
    }
    if (options == NULL || out == NULL || options->socket == NULL ||
        (options->output_count > 0 && options->outputs == NULL)) {
        return refuse(fault, FSN_E_ARG, "fsn_realtime_open", "socket or outputs are missing");
    }
    struct fsn_realtime *realtime = calloc(1, sizeof *realtime);
    if (realtime == NULL) {
        return refuse(fault, FSN_E_NOMEM, "fsn_realtime_open", "out of memory");
    }
    const fsn_status status = open_client(options, realtime, fault);
    if (status != FSN_OK) {
        fsn_realtime_close(realtime);
        return status;
    }
    realtime->taken = atomic_load_explicit(&realtime->inputs->shown.whole, memory_order_relaxed);
    *out = realtime;
    return FSN_OK;
}

void fsn_realtime_close(struct fsn_realtime *realtime) {
    if (realtime == NULL) {
        return;
    }
    if (realtime->fd >= 0) {
        close(realtime->fd);
    }
    if (realtime->inputs != NULL) {
        munmap((void *)realtime->inputs, realtime->inputs_bytes);
    }
    if (realtime->outputs != NULL) {
        munmap(realtime->outputs, realtime->outputs_bytes);
    }
    free(realtime->image);
    free(realtime->slot);
    free(realtime->values);
    free(realtime);
}

/* -- symbols -------------------------------------------------------------------------------- */

uint32_t fsn_realtime_symbol_count(const struct fsn_realtime *realtime) {
    return realtime->inputs->symbol_count;
}

fsn_status fsn_realtime_symbol(const struct fsn_realtime *realtime, uint32_t number,
                               struct fsn_realtime_symbol *info) {
    if (number >= realtime->inputs->symbol_count) {
        return FSN_E_ARG;
    }
    const struct fsn_shared_symbol *symbol = &realtime->symbols[number];
    const char *names = (const char *)realtime->inputs;
    *info = (struct fsn_realtime_symbol){.name = names + symbol->name,
                                         .subdevice = names + symbol->subdevice,
                                         .factor = symbol->factor,
                                         .offset = symbol->offset,
                                         .stop_value = symbol->stop_value,
                                         .bit_offset = symbol->bit_offset,
                                         .bits = symbol->bits,
                                         .index = symbol->index,
                                         .subindex = symbol->subindex,
                                         .kind = symbol->kind,
                                         .output = symbol->output != 0,
                                         .owned = realtime->slot[number] != 0};
    return FSN_OK;
}

static int32_t find(const struct fsn_realtime *realtime, const char *name, bool output) {
    for (uint32_t i = 0; i < realtime->inputs->symbol_count; i++) {
        const struct fsn_shared_symbol *symbol = &realtime->symbols[i];
        if ((symbol->output != 0) == output &&
            strcmp((const char *)realtime->inputs + symbol->name, name) == 0) {
            return (int32_t)i;
        }
    }
    return FSN_REALTIME_NONE;
}

int32_t fsn_realtime_input(const struct fsn_realtime *realtime, const char *name) {
    return find(realtime, name, false);
}

int32_t fsn_realtime_output(const struct fsn_realtime *realtime, const char *name) {
    return find(realtime, name, true);
}

/** NULL: no such number. */
static const struct fsn_shared_symbol *symbol_of(const struct fsn_realtime *realtime,
                                                 int32_t number) {
    return number >= 0 && (uint32_t)number < realtime->inputs->symbol_count
               ? &realtime->symbols[number]
               : NULL;
}

/* -- cycles --------------------------------------------------------------------------------- */

/** Takes the newest snapshot; false if the master has begun to overwrite it in the meantime. */
static bool take(struct fsn_realtime *realtime, uint32_t whole) {
    const struct fsn_shared_inputs *inputs = realtime->inputs;
    const _Atomic uint64_t *words = (const void *)((const uint8_t *)inputs + inputs->pictures_at);
    struct fsn_shared_cycle cycle;
    words = fsn_words_take(words + (whole % FSN_SHARED_PICTURES) * inputs->picture_words, &cycle,
                           sizeof cycle);
    fsn_words_take(words, realtime->image, inputs->image_bytes);
    /* The loads above must not be reordered after this check for a new write. */
    atomic_thread_fence(memory_order_acquire);
    if (atomic_load_explicit(&inputs->shown.begun, memory_order_relaxed) - whole >=
        FSN_SHARED_PICTURES) {
        return false;
    }
    realtime->cycle = cycle;
    realtime->taken = whole;
    return true;
}

/** Sleeps until the next cycle is expected, then in small steps. */
static void sleep_for_next(const struct fsn_realtime *realtime, uint64_t now_ns,
                           uint64_t until_ns) {
    enum { STEPS = 64, LEAST_NS = 2000, MOST_NS = 100000 };
    uint64_t step_ns = realtime->inputs->cycle_ns / STEPS;
    step_ns = step_ns > LEAST_NS ? step_ns : LEAST_NS;
    step_ns = step_ns < MOST_NS ? step_ns : MOST_NS;
    uint64_t at_ns = realtime->cycle.next_ns + realtime->cycle.shown_ns;
    at_ns = at_ns > now_ns ? at_ns : now_ns + step_ns;
    at_ns = at_ns < until_ns ? at_ns : until_ns;
    const struct timespec at = {.tv_sec = (time_t)(at_ns / 1000000000u),
                                .tv_nsec = (long)(at_ns % 1000000000u)};
    (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
}

/** Whether fsn-master has ended without marking the memory. */
static bool has_ended(const struct fsn_realtime *realtime) {
    char byte;
    return recv(realtime->fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT) == 0;
}

static bool holds_outputs(const struct fsn_realtime *realtime) {
    const struct fsn_shared_outputs *outputs = realtime->outputs;
    if (outputs == NULL) {
        return true;
    }
    const struct fsn_shared_client *shown =
        &realtime->inputs->client[outputs->place % FSN_SHARED_CLIENTS];
    return atomic_load_explicit(&shown->holder, memory_order_relaxed) == outputs->holder &&
           atomic_load_explicit(&shown->state, memory_order_relaxed) != FSN_SHARED_LATE;
}

fsn_status fsn_realtime_wait(struct fsn_realtime *realtime, uint64_t timeout_ns,
                             struct fsn_realtime_cycle *cycle) {
    const struct fsn_shared_inputs *inputs = realtime->inputs;
    const uint64_t before = realtime->cycle.cycle;
    uint64_t now_ns = fsn_clock_ns(CLOCK_MONOTONIC);
    /* Saturated: a caller may wait forever. */
    const uint64_t until_ns = timeout_ns < UINT64_MAX - now_ns ? now_ns + timeout_ns : UINT64_MAX;
    for (uint32_t sleeps = 1;; sleeps++, now_ns = fsn_clock_ns(CLOCK_MONOTONIC)) {
        /* Acquire: the values belong to the number read here. */
        const uint32_t whole = atomic_load_explicit(&inputs->shown.whole, memory_order_acquire);
        if (whole != realtime->taken && take(realtime, whole)) {
            break;
        }
        if (atomic_load_explicit(&inputs->open, memory_order_relaxed) == 0) {
            return FSN_E_STATE;
        }
        const bool over = now_ns >= until_ns;
        /* The process is checked only at intervals, because that needs a system call. */
        if ((over || sleeps % LOOK_AFTER == 0) && has_ended(realtime)) {
            return FSN_E_STATE;
        }
        if (over) {
            return FSN_E_BUSY;
        }
        sleep_for_next(realtime, now_ns, until_ns);
    }
    const struct fsn_shared_cycle *seen = &realtime->cycle;
    if (cycle != NULL) {
        *cycle = (struct fsn_realtime_cycle){.cycle = seen->cycle,
                                             .now_ns = seen->now_ns,
                                             .next_ns = seen->next_ns,
                                             .dc_time_ns = seen->dc_time_ns,
                                             .skipped = before == 0 ? 0 : seen->cycle - before - 1,
                                             .overruns = seen->overruns,
                                             .expected_wkc = seen->expected_wkc,
                                             .actual_wkc = seen->actual_wkc};
    }
    /* Outputs that fell back must be noticed in the same call that returns the inputs. */
    return holds_outputs(realtime) ? FSN_OK : FSN_E_CLOSED;
}

/* -- values --------------------------------------------------------------------------------- */

uint64_t fsn_realtime_get(const struct fsn_realtime *realtime, int32_t number) {
    const struct fsn_shared_symbol *symbol = symbol_of(realtime, number);
    return symbol == NULL ? 0 : fsn_read_bits(realtime->image, symbol->bit_offset, symbol->bits);
}

double fsn_realtime_value(const struct fsn_realtime *realtime, int32_t number) {
    const struct fsn_shared_symbol *symbol = symbol_of(realtime, number);
    if (symbol == NULL || symbol->bits == 0) {
        return 0;
    }
    const double raw =
        fsn_number_of(symbol->kind, symbol->bits, fsn_realtime_get(realtime, number));
    if (symbol->kind == FSN_KIND_BOOL) {
        return raw;
    }
    return symbol->output != 0 ? (raw - symbol->offset) / symbol->factor
                               : symbol->factor * raw + symbol->offset;
}

fsn_status fsn_realtime_set(struct fsn_realtime *realtime, int32_t number, uint64_t raw) {
    if (symbol_of(realtime, number) == NULL || realtime->slot[number] == 0) {
        return FSN_E_CLOSED;
    }
    realtime->values[realtime->slot[number] - 1] = raw;
    return FSN_OK;
}

fsn_status fsn_realtime_set_value(struct fsn_realtime *realtime, int32_t number, double value) {
    const struct fsn_shared_symbol *symbol = symbol_of(realtime, number);
    uint64_t raw;
    if (symbol == NULL || realtime->slot[number] == 0) {
        return FSN_E_CLOSED;
    }
    if (symbol->kind != FSN_KIND_BOOL) {
        value = symbol->factor * value + symbol->offset;
    }
    if (!fsn_bits_of(symbol->kind, symbol->bits, value, &raw)) {
        return FSN_E_ARG;
    }
    return fsn_realtime_set(realtime, number, raw);
}

void fsn_realtime_send(struct fsn_realtime *realtime) {
    struct fsn_shared_outputs *outputs = realtime->outputs;
    if (outputs == NULL) {
        return;
    }
    const uint32_t number = atomic_load_explicit(&outputs->sent.whole, memory_order_relaxed) + 1;
    atomic_store_explicit(&outputs->sent.begun, number, memory_order_relaxed);
    atomic_thread_fence(memory_order_release);
    _Atomic uint64_t *words = (void *)((uint8_t *)outputs + outputs->sets_at);
    words += (number % FSN_SHARED_SETS) * (1 + (size_t)outputs->count);
    words = fsn_words_put(words, &realtime->cycle.cycle, sizeof realtime->cycle.cycle);
    fsn_words_put(words, realtime->values, outputs->count * sizeof *realtime->values);
    atomic_store_explicit(&outputs->sent.whole, number, memory_order_release);
}

struct fsn_realtime_counts fsn_realtime_counts(const struct fsn_realtime *realtime) {
    const struct fsn_shared_outputs *outputs = realtime->outputs;
    if (outputs == NULL) {
        return (struct fsn_realtime_counts){0};
    }
    const struct fsn_shared_client *shown =
        &realtime->inputs->client[outputs->place % FSN_SHARED_CLIENTS];
    return (struct fsn_realtime_counts){
        .on_time = atomic_load_explicit(&shown->on_time, memory_order_relaxed),
        .late = atomic_load_explicit(&shown->late, memory_order_relaxed),
        .missed = atomic_load_explicit(&shown->missed, memory_order_relaxed),
        .torn = atomic_load_explicit(&shown->torn, memory_order_relaxed)};
}

const uint8_t *fsn_realtime_image(const struct fsn_realtime *realtime) {
    return realtime->image;
}

uint32_t fsn_realtime_image_bytes(const struct fsn_realtime *realtime) {
    return realtime->inputs->image_bytes;
}

uint64_t fsn_realtime_cycle_ns(const struct fsn_realtime *realtime) {
    return realtime->inputs->cycle_ns;
}
