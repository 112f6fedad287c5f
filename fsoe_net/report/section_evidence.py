"""Data reported by the machine itself: scans, runs, incident files, a running bus."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from fsoe_net.diag.words import noun
from fsoe_net.document.model import (
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
    number_of,
    stated,
    strong,
)
from fsoe_net.fsoe.parameters import SeenParameters, differences
from fsoe_net.live.health import (
    Health,
    HealthLevel,
    health_texts,
    snapshot_health,
    subdevice_health,
)
from fsoe_net.model.scan import Scan, ScannedSubDevice
from fsoe_net.report.evidence import Evidence, LiveEvidence, RunEvidence
from fsoe_net.report.inputs import ReportInputs
from fsoe_net.report.model import ReportSection, open_point
from fsoe_net.report.section_identity import files_table

if TYPE_CHECKING:
    from fsoe_net.incident.incident import IncidentHead


def observed_cell(name: str, seen: SeenParameters) -> Cell:
    """Return the parameters of the MainInstance in its last start-up, and objections to them."""
    against = tuple(_against(name, seen))
    if against:
        return against
    o = seen.observed
    if o.watchdog_ms is None:
        return cell(Verdict("not observed", Level.OPEN))
    words = f"ConnID {o.connection_id}, address {o.address}, {o.watchdog_ms} ms"
    if not o.app_bytes:
        return cell(Verdict("as stated", Level.CLEAR), muted(words))
    words += f", {o.app_bytes} bytes of application parameters"
    if seen.configured.app_bytes is None:
        words += ", which the network does not state"
        return cell(Verdict("application parameters not compared", Level.OPEN), muted(words))
    return cell(Verdict("as stated", Level.CLEAR), muted(words))


def _against(name: str, seen: SeenParameters) -> Iterator[Item]:
    for text in differences(seen.differs, seen.configured, seen.observed):
        yield Verdict(f"{name}: {text}", Level.ERROR)


HEALTH_LEVELS = {
    HealthLevel.GOOD: Level.CLEAR,
    HealthLevel.UNKNOWN: Level.OPEN,
    HealthLevel.WARNING: Level.WARNING,
    HealthLevel.ERROR: Level.ERROR,
}
"""The display level of each health level."""

EMULATED = Verdict("EMULATED, not evidence for this machine", Level.NOTE)


# -- 8 bus evidence -------------------------------------------------------------------------------


def bus_evidence(inputs: ReportInputs) -> ReportSection:
    """Return scans, runs, incident files, and a running bus."""
    parts: list[Part] = []
    if inputs.evidence:
        files = [e.source for e in inputs.evidence]
        parts += [Heading("Files"), files_table("evidence files", files)]
    for e in inputs.evidence:
        parts += _file(e, inputs)
    if inputs.live is not None:
        parts += _live(inputs.live, inputs)
    if not parts:
        text = "There is no evidence of the machine; all other facts are from the files."
        parts.append(Paragraph((Text(text),)))
    words = [*_other_plans(inputs), *_unread(inputs)]
    points = tuple(open_point(text) for text in words)
    return ReportSection(
        key="bus_evidence", title="Bus evidence", parts=tuple(parts), points=points
    )


def _other_plans(inputs: ReportInputs) -> Iterator[str]:
    """Yield evidence of a plan other than that of the report, or of a plan not accepted."""
    own = plan_sha256(inputs)
    # A plan that was not accepted is not the plan that people signed.
    if inputs.live is not None and inputs.live.status.plan_sha256 != own:
        yield "the running fsn-master has another plan"
    if inputs.live is not None and not inputs.live.status.accepted:
        yield "the running fsn-master holds no accepted plan"
    # Both types state their plan; a scan has none.
    for e in inputs.evidence:
        for source in (e.run, e.incident):
            if source is not None and source.plan_sha256 != own:
                yield f"{e.source.path} is from another plan"


def is_of_machine(inputs: ReportInputs) -> bool:
    """Return whether any data were read at the machine."""
    if inputs.live is not None and inputs.live.status.backend != "emulated":
        return True
    return any(e.run is None or not e.run.emulated for e in inputs.evidence)


def _unread(inputs: ReportInputs) -> Iterator[str]:
    """Yield the data that were not read from the machine."""
    if not is_of_machine(inputs):
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
    # Only devices that report FSoE objects: most SubDevices have none.
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
    # The values read back are those in use, whatever the files contain.
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
    words += [Verdict(p, Level.OPEN) for p in s.remarks]
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
        # `given` are parameters as transferred by the MainInstance; both are evidence.
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
                cell(number_of(sm.size_bytes, "byte", path)),
                cell(code(pdos or "none")),
            )
        )
    return rows


def plan_sha256(inputs: ReportInputs) -> str:
    """Return the SHA-256 of the plan of a report; empty if there is none."""
    return "" if inputs.plan is None else hashlib.sha256(inputs.plan.to_bytes()).hexdigest()


def _same_plan(sha256: str, inputs: ReportInputs) -> Verdict:
    if inputs.plan is None:
        return Verdict("plan not compared", Level.OPEN)
    same = plan_sha256(inputs) == sha256
    return Verdict("this plan", Level.CLEAR) if same else Verdict("ANOTHER plan", Level.WARNING)


def _run_file(path: str, run: RunEvidence, inputs: ReportInputs) -> list[Part]:
    items: list[Item] = [
        EMULATED if run.emulated else Text(f"On a bus through {run.backend}"),
        Text(", "),
        stated(run.duration_ms / 1000, "s", path),
        Text(", "),
        number_of(run.cycles, "bus cycle", path),
        Text(", "),
        number_of(run.overruns, "late cycle", path),
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
            cell(c.state.text),
            cell(stated(c.cycle_mean, "ms", path)),
            cell(stated(c.cycle_max, "ms", path)),
            cell(stated(c.watchdog, "ms", path)),
            cell(number_of(c.resets, "reset", path), muted(c.reset_text if c.resets else "")),
            observed_cell(c.name, c),
        )
        for c in run.rows
    )
    return [
        Heading(f"Run {path}"),
        Paragraph(tuple(items)),
        Table(name=f"run {path}", columns=(*RUN_COLUMNS, _OBSERVED), rows=rows),
    ]


_OBSERVED = Column("Parameters sent at the last start-up")
RUN_COLUMNS = (
    Column("Connection"),
    Column("State at the end"),
    Column("FSoE cycle, mean", number=True),
    Column("FSoE cycle, most", number=True),
    Column("Watchdog", number=True),
    Column("Resets", number=True),
)


def _incident(path: str, head: IncidentHead, inputs: ReportInputs) -> list[Part]:
    t = head.trigger
    # A trigger of a condition has a text; a change of state has two states.
    words = t.text or f"{t.connection}: {t.before or ''} → {t.after or ''}".strip()
    rows = tuple(
        (
            cell(strong(c.name)),
            cell(c.state.text),
            tuple(
                stated(d.wrong, f"{noun(d.wrong, 'wrong frame')} {to}", path)
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
                Text("; fsoe-net log incident names the likely cause."),
            )
        ),
        Table(name=f"incident {path}", columns=tuple(Column(h) for h in heads), rows=rows),
    ]


def _live(live: LiveEvidence, inputs: ReportInputs) -> list[Part]:
    s, source = live.status, f"fsn-master at {live.socket}"
    where = Text(f"{s.state.value} on {s.interface or 'no interface'} through {s.backend}; ")
    items: list[Item] = [where]
    # An emulated bus must never look like evidence of the machine.
    if s.backend == "emulated":
        items += [EMULATED, Text("; ")]
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
    if s.standby is not None:
        held = ", held: it takes nothing over" if s.standby.held else ""
        items.append(Text(f"; a standby follows, process {s.standby.pid}{held}"))
    # Names come from another request than the snapshot; a plan loaded in between has other names.
    names = (*live.names, *("?",) * len(live.snapshot.cycle.connections))
    rows = tuple(
        (
            cell(strong(name)),
            _state_now(snapshot_health(c, live.snapshot.subdevices), c.state.text),
            cell(_seen(max(c.to_sub.interval_mean_ns, c.to_main.interval_mean_ns), source)),
            cell(_seen(max(c.to_sub.interval_max_ns, c.to_main.interval_max_ns), source)),
            cell(number_of(c.to_sub.wrong + c.to_main.wrong, "frame", source)),
            cell(number_of(c.to_sub.resets + c.to_main.resets, "reset", source)),
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
                (
                    cell(strong(s.name)),
                    _state_now(subdevice_health(s), s.al),
                    cell(s.found_text or muted("not known"), s.detail),
                )
                for s in live.snapshot.subdevices
            ),
        ),
    ]


def _state_now(health: Health, state: str) -> Cell:
    """Return a state, and the reasons if it is not good."""
    level = HEALTH_LEVELS[health.level]
    return (Text(state), *(Verdict(text, level) for text in health_texts(health)))


def _seen(ns: int, source: str) -> Item:
    return stated(ns / 1e6, "ms", source) if ns else muted("none seen")
