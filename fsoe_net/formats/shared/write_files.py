"""Writes files completely or not at all; an existing file is replaced only if allowed."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Mapping
from pathlib import Path

from fsoe_net.errors import EnvironmentFault, FilePresent

STDOUT = "-"


def write_whole(output: str | os.PathLike[str], data: bytes, *, overwrite: bool) -> None:
    """Write a file; a full disk must not replace a good file with a truncated one.

    ``-`` is standard output. A link remains a link. Special files, such as ``/dev/null`` or a named
    pipe, are written in place: replacing them by a new file would remove them for all other
    programs.

    Raises:
        FilePresent: The file exists and must not be replaced.
        EnvironmentFault: The file cannot be written; the existing content is unchanged.
    """
    if os.fspath(output) == STDOUT:
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
        return
    _write_parts({Path(output): data}, overwrite=overwrite)


def write_all(
    folder: str | os.PathLike[str], files: Mapping[str, bytes], *, overwrite: bool
) -> None:
    """Write several files and the folders that they need: all or none.

    Args:
        folder: Folder that the file names are relative to.
        files: Content by name; a file that refers to the others comes first and is written last.
        overwrite: Whether to replace existing files.

    Raises:
        FilePresent: A file exists and must not be replaced.
        EnvironmentFault: A file cannot be written; the existing content is unchanged.
    """
    paths = {Path(folder) / name: data for name, data in reversed(list(files.items()))}
    if not overwrite:
        for path in reversed(paths):
            refuse_present(path)
    for path in paths:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as exc:
            raise EnvironmentFault(f"cannot write {path}: {exc.strerror}") from exc
    _write_parts(paths, overwrite=overwrite)


def _write_parts(files: Mapping[Path, bytes], *, overwrite: bool) -> None:
    """Write each file under a temporary name first, so that a full disk is noticed early."""
    partial: dict[Path, Path] = {}
    made: list[Path] = []
    path = Path()
    try:
        for path, data in files.items():
            if path.exists() and not path.is_file():
                path.write_bytes(data)
                continue
            if not overwrite:
                refuse_present(path)
            target = Path(os.path.realpath(path))
            partial[target] = target.with_name(f"{target.name}.{os.getpid()}.part")
            partial[target].write_bytes(data)
        for path, part in partial.items():
            is_new = not path.exists()
            if overwrite:
                part.replace(path)
            else:
                _link(part, path)
            if is_new:
                made.append(path)
        # All files are in place, so none is removed.
        made.clear()
    except OSError as exc:
        why = exc.strerror if path.parent.is_dir() else f"missing folder {path.parent}"
        raise EnvironmentFault(f"cannot write {path}: {why}") from exc
    finally:
        for left in (*partial.values(), *made):
            with contextlib.suppress(OSError):  # it already has its name, or was never created
                left.unlink(missing_ok=True)


def _link(part: Path, path: Path) -> None:
    """Give a file its name unless that exists by now."""
    try:
        # link() fails if the name now exists; replace() would not.
        os.link(part, path)
    except FileExistsError:
        refuse_present(path)
        raise
    except OSError:  # no hard links on this file system
        refuse_present(path)
        part.replace(path)


def refuse_present(path: Path) -> None:
    """Reject a file that would be replaced.

    Raises:
        FilePresent: The file exists.
    """
    # A link also counts, even a dangling one; a pipe or /dev/null has nothing to lose.
    if path.is_symlink() or path.is_file():
        if path.exists() and not path.is_file():
            return
        raise FilePresent(path)


def make_folder(path: str | None, what: str) -> None:
    """Create the folder if it is missing, but not its parents, as a typo would create wrong ones.

    Raises:
        EnvironmentFault: The folder is missing and cannot be created.
    """
    if path is None or Path(path).is_dir():
        return
    try:
        Path(path).mkdir()
    except FileNotFoundError as exc:
        raise EnvironmentFault(f"{what} {path}: missing folder {Path(path).parent}") from exc
    except OSError as exc:
        raise EnvironmentFault(f"{what} {path}: {exc.strerror}") from exc
