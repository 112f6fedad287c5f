"""What readers keep, refuse and say, and what writers write, at the edges of what they take."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from described import bus, entry
from formats import twincat_text as tc
from formats.esi_text import esi_text
from formats.test_eni_start import with_esi

from fsoe_net.diag.diagnostic import Edit, Span
from fsoe_net.errors import InputError
from fsoe_net.formats.capture.datagrams import datagrams
from fsoe_net.formats.eni.read import load_eni
from fsoe_net.formats.eni.write import write_eni
from fsoe_net.formats.esi.read import load_esi
from fsoe_net.formats.igh.write import write_c_header
from fsoe_net.formats.own.patch import patch_yaml
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.xml_text import plain_xml
from fsoe_net.formats.twincat.box import _frame
from fsoe_net.formats.twincat.read import load_twincat
from fsoe_net.model.bus import Direction, Pdo
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
    found = load_eni(new.encode(), Collector())
    assert found is not None
    facts = next(s.start for s in found.subdevices if s.start and 2 in s.start.starts)
    assert facts.controls.get(2) == kept


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


# -- texts ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["utf-8", "us-ascii", "iso-8859-1"])
def test_what_expat_reads_is_left_as_it_is(name: str):
    data = f'<?xml version="1.0" encoding="{name}"?><a/>'.encode()
    assert plain_xml(data) is data


@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("before", ["", "a: 1\n"])
def test_an_edit_is_at_its_place_behind_a_byte_order_mark(mark: str, before: str):
    text = f"{mark}{before}b: {{size: 6}}\n"
    line = 2 if before else 1
    wanted = Edit(span=Span("n.yaml", line, 11), key="size", text="31")
    after, made = patch_yaml(text.encode(), "n.yaml", [wanted])
    assert after.decode() == text.replace("6", "31")
    assert made == {wanted}


def test_an_entry_that_no_table_holds_is_named():
    made = bus(1)
    logic = made.subdevices[0]
    outputs, *rest = logic.device.sync_managers
    pdo = Pdo(index=0x1600, entries=(entry(0x7000, 1, 256),))
    changed = replace(logic.device, sync_managers=(replace(outputs, pdos=(pdo,)), *rest))
    made = replace(made, subdevices=(replace(logic, device=changed),), copies=(), connections=())
    with pytest.raises(InputError, match=r"^logic: 0x7000:01 has 256 bits; tables hold 255$"):
        write_c_header(made)
