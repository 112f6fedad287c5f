"""Checks of the interrupts of a network interface: their CPUs and priorities."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from fsoe_net.host.cpu import cpu_list, isolated_cpus, online_cpus, range_text
from fsoe_net.host.finding import Check, MachineFacts, MachineLevel, written
from fsoe_net.host.permissions import scheduling
from fsoe_net.host.seam import Host, Unreadable

# The default that fsn-master requests.
_MASTER_PRIORITY = 80


def _interrupts(host: Host, name: str) -> list[int]:
    """Return the interrupt numbers of an interface.

    Raises:
        Unreadable: No number can be read.
    """
    folder = f"/sys/class/net/{name}/device"
    if not host.exists(folder):
        raise Unreadable(f"{name} is a virtual interface without interrupt")
    found = {int(n) for n in host.names(f"{folder}/msi_irqs") if n.isdecimal()}
    listed = set()
    for line in host.read("/proc/interrupts").splitlines():
        number, _, rest = line.strip().partition(":")
        words = rest.replace(",", " ").split()
        # Drivers name their queues after the interface, with a dash or a colon.
        mine = any(w == name or w.startswith((f"{name}-", f"{name}:")) for w in words)
        if number.isdecimal() and mine:
            listed.add(int(number))
    # /proc/interrupts lists those in use; msi_irqs also lists unused ones.
    found = listed or found
    single = host.maybe(f"{folder}/irq") or ""
    if not found and single.isdecimal() and single != "0":
        found = {int(single)}
    if not found:
        raise Unreadable(f"neither sysfs nor /proc/interrupts name an interrupt of {name}")
    return sorted(found)


def _affinity(host: Host, name: str) -> Iterator[MachineFacts]:
    numbers = _interrupts(host, name)
    cpus: set[int] = set()
    allowed: dict[str, str] = {}
    for n in numbers:
        place = f"/proc/irq/{n}"
        if permitted := host.maybe(f"{place}/smp_affinity_list"):
            allowed[f"{place}/smp_affinity_list"] = permitted
        # The effective list contains the CPUs in use; the other one contains the permitted CPUs.
        text = host.maybe(f"{place}/effective_affinity_list") or host.read(
            f"{place}/smp_affinity_list"
        )
        cpus |= cpu_list(text)
    text = f"interrupt {range_text(set(numbers))} on CPU {range_text(cpus)}"
    online = online_cpus(host)
    wanted = max(isolated_cpus(host), default=max(online))
    # One CPU handles all interrupts: replies keep their order and stay in its cache.
    if len(cpus) <= 1 or len(online) == 1:
        yield MachineFacts(level=MachineLevel.GOOD, text=text)
        return
    yield MachineFacts(
        level=MachineLevel.NOTE,
        text=f"{text}: replies are taken on any of them",
        now=tuple(f"echo {wanted} > /proc/irq/{n}/smp_affinity_list" for n in numbers[:4]),
        keep=(f"a unit that runs that after boot, or irqaffinity={wanted} on the command line",),
        fix=written(dict.fromkeys(allowed, str(wanted)), allowed),
    )


def _thread(host: Host, name: str) -> Iterator[MachineFacts]:
    numbers = _interrupts(host, name)
    threads: dict[int, tuple[str, int]] = {}
    # The kernel calls these threads irq/NUMBER-NAME.
    for pid in host.processes("irq/"):
        words = (host.maybe(f"/proc/{pid}/comm") or "").split("/")[1].partition("-")[0]
        how = scheduling(host, pid)
        if words.isdecimal() and int(words) in numbers and how is not None:
            threads[pid] = how
    if not threads:
        raise Unreadable(
            "its interrupts have no thread of their own, or it is not visible: without "
            "PREEMPT_RT or `threadirqs` they run in the kernel's softirq"
        )
    # 50 is the priority of each interrupt thread by default.
    low = {pid: p for pid, (policy, p) in threads.items() if policy != "fifo" or p <= 50}
    text = ", ".join(f"process {pid}: {how[0]} {how[1]}" for pid, how in threads.items())
    if not low:
        yield MachineFacts(level=MachineLevel.GOOD, text=text)
        return
    wanted = _MASTER_PRIORITY + 5
    yield MachineFacts(
        level=MachineLevel.NOTE,
        text=f"{text}: not more urgent than the interrupts of every other device",
        now=tuple(f"chrt -f -p {wanted} {pid}" for pid in low),
        keep=("a unit that runs that after boot, or rtirq, or tuned with [scheduler]",),
    )


def interrupt_checks(name: str) -> tuple[Check, ...]:
    """Return the checks of the interrupts of an interface."""
    return (
        Check(
            name="interface.irq_affinity",
            why="A reply that comes in on another CPU each time waits for cold caches; on a busy "
            "CPU it waits for what runs there.",
            look=partial(_affinity, name=name),
        ),
        Check(
            name="interface.irq_thread",
            why="The reply of the bus waits until the thread of the interrupt has run. When a disk "
            "is as urgent as the bus, a cycle finds no reply and FSoE frames stay one cycle more.",
            look=partial(_thread, name=name),
        ),
    )
