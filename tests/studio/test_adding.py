"""SubDevices come in from the library and from files, go, and change places; nothing gets lost."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from fsoe_net.errors import InputError
from fsoe_net.studio.begin import empty_network
from fsoe_net.studio.document import state_of
from fsoe_net.studio.server import try_network
from fsoe_net.studio.uploads import Uploads
from fsoe_net.studio.workspace import Workspace

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
BASE = ROOT / "tests" / "diagnostics" / "base"
ESI = ROOT / "tests" / "formats" / "esi" / "modular.xml"


@pytest.fixture
def uploads():
    uploads = Uploads()
    yield uploads
    uploads.clear()


@pytest.fixture
def new(tmp_path: Path) -> Workspace:
    (tmp_path / "cell").mkdir()
    path = str(tmp_path / "cell" / "network.yaml")
    return Workspace(path, new_text=empty_network(path))


@pytest.fixture
def tools(tmp_path: Path) -> Workspace:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    return Workspace(str(tmp_path / "examples" / "tool-exchange" / "network.yaml"))


def _give(uploads: Uploads, name: str, data: bytes) -> None:
    upload = uploads.begin(name)
    upload.write(data)
    upload.close(keep=True)
    uploads.put(upload)


def _number(uploads: Uploads, order: str, process_data: str = "", **more: object) -> int:
    found = [
        row["number"]
        for row in uploads.shown()["offers"]
        if (row["order"], row["process_data"]) == (order, process_data)
        and all(row[key] == value for key, value in more.items())
    ]
    return found[0]


def _add(workspace: Workspace, uploads: Uploads, *numbers: int, bus: int = 0) -> tuple[str, ...]:
    return uploads.add(workspace, workspace.version, {"offers": list(numbers), "bus": bus})


def _names(workspace: Workspace) -> list[tuple[str, int]]:
    return [(s.name, s.position) for s in workspace.checked.network.subdevices]


def _errors(workspace: Workspace) -> list[str]:
    return [d.code for d in workspace.checked.diagnostics if d.level.value == "error"]


def _change(workspace: Workspace, change: str, **more: object) -> None:
    workspace.change(workspace.version, {"change": change, **more})


def test_from_nothing_to_data_by_the_library(new: Workspace, uploads: Uploads) -> None:
    folder = Path(new.path).parent
    assert new.is_new
    assert not new.is_saved
    said = _add(new, uploads, _number(uploads, "EK1914", "as devices report it"))
    assert any("unverified: compare them with the device" in text for text in said)
    _add(new, uploads, _number(uploads, "EL1918", "own safety program, 1 connection"))
    assert _names(new) == [("ek1914", 0), ("el1918", 1)]
    shown = state_of(new)
    assert [sub["likely"] for sub in shown["subdevices"]] == ["sub", "main"]
    assert [(row["code"], row["subdevices"]) for row in shown["findings"]] == [("FSN125", [])]
    assert shown["unwritten"] == ["devices/ek1914.yaml", "devices/el1918.yaml"]
    assert list(folder.iterdir()) == []
    _change(new, "connect", main="el1918", slot=0, sub="ek1914", sub_slot=0)
    _change(new, "confirm", connection=0)
    assert _errors(new) == []
    assert try_network(new.checked)["passed"] is True
    new.save(new.version)
    assert new.is_saved
    assert not new.is_new
    assert new.unwritten == ()
    assert sorted(p.name for p in (folder / "devices").iterdir()) == ["ek1914.yaml", "el1918.yaml"]
    text = (folder / "devices" / "ek1914.yaml").read_text("utf-8")
    assert (
        "from the device library (EK1914, 'as devices report it', as answered), unverified" in text
    )
    again = Workspace(new.path)
    assert _errors(again) == []
    assert again.checked.resolution.connections[0].sub.name == "ek1914"


def test_steps_back_and_forth_find_the_device_file_again(new: Workspace, uploads: Uploads) -> None:
    before = new.text
    _add(new, uploads, _number(uploads, "EK1914", "as devices report it"))
    added = new.text
    new.undo(new.version)
    assert new.text == before
    new.save(new.version)  # the text names no device file, so none is written
    assert [p.name for p in Path(new.path).parent.iterdir()] == ["network.yaml"]
    new.redo(new.version)
    assert new.text == added
    assert "FSN133" not in _errors(new)
    new.save(new.version)
    assert (Path(new.path).parent / "devices" / "ek1914.yaml").is_file()


def test_a_name_is_free_again_when_nothing_leads_back_to_it(
    new: Workspace, uploads: Uploads
) -> None:
    _add(new, uploads, _number(uploads, "EK1914", "device PDO"))
    new.undo(new.version)
    _add(new, uploads, _number(uploads, "EK1914", "as devices report it"))  # redo is gone
    assert new.unwritten == ("devices/ek1914.yaml",)
    _change(new, "remove", subdevice="ek1914")
    _add(new, uploads, _number(uploads, "EK1914", "device PDO"))
    assert new.unwritten == ("devices/ek1914_2.yaml",)  # undo leads back to the first
    for _ in range(2):
        new.undo(new.version)
    assert "FSN133" not in _errors(new)
    assert new.unwritten == ("devices/ek1914.yaml",)


def test_equal_devices_share_a_file_and_no_file_is_replaced(
    new: Workspace, uploads: Uploads
) -> None:
    mine = Path(new.path).parent / "devices" / "ek1914.yaml"
    mine.parent.mkdir()
    mine.write_text("# mine\n", "utf-8")
    coupler = _number(uploads, "EK1914", "as devices report it")
    _add(new, uploads, coupler, coupler)
    _add(new, uploads, coupler)
    _add(new, uploads, _number(uploads, "EK1914", "device PDO"))
    assert _names(new) == [("ek1914", 0), ("ek1914_2", 1), ("ek1914_3", 2), ("ek1914_4", 3)]
    assert new.unwritten == ("devices/ek1914_2.yaml", "devices/ek1914_3.yaml")
    assert new.text.count("config: devices/ek1914_2.yaml") == 3
    new.save(new.version)
    assert mine.read_text("utf-8") == "# mine\n"


def test_a_device_file_that_a_person_makes_meanwhile_is_kept(
    new: Workspace, uploads: Uploads
) -> None:
    _add(new, uploads, _number(uploads, "EK1914", "as devices report it"))
    theirs = Path(new.path).parent / "devices" / "ek1914.yaml"
    theirs.parent.mkdir()
    theirs.write_text("# theirs\n", "utf-8")
    with pytest.raises(InputError, match=r"nothing written: .*ek1914\.yaml was created meanwhile"):
        new.save(new.version)
    assert theirs.read_text("utf-8") == "# theirs\n"
    assert not Path(new.path).exists()
    new.undo(new.version)
    _add(new, uploads, _number(uploads, "EK1914", "as devices report it"))
    assert new.unwritten == ("devices/ek1914_2.yaml",)
    theirs.unlink()
    theirs.mkdir()  # a folder of that name is no file of ours either
    new.save(new.version)
    assert "devices/ek1914_2.yaml" in Path(new.path).read_text("utf-8")


def test_a_network_file_that_appears_is_not_replaced(new: Workspace, uploads: Uploads) -> None:
    assert not new.look()
    path = Path(new.path)
    shutil.copytree(EXAMPLES / "estop" / "devices", path.parent / "devices")
    shutil.copy(EXAMPLES / "estop" / "network.yaml", path)
    assert new.look()
    assert new.outside
    with pytest.raises(
        InputError, match=r"nothing written: .*network\.yaml was created meanwhile; take"
    ):
        new.save(new.version)
    new.take_file(new.version)
    assert _names(new) == [("ek1914", 0), ("el1918", 1)]
    assert not new.is_new
    path.unlink()
    assert new.look()
    assert new.outside


def test_an_esi_gives_its_devices_with_their_revision(new: Workspace, uploads: Uploads) -> None:
    _give(uploads, "C:\\esi\\maker<b>.xml", ESI.read_bytes())
    shown = uploads.shown()
    assert shown["files"] == ["C_/esi/maker_b_.xml"]
    assert shown["proposal"] is None
    assert (shown["error"], shown["findings"]) == ("", [])
    _add(new, uploads, _number(uploads, "D", file="C_/esi/maker_b_.xml"))
    (sub,) = new.checked.network.subdevices
    assert (sub.name, sub.revision, sub.device.vendor_id) == ("d", 2, 0xA5F)
    assert "revision: 0x00000002" in new.text
    new.save(new.version)
    text = (Path(new.path).parent / "devices" / "d.yaml").read_text("utf-8")
    assert "maker_b_.xml" in text
    assert "fsoe-net-studio" not in text


def test_a_scan_gives_its_subdevices_and_a_proposal(new: Workspace, uploads: Uploads) -> None:
    _give(uploads, "scan.json", (BASE / "scan.json").read_bytes())
    shown = uploads.shown()
    scan = json.loads((BASE / "scan.json").read_text("utf-8"))["subdevices"]
    placed = [row for row in shown["offers"] if row["position"] is not None]
    assert [row["position"] for row in placed] == [row["position"] for row in scan]
    assert shown["proposal"]["subdevices"] == len(scan)
    _add(new, uploads, placed[-1]["number"])
    assert _names(new)[0][1] == scan[-1]["position"]
    with pytest.raises(InputError, match=f"position {scan[-1]['position']} is taken by"):
        _add(new, uploads, placed[-1]["number"])
    new.undo(new.version)
    uploads.take(new, new.version, {})
    assert len(_names(new)) == len(scan)
    assert "fsoe-net-studio" not in new.text
    assert "from scan.json" in new.text
    new.undo(new.version)
    assert new.text == empty_network(new.path)


def test_a_bus_without_process_data_gets_those_of_the_library(
    new: Workspace, uploads: Uploads
) -> None:
    row = {"vendor_id": 2, "product_code": 0x077A2C52, "name": "EK1914", "revision": 1}
    scan = {"scan": 1, "interface": "eth1", "subdevices": [{"position": 0, **row}]}
    _give(uploads, "scan.json", json.dumps(scan).encode())
    ways = [r for r in uploads.shown()["offers"] if r["position"] == 0]
    assert [r["process_data"] for r in ways] == [
        "as devices report it",
        "module 0x100C3",
    ]  # "device PDO" is of later revisions
    assert ways[0]["frames"] == [[6, 6]]
    _add(new, uploads, ways[1]["number"])
    (sub,) = new.checked.network.subdevices
    assert sub.layout.frame_pairs[0].sent_bytes == 6


def test_safety_logic_has_the_connections_that_a_person_chose(
    new: Workspace, uploads: Uploads
) -> None:
    (offer,) = [row for row in uploads.shown()["offers"] if row["order"] == "EL6910"]
    assert (offer["role"], offer["functions"]) == ("main", ["safety_logic"])
    assert offer["most_connections"] == 16

    def add(connections: object) -> tuple[str, ...]:
        body = {"offers": [offer["number"]], "connections": connections}
        return uploads.add(new, new.version, body)

    for wrong in ([], [[6, 6]] * 17):
        with pytest.raises(InputError, match="the device has 1 to 16 connections"):
            add(wrong)
    for wrong in ("6", [[6]], [[6, True]], [6]):
        with pytest.raises(InputError, match="connections is a list of two lengths"):
            add(wrong)
    for wrong in (0, -7, 8, 10**9):
        with pytest.raises(InputError, match="EL6910"):
            add([[6, wrong]])
    said = add([[6, 6], [31, 11]])
    assert any("unverified: compare them with the device" in text for text in said)
    assert state_of(new)["subdevices"][0]["pairs"] == [
        {"slot": 0, "sends_bytes": 6, "takes_bytes": 6, "matched": True, "connection": None},
        {"slot": 1, "sends_bytes": 11, "takes_bytes": 31, "matched": True, "connection": None},
    ]
    assert new.unwritten == ("devices/el6910.yaml",)


def test_the_variants_of_a_type_have_their_roles(uploads: Uploads) -> None:
    rows = [row for row in uploads.shown()["offers"] if row["order"] == "EL1918"]
    assert [row["role"] for row in rows] == ["sub", "sub", "main", "main"]
    assert [row["most_connections"] for row in rows] == [0, 0, 0, 16]
    assert all(row["functions"] == ["safe_input", "safety_logic"] for row in rows)


def test_a_rejected_addition_has_a_reason(new: Workspace, uploads: Uploads) -> None:
    sii = {"position": 0, "vendor_id": 2, "product_code": 1, "name": "EL9999", "revision": 1}
    scan = {"scan": 1, "interface": "eth1", "subdevices": [sii]}
    _give(uploads, "scan.json", json.dumps(scan).encode())
    with pytest.raises(InputError, match="no file here has its process data; add its ESI"):
        _add(new, uploads, 0)
    uploads.clear()
    with pytest.raises(InputError, match="not here any more; look at the list again"):
        _add(new, uploads, 99_999)
    with pytest.raises(InputError, match="unknown bus"):
        _add(new, uploads, 0, bus=1)
    for body in ({}, {"offers": [0], "bus": -1}, {"offers": [0], "bus": "0"}):
        with pytest.raises(InputError, match="offers is a list of numbers"):
            uploads.add(new, new.version, body)
    with pytest.raises(InputError, match="these files propose no network"):
        uploads.take(new, new.version, {})
    new.replace(new.version, "nets: [")
    with pytest.raises(InputError, match="not a valid network at present"):
        _add(new, uploads, 0)
    new.replace(
        new.version,
        "version: 1\nsubdevices:\n  - {name: a, position: 65535, config: a.yaml}\nnets: []\n",
    )
    with pytest.raises(InputError, match="no position is left"):
        _add(new, uploads, _number(uploads, "EK1914", "device PDO"))


def test_files_that_cannot_be_read_are_named_and_the_library_stays(uploads: Uploads) -> None:
    library = len(uploads.shown()["offers"])
    _give(uploads, "../../x.xml", b"<EtherCATInfo><Vendor>")
    _give(uploads, "\x1b[2J\u202e.bin", b"\0\1")
    shown = uploads.shown()
    assert shown["files"][0] == "x.xml"
    assert "\x1b" not in json.dumps(shown, ensure_ascii=False)
    assert "\u202e" not in json.dumps(shown, ensure_ascii=False)
    assert shown["error"] == ""
    assert len(shown["offers"]) == library
    said = [(row["severity"], row["place"].partition(":")[0]) for row in shown["findings"]]
    assert said == [("warning", shown["files"][1]), ("error", "x.xml")]
    uploads.clear()
    _give(uploads, "odd.bin", b"\0\1")  # one alone has to be right
    shown = uploads.shown()
    assert shown["error"] == "nothing written"
    assert [row["severity"] for row in shown["findings"]] == ["error"]
    uploads.clear()
    assert uploads.shown()["files"] == []
    assert uploads.shown()["error"] == ""


def test_a_file_of_the_same_name_takes_the_place_of_the_first(uploads: Uploads) -> None:
    _give(uploads, "a.xml", b"<nothing/>")
    room = uploads.room_bytes()
    _give(uploads, "a.xml", ESI.read_bytes())
    assert uploads.shown()["files"] == ["a.xml"]
    assert uploads.room_bytes() == room + len(b"<nothing/>") - ESI.stat().st_size
    gone = uploads.begin("b.xml")
    gone.close(keep=False)
    assert not Path(gone.path).exists()


def test_no_name_leads_out_of_the_folder(uploads: Uploads) -> None:
    for name in ("../../a.xml", "/etc/b.xml", "..\\c.xml", ".", "", "a/../..//d.xml", "e" * 999):
        _give(uploads, name, b"x")
    assert uploads.shown()["files"] == [
        "a.xml",
        "etc/b.xml",
        "c.xml",
        "file",
        "a/d.xml",
        "e" * 120,
    ]
    with pytest.raises(OSError, match=r"exists|director"):
        _give(uploads, "a.xml/under-a-file.xml", b"x")
    assert len(uploads.shown()["files"]) == 6


def test_a_folder_brings_a_network_with_its_device_files(new: Workspace, uploads: Uploads) -> None:
    folder = EXAMPLES / "el6910"
    for path in sorted(folder.rglob("*.yaml")):
        _give(uploads, f"cell/{path.relative_to(folder)}", path.read_bytes())
    shown = uploads.shown()
    assert shown["proposal"]["subdevices"] == 5
    assert shown["proposal"]["connections"] == 4
    uploads.take(new, new.version, {})
    assert _errors(new) == []
    assert [c.sub.name for c in new.checked.resolution.connections] == [
        "el1904",
        "el2904",
        "drive_1",
        "drive_2",
    ]
    new.save(new.version)
    assert _errors(Workspace(new.path)) == []


def test_a_proposal_with_a_damaged_file_is_not_taken(new: Workspace, uploads: Uploads) -> None:
    row = {"vendor_id": 0xA5F, "product_code": 0x10, "name": "D", "revision": 2}
    scan = {"scan": 1, "interface": "eth1", "subdevices": [{"position": 0, **row}]}
    _give(uploads, "scan.json", json.dumps(scan).encode())
    _give(uploads, "maker.xml", ESI.read_bytes()[:-400])
    assert "error" in [row["severity"] for row in uploads.shown()["findings"]]
    with pytest.raises(InputError, match="a file has errors, see above; put it away"):
        uploads.take(new, new.version, {})


def test_the_number_of_files_is_limited(uploads: Uploads) -> None:
    for number in range(200):
        _give(uploads, f"{number}.xml", b"")
    with pytest.raises(InputError, match="200 files are here; put them away first"):
        uploads.begin("one more.xml")


def test_the_example_is_one_step(new: Workspace) -> None:
    before = new.text
    Uploads.example(new, new.version, {})
    assert _errors(new) == []
    assert try_network(new.checked)["passed"] is True
    assert new.text == (EXAMPLES / "estop" / "network.yaml").read_text("utf-8")
    new.undo(new.version)
    assert new.text == before
    new.redo(new.version)
    new.save(new.version)
    written = Path(new.path).parent / "devices" / "el1918.yaml"
    assert written.read_bytes() == (EXAMPLES / "estop" / "devices" / "el1918.yaml").read_bytes()


def test_the_example_taken_twice_keeps_what_redo_leads_to(new: Workspace, uploads: Uploads) -> None:
    Uploads.example(new, new.version, {})
    _add(new, uploads, _number(uploads, "EK1914", "device PDO"))
    added = new.text
    new.undo(new.version)
    Uploads.example(new, new.version, {})  # the same text: no step
    new.redo(new.version)
    assert new.text == added
    assert "FSN133" not in _errors(new)


def test_a_subdevice_goes_with_all_that_names_it(tools: Workspace) -> None:
    before = tools.text
    _change(tools, "remove", subdevice="valves")
    assert "valves]" not in tools.text
    assert "name: gripper" not in tools.text
    assert [c.sub.name for c in tools.checked.resolution.connections] == ["el1904", "spindle"]
    _change(tools, "remove", subdevice="spindle")
    assert "groups:" not in tools.text
    _change(tools, "remove", subdevice="el1904")
    assert [s.name for s in tools.checked.network.subdevices] == ["el6910"]
    assert tools.checked.network.nets == ()
    assert Path(tools.path).parent.joinpath("devices/spindle.yaml").is_file()
    for _ in range(3):
        tools.undo(tools.version)
    assert tools.text == before


def test_copies_of_standard_data_go_with_their_subdevice(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES / "estop", tmp_path / "estop")
    workspace = Workspace(str(tmp_path / "estop" / "network.yaml"))
    standard = """      - size: 1
        kind: standard
        in: {ec_module: el1918, index: 0xf100, subindex: 1}
        out: {ec_module: ek1914, index: 0x7010, subindex: 1}
      - 7
    connections:
"""
    text = workspace.text.replace("    connections:\n", standard)
    workspace.replace(workspace.version, text)
    _change(workspace, "remove", subdevice="ek1914")
    assert "0xf100" not in workspace.text
    assert "      - 7\n" in workspace.text  # what is no map is a finding, and stays
    assert "ec_module" not in workspace.text


def test_a_subdevice_gets_a_name_wherever_the_file_has_it(tools: Workspace) -> None:
    before = tools.text
    for old, new in (("valves", "gripper valves"), ("el6910", "logic"), ("el1904", "e-stop")):
        _change(tools, "rename", subdevice=old, name=new)
    assert _errors(tools) == []
    assert "subdevices: [gripper valves]" in tools.text
    assert "sub: gripper valves" in tools.text
    assert "safety_master: logic" in tools.text
    assert [c.name for c in tools.checked.resolution.connections] == [
        "logic-e-stop",
        "logic-gripper valves",
        "logic-spindle",
    ]
    for name, words in (
        ("logic", "has the name logic already"),
        ("", "a name has 1 to 80 characters that print"),
        ("x" * 81, "a name has 1 to 80"),
        ("a\x1b", "a name has 1 to 80"),
        (7, "a name has 1 to 80"),
    ):
        with pytest.raises(InputError, match=words):
            _change(tools, "rename", subdevice="spindle", name=name)
    for _ in range(3):
        tools.undo(tools.version)
    assert tools.text == before


def test_a_transfer_has_the_new_name_too(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES / "estop", tmp_path / "estop")
    workspace = Workspace(str(tmp_path / "estop" / "network.yaml"))
    _change(workspace, "rename", subdevice="ek1914", name="door")
    assert workspace.text.count("ec_module: door") == 2
    assert _errors(workspace) == []


def test_name_and_cycle_of_a_network_are_set_in_front(new: Workspace, tools: Workspace) -> None:
    _change(new, "network", cycle_us=1000)
    _change(new, "network", name="press: 7")
    assert new.text.startswith("version: 1\ncycle_us: 1000\nname: 'press: 7'\n")
    assert state_of(new)["cycle_us"] == 1000
    _change(new, "network", cycle_us=2000)
    assert "cycle_us: 2000" in new.text
    new.replace(new.version, "subdevices: []\nnets: []\n")
    _change(new, "network", name="late")
    assert new.text.startswith("name: late\n")
    with pytest.raises(InputError, match="cycle_us is a number from 0 to 4000000"):
        _change(new, "network", cycle_us=4_000_001)
    two = Workspace(str(Path(tools.path).parents[1] / "two-buses" / "network.yaml"))
    with pytest.raises(InputError, match="each bus has a cycle of its own"):
        _change(two, "network", cycle_us=1000)


def test_subdevices_change_places_and_positions_stay_in_use(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES / "el6910", tmp_path / "cell")
    cell = Workspace(str(tmp_path / "cell" / "network.yaml"))
    before = _names(cell)
    assert before == [("el6910", 1), ("el1904", 2), ("el2904", 3), ("drive_1", 4), ("drive_2", 5)]
    _change(cell, "move", subdevice="drive_2", to="el1904")
    assert dict(_names(cell)) == {
        "el6910": 1,
        "drive_2": 2,
        "el1904": 3,
        "el2904": 4,
        "drive_1": 5,
    }
    _change(cell, "move", subdevice="drive_2", to="drive_1")
    assert _names(cell) == before
    _change(cell, "place", subdevice="el1904", alias=7, position=0)
    assert "{name: el1904, position: 0" in cell.text
    assert "alias: 7" in cell.text
    with pytest.raises(InputError, match="set the position of one with an alias"):
        _change(cell, "move", subdevice="el1904", to="el2904")
    _change(cell, "place", subdevice="el1904", alias=0)
    assert "alias" not in cell.text.partition("nets:")[0]
    with pytest.raises(InputError, match="position is a number"):
        _change(cell, "place", subdevice="el1904")


def test_a_subdevice_is_added_to_the_bus_that_is_meant(tmp_path: Path, uploads: Uploads) -> None:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    workspace = Workspace(str(tmp_path / "examples" / "two-buses" / "network.yaml"))
    on_second = [s.position for s in workspace.checked.network.subdevices if s.master_id == 1]
    _add(workspace, uploads, _number(uploads, "EK1914", "device PDO"), bus=1)
    (made,) = [s for s in workspace.checked.network.subdevices if s.name.startswith("ek1914")]
    assert (made.master_id, made.position) == (1, max(on_second) + 1)


def _bus(*links: str) -> bytes:
    """Return a scan of couplers with these linked ports."""
    row = {"vendor_id": 2, "product_code": 0x077A2C52, "name": "EK1914", "revision": 1}
    subs = [
        {
            "position": n,
            **row,
            "ports": [{"port": p, "link": str(p) in ports} for p in range(4)],
        }
        for n, ports in enumerate(links)
    ]
    return json.dumps({"scan": 1, "interface": "eth1", "subdevices": subs}).encode()


def test_a_scan_shows_how_the_cables_run(tmp_path: Path, uploads: Uploads) -> None:
    shutil.copytree(EXAMPLES / "estop", tmp_path / "estop")
    workspace = Workspace(str(tmp_path / "estop" / "network.yaml"))
    assert state_of(workspace, uploads.scan)["wiring"] is None
    _give(uploads, "bus.json", _bus("013", "0", "01"))
    uploads.shown()
    wiring = state_of(workspace, uploads.scan)["wiring"]
    assert (wiring["file"], wiring["is_known"], wiring["ring_from"]) == ("bus.json", True, [2, 1])
    assert [(n["parent"], n["port"], n["subdevice"]) for n in wiring["nodes"]] == [
        (None, 0, "ek1914"),
        (0, 3, "el1918"),  # another type in its place: it is shown where the file has it
        (0, 1, ""),
    ]
    assert [n["is_other"] for n in wiring["nodes"]] == [False, True, False]
    assert wiring["nodes"][2]["type"] == "EK1914"
    _give(uploads, "bus.json", _bus("0123", "0"))
    uploads.shown()
    wiring = state_of(workspace, uploads.scan)["wiring"]
    assert (wiring["is_known"], wiring["nodes"]) == (False, [])
    workspace.replace(workspace.version, "nets: [")
    assert state_of(workspace, uploads.scan)["wiring"] is None
    uploads.clear()
    assert uploads.scan is None
