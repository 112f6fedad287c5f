"""What readers keep, refuse and say, and what writers write, at the edges of what they take."""

from __future__ import annotations

import io
import struct
from dataclasses import replace
from pathlib import Path

import pytest
from described import bus, entry
from formats import twincat_text as tc
from formats.eni_with_esi import with_esi
from formats.esi_text import esi_text

from fsoe_net.diag.diagnostic import Edit, Span
from fsoe_net.errors import InputError
from fsoe_net.formats.capture.datagrams import datagrams
from fsoe_net.formats.capture.packets import CaptureReader
from fsoe_net.formats.capture.sdo import _segment
from fsoe_net.formats.eni.read import load_eni
from fsoe_net.formats.eni.write import write_eni
from fsoe_net.formats.esi.read import list_esi, load_esi
from fsoe_net.formats.esi.wanted import load_devices
from fsoe_net.formats.igh.write import write_c_header
from fsoe_net.formats.lcec.write import write_lcec
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.patch import patch_yaml
from fsoe_net.formats.own.schema import check_structure, nearest_keys
from fsoe_net.formats.own.slave_yaml import device_from_yaml
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.writers import plain_text
from fsoe_net.formats.shared.xml_text import plain_xml
from fsoe_net.formats.shared.yaml_tree import parse_yaml
from fsoe_net.formats.sii.hex_text import binary_of
from fsoe_net.formats.sii.parts import _TYPES
from fsoe_net.formats.sii.read import SiiManager
from fsoe_net.formats.twincat.box import _frame
from fsoe_net.formats.twincat.read import load_twincat
from fsoe_net.model.bus import Direction, Pdo, Sdo
from fsoe_net.model.description import StartFacts

# -- sync managers --------------------------------------------------------------------------------


def esi_starts(count: int, start: str, control: str) -> StartFacts:
    managers = f'<Sm StartAddress="{start}" ControlByte="{control}">Inputs</Sm>' * count
    text = f'<Device><Type ProductCode="#x10" RevisionNo="#x1">D</Type>{managers}</Device>'
    found = load_esi(esi_text(text).encode(), Collector())
    assert found is not None
    (subdevice,) = found.subdevices
    assert subdevice.start is not None
    return subdevice.start


def test_the_first_16_sync_managers_of_an_esi_count():
    assert list(esi_starts(15, "#x1000", "#x20").starts) == list(range(15))
    assert list(esi_starts(17, "#x1000", "#x20").starts) == list(range(16))


def test_numbers_of_sync_managers_are_kept_up_to_what_a_register_holds():
    esi = esi_starts(1, "#xffff", "#xff")
    assert (esi.starts, esi.controls) == ({0: 0xFFFF}, {0: 0xFF})
    esi = esi_starts(1, "#x10000", "#x100")
    assert (esi.starts, esi.controls) == ({}, {})


@pytest.mark.parametrize(("number", "kept"), [(255, 255), (256, None)])
def test_control_bytes_of_an_eni(number: int, kept: int | None):
    text = write_eni(with_esi())
    old = "<ControlByte>100</ControlByte>"
    assert text.count(old) == 1
    new = text.replace(old, f"<ControlByte>{number}</ControlByte>")
    out = Collector()
    found = load_eni(new.encode(), out)
    said = [d.message for d in out.diagnostics]
    assert said == ([] if kept else ["<ControlByte> '256' is outside 0 ... 255"])
    assert found is not None
    facts = next(s.start for s in found.subdevices if s.start and 2 in s.start.starts)
    assert facts.controls.get(2) == kept


@pytest.mark.parametrize("size", [1, 2, 4, 8])
@pytest.mark.parametrize("value", ["lowest", "highest"])
def test_start_up_sdos_keep_size_and_value(size: int, value: str):
    sdo = Sdo(
        index=0x8000,
        subindex=1,
        size_bytes=size,
        value=0 if value == "lowest" else 2 ** (8 * size) - 1,
    )
    made = bus(1)
    logic, *rest = made.subdevices
    logic = replace(logic, device=replace(logic.device, sdos=(sdo,)))
    out = Collector()
    found = load_eni(write_eni(replace(made, subdevices=(logic, *rest))).encode(), out)
    assert found is not None
    assert found.subdevices[0].device.sdos == (sdo,)
    assert out.diagnostics == []


@pytest.mark.parametrize(
    ("value", "data"), [(-2, "FE FF"), (-32768, "00 80"), (65535, "FF FF"), (258, "02 01")]
)
def test_an_sdo_of_linuxcnc_is_low_byte_first(value: int, data: str):
    made = bus(1)
    logic, *rest = made.subdevices
    sdo = Sdo(index=0x8000, subindex=0x0A, size_bytes=2, value=value)
    logic = replace(logic, device=replace(logic.device, sdos=(sdo,)))
    text = write_lcec(replace(made, subdevices=(logic, *rest), connections=())).files
    (whole,) = text.values()
    assert (
        '      <sdoConfig idx="8000" subIdx="0A">\n'
        f'        <sdoDataRaw data="{data}"/>\n'
        "      </sdoConfig>\n"
    ) in whole


def test_a_device_that_no_datagram_holds_is_named():
    made = bus(1)
    logic, *rest = made.subdevices
    outputs, inputs = logic.device.sync_managers
    pdo = Pdo(index=0x1600, entries=tuple(entry(0x7000, n, 248) for n in range(1, 49)))
    device = replace(logic.device, sync_managers=(replace(outputs, pdos=(pdo,)), inputs))
    made = replace(made, subdevices=(replace(logic, device=device), *rest), copies=())
    with pytest.raises(InputError, match=r"^logic: 1496 bytes do not fit into one datagram$"):
        write_eni(made)


def test_pdos_of_an_eni_that_no_sync_manager_has_are_available():
    text = write_eni(bus(1)).replace(
        "</ProcessData>",
        "<TxPdo><Index>#x1a40</Index><Entry><Index>#x6400</Index><SubIndex>1</SubIndex>"
        "<BitLen>16</BitLen></Entry></TxPdo></ProcessData>",
        1,
    )
    found = load_eni(text.encode(), Collector())
    assert found is not None
    assert [p.index for p in found.subdevices[0].available] == [0x1A40]
    assert {s.available for s in found.subdevices[1:]} == {()}


@pytest.mark.parametrize(
    ("shift", "kept"), [(-0x80000000, -0x80000000), (-0x80000001, 0), (500, 500)]
)
def test_a_shift_of_the_clock_of_an_eni_has_32_bits(shift: int, kept: int):
    clock = f"<DC><CycleTime0>1000000</CycleTime0><ShiftTime>{shift}</ShiftTime></DC>"
    text = write_eni(bus(1)).replace("</Slave>", f"{clock}</Slave>", 1)
    found = load_eni(text.encode(), Collector())
    assert found is not None
    assert next(s.start.clock.shift_ns for s in found.subdevices if s.start and s.start.clock) == (
        kept
    )


def test_devices_of_an_esi_have_the_place_of_the_file(tmp_path: Path):
    path = tmp_path / "a.xml"
    path.write_text(
        esi_text('<Device><Type ProductCode="#x10" RevisionNo="#x1">D</Type></Device>'), "utf-8"
    )
    listed = list_esi(str(path), Collector())
    assert listed is not None
    vendor = listed.devices[0].vendor
    logic = bus(1).subdevices[0]
    wanted = replace(logic, device=replace(logic.device, vendor_id=vendor, product_code=0x10))
    found = load_devices(str(path), [wanted], Collector())
    assert found is not None
    assert (str(found.span), found.path) == (f"{path}:1:1", str(path))
    assert load_devices(str(path), [logic], Collector()) is None


# -- images of an EEPROM --------------------------------------------------------------------------


def record(address: int, kind: int, body: bytes) -> str:
    row = bytes((len(body), address >> 8, address & 0xFF, kind)) + body
    return ":" + (row + bytes((-sum(row) & 0xFF,))).hex().upper() + "\n"


@pytest.mark.parametrize(("kind", "base"), [(2, 16), (4, 0x10000)])
def test_records_of_intel_hex_lie_after_their_base(kind: int, base: int):
    text = "".join(record(at, 0, bytes(16)) for at in range(0, base, 16))
    text += record(0, kind, b"\0\1") + record(0, 0, b"\3\4") + ":00000001FF\n"
    assert binary_of(text.encode()) == bytes(base) + b"\3\4"


@pytest.mark.parametrize(
    ("use", "control", "direction"),
    [
        (0, 0x64, Direction.OUTPUT),
        (0, 0x20, Direction.INPUT),
        (0, 0x08, Direction.INPUT),
        (1, 0x20, Direction.OUTPUT),
        (2, 0x24, Direction.INPUT),
        (3, 0x20, Direction.OUTPUT),
        (4, 0x24, Direction.INPUT),
    ],
)
def test_directions_of_sync_managers_of_an_sii(use: int, control: int, direction: Direction):
    manager = SiiManager(start=0x1000, length=8, control=control, enable=1, use=use)
    assert manager.direction is direction


@pytest.mark.parametrize(
    ("number", "name"),
    [
        *enumerate(("BOOL", "SINT", "INT", "DINT", "USINT", "UINT", "UDINT", "REAL"), 1),
        (0x11, "LREAL"),
        (0x15, "LINT"),
        (0x1B, "ULINT"),
        *((0x30 + n, f"BIT{n + 1}") for n in range(8)),
    ],
)
def test_types_of_an_sii_are_those_of_the_base_data_types(number: int, name: str):
    assert _TYPES[number] == name


# -- TwinCAT --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("size", "slot", "bits"),
    [
        (6, 0, [8, 8, 16, 16]),
        (7, 0, [8, 16, 16, 16]),
        (8, 0, [64]),
        (10, 0, [80]),
        (11, 0, [8, 16, 16, 16, 16, 16]),
        (3, 0, [24]),
        (6, 255, [8, 8, 16, 16]),
        (6, 256, [48]),
    ],
)
def test_a_message_is_a_frame_where_its_size_and_place_can_be_one(
    size: int, slot: int, bits: list[int]
):
    rows = _frame(slot, size, Direction.OUTPUT, Span("x", 1, 1), "m")
    assert [row.bits for row in rows] == bits


def test_of_two_masters_the_one_with_a_safety_logic_is_read():
    plain = tc.box(1, "Term 90 (EK1100)", "EK1100", 0x044C2C52)
    whole = tc.machine(safety="")
    begin = whole.index('<Device Id="1"')
    first = f'<Device Id="7" DevType="111"><Name>Plain</Name>\n{plain}<EtherCAT/></Device>\n'
    out = Collector()
    found = load_twincat((whole[:begin] + first + whole[begin:]).encode(), out)
    assert found is not None
    assert [s.order for s in found.subdevices] == ["EK1100", "EL6910", "EL1904", "EL2904"]
    (said,) = [d for d in out.diagnostics if d.code == "FSN147" and "masters" in d.message]
    assert said.message == (f"this project has 2 EtherCAT masters; {tc.MASTER} is read, Plain not")


@pytest.mark.parametrize("index", ["#x10000", "-1", "x"])
def test_a_pdo_of_twincat_without_a_number_is_named(index: str):
    text = tc.machine(safety="").replace('Index="#x1a00"', f'Index="{index}"', 1)
    out = Collector()
    load_twincat(text.encode(), out)
    said = [d.message for d in out.diagnostics if d.code == "FSN141"]
    assert said == ["a PDO of EL6910 has no number"]


def test_a_part_of_a_project_that_is_not_there_is_named(tmp_path: Path):
    path = tmp_path / "machine.tsproj"
    whole = tc.machine(safety="")
    path.write_text(whole.replace("<Io>\n", '<Io>\n<Device File="gone.xti"/>\n', 1), "utf-8")
    out = Collector()
    load_twincat(path, out)
    (said,) = [d for d in out.diagnostics if "gone" in d.message]
    assert (said.code, said.message, said.hint) == (
        "FSN147",
        "a part of this project is in the file 'gone.xti', which is not read",
        "give the folder of the project whole, with its _Config/IO",
    )


# -- captures -------------------------------------------------------------------------------------


def udp(*, offset: int = 0, protocol: int = 17, port: int = 0x88A4, flags: int = 0) -> bytes:
    """Return an EtherCAT frame in UDP with one datagram: BRD of one byte."""
    begin = bytes(12) + bytes.fromhex("0800")
    fragment = (flags << 13 | offset).to_bytes(2, "big")
    ip = bytes.fromhex("4500003000000000")[:6] + fragment + bytes((64, protocol)) + bytes(10)
    head = bytes.fromhex("88a4") + port.to_bytes(2, "big") + bytes(4)
    datagram = bytes.fromhex("07 01 0000 0000 0100 0000 ab 0300")
    return begin + ip + head + (len(datagram) | 0x1000).to_bytes(2, "little") + datagram


@pytest.mark.parametrize(
    ("packet", "taken"),
    [
        (udp(), True),
        (udp(flags=2), True),
        (udp(offset=1), False),
        (udp(offset=0x100), False),
        (udp(offset=0x1000), False),
        (udp(protocol=6), False),
        (udp(port=0x88A5), False),
    ],
)
def test_frames_in_udp_are_taken_where_they_are_whole(packet: bytes, taken: bool):
    found = datagrams(packet)
    assert (found is not None) is taken
    if found is not None:
        (row,), cut = found
        assert (row.data, row.counter, cut) == (b"\xab", 3, False)


@pytest.mark.parametrize("unused", range(8))
def test_a_short_segment_states_how_many_bytes_count(unused: int):
    assert _segment(bytes((unused << 1 | 1,)) + b"ABCDEFG") == b"ABCDEFG"[: 7 - unused]
    assert _segment(bytes((unused << 1 | 1,)) + b"ABCDEFGH") == b"ABCDEFGH"


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_pcapng_of_either_byte_order(order: str):
    def block(kind: int, body: bytes) -> bytes:
        size = struct.pack(order + "I", 12 + len(body))
        return struct.pack(order + "I", kind) + size + body + size

    section = block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1))
    interface = block(1, struct.pack(order + "HHI", 1, 0, 65535))
    packet = block(6, struct.pack(order + "IIIII", 0, 0, 250, 4, 4) + b"abcd")
    reader = CaptureReader("x.pcapng", io.BytesIO(section + interface + packet))
    assert list(reader) == [(250_000, 0, b"abcd")]


def test_packets_of_a_pcap_have_their_time_and_the_first_interface():
    head = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    packet = struct.pack("<IIII", 7, 250, 3, 3) + b"abc"
    reader = CaptureReader("x.pcap", io.BytesIO(head + packet))
    assert list(reader) == [(7_000_250_000, 0, b"abc")]


# -- texts ----------------------------------------------------------------------------------------


def test_a_file_that_is_too_large_states_how_large(tmp_path: Path):
    path = tmp_path / "x"
    path.write_bytes(bytes(11))
    out = Collector()
    assert read_bytes(path, out, most=10) is None
    (said,) = out.diagnostics
    assert said.message.rpartition(": ")[2] == "it has 11 bytes, more than the 10 allowed"
    assert said.hint == "is this really a configuration file?"
    assert read_bytes(path, Collector(), most=11) == bytes(11)


@pytest.mark.parametrize("name", ["utf-8", "us-ascii", "iso-8859-1"])
def test_text_that_expat_reads_is_unchanged(name: str):
    data = f'<?xml version="1.0" encoding="{name}"?><a/>'.encode()
    assert plain_xml(data) is data


def test_signs_that_no_file_holds_become_blanks():
    kept = "".join(map(chr, (*range(0x20, 0x7F), 0xA0, 0x2027, 0x202A, 0xE000, 0xFEFE)))
    assert plain_text(f"a{kept}b") == f"a{kept}b"
    for number in (0, 9, 0x1F, 0x7F, 0x9F, 0x2028, 0x2029, 0xD800, 0xDFFF, 0xFEFF, 0xFFFE, 0xFFFF):
        assert plain_text(f"a{chr(number)}b") == "a b"


@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("before", ["", "a: 1\n"])
def test_an_edit_is_at_its_place_after_a_byte_order_mark(mark: str, before: str):
    text = f"{mark}{before}b: {{size: 6}}\n"
    line = 2 if before else 1
    wanted = Edit(span=Span("n.yaml", line, 11), key="size", text="31")
    after, made = patch_yaml(text.encode(), "n.yaml", [wanted])
    assert after.decode() == text.replace("6", "31")
    assert made == {wanted}


CHANNELS = """\
vendor_id: 1
product_id: 2
tpdo:
  - index: 0x1a00
    channels:
      - {{index: 0x6064, sub_index: 0, type: int32, {rest}}}
"""


@pytest.mark.parametrize(
    ("rest", "message", "hint"),
    [
        (
            "factor: 1,5",
            "unknown key '5' in tpdo 1, channels 1",
            "the comma ends factor: write 1.5; a comma is not part of a number",
        ),
        (
            "factor: 1,500",
            "unknown key '500' in tpdo 1, channels 1",
            "the comma ends factor: write 1.500 or 1500; a comma is not part of a number",
        ),
        (
            "factor: 1,0e-8",
            "unknown key '0e-8' in tpdo 1, channels 1",
            "the comma ends factor: write 1.0e-8; a comma is not part of a number",
        ),
        (
            "-factor: 2",
            "unknown key '-factor' in tpdo 1, channels 1",
            "write 'factor'; where a list item begins, `- ` with a blank before it",
        ),
    ],
)
def test_a_slip_in_a_channel_is_an_error_with_its_cause(rest: str, message: str, hint: str):
    """Else `factor: 1,5` would be a factor of 1 and a remark."""
    out = Collector()
    root = parse_yaml(CHANNELS.format(rest=rest).encode(), "d.yaml", out)
    assert root is not None
    device_from_yaml(root, "d.yaml", out)
    rows = [(d.level.value, d.message, d.hint) for d in out.diagnostics]
    assert rows == [("error", message, hint)]


def test_a_comma_in_a_whole_number_is_not_read_as_a_point():
    out = Collector()
    text = "version: 1\nnets: [{name: a, transfers: [], connections: [{watchdog_ms: 100,5}]}]\n"
    root = parse_yaml(text.encode(), "n.yaml", out)
    assert root is not None
    check_structure(root, "network", out)
    hints = [d.hint for d in out.diagnostics if d.code == "FSN109"]
    assert hints == ["the comma ends watchdog_ms: write a whole number"]


@pytest.mark.parametrize("rest", ["5: ~", "factor: a, 5: ~", "7: 1"])
def test_a_number_as_a_key_is_a_remark_where_no_number_is_before_it(rest: str):
    out = Collector()
    root = parse_yaml(CHANNELS.format(rest=rest).encode(), "d.yaml", out)
    assert root is not None
    device_from_yaml(root, "d.yaml", out)
    assert [d.level.value for d in out.diagnostics if d.code == "FSN109"] == ["info"]


CONFUSED = (
    ("sub_index", "subindex"), ("subIndex", "subindex"), ("module", "ec_module"),
    ("rpdos", "rpdo"), ("product_code", "product_id"), ("sync_manager", "sm"),
    ("length", "size"), ("bytes", "size"), ("entries", "channels"), ("conn_id", "connection_id"),
    ("watchdog", "watchdog_ms"), ("slaves", "subdevices"), ("devices", "subdevices"),
    ("fsoe_address", "address"), ("SM", "sm"), ("vendorid", "vendor_id"),
)  # fmt: skip


@pytest.mark.parametrize(("key", "meant"), CONFUSED)
def test_a_key_by_another_name_is_known(key: str, meant: str):
    assert nearest_keys(key, ["name", "vendor", "data", meant]) == (meant,)
    assert nearest_keys(key, ["name"]) == ()


@pytest.mark.parametrize(
    ("key", "missing"),
    [
        ("safety_mods", []),
        ("transfer_module", []),
        ("subdevice", ["the document has no 'nets'", "the document has no 'version'"]),
        ("vendor_ids", ["the document has no 'product_id'"]),
    ],
)
def test_a_file_is_known_by_a_key_that_is_spelled_wrong(
    key: str, missing: list[str], tmp_path: Path
):
    path = tmp_path / "t.yaml"
    path.write_text(f"{key}: []\n", "utf-8")
    unknown = f"unknown key {key!r} at the top level"
    assert [d.message for d in load_network([path]).diagnostics] == [unknown, *missing]


def test_an_entry_that_no_table_holds_is_named():
    made = bus(1)
    logic = made.subdevices[0]
    outputs, *rest = logic.device.sync_managers
    pdo = Pdo(index=0x1600, entries=(entry(0x7000, 1, 256),))
    changed = replace(logic.device, sync_managers=(replace(outputs, pdos=(pdo,)), *rest))
    made = replace(made, subdevices=(replace(logic, device=changed),), copies=(), connections=())
    with pytest.raises(InputError, match=r"^logic: 0x7000:01 has 256 bits; tables hold 255$"):
        write_c_header(made)
