"""The bus for an hour or a day, with a verdict: faults of ours apart from stalls of the machine.

Call: ``soak.py [SECONDS] [--cpu N] [--copies N]``, as root in a network namespace of its own
(``scripts/rig/soak`` makes it, and builds both programs). The el6910 example runs over a veth pair
at 1 kHz. On every CPU a program above all others only watches the clock. A connection that leaves
Data is explained by a stall longer than its watchdog, and by nothing else. Then copies of the core
are compared with a shadow.

Exit codes: 0 good, 1 something is not explained or differs, 3 it could not be tried.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fsoe_net.core.bus_documents import BusSnapshot
from fsoe_net.errors import FsnError
from fsoe_net.live.client import Client
from fsoe_net.live.master import find_master

ROOT = Path(__file__).parents[2]
NETWORK = ROOT / "examples" / "el6910" / "network.yaml"
PROGRAMS = ROOT / "build" / "bench"
FSN = [sys.executable, "-m", "fsoe_net.cli"]
PRIORITY = 80
THRESHOLD_MS = 5
PATIENCE_S = 60
AFTER_NS = 1_000_000_000
"""What follows a stall within so long follows from it: its end, the handshake, the logic."""
COULD_NOT = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Stall:
    """The clock of a CPU was not seen from ``from_ns`` to ``until_ns``, monotonic."""

    cpu: int
    from_ns: int
    until_ns: int

    @property
    def length_ns(self) -> int:
        """For how long."""
        return self.until_ns - self.from_ns


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """A connection has left Data. ``stall`` explains it; ``None``: nothing does."""

    connection: str
    now_ns: int
    text: str
    stall: Stall | None


def losses(
    events: Sequence[Mapping[str, Any]],
    stalls: Sequence[Stall],
    watchdog_ns: Mapping[str, int],
    from_ns: int,
) -> list[Loss]:
    """Return every connection that has left Data since a time, each with the stall behind it.

    Args:
        events: Of ``fsn-master``, as its log has them.
        stalls: Of all CPUs.
        watchdog_ns: By connection: for how long a stall must last to explain its loss.
        from_ns: Before, the connections were on their way to Data.
    """
    found = []
    for event in events:
        if event.get("event") != "connection" or event["now_ns"] < from_ns:
            continue
        if " data" not in event["before"] or " data" in event["after"]:
            continue
        name, now_ns = event["connection"], event["now_ns"]
        behind = [
            s
            for s in stalls
            if s.length_ns >= watchdog_ns[name] and s.from_ns <= now_ns <= s.until_ns + AFTER_NS
        ]
        found.append(
            Loss(
                connection=name,
                now_ns=now_ns,
                text=event["text"],
                stall=max(behind, key=lambda s: s.length_ns, default=None),
            )
        )
    return found


def read_stalls(cpu: int, lines: str) -> list[Stall]:
    """Return the stalls in what the watcher of a CPU has printed."""
    pairs = [line.split() for line in lines.splitlines() if line[:1].isdigit()]
    return [Stall(cpu=cpu, from_ns=int(a), until_ns=int(b)) for a, b in pairs]


def spare_ns(snapshot: BusSnapshot, watchdogs_ms: Mapping[str, int]) -> dict[str, int]:
    """Return what is left of each watchdog when the two frames that were under way are taken off.

    A watchdog runs from one new frame to the next, so a stall and these share it.
    """
    spare = {}
    for c in snapshot.cycle.connections:
        usual = max(d.interval_mean_ns for d in (c.to_sub, c.to_main))
        spare[c.name] = round(watchdogs_ms[c.name] * 1_000_000 - 2 * usual)
    return spare


class Watchers:
    """A program on every CPU that only watches the clock."""

    def __init__(self) -> None:
        self._running = {
            cpu: subprocess.Popen(
                [PROGRAMS / "watch_clock", str(cpu), str(THRESHOLD_MS)],
                stdout=subprocess.PIPE,
                text=True,
            )
            for cpu in sorted(os.sched_getaffinity(0))
        }
        if any(p.stdout is None or p.stdout.readline() == "" for p in self._running.values()):
            self.end()
            sys.exit(COULD_NOT)

    def end(self) -> list[Stall]:
        """End them; return every stall, in order of time."""
        stalls = []
        for cpu, process in self._running.items():
            process.terminate()
            stalls += read_stalls(cpu, process.communicate()[0])
        return sorted(stalls, key=lambda s: s.from_ns)


@contextmanager
def bus(folder: Path, cpu: int) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """Run segment and ``fsn-master``; give the latter, and the file of its log."""
    # The devices above whatever else the machine does: their watchdogs do not wait for it.
    above = ["chrt", "-f", "10"] if shutil.which("chrt") else []
    words = ["--interface", "far", "--priority", str(PRIORITY + 1), "--cpu", str(cpu)]
    segment = subprocess.Popen(
        [*above, *FSN, "emulate", str(NETWORK), *words], stdout=subprocess.DEVNULL
    )
    plan, log = folder / "n.fsnplan", folder / "log"
    subprocess.run([*FSN, "plan", str(NETWORK), "-o", str(plan)], check=True, capture_output=True)
    words = [
        "--interface",
        "near",
        "--socket",
        str(folder / "s"),
        "--wait",
        "30s",
        "--cycle",
        "1ms",
    ]
    words += ["--policy", "fifo", "--priority", str(PRIORITY), "--cpu", str(cpu), "--log", "json"]
    with log.open("wb") as lines:
        master = subprocess.Popen([find_master(), plan, *words], stderr=lines)
    try:
        yield master, log
    finally:
        for process in (master, segment):  # SIGINT is ignored in background jobs
            process.terminate()
            process.wait()


def in_data(socket: Path) -> BusSnapshot | None:
    """Return the bus, or ``None`` while not all of it is in Data."""
    try:
        with Client(socket) as client:
            seen = client.snapshot()
    except FsnError:
        return None
    return seen if all(c.state.in_data for c in seen.cycle.connections) else None


def wait_for_data(master: subprocess.Popen[bytes], socket: Path) -> None:
    until = time.monotonic() + PATIENCE_S
    while in_data(socket) is None:
        if master.poll() is not None or time.monotonic() > until:
            sys.exit("soak: the bus did not come to Data")
        time.sleep(0.1)


def events_of(log: Path) -> list[dict[str, Any]]:
    rows = (json.loads(line) for line in log.read_text("utf-8").splitlines() if line[:1] == "{")
    return [row for row in rows if "event" in row]


def on_the_wire(seconds: float, cpu: int) -> bool:
    """Run the bus for a time and print what happened; return whether all of it is explained."""
    watchers = Watchers()
    stalls: list[Stall] = []
    try:
        with tempfile.TemporaryDirectory(prefix="fsn-") as name, bus(Path(name), cpu) as running:
            master, log = running
            socket = Path(name) / "s"
            wait_for_data(master, socket)
            from_ns = time.monotonic_ns()
            while master.poll() is None and time.monotonic_ns() < from_ns + seconds * 1e9:
                time.sleep(min(1.0, seconds / 10))
            ended = master.poll()
            with Client(socket) as client:
                last = client.snapshot()
                watchdogs = {c.name: c.watchdog_ms or 0 for c in client.layout().connections}
            events = events_of(log)
    finally:
        stalls += watchers.end()
    lost = losses(events, stalls, spare_ns(last, watchdogs), from_ns)
    stalls = [s for s in stalls if s.until_ns > from_ns]
    print_bus(last, stalls, lost)
    good = ended is None and all(c.state.in_data for c in last.cycle.connections)
    print("" if good else f"the bus is not in Data at the end, fsn-master: {ended}", end="")
    return good and all(loss.stall is not None for loss in lost)


def print_bus(last: BusSnapshot, stalls: Sequence[Stall], lost: Sequence[Loss]) -> None:
    """Print counters, stalls of the machine, and every loss."""
    s = last.cycle.statistics
    print(
        f"{s.cycles} cycles: {s.lost_frames} lost frames, {s.wkc_errors} incomplete, "
        f"{s.overruns} overruns; latency 99.9 % {s.latency.p999_ns / 1000:.0f} us, most "
        f"{s.latency.max_ns / 1000:.0f} us; {s.cycles * s.copies} copies"
    )
    longest = max((x.length_ns for x in stalls), default=0) / 1e6
    print(f"stalls of the machine of {THRESHOLD_MS} ms and more: {len(stalls)}", end="")
    print(f", the longest {longest:.0f} ms" if stalls else "")
    for loss in lost:
        by = loss.stall
        why = f"CPU {by.cpu} stood still for {by.length_ns / 1e6:.0f} ms" if by else "NOT EXPLAINED"
        print(f"{loss.now_ns / 1e6:12.1f} ms  {loss.text}: {why}")
    explained = sum(loss.stall is not None for loss in lost)
    print(f"connections that left Data: {len(lost)}, {explained} explained by a stall")


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="scripts/rig/soak", description=__doc__.partition("\n")[0]
    )
    parser.add_argument("seconds", nargs="?", type=float, default=3600.0)
    parser.add_argument("--cpu", type=int, default=max(os.sched_getaffinity(0)))
    parser.add_argument("--copies", type=int, default=1_000_000_000)
    asked = parser.parse_args()
    try:
        good = asked.seconds <= 0 or on_the_wire(asked.seconds, asked.cpu)
    except FsnError as exc:
        print(f"soak: fsn-master does not answer at the end: {exc}")
        good = False
    sys.stdout.flush()
    if asked.copies > 0:
        done = subprocess.run([PROGRAMS / "soak_copy", str(asked.copies)], check=False)
        good = good and done.returncode == 0
    print("soak: good" if good else "soak: FAILED")
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
