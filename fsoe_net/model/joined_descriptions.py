"""Joins several descriptions of one bus; each fills the gaps of the others.

Nothing is replaced: a layout is added if there is none, copies and connections if no earlier
description has any. Contradicting descriptions are rejected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fsoe_net.errors import InputError
from fsoe_net.model.bus import Device
from fsoe_net.model.description import (
    DescribedConnection,
    DescribedCopy,
    DescribedEnd,
    DescribedSubDevice,
    Description,
)


def has_layout(device: Device) -> bool:
    """Whether the process data of the device are known."""
    return any(device.pdos_of(sm) for sm in device.sync_managers)


def _is_of_type(sub: DescribedSubDevice, row: DescribedSubDevice) -> bool:
    """Whether a SubDevice is of a type: by identity, or by order number if it has none."""
    one, two = sub.device, row.device
    if one.product_code:
        return one.identity == two.identity
    return bool(sub.order) and sub.order.casefold() == row.order.casefold()


def join_buses(buses: Sequence[Description], notes: list[str]) -> Description:
    """Join descriptions whose SubDevices have a place in the ring.

    SubDevices of two descriptions are the same if position or alias is the same.

    Args:
        buses: At least one; the first one has precedence.
        notes: Takes notes on parts that could not be joined.

    Raises:
        InputError: Two descriptions have different devices at one position.
    """
    joined = buses[0]
    for other in buses[1:]:
        joined = _joined(joined, other, notes)
    return joined


def _place(sub: DescribedSubDevice) -> tuple[str, int] | None:
    if sub.alias:
        return ("alias", sub.alias)
    return None if sub.position is None else ("position", sub.position)


def _joined(first: Description, other: Description, notes: list[str]) -> Description:
    subs = list(first.subdevices)
    places = {p: n for n, s in enumerate(subs) if (p := _place(s)) is not None}
    numbers: dict[int, int] = {}
    for number, sub in enumerate(other.subdevices):
        # Without a position two SubDevices cannot be recognised as the same one.
        place = _place(sub)
        if place is None:
            notes.append(f"{other.path}: {_shown(sub)} has no place in the ring; it is left out")
        elif place in places:
            numbers[number] = places[place]
            subs[places[place]] = _filled(subs[places[place]], sub, other.path)
        else:
            numbers[number] = places[place] = len(subs)
            # A description may know only a part of the bus.
            subs.append(sub)
    return replace(
        first,
        subdevices=tuple(subs),
        copies=_joined_copies(first, other, numbers, notes),
        connections=_joined_connections(first, other, numbers, notes),
        cycle_us=first.cycle_us or other.cycle_us,
        truncated=first.truncated or other.truncated,
    )


def _joined_copies(
    first: Description, other: Description, numbers: Mapping[int, int], notes: list[str]
) -> tuple[DescribedCopy, ...]:
    """Return the copies of the first description that has any."""
    if first.copies:
        if other.copies:
            notes.append(f"{other.path}: its copies are left out; those of {first.path} are taken")
        return first.copies
    copies = tuple(
        replace(c, source=_moved(c.source, numbers), destination=_moved(c.destination, numbers))
        for c in other.copies
        if {c.source.subdevice, c.destination.subdevice} <= numbers.keys()
    )
    if len(copies) < len(other.copies):
        notes.append(f"{other.path}: copies without known SubDevices are left out")
    return copies


def _joined_connections(
    first: Description, other: Description, numbers: Mapping[int, int], notes: list[str]
) -> tuple[DescribedConnection, ...]:
    """Return the connections of the first description that has any."""
    if first.connections:
        # Connections of two sources are not mixed: half of each would match neither safety project.
        if other.connections:
            notes.append(f"{other.path}: its connections are left out; {first.path} has some")
        return first.connections
    connections = tuple(
        replace(c, main=numbers[c.main], sub=numbers[c.sub])
        for c in other.connections
        if c.main is not None and c.sub is not None and {c.main, c.sub} <= numbers.keys()
    )
    if len(connections) < len(other.connections):
        notes.append(f"{other.path}: connections without known SubDevices are left out")
    return connections


def _moved(end: DescribedEnd, numbers: Mapping[int, int]) -> DescribedEnd:
    return replace(end, subdevice=numbers[end.subdevice])


def _shown(sub: DescribedSubDevice) -> str:
    return _name(sub) or "a SubDevice"


def _type(sub: DescribedSubDevice) -> str:
    name = _name(sub)
    return f"a {name}" if name else "of the type it describes"


def _name(sub: DescribedSubDevice) -> str:
    name = "" if sub.name.isdigit() and sub.order else sub.name  # a bare number is not a name
    return name or sub.order


def _refuse_another_type(sub: DescribedSubDevice, other: DescribedSubDevice, path: str) -> None:
    """Reject two device types at one position.

    Raises:
        InputError: Vendor or product differ.
    """
    for key, word in (("vendor_id", "vendor"), ("product_code", "product")):
        one, two = getattr(sub.device, key), getattr(other.device, key)
        if one and two and one != two:
            raise InputError(
                f"{_shown(sub)}: {word} 0x{one:08x}, but 0x{two:08x} in {path}; "
                "are these files of one bus?"
            )


def _filled(sub: DescribedSubDevice, other: DescribedSubDevice, path: str) -> DescribedSubDevice:
    """Return the SubDevice with the additional facts of the other one."""
    # Before any addition: two device types at one position mean two different buses.
    _refuse_another_type(sub, other, path)
    device = sub.device
    # A layout is used as a whole: parts of two layouts would shift each other.
    if not has_layout(device) and has_layout(other.device):
        device = replace(
            other.device,
            sdos=device.sdos or other.device.sdos,
            assign_activate=device.assign_activate or other.device.assign_activate,
        )
    return replace(
        sub,
        name=sub.name or other.name,
        order=sub.order or other.order,
        device=replace(
            device,
            vendor_id=sub.device.vendor_id or other.device.vendor_id,
            product_code=sub.device.product_code or other.device.product_code,
        ),
        revision=other.revision if sub.revision is None else sub.revision,
        serial=sub.serial or other.serial,
        available=sub.available or other.available,
        module_ident=sub.module_ident or other.module_ident,
        start=sub.start or other.start,
    )


def _filled_by_type(
    sub: DescribedSubDevice, row: DescribedSubDevice, path: str, notes: list[str]
) -> DescribedSubDevice:
    """Return a SubDevice with the process data of its type; its own revision is kept."""
    if sub.revision is not None and row.revision not in (None, sub.revision):
        notes.append(
            f"{_shown(sub)}: revision 0x{sub.revision:08x} is not in {path}; the process data "
            f"of 0x{row.revision:08x} are taken"
        )
    if not has_layout(row.device):
        notes.append(f"{_shown(sub)}: {path} names the device and no process data")
    return replace(_filled(sub, row, path), revision=sub.revision)


def fill_devices(bus: Description, types: Sequence[Description], notes: list[str]) -> Description:
    """Fill SubDevices without process data from device types of the same identity.

    A SubDevice with process data keeps them; its type only adds start-up data.

    Args:
        bus: SubDevices in a ring.
        types: Device types, as read from ESI and SII; an exact revision comes first.
        notes: Takes notes about differing revisions.
    """
    rows = [(sub, t.path) for t in types for sub in t.subdevices]
    subs = []
    for sub in bus.subdevices:
        same = [(row, path) for row, path in rows if _is_of_type(sub, row)]
        if not same:
            subs.append(sub)
            continue
        # The exact revision has the layout of this device; another one is a hint only.
        exact = [r for r in same if r[0].revision == sub.revision]
        row, path = (exact or same)[0]
        if has_layout(sub.device):
            subs.append(replace(sub, start=sub.start or row.start))
        else:
            subs.append(_filled_by_type(sub, row, path, notes))
    return replace(bus, subdevices=tuple(subs))


def idle_types(bus: Description, types: Sequence[Description]) -> list[str]:
    """Return a note for each device type without a SubDevice in the ring."""
    return [
        f"{t.path}: no SubDevice is {_type(row)}; it is left out"
        for t in types
        for row in t.subdevices
        if not any(_is_of_type(sub, row) for sub in bus.subdevices)
    ]
