"""``fsoe-net init``: a commented network from any available files."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from fsoe_net.cli.devices import print_devices
from fsoe_net.cli.init_output import write_network
from fsoe_net.cli.init_prompt import answered, refuse, report_questions
from fsoe_net.cli.inputs import master_option, reference_options
from fsoe_net.cli.options import (
    FILE,
    FOLDER,
    INTERFACE,
    format_option,
    output_option,
    refuse_others,
)
from fsoe_net.cli.terminal import echo
from fsoe_net.cli.write import check_folder
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.own.scan_bus import describe_scan
from fsoe_net.proposal.draft import Inputs, make_draft
from fsoe_net.proposal.draft_text import answers_template
from fsoe_net.proposal.gather import Gathered, gather

_EPILOG = """\b
Examples:
  fsoe-net init machine.xml -o machine          # asks for missing facts
  fsoe-net init Beckhoff_ELx9xx.xml             # ESI only: asks for the SubDevices
  fsoe-net init --interface eth1 -o machine
  fsoe-net init bus/ --answers-template > answers.yaml
  fsoe-net init bus/ --answers answers.yaml -o machine
  fsoe-net init --list                          # FSoE devices of the library
  fsoe-net init --list EL1918                   # one of them: process data, frames, figures

If more than one pairing of frames is possible, the connection is unconfirmed. `fsoe-net plan`
rejects it until a person has compared it with the safety project.

Exit codes: 0 written, no error in the network; 1 written with an error, for example an unconfirmed
connection, or nothing written because a file or answer is invalid or a question needs a person;
2 usage error; 3 no bus, or the folder cannot be written."""


@click.command("init", epilog=_EPILOG)
@click.argument("files", nargs=-1, type=FILE)
@reference_options
@master_option
@click.option(
    "--interface", type=INTERFACE, metavar="IF", help="Also scan the bus on this interface."
)
@click.option(
    "--socket",
    type=FILE,
    metavar="PATH",
    help="Same as --interface, through the fsn-master at this socket.",
)
@click.option("-y", "--yes", is_flag=True, help="Do not ask before changing AL states.")
@output_option("Folder to write into; default: the current one.", metavar="DIR", type=FOLDER)
@click.option(
    "--answers",
    "answers_file",
    type=FILE,
    metavar="FILE",
    help="YAML file with the answers to all questions.",
)
@click.option(
    "--answers-template", "template", is_flag=True, help="Print a template for --answers and exit."
)
@click.option(
    "--list",
    "is_list",
    is_flag=True,
    help="List the known FSoE devices; with a name or order number, show that one. The figures are "
    "unverified: only the manual of the revision in use counts.",
)
@click.option(
    "--device-file",
    "own",
    multiple=True,
    type=FILE,
    metavar="FILE",
    help="With --list: your own device file. It takes precedence over the library. Repeatable.",
)
@format_option
@click.option("--no-input", is_flag=True, help="Ask no questions; unanswered items stay open.")
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    loading: LoadOptions,
    interface: str | None,
    socket: str | None,
    yes: bool,
    output: str | None,
    overwrite: bool,
    answers_file: str | None,
    template: bool,
    no_input: bool,
    is_list: bool,
    own: tuple[str, ...],
    fmt: str,
) -> None:
    """Propose a network from any mix of FILES and write a commented network.yaml.

    FILES: any format that `fsoe-net convert` reads, a scan.json, and folders with such files.
    With --list a FILE is the name or order number of a device.
    Known copies and connections are used. Frames are paired by length and direction if only one
    pairing is possible. You are asked for facts that the files do not contain.
    """
    if is_list:
        refuse_others(ctx, "--list", "is_list", "own", "fmt")
        print_devices(files, own, fmt)
        return
    if own or fmt != "text":
        raise click.UsageError("--device-file and --format belong to --list")
    folder = Path(output or ".")
    # Before any question is asked, so that the answers are not lost at the end.
    if not template:
        check_folder(folder, overwrite=overwrite)
    found = gather(files, loading, answers=answers_file)
    if not files and interface is None and socket is None and not found.answers.subdevices:
        raise click.UsageError("name files of the bus, or --interface IF; `--help` shows examples")
    _scan(found, interface, socket, yes=yes)
    inputs = Inputs.of(found)
    if template:
        refuse(made := make_draft(inputs, found.answers))
        echo(answers_template(made, answers_file), nl=False)
        return
    # Without a terminal no person can answer; open questions are then reported.
    asking = not no_input and sys.stdin.isatty()
    made = answered(inputs, found.answers, asking=asking)
    if not asking:
        report_questions(made, answered=answers_file is not None or no_input)
    if write_network(made, folder, overwrite=overwrite):
        ctx.exit(1)


def _scan(found: Gathered, interface: str | None, socket: str | None, *, yes: bool) -> None:
    if interface is None and socket is None:
        return
    from fsoe_net.cli.bus import take_scan

    scan = take_scan(interface, bus=None, socket=socket, yes=yes).scan
    name = f"the bus at {interface or socket}"
    found.buses.append(describe_scan(scan, name))
    found.used.append(name)
