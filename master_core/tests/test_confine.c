/** Calls still possible in a confined process and thread. Each case runs in its own process. */
#define _GNU_SOURCE

#include "app/base/confine.h"

#include <errno.h>
#include <linux/bpf.h>
#include <linux/capability.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "builder.h"

/** Runs it in a process of its own; returns the status as from wait(). */
static int ended(void (*what)(void)) {
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        what();
        _exit(0);
    }
    int status = -1;
    CHECK(waitpid(child, &status, 0) == child);
    return status;
}

static void confined(void) {
    CHECK(confine_process(false) == 0);
}

static void *nothing(void *argument) {
    return argument;
}

static void what_runs_needs(void) {
    confined();
    pthread_t thread;
    void *got;
    int number = 7;
    CHECK(pthread_create(&thread, NULL, nothing, &number) == 0);
    CHECK(pthread_join(thread, &got) == 0 && got == &number);
    const int fd = socket(AF_UNIX, SOCK_DGRAM, 0);
    CHECK(fd >= 0 && close(fd) == 0);
    FILE *file = fopen("/proc/self/comm", "re");
    char line[32];
    CHECK(file != NULL && fgets(line, sizeof line, file) != NULL && fclose(file) == 0);
    void *room = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    CHECK(room != MAP_FAILED && munmap(room, 4096) == 0);
    errno = 0; /* whether this user may is another matter */
    CHECK(socket(AF_PACKET, SOCK_RAW, 0) >= 0 || errno == EPERM);
}

static void refused(void) {
    confined();
    CHECK(socket(AF_INET, SOCK_STREAM, 0) < 0 && errno == ENOSYS);
    CHECK(socket(AF_NETLINK, SOCK_RAW, 0) < 0 && errno == ENOSYS);
    CHECK(fork() < 0 && errno == ENOSYS);
    CHECK(ptrace(PTRACE_TRACEME, 0, NULL, NULL) < 0 && errno == ENOSYS);
    CHECK(setuid(getuid()) < 0 && errno == ENOSYS);
    CHECK(kill(getpid(), 0) < 0 && errno == ENOSYS);
    CHECK(chdir("/") < 0 && errno == ENOSYS);
    const int code = PROT_READ | PROT_EXEC;
    CHECK(mmap(NULL, 4096, code, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) == MAP_FAILED);
    void *room = mmap(NULL, 4096, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    CHECK(room != MAP_FAILED && mprotect(room, 4096, code) < 0 && errno == ENOSYS);
    CHECK(syscall(SYS_unshare, 0) < 0 && errno == ENOSYS);
    CHECK(socket(AF_XDP, SOCK_RAW, 0) < 0 && errno == ENOSYS);
    CHECK(syscall(SYS_bpf, 0, NULL, 0) < 0 && errno == ENOSYS);
}

static void what_xdp_needs(void) {
    CHECK(confine_process(true) == 0);
    errno = 0; /* whether this user may, and whether the kernel has it, is another matter */
    CHECK(socket(AF_XDP, SOCK_RAW, 0) >= 0 || errno != ENOSYS);
    CHECK(socket(AF_INET, SOCK_STREAM, 0) < 0 && errno == ENOSYS);
    CHECK(syscall(SYS_bpf, BPF_PROG_LOAD, NULL, 0) < 0 && errno != ENOSYS);
    CHECK(syscall(SYS_bpf, BPF_OBJ_GET, NULL, 0) < 0 && errno == ENOSYS);
}

static void another_program(void) {
    confined();
    execl("/bin/true", "true", (char *)NULL);
}

static atomic_int step;

static void *another_thread(void *argument) {
    atomic_store(&step, 1);
    while (atomic_load(&step) != 2) {
        usleep(1000);
    }
    const bool closed = socket(AF_INET, SOCK_STREAM, 0) < 0 && errno == ENOSYS;
    return closed ? argument : NULL;
}

static void threads_that_run_already(void) {
    pthread_t thread;
    void *got;
    int number = 0;
    CHECK(pthread_create(&thread, NULL, another_thread, &number) == 0);
    while (atomic_load(&step) != 1) {
        usleep(1000);
    }
    confined();
    atomic_store(&step, 2);
    CHECK(pthread_join(thread, &got) == 0 && got == &number);
}

static uint64_t capabilities(void) {
    struct __user_cap_header_struct header = {.version = _LINUX_CAPABILITY_VERSION_3};
    struct __user_cap_data_struct set[_LINUX_CAPABILITY_U32S_3];
    CHECK(syscall(SYS_capget, &header, set) == 0);
    CHECK((set[0].effective | set[0].permitted) == set[0].permitted);
    return set[0].permitted | (uint64_t)set[1].permitted << 32;
}

static void *capabilities_of(void *into) {
    *(uint64_t *)into = capabilities();
    return into;
}

static void capabilities_of_a_thread(void) {
    const uint64_t before = capabilities();
    const uint64_t kept = UINT64_C(1) << CAP_IPC_LOCK | UINT64_C(1) << CAP_DAC_OVERRIDE;
    uint64_t inherited = UINT64_MAX;
    pthread_t thread;
    CHECK(confine_thread() == 0);
    CHECK((capabilities() & ~kept) == 0);
    if (geteuid() == 0) {
        CHECK(capabilities() == (before & kept));
    }
    CHECK(pthread_create(&thread, NULL, capabilities_of, &inherited) == 0);
    CHECK(pthread_join(thread, NULL) == 0 && inherited == capabilities());
    CHECK(socket(AF_PACKET, SOCK_RAW, 0) < 0 && errno == EPERM);
    confined();
}

int main(void) {
    CHECK(ended(what_runs_needs) == 0);
    CHECK(ended(refused) == 0);
    CHECK(ended(what_xdp_needs) == 0);
    const int status = ended(another_program);
    CHECK(WIFSIGNALED(status) && WTERMSIG(status) == SIGSYS);
    CHECK(ended(threads_that_run_already) == 0);
    CHECK(ended(capabilities_of_a_thread) == 0);
    return 0;
}
