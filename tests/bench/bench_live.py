"""Free-running cycles over veth against one emulated segment: fsn-master, pysoem, KickCAT in turn.

Call: ``bench_live.py [SECONDS] [CPU]``, as root in a network namespace of its own
(``scripts/bench live`` makes it). Emulator and MainDevice share a CPU, the emulator has the higher
priority; devices stand still, so only the cycle is measured. pysoem and KickCAT are called from
Python, as their users do: `fsoe-net bench --wire` measures the loop of SOEM itself in C.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from fsoe_net.bench.wire import write_cells
from fsoe_net.core.segment import SegmentLink
from fsoe_net.errors import FsnError
from fsoe_net.formats.own.network import load_network
from fsoe_net.live.client import Client
from fsoe_net.live.master import find_master
from fsoe_net.model.resolve import resolve
from fsoe_net.plan.compile import compile_plan
from fsoe_net.simulate.emulate import SegmentSession
from fsoe_net.simulate.session import counted_session_ids

PRIORITY, TURNS, ATTEMPTS = 60, 3, 6


def be_cyclic(cpu: int | None) -> None:
    """Put this thread where the cycle runs, or back among all others."""
    os.sched_setaffinity(0, range(os.cpu_count() or 1) if cpu is None else {cpu})
    policy = os.SCHED_OTHER if cpu is None else os.SCHED_FIFO
    os.sched_setscheduler(0, policy, os.sched_param(0 if cpu is None else PRIORITY))


def counted(cycle: Callable[[], bool], seconds: float, cpu: int) -> tuple[float, int]:
    """Return complete cycles per second, and how many were incomplete."""
    be_cyclic(cpu)
    try:
        begin = time.perf_counter()
        cycles = bad = 0
        while (now := time.perf_counter()) < begin + seconds:
            for _ in range(50):
                bad += not cycle()
            cycles += 50
        return (cycles - bad) / (now - begin), bad
    finally:
        be_cyclic(None)


def with_pysoem(seconds: float, cpu: int) -> tuple[float, int]:
    import pysoem

    master = pysoem.Master()
    master.open("near")
    master.config_init()
    master.config_map()
    master.state_check(pysoem.SAFEOP_STATE, 500_000)
    master.state = pysoem.OP_STATE
    master.send_processdata()
    master.receive_processdata(2000)
    master.write_state()
    if master.state_check(pysoem.OP_STATE, 500_000) != pysoem.OP_STATE:
        master.close()
        raise RuntimeError("not every SubDevice has reached OP")
    send, receive = master.send_processdata, master.receive_processdata
    expected = master.expected_wkc

    def cycle() -> bool:
        send()
        return receive(2000) == expected

    rate = counted(cycle, seconds, cpu)
    master.close()
    return rate


def with_kickcat(seconds: float, cpu: int) -> tuple[float, int]:
    import kickcat as kick

    bus = kick.Bus(kick.create_link("near", ""))
    bus.init(0.1)
    bus.create_mapping()
    bus.request_state(kick.State.SAFE_OP)
    bus.wait_for_state(kick.State.SAFE_OP, 3.0)

    def cycle() -> bool:
        try:
            bus.process_data()
        except Exception:  # it raises where a frame was lost
            return False
        return True

    cycle()
    bus.request_state(kick.State.OPERATIONAL)
    bus.wait_for_state(kick.State.OPERATIONAL, 3.0, bus.process_data)
    return counted(cycle, seconds, cpu)


def with_fsn(plan: Path, seconds: float, cpu: int) -> tuple[float, int]:
    path = plan.with_name("control.sock")
    words = ["--bus", "soem", "--interface", "near", "--free-run", "--cpu", str(cpu)]
    words += ["--policy", "fifo", "--priority", str(PRIORITY), "--socket", str(path)]
    with subprocess.Popen(
        [find_master(), str(plan), *words], stderr=subprocess.PIPE, text=True
    ) as process:
        client = None
        while client is None:
            if process.poll() is not None:
                sys.exit(f"fsn-master has ended: {process.stderr.read()}")
            try:
                client = Client(path)
            except FsnError:
                time.sleep(0.02)
        while client.request("status")["state"] != "running":
            time.sleep(0.02)
        begin, first = time.perf_counter(), client.snapshot().cycle.statistics
        time.sleep(seconds)
        end, last = time.perf_counter(), client.snapshot().cycle.statistics
        client.request("shutdown")
        process.communicate()
    bad = last.wkc_errors - first.wkc_errors
    return (last.cycles - first.cycles - bad) / (end - begin), bad


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 8.0
    cpu = int(sys.argv[2]) if len(sys.argv) > 2 else max(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as folder:
        loaded = load_network([write_cells(Path(folder))])
        resolution = resolve(loaded.network)
        data = compile_plan(resolution).to_bytes()
        plan = Path(folder) / "ten.fsnplan"
        plan.write_bytes(data)
        session = SegmentSession(resolution, data, None, session_ids=counted_session_ids())
        with session.segment as segment:
            segment.link(SegmentLink(interface="far", priority=PRIORITY + 1, cpu=cpu))
            compare(plan, seconds, cpu)
            counts = segment.counts()
    print(f"emulator: {counts.work_ns / counts.frames / 1000:.2f} us per frame")


def patiently(run: Callable[[], tuple[float, int]]) -> tuple[float, int]:
    """Bring the peer up again where a busy machine made it give up."""
    for _ in range(ATTEMPTS - 1):
        try:
            return run()
        except Exception as fault:
            print(f"  again: {fault}")
    return run()


def compare(plan: Path, seconds: float, cpu: int) -> None:
    """Parts in turn, so that a slow second of the machine falls on all."""
    best = {"fsn-master": 0.0, "pysoem": 0.0, "kickcat": 0.0}
    for _ in range(TURNS):
        for name in best:
            if name == "fsn-master":
                rate, bad = with_fsn(plan, seconds / TURNS, cpu)
            else:
                peer = with_pysoem if name == "pysoem" else with_kickcat
                rate, bad = patiently(partial(peer, seconds / TURNS, cpu))
            print(f"  {name:<12}{rate / 1000:8.1f} kHz, {bad} incomplete")
            best[name] = max(best[name], rate)
    for name in ("pysoem", "kickcat"):
        print(f"=> rate of fsn-master {best['fsn-master'] / best[name]:.2f} of that of {name}")


if __name__ == "__main__":
    main()
