"""``fsoe-net demo``: an emulated e-stop cell in a browser."""

from __future__ import annotations

import os
import shutil
import tempfile

import click

from fsoe_net.cli.studio_start import serve
from fsoe_net.cli.terminal import echo
from fsoe_net.project.installed import shipped

_EPILOG = """\b
Examples:
  fsoe-net demo
  fsoe-net demo --no-browser

Press the e-stop, unplug a SubDevice, delay frames: the page shows what FSoE does and why. All
devices are emulated, and nothing is sent to a bus. The files are a copy of examples/estop; edit
them freely.

Exit codes: 0 ended by Ctrl-C; 2 usage error; 3 no free port, or no space for the files."""


@click.command("demo", epilog=_EPILOG)
@click.option("--no-browser", is_flag=True, help="Print the address without opening a browser.")
def command(no_browser: bool) -> None:
    """Run an emulated e-stop cell and open its live page in a browser."""
    from fsoe_net.studio.server import Studio
    from fsoe_net.studio.workspace import Workspace

    folder = os.path.join(tempfile.mkdtemp(prefix="fsoe-net-demo-"), "estop")
    shutil.copytree(shipped("examples") / "estop", folder)
    studio = Studio(Workspace(os.path.join(folder, "network.yaml")), runs_emulated=True)
    echo(f"e-stop cell, emulated: open {studio.url}#live")
    echo(f"its files are in {folder}; Ctrl-C ends the demo and keeps them")
    serve(studio, f"{studio.url}#live", no_browser=no_browser)
