"""FSN508, FSN509, FSN510, FSN513: FSoE values of the devices compared with the network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from fsoe_net.compare.pairing import VALUES, Value, differing, pair_connections
from fsoe_net.diag.diagnostic import FindingList, Related
from fsoe_net.diag.words import counted
from fsoe_net.model.network import ConnectionFacts, NetworkConfig
from fsoe_net.model.scan import ScannedConnection, ScannedSubDevice
from fsoe_net.rules.context import ACCEPTED, SECURED, few

_Pair = tuple[ConnectionFacts, ScannedConnection]


def check_fsoe_values(
    out: FindingList, network: NetworkConfig, found: Mapping[str, ScannedSubDevice]
) -> None:
    """Compare addresses of the SubInstances, and the connections of the MainInstances.

    Args:
        out: Takes the findings.
        network: The network, with the stated facts of its connections.
        found: SubDevices on the bus by name; missing ones are reported elsewhere.
    """
    stated = [fact for net in network.nets for fact in net.connections]
    mains = dict.fromkeys(f.main for f in stated)
    # Not every device reports whether it is main or sub of a connection; the network states it.
    given = {
        name: [*there.fsoe.given, *(() if name in mains else there.fsoe.connections)]
        for name, there in found.items()
        if there.fsoe is not None
    }
    bus = _Bus(out, found, given)
    unread = bus.check_addresses(stated)
    for main in mains:
        facts = [f for f in stated if f.main == main and f.main in found]
        if facts:
            unread += bus.check_connections(main, facts)
    for fact in dict.fromkeys(unread):
        out.add(
            "FSN513",
            fact.at("sub"),
            f"FSoE values of {fact.sub} cannot be read over the bus, so they were not compared",
            hint="compare address, connection ID and watchdog with its switches and the safety "
            "project",
        )


@dataclass(frozen=True, slots=True)
class _Bus:
    """SubDevices on the bus by name, and what each reports about its SubInstances."""

    out: FindingList
    found: Mapping[str, ScannedSubDevice]
    given: Mapping[str, list[ScannedConnection]]

    def _addresses_of(self, name: str) -> list[int]:
        """Return the FSoE addresses that a SubDevice or else its MainInstance reports."""
        fsoe = self.found[name].fsoe
        if fsoe is not None and fsoe.addresses:
            return list(fsoe.addresses)
        return [row.address for row in self.given.get(name, ()) if row.address]  # 0 if unknown

    def check_addresses(self, stated: Iterable[ConnectionFacts]) -> list[ConnectionFacts]:
        """Compare the FSoE address of each SubInstance; return those that cannot be read."""
        facts: dict[str, ConnectionFacts] = {}
        for fact in stated:
            if fact.address is not None and fact.sub in self.found:
                facts.setdefault(fact.sub, fact)
        read: dict[str, int] = {}
        owners: dict[int | None, str] = {}
        for name, fact in facts.items():
            owners.setdefault(fact.address, name)
            if own := self._addresses_of(name):
                read[name] = fact.address if fact.address in own else own[0]
        done: set[str] = set()
        for name, address in read.items():
            fact = facts[name]
            if address == fact.address or name in done:
                continue
            owner = owners.get(address, "")
            if owner and read.get(owner) == fact.address:
                done |= {name, owner}
                self._exchanged(fact, facts[owner])
                continue
            whose = f", the address of {owner}" if owner else ""
            self.out.add(
                "FSN508",
                fact.at("address"),
                f"{name} (position {self.found[name].position}) has FSoE address {address}{whose}; "
                f"the network states {fact.address}",
                hint="find out which one the safety project has, and correct the other one; the "
                f"connection is refused (error 6) while they differ{ACCEPTED}",
            )
        return [fact for name, fact in facts.items() if name not in read]

    def _exchanged(self, one: ConnectionFacts, two: ConnectionFacts) -> None:
        places = self.found[one.sub].position, self.found[two.sub].position
        self.out.add(
            "FSN508",
            one.at("address"),
            f"{one.sub} and {two.sub} are exchanged: position {places[0]} has FSoE address "
            f"{two.address}, position {places[1]} has {one.address}",
            hint=f"{SECURED}were the two devices, or their cables, put in each other's place?",
            related=(Related(span=two.at("address"), message=f"{two.sub} is expected here"),),
        )

    def check_connections(self, main: str, facts: list[ConnectionFacts]) -> list[ConnectionFacts]:
        """Compare the connections a MainInstance reports with what is stated.

        If it reports nothing, compare the values that its SubInstances received.

        Returns:
            The connections of which nothing can be read.
        """
        fsoe = self.found[main].fsoe
        rows = () if fsoe is None else fsoe.connections
        if not rows:
            return self._check_given(main, facts)
        left, right = dict(enumerate(facts)), dict(enumerate(rows))
        numbers = pair_connections(left, right)
        numbers += list(zip(left, right, strict=False))  # nothing else is known about these
        pairs = [(facts[one], rows[two]) for one, two in numbers]
        for value in VALUES:
            self._compare(main, value, pairs)
        paired = {one for one, _ in numbers}
        unpaired = [f.sub for n, f in enumerate(facts) if n not in paired]
        if unpaired:
            self.out.add(
                "FSN513",
                facts[-1].at("main"),
                f"{main} reports {counted(len(rows), 'connection')}; nothing of {few(unpaired)}",
                hint="does the safety project in the device have these connections?",
            )
        return []

    def _check_given(self, main: str, facts: list[ConnectionFacts]) -> list[ConnectionFacts]:
        """Compare what SubInstances report of a connection that was up; return the others."""
        pairs: list[_Pair] = []
        unread = []
        for fact in facts:
            if fact.connection_id is None and fact.watchdog_ms is None:
                continue
            rows = self.given.get(fact.sub, [])
            row = next((r for r in rows if r.address == fact.address), rows[0] if rows else None)
            if row is not None and row.connection_id and row.watchdog_ms:  # 0: nothing received
                pairs.append((fact, row))
            else:
                unread.append(fact)
        for value in VALUES[1:]:  # the address has already been compared
            self._compare(main, value, pairs, by_sub=True)
        return unread

    def _compare(
        self, main: str, value: Value, pairs: list[_Pair], *, by_sub: bool = False
    ) -> None:
        wrong = [(fact, *both) for fact, row in pairs if (both := differing(value, fact, row))]
        while wrong:
            fact, planned, found = wrong.pop(0)
            # Two crossed values are one mistake; watchdogs are often equal by chance.
            number = next((n for n, row in enumerate(wrong) if row[1:] == (found, planned)), None)
            if number is not None and value.key != "watchdog_ms":
                other = wrong.pop(number)[0]
                self.out.add(
                    value.code,
                    fact.at(value.key),
                    f"{main}: the {value.what}s of {fact.sub} and {other.sub} are exchanged, "
                    f"{found} and {planned}; the network states {planned} and {found}",
                    hint=f"correct them here or in the safety project{ACCEPTED}",
                    related=(Related(span=other.at(value.key), message=other.sub),),
                )
                continue
            has = f"has {value.what} {found}{value.unit}"
            whose = f"{main} {has} for {fact.sub}"
            if by_sub:
                whose = f"{fact.sub} {has}, given by {main}"
            self.out.add(
                value.code,
                fact.at(value.key),
                f"{whose}; the network states {planned}{value.unit}",
                hint=f"the safety project in the device counts: correct it there or here{ACCEPTED}",
            )
