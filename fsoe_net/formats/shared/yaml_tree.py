"""Parses YAML into a tree whose nodes have file, line and column.

Built from libyaml's events with its own stack, so that nesting and alias expansion are bounded
without recursion. Differences to the driver's parser (yaml-cpp), or content that it silently drops
(duplicate keys, merge keys, further documents), are findings here.
"""

from __future__ import annotations

import os
import re
from array import array
from collections.abc import Iterator, Mapping
from functools import lru_cache
from itertools import islice
from typing import Any

import yaml

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Related, Severity, Span
from fsoe_net.diag.printable import first_control
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.yaml_events import (
    COLUMN_BITS,
    EventReader,
    MarkedNode,
    OpenNode,
    RefusedYaml,
    add_syntax_error,
    span_of,
)

_NULLS = frozenset(("", "~", "null", "Null", "NULL"))


@dataclass(slots=True, eq=False)
class ScalarNode(MarkedNode):
    """A scalar as written. ``plain`` is false for quoted and block scalars."""

    text: str
    plain: bool

    @property
    def is_null(self) -> bool:
        """Whether YAML reads this as null (empty, ``~``, ``null``)."""
        return self.text in _NULLS and self.plain


@dataclass(slots=True, eq=False)
class SeqNode(MarkedNode):
    """A list."""

    items: list[Node]


@dataclass(slots=True, eq=False)
class MapNode(MarkedNode):
    """A map. Keys are scalars; of a repeated key the first one counts, as in yaml-cpp."""

    pairs: dict[str, Node]
    # In the order of ``pairs``; as numbers in place, because each of millions would be an object.
    key_places: array[int]
    _spans: dict[str, Span] | None = None  # of the keys, created on the first request

    @property
    def keys(self) -> dict[str, Span]:
        """The place of every key, including keys added since the last call."""
        known = self._spans = {} if self._spans is None else self._spans
        count = len(self.pairs) - len(known)
        if count:
            newest = zip(reversed(self.pairs), reversed(self.key_places), strict=True)
            for key, place in reversed(list(islice(newest, count))):
                known[key] = span_of(self.file, place)
        return known

    def texts(self, key: str) -> tuple[str, ...] | None:
        """Return the scalars of a list, ``None`` if it is not a list."""
        found = self.pairs.get(key)
        if not isinstance(found, SeqNode):
            return None
        return tuple(item.text for item in found.items if isinstance(item, ScalarNode))

    def get(self, key: str) -> Node | None:
        """Return a value, or ``None``."""
        return self.pairs.get(key)

    def at(self, key: str) -> Span:
        """Return the place of a key's value, or of the map."""
        node = self.pairs.get(key)
        return node.span if node is not None else self.span

    def places(self) -> Places:
        """Return the place of every value, for `fsoe_net.model.Located.fields`."""
        return Places(self.file, self.pairs)

    def maps(self, key: str) -> list[MapNode]:
        """Return the maps in the list under a key; empty if it is not a list."""
        node = self.pairs.get(key)
        if not isinstance(node, SeqNode):
            return []
        return [item for item in node.items if isinstance(item, MapNode)]

    def text(self, key: str) -> str | None:
        """Return the text of the scalar under a key, or ``None`` if there is none."""
        node = self.pairs.get(key)
        return node.text if isinstance(node, ScalarNode) and not node.is_null else None

    def truth(self, key: str) -> bool:
        """Return whether the scalar under a key is true."""
        return (self.text(key) or "").lower() in ("true", "yes", "on", "y")


Node = ScalarNode | SeqNode | MapNode


class Places(Mapping[str, Span]):
    """The place of each value of a map, created on request: most are never needed.

    It refers to no node, so that the tree is freed when its values have been read.
    """

    __slots__ = ("_file", "_keys", "_places")

    def __init__(self, file: str, pairs: Mapping[str, Node]) -> None:
        self._file = file
        self._keys = _shared_keys(tuple(pairs))
        self._places = array("Q", [node.place for node in pairs.values()])

    def __getitem__(self, key: str) -> Span:
        try:
            return span_of(self._file, self._places[self._keys.index(key)])
        except ValueError:
            raise KeyError(key) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._keys)

    def __len__(self) -> int:
        return len(self._keys)

    def __or__(self, other: Mapping[str, Span]) -> dict[str, Span]:
        return {**self, **other}


@lru_cache(maxsize=1024)
def _shared_keys(keys: tuple[str, ...]) -> tuple[str, ...]:
    """Return one object for equal keys: thousands of maps have the same ones."""
    return keys


def load_yaml(
    path: str | os.PathLike[str], out: Collector, *, named_at: Span | None = None
) -> MapNode | None:
    """Read a YAML file whose root is a map; if it is rejected, ``out`` contains the reason."""
    data = read_bytes(path, out, named_at=named_at)
    return None if data is None else parse_yaml(data, os.fspath(path), out)


def parse_yaml(
    data: bytes, file: str, out: Collector, *, of_devices: bool = False
) -> MapNode | None:
    """Parse one YAML document whose root is a map.

    Args:
        data: Bytes of the file, UTF-8 with or without byte order mark.
        file: Name shown in findings.
        out: Takes FSN102 … FSN108.
        of_devices: Its names come unchanged from devices: the caller makes them printable.
    """
    text = _decode(data, file, out)
    if text is None:
        return None
    try:
        root = _Builder(file, out, of_devices=of_devices).build(text)
    except yaml.YAMLError as exc:
        add_syntax_error(exc, file, text, out)
        return None
    except RefusedYaml:
        return None
    if root is None or (isinstance(root, ScalarNode) and root.is_null):
        out.add(
            "FSN104",
            Span(file, 1, 1),
            "the document is empty",
            hint="check the path, or fill in the file",
        )
        return None
    if not isinstance(root, MapNode):
        what = "a list" if isinstance(root, SeqNode) else "a single value"
        out.add(
            "FSN104",
            root.span,
            f"the document is {what}, not a map of keys and values",
            hint="begin with a key and a colon, without `- ` in front; is it the right file?",
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
            _place_in(file, good, len(good)),
            f"byte 0x{data[exc.start]:02x} is not UTF-8",
            hint="save the file as UTF-8",
        )
        return None
    bad = re.search(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\ufffe\uffff]", text)
    if bad:
        out.add(
            "FSN102",
            _place_in(file, text, bad.start()),
            f"control character U+{ord(bad.group()):04X}",
            hint="delete it; the file may be binary or damaged",
        )
        return None
    return text


def _place_in(file: str, text: str, offset: int) -> Span:
    line_start = text.rfind("\n", 0, offset) + 1
    return Span(file, text.count("\n", 0, offset) + 1, offset - line_start + 1)


class _Builder(EventReader):
    """Creates the nodes of a tree."""

    def __init__(self, file: str, out: Collector, *, of_devices: bool) -> None:
        super().__init__(file, out)
        self._of_devices = of_devices
        self._texts: dict[str, str] = {}
        self._good_keys: set[str] = set()

    def _node(self, event: Any, *, is_map: bool) -> Node:
        place = self._place_of(event)
        if is_map:
            return MapNode(self._file, place, {}, array("Q"))
        return SeqNode(self._file, place, [])

    def _scalar(self, event: Any) -> None:
        mark = event.start_mark
        place = mark.line << COLUMN_BITS | mark.column
        # One object per spelling: the same keys, names and numbers occur thousands of times.
        text = self._texts.get(event.value)
        if text is None:
            text = self._texts[event.value] = event.value
            self._check_characters(event)
        top = self._top
        pairs = top.pairs if top is not None else None
        # A key needs no node, unless an alias may refer to it.
        if top is not None and top.key is None and pairs is not None and event.anchor is None:
            top.key, top.key_place, top.key_plain = text, place, not event.style
            return
        node = ScalarNode(self._file, place, text, not event.style)
        if event.anchor is not None:
            self._anchors[event.anchor] = (node, 1)
        if top is None:
            self._root = node
        elif pairs is None:
            top.node.items.append(node)
        elif top.key in self._good_keys and top.key not in pairs and "\n" not in text:
            # The usual value, which needs none of the checks of `_pair`.
            pairs[top.key] = node
            top.node.key_places.append(top.key_place)
            top.key = None
        else:
            self._attach(node, event)

    def _check_characters(self, event: Any) -> None:
        """FSN102: a text that would control the terminal, or look like two lines."""
        text = event.value
        if self._of_devices or text.isprintable():
            return
        bad = first_control(text)
        if not bad and "\n" in text and event.start_mark.line == event.end_mark.line:
            bad = "\n"  # written as an escape
        if bad:
            self._refuse(
                "FSN102",
                span_of(self._file, self._place_of(event)),
                f"control character U+{ord(bad):04X} in a text",
                "delete it, or its escape sequence",
            )

    def _attach(self, node: Node, event: Any) -> None:
        top = self._top
        if top is None:
            self._root = node
        elif top.pairs is None:
            top.node.items.append(node)
        elif top.key is None:
            self._key(top, node)
        else:
            self._pair(top, top.key, node)
            top.key = None

    def _key(self, top: OpenNode, node: Node) -> None:
        if not isinstance(node, ScalarNode):
            self._refuse("FSN111", node.span, "a key must be a word", "quote it or check brackets")
        top.key, top.key_place, top.key_plain = node.text, node.place, node.plain

    def _pair(self, top: OpenNode, text: str, node: Node) -> None:
        into = top.node
        assert isinstance(into, MapNode)  # noqa: S101  (only maps have keys)
        if text not in self._good_keys:
            typed = self._look_at_key(top, text)
            if typed is None:
                return
            text = typed
        is_name = text == "name" and not self._of_devices
        if is_name and isinstance(node, ScalarNode) and "\n" in node.text:
            self._refuse("FSN102", node.span, "a name of several lines", "write it on one line")
        if text in into.pairs:
            if not top.continued:
                self._key_twice(top, text, into)
            return
        into.pairs[text] = node
        into.key_places.append(top.key_place)

    def _key_twice(self, top: OpenNode, text: str, into: MapNode) -> None:
        """FSN106; reported once if an item of a list is repeated because of a forgotten dash."""
        first, here = into.keys[text], span_of(self._file, top.key_place)
        in_list = len(self._stack) > 1 and isinstance(self._stack[-2].node, SeqNode)
        below = here.line > first.line and here.column == first.column
        top.continued = in_list and below and text == next(iter(into.pairs))
        self._out.add(
            "FSN106",
            here,
            f"key {text!r} is given twice; the first one is used",
            hint="start a new item with `- ` here, or delete one of them"
            if top.continued
            else "delete one of them",
            related=(Related(span=first, message="first given here"),),
        )

    def _look_at_key(self, top: OpenNode, text: str) -> str | None:
        """Return the key to use; ``None`` if the pair is omitted."""
        span = span_of(self._file, top.key_place)
        if text == "<<" and top.key_plain:
            self._out.add(
                "FSN107",
                span,
                "merge key `<<`: the driver's YAML parser does not merge, keys would be missing",
                hint="write the keys out here",
            )
            return None
        strange = re.search(r"[^\x20-\x7e]", text)
        if strange is None:
            # A quoted `<<` is an ordinary key, but the next one may be plain.
            if text != "<<":
                self._good_keys.add(text)
            return text
        typed = re.sub(r"[^\x21-\x7e]", "", text)
        self._out.add(
            "FSN108",
            span,
            f"key {text!r} holds the character U+{ord(strange.group()):04X}",
            hint=f"type the key again: {typed}",
        )
        return typed
