"""Resolves names to bytes: the block and sync manager that each end of a transfer refers to.

Pure functions on the model; rules report unresolved ends as diagnostics, the plan uses resolved
ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.pause import without_collector
from fsoe_net.model.bus import Direction, SubDevice, same_devices
from fsoe_net.model.expand import NotExpanded, Obstacle, expand
from fsoe_net.model.names import Names
from fsoe_net.model.network import ConnectionFacts, Net, NetworkConfig, TransferKind
from fsoe_net.model.transfer_ends import ResolvedEnd, ResolvedTransfer, find_end


@dataclass(frozen=True, slots=True, kw_only=True)
class Connection:
    """Two FSoE transfers in opposite directions between a MainInstance and a SubInstance.

    ``slot`` and ``sub_slot`` are the numbers of its frame pairs (`frame_pairs`); ``None`` if a
    frame is not recognised, or both directions use different pairs. ``net_number`` counts the nets,
    ``facts_number`` the connections that the net states.
    """

    name: str
    net_number: int
    net: Net
    main: SubDevice
    sub: SubDevice
    slot: int | None
    sub_slot: int | None
    to_sub: ResolvedTransfer
    to_main: ResolvedTransfer
    facts: ConnectionFacts | None
    facts_number: int | None = None

    @property
    def stated(self) -> ConnectionFacts:
        """The stated facts; if the files state none, facts without values."""
        return self.facts or ConnectionFacts(main=self.main.name, sub=self.sub.name)

    @property
    def made(self) -> bool:
        """Whether its transfers come from a shorthand."""
        return self.to_sub.made


@dataclass(frozen=True, slots=True, kw_only=True)
class UnmatchedFacts:
    """Facts about a connection that is not in the net, or that has other facts (``twin``)."""

    net_number: int
    net: Net
    facts: ConnectionFacts
    twin: ConnectionFacts | None = None


@dataclass(frozen=True, kw_only=True)  # no slots, as derived values are cached
class Resolution:
    """A network with every transfer and connection resolved.

    ``network`` includes the transfers created from its connections (`expand`); ``troubles`` are the
    connections without them. ``single``: FSoE transfers without a partner in the opposite
    direction. Parts are numbered by their index in their tuple.
    """

    network: NetworkConfig
    transfers: tuple[ResolvedTransfer, ...]
    connections: tuple[Connection, ...]
    single: tuple[ResolvedTransfer, ...]
    unmatched_facts: tuple[UnmatchedFacts, ...]
    troubles: tuple[NotExpanded, ...] = ()

    @cached_property
    def numbers(self) -> Mapping[str, int]:
        """The number of each SubDevice by name; of two with one name, the first."""
        names = [sub.name for sub in self.network.subdevices]
        return {name: len(names) - 1 - n for n, name in enumerate(reversed(names))}

    @cached_property
    def device_numbers(self) -> tuple[int, ...]:
        """For each SubDevice, the number of the first one with the same device."""
        return same_devices(sub.device for sub in self.network.subdevices)


@without_collector
def resolve(network: NetworkConfig) -> Resolution:
    """Determine layouts, transfer ends and connections of a network. Never raises."""
    by_name: dict[str, SubDevice] = {}
    # With a duplicate name the first one counts; the rule for names reports the second.
    for sub in network.subdevices:
        by_name.setdefault(sub.name, sub)
    stated = [len(net.transfers) for net in network.nets]
    transfers = _transfers(network, by_name, stated)
    expansion = expand(network, transfers, by_name)
    if expansion.network is not network:
        network = expansion.network
        # Created transfers are resolved like stated ones, so that all rules see them.
        transfers = _transfers(network, by_name, stated)
    pairing = _Pairing(by_name)
    per_net: list[_Rows] = [[] for _ in network.nets]
    for row in transfers:
        if row.transfer.kind is TransferKind.FSOE:
            per_net[row.net_number].append(row)
    for number, (net, rows) in enumerate(zip(network.nets, per_net, strict=True)):
        pairing.add(number, net, rows, expansion.left_out)
    return Resolution(
        network=network,
        transfers=transfers,
        connections=tuple(pairing.connections),
        single=tuple(pairing.single),
        unmatched_facts=tuple(pairing.unmatched),
        troubles=(*expansion.troubles, *pairing.troubles),
    )


def _transfers(
    network: NetworkConfig, by_name: Mapping[str, SubDevice], stated: list[int]
) -> tuple[ResolvedTransfer, ...]:
    """Look up all ends; ``stated`` is the number of transfers of each net in its file."""
    rows: list[ResolvedTransfer] = []
    for net_number, net in enumerate(network.nets):
        for number, transfer in enumerate(net.transfers):
            source, destination = transfer.source, transfer.destination
            rows.append(
                ResolvedTransfer(
                    number=len(rows),
                    net_number=net_number,
                    net=net,
                    transfer=transfer,
                    source=find_end(source, by_name.get(source.module), Direction.INPUT),
                    destination=find_end(
                        destination, by_name.get(destination.module), Direction.OUTPUT
                    ),
                    made=number >= stated[net_number],
                )
            )
    return tuple(rows)


def shared_modules(ends: list[tuple[str, str]]) -> set[str]:
    """Return the modules that are part of every one of these transfers."""
    return set.intersection(*map(set, ends)) if ends else set()


def main_instance_of(net: Net, ends: list[tuple[str, str]]) -> str | None:
    """Return the name of the SubDevice with the MainInstance of a net.

    The file states it (``safety_master``); otherwise it is the one SubDevice that all FSoE
    transfers share.
    """
    if net.safety_master is not None:
        return net.safety_master
    common = shared_modules(ends)
    return common.pop() if len(common) == 1 else None


_Rows = list[ResolvedTransfer]
_Stated = dict[int, ConnectionFacts]  # by its number in the net


@dataclass(frozen=True, slots=True)
class _Couple:
    """Two transfers that belong together, with the slots of their frames."""

    down: ResolvedTransfer
    up: ResolvedTransfer
    slots: frozenset[int]
    sub_slots: frozenset[int]

    def may_be(self, facts: ConnectionFacts) -> bool:
        """Whether facts can be those of this connection; unknown frames count as a match."""
        return _allows(self.slots, facts.slot) and _allows(self.sub_slots, facts.sub_slot)


def _with_slots(down: ResolvedTransfer, up: ResolvedTransfer) -> _Couple:
    return _Couple(
        down,
        up,
        slots=_slots(down.source, up.destination),
        sub_slots=_slots(up.source, down.destination),
    )


def _slots(*ends: ResolvedEnd) -> frozenset[int]:
    found: set[int] = set()
    for end in ends:
        if end.block is not None and (layout := end.layout) is not None:
            slot = layout.slots.get(end.block.key)
            if slot is not None:
                found.add(slot)
    return frozenset(found)


def _allows(slots: frozenset[int], stated: int | None) -> bool:
    return stated is None or not slots or stated in slots


def _only(slots: frozenset[int]) -> int | None:
    return next(iter(slots)) if len(slots) == 1 else None


class _Pairing:
    """Finds the two transfers of each connection, and the facts stated about it."""

    def __init__(self, by_name: dict[str, SubDevice]) -> None:
        self._by_name = by_name
        self._names = Names(between="-")
        self.connections: list[Connection] = []
        self.single: _Rows = []
        self.unmatched: list[UnmatchedFacts] = []
        self.troubles: list[NotExpanded] = []

    def add(
        self, net_number: int, net: Net, rows: _Rows, left_out: frozenset[tuple[int, int]]
    ) -> None:
        """Add the connections of a net; facts in ``left_out`` are not assigned."""
        ends = [(r.transfer.source.module, r.transfer.destination.module) for r in rows]
        groups = _by_partner(rows, main_instance_of(net, ends))
        stated: dict[tuple[str, str], _Stated] = {}
        # A connection that could not be expanded has no frames; this is already reported.
        for number, fact in enumerate(net.connections):
            if (net_number, number) not in left_out:
                stated.setdefault((fact.main, fact.sub), {})[number] = fact
        for (main, sub), (to_sub, to_main) in groups.items():
            both, alone = _couple(to_sub, to_main)
            self.single.extend(alone)
            couples = [_with_slots(down, up) for down, up in both]
            facts = self._assign(net_number, net, stated.pop((main, sub), {}), couples)
            if main in self._by_name and sub in self._by_name:
                self._connect(net_number, net, main, sub, couples, facts)
        # Facts without a transfer: usually a typing error in a name.
        for facts_of_pair in stated.values():
            self.unmatched += [
                UnmatchedFacts(net_number=net_number, net=net, facts=f)
                for f in facts_of_pair.values()
            ]

    def _assign(
        self, net_number: int, net: Net, stated: _Stated, couples: list[_Couple]
    ) -> dict[int, int]:
        """Return the number of the facts of each couple; those with a slot are assigned first."""
        taken: dict[int, int] = {}
        order = sorted(stated, key=lambda n: stated[n].slot is None and stated[n].sub_slot is None)
        for number in order:
            fact = stated[number]
            meant = [n for n, couple in enumerate(couples) if couple.may_be(fact)]
            # Frames without a number are a fallback.
            meant = [n for n in meant if couples[n].slots or fact.slot is None] or meant
            free = [n for n in meant if n not in taken]
            # Two connections claim one frame pair: the second one is reported with its twin.
            if not free:
                twin = stated[taken[meant[0]]] if meant else None
                self.unmatched.append(
                    UnmatchedFacts(net_number=net_number, net=net, facts=fact, twin=twin)
                )
            elif len(free) > 1:
                self._several(net, fact, [couples[n] for n in free])
            else:
                taken[free[0]] = number
        return taken

    def _several(self, net: Net, fact: ConnectionFacts, couples: list[_Couple]) -> None:
        main, sub = self._by_name.get(fact.main), self._by_name.get(fact.sub)
        if main is None or sub is None:
            return  # reported for the name
        slots = frozenset().union(*(c.slots for c in couples))
        key, there, numbers = "main", main, slots
        if fact.slot is not None or len(slots) < len(couples):
            key, there, numbers = "sub", sub, frozenset().union(*(c.sub_slots for c in couples))
        pairs = there.layout.frame_pairs if there.layout is not None else ()
        self.troubles.append(
            NotExpanded(
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
        net_number: int,
        net: Net,
        main: str,
        sub: str,
        couples: list[_Couple],
        facts: dict[int, int],
    ) -> None:
        for number, couple in enumerate(couples):
            facts_number = facts.get(number)
            self.connections.append(
                Connection(
                    name=self._names.add(f"{main}-{sub}"),
                    net_number=net_number,
                    net=net,
                    main=self._by_name[main],
                    sub=self._by_name[sub],
                    slot=_only(couple.slots),
                    sub_slot=_only(couple.sub_slots),
                    to_sub=couple.down,
                    to_main=couple.up,
                    facts=None if facts_number is None else net.connections[facts_number],
                    facts_number=facts_number,
                )
            )


def _by_partner(rows: _Rows, main_name: str | None) -> dict[tuple[str, str], tuple[_Rows, _Rows]]:
    """Group transfers by (main, sub); rules report those without the MainInstance."""
    groups: dict[tuple[str, str], tuple[_Rows, _Rows]] = {}
    for row in rows:
        source, destination = row.transfer.source.module, row.transfer.destination.module
        if main_name is None or main_name not in (source, destination):
            # Without a MainInstance the two directions still belong together, in either order.
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

    First by their blocks (an output block of a device has one input block as partner), then the
    rest in file order.
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
    # In file order, because connections are named and numbered in this order.
    couples.sort(key=lambda pair: pair[0].number)
    return couples, waiting[matched:] + left_up[matched:]


def _blocks_agree(down: ResolvedTransfer, up: ResolvedTransfer) -> bool:
    sub_ok = partner_block(down.destination) == _key(up.source)
    main_ok = partner_block(up.destination) == _key(down.source)
    return sub_ok and main_ok


def _key(end: ResolvedEnd) -> tuple[int, int] | None:
    block = end.block
    return block.key if block is not None else None


def partner_block(end: ResolvedEnd) -> tuple[int, int] | None:
    """Return the key of the input frame that belongs to the output frame of this end.

    ``None`` if the end is not an output frame or the device has no such partner.
    """
    block = end.block
    if block is None or end.layout is None or block.direction is not Direction.OUTPUT:
        return None
    return end.layout.partners.get(block.key)
