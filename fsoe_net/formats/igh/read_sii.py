"""``ethercat sii_read -v``: the EEPROM of a SubDevice in hexadecimal, category by category.

The first 0x40 words, then each category with the bytes of its body; the mark at the end is not
printed:

    SII Area:
      0c 05 04 01 00 00 00 00 ...
    SII Category 0x000a (STRINGS), 26 words
      04 06 ...
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field

from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.shared.terminal_text import Line, Pasted
from fsoe_net.formats.sii.read import describe_sii, read_sii
from fsoe_net.model.description import Description

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
        """Whether it has as many bytes as it announces."""
        return len(self.body) == self.size_bytes


@dataclass(slots=True)
class _Area:
    """The EEPROM of one SubDevice while its lines come."""

    span: Span
    parts: list[_Part]

    def why_cut(self) -> str:
        """Return the missing part of a text that ends here, or an empty text."""
        part = self.parts[-1]
        if part.is_whole:
            return ""
        return f"{part.shown} has {len(part.body)} of {part.size_bytes} bytes"

    def image(self) -> bytes:
        """Return the image as far as its parts are whole."""
        return b"".join(p.kind + p.body for p in self.parts if p.is_whole) + _END


def read_sii_text(text: Pasted) -> Description:
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
    """Take a line; ``False``: it is not one of this output."""
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
    """Name a part that has more or fewer bytes than it announces, where another one follows."""
    why = areas[-1].why_cut() if areas else ""
    if why:
        text.out.add(
            "FSN147",
            line.span,
            f"{why} before this line",
            hint="paste the output of `ethercat sii_read -v` again, unchanged",
        )
