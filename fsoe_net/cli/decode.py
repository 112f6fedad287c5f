"""``fsoe-net decode``: FSoE frames from hex or captures, for people."""

from __future__ import annotations

import click

from fsoe_net.capture.decode import naming_of
from fsoe_net.capture.lua import lua_dissector
from fsoe_net.capture.names import Naming
from fsoe_net.cli.decode_inputs import (
    decode_capture,
    decode_hex,
    hex_lines,
    is_file,
    standard_input,
)
from fsoe_net.cli.decode_output import JsonOutput, Output, TextOutput
from fsoe_net.cli.options import FILE, NETWORK_FILE, format_option, output_option
from fsoe_net.cli.terminal import echo
from fsoe_net.cli.write import check_target
from fsoe_net.formats.capture.packets import is_capture
from fsoe_net.formats.shared.files import open_file
from fsoe_net.formats.shared.write_files import STDOUT, write_whole
from fsoe_net.plan.compile import compile_plan
from fsoe_net.project.check import check_files, whole_network

_EPILOG = """\b
Examples:
  fsoe-net decode 2a0400a6340000
  fsoe-net decode "main 2a0000c42d0000 sub 2a0000c42d0000 main 4e2211fddd0000"
  fsoe-net decode bus.pcapng --network network.yaml
  fsoe-net decode --lua network.yaml -o fsoe.lua

INPUT is hex, a capture (pcap, pcapng) or - for hex on standard input. Exit codes: 0 all CRCs are
right, and in a capture every connection was checked; 1 a CRC is wrong, nothing could be checked, or
an input cannot be read; 2 usage error."""


@click.command("decode", epilog=_EPILOG)
@click.argument("inputs", nargs=-1, metavar="[INPUT]...", type=FILE)
@click.option(
    "--network",
    multiple=True,
    type=NETWORK_FILE,
    metavar="FILE",
    help="Network file for names. Repeatable.",
)
@click.option(
    "--lua",
    multiple=True,
    type=NETWORK_FILE,
    metavar="FILE",
    help="Write a Wireshark dissector for this network. Repeatable.",
)
@output_option("File for --lua; default: standard output.")
@click.option("--changes", is_flag=True, help="Show only frames that differ from the previous one.")
@click.option("--summary", is_flag=True, help="Show only the list of connections.")
@format_option
@click.pass_context
def command(
    ctx: click.Context,
    inputs: tuple[str, ...],
    network: tuple[str, ...],
    lua: tuple[str, ...],
    output: str | None,
    overwrite: bool,
    changes: bool,
    summary: bool,
    fmt: str,
) -> None:
    """Decode FSoE frames from hex or from captured EtherCAT traffic.

    In a capture, frames are found by command, ConnID and CRCs; no network file is needed.
    """
    if lua:
        if inputs or network:
            raise click.UsageError("--lua takes the network and writes a dissector; no INPUT")
        _write_lua(lua, output, overwrite=overwrite)
        return
    if output is not None:
        raise click.UsageError("-o belongs to --lua; else redirect standard output")
    captures = _captures(inputs)
    naming = _naming(network)
    out: Output = JsonOutput() if fmt == "json" else TextOutput()
    for path in captures:
        with open_file(path, regular=False) as file:
            decode_capture(path, file, naming, out, changes=changes, summary=summary)
    if not inputs or inputs == ("-",):
        stdin = standard_input()
        # The first bytes identify the format and are not consumed.
        if is_capture(stdin.peek(4)[:4]):
            decode_capture("stdin", stdin, naming, out, changes=changes, summary=summary)
        else:
            decode_hex(hex_lines(stdin), naming, out)
    elif not captures:
        decode_hex([("argument", " ".join(inputs))], naming, out)
    out.end()
    # Frames whose CRC could not be checked are not a pass.
    ctx.exit(int(out.wrong > 0 or out.unchecked))


def _captures(inputs: tuple[str, ...]) -> list[str]:
    captures = [name for name in inputs if name != "-" and is_file(name)]
    # A misspelt file name would otherwise be decoded as hex.
    if captures and len(captures) < len(inputs):
        hexes = [name for name in inputs if name not in captures]
        raise click.UsageError(
            f"{hexes[0]!r} is not a file; captures and hex go into separate calls"
        )
    return captures


def _naming(network: tuple[str, ...]) -> Naming:
    if not network:
        return naming_of(None)
    resolution = whole_network(check_files(network), "nothing decoded")
    return naming_of(resolution)


def _write_lua(files: tuple[str, ...], output: str | None, *, overwrite: bool) -> None:
    check_target(output, overwrite=overwrite, stdout=True)
    resolution = whole_network(check_files(files), "no dissector written")
    text = lua_dissector(resolution, compile_plan(resolution))
    write_whole(output or STDOUT, text.encode("utf-8"), overwrite=overwrite)
    if output is None or output == STDOUT:
        return
    echo(f"{output}: open a capture with: wireshark -X lua_script:{output} FILE", err=True)
