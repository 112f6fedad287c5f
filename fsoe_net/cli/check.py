"""``fsoe-net check``: every mistake in the files of a network, at file, line and column."""

from __future__ import annotations

import click

from fsoe_net.cli.inputs import Checked, check_files, input_options, runtime_option
from fsoe_net.cli.output import FORMATS, counted, exit_code, print_diagnostics, summary
from fsoe_net.diag import Severity
from fsoe_net.rules import Runtime

__all__ = ["command"]

_EPILOG = """\b
Examples:
  fsoe-net check network.yaml
  fsoe-net check robot.urdf.xacro --package my_robot=src/my_robot
  fsoe-net check transfers.yaml --runtime ros2-2026
  fsoe-net check network.yaml --format sarif > findings.sarif"""


@click.command("check", epilog=_EPILOG)
@input_options
@runtime_option
@click.option(
    "--format",
    "fmt",
    type=click.Choice(FORMATS),
    default="text",
    show_default=True,
    help="Output format; all but text are stable.",
)
@click.option("-q", "--quiet", is_flag=True, help="No notes and no summary.")
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    packages: dict[str, str],
    xacro_args: dict[str, str],
    runtime: str,
    fmt: str,
    quiet: bool,
) -> None:
    """Check files of a network and explain every mistake.

    FILES: one network.yaml; or one URDF or xacro, with the transfer YAML it needs or without; or a
    transfer YAML or slave YAML on its own.
    """
    present = Runtime(runtime)
    checked = check_files(files, packages=packages, xacro_args=xacro_args, runtime=present)
    found = checked.diagnostics
    if quiet:
        found = [d for d in found if d.level is not Severity.INFO]
    print_diagnostics(found, fmt, runtime=present)
    if fmt == "text" and not quiet:
        click.echo(_verdict(checked))
    ctx.exit(exit_code(found))


def _verdict(checked: Checked) -> str:
    counts = summary(checked.diagnostics)
    network = checked.network
    bad = exit_code(checked.diagnostics)
    codes = sorted({d.code for d in checked.diagnostics if d.level is not Severity.INFO})
    more = f"; `fsoe-net explain {codes[0]}` says more" if codes else ""
    if network is None or checked.resolution is None:
        return f"nothing checked: {counts}{more}"
    if network.partial:
        return f"{network.name}: checked as far as this file goes" + (
            f"; {counts}{more}" if counts else ", no mistake found"
        )
    size = (
        f"{counted(len(network.subdevices), 'SubDevice')}, "
        f"{counted(len(checked.resolution.connections), 'FSoE connection')}"
    )
    return f"{network.name}: {'' if bad else 'no mistake found, '}{size}" + (
        f"; {counts}{more}" if counts else ""
    )
