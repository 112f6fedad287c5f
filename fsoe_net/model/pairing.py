"""Assigns SubInstances to slots of MainInstances, as far as lengths and direction show.

A connection has a frame in each direction, so a SubDevice takes part with pairs of frames:

    MainInstance (safety logic)              SubInstance
    inputs   n-th frame  -------------->     outputs  m-th frame
    outputs  n-th frame  <--------------     inputs   m-th frame
             slot n                                   sub_slot m

A frame has the same length at both ends. Two pairs are joined by lengths only if there is no
alternative: one slot and one SubInstance with these lengths. Everything else is a proposal with its
candidates, for a person to decide.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.model.layout import DeviceLayout, FsoeBlock


@dataclass(frozen=True, slots=True, kw_only=True)
class PairEnd:
    """The frames of one connection at one of its ends.

    Attributes:
        subdevice: Number of the SubDevice.
        slot: Number of the pair in its process image, from 0.
        written: Frame among its outputs.
        read: Frame among its inputs.
    """

    subdevice: int
    slot: int
    written: FsoeBlock
    read: FsoeBlock

    @property
    def key(self) -> tuple[int, int]:
        """SubDevice and slot."""
        return (self.subdevice, self.slot)

    @property
    def lengths(self) -> tuple[int, int]:
        """Bytes to the SubDevice, and bytes from it."""
        return (self.written.frame_bytes, self.read.frame_bytes)

    def fits(self, other: PairEnd) -> bool:
        """Whether both frames of the other end have matching lengths."""
        return self.lengths == other.lengths[::-1]


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenPair:
    """A SubInstance that cannot be paired by length.

    Attributes:
        sub: Its frames.
        candidates: Free slots of these lengths; empty if there are none.
        rivals: Other SubInstances for the same slots.
        proposed: The next slot in ring order, ``None`` if all are assigned. It is as likely as the
            other candidates.
    """

    sub: PairEnd
    candidates: tuple[PairEnd, ...]
    rivals: tuple[PairEnd, ...]
    proposed: PairEnd | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Pairing:
    """Result of pairing by lengths: pairs of MainInstance and SubInstance, and open ones."""

    settled: tuple[tuple[PairEnd, PairEnd], ...]
    open: tuple[OpenPair, ...]


def pair_ends(layout: DeviceLayout, subdevice: int) -> tuple[PairEnd, ...]:
    """Return the pairs of matching frames of a SubDevice, by slot.

    Args:
        layout: Its layout.
        subdevice: Its number.
    """
    return tuple(
        PairEnd(subdevice=subdevice, slot=pair.slot, written=pair.takes, read=pair.sends)
        for pair in layout.frame_pairs
        if pair.matched and pair.takes is not None and pair.sends is not None
    )


def lonely_frames(layout: DeviceLayout) -> tuple[FsoeBlock, ...]:
    """Return the frames of a SubDevice without a frame in the other direction."""
    return tuple(b for pair in layout.frame_pairs if not pair.matched for b in pair.blocks)


def pair_by_lengths(
    mains: Sequence[PairEnd], subs: Sequence[PairEnd], doubtful: Iterable[PairEnd] = ()
) -> Pairing:
    """Pair free slots and free SubInstances if lengths and direction leave only one choice.

    Args:
        mains: Slots of all MainInstances that no known connection uses, in ring order.
        subs: SubInstances without a connection, in ring order.
        doubtful: Pairs whose participation or end is unknown; they block all pairs that they could
            be part of.
    """
    # A doubtful pair may have either role: both orders of its lengths are blocked.
    unknown = {p.lengths for p in doubtful} | {p.lengths[::-1] for p in doubtful}
    settled: list[tuple[PairEnd, PairEnd]] = []
    rows: list[OpenPair] = []
    given: dict[tuple[int, int], int] = {}
    for sub in subs:
        slots = tuple(m for m in mains if m.fits(sub))
        rivals = tuple(s for s in subs if s.lengths == sub.lengths and s is not sub)
        # Decided only if no other frame with these lengths is left on either side.
        if len(slots) == 1 and not rivals and sub.lengths not in unknown:
            settled.append((slots[0], sub))
            continue
        # In turn: otherwise, all equal SubInstances would be proposed for the first slot.
        turn = given.get(sub.lengths, 0)
        given[sub.lengths] = turn + 1
        rows.append(
            OpenPair(
                sub=sub,
                candidates=slots,
                rivals=rivals,
                proposed=slots[turn] if turn < len(slots) else None,
            )
        )
    return Pairing(settled=tuple(settled), open=tuple(rows))
