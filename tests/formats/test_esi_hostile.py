"""ESI files that are damaged, foreign, huge or lie; cached catalogues that do."""

from __future__ import annotations

import codecs
import hashlib
import json

import pytest
from bench.big_esi import write_big_esi
from formats.esi_text import esi_text, module_text

from fsoe_net.formats.esi import read as esi_module
from fsoe_net.formats.esi.cache import cache_folder
from fsoe_net.formats.esi.read import EsiChoice, list_esi, load_esi
from fsoe_net.formats.shared.files import Collector

DEVICE = '<Device><Type ProductCode="#x10" RevisionNo="1">D</Type><Name>{0}</Name>{1}</Device>\n'


def load(text: str | bytes, **choice):
    out = Collector()
    data = text.encode() if isinstance(text, str) else text
    description = load_esi(data, out, choice=EsiChoice(**choice), name="a.xml")
    assert all(d.hint for d in out.diagnostics)
    return description, out


def refused(text: str | bytes) -> tuple[str, str]:
    description, out = load(text)
    assert description is None
    (only,) = out.diagnostics
    return only.code, str(only.span)


PLAIN = esi_text(DEVICE.format("N", ""))


@pytest.mark.shows("R7")
@pytest.mark.parametrize(
    ("text", "code", "span"),
    [
        ("", "FSN118", "a.xml:1:1"),
        ("<EtherCATConfig/>", "FSN140", "a.xml:1:1"),
        ("\n <robot name='a'/>", "FSN140", "a.xml:2:2"),
        ("<EtherCATInfo/>", "FSN135", "a.xml:1:1"),
        ("<EtherCATInfo>\n<Descriptions></EtherCATInfo>", "FSN118", "a.xml:2:17"),
        (PLAIN[: PLAIN.index("</Device>")], "FSN118", "a.xml:3:71"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]>" + PLAIN, "FSN118", "a.xml:1:1"),
        ("<?xml version='1.0' encoding='nonsense'?>" + PLAIN, "FSN118", None),
        (PLAIN.replace(">D<", ">&nbsp;<"), "FSN118", None),
        (b"\xff\xfe\0", "FSN118", None),
        (PLAIN.replace("<Type", "<Type>" * 300), "FSN118", None),
        (PLAIN.replace("<Name>N", "<A>" * 300 + "<Name>N"), "FSN118", None),
    ],
)
def test_an_invalid_esi_is_rejected_at_its_place(text, code, span):
    found = refused(text)
    assert found[0] == code
    assert span in (None, found[1])


@pytest.mark.parametrize("root", ["EtherCATConfig", "EtherCATModule", "TcSmProject", "masters"])
def test_known_foreign_files_are_named(root):
    _, out = load(f"<{root}/>")
    assert "this is" in out.diagnostics[0].hint


def test_names_that_a_tool_did_not_escape():
    _, out = load(esi_text(DEVICE.format("Start & stop", "")))
    assert [d.code for d in out.diagnostics] == ["FSN118"]
    assert "&amp;" in out.diagnostics[0].hint


@pytest.mark.shows("R7")
def test_entities_never_expand():
    bomb = "<!DOCTYPE a [<!ENTITY b 'bbbbbbbbbb'><!ENTITY c '&b;&b;&b;'>]>"
    assert refused(bomb + PLAIN.replace(">D<", ">&c;<"))[0] == "FSN118"


def test_text_of_another_encoding_is_read_and_reported():
    text = esi_text(DEVICE.format("Größe", ""))
    description, out = load(text.encode("latin-1"))
    assert description.subdevices[0].name == "Größe"
    (only,) = out.diagnostics
    assert (only.code, only.level.value, str(only.span)) == ("FSN118", "warning", "a.xml:3:65")
    assert "ISO-8859-1" in only.hint


def test_windows_encoding_and_marks():
    head = '<?xml version="1.0" encoding="windows-1252"?>'
    description, out = load((head + esi_text(DEVICE.format("5 €", ""))).encode("cp1252"))
    assert (description.subdevices[0].name, out.diagnostics) == ("5 €", [])
    description, out = load(codecs.BOM_UTF8 + PLAIN.encode())
    assert str(description.subdevices[0].span) == "a.xml:3:1"


@pytest.mark.parametrize(
    ("attributes", "code"),
    [
        ('RevisionNo="1"', "FSN110"),
        ('ProductCode="ten"', "FSN111"),
        ('ProductCode="#x123456789"', "FSN111"),
        ('ProductCode="' + "9" * 50 + '"', "FSN111"),
    ],
)
def test_device_without_an_identity_is_left_out_and_reported(attributes, code):
    other = f"<Device><Type {attributes}>X</Type></Device>\n"
    description, out = load(esi_text(other + DEVICE.format("N", "")))
    assert [d.name for d in description.subdevices] == ["N"]
    assert [(d.code, str(d.span)) for d in out.diagnostics] == [(code, "a.xml:3:1")]


def test_vendor_that_is_missing():
    description, out = load(PLAIN.replace("<Id>#x00000a5f</Id>", ""))
    assert description.subdevices[0].device.vendor_id == 0
    assert [d.code for d in out.diagnostics] == ["FSN110"]


# What stands in a dictionary is jumped over; its tags may be anywhere.
PROFILES = [
    "<Profile><Dictionary>\n<a/></Dictionary></Profile>",
    "<Profile/>",
    "<!-- <Profile> -->",
    "<!-- <Profile> --><Profile>\n</Profile>",
    "<Profile><!-- </Profile> --></Profile>",
    "<Profile><![CDATA[</Profile>]]>\n</Profile>",
    "<Profile><![CDATA[a]]></Profile>",
    "<Profile Channel='>'>\n</Profile>",
    "<Profile><Profile></Profile></Profile>",
    "<ProfileNo>5001</ProfileNo>",
    "<Desc>a\nb</Desc><Profile  >\n\n</Profile\n>",
]


@pytest.mark.parametrize("profile", PROFILES)
def test_dictionaries_are_jumped_over_without_losing_the_place(profile):
    text = esi_text(
        DEVICE.format("A", profile)
        + DEVICE.format("B", profile)
        + "  "
        + DEVICE.format("Last", profile),
        modules=module_text(1, profile),
    )
    out = Collector()
    found = list_esi(text.encode(), out, name="a.xml")
    assert out.diagnostics == []
    assert [r.name for r in found.devices] == ["A", "B", "Last"]
    last = found.devices[-1]
    lines = text[: text.index("<Device", text.index(">B<"))].split("\n")
    assert (last.line, last.column) == (len(lines), len(lines[-1]) + 1)
    assert text[last.offset :].startswith("<Device><Type")
    description, out = load(text)
    assert out.diagnostics == []
    assert len(description.subdevices) == 3


def test_a_dictionary_without_an_end_is_not_an_end_of_the_device():
    code, _ = refused(esi_text(DEVICE.format("A", "<Profile>") + DEVICE.format("B", PROFILES[0])))
    assert code == "FSN118"


def test_a_dictionary_across_two_devices_is_refused():
    assert refused(esi_text(DEVICE.format("A", "<Profile>") + DEVICE.format("B", "</Profile>")))


def test_text_between_comments_counts():
    text = esi_text(
        '<Device><Type ProductCode="1">D</Type><!-- <Profile> --><Name>Between</Name>'
        "<!-- </Profile> --></Device>"
    )
    found = list_esi(text.encode(), Collector())
    assert [r.name for r in found.rows] == ["Between"]


def test_file_that_is_too_large_or_not_there(tmp_path, monkeypatch):
    path = tmp_path / "a.xml"
    path.write_text(PLAIN, "utf-8")
    monkeypatch.setattr(esi_module, "MAX_LARGE_BYTES", 10)
    out = Collector()
    assert load_esi(path, out) is None
    assert load_esi(tmp_path / "b.xml", out) is None
    assert [d.code for d in out.diagnostics] == ["FSN101", "FSN101"]


# -- the cache ------------------------------------------------------------------------------------


@pytest.fixture
def big(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = tmp_path / "big.xml"
    write_big_esi(path, 400_000, objects=30)
    return path


def read_big(path):
    out = Collector()
    description = load_esi(path, out, choice=EsiChoice(product=3, revision=0x20000))
    assert out.diagnostics == []
    (found,) = description.subdevices
    return found


def test_catalogue_is_kept_and_gives_the_same(big, monkeypatch):
    first = read_big(big)
    assert first.name == "Device 7"
    (kept,) = cache_folder().iterdir()
    assert kept.stem == hashlib.sha256(big.read_bytes()).hexdigest()
    monkeypatch.setattr(esi_module, "scan_esi", None)  # it is not scanned again
    second = read_big(big)
    assert second == first
    assert second.span == first.span


def _rows(change):
    def spoil(body: bytes) -> bytes:
        document = json.loads(body)
        change(document)
        return json.dumps(document).encode()

    return spoil


SPOILT = {
    "cut off": lambda body: body[:-10],
    "empty": lambda body: b"",
    "no JSON": lambda body: b"[" * 100_000,
    "a list": lambda body: b"[]",
    "a number": lambda body: b"1",
    "another version": _rows(lambda d: d.update(version=0)),
    "another file": _rows(lambda d: d.update(sha256="")),
    "rows that are none": _rows(lambda d: d.update(rows=[1])),
    "a key is missing": _rows(lambda d: d["rows"][0].pop("end")),
    "text for a number": _rows(lambda d: d["rows"][0].update(offset="1")),
    "a truth value for a number": _rows(lambda d: d["rows"][0].update(offset=True)),
    "negative": _rows(lambda d: d["rows"][0].update(offset=-1)),
    "behind the end": _rows(lambda d: d["rows"][0].update(end=10**9)),
    "places that are no devices": _rows(lambda d: [r.update(offset=1) for r in d["rows"]]),
    "another kind": _rows(lambda d: d["rows"][0].update(kind="slot")),
    "references that are none": _rows(lambda d: d.update(references=[1])),
    "encoding that is none": _rows(lambda d: d.update(encoding=1)),
}


@pytest.mark.parametrize("how", SPOILT)
@pytest.mark.parametrize("signed", [False, True])
def test_damaged_cache_is_as_good_as_none(big, how, signed):
    first = read_big(big)
    (kept,) = cache_folder().iterdir()
    good = kept.read_bytes()
    head, _, body = good.partition(b"\n")
    body = SPOILT[how](body)
    if signed:
        head = hashlib.sha256(body).hexdigest().encode()
    kept.write_bytes(head + b"\n" + body)
    assert read_big(big) == first
    assert kept.read_bytes() == good  # and written anew


def test_cache_that_was_changed_is_not_believed(big):
    first = read_big(big)
    (kept,) = cache_folder().iterdir()
    good = kept.read_bytes()
    kept.write_bytes(good.replace(b"Device 7", b"Device 8"))
    assert read_big(big) == first
    assert kept.read_bytes() == good


def test_cache_that_cannot_be_written(big, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert read_big(big).name == "Device 7"
    monkeypatch.setenv("XDG_CACHE_HOME", "not/absolute")
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr("pathlib.Path.home", _no_home)
    assert cache_folder() is None
    assert read_big(big).name == "Device 7"


def _no_home():
    raise RuntimeError("no home")


def test_old_catalogues_go(big, monkeypatch):
    monkeypatch.setattr("fsoe_net.formats.esi.cache._MAX_FILES", 1)
    read_big(big)
    big.write_bytes(big.read_bytes() + b"\n")
    read_big(big)
    (kept,) = cache_folder().iterdir()
    assert kept.stem == hashlib.sha256(big.read_bytes()).hexdigest()


def test_small_files_and_files_with_findings_are_not_kept(big):
    assert load(PLAIN)[0] is not None
    text = big.read_bytes().replace(b'ProductCode="#x00000001"', b'ProductCode="?"')
    big.write_bytes(text)
    for _ in range(2):
        out = Collector()
        list_esi(big, out)
        assert [d.code for d in out.diagnostics] == ["FSN111", "FSN111"]
    assert not cache_folder().exists()


# -- as much as it can be -------------------------------------------------------------------------


def test_slots_do_not_multiply_without_bound():
    slot = (
        '<Slot MinInstances="65535" MaxInstances="65535"><ModuleIdent Default="1">1</ModuleIdent>'
    )
    entry = "<Entry><Index>0</Index><BitLen>1</BitLen></Entry>"
    module = module_text(1, f'<TxPdo Sm="3"><Index>#x1a00</Index>{100 * entry}</TxPdo>')
    text = esi_text(DEVICE.format("N", f"<Slots>{slot}</Slot>{500 * (slot + '</Slot>')}</Slots>"))
    description, out = load(text.replace("<Modules>\n", "<Modules>\n" + module))
    assert description is None
    assert [d.code for d in out.diagnostics] == ["FSN103"]


def test_findings_do_not_multiply_without_bound():
    entry = "<Entry><Index>x</Index><BitLen>1</BitLen></Entry>"
    text = esi_text(DEVICE.format("N", f'<TxPdo Sm="3"><Index>#x1a00</Index>{500 * entry}</TxPdo>'))
    _, out = load(text)
    assert len(out.diagnostics) == 50
    pdos = "".join(f'<TxPdo Sm="3"><Index>{n}</Index></TxPdo>' for n in range(1, 500))
    description, out = load(esi_text(DEVICE.format("N", pdos)))
    assert description is not None
    assert len(out.diagnostics) == 50


def test_rows_and_references_have_an_end(monkeypatch):
    monkeypatch.setattr("fsoe_net.formats.esi.catalogue.MAX_ROWS", 3)
    no_identity = "<Device><Type>X</Type></Device>\n"
    _, out = load(esi_text(4 * no_identity))
    assert [d.code for d in out.diagnostics] == ["FSN110", "FSN110", "FSN110", "FSN103"]
    out = Collector()
    text = PLAIN.replace("</Vendor>", "</Vendor>" + 1100 * "<InfoReference>a</InfoReference>")
    assert len(list_esi(text.encode(), out).references) == 1000
