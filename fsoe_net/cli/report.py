"""``fsoe-net report``: the configuration, and a run if there was one, as one HTML page."""

from __future__ import annotations

import click

from fsoe_net import __version__
from fsoe_net.cli.inputs import check_files, input_options
from fsoe_net.cli.output import print_diagnostics, summary
from fsoe_net.cli.plan import write_whole
from fsoe_net.diag import Severity
from fsoe_net.errors import InputError
from fsoe_net.plan import compile_plan
from fsoe_net.report import render_report

__all__ = ["command"]

_EPILOG = """\b
Examples:
  fsoe-net report network.yaml -o report.html
  fsoe-net report network.yaml --scenario scenario.yaml -o report.html"""


@click.command("report", epilog=_EPILOG)
@input_options
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False), required=True, help="Page to write."
)
@click.option(
    "--scenario",
    "scenario_file",
    type=click.Path(),
    help="Run this scenario in virtual time and put the result into the page.",
)
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    packages: dict[str, str],
    xacro_args: dict[str, str],
    output: str,
    scenario_file: str | None,
) -> None:
    """Write a report page: topology, connections, copy table with byte ranges, findings, run.

    FILES as for `fsoe-net check`. A network with an error gets no page.
    """
    checked = check_files(files, packages=packages, xacro_args=xacro_args)
    errors = [d for d in checked.diagnostics if d.level is Severity.ERROR]
    if errors or checked.resolution is None:
        print_diagnostics(errors, err=True)
        raise InputError(f"no page written: {summary(errors) or 'nothing to report'}")
    if checked.resolution.network.partial or not checked.resolution.transfers:
        raise InputError("no page written: these files alone are no whole network")
    result = None
    if scenario_file is not None:
        from fsoe_net.cli.run import prepare
        from fsoe_net.run import run_virtual

        session = prepare(checked.resolution, None, scenario_file, virtual=True)
        result = run_virtual(session, session.duration_ns)
    page = render_report(
        checked.resolution.network,
        compile_plan(checked.resolution),
        checked.diagnostics,
        version=__version__,
        run=result,
    )
    write_whole(output, page.encode("utf-8"))
    verdict = "" if result is None else f"; run {'passed' if result.passed else 'FAILED'}"
    click.echo(f"{output}: {summary(checked.diagnostics) or 'no findings'}{verdict}")
    ctx.exit(int(result is not None and not result.passed))
