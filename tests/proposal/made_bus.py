"""A bus for proposals."""

from __future__ import annotations

from fsoe_net.formats.own.library import builtin_library
from fsoe_net.model.bus import Device, Direction, Entry, Pdo, SyncManager
from fsoe_net.model.description import DescribedSubDevice
from fsoe_net.proposal.proposal import Proposal

LIBRARY = builtin_library()


def words(index: int, safe_bits: int) -> tuple[Entry, ...]:
    rows = ((index, 1, 8), (index + 1, 1, safe_bits), (index, 3, 16), (index, 2, 16))
    return tuple(Entry(index=i, subindex=s, bits=b, name="") for i, s, b in rows)


def device(product: int, *lengths: tuple[int, int]) -> Device:
    """A device with a pair of frames of one or two safe bytes for each pair of lengths."""
    managers = []
    for sm, way, column, base in ((2, "output", 0, 0x7000), (3, "input", 1, 0x6000)):
        pdos = tuple(
            Pdo(index=0x1600 + n, entries=words(base + 16 * n, 8 * (pair[column] - 5)))
            for n, pair in enumerate(lengths)
        )
        managers.append(SyncManager(index=sm, direction=Direction(way), pdos=pdos))
    return Device(path="", vendor_id=2, product_code=product, sync_managers=tuple(managers))


LOGIC, INPUT, OUTPUT = 0x1AFE3052, 0x07703052, 0x0B583052


def sub(name: str, product: int, *lengths: tuple[int, int]) -> DescribedSubDevice:
    return DescribedSubDevice(name=name, device=device(product, *lengths))


def rows(made: Proposal) -> list[tuple]:
    return [(c.main, c.slot, c.sub, bool(c.unconfirmed)) for c in made.bus.connections]


SIX, SEVEN = (6, 6), (6, 7)
EL1904 = sub("stop", INPUT, SIX)
EL2904 = sub("motor", OUTPUT, SIX)
