"""The answers file of ``fsoe-net init``: user knowledge missing in the other files."""

from __future__ import annotations

import os

from fsoe_net.formats.own.schema import check_structure
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.numbers import own_int, record_of
from fsoe_net.formats.shared.yaml_tree import MapNode, Node, ScalarNode, SeqNode, parse_yaml
from fsoe_net.model.answers import AnsweredDevice, AnsweredWord, Answers
from fsoe_net.model.network import ConnectionFacts

_U16, _U32 = 0xFFFF, 0xFFFFFFFF
_MOST = 1000
_NO = ("false", "no", "off", "n")


def load_answers(path: str | os.PathLike[str], out: Collector) -> Answers | None:
    """Read an answers file.

    Args:
        path: The file.
        out: Takes FSN101 … FSN116 with line and column.

    Returns:
        The answers, or ``None`` when the file does not exist or is not valid YAML.
    """
    data = read_bytes(path, out)
    return None if data is None else parse_answers(data, os.fspath(path), out)


def parse_answers(data: bytes, file: str, out: Collector) -> Answers | None:
    """Read answers from the bytes of a file; see `load_answers`."""
    before = len(out.diagnostics)  # a key that is given twice counts
    root = parse_yaml(data, file, out)
    if root is None:
        return None
    check_structure(root, "answers", out)
    if len(out.diagnostics) > before:
        return None
    main = root.get("main")
    return record_of(
        Answers,
        root,
        out,
        cycle_us=own_int(root, "cycle_us", 4_000_000, out, low=1),
        subdevices=tuple(_device(n, out) for n in root.maps("subdevices")),
        main=None if main is None else tuple(_words(main)),
        process_data=_by_name(root, "process_data"),
        frames=_by_name(root, "frames"),
        connections=tuple(_connection(n, out) for n in root.maps("connections")),
    )


def _device(node: MapNode, out: Collector) -> AnsweredDevice:
    return record_of(
        AnsweredDevice,
        node,
        out,
        {"position": _U16, "revision": _U32},
        type=(node.text("type") or "").strip(),
        name=(node.text("name") or "").strip(),
        count=own_int(node, "count", _MOST, out, low=1) or 1,
    )


def _connection(node: MapNode, out: Collector) -> ConnectionFacts:
    highs = {"address": _U16, "connection_id": _U16, "watchdog_ms": _U16}
    return record_of(ConnectionFacts, node, out, {"slot": 255, "sub_slot": 255} | highs)


def _words(node: Node) -> list[AnsweredWord]:
    items = node.items if isinstance(node, SeqNode) else [node]
    return [AnsweredWord(span=i.span, text=i.text) for i in items if isinstance(i, ScalarNode)]


def _by_name(root: MapNode, key: str) -> dict[str, AnsweredWord]:
    node = root.get(key)
    if not isinstance(node, MapNode):
        return {}
    return {
        name: AnsweredWord(
            span=node.keys[name],
            fields={"value": value.span},
            text="no" if value.text.lower() in _NO and value.plain else value.text,
        )
        for name, value in node.pairs.items()
        if isinstance(value, ScalarNode)
    }
