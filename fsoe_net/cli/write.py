"""A file that a command is to write is looked at before the work, not after it."""

from __future__ import annotations

import os
from pathlib import Path

import click

from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.shared.write_files import STDOUT, refuse_present

__all__ = ["check_target"]


def check_target(path: str | None, *, overwrite: bool, stdout: bool = False) -> None:
    """Refuse a file that could not be written, before the work and not after it.

    Args:
        path: The file; ``None``: none is to be written.
        overwrite: Whether a file that exists is replaced.
        stdout: Whether ``-`` is standard output.

    Raises:
        click.UsageError: ``-`` where only a file is written.
        InputError: It exists.
        EnvironmentFault: Its folder is missing or closed, or it is a folder itself.
    """
    if path is None or (path == STDOUT and stdout):
        return
    if path == STDOUT:
        raise click.UsageError("- is standard output; this one is only written into a file")
    target = Path(path)
    if target.is_dir():
        raise EnvironmentFault(f"cannot write {path}: it is a folder; name a file")
    if not target.parent.is_dir():
        raise EnvironmentFault(f"cannot write {path}: there is no folder {target.parent}")
    if not overwrite:
        refuse_present(target)
    if not os.access(target if target.exists() else target.parent, os.W_OK):
        raise EnvironmentFault(f"cannot write {path}: permission denied")
