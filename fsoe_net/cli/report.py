"""``fsoe-net report``: the configuration, and a run if there was one, as one HTML page."""

from __future__ import annotations

import click

from fsoe_net import __version__
from fsoe_net.cli.inputs import check_files, input_options, whole_network
from fsoe_net.cli.output import summary
from fsoe_net.cli.plan import write_whole
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

    FILES as for `fsoe-net check`, also other files to compare with: the page then names them. A
    network with an error gets no page.
    """
    checked = check_files(files, packages=packages, xacro_args=xacro_args, compared=True)
    resolution = whole_network(checked, "no page written")
    result = None
    if scenario_file is not None:
        from fsoe_net.cli.run import prepare
        from fsoe_net.run import run_virtual

        session = prepare(resolution, None, scenario_file, virtual=True)
        result = run_virtual(session, session.duration_ns)
    page = render_report(
        resolution.network,
        compile_plan(resolution),
        checked.diagnostics,
        version=__version__,
        run=result,
        references=checked.references,
    )
    write_whole(output, page.encode("utf-8"))
    verdict = "" if result is None else f"; run {'passed' if result.passed else 'FAILED'}"
    click.echo(f"{output}: {summary(checked.diagnostics) or 'no findings'}{verdict}")
    ctx.exit(int(result is not None and not result.passed))
