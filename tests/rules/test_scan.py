"""A scan derived from a network gives no finding; each single change gives exactly its own."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from networks import PLAIN
from scans import COUPLER, scan_of, subdevice

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.scan import parse_scan
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.rules.scan import check_scan

pytestmark = pytest.mark.usefixtures("said")

EXAMPLES = PLAIN


def _network(name: str) -> Resolution:
    network = load_network([EXAMPLES / name / "network.yaml"]).network
    assert network is not None
    return resolve(network)


NETWORKS = {name: _network(name) for name in ("estop", "el6910")}
ROBOT = NETWORKS["el6910"]  # 1 el6910, 2 el1904, 3 el2904, 4 drive_1, 5 drive_2; 0 is a coupler


def _found(resolution: Resolution, document: dict[str, Any]):
    scan, damage = parse_scan(json.dumps(document).encode(), "scan.json")
    assert scan is not None, damage
    return check_scan(resolution, scan)


def _codes(document: dict[str, Any], resolution: Resolution = ROBOT) -> list[str]:
    return [d.code for d in _found(resolution, document)]


def _renumbered(document: dict[str, Any]) -> dict[str, Any]:
    for number, row in enumerate(document["subdevices"]):
        row["position"] = number
    return document


@pytest.fixture
def robot() -> dict[str, Any]:
    return scan_of(ROBOT)


@pytest.mark.shows("R8")
@pytest.mark.parametrize("name", NETWORKS)
def test_a_bus_as_it_should_be_gives_nothing(name: str):
    assert _found(NETWORKS[name], scan_of(NETWORKS[name])) == []


# Each: what is changed in the document, the one code, what its message must name, and the line of
# the user's file.
def _remove(n):
    return lambda rows: rows.pop(n)


def _swap(a, b):
    def change(rows):
        rows[a], rows[b] = rows[b], rows[a]

    return change


def _insert(n, row):
    return lambda rows: rows.insert(n, copy.deepcopy(row))


def _put(n, *path_and_value):
    *path, value = path_and_value

    def change(rows):
        at = rows[n]
        for step in path[:-1]:
            at = at[step]
        at[path[-1]] = value

    return change


def _delete(n, *path):
    def change(rows):
        at = rows[n]
        for step in path[:-1]:
            at = at[step]
        del at[path[-1]]

    return change


def _both(*changes):
    def change(rows):
        for one in changes:
            one(rows)

    return change


FOREIGN = subdevice(
    0,
    vendor_id=9,
    product_code=7,
    name="drive",
    sms=[{"sm": 2, "kind": "outputs", "bytes": 4, "pdos": []}],
)
ENTRY = {"index": 0x7777, "subindex": 1, "bits": 8}
CASES = {
    "coupler gone": (_remove(0), "FSN501", "position 0", 7),
    "first gone": (_remove(1), "FSN501", "el6910 is missing", 7),
    "middle gone": (_remove(3), "FSN501", "el2904 is missing", 9),
    "twin gone, told by its address": (_remove(4), "FSN501", "drive_1 is missing", 10),
    "last gone": (_remove(5), "FSN501", "drive_2 is missing", 11),
    "extra at the front": (_insert(0, FOREIGN), "FSN502", "position 0 is drive", 2),
    "extra in the middle": (_insert(3, FOREIGN), "FSN502", "position 3 is drive", 2),
    "extra at the end": (_insert(6, FOREIGN), "FSN502", "position 6 is drive", 2),
    "coupler in the way": (_insert(3, subdevice(3, **COUPLER)), "FSN502", "position 3", 2),
    "process data on a free place": (_put(0, "sms", FOREIGN["sms"]), "FSN502", "position 0", 2),
    "neighbours exchanged": (_swap(2, 3), "FSN503", "el1904 and el2904 are exchanged", 8),
    "far ones exchanged": (_swap(1, 4), "FSN503", "el6910 and drive_1 are exchanged", 7),
    "moved to the end": (lambda r: r.append(r.pop(1)), "FSN503", "el6910 is at position 5", 7),
    "other vendor": (_put(3, "vendor_id", 3), "FSN504", "position 3 is EL2904", 9),
    "other product": (_put(3, "product_code", 3), "FSN504", "el2904 is vendor", 9),
    "PDO less": (
        lambda r: r[4]["sms"][0]["pdos"].pop(2),
        "FSN506",
        "without 0x1602",
        8,
    ),
    "PDO more": (
        lambda r: r[4]["sms"][0]["pdos"].append({"index": 0x1633, "entries": []}),
        "FSN506",
        "with 0x1633 besides",
        8,
    ),
    "PDOs in another order": (
        lambda r: r[4]["sms"][1]["pdos"].reverse(),
        "FSN506",
        "in another order",
        52,
    ),
    "entry of another object": (
        _put(2, "sms", 0, "pdos", 0, "entries", 0, ENTRY),
        "FSN506",
        "entry 1 of PDO 0x1600 is 0x7000:01 with 8 bits in the file, 0x7777:01 with 8 bits",
        8,
    ),
    "entry longer": (
        _both(
            _put(2, "sms", 0, "pdos", 0, "entries", 1, "bits", 16),
            _put(2, "sms", 0, "bytes", 7),
        ),
        "FSN506",
        "8 bits of padding in the file, 16 bits of padding",
        9,
    ),
    "entry less": (
        lambda r: r[2]["sms"][0]["pdos"][0]["entries"].pop(),
        "FSN506",
        "entry 4 of PDO 0x1600 is 0x7000:03 with 16 bits in the file, not there on the device",
        11,
    ),
    "entry more": (
        lambda r: r[2]["sms"][0]["pdos"][0]["entries"].append(ENTRY),
        "FSN506",
        "not there in the file, 0x7777:01",
        6,
    ),
    "longer, mapping not read": (
        _both(_delete(2, "sms", 1, "pdos"), _put(2, "sms", 1, "bytes", 7)),
        "FSN507",
        "SM3 has 6 bytes by the file; on the device at position 2 7 bytes",
        29,
    ),
    "no such sync manager": (_delete(2, "sms", 1), "FSN507", "no such sync manager", 29),
    "other direction": (_put(2, "sms", 1, "kind", "outputs"), "FSN507", "for outputs", 29),
    "more sync managers": (
        lambda r: r[2]["sms"].append({"sm": 6, "kind": "outputs", "bytes": 2}),
        "FSN507",
        "SM6 has 2 bytes of outputs",
        26,
    ),
    "other address": (_put(2, "fsoe", "address", 77), "FSN508", "has FSoE address 77; the", 42),
    "address of another": (
        _put(2, "fsoe", "address", 102),
        "FSN508",
        "has FSoE address 102, the address of el2904",
        42,
    ),
    "twins exchanged": (_swap(4, 5), "FSN508", "drive_1 and drive_2 are exchanged", 44),
    "other address in the safety project": (
        _put(1, "fsoe", "connections", 2, "address", 77),
        "FSN508",
        "el6910 has FSoE address 77 for drive_1",
        44,
    ),
    "other connection ID": (
        _put(1, "fsoe", "connections", 1, "connection_id", 9),
        "FSN509",
        "el6910 has connection ID 9 for el2904; the network says 2",
        43,
    ),
    "connection IDs crossed": (
        _both(
            _put(1, "fsoe", "connections", 0, "connection_id", 2),
            _put(1, "fsoe", "connections", 1, "connection_id", 1),
        ),
        "FSN509",
        "connection IDs of el1904 and el2904 are exchanged",
        42,
    ),
    "other watchdog": (
        _put(1, "fsoe", "connections", 3, "watchdog_ms", 50),
        "FSN510",
        "el6910 has FSoE watchdog 50 ms for drive_2; the network says 100 ms",
        45,
    ),
    "error state": (
        _both(_put(3, "al_status", 0x14), _put(3, "al_code", 0x1B)),
        "FSN511",
        "AL status code 0x001b",
        9,
    ),
    "error state of a coupler": (_put(0, "al_status", 0x11), "FSN511", "EK1100 (position 0)", 2),
    "lost link": (_put(3, "ports", 1, "link_lost", 3), "FSN512", "port 1: 3 lost links", 9),
    "receive error": (_put(3, "ports", 0, "rx_errors", 1), "FSN512", "1 receive error", 9),
    "address not readable": (_put(2, "fsoe", None), "FSN513", "FSoE values of el1904", 42),
    "connection not reported": (
        lambda r: r[1]["fsoe"]["connections"].pop(),
        "FSN513",
        "nothing of drive_2",
        45,
    ),
    "not read": (_put(2, "problems", ["0x1C12: no answer"]), "FSN514", "0x1C12: no answer", 8),
}


@pytest.mark.shows("R8")
@pytest.mark.parametrize("case", CASES)
def test_one_change_is_one_finding_at_its_place(case: str, robot: dict[str, Any]):
    change, code, words, line = CASES[case]
    change(robot["subdevices"])
    found = _found(ROBOT, _renumbered(robot))
    assert [d.code for d in found] == [code], [d.message for d in found]
    assert words in found[0].message
    assert found[0].hint
    assert found[0].span.line == line, found[0].span


def test_everything_behind_a_cut_is_missing(robot: dict[str, Any]):
    del robot["subdevices"][3:]
    found = _found(ROBOT, robot)
    assert [d.code for d in found] == ["FSN501"] * 3
    assert "EL1904" in found[0].hint


def test_an_empty_bus(robot: dict[str, Any]):
    robot["subdevices"] = []
    found = _found(ROBOT, robot)
    assert {d.code for d in found} == {"FSN501"}
    assert "the bus is empty" in found[-1].hint


def test_main_instance_that_tells_nothing_is_one_note_per_connection(robot: dict[str, Any]):
    robot["subdevices"][1]["fsoe"] = None
    assert _codes(robot) == ["FSN513"] * 4


def test_sub_instances_tell_what_a_silent_main_instance_gave_them(robot: dict[str, Any]):
    """Of a MainInstance without readable objects, what its SubInstances have counts."""
    rows = robot["subdevices"]
    told = rows[1]["fsoe"]["connections"]
    rows[1]["fsoe"] = None
    for row, one in zip(rows[2:], told, strict=True):
        row["fsoe"]["given"] = [{**one, "object": 0x9001}]
    assert _codes(robot) == []
    rows[3]["fsoe"]["given"][0] |= {"connection_id": 77, "watchdog_ms": 5}
    rows[4]["fsoe"]["given"][0] |= {"connection_id": 0, "watchdog_ms": 0}  # not connected so far
    found = _found(ROBOT, robot)
    assert [d.code for d in found] == ["FSN509", "FSN510", "FSN513"]
    assert "el2904 has connection ID 77, given by el6910; the network says" in found[0].message
    assert "el2904 has FSoE watchdog 5 ms, given by el6910" in found[1].message
    assert "FSoE values of drive_1 cannot be read" in found[2].message


def test_an_address_stands_in_the_connection_where_a_device_has_no_other(robot: dict[str, Any]):
    """0x9nn1:02, also of a device that does not tell on which side of the connection it is."""
    fsoe = robot["subdevices"][2]["fsoe"]
    row = {"object": 0x9001, "address": fsoe["address"], "connection_id": 0, "watchdog_ms": 0}
    for key in ("given", "connections"):
        robot["subdevices"][2]["fsoe"] = {"address": None, "connections": [], key: [dict(row)]}
        assert _codes(robot) == []
        robot["subdevices"][2]["fsoe"][key][0]["address"] = 0  # not known before a connection
        assert _codes(robot) == ["FSN513"]
        robot["subdevices"][2]["fsoe"][key][0]["address"] = 99
        (wrong,) = _found(ROBOT, robot)
        assert wrong.code == "FSN508"
        assert "el1904 (position 2) has FSoE address 99" in wrong.message


def test_split_padding_is_the_same_padding(robot: dict[str, Any]):
    entries = robot["subdevices"][2]["sms"][0]["pdos"][0]["entries"]
    assert entries[1] == {"index": 0, "subindex": 0, "bits": 8}
    entries[1:2] = [{"index": 0, "subindex": 0, "bits": 4}] * 2
    assert _codes(robot) == []


def test_a_coupler_behind_all_is_a_note(robot: dict[str, Any]):
    robot["subdevices"].append(subdevice(6, **COUPLER))
    found = _found(ROBOT, robot)
    assert [(d.code, d.level) for d in found] == [("FSN502", Severity.INFO)]


def test_what_was_not_read_is_not_held_against_a_device(robot: dict[str, Any]):
    for row in robot["subdevices"]:
        for key in ("vendor_id", "product_code", "sms", "revision", "al_status"):
            del row[key]
    assert _codes(robot) == []


def _with(tmp_path: Path, find: str, put: str) -> Resolution:
    text = (EXAMPLES / "estop" / "network.yaml").read_text("utf-8")
    assert find in text
    text = text.replace("devices/", f"{EXAMPLES / 'estop' / 'devices'}/")
    (tmp_path / "network.yaml").write_text(text.replace(find, put, 1), "utf-8")
    network = load_network([tmp_path / "network.yaml"]).network
    assert network is not None
    return resolve(network)


def test_a_stated_revision_is_compared(tmp_path: Path):
    place = "{name: el1918, position: 1,"
    resolution = _with(tmp_path, place, place + " revision: 0x110000,")
    document = scan_of(resolution)
    assert _codes(document, resolution) == ["FSN505"]
    document["subdevices"][1]["revision"] = 0x110000
    assert _codes(document, resolution) == []


def test_alias_is_looked_up_and_offsets_count_from_it(tmp_path: Path):
    place = "{name: el1918, position: 1,"
    resolution = _with(tmp_path, place, "{name: el1918, alias: 300, position: 1,")
    document = scan_of(NETWORKS["estop"])
    assert _codes(document, resolution) == ["FSN502", "FSN501"]  # nobody has this alias
    document["subdevices"][0]["alias"] = 300
    assert _codes(document, resolution) == []
    document["subdevices"][1]["alias"] = 300
    assert _codes(document, resolution) == ["FSN515"]


@pytest.mark.shows("R8")
@given(st.data())
def test_a_bus_in_any_order_never_fails_and_is_never_clean(data: st.DataObject):
    document = scan_of(ROBOT)
    rows = document["subdevices"]
    order = data.draw(st.permutations(range(len(rows))))
    document["subdevices"] = [rows[n] for n in order][: data.draw(st.integers(0, len(rows)))]
    same = document["subdevices"] == rows  # two have one name, and addresses of their own
    assert (_codes(_renumbered(document)) == []) is same


@pytest.mark.uncounted
def test_a_long_bus_is_compared_in_reasonable_time():
    resolution = ROBOT
    document = scan_of(resolution)
    document["subdevices"] += [copy.deepcopy(FOREIGN) for _ in range(3000)]
    codes = _codes(_renumbered(document))
    assert codes == ["FSN502"] * 3000


def test_a_device_with_several_addresses_has_each_of_them(robot: dict[str, Any]):
    robot["subdevices"][2]["fsoe"] |= {"address": 7, "addresses": [7, 101]}
    assert _codes(robot) == []
    robot["subdevices"][2]["fsoe"]["addresses"] = [7, 8]
    assert _codes(robot) == ["FSN508"]


def test_an_error_state_is_named_once_with_its_code_in_words(robot: dict[str, Any]):
    state = {"al_status": 0x14, "al_code": 0x1B, "al_code_text": "sync manager watchdog"}
    robot["subdevices"][3] |= state
    (found,) = _found(ROBOT, robot)
    assert found.code == "FSN511"
    assert "sync manager watchdog" in found.message


def test_a_mapping_read_by_half_is_not_held_against_a_device(robot: dict[str, Any]):
    row = robot["subdevices"][2]
    del row["sms"][0]["pdos"][0]["entries"][2:]
    row["sms"][0]["bytes"] = 2
    row["sms"][0]["complete"] = False
    row["problems"] = ["SM2: the mapping of PDO 0x1600 cannot be read"]
    assert _codes(robot) == ["FSN514"]


def test_one_that_answers_no_more_is_missing_and_nothing_else(robot: dict[str, Any]):
    robot["subdevices"][3] |= {
        "al_status": 0,
        "sms": [],
        "fsoe": None,
        "problems": ["it does not answer"],
    }
    (found,) = _found(ROBOT, robot)
    assert found.code == "FSN501"
    assert "answers no more" in found.message
