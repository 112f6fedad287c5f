"""Bodies of SII categories: strings, general, PDOs. Inconsistencies are reported.

A PDO is a header of 8 bytes and entries of 8 bytes each; strings are named by number:

    +-------+---------+----+------+------+-------+     +-------+-----+------+------+------+-------+
    | index | entries | SM | sync | name | flags |  +  | index | sub | name | type | bits | flags |
    +-------+---------+----+------+------+-------+     +-------+-----+------+------+------+-------+
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from fsoe_net.diag.diagnostic import Span
from fsoe_net.diag.words import counted
from fsoe_net.model.bus import Direction, Entry, Pdo
from fsoe_net.model.description import OfferedPdo

_PDO = struct.Struct("<HBBBBH")
_ENTRY = struct.Struct("<HBBBBH")
_VIRTUAL = 0x0020
_UNASSIGNED = 0xFF  # in place of a sync manager
_TYPES = {
    1: "BOOL",
    2: "SINT",
    3: "INT",
    4: "DINT",
    5: "USINT",
    6: "UINT",
    7: "UDINT",
    8: "REAL",
    0x11: "LREAL",
    0x15: "LINT",
    0x1B: "ULINT",
    **{0x30 + n: f"BIT{n + 1}" for n in range(8)},
}


def sii_strings(body: bytes) -> tuple[list[str], str]:
    """Return the strings, and the error in the table, if any.

    Names are Latin-1 by the specification and UTF-8 in some devices; others pad them with NULs.
    """
    if not body:
        return [], ""
    found: list[str] = []
    at = 1
    for _ in range(body[0]):
        if at >= len(body):
            return found, f"it promises {body[0]} strings and has {len(found)}"
        length = body[at]
        raw = body[at + 1 : at + 1 + length]
        if len(raw) < length:
            return found, f"string {len(found) + 1} is cut off"
        found.append(_text(raw))
        at += 1 + length
    return found, ""


def _text(raw: bytes) -> str:
    raw = raw.split(b"\0", 1)[0]
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    return "".join(c for c in text if c.isprintable()).strip()


def sii_general(body: bytes) -> tuple[int, int] | None:
    """Return the string numbers of name and order number; ``None`` if the body is too short."""
    return (body[3], body[2]) if len(body) >= 6 else None


def sii_pdos(
    body: bytes, direction: Direction, text: Callable[[int], str], span: Span
) -> tuple[list[OfferedPdo], str]:
    """Return the complete PDOs, and the error after them if any.

    Args:
        body: The category.
        direction: That of its PDOs.
        text: Returns a string by its number.
        span: The image.
    """
    found: list[OfferedPdo] = []
    at = 0
    while at < len(body):
        if len(body) - at < _PDO.size:
            rest = body[at:]
            return found, f"{len(rest)} bytes are left over" if any(rest) else ""
        index, count, sm, _, name, flags = _PDO.unpack_from(body, at)
        # Some vendors pad the category with zeros.
        if index == 0 and count == 0:
            return found, "zeros follow the last PDO" if any(body[at:]) else ""
        at += _PDO.size
        end = at + count * _ENTRY.size
        if end > len(body):
            return found, f"PDO 0x{index:04x} with {counted(count, 'entry')} is cut off"
        entries = (
            Entry(
                index=number,
                subindex=subindex,
                bits=bits,
                type_name=_TYPES.get(kind, "") if number else "",
                name=text(title),
                span=span,
            )
            for number, subindex, title, kind, bits, _ in _ENTRY.iter_unpack(body[at:end])
            if bits
        )
        found.append(
            OfferedPdo(
                pdo=Pdo(index=index, entries=tuple(entries), name=text(name), span=span),
                index=index,
                direction=direction,
                sm=None if sm == _UNASSIGNED else sm,
                virtual=bool(flags & _VIRTUAL),
            )
        )
        at = end
    return found, ""
