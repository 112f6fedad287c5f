"""First page: the accepted configuration and its signers, safety functions, and objections."""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.diag.words import counted
from fsoe_net.document.model import (
    BLANK,
    Cell,
    Column,
    Heading,
    Item,
    Level,
    Part,
    Table,
    Verdict,
    cell,
    code,
    muted,
    stated,
    strong,
)
from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.report_facts import ReportFacts
from fsoe_net.model.safety import level_words
from fsoe_net.report.inputs import GivenRecord, ReportInputs
from fsoe_net.report.section_functions import function_label, function_test
from fsoe_net.report.section_timing import JUDGED, upper_bound
from fsoe_net.timing.judgement import Judgement
from fsoe_net.timing.reaction import FunctionBudget

_OPEN = {Judgement.MISSING: "not judged", Judgement.UNVERIFIED: "unverified"}
_SOURCE = "network file"


def title_block(network: NetworkConfig | None) -> Table:
    """Return number, revision, date and customer of the report; people write those not stated."""
    facts = ReportFacts() if network is None else network.report
    rows = {
        "Document number": facts.number,
        "Revision": facts.revision,
        "Date": facts.date,
        "Customer": facts.customer,
    }
    return Table(
        name="title block",
        columns=tuple(
            Column(title, share=share) for title, share in zip(rows, (26, 14, 18, 42), strict=True)
        ),
        rows=(tuple(cell(text) if text else BLANK for text in rows.values()),),
    )


def first_page(inputs: ReportInputs, files: Verdict, machine: Verdict) -> list[Part]:
    """Return the accepted configuration with its signers, and a row per safety function.

    Args:
        inputs: Inputs of the report.
        files: Statement about the findings.
        machine: Statement about the tests at the machine.
    """
    rows: list[tuple[str, Cell]] = [
        ("What", cell(_what(inputs))),
        ("By whom", _by_whom(inputs.accepted)),
        ("Signatures", _signatures(inputs)),
        ("Tests at the machine", cell(machine)),
        ("Findings", cell(files)),
    ]
    parts: list[Part] = [
        Heading("What is accepted"),
        Table(
            name="what is accepted",
            columns=(Column("Question", share=20), Column("Answer", share=80)),
            rows=tuple((cell(strong(what)), value) for what, value in rows),
        ),
    ]
    functions = () if inputs.budget is None else inputs.budget.functions
    parts.append(Heading("Safety functions"))
    if not functions:
        return [*parts, Table(name="safety functions", columns=_FUNCTIONS, rows=())]
    table = Table(
        name="safety functions",
        columns=_FUNCTIONS,
        rows=tuple(_function(n, row, inputs) for n, row in enumerate(functions, 1)),
        remark="Calculated: the longest case that is judged. Claimed: the lowest level that the "
        "source of an element claims; no level is judged as reached.",
    )
    return [*parts, table]


_FUNCTIONS = (
    Column("Safety function", share=21),
    Column("Required", number=True, share=10),
    Column("Calculated", number=True, share=13),
    Column("Level required", share=9),
    Column("Claimed", share=9),
    Column("Tested", share=18),
    Column("Against it", share=20),
)


def _what(inputs: ReportInputs) -> str:
    resolution = inputs.resolution
    if resolution is None:
        return "nothing: no network could be read"
    functions = counted(len(resolution.network.safety_functions), "safety function")
    connections = counted(len(resolution.connections), "FSoE connection")
    copies = counted(len(resolution.transfers), "copy")
    return f"{copies} per bus cycle for {connections} and {functions}"


def _by_whom(given: GivenRecord | None) -> Cell:
    if given is None:
        return cell(Verdict("not accepted: no acceptance record", Level.OPEN))
    record, path = given.record, code(given.source.path)
    if not given.fits:
        word = "the record is of ANOTHER configuration"
        return cell(Verdict(word, Level.ERROR), path)
    people = (("author", record.author), ("verifier", record.verifier))
    return cell(*(f"{role} {p.name}, {p.date}" for role, p in people), path)


def _signatures(inputs: ReportInputs) -> Cell:
    given, signed = inputs.accepted, inputs.signed
    if given is None:
        return cell(Verdict("none", Level.OPEN))
    if signed is None:
        word = "not checked; --signers FILE checks those next to the record"
        return cell(Verdict(word, Level.OPEN))
    items: list[Item] = []
    for s in signed.signatures:
        items += [
            Verdict(f"{s.role} {s.name}, {s.date}", Level.CLEAR),
            muted(f"{s.principal}, {s.key}"),
        ]
    return (*items, *(Verdict(words, Level.ERROR) for words in signed.against))


def _function(number: int, row: FunctionBudget, inputs: ReportInputs) -> tuple[Cell, ...]:
    f, reaction = row.function, row.reaction
    levels = level_words(f)
    against: Cell = tuple(_against(row))
    tested = function_test(row, inputs)
    # "Nothing found" only after the test at the machine: before that, nothing was tested.
    if not against and tested.level is Level.CLEAR:
        against = (muted("nothing found"),)
    longest = None if reaction is None else reaction.decides.ms
    return (
        cell(strong(f"{function_label(number)} {f.name}")),
        cell(stated(f.required_reaction_ms, "ms", _SOURCE)),
        cell(upper_bound(longest, "the case that decides, on its page")),
        cell(*levels) if levels else cell(Verdict("not stated", Level.OPEN)),
        cell(*(c.lowest or muted("not stated") for c in row.levels)),
        cell(tested),
        against,
    )


def _against(row: FunctionBudget) -> Iterator[Verdict]:
    # Time, level and PFH are judged separately; one good value does not outweigh another.
    if row.judgement is Judgement.ABOVE:
        yield Verdict("takes longer than required", Level.ERROR)
    elif row.judgement in _OPEN:
        yield Verdict(f"time {_OPEN[row.judgement]}", JUDGED[row.judgement])
    for claim in row.levels:
        if claim.judgement is Judgement.ABOVE:
            yield Verdict("level above the lowest claim", Level.ERROR)
        elif claim.judgement in _OPEN:
            yield Verdict(f"claim {_OPEN[claim.judgement]}", JUDGED[claim.judgement])
    if row.pfh.judgement is Judgement.ABOVE:
        yield Verdict("PFH above the limit", Level.ERROR)
    elif row.pfh.judgement in _OPEN:
        yield Verdict(f"PFH {_OPEN[row.pfh.judgement]}", JUDGED[row.pfh.judgement])
