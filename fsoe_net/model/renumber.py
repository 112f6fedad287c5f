"""Copies of one description with the SubDevice numbers of another one of the same bus."""

from __future__ import annotations

from dataclasses import replace

from fsoe_net.errors import InputError
from fsoe_net.model.description import DescribedCopy, DescribedEnd, DescribedSubDevice, Description
from fsoe_net.model.layout import SmLayout


def renumbered_copies(bus: Description, other: Description) -> tuple[DescribedCopy, ...]:
    """Return the copies of ``bus`` with SubDevices of ``other`` as ends.

    SubDevices are the same if they have the same ring position and the same identity.

    Args:
        bus: Description with copies and ring positions.
        other: Description of the same bus, with all its SubDevices and their process data.

    Raises:
        InputError: The buses differ, or an end has other process data; with the location.
    """
    places = {s.position: n for n, s in enumerate(other.subdevices)}
    numbers = [_partner(sub, places, other) for sub in bus.subdevices]
    # Copies of SubDevices that are missing in the other description would be lost silently.
    missing = set(range(len(other.subdevices))) - set(numbers)
    for copy in other.copies:
        if {copy.source.subdevice, copy.destination.subdevice} & missing:
            raise InputError(
                f"{copy.span}: a copy of a SubDevice that {bus.path} does not name would be lost; "
                "name it there, or delete the copy"
            )
    return tuple(
        replace(
            copy,
            source=_end(copy.source, copy.bits, bus, other, numbers),
            destination=_end(copy.destination, copy.bits, bus, other, numbers),
        )
        for copy in bus.copies
    )


def _name(sub: DescribedSubDevice) -> str:
    return sub.name or sub.order or f"the SubDevice at position {sub.position}"


def _partner(sub: DescribedSubDevice, places: dict[int | None, int], other: Description) -> int:
    if sub.position is None or sub.alias:
        raise InputError(
            f"{sub.span}: {_name(sub)} has no ring position to find it by in {other.path}; "
            "give it its position"
        )
    number = places.get(sub.position)
    if number is None:
        raise InputError(
            f"{sub.span}: {_name(sub)} is at position {sub.position}; {other.path} has no "
            "SubDevice there: these are not the same bus"
        )
    found = other.subdevices[number]
    mine, theirs = sub.device.identity, found.device.identity
    if mine != theirs:
        raise InputError(
            f"{sub.span}: {_name(sub)} at position {sub.position} is vendor 0x{mine[0]:x}, product "
            f"0x{mine[1]:x}; {found.span} has vendor 0x{theirs[0]:x}, product 0x{theirs[1]:x} "
            "there: these are not the same bus"
        )
    return number


def _end(
    end: DescribedEnd, bits: int, bus: Description, other: Description, numbers: list[int]
) -> DescribedEnd:
    sub, found = bus.subdevices[end.subdevice], other.subdevices[numbers[end.subdevice]]
    managers = (s.device.layout.manager(end.sm_index) for s in (sub, found))
    mine, theirs = (_range(manager, end.bit_offset, bits) for manager in managers)
    if mine != theirs:
        raise InputError(
            f"{sub.span}: {_name(sub)}: byte {end.bit_offset // 8} of sync manager {end.sm_index} "
            f"holds other data at {found.span}; assign the same PDOs in both"
        )
    return replace(end, subdevice=numbers[end.subdevice])


def _range(manager: SmLayout | None, first: int, bits: int) -> list[tuple[int, ...]] | None:
    """Return the content of a range: place, index and length of each entry.

    Subindexes are not included: a device and its module swap those of CRC and connection ID.
    """
    if manager is None or first + bits > manager.bits:
        return None
    return [
        (p.bit_offset, p.entry.index, p.entry.bits)
        for p in manager.placed
        if not p.entry.is_gap and p.end_bit > first and p.bit_offset < first + bits
    ]
