"""Logical addresses and image bits for a new ENI."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.errors import InputError
from fsoe_net.model.bus import Direction
from fsoe_net.model.description import DescribedSubDevice, Description
from fsoe_net.model.layout import SmLayout

LOGICAL_BASE = 0x10000000
_MAX_DATAGRAM = 1486
_FIRST_WITH_HEADER = 16  # 14 bytes of Ethernet and 2 of EtherCAT before the first datagram
_COUNTER_BYTES = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Process data of one sync manager: a window, an FMMU, and the position in its image."""

    subdevice: int
    layout: SmLayout
    logical: int
    first_bit: int

    @property
    def direction(self) -> Direction:
        """Its image."""
        return self.layout.sm.direction


@dataclass(slots=True, kw_only=True)
class WrittenCommand:
    """One LRW."""

    address: int
    offset: int
    length: int = 0
    pieces: list[Piece] = field(default_factory=list)

    @property
    def counter(self) -> int:
        """Expected working counter: 1 for each SubDevice read, 2 for each one written."""
        users = {(p.subdevice, p.direction) for p in self.pieces}
        return sum(1 if direction is Direction.INPUT else 2 for _, direction in users)


@dataclass(frozen=True, slots=True, kw_only=True)
class EniLayout:
    """All commands, the place of each sync manager by SubDevice and number, the image sizes."""

    commands: tuple[WrittenCommand, ...]
    places: Mapping[tuple[int, int], tuple[Piece, WrittenCommand]]
    size_bytes: int


def _outputs_first(sub: DescribedSubDevice) -> list[SmLayout]:
    """Return the sync managers with data, outputs first; together they fit into a datagram."""
    # A sync manager of unknown length must not pass as an empty one; it is rejected below.
    group = [m for m in sub.device.layout.managers if m.bits or not m.complete]
    if not all(m.complete for m in group):
        raise InputError(f"{sub.name}: a PDO without entries has no known length")
    size = sum(m.size_bytes for m in group)
    if size > _MAX_DATAGRAM:
        raise InputError(f"{sub.name}: {size} bytes do not fit into one datagram")
    return sorted(group, key=lambda m: (m.sm.direction is Direction.INPUT, m.sm.index))


def lay_out(description: Description, header_bytes: int) -> EniLayout:
    """Assign a place to every sync manager, outputs before inputs in each SubDevice.

    Raises:
        InputError: A SubDevice has a PDO of unknown length, or more data than a datagram holds.
    """
    commands: list[WrittenCommand] = []
    offset = _FIRST_WITH_HEADER if header_bytes else 0
    logical = LOGICAL_BASE
    for number, sub in enumerate(description.subdevices):
        group = _outputs_first(sub)
        size = sum(m.size_bytes for m in group)
        # A SubDevice is never split over two commands: each counts its reads and writes once.
        if not commands or commands[-1].length + size > _MAX_DATAGRAM:
            if commands:
                offset += commands[-1].length + header_bytes
                # With headers the image is the frame as sent, working counters included.
                offset += _COUNTER_BYTES if header_bytes else 0
            commands.append(WrittenCommand(address=logical, offset=offset))
        command = commands[-1]
        for manager in group:
            piece = Piece(
                subdevice=number,
                layout=manager,
                logical=logical,
                first_bit=8 * (command.offset + header_bytes + logical - command.address),
            )
            command.pieces.append(piece)
            command.length += manager.size_bytes
            logical += manager.size_bytes
    commands = [c for c in commands if c.length]
    end = 0
    if commands:
        last = commands[-1]
        end = last.offset + header_bytes + last.length
    places = {(p.subdevice, p.layout.sm.index): (p, c) for c in commands for p in c.pieces}
    return EniLayout(commands=tuple(commands), places=places, size_bytes=end)
