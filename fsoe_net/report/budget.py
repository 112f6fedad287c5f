"""The timing budget as text, as JSON and as a picture."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from fsoe_net.diag.words import counted
from fsoe_net.document.markup import escape, svg_text
from fsoe_net.document.model import (
    Column,
    Document,
    Part,
    Section,
    Table,
    cell,
    outward,
    words,
)
from fsoe_net.timing.budget import Budget
from fsoe_net.timing.claims import LevelClaim
from fsoe_net.timing.elements import ElementRow, Quantity
from fsoe_net.timing.formulas import PartTimes, SignalWay
from fsoe_net.timing.reaction import FunctionBudget, Reaction, ResponseCase, reaction_of
from fsoe_net.timing.watchdogs import Limit, WatchdogBudget

_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 760, 250, 64, 210, 30, 44
_CYCLES = (0.1, 0.2, 0.25, 0.5, 1.0, 2.0, 4.0, 5.0, 8.0, 10.0)
# Dashes, colour and mark of each curve, so that none of them is needed alone.
_LOOKS = {
    "error-free": ("", "#116329", "M-4,0a4,4 0 1,0 8,0a4,4 0 1,0 -8,0z"),
    "ETG.5100, one failure": ("7 4", "#0550ae", "M-4,-4h8v8h-8z"),
    "Beckhoff, two watchdogs": ("2 3", "#953800", "M0,-5l5,9h-10z"),
    "FSoE handshake, one late": ("10 3 2 3 2 3", "#6639ba", "M0,-5l5,5l-5,5l-5,-5z"),
    "required": ("12 3 2 3", "#99286e", "M-4,-4l8,8m0,-8l-8,8"),
}
_LABEL = 15  # height of a label, so that labels do not touch
_STYLE = (
    ".budget text{font:12px system-ui,sans-serif;fill:#1f2328}"
    ".budget .small{font-size:11px;fill:#57606a}"
    ".budget .line,.budget .mark{fill:none;stroke-width:1.8}.budget .grid{stroke:#d0d7de}"
    ".budget .lead{stroke:#8c959f;stroke-width:.8}"
    ".budget .axis{stroke:#57606a}.budget .here{stroke:#57606a;stroke-dasharray:1 3}"
    ".budget .back{fill:#fff}@media screen and (prefers-color-scheme:dark){"
    ".budget text{fill:#e6edf3}.budget .small{fill:#9198a1}"
    ".budget .line,.budget .mark,.budget .name{filter:brightness(2)}"
    ".budget .grid{stroke:#30363d}.budget .axis,.budget .here{stroke:#9198a1}"
    ".budget .back{fill:#0d1117}}"
)


# -- text -----------------------------------------------------------------------------------------
_HANDSHAKE = "FSoE handshake counted"
_LATE = {"input": "input", "output": "output", "both ways": "both ways of one"}
_WATCHDOGS = (
    Column("connection"),
    Column("watchdog", number=True, rank=1),
    Column("least", number=True, rank=3),
    Column("greatest: printed", number=True, rank=4),
    Column("handshake counted", number=True, rank=5),
    Column("margin", number=True, rank=6),
    Column("lost cycles", number=True, rank=8),
    Column("verdict", rank=2, wraps=True),
    Column("functions", rank=7, wraps=True),
)
_ELEMENTS = (
    Column("part"),
    Column("element"),
    Column("time", number=True),
    Column("PFH", number=True, rank=1),
    Column("claim", rank=2),
    Column("source", rank=3, wraps=True),
)
_TIMES = (Column("response time"), Column("longest", number=True), Column("counted by", rank=1))


def budget_document(budget: Budget) -> Document:
    """Return watchdogs as a table, then each safety function with every part of its sum."""
    rows = tuple(tuple(cell(text) for text in _watchdog(c)) for c in budget.connections)
    lead: list[Part] = [
        words(_assumptions(budget)),
        Table(name="watchdogs", columns=_WATCHDOGS, rows=rows),
    ]
    for c in budget.connections:
        # The order of the table: too short is judged first, then too long.
        for word, limit, way in (
            ("at least", c.least, _up),
            ("at most", c.printed, _down),
            ("at most", c.handshake, _down),
        ):
            if limit is not None:
                lead.append(words(f"{c.connection.name} {word} {_limit(limit, way)}: {limit.why}"))
    if not budget.functions:
        lead.append(words("no safety_functions in the network file: nothing is judged"))
    return Document(lead=tuple(lead), sections=tuple(_function(f) for f in budget.functions))


def _watchdog(c: WatchdogBudget) -> tuple[str, ...]:
    return (
        c.connection.name,
        _ms(c.configured),
        _limit(c.least, _up),
        _limit(c.printed, _down),
        _limit(c.handshake, _down),
        "-" if c.margin is None else f"{c.margin:.1f}x",
        "-" if c.lost_frames is None else str(c.lost_frames),
        "EMPTY: no watchdog fits" if c.empty else c.verdict,
        ", ".join(c.functions) or "-",
    )


def _assumptions(budget: Budget) -> str:
    cycle = "bus cycle not stated" if budget.cycle is None else f"bus cycle {budget.cycle:g} ms"
    drift = f"clocks of devices up to {budget.drift:.2%} slow" if budget.drift else "clocks exact"
    if budget.buses:
        # Each bus has its own cycle; all are listed, so that a reader can check the sum.
        cycle = "bus cycle " + ", ".join(f"{ms:g} ms ({name})" for name, ms in budget.buses)
    across = ", one more of each bus that takes a frame over" if budget.buses else ""
    return f"{cycle}, {counted(budget.copy_cycles, 'bus cycle')} per direction{across}, {drift}"


def _function(row: FunctionBudget) -> Section:
    f = row.function
    elements = tuple(
        (
            cell(e.element.kind.value),
            cell(e.element.name),
            cell(_quantity(e.time)),
            cell(_quantity(e.pfh)),
            cell(_claim(e)),
            cell(e.time.source or e.pfh.source or "no source"),
        )
        for e in row.parts.rows
    )
    parts: list[Part] = [Table(name="elements", columns=_ELEMENTS, rows=elements)]
    if row.reaction is not None:
        times = tuple(tuple(cell(text) for text in time) for time in _times(row.reaction))
        parts.append(Table(name="times", columns=_TIMES, rows=times))
    required = f.required_reaction_ms
    parts.append(words(f"required {_ms(required)}: {row.verdict}" if required else row.verdict))
    # The share of FSoE is 1 % of SIL 3 and counts once, whatever the number of connections.
    limit = "" if row.pfh.limit is None else f" of {row.pfh.limit:.0e} 1/h"
    fsoe = f", {row.pfh.fsoe:.2e} of it for FSoE" if row.pfh.fsoe else ""
    parts.append(words(f"PFH {row.pfh.total:.2e} 1/h{limit}{fsoe}: {row.pfh.verdict}"))
    parts += [words(w) for claim in row.levels for w in (claim.verdict, claim.sum_words) if w]
    title = f"{f.name}: {f.trigger or '?'} -> {f.reaction or '?'}"
    return Section(key=f.name, title=title, parts=tuple(parts))


def _times(r: Reaction) -> list[tuple[str, str, str]]:
    sides = (("input", r.worst_input), ("output", r.worst_output))
    both = " and ".join(f"{side} {_up(value)}" for side, value in sides if value)
    return [
        ("error-free", _up(r.error_free), "ETG.5100 9.3"),
        ("worst case, one failure", _up(r.worst_etg), f"ETG.5100 9.3 ({both or 'no bus'})"),
        ("typical", _up(r.typical), "Beckhoff"),
        ("worst case, two watchdogs", _up(r.worst_beckhoff), "Beckhoff"),
        ("error-free, waits for the turn", _up(r.polled), _HANDSHAKE),
        ("one connection breaks", _up(r.broken), _HANDSHAKE),
        *(
            (f"{_LATE[c.way]} late, then lost", _up(c.ms), f"{_HANDSHAKE} ({c.connection})")
            for c in r.late
            if c.connection
        ),
        ("both late, then lost", _up(r.disturbed), f"{_HANDSHAKE}; not in the verdict"),
    ]


def _ms(value: float | None) -> str:
    return "not stated" if value is None else f"{value:.1f} ms"


def _up(value: float | None) -> str:
    """Format a time or a minimum, rounded up: 49.94 ms as 50.0 ms."""
    return _ms(None if value is None else outward(value, 1, up=True))


def _down(value: float | None) -> str:
    """Format a maximum, rounded down: 49.96 ms as 49.9 ms."""
    return _ms(None if value is None else outward(value, 1, up=False))


def _limit(limit: Limit | None, way: Callable[[float], str]) -> str:
    return "-" if limit is None else way(limit.ms)


def _quantity(quantity: Quantity) -> str:
    if quantity.value is None:
        return "not stated"
    number = f"{quantity.value:g} {quantity.unit}"
    if quantity.needs_reason:
        return f"{number} (no reason)"
    return number if quantity.answered_for else f"{number} (unverified)"


def _claim(row: ElementRow) -> str:
    e = row.element
    said = [
        "not stated" if row.has_no_claim else row.claim,
        f"category {e.category}" if e.category else "",
        "" if e.mission_years is None else f"{e.mission_years:g} years",
    ]
    return ", ".join(w for w in said if w) or "needs none"


# -- JSON -----------------------------------------------------------------------------------------


def budget_json(budget: Budget) -> dict[str, Any]:
    """Return the budget as plain data; times in ms, PFH per hour, ``None`` if open."""
    return {
        "cycle_ms": budget.cycle,
        "copy_cycles": budget.copy_cycles,
        "buses": [{"name": name, "cycle_ms": ms} for name, ms in budget.buses],
        "drift": budget.drift,
        "connections": [_connection_json(c) for c in budget.connections],
        "functions": [_function_json(f) for f in budget.functions],
    }


def _limit_json(limit: Limit | None) -> dict[str, Any] | None:
    return None if limit is None else {"ms": limit.ms, "why": limit.why}


def _connection_json(c: WatchdogBudget) -> dict[str, Any]:
    return {
        "name": c.connection.name,
        "watchdog_ms": c.configured,
        "round_trip_ms": c.round_trip,
        "measured_round_trip_ms": c.measured,
        "least": _limit_json(c.least),
        "greatest": _limit_json(c.greatest),
        "greatest_printed": _limit_json(c.printed),
        "greatest_handshake": _limit_json(c.handshake),
        "empty": c.empty,
        "judgement": c.judgement.value,
        "verdict": c.verdict,
        "margin": c.margin,
        "lost_cycles_survived": c.lost_frames,
        "functions": list(c.functions),
        "spdus_per_hour": c.spdus_per_hour,
    }


def _quantity_json(q: Quantity) -> dict[str, Any]:
    return {
        "value": q.value,
        "unit": q.unit,
        "source": q.source,
        "unverified": not q.answered_for,
        "needs_reason": q.needs_reason,
    }


def _element_json(row: ElementRow) -> dict[str, Any]:
    e = row.element
    return {
        "kind": e.kind.value,
        "sub": e.sub or None,
        "name": e.name,
        "time": _quantity_json(row.time),
        "pfh": _quantity_json(row.pfh),
        "claim": {"pl": e.pl or None, "sil": e.sil, "unverified": not row.claim_answered_for},
        "category": e.category or None,
        "mission_years": e.mission_years,
    }


def _level_json(claim: LevelClaim) -> dict[str, Any]:
    return {
        "required": claim.required or None,
        "lowest": claim.lowest or None,
        "weakest": list(claim.weakest),
        "by_sum_alone": claim.by_sum or None,
        "missing": list(claim.missing),
        "unverified": list(claim.unverified),
        "judgement": claim.judgement.value,
        "verdict": claim.verdict,
    }


def _case_json(case: ResponseCase) -> dict[str, Any]:
    return {"way": case.way, "connection": case.connection or None, "ms": case.ms}


def _function_json(row: FunctionBudget) -> dict[str, Any]:
    f, r = row.function, row.reaction
    # Without all times there is no sum; `missing` then names the missing ones.
    reaction = None
    if r is not None:
        reaction = {
            "error_free_ms": r.error_free,
            "typical_ms": r.typical,
            "worst_input_ms": r.worst_input,
            "worst_output_ms": r.worst_output,
            "worst_etg_ms": r.worst_etg,
            "worst_beckhoff_ms": r.worst_beckhoff,
            "handshake_error_free_ms": r.polled,
            "handshake_one_breaks_ms": r.broken,
            "handshake_one_disturbed": [_case_json(c) for c in r.late if c.connection],
            "handshake_both_disturbed_ms": r.disturbed,
            "watchdog_in_ms": r.watchdog_in,
            "watchdog_out_ms": r.watchdog_out,
            "decides": _case_json(r.decides),
        }
    return {
        "name": f.name,
        "trigger": f.trigger,
        "reaction": f.reaction,
        "required_reaction_ms": f.required_reaction_ms,
        "required": {"pl": f.pl or None, "sil": f.sil},
        "elements": [_element_json(e) for e in row.parts.rows],
        "connections": sorted({c.name for c in (*row.parts.to_input, *row.parts.to_output)}),
        "times": reaction,
        "missing": list(row.missing),
        "judgement": row.judgement.value,
        "verdict": row.verdict,
        "pfh": {
            "total": row.pfh.total,
            "fsoe": row.pfh.fsoe,
            "limit": row.pfh.limit,
            "missing": list(row.pfh.missing),
            "unverified": list(row.pfh.unverified),
            "judgement": row.pfh.judgement.value,
            "verdict": row.pfh.verdict,
        },
        "levels": [_level_json(claim) for claim in row.levels],
    }


# -- picture --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Curve:
    name: str
    points: tuple[tuple[float, float], ...]


def budget_picture(budget: Budget, title: str) -> str:
    """Draw reaction times of each judged function over the bus cycle and over its watchdogs.

    Curves differ in colour, dashes and marks and have labels, so no colour is needed.
    """
    return _svg([p for row in budget.functions for _, p in _panels(budget, row)], title)


def reaction_pictures(budget: Budget, row: FunctionBudget) -> list[tuple[str, str]]:
    """Return the content of `budget_picture` for one function, each panel as title and picture."""
    return [(title, _svg([panel], title, head=0)) for title, panel in _panels(budget, row)]


def _panels(budget: Budget, row: FunctionBudget) -> list[tuple[str, str]]:
    r, times, cycle = row.reaction, row.times, budget.cycle
    if r is None or times is None or cycle is None:
        return []
    over = "over the bus cycle, ms"
    if budget.buses:
        over = f"over the bus cycle of {budget.buses[0][0]}, ms, all buses in proportion"
    # Other bus cycles scale the parts that depend on the bus, not the times of devices.
    scaled = {c: times.with_ways(partial(SignalWay.scaled, factor=c / cycle)) for c in _CYCLES}
    found = [(over, _curves(row, scaled), cycle)]
    watchdog = max(r.watchdog_in or 0.0, r.watchdog_out or 0.0)
    # Without a watchdog there is no axis to scale.
    if watchdog:
        shares = [n / 10 for n in range(1, 21)]
        watched = {watchdog * s: times.with_ways(partial(_watched, share=s)) for s in shares}
        over = "over the longest watchdog, ms, all in proportion"
        found.append((over, _curves(row, watched), watchdog))
    name = row.function.name
    return [
        (f"Reaction times of {name} {over}", _panel(f"{name}: {over}", curves, here=here))
        for over, curves, here in found
    ]


def _watched(way: SignalWay, share: float) -> SignalWay:
    return replace(way, watchdog=share * way.watchdog)


def _svg(panels: Sequence[str], title: str, head: int = 34) -> str:
    """Return panels below each other; ``head``: height of a line for the title, 0 for none."""
    height = _HEIGHT * max(1, len(panels)) + head
    body = "".join(
        f'<g transform="translate(0 {head + n * _HEIGHT})">{p}</g>' for n, p in enumerate(panels)
    )
    heading = svg_text(20, 22, title, "start") if head else ""
    if not panels:
        body = svg_text(20, 80, "no safety function has a reaction time", "start")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="budget" viewBox="0 0 {_WIDTH} {height}" '
        f'role="img" aria-label="{escape(title)}"><title>{escape(title)}</title>'
        f"<style>{_STYLE}</style>"
        f'<rect class="back" width="{_WIDTH}" height="{height}"/>{heading}'
        f"{body}</svg>\n"
    )


def _curves(row: FunctionBudget, times: Mapping[float, PartTimes]) -> list[_Curve]:
    """Return the response times of a function for other times, with their positions."""
    found = [(x, reaction_of(t)) for x, t in times.items()]
    curves = [
        _Curve("error-free", tuple((x, r.error_free) for x, r in found)),
        _Curve("ETG.5100, one failure", tuple((x, r.worst_etg) for x, r in found)),
        _Curve("Beckhoff, two watchdogs", tuple((x, r.worst_beckhoff) for x, r in found)),
        _Curve("FSoE handshake, one late", tuple((x, r.decides.ms) for x, r in found)),
    ]
    required = row.function.required_reaction_ms
    if required is not None:
        curves.append(_Curve("required", tuple((x, required) for x in times)))
    return curves


def _ticks(most: float) -> Iterable[float]:
    step = 1.0
    while most / step > 6:
        step *= 2.5 if str(step)[0] == "2" and step != 2.5 else 2
    n = 0
    while n * step <= most:
        yield n * step
        n += 1


def _panel(title: str, curves: Sequence[_Curve], *, here: float) -> str:
    # All curves share one scale, so that heights can be compared.
    right = max(x for c in curves for x, _ in c.points)
    top = 1.05 * max(y for c in curves for _, y in c.points)
    wide, tall = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM

    def at(x: float, y: float) -> tuple[float, float]:
        return _LEFT + wide * x / right, _TOP + tall * (1 - y / top)

    parts = [svg_text(_LEFT, 16, title, "start")]
    for y in _ticks(top):
        _, place = at(0, y)
        parts.append(
            f'<line class="grid" x1="{_LEFT}" y1="{place:.1f}" x2="{_LEFT + wide}" '
            f'y2="{place:.1f}"/>{svg_text(_LEFT - 6, place + 4, f"{y:g} ms", "end", "small")}'
        )
    for x in _ticks(right):
        place, _ = at(x, 0)
        parts.append(svg_text(place, _TOP + tall + 16, f"{x:g}", "middle", "small"))
    place, _ = at(min(here, right), 0)
    parts.append(
        f'<line class="here" x1="{place:.1f}" y1="{_TOP}" x2="{place:.1f}" y2="{_TOP + tall}"/>'
        + svg_text(place, _TOP + tall + 32, f"now {here:g}", "middle", "small")
    )
    parts.append(
        f'<line class="axis" x1="{_LEFT}" y1="{_TOP + tall}" x2="{_LEFT + wide}" '
        f'y2="{_TOP + tall}"/>'
    )
    # From top to bottom, so that overlapping labels move in one direction.
    ends = sorted(curves, key=lambda c: -c.points[-1][1])
    places = _apart([at(0, c.points[-1][1])[1] for c in ends], _TOP + tall)
    for curve, label_y in zip(ends, places, strict=True):
        # Dash and mark in addition to colour: a printed page may be black and white.
        dash, colour, mark = _LOOKS[curve.name]
        spots = [at(x, y) for x, y in curve.points]
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in spots)
        parts.append(
            f'<polyline class="line" stroke="{colour}" stroke-dasharray="{dash}" points="{line}"/>'
        )
        x, y = spots[-1]
        drawn = [*spots[len(spots) // 2 : -1 : len(spots)], (x, y), (x + 22, label_y)]
        parts.append(
            f'<line class="lead" x1="{x + 6:.1f}" y1="{y:.1f}" x2="{x + 16:.1f}" '
            f'y2="{label_y:.1f}"/>'
        )
        parts += [
            f'<path class="mark" stroke="{colour}" transform="translate({mx:.1f} {my:.1f})" '
            f'd="{mark}"/>'
            for mx, my in drawn
        ]
        parts.append(
            f'<text class="name" style="fill:{colour};font-size:11px" x="{x + 32:.1f}" '
            f'y="{label_y + 4:.1f}">{escape(curve.name)}</text>'
        )
    return "".join(parts)


def _apart(wanted: Sequence[float], bottom: float) -> list[float]:
    """Return label positions from top to bottom, close to the wanted ones without touching."""
    found: list[float] = []
    for y in wanted:
        found.append(max(y, found[-1] + _LABEL) if found else y)
    floor = bottom
    for n in range(len(found) - 1, -1, -1):
        found[n] = min(found[n], floor)
        floor = found[n] - _LABEL
    return found
