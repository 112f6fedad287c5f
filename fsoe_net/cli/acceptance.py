"""``fsoe-net acceptance``: who accepted which configuration, and whether it is still the same."""

from __future__ import annotations

import os
from typing import Any

import click

from fsoe_net.acceptance.accept import accept, intervention_rows, reason_rows, record_bytes
from fsoe_net.acceptance.signatures import ROLES, sign_record
from fsoe_net.cli.acceptance_options import circumstance_options, day_of_signature
from fsoe_net.cli.acceptance_output import (
    EPILOG,
    print_record,
    print_refusals,
    print_signature,
)
from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import FILE, output_option, overwrite_option, read_by
from fsoe_net.cli.verify import verify
from fsoe_net.cli.write import check_target
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.write_files import write_whole


@click.group("acceptance", epilog=EPILOG)
def command() -> None:
    """Record who accepted which configuration; sign the record; compare with it."""


command.add_command(verify)


@command.command("record", epilog=EPILOG)
@input_options
@click.option(
    "--report",
    "reports",
    multiple=True,
    required=True,
    type=FILE,
    metavar="FILE",
    help="Signed report: the page and its JSON form. Give the option twice.",
)
@click.option(
    "--test-record",
    required=True,
    type=FILE,
    metavar="FILE",
    help="Test record that was filled in at the machine.",
)
@click.option(
    "--author", required=True, metavar="NAME", help="Name of the author of the configuration."
)
@click.option(
    "--verifier",
    required=True,
    metavar="NAME",
    help="Name of the verifier. Must not be the author.",
)
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
@output_option("File to write (.yaml).", required=True)
@click.pass_context
def record(
    ctx: click.Context,
    /,
    files: tuple[str, ...],
    loading: LoadOptions,
    output: str,
    overwrite: bool,
    **given: Any,
) -> None:
    """Write the acceptance record of a network, or list every reason against it.

    Required: a report of exactly this configuration without errors, a justification with name and
    reason for each warning, a test record with all steps done at the machine, and a verifier who
    is not the author. FILES as for `fsoe-net check`.
    """
    check_target(output, overwrite=overwrite)
    folder = os.path.dirname(output) or "."
    made, refusals, before = accept(files, loading, folder=folder, **given)
    if made is None:
        print_refusals(refusals)
        ctx.exit(1)
    write_whole(output, record_bytes(made), overwrite=overwrite)
    print_record(output, made, before)


@command.command("sign", epilog=EPILOG)
@click.argument("file", type=FILE, metavar="RECORD")
@click.option("--key", type=FILE, metavar="KEY", required=True, help="SSH key of this person.")
@click.option(
    "--as", "role", type=click.Choice(ROLES), required=True, help="Role of the person who signs."
)
@overwrite_option
def sign(file: str, key: str, role: str, overwrite: bool) -> None:
    """Sign an acceptance record as it is. The signature is a file next to it."""
    print_signature(sign_record(file, role, key, overwrite=overwrite))
