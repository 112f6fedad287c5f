"""The tests: the checklist, and separately the runs on the emulated bus."""

from __future__ import annotations

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
    number_of,
    stated,
    strong,
)
from fsoe_net.model.test_record import AtMachine, StepOutcome, StepResult, TestStep
from fsoe_net.report.inputs import ReportInputs, Tried
from fsoe_net.report.model import Point, ReportSection, open_point
from fsoe_net.report.section_evidence import EMULATED, RUN_COLUMNS, plan_sha256
from fsoe_net.report.section_identity import files_table

if TYPE_CHECKING:
    from fsoe_net.live.result import Run


def tests(inputs: ReportInputs) -> ReportSection:
    """Return the checklist, and separately the runs on the emulated bus."""
    parts: list[Part] = [Heading("Checklist")]
    points: list[Point] = []
    tried = inputs.tried
    # A missing record is an open point, not an error: the report can be created before the tests.
    if tried is None:
        parts.append(Paragraph((Text("The checklist is empty: no test record was given."),)))
        points.append(open_point("no test record: nothing was tried at the machine"))
    else:
        parts += [files_table("test record", [tried.source]), _checklist(tried)]
        points += _left(tried, inputs)
        # A record of another network stays visible, but none of its results count.
        if not tried.fits:
            word = f"{tried.source.path} cannot be taken for this network"
            parts.append(Paragraph((Verdict(word, Level.ERROR), Text(": see the open points."))))
        points += [open_point(f"{tried.source.path}:{note}") for note in tried.notes]
    parts += _circumstances(inputs)
    if inputs.run is not None:
        parts += _emulated_run(inputs.run)
    # A network with errors has no plan that could run.
    elif inputs.scenario:
        words = f"{inputs.scenario} was not run: the network has errors"
        parts += [Heading("Run on the emulated bus"), Paragraph((Text(f"{words}."),))]
        points.append(open_point(words))
    return ReportSection(key="tests", title="Tests", parts=tuple(parts), points=tuple(points))


def _left(tried: Tried, inputs: ReportInputs) -> list[Point]:
    """Return steps open at the machine, failed or disputed steps, and a differing plan."""
    points = []
    test_record = tried.test_record
    left = len(test_record.open_steps)
    if left:
        steps = counted(len(test_record.machine_steps), "test step")
        words = f"{left} of {steps} open at the machine"
        points.append(open_point(words))
    failed = test_record.failed_steps
    if failed:
        words = (
            f"{counted(len(failed), 'test step')} did not go as expected, first: {failed[0].what}"
        )
        points.append(open_point(words))
    disputed = test_record.disputed_steps
    if disputed:
        words = (
            f"{counted(len(disputed), 'test step')} went as expected by hand and not by "
            f"program, first: "
            f"{disputed[0].what}"
        )
        points.append(open_point(words))
    if test_record.plan_sha256 != plan_sha256(inputs):
        words = f"{tried.source.path} was made for another plan"
        points.append(open_point(words))
    return points


def _circumstances(inputs: ReportInputs) -> list[Part]:
    """Return equipment, environment and attachments of the acceptance record."""
    given = inputs.accepted
    # Circumstances of another configuration do not apply to these tests.
    if given is None or not given.fits:
        return []
    record = given.record
    left = cell(muted("not stated"))
    people = (("author", record.author), ("verifier", record.verifier))
    rows = (
        *(
            (cell(strong(f"Competence of the {role}")), cell(p.competence or muted("not stated")))
            for role, p in people
        ),
        (cell(strong("Test equipment")), cell(*record.equipment) or left),
        (cell(strong("Environment")), cell(record.environment) if record.environment else left),
    )
    columns = (Column("What", share=20), Column("As accepted", share=80))
    parts: list[Part] = [
        Heading("Competence, equipment and environment"),
        Table(name="circumstances", columns=columns, rows=rows),
    ]
    if record.attachments:
        parts += [Heading("Attachments"), files_table("attachments", record.attachments)]
    return parts


_CHECKLIST = (
    Column("What to do", share=17),
    Column("Expected", share=18),
    Column("At most", share=7),
    Column("EMULATED", share=9),
    Column("LIVE, by program", share=9),
    Column("MACHINE, by hand", share=21),
    Column("Who, when", share=19),
)
"""Columns filled in by hand take most of the width."""


def _checklist(tried: Tried) -> Table:
    source = tried.source.path
    rows = tuple(
        (
            cell(s.what),
            cell(s.expected),
            limit(s, source),
            _result(s.emulated, source),
            _result(s.live, source),
            by_hand(s, source),
            who(s),
        )
        for s in tried.test_record.steps
    )
    return Table(
        name="checklist",
        columns=_CHECKLIST,
        rows=rows,
        remark="EMULATED: on an emulated bus, not evidence for this machine. Only what a person "
        "wrote down at the machine closes a step.",
    )


def limit(s: TestStep, source: str) -> Cell:
    """Return the time limit of a step in ms, or that there is none."""
    if s.limit_ms is None:
        return cell(muted("no limit"))
    return cell(stated(s.limit_ms, "ms", s.limit_source or source))


def by_hand(s: TestStep, source: str) -> Cell:
    """Return the entries of a person at the machine, or blank fields for them."""
    if not s.kind.at_machine:
        return cell(muted("not tried at the machine"))
    return _result(s.machine, source, failed=s.is_failed) or BLANK


def who(s: TestStep) -> Cell:
    """Return the person and date of the test at the machine, or blank fields for them."""
    if s.machine.who:
        return cell(s.machine.who)
    return BLANK if s.kind.at_machine else ()


def _result(seen: StepResult | AtMachine | None, source: str, *, failed: bool = False) -> Cell:
    items: list[Item] = []
    if seen is not None and seen.outcome is not None:
        said = "; ".join(text for text in (getattr(seen, "time_is", ""), seen.remark) if text)
        word = f"{seen.outcome.value}: {said}" if said else seen.outcome.value
        # Whether the same result is an error depends on the observer: the caller decides.
        failed = failed or seen.outcome is StepOutcome.NOT_AS_EXPECTED
        items.append(Verdict(word, Level.ERROR) if failed else Text(word))
    if seen is not None and seen.measured_ms is not None:
        items.append(stated(seen.measured_ms, "ms", source))
    return tuple(items)


def _emulated_run(run: Run) -> list[Part]:
    source = "run of this plan on the emulated bus"
    s = run.statistics
    passed = Verdict("passed", Level.CLEAR) if run.passed else Verdict("FAILED", Level.ERROR)
    parts: list[Part] = [
        Heading("Run on the emulated bus"),
        Paragraph(
            (
                EMULATED,
                Text(f". {run.mode.capitalize()} time, "),
                stated(run.duration_ms / 1000, "s", source),
                Text(", "),
                number_of(s.cycles, "bus cycle", source),
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
            columns=RUN_COLUMNS,
            rows=tuple(
                (
                    cell(strong(c.name)),
                    cell(c.state.text),
                    cell(stated(c.fsoe_cycle_ms["mean"], "ms", source)),
                    cell(stated(c.fsoe_cycle_ms["max"], "ms", source)),
                    cell(stated(c.watchdog_ms, "ms", source)),
                    cell(
                        number_of(c.resets, "reset", source),
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
