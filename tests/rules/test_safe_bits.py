"""FSN615 and FSN616: safe bits in no frame, and names that contradict each other."""

from __future__ import annotations

from pathlib import Path

import pytest
from changed import figures
from report.made import BASE, TIMED

from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.project.check import check_files

OUTPUT = "{kind: output, sub: io2, "
INPUT = "{kind: input, sub: io, "
SECOND = """\
  - name: second
    elements:
      - {kind: input, sub: io, %s time_ms: 1, source: sheet}
      - {kind: logic, sub: logic}
"""


def bits(*rows: str) -> str:
    return f"bits: [{', '.join(f'{{{row}}}' for row in rows)}], "


def found(folder: Path, *edits: tuple[str, str], more: str = "") -> list[Diagnostic]:
    text = TIMED.read_text("utf-8").replace("devices/", f"{BASE}/devices/")
    for old, new in edits:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = folder / "timed.yaml"
    path.write_text(text + more, "utf-8")
    return list(check_files([str(path)]).diagnostics)


def rows(diagnostics: list[Diagnostic]) -> list[tuple[str, str]]:
    """Return code and figures of each finding about safe bits."""
    return [(d.code, figures(d.message)) for d in diagnostics if d.code in ("FSN615", "FSN616")]


def test_right_bits_are_not_finding(tmp_path: Path) -> None:
    pair = bits("bit: 0, name: ES1 A", "bit: 1, name: ES1 B")
    same = SECOND % "bits: [{slot: 0, bit: 0, name: ES1 A}],"
    edits = (INPUT, INPUT + pair), (OUTPUT, OUTPUT + bits("bit: 7, name: K1"))
    assert rows(found(tmp_path, *edits, more=same)) == []


@pytest.mark.parametrize(
    ("edits", "shown"),
    [
        ([(OUTPUT, OUTPUT + bits("bit: 8, name: K1"))], "K1 8 8 logic-io2"),
        ([(OUTPUT, OUTPUT + bits("bit: 0, name: K1, slot: 1"))], "K1 1 io2 0"),
        ([("{kind: actuator, ", "{kind: actuator, " + bits("bit: 0, name: K1"))], "K1"),
        ([(OUTPUT, "{kind: output, name: relay, " + bits("bit: 0, name: K1"))], ""),
        ([(OUTPUT, "{kind: output, sub: logic, " + bits("bit: 0, name: K1"))], ""),
        (
            [
                ("{kind: logic, sub: logic,", "{kind: logic, sub: io2,"),
                (INPUT, INPUT + bits("bit: 0, name: A")),
            ],
            "",
        ),
        (
            [
                ("{kind: logic, sub: logic,", "{kind: logic,"),
                (INPUT, "{kind: input, sub: logic, " + bits("bit: 0, name: A")),
            ],
            "0 1",
        ),
    ],
)
def test_a_bit_in_no_frame_is_named(
    tmp_path: Path, edits: list[tuple[str, str]], shown: str
) -> None:
    assert rows(found(tmp_path, *edits)) == [("FSN615", shown)]


def test_bits_are_not_judged_while_an_error_leaves_connections_out(tmp_path: Path) -> None:
    edits = [
        (OUTPUT, OUTPUT + bits("bit: 0, name: K1")),
        ("in: {ec_module: io2, index: 0x6000", "in: {ec_module: io2, index: 0x6003"),
    ]
    diagnostics = found(tmp_path, *edits)
    assert [d.code for d in diagnostics] == ["FSN202"]
    assert rows(diagnostics) == []


def test_bits_of_an_unknown_subdevice_are_not_judged(tmp_path: Path) -> None:
    edits = [(OUTPUT, "{kind: output, sub: io9, " + bits("bit: 99, name: K1"))]
    diagnostics = found(tmp_path, *edits)
    assert "FSN605" in [d.code for d in diagnostics]
    assert rows(diagnostics) == []


@pytest.mark.parametrize(
    ("first", "second", "shown"),
    [
        (
            ["bit: 0, name: A", "bit: 0, name: A"],
            [],
            "0",
        ),
        (
            ["bit: 0, name: A"],
            ["bit: 0, name: B"],
            "0",
        ),
        (
            ["bit: 0, name: A"],
            ["bit: 1, name: A"],
            "0 1",
        ),
        (
            ["bit: 2, name: A", "bit: 0, name: A"],
            [],
            "0 2",
        ),
    ],
)
def test_contradictions_within_a_frame(
    tmp_path: Path, first: list[str], second: list[str], shown: str
) -> None:
    more = SECOND % (bits(*second) if second else "")
    edit = (INPUT, INPUT + bits(*first))
    assert rows(found(tmp_path, edit, more=more)) == [("FSN616", shown)]


def test_a_name_may_be_in_two_frames(tmp_path: Path) -> None:
    edits = [
        (INPUT, INPUT + bits("bit: 1, name: K1")),  # its feedback
        (OUTPUT, OUTPUT + bits("bit: 0, name: K1")),
    ]
    assert rows(found(tmp_path, *edits)) == []
