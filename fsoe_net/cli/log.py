"""``fsoe-net log``: incident files, and the intervention log of ``fsn-master``."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import datetime

import click

from fsoe_net.cli.incident import incident, incident_table
from fsoe_net.cli.options import (
    FILE,
    format_option,
    overwrite_option,
    read_by,
    read_moment,
    read_sha256,
)
from fsoe_net.cli.terminal import echo, show
from fsoe_net.cli.write import check_target
from fsoe_net.diag.words import counted
from fsoe_net.intervention_log.chain import LogChain, LogFilter
from fsoe_net.intervention_log.document import (
    check_json,
    log_check_document,
    log_document,
    selection_json,
)
from fsoe_net.intervention_log.files import export_log, log_files, read_log, select_entries
from fsoe_net.version import __version__

_EPILOG = """\b
Examples:
  fsoe-net log show /var/log/fsn --since 2026-11-01 --event request
  fsoe-net log verify /var/log/fsn --last HASH
  fsoe-net log export /var/log/fsn -o log.zip
  fsoe-net log incident incidents/NAME.fsnincident

fsn-master --intervention-log DIR writes the log. Exit codes: 0 the chain is intact; 1 it is not, or
a file cannot be read."""


@click.group("log", epilog=_EPILOG)
def command() -> None:
    """Explain incident files; show, verify and export the intervention log of fsn-master."""


command.add_command(incident)
command.add_command(incident_table)


def _chain_options(function: Callable[..., None]) -> Callable[..., None]:
    """Add the files, and the hashes that were kept elsewhere."""
    for decorate in (
        click.option(
            "--last",
            metavar="HASH",
            callback=read_by(read_sha256),
            help="SHA-256 of an entry, kept elsewhere. All entries up to it must be present.",
        ),
        click.option(
            "--after",
            metavar="HASH",
            callback=read_by(read_sha256),
            help="SHA-256 of the entry before the first one, if earlier files are kept elsewhere.",
        ),
        click.argument("files", nargs=-1, required=True, type=FILE, metavar="FILES..."),
    ):
        function = decorate(function)
    return function


@command.command("show")
@click.argument("files", nargs=-1, required=True, type=FILE, metavar="FILES...")
@click.option("--since", metavar="UTC", callback=read_by(read_moment), help="From this time on.")
@click.option("--until", metavar="UTC", callback=read_by(read_moment), help="Before this time.")
@click.option("--event", "events", multiple=True, help="Show only this event. Repeatable.")
@click.option("--user", help="Show only entries that name this user or program.")
@click.option(
    "--most",
    type=click.IntRange(1, 100_000),
    default=200,
    show_default=True,
    help="Show at most this number of entries, the newest ones.",
)
@format_option
@click.pass_context
def show_entries(
    ctx: click.Context,
    files: tuple[str, ...],
    since: datetime | None,
    until: datetime | None,
    events: tuple[str, ...],
    user: str | None,
    most: int,
    fmt: str,
) -> None:
    """Show entries as a table. FILES: the folder of a log, or its files in order."""
    wanted = LogFilter(since=since, until=until, events=events, who=user or "", most=most)
    found = select_entries(log_files(files), wanted)
    if fmt == "json":
        echo(json.dumps(selection_json(found), indent=2))
    else:
        show(log_document(found, __version__), width=100)
    ctx.exit(0 if found.check.holds else 1)


@command.command("verify")
@_chain_options
@format_option
@click.pass_context
def verify_chain(
    ctx: click.Context, files: tuple[str, ...], after: str, last: str, fmt: str
) -> None:
    """Verify the chain over all files: find entries that were changed, removed, inserted or moved.

    FILES: the folder of a log, or its files in order.
    """
    check = read_log(log_files(files), LogChain(after=after, last=last))
    if fmt == "json":
        echo(json.dumps(check_json(check), indent=2))
    else:
        show(log_check_document(check, __version__), width=100)
    ctx.exit(0 if check.holds else 1)


@command.command("export")
@_chain_options
@click.option("-o", "--output", type=FILE, metavar="ZIP", required=True, help="ZIP file to write.")
@overwrite_option
@click.pass_context
def export(
    ctx: click.Context,
    files: tuple[str, ...],
    after: str,
    last: str,
    output: str,
    overwrite: bool,
) -> None:
    """Export the files, their SHA-256 and the result of the verification as one ZIP file.

    The files are not changed, even if the verification fails.
    """
    check_target(output, overwrite=overwrite)
    chain = LogChain(after=after, last=last)
    check = export_log(log_files(files), chain, output, overwrite=overwrite)
    show(log_check_document(check, __version__), width=100)
    echo(f"{output}: {counted(len(check.files), 'file')}, SHA256SUMS, verification.txt and .json")
    ctx.exit(0 if check.holds else 1)
