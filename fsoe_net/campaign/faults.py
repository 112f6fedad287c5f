"""Faults of frames on the path: small parts, each for one direction and a limited time.

A fault is data without internal state: its effect in a cycle depends only on the cycle and on the
frames sent by the channel. It can therefore be repeated, shortened and combined with others. The
faults of each catalogue class are listed in `fsoe_net.campaign.fault_classes`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from fsoe_net.campaign.channel import BACK, Channel, Fault, Way
from fsoe_net.campaign.collision_proof import block_crcs
from fsoe_net.fsoe.pdu import Pdu, assemble, decode_pdu, is_frame_length


@dataclass(frozen=True, slots=True, kw_only=True)
class _Span:
    """Common attributes: ``way``, first cycle ``start``, and the first cycle after, ``until``."""

    way: Way
    start: int
    until: int

    def _on(self, channel: Channel) -> bool:
        return self.start <= channel.cycle < self.until

    def next_change(self, channel: Channel) -> int | None:
        """Return the next cycle in which its effect may differ from the preceding cycle."""
        if channel.cycle <= self.start:
            return self.start
        return self.until if channel.cycle <= self.until else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Flip(_Span):
    """Flips bits: ``mask`` is XORed to the frame as an integer, first byte lowest."""

    mask: int

    def apply(self, channel: Channel, image: bytes | None) -> bytes | None:
        """Return the image with flipped bits."""
        if image is None or not self._on(channel):
            return image
        size = len(image)
        value = int.from_bytes(image, "little") ^ (self.mask & ((1 << 8 * size) - 1))
        return value.to_bytes(size, "little")


@dataclass(frozen=True, slots=True, kw_only=True)
class Swap(_Span):
    """Another frame replaces the correct one."""

    frame: bytes

    def apply(self, channel: Channel, image: bytes | None) -> bytes | None:
        """Return the other frame."""
        return self.frame if self._on(channel) else image


@dataclass(frozen=True, slots=True, kw_only=True)
class Freeze(_Span):
    """Nothing arrives: the image keeps its value from before ``start``."""

    def apply(self, channel: Channel, image: bytes | None) -> bytes | None:
        """Return the image of the previous cycle."""
        return channel.image(self.way, self.start - 1) if self._on(channel) else image


@dataclass(frozen=True, slots=True, kw_only=True)
class Early(_Span):
    """Every bus cycle from ``start`` on begins earlier, by less than one; frames are unchanged."""

    early_ns: int

    def apply(self, channel: Channel, image: bytes | None) -> bytes | None:
        """Return the image unchanged."""
        return image


@dataclass(frozen=True, slots=True, kw_only=True)
class Late(_Span):
    """Frames that become visible from ``start`` on arrive ``cycles`` bus cycles later."""

    cycles: int

    def apply(self, channel: Channel, image: bytes | None) -> bytes | None:
        """Return the image of ``cycles`` cycles ago."""
        if not self._on(channel):
            return image
        return channel.image(self.way, max(self.start - 1, channel.cycle - self.cycles))

    def next_change(self, channel: Channel) -> int | None:
        """Return when the next delayed frame becomes visible, or when the delay ends."""
        if not self.start < channel.cycle < self.until:
            return _Span.next_change(self, channel)
        first = max(self.start, channel.cycle - self.cycles)
        delayed = [visible for visible, _ in channel.sent[self.way] if visible >= first]
        return min(self.until, delayed[0] + self.cycles) if delayed else self.until


@dataclass(frozen=True, slots=True, kw_only=True)
class Torn(_Span):
    """A torn copy: the first ``head_bytes`` are new, the rest is from the previous frame."""

    head_bytes: int

    def apply(self, channel: Channel, image: bytes | None) -> bytes | None:
        """Return the mixed image."""
        frames = channel.sent[self.way]
        if image is None or not self._on(channel):
            return image
        older = [frame for visible, frame in frames if visible <= channel.cycle and frame != image]
        # Before the first frame, the remaining memory is zero.
        rest = older[-1] if older else bytes(len(image))
        return image[: self.head_bytes] + rest[self.head_bytes :]


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip(_Span):
    """The copy starts at a wrong byte: ``shift`` bytes too late or (negative) too early.

    The gap is filled with repeated copies of ``filler``, the bytes next to the frame.
    """

    shift: int
    filler: bytes = b"\0"

    def apply(self, channel: Channel, image: bytes | None) -> bytes | None:
        """Return the shifted bytes."""
        if image is None or not self._on(channel) or not self.shift:
            return image
        size, gap = len(image), min(abs(self.shift), len(image))
        fill = (self.filler * (-(-gap // len(self.filler))))[:gap]
        return (image + fill)[-size:] if self.shift > 0 else (fill + image)[:size]


@dataclass(frozen=True, slots=True, kw_only=True)
class Forge(_Span):
    """A frame rebuilt with valid CRCs, so that only the listed fields are wrong.

    Attributes:
        command: Another command.
        connection_id: Another ConnID.
        turned: Bits to invert in the safe data, first byte lowest.
        ahead: Added to the sequence number.
        spoiled: XORed to the CRC of the last block.
        from_start: Old CRC 0 and number 1, as for a Reset or the first Session frame.
    """

    command: int | None = None
    connection_id: int | None = None
    turned: int = 0
    ahead: int = 0
    spoiled: int = 0
    from_start: bool = False

    def apply(self, channel: Channel, image: bytes | None) -> bytes | None:
        """Return the rebuilt frame."""
        # A table provides the chain of a correct sender.
        table = channel.tables[self.way]
        if image is None or table is None or not self._on(channel):
            return image
        if not is_frame_length(len(image)):
            return image
        right = decode_pdu(image)
        size = len(right.safe_data)
        data = int.from_bytes(right.safe_data, "little") ^ self.turned & ((1 << 8 * size) - 1)
        pdu = Pdu(
            command=right.command if self.command is None else self.command,
            safe_data=data.to_bytes(size, "little"),
            crcs=right.crcs,
            connection_id=(
                right.connection_id if self.connection_id is None else self.connection_id
            ),
        )
        old, sequence = table.last, table.due_sequence(pdu)
        if self.from_start:
            old, sequence = 0, 1
        # Sequence numbers run from 1 to 65535; 0 is not used.
        sequence = (sequence - 1 + self.ahead) % 0xFFFF + 1
        crcs = list(block_crcs(old, sequence, pdu))
        # The last block: earlier ones stay valid, so that the frame is rejected at its end.
        crcs[-1] ^= self.spoiled
        return assemble(pdu.command, pdu.safe_data, tuple(crcs), pdu.connection_id)


@dataclass(frozen=True, slots=True, kw_only=True)
class Replay(_Span):
    """Frames from another time, in order: the next one after its receiver has answered."""

    frames: tuple[bytes, ...]

    def apply(self, channel: Channel, image: bytes | None) -> bytes | None:
        """Return the frame due in the sequence; the last one is kept."""
        if not self._on(channel):
            return image
        back = BACK[self.way]
        first = self.start + channel.delay_cycles[back]
        answers = 0
        for visible, _ in reversed(channel.sent[back]):
            if visible < first:
                break
            answers += 1
        return self.frames[min(answers, len(self.frames) - 1)]

    def next_change(self, channel: Channel) -> int | None:
        """Return this cycle: the effect changes with every answer."""
        return channel.cycle if self._on(channel) else _Span.next_change(self, channel)


@dataclass(frozen=True, slots=True, kw_only=True)
class Alternate(_Span):
    """Two writers share an image, which contains ``frame`` in every second cycle."""

    frame: bytes

    def apply(self, channel: Channel, image: bytes | None) -> bytes | None:
        """Return the other writer's frame and the right one alternately."""
        other = self._on(channel) and (channel.cycle - self.start) % 2 == 0
        return self.frame if other else image

    def next_change(self, channel: Channel) -> int | None:
        """Return this cycle: the effect changes in every cycle."""
        return channel.cycle if self._on(channel) else _Span.next_change(self, channel)


def compose(*parts: Fault | tuple[Fault, ...]) -> tuple[Fault, ...]:
    """Combine faults: each acts on the result of the previous ones."""
    return tuple(
        fault for part in parts for fault in (part if isinstance(part, tuple) else (part,))
    )


def shortened(fault: Fault, cycles: int) -> Fault:
    """Return the same fault for fewer cycles."""
    if not isinstance(fault, _Span) or fault.until - fault.start <= cycles:
        return fault
    return replace(fault, until=fault.start + cycles)
