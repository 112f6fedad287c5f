"""Each reason of health has a rule and a text, and every program reports the same level for it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from types import SimpleNamespace as Facts
from typing import Any

import pytest

from fsoe_net.cli.monitor_output import bus_document
from fsoe_net.cli.run_output import _live_view
from fsoe_net.core.bus_documents import Found
from fsoe_net.document.model import Level, Paragraph, Table, Verdict
from fsoe_net.document.write_terminal import document_text
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.fsoe.parameters import FsoeParameters
from fsoe_net.live.attachment import Attachment, BusView
from fsoe_net.live.console.commands_bus import BUS_COMMANDS
from fsoe_net.live.control_values import BusState, ClocksStatus, GroupStatus, LogStatus, RingStatus
from fsoe_net.live.health import (
    HOLD_S,
    TEXTS,
    Health,
    HealthLevel,
    HealthReason,
    RecentChanges,
    health_texts,
    in_operation,
)
from fsoe_net.live.result import RunUpdate
from fsoe_net.report.evidence import LiveEvidence
from fsoe_net.report.section_evidence import bus_evidence
from fsoe_net.ros2.diagnostics import ros_statuses
from fsoe_net.studio.live_master import _view
from fsoe_net.testing.fake_master import FakeMaster

BUS, DEVICE, LINK = "bus", "drive_1", "c1"
GOOD, UNKNOWN, WARNING, ERROR = HealthLevel
R = HealthReason
Change = Callable[[BusView], BusView]


@pytest.fixture(scope="module")
def healthy() -> Iterator[BusView]:
    """A bus with one connection, between a logic that no row describes and one SubDevice."""
    with FakeMaster() as master, Attachment(master.path) as attachment:
        view = attachment.look(0.0)
        assert view.status is not None
        yield replace(view, status=replace(view.status, planned=1, in_op=1))


def _status(**values: Any) -> Change:
    return lambda view: replace(view, status=replace(view.status, **values))  # type: ignore[type-var]


def _view_of(**values: Any) -> Change:
    return lambda view: replace(view, **values)


def _changed(name: str, reason: HealthReason) -> Change:
    return lambda view: replace(view, changes=frozenset({(name, reason)}))


def _statistics(**values: Any) -> Change:
    def change(view: BusView) -> BusView:
        assert view.snapshot is not None
        cycle = view.snapshot.cycle
        cycle = replace(cycle, statistics=replace(cycle.statistics, **values))
        return replace(view, snapshot=replace(view.snapshot, cycle=cycle))

    return change


def _device(**values: Any) -> Change:
    def change(view: BusView) -> BusView:
        assert view.snapshot is not None
        (seen,) = view.snapshot.subdevices
        rows = (replace(seen, **values),)
        return replace(view, snapshot=replace(view.snapshot, subdevices=rows))

    return change


def _link(
    state: ConnectionState = ConnectionState.DATA_PROCESS,
    *,
    longest_ms: int = 1,
    differs: tuple[str, ...] = (),
) -> Change:
    """Change the connection in both forms: as it is in a snapshot, and in a result."""
    parameters = {
        "configured": FsoeParameters(watchdog_ms=100),
        "observed": FsoeParameters(watchdog_ms=200),
        "differs": differs,
    }

    def change(view: BusView) -> BusView:
        assert view.snapshot is not None
        (wire,), (row,) = view.snapshot.cycle.connections, view.connections
        to_sub = replace(wire.to_sub, interval_max_ns=longest_ms * 1_000_000)
        wire = replace(wire, state=state, to_sub=to_sub, **parameters)
        cycle_ms = {**row.result.fsoe_cycle_ms, "max": float(longest_ms)}
        result = replace(
            row.result,
            state=state,
            watchdog_ms=100,
            fsoe_cycle_ms=cycle_ms,
            **parameters,
        )
        cycle = replace(view.snapshot.cycle, connections=(wire,))
        return replace(
            view,
            snapshot=replace(view.snapshot, cycle=cycle),
            connections=(replace(row, result=result, watchdog_share=longest_ms / 100),),
        )

    return change


def _clocks(state: str) -> Change:
    numbers = dict.fromkeys(
        ("subdevices", "outside", "leaves", "window_ns", "worst_ns", "shift_ns", "lead_ns"), 0
    )
    return _status(
        clocks=ClocksStatus(state=state, set_by="bus", reference="a", place="", **numbers)
    )


@dataclass(frozen=True)
class Case:
    """A made-up bus: the subject of a reason, how it comes about, and the level of the subject.

    ``asked``: whether one question shows it, so that programs without a memory report it.
    """

    subject: str
    change: Change
    level: HealthLevel
    asked: bool = True


RING = RingStatus(state="open", ways=(True, False), breaks=1, place="after a")
GROUP = GroupStatus(name="tools", place="", state="wrong", detail="another tool")
CASES = {
    R.NOT_CURRENT: Case(DEVICE, _view_of(current=False), UNKNOWN, asked=False),
    R.END_ABSENT: Case(LINK, _device(al="none", found=Found.ABSENT), GOOD),
    R.NOT_IN_DATA: Case(LINK, _link(ConnectionState.PARAMETER), ERROR),
    R.FAILSAFE_DATA: Case(LINK, _link(ConnectionState.DATA_FAILSAFE), WARNING),
    R.END_NOT_IN_OP: Case(LINK, _device(al="SAFEOP"), ERROR),
    R.RESET: Case(LINK, _changed(LINK, R.RESET), ERROR, asked=False),
    R.OTHER_PARAMETERS: Case(LINK, _link(differs=("watchdog_ms",)), ERROR),
    R.WATCHDOG_RESERVE: Case(LINK, _link(longest_ms=84), WARNING),
    R.NOT_READ: Case(DEVICE, _device(known=False, al="none"), UNKNOWN),
    R.ABSENT: Case(DEVICE, _device(al="none", found=Found.ABSENT), GOOD),
    R.NOT_IN_OP: Case(DEVICE, _device(al="SAFEOP+ERROR", al_code=0x1B), ERROR),
    R.DEFECT: Case(DEVICE, _device(detail="port 1 is open"), WARNING),
    R.RETURNED: Case(DEVICE, _changed(DEVICE, R.RETURNED), WARNING, asked=False),
    R.LINK_LOST: Case(DEVICE, _changed(DEVICE, R.LINK_LOST), WARNING, asked=False),
    R.RECEIVE_ERRORS: Case(DEVICE, _changed(DEVICE, R.RECEIVE_ERRORS), WARNING, asked=False),
    R.NOTHING_KNOWN: Case(
        BUS, _view_of(status=None, snapshot=None, connections=()), UNKNOWN, asked=False
    ),
    R.MASTER_GONE: Case(BUS, _view_of(away="no reply", current=False), ERROR, asked=False),
    R.BUS_FAILED: Case(BUS, _status(state=BusState.FAILED, fault="no link"), ERROR),
    R.SNAPSHOT_REFUSED: Case(BUS, _view_of(refused="too large", current=False), ERROR, asked=False),
    R.BUS_STOPPED: Case(
        BUS, lambda v: _status(state=BusState.STOPPED)(replace(v, current=False)), WARNING
    ),
    R.WKC_INCOMPLETE: Case(BUS, _statistics(expected_wkc=9, actual_wkc=6), ERROR),
    R.RING_OPEN: Case(BUS, _status(ring=RING), WARNING),
    R.CLOCKS_APART: Case(BUS, _clocks("apart"), WARNING),
    R.CLOCKS_WITHOUT_REFERENCE: Case(BUS, _clocks("no reference"), WARNING),
    R.GROUP_WRONG: Case(BUS, _status(groups=(GROUP,)), ERROR),
    R.LOG_NOT_WRITTEN: Case(
        BUS, _status(interventions=LogStatus(entry=1, sha256="", fault="disk full")), WARNING
    ),
    R.OVERRUNS: Case(BUS, _changed("", R.OVERRUNS), WARNING, asked=False),
    R.WKC_ERRORS: Case(BUS, _changed("", R.WKC_ERRORS), WARNING, asked=False),
    R.LOST_FRAMES: Case(BUS, _changed("", R.LOST_FRAMES), WARNING, asked=False),
}

# -- what each program reports --------------------------------------------------------------------

_SHOWN = {Level.CLEAR: GOOD, Level.OPEN: UNKNOWN, Level.WARNING: WARNING, Level.ERROR: ERROR}


def _worst(items: Any) -> HealthLevel:
    return max((_SHOWN[i.level] for i in items if isinstance(i, Verdict)), default=GOOD)


def _of_document(parts: Any, subject: str) -> HealthLevel:
    """Return the level of a table row or of the lines about a subject; other lines are the bus."""
    lines = [p for p in parts if isinstance(p, Paragraph)]
    if subject == LINK:
        tables = [p for p in parts if isinstance(p, Table)]
        (table,) = [t for t in tables if t.columns[0].title == "connection"]
        return _worst(table.rows[0][1])
    named = [i for p in lines for i in p.items if isinstance(i, Verdict)]
    if subject == DEVICE:
        return _worst(i for i in named if i.word.startswith(f"{DEVICE}: "))
    return _worst(i for i in named if not i.word.startswith((f"{DEVICE}: ", f"{LINK}: ")))


def monitor(view: BusView, subject: str) -> HealthLevel:
    return _of_document(bus_document(view).lead, subject)


def run(view: BusView, subject: str) -> HealthLevel | None:
    if subject == BUS or view.snapshot is None:
        return None
    update = RunUpdate(
        connections=tuple(c.result for c in view.connections),
        statistics=view.snapshot.cycle.statistics,
        now_s=1.0,
        subdevices=view.snapshot.subdevices,
    )
    return _of_document(_live_view("estop", update)._document.lead, subject)


def ros(view: BusView, subject: str) -> HealthLevel:
    name = {BUS: "bus", DEVICE: f"SubDevice {DEVICE}", LINK: f"connection {LINK}"}[subject]
    (level,) = [row.level.name for row in ros_statuses(view) if row.name == name]
    return {"OK": GOOD, "STALE": UNKNOWN, "WARN": WARNING, "ERROR": ERROR}[level]


def studio(view: BusView, subject: str) -> HealthLevel:
    rows: Any = _view("/run/s", view)
    row = {
        BUS: lambda: rows["bus"],
        DEVICE: lambda: rows["subdevices"][0],
        LINK: lambda: rows["connections"][0],
    }[subject]()
    return HealthLevel[row["level"].upper()]


def console(view: BusView, subject: str) -> HealthLevel:
    client = Facts(
        status=lambda: view.status,
        snapshot=lambda: view.snapshot,
        subdevices=lambda: view.snapshot.subdevices if view.snapshot else (),
    )
    if not view.current:
        client.snapshot = lambda: None
    lines: list[str] = []
    context: Any = Facts(link=Facts(call=lambda ask: ask(client)), out=lines.append)
    command, words = {BUS: ("state", []), DEVICE: ("state", ["all"]), LINK: ("connections", [])}[
        subject
    ]
    BUS_COMMANDS[command].do(context, words)
    own = [line for line in lines if subject == BUS or line.startswith(subject)]
    own = [line for line in own if subject != BUS or not line.startswith(DEVICE)]
    marks = [level for level in HealthLevel for line in own if f"{level.name.lower()}: " in line]
    return max(marks, default=GOOD)


def report(view: BusView, subject: str) -> HealthLevel | None:
    if subject == BUS or view.snapshot is None or view.status is None:
        return None
    live = LiveEvidence(socket="/run/s", status=view.status, snapshot=view.snapshot, names=(LINK,))
    section = bus_evidence(Facts(evidence=(), live=live, plan=None))  # type: ignore[arg-type]
    name = {LINK: "running bus", DEVICE: "running SubDevices"}[subject]
    (table,) = [p for p in section.parts if isinstance(p, Table) and p.name == name]
    return _worst(table.rows[0][1])


@pytest.mark.parametrize("program", [monitor, ros, studio, console, report, run])
@pytest.mark.parametrize("reason", HealthReason, ids=lambda r: r.key)
def test_every_program_reports_the_same_level(
    healthy: BusView, reason: HealthReason, program: Callable[[BusView, str], HealthLevel | None]
) -> None:
    case = CASES[reason]
    assert program(healthy, case.subject) in (GOOD, None)
    expected = case.level
    if case.subject == DEVICE and expected is UNKNOWN and program in (monitor, run):
        expected = GOOD  # below the table are only the SubDevices that are not well
    if case.asked or program in (monitor, ros, studio):
        assert program(case.change(healthy), case.subject) in (expected, None)


@pytest.mark.parametrize("reason", HealthReason, ids=lambda r: r.key)
def test_a_reason_is_reached_and_has_a_text(healthy: BusView, reason: HealthReason) -> None:
    case = CASES[reason]
    assert _health(healthy, case.subject).reasons == ()
    health = _health(case.change(healthy), case.subject)
    assert health.reasons == (reason,)
    assert reason.level is health.level is case.level
    (text,) = health_texts(health)
    assert text.strip()
    assert "{" not in text
    assert len(TEXTS) == len(HealthReason)


def _health(view: BusView, subject: str) -> Health:
    report = view.health
    return {
        BUS: lambda: report.bus,
        DEVICE: lambda: report.subdevices[0],
        LINK: lambda: report.connections[0],
    }[subject]()


@pytest.mark.parametrize(("longest_ms", "level"), [(83, GOOD), (84, WARNING)])
def test_the_reserve_is_a_fifth_of_the_round_trip(
    healthy: BusView, longest_ms: int, level: HealthLevel
) -> None:
    """1.2 times the longest FSoE cycle must fit into the watchdog: 83 ms do into 100 ms."""
    assert _link(longest_ms=longest_ms)(healthy).health.connections[0].level is level


def test_values_of_an_earlier_moment_have_no_level(healthy: BusView) -> None:
    view = replace(_link(ConnectionState.RESET)(healthy), current=False)
    health = view.health.connections[0]
    assert health.reasons == (R.NOT_CURRENT, R.NOT_IN_DATA)
    assert health.level is UNKNOWN


def test_a_bus_is_in_operation_in_spite_of_warnings(healthy: BusView) -> None:
    for reason, case in CASES.items():
        if case.subject != BUS:
            rows = case.change(healthy).health
            stops = reason in (R.NOT_CURRENT, R.NOT_IN_DATA, R.END_NOT_IN_OP, R.NOT_IN_OP)
            assert in_operation((*rows.subdevices, *rows.connections)) is not stops, reason


@pytest.mark.parametrize(
    ("subject", "reason", "change"),
    [
        (BUS, R.OVERRUNS, _statistics(overruns=1)),
        (BUS, R.WKC_ERRORS, _statistics(wkc_errors=1)),
        (BUS, R.LOST_FRAMES, _statistics(lost_frames=1)),
        (DEVICE, R.RETURNED, _device(returns=1)),
        (DEVICE, R.LINK_LOST, _device(link_lost=(0, 1))),
        (DEVICE, R.RECEIVE_ERRORS, _device(rx_errors=(1, 0))),
    ],
)
def test_a_counter_that_rose_is_a_reason_for_a_time(
    healthy: BusView, subject: str, reason: HealthReason, change: Change
) -> None:
    recent = RecentChanges()
    before, after = healthy.snapshot, change(healthy).snapshot
    assert before is not None
    assert after is not None
    key = ("" if subject == BUS else subject, reason)
    assert recent.take(before, 0.0) == frozenset()
    assert recent.take(after, 1.0) == {key}
    assert recent.take(after, 1.0 + HOLD_S * 0.99) == {key}
    assert recent.take(after, 1.0 + HOLD_S) == frozenset()
    assert recent.take(before, 20.0) == frozenset()  # the bus was opened again


def test_the_monitor_names_reasons_that_no_column_shows(healthy: BusView) -> None:
    text = document_text(bus_document(_changed(LINK, R.RESET)(healthy)))
    assert "c1: Reset in the last 5 s" in text
    text = document_text(bus_document(_device(al="none", found=Found.ABSENT)(healthy)))
    assert re.search(r"^c1 +absent ", text, re.M)
