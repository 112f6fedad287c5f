"""Semantic comparison of two descriptions or plans: moved, added, removed, changed, exchanged.

SubDevices are paired by name, then by place and identity, then by identity in order, then by place
(an exchanged device). Entries are followed by their address, so that data which merely moved are
kept apart from data that came and went. Facts that one side does not have are not compared, and
said so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, replace
from typing import TypeVar

from fsoe_net.compare.diff_process_data import compare_managers
from fsoe_net.compare.diff_safety import compare_functions
from fsoe_net.compare.diff_side import (
    Side,
    SideCopy,
    SideEnd,
    SideSubDevice,
)
from fsoe_net.compare.diff_types import Change, ChangeArea, ChangeKind, Fact
from fsoe_net.model.description import DescribedConnection

_FACTS = ("address", "connection_id", "watchdog_ms")
_T = TypeVar("_T")
_K = TypeVar("_K", bound=Hashable)


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """What differs. ``not_compared``: facts that only one side has, in words."""

    changes: tuple[Change, ...]
    not_compared: tuple[str, ...]

    @property
    def same(self) -> bool:
        """Whether the comparable parts are equal."""
        return not self.changes


def compare(a: Side, b: Side) -> Difference:
    """Compare two sides; a pure function, linear in their size."""
    pairs = _pair_subdevices(a.subdevices, b.subdevices)
    changes: list[Change] = []
    if a.cycle_ns != b.cycle_ns and _told(a.cycle_ns, b.cycle_ns, a, b):
        changes.append(_changed(ChangeArea.NETWORK, "", "cycle_ns", a.cycle_ns, b.cycle_ns))
    for left, right in pairs:
        changes += _subdevice(a, b, left, right)
    # From here on, SubDevices of B have the numbers of their partners in A.
    renumber = {right: left for left, right in pairs if left is not None and right is not None}
    for left, right in pairs:
        if left is None and right is not None:
            renumber[right] = len(a.subdevices) + right
    label = _Labels(a, b, renumber)
    if a.copies is not None and b.copies is not None:
        moved = [_renumbered(c, renumber) for c in b.copies]
        changes += _copies(a.copies, moved, label)
    if a.connections is not None and b.connections is not None:
        changes += _connections(a, b, renumber, label)
    changes += _functions(a, b)
    return Difference(changes=tuple(changes), not_compared=tuple(_silence(a, b, pairs)))


_Pairs = list[tuple[int | None, int | None]]


def _functions(a: Side, b: Side) -> list[Change]:
    if a.functions is not None and b.functions is not None:
        return compare_functions(a.functions, b.functions)
    before, after = a.functions_sha256, b.functions_sha256
    if before is None or after is None or before == after:
        return []
    return [
        _changed(ChangeArea.SAFETY_FUNCTION, "", "SHA-256 of all", before or None, after or None)
    ]


def _pair_subdevices(a: tuple[SideSubDevice, ...], b: tuple[SideSubDevice, ...]) -> _Pairs:
    left = dict(enumerate(a))
    right = dict(enumerate(b))
    pairs: list[tuple[int, int]] = []

    def by(key: Callable[[SideSubDevice], Hashable | None], *, unique: bool) -> None:
        waiting: dict[Hashable, list[int]] = {}
        for n, sub in right.items():
            if (k := key(sub)) is not None:
                waiting.setdefault(k, []).append(n)
        counts = Counter(key(sub) for sub in left.values())
        taken: dict[Hashable, int] = {}
        for n, sub in list(left.items()):
            k = key(sub)
            row = waiting.get(k, []) if k is not None else []
            used = taken.get(k, 0)
            if used >= len(row) or (unique and (len(row) > 1 or counts[k] > 1)):
                continue
            taken[k] = used + 1
            pairs.append((n, row[used]))
            del left[n], right[row[used]]

    by(lambda s: s.name or None, unique=True)
    by(lambda s: None if s.identity is None else (_place(s), s.identity), unique=True)
    by(lambda s: s.identity, unique=False)
    by(_place, unique=True)
    by(lambda s: _place(s) is s.identity is None or None, unique=False)  # nothing known: in order
    if len(left) == len(right) == 1:  # one device type against one device
        one, two = next(iter(left)), next(iter(right))
        subs = a[one], b[two]
        if any(s.identity is None or _place(s) is None for s in subs):
            pairs.append((one, two))
            left, right = {}, {}
    known: _Pairs = [*pairs, *((n, None) for n in left)]
    known.sort(key=lambda pair: pair[0] or 0)
    return known + [(None, n) for n in right]


def _place(sub: SideSubDevice) -> tuple[int, int] | None:
    return None if sub.position is None else (sub.alias or 0, sub.position)


def _title(sub: SideSubDevice) -> str:
    if sub.name:
        return sub.name
    return f"position {sub.position}" if sub.position is not None else "unnamed SubDevice"


def _identity(sub: SideSubDevice) -> str | None:
    if sub.identity is None:
        return None
    return f"vendor 0x{sub.identity[0]:08x}, product 0x{sub.identity[1]:08x}"


def _changed(area: ChangeArea, where: str, what: str, before: Fact, after: Fact) -> Change:
    return Change(
        kind=ChangeKind.CHANGED, area=area, where=where, what=what, before=before, after=after
    )


def _differ(before: object, after: object) -> bool:
    """Whether both sides state a value, and the values differ."""
    return before is not None and after is not None and before != after


def _told(before: object, after: object, a: Side, b: Side) -> bool:
    """Whether both sides speak about a fact; in two whole ones ``None`` means *not set*."""
    return (before is not None and after is not None) or (a.whole and b.whole)


def _about(changes: Iterable[Change], names: Iterable[str]) -> list[Change]:
    """Return the changes with the names of the SubDevices that they are about."""
    subdevices = tuple(dict.fromkeys(names))
    return [replace(change, subdevices=subdevices) for change in changes]


def _subdevice(a: Side, b: Side, left: int | None, right: int | None) -> list[Change]:
    if left is None or right is None:
        return [_lone(a, b, left, right)]
    old, new = a.subdevices[left], b.subdevices[right]
    return _about(_both(a, b, old, new), (old.name, new.name))


def _both(a: Side, b: Side, old: SideSubDevice, new: SideSubDevice) -> list[Change]:
    where = _title(old)
    changes: list[Change] = []
    if _differ(old.identity, new.identity):
        changes.append(
            Change(
                kind=ChangeKind.EXCHANGED,
                area=ChangeArea.SUBDEVICE,
                where=where,
                before=_identity(old),
                after=_identity(new),
            )
        )
    if old.name != new.name and a.whole and b.whole:
        changes.append(_changed(ChangeArea.SUBDEVICE, where, "name", old.name, new.name))
    if old.revision != new.revision and _told(old.revision, new.revision, a, b):
        changes.append(
            _changed(ChangeArea.SUBDEVICE, where, "revision", old.revision, new.revision)
        )
    changes += _moved(where, old, new)
    if old.managers is not None and new.managers is not None:
        changes += compare_managers(where, old.managers, new.managers)
    changes += _sdos(where, old, new)
    if a.connections is None or b.connections is None:
        changes += _addresses(where, old.fsoe_addresses, new.fsoe_addresses)
    return changes


def _lone(a: Side, b: Side, left: int | None, right: int | None) -> Change:
    """Return the change of a SubDevice that one side has alone."""
    if left is not None:
        sub = a.subdevices[left]
        return Change(
            kind=ChangeKind.REMOVED,
            area=ChangeArea.SUBDEVICE,
            where=_title(sub),
            before=_identity(sub),
            subdevices=(sub.name,),
        )
    sub = b.subdevices[right or 0]
    return Change(
        kind=ChangeKind.ADDED,
        area=ChangeArea.SUBDEVICE,
        where=_title(sub),
        after=_identity(sub),
        subdevices=(sub.name,),
    )


def _addresses(
    where: str, old: tuple[int, ...] | None, new: tuple[int, ...] | None
) -> list[Change]:
    if old is None or new is None or set(old) == set(new):
        return []
    before, after = (", ".join(map(str, sorted(numbers))) for numbers in (old, new))
    return [_changed(ChangeArea.SUBDEVICE, where, "fsoe_addresses", before, after)]


def _moved(where: str, old: SideSubDevice, new: SideSubDevice) -> list[Change]:
    changes = []
    if _differ(old.alias, new.alias):
        changes.append(_changed(ChangeArea.SUBDEVICE, where, "alias", old.alias, new.alias))
    comparable = (old.alias or 0) == (new.alias or 0)
    if comparable and _differ(old.position, new.position):
        changes.append(
            Change(
                kind=ChangeKind.MOVED,
                area=ChangeArea.SUBDEVICE,
                where=where,
                what="position",
                before=old.position,
                after=new.position,
            )
        )
    return changes


def _sdos(where: str, old: SideSubDevice, new: SideSubDevice) -> list[Change]:
    if old.sdos is None or new.sdos is None:
        return []
    changes = []
    for key in sorted(old.sdos.keys() | new.sdos.keys()):
        before, after = old.sdos.get(key), new.sdos.get(key)
        if before == after:
            continue
        kind = ChangeKind.CHANGED
        if before is None:
            kind = ChangeKind.ADDED
        elif after is None:
            kind = ChangeKind.REMOVED
        texts = [None if v is None else f"{v[1]} ({v[0]} bytes)" for v in (before, after)]
        changes.append(
            Change(
                kind=kind,
                area=ChangeArea.SDO,
                where=where,
                what=f"0x{key[0]:04x}:{key[1]:02x}",
                before=texts[0],
                after=texts[1],
            )
        )
    return changes


class _Labels:
    """Names of SubDevices by number of A; those only in B follow."""

    def __init__(self, a: Side, b: Side, renumber: dict[int, int]) -> None:
        self._rows = dict(enumerate(a.subdevices))
        for right, number in renumber.items():
            self._rows.setdefault(number, b.subdevices[right])

    def of(self, number: int | None) -> str:
        return _title(self._rows[number]) if number in self._rows else "?"

    def names(self, *numbers: int | None) -> list[str]:
        return [self._rows[n].name if n in self._rows else "" for n in numbers]

    def of_copies(self, *copies: SideCopy) -> list[str]:
        ends = [end for copy in copies for end in (copy.source, copy.destination)]
        return self.names(*(end.subdevice for end in ends))

    def end(self, end: SideEnd) -> str:
        if end.subdevice is None:
            return end.address
        return f"{self.of(end.subdevice)} {end.place[1]}"


def _renumbered(copy: SideCopy, numbers: dict[int, int]) -> SideCopy:
    source, destination = (
        e if e.subdevice is None else replace(e, subdevice=numbers[e.subdevice])
        for e in (copy.source, copy.destination)
    )
    return replace(copy, source=source, destination=destination)


def _groups(rows: Iterable[_T], key: Callable[[_T], _K]) -> dict[_K, list[_T]]:
    groups: dict[_K, list[_T]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


def _copies(a: Iterable[SideCopy], b: Iterable[SideCopy], label: _Labels) -> list[Change]:
    changes: list[Change] = []
    left = _groups(a, lambda c: c.destination.place)
    right = _groups(b, lambda c: c.destination.place)
    for place in dict.fromkeys([*left, *right]):
        old, new = left.get(place, []), right.get(place, [])
        for before in list(old):
            after = next((c for c in new if c.source.place == before.source.place), None)
            if after is None and len(old) == len(new) == 1:
                after = new[0]
            if after is not None:
                changes += _about(_copy(before, after, label), label.of_copies(before, after))
                old.remove(before)
                new.remove(after)
        changes += [_copy_row(ChangeKind.REMOVED, c, label) for c in old]
        changes += [_copy_row(ChangeKind.ADDED, c, label) for c in new]
    return changes


def _copy_row(kind: ChangeKind, copy: SideCopy, label: _Labels) -> Change:
    size = _size(copy.bits)
    before, after = (size, None) if kind is ChangeKind.REMOVED else (None, size)
    return Change(
        kind=kind,
        area=ChangeArea.COPY,
        where=_arrow(copy, label),
        before=before,
        after=after,
        subdevices=tuple(dict.fromkeys(label.of_copies(copy))),
    )


def _arrow(copy: SideCopy, label: _Labels) -> str:
    return f"{label.end(copy.source)} -> {label.end(copy.destination)}"


def _size(bits: int) -> str:
    return f"{bits // 8} bytes" if bits % 8 == 0 else f"{bits} bits"


def _copy(old: SideCopy, new: SideCopy, label: _Labels) -> list[Change]:
    where = _arrow(old, label)
    changes = []
    if old.source.place != new.source.place:
        texts = label.end(old.source), label.end(new.source)
        changes.append(_changed(ChangeArea.COPY, where, "source", *texts))
    if old.bits != new.bits:
        changes.append(_changed(ChangeArea.COPY, where, "size", _size(old.bits), _size(new.bits)))
    if _differ(old.kind, new.kind):
        changes.append(_changed(ChangeArea.COPY, where, "kind", old.kind, new.kind))
    if _differ(old.net, new.net):
        changes.append(_changed(ChangeArea.COPY, where, "net", old.net, new.net))
    return changes


def _connections(a: Side, b: Side, numbers: dict[int, int], label: _Labels) -> list[Change]:
    left = dict(enumerate(a.connections or ()))
    right = {
        n: replace(
            c,
            main=None if c.main is None else numbers.get(c.main),
            sub=None if c.sub is None else numbers.get(c.sub),
        )
        for n, c in enumerate(b.connections or ())
    }
    alone = _lone_pairs(left.values()) & _lone_pairs(right.values())
    changes: list[Change] = []
    for key in _ways_to_match(alone):
        waiting = {k: n for n, c in right.items() if (k := key(c)) is not None}
        for n, old in list(left.items()):
            k = key(old)
            partner = waiting.pop(k, None) if k is not None else None
            if partner is None:
                continue
            new = right.pop(partner)
            del left[n]
            names = label.names(old.main, old.sub, new.main, new.sub)
            changes += _about(_connection(a, b, old, new, label), names)
    changes += [_connection_row(ChangeKind.REMOVED, c, label) for c in left.values()]
    changes += [_connection_row(ChangeKind.ADDED, c, label) for c in right.values()]
    return changes


def _ways_to_match(
    alone: set[tuple[int | None, int | None]],
) -> tuple[Callable[[DescribedConnection], Hashable | None], ...]:
    """Return the keys that match connections of both sides, the most reliable first."""
    return (
        lambda c: None if None in (c.main, c.sub) else (c.main, c.sub, c.slot),
        lambda c: (c.name, c.slot) if c.name and c.main is c.sub is None else None,
        lambda c: _pair_key(c.sub, c.address),
        lambda c: _pair_key(c.main, c.connection_id),
        lambda c: c.connection_id,
        lambda c: (c.main, c.sub) if (c.main, c.sub) in alone else None,
    )


def _lone_pairs(rows: Iterable[DescribedConnection]) -> set[tuple[int | None, int | None]]:
    """Return the SubDevices with one connection between them, whatever its slot."""
    counts = Counter((c.main, c.sub) for c in rows if None not in (c.main, c.sub))
    return {pair for pair, count in counts.items() if count == 1}


def _pair_key(number: int | None, fact: Fact) -> Hashable | None:
    return None if number is None or fact is None else (number, fact)


def _connection_name(c: DescribedConnection, label: _Labels) -> str:
    slot = f" slot {c.slot}" if c.slot else ""
    if c.main is None and c.sub is None and c.name:
        return f"{c.name}{slot}"
    return f"{label.of(c.main)} - {label.of(c.sub)}{slot}"


def _connection_row(kind: ChangeKind, c: DescribedConnection, label: _Labels) -> Change:
    return Change(
        kind=kind,
        area=ChangeArea.CONNECTION,
        where=_connection_name(c, label),
        subdevices=tuple(dict.fromkeys(label.names(c.main, c.sub))),
    )


def _connection(
    a: Side, b: Side, old: DescribedConnection, new: DescribedConnection, label: _Labels
) -> list[Change]:
    where = _connection_name(old, label)
    changes = []
    for role in ("main", "sub"):
        before, after = getattr(old, role), getattr(new, role)
        if None not in (before, after) and before != after:
            texts = label.of(before), label.of(after)
            changes.append(_changed(ChangeArea.CONNECTION, where, role, *texts))
    facts = [(key, getattr(old, key), getattr(new, key)) for key in _FACTS]
    if "plan" not in (a.format, b.format):  # which has no parameters
        facts.append(("app_parameters", _parameters(a, old), _parameters(b, new)))
    for fact, first, second in facts:
        if first != second and _told(first, second, a, b):
            changes.append(_changed(ChangeArea.CONNECTION, where, fact, first, second))
    return changes


def _parameters(side: Side, connection: DescribedConnection) -> str | None:
    """Return the parameters; without any ``None`` when the side may only be silent about them."""
    return connection.app_parameters.hex() or ("" if side.whole else None)


def _silence(a: Side, b: Side, pairs: _Pairs) -> list[str]:
    """Return facts that only one side states."""
    words = []
    for what, left, right in (
        ("copies", a.copies, b.copies),
        ("FSoE connections", a.connections, b.connections),
        ("the bus cycle", a.cycle_ns, b.cycle_ns),
    ):
        if (left is None) != (right is None) and not (a.whole and b.whole):
            silent = a if left is None else b
            words.append(f"{what}: {silent.path} ({silent.format}) does not contain them")
    for side, other in ((a, b), (b, a)):
        if side.functions_sha256 is None and other.functions_sha256:
            words.append(f"safety functions: {side.path} ({side.format}) does not contain them")
    unread = 0
    for left_number, right_number in pairs:
        if left_number is not None and right_number is not None:
            old, new = a.subdevices[left_number], b.subdevices[right_number]
            unread += (old.managers is None) or (new.managers is None)
    if unread:
        words.append(f"process data of SubDevices that one side does not know: {unread}")
    return words
