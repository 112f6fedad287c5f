"""A scan derived from a network gives no finding; each single change gives exactly its own."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import pytest
from compare.scan_changes import (
    CASES,
    FOREIGN,
    NETWORKS,
    ROBOT,
    renumbered,
    scan_findings,
)
from hypothesis import given
from hypothesis import strategies as st
from networks import PLAIN
from scans import COUPLER, scan_of, subdevice

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.own.network import load_network
from fsoe_net.model.resolve import Resolution, resolve

EXAMPLES = PLAIN


def _codes(document: dict[str, Any], resolution: Resolution = ROBOT) -> list[str]:
    return [d.code for d in scan_findings(resolution, document)]


@pytest.fixture
def robot() -> dict[str, Any]:
    return scan_of(ROBOT)


@pytest.mark.shows("R8")
@pytest.mark.parametrize("name", NETWORKS)
def test_a_bus_as_it_should_be_gives_nothing(name: str):
    assert scan_findings(NETWORKS[name], scan_of(NETWORKS[name])) == []


@pytest.mark.shows("R8")
@pytest.mark.parametrize("case", CASES)
def test_one_change_is_one_finding_at_its_place(case: str, robot: dict[str, Any]):
    change, code, line = CASES[case]
    change(robot["subdevices"])
    found = scan_findings(ROBOT, renumbered(robot))
    assert [d.code for d in found] == [code], [d.message for d in found]
    assert found[0].hint
    assert found[0].span.line == line, found[0].span


def test_everything_after_a_cut_is_missing(robot: dict[str, Any]):
    del robot["subdevices"][3:]
    found = scan_findings(ROBOT, robot)
    assert [d.code for d in found] == ["FSN501"] * 3


def test_an_empty_bus(robot: dict[str, Any]):
    robot["subdevices"] = []
    found = scan_findings(ROBOT, robot)
    assert {d.code for d in found} == {"FSN501"}


def test_main_instance_that_reports_nothing_is_one_note_per_connection(robot: dict[str, Any]):
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
    found = scan_findings(ROBOT, robot)
    assert [d.code for d in found] == ["FSN509", "FSN510", "FSN513"]
    assert [d.span.line for d in found] == [43, 43, 44]


def test_an_address_is_in_the_connection_where_a_device_has_no_other(robot: dict[str, Any]):
    """0x9nn1:02, also of a device that does not tell on which side of the connection it is."""
    fsoe = robot["subdevices"][2]["fsoe"]
    row = {"object": 0x9001, "address": fsoe["address"], "connection_id": 0, "watchdog_ms": 0}
    for key in ("given", "connections"):
        robot["subdevices"][2]["fsoe"] = {"address": None, "connections": [], key: [dict(row)]}
        assert _codes(robot) == []
        robot["subdevices"][2]["fsoe"][key][0]["address"] = 0  # not known before a connection
        assert _codes(robot) == ["FSN513"]
        robot["subdevices"][2]["fsoe"][key][0]["address"] = 99
        (wrong,) = scan_findings(ROBOT, robot)
        assert wrong.code == "FSN508"


def test_split_padding_is_the_same_padding(robot: dict[str, Any]):
    entries = robot["subdevices"][2]["sms"][0]["pdos"][0]["entries"]
    assert entries[1] == {"index": 0, "subindex": 0, "bits": 8}
    entries[1:2] = [{"index": 0, "subindex": 0, "bits": 4}] * 2
    assert _codes(robot) == []


def test_a_coupler_after_all_is_a_note(robot: dict[str, Any]):
    robot["subdevices"].append(subdevice(6, **COUPLER))
    found = scan_findings(ROBOT, robot)
    assert [(d.code, d.level) for d in found] == [("FSN502", Severity.INFO)]


def test_unread_parts_are_not_a_difference(robot: dict[str, Any]):
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
    assert (_codes(renumbered(document)) == []) is same


@pytest.mark.uncounted
def test_a_long_bus_is_compared_in_reasonable_time():
    resolution = ROBOT
    document = scan_of(resolution)
    document["subdevices"] += [copy.deepcopy(FOREIGN) for _ in range(3000)]
    codes = _codes(renumbered(document))
    assert codes == ["FSN502"] * 3000


def test_a_device_with_several_addresses_has_each_of_them(robot: dict[str, Any]):
    robot["subdevices"][2]["fsoe"] |= {"address": 7, "addresses": [7, 101]}
    assert _codes(robot) == []
    robot["subdevices"][2]["fsoe"]["addresses"] = [7, 8]
    assert _codes(robot) == ["FSN508"]


def test_an_error_state_is_named_once_with_its_code_in_words(robot: dict[str, Any]):
    state = {"al_status": 0x14, "al_code": 0x1B, "al_code_text": "sync manager watchdog"}
    robot["subdevices"][3] |= state
    (found,) = scan_findings(ROBOT, robot)
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
    (found,) = scan_findings(ROBOT, robot)
    assert found.code == "FSN501"
