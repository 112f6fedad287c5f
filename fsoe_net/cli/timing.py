"""``fsoe-net timing``: watchdogs and reaction times, and their limits."""

from __future__ import annotations

import json
import re

import click

from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import FILE, Time, format_option, overwrite_option
from fsoe_net.cli.output import exit_code, print_diagnostics
from fsoe_net.cli.terminal import echo, show
from fsoe_net.cli.write import check_target
from fsoe_net.errors import InputError
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.files import open_file
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.project.check import check_files, library_of, whole_network
from fsoe_net.report.budget import budget_document, budget_json, budget_picture
from fsoe_net.report.evidence import measured_ms
from fsoe_net.rules.timing import check_timing
from fsoe_net.timing.budget import make_budget

_EPILOG = """\b
Examples:
  fsoe-net timing network.yaml
  fsoe-net timing network.yaml --cycle 4ms --drift 1%
  fsoe-net timing network.yaml --plot reaction.svg
  fsoe-net timing network.yaml --measured run.json    # of fsoe-net run --format json

Exit codes: 0 no errors or warnings, 1 a watchdog or reaction time does not fit or is unknown, or a
file has an error; 2 usage error."""


class _Share(click.ParamType):  # type: ignore[type-arg]
    """A share such as 1% or 0.01."""

    name = "share"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        match = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)\s*(%?)", str(value))
        share = float(match[1]) if match else -1.0
        if match and match[2]:
            share /= 100
        if not 0 <= share <= 0.1:
            self.fail(f"{value!r} is not a share up to 10%; write 1% or 0.01", param, ctx)
        return share


@click.command("timing", epilog=_EPILOG)
@input_options
@click.option(
    "--cycle",
    "cycle_ns",
    type=Time("10us", "4s", bare=False),
    metavar="TIME",
    help="Calculate with this bus cycle, such as 250us or 4ms.",
)
@click.option(
    "--copy-cycles",
    type=click.IntRange(1, 10),
    default=2,
    show_default=True,
    help="Bus cycles per direction: 2 for fsn-master, 3 for a program that copies a cycle later.",
)
@click.option(
    "--drift",
    type=_Share(),
    default="0",
    show_default=True,
    help="Share by which device clocks may be slow. All bounds include it.",
)
@click.option(
    "--measured",
    type=FILE,
    metavar="FILE",
    help="Result of a run (JSON). Its FSoE cycles are used if they are longer.",
)
@click.option("--plot", type=FILE, metavar="FILE", help="Write a diagram (SVG).")
@overwrite_option
@format_option
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    loading: LoadOptions,
    cycle_ns: int | None,
    copy_cycles: int,
    drift: float,
    measured: str | None,
    plot: str | None,
    overwrite: bool,
    fmt: str,
) -> None:
    """Print the timing budget: each watchdog with its interval, each safety function.

    FILES as for `fsoe-net check`. Times and requirements come from `safety_functions` in the
    network file. Missing values are taken from the device library and marked as unverified.
    """
    check_target(plot, overwrite=overwrite)
    checked = check_files(files, loading, timed=False)
    resolution = whole_network(checked, "no budget")
    budget = make_budget(
        resolution,
        library_of(resolution.network),
        cycle=None if cycle_ns is None else cycle_ns / 1e6,
        copy_cycles=copy_cycles,
        drift=drift,
        measured=None if measured is None else _measured(measured),
    )
    found = check_timing(resolution.network, budget, found=checked.diagnostics)
    if plot is not None:
        picture = budget_picture(budget, f"Reaction times of {resolution.network.name}")
        write_whole(plot, picture.encode("utf-8"), overwrite=overwrite)
    if fmt == "json":
        echo(json.dumps(budget_json(budget), indent=2, ensure_ascii=False))
    else:
        show(budget_document(budget))
        echo()
    print_diagnostics(found, err=fmt == "json")
    ctx.exit(exit_code(found))


def _measured(path: str) -> dict[str, float]:
    """Return the longest FSoE cycle of each connection of a run, ms.

    Raises:
        InputError: The file is not the result of a run.
    """
    try:
        with open_file(path) as stream:
            document = json.load(stream)
        times = {
            str(c["name"]): measured_ms(c["fsoe_cycle_ms"]["max"]) for c in document["connections"]
        }
    except (ValueError, KeyError, TypeError, RecursionError) as exc:
        raise InputError(
            f"{path} is not the result of a run; make one with fsoe-net run --format json"
        ) from exc
    return {name: ms for name, ms in times.items() if ms is not None}
