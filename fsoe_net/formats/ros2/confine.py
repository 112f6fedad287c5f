"""Confines a process by the kernel before it evaluates a file of unknown origin.

Python cannot confine Python: an expression with access to a frame has access to the interpreter.
The kernel therefore limits the process:

- Landlock: it can only open files for reading, below a few folders
  (https://docs.kernel.org/userspace-api/landlock.html).
- seccomp, by the libseccomp of the system: a list of calls that reading, computing and writing to
  open files need. No socket, no process, no signal, no file opened for writing.
"""

from __future__ import annotations

import ctypes
import errno
import os
import struct
import sysconfig
from collections.abc import Sequence
from ctypes import CDLL, c_char_p, c_int, c_uint, c_uint32, c_uint64, c_void_p
from pathlib import Path

# The same numbers on every architecture.
_LANDLOCK_CREATE_RULESET, _LANDLOCK_ADD_RULE, _LANDLOCK_RESTRICT_SELF = 444, 445, 446
_LANDLOCK_VERSION_FLAG = 1
_LANDLOCK_PATH_BENEATH = 1
_READ_FILE, _READ_DIR = 1 << 2, 1 << 3
# Number of access rights in each version of Landlock, from version 1.
_RIGHTS_BY_VERSION = (13, 14, 15, 15, 16)

_PR_SET_PDEATHSIG, _PR_SET_NO_NEW_PRIVS = 1, 38
_SIGKILL = 9

_SCMP_ACT_ALLOW, _SCMP_ACT_ERRNO = 0x7FFF0000, 0x00050000
_SCMP_CMP_MASKED_EQ = 7
_NOT_READING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
# Names of all architectures; those missing on an architecture are skipped.
_CALLS = """
    read readv pread64 write writev close lseek _llseek
    stat lstat fstat stat64 lstat64 fstat64 newfstatat fstatat64 statx access faccessat faccessat2
    readlink readlinkat getdents getdents64 getcwd
    brk mmap mmap2 munmap mremap mprotect madvise
    rt_sigaction rt_sigprocmask rt_sigreturn sigreturn sigaltstack
    futex futex_time64 set_robust_list rseq sched_yield
    clock_gettime clock_gettime64 clock_getres clock_getres_time64 gettimeofday time getrusage
    getrandom getpid gettid getuid geteuid getgid getegid exit exit_group restart_syscall
"""


class _ArgumentTest(ctypes.Structure):
    """``struct scmp_arg_cmp``."""

    _fields_ = (("arg", c_uint), ("op", c_int), ("datum_a", c_uint64), ("datum_b", c_uint64))


def inside(path: str | os.PathLike[str], folders: Sequence[str]) -> bool:
    """Whether a path, with its links followed, is in one of these folders."""
    real = Path(os.path.realpath(path))
    return any(real.is_relative_to(os.path.realpath(folder)) for folder in folders)


def python_folders() -> list[str]:
    """Return the folders of Python's own library, which modules are imported from later."""
    paths = sysconfig.get_paths()
    return sorted({paths["stdlib"], paths["platstdlib"]})


def can_confine() -> bool:
    """Whether this machine has Landlock and libseccomp."""
    return _libseccomp() is not None and _landlock_version() > 0


def end_with_parent() -> None:
    """Let the kernel kill this process when its parent ends."""
    CDLL(None).prctl(_PR_SET_PDEATHSIG, _SIGKILL, 0, 0, 0)


def confine(readable: Sequence[str]) -> None:
    """Confine this process permanently: read files in these folders, compute, write to open files.

    Args:
        readable: Folders; missing ones are skipped.

    Raises:
        OSError: The kernel or libseccomp refused; the process must not continue.
    """
    libc = CDLL(None, use_errno=True)
    seccomp = _libseccomp()
    if seccomp is None:
        raise OSError(errno.ENOSYS, "libseccomp is missing")
    _checked(libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0))
    _restrict_files(libc, _landlock_version(), readable)
    _restrict_calls(seccomp)


def _landlock_version() -> int:
    """Return the version of Landlock in this kernel, 0 if it is missing or disabled."""
    libc = CDLL(None, use_errno=True)
    found = libc.syscall(_LANDLOCK_CREATE_RULESET, None, 0, _LANDLOCK_VERSION_FLAG)
    return max(int(found), 0)


def _restrict_files(libc: CDLL, version: int, readable: Sequence[str]) -> None:
    rights = _RIGHTS_BY_VERSION[min(version, len(_RIGHTS_BY_VERSION)) - 1]
    handled = c_uint64((1 << rights) - 1)
    rules = _checked(
        libc.syscall(_LANDLOCK_CREATE_RULESET, ctypes.byref(handled), ctypes.sizeof(handled), 0)
    )
    for folder in readable:
        try:
            place = os.open(folder, os.O_PATH | os.O_CLOEXEC | os.O_DIRECTORY)
        except OSError:
            continue
        # struct landlock_path_beneath_attr, which is packed
        rule = struct.pack("=Qi", _READ_FILE | _READ_DIR, place)
        _checked(libc.syscall(_LANDLOCK_ADD_RULE, rules, _LANDLOCK_PATH_BENEATH, rule, 0))
        os.close(place)
    _checked(libc.syscall(_LANDLOCK_RESTRICT_SELF, rules, 0))
    os.close(rules)


def _restrict_calls(library: CDLL) -> None:
    library.seccomp_init.restype = c_void_p
    library.seccomp_init.argtypes = (c_uint32,)
    library.seccomp_load.argtypes = (c_void_p,)
    library.seccomp_syscall_resolve_name.argtypes = (c_char_p,)
    library.seccomp_rule_add_array.argtypes = (c_void_p, c_uint32, c_int, c_uint, c_void_p)
    rules = library.seccomp_init(_SCMP_ACT_ERRNO | errno.EPERM)
    if rules is None:
        raise OSError(errno.ENOMEM, "libseccomp gives no filter")

    def allow(name: str, *tests: _ArgumentTest) -> None:
        number = library.seccomp_syscall_resolve_name(name.encode())
        if number < 0:  # not on this architecture
            return
        rows = (_ArgumentTest * len(tests))(*tests)
        done = library.seccomp_rule_add_array(rules, _SCMP_ACT_ALLOW, number, len(tests), rows)
        if done != 0:
            raise OSError(-done, f"libseccomp refuses a rule for {name}")

    for name in _CALLS.split():
        allow(name)
    # Landlock before version 3 lets an open for reading truncate a file.
    allow("open", _ArgumentTest(1, _SCMP_CMP_MASKED_EQ, _NOT_READING, 0))
    allow("openat", _ArgumentTest(2, _SCMP_CMP_MASKED_EQ, _NOT_READING, 0))
    done = library.seccomp_load(rules)
    if done != 0:
        raise OSError(-done, "the kernel takes no seccomp filter")


def _libseccomp() -> CDLL | None:
    try:
        return CDLL("libseccomp.so.2")
    except OSError:
        return None


def _checked(result: int) -> int:
    if result < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return result
