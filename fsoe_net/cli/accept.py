"""``fsoe-net accept``: write down who accepted which configuration, and on what grounds."""

from __future__ import annotations

import datetime
from typing import Any

import click

from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import FILE, output_option, read_by
from fsoe_net.cli.terminal import echo
from fsoe_net.cli.write import check_target
from fsoe_net.diag.words import counted
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.model.acceptance import Acceptance
from fsoe_net.plan.fingerprint import short_code
from fsoe_net.project.accept import accept, intervention_rows, reason_rows, record_bytes
from fsoe_net.project.known import AcceptedRecord
from fsoe_net.report.sign_off import Refusal

__all__ = ["command"]

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


def _day(value: str | None) -> str:
    if value is None:
        return datetime.date.today().isoformat()
    try:
        day = datetime.date.fromisoformat(value)
    except ValueError as exc:
        raise ValueError(f"{value!r} is not a date; write YYYY-MM-DD") from exc
    if day > datetime.date.today():
        raise ValueError(f"{value} is in the future; nobody has signed then")
    return day.isoformat()


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
@click.option(
    "--date",
    "day",
    callback=read_by(_day),
    metavar="YYYY-MM-DD",
    help="Day of the signatures; today without it.",
)
@click.option(
    "--justify",
    multiple=True,
    callback=read_by(reason_rows),
    metavar="WHAT=REASON by NAME",
    help="Let a warning (CODE@file:line) or a step that was not done (its id, `loss *`) "
    "pass; may be given again. @FILE: one per line.",
)
@click.option(
    "--intervention",
    "interventions",
    multiple=True,
    callback=read_by(intervention_rows),
    metavar="WHAT by NAME",
    help="What was changed since the record before, and why; may be given again.",
)
@click.option("--replaces", type=FILE, metavar="FILE", help="The acceptance record before.")
@output_option("File to write (.yaml).", required=True)
@click.pass_context
def command(
    ctx: click.Context,
    /,
    files: tuple[str, ...],
    loading: LoadOptions,
    output: str,
    overwrite: bool,
    **given: Any,
) -> None:
    """Write the acceptance record of a network, or say everything that stands against it.

    It wants a report of this very configuration without errors, each warning justified by name and
    reason, a test protocol whose steps were done at the machine, and a verifier who is not the
    author. FILES as for `fsoe-net check`.
    """
    check_target(output, overwrite=overwrite)
    record, refusals, before = accept(files, loading, **given)
    if record is None:
        _refuse(refusals)
        ctx.exit(1)
    write_whole(output, record_bytes(record), overwrite=overwrite)
    _say(output, record, before)


def _refuse(refusals: tuple[Refusal, ...]) -> None:
    for refusal in refusals:
        echo("refused: ", fg="red", bold=True, nl=False, err=True)
        echo(refusal.what, err=True)
        echo(f"  next: {refusal.fix}", err=True)
    echo(f"no record written: {counted(len(refusals), 'reason')}", err=True)


def _say(output: str, record: Acceptance, before: AcceptedRecord | None) -> None:
    echo(
        f"{output}: {short_code(record.whole)}, author {record.author.name}, verifier "
        f"{record.verifier.name}, {record.verifier.date}"
    )
    findings, steps = len(record.findings), len(record.steps_left_out)
    if findings or steps:
        echo(
            f"let pass: {counted(findings, 'warning')}, {counted(steps, 'other')}, each by name "
            "and reason"
        )
    if before is not None:
        same = before.fingerprint.whole == record.whole
        word = "the same configuration as" if same else "replaces"
        echo(f"{word} {before.source.path}, {before.fingerprint.short}")
    echo("Sign the report; keep it and this record under version control.")
