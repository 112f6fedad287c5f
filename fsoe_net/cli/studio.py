"""``fsoe-net studio``: the network in a browser."""

from __future__ import annotations

import os

import click

from fsoe_net.cli.inputs import reference_options
from fsoe_net.cli.options import FILE, NETWORK, master_options, named_master, overwrite_option
from fsoe_net.cli.studio_snapshot import write_snapshot
from fsoe_net.cli.studio_start import check_control, listening, serve, usual_port
from fsoe_net.cli.terminal import echo
from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.own.options import LoadOptions

_EPILOG = """\b
Examples:
  fsoe-net studio                        # network.yaml of this folder
  fsoe-net studio examples/estop
  fsoe-net studio network.yaml --port 8765 --no-browser
  fsoe-net studio --interface eth1       # a live bus
  fsoe-net studio --interface eth1 --allow-control  # and control it
  fsoe-net studio network.yaml --snapshot network.html   # with --interface: also the bus
  fsoe-net studio --listen cell.local --port 8443 --tls-cert cert.pem --tls-key key.pem \\
      --password-file password

From another machine: ssh -L 8765:127.0.0.1:8765 HOST, then the printed address in the browser here.

Exit codes: 0 ended by Ctrl-C, or the snapshot was written; 1 an invalid file; 2 usage error;
3 a port or a package is missing, or no fsn-master answers for a snapshot."""


def _network_file(path: str | None) -> tuple[str, bool]:
    """Return the network file, and whether it may still have to be created."""
    name = path or NETWORK
    if os.path.isdir(name):
        return os.path.join(name, NETWORK), True
    return name, path is None


@click.command("studio", epilog=_EPILOG)
@click.argument("path", required=False, type=FILE)
@reference_options
@master_options
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    help="Port. Default: a port derived from the file name, if it is free.",
)
@click.option("--no-browser", is_flag=True, help="Print the address without opening a browser.")
@click.option(
    "--snapshot",
    type=FILE,
    metavar="FILE.html",
    help="Write the network and the current bus state as one page without scripts, then exit.",
)
@overwrite_option
@click.option(
    "--listen",
    metavar="ADDRESS",
    help="Accept other machines at this address. Requires the next three options.",
)
@click.option("--tls-cert", type=FILE, metavar="FILE", help="Certificate with its chain (PEM).")
@click.option(
    "--tls-key", type=FILE, metavar="FILE", help="Key of the certificate (PEM), without passphrase."
)
@click.option(
    "--password-file", type=FILE, metavar="FILE", help="File with the password in its first line."
)
@click.option(
    "--allow-control",
    is_flag=True,
    help="Allow the page to start and stop the bus and to set outputs.",
)
def command(
    path: str | None,
    loading: LoadOptions,
    socket: str | None,
    interface: str | None,
    port: int | None,
    no_browser: bool,
    snapshot: str | None,
    overwrite: bool,
    listen: str | None,
    tls_cert: str | None,
    tls_key: str | None,
    password_file: str | None,
    allow_control: bool,
) -> None:
    """View and edit a network in a browser: the bus, its connections, findings, the file.

    PATH: a network file or its folder. In a folder without one, a new network is created. The page
    is for one person in one browser on this machine; the printed address is valid once. The network
    file is written only when you press Save. With --interface or --socket the page also shows a
    running fsn-master. Without --allow-control it changes nothing there.
    """
    live = named_master(socket, interface)
    name, may_be_new = _network_file(path)
    if snapshot is not None:
        write_snapshot(
            name, loading, snapshot, live, may_be_missing=may_be_new, overwrite=overwrite
        )
        return
    if allow_control:
        check_control(live, listen)
    remote = listening(listen, tls_cert, tls_key, password_file)
    from fsoe_net.studio.begin import empty_network
    from fsoe_net.studio.server import Studio
    from fsoe_net.studio.workspace import Workspace

    new_text = empty_network(name) if may_be_new else None
    workspace = Workspace(name, loading, new_text=new_text)
    # A separate port for each file, so that bookmarks and cookies stay valid.
    usual = usual_port(name) if remote is None else 0
    try:
        studio = Studio(
            workspace,
            port=usual if port is None else port,
            control_socket=live,
            remote=remote,
            allow_control=allow_control,
        )
    except EnvironmentFault:
        # A port selected by the user must not be replaced.
        if port is not None or not usual:
            raise
        # The usual port is in use.
        studio = Studio(workspace, control_socket=live, allow_control=allow_control)
    url = studio.url if live is None else f"{studio.url}#live"
    echo(f"{name}: open {url}")
    echo("Ctrl-C ends it; only what was saved is in the file")
    if allow_control:
        echo(f"the page may start and stop the bus at {live}, and set outputs: no emergency stop")
    serve(studio, url, no_browser=no_browser)
