"""Plan bytes for tests of the C core, written from docs/reference/plan-format.md alone.

It imports nothing of the package, so that a mistake in the package's writer cannot hide one in the
loader. ``python plan_builder.py FILE`` writes the e-stop pair, for `scripts/rig/consumer`.
"""

from __future__ import annotations

import struct
import sys
import zlib
from dataclasses import dataclass, field
from pathlib import Path

OUTPUT, INPUT = 1, 2
NONE = 0xFFFFFFFF


def safe_bytes(frame: int) -> int:
    return 1 if frame == 6 else (frame - 3) // 2


@dataclass(frozen=True)
class Transfer:
    """Bytes from the inputs of one SubDevice to the outputs of another."""

    source: int
    source_byte: int
    target: int
    target_byte: int
    size: int


@dataclass
class Builder:
    """SubDevices with SM2 (outputs) and SM3 (inputs); one entry of 8 bits for each byte."""

    sizes: list[tuple[int, int]]
    pairs: list[tuple[Transfer, Transfer]] = field(default_factory=list)
    """To sub and to main of each connection."""
    standard: list[Transfer] = field(default_factory=list)
    symbols: list[tuple[str, int, int, int]] = field(default_factory=list)
    """Name, sync manager, bit offset, bits."""
    blocks: list[tuple[int, int, int]] = field(default_factory=list)
    """Sync manager, byte offset, frame length."""
    cycle_ns: int = 1_000_000
    names: list[str] | None = None

    def sorted_copies(self) -> list[tuple[Transfer, int]]:
        """Copies by destination, with their connection."""
        rows = [(t, n) for n, pair in enumerate(self.pairs) for t in pair]
        rows += [(t, NONE) for t in self.standard]
        return sorted(rows, key=lambda row: (row[0].target, row[0].target_byte))

    def build(self) -> bytes:
        strings = bytearray(b"\0")

        def text(value: str) -> int:
            at = len(strings)
            strings.extend(value.encode() + b"\0")
            return at

        names = self.names or [f"sub{n}" for n in range(len(self.sizes))]
        sms = [
            (n, 2 + k, (OUTPUT, INPUT)[k], s)
            for n, p in enumerate(self.sizes)
            for k, s in enumerate(p)
        ]
        copies = self.sorted_copies()
        net = text("net")
        subdevices = [
            struct.pack("<IHHIIIIIIIIHHI", text(name), 0, n, 2, n, 0, NONE, 2 * n, 2, 0, 0, 0, 1, 0)
            for n, name in enumerate(names)
        ]
        managers, pdos, entries = [], [], []
        for number, (sub, index, direction, size) in enumerate(sms):
            managers.append(
                struct.pack(
                    "<IBBBBIIII", sub, index, direction, 0, size > 0, 8 * size, number, 1, 0
                )
            )
            pdos.append(struct.pack("<HHIII", 0x1600, 0, len(entries), size, 0))
            entries += [
                struct.pack("<HBBHBBI", 0x6000, 1, 1, 8, 3, 0, 8 * byte) for byte in range(size)
            ]
        sections = [
            subdevices,
            managers,
            pdos,
            entries,
            [],
            [
                struct.pack("<IIIHBBIQdd", text(name), sm, bit, bits, 3, sm % 2 == 0, 0, 0, 1, 0)
                for name, sm, bit, bits in self.symbols
            ],
            [
                struct.pack("<IIHHI", sm, byte, size, safe_bytes(size), 1)
                for sm, byte, size in self.blocks
            ],
            [
                struct.pack(
                    "<IIIIIIHHI",
                    2 * t.source + 1,
                    8 * t.source_byte,
                    2 * t.target,
                    8 * t.target_byte,
                    8 * t.size,
                    net,
                    2 if connection == NONE else 1,
                    0,
                    connection,
                )
                for t, connection in copies
            ],
            [
                struct.pack(
                    "<IIIIIIHHHHHHI",
                    text(f"{names[down.source]}-{names[down.target]}-{n}"),
                    net,
                    down.source,
                    down.target,
                    copies.index((down, n)),
                    copies.index((up, n)),
                    n + 1,
                    0,
                    0,
                    1,
                    safe_bytes(down.size),
                    safe_bytes(up.size),
                    0,
                )
                for n, (down, up) in enumerate(self.pairs)
            ],
        ]
        return assemble(sections, bytes(strings), self.cycle_ns)


def assemble(sections: list[list[bytes]], strings: bytes, cycle_ns: int) -> bytes:
    """Put header and section table before the records."""
    records = [48, 24, 16, 12, 16, 44, 16, 32, 40, 1]
    table, body = b"", b""
    for kind, (rows, size) in enumerate(zip([*sections, [strings]], records, strict=True), start=1):
        data = b"".join(rows)
        table += struct.pack("<IIII", kind, 192 + len(body), len(data) // size, size)
        body += data
        if kind < 10:
            body += bytes(-len(body) % 4)
    length = 192 + len(body)
    raw = struct.pack("<8sHHIIIII", b"FSNPLAN", 1, 0, length, 0, cycle_ns, 10, 0) + table + body
    return fix_crc(raw)


def fix_crc(raw: bytes) -> bytes:
    """Write the CRC anew."""
    blank = raw[:16] + bytes(4) + raw[20:]
    return raw[:16] + struct.pack("<I", zlib.crc32(blank)) + raw[20:]


def section(raw: bytes, kind: int) -> int:
    """Offset of the first record of a section."""
    return int(struct.unpack_from("<I", raw, 32 + 16 * (kind - 1) + 4)[0])


def estop() -> Builder:
    """Main (0) with 9 + 8 bytes and sub (1) with 8 + 8 bytes, one connection of 6-byte frames."""
    return Builder(
        sizes=[(9, 8), (8, 8)],
        pairs=[(Transfer(0, 0, 1, 0, 6), Transfer(1, 0, 0, 0, 6))],
        symbols=[("main.out", 0, 48, 16), ("main.in", 1, 48, 16), ("sub.out", 2, 52, 8)],
        blocks=[(0, 0, 6), (1, 0, 6), (2, 0, 6), (3, 0, 6)],
        names=["main", "sub"],
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_bytes(estop().build())
