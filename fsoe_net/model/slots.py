"""Slots: the FSoE frame pairs of a device by number, which is what ``slot`` means everywhere."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest

from fsoe_net.model.bus import Direction
from fsoe_net.model.layout import DeviceLayout, FsoeBlock

__all__ = ["FramePair", "frame_pairs", "slot_numbers"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FramePair:
    """The n-th frame among the inputs of a device with the n-th among its outputs.

    Attributes:
        slot: Number, from 0 in the order of the process image.
        sends: Frame of the device to the MainDevice; ``None`` when it has fewer of these.
        takes: Frame of the MainDevice to the device; ``None`` when it has fewer of these.
        matched: Both are there, and the object numbers do not say that they belong to two
            connections.
    """

    slot: int
    sends: FsoeBlock | None
    takes: FsoeBlock | None
    matched: bool

    @property
    def blocks(self) -> tuple[FsoeBlock, ...]:
        """The frames that are there."""
        return tuple(b for b in (self.sends, self.takes) if b is not None)

    @property
    def sent_bytes(self) -> int:
        """Length of the frame to the MainDevice, 0 without one."""
        return self.sends.frame_bytes if self.sends is not None else 0

    @property
    def taken_bytes(self) -> int:
        """Length of the frame from the MainDevice, 0 without one."""
        return self.takes.frame_bytes if self.takes is not None else 0

    def fits(self, other: FramePair) -> bool:
        """Whether what each of the two sends is as long as what the other takes."""
        return self.sent_bytes == other.taken_bytes and self.taken_bytes == other.sent_bytes


def frame_pairs(layout: DeviceLayout) -> tuple[FramePair, ...]:
    """Return the frame pairs of a device by slot.

    Frames behind a PDO whose layout is not known offline have no number.
    """
    inputs, outputs = (_frames(layout, way) for way in (Direction.INPUT, Direction.OUTPUT))
    even = len(inputs) == len(outputs)
    with_partner = {*layout.partners, *layout.partners.values()}
    rows = []
    for slot, (sends, takes) in enumerate(zip_longest(inputs, outputs)):
        matched = sends is not None and takes is not None
        if sends is not None and takes is not None:
            partner = layout.partners.get(takes.key)
            matched = partner == sends.key or (
                even and partner is None and sends.key not in with_partner
            )
        rows.append(FramePair(slot=slot, sends=sends, takes=takes, matched=matched))
    return tuple(rows)


def _frames(layout: DeviceLayout, direction: Direction) -> list[FsoeBlock]:
    found: list[FsoeBlock] = []
    for sm in layout.managers:
        if sm.sm.direction is not direction:
            continue
        found += [b for b in sm.blocks if 8 * b.end_byte <= sm.known_bits]
        if not sm.complete:
            break
    return found


def slot_numbers(layout: DeviceLayout) -> dict[tuple[int, int], int]:
    """Return the slot of each frame of a device, by `FsoeBlock.key`."""
    return {b.key: pair.slot for pair in frame_pairs(layout) for b in pair.blocks}
