"""Copies of one description on the SubDevices of another, and every way in which they differ."""

from __future__ import annotations

from dataclasses import replace

import pytest
from described import bus, copy, device

from fsoe_net.diag.diagnostic import Span
from fsoe_net.errors import InputError
from fsoe_net.model.description import Description
from fsoe_net.model.renumber import _range, renumbered_copies

MINE = replace(bus(2), path="mine.xml")
MINE = replace(
    MINE,
    subdevices=tuple(
        replace(sub, span=Span("mine.xml", 10 + n, 1)) for n, sub in enumerate(MINE.subdevices)
    ),
)


def other(**changes: object) -> Description:
    """The same bus, its SubDevices listed from the last one on."""
    subs = [replace(s, span=Span("other.xml", s.position, 2)) for s in MINE.subdevices[::-1]]
    return Description(
        **{"format": "test", "path": "other.xml", "subdevices": tuple(subs), "copies": ()} | changes
    )


def test_ends_get_the_numbers_of_the_other():
    rows = [
        (c.source.subdevice, c.destination.subdevice, c.bits)
        for c in renumbered_copies(MINE, other())
    ]
    assert rows == [(1, 2, 48), (2, 1, 48), (0, 2, 48), (2, 0, 48)]


def test_a_copy_that_no_one_names_would_be_lost():
    kept = replace(copy((0, 3, 0), (2, 2, 48), 48), span=Span("other.xml", 7, 3))
    fewer = replace(MINE, subdevices=MINE.subdevices[:2], copies=MINE.copies[:2])
    with pytest.raises(InputError) as caught:
        renumbered_copies(fewer, other(copies=(kept,)))
    assert str(caught.value) == (
        "other.xml:7:3: a copy of a SubDevice that mine.xml does not name would be lost; "
        "name it there, or delete the copy"
    )


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            {"position": None},
            "mine.xml:11:1: terminal 0 <ä> & co has no ring position to find it by in other.xml; "
            "give it its position",
        ),
        (
            {"alias": 5, "name": "", "order": "EL1904"},
            "mine.xml:11:1: EL1904 has no ring position to find it by in other.xml; "
            "give it its position",
        ),
        (
            {"position": 9, "name": ""},
            "mine.xml:11:1: the SubDevice at position 9 is at position 9; other.xml has no "
            "SubDevice there: these are not the same bus",
        ),
        (
            {"device": device(3, 0x07703052, 1)},
            "mine.xml:11:1: terminal 0 <ä> & co at position 1 is vendor 0x3, product 0x7703052; "
            "other.xml:1:2 has vendor 0x2, product 0x7703052 there: these are not the same bus",
        ),
        (
            {"device": device(2, 0x07703052, 0)},
            "mine.xml:11:1: terminal 0 <ä> & co: byte 0 of sync manager 3 holds other data at "
            "other.xml:1:2; assign the same PDOs in both",
        ),
    ],
)
def test_another_bus_is_rejected(change: dict, text: str):
    subs = list(MINE.subdevices)
    subs[1] = replace(subs[1], **change)
    with pytest.raises(InputError) as caught:
        renumbered_copies(replace(MINE, subdevices=tuple(subs)), other())
    assert str(caught.value) == text


@pytest.mark.parametrize(("pdo", "same"), [(0, False), (1, True)])
def test_only_what_is_copied_has_to_be_equal(pdo: int, same: bool):
    """The frame is the first PDO; what stands behind it is not moved."""
    subs = list(MINE.subdevices)
    made = subs[1].device
    *others, manager = made.sync_managers
    pdos = list(manager.pdos)
    entries = [replace(e, index=e.index + 1) for e in pdos[pdo].entries]
    pdos[pdo] = replace(pdos[pdo], entries=tuple(entries))
    managers = (*others, replace(manager, pdos=tuple(pdos)))
    subs[1] = replace(subs[1], device=replace(made, sync_managers=managers))
    changed = replace(MINE, subdevices=tuple(subs))
    if same:
        assert renumbered_copies(changed, other()) == renumbered_copies(MINE, other())
    else:
        with pytest.raises(InputError, match="byte 0 of sync manager 3 holds other data"):
            renumbered_copies(changed, other())


def test_entries_next_to_what_is_copied_are_not_compared():
    manager = MINE.subdevices[1].device.layout.managers[0]
    places = [(p.bit_offset, p.end_bit, p.entry.index) for p in manager.placed]
    (_, first_end, _), (second, second_end, index), (third, _, _) = places[:3]
    assert (first_end, second_end) == (second, third)
    found = _range(manager, second, second_end - second)
    assert found == [(second, index, second_end - second)]
    whole = _range(manager, 0, manager.bits)
    assert whole is not None
    assert len(whole) == len([p for p in manager.placed if not p.entry.is_gap])
    assert _range(manager, 1, manager.bits) is None
    assert _range(None, 0, 1) is None
