/** Hangs in two threads: ctest passes it when its stacks come, see CMakeLists.txt. */
#include "builder.h"

#include <pthread.h>
#include <unistd.h>

static void *wait_for_ever(void *none) {
    for (;;) {
        (void)pause();
    }
    return none;
}

int main(void) {
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, wait_for_ever, NULL) == 0);
    (void)wait_for_ever(NULL);
}
