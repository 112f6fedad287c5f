#include "weak.h"

#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LOCATIONS = 256, VALUES = 12, DEPTH = 256 };

/** Oldest value of each location that may be read. */
struct view {
    uint8_t oldest[LOCATIONS];
};

struct value {
    uint64_t value;
    struct view view; /**< passed on to whoever acquires it */
};

struct location {
    const volatile void *at;
    uint8_t count;
    struct value values[VALUES];
};

/** `released` goes with relaxed stores after a fence, `read` is acquired by the next fence. */
struct thread {
    struct view view, released, read;
};

static struct {
    struct location locations[LOCATIONS];
    uint32_t count;
    struct thread threads[WEAK_THREADS];
    struct thread *thread;
} memory;

static struct {
    uint8_t choice[DEPTH], of[DEPTH];
    uint32_t depth, at;
} path;

static struct {
    struct weak_site sites[WEAK_SITES];
    uint32_t count;
    const struct weak_site *weakened;
    enum weak_order as;
} orders;

void (*weak_before_store)(const volatile void *at, uint64_t value);

static jmp_buf violated;

static void require(bool condition, const char *text) {
    if (!condition) {
        fprintf(stderr, "weak: %s\n", text);
        abort();
    }
}

void weak_violation(void) {
    longjmp(violated, 1);
}

uint32_t weak_choose(uint32_t count) {
    if (path.at == path.depth) {
        require(path.depth < DEPTH && count < UINT8_MAX, "too many choices");
        path.choice[path.depth] = 0;
        path.of[path.depth++] = (uint8_t)count;
    }
    require(path.of[path.at] == count, "a run differs from the one before");
    return path.choice[path.at++];
}

/** The next path in the order of depth; false after the last one. */
static bool next_path(void) {
    while (path.depth > 0 && path.choice[path.depth - 1] + 1 == path.of[path.depth - 1]) {
        path.depth--;
    }
    if (path.depth == 0) {
        return false;
    }
    path.choice[path.depth - 1]++;
    return true;
}

static bool is_same(const struct weak_site *a, const struct weak_site *b) {
    return a->line == b->line && strcmp(a->file, b->file) == 0;
}

/** The order at a place of the source, unless it is weakened. */
static enum weak_order order_at(const char *file, int line, enum weak_order order) {
    const struct weak_site site = {file, line, order};
    if (order == memory_order_relaxed) {
        return order;
    }
    uint32_t n = 0;
    while (n < orders.count && !is_same(&orders.sites[n], &site)) {
        n++;
    }
    if (n == orders.count) {
        require(n < WEAK_SITES, "too many orders");
        orders.sites[orders.count++] = site;
    }
    return orders.weakened != NULL && is_same(orders.weakened, &site) ? orders.as : order;
}

static bool acquires(enum weak_order order) {
    return order == memory_order_acquire || order >= memory_order_acq_rel;
}

static bool releases(enum weak_order order) {
    return order >= memory_order_release;
}

static void join(struct view *view, const struct view *other) {
    for (uint32_t n = 0; n < memory.count; n++) {
        if (view->oldest[n] < other->oldest[n]) {
            view->oldest[n] = other->oldest[n];
        }
    }
}

/** Number of a location; one that is new has the value that is in the memory. */
static uint32_t locate(const volatile void *at, size_t bytes) {
    for (uint32_t n = 0; n < memory.count; n++) {
        if (memory.locations[n].at == at) {
            return n;
        }
    }
    require(memory.count < LOCATIONS, "too many locations");
    struct location *new = &memory.locations[memory.count];
    *new = (struct location){.at = at, .count = 1};
    const volatile uint8_t *from = at;
    uint8_t raw[sizeof(uint64_t)] = {0};
    for (size_t i = 0; i < bytes; i++) {
        raw[i] = from[i];
    }
    switch (bytes) { /* either byte order */
    case 1:
        new->values[0].value = raw[0];
        break;
    case 4: {
        uint32_t word;
        memcpy(&word, raw, 4);
        new->values[0].value = word;
        break;
    }
    default:
        memcpy(&new->values[0].value, raw, 8);
    }
    return memory.count++;
}

static uint64_t read_value(uint32_t n, uint32_t index, enum weak_order order) {
    struct thread *thread = memory.thread;
    const struct value *value = &memory.locations[n].values[index];
    thread->view.oldest[n] = (uint8_t)index;
    join(&thread->read, &thread->view);
    join(&thread->read, &value->view);
    if (acquires(order)) {
        join(&thread->view, &value->view);
    }
    return value->value;
}

/** Adds the newest value. `before` is the view of the value that an exchange has read. */
static void add_value(uint32_t n, uint64_t number, enum weak_order order,
                      const struct view *before) {
    struct thread *thread = memory.thread;
    struct location *location = &memory.locations[n];
    require(location->count < VALUES, "too many values");
    const uint8_t index = location->count++;
    thread->view.oldest[n] = thread->read.oldest[n] = index;
    struct value *value = &location->values[index];
    *value = (struct value){number, releases(order) ? thread->view : thread->released};
    value->view.oldest[n] = index;
    if (before != NULL) {
        join(&value->view, before);
    }
}

uint64_t weak_load(const volatile void *at, size_t bytes, const char *file, int line,
                   enum weak_order order) {
    const uint32_t n = locate(at, bytes), newest = memory.locations[n].count - 1u;
    const uint32_t older = weak_choose(newest - memory.thread->view.oldest[n] + 1);
    return read_value(n, newest - older, order_at(file, line, order));
}

void weak_store(volatile void *at, size_t bytes, const char *file, int line, enum weak_order order,
                uint64_t value) {
    if (weak_before_store != NULL) {
        weak_before_store(at, value);
    }
    add_value(locate(at, bytes), value, order_at(file, line, order), NULL);
}

uint64_t weak_exchange(volatile void *at, size_t bytes, const char *file, int line,
                       enum weak_order order, uint64_t value) {
    const enum weak_order actual = order_at(file, line, order);
    const uint32_t n = locate(at, bytes), newest = memory.locations[n].count - 1u;
    const uint64_t before = read_value(n, newest, actual);
    add_value(n, value, actual, &memory.locations[n].values[newest].view);
    return before;
}

void weak_fence(const char *file, int line, enum weak_order order) {
    const enum weak_order actual = order_at(file, line, order);
    struct thread *thread = memory.thread;
    if (acquires(actual)) {
        join(&thread->view, &thread->read);
    }
    if (releases(actual)) {
        thread->released = thread->view;
    }
}

void weak_thread(uint32_t thread) {
    memory.thread = &memory.threads[thread];
}

/* Each access is a value of a location of its own: reads of the data at its first byte, writes at
 * its second one. */
void weak_data(const void *data, bool is_write) {
    const uint8_t *at = data;
    const uint32_t reads = locate(at, 1), writes = locate(at + 1, 1);
    const struct view *view = &memory.thread->view;
    if (view->oldest[writes] + 1 != memory.locations[writes].count ||
        (is_write && view->oldest[reads] + 1 != memory.locations[reads].count)) {
        weak_violation();
    }
    add_value(is_write ? writes : reads, 0, memory_order_relaxed, NULL);
}

struct weak_result weak_explore(void (*run)(void), const struct weak_site *weakened,
                                enum weak_order as) {
    static struct weak_result result; /* kept over longjmp() */
    result = (struct weak_result){0};
    orders.count = weakened == NULL ? 0 : orders.count;
    orders.weakened = weakened;
    orders.as = as;
    path.depth = 0;
    do {
        path.at = 0;
        memory.count = 0;
        memset(memory.threads, 0, sizeof memory.threads);
        weak_thread(0);
        result.runs++;
        if (setjmp(violated) != 0) {
            result.violated = true;
            return result;
        }
        run();
    } while (next_path());
    return result;
}

uint32_t weak_sites(struct weak_site sites[WEAK_SITES]) {
    memcpy(sites, orders.sites, sizeof orders.sites);
    return orders.count;
}
