"""Preparation of ``fsoe-net studio`` before it serves a page."""

from __future__ import annotations

import contextlib
import os
import webbrowser
import zlib
from typing import TYPE_CHECKING

import click

from fsoe_net.studio.listening import Listening

if TYPE_CHECKING:
    from fsoe_net.studio.server import Studio

_FIRST_PORT, _PORTS = 61_000, 4500  # above the ephemeral ports of Linux


def usual_port(name: str) -> int:
    """Return the port of a file, so that the browser finds the data that it stored for it."""
    return _FIRST_PORT + zlib.crc32(os.fsencode(os.path.realpath(name))) % _PORTS


def listening(*given: str | None) -> Listening | None:
    """Return the settings for access from other machines, or ``None`` for no access.

    Args:
        given: Address, certificate, key and password file: all, or none.

    Raises:
        click.UsageError: Only some of them are given.
        InputError: A file cannot be used.
    """
    found = [value for value in given if value]
    if not found:
        return None
    if len(found) < len(given):
        raise click.UsageError("--listen, --tls-cert, --tls-key and --password-file go together")
    return Listening.read(*found)


def check_control(live: str | None, listen: str | None) -> None:
    """Reject control of a bus if no bus is given, or if users could not be identified.

    Raises:
        click.UsageError: Control is rejected.
    """
    if live is None:
        raise click.UsageError("--allow-control needs --socket PATH or --interface IF")
    if listen is not None:
        raise click.UsageError(
            "--allow-control and --listen do not go together: the intervention log could not name "
            "the person; use ssh -L, each person with a studio of their own"
        )


def serve(studio: Studio, url: str, *, no_browser: bool) -> None:
    """Serve a page until Ctrl-C; open it in the browser of this machine, if there is one."""
    if not no_browser:
        webbrowser.open(url)
    with contextlib.suppress(KeyboardInterrupt):
        studio.run()
