"""A file that a command is to write is looked at before the work, not after it."""

from __future__ import annotations

import os
from pathlib import Path

import click

from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.formats.shared.write_files import STDOUT, refuse_present


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
        raise EnvironmentFault(f"cannot write {path}: missing folder {target.parent}")
    # `--overwrite` is needed for each file that exists: results must not vanish by a repeated
    # command.
    if not overwrite:
        refuse_present(target)
    # Looked at before the work: after it, the result would be lost.
    if why := _why_closed(target if target.exists() else target.parent, os.W_OK):
        raise EnvironmentFault(f"cannot write {path}: {why}")


def check_folder(folder: Path, *, overwrite: bool) -> None:
    """Refuse a folder that cannot take the files, before anybody answers questions.

    Raises:
        InputError: There is a network already.
        EnvironmentFault: It cannot be written.
    """
    network = folder / "network.yaml"
    if not overwrite and os.path.lexists(network):
        raise InputError(
            f"nothing written: {network} exists; name another folder with -o, or replace it with "
            "--overwrite"
        )
    # Missing folders are created, so the nearest existing one decides.
    there = next((p for p in (folder, *folder.parents) if p.exists()), Path("."))
    why = _why_closed(there, os.W_OK | os.X_OK) if there.is_dir() else f"{there} is a file"
    if why:
        raise EnvironmentFault(f"cannot write {folder}: {why}; nothing written")


def _why_closed(place: Path, mode: int) -> str:
    """Return why a file or folder cannot be written, or nothing."""
    if os.access(place, mode):
        return ""
    if os.statvfs(place).f_flag & os.ST_RDONLY:
        return "the file system is read-only"
    return "permission denied"
