"""``fsoe-net accept``: write down who accepted which configuration, and on what grounds."""

from __future__ import annotations

import os
from typing import Any

import click
from click.core import ParameterSource

from fsoe_net.acceptance.accept import accept, intervention_rows, reason_rows, record_bytes
from fsoe_net.acceptance.signatures import ROLES, sign_record
from fsoe_net.cli.accept_options import circumstance_options, day_of_signature
from fsoe_net.cli.accept_output import (
    EPILOG,
    print_record,
    print_refusals,
    print_signature,
)
from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import FILE, output_option, read_by
from fsoe_net.cli.write import check_target
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.project.known import is_record

_NEEDED = ("reports", "test_record", "author", "verifier", "output")
"""Of a network; a record that is only signed holds them."""
_MORE = (
    "author_competence",
    "verifier_competence",
    "day",
    "justify",
    "interventions",
    "replaces",
    "equipment",
    "environment",
    "attach",
)


@click.command("accept", epilog=EPILOG)
@input_options
@click.option(
    "--report",
    "reports",
    multiple=True,
    type=FILE,
    metavar="FILE",
    help="Signed report: the page and its JSON form. Give the option twice.",
)
@click.option(
    "--test-record",
    type=FILE,
    metavar="FILE",
    help="Test record that was filled in at the machine.",
)
@click.option("--author", metavar="NAME", help="Name of the author of the configuration.")
@click.option("--verifier", metavar="NAME", help="Name of the verifier. Must not be the author.")
@click.option(
    "--date",
    "day",
    callback=read_by(day_of_signature),
    metavar="YYYY-MM-DD",
    help="Date of the signatures. Default: today.",
)
@click.option(
    "--justify",
    multiple=True,
    callback=read_by(reason_rows),
    metavar="WHAT=REASON by NAME",
    help="Accept a warning (CODE@file:line) or a test step that was not done (its ID, "
    "`loss *`). Repeatable. @FILE reads one per line.",
)
@click.option(
    "--intervention",
    "interventions",
    multiple=True,
    callback=read_by(intervention_rows),
    metavar="WHAT by NAME",
    help="Change since the previous record, with its reason. Repeatable.",
)
@circumstance_options
@click.option("--replaces", type=FILE, metavar="FILE", help="Previous acceptance record.")
@click.option(
    "--sign",
    "key",
    type=FILE,
    metavar="KEY",
    help="Sign the new record, or the record given as FILES, with this SSH key. The "
    "signature is a file next to it.",
)
@click.option("--as", "role", type=click.Choice(ROLES), help="Role of the person who signs.")
@output_option("File to write (.yaml).")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    files: tuple[str, ...],
    loading: LoadOptions,
    output: str | None,
    overwrite: bool,
    key: str | None,
    role: str | None,
    **given: Any,
) -> None:
    """Write the acceptance record of a network, or list every reason against it.

    Required: a report of exactly this configuration without errors, a justification with name and
    reason for each warning, a test record with all steps done at the machine, and a verifier who
    is not the author. FILES as for `fsoe-net check`, or an acceptance record to be signed.
    """
    if (key is None) != (role is None):
        raise click.UsageError("--sign KEY and --as author|verifier belong together")
    if len(files) == 1 and key is not None and role is not None and is_record(files[0]):
        _only_sign(ctx, files[0])
        print_signature(sign_record(files[0], role, key, overwrite=overwrite))
        return
    missing = [name for name in _NEEDED if not ctx.params[name]]
    if missing or output is None:
        raise click.MissingParameter(ctx=ctx, param=_option(ctx, missing[0]))
    check_target(output, overwrite=overwrite)
    folder = os.path.dirname(output) or "."
    record, refusals, before = accept(files, loading, folder=folder, **given)
    if record is None:
        print_refusals(refusals)
        ctx.exit(1)
    write_whole(output, record_bytes(record), overwrite=overwrite)
    print_record(output, record, before)
    if key is not None and role is not None:
        print_signature(sign_record(output, role, key, overwrite=overwrite))


def _option(ctx: click.Context, name: str) -> click.Parameter:
    return next(p for p in ctx.command.params if p.name == name)


def _only_sign(ctx: click.Context, path: str) -> None:
    """Refuse options that say what a record holds: the one that is signed holds it already."""
    for name in (*_NEEDED, *_MORE):
        if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            option = _option(ctx, name).opts[-1]
            raise click.UsageError(f"{option}: {path} is a record, which is only signed")
