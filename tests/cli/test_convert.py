"""``convert``: each format to each other, joined inputs, refusals."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from capture.traffic import Bus
from cli.tool import fsn
from formats.startup import LOGIC, TERMINAL, Startup, startup
from formats.texts import XML
from networks import PLAIN

ROOT = Path(__file__).parents[2]
NETWORK = PLAIN / "el6910" / "network.yaml"
URDF = ROOT / "examples" / "estop" / "estop.urdf.xacro"

ESI = """<?xml version="1.0"?>
<EtherCATInfo><Vendor><Id>#x2</Id></Vendor><Descriptions><Groups/><Devices><Device>
<Type ProductCode="#x07703052" RevisionNo="#x00120000">EL1904</Type><Name>EL1904</Name>
<Sm>MBoxOut</Sm><Sm>MBoxIn</Sm><Sm StartAddress="#x1200">Outputs</Sm>
<Sm StartAddress="#x1D00">Inputs</Sm>
<RxPdo Sm="2" Fixed="1"><Index>#x1600</Index><Name>Out</Name>
<Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>8</BitLen><Name>Cmd</Name></Entry>
<Entry><Index>0</Index><BitLen>8</BitLen></Entry>
<Entry><Index>#x7000</Index><SubIndex>2</SubIndex><BitLen>16</BitLen><Name>CRC</Name></Entry>
<Entry><Index>#x7000</Index><SubIndex>3</SubIndex><BitLen>16</BitLen><Name>ID</Name></Entry>
</RxPdo></Device></Devices></Descriptions></EtherCATInfo>
"""
SLAVES = """\
ethercat_slaves:
  stop: {vendor_id: 0x00000002, product_code: 0x07703052, position: 4}
"""


def converted(*arguments: object):
    return fsn("convert", *map(str, arguments))


@pytest.mark.shows("R22")
@pytest.mark.parametrize("out", ["bus.eni.xml", "folder/", "deep/down/network.yaml"])
def test_there_and_back_compiles_to_the_same_plan(out: str, tmp_path: Path):
    there = converted(NETWORK, "-o", f"{tmp_path}/{out}")
    assert there.returncode == 0, there.stderr
    assert "5 SubDevices, 8 copies" in there.stdout
    back = converted(f"{tmp_path}/{out}", "-o", tmp_path / "back" / "network.yaml")
    assert back.returncode == 0, back.stderr
    assert copies(tmp_path / "back" / "network.yaml") == copies(NETWORK)


def copies(network: Path) -> list[dict]:
    shown = fsn("plan", str(network), "--format", "json")
    assert shown.returncode == 0, shown.stderr
    rows = json.loads(shown.stdout)["copies"]
    assert len(rows) == 8
    return [{k: v for k, v in row.items() if k != "net"} for row in rows]


@pytest.mark.parametrize(
    ("out", "to", "begin"),
    [
        ("bus.h", (), "#include <ecrt.h>"),
        ("bus.h", ("--to", "c"), "fsn_pdo_entry_info_t;"),
        ("hal.xml", (), '<modParam name="fsoeSlaveIdx" value="2"/>'),
        ("net.yaml", (), "name: net"),
        ("any.thing", ("--to", "eni"), "<EtherCATConfig"),
    ],
)
def test_target_is_chosen_by_extension_or_option(
    out: str, to: tuple[str, ...], begin: str, tmp_path: Path
):
    done = converted(NETWORK, "-o", tmp_path / out, *to)
    assert done.returncode == 0, done.stderr
    assert begin in (tmp_path / out).read_text("utf-8")


@pytest.mark.parametrize("out", ["bus.h", "hal.xml"])
def test_written_files_are_recognised_by_content(out: str, tmp_path: Path):
    assert converted(URDF, "-o", tmp_path / out).returncode == 0
    again = converted(tmp_path / out, "-o", tmp_path / "n" / "network.yaml")
    assert again.returncode == 0, again.stderr
    assert "2 SubDevices" in again.stdout


def test_older_keys_for_an_older_driver(tmp_path: Path):
    done = converted(URDF, "-o", tmp_path / "d", "--to", "driver-2025")
    assert done.returncode == 0, done.stderr
    assert "safety_modules:" in (tmp_path / "d" / "transfers.yaml").read_text("utf-8")
    assert "note: the cycle is not in these files; set control_frequency" in done.stderr


def test_an_esi_gives_the_process_data_of_a_device_named_elsewhere(tmp_path: Path):
    (tmp_path / "a.yaml").write_text(SLAVES, "utf-8")
    (tmp_path / "b.xml").write_text(ESI, "utf-8")
    done = converted(tmp_path / "b.xml", tmp_path / "a.yaml", "-o", tmp_path / "o" / "network.yaml")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "o" / "network.yaml").read_text("utf-8")
    assert "name: stop, alias: 0, position: 4" in text
    assert "index: 0x7000, sub_index: 2, type: uint16" in (
        tmp_path / "o" / "devices" / "stop.yaml"
    ).read_text("utf-8")


def test_an_esi_alone_gives_devices_without_a_place(tmp_path: Path):
    (tmp_path / "b.xml").write_text(ESI, "utf-8")
    done = converted(tmp_path / "b.xml", "-o", tmp_path / "o" / "network.yaml")
    assert done.returncode == 0, done.stderr
    assert "its ring position is not known; 0 is written" in done.stderr
    eni = converted(tmp_path / "b.xml", "-o", tmp_path / "x.eni.xml")
    assert eni.returncode == 1
    assert "no ring position" in eni.stderr


def test_nothing_is_overwritten(tmp_path: Path):
    (tmp_path / "devices").mkdir()
    (tmp_path / "devices" / "el1904.yaml").write_text("mine", "utf-8")
    done = converted(NETWORK, "-o", tmp_path / "network.yaml")
    assert done.returncode == 1
    assert "devices/el1904.yaml exists" in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["devices"]
    assert (tmp_path / "devices" / "el1904.yaml").read_text("utf-8") == "mine"


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("a.xml", b"<Project1/>", "FSN117"),
        ("a.txt", b"hello", "unsupported file type"),
        ("a.yaml", b"x: [", "FSN1"),
        ("a.sii", b"\0" * 20, "FSN138"),
        ("a.eni.xml", b"<EtherCATConfig><Config>", "FSN118"),
        ("a.h", b"ec_pdo_entry_info_t a[] = {\n{0x7000, 0x01, 8},\n", "FSN146"),
    ],
)
def test_foreign_and_damaged_files_are_refused(name: str, content: bytes, why: str, tmp_path: Path):
    (tmp_path / name).write_bytes(content)
    done = converted(tmp_path / name, "-o", tmp_path / "o" / "network.yaml")
    assert done.returncode == 1, done.stdout
    assert why in done.stderr
    assert not (tmp_path / "o").exists()


def test_unknown_target_and_missing_input_have_their_exit_codes(tmp_path: Path):
    assert converted(NETWORK, "-o", tmp_path / "x.esi.xml").returncode == 2
    assert converted(NETWORK, "-o", tmp_path / "x.what").returncode == 2
    missing = converted(tmp_path / "none.yaml", "-o", tmp_path / "n.yaml")
    assert missing.returncode == 1
    assert "FSN101" in missing.stderr
    wrong = converted(NETWORK, "--from", "eni", "-o", tmp_path / "n.yaml")
    assert wrong.returncode == 1
    assert "FSN140" in wrong.stderr


def test_two_files_of_different_buses_are_refused(tmp_path: Path):
    other = SLAVES.replace("position: 4", "position: 1")
    (tmp_path / "a.yaml").write_text(other, "utf-8")
    done = converted(NETWORK, tmp_path / "a.yaml", "-o", tmp_path / "o" / "network.yaml")
    assert done.returncode == 1
    assert "are these files of one bus?" in done.stderr


def test_a_slave_yaml_is_a_device_type(tmp_path: Path):
    (tmp_path / "a.yaml").write_text(SLAVES, "utf-8")
    device = ROOT / "examples" / "el6910" / "devices" / "el1904.yaml"
    done = converted(tmp_path / "a.yaml", device, "-o", tmp_path / "o" / "network.yaml")
    assert done.returncode == 0, done.stderr
    assert "1 SubDevice," in done.stdout
    assert "note: no copies are known" in done.stderr
    assert "rpdo:" in (tmp_path / "o" / "devices" / "stop.yaml").read_text("utf-8")


@pytest.mark.parametrize("comment", ["<!-- Slave 4 -->", ""])
def test_output_of_the_tool_for_one_device_gives_its_process_data(comment: str, tmp_path: Path):
    (tmp_path / "a.yaml").write_text(SLAVES.replace("0x07703052", "0x077a2c52"), "utf-8")
    text = "$ ethercat xml -p 4\n" + XML.replace("<!-- Slave 4 -->", comment)
    (tmp_path / "b.txt").write_text(text, "utf-8")
    done = converted(tmp_path / "a.yaml", tmp_path / "b.txt", "-o", tmp_path / "o" / "network.yaml")
    assert done.returncode == 0, done.stderr
    assert "1 SubDevice," in done.stdout
    assert "rpdo:" in (tmp_path / "o" / "devices" / "stop.yaml").read_text("utf-8")


def test_transfers_without_their_modules_are_not_network(tmp_path: Path):
    part = ROOT / "examples" / "estop" / "transfers.yaml"
    done = converted(part, "-o", tmp_path / "o" / "network.yaml")
    assert done.returncode == 1
    assert "name the URDF or network file too" in done.stderr


def test_capture_becomes_a_network(tmp_path: Path):
    capture = tmp_path / "start-up.pcap"
    capture.write_bytes(startup(cycles=300, alias=0))
    done = converted(capture, "-o", tmp_path / "network.yaml")
    assert done.returncode == 0, done.stderr
    assert "2 SubDevices, 2 copies" in done.stdout
    same = fsn("diff", str(capture), str(tmp_path / "network.yaml"))
    assert same.stdout.endswith("no difference\n"), same.stdout + same.stderr


def test_capture_without_a_start_up_is_refused_with_the_next_step(tmp_path: Path):
    made = Startup()
    made.cycle(Bus(), 30)
    capture = tmp_path / "middle.pcap"
    capture.write_bytes(made.pcap())
    done = converted(capture, "-o", tmp_path / "network.yaml")
    assert done.returncode != 0
    assert "FSN153" in done.stderr
    assert "fsoe-net decode" in done.stderr
    assert fsn("diff", str(capture), str(capture)).returncode == 1


def test_esi_fills_what_a_capture_does_not_show(tmp_path: Path):
    made = Startup()
    made.addresses()
    made.eeprom(LOGIC)
    made.eeprom(TERMINAL)
    capture, esi = tmp_path / "scan.pcap", tmp_path / "el1904.xml"
    capture.write_bytes(made.pcap())
    esi.write_text(ESI, "utf-8")
    done = converted(capture, esi, "-o", tmp_path / "network.yaml")
    assert done.returncode == 0, done.stderr
    assert "0x7000" in (tmp_path / "devices" / "terminal.yaml").read_text("utf-8")


# -- only the copies of an ENI --------------------------------------------------------------------


def eni_of_network(folder: Path) -> Path:
    """An ENI of the same bus as another tool has it: CRLF, a comment, no copies."""
    assert converted(NETWORK, "-o", folder / "made.eni.xml").returncode == 0
    data = (folder / "made.eni.xml").read_bytes()
    bare = re.sub(rb"\s*<CopyInfos>.*?</CopyInfos>", b"", data, flags=re.DOTALL)
    bare = bare.replace(b"<Config>", b"<Config><!-- kept \xc2\xb0 -->", 1).replace(b"\n", b"\r\n")
    (folder / "machine.eni.xml").write_bytes(bare)
    return folder / "machine.eni.xml"


def test_copies_of_a_network_go_into_an_eni_and_nothing_else_changes(tmp_path: Path):
    eni = eni_of_network(tmp_path)
    made = converted(NETWORK, eni, "-o", tmp_path / "out" / "new.eni.xml")
    assert made.returncode == 0, made.stderr
    assert "5 SubDevices, 8 copies, 1 file" in made.stdout
    assert "8 copies instead of 0, all else as it was" in made.stderr
    new = (tmp_path / "out" / "new.eni.xml").read_bytes()
    assert re.sub(rb"\s*<CopyInfos>.*?</CopyInfos>", b"", new, flags=re.DOTALL) == eni.read_bytes()
    same = fsn("diff", str(NETWORK), str(tmp_path / "out" / "new.eni.xml"))
    assert same.returncode == 0, same.stdout
    again = converted(NETWORK, tmp_path / "out" / "new.eni.xml", "-o", tmp_path / "twice.eni.xml")
    assert "8 copies instead of 8" in again.stderr
    assert (tmp_path / "twice.eni.xml").read_bytes() == new
    refused = converted(NETWORK, eni, "-o", tmp_path / "twice.eni.xml")
    assert refused.returncode == 1
    assert "exists" in refused.stderr


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"<ProductCode>125792338<", b"<ProductCode>77<", "not the same bus"),
        (b"<AutoIncAddr>65532<", b"<AutoIncAddr>65500<", "not the same bus"),
        (b"<BitLen>16</BitLen>", b"<BitLen>8</BitLen>", "holds other data"),
    ],
)
def test_an_eni_of_another_bus_is_refused_at_its_place(old, new, words, tmp_path: Path):
    eni = eni_of_network(tmp_path)
    data = eni.read_bytes()
    code = re.search(rb"<ProductCode>\d+<", data)
    assert code is not None
    old = code[0] if old.startswith(b"<ProductCode") else old
    assert old in data
    if b"BitLen" in old:  # inside the first frame, its length kept by the entry behind
        at = data.index(b"<BitLen>16</BitLen>")
        behind = data.index(b"<BitLen>16</BitLen>", at + 5)
        data = data[:behind] + b"<BitLen>24</BitLen>" + data[behind + 19 :]
        data = data[:at] + new + data[at + 19 :]
    else:
        data = data.replace(old, new, 1)
    eni.write_bytes(data)
    refused = converted(NETWORK, eni, "-o", tmp_path / "new.eni.xml")
    assert refused.returncode == 1, refused.stdout
    assert words in refused.stderr
    assert "network.yaml:" in refused.stderr
    assert "Traceback" not in refused.stderr
    assert not (tmp_path / "new.eni.xml").exists()


# What the way through each format takes away, and the note that tells it; everything else is back.
CYCLE = {("network", "cycle_ns"): "the cycle is not in"}
RESTART = {("entries", "restart_relevant"): "restart_relevant marks"}
FACTS = {
    ("connection", what): "addresses and watchdogs of connections"
    for what in ("address", "connection_id", "watchdog_ms", "app_parameters")
}
NO_COPIES = {("copy", None): "does not read back", ("connection", None): "does not read back"}
LOST: dict[str, dict[tuple[str, str | None], str]] = {
    "driver": CYCLE,
    "driver-2025": CYCLE,
    "driver-2026-06": CYCLE,
    "driver-2026-08": CYCLE,
    "eni": {**RESTART, **FACTS, ("copy", "net"): "names of nets"},
    "igh": {**CYCLE, **RESTART, **NO_COPIES},
    "c": {**CYCLE, **RESTART, **NO_COPIES},
    "lcec": {
        **RESTART,
        ("sync_manager", "watchdog"): "watchdogs of sync managers",
        ("sync_manager", None): "its PDOs are those that the driver has",
        ("subdevice", None): "its PDOs are those that the driver has",
        ("copy", None): "its frames are not copied",
        ("connection", None): "its frames are not copied",
    },
}


@pytest.mark.shows("R22")
@pytest.mark.parametrize("target", LOST)
def test_there_and_back_differs_only_in_what_was_reported(target: str, tmp_path: Path):
    suffix = {"eni": "a.eni.xml", "igh": "a.h", "c": "a.h", "lcec": "a.xml"}.get(target, "d")
    there = converted(NETWORK, "--to", target, "-o", tmp_path / suffix)
    assert there.returncode == 0, there.stderr
    back = converted(tmp_path / suffix, "-o", tmp_path / "back" / "network.yaml")
    assert back.returncode == 0, back.stderr
    diff = fsn("diff", str(NETWORK), str(tmp_path / "back" / "network.yaml"), "--format", "json")
    assert diff.returncode in (0, 1), diff.stderr
    changes = {(c["area"], c["what"]) for c in json.loads(diff.stdout)["changes"]}
    assert changes <= set(LOST[target])
    untold = [c for c in changes if LOST[target][c] not in there.stderr]
    assert untold == [], there.stderr
    check = fsn("check", str(tmp_path / "back" / "network.yaml"))
    missing = {"FSN125"} if ("copy", None) in changes else set()
    assert set(re.findall(r"error\[(FSN\d+)\]", check.stdout + check.stderr)) <= missing


def test_a_network_without_nets_is_compared(tmp_path: Path):
    """What somebody has made of a text without copies can be compared with that text."""
    assert converted(NETWORK, "-o", tmp_path / "bus.h").returncode == 0
    assert converted(tmp_path / "bus.h", "-o", tmp_path / "n" / "network.yaml").returncode == 0
    same = fsn("diff", str(tmp_path / "bus.h"), str(tmp_path / "n" / "network.yaml"))
    assert same.returncode == 0, same.stdout + same.stderr


def test_an_esi_next_to_a_network_fills_an_eni(tmp_path: Path):
    esi = tmp_path / "maker.xml"
    esi.write_text(
        "<EtherCATInfo><Vendor><Id>2</Id></Vendor><Descriptions><Devices>"
        '<Device Physics="KK"><Type ProductCode="#x077e3052" RevisionNo="#x00110000">EL1918'
        "</Type><Name>EL1918</Name></Device></Devices></Descriptions></EtherCATInfo>",
        "utf-8",
    )
    network = ROOT / "examples" / "estop" / "network.yaml"
    made = converted(network, esi, "-o", tmp_path / "bus.eni.xml")
    assert made.returncode == 0
    assert made.stderr.splitlines() == [
        "note: RevisionNo of ek1914 is not in this file; some tools need it",
        "note: Physics, mailbox, control bytes and SYNC0 times of ek1914 are not in this file",
        "note: name the ESI of the vendor as a further FILE to have that in it",
        "note: RevisionNo of el1918 is that of the ESI; compare with the devices",
        "note: restart_relevant marks of entries are not in this file",
        "note: names of nets are not in this file",
        "note: addresses and watchdogs of connections are not in this file",
    ]
    text = (tmp_path / "bus.eni.xml").read_text("utf-8")
    assert text.count("<RevisionNo>1114112</RevisionNo>") == 1
    assert text.count("<Physics>KK</Physics>") == 1


PLAIN_BUS = """<EtherCATConfig><Config><Slave><Info><Name>out</Name><AutoIncAddr>0</AutoIncAddr>
<VendorId>2</VendorId><ProductCode>131870802</ProductCode></Info><ProcessData>
<Send><BitStart>0</BitStart><BitLength>8</BitLength></Send>
<Sm2><Type>Outputs</Type><StartAddress>3840</StartAddress><Pdo>5632</Pdo></Sm2>
<RxPdo Sm="2"><Index>#x1600</Index><Name/><Entry><Index>#x7000</Index><SubIndex>1</SubIndex>
<BitLen>8</BitLen><Name>Output</Name></Entry></RxPdo></ProcessData></Slave></Config></EtherCATConfig>
"""


@pytest.mark.parametrize("target", LOST)
def test_a_bus_without_fsoe_goes_into_every_format(target: str, tmp_path: Path):
    (tmp_path / "plain.eni.xml").write_text(PLAIN_BUS, "utf-8")
    network = tmp_path / "n" / "network.yaml"
    assert converted(tmp_path / "plain.eni.xml", "-o", network).returncode == 0
    done = converted(network, "--to", target, "-o", tmp_path / "made")
    assert (done.returncode, "error" in done.stderr) == (0, False), done.stderr
    assert "note: no copies are known, so no safety frame would be moved" in done.stderr
    check = fsn("check", str(network))
    assert check.returncode == 0
    assert "info[FSN125]: no net is given" in check.stdout
    assert "fine for a bus without FSoE" in check.stdout


def test_a_network_with_frames_and_no_net_stays_an_error(tmp_path: Path):
    assert converted(NETWORK, "-o", tmp_path / "bus.h").returncode == 0
    assert converted(tmp_path / "bus.h", "-o", tmp_path / "n" / "network.yaml").returncode == 0
    check = fsn("check", str(tmp_path / "n" / "network.yaml"))
    assert check.returncode == 1
    assert "error[FSN125]" in check.stdout


ROBOT = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="place" default="0"/><ros2_control name="s" type="system">
<hardware><plugin>ethercat_driver/EthercatDriver</plugin></hardware>
<gpio name="g"><ec_module name="io"><plugin>ethercat_generic_plugins/GenericEcSlave</plugin>
<param name="position">$(arg place)</param>
<param name="slave_config">$(find cell)/io.yaml</param></ec_module></gpio></ros2_control></robot>
"""


def test_references_of_a_xacro_are_followed(tmp_path: Path):
    """With the options that its errors name."""
    robot = tmp_path / "r.xacro"
    robot.write_text(ROBOT, "utf-8")
    package = tmp_path / "cell"
    package.mkdir()
    (package / "io.yaml").write_text("vendor_id: 2\nproduct_id: 3\n", "utf-8")
    out = tmp_path / "made" / "network.yaml"
    done = converted(robot, "-o", out)
    assert "hint: pass --package cell=DIR" in done.stderr
    done = converted(robot, "--package", f"cell={package}", "--arg", "place:=4", "-o", out)
    assert done.returncode == 0, done.stderr
    assert "{name: io, alias: 0, position: 4" in out.read_text("utf-8")


TWO = """<robot name="r">{systems}</robot>"""
SYSTEM = """<ros2_control name="{name}" type="system">
<hardware><plugin>ethercat_driver/EthercatDriver</plugin>
<param name="master_id">{number}</param><param name="control_frequency">{hertz}</param></hardware>
<gpio name="{name}"><ec_module name="io_{name}">
<plugin>ethercat_generic_plugins/GenericEcSlave</plugin><param name="position">0</param>
<param name="slave_config">io.yaml</param></ec_module></gpio></ros2_control>"""


def test_two_masters_of_a_urdf_are_not_written_as_one_ring(tmp_path: Path):
    """Both would have a SubDevice at position 0."""
    robot = tmp_path / "r.urdf"
    rows = [("left", 0, 1000), ("right", 1, 500)]
    systems = "".join(SYSTEM.format(name=n, number=m, hertz=f) for n, m, f in rows)
    robot.write_text(TWO.format(systems=systems), "utf-8")
    (tmp_path / "io.yaml").write_text("vendor_id: 2\nproduct_id: 3\n", "utf-8")
    out = tmp_path / "made" / "network.yaml"
    done = converted(robot, "-o", out)
    assert done.returncode == 1
    assert (
        "2 EtherCAT masters are not one bus; choose one with --master: 0 or left, 1 or right"
        in (done.stderr)
    )
    for master, name, cycle in (("right", "io_right", 2000), ("0", "io_left", 1000)):
        done = converted(robot, "--master", master, "-o", out, "--overwrite")
        assert done.returncode == 0, done.stderr
        text = out.read_text("utf-8")
        assert [f"name: {n}," in text for n in ("io_left", "io_right")] == [
            name == "io_left",
            name == "io_right",
        ]
        assert f"cycle_us: {cycle}" in text
    done = converted(robot, "--master", "both", "-o", out, "--overwrite")
    assert "this URDF has no EtherCAT master 'both'" in done.stderr
    assert "choose one with --master: 0 or left, 1 or right" in done.stderr
