"""``fsoe-net run``: a network on the emulated bus, or on a live one driven by ``fsn-master``."""

from __future__ import annotations

import contextlib
import json
from typing import Any

import click

from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.live_bus import LiveBus, live_bus_options, run_live_bus
from fsoe_net.cli.options import (
    FILE,
    FOLDER,
    RUN_TIME,
    device_period_option,
    format_option,
    overwrite_option,
    scenario_option,
)
from fsoe_net.cli.run_output import display, print_result, write_timing
from fsoe_net.cli.terminal import echo, is_screen
from fsoe_net.cli.write import check_target
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.write_files import make_folder
from fsoe_net.project.check import check_files, whole_network
from fsoe_net.project.simulate import simulate
from fsoe_net.version import __version__

_EPILOG = """\b
Examples:
  fsoe-net run network.yaml
  fsoe-net run network.yaml --scenario scenario.yaml --virtual-time
  fsoe-net run network.yaml --duration 10s --format json > run.json
  fsoe-net run network.yaml --interface eth1

Without --interface the devices are emulated and nothing is sent to a bus. With --interface,
fsn-master drives the real bus: machines may move.

Exit codes: 0 every expectation was met, or without expectations every connection is in Data at the
end; 1 otherwise, a file has an error, or the live bus was rejected; 2 usage error; 3 the compiled
core, fsn-master or a permission is missing."""


@click.command("run", epilog=_EPILOG)
@input_options
@click.option(
    "--plan",
    "plan_file",
    type=FILE,
    metavar="PLAN",
    help="Load this plan. It must match FILES.",
)
@click.option(
    "--duration",
    "duration_ns",
    type=RUN_TIME,
    metavar="TIME",
    help="Run time. Default: the scenario, else 3s; on a live bus until Ctrl-C.",
)
@scenario_option
@click.option(
    "--virtual-time",
    is_flag=True,
    help="Emulated: run in simulated time, as fast as possible and repeatable.",
)
@click.option(
    "--capture",
    type=FILE,
    metavar="FILE",
    help="Write the frames of a virtual run to this pcapng file.",
)
@device_period_option
@click.option(
    "--incidents",
    type=FOLDER,
    metavar="DIR",
    help="Folder for incident files (created if missing). See `fsoe-net log incident`.",
)
@live_bus_options
@click.option("--stats", type=FILE, metavar="FILE", help="Write timing histograms (CSV).")
@click.option("--plot", type=FILE, metavar="FILE", help="Write timing histograms (SVG).")
@overwrite_option
@format_option
@click.pass_context
def command(
    ctx: click.Context,
    /,
    files: tuple[str, ...],
    loading: LoadOptions,
    live: LiveBus,
    stats: str | None,
    plot: str | None,
    overwrite: bool,
    fmt: str,
    **wanted: Any,
) -> None:
    """Run a network on an emulated bus, or with --interface on a live bus.

    Emulated: the C core copies the frames in its own thread. Emulated devices (MainInstances in the
    safety masters, SubInstances elsewhere) run at their own cycle. Live: fsn-master drives the bus
    until Ctrl-C. If this program is killed, fsn-master continues. FILES as for `check`.
    """
    live.check(wanted, histograms=stats is not None or plot is not None)
    for path in (wanted["capture"], stats, plot):
        check_target(path, overwrite=overwrite)
    resolution = whole_network(check_files(files, loading), "nothing started")
    make_folder(wanted["incidents"], "--incidents")
    make_folder(live.intervention_log, "--intervention-log")
    # In virtual time a run ends before a display could be read.
    is_shown = fmt == "text" and is_screen() and not wanted["virtual_time"]
    with display(resolution.network.name) if is_shown else contextlib.nullcontext() as show:
        if not live.wanted:
            virtual = wanted.pop("virtual_time")
            result = simulate(resolution, **wanted, virtual=virtual, on_update=show)
        else:
            options = live.options(resolution.network, wanted["incidents"])
            result = run_live_bus(resolution, options, wanted, show)
    if fmt == "json":
        echo(json.dumps(result.to_json(__version__), indent=2, ensure_ascii=False))
    else:
        print_result(result)
    # Last, because a disk error must not hide the result.
    write_timing(result, stats, plot, text=fmt == "text", overwrite=overwrite)
    ctx.exit(0 if result.passed else 1)
