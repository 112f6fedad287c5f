"""``fsoe-net log incident``: why a connection dropped, as one page; many incidents as a table."""

from __future__ import annotations

import json
import os
from pathlib import Path

import click

from fsoe_net.cli.options import FILE, output_option
from fsoe_net.cli.output import print_diagnostics
from fsoe_net.cli.terminal import echo, show
from fsoe_net.cli.write import check_target
from fsoe_net.diag.packages import missing_package
from fsoe_net.diag.words import counted
from fsoe_net.document.write_html import document_html
from fsoe_net.document.write_terminal import document_text
from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.shared.files import open_file
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.incident.evidence import gather
from fsoe_net.incident.incident_facts import facts_json, facts_of
from fsoe_net.incident.incident_read import IncidentReader
from fsoe_net.report.incident_document import incident_document
from fsoe_net.version import __version__

_EPILOG = """\b
Examples:
  fsoe-net log incident incident-20261121T154612.123Z-el1918-ek1914.fsnincident
  fsoe-net log incident FILE --format html -o incident.html

fsn-master --incidents DIR and fsoe-net run --incidents DIR write these files. Exit codes: 0 a cause
was found; 1 none fits, or the file cannot be read."""


@click.command("incident", epilog=_EPILOG)
@click.argument("file", type=FILE)
@click.option(
    "--format",
    "fmt",
    type=click.Choice(["text", "json", "html"]),
    default="text",
    show_default=True,
)
@output_option("File to write; default: standard output.")
@click.pass_context
def incident(ctx: click.Context, file: str, fmt: str, output: str | None, overwrite: bool) -> None:
    """Explain an incident: what happened, the likely cause with its evidence, and the next step.

    Nothing is sent to a bus and no network files are needed: all facts are in FILE.
    """
    check_target(output, overwrite=overwrite, stdout=True)
    with open_file(file, regular=False) as stream:
        facts = facts_of(gather(IncidentReader(file, stream)))
    document = incident_document(facts, __version__)
    if fmt == "html":
        text = document_html(document)
    elif fmt == "json":
        text = json.dumps(facts_json(facts, __version__), indent=2, ensure_ascii=False) + "\n"
    else:
        text = document_text(document)
    if output is not None:
        write_whole(output, text.encode("utf-8"), overwrite=overwrite)
    elif fmt == "text":
        show(document, width=100)
    else:
        echo(text, nl=False)
    # A page without a likely cause is not an answer; the exit code shows this to scripts.
    ctx.exit(0 if facts.verdicts.likely else 1)


_TABLE_EPILOG = """\b
Examples:
  fsoe-net log incident-table incidents/ --parquet incidents.parquet
  fsoe-net log incident-table /var/lib/fsn --machine press-3 --parquet incidents.parquet
  duckdb -c "SELECT machine, count(*) FROM 'incidents.parquet' GROUP BY ALL"

Exit codes: 0 every file is in the table; 1 a file cannot be read, the others are in the table;
3 the table cannot be written, or duckdb is not installed."""


@click.command("incident-table", epilog=_TABLE_EPILOG)
@click.argument("files", nargs=-1, required=True, type=FILE, metavar="FILES...")
@click.option(
    "--parquet", type=FILE, required=True, metavar="FILE", help="Table to create or to add to."
)
@click.option("--machine", default="", help="Machine of all files. Default: the folder of each.")
@click.pass_context
def incident_table(ctx: click.Context, files: tuple[str, ...], parquet: str, machine: str) -> None:
    """Collect incident files of many machines in one Parquet file, a row for each incident.

    FILES: incident files, or folders with them. Incidents that the table already has are skipped:
    the SHA-256 of the content identifies them.
    """
    check_target(parquet, overwrite=True)
    try:
        from fsoe_net.fleet.incident_table import update_table
    except ImportError as exc:
        raise EnvironmentFault(missing_package("incident-table", exc.name, "tables")) from exc
    result = update_table(Path(parquet), files, machine)
    for failure in result.failures:
        echo(f"error: {failure.message}", err=True)
        print_diagnostics(failure.diagnostics, err=True)
    if os.path.exists(parquet):
        echo(f"{parquet}: {counted(result.rows, 'incident')}, {result.added} new")
    ctx.exit(1 if result.failures else 0)
