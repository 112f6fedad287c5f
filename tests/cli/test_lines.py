"""Lines of commands for what hardly any file or bus brings about."""

from __future__ import annotations

import os
from dataclasses import replace
from types import SimpleNamespace as Facts
from typing import Any

import pytest
from click.testing import CliRunner

from fsoe_net.acceptance import verify
from fsoe_net.cli import decode_output, explain, monitor_output, write
from fsoe_net.compare.diff_types import Change, ChangeArea, ChangeKind
from fsoe_net.core.scan import FoundConnection, FoundPlace, ScanCounts
from fsoe_net.core.snapshot import DirectionSnapshot
from fsoe_net.diag.diagnostic import Diagnostic, Edit, Span
from fsoe_net.document.write_terminal import document_text
from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.live.attachment import BusView
from fsoe_net.project import fix

MS = 1_000_000
COUNTS = ScanCounts(packets=0, ethercat=0, malformed=0, datagrams=0, unanswered=0, dropped=0)
WAY = DirectionSnapshot(
    command=0x36, connection_id=5, reset_code=0, frames=2, process_data=0, failsafe_data=0,
    right=0, wrong=0, unchecked=2, resets=0, last_new_ns=1, interval_last_ns=0, interval_min_ns=0,
    interval_max_ns=0, interval_sum_ns=0, intervals=0,
)  # fmt: skip
RESET = replace(
    WAY, right=7, wrong=1, frames=8, unchecked=0, resets=2, reset_code=5,
    interval_min_ns=3 * MS, interval_max_ns=9 * MS, interval_sum_ns=20 * MS, intervals=5,
)  # fmt: skip


@pytest.mark.parametrize(
    ("counts", "text"),
    [
        ({}, "the capture is empty"),
        (
            {"packets": 1},
            "none of its 1 packet is EtherCAT (0x88A4, or UDP port 34980)",
        ),
        (
            {"packets": 5, "ethercat": 3, "unanswered": 3},
            "all 3 process data datagrams have working counter 0: captured on the way out only, or "
            "no SubDevice was there",
        ),
        (
            {"packets": 5, "ethercat": 3, "datagrams": 1},
            "3 EtherCAT frames with 1 answered process data datagrams were looked at",
        ),
    ],
)
def test_why_no_connection_was_found(counts: dict[str, int], text: str):
    assert decode_output._none_text(replace(COUNTS, **counts)) == text


def found(**changes: Any) -> FoundConnection:
    places = (
        FoundPlace(command="FPWR", address=0x1100_03E9, direction=0, size_bytes=6),
        FoundPlace(command="LRW", address=0x40, direction=1, size_bytes=7),
    )
    connection = FoundConnection(
        connection_id=5, places=places, roles_certain=False, state=ConnectionState.DATA_PROCESS,
        gaps=0, to_sub=WAY, to_main=WAY,
    )  # fmt: skip
    return replace(connection, **changes)


@pytest.mark.parametrize(
    ("connection", "lines"),
    [
        (
            found(),
            """\
#1: ConnID 5, now data process
  main > sub  2 frames: 0 right, 0 wrong, 2 unchecked
  sub > main  2 frames: 0 right, 0 wrong, 2 unchecked
  main > sub  at FPWR station 0x03e9 offset 0x1100, 6 bytes with 1 safe byte
  sub > main  at LRW 0x00000040, 7 bytes with 2 safe bytes
  no CRC could be checked: too few frames of both ends in a row
  main and sub are distinguished by their numbers; no start-up was seen""",
        ),
        (
            found(roles_certain=True, places=(), to_sub=RESET, gaps=1),
            """\
#1: ConnID 5, now data process
  main > sub  8 frames: 7 right, 1 wrong, 0 unchecked; every 3.000 … 4.000 … 9.000 ms; 2 resets, \
last 5: watchdog expired
  sub > main  2 frames: 0 right, 0 wrong, 2 unchecked
  1 gap: the capture does not hold every frame""",
        ),
    ],
)
def test_a_connection_of_a_capture(connection: FoundConnection, lines: str):
    assert "\n".join(decode_output._connection_lines(1, connection, None, False)) == lines


def test_missing_parts_of_a_capture_are_named(capsys: pytest.CaptureFixture[str]):
    out = decode_output.TextOutput()
    out.begin("x.pcap")
    counts = replace(COUNTS, malformed=2, dropped=3)
    out.found([], counts, decode_output.CaptureFacts(-1, cut=4, other_links=5))
    assert capsys.readouterr().out.splitlines()[1:] == [
        "4 packets were captured in part only: capture with -s 0",
        "5 packets of interfaces that are not Ethernet left out",
        "2 EtherCAT frames with datagrams that do not fit",
        "3 datagrams or places were not looked at: too many at once",
    ]


def test_texts_of_frames_are_forgotten_when_they_are_too_many(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(decode_output, "_MOST_PARTS", 2)
    built = []

    def build(row: Any, data: bytes) -> tuple[str, str]:
        built.append(data)
        return "", ""

    parts = decode_output._Parts(build)
    for value in (1, 1, 2, 3, 1):  # the third one begins anew
        frame = bytes([0x36, value, 0, 0, 5, 0])
        parts.of((0, 0, None, 0, 0, frame, 0, 0, 0, 0))  # type: ignore[arg-type]
    assert built == [b"\1", b"\2", b"\3", b"\1"]


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (
            Change(
                kind=ChangeKind.MOVED, area=ChangeArea.ENTRIES, where="io 0x6000:01", after="bit 8"
            ),
            "~ entries io 0x6000:01 moved: bit 8",
        ),
        (
            Change(
                kind=ChangeKind.ADDED,
                area=ChangeArea.ENTRIES,
                where="io",
                entries=tuple("abcdefgh"),
            ),
            "+ entries io added: a, b, c, d, e, f and 2 more",
        ),
        (
            Change(
                kind=ChangeKind.CHANGED,
                area=ChangeArea.CONNECTION,
                where="a",
                what="net",
                before="",
                after=None,
            ),
            "~ connection a changed: net empty -> not stated",
        ),
    ],
)
def test_difference_is_printed_as_a_line(change: Change, line: str):
    assert str(change) == line


def test_long_sections_differ_in_a_few_lines():
    rows = [f"row {n}" for n in range(100)]

    def told(now: list[str], before: list[str] = rows) -> list[str]:
        return list(verify._changed_lines("copies", "\n".join(before), "\n".join(now)))

    assert told(rows) == []
    assert told([*rows[:50], *rows[51:]]) == ["copies - row 50"]
    many = told([f"line {n}" for n in range(100)])
    assert many[0] == "copies - row 0"
    left = 200 - verify._SHOWN_LINES
    assert many[-1] == f"copies: {left} more lines; `fsoe-net plan --canonical` prints them"
    assert told([f"x {n}" for n in range(20_000)]) == [
        "copies: 100 lines became 20000; `fsoe-net plan --canonical copies` prints them"
    ]


def test_a_file_that_may_not_be_written(monkeypatch: pytest.MonkeyPatch, tmp_path):
    monkeypatch.setattr(os, "access", lambda *_: False)
    path = tmp_path / "x"
    with pytest.raises(EnvironmentFault) as refused:
        write.check_target(str(path), overwrite=False)
    assert str(refused.value) == f"cannot write {path}: permission denied"


def test_a_code_without_a_page(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(explain, "page_text", lambda _: None)
    done = CliRunner().invoke(explain.command, ["FSN101"])
    assert done.output == "FSN101 (error): file cannot be read\n"


def test_a_file_that_goes_while_a_fix_is_asked_for():
    with pytest.raises(InputError) as refused:
        fix.read_unchanged("/no/such/file", "", next_step="")
    assert refused.value.message == "nothing written: /no/such/file cannot be read again"


def test_a_finding_is_fixed_as_a_whole_or_not_at_all():
    """The second edit of the first finding has no place: then its first one is not made either."""
    here, nowhere = Span("n.yaml", 1, 4), Span("n.yaml", 9, 9)
    edits = tuple(Edit(span=s, key=k, text="3") for s, k in ((here, "a"), (nowhere, "b")))
    found = [Diagnostic(code="FSN109", span=here, message="", edits=edits)]
    assert fix._patched(b"a: 1\nb: 2\n", "n.yaml", found) == (b"a: 1\nb: 2\n", frozenset())


VIEW = BusView(
    refused="",
    away="", status=None, connections=(), snapshot=None, current=False, now_s=1.5, events=(),
    events_lost=0,
)  # fmt: skip


def shown(view: BusView) -> str:
    return document_text(monitor_output.bus_document(view))


def test_a_monitor_of_which_nothing_is_known():
    assert shown(VIEW) == "1.5 s\n\nnothing is known yet\n"
    assert shown(replace(VIEW, away="gone")) == ("1.5 s\n\nfsn-master does not answer: gone\n")


@pytest.mark.parametrize(
    ("recorder", "text"),
    [
        (
            Facts(rebuilt="", packets=0, skipped=0, fault=""),
            "x.pcapng: 0 frames, from the wire; is fsn-master in another network namespace? "
            "--rebuild needs none",
        ),
        (
            Facts(rebuilt="no socket", packets=1, skipped=2, fault="disk full"),
            "x.pcapng: 1 frame, rebuilt: no socket, 2 missed; it ended early: disk full",
        ),
        (Facts(rebuilt="why", packets=0, skipped=0, fault=""), "x.pcapng: 0 frames, rebuilt: why"),
    ],
)
def test_captured_values(recorder: Facts, text: str):
    assert monitor_output.capture_text(recorder, "x.pcapng") == text
