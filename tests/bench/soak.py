"""An hour of el6910 over veth at 1 kHz; fails on a Reset of any connection.

Call: ``soak.py [SECONDS] [CPU]``, as root in a network namespace of its own (``scripts/soak``
makes it).
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

NETWORK = str(Path(__file__).parents[2] / "examples" / "el6910" / "network.yaml")
FSN = [sys.executable, "-m", "fsoe_net.cli"]
PRIORITY = 80


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 3600.0
    cpu = sys.argv[2] if len(sys.argv) > 2 else str(max(os.sched_getaffinity(0)))
    # The devices above whatever else the machine does: their watchdogs do not wait for it.
    above = ["chrt", "-f", "10"] if shutil.which("chrt") else []
    segment = ["--interface", "far", "--priority", str(PRIORITY + 1), "--cpu", cpu]
    emulator = subprocess.Popen(
        [*above, *FSN, "emulate", NETWORK, *segment], stdout=subprocess.DEVNULL
    )
    options = ["--wait", "30", "--cycle", "1ms", "--priority", str(PRIORITY), "--cpu", cpu]
    options += ["--format", "json"]
    done = subprocess.run(
        [*FSN, "run", NETWORK, "--interface", "near", *options, "--duration", str(seconds)],
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    emulator.terminate()  # SIGINT is ignored in background jobs
    emulator.wait()
    if not done.stdout:
        sys.exit(done.returncode or 3)
    sys.exit(judge(json.loads(done.stdout)))


def judge(found: dict) -> int:
    s = found["statistics"]
    print(
        f"{s['cycles']} cycles in {found['duration_ms'] / 1000:.0f} s: {s['lost_frames']} lost "
        f"frames, {s['wkc_errors']} incomplete, {s['overruns']} overruns; latency 99.9 % "
        f"{s['latency']['p999_ns'] / 1000:.0f} us, most {s['latency']['max_ns'] / 1000:.0f} us"
    )
    resets = 0
    for c in found["connections"]:
        resets += c["resets"]
        print(
            f"{c['name']}: {c['wire_state']}, {c['frames_to_sub']} frames, longest "
            f"{c['fsoe_cycle_ms']['max']:.1f} ms, {c['resets']} resets {c['last_reset_text']}"
        )
    for event in found["events"]:
        if event["code"] is not None:
            print(f"{event['time_ms']:12.1f} ms  {event['source']}: {event['text']}")
    good = resets == 0 and all(c["wire_state"].startswith("data") for c in found["connections"])
    print("soak: no reset" if good else "soak: FAILED")
    return 0 if good else 1


if __name__ == "__main__":
    main()
