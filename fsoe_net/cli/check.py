"""``fsoe-net check``: what is wrong in the files of a network, at file, line and column."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from fsoe_net.cli.bus import scan_to_compare
from fsoe_net.cli.inputs import input_options, master_option, runtime_option
from fsoe_net.cli.options import FILE, INTERFACE
from fsoe_net.cli.output import FORMATS, exit_code, print_diagnostics, verdict_line
from fsoe_net.cli.terminal import echo
from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.diag.pause import without_collector
from fsoe_net.diag.words import counted
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.project.check import Checked, check_files
from fsoe_net.rules.runtime import Runtime

if TYPE_CHECKING:
    from fsoe_net.project.fix import Fixes

_EPILOG = """\b
Examples:
  fsoe-net check                    # network.yaml of this folder
  fsoe-net check network.yaml
  fsoe-net check --fix              # shows the changes, then asks
  fsoe-net check robot.urdf.xacro --package my_robot=src/my_robot
  fsoe-net check robot.urdf.xacro controllers.yaml
  fsoe-net check transfers.yaml --runtime ros2-2026-08
  fsoe-net check network.yaml machine.eni.xml Beckhoff*.xml TwinSAFE-Project.xml
  fsoe-net check network.yaml --interface eth1    # also the bus
  fsoe-net check network.yaml --format sarif > findings.sarif

Exit codes: 0 no errors or warnings (notes are ignored), 1 errors or warnings, 2 usage error, 3 no
bus or no permission. `fsoe-net explain CODE` explains a finding."""


@click.command("check", epilog=_EPILOG)
@input_options
@master_option
@runtime_option
@click.option(
    "--format",
    "fmt",
    type=click.Choice(FORMATS),
    default="text",
    show_default=True,
    help="Output format. All formats except text are stable.",
)
@click.option(
    "--interface", type=INTERFACE, metavar="IF", help="Compare with the live bus on this interface."
)
@click.option(
    "--socket",
    type=FILE,
    metavar="PATH",
    help="Same as --interface, through the fsn-master at this socket.",
)
@click.option(
    "--scan", "scan_file", type=FILE, metavar="FILE", help="Same as --interface, from a scan.json."
)
@click.option(
    "--fix",
    is_flag=True,
    help="Apply fixes that are unambiguous: swap in and out, correct a size, use the "
    "nearest entry.",
)
@click.option("-y", "--yes", is_flag=True, help="Do not ask before changing AL states or files.")
@click.option("-q", "--quiet", is_flag=True, help="Print no notes and no summary.")
@click.pass_context
@without_collector
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    loading: LoadOptions,
    runtime: str,
    fmt: str,
    interface: str | None,
    socket: str | None,
    scan_file: str | None,
    fix: bool,
    yes: bool,
    quiet: bool,
) -> None:
    """Check the files of a network. Each finding has its place and the next step.

    FILES: a network.yaml (default: the one in this folder), or a URDF or xacro with or without its
    transfer YAML, or a single transfer YAML or slave YAML. Other files are compared with it: ESI,
    ENI, SII image, output of the `ethercat` tool or of `slaveinfo -map`, linuxcnc-ethercat XML,
    ethercat_slaves.yaml, TwinSAFE export, TwinCAT project. The type is recognised by content. With
    a bus or a scan, differences between the bus and the files are also reported.
    """
    present = Runtime(runtime)
    scan = scan_to_compare(interface, socket, scan_file, yes=yes)
    # A fix changes files after asking a person; a program would wait forever.
    if fix and fmt != "text":
        raise click.UsageError("--fix shows changes for people: leave out --format")

    def once() -> Checked:
        checked = check_files(files, loading, runtime=present, scan=scan, compared=True)
        shown = _shown(checked, quiet=quiet)
        print_diagnostics(shown, fmt, runtime=present)
        if fmt == "text" and not quiet:
            echo(verdict_line(checked, scan))
        return checked

    checked = once()
    if fix and checked.network is not None:
        from fsoe_net.project.fix import Fixes

        fixes = Fixes.of(checked.diagnostics, checked.network.sources)
        if _is_wanted(fixes, len(checked.diagnostics), yes=yes):
            fixes.write()
            # Checked again: a fix may reveal another finding.
            echo(f"written: {', '.join(fixes.after)}")
            checked = once()
    ctx.exit(exit_code(_shown(checked, quiet=quiet)))


def _is_wanted(fixes: Fixes, findings: int, *, yes: bool) -> bool:
    """Show the changes, and return whether to write them."""
    if not fixes.after:
        echo("nothing to fix: no hint has exactly one way to follow it")
        return False
    echo(fixes.diff(), nl=False)
    echo(f"{counted(fixes.fixed, 'finding')} of {findings} would be fixed")
    if yes:
        return True
    if sys.stdin is None or not sys.stdin.isatty():
        echo("not written; --yes writes it")
        return False
    return click.confirm("Write this?", default=False)


def _shown(checked: Checked, *, quiet: bool) -> list[Diagnostic]:
    found = checked.diagnostics
    return [d for d in found if d.level is not Severity.INFO] if quiet else found
