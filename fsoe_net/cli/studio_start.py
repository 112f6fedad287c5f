"""What ``fsoe-net studio`` needs before it serves a page, or instead of that."""

from __future__ import annotations

import os
import zlib
from pathlib import Path

import click

from fsoe_net.cli.terminal import echo
from fsoe_net.cli.write import check_target
from fsoe_net.document.write_html import document_html
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.project.check import check_files
from fsoe_net.project.snapshot import snapshot
from fsoe_net.studio.listening import Listening

__all__ = ["check_control", "listening", "usual_port", "write_snapshot"]

_FIRST_PORT, _PORTS = 61_000, 4500  # above those that Linux gives away by itself


def usual_port(name: str) -> int:
    """Return the port of a file, so that a browser finds again what it has kept for it."""
    return _FIRST_PORT + zlib.crc32(os.fsencode(os.path.realpath(name))) % _PORTS


def listening(*given: str | None) -> Listening | None:
    """Return how other machines are let in; ``None``: they are not.

    Args:
        given: Address, certificate, key and password file: all, or none.

    Raises:
        click.UsageError: Some are missing.
        InputError: A file cannot be used.
    """
    found = [value for value in given if value]
    if not found:
        return None
    if len(found) < len(given):
        raise click.UsageError("--listen, --tls-cert, --tls-key and --password-file go together")
    return Listening.read(*found)


def check_control(live: str | None, listen: str | None) -> None:
    """Refuse control of a bus where none is named, or where nobody could say who did it.

    Raises:
        click.UsageError: It is refused.
    """
    if live is None:
        raise click.UsageError("--allow-control needs --socket PATH or --interface IF")
    if listen is not None:
        raise click.UsageError(
            "--allow-control and --listen do not go together: the intervention log could not name "
            "the person; use ssh -L, each person with a studio of their own"
        )


def write_snapshot(name: str, loading: LoadOptions, target: str, *, overwrite: bool) -> None:
    """Write a network as one page.

    Raises:
        click.UsageError: The name is not that of a page.
        InputError: The file exists, and is not to be replaced.
        EnvironmentFault: It cannot be written.
    """
    if Path(target).suffix not in (".html", ".htm"):
        raise click.UsageError(f"--snapshot {target}: write a page, .html")
    check_target(target, overwrite=overwrite)
    page = document_html(snapshot(check_files([name], loading, compared=True), name))
    write_whole(target, page.encode("utf-8"), overwrite=overwrite)
    echo(f"{target}: {name} as one page, without scripts")
