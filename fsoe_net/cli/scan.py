"""``fsoe-net scan``: the content of a live bus as a table, a document, or initial files."""

from __future__ import annotations

import click

from fsoe_net.cli.bus import take_scan
from fsoe_net.cli.options import FILE, FOLDER, INTERFACE, format_option, output_option
from fsoe_net.cli.scan_output import scan_document
from fsoe_net.cli.terminal import echo, show
from fsoe_net.diag.words import counted
from fsoe_net.formats.shared.write_files import write_all
from fsoe_net.live.scan_files import compact_json, scan_files

_EPILOG = """\b
Examples:
  fsoe-net scan --interface eth1
  fsoe-net scan --interface eth1 --yes -o bus    # network.yaml, devices/, scan.json
  fsoe-net scan --socket /run/fsn-master-eth1.sock --format json
  fsoe-net check network.yaml --interface eth1   # compares

Exit codes: 0 done, 1 the bus or its answer was rejected, 2 usage error, or no terminal to ask;
3 no fsn-master, interface or permission."""


@click.command("scan", epilog=_EPILOG)
@click.option(
    "--interface",
    type=INTERFACE,
    metavar="IF",
    help="Interface of the bus, or the IgH master of a running fsn-master.",
)
@click.option("--bus", type=click.Choice(["soem"]), help="Backend. Default: soem.")
@click.option("--socket", type=FILE, metavar="PATH", help="Control socket of a running fsn-master.")
@format_option
@output_option("Folder for network.yaml and its files.", metavar="DIR", type=FOLDER)
@click.option("-y", "--yes", is_flag=True, help="Do not ask before changing AL states.")
def command(
    interface: str | None,
    bus: str | None,
    socket: str | None,
    fmt: str,
    output: str | None,
    overwrite: bool,
    yes: bool,
) -> None:
    """Read a bus: identities, states, process data, FSoE values.

    If fsn-master is running, it answers and nothing on the bus changes. Otherwise every SubDevice
    is set to PREOP; the command explains the consequences and asks first.
    """
    if overwrite and output is None:
        raise click.UsageError("--overwrite is for the files of -o DIR")
    taken = take_scan(interface, bus=bus, socket=socket, yes=yes)
    if fmt == "json":
        echo(compact_json(taken.document))
    else:
        show(scan_document(taken.scan))
    if output is not None:
        # Only for -o: reading the files back takes a moment.
        files = scan_files(taken)
        texts = {name: text.encode("utf-8") for name, text in files.texts.items()}
        write_all(output, texts, overwrite=overwrite)
        names = ", ".join(files.texts)
        echo(f"{counted(len(files.texts), 'file')} in {output}: {names}", err=True)
        for text in files.left_out:
            echo(f"left out: {text}", err=True)
