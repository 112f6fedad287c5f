"""YAML for the driver and for this tool: written, read back, compared."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from described import bus, copy, described_devices, device, entry
from hypothesis import given, settings
from networks import EXAMPLES, example
from weekly import examples

from fsoe_net.errors import InputError
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.slave_yaml import device_from_yaml
from fsoe_net.formats.own.write import write_network
from fsoe_net.formats.own.write_slave_yaml import write_slave_yaml
from fsoe_net.formats.ros2.write import write_driver
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.writers import Written
from fsoe_net.formats.shared.yaml_tree import parse_yaml
from fsoe_net.model.bus import Device, Direction, Pdo, Sdo, SyncManager
from fsoe_net.model.described_network import describe
from fsoe_net.model.description import DescribedConnection, DescribedSubDevice, Description


def put(written: Written, folder: Path) -> None:
    for name, text in written.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")


def back(written: Written, folder: Path) -> Description:
    put(written, folder)
    main = next(n for n in written.files if "/" not in n)
    loaded = load_network([folder / main])
    bad = [d for d in loaded.diagnostics if d.code not in ("FSN126", "FSN201")]
    assert bad == []
    assert loaded.network is not None
    assert not loaded.network.partial
    return describe(loaded.network)


def facts(device: Device) -> object:
    """What a slave YAML holds, by value."""
    sdos = [
        (s.index, s.subindex, s.size_bytes, s.value % 2 ** (8 * s.size_bytes)) for s in device.sdos
    ]
    managers = [
        (
            sm.index,
            sm.direction,
            sm.watchdog,
            [
                (p.index, [(e.index, e.subindex, e.bits) for e in p.entries])
                for p in device.pdos_of(sm)
            ],
        )
        for sm in device.sync_managers
    ]
    return device.vendor_id, device.product_code, device.assign_activate, sdos, managers


def rows(description: Description) -> list[object]:
    subs = [(s.name, s.position, s.alias, facts(s.device)) for s in description.subdevices]
    copies = [(c.source, c.destination, c.bits, c.fsoe) for c in description.copies]
    return [subs, copies, list(description.connections)]


@pytest.mark.parametrize("name", ["estop", "el6910"])
def test_an_example_comes_back_as_it_was(name: str, tmp_path: Path):
    network = describe(example(name).network)
    written = write_network(network, name="cell")
    found = back(written, tmp_path)
    assert written.notes == ()
    assert rows(found) == rows(network)
    assert found.cycle_us == network.cycle_us
    assert "name: cell" in written.files["network.yaml"]


@pytest.mark.parametrize("version", ["2025", "2026-06", "2026-08", "newest"])
def test_driver_files_come_back_without_the_cycle(version: str, tmp_path: Path):
    network = describe(example("el6910").network)
    written = write_driver(network, version=version)
    assert rows(back(written, tmp_path)) == rows(network)
    text = written.files["transfers.yaml"]
    word = "safety" if version == "2025" else "transfer"
    assert f"\n    {word}_master: el6910\n" in text
    assert f"{word}_modules:" in text
    assert any("control_frequency to 1000" in n for n in written.notes)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*/devices/*.yaml")), ids=lambda p: p.name)
def test_a_slave_yaml_keeps_every_key(path: Path):
    first = parse(path.read_text("utf-8"))
    notes: list[str] = []
    assert parse(write_slave_yaml(first, "x", notes)) == replace(first, path="x.yaml")
    assert notes == []


def parse(text: str) -> Device:
    out = Collector()
    root = parse_yaml(text.encode(), "x.yaml", out)
    assert root is not None
    made = device_from_yaml(root, "x.yaml", out)
    assert [d for d in out.diagnostics if d.code != "FSN423"] == []
    assert made is not None
    return made


GROUPS = """\
vendor_id: 1
product_id: 2
rpdo:
  - index: 0x1600
    channels:
      - index: 0x7000
        sub_index: 1
        type: bit24
        data_mapping:
          - {addr_offset: 0, type: bool, mask: 4, command_interface: a, default_value: 1.0}
          - {addr_offset: 1, type: uint16, state_interface: "no", factor: 0.5, offset: -1.5}
      - {index: 0x7001, sub_index: 2, type: float, default: .5, mask: 7, skip: true, name: "ü: x"}
sm:
  - {index: 2, type: output, pdo: rpdo}
"""


def test_groups_scales_and_masks_come_back():
    first = parse(GROUPS)
    assert parse(write_slave_yaml(first, "x", [])) == first


def test_copies_require_a_bus(tmp_path: Path):
    wanted = bus(5)
    written = write_network(wanted)
    found = back(written, tmp_path)
    ends = [(c.source, c.destination, c.bits) for c in found.copies]
    assert ends == [(c.source, c.destination, c.bits) for c in wanted.copies]
    assert all(c.fsoe for c in found.copies)
    assert [s.name for s in found.subdevices] == [s.name for s in wanted.subdevices]
    assert "safety_master: logic" in written.files["network.yaml"]
    # five terminals of one type share a file
    assert len(written.files) == 3


@pytest.mark.shows("R22")
def test_the_main_instance_is_never_guessed(tmp_path: Path):
    two = bus(1)
    written = write_network(two)
    assert "safety_master" not in written.files["network.yaml"]
    assert any("MainInstance is not known" in n for n in written.notes)
    known = replace(two, connections=(DescribedConnection(main=0, sub=1, address=3),))
    text = write_network(known).files["network.yaml"]
    assert "safety_master: logic" in text
    assert 'main: logic, sub: "terminal 0 <ä> & co", address: 3' in text


def test_data_that_are_not_frame_are_written_as_such(tmp_path: Path):
    made = bus(1)
    plain = replace(made, copies=(*made.copies, copy((0, 3, 48), (1, 2, 48), 8)))
    found = back(write_network(plain), tmp_path)
    assert [c.fsoe for c in found.copies] == [True, True, False]


def test_names_are_made_unique():
    made = device(1, 2, 0)
    subs = [
        DescribedSubDevice(name=n, position=i, device=made) for i, n in enumerate(["a", "a", ""])
    ]
    written = write_network(Description(format="t", path="", subdevices=tuple(subs)))
    assert [
        n
        for n in ("name: a,", "name: a_2,", "name: subdevice_2,")
        if n in written.files["network.yaml"]
    ] == ["name: a,", "name: a_2,", "name: subdevice_2,"]


# -- what does not fit ----------------------------------------------------------------------------


def described(*managers: SyncManager, copies=()) -> Description:
    made = Device(path="", vendor_id=1, product_code=2, sync_managers=managers)
    sub = DescribedSubDevice(name="a", position=0, device=made)
    return Description(
        format="t", path="", subdevices=(sub, replace(sub, name="b", position=1)), copies=copies
    )


def output(index: int, *entries) -> SyncManager:
    pdo = Pdo(index=0x1600 + index, entries=entries)
    return SyncManager(index=index, direction=Direction.OUTPUT, pdos=(pdo,))


def source(index: int, *entries) -> SyncManager:
    pdo = Pdo(index=0x1A00 + index, entries=entries)
    return SyncManager(index=index, direction=Direction.INPUT, pdos=(pdo,))


def test_a_second_output_sync_manager_is_reported():
    both = described(output(2, entry(0x7000, 1, 8)), output(4, entry(0x7001, 1, 8)))
    written = write_network(both)
    assert any("PDOs of Sm4 are left out" in n for n in written.notes)
    assert "0x7001" not in "".join(written.files.values())


def test_the_sync_manager_a_copy_uses_is_kept():
    managers = (
        output(2, entry(0x7000, 1, 8)),
        output(4, entry(0x7001, 1, 8)),
        source(3, entry(0x6000, 1, 8)),
    )
    written = write_network(described(*managers, copies=(copy((0, 3, 0), (1, 4, 0), 8),)))
    assert "0x7001" in written.files["devices/b.yaml"]
    both = (copy((0, 3, 0), (1, 4, 0), 8), copy((0, 3, 0), (1, 2, 0), 8))
    with pytest.raises(InputError, match="copies use Sm2 and Sm4"):
        write_network(described(*managers, copies=both))


@pytest.mark.parametrize(
    ("entries", "bit", "why"),
    [
        ((entry(0x7000, 1, 16),), 8, "not the begin of an entry"),
        ((entry(0, 0, 8),), 0, "padding"),
        ((entry(0x7000, 1, 8), entry(0x7000, 1, 8)), 8, "a second time"),
    ],
)
def test_a_copy_without_an_address_is_refused(entries, bit: int, why: str):
    managers = (output(2, *entries), source(3, entry(0x6000, 1, 8)))
    with pytest.raises(InputError, match=why):
        write_network(described(*managers, copies=(copy((0, 3, 0), (1, 2, bit), 8),)))


def test_part_of_a_byte_is_refused():
    managers = (output(2, entry(0x7000, 1, 8)), source(3, entry(0x6000, 1, 8)))
    with pytest.raises(InputError, match="whole bytes"):
        write_network(described(*managers, copies=(copy((0, 3, 0), (1, 2, 0), 4),)))


def test_long_padding_is_split_and_a_long_entry_is_rejected():
    gap = write_network(described(output(2, entry(0, 0, 300))))
    assert parse(gap.files["devices/a.yaml"]).rpdos[0].bits == 300
    with pytest.raises(InputError, match="300 bits"):
        write_network(described(output(2, entry(0x7000, 1, 300))))


def test_an_sdo_value_the_driver_cannot_read_is_reported():
    made = device(1, 2, 0, (Sdo(index=0x8000, subindex=1, size_bytes=8, value=2**40),))
    notes: list[str] = []
    write_slave_yaml(made, "a", notes)
    assert notes == [
        "a: SDO 0x8000:01 has a value that the driver cannot read; it takes 32 bits with a sign"
    ]


@pytest.mark.shows("R22")
@settings(max_examples=examples(60), deadline=None)
@given(described_devices())
def test_any_device_comes_back(sub: DescribedSubDevice):
    notes: list[str] = []
    text = write_slave_yaml(sub.device, "x", notes)
    out = Collector()
    root = parse_yaml(text.encode(), "x.yaml", out)
    assert root is not None
    found = device_from_yaml(root, "x.yaml", out)
    assert found is not None
    if not any("left out" in n for n in notes) and sub.device.sync_managers:
        assert facts(found) == facts(sub.device)
