"""Blocks 10 to 13: fingerprint, change log, sign-off, open points and assumptions."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.compare.diff_types import Change, ChangeArea
from fsoe_net.diag.words import counted
from fsoe_net.document.model import (
    BLANK,
    Bullets,
    Cell,
    Column,
    Heading,
    Item,
    Level,
    Paragraph,
    Part,
    Style,
    Table,
    Text,
    Verdict,
    cell,
    code,
    muted,
    number_of,
    strong,
)
from fsoe_net.model.acceptance import Acceptance, SignedBy
from fsoe_net.plan.fingerprint import short_code
from fsoe_net.report.inputs import Against, GivenRecord, ReportInputs, Signatures
from fsoe_net.report.model import LEVELS, Point, PointKind, ReportSection, assumption, open_point

_MADE_FROM = (
    "SHA-256, made from the canonical text of everything safety-relevant in the plan. "
    "Paths and dates are not in it."
)
_CALLS_FOR = {
    ChangeArea.NETWORK: "reaction times and watchdogs",
    ChangeArea.SUBDEVICE: "identity at the machine, its address, each safety function that uses it",
    ChangeArea.SYNC_MANAGER: "process data read back, each connection of that SubDevice",
    ChangeArea.FRAME: "each connection of that SubDevice",
    ChangeArea.ENTRIES: "process data read back, signals of that SubDevice",
    ChangeArea.SDO: "start-up of that SubDevice",
    ChangeArea.COPY: "each safety function over that connection",
    ChangeArea.CONNECTION: (
        "start-up of that connection, loss of its ends, each safety function over it"
    ),
    ChangeArea.SAFETY_FUNCTION: "that safety function, with its reaction time",
}


# -- 10 fingerprint -------------------------------------------------------------------------------


def fingerprint(inputs: ReportInputs) -> ReportSection:
    """Return the fingerprint with one hash per section."""
    title, found = "Fingerprint", inputs.fingerprint
    if found is None:
        return ReportSection(
            key="fingerprint",
            title=title,
            parts=(
                Paragraph((Text("No fingerprint: a network with errors is not a configuration."),)),
            ),
            points=(open_point("there is no fingerprint"),),
        )
    rows: list[tuple[Cell, ...]] = [
        (cell(strong("short code")), cell(Text(found.short, Style.CODE))),
        (cell(strong("whole")), cell(code(found.whole))),
    ]
    rows += [(cell(name.replace("_", " ")), cell(code(h))) for name, h in found.sections.items()]
    return ReportSection(
        key="fingerprint",
        title=title,
        parts=(
            Paragraph((Text(_MADE_FROM),)),
            Table(
                name="fingerprint", columns=(Column("Section"), Column("Hash")), rows=tuple(rows)
            ),
        ),
        points=(
            assumption(
                "the machine runs this configuration as long as its fsn-master shows this "
                "fingerprint; compare the short code at the machine"
            ),
        ),
    )


# -- 11 change log --------------------------------------------------------------------------------


def change_log(inputs: ReportInputs) -> ReportSection:
    """Return differences from an earlier state, and the tests to repeat because of them."""
    title, against = "Change log", inputs.against
    if against is None:
        text = "Not compared with an earlier state; --against FILE names one."
        words = "not compared with the state that was accepted last"
        return ReportSection(
            key="change_log",
            title=title,
            parts=(Paragraph((Text(text),)),),
            points=(open_point(words),),
        )
    found = against.difference
    count = len(found.changes)
    parts: list[Part] = [_compared(against, inputs)]
    points: list[Point] = []
    if found.changes:
        parts.append(
            Table(
                name="changes",
                columns=tuple(
                    Column(h) for h in ("Change", "Where", "Before", "Now", "To be tried again")
                ),
                rows=tuple(_change(c) for c in found.changes),
            )
        )
        points.append(
            open_point(f"{counted(count, 'change')} since {against.source.path}: to be tried again")
        )
    # The compared files may be equal although the plan differs, for example because of another
    # library.
    elif _sections_changed(against, inputs):
        word = f"another fingerprint than {against.source.path}: to be tried again"
        points.append(open_point(word))
    # Even without a change in the files, the record itself may have open steps.
    if points or against.again:
        parts += [Heading("Steps of the test record to do again"), _again(against)]
    points += [open_point(f"not compared: {w}") for w in found.not_compared]
    if inputs.accepted is not None and inputs.accepted.record.interventions:
        parts += [Heading("Interventions since the first record"), _interventions(inputs.accepted)]
    return ReportSection(key="change_log", title=title, parts=tuple(parts), points=tuple(points))


def _compared(against: Against, inputs: ReportInputs) -> Paragraph:
    count = len(against.difference.changes)
    changed = _sections_changed(against, inputs)
    items: list[Item] = [
        Text("Compared with "),
        code(against.source.path),
        Text(", SHA-256 "),
        code(against.source.sha256),
        Text(": "),
    ]
    if count:
        items.append(number_of(count, "difference", "by meaning"))
    elif changed:
        items.append(Verdict("no difference by meaning, but another fingerprint", Level.WARNING))
    else:
        items.append(Verdict("no difference in what both speak about", Level.CLEAR))
    if against.fingerprint is not None:
        items += [Text("; its fingerprint "), code(against.fingerprint.short)]
        if changed:
            items.append(Text(f" (sections that differ: {', '.join(changed)})"))
    items.append(Text("."))
    return Paragraph(tuple(items))


def _again(against: Against) -> Part:
    if not against.again:
        return Paragraph((Text("None of its steps is about what changed; judge each change."),))
    return Bullets(tuple((code(step),) for step in against.again))


def _sections_changed(against: Against, inputs: ReportInputs) -> tuple[str, ...]:
    if against.fingerprint is None or inputs.fingerprint is None:
        return ()
    return inputs.fingerprint.changed(against.fingerprint)


def _change(c: Change) -> tuple[Cell, ...]:
    what = " ".join(w for w in (c.area.replace("_", " "), c.kind) if w)
    where = [w for w in (c.where, c.what, c.listed_entries) if w]
    return (
        cell(strong(what)),
        tuple(Text(w) if n == 0 else muted(w) for n, w in enumerate(where)),
        cell("" if c.before is None else str(c.before)),
        cell("" if c.after is None else str(c.after)),
        cell(_CALLS_FOR[c.area]),
    )


# -- 12 sign-off ----------------------------------------------------------------------------------


def sign_off(inputs: ReportInputs) -> ReportSection:
    """Return fields to fill in by hand, and the corresponding facts of an acceptance record."""
    given = inputs.accepted
    short = "no fingerprint" if inputs.fingerprint is None else inputs.fingerprint.short
    parts: list[Part] = [
        Paragraph((Text("For the configuration with the short code "), code(short), Text(".")))
    ]
    if given is None:
        return _sign_off(parts, (), open_point("not signed"))
    # A signed record of another configuration is worse than none: it must be visible.
    if not given.fits:
        word = f"{given.source.path} is the record of ANOTHER configuration"
        parts.append(Paragraph((Verdict(word, Level.ERROR), Text(f": {_of(given)}."))))
        return _sign_off(parts, (), open_point(f"not signed; {word}"))
    record = given.record
    word = f"{given.source.path} is a record of this configuration"
    parts.append(Paragraph((Verdict(word, Level.CLEAR), Text(f": {_of(given)}."))))
    if record.steps_left_out:
        parts.append(
            Table(
                name="steps left out",
                columns=tuple(Column(h) for h in ("Let pass", "Reason", "Answered for by")),
                rows=tuple(
                    (cell(strong(s.step)), cell(s.reason), cell(s.by))
                    for s in record.steps_left_out
                ),
            )
        )
    # If signatures were not checked, their existence is an assumption.
    if inputs.signed is None:
        signed = assumption(
            f"the signatures of {record.author.name} and {record.verifier.name} stand on the "
            "report that the record names"
        )
    else:
        parts += _signatures(inputs.signed)
        signed = assumption("the keys belong to the people whom the file of allowed signers names")
    changed = _changed_files(record, inputs)
    return _sign_off(parts, (record.author, record.verifier), signed, *changed)


def _signatures(signed: Signatures) -> list[Part]:
    """Return the valid signatures of the record, and the objections to the others."""
    heads = ("Signed as", "Name", "Principal", "Date", "Key")
    table = Table(
        name="signatures",
        columns=tuple(Column(h) for h in heads),
        rows=tuple(
            (cell(s.role), cell(strong(s.name)), cell(s.principal), cell(s.date), cell(code(s.key)))
            for s in signed.signatures
        ),
    )
    wrong = [Paragraph((Verdict(words, Level.ERROR),)) for words in signed.against]
    return [Heading("Signatures that hold"), table, *wrong]


def _changed_files(record: Acceptance, inputs: ReportInputs) -> list[Point]:
    """Return points about files that changed although the fingerprint did not."""
    accepted = {s.sha256 for s in record.inputs}
    sources = inputs.resolution.network.sources if inputs.resolution else ()
    changed = [s.path for s in sources if s.sha256 not in accepted]
    if not changed:
        return []
    words = (
        f"changed since the record, within the same fingerprint: {', '.join(changed)}; look what "
        "was changed: comments and names of files change nothing"
    )
    return [open_point(words)]


def _of(given: GivenRecord) -> str:
    record = given.record
    return (
        f"SHA-256 {given.source.sha256}, fingerprint {short_code(record.whole)}, author "
        f"{record.author.name}, verifier {record.verifier.name}, {record.verifier.date}"
    )


def _sign_off(parts: list[Part], people: Sequence[SignedBy], *points: Point) -> ReportSection:
    roles = ("Author", "Verifier, who is not the author", "Released for the machine by")
    rows = []
    # Lines for hand-written names stay empty if no record fills them.
    for number, role in enumerate(roles):
        signed = people[number] if number < len(people) else None
        name = BLANK if signed is None else cell(signed.name)
        date = BLANK if signed is None else cell(signed.date)
        rows.append((cell(role), name, date, BLANK))
    heads = ("Role", "Name", "Date", "Signature")
    table = Table(name="sign-off", columns=tuple(Column(h) for h in heads), rows=tuple(rows))
    return ReportSection(key="sign_off", title="Sign-off", parts=(*parts, table), points=points)


def _interventions(given: GivenRecord) -> Table:
    return Table(
        name="interventions",
        columns=tuple(Column(h) for h in ("What and why", "By", "Date")),
        rows=tuple((cell(i.what), cell(i.by), cell(i.date)) for i in given.record.interventions),
    )


# -- 13 assumptions and open points ---------------------------------------------------------------


def open_points(points: Sequence[tuple[str, Point]], inputs: ReportInputs) -> ReportSection:
    """Return all open items: findings with their fixes, open points, assumptions."""
    parts: list[Part] = [Heading("Findings")]
    if inputs.diagnostics:
        parts.append(_findings(inputs))
    else:
        parts.append(Paragraph((Verdict("no findings", Level.CLEAR),)))
    for kind, title in (
        (PointKind.OPEN, "Open points"),
        (PointKind.ASSUMPTION, "Assumptions"),
    ):
        rows = tuple(
            (cell(muted(block)), cell(p.text), BLANK)
            for block, p in points
            # Findings have a separate table above.
            if p.kind is kind and block != "Findings"
        )
        parts.append(Heading(title))
        last = "Settled by, reason" if kind is PointKind.OPEN else "Agreed by"
        parts.append(
            Table(
                name=title.lower(),
                columns=(Column("Block"), Column(title[:-1]), Column(last)),
                rows=rows,
            )
        )
    return ReportSection(key="open_points", title="Assumptions and open points", parts=tuple(parts))


def _findings(inputs: ReportInputs) -> Table:
    rows = []
    for d in inputs.diagnostics:
        justified = inputs.justification(d)
        said: list[Item] = [Text(d.message)]
        said += [muted(f"see {r.span}: {r.message}") for r in d.related]
        if d.hint:
            said.append(muted(f"fix: {d.hint}"))
        rows.append(
            (
                cell(Verdict(d.level.value, LEVELS[d.level]), code(d.code)),
                (*said, muted(str(d.span))),
                BLANK if justified is None else cell(justified.by, muted(justified.reason)),
            )
        )
    return Table(
        name="findings",
        columns=(Column("Finding"), Column("What and fix"), Column("Justified by, reason")),
        rows=tuple(rows),
        remark="Findings cannot be hidden; warnings can be justified by name and reason.",
    )
