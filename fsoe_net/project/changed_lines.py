"""Which lines of a text of YAML a change of its maps and lists touches.

What was read is compared with the maps and lists as they are now. What differs becomes spans of
whole lines, each with what is to be said there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fsoe_net.project.yaml_parts import Part, ReadText, is_same

__all__ = ["ChangedLines", "change_rows", "spans_of", "whole_of"]


@dataclass(frozen=True, slots=True)
class _Row:
    """What becomes of a part, or a new one.

    Attributes:
        number: Which part of its map or list; ``None``: it is new.
        key: In a map.
        value: What it says now.
        stays: Whether there is still something: otherwise the part goes.
        differs: Whether it has to be written.
    """

    number: int | None
    key: Any
    value: Any = None
    stays: bool = True
    differs: bool = True


@dataclass(frozen=True, slots=True)
class ChangedLines:
    """Lines of the text that are written anew.

    Attributes:
        begin: The first line, from 0.
        stop: The line behind the last one.
        part: Whose parts stand there.
        rows: What becomes of those, and what is new among them; none: the lines go.
    """

    begin: int
    stop: int
    part: Part
    rows: list[_Row]


def spans_of(read: ReadText, value: Any) -> list[ChangedLines] | None:
    """Return the lines that are to be written anew, from the first to the last.

    Args:
        read: As it was read.
        value: Its maps and lists as they are now.

    Returns:
        ``None`` where only the whole can be written anew.
    """
    if read.is_linked:
        return None
    return _spans(read, read.root, value, len(read.lines))


def _rows_of(part: Part, value: Any) -> list[_Row]:
    """Return what becomes of each part of a map or list, and what is new, in the order of both.

    Maps and lists are known again as the same objects; what else differs in the same place has been
    changed, and what is too many there has gone or has come.
    """
    now = list(value.items()) if isinstance(value, dict) else [(None, v) for v in value]
    known = {id(p.value): n for n, p in enumerate(part.parts)}
    of_key = {key: n for n, key in enumerate(part.keys)}
    rows: list[_Row] = []
    old, new = 0, 0
    for at, (key, each) in enumerate(now):
        if isinstance(value, dict):
            number = of_key.get(key, -1)
        elif isinstance(each, dict | list):  # an alias may have put one into more than one place
            is_next = old < len(part.parts) and part.parts[old].value is each
            number = old if is_next else known.get(id(each), -1)
        else:
            number = _next_scalar(part, old, each, len(now) - at)
        if number < old:
            continue
        rows += _gap(part, range(old, number), now[new:at])
        rows.append(_Row(number, key, each, differs=not is_same(part.parts[number], each)))
        old, new = number + 1, at + 1
    return rows + _gap(part, range(old, len(part.parts)), now[new:])


def _next_scalar(part: Part, old: int, value: Any, left: int) -> int:
    """Return which of the next parts of a list is a scalar of this value; -1: none.

    No further than as many parts can go as there are too many.
    """
    for number in range(old, min(len(part.parts), old + max(len(part.parts) - old - left, 0) + 1)):
        if is_same(part.parts[number], value):
            return number
    return -1


def _gap(part: Part, old: range, new: list[tuple[Any, Any]]) -> list[_Row]:
    """Return rows between two that are known: changed ones, then what has gone or has come."""
    key_of = (lambda n: part.keys[n]) if part.keys else (lambda _: None)
    ends = [part.parts[n].value for n in old], [value for _, value in new]
    is_scalars = not any(isinstance(value, dict | list) for values in ends for value in values)
    pairs = min(len(old), len(new)) if is_scalars and not part.keys else 0
    rows = [_Row(n, None, v) for n, (_, v) in zip(old[:pairs], new[:pairs], strict=True)]
    rows += [_Row(n, key_of(n), stays=False) for n in old[pairs:]]
    return rows + [_Row(None, key, value) for key, value in new[pairs:]]


def _spans(read: ReadText, part: Part, value: Any, stop: int) -> list[ChangedLines] | None:
    """Return the spans of a part that ends before a line; ``None``: what holds it is written."""
    if is_same(part, value):
        return []
    if value is not part.value or not part.is_block or not part.parts:
        return None
    rows = _rows_of(part, value)
    ends = [*part.lines[1:], stop]
    found: dict[int, list[ChangedLines]] = {}
    written = [False] * len(rows)
    for at, row in enumerate(rows):
        number = row.number
        if number is None or not (row.stays or _is_whole_lines(part, number)):
            _write_with_those_beside(rows, at, written)
        elif row.stays and row.differs:
            inner = _spans(read, part.parts[number], row.value, ends[number])
            written[at] = written[at] or inner is None
            found[at] = inner or []
    if not any(row.stays for row in rows):
        return None
    return _joined(read, part, rows, ends, written, found)


def _is_whole_lines(part: Part, number: int) -> bool:
    return all(part.has_own_line[number : number + 2])


def _cut(read: ReadText, part: Part, number: int, stop: int) -> ChangedLines:
    """Return lines that go; comments behind them, which are about what follows, stay."""
    behind = part.parts[number].last + 1
    has_comment = any(line.strip() for line in read.lines[behind:stop])
    return ChangedLines(part.lines[number], behind if has_comment else stop, part, [])


def _write_with_those_beside(rows: list[_Row], at: int, written: list[bool]) -> None:
    """Those beside it show how it is laid out."""
    for beside in (_kept_beside(rows, at, -1), _kept_beside(rows, at, 1)):
        if beside is not None:
            begin, stop = min(at, beside), max(at, beside) + 1
            written[begin:stop] = [True] * (stop - begin)


def _kept_beside(rows: list[_Row], at: int, step: int) -> int | None:
    """Return the next row in one direction whose part stays."""
    at += step
    while 0 <= at < len(rows):
        if rows[at].number is not None and rows[at].stays:
            return at
        at += step
    return None


def _joined(
    read: ReadText,
    part: Part,
    rows: list[_Row],
    ends: list[int],
    written: list[bool],
    found: dict[int, list[ChangedLines]],
) -> list[ChangedLines] | None:
    """Return rows that are written, beside each other, as one span each, and those in others."""
    spans: list[ChangedLines] = []
    stop = len(rows)
    while stop:
        begin = stop - 1
        row = rows[begin]
        if written[begin]:
            while begin and (written[begin - 1] or not _begins_a_line(part, rows[begin:stop])):
                begin -= 1
            lines = _lines_of(read, part, rows[begin:stop], ends)
            if lines is None:
                return None
            spans.append(lines)
        elif row.stays or row.number is None:
            spans += reversed(found.get(begin, []))
        else:
            spans.append(_cut(read, part, row.number, ends[row.number]))
        stop = begin
    return spans[::-1]


def _lines_of(read: ReadText, part: Part, rows: list[_Row], ends: list[int]) -> ChangedLines | None:
    """Return the lines of rows beside each other; ``None``: they are no whole lines, or all go."""
    stays = any(row.stays and row.number is not None for row in rows)
    if not stays or not _begins_a_line(part, rows):
        return None
    numbers = [row.number for row in rows if row.number is not None]
    begin, stop = part.lines[numbers[0]], ends[numbers[-1]]
    while stop > begin and _is_behind(read.lines[stop - 1], part.column):
        stop -= 1
    return ChangedLines(begin, stop, part, rows)


def _begins_a_line(part: Part, rows: list[_Row]) -> bool:
    number = next((row.number for row in rows if row.number is not None), None)
    return number is not None and part.has_own_line[number]


def _is_behind(line: str, column: int) -> bool:
    """Whether a line at the end of a part is a comment, or a blank, that stands further out."""
    text = line.lstrip(" ")
    return not text.strip() or (text[0] == "#" and len(line) - len(text) < column)


# -- writing ---------------------------------------------------------------------------------------


def whole_of(read: ReadText, value: Any) -> ChangedLines:
    """Return all lines of a text, to be written anew."""
    rows = _rows_of(read.root, value)
    return ChangedLines(0, len(read.lines), read.root, rows)


def change_rows(written: Any, span: ChangedLines) -> None:
    """Change the maps and lists of a span as ruamel.yaml has read them from its lines alone."""
    _change(written, span.part, span.rows, set())


def _change(written: Any, part: Part, rows: list[_Row], done: set[int]) -> None:
    """Change a map or list; one that an alias shows in a second place, once."""
    if id(part) in done:
        return
    done.add(id(part))
    at = 0
    for row in rows:
        is_map = isinstance(part.value, dict)
        place = row.key if is_map else at
        if not row.stays:
            del written[place]
            continue
        if row.number is None:
            written.insert(*((at, row.key, row.value) if is_map else (at, row.value)))
        elif row.differs:
            old = part.parts[row.number]
            if row.value is old.value and old.parts and row.value:
                _change(written[place], old, _rows_of(old, row.value), done)
            else:
                if old.is_block:  # a comment before its first part would come before the value
                    written.ca.items.pop(place, None)
                written[place] = row.value
        at += 1
