"""Measures `check` and `plan` as a user runs them, and virtual time; prints limits too."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from networks import write_big_network

from fsoe_net.bench.measure import emulated_per_s


def process(*arguments: str) -> tuple[float, float]:
    """Return processor seconds and peak memory in MB of one call of the tool."""
    child = subprocess.Popen(
        [sys.executable, "-m", "fsoe_net.cli", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    assert child.returncode == 0, (arguments, child.returncode)
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def best(*arguments: str, times: int = 3) -> tuple[float, float]:
    runs = [process(*arguments) for _ in range(times)]
    return min(r[0] for r in runs), max(r[1] for r in runs)


def main() -> None:
    print(f"\n{'network':<24}{'check s':>9}{'plan s':>9}{'sum s':>9}{'MB':>7}")
    sums = {}
    with tempfile.TemporaryDirectory() as folder:
        for subdevices, transfers in ((500, 424), (5000, 4000)):
            path = Path(folder) / str(subdevices)
            path.mkdir()
            network = str(write_big_network(path, subdevices, transfers))
            check, memory_1 = best("check", network)
            plan, memory_2 = best("plan", network, "-o", str(path / "x.fsnplan"), "--overwrite")
            sums[subdevices] = check + plan
            name = f"{subdevices} / {transfers}"
            memory = max(memory_1, memory_2)
            print(f"{name:<24}{check:>9.2f}{plan:>9.2f}{check + plan:>9.2f}{memory:>7.0f}")
    print("limits: 500 / 424 below 1 s; 5000 / 4000 below 300 MB")
    print(f"growth from 500 to 5000: {sums[5000] / sums[500]:.1f} times (linear is at most 10)")
    rate = emulated_per_s()
    print(f"virtual time, examples/estop: {rate:.0f} bus cycles per second (limit 2000)")
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(f"peak memory of this process: {peak_mb} MB")


if __name__ == "__main__":
    main()
