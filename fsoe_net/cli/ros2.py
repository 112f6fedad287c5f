"""``fsoe-net ros2``: a running ``fsn-master`` as a node of ROS 2."""

from __future__ import annotations

import os
import time
from typing import Any

import click

from fsoe_net.cli.options import FILE, RUN_TIME, master_options, master_socket, overwrite_option
from fsoe_net.cli.stop import ENDS_OR_HANGS_UP, stop_on
from fsoe_net.cli.terminal import echo
from fsoe_net.cli.write import check_target
from fsoe_net.diag.packages import missing_package
from fsoe_net.diag.words import counted
from fsoe_net.errors import EnvironmentFault
from fsoe_net.ros2.names import is_node_name, legal_token

_EPILOG = """\b
Examples:
  fsoe-net ros2 --interface eth1
  fsoe-net ros2 --socket /run/fsn-master/fsn-master-eth1.sock --localhost --domain 7
  fsoe-net ros2 --interface eth1 --record shift.mcap --duration 8h
  fsoe-net ros2 --interface eth1 --localhost --allow-control

If ROS 2 is installed for this Python and its setup.bash was sourced, rclpy makes the node.

Exit codes: 0 ended by Ctrl-C or after --duration; 2 usage error; 3 no fsn-master answers,
cyclonedds is not installed, or DDS does not start."""


def _node_name(_ctx: click.Context, _param: click.Parameter, value: str) -> str:
    if not is_node_name(value):
        raise click.BadParameter(
            f"{value!r} is not a name of a node; {legal_token(value)!r} would be"
        )
    return value


def _namespace(_ctx: click.Context, _param: click.Parameter, value: str) -> str:
    parts = [part for part in value.split("/") if part]
    if not all(map(is_node_name, parts)):
        raise click.BadParameter(f"{value!r} is not a namespace, such as /left")
    return "".join(f"/{part}" for part in parts)


@click.command("ros2", epilog=_EPILOG)
@master_options
@click.option(
    "--domain",
    type=click.IntRange(0, 232),
    envvar="ROS_DOMAIN_ID",
    default=0,
    show_default=True,
    help="Domain ID. Default: ROS_DOMAIN_ID.",
)
@click.option(
    "--localhost",
    is_flag=True,
    help="Use this machine only, like ROS_LOCALHOST_ONLY=1 or "
    "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST.",
)
@click.option(
    "--name",
    default="fsoe_net",
    show_default=True,
    callback=_node_name,
    help="Name of the node and prefix of its topics.",
)
@click.option(
    "--rate",
    "rate_hz",
    type=click.FloatRange(0.1, 1000),
    default=50.0,
    show_default=True,
    help="Publishing rate of joints and changed values in Hz.",
)
@click.option(
    "--no-joints", "joints", flag_value=False, default=True, help="Publish no joint states."
)
@click.option(
    "--namespace",
    default="",
    callback=_namespace,
    metavar="NAME",
    help="Namespace of all topics except /diagnostics, such as /left.",
)
@click.option("--dds", is_flag=True, help="Use DDS directly, also where ROS 2 is installed.")
@click.option("--record", type=FILE, metavar="FILE.mcap", help="Record all published messages.")
@overwrite_option
@click.option(
    "--duration",
    "duration_ns",
    type=RUN_TIME,
    metavar="TIME",
    help="Run time. Default: until Ctrl-C.",
)
@click.option(
    "--allow-control",
    is_flag=True,
    help="Allow every node in the domain to set outputs and to start and stop the bus.",
)
def command(
    socket: str | None,
    interface: str | None,
    localhost: bool,
    dds: bool,
    overwrite: bool,
    duration_ns: int | None,
    **shown: Any,
) -> None:
    """Publish the bus of a running fsn-master to ROS 2. No ROS installation is needed.

    Topics with standard messages: /diagnostics for connections, SubDevices and the cycle;
    /fsoe_net/hardware_status for SubDevices, as hardware of ros2_control publishes it;
    /joint_states for axes whose position has a factor, unless another node publishes it; a topic
    for each input and output. Only with --allow-control can nodes change the bus, and then every
    node of the domain: DDS has no user accounts.
    """
    path = master_socket(socket, interface)
    check_target(shown["record"], overwrite=overwrite)
    try:
        from fsoe_net.ros2.bridge import Bridge, BridgeOptions, has_rclpy
    except ImportError as exc:
        raise EnvironmentFault(missing_package("ros2", exc.name, "ros2")) from exc
    stop = stop_on(ENDS_OR_HANGS_UP)
    here_only = localhost or (
        # The variables that ROS 2 itself reads, in older and newer versions.
        os.environ.get("ROS_LOCALHOST_ONLY") == "1"
        or os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE") == "LOCALHOST"
    )
    options = BridgeOptions(here_only=here_only, by_rclpy=not dds and has_rclpy(), **shown)
    until = None if duration_ns is None else time.monotonic() + duration_ns / 1e9
    with Bridge(path, options) as bridge:
        where = "on this machine" if here_only else "in its network"
        where += f" by {bridge.maker}"
        echo(f"domain {options.domain} {where}: {', '.join(bridge.topics)}; Ctrl-C ends it")
        if bridge.control is not None:
            echo(
                f"every node there may set outputs (role here: {bridge.control.access}); no "
                "emergency stop, no safety function"
            )
        while not stop.is_set() and (until is None or time.monotonic() < until):
            bridge.look(stop)
            for topic, instead in bridge.left_out():
                echo(f"{topic} is left out: this ROS 2 has {instead}")
    if bridge.recording is not None:
        echo(f"{options.record}: {counted(bridge.recording.messages, 'message')}")
