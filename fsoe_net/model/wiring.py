"""The cabling of a bus, derived from the links that a scan found at the ports.

A frame enters a SubDevice at port 0 and leaves it at ports 3, 1 and 2, in this order, if the port
has a link: the frame processing order of EtherCAT SubDevice controllers. Positions count in the
order in which frames pass, so links and positions determine one tree. If there is one more link
than following SubDevices, the last cable returns to the MainDevice: a ring.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.model.scan import Scan, ScannedSubDevice

_ORDER = (3, 1, 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cable:
    """The cable that connects a SubDevice.

    Attributes:
        position: Ring position of the SubDevice.
        parent: Position of the preceding device; ``None`` for the MainDevice.
        port: Port of the preceding device, 0 to 3; 0 at the MainDevice.
    """

    position: int
    parent: int | None
    port: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """The cables of a bus.

    Attributes:
        cables: One for each SubDevice, by position.
        ring_from: Position and port from which a cable returns to the MainDevice; ``None`` for a
            line or a tree.
    """

    cables: tuple[Cable, ...]
    ring_from: tuple[int, int] | None = None


def wiring_of(scan: Scan) -> Wiring | None:
    """Return the cabling; ``None`` if the links do not determine it.

    This is the case if a link was not read, a SubDevice is not fed at port 0, or links and
    SubDevices do not match, for example if a cable was unplugged during the scan.

    Args:
        scan: SubDevices in ring order.
    """
    subdevices = scan.subdevices
    if not subdevices or not all(map(_is_fed_at_port_0, subdevices)):
        return None
    cables = [Cable(position=0, parent=None, port=0)]
    open_ends = _ends(subdevices[0])
    for sub in subdevices[1:]:
        # More SubDevices than open ports: a link was not read.
        if not open_ends:
            return None
        # The last open end: frames return from the deepest branch first.
        parent, port = open_ends.pop()
        cables.append(Cable(position=sub.position, parent=parent, port=port))
        open_ends += _ends(sub)
    if len(open_ends) > 1:
        return None
    return Wiring(cables=tuple(cables), ring_from=open_ends[0] if open_ends else None)


def _is_fed_at_port_0(sub: ScannedSubDevice) -> bool:
    links = {port.port: port.link for port in sub.ports}
    return links.get(0) is True and None not in links.values()


def _ends(sub: ScannedSubDevice) -> list[tuple[int, int]]:
    """Return the ports that may have a following device, the first one last."""
    linked = {port.port for port in sub.ports if port.link}
    return [(sub.position, port) for port in reversed(_ORDER) if port in linked]


def reached(
    parents: Sequence[int | None], ring_ends: Sequence[int], cut: Collection[int]
) -> frozenset[int]:
    """Return the SubDevices that frames of the MainDevice still reach.

    Args:
        parents: The device before each SubDevice; ``None`` for the MainDevice.
        ring_ends: SubDevices from which one more cable returns to the MainDevice.
        cut: Numbers of cut cables: first the one before each SubDevice, then those of
            ``ring_ends``.
    """
    neighbours: dict[int | None, list[int | None]] = {}
    cables = [*enumerate(parents), *((end, None) for end in ring_ends)]
    for number, (one, other) in enumerate(cables):
        if number not in cut:
            neighbours.setdefault(one, []).append(other)
            neighbours.setdefault(other, []).append(one)
    found: set[int | None] = {None}
    waiting: list[int | None] = [None]
    while waiting:
        new = set(neighbours.get(waiting.pop(), ())) - found
        found |= new
        waiting += new
    return frozenset(place for place in found if place is not None)
