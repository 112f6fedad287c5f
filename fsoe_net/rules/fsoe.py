"""FSN301 … FSN306, FSN425 and FSN601: the FSoE facts of the connections, and times."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.diag.diagnostic import Related
from fsoe_net.diag.words import counted
from fsoe_net.model.bus import Direction, SubDevice, Watchdog
from fsoe_net.model.network import Bus, ConnectionFacts, Net, NetworkConfig, TransferKind
from fsoe_net.rules.context import Context, few

# Bus cycles of one FSoE cycle at best (two hops, each sampled by one frame and delivered by the
# next), plus one for jitter: below that the watchdog expires without any fault.
WATCHDOG_BUS_CYCLES = 5
_TWINSAFE_DEFAULT_MS = 100
_SM_WATCHDOG_MS = 100  # the default of every EtherCAT device
_MAX_APP_PARAMETER_BYTES = 256


def check_fsoe(ctx: Context) -> None:
    """Check addresses, connection IDs, parameters and watchdog times."""
    stated = [fact for net in ctx.resolution.network.nets for fact in net.connections]
    _unique(ctx, stated, "FSN301", "address", "FSoE address")
    _unique(ctx, stated, "FSN302", "connection_id", "connection ID")
    for fact in stated:
        _values(ctx, fact)
    _timing(ctx)


def _unique(
    ctx: Context, stated: Sequence[ConnectionFacts], code: str, key: str, what: str
) -> None:
    seen: dict[int, ConnectionFacts] = {}
    # The first use is kept, so that a duplicate can refer to it.
    for fact in stated:
        value: int | None = getattr(fact, key)
        if value is None:
            continue
        first = seen.setdefault(value, fact)
        # A SubDevice has one FSoE address, even if it has several connections.
        same_device = code == "FSN301" and first.sub == fact.sub
        if first is not fact and not same_device:
            ctx.add(
                code,
                fact.at(key),
                f"{what} {value} is used twice; it must be unique in the whole network, also "
                "with several safety masters",
                hint="give each connection its own, and set the device to the same value",
                related=(Related(span=first.at(key), message=f"first used by {first.sub}"),),
            )


def _values(ctx: Context, fact: ConnectionFacts) -> None:
    if fact.address in (0, 0xFFFF):
        ctx.add(
            "FSN303",
            fact.at("address"),
            f"FSoE address {fact.address} is the value of devices without an address",
            hint="set the address at the device (1 … 65534) and write it here",
        )
    if fact.connection_id == 0:
        ctx.add(
            "FSN304",
            fact.at("connection_id"),
            "connection ID 0 is refused by every SubInstance (error 3)",
            hint="write a number from 1 to 65535, unique in the network",
        )
    if fact.watchdog_ms == 0:
        ctx.add(
            "FSN305",
            fact.at("watchdog_ms"),
            "a watchdog of 0 ms is refused (error 9), some devices even hang on it",
            hint="write the time in milliseconds, 1 … 65535",
        )
    if len(fact.app_parameters) > _MAX_APP_PARAMETER_BYTES:
        ctx.add(
            "FSN306",
            fact.at("app_parameters"),
            f"{len(fact.app_parameters)} bytes of application parameters; more than "
            f"{_MAX_APP_PARAMETER_BYTES} were never seen to work",
            hint="check the parameter list of the device",
        )


def _timing(ctx: Context) -> None:
    network = ctx.resolution.network
    _sync_manager_watchdogs(ctx)
    # Without a bus cycle, a watchdog cannot be compared.
    if network.cycle_ns is None:
        return
    alone = (network.cycle_ns / 1e6,)
    ways_of: list[list[tuple[int | None, tuple[float, ...]]]] = [[] for _ in network.nets]
    for c in ctx.resolution.connections:
        cycles_ns = network.way_cycles_ns(c.main, c.sub)
        if cycles_ns is not None:
            ways_of[c.net_number].append((c.facts_number, tuple(ns / 1e6 for ns in cycles_ns)))
    for net, ways in zip(network.nets, ways_of, strict=True):
        of_facts = dict(ways)
        for number, fact in enumerate(net.connections):
            _short_watchdog(ctx, fact, of_facts.get(number, alone))
        # The slowest connection decides about the watchdog shared by all in the net.
        slowest = max((cycles for _, cycles in ways), key=_least_ms, default=alone)
        _unstated_watchdogs(ctx, net, slowest)


def _short_watchdog(ctx: Context, fact: ConnectionFacts, cycles: Sequence[float]) -> None:
    least_ms = _least_ms(cycles)
    if fact.watchdog_ms and fact.watchdog_ms < least_ms:
        ctx.add(
            "FSN601",
            fact.at("watchdog_ms"),
            f"watchdog {fact.watchdog_ms} ms is shorter than {_least_words(cycles)}; it would "
            "expire without any fault",
            hint=f"at least {least_ms:g} ms plus the cycle times of both devices, or a "
            "shorter bus cycle; then calculate the reaction times again, and accept again",
        )


def _unstated_watchdogs(ctx: Context, net: Net, cycles: Sequence[float]) -> None:
    """Compare the usual watchdog with the slowest connection of a net without stated watchdogs."""
    unstated = not any(f.watchdog_ms for f in net.connections)
    has_fsoe = any(t.kind is TransferKind.FSOE for t in net.transfers)
    # If one watchdog is stated, the others count as chosen.
    if unstated and has_fsoe and _least_ms(cycles) > _TWINSAFE_DEFAULT_MS:
        most_ms = _TWINSAFE_DEFAULT_MS / WATCHDOG_BUS_CYCLES
        ctx.add(
            "FSN601",
            net.span,
            f"the usual FSoE watchdog of {_TWINSAFE_DEFAULT_MS} ms is shorter than "
            f"{_least_words(cycles)}",
            hint=f"bus cycles of at most {most_ms:g} ms (control_frequency of at least "
            f"{1000 / most_ms:g} Hz); state the watchdogs of the safety project as "
            "watchdog_ms, and calculate the reaction times again",
        )


def _least_ms(cycles: Sequence[float]) -> float:
    """Return the shortest watchdog, ms: an FSoE cycle at best, and a bus cycle for jitter.

    Args:
        cycles: Cycle of each bus on the path of a frame, ms. Both ends wait twice for their own
            bus.
    """
    return 2 * (cycles[0] + cycles[-1]) + max(cycles)


def _least_words(cycles: Sequence[float]) -> str:
    if len(cycles) == 1:
        return f"{counted(WATCHDOG_BUS_CYCLES, 'bus cycle')} of {cycles[0]:g} ms"
    buses = ", ".join(f"{c:g} ms" for c in cycles)
    return f"{_least_ms(cycles):g} ms, an FSoE cycle over buses of {buses}"


def _sync_manager_watchdogs(ctx: Context) -> None:
    """FSN425: SubDevices whose outputs need frames more often than once per bus cycle."""
    network = ctx.resolution.network
    buses: Sequence[Bus | NetworkConfig] = network.buses or (network,)
    for number, bus in enumerate(buses):
        cycle_ms = (bus.cycle_ns or 0) / 1e6
        if cycle_ms < _SM_WATCHDOG_MS:
            continue
        names = [
            sub.name
            for sub in network.subdevices
            # Each bus has its own cycle.
            if (not network.buses or sub.master_id == number) and _is_watched(sub)
        ]
        if names:
            ctx.add(
                "FSN425",
                bus.at("cycle_us" if "cycle_us" in bus.fields else "control_frequency"),
                f"the bus cycle is {cycle_ms:g} ms; the sync manager watchdog of {few(names)} "
                f"expires after {_SM_WATCHDOG_MS} ms unless another time is set, and the "
                "SubDevice leaves OP (AL status 0x001b)",
                hint=f"a bus cycle well below {_SM_WATCHDOG_MS} ms, as FSoE needs anyway",
            )


def _is_watched(sub: SubDevice) -> bool:
    return sub.layout is not None and any(
        sm.sm.direction is Direction.OUTPUT
        and sm.sm.watchdog is not Watchdog.DISABLE
        and sm.registered
        for sm in sub.layout.managers
    )
