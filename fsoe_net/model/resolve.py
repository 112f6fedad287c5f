"""From names to bytes: which block of which sync manager each end of a transfer means.

Pure functions on the model; rules turn what does not resolve into diagnostics, the plan takes what
does.
"""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.diag.pause import without_collector
from fsoe_net.model.bus import Direction, SubDevice
from fsoe_net.model.ends import Finder, Layouts, ResolvedEnd, ResolvedTransfer
from fsoe_net.model.expand import ConnectionTrouble, Obstacle, expand
from fsoe_net.model.layout import DeviceLayout
from fsoe_net.model.network import ConnectionFacts, Net, NetworkConfig, TransferKind
from fsoe_net.model.slots import frame_pairs, slot_numbers

__all__ = [
    "Connection",
    "Resolution",
    "UnmatchedFacts",
    "main_instance_of",
    "partner_block",
    "resolve",
    "shared_modules",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Connection:
    """Two FSoE transfers in opposite directions between a MainInstance and a SubInstance.

    ``slot`` and ``sub_slot`` number the frame pairs it uses (`frame_pairs`); ``None`` where a frame
    is not recognised, or both directions use different pairs. ``made``: from a shorthand.
    """

    name: str
    net: Net
    main: SubDevice
    sub: SubDevice
    slot: int | None
    sub_slot: int | None
    to_sub: ResolvedTransfer
    to_main: ResolvedTransfer
    facts: ConnectionFacts | None
    made: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class UnmatchedFacts:
    """Facts of a connection that the net does not have, or that another one has (``twin``)."""

    net: Net
    facts: ConnectionFacts
    twin: ConnectionFacts | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolution:
    """A network with every layout, transfer and connection worked out.

    ``network`` has the transfers made from its connections (`expand`); ``troubles`` are those that
    could not be made. ``layouts`` has one row per SubDevice, in bus order. ``single`` are FSoE
    transfers that found no partner in the opposite direction.
    """

    network: NetworkConfig
    layouts: tuple[DeviceLayout | None, ...]
    transfers: tuple[ResolvedTransfer, ...]
    connections: tuple[Connection, ...]
    single: tuple[ResolvedTransfer, ...]
    unmatched_facts: tuple[UnmatchedFacts, ...]
    troubles: tuple[ConnectionTrouble, ...] = ()


@without_collector
def resolve(network: NetworkConfig) -> Resolution:
    """Work out layouts, transfer ends and connections of a network. Never raises."""
    layouts = Layouts()
    by_name: dict[str, SubDevice] = {}
    for sub in network.subdevices:
        by_name.setdefault(sub.name, sub)
    finder = Finder(by_name, layouts)
    transfers = _transfers(network, finder)
    expansion = expand(network, transfers, by_name, finder, layouts)
    if expansion.network is not network:
        network = expansion.network
        transfers = _transfers(network, finder)
    pairing = _Pairing(by_name, layouts, expansion.made)
    per_net: dict[int, _Rows] = {}
    for row in transfers:
        if row.transfer.kind is TransferKind.FSOE:
            per_net.setdefault(id(row.net), []).append(row)
    for net in network.nets:
        pairing.add(net, per_net.get(id(net), []), expansion.left_out)
    return Resolution(
        network=network,
        layouts=tuple(
            layouts.of(s.device) if s.device is not None else None for s in network.subdevices
        ),
        transfers=transfers,
        connections=tuple(pairing.connections),
        single=tuple(pairing.single),
        unmatched_facts=tuple(pairing.unmatched),
        troubles=(*expansion.troubles, *pairing.troubles),
    )


def _transfers(network: NetworkConfig, finder: Finder) -> tuple[ResolvedTransfer, ...]:
    return tuple(
        ResolvedTransfer(
            net=net,
            transfer=transfer,
            source=finder.end(transfer.source),
            destination=finder.end(transfer.destination),
        )
        for net in network.nets
        for transfer in net.transfers
    )


def shared_modules(ends: list[tuple[str, str]]) -> set[str]:
    """Return the modules that every one of these transfers touches."""
    return set(ends[0]).intersection(*map(set, ends[1:])) if ends else set()


def main_instance_of(net: Net, ends: list[tuple[str, str]]) -> str | None:
    """Return the name of the SubDevice with the MainInstance of a net.

    The file says it (``safety_master``); without that, the one SubDevice all FSoE transfers share.
    """
    if net.safety_master is not None:
        return net.safety_master
    common = shared_modules(ends)
    return common.pop() if len(common) == 1 else None


_Rows = list[ResolvedTransfer]


@dataclass(frozen=True, slots=True)
class _Couple:
    """Two transfers that belong together, with the slots their frames stand in."""

    down: ResolvedTransfer
    up: ResolvedTransfer
    slots: frozenset[int]
    sub_slots: frozenset[int]

    def may_be(self, facts: ConnectionFacts) -> bool:
        """Whether facts can be those of this connection; frames that nobody sees speak for it."""
        return _allows(self.slots, facts.slot) and _allows(self.sub_slots, facts.sub_slot)


def _allows(slots: frozenset[int], stated: int | None) -> bool:
    return stated is None or not slots or stated in slots


def _only(slots: frozenset[int]) -> int | None:
    return next(iter(slots)) if len(slots) == 1 else None


class _Pairing:
    """Finds the two transfers of each connection, and the facts that are stated of it."""

    def __init__(
        self, by_name: dict[str, SubDevice], layouts: Layouts, made: frozenset[int]
    ) -> None:
        self._by_name = by_name
        self._layouts = layouts
        self._made = made
        self._numbers: dict[int, dict[tuple[int, int], int]] = {}
        self._names: set[str] = set()
        self.connections: list[Connection] = []
        self.single: _Rows = []
        self.unmatched: list[UnmatchedFacts] = []
        self.troubles: list[ConnectionTrouble] = []

    def add(self, net: Net, rows: _Rows, left_out: frozenset[int]) -> None:
        """Add the connections of a net; the facts in ``left_out`` are of none."""
        ends = [(r.transfer.source.module, r.transfer.destination.module) for r in rows]
        groups = _by_partner(rows, main_instance_of(net, ends))
        stated: dict[tuple[str, str], list[ConnectionFacts]] = {}
        for fact in net.connections:
            if id(fact) not in left_out:
                stated.setdefault((fact.main, fact.sub), []).append(fact)
        for (main, sub), (to_sub, to_main) in groups.items():
            both, alone = _couple(to_sub, to_main)
            self.single.extend(alone)
            couples = [self._numbered(down, up) for down, up in both]
            facts = self._assign(net, stated.pop((main, sub), []), couples)
            if main in self._by_name and sub in self._by_name:
                self._connect(net, main, sub, couples, facts)
        for facts_of_pair in stated.values():
            self.unmatched += [UnmatchedFacts(net=net, facts=f) for f in facts_of_pair]

    def _numbered(self, down: ResolvedTransfer, up: ResolvedTransfer) -> _Couple:
        return _Couple(
            down,
            up,
            slots=self._slots(down.source, up.destination),
            sub_slots=self._slots(up.source, down.destination),
        )

    def _slots(self, *ends: ResolvedEnd) -> frozenset[int]:
        found: set[int] = set()
        for end in ends:
            if end.block is None or end.layout is None:
                continue
            numbers = self._numbers.get(id(end.layout))
            if numbers is None:
                numbers = self._numbers[id(end.layout)] = slot_numbers(end.layout)
            if end.block.key in numbers:
                found.add(numbers[end.block.key])
        return frozenset(found)

    def _assign(
        self, net: Net, stated: list[ConnectionFacts], couples: list[_Couple]
    ) -> dict[int, ConnectionFacts]:
        """Return the facts of each couple; those that name a slot choose first."""
        taken: dict[int, ConnectionFacts] = {}
        stated = sorted(stated, key=lambda f: f.slot is None and f.sub_slot is None)
        for fact in stated:
            meant = [n for n, couple in enumerate(couples) if couple.may_be(fact)]
            # Frames nobody can number are meant only when no others are.
            meant = [n for n in meant if couples[n].slots or fact.slot is None] or meant
            free = [n for n in meant if n not in taken]
            if not free:
                twin = taken[meant[0]] if meant else None
                self.unmatched.append(UnmatchedFacts(net=net, facts=fact, twin=twin))
            elif len(free) > 1:
                self._several(net, fact, [couples[n] for n in free])
            else:
                taken[free[0]] = fact
        return taken

    def _several(self, net: Net, fact: ConnectionFacts, couples: list[_Couple]) -> None:
        main, sub = self._by_name.get(fact.main), self._by_name.get(fact.sub)
        if main is None or sub is None:
            return  # said of the name
        slots = frozenset().union(*(c.slots for c in couples))
        key, there, numbers = "main", main, slots
        if fact.slot is not None or len(slots) < len(couples):
            key, there, numbers = "sub", sub, frozenset().union(*(c.sub_slots for c in couples))
        pairs = frame_pairs(self._layouts.of(there.device)) if there.device is not None else ()
        self.troubles.append(
            ConnectionTrouble(
                net=net,
                facts=fact,
                obstacle=Obstacle.SEVERAL,
                key=key,
                pairs=tuple(p for p in pairs if p.slot in numbers),
                name=there.name,
            )
        )

    def _connect(
        self,
        net: Net,
        main: str,
        sub: str,
        couples: list[_Couple],
        facts: dict[int, ConnectionFacts],
    ) -> None:
        for number, couple in enumerate(couples):
            self.connections.append(
                Connection(
                    name=_unique(f"{main}-{sub}", self._names),
                    net=net,
                    main=self._by_name[main],
                    sub=self._by_name[sub],
                    slot=_only(couple.slots),
                    sub_slot=_only(couple.sub_slots),
                    to_sub=couple.down,
                    to_main=couple.up,
                    facts=facts.get(number),
                    made=id(couple.down.transfer) in self._made,
                )
            )


def _unique(name: str, used: set[str]) -> str:
    """Return the name, with a counter where it is taken; a SubDevice may itself end in ``-2``."""
    found, number = name, 1
    while found in used:
        number += 1
        found = f"{name}-{number}"
    used.add(found)
    return found


def _by_partner(rows: _Rows, main_name: str | None) -> dict[tuple[str, str], tuple[_Rows, _Rows]]:
    """Group transfers by (main, sub); rules speak about those that miss the MainInstance."""
    groups: dict[tuple[str, str], tuple[_Rows, _Rows]] = {}
    for row in rows:
        source, destination = row.transfer.source.module, row.transfer.destination.module
        if main_name is None or main_name not in (source, destination):
            # Without a MainInstance the two directions still belong together: take either order.
            main, sub = sorted((source, destination))
        elif source == main_name:
            main, sub = source, destination
        else:
            main, sub = destination, source
        down, up = groups.setdefault((main, sub), ([], []))
        (down if source == main else up).append(row)
    return groups


def _couple(
    to_sub: _Rows, to_main: _Rows
) -> tuple[list[tuple[ResolvedTransfer, ResolvedTransfer]], _Rows]:
    """Match the two directions of each connection between one pair of SubDevices.

    First by the blocks they use (a device's output block has one input block as partner), then in
    file order for what the blocks do not tell.
    """
    if len(to_sub) == len(to_main) == 1:
        return [(to_sub[0], to_main[0])], []
    couples: list[tuple[ResolvedTransfer, ResolvedTransfer]] = []
    left_up = list(to_main)
    waiting: _Rows = []
    for down in to_sub:
        match = next((up for up in left_up if _blocks_agree(down, up)), None)
        if match is None:
            waiting.append(down)
        else:
            left_up.remove(match)
            couples.append((down, match))
    couples.extend(zip(waiting, left_up, strict=False))
    matched = min(len(waiting), len(left_up))
    order = {id(row): n for n, row in enumerate(to_sub)}
    couples.sort(key=lambda pair: order[id(pair[0])])
    return couples, waiting[matched:] + left_up[matched:]


def _blocks_agree(down: ResolvedTransfer, up: ResolvedTransfer) -> bool:
    sub_ok = partner_block(down.destination) == _key(up.source)
    main_ok = partner_block(up.destination) == _key(down.source)
    return sub_ok and main_ok


def _key(end: ResolvedEnd) -> tuple[int, int] | None:
    block = end.block
    return block.key if block is not None else None


def partner_block(end: ResolvedEnd) -> tuple[int, int] | None:
    """Return the key of the input frame that belongs to the output frame this end means.

    ``None`` when the end is no output frame or the device shows no such partner.
    """
    block = end.block
    if block is None or end.layout is None or block.direction is not Direction.OUTPUT:
        return None
    return end.layout.partners.get(block.key)
