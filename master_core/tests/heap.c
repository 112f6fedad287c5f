/** This program's allocator takes the place of libc's. */
#define _GNU_SOURCE

#include "heap.h"

#include <dlfcn.h>
#include <errno.h>
#include <malloc.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct {
    void *(*malloc)(size_t);
    void *(*calloc)(size_t, size_t);
    void *(*realloc)(void *, size_t);
    void *(*aligned_alloc)(size_t, size_t);
    void (*free)(void *);
} libc;

struct heap heap;

/** What is hidden libc would not call, as in strdup(). */
#define SHOWN __attribute__((visibility("default")))

static void find(void *to, const char *name) {
    void *found = dlsym(RTLD_NEXT, name);
    memcpy(to, &found, sizeof found);
}

static bool runs_out(void) {
    const bool here = heap.fails_in > 0 && --heap.fails_in == 0;
    errno = here ? ENOMEM : errno;
    return here;
}

/* -- guards ------------------------------------------------------------------------------------
 * The requested bytes are followed by guard bytes, and these by their start address. free() checks
 * them; memory without such an end was not allocated by this file. */

enum { GUARD = 64, FILL = 0xFD };

struct end {
    size_t bytes;
    uintptr_t mark; /**< of this block */
};

static struct end *end_of(void *block) {
    return (struct end *)(void *)((uint8_t *)block + (malloc_usable_size(block) & ~(size_t)15)) - 1;
}

static uintptr_t mark_of(const void *block, size_t bytes) {
    return ((uintptr_t)block ^ bytes) + 0x5AFE;
}

static size_t with_guard(size_t bytes) {
    return bytes > PTRDIFF_MAX / 2 ? bytes : bytes + GUARD + 2 * sizeof(struct end);
}

static void *guarded(void *made, size_t bytes) {
    if (made != NULL) {
        struct end *end = end_of(made);
        memset((uint8_t *)made + bytes, FILL, (size_t)((uint8_t *)end - (uint8_t *)made) - bytes);
        *end = (struct end){bytes, mark_of(made, bytes)};
    }
    return made;
}

static void look_at(void *block) {
    if (block == NULL) {
        return;
    }
    struct end *end = end_of(block);
    if (end->mark != mark_of(block, end->bytes)) {
        return;
    }
    for (const uint8_t *at = (uint8_t *)block + end->bytes; at < (uint8_t *)end; at++) {
        if (*at != FILL) {
            static const char text[] = "heap: bytes after a block were overwritten\n";
            (void)!write(STDERR_FILENO, text, sizeof text - 1);
            abort();
        }
    }
    end->mark = 0;
}

/* -- the calls -------------------------------------------------------------------------------- */

static void *counted(void *made) {
    heap.alive += made != NULL;
    return made;
}

SHOWN void *malloc(size_t bytes) {
    if (libc.malloc == NULL) {
        find(&libc.malloc, "malloc");
    }
    return runs_out() ? NULL : guarded(counted(libc.malloc(with_guard(bytes))), bytes);
}

SHOWN void *calloc(size_t count, size_t bytes) {
    if (libc.calloc == NULL) {
        find(&libc.calloc, "calloc");
    }
    size_t all;
    if (runs_out() || __builtin_mul_overflow(count, bytes, &all)) {
        return NULL;
    }
    return guarded(counted(libc.calloc(1, with_guard(all))), all);
}

SHOWN void *realloc(void *old, size_t bytes) {
    if (libc.realloc == NULL) {
        find(&libc.realloc, "realloc");
    }
    if (runs_out()) {
        return NULL;
    }
    look_at(old);
    void *made = guarded(libc.realloc(old, with_guard(bytes)), bytes);
    heap.alive += old == NULL && made != NULL;
    return made;
}

SHOWN void *aligned_alloc(size_t alignment, size_t bytes) {
    if (libc.aligned_alloc == NULL) {
        find(&libc.aligned_alloc, "aligned_alloc");
    }
    return runs_out() ? NULL
                      : guarded(counted(libc.aligned_alloc(alignment, with_guard(bytes))), bytes);
}

SHOWN void free(void *old) {
    if (libc.free == NULL) {
        find(&libc.free, "free");
    }
    look_at(old);
    heap.alive -= old != NULL;
    libc.free(old);
}
