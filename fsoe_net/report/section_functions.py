"""A page for each safety function, and a matrix of causes and effects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from fsoe_net.diag.words import counted, listed
from fsoe_net.document.model import (
    BLANK,
    Cell,
    Column,
    Heading,
    Item,
    Level,
    Number,
    Paragraph,
    Part,
    Table,
    Text,
    Verdict,
    cell,
    muted,
    stated,
    strong,
)
from fsoe_net.model.safety import ElementKind, SafetyFunction, level_words
from fsoe_net.model.test_record import StepKind, TestStep
from fsoe_net.report.function_picture import function_picture
from fsoe_net.report.inputs import ReportInputs
from fsoe_net.report.model import ReportSection, open_point
from fsoe_net.report.section_quantities import claim_cell, mission_cell, shortest_mission
from fsoe_net.report.section_safe_bits import safe_bits
from fsoe_net.report.section_tests import by_hand, limit, who
from fsoe_net.report.section_timing import JUDGED, quantity_cell, upper_bound
from fsoe_net.timing.claims import LevelClaim
from fsoe_net.timing.reaction import FunctionBudget

_EFFECTS_BESIDE = 6  # columns that a printed page has room for


def function_label(number: int) -> str:
    """Return the name of a safety function in tables: ``SF1`` …."""
    return f"SF{number}"


def function_pages(inputs: ReportInputs) -> list[ReportSection]:
    """Return a section for each safety function, in the order of the network file."""
    budget = inputs.budget
    if budget is None:
        return []
    connections = [c.connection for c in budget.connections]
    return [
        _page(number, row, safe_bits(row.function, connections), inputs)
        for number, row in enumerate(budget.functions, 1)
    ]


def _page(
    number: int, row: FunctionBudget, bits: Sequence[Part], inputs: ReportInputs
) -> ReportSection:
    f = row.function
    points = [
        open_point(words)
        for words, text in (("no reset is stated", f.reset), ("no modes are stated", f.modes))
        if not text
    ]
    parts: list[Part] = [
        function_picture(row),
        _facts(row),
        Heading("Parts"),
        _parts(row),
        *shortest_mission(row),
    ]
    parts += [*bits, Heading("Tests at the machine"), _tests(row, inputs), _sign()]
    return ReportSection(
        key=f"function_{number}",
        title=f"{function_label(number)} {f.name}",
        parts=tuple(parts),
        points=tuple(points),
        page=True,
    )


def _facts(row: FunctionBudget) -> Table:
    f = row.function
    used = sorted({c.name for c in (*row.parts.to_input, *row.parts.to_output)})
    facts: list[tuple[str, Cell]] = [
        ("Trigger", _said(f.trigger)),
        ("Reaction", _said(f.reaction)),
        ("Reset", _said(f.reset)),
        ("Modes", _said(f.modes)),
        ("FSoE connections", cell(", ".join(used) or muted("none"))),
        ("Required", cell(_required(f), stated(f.required_reaction_ms, "ms", "network file"))),
        ("Claimed", tuple(i for claim in row.levels for i in _claimed(claim))),
        ("Sum of PFH", cell(Verdict(row.pfh.verdict, JUDGED[row.pfh.judgement]))),
        ("Calculated time", (Verdict(row.verdict, JUDGED[row.judgement]), *_without_fault(row))),
    ]
    return Table(
        name=f"facts of {f.name}",
        columns=(Column("What", share=18), Column("Value", share=82)),
        rows=tuple((cell(strong(what)), value) for what, value in facts),
    )


def _without_fault(row: FunctionBudget) -> Cell:
    """Return the response time without a fault: a longer measured time is a fault."""
    if row.reaction is None:
        return ()
    unit = "ms at most without a fault"
    number = upper_bound(row.reaction.polled, "derived: docs/explanation/timing.md")
    return (replace(number, unit=unit) if isinstance(number, Number) else number,)


def _said(text: str) -> Cell:
    return cell(text or Verdict("not stated", Level.OPEN))


def _required(f: SafetyFunction) -> Item:
    levels = level_words(f)
    return Text(" and ".join(levels)) if levels else Verdict("not stated", Level.OPEN)


def _claimed(claim: LevelClaim) -> Iterator[Item]:
    yield Verdict(claim.verdict, JUDGED[claim.judgement])
    if claim.sum_words:
        yield Verdict(claim.sum_words, Level.NOTE)


def _parts(row: FunctionBudget) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for e in row.parts.rows:
        time = "" if e.time.value is None else f"{e.time.value:g}"
        pfh = "" if e.pfh.value is None else f"{e.pfh.value:.2e}"
        rows.append(
            (
                cell(e.element.kind.value),
                cell(strong(e.element.name)),
                quantity_cell(e.time, time),
                quantity_cell(e.pfh, pfh),
                claim_cell(e),
                cell(e.element.category or muted("not stated")),
                mission_cell(e.element),
            )
        )
    # FSoE is part of the sum although it is not listed as an element.
    if row.pfh.fsoe:
        fsoe = stated(
            row.pfh.fsoe, "1/h", "Beckhoff, Application Guide TwinSAFE", f"{row.pfh.fsoe:.2e}"
        )
        rows.append((cell("bus"), cell("Safety over EtherCAT"), (), (fsoe,), (), (), ()))
    # The sum is repeated here so that a reader can add up the column.
    total = stated(row.pfh.total, "1/h", "sum of the rows above", f"{row.pfh.total:.2e}")
    lowest: Cell = tuple(strong(c.lowest) for c in row.levels if c.lowest)
    end = cell(*lowest, muted("lowest claim")) if lowest else ()
    rows.append((cell(strong("sum")), (), (), (total,), end, (), ()))
    return Table(
        name=f"parts of {row.function.name}",
        columns=(
            Column("Part"),
            Column("Element"),
            Column("Time", number=True),
            Column("PFH", number=True),
            Column("Claim"),
            Column("Category"),
            Column("Mission time", number=True),
        ),
        rows=tuple(rows),
    )


def function_test(row: FunctionBudget, inputs: ReportInputs) -> Verdict:
    """Summarise the result of a safety function's trigger at the machine."""
    # Only the trigger tests the function as a whole; other steps test its parts.
    steps = [s for s in _steps(row, inputs) if s.kind is StepKind.TRIGGER]
    # From worst to best: one failed step outweighs all others.
    if any(s.is_failed for s in steps):
        return Verdict("FAILED", Level.ERROR)
    if any(s.is_disputed for s in steps):
        return Verdict("disputed by a program", Level.OPEN)
    if not steps or any(s.is_open for s in steps):
        return Verdict("NOT TESTED", Level.OPEN)
    times = ", ".join(f"{t:g} ms" for s in steps if (t := s.machine.measured_ms) is not None)
    return Verdict(f"as expected{', ' if times else ''}{times}", Level.CLEAR)


def _steps(row: FunctionBudget, inputs: ReportInputs) -> Sequence[TestStep]:
    """Return the steps at the machine for a function, its connections and its SubDevices."""
    tried = inputs.tried
    # A record of another configuration proves nothing about this one.
    if tried is None or not tried.fits:
        return ()
    subjects = {
        StepKind.TRIGGER: {row.function.name},
        StepKind.START_UP: {c.name for c in (*row.parts.to_input, *row.parts.to_output)},
        StepKind.LOSS: {e.element.sub for e in row.parts.rows},
    }
    return [s for s in tried.test_record.steps if s.subject in subjects.get(s.kind, ())]


def _tests(row: FunctionBudget, inputs: ReportInputs) -> Part:
    steps = _steps(row, inputs)
    if not steps or inputs.tried is None:
        return Paragraph((Verdict("NOT TESTED", Level.OPEN), Text(": no test record of it.")))
    source = inputs.tried.source.path
    rows = [
        (
            cell(s.what, muted(s.expected)),
            limit(s, source),
            by_hand(s, source),
            who(s),
        )
        for s in steps
        if s.kind is StepKind.TRIGGER
    ]
    # Start-up and loss are steps of connections and SubDevices; one row summarises them.
    for kind in (StepKind.START_UP, StepKind.LOSS):
        same = [s for s in steps if s.kind is kind]
        if same:
            word = f"{kind.value.replace('_', '-')} of {listed([s.subject for s in same])}"
            people = ", ".join(dict.fromkeys(s.machine.who for s in same if s.machine.who))
            rows.append((cell(word), (), cell(_together(same)), cell(people)))
    return Table(
        name=f"tests of {row.function.name}",
        columns=(
            Column("Step", share=40),
            Column("At most", share=10),
            Column("MACHINE, by hand", share=28),
            Column("Who, when", share=22),
        ),
        rows=tuple(rows),
        remark="The checklist has each start-up and loss, and room to write.",
    )


def _together(steps: Sequence[TestStep]) -> Verdict:
    """Return the number of steps with the expected result, or the objections to them."""
    failed, left = sum(s.is_failed for s in steps), sum(s.is_open for s in steps)
    of = f"of {counted(len(steps), 'step')}"
    if failed:
        return Verdict(f"{failed} {of} FAILED", Level.ERROR)
    if left:
        return Verdict(f"{left} {of} open", Level.OPEN)
    if any(s.is_disputed for s in steps):
        return Verdict("disputed by a program", Level.OPEN)
    return Verdict(f"{len(steps)} {of} as expected", Level.CLEAR)


def _sign() -> Table:
    heads = ("Verified for this function by", "Date", "Signature")
    return Table(
        name="signature",
        columns=tuple(Column(head) for head in heads),
        rows=((BLANK, BLANK, BLANK),),
    )


# -- causes and effects ---------------------------------------------------------------------------


def causes_and_effects(inputs: ReportInputs) -> ReportSection:
    """Return which sensor acts on which actuator, by which safety function."""
    key, title = "causes_and_effects", "Causes and effects"
    rows = () if inputs.budget is None else inputs.budget.functions
    # Ordered by first mention, because people list functions by importance.
    acts: dict[str, dict[str, list[str]]] = {}
    effects: dict[str, None] = {}
    for number, row in enumerate(rows, 1):
        ends = _names(row, ElementKind.ACTUATOR, ElementKind.OUTPUT)
        effects |= dict.fromkeys(ends)
        for cause in _names(row, ElementKind.SENSOR, ElementKind.INPUT):
            for effect in ends:
                acts.setdefault(cause, {}).setdefault(effect, []).append(function_label(number))
    if not acts:
        words = "No safety function with sensors and actuators is stated."
        return ReportSection(key=key, title=title, parts=(Paragraph((Text(words),)),))
    names = list(effects)
    # Too many columns do not fit on a page: the matrix continues in another table.
    tables = [
        _matrix(acts, names[at : at + _EFFECTS_BESIDE], at)
        for at in range(0, len(names), _EFFECTS_BESIDE)
    ]
    return ReportSection(key=key, title=title, parts=tuple(tables), page=True)


def _names(row: FunctionBudget, kind: ElementKind, otherwise: ElementKind) -> list[str]:
    """Return elements of a kind by name; if there are none, those of the other kind."""
    for wanted in (kind, otherwise):
        found = [e.element.name for e in row.parts.rows if e.element.kind is wanted]
        if found:
            return found
    return []


def _matrix(acts: dict[str, dict[str, list[str]]], names: Sequence[str], at: int) -> Table:
    share = 70 // _EFFECTS_BESIDE
    return Table(
        name=f"causes and effects {at // _EFFECTS_BESIDE + 1}",
        columns=(
            Column("Cause: sensor, input", share=100 - share * len(names)),
            *(Column(name, share=share) for name in names),
        ),
        rows=tuple(
            (cell(strong(cause)), *(cell(*by.get(name, [])) for name in names))
            for cause, by in acts.items()
            if not by.keys().isdisjoint(names)
        ),
        remark="The other columns are effects: actuators, or outputs where no actuator is stated.",
    )
