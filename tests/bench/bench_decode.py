"""Measures `fsoe-net decode` on a capture: packets per second against the limit, and memory.

The capture is a running cell with one connection, an FSoE frame in every second packet that comes
back. Time is that of one core, so other load does not count. The same command runs on a file ten
times as long to show that memory does not grow.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
NETWORK = str(ROOT / "examples" / "estop" / "network.yaml")
LIMIT_PER_S = 100_000
COMMAND = [sys.executable, "-m", "fsoe_net.cli"]


def capture(path: Path, seconds: int) -> int:
    """Write a capture of a virtual run; return its packets."""
    arguments = ["run", NETWORK, "--virtual-time", "--duration", str(seconds)]
    subprocess.run(
        [*COMMAND, *arguments, "--capture", str(path)], check=True, stdout=subprocess.DEVNULL
    )
    return 2000 * seconds - 1


def timed(*options: str) -> tuple[float, int]:
    """Run `decode` once; return seconds of one core and peak memory in KiB."""
    with open(os.devnull, "w") as nowhere:
        child = subprocess.Popen([*COMMAND, "decode", *options], stdout=nowhere)
        _, status, usage = os.wait4(child.pid, 0)
    if status:
        raise SystemExit(f"decode failed: {options}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss


def main() -> None:
    """Print packets per second, the ratio to the limit, and memory for two lengths."""
    with tempfile.TemporaryDirectory() as folder:
        short, long = Path(folder) / "short.pcapng", Path(folder) / "long.pcapng"
        few, many = capture(short, 15), capture(long, 150)
        print("decode            packets/s   of limit   MiB short   MiB long")
        for title, options in (
            ("text", []),
            ("text, names", ["--network", NETWORK]),
            ("--changes", ["--changes"]),
            ("--summary", ["--summary"]),
            ("json", ["--format", "json"]),
        ):
            short_s, short_kib = timed(str(short), *options)
            long_s, long_kib = timed(str(long), *options)
            # The difference leaves the start of the interpreter out.
            rate = (many - few) / max(long_s - short_s, 1e-9)
            print(
                f"{title:16} {rate:10.0f} {rate / LIMIT_PER_S:10.2f} "
                f"{short_kib / 1024:11.1f} {long_kib / 1024:10.1f}"
            )


if __name__ == "__main__":
    main()
