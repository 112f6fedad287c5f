#define _GNU_SOURCE

#include "app/base/confine.h"

#include <errno.h>
#include <linux/audit.h>
#include <linux/bpf.h>
#include <linux/capability.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#if defined __x86_64__
#define OUR_ARCH AUDIT_ARCH_X86_64
#elif defined __aarch64__
#define OUR_ARCH AUDIT_ARCH_AARCH64
#endif

#if defined __has_feature
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define UNCONFINED 1
#endif
#endif
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__ || !defined OUR_ARCH
#define UNCONFINED 1
#endif

#ifdef UNCONFINED

int confine_process(bool xdp) {
    (void)xdp;
    return 0; /* a sanitizer makes its own system calls; other processors number them differently */
}

#else

/** Calls permitted with any arguments; those of the cycle first. */
static const int allowed[] = {
    /* Cycle. */
    SYS_clock_nanosleep,
    SYS_sendto,
    SYS_recvfrom,
    SYS_recvmsg,
    SYS_ppoll,
    SYS_clock_gettime,
    /* Turns, threads, memory. */
    SYS_futex,
    SYS_read,
    SYS_write,
    SYS_sendmsg,
    SYS_accept4,
    SYS_close,
    SYS_getsockopt,
    SYS_gettimeofday,
    SYS_nanosleep,
    SYS_sched_yield,
    SYS_brk,
    SYS_munmap,
    SYS_mremap,
    SYS_madvise,
    SYS_mlock,
    SYS_mlockall,
    SYS_munlockall,
    SYS_set_robust_list,
    SYS_rt_sigprocmask,
    SYS_rt_sigaction,
    SYS_rt_sigreturn,
    SYS_sigaltstack,
    SYS_restart_syscall,
    SYS_exit,
    SYS_exit_group,
    SYS_getrandom,
    SYS_eventfd2,
    /* Opening the bus, and its scheduling. */
    SYS_setsockopt,
    SYS_bind,
    SYS_connect,
    SYS_ioctl,
    SYS_sched_setscheduler,
    SYS_sched_setparam,
    SYS_sched_setattr,
    SYS_sched_setaffinity,
    SYS_sched_getscheduler,
    SYS_sched_getparam,
    SYS_sched_getattr,
    SYS_sched_getaffinity,
    SYS_sched_get_priority_max,
    SYS_sched_get_priority_min,
    SYS_prlimit64,
    /* Another fsn-master of this user, as predecessor or successor. */
    SYS_listen,
    SYS_getsockname,
    SYS_getpeername,
    SYS_socketpair,
    SYS_shutdown,
    SYS_dup,
    SYS_dup3,
    SYS_memfd_create,
#ifdef SYS_pidfd_open
    SYS_pidfd_open,
    SYS_pidfd_send_signal,
#endif
    /* Files: incidents, interventions, identity of clients. */
    SYS_openat,
    SYS_fstat,
    SYS_newfstatat,
    SYS_statx,
    SYS_faccessat,
    SYS_lseek,
    SYS_pread64,
    SYS_readv,
    SYS_writev,
    SYS_getdents64,
    SYS_fsync,
    SYS_fdatasync,
    SYS_ftruncate,
    SYS_fcntl,
    SYS_flock,
    SYS_unlinkat,
    SYS_renameat,
    SYS_readlinkat,
    SYS_mkdirat,
    SYS_umask,
    /* Identity of the process; abort(); dropping capabilities. */
    SYS_getpid,
    SYS_gettid,
    SYS_getuid,
    SYS_geteuid,
    SYS_getgid,
    SYS_getegid,
    SYS_tgkill,
    SYS_capget,
    SYS_capset,
#ifdef SYS_rseq
    SYS_rseq,
#endif
#ifdef SYS_faccessat2
    SYS_faccessat2,
#endif
#ifdef SYS_renameat2
    SYS_renameat2,
#endif
#ifdef __x86_64__ /* older names of calls above */
    SYS_poll,
    SYS_open,
    SYS_stat,
    SYS_lstat,
    SYS_access,
    SYS_getdents,
    SYS_unlink,
    SYS_rename,
    SYS_mkdir,
    SYS_readlink,
#endif
};

enum {
    ALLOWED = sizeof allowed / sizeof allowed[0],
    NUMBER = offsetof(struct seccomp_data, nr),
    ARCH = offsetof(struct seccomp_data, arch),
    ARGUMENTS = offsetof(struct seccomp_data, args),
    ARGUMENT_BYTES = 8,
    MOST_STEPS = 2 * ALLOWED + 64,
    ABSENT = SECCOMP_RET_ERRNO | ENOSYS,
};

/** Loads the low half of an argument; both machines are little-endian. */
#define LOAD_ARGUMENT(n)                                                                           \
    (struct sock_filter)                                                                           \
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, (uint32_t)(ARGUMENTS + ARGUMENT_BYTES * (n)))
#define LOAD(offset) (struct sock_filter) BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offset)
#define END(verdict) (struct sock_filter) BPF_STMT(BPF_RET | BPF_K, (uint32_t)(verdict))
/** Continues with the next step if the condition holds, otherwise skips `steps`. */
#define WHERE(how, value, steps)                                                                   \
    (struct sock_filter) BPF_JUMP(BPF_JMP | (how) | BPF_K, (uint32_t)(value), 0, steps)

struct program {
    struct sock_filter step[MOST_STEPS];
    unsigned short count;
};

static void add(struct program *p, struct sock_filter step) {
    p->step[p->count++] = step;
}

/** A call that depends on an argument: the first verdict if any bit of `bits` is set, otherwise the
 *  other. */
static void decide_by_bits(struct program *p, long call, int argument, uint32_t bits,
                           uint32_t where_set, uint32_t else_verdict) {
    add(p, WHERE(BPF_JEQ, call, 4));
    add(p, LOAD_ARGUMENT(argument));
    add(p, WHERE(BPF_JSET, bits, 1));
    add(p, END(where_set));
    add(p, END(else_verdict));
}

/** Allows a call for some values of its first argument. */
static void allow_values(struct program *p, long call, const uint32_t *values, uint8_t count) {
    add(p, WHERE(BPF_JEQ, call, (uint8_t)(2 + 2 * count)));
    add(p, LOAD_ARGUMENT(0));
    for (uint8_t i = 0; i < count; i++) {
        add(p, WHERE(BPF_JEQ, values[i], 1));
        add(p, END(SECCOMP_RET_ALLOW));
    }
    add(p, END(ABSENT));
}

static void end_process(struct program *p, long call) {
    add(p, WHERE(BPF_JEQ, call, 1));
    add(p, END(SECCOMP_RET_KILL_PROCESS));
}

static void write_program(struct program *p, bool xdp) {
    static const uint32_t families[] = {AF_UNIX, AF_PACKET, AF_XDP};
    static const uint32_t names[] = {PR_SET_NAME, PR_CAP_AMBIENT};
    static const uint32_t bpf[] = {BPF_MAP_CREATE, BPF_MAP_UPDATE_ELEM, BPF_PROG_LOAD,
                                   BPF_LINK_CREATE};
    add(p, LOAD(ARCH));
    add(p, (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, OUR_ARCH, 1, 0));
    add(p, END(SECCOMP_RET_KILL_PROCESS));
    add(p, LOAD(NUMBER));
    for (size_t i = 0; i < ALLOWED; i++) {
        add(p, WHERE(BPF_JEQ, allowed[i], 1));
        add(p, END(SECCOMP_RET_ALLOW));
    }
    /* Memory must never be executable. */
    decide_by_bits(p, SYS_mmap, 2, PROT_EXEC, ABSENT, SECCOMP_RET_ALLOW);
    decide_by_bits(p, SYS_mprotect, 2, PROT_EXEC, ABSENT, SECCOMP_RET_ALLOW);
    /* Threads, no processes; clone3() hides its flags, and the C library works without it. */
    decide_by_bits(p, SYS_clone, 0, CLONE_THREAD, SECCOMP_RET_ALLOW, ABSENT);
    allow_values(p, SYS_socket, families, xdp ? 3 : 2);
    allow_values(p, SYS_prctl, names, 2);
    if (xdp) {
        allow_values(p, SYS_bpf, bpf, 4);
    }
    end_process(p, SYS_execve);
    end_process(p, SYS_execveat);
    add(p, END(ABSENT));
}

int confine_process(bool xdp) {
    struct program p = {.count = 0};
    write_program(&p, xdp);
    const struct sock_fprog program = {.len = p.count, .filter = p.step};
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 ||
        syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, &program) != 0) {
        return errno; /* mutants: no thread has a filter of its own that could be in the way */
    }
    return 0;
}

#endif

int confine_thread(void) {
    const uint32_t kept = (1u << CAP_IPC_LOCK) | (geteuid() == 0 ? 1u << CAP_DAC_OVERRIDE : 0u);
    struct __user_cap_header_struct header = {.version = _LINUX_CAPABILITY_VERSION_3};
    struct __user_cap_data_struct set[_LINUX_CAPABILITY_U32S_3] = {{0}};
    if (syscall(SYS_capget, &header, set) != 0) {
        return errno;
    }
    set[0].effective &= kept;
    set[0].permitted &= kept;
    set[0].inheritable &= kept;
    set[1] = (struct __user_cap_data_struct){0};
    return syscall(SYS_capset, &header, set) != 0 ? errno : 0;
}
