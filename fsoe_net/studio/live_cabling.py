"""The cables of the machine that the live page draws: SubDevices in their order on each bus.

A cable has a number: that of the SubDevice after it. The cables that close a ring follow.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from fsoe_net.core.bus_documents import SubDeviceSnapshot
from fsoe_net.model.kinds import SubDeviceKind
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.scan import Scan, ScannedPort, ScannedSubDevice
from fsoe_net.model.wiring import reached, wiring_of
from fsoe_net.studio.document import cables_of

Row = dict[str, object]


@dataclass(frozen=True, slots=True, kw_only=True)
class CablePlace:
    """A SubDevice on a bus: absolute, or after the SubDevice with the alias."""

    name: str
    bus: int
    alias: int
    position: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CableNode:
    """A SubDevice of the picture.

    Attributes:
        name: Name in the network; empty for a device that only the scan has.
        bus: Number of its bus.
        type: Type in the scan, for a device without a name.
        parent: Number of the node before it; ``None`` for the MainDevice.
        port: Port of that node.
    """

    name: str
    bus: int
    type: str = ""
    parent: int | None = None
    port: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Cabling:
    """All nodes, and those from which a cable returns to the MainDevice."""

    nodes: tuple[CableNode, ...]
    rings: tuple[int, ...] = ()

    def unreached(self, cut: Collection[int]) -> set[str]:
        """Return the SubDevices that cut cables separate from the MainDevice."""
        there = reached([node.parent for node in self.nodes], self.rings, cut)
        return {node.name for n, node in enumerate(self.nodes) if n not in there and node.name}

    def cable_text(self, cable: int) -> str:
        """Return both ends of a cable."""
        is_ring = cable >= len(self.nodes)
        last = self.rings[cable - len(self.nodes)] if is_ring else cable
        parent = None if is_ring else self.nodes[cable].parent
        ends = [
            "the MainDevice" if n is None else self.nodes[n].name or self.nodes[n].type
            for n in (parent, last)
        ]
        return f"cable between {' and '.join(ends)}"

    def row(self, facts: Mapping[str, Row], buses: Sequence[str]) -> Row:
        """Return the picture.

        Args:
            facts: Further keys of SubDevices by name.
            buses: Names of the buses; empty for a single one.
        """
        unknown: Row = {"kind": SubDeviceKind.TERMINAL.value, "type": "", "about": "", "axes": []}
        unknown |= {"inputs": [], "outputs": []}
        return {
            "buses": list(buses),
            "rings": list(self.rings),
            "nodes": [
                {
                    **unknown,
                    "name": node.name,
                    "bus": node.bus,
                    "type": node.type,
                    "parent": node.parent,
                    "port": node.port,
                    **facts.get(node.name, {}),
                }
                for node in self.nodes
            ],
        }


def lines_of(places: Sequence[CablePlace]) -> Cabling:
    """Return each bus as a line, in the order of its positions."""
    nodes: list[CableNode] = []
    for bus in sorted({place.bus for place in places}):
        # A SubDevice with an alias stays after the previous one in the file.
        groups: list[list[CablePlace]] = [[]]
        for place in places:
            if place.bus == bus:
                if not place.alias:
                    groups.append([])
                groups[-1].append(place)
        first, *others = groups
        others.sort(key=lambda group: group[0].position)
        parent = None
        for place in (place for group in (first, *others) for place in group):
            nodes.append(CableNode(name=place.name, bus=bus, parent=parent))
            parent = len(nodes) - 1
    return Cabling(nodes=tuple(nodes))


def cabling_of(resolution: Resolution, scan: Scan | None) -> Cabling:
    """Return the cables of a network; the first bus as in a scan, if its links determine them."""
    network = resolution.network
    places = [
        CablePlace(name=s.name, bus=s.master_id, alias=s.alias, position=s.position)
        for s in network.subdevices
    ]
    wired = None if scan is None else cables_of(network, scan)
    if wired is None or not wired["is_known"]:
        return lines_of(places)
    nodes = [
        CableNode(
            name=str(row["subdevice"]),
            bus=0,
            type=str(row["type"]),
            parent=row["parent"],
            port=row["port"],
        )
        for row in wired["nodes"]
    ]
    # SubDevices that the scan lacks, and other buses, follow as lines.
    names = {node.name for node in nodes}
    rest = lines_of([place for place in places if place.name not in names])
    first = len(nodes)
    for node in rest.nodes:
        parent = None if node.parent is None else node.parent + first
        nodes.append(CableNode(name=node.name, bus=node.bus, parent=parent))
    ring = wired["ring_from"]
    return Cabling(nodes=tuple(nodes), rings=() if ring is None else (ring[0],))


def bus_row(
    subdevices: Sequence[SubDeviceSnapshot],
    kinds: Mapping[str, SubDeviceKind],
    buses: Sequence[str] = (),
) -> Row:
    """Return the picture of a bus from its own reports, without lamps and axes."""
    places = [
        CablePlace(name=s.name, bus=s.bus, alias=s.alias, position=s.position) for s in subdevices
    ]
    facts: dict[str, Row] = {name: {"kind": kind.value} for name, kind in kinds.items()}
    return (_linked(subdevices) or lines_of(places)).row(facts, buses)


def _linked(subdevices: Sequence[SubDeviceSnapshot]) -> Cabling | None:
    """Return the cables by the links at the ports, if these are read and leave one way."""
    # A device that is not in the plan would be missing between the others.
    if [(s.bus, s.alias, s.position) for s in subdevices] != [
        (0, 0, n) for n in range(len(subdevices))
    ]:
        return None
    wiring = wiring_of(
        Scan(
            interface="",
            subdevices=tuple(
                ScannedSubDevice(
                    position=s.position,
                    ports=tuple(
                        ScannedPort(port=port, link=bool(up)) for port, up in enumerate(s.link)
                    ),
                )
                for s in subdevices
            ),
        )
    )
    if wiring is None:
        return None
    rings = () if wiring.ring_from is None else (wiring.ring_from[0],)
    nodes = tuple(
        CableNode(name=subdevices[c.position].name, bus=0, parent=c.parent, port=c.port)
        for c in wiring.cables
    )
    return Cabling(nodes=nodes, rings=rings)
