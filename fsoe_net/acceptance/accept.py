"""The acceptance record of a network, or all objections to it."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import PurePath

from fsoe_net.acceptance.report import since
from fsoe_net.acceptance.sign_off import Grounds, Reason, Refusal, sign_off
from fsoe_net.acceptance.signed_report import read_signed_report
from fsoe_net.errors import InputError
from fsoe_net.formats.own.acceptance import parse_acceptance
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.own.write_acceptance import write_acceptance
from fsoe_net.formats.shared.files import Collector, read_source
from fsoe_net.formats.shared.limits import MAX_LARGE_BYTES
from fsoe_net.model.acceptance import Acceptance, Intervention, SignedBy
from fsoe_net.model.network import SourceFile
from fsoe_net.model.written import says_something
from fsoe_net.plan.compile import compile_plan
from fsoe_net.project.check import check_files, library_of, whole_network
from fsoe_net.project.known import AcceptedRecord, read_record
from fsoe_net.test_record.trial import read_test_record
from fsoe_net.timing.budget import make_budget
from fsoe_net.version import __version__


def accept(
    files: Sequence[str],
    loading: LoadOptions | None = None,
    *,
    reports: Sequence[str],
    test_record: str,
    author: str,
    verifier: str,
    author_competence: str = "",
    verifier_competence: str = "",
    day: str,
    justify: Sequence[str] = (),
    interventions: Sequence[tuple[str, str]] = (),
    replaces: str | None = None,
    equipment: Sequence[str] = (),
    environment: str = "",
    attach: Sequence[str] = (),
    folder: str = ".",
) -> tuple[Acceptance | None, tuple[Refusal, ...], AcceptedRecord | None]:
    """Make the acceptance record of a network.

    Args:
        files: The network.
        loading: How references in the files are followed.
        reports: The signed report: its pages and its JSON form.
        test_record: The test record as filled in.
        author: Author of the configuration.
        verifier: Verifier of the configuration.
        author_competence: Qualification of the author.
        verifier_competence: Qualification of the verifier.
        day: Day of the signatures, YYYY-MM-DD.
        justify: Reasons as `reason_rows` returns them.
        interventions: Changes since the previous record, with the persons who made them.
        replaces: The previous record.
        equipment: Test equipment, one each.
        environment: Place and conditions of the tests.
        attach: Photos and other files in the folder of the record.
        folder: Folder of the record.

    Returns:
        The record, or `None` with all reasons against it; and the previous record.

    Raises:
        InputError: A file cannot be used, or the network has an error.
    """
    before = None if replaces is None else read_record(replaces)
    report = read_signed_report([read_source(path, most=MAX_LARGE_BYTES) for path in reports])
    # Compared with all files and the library, as the signed report was.
    checked = check_files(files, loading, compared=True)
    resolution = whole_network(checked, "no record written")
    plan = compile_plan(resolution)
    source, filled, wrong = read_test_record(test_record, resolution, plan)
    changed = None if before is None else since(before, resolution, plan)
    # Names of steps contain an equals sign, which also separates the reason.
    named = [step.id for step in filled.steps]
    named += [f"{key} {d.subdevice}" for d in filled.devices for key in d.blank()]
    grounds = Grounds(
        version=__version__,
        resolution=resolution,
        plan=plan,
        report=report,
        diagnostics=checked.diagnostics,
        test_record=filled,
        test_record_source=source,
        test_record_findings=wrong,
        author=SignedBy(name=author.strip(), date=day, competence=author_competence),
        verifier=SignedBy(name=verifier.strip(), date=day, competence=verifier_competence),
        reasons=[_reason(row, named) for row in justify],
        interventions=[Intervention(what=what, by=by, date=day) for what, by in interventions],
        before=None if before is None else before.record,
        before_source=None if before is None else before.source,
        again=() if changed is None else changed.again,
        equipment=tuple(equipment),
        environment=environment,
        attachments=attachments(attach, folder),
        # A time that is shorter than the longest one without a fault is plausible.
        longest_ms={
            f.function.name: f.reaction.polled
            for f in make_budget(resolution, library_of(resolution.network)).functions
            if f.reaction is not None
        },
    )
    return (*sign_off(grounds), before)


def attachments(paths: Sequence[str], folder: str) -> tuple[SourceFile, ...]:
    """Return the attached files of a record with their hashes, by path relative to its folder.

    Raises:
        InputError: A file cannot be read, is named twice, or is outside the folder.
    """
    home = os.path.realpath(folder)
    found: list[SourceFile] = []
    for path in paths:
        source, _ = read_source(path, most=MAX_LARGE_BYTES)
        whole = os.path.realpath(path)
        if os.path.commonpath([whole, home]) != home:
            raise InputError(
                f"{path} is not in the folder of the record, or leads out of it; copy it there"
            )
        inside = PurePath(os.path.relpath(whole, home)).as_posix()
        if inside in (f.path for f in found):
            raise InputError(f"{path} is attached twice; name it once")
        found.append(SourceFile(path=inside, sha256=source.sha256))
    return tuple(found)


def record_bytes(record: Acceptance) -> bytes:
    """Return the record as a file.

    Raises:
        InputError: A name, reason or file name is not valid text; arguments of a command line can
            be arbitrary bytes.
    """
    data = write_acceptance(record).encode("utf-8")
    if parse_acceptance(data, "", Collector()) is None:
        raise InputError(
            "no record written: a name, reason or file name is not UTF-8; write it otherwise"
        )
    return data


def reason_rows(values: Sequence[str]) -> list[str]:
    """Return rows ``WHAT=REASON by NAME``; the rows of an ``@FILE`` take its place.

    Raises:
        ValueError: A row does not have that form.
        InputError: A file cannot be read.
    """
    rows: list[str] = []
    for value in values:
        rows += _lines(value[1:]) if value.startswith("@") else [value]
    for row in rows:
        _reason(row)
    return rows


def intervention_rows(values: Sequence[str]) -> list[tuple[str, str]]:
    """Return the changes and their authors, from rows ``WHAT by NAME``.

    Raises:
        ValueError: A row does not have that form.
    """
    found = [_by(value) for value in values]
    for value, (what, by) in zip(values, found, strict=True):
        if not (what and by):
            raise ValueError(f"{value!r} is not WHAT by NAME")
    return found


def _lines(path: str) -> list[str]:
    _, data = read_source(path, most=MAX_LARGE_BYTES)
    try:
        lines = data.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as exc:
        raise InputError(f"{path} is not text in UTF-8") from exc
    return [line for line in map(str.strip, lines) if line and not line.startswith("#")]


def _reason(row: str, steps: Iterable[str] = ()) -> Reason:
    """Return a reason; the name of a step may itself contain an equals sign."""
    subject, _, rest = row.partition("=")
    for step in steps:
        # The longest matching name is used, because one name may be a prefix of another.
        if row.startswith(f"{step}=") and len(step) > len(subject):
            subject, rest = step, row[len(step) + 1 :]
    reason, by = _by(rest)
    if not (subject.strip() and reason and by):
        raise ValueError(f"{row!r} is not WHAT=REASON by NAME")
    return Reason(subject=subject.strip(), reason=reason, by=by)


def _by(text: str) -> tuple[str, str]:
    words, found, name = text.strip().rpartition(" by ")
    said = found and says_something(words) and says_something(name)
    return (words.strip(), name.strip()) if said else ("", "")
