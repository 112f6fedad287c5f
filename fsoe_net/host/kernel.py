"""Checks of the kernel: preemption, throttling, clocksource."""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Iterator

from fsoe_net.host.finding import Check, MachineFacts, MachineFix, MachineLevel
from fsoe_net.host.seam import Host, Unreadable

_RT = (
    "Debian/Ubuntu: apt install linux-image-rt-amd64 (or linux-realtime), then boot it; "
    "from 6.12 on: a kernel built with CONFIG_PREEMPT_RT=y"
)
_GRUB = "add {} to GRUB_CMDLINE_LINUX in /etc/default/grub; update-grub; reboot"


def command_line(host: Host) -> dict[str, str]:
    """Return the words of the kernel command line."""
    # Words after -- are for the init process.
    words = (host.maybe("/proc/cmdline") or "").split(" -- ")[0].split()
    return {name: value for name, _, value in (word.partition("=") for word in words)}


def release(host: Host) -> str:
    """Return the release of the kernel; raises `Unreadable`."""
    found = re.match(r"Linux version (\S+)", host.read("/proc/version"))
    if found is None:
        raise Unreadable("/proc/version is not that of Linux")
    return found[1]


def kernel_option(host: Host, name: str) -> str | None:
    """Return a build option of the kernel; ``""`` if it is off, ``None`` if unknown."""
    text = host.maybe(f"/boot/config-{release(host)}")
    if text is None:
        try:
            text = gzip.decompress(host.data("/proc/config.gz")).decode("utf-8", "replace")
        except (Unreadable, OSError, EOFError, zlib.error):
            return None
    found = re.search(rf"^CONFIG_{name}=(\S+)$", text, re.M)
    return found[1] if found else ""


def _preemption(host: Host) -> Iterator[MachineFacts]:
    version = host.read("/proc/version")
    # Newer kernels have the file, older ones the word in their version.
    if host.maybe("/sys/kernel/realtime") == "1" or "PREEMPT_RT" in version:
        yield MachineFacts(level=MachineLevel.GOOD, text="PREEMPT_RT")
        return
    model = _model(host, version)
    if model in ("full", "lazy"):
        yield MachineFacts(
            level=MachineLevel.NOTE,
            text=f"preemption {model}, no PREEMPT_RT: most stalls stay below 1 ms, but nothing "
            "bounds them",
            keep=(_RT,),
        )
    elif model is None:
        raise Unreadable(
            f"{release(host)}: neither /sys/kernel/debug/sched/preempt nor the kernel's "
            "configuration can be read; root can read more"
        )
    else:
        yield MachineFacts(
            level=MachineLevel.WARNING,
            text=f"preemption {model}: a thread in the kernel is not interrupted everywhere",
            now=("echo full > /sys/kernel/debug/sched/preempt",) if "DYNAMIC" in version else (),
            keep=(_RT, "or at least: " + _GRUB.format("preempt=full")),
            fix=MachineFix(boot="preempt=full"),
        )


def _model(host: Host, version: str) -> str | None:
    """Return the preemption model of a kernel that is not PREEMPT_RT."""
    # The kernel marks the model in use by brackets.
    chosen = re.search(r"\((\w+)\)", host.maybe("/sys/kernel/debug/sched/preempt") or "")
    if chosen:
        return chosen[1]
    stated = command_line(host).get("preempt", "")
    # The command line counts only if the kernel supports changing the model.
    if "PREEMPT_DYNAMIC" in version and stated in ("none", "voluntary", "full", "lazy"):
        return stated
    for option, model in (
        ("PREEMPT_NONE", "none"),
        ("PREEMPT_VOLUNTARY", "voluntary"),
        ("PREEMPT_LAZY", "lazy"),
        ("PREEMPT", "full"),
    ):
        if kernel_option(host, option) == "y":
            return model
    if " PREEMPT " in version:
        return "full"
    return None if "PREEMPT_DYNAMIC" in version else "none or voluntary"


def _throttling(host: Host) -> Iterator[MachineFacts]:
    runtime = host.number("/proc/sys/kernel/sched_rt_runtime_us")
    period = host.number("/proc/sys/kernel/sched_rt_period_us")
    if runtime < 0 or runtime >= period:
        yield MachineFacts(
            level=MachineLevel.GOOD,
            text="off; a real-time thread that never sleeps now takes its CPU for good",
        )
        return
    if host.maybe("/proc/sys/kernel/sched_rt_runtime_us") == "0":
        text, level = "no real-time thread may run at all", MachineLevel.BAD
    else:
        share = 100 * runtime / period
        text = (
            f"real-time threads that use more than {share:.0f} % of {period / 1e6:g} s are stopped "
            f"for the rest of it, up to {(period - runtime) / 1000:g} ms"
        )
        # A cycle that sleeps never comes near 95 %; one that runs without sleeping does
        # immediately.
        level = MachineLevel.NOTE if share >= 90 else MachineLevel.WARNING
    yield MachineFacts(
        level=level,
        text=text,
        now=("sysctl -w kernel.sched_rt_runtime_us=-1",),
        keep=("echo kernel.sched_rt_runtime_us=-1 > /etc/sysctl.d/90-fsoe-net.conf",),
    )


def _group_scheduling(host: Host) -> Iterator[MachineFacts]:
    found = kernel_option(host, "RT_GROUP_SCHED")
    if found is None:
        raise Unreadable("the kernel's configuration can be read neither in /boot nor in /proc")
    if found == "y" and command_line(host).get("rt_group_sched") not in ("0", "off"):
        yield MachineFacts(
            level=MachineLevel.WARNING,
            text="CONFIG_RT_GROUP_SCHED: a control group without a share of its own refuses "
            "SCHED_FIFO with EPERM, also to root",
            keep=(_GRUB.format("rt_group_sched=0") + " (6.16 and later), or another kernel",),
            fix=MachineFix(boot="rt_group_sched=0"),
        )
    else:
        yield MachineFacts(level=MachineLevel.GOOD, text="no quota per control group")


def _clocksource(host: Host) -> Iterator[MachineFacts]:
    folder = "/sys/devices/system/clocksource/clocksource0"
    name = host.read(f"{folder}/current_clocksource")
    if name in ("tsc", "arch_sys_counter", "timebase", "riscv_clocksource"):
        yield MachineFacts(level=MachineLevel.GOOD, text=name)
    elif name in ("kvm-clock", "hyperv_clocksource_tsc_page", "xen"):
        yield MachineFacts(
            level=MachineLevel.NOTE, text=f"{name}: the clock of a hypervisor; it may be corrected"
        )
    else:
        usable = host.maybe(f"{folder}/available_clocksource") or ""
        now = (f"echo tsc > {folder}/current_clocksource",) if "tsc" in usable.split() else ()
        yield MachineFacts(
            level=MachineLevel.WARNING,
            text=f"{name}: each reading takes microseconds; the kernel has found the TSC unfit",
            now=now,
            keep=(
                "journalctl -k | grep -i tsc shows the reason; then firmware, or "
                + _GRUB.format("tsc=reliable")
                + " when the TSC is known to be good",
            ),
        )


KERNEL = (
    Check(
        name="kernel.preemption",
        why="Without PREEMPT_RT a driver or a system call of anybody can hold the cycle up for "
        "milliseconds. No frame goes out meanwhile: both ends of each FSoE connection wait, and "
        "when the stall and the normal FSoE cycle together exceed the watchdog, the machine stops.",
        look=_preemption,
    ),
    Check(
        name="kernel.rt_throttling",
        why="A throttled cyclic thread stands still for tens of milliseconds, longer than many "
        "FSoE watchdogs.",
        look=_throttling,
    ),
    Check(
        name="kernel.rt_group_sched",
        why="Without SCHED_FIFO every other program on the CPU delays the cycle.",
        look=_group_scheduling,
    ),
    Check(
        name="kernel.clocksource",
        why="Each cycle reads the clock several times; a slow or corrected clock shifts the beat "
        "and all times that are compared with watchdogs.",
        look=_clocksource,
    ),
)
