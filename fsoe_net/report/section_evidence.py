"""Blocks 8 and 9: what the machine itself reports, and what was tried."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from fsoe_net.diag.words import counted
from fsoe_net.document.model import (
    BLANK,
    Cell,
    Column,
    Heading,
    Item,
    Level,
    Paragraph,
    Part,
    Table,
    Text,
    Verdict,
    cell,
    code,
    muted,
    stated,
    strong,
)
from fsoe_net.model.scan import Scan, ScannedSubDevice
from fsoe_net.report.evidence import Evidence, LiveEvidence, RunEvidence
from fsoe_net.report.inputs import ReportInputs, TestStep, Tried
from fsoe_net.report.model import Point, PointKind, ReportSection
from fsoe_net.report.observed import observed_cell
from fsoe_net.report.section_identity import files_table

if TYPE_CHECKING:
    from fsoe_net.observe.incident import IncidentHead
    from fsoe_net.run.result import Run

__all__ = ["bus_evidence", "tests"]

_EMULATED = Verdict("EMULATED, not evidence for this machine", Level.NOTE)


# -- 8 bus evidence -------------------------------------------------------------------------------


def bus_evidence(inputs: ReportInputs) -> ReportSection:
    """Scans, runs, incident files, and a running bus."""
    parts: list[Part] = []
    if inputs.evidence:
        files = [e.source for e in inputs.evidence]
        parts += [Heading("Files"), files_table("evidence files", files)]
    for e in inputs.evidence:
        parts += _file(e, inputs)
    if inputs.live is not None:
        parts += _live(inputs.live, inputs)
    if not parts:
        text = "There is no evidence of the machine; all else is what the files say."
        parts.append(Paragraph((Text(text),)))
    words = [*_other_plans(inputs), *_unread(inputs)]
    points = tuple(Point(PointKind.OPEN, text) for text in words)
    return ReportSection(
        key="bus_evidence", title="Bus evidence", parts=tuple(parts), points=points
    )


def _other_plans(inputs: ReportInputs) -> Iterator[str]:
    """Yield what is of another plan than that of the report, or of none that was accepted."""
    own = _plan_sha256(inputs)
    if inputs.live is not None and inputs.live.status.plan_sha256 != own:
        yield "the running fsn-master has another plan"
    if inputs.live is not None and not inputs.live.status.accepted:
        yield "the running fsn-master holds no accepted plan"
    for e in inputs.evidence:
        for source in (e.run, e.incident):
            if source is not None and source.plan_sha256 != own:
                yield f"{e.source.path} is from another plan"


def _unread(inputs: ReportInputs) -> Iterator[str]:
    """Yield what nobody has read from the machine."""
    of_machine = any(e.run is None or not e.run.emulated for e in inputs.evidence)
    is_live = inputs.live is not None and inputs.live.status.backend != "emulated"
    if not of_machine and not is_live:
        yield "no evidence of the machine: give --evidence scan.json or --interface IF"
    elif not any(e.scan is not None for e in inputs.evidence):
        yield "identities and mappings were not read back: a scan.json has them"


def _file(e: Evidence, inputs: ReportInputs) -> list[Part]:
    if e.scan is not None:
        return _scan(e.source.path, e.scan)
    if e.run is not None:
        return _run_file(e.source.path, e.run, inputs)
    return [] if e.incident is None else _incident(e.source.path, e.incident, inputs)


def _hex(value: int | None, source: str, width: int = 8) -> Item:
    return stated(value, "", source, "" if value is None else f"0x{value:0{width}x}")


def _scan(path: str, scan: Scan) -> list[Part]:
    columns = ("Position", "Name", "Vendor", "Product", "Revision", "Serial", "State")
    rows = [
        (
            cell(stated(s.position, "", path)),
            cell(strong(s.planned or s.name or "?")),
            cell(_hex(s.vendor_id, path)),
            cell(_hex(s.product_code, path)),
            cell(_hex(s.revision, path)),
            cell(stated(s.serial, "", path)),
            _state(s),
        )
        for s in scan.subdevices
    ]
    parts: list[Part] = [
        Heading(f"Scan {path}"),
        Paragraph(
            (Text(f"Read from interface {scan.interface} at {scan.utc or 'no stated time'}."),)
        ),
        Table(
            name=f"scan {path}",
            columns=tuple(Column(c) for c in columns),
            rows=tuple(rows),
            remark="What differs from the network files stands among the findings (FSN5xx).",
        ),
    ]
    fsoe = [row for s in scan.subdevices for row in _fsoe_rows(path, s)]
    if fsoe:
        heads = ("SubDevice", "Object", "FSoE address", "ConnID", "Watchdog")
        parts.append(
            Table(
                name=f"FSoE objects {path}",
                columns=tuple(Column(h) for h in heads),
                rows=tuple(fsoe),
                remark="Addresses (0xF980) and communication parameters (0x9nn1, 0xE9n1, 0x6791) "
                "as read from the devices.",
            )
        )
    mapped = [row for s in scan.subdevices for row in _mapping_rows(path, s)]
    if mapped:
        read = ("SubDevice", "Sync manager", "Length", "Assigned PDOs")
        parts.append(
            Table(
                name=f"mapping {path}",
                columns=tuple(Column(h) for h in read),
                rows=tuple(mapped),
                remark="Process data as read back from the devices.",
            )
        )
    return parts


def _state(s: ScannedSubDevice) -> Cell:
    words: list[Item] = [Text(s.al or "not read")]
    if s.in_error:
        words.append(Verdict("AL error flag", Level.WARNING))
    words += [Verdict(p, Level.OPEN) for p in s.problems]
    return tuple(words)


def _fsoe_rows(path: str, s: ScannedSubDevice) -> list[tuple[Cell, ...]]:
    if s.fsoe is None:
        return []
    name = cell(strong(s.planned or s.name or "?"), muted(f"position {s.position}"))
    rows: list[tuple[Cell, ...]] = [
        (name, cell(code(f"0xf980:{n:02x}")), cell(stated(a, "", path)), cell(""), cell(""))
        for n, a in enumerate(s.fsoe.addresses, 1)
    ]
    rows += [
        (
            name,
            cell(code(f"0x{c.object_index:04x}")),
            cell(stated(c.address, "", path)),
            cell(stated(c.connection_id, "", path)),
            cell(stated(c.watchdog_ms, "ms", path)),
        )
        for c in (*s.fsoe.connections, *s.fsoe.given)
    ]
    return rows


def _mapping_rows(path: str, s: ScannedSubDevice) -> list[tuple[Cell, ...]]:
    rows: list[tuple[Cell, ...]] = []
    for sm in s.process_data:
        pdos = "not read" if sm.pdos is None else ", ".join(f"0x{p.index:04x}" for p in sm.pdos)
        rows.append(
            (
                cell(strong(s.planned or s.name or "?"), muted(f"position {s.position}")),
                cell(f"SM{sm.index} {sm.kind}"),
                cell(stated(sm.size_bytes, "bytes", path)),
                cell(code(pdos or "none")),
            )
        )
    return rows


def _plan_sha256(inputs: ReportInputs) -> str:
    return "" if inputs.plan is None else hashlib.sha256(inputs.plan.to_bytes()).hexdigest()


def _same_plan(sha256: str, inputs: ReportInputs) -> Verdict:
    if inputs.plan is None:
        return Verdict("plan not compared", Level.OPEN)
    same = _plan_sha256(inputs) == sha256
    return Verdict("this plan", Level.CLEAR) if same else Verdict("ANOTHER plan", Level.WARNING)


def _run_file(path: str, run: RunEvidence, inputs: ReportInputs) -> list[Part]:
    items: list[Item] = [
        _EMULATED if run.emulated else Text(f"On a bus through {run.backend}"),
        Text(", "),
        stated(run.duration_ms / 1000, "s", path),
        Text(", "),
        stated(run.cycles, "bus cycles", path),
        Text(", "),
        stated(run.overruns, "late cycles", path),
        Text(", "),
        stated(run.wkc_errors, "cycles with incomplete working counter", path),
        Text("; "),
        _same_plan(run.plan_sha256, inputs),
        Text("; "),
        Verdict("run passed", Level.CLEAR) if run.passed else Verdict("run FAILED", Level.ERROR),
        Text("."),
    ]
    rows = tuple(
        (
            cell(strong(c.name)),
            cell(_state_words(c.state)),
            cell(stated(c.cycle_mean, "ms", path)),
            cell(stated(c.cycle_max, "ms", path)),
            cell(stated(c.watchdog, "ms", path)),
            cell(stated(c.resets, "resets", path), muted(c.reset_text if c.resets else "")),
            observed_cell(c.name, c),
        )
        for c in run.rows
    )
    return [
        Heading(f"Run {path}"),
        Paragraph(tuple(items)),
        Table(name=f"run {path}", columns=(*_RUN_COLUMNS, _OBSERVED), rows=rows),
    ]


_OBSERVED = Column("Parameters sent at the last start-up")
_RUN_COLUMNS = (
    Column("Connection"),
    Column("State at the end"),
    Column("FSoE cycle, mean", number=True),
    Column("FSoE cycle, most", number=True),
    Column("Watchdog", number=True),
    Column("Resets", number=True),
)


def _incident(path: str, head: IncidentHead, inputs: ReportInputs) -> list[Part]:
    t = head.trigger
    words = t.text or f"{t.connection}: {t.before} → {t.after}".strip()
    rows = tuple(
        (
            cell(strong(c.name)),
            cell(_state_words(c.state.word)),
            tuple(
                stated(d.wrong, f"wrong frames {to}", path)
                for d, to in ((c.to_sub, "to sub"), (c.to_main, "to main"))
            ),
            tuple(
                stated(d.interval_max_ns / 1e6, f"ms {to}", path)
                for d, to in ((c.to_sub, "to sub"), (c.to_main, "to main"))
            ),
        )
        for c in head.connections
    )
    heads = ("Connection", "State", "Wrong frames", "Longest time between new frames")
    return [
        Heading(f"Incident {path}"),
        Paragraph(
            (
                Text(
                    f"{head.utc}, {head.backend} on {head.interface or 'no interface'}: {words}; "
                ),
                _same_plan(head.plan_sha256, inputs),
                Text("; fsoe-net incident names the likely cause."),
            )
        ),
        Table(name=f"incident {path}", columns=tuple(Column(h) for h in heads), rows=rows),
    ]


def _live(live: LiveEvidence, inputs: ReportInputs) -> list[Part]:
    s, source = live.status, f"fsn-master at {live.socket}"
    where = Text(f"{s.state.value} on {s.interface or 'no interface'} through {s.backend}; ")
    items: list[Item] = [where]
    if s.backend == "emulated":
        items += [_EMULATED, Text("; ")]
    for value, unit in (
        (s.planned, "SubDevices planned"),
        (s.in_op, "in OP"),
        (s.missing, "missing"),
        (s.cycles, "bus cycles"),
        (s.overruns, "late cycles"),
        (s.wkc_errors, "cycles with incomplete working counter"),
    ):
        items += [stated(value, unit, source), Text(", ")]
    items += [Text("plan "), code(s.plan_sha256), Text(" "), _same_plan(s.plan_sha256, inputs)]
    if s.interventions is not None:
        entry = Text(f"; intervention log up to entry {s.interventions.entry}, SHA-256 ")
        items += [entry, code(s.interventions.sha256 or "none")]
    names = (*live.names, *("?",) * len(live.snapshot.cycle.connections))
    rows = tuple(
        (
            cell(strong(name)),
            cell(_state_words(c.state.word)),
            cell(_seen(max(c.to_sub.interval_mean_ns, c.to_main.interval_mean_ns), source)),
            cell(_seen(max(c.to_sub.interval_max_ns, c.to_main.interval_max_ns), source)),
            cell(stated(c.to_sub.wrong + c.to_main.wrong, "frames", source)),
            cell(stated(c.to_sub.resets + c.to_main.resets, "resets", source)),
            observed_cell(name, c),
        )
        for name, c in zip(names, live.snapshot.cycle.connections, strict=False)
    )
    heads = ("State now", "FSoE cycle, mean", "FSoE cycle, most", "Wrong CRC", "Resets")
    columns = (Column("Connection"), *(Column(h) for h in heads), _OBSERVED)
    return [
        Heading("Running bus"),
        Paragraph(tuple(items)),
        Table(name="running bus", columns=columns, rows=rows),
        Table(
            name="running SubDevices",
            columns=tuple(Column(h) for h in ("SubDevice", "AL state", "In its place")),
            rows=tuple(
                (cell(strong(d.name)), cell(d.al), cell(d.found or muted("not known"), d.detail))
                for d in live.snapshot.subdevices
            ),
        ),
    ]


def _seen(ns: int, source: str) -> Item:
    return stated(ns / 1e6, "ms", source) if ns else muted("none seen")


# -- 9 tests --------------------------------------------------------------------------------------


def tests(inputs: ReportInputs) -> ReportSection:
    """The checklist, and what ran on the emulated bus, apart from it."""
    parts: list[Part] = [Heading("Checklist")]
    points: list[Point] = []
    tried = inputs.tried
    if tried is None:
        parts.append(Paragraph((Text("The checklist is empty: no test protocol was given."),)))
        points.append(Point(PointKind.OPEN, "no test protocol: nothing was tried at the machine"))
    else:
        parts += [files_table("test protocol", [tried.source]), _checklist(tried)]
        left = sum(s.is_open for s in tried.steps)
        if left:
            count = sum(s.at_machine for s in tried.steps)
            words = f"{left} of {counted(count, 'test step')} open at the machine"
            points.append(Point(PointKind.OPEN, words))
        failed = [s for s in tried.steps if s.is_failed]
        if failed:
            words = (
                f"{counted(len(failed), 'test step')} did not go as expected, first: "
                f"{failed[0].what}"
            )
            points.append(Point(PointKind.OPEN, words))
        disputed = [s for s in tried.steps if s.is_disputed]
        if disputed:
            words = (
                f"{counted(len(disputed), 'test step')} went as expected by hand and not by "
                f"program, first: "
                f"{disputed[0].what}"
            )
            points.append(Point(PointKind.OPEN, words))
        if tried.plan_sha256 != _plan_sha256(inputs):
            words = f"{tried.source.path} was made for another plan"
            points.append(Point(PointKind.OPEN, words))
        if not tried.fits:
            word = f"{tried.source.path} cannot be taken for this network"
            parts.append(Paragraph((Verdict(word, Level.ERROR), Text(": see the open points."))))
        points += [Point(PointKind.OPEN, f"{tried.source.path}:{note}") for note in tried.notes]
    if inputs.run is not None:
        parts += _emulated_run(inputs.run)
    elif inputs.scenario:
        words = f"{inputs.scenario} was not run: the network has errors"
        parts += [Heading("Run on the emulated bus"), Paragraph((Text(f"{words}."),))]
        points.append(Point(PointKind.OPEN, words))
    return ReportSection(key="tests", title="Tests", parts=tuple(parts), points=tuple(points))


def _checklist(tried: Tried) -> Table:
    heads = (
        "What to do",
        "Expected",
        "At most",
        "EMULATED",
        "LIVE, by program",
        "MACHINE, by hand",
        "Who, when",
    )
    source = tried.source.path
    rows = tuple(
        (
            cell(s.what),
            cell(s.expected),
            cell(muted("no limit"))
            if s.limit_ms is None
            else cell(stated(s.limit_ms, "ms", s.limit_source or source)),
            _result(s.emulated, s.emulated_ms, source),
            _result(s.live, s.live_ms, source),
            _by_hand(s, source),
            cell(s.who) if s.who else BLANK if s.at_machine else (),
        )
        for s in tried.steps
    )
    return Table(
        name="checklist",
        columns=tuple(Column(h) for h in heads),
        rows=rows,
        remark="EMULATED: on an emulated bus, not evidence for this machine. Only what a person "
        "wrote down at the machine closes a step.",
    )


def _by_hand(s: TestStep, source: str) -> Cell:
    if not s.at_machine:
        return cell(muted("not tried at the machine"))
    return _result(s.machine, s.machine_ms, source, failed=s.is_failed) or BLANK


def _result(word: str, ms: float | None, source: str, *, failed: bool = False) -> Cell:
    items: list[Item] = []
    if word:
        failed = failed or word.startswith("not as expected")
        items.append(Verdict(word, Level.ERROR) if failed else Text(word))
    if ms is not None:
        items.append(stated(ms, "ms", source))
    return tuple(items)


def _state_words(word: str) -> str:
    from fsoe_net.run.result import state_text  # slow to load, and most reports have no run

    return state_text(word)


def _emulated_run(run: Run) -> list[Part]:
    source = "run of this plan on the emulated bus"
    s = run.statistics
    passed = Verdict("passed", Level.CLEAR) if run.passed else Verdict("FAILED", Level.ERROR)
    parts: list[Part] = [
        Heading("Run on the emulated bus"),
        Paragraph(
            (
                _EMULATED,
                Text(f". {run.mode.capitalize()} time, "),
                stated(run.duration_ms / 1000, "s", source),
                Text(", "),
                stated(s.cycles, "bus cycles", source),
                Text(", "),
                stated(s.wkc_errors, "with incomplete working counter", source),
                Text(", "),
                stated(s.bytes_copied, "bytes copied", source),
                Text(": "),
                passed,
                Text("."),
            )
        ),
        Table(
            name="emulated run",
            columns=_RUN_COLUMNS,
            rows=tuple(
                (
                    cell(strong(c.name)),
                    cell(_state_words(c.state)),
                    cell(stated(c.fsoe_cycle_ms["mean"], "ms", source)),
                    cell(stated(c.fsoe_cycle_ms["max"], "ms", source)),
                    cell(stated(c.watchdog_ms, "ms", source)),
                    cell(
                        stated(c.resets, "resets", source),
                        muted(c.last_reset_text if c.resets else ""),
                    ),
                )
                for c in run.connections
            ),
        ),
    ]
    if run.verdicts:
        rows = tuple(
            (
                cell(Verdict("held", Level.CLEAR) if v.held else Verdict("NOT held", Level.ERROR)),
                cell(v.text),
                cell(code(v.place), *([v.seen] if v.seen else [])),
            )
            for v in run.verdicts
        )
        columns = tuple(Column(h) for h in ("Verdict", "Expectation", "Place"))
        parts.append(Table(name="expectations", columns=columns, rows=rows))
    return parts
