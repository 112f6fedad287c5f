"""Groups of SubDevices that may be absent, in a network file."""

from __future__ import annotations

from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.yaml_tree import MapNode, ScalarNode, SeqNode
from fsoe_net.model.network import Group


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
            "groups stand beside buses; which parts are there is watched on one bus only",
            hint="leave groups out, or write a network file for the bus that has them",
        )
        return ()
    return tuple(map(_group, root.maps("groups")))


def _group(node: MapNode) -> Group:
    names = node.get("subdevices")
    items = names.items if isinstance(names, SeqNode) else ()
    members = [item for item in items if isinstance(item, ScalarNode)]
    return Group(
        span=node.span,
        fields=node.places(),
        name=node.text("name") or "",
        place=node.text("place") or "",
        subdevices=tuple(item.text for item in members),
        places=tuple(item.span for item in members),
    )
