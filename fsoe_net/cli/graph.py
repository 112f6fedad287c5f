"""``fsoe-net graph``: a robot as a picture."""

from __future__ import annotations

from pathlib import Path

import click

from fsoe_net.cli.inputs import input_options, master_option
from fsoe_net.cli.options import output_option
from fsoe_net.cli.terminal import echo
from fsoe_net.document.style import standalone_picture
from fsoe_net.document.write_html import document_html
from fsoe_net.errors import InputError
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.write_files import STDOUT, write_whole
from fsoe_net.project.check import check_files
from fsoe_net.project.snapshot import snapshot
from fsoe_net.report.robot_boxes import robot_graph
from fsoe_net.report.robot_picture import robot_picture

_EPILOG = """\b
Examples:
  fsoe-net graph robot.urdf.xacro controllers.yaml -o robot.svg
  fsoe-net graph robot.urdf.xacro controllers.yaml -o robot.html
  fsoe-net graph network.yaml -o - > network.svg

Exit codes: 0 written, also with unbound ends; 1 nothing could be read, or the file exists; 2 usage
error; 3 the file cannot be written."""


@click.command("graph", epilog=_EPILOG)
@input_options
@master_option
@output_option("Picture (.svg, also -), or page with all findings (.html).", required=True)
def command(files: tuple[str, ...], loading: LoadOptions, output: str, overwrite: bool) -> None:
    """Draw a robot: controllers, joints, channels of SubDevices, FSoE connections.

    FILES: URDF or xacro, files of controllers, or a network, as for `check`. An end that `check`
    reports as unbound is red and has a cross.
    """
    suffix = ".svg" if output == STDOUT else Path(output).suffix
    if suffix not in (".svg", ".html", ".htm"):
        raise click.UsageError(f"-o {output}: write a picture, .svg, or a page, .html")
    checked = check_files(files, loading, compared=True)
    if checked.resolution is None:
        raise InputError("nothing drawn", checked.diagnostics)
    graph = robot_graph(checked.resolution, checked.diagnostics)
    made = standalone_picture(robot_picture(graph))
    if suffix != ".svg":
        made = document_html(snapshot(checked, " ".join(files)))
    write_whole(output, made.encode("utf-8"), overwrite=overwrite)
    echo(f"{output}: {graph.words}", err=output == STDOUT)
