#define _GNU_SOURCE

#include "core/clients.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/core_internal.h"
#include "rt/prefault.h"
#include "rt/words.h"

#ifndef F_SEAL_FUTURE_WRITE
#define F_SEAL_FUTURE_WRITE 0x0010
#endif

static size_t align(size_t bytes) {
    return (bytes + FSN_SHARED_ALIGN - 1) / FSN_SHARED_ALIGN * FSN_SHARED_ALIGN;
}

/** Creates a file in memory with a fixed size, and maps it here. Returns its descriptor, or -1 with
 *  errno.
 *  @param[in] seals  seals in addition to those of its size. */
static int make_file(const char *name, size_t size_bytes, int seals, void **at) {
    const int fd = memfd_create(name, MFD_CLOEXEC | MFD_ALLOW_SEALING);
    if (fd < 0) {
        return -1;
    }
    *at = MAP_FAILED;
    if (ftruncate(fd, (off_t)size_bytes) == 0) {
        /* Every page is present before the cycle accesses it. */
        *at = mmap(NULL, size_bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd, 0);
    }
    if (*at == MAP_FAILED || fcntl(fd, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | seals) != 0) {
        const int error = errno;
        if (*at != MAP_FAILED) {
            munmap(*at, size_bytes);
        }
        close(fd);
        errno = error;
        return -1;
    }
    return fd;
}

static uint32_t put_name(struct fsn_shared_inputs *inputs, size_t *at, const char *name) {
    const size_t begin = *at;
    const size_t bytes = strlen(name) + 1;
    memcpy((uint8_t *)inputs + begin, name, bytes);
    *at = begin + bytes;
    return (uint32_t)begin;
}

/** Writes the symbols and their names after the head; returns the end position. */
static size_t put_symbols(const struct fsn_core *core, struct fsn_shared_inputs *inputs) {
    const uint32_t count = core->plan->count[FSN_SEC_SYMBOL];
    size_t at = align(sizeof *inputs);
    size_t name_at = at + count * sizeof(struct fsn_shared_symbol);
    for (uint32_t i = 0; i < count; i++, at += sizeof(struct fsn_shared_symbol)) {
        const struct fsn_symbol_info info = fsn_known_symbol(core->plan, i);
        const struct fsn_entry_record object = fsn_symbol_object(core->plan, &info);
        const uint32_t name = put_name(inputs, &name_at, info.name);
        const uint32_t subdevice =
            put_name(inputs, &name_at, fsn_symbol_subdevice(core->plan, &info));
        const struct fsn_shared_symbol symbol = {.factor = info.factor,
                                                 .offset = info.offset,
                                                 .stop_value = info.stop_value,
                                                 .name = name,
                                                 .bit_offset = core->rt.outputs[i].bit_offset,
                                                 .bits = (uint16_t)core->rt.outputs[i].bits,
                                                 .kind = info.kind,
                                                 .output = info.output,
                                                 .subdevice = subdevice,
                                                 .index = object.index,
                                                 .subindex = object.subindex};
        memcpy((uint8_t *)inputs + at, &symbol, sizeof symbol);
    }
    return align(name_at);
}

static size_t symbols_bytes(const struct fsn_core *core) {
    const uint32_t count = core->plan->count[FSN_SEC_SYMBOL];
    size_t bytes = align(sizeof(struct fsn_shared_inputs));
    for (uint32_t i = 0; i < count; i++) {
        const struct fsn_symbol_info info = fsn_known_symbol(core->plan, i);
        bytes += sizeof(struct fsn_shared_symbol) + strlen(info.name) + 1 +
                 strlen(fsn_symbol_subdevice(core->plan, &info)) + 1;
    }
    return align(bytes);
}

/** Creates the file that shows the cycles, for the first client. */
static fsn_status make_inputs(struct fsn_core *core) {
    struct fsn_rt_clients *clients = &core->rt.clients;
    const size_t words =
        fsn_words_of(sizeof(struct fsn_shared_cycle)) + fsn_words_of(core->rt.image_bytes);
    const size_t pictures_at = symbols_bytes(core);
    const size_t size_bytes = pictures_at + FSN_SHARED_PICTURES * words * sizeof(uint64_t);
    void *at;
    if (clients->inputs != NULL) {
        return FSN_OK;
    }
    core->inputs_fd = make_file("fsn-inputs", size_bytes, F_SEAL_FUTURE_WRITE | F_SEAL_SEAL, &at);
    if (core->inputs_fd < 0) {
        return FSN_E_SYS;
    }
    struct fsn_shared_inputs *inputs = at;
    inputs->magic = FSN_SHARED_MAGIC;
    inputs->layout = FSN_SHARED_LAYOUT;
    inputs->size_bytes = size_bytes;
    inputs->cycle_ns = core->plan->cycle_ns;
    inputs->symbols_at = align(sizeof *inputs);
    inputs->symbol_count = core->plan->count[FSN_SEC_SYMBOL];
    inputs->image_bytes = core->rt.image_bytes;
    inputs->pictures_at = put_symbols(core, inputs);
    inputs->picture_words = words;
    fsn_plan_sha256(core->plan, inputs->plan_sha256);
    atomic_store(&inputs->open, 1);
    clients->pictures = (_Atomic uint64_t *)(void *)((uint8_t *)at + pictures_at);
    clients->inputs = inputs;
    return FSN_OK;
}

static size_t sets_at(uint32_t count) {
    return align(align(sizeof(struct fsn_shared_outputs)) + count * sizeof(uint32_t));
}

static size_t outputs_bytes(uint32_t count) {
    return sets_at(count) + FSN_SHARED_SETS * (1 + (size_t)count) * sizeof(uint64_t);
}

/** Releases the resources of a client. */
static void clear_place(struct fsn_core *core, uint32_t n) {
    struct fsn_core_place *place = &core->places[n];
    if (place->outputs != NULL) {
        if (place->fd >= 0) {
            close(place->fd);
        }
        munmap(place->outputs, outputs_bytes(core->rt.clients.client[n].count));
    }
    free(place->symbols);
    free(place->values);
    *place = (struct fsn_core_place){0};
    core->rt.clients.client[n] = (struct fsn_rt_client){0};
}

/** Creates the file for the outputs of a client; returns a descriptor for the client. */
static int make_outputs(struct fsn_core *core, const struct fsn_core_client *wanted, uint32_t n) {
    struct fsn_core_place *place = &core->places[n];
    void *at;
    const int fd = make_file("fsn-outputs", outputs_bytes(wanted->count), 0, &at);
    if (fd < 0) {
        return -1;
    }
    struct fsn_shared_outputs *outputs = at;
    place->outputs = outputs;
    place->fd = fd;
    outputs->magic = FSN_SHARED_MAGIC;
    outputs->layout = FSN_SHARED_LAYOUT;
    outputs->size_bytes = outputs_bytes(wanted->count);
    outputs->symbols_at = align(sizeof *outputs);
    outputs->sets_at = sets_at(wanted->count);
    outputs->count = wanted->count;
    outputs->place = n;
    outputs->holder = ++core->holders;
    outputs->misses = wanted->misses;
    memcpy((uint8_t *)at + outputs->symbols_at, place->symbols,
           wanted->count * sizeof *place->symbols);
    return fcntl(fd, F_DUPFD_CLOEXEC, 0);
}

/** Fills the fields that the cycle reads; they are not written afterwards. */
static void set_up(struct fsn_core *core, const struct fsn_core_client *wanted, uint32_t n) {
    struct fsn_core_place *place = &core->places[n];
    struct fsn_rt_client *client = &core->rt.clients.client[n];
    struct fsn_shared_client *shown = &core->rt.clients.inputs->client[n];
    *client = (struct fsn_rt_client){.symbols = place->symbols,
                                     .values = place->values,
                                     .fresh = place->values + wanted->count,
                                     .shown = shown,
                                     .count = wanted->count,
                                     .misses = wanted->misses};
    if (wanted->count > 0) {
        const uint64_t *sets = (void *)((uint8_t *)place->outputs + sets_at(wanted->count));
        client->sent = &place->outputs->sent;
        for (size_t i = 0; i < FSN_SHARED_SETS; i++) {
            client->set[i] = (const _Atomic uint64_t *)(sets + i * (1 + (size_t)wanted->count));
        }
    }
    atomic_store(&shown->on_time, 0);
    atomic_store(&shown->late, 0);
    atomic_store(&shown->missed, 0);
    atomic_store(&shown->torn, 0);
    atomic_store(&shown->state, FSN_SHARED_WAITS);
    atomic_store(&shown->holder, core->holders);
}

/** A free place. A place that was closed is free after the cycle that may still read it. */
static uint32_t find_place(struct fsn_core *core) {
    const uint64_t last = fsn_core_last_cycle(core);
    for (uint32_t n = 0; n < FSN_SHARED_CLIENTS; n++) {
        struct fsn_core_place *place = &core->places[n];
        if (place->used && place->closed && (!core->running || last > place->closed_after)) {
            clear_place(core, n);
        }
        if (!place->used) {
            return n;
        }
    }
    return FSN_NONE;
}

static fsn_status fill_place(struct fsn_core *core, const struct fsn_core_client *wanted,
                             uint32_t n, int fds[FSN_CLIENT_FDS]) {
    struct fsn_core_place *place = &core->places[n];
    const size_t count = wanted->count;
    place->used = true;
    if (!FSN_NEW_PREFAULTED(place->symbols, count) ||
        !FSN_NEW_PREFAULTED(place->values, 2 * count)) {
        return FSN_E_NOMEM;
    }
    if (count > 0) {
        memcpy(place->symbols, wanted->symbols, count * sizeof *place->symbols);
        fds[1] = make_outputs(core, wanted, n);
    }
    fds[0] = fcntl(core->inputs_fd, F_DUPFD_CLOEXEC, 0);
    return fds[0] < 0 || (count > 0 && fds[1] < 0) ? FSN_E_SYS : FSN_OK;
}

static fsn_status check_wanted(const struct fsn_core *core, const struct fsn_core_client *wanted) {
    for (uint32_t i = 0; i < wanted->count; i++) {
        if (wanted->symbols[i] >= core->plan->count[FSN_SEC_SYMBOL]) {
            return FSN_E_ARG;
        }
        if (!fsn_core_is_open(core, wanted->symbols[i])) {
            return FSN_E_CLOSED;
        }
    }
    return FSN_OK;
}

/** All fields that the cycle reads are complete. */
static void let_in(struct fsn_core *core, uint32_t n) {
    atomic_fetch_or_explicit(&core->rt.clients.present, 1u << n, memory_order_release);
}

fsn_status fsn_core_client_open(struct fsn_core *core, const struct fsn_core_client *wanted,
                                uint32_t *number, int fds[FSN_CLIENT_FDS]) {
    fds[0] = fds[1] = -1;
    FSN_TRY(check_wanted(core, wanted));
    FSN_TRY(make_inputs(core));
    const uint32_t n = find_place(core);
    if (n == FSN_NONE) {
        return FSN_E_BUSY;
    }
    const fsn_status status = fill_place(core, wanted, n, fds);
    if (status != FSN_OK) {
        const int error = errno;
        for (int i = 0; i < FSN_CLIENT_FDS; i++) {
            if (fds[i] >= 0) {
                close(fds[i]);
            }
        }
        clear_place(core, n);
        errno = error;
        return status;
    }
    set_up(core, wanted, n);
    *number = n;
    if (wanted->count == 0) {
        let_in(core, n);
    }
    return FSN_OK;
}

/** Pages that the client removed before the seal are mapped again here, not in the cycle. */
static void touch(const struct fsn_shared_outputs *outputs, size_t size_bytes) {
    enum { STEP_BYTES = 1024 }; /* no page is smaller */
    const volatile uint8_t *at = (const volatile uint8_t *)outputs;
    for (size_t i = 0; i < size_bytes; i += STEP_BYTES) {
        (void)at[i];
    }
}

fsn_status fsn_core_client_begin(struct fsn_core *core, uint32_t n) {
    struct fsn_core_place *place = &core->places[n];
    if (place->outputs == NULL || place->fd < 0) {
        return FSN_OK; /* it has none, or has already begun */
    }
    (void)fcntl(place->fd, F_ADD_SEALS, F_SEAL_FUTURE_WRITE | F_SEAL_SEAL);
    const int seals = fcntl(place->fd, F_GET_SEALS);
    close(place->fd);
    place->fd = -1;
    const bool sealed = seals >= 0 && /* GCOVR_EXCL_BR_LINE: a file in memory has seals */
                        (seals & F_SEAL_FUTURE_WRITE) != 0;
    if (!sealed) {
        errno = EPERM; /* it was the client that has sealed the seals */
        return FSN_E_SYS;
    }
    touch(place->outputs, outputs_bytes(core->rt.clients.client[n].count));
    let_in(core, n);
    return FSN_OK;
}

void fsn_core_client_close(struct fsn_core *core, uint32_t n) {
    atomic_fetch_and_explicit(&core->rt.clients.present, ~(1u << n), memory_order_release);
    core->places[n].closed = true;
    core->places[n].closed_after = fsn_core_last_cycle(core);
    atomic_store(&core->rt.clients.inputs->client[n].holder, 0);
}

struct fsn_core_client_seen fsn_core_client_seen(const struct fsn_core *core, uint32_t n) {
    const struct fsn_rt_client *client = &core->rt.clients.client[n];
    const struct fsn_shared_client *shown = client->shown;
    return (struct fsn_core_client_seen){
        .count = client->count,
        .misses = client->misses,
        .state = atomic_load_explicit(&shown->state, memory_order_relaxed),
        .on_time = atomic_load_explicit(&shown->on_time, memory_order_relaxed),
        .late = atomic_load_explicit(&shown->late, memory_order_relaxed),
        .missed = atomic_load_explicit(&shown->missed, memory_order_relaxed),
        .torn = atomic_load_explicit(&shown->torn, memory_order_relaxed)};
}

void fsn_core_clients_end(struct fsn_core *core) {
    struct fsn_shared_inputs *inputs = core->rt.clients.inputs;
    for (uint32_t n = 0; n < FSN_SHARED_CLIENTS; n++) {
        clear_place(core, n);
    }
    if (inputs != NULL) {
        atomic_store(&inputs->open, 0);
        munmap(inputs, (size_t)inputs->size_bytes);
        close(core->inputs_fd);
    }
}
