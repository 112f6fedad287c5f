"""``fsoe-net run``: a network on the emulated bus, or on a live one driven by ``fsn-master``."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import click

from fsoe_net import __version__
from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import CYCLE, FILE, FOLDER, INTERFACE, RUN_TIME, Time, overwrite_option
from fsoe_net.cli.run_output import (
    live_view,
    print_result,
    write_timing,
)
from fsoe_net.cli.stop import ENDS, stop_on
from fsoe_net.cli.terminal import echo, terminal
from fsoe_net.cli.write import check_target
from fsoe_net.core.snapshot import Snapshot
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.write_files import make_folder
from fsoe_net.model.resolve import Resolution
from fsoe_net.observe.capture import CaptureWriter
from fsoe_net.project.check import check_files, whole_network
from fsoe_net.project.simulate import plan_bytes, prepare
from fsoe_net.run.incidents import IncidentRecorder
from fsoe_net.run.live_bus import BusOptions, LiveUpdate, run_on_bus
from fsoe_net.run.master import Master
from fsoe_net.run.result import ConnectionResult, Run
from fsoe_net.run.session import Session, run_live, run_virtual

__all__ = ["command"]

_EPILOG = """\b
Examples:
  fsoe-net run network.yaml
  fsoe-net run network.yaml --scenario scenario.yaml --virtual-time
  fsoe-net run network.yaml --duration 10s --format json > run.json
  fsoe-net run network.yaml --interface eth1

Without --interface the devices are emulated and nothing is sent to a bus. With it, fsn-master
drives the real one: machines may move.

Exit codes: 0 every expectation held, or without any every connection is in Data at the end; 1 not
so, a file has an error, or the live bus was refused; 2 wrong use; 3 the compiled core, fsn-master
or a permission is missing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Files:
    """What a run is made of and what it writes."""

    plan: str | None
    scenario: str | None
    capture: str | None
    incidents: str | None
    stats: str | None
    plot: str | None
    fmt: str


def _bus_options(function: Callable[..., None]) -> Callable[..., None]:
    """Add the options of a live bus."""
    for decorate in (
        click.option(
            "--interface",
            type=INTERFACE,
            metavar="IF",
            help="Live bus: its interface or IgH master.",
        ),
        click.option(
            "--redundant",
            type=INTERFACE,
            metavar="IF2",
            help="Live bus: second interface, the far end of a ring.",
        ),
        click.option(
            "--bus",
            type=click.Choice(["soem", "igh"]),
            help="Live bus: what drives it; default soem.",
        ),
        click.option(
            "--cycle",
            "cycle_ns",
            type=CYCLE,
            metavar="TIME",
            help="Live bus: its cycle; default: the plan's.",
        ),
        click.option(
            "--priority",
            type=click.IntRange(1, 99),
            help="Live bus: SCHED_FIFO priority of the cycle.",
        ),
        click.option(
            "--cpu", type=click.IntRange(0, 1023), help="Live bus: the CPU that runs the cycle."
        ),
        click.option(
            "--wait",
            "wait_ns",
            type=RUN_TIME,
            metavar="TIME",
            help="Live bus: how long to try again while SubDevices are missing.",
        ),
    )[::-1]:
        function = decorate(function)
    return function


@click.command("run", epilog=_EPILOG)
@input_options
@click.option(
    "--plan",
    "plan_file",
    type=FILE,
    metavar="PLAN",
    help="Load this plan; it must be that of FILES.",
)
@click.option(
    "--duration",
    "duration_ns",
    type=RUN_TIME,
    metavar="TIME",
    help="End after so long; default: scenario, else 3s; on a live bus when interrupted.",
)
@click.option(
    "--scenario",
    "scenario_file",
    type=FILE,
    metavar="FILE",
    help="YAML with steps and expectations.",
)
@click.option(
    "--virtual-time",
    is_flag=True,
    help="Emulated: simulated time, as fast as the machine goes; repeatable.",
)
@click.option(
    "--capture", type=FILE, metavar="FILE", help="Write the frames of a virtual run (pcapng)."
)
@click.option(
    "--device-period",
    "device_period_ns",
    type=Time("100us", "1s"),
    metavar="TIME",
    help="Pace of the emulated devices in real time; default 1ms.",
)
@click.option(
    "--incidents",
    type=FOLDER,
    metavar="DIR",
    help="Folder for a file when a connection fails, made if missing; see `fsoe-net incident`.",
)
@_bus_options
@click.option("--stats", type=FILE, metavar="FILE", help="Write timing histograms (CSV).")
@click.option("--plot", type=FILE, metavar="FILE", help="Draw timing histograms (SVG).")
@overwrite_option
@click.option(
    "--format", "fmt", type=click.Choice(["text", "json"]), default="text", show_default=True
)
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    loading: LoadOptions,
    plan_file: str | None,
    duration_ns: int | None,
    scenario_file: str | None,
    virtual_time: bool,
    capture: str | None,
    device_period_ns: int | None,
    incidents: str | None,
    interface: str | None,
    redundant: str | None,
    bus: str | None,
    cycle_ns: int | None,
    priority: int | None,
    cpu: int | None,
    wait_ns: int | None,
    stats: str | None,
    plot: str | None,
    overwrite: bool,
    fmt: str,
) -> None:
    """Run a network on the emulated bus, or with --interface on a live one.

    Emulated: the C core copies the frames in its own thread; emulated devices (MainInstances in the
    safety masters, SubInstances elsewhere) live on the bus at their own pace. Live: fsn-master
    drives the bus until Ctrl-C; killing this program leaves it running. FILES as for `check`.
    """
    wanted = _Files(
        plan=plan_file,
        scenario=scenario_file,
        capture=capture,
        incidents=incidents,
        stats=stats,
        plot=plot,
        fmt=fmt,
    )
    live = {
        "--redundant": redundant,
        "--bus": bus,
        "--cycle": cycle_ns,
        "--priority": priority,
        "--cpu": cpu,
        "--wait": wait_ns,
    }
    emulated = {
        "--virtual-time": virtual_time or None,
        "--capture": capture,
        "--device-period": device_period_ns,
    }
    _check_options(interface, live, emulated, wanted)
    for path in (capture, stats, plot):
        check_target(path, overwrite=overwrite)
    checked = check_files(files, loading)
    resolution = whole_network(checked, "nothing started")
    make_folder(incidents, "--incidents")
    if interface is not None:
        options = BusOptions(
            backend=bus or "soem",
            interface=interface,
            redundant=redundant,
            cycle_ns=cycle_ns,
            priority=priority,
            cpu=cpu,
            wait_s=(wait_ns or 0) / 1e9,
            incidents=incidents,
        )
        result = _on_bus(resolution, options, duration_ns, wanted)
    else:
        period_ns = device_period_ns or 1_000_000
        result = _emulated(resolution, duration_ns, wanted, period_ns, virtual=virtual_time)
    if fmt == "json":
        echo(json.dumps(result.to_json(__version__), indent=2, ensure_ascii=False))
    else:
        print_result(result)
    write_timing(result, stats, plot, text=fmt == "text", overwrite=overwrite)
    ctx.exit(0 if result.passed else 1)


def _check_options(
    interface: str | None,
    live: Mapping[str, object],
    emulated: Mapping[str, object],
    wanted: _Files,
) -> None:
    """Refuse options that do not go together.

    Raises:
        click.UsageError: Some do not.
    """
    if interface is None:
        given = [name for name, value in live.items() if value is not None]
        if given:
            raise click.UsageError(f"{given[0]} is for a live bus: name its --interface too")
        virtual = emulated["--virtual-time"] is not None
        if wanted.capture is not None and not virtual:
            raise click.UsageError("--capture needs --virtual-time: a live run carries no frames")
        if virtual and (wanted.stats is not None or wanted.plot is not None):
            raise click.UsageError("--stats and --plot need real time: leave out --virtual-time")
        return
    if wanted.scenario is not None:
        raise click.UsageError(
            "--scenario acts on emulated devices, and those of a live bus are not ours to press; "
            "with an emulated segment at the other end give it to that: fsoe-net emulate FILES "
            "--interface OTHER_END --scenario FILE"
        )
    given = [name for name, value in emulated.items() if value is not None]
    if given == ["--capture"]:
        raise click.UsageError(
            f"--capture is for virtual runs; `tcpdump -i {interface} -w FILE` records a live bus"
        )
    if given:
        raise click.UsageError(f"{given[0]} is for emulated devices: leave it or --interface out")
    if live["--bus"] == "igh" and live["--redundant"] is not None:
        raise click.UsageError("--redundant: with igh, the second interface is a setting of IgH")
    if live["--redundant"] == interface:
        raise click.UsageError("--redundant: the same interface twice")


def _emulated(
    resolution: Resolution, duration: int | None, wanted: _Files, period_ns: int, *, virtual: bool
) -> Run:
    session = prepare(resolution, wanted.plan, wanted.scenario, virtual=virtual)
    duration_ns = duration or session.duration_ns
    recorder = None
    if wanted.incidents is not None:
        recorder = IncidentRecorder(session, Path(wanted.incidents), background=not virtual)
    if wanted.capture is not None:
        with CaptureWriter(wanted.capture) as writer:
            return run_virtual(session, duration_ns, capture=writer, incidents=recorder)
    if virtual:
        return run_virtual(session, duration_ns, incidents=recorder)
    return _live(session, duration_ns, period_ns, wanted.fmt, recorder)


def _on_bus(
    resolution: Resolution, options: BusOptions, duration_ns: int | None, wanted: _Files
) -> Run:
    plan = plan_bytes(resolution, wanted.plan)
    name = resolution.network.name
    stop = stop_on(ENDS)  # when its terminal goes, the tool goes and the bus stays

    def started(master: Master) -> None:
        echo(
            f"fsn-master (process {master.pid}) starts on {options.interface}; Ctrl-C stops it; "
            f"control socket {master.socket}",
            err=True,
        )

    if wanted.fmt == "json" or not sys.stdout.isatty():
        return run_on_bus(resolution, plan, options, duration_ns, on_start=started, stop=stop)
    from rich.live import Live

    with Live(refresh_per_second=10, transient=True, console=terminal()) as display:

        def show(seen: LiveUpdate) -> None:
            snapshot = seen.snapshot
            statistics = snapshot.cycle.statistics
            display.update(
                live_view(name, seen.connections, statistics, seen.now_s, snapshot.subdevices)
            )

        return run_on_bus(
            resolution,
            plan,
            options,
            duration_ns,
            on_start=started,
            on_update=show,
            stop=stop,
        )


def _live(
    session: Session,
    duration_ns: int,
    period_ns: int,
    fmt: str,
    recorder: IncidentRecorder | None,
) -> Run:
    if fmt == "json" or not sys.stdout.isatty():
        return run_live(session, duration_ns, device_period_ns=period_ns, incidents=recorder)
    from rich.live import Live

    with Live(refresh_per_second=10, transient=True, console=terminal()) as display:

        def show(rows: tuple[ConnectionResult, ...], snapshot: Snapshot, now_s: float) -> None:
            name = session.resolution.network.name
            display.update(live_view(name, rows, snapshot.statistics, now_s))

        return run_live(
            session, duration_ns, device_period_ns=period_ns, on_update=show, incidents=recorder
        )
