"""The ends of transfers: the entry of a sync manager for a name, index and subindex."""

from __future__ import annotations

import enum

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import Direction, SubDevice
from fsoe_net.model.layout import DeviceLayout, FsoeBlock, Placed, SmLayout
from fsoe_net.model.network import Endpoint, Net, Transfer


class Miss(enum.Enum):
    """Reason why an end of a transfer does not refer to bytes."""

    MODULE = "module is not known"
    DEVICE = "device description could not be read"
    ENTRY = "entry is not mapped"
    SKIPPED = "entry is marked skip"
    GAP = "entry is padding"
    LAYOUT = "layout is not known offline"


@dataclass(frozen=True, slots=True, kw_only=True)
class ResolvedEnd:
    """One end of a transfer. ``miss`` is ``None`` if all other fields are set.

    ``block`` is the recognised FSoE frame that contains the entry, or ``None``.
    """

    endpoint: Endpoint
    subdevice: SubDevice | None = None
    sm: SmLayout | None = None
    placed: Placed | None = None
    block: FsoeBlock | None = None
    miss: Miss | None = None

    @property
    def layout(self) -> DeviceLayout | None:
        """The layout of the SubDevice, if there is one."""
        return None if self.subdevice is None else self.subdevice.layout

    @property
    def partner(self) -> FsoeBlock | None:
        """The frame of the other direction of the same connection, if the device has it."""
        if self.block is None or self.layout is None:
            return None
        return self.layout.partner_frames.get(self.block.key)

    @property
    def byte_offset(self) -> int:
        """Byte in the sync manager where the copy starts (bits are dropped, as in memcpy)."""
        return self.placed.bit_offset // 8 if self.placed is not None else 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ResolvedTransfer:
    """A transfer of a net with both ends looked up.

    ``number`` counts the transfers of the network, ``net_number`` its nets. ``made``: created from
    a connection, not stated.
    """

    number: int
    net_number: int
    net: Net
    transfer: Transfer
    source: ResolvedEnd
    destination: ResolvedEnd
    made: bool = False

    @property
    def found(self) -> bool:
        """Whether both ends refer to bytes."""
        return self.source.miss is None and self.destination.miss is None

    @property
    def usable(self) -> bool:
        """Whether both ends refer to bytes and the direction is input to output."""
        return (
            self.found
            and self.source.sm is not None
            and self.destination.sm is not None
            and self.source.sm.sm.direction is Direction.INPUT
            and self.destination.sm.sm.direction is Direction.OUTPUT
        )


def find_end(endpoint: Endpoint, sub: SubDevice | None, wanted: Direction) -> ResolvedEnd:
    """Look up one end; if it fails, ``miss`` is the reason.

    Args:
        endpoint: The end.
        sub: The SubDevice with its name; ``None`` if there is none.
        wanted: Its direction, which decides if an entry is mapped in both.
    """
    if sub is None:
        return ResolvedEnd(endpoint=endpoint, miss=Miss.MODULE)
    layout = sub.layout
    if layout is None:
        return ResolvedEnd(endpoint=endpoint, subdevice=sub, miss=Miss.DEVICE)
    # Index 0 is padding in ETG.1000 and has no name.
    if endpoint.index == 0:
        return ResolvedEnd(endpoint=endpoint, subdevice=sub, miss=Miss.GAP)
    found = layout.by_address.get((endpoint.index, endpoint.subindex))
    if found is None:
        # In an incomplete layout the entry may exist; this is not an error of the name.
        complete = all(sm.complete for sm in layout.managers)
        miss = Miss.ENTRY if complete else Miss.LAYOUT
        return ResolvedEnd(endpoint=endpoint, subdevice=sub, miss=miss)
    sm, placed, block = found[0]
    if len(found) > 1:  # an object can be mapped in both directions
        right = (place for place in found if place.sm.sm.direction is wanted)
        sm, placed, block = next(right, found[0])
    return ResolvedEnd(
        endpoint=endpoint,
        subdevice=sub,
        sm=sm,
        placed=placed,
        block=block,
        miss=_doubt(sm, placed),
    )


def _doubt(sm: SmLayout, placed: Placed) -> Miss | None:
    if placed.entry.skip:
        return Miss.SKIPPED
    return Miss.LAYOUT if placed.end_bit > sm.known_bits else None
