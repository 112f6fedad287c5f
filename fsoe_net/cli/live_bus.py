"""``fsoe-net run`` on a live bus: its options, their valid combinations, the run."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import click

from fsoe_net.cli.options import CYCLE, FOLDER, INTERFACE, INTERFACES, RUN_TIME, interfaces_of
from fsoe_net.cli.run_output import Show
from fsoe_net.cli.stop import ENDS, stop_on
from fsoe_net.cli.terminal import echo
from fsoe_net.live.live_bus import BusOptions, run_on_bus
from fsoe_net.live.master import Master
from fsoe_net.live.result import Run
from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.resolve import Resolution
from fsoe_net.project.simulate import plan_bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveBus:
    """The options of a live bus as given; ``None`` if one was not given."""

    interfaces: tuple[str, ...]
    redundant: str | None
    bus: str | None
    cycle_ns: int | None
    priority: int | None
    cpu: int | None
    wait_ns: int | None
    intervention_log: str | None

    @property
    def wanted(self) -> bool:
        """Whether a live bus is requested, by its interface or by its driver."""
        return bool(self.interfaces) or self.bus is not None

    def check(self, wanted: Mapping[str, Any], *, histograms: bool) -> None:
        """Reject options that cannot be combined.

        Args:
            wanted: The options of an emulated run.
            histograms: Whether timing files are requested.

        Raises:
            click.UsageError: Some options cannot be combined.
        """
        if not self.wanted:
            self._check_emulated(wanted, histograms=histograms)
        else:
            self._check_live(wanted)

    def _check_emulated(self, wanted: Mapping[str, Any], *, histograms: bool) -> None:
        for name, value in (
            ("--redundant", self.redundant),
            ("--cycle", self.cycle_ns),
            ("--priority", self.priority),
            ("--cpu", self.cpu),
            ("--wait", self.wait_ns),
            # Each of these would be ignored without a bus; an ignored option misleads.
            ("--intervention-log", self.intervention_log),
        ):
            if value is not None:
                raise click.UsageError(f"{name} is for a live bus: name its --interface too")
        if wanted["capture"] is not None and not wanted["virtual_time"]:
            raise click.UsageError("--capture needs --virtual-time: a live run carries no frames")
        if wanted["virtual_time"] and histograms:
            raise click.UsageError("--stats and --plot need real time: leave out --virtual-time")

    def _check_live(self, wanted: Mapping[str, Any]) -> None:
        if wanted["scenario_file"] is not None:
            raise click.UsageError(
                "--scenario acts on emulated devices, and those of a live bus are not ours to "
                "press; with an emulated segment at the other end give it to that: fsoe-net "
                "emulate FILES --interface OTHER_END --scenario FILE"
            )
        for name, key in (
            ("--virtual-time", "virtual_time"),
            ("--device-period", "device_period_ns"),
        ):
            if wanted[key]:
                raise click.UsageError(
                    f"{name} is for emulated devices: leave it or --interface out"
                )
        if wanted["capture"] is not None:
            near = self.interfaces[0].rpartition("=")[2] if self.interfaces else "IF"
            raise click.UsageError(
                f"--capture is for virtual runs; `tcpdump -i {near} -w FILE` records a live bus"
            )
        # The IgH master has its own redundancy.
        if self.bus == "igh" and self.redundant is not None:
            raise click.UsageError(
                "--redundant: with igh, the second interface is a setting of IgH"
            )
        if self.redundant in self.interfaces:
            raise click.UsageError("--redundant: the same interface twice")

    def options(self, network: NetworkConfig, incidents: str | None) -> BusOptions:
        """Return the options in the form that ``fsn-master`` accepts.

        Raises:
            click.UsageError: A bus has no interface, or an option is only valid for a single bus.
        """
        if not self.interfaces and not network.buses:
            raise click.UsageError("--bus is for a live bus: name its --interface too")
        interfaces = interfaces_of(self.interfaces, network, own=True)
        for name, value in (("--redundant", self.redundant), ("--cycle", self.cycle_ns)):
            if network.buses and value is not None:
                raise click.UsageError(f"{name} goes with a network of one bus")
        return BusOptions(
            backend=self.bus or "soem",
            interface=interfaces[0],
            # A network with one bus has no bus names and no pairs; it uses the interface above.
            buses=tuple(zip((b.name for b in network.buses), interfaces, strict=False)),
            redundant=self.redundant,
            cycle_ns=self.cycle_ns,
            priority=self.priority,
            cpu=self.cpu,
            wait_s=(self.wait_ns or 0) / 1e9,
            incidents=incidents,
            intervention_log=self.intervention_log,
        )


def live_bus_options(function: Callable[..., None]) -> Callable[..., None]:
    """Add the options of a live bus; they are passed as ``live``."""

    @functools.wraps(function)
    def with_live(*args: Any, **kwargs: Any) -> None:
        live = LiveBus(**{field.name: kwargs.pop(field.name) for field in fields(LiveBus)})
        function(*args, live=live, **kwargs)

    decorated: Callable[..., None] = with_live
    # Decorators apply from the last to the first; reversing them keeps the order in `--help`.
    for decorate in (
        INTERFACES,
        click.option(
            "--redundant",
            type=INTERFACE,
            metavar="IF2",
            help="Live bus: second interface, the other end of a ring.",
        ),
        click.option(
            "--bus",
            type=click.Choice(["soem", "igh"]),
            help="Live bus: backend. Default: soem.",
        ),
        click.option(
            "--cycle",
            "cycle_ns",
            type=CYCLE,
            metavar="TIME",
            help="Live bus: cycle time. Default: the cycle of the plan.",
        ),
        click.option(
            "--priority",
            type=click.IntRange(1, 99),
            help="Live bus: SCHED_FIFO priority of the cyclic thread.",
        ),
        click.option(
            "--cpu", type=click.IntRange(0, 1023), help="Live bus: CPU of the cyclic thread."
        ),
        click.option(
            "--wait",
            "wait_ns",
            type=RUN_TIME,
            metavar="TIME",
            help="Live bus: how long to wait for missing SubDevices.",
        ),
        click.option(
            "--intervention-log",
            type=FOLDER,
            metavar="DIR",
            help="Live bus: folder for the intervention log (created if missing). See "
            "fsoe-net log.",
        ),
    )[::-1]:
        decorated = decorate(decorated)
    return decorated


def run_live_bus(
    resolution: Resolution, options: BusOptions, wanted: Mapping[str, Any], show: Show | None
) -> Run:
    """Run a network on a live bus; ``wanted`` contains its plan and duration."""

    def started(master: Master) -> None:
        echo(
            f"fsn-master (process {master.pid}) starts on {options.where}; Ctrl-C stops it; "
            f"control socket {master.socket}",
            err=True,
        )

    return run_on_bus(
        resolution,
        plan_bytes(resolution, wanted["plan_file"]),
        options,
        wanted["duration_ns"],
        on_start=started,
        on_update=show,
        stop=stop_on(ENDS),  # if the terminal closes, this command ends and the bus continues
    )
