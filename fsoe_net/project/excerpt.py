"""The line of a file that a finding is about, with a mark below its column."""

from __future__ import annotations

import functools
import os
import re
import stat
import unicodedata
from collections.abc import Iterable

from fsoe_net.diag.diagnostic import Span
from fsoe_net.diag.printable import printable

STDIN = "-"
_MOST_BYTES = 4 << 20
_WIDTH = 92  # columns of a line that are shown
_BEFORE = 60  # maximum before the marked column
# A comma in a number is part of what was typed; in a list it ends a value.
# A number and its unit are one value.
_UNIT = r"\d[\d.]* [^\W\d_]+(?=\s*(?:$|[,\]}])|\s+#)|"
_TOKEN = re.compile(_UNIT + r'\d+,\d+(?!\S)|"[^"]*"|\'[^\']*\'|</?[\w:.-]+|[^\s,:#<>\[\]{}"\']+')
# YAML also ends lines at these; XML does not. Line numbers of a file with one are ambiguous.
_ODD_BREAKS = re.compile("[\x0b\x0c\x85\u2028\u2029]")


def excerpt(span: Span, folders: Iterable[str]) -> list[str]:
    """Return the line of a place and a line of ``^`` below it, for a terminal.

    Empty if nothing can be shown: the place has no line, or the file is missing, is not text, or
    has more than 4 MiB. Also empty for files that must not be shown: an untrusted file can refer to
    any file of the user, whose content does not belong in a log.

    Args:
        span: The place.
        folders: Folders with files that the user named. Files below them are shown, except hidden
            ones.
    """
    if span.line < 1 or span.column < 1 or not _is_below(span.file, folders):
        return []
    lines = _lines(span.file)
    if span.line > len(lines):
        return []
    text = lines[span.line - 1]
    if span.column > len(text):
        return []
    start = span.column - 1
    token = _TOKEN.match(text, start)
    end = token.end() if token else start + 1
    first = max(0, start - _BEFORE) if len(text) > _WIDTH else 0
    last = first + _WIDTH
    head = ("…" if first else "") + _shown(text[first:start])
    marked = _shown(text[start : min(end, last)])
    tail = _shown(text[end:last]) + ("…" if last < len(text) else "")
    number = f"{span.line:5}"
    return [
        f"{number} | {head}{marked}{tail}".rstrip(),
        f"{' ' * len(number)} | {' ' * _columns(head)}{'^' * max(1, _columns(marked))}",
    ]


def _is_below(path: str, folders: Iterable[str]) -> bool:
    if path == STDIN:
        return False
    real = os.path.realpath(path)
    for folder in folders:
        inside = os.path.relpath(real, os.path.realpath(folder)).split(os.sep)
        if not any(part.startswith(".") for part in inside):
            return True
    return False


def _shown(text: str) -> str:
    return printable(text.replace("\t", " "))


def _columns(text: str) -> int:
    """Return the number of columns of a text in a terminal."""
    wide = sum(unicodedata.east_asian_width(c) in "WF" for c in text)
    return len(text) + wide - sum(unicodedata.combining(c) > 0 for c in text)


def _lines(path: str) -> list[str]:
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return []
    # A pipe would block, and a device never ends.
    if not stat.S_ISREG(status.st_mode) or status.st_size > _MOST_BYTES:
        return []
    return _read(path, status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=8)
def _read(path: str, _mtime_ns: int, _size: int) -> list[str]:
    try:
        with open(path, "rb") as file:
            text = file.read(_MOST_BYTES + 1).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError):
        return []
    return [] if _ODD_BREAKS.search(text) else re.split(r"\r\n|\r|\n", text)
