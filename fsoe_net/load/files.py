"""Reading files of unknown origin: bounded, regular files only, never an exception."""

from __future__ import annotations

import hashlib
import os
import stat
from dataclasses import dataclass, field
from pathlib import Path

from fsoe_net.diag import Findings, Span
from fsoe_net.model import SourceFile

__all__ = ["MAX_FILE_BYTES", "Collector", "read_bytes"]

MAX_FILE_BYTES = 32 * 1024 * 1024


@dataclass(slots=True)
class Collector(Findings):
    """Findings, and the files that were read.

    ``decimal_files`` are those of which FSN115 has spoken.
    """

    sources: list[SourceFile] = field(default_factory=list)
    decimal_files: set[str] = field(default_factory=set)

    def source(self, path: str, data: bytes) -> None:
        """Remember a file that was read, once."""
        row = SourceFile(path=path, sha256=hashlib.sha256(data).hexdigest())
        if row not in self.sources:
            self.sources.append(row)


def read_bytes(
    path: str | os.PathLike[str],
    out: Collector,
    *,
    named_at: Span | None = None,
    most: int = MAX_FILE_BYTES,
) -> bytes | None:
    """Return the content of a regular file of bounded size, or ``None`` with a finding.

    Args:
        path: The file.
        out: Takes FSN101, or FSN133 when another file names this one.
        named_at: Place of the reference, when another file names this one.
        most: Largest size in bytes, 32 MiB unless told.
    """
    shown = os.fspath(path)
    try:
        info = os.stat(shown)
        if not stat.S_ISREG(info.st_mode):
            what = "a directory" if stat.S_ISDIR(info.st_mode) else "not a regular file"
            inside = os.path.join(shown, "network.yaml")
            hint = f"give {inside}" if os.path.isfile(inside) else "give the path of a file"
            return _refuse(out, shown, named_at, f"it is {what}", hint)
        if info.st_size > most:
            size = f"it has {info.st_size} bytes, more than the {most} allowed"
            return _refuse(out, shown, named_at, size, "is this really a configuration file?")
        data = Path(shown).read_bytes()
    except FileNotFoundError:
        return _refuse(out, shown, named_at, "no such file", _nearest_file(shown))
    except PermissionError:
        return _refuse(out, shown, named_at, "permission denied", f"chmod a+r {shown}")
    except (OSError, ValueError) as exc:
        reason = exc.strerror if isinstance(exc, OSError) and exc.strerror else str(exc)
        return _refuse(out, shown, named_at, reason, "check the path")
    out.source(shown, data)
    return data


def _refuse(out: Collector, shown: str, named_at: Span | None, why: str, hint: str) -> bytes | None:
    if named_at is None:
        out.add("FSN101", Span(shown), f"cannot read {shown!r}: {why}", hint=hint)
    else:
        out.add("FSN133", named_at, f"cannot read the file named here, {shown!r}: {why}", hint=hint)
    return None


def _nearest_file(shown: str) -> str:
    """Name a file of nearly that name in the same folder, if there is one."""
    import difflib

    folder, name = os.path.split(shown)
    try:
        present = sorted(os.listdir(folder or "."))[:5000]
    except (OSError, ValueError):
        return f"the folder {folder!r} does not exist either" if folder else "check the path"
    close = difflib.get_close_matches(name, present, n=1, cutoff=0.75)
    if close:
        return f"there is {os.path.join(folder, close[0])!r}"
    return "check the path; relative paths start at the file that names them"
