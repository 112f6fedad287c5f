"""Whether a configuration can be signed off, and the record of it.

Required: a report of this configuration without errors, a name and reason for each warning, a test
record with steps that a person has done at the machine, and a verifier who is not the author (IEC
62061 clause 9; ISO 13849-2 clause 4.1 requires independent persons).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath

from fsoe_net.acceptance.signed_report import SignedReport
from fsoe_net.diag.diagnostic import Diagnostic, Severity, Span
from fsoe_net.diag.words import counted
from fsoe_net.model.acceptance import (
    Acceptance,
    Intervention,
    JustifiedFinding,
    JustifiedStep,
    Replaced,
    SignedBy,
)
from fsoe_net.model.network import SourceFile
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.test_record import StepKind, StepOutcome, TestRecord, TestStep
from fsoe_net.model.written import names_a_person, same_person, says_something
from fsoe_net.plan.fingerprint import fingerprint_of
from fsoe_net.plan.model import Plan

_DO_IT = "do it at the machine"
_LEFT_OUT = (StepKind.LOSS,)
"""Steps that can be omitted with a reason alone.

Any other step can be omitted only if it was done for the previous record and no change requires
it to be repeated.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """Reasons against a sign-off, and the next step."""

    what: str
    fix: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Reason:
    """The reason why an item is accepted as it is.

    The subject is ``CODE@file:line``, the id of a step, ``firmware NAME`` and the like, ``bus
    evidence``, or all items of one kind, such as ``loss *``.
    """

    subject: str
    reason: str
    by: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Grounds:
    """Basis of a sign-off.

    Attributes:
        version: Version of fsoe-net.
        resolution: The network, without errors.
        plan: Its plan.
        report: The report that was signed.
        diagnostics: Current findings of the network's files.
        test_record: The test record as filled in.
        test_record_source: Its file.
        test_record_findings: Its errors, including mismatches with the current network.
        author: Author of the configuration.
        verifier: Verifier of the configuration.
        reasons: Reasons for warnings and steps.
        interventions: Changes since the previous record.
        before: The record to replace, and
        before_source: its file.
        again: Steps to repeat because of the changes since then.
        equipment: Test equipment.
        environment: Place and conditions of the tests.
        attachments: Photos and other attached files of the record.
        longest_ms: For each safety function, the longest response without a fault according to the
            stated times, ms.
    """

    version: str
    resolution: Resolution
    plan: Plan
    report: SignedReport
    diagnostics: Sequence[Diagnostic] = ()
    test_record: TestRecord
    test_record_source: SourceFile
    test_record_findings: Sequence[Diagnostic] = ()
    author: SignedBy
    verifier: SignedBy
    reasons: Sequence[Reason] = ()
    interventions: Sequence[Intervention] = ()
    before: Acceptance | None = None
    before_source: SourceFile | None = None
    again: Collection[str] = ()
    equipment: Sequence[str] = ()
    environment: str = ""
    attachments: Sequence[SourceFile] = ()
    longest_ms: Mapping[str, float] = field(default_factory=dict)


@dataclass(slots=True)
class _Gathered:
    refusals: list[Refusal] = field(default_factory=list)
    findings: list[JustifiedFinding] = field(default_factory=list)
    steps: list[JustifiedStep] = field(default_factory=list)
    used: set[str] = field(default_factory=set)

    def refuse(self, what: str, fix: str) -> None:
        self.refusals.append(Refusal(what=what, fix=fix))


def sign_off(grounds: Grounds) -> tuple[Acceptance | None, tuple[Refusal, ...]]:
    """Return the record, or every reason why there is none; a pure function."""
    g, out = grounds, _Gathered()
    fingerprint = fingerprint_of(g.plan)
    _people(g, out)
    # All reasons are collected: a person must not meet them one at a time.
    _circumstances(g, out)
    _report(g, fingerprint.whole, out)
    _findings(g, out)
    if not g.report.of_machine:
        why = "the report has no evidence of the machine"
        _let_pass("bus evidence", why, "give `report` a --evidence scan.json", g, out)
    _steps(g, fingerprint.whole, out)
    _history(g, fingerprint.whole, out)
    # Two reasons for one subject: it would be unclear which one applies.
    for subject, count in Counter(r.subject for r in g.reasons).items():
        if count > 1:
            out.refuse(f"--justify {subject} is there {counted(count, 'time')}", "keep one of them")
    # A reason for an unknown item is a typing error; the warning that it was meant for stays open.
    for r in g.reasons:
        if r.subject not in out.used:
            out.refuse(
                f"--justify {r.subject}: no warning or open step has this name",
                "write CODE@file:line as the report shows it, the id of a step, or `loss *`; the "
                "others as a refusal names them",
            )
    if out.refusals:
        return None, tuple(out.refusals)
    network = g.resolution.network
    before = g.before
    record = Acceptance(
        network=network.name,
        project=network.project or "",
        made_with=g.version,
        whole=fingerprint.whole,
        sections=fingerprint.sections,
        plan=g.plan.to_bytes(),
        safety_functions=network.safety_functions,
        inputs=tuple(network.sources),
        reports=g.report.sources,
        open_points=g.report.open_points,
        assumptions=g.report.assumptions,
        test_record=g.test_record_source,
        steps=len(g.test_record.machine_steps),
        author=g.author,
        verifier=g.verifier,
        findings=tuple(out.findings),
        steps_left_out=tuple(out.steps),
        equipment=tuple(g.equipment),
        environment=g.environment,
        attachments=tuple(g.attachments),
        interventions=(*(before.interventions if before else ()), *g.interventions),
        replaces=(
            Replaced(source=g.before_source, whole=before.whole)
            if before is not None and g.before_source is not None
            else None
        ),
    )
    return record, ()


def _people(g: Grounds, out: _Gathered) -> None:
    for role, person in (("author", g.author), ("verifier", g.verifier)):
        # A signature requires a person: blanks, dashes and roles are rejected.
        if not says_something(person.name):
            out.refuse(f"the {role} has no name", f"name a person with --{role}")
        elif not names_a_person(person.name):
            out.refuse(
                f"the {role} is {person.name!r}: that is not a person",
                f"write the name of the person with --{role}",
            )
        # Invisible characters make two names look like one.
        elif not person.name.isprintable():
            out.refuse(
                f"the name of the {role} contains invisible characters: {person.name!r}",
                "write it without them",
            )
    for r in g.reasons:
        if not names_a_person(r.by):
            out.refuse(
                f"--justify {r.subject} is by {r.by!r}: that is not a person",
                "write the name of the person after `by`",
            )
    if g.author.name.strip() and same_person(g.author.name, g.verifier.name):
        out.refuse(
            f"author and verifier are one person: {g.verifier.name}",
            "a person other than the author must verify",
        )


def _circumstances(g: Grounds, out: _Gathered) -> None:
    """Check who validated, with which equipment and where (ISO 13849-2, IEC 62061)."""
    for role, person in (("author", g.author), ("verifier", g.verifier)):
        if not says_something(person.competence):
            out.refuse(
                f"the competence of the {role} is not stated",
                f"name training, certificate or experience with --{role}-competence",
            )
    if not g.equipment:
        out.refuse(
            "no test equipment is stated",
            "name instrument, serial number and calibration with --equipment, or why there is none",
        )
    if not says_something(g.environment):
        out.refuse(
            "the environment of the tests is not stated",
            "name place and conditions with --environment",
        )


def _report(g: Grounds, whole: str, out: _Gathered) -> None:
    # The whole fingerprint is compared: the report must describe exactly this configuration.
    if g.report.whole != whole:
        code = g.report.whole[:16].upper() or "none"
        out.refuse(
            f"the report is not of this configuration: its fingerprint begins with {code}, that of "
            f"the network with {whole[:16].upper()}",
            "write the report again, and have it signed",
        )
    if g.report.against and not any(f.level is Severity.ERROR for f in g.report.findings):
        out.refuse(
            f"the report states: {g.report.against}",
            "fix what its first page names, and write it again",
        )
    # People sign pages; no person reads the JSON form.
    if not g.report.pages:
        out.refuse(
            "the files contain no page of the report, which people sign",
            "name it with --report in addition to the JSON form",
        )
    # A page without the hash of this record was made from other results.
    for path, hashes in g.report.hashes.items():
        if path not in g.report.not_of and g.test_record_source.sha256 not in hashes:
            out.refuse(
                f"{path} does not show {g.test_record_source.path} as it is now",
                f"write the report again with --test-record {g.test_record_source.path} and have "
                "it signed",
            )
    for path in g.report.not_of:
        out.refuse(
            f"{path} does not hold the fingerprint of the report in JSON",
            "write both with the same options",
        )


def _findings(g: Grounds, out: _Gathered) -> None:
    reported = Counter((f.code, f.level, f.message) for f in g.report.findings)
    for d in g.diagnostics:
        key = d.code, d.level, d.message
        # Counted: the same message at two places must be in the report twice.
        reported[key] -= 1
        if d.level is not Severity.INFO and reported[key] < 0:
            out.refuse(
                f"{d.code} at {d.span} is not in the report: {d.message}",
                "write the report again from the current files, and have it signed",
            )
    for f in g.report.findings:
        if f.level is Severity.ERROR:
            out.refuse(f"{f.code} at {f.span}: {f.message}", "fix it; no reason is accepted for it")
        elif f.level is Severity.WARNING:
            _warning(f, g, out)


def _warning(found: Diagnostic, g: Grounds, out: _Gathered) -> None:
    places = _places(found)
    reason = next((r for r in g.reasons if r.subject in places), None)
    if reason is None:
        out.refuse(
            f"{found.code} at {found.span} is not justified: {found.message}",
            f'fix it, or --justify "{places[-1]}=reason by name"',
        )
        return
    out.used.add(reason.subject)
    row = JustifiedFinding(
        code=found.code,
        place=str(found.span),
        message=found.message,
        reason=reason.reason,
        by=reason.by,
    )
    if row not in out.findings:
        out.findings.append(row)


def _places(found: Diagnostic) -> tuple[str, ...]:
    """Return the ways to name the place: with or without folder and column, shortest last."""
    span = found.span
    names = (span.file, PurePath(span.file).name)
    whole = [str(Span(name, span.line, span.column)) for name in names]
    line = f":{span.line}" if span.line else ""
    return tuple(f"{found.code}@{place}" for place in (*whole, *(name + line for name in names)))


def _steps(g: Grounds, whole: str, out: _Gathered) -> None:
    errors = [d for d in g.test_record_findings if d.level is Severity.ERROR]
    for d in errors:
        out.refuse(f"{d.code} at {d.span}: {d.message}", d.hint)
    if g.test_record.fingerprint == whole:
        for step in g.test_record.steps:
            _step(step, g, out)
        _devices(g, out)
        if not g.test_record.made.strip():
            out.refuse(
                f"{g.test_record_source.path} does not say since when there is this configuration",
                "write it again with `fsoe-net test-record … --overwrite`: it keeps what is "
                "filled in",
            )
    elif not errors:  # steps of another configuration do not count
        out.refuse(
            f"{g.test_record_source.path} is the test record of another configuration",
            "write one with `fsoe-net test-record` and do its steps",
        )


def _step(step: TestStep, g: Grounds, out: _Gathered) -> None:
    failed = next(_failures(step), "")
    if failed:
        out.refuse(f"step {step.id} at {step.span}: {failed}", "fix the cause and do it again")
        return
    missing = _missing(step)
    if not missing:
        _done(step, g, out)
    # A step may be left out only if it is not needed for this change.
    elif step.kind not in _LEFT_OUT and (g.before is None or step.id in g.again):
        out.refuse(f"step {step.id} at {step.span}: {missing}", _DO_IT)
    else:
        _let_pass(step.id, f"step {step.id} at {step.span}: {missing}", _DO_IT, g, out)


def _devices(g: Grounds, out: _Gathered) -> None:
    """Check that firmware, serial number and project CRC of each FSoE device were recorded."""
    for device in g.test_record.devices:
        for key in device.blank():
            what = f"{key} {device.subdevice}"
            why = f"{what} at {device.span}: it was not read at the machine"
            fix = "read it; where there is none, write `not applicable: why`"
            _let_pass(what, why, fix, g, out)


def _done(step: TestStep, g: Grounds, out: _Gathered) -> None:
    """Check a step that passed: person, date, and whether its time is plausible."""
    if not step.kind.at_machine:
        return
    who, day = step.machine.by, step.machine.date.strip()[:10]
    if not names_a_person(who):
        out.refuse(
            f"step {step.id} at {step.span}: done by {who!r}, which is not a person",
            "write the name of who did it",
        )
    # A step after the signatures was not known to the people who signed.
    if day > g.verifier.date:
        out.refuse(
            f"step {step.id} at {step.span}: done on {day}, after the day of the signatures, "
            f"{g.verifier.date}",
            "sign after the last step; --date sets the day",
        )
    doubts = [text for text in (_too_early(day, g), _doubt(step, g)) if text]
    if doubts:
        why = f"step {step.id} at {step.span}: {'; '.join(doubts)}"
        _let_pass(step.id, why, "do it again and measure", g, out)


def _too_early(day: str, g: Grounds) -> str:
    """Return an error if a step is dated before the configuration existed; otherwise empty."""
    made = g.test_record.made.strip()[:10]
    return "" if day >= made else f"done on {day}, before this configuration existed: {made}"


def _doubt(step: TestStep, g: Grounds) -> str:
    """Return why a measured time is implausible, or an empty string."""
    measured = step.machine.measured_ms
    if step.kind is not StepKind.TRIGGER or measured is None:
        return ""
    least, most = 2 * g.plan.cycle_ns / 1e6, g.longest_ms.get(step.subject)
    # A time below two bus cycles cannot have been measured.
    if measured < least:
        return f"{measured:g} ms at the machine; the bus alone takes two cycles, {least:g} ms"
    if most is not None and measured > most:
        return (
            f"{measured:g} ms at the machine; by the stated times it is {most:g} ms at most "
            "without a fault"
        )
    return ""


def _let_pass(what: str, why: str, fix: str, g: Grounds, out: _Gathered) -> None:
    """Take a reason for a step or a missing item, or reject it."""
    meant = [r for r in g.reasons if r.subject in (what, f"{what.partition(' ')[0]} *")]
    meant.sort(key=lambda r: r.subject != what)  # the specific reason first
    reason = next(iter(meant), None)
    if reason is None:
        out.refuse(why, f'{fix}, or --justify "{what}=reason by name"')
        return
    out.used.add(reason.subject)
    out.steps.append(JustifiedStep(step=what, reason=reason.reason, by=reason.by))


def _failures(step: TestStep) -> Iterator[str]:
    """Yield failures on any bus: a failure on an emulated bus also counts."""
    for where, seen in (("emulated", step.emulated), ("live", step.live)):
        if seen is not None and seen.outcome is StepOutcome.NOT_AS_EXPECTED:
            yield f"{where}: not as expected"
    if step.is_late:
        yield f"{step.machine.measured_ms:g} ms at the machine, {step.limit_ms:g} ms allowed"
    elif step.is_failed:
        yield "not as expected at the machine"


def _missing(step: TestStep) -> str:
    if step.is_open:
        return "open at the machine"
    timed = step.kind is StepKind.TRIGGER and step.limit_ms is not None
    return "no time measured at the machine" if timed and step.machine.measured_ms is None else ""


def _history(g: Grounds, whole: str, out: _Gathered) -> None:
    if g.before is not None and g.before.whole != whole and not g.interventions:
        out.refuse(
            "this configuration is not the one accepted before, and the change is not stated",
            '--intervention "what was changed and why by NAME"',
        )
