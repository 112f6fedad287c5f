"""Reading files of unknown origin: bounded, regular files only, never an exception."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import os
import stat
import sys
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import FindingList, Span
from fsoe_net.errors import InputError
from fsoe_net.formats.shared.limits import MAX_FILE_BYTES, MAX_LARGE_BYTES
from fsoe_net.model.network import SourceFile

STDIN = "-"
Stream = io.BufferedReader | io.BytesIO
_REPLACED: ContextVar[Mapping[str, bytes]] = ContextVar("replaced files", default={})  # noqa: B039


@dataclass(slots=True)
class Collector(FindingList):
    """Findings, and the files that were read.

    ``decimal_files`` are files with an FSN115, ``mistyped`` are values with an FSN111 of their
    schema.
    """

    sources: list[SourceFile] = field(default_factory=list)
    decimal_files: set[str] = field(default_factory=set)
    mistyped: set[Span] = field(default_factory=set)

    def source(self, path: str, data: bytes) -> None:
        """Record a file that was read, once."""
        row = SourceFile(path=path, sha256=hashlib.sha256(data).hexdigest())
        if row not in self.sources:
            self.sources.append(row)


@contextlib.contextmanager
def replaced_files(contents: Mapping[str, bytes]) -> Iterator[None]:
    """Make readers use these contents instead of the files with these paths."""
    token = _REPLACED.set(contents)
    try:
        yield
    finally:
        _REPLACED.reset(token)


def is_there(path: str) -> bool:
    """Whether readers find a file or replaced content under a path, see `replaced_files`."""
    return path in _REPLACED.get() or os.path.exists(path)


def stem_of(path: str) -> str:
    """Return the name of a file without folder and suffix."""
    return os.path.splitext(os.path.basename(path))[0]


def open_file(path: str | os.PathLike[str], *, regular: bool = True) -> Stream:
    """Open a file named by the user; ``-`` is standard input, which is read once.

    Args:
        path: The file.
        regular: Reject pipes and devices, which could block.

    Raises:
        InputError: The file cannot be read; FSN101 gives the reason.
    """
    out = Collector()
    stream = _opened(os.fspath(path), out, None, sys.maxsize, regular=regular)
    if stream is None:
        raise InputError(f"{os.fspath(path)} cannot be read", out.diagnostics)
    return stream


def read_bytes(
    path: str | os.PathLike[str],
    out: Collector,
    *,
    named_at: Span | None = None,
    most: int = MAX_FILE_BYTES,
) -> bytes | None:
    """Return the content of a regular file of bounded size, or ``None`` with a finding.

    Args:
        path: The file; ``-`` is standard input, unless another file names it.
        out: Takes FSN101, or FSN133 if another file names this one.
        named_at: Place of the reference, if another file names this one.
        most: Largest size in bytes, 32 MiB by default.
    """
    shown = os.fspath(path)
    stream = _opened(shown, out, named_at, most, regular=True)
    if stream is None:
        return None
    try:
        with stream:
            data = stream.read()
    except OSError as exc:
        _refuse(out, shown, named_at, exc.strerror or str(exc), "check the path")
        return None
    out.source(shown, data)
    return data


def read_source(path: str, *, most: int = MAX_FILE_BYTES) -> tuple[SourceFile, bytes]:
    """Return a file with its hash, and its content.

    Raises:
        InputError: The file cannot be read, or has more than ``most`` bytes.
    """
    out = Collector()
    data = read_bytes(path, out, most=most)
    if data is None:
        raise InputError(f"{path} cannot be read", out.diagnostics)
    return out.sources[0], data


def read_unchanged(path: str, sha256: str, *, next_step: str) -> bytes:
    """Return the content of a file to be written, if it still has this hash.

    Raises:
        InputError: The file cannot be read, or has been changed.
    """
    out = Collector()
    data = read_bytes(path, out)
    if data is None:
        raise InputError(f"nothing written: {path} cannot be read again", out.diagnostics)
    if out.sources[0].sha256 != sha256:
        raise InputError(f"nothing written: {path} has changed since it was read; {next_step}")
    return data


def _opened(
    shown: str, out: Collector, named_at: Span | None, most: int, *, regular: bool
) -> Stream | None:
    try:
        is_stdin = shown == STDIN and named_at is None
        data = _standard_input() if is_stdin else _REPLACED.get().get(shown)
        if data is not None:
            refusal = _too_large(len(data), min(most, MAX_LARGE_BYTES))
            if refusal is None:
                return io.BytesIO(data)
        else:
            info = os.stat(shown)
            refusal = _not_a_file(shown, info.st_mode, regular=regular)
            refusal = refusal or _too_large(info.st_size, most)
            if refusal is None:
                return open(shown, "rb")
    except FileNotFoundError:
        refusal = "no such file", _nearest_file(shown, named_at)
    except PermissionError:
        refusal = "permission denied", f"chmod a+r {shown}"
    except (OSError, ValueError) as exc:
        refusal = getattr(exc, "strerror", None) or str(exc), "check the path"
    _refuse(out, shown, named_at, *refusal)
    return None


def _not_a_file(shown: str, mode: int, *, regular: bool) -> tuple[str, str] | None:
    """Return why this is not opened, and the next step."""
    if stat.S_ISDIR(mode):
        why = "it is a directory"
    elif regular and not stat.S_ISREG(mode):
        why = "it is not a regular file"
    else:
        return None
    inside = os.path.join(shown, "network.yaml")
    return why, f"give {inside}" if os.path.isfile(inside) else "give the path of a file"


def _too_large(size: int, most: int) -> tuple[str, str] | None:
    if size <= most:
        return None
    why = f"it has {size} bytes, more than the {most} allowed"
    return why, "is this really a configuration file?"


# Several readers may try the input, which can be read once.
@functools.cache
def _standard_input() -> bytes:
    if sys.stdin is None or sys.stdin.closed:
        return b""
    # One byte more than allowed shows that the input is too long.
    return sys.stdin.buffer.read(MAX_LARGE_BYTES + 1)


def _refuse(out: Collector, shown: str, named_at: Span | None, why: str, hint: str) -> None:
    if named_at is None:
        out.add("FSN101", Span(shown), f"cannot read {shown!r}: {why}", hint=hint)
    else:
        out.add("FSN133", named_at, f"cannot read the file named here, {shown!r}: {why}", hint=hint)


def _nearest_file(shown: str, named_at: Span | None) -> str:
    """Return a hint with a file of a similar name in the same folder, if there is one."""
    from fsoe_net.diag.guesses import guesses, one_of

    folder, name = os.path.split(shown)
    try:
        # Each name is compared; a folder of a million files must not delay the message.
        present = sorted(os.listdir(folder or "."))[:5000]
    except (OSError, ValueError):
        return f"the folder {folder!r} does not exist either" if folder else "check the path"
    close = [repr(os.path.join(folder, c)) for c in guesses(name, present, cutoff=0.75)]
    if close:
        return f"there is {one_of(close)}"
    start = "in the current folder" if named_at is None else "at the file that names them"
    return f"check the path; relative paths start {start}"
