"""What a person does in the page is done to the text, step by step, and nothing gets lost."""

import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsoe_net.errors import InputError
from fsoe_net.plan.compile import compile_plan
from fsoe_net.studio.changes import DRAWN, change_of
from fsoe_net.studio.document import state_of
from fsoe_net.studio.rows import remove_row, row_of
from fsoe_net.studio.server import try_network
from fsoe_net.studio.workspace import MAX_TEXT_BYTES, StaleVersion, Workspace

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"


@pytest.fixture
def estop(tmp_path: Path) -> Workspace:
    shutil.copytree(EXAMPLES / "estop", tmp_path / "estop")
    return Workspace(str(tmp_path / "estop" / "network.yaml"))


@pytest.fixture
def cell(tmp_path: Path) -> Workspace:
    shutil.copytree(EXAMPLES / "el6910", tmp_path / "cell")
    return Workspace(str(tmp_path / "cell" / "network.yaml"))


def _codes(workspace: Workspace) -> list[str]:
    return [d.code for d in workspace.checked.diagnostics]


def test_steps_go_back_and_forth_and_are_written_when_asked(estop: Workspace) -> None:
    path, before = Path(estop.path), estop.text
    estop.replace(estop.version, before.replace("0x6080", "0x6081"))
    assert not estop.is_saved
    assert estop.can_undo
    assert not estop.can_redo
    assert any(d.level.value == "error" for d in estop.checked.diagnostics)
    assert path.read_text("utf-8") == before
    estop.undo(estop.version)
    assert estop.text == before
    assert estop.is_saved
    assert estop.can_redo
    estop.redo(estop.version)
    wrong = estop.text
    estop.save(estop.version)  # also with errors: it is the user's file
    assert path.read_text("utf-8") == wrong
    assert estop.is_saved
    estop.undo(estop.version)
    estop.replace(estop.version, before + "# mine\n")
    assert not estop.can_redo
    version = estop.version
    estop.replace(version, estop.text)
    assert estop.version == version + 1  # told, and no step
    estop.undo(estop.version)
    estop.undo(estop.version)
    assert estop.text == before
    assert not estop.can_undo
    estop.undo(estop.version)


def test_a_change_of_an_older_text_is_refused(estop: Workspace) -> None:
    version = estop.version
    estop.replace(version, estop.text + "#\n")
    text = estop.text
    for late in (
        lambda: estop.replace(version, ""),
        lambda: estop.change(version, {"change": "confirm", "connection": 0}),
        lambda: estop.change_with_files(version, [], lambda *_: None, text="name: late\n"),
        lambda: estop.fix(version, 0),
        lambda: estop.undo(version),
        lambda: estop.save(version),
        lambda: estop.take_file(version),
    ):
        with pytest.raises(StaleVersion):
            late()
    assert estop.text == text


def test_a_file_that_another_program_changes_is_never_overwritten(estop: Workspace) -> None:
    path = Path(estop.path)
    theirs = estop.text.replace("estop", "theirs", 1)
    assert not estop.look()
    path.write_text(theirs, "utf-8")
    assert estop.look()
    assert not estop.look()
    assert estop.text == theirs
    assert not estop.outside
    estop.replace(estop.version, theirs + "# mine\n")
    path.write_text(theirs + "# theirs\n", "utf-8")
    assert estop.look()
    assert estop.outside
    with pytest.raises(InputError, match=r"has changed since it was read; take the file's text"):
        estop.save(estop.version)
    estop.take_file(estop.version)
    assert estop.text == theirs + "# theirs\n"
    assert estop.is_saved
    assert not estop.outside
    estop.undo(estop.version)
    assert estop.text == theirs + "# mine\n"
    estop.save(estop.version)
    assert path.read_text("utf-8") == theirs + "# mine\n"
    path.unlink()
    assert estop.look()
    assert estop.outside
    with pytest.raises(InputError, match="cannot be read"):
        estop.take_file(estop.version)
    assert estop.text == theirs + "# mine\n"


def test_a_device_file_that_changes_is_checked_again(estop: Workspace) -> None:
    device = Path(estop.path).parent / "devices" / "ek1914.yaml"
    device.write_text(device.read_text("utf-8").replace("0x6000", "0x6123"), "utf-8")
    assert estop.look()
    assert estop.is_saved
    assert not estop.outside
    assert any(code.startswith("FSN2") for code in _codes(estop))


@pytest.mark.parametrize("data", [b"\xff\xfe", b"a" * (MAX_TEXT_BYTES + 1)])
def test_binary_content_is_rejected(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "network.yaml"
    path.write_bytes(data)
    with pytest.raises(InputError):
        Workspace(str(path))


def test_marks_and_line_ends_stay(estop: Workspace) -> None:
    path = Path(estop.path)
    data = b"\xef\xbb\xbf" + estop.text.replace("\n", "\r\n").encode()
    path.write_bytes(data)
    again = Workspace(estop.path)
    again.change(
        again.version, {"change": "set", "connection": 0, "key": "watchdog_ms", "value": 150}
    )
    again.save(again.version)
    assert path.read_bytes() == data.replace(b"watchdog_ms: 100", b"watchdog_ms: 150")
    assert not again.look()
    shown = state_of(again)["text"]
    assert "\r" not in shown
    again.replace(again.version, shown.replace("name: estop", "name: mine"))
    again.save(again.version)
    expected = data.replace(b"watchdog_ms: 100", b"watchdog_ms: 150")
    assert path.read_bytes() == expected.replace(b"name: estop", b"name: mine")


def test_too_long_a_text_is_refused_and_nothing_lost(estop: Workspace) -> None:
    before = estop.text
    with pytest.raises(InputError, match="more than 4 MiB"):
        estop.replace(estop.version, "#" * (MAX_TEXT_BYTES + 1))
    assert estop.text == before
    assert not estop.can_undo


def test_values_are_set_in_place(estop: Workspace) -> None:
    before = estop.text
    for key, value in (("address", 15), ("connection_id", 7), ("watchdog_ms", 120)):
        request = {"change": "set", "connection": 0, "key": key, "value": value}
        estop.change(estop.version, request)
    expected = before.replace(
        "address: 14, connection_id: 1, watchdog_ms: 100",
        "address: 15, connection_id: 7, watchdog_ms: 120",
    )
    assert estop.text == expected
    estop.change(estop.version, {"change": "set", "connection": 0, "key": "address", "value": None})
    assert estop.text == expected.replace("address: 15, ", "")
    estop.change(estop.version, {"change": "place", "subdevice": "ek1914", "position": 9})
    assert "{name: ek1914, position: 9, config" in estop.text


SUBS = ("el1904", "el2904", "drive_1", "drive_2")  # in the order of the slots of el6910


@pytest.mark.parametrize("slot", range(4))
def test_a_connection_goes_and_comes_back(slot: int, cell: Workspace) -> None:
    before, name = cell.text, SUBS[slot]
    numbers = {c.sub.name: n for n, c in enumerate(cell.checked.resolution.connections)}
    cell.change(cell.version, {"change": "disconnect", "connection": numbers[name]})
    left = [c.sub.name for c in cell.checked.resolution.connections]
    assert left == [sub for sub in SUBS if sub != name]
    gone = set(before.splitlines()) - set(cell.text.splitlines())
    assert all(name in line or "size" in line or "el6910" in line for line in gone)
    ends = {"main": "el6910", "slot": slot, "sub": name, "sub_slot": 0}
    cell.change(cell.version, {"change": "connect", **ends})
    last = cell.checked.resolution.connections[-1]
    assert (last.sub.name, last.slot, last.stated.unconfirmed) == (name, slot, DRAWN)
    assert f"slot: {slot}" in cell.text
    assert "sub_slot" not in cell.text
    assert "FSN234" in _codes(cell)  # a person has to compare it first
    number = len(cell.checked.resolution.connections) - 1
    cell.change(cell.version, {"change": "confirm", "connection": number})
    assert "FSN234" not in _codes(cell)
    while cell.can_undo:
        cell.undo(cell.version)
    assert cell.text == before


def test_slot_0_of_several_is_written(cell: Workspace) -> None:
    ends = {"main": "drive_2", "slot": 0, "sub": "el6910", "sub_slot": 0}
    cell.change(cell.version, {"change": "connect", **ends})
    keys = [line.split(":")[0].strip() for line in cell.text.splitlines()]
    assert keys[keys.index("- main") : keys.index("unconfirmed")] == ["- main", "sub", "sub_slot"]


def test_a_network_without_nets_gets_one(estop: Workspace) -> None:
    estop.change(estop.version, {"change": "disconnect", "connection": 0})
    assert estop.checked.network is not None
    assert estop.checked.network.nets == ()
    ends = {"main": "el1918", "slot": 0, "sub": "ek1914", "sub_slot": 0}
    estop.change(estop.version, {"change": "connect", **ends})
    (net,) = estop.checked.network.nets
    assert (net.name, net.safety_master) == ("el1918", "el1918")
    (connection,) = estop.checked.resolution.connections
    assert connection.sub.name == "ek1914"


@pytest.mark.parametrize(
    ("request_", "text"),
    [
        ({}, "unknown change 'None'"),
        ({"change": "erase"}, "unknown change 'erase'"),
        ({"change": "set", "connection": 0, "key": "main", "value": 1}, "is nothing that is set"),
        ({"change": "set", "connection": 0, "key": [], "value": 1}, "is nothing that is set"),
        ({"change": "set", "connection": 1, "key": "address", "value": 1}, "a number from 0 to 0"),
        ({"change": "set", "connection": True, "key": "address"}, "a number from 0 to 0"),
        ({"change": "set", "connection": 0, "key": "address", "value": 65536}, "from 0 to 65535"),
        ({"change": "set", "connection": 0, "key": "address", "value": "1"}, "from 0 to 65535"),
        ({"change": "confirm", "connection": 0}, "is confirmed already"),
        ({"change": "connect", "main": "el1918", "sub": "?"}, "sub: no SubDevice has the name"),
        ({"change": "connect", "main": {}, "sub": "ek1914"}, "main: no SubDevice has the name"),
        (
            {"change": "connect", "main": "el1918", "sub": "el1918", "slot": 0, "sub_slot": 0},
            "cannot be connected with itself",
        ),
        ({"change": "connect", "main": "el1918", "sub": "ek1914", "slot": -1}, "slot is a number"),
        ({"change": "place", "subdevice": "ek1914", "position": 1.5}, "position is a number"),
    ],
)
def test_a_request_that_cannot_be_made_gives_the_reason(
    estop: Workspace, request_: dict[str, object], text: str
) -> None:
    before = estop.text
    with pytest.raises(InputError, match=text):
        estop.change(estop.version, request_)
    assert estop.text == before


def test_an_item_that_an_anchor_shares_is_changed_in_place(estop: Workspace) -> None:
    item = "{name: ek1914, position: 0, config: devices/ek1914.yaml}"
    estop.replace(estop.version, f"x: &shared {item}\n" + estop.text.replace(item, "*shared"))
    estop.change(estop.version, {"change": "place", "subdevice": "ek1914", "position": 2})
    assert estop.text.startswith("x: &shared {name: ek1914, position: 2, config")


def test_a_part_that_is_not_in_the_file_is_left_to_the_text(estop: Workspace) -> None:
    (sub, _) = estop.checked.resolution.network.subdevices
    with pytest.raises(InputError, match="8:5: this part cannot be changed here; change it in"):
        row_of([{"name": "ek1914"}], sub)


def test_a_text_that_is_not_a_network_is_kept_and_said(estop: Workspace) -> None:
    estop.replace(estop.version, "nets: [")
    assert estop.checked.resolution is None
    with pytest.raises(InputError, match="the text is not a valid network at present"):
        estop.change(estop.version, {"change": "place", "subdevice": "ek1914", "position": 2})
    shown = state_of(estop)
    assert shown["is_network"] is False
    assert shown["subdevices"] == []
    assert shown["findings"]
    estop.save(estop.version)
    assert Path(estop.path).read_text("utf-8") == "nets: ["


def test_a_hint_with_one_way_is_followed(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    workspace = Workspace(str(tmp_path / "examples" / "broken" / "04_size.yaml"))
    rows = state_of(workspace)["findings"]
    fixable = [n for n, row in enumerate(rows) if row["fixable"]]
    assert fixable
    with pytest.raises(InputError, match="no hint that the page could follow"):
        workspace.fix(workspace.version, len(rows))
    workspace.fix(workspace.version, fixable[0])
    assert rows[fixable[0]]["message"] not in [
        row["message"] for row in state_of(workspace)["findings"]
    ]
    assert workspace.can_undo
    assert not workspace.is_saved


@pytest.mark.parametrize("name", sorted(p.name for p in (EXAMPLES / "broken").glob("*.yaml")))
def test_each_finding_is_shown_at_its_part(tmp_path: Path, name: str) -> None:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    shown = state_of(Workspace(str(tmp_path / "examples" / "broken" / name)))
    rows = shown["findings"]
    assert rows
    for row in rows:
        assert all(n < len(shown["connections"]) for n in row["connections"])
        assert set(row["subdevices"]) <= {sub["name"] for sub in shown["subdevices"]}


def test_a_limit_is_shown_on_its_safe_side(estop: Workspace) -> None:
    """1.2 * 20.02 ms at least, and a third of 400 - 10 - 8.02 - 40.04 ms at most."""
    text = estop.text.replace("time_ms: 20", "time_ms: 20.02").replace(
        "time_ms: 4,", "time_ms: 4.01,"
    )
    estop.replace(estop.version, text)
    (row,) = state_of(estop)["connections"]
    assert (row["least_ms"], row["greatest_ms"]) == (24.1, 113.9)


def test_the_state_shows_what_the_timing_budget_allows(estop: Workspace) -> None:
    (row,) = state_of(estop)["connections"]
    assert (row["least_ms"], row["greatest_ms"]) == (24.0, 114.0)  # as `fsoe-net timing` prints
    text = estop.text.partition("# Figures of an example")[0]
    estop.replace(estop.version, text)
    (row,) = state_of(estop)["connections"]
    assert row["greatest_ms"] is None


def test_the_state_shows_what_may_be_absent() -> None:
    shown = state_of(Workspace(str(EXAMPLES / "tool-exchange" / "network.yaml")))
    assert {sub["name"]: sub["group"] for sub in shown["subdevices"]} == {
        "el6910": "",
        "el1904": "",
        "valves": "gripper",
        "spindle": "drill",
    }


def test_a_try_leaves_out_the_second_tool_of_a_place() -> None:
    workspace = Workspace(str(EXAMPLES / "tool-exchange" / "network.yaml"))
    tried = try_network(workspace.checked)
    assert tried["passed"] is True
    assert [(c["name"], c["state"], c["absent"]) for c in tried["connections"]] == [
        ("el6910-el1904", "Data · ProcessData", False),
        ("el6910-valves", "Data · ProcessData", False),
        ("el6910-spindle", "absent: drill", True),
    ]


def test_the_state_shows_both_copies_to_the_byte(cell: Workspace) -> None:
    row = state_of(cell)["connections"][2]  # drive_1 in the third slot
    to_sub, to_main = row["copies"]
    assert (to_sub["size_bytes"], to_main["size_bytes"]) == (11, 31)
    ends = [(copy["source"], copy["destination"]) for copy in (to_sub, to_main)]
    assert [[e["subdevice"] for e in pair] for pair in ends] == [
        ["el6910", "drive_1"],
        ["drive_1", "el6910"],
    ]
    plan = compile_plan(cell.checked.resolution)
    made = [c for c in plan.copies if c.bits == 8 * 11 and plan.connections[c.connection].sub == 3]
    (copy,) = made
    sms = [plan.sync_managers[n] for n in (copy.source_sm, copy.destination_sm)]
    assert [(e["sm"], 8 * e["byte"]) for e in ends[0]] == [
        (sms[0].index, copy.source_bit),
        (sms[1].index, copy.destination_bit),
    ]


def test_the_state_shows_slots_and_proposals(cell: Workspace) -> None:
    shown = state_of(cell)
    logic = shown["subdevices"][0]
    assert (logic["name"], logic["role"], logic["line"]) == ("el6910", "main", 8)
    assert [pair["connection"] for pair in logic["pairs"]] == [0, 1, 2, 3]
    assert [(p["sends_bytes"], p["takes_bytes"]) for p in logic["pairs"]] == [
        (6, 6),
        (6, 6),
        (11, 31),
        (11, 31),
    ]
    assert shown["proposals"] == {"address": 1, "connection_id": 5}
    assert (
        shown["connections"][0]["line"]
        == cell.text.split("sub: el1904, address")[0].count("\n") + 1
    )


_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 70000) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=4,
)
_KEYS = st.sampled_from(
    [
        "change",
        "connection",
        "key",
        "value",
        "main",
        "sub",
        "slot",
        "sub_slot",
        "subdevice",
        "to",
        "position",
        "alias",
        "name",
        "cycle_us",
    ]
)
_WORDS = st.sampled_from(
    [
        "set",
        "connect",
        "disconnect",
        "confirm",
        "place",
        "move",
        "remove",
        "rename",
        "network",
        "el1918",
        "ek1914",
        "address",
        0,
        1,
    ]
)


@given(st.dictionaries(_KEYS, _WORDS | _VALUES, max_size=6))
def test_no_request_breaks_anything(request_: dict[str, object]) -> None:
    workspace = Workspace(str(EXAMPLES / "estop" / "network.yaml"))
    try:
        change_of(request_, workspace.checked)
        workspace.change(workspace.version, request_)
    except InputError:
        assert not workspace.can_undo


def test_a_line_that_a_person_deletes_stays_deleted_whatever_ends_it(tmp_path: Path) -> None:
    """Also a comment, and in a file with the line ends of Windows."""
    file = tmp_path / "network.yaml"
    file.write_bytes(b"version: 1\r\n# gone\r\nname: x\nsubdevices: []\r\n")
    workspace = Workspace(str(file))
    workspace.replace(workspace.version, "version: 1\nname: x\n# new\nsubdevices: []\n")
    assert workspace.text == "version: 1\r\nname: x\n# new\r\nsubdevices: []\r\n"


def test_name_and_cycle_are_changed_in_place(tmp_path: Path) -> None:
    """Wherever `version` is, and with what stands behind them."""
    file = tmp_path / "network.yaml"
    text = "name: legs   # the machine\nversion: 1\ncycle_us: 1000  # of SOEM\nsubdevices: []\n"
    file.write_text(text, "utf-8")
    workspace = Workspace(str(file))
    workspace.change(workspace.version, {"change": "network", "name": "arm", "cycle_us": 2000})
    assert workspace.text == text.replace("legs ", "arm  ").replace("1000", "2000")


def test_the_last_subdevice_goes_and_the_blank_line_after_it_stays(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    workspace = Workspace(str(tmp_path / "examples" / "el6910" / "network.yaml"))
    last = workspace.checked.resolution.network.subdevices[-1].name
    workspace.change(workspace.version, {"change": "remove", "subdevice": last})
    assert "\n\nnets:\n" in workspace.text


def test_the_meant_one_of_equal_rows_is_removed() -> None:
    first, second = {"main": "a"}, {"main": "a"}
    rows = [first, second]
    remove_row(rows, second)
    assert len(rows) == 1
    assert rows[0] is first
