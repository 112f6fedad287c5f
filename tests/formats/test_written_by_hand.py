"""What people and tools other than the usual ones write: tables by hand, odd numbers."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsoe_net.compare.diff import compare
from fsoe_net.compare.sides import side_of_description
from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.errors import InputError
from fsoe_net.formats.eni.write import write_eni
from fsoe_net.formats.esi.read import load_esi
from fsoe_net.formats.igh.read import load_igh_text
from fsoe_net.formats.recognise import find_format
from fsoe_net.formats.registry import read_foreign
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.bus import Device
from fsoe_net.model.description import DescribedSubDevice, Description

BY_HAND = b"""\
// terminals of the test rig
static ec_pdo_entry_info_t logic_entries[] = {
    {0x7000, 1,  8}, // command
    {0x7001, 1,  8}, /* data */
    // {0x7001, 2,  8}, not used
    {0x7000, 3, 16},
    {0x7000, 2, 16}, // connection
    {0x6000, 1, 8}, {0x6001, 1, 8},
};

static ec_pdo_info_t logic_pdos[] = {
    {0x1600, 4, logic_entries},
    {0x1a00, 2, &logic_entries[4]}
};

static ec_sync_info_t logic_syncs[] = {
    {1, EC_DIR_INPUT},
    {2, EC_DIR_OUTPUT, 1, logic_pdos},
    {3, EC_DIR_INPUT, 1, logic_pdos + 1, EC_WD_DISABLE},
    {0xff}
};
"""
GOOD = BY_HAND.replace(b"{0x6000, 1, 8}, {", b"{0x6000, 1, 8},\n    {")


def test_tables_written_by_hand_are_read():
    out = Collector()
    found = load_igh_text(GOOD, out)
    assert out.diagnostics == []
    assert found is not None
    (sub,) = found.subdevices
    sizes = {
        s.index: [[e.bits for e in p.entries] for p in s.pdos] for s in sub.device.sync_managers
    }
    assert sizes == {1: [], 2: [[8, 8, 16, 16]], 3: [[8, 8]]}
    names = [e.name for e in sub.device.sync_managers[1].pdos[0].entries]
    assert names == ["command", "data", "", "connection"]
    assert [e.subindex for e in sub.device.sync_managers[1].pdos[0].entries] == [1, 1, 3, 2]


@pytest.mark.parametrize("row", [b"{0x7000, 3, SIXTEEN},", b"{0x7000 3, 16},", b"{0x7000, 3, 16"])
def test_a_row_that_is_not_understood_is_never_left_out(row):
    out = Collector()
    load_igh_text(GOOD.replace(b"{0x7000, 3, 16},", row), out)
    assert "FSN146" in {d.code for d in out.diagnostics if d.level is Severity.ERROR}
    out = Collector()
    load_igh_text(BY_HAND, out)  # two entries in a line
    assert [d.code for d in out.diagnostics if d.level is Severity.ERROR] == ["FSN146"]


def test_numbers_of_lcec_may_have_leading_zeros():
    text = b"""<masters><master idx="00" appTimePeriod="0001000000">
    <slave idx="001" type="generic" vid="000000000aaa" pid="000bbbccc" name="a"/>
    </master></masters>"""
    out = Collector()
    kind = find_format(text, out, name="conf.xml")
    assert kind.kind == "lcec"
    found = read_foreign(text, kind, out, name="conf.xml")
    assert out.diagnostics == []
    assert found is not None
    device = found.subdevices[0].device
    assert (device.vendor_id, device.product_code) == (0xAAA, 0xBBBCCC)
    bad = read_foreign(text.replace(b"000bbbccc", b"1000bbbcc"), kind, out, name="conf.xml")
    assert bad is None or [d.code for d in out.diagnostics] == ["FSN141"]


def test_a_start_address_beyond_16_bits_is_left_out_and_reported():
    text = b"""<EtherCATInfo><Vendor><Id>2</Id></Vendor><Descriptions><Devices><Device>
    <Type ProductCode="#x1" RevisionNo="#x1">A</Type>
    <Sm StartAddress="#x110044444444" ControlByte="#x64">Outputs</Sm>
    <RxPdo Sm="0"><Index>#x1600</Index><Entry><Index>#x7000</Index><SubIndex>1</SubIndex>
    <BitLen>8</BitLen></Entry></RxPdo></Device></Devices></Descriptions></EtherCATInfo>"""
    out = Collector()
    found = load_esi(text, out, cache=False)
    assert [(d.code, d.level) for d in out.diagnostics] == [("FSN111", Severity.WARNING)]
    assert found is not None
    assert found.subdevices[0].device.sync_managers[0].start_byte is None
    placed = replace(found.subdevices[0], position=0)
    assert "EtherCATConfig" in write_eni(replace(found, subdevices=(placed,)))


def test_an_activation_word_beyond_16_bits_is_refused_by_the_eni_writer():
    sub = described(0x10300)
    with pytest.raises(InputError, match="assign_activate 0x10300"):
        write_eni(bus(replace(sub, position=0)))


def test_subdevices_of_which_nothing_is_known_are_paired_in_order():
    same = side_of_description(bus(described(1), described(2)))
    assert compare(same, same).same
    one = side_of_description(bus(described(1)))
    assert [c.kind for c in compare(same, one).changes] == ["removed"]


def described(activate: int) -> DescribedSubDevice:
    device = Device(path="x", vendor_id=0, product_code=0, assign_activate=activate)
    return DescribedSubDevice(span=Span("x", 1, 1), device=device)


def bus(*subs: DescribedSubDevice) -> Description:
    return Description(span=Span("x", 1, 1), format="ethercat-cstruct", path="x", subdevices=subs)
