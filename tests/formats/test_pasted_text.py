"""Output of the IgH and SOEM tools: whole, in noise, and cut off at every place."""

from __future__ import annotations

import pytest
from data_files import need
from formats.sii_image import category, image, printed, strings
from formats.texts import (
    CONFIG,
    DOMAINS,
    PDOS,
    SLAVES,
    SLAVES_V,
    SOEM,
    SOEM_MAP,
    TWO_PDOS,
    XML,
    cstruct,
)

from fsoe_net.formats.igh.read import load_igh_text
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.soem.read import load_soem_text
from fsoe_net.model.bus import Watchdog
from fsoe_net.model.description import Description

MAILBOXES = "0010800026000101 8010800022000102"  # sync managers 0 and 1
SII = printed(
    image(
        strings(b"EK1914", b"coupler", b"in"),
        category(30, bytes([0, 0, 1, 2]) + bytes(28)),
        category(41, bytes.fromhex(MAILBOXES + "0011060064000103 8011010020000104")),
        category(50, bytes.fromhex("001a 01 03 00 03 0000 0060 01 03 05 08 0000")),
        alias=5,
    )
)
READERS = {
    "pdos": (PDOS, load_igh_text),
    "two pdos": (TWO_PDOS, load_igh_text),
    "cstruct": (cstruct(3, 16), load_igh_text),
    "xml": (XML, load_igh_text),
    "slaves -v": (SLAVES_V, load_igh_text),
    "config -v": (CONFIG, load_igh_text),
    "domains -v": (DOMAINS, load_igh_text),
    "sii_read -v": (SII, load_igh_text),
    "soem": (SOEM, load_soem_text),
}


def read(text: str, *codes: str, reader=load_igh_text) -> Description:
    out = Collector()
    found = reader(text.encode(), out, name="paste.txt")
    assert [d.code for d in out.diagnostics] == list(codes), out.diagnostics
    assert found is not None
    return found


def rows(found: Description) -> list[tuple]:
    return [
        (
            s.position,
            [
                (m.sm.index, m.sm.direction.value, p.bit_offset, p.entry.address, p.entry.bits)
                for m in s.device.layout.managers
                for p in m.placed
            ],
        )
        for s in found.subdevices
    ]


def test_output_of_ethercat_pdos_is_read():
    found = read(PDOS)
    (sub,) = found.subdevices
    layouts = sub.device.layout.managers
    assert [(m.sm.index, m.bits, m.sm.start_byte) for m in layouts] == [
        (2, 56, 0x1100),
        (3, 48, 0x1180),
    ]
    assert [b.frame_bytes for m in layouts for b in m.blocks] == [6, 6]
    assert layouts[0].sm.watchdog is Watchdog.ENABLE
    assert layouts[0].placed[0].entry.name == 'cmd "quoted"'
    assert sub.position is None
    assert sub.notes == ("SM2: DefaultSize 8, its PDOs 56 bits", "this text has no identity")


def test_pdos_without_entries_are_whole():
    quiet = "".join(line for line in PDOS.splitlines(keepends=True) if "entry" not in line)
    (sub,) = read(quiet).subdevices
    assert [m.complete for m in sub.device.layout.managers] == [False, False]


def test_pdos_of_several():
    found = read(TWO_PDOS)
    assert [s.position for s in found.subdevices] == [3, 11]
    assert rows(found)[0][1] == rows(found)[1][1]


def test_pdos_of_a_real_device():
    out = Collector()
    found = load_igh_text(need("igh", "igh_pdos_EP1918.txt"), out)
    assert found is not None
    assert out.diagnostics == []
    layouts = found.subdevices[0].device.layout.managers
    assert [(m.sm.index, m.size_bytes) for m in layouts] == [(2, 9), (3, 8), (4, 0), (5, 0)]
    assert [b.frame_bytes for m in layouts for b in m.blocks] == [6, 6]


def test_cstruct_numbers_come_from_identifiers():
    found = read(cstruct(3, 10, 16))
    assert [s.position for s in found.subdevices] == [3, 10, 16]
    assert [s.device.product_code for s in found.subdevices] == [0x077A2C52] * 3
    assert [s.revision for s in found.subdevices] == [0x120000] * 3
    layouts = found.subdevices[2].device.layout.managers
    assert [(m.sm.index, [p.index for p in m.sm.pdos or ()]) for m in layouts] == [
        (2, [0x1600, 0x17FF]),
        (3, [0x1A00]),
    ]
    assert [b.frame_bytes for m in layouts for b in m.blocks] == [6, 6]


def test_renamed_tables_are_followed_by_their_names():
    text = cstruct(3).replace("slave_3_pdo_entries", "a").replace("slave_3_pdos", "el6900_p")
    found = read(text.replace("slave_3_syncs", "s"))
    assert found.subdevices[0].position is None
    assert [m.bits for m in found.subdevices[0].device.layout.managers] == [48, 48]


def test_table_that_is_too_short_is_named():
    text = cstruct(3).replace("    {0x6000, 0x02, 16}, /* id */\n", "")
    out = Collector()
    load_igh_text(text.encode(), out)
    assert [d.code for d in out.diagnostics] == ["FSN147"]
    assert "5 rows from 4 on" in out.diagnostics[0].message


def test_xml_with_names_that_break_it():
    found = read(XML)
    (sub,) = found.subdevices
    assert (sub.position, sub.order, sub.name) == (4, "EK1914 <&>", "coupler & more")
    assert (sub.device.vendor_id, sub.device.product_code) == (2, 0x077A2C52)
    managers = sub.device.layout.managers
    assert [(m.sm.index, m.bits) for m in managers] == [(2, 16), (3, 16)]
    assert managers[0].placed[0].entry.name == "cmd < 3 & 4"
    assert managers[1].placed[0].entry.subindex == 10


@pytest.mark.parametrize(
    "text",
    [
        TWO_PDOS + TWO_PDOS.replace("Master 0", "Master 1"),
        cstruct(3, 11) + cstruct(3).replace("Master 0", "Master 1"),
    ],
)
def test_second_master_is_another_bus(text: str):
    assert [s.position for s in read(text, "FSN147").subdevices] == [3, 11]


def test_second_master_in_lists():
    listed = "Master0\n" + SLAVES + "Master1\n" + SLAVES
    assert len(read(listed, "FSN147").subdevices) == 4


def test_esi_of_a_vendor_is_not_taken_for_it():
    out = Collector()
    esi = "<EtherCATInfo><Descriptions><Groups><Group/></Groups></Descriptions></EtherCATInfo>"
    assert load_igh_text(esi.encode(), out) is None
    assert [d.code for d in out.diagnostics] == ["FSN140"]
    assert "an ESI" in out.diagnostics[0].message


def test_xml_of_several():
    body = XML.split("\n", 1)[1]
    text = f"<?xml version='1.0' ?>\n<EtherCATInfoList>\n{body}{body.replace('Slave 4', 'Slave 5')}"
    found = read(text + "</EtherCATInfoList>\n")
    assert [s.position for s in found.subdevices] == [4, 5]


def test_output_of_ethercat_slaves_is_read():
    found = read("Master0\n" + SLAVES + "xxx LINK FAILURE xxx\n")
    assert [(s.position, s.alias, s.order) for s in found.subdevices] == [
        (0, 0, "EK1100"),
        (1, 0, "EL1918"),
        (2, 5, ""),
        (10, 0, "EP1957"),
    ]
    assert found.subdevices[2].device.product_code == 0x077A2C52


def test_verbose_output_of_ethercat_slaves_is_read():
    (sub,) = read(SLAVES_V).subdevices
    assert (sub.position, sub.alias, sub.order, sub.name) == (2, 5, "EK1914", "EK1914 coupler")
    assert (sub.device.vendor_id, sub.revision, sub.serial) == (2, 0x120000, 7)
    assert len(sub.notes) == 2


def test_output_of_ethercat_config_is_read():
    (sub,) = read(CONFIG).subdevices
    assert (sub.position, sub.device.vendor_id, sub.device.product_code) == (1, 2, 0x077E3052)
    assert sub.device.assign_activate == 0x300
    assert [(s.index, s.subindex, s.size_bytes, s.value) for s in sub.device.sdos] == [
        (0x8000, 1, 2, 0x107)
    ]
    assert sub.notes == ("start-up SDO 0x8010 of 20 bytes is left out",)
    assert [(m.sm.index, m.bits) for m in sub.device.layout.managers] == [(2, 48), (3, 8)]
    two = read(CONFIG + CONFIG.replace("Position: 1", "Position: 2").replace("1 (OP)", "none"))
    assert [s.position for s in two.subdevices] == [1, 2]


def test_output_of_ethercat_domains_is_read():
    found = read(DOMAINS)
    assert [
        (s.position, [(m.sm.index, m.size_bytes) for m in s.device.layout.managers])
        for s in found.subdevices
    ] == [(1, [(2, 9), (3, 8)]), (0, [(2, 8), (3, 8)])]


def test_output_of_slaveinfo_is_read():
    found = read(SOEM, reader=load_soem_text)
    (sub,) = found.subdevices
    assert (sub.position, sub.name, sub.device.vendor_id) == (0, "Drive", 0x22D2)
    managers = sub.device.layout.managers
    assert [(m.sm.index, m.bits, m.sm.start_byte) for m in managers] == [
        (2, 64, 0x1100),
        (3, 48, 0x1180),
    ]
    assert [(b.byte_offset, b.frame_bytes) for m in managers for b in m.blocks] == [(2, 6), (0, 6)]


def test_soem_map_alone_and_with_byte_column():
    alone = read(SOEM_MAP, reader=load_soem_text)
    assert rows(alone)[0][1] == rows(read(SOEM, reader=load_soem_text))[0][1]
    numbered = SOEM_MAP.replace("  [0x", "  [39 ] [0x")
    assert rows(read(numbered, reader=load_soem_text)) == rows(alone)


def test_soem_map_from_the_sii():
    text = SOEM.replace("according to CoE", "according to SII")
    text = text.replace("  SM2 outputs", "  SM2 RXPDO 0x1600 out").replace(
        "  SM3 inputs", "  SM3 TXPDO 0x1A00 in"
    )
    (sub,) = read(text, reader=load_soem_text).subdevices
    assert [p.index for m in sub.device.sync_managers for p in m.pdos or ()] == [0x1600, 0x1A00]


def test_soem_without_a_map_is_named():
    head = SOEM[: SOEM.index("PDO mapping")]
    read(head + "End slaveinfo, close socket\n", "FSN147", reader=load_soem_text)
    read(head, "FSN146", reader=load_soem_text)


# -- noise ----------------------------------------------------------------------------------------


def noise(text: str) -> dict[str, str]:
    quoted = "".join(f"> {line}\n" for line in text.splitlines())
    prompt = "user@cell:~$ sudo ethercat show\n" + text + "user@cell:~$ \n"
    return {
        "prompt": prompt,
        "CRLF": text.replace("\n", "\r\n"),
        "indented": "".join(f"        {line}\n" for line in text.splitlines()),
        "flat": "".join(f"{line.strip()}\n" for line in text.splitlines()),
        "mail": quoted,
        "fence": f"Hello, here it is:\n\n```\n{text}```\nthanks!\n",
        "colours": f"\x1b[32m{text}\x1b[0m",
        "root": "[root@cell ~]# ethercat x\n" + text + "[root@cell ~]# exit\n",
    }


@pytest.mark.parametrize("kind", noise(""))
@pytest.mark.parametrize("name", [n for n in READERS if n != "xml"])
def test_noise_changes_nothing(name: str, kind: str):
    text, reader = READERS[name]
    clean = rows(read(text, reader=reader))
    assert rows(read(noise(text)[kind], reader=reader)) == clean


@pytest.mark.parametrize("kind", ["prompt", "CRLF", "indented", "fence", "root"])
def test_noise_around_xml(kind: str):
    assert rows(read(noise(XML)[kind])) == rows(read(XML))


# -- cut off --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", READERS)
def test_text_that_is_cut_is_never_a_shorter_map(name: str):
    """Cut behind every character: named as a cut, or read as the very same SubDevices."""
    text, reader = READERS[name]
    whole = rows(read(text, reader=reader))
    silent = []
    for end in range(len(text)):
        out = Collector()
        found = reader(text[:end].encode(), out, name="paste.txt")
        codes = {d.code for d in out.diagnostics}
        if found is None:
            assert codes & {"FSN140", "FSN146", "FSN118"}, (end, codes)
        elif not codes:
            if rows(found) != whole:
                silent.append(end)
        elif "FSN146" in codes:
            assert found.truncated
            assert "last good" in out.diagnostics[-1].message or "no line" in (
                out.diagnostics[-1].message
            )
    assert [text[:end].splitlines()[-1] for end in silent if not whole_part(name, text, end)] == []


def whole_part(name: str, text: str, end: int) -> bool:
    """Where a cut cannot be told from a shorter output: behind all of one SubDevice, or behind a
    whole line of the last sync manager of `pdos`, which says nothing of how much must follow, or
    between two categories of an EEPROM.
    """
    rest = text[end:].lstrip()
    if name in ("two pdos", "pdos") and text[:end].rfind("SM3") > text[:end].rfind("SM2"):
        return text[:end].rstrip()[-1] == '"'
    starts = ("=== Master", "/* Master", "Domain", "DC configuration", "AssignActivate", "None.")
    starts += ("SII Category",)
    return rest.startswith(starts) or (name == "config -v" and "IDN" in text[:end])


def test_last_good_line_is_named():
    lines = PDOS.splitlines(keepends=True)
    out = Collector()
    found = load_igh_text("".join(lines[:6]).encode() + b"    PDO entry 0x70", out, name="p.txt")
    assert found is not None
    assert found.truncated
    assert found.subdevices[-1].truncated
    assert str(out.diagnostics[0].span) == "p.txt:7:5"
    assert "line 6 is the last good one" in out.diagnostics[0].message


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (
            TWO_PDOS[: TWO_PDOS.index("=== Master 0, Slave 11 ===") + 27],
            "nothing follows the header",
        ),
        ("".join(PDOS.splitlines(keepends=True)[:1]), "nothing follows the mailbox SM0"),
        ("".join(PDOS.splitlines(keepends=True)[:3]), "SM2 has data but no PDOs"),
    ],
)
def test_missing_parts_at_a_cut_are_named(text: str, why: str):
    out = Collector()
    load_igh_text(text.encode(), out, name="p.txt")
    line = text.count("\n")
    (said,) = out.diagnostics
    assert said.message == f"the text is cut off: {why}; line {line} is the last good one"
    assert (said.span.line, said.span.column) == (line, 1)
    assert said.hint == "paste the whole output; what is missing cannot be guessed"


def test_xml_that_is_broken_is_named_at_its_place():
    out = Collector()
    assert load_igh_text(XML.replace("</Vendor>", "</Vendr>", 1).encode(), out) is None
    (said,) = out.diagnostics
    assert (said.code, str(said.span)) == ("FSN118", "<text>:6:5")


def test_a_last_subdevice_without_anything_is_a_cut():
    text = SOEM[: SOEM.index("End slaveinfo")] + "Slave:2\n Name:Other\n"
    found = read(text, "FSN146", reader=load_soem_text)
    assert [s.truncated for s in found.subdevices] == [False, True]


@pytest.mark.parametrize("mark", ["...", "[...]", "--More--", "\u2026"])
def test_lines_left_out_by_hand_are_a_cut(mark: str):
    lines = PDOS.splitlines(keepends=True)
    text = "".join((*lines[:6], f"    {mark}\n", *lines[8:]))
    assert read(text, "FSN146").truncated


def test_line_in_the_middle_that_is_broken_is_named():
    read(PDOS.replace("0x7001:01,  8 bit", "0x7001:01,  8 bi"), "FSN147")


@pytest.mark.parametrize("text", ["", "hello\n", "nets: []\n", "\0\0\0", "<EtherCATConfig/>"])
@pytest.mark.parametrize("reader", [load_igh_text, load_soem_text])
def test_other_texts_are_refused(text: str, reader):
    out = Collector()
    assert reader(text.encode(), out) is None
    assert [d.code for d in out.diagnostics] == ["FSN140"]


@pytest.mark.uncounted
def test_long_and_many_lines_are_bounded():
    for text in (
        " " * 4_000_000 + "x",
        'PDO entry 0x7000:01,  8 bit, "' * 100_000,
        "<EtherCATInfo>" + "<Name>" * 500_000 + "</EtherCATInfo>",
        "\n" * 4_000_000 + "SM2: PhysAddr 0x1200",
        "* " + " " * 4_000_000 + "ec_pdo_entry_info_t",
    ):
        load_igh_text(text.encode(), Collector())
    out = Collector()
    load_igh_text(b"SM2: PhysAddr 0x1100\n" * 500_000, out)
    assert [d.code for d in out.diagnostics][:1] == ["FSN103"]


@pytest.mark.uncounted
def test_tables_that_refer_to_each_other_without_end_are_refused():
    entries = "    {0x7000, 0x01, 8},\n" * 255
    pdos = "    {0x1600, 255, e + 0},\n" * 3000
    syncs = "".join("    {2, EC_DIR_OUTPUT, 255, p + 0, EC_WD_ENABLE},\n" for _ in range(200))
    text = (
        f"ec_pdo_entry_info_t e[] = {{\n{entries}}};\nec_pdo_info_t p[] = {{\n{pdos}}};\n"
        f"ec_sync_info_t s[] = {{\n{syncs}    {{0xff}}\n}};\n"
    )
    out = Collector()
    found = load_igh_text(text.encode(), out)
    assert found is not None
    assert found.subdevices == ()
    assert "FSN103" in [d.code for d in out.diagnostics]
