"""The maps and lists of a YAML text, as parts with their places."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import date
from typing import Any

import yaml

_NO_KEY = object()
_LOADER = getattr(yaml, "CLoader", yaml.Loader)
_MOST_DEPTH = 64
_ANCHOR_OR_TAG = re.compile(r"(?:[&!]\S*\s+)*")
# After a key or a dash: the properties of any value that may follow.
_HEAD = re.compile(r"\s*[:-](?:[ \t]+[&!]\S*)*")
_INTEGER = re.compile(r"[-+]?(?:[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+)")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_WORDS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    ".inf": float("inf"),
    "-.inf": -float("inf"),
    ".nan": float("nan"),
}


class EditedMap(dict[Any, Any]):
    """A map of a text that is edited.

    Attributes:
        place: Its line and column in the text, from 1, as in `fsoe_net.diag.diagnostic.Span`.
    """

    __slots__ = ("place",)
    place: tuple[int, int]


@dataclass(slots=True, eq=False)
class Part:
    """A value of the text.

    Attributes:
        value: A map, a list, or a scalar.
        begin: Its start in the text, without an anchor and a tag.
        stop: Its end.
        column: Column of its keys or dashes, if `is_block`.
        is_block: Whether each row has its own line.
        rows: Its content.
        place: Its line and column, from 1, with an anchor or a tag.
    """

    value: Any
    begin: int
    stop: int
    column: int = 0
    is_block: bool = False
    rows: list[PartRow] = field(default_factory=list)
    place: tuple[int, int] = (1, 1)


@dataclass(slots=True, eq=False)
class PartRow:
    """A pair of a map, or an item of a list.

    Attributes:
        part: Its value; an alias refers to one at another place.
        key: Its key in a map.
        begin: Start of its key or dash in the text; in a list in brackets, of its value.
        head: End of those, with a colon, an anchor and a tag.
        at: Start of its value, or of the alias.
        stop: End of its value.
    """

    part: Part
    key: Any
    begin: int
    head: int
    at: int
    stop: int

    @property
    def is_lines(self) -> bool:
        """Whether its value is a map or list in lines."""
        return self.part.is_block and self.part.begin == self.at

    @property
    def space(self) -> str:
        """What is missing before a value where there was nothing."""
        return " " if self.begin < self.head == self.at else ""


@dataclass(frozen=True, slots=True)
class ReadText:
    """A text that was read.

    Attributes:
        text: Itself; its last line has an end.
        root: All of it.
        dash_column: Of the first list in lines, counted from the key that it stands under.
        key_column: Of the first map in lines under a key, in the same way.
        starts: Where its lines begin.
    """

    text: str
    root: Part
    dash_column: int
    key_column: int
    starts: list[int]

    def line_of(self, at: int) -> int:
        """Return the line that a place is in, from 0."""
        return bisect_right(self.starts, at) - 1

    def column_of(self, at: int) -> int:
        """Return the column of a place, from 0."""
        return at - self.starts[self.line_of(at)]

    def line_end(self, at: int) -> int:
        """Return where the line of a place ends, before its line end."""
        begin, stop = self.starts[self.line_of(at)], self.line_behind(at)
        return begin + len(self.text[begin:stop].rstrip("\r\n"))

    def line_behind(self, at: int) -> int:
        """Return the start of the line after that of a place."""
        line = self.line_of(at) + 1
        return self.starts[line] if line < len(self.starts) else len(self.text)


def read_text(text: str) -> ReadText:
    """Read a text.

    Args:
        text: The text.

    Raises:
        ValueError: It is not valid YAML, is more than one document, or has a key that is not a
            scalar or is duplicate.
    """
    try:
        return _Reader(text).result
    except yaml.YAMLError as exc:
        raise ValueError(str(exc)) from exc


class _Reader:
    """Builds parts from events of the parser; nothing recurses."""

    def __init__(self, text: str) -> None:
        lines = text.splitlines(keepends=True)
        if lines and not lines[-1].endswith("\n"):
            text += "\r\n" if lines[0].endswith("\r\n") else "\n"
        self._text = text
        self._starts = [0]
        for line in lines[:-1]:
            self._starts.append(self._starts[-1] + len(line))
        self._stack: list[Part] = []
        self._keys: list[Any] = []  # of maps in the stack that wait for a value, else `_NO_KEY`
        self._key_marks: list[tuple[int, int]] = []
        self._anchors: dict[str, Part] = {}
        self._root = Part(None, 0, 0)
        self._columns: dict[type, int] = {}
        parser: Any = _LOADER(text)
        try:
            self._read(iter(parser.get_event, None))
        finally:
            parser.dispose()
        self.result = ReadText(
            text,
            self._root,
            dash_column=self._columns.get(list, 2),
            key_column=self._columns.get(EditedMap, 2),
            starts=self._starts,
        )

    def _read(self, events: Iterator[Any]) -> None:
        documents = 0
        for event in events:
            kind = type(event)
            if kind is yaml.ScalarEvent:
                plain = not event.style and not event.tag
                value = plain_value(event.value) if plain else event.value
                part = self._scalar(event, value)
                self._take(event, part, part.begin, part.stop)
            elif kind is yaml.MappingStartEvent:
                self._open(event, EditedMap())
            elif kind is yaml.SequenceStartEvent:
                self._open(event, [])
            elif kind is yaml.MappingEndEvent or kind is yaml.SequenceEndEvent:
                self._close(event)
            elif kind is yaml.AliasEvent:
                found = self._anchors.get(event.anchor)
                if found is None or found in self._stack:
                    raise ValueError(f"alias *{event.anchor} has no whole value before it")
                begin, stop = self._offset(event.start_mark), self._offset(event.end_mark)
                self._take(event, found, begin, stop)
            elif kind is yaml.DocumentStartEvent:
                documents += 1
                if documents > 1:
                    raise ValueError("there is more than one document")

    def _offset(self, mark: Any) -> int:
        at = self._starts[mark.line] if mark.line < len(self._starts) else len(self._text)
        return int(at + mark.column)

    def _scalar(self, event: Any, value: Any) -> Part:
        begin, stop = self._offset(event.start_mark), self._offset(event.end_mark)
        if event.style in ("|", ">"):
            # It ends at the start of the next line: blank lines count where "+" keeps them.
            lines = self._text[begin:stop]
            is_kept = "+" in lines.partition("\n")[0].partition("#")[0]
            lines = lines.removesuffix("\n").removesuffix("\r") if is_kept else lines.rstrip()
            stop = begin + len(lines)
        if event.anchor is not None or event.tag is not None:
            found = _ANCHOR_OR_TAG.match(self._text, begin, stop)
            begin = found.end() if found else begin
        return self._made(event, value, begin, stop)

    def _made(self, event: Any, value: Any, begin: int, stop: int) -> Part:
        mark = event.start_mark
        part = Part(value, begin, stop, place=(mark.line + 1, mark.column + 1))
        if event.anchor is not None:
            self._anchors[event.anchor] = part
        return part

    def _open(self, event: Any, value: Any) -> None:
        begin, stop = self._offset(event.start_mark), self._offset(event.end_mark)
        if event.anchor is not None or event.tag is not None:
            # It ends after a bracket or a dash below its key, else before a dash or key.
            is_behind = event.flow_style or (value == [] and self._text[stop : stop + 1] != "-")
            begin = stop - bool(is_behind)
        part = self._made(event, value, begin, stop)
        part.is_block = not event.flow_style
        line = bisect_right(self._starts, begin) - 1
        part.column = begin - self._starts[line]
        if isinstance(value, EditedMap):
            value.place = part.place
        if part.is_block and self._stack and self._keys[-1] is not _NO_KEY:
            self._columns.setdefault(type(value), part.column - self._stack[-1].column)
        self._take(event, part, begin, stop)
        if len(self._stack) >= _MOST_DEPTH:
            raise ValueError(f"it is nested deeper than {_MOST_DEPTH} levels")
        self._stack.append(part)
        self._keys.append(_NO_KEY)
        self._key_marks.append((0, 0))

    def _close(self, event: Any) -> None:
        done = self._stack.pop()
        self._keys.pop()
        self._key_marks.pop()
        done.stop = done.rows[-1].stop if done.is_block else self._offset(event.end_mark)
        if self._stack:
            self._stack[-1].rows[-1].stop = done.stop

    def _take(self, event: Any, part: Part, at: int, stop: int) -> None:
        if not self._stack:
            self._root = part
            return
        top = self._stack[-1]
        if not isinstance(top.value, dict):
            top.value.append(part.value)
            begin = self._dash(top, event) if top.is_block else at
            top.rows.append(PartRow(part, None, begin, self._head(begin, at), at, stop))
        elif self._keys[-1] is _NO_KEY:
            line = event.start_mark.line + 1
            if not isinstance(part.value, str | int | float | None):
                raise ValueError(f"line {line}: a key must be a word")
            if part.value in top.value:
                raise ValueError(f"line {line}: the key {part.value!r} is given twice")
            self._keys[-1] = part.value
            self._key_marks[-1] = self._offset(event.start_mark), stop
        else:
            top.value[self._keys[-1]] = part.value
            begin, key_stop = self._key_marks[-1]
            row = PartRow(part, self._keys[-1], begin, self._head(key_stop, at), at, stop)
            top.rows.append(row)
            self._keys[-1] = _NO_KEY

    def _head(self, begin: int, at: int) -> int:
        found = _HEAD.match(self._text, begin, at)
        return found.end() if found else begin

    def _dash(self, top: Part, event: Any) -> int:
        """Return the position of the dash of an item, on its line or a line above it."""
        line: int = event.start_mark.line
        while line:
            at = self._starts[line] + top.column
            if self._text.startswith("-", at) and not self._is_comment(line):
                break
            line -= 1
        return self._starts[line] + top.column

    def _is_comment(self, line: int) -> bool:
        stop = self._starts[line + 1] if line + 1 < len(self._starts) else len(self._text)
        return self._text[self._starts[line] : stop].lstrip().startswith("#")


def plain_value(text: str) -> Any:
    """Return the value of a plain scalar by the core schema of YAML 1.2 (section 10.3.2)."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text) if text.lstrip("-+").isdigit() else int(text, 0)
    return float(text) if _FLOAT.fullmatch(text) else text


def is_same(part: Part, value: Any, known: dict[tuple[int, int], bool] | None = None) -> bool:
    """Whether a value equals a part, with its keys in the same order.

    Args:
        part: As it was read.
        value: Value to compare.
        known: Pairs already compared: aliases may refer to the same value very often.
    """
    if not isinstance(part.value, dict | list):
        return _is_same_scalar(part.value, value)
    if not isinstance(value, dict if isinstance(part.value, dict) else list | tuple):
        return False
    known = {} if known is None else known
    pair = (id(part), id(value))
    if pair not in known:
        known[pair] = True  # until it is shown to differ: a value may hold itself
        each = list(value.values()) if isinstance(value, dict) else value
        known[pair] = len(each) == len(part.rows) and (
            (not isinstance(value, dict) or list(value) == [row.key for row in part.rows])
            and all(is_same(row.part, v, known) for row, v in zip(part.rows, each, strict=True))
        )
    return known[pair]


def _is_same_scalar(old: Any, new: Any) -> bool:
    if isinstance(new, date):
        return bool(old == str(new))
    kinds = (bool, float, str, dict, list)
    if any(isinstance(old, kind) != isinstance(new, kind) for kind in kinds):
        return False
    return bool(old == new) or (old != old and new != new)  # not a number


def adopt(part: Part, value: Any, known: set[int] | None = None) -> None:
    """Take maps and lists that say the same for those of a part and of all in it."""
    known = set() if known is None else known
    if not isinstance(value, dict | list) or id(part) in known:
        return
    known.add(id(part))
    if isinstance(value, EditedMap):
        value.place = part.place
    part.value = value
    each = value.values() if isinstance(value, dict) else value
    for row, other in zip(part.rows, each, strict=True):
        adopt(row.part, other, known)
