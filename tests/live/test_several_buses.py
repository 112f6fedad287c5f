"""A network of two buses: emulated in virtual time, and over two wires with one fsn-master."""

from __future__ import annotations

import json
import zlib
from pathlib import Path

import pytest
from cli import tool
from live.on_the_wire import on_the_wire
from live.support import needs_core
from networks import EXAMPLES, PLAIN, resolved

from fsoe_net.errors import PlanFormatError
from fsoe_net.plan.codec import decode_plan, encode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.rules.check import check

NETWORK = EXAMPLES / "two-buses" / "network.yaml"
INSIDE = ("el6910-el1904", "el6910-el2904")
ACROSS = ("el6910-drive_1", "el6910-drive_2")


def fsn(*words: object):
    return tool.fsn(*map(str, words))


@pytest.fixture(name="changed")
def changed_network(tmp_path: Path):
    """Return a function that writes the example with some texts replaced."""

    def write(*pairs: tuple[str, str], base: Path = NETWORK) -> Path:
        text = base.read_text("utf-8")
        for before, after in pairs:
            assert before in text
            text = text.replace(before, after)
        path = tmp_path / "changed.yaml"
        path.write_text(text.replace("../el6910", str(EXAMPLES / "el6910")), "utf-8")
        return path

    return write


# -- plan -----------------------------------------------------------------------------------------


def test_a_plan_names_which_subdevices_are_on_which_bus():
    plan = compile_plan(resolved(NETWORK))
    assert plan.format == "1.2"
    assert plan.cycle_ns == 1_000_000
    assert [(b.name, b.cycle_ns, b.first_subdevice, b.subdevice_count) for b in plan.buses] == [
        ("cell", 1_000_000, 0, 3),
        ("drives", 2_000_000, 3, 2),
    ]
    assert [plan.bus_number(n) for n in range(5)] == [0, 0, 0, 1, 1]
    assert (plan.way_cycle_ns(0, 1), plan.way_cycle_ns(0, 3)) == (1_000_000, 2_000_000)
    assert decode_plan(encode_plan(plan)) == plan


@needs_core
@pytest.mark.parametrize("path", [NETWORK, PLAIN / "two-buses" / "network.yaml"])
def test_the_core_reads_the_plan_and_makes_the_same_fingerprint(path):
    from fsoe_net.core.core import CorePlan

    plan = compile_plan(resolved(path))
    core = CorePlan.load(encode_plan(plan))
    assert core.fingerprint() == plan.fingerprint
    parts = core.parts()
    assert [p.subdevice_names for p in parts] == [
        ("el6910", "el1904", "el2904"),
        ("drive_1", "drive_2"),
    ]
    assert [p.connection_names for p in parts] == [INSIDE, ()]
    assert [p.cycle_ns for p in parts] == [1_000_000, 2_000_000]
    assert [size for p in parts for size in p.sm_sizes] == core.sm_sizes


def test_a_bus_and_its_cycle_are_in_the_fingerprint(changed):
    first = compile_plan(resolved(NETWORK)).fingerprint
    for pair in (("name: drives", "name: robot"), ("cycle_us: 2000", "cycle_us: 4000")):
        other = compile_plan(resolved(changed(pair))).fingerprint
        assert other.sections["devices"] != first.sections["devices"]
        assert other.whole != first.whole


def test_interfaces_are_not_in_the_fingerprint(changed):
    """They name ports of the PC; `docs/reference/fingerprint.md` has the reason."""
    first = compile_plan(resolved(NETWORK)).fingerprint
    exchanged = [
        ("interface: eth1", "interface: other"),
        ("interface: eth2", "interface: eth1"),
        ("interface: other", "interface: eth2"),
    ]
    for pairs in ([("interface: eth2", "interface: eth7")], exchanged):
        assert compile_plan(resolved(changed(*pairs))).fingerprint == first


@needs_core
@pytest.mark.parametrize(
    ("place", "value", "text"),
    [
        (8, 4, "bus 0: SubDevice"),  # more than there are
        (24, 2, "bus 1: SubDevice"),  # one on both
        (28, 3, "bus 1: SubDevice"),
    ],
)
def test_a_wrong_share_is_refused_by_both_readers(place, value, text):
    from fsoe_net.core.core import CorePlan

    raw = bytearray(encode_plan(compile_plan(resolved(NETWORK))))
    raw[len(raw) - 32 + place] = value
    raw[16:20] = bytes(4)
    raw[16:20] = zlib.crc32(raw).to_bytes(4, "little")
    with pytest.raises(PlanFormatError, match=text):
        decode_plan(bytes(raw))
    with pytest.raises(PlanFormatError, match=r"SubDevices do not follow|belongs to no bus"):
        CorePlan.load(bytes(raw))


@needs_core
def test_every_changed_byte_is_refused_or_another_fingerprint():
    """The share of the buses decides which bytes move: no byte of it may change unseen."""
    from fsoe_net.core.core import CorePlan

    raw = encode_plan(compile_plan(resolved(NETWORK)))
    first = CorePlan.load(raw).fingerprint()
    for place in [*range(32), *range(len(raw) - 32, len(raw))]:
        changed = bytearray(raw)
        changed[place] ^= 1
        if place not in range(16, 20):
            changed[16:20] = bytes(4)
            changed[16:20] = zlib.crc32(changed).to_bytes(4, "little")
        try:
            core = CorePlan.load(bytes(changed))
        except PlanFormatError:
            continue
        assert core.fingerprint() != first
        assert decode_plan(bytes(changed)).fingerprint == core.fingerprint()


def test_one_bus_keeps_its_plan():
    plan = compile_plan(resolved(EXAMPLES / "el6910" / "network.yaml"))
    assert (plan.buses, plan.format, plan.bus_number(3)) == ((), "1.1", 0)
    assert plan.way_cycle_ns(0, 3) == plan.cycle_ns


# -- rules ----------------------------------------------------------------------------------------


def found(path: Path) -> list[str]:
    resolution = resolved(path)
    return [f"{d.code} {d.span.line}: {d.message}" for d in check(resolution)]


def test_positions_are_of_a_bus(changed):
    assert found(changed(("drive_1, position: 0", "drive_1, position: 2"))) == []
    (one,) = found(changed(("drive_1, position: 0", "drive_1, position: 1")))
    assert one.startswith("FSN414")


@pytest.mark.parametrize(
    ("pair", "line", "text"),
    [
        (("name: drives", "name: cell"), 15, "two buses have the name 'cell'"),
        (
            ("cycle_us: 2000", "cycle_us: 500"),
            17,
            "bus drives has a shorter cycle than cell, the first, which moves the frames between "
            "the buses",
        ),
    ],
)
def test_buses_that_are_not_possible(changed, pair, line, text):
    assert f"FSN164 {line}: {text}" in found(changed(pair))


def test_a_watchdog_counts_the_way_between_the_buses(changed):
    (one,) = [x for x in found(changed(("connection_id: 3, watchdog_ms: 100",
                                        "connection_id: 3, watchdog_ms: 7"),
                                       base=PLAIN / "two-buses" / "network.yaml"))
              if x.startswith("FSN601")]  # fmt: skip
    assert "watchdog 7 ms is shorter than 8 ms, an FSoE cycle over buses of 1 ms, 2 ms" in one


def test_keys_of_one_bus_next_to_several(changed):
    done = fsn("check", changed(("\nbuses:", "\ncycle_us: 1000\nbuses:")))
    assert done.returncode == 1
    assert "error[FSN164]: cycle_us is next to buses; the bus that it belongs to is unknown" in (
        done.stdout + done.stderr
    )


def test_a_network_without_subdevices_and_buses(tmp_path):
    path = tmp_path / "n.yaml"
    path.write_text("version: 1\nnets: []\n", "utf-8")
    done = fsn("check", path)
    assert "error[FSN110]: the document has no 'subdevices'" in done.stdout + done.stderr


@pytest.mark.parametrize("name", ["bus.eni.xml", "driver"])
def test_other_formats_hold_one_bus(name, tmp_path):
    done = fsn("convert", NETWORK, "-o", tmp_path / name)
    assert done.returncode == 1
    assert "this network has 2 buses, and no other format holds more than one" in done.stderr


# -- timing ---------------------------------------------------------------------------------------


def test_a_connection_across_waits_for_each_bus(changed):
    from fsoe_net.model.library import Library
    from fsoe_net.timing.budget import make_budget

    budget = make_budget(resolved(NETWORK), Library(devices=()))
    trips = {w.connection.name: w.round_trip for w in budget.connections}
    # Input and logic, or logic and output, twice each; two cycles of 1 ms per direction.
    assert trips["el6910-el2904"] == 2 * (4 + 4) + 2 * 2 * 1
    # To the drive 1 + 1 + 2, from it 2 + 2 + 1.
    assert trips["el6910-drive_1"] == 2 * (4 + 8) + 4 + 5
    assert [w.cycle for w in budget.connections] == [1, 1, 2, 2]
    slow = make_budget(resolved(changed(("cycle_us: 2000", "cycle_us: 8000"))), Library(devices=()))
    assert slow.connections[2].round_trip == 2 * (4 + 8) + (1 + 1 + 8) + (8 + 8 + 1)
    assert slow.connections[1].round_trip == trips["el6910-el2904"]
    one = make_budget(resolved(NETWORK), Library(devices=()), cycle=3.0)
    assert {w.cycle for w in one.connections} == {3.0}


# -- runs -----------------------------------------------------------------------------------------


@needs_core
def test_all_connections_come_up_in_virtual_time():
    done = fsn("run", NETWORK, "--virtual-time", "--format", "json")
    assert done.returncode == 0
    document = json.loads(done.stdout)
    trips = {c["name"]: c["fsoe_cycle_ms"]["max"] for c in document["connections"]}
    assert {c["state"] for c in document["connections"]} == {"data_process"}
    assert [trips[n] for n in INSIDE] == [2.0, 2.0]
    assert [trips[n] for n in ACROSS] == [4.0, 4.0]


def try_rig(case, path, tmp_path, good=lambda _: True):
    return on_the_wire(case, path, tmp=tmp_path, good=good, script="live/several_rig.py", cables=2)


@pytest.fixture(name="slow")
def slow_network(changed) -> Path:
    """Buses that a busy machine keeps up with."""
    return changed(
        ("cycle_us: 1000", "cycle_us: 5000"),
        ("cycle_us: 2000", "cycle_us: 10000"),
        ("watchdog_ms: 100", "watchdog_ms: 1000"),
        base=PLAIN / "two-buses" / "network.yaml",
    )


def test_a_bus_that_is_lost_takes_only_its_own_connections(slow, tmp_path):
    def good(seen):
        before, then, later = seen["resets"]
        # A drive whose clock is set anew on a busy machine may lose the time once more.
        return seen["code"] == 0 and all(before[n] == then[n] == later[n] for n in INSIDE)

    seen = try_rig("lost", slow, tmp_path, good)
    assert all(seen["stay"][name].startswith("data") for name in INSIDE)
    assert not any(seen["stay"][name].startswith("data") for name in ACROSS)
    said, away, back = (seen["status"][n : n + 2] for n in (0, 2, 4))
    assert [(b["name"], b["interface"], b["cycle_ns"]) for b in said] == [
        ("cell", "near", 5_000_000),
        ("drives", "near2", 10_000_000),
    ]
    for cell, drives in (said, back):
        assert cell["actual_wkc"] == cell["expected_wkc"] > 0
        assert drives["actual_wkc"] == drives["expected_wkc"] > 0
    assert away[0]["actual_wkc"] == away[0]["expected_wkc"]
    assert away[1]["actual_wkc"] == 0
    assert back[1]["cycles"] > away[1]["cycles"] > said[1]["cycles"]
    assert seen["vendor"] > 0
    assert "soem on cell=near, drives=near2" in seen["monitor"]
    assert "bus drives: 10 ms" in seen["monitor"]


def test_the_leading_bus_may_be_lost_too(slow, tmp_path):
    def good(seen):
        # On a busy machine a drive may just have left OP as well.
        return seen["in_op"]["drive_1"] and seen["in_op"]["drive_2"]

    seen = try_rig("first_lost", slow, tmp_path, good)
    assert seen["in_op"] == {
        "el6910": False,
        "el1904": False,
        "el2904": False,
        "drive_1": True,
        "drive_2": True,
    }
    before, after = seen["cycles"]
    assert after[0] > before[0]
    assert after[1] > before[1]


# -- command lines --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--interface", "near"], "write BUS=IF, where BUS is cell or drives"),
        (["--interface", "robot=near"], "write BUS=IF, where BUS is cell or drives"),
        (["--interface", "cell=eth2"], "two buses on one interface"),
        (["--interface", "cell=a", "--interface", "cell=b"], "cell=b: this bus has one already"),
        (["--bus", "soem", "--cycle", "1ms"], "--cycle goes with a network of one bus"),
        (["--bus", "soem", "--redundant", "eth3"], "--redundant goes with a network of one bus"),
    ],
)
def test_wrong_interfaces_are_usage_errors(options, text):
    done = fsn("run", NETWORK, *options)
    assert done.returncode == 2
    assert text in done.stderr


def test_emulate_takes_none_of_the_interfaces_of_the_maindevice():
    done = fsn("emulate", NETWORK, "--interface", "cell=far")
    assert done.returncode == 2
    assert "bus drives has no interface: --interface drives=IF" in done.stderr
    done = fsn("emulate", NETWORK, "--interface", "cell=a", "--interface", "drives=b",
               "--redundant", "c")  # fmt: skip
    assert done.returncode == 2
    assert "--redundant goes with a network of one bus" in done.stderr


def test_one_bus_takes_one_interface():
    network = EXAMPLES / "el6910" / "network.yaml"
    done = fsn("run", network, "--interface", "a", "--interface", "b")
    assert done.returncode == 2
    assert "one --interface IF: this network has one bus" in done.stderr
