"""``fsoe-net convert``: descriptions of a bus from one format into another."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import click

from fsoe_net.cli.inputs import master_option, network_of_folder, reference_options
from fsoe_net.cli.options import NETWORK_FILE, output_option
from fsoe_net.cli.output import print_diagnostics
from fsoe_net.cli.terminal import echo
from fsoe_net.diag.words import counted
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.registry import all_formats, all_targets, target_of
from fsoe_net.formats.shared.write_files import STDOUT, write_all, write_whole
from fsoe_net.project.convert import convert_files

_EPILOG = """\b
Examples:
  fsoe-net convert machine.xml -o machine/network.yaml
  fsoe-net convert pdos.txt Beckhoff_EL19xx.xml -o network.yaml
  fsoe-net convert network.yaml -o driver/
  fsoe-net convert network.yaml -o bus.h --to c
  fsoe-net convert start-up.pcapng -o network.yaml
  fsoe-net convert network.yaml machine.eni.xml -o new.eni.xml"""


_HELP = f"""\
Write a description of a bus in another format; several FILES of one bus are joined.

FILES: {", ".join(f.title for f in all_formats().values())}, or a folder that this command wrote. An
ESI or SII image gives the process data of devices named elsewhere.

Content that the format of OUT cannot hold becomes a note. With a network
and an ENI of the same bus, an ENI as output gets the copies of the network; all other bytes of the
ENI are unchanged."""


@click.command("convert", help=_HELP, epilog=_EPILOG)
@click.argument("files", nargs=-1, type=NETWORK_FILE, callback=network_of_folder)
@reference_options
@master_option
@output_option("File to write; a folder for the ROS 2 driver.", metavar="OUT", required=True)
@click.option(
    "--from",
    "source",
    type=click.Choice(list(all_formats())),
    help="Format of all FILES. Default: recognised by content, then by extension.",
)
@click.option(
    "--to",
    "target",
    type=click.Choice(list(all_targets())),
    help="Format of OUT. Default: from its extension.",
)
def command(
    files: tuple[str, ...],
    output: str,
    overwrite: bool,
    source: str | None,
    target: str | None,
    loading: LoadOptions,
) -> None:
    """Write a description of a bus in another format."""
    chosen = target or _target(output)
    made = convert_files(files, chosen, name=Path(output).name, source=source, options=loading)
    print_diagnostics(made.findings, err=True)
    if all_targets()[chosen].is_folder and output != STDOUT:
        made.save(output, overwrite=overwrite)
    else:
        _write(made.files, output, overwrite)
    for note in dict.fromkeys(made.notes):
        echo(f"note: {note}", err=True)
    bus = made.description
    echo(
        f"{output}: {counted(len(bus.subdevices), 'SubDevice')}, "
        f"{counted(len(bus.copies), 'copy')}, {counted(len(made.files), 'file')}",
        err=output == STDOUT,
    )


def _write(files: Mapping[str, bytes], output: str, overwrite: bool) -> None:
    if output != STDOUT:
        write_all(Path(output).parent, files, overwrite=overwrite)
    elif len(files) == 1:
        write_whole(STDOUT, *files.values(), overwrite=overwrite)
    else:
        raise click.UsageError(
            f"-o -: this takes {counted(len(files), 'file')}; name one with -o OUT"
        )


def _target(output: str) -> str:
    if output == STDOUT:
        raise click.UsageError("-o -: standard output has no extension; say the format with --to")
    # A name without an extension is a folder, because formats of several files write folders.
    if output.endswith(os.sep) or Path(output).is_dir() or "." not in Path(output).name:
        return next(name for name, target in all_targets().items() if target.is_folder)
    suffix, target = target_of(output)
    if target is not None:
        return target.name
    if suffix:
        raise click.UsageError(f"{suffix} is read and not written; choose a format with --to")
    raise click.UsageError(f"the format of {output!r} is not known; say it with --to")
