"""A bus that commands compare with or start from."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from fsoe_net.cli.terminal import echo
from fsoe_net.errors import InputError

if TYPE_CHECKING:
    from fsoe_net.live.scan import TakenScan
    from fsoe_net.model.scan import Scan


def scan_to_compare(
    interface: str | None, socket: str | None, scan_file: str | None, *, yes: bool
) -> Scan | None:
    """Return the scan of the bus to compare with, if requested.

    Raises:
        click.UsageError: It is given twice.
        InputError: The document is damaged.
    """
    # A file and a bus may differ: it would be unclear which one was compared.
    if scan_file is not None:
        if interface is not None or socket is not None:
            raise click.UsageError(
                "--scan compares with a file; leave out --interface and --socket"
            )
        from fsoe_net.formats.own.scan import load_scan

        scan, found = load_scan(scan_file)
        if scan is None:
            raise InputError(f"{scan_file} is not a complete scan document", found)
        return scan
    if interface is None and socket is None:
        return None
    return take_scan(interface, bus=None, socket=socket, yes=yes).scan


def take_scan(
    interface: str | None, *, bus: str | None, socket: str | None, yes: bool
) -> TakenScan:
    """Scan a bus, after stating the effect on it and asking before states are changed.

    Raises:
        click.UsageError: A question is needed, but there is no terminal.
    """
    if interface is None and socket is None:
        raise click.UsageError("name the bus: --interface IF, or --socket PATH of an fsn-master")
    from fsoe_net.live.scan import scan_source

    source = scan_source(interface, socket=socket, bus=bus)
    echo(source.announcement, err=True)
    if not source.attached and not yes:
        ask_before("this changes states on the bus")
    return source.take()


def ask_before(effect: str) -> None:
    """Ask for confirmation at the terminal.

    Raises:
        click.UsageError: Standard input is not a terminal.
        click.Abort: The user does not confirm.
    """
    if not sys.stdin.isatty():
        raise click.UsageError(
            f"{effect} and needs a terminal to ask for confirmation; confirm with --yes"
        )
    click.confirm("Go on?", abort=True, err=True)
