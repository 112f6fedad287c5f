/** Locks and threads of a program under test are checked: unlocking a lock of another thread ends
 * the test, and so does a thread of a test that CMakeLists.txt does not list with THREADS. */
#define _GNU_SOURCE

#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "builder.h"

static void real(void *to, const char *name) {
    void *found = dlsym(RTLD_NEXT, name);
    CHECK(found != NULL);
    memcpy(to, &found, sizeof found);
}

int pthread_mutex_init(pthread_mutex_t *mutex, const pthread_mutexattr_t *attributes) {
    int (*libc)(pthread_mutex_t *, const pthread_mutexattr_t *);
    pthread_mutexattr_t checked;
    int protocol = PTHREAD_PRIO_NONE;
    real(&libc, "pthread_mutex_init");
    pthread_mutexattr_init(&checked);
    if (attributes != NULL) {
        CHECK(pthread_mutexattr_getprotocol(attributes, &protocol) == 0);
    }
    CHECK(pthread_mutexattr_setprotocol(&checked, protocol) == 0);
    CHECK(pthread_mutexattr_settype(&checked, PTHREAD_MUTEX_ERRORCHECK) == 0);
    const int error = libc(mutex, &checked);
    pthread_mutexattr_destroy(&checked);
    return error;
}

int pthread_mutex_unlock(pthread_mutex_t *mutex) {
    int (*libc)(pthread_mutex_t *);
    real(&libc, "pthread_mutex_unlock");
    CHECK(libc(mutex) == 0);
    return 0;
}

int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *),
                          void *argument);

/** The linker puts it in the place of pthread_create() in a test without THREADS. */
int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *),
                          void *argument) {
    (void)thread, (void)attributes, (void)run, (void)argument;
    (void)fprintf(stderr, "a thread: list this test with THREADS, so that TSan runs it\n");
    exit(1);
}
