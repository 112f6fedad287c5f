"""TwinCAT 3 projects: the ring, its copies, and the safety project beside."""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest
from cli.tool import fsn
from formats import twincat_text as tc

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.recognise import find_format
from fsoe_net.formats.registry import all_formats, read_foreign
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.twincat.read import load_twincat
from fsoe_net.formats.twinsafe.read import load_twinsafe
from fsoe_net.model.bus import Watchdog
from fsoe_net.model.description import Description


def read(path: Path) -> Description:
    out = Collector()
    found = load_twincat(path, out)
    assert [(d.code, d.message) for d in out.diagnostics if d.level is not Severity.INFO] == []
    assert found is not None
    return found


def said(text: str, name: str = "<tsproj>") -> list[tuple[str, str]]:
    out = Collector()
    load_twincat(text.encode(), out, name=name)
    assert all(d.hint for d in out.diagnostics)
    return [(d.code, d.message) for d in out.diagnostics]


# -- what is read ---------------------------------------------------------------------------------


@pytest.mark.parametrize("turned", [False, True])
def test_a_machine_with_its_safety_project(turned: bool, tmp_path: Path):
    path = tc.write(tmp_path, turned=turned)
    found = read(path)
    assert [(s.name, s.order, s.position, s.revision) for s in found.subdevices] == [
        ("Term 1 (EK1100)", "EK1100", 0, 0x120000),
        ("Term 2 (EL6910)", "EL6910", 1, 0x120000),
        ("Term 3 (EL1904)", "EL1904", 2, 0x120000),
        ("Term 4 (EL2904)", "EL2904", 3, 0x120000),
    ]
    rows = [
        (c.main, c.sub, c.slot, c.address, c.connection_id, c.watchdog_ms)
        for c in found.connections
    ]
    assert rows == [(1, 2, 0, 5, 11, 120), (1, 3, 1, 6, 12, 140)]
    first = found.connections[0]
    assert Path(first.span.file).name == "Term 3 (EL1904) - Module 1 (FSOES).sds"
    assert first.at("SAddress").line == 8
    ends = {
        (
            (c.source.subdevice, c.source.bit_offset),
            (c.destination.subdevice, c.destination.bit_offset),
        )
        for c in found.copies
    }
    assert ends == {((1, 0), (2, 0)), ((2, 0), (1, 0)), ((1, 48), (3, 0)), ((3, 0), (1, 48))}
    assert {(c.bits, c.fsoe) for c in found.copies} == {(48, True)}


@pytest.mark.parametrize(("logic", "address"), [("Term 2 (EL6910)", 5), ("Other (EL6910)", None)])
def test_a_safety_project_of_another_logic_is_silent_of_this_one(
    logic: str, address: int | None, tmp_path: Path
):
    path = tc.write(tmp_path)
    target = tmp_path / "Safe" / "TargetSystemConfig.xml"
    target.write_text(target.read_text("utf-8").replace("Term 2 (EL6910)", logic), "utf-8")
    found = load_twincat(path, Collector())
    assert found is not None
    assert found.connections[0].address == address


def test_messages_of_a_logic_are_frames(tmp_path: Path):
    brain = read(tc.write(tmp_path)).subdevices[1]
    outputs, inputs = brain.device.layout.managers
    assert (outputs.sm.index, outputs.sm.start_byte, outputs.sm.watchdog) == (
        2,
        0x1200,
        Watchdog.ENABLE,
    )
    assert [(b.byte_offset, b.frame_bytes, b.command.address) for b in outputs.blocks] == [
        (0, 6, "0x7000:01"),
        (6, 6, "0x7010:01"),
    ]
    assert [(b.byte_offset, b.frame_bytes, b.command.address) for b in inputs.blocks] == [
        (0, 6, "0x6000:01"),
        (6, 6, "0x6010:01"),
    ]
    signals = outputs.placed[-1].entry
    assert (signals.address, signals.bits) == ("0xf788:00", 8)
    assert brain.notes == (
        "its objects are numbered as in the device library, not as in TwinCAT: compare them "
        "with the device (`ethercat pdos`)",
        "Standard In Var 1 (Restart) is linked to MAIN.restart",
    )
    assert brain.start is not None
    assert brain.start.mailbox is not None
    assert brain.start.mailbox.to_sub == (0x1000, 256)


def test_a_part_of_a_project_is_read_from_its_folder(tmp_path: Path):
    whole = tc.machine(safety="")
    begin, end = whole.index("<Device "), whole.index("</Device>") + len("</Device>")
    part = whole[begin:end].replace(f"<Name>{tc.MASTER}</Name>", "<Name>__FILENAME__</Name>", 1)
    folder = tmp_path / "_Config" / "IO"
    folder.mkdir(parents=True)
    xti = folder / f"{tc.MASTER}.xti"
    xti.write_text(f"<TcSmItem>{tc.FSOE_TYPES}{part}</TcSmItem>", "utf-8")
    path = tmp_path / "machine.tsproj"
    named = f'<Device File="{tc.MASTER}.xti"/>'
    path.write_text(whole[:begin] + named + whole[end:], "utf-8")
    split, alone = read(path), read(xti)
    assert [s.name for s in split.subdevices] == [s.name for s in alone.subdevices]
    assert len(split.subdevices) == 4
    assert len(split.copies) == 4
    assert [(c.main, c.sub, c.address) for c in split.connections] == [(1, 2, None), (1, 3, None)]
    assert alone.copies == ()


@pytest.mark.parametrize("disabled", ["", 'Disabled="true"'])
def test_a_box_that_is_a_file_with_what_is_at_its_place(disabled: str, tmp_path: Path):
    """Beside its file a box has where it is plugged in; whether it is used may stand there, too."""
    folder = tmp_path / "_Config" / "IO" / tc.MASTER
    folder.mkdir(parents=True)
    box = tc.box(2, "__FILENAME__", "EL1904", 0x07703052)
    (folder / "Term 2 (EL1904).xti").write_text(f"<TcSmItem>{box}</TcSmItem>", "utf-8")
    inside = (
        f'<Device Id="1"><Name>{tc.MASTER}</Name><EtherCAT/>'
        f"{tc.box(1, 'Term 1 (EK1100)', 'EK1100', 0x044C2C52)}"
        f'<Box File="Term 2 (EL1904).xti" {disabled}><EtherCAT PortABoxInfo="#x01000001"/></Box>'
    )
    path = tmp_path / "machine.tsproj"
    project = f"<TcSmProject><Project><Io>{inside}</Device></Io></Project></TcSmProject>"
    path.write_text(project, "utf-8")
    names = [s.name for s in read(path).subdevices]
    assert names == ["Term 1 (EK1100)", *([] if disabled else ["Term 2 (EL1904)"])]


def test_each_of_several_masters_is_read_by_its_name():
    whole = tc.machine(safety="")
    begin, end = whole.index("<Device "), whole.index("</Device>") + len("</Device>")
    other = (
        '<Device Id="2"><Name>Device 2 (EtherCAT)</Name><EtherCAT/>'
        f"{tc.box(1, 'Far (EK1100)', 'EK1100', 0x044C2C52)}</Device>"
    )
    off = other.replace("Device 2", "Device 3").replace('Id="2"', 'Id="2" Disabled="true"')
    text = (whole[:end] + other + off + whole[end:]).encode()
    assert begin > 0
    out = Collector()
    first = load_twincat(text, out)
    assert first is not None
    assert len(first.subdevices) == 4
    (choice,) = [d for d in out.diagnostics if "masters" in d.message]
    assert choice.level is Severity.WARNING
    assert choice.hint == "--master 'Device 2 (EtherCAT)' reads another one"
    out = Collector()
    second = load_twincat(text, out, master="Device 2 (EtherCAT)")
    assert second is not None
    assert [s.name for s in second.subdevices] == ["Far (EK1100)"]
    assert [d for d in out.diagnostics if "masters" in d.message] == []
    assert load_twincat(text, out, master="Device 3 (EtherCAT)") is None
    assert out.diagnostics[-1].code == "FSN140"
    known = "'Device 1 (EtherCAT)', 'Device 2 (EtherCAT)'"
    assert out.diagnostics[-1].hint == f"choose one with --master: {known}"


def test_a_box_alone_is_a_bus_of_what_hangs_on_it(tmp_path: Path):
    inside = tc.logic(2, (3,)) + tc.terminal(3, "EL1904", 0x07703052)
    coupler = tc.box(1, "__FILENAME__", "EK1100", 0x044C2C52, more=inside)
    path = tmp_path / "Term 1 (EK1100).xti"
    path.write_text(f"<TcSmItem>{tc.FSOE_TYPES}{coupler}</TcSmItem>", "utf-8")
    assert find_format(path, Collector()).kind == "twincat"
    found = read(path)
    assert [(s.name, s.position) for s in found.subdevices] == [
        ("Term 1 (EK1100)", 0),
        ("Term 2 (EL6910)", 1),
        ("Term 3 (EL1904)", 2),
    ]
    assert (found.copies, found.connections) == ((), ())


@pytest.mark.parametrize(
    ("file", "subs"),
    [
        ("Safe/Safe.splcproj", 2),
        ("Safe/Group1/Group1.sal", 2),
        ("Safe/Group1/Alias Devices/Term 4 (EL2904) - Module 1 (FSOES).sds", 1),
    ],
)
def test_a_safety_project_alone_has_connections_without_a_ring(
    file: str, subs: int, tmp_path: Path
):
    tc.write(tmp_path)
    out = Collector()
    assert find_format(tmp_path / file, out).kind == "twinsafe"
    found = read_foreign(tmp_path / file, all_formats()["twinsafe"], out)
    assert out.diagnostics == []
    assert found is not None
    assert found.format == "twinsafe"
    assert [(s.order, s.module_ident) for s in found.subdevices[1:]][-1] == ("EL2904", (190,))
    last = found.connections[-1]
    assert (last.address, last.connection_id, last.watchdog_ms, last.slot) == (6, 12, 140, None)
    assert len(found.connections) == subs


def test_a_logic_that_is_a_sub_instance_is_on_the_other_side(tmp_path: Path):
    path = tc.write(tmp_path)
    file = next(tmp_path.rglob("Term 3*.sds"))
    file.write_text(tc.alias(3, 5, 11, 120, mode="slave"), "utf-8")
    assert [(c.main, c.sub) for c in read(path).connections] == [(2, 1), (1, 3)]


# -- what is said ---------------------------------------------------------------------------------


def test_a_safety_project_that_is_not_there(tmp_path: Path):
    path = tmp_path / "machine.tsproj"
    for text in ("..\\Safe.splcproj", "C:\\Safe.splcproj", "/etc/passwd", "Safe\\Safe.splcproj"):
        path.write_text(tc.machine(safety=text), "utf-8")
        assert said(path.read_text(), str(path)) == [
            (
                "FSN147",
                f"the safety project {text!r} is not here, so FSoE addresses, connection IDs and "
                "watchdogs are not known",
            )
        ]


def test_two_masters_and_a_frame_that_leaves_the_ring():
    second = tc.terminal(30, "EL1904", 0x07703052)
    more = f'<Device Id="2"><Name>Device 2</Name>{second}<EtherCAT/></Device>'
    boxes = tc.logic(1, (3,))
    away = tc.link(3, "Term 1 (EL6910)", "x").replace(
        f"TIID^{tc.MASTER}^x", "TIID^Device 2^Term 30 (EL1904)"
    )
    assert said(tc.project(boxes, away, more=more)) == [
        (
            "FSN147",
            "this project has 2 EtherCAT masters; Device 1 (EtherCAT) is read, Device 2 not",
        ),
        (
            "FSN148",
            "Message_3 of Term 1 (EL6910) is linked to Device 2 ^ Term 30 (EL1904) ^ "
            "Module 1 (FSOES) ^ RxPDO ^ FSOE, which is not on this ring",
        ),
    ]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "FSOE_6</Type>",
            "ODD_TYPE</Type>",
            ("FSN147", "EL6910: the length of 'ODD_TYPE' is not stated, so the process data"),
        ),
        (
            "USINT</Type>",
            "UINT</Type>",
            ("FSN143", "Term 3 (EL1904): the PDOs of SM2 have 56 bits"),
        ),
        ("<SyncMan>0012", "<SyncMan>zz12", ("FSN141", "EL6910: a sync manager is 12 bytes")),
        (
            'ProductCode="#x1afe3052"',
            'ProductCode="#x1afe305200"',
            ("FSN141", "ProductCode '#x1afe305200' of EL6910 is not a number from 0 to 4294967295"),
        ),
        ("^RxPDO^FSOE", "^RxPDO^FSOG", ("FSN145", "no variable is Device 1 (EtherCAT) ^ Term 1")),
        (
            'Index="#x1a00" SyncMan',
            'Index="zz" SyncMan',
            ("FSN141", "a PDO of EL6910 has no number"),
        ),
    ],
)
def test_unsupported_elements_are_reported(old: str, new: str, expected: tuple[str, str]):
    text = tc.machine(safety="")
    assert old in text
    found = said(text.replace(old, new))
    assert [row for row in found if row[0] == expected[0] and row[1].startswith(expected[1])], found


def test_a_disabled_box_is_left_out_and_named():
    text = tc.machine(safety="").replace('<Box Id="4"', '<Box Id="4" Disabled="true"')
    out = Collector()
    found = load_twincat(text.encode(), out)
    assert found is not None
    assert [s.order for s in found.subdevices] == ["EK1100", "EL6910", "EL1904"]
    assert ("FSN147", "not read: Term 4 (EL2904) (disabled)") in [
        (d.code, d.message) for d in out.diagnostics
    ]


# -- hostile files --------------------------------------------------------------------------------


@pytest.mark.parametrize("file", ["../x.xti", "..\\x.xti", "C:\\x.xti", "/etc/passwd", "", ".."])
def test_parts_are_only_read_from_their_own_folder(file: str, tmp_path: Path):
    folder = tmp_path / "deep"
    folder.mkdir()
    (tmp_path / "x.xti").write_text(f"<TcSmItem>{tc.box(7, 'secret', 'X', 1)}</TcSmItem>", "utf-8")
    text = tc.machine(safety="").replace('<Box Id="4"', f'<Box File="{file}"/><Box Id="4"')
    path = folder / "machine.tsproj"
    path.write_text(text, "utf-8")
    out = Collector()
    found = load_twincat(path, out)
    assert found is not None
    assert "secret" not in [s.name for s in found.subdevices]
    assert [d.code for d in out.diagnostics] == ["FSN147"]


def test_names_are_fit_to_be_shown_and_links_still_find_them():
    text = tc.machine(safety="").replace("Term 3 (EL1904)", "Term 3&#x9b;31m (EL1904)")
    out = Collector()
    found = load_twincat(text.encode(), out)
    assert found is not None
    assert found.subdevices[2].name == "Term 3\\u009b31m (EL1904)"
    assert len(found.copies) == 4
    assert [d.level for d in out.diagnostics] == [Severity.INFO] * len(out.diagnostics)


def test_entities_are_refused():
    text = '<!DOCTYPE a [<!ENTITY x "y">]>' + tc.machine(safety="").partition("\n")[2]
    assert [row[0] for row in said(text)] == ["FSN118"]
    out = Collector()
    assert load_twinsafe(b"<!DOCTYPE a><SafetyDeviceDesc/>", out) is None
    assert [d.code for d in out.diagnostics] == ["FSN118"]


def test_many_links_and_names_cost_no_more_than_their_number():
    boxes = tc.logic(1, tuple(range(1, tc.BIG))) + tc.terminal(2, "EL1904", 0x07703052)
    links = "".join(
        tc.link(n, "Term 1 (EL6910)", "Term 2 (EL1904)") for n in range(1, tc.BIG)
    ) + tc.link(1, "^" * 100_000, "^" * 100_000)
    begin = time.monotonic()
    load_twincat(tc.project(boxes, links * 20).encode(), Collector())
    assert time.monotonic() - begin < 30


def test_damaged_text_is_read_or_refused():
    dice = random.Random("twincat")
    for seed in (tc.machine(safety=""), tc.alias(3, 5, 11, 120)):
        for _ in range(150):
            data = bytearray(seed.encode())
            for _ in range(dice.randint(1, 6)):
                at = dice.randrange(len(data))
                data[at : at + dice.randint(0, 9)] = dice.randbytes(dice.randint(0, 5))
            for reader in (load_twincat, load_twinsafe):
                out = Collector()
                found = reader(bytes(data), out)
                assert found is not None or out.diagnostics


# -- in the commands ------------------------------------------------------------------------------


def test_init_check_and_convert_take_a_project(tmp_path: Path):
    path = tc.write(tmp_path)
    out = tmp_path / "cell"
    done = fsn("init", str(path), "--no-input", "-o", str(out))
    assert done.returncode == 0, done.stderr
    assert "4 SubDevices, 2 FSoE connections, 0 of them unconfirmed" in done.stdout
    network = out / "network.yaml"
    same = fsn("check", str(network), str(path))
    assert same.returncode == 0, same.stdout
    assert "warning[" not in same.stdout
    text = network.read_text("utf-8")
    assert "address: 5" in text
    network.write_text(text.replace("address: 5", "address: 15"), "utf-8")
    for other in (path, tmp_path / "Safe" / "Safe.splcproj"):
        checked = fsn("check", str(network), str(other))
        assert checked.returncode == 1
        assert (
            "error[FSN446]: term_2_el6910 with term_3_el1904: FSoE address 15, 5 in "
            f"{other}" in checked.stdout
        ), checked.stdout
        assert "Term 3 (EL1904) - Module 1 (FSOES).sds:8:14: the value there" in checked.stdout
    eni = fsn("convert", str(path), "-o", str(tmp_path / "a.eni.xml"))
    assert eni.returncode == 0, eni.stderr
    assert "4 SubDevices, 4 copies, 1 file" in eni.stdout


def test_a_folder_with_a_project_is_read_through_the_project(tmp_path: Path):
    tc.write(tmp_path / "machine")
    done = fsn("init", str(tmp_path / "machine"), "--no-input", "-o", str(tmp_path / "cell"))
    assert done.returncode == 0, done.stderr
    assert "FSN158" not in done.stderr
    assert "4 SubDevices, 2 FSoE connections, 0 of them unconfirmed" in done.stdout
