"""Differences in the process data of one SubDevice."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fsoe_net.compare.diff_side import SideEntry, SideFrame, SideManager
from fsoe_net.compare.diff_types import Change, ChangeArea, ChangeKind, Fact

_Key = tuple[str, int]


def compare_managers(
    where: str, a: Mapping[int, SideManager], b: Mapping[int, SideManager]
) -> list[Change]:
    """Compare all sync managers of a SubDevice.

    Args:
        where: Name of the SubDevice.
        a: Its sync managers with process data in A, by number.
        b: The same in B.
    """
    changes: list[Change] = []
    for index in sorted(a.keys() | b.keys()):
        name = f"{where} SM{index}"
        old, new = a.get(index), b.get(index)
        if old is None or new is None:
            kind = ChangeKind.ADDED if old is None else ChangeKind.REMOVED
            sizes = [None if m is None or m.bits is None else _size(m.bits) for m in (old, new)]
            changes.append(
                Change(
                    kind=kind,
                    area=ChangeArea.SYNC_MANAGER,
                    where=name,
                    before=sizes[0],
                    after=sizes[1],
                )
            )
        else:
            changes += _manager(name, old, new)
    return changes


def _size(bits: int) -> str:
    return f"{bits // 8} bytes" if bits % 8 == 0 else f"{bits} bits"


def _manager(where: str, old: SideManager, new: SideManager) -> list[Change]:
    changes: list[Change] = []

    def changed(what: str, before: Fact, after: Fact) -> None:
        changes.append(
            Change(
                kind=ChangeKind.CHANGED,
                area=ChangeArea.SYNC_MANAGER,
                where=where,
                what=what,
                before=before,
                after=after,
            )
        )

    if old.direction != new.direction:
        changed("direction", old.direction, new.direction)
    if None not in (old.watchdog, new.watchdog) and old.watchdog != new.watchdog:
        changed("watchdog", old.watchdog, new.watchdog)
    if old.bits is not None and new.bits is not None and old.bits != new.bits:
        changed("size", _size(old.bits), _size(new.bits))
    if old.entries is None or new.entries is None:
        return changes
    frames, kept = _frames(where, old.frames, new.frames)
    return changes + frames + _entries(where, old.entries, new.entries, kept)


def _frames(
    where: str, a: Iterable[SideFrame], b: Iterable[SideFrame]
) -> tuple[list[Change], list[tuple[SideFrame, SideFrame]]]:
    """Return changes, and the frames both sides have."""
    left, right = {f.address: f for f in a}, {f.address: f for f in b}
    changes: list[Change] = []
    kept = []
    for address in dict.fromkeys([*left, *right]):
        old, new = left.get(address), right.get(address)
        name = f"{where} {address}"
        if old is None or new is None:
            kind = ChangeKind.ADDED if old is None else ChangeKind.REMOVED
            sizes = [None if f is None else f"{f.size_bytes} bytes" for f in (old, new)]
            changes.append(
                Change(
                    kind=kind, area=ChangeArea.FRAME, where=name, before=sizes[0], after=sizes[1]
                )
            )
            continue
        kept.append((old, new))
        for kind, what, before, after in (
            (ChangeKind.MOVED, "byte", old.byte, new.byte),
            (ChangeKind.CHANGED, "frame_bytes", old.size_bytes, new.size_bytes),
        ):
            if before != after:
                changes.append(
                    Change(
                        kind=kind,
                        area=ChangeArea.FRAME,
                        where=name,
                        what=what,
                        before=before,
                        after=after,
                    )
                )
    return changes, kept


def _keyed(entries: Iterable[SideEntry]) -> dict[_Key, SideEntry]:
    """Entries by address; the same address a second time is one of its own."""
    seen: dict[str, int] = {}
    rows: dict[_Key, SideEntry] = {}
    for entry in entries:
        number = seen.get(entry.address, 0)
        seen[entry.address] = number + 1
        rows[entry.address, number] = entry
    return rows


def _entries(
    where: str,
    a: Iterable[SideEntry],
    b: Iterable[SideEntry],
    frames: list[tuple[SideFrame, SideFrame]],
) -> list[Change]:
    left, right = _keyed(a), _keyed(b)
    follows = _followed(frames)
    moved: dict[int, list[str]] = {}
    changes: list[Change] = []

    def changed(address: str, what: str, before: Fact, after: Fact) -> None:
        changes.append(
            Change(
                kind=ChangeKind.CHANGED,
                area=ChangeArea.ENTRIES,
                where=where,
                what=what,
                before=before,
                after=after,
                entries=(address,),
            )
        )

    for key, old in left.items():
        new = right.get(key)
        if new is None:
            continue
        distance = new.bit - old.bit
        if distance and follows.get(old.bit // 8) != distance:
            moved.setdefault(distance, []).append(old.address)
        if old.bits != new.bits:
            changed(old.address, "bits", old.bits, new.bits)
        if None not in (old.restart, new.restart) and old.restart != new.restart:
            words = ["no", "yes"]
            changed(
                old.address,
                "restart_relevant",
                words[bool(old.restart)],
                words[bool(new.restart)],
            )
    for distance, addresses in moved.items():
        changes.append(
            Change(
                kind=ChangeKind.MOVED,
                area=ChangeArea.ENTRIES,
                where=where,
                what="bit",
                after=f"{distance:+d} bits",
                entries=tuple(addresses),
            )
        )
    for kind, order, other in (
        (ChangeKind.REMOVED, left, right),
        (ChangeKind.ADDED, right, left),
    ):
        if found := tuple(key[0] for key in order if key not in other):
            changes.append(Change(kind=kind, area=ChangeArea.ENTRIES, where=where, entries=found))
    return changes


def _followed(frames: list[tuple[SideFrame, SideFrame]]) -> dict[int, int]:
    """Return by how many bits each byte of a frame moved with it: said once, at the frame."""
    return {
        byte: 8 * (new.byte - old.byte)
        for old, new in frames
        if new.byte != old.byte
        for byte in range(old.byte, old.byte + old.size_bytes)
    }
