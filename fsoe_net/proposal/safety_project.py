"""Matches connections of a safety project, whose devices have no position, to a ring."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from fsoe_net.model.description import (
    DescribedConnection,
    DescribedSubDevice,
    Description,
)
from fsoe_net.model.library import Library
from fsoe_net.model.library_fill import library_device


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchedProject:
    """Facts of a safety project about the SubDevices of a ring.

    Attributes:
        connections: Connections with a certain SubInstance; the MainInstance may be open.
        hints: Connections with several candidate SubDevices, with their numbers, in words.
        lost: Connections without any SubDevice, in words.
    """

    connections: tuple[DescribedConnection, ...]
    hints: tuple[tuple[frozenset[int], str], ...]
    lost: tuple[str, ...]


def projects_of(bus: Description) -> list[Description]:
    """Return the connections of a bus as safety projects, one per logic, which comes first."""
    projects = []
    for main in dict.fromkeys(c.main for c in bus.connections if c.main is not None):
        rows = [c for c in bus.connections if c.main == main and c.sub is not None]
        numbers = [main, *dict.fromkeys(c.sub for c in rows if c.sub is not None)]
        projects.append(
            replace(
                bus,
                subdevices=tuple(bus.subdevices[n] for n in numbers),
                copies=(),
                connections=tuple(
                    replace(c, main=0, sub=numbers.index(c.sub)) for c in rows if c.sub is not None
                ),
            )
        )
    return projects


def match_project(
    subdevices: Sequence[DescribedSubDevice],
    project: Description,
    library: Library,
    connections: Sequence[DescribedConnection] = (),
) -> MatchedProject:
    """Match by name, or else by order number if ring and project have exactly one of it.

    Equal devices are distinguished by slots, if a file of the ring and the project have the same
    type of device in each slot of the only logic.

    Args:
        subdevices: The ring.
        project: The safety project.
        library: Order numbers of identities.
        connections: Connections from other files about the ring.
    """
    matched, hints, lost = [], [], []
    orders = [_orders(s, library) for s in subdevices]
    by_slot = _by_slot(project, orders, connections)
    names = _by_name(subdevices)
    rivals = Counter(sub.order for sub in project.subdevices)
    for row in project.connections:
        wanted = project.subdevices[row.sub or row.main or 0]
        found = names.get(wanted.name, [])
        # Names differ between tools; then the slots of the only logic decide.
        if len(found) != 1 and row.main == 0 and row.slot in by_slot:
            found = [by_slot[row.slot]]
        is_sure = len(found) == 1
        if not is_sure:
            found = _with_order(wanted, orders)
            # The only one of its type on the ring and in the project.
            is_sure = len(found) == 1 and rivals[wanted.order] == 1
        text = _text(row, wanted, project.path)
        if is_sure and row.main == 0:
            matched.append(replace(row, main=None, sub=found[0]))
        elif found:
            hints.append((frozenset(found), text))
        else:
            lost.append(text)
    return MatchedProject(connections=tuple(matched), hints=tuple(hints), lost=tuple(lost))


def _by_name(subdevices: Sequence[DescribedSubDevice]) -> dict[str, list[int]]:
    names: dict[str, list[int]] = {}
    for number, sub in enumerate(subdevices):
        if sub.name:
            names.setdefault(sub.name, []).append(number)
    return names


def _with_order(wanted: DescribedSubDevice, orders: Sequence[set[str]]) -> list[int]:
    order = wanted.order.casefold()
    return [number for number, words in enumerate(orders) if order in words]


def _by_slot(
    project: Description, orders: Sequence[set[str]], connections: Sequence[DescribedConnection]
) -> dict[int, int]:
    """Return the SubDevice in each slot if the project matches all of them, otherwise none."""
    known = [c for c in connections if c.main is not None]
    here = {c.slot: c.sub for c in known if c.slot is not None and c.sub is not None}
    there = {
        c.slot: project.subdevices[c.sub].order.casefold()
        for c in project.connections
        if c.main == 0 and c.sub is not None and c.slot is not None
    }
    # A single differing slot makes all of them doubtful.
    if len({c.main for c in known}) != 1 or here.keys() != there.keys():
        return {}
    return here if all(there[slot] in orders[sub] for slot, sub in here.items()) else {}


def _orders(sub: DescribedSubDevice, library: Library) -> set[str]:
    known = library_device(sub, library)
    words = {sub.order} if known is None else {sub.order, known.name}
    if known is not None:
        words |= {i.order for i in known.identities if i.product_code == sub.device.product_code}
    return {w.casefold() for w in words if w}


def _text(row: DescribedConnection, wanted: DescribedSubDevice, path: str) -> str:
    line = f":{row.span.line}" if row.span.line else ""
    facts = [
        f"{word} {value}"
        for word, value in (
            ("slot", row.slot),
            ("address", row.address),
            ("connection ID", row.connection_id),
            ("watchdog ms", row.watchdog_ms),
        )
        if value is not None
    ]
    what = wanted.order or "a device"
    return f"{path}{line}: connection {row.name!r} of {what}: {', '.join(facts)}"
