"""The maps and lists of a text of YAML, as parts that know in which lines they stand."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import date
from typing import Any

import yaml

__all__ = ["EditedMap", "Part", "ReadText", "adopt", "is_same", "read_text"]

_NO_KEY = object()
_LOADER = getattr(yaml, "CLoader", yaml.Loader)
_MOST_DEPTH = 64
_DASH = re.compile(r" *-(?: +|$)")
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
        value: Itself: a map, a list, or a scalar.
        line: Where it begins, from 0.
        column: The same.
        last: The last line that is said in, from 0; comments may follow.
        is_block: Whether its parts stand on lines of their own.
        is_level: Whether the dashes of a list stand in the column of its key.
        keys: Of a map, one for each of its parts.
        parts: What is in it.
        lines: Where each of those begins, its key or dash included; from 0.
        has_own_line: Whether nothing stands before it in that line.
    """

    value: Any
    line: int
    column: int
    last: int = 0
    is_block: bool = False
    is_level: bool = False
    keys: list[Any] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    has_own_line: list[bool] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class ReadText:
    """A text that was read.

    Attributes:
        root: All of it.
        lines: Its lines, with their ends; the last one has one, too.
        is_linked: Whether it has anchors, aliases or tags, which no part can be read without.
        dash_column: Of the first list in lines, counted from the key that it stands under.
        key_column: Of the first map in lines under a key, in the same way.
    """

    root: Part
    lines: list[str]
    is_linked: bool
    dash_column: int
    key_column: int


def read_text(text: str) -> ReadText:
    """Read a text.

    Args:
        text: The text.

    Raises:
        ValueError: It is no YAML, is more than one document, or has a key that is no scalar, or
            twice.
    """
    try:
        return _Reader(text).result
    except yaml.YAMLError as exc:
        raise ValueError(str(exc)) from exc


class _Reader:
    """Builds parts from events of the parser; nothing recurses."""

    def __init__(self, text: str) -> None:
        self._lines = text.splitlines(keepends=True)
        if self._lines and not self._lines[-1].endswith("\n"):
            self._lines[-1] += "\r\n" if self._lines[0].endswith("\r\n") else "\n"
        self._stack: list[Part] = []
        self._keys: list[Any] = []  # of maps in the stack that wait for a value, else `_NO_KEY`
        self._anchors: dict[str, Part] = {}
        self._root: Part | None = None
        self._is_linked = False
        self._columns: dict[type, int] = {}
        parser: Any = _LOADER(text)
        try:
            self._read(iter(parser.get_event, None))
        finally:
            parser.dispose()
        self.result = ReadText(
            self._root or Part(None, 0, 0),
            self._lines,
            self._is_linked,
            dash_column=self._columns.get(list, 2),
            key_column=self._columns.get(EditedMap, 2),
        )

    def _read(self, events: Iterator[Any]) -> None:
        documents = 0
        for event in events:
            kind = type(event)
            if kind is yaml.ScalarEvent:
                plain = not event.style and not event.tag
                value = _scalar(event.value) if plain else event.value
                self._take(event, self._made(event, value))
            elif kind is yaml.MappingStartEvent:
                self._open(event, EditedMap())
            elif kind is yaml.SequenceStartEvent:
                self._open(event, [])
            elif kind is yaml.MappingEndEvent or kind is yaml.SequenceEndEvent:
                self._close(event)
            elif kind is yaml.AliasEvent:
                self._is_linked = True
                part = self._anchors.get(event.anchor)
                if part is None or part in self._stack:
                    raise ValueError(f"alias *{event.anchor} has no whole value before it")
                self._take(event, part)
            elif kind is yaml.DocumentStartEvent:
                documents += 1
                if documents > 1:
                    raise ValueError("there is more than one document")

    def _made(self, event: Any, value: Any) -> Part:
        mark = event.start_mark
        # The end of a text in lines of its own is the begin of the line behind it.
        is_lines = getattr(event, "style", None) in ("|", ">")
        part = Part(value, mark.line, mark.column, last=event.end_mark.line - is_lines)
        if event.anchor is not None:
            self._anchors[event.anchor] = part
        self._is_linked = self._is_linked or event.anchor is not None or event.tag is not None
        return part

    def _open(self, event: Any, value: Any) -> None:
        part = self._made(event, value)
        part.is_block = not event.flow_style
        if isinstance(value, EditedMap):
            value.place = (part.line + 1, part.column + 1)
        if part.is_block and self._stack and self._keys[-1] is not _NO_KEY and not event.anchor:
            column = part.column - self._stack[-1].column
            self._columns.setdefault(type(value), column)
            part.is_level = column == 0
        self._take(event, part)
        if len(self._stack) >= _MOST_DEPTH:
            raise ValueError(f"it is nested deeper than {_MOST_DEPTH} levels")
        self._stack.append(part)
        self._keys.append(_NO_KEY)

    def _close(self, event: Any) -> None:
        done = self._stack.pop()
        self._keys.pop()
        if not done.is_block:
            done.last = event.end_mark.line
        if self._stack:
            self._stack[-1].last = max(self._stack[-1].last, done.last)

    def _take(self, event: Any, part: Part) -> None:
        if not self._stack:
            self._root = part
            return
        top, mark = self._stack[-1], event.start_mark
        top.last = max(top.last, part.last, mark.line)
        before = "" if mark.column == 0 else self._lines[mark.line][: mark.column]
        if not isinstance(top.value, dict):
            top.value.append(part.value)
            top.lines.append(mark.line)
            top.has_own_line.append(
                _DASH.fullmatch(before) is not None and before.index("-") == top.column
            )
        elif self._keys[-1] is _NO_KEY:
            if not isinstance(part.value, str | int | float | None):
                raise ValueError(f"line {mark.line + 1}: a key must be a word")
            if part.value in top.value:
                raise ValueError(f"line {mark.line + 1}: the key {part.value!r} is given twice")
            self._keys[-1] = part.value
            top.lines.append(mark.line)
            top.has_own_line.append(not before.strip())
            return
        else:
            top.value[self._keys[-1]] = part.value
            top.keys.append(self._keys[-1])
            self._keys[-1] = _NO_KEY
        top.parts.append(part)


def _scalar(text: str) -> Any:
    """Return the value of a plain scalar by the core schema of YAML 1.2 (section 10.3.2)."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text) if text.lstrip("-+").isdigit() else int(text, 0)
    return float(text) if _FLOAT.fullmatch(text) else text


def is_same(part: Part, value: Any, known: dict[tuple[int, int], bool] | None = None) -> bool:
    """Whether a value says what a part says, with its keys in the same order.

    Args:
        part: As it was read.
        value: Compared with it.
        known: What was compared before: aliases may lead to the same thing very often.
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
        known[pair] = len(each) == len(part.parts) and (
            (not isinstance(value, dict) or list(value) == part.keys)
            and all(is_same(p, v, known) for p, v in zip(part.parts, each, strict=True))
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
        value.place = (part.line + 1, part.column + 1)
    part.value = value
    each = value.values() if isinstance(value, dict) else value
    for own, other in zip(part.parts, each, strict=True):
        adopt(own, other, known)
