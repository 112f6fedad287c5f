"""``fsoe-net studio``: the network in a browser."""

from __future__ import annotations

import contextlib
import os
import webbrowser

import click

from fsoe_net.cli.inputs import reference_options
from fsoe_net.cli.options import FILE, master_options, master_socket
from fsoe_net.cli.terminal import echo
from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.own.options import LoadOptions

__all__ = ["command"]

_NETWORK = "network.yaml"

_EPILOG = """\b
Examples:
  fsoe-net studio                        # network.yaml of this folder
  fsoe-net studio examples/estop
  fsoe-net studio network.yaml --port 8765 --no-browser
  fsoe-net studio --interface eth1       # what the fsn-master there does, live

From another machine: ssh -L 8765:127.0.0.1:8765 HOST, then the printed address in the browser here.

Exit codes: 0 ended by Ctrl-C, 1 a file that cannot be used, 2 wrong use, 3 a port or a package is
missing."""


def _network_file(path: str | None) -> tuple[str, bool]:
    """Return the network file, and whether it may be one that is still to be made."""
    name = path or _NETWORK
    if os.path.isdir(name):
        return os.path.join(name, _NETWORK), True
    return name, path is None


@click.command("studio", epilog=_EPILOG)
@click.argument("path", required=False, type=FILE)
@reference_options
@master_options
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    help="Port of 127.0.0.1; by itself a free one.",
)
@click.option("--no-browser", is_flag=True, help="Print the address; open no browser.")
def command(
    path: str | None,
    loading: LoadOptions,
    socket: str | None,
    interface: str | None,
    port: int,
    no_browser: bool,
) -> None:
    """See and edit a network in a browser: the bus, its connections, what is wrong, the file.

    PATH: a network file, or its folder; in a folder without one a new network begins. The page is
    for one person at one browser of this machine; the printed address counts once. Nothing is
    written before you press Save. With --interface or --socket it also shows what a running
    fsn-master does, and changes nothing there.
    """
    live = None if socket is None and interface is None else master_socket(socket, interface)
    name, may_be_new = _network_file(path)
    try:
        from fsoe_net.studio.server import Studio
    except ImportError as exc:
        raise EnvironmentFault(
            f"studio needs {exc.name}, which is not installed; pip install 'fsoe-net[studio]'"
        ) from exc
    from fsoe_net.studio.begin import empty_network
    from fsoe_net.studio.workspace import Workspace

    new_text = empty_network(name) if may_be_new else None
    workspace = Workspace(name, loading, new_text=new_text)
    studio = Studio(workspace, port=port, control_socket=live)
    url = studio.url if live is None else f"{studio.url}#live"
    echo(f"{name}: open {url}")
    echo("Ctrl-C ends it; only what was saved is in the file")
    if not no_browser:
        webbrowser.open(url)
    with contextlib.suppress(KeyboardInterrupt):  # how people end it
        studio.run()
