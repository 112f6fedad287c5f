"""Whole results of files that are changed in one place: what a reader or a check makes of each.

A test gives the result of each change as a text without sentences: of findings the codes, levels,
places and edits, of other texts the figures. One line of `changed.txt` next to the test holds them;
a message may be reworded without a change there. To see what differs, run the test before and after
a change of the code:

    FSN_CHANGED=/tmp/before python -m pytest -k each_change tests     # with the code as it was
    FSN_CHANGED=/tmp/after python -m pytest -k each_change tests
    diff -r /tmp/before /tmp/after

After an intended change, `FSN_RECORD=1` writes the lines again.
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

from fsoe_net.diag.diagnostic import Diagnostic

_NUMBER = re.compile(r"(?<![\w.])(0x|#x)?([0-9a-fA-F]+)(?![\w.])")
_WORD = re.compile(r"(?<![\w</:&#])[A-Za-z_]\w+")
_TAG = re.compile(r"<(/?)([A-Za-z][\w:.-]*)((?:\"[^\"]*\"|[^\">])*?)(/?)>")
_ATTRIBUTE = re.compile(r"\s[A-Za-z][\w:]*=\"[^\"]*\"")
_VALUE = re.compile(r"(\w+): ([^,}\s]+)")
_FINDING = re.compile(r"^FSN\d{3} ", re.MULTILINE)
_FIGURE = re.compile(r"[\w.:+-]*\d[\w.:+-]*")
_SENTENCE = re.compile(r"([^\W\d_]{2,}\W+){2}[^\W\d_]{2,}")
_COMMENT = re.compile(r"# [^\n]*|<!--.*?-->|/\*.*?\*/|// [^\n]*", re.DOTALL)

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


def figures(text: str) -> str:
    """Return what of a sentence is no wording: each part of it that has a digit."""
    return " ".join(part.strip(".:") for part in _FIGURE.findall(text))


def findings(rows: Iterable[Diagnostic]) -> str:
    """Return code, level, places and edits of each finding, a line each, sorted by them."""
    lines = []
    for one in rows:
        parts = [one.code, one.level.value, str(one.span), *(f"see {r.span}" for r in one.related)]
        parts += [f"edit {e.span} {e.key} {e.renames} {e.text}" for e in one.edits]
        lines.append(" ".join(parts))
    return "\n".join(sorted(lines))


def _text(text: str) -> str:
    """Return a text; of a sentence, and of the comments of a document, the figures only."""
    if "\n" in text:
        return repr(_COMMENT.sub(lambda match: figures(match[0]), text))
    return figures(text) if _SENTENCE.search(text) else repr(text)


def whole(value: object, seen: dict[int, tuple[int, object]] | None = None) -> str:
    """Return what a value holds, without sentences; an object that comes again by its number."""
    kind = type(value)
    if isinstance(value, str) and kind is str:
        return _text(value)
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


_PLAIN = {int, bool, float, bytes, type(None)}


@cache
def _fields_of(kind: type) -> tuple[str, ...] | None:
    return tuple(f.name for f in fields(kind)) if is_dataclass(kind) else None


def compare(test: str, name: str, results: Iterable[tuple[str, str]]) -> None:
    """Compare each result with the recorded one, by a digest; `test` is the test's file."""
    whole = dict(results)
    text = _all_of(whole)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    _recorded(test, name, f"{len(whole)} results, {_findings_in(text)} findings, {digest}", text)


def count(test: str, name: str, results: Iterable[tuple[str, str]]) -> None:
    """Compare how many results differ from each other, and how many findings they have.

    A reader that ignores a value, or a rule that no longer reports, lowers a number. A new field of
    a model changes none.
    """
    whole = dict(results)
    text = _all_of(whole)
    distinct = len(set(whole.values()))
    row = f"{len(whole)} changes, {distinct} distinct results, {_findings_in(text)} findings"
    _recorded(test, name, row, text)


def _all_of(results: Mapping[str, str]) -> str:
    text = "".join(f"== {change}\n{result}\n" for change, result in results.items())
    return text.replace(f"{Path.cwd()}/", "")


def _findings_in(text: str) -> int:
    return len(_FINDING.findall(text))


def _recorded(test: str, name: str, counts: str, text: str) -> None:
    path, row = Path(test).parent / "changed.txt", f"{name}: {counts}"
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
    """Write one line; several processes may do so at once."""
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
