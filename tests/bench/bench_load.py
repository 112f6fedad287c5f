"""Measures the ESI reader: one device out of a large file, first and again, against the limits.

Each row is a process of its own, so that memory is that of one reading; the start of the
interpreter and the imports are told apart. Time is that of one core, so other load does not count.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from big_esi import write_big_esi

MEGABYTES = 40
LIMIT_S = 3.0
LIMIT_MIB = 150.0
READ = """
import resource, sys, time
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.esi.read import EsiChoice, load_esi
out, begin = Collector(), time.process_time()
found = load_esi(sys.argv[1], out, choice=EsiChoice(product=int(sys.argv[2])))
assert found is not None and not out.diagnostics, out.diagnostics
usage = resource.getrusage(resource.RUSAGE_SELF)
print(begin, time.process_time() - begin, usage.ru_maxrss)
"""


def timed(path: Path, product: int, cache: Path) -> tuple[float, float, float]:
    """Read one device; return seconds until it begins, seconds of it, and MiB at most."""
    done = subprocess.run(
        [sys.executable, "-c", READ, str(path), str(product)],
        env={**os.environ, "XDG_CACHE_HOME": str(cache)},
        check=True,
        capture_output=True,
        text=True,
    )
    start, seconds, kib = map(float, done.stdout.split())
    return start, seconds, kib / 1024


def main() -> None:
    """Print time and memory of the first reading, and of one with the list kept."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "big.xml"
        devices = write_big_esi(path, MEGABYTES * 1_000_000)
        print(f"ESI of {MEGABYTES} MB, {devices} devices   seconds   of limit      MiB   of limit")
        for title in ("first", "list kept"):
            start, seconds, mib = timed(path, devices // 2 - 1, folder / "cache")
            print(
                f"{title:32} {seconds:9.2f} {seconds / LIMIT_S:10.2f} "
                f"{mib:8.0f} {mib / LIMIT_MIB:10.2f}"
            )
        print(f"{'(start and imports)':32} {start:9.2f}")


if __name__ == "__main__":
    main()
