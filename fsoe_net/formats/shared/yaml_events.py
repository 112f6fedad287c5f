"""The events of libyaml, with limits; a syntax error becomes a finding.

Nesting and alias expansion are bounded by a stack, so there is no recursion.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from itertools import islice
from typing import Any, NoReturn

import yaml

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Related, Span
from fsoe_net.formats.shared.files import Collector

MAX_DEPTH = 64
DEEPER = f"nested deeper than {MAX_DEPTH} levels"
FLATTER = "no file of this kind needs more than a dozen levels"
# A key below a key that already has a value, with and without a comment after the value.
_TOO_DEEP_KEY = ("did not find expected key", "mapping values are not allowed in this context")
# Message of newer builds of libyaml for more than 1000 nested flow lists.
_TOO_DEEP = "exceeded maximum nesting depth"
MAX_PARTS = 4_000_000  # about 150 bytes each; 65 535 SubDevices with all facts have 2 500 000
MAX_ALIASED = 1_000_000

COLUMN_BITS = 26  # a line is no longer than the file
_COLUMN_MASK = (1 << COLUMN_BITS) - 1
_LOADER = getattr(yaml, "CLoader", yaml.Loader)


def span_of(file: str, place: int) -> Span:
    """Return a place that was packed into one number."""
    # In a quarter of the time of a call with three arguments, for hundreds of thousands.
    return tuple.__new__(Span, (file, (place >> COLUMN_BITS) + 1, (place & _COLUMN_MASK) + 1))


@dataclass(slots=True, eq=False)
class MarkedNode:
    """A part of a file."""

    file: str
    place: int

    @property
    def span(self) -> Span:
        """The place where it starts."""
        return span_of(self.file, self.place)


class RefusedYaml(Exception):
    """The document was rejected as a whole; the finding has been added."""


class OpenNode:
    """A collection that is still being read, with the number of parts before it."""

    __slots__ = ("anchor", "before", "continued", "key", "key_place", "key_plain", "node", "pairs")

    def __init__(self, node: Any, anchor: str | None, before: int):
        self.node = node
        self.pairs = getattr(node, "pairs", None)
        self.anchor = anchor
        self.before = before
        self.key: Any = None
        self.key_place: Any = 0
        self.key_plain = True
        self.continued = False  # whether the keys of its first item are repeated without a dash


class EventReader(ABC):
    """Reads the events of libyaml; a subclass creates the nodes.

    Direct content is limited by the bytes of the file; content repeated by aliases is counted
    separately, as if written in full, because a few lines can expand to billions of values.
    """

    def __init__(self, file: str, out: Collector) -> None:
        self._file = file
        self._out = out
        self._stack: list[OpenNode] = []
        self._top: OpenNode | None = None
        self._anchors: dict[str, tuple[Any, int]] = {}  # with the number of its parts
        self._aliased = 0
        self._root: Any = None
        self._documents = 0

    @abstractmethod
    def _scalar(self, event: Any) -> None:
        """Process a scalar."""

    @abstractmethod
    def _node(self, event: Any, *, is_map: bool) -> Any:
        """Return a new map or list."""

    @abstractmethod
    def _attach(self, node: Any, event: Any) -> None:
        """Add a node to the open one; ``event`` ends it, or is the alias."""

    def build(self, text: str) -> Any:
        """Return the root, or ``None`` if there is none."""
        parser: Any = _LOADER(text)
        events: Iterator[Any] = iter(parser.get_event, None)
        scalar = self._scalar
        try:
            for count, event in enumerate(islice(events, MAX_PARTS)):
                kind = type(event)
                if kind is yaml.ScalarEvent:
                    scalar(event)
                elif kind is yaml.MappingStartEvent or kind is yaml.SequenceStartEvent:
                    self._open(event, count, is_map=kind is yaml.MappingStartEvent)
                elif kind is yaml.MappingEndEvent or kind is yaml.SequenceEndEvent:
                    self._close(event, count)
                elif kind is yaml.AliasEvent:
                    self._alias(event)
                elif kind is yaml.DocumentStartEvent:
                    self._document(event)
            rest = next(events, None)
        finally:
            parser.dispose()
        if rest is not None:
            self._refuse(
                "FSN103",
                span_of(self._file, self._place_of(rest)),
                f"more than {MAX_PARTS} keys, values and ends of lists and maps",
                "the largest bus has 2.5 million, with 65535 SubDevices and all their transfers",
            )
        return self._root

    def _place_of(self, event: Any) -> int:
        """Return line and column, both from 0, packed into one number: millions are stored."""
        mark = event.start_mark
        place: int = mark.line << COLUMN_BITS | mark.column
        return place

    def _refuse(self, code: str, span: Span, message: str, hint: str) -> NoReturn:
        self._out.add(code, span, message, hint=hint)
        raise RefusedYaml

    def _document(self, event: Any) -> None:
        self._documents += 1
        if self._documents > 1:
            self._refuse(
                "FSN105",
                span_of(self._file, self._place_of(event)),
                "a second document starts here; the driver reads only the first",
                "merge the documents and delete the `---` line",
            )

    def _open(self, event: Any, count: int, *, is_map: bool) -> None:
        if len(self._stack) >= MAX_DEPTH:
            self._refuse("FSN103", span_of(self._file, self._place_of(event)), DEEPER, FLATTER)
        node = self._node(event, is_map=is_map)
        self._top = OpenNode(node, event.anchor, count + self._aliased)
        self._stack.append(self._top)

    def _close(self, event: Any, count: int) -> None:
        done = self._stack.pop()
        self._top = self._stack[-1] if self._stack else None
        if done.anchor is not None:
            # Its expanded size, which each alias of it adds again.
            self._anchors[done.anchor] = (done.node, count + self._aliased - done.before)
        self._attach(done.node, event)

    def _alias(self, event: Any) -> None:
        place = self._place_of(event)
        node, parts = self._anchors.get(event.anchor, (None, 0))
        if node is None:
            inside = any(o.anchor == event.anchor for o in self._stack)
            why = "refers to the node that contains it" if inside else "has no anchor before it"
            self._refuse(
                "FSN103" if inside else "FSN102",
                span_of(self._file, place),
                f"alias *{event.anchor} {why}",
                "write the value out",
            )
        self._aliased += parts
        if self._aliased > MAX_ALIASED:
            self._refuse(
                "FSN103",
                node.span,
                f"the document holds more than {MAX_ALIASED} values that only aliases repeat",
                "no file of this kind needs that many; aliases multiply what they refer to",
            )
        self._attach(node, event)


def add_syntax_error(exc: yaml.YAMLError, file: str, text: str, out: Collector) -> None:
    """Add FSN102 or FSN103 for an error of the parser, at its place and with the next step."""
    mark = getattr(exc, "problem_mark", None) or getattr(exc, "context_mark", None)
    span = Span(file, mark.line + 1, mark.column + 1) if mark else Span(file, 1, 1)
    problem = getattr(exc, "problem", None) or str(exc).splitlines()[0]
    if problem == _TOO_DEEP:
        out.add("FSN103", span, DEEPER, hint=FLATTER)
        return
    context = getattr(exc, "context", None)
    start = getattr(exc, "context_mark", None)
    related: tuple[Related, ...] = ()
    if context and start is not None and mark is not None and start.line != mark.line:
        related = (Related(span=Span(file, start.line + 1, start.column + 1), message=context),)
    hint = _syntax_hint(problem, text.splitlines()[: span.line])
    if problem == "could not find expected ':'" and start is not None:
        hint = f"line {start.line + 1} has no colon after a key; an item of a list begins with `- `"
    out.add("FSN102", span, f"not valid YAML: {problem}", hint=hint, related=related)


def _syntax_hint(problem: str, lines: list[str]) -> str:
    """Return the fix for a syntax error in the last of these lines."""
    line = lines[-1] if lines else ""
    if "\t" in line[: _indent(line)]:
        return "replace the tab by spaces; YAML forbids tabs in indentation"
    if problem == "did not find expected '-' indicator":
        return "start the item with `- `, or indent it like the other keys of the item above"
    for number in range(len(lines), max(len(lines) - 4, 0), -1):
        if glued := re.match(r"\s*-([A-Za-z_]\w*):", lines[number - 1]):
            return f"write `- {glued[1]}:` in line {number}: a dash needs a blank"
    above = next((row for row in reversed(lines[:-1]) if row.strip()), "")
    if problem == "did not find expected key" and line.lstrip().startswith("- "):
        return "start the item above with `- ` too, and indent both alike"
    is_deeper = _indent(line) > _indent(above) and not above.rstrip().endswith(":")
    if problem in _TOO_DEEP_KEY and is_deeper:
        return "start the item in the line above with `- `, or indent this line like it"
    return "check indentation and brackets above this place"


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())
