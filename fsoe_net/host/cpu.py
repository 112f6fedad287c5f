"""Checks of the processors: isolation, frequency, idle states, hyper-threads."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from fsoe_net.host.finding import Check, MachineFacts, MachineFix, MachineLevel, written
from fsoe_net.host.kernel import command_line
from fsoe_net.host.seam import Host, Unreadable

_FOLDER = "/sys/devices/system/cpu"
_DEEP_US, _VERY_DEEP_US = 20, 100
_SHALLOW = "processor.max_cstate=1 intel_idle.max_cstate=1"
_GRUB = "add {} to GRUB_CMDLINE_LINUX in /etc/default/grub; update-grub; reboot"


def cpu_list(text: str) -> set[int]:
    """Return the numbers in a list like ``0-2,7``; other content is ignored."""
    found: set[int] = set()
    for part in text.split(","):
        first, _, last = part.strip().partition("-")
        if first.isdecimal() and (last or first).isdecimal():
            # Bounded: a damaged file must not create a set of millions.
            found |= set(range(int(first), min(int(last or first), int(first) + 8192) + 1))
    return found


def range_text(numbers: set[int]) -> str:
    """Return numbers as ``0-2,7``."""
    parts: list[list[int]] = []
    for n in sorted(numbers):
        if parts and n == parts[-1][1] + 1:
            parts[-1][1] = n
        else:
            parts.append([n, n])
    return ",".join(str(a) if a == b else f"{a}-{b}" for a, b in parts)


def online_cpus(host: Host) -> set[int]:
    """Return the CPUs in use; raises `Unreadable`."""
    text = host.maybe(f"{_FOLDER}/online")
    found = cpu_list(text) if text else set()
    # Some containers hide sysfs; /proc is the second source.
    if not found:
        lines = host.read("/proc/cpuinfo").splitlines()
        found = {n for n, _ in enumerate(line for line in lines if line.startswith("processor"))}
    if not found:
        raise Unreadable("neither /sys/devices/system/cpu/online nor /proc/cpuinfo list the CPUs")
    return found


def isolated_cpus(host: Host) -> set[int]:
    """Return the CPUs on which the scheduler places nothing by itself."""
    isolcpus = command_line(host).get("isolcpus", "")
    # Flags may come before the list (kernel-parameters.txt).
    flags = ("domain,", "nohz,", "managed_irq,")
    while isolcpus.startswith(flags):
        isolcpus = isolcpus.partition(",")[2]
    # Two ways to isolate: the kernel's command line, and partitions of control group v2.
    return (
        cpu_list(host.maybe(f"{_FOLDER}/isolated") or isolcpus)
        | cpu_list(host.maybe("/sys/fs/cgroup/cpuset.cpus.isolated") or "")
    )  # fmt: skip


def _isolation(host: Host) -> Iterator[MachineFacts]:
    online, isolated = online_cpus(host), isolated_cpus(host)
    last = max(online)
    if len(online) == 1:
        yield MachineFacts(
            level=MachineLevel.WARNING, text="one CPU: cycle, network and all else share it"
        )
        return
    # RCU callbacks run on an isolated CPU unless they are moved away.
    ticking = isolated - cpu_list(command_line(host).get("rcu_nocbs", "") or "")
    full = cpu_list(host.maybe(f"{_FOLDER}/nohz_full") or "")
    words = f"isolcpus=managed_irq,domain,{last} rcu_nocbs={last} irqaffinity="
    words += range_text(online - {last})
    if not isolated:
        yield MachineFacts(
            level=MachineLevel.NOTE,
            text=f"none of the {len(online)} CPUs is kept free for the cycle",
            now=(
                "mkdir /sys/fs/cgroup/fsn; cd /sys/fs/cgroup/fsn; "
                f"echo {last} > cpuset.cpus; echo isolated > cpuset.cpus.partition",
                f"then start fsn-master in that group with --cpu {last}",
            ),
            keep=(_GRUB.format(words), f"fsn-master --cpu {last}"),
            fix=MachineFix(boot=words),
        )
    elif ticking - full:
        yield MachineFacts(
            level=MachineLevel.NOTE,
            text=f"CPU {range_text(isolated)} isolated, but RCU callbacks run on them",
            keep=(_GRUB.format(f"rcu_nocbs={range_text(isolated)}"),),
            fix=MachineFix(boot=f"rcu_nocbs={range_text(isolated)}"),
        )
    else:
        yield MachineFacts(level=MachineLevel.GOOD, text=f"CPU {range_text(isolated)} isolated")
    allowed = _allowed(host)
    # The shell passes its affinity on, so `--cpu` may be denied.
    if isolated and allowed is not None and not isolated & allowed:
        yield MachineFacts(
            level=MachineLevel.NOTE,
            text=f"this shell may use CPU {range_text(allowed)} only: started from here, "
            f"fsn-master --cpu {min(isolated)} may be refused",
            now=(f"taskset -c {min(isolated)} fsn-master …",),
            keep=(f"CPUAffinity={min(isolated)} in the systemd unit",),
        )


def _allowed(host: Host) -> set[int] | None:
    for line in (host.maybe("/proc/self/status") or "").splitlines():
        if line.startswith("Cpus_allowed_list:"):
            return cpu_list(line.partition(":")[2].strip())
    return None


def _cpus(host: Host) -> list[str]:
    return [f"{_FOLDER}/cpu{n}" for n in sorted(online_cpus(host))]


def _frequency(host: Host) -> Iterator[MachineFacts]:
    by_governor: defaultdict[str, set[int]] = defaultdict(set)
    slow_files: dict[str, str] = {}
    for folder in _cpus(host):
        governor = host.maybe(f"{folder}/cpufreq/scaling_governor")
        if governor:
            by_governor[governor].add(int(folder.rpartition("cpu")[2]))
            if governor != "performance":
                slow_files[f"{folder}/cpufreq/scaling_governor"] = governor
    # Without cpufreq the frequency may still change without the kernel.
    if not by_governor:
        raise Unreadable(
            "no cpufreq in sysfs: the frequency is fixed, or firmware or a hypervisor changes it "
            "unseen"
        )
    slow = {name: cpus for name, cpus in by_governor.items() if name != "performance"}
    if not slow:
        yield MachineFacts(level=MachineLevel.GOOD, text="performance on every CPU")
        return
    yield MachineFacts(
        level=MachineLevel.WARNING,
        text="; ".join(f"CPU {range_text(cpus)}: {name}" for name, cpus in sorted(slow.items())),
        now=(f"echo performance | tee {_FOLDER}/cpu*/cpufreq/scaling_governor",),
        fix=written(dict.fromkeys(slow_files, "performance"), slow_files),
        keep=(
            "tuned-adm profile realtime (or latency-performance); else "
            "apt install cpufrequtils; echo 'GOVERNOR=\"performance\"' > /etc/default/cpufrequtils",
        ),
    )


def _idle(host: Host) -> Iterator[MachineFacts]:
    driver = host.read(f"{_FOLDER}/cpuidle/current_driver")
    # Without an idle driver a CPU only halts and wakes immediately.
    if driver in ("none", ""):
        yield MachineFacts(
            level=MachineLevel.GOOD, text="no idle driver: CPUs halt, but sleep no deeper"
        )
        return
    deepest: tuple[int, str] = (0, "")
    for folder in _cpus(host):
        for state in host.names(f"{folder}/cpuidle"):
            place = f"{folder}/cpuidle/{state}"
            latency, name = host.maybe(f"{place}/latency"), host.maybe(f"{place}/name")
            # A disabled state is not entered, however deep it is.
            if host.maybe(f"{place}/disable") == "0" and (latency or "").isdecimal():
                deepest = max(deepest, (int(latency or 0), name or state))
    latency_us, name = deepest
    if latency_us <= _DEEP_US:
        yield MachineFacts(
            level=MachineLevel.GOOD, text=f"{driver}: awake again within {latency_us} us"
        )
        return
    yield MachineFacts(
        level=MachineLevel.WARNING if latency_us > _VERY_DEEP_US else MachineLevel.NOTE,
        text=f"{driver}: down to {name}, {latency_us} us until a CPU is awake again",
        now=(
            f"for s in {_FOLDER}/cpu*/cpuidle/state*; do "
            f"[ $(cat $s/latency) -le {_DEEP_US} ] || echo 1 > $s/disable; done",
        ),
        keep=(_GRUB.format(_SHALLOW), "or a tuned profile"),
        fix=MachineFix(boot=_SHALLOW),
    )


def _siblings(host: Host) -> Iterator[MachineFacts]:
    if host.read(f"{_FOLDER}/smt/active") == "0":
        yield MachineFacts(level=MachineLevel.GOOD, text="no hyper-threads in use")
        return
    isolated, shared = isolated_cpus(host), set()
    # Only threads outside of the isolated set disturb it.
    for cpu in isolated:
        place = f"{_FOLDER}/cpu{cpu}/topology/thread_siblings_list"
        shared |= cpu_list(host.maybe(place) or "") - isolated
    if isolated and not shared:
        yield MachineFacts(
            level=MachineLevel.GOOD, text="in use, but isolated cores are not shared"
        )
        return
    text = f"CPU {range_text(shared)} shares a core with an isolated one" if shared else "in use"
    yield MachineFacts(
        level=MachineLevel.WARNING if shared else MachineLevel.NOTE,
        text=text,
        now=(
            f"echo 0 > {_FOLDER}/cpu{min(shared)}/online"
            if shared
            else f"echo off > {_FOLDER}/smt/control",
        ),
        keep=("switch it off in the firmware, or " + _GRUB.format("nosmt"),),
    )


CPU = (
    Check(
        name="cpu.isolation",
        why="Other programs on the CPU of the cycle cost it its caches and, by kernel work they "
        "cause there, time; late cycles use up what the FSoE watchdog has left.",
        look=_isolation,
    ),
    Check(
        name="cpu.frequency",
        why="A CPU that is clocked down between cycles begins each one slowly: wake-ups come later "
        "and copies take longer, and each FSoE round trip with them.",
        look=_frequency,
    ),
    Check(
        name="cpu.idle",
        why="The cycle sleeps until its time; a CPU in a deep idle state begins late by the time "
        "it takes to wake up, in every cycle.",
        look=_idle,
    ),
    Check(
        name="cpu.smt",
        why="Two hyper-threads share one core: what runs on the other one slows the cycle down by "
        "chance, up to a half.",
        look=_siblings,
    ),
)
