"""Measures on the emulated bus of ``fsn-master``, where no frame is sent; and over a wire."""

from __future__ import annotations

import contextlib
import ctypes
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime

from fsoe_net.bench.result import BenchHost, BenchResult, Measured, Times, WireResult
from fsoe_net.bench.wire import measure_wire
from fsoe_net.core.json_object import clean
from fsoe_net.core.snapshot import Statistics
from fsoe_net.errors import EnvironmentFault
from fsoe_net.host.doctor import examine
from fsoe_net.host.finding import MachineLevel
from fsoe_net.host.seam import Host, Unreadable
from fsoe_net.live.attachment import Attachment
from fsoe_net.live.client import Client
from fsoe_net.live.control_values import BusState
from fsoe_net.live.master import Master, find_master
from fsoe_net.network import load
from fsoe_net.project.installed import shipped

MOST_CYCLES = 10_000_000
"""Each sample of a part is kept until its end."""
_OPEN_S = 10.0
_OTHERS_S = 1.0
_VIRTUAL_S = 5.0
_LOOK_S = 0.1
_TIMER_ABSTIME = 1
_PRIORITY = 80
_STAT_FIELDS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchPlan:
    """The cycle, the time of each part, and the wire: none, a veth pair or an interface."""

    cycle_ns: int
    seconds: float
    wire: bool = False
    interface: str | None = None


def bench(plan: BenchPlan, host: Host, report: Callable[[str], None]) -> BenchResult:
    """Measure this machine.

    Args:
        plan: The cycle and the times.
        host: The machine.
        report: Called with the name of each part before it begins.

    Raises:
        EnvironmentFault: A program is missing or does not start, a permission is missing, or an
            ``fsn-master`` drives a bus.
    """
    find_master()
    refuse_beside_a_bus(host)
    others = others_share(host, _OTHERS_S)
    wire: WireResult | None = None
    on_wire: dict[Measured, Times] = {}
    if plan.wire:
        report("frames on a wire")
        wire, on_wire = measure_wire(plan.cycle_ns, plan.seconds, plan.interface)
    report("an empty timer")
    timer, realtime = empty_timer(plan)
    report("the cycle alone")
    alone = _cycle(plan, realtime, lambda client: time.sleep(plan.seconds))
    report("the cycle with a monitor")
    monitored = _cycle(plan, realtime, lambda client: _monitor(client, plan.seconds))
    report("a real-time client")
    late: list[int] = []
    _cycle(plan, realtime, lambda client: late.extend(_client(client, plan.seconds)))
    times = {
        Measured.TIMER: timer,
        Measured.WAKE_UP: Times.of_histogram(alone.latency),
        Measured.WORK: Times.of_histogram(alone.work),
        Measured.COPY: Times.of_histogram(alone.copy),
        Measured.MONITORED_WAKE_UP: Times.of_histogram(monitored.latency),
        Measured.MONITORED_WORK: Times.of_histogram(monitored.work),
        Measured.CLIENT: Times.of_samples(late),
        **on_wire,
    }
    report("the emulator")
    rate = emulated_per_s()
    others = max(others, others_share(host, _OTHERS_S))
    return BenchResult(
        utc=f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}",
        host=_host(host, realtime=realtime, others=others),
        cycle_ns=plan.cycle_ns,
        seconds=plan.seconds,
        times=times,
        emulated_per_s=rate,
        wire=wire,
    )


def refuse_beside_a_bus(host: Host) -> None:
    """Reject a machine that drives a bus: threads of the same priority would delay its cycle.

    Raises:
        EnvironmentFault: An ``fsn-master`` runs whose bus is not emulated.
    """
    for pid in host.processes("fsn-master"):
        words = (host.maybe(f"/proc/{pid}/cmdline") or "").split("\0")
        if "emulated" not in words and "--bus=emulated" not in words:
            raise EnvironmentFault(
                f"fsn-master (process {pid}) drives a bus on this machine, and a measurement would "
                "delay its cycle; measure while no bus runs"
            )


class _TimeSpec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


@contextlib.contextmanager
def cyclic_priority() -> Iterator[bool]:
    """Give this thread the priority of a cycle, if that is permitted; yields whether it is."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
    except OSError:
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def empty_timer(plan: BenchPlan) -> tuple[Times, bool]:
    """Return how late a loop wakes up that only sleeps until each cycle, and its priority."""
    # Not time.sleep(), which computes a duration: the cycle also sleeps until a time.
    sleep = ctypes.CDLL(None).clock_nanosleep
    late = []
    with cyclic_priority() as realtime:
        at_ns = time.monotonic_ns() + plan.cycle_ns
        for _ in range(max(1, int(plan.seconds * 1e9 / plan.cycle_ns))):
            until = _TimeSpec(*divmod(at_ns, 1_000_000_000))
            sleep(time.CLOCK_MONOTONIC, _TIMER_ABSTIME, ctypes.byref(until), None)
            late.append(max(0, time.monotonic_ns() - at_ns))
            # As the cycle does, it leaves out what it is too late for.
            at_ns += plan.cycle_ns * (1 + late[-1] // plan.cycle_ns)
    return Times.of_samples(late), realtime


def _cycle(plan: BenchPlan, realtime: bool, during: Callable[[Client], None]) -> Statistics:
    """Run the e-stop cell in memory, with the priority that the timer had."""
    data = load(shipped("examples") / "estop" / "network.yaml").compile().to_bytes()
    options = ["--bus", "emulated", "--cycle", f"{plan.cycle_ns // 1000}us"]
    options += ["--policy", "fifo" if realtime else "other"]
    with Master(data, options) as master, master.connect() as client:
        until = time.monotonic() + _OPEN_S
        while client.status().state is not BusState.RUNNING:
            if time.monotonic() > until:
                raise EnvironmentFault("fsn-master does not reach the state running")
            time.sleep(0.01)
        during(client)
        return client.snapshot().cycle.statistics


def _monitor(client: Client, seconds: float) -> None:
    until = time.monotonic() + seconds
    with Attachment(client.path) as attached:
        while time.monotonic() < until:
            attached.look(_LOOK_S)


def _client(client: Client, seconds: float) -> Iterator[int]:
    until = time.monotonic() + seconds
    with client.realtime() as cycle, cyclic_priority():
        while True:
            start_ns = cycle.wait(_OPEN_S).now_ns
            yield max(0, time.monotonic_ns() - start_ns)
            if time.monotonic() >= until:
                return


def emulated_per_s() -> float:
    """Return how many bus cycles a second the emulated e-stop cell runs in virtual time."""
    network = load(shipped("examples") / "estop" / "network.yaml")
    begin = time.perf_counter()
    run = network.simulate(duration_s=_VIRTUAL_S)
    cycles = run.statistics.cycles if run.statistics is not None else 0
    return cycles / (time.perf_counter() - begin)


def others_share(host: Host, seconds: float) -> float:
    """Return the share of all processors that is busy while this process sleeps.

    Raises:
        Unreadable: The system is not Linux.
    """
    idle, total = _processor_times(host)
    time.sleep(seconds)
    idle_after, total_after = _processor_times(host)
    passed = total_after - total
    return 1 - (idle_after - idle) / passed if passed > 0 else 0.0


def _processor_times(host: Host) -> tuple[int, int]:
    words = host.read("/proc/stat").partition("\n")[0].split()[1:9]
    if len(words) < _STAT_FIELDS or not all(w.isdecimal() for w in words):
        raise Unreadable("/proc/stat has no line of all CPUs in the form of Linux")
    times = [int(w) for w in words]
    # Idle, and idle while input or output is awaited (proc(5)).
    return times[3] + times[4], sum(times)


def _host(host: Host, *, realtime: bool, others: float) -> BenchHost:
    examination = examine(host)
    lines = (host.maybe("/proc/cpuinfo") or "").splitlines()
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return BenchHost(
        kernel=examination.release,
        processor=clean(next(models, "")),
        cpus=examination.cpus,
        warnings=examination.count(MachineLevel.WARNING) + examination.count(MachineLevel.BAD),
        realtime=realtime,
        others_share=round(others, 3),
    )
