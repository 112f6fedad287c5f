"""The ends of transfers: which entry of which sync manager a name, index and subindex mean."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from fsoe_net.model.bus import Device, Direction, SubDevice
from fsoe_net.model.layout import DeviceLayout, FsoeBlock, Placed, SmLayout, layout_of
from fsoe_net.model.network import Endpoint, Net, Transfer

__all__ = ["Finder", "Layouts", "Miss", "ResolvedEnd", "ResolvedTransfer"]


class Miss(enum.Enum):
    """Why an end of a transfer means no bytes."""

    MODULE = "module is not known"
    DEVICE = "device description could not be read"
    ENTRY = "entry is not mapped"
    SKIPPED = "entry is marked skip"
    GAP = "entry is padding"
    LAYOUT = "layout is not known offline"


@dataclass(frozen=True, slots=True, kw_only=True)
class ResolvedEnd:
    """One end of a transfer. ``miss`` is ``None`` when all other fields are set.

    ``block`` is the recognised FSoE frame the entry lies in, or ``None``.
    """

    endpoint: Endpoint
    subdevice: SubDevice | None = None
    layout: DeviceLayout | None = None
    sm: SmLayout | None = None
    placed: Placed | None = None
    block: FsoeBlock | None = None
    miss: Miss | None = None

    @property
    def byte_offset(self) -> int:
        """Byte inside the sync manager where the copy starts (bits are dropped, as memcpy does)."""
        return self.placed.bit_offset // 8 if self.placed is not None else 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ResolvedTransfer:
    """A transfer of a net with both ends looked up."""

    net: Net
    transfer: Transfer
    source: ResolvedEnd
    destination: ResolvedEnd

    @property
    def found(self) -> bool:
        """Whether both ends mean bytes."""
        return self.source.miss is None and self.destination.miss is None

    @property
    def usable(self) -> bool:
        """Whether both ends mean bytes and the direction is input to output."""
        return (
            self.found
            and self.source.sm is not None
            and self.destination.sm is not None
            and self.source.sm.sm.direction is Direction.INPUT
            and self.destination.sm.sm.direction is Direction.OUTPUT
        )


class Layouts:
    """Layouts by device object: a hundred equal terminals are placed once."""

    def __init__(self) -> None:
        self._known: dict[int, DeviceLayout] = {}

    def of(self, device: Device) -> DeviceLayout:
        """Return the layout of a device."""
        found = self._known.get(id(device))
        if found is None:
            found = self._known[id(device)] = layout_of(device)
        return found


_Hit = tuple[SmLayout, Placed, FsoeBlock | None]


class Finder:
    """Looks up transfer ends the way the driver does."""

    def __init__(self, by_name: dict[str, SubDevice], layouts: Layouts) -> None:
        self._by_name = by_name
        self._layouts = layouts
        self._entries: dict[int, dict[tuple[int, int], _Hit]] = {}

    def end(self, endpoint: Endpoint) -> ResolvedEnd:
        """Look up one end; what it does not mean is in ``miss``."""
        sub = self._by_name.get(endpoint.module)
        if sub is None:
            return ResolvedEnd(endpoint=endpoint, miss=Miss.MODULE)
        if sub.device is None:
            return ResolvedEnd(endpoint=endpoint, subdevice=sub, miss=Miss.DEVICE)
        layout = self._layouts.of(sub.device)
        if endpoint.index == 0:
            return ResolvedEnd(endpoint=endpoint, subdevice=sub, layout=layout, miss=Miss.GAP)
        hit = self._index(sub.device, layout).get((endpoint.index, endpoint.subindex))
        if hit is None:
            complete = all(sm.complete for sm in layout.managers)
            miss = Miss.ENTRY if complete else Miss.LAYOUT
            return ResolvedEnd(endpoint=endpoint, subdevice=sub, layout=layout, miss=miss)
        sm, placed, block = hit
        return ResolvedEnd(
            endpoint=endpoint,
            subdevice=sub,
            layout=layout,
            sm=sm,
            placed=placed,
            block=block,
            miss=_doubt(sm, placed),
        )

    def _index(self, device: Device, layout: DeviceLayout) -> dict[tuple[int, int], _Hit]:
        known = self._entries.get(id(device))
        if known is None:
            known = {}
            for sm in layout.managers:
                for placed in sm.placed:
                    key = (placed.entry.index, placed.entry.subindex)
                    if not placed.entry.is_gap and key not in known:
                        known[key] = (sm, placed, sm.block_at(placed.bit_offset))
            self._entries[id(device)] = known
        return known


def _doubt(sm: SmLayout, placed: Placed) -> Miss | None:
    if placed.entry.skip:
        return Miss.SKIPPED
    return Miss.LAYOUT if placed.end_bit > sm.known_bits else None
