"""Assembles the report from its sections, with findings and open points first."""

from __future__ import annotations

from base64 import b64encode
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

from fsoe_net.diag.catalogue import CATALOGUE
from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.diag.words import counted, summary
from fsoe_net.document.model import (
    Bullets,
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
    code,
    muted,
    number_of,
    strong,
)
from fsoe_net.model.report_facts import Logo
from fsoe_net.model.written import without_principal
from fsoe_net.report.first_page import first_page, title_block
from fsoe_net.report.inputs import ReportInputs
from fsoe_net.report.model import (
    LEVELS,
    Point,
    PointKind,
    ReportDocument,
    ReportSection,
    assumption,
    open_point,
)
from fsoe_net.report.section_copies import copies
from fsoe_net.report.section_evidence import bus_evidence, is_of_machine
from fsoe_net.report.section_functions import causes_and_effects, function_pages
from fsoe_net.report.section_identity import identity, role
from fsoe_net.report.section_network import architecture, connections
from fsoe_net.report.section_quantities import quantities
from fsoe_net.report.section_record import change_log, fingerprint, open_points, sign_off
from fsoe_net.report.section_tests import tests
from fsoe_net.report.section_timing import timing

_ROWS_ON_FIRST_PAGE = 14
_Make = Callable[[ReportInputs], ReportSection]
_MAIN: tuple[_Make, ...] = (causes_and_effects, architecture, role, change_log, sign_off)
"""Sections after the pages of the safety functions; open points, from all of them, follow."""
_APPENDICES: tuple[_Make, ...] = (
    identity,
    tests,
    connections,
    timing,
    quantities,
    copies,
    bus_evidence,
    fingerprint,
)


def compose_report(inputs: ReportInputs) -> ReportDocument:
    """Create the report of a network; a pure function, so equal inputs give equal documents."""
    main = [*function_pages(inputs), *(section(inputs) for section in _MAIN)]
    appendices = [replace(s(inputs), appendix=True, page=n == 0) for n, s in enumerate(_APPENDICES)]
    sections = [*main, *appendices]
    # Points of sections before findings: an open point is a decision for a person.
    of_sections = tuple((s.title, p) for s in sections for p in s.points)
    of_findings = [_point(inputs, d) for d in inputs.diagnostics if d.level is not Severity.INFO]
    points = (*of_sections, *(("Findings", p) for p in of_findings))
    last = len(main) + 1
    network = None if inputs.resolution is None else inputs.resolution.network
    # Verdicts against the network follow from its errors; a second list would repeat these.
    against = () if _has_error(inputs) else _against(sections)
    verdict = _verdict(inputs, len(against))
    return ReportDocument(
        title=(network.project if network is not None else "") or inputs.name,
        subtitle=f"FSoE network {inputs.name}: configuration report",
        title_block=title_block(network),
        logo="" if network is None else _logo(network.report.logo),
        network=inputs.name,
        version=inputs.version,
        seal="NO FINGERPRINT" if inputs.fingerprint is None else inputs.fingerprint.short,
        whole="" if inputs.fingerprint is None else inputs.fingerprint.whole,
        verdict=verdict,
        lead=(
            *first_page(inputs, _of_findings(inputs), _machine(inputs)),
            *_lead(inputs, of_sections, of_findings, against, last),
        ),
        sections=(*main, open_points(points, inputs), *appendices),
        foot=f"black channel configuration, evidence and no certificate · {verdict.word}",
        numbered=True,
        points=points,
        findings=tuple(inputs.diagnostics),
        against=against,
        of_machine=is_of_machine(inputs),
    )


def _logo(logo: Logo | None) -> str:
    return "" if logo is None else f"data:{logo.media};base64,{b64encode(logo.data).decode()}"


def _has_error(inputs: ReportInputs) -> bool:
    return any(d.level is Severity.ERROR for d in inputs.diagnostics)


def _point(inputs: ReportInputs, found: Diagnostic) -> Point:
    text = f"{found.code} at {found.span}: {found.message}"
    justified = inputs.justification(found)
    if justified is None:
        return open_point(text)
    return assumption(f"{text} (let pass by {justified.by}: {justified.reason})")


def _against(sections: Sequence[ReportSection]) -> tuple[tuple[str, Verdict], ...]:
    """Return the objections to the network, each with the title of its section."""
    # A verdict can be on several pages: it is one objection, reported for the first page.
    found: dict[Verdict, str] = {}
    for section in sections:
        for item in chain.from_iterable(map(_items, section.parts)):
            if isinstance(item, Verdict) and item.level is Level.ERROR:
                found.setdefault(item, section.title)
    return tuple((title, verdict) for verdict, title in found.items())


def _items(part: Part) -> Iterator[Item]:
    if isinstance(part, Paragraph):
        yield from part.items
    elif isinstance(part, Bullets):
        yield from chain.from_iterable(part.rows)
    elif isinstance(part, Table):
        for row in part.rows:
            yield from chain.from_iterable(row)


def _verdict(inputs: ReportInputs, against: int) -> Verdict:
    """Describe the known facts about the machine, the signatures and the files.

    Files with an error are judged by it alone. The absence of findings is mentioned only if the
    machine was tested and signed off.
    """
    files = _of_findings(inputs)
    if files.level is Level.ERROR:
        return files
    machine = _machine(inputs)
    signed, is_signed = _signed(inputs)
    # "Done" needs both: tests without signatures, or signatures without tests, prove nothing.
    is_done = machine.level is Level.CLEAR and is_signed
    words = f"machine: {machine.word} · {signed}"
    # The absence of findings is mentioned only after the test of the machine: otherwise it reads
    # like a pass.
    if is_done or files.level is Level.WARNING:
        words += f" · files: {files.word}"
    if against:
        return Verdict(f"{counted(against, 'verdict')} against it · {words}", Level.ERROR)
    if files.level is Level.WARNING:
        return Verdict(words, Level.WARNING)
    return Verdict(words, files.level if is_done else Level.OPEN)


def _machine(inputs: ReportInputs) -> Verdict:
    """Return the tests by people at the machine; clear if all results were as expected."""
    tried = inputs.tried
    steps = () if tried is None or not tried.fits else tried.test_record.machine_steps
    done = [s for s in steps if s.machine.outcome is not None]
    failed = sum(s.is_failed for s in done)
    # An empty record is not a failed one.
    if not done:
        return Verdict("NOT TESTED", Level.OPEN)
    if failed:
        return Verdict(f"{failed} of {counted(len(steps), 'test step')} FAILED", Level.ERROR)
    # A step that a program disputes stays open, even if a person has confirmed it.
    left = sum(s.is_open or s.is_disputed for s in steps)
    word = f"{len(steps) - left} of {counted(len(steps), 'test step')} as expected"
    return Verdict(f"{word}, {left} open", Level.OPEN) if left else Verdict(word, Level.CLEAR)


def _signed(inputs: ReportInputs) -> tuple[str, bool]:
    """Return the persons who signed off this configuration, and an objection if there is one."""
    given = inputs.accepted
    if given is None:
        return "not signed", False
    if not given.fits:
        return "signed for another configuration", False
    if inputs.signed is not None and inputs.signed.against:
        return "signatures DO NOT HOLD", False
    names = (given.record.author.name, given.record.verifier.name)
    people = " and ".join(map(without_principal, names))
    # A record only names persons; a signature shows that they have seen it.
    if inputs.signed is None:
        return f"accepted by {people}, signatures not checked", False
    return f"signed by {people}", True


def _of_findings(inputs: ReportInputs) -> Verdict:
    found = inputs.diagnostics
    if not found:
        return Verdict("no findings", Level.CLEAR)
    counts = summary(found)
    worst = min((d.level for d in found), key=lambda level: level.rank)
    if worst is Severity.ERROR:
        return Verdict(f"NOT ACCEPTABLE: {counts}", Level.ERROR)
    if worst is Severity.WARNING:
        warnings = [d for d in found if d.level is Severity.WARNING]
        # A warning that is justified by name is settled, but stays visible as a warning.
        if all(inputs.justification(d) is not None for d in warnings):
            return Verdict(f"{counts}; each warning justified by name", Level.WARNING)
        needed = f"{counts}: each needs a correction or a justification by name"
        return Verdict(needed, Level.WARNING)
    return Verdict(f"no errors, no warnings; {counts}", Level.NOTE)


def _lead(
    inputs: ReportInputs,
    of_sections: Sequence[tuple[str, Point]],
    of_findings: Sequence[Point],
    against: Sequence[tuple[str, Verdict]],
    last: int,
) -> tuple[Part, ...]:
    parts: list[Part] = []
    if against:
        rows: list[tuple[Item, ...]] = [
            (Text(f"{title}: "), verdict) for title, verdict in against[:_ROWS_ON_FIRST_PAGE]
        ]
        # The first page must fit on one printed page; the later blocks list all items.
        if len(against) > _ROWS_ON_FIRST_PAGE:
            rows.append((Text(f"and {len(against) - _ROWS_ON_FIRST_PAGE} more in the blocks"),))
        parts += [Heading("Against it"), Bullets(tuple(rows))]
    found = sorted(inputs.diagnostics, key=lambda d: d.level.rank)
    if found:
        parts += [Heading("Findings"), _findings(found, inputs, last)]
    opened = [(title, p) for title, p in of_sections if p.kind is PointKind.OPEN]
    points = [*(p for _, p in of_sections), *of_findings]
    assumed = sum(p.kind is PointKind.ASSUMPTION for p in points)
    parts.append(Heading("Open points and assumptions"))
    numbers: list[Item] = [
        number_of(len(opened), "open point", "all blocks"),
        Text(" and "),
        number_of(assumed, "assumption", "all blocks"),
        Text(f"; block {last} lists all. A judgement rests on them."),
    ]
    parts.append(Paragraph(tuple(numbers)))
    rows = [(strong(f"{title}: "), Text(p.text)) for title, p in opened[:_ROWS_ON_FIRST_PAGE]]
    if len(opened) > _ROWS_ON_FIRST_PAGE:
        rows.append((Text(f"and {len(opened) - _ROWS_ON_FIRST_PAGE} more in block {last}"),))
    if rows:
        parts.append(Bullets(tuple(rows)))
    return tuple(parts)


def _findings(found: Sequence[Diagnostic], inputs: ReportInputs, last: int) -> Table:
    """Return all findings; if there are many, one row per code, so that they fit on one page."""
    per_code = Counter(d.code for d in found)
    shown: list[tuple[Diagnostic, int]] = [(d, 1) for d in found]
    # Hundreds of findings often share one code: with one row per code they fit on the page.
    if len(found) > _ROWS_ON_FIRST_PAGE:
        firsts: dict[str, Diagnostic] = {}
        for d in found:
            # The first of each code is shown as an example.
            firsts.setdefault(d.code, d)
        shown = [(d, per_code[d.code]) for d in firsts.values()]
    rows = []
    for d, count in shown:
        items: list[Item] = [Text(d.message)]
        justified = inputs.justification(d)
        if justified is not None:
            items.append(muted(f"let pass by {justified.by}: {justified.reason}"))
        if count > 1:
            items.append(
                Number(
                    value=count - 1,
                    text=f"and {count - 1}",
                    unit=f"more of {d.code}: {CATALOGUE[d.code].title}",
                    source=f"findings of fsoe-net, block {last} lists all",
                )
            )
        rows.append(
            (
                cell(Verdict(d.level.value, LEVELS[d.level]), code(d.code)),
                tuple(items),
                cell(code(str(d.span))),
            )
        )
    return Table(
        name="findings on the first page",
        columns=(Column("Finding"), Column("What is wrong"), Column("Place")),
        rows=tuple(rows),
        remark=f"Block {last} lists every finding with its fix.",
    )
