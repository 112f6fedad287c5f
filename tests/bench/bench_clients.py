"""What busy clients cost the cycle: its statistics without any, and with 50 that never stop asking.

Call: ``bench_clients.py [SECONDS] [CPU]``. Runs ``fsn-master`` on its emulated bus, the cycle with
real-time priority on one CPU where that is permitted; the control thread and the clients run where
the system puts them. Without and with clients take turns; medians and spreads are of several turns.
Nothing is asserted.
"""

from __future__ import annotations

import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fsoe_net.errors import FsnError
from fsoe_net.formats.own.network import load_network
from fsoe_net.live.client import Client
from fsoe_net.live.master import find_master
from fsoe_net.model.resolve import resolve
from fsoe_net.plan.compile import compile_plan

CLIENTS, TURNS, CYCLE, CHANGES = 50, 5, "500us", 200
OUTPUT = "drive_1.0x6060:00"
NETWORK = Path(__file__).parents[2] / "examples" / "el6910" / "network.yaml"
ASKED = (b"watch 1 --image", b"watch 1", b"events on")
"""A third of the clients each gets images, values, and events; all of them ask on and on."""
ROWS = (
    ("wake-up late", "latency"),
    ("work", "work"),
    ("copies", "copy"),
)


class Busy:
    """Clients that send requests as fast as they are answered, and read all they are sent."""

    def __init__(self, path: Path, count: int) -> None:
        self.over = threading.Event()
        self.bytes = [0] * count
        self._threads = [
            threading.Thread(target=self._run, args=(path, n), daemon=True) for n in range(count)
        ]
        for thread in self._threads:
            thread.start()

    def _run(self, path: Path, number: int) -> None:
        with socket.socket(socket.AF_UNIX) as wire:
            wire.connect(str(path))
            wire.sendall(ASKED[number % len(ASKED)] + b"\n")
            while not self.over.is_set():
                wire.sendall(b"snapshot\nsymbols\n")
                self.bytes[number] += len(wire.recv(1 << 18))

    def end(self) -> int:
        """Stop them; return how many bytes they were sent."""
        self.over.set()
        for thread in self._threads:
            thread.join()
        return sum(self.bytes)


@contextmanager
def master(folder: Path, cpu: int | None) -> Iterator[Path]:
    plan = folder / "bench.fsnplan"
    plan.write_bytes(compile_plan(resolve(load_network([NETWORK]).network)).to_bytes())
    path = folder / "s"
    words = [str(find_master()), str(plan), "--bus", "emulated", "--cycle", CYCLE]
    words += ["--socket", str(path), *(["--cpu", str(cpu)] if cpu is not None else [])]
    process = subprocess.Popen(words, stderr=subprocess.DEVNULL)
    try:
        while not path.exists() or state(path) != "running":
            time.sleep(0.05)
        yield path
    finally:
        process.terminate()
        process.wait()


def state(path: Path) -> str:
    try:
        with Client(path) as client:
            return str(client.request("status")["state"])
    except FsnError:
        return ""


def looked(path: Path) -> dict[str, Any]:
    with Client(path) as client:
        found: dict[str, Any] = client.request("snapshot")["statistics"]
        return found


def percentile(before: dict[str, Any], after: dict[str, Any], share: float) -> float:
    """Return a percentile of the times between two snapshots, in us, by the floors of buckets."""
    old = dict(map(tuple, before["buckets"]))
    counts = [(floor, count - old.get(floor, 0)) for floor, count in after["buckets"]]
    wanted = share * sum(count for _, count in counts)
    seen = 0
    for floor, count in counts:
        seen += count
        if count and seen >= wanted:
            return floor / 1e3
    return 0.0


def turn(folder: Path, cpu: int | None, seconds: float, clients: int) -> dict[str, float]:
    """Measure once, on a process of its own; times in us."""
    with master(folder, cpu) as path:
        busy = Busy(path, clients)
        time.sleep(0.5)
        before = looked(path)
        time.sleep(seconds)
        after = looked(path)
        sent = busy.end()
    cycles = after["cycles"] - before["cycles"]
    found = {"cycles": float(cycles), "MB to clients": sent / 1e6}
    found["cycles left out"] = float(after["overruns"] - before["overruns"])
    for title, key in ROWS:
        for share in (0.5, 0.99, 0.999):
            found[f"{title} {100 * share:g} % [us]"] = percentile(before[key], after[key], share)
    found["real-time"] = float(after["realtime"])
    return found


def change_seen(folder: Path, cpu: int | None) -> list[float]:
    """Return, per change of a value, the ms from the start of its cycle to a client's having it."""
    found = []
    with master(folder, cpu) as path, Client(path) as writer, socket.socket(socket.AF_UNIX) as wire:
        writer.request("lease", "0")
        wire.connect(str(path))
        lines = wire.makefile("rwb", buffering=0)
        lines.write(f"watch 1 {OUTPUT}\n".encode())
        lines.readline()
        for number in range(CHANGES):
            wanted = number % 2
            writer.request("set", f"{OUTPUT}={wanted}")
            while True:
                line = lines.readline()
                now_ns = time.monotonic_ns()
                told = json.loads(line)
                if told["outputs"][OUTPUT] == wanted:
                    break
            found.append((now_ns - told["now_ns"]) / 1e6)
            time.sleep(0.003)
            wire.setblocking(False)
            try:
                while wire.recv(1 << 16):
                    pass
            except BlockingIOError:
                wire.setblocking(True)
            while lines.read(1) != b"\n":
                pass  # the rest of a line
    return sorted(found)


def main() -> int:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 5.0
    cpu = int(sys.argv[2]) if len(sys.argv) > 2 else (os.cpu_count() or 1) - 1
    runs: dict[int, list[dict[str, float]]] = {0: [], CLIENTS: []}
    with tempfile.TemporaryDirectory(prefix="fsn-") as text:
        for _ in range(TURNS):
            for clients, found in runs.items():
                found.append(turn(Path(text), cpu, seconds, clients))
    print(f"cycle of {CYCLE} on CPU {cpu}, {TURNS} turns of {seconds:g} s: median (least, most)")
    print(f"{'':28}{'no client':>30}{f'{CLIENTS} busy clients':>30}")
    for key in runs[0][0]:
        cells = []
        for found in runs.values():
            values = [run[key] for run in found]
            cells.append(f"{statistics.median(values):.6g} ({min(values):.6g}, {max(values):.6g})")
        print(f"{key:28}{cells[0]:>30}{cells[1]:>30}")
    with tempfile.TemporaryDirectory(prefix="fsn-") as text:
        late = change_seen(Path(text), cpu)
    print(
        f"a client has a change {late[len(late) // 2]:.2f} ms (half of {CHANGES}), "
        f"{late[len(late) * 99 // 100]:.2f} ms (99 %) after its cycle of {CYCLE} began"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
