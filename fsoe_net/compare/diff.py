"""Semantic comparison of two descriptions or plans: moved, added, removed, changed, exchanged.

SubDevices are paired by name, then by place and identity, then by identity in order, then by place
(an exchanged device). Entries are identified by their address, which distinguishes moved data from
added and removed data. Facts that are missing on one side are not compared, and are listed as such.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from fsoe_net.compare.diff_process_data import compare_managers
from fsoe_net.compare.diff_safety import compare_functions
from fsoe_net.compare.diff_types import (
    Change,
    ChangeArea,
    ChangeKind,
    changed_facts,
    changed_part,
    size_text,
)
from fsoe_net.compare.pairing import attributes, pair_by
from fsoe_net.compare.sides import Sdos, Side, SideCopy, SideEnd, SideSubDevice
from fsoe_net.diag.words import counted
from fsoe_net.document.model import Document, Level, Verdict, words
from fsoe_net.model.description import DescribedConnection

_LEVELS = {ChangeKind.ADDED: Level.CLEAR, ChangeKind.REMOVED: Level.ERROR}
_Pairs = list[tuple[int | None, int | None]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """The differences. ``not_compared``: facts that only one side has, in words."""

    changes: tuple[Change, ...]
    not_compared: tuple[str, ...]

    @property
    def same(self) -> bool:
        """Whether the comparable parts are equal."""
        return not self.changes


def compare(a: Side, b: Side) -> Difference:
    """Compare two sides; a pure function, linear in their size."""
    pairs = _pair_subdevices(a.subdevices, b.subdevices)
    found = _Comparison(a, b, pairs)
    return Difference(changes=tuple(found.changes()), not_compared=tuple(found.not_compared()))


def _pair_subdevices(a: tuple[SideSubDevice, ...], b: tuple[SideSubDevice, ...]) -> _Pairs:
    left, right = dict(enumerate(a)), dict(enumerate(b))
    # Users choose names, so a renamed SubDevice is a new one only if nothing else matches.
    pairs = pair_by(lambda s: s.name or None, left, right, unique=True)
    pairs += pair_by(
        lambda s: None if s.identity is None else (s.place, s.identity), left, right, unique=True
    )
    pairs += pair_by(lambda s: s.identity, left, right)
    pairs += pair_by(lambda s: s.place, left, right, unique=True)
    # Nothing else is known about these: their order decides.
    pairs += pair_by(lambda s: s.place is s.identity is None or None, left, right)
    if len(left) == len(right) == 1:  # one device on each side
        (one, old), (two, new) = *left.items(), *right.items()
        if any(s.identity is None or s.place is None for s in (old, new)):
            pairs.append((one, two))
            left, right = {}, {}
    in_a: _Pairs = [*pairs, *((n, None) for n in left)]
    in_a.sort(key=lambda pair: pair[0] or 0)
    return in_a + [(None, n) for n in right]


class _Comparison:
    """Two sides whose SubDevices are paired.

    A SubDevice of B has the number of its partner in A; without a partner, a number after all of A.
    """

    def __init__(self, a: Side, b: Side, pairs: _Pairs) -> None:
        self.a, self.b, self.pairs = a, b, pairs
        self.whole = a.whole and b.whole
        self.subdevices = (*a.subdevices, *b.subdevices)
        first = len(a.subdevices)
        self.numbers = {
            right: first + right if left is None else left
            for left, right in pairs
            if right is not None
        }

    def changes(self) -> Iterator[Change]:
        """Yield all differences: the network, SubDevices, copies, connections, functions."""
        a, b = self.a, self.b
        cycle = ("cycle_ns", a.cycle_ns, b.cycle_ns)
        yield from changed_facts(ChangeArea.NETWORK, "", cycle, whole=self.whole)
        for name, cycle_ns in a.bus_cycles.items():
            if name in b.bus_cycles:
                cycle = ("cycle_ns", cycle_ns, b.bus_cycles[name])
                yield from changed_facts(ChangeArea.NETWORK, f"bus {name}", cycle, whole=True)
        yield from self._subdevices()
        if a.copies is not None and b.copies is not None:
            yield from self._copies(a.copies, [self._renumbered(c) for c in b.copies])
        if a.connections is not None and b.connections is not None:
            yield from self._connections(a.connections, b.connections)
        yield from self._functions()

    # -- SubDevices -------------------------------------------------------------------------------

    def _subdevices(self) -> Iterator[Change]:
        for left, right in self.pairs:
            old = None if left is None else self.a.subdevices[left]
            new = None if right is None else self.b.subdevices[right]
            if old is not None and new is not None:
                names = tuple(dict.fromkeys((old.name, new.name)))
                for change in self._subdevice(old, new):
                    yield replace(change, subdevices=names)
            elif (alone := old or new) is not None:
                yield changed_part(
                    ChangeArea.SUBDEVICE,
                    alone.title,
                    old,
                    new,
                    lambda s: s.identity_text,
                    subdevices=(alone.name,),
                )

    def _subdevice(self, old: SideSubDevice, new: SideSubDevice) -> Iterator[Change]:
        area, where = ChangeArea.SUBDEVICE, old.title
        if None not in (old.identity, new.identity) and old.identity != new.identity:
            words = old.identity_text, new.identity_text
            yield Change(ChangeKind.EXCHANGED, area, where, "", *words)
        if self.whole:
            yield from changed_facts(area, where, ("name", old.name, new.name))
        yield from changed_facts(
            area,
            where,
            ("revision", old.revision, new.revision),
            ("alias", old.alias, new.alias),
            whole=self.whole,
        )
        # Positions count from the alias, so they compare only where it is the same.
        both_placed = None not in (old.position, new.position)
        if both_placed and (old.alias or 0) == (new.alias or 0) and old.position != new.position:
            places = old.position, new.position
            yield Change(ChangeKind.MOVED, area, where, "position", *places)
        if old.managers is not None and new.managers is not None:
            stated = self.a.whole, self.b.whole
            yield from compare_managers(where, old.managers, new.managers, stated)
        if old.sdos is not None and new.sdos is not None:
            yield from _sdos(where, old.sdos, new.sdos)
        # Otherwise the addresses are compared with the connections.
        if self.a.connections is None or self.b.connections is None:
            before, after = _sorted_text(old.fsoe_addresses), _sorted_text(new.fsoe_addresses)
            yield from changed_facts(area, where, ("fsoe_addresses", before, after))

    # -- copies -----------------------------------------------------------------------------------

    def _renumbered(self, copy: SideCopy) -> SideCopy:
        source, destination = (
            end if end.subdevice is None else replace(end, subdevice=self.numbers[end.subdevice])
            for end in (copy.source, copy.destination)
        )
        return replace(copy, source=source, destination=destination)

    def _copies(self, a: Iterable[SideCopy], b: Iterable[SideCopy]) -> Iterator[Change]:
        # An output has one writer, so copies to one destination are the same copy in A and B.
        destinations: dict[SideEnd, tuple[list[SideCopy], list[SideCopy]]] = {}
        for side, copies in enumerate((a, b)):
            for copy in copies:
                destinations.setdefault(copy.destination, ([], []))[side].append(copy)
        for olds, news in destinations.values():
            left, right = dict(enumerate(olds)), dict(enumerate(news))
            pairs = pair_by(lambda c: c.source, left, right)
            pairs += pair_by(lambda _: True, left, right, unique=True)  # from another source
            for one, two in sorted(pairs):
                yield from self._copy(olds[one], news[two])
            for copy in left.values():
                yield self._lone_copy(copy, copy, None)
            for copy in right.values():
                yield self._lone_copy(copy, None, copy)

    def _copy(self, old: SideCopy, new: SideCopy) -> Iterator[Change]:
        area, where, names = ChangeArea.COPY, self._arrow(old), self._ends(old, new)
        if old.source != new.source:  # two SubDevices may have the same title
            texts = self._end(old.source), self._end(new.source)
            yield Change(ChangeKind.CHANGED, area, where, "source", *texts, (), names)
        yield from changed_facts(
            area,
            where,
            ("size", size_text(old.bits), size_text(new.bits)),
            ("kind", old.kind, new.kind),
            ("net", old.net, new.net),
            subdevices=names,
        )

    def _lone_copy(self, copy: SideCopy, old: SideCopy | None, new: SideCopy | None) -> Change:
        where, names = self._arrow(copy), self._ends(copy)
        return changed_part(
            ChangeArea.COPY, where, old, new, lambda c: size_text(c.bits), subdevices=names
        )

    def _ends(self, *copies: SideCopy) -> tuple[str, ...]:
        ends = (end for copy in copies for end in (copy.source, copy.destination))
        return self._names(*(end.subdevice for end in ends))

    def _end(self, end: SideEnd) -> str:
        place = "" if end.subdevice is None else f"{self._title(end.subdevice)} "
        return f"{place}{end.address}"

    def _arrow(self, copy: SideCopy) -> str:
        return f"{self._end(copy.source)} -> {self._end(copy.destination)}"

    # -- connections ------------------------------------------------------------------------------

    def _connections(
        self, a: Iterable[DescribedConnection], b: Iterable[DescribedConnection]
    ) -> Iterator[Change]:
        left = dict(enumerate(a))
        right = {
            number: replace(c, main=self._number(c.main), sub=self._number(c.sub))
            for number, c in enumerate(b)
        }
        olds, news = dict(left), dict(right)
        # Two SubDevices identify a connection only if it is the only one between them on both
        # sides.
        single = _single(left.values()) & _single(right.values())
        for key in (
            lambda c: None if None in (c.main, c.sub) else (c.main, c.sub, c.slot),
            lambda c: (c.name, c.slot) if c.name and c.main is c.sub is None else None,
            attributes("sub", "address"),
            attributes("main", "connection_id"),
            lambda c: c.connection_id,
            lambda c: (c.main, c.sub) if (c.main, c.sub) in single else None,
        ):
            for one, two in pair_by(key, left, right):
                yield from self._connection(olds[one], news[two])
        for kind, rows in ((ChangeKind.REMOVED, left), (ChangeKind.ADDED, right)):
            for c in rows.values():
                where, names = self._connection_name(c), self._names(c.main, c.sub)
                yield Change(kind, ChangeArea.CONNECTION, where, subdevices=names)

    def _number(self, number: int | None) -> int | None:
        return None if number is None else self.numbers.get(number)

    def _connection(self, old: DescribedConnection, new: DescribedConnection) -> Iterator[Change]:
        where = self._connection_name(old)
        names = self._names(old.main, old.sub, new.main, new.sub)
        for role, before, after in (("main", old.main, new.main), ("sub", old.sub, new.sub)):
            if None not in (before, after) and before != after:
                kind, area = ChangeKind.CHANGED, ChangeArea.CONNECTION
                titles = self._title(before), self._title(after)
                yield Change(kind, area, where, role, *titles, (), names)
        yield from changed_facts(
            ChangeArea.CONNECTION,
            where,
            ("address", old.address, new.address),
            ("connection_id", old.connection_id, new.connection_id),
            ("watchdog_ms", old.watchdog_ms, new.watchdog_ms),
            ("app_parameters", _parameters(self.a, old), _parameters(self.b, new)),
            whole=self.whole,
            subdevices=names,
        )

    def _connection_name(self, c: DescribedConnection) -> str:
        slot = f" slot {c.slot}" if c.slot else ""
        if c.main is None and c.sub is None and c.name:
            return f"{c.name}{slot}"
        return f"{self._title(c.main)} - {self._title(c.sub)}{slot}"

    # -- the rest ---------------------------------------------------------------------------------

    def _functions(self) -> Iterable[Change]:
        a, b = self.a, self.b
        if a.functions is not None and b.functions is not None:
            return compare_functions(a.functions, b.functions)
        if a.functions_sha256 is None or b.functions_sha256 is None:
            return ()
        hashes = ("SHA-256 of all", a.functions_sha256 or None, b.functions_sha256 or None)
        return changed_facts(ChangeArea.SAFETY_FUNCTION, "", hashes, whole=True)

    def _title(self, number: int | None) -> str:
        return "?" if number is None else self.subdevices[number].title

    def _names(self, *numbers: int | None) -> tuple[str, ...]:
        names = ("" if n is None else self.subdevices[n].name for n in numbers)
        return tuple(dict.fromkeys(names))

    def not_compared(self) -> Iterator[str]:
        """Yield the facts that only one side states, in words."""
        a, b = self.a, self.b
        for what, left, right in (
            ("copies", a.copies, b.copies),
            ("FSoE connections", a.connections, b.connections),
            ("the bus cycle", a.cycle_ns, b.cycle_ns),
        ):
            if (left is None) != (right is None) and not self.whole:
                yield _silent(what, a if left is None else b)
        for side, other in ((a, b), (b, a)):
            if side.functions_sha256 is None and other.functions_sha256:
                yield _silent("safety functions", side)
        unread = sum(
            left is not None
            and right is not None
            and None in (a.subdevices[left].managers, b.subdevices[right].managers)
            for left, right in self.pairs
        )
        if unread:
            yield f"process data of SubDevices that one side does not know: {unread}"


def _silent(what: str, side: Side) -> str:
    return f"{what}: {side.path} ({side.format}) does not contain them"


def _sdos(where: str, old: Sdos, new: Sdos) -> Iterator[Change]:
    for key in sorted(old.keys() | new.keys()):
        before, after = old.get(key), new.get(key)
        if before != after:
            address = f"0x{key[0]:04x}:{key[1]:02x}"
            yield changed_part(ChangeArea.SDO, where, before, after, _sdo_text, address)


def _sdo_text(sdo: tuple[int, int]) -> str:
    return f"{sdo[1]} ({sdo[0]} bytes)"


def _sorted_text(numbers: tuple[int, ...] | None) -> str | None:
    return None if numbers is None else ", ".join(map(str, sorted(set(numbers))))


def _single(rows: Iterable[DescribedConnection]) -> set[tuple[int | None, int | None]]:
    """Return the pairs of SubDevices with one connection between them, whatever its slot."""
    counts = Counter((c.main, c.sub) for c in rows if None not in (c.main, c.sub))
    return {pair for pair, count in counts.items() if count == 1}


def _parameters(side: Side, connection: DescribedConnection) -> str | None:
    """Return the parameters; ``None`` if there are none and the side may simply not state them."""
    return connection.app_parameters.hex() or ("" if side.whole else None)


def diff_document(a: Side, b: Side, difference: Difference) -> Document:
    """Return the result of `fsoe-net diff` for two sides."""
    rows: list[str | Verdict] = [
        f"{name}: {side.path} ({side.format}), {counted(len(side.subdevices), 'SubDevice')}"
        for name, side in (("A", a), ("B", b))
    ]
    rows += [Verdict(str(c), _LEVELS.get(c.kind, Level.WARNING)) for c in difference.changes]
    rows += [f"not compared: {text}" for text in difference.not_compared]
    count = len(difference.changes)
    rows.append(counted(count, "difference") if count else "no difference")
    return Document(lead=tuple(words(row) for row in rows))
