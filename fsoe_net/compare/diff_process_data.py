"""Differences in the process data of one SubDevice."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace

from fsoe_net.compare.diff_types import (
    Change,
    ChangeArea,
    ChangeKind,
    changed_facts,
    changed_part,
    size_text,
)
from fsoe_net.compare.sides import Managers
from fsoe_net.model.bus import Watchdog
from fsoe_net.model.layout import FsoeBlock, Placed, SmLayout


def compare_managers(
    where: str, a: Managers, b: Managers, whole: tuple[bool, bool]
) -> Iterator[Change]:
    """Compare all sync managers of a SubDevice.

    Args:
        where: Name of the SubDevice.
        a: Its sync managers with process data in A, by number.
        b: The same in B.
        whole: Whether A, and B, state all facts (`Side.whole`).
    """
    for index in sorted(a.keys() | b.keys()):
        name = f"{where} SM{index}"
        old, new = a.get(index), b.get(index)
        if old is None or new is None:
            yield changed_part(ChangeArea.SYNC_MANAGER, name, old, new, _size)
        else:
            yield from _manager(name, old, new, whole)


def _size(sm: SmLayout) -> str | None:
    return size_text(sm.bits) if sm.complete else None


def _watchdog(sm: SmLayout, whole: bool) -> str | None:
    """Return the watchdog; for a file of another tool, the default counts as not stated."""
    stated = whole or sm.sm.watchdog is not Watchdog.DEFAULT
    return sm.sm.watchdog.value if stated else None


def _manager(
    where: str, old: SmLayout, new: SmLayout, whole: tuple[bool, bool]
) -> Iterator[Change]:
    yield from changed_facts(
        ChangeArea.SYNC_MANAGER,
        where,
        ("direction", old.sm.direction.value, new.sm.direction.value),
        ("watchdog", _watchdog(old, whole[0]), _watchdog(new, whole[1])),
        ("size", _size(old), _size(new)),
    )
    if old.complete and new.complete:
        yield from _frames(where, old.blocks, new.blocks)
        yield from _entries(where, old, new, with_restart=all(whole))


def _frames(where: str, a: Iterable[FsoeBlock], b: Iterable[FsoeBlock]) -> Iterator[Change]:
    left, right = _by_address(a), _by_address(b)
    for address in dict.fromkeys([*left, *right]):
        old, new = left.get(address), right.get(address)
        name = f"{where} {address}"
        if old is None or new is None:
            yield changed_part(ChangeArea.FRAME, name, old, new, lambda f: f"{f.frame_bytes} bytes")
            continue
        places = old.byte_offset, new.byte_offset
        if places[0] != places[1]:
            yield Change(ChangeKind.MOVED, ChangeArea.FRAME, name, "byte", *places)
        sizes_now = ("frame_bytes", old.frame_bytes, new.frame_bytes)
        yield from changed_facts(ChangeArea.FRAME, name, sizes_now)


def _by_address(blocks: Iterable[FsoeBlock]) -> dict[str, FsoeBlock]:
    return {_frame_name(block): block for block in blocks}


def _frame_name(block: FsoeBlock) -> str:
    """Return the address of the command; a plan of another tool may have no entry there."""
    command = block.command
    return f"byte {block.byte_offset}" if command.is_gap else command.address


def _entries(where: str, a: SmLayout, b: SmLayout, *, with_restart: bool) -> Iterator[Change]:
    left, right = _keyed(a.placed), _keyed(b.placed)
    follows = _followed(a.blocks, b.blocks)
    moved: dict[int, list[str]] = {}
    for key, old in left.items():
        new = right.get(key)
        if new is None:
            continue
        distance = new.bit_offset - old.bit_offset
        # What moved together with its frame is one change: that of the frame.
        if distance and follows.get(old.bit_offset // 8) != distance:
            moved.setdefault(distance, []).append(old.entry.address)
        facts: list[tuple[str, int | str, int | str]] = [("bits", old.entry.bits, new.entry.bits)]
        if with_restart:
            facts.append(("restart_relevant", _restart(old), _restart(new)))
        for change in changed_facts(ChangeArea.ENTRIES, where, *facts):
            yield replace(change, entries=(old.entry.address,))
    for distance, addresses in moved.items():
        words = "bit", None, f"{distance:+d} bits", tuple(addresses)
        yield Change(ChangeKind.MOVED, ChangeArea.ENTRIES, where, *words)
    for kind, order, other in (
        (ChangeKind.REMOVED, left, right),
        (ChangeKind.ADDED, right, left),
    ):
        if alone := tuple(key[0] for key in order if key not in other):
            yield Change(kind, ChangeArea.ENTRIES, where, entries=alone)


def _restart(placed: Placed) -> str:
    return "yes" if placed.entry.restart_relevant else "no"


def _keyed(rows: Iterable[Placed]) -> dict[tuple[str, int], Placed]:
    """Return the entries by address, without padding; a repeated address gets a number."""
    counts: Counter[str] = Counter()
    keyed = {}
    for row in rows:
        if not row.entry.is_gap:
            address = row.entry.address
            keyed[address, counts[address]] = row
            counts[address] += 1
    return keyed


def _followed(a: Iterable[FsoeBlock], b: Iterable[FsoeBlock]) -> dict[int, int]:
    """Return by how many bits each byte of a frame moved with it; the frame reports this move."""
    right = _by_address(b)
    return {
        byte: 8 * (new.byte_offset - old.byte_offset)
        for address, old in _by_address(a).items()
        if (new := right.get(address)) is not None
        for byte in range(old.byte_offset, old.end_byte)
    }
