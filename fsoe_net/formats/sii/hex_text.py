"""Binary files as text: Intel HEX, and the output of ``hexdump``, ``xxd`` and ``od -A x``."""

from __future__ import annotations

import re

from fsoe_net.errors import InputError
from fsoe_net.formats.shared.limits import MAX_EEPROM_BYTES

_INTEL = rb"\A\s*:[0-9A-Fa-f]{10}"
_DUMP = rb"\A\s*0{4,8}:? +(?:[0-9a-fA-F]{2} ?){4}"
HEX_TEXT = (_INTEL, _DUMP, rb"\A\s*(?:(?:0x)?[0-9a-fA-F]{2}[ ,\t\r\n]+){16}")
"""Patterns for the beginning of such a text; one of them matches."""
_ROW = re.compile(r"([0-9a-fA-F]{4,8})(:?)(?: {1,4}(.*))?$")
_BYTES = re.compile(r"(?:[0-9a-fA-F]{2}){1,16}")


def is_hex_text(head: bytes) -> bool:
    """Return whether a file with this beginning is a binary file as text."""
    return any(re.match(p, head) for p in HEX_TEXT)


def binary_of(data: bytes) -> bytes:
    """Return the bytes that a text represents.

    Args:
        data: The text, for which `is_hex_text` is true.

    Raises:
        InputError: A line is damaged or missing; the message names it.
    """
    lines = data.decode("ascii", "replace").splitlines()
    if re.match(_INTEL, data):
        return _of_intel(lines)
    if re.match(_DUMP, data):
        return _of_dump(lines)
    words = data.decode("ascii", "replace").replace(",", " ").split()
    try:
        return bytes(int(w, 16) for w in words)
    except ValueError:
        raise InputError("a word of the text is not a byte in hexadecimal") from None


def _of_intel(lines: list[str]) -> bytes:
    image = bytearray()
    base = 0
    for number, line in enumerate((text.strip() for text in lines), 1):
        if not line:
            continue
        digits = line.removeprefix(":")
        if len(digits) % 2:  # some generators write a checksum below 0x10 as one digit
            digits = f"{digits[:-1]}0{digits[-1]}"
        try:
            row = bytes.fromhex(digits)
        except ValueError:
            row = b""
        if not line.startswith(":") or len(row) < 5 or len(row) != row[0] + 5:
            raise InputError(f"line {number} is not a whole record of Intel HEX")
        if sum(row) & 0xFF:
            raise InputError(f"line {number}: the checksum of the record is wrong")
        kind, body = row[3], row[4:-1]
        if kind == 1:
            return bytes(image)
        # Extended segment address, times 16, or extended linear address, the upper 16 bits.
        if kind in (2, 4):
            base = int.from_bytes(body, "big") << (4 if kind == 2 else 16)
        elif kind == 0:
            _put(image, base + int.from_bytes(row[1:3], "big"), body, number)
    raise InputError("the end record of Intel HEX is missing: the text is cut off")


def _of_dump(lines: list[str]) -> bytes:
    image = bytearray()
    repeated = b""
    last = b""
    for number, line in enumerate(lines, 1):
        text = line.strip()
        # hexdump and od print one star for all rows that repeat the one before.
        if text == "*":
            repeated = last
            continue
        match = _ROW.match(text)
        if match is None:
            if text:
                raise InputError(f"line {number} is not a line of a dump")
            continue
        at = int(match[1], 16)
        if repeated:
            if at > MAX_EEPROM_BYTES:
                raise InputError(f"line {number}: address 0x{at:x} is beyond any such image")
            while len(image) < at:
                image += repeated[: at - len(image)]
            repeated = b""
        last = _row(match[3] or "", swapped=not match[2])
        if last:
            _put(image, at, last, number)
    return bytes(image)


def _row(text: str, *, swapped: bool) -> bytes:
    """Return the bytes of a row; the text column after two blanks or a bar is ignored."""
    text = text.split("|")[0]
    row = bytearray()
    for number, word in enumerate(text.replace("  ", " \0 ").split(" ")):
        # `hexdump -C` also has two blanks after 8 bytes; any others begin the text column.
        if word == "\0" and len(row) != 8:
            break
        if not word or word == "\0":
            continue
        if not _BYTES.fullmatch(word) or number > 40 or len(row) >= 16:
            break
        # Words of hexdump and od are little-endian numbers; xxd, with a colon, prints bytes.
        piece = bytes.fromhex(word)
        row += piece[::-1] if swapped and len(piece) == 2 else piece
    return bytes(row)


def _put(image: bytearray, at: int, body: bytes, number: int) -> None:
    if at + len(body) > MAX_EEPROM_BYTES:
        raise InputError(f"line {number}: address 0x{at:x} is beyond any such image")
    # A lost line would shift all later data to another word address.
    if at != len(image):
        raise InputError(f"line {number}: it begins at 0x{at:x}; 0x{len(image):x} would follow")
    image += body
