"""`fsoe-net bench`: a short measurement, its document, and the comparison of two results.

What needs a wire is in ``test_wire.py``.
"""

from __future__ import annotations

import json
import os
import random
from pathlib import Path

import numpy as np
import pytest
from bench.made_result import SCHEMA, result, write
from cli.tool import fsn
from jsonschema import Draft202012Validator
from live.support import needs_core
from master.rig import program

from fsoe_net.bench.document import bench_document
from fsoe_net.bench.measure import BenchPlan, bench, others_share, refuse_beside_a_bus
from fsoe_net.bench.result import Measured, Times, read_result
from fsoe_net.document.write_terminal import document_text
from fsoe_net.errors import EnvironmentFault
from fsoe_net.host.seam import Host, Unreadable


class NoBus(Host):
    """This machine, without the processes of other tests."""

    def processes(self, name: str) -> list[int]:
        return []


@needs_core
def test_a_measurement_follows_its_schema_and_can_be_compared(tmp_path, monkeypatch):
    monkeypatch.setenv("FSN_MASTER", program())
    parts: list[str] = []
    done = bench(BenchPlan(cycle_ns=2_000_000, seconds=0.3), NoBus(), parts.append)
    path = write(tmp_path / "a.json", done.to_json())
    row = json.loads(Path(path).read_text("utf-8"))
    Draft202012Validator(SCHEMA).validate(row)
    assert read_result(path) == done
    assert len(parts) == 5
    in_memory = {name.value for name in Measured if not name.startswith("wire_")}
    assert (set(row["times"]), "wire" in row) == (in_memory, False)
    assert row["times"]["empty_timer"]["count"] == 150
    assert row["times"]["cycle_wake_up"]["count"] > 0
    assert row["emulated_per_s"] > 0
    for times in row["times"].values():
        assert times["p50_ns"] <= times["p99_ns"] <= times["p999_ns"] <= times["max_ns"]
    text = document_text(bench_document(done))
    assert "Not measured: frames on a wire" in text
    assert "empty timer, wake-up late" in text
    assert "not a safety statement" in text
    same = fsn("bench", "--compare", path, path)
    assert (same.returncode, same.stderr) == (0, "")
    assert "Compare with care" not in same.stdout


@pytest.mark.parametrize(
    ("words", "refused"),
    [
        (("/usr/bin/fsn-master", "cell.fsnplan", "--interface", "eth1"), True),
        (("fsn-master", "cell.fsnplan", "--bus", "emulated"), False),
    ],
)
def test_a_machine_that_drives_a_bus_is_not_measured(words, refused, tmp_path):
    process = tmp_path / "proc" / "77"
    process.mkdir(parents=True)
    (process / "comm").write_text("fsn-master\n", "utf-8")
    (process / "cmdline").write_text("\0".join([*words, ""]), "utf-8")
    host = Host(tmp_path)
    assert host.processes("fsn-master") == [77]
    if not refused:
        refuse_beside_a_bus(host)
        return
    with pytest.raises(EnvironmentFault, match="process 77"):
        refuse_beside_a_bus(host)


def test_percentiles_are_those_of_numpy():
    rng = random.Random(4)
    for count in (1, 2, 999, 1000, 1001, 7777):
        samples = [rng.randrange(10**9) for _ in range(count)]
        times = Times.of_samples(samples)
        expected = np.quantile(samples, [0.5, 0.99, 0.999, 1], method="inverted_cdf")
        assert [times.p50_ns, times.p99_ns, times.p999_ns, times.max_ns] == list(expected)


def test_a_comparison_has_the_factor_of_the_second(tmp_path):
    slow = {"count": 10, "p50_ns": 3000, "p99_ns": 2000, "p999_ns": 7500, "max_ns": 2000}
    other = result(times={"empty_timer": slow, "cycle_wake_up": slow})
    first, second = write(tmp_path / "a.json", result()), write(tmp_path / "b.json", other)
    done = fsn("bench", "--compare", first, second)
    (line,) = [x for x in done.stdout.splitlines() if x.startswith("empty timer")]
    assert line.split()[-9:] == ["1.0", "3.0", "3.00", "3.0", "7.5", "2.50", "4.0", "2.0", "0.50"]


def test_a_busy_machine_and_another_cycle_are_named(tmp_path):
    busy = result(cycle_ns=500_000, host=result()["host"] | {"others_share": 0.6})
    first, second = write(tmp_path / "a.json", result()), write(tmp_path / "b.json", busy)
    page = tmp_path / "page.html"
    done = fsn("bench", "--compare", first, second, "-o", str(page))
    assert "B: busy: other processes used 60%" in done.stdout
    assert "A: busy" not in done.stdout
    assert "Compare with care: the cycles differ" in done.stdout
    assert "B: busy: other processes used 60%" in page.read_text("utf-8")


def test_a_name_in_a_result_is_escaped(tmp_path):
    hostile = result(host=result()["host"] | {"processor": "<script>\x1b[2J"})
    path = write(tmp_path / "a.json", hostile)
    page = tmp_path / "page.html"
    done = fsn("bench", "--compare", path, path, "-o", str(page))
    assert "\x1b" not in done.stdout
    assert "<script>" not in page.read_text("utf-8")


@pytest.mark.parametrize(
    ("row", "text"),
    [
        ([], "the document (type)"),
        ({}, "the document (required)"),
        (result(bench=2), "bench (const)"),
        (result(extra=1), "the document (additionalProperties)"),
        (result(times={"empty_timer": {}, "cycle_wake_up": {}}), "times.empty_timer (required)"),
        (result(cycle_ns="1"), "cycle_ns (type)"),
    ],
)
def test_another_file_is_rejected_with_its_place(row, text, tmp_path):
    path = write(tmp_path / "a.json", row)
    done = fsn("bench", "--compare", path, path)
    assert (done.returncode, done.stdout) == (1, "")
    assert text in done.stderr


def test_usage_errors(tmp_path):
    path = write(tmp_path / "a.json", result())
    for words, code, text in (
        (("-o", "x.txt"), 2, "name a file that ends in .html or .json"),
        (("--compare", path, path, "--cycle", "1ms"), 2, "--cycle does not go with --compare"),
        (("--duration", "1h", "--cycle", "50us"), 2, "more than 10 million cycles"),
        (("--wire", "--interface", "lo"), 2, "leave it or --interface out"),
        (("--interface", "lo"), 2, "needs a terminal to ask for confirmation"),
        (("--compare", path, path, "-o", path), 1, f"{path} exists"),
        (("--compare", path, "/nothere"), 1, "/nothere cannot be read"),
    ):
        done = fsn("bench", *words)
        assert (done.returncode, text in done.stderr) == (code, True), done.stderr
    done = fsn("bench", "--duration", "100ms", env=os.environ | {"FSN_MASTER": "/nothere"})
    assert (done.returncode, done.stdout) == (3, "")
    assert "FSN_MASTER=/nothere is not an executable program" in done.stderr


class Passing(Host):
    """A host whose processors work between two looks."""

    def __init__(self, *lines: str) -> None:
        super().__init__()
        self._lines = list(lines)

    def read(self, path: str) -> str:
        return self._lines.pop(0)


def test_the_share_of_others_counts_all_but_idle_and_waiting():
    # proc(5): user, nice, system, idle, iowait, irq, softirq, steal.
    host = Passing("cpu 0 0 0 0 0 0 0 0 0 0", "cpu 10 5 5 60 15 1 1 3 9 9")
    assert others_share(host, 0.0) == pytest.approx(0.25)
    assert others_share(Passing(*["cpu 1 1 1 1 1 1 1 1"] * 2), 0.0) == 0
    with pytest.raises(Unreadable):
        others_share(Passing("cpu x"), 0.0)
