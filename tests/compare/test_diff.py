"""What differs is said once, by what it means; what does not differ is not said."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from described import bus
from networks import PLAIN, example, resolved
from scans import scan_of

from fsoe_net.compare.diff import Difference, compare
from fsoe_net.compare.sides import (
    Side,
    side_of_description,
    side_of_network,
    side_of_plan,
    side_of_scan,
)
from fsoe_net.formats.eni.read import load_eni
from fsoe_net.formats.eni.write import write_eni
from fsoe_net.formats.own.scan import parse_scan
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.bus import Direction, Watchdog
from fsoe_net.model.description import Description
from fsoe_net.plan.compile import compile_plan

MIRROR = {"added": "removed", "removed": "added"}


def rows(difference: Difference) -> list[tuple[str, str, str]]:
    return [(c.kind, c.area, c.what) for c in difference.changes]


def network(folder: Path) -> Side:
    return side_of_network(resolved(folder / "network.yaml"), "network.yaml")


def scanned(document: dict[str, object]) -> Side:
    scan, found = parse_scan(json.dumps(document).encode(), "scan.json")
    assert scan is not None, found
    return side_of_scan(scan, "scan.json")


def described(description: Description) -> Side:
    return side_of_description(description)


@pytest.fixture
def copied(tmp_path: Path):
    def make(name: str) -> Path:
        return Path(shutil.copytree(PLAIN / name, tmp_path / name))

    return make


@pytest.mark.shows("R27")
@pytest.mark.parametrize("name", ["estop", "el6910"])
def test_a_network_is_the_same_as_itself_and_as_its_plan(name):
    side = side_of_network(example(name), "a")
    plan = side_of_plan(compile_plan(example(name)), "b")
    for left, right in ((side, side), (side, plan), (plan, side), (plan, plan)):
        difference = compare(left, right)
        assert difference.same, difference.changes
        assert difference.not_compared == ()


@pytest.mark.parametrize("name", ["estop", "el6910"])
def test_a_network_is_the_same_as_the_scan_of_its_bus(name):
    resolution = example(name)
    document = scan_of(resolution)
    difference = compare(side_of_network(resolution, "a"), scanned(document))
    couplers = len(document["subdevices"]) - len(resolution.network.subdevices)
    assert rows(difference) == [("added", "subdevice", "")] * couplers
    assert [w.split(":")[0] for w in difference.not_compared] == [
        "copies",
        "FSoE connections",
        "the bus cycle",
    ]


def test_a_description_is_the_same_as_the_eni_written_from_it():
    description = bus(7)
    out = Collector()
    again = load_eni(write_eni(description).encode(), out)
    difference = compare(described(description), described(again))
    assert difference.same, difference.changes


ESTOP_CHANGES = [
    ("network.yaml", "cycle_us: 1000", "cycle_us: 500", [("changed", "network", "cycle_ns")]),
    ("network.yaml", "address: 14", "address: 15", [("changed", "connection", "address")]),
    ("network.yaml", "connection_id: 1", "connection_id: 2",
     [("changed", "connection", "connection_id")]),
    ("network.yaml", "watchdog_ms: 100", "watchdog_ms: 200",
     [("changed", "connection", "watchdog_ms")]),
    ("network.yaml", ", watchdog_ms: 100", "", [("changed", "connection", "watchdog_ms")]),
    ("network.yaml", "{name: ek1914, position: 0", "{name: ek1914, position: 2",
     [("moved", "subdevice", "position")]),
    ("network.yaml", "{name: ek1914, position: 0", "{name: ek1914, revision: 0x120000, position: 0",
     [("changed", "subdevice", "revision")]),
    ("network.yaml", "{name: ek1914, position: 0", "{name: ek1914, alias: 7, position: 0",
     [("changed", "subdevice", "alias")]),
    ("network.yaml", "name: safety_net", "name: other_net",
     [("changed", "copy", "net"), ("changed", "copy", "net")]),
    ("devices/el1918.yaml", "0x077e3052", "0x077e3053", [("exchanged", "subdevice", "")]),
]  # fmt: skip


@pytest.mark.shows("R27")
@pytest.mark.parametrize(("file", "old", "new", "expected"), ESTOP_CHANGES)
def test_one_change_of_a_network_is_one_difference(copied, file, old, new, expected):
    before = network(PLAIN / "estop")
    folder = copied("estop")
    text = (folder / file).read_text("utf-8")
    assert text.lower().count(old.lower()) == 1
    at = text.lower().index(old.lower())
    (folder / file).write_text(text[:at] + new + text[at + len(old) :], "utf-8")
    after = network(folder)
    assert rows(compare(before, after)) == expected
    back = compare(after, before)
    assert rows(back) == [(MIRROR.get(k, k), a, w) for k, a, w in expected]


@pytest.mark.parametrize("as_plan", [False, True])
def test_the_cycle_of_the_second_bus_is_compared(tmp_path: Path, as_plan: bool):
    shutil.copytree(PLAIN, tmp_path, dirs_exist_ok=True)
    file = tmp_path / "two-buses" / "network.yaml"
    file.write_text(file.read_text("utf-8").replace("cycle_us: 2000", "cycle_us: 4000"), "utf-8")
    sides = []
    for resolution in (example("two-buses"), resolved(file)):
        side = side_of_network(resolution, "n")
        sides.append(side_of_plan(compile_plan(resolution), "p") if as_plan else side)
    (change,) = compare(*sides).changes
    assert (change.area, change.where, change.what) == ("network", "bus drives", "cycle_ns")
    assert (change.before, change.after) == (2_000_000, 4_000_000)


TRANSFERS = (PLAIN / "estop" / "transfers.yaml").read_text("utf-8")


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("size: 6 ", "size: 7 ", [("changed", "copy", "size")]),
        ("ec_module: ek1914, index: 0x6000", "ec_module: ek1914, index: 0x6010",
         [("changed", "copy", "source")]),
        ("connection_id: 1", "connection_id: 3", [("changed", "connection", "connection_id")]),
        ("      - {main: el1918, sub: ek1914, address: 14, connection_id: 1, watchdog_ms: 100}", "",
         [("removed", "connection", "")]),
        ("watchdog_ms: 100", "watchdog_ms: 100, app_parameters: \"01\"",
         [("changed", "connection", "app_parameters")]),
    ],
)  # fmt: skip
def test_transfers_without_their_subdevices_are_compared_too(tmp_path, old, new, expected):
    sides = []
    for number, text in enumerate((TRANSFERS, TRANSFERS.replace(old, new, 1))):
        file = tmp_path / f"{number}.yaml"
        file.write_text(text, "utf-8")
        sides.append(side_of_network(resolved(file), file.name))
    assert old in TRANSFERS
    assert rows(compare(sides[0], sides[0])) == []
    assert rows(compare(*sides)) == expected


def manager(side: Side, name: str, index: int, **values: object) -> Side:
    """Return the side with facts of one sync manager changed."""
    subs = list(side.subdevices)
    n = next(n for n, s in enumerate(subs) if s.name == name)
    managers = dict(subs[n].managers)
    managers[index] = replace(managers[index], **values)
    subs[n] = replace(subs[n], managers=managers)
    return replace(side, subdevices=tuple(subs))


def test_facts_of_a_sync_manager():
    side = side_of_network(example("estop"), "a")
    ek = side.subdevices[0].managers[3]
    first, *rest = ek.placed
    frame = ek.blocks[0]
    shorter = replace(first, entry=replace(first.entry, bits=4))
    relevant = replace(first, entry=replace(first.entry, restart_relevant=True))
    for values, expected in (
        ({"sm": replace(ek.sm, direction=Direction.OUTPUT)},
         ("changed", "sync_manager", "direction")),
        ({"sm": replace(ek.sm, watchdog=Watchdog.ENABLE)},
         ("changed", "sync_manager", "watchdog")),
        ({"bits": ek.bits + 3}, ("changed", "sync_manager", "size")),
        ({"blocks": ()}, ("removed", "frame", "")),
        ({"blocks": (replace(frame, frame_bytes=7),)}, ("changed", "frame", "frame_bytes")),
        ({"blocks": (replace(frame, byte_offset=1),)}, ("moved", "frame", "byte")),
        ({"placed": (shorter, *rest)}, ("changed", "entries", "bits")),
        ({"placed": (relevant, *rest)}, ("changed", "entries", "restart_relevant")),
        ({"placed": tuple(rest)}, ("removed", "entries", "")),
        ({"placed": (*ek.placed, replace(first, bit_offset=200))}, ("added", "entries", "")),
    ):  # fmt: skip
        other = manager(side, "ek1914", 3, **values)
        found = rows(compare(side, other))
        if "blocks" in values and expected[0] == "moved":
            assert found[0] == expected
        else:
            assert found == [expected]


def test_a_sync_manager_that_came():
    side = side_of_network(example("estop"), "a")
    sub = side.subdevices[0]
    fewer = replace(sub, managers={2: sub.managers[2]})
    other = replace(side, subdevices=(fewer, *side.subdevices[1:]))
    difference = compare(other, side)
    assert rows(difference) == [("added", "sync_manager", "")]
    assert difference.changes[0].after == "8 bytes"


def test_start_up_sdos():
    side = side_of_network(example("estop"), "a")
    first, second = ({(0x8000, 1): (2, 7), (0x8000, 2): (1, 1)}, {(0x8000, 1): (2, 9)})
    sides = [
        replace(side, subdevices=(replace(side.subdevices[0], sdos=s), *side.subdevices[1:]))
        for s in (first, second)
    ]
    found = compare(*sides).changes
    assert [(c.kind, c.what, c.before, c.after) for c in found] == [
        ("changed", "0x8000:01", "7 (2 bytes)", "9 (2 bytes)"),
        ("removed", "0x8000:02", "1 (1 bytes)", None),
    ]


def test_kind_and_size_of_a_copy():
    side = side_of_network(example("estop"), "a")
    for values, what in (({"kind": "standard"}, "kind"), ({"bits": 56}, "size")):
        other = replace(side, copies=(replace(side.copies[0], **values), *side.copies[1:]))
        assert rows(compare(side, other)) == [("changed", "copy", what)]


def test_unnamed_devices_are_paired_by_identity_and_order_and_then_by_place():
    side = described(bus(4))
    bare = replace(
        side, subdevices=tuple(replace(s, name="") for s in side.subdevices), copies=None
    )
    front = bare.subdevices[:1]
    shorter = replace(
        bare,
        subdevices=front
        + tuple(replace(s, position=n) for n, s in enumerate(bare.subdevices[2:], start=1)),
    )
    assert rows(compare(bare, shorter)) == [("removed", "subdevice", "")]
    other = replace(bare.subdevices[2], identity=(2, 0x0B583052))
    exchanged = replace(bare, subdevices=(*bare.subdevices[:2], other, *bare.subdevices[3:]))
    assert rows(compare(bare, exchanged)) == [("exchanged", "subdevice", "")]


def test_a_device_gone_from_the_middle_is_not_an_exchange_of_all_after_it():
    side = described(bus(2))
    logic, first, second = (replace(s, name="", managers=None) for s in side.subdevices)
    second = replace(second, identity=(2, 0x0B583052))
    three = replace(side, subdevices=(logic, first, second), copies=None)
    two = replace(three, subdevices=(logic, replace(second, position=1)))
    assert rows(compare(three, two)) == [
        ("removed", "subdevice", ""),
        ("moved", "subdevice", "position"),
    ]


def test_a_connection_with_another_main_instance_is_the_same_by_its_address():
    side = side_of_network(example("el6910"), "a")
    first = side.connections[0]
    changed = replace(first, main=first.sub, connection_id=999)
    other = replace(side, connections=(changed, *side.connections[1:]))
    assert rows(compare(side, other)) == [
        ("changed", "connection", "main"),
        ("changed", "connection", "connection_id"),
    ]


def test_data_in_front_of_a_frame_move_it_and_what_is_after(copied):
    folder = copied("estop")
    file = folder / "devices" / "ek1914.yaml"
    text = file.read_text("utf-8")
    new = "  - index: 0x1a05\n    channels:\n      - {index: 0x6100, sub_index: 1, type: uint16}\n"
    file.write_text(text.replace("  - index: 0x1a00", new + "  - index: 0x1a00", 1), "utf-8")
    found = compare(network(PLAIN / "estop"), network(folder)).changes
    size, frame, moved, added = found
    assert (size.area, size.before, size.after) == ("sync_manager", "8 bytes", "10 bytes")
    assert (frame.area, frame.where, frame.before, frame.after) == (
        "frame", "ek1914 SM3 0x6000:01", 0, 2,
    )  # fmt: skip
    assert (moved.kind, moved.after) == ("moved", "+16 bits")
    assert set(moved.entries) == {f"0x6010:0{n}" for n in range(1, 5)}  # not those of the frame
    assert (added.kind, added.entries) == ("added", ("0x6100:01",))


def test_a_removed_subdevice_takes_its_copies_and_connection_along():
    side = side_of_network(example("el6910"), "a")
    gone = next(n for n, s in enumerate(side.subdevices) if s.name == "el2904")
    kept = [n for n in range(len(side.subdevices)) if n != gone]
    number = {old: new for new, old in enumerate(kept)}
    other = replace(
        side,
        subdevices=tuple(side.subdevices[n] for n in kept),
        copies=tuple(
            replace(
                c,
                source=replace(c.source, subdevice=number[c.source.subdevice]),
                destination=replace(c.destination, subdevice=number[c.destination.subdevice]),
            )
            for c in side.copies
            if gone not in (c.source.subdevice, c.destination.subdevice)
        ),
        connections=tuple(
            replace(c, main=number[c.main], sub=number[c.sub])
            for c in side.connections
            if gone not in (c.main, c.sub)
        ),
    )
    expected = ["subdevice", "copy", "copy", "connection"]
    assert rows(compare(side, other)) == [("removed", area, "") for area in expected]
    assert rows(compare(other, side)) == [("added", area, "") for area in expected]


def test_exchanged_wires_of_two_equal_devices_are_seen():
    side = side_of_network(example("el6910"), "a")
    one, two = (
        next(n for n, s in enumerate(side.subdevices) if s.name == f"drive_{k}") for k in (1, 2)
    )
    swap = {one: two, two: one}
    other = replace(
        side,
        copies=tuple(
            replace(c, source=replace(c.source, subdevice=swap[c.source.subdevice]))
            if c.source.subdevice in swap
            else c
            for c in side.copies
        ),
    )
    difference = compare(side, other)
    assert rows(difference) == [("changed", "copy", "source")] * 2
    assert {c.before.split()[0] for c in difference.changes} == {"drive_1", "drive_2"}


def test_names_of_another_tool_are_not_difference():
    side = described(bus(5))
    other = replace(
        side, subdevices=tuple(replace(s, name=f"Box {n}") for n, s in enumerate(side.subdevices))
    )
    assert compare(side, other).same


def test_unread_parts_are_not_compared_and_reported():
    resolution = example("estop")
    document = scan_of(resolution)
    document["subdevices"][0]["sms"] = None
    del document["subdevices"][0]["sms"]
    difference = compare(side_of_network(resolution, "a"), scanned(document))
    assert difference.same
    assert "process data of SubDevices that one side does not know: 1" in difference.not_compared


def test_another_fsoe_address_on_the_bus_is_a_difference():
    resolution = example("estop")
    document = scan_of(resolution)
    document["subdevices"][0]["fsoe"]["address"] = 99
    difference = compare(side_of_network(resolution, "a"), scanned(document))
    assert rows(difference) == [("changed", "subdevice", "fsoe_addresses")]
    assert (difference.changes[0].before, difference.changes[0].after) == ("14", "99")
