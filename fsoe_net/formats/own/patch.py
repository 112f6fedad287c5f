"""Replaces scalars in a YAML file in place. All other bytes are unchanged."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from fsoe_net.diag.diagnostic import Edit, Span
from fsoe_net.errors import InputError
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.yaml_tree import MapNode, Node, ScalarNode, parse_yaml

# FSoE addresses, connection IDs and watchdogs belong to the safety project: never changed here.
_KEYS = frozenset({"size", "in", "out", "index", "subindex"})
# YAML 1.1 also ends lines at NEL, LS and PS, and places count them.
_LINE = re.compile("[^\\r\\n\\x85\\u2028\\u2029]*(?:\\r\\n|[\\r\\n\\x85\\u2028\\u2029]|\\Z)")


def patch_yaml(data: bytes, file: str, edits: Iterable[Edit]) -> tuple[bytes, frozenset[Edit]]:
    """Return the bytes with the edits applied, and the applied edits.

    An edit is skipped when another one conflicts with it, when its place does not contain a plain
    scalar of its key, or when its key is not one of a transfer.

    Args:
        data: The file in the state in which its findings were made.
        file: Its name, as in the places of the edits.
        edits: Edits to apply.

    Raises:
        InputError: The file is not valid YAML.
    """
    out = Collector()
    root = parse_yaml(data, file, out)
    if root is None:
        raise InputError(f"{file} cannot be read", out.diagnostics)
    text = data.decode("utf-8")
    mark = int(text.startswith("\ufeff"))
    starts = [match.start() for match in _LINE.finditer(text[mark:])]

    def offset(span: Span) -> int:
        return mark + starts[span.line - 1] + span.column - 1

    def place_of(edit: Edit) -> tuple[int, int] | None:
        """Return the range of the text that an edit replaces; ``None`` if that is not allowed."""
        found = places.get((edit.key, edit.span))
        if found is None or edit.key not in _KEYS:
            return None
        key_at, node = found
        if edit.renames:
            begin, old = offset(key_at), edit.key
        elif isinstance(node, ScalarNode) and node.plain:
            begin, old = offset(node.span), node.text
        else:
            return None
        end = begin + len(old)
        return (begin, end) if text[begin:end] == old else None

    places = {(key, node.span): (place, node) for key, place, node in _values(root)}
    wanted: dict[tuple[int, int], set[str]] = {}
    made: dict[Edit, tuple[int, int]] = {}
    for edit in edits:
        if edit.renames and edit.text not in _KEYS:
            continue
        place = place_of(edit)
        if place is not None:
            made[edit] = place
            wanted.setdefault(place, set()).add(edit.text)
    # From the end, so that earlier places stay valid.
    for begin, end in sorted(wanted, reverse=True):
        if len(wanted[begin, end]) == 1:
            text = text[:begin] + next(iter(wanted[begin, end])) + text[end:]
    return text.encode("utf-8"), frozenset(e for e, at in made.items() if len(wanted[at]) == 1)


def _values(root: MapNode) -> Iterator[tuple[str, Span, Node]]:
    """Yield every value of every map with its key and the place of the key; without recursion."""
    left: list[Node] = [root]
    seen: set[Node] = set()
    while left:
        node = left.pop()
        if isinstance(node, ScalarNode) or node in seen:
            continue
        seen.add(node)
        if isinstance(node, MapNode):
            keys = node.keys
            yield from ((key, keys[key], value) for key, value in node.pairs.items())
            left += node.pairs.values()
        else:
            left += node.items
