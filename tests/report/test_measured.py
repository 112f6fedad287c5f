"""The bus cycle as measured, in the block on timing: percentiles worked by hand."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from report.made import TIMED, inputs_of

from fsoe_net.core.snapshot import Histogram, bucket_end
from fsoe_net.document.model import (
    Number,
    Table,
)
from fsoe_net.errors import InputError
from fsoe_net.model.network import SourceFile
from fsoe_net.report.compose import compose_report
from fsoe_net.report.evidence import Evidence, RunEvidence, read_evidence
from fsoe_net.report.measured_cycle import measured_cycle

# Buckets are a 64th of their octave wide: 999 424 … 1 007 615 ns holds 1 ms, the next one ends at
# 1 015 807 ns; 4 980 736 … 5 046 271 ns holds 5 ms.
COMMON, LATE, LATEST = 999_424, 1_007_616, 4_980_736


def histogram(common: int, late: int, latest: int) -> Histogram:
    rows = ((COMMON, common), (LATE, late), (LATEST, latest))
    return Histogram(
        count=common + late + latest, min_ns=999_500,
        sum_ns=1_000_001 * (common + late + latest), p50_ns=1_007_615,
        p99_ns=1_007_615, p999_ns=1_007_615, max_ns=5_000_000,
        buckets=tuple(row for row in rows if row[1]),
    )  # fmt: skip


def run(period: Histogram | None, backend: str = "soem") -> Evidence:
    found = RunEvidence(
        mode="live", backend=backend, plan_sha256="00", duration_ms=1.0, passed=True, cycles=1,
        overruns=0, wkc_errors=0, period=period, rows=(),
    )  # fmt: skip
    return Evidence(source=SourceFile(path="run.json", sha256="00"), run=found)


def measured(*evidence: Evidence, live: object = None) -> list[tuple[Any, ...]]:
    inputs: Any = SimpleNamespace(evidence=evidence, live=live)
    return [row for p in measured_cycle(inputs) if isinstance(p, Table) for row in p.rows]


@pytest.mark.parametrize(
    ("period", "share"),
    [
        # 199 998 of 200 000: one more than the first bucket has
        (histogram(199_997, 2, 1), 1_015_807),
        (histogram(199_998, 1, 1), 1_007_615),
        # the smallest number that has one: the 99 999th of 100 000
        (histogram(99_998, 0, 2), 5_000_000),
        (histogram(99_999, 0, 1), 1_007_615),
    ],
)
def test_the_highest_percentile_is_the_upper_end_of_its_bucket(
    period: Histogram, share: int
) -> None:
    (row,) = measured(run(period))
    numbers = [cell[0] for cell in row[1:]]
    assert all(isinstance(n, Number) for n in numbers)
    values = [n.value for n in numbers]
    assert values[:3] == [period.count, 0.9995, 1.000001]
    assert values[3:] == [1.007615, 1.007615, share / 1e6, 5.0]
    assert [n.unit for n in numbers] == ["cycles", *["ms"] * 6]
    assert numbers[5].source == "run.json, upper end of a histogram bucket"
    assert numbers[6].source == "run.json"


def test_fewer_than_100_000_cycles_have_no_such_percentile() -> None:
    (row,) = measured(run(histogram(99_998, 0, 1)))
    assert row[6][0].text == "not stated: fewer than 100 000 cycles"
    assert row[5][0].value == 1.007615
    (row,) = measured(run(histogram(98, 0, 1)))
    words = [f"not stated: fewer than {n} cycles" for n in ("100", "1 000", "100 000")]
    assert [cell[0].text for cell in row[4:7]] == words


@pytest.mark.shows("R13")
def test_an_emulated_run_is_marked_and_a_running_bus_counts() -> None:
    period = dataclasses.replace(histogram(100_000, 0, 0), max_ns=1_000_100)
    cycle = SimpleNamespace(statistics=SimpleNamespace(period=period))
    live = SimpleNamespace(
        socket="/run/fsn.sock",
        status=SimpleNamespace(backend="soem"),
        snapshot=SimpleNamespace(cycle=cycle),
    )
    emulated, running = measured(run(histogram(9, 0, 0), "emulated"), live=live)
    assert "EMULATED" in emulated[0][1].word
    assert (running[0][0].text, len(running[0])) == ("/run/fsn.sock", 1)
    # The end of the bucket is above the greatest time that was seen.
    assert running[6][0].value == 1.0001


@pytest.mark.shows("R13")
def test_a_recorded_run_counts_for_the_machine_unless_it_was_emulated() -> None:
    for backend, of_machine in (("emulated", False), ("soem", True)):
        evidence = run(histogram(100_000, 0, 0), backend)
        document = compose_report(inputs_of(TIMED, evidence=(evidence,)))
        assert document.of_machine is of_machine
        missing = [p for p in document.points if "no evidence of the machine" in p[1].text]
        assert bool(missing) is not of_machine
    assert not compose_report(inputs_of(TIMED)).of_machine


def test_the_block_on_timing_has_it_or_states_that_nothing_was_measured() -> None:
    for evidence, words in (
        (run(histogram(100_000, 0, 0)), "upper end of the histogram bucket"),
        (run(None), "Not measured: no run in real time"),
    ):
        document = compose_report(inputs_of(TIMED, evidence=(evidence,)))
        (block,) = [b for b in document.sections if b.key == "timing"]
        assert words in repr(block)


@pytest.mark.parametrize(
    ("floor", "end"),
    [(0, 1), (63, 64), (64, 65), (127, 128), (128, 130), (254, 256), (COMMON, LATE)],
)
def test_a_bucket_is_a_64th_of_its_octave(floor: int, end: int) -> None:
    assert bucket_end(floor) == end


@pytest.mark.parametrize(
    "wrong",
    [
        {"buckets": [[COMMON, 4]]},
        {"buckets": [[LATE, 4], [COMMON, 1]]},
        {"buckets": 3},
        {"p50_ns": 1_048_575},  # its buckets were wider
        {"max_ns": None},
    ],
)
def test_a_histogram_that_cannot_be_is_refused(tmp_path: Path, wrong: dict[str, Any]) -> None:
    row = histogram(4, 1, 0).to_json()
    document = {
        "mode": "live", "plan_sha256": "00", "duration_ms": 1, "result": "pass", "connections": [],
        "statistics": {"cycles": 5, "overruns": 0, "wkc_errors": 0, "period": row},
    }  # fmt: skip
    path = tmp_path / "run.json"
    path.write_text(json.dumps(document))
    found = read_evidence(str(path)).run
    assert found is not None
    assert found.period == histogram(4, 1, 0)
    row.update(wrong)
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match="is not a complete result of a run"):
        read_evidence(str(path))
