"""Which lines of a text of YAML a change of its maps and lists touches.

What was read is compared with the maps and lists as they are now. What differs becomes spans of
whole lines, each with what is to be said there.
"""

from __future__ import annotations

from bisect import bisect_left
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

    Maps and lists are known again as the same objects. Scalars that differ in the same place were
    changed; what is left over was removed or added. An item that moved counts as both.
    """
    now = list(value.items()) if isinstance(value, dict) else [(None, v) for v in value]
    found = _known_again(
        part.keys if part.keys else [_mark(p.value) for p in part.parts],
        [key if part.keys else _mark(each) for key, each in now],
    )
    rows: list[_Row] = []
    old, new = 0, 0
    for at in _longest_rising(found):
        (key, each), number = now[at], found[at]
        assert number is not None  # noqa: S101 - only numbers rise
        rows += _gap(part, range(old, number), now[new:at])
        rows.append(_Row(number, key, each, differs=not is_same(part.parts[number], each)))
        old, new = number + 1, at + 1
    return rows + _gap(part, range(old, len(part.parts)), now[new:])


def _known_again(old: list[Any], new: list[Any]) -> list[int | None]:
    """Return which of the old ones each new one is; those that are equal in the same order.

    What is alike at the begin and at the end counts first: of equal scalars any might be meant.
    """
    shorter = min(len(old), len(new))
    begin = next((n for n in range(shorter) if old[n] != new[n]), shorter)
    most = shorter - begin
    end = next((n for n in range(most) if old[-1 - n] != new[-1 - n]), most)
    places: dict[object, list[int]] = {}
    for n in reversed(range(begin, len(old) - end)):
        places.setdefault(old[n], []).append(n)
    middle = [
        stack.pop() if (stack := places.get(mark)) else None for mark in new[begin : len(new) - end]
    ]
    return [*range(begin), *middle, *range(len(old) - end, len(old))]


def _mark(value: Any) -> object:
    """Return by what an item of a list is known again."""
    return id(value) if isinstance(value, dict | list) else (type(value).__name__, repr(value))


def _longest_rising(numbers: list[int | None]) -> list[int]:
    """Return the places of the longest run of numbers that rise, with others between them.

    By patience sorting: of each length the run with the smallest end is kept.
    """
    ends: list[int] = []
    at_ends: list[int] = []
    before: dict[int, int] = {}
    for at, number in enumerate(numbers):
        if number is None:
            continue
        length = bisect_left(ends, number)
        ends[length : length + 1] = [number]
        at_ends[length : length + 1] = [at]
        if length:
            before[at] = at_ends[length - 1]
    run: list[int] = []
    at_last = at_ends[-1] if at_ends else None
    while at_last is not None:
        run.append(at_last)
        at_last = before.get(at_last)
    return run[::-1]


def _gap(part: Part, old: range, new: list[tuple[Any, Any]]) -> list[_Row]:
    """Return rows between two that are known: changed ones, what has come, what has gone."""
    key_of = (lambda n: part.keys[n]) if part.keys else (lambda _: None)
    ends = [part.parts[n].value for n in old], [value for _, value in new]
    is_scalars = not any(isinstance(value, dict | list) for values in ends for value in values)
    pairs = min(len(old), len(new)) if is_scalars and not part.keys else 0
    rows = [_Row(n, None, v) for n, (_, v) in zip(old[:pairs], new[:pairs], strict=True)]
    # What has come is written behind what is before it, whatever comments stand behind what goes.
    rows += [_Row(None, key, value) for key, value in new[pairs:]]
    return rows + [_Row(n, key_of(n), stays=False) for n in old[pairs:]]


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
        if number is None:
            _write_with(rows, at, written, 1)
        elif not row.stays and not _is_whole_lines(part, number):
            _write_with(rows, at, written, 2)
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
    """Return lines that go; comments behind them, which are about what follows, stay.

    So do blank lines behind the last part, unless there is one before it.
    """
    begin, behind = part.lines[number], part.parts[number].last + 1
    is_apart = number + 1 < len(part.parts) or not read.lines[max(begin - 1, 0)].strip()
    has_comment = any(line.strip() for line in read.lines[behind:stop])
    return ChangedLines(begin, stop if is_apart and not has_comment else behind, part, [])


def _write_with(rows: list[_Row], at: int, written: list[bool], most: int) -> None:
    """Write a row with so many of the two beside it: they show how it is laid out."""
    if at and rows[at].number is None and rows[at - 1].number is None:
        written[at] = True  # with the new one before it
        return
    found = [n for n in (_kept_beside(rows, at, -1), _kept_beside(rows, at, 1)) if n is not None]
    for beside in found[:most]:
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
    while stop > begin and _is_behind(read.lines[stop - 1], part.column + part.is_level):
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


def _drop_comments_inside(written: Any, key: Any, old: Part) -> None:
    """Drop comments before the first part of a value, which would come before another value.

    ruamel.yaml keeps them behind that of the key itself: in its third place, and in the fourth.
    """
    tokens = None if isinstance(written, list) else written.ca.items.get(key)
    if tokens is not None and old.is_block:
        of_key = tokens[2].value.partition("\n")[0] if tokens[2] is not None else ""
        tokens[3] = None
        if of_key:
            tokens[2].value = f"{of_key}\n"
        else:
            tokens[2] = None


def _change(written: Any, part: Part, rows: list[_Row], done: set[int]) -> None:
    """Change a map or list; one that an alias shows in a second place, once."""
    if id(part) in done:
        return
    done.add(id(part))
    _remove(written, part, [row for row in rows if row.number is not None])
    for at, row in enumerate(row for row in rows if row.stays):
        if row.number is None:
            where = (at, row.key) if isinstance(part.value, dict) else (at,)
            written.insert(*where, row.value)
        elif row.differs:
            place = row.key if isinstance(part.value, dict) else at
            old = part.parts[row.number]
            if row.value is old.value and old.parts and row.value:
                _change(written[place], old, _rows_of(old, row.value), done)
            else:
                _drop_comments_inside(written, place, old)
                written[place] = row.value


def _remove(written: Any, part: Part, rows: list[_Row]) -> None:
    """Remove what goes; the rows are those of parts, which stand there as they did."""
    for at, row in reversed(list(enumerate(rows))):
        if not row.stays:
            del written[row.key if isinstance(part.value, dict) else at]
