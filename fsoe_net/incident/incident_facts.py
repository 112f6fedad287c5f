"""Content of an incident file for readers; shown by the page and its JSON form."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from fsoe_net.diag.words import counted
from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict
from fsoe_net.fsoe.parameters import differences
from fsoe_net.fsoe.pdu import decode_pdu, describe_data, reset_code_text
from fsoe_net.incident.causes import Verdicts, judge
from fsoe_net.incident.evidence import IncidentEvidence
from fsoe_net.incident.evidence_frames import FrameSeen
from fsoe_net.incident.incident import TriggerKind

NO_STATEMENT = (
    "This page shows causes that match the evidence. It is not a safety statement and certifies "
    "nothing"
)
_EVENTS = 12
_BEFORE, _AFTER = 8, 4
_MOST_LINKS = 24
_VERDICTS = {
    CrcVerdict.SAME: "",
    CrcVerdict.RIGHT: "right",
    CrcVerdict.WRONG: "WRONG CRC",
    CrcVerdict.UNCHECKED: "not checked",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkRow:
    """One connection; ``mark`` if the page is about it."""

    name: str
    main: str
    sub: str
    connection_id: str
    address: str
    watchdog: str
    state: str
    wrong: str
    resets: str
    answers: str
    mark: bool

    @property
    def cells(self) -> tuple[str, ...]:
        """The cells of a table; the name is first."""
        return (
            self.name,
            self.connection_id,
            self.address,
            self.watchdog,
            self.state,
            self.wrong,
            self.resets,
            self.answers,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeRow:
    """One event; time relative to the moment."""

    offset_ms: float
    text: str
    level: str

    @property
    def is_warning(self) -> bool:
        """Whether it is a warning or worse."""
        return self.level in ("warning", "error")


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameRow:
    """One frame; ``changed``: bytes that differ from the previous frame; ``wrong``: its CRC."""

    offset_ms: float
    cycle: int
    direction: str
    data: bytes
    changed: tuple[int, ...]
    text: str
    verdict: str
    wrong: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class IncidentFacts:
    """Content of a page. ``nothing``: why no cause is named; otherwise empty."""

    title: str
    sentence: str
    facts: tuple[str, ...]
    remarks: tuple[str, ...]
    verdicts: Verdicts
    nothing: str
    links: tuple[LinkRow, ...]
    links_left: int
    events: tuple[TimeRow, ...]
    events_left: int
    frames: tuple[FrameRow, ...]
    worst: tuple[tuple[str, ...], ...]
    evidence: IncidentEvidence


def facts_of(e: IncidentEvidence) -> IncidentFacts:
    """Return the facts to report."""
    verdicts = judge(e)
    events, events_left = _events(e)
    links = _links(e)
    return IncidentFacts(
        title=_title(e),
        sentence=_sentence(e),
        facts=_facts(e),
        remarks=_remarks(e),
        verdicts=verdicts,
        nothing=_nothing(e, verdicts),
        links=tuple(links[:_MOST_LINKS]),
        links_left=max(0, len(links) - _MOST_LINKS),
        events=events,
        events_left=events_left,
        frames=_frames(e),
        worst=_worst(e),
        evidence=e,
    )


def _title(e: IncidentEvidence) -> str:
    what = {
        TriggerKind.LEFT_DATA: f"connection {e.name} left Data",
        TriggerKind.NOT_CONNECTED: f"connection {e.name} did not reach Data",
        TriggerKind.REFUSED: f"SubDevice {e.head.trigger.subdevice} is not as planned",
        TriggerKind.BUS_FAILED: "the bus did not open",
        TriggerKind.REQUEST: "recorded on request",
    }
    return f"Incident: {what[e.head.trigger.kind]}"


def _when(e: IncidentEvidence) -> str:
    return f"{e.head.utc.replace('T', ' ').removesuffix('Z')} UTC" if e.head.utc else "unknown time"


def _sentence(e: IncidentEvidence) -> str:
    """Return one sentence that describes the incident without its cause."""
    trigger = e.head.trigger
    if trigger.kind is TriggerKind.BUS_FAILED:
        reason = trigger.text or "no reason was reported"
        return f"At {_when(e)} the bus did not open: {reason}."
    if trigger.kind is TriggerKind.REFUSED:
        return f"At {_when(e)} the bus reported: {trigger.text}."
    if trigger.kind is TriggerKind.REQUEST:
        about = f" {e.name} was in {_state(e)}." if e.name else ""
        said = f" ({trigger.text})" if trigger.text else ""
        return f"At {_when(e)} this was recorded on request{said}.{about}"
    if trigger.kind is TriggerKind.NOT_CONNECTED:
        return (
            f"Connection {e.name} did not reach Data; at {_when(e)} it was in {_state(e)}"
            f"{_last_reset(e)}."
        )
    before = trigger.before.text if trigger.before else "Data"
    after = trigger.after.text if trigger.after else "another state"
    return f"Connection {e.name} left {before} for {after} at {_when(e)}{_who(e)}."


def _state(e: IncidentEvidence) -> str:
    state = e.head.trigger.after or (e.link.state_at_moment if e.link else None)
    return state.text if state else "an unknown state"


def _who(e: IncidentEvidence) -> str:
    if e.code is None or not e.by:
        return "; no reset was seen"
    return f": the {_end(e, e.by)} reset it with code {e.code}, {reset_code_text(e.code)}"


def _end(e: IncidentEvidence, by: str) -> str:
    word = "MainInstance" if by == "main" else "SubInstance"
    if e.plan is None:
        return word
    device = e.plan.main if by == "main" else e.plan.sub
    return f"{word} in {device}" if device else word


def _last_reset(e: IncidentEvidence) -> str:
    errors = [r for r in e.link.resets if r.code] if e.link else []
    if not errors:
        return ", and it was not reset with an error"
    last = errors[-1]
    return (
        f"; {counted(len(errors), 'reset')} with an error, the last by the {_end(e, last.by)} "
        f"with code "
        f"{last.code}, {reset_code_text(last.code)}"
    )


def _facts(e: IncidentEvidence) -> tuple[str, ...]:
    head, bus = e.head, e.bus
    rows = [
        f"bus {head.backend or 'unknown'}" + (f" on {head.interface}" if head.interface else ""),
        f"plan {head.plan_file or 'without a name'}"
        + (f", SHA-256 {head.plan_sha256[:16]}" if head.plan_sha256 else ""),
        f"fsoe-net {head.version}" if head.version else "",
    ]
    if bus.cycles:
        start, end = (bus.first_ns - e.moment_ns) / 1e9, (bus.last_ns - e.moment_ns) / 1e9
        cycles = f"{counted(bus.cycles, 'cycle')} of {bus.cycle_ns / 1000:g} us"
        rows.append(f"{cycles}, from {start:+.2f} s to {end:+.2f} s")
    return tuple(row for row in rows if row)


def _remarks(e: IncidentEvidence) -> tuple[str, ...]:
    rows = list(e.head.remarks)
    # A truncated file is still useful, but its counts are minimums.
    if e.cut:
        rows.append(f"the file ends early ({e.cut}); what is before is shown")
    if e.bus.missed:
        rows.append(
            f"{e.bus.missed} cycles were not recorded: frames may have passed unseen, so CRC "
            "verdicts and answer times are less certain"
        )
    for c in e.head.connections:
        others = differences(c.differs, c.configured, c.observed)
        # Such a connection differs from its documentation, whatever the cause.
        if others:
            rows.append(f"{c.name} ran with other parameters than the plan: {'; '.join(others)}")
    if e.head.trigger.kind is not TriggerKind.BUS_FAILED and not e.links:
        rows.append("the file holds no layout: the frames cannot be shown")
    return tuple(rows)


def _nothing(e: IncidentEvidence, verdicts: Verdicts) -> str:
    if verdicts.likely is not None:
        return ""
    if e.head.trigger.kind is TriggerKind.REQUEST and not verdicts.others:
        return "Nothing wrong is seen in what was recorded."
    return (
        "No known cause fits the evidence well, so none is named. Keep this file; look at the "
        "frames and events below, and at the diagnosis of the devices."
    )


def _links(e: IncidentEvidence) -> list[LinkRow]:
    rows = []
    for name, plan in e.planned.items():
        link = e.links.get(name)
        seen = next((c for c in e.head.connections if c.name == name), None)
        # A connection without frames and without a state has nothing to show.
        if link is None and seen is None:
            continue
        state: ConnectionState | None = None
        if link:
            state = link.state_at_moment
        elif seen:
            state = seen.state
        rows.append(
            LinkRow(
                name=name,
                main=plan.main,
                sub=plan.sub,
                connection_id="-" if plan.connection_id is None else str(plan.connection_id),
                address="-" if plan.address is None else str(plan.address),
                watchdog="-" if plan.watchdog_ms is None else f"{plan.watchdog_ms} ms",
                state=state.text if state else "-",
                wrong=f"{link.sides[0].wrong} / {link.sides[1].wrong}" if link else "-",
                resets=_resets(e, name),
                answers=_answers(e, name),
                mark=name == e.name,
            )
        )
    # The connection of the incident first.
    rows.sort(key=lambda r: not r.mark)
    return rows


def _resets(e: IncidentEvidence, name: str) -> str:
    link = e.links.get(name)
    if link is None or not link.resets:
        return "-"
    codes: dict[str, int] = {}
    for reset in link.resets:
        key = f"{reset.by} {reset.code}"
        codes[key] = codes.get(key, 0) + 1
    return ", ".join(f"{times}x {key}" for key, times in sorted(codes.items()))


def _answers(e: IncidentEvidence, name: str) -> str:
    """Return mean and maximum answer time in Data of main and sub, in milliseconds."""
    link = e.links.get(name)
    if link is None or not any(s.waits for s in link.sides):
        return "-"
    parts = [
        f"{s.waits_sum_ns / s.waits / 1e6:.2g} ({s.waits_most_ns / 1e6:.3g})" if s.waits else "-"
        for s in link.sides
    ]
    return " / ".join(parts)


def _events(e: IncidentEvidence) -> tuple[tuple[TimeRow, ...], int]:
    """Return the most relevant events: warnings and those close to the moment."""
    # A bus that did not open has no cycles, so all its events count.
    rows = [
        v for v in e.head.events if e.bus.first_ns <= v.now_ns <= e.bus.last_ns or not e.bus.cycles
    ]
    rank = {"error": 0, "warning": 0}
    chosen = sorted(
        rows, key=lambda v: (rank.get(v.level, 1), abs(v.now_ns - e.moment_ns), v.now_ns)
    )[:_EVENTS]
    kept = sorted(chosen, key=lambda v: v.now_ns)
    shown = tuple(
        TimeRow(offset_ms=(v.now_ns - e.moment_ns) / 1e6, text=v.text or v.event, level=v.level)
        for v in kept
    )
    return shown, len(rows) - len(kept)


def _frames(e: IncidentEvidence) -> tuple[FrameRow, ...]:
    link = e.link
    if link is None:
        return ()
    before = [f for f in link.frames if f.now_ns <= e.moment_ns]
    after = [f for f in link.frames if f.now_ns > e.moment_ns]
    return tuple(_frame(e, f) for f in [*before[-_BEFORE:], *after[:_AFTER]])


def _frame(e: IncidentEvidence, seen: FrameSeen) -> FrameRow:
    plan = e.plan
    main, sub = (plan.main, plan.sub) if plan else ("main", "sub")
    return FrameRow(
        offset_ms=(seen.now_ns - e.moment_ns) / 1e6,
        cycle=seen.cycle,
        direction=f"{main} > {sub}" if seen.direction == 0 else f"{sub} > {main}",
        data=seen.data,
        changed=seen.changed,
        text=describe_data(decode_pdu(seen.data)),
        verdict=_VERDICTS[seen.verdict],
        wrong=seen.verdict is CrcVerdict.WRONG,
    )


def _worst(e: IncidentEvidence) -> tuple[tuple[str, ...], ...]:
    """Return the latest cycles: number, time, lateness, wake-up, work and round trip."""
    return tuple(
        (
            str(s.cycle),
            f"{(s.now_ns - e.moment_ns) / 1e6:+.1f} ms",
            _us(s.extra_ns),
            _us(s.late_ns),
            _us(s.work_ns),
            _us(s.round_ns),
        )
        for s in e.bus.worst[:5]
    )


def _us(ns: int) -> str:
    return f"{ns / 1000:.1f} us" if ns else "-"


def facts_json(facts: IncidentFacts, version: str) -> dict[str, object]:
    """Return the JSON document (``docs/howto/incident.md``)."""
    e = facts.evidence
    trigger = e.head.trigger
    return {
        "tool": "fsoe-net",
        "version": version,
        "kind": trigger.kind.value,
        "utc": e.head.utc,
        "connection": e.name or None,
        "reset_by": e.by or None,
        "reset_code": e.code,
        "sentence": facts.sentence,
        "likely": None if facts.verdicts.likely is None else asdict(facts.verdicts.likely),
        "others": [asdict(c) for c in facts.verdicts.others],
        "nothing": facts.nothing or None,
        "remarks": list(facts.remarks),
        "facts": list(facts.facts),
        "connections": [asdict(row) for row in facts.links],
        "events": [asdict(row) for row in facts.events],
        "working_counter": {
            "incomplete_cycles": sum(r.cycles for r in e.bus.short),
            "lost_frames": e.bus.lost_frames,
            "late_cycles": e.bus.late_cycles,
        },
        "frames": [
            asdict(row) | {"data": row.data.hex(), "changed": list(row.changed)}
            for row in facts.frames
        ],
    }
