"""``fsoe-net emulate``: the devices of a network on an emulated EtherCAT segment."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from fsoe_net.cli.command_lines import CommandLines
from fsoe_net.cli.emulate_output import check_rig, print_emulation
from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import (
    INTERFACE,
    RUN_TIME,
    device_period_option,
    format_option,
    interfaces_of,
    scenario_option,
)
from fsoe_net.cli.stop import ENDS_OR_HANGS_UP, stop_on
from fsoe_net.cli.terminal import echo
from fsoe_net.core.segment import SegmentLink
from fsoe_net.diag.words import counted
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.plan.compile import compile_plan
from fsoe_net.project.check import check_files, whole_network
from fsoe_net.project.simulate import with_scenario
from fsoe_net.simulate.emulate import SegmentSession, serve
from fsoe_net.simulate.session import DEVICE_PERIOD_NS, random_session_ids
from fsoe_net.version import __version__

_STDIN = 0
_EPILOG = """\b
Examples:
  ip link add veth0 type veth peer name veth1; ip link set veth0 up; ip link set veth1 up
  fsoe-net emulate network.yaml --interface veth1
  fsoe-net emulate network.yaml --interface veth1 --scenario scenario.yaml --duration 20s
  fsoe-net emulate network.yaml --interface veth1 --redundant veth3 --priority 81 --cpu 1
  (sleep 5; echo break ek1914) | fsoe-net emulate network.yaml --interface veth1 --commands

Then run any EtherCAT MainDevice on the other end, veth0. Only veth and tap interfaces are accepted:
an emulated e-stop must never be connected to a real machine.

Exit codes: 0 every expectation was met, or without expectations every connection is in Data at the
end; 1 otherwise, or a file has an error; 2 usage error; 3 no such interface, or no permission."""


@click.command("emulate", epilog=_EPILOG)
@input_options
@click.option(
    "--interface",
    "interfaces",
    type=INTERFACE,
    multiple=True,
    metavar="IF",
    required=True,
    help="veth or tap interface that answers. With several buses: BUS=IF for each.",
)
@click.option(
    "--redundant", type=INTERFACE, metavar="IF2", help="Second interface: the other end of a ring."
)
@click.option(
    "--priority",
    type=click.IntRange(0, 99),
    default=0,
    help="SCHED_FIFO priority of the answering thread.",
)
@click.option("--cpu", type=click.IntRange(0, 1023), help="CPU of the answering thread.")
@scenario_option
@device_period_option
@click.option(
    "--no-machine-on-this-wire",
    "vouched",
    is_flag=True,
    help="Test rigs only. You confirm that no machine is connected to this interface.",
)
@click.option("--commands", is_flag=True, help="Read commands from standard input.")
@click.option(
    "--duration",
    "duration_ns",
    type=RUN_TIME,
    metavar="TIME",
    help="Run time. Default: the scenario, else until Ctrl-C.",
)
@format_option
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    loading: LoadOptions,
    interfaces: tuple[str, ...],
    redundant: str | None,
    priority: int,
    cpu: int | None,
    scenario_file: str | None,
    device_period_ns: int | None,
    vouched: bool,
    commands: bool,
    duration_ns: int | None,
    fmt: str,
) -> None:
    """Emulate the EtherCAT SubDevices of a network, with working FSoE devices.

    FILES as for `check`. EMULATION: nothing here is safe, certified or a real device.
    """
    checked = check_files(files, loading)
    resolution = whole_network(checked, "nothing started")
    plan = compile_plan(resolution).to_bytes()
    session = with_scenario(
        lambda scenario: SegmentSession(
            resolution, plan, scenario, session_ids=random_session_ids()
        ),
        scenario_file,
    )
    if duration_ns is None and session.scenario is not None:
        duration_ns = session.scenario.duration_ns or None
    # Emulated devices on the network of a machine could be mistaken for real ones.
    check_rig(vouched)
    links = [
        SegmentLink(
            interface=interface,
            interface2=redundant,
            priority=priority,
            cpu=cpu,
            no_machine_on_this_wire=vouched,
        )
        for interface in interfaces_of(interfaces, resolution.network, own=False)
    ]
    if redundant is not None and len(links) > 1:
        raise click.UsageError("--redundant goes with a network of one bus")
    where = f"{interfaces[0]} and {redundant}, a ring" if redundant else ", ".join(interfaces)
    size = counted(sum(segment.size for segment in session.segments), "SubDevice")
    banner = f"EMULATION of {size} on {where}; Ctrl-C ends it"
    result = serve(
        session,
        links[0],
        duration_ns,
        further=links[1:],
        period_ns=device_period_ns or DEVICE_PERIOD_NS,
        on_step=CommandLines(_STDIN) if commands else None,
        on_link=lambda: echo(banner, err=True),
        stop=stop_on(ENDS_OR_HANGS_UP),
    )
    if fmt == "json":
        document = {"tool": "fsoe-net", "version": __version__} | asdict(result)
        echo(json.dumps(document, indent=2, ensure_ascii=False))
    else:
        print_emulation(result)
    ctx.exit(0 if result.passed else 1)
