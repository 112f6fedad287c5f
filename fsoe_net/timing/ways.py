"""Times of a safety function: one way per connection, with the times of its device."""

from __future__ import annotations

from fsoe_net.model.resolve import Connection
from fsoe_net.model.safety import ElementKind
from fsoe_net.timing.elements import FunctionParts
from fsoe_net.timing.formulas import PartTimes, SignalWay
from fsoe_net.timing.transit import Transit


def part_times(parts: FunctionParts, bus: Transit, drift: float) -> PartTimes | None:
    """Return the times of a safety function; ``None`` if a bus cycle is not stated.

    Args:
        parts: Its elements and connections.
        bus: Bus cycles, and the number of cycles that a frame needs.
        drift: Relative error by which a device clock may be slow; watchdogs count as longer by this
            share.
    """
    inputs = [_way(c, parts, ElementKind.INPUT, bus, drift) for c in parts.to_input]
    outputs = [_way(c, parts, ElementKind.OUTPUT, bus, drift) for c in parts.to_output]
    by_bus = [w for w in (*inputs, *outputs) if w is not None]
    if len(by_bus) < len(inputs) + len(outputs):
        return None
    return PartTimes(
        sensor=parts.slowest(ElementKind.SENSOR),
        inputs=(*by_bus[: len(inputs)], *_local(parts, ElementKind.INPUT)),
        outputs=(*by_bus[len(inputs) :], *_local(parts, ElementKind.OUTPUT)),
        actuator=parts.slowest(ElementKind.ACTUATOR),
    )


def watchdog_of(connection: Connection) -> float | None:
    """Return the configured watchdog, ms; ``None`` if it is not stated or 0."""
    facts = connection.facts
    return None if facts is None or not facts.watchdog_ms else float(facts.watchdog_ms)


def _way(
    connection: Connection, parts: FunctionParts, kind: ElementKind, bus: Transit, drift: float
) -> SignalWay | None:
    ends = (connection.main, connection.sub)
    # The logic may be at either end of a connection.
    device, logic = ends if connection.sub.name in parts.logic else ends[::-1]
    cycles = bus.cycles(device, logic)
    to_logic, from_logic = bus.transfer(device, logic), bus.transfer(logic, device)
    if cycles is None or to_logic is None or from_logic is None:
        return None
    return SignalWay(
        connection=connection.name,
        device=parts.slowest(kind, device.name),
        logic=parts.slowest(ElementKind.LOGIC),
        to_logic=to_logic,
        from_logic=from_logic,
        cycle=max(cycles),
        # A device with a slow clock waits longer than its watchdog value.
        watchdog=(watchdog_of(connection) or 0.0) * (1 + drift),
    )


def _local(parts: FunctionParts, kind: ElementKind) -> list[SignalWay]:
    """Return the way inside the logic; none if every input or output has a connection."""
    connections = parts.to_input if kind is ElementKind.INPUT else parts.to_output
    subs = parts.local(kind)
    if connections and not subs:
        return []
    device = max((parts.slowest(kind, s) for s in subs), default=parts.slowest(kind))
    return [SignalWay(device=device, logic=parts.slowest(ElementKind.LOGIC))]
