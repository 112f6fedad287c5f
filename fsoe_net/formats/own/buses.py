"""Buses and groups of a network file, and the bus cycle."""

from __future__ import annotations

import itertools

from fsoe_net.dataclass import dataclass
from fsoe_net.formats.own.schema import MOST_UNKNOWN, nearest_keys
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.numbers import read_float, record_of
from fsoe_net.formats.shared.yaml_tree import MapNode, ScalarNode, SeqNode
from fsoe_net.model.network import Bus, Group

_SHORTEST_CYCLE_US = 6.72  # the shortest Ethernet frame and its gap at 100 Mbit/s


@dataclass(frozen=True, slots=True, kw_only=True)
class BusRows:
    """A bus, and the data of its file about each SubDevice."""

    bus: Bus
    subdevices: tuple[MapNode, ...]


def check_subdevices(root: MapNode, out: Collector) -> None:
    """Report a network file without bus content; a misspelt key is already reported.

    Args:
        root: The document.
        out: Takes FSN110.
    """
    wanted = ("subdevices", "buses")
    others = itertools.islice((k for k in root.pairs if k not in wanted), MOST_UNKNOWN)
    if not any(key in root.pairs for key in wanted) and not any(
        nearest_keys(key, wanted) for key in others
    ):
        out.add(
            "FSN110",
            root.span,
            "the document has no 'subdevices'",
            hint="add subdevices: a list, or buses: where there are several",
        )


def cycle_from_yaml(node: MapNode, out: Collector) -> int | None:
    """Return ``cycle_us`` of a network or bus in ns.

    Args:
        node: The map that may have the key.
        out: Takes FSN130 for an impossible bus.
    """
    cycle_us = read_float(node.get("cycle_us"), out, what="cycle_us")
    if cycle_us is None:
        return None
    if not _SHORTEST_CYCLE_US <= cycle_us <= 4_000_000:
        out.add(
            "FSN130",
            node.at("cycle_us"),
            f"cycle_us {node.text('cycle_us')} is not a possible bus cycle",
            hint="write the cycle in microseconds: 1 ms is cycle_us: 1000",
        )
        return None
    return max(1, round(cycle_us * 1000))


def buses_from_yaml(root: MapNode, out: Collector) -> list[BusRows]:
    """Return the buses of a network file; nothing if it has a single, unnamed bus.

    Args:
        root: The document.
        out: Takes FSN130 and FSN164.
    """
    if not isinstance(root.get("buses"), SeqNode):
        return []
    for key in ("subdevices", "cycle_us"):
        if key in root.pairs:
            out.add(
                "FSN164",
                root.keys[key],
                f"{key} is next to buses; the bus that it belongs to is unknown",
                hint=f"write {key} under the bus it belongs to, or leave buses out",
            )
    return [
        BusRows(
            bus=record_of(Bus, node, out, cycle_ns=cycle_from_yaml(node, out)),
            subdevices=tuple(node.maps("subdevices")),
        )
        for node in root.maps("buses")
    ]


def groups_from_yaml(root: MapNode, out: Collector) -> tuple[Group, ...]:
    """Return the groups of a network file.

    Args:
        root: The document.
        out: Takes FSN165 for groups in a file with several buses.
    """
    if "groups" in root.pairs and "buses" in root.pairs:
        out.add(
            "FSN165",
            root.keys["groups"],
            "groups are next to buses; absent parts are detected on one bus only",
            hint="leave groups out, or write a network file for the bus that has them",
        )
        return ()
    return tuple(_group(node, out) for node in root.maps("groups"))


def _group(node: MapNode, out: Collector) -> Group:
    names = node.get("subdevices")
    items = names.items if isinstance(names, SeqNode) else ()
    members = [item for item in items if isinstance(item, ScalarNode)]
    return record_of(
        Group,
        node,
        out,
        subdevices=tuple(item.text for item in members),
        places=tuple(item.span for item in members),
    )
