"""Checks the target of a command before the work, not after it."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import click

from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.formats.shared.write_files import STDOUT, refuse_present


def check_target(path: str | None, *, overwrite: bool, stdout: bool = False) -> None:
    """Reject a file that cannot be written, before the work and not after it.

    Args:
        path: The file, or ``None`` if none is written.
        overwrite: Whether to replace an existing file.
        stdout: Whether ``-`` is standard output.

    Raises:
        click.UsageError: ``-``, but the output must be a file.
        InputError: The file exists.
        EnvironmentFault: Its folder is missing or not writable, or the path is a folder.
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
    # `--overwrite` is needed for each existing file: a repeated command must not destroy results.
    if not overwrite:
        refuse_present(target)
    # Checked before the work: afterwards, the result would be lost.
    if why := _why_closed(target if target.exists() else target.parent, os.W_OK):
        raise EnvironmentFault(f"cannot write {path}: {why}")


def check_folder(folder: Path, *, overwrite: bool) -> None:
    """Reject a folder that cannot take the files, before any question is asked.

    Raises:
        InputError: The folder already contains a network.
        EnvironmentFault: The folder cannot be written.
    """
    network = folder / "network.yaml"
    if not overwrite and os.path.lexists(network):
        raise InputError(
            f"nothing written: {network} exists; name another folder with -o, or replace it with "
            "--overwrite"
        )
    # Missing folders are created, so the nearest existing folder decides.
    there = next((p for p in (folder, *folder.parents) if p.exists()), Path("."))
    why = _why_closed(there, os.W_OK | os.X_OK) if there.is_dir() else f"{there} is a file"
    if why:
        raise EnvironmentFault(f"cannot write {folder}: {why}; nothing written")


def _why_closed(place: Path, mode: int) -> str:
    """Return why a file or folder cannot be written, or an empty string."""
    if os.access(place, mode):
        return ""
    if os.statvfs(place).f_flag & os.ST_RDONLY:
        return "the file system is read-only"
    return "permission denied"


def try_folder(save_dir: str | None) -> None:
    """Create a folder, and raise `OSError` if no file can be written there."""
    if save_dir:
        Path(save_dir).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=save_dir):
            pass
