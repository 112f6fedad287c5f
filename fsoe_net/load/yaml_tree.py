"""YAML into a tree whose every node knows its file, line and column.

Built from libyaml's events with an own stack, so that nesting and alias expansion are bounded and
nothing recurses. What the driver's parser (yaml-cpp) would read differently or silently drop
(duplicate keys, merge keys, further documents) is a finding here.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import yaml

from fsoe_net.diag import Related, Severity, Span
from fsoe_net.load.files import Collector, read_bytes

__all__ = ["MapNode", "Node", "ScalarNode", "SeqNode", "load_yaml", "parse_yaml"]

MAX_DEPTH = 64
MAX_NODES = 1_000_000

_LOADER = getattr(yaml, "CLoader", yaml.Loader)


@dataclass(slots=True, eq=False)
class ScalarNode:
    """A scalar as written. ``plain`` is false for quoted and block scalars."""

    span: Span
    text: str
    plain: bool
    weight: int = 1

    @property
    def is_null(self) -> bool:
        """Whether YAML reads this as nothing (empty, ``~``, ``null``)."""
        return self.plain and self.text in ("", "~", "null", "Null", "NULL")


@dataclass(slots=True, eq=False)
class SeqNode:
    """A list."""

    span: Span
    items: list[Node]
    weight: int = 1


@dataclass(slots=True, eq=False)
class MapNode:
    """A map. Keys are scalars; of a key given twice the first counts, as in yaml-cpp."""

    span: Span
    pairs: dict[str, Node]
    keys: dict[str, Span]
    weight: int = 1

    def get(self, key: str) -> Node | None:
        """Return a value, or ``None``."""
        return self.pairs.get(key)

    def at(self, key: str) -> Span:
        """Return the place of a key's value, else of the map."""
        node = self.pairs.get(key)
        return node.span if node is not None else self.span

    def places(self) -> dict[str, Span]:
        """Return the place of every value, for `fsoe_net.model.Located.fields`."""
        return {key: value.span for key, value in self.pairs.items()}

    def maps(self, key: str) -> list[MapNode]:
        """Return the maps in the list under a key; nothing when it is no list."""
        node = self.pairs.get(key)
        if not isinstance(node, SeqNode):
            return []
        return [item for item in node.items if isinstance(item, MapNode)]

    def text(self, key: str) -> str | None:
        """Return the text of the scalar under a key, or ``None`` when there is none."""
        node = self.pairs.get(key)
        return node.text if isinstance(node, ScalarNode) and not node.is_null else None

    def truth(self, key: str) -> bool:
        """Return whether the scalar under a key says yes."""
        return (self.text(key) or "").lower() in ("true", "yes", "on", "y")


Node = ScalarNode | SeqNode | MapNode


class _Refused(Exception):
    """The document was refused as a whole; the finding is already recorded."""


def load_yaml(
    path: str | os.PathLike[str], out: Collector, *, named_at: Span | None = None
) -> MapNode | None:
    """Read a YAML file whose root is a map. ``None`` when refused; the reason is in ``out``."""
    data = read_bytes(path, out, named_at=named_at)
    return None if data is None else parse_yaml(data, os.fspath(path), out)


def parse_yaml(data: bytes, file: str, out: Collector) -> MapNode | None:
    """Parse one YAML document whose root is a map.

    Args:
        data: Bytes of the file, UTF-8 with or without byte order mark.
        file: Name shown in findings.
        out: Takes FSN102 … FSN108.
    """
    text = _decode(data, file, out)
    if text is None:
        return None
    try:
        root = _Builder(file, out).build(text)
    except yaml.YAMLError as exc:
        _syntax_error(exc, file, text, out)
        return None
    except _Refused:
        return None
    if root is None or (isinstance(root, ScalarNode) and root.is_null):
        out.add("FSN104", Span(file, 1, 1), "the document is empty", hint="nothing would be done")
        return None
    if not isinstance(root, MapNode):
        what = "a list" if isinstance(root, SeqNode) else "a single value"
        out.add(
            "FSN104",
            root.span,
            f"the document is {what}, not a map: the driver would find no key in it",
            hint="start the file with a key such as `nets:`, without `- ` in front",
        )
        return None
    return root


def _decode(data: bytes, file: str, out: Collector) -> str | None:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        out.add("FSN102", Span(file, 1, 1), "the file is UTF-16", hint="save it as UTF-8")
        return None
    if data.startswith(b"\xef\xbb\xbf"):
        out.add(
            "FSN108",
            Span(file, 1, 1),
            "the file starts with a byte order mark",
            severity=Severity.INFO,
            hint="save it as UTF-8 without BOM; other readers may take it for a part of the key",
        )
        data = data[3:]
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as exc:
        good = data[: exc.start].decode("utf-8", "replace")
        out.add(
            "FSN102",
            _place(file, good, len(good)),
            f"byte 0x{data[exc.start]:02x} is not UTF-8",
            hint="save the file as UTF-8",
        )
        return None
    bad = re.search(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\ufffe\uffff]", text)
    if bad:
        out.add(
            "FSN102",
            _place(file, text, bad.start()),
            f"control character U+{ord(bad.group()):04X}",
            hint="delete it; the file may be binary or damaged",
        )
        return None
    return text


def _place(file: str, text: str, offset: int) -> Span:
    line_start = text.rfind("\n", 0, offset) + 1
    return Span(file, text.count("\n", 0, offset) + 1, offset - line_start + 1)


def _syntax_error(exc: yaml.YAMLError, file: str, text: str, out: Collector) -> None:
    mark = getattr(exc, "problem_mark", None) or getattr(exc, "context_mark", None)
    span = Span(file, mark.line + 1, mark.column + 1) if mark else Span(file, 1, 1)
    problem = getattr(exc, "problem", None) or str(exc).splitlines()[0]
    context = getattr(exc, "context", None)
    start = getattr(exc, "context_mark", None)
    related: tuple[Related, ...] = ()
    if context and start is not None and mark is not None and start.line != mark.line:
        related = (Related(span=Span(file, start.line + 1, start.column + 1), message=context),)
    lines = text.splitlines()
    line = lines[mark.line] if mark and mark.line < len(lines) else ""
    hint = "check indentation and brackets above this place"
    if "\t" in line[: len(line) - len(line.lstrip())]:
        hint = "replace the tab by spaces; YAML forbids tabs in indentation"
    out.add("FSN102", span, f"not valid YAML: {problem}", hint=hint, related=related)


@dataclass(slots=True)
class _Open:
    """A collection that is still being read."""

    node: SeqNode | MapNode
    anchor: str | None
    key: ScalarNode | None = None


class _Builder:
    """Turns libyaml events into nodes."""

    def __init__(self, file: str, out: Collector) -> None:
        self._file = file
        self._out = out
        self._stack: list[_Open] = []
        self._anchors: dict[str, Node] = {}
        self._total = 0
        self._root: Node | None = None
        self._documents = 0

    def build(self, text: str) -> Node | None:
        events: Iterator[Any] = yaml.parse(text, Loader=_LOADER)
        for event in events:
            if isinstance(event, yaml.ScalarEvent):
                node = ScalarNode(self._span(event), event.value, not event.style)
                self._remember(event.anchor, node)
                self._attach(node)
            elif isinstance(event, (yaml.SequenceStartEvent, yaml.MappingStartEvent)):
                self._open(event)
            elif isinstance(event, (yaml.SequenceEndEvent, yaml.MappingEndEvent)):
                self._close()
            elif isinstance(event, yaml.AliasEvent):
                self._alias(event)
            elif isinstance(event, yaml.DocumentStartEvent):
                self._document(event)
        return self._root

    def _span(self, event: Any) -> Span:
        mark = event.start_mark
        return Span(self._file, mark.line + 1, mark.column + 1)

    def _refuse(self, code: str, span: Span, message: str, hint: str) -> None:
        self._out.add(code, span, message, hint=hint)
        raise _Refused

    def _document(self, event: Any) -> None:
        self._documents += 1
        if self._documents > 1:
            self._refuse(
                "FSN105",
                self._span(event),
                "a second document starts here; the driver reads only the first",
                "merge the documents and delete the `---` line",
            )

    def _open(self, event: Any) -> None:
        if len(self._stack) >= MAX_DEPTH:
            self._refuse(
                "FSN103",
                self._span(event),
                f"nested deeper than {MAX_DEPTH} levels",
                "no file of this kind needs more than a dozen levels",
            )
        node: SeqNode | MapNode
        if isinstance(event, yaml.SequenceStartEvent):
            node = SeqNode(self._span(event), [])
        else:
            node = MapNode(self._span(event), {}, {})
        self._stack.append(_Open(node, event.anchor))

    def _close(self) -> None:
        done = self._stack.pop()
        self._remember(done.anchor, done.node)
        self._attach(done.node)

    def _remember(self, anchor: str | None, node: Node) -> None:
        if anchor is not None:
            self._anchors[anchor] = node

    def _alias(self, event: Any) -> None:
        node = self._anchors.get(event.anchor)
        if node is None:
            inside = any(o.anchor == event.anchor for o in self._stack)
            why = "refers to the node it stands in" if inside else "has no anchor before it"
            self._refuse(
                "FSN103" if inside else "FSN102",
                self._span(event),
                f"alias *{event.anchor} {why}",
                "write the value out",
            )
            return
        self._attach(node, node.weight)

    def _attach(self, node: Node, count: int = 1) -> None:
        self._total += count
        if self._total > MAX_NODES:
            self._refuse(
                "FSN103",
                node.span,
                f"the document holds more than {MAX_NODES} values",
                "no file of this kind needs that many; aliases multiply what they refer to",
            )
        if not self._stack:
            self._root = node
            return
        top = self._stack[-1]
        if isinstance(top.node, SeqNode):
            top.node.items.append(node)
        elif top.key is None:
            self._key(top, node)
            return
        else:
            self._pair(top.node, top.key, node)
            top.key = None
        top.node.weight += node.weight

    def _key(self, top: _Open, node: Node) -> None:
        if not isinstance(node, ScalarNode):
            self._refuse("FSN111", node.span, "a key must be a word", "quote it or check brackets")
            return
        top.key = node

    def _pair(self, into: MapNode, key: ScalarNode, node: Node) -> None:
        text = key.text
        if text == "<<" and key.plain:
            self._out.add(
                "FSN107",
                key.span,
                "merge key `<<`: the driver's YAML parser does not merge, keys would be missing",
                hint="write the keys out here",
            )
            return
        strange = re.search(r"[^\x20-\x7e]", text)
        if strange:
            text = re.sub(r"[^\x21-\x7e]", "", text)
            self._out.add(
                "FSN108",
                key.span,
                f"key {key.text!r} holds the character U+{ord(strange.group()):04X}",
                hint=f"type the key anew: {text}",
            )
        if text in into.pairs:
            self._out.add(
                "FSN106",
                key.span,
                f"key {text!r} is given twice; the driver takes the first",
                hint="delete one of them",
                related=(Related(span=into.keys[text], message="first given here"),),
            )
            return
        into.pairs[text] = node
        into.keys[text] = key.span
