"""Checks of the machine as a whole: virtual machine, container, irqbalance, swap."""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.host.finding import Check, MachineFacts, MachineLevel
from fsoe_net.host.seam import Host, Unreadable

# The ninth and tenth, times of guests, are already part of the first two (proc(5)).
_STEAL, _FIELDS = 7, 8
_BAD_STEAL = 0.001


def _virtual(host: Host) -> Iterator[MachineFacts]:
    info = host.read("/proc/cpuinfo")
    flags = next((line for line in info.splitlines() if line.startswith("flags")), "")
    vendor = host.maybe("/sys/class/dmi/id/sys_vendor") or ""
    product = host.maybe("/sys/class/dmi/id/product_name") or ""
    kind = host.maybe("/sys/hypervisor/type") or ""
    names = ("QEMU", "VMware", "innotek", "VirtualBox", "Xen", "Parallels", "Virtual Machine")
    known = [n for n in names if n in vendor or n in product]
    # Each hypervisor is visible in another place.
    if not (" hypervisor" in flags or known or kind):
        yield MachineFacts(level=MachineLevel.GOOD, text="no sign of a virtual machine")
        return
    found = " ".join(filter(None, (vendor, product))) or kind or "a hypervisor"
    yield MachineFacts(
        level=MachineLevel.WARNING,
        text=f"virtual machine ({found}): its host may take the CPU away at any time",
        keep=("run the bus on real hardware; else pin the virtual CPUs to host CPUs of their own",),
    )


def _steal(host: Host) -> Iterator[MachineFacts]:
    words = host.read("/proc/stat").partition("\n")[0].split()[1:]
    # The first line sums all CPUs; its fields are fixed by the kernel.
    if len(words) < _FIELDS or not all(w.isdecimal() for w in words):
        raise Unreadable("/proc/stat has no line of all CPUs in the form of Linux")
    times = [int(w) for w in words[:_FIELDS]]
    share = times[_STEAL] / max(1, sum(times))
    text = f"{100 * share:.2f} % of the time since boot was taken by the hypervisor"
    if times[_STEAL] == 0:
        yield MachineFacts(level=MachineLevel.GOOD, text="no time was stolen since boot")
    elif share < _BAD_STEAL:
        yield MachineFacts(
            level=MachineLevel.WARNING, text=text, keep=("pin the virtual CPUs on the host",)
        )
    else:
        yield MachineFacts(
            level=MachineLevel.BAD, text=text, keep=("pin the virtual CPUs on the host",)
        )


def _container(host: Host) -> Iterator[MachineFacts]:
    kind = host.maybe("/run/systemd/container") or ""
    # Docker and Podman create their own files, without the systemd one.
    if host.exists("/.dockerenv"):
        kind = kind or "docker"
    if host.exists("/run/.containerenv"):
        kind = kind or "podman"
    if not kind:
        yield MachineFacts(level=MachineLevel.GOOD, text="no sign of one")
        return
    yield MachineFacts(
        level=MachineLevel.NOTE,
        text=f"{kind}: limits, capabilities and interfaces are those it was given",
        keep=(
            "docker run --network host --cap-add NET_RAW --cap-add SYS_NICE --cap-add IPC_LOCK "
            "--ulimit rtprio=99 --ulimit memlock=-1 …",
        ),
    )


def _irqbalance(host: Host) -> Iterator[MachineFacts]:
    if not host.pids():
        raise Unreadable("/proc shows no processes")
    running = host.processes("irqbalance")
    if not running:
        yield MachineFacts(level=MachineLevel.GOOD, text="not running")
        return
    yield MachineFacts(
        level=MachineLevel.WARNING,
        text=f"process {running[0]} moves interrupts between CPUs, that of the interface included",
        now=("systemctl stop irqbalance",),
        keep=(
            "systemctl disable --now irqbalance; or IRQBALANCE_BANNED_CPULIST=CPU in "
            "/etc/default/irqbalance for the CPU of the cycle",
        ),
    )


def _swap(host: Host) -> Iterator[MachineFacts]:
    rows = [line.split() for line in host.read("/proc/swaps").splitlines()[1:] if line.strip()]
    if not rows:
        yield MachineFacts(level=MachineLevel.GOOD, text="none")
        return
    used = sum(int(r[3]) for r in rows if len(r) > 3 and r[3].isdecimal())
    yield MachineFacts(
        level=MachineLevel.NOTE,
        text=f"{', '.join(r[0] for r in rows)}: {used} KiB in use; fsn-master locks its own memory "
        "where it may, its clients do not",
        now=("swapoff -a",),
        keep=("take the swap lines out of /etc/fstab; systemctl mask swap.target",),
    )


MACHINE = (
    Check(
        name="machine.virtual",
        why="A hypervisor that runs something else stops the cycle without a trace in this system; "
        "FSoE watchdogs run on in the devices.",
        look=_virtual,
    ),
    Check(
        name="machine.steal",
        why="Stolen time comes in pieces of milliseconds, each of them a gap between two frames.",
        look=_steal,
    ),
    Check(
        name="machine.container",
        why="What the container was not given fails when fsn-master starts, not when it is built.",
        look=_container,
    ),
    Check(
        name="machine.irqbalance",
        why="An interrupt that moves onto the CPU of the cycle delays it; one that moves away from "
        "a warm cache delays the reply.",
        look=_irqbalance,
    ),
    Check(
        name="machine.swap",
        why="A page that has to come back from a disk costs milliseconds to seconds. Locked memory "
        "is exempt.",
        look=_swap,
    ),
)
