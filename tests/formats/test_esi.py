"""ESI files: choice of a device, sync managers and PDOs, modules, spelling of numbers."""

from __future__ import annotations

from dataclasses import replace

import pytest
from data_files import listed, need
from described import described_devices
from formats.esi_text import device_text, esi_text, module_text
from hypothesis import given, settings
from weekly import examples

from fsoe_net.formats.esi.read import EsiChoice, list_esi, load_esi
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.bus import Direction, Entry, Pdo

SMS = (
    '<Sm StartAddress="#x1000" ControlByte="#x26">MBoxOut</Sm>'
    '<Sm StartAddress="#x1080" ControlByte="#x22">MBoxIn</Sm>'
    '<Sm StartAddress="#x1100" ControlByte="#x24">Outputs</Sm>'
    '<Sm StartAddress="#x1180" ControlByte="#x20">Inputs</Sm>\n'
)
FRAME = (
    "<Entry><Index>#x{base}0</Index><SubIndex>1</SubIndex><BitLen>8</BitLen></Entry>"
    "<Entry><Index>#x{base}1</Index><SubIndex>1</SubIndex><BitLen>1</BitLen></Entry>"
    "<Entry><Index>0</Index><BitLen>7</BitLen></Entry>"
    "<Entry><Index>#x{base}0</Index><SubIndex>3</SubIndex><BitLen>16</BitLen></Entry>"
    "<Entry><Index>#x{base}0</Index><SubIndex>2</SubIndex><BitLen>16</BitLen></Entry>"
)


def device(inside: str = "", *, product: str = "#x10", revision: str = "#x1", type_: str = "D"):
    number = f' RevisionNo="{revision}"' if revision else ""
    return f'<Device><Type ProductCode="{product}"{number}>{type_}</Type>{inside}</Device>\n'


def pdo(tag: str, index: str, inside: str = "", attributes: str = "") -> str:
    return f"<{tag} {attributes}><Index>{index}</Index>{inside}</{tag}>\n"


def load(text: str | bytes, **choice):
    out = Collector()
    data = text.encode() if isinstance(text, str) else text
    description = load_esi(data, out, choice=EsiChoice(**choice), name="a.xml")
    return description, out


def one(text: str | bytes, **choice):
    description, out = load(text, **choice)
    assert out.diagnostics == []
    (subdevice,) = description.subdevices
    return subdevice


def codes(out: Collector) -> list[tuple[str, str]]:
    return [(d.code, str(d.span)) for d in out.diagnostics]


def carried(subdevice) -> dict[int, list[int]]:
    return {sm.index: [p.index for p in sm.pdos] for sm in subdevice.device.sync_managers}


# -- which device ---------------------------------------------------------------------------------


def test_identity_names_and_places():
    text = esi_text(
        '<Device><Type ProductCode="#x7703052" RevisionNo="1048576">EL1</Type>'
        '<Name LcId="1031">Eingang</Name><Name LcId="1033">Input</Name></Device>',
        vendor="2",
    )
    found = one(text)
    assert (found.order, found.name, found.revision) == ("EL1", "Input", 0x100000)
    assert (found.device.vendor_id, found.device.product_code) == (2, 0x07703052)
    assert found.position is None
    assert str(found.span) == "a.xml:3:1"


@pytest.mark.parametrize("number", ["#x0CAFE", "0xcafe", "51966", "0051966", "#XCAFE", " #xcafe\n"])
def test_numbers_in_every_spelling(number):
    found = one(esi_text(device(product=number), vendor=number))
    assert (found.device.vendor_id, found.device.product_code) == (0xCAFE, 0xCAFE)


REVISIONS = "".join(device(revision=r) for r in ("#x00100000", "#x00120000", "#x00150000"))


def test_exact_revision_is_preferred():
    assert one(esi_text(REVISIONS), product=16, revision=0x120000).revision == 0x120000


def test_nearest_lower_revision_is_taken_and_said():
    description, out = load(esi_text(REVISIONS), product=16, revision=0x140000)
    (found,) = description.subdevices
    assert found.revision == 0x120000
    assert codes(out) == [("FSN136", "a.xml:4:1")]
    assert "0x00140000" in found.notes[0]
    assert "0x00120000" in found.notes[0]


def test_no_lower_revision_is_refused():
    description, out = load(esi_text(REVISIONS), product=16, revision=0x10000)
    assert description is None
    assert [d.code for d in out.diagnostics] == ["FSN135"]


def test_newest_without_a_revision_and_an_entry_that_leaves_it_open():
    found = one(esi_text(REVISIONS), product=16)
    assert found.revision == 0x150000
    assert "newest of 3" in found.notes[0]
    description, out = load(esi_text(device(revision="")), product=16, revision=5)
    assert description.subdevices[0].revision is None
    assert [d.code for d in out.diagnostics] == ["FSN136"]


@pytest.mark.parametrize(
    ("choice", "hint"),
    [
        ({"product": 17}, "it describes D"),
        ({"product": 16, "vendor": 3}, "it has D of vendor 0x00000a5f"),
        ({"type": "EL1940"}, "did you mean EL1904?"),
    ],
)
def test_device_that_is_not_there(choice, hint):
    text = esi_text(device() + device(product="5", type_="EL1904"))
    description, out = load(text, **choice)
    assert description is None
    assert codes(out) == [("FSN135", "a.xml:1:1")]
    assert hint in out.diagnostics[0].hint


def test_type_is_found_whatever_its_capitals():
    text = esi_text(device() + device(product="5", type_="EL1904"))
    assert one(text, type="el1904").device.product_code == 5


def test_many_devices_need_a_choice():
    text = esi_text("".join(device(product=str(n)) for n in range(1, 70)))
    description, out = load(text)
    assert description is None
    assert "69 devices" in out.diagnostics[0].message


def test_list_of_the_ethercat_tool_has_places():
    info = (
        "<EtherCATInfo><Vendor><Id>{0}</Id></Vendor><Descriptions><Devices>{1}</Devices>"
        "</Descriptions></EtherCATInfo>"
    )
    inside = (
        '<Sm Enable="1" StartAddress="#x1000" ControlByte="#x26" DefaultSize="128" />'
        '<Sm Enable="1" StartAddress="#x1080" ControlByte="#x22" DefaultSize="128" />'
        '<Sm Enable="1" StartAddress="#x1100" ControlByte="#x64" DefaultSize="6" />'
        '<Sm Enable="1" StartAddress="#x1180" ControlByte="#x20" DefaultSize="6" />'
    )
    text = f"<EtherCATInfoList>{info.format(2, device(inside))}{info.format(7, device())}"
    description, out = load(text + "</EtherCATInfoList>")
    assert out.diagnostics == []
    first, second = description.subdevices
    assert (first.position, second.position) == (0, 1)
    assert (first.device.vendor_id, second.device.vendor_id) == (2, 7)
    ways = [sm.direction.value for sm in first.device.sync_managers]
    assert ways == ["output", "input", "output", "input"]


def test_catalogue_lists_devices_with_their_places():
    out = Collector()
    text = esi_text(device() + device(product="5"), modules=module_text(190, ""))
    found = list_esi(text.encode(), out)
    assert [(r.kind, r.product, r.type) for r in found.rows] == [
        ("device", 16, "D"),
        ("device", 5, "D"),
        ("module", 190, "M"),
    ]
    row = found.rows[1]
    assert text.encode()[row.offset : row.end].startswith(b'<Device><Type ProductCode="5"')
    assert (row.line, row.column) == (4, 1)


# -- PDOs -----------------------------------------------------------------------------------------


def test_pdos_go_where_sm_states_and_the_rest_is_available():
    inside = (
        SMS
        + pdo("RxPdo", "#x1600", FRAME.format(base="700"), 'Fixed="true" Sm="2"')
        + pdo("RxPdo", "#x1601", "", 'Sm="2"')
        + pdo("TxPdo", "#x1a00", FRAME.format(base="600"), 'Sm="3"')
        + pdo("TxPdo", "#x1a01", "<Exclude>#x1a00</Exclude>")
        + pdo("TxPdo", "#x1a02", "", 'Mandatory="1"')
        + pdo("TxPdo", "#x1a03", "", 'Virtual="1" Sm="3"')
    )
    found = one(esi_text(device(inside)))
    assert carried(found) == {0: [], 1: [], 2: [0x1600, 0x1601], 3: [0x1A00, 0x1A02]}
    assert [p.index for p in found.available] == [0x1A01, 0x1A03]
    assert [sm.start_byte for sm in found.device.sync_managers] == [0x1000, 0x1080, 0x1100, 0x1180]
    blocks = [b for sm in found.device.layout.managers for b in sm.blocks]
    assert [(b.sm_index, b.frame_bytes) for b in blocks] == [(2, 6), (3, 6)]
    assert len(found.notes) == 2


def test_a_virtual_pdo_has_its_place_on_a_virtual_sync_manager():
    clock = '<Sm StartAddress="#x0998" ControlByte="#x00" Virtual="1" Enable="1">Inputs</Sm>'
    entry = "<Entry><Index>#x1d09</Index><SubIndex>1</SubIndex><BitLen>32</BitLen></Entry>"
    found = one(esi_text(device(SMS + clock + pdo("TxPdo", "#x1702", entry, 'Virtual="1" Sm="4"'))))
    assert carried(found)[4] == [0x1702]
    assert (found.available, found.notes) == ((), ())


def test_gaps_of_any_size_stay():
    gaps = "".join(f"<Entry><Index>#x0</Index><BitLen>{n}</BitLen></Entry>" for n in (1, 9, 900))
    found = one(esi_text(device(SMS + pdo("TxPdo", "#x1a00", gaps, 'Sm="3"'))))
    (mapped,) = found.device.sync_managers[3].pdos
    assert [e.bits for e in mapped.entries] == [1, 9, 900]
    assert all(e.is_gap for e in mapped.entries)


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        (pdo("RxPdo", "#x1600", "", 'Sm="3"'), "other direction"),
        (pdo("RxPdo", "#x1600", "", 'Sm="0"'), "is a mailbox"),
        (pdo("RxPdo", "#x1600", "", 'Sm="7"'), "does not have"),
        (2 * pdo("RxPdo", "#x1600", "", 'Sm="2"'), "assigned twice"),
        (
            pdo("RxPdo", "#x1600", "", 'Sm="2"')
            + pdo("RxPdo", "#x1601", "<Exclude>#x1600</Exclude>", 'Sm="2"'),
            "exclude each other",
        ),
        (
            pdo("RxPdo", "#x1601", "<Exclude>#x1600</Exclude>", 'Sm="2"')
            + pdo("RxPdo", "#x1600", "", 'Sm="2"'),
            "exclude each other",
        ),
    ],
)
def test_contradictions_are_reported_and_the_file_is_followed(inside, message):
    description, out = load(esi_text(device(SMS + inside)))
    assert [d.code for d in out.diagnostics] == ["FSN139"]
    assert message in out.diagnostics[0].message
    assert out.diagnostics[0].span.line >= 4
    managers = description.subdevices[0].device.sync_managers
    assert any(p.index == 0x1600 for sm in managers for p in sm.pdos)


@pytest.mark.parametrize(
    ("inside", "code"),
    [
        ("<Entry><Index>#x6000</Index></Entry>", "FSN110"),
        ("<Entry><BitLen>8</BitLen></Entry>", "FSN110"),
        ("<Entry><Index>sixty</Index><BitLen>8</BitLen></Entry>", "FSN111"),
        ("<Entry><Index>#x16000</Index><BitLen>8</BitLen></Entry>", "FSN113"),
        ("<Entry><Index>1</Index><SubIndex>256</SubIndex><BitLen>8</BitLen></Entry>", "FSN113"),
        ("<Entry><Index>1</Index><BitLen>-8</BitLen></Entry>", "FSN113"),
        ("<Entry><Index>1</Index><BitLen>9999999</BitLen></Entry>", "FSN113"),
    ],
)
def test_a_layout_that_is_not_whole_is_not_given(inside, code):
    description, out = load(esi_text(device(SMS + pdo("TxPdo", "#x1a00", inside, 'Sm="3"'))))
    assert description is None
    assert [d.code for d in out.diagnostics] == [code]
    assert out.diagnostics[0].span.line == 4
    assert all(d.hint for d in out.diagnostics)


def test_start_up_sdos_and_clock():
    inside = (
        "<Mailbox><CoE><InitCmd><Index>#x1c12</Index><SubIndex>0</SubIndex><Data>00</Data></InitCmd>"
        "<InitCmd><Index>#x8000</Index><SubIndex>1</SubIndex><Data>0102 0304</Data></InitCmd>"
        "<InitCmd><Index>#x8001</Index><SubIndex>1</SubIndex><Data>010203</Data></InitCmd>"
        '<InitCmd CompleteAccess="1"><Index>#x8002</Index><SubIndex>0</SubIndex><Data>01</Data>'
        "</InitCmd></CoE></Mailbox>"
        "<Dc><OpMode><Name>DC</Name><AssignActivate>#x700</AssignActivate></OpMode>"
        "<OpMode><Name>Free</Name></OpMode></Dc>"
    )
    found = one(esi_text(device(inside)))
    made = [(s.index, s.subindex, s.size_bytes, s.value) for s in found.device.sdos]
    assert made == [(0x1C12, 0, 1, 0), (0x8000, 1, 4, 0x04030201)]
    assert found.device.assign_activate == 0x700
    assert [n.split(" is ")[0] for n in found.notes] == [
        "start-up SDO 0x8001:01 of 3 bytes",
        "start-up SDO 0x8002:00 with complete access",
        "of the clock modes DC, Free the first",
    ]


# -- modules --------------------------------------------------------------------------------------

SLOTS = (
    '<Slots SlotPdoIncrement="1" SlotIndexIncrement="#x10">'
    '<Slot><ModuleIdent Default="1">190</ModuleIdent><ModuleIdent>#xbf</ModuleIdent></Slot>'
    '<Slot MaxInstances="2" SlotIndexIncrement="#x20"><ModuleIdent>#xbf</ModuleIdent></Slot>'
    "</Slots>"
)
BOUND = FRAME.replace("<Index>#x", '<Index DependOnSlot="true">#x')
MODULES = module_text(
    0xBE, pdo("TxPdo", "#x1a00", FRAME.format(base="600"), 'Fixed="1" Sm="3"')
) + module_text(
    0xBF,
    f'<TxPdo Sm="3"><Index DependOnSlot="1">#x1a00</Index>{BOUND.format(base="600")}</TxPdo>',
)
MODULAR = esi_text(
    device(
        SMS
        + pdo("TxPdo", "#x1a00", "", 'Sm="3" OverwrittenByModule="1"')
        + pdo("TxPdo", "#x1bff", "", 'Sm="3"')
        + SLOTS
    ),
    modules=MODULES,
)


def test_default_module_replaces_the_pdo_of_the_device():
    found = one(MODULAR)
    assert carried(found)[3] == [0x1A00, 0x1BFF]
    assert found.device.sync_managers[3].pdos[0].bits == 48
    assert found.module_ident == (0xBE,)


def test_chosen_modules_move_with_their_slot():
    found = one(MODULAR, modules=(0xBF, None, 0xBF))
    assert carried(found)[3] == [0x1A00, 0x1A02, 0x1BFF]
    first, second, _ = found.device.sync_managers[3].pdos
    assert [e.index for e in first.entries] == [0x6000, 0x6001, 0, 0x6000, 0x6000]
    assert [e.index for e in second.entries] == [0x6040, 0x6041, 0, 0x6040, 0x6040]
    assert found.module_ident == (0xBF, 0xBF)
    assert "order of their index" in found.notes[0]


def test_module_pdo_without_a_place_takes_that_of_the_device():
    found = one(MODULAR.replace('Fixed="1" Sm="3"', 'Fixed="1"'))
    assert carried(found)[3] == [0x1A00, 0x1BFF]
    assert found.device.sync_managers[3].pdos[0].bits == 48


def test_empty_slots_leave_the_device_alone():
    found = one(MODULAR, modules=())
    assert found.module_ident == ()
    assert found.device.sync_managers[3].pdos[0].bits == 0


@pytest.mark.parametrize(
    ("modules", "message", "given"),
    [
        ((0xC0,), "is not among those of slot 0", False),
        ((None, 0xBE), "is not among those of slot 1", True),
        ((None, None, None, 0xBE), "4 modules are chosen, the device has 3 slots", False),
    ],
)
def test_modules_that_do_not_fit(modules, message, given):
    description, out = load(MODULAR, modules=modules)
    assert any(message in d.message for d in out.diagnostics)
    assert {d.code for d in out.diagnostics} == {"FSN137"}
    assert (description is not None) is given


@pytest.mark.parametrize(
    ("slots", "idents", "note"),
    [
        (
            '<Slot MaxInstances="3"><ModuleIdent Default="1">1</ModuleIdent>'
            '<ModuleIdent Default="true">2</ModuleIdent></Slot>',
            (1, 2),
            "",
        ),
        (
            '<Slot MinInstances="2" MaxInstances="9"><ModuleIdent Default="1">2</ModuleIdent>'
            "</Slot>"
            '<Slot><ModuleIdent Default="1">1</ModuleIdent></Slot>',
            (2, 2, 1),
            "",
        ),
        ('<Slot MinInstances="1"><ModuleIdent>2</ModuleIdent></Slot>', (2,), "its only module"),
        (
            '<Slot MinInstances="1"><ModuleIdent>1</ModuleIdent><ModuleIdent>2</ModuleIdent>'
            "</Slot>",
            (),
            "left empty",
        ),
        ("<Slot><ModuleIdent>1</ModuleIdent></Slot>", (), ""),
        ('<ModulePdoGroup Alignment="4"/>', (), "alignment"),
        (
            '<Slot MinInstances="1"><ModuleIdent>2</ModuleIdent></Slot>'
            '<ModulePdoGroup Alignment="4"/>',
            (2,),
            "alignment",
        ),
    ],
)
def test_modules_that_are_built_in(slots, idents, note):
    text = esi_text(
        device(f"<Slots>{slots}</Slots>"), modules=module_text(1, "") + module_text(2, "")
    )
    found = one(text)
    assert found.module_ident == idents
    assert note in "".join(found.notes)
    assert bool(found.notes) is bool(note)


def test_number_of_a_slot_counts_those_before_it():
    slots = (
        '<Slots SlotPdoIncrement="2"><Slot MaxInstances="10"/>'
        '<Slot><ModuleIdent Default="1">1</ModuleIdent></Slot></Slots>'
    )
    module = '<TxPdo Sm="3"><Index DependOnSlot="1">#x1a00</Index></TxPdo>'
    found = one(esi_text(device(SMS + slots), modules=module_text(1, module)))
    assert carried(found)[3] == [0x1A14]


def test_marks_of_the_schema_are_noted():
    inside = SMS + pdo("TxPdo", "#x1a00", "", 'Sm="3" SafetyPdoType="FSoESlave"')
    assert one(esi_text(device(inside))).notes == ("PDO 0x1a00 is marked FSoESlave",)


def test_module_in_another_file_is_named():
    text = MODULAR.replace("</Vendor>", "</Vendor><InfoReference>Modules.xml</InfoReference>")
    _, out = load(text.replace('ModuleIdent="190"', 'ModuleIdent="1"'))
    assert [d.code for d in out.diagnostics] == ["FSN137"]
    assert "Modules.xml" in out.diagnostics[0].hint


def test_index_that_runs_over():
    text = MODULAR.replace('SlotIndexIncrement="#x10"', 'SlotIndexIncrement="#xf000"')
    text = text.replace(' SlotIndexIncrement="#x20"', "")
    description, out = load(text, modules=(None, 0xBF))
    assert description is None
    assert {d.code for d in out.diagnostics} == {"FSN113"}


# -- the whole ------------------------------------------------------------------------------------


@settings(max_examples=examples(60), deadline=None)
@given(described_devices())
def test_written_values_are_read_back(made):
    text = esi_text(device_text(made), vendor=str(made.device.vendor_id))
    found = one(text)
    expected = replace(
        made,
        device=replace(made.device, path="a.xml"),
        notes=found.notes,
        available=found.available,
    )
    assert found == expected
    assert [p.index for p in found.available] == [p.index for p in made.available]


@settings(max_examples=40, deadline=None)
@given(described_devices())
def test_encodings_and_one_line_give_the_same(made):
    text = esi_text(device_text(made), vendor=str(made.device.vendor_id))
    plain = one(text)
    head = '<?xml version="1.0" encoding="{}"?>'
    for coding, name in (("latin-1", "ISO-8859-1"), ("utf-8-sig", "utf-8"), ("utf-16", "utf-16")):
        assert one((head.format(name) + text).encode(coding)) == plain
    assert one(text.replace("\n", "")) == plain


@pytest.mark.parametrize("name", listed("esi", "*.xml"))
def test_real_esi_is_read_without_findings(name):
    out = Collector()
    description = load_esi(need("esi", name), out)
    assert out.diagnostics == []
    for found in description.subdevices:
        assert found.device.vendor_id
        for sm in found.device.sync_managers:
            assert all(p.index >= 0x1600 for p in sm.pdos)


def test_entries_have_their_place():
    inside = SMS + pdo("TxPdo", "#x1a00", "\n  " + FRAME.format(base="600"), 'Sm="3"')
    found = one(esi_text(device(inside)))
    (mapped,) = found.device.sync_managers[3].pdos
    assert isinstance(mapped, Pdo)
    assert isinstance(mapped.entries[0], Entry)
    assert str(mapped.span) == "a.xml:4:1"
    assert str(mapped.entries[0].span) == "a.xml:5:3"
    assert found.device.sync_managers[3].direction is Direction.INPUT


def test_places_in_one_line_count_from_its_begin():
    text = esi_text(device(SMS + pdo("TxPdo", "#x1a00", FRAME.format(base="600"), 'Sm="3"')))
    text = text.replace("\n", "")
    (mapped,) = one(text).device.sync_managers[3].pdos
    assert str(mapped.span) == f"a.xml:1:{text.index('<TxPdo') + 1}"
    assert str(mapped.entries[0].span) == f"a.xml:1:{text.index('<Entry') + 1}"
