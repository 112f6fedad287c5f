"""Reads output of the ``ethercat`` tool of the IgH master into descriptions.

``slaves``, ``slaves -v`` and ``sii_read -v`` are read here, other commands in separate modules.
Indentation is ignored, because it is lost when text is pasted.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Severity, Span
from fsoe_net.formats.igh import CSTRUCT
from fsoe_net.formats.igh.read_cstruct import read_cstruct
from fsoe_net.formats.igh.read_layout import HEADER, read_config, read_domains, read_pdos
from fsoe_net.formats.igh.read_xml import read_xml
from fsoe_net.formats.recognise import is_format, recognise
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import Source, source_bytes
from fsoe_net.formats.shared.terminal_text import Line, Pasted, pasted
from fsoe_net.formats.sii.read import describe_sii, read_sii
from fsoe_net.model.bus import Device
from fsoe_net.model.description import DescribedSubDevice, Description

_ROOTS = ("EtherCATInfo", "EtherCATInfoList")


def load_igh_text(source: Source, out: Collector, *, name: str = "<text>") -> Description | None:
    """Read output of the ``ethercat`` tool; the command is recognised by its content.

    Args:
        source: Path, or the bytes.
        out: Takes findings; a truncated text is FSN146, never a shorter map.
        name: Name shown when ``source`` is bytes.
    """
    data, shown = source_bytes(source, out, name)
    if data is None:
        return None
    found = recognise(data)
    text = pasted(data, shown, out)
    # `ethercat xml` prints devices without groups: this is an ESI of a vendor.
    if found is not None and found.kind == "esi" and b"<Groups" in data:
        is_format(data, "ethercat", shown, out)
        return None
    if found is not None and found.signature is CSTRUCT:
        _one_master(text)
        return read_cstruct(text)
    is_xml = found is not None and (found.kind == "esi" or found.signature.root in _ROOTS)
    if is_xml or any("<EtherCATInfo" in line.text for line in text):
        return read_xml(data, shown, out)
    _one_master(text)
    reader = _reader_of(text)
    if reader is not None:
        return reader(text)
    what = "no line of this is known" if found is None else f"this is {found.words}"
    out.add(
        "FSN140",
        Span(shown, 1, 1),
        f"{what}, not output of the `ethercat` tool",
        hint="paste the output of ethercat pdos, cstruct, xml, slaves -v, sii_read -v, config -v "
        "or domains -v",
    )
    return None


def _reader_of(text: Pasted) -> Callable[[Pasted], Description | None] | None:
    for wanted, reader in _READERS:
        if any(wanted.search(line.text) for line in text):
            return reader
    return None


_MASTER = re.compile(r"(?:=== |/\* )Master (\d{1,3}), Slave |Master ?(\d{1,3})$")


def _one_master(text: Pasted) -> None:
    """Keep the lines of the first master: two masters are two buses."""
    first: str | None = None
    current: str | None = None
    kept: list[Line] = []
    others: Line | None = None
    for line in text:
        match = _MASTER.match(line.stripped)
        if match:
            current = match[1] or match[2]
            first = current if first is None else first
        if current == first:
            kept.append(line)
        elif others is None:
            others = line
    if others is None:
        return
    text.out.add(
        "FSN147",
        others.span,
        f"another master begins here; only master {first} is read",
        severity=Severity.INFO,
        hint="give each master's output on its own: ethercat -m N",
    )
    text.lines = tuple(kept)


# -- slaves ---------------------------------------------------------------------------------------

_SLAVE = re.compile(
    r"^\s*(\d{1,5})\s+(\d{1,5}):(\d{1,5})\s+"
    r"((?:INIT|PREOP|BOOT|SAFEOP|OP|\?\?\?)(?:\+ERROR)?)\s+([+E])\s+(.+)$"
)
_RAW_NAME = re.compile(r"0x([0-9a-f]{8}):0x([0-9a-f]{8})$")
_VALUE = re.compile(r"^\s*([A-Z][A-Za-z ]{1,40}):\s*(.*)$")
_HEX_KEYS = {
    "Vendor Id": "vendor",
    "Product code": "product",
    "Revision number": "revision",
    "Serial number": "serial",
}
_LINE_OF_TEXT = re.compile(
    r"^\s*(\d\*?\s+(MII|EBUS|N/A|\S+)\s+(up|down)|Port\s+Type|Bootstrap|Standard|"
    r"Supported protocols|Enable |Image name|Group|CoE details|Flags|Current consumption|"
    r"FMMU|Distributed|DC system|\d+\*? )"
)


_VERBOSE_STARTS = ("=== Master", *_HEX_KEYS, "Alias", "State", "Device", "Order number")


# A line of the list begins with the position; a truncated one has only that.
_PART_OF_LIST = re.compile(r"\d{1,5}(\s+\d{0,5}:?|$)")


def _read_slaves(text: Pasted) -> Description:
    rows: list[DescribedSubDevice] = []

    def take(line: Line) -> bool | None:
        match = _SLAVE.match(line.text)
        if match is None:
            is_title = re.match(r"\s*(Master\d+|xxx LINK FAILURE xxx)", line.text)
            return None if is_title else False
        raw = _RAW_NAME.search(match[6])
        identity = (int(raw[1], 16), int(raw[2], 16)) if raw else (0, 0)
        rows.append(
            DescribedSubDevice(
                span=line.span,
                name=match[6].strip(),
                order="" if raw else match[6].split(" ")[0].rstrip(","),
                position=int(match[1]),
                alias=0 if match[2] == "65535" else int(match[2]),
                device=Device(path=text.shown, vendor_id=identity[0], product_code=identity[1]),
                notes=() if raw else ("this text has no identity; paste `slaves -v`",),
            )
        )
        return True

    text.read(take, "`ethercat slaves`", (), part=_PART_OF_LIST)
    return text.described("ethercat-slaves", rows)


def _read_slaves_verbose(text: Pasted) -> Description:
    sections: list[tuple[Line, int | None, dict[str, str]]] = []

    def take(line: Line) -> bool:
        if match := HEADER.search(line.stripped):
            sections.append((line, int(match[2]), {}))
        elif match := _VALUE.match(line.text):
            if not sections:
                sections.append((line, None, {}))
            sections[-1][2].setdefault(match[1].strip(), match[2].strip())
        else:
            return bool(sections) and _LINE_OF_TEXT.match(line.text) is not None
        return True

    text.read(take, "`ethercat slaves -v`", _VERBOSE_STARTS)
    rows = []
    for number, (line, position, values) in enumerate(sections):
        final = number == len(sections) - 1
        missing = [key for key in _HEX_KEYS if not re.match(r"0x[0-9a-f]{8}$", values.get(key, ""))]
        if missing and final:
            text.cut(text.lines[-1], f"{missing[0]} of the last SubDevice is missing")
        elif missing:
            text.out.add(
                "FSN147",
                line.span,
                f"this SubDevice has no {missing[0]}",
                hint="paste the output of `ethercat slaves -v` again, unchanged",
            )
        rows.append(_identity(text, line, position, values, truncated=final and text.truncated))
    return text.described("ethercat-slaves", rows)


def _identity(
    text: Pasted, line: Line, position: int | None, values: dict[str, str], *, truncated: bool
) -> DescribedSubDevice:
    numbers = {
        name: int(values[key], 16) if re.match(r"0x[0-9a-f]{8}$", values.get(key, "")) else None
        for key, name in _HEX_KEYS.items()
    }
    alias = values.get("Alias", "")
    notes = []
    if values.get("Enable notLRW") == "yes":
        notes.append("it cannot take part in an LRW")
    if values.get("Enable PDO Assign") == "no" and values.get("Enable PDO Configuration") == "no":
        notes.append("its PDO mapping is fixed")
    device = Device(
        path=text.shown, vendor_id=numbers["vendor"] or 0, product_code=numbers["product"] or 0
    )
    return DescribedSubDevice(
        span=line.span,
        name=values.get("Device name", ""),
        order=values.get("Order number", ""),
        position=position,
        alias=int(alias) if alias.isdigit() and len(alias) < 6 and alias != "65535" else 0,
        device=device,
        revision=numbers["revision"],
        serial=numbers["serial"],
        truncated=truncated,
        notes=tuple(notes),
    )


# -- sii_read -------------------------------------------------------------------------------------
#
# The first 0x40 words, then each category with the bytes of its body; the mark at the end is not
# printed:
#
#     SII Area:
#       0c 05 04 01 00 00 00 00 ...
#     SII Category 0x000a (STRINGS), 26 words
#       04 06 ...

_AREA = re.compile(r"SII Area:$")
_CATEGORY = re.compile(r"SII Category 0x([0-9a-f]{4}) \([^)]{0,40}\), (\d{1,5}) words?$")
_BYTES = re.compile(r"[0-9a-f]{2}(?: [0-9a-f]{2}){0,15}$")
_STARTS = ("SII Area:", "SII Category 0x")
# A truncated line of bytes.
_PART_OF_BYTES = re.compile(r"[0-9a-f]{1,2}(?: [0-9a-f]{1,2})*$")
_HEADER_BYTES = 0x80
_MOST_WORDS = 0xFFFF
_END = b"\xff\xff"


@dataclass(slots=True)
class _Part:
    """The header of an image, or a category; ``kind`` is empty in a header."""

    kind: bytes
    size_bytes: int
    shown: str
    body: bytearray = field(default_factory=bytearray)

    @property
    def is_whole(self) -> bool:
        """Whether it has as many bytes as its header states."""
        return len(self.body) == self.size_bytes


@dataclass(slots=True)
class _Area:
    """The EEPROM of one SubDevice while its lines are read."""

    span: Span
    parts: list[_Part]

    def why_cut(self) -> str:
        """Return the missing part if the text ends here, otherwise an empty text."""
        part = self.parts[-1]
        if part.is_whole:
            return ""
        return f"{part.shown} has {len(part.body)} of {part.size_bytes} bytes"

    def image(self) -> bytes:
        """Return the image, as far as its parts are complete."""
        return b"".join(p.kind + p.body for p in self.parts if p.is_whole) + _END


def _read_sii(text: Pasted) -> Description:
    """Read the output of ``ethercat sii_read -v`` of one SubDevice, or of several in a row."""
    areas: list[_Area] = []
    text.read(
        lambda line: _take(areas, line, text),
        "`ethercat sii_read -v`",
        _STARTS,
        part=_PART_OF_BYTES,
    )
    if areas and areas[-1].why_cut():
        text.cut(text.lines[-1], areas[-1].why_cut())
    rows = []
    for area in areas:
        header = area.parts[0]
        image = read_sii(area.image(), area.span, text.out) if header.is_whole else None
        if image is not None:
            image.broken = image.broken or not all(p.is_whole for p in area.parts)
            image.broken = image.broken or (text.truncated and area is areas[-1])
            rows.append(describe_sii(image, text.shown, area.span, text.out))
    return text.described("ethercat-sii", rows)


def _take(areas: list[_Area], line: Line, text: Pasted) -> bool:
    """Process a line; ``False`` if it does not belong to this output."""
    shown = line.stripped
    if _AREA.match(shown):
        _end(areas, line, text)
        areas.append(_Area(line.span, [_Part(b"", _HEADER_BYTES, "the SII area")]))
    elif areas and (match := _CATEGORY.match(shown)) and int(match[2]) <= _MOST_WORDS:
        _end(areas, line, text)
        number, words = int(match[1], 16), int(match[2])
        kind = struct.pack("<HH", number, words)
        areas[-1].parts.append(_Part(kind, 2 * words, f"category 0x{number:04x}"))
    elif areas and _BYTES.match(shown):
        areas[-1].parts[-1].body += bytes.fromhex(shown)
    else:
        return False
    return True


def _end(areas: list[_Area], line: Line, text: Pasted) -> None:
    """Report a part whose number of bytes differs from its header, if another part follows."""
    why = areas[-1].why_cut() if areas else ""
    if why:
        text.out.add(
            "FSN147",
            line.span,
            f"{why} before this line",
            hint="paste the output of `ethercat sii_read -v` again, unchanged",
        )


_READERS = (
    (re.compile(r"Domain\d+: LogBaseAddr"), read_domains),
    (re.compile(r"\bSII Area:$"), _read_sii),
    (re.compile(r"^\s*Watchdog divider:|SM\d+, Dir: "), read_config),
    (re.compile(r"SM\d+: PhysAddr"), read_pdos),
    (re.compile(r"^\s*(Vendor Id|Identity):"), _read_slaves_verbose),
    (_SLAVE, _read_slaves),
)
