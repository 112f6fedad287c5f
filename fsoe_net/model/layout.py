"""PDO layout of each sync manager to the bit, and the FSoE frames recognised in it.

The rule (observed in the IgH master): the PDOs of a sync manager follow each other in assignment
order, the entries of a PDO in listed order, nothing is aligned, padding counts. A driver uses the
first entry with an index:subindex, lowest sync manager first; an end of a copy refers to the first
one in its own direction.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from itertools import zip_longest
from typing import NamedTuple

from fsoe_net.dataclass import dataclass
from fsoe_net.fsoe.pdu import safe_byte_offset, safe_data_length
from fsoe_net.model.bus import Device, Direction, Entry, Pdo, SyncManager

_CRC_BITS = 16
_COMMAND_BITS = 8
_LONGEST_FRAME = 255  # bytes
_NEIGHBOUR = 0x0F  # a CRC was observed at most eight objects away from its command


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """An entry with its bit offset inside the process data of its sync manager.

    ``pdo_number`` counts the PDOs of the sync manager.
    """

    entry: Entry
    pdo: Pdo
    pdo_number: int
    bit_offset: int

    @property
    def end_bit(self) -> int:
        """First bit after the entry."""
        return self.bit_offset + self.entry.bits


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeBlock:
    """An FSoE frame recognised by structure.

    ``likely`` is true if a CRC has another index than the command, as in some mappings: the frame
    is used, but a size check against it only warns.
    """

    byte_offset: int
    frame_bytes: int
    command: Entry
    direction: Direction
    sm_index: int
    likely: bool = False

    @property
    def end_byte(self) -> int:
        """First byte after the frame."""
        return self.byte_offset + self.frame_bytes

    @property
    def safe_bytes(self) -> int:
        """Number of safe data bytes in the frame."""
        return safe_data_length(self.frame_bytes)

    @property
    def key(self) -> tuple[int, int]:
        """Sync manager number and byte offset, unique within a device."""
        return (self.sm_index, self.byte_offset)


@dataclass(frozen=True, kw_only=True)  # no slots, as `written` is cached
class SmLayout:
    """One sync manager with every entry placed; ``number`` is its index in the device's layout.

    ``known_bits`` is smaller than ``bits``, or 0, if it contains a PDO without channels: the device
    inserts its own content, and the offsets after it are unknown.
    """

    number: int
    sm: SyncManager
    placed: tuple[Placed, ...]
    bits: int
    known_bits: int
    complete: bool
    blocks: tuple[FsoeBlock, ...]

    @property
    def size_bytes(self) -> int:
        """Length of the process data, rounded up to bytes."""
        return (self.bits + 7) // 8

    @property
    def registered(self) -> bool:
        """Whether a driver registers an entry here, which gives it a place in the image."""
        return any(p.entry.registered for p in self.placed)

    @cached_property
    def written(self) -> tuple[Placed, ...]:
        """The entries that a driver writes itself."""
        return tuple(
            p for p in self.placed if p.entry.registered and p.entry.written_by is not None
        )

    def has_safe_data(self, block: FsoeBlock) -> bool:
        """Return whether the safe data of the frame contain an entry other than padding.

        A frame that is a single entry counts, because its content is unknown.
        """
        at = {safe_byte_offset(n) for n in range(block.safe_bytes)}
        first = block.byte_offset
        return any(
            not p.entry.is_gap
            and any(p.bit_offset < 8 * (first + n + 1) and p.end_bit > 8 * (first + n) for n in at)
            for p in self.placed
        )

    def block_at(self, bit_offset: int) -> FsoeBlock | None:
        """Return the frame that contains this bit, or ``None``."""
        byte = bit_offset // 8
        return next((b for b in self.blocks if b.byte_offset <= byte < b.end_byte), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class FramePair:
    """The n-th frame among the inputs of a device and the n-th among its outputs.

    Attributes:
        slot: Number, from 0 in the order of the process image.
        sends: Frame from the device to the MainDevice; ``None`` if it has fewer of these.
        takes: Frame from the MainDevice to the device; ``None`` if it has fewer of these.
        matched: Whether both exist and their object numbers do not belong to two connections.
    """

    slot: int
    sends: FsoeBlock | None
    takes: FsoeBlock | None
    matched: bool

    @property
    def blocks(self) -> tuple[FsoeBlock, ...]:
        """The existing frames."""
        return tuple(b for b in (self.sends, self.takes) if b is not None)

    @property
    def sent_bytes(self) -> int:
        """Length of the frame to the MainDevice; 0 if there is none."""
        return self.sends.frame_bytes if self.sends is not None else 0

    @property
    def taken_bytes(self) -> int:
        """Length of the frame from the MainDevice; 0 if there is none."""
        return self.takes.frame_bytes if self.takes is not None else 0

    def fits(self, other: FramePair) -> bool:
        """Whether the frames that each of the two sends are as long as those the other receives."""
        return self.sent_bytes == other.taken_bytes and self.taken_bytes == other.sent_bytes


class EntryPlace(NamedTuple):
    """A place of an entry, and its frame."""

    sm: SmLayout
    placed: Placed
    block: FsoeBlock | None


@dataclass(frozen=True, kw_only=True)  # no slots, as derived values are cached
class DeviceLayout:
    """All sync managers of a device in ascending order, including those without PDOs.

    ``partners`` maps each output frame to the input frame of the same connection, as
    `FsoeBlock.key`. On all known devices the indices of the two commands differ by 0x1000 (0x7080 /
    0x6080), 0x100 (0xE700 / 0xE600) or 0x10 (0x6770 / 0x6760); frames without such a partner are
    omitted.
    """

    managers: tuple[SmLayout, ...]
    partners: Mapping[tuple[int, int], tuple[int, int]]

    def manager(self, index: int) -> SmLayout | None:
        """Return the sync manager with this number."""
        return next((m for m in self.managers if m.sm.index == index), None)

    @cached_property
    def blocks(self) -> tuple[FsoeBlock, ...]:
        """The FSoE frames of all sync managers."""
        return tuple(block for sm in self.managers for block in sm.blocks)

    @cached_property
    def partner_frames(self) -> Mapping[tuple[int, int], FsoeBlock]:
        """The frame of the other direction of the same connection, by `FsoeBlock.key`."""
        blocks = {block.key: block for block in self.blocks}
        return {
            one: blocks[two] for pair in self.partners.items() for one, two in (pair, pair[::-1])
        }

    @cached_property
    def by_address(self) -> Mapping[tuple[int, int], tuple[EntryPlace, ...]]:
        """Places of each entry by index and subindex: the first place in each direction.

        A driver that does not specify a direction uses the first one.
        """
        found: dict[tuple[int, int], tuple[EntryPlace, ...]] = {}
        for sm in self.managers:
            for placed in sm.placed:
                if placed.entry.is_gap:
                    continue
                key = (placed.entry.index, placed.entry.subindex)
                places = found.get(key, ())
                # The first place in each direction counts, because the IgH master looks it up this
                # way.
                if all(place.sm.sm.direction is not sm.sm.direction for place in places):
                    place = EntryPlace(sm, placed, sm.block_at(placed.bit_offset))
                    found[key] = (*places, place)
        return found

    @cached_property
    def frame_pairs(self) -> tuple[FramePair, ...]:
        """The frame pairs of the device by slot; ``slot`` has this meaning everywhere.

        Frames after a PDO with an unknown layout have no number.
        """
        inputs, outputs = (self._numbered(way) for way in (Direction.INPUT, Direction.OUTPUT))
        # Without numbered partners, the order is a proof only if both sides have equal counts.
        even = len(inputs) == len(outputs)
        with_partner = {*self.partners, *self.partners.values()}
        rows = []
        for slot, (sends, takes) in enumerate(zip_longest(inputs, outputs)):
            matched = sends is not None and takes is not None
            if sends is not None and takes is not None:
                partner = self.partners.get(takes.key)
                # Partners by index have precedence over the order; a single frame joins only if no
                # other claims it.
                matched = partner == sends.key or (
                    even and partner is None and sends.key not in with_partner
                )
            rows.append(FramePair(slot=slot, sends=sends, takes=takes, matched=matched))
        return tuple(rows)

    def _numbered(self, direction: Direction) -> list[FsoeBlock]:
        found: list[FsoeBlock] = []
        for sm in self.managers:
            if sm.sm.direction is not direction:
                continue
            found += [b for b in sm.blocks if 8 * b.end_byte <= sm.known_bits]
            if not sm.complete:
                break
        return found

    @cached_property
    def slots(self) -> Mapping[tuple[int, int], int]:
        """The slot of each frame, by `FsoeBlock.key`."""
        return {b.key: pair.slot for pair in self.frame_pairs for b in pair.blocks}


def place_device(device: Device) -> DeviceLayout:
    """Place every entry of a device and recognise its FSoE frames; cached in `Device.layout`."""
    managers = tuple(
        _place(device, sm, number)
        for number, sm in enumerate(sorted(device.sync_managers, key=lambda sm: sm.index))
    )
    return DeviceLayout(managers=managers, partners=_partners(managers))


def place_entries(pdos: Iterable[Pdo]) -> tuple[Placed, ...]:
    """Place the entries of consecutive PDOs."""
    placed: list[Placed] = []
    bit = 0
    for number, pdo in enumerate(pdos):
        for entry in pdo.entries:
            placed.append(Placed(entry=entry, pdo=pdo, pdo_number=number, bit_offset=bit))
            bit += entry.bits
    return tuple(placed)


def _place(device: Device, sm: SyncManager, number: int) -> SmLayout:
    pdos = device.pdos_of(sm)
    placed = place_entries(pdos)
    bits = placed[-1].end_bit if placed else 0
    known_bits: int | None = None
    end_bit = 0
    for pdo in pdos:
        if not pdo.entries and known_bits is None:
            # From the first PDO without entries on, offsets are unknown.
            known_bits = end_bit
        end_bit += pdo.bits
    return SmLayout(
        number=number,
        sm=sm,
        placed=placed,
        bits=bits,
        known_bits=bits if known_bits is None else known_bits,
        complete=known_bits is None,
        blocks=find_blocks(placed, sm),
    )


def _partners(managers: tuple[SmLayout, ...]) -> dict[tuple[int, int], tuple[int, int]]:
    blocks = [b for sm in managers for b in sm.blocks]
    inputs = {b.command.index: b for b in blocks if b.direction is Direction.INPUT}
    pairs: dict[tuple[int, int], tuple[int, int]] = {}
    for out in (b for b in blocks if b.direction is Direction.OUTPUT):
        # Index distances in the FSoE profiles: outputs have higher indices than their inputs.
        for distance in (0x1000, 0x100, 0x10):
            partner = inputs.get(out.command.index - distance)
            if partner is not None:
                pairs[out.key] = partner.key
                break
    return pairs


def find_blocks(placed: tuple[Placed, ...], sm: SyncManager) -> tuple[FsoeBlock, ...]:
    """Recognise FSoE frames by structure; names are never used (they are empty or swapped).

    A frame starts with an 8-bit command on a byte boundary. CRCs of 16 bits are at byte 2 (one safe
    byte) or at bytes 3, 7, 11 … (even numbers of safe bytes); the connection ID ends it. Command,
    CRCs and connection ID share one object index; safe data do not:

        +-----+--------+-------+-----+--------+-------+---------+
        | cmd | data 0 | CRC 0 | ... | data k | CRC k | conn ID |
        +-----+--------+-------+-----+--------+-------+---------+
          X:01            X:03                   X:..     X:02
    """
    starts = {p.bit_offset: n for n, p in enumerate(placed)}
    blocks: list[FsoeBlock] = []
    free_from = 0
    for number, place in enumerate(placed):
        if place.bit_offset < free_from or not _can_be_command(place):
            # Frames do not overlap: within a frame, an entry that looks like a command is data.
            continue
        block = _block_at(placed, starts, number, sm)
        if block is not None:
            blocks.append(block)
            free_from = 8 * block.end_byte
    return tuple(blocks)


def _can_be_command(place: Placed) -> bool:
    return (
        place.entry.bits == _COMMAND_BITS
        and not place.entry.is_gap
        and place.bit_offset % 8 == 0
        and place.entry.index >= 0x2000
    )


def _block_at(
    placed: tuple[Placed, ...], starts: dict[int, int], number: int, sm: SyncManager
) -> FsoeBlock | None:
    """Return the longest frame that starts at this entry, or ``None``."""
    command = placed[number]
    best: FsoeBlock | None = None
    for words in frames_at(placed, starts, command, placed[-1].end_bit):
        match = _matches(placed, starts, command, words)
        if match is not None:
            # Shorter frames are found first; the longest one stays.
            best = FsoeBlock(
                byte_offset=command.bit_offset // 8,
                frame_bytes=(words[-1].end_bit - command.bit_offset) // 8,
                command=command.entry,
                direction=sm.direction,
                sm_index=sm.index,
                likely=match == "likely",
            )
    return best


def _matches(
    placed: tuple[Placed, ...],
    starts: Mapping[int, int],
    command: Placed,
    words: tuple[Placed, ...],
) -> str | None:
    """Return ``sure`` or ``likely`` if these words belong to the command, otherwise ``None``."""
    checks = [w.entry for w in words]
    index = command.entry.index
    same = [e.index == index for e in checks]
    # No device maps a frame that reads one object twice.
    if not _subindices_differ(command.entry, checks):
        return None
    if all(same):
        return "sure" if _data_differs(placed, starts, command, words) else None
    # Some mappings put a single CRC on a neighbouring object; the connection ID has the command's.
    near = all(abs(e.index - index) <= _NEIGHBOUR for e in checks)
    if near and same[-1] and sum(same) >= len(same) - 1 and len(same) > 2:
        return "likely"
    return None


def frames_at(
    placed: tuple[Placed, ...], starts: Mapping[int, int], command: Placed, end_bit: int
) -> Iterator[tuple[Placed, ...]]:
    """Yield the CRCs and the connection ID of every frame that is possible by position alone.

    Args:
        placed: All entries of the sync manager.
        starts: Number in ``placed`` of the entry that starts at a bit.
        command: The command at the beginning of the frame.
        end_bit: Latest end of the frame.

    Yields:
        The 16-bit entries, none of them padding, the connection ID last; shorter frames first.
    """

    def word(byte: int) -> Placed | None:
        number = starts.get(command.bit_offset + 8 * byte)
        if number is None:
            return None
        found = placed[number]
        right = found.entry.bits == _CRC_BITS and not found.entry.is_gap
        return found if right and found.end_bit <= end_bit else None

    # The frame of 6 bytes: command, one safe byte, CRC, connection ID (ETG.5100).
    crc, connection = word(2), word(4)
    if crc is not None and connection is not None:
        yield crc, connection
    crcs: list[Placed] = []
    # Longer frames have two safe bytes before each CRC.
    for byte in range(3, _LONGEST_FRAME - 3, 4):
        crc = word(byte)
        if crc is None:
            return  # longer frames also need it
        crcs.append(crc)
        connection = word(byte + 2)
        if connection is not None:
            yield *crcs, connection


def _subindices_differ(command: Entry, checks: list[Entry]) -> bool:
    seen = [(e.index, e.subindex) for e in (command, *checks)]
    return len(set(seen)) == len(seen)


def _data_differs(
    placed: tuple[Placed, ...],
    starts: Mapping[int, int],
    command: Placed,
    words: tuple[Placed, ...],
) -> bool:
    """Whether no safe data have the index of the command: true for frames, not for records."""
    checks = {w.bit_offset for w in words}
    for number in range(starts[command.bit_offset] + 1, starts[words[-1].bit_offset]):
        place = placed[number]
        if place.bit_offset not in checks and place.entry.index == command.entry.index:
            return False
    return True
