"""ENI into descriptions: layout rules that hold on real files, copies, and what is not an ENI."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest
from data_files import need
from described import bus, copy

from fsoe_net.formats.eni.read import load_eni, load_eni_images
from fsoe_net.formats.eni.write import write_eni
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.bus import Direction
from fsoe_net.model.description import DescribedSubDevice


def read(text: str | bytes, *, expect: tuple[str, ...] = ()):
    out = Collector()
    data = text.encode() if isinstance(text, str) else text
    found = load_eni(data, out, name="bus.xml")
    assert tuple(d.code for d in out.diagnostics) == expect, out.diagnostics
    for d in out.diagnostics:
        assert d.hint
        assert d.span.file == "bus.xml"
        assert d.span.line > 0
    return found, out.diagnostics


def with_copies(text: str, rows: list[tuple[int, int, int]], name: str = "DstBitOffs") -> str:
    infos = "".join(
        f"<CopyInfo><SrcBitOffs>{s}</SrcBitOffs><{name}>{d}</{name}><BitSize>{n}</BitSize></CopyInfo>"
        for s, d, n in rows
    )
    text = re.sub(r"<CopyInfos>.*?</CopyInfos>\n", "", text, flags=re.DOTALL)
    return text.replace("</OutputOffs>", f"</OutputOffs><CopyInfos>{infos}</CopyInfos>", 1)


def rows_of(text: str) -> list[tuple[int, int, int]]:
    """The copies of a written ENI, as numbers."""
    out = Collector()
    images = load_eni_images(text.encode(), out)
    assert images is not None
    return [bits for c in images.description.copies if (bits := images.bits_of(c)) is not None]


@pytest.mark.parametrize("header", [0, 10])
def test_both_header_conventions_give_the_same_description(header: int):
    given = bus(2)
    found, _ = read(write_eni(given, header_bytes=header))
    assert found is not None
    assert found.cycle_us == 2000
    assert [s.name for s in found.subdevices] == [s.name for s in given.subdevices]
    assert [s.position for s in found.subdevices] == [0, 1, 2]
    assert set(found.copies) == set(given.copies)
    assert found.subdevices[0].device.sdos == given.subdevices[0].device.sdos
    blocks = found.subdevices[0].device.layout.managers[0].blocks
    assert [b.byte_offset for b in blocks] == [0, 6]


def test_mixed_headers_are_refused():
    text = write_eni(bus(2), header_bytes=10)
    start = re.findall(r"<Recv><BitStart>(\d+)", text)[1]
    found, _ = read(
        text.replace(f"<BitStart>{start}<", f"<BitStart>{int(start) - 80}<"), expect=("FSN142",)
    )
    assert found is None


def test_copies_without_cyclic_addresses_are_refused():
    text = re.sub(r"<Data>[0-9a-f]{32}</Data>", "<Data></Data>", write_eni(bus(1)))
    found, _ = read(text, expect=("FSN142",))
    assert found is not None
    assert found.copies == ()


def test_window_that_the_pdos_do_not_fill_is_named():
    text = write_eni(bus(1))
    found, _ = read(
        text.replace("<BitLength>64</BitLength>", "<BitLength>72</BitLength>", 1),
        expect=("FSN143",),
    )
    assert found is not None
    assert [c.source.subdevice for c in found.copies] == [1]


def test_variable_at_another_bit_than_its_entry_is_named():
    text = write_eni(bus(1))
    moved = re.sub(
        r"(<Name>logic\.crc 0</Name><BitSize>16</BitSize><BitOffs>)(\d+)",
        lambda m: f"{m[1]}{int(m[2]) + 1}",
        text,
        count=1,
    )
    _, found = read(moved, expect=("FSN144",))
    assert "crc 0" in found[0].message


def test_variables_agree_on_a_real_file():
    out = Collector()
    found = load_eni(need("eni", "kpierczy_test_eni.xml"), out)
    assert found is not None
    assert out.diagnostics == []
    assert [s.name for s in found.subdevices][:2] == ["Imu", "WheelRearLeft"]
    assert [s.position for s in found.subdevices] == [0, 1, 2, 3, 4]
    drive = found.subdevices[1]
    assert drive.device.assign_activate == 0x300
    assert [m.size_bytes for m in drive.device.layout.managers] == [6, 14]
    assert any("assign PDOs" in note for note in drive.notes)
    assert found.subdevices[0].device.sync_managers[0].pdos == ()
    assert len(drive.available) > 0


def test_real_file_counts_from_the_datagram_header():
    out = Collector()
    images = load_eni_images(need("eni", "kpierczy_test_eni.xml"), out)
    assert images is not None
    assert images.header_bits == 80
    assert images.starts[(0, 3)] == 568


def test_inputs_and_outputs_of_a_real_file_are_two_memories():
    """The same numbers in both images: an LRW brings and takes at one place of the frame."""
    images = load_eni_images(need("eni", "kpierczy_test_eni.xml"), Collector())
    assert images is not None
    for drive in (1, 2, 3, 4):
        assert images.starts[(drive, 2)] == images.starts[(drive, 3)]
    bits = images.bits_of(copy((1, 3, 0), (1, 2, 0), 16))
    assert bits is not None
    assert bits[0] == bits[1]
    # slots are as wide as the wider direction: the output image has holes
    outputs = [images.starts[(drive, 2)] for drive in (1, 2, 3, 4)]
    assert {b - a for a, b in pairwise(outputs)} == {112}


@pytest.mark.parametrize("number", range(12))
def test_each_rule_of_a_real_file_is_looked_at(number: int):
    """Move one window, or one variable with a name, of the real file: it is named."""
    text = need("eni", "kpierczy_test_eni.xml").read_text("utf-8")
    if number < 6:
        places = [m.span(1) for m in re.finditer(r"<BitStart>(\d+)<", text)]
        wanted = {"FSN142"}
    else:
        places = [m.span(1) for m in re.finditer(r"<BitOffs>(\d+)<", text)]
        kept = [p for p in places if int(text[slice(*p)]) < 1000]
        places, wanted = kept[:: len(kept) // 6], {"FSN144"}
    start, end = places[number % 6]
    out = Collector()
    moved = f"{text[:start]}{int(text[start:end]) + 1}{text[end:]}"
    load_eni(moved.encode(), out)
    assert {d.code for d in out.diagnostics} == wanted


# -- copies ---------------------------------------------------------------------------------------


def test_pieces_of_one_copy_are_joined_and_the_other_spelling_is_read():
    text = write_eni(bus(1))
    (a, b) = sorted(rows_of(text))
    cut = [(a[0] + 16, a[1] + 16, 32), (a[0], a[1], 16), b]
    for name in ("DstBitOffs", "DestBitOffs"):
        found, _ = read(with_copies(text, cut, name))
        assert found is not None
        assert set(found.copies) == set(bus(1).copies)


def test_run_over_two_frames_is_cut_between_them():
    given = bus(2)
    text = write_eni(given)
    images = load_eni_images(text.encode(), Collector())
    assert images is not None
    # both frames of the logic to itself: no sensible network, but one run over two frames
    row = (images.starts[(0, 3)], images.starts[(0, 2)], 96)
    found, _ = read(with_copies(text, [row]))
    assert found is not None
    assert found.copies == (copy((0, 3, 0), (0, 2, 0), 48), copy((0, 3, 48), (0, 2, 48), 48))


def test_part_of_a_frame_is_named():
    text = write_eni(bus(1))
    (a, b) = sorted(rows_of(text))
    found, named = read(with_copies(text, [(a[0], a[1], 40), b]), expect=("FSN149",))
    assert found is not None
    assert "a part of the FSoE frame at bits 0 to 47" in named[0].message


def test_frame_to_another_place_than_a_frame_is_named():
    text = write_eni(bus(1))
    (a, _) = sorted(rows_of(text))
    read(with_copies(text, [(a[0], a[1] + 8, 40)]), expect=("FSN149",))


def test_copy_out_of_the_image_is_named():
    text = write_eni(bus(1))
    _, named = read(with_copies(text, [(100_000, 0, 48)]), expect=("FSN145",))
    assert "image has" in named[0].message


def test_copy_from_no_process_data_is_named():
    text = write_eni(bus(1), header_bytes=10)
    _, named = read(with_copies(text, [(0, 208, 48)]), expect=("FSN145",))
    assert "no SubDevice's process data" in named[0].message


def test_images_of_what_is_not_a_bus_are_none():
    out = Collector()
    assert load_eni_images(b"<EtherCATConfig/>", out) is None
    assert [d.code for d in out.diagnostics] == ["FSN141"]


@pytest.mark.uncounted
def test_wrapped_counter_is_guessed_at():
    text = write_eni(bus(350))
    images = load_eni_images(text.encode(), Collector())
    assert images is not None
    used = {
        bit
        for (number, sm), first in images.starts.items()
        if sm == 3
        for bit in range(first, first + layout_bits(images.description.subdevices[number]))
    }
    rows = [r for r in rows_of(text) if r[0] >= 65_536 and r[0] - 65_536 not in used]
    row = rows[0]
    text = with_copies(text, [(row[0] - 65_536, row[1], 48)])
    _, named = read(text, expect=("FSN145",))
    assert named[0].hint == f"a 16-bit counter may have wrapped: is {row[0]} meant?"


def layout_bits(sub: DescribedSubDevice) -> int:
    return sub.device.layout.managers[1].bits


def test_copies_at_a_writing_command_are_named():
    text = write_eni(bus(1)).replace("<Cmd>12</Cmd>", "<Cmd>11</Cmd>")
    out = Collector()
    load_eni(text.encode(), out, name="bus.xml")
    assert "FSN145" in {d.code for d in out.diagnostics}


# -- what real files look like --------------------------------------------------------------------


def test_one_line_latin_1_and_cdata():
    text = write_eni(bus(1)).replace("\n", "").replace('encoding="UTF-8"', 'encoding="ISO-8859-1"')
    text = text.replace("<Name>logic</Name>", "<Name><![CDATA[L\u00f6gic & <co>]]></Name>")
    found, _ = read(text.encode("latin-1"))
    assert found is not None
    assert found.subdevices[0].name == "L\u00f6gic & <co>"


@pytest.mark.parametrize("spelling", ["#x1600", "#X1600", "0x1600", "5632", "005632"])
def test_number_is_read_in_each_spelling(spelling: str):
    text = write_eni(bus(1)).replace("<Pdo>5632</Pdo>", f"<Pdo>{spelling}</Pdo>")
    found, _ = read(text)
    assert found is not None
    assert found.subdevices[0].device.sync_managers[0].pdos[0].index == 0x1600


@pytest.mark.parametrize("spelling", ["1600h", "", "-1", "1e3", "#x", "9" * 30, "70000"])
def test_other_number_forms_are_named(spelling: str):
    text = write_eni(bus(1)).replace("<PhysAddr>", "<RevisionNo>zzz</RevisionNo><PhysAddr>")
    out = Collector()
    load_eni(text.replace("<Ado>16</Ado>", f"<Ado>{spelling}</Ado>").encode(), out)
    assert {d.code for d in out.diagnostics} == {"FSN141"}


def test_pdo_that_is_not_there_is_named():
    text = write_eni(bus(1)).replace("<Pdo>5632</Pdo>", "<Pdo>5700</Pdo>", 1)
    out = Collector()
    load_eni(text.encode(), out)
    assert out.diagnostics[0].code == "FSN143"
    assert "0x1644" in out.diagnostics[0].message


def test_two_subdevices_at_one_place_are_named():
    text = write_eni(bus(1)).replace("<AutoIncAddr>65535<", "<AutoIncAddr>0<")
    read(text, expect=("FSN141",))


def test_groups_that_come_and_go_have_no_place_of_their_own():
    text = write_eni(bus(1)).replace("<AutoIncAddr>65535<", "<AutoIncAddr>0<")
    hot = "<HotConnect><GroupMemberCnt>1</GroupMemberCnt></HotConnect><Mailbox>"
    found, _ = read(text.replace("<Mailbox>", hot))
    assert found is not None
    assert [s.position for s in found.subdevices] == [None, 0]


def test_pdo_that_is_listed_twice_is_named():
    text = write_eni(bus(1)).replace("<Pdo>5632</Pdo>", "<Pdo>5632</Pdo>" * 1000, 1)
    found, named = read(text, expect=("FSN143",))
    assert found is not None
    assert "a second time" in named[0].message
    assert found.subdevices[0].device.sync_managers[0].pdos is not None
    assert len(found.subdevices[0].device.sync_managers[0].pdos) == 2


def test_empty_window_is_none():
    text = write_eni(bus(1), header_bytes=10)
    empty = "<Send><BitStart>0</BitStart><BitLength>0</BitLength></Send><Send>"
    found, _ = read(text.replace("<Send>", empty))
    assert found is not None
    assert len(found.copies) == 2


def test_sample_without_process_data_is_read():
    found, _ = read(
        "<EtherCATConfig><Config><Slave><Info><Name>a</Name><VendorId>2</VendorId>"
        "<ProductCode>#x10</ProductCode></Info><Mailbox><CoE><InitCmds>"
        "<InitCmd><Ccs>2</Ccs><Index>0x8010</Index><SubIndex>3</SubIndex><Data>0100</Data></InitCmd>"
        "<InitCmd CompleteAccess='1'><Ccs>1</Ccs><Index>1</Index><Data>0100</Data></InitCmd>"
        "</InitCmds></CoE></Mailbox></Slave></Config></EtherCATConfig>"
    )
    assert found is not None
    sub = found.subdevices[0]
    assert [(s.index, s.subindex, s.size_bytes, s.value) for s in sub.device.sdos] == [
        (0x8010, 3, 2, 1)
    ]
    assert len(sub.notes) == 1


FOREIGN = {
    "<Network><Slaves/></Network>": "openethercat",
    "<a><Slave Name='x' PhysAddr='1001'><Pdo><Edit/></Pdo></Slave></a>": "ENI builder",
    "<EtherCATMailbox><CoE><InitCmds/></CoE></EtherCATMailbox>": "start-up commands from TwinCAT",
    "<EtherCATInfo/>": "an ESI",
    "<EtherCATInfoList/>": "ethercat xml",
    "<masters/>": "linuxcnc-ethercat",
    "<other/>": "<other>",
    "SM2: PhysAddr 0x1200, DefaultSize    8": "ethercat pdos",
    "nets: []": "YAML",
}


@pytest.mark.parametrize("text", FOREIGN)
def test_files_that_are_not_eni_are_called_what_they_are(text: str):
    found, named = read(text, expect=("FSN140",))
    assert found is None
    assert FOREIGN[text] in named[0].message


@pytest.mark.parametrize(
    "text",
    [
        "<EtherCATConfig><Config>",
        "<!DOCTYPE a [<!ENTITY b 'c'>]><EtherCATConfig>&b;</EtherCATConfig>",
        "<EtherCATConfig>" + "<a>" * 300,
        "no XML at all",
    ],
)
def test_damaged_files_are_refused(text: str):
    found, _ = read(text, expect=("FSN118",))
    assert found is None


def test_nothing_and_no_subdevices():
    out = Collector()
    assert load_eni(b"  \n", out) is None
    assert load_eni(b"<EtherCATConfig/>", out) is None
    assert [d.code for d in out.diagnostics] == ["FSN140", "FSN141"]


def test_directions_are_named_from_the_main_device():
    found, _ = read(write_eni(bus(1)))
    assert found is not None
    directions = [sm.direction for sm in found.subdevices[0].device.sync_managers]
    assert directions == [Direction.OUTPUT, Direction.INPUT]
