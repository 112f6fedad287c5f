"""`fsoe-net report --test-record`: what people wrote is taken, or they are told where it is not."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from cli.tool import fsn

TIMED = str(Path(__file__).parents[1] / "diagnostics" / "base" / "timed.yaml")


@pytest.fixture(name="text", scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("test_record") / "test-record.yaml"
    assert fsn("test-record", TIMED, "-o", str(path)).returncode == 0
    return path.read_text("utf-8")


@pytest.mark.parametrize(
    ("pattern", "put", "told", "code"),
    [
        ("result: ''", "result: as expectd", "as expectd", 2),
        ("measured_ms: ''", "measured_ms: fast", "such as 61.5", 2),
        ("date: ''", "date: 21.11.26", "such as 2026-11-21", 2),
        ("result: ''", "result: as expected", "stays open: by and date not filled in", 0),
        ("- id: loss io2", "- id: loss io9", "step loss io2 of these files is missing", 1),
        ("limit_ms: 300.0", "limit_ms: 999", "limit_ms is not what these files give", 1),
        ("fingerprint: ....", "fingerprint: 0000", "made for another configuration", 1),
    ],
)
def test_mistakes_are_located_and_are_in_the_report(
    text: str, pattern: str, put: str, told: str, code: int, tmp_path: Path
) -> None:
    path, report = tmp_path / "test-record.yaml", tmp_path / "report.json"
    path.write_text(re.sub(pattern, put, text, count=1), "utf-8")
    done = fsn("report", TIMED, "--test-record", str(path), "-o", str(report))
    assert "Traceback" not in done.stderr
    assert told in done.stderr
    assert re.search(r"test-record\.yaml:\d+:\d+: (error|warning)", done.stderr)
    assert "hint: " in done.stderr
    if code == 2:  # cannot be read at all
        assert done.returncode == 1
        assert not report.exists()
        return
    assert done.returncode == code
    assert ("CANNOT BE TAKEN" in done.stdout) == bool(code)
    points = json.loads(report.read_text("utf-8"))["points"]
    assert any(told in p["text"] for p in points if p["block"] == "Tests")
