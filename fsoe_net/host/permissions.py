"""Checks the permissions of ``fsn-master``: capabilities, limits, and those of a running one."""

from __future__ import annotations

import errno
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

from fsoe_net.host.finding import Check, MachineFacts, MachineLevel
from fsoe_net.host.seam import Host, Unreadable

PROGRAM = "fsn-master"
# Bit numbers in <linux/capability.h>.
CAPABILITIES = {"CAP_NET_RAW": 13, "CAP_IPC_LOCK": 14, "CAP_SYS_NICE": 23}
_ALL = sum(1 << bit for bit in CAPABILITIES.values())
_EFFECTIVE = 1
_FIFO, _DEADLINE = 1, 6
_POLICIES = {0: "other", _FIFO: "fifo", 2: "rr", 3: "batch", 5: "idle", _DEADLINE: "deadline"}
_WORDS = "CAP_NET_RAW CAP_SYS_NICE CAP_IPC_LOCK"
_UNIT = f"in the systemd unit: AmbientCapabilities={_WORDS} and CapabilityBoundingSet={_WORDS}"
_SETCAP = "setcap cap_net_raw,cap_sys_nice,cap_ipc_lock=ep {}"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Status:
    """Part of ``/proc/PID/status``; capabilities as bits."""

    user: int
    effective: int
    ambient: int
    no_new: bool


def _status(host: Host, pid: str) -> _Status:
    rows = dict(
        line.split(":", 1) for line in host.read(f"/proc/{pid}/status").splitlines() if ":" in line
    )
    try:
        return _Status(
            # The second one is the effective user.
            user=int(rows["Uid"].split()[1]),
            effective=int(rows["CapEff"], 16),
            ambient=int(rows.get("CapAmb", "0"), 16),
            no_new=rows.get("NoNewPrivs", "0").strip() == "1",
        )
    except (KeyError, ValueError, IndexError) as exc:
        raise Unreadable(f"/proc/{pid}/status has not the form of Linux") from exc


def _lacking(bits: int) -> str:
    return ", ".join(name for name, bit in CAPABILITIES.items() if not bits >> bit & 1)


def _file_capabilities(host: Host, program: str) -> int:
    """Return the capabilities that a program file grants, as bits.

    Raises:
        Unreadable: The file system does not report them.
    """
    try:
        data = host.seam.attribute(program, "security.capability")
    except OSError as exc:
        # No such attribute, or a file system without attributes: the file grants no capability.
        if exc.errno in (errno.ENODATA, errno.EOPNOTSUPP):
            return 0
        raise Unreadable(f"{program}: its capabilities: {exc.strerror}") from exc
    if len(data) < 12:
        return 0
    # struct vfs_cap_data, always little-endian.
    magic, permitted = struct.unpack_from("<II", data)
    return int(permitted) if magic & _EFFECTIVE else 0


def _capabilities(host: Host, *, program: str | None) -> Iterator[MachineFacts]:
    mine = _status(host, "self")
    if program is None:
        yield MachineFacts(
            level=MachineLevel.WARNING,
            text=f"{PROGRAM} is not installed",
            now=("fsoe-net install-master",),
            keep=("FSN_MASTER=PATH names one elsewhere",),
        )
        return
    fix = (_SETCAP.format(program),)
    keep = (_UNIT, "setcap again after each build: a new file has none")
    granted = _file_capabilities(host, program)
    # The kernel ignores file capabilities on nosuid mounts and after NoNewPrivileges.
    ignored = _ignored(host, program, mine)
    if granted and not _lacking(granted) and not ignored:
        yield MachineFacts(
            level=MachineLevel.GOOD, text=f"{program} has them by its file: no root needed"
        )
    elif granted and ignored:
        yield MachineFacts(
            level=MachineLevel.BAD, text=f"{program} has them, but {ignored}", keep=(_UNIT,)
        )
    # Ambient capabilities are inherited by each program started from here.
    elif mine.ambient & _ALL == _ALL:
        yield MachineFacts(
            level=MachineLevel.GOOD, text="what is started from here inherits them (ambient)"
        )
    # Root works here, but the unit runs as another user.
    elif mine.user == 0 and mine.effective & _ALL == _ALL:
        yield MachineFacts(
            level=MachineLevel.NOTE,
            text=f"root has them here; {program} started by another user lacks {_lacking(granted)}",
            now=fix,
            keep=keep,
        )
    else:
        lacking = _lacking(granted)
        yield MachineFacts(
            level=MachineLevel.BAD if "NET_RAW" in lacking else MachineLevel.WARNING,
            text=f"{program} lacks {lacking}",
            now=fix,
            keep=keep,
        )


def _ignored(host: Host, program: str, mine: _Status) -> str:
    """Return why the kernel ignores the capabilities of this file; empty if it does not."""
    if mine.no_new:
        return "this shell was started with NoNewPrivileges, so the kernel ignores them"
    best, options = "", ""
    for line in (host.maybe("/proc/self/mountinfo") or "").splitlines():
        words = line.split()
        if len(words) < 6:
            continue
        point = words[4]
        inside = program == point or program.startswith(point.rstrip("/") + "/")
        # The longest mount point that contains the program is its file system.
        if inside and len(point) >= len(best):
            best, options = point, words[5]
    if "nosuid" in options.split(","):
        return f"{best} is mounted nosuid, so the kernel ignores them"
    return ""


def _limits(host: Host, *, program: str | None) -> Iterator[MachineFacts]:
    found = {}
    for line in host.read("/proc/self/limits").splitlines():
        for name in ("Max locked memory", "Max realtime priority"):
            if line.startswith(name):
                found[name] = line[len(name) :].split()[0]
    if len(found) != 2:
        raise Unreadable("/proc/self/limits has not the form of Linux")
    memory, priority = found["Max locked memory"], found["Max realtime priority"]
    granted = 0 if program is None else _file_capabilities(host, program)
    mine = _status(host, "self")
    # A container may reduce the capabilities of root.
    held = granted | mine.ambient | (mine.effective if mine.user == 0 else 0)
    low = []
    if not held >> CAPABILITIES["CAP_IPC_LOCK"] & 1 and memory != "unlimited":
        low.append(f"{int(memory) // 1024} KiB of memory may be locked")
    if not held >> CAPABILITIES["CAP_SYS_NICE"] & 1 and int(priority) < 80:
        low.append(f"real-time priority up to {priority}, fsn-master asks for 80")
    if low:
        yield MachineFacts(
            level=MachineLevel.WARNING,
            text="; ".join(low),
            now=() if program is None else (_SETCAP.format(program),),
            keep=(
                "printf '@realtime - rtprio 99\\n@realtime - memlock unlimited\\n' > "
                "/etc/security/limits.d/90-fsoe-net.conf; gpasswd -a USER realtime; log in again",
                "in the systemd unit: LimitRTPRIO=99 and LimitMEMLOCK=infinity",
            ),
        )
    else:
        yield MachineFacts(
            level=MachineLevel.GOOD,
            text=f"locked memory {memory}, real-time priority {priority}"
            + ("; capabilities lift both" if held & _ALL else ""),
        )


def scheduling(host: Host, pid: int, thread: int | None = None) -> tuple[str, int] | None:
    """Return policy and priority of a process or thread, or ``None`` if it has ended."""
    place = f"/proc/{pid}/stat" if thread is None else f"/proc/{pid}/task/{thread}/stat"
    # The name of a process may contain blanks and parentheses; fields are counted after the last
    # one.
    words = (host.maybe(place) or "").rpartition(")")[2].split()
    # Fields 40 and 41 of proc(5) are priority and policy; the first two end with the name.
    if len(words) < 39 or not words[37].isdecimal() or not words[38].isdecimal():
        return None
    return _POLICIES.get(int(words[38]), words[38]), int(words[37])


def _running(host: Host) -> Iterator[MachineFacts]:
    if not host.pids():
        raise Unreadable("/proc shows no processes")
    for pid in host.processes(PROGRAM):
        status = _status(host, str(pid))
        threads = [int(n) for n in host.names(f"/proc/{pid}/task") if n.isdecimal()]
        how = {s for n in threads if (s := scheduling(host, pid, n)) is not None}
        best = max((s for s in how if s[0] in ("fifo", "rr", "deadline")), default=None)
        spare = "as root; capabilities are enough" if status.user == 0 else ""
        if best is None:
            yield MachineFacts(
                level=MachineLevel.WARNING,
                text=f"process {pid} runs without a real-time thread",
                keep=("--policy fifo refuses to run with less; capabilities as above",),
            )
        elif spare:
            yield MachineFacts(
                level=MachineLevel.NOTE, text=f"process {pid} runs {spare}", keep=(_UNIT,)
            )
        else:
            text = f"process {pid}: {best[0]} {best[1]}, user {status.user}"
            yield MachineFacts(level=MachineLevel.GOOD, text=text)
    if not host.processes(PROGRAM):
        yield MachineFacts(level=MachineLevel.GOOD, text="none runs")


def permission_checks(program: str | None) -> tuple[Check, ...]:
    """Return the checks for this ``fsn-master``; ``None`` if there is none."""
    return (
        Check(
            name="master.capabilities",
            why="CAP_NET_RAW opens the interface, CAP_SYS_NICE gives SCHED_FIFO, CAP_IPC_LOCK "
            "keeps memory from being swapped. With them root is not needed, which limits the "
            "damage of a mistake.",
            look=partial(_capabilities, program=program),
        ),
        Check(
            name="master.limits",
            why="Without real-time priority every other program delays the cycle; memory that is "
            "not locked can be swapped out, which costs a cycle milliseconds.",
            look=partial(_limits, program=program),
        ),
        Check(
            name="master.running",
            why="A cyclic thread without real-time scheduling loses its CPU to any busy program; "
            "FSoE watchdogs then expire by chance.",
            look=_running,
        ),
    )
