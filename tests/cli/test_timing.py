"""`fsoe-net timing`: what it prints, what it refuses, its exit codes."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from cli.tool import fsn
from networks import PLAIN

TIMED = Path(__file__).parents[1] / "diagnostics" / "base" / "timed.yaml"


def test_the_budget_as_text() -> None:
    done = fsn("timing", str(TIMED))
    assert done.returncode == 0
    assert "bus cycle 1 ms, 2 bus cycles per direction, clocks exact" in done.stdout
    assert "worst case, two watchdogs       220.0 ms  Beckhoff" in done.stdout
    assert "both late, then lost            460.0 ms  FSoE handshake counted; not" in done.stdout
    assert "greatest: printed  handshake counted" in done.stdout
    assert "19.2 ms           180.0 ms           111.0 ms" in done.stdout
    assert "at most 109.0 ms: estop: 300 ms required, 82 ms besides" in done.stdout
    assert (
        "required 300.0 ms: within the required reaction time: at most 282 ms when logic-io2 is "
        "late up to its watchdog and then lost"
    ) in done.stdout
    assert "category, diagnostic coverage and common causes not assessed" in done.stdout


def test_every_number_of_the_text_is_in_the_document() -> None:
    document = json.loads(fsn("timing", str(TIMED), "--format", "json").stdout)
    one, two = document["connections"]
    assert (one["name"], one["least"]["ms"], one["greatest"]["ms"]) == ("logic-io", 19.2, 111.0)
    assert (one["greatest_printed"]["ms"], one["greatest_handshake"]["ms"]) == (180.0, 111.0)
    assert (one["judgement"], one["verdict"]) == ("within", "inside the interval")
    assert two["lost_cycles_survived"] == 85
    (function,) = document["functions"]
    assert function["times"]["worst_etg_ms"] == 168
    assert function["times"]["handshake_one_disturbed"] == [
        {"way": "input", "connection": "logic-io", "ms": 278.0},
        {"way": "output", "connection": "logic-io2", "ms": 282.0},
    ]
    assert function["times"]["decides"] == function["times"]["handshake_one_disturbed"][1]
    assert function["elements"][0]["time"] == {
        "value": 5.0,
        "unit": "ms",
        "source": "sheet of the maker",
        "unverified": False,
        "needs_reason": False,
    }
    assert function["elements"][4]["claim"] == {"pl": "d", "sil": None, "unverified": False}
    assert (function["elements"][4]["category"], function["elements"][4]["mission_years"]) == (
        "3",
        20,
    )
    (level,) = function["levels"]
    assert (level["required"], level["lowest"], level["by_sum_alone"]) == ("PL d", "PL d", "PL e")
    assert (level["weakest"], level["judgement"]) == (["ES1", "io", "logic", "io2", "K1"], "within")
    assert (function["judgement"], function["pfh"]["judgement"]) == ("within", "within")
    assert function["pfh"]["total"] == pytest.approx(2.439e-8)


def test_another_cycle_may_not_fit() -> None:
    done = fsn("timing", str(TIMED), "--cycle", "40ms", "--copy-cycles", "3")
    assert done.returncode == 1
    assert "EMPTY" in done.stdout
    assert "error[FSN603]" in done.stdout


def test_a_run_counts_where_it_was_slower(tmp_path: Path) -> None:
    run = tmp_path / "run.json"
    rows = [{"name": "logic-io", "fsoe_cycle_ms": {"max": 90.0}}]
    run.write_text(json.dumps({"connections": rows}))
    done = fsn("timing", str(TIMED), "--measured", str(run))
    assert "logic-io at least 108.0 ms: 1.2 x 90 ms round trip as measured" in done.stdout
    assert "warning[FSN602]" in done.stdout


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (("--cycle", "4"), "has no unit; write 4ms or 4us"),
        (("--drift", "50%"), "not a share up to 10%"),
        (("--copy-cycles", "0"), "copy-cycles"),
    ],
)
def test_wrong_options_are_usage(option: tuple[str, str], words: str) -> None:
    done = fsn("timing", str(TIMED), *option)
    assert done.returncode == 2
    assert words in done.stderr


def _row(most: str) -> str:
    rows = '{"connections": [{"name": "logic-io", "fsoe_cycle_ms": {"max": MOST}}]}'
    return rows.replace("MOST", most)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '{"connections": [{}]}',
        "[" * 100_000,
        *(_row(most) for most in ("NaN", "Infinity", "1e999", "-1", '"long"')),
    ],
)
def test_an_invalid_run_is_rejected(tmp_path: Path, text: str) -> None:
    path = tmp_path / "run.json"
    path.write_text(text)
    done = fsn("timing", str(TIMED), "--measured", str(path))
    assert done.returncode == 1
    assert "is not the result of a run" in done.stderr


def test_the_picture_has_a_curve_of_each_school(tmp_path: Path) -> None:
    path = tmp_path / "reaction.svg"
    assert fsn("timing", str(TIMED), "--plot", str(path)).returncode == 0
    root = ET.fromstring(path.read_text())
    svg = "{http://www.w3.org/2000/svg}"
    words = [t.text for t in root.iter(f"{svg}text")]
    for name in ("error-free", "ETG.5100, one failure", "Beckhoff, two watchdogs", "required"):
        assert words.count(name) == 2
    assert words.count("FSoE handshake, one late") == 2
    dashes = {p.get("stroke-dasharray") for p in root.iter(f"{svg}polyline")}
    assert len(dashes) == 5


def test_without_safety_functions_nothing_is_judged() -> None:
    example = PLAIN / "el6910" / "network.yaml"
    done = fsn("timing", str(example))
    assert done.returncode == 0
    assert "nothing is judged" in done.stdout
