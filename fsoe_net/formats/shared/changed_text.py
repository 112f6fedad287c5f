"""Applies changes of maps and lists to YAML text in place.

The parsed text is compared with the current maps and lists. Differences are written into the text;
all other characters are unchanged.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from typing import Any

from fsoe_net.dataclass import dataclass
from fsoe_net.formats.shared.yaml_parts import Part, PartRow, ReadText, is_same
from fsoe_net.formats.shared.yaml_words import in_brackets, in_lines, is_empty, scalar

_COMMA_BEHIND = re.compile(r"\s*,[ \t]*")
_ALIGNED_COMMENT = re.compile(r"  +(?=#)")
_DASHES = re.compile(r" *(?:- +)+")


@dataclass(frozen=True, slots=True)
class _Now:
    """Change of a row, or a new row.

    Attributes:
        row: The row as read, or ``None`` if it is new.
        key: Its key in a map.
        value: Its current value.
        stays: Whether it still exists; otherwise the row is removed.
    """

    row: PartRow | None
    key: Any
    value: Any = None
    stays: bool = True


def changed_text(read: ReadText, value: Any) -> str | None:
    """Return the text for the current maps and lists.

    Inserted lines can change the meaning of others: parse and compare the result.

    Args:
        read: The text as it was read.
        value: Its current maps and lists.

    Returns:
        ``None`` if the layout of the lines does not allow the change.

    Raises:
        yaml.YAMLError: A value cannot be represented in YAML.
        RecursionError: A value contains itself.
    """
    changes = _Changes(read)
    root = read.root
    # Treat it as an item after a dash to the left of the first column.
    holder = Part("", 0, [], 0, 0, column=-2, is_block=True)
    try:
        changes.set(
            holder, PartRow(root, None, root.begin, root.begin, root.begin, root.stop), value
        )
        return changes.text
    except _OddLayoutError:
        return None


class _OddLayoutError(Exception):
    """A row cannot be removed from its lines."""


# -- which row is which ----------------------------------------------------------------------------


def _rows_now(part: Part, value: Any) -> list[_Now]:
    """Return changed, removed and new rows of a map or list, in the order of both.

    Maps and lists are recognised as the same objects. Items that differ at the same place were
    changed; the others were removed or added. A moved item counts as both.
    """
    is_map = isinstance(value, dict)
    now = list(value.items()) if is_map else [(None, v) for v in value]
    found = _known_again(
        [row.key if is_map else _mark(row.part.value) for row in part.rows],
        [key if is_map else _mark(each) for key, each in now],
    )
    rows: list[_Now] = []
    old, new = 0, 0
    for at in _longest_rising(found):
        (key, each), number = now[at], found[at]
        assert number is not None  # noqa: S101 - only numbers rise
        rows += _gap(part.rows[old:number], now[new:at], is_map)
        rows.append(_Now(part.rows[number], key, each))
        old, new = number + 1, at + 1
    return rows + _gap(part.rows[old:], now[new:], is_map)


def _known_again(old: list[Any], new: list[Any]) -> list[int | None]:
    """Return the old item for each new one; equal items keep their order.

    Equal items at the beginning and at the end are matched first, because equal scalars are
    ambiguous.
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
    """Return the key that identifies an item of a list."""
    return id(value) if isinstance(value, dict | list) else (type(value).__name__, repr(value))


def _longest_rising(numbers: list[int | None]) -> list[int]:
    """Return the places of the longest increasing subsequence.

    Uses patience sorting: for each length, the subsequence with the smallest last number is kept.
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
    # Backwards from the end of the longest subsequence, along the predecessors.
    run: list[int] = []
    at_last = at_ends[-1] if at_ends else None
    while at_last is not None:
        run.append(at_last)
        at_last = before.get(at_last)
    return run[::-1]


def _gap(old: list[PartRow], new: list[tuple[Any, Any]], is_map: bool) -> list[_Now]:
    """Return the rows between two matched rows: changed, added and removed ones.

    Scalars are paired in order; maps and lists only if the numbers of old and new ones are equal.
    """
    is_scalars = not any(isinstance(value, dict | list) for _, value in new) and not any(
        isinstance(row.part.value, dict | list) for row in old
    )
    pairs = min(len(old), len(new)) if not is_map and (is_scalars or len(old) == len(new)) else 0
    rows = [_Now(row, None, v) for row, (_, v) in zip(old[:pairs], new[:pairs], strict=True)]
    # New rows are written after the preceding row, whatever comments follow removed rows.
    rows += [_Now(None, key, value) for key, value in new[pairs:]]
    return rows + [_Now(row, row.key, stays=False) for row in old[pairs:]]


def _first_that_stays(rows: list[_Now]) -> tuple[int, PartRow]:
    return next((n, now.row) for n, now in enumerate(rows) if now.stays and now.row is not None)


# -- in place --------------------------------------------------------------------------------------


class _Changes:
    """Changes of a text, each with a range and its replacement."""

    def __init__(self, read: ReadText) -> None:
        self._read = read
        self._line_end = "\r\n" if read.text[read.line_end(0) :].startswith("\r\n") else "\n"
        self._changes: list[tuple[int, int, str]] = []
        self._done: set[int] = set()

    @property
    def text(self) -> str:
        """The text with all changes in it."""
        text, parts, at = self._read.text, [], 0
        # At the same place, insertions come before removals; otherwise changes keep their order.
        for begin, stop, new in sorted(self._changes, key=lambda change: change[:2]):
            # Blank lines that are removed may be at the place of an insertion.
            parts += [text[at:begin], new]
            at = max(at, stop)
        return "".join([*parts, text[at:]])

    def set(self, holder: Part, row: PartRow, value: Any) -> None:
        """Set the value of a row of a map or list."""
        old = row.part
        if is_same(old, value):
            return
        rows = []
        # Only the map or list that was read has rows in the text; any other one replaces it
        # completely.
        if value is old.value:
            if id(old) in self._done:  # an alias refers to it a second time
                return
            self._done.add(id(old))
            rows = _rows_now(old, value)
        if not any(now.stays and now.row is not None for now in rows):
            self._replace(holder, row, value)
        else:
            (self._change_lines if old.is_block else self._change_brackets)(old, rows)

    def _put(self, begin: int, stop: int, text: str) -> None:
        if text or stop > begin:
            self._changes.append((begin, stop, text))

    def _put_lines(self, begin: int, stop: int, lines: list[str]) -> None:
        self._put(begin, stop, "".join(f"{line}{self._line_end}" for line in lines))

    def _replace(self, holder: Part, row: PartRow, value: Any) -> None:
        """Replace a value by another one."""
        read = self._read
        was_brackets = bool(row.part.rows) and row.part.begin == row.at and not row.part.is_block
        if not isinstance(value, dict | list | tuple):
            like = read.text[row.at : row.stop]
            words = scalar(value, like=like, is_in_brackets=not holder.is_block)
        elif not holder.is_block or is_empty(value) or was_brackets:
            words = in_brackets(value)
        else:
            self._replace_by_lines(holder, row, value)
            return
        if self._is_below(row):
            self._put(row.head, row.head, f" {words}")
            self._put(read.line_begin(row.at), read.line_behind(row.stop), "")
            return
        stop = self._stop_of(row)
        # A comment after the value keeps its column.
        comment = _ALIGNED_COMMENT.match(read.text, stop)
        self._put(row.at, stop, row.space + words)
        if comment and "\n" not in read.text[row.at : stop]:
            blanks = comment.end() - row.at - len(words)
            self._put(stop, comment.end(), " " * max(blanks, 2))

    def _is_below(self, row: PartRow) -> bool:
        """Whether a value is on the lines below its key or dash."""
        return row.is_lines and self._read.line_of(row.head) != self._read.line_of(row.at)

    def _stop_of(self, row: PartRow) -> int:
        """Return the end of a value, with the comment on its last line."""
        is_one_line = self._read.line_of(row.at) == self._read.line_of(row.stop)
        return row.stop if is_one_line or not row.is_lines else self._read.line_end(row.stop)

    def _replace_by_lines(self, holder: Part, row: PartRow, value: Any) -> None:
        """Replace a value by a map or list on separate lines."""
        old, read = row.part, self._read
        kind = dict if isinstance(value, dict) else list
        is_map, is_below = isinstance(holder.value, dict), self._is_below(row)
        if row.is_lines and isinstance(old.value, kind):
            column = old.column
        elif is_map or is_below:
            column = holder.column + (self._read.under_key[kind] if is_map else 2)
        else:
            column = row.at - read.line_begin(row.at) + len(row.space)
        lines = in_lines(value, column, self._read.under_key)
        behind = read.line_behind(row.stop)
        if is_below:
            self._put_lines(read.line_begin(row.at), behind, lines)
        elif is_map:
            self._put(row.head, row.stop, "")
            self._put_lines(behind, behind, lines)
        else:
            self._put(row.at, self._stop_of(row), row.space + lines[0].lstrip(" "))
            self._put_lines(behind, behind, lines[1:])

    def _change_lines(self, part: Part, rows: list[_Now]) -> None:
        """Change a map or list whose rows are on separate lines."""
        first, above = _first_that_stays(rows)
        self._change_first(part, rows[:first], above)
        for number, now in enumerate(rows[first:], first):
            row = now.row
            if row is None:
                below = self._place_below(part, above)
                self._put_lines(below, below, self._new_lines(part, now, above))
            elif now.stays:
                above = row
                self.set(part, row, now.value)
            else:
                self._cut(part, row, has_next=number + 1 < len(rows))

    def _change_first(self, part: Part, before: list[_Now], row: PartRow) -> None:
        """Change the rows before the first remaining one."""
        read = self._read
        new = [now for now in before if now.row is None]
        lines = [line for now in new for line in self._new_lines(part, now, row)]
        gone = [now.row for now in before if now.row is not None]
        top = gone[0] if gone else row
        line_begin = read.line_begin(top.begin)
        head = read.text[line_begin : top.begin]
        if not head.strip(" "):
            for each in gone:
                self._cut(part, each, has_next=True)
            place = self._place_above(part, row)
            self._put_lines(place, place, lines)
            return
        # It follows the dash of its parent list item, as the new first row must.
        if not _DASHES.fullmatch(head) or len(head) != part.column:
            raise _OddLayoutError
        pad = " " * part.column
        text = "".join(f"{line}{self._line_end}" for line in lines) + pad
        if not gone:
            self._put(row.begin, row.begin, text.removeprefix(pad))
            return
        self._put(line_begin, read.line_behind(top.stop), "")
        for each in gone[1:]:
            self._cut(part, each, has_next=True)
        self._put(self._begin_of_line(row), row.begin, head + text.removeprefix(pad))

    def _begin_of_line(self, row: PartRow) -> int:
        """Return the start of the line of a row that is alone on it."""
        begin = self._read.line_begin(row.begin)
        if self._read.text[begin : row.begin].strip(" "):
            raise _OddLayoutError
        return begin

    def _new_lines(self, part: Part, now: _Now, beside: PartRow) -> list[str]:
        """Return the lines of a new row; in a list, laid out like its neighbour."""
        if isinstance(part.value, dict):
            return in_lines({now.key: now.value}, part.column, self._read.under_key)
        is_block = bool(beside.part.rows) and beside.part.is_block
        if beside.part.rows and not is_block and isinstance(now.value, dict | list | tuple):
            return [f"{' ' * part.column}- {in_brackets(now.value)}"]
        return in_lines([now.value], part.column, self._read.under_key, has_short=not is_block)

    def _place_below(self, part: Part, row: PartRow) -> int:
        """Return the start of lines below a row: after comments that are indented more than it."""
        read = self._read
        place = read.line_behind(row.stop)
        while place < len(read.text) and self._is_comment(place, part.column + 1):
            place = read.line_behind(place)
        return place

    def _place_above(self, part: Part, row: PartRow) -> int:
        """Return the start of the lines above a row: before the comments directly above it.

        Comments at the beginning of the text belong to the whole text.
        """
        read = self._read
        place = read.line_begin(row.begin)
        top = place
        while top and self._is_comment(read.line_begin(top - 1), part.column):
            top = read.line_begin(top - 1)
        return top or place

    def _is_comment(self, begin: int, column: int) -> bool:
        """Whether a line is a comment with at least this indentation."""
        line = self._read.text[begin : self._read.line_behind(begin)]
        text = line.lstrip(" ")
        return text.startswith("#") and len(line) - len(text) >= column

    def _cut(self, part: Part, row: PartRow, has_next: bool) -> None:
        """Remove the lines of a row; comments above and below stay.

        Blank lines below also stay, unless a blank line or nothing is above the row.
        """
        read = self._read
        begin = self._begin_of_line(row)
        stop = behind = read.line_behind(row.stop)
        while stop < len(read.text) and not read.text[stop : read.line_behind(stop)].strip():
            stop = read.line_behind(stop)
        above = read.text[read.starts[max(read.line_of(begin) - 1, 0)] : begin]
        is_apart = not above.strip() or (has_next and row is part.rows[0])
        self._put(begin, stop if is_apart else behind, "")

    def _change_brackets(self, part: Part, rows: list[_Now]) -> None:
        """Change a map or list in brackets."""
        _, below = _first_that_stays(rows)
        last = max(number for number, now in enumerate(rows) if now.stays)
        above: PartRow | None = None
        for number, now in enumerate(rows):
            row = now.row
            if row is None:
                is_map = isinstance(part.value, dict)
                words = in_brackets({now.key: now.value} if is_map else [now.value])[1:-1]
                if above is None:
                    self._put(below.begin, below.begin, f"{words}, ")
                else:
                    self._put(above.stop, above.stop, f", {words}")
            elif now.stays:
                above = row
                self.set(part, row, now.value)
            elif above is not None and number > last:
                self._cut_last(above, [later.row for later in rows[number:] if later.row])
                return
            else:
                self._cut_item(row)

    def _cut_last(self, above: PartRow, gone: list[PartRow]) -> None:
        """Remove the last items in brackets; comments between them stay."""
        if "#" not in self._read.text[above.stop : gone[0].begin]:
            self._put(above.stop, gone[-1].stop, "")
            return
        for row in gone:
            self._cut_item(row)

    def _cut_item(self, row: PartRow) -> None:
        """Remove an item in brackets with the following comma, or its whole line."""
        text = self._read.text
        found = _COMMA_BEHIND.match(text, row.stop)
        begin, stop = row.begin, found.end() if found else row.stop
        line_begin = self._read.line_begin(begin)
        line_end = self._read.line_end(stop)
        if stop == line_end and not text[line_begin:begin].strip():
            begin, stop = line_begin, self._read.line_behind(stop)
        self._put(begin, stop, "")
