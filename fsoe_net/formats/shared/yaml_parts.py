"""The maps and lists of a YAML text, as parts with their places."""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import field
from datetime import date
from itertools import accumulate
from typing import Any, NoReturn

import yaml

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.yaml_events import EventReader, MarkedNode

_ANCHOR_OR_TAG = re.compile(r"(?:[&!]\S*\s+)*")
# After a key or a dash: the properties of any value that may follow.
_HEAD = re.compile(r"\s*[:-](?:[ \t]+[&!]\S*)*")
_COMMENT = re.compile(r"[ \t]*#")
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
    """A map of a text that is being edited.

    Attributes:
        place: Its line and column in the text, from 1, as in `fsoe_net.diag.diagnostic.Span`.
    """

    __slots__ = ("place",)
    place: tuple[int, int]


@dataclass(slots=True, eq=False)
class Part(MarkedNode):
    """A value of the text; its place is that of its anchor or tag, if any.

    Attributes:
        value: A map, a list, or a scalar.
        begin: Its start in the text, without an anchor and a tag.
        stop: Its end.
        column: Column of its keys or dashes, if `is_block`.
        is_block: Whether each row has its own line.
        rows: Its content.
    """

    value: Any
    begin: int
    stop: int
    column: int = 0
    is_block: bool = False
    rows: list[PartRow] = field(default_factory=list)


@dataclass(slots=True, eq=False)
class PartRow:
    """A pair of a map, or an item of a list.

    Attributes:
        part: Its value; for an alias, the value is at another place.
        key: Its key in a map.
        begin: Start of its key or dash in the text; in brackets, of its value.
        head: End of the key or dash, including a colon, an anchor and a tag.
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
        """Whether its value is a map or list on separate lines."""
        return self.part.is_block and self.part.begin == self.at

    @property
    def space(self) -> str:
        """The characters that are missing before a value if there was none."""
        return " " if self.begin < self.head == self.at else ""


class ReadText(EventReader):
    """The text that was read.

    Attributes:
        text: The text itself; its last line has a line end.
        root: The whole document.
        starts: Start of each line.
        under_key: Indentation below their key of the first `dict` and the first `list` on separate
            lines.

    Raises:
        ValueError: The text is not valid YAML, has more than one document, or has a key that is not
            a scalar or is duplicated.
    """

    def __init__(self, text: str) -> None:
        super().__init__("", Collector())
        lines = text.splitlines(keepends=True)
        if lines and not lines[-1].endswith("\n"):
            text += "\r\n" if lines[0].endswith("\r\n") else "\n"
        self.text = text
        self.starts = [0, *accumulate(len(line) for line in lines[:-1])]
        self._columns: dict[type, int] = {}
        try:
            self.root: Part = self.build(text) or Part("", 0, None, 0, 0)
        except yaml.YAMLError as exc:
            raise ValueError(str(exc)) from exc
        self.under_key = {dict: 2, list: 2} | self._columns

    def line_of(self, at: int) -> int:
        """Return the line of a position, from 0."""
        return bisect_right(self.starts, at) - 1

    def line_begin(self, at: int) -> int:
        """Return the start of the line that contains a position."""
        return self.starts[self.line_of(at)]

    def line_end(self, at: int) -> int:
        """Return the end of the line that contains a position, before the line break."""
        begin, stop = self.line_begin(at), self.line_behind(at)
        return begin + len(self.text[begin:stop].rstrip("\r\n"))

    def line_behind(self, at: int) -> int:
        """Return the start of the next line after a position."""
        line = self.line_of(at) + 1
        return self.starts[line] if line < len(self.starts) else len(self.text)

    def _refuse(self, code: str, span: Span, message: str, hint: str) -> NoReturn:
        raise ValueError(f"line {span.line}: {message}")

    def _scalar(self, event: Any) -> None:
        begin, stop = event.start_mark.index, event.end_mark.index
        if event.style in ("|", ">"):
            # It ends at the start of the next line: blank lines count if "+" keeps them.
            lines = self.text[begin:stop]
            is_kept = "+" in lines.partition("\n")[0].partition("#")[0]
            lines = lines.removesuffix("\n").removesuffix("\r") if is_kept else lines.rstrip()
            stop = begin + len(lines)
        if event.anchor is not None or event.tag is not None:
            found = _ANCHOR_OR_TAG.match(self.text, begin, stop)
            begin = found.end() if found else begin
        is_plain = not event.style and not event.tag
        value = plain_value(event.value) if is_plain else event.value
        part = Part("", self._place_of(event), value, begin, stop)
        if event.anchor is not None:
            self._anchors[event.anchor] = (part, 1)
        self._attach(part, event)

    def _node(self, event: Any, *, is_map: bool) -> Part:
        value: Any = EditedMap() if is_map else []
        begin, stop = event.start_mark.index, event.end_mark.index
        if event.anchor is not None or event.tag is not None:
            # It ends after a bracket or a dash below its key, otherwise before a dash or key.
            is_behind = event.flow_style or (not is_map and self.text[stop : stop + 1] != "-")
            begin = stop - bool(is_behind)
        column = begin - self.line_begin(begin)
        is_block = not event.flow_style
        part = Part("", self._place_of(event), value, begin, stop, column, is_block)
        if is_map:
            value.place = part.span.line, part.span.column
        top = self._top
        if is_block and top is not None and top.key_place:
            self._columns.setdefault(dict if is_map else list, column - top.node.column)
        return part

    def _attach(self, part: Part, event: Any) -> None:
        kind = type(event)
        if kind is yaml.MappingEndEvent or kind is yaml.SequenceEndEvent:
            # The event of a block comes after the blank lines and comments below it.
            part.stop = part.rows[-1].stop if part.is_block else event.end_mark.index
        at, stop, line = part.begin, part.stop, part.span.line - 1
        if kind is yaml.AliasEvent:
            at, stop, line = event.start_mark.index, event.end_mark.index, event.start_mark.line
        top = self._top
        if top is None:
            self._root = part
            return
        into = top.node
        if not isinstance(into.value, dict):
            into.value.append(part.value)
            begin = self._dash(into, line) if into.is_block else at
            into.rows.append(PartRow(part, None, begin, self._head(begin, at), at, stop))
        elif not top.key_place:
            if not isinstance(part.value, str | int | float | None):
                raise ValueError(f"line {line + 1}: a key must be a word")
            if part.value in into.value:
                raise ValueError(f"line {line + 1}: the key {part.value!r} is given twice")
            top.key, top.key_place = part.value, (event.start_mark.index, stop)
        else:
            into.value[top.key] = part.value
            begin, key_stop = top.key_place
            into.rows.append(PartRow(part, top.key, begin, self._head(key_stop, at), at, stop))
            top.key_place = None

    def _head(self, begin: int, at: int) -> int:
        found = _HEAD.match(self.text, begin, at)
        return found.end() if found else begin

    def _dash(self, top: Part, line: int) -> int:
        """Return the position of the dash of an item, on its line or a line above it."""
        # libyaml has no event for a dash, and comments may be between it and its value.
        while line:
            at = self.starts[line] + top.column
            if self.text.startswith("-", at) and not _COMMENT.match(self.text, self.starts[line]):
                break
            line -= 1
        return self.starts[line] + top.column


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
        part: Part as it was read.
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
        known[pair] = True  # until a difference is found: a value may contain itself
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
    return bool(old == new) or (old != old and new != new)  # NaN


def adopt(part: Part, value: Any, known: set[int] | None = None) -> None:
    """Use equal maps and lists of a value in place of those of a part and all its descendants."""
    known = set() if known is None else known
    if not isinstance(value, dict | list) or id(part) in known:
        return
    known.add(id(part))
    if isinstance(value, EditedMap):
        value.place = part.value.place
    part.value = value
    each = value.values() if isinstance(value, dict) else value
    for row, other in zip(part.rows, each, strict=True):
        adopt(row.part, other, known)
