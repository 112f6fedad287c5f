/** This program's allocator takes the place of libc's. */
#define _GNU_SOURCE

#include "heap.h"

#include <dlfcn.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

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
    return heap.fails_in > 0 && --heap.fails_in == 0;
}

static void *counted(void *made) {
    heap.alive += made != NULL;
    return made;
}

SHOWN void *malloc(size_t bytes) {
    if (libc.malloc == NULL) {
        find(&libc.malloc, "malloc");
    }
    return runs_out() ? NULL : counted(libc.malloc(bytes));
}

SHOWN void *calloc(size_t count, size_t bytes) {
    if (libc.calloc == NULL) {
        find(&libc.calloc, "calloc");
    }
    return runs_out() ? NULL : counted(libc.calloc(count, bytes));
}

SHOWN void *realloc(void *old, size_t bytes) {
    if (libc.realloc == NULL) {
        find(&libc.realloc, "realloc");
    }
    if (runs_out()) {
        return NULL;
    }
    void *made = libc.realloc(old, bytes);
    heap.alive += old == NULL && made != NULL;
    return made;
}

SHOWN void *aligned_alloc(size_t alignment, size_t bytes) {
    if (libc.aligned_alloc == NULL) {
        find(&libc.aligned_alloc, "aligned_alloc");
    }
    return runs_out() ? NULL : counted(libc.aligned_alloc(alignment, bytes));
}

SHOWN void free(void *old) {
    if (libc.free == NULL) {
        find(&libc.free, "free");
    }
    heap.alive -= old != NULL;
    libc.free(old);
}
