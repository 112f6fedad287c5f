"""Block 6: watchdogs, and reaction times by both methods."""

from __future__ import annotations

from fsoe_net.diag.words import counted
from fsoe_net.document.model import (
    Bullets,
    Cell,
    Column,
    Heading,
    Item,
    Level,
    Paragraph,
    Part,
    Picture,
    Table,
    Text,
    Verdict,
    cell,
    decimal,
    muted,
    number_of,
    outward,
    stated,
    strong,
)
from fsoe_net.report.budget import reaction_pictures
from fsoe_net.report.inputs import ReportInputs
from fsoe_net.report.measured_cycle import measured_cycle
from fsoe_net.report.model import Point, ReportSection, assumption, open_point
from fsoe_net.timing.budget import Budget
from fsoe_net.timing.elements import Quantity
from fsoe_net.timing.judgement import Judgement, WatchdogJudgement
from fsoe_net.timing.reaction import FunctionBudget, Reaction
from fsoe_net.timing.watchdogs import Limit, WatchdogBudget

_ETG = "ETG.5100 chapter 9.3 as printed by Lenze (i750)"
_BECKHOFF = "Beckhoff, manuals of EL2904, EL6900, EK1914, EP1957"
_HANDSHAKE = "derived: fsoe_net.timing.handshake, docs/explanation/timing.md"
_FILE = "network file"
JUDGED = dict.fromkeys(Judgement, Level.OPEN) | {
    Judgement.WITHIN: Level.CLEAR,
    Judgement.ABOVE: Level.ERROR,
}
_WATCHDOGS = dict.fromkeys(WatchdogJudgement, Level.OPEN) | {
    WatchdogJudgement.WITHIN: Level.CLEAR,
    WatchdogJudgement.UNLIMITED: Level.NOTE,
    WatchdogJudgement.EMPTY: Level.ERROR,
    WatchdogJudgement.BELOW: Level.ERROR,
    WatchdogJudgement.ABOVE: Level.ERROR,
}


# -- 6 timing -------------------------------------------------------------------------------------


def timing(inputs: ReportInputs) -> ReportSection:
    """Return watchdogs with their permitted intervals, and reaction times of each function."""
    title = "Timing"
    budget = inputs.budget
    if budget is None:
        return ReportSection(
            key="timing",
            title=title,
            parts=(Paragraph((Text("No network could be read: nothing is judged."),)),),
            points=(open_point("timing is not judged"),),
        )
    points = _assumed(budget)
    parts: list[Part] = [_basis(budget), *measured_cycle(inputs)]
    parts += [Heading("Watchdogs"), _watchdogs(budget), *_reasons(budget)]
    if budget.functions:
        parts += [Heading("Reaction times"), _reactions(budget)]
        for row in budget.functions:
            # Missing values make a reaction time unknown, not zero.
            points += [open_point(f"{row.function.name}: {words}") for words in row.missing]
            # Values of the library are unverified until a person takes responsibility for them.
            if row.parts.unverified:
                names = ", ".join(row.parts.unverified)
                words = f"{row.function.name}: values without a responsible person: {names}"
                points.append(open_point(words))
            if row.function.required_reaction_ms is None:
                words = f"{row.function.name}: no required reaction time is stated"
                points.append(open_point(words))
            parts += _pictures(budget, row)
    else:
        parts.append(
            Paragraph((Text("No safety function is stated: no reaction time is judged."),))
        )
        points.append(open_point("no safety_functions in the network file: nothing is judged"))
    return ReportSection(key="timing", title=title, parts=tuple(parts), points=tuple(points))


def _pictures(budget: Budget, row: FunctionBudget) -> list[Picture]:
    """Draw one function; a common picture would be cut at the end of a page."""
    words = (
        "Error-free: solid, circle; ETG.5100: dashed, square; Beckhoff: dotted, triangle; FSoE "
        "handshake, one connection late: diamond; required: dash and dot, cross. The upright "
        "dotted line is the configuration"
    )
    return [
        Picture(title=title, words=words, svg=svg) for title, svg in reaction_pictures(budget, row)
    ]


def _assumed(budget: Budget) -> list[Point]:
    drift = (
        f"clocks of devices are at most {100 * budget.drift:g} % slow"
        if budget.drift
        else "clocks of devices are exact"
    )
    return [
        assumption(
            f"a frame needs {counted(budget.copy_cycles, 'bus cycle')} per direction: true "
            f"for fsn-master, "
            "which copies in the cycle of arrival; a program that copies a cycle later needs 3"
        ),
        *_across(budget),
        assumption(drift),
        assumption("times of elements are the longest their sources state; none was measured here"),
    ]


def _across(budget: Budget) -> list[Point]:
    if not budget.buses:
        return []
    cycles = ", ".join(f"{name} {ms:g} ms" for name, ms in budget.buses)
    return [
        assumption(
            f"several buses ({cycles}): a frame that crosses waits for one cycle of its own bus, "
            "needs another, and waits for one of each bus that takes it over"
        )
    ]


def _basis(budget: Budget) -> Paragraph:
    return Paragraph(
        (
            Text("Bus cycle T_Com "),
            stated(budget.cycle, "ms", _FILE),
            Text("; copy factor k "),
            stated(budget.copy_cycles, "bus cycles per direction", "copy engine of fsn-master"),
            Text("; drift of clocks "),
            stated(100 * budget.drift, "%", "option of the budget"),
            Text(". T_S, T_I, T_L, T_O, T_A: times of sensor, input, logic, output, actuator."),
        )
    )


def _limit(limit: Limit | None, *, up: bool = False) -> Cell:
    return cell(muted("nothing asks") if limit is None else upper_bound(limit.ms, limit.why, up=up))


def upper_bound(value: float | None, source: str, *, up: bool = True) -> Item:
    """Return a time that is compared with a limit, rounded to the unfavourable side."""
    text = "" if value is None else decimal(outward(value, up=up))
    return stated(value, "ms", source, text)


def _watchdogs(budget: Budget) -> Table:
    rows = [
        (
            cell(strong(c.connection.name), *(muted(f) for f in c.functions)),
            cell(stated(c.configured, "ms", "connections of the network file")),
            _limit(c.least, up=True),
            _limit(c.printed),
            _limit(c.handshake),
            cell(_margin(c)),
            cell(_lost(c)),
            cell(Verdict(c.verdict, _WATCHDOGS[c.judgement])),
        )
        for c in budget.connections
    ]
    return Table(
        name="watchdogs",
        columns=(
            Column("Connection"),
            Column("Configured", number=True),
            Column("At least", number=True),
            Column("At most, as printed", number=True),
            Column("At most, handshake counted", number=True),
            Column("Margin", number=True),
            Column("Lost bus cycles survived", number=True),
            Column("Verdict"),
        ),
        rows=tuple(rows),
        remark="Each connection counts its own device, its own way and its own watchdog. At "
        "least: 1.2 x the longest round trip, for availability. At most: "
        "what the required reaction times leave, as both methods print it (the smaller), and when "
        "this connection is late up to its watchdog and then lost, the handshake of FSoE counted; "
        "the smaller one counts. Margin: configured over least.",
    )


def _margin(c: WatchdogBudget) -> Item:
    if c.margin is None:
        return muted("not judged")
    return stated(c.margin, "x least", "configured / least", f"{c.margin:.1f}")


def _lost(c: WatchdogBudget) -> Item:
    if c.lost_frames is None:
        return muted("not judged")
    source = "(watchdog - round trip - 1 ms) / T_Com of the slowest bus on its way"
    return number_of(c.lost_frames, "cycle", source)


def _reasons(budget: Budget) -> list[Part]:
    rows: list[tuple[Item, ...]] = []
    for c in budget.connections:
        for word, limit in (
            ("at least", c.least),
            ("at most", c.printed),
            ("at most", c.handshake),
        ):
            if limit is not None:
                rows.append(
                    (
                        Text(f"{c.connection.name} {word} "),
                        upper_bound(limit.ms, limit.why, up=limit is c.least),
                        Text(f": {limit.why}"),
                    )
                )
    return [Heading("What limits each watchdog"), Bullets(tuple(rows))] if rows else []


def _reactions(budget: Budget) -> Table:
    rows = []
    for row in budget.functions:
        r, required = row.reaction, row.function.required_reaction_ms
        # The two methods come from different documents and must not be mixed in one column.
        etg, typical = _ETG, _BECKHOFF
        rows.append(
            (
                cell(strong(row.function.name)),
                cell(upper_bound(r.error_free if r else None, etg)),
                cell(upper_bound(r.worst_etg if r else None, etg)),
                cell(upper_bound(r.typical if r else None, typical)),
                cell(upper_bound(r.worst_beckhoff if r else None, typical)),
                _late(r),
                cell(upper_bound(r.disturbed if r else None, _HANDSHAKE)),
                cell(stated(required, "ms", "risk assessment, as the network file states it")),
                cell(Verdict(row.verdict, JUDGED[row.judgement])),
            )
        )
    return Table(
        name="reaction times",
        columns=(
            Column("Safety function"),
            Column("ETG: error-free", number=True),
            Column("ETG: worst case, one failure", number=True),
            Column("Beckhoff: typical", number=True),
            Column("Beckhoff: worst case, two watchdogs", number=True),
            Column("FSoE: one connection late, then lost", number=True),
            Column("FSoE: both late, then lost", number=True),
            Column("Required", number=True),
            Column("Verdict"),
        ),
        rows=tuple(rows),
        remark="Both methods stand side by side and do not agree. Neither counts the handshake of "
        "FSoE, in which a value may have to wait for its turn. One connection that is late up to "
        "its watchdog and is lost then is a single fault. The longest of these cases and the "
        "printed worst cases is judged, and the verdict names it. Both connections late and lost "
        "is shown and not judged.",
    )


def _late(r: Reaction | None) -> Cell:
    """Return the response of each connection for a late and a lost frame; the judged one first."""
    if r is None:
        return cell(upper_bound(None, _HANDSHAKE))
    items: list[Item] = []
    for case in sorted(r.late, key=lambda c: -c.ms):
        if case.connection or case is r.decides:
            items += [upper_bound(case.ms, _HANDSHAKE), muted(case.way)]
    return cell(*items)


def quantity_cell(q: Quantity, text: str = "") -> Cell:
    """Return a value with its unit, and whether a person confirms it."""
    if q.value is None:
        return cell(Verdict("not stated", Level.OPEN))
    number = stated(q.value, q.unit, q.source or "no source", text)
    if q.answered_for:
        return (number,)
    return (number, Verdict("0 without a reason" if q.needs_reason else "unverified", Level.OPEN))
