"""FSN508, FSN509, FSN510, FSN513: FSoE values of the devices compared with the network."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from fsoe_net.diag.diagnostic import FindingList, Related
from fsoe_net.diag.words import counted
from fsoe_net.model.network import ConnectionFacts, NetworkConfig
from fsoe_net.model.scan import ScannedConnection, ScannedSubDevice
from fsoe_net.rules.context import ACCEPTED, SECURED, few


@dataclass(frozen=True, slots=True)
class _Value:
    """One kind of value that a MainInstance reports of a connection."""

    code: str
    key: str
    what: str
    unit: str
    planned: Callable[[ConnectionFacts], int | None]
    found: Callable[[ScannedConnection], int | None]


_VALUES = (
    _Value("FSN508", "address", "FSoE address", "", lambda c: c.address, lambda r: r.address),
    _Value(
        "FSN509",
        "connection_id",
        "connection ID",
        "",
        lambda c: c.connection_id,
        lambda r: r.connection_id,
    ),
    _Value(
        "FSN510",
        "watchdog_ms",
        "FSoE watchdog",
        " ms",
        lambda c: c.watchdog_ms,
        lambda r: r.watchdog_ms,
    ),
)


def check_fsoe_values(
    out: FindingList, network: NetworkConfig, found: Mapping[str, ScannedSubDevice]
) -> None:
    """Compare addresses of the SubInstances, and the connections of the MainInstances.

    Args:
        out: Takes the findings.
        network: With what is stated of its connections.
        found: SubDevices on the bus by name; those that are not there have been named elsewhere.
    """
    stated = [fact for net in network.nets for fact in net.connections]
    mains = dict.fromkeys(f.main for f in stated)
    given = {
        name: _given(there, is_main=name in mains)
        for name, there in found.items()
        if there.fsoe is not None
    }
    unread = _addresses(out, stated, found, given)
    for main in mains:
        facts = [f for f in stated if f.main == main and f.main in found]
        if facts:
            unread += _connections(out, main, facts, found[main], given)
    for fact in dict.fromkeys(unread):
        out.add(
            "FSN513",
            fact.at("sub"),
            f"FSoE values of {fact.sub} cannot be read over the bus, so they were not compared",
            hint="compare address, connection ID and watchdog with its switches and the safety "
            "project",
        )


def _given(there: ScannedSubDevice, *, is_main: bool) -> list[ScannedConnection]:
    """Return what a device reports of its SubInstances.

    Not every device reports on which side of a connection it is; the network does.
    """
    assert there.fsoe is not None  # noqa: S101  (checked by the caller)
    return [*there.fsoe.given, *(() if is_main else there.fsoe.connections)]


def _addresses(
    out: FindingList,
    stated: list[ConnectionFacts],
    found: Mapping[str, ScannedSubDevice],
    given: Mapping[str, list[ScannedConnection]],
) -> list[ConnectionFacts]:
    """Compare the FSoE address of each SubInstance; return whose cannot be read."""
    facts: dict[str, ConnectionFacts] = {}
    for fact in stated:
        if fact.address is not None and fact.sub in found:
            facts.setdefault(fact.sub, fact)
    read: dict[str, int] = {}
    for name, fact in facts.items():
        own = _own_addresses(found[name], given.get(name, ()))
        if own:
            read[name] = fact.address if fact.address in own else own[0]
    owners: dict[int | None, str] = {}
    for name, fact in facts.items():
        owners.setdefault(fact.address, name)
    done: set[str] = set()
    for name, address in read.items():
        fact = facts[name]
        if address == fact.address or name in done:
            continue
        owner = owners.get(address, "")
        if owner and read.get(owner) == fact.address:
            done |= {name, owner}
            _exchanged(out, fact, facts[owner], found)
            continue
        whose = f", the address of {owner}" if owner else ""
        out.add(
            "FSN508",
            fact.at("address"),
            f"{name} (position {found[name].position}) has FSoE address {address}{whose}; the "
            f"network states {fact.address}",
            hint="find out which one the safety project has, and correct the other one; the "
            f"connection is refused (error 6) while they differ{ACCEPTED}",
        )
    return [fact for name, fact in facts.items() if name not in read]


def _own_addresses(there: ScannedSubDevice, given: Sequence[ScannedConnection]) -> list[int]:
    """Return the FSoE addresses of a SubDevice; without its own those its MainInstance names."""
    if there.fsoe is not None and there.fsoe.addresses:
        return list(there.fsoe.addresses)
    return [row.address for row in given if row.address]  # 0: not known so far


def _exchanged(
    out: FindingList,
    one: ConnectionFacts,
    two: ConnectionFacts,
    found: Mapping[str, ScannedSubDevice],
) -> None:
    out.add(
        "FSN508",
        one.at("address"),
        f"{one.sub} and {two.sub} are exchanged: position {found[one.sub].position} has FSoE "
        f"address {two.address}, position {found[two.sub].position} has {one.address}",
        hint=f"{SECURED}were the two devices, or their cables, put in each other's place?",
        related=(Related(span=two.at("address"), message=f"{two.sub} is expected here"),),
    )


def _connections(
    out: FindingList,
    main: str,
    facts: list[ConnectionFacts],
    there: ScannedSubDevice,
    given: Mapping[str, list[ScannedConnection]],
) -> list[ConnectionFacts]:
    """Compare the connections a MainInstance reports with what is stated.

    Of one that reports nothing, compare what its SubInstances were given.

    Returns:
        Those of which nothing can be read.
    """
    rows = list(there.fsoe.connections) if there.fsoe is not None else []
    if not rows:
        return _as_given(out, main, [f for f in facts if _is_stated(f)], given)
    pairs = _paired(facts, rows)
    for value in _VALUES:
        _compare(out, main, value, pairs)
    unpaired = [f.sub for f in facts if not any(f is p for p, _ in pairs)]
    if unpaired:
        out.add(
            "FSN513",
            facts[-1].at("main"),
            f"{main} reports {counted(len(rows), 'connection')}; nothing of {few(unpaired)}",
            hint="does the safety project in the device have these connections?",
        )
    return []


def _as_given(
    out: FindingList,
    main: str,
    facts: list[ConnectionFacts],
    given: Mapping[str, list[ScannedConnection]],
) -> list[ConnectionFacts]:
    """Compare what SubInstances report of a connection that has been up; return the others."""
    pairs: list[tuple[ConnectionFacts, ScannedConnection]] = []
    for fact in facts:
        rows = given.get(fact.sub, [])
        row = next((r for r in rows if r.address == fact.address), rows[0] if rows else None)
        if row is not None and row.connection_id and row.watchdog_ms:  # 0: nothing given so far
            pairs.append((fact, row))
    for value in _VALUES[1:]:  # the address has been compared
        _compare(out, main, value, pairs, by_sub=True)
    return [f for f in facts if not any(f is p for p, _ in pairs)]


def _is_stated(fact: ConnectionFacts) -> bool:
    return fact.connection_id is not None or fact.watchdog_ms is not None


def _paired(
    facts: list[ConnectionFacts], rows: list[ScannedConnection]
) -> list[tuple[ConnectionFacts, ScannedConnection]]:
    """Pair by address and connection ID, then by one of them, then by order."""
    pairs: list[tuple[ConnectionFacts, ScannedConnection]] = []
    free_facts, free_rows = list(facts), list(rows)

    def take(agree: Callable[[ConnectionFacts, ScannedConnection], bool]) -> None:
        for fact in list(free_facts):
            row = next((r for r in free_rows if agree(fact, r)), None)
            if row is not None:
                pairs.append((fact, row))
                free_facts.remove(fact)
                free_rows.remove(row)

    def same(one: int | None, two: int | None) -> bool:
        return one is not None and one == two

    take(lambda f, r: same(f.address, r.address) and same(f.connection_id, r.connection_id))
    take(lambda f, r: same(f.address, r.address))
    take(lambda f, r: same(f.connection_id, r.connection_id))
    pairs.extend(zip(free_facts, free_rows, strict=False))
    return pairs


def _compare(
    out: FindingList,
    main: str,
    value: _Value,
    pairs: list[tuple[ConnectionFacts, ScannedConnection]],
    *,
    by_sub: bool = False,
) -> None:
    wrong = [
        (fact, planned, found)
        for fact, row in pairs
        if (planned := value.planned(fact)) is not None
        and (found := value.found(row)) is not None
        and planned != found
    ]
    done: set[int] = set()
    for number, (fact, planned, found) in enumerate(wrong):
        if number in done:
            continue
        crossed = next(
            (
                n
                for n in range(number + 1, len(wrong))
                if value.key != "watchdog_ms" and wrong[n][1:] == (found, planned)
            ),
            None,
        )
        if crossed is not None:
            done.add(crossed)
            other = wrong[crossed][0]
            out.add(
                value.code,
                fact.at(value.key),
                f"{main}: the {value.what}s of {fact.sub} and {other.sub} are exchanged, {found} "
                f"and {planned}; the network states {planned} and {found}",
                hint=f"correct them here or in the safety project{ACCEPTED}",
                related=(Related(span=other.at(value.key), message=f"{other.sub}"),),
            )
            continue
        has = f"has {value.what} {found}{value.unit}"
        whose = f"{fact.sub} {has}, given by {main}" if by_sub else f"{main} {has} for {fact.sub}"
        out.add(
            value.code,
            fact.at(value.key),
            f"{whose}; the network states {planned}{value.unit}",
            hint=f"the safety project in the device counts: correct it there or here{ACCEPTED}",
        )
