"""Connections as shorthand: they become the transfers people would write, or say why not."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from networks import example, resolved
from weekly import examples

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.own.write import write_network
from fsoe_net.model.bus import Device, Direction, Entry, Pdo, SubDevice, SyncManager
from fsoe_net.model.described_network import describe
from fsoe_net.model.expand import Obstacle
from fsoe_net.model.network import ConnectionFacts, Endpoint, Net, NetworkConfig, Transfer
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.plan.compile import compile_plan
from fsoe_net.project.check import check_files

BASE = Path(__file__).parents[1] / "diagnostics" / "base"


def shortened(resolution: Resolution) -> NetworkConfig:
    """The same network without its FSoE transfers: connections with slots instead."""
    nets = []
    for net in resolution.network.nets:
        ours = [c for c in resolution.connections if c.net is net]
        moved = {id(row.transfer) for c in ours for row in (c.to_sub, c.to_main)}
        stated = tuple(
            replace(
                c.facts or ConnectionFacts(main=c.main.name, sub=c.sub.name),
                slot=c.slot,
                sub_slot=c.sub_slot,
            )
            for c in ours
        )
        left = tuple(t for t in net.transfers if id(t) not in moved)
        nets.append(replace(net, transfers=left, connections=stated))
    return replace(resolution.network, nets=tuple(nets))


@pytest.mark.parametrize("name", ["estop", "el6910", "base"])
def test_plans_of_both_forms_are_equal(name: str):
    long = resolved(BASE / "network.yaml") if name == "base" else example(name)
    short = resolve(shortened(long))
    assert all(c.made for c in short.connections)
    assert short.troubles == ()
    assert compile_plan(short).to_bytes() == compile_plan(long).to_bytes()


def test_the_order_of_connections_is_nobodys_slot():
    long = example("el6910")
    network = shortened(long)
    (net,) = network.nets
    turned = replace(network, nets=(replace(net, connections=net.connections[::-1]),))
    copies = compile_plan(resolve(turned)).copies
    assert [c._replace(connection=0) for c in copies] == [
        c._replace(connection=0) for c in compile_plan(long).copies
    ]


def test_expanding_twice_changes_nothing():
    once = resolve(shortened(example("el6910")))
    again = resolve(once.network)
    assert again.network is once.network or again.network == once.network
    assert compile_plan(again) == compile_plan(once)
    assert not any(c.made for c in again.connections)


# -- made-up devices ------------------------------------------------------------------------------


def _frame(command: int, data: int, safe: int) -> tuple[Entry, ...]:
    rows = [Entry(index=command, subindex=1, bits=8)]
    words = 1 if safe == 1 else safe // 2
    for n in range(words):
        bits = 8 if safe == 1 else 16
        rows.append(Entry(index=data, subindex=n + 1, bits=bits))
        rows.append(Entry(index=command, subindex=3 + n, bits=16))
    return (*rows, Entry(index=command, subindex=2, bits=16))


def device(*slots: tuple[int, int], distance: int = 0x1000) -> Device:
    """A device that takes and sends so many safe bytes in each slot."""

    def pdos(base: int, first: int, way: int) -> tuple[Pdo, ...]:
        return tuple(
            Pdo(
                index=base + n,
                entries=_frame(first + 16 * n, first + 0x800 + 16 * n, sizes[way]),
            )
            for n, sizes in enumerate(slots)
        )

    return Device(
        path="",
        vendor_id=2,
        product_code=1,
        sync_managers=(
            SyncManager(
                index=2,
                direction=Direction.OUTPUT,
                pdos=pdos(0x1600, 0x6000 + distance, 0),
            ),
            SyncManager(index=3, direction=Direction.INPUT, pdos=pdos(0x1A00, 0x6000, 1)),
        ),
    )


def bus(devices: dict[str, Device], *connections: ConnectionFacts, **net: object) -> NetworkConfig:
    return NetworkConfig(
        name="n",
        cycle_ns=1_000_000,
        subdevices=tuple(
            SubDevice(name=name, position=n, device=made)
            for n, (name, made) in enumerate(devices.items())
        ),
        nets=(
            Net(
                **{"name": "net", "safety_master": "logic", "transfers": (), **net},
                connections=connections,
            ),
        ),
    )


def facts(sub: str, slot: int | None = None, sub_slot: int | None = None) -> ConnectionFacts:
    return ConnectionFacts(main="logic", sub=sub, slot=slot, sub_slot=sub_slot)


def ends(resolution: Resolution) -> list[tuple[str, str, int]]:
    return [
        (str(r.transfer.source), str(r.transfer.destination), r.transfer.size_bytes)
        for r in resolution.transfers
    ]


def obstacles(network: NetworkConfig) -> list[tuple[Obstacle, str]]:
    return [(t.obstacle, t.key) for t in resolve(network).troubles]


@st.composite
def networks(draw: st.DrawFn) -> tuple[NetworkConfig, NetworkConfig]:
    """The same network twice: with transfers, and with connections alone."""
    safe = st.sampled_from([1, 2, 4, 6, 14])
    sizes = draw(st.lists(st.tuples(safe, safe), min_size=1, max_size=6))
    order = draw(st.permutations(range(len(sizes))))
    per_sub = [order[0:1], order[1:3], order[3:4], order[4:]]
    devices = {"logic": device(*sizes)}
    transfers: list[Transfer] = []
    stated: list[ConnectionFacts] = []
    for number, slots in enumerate(per_sub):
        name = f"sub{number}"
        if not slots:
            continue
        devices[name] = device(*[(sizes[n][1], sizes[n][0]) for n in slots])
        for sub_slot, slot in enumerate(slots):
            for source, there, destination, here, safe_bytes in (
                (name, sub_slot, "logic", slot, sizes[slot][0]),
                ("logic", slot, name, sub_slot, sizes[slot][1]),
            ):
                transfers.append(
                    Transfer(
                        size_bytes=6 if safe_bytes == 1 else 3 + 2 * safe_bytes,
                        source=Endpoint(module=source, index=0x6000 + 16 * there, subindex=1),
                        destination=Endpoint(
                            module=destination, index=0x7000 + 16 * here, subindex=1
                        ),
                    )
                )
            stated.append(facts(name, slot, sub_slot if len(slots) > 1 else None))
    return bus(devices, transfers=tuple(transfers)), bus(devices, *stated)


@settings(max_examples=examples(60), deadline=None)
@given(networks())
def test_any_network_can_be_written_short(both: tuple[NetworkConfig, NetworkConfig]):
    long, short = both
    assert resolve(short).troubles == ()
    assert compile_plan(resolve(short)).to_bytes() == compile_plan(resolve(long)).to_bytes()


TWO = {"logic": device((1, 1), (1, 1), (1, 1), (1, 1)), "left": device((1, 1), (1, 1))}


def test_two_drives_with_two_frame_pairs_each():
    network = bus(
        {**TWO, "right": TWO["left"]},
        facts("left", 0, 1),
        facts("left", 2, 0),
        facts("right", 1, 1),
        facts("right", 3, 0),
    )
    found = resolve(network)
    assert found.troubles == ()
    assert [(c.name, c.slot, c.sub_slot) for c in found.connections] == [
        ("logic-left", 0, 1),
        ("logic-left-2", 2, 0),
        ("logic-right", 1, 1),
        ("logic-right-2", 3, 0),
    ]
    assert ends(found)[:2] == [
        ("left 0x6010:01", "logic 0x7000:01", 6),
        ("logic 0x6000:01", "left 0x7010:01", 6),
    ]


def test_a_subdevice_whose_name_ends_in_a_counter_keeps_names_apart():
    network = bus(
        {**TWO, "left-2": TWO["left"]},
        facts("left", 0, 1),
        facts("left", 2, 0),
        facts("left-2", 1, 1),
    )
    assert [c.name for c in resolve(network).connections] == [
        "logic-left",
        "logic-left-2",
        "logic-left-2-2",
    ]


def test_a_slot_may_be_left_out_when_only_one_is_left():
    network = bus(TWO, facts("left", sub_slot=0), facts("left", 0, 1), facts("left", 9))
    assert obstacles(network) == [(Obstacle.SEVERAL, "main"), (Obstacle.NO_SLOT, "slot")]
    small = {"logic": device((1, 1), (1, 1)), "left": device((1, 1), (1, 1))}
    found = resolve(bus(small, facts("left"), facts("left", 1, 0)))
    assert [(c.slot, c.sub_slot) for c in found.connections] == [(0, 1), (1, 0)]
    assert obstacles(bus(small, facts("left", 0), facts("left", 1))) == [
        (Obstacle.SEVERAL, "sub"),
        (Obstacle.SEVERAL, "sub"),
    ]


def test_sizes_leave_only_one_slot():
    devices = {"logic": device((1, 1), (14, 4)), "drive": device((4, 14))}
    (found,) = resolve(bus(devices, facts("drive"))).connections
    assert (found.slot, found.sub_slot) == (1, 0)
    assert obstacles(bus(devices, facts("drive", 0))) == [(Obstacle.LENGTHS, "slot")]
    turned = {**devices, "drive": device((14, 4))}
    assert obstacles(bus(turned, facts("drive"))) == [(Obstacle.LENGTHS, "main")]


def test_frames_are_used_once():
    devices = {"logic": device((1, 1), (1, 1)), "a": device((1, 1)), "b": device((1, 1))}
    assert obstacles(bus(devices, facts("a", 0), facts("b", 0))) == [(Obstacle.USED, "main")]
    assert obstacles(bus(devices, facts("a", 0), facts("a", 1))) == [(Obstacle.USED, "sub")]
    third = {**devices, "c": device((1, 1))}
    full = bus(third, facts("a", 0), facts("b", 1), facts("c"))
    assert obstacles(full) == [(Obstacle.USED, "main")]
    one, other = bus(devices, facts("a", 0)), bus(devices, facts("a", 0), name="other")
    two = replace(one, nets=one.nets + other.nets)
    assert obstacles(two) == [(Obstacle.USED, "main")]


def test_pdos_in_two_orders_are_not_slot():
    mixed = device((1, 1), (1, 1))
    outputs, inputs = mixed.sync_managers
    mixed = replace(mixed, sync_managers=(outputs, replace(inputs, pdos=inputs.pdos[::-1])))
    assert obstacles(bus({"logic": mixed, "a": device((1, 1))}, facts("a", 0))) == [
        (Obstacle.UNMATCHED, "slot")
    ]


def test_a_frame_in_one_direction_is_not_a_slot():
    cut = device((1, 1), (1, 1))
    outputs, inputs = cut.sync_managers
    cut = replace(cut, sync_managers=(outputs, replace(inputs, pdos=inputs.pdos[:1])))
    devices = {"logic": cut, "a": device((1, 1))}
    assert obstacles(bus(devices, facts("a", 1))) == [(Obstacle.UNMATCHED, "slot")]
    assert [c.slot for c in resolve(bus(devices, facts("a"))).connections] == [0]


def test_frames_after_an_unknown_layout_have_no_number():
    dark = device((1, 1), (1, 1))
    outputs, inputs = dark.sync_managers
    hole = (Pdo(index=0x1601, entries=()), *outputs.pdos[1:])
    dark = replace(dark, sync_managers=(replace(outputs, pdos=(outputs.pdos[0], *hole)), inputs))
    assert obstacles(bus({"logic": dark, "a": device((1, 1))}, facts("a", 1))) == [
        (Obstacle.UNMATCHED, "slot")
    ]


def test_partners_need_no_known_distance_of_objects():
    odd = device((1, 1), (1, 1), distance=0x1230)
    assert [p.matched for p in odd.layout.frame_pairs] == [True] * 2


def test_an_entry_a_driver_finds_elsewhere_is_refused():
    double = device((1, 1))
    outputs, inputs = double.sync_managers
    early = Pdo(index=0x15FF, entries=(Entry(index=0x7000, subindex=1, bits=8),))
    double = replace(double, sync_managers=(replace(outputs, pdos=(early, *outputs.pdos)), inputs))
    assert obstacles(bus({"logic": double, "a": device((1, 1))}, facts("a"))) == [
        (Obstacle.HIDDEN, "main")
    ]


def test_without_safety_master_the_connections_state_it():
    devices = {"logic": device((1, 1)), "a": device((1, 1))}
    found = resolve(bus(devices, facts("a"), safety_master=None))
    assert found.network.nets[0].safety_master == "logic"
    assert [c.main.name for c in found.connections] == ["logic"]
    turned = ConnectionFacts(main="a", sub="logic")
    assert obstacles(bus(devices, turned)) == [(Obstacle.NOT_MAIN, "main")]


def test_transfers_and_shorthand_in_one_net():
    long = example("el6910")
    (net,) = long.network.nets
    short = shortened(long).nets[0].connections
    mixed = replace(net, transfers=net.transfers[:4], connections=short)
    found = resolve(replace(long.network, nets=(mixed,)))
    assert [c.made for c in found.connections] == [False, False, True, True]
    assert compile_plan(found).to_bytes() == compile_plan(long).to_bytes()


# -- what users write -----------------------------------------------------------------------------

SHORT = """version: 1
cycle_us: 1000
subdevices:
  - {{name: io, position: 0, config: devices/ek1914.yaml}}
  - {{name: io2, position: 1, config: devices/ek1914.yaml}}
  - {{name: logic, position: 2, config: devices/el6910.yaml}}
  - {{name: axis, position: 3, config: devices/plain.yaml}}
nets:
  - name: safety
    safety_master: {master}
    connections:
      - {{main: logic, sub: io, slot: 0}}
      - {entry}
"""
PLAIN = """vendor_id: 2
product_id: 1
tpdo:
  - index: 0x1a00
    channels: [{index: 0x6000, sub_index: 1, type: uint8}]
"""
GOOD = "{main: logic, sub: io2, slot: 1}"

BROKEN = {
    "a list": ("[logic, io2]", "FSN111", 9),
    "a text": ("logic", "FSN111", 9),
    "nothing": ("", "FSN111", None),
    "main is a list": ("{main: [logic], sub: io2, slot: 1}", "FSN111", 16),
    "no sub": ("{main: logic, slot: 1}", "FSN110", 9),
    "negative slot": ("{main: logic, sub: io2, slot: -1}", "FSN113", 39),
    "huge slot": (f"{{main: logic, sub: io2, slot: {'9' * 60}}}", "FSN113", 39),
    "large slot": ("{main: logic, sub: io2, slot: 65535}", "FSN235", 39),
    "slot in words": ("{main: logic, sub: io2, slot: one}", "FSN111", 39),
    "slot is a map": ("{main: logic, sub: io2, slot: {a: 1}}", "FSN111", 39),
    "slot is empty": ("{main: logic, sub: io2, slot: }", "FSN111", None),
    "slot with a comma": ("{main: logic, sub: io2, slot: 1.5}", "FSN111", 39),
    "slot in quotes": ('{main: logic, sub: io2, slot: "1"}', "FSN111", 39),
    "slot misspelt": ("{main: logic, sub: io2, slott: 1}", "FSN109", 33),
    "sub_slot that is not there": (
        "{main: logic, sub: io2, slot: 1, sub_slot: 1}",
        "FSN235",
        52,
    ),
    "unknown sub": ("{main: logic, sub: oi2, slot: 1}", "FSN201", 28),
    "main is the sub": ("{main: logic, sub: logic, slot: 1}", "FSN239", 28),
    "exchanged": ("{main: io2, sub: logic, slot: 0}", "FSN239", 16),
    "another main": ("{main: io, sub: io2, slot: 0}", "FSN239", 16),
    "the MainDevice": ("{main: MainDevice, sub: io2}", "FSN226", 16),
    "no frames": ("{main: logic, sub: axis, slot: 1}", "FSN235", 28),
    "stated twice": ("{main: logic, sub: io, slot: 0}", "FSN238", None),
    "unconfirmed": ("{main: logic, sub: io2, slot: 1, unconfirmed: true}", "FSN234", 55),
    "a reason": ("{main: logic, sub: io2, slot: 1, unconfirmed: by size}", "FSN234", 55),
    "reason is a list": ("{main: logic, sub: io2, slot: 1, unconfirmed: [a]}", "FSN111", 55),
}


def _write(folder: Path, entry: str, master: str = "logic") -> str:
    shutil.copytree(BASE / "devices", folder / "devices")
    (folder / "devices" / "plain.yaml").write_text(PLAIN, "utf-8")
    path = folder / "network.yaml"
    path.write_text(SHORT.format(entry=entry, master=master), "utf-8")
    return str(path)


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_connection_is_one_finding(name: str, tmp_path: Path):
    entry, code, column = BROKEN[name]
    found = check_files([_write(tmp_path, entry)]).diagnostics
    loud = [d for d in found if d.level is not Severity.INFO]
    assert [d.code for d in loud] == [code], [f"{d.span} {d.message}" for d in loud]
    first = loud[0]
    assert first.span.line == 13
    assert column in (None, first.span.column)
    assert first.level is Severity.ERROR
    assert first.hint


@pytest.mark.parametrize("spelt", ["1", "0x1"])
def test_spellings_of_a_slot(spelt: str, tmp_path: Path):
    checked = check_files([_write(tmp_path, GOOD.replace("1}", f"{spelt}}}"))])
    assert [d for d in checked.diagnostics if d.level is not Severity.INFO] == []
    assert checked.resolution is not None
    assert [c.slot for c in checked.resolution.connections] == [0, 1]


def test_a_wrong_safety_master_is_the_only_finding(tmp_path: Path):
    found = check_files([_write(tmp_path, GOOD, master="logik")]).diagnostics
    assert [d.code for d in found if d.level is Severity.ERROR] == ["FSN218"]


def test_a_slave_yaml_that_cannot_be_read_is_the_only_finding(tmp_path: Path):
    path = _write(tmp_path, GOOD)
    (tmp_path / "devices" / "ek1914.yaml").write_text("a: [", "utf-8")
    found = check_files([path]).diagnostics
    assert {d.code for d in found if d.level is Severity.ERROR} == {"FSN102"}


def test_transfers_alone_leave_connections_to_the_whole_network(tmp_path: Path):
    path = tmp_path / "transfers.yaml"
    path.write_text("nets:\n  - {name: a, connections: [{main: x, sub: y}]}\n", "utf-8")
    found = check_files([str(path)]).diagnostics
    assert [(d.code, d.level) for d in found] == [("FSN201", Severity.INFO)]


def test_connections_must_be_a_list(tmp_path: Path):
    path = tmp_path / "network.yaml"
    for wrong in ("{main: a, sub: b}", "text", "", "5"):
        path.write_text(
            f"version: 1\nsubdevices: []\nnets:\n  - name: a\n    connections: {wrong}\n", "utf-8"
        )
        found = check_files([str(path)]).diagnostics
        assert [d.code for d in found] == ["FSN111"], wrong


def test_written_files_tell_connections_of_the_same_two_apart(tmp_path: Path):
    devices = {**TWO, "right": device((1, 1))}
    stated = (
        replace(facts("left", 2, 0), address=5),
        replace(facts("left", 0, 1), address=6),
        replace(facts("right", 1), address=7),
    )
    network = bus(devices, *stated)
    written = write_network(describe(network))
    for name, text in written.files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, "utf-8")
    again = resolved(tmp_path / "network.yaml")
    told = {c.slot: c.facts.address for c in again.connections if c.facts is not None}
    assert told == {2: 5, 0: 6, 1: 7}
    assert [c.made for c in again.connections] == [False] * 3


def test_slots_of_transfers_are_those_of_the_frames():
    two = (facts("left", 3, 0), facts("left", 1, 1))
    made = resolve(bus(TWO, *two)).network
    (net,) = made.nets
    turned = replace(net, connections=(facts("left", 1), facts("left", sub_slot=0)))
    found = resolve(replace(made, nets=(turned,)))
    assert [(c.slot, c.facts and c.facts.slot) for c in found.connections] == [(3, None), (1, 1)]
    assert (found.troubles, found.unmatched_facts) == ((), ())
    unclear = replace(net, connections=(facts("left"),))
    (trouble,) = resolve(replace(made, nets=(unclear,))).troubles
    assert (trouble.obstacle, [p.slot for p in trouble.pairs]) == (Obstacle.SEVERAL, [1, 3])
