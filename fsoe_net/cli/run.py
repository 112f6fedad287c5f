"""``fsoe-net run``: bring a network up on the emulated bus, copied by the C core."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from fsoe_net import __version__
from fsoe_net.cli.inputs import check_files, input_options, whole_network
from fsoe_net.cli.output import summary
from fsoe_net.core import Snapshot
from fsoe_net.diag import Severity
from fsoe_net.errors import InputError
from fsoe_net.load import Collector, load_scenario, read_bytes
from fsoe_net.model import Resolution, Scenario
from fsoe_net.observe import CaptureWriter
from fsoe_net.plan import compile_plan, decode_plan
from fsoe_net.run import (
    ConnectionResult,
    RunEvent,
    RunResult,
    Session,
    counted_session_ids,
    random_session_ids,
    run_live,
    run_virtual,
    state_text,
)

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["command", "interesting", "prepare", "scenario_of"]

_EPILOG = """\b
Examples:
  fsoe-net run network.yaml
  fsoe-net run network.yaml --scenario scenario.yaml --virtual-time
  fsoe-net run network.yaml --duration 10 --format json > run.json

The devices are emulated; nothing is sent to a real bus."""


class _Finite(click.FloatRange):
    """A number in a range; ``nan`` slips through the comparisons of `click.FloatRange`."""

    def convert(
        self, value: str | float, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        number = float(super().convert(value, param, ctx))  # type: ignore[arg-type]  # click's stub
        if math.isnan(number):
            self.fail(f"{value} is no number.", param, ctx)
        return number


_WEEK_S = 7 * 24 * 3600


@click.command("run", epilog=_EPILOG)
@input_options
@click.option("--plan", "plan_file", type=click.Path(), help="Plan the core loads.")
@click.option(
    "--duration", type=_Finite(min=0.001, max=_WEEK_S), help="Seconds; default: scenario, else 3."
)
@click.option("--scenario", "scenario_file", type=click.Path(), help="Steps and expectations.")
@click.option("--virtual-time", is_flag=True, help="As fast as the machine goes, repeatable.")
@click.option("--capture", type=click.Path(), help="Write the frames of a virtual run (pcapng).")
@click.option(
    "--device-period-ms",
    type=_Finite(min=0.1, max=1000),
    default=1.0,
    show_default=True,
    help="Pace of the emulated devices in a live run.",
)
@click.option(
    "--format", "fmt", type=click.Choice(["text", "json"]), default="text", show_default=True
)
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    packages: dict[str, str],
    xacro_args: dict[str, str],
    plan_file: str | None,
    duration: float | None,
    scenario_file: str | None,
    virtual_time: bool,
    capture: str | None,
    device_period_ms: float,
    fmt: str,
) -> None:
    """Run a network on the emulated bus.

    The C core copies the frames in its own thread; emulated devices (MainInstances in the safety
    masters, SubInstances elsewhere) live on the bus at their own pace. FILES as for `check`.
    """
    if capture is not None and not virtual_time:
        raise click.UsageError("--capture needs --virtual-time: a live run carries no frames")
    checked = check_files(files, packages=packages, xacro_args=xacro_args)
    resolution = whole_network(checked, "nothing started")
    session = prepare(resolution, plan_file, scenario_file, virtual=virtual_time)
    duration_ns = round(duration * 1e9) if duration else session.duration_ns
    if capture is not None:
        with CaptureWriter(capture) as writer:
            result = run_virtual(session, duration_ns, capture=writer)
    elif virtual_time:
        result = run_virtual(session, duration_ns)
    else:
        result = _live(session, duration_ns, round(device_period_ms * 1e6), fmt)
    if fmt == "json":
        click.echo(json.dumps(result.to_json(__version__), indent=2, ensure_ascii=False))
    else:
        _print_result(result)
    ctx.exit(0 if result.passed else 1)


def prepare(
    resolution: Resolution, plan_file: str | None, scenario_file: str | None, *, virtual: bool
) -> Session:
    """Build a session from a checked network.

    Raises:
        InputError: No connection, a plan of another network, or a scenario with mistakes.
    """
    if resolution.network.partial or not resolution.connections:
        raise InputError("nothing to run: these files hold no FSoE connection of a whole network")
    fresh = compile_plan(resolution).to_bytes()
    data = fresh if plan_file is None else _plan_of(plan_file, fresh)
    scenario = scenario_of(scenario_file) if scenario_file is not None else None
    ids = counted_session_ids() if virtual else random_session_ids()
    session = Session(resolution, data, scenario, session_ids=ids)
    found = session.scenario_findings()
    if found:
        raise InputError(f"the scenario does not fit this network: {summary(found)}", found)
    return session


def _plan_of(plan_file: str, fresh: bytes) -> bytes:
    out = Collector()
    data = read_bytes(plan_file, out)
    if data is None:
        raise InputError("no plan to run", out.diagnostics)
    try:
        decode_plan(data)
    except InputError as exc:
        raise InputError(f"{plan_file}: {exc}") from exc
    if data != fresh:
        raise InputError(
            f"{plan_file} was not compiled from these files; `fsoe-net plan … -o {plan_file}` "
            "compiles it anew"
        )
    return data


def scenario_of(path: str) -> Scenario:
    """Load a scenario.

    Raises:
        InputError: It has mistakes.
    """
    scenario, found = load_scenario(path)
    bad = [d for d in found if d.level is not Severity.INFO]
    if scenario is None or bad:
        raise InputError(f"the scenario has mistakes: {summary(bad)}", found)
    return scenario


def _live(session: Session, duration_ns: int, period_ns: int, fmt: str) -> RunResult:
    if fmt == "json" or not sys.stdout.isatty():
        return run_live(session, duration_ns, device_period_ns=period_ns)
    from rich.live import Live

    with Live(refresh_per_second=10, transient=True) as display:

        def show(rows: tuple[ConnectionResult, ...], snapshot: Snapshot, now_s: float) -> None:
            display.update(_live_table(session, rows, snapshot, now_s))

        return run_live(session, duration_ns, device_period_ns=period_ns, on_update=show)


_STATE_STYLE = {"data_process": "bold green", "data_failsafe": "yellow"}


def _live_table(
    session: Session, rows: tuple[ConnectionResult, ...], snapshot: Snapshot, now_s: float
) -> Table:
    from rich.markup import escape
    from rich.table import Table

    s = snapshot.statistics
    name = session.resolution.network.name
    wkc = "" if s.expected_wkc == s.actual_wkc else f" · WKC {s.actual_wkc}/{s.expected_wkc}"
    table = Table(title=f"{escape(name)} · {now_s:.1f} s · cycle {s.cycles}{wkc}")
    for column in ("connection", "state", "ConnID", "FSoE cycle", "resets", "last reason"):
        table.add_column(column, no_wrap=column != "last reason")
    for c in rows:
        style = _STATE_STYLE.get(c.state, "red")
        table.add_row(
            escape(c.name),
            f"[{style}]{state_text(c.state)}[/]",
            str(c.connection_id),
            f"{c.fsoe_cycle_ms['last']:.1f} ms",
            str(c.resets),
            c.last_reset_text,
        )
    return table


def _print_result(result: RunResult) -> None:
    rows = [["connection", "state", "ConnID", "address", "FSoE cycle", "to Data", "resets"]]
    for c in result.connections:
        to_data = "-" if c.time_to_data_ms is None else f"{c.time_to_data_ms:.0f} ms"
        resets = str(c.resets) if not c.resets else f"{c.resets} ({c.last_reset_text})"
        rows.append(
            [
                c.name,
                state_text(c.state),
                str(c.connection_id) + ("*" if "connection_id" in c.chosen else ""),
                str(c.address) + ("*" if "address" in c.chosen else ""),
                f"{c.fsoe_cycle_ms['mean']:.2f} ms",
                to_data,
                resets,
            ]
        )
    for event in interesting(result.events):
        click.echo(f"{event.time_ms:10.1f} ms  {event.source}: {event.text}")
    widths = [max(len(row[n]) for row in rows) for n in range(len(rows[0]))]
    click.echo()
    for row in rows:
        click.echo("  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip())
    if any(c.chosen for c in result.connections):
        click.echo("* chosen here; no file states it")
    s = result.statistics
    click.echo(
        f"\n{s.cycles} bus cycles in {result.duration_ms / 1000:.1f} s ({result.mode}), "
        f"{s.wkc_errors} with incomplete working counter, {s.overruns} overruns"
    )
    _print_verdicts(result)


def interesting(events: Sequence[RunEvent]) -> list[RunEvent]:
    """Return the events a person wants to read: not every step of a start-up."""
    quiet = ("MainInstance: ", "SubInstance: ")
    return [e for e in events if not e.text.startswith(quiet) or e.text.endswith("Data")]


def _print_verdicts(result: RunResult) -> None:
    for verdict in result.verdicts:
        if not verdict.held:
            click.echo(f"{verdict.place}: not observed: {verdict.text}; {verdict.seen}")
    if result.verdicts:
        held = sum(v.held for v in result.verdicts)
        click.echo(f"{held} of {len(result.verdicts)} expectations held")
    if not result.passed and not result.verdicts:
        click.echo("not every connection is in Data")
