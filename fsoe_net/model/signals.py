"""Names of safe data: the place of each PDO entry in the safe data of a frame."""

from __future__ import annotations

import re

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import Entry
from fsoe_net.model.layout import SmLayout
from fsoe_net.model.resolve import Connection
from fsoe_net.model.transfer_ends import ResolvedEnd


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """Some bits of the safe data of one frame.

    ``name`` is ``subdevice.0x6001:01``. ``label`` is the common name, such as ``STO``; empty when
    unknown.
    """

    name: str
    index: int
    subindex: int
    bit: int
    bits: int
    label: str = ""

    @property
    def address(self) -> str:
        """``0x6001:01``, as in `Entry.address`."""
        return f"0x{self.index:04x}:{self.subindex:02x}"

    def read(self, data: bytes | bytearray) -> int:
        """Return the value from these safe data."""
        whole = int.from_bytes(data, "little")
        return whole >> self.bit & ((1 << self.bits) - 1)

    def write(self, data: bytearray, value: int) -> None:
        """Write a value into these safe data; bits that do not fit are truncated."""
        write_bits(data, self.bit, self.bits, value)


def write_bits(data: bytearray, bit: int, bits: int, value: int) -> None:
    """Write a value at a bit offset, low bit first; bits that do not fit are truncated."""
    if not (bit | bits) % 8:  # most are whole bytes
        first, count = bit // 8, bits // 8
        data[first : first + count] = (value & ((1 << bits) - 1)).to_bytes(count, "little")
        return
    mask = ((1 << bits) - 1) << bit
    whole = int.from_bytes(data, "little") & ~mask | value << bit & mask
    data[:] = whole.to_bytes(len(data), "little")


def signals_of(
    subdevice: str, sm: SmLayout, byte_offset: int, frame_bytes: int
) -> dict[str, Signal]:
    """Return the safe data entries of a frame by name, without padding and repeated objects.

    Safe data are interleaved with a CRC after every second byte (after the first if only one):

        frame byte   0     1    2    3..4    5    6    7..8
                   +-----+----+----+-------+----+----+-------+
                   | cmd | d0 | d1 | CRC 0 | d2 | d3 | CRC 1 | ...
                   +-----+----+----+-------+----+----+-------+
    """
    found: dict[str, Signal] = {}
    for placed in sm.placed:
        entry = placed.entry
        if entry.is_gap or not entry.bits:
            continue
        start = _safe_bit(placed.bit_offset - 8 * byte_offset, frame_bytes)
        end = _safe_bit(placed.end_bit - 1 - 8 * byte_offset, frame_bytes)
        # An entry across a CRC is not contiguous and cannot be named.
        if start is None or end is None or end - start != entry.bits - 1:
            continue
        name = f"{subdevice}.{entry.address}"
        # A repeated object: the driver reads the first place.
        found.setdefault(
            name,
            Signal(
                name=name,
                index=entry.index,
                subindex=entry.subindex,
                bit=start,
                bits=entry.bits,
                label=_label(entry),
            ),
        )
    return found


def connection_signals(connection: Connection) -> tuple[dict[str, Signal], dict[str, Signal]]:
    """Return the safe data of a connection by name: main to sub, sub to main.

    Both are named by the PDOs of the SubInstance; the slots of a safety logic have only numbers.
    """
    sub, to_sub, to_main = connection.sub.name, connection.to_sub, connection.to_main
    return (
        _signals_at(sub, to_sub.destination, to_sub.transfer.size_bytes),
        _signals_at(sub, to_main.source, to_main.transfer.size_bytes),
    )


def _signals_at(subdevice: str, end: ResolvedEnd, frame_bytes: int) -> dict[str, Signal]:
    if end.sm is None:
        return {}  # it has no place in the process data, which a rule reports
    return signals_of(subdevice, end.sm, end.byte_offset, frame_bytes)


# Safety objects of drives (ETG.6100.2) as printed in manuals of several vendors. In the frame to
# the drive, a bit of 0 requests the function; in the frame from it, a bit of 1 reports it.
_DRIVE_OBJECTS = {
    0x6630: "restart acknowledge",
    0x6632: "error acknowledge",
    0x6640: "STO",
    0x6650: "SS1",
    0x6660: "SBC",
    0x6668: "SOS",
    0x6670: "SS2",
    0x6690: "SLS",
    0x66D0: "SDI positive",
    0x66D1: "SDI negative",
}


def _label(entry: Entry) -> str:
    """Return the name from the file, or else from the drive profile."""
    given = entry.name or entry.state_interface or entry.command_interface
    return given or _DRIVE_OBJECTS.get(entry.index, "")


def _safe_bit(frame_bit: int, frame_bytes: int) -> int | None:
    """Return the safe data bit for a bit of the frame; ``None`` for command, CRC and ConnID."""
    byte, bit = divmod(frame_bit, 8)
    if not 1 <= byte < frame_bytes - 2:
        return None
    # The shortest frame has one safe byte, so its CRC is one byte earlier.
    if frame_bytes == 6:
        return bit if byte == 1 else None
    block, inside = divmod(byte - 1, 4)
    return 8 * (2 * block + inside) + bit if inside < 2 else None


def split_name(text: str) -> tuple[str, int, int] | None:
    """Parse ``ek1914.0x6001:01``; ``0x`` is optional. ``None`` if invalid."""
    match = re.fullmatch(r"(.+)\.(?:0x)?([0-9a-fA-F]{1,4}):(?:0x)?([0-9a-fA-F]{1,2})", text)
    if match is None:
        return None
    return match.group(1), int(match.group(2), 16), int(match.group(3), 16)
