"""``fsoe-net accept``: write down who accepted which configuration, and on what grounds."""

from __future__ import annotations

import datetime
import hashlib
from collections.abc import Iterable

import click

from fsoe_net import __version__
from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import FILE, output_option
from fsoe_net.cli.terminal import echo
from fsoe_net.cli.write import check_target
from fsoe_net.diag.words import counted
from fsoe_net.errors import InputError
from fsoe_net.formats.acceptance import parse_acceptance
from fsoe_net.formats.files import Collector, read_bytes
from fsoe_net.formats.options import LoadOptions
from fsoe_net.model.acceptance import Acceptance, Intervention, SignedBy, says_something
from fsoe_net.model.network import SourceFile
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import short_code
from fsoe_net.project.check import check_files, whole_network
from fsoe_net.project.known import Record, read_record
from fsoe_net.project.report import read_protocol, since
from fsoe_net.report.sign_off import Grounds, Reason, Refusal, read_signed_report, sign_off
from fsoe_net.save.acceptance import write_acceptance
from fsoe_net.save.files import write_whole

__all__ = ["command"]

_MOST_BYTES = 256 * 1024 * 1024
_EPILOG = """\b
Example:
  fsoe-net test-protocol network.yaml --virtual -o protocol.yaml    # then do it at the machine
  fsoe-net report network.yaml --protocol protocol.yaml -o report.html
  fsoe-net report network.yaml --protocol protocol.yaml -o report.json
  fsoe-net accept network.yaml --protocol protocol.yaml --report report.html --report report.json
      --author "A. Meier" --verifier "B. Kaya" -o acceptance.yaml
      --justify "FSN607@network.yaml:43=both sheets were read, copies in folder 7 by B. Kaya"
      --justify "loss io_box=soldered in, cannot be unplugged by B. Kaya"

Afterwards: fsoe-net verify network.yaml --accepted acceptance.yaml (or --socket PATH), and
fsoe-net report network.yaml --accepted acceptance.yaml -o report.html for what has changed since.

Exit codes: 0 written, 1 refused with every reason, or a file cannot be read, 2 wrong use.

A record is evidence. It is no certificate, and nobody is who the record says but by the signature
on the report."""


@click.command("accept", epilog=_EPILOG)
@input_options
@click.option(
    "--report",
    "reports",
    multiple=True,
    required=True,
    type=FILE,
    metavar="FILE",
    help="The signed report: the page, and the same in JSON.",
)
@click.option(
    "--protocol",
    required=True,
    type=FILE,
    metavar="FILE",
    help="The test protocol as it was filled in at the machine.",
)
@click.option("--author", required=True, metavar="NAME", help="Who made the configuration.")
@click.option("--verifier", required=True, metavar="NAME", help="Who checked it: not the author.")
@click.option("--date", metavar="YYYY-MM-DD", help="Day of the signatures; today without it.")
@click.option(
    "--justify",
    multiple=True,
    metavar="WHAT=REASON by NAME",
    help="Let a warning (CODE@file:line) or a step that was not done (its id, `loss *`) "
    "pass; may be given again. @FILE: one per line.",
)
@click.option(
    "--intervention",
    multiple=True,
    metavar="WHAT by NAME",
    help="What was changed since the record before, and why; may be given again.",
)
@click.option("--replaces", type=FILE, metavar="FILE", help="The acceptance record before.")
@output_option("File to write (.yaml).", required=True)
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    loading: LoadOptions,
    reports: tuple[str, ...],
    protocol: str,
    author: str,
    verifier: str,
    date: str | None,
    justify: tuple[str, ...],
    intervention: tuple[str, ...],
    replaces: str | None,
    output: str,
    overwrite: bool,
) -> None:
    """Write the acceptance record of a network, or say everything that stands against it.

    It wants a report of this very configuration without errors, each warning justified by name and
    reason, a test protocol whose steps were done at the machine, and a verifier who is not the
    author. FILES as for `fsoe-net check`.
    """
    check_target(output, overwrite=overwrite)
    day = _day(date)
    rows = _rows(justify)
    for row in rows:
        _reason(row)  # what is no reason is told before files are read
    changes = [_intervention(row, day) for row in intervention]
    before = None if replaces is None else read_record(replaces)
    report = read_signed_report([_read(path) for path in reports])
    checked = check_files(files, loading, compared=True)
    resolution = whole_network(checked, "no record written")
    plan = compile_plan(resolution)
    source, filled, wrong = read_protocol(protocol, resolution, plan)
    changed = None if before is None else since(before, resolution, plan)
    record, refusals = sign_off(
        Grounds(
            version=__version__,
            resolution=resolution,
            plan=plan,
            report=report,
            diagnostics=checked.diagnostics,
            protocol=filled,
            protocol_source=source,
            protocol_findings=wrong,
            author=SignedBy(name=author.strip(), date=day),
            verifier=SignedBy(name=verifier.strip(), date=day),
            reasons=[_reason(row, [step.id for step in filled.steps]) for row in rows],
            interventions=changes,
            before=None if before is None else before.record,
            before_source=None if before is None else before.source,
            again=() if changed is None else changed.again,
        )
    )
    if record is None:
        _refuse(refusals)
        ctx.exit(1)
    write_whole(output, _readable(record), overwrite=overwrite)
    _say(output, record, before)


def _day(date: str | None) -> str:
    if date is None:
        return datetime.date.today().isoformat()
    try:
        return datetime.date.fromisoformat(date).isoformat()
    except ValueError as exc:
        raise click.BadParameter(f"{date!r} is no date; write YYYY-MM-DD") from exc


def _rows(values: tuple[str, ...]) -> list[str]:
    rows = []
    for value in values:
        if not value.startswith("@"):
            rows.append(value)
            continue
        _, data = _read(value[1:])
        try:
            lines = data.decode("utf-8-sig").splitlines()
        except UnicodeDecodeError as exc:
            raise InputError(f"{value[1:]} is no text in UTF-8") from exc
        rows += [line for line in map(str.strip, lines) if line and not line.startswith("#")]
    return rows


def _reason(row: str, steps: Iterable[str] = ()) -> Reason:
    """Return a reason; names in steps may have an equals sign of their own."""
    subject, _, rest = row.partition("=")
    for step in steps:
        if row.startswith(f"{step}=") and len(step) > len(subject):
            subject, rest = step, row[len(step) + 1 :]
    reason, by = _by(rest)
    if not (subject.strip() and reason and by):
        raise click.BadParameter(f"{row!r} is not WHAT=REASON by NAME", param_hint="--justify")
    return Reason(subject=subject.strip(), reason=reason, by=by)


def _intervention(row: str, day: str) -> Intervention:
    what, by = _by(row)
    if not (what and by):
        raise click.BadParameter(f"{row!r} is not WHAT by NAME", param_hint="--intervention")
    return Intervention(what=what, by=by, date=day)


def _by(text: str) -> tuple[str, str]:
    words, found, name = text.strip().rpartition(" by ")
    said = found and says_something(words) and says_something(name)
    return (words.strip(), name.strip()) if said else ("", "")


def _read(path: str) -> tuple[SourceFile, bytes]:
    out = Collector()
    data = read_bytes(path, out, most=_MOST_BYTES)
    if data is None:
        raise InputError(f"{path} cannot be read", out.diagnostics)
    return SourceFile(path=path, sha256=hashlib.sha256(data).hexdigest()), data


def _readable(record: Acceptance) -> bytes:
    """Return the bytes of the file; bytes of the command line may be no text that can be kept."""
    data = write_acceptance(record).encode("utf-8")
    if parse_acceptance(data, "", Collector()) is None:
        raise InputError(
            "no record written: a name, reason or file name is no text in UTF-8; write it otherwise"
        )
    return data


def _refuse(refusals: tuple[Refusal, ...]) -> None:
    for refusal in refusals:
        echo("refused: ", fg="red", bold=True, nl=False, err=True)
        echo(refusal.what, err=True)
        echo(f"  next: {refusal.mend}", err=True)
    echo(f"no record written: {counted(len(refusals), 'reason')}", err=True)


def _say(output: str, record: Acceptance, before: Record | None) -> None:
    echo(
        f"{output}: {short_code(record.whole)}, author {record.author.name}, verifier "
        f"{record.verifier.name}, {record.verifier.date}"
    )
    findings, steps = len(record.findings), len(record.steps_left_out)
    if findings or steps:
        echo(
            f"let pass: {counted(findings, 'warning')}, {counted(steps, 'step')} of "
            f"{record.steps}, each by name and reason"
        )
    if before is not None:
        same = before.fingerprint.whole == record.whole
        word = "the same configuration as" if same else "replaces"
        echo(f"{word} {before.source.path}, {before.fingerprint.short}")
    echo("Sign the report; keep it and this record under version control.")
