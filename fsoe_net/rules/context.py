"""What every rule is given, and the shorthand for adding a finding."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from fsoe_net.diag import Findings
from fsoe_net.model import (
    Device,
    DeviceLayout,
    FsoeBlock,
    Resolution,
    ResolvedEnd,
    ResolvedTransfer,
    SmLayout,
    SubDevice,
)

__all__ = [
    "Context",
    "block_text",
    "count_of",
    "describe_end",
    "describe_sm",
    "few",
    "module_pair",
    "nearest",
    "touched_bytes",
]


@dataclass(slots=True, kw_only=True)
class Context(Findings):
    """One run of the rules over one network.

    The sets keep one mistake from being named twice: module pairs that already have an error,
    devices whose PDO groups are exchanged or on no sync manager, nets of which a part is unknown.
    """

    resolution: Resolution
    blamed_pairs: set[frozenset[str]] = field(default_factory=set)
    exchanged: set[int] = field(default_factory=set)
    unassigned: set[int] = field(default_factory=set)
    unsure_nets: set[int] = field(default_factory=set)

    def devices(self) -> Iterator[tuple[Device, DeviceLayout, SubDevice]]:
        """Yield each device description once, with the first SubDevice that uses it."""
        seen: set[int] = set()
        network = self.resolution.network
        for sub, layout in zip(network.subdevices, self.resolution.layouts, strict=True):
            if sub.device is None or layout is None or id(sub.device) in seen:
                continue
            seen.add(id(sub.device))
            yield sub.device, layout, sub

    def blame(self, row: ResolvedTransfer) -> None:
        """Remember that the two modules of a transfer already have an error of their own."""
        self.blamed_pairs.add(module_pair(row))

    def is_exchanged(self, end: ResolvedEnd) -> bool:
        """Whether the device of this end has its PDO groups exchanged (FSN401)."""
        sub = end.subdevice
        return sub is not None and id(sub.device) in self.exchanged

    def is_unassigned(self, end: ResolvedEnd) -> bool:
        """Whether PDOs of the device of this end are on no sync manager (FSN409)."""
        sub = end.subdevice
        return sub is not None and id(sub.device) in self.unassigned


def module_pair(row: ResolvedTransfer) -> frozenset[str]:
    """Return the names of the two modules a transfer joins."""
    return frozenset((row.transfer.source.module, row.transfer.destination.module))


def nearest(name: str, known: Iterable[str]) -> str | None:
    """Return the name that was probably meant, or ``None``."""
    folded = {k.lower(): k for k in known}
    if name.lower() in folded:
        return folded[name.lower()]
    swapped = [k for k in folded if sorted(k) == sorted(name.lower())]
    close = difflib.get_close_matches(name.lower(), folded, n=1, cutoff=0.6)
    best = swapped or close
    return folded[best[0]] if best else None


def describe_sm(sm: SmLayout) -> str:
    """``SM2, MainDevice to SubDevice``."""
    way = (
        "MainDevice to SubDevice"
        if sm.sm.direction.value == "output"
        else ("SubDevice to MainDevice")
    )
    return f"SM{sm.sm.index}, {way}"


def describe_end(end: ResolvedEnd) -> str:
    """``el1918 0x7080:01 is in RxPDO 0x1600 (SM2, MainDevice to SubDevice)``."""
    if end.sm is None or end.placed is None:
        return str(end.endpoint)
    group = "RxPDO" if end.sm.sm.carries == "rpdo" else "TxPDO"
    return f"{end.endpoint} is in {group} 0x{end.placed.pdo.index:04x} ({describe_sm(end.sm)})"


def touched_bytes(end: ResolvedEnd, size_bytes: int) -> tuple[int, int]:
    """Return the first byte and the byte behind the last that a copy touches in its SM."""
    return end.byte_offset, end.byte_offset + size_bytes


def few(names: list[str], limit: int = 6) -> str:
    """Return the first names of a list, and how many more there are."""
    more = len(names) - limit
    return ", ".join(names[:limit]) + (f" and {more} more" if more > 0 else "")


def count_of(number: int, word: str) -> str:
    """``1 byte``, ``2 bytes``."""
    return f"{number} {word}" if number == 1 else f"{number} {word}s"


def block_text(module: str, block: FsoeBlock) -> str:
    """``ek1914 0x7000:01``."""
    return f"{module} {block.command.address}"
