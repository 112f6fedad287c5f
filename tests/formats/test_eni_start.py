"""ENI for other tools: what an ESI adds, and readers that are not ours."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from data_files import ROOT, need
from described import bus
from formats.eni_with_esi import with_esi

from fsoe_net.formats.eni.read import load_eni
from fsoe_net.formats.eni.write import eni_notes, write_eni
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.description import Description, StartFacts

# Children in the order in which an ENI (ETG.2100) has them.
ORDER = {
    "Slave": ("Info", "ProcessData", "Mailbox", "InitCmds", "PreviousPort", "HotConnect", "DC"),
    "ProcessData": ("Send", "Recv", *(f"Sm{n}" for n in range(16)), "RxPdo", "TxPdo"),
    "Send": ("BitStart", "BitLength", "Start", "Length"),
    "Recv": ("BitStart", "BitLength", "Start", "Length", "PollTime", "StatusBitAddr"),
    "Mailbox": ("Send", "Recv", "BootStrap", "Protocol", "CoE"),
    "DC": ("PotentialReferenceClock", "ReferenceClock", "CycleTime0", "CycleTime1", "ShiftTime"),
    "Validate": ("Data", "DataMask", "Timeout"),
    "Entry": ("Index", "SubIndex", "BitLen", "Name", "DataType"),
    "Master": ("Info", "MailboxStates", "EoE", "InitCmds"),
    "Config": ("Master", "Slave", "Cyclic", "ProcessImage"),
}
INFO = (
    *("Name", "PhysAddr", "AutoIncAddr", "Physics", "VendorId", "ProductCode"),
    *("RevisionNo", "SerialNo"),
)
REGISTER = (
    *(
        "Transition",
        "BeforeSlave",
        "Comment",
        "Requires",
        "Cmd",
        "Adp",
        "Ado",
        "Data",
        "DataLength",
    ),
    *("Cnt", "Retries", "Validate", "Timeout"),
)
SDO = ("Transition", "Comment", "Timeout", "Ccs", "Index", "SubIndex", "Data", "Disabled")
SM = ("Type", "MinSize", "MaxSize", "DefaultSize", "StartAddress", "ControlByte", "Enable", "Pdo")


def misplaced(element: ElementTree.Element, parents: tuple[str, ...] = ()) -> list[str]:
    """Return the elements that are not where ETG.2100 has them."""
    tag = element.tag
    if tag == "Info" and "Slave" in parents:
        order: tuple[str, ...] | None = INFO
    elif tag == "InitCmd":
        order = SDO if "CoE" in parents else REGISTER
    else:
        order = SM if tag.startswith("Sm") and tag[2:].isdigit() else ORDER.get(tag)
    names = [child.tag for child in element]
    wrong = []
    if order is not None and names and tag != "ProcessData":
        places = [order.index(n) if n in order else -1 for n in names]
        wrong = [f"{tag}: {names}"] if places != sorted(places) or -1 in places else []
    return wrong + [w for child in element for w in misplaced(child, (*parents, tag))]


def slaves(text: str) -> list[ElementTree.Element]:
    root = ElementTree.fromstring(text)
    assert misplaced(root) == []
    return root.findall("Config/Slave")


def texts(element: ElementTree.Element, path: str) -> list[str]:
    return [e.text or "" for e in element.findall(path)]


def test_an_esi_gives_what_a_network_does_not_hold():
    logic, one, two = slaves(write_eni(with_esi()))
    assert [e.tag for e in logic.findall("Info/*")] == list(INFO)
    assert texts(logic, "Info/Physics") + texts(one, "Info/Physics") == ["KK", "YKY"]
    # The network says 0x120000 of the logic and nothing of the terminals.
    assert [texts(s, "Info/RevisionNo") for s in (logic, one, two)] == [[str(0x120000)]] * 3
    assert [s.find("Mailbox") is None for s in (logic, one, two)] == [False, True, True]
    assert texts(logic, "Mailbox/Send/*") == ["4096", "256"]
    assert texts(logic, "Mailbox/Recv/*") == ["4352", "512", "20"]
    assert texts(logic, "Mailbox/Protocol") == ["CoE", "FoE"]
    assert texts(logic, "ProcessData/Sm2/ControlByte") == ["100"]
    assert texts(logic, "ProcessData/Sm2/StartAddress") == [str(0x1200)]  # the network's own


def test_start_up_sdos_assign_pdos_and_write_those_that_are_not_fixed():
    logic = slaves(write_eni(with_esi()))[0]
    rows = [
        f"{int(i.findtext('Index') or 0):04x}:" + " ".join(texts(i, "SubIndex") + texts(i, "Data"))
        for i in logic.findall("Mailbox/CoE/InitCmds/InitCmd")
    ]
    assert rows == [
        "17f0:0 00",
        "17f0:1 080088f7",
        "17f0:0 01",
        *("1c12:0 00", "1c12:1 0016", "1c12:2 0116", "1c12:3 f017", "1c12:0 03"),
        *("1c13:0 00", "1c13:1 001a", "1c13:2 011a", "1c13:3 ff1b", "1c13:0 03"),
        "8000:1 0700",
    ]


def test_mailbox_registers_are_set_before_preop_and_states_are_waited_for():
    logic = slaves(write_eni(with_esi()))[0]
    rows = [
        (texts(i, "Transition")[0], int(texts(i, "Ado")[0]), texts(i, "Data")[0])
        for i in logic.findall("InitCmds/InitCmd")
    ]
    assert rows[:5] == [
        ("IP", 0x0010, "e903"),
        ("IP", 0x0800, "0010000126000100"),
        ("IP", 0x0808, "0011000222000100"),
        ("IP", 0x0120, "0200"),
        ("IP", 0x0130, "0000"),
    ]
    assert texts(logic, "InitCmds/InitCmd/Validate/Data") == ["0200", "0400", "0800"]
    assert ("PS", 0x0810, "00120d0064000100") in rows


def test_the_clock_divides_the_bus_cycle_as_the_esi_states():
    description = with_esi()
    parts = list(description.subdevices)
    for number in (0, 1):
        sub = parts[number]
        parts[number] = replace(sub, device=replace(sub.device, assign_activate=0x0300))
    logic, one, _ = slaves(write_eni(replace(description, subdevices=tuple(parts))))
    assert texts(logic, "DC/*") == ["true", "1000000", "0", "-500"]  # 2 ms, divided by 2
    assert texts(one, "DC/*") == ["false"]  # the ESI has no clock for it
    assert [
        i.findtext("Data")
        for i in logic.findall("InitCmds/InitCmd")
        if i.findtext("Ado") == str(0x09A0)
    ] == ["40420f0000000000"]


def test_missing_facts_are_named_with_the_next_step():
    assert eni_notes(bus(2)) == [
        "RevisionNo of terminal 0 <ä> & co, terminal 1 <ä> & co is not in this file; "
        "some tools need it",
        "Physics, mailbox, control bytes and SYNC0 times of logic, terminal 0 <ä> & co, "
        "terminal 1 <ä> & co are not in this file",
        "name the ESI of the vendor as a further FILE to have that in it",
    ]
    assert eni_notes(with_esi()) == [
        "RevisionNo of terminal 0 <ä> & co, terminal 1 <ä> & co is that of the ESI; "
        "compare with the devices"
    ]
    assert "<RevisionNo>" not in str(slaves(write_eni(bus(1)))[1].find("Info"))


def facts(description: Description) -> list[tuple[object, ...]]:
    return [
        (s.name, s.position, s.serial, s.device, s.start and (s.start.physics, s.start.mailbox))
        for s in description.subdevices
    ]


@pytest.mark.parametrize("real", [False, True])
def test_a_second_round_changes_nothing(real: bool):
    given = with_esi()
    if real:
        loaded = load_eni(need("eni", "kpierczy_test_eni.xml").read_bytes(), Collector())
        assert loaded is not None
        given = loaded
    out = Collector()
    again = load_eni(write_eni(given).encode(), out)
    assert again is not None
    assert out.diagnostics == []
    assert [s.start and s.start.mailbox for s in again.subdevices] == [
        s.start and s.start.mailbox for s in given.subdevices
    ]
    twice = load_eni(write_eni(again).encode(), Collector())
    assert twice is not None
    assert facts(twice) == facts(again)
    assert twice.subdevices[0].start == again.subdevices[0].start
    assert isinstance(again.subdevices[0].start, StartFacts)
    if real:
        assert facts(again) == facts(given)


def soem_tree() -> Path:
    """Return a source tree of SOEM 2, or skip; SOEM 1.4 has no such script."""
    tree = Path(os.environ.get("FSN_SOEM_TREE", ROOT / "build" / "soem2"))
    script = tree / "scripts" / "eniconv.py"
    if not script.is_file():
        pytest.skip(f"no {script}; set FSN_SOEM_TREE to a source tree of SOEM 2")
    return script


def test_soem_2_takes_the_start_up_sdos_of_every_subdevice(tmp_path: Path):
    script = soem_tree()
    eni, made = tmp_path / "bus.eni.xml", tmp_path / "eni.c"
    eni.write_text(write_eni(with_esi()), "utf-8")
    command = [sys.executable, str(script), str(eni), str(made)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (0, "")
    text = made.read_text()
    assert ".slavecount = 1" in text  # the terminals have no mailbox
    assert f".RevisionNo = {0x120000}" in text
    assert ".CoECmdCount = 14" in text
