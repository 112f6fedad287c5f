"""Builds SII images for tests, from descriptions of the model or from single categories."""

from __future__ import annotations

import struct

from fsoe_net.formats.sii.read import sii_checksum
from fsoe_net.model.bus import Direction, Pdo
from fsoe_net.model.description import DescribedSubDevice

_TYPES = {"UINT": 6, "BOOL": 1, "": 0}
END = b"\xff\xff"


def category(kind: int, body: bytes) -> bytes:
    body += b"\0" * (len(body) % 2)
    return struct.pack("<HH", kind, len(body) // 2) + body


def strings(*texts: bytes) -> bytes:
    return category(10, bytes([len(texts)]) + b"".join(bytes([len(t)]) + t for t in texts))


def image(
    *categories: bytes,
    identity: tuple[int, int, int, int] = (0xA5F, 0x10, 1, 7),
    alias: int = 0,
    protocols: int = 0,
    size: int = 0,
    end: bytes = END,
) -> bytes:
    head = struct.pack("<4HH4x", 0x0C05, 0x0104, 0, 0, alias)
    head += struct.pack("<H", sii_checksum(head)) + struct.pack("<4I", *identity)
    head = head.ljust(0x38, b"\0") + struct.pack("<H", protocols)
    data = head.ljust(0x80, b"\0") + b"".join(categories) + end
    return data.ljust(size, b"\xff")


def printed(data: bytes) -> str:
    """Return what `ethercat sii_read -v` of IgH 1.6 prints of an image, category by category."""
    kinds = {10: "STRINGS", 20: "DataTypes", 30: "General", 40: "FMMU", 41: "SyncM", 50: "TXPDO"}
    kinds |= {51: "RXPDO", 60: "DC"}
    text, at = "SII Area:" + _rows(data[:0x80]), 0x80
    while data[at : at + 2] != END:
        kind, words = struct.unpack_from("<HH", data, at)
        body = data[at + 4 : at + 4 + 2 * words]
        text += f"SII Category 0x{kind:04x} ({kinds.get(kind, 'unknown')}), {words} words"
        text += _rows(body)
        at += 4 + 2 * words
    return text


def _rows(data: bytes) -> str:
    rows = (data[n : n + 16].hex(" ") for n in range(0, len(data), 16))
    return "".join(f"\n  {row}" for row in rows) + "\n"


class _Names:
    def __init__(self) -> None:
        self.texts: list[str] = []

    def number(self, text: str) -> int:
        if not text:
            return 0
        if text not in self.texts:
            self.texts.append(text)
        return self.texts.index(text) + 1


def _pdo(pdo: Pdo, sm: int, names: _Names) -> bytes:
    data = struct.pack("<HBBBBH", pdo.index, len(pdo.entries), sm, 0, names.number(pdo.name), 0)
    for e in pdo.entries:
        kind, name = _TYPES[e.type_name], names.number(e.name)
        data += struct.pack("<HBBBBH", e.index, e.subindex, name, kind, e.bits, 0)
    return data


def image_of(made: DescribedSubDevice) -> bytes:
    names, managers, clock = _Names(), b"", made.device.assign_activate
    general = bytes([0, 0, names.number(made.order), names.number(made.name), 0, 0]) + bytes(26)
    bodies = {Direction.OUTPUT: b"", Direction.INPUT: b""}
    for sm in made.device.sync_managers:
        use = 3 if sm.direction is Direction.OUTPUT else 4
        managers += struct.pack("<HHBBBB", sm.start_byte or 0, 0, 0x24, 0, 1, use)
        for pdo in sm.pdos or ():
            bodies[sm.direction] += _pdo(pdo, sm.index, names)
    for pdo in made.available:
        bodies[Direction.INPUT] += _pdo(pdo, 0xFF, names)
    parts = [
        category(30, general),
        category(41, managers),
        category(50, bodies[Direction.INPUT]),
        category(51, bodies[Direction.OUTPUT]),
        category(60, struct.pack("<3IhHhBB4x", 0, 0, 0, 0, clock, 0, 0, 0)),
    ]
    texts = [t.encode() for t in names.texts]  # Latin-1 may look like UTF-8
    identity = (made.device.vendor_id, made.device.product_code, made.revision, made.serial)
    return image(strings(*texts), *parts, identity=identity, alias=made.alias)
