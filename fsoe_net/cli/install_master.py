"""``fsoe-net install-master``: the program that drives a live bus, built on this machine."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from fsoe_net.cli.options import FOLDER, output_option
from fsoe_net.cli.terminal import echo
from fsoe_net.cli.write import check_target
from fsoe_net.live.build_master import SOEM_TERMS, build_master, master_place

_EPILOG = """\b
Examples:
  fsoe-net install-master
  fsoe-net install-master --yes                # in a script: you accept the licence
  fsoe-net install-master --without-soem       # for an installed IgH EtherCAT Master

A C compiler is required. CMake and the source of SOEM are downloaded from the Python package index
if they are missing. A running fsn-master is not affected.

Exit codes: 0 built; 2 usage error; 3 a tool, the network or a permission is missing."""


@click.command("install-master", epilog=_EPILOG)
@output_option("The program; default: next to the Python that runs this.")
@click.option("--soem", type=FOLDER, metavar="DIR", help="Folder with the source of SOEM 1.4.")
@click.option("--without-soem", is_flag=True, help="Build without the SOEM backend.")
@click.option(
    "--build-dir",
    type=FOLDER,
    metavar="DIR",
    help="Keep the build in this folder for the next build.",
)
@click.option("-y", "--yes", is_flag=True, help="Do not ask about the licence of SOEM.")
def command(
    output: str | None,
    overwrite: bool,
    soem: str | None,
    without_soem: bool,
    build_dir: str | None,
    yes: bool,
) -> None:
    """Build fsn-master, which drives a live bus, and install it."""
    target = Path(output) if output else master_place()
    check_target(str(target), overwrite=overwrite)
    if not without_soem:
        echo(SOEM_TERMS, err=True)
        # The licence of SOEM binds the user, so a person must agree, not a script.
        if not yes:
            if not sys.stdin.isatty():
                raise click.UsageError(
                    "these terms need consent, and there is no terminal to ask for it: --yes"
                )
            click.confirm("Fetch and build it?", abort=True, err=True)
    echo("building, about half a minute", err=True)
    version = build_master(
        target.absolute(),
        soem=Path(soem) if soem else None,
        with_soem=not without_soem,
        build=Path(build_dir) if build_dir else None,
    )
    echo(version.rstrip())
    echo(f"\n{target}: installed. Without root it needs, after each build:")
    echo(f"  sudo setcap cap_net_raw,cap_sys_nice,cap_ipc_lock=ep {target.resolve()}")
