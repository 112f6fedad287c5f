"""Files in another shape: packed, as a dump, in another encoding, or not the file at all."""

from __future__ import annotations

import gzip
import io
import random
import zipfile

import pytest
from formats.sii_image import category, image

from fsoe_net.errors import InputError
from fsoe_net.formats.recognise import find_format
from fsoe_net.formats.registry import all_formats, read_foreign
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.sii.hex_text import binary_of

ENI = """<EtherCATConfig Version="1.3"><Config><Master><Info><Name>m</Name></Info></Master>
<Slave><Info><Name><![CDATA[Box \u00b0]]></Name>
<PhysAddr>1001</PhysAddr><AutoIncAddr>0</AutoIncAddr>
<VendorId>2</VendorId><ProductCode>#x1</ProductCode><RevisionNo>1</RevisionNo></Info></Slave>
</Config></EtherCATConfig>
"""
IMAGE = image(category(41, bytes.fromhex("0010040024000103")))


def kind(data: bytes, name: str = "file.xml"):
    out = Collector()
    return find_format(data, out, name=name), out


def packed() -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("a.xml", ENI)
    return stream.getvalue()


UNPACK = "unpack it, then name the files in it"
AGAIN = "fetch the file itself; this is what came instead of it"
OLD = "a compound document, as older editors save projects"


@pytest.mark.parametrize(
    ("data", "words", "hint"),
    [
        (packed(), "a ZIP archive", UNPACK),
        (b"\x1f\x8b\x08\0" + bytes(200), "a file packed with gzip", "unpack it with `gunzip`"),
        (b"BZh91AY&SY" + bytes(9), "a file packed with bzip2", "unpack it with `bunzip2`"),
        (b"\xfd7zXZ\0\0\4" + bytes(99), "a file packed with xz", "unpack it with `unxz`"),
        (b"7z\xbc\xaf\x27\x1c\0\4" + bytes(99), "a 7-Zip archive", UNPACK),
        (b"Rar!\x1a\7\1\0" + bytes(99), "a RAR archive", UNPACK),
        (b"%PDF-1.7\n", "a PDF document", "give the file that it describes"),
        (
            b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(99),
            OLD,
            "export the project as XML in its editor, and give that",
        ),
        (b"\x7fELF\2\1\1" + bytes(99), "a program", "give a file of the bus instead"),
        (
            b"version https://git-lfs.github.com/spec/v1\n",
            "a pointer of git-lfs, not the file",
            "run `git lfs pull`",
        ),
        (b"<!DOCTYPE html>\n<html><body><br></body></html>", "a web page (HTML)", AGAIN),
        (b"<HTML><p>log in", "a web page (HTML)", AGAIN),
    ],
)
@pytest.mark.parametrize("name", ["x.xml", "x.sii", "x.bin", "x.eni"])
def test_a_file_without_a_description_is_named_with_the_next_step(data, words, hint, name):
    found, out = kind(data, name)
    assert found is None
    (finding,) = out.diagnostics
    assert (finding.code, finding.hint) == ("FSN117", hint)
    assert finding.message == f"this is {words}, which is not read"


@pytest.mark.parametrize(
    "reader", [f for f in all_formats().values() if f.read and f.kind != "capture"]
)
def test_no_reader_takes_a_capture_for_its_own(reader):
    out = Collector()
    data = b"\x0a\x0d\x0d\x0a\x1c\0\0\0" + bytes(range(256)) * 4
    assert read_foreign(data, reader, out, name="x") is None
    assert {d.code for d in out.diagnostics} <= {"FSN117", "FSN140", "FSN118"}


def test_packed_content_decides_whether_it_is_a_capture():
    found, _ = kind(gzip.compress(b"\xd4\xc3\xb2\xa1\2\0\4\0" + random.Random(1).randbytes(200)))
    assert found.kind == "capture"
    found, out = kind(gzip.compress(ENI.encode() * 3))
    assert found is None
    assert "a file packed with gzip" in out.diagnostics[0].message


def intel_hex(data: bytes) -> bytes:
    rows = []
    for at in range(0, len(data), 16):
        row = bytes((len(data[at : at + 16]), at >> 8, at & 0xFF, 0)) + data[at : at + 16]
        rows.append(":" + (row + bytes((-sum(row) & 0xFF,))).hex().upper())
    return "\r\n".join([*rows, ":00000001FF", ""]).encode()


def hexdump(data: bytes, *, colon: str = "", words: int = 1, swap: bool = False) -> bytes:
    """What hexdump and xxd print, with `*` for rows that repeat where there is no colon."""
    rows = []
    last = None
    for at in range(0, len(data), 16):
        row = data[at : at + 16]
        if row == last and not colon and at + 16 < len(data):
            if rows[-1] != "*":
                rows.append("*")
            continue
        last = row
        pieces = [row[n : n + words] for n in range(0, len(row), words)]
        text = " ".join((p[::-1] if swap else p).hex() for p in pieces)
        shown = "".join(chr(b) if 32 <= b < 127 else "." for b in row)
        end = f"  {shown}" if colon else f"  |{shown}|"
        rows.append(f"{at:08x}{colon} {text}" + ("" if swap else end))
    return "\n".join([*rows, "" if colon else f"{len(data):08x}\n"]).encode()


@pytest.mark.parametrize(
    "text",
    [
        intel_hex(IMAGE),
        hexdump(IMAGE + bytes(300)),
        hexdump(IMAGE, colon=":", words=2),
        hexdump(IMAGE, colon=":"),
        hexdump(IMAGE, words=2, swap=True),
        IMAGE.hex(" ").encode(),
        ", ".join(f"0x{b:02x}" for b in IMAGE).encode(),
    ],
)
def test_an_image_as_text_is_the_same_image(text):
    found, out = kind(text, "eeprom.txt")
    assert found.kind == "sii"
    out = Collector()
    read = read_foreign(text, found, out, name="eeprom.txt")
    plain = read_foreign(IMAGE, all_formats()["sii"], Collector(), name="eeprom.txt")
    assert out.diagnostics == []
    assert read == plain


def test_a_checksum_of_one_digit_is_read():
    assert binary_of(b":01000000FB4\n:00000001FF\n") == b"\xfb"
    with pytest.raises(InputError, match="line 1: the checksum"):
        binary_of(b":01000000FB5\n:00000001FF\n")


def record(kind: int, body: bytes, at: int = 0) -> bytes:
    row = bytes([len(body), at >> 8, at & 0xFF, kind]) + body
    return b":" + (row + bytes([-sum(row) & 0xFF])).hex().upper().encode() + b"\n"


END = record(1, b"")


def test_records_of_intel_hex_that_are_not_data():
    rows = [record(5, bytes(4)), b"\n", record(2, bytes(2)), record(0, b"\1\2\3\4")]
    assert binary_of(b"".join([*rows, record(4, bytes(2)), record(0, b"\5", 4), END])) == (
        b"\1\2\3\4\5"
    )


def test_a_base_of_intel_hex_moves_what_follows():
    with pytest.raises(InputError, match=r"line 2.*0x10000"):
        binary_of(record(2, b"\x10\0") + record(0, b"\1") + END)


def test_lines_of_a_dump_that_are_not_rows():
    rows = [b"00000000  01 02 03 04 05 06 07 08  09 0a 0b 0c 0d 0e 0f 10  |abc|", b"", b"*"]
    rows += [b"00000020  11 zz 13", b"00000021"]
    assert binary_of(b"\n".join(rows)) == bytes(range(1, 17)) * 2 + b"\x11"


def test_plain_hexadecimal_words_are_read():
    assert binary_of(b"0x01, 02\n03 " + b"04 " * 16) == b"\1\2\3" + b"\4" * 16
    with pytest.raises(InputError, match="a word of the text is not a byte in hexadecimal"):
        binary_of(b"01 " * 16 + b"0g")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b":0200000001FD\n" + END, "line 1 is not a whole record"),
        (record(0, b"\1\2") + b":zz\n" + END, "line 2 is not a whole record"),
        (intel_hex(IMAGE)[:-15], "cut off"),
        (intel_hex(IMAGE).replace(b":10001000", b":10001001"), "line 2: the checksum"),
        (
            b"\r\n".join(intel_hex(IMAGE).splitlines()[:2] + intel_hex(IMAGE).splitlines()[3:]),
            "0x20",
        ),
        (intel_hex(IMAGE)[:70], "line 2 is not a whole record"),
        (hexdump(IMAGE).replace(b"00000020 ", b"00000030 "), "line 3: it begins at 0x30"),
        (hexdump(IMAGE).replace(b"00000020 ", b"fffffff0 "), "beyond any such image"),
        (hexdump(IMAGE).replace(b"00000020 ", b"oops "), "line 3 is not a line of a dump"),
        (b"00000000 00 01 02 03\n*\nffffffff\n", "beyond any such image"),
    ],
)
def test_a_damaged_dump_is_refused_with_its_line(text, words):
    out = Collector()
    assert read_foreign(text, all_formats()["sii"], out, name="e.hex") is None
    assert [d.code for d in out.diagnostics] == ["FSN138"]
    assert words in out.diagnostics[0].message


def declared(encoding: str) -> str:
    return f'<?xml version="1.0" encoding="{encoding}"?>\r\n{ENI}'


@pytest.mark.parametrize(
    "data",
    [
        declared("UTF-8").encode(),
        b"\xef\xbb\xbf" + declared("UTF-8").encode(),
        declared("ISO-8859-1").encode("latin-1"),
        declared("windows-1252").encode("cp1252"),
        declared("UTF-16").encode("utf-16"),
        declared("utf-8").encode("utf-16"),
        ENI.encode("utf-16"),
        b"\xfe\xff" + declared("utf-8").encode("utf-16-be"),
        declared("UTF-16LE").encode("utf-16-le"),
        declared("UTF-16BE").encode("utf-16-be"),
        declared("gb18030").encode("gb18030"),
        declared("Shift_JIS").encode("shift_jis"),
        b"\n\n  " + declared("utf-8").encode(),
    ],
)
def test_an_eni_is_read_in_every_encoding(data):
    found, out = kind(data)
    assert found.kind == "eni"
    read = read_foreign(data, found, out, name="x.xml")
    assert out.diagnostics == []
    assert read is not None
    assert read.subdevices[0].name == "Box \u00b0"


@pytest.mark.parametrize("head", ["", '<?xml version="1.0"?>\n', declared("utf-8")[:40] + "\n"])
def test_latin_1_that_claims_to_be_utf_8_is_read_with_a_warning(head):
    found, out = kind((head + "<!-- \u00e4 -->" + ENI).encode("latin-1"))
    assert found.kind == "eni"
    data = (head + ENI).encode("latin-1")
    read = read_foreign(data, found, out, name="x.xml")
    assert [(d.code, d.level.name) for d in out.diagnostics] == [("FSN118", "WARNING")]
    line = data[: data.index(b"\xb0")].count(b"\n") + 1
    assert out.diagnostics[0].span.line == line
    assert read is not None
    assert read.subdevices[0].name == "Box \u00b0"
