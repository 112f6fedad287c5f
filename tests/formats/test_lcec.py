"""linuxcnc-ethercat XML: written, read back, compared."""

from __future__ import annotations

from dataclasses import replace

import pytest
from described import bus, copy, described_devices, entry
from hypothesis import given, settings
from networks import example
from weekly import examples

from fsoe_net.errors import InputError
from fsoe_net.formats.lcec.read import load_lcec
from fsoe_net.formats.lcec.write import write_lcec
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.writers import Written
from fsoe_net.model.bus import Device, Direction, Pdo, SyncManager
from fsoe_net.model.described_network import describe
from fsoe_net.model.description import DescribedConnection, DescribedSubDevice, Description


def back(written: Written) -> Description:
    out = Collector()
    found = load_lcec(written.files["ethercat-conf.xml"].encode(), out)
    assert [(d.code, d.message) for d in out.diagnostics] == []
    assert found is not None
    return found


def content(device: Device) -> list[object]:
    """Identity and layout, as far as this format has them."""
    managers = [
        (
            sm.index,
            sm.direction,
            [
                (p.index, [(e.index, e.subindex, e.bits) for e in p.entries])
                for p in device.pdos_of(sm)
            ],
        )
        for sm in sorted(device.sync_managers, key=lambda s: s.index)
        if sm.index > 1 or device.pdos_of(sm)
    ]
    sdos = [(s.index, s.subindex, s.size_bytes, s.value) for s in device.sdos]
    return [device.vendor_id, device.product_code, device.assign_activate, managers, sdos]


def test_a_network_comes_back():
    network = describe(example("el6910").network)
    written = write_lcec(network)
    found = back(written)
    assert found.cycle_us == 1000
    assert [(s.name, s.position) for s in found.subdevices] == [
        (s.name, s.position) for s in network.subdevices
    ]
    assert [(c.main, c.sub, c.slot) for c in found.connections] == [
        (0, 1, 0),
        (0, 2, 1),
        (0, 3, 2),
        (0, 4, 3),
    ]
    # The driver knows the two terminals by type; the rest is generic, and its user is told.
    assert [s.order for s in found.subdevices] == ["", "EL1904", "EL2904", "", ""]
    for number in (0, 3, 4):
        assert content(found.subdevices[number].device) == content(
            network.subdevices[number].device
        )
    assert any(n.startswith("drive_1: linuxcnc-ethercat has no FSoE") for n in written.notes)
    assert "el1904: its PDOs are those that the driver has for EL1904" in written.notes
    assert back(write_lcec(found)).connections == found.connections


def test_types_the_driver_has_stay_types():
    logic = back(write_lcec(describe(example("estop").network))).subdevices[1]
    assert logic.order == "EL1918_LOGIC"
    source = b'<masters><master><slave idx="0" type="EK1100" name="a"/></master></masters>'
    found = load_lcec(source, Collector())
    assert found is not None
    assert back(write_lcec(found)).subdevices[0].order == "EK1100"


def test_slots_follow_the_place_in_the_logic_not_the_order_of_the_copies():
    made = bus(3)
    turned = replace(made, copies=tuple(reversed(made.copies)))
    assert [c.sub for c in back(write_lcec(turned)).connections] == [1, 2, 3]


def test_no_connection_is_guessed():
    written = write_lcec(bus(1))
    assert back(written).connections == ()
    assert any("MainInstance is not known" in n for n in written.notes)
    known = replace(bus(1), connections=(DescribedConnection(main=0, sub=1, watchdog_ms=5),))
    written = write_lcec(known)
    assert [(c.main, c.sub) for c in back(written).connections] == [(0, 1)]
    assert "addresses and watchdogs of connections are not in this file" in written.notes


def test_other_data_are_reported():
    made = bus(2)
    more = replace(made, copies=(*made.copies, copy((0, 3, 96), (1, 2, 48), 8)))
    assert any("other data" in n for n in write_lcec(more).notes)


def test_positions_are_needed():
    made = bus(1)
    first = replace(made.subdevices[0], position=None)
    with pytest.raises(InputError, match="no ring position"):
        write_lcec(replace(made, subdevices=(first, made.subdevices[1])))
    first = replace(made.subdevices[0], position=1)
    with pytest.raises(InputError, match="at ring position 1 is logic"):
        write_lcec(replace(made, subdevices=(first, made.subdevices[1])))


def test_hal_pins_are_named_once():
    rows = (entry(0x7000, 1, 8, 'a<&"'), entry(0x7000, 2, 8, 'a<&"'), entry(0, 0, 300))
    sm = SyncManager(
        index=2,
        direction=Direction.OUTPUT,
        pdos=(Pdo(index=0x1600, entries=rows),),
    )
    made = Device(path="", vendor_id=1, product_code=2, sync_managers=(sm,))
    sub = DescribedSubDevice(name="x", position=0, device=made)
    found = back(write_lcec(Description(format="t", path="", subdevices=(sub,))))
    pdo = found.subdevices[0].device.sync_managers[0].pdos
    assert pdo is not None
    assert [(e.name, e.bits) for e in pdo[0].entries] == [
        ('a<&"', 8),
        ('a<&"_2', 8),
        ("", 255),
        ("", 45),
    ]


@settings(max_examples=examples(60), deadline=None)
@given(described_devices())
def test_any_device_comes_back(sub: DescribedSubDevice):
    one = Description(format="t", path="", subdevices=(replace(sub, position=7),))
    found = back(write_lcec(one)).subdevices[0]
    assert found.position == 7
    assert content(found.device) == content(sub.device)
