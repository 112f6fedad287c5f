"""Descriptions of one bus joined: nothing replaced, nothing lost in silence."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from operator import attrgetter

import pytest
from changed import compare, figures, whole
from described import bus, device

from fsoe_net.errors import InputError
from fsoe_net.model.bus import Device, Sdo
from fsoe_net.model.description import (
    DescribedConnection,
    DescribedSubDevice,
    Description,
    StartFacts,
)
from fsoe_net.model.joined_descriptions import fill_devices, has_layout, idle_types, join_buses


def bare(made: DescribedSubDevice, **changes) -> DescribedSubDevice:
    """The SubDevice without its process data."""
    known = replace(made.device, sync_managers=(), sdos=())
    return replace(made, device=known, **changes)


def without_layouts(made: Description) -> Description:
    return replace(made, subdevices=tuple(bare(s) for s in made.subdevices), copies=())


def test_layouts_and_copies_come_from_who_has_them():
    made = bus(2)
    shuffled = replace(
        made, subdevices=tuple(reversed(without_layouts(made).subdevices)), copies=()
    )
    notes: list[str] = []
    joined = join_buses([shuffled, made], notes)
    assert notes == []
    assert [s.position for s in joined.subdevices] == [2, 1, 0]
    assert [s.device for s in joined.subdevices] == [s.device for s in reversed(made.subdevices)]
    places = [(joined.subdevices[c.source.subdevice].position, c.bits) for c in joined.copies]
    assert places == [(c.source.subdevice, c.bits) for c in made.copies]


def test_more_places_are_added_and_connections_follow():
    made = bus(1)
    first = replace(made, subdevices=made.subdevices[:1], copies=())
    other = replace(made, connections=(DescribedConnection(main=0, sub=1),), copies=())
    joined = join_buses([first, other], [])
    assert [s.position for s in joined.subdevices] == [0, 1]
    assert [(c.main, c.sub) for c in joined.connections] == [(0, 1)]


def test_the_first_one_leads_and_the_rest_is_reported():
    made = replace(bus(1), connections=(DescribedConnection(main=0, sub=1),))
    again = replace(made, path="b", cycle_us=7)
    notes: list[str] = []
    joined = join_buses([made, again], notes)
    assert joined == made
    assert [n.split(":")[0] for n in notes] == ["b", "b"]


def test_parts_without_a_place_are_left_out_and_reported():
    made = bus(1)
    nowhere = replace(
        made,
        path="b",
        subdevices=tuple(replace(s, position=None) for s in made.subdevices),
        connections=(DescribedConnection(main=0, sub=1),),
    )
    notes: list[str] = []
    joined = join_buses([replace(made, copies=()), nowhere], notes)
    assert len(joined.subdevices) == 2
    assert joined.copies == ()
    assert joined.connections == ()
    assert len(notes) == 4  # two SubDevices, the copies, the connection


@pytest.mark.parametrize("key", ["vendor_id", "product_code"])
def test_contradictions_are_refused(key: str):
    made = bus(1)
    changed = replace(made.subdevices[1], device=replace(made.subdevices[1].device, **{key: 99}))
    other = replace(made, subdevices=(made.subdevices[0], changed))
    with pytest.raises(InputError, match="are these files of one bus"):
        join_buses([made, other], [])


def test_a_place_by_alias_is_not_one_by_position():
    one = DescribedSubDevice(name="a", position=5, device=device(1, 2, 1))
    two = DescribedSubDevice(name="b", alias=5, device=device(3, 4, 1))
    rows = [Description(format="t", path="", subdevices=(s,)) for s in (one, two)]
    assert join_buses(rows, []).subdevices == (one, two)


def _knowing(made: Description, n: int) -> Iterator[tuple[str, Description]]:
    """Yield the bus with one SubDevice that knows more or less of itself."""
    known = made.subdevices[n]
    sdo = Sdo(index=0x1C12, subindex=0, size_bytes=1, value=0)
    start = StartFacts()
    others = {
        "as it is": {},
        "nameless": {"name": "", "order": "X1"},
        "a number": {"name": "7", "order": "X2"},
        "no name": {"name": "", "order": ""},
        "revision": {"revision": 5},
        "serial": {"serial": 6, "module_ident": (7,), "start": start},
        "bare": {"device": replace(known.device, sync_managers=(), assign_activate=0x300)},
        "sdos": {"device": replace(known.device, sync_managers=(), sdos=(sdo,))},
        "other vendor": {"device": replace(known.device, vendor_id=99)},
        "other product": {"device": replace(known.device, product_code=98)},
        "no identity": {"device": replace(known.device, vendor_id=0, product_code=0)},
        "no product": {"device": replace(known.device, product_code=0), "order": "x1"},
        "alias": {"alias": 4, "position": None},
        "no place": {"position": None},
    }
    for name, changes in others.items():
        subs = [*made.subdevices]
        subs[n] = replace(known, **changes)
        yield name, replace(made, subdevices=tuple(subs))


SUBDEVICE = attrgetter(
    *["name", "order", "position", "alias", "revision", "serial", "module_ident"],
    *["device.vendor_id", "device.product_code", "device.assign_activate"],
)


def _text(made: Description) -> str:
    rows = [
        (SUBDEVICE(s), s.start is not None, len(s.device.sdos), len(s.device.sync_managers))
        for s in made.subdevices
    ]
    copies = [(c.source.subdevice, c.destination.subdevice, c.bits) for c in made.copies]
    connections = [(c.main, c.sub, c.name) for c in made.connections]
    return f"{rows} {copies} {connections} {made.cycle_us} {made.truncated}"


@pytest.mark.weekly
def test_each_change_of_what_two_descriptions_have() -> None:
    connected = (DescribedConnection(name="c", main=0, sub=1),)
    first = replace(bus(2), path="a.xml", cycle_us=None)
    other = replace(first, path="b.xml", connections=connected, cycle_us=3, truncated=True)
    first = replace(first, copies=())
    rows = []
    for (one, a), (two, b) in product(_knowing(first, 1), _knowing(other, 1)):
        for what, changed in {
            "": b,
            " connected": replace(b, copies=()),
            " fewer": replace(b, subdevices=b.subdevices[:2]),
            " both": replace(b, connections=(*connected, DescribedConnection(main=None, sub=1))),
        }.items():
            lead = replace(a, connections=connected, copies=other.copies) if what == " both" else a
            notes: list[str] = []
            try:
                text = _text(join_buses([lead, changed], notes))
            except (InputError, IndexError) as error:
                text = f"{type(error).__name__} {figures(str(error))}"
            rows.append((f"{one} and {two}{what}", f"{text} {whole(notes)}"))
        notes = []
        ring, kinds = a, [replace(b, path="esi.xml"), replace(other, path="sii.bin")]
        try:
            text = _text(fill_devices(ring, kinds, notes))
            notes += idle_types(ring, kinds)
        except InputError as error:
            text = figures(str(error))
        rows.append((f"{one} of type {two}", f"{text} {whole(notes)}"))
    compare(__file__, "joined", rows)


def types(*rows: DescribedSubDevice) -> Description:
    return Description(format="esi", path="esi.xml", subdevices=rows)


def test_a_type_fills_every_device_of_its_identity():
    made = bus(3)
    terminal = replace(made.subdevices[1], name="", position=None)
    notes: list[str] = []
    filled = fill_devices(without_layouts(made), [types(terminal)], notes)
    assert [has_layout(s.device) for s in filled.subdevices] == [False, True, True, True]
    assert [s.name for s in filled.subdevices] == [s.name for s in made.subdevices]
    assert notes == []


def test_the_same_revision_comes_first_and_another_one_is_reported():
    made = bus(1)
    sub = bare(made.subdevices[1], revision=7)
    old = replace(made.subdevices[1], revision=6, position=None)
    new = replace(old, revision=7, device=replace(old.device, assign_activate=0x300))
    one = Description(format="t", path="", subdevices=(sub,))
    notes: list[str] = []
    assert fill_devices(one, [types(old, new)], notes).subdevices[0].device.assign_activate == 0x300
    assert notes == []
    filled = fill_devices(one, [types(old)], notes).subdevices[0]
    assert filled.revision == 7
    assert "revision 0x00000007 is not in esi.xml" in notes[0]


def test_known_process_data_stay_and_unused_types_are_reported():
    made = bus(1)
    other = replace(
        made.subdevices[1], name="", order="X1", device=Device(path="", vendor_id=9, product_code=9)
    )
    notes: list[str] = []
    assert fill_devices(made, [types(other)], notes) == made
    assert notes == []
    assert idle_types(made, [types(other)]) == ["esi.xml: no SubDevice is a X1; it is left out"]


def test_a_description_without_any_place_is_of_device_types():
    placed = bus(2)
    assert not placed.placeless
    assert not placed.without_positions().placeless  # it still has copies
    types = replace(placed.without_positions(), copies=(), connections=())
    assert types.placeless
    assert {s.position for s in types.subdevices} == {None}
    first, *rest = types.subdevices
    assert not replace(types, subdevices=(replace(first, alias=7), *rest)).placeless
    assert not replace(types, connections=(DescribedConnection(),)).placeless
