"""Bodies of SII categories: strings, general, PDOs. Inconsistencies are reported.

A PDO is a header of 8 bytes and entries of 8 bytes each; strings are named by number:

    +-------+---------+----+------+------+-------+     +-------+-----+------+------+------+-------+
    | index | entries | SM | sync | name | flags |  +  | index | sub | name | type | bits | flags |
    +-------+---------+----+------+------+-------+     +-------+-----+------+------+------+-------+
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Span
from fsoe_net.diag.words import counted
from fsoe_net.model.bus import Direction, Entry, Pdo

_PDO = struct.Struct("<HBBBBH")
_ENTRY = struct.Struct("<HBBBBH")
_VIRTUAL = 0x0020
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


@dataclass(frozen=True, slots=True, kw_only=True)
class SiiEntry:
    """An entry of a PDO; ``name`` is the number of a string."""

    index: int
    subindex: int
    name: int
    kind: int
    bits: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SiiPdo:
    """A PDO; ``sm`` 0xFF means that it is not assigned."""

    index: int
    direction: Direction
    sm: int
    name: int
    virtual: bool
    entries: tuple[SiiEntry, ...]

    def model(self, text: Callable[[int], str], span: Span) -> Pdo:
        """Return the PDO of the model.

        Args:
            text: Returns a string by its number.
            span: The image.
        """
        entries = (
            Entry(
                index=e.index,
                subindex=e.subindex,
                bits=e.bits,
                type_name=_TYPES.get(e.kind, "") if e.index else "",
                name=text(e.name),
                span=span,
            )
            for e in self.entries
            if e.bits
        )
        return Pdo(index=self.index, entries=tuple(entries), name=text(self.name), span=span)


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


def sii_pdos(body: bytes, direction: Direction) -> tuple[list[SiiPdo], str]:
    """Return the complete PDOs, and the error after them if any."""
    found: list[SiiPdo] = []
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
        if len(body) - at < count * _ENTRY.size:
            return found, f"PDO 0x{index:04x} with {counted(count, 'entry')} is cut off"
        entries = (_ENTRY.unpack_from(body, at + n * _ENTRY.size) for n in range(count))
        found.append(
            SiiPdo(
                index=index,
                direction=direction,
                sm=sm,
                name=name,
                virtual=bool(flags & _VIRTUAL),
                entries=tuple(
                    SiiEntry(index=i, subindex=sub, name=text, kind=kind, bits=bits)
                    for i, sub, text, kind, bits, _ in entries
                ),
            )
        )
        at += count * _ENTRY.size
    return found, ""
