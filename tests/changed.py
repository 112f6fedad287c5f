"""Whole results of files that are changed in one place: what a reader or a check makes of each.

A test gives the result of each change as a text. How many changes there are, how many findings they
make and the digest of all results stand in one line of `changed.txt` beside the test. What differs
is seen by running the test before and after a change of the code:

    FSN_CHANGED=/tmp/before python -m pytest -k each_change tests     # with the code as it was
    FSN_CHANGED=/tmp/after python -m pytest -k each_change tests
    diff -r /tmp/before /tmp/after

Where the difference is wanted, `FSN_RECORD=1` writes the lines anew.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from fcntl import LOCK_EX, flock
from functools import cache
from pathlib import Path

_NUMBER = re.compile(r"(?<![\w.])(0x|#x)?([0-9a-fA-F]+)(?![\w.])")
_WORD = re.compile(r"(?<![\w</:&#])[A-Za-z_]\w+")
_TAG = re.compile(r"<(/?)([A-Za-z][\w:.-]*)((?:\"[^\"]*\"|[^\">])*?)(/?)>")
_ATTRIBUTE = re.compile(r"\s[A-Za-z][\w:]*=\"[^\"]*\"")
_VALUE = re.compile(r"(\w+): ([^,}\s]+)")
_FINDING = re.compile(r"\[FSN\d{3}\]: ")

Changes = Iterator[tuple[str, str]]


def gone(text: str) -> Changes:
    """Yield the text once without each line; XML without each element, without each attribute."""
    for first, end in _parts(text):
        yield f"{_place(text, first)} gone", text[:first] + text[end:]
    for match in _ATTRIBUTE.finditer(text) if _is_xml(text) else ():
        name = f"{_place(text, match.start())} attribute gone"
        yield name, text[: match.start()] + text[match.end() :]


def twice(text: str) -> Changes:
    """Yield the text once with each line twice; XML with each element."""
    for first, end in _parts(text):
        yield f"{_place(text, first)} twice", text[:end] + text[first:]


def more(text: str) -> Changes:
    """Yield the text once with each number one more."""
    for match in _NUMBER.finditer(text):
        prefix, digits = match[1] or "", match[2]
        if not prefix and not digits.isdigit():
            continue  # a word
        base, form = (16, "x") if prefix else (10, "d")
        other = format(int(digits, base) + 1, f"0{len(digits)}{form}")
        name = f"{_place(text, match.start())} {prefix}{digits} + 1"
        yield name, text[: match.start(2)] + other + text[match.end(2) :]


def words(text: str) -> Changes:
    """Yield the text once with each word another one; of XML not the names of elements."""
    for match in _WORD.finditer(text):
        name = f"{_place(text, match.start())} {match[0]} is another"
        yield name, text[: match.end()] + "q" + text[match.end() :]


def others(text: str, most: int = 3) -> Changes:
    """Yield the text once with each value of a key replaced by others that the key has."""
    found = list(_VALUE.finditer(text))
    values: dict[str, list[str]] = {}
    for match in found:
        values.setdefault(match[1], []).append(match[2])
    for match in found:
        known = list(dict.fromkeys(values[match[1]]))
        at = known.index(match[2])
        for other in (known[at + 1 :] + known[:at])[:most]:
            name = f"{_place(text, match.start())} {match[0]} is {other}"
            yield name, text[: match.start(2)] + other + text[match.end(2) :]


WAYS: dict[str, Callable[[str], Changes]] = {w.__name__: w for w in (gone, twice, more, words)}


def bits(data: bytes, step: int = 1) -> Iterator[tuple[str, bytes]]:
    """Yield the bytes with one bit of each other, the bit changing from byte to byte."""
    for n in range(0, len(data), step):
        yield f"byte {n}", data[:n] + bytes([data[n] ^ 1 << n // step % 8]) + data[n + 1 :]


def whole(value: object, seen: dict[int, tuple[int, object]] | None = None) -> str:
    """Return all that a value holds, the same in each process; what comes again by its number."""
    kind = type(value)
    if kind in _PLAIN:  # most values, by far
        return repr(value)
    seen = {} if seen is None else seen
    names = _fields_of(kind)
    if names is not None:
        if id(value) in seen:
            return f"#{seen[id(value)][0]}"
        seen[id(value)] = len(seen), value  # kept: what is made on demand must not go
        inner = [f"{name}={whole(getattr(value, name), seen)}" for name in names]
        return f"({', '.join(inner)})"
    if isinstance(value, tuple | list):
        return f"[{', '.join([whole(v, seen) for v in value])}]"
    if isinstance(value, set | frozenset):
        return f"{{{', '.join(sorted(whole(v, {}) for v in value))}}}"
    if isinstance(value, Mapping):
        rows = [f"{whole(k, seen)}: {whole(v, seen)}" for k, v in value.items()]
        return f"{{{', '.join(rows)}}}"
    return repr(value)


_PLAIN = {str, int, bool, float, bytes, type(None)}


@cache
def _fields_of(kind: type) -> tuple[str, ...] | None:
    return tuple(f.name for f in fields(kind)) if is_dataclass(kind) else None


def compare(test: str, name: str, results: Iterable[tuple[str, str]]) -> None:
    """Compare the results of all changes with the recorded line; `test` is the test's file."""
    path = Path(test).parent / "changed.txt"
    whole = dict(results)
    text = "".join(f"== {change}\n{said}\n" for change, said in whole.items())
    text = text.replace(f"{Path.cwd()}/", "")
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    row = f"{name}: {len(whole)} changes, {len(_FINDING.findall(text))} findings, {digest}"
    if "FSN_CHANGED" in os.environ:
        shown = Path(os.environ["FSN_CHANGED"]) / path.parent.name / f"{name}.txt"
        shown.parent.mkdir(parents=True, exist_ok=True)
        shown.write_text(text, "utf-8")
    if "FSN_RECORD" in os.environ:
        _record(path, name, row)
    recorded = _rows(path.read_text("utf-8")).get(name)
    assert recorded == row, f"{path}: {recorded}, now\n{row}; changed.py says how to see the rest"


def _rows(text: str) -> dict[str, str]:
    return {line.partition(":")[0]: line for line in text.splitlines()}


def _record(path: Path, name: str, row: str) -> None:
    """Write one line anew; several processes may do so at once."""
    with path.open("a+", encoding="utf-8") as file:
        flock(file, LOCK_EX)
        file.seek(0)
        rows = _rows(file.read()) | {name: row}
        file.truncate(0)
        file.write("".join(f"{rows[key]}\n" for key in sorted(rows)))


def _is_xml(text: str) -> bool:
    return text.lstrip().startswith("<")


def _parts(text: str) -> list[tuple[int, int]]:
    """Return first and end of each line, of XML of each element."""
    if not _is_xml(text):
        starts = [0, *(m.end() for m in re.finditer("\n", text))]
        return [(a, b) for a, b in zip(starts, [*starts[1:], len(text)], strict=True) if a < b]
    out, opened = [], []
    for tag in _TAG.finditer(text):
        if tag[1]:
            out.append((opened.pop(), tag.end()))
        elif tag[4]:
            out.append((tag.start(), tag.end()))
        else:
            opened.append(tag.start())
    return sorted(out)


def _place(text: str, at: int) -> str:
    return f"{text.count(chr(10), 0, at) + 1}:{at - text.rfind(chr(10), 0, at)}"
