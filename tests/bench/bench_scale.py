"""Measures the largest bus that addresses allow, stage by stage, and that time grows linearly.

A network of 65 535 SubDevices with 65 534 transfers, as a user writes it, and two smaller ones.
Each run is a process of its own, so that memory is that of one network. Time is that of one core,
so other load counts less; of several runs the least is told. Nothing is asserted.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from networks import write_big_network

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.diag.pause import without_collector

SIZES = (4_096, 16_384, 65_535)
LIMIT_S = 8.0
LIMIT_MIB = 400.0
STAGES = ("start", "load", "resolve", "rules", "plan", "encode")


@without_collector
def stages(path: str) -> None:
    """Check and plan one network as `plan` does; print seconds per stage and MiB at most."""
    from fsoe_net.formats.own.network import load_network
    from fsoe_net.model.resolve import resolve
    from fsoe_net.plan.compile import compile_plan
    from fsoe_net.rules.check import check

    marks = [0.0, time.process_time()]
    loaded = load_network([path])
    marks.append(time.process_time())
    assert loaded.network is not None, loaded.diagnostics
    resolution = resolve(loaded.network)
    marks.append(time.process_time())
    found = check(resolution)
    marks.append(time.process_time())
    assert not any(d.level is Severity.ERROR for d in found), found[:3]
    plan = compile_plan(resolution)
    marks.append(time.process_time())
    del loaded, resolution, found  # as `plan` does
    size = len(plan.to_bytes())
    marks.append(time.process_time())
    kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(*(b - a for a, b in pairwise(marks)), kib / 1024, size)


def parser_alone(path: str) -> None:
    """Take the events of libyaml and nothing else; print seconds."""
    import yaml

    text = Path(path).read_text("utf-8")
    begin = time.process_time()
    for _ in yaml.parse(text, Loader=yaml.CLoader):
        pass
    print(time.process_time() - begin)


def core(path: str) -> None:
    """Load a plan with the C core, and read it back in Python; print seconds of both."""
    from networks import resolved

    from fsoe_net.core.core import CorePlan
    from fsoe_net.plan.codec import decode_plan
    from fsoe_net.plan.compile import compile_plan

    data = compile_plan(resolved(path)).to_bytes()
    begin = time.process_time()
    CorePlan.load(data)
    loaded = time.process_time()
    again = time.process_time()
    decode_plan(data)
    print(loaded - begin, time.process_time() - again)


def measured(stage: str, path: Path) -> list[float]:
    """Run one measurement in a process of its own."""
    done = subprocess.run(
        [sys.executable, __file__, stage, str(path)],
        check=True,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )
    return [float(word) for word in done.stdout.split()]


def main(times: int = 3) -> None:
    """Print one row per size, then what the parts of others take of the largest."""
    head = "".join(f"{stage:>9}" for stage in STAGES)
    print(f"SubDevices / transfers   seconds{head}      MiB  of limit   us/transfer")
    with tempfile.TemporaryDirectory() as name:
        for size in SIZES:
            folder = Path(name) / str(size)
            folder.mkdir()
            path = write_big_network(folder, size, size - 1)
            rows = [measured("stages", path) for _ in range(times)]
            best = min(rows, key=lambda row: sum(row[: len(STAGES)]))
            seconds, mib = sum(best[: len(STAGES)]), max(row[-2] for row in rows)
            shares = "".join(f"{part / seconds:>8.0%} " for part in best[: len(STAGES)])
            print(
                f"{f'{size} / {size - 1}':<22}{seconds:>10.2f}{shares}{mib:>9.0f}"
                f"{mib / LIMIT_MIB:>10.2f}{1e6 * (seconds - best[0]) / size:>14.1f}"
            )
        parser = min(measured("parser_alone", path)[0] for _ in range(times))
        load, decode = measured("core", path)
    print(
        f"linear when the last column stays; limits {LIMIT_S:g} s "
        f"({seconds / LIMIT_S:.2f} of it) and {LIMIT_MIB:g} MiB"
    )
    print(
        f"of the largest, libyaml alone takes {parser:.2f} s ({parser / seconds:.0%}); "
        f"its plan of {best[-1] / 1e6:.0f} MB is loaded by the core in {load:.2f} s, "
        f"read by plan --show in {decode:.2f} s"
    )


if __name__ == "__main__":
    if len(sys.argv) > 2:
        {"stages": stages, "parser_alone": parser_alone, "core": core}[sys.argv[1]](sys.argv[2])
    else:
        main(*map(int, sys.argv[1:2]))
