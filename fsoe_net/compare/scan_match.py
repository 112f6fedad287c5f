"""Matches the SubDevices of a network with those of a bus: in place, moved, or missing.

A missing SubDevice moves all following ones one position forward. Positions are therefore not
compared one by one: the two lists are aligned at the lowest cost, and each difference is named
once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields

from fsoe_net.diag.diagnostic import Span
from fsoe_net.model.bus import SubDevice
from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.scan import ScannedSubDevice

Identity = tuple[int, int]

_MOST_CELLS = 4_000_000
# Two exchanged devices (9) cost less than two wrong ones (20) or one missing and one added (16).
_ADDRESS, _FREE_TAKEN, _SMALL, _GONE, _SWAPPED, _OTHER = 1, 6, 3, 8, 9, 10


@dataclass(slots=True, kw_only=True)
class Match:
    """SubDevices of a network on a bus.

    Attributes:
        pairs: Same identity, even if found at another position.
        other: Another device at the position.
        swapped: Two SubDevices with exchanged positions, each with the position where it was found.
        moved: Found at another position; with its position in the network.
        missing: Not found; with its position, or ``None`` if its alias is not on the bus.
        free_missing: Empty free positions of the network (a coupler, say) that shift the following
            SubDevices.
        extra: On the bus but not in the network, with process data or between listed SubDevices.
        trailing: On the bus, without process data, after all SubDevices of the network.
        cost: Cost of the differences.
    """

    pairs: list[tuple[SubDevice, ScannedSubDevice]] = field(default_factory=list)
    other: list[tuple[SubDevice, ScannedSubDevice]] = field(default_factory=list)
    swapped: list[tuple[SubDevice, ScannedSubDevice, SubDevice, ScannedSubDevice]] = field(
        default_factory=list
    )
    moved: list[tuple[SubDevice, int, ScannedSubDevice]] = field(default_factory=list)
    missing: list[tuple[SubDevice, int | None]] = field(default_factory=list)
    free_missing: list[int] = field(default_factory=list)
    extra: list[ScannedSubDevice] = field(default_factory=list)
    trailing: list[ScannedSubDevice] = field(default_factory=list)
    cost: int = 0

    def take(self, sub: SubDevice, found: ScannedSubDevice) -> None:
        """Add the device found at the place of a SubDevice."""
        is_it = is_same(identity_of(sub), found.numbers)
        (self.pairs if is_it else self.other).append((sub, found))


@dataclass(frozen=True, slots=True)
class _Rows:
    """The two rows; ``None`` is a place that the network does not name."""

    planned: list[SubDevice | None]
    found: list[ScannedSubDevice]
    addresses: Mapping[str, int]
    by_alias: frozenset[int]

    def cost(self, sub: SubDevice | None, found: ScannedSubDevice) -> int:
        """Return the cost of matching the two."""
        if sub is None:
            return 0 if self.is_plain(found) else _FREE_TAKEN
        if not is_same(identity_of(sub), found.numbers):
            return _OTHER
        stated = self.addresses.get(sub.name)
        read = found.fsoe.addresses if found.fsoe is not None else ()
        return _ADDRESS if stated is not None and read and stated not in read else 0

    def is_plain(self, found: ScannedSubDevice) -> bool:
        """Whether the network may leave it unnamed."""
        return found.position in self.by_alias or not found.process_data


def identity_of(sub: SubDevice) -> Identity | None:
    """Return vendor and product of a SubDevice, if known."""
    return None if sub.device is None else sub.device.identity


def is_same(one: Identity | None, two: Identity | None) -> bool:
    """Whether two identities match; an unknown one matches any other."""
    return None in (one, two) or one == two


def place_of(sub: SubDevice) -> Span:
    """Return where the file of the user states the place of a SubDevice."""
    return sub.at("alias") if sub.alias else sub.at("position")


def first_master(network: NetworkConfig) -> list[SubDevice]:
    """Return the SubDevices of the EtherCAT master with the lowest number."""
    master = min((s.master_id for s in network.subdevices), default=0)
    return [s for s in network.subdevices if s.master_id == master]


def match_subdevices(
    subs: Sequence[SubDevice], bus: Sequence[ScannedSubDevice], addresses: Mapping[str, int]
) -> Match:
    """Match each SubDevice of a network with a bus.

    Args:
        subs: The expected SubDevices, of one master.
        bus: The SubDevices found, in ring order.
        addresses: Stated FSoE addresses by name: they distinguish devices of the same type.
    """
    match = Match()
    by_alias = _find_aliases([s for s in subs if s.alias], bus, match)
    places: dict[int, SubDevice] = {}
    for sub in subs:
        if not sub.alias:
            places.setdefault(sub.position, sub)
    size = max(places, default=-1) + 1
    rows = _Rows([places.get(n) for n in range(size)], list(bus), addresses, frozenset(by_alias))
    # Exchanged devices are cheapest when compared place by place. A missing one shifts all others,
    # which only the alignment finds. Its table has a cell for each pair, too many on a very large
    # bus.
    best = _in_place(rows)
    if best.cost and len(rows.planned) * len(rows.found) <= _MOST_CELLS:
        best = min(best, _aligned(rows), key=lambda m: m.cost)
    for part in fields(Match):
        setattr(match, part.name, getattr(match, part.name) + getattr(best, part.name))
    return match


def _find_aliases(subs: list[SubDevice], bus: Sequence[ScannedSubDevice], match: Match) -> set[int]:
    """Look up SubDevices by alias; return the positions where they were found."""
    first: dict[int, int] = {}
    for found in bus:
        if found.alias:
            first.setdefault(found.alias, found.position)
    taken: set[int] = set()
    for sub in subs:
        base = first.get(sub.alias)
        if base is None or base + sub.position >= len(bus):
            match.missing.append((sub, None if base is None else base + sub.position))
            continue
        found = bus[base + sub.position]
        taken.add(found.position)
        match.take(sub, found)
    return taken


def _in_place(rows: _Rows) -> Match:
    """Compare place by place; two that have each other's place count as swapped."""
    match = Match()
    wrong: list[int] = []
    for place, (sub, found) in enumerate(zip(rows.planned, rows.found, strict=False)):
        if rows.cost(sub, found) == _OTHER:
            wrong.append(place)
        else:
            _take(rows, match, sub, found)
    crossed: dict[object, list[int]] = {}
    for place in wrong:
        sub = rows.planned[place]
        own, there = sub and identity_of(sub), rows.found[place].numbers
        partners = crossed.get((there, own))
        if partners:
            _swap(rows, match, partners.pop(0), place)
        else:
            crossed.setdefault((own, there), []).append(place)
    for place in sorted(p for places in crossed.values() for p in places):
        sub = rows.planned[place]
        if sub is not None:
            match.other.append((sub, rows.found[place]))
            match.cost += _OTHER
    for place in range(len(rows.found), len(rows.planned)):
        _leave(match, rows.planned[place], place)
    for found in rows.found[len(rows.planned) :]:
        _add(rows, match, found)
    return match


def _swap(rows: _Rows, match: Match, one: int, two: int) -> None:
    a, b = rows.planned[one], rows.planned[two]
    if a is not None and b is not None:
        match.swapped.append((a, rows.found[two], b, rows.found[one]))
        match.pairs += [(a, rows.found[two]), (b, rows.found[one])]
        match.cost += _SWAPPED


def _take(rows: _Rows, match: Match, sub: SubDevice | None, found: ScannedSubDevice) -> None:
    match.cost += rows.cost(sub, found)
    if sub is None:
        if not rows.is_plain(found):
            match.extra.append(found)
    else:
        match.take(sub, found)


def _leave(match: Match, sub: SubDevice | None, place: int) -> None:
    match.cost += _SMALL if sub is None else _GONE
    if sub is None:
        match.free_missing.append(place)
    else:
        match.missing.append((sub, place))


def _add(rows: _Rows, match: Match, found: ScannedSubDevice) -> None:
    """Add an unlisted SubDevice; one without process data after all the others is harmless."""
    if found.position in rows.by_alias:
        return
    end = max((f.position for _, f in (*match.pairs, *match.other)), default=-1)
    if rows.is_plain(found) and (end < found.position or not any(rows.planned)):
        match.trailing.append(found)
        return
    match.cost += _SMALL if rows.is_plain(found) else _GONE
    match.extra.append(found)


# -- side by side ---------------------------------------------------------------------------------


def _aligned(rows: _Rows) -> Match:
    """Align the rows at the lowest cost."""
    match = Match()
    taken, gone, added = _steps(rows)
    for place, found in taken:
        _take(rows, match, rows.planned[place], found)
    for place in gone:
        sub = rows.planned[place]
        there = next((f for f in added if sub and is_same(identity_of(sub), f.numbers)), None)
        if sub is None or there is None:
            _leave(match, sub, place)
            continue
        added.remove(there)
        match.moved.append((sub, place, there))
        match.pairs.append((sub, there))
        match.cost += _OTHER
    for found in added:
        _add(rows, match, found)
    return match


def _steps(
    rows: _Rows,
) -> tuple[list[tuple[int, ScannedSubDevice]], list[int], list[ScannedSubDevice]]:
    """Return the cheapest alignment: matched places, and what is unmatched on each side."""
    lost = [_SMALL if s is None else _GONE for s in rows.planned]
    extra = [_SMALL if rows.is_plain(f) else _GONE for f in rows.found]
    width, costs = len(rows.found), _costs(rows, lost, extra)
    taken, gone, added = [], [], []
    i = j = 0
    while i < len(rows.planned) or j < width:
        sub = rows.planned[i] if i < len(rows.planned) else None
        is_planned, is_found = i < len(rows.planned), j < width
        if (
            is_planned
            and is_found
            and costs[i][j] == costs[i + 1][j + 1] + rows.cost(sub, rows.found[j])
        ):
            taken.append((i, rows.found[j]))
            i, j = i + 1, j + 1
        elif is_planned and costs[i][j] == costs[i + 1][j] + lost[i]:
            gone.append(i)
            i += 1
        else:
            added.append(rows.found[j])
            j += 1
    return taken, gone, added


def _costs(rows: _Rows, lost: list[int], extra: list[int]) -> list[list[int]]:
    """Return the lowest cost from place i and number j to the end, as ``costs[i][j]``."""
    width = len(rows.found)
    costs = [[0] * (width + 1) for _ in range(len(rows.planned) + 1)]
    for j in range(width - 1, -1, -1):
        costs[-1][j] = costs[-1][j + 1] + extra[j]
    for i in range(len(rows.planned) - 1, -1, -1):
        row, below = costs[i], costs[i + 1]
        row[width] = below[width] + lost[i]
        for j in range(width - 1, -1, -1):
            both = below[j + 1] + rows.cost(rows.planned[i], rows.found[j])
            row[j] = min(both, below[j] + lost[i], row[j + 1] + extra[j])
    return costs
