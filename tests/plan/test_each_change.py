"""Nothing that matters lies outside the fingerprint: each change of each file, each byte of a plan.

Every change of a place is refused, or gives another fingerprint, or stands in a table of what is
left out for a reason; `docs/reference/fingerprint.md` has the same reasons for people.
"""

from __future__ import annotations

import re
import shutil
import struct
from collections.abc import Callable
from pathlib import Path

import changed
import pytest
from cases_file import DIAGNOSTICS
from core.plan_builder import fix_crc
from core.rig import load
from networks import example

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.errors import FsnError, PlanFormatError
from fsoe_net.network import convert
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import Fingerprint, fingerprint_of
from fsoe_net.plan.records import RECORDS
from fsoe_net.project.check import check_files

BASE = DIAGNOSTICS / "base"


def _of_files(*files: str) -> Fingerprint | None:
    """Return the fingerprint of a network without errors; ``None``: refused."""
    checked = check_files(list(files))
    if any(d.level is Severity.ERROR for d in checked.diagnostics):
        return None
    return fingerprint_of(compile_plan(checked.resolution))


def _converted(file: str) -> Path | None:
    """Return the network that is made from a description of a bus or a device; None: refused."""
    folder = Path("made")
    shutil.rmtree(folder, ignore_errors=True)
    try:
        convert(file, to="network").save(folder)
    except FsnError:
        return None
    return folder / "network.yaml"


def _of_eni() -> Fingerprint | None:
    """Return the fingerprint of an ENI, which cannot say who holds the MainInstance."""
    network = _converted("bus.eni.xml")
    if network is None:
        return None
    text = network.read_text("utf-8")
    network.write_text(text.replace("- name:", "- safety_master: logic\n    name:"), "utf-8")
    return _of_files(str(network))


def _of_esi() -> Fingerprint | None:
    """Return the fingerprint of a bus whose coupler is described by an ESI."""
    made = _converted("coupler.xml")
    if (
        made is None
        or (row := re.search(r"config: (\S+),( revision: \w+)?", made.read_text("utf-8"))) is None
    ):
        return None
    text = Path("network.yaml").read_text("utf-8")
    stated = f"config: made/{row[1]},{row[2] or ' alias: 0'}" + "}"
    Path("esi.yaml").write_text(text.replace("config: devices/ek1914.yaml}", stated, 1), "utf-8")
    return _of_files("esi.yaml")


# A drive with every key that a slave YAML has.
RICH = """\
vendor_id: 0x29c
product_id: 0x3811fda
assign_activate: 0x0300
auto_fault_reset: true
auto_state_transitions: false
sm:
  - {index: 2, type: output, pdo: rpdo, watchdog: enable}
  - {index: 3, type: input, pdo: tpdo, watchdog: disable}
sdo:
  - {index: 0x1c32, sub_index: 1, type: uint16, value: 2}
sdo_check:
  - {index: 0x1018, sub_index: 1, type: uint32, value: 0x29c}
rpdo:
  - index: 0x1600
    channels:
      - {index: 0x6040, sub_index: 0, type: uint16, default: 6}
      - {index: 0x607a, sub_index: 0, type: int32, command_interface: set, factor: 2.5, offset: 3}
      - {index: 0x60fe, sub_index: 1, type: uint8, name: lamps, mask: 0x0f, restart_relevant: true}
      - {index: 0x60fe, sub_index: 2, type: uint8, skip: true}
tpdo:
  - index: 0x1a00
    channels:
      - {index: 0x6041, sub_index: 0, type: uint16, state_interface: status}
      - {index: 0x6064, sub_index: 0, type: int32, state_interface: position, factor: 0.5}
      - index: 0x60fd
        sub_index: 0
        type: uint8
        data_mapping:
          - {addr_offset: 0, type: bool, mask: 1, state_interface: left, factor: 2}
          - {addr_offset: 0, type: bool, mask: 2, state_interface: right, offset: 1}
"""
# A safety function with all keys of a safe bit.
BITS = """\
version: 1
subdevices:
  - {name: io, position: 0, config: devices/ek1914.yaml}
  - {name: logic, position: 1, config: devices/el6910.yaml}
nets:
  - name: safety
    safety_master: logic
    connections:
      - {main: logic, slot: 0, sub: io, address: 1, connection_id: 10, watchdog_ms: 100}
safety_functions:
  - name: estop
    elements:
      - {kind: input, sub: io, bits: [{bit: 0, name: ES1}, {bit: 1, name: ES2}]}
      - {kind: logic, sub: logic}
      - {kind: output, sub: io, bits: [{slot: 0, bit: 0, name: K1}, {slot: 0, bit: 1, name: K2}]}
"""
# Name: the file that changes, what gives the fingerprint.
FILES: dict[str, tuple[str, Callable[[], Fingerprint | None]]] = {
    "network": ("timed.yaml", lambda: _of_files("timed.yaml")),
    "terminal": ("devices/ek1914.yaml", lambda: _of_files("network.yaml")),
    "drive": ("devices/drive.yaml", lambda: _of_files("robot.urdf")),
    "bits": ("bits.yaml", lambda: _of_files("bits.yaml")),
    "rich": ("devices/rich.yaml", lambda: _of_files("rich.yaml")),
    "transfers": ("transfers.yaml", lambda: _of_files("robot.urdf")),
    "urdf": ("robot.urdf", lambda: _of_files("robot.urdf")),
    "eni": ("bus.eni.xml", _of_eni),
    "esi": ("coupler.xml", _of_esi),
}
ENI = """
    Addr Ado Adp AutoIncAddr ByteSize Ccs Cmd Cnt Data DataLength DefaultSize Destination Enable
    EtherType Info InitCmd InitCmds InputOffs Inputs Master Name OutputOffs Outputs PhysAddr
    ProcessImage Protocol Requires Retries Source StartAddress State SubIndex Timeout Transition
"""
ESI = """
    BitLen CoE ControlByte DefaultSize Entry Exclude Fixed Index LcId Mailbox Mandatory Name
    PdoAssign RevisionNo RxPdo Sm StartAddress SubIndex
"""
XML_HEAD = {"xml", "encoding", "Version", "version"}
# Keys whose change may leave the fingerprint as it is; the page of the fingerprint says why.
SAME: dict[str, set[str]] = {
    "network": {"name", "safety_master"},
    "terminal": {"#"},
    "drive": {"#"},
    "bits": {"safety_master"},
    "rich": set(),
    "transfers": {"plugin", "alias"},
    "urdf": {"param", "command_interface", "name", "type", "plugin", *XML_HEAD},
    "eni": {*ENI.split(), *XML_HEAD},
    "esi": {*ESI.split(), *XML_HEAD},
}
# Of an XML file what stands twice is read once.
CASES = [
    (name, way)
    for name in FILES
    for way in changed.WAYS
    if way != "twice" or not FILES[name][0].endswith(("xml", "urdf"))
]


def _key(text: str, change: str) -> str:
    """Return the key, element or attribute that a change is in; ``#``: a comment."""
    line, column, what = re.match(r"(\d+):(\d+) (\S+)", change).groups()
    row, at = text.splitlines()[int(line) - 1], int(column) - 1
    if what == "attribute":
        return re.match(r"\s*([\w:]+)", row[at:])[1]
    upto = row[: at + 1] if what in ("gone", "twice") else row[: at + len(what) + 1]
    if "<" in row:
        opened = re.match(r"<(\w+)", row[at:])
        found = [a or b for a, b in re.findall(r"<\??(\w+)|\s(\w+)=", upto)]
        return opened[1] if opened else found[-1]
    upto = row if what in ("gone", "twice") else upto
    return "#" if upto.lstrip().startswith("#") else re.findall(r"(\w+):", upto)[0 - (upto != row)]


@pytest.mark.weekly
@pytest.mark.shows("R5")
@pytest.mark.parametrize(("name", "way"), CASES)
def test_each_change_of_a_file(name, way, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    shutil.copytree(BASE, tmp_path / "case")
    monkeypatch.chdir(tmp_path / "case")
    Path("devices/rich.yaml").write_text(RICH, "utf-8")
    text = Path("network.yaml").read_text("utf-8")
    at = text.index("nets:")
    added = "  - {name: drive, position: 3, config: devices/rich.yaml}\n"
    Path("rich.yaml").write_text(text[:at] + added + text[at:], "utf-8")
    Path("bits.yaml").write_text(BITS, "utf-8")
    file, fingerprint = FILES[name]
    whole = Path(file).read_text("utf-8")
    before = fingerprint()
    assert before is not None
    same = []
    for change, changed_text in changed.WAYS[way](whole):
        Path(file).write_text(changed_text, "utf-8")
        if fingerprint() == before and _key(whole, change) not in SAME[name]:
            same.append(change)
    assert same == []


CRC = range(16, 20)


def _field_at(raw: bytes, at: int) -> tuple[str, str]:
    """Return the record and the field that a byte of a plan belongs to."""
    for record in RECORDS:
        first, count = struct.unpack_from("<II", raw, 32 + 16 * (record.number - 1) + 4)
        inside = at - first
        if 0 <= inside < record.layout.size * count:
            inside %= record.layout.size
            for field in record.fields:
                inside -= field.size
                if inside < 0:
                    return record.name, field.name
    return "", ""


@pytest.mark.weekly
@pytest.mark.shows("R5")
@pytest.mark.parametrize("name", ["estop", "el6910"])
def test_each_change_of_a_byte_of_a_plan(name: str) -> None:
    """Each is refused as it is; where its CRC is made to fit, the fingerprint is another one."""
    plan = compile_plan(example(name))
    raw, before = plan.to_bytes(), fingerprint_of(plan)
    same = set()
    for at in (n for n in range(len(raw)) if n not in CRC):
        other = raw[:at] + bytes([raw[at] ^ 1 << at % 8]) + raw[at + 1 :]
        with pytest.raises(PlanFormatError):
            load(other)
        try:
            found = load(fix_crc(other)).fingerprint()
        except PlanFormatError:
            continue
        if found == before:
            same.add((at, _field_at(raw, at)))
    assert same == set()
