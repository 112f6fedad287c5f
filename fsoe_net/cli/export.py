"""``fsoe-net export``: metrics of running ``fsn-master`` processes for Prometheus."""

from __future__ import annotations

import functools
from collections.abc import Callable

import click

from fsoe_net.cli.options import FILE, INTERFACE, RUN_TIME, master_socket
from fsoe_net.cli.stop import ENDS_OR_HANGS_UP, stop_on
from fsoe_net.cli.terminal import echo
from fsoe_net.diag.packages import missing_package
from fsoe_net.diag.words import counted
from fsoe_net.errors import EnvironmentFault

_EPILOG = """\b
Examples:
  fsoe-net export --interface eth1 --interface eth2
  fsoe-net export --socket /run/fsn-master/fsn-master-eth1.sock --port 9977
  fsoe-net export --interface eth1 --once | promtool check metrics

Exit codes: 0 ended by Ctrl-C or after --duration; 2 usage error; 3 the port is in use, or
prometheus_client is not installed. An absent fsn-master is a metric, not an error."""


def _masters(interfaces: tuple[str, ...], sockets: tuple[str, ...]) -> dict[str, Callable[[], str]]:
    """Return how to find the socket of each master, by name."""
    names = [*interfaces, *sockets]
    if not names:
        raise click.UsageError("give --interface IF or --socket PATH, once for each fsn-master")
    if len(set(names)) < len(names):
        raise click.UsageError("one fsn-master is given twice")
    pairs = [*((None, name) for name in interfaces), *((path, None) for path in sockets)]
    return {
        name: functools.partial(master_socket, *pair)
        for name, pair in zip(names, pairs, strict=True)
    }


@click.command("export", epilog=_EPILOG)
@click.option(
    "--interface",
    "interfaces",
    type=INTERFACE,
    multiple=True,
    metavar="IF",
    help="Interface that an fsn-master drives. Repeatable.",
)
@click.option(
    "--socket",
    "sockets",
    type=FILE,
    multiple=True,
    metavar="PATH",
    help="Control socket of an fsn-master. Repeatable.",
)
@click.option(
    "--listen",
    default="127.0.0.1",
    show_default=True,
    metavar="ADDRESS",
    help="Local address. Metrics have no password.",
)
@click.option("--port", type=click.IntRange(0, 65535), default=9977, show_default=True)
@click.option("--once", is_flag=True, help="Print the metrics once and exit.")
@click.option(
    "--duration",
    "duration_ns",
    type=RUN_TIME,
    metavar="TIME",
    help="Run time. Default: until Ctrl-C.",
)
def command(
    interfaces: tuple[str, ...],
    sockets: tuple[str, ...],
    listen: str,
    port: int,
    once: bool,
    duration_ns: int | None,
) -> None:
    """Serve metrics of running fsn-masters in the OpenMetrics format, for Prometheus.

    Connections, resets by cause, FSoE cycles and their margin to the watchdog, lost frames, jitter,
    health. It changes nothing on a bus. Metrics are for maintenance, not for protection.
    """
    masters = _masters(interfaces, sockets)
    if once and duration_ns is not None:
        raise click.UsageError("--once looks once: leave out --duration")
    try:
        from fsoe_net.fleet.exporter import Exporter, metrics_once
    except ImportError as exc:
        raise EnvironmentFault(missing_package("export", exc.name, "metrics")) from exc
    if once:
        echo(metrics_once(masters), nl=False)
        return
    stop = stop_on(ENDS_OR_HANGS_UP)
    with Exporter(masters, address=listen, port=port) as exporter:
        where = f"[{listen}]" if ":" in listen else listen
        echo(f"{counted(len(masters), 'master')}: http://{where}:{exporter.port}/metrics")
        stop.wait(None if duration_ns is None else duration_ns / 1e9)
